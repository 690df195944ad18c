# SPDX-License-Identifier: MIT
"""Measures what the paper's tables and figures compare, draws, writes docs/tables.md (run.sh says how)."""

import argparse
import csv
import json
import os
import sys

import numpy as np

import ablation
import draw
import page
from cache import Cache
from measure import ROOT, Failed, Tools, tensorfile

SHORT = 31  # frames by which Table 2 compares: what is trained so shortly does not last much longer
HERE = os.path.dirname(os.path.abspath(__file__))


class Size:
    """How much of everything: whole, or quick; --set changes a number."""

    def __init__(self, quick, changes=()):
        self.quick = quick
        self.sequences = 1 if quick else 5  # of Tables 1 and 2 (at most 2)
        self.frames = 40 if quick else 501  # of each at most, 0.005 s apart
        self.steps = 100 if quick else 500  # of momentum
        self.fall = 60 if quick else 200  # steps of Figure 5
        self.iterations = 5 if quick else 100  # of training in Table 2, per cent
        self.particles = 2000 if quick else 50000
        self.more = 8000 if quick else 1000000
        self.sph = 1000 if quick else 50000
        for change in changes:
            name, _, number = change.partition("=")
            if name not in vars(self) or name == "quick" or not number.isdigit() or int(number) < 1:
                raise SystemExit(f"--set {change}: NAME=NUMBER, NAME one of {', '.join(list(vars(self))[1:])}")
            setattr(self, name, int(number))

def methods():
    """Rows of methods.csv with the path of the model, or None, and where from."""
    with open(os.path.join(HERE, "methods.csv"), encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    for row in rows:
        row["path"] = next((path for path in places(row["model"]) if os.path.exists(path)), None)
        row["seconds"] = row["path"] and training_seconds(row["path"])
    return rows


def training_seconds(path):
    """What the training log beside a model says that it took, or None."""
    try:
        with open(path[: -len(".safetensors")] + ".csv", encoding="utf-8", newline="") as file:
            return float(list(csv.DictReader(file))[-1]["cpu_seconds"])
    except (OSError, IndexError, KeyError, ValueError):
        return None


def places(name):
    return [
        os.path.join(ROOT, "examples", "models", name + ".safetensors"),
        os.path.join(ROOT, "examples", "train", "runs", name + ".safetensors"),
    ]


def say(text):
    print(text, file=sys.stderr, flush=True)


def attempt(errors, what, measure):
    """A measurement, or None and why not: one that fails is a line of the page, not the end of it."""
    say(what)
    try:
        return measure()
    except Failed as error:
        errors.append(f"{what}: {error}")
        say(f"  {error}")
        return None


def test_sequences(tools, size, shared):
    """The given test sequences, two, and generated ones, all with frames of 0.005 s."""
    given = [os.path.join(shared, "data", "wbc2d", "test", f"test_0{i}.safetensors") for i in range(2)]
    given = [path for path in given if os.path.exists(path)][: size.sequences]
    wanted = size.sequences - len(given)
    made = [tools.generated("wbc2d", size.frames, 900 + i, 0.005, "--solver", "sph") for i in range(wanted)]
    return [tools.cut(path, size.frames, 2) for path in given] + made


def drifting_drops(tools):
    """Two drops that collide while both drift: else their momentum, which errors are measured by, would be 0."""
    return tools.drifting(tools.generated("droplets", 2, 900, 0.005, "--dimension", "2"), (0.5, 0.25))


def table1(tools, size, rows, shared, errors):
    sequences = test_sequences(tools, size, shared)
    start = drifting_drops(tools)
    for row in rows:
        row["figures"], row["momentum"] = [], None
        if not row["path"]:
            continue
        for i, sequence in enumerate(sequences):
            found = attempt(errors, f"{row['model']} on test sequence {i}", lambda s=sequence: tools.evaluate(row["path"], s))
            row["figures"] += [found] if found else []
        row["momentum"] = attempt(
            errors, f"{row['model']}: momentum", lambda: tools.rollout(row["path"], start, size.steps, 10, (0, 0))
        )
    return len(sequences)


def table2(tools, size, shared, errors):
    if not os.path.isdir(os.path.join(shared, "data", "wbc2d")):
        return []
    sequences = test_sequences(tools, size, shared)[:2]
    short = [tools.cut(path, SHORT, 1) for path in sequences]
    start = drifting_drops(tools)
    found = []
    for name, network, schedule, text in ablation.ROWS:
        made = attempt(
            errors, f"training: {name}", lambda: ablation.train(tools, network, schedule, size.iterations, shared)
        )
        if not made:
            found.append({"row": name, "text": text})
            continue
        model, seconds = made
        figures, whole = (
            [f for s in list if (f := attempt(errors, f"{name} on a test sequence", lambda: tools.evaluate(model, s)))]
            for list in (short, sequences)
        )
        momentum = attempt(errors, f"{name}: momentum", lambda: tools.rollout(model, start, size.steps, 10, (0, 0)))
        found.append({"row": name, "text": text, "seconds": seconds, "figures": figures, "whole": whole,
                      "momentum": momentum})  # fmt: skip
    return found


def figure5(tools, size, rows, errors):
    """Truth and methods in free fall and in a collision, without and with gravity."""
    every = size.fall // 20
    fall = tools.generated("free-fall", size.fall + 1, 900, 0.005, "--dimension", "2")
    drops = tools.generated("droplets", size.fall + 1, 900, 0.005, "--dimension", "2")
    def truth(path, gravity):
        x = tensorfile.read(path)[0]["fluid.position"][::every].astype(float)
        t = np.arange(len(x)) * every * 0.005
        return x + 0.5 * np.array(gravity)[None, None] * (t**2)[:, None, None]

    lines = []
    for what, path, gravity, added in (
        ("free fall", fall, (0, -9.81), (0, 0)),
        ("two drops, no gravity", drops, (0, 0), (0, 0)),
        ("two drops, gravity", drops, (0, -9.81), (0, -9.81)),
    ):
        panels = [("truth", truth(path, added), "")]
        for row in rows:
            run = row["path"] and attempt(
                errors, f"{row['model']}: {what}",
                lambda r=row, p=path, g=gravity: tools.rollout(r["path"], p, size.fall, every, g))  # fmt: skip
            panels.append((row["row"], run[1] if run else None, run[2] if run else ""))
        lines.append((what, panels))
    return lines


SPEED = [  # label, model, largest number of particles it is asked for (0: all)
    ("ours, 3D", "water3d", 0), ("ours, 3D, large", "water3d-large", 50000), ("ours, 2D", "water2d", 50000),
    ("PointNet++, 3D", "pointnet3d", 50000), ("GNS, 3D", "gns3d", 0),
    ("CConv, published, 3D", "cconv", 50000), ("DMCF, published, 3D", "dmcf", 50000),
]  # fmt: skip


def speed(tools, size, errors):
    found = []
    for label, name, most in SPEED:
        path = next((p for p in places(name) if os.path.exists(p)), name if name in ("cconv", "dmcf") else None)
        costs = []
        for particles in (size.particles, size.more):
            asked = path and (not most or particles <= most)
            cost = asked and attempt(errors, f"{label}: {particles} particles", lambda: tools.step_cost(path, particles))
            costs.append(cost or None)
        found.append({"label": label, "model": name, "missing": not path, "cost": costs})
    sph = attempt(errors, "reference SPH in steps of 1e-4 s", lambda: tools.sph_cost(size.sph))
    return found, sph


def main():
    parser = argparse.ArgumentParser(prog="run.sh", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller runs, a few minutes")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=NUMBER", help="another size of one run")
    parser.add_argument("--build", default="build")
    parser.add_argument("--shared", default=os.path.join(ROOT, "..", "shared"))
    parser.add_argument("--page", default=os.path.join(ROOT, "docs", "tables.md"))
    options = parser.parse_args()
    size, errors = Size(options.quick, options.set), []
    shared = os.path.abspath(options.shared)
    tools = Tools(options.build, Cache(os.path.join(options.build, "tables")), options.quick)
    with open(os.path.join(HERE, "paper.json"), encoding="utf-8") as file:
        paper = json.load(file)
    rows = methods()
    sequences = table1(tools, size, rows, shared, errors)
    lines = figure5(tools, size, rows, errors)
    ablations = table2(tools, size, shared, errors)
    costs, sph = speed(tools, size, errors)
    figures = os.path.join(os.path.dirname(os.path.abspath(options.page)), "figures")
    os.makedirs(figures, exist_ok=True)
    draw.momentum([(r["row"], r["momentum"][0]) for r in rows if r["momentum"]], os.path.join(figures, "tables-momentum.png"))
    draw.scenes(lines, os.path.join(figures, "tables-scenes.png"))
    page.write(options.page, size, paper, rows, sequences, ablations, costs, sph, errors)


if __name__ == "__main__":
    main()
