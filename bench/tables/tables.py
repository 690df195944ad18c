# SPDX-License-Identifier: MIT
"""Measures what the paper's tables and figures compare, draws, writes docs/tables.md (run.sh says how)."""

import argparse
import csv
import json
import math
import os
import shutil

import ablation
import draw
import page
import scenes
import training
from cache import Cache
from measure import ROOT, Tools, attempt, say, tensorfile
from sequences import World, drifting_drops

PARTS = ("2d", "3d", "ablation", "speed")
UNTOLD = ", no gravity given"
SHORT = 31  # frames by which Table 2 compares: what is trained so shortly does not last much longer
HERE = os.path.dirname(os.path.abspath(__file__))


class Size:
    """How much of everything: whole, or quick; --set changes a number."""

    def __init__(self, quick, changes=()):
        self.quick = quick
        self.sequences = 1 if quick else 5  # of Tables 1 and 2 (at most 2)
        self.frames = 40 if quick else 501  # of each at most, 0.005 s apart
        self.made = 2 if quick else 12  # sequences to learn from, beside the given and a few of still water and drops
        self.steps = 100 if quick else 500  # of momentum
        self.fall = 60 if quick else 200  # steps of Figure 5
        self.seconds = 3 if quick else 90  # of CPU time that a network of Table 1 is trained for
        self.seconds_3d = 5 if quick else 120  # in 3D
        self.tuning = 3 if quick else 30  # for a choice of learning rate and noise
        self.sample = 3 if quick else 12  # iterations of each stage that say how many will take so long
        self.rates = 1 if quick else 3  # learning rates to choose from
        self.noises = 0 if quick else 2  # then noises, beside that of the config
        self.seeds = 1 if quick else 3  # of the networks of Tables 1 and 2; one in 3D
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
    with open(os.path.join(HERE, "methods.csv"), encoding="utf-8", newline="") as file:
        return [{**row, "trained": row["trained"] == "yes", "runs": []} for row in csv.DictReader(file)]


def choose(tools, size, model, plane):
    """Learning rate and noise of a 2D network, by the error after 20 steps on sequences that nobody learns from."""

    def judge(path):
        errors = [tools.evaluate(path, sequence)["rmse_20"] for sequence in plane.valid]
        return math.inf if None in errors else sum(errors) / len(errors)

    tries = (size.rates, size.noises)
    return training.tune(tools, model, plane.train, size.tuning, each_of(tools, size, model, plane), tries, judge)


def each_of(tools, size, model, world):
    """CPU seconds of an iteration of each stage."""
    return training.cost(tools, training.setup(model, world.train, 1, training.RATES[0], 1), size.sample)


def networks(tools, size, row, rows, world, plane):
    """Each network of a row; a row without training is a shipped or given file. rows, plane: of 2D, where rates are chosen."""
    if not row["trained"]:
        path = shipped(row["model"]) or tools.published(row["model"])
        return [{"path": path, "seconds": None}] if path else []
    name = row["row"].removesuffix(UNTOLD)
    model = next(other["model"] for other in rows if other["row"] == name)
    row["rate"], row["noise"] = choose(tools, size, model, plane)
    made = []
    for seed in range(1, world.seeds + 1):
        config = training.setup(row["model"], world.train, seed, row["rate"], row["noise"])
        if name != row["row"]:
            config = training.without_gravity(config)
        network = training.train(tools, config, world.seconds, each_of(tools, size, row["model"], world))
        weights = sum(tensor.size for tensor in tensorfile.read(network["path"])[0].values())
        made.append({**network, "jitter": config["jitter"], "weights": weights})
        say(f"  seed {seed}: {made[-1]['iterations']} iterations in {made[-1]['seconds']:.0f} CPU s")
    return made


def shipped(name):
    """The model file of that name, if there is one."""
    folders = (("models",), ("models", "baselines"), ("train", "runs"))
    paths = (os.path.join(ROOT, "examples", *folder, name + ".safetensors") for folder in folders)
    return next((path for path in paths if os.path.exists(path)), None)


def keep(rows, folder):
    """Copies the first network of each baseline to a folder, under the name of its config."""
    os.makedirs(folder, exist_ok=True)
    for row in rows:
        if row["trained"] and row["runs"] and not row["row"].startswith("ASCC") and not row["row"].endswith(UNTOLD):
            shutil.copyfile(row["runs"][0]["path"], os.path.join(folder, row["model"] + ".safetensors"))


def table1(tools, size, rows, told, flat, plane, errors):
    """Trains and measures the rows of one dimension. flat, plane: rows and sequences of 2D."""
    for row in rows:
        untold = row["row"].endswith(UNTOLD)
        world = told.without_gravity(tools) if untold else told
        start = drifting_drops(tools, row["dimension"])
        still = (0, 0, 0)[: int(row["dimension"])]
        made = attempt(errors, f"training: {row['row']}", lambda r=row, w=world: networks(tools, size, r, flat, w, plane))
        for network in made or []:
            path = network["path"]
            found = [
                attempt(errors, f"{row['row']} on test sequence {i}", lambda s=sequence, p=path: tools.evaluate(p, s))
                for i, sequence in enumerate(world.test)
            ]
            # What learnt gravity cannot be asked what it does without.
            momentum = None if untold else attempt(
                errors, f"{row['row']}: momentum", lambda p=path, s=start: tools.rollout(p, s, size.steps, 10, still)
            )  # fmt: skip
            row["runs"].append({**network, "momentum": momentum, "figures": [f for f in found if f]})


def table2(tools, size, world, errors):
    sequences = world.test[:2]
    short = [tools.cut(path, SHORT, 1) for path in sequences]
    start = drifting_drops(tools)
    found = []
    for name, network, schedule, text in ablation.ROWS:
        row = {"row": name, "text": text, "runs": []}
        for seed in range(1, world.seeds + 1):
            config = ablation.config_of(network, schedule, world.train, seed, size.iterations)
            made = attempt(errors, f"training: {name}, seed {seed}", lambda c=config: training.run(tools, c))
            if not made:
                continue
            path, spent = made
            figures, whole = (
                [f for s in list if (f := attempt(errors, f"{name} on a test sequence", lambda: tools.evaluate(path, s)))]
                for list in (short, sequences)
            )
            momentum = attempt(errors, f"{name}: momentum", lambda: tools.rollout(path, start, size.steps, 10, (0, 0)))
            row["runs"].append({"seconds": spent[-1], "figures": figures, "whole": whole, "momentum": momentum})
        found.append(row)
    return found


SPEED = [  # label, model, why it is not asked for the larger number of particles
    ("ours, 3D", "water3d", ""), ("ours, 3D, large", "water3d-large", ""),
    ("PointNet++, 3D", "pointnet3d", "minutes: not asked"), ("GNS, 3D", "gns3d", ""),
    ("CConv, published, 3D", "cconv", "not asked"), ("DMCF, published, 3D", "dmcf", "13 GiB: not asked"),
    ("ours, 2D", "water2d", ""), ("PointNet++, 2D", "pointnet2d", "minutes: not asked"),
    ("GNS, 2D", "gns2d", "not asked"), ("CConv, 2D", "cconv2d", "not asked"),
]  # fmt: skip


def speed(tools, size, errors):
    """Costs of shipped networks at both numbers of particles, each a measurement or why there is none."""
    found = []
    for label, name, why in SPEED:
        path = shipped(name) or (name if name in ("cconv", "dmcf") else None)
        measure = lambda particles, p=path, l=label: attempt(  # noqa: E731
            errors, f"{l}: {particles} particles", lambda: tools.step_cost(p, particles)) or "failed"  # fmt: skip
        costs = [measure(size.particles), why or measure(size.more)] if path else ["-", "-"]
        found.append({"label": label, "model": name, "missing": not path, "cost": costs})
    sph = attempt(errors, "reference SPH in steps of 1e-4 s", lambda: tools.sph_cost(size.sph))
    return found, sph


def floor(tools, path, errors):
    return attempt(errors, f"free flight: {os.path.basename(path)}", lambda: tools.evaluate("ballistic", path)) or {}


def main():
    parser = argparse.ArgumentParser(prog="run.sh", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="smaller runs, a few minutes")
    parser.add_argument("--set", action="append", default=[], metavar="NAME=NUMBER", help="another size of one run")
    parser.add_argument("--minutes", type=float, help="begin nothing new after so many: what is missing is told, and the same command goes on")
    parser.add_argument("--only", choices=PARTS, help="measure this part, write no page: several can run side by side")
    parser.add_argument("--keep", metavar="DIR", help="copy the baselines of the first seed there, as examples/models/baselines has them")
    parser.add_argument("--build", default="build")
    parser.add_argument("--shared", default=os.path.join(ROOT, "..", "shared"))
    parser.add_argument("--page", default=os.path.join(ROOT, "docs", "tables.md"))
    options = parser.parse_args()
    size, errors = Size(options.quick, options.set), []
    cache = Cache(os.path.join(options.build, "tables"), None if options.minutes is None else 60 * options.minutes)
    shared = os.path.abspath(options.shared)
    tools = Tools(options.build, cache, options.quick, shared)
    with open(os.path.join(HERE, "paper.json"), encoding="utf-8") as file:
        paper = json.load(file)
    rows = methods()
    flat, solid = ([row for row in rows if row["dimension"] == d] for d in "23")
    plane, space = (World(tools, size, dimension, shared) for dimension in "23")
    asked = lambda part: options.only in (None, part)  # noqa: E731
    if asked("2d"):
        table1(tools, size, flat, plane, flat, plane, errors)
    if asked("3d") and space.test:
        table1(tools, size, solid, space, flat, plane, errors)
    ablations = table2(tools, size, plane, errors) if asked("ablation") else []
    costs, sph = speed(tools, size, errors) if asked("speed") else ([], None)
    if options.keep:
        keep(rows, options.keep)
    if options.only:
        raise SystemExit(3 if cache.left else 0)
    lines = scenes.figure5(tools, size, flat, errors)
    failing = scenes.failures(tools, flat, plane, (20, 60, 100, 200, 400), errors)
    figures = os.path.join(os.path.dirname(os.path.abspath(options.page)), "figures")
    os.makedirs(figures, exist_ok=True)
    curves = [(r["row"], r["runs"][0]["momentum"][0]) for r in flat if r["runs"] and r["runs"][0]["momentum"]]
    draw.momentum(curves, os.path.join(figures, "tables-momentum.png"))
    draw.scenes(lines, os.path.join(figures, "tables-scenes.png"))
    draw.scenes(failing, os.path.join(figures, "tables-failures.png"))
    floors = {d: [floor(tools, path, errors) for path in world.test] for d, world in (("2", plane), ("3", space))}
    page.write(options.page, size, paper, rows, floors, ablations, costs, sph, errors)
    raise SystemExit(3 if cache.left else 0)


if __name__ == "__main__":
    main()
