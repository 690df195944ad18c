# SPDX-License-Identifier: MIT
"""Tests of bench/tables without its measurements; run by tests/bench_test.sh."""

import os
import sys
import tempfile
import types
import unittest

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "support"), os.path.join(HERE, "..", "bench", "tables")]

import ablation  # noqa: E402
import draw  # noqa: E402
import page  # noqa: E402
import tap  # noqa: E402
from cache import Cache, File  # noqa: E402

PAPER = {
    "table1": {"GNS": {"rmse": 1e-3, "emd": 2, "jsd": 0.1}},
    "table2": {"no ASCC": 0.42, "full": 1.0},
    "speed": {"50000": 67.25, "1000000": 1200, "ratio": 162},
}


def figures(rmse):
    return {"rmse_20": rmse, "emd_final": rmse, "frames": 4, "last_frame": 3, "jsd_mean": 0.1, "escaped_max": 3}


def ablation_row(name, rmse, momentum):
    return {"row": name, "text": "", "seconds": 1, "figures": [figures(rmse)], "momentum": (momentum, None, "")}


class Page(unittest.TestCase):
    def test_a_method_without_a_file_is_said_to_be_missing(self):
        size = types.SimpleNamespace(quick=True, frames=1, steps=2, fall=20, sequences=1, iterations=3, particles=10, more=20)
        row = {"row": "GNS", "model": "gns2d", "path": None, "figures": [], "momentum": None}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "tables.md")
            page.write(path, size, PAPER, [row], 1, [], [], None, ["a run: broke"])
            with open(path, encoding="utf-8") as file:
                text = file.read()
        self.assertIn("| GNS | `gns2d` | no model file |", text)
        self.assertIn("- no model file: `gns2d`", text)
        self.assertIn("- a run: broke", text)
        self.assertIn("quick run", text)

    def test_zero_is_said_only_where_it_is(self):
        self.assertEqual(page.last(([0.0, 0.0], None, "")), "**0**")
        self.assertEqual(page.last(([0.0, 3e-18], None, "")), "3e-18")
        self.assertEqual(page.last(None), "-")

    def test_spread_is_the_standard_deviation_of_several(self):
        self.assertEqual(page.spread([1.0, 3.0]), "2 ± 1.4")
        self.assertEqual(page.spread([2.5, None]), "2.5")
        self.assertEqual(page.spread([None]), "-")

    def test_the_full_network_scores_1_and_lost_momentum_or_doubled_errors_less(self):
        full = ablation_row("full", 1.0, [0.0])
        self.assertEqual(page.score(full, full), 1)
        self.assertAlmostEqual(page.score(ablation_row("no ASCC", 1.0, [0.5, 1.0]), full), 3 / (1 + 1 + 2))
        self.assertAlmostEqual(page.score(ablation_row("no ASCC", 2.0, [0.0]), full), 3 / (2 + 2 + 1))
        self.assertIsNone(page.score(ablation_row("stopped", None, [0.0]), full))

    def test_orders_are_told_where_they_part(self):
        said = {"a": 1, "b": 2, "c": 3}
        self.assertEqual(page.orders({"a": 0.1, "b": 0.2, "c": None}, said), "a, b; as in the paper")
        self.assertEqual(page.orders({"a": 0.2, "b": 0.1}, said), "b, a; in the paper a, b")

    def test_a_rollout_that_ended_early_is_told(self):
        self.assertEqual(page.stopped([figures(1.0)]), "")
        self.assertEqual(page.stopped([{"frames": 40, "last_frame": 35}]), " (stopped at frame 35)")


class Figure(unittest.TestCase):
    def test_exactly_zero_is_drawn_at_the_foot_and_nothing_else(self):
        drawn, save = [], draw.save
        draw.save = lambda figure, path: drawn.append(figure)
        try:
            draw.momentum([("whole", [0.0, 0.0]), ("lossy", [0.0, 1e-3])], "")
        finally:
            draw.save = save
        axes = drawn[0].axes[0]
        lines = {line.get_label(): list(line.get_ydata()) for line in axes.lines}
        self.assertEqual(lines["whole: exactly 0"], [draw.ZERO] * 2)
        self.assertEqual(lines["lossy"], [draw.ZERO, 1e-3])
        foot = axes.get_yticks().tolist().index(draw.ZERO)
        self.assertEqual(axes.get_yticklabels()[foot].get_text(), "0")


class Kept(unittest.TestCase):
    def test_a_result_is_measured_once_for_what_it_is_made_from(self):
        with tempfile.TemporaryDirectory() as folder:
            source, calls = os.path.join(folder, "file"), []

            def result():
                return Cache(folder).result("x", [File(source), 3], lambda path: calls.append(path) or len(calls))

            for text, wanted in (("a", 1), ("a", 1), ("b", 2), ("a", 1)):
                with open(source, "w", encoding="utf-8") as file:
                    file.write(text)
                self.assertEqual(result(), wanted)

    def test_what_failed_is_measured_again(self):
        with tempfile.TemporaryDirectory() as folder:

            def fails(path):
                raise ValueError

            with self.assertRaises(ValueError):
                Cache(folder).result("x", [1], fails)
            self.assertEqual(Cache(folder).result("x", [1], lambda path: 5), 5)


class Ablation(unittest.TestCase):
    def test_every_row_trains_equally_long(self):
        for percent in (100, 5):
            configs = [ablation.config_of(network, schedule, percent) for _, network, schedule, _ in ablation.ROWS]
            self.assertEqual(len({sum(s["iterations"] for s in c["stages"]) for c in configs}), 1)
            self.assertEqual([c["network"].get("output") for c in configs], ["plain"] + [None] * 5)


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
