# SPDX-License-Identifier: MIT
"""Water-Ramps and its kin: TFRecord files and metadata.json of DeepMind's learning_to_simulate.

A TFRecord file is a run of records: length (8 bytes), masked CRC-32C of it, data, masked CRC-32C of
that, all little-endian. A record is a tf.train.SequenceExample: context `particle_type` (int64s as
bytes) and the feature list `position`, one entry per frame (float32s as bytes). There is one frame
more than metadata's sequence_length, so that the first frame has a velocity.

The data has no walls and no normals: the container (`bounds`) is sampled here, the normals of the
ramps are estimated.
"""

import os
import struct

import numpy as np

import positions
import sequence
import wire
from crc32c import masked_crc32c
from errors import ConvertError

SUFFIX = ".tfrecord"
BOUNDARY = 3
WATER = 5
NAMES = {0: "rigid", 3: "boundary", 5: "water", 6: "sand", 7: "goop"}


def tfrecords(path):
    """Yields the data of each record; every length and checksum is checked first."""
    try:
        file = open(path, "rb")
    except OSError as error:
        raise ConvertError(path, "", error.strerror or str(error)) from None
    with file:
        left = os.fstat(file.fileno()).st_size
        index = 0
        while left:
            name = f"record {index}"
            head = file.read(12)
            if index == 0 and head[:2] == b"\x1f\x8b":
                raise ConvertError(path, name, "the file is gzip-compressed; unpack it first")
            if len(head) < 12:
                raise ConvertError(path, name, "truncated: the file ends inside its length")
            length, crc = struct.unpack("<QI", head)
            if masked_crc32c(head[:8]) != crc:
                raise ConvertError(
                    path,
                    name,
                    "checksum of the length does not match: no TFRecord file, or a damaged one",
                )
            if length + 16 > left:
                raise ConvertError(path, name, f"truncated: {length} bytes, {left - 12} are left")
            data = file.read(length)
            if masked_crc32c(data) != struct.unpack("<I", file.read(4))[0]:
                raise ConvertError(path, name, "checksum of the data does not match")
            yield data
            left -= length + 16
            index += 1
        if index == 0:
            raise ConvertError(path, "", "empty: no records")


def entries(data):
    """A map<string, message> field, as wire format stores it."""
    found = {}
    for pair in wire.messages(data, 1):
        key, value = wire.messages(pair, 1), wire.messages(pair, 2)
        if key:
            found[bytes(key[0]).decode("utf-8", "replace")] = value[0] if value else b""
    return found


def feature_bytes(feature):
    """The values of a Feature that is a bytes_list."""
    return [value for chunk in wire.messages(feature, 1) for value in wire.messages(chunk, 1)]


def parse(data):
    """(particle_type, position): the raw bytes of each frame, None where absent.

    An Example and a SequenceExample's context have the same encoding, so both are read."""
    context, lists = {}, {}
    for part in wire.messages(data, 1):
        context.update(entries(part))
    for part in wire.messages(data, 2):
        lists.update(entries(part))
    kind = feature_bytes(context["particle_type"]) if "particle_type" in context else None
    if "position" in lists:
        frames = [
            value
            for feature in wire.messages(lists["position"], 1)
            for value in feature_bytes(feature)
        ]
    else:
        frames = feature_bytes(context["position"]) if "position" in context else None
    return kind, frames


def decode(where, data, frame_count, dim):
    """(particle_type [N], position [T][N][dim]) of one record."""
    try:
        kind, frames = parse(data)
    except wire.WireError as error:
        raise ConvertError(where, "SequenceExample", str(error)) from None
    kind = b"".join(kind or [])
    if not kind:
        raise ConvertError(where, "particle_type", "missing")
    if not frames:
        raise ConvertError(where, "position", "missing")
    if len(kind) % 8:
        raise ConvertError(where, "particle_type", f"{len(kind)} bytes are no int64s")
    kind = np.frombuffer(kind, "<i8")
    if len(frames) == 1 and frame_count > 1:  # all frames in one value
        size = len(frames[0]) // frame_count
        frames = [frames[0][i * size : (i + 1) * size] for i in range(frame_count)]
    if len(frames) != frame_count:
        raise ConvertError(
            where,
            "position",
            f"{len(frames)} frames, metadata.json says {frame_count} (sequence_length + 1)",
        )
    for i, frame in enumerate(frames):
        if len(frame) != 4 * dim * len(kind):
            raise ConvertError(
                where,
                f"position[{i}]",
                f"{len(frame)} bytes, expected "
                f"{4 * dim * len(kind)}: {len(kind)} particles of {dim} float32s",
            )
    position = np.frombuffer(b"".join(frames), "<f4").reshape(frame_count, len(kind), dim)
    sequence.check_finite(where, "position", position)
    return kind, position


def read_one(path, options):
    """Yields the sequences of one file."""
    meta_path, metadata = positions.read_metadata(path, options.metadata)
    dim = positions.dimension(meta_path, metadata, options.dim)
    frame_count = positions.get(meta_path, metadata, "sequence_length", int) + 1
    if frame_count < 2:
        raise ConvertError(meta_path, "sequence_length", f"{frame_count - 1}")
    if "context_mean" in metadata:
        raise ConvertError(
            meta_path,
            "context_mean",
            "the set has step_context, an outer influence "
            "that changes over time; a sequence file has no place for it",
        )
    low, high = positions.bounds(meta_path, metadata, dim)
    dt = options.dt or positions.get(meta_path, metadata, "dt", float)
    stem = os.path.basename(path).removesuffix(SUFFIX)
    fluid_types = options.fluid_type or [WATER]
    for index, data in enumerate(tfrecords(path)):
        where = f"{path}: record {index}"
        kind, position = decode(where, data, frame_count, dim)
        other = sorted(set(kind.tolist()) - {BOUNDARY, *fluid_types})
        if other:
            names = ", ".join(f"{k} ({NAMES.get(k, 'unknown')})" for k in other)
            raise ConvertError(
                where,
                "particle_type",
                f"{names}; only {BOUNDARY} (boundary) and fluid "
                f"({', '.join(map(str, fluid_types))}) are read; see --fluid-type",
            )
        is_fluid = np.isin(kind, fluid_types)
        if not is_fluid.any():
            raise ConvertError(where, "particle_type", "no fluid particles")
        ramps = positions.still(where, "position", position[:, ~is_fluid])
        fluid, velocity = positions.with_first_velocity(where, position[:, is_fluid], dt)
        spacing, spacing_from = sequence.choose_spacing(
            where, position[0, is_fluid], options.spacing
        )
        walls, wall_normals = sequence.walls_around(
            low, high, [False] * dim, spacing, options.wall_layers
        )
        ramp_normals = sequence.estimated_normals(ramps, fluid[0], spacing)
        density = options.rest_density or 1000.0
        yield sequence.Sequence(
            origin=where,
            name=f"{stem}_{index:05d}",
            position=fluid,
            velocity=velocity,
            boundary=np.concatenate([ramps, walls]).astype(np.float32),
            normal=np.concatenate([ramp_normals, wall_normals]).astype(np.float32),
            dt=dt,
            gravity=options.gravity or (0.0, -9.81, 0.0)[:dim],
            spacing=spacing,
            spacing_from=spacing_from,
            rest_density=density,
            particle_mass=sequence.lattice_mass(density, spacing, dim),
            source=options.source or f"learning_to_simulate TFRecord, {stem}, record {index}",
            extra={
                "box_min": sequence.numbers(low),
                "box_max": sequence.numbers(high),
                "boundary_order": (
                    f"{len(ramps)} of the data (normals estimated), then "
                    f"{len(walls)} sampled around the box"
                ),
            },
        )


def read(paths, options):
    for path in sorted(paths):
        yield from read_one(path, options)
