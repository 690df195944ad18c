# SPDX-License-Identifier: MIT
"""The networks of Table 2: examples/train/ablation2d.json with one thing after the other, trained."""

import copy
import json
import os

from cache import File
from measure import ROOT

BASE = os.path.join(ROOT, "examples", "train", "ablation2d.json")

# Row, what is taken from the config, what that leaves. Each row keeps what those above it have, but for sampling.
ROWS = [
    ("no ASCC", {"output": "plain", "levels": 0}, "short", "a plain convolution at the end, one scale"),
    ("+ ASCC", {"levels": 0}, "short", "pair impulses at the end"),
    ("+ multi-scale, farthest points", {"sampling": "farthest"}, "short", "two coarser levels of farthest points"),
    ("+ multi-scale, voxels", {}, "short", "of lattices in their place"),
    ("+ preprocessing", {}, "warm", "up to eight steps without gradient before a rollout of two"),
    ("full", {}, "long", "then rollouts of four steps behind sixteen"),
]


def config_of(network, schedule, percent):
    """The config of a row. All have as many iterations; what is short trains on in its place."""
    with open(BASE, encoding="utf-8") as file:
        config = json.load(file)
    config["network"].update(network)
    if config["network"]["levels"] == 0:
        del config["network"]["coarse_channels"]
    first, second, third = config["stages"]
    if schedule == "short":
        second["warm_up"] = 0
    if schedule != "long":
        third.update({key: second[key] for key in ("unroll", "warm_up")})
    for stage in config["stages"]:
        stage["iterations"] = max(2, round(stage["iterations"] * percent / 100))
    return config


def train(tools, network, schedule, percent, shared):
    """The model file of a row and the CPU seconds that it took."""
    config = config_of(network, schedule, percent)

    def measure(path):
        made = copy.deepcopy(config)
        made["output"] = path + ".safetensors"
        for part in ("train", "valid"):
            for entry in made["data"][part]:
                entry["path"] = os.path.join(shared, entry["path"].removeprefix("../../../shared/"))
        with open(path + ".config", "w", encoding="utf-8") as file:
            json.dump(made, file)
        _, seconds = tools.ascc("train", path + ".config", "--threads", 1, "--resume")
        return {"seconds": seconds}

    made_from = ["2", json.dumps(config)]
    value = tools.cache.result("train", made_from, measure)
    return File(tools.cache.path("train", *made_from) + ".safetensors"), value["seconds"]
