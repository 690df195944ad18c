# SPDX-License-Identifier: MIT
"""Steps of a graph network of libascc's, converted from a checkpoint in LagrangeBench's layout, against the network
written down once more from what the method is: with numpy in doubles, and with Haiku where dm-haiku is installed, which
also says what such a checkpoint's names are. Run by tests/python_test.sh."""

import io
import json
import os
import pickle
import sys
import tempfile
import unittest

import numpy as np

HERE = os.path.dirname(os.path.abspath(__file__))
sys.path[:0] = [os.path.join(HERE, "support"), os.path.join(HERE, "..", "examples", "convert")]

import ascc  # noqa: E402
import convert  # noqa: E402
import tap  # noqa: E402

try:
    import haiku as hk
    import jax
    import jax.numpy as jnp
except (ImportError, AttributeError):  # not there, or not for the JAX that is
    hk = None

SPACING, RADIUS, DT, EVERY = 0.02, 0.029, 0.0003, 100
WIDTH, STEPS, FRAMES, KINDS, EMBEDDED, NOISE = 16, 3, 6, 9, 16, 3e-4
BOUND = 1e-5  # of the largest correction


def metadata(d):
    values = {"vel_mean": [1e-4, -2e-3, 3e-4], "vel_std": [3e-3, 4e-3, 2e-3]}
    values |= {"acc_mean": [1e-6, -5e-5, 2e-6], "acc_std": [5e-4, 8e-4, 4e-4]}
    return {key: v[:d] for key, v in values.items()} | {
        "dim": d,
        "dx": SPACING,
        "dt": DT,
        "write_every": EVERY,
        "default_connectivity_radius": RADIUS,
    }


def perceptrons(d):
    """Module of each perceptron, its inputs and outputs, and its norm."""
    e, p = "gns/~_encoder", "gns/~_processor"
    yield f"{e}/MLP", (FRAMES - 1) * d + EMBEDDED, WIDTH, f"{e}/layer_norm"
    yield f"{e}/MLP_1", d + 1, WIDTH, f"{e}/layer_norm_1"
    for k in range(2 * STEPS):
        tail = f"_{k}" if k else ""
        yield f"{p}/MLP{tail}", (2 if k % 2 else 3) * WIDTH, WIDTH, f"{p}/layer_norm{tail}"
    yield "gns/~_decoder/MLP", WIDTH, d, None


def parameters(d, random):
    made = {"gns/~/embed": {"embeddings": random.normal(0, 1, (KINDS, EMBEDDED))}}
    for module, inputs, outputs, norm in perceptrons(d):
        for i, (a, b) in enumerate([(inputs, WIDTH), (WIDTH, outputs)]):
            weight, bias = random.normal(0, a**-0.5, (a, b)), random.normal(0, 0.1, b)
            made[f"{module}/~/linear_{i}"] = {"w": weight, "b": bias}
        if norm:
            made[norm] = {"scale": random.normal(1, 0.1, outputs), "offset": random.normal(0, 0.1, outputs)}
    return {m: {n: v.astype(np.float32) for n, v in p.items()} for m, p in made.items()}


def write_checkpoint(folder, made, d):
    with open(os.path.join(folder, "params_tree.pkl"), "wb") as file:
        pickle.dump({m: dict.fromkeys(p, 0) for m, p in made.items()}, file)
    with open(os.path.join(folder, "params_array.npy"), "wb") as file:
        for module in sorted(made):
            for name in sorted(made[module]):
                np.save(file, made[module][name])
    with open(os.path.join(folder, "metadata.json"), "w", encoding="utf-8") as file:
        json.dump(metadata(d), file)


def converted(folder, *more):
    path = os.path.join(folder, "gns.safetensors")
    code = convert.main(["weights", "lagrangebench-gns", folder, "-o", path, *more])
    return path if code == 0 else None


# ---- The method, once more ----


def graph_of(d, positions, wall):
    """Node features, types and edges from the last positions [FRAMES][fluid][d]."""
    m = metadata(d)
    deviation = np.sqrt(np.array(m["vel_std"]) ** 2 + NOISE**2)
    still = np.broadcast_to(wall, (FRAMES, *wall.shape))
    x = np.concatenate([positions, still], 1)
    velocity = (np.diff(x, axis=0) - m["vel_mean"]) / deviation
    nodes = velocity.transpose(1, 0, 2).reshape(x.shape[1], -1)
    offset = x[-1][None] - x[-1][:, None]  # [receiver][sender]
    receiver, sender = np.nonzero((offset**2).sum(2) <= RADIUS**2)
    way = offset[receiver, sender] / RADIUS
    edges = np.concatenate([way, np.sqrt((way**2).sum(1, keepdims=True))], 1)
    kinds = np.r_[np.zeros(positions.shape[1], int), np.ones(len(wall), int)]
    return nodes, edges, sender, receiver, kinds


def with_numpy(made, nodes, edges, sender, receiver, kinds):
    def perceptron(module, norm, x):
        for i in range(2):
            p = {n: v.astype(np.float64) for n, v in made[f"{module}/~/linear_{i}"].items()}
            x = (np.maximum(x, 0) if i else x) @ p["w"] + p["b"]
        if norm:
            p = {n: v.astype(np.float64) for n, v in made[norm].items()}
            spread = np.sqrt(x.var(1, keepdims=True) + 1e-5)
            x = (x - x.mean(1, keepdims=True)) / spread * p["scale"] + p["offset"]
        return x

    d = edges.shape[1] - 1
    list_of = [(module, norm) for module, _, _, norm in perceptrons(d)]
    n = np.concatenate([nodes, made["gns/~/embed"]["embeddings"][kinds].astype(float)], 1)
    n, e = perceptron(*list_of[0], n), perceptron(*list_of[1], edges)
    for k in range(STEPS):
        message = perceptron(*list_of[2 + 2 * k], np.concatenate([n[sender], n[receiver], e], 1))
        total = np.zeros_like(n)
        np.add.at(total, receiver, message)
        n, e = n + perceptron(*list_of[3 + 2 * k], np.concatenate([n, total], 1)), e + message
    return perceptron(*list_of[-1], n)


def haiku_network(d):
    """The same as a Haiku module of the same structure: its names are those of a checkpoint."""

    def perceptron(outputs, normed=True):
        net = hk.nets.MLP([WIDTH, outputs], name="MLP")
        return hk.Sequential([net, hk.LayerNorm(-1, True, True)]) if normed else net

    class Network(hk.Module):
        def __init__(self):
            super().__init__(name="gns")
            self.embed = hk.Embed(KINDS, EMBEDDED)

        def _encoder(self, n, e):
            return perceptron(WIDTH)(n), perceptron(WIDTH)(e)

        def _processor(self, n, e, sender, receiver):
            for _ in range(STEPS):
                message = perceptron(WIDTH)(jnp.concatenate([n[sender], n[receiver], e], 1))
                total = jax.ops.segment_sum(message, receiver, len(n))
                n = n + perceptron(WIDTH)(jnp.concatenate([n, total], 1))
                e = e + message
            return n

        def _decoder(self, n):
            return perceptron(d, normed=False)(n)

        def __call__(self, nodes, edges, sender, receiver, kinds):
            n, e = self._encoder(jnp.concatenate([nodes, self.embed(kinds)], 1), edges)
            return self._decoder(self._processor(n, e, sender, receiver))

    return hk.without_apply_rng(hk.transform(lambda *graph: Network()(*graph)))


# ---- A scene, and the library's steps ----


class Forward(unittest.TestCase):
    def scene(self, d):
        random = np.random.default_rng(d)
        side = 12 if d == 2 else 5
        grid = np.stack(np.meshgrid(*[np.arange(side)] * d, indexing="ij"), -1).reshape(-1, d)
        x = (grid + 0.5 + random.uniform(-0.2, 0.2, grid.shape)) * SPACING
        v = random.uniform(-1, 1, x.shape) * 0.1 * SPACING / (DT * EVERY)
        floor = np.stack(np.meshgrid(*[np.arange(-1, side + 1)] * (d - 1), indexing="ij"), -1)
        wall = np.insert(floor.reshape(-1, d - 1).astype(float), 1, -0.5, 1) * SPACING
        return random, x, v, wall

    def check(self, d, forward):
        random, x, v, wall = self.scene(d)
        made = parameters(d, random)
        with tempfile.TemporaryDirectory() as folder:
            write_checkpoint(folder, made, d)
            path = converted(folder)
            self.assertIsNotNone(path)
            model = ascc.Model(path)
        water = ascc.Particles(model)
        water.add_fluid(x, v)
        normal = np.zeros_like(wall)
        normal[:, 1] = 1
        water.add_boundary(wall, normal)
        step, dt = ascc.Step(model), DT * EVERY
        read = lambda field: water.get(ascc.FLUID, field, dtype=float)  # noqa: E731
        start, speed = read(ascc.POSITION), read(ascc.VELOCITY)
        seen = [start - age * dt * speed for age in range(FRAMES - 1, -1, -1)]  # as if it had moved so
        m = metadata(d)
        deviation = np.sqrt(np.array(m["acc_std"]) ** 2 + NOISE**2)
        for _ in range(4):  # as long as the history changes
            out = forward(made, *graph_of(d, np.array(seen), wall))[: len(x)]
            wanted = np.asarray(out, float) * deviation + m["acc_mean"]
            step.run(water, 1)
            got = read(ascc.POSITION) - 2 * seen[-1] + seen[-2]
            largest = np.abs(wanted).max()
            self.assertGreater(largest, 0.01 * SPACING)
            self.assertLess(np.abs(got - wanted).max(), BOUND * largest)
            seen = [*seen[1:], read(ascc.POSITION)]

    def test_steps_are_those_of_the_method_in_doubles(self):
        for d in (2, 3):
            with self.subTest(dimension=d):
                self.check(d, with_numpy)

    @unittest.skipIf(hk is None, "dm-haiku is not installed")
    def test_steps_are_those_of_a_haiku_module_with_the_same_weights(self):
        for d in (2, 3):
            with self.subTest(dimension=d):
                random, x, v, wall = self.scene(d)
                graph = graph_of(d, np.broadcast_to(x, (FRAMES, *x.shape)), wall)
                network = haiku_network(d)
                names = network.init(jax.random.PRNGKey(1), *graph)
                shapes = lambda t: {m: {n: v.shape for n, v in p.items()} for m, p in t.items()}  # noqa: E731
                self.assertEqual(shapes(names), shapes(parameters(d, random)))
                self.check(d, lambda made, *graph: network.apply(made, *graph))


class Refusals(unittest.TestCase):
    def fails(self, change, says, d=2):
        made = parameters(d, np.random.default_rng(1))
        with tempfile.TemporaryDirectory() as folder:
            write_checkpoint(folder, made, d)
            change(folder, made)
            err, old = io.StringIO(), sys.stderr
            sys.stderr = err
            try:
                path = converted(folder)
            finally:
                sys.stderr = old
            self.assertIsNone(path)
            self.assertIn(says, err.getvalue())

    def test_wrong_checkpoints_are_refused_by_name(self):
        def again(change):
            def rewrite(folder, made):
                change(made)
                write_checkpoint(folder, made, 2)

            return rewrite

        def wide(made):
            made["gns/~_encoder/MLP/~/linear_0"]["w"] = np.zeros((FRAMES * 2 + EMBEDDED + 3, WIDTH))

        def metadata_of(**values):
            def rewrite(folder, made):
                with open(os.path.join(folder, "metadata.json"), "w", encoding="utf-8") as file:
                    json.dump(metadata(2) | values, file)

            return rewrite

        def tree(value):
            def rewrite(folder, made):
                with open(os.path.join(folder, "params_tree.pkl"), "wb") as file:
                    pickle.dump(value, file)

            return rewrite

        self.fails(again(lambda m: m.pop("gns/~_encoder/layer_norm")), "layer_norm|scale: missing")
        self.fails(again(lambda m: m.update({"gns/other": {"w": np.zeros(1)}})), "gns/other|w: not known")
        self.fails(again(wide), "are not 1 to 9 velocities of 2 numbers")
        self.fails(metadata_of(dim=3), "velocities of 3 numbers")
        self.fails(metadata_of(acc_std=[1.0]), "acc_std: expected 2 numbers")
        self.fails(metadata_of(dx=None), "dx: missing")
        self.fails(tree(np.zeros(3)), "the tree asks for")
        self.fails(tree([1]), "expected a dictionary")
        self.fails(
            lambda folder, made: open(os.path.join(folder, "params_array.npy"), "wb").close(), "embed|embeddings"
        )


if __name__ == "__main__":
    sys.exit(tap.main(sys.modules[__name__]))
