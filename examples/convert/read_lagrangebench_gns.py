# SPDX-License-Identifier: MIT
"""GNS as LagrangeBench stores it, to a model file.

A checkpoint is a folder: `params_tree.pkl`, a pickle of nested dictionaries of names, and
`params_array.npy`, the arrays one after another in the order of the sorted names. The pickle may
build dictionaries, texts and numbers only. Names are those that Haiku gives:

    gns/~/embed                               of particle types (fluid 0, wall 1)
    gns/~_encoder/MLP{,_1}/~/linear_I         nodes, edges; each with gns/~_encoder/layer_norm{,_1}
    gns/~_processor/MLP{,_K}/~/linear_I       edges and nodes of each step in turn; likewise
    gns/~_decoder/MLP/~/linear_I

What is not in the checkpoint comes from the data's metadata.json: lengths, times, and the means
and deviations that velocities and accelerations were normalised by. Of a model file's features
`motion` and `history` the same numbers follow, so the normalisation goes into the first matrices.
"""

import io
import json
import os
import pickle
import re

import numpy as np

import gns_network
import positions
import tensorfile
from errors import ConvertError, read_file

FLUID, WALL = 0, 1


class Tree(pickle.Unpickler):
    def find_class(self, module, name):
        raise pickle.UnpicklingError(f"the tree asks for {module}.{name}")


def leaves(path, tree, prefix=""):
    """Names in the order of the arrays."""
    for key in sorted(tree):
        value = tree[key]
        if not isinstance(key, str):
            raise ConvertError(path, repr(key), "a name that is no text")
        if isinstance(value, dict):
            yield from leaves(path, value, f"{prefix}{key}|")
        else:
            yield prefix + key


def read_parameters(folder):
    """{"MODULE|PARAMETER": array}."""
    tree_path = os.path.join(folder, "params_tree.pkl")
    array_path = os.path.join(folder, "params_array.npy")
    try:
        tree = Tree(io.BytesIO(read_file(tree_path, 1 << 22))).load()
    except Exception as error:  # pickles fail in many ways
        raise ConvertError(tree_path, "", f"not read: {error}") from None
    if not isinstance(tree, dict):
        raise ConvertError(tree_path, "", "expected a dictionary")
    found, data = {}, io.BytesIO(read_file(array_path, 1 << 30))
    for name in leaves(tree_path, tree):
        try:
            found[name] = np.load(data, allow_pickle=False).astype(np.float64)
        except (ValueError, EOFError, OSError) as error:
            raise ConvertError(array_path, name, str(error)) from None
        if not np.isfinite(found[name]).all():
            raise ConvertError(array_path, name, "not finite")
    return found


class Parameters:
    """Those of a checkpoint, each taken once, with its shape checked."""

    def __init__(self, folder):
        self.folder, self.left = folder, read_parameters(folder)

    def take(self, module, name, shape):
        full = f"{module}|{name}"
        value = self.left.pop(full, None)
        if value is None:
            raise ConvertError(self.folder, full, "missing")
        if value.shape != tuple(shape):
            raise ConvertError(
                self.folder, full, f"has the shape {value.shape}, expected {tuple(shape)}"
            )
        return value

    def shape(self, module, name):
        if f"{module}|{name}" not in self.left:
            raise ConvertError(self.folder, f"{module}|{name}", "missing")
        return self.left[f"{module}|{name}"].shape


def numbered(name, number):
    return f"{name}_{number}" if number else name


class Converter:
    def __init__(self, folder, metadata_path, metadata, noise):
        self.p = Parameters(folder)
        self.tensors = {}
        self.d = positions.dimension(metadata_path, metadata, None)
        self.spacing = positions.get(metadata_path, metadata, "dx", float)
        self.find_sizes(folder)

        def numbers(key):
            value = np.asarray(metadata.get(key), np.float64)
            if value.shape != (self.d,) or not np.isfinite(value).all():
                raise ConvertError(metadata_path, key, f"expected {self.d} numbers")
            return value

        self.mean = numbers("vel_mean")
        self.deviation = np.sqrt(numbers("vel_std") ** 2 + noise**2)
        self.acc_mean = numbers("acc_mean")
        self.acc_deviation = np.sqrt(numbers("acc_std") ** 2 + noise**2)

    def find_sizes(self, folder):
        first = "gns/~_encoder/MLP"
        self.matrices = 0
        while f"{first}/~/linear_{self.matrices}|w" in self.p.left:
            self.matrices += 1
        if self.matrices < 2:
            raise ConvertError(folder, first, "fewer than two matrices")
        inputs, self.width = self.p.shape(f"{first}/~/linear_0", "w")
        kinds, self.embedding = self.p.shape("gns/~/embed", "embeddings")
        self.inputs, velocities = inputs, inputs - self.embedding
        if velocities % self.d or not 1 <= velocities // self.d <= 9 or kinds <= WALL:
            raise ConvertError(
                folder,
                f"{first}/~/linear_0",
                f"{inputs} inputs are not 1 to 9 velocities of {self.d} numbers and {self.embedding} "
                "of the type: external forces, magnitudes and distances to the walls of a box are "
                "not converted",
            )
        self.history = velocities // self.d - 1
        modules = [name for name in self.p.left if "~_processor/MLP" in name]
        self.steps = len({name.split("/~/")[0] for name in modules}) // 2

    def set(self, name, value):
        self.tensors[name] = np.ascontiguousarray(value, np.float32)

    def rest(self, module, norm, name):
        """All of a perceptron but its first matrix and bias."""
        for m in range(1, self.matrices):
            linear, w = f"{module}/~/linear_{m}", self.width
            self.set(f"{name}.{m}.weight", self.p.take(linear, "w", (w, w)))
            self.set(f"{name}.{m}.bias", self.p.take(linear, "b", (w,)))
        self.set(f"{name}.scale", self.p.take(norm, "scale", (self.width,)))
        self.set(f"{name}.offset", self.p.take(norm, "offset", (self.width,)))

    def first(self, module, inputs):
        linear = f"{module}/~/linear_0"
        return (
            self.p.take(linear, "w", (inputs, self.width)),
            self.p.take(linear, "b", (self.width,)),
        )

    def nodes(self):
        module, d, steps = "gns/~_encoder/MLP", self.d, self.history + 1
        weight, bias = self.first(module, self.inputs)
        embedding = self.p.take(
            "gns/~/embed", "embeddings", (self.p.shape("gns/~/embed", "embeddings")[0],
                                          self.embedding)
        )
        of_type = embedding @ weight[steps * d :]
        velocity = weight[: steps * d].reshape(steps, d, self.width)[::-1]  # the last comes first
        bias = bias - np.einsum("c,scw->w", self.mean / self.deviation, velocity)
        velocity = velocity * (self.spacing / self.deviation)[None, :, None]
        self.set("n0.fluid.weight", velocity.reshape(steps * d, self.width))
        self.set("n0.fluid.bias", bias + of_type[FLUID])
        self.set("n0.boundary.weight", of_type[WALL][None])
        self.set("n0.boundary.bias", bias)
        self.rest(module, "gns/~_encoder/layer_norm", "n0")

    def edges(self):
        module = "gns/~_encoder/MLP_1"
        weight, bias = self.first(module, self.d + 1)
        self.set("e0.0.weight", weight)
        self.set("e0.0.bias", bias)
        self.rest(module, "gns/~_encoder/layer_norm_1", "e0")

    def step(self, k):
        w, module, norm = self.width, "gns/~_processor/MLP", "gns/~_processor/layer_norm"
        weight, bias = self.first(numbered(module, 2 * k - 2), 3 * w)
        for i, end in enumerate(("sender", "receiver", "edge")):
            self.set(f"m{k}.{end}.weight", weight[i * w : (i + 1) * w])
        self.set(f"m{k}.receiver.bias", bias)
        self.rest(numbered(module, 2 * k - 2), numbered(norm, 2 * k - 2), f"m{k}")
        weight, bias = self.first(numbered(module, 2 * k - 1), 2 * w)
        self.set(f"n{k}.node.weight", weight[:w])
        self.set(f"n{k}.sum.weight", weight[w:])
        self.set(f"n{k}.node.bias", bias)
        self.rest(numbered(module, 2 * k - 1), numbered(norm, 2 * k - 1), f"n{k}")

    def decoder(self):
        module, w = "gns/~_decoder/MLP", self.width
        for m in range(self.matrices - 1):
            linear = f"{module}/~/linear_{m}"
            self.set(f"d.{m}.weight", self.p.take(linear, "w", (w, w)))
            self.set(f"d.{m}.bias", self.p.take(linear, "b", (w,)))
        linear = f"{module}/~/linear_{self.matrices - 1}"
        self.set("d.weight", self.p.take(linear, "w", (w, self.d)))
        bias = self.p.take(linear, "b", (self.d,))
        self.set("d.bias", bias + self.acc_mean / self.acc_deviation)

    def run(self):
        self.nodes()
        self.edges()
        for k in range(1, self.steps + 1):
            self.step(k)
        self.decoder()
        if self.p.left:
            raise ConvertError(self.p.folder, sorted(self.p.left)[0], "not known")
        return self.tensors


def convert(folder, output, options):
    path, metadata = positions.read_metadata(os.path.join(folder, "x"), options.metadata)
    made = Converter(folder, path, metadata, options.noise)
    tensors = made.run()
    dt = positions.get(path, metadata, "dt", float)
    every = positions.get(path, metadata, "write_every", int, 1)
    network = gns_network.network(
        made.d,
        made.spacing,
        dt * every,
        positions.get(path, metadata, "default_connectivity_radius", float),
        made.acc_deviation.tolist(),
        name=re.sub(r"[^\w.-]", "-", os.path.basename(os.path.normpath(folder)))[:63],
        description=f"GNS-{made.steps}-{made.width}, converted; learned gravity, too",
        gravity=[0] * made.d,  # the network has learned it with the rest
        features={
            "fluid": ["motion", "history"] if made.history else ["motion"],
            "boundary": ["one"],
        },
        history=made.history,
        steps=made.steps,
        width=made.width,
        matrices=made.matrices,
    )
    if not made.history:
        del network["history"]
    tensorfile.write(
        output,
        tensors,
        {
            "format": "ascc.model",
            "version": "1",
            "network": json.dumps(network),
            "source": f"converted from a LagrangeBench checkpoint, {os.path.basename(folder)}",
        },
    )
    floats = sum(t.size for t in tensors.values())
    print(f"{output}: GNS-{made.steps}-{made.width}, {len(tensors)} tensors, {floats} floats")
