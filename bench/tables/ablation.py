# SPDX-License-Identifier: MIT
"""The networks of Table 2: examples/train/ablation2d.json with one thing after the other, trained."""

import training

# Row, what is taken from the config, what that leaves. Each row keeps what those above it have, but for sampling.
ROWS = [
    ("no ASCC", {"output": "plain", "levels": 0}, "short", "a plain convolution at the end, one scale"),
    ("+ ASCC", {"levels": 0}, "short", "pair impulses at the end"),
    ("+ multi-scale, farthest points", {"sampling": "farthest"}, "short", "two coarser levels of farthest points"),
    ("+ multi-scale, voxels", {}, "short", "of lattices in their place"),
    ("+ preprocessing", {}, "warm", "up to eight steps without gradient before a rollout of two"),
    ("full", {}, "long", "then rollouts of four steps behind sixteen"),
]


def config_of(network, schedule, data, seed, percent):
    """The config of a row. All have as many iterations; what is short trains on in its place."""
    config = training.read("ablation2d")
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
    return {**config, "data": {"train": data}, "seed": seed}
