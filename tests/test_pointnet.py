# SPDX-License-Identifier: MIT
"""One step of a PointNet++ of libascc's against the network written down once more with numpy, in doubles, from what
the method is: group points around farthest ones, a small network on each, the maximum, three-point interpolation
back; and in JAX where it is installed, which shares none of numpy's arithmetic. Run by tests/python_test.sh."""

import json
import os
import struct
import sys
import unittest

import numpy as np

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "support"))

import ascc  # noqa: E402
import tap  # noqa: E402

try:
    import jax.numpy as jnp
except ImportError:
    jnp = None

SPACING, STEP, GRAVITY = 0.05, 0.01, -9.81
RADII = (2.25 * SPACING, 4.5 * SPACING, 12 * SPACING)
WIDTH = (32, 64)
RATIO, SCALE = 0.125, 0.01


def network(d):
    inputs = 2 * d + 1

    def abstraction(name, source, radius, inputs, width, **more):
        return {
            "type": "set_abstraction", "source": source, "radius": radius, "pool": "maximum", "hidden": width,
            "hidden_weight": f"{name}.0", "hidden_bias": f"{name}.0b", "weight": f"{name}.1", "bias": f"{name}.1b",
            **more,
        }  # fmt: skip

    layers = [
        {"name": "joined", "points": "all", "channels": inputs, "terms": [
            {"type": "identity", "source": "fluid"},
            {"type": "identity", "source": "boundary", "column": d}]},
        {"name": "s1", "points": "fluid", "channels": WIDTH[0], "terms": [
            abstraction("s1", "joined", RADII[0], inputs, WIDTH[0], relative=True)]},
        {"name": "s2", "points": "level1", "channels": WIDTH[1], "terms": [
            abstraction("s2", "s1", RADII[1], WIDTH[0], WIDTH[1])]},
        {"name": "both", "points": "fluid", "channels": WIDTH[0] + WIDTH[1], "terms": [
            {"type": "interpolation", "source": "s2", "nearest": 3, "radius": RADII[2]},
            {"type": "identity", "source": "s1", "column": WIDTH[1]}]},
        {"name": "last", "points": "fluid", "channels": WIDTH[0], "terms": [
            {"type": "dense", "source": "both", "weight": "last", "bias": "lastb"}]},
        {"name": "out", "points": "fluid", "channels": d, "terms": [
            {"type": "dense", "source": "last", "relu": True, "weight": "out", "bias": "outb"}]}]  # fmt: skip
    return {
        "name": "pointnet", "dimension": d, "time_step": STEP, "gravity": [0, GRAVITY, 0][:d],
        "particle_spacing": SPACING, "rest_density": 1000, "evaluate": "current",
        "features": {"fluid": ["motion"], "boundary": ["one", "normal"]},
        "levels": [{"ratio": RATIO}], "sampling": {"method": "farthest", "points": "fluid"},
        "layers": layers, "output": {"type": "plain", "source": "out", "scale": SCALE}}  # fmt: skip


def weights(d, random):
    shapes = {
        "s1.0": (3 * d + 1, WIDTH[0]), "s1.1": (WIDTH[0], WIDTH[0]),
        "s2.0": (WIDTH[0] + d, WIDTH[1]), "s2.1": (WIDTH[1], WIDTH[1]),
        "last": (WIDTH[0] + WIDTH[1], WIDTH[0]), "out": (WIDTH[0], d)}  # fmt: skip
    made = {}
    for name, shape in shapes.items():
        made[name] = random.normal(0, np.sqrt(2 / shape[0]), shape).astype(np.float32)
        made[name + "b"] = random.normal(0, 0.1, shape[1]).astype(np.float32)
    return made


def file_of(description, tensors):
    header, at = {"__metadata__": {"format": "ascc.model", "version": "1", "network": json.dumps(description)}}, 0
    for name, t in tensors.items():
        header[name] = {"dtype": "F32", "shape": list(t.shape), "data_offsets": [at, at + t.nbytes]}
        at += t.nbytes
    text = json.dumps(header).encode()
    return struct.pack("<Q", len(text)) + text + b"".join(t.tobytes() for t in tensors.values())


# ---- The method, once more ----


def layer(xp, x, w, name, rectify=True):
    y = x @ xp.asarray(w[name], float) + xp.asarray(w[name + "b"], float)
    return xp.maximum(y, 0) if rectify else y


def farthest(x, count, first):
    chosen, nearest = [first], np.full(len(x), np.inf)
    while len(chosen) < count:
        nearest = np.minimum(nearest, ((x - x[chosen[-1]]) ** 2).sum(1))
        chosen.append(int(nearest.argmax()))
    return np.array(chosen)


def abstract(xp, w, name, x, f, query, radius, own=None):
    """Maximum over all points within the radius of each query."""
    offset = x[None] - query[:, None]
    value = xp.broadcast_to(f[None], (len(query), *f.shape))
    if own is not None:
        value = value - own[:, None]
    y = layer(xp, layer(xp, xp.concatenate([value, xp.asarray(offset / radius)], 2), w, name + ".0"), w, name + ".1")
    return xp.where(((offset**2).sum(2) > radius**2)[:, :, None], -np.inf, y).max(1)


def interpolate(xp, x, f, query, radius):
    square = ((query[:, None] - x[None]) ** 2).sum(2) / radius**2
    nearest = np.argsort(square, 1)[:, :3]
    weight = xp.asarray(1 / (np.take_along_axis(square, nearest, 1) + 1e-6))
    return (f[nearest] * weight[:, :, None]).sum(1) / weight.sum(1, keepdims=True)


def correction(xp, w, d, x, v, wall, normal, first):
    """Who is whose neighbour is numpy's; what networks make of it xp's."""
    motion = v * STEP / SPACING
    f = np.zeros((len(x) + len(wall), 2 * d + 1))
    f[: len(x), :d], f[len(x) :, d], f[len(x) :, d + 1 :] = motion, 1, normal
    f = xp.asarray(f)
    s1 = abstract(xp, w, "s1", np.concatenate([x, wall]), f, x, RADII[0], own=f[: len(x)])
    chosen = farthest(x, int(np.ceil(RATIO * len(x))), first)
    s2 = abstract(xp, w, "s2", x, s1, x[chosen], RADII[1])
    both = xp.concatenate([interpolate(xp, x[chosen], s2, x, RADII[2]), s1], 1)
    return np.asarray(SCALE * layer(xp, layer(xp, both, w, "last"), w, "out", rectify=False), float)


class Forward(unittest.TestCase):
    def check(self, d, xp):
        random = np.random.default_rng(d)
        side = 24 if d == 2 else 8
        grid = np.stack(np.meshgrid(*[np.arange(side)] * d, indexing="ij"), -1).reshape(-1, d)
        x = (grid + 1.5 + random.uniform(-0.3, 0.3, grid.shape)) * SPACING
        x[0] = 0.3 * SPACING  # alone in the first cell: where farthest points begin
        v = random.uniform(-1, 1, x.shape)
        floor = np.stack(np.meshgrid(*[np.arange(side + 2)] * (d - 1), indexing="ij"), -1).reshape(-1, d - 1)
        wall = np.insert(floor.astype(float), 1, -0.4, 1) * SPACING
        normal = np.zeros_like(wall)
        normal[:, 1] = 1
        description = network(d)
        w = weights(d, random)
        model = ascc.Model.from_bytes(file_of(description, w))
        water = ascc.Particles(model)
        water.add_fluid(x, v)
        water.add_boundary(wall, normal)
        start, speed = (water.get(ascc.FLUID, f, dtype=float) for f in (ascc.POSITION, ascc.VELOCITY))
        ascc.Step(model).run(water, 1)
        gravity = np.array([0, GRAVITY, 0][:d])
        advanced = speed + STEP * gravity
        wanted = correction(xp, w, d, start, advanced, wall, normal, 0)
        got = water.get(ascc.FLUID, ascc.POSITION, dtype=float) - start - STEP * advanced
        largest = np.abs(wanted).max()
        self.assertGreater(largest, 1e-3 * SPACING)
        error = np.abs(got - wanted).max() / largest
        print(f"# {d}D: {error:.2g} of the largest correction")
        self.assertLess(error, 1e-5)

    def test_a_step_is_that_of_the_method_in_doubles(self):
        for d in (2, 3):
            with self.subTest(dimension=d):
                self.check(d, np)

    @unittest.skipIf(jnp is None, "jax is not installed")
    def test_a_step_is_that_of_jax_with_the_same_weights(self):
        for d in (2, 3):
            with self.subTest(dimension=d):
                self.check(d, jnp)


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
