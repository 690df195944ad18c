# SPDX-License-Identifier: MIT
"""unittest with a line of TAP for each test, for tests/run.sh."""

import unittest


class Tap(unittest.TestResult):
    count = 0

    def line(self, word, test, note=""):
        self.count += 1
        print(f"{word} {self.count} - {test.id().removeprefix('__main__.')}{note}", flush=True)

    def addSuccess(self, test):
        self.line("ok", test)

    def addSkip(self, test, reason):
        super().addSkip(test, reason)
        self.line("ok", test, f" # SKIP {reason}")

    def stopTest(self, test):
        super().stopTest(test)
        bad = [
            text
            for case, text in self.failures + self.errors
            if getattr(case, "test_case", case) is test
        ]
        if bad:
            self.line("not ok", test)
            print("".join("# " + row + "\n" for text in bad for row in text.splitlines()), end="")


def main(module):
    """Runs the tests of a module; the exit status."""
    tests = unittest.defaultTestLoader.loadTestsFromModule(module)
    print(f"1..{tests.countTestCases()}")
    result = Tap()
    tests.run(result)
    return 0 if result.wasSuccessful() else 1
