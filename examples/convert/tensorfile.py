# SPDX-License-Identifier: MIT
"""safetensors files: written whole or not at all, the same bytes for the same content.

Layout: 8 bytes little-endian header length, JSON header padded with spaces to a multiple of eight,
then the tensors in the order of the header, without gaps.
"""

import json
import os

import numpy as np

from errors import ConvertError, read_file


def encode(tensors, metadata):
    """The pieces of the file: header bytes, then each tensor's bytes."""
    header, offset, pieces = {"__metadata__": metadata}, 0, []
    for name, tensor in tensors.items():
        piece = np.ascontiguousarray(tensor, "<f4")
        header[name] = {
            "dtype": "F32",
            "shape": list(piece.shape),
            "data_offsets": [offset, offset + piece.nbytes],
        }
        offset += piece.nbytes
        pieces.append(piece)
    text = json.dumps(header, separators=(",", ":"), ensure_ascii=False).encode()
    text += b" " * (-len(text) % 8)
    return [len(text).to_bytes(8, "little"), text, *pieces]


def write(path, tensors, metadata):
    """Writes beside the target under another name, then renames."""
    path = os.fspath(path)
    partial = path + ".partial"
    try:
        try:
            with open(partial, "wb") as file:
                for piece in encode(tensors, metadata):
                    file.write(piece)
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, path)
        except BaseException:
            if os.path.exists(partial):
                os.unlink(partial)
            raise
    except OSError as error:
        raise ConvertError(path, "", f"cannot write: {error.strerror or error}") from None


def read(path):
    """(tensors, metadata) of an F32 file; used by the tests and by `inspect`."""
    data = read_file(path)
    size = int.from_bytes(data[:8], "little")
    if len(data) < 8 or size > len(data) - 8:
        raise ConvertError(path, "header", "the file ends inside it")
    try:
        header = json.loads(data[8 : 8 + size])
    except ValueError as error:
        raise ConvertError(path, "header", f"not JSON: {error}") from None
    metadata, tensors = header.pop("__metadata__", {}), {}
    body = memoryview(data)[8 + size :]
    for name, entry in header.items():
        begin, end = entry["data_offsets"]
        count = int(np.prod(entry["shape"], dtype=np.int64))
        if (
            entry["dtype"] != "F32"
            or not 0 <= begin <= end <= len(body)
            or end - begin != 4 * count
        ):
            raise ConvertError(path, name, "dtype, shape and offsets do not fit the file")
        tensors[name] = np.frombuffer(body[begin:end], "<f4").reshape(entry["shape"])
    return tensors, metadata
