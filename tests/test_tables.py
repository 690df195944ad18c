# SPDX-License-Identifier: MIT
"""Tests of bench/tables without its measurements; run by tests/bench_test.sh."""

import json
import os
import sys
import tempfile
import threading
import unittest

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "support"), os.path.join(HERE, "..", "bench", "tables")]

import ablation  # noqa: E402
import draw  # noqa: E402
import page  # noqa: E402
import tables  # noqa: E402
import tap  # noqa: E402
import training  # noqa: E402
from cache import Cache, Failed, File  # noqa: E402

try:
    import lagrangebench_gns
except ImportError:
    lagrangebench_gns = None

PAPER = {
    "table1": {"GNS": {"rmse": 1e-3, "emd": 2, "jsd": 0.1}},
    "table2": {"no ASCC": 0.42, "full": 1.0},
    "speed": {"50000": 67.25, "1000000": 1200, "ratio": 162},
    "published": {"GNS": "20 million iterations"},
}


def figures(rmse):
    return {"rmse_20": rmse, "emd_final": rmse, "frames": 4, "last_frame": 3, "jsd_mean": 0.1, "escaped_max": 3, "fluid": 10}


def ablation_run(rmse, momentum):
    return {"seconds": 1, "figures": [figures(rmse)], "whole": [figures(rmse)], "momentum": (momentum, None, "")}


class Page(unittest.TestCase):
    def test_a_method_without_a_network_is_said_to_be_missing(self):
        row = {"row": "GNS", "model": "gns2d", "dimension": "2", "runs": []}
        free = {"2": [{"err_n1_difference": 5e-4}], "3": []}
        with tempfile.TemporaryDirectory() as folder:
            path = os.path.join(folder, "tables.md")
            page.write(path, tables.Size(True), PAPER, [row], free, [], [], None, ["a run: broke"])
            with open(path, encoding="utf-8") as file:
                text = file.read()
        self.assertIn("| GNS | `gns2d` | none |", text)
        self.assertIn("- no network: `gns2d`", text)
        self.assertIn("- a run: broke", text)
        self.assertIn("quick run", text)
        self.assertIn("free flight has 0.5 mm", text)

    def test_what_was_trained_stands_beside_what_is_published(self):
        runs = [{"iterations": 10, "weights": 161000, "jitter": 0.003}]
        row = {"row": "GNS, small", "model": "gns2d-small", "rate": 0.001, "noise": 3, "runs": runs}
        line = list(page.networks([row, {"row": "ASCC, shipped", "model": "x", "runs": runs}], PAPER))[-1]
        self.assertIn("| 161,000 | 0.001 | 0.003 | 10 | 20 million iterations |", line)

    def test_spread_is_the_standard_deviation_of_several(self):
        self.assertEqual(page.spread([1.0, 3.0]), "2 ± 1.4")
        self.assertEqual(page.spread([2.5, None]), "2.5")
        self.assertEqual(page.spread([None]), "-")

    def test_the_full_network_scores_1_and_lost_momentum_or_doubled_errors_less(self):
        full = {"row": "full", "runs": [ablation_run(1.0, [0.0]), ablation_run(1.0, [0.0])]}
        of = lambda *run: page.scores({"runs": [ablation_run(*run)]}, [full])  # noqa: E731
        self.assertEqual(page.scores(full, [full]), [1, 1])
        self.assertAlmostEqual(of(1.0, [0.5, 1.0])[0], 3 / (1 + 1 + 2))
        self.assertAlmostEqual(of(2.0, [0.0])[0], 3 / (2 + 2 + 1))
        self.assertEqual(of(None, [0.0]), [])
        full["runs"][1] = ablation_run(3.0, [0.0])  # errors are held against the mean of the full ones
        self.assertAlmostEqual(of(2.0, [0.0])[0], 1)

    def test_zero_is_said_only_where_it_is(self):
        of = lambda *errors: page.momentum_of({"runs": [{"momentum": (list(errors), None, "")}]})  # noqa: E731
        self.assertEqual(of(0.0, 0.0), "**0**")
        self.assertEqual(of(0.0, 3e-18), "3e-18")
        self.assertEqual(page.momentum_of({"runs": [{"momentum": None}]}), "-")

    def test_orders_are_told_where_they_part(self):
        said = {"a": 1, "b": 2, "c": 3}
        self.assertEqual(page.orders({"a": 0.1, "b": 0.2, "c": None}, said), "a, b; as in the paper")
        self.assertEqual(page.orders({"a": 0.2, "b": 0.1}, said), "b, a; in the paper a, b")

    def test_a_rollout_that_ended_early_is_told(self):
        self.assertEqual(page.stopped([figures(1.0)]), "")
        ended = [{"frames": 40, "last_frame": last} for last in (39, 35, 17)]
        self.assertEqual(page.stopped(ended), " (2 of 3 stopped, the first at frame 17)")

    def test_spread_of_a_method_is_that_of_its_networks(self):
        run = lambda seconds, *errors: {  # noqa: E731
            "seconds": seconds, "momentum": ([0.0, seconds / 10], None, ""), "figures": [figures(e) for e in errors]}  # fmt: skip
        row = {"row": "GNS", "model": "gns2d", "runs": [run(10, 1.0, 3.0), run(30, 4.0, 4.0)]}
        line = list(page.table1([row], PAPER))[-1]
        self.assertIn("| 2 x 20 |", line)
        self.assertIn("| 3,000 ± 1,414 |", line)
        self.assertIn("| 30 % | 2 ± 1.4 |", line)
        row["runs"] = [dict(run(0, 1.0, 3.0), seconds=None, momentum=([0.0], None, ""))]
        line = list(page.table1([row], PAPER))[-1]
        self.assertIn("| [card](models/gns2d.md) |", line)
        self.assertIn("| 2,000 ± 1,414 |", line)
        self.assertIn("| **0** |", line)

    def rows_of(self, **errors):
        return [
            {"row": name, "model": name, "runs": [dict(ablation_run(e, [0.0 if name == "ASCC" else 1.0]),
                                                       figures=[dict(figures(e), err_n1_difference=e)]) for e in list_of]}
            for name, list_of in errors.items()
        ]  # fmt: skip

    def test_what_is_seen_names_who_leads_and_what_is_not_told_apart(self):
        paper = {"table1": dict.fromkeys(("ASCC", "GNS", "CConv"))}
        rows = self.rows_of(ASCC=[1e-4, 2e-4], GNS=[4e-4, 6e-4], CConv=[5e-4, 6e-4])
        text = page.seen(rows, 1.0, paper)
        self.assertIn("Least in one step, RMSE, EMD and momentum: ASCC.", text)
        self.assertIn("free flight has: ASCC 85 %, GNS 50 % and CConv 45 %.", text)
        self.assertIn("Within their ± in RMSE: GNS and CConv.", text)
        self.assertIn("GNS: 2 of 2 rollouts lose a tenth of the particles or more.", text)
        rows[0]["runs"][0]["figures"][0].update(last_frame=1, emd_final=None)
        self.assertIn("ASCC: 2 of 2 rollouts lose a tenth of the particles or more and 1 of 2 rollouts end early.",
                      page.seen(rows, None, paper))  # fmt: skip
        for run in rows[0]["runs"]:
            run["figures"][0].update(jsd_mean=0.05, escaped_max=0)
        self.assertIn("ASCC leads every column.", page.seen(rows, None, paper))
        self.assertEqual(page.seen(rows[:1], 1.0, paper), "")

    def test_remarks_stand_in_the_page_of_a_whole_run_alone(self):
        kept, free = page.REMARKS, {"2": [], "3": []}
        with tempfile.TemporaryDirectory() as folder:
            page.REMARKS = os.path.join(folder, "remarks.md")
            with open(page.REMARKS, "w", encoding="utf-8") as file:
                file.write("for whom\n\n## Table 2\n\nA remark.\n\n## Speed\n\nAnother.\n")
            try:
                self.assertEqual(page.remarks(page.REMARKS), {"Table 2": "A remark.", "Speed": "Another."})
                for quick in (False, True):
                    path = os.path.join(folder, "tables.md")
                    page.write(path, tables.Size(quick), PAPER, [], free, [], [], None, [])
                    with open(path, encoding="utf-8") as file:
                        text = file.read()
                    self.assertEqual(("A remark." in text, "Another." in text, "for whom" in text), (not quick, not quick, False))
            finally:
                page.REMARKS = kept

    def test_a_cost_that_there_is_not_says_why(self):
        costs = [{"label": "GNS, 3D", "model": "gns3d", "missing": False, "cost": [{"ms": 500.0, "mib": 340.0}, "failed"]}]
        size = tables.Size(False)
        line = list(page.speed(costs, {"ms": 40000.0, "particles": 50000}, PAPER, size))[2]
        self.assertEqual(line, "| GNS, 3D (`gns3d`) | 500 | 340 | failed |  | 80 |")

    def test_the_first_network_of_each_baseline_is_kept(self):
        with tempfile.TemporaryDirectory() as folder:
            rows = []
            for k, name in enumerate(("GNS", "GNS" + tables.UNTOLD, "ASCC", "CConv")):
                paths = [os.path.join(folder, f"{k}{seed}") for seed in "ab"]
                for path in paths:
                    with open(path, "w", encoding="utf-8") as file:
                        file.write(path)
                rows.append({"row": name, "model": f"m{k}", "trained": True, "runs": [{"path": path} for path in paths]})
            rows[3]["runs"] = []
            out = os.path.join(folder, "out")
            tables.keep(rows, out)
            self.assertEqual(os.listdir(out), ["m0.safetensors"])
            with open(os.path.join(out, "m0.safetensors"), encoding="utf-8") as file:
                self.assertTrue(file.read().endswith("0a"))

    def test_only_rows_that_the_paper_has_too_are_put_in_order(self):
        rows = [{"row": name, "runs": [{"figures": [figures(e)]}]} for name, e in (("GNS", 2.0), ("GNS, shipped", 1.0))]
        self.assertEqual(page.table1_order(rows, PAPER), "GNS; as in the paper")


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


    def test_what_runs_beside_measures_once(self):
        with tempfile.TemporaryDirectory() as folder:
            inner, seen = [], []

            def measure(path):
                # Another one asks for it meanwhile, and waits.
                inner.append(threading.Thread(target=lambda: seen.append(Cache(folder).result("x", [1], lambda path: 7))))
                inner[0].start()
                return 5

            seen.append(Cache(folder).result("x", [1], measure))
            inner[0].join()
            self.assertEqual(seen, [5, 5])

    def test_nothing_is_begun_when_the_time_is_over(self):
        with tempfile.TemporaryDirectory() as folder:
            late = Cache(folder, 0)
            with self.assertRaises(Failed):
                late.result("x", [1], lambda path: 5)
            self.assertTrue(late.left)
            Cache(folder).result("x", [1], lambda path: 5)
            self.assertEqual(late.result("x", [1], lambda path: 6), 5)


class Training(unittest.TestCase):
    def test_every_row_of_table_2_trains_equally_long(self):
        for percent in (100, 5):
            configs = [ablation.config_of(network, schedule, [], 1, percent) for _, network, schedule, _ in ablation.ROWS]
            self.assertEqual(len({sum(s["iterations"] for s in c["stages"]) for c in configs}), 1)
            self.assertEqual([c["network"].get("output") for c in configs], ["plain"] + [None] * 5)

    def test_every_method_has_a_config_and_the_same_schedule(self):
        rows = [row for row in tables.methods() if row["trained"]]
        self.assertGreater(len(rows), 5)
        for row in rows:
            config = training.setup(row["model"], ["x"], 3, 0.004, 0)
            self.assertEqual([s["learning_rate"] for s in config["stages"]], [0.004, 0.004 / 3])
            self.assertEqual((config["seed"], config["jitter"], config["data"]), (3, 0, {"train": ["x"]}))
            self.assertNotIn("model", config)

    def test_rates_are_tried_first_then_noises_at_the_best(self):
        tried, train = [], training.train
        training.train = lambda tools, config, seconds, each: {
            "path": (config["stages"][0]["learning_rate"], config["jitter"] / base)}  # fmt: skip
        base = training.read("gns2d")["jitter"]
        try:
            judge = lambda path: tried.append(path) or abs(path[0] - 0.006) + abs(path[1] - 3)  # noqa: E731
            chosen = training.tune(None, "gns2d", [], 1, None, (3, 2), judge)
        finally:
            training.train = train
        self.assertEqual(chosen, (0.006, 3))
        self.assertEqual(len(tried), 5)
        self.assertEqual({rate for rate, _ in tried[3:]}, {0.006})


class Pieces(unittest.TestCase):
    @unittest.skipIf(lagrangebench_gns is None, "h5py is not installed")
    def test_frames_in_which_nearest_images_agree_are_continuous_in_a_wide_box(self):
        import h5py

        way = np.linspace(0, 4, 60)  # through the side of a box of 5, then apart
        x = np.zeros((60, 3, 3)) + [[0, 0, 0], [1, 0, 0], [0, 1, 0]] + 3.5
        x[..., 0] += way[:, None]
        x[40:, 2, 1] += 1.0
        x[40:, 1, 1] -= 1.5
        with tempfile.TemporaryDirectory() as folder:
            with open(os.path.join(folder, "metadata.json"), "w", encoding="utf-8") as file:
                json.dump({"bounds": [[0, 5]] * 3}, file)
            with h5py.File(os.path.join(folder, "a.h5"), "w") as file:
                file["00000/position"] = x % 5
            pieces = lagrangebench_gns.together(os.path.join(folder, "a.h5"), 20)
        self.assertEqual(len(pieces), 2)
        for k, piece in enumerate(pieces):
            part = x[20 * k : 20 * k + 20]
            difference = (piece - piece[:1, :1]) - (part - part[:1, :1])
            self.assertLess(np.abs(difference).max(), 1e-9)


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
