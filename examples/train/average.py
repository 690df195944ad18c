#!/usr/bin/env python3
"""Averages the weights of model files that are the same but for these.

    python3 average.py OUT FILE=SHARE FILE=SHARE...      shares of 1 in all; the rest of OUT is the first file's

SPDX-License-Identifier: MIT
"""
import array
import json
import struct
import sys


def read(path):
    """Header, description, and data of a file of float32 tensors."""
    with open(path, "rb") as file:
        raw = file.read()
    end = 8 + struct.unpack("<Q", raw[:8])[0]
    return raw[:end], json.loads(raw[8:end]), raw[end:]


def tensor(path, description, data, name):
    if name not in description or description[name]["dtype"] != "F32":
        sys.exit(f"{path}: no tensor '{name}' of float32")
    begin, end = description[name]["data_offsets"]
    return array.array("f", data[begin:end])


def average(out, parts):
    files = [(path, float(share), *read(path)) for path, share in parts]
    if abs(sum(file[1] for file in files) - 1) > 1e-9:
        sys.exit("shares are not 1 in all")
    header, description, data = files[0][2:]
    mean = bytearray(data)
    for name in description:
        if name == "__metadata__":
            continue
        begin, end = description[name]["data_offsets"]
        total = [0.0] * ((end - begin) // 4)
        for path, share, _, other, weights in files:
            values = tensor(path, other, weights, name)
            if len(values) != len(total):
                sys.exit(f"{path}: '{name}' has another size")
            total = [t + share * v for t, v in zip(total, values)]
        mean[begin:end] = array.array("f", total).tobytes()
    with open(out, "wb") as file:
        file.write(header + bytes(mean))


if __name__ == "__main__":
    if len(sys.argv) < 4 or any("=" not in part for part in sys.argv[2:]):
        sys.exit(__doc__)
    average(sys.argv[1], [part.rsplit("=", 1) for part in sys.argv[2:]])
