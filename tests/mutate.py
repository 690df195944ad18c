#!/usr/bin/env python3
"""Makes small faults in the library, one at a time, and tells which of them no test sees.

SPDX-License-Identifier: MIT

    python3 tests/mutate.py lib/step/*.c                      an hour of mutants of these files
    python3 tests/mutate.py --seconds 600 --tests step,limits lib/step/contact.c
    python3 tests/mutate.py --list lib/step/contact.c         what would be tried

A mutant is one changed operator, number, return value or deleted statement. Each is built in build-mutants, a
copy of the tree, and the tests named are run until one fails. Results are kept in build-mutants/results.tsv:
called again, it goes on where it was, and a line that has changed since is tried anew. A mutant that survives
names a line that no test needs: write the test, or find that the change makes no difference.
"""
import argparse
import hashlib
import os
import random
import re
import shutil
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
COPY = os.path.join(ROOT, "build-mutants")
BUILD = os.path.join(COPY, "build")
RESULTS = os.path.join(COPY, "results.tsv")

# Tests that are run for a file of this folder, the quick and telling ones first.
TESTS = {
    "base": "memory,workers,context,step",
    "kernels": "kernels,network,oracle,step",
    "file": "json,safetensors,model,corpus",
    "points": "particles,neighbors,resample,limits,step",
    "model": "model,corpus,network,oracle",
    "network": "network,limits,step,oracle",
    "step": "limits,step,oracle",
    "train": "train",
}

OPERATORS = [  # what is written, what it becomes
    (r"(?<![<>=!\-+*/&|])<=(?!=)", "<"), (r"(?<![<>\-=])<(?![<=])(?= )", "<="),
    (r"(?<![<>=\-])>=(?!=)", ">"), (r"(?<= )>(?![>=])(?= )", ">="),
    (r"==", "!="), (r"!=", "=="), (r"&&", "||"), (r"\|\|", "&&"),
    (r"(?<= )\+(?= )", "-"), (r"(?<= )-(?= )", "+"), (r"(?<= )\*(?= )", "/"),
    (r"(?<=[ (\[])1(?=[;,)\] ])", "2"), (r"(?<=[ (\[])0(?=[;,)\] ])", "1"),
    (r"(?<= )\+=(?= )", "-="), (r"(?<= )-=(?= )", "+="), (r"(?<= )&=(?= )", "|="),
    (r"\btrue\b", "false"), (r"\bfalse\b", "true"), (r"(?<=\()!(?=[a-z(])", ""),
    (r"(?<=return )status(?=;)", "ASCC_OK"), (r"(?<=return )good(?=;)", "true"),
]
STATEMENT = re.compile(r"^\s+(?!return|break|continue|goto|const|static|else|if|for|while|do|case|default|[{}#/*])"
                       r"[^={]*(\(.*\)|[-+&|*]?=[^=].*|\+\+|--);\s*(/\*.*\*/)?$")
DECLARATION = re.compile(r"^\s+(const |static |struct |unsigned |u?int\d*_t |size_t |double |float |bool |char |int "
                         r"|ascc_\w+ \**\w+( =|;|\[|,)|\w+ \*+\w+ =|\w+ \w+ =)")


def without_comments(lines):
    """Lines with comments and texts as blanks, so that places stay; None for what is no code."""
    code, inside = [], False
    for line in lines:
        out = list(line)
        at, text = 0, None
        while at < len(line):
            two = line[at:at + 2]
            if inside:
                if two == "*/":
                    inside = False
                    out[at] = out[at + 1] = " "
                    at += 1
                else:
                    out[at] = " "
            elif text:
                if line[at] == "\\":
                    out[at] = " "
                    at += 1
                elif line[at] == text:
                    text = None
                if at < len(line):
                    out[at] = " "
            elif two == "/*":
                inside = True
                out[at] = " "
            elif two == "//":
                out[at:] = " " * (len(line) - at)
                break
            elif line[at] in "\"'":
                text = line[at]
                out[at] = " "
            at += 1
        blank = "".join(out)
        code.append(None if blank.lstrip().startswith("#") or blank.rstrip().endswith("\\") else blank)
    return code


def mutants_of(path):
    """(path, line number, column, new line, what was done) of everything that can be tried."""
    with open(os.path.join(ROOT, path), encoding="utf-8") as file:
        lines = file.read().split("\n")
    depth = 0
    for number, (line, code) in enumerate(zip(lines, without_comments(lines))):
        if code is None:
            continue
        inside, depth = depth > 0, depth + code.count("{") - code.count("}")
        if not inside or "assert" in code.lower():
            continue
        for pattern, becomes in OPERATORS:
            for found in re.finditer(pattern, code):
                yield (path, number, found.start(), line[:found.start()] + becomes + line[found.end():],
                       f"{found.group()} -> {becomes or 'nothing'}")
        if STATEMENT.match(code) and not DECLARATION.match(code) and code.count("(") == code.count(")"):
            yield path, number, 0, re.match(r"\s*", line).group() + ";", "statement deleted"


def key_of(mutant, line):
    path, number, column, new, what = mutant
    return hashlib.sha1("\0".join((path, line, new, str(column), what)).encode()).hexdigest()[:16]


def run(command, seconds):
    """Status, or None after so many seconds."""
    try:
        return subprocess.run(command, cwd=COPY, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                              timeout=seconds, check=False).returncode
    except subprocess.TimeoutExpired:
        return None


def copy_tree():
    """Brings the copy up to date; only files that differ are written, so that little is built again."""
    listing = subprocess.run(["git", "ls-files", "-co", "--exclude-standard"], cwd=ROOT, check=True,
                             capture_output=True, text=True).stdout
    for name in listing.split("\n"):
        source, target = os.path.join(ROOT, name), os.path.join(COPY, name)
        if not name or not os.path.isfile(source):
            continue
        with open(source, "rb") as file:
            data = file.read()
        if os.path.exists(target):
            with open(target, "rb") as file:
                if file.read() == data:
                    continue
        os.makedirs(os.path.dirname(target), exist_ok=True)
        shutil.copy(source, target)
    if not os.path.isdir(BUILD) and run(["meson", "setup", BUILD, "--buildtype=debugoptimized", "-Dbench=false",
                                         "-Db_ndebug=false", "-Db_sanitize=address,undefined",
                                         "-Db_lundef=false"], 600) != 0:
        sys.exit("mutate: meson setup fails in build-mutants")


def programs(tests):
    return [f"tests/test_{name}" for name in tests]


def outcome_of(tests, limits):
    """What becomes of the tree as it is in the copy."""
    build = run(["ninja", "-C", BUILD] + programs(tests), 900)
    if build != 0:
        return "invalid"
    for name in tests:
        begin = time.monotonic()
        status = run([os.path.join(BUILD, f"tests/test_{name}")], limits.get(name, 600))
        if status != 0:
            return f"killed by test_{name}" + (" (time)" if status is None else "")
        limits.setdefault(name, 10 + 5 * (time.monotonic() - begin))
    return "survived"


def read_results():
    results = {}
    if os.path.exists(RESULTS):
        with open(RESULTS, encoding="utf-8") as file:
            for line in file:
                key, outcome = line.rstrip("\n").split("\t")[:2]
                results[key] = outcome
    return results


def try_one(mutant, lines, tests, limits):
    path, number, _, new, _ = mutant
    target = os.path.join(COPY, path)
    try:
        with open(target, "w", encoding="utf-8") as file:
            file.write("\n".join(lines[:number] + [new] + lines[number + 1:]))
        return outcome_of(tests, limits)
    finally:
        with open(target, "w", encoding="utf-8") as file:
            file.write("\n".join(lines))


def describe(mutant, lines):
    path, number, _, new, what = mutant
    return f"{path}:{number + 1}: {what}\n    - {lines[number].strip()}\n    + {new.strip()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n", maxsplit=1)[0])
    parser.add_argument("--seconds", type=float, default=3600)
    parser.add_argument("--seed", type=int, default=1, help="of the order in which mutants are tried")
    parser.add_argument("--tests", help="units such as step,limits; by folder if not given")
    parser.add_argument("--lines", help="only these, such as 80-126")
    parser.add_argument("--list", action="store_true", help="only say what would be tried")
    parser.add_argument("files", nargs="+")
    o = parser.parse_args()
    os.environ.setdefault("ASAN_OPTIONS", "detect_leaks=0")
    os.environ.setdefault("UBSAN_OPTIONS", "halt_on_error=1")

    files = [os.path.relpath(os.path.abspath(f), ROOT) for f in o.files]
    text = {}
    for path in files:
        with open(os.path.join(ROOT, path), encoding="utf-8") as file:
            text[path] = file.read().split("\n")
    first, last = (map(int, o.lines.split("-")) if o.lines else (1, sys.maxsize))
    mutants = [m for path in files for m in mutants_of(path) if first <= m[1] + 1 <= last]
    random.Random(o.seed).shuffle(mutants)
    if o.list:
        for m in sorted(mutants):
            print(describe(m, text[m[0]]))
        return 0

    copy_tree()
    begin, limits, survivors, counts = time.monotonic(), {}, [], {}
    results, checked = read_results(), set()
    for n, m in enumerate(mutants):
        lines = text[m[0]]
        key = key_of(m, lines[m[1]])
        folder = m[0].split("/")[1]
        tests = (o.tests or TESTS.get(folder, "step")).split(",")
        if key not in results:
            if time.monotonic() - begin > o.seconds:
                print(f"time is over: {n} of {len(mutants)} mutants; call again to go on")
                break
            for name in tests:  # each must pass without a mutant, and says how long it takes
                if name not in checked and outcome_of([name], limits) != "survived":
                    sys.exit(f"mutate: test_{name} does not pass as it is")
                checked.add(name)
            results[key] = try_one(m, lines, tests, limits)
            with open(RESULTS, "a", encoding="utf-8") as file:
                file.write(f"{key}\t{results[key]}\t{m[0]}:{m[1] + 1}\t{m[4]}\n")
            print(f"{m[0]}:{m[1] + 1}: {m[4]}: {results[key]}", flush=True)
        outcome = results[key].split()[0]
        counts[outcome] = counts.get(outcome, 0) + 1
        if outcome == "survived":
            survivors.append(m)
    for m in sorted(survivors):
        print(describe(m, text[m[0]]))
    print(", ".join(f"{count} {outcome}" for outcome, count in sorted(counts.items())) or "nothing to try")
    return 0


if __name__ == "__main__":
    sys.exit(main())
