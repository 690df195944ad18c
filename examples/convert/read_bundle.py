# SPDX-License-Identifier: MIT
"""TensorFlow checkpoints (tensor bundles), without TensorFlow.

PREFIX.index is a sorted-string table as in LevelDB: blocks of (key, value) whose keys share
prefixes, an index block, and a footer of 48 bytes. Its values are BundleEntryProto: dtype, shape,
and where in PREFIX.data-00000-of-0000N the tensor lies. The key
_CHECKPOINTABLE_OBJECT_GRAPH names how the saved Python objects hang together, which is what turns
keys into the variables of the network. Every block's and every tensor's CRC-32C is checked.
"""

import os
import struct
from dataclasses import dataclass

import numpy as np

import wire
from crc32c import crc32c, mask, masked_crc32c
from errors import ConvertError, read_file

MAGIC = 0xDB4775248B80FB57
GRAPH_KEY = "_CHECKPOINTABLE_OBJECT_GRAPH"
FLOAT, STRING = 1, 7
DTYPES = {1: "<f4", 2: "<f8", 3: "<i4", 9: "<i8"}
MAX_BYTES = 1 << 32


def snappy(data):
    """A raw snappy block: a length, then literals and copies of what is already there."""
    size, at = wire.varint(data, 0)
    if size > MAX_BYTES:
        raise wire.WireError(f"snappy block of {size} bytes")
    out = bytearray()
    while at < len(data):
        tag = data[at]
        at += 1
        kind, length, offset = tag & 3, (tag >> 2) + 1, 0
        extra = max(0, length - 60) if kind == 0 else (1, 2, 4)[kind - 1]
        if at + extra > len(data):
            raise wire.WireError("snappy block ends inside a tag")
        number = int.from_bytes(data[at : at + extra], "little")
        at += extra
        if kind == 0:
            length = number + 1 if extra else length
            if at + length > len(data):
                raise wire.WireError("snappy literal longer than its block")
            out += data[at : at + length]
            at += length
            continue
        if kind == 1:
            length, offset = (tag >> 2 & 7) + 4, (tag >> 5) << 8 | number
        else:
            offset = number
        if not 0 < offset <= len(out) or len(out) + length > size:
            raise wire.WireError("snappy copy from outside the block")
        for _ in range(length):
            out.append(out[-offset])
    if len(out) != size:
        raise wire.WireError(f"snappy block gives {len(out)} bytes, says {size}")
    return bytes(out)


class Table:
    """The (key, value) pairs of a .index file."""

    def __init__(self, path):
        self.path = path
        self.data = read_file(path, 1 << 28)
        if len(self.data) < 48 or struct.unpack("<Q", self.data[-8:])[0] != MAGIC:
            raise ConvertError(path, "footer", "no tensor-bundle index, or truncated")

    def block(self, name, handle):
        offset, at = wire.varint(handle, 0)
        size, _ = wire.varint(handle, at)
        if offset + size + 5 > len(self.data) - 48:
            raise ConvertError(self.path, name, f"{size} bytes at {offset}: outside the file")
        body, kind = self.data[offset : offset + size], self.data[offset + size]
        crc = struct.unpack("<I", self.data[offset + size + 1 : offset + size + 5])[0]
        if masked_crc32c(self.data[offset : offset + size + 1]) != crc:
            raise ConvertError(self.path, name, "checksum does not match")
        if kind not in (0, 1):
            raise ConvertError(self.path, name, f"compression {kind} is unknown")
        return snappy(body) if kind == 1 else body

    def pairs(self, name, block):
        if len(block) < 4:
            raise ConvertError(self.path, name, "too short")
        restarts = struct.unpack("<I", block[-4:])[0]
        end = len(block) - 4 - 4 * restarts
        if end < 0:
            raise ConvertError(self.path, name, f"{restarts} restarts in {len(block)} bytes")
        at, key = 0, b""
        while at < end:
            shared, at = wire.varint(block, at)
            rest, at = wire.varint(block, at)
            size, at = wire.varint(block, at)
            if shared > len(key) or at + rest + size > end:
                raise ConvertError(self.path, name, "entry longer than its block")
            key = key[:shared] + block[at : at + rest]
            yield key, block[at + rest : at + rest + size]
            at += rest + size

    def __iter__(self):
        footer = self.data[-48:]
        try:
            _, at = wire.varint(footer, 0)
            _, at = wire.varint(footer, at)
            index = self.block("index block", footer[at:])
            for i, (_, handle) in enumerate(self.pairs("index block", index)):
                yield from self.pairs(f"block {i}", self.block(f"block {i}", handle))
        except wire.WireError as error:
            raise ConvertError(self.path, "table", str(error)) from None


@dataclass
class Entry:
    dtype: int = 0
    shape: tuple = ()
    shard: int = 0
    offset: int = 0
    size: int = 0
    crc: int = 0
    sliced: bool = False


def entry_of(value):
    e = Entry()
    for field, kind, item in wire.fields(value):
        if field == 1 and kind == 0:
            e.dtype = item
        elif field == 2 and kind == 2:
            sizes = [wire.integers(dim).get(1, 0) for dim in wire.messages(item, 2)]
            e.shape = tuple(wire.signed(size) for size in sizes)
        elif field == 3 and kind == 0:
            e.shard = item
        elif field == 4 and kind == 0:
            e.offset = item
        elif field == 5 and kind == 0:
            e.size = item
        elif field == 6 and kind == 5:
            e.crc = struct.unpack("<I", item)[0]
        elif field == 7:
            e.sliced = True
    return e


class Bundle:
    """A checkpoint: `tensor(key)` by key, `keys_of(path)` by the path of Python attributes."""

    def __init__(self, path):
        self.prefix = os.fspath(path).removesuffix(".index")
        self.index = self.prefix + ".index"
        self.entries, self.shards, header = {}, {}, None
        for key, value in Table(self.index):
            if key == b"":
                header = value
                continue
            name = key.decode("utf-8", "replace")
            try:
                self.entries[name] = entry_of(value)
            except wire.WireError as error:
                raise ConvertError(self.index, name, str(error)) from None
        if header is None:
            raise ConvertError(self.index, "header", "missing")
        self.read_header(header)
        self.nodes = self.read_graph()

    def read_header(self, header):
        try:
            found = wire.integers(header)
            version = wire.integers(b"".join(wire.messages(header, 3)))
        except wire.WireError as error:
            raise ConvertError(self.index, "header", str(error)) from None
        self.shard_count = found.get(1, 0)
        if found.get(2, 0) != 0:
            raise ConvertError(self.index, "header", "big-endian tensors are not read")
        if version.get(1, 0) != 1 or version.get(2, 0) > 1:
            raise ConvertError(
                self.index,
                "header",
                f"unknown version: producer {version.get(1, 0)}, "
                f"min_consumer {version.get(2, 0)}; version 1 is read",
            )

    def raw(self, name):
        e = self.entries.get(name)
        if e is None:
            raise ConvertError(self.index, name, "missing")
        if e.sliced:
            raise ConvertError(self.index, name, "partitioned variables are not read")
        if e.shard >= self.shard_count:
            raise ConvertError(self.index, name, f"shard {e.shard} of {self.shard_count}")
        if e.shard not in self.shards:
            path = f"{self.prefix}.data-{e.shard:05d}-of-{self.shard_count:05d}"
            self.shards[e.shard] = (path, read_file(path, MAX_BYTES))
        path, data = self.shards[e.shard]
        if e.offset + e.size > len(data):
            raise ConvertError(
                path, name, f"truncated: {e.size} bytes at {e.offset}, the file has {len(data)}"
            )
        return path, e, data[e.offset : e.offset + e.size]

    def tensor(self, name):
        path, e, data = self.raw(name)
        if e.dtype not in DTYPES:
            raise ConvertError(self.index, name, f"dtype {e.dtype} is no number that is read")
        if masked_crc32c(data) != e.crc:
            raise ConvertError(path, name, "checksum does not match")
        kind, count = np.dtype(DTYPES[e.dtype]), 1
        for size in e.shape:
            count *= max(0, size)
        if count * kind.itemsize != len(data):
            raise ConvertError(self.index, name, f"{len(data)} bytes for shape {list(e.shape)}")
        return np.frombuffer(data, kind).reshape(e.shape)

    def text(self, name):
        """A scalar string: its length as a varint, the masked CRC of that, its bytes.

        The two checksums are not taken over the stored length but over it as four bytes, or eight
        where it needs them; the entry's goes on over the rest."""
        path, e, data = self.raw(name)
        if e.dtype != STRING or e.shape != ():
            raise ConvertError(self.index, name, "expected a string")
        try:
            length, at = wire.varint(data, 0)
        except wire.WireError as error:
            raise ConvertError(path, name, str(error)) from None
        if at + 4 + length != len(data):
            raise ConvertError(path, name, f"string of {length} bytes in {len(data)}")
        fixed = length.to_bytes(4 if length < 1 << 32 else 8, "little")
        stored = data[at : at + 4]
        if (
            mask(crc32c(fixed)) != struct.unpack("<I", stored)[0]
            or mask(crc32c(fixed + stored + data[at + 4 :])) != e.crc
        ):
            raise ConvertError(path, name, "checksum does not match")
        return data[at + 4 :]

    def read_graph(self):
        """[(children {name: node}, keys {variable: key})] of the saved objects."""
        nodes = []
        try:
            for node in wire.messages(self.text(GRAPH_KEY), 1):
                children, keys = {}, {}
                for child in wire.messages(node, 1):
                    children[wire.texts(child).get(2, "")] = wire.integers(child).get(1, 0)
                for attribute in wire.messages(node, 2):
                    found = wire.texts(attribute)
                    keys[found.get(1, "")] = found.get(3, "")
                nodes.append((children, keys))
        except wire.WireError as error:
            raise ConvertError(self.index, GRAPH_KEY, str(error)) from None
        return nodes

    def node(self, path):
        """The children and keys of the object that `path` (a/b/c, from the root) leads to."""
        at = 0
        for part in path.split("/"):
            at = self.nodes[at][0].get(part, -1) if at < len(self.nodes) else -1
            if not 0 <= at < len(self.nodes):
                raise ConvertError(self.index, path, f"no object {part!r} in the checkpoint")
        return self.nodes[at]

    def variable(self, path):
        """The tensor of the variable that a path of attributes leads to."""
        key = self.node(path)[1].get("VARIABLE_VALUE")
        if key is None:
            raise ConvertError(self.index, path, "not a variable")
        return self.tensor(key)
