# SPDX-License-Identifier: MIT
"""Trains the network of a config for so many CPU seconds, or finds it trained."""

import copy
import csv
import json
import os

from cache import Failed, File
from measure import ROOT

CONFIGS = os.path.join(ROOT, "examples", "train")
RATES = (0.0025, 0.006, 0.001)  # learning rates that every network is tried with
NOISES = (3, 0)  # and then, how many times the noise of its config
SHARES = (0.7, 0.3)  # of the seconds: single steps, then rollouts


def read(name):
    """A config of examples/train, to begin with random weights."""
    with open(os.path.join(CONFIGS, name + ".json"), encoding="utf-8") as file:
        config = json.load(file)
    config.pop("model", None)
    return config


def setup(name, data, seed, rate, noise):
    """One protocol for all: single steps, then rollouts of two behind some without gradient, the rate falling."""
    config = read(name)
    before = min(config["stages"][1].get("warm_up", 0), 8)
    config["stages"] = [
        {"iterations": 1, "unroll": 1, "learning_rate": rate, "learning_rate_end": rate / 3},
        {"iterations": 1, "unroll": 2, "warm_up": before, "learning_rate": rate / 3, "learning_rate_end": rate / 50},
    ]
    config["jitter"] *= noise
    return {**config, "data": {"train": data}, "seed": seed}


def without_gravity(config):
    """What learns gravity must know which way it is: not turned, not mirrored."""
    return {**config, "rotate": False, "mirror": False}


def run(tools, config):
    """Model file and the CPU seconds after each iteration."""

    def measure(path):
        made = {**copy.deepcopy(config), "output": path + ".safetensors"}
        made.pop("validate", None)
        with open(path + ".config", "w", encoding="utf-8") as file:
            json.dump(made, file)
        tools.ascc("train", path + ".config", "--threads", 1, "--resume")
        with open(path + ".csv", encoding="utf-8", newline="") as file:  # resumed runs have all of it
            return {"seconds": [float(row["cpu_seconds"]) for row in csv.DictReader(file)]}

    learnt = [(entry, File(entry["path"])) for entry in config["data"]["train"]]
    rest = [{**config, "data": None, "output": None}, [{**entry, "path": None} for entry, _ in learnt]]
    made_from = ["5", json.dumps(rest), *(path for _, path in learnt)]
    value = tools.cache.result("train", made_from, measure)
    path = tools.cache.path("train", *made_from) + ".safetensors"
    if not os.path.exists(path):
        raise Failed(f"{path} is gone; so must be the .json beside it")
    return File(path), value["seconds"]


def cost(tools, config, sample):
    """CPU seconds of an iteration of each stage: a few are run. Kept, so that a network's config stays what it was."""
    tried = copy.deepcopy(config)
    for stage in tried["stages"]:
        stage["iterations"] = sample
    _, spent = run(tools, tried)
    return (spent[sample - 1] - spent[1]) / (sample - 2), (spent[-1] - spent[sample - 1]) / sample


def train(tools, config, seconds, each):
    """A network that is given so many CPU seconds where iterations take so long each."""
    made = copy.deepcopy(config)
    for stage, share, one in zip(made["stages"], SHARES, each):
        stage["iterations"] = max(2, round(share * seconds / one))
    path, spent = run(tools, made)
    return {"path": path, "seconds": spent[-1], "iterations": len(spent)}


def tune(tools, name, data, seconds, each, tries, judge):
    """(rate, noise) of the least error by judge(path) after so many seconds: rates first, then noises at the best."""
    errors = {}
    for rates, noises in ((RATES[: tries[0]], (1,)), (None, NOISES[: tries[1]])):
        best = min(errors, key=errors.get, default=None)
        for rate in rates or best[:1]:
            for noise in noises:
                errors[rate, noise] = judge(train(tools, setup(name, data, 1, rate, noise), seconds, each)["path"])
    return min(errors, key=errors.get)
