# SPDX-License-Identifier: MIT
"""Weights that Keras saved as HDF5: a group per layer, its attribute `weight_names` their paths."""

import os

from errors import ConvertError


def load(path):
    """{layer: {"kernel": array, "bias": array}} of a .h5 file."""
    import h5py
    if not os.path.isfile(path):
        raise ConvertError(path, "", "no such file")
    try:
        file = h5py.File(path, "r")
    except OSError as error:
        raise ConvertError(path, "HDF5", f"not readable, or truncated: {error}") from None
    with file:
        # A whole model saved with its configuration keeps the weights one group deeper.
        root = file["model_weights"] if "model_weights" in file else file
        if "layer_names" not in root.attrs:
            raise ConvertError(path, "layer_names", "missing: no Keras weights")
        return {layer: layer_weights(path, root, layer)
                for layer in (text(name) for name in root.attrs["layer_names"])}


def text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def layer_weights(path, root, layer):
    group = root.get(layer)
    if group is None or "weight_names" not in group.attrs:
        raise ConvertError(path, layer, "missing")
    weights = {}
    for name in (text(value) for value in group.attrs["weight_names"]):
        if name not in group or not hasattr(group[name], "dtype") or group[name].dtype.kind != "f":
            raise ConvertError(path, f"{layer}/{name}", "missing, or not floating point")
        try:
            weights[name.split("/")[-1].split(":")[0]] = group[name][()]
        except OSError as error:
            raise ConvertError(path, f"{layer}/{name}", f"cannot be read: {error}") from None
    return weights
