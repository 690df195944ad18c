# SPDX-License-Identifier: MIT
"""Published networks as safetensors files (metadata format `ascc.weights`), which `ascc convert`
makes model files of.

dmcf-liquid3d.json and cconv-liquid3d.json say what the networks are: every tensor with its shape,
and the metadata the file carries. A checkpoint must hold exactly these tensors. Kernels keep
their axis order [z,y,x,in,out]; dense kernels are [in,out], so PyTorch's are transposed.

If the tensors are the published ones bit for bit, the file says so in `source`; else it says what
it was converted from.
"""

import hashlib
import json
import os
import re

import numpy as np

import read_bundle
import read_keras
import read_torch
import sequence
import tensorfile
from errors import ConvertError

HERE = os.path.dirname(os.path.abspath(__file__))
GRAVITY = (0.0, -9.81, 0.0)


def network(name):
    with open(os.path.join(HERE, name + ".json"), encoding="utf-8") as file:
        return json.load(file)


def dmcf_object(name):
    """The path of Python attributes in DMCF's checkpoint that leads to a tensor."""
    layer, kind = name.rsplit(".", 1)
    first = {
        "conv_fluid": "fluid_convs",
        "conv_obstacle": "obs_convs",
        "dense_fluid": "fluid_dense",
        "dense_obstacle": "obs_dense",
        "sym0": "sym_convs/0",
    }
    if layer in first:
        return f"model/{first[layer]}/{kind.removesuffix('_half')}"
    found = re.fullmatch(r"l(\d+)\.conv_(\d+)_(\d+)", layer)
    if found:  # convs[layer - 1][to][0][from]
        number, source, target = map(int, found.groups())
        return f"model/convs/{number - 1}/{target}/0/{source}/{kind}"
    number, branch = map(int, re.fullmatch(r"l(\d+)\.dense_(\d+)", layer).groups())
    return f"model/denses/{number - 1}/{branch}/0/{branch}/{kind}"


def read_dmcf(path, names):
    bundle = read_bundle.Bundle(path)
    layers = len(bundle.node("model/convs")[0])
    if layers != 3:
        raise ConvertError(
            bundle.index,
            "model/convs",
            f"{layers} trunk layers, the Liquid3d network "
            "has 3; DMCF's 2D networks are not converted",
        )
    return {name: bundle.variable(dmcf_object(name)) for name in names}


def read_cconv_keras(path, names):
    layers, tensors = read_keras.load(path), {}
    for name in names:
        layer, kind = name.split(".")
        if kind not in layers.get(layer, {}):
            raise ConvertError(path, name, "missing")
        tensors[name] = layers[layer][kind]
    refuse_others(path, [f"{layer}.{kind}" for layer in layers for kind in layers[layer]], names)
    return tensors


def read_cconv_torch(path, names):
    state, tensors, used = read_torch.load(path), {}, []
    for name in names:
        key = name.replace(".kernel", ".weight") if name.startswith("dense") else name
        if key not in state:
            raise ConvertError(path, key, "missing")
        if key != name and state[key].ndim != 2:
            raise ConvertError(path, key, f"shape {list(state[key].shape)}, expected [out, in]")
        tensors[name] = state[key].T if key != name else state[key]
        used.append(key)
    check_buffers(path, state)
    refuse_others(
        path, [key for key in state if key != "gravity" and not key.endswith(".offset")], used
    )
    return tensors


def check_buffers(path, state):
    """What the network holds besides weights, and the file states in its metadata."""
    gravity = state.get("gravity", np.float32(GRAVITY))
    if not np.array_equal(gravity.astype(np.float32), np.float32(GRAVITY)):
        raise ConvertError(path, "gravity", f"{gravity.tolist()}, expected {list(GRAVITY)}")
    for key, value in state.items():
        if key.endswith(".offset") and value.any():
            raise ConvertError(path, key, f"{value.tolist()}, expected zeros")


def refuse_others(path, found, known):
    other = sorted(set(found) - set(known))
    if other:
        raise ConvertError(path, other[0], f"not part of the network ({len(other)} such tensors)")


READERS = {
    "dmcf": ("dmcf-liquid3d", read_dmcf),
    "cconv-h5": ("cconv-liquid3d", read_cconv_keras),
    "cconv-pt": ("cconv-liquid3d", read_cconv_torch),
}


def check_tensor(path, name, tensor, shape):
    if list(tensor.shape) != shape:
        raise ConvertError(path, name, f"shape {list(tensor.shape)}, expected {shape}")
    if tensor.dtype != np.float32:
        raise ConvertError(path, name, f"type {tensor.dtype}, expected float32")
    sequence.check_finite(path, name, tensor)


def metadata(path, description, tensors):
    digest = hashlib.sha256(
        b"".join(np.ascontiguousarray(tensor, "<f4").tobytes() for tensor in tensors.values())
    ).hexdigest()
    values = dict(description["metadata"])
    values["architecture"] = json.dumps(values["architecture"])
    values["floats"] = str(sum(tensor.size for tensor in tensors.values()))
    if digest != description["published_sha256"]:
        values["source"] = f"converted from {os.path.basename(path)}"
        values.pop("trained_with", None)
    return values


def convert(kind, path, output):
    name, reader = READERS[kind]
    description = network(name)
    tensors = reader(path, list(description["tensors"]))
    for tensor, shape in description["tensors"].items():
        check_tensor(path, tensor, tensors[tensor], shape)
    values = metadata(path, description, tensors)
    tensorfile.write(output, tensors, values)
    print(
        f"{output}: {name}, {len(tensors)} tensors, {values['floats']} floats; {values['source']}"
    )
