#!/usr/bin/env python3
"""Gives the networks of examples/models their statistics of training and the distance at which errors double.

    PYTHONPATH=examples/python/src ASCC_LIBRARY=build/lib/libascc.so python3 docs/make_trust.py [NAME...]

needs NumPy, ../shared/data and build/examples/ascc; some minutes, most of them for the scenes that
`ascc generate` makes in examples/train/runs/trust. Weights stay as they are.
SPDX-License-Identifier: MIT
"""
import glob
import json
import os
import struct
import subprocess
import sys

import numpy as np

import ascc

PROGRAM, DATA, MADE = "build/examples/ascc", "../shared/data", "examples/train/runs/trust"
STRANGE = ("dam-break", "draining", "filling", "jet")  # beyond what the networks have seen
FRAMES, EVERY, WIDTH, LEAST = 400, 5, 0.1, 3


def generate(kind, *options):
    subprocess.run([PROGRAM, "generate", kind, *options], check=True)


def made(kind, dimension):
    return sorted(glob.glob(f"{MADE}/{dimension}d/{kind}_*.safetensors"))


def sequences(dimension):
    """What the networks learnt from, valid scenes, stranger ones; how many frames make a step."""
    more = ["-o", f"{MADE}/{dimension}d", "--dimension", str(dimension), "--count", "2"]
    if dimension == 2:
        more += ["--spacing", "0.0125"]
        generate("still-column", *more, "--seed", "7", "--frames", "200", "--solver", "sph")
        generate("pool-drop", *more, "--seed", "8", "--frames", "300", "--solver", "sph")
        more += ["--interval", "0.005"]
    for kind in STRANGE:
        generate(kind, *more, "--seed", "1")
    strange = [path for kind in STRANGE for path in made(kind, dimension)]
    if dimension == 2:
        given = sorted(glob.glob(f"{DATA}/wbc2d/train/*.safetensors"))
        return given[:8], given[8:], strange, 2
    given = sorted(glob.glob(f"{DATA}/liquid3d/train/*.safetensors"))
    return given, sorted(glob.glob(f"{DATA}/liquid3d/valid/*.safetensors")), strange, 1


def read(path):
    with open(path, "rb") as file:
        raw = file.read()
    size = struct.unpack("<Q", raw[:8])[0]
    header = json.loads(raw[8 : 8 + size])
    meta = header.pop("__metadata__")
    arrays = {
        name: np.frombuffer(
            raw, np.float32, int(np.prod(t["shape"])), 8 + size + t["data_offsets"][0]
        ).reshape(t["shape"])
        for name, t in header.items()
    }
    return meta, arrays


def measure(model, path, thin):
    """[distance, error in spacings] of single steps from true states."""
    meta, arrays = read(path)
    x = arrays["fluid.position"][::thin].astype(float)
    time_step, spacing = float(meta["dt"]) * thin, 2 * float(meta["particle_radius"])
    step = ascc.Step(model, measure_distance=True, time_step=time_step)
    rows = []
    for t in range(1, len(x) - 1, EVERY):
        water = ascc.Particles(model)
        water.add_fluid(x[t], (x[t] - x[t - 1]) / time_step)
        if len(arrays["boundary.position"]):
            water.add_boundary(arrays["boundary.position"], arrays["boundary.normal"])
        step.run(water, gravity=[float(g) for g in meta["gravity"].split()])
        error = np.linalg.norm(water.position - x[t + 1], axis=1).mean() / spacing
        rows.append((step.statistics.distance_mean, error))
    return rows


def threshold(valid, rows):
    """Where states as far as that have twice the error of valid scenes in the mean."""
    usual = np.mean([error for _, error in valid])
    print(f"  valid scenes: error {usual:.4f} spacings, distance {np.mean([d for d, _ in valid]):.2f}")
    found = 0.0
    for k in range(200):
        errors = [e for d, e in rows if k * WIDTH <= d < (k + 1) * WIDTH]
        if errors:
            print(f"  {k * WIDTH:.1f}: {len(errors)} states, error {np.mean(errors):.4f}")
        if not found and len(errors) >= LEAST and np.mean(errors) >= 2 * usual:
            found = k * WIDTH
    return found


def trust(name, path, training, every, *options):
    whole = f"{MADE}/{name}.safetensors"
    thin = ["--every", str(every)] if every > 1 else []
    subprocess.run(
        [PROGRAM, "trust", path, *training, "-o", whole, "--frames", str(FRAMES), *thin, *options],
        check=True,
    )
    return whole


def main(names):
    known = {d: sequences(d) for d in (2, 3) if any(f"{d}d" in name for name in names)}
    for name in names:
        path = f"examples/models/{name}.safetensors"
        training, valid, strange, thin = known[2 if "2d" in name else 3]
        if "2d" in name:
            still = made("still-column", 2) + made("pool-drop", 2)
            training = training + still
        model = ascc.Model(trust(name, path, training, thin))
        print(name)
        usual = [row for p in valid for row in measure(model, p, thin)]
        rows = usual + [row for p in strange for row in measure(model, p, 1)]
        found = threshold(usual, rows)
        print(f"  errors double at {found:.1f}")
        os.replace(trust(name, path, training, thin, "--threshold", f"{found:.1f}"), path)


os.makedirs(MADE, exist_ok=True)
main(sys.argv[1:] or ["water2d", "water2d-tiny", "water3d", "water3d-large", "water3d-tiny"])
