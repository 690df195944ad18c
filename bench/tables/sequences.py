# SPDX-License-Identifier: MIT
"""The sequences that networks learn from, are chosen by and are tested on."""

import copy
import glob
import os

import training

CHOICE = 21  # frames by which learning rate and noise are chosen


class World:
    """Sequences of one dimension: to learn from, to choose by, to be tested on; and how long networks are trained."""

    def __init__(self, tools, size, dimension, shared):
        self.flat = dimension == "2"
        self.seconds, self.seeds = (size.seconds, size.seeds) if self.flat else (size.seconds_3d, 1)
        (self.flat_ones if self.flat else self.solid_ones)(tools, size, os.path.join(shared, "data"))

    def flat_ones(self, tools, size, data):
        """What is given, with every second frame, and what is made with frames of 0.005 s."""

        def given(part, numbers):
            paths = [os.path.join(data, "wbc2d", part, f"{part}_0{i}.safetensors") for i in numbers]
            return [path for path in paths if os.path.exists(path)]

        def made(kind, frames, seed, *more):
            return tools.generated(kind, frames, seed, 0.005, "--solver", "sph", *more)

        flat = ("--dimension", "2", "--spacing", 0.0125)
        learnt = [made("wbc2d", 200, 100 + i, "--spacing", 0.0125) for i in range(size.made)]
        still = [made("still-column", 100, 7 + i, *flat) for i in range((size.made + 4) // 6)]
        drops = [made("pool-drop", 150, 8 + i, *flat) for i in range((size.made + 4) // 6)]
        self.train = [{"path": path, "every": 2} for path in given("train", range(8))]
        self.train += [{"path": path} for path in learnt + drops] + [{"path": path, "share": 2} for path in still]
        self.valid = [tools.cut(path, CHOICE, 2) for path in given("train", (8, 9))]
        self.valid += [made("wbc2d", CHOICE, 800 + i) for i in range(3)]
        known = given("test", range(2))[: size.sequences]
        self.test = [tools.cut(path, size.frames, 2) for path in known]
        self.test += [made("wbc2d", size.frames, 900 + i) for i in range(size.sequences - len(known))]

    def solid_ones(self, tools, size, data):
        """What is given, if it is there."""
        config = training.read("water3d")
        below = "../../../shared/data/"
        self.train = [
            {**entry, "path": path}
            for entry in config["data"]["train"]
            for path in sorted(glob.glob(os.path.join(data, entry["path"][len(below) :])))
        ]
        paths = [os.path.join(data, "liquid3d", "test", f"test_00{i}.safetensors") for i in range(2)]
        self.test = [tools.cut(path, size.frames, 1) for path in paths if os.path.exists(path)][: size.sequences]

    def without_gravity(self, tools):
        """The same sequences, of which networks are not told that there is gravity."""
        other = copy.copy(self)
        other.train = [{**entry, "path": tools.floating(entry["path"])} for entry in self.train]
        other.test = [tools.floating(path) for path in self.test]
        return other


def drifting_drops(tools, dimension="2"):
    """Two drops that collide while both drift: else their momentum, which errors are measured by, would be 0."""
    made = tools.generated("droplets", 2, 900, 0.005 if dimension == "2" else 0.02, "--dimension", dimension)
    return tools.drifting(made, (0.5, 0.25, 0)[: int(dimension)])
