# SPDX-License-Identifier: MIT
"""Weights that Keras saved as HDF5: a group per layer, its attribute `weight_names` their paths."""

import hdf5
from errors import ConvertError


def load(path):
    """{layer: {"kernel": array, "bias": array}} of a .h5 file."""
    with hdf5.opened(path) as file, hdf5.reading(path, "layer_names"):
        # A whole model saved with its configuration keeps the weights one group deeper.
        root = file["model_weights"] if "model_weights" in file else file
        if "layer_names" not in root.attrs:
            raise ConvertError(path, "layer_names", "missing: no Keras weights")
        return {
            layer: layer_weights(path, root, layer)
            for layer in map(text, root.attrs["layer_names"])
        }


def text(value):
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else str(value)


def layer_weights(path, root, layer):
    group = root.get(layer)
    if group is None or "weight_names" not in group.attrs:
        raise ConvertError(path, layer, "missing")
    return {
        name.split("/")[-1].split(":")[0]: hdf5.numbers(f"{path}: {layer}", group, name)
        for name in map(text, group.attrs["weight_names"])
    }
