# SPDX-License-Identifier: MIT
"""State dictionaries of PyTorch (.pt), without PyTorch.

A .pt file is a zip archive: NAME/data.pkl, a pickle of the dictionary, and NAME/data/KEY, the raw
storage of each tensor. A pickle is a program; this one may only build dictionaries, numbers, text
and tensors: the two functions and the storage types below are all it can name, and they are ours.
"""

import collections
import io
import pickle
import zipfile
from dataclasses import dataclass

import numpy as np

from errors import ConvertError

STORAGES = {
    "FloatStorage": "<f4",
    "DoubleStorage": "<f8",
    "HalfStorage": "<f2",
    "LongStorage": "<i8",
    "IntStorage": "<i4",
}
MAX_PICKLE = 1 << 24


@dataclass(frozen=True)
class StorageType:
    dtype: str


class Refused(pickle.UnpicklingError):
    """The pickle asks for something that no tensor file needs."""


def rebuild_tensor(storage, offset, size, stride, *_):
    """A copy of the strided view [size] of a storage."""
    size, stride = tuple(size), tuple(stride)
    numbers = (offset, *size, *stride)
    if (
        not isinstance(storage, np.ndarray)
        or len(size) != len(stride)
        or len(size) > 16
        or any(type(n) is not int or n < 0 for n in numbers)
    ):
        raise Refused(f"tensor of size {size}, stride {stride}")
    last = offset + sum((n - 1) * s for n, s in zip(size, stride))
    if 0 not in size and last >= len(storage):
        raise Refused(f"tensor reaches to {last} in a storage of {len(storage)}")
    view = np.lib.stride_tricks.as_strided(
        storage[offset:] if 0 not in size else storage,
        size,
        tuple(s * storage.itemsize for s in stride),
        writeable=False,
    )
    if view.size > len(storage):
        raise Refused(f"tensor of size {size} repeats a storage of {len(storage)}")
    return np.array(view)


def rebuild_parameter(data, *_):
    return data


class Reader(pickle.Unpickler):
    ALLOWED = {
        ("collections", "OrderedDict"): collections.OrderedDict,
        ("torch._utils", "_rebuild_tensor_v2"): rebuild_tensor,
        ("torch._utils", "_rebuild_parameter"): rebuild_parameter,
        **{("torch", name): StorageType(kind) for name, kind in STORAGES.items()},
    }

    def __init__(self, data, storage_of):
        super().__init__(io.BytesIO(data))
        self.storage_of = storage_of

    def find_class(self, module, name):
        if (module, name) not in self.ALLOWED:
            raise Refused(f"refused: the pickle names {module}.{name}")
        return self.ALLOWED[module, name]

    def persistent_load(self, pid):
        if not (
            isinstance(pid, tuple)
            and len(pid) == 5
            and pid[0] == "storage"
            and isinstance(pid[1], StorageType)
        ):
            raise Refused(f"refused: persistent id {pid!r}")
        return self.storage_of(pid[1], str(pid[2]), pid[4])


def read_storage(path, archive, prefix, kind, key, count):
    name = f"{prefix}data/{key}"
    try:
        data = archive.read(name)
    except KeyError:
        raise ConvertError(path, name, "missing in the archive") from None
    kind = np.dtype(kind.dtype)
    if len(data) != count * kind.itemsize:
        raise ConvertError(path, name, f"{len(data)} bytes for {count} numbers of {kind.itemsize}")
    return np.frombuffer(data, kind)


def load(path):
    """The tensors of a .pt file by name; a checkpoint's `model` if it holds more than that."""
    try:
        with zipfile.ZipFile(path) as archive:
            value = load_archive(path, archive)
    except zipfile.BadZipFile as error:
        raise ConvertError(
            path,
            "zip",
            f"{error}: truncated, or of a PyTorch before 1.6 (load and save it again there)",
        ) from None
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
    if isinstance(value, dict) and isinstance(value.get("model"), dict):
        value = value["model"]
    if not isinstance(value, dict):
        raise ConvertError(path, "data.pkl", "expected a state dictionary")
    return {name: tensor for name, tensor in value.items() if isinstance(tensor, np.ndarray)}


def load_archive(path, archive):
    names = [
        name for name in archive.namelist() if name.endswith("data.pkl") and name.count("/") <= 1
    ]
    if len(names) != 1:
        raise ConvertError(path, "data.pkl", f"{len(names)} in the archive, expected one")
    prefix = names[0].removesuffix("data.pkl")
    if (
        prefix + "byteorder" in archive.namelist()
        and archive.read(prefix + "byteorder") != b"little"
    ):
        raise ConvertError(path, "byteorder", "only little-endian files are read")
    if archive.getinfo(names[0]).file_size > MAX_PICKLE:
        raise ConvertError(path, "data.pkl", f"more than {MAX_PICKLE} bytes")
    try:
        return Reader(
            archive.read(names[0]),
            lambda kind, key, count: read_storage(path, archive, prefix, kind, key, count),
        ).load()
    except ConvertError:
        raise
    except zipfile.BadZipFile:
        raise
    except Exception as error:  # whatever a damaged pickle makes the unpickler raise
        raise ConvertError(path, "data.pkl", str(error) or type(error).__name__) from None
