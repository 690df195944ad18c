# SPDX-License-Identifier: MIT
"""Writers of the published formats, from their specifications, for the tests only."""

import io
import json
import os
import pickle
import struct
import zipfile

import numpy as np

from crc32c import crc32c, mask, masked_crc32c

# ---- msgpack-numpy and zstd shards ----


def encoded(array):
    """An array or numpy number as msgpack-numpy packs it."""
    array = np.asarray(array)
    if array.ndim == 0:
        return {b"nd": False, b"type": array.dtype.str, b"data": array.tobytes()}
    return {
        b"nd": True,
        b"type": array.dtype.str,
        b"kind": b"",
        b"shape": list(array.shape),
        b"data": array.tobytes(),
    }


def write_shard(path, frames):
    import msgpack
    import zstandard

    packed = msgpack.packb(
        [
            {
                key: value if isinstance(value, (str, dict, int)) else encoded(value)
                for key, value in frame.items()
            }
            for frame in frames
        ],
        use_bin_type=True,
    )
    with open(path, "wb") as file:
        file.write(zstandard.ZstdCompressor(level=3).compress(packed))


def scene_frames(name="sim_0001", first=0, count=4, dim=3, particles=8, seed=1):
    """Frames of a lattice that drifts; positions and velocities agree at the set's frame time."""
    rng = np.random.default_rng(seed)
    dt, spacing = (0.02, 0.05) if dim == 3 else (0.0025, 0.005)
    cells = np.arange(particles)
    start = np.stack([cells % 2, cells // 2 % 2, cells // 4], -1) * spacing
    if dim == 2:
        start = np.stack([cells % 4, cells // 4, 0 * cells], -1) * spacing
    velocity = np.float32(rng.normal(size=3) * [1, 1, dim - 2])
    box = np.float32([[0, -1, 0], [1, -1, 0], [0, -1, dim - 2]])
    frames = []
    for i in range(first, first + count):
        frames.append(
            {
                "frame_id": np.int64(i),
                "scene_id": name,
                "pos": np.float32(start + i * dt * velocity),
                "vel": np.float32(np.tile(velocity, (particles, 1))),
                "m": np.full(particles, 0.125, np.float32),
                "viscosity": np.full(particles, 0.01, np.float32),
            }
        )
    frames[0]["box"], frames[0]["box_normals"] = box, np.float32([[0, 1, 0]] * 3)
    return frames


# ---- protocol buffers, TFRecord ----


def varint(value):
    out = bytearray()
    value &= 0xFFFFFFFFFFFFFFFF
    while value >= 0x80:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes(out) + bytes([value])


def field(number, value):
    """One field: an int as varint, bytes or text with their length."""
    if isinstance(value, int):
        return varint(number << 3) + varint(value)
    value = value.encode() if isinstance(value, str) else bytes(value)
    return varint(number << 3 | 2) + varint(len(value)) + value


def bytes_feature(values):
    return field(1, b"".join(field(1, value) for value in values))


def int64_feature(values):
    return field(3, field(1, b"".join(map(varint, values))))


def map_entry(key, value):
    return field(1, field(1, key) + field(2, value))


def sequence_example(key, kinds, position):
    """learning_to_simulate's record: context key and particle_type, feature list position."""
    context = map_entry("key", int64_feature([key])) + map_entry(
        "particle_type", bytes_feature([np.asarray(kinds, "<i8").tobytes()])
    )
    steps = b"".join(
        field(1, bytes_feature([np.asarray(frame, "<f4").tobytes()])) for frame in position
    )
    return field(1, context) + field(2, map_entry("position", steps))


def write_tfrecord(path, records):
    with open(path, "wb") as file:
        for record in records:
            length = struct.pack("<Q", len(record))
            file.write(
                length
                + struct.pack("<I", masked_crc32c(length))
                + record
                + struct.pack("<I", masked_crc32c(record))
            )


# ---- tensor bundles ----


def snappy_compress(data):
    """Raw snappy with literals and all three kinds of copies."""
    out, seen, literal, at = bytearray(varint(len(data))), {}, bytearray(), 0

    def flush():
        for begin in range(0, len(literal), 300):
            piece = literal[begin : begin + 300]
            size = len(piece) - 1
            out.extend(
                bytes([size << 2])
                if size < 60
                else (
                    bytes([60 << 2, size])
                    if size < 256
                    else bytes([61 << 2, size & 255, size >> 8])
                )
            )
            out.extend(piece)
        literal.clear()

    while at < len(data):
        start = seen.get(data[at : at + 4], -1)
        seen[data[at : at + 4]] = at
        length = 0
        while (
            start >= 0
            and length < 60
            and at + length < len(data)
            and data[start + length] == data[at + length]
        ):
            length += 1
        if length < 4:
            literal.append(data[at])
            at += 1
            continue
        flush()
        offset = at - start
        if length < 12 and offset < 2048:
            out.extend([offset >> 8 << 5 | length - 4 << 2 | 1, offset & 255])
        elif offset < 1 << 15:
            out.extend(bytes([length - 1 << 2 | 2]) + struct.pack("<H", offset))
        else:
            out.extend(bytes([length - 1 << 2 | 3]) + struct.pack("<I", offset))
        at += length
    flush()
    return bytes(out)


def table_block(pairs):
    """Entries with shared prefixes, a restart every 16."""
    out, restarts, last = bytearray(), [], b""
    for i, (key, value) in enumerate(pairs):
        shared = 0
        if i % 16 == 0:
            restarts.append(len(out))
        else:
            while shared < min(len(key), len(last)) and key[shared] == last[shared]:
                shared += 1
        out += (
            varint(shared) + varint(len(key) - shared) + varint(len(value)) + key[shared:] + value
        )
        last = key
    restarts = restarts or [0]
    return bytes(out) + b"".join(struct.pack("<I", at) for at in restarts + [len(restarts)])


def write_table(path, pairs, compress, per_block=20):
    out, handles = bytearray(), []

    def add(block, kind):
        body = snappy_compress(block) if kind else block
        handle = varint(len(out)) + varint(len(body))
        body += bytes([kind])
        out.extend(body + struct.pack("<I", masked_crc32c(body)))
        return handle

    for begin in range(0, len(pairs), per_block):
        part = pairs[begin : begin + per_block]
        handles.append((part[-1][0] + b"\xff", add(table_block(part), 1 if compress else 0)))
    meta, index = add(table_block([]), 0), add(table_block(handles), 0)
    footer = (meta + index).ljust(40, b"\0") + struct.pack("<Q", 0xDB4775248B80FB57)
    with open(path, "wb") as file:
        file.write(bytes(out) + footer)


def object_graph(paths, keys):
    """TrackableObjectGraph of a tree of attribute paths; the variables' keys are given."""
    nodes = [({}, None)]
    for path in paths:
        at = 0
        for part in path.split("/"):
            if part not in nodes[at][0]:
                nodes.append(({}, None))
                nodes[at][0][part] = len(nodes) - 1
            at = nodes[at][0][part]
        nodes[at] = (nodes[at][0], keys[path])
    return b"".join(
        field(
            1,
            b"".join(field(1, field(1, child) + field(2, name)) for name, child in children.items())
            + (field(2, field(1, "VARIABLE_VALUE") + field(3, key)) if key else b""),
        )
        for children, key in nodes
    )


def write_bundle(prefix, variables, compress=False, version=1, shards=1, key_of=None):
    """A checkpoint of {attribute path: array}; the arrays go round the data shards."""
    key_of = key_of or (lambda path: path + "/.ATTRIBUTES/VARIABLE_VALUE")
    keys = {path: key_of(path) for path in variables}
    data, pairs = [bytearray() for _ in range(shards)], []
    types = {"float32": 1, "float64": 2, "int64": 9}

    def entry(kind, shape, shard, size, crc):
        dims = b"".join(field(2, field(1, n)) for n in shape)
        return (
            field(1, kind)
            + field(2, dims)
            + field(3, shard)
            + field(4, len(data[shard]))
            + field(5, size)
            + varint(6 << 3 | 5)
            + struct.pack("<I", crc)
        )

    for i, (path, array) in enumerate(sorted(variables.items(), key=lambda item: keys[item[0]])):
        shard, body = i % shards, np.ascontiguousarray(array).tobytes()
        pairs.append(
            (
                keys[path].encode(),
                entry(types[array.dtype.name], array.shape, shard, len(body), masked_crc32c(body)),
            )
        )
        data[shard] += body
    graph = object_graph(variables, keys)
    length = len(graph).to_bytes(4, "little")
    stored = struct.pack("<I", mask(crc32c(length)))
    body = varint(len(graph)) + stored + graph
    pairs.append(
        (
            b"_CHECKPOINTABLE_OBJECT_GRAPH",
            entry(7, (), 0, len(body), mask(crc32c(length + stored + graph))),
        )
    )
    data[0] += body
    pairs.append((b"", field(1, shards) + field(3, field(1, version))))
    write_table(f"{prefix}.index", sorted(pairs), compress)
    for i, body in enumerate(data):
        with open(f"{prefix}.data-{i:05d}-of-{shards:05d}", "wb") as file:
            file.write(body)


# ---- PyTorch ----


class Pickle(pickle._Pickler):
    """Pickles arrays as torch.save does, naming torch's functions without having them."""

    def __init__(self, file):
        super().__init__(file, protocol=2)
        self.storages = {}

    def save(self, value, save_persistent_id=True):
        if not isinstance(value, np.ndarray):
            return super().save(value, save_persistent_id)
        key = str(94350711445872 + 64 * len(self.storages))
        self.storages[key] = value.tobytes()
        names = {"float32": "FloatStorage", "float64": "DoubleStorage", "int64": "LongStorage"}
        stride = [s // value.itemsize for s in np.ascontiguousarray(value).strides]
        self.write(b"ctorch._utils\n_rebuild_tensor_v2\n((")
        super().save("storage")
        self.write(b"ctorch\n" + names[value.dtype.name].encode() + b"\n")
        for part in (key, "cpu", value.size):
            super().save(part)
        self.write(b"tQ")
        for part in (0, value.shape, tuple(stride), False):
            super().save(part)
        self.write(b"ccollections\nOrderedDict\n)RtR")


def write_torch(path, value, pickled=None):
    """A zip archive as torch.save lays it out; `pickled` replaces the pickle."""
    stream = io.BytesIO()
    pickler = Pickle(stream)
    pickler.dump(value)
    stem = os.path.splitext(os.path.basename(path))[0]
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        archive.writestr(f"{stem}/data.pkl", pickled or stream.getvalue())
        archive.writestr(f"{stem}/byteorder", "little")
        for key, body in pickler.storages.items():
            archive.writestr(f"{stem}/data/{key}", body)
        archive.writestr(f"{stem}/version", "3\n")


# ---- HDF5 ----


def write_keras(path, layers):
    import h5py

    with h5py.File(path, "w") as file:
        file.attrs["layer_names"] = np.array([name.encode() for name in layers])
        file.attrs["backend"] = b"tensorflow"
        for layer, weights in layers.items():
            names = [f"MyParticleNetwork/{layer}/{kind}:0" for kind in weights]
            group = file.create_group(layer)
            group.attrs["weight_names"] = np.array([name.encode() for name in names])
            for name, array in zip(names, weights.values()):
                group[name] = array


def write_lagrangebench(folder, split, trajectories, **changes):
    """trajectories: [(position, particle_type)]"""
    import h5py

    dim = trajectories[0][0].shape[-1]
    metadata = {
        "case": "TGV",
        "dim": dim,
        "dx": 0.1,
        "dt": 0.001,
        "write_every": 10,
        "g_ext_magnitude": 0.0,
        "bounds": [[0.0, 1.0]] * dim,
        "periodic_boundary_conditions": [False] * 3,
        **changes,
    }
    write_json(
        os.path.join(folder, "metadata.json"),
        {key: value for key, value in metadata.items() if value is not None},
    )
    path = os.path.join(folder, split + ".h5")
    with h5py.File(path, "w") as file:
        for i, (position, kind) in enumerate(trajectories):
            file[f"{i:05d}/position"] = position
            file[f"{i:05d}/particle_type"] = kind
    return path


def write_json(path, value):
    with open(path, "w", encoding="utf-8") as file:
        json.dump(value, file)
