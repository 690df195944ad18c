# SPDX-License-Identifier: MIT
"""HDF5 files whose damage is a clear error: h5py raises many kinds, depending on what is hit."""

import contextlib
import os

from errors import ConvertError

DAMAGE = (OSError, RuntimeError, KeyError, ValueError, TypeError, AttributeError, MemoryError)


@contextlib.contextmanager
def reading(path, field):
    """Turns what h5py raises inside into an error that names file and field."""
    try:
        yield
    except DAMAGE as error:
        raise ConvertError(path, field, f"not readable, damaged or truncated: {error}") from None


def opened(path):
    """The open file."""
    import h5py

    if not os.path.isfile(path):
        raise ConvertError(path, "", "no such file")
    with reading(path, "HDF5"):
        return h5py.File(path, "r")


def numbers(where, group, name):
    """The dataset `name` of a group as an array of numbers."""
    import h5py

    with reading(where, name):
        item = group.get(name) if isinstance(group, h5py.Group) else None
        if not isinstance(item, h5py.Dataset):
            raise ConvertError(where, name, "missing")
        if item.dtype.kind not in "fiu":
            raise ConvertError(where, name, f"type {item.dtype}, expected numbers")
        return item[()]
