# SPDX-License-Identifier: MIT
"""Liquid3d and WBC-SPH: shards of a scene as DeepLagrangianFluids and DMCF write them.

A shard is one zstd frame around one msgpack value: a list of frames, each a map with `scene_id`,
`frame_id`, `pos`, `vel`, usually `m` and `viscosity`, in WBC-SPH `grav`; the first frame of a shard
also has `box` and `box_normals`. Arrays are maps as msgpack-numpy writes them: `nd` true, `type`
(a numpy dtype), `shape`, `data`; numbers likewise with `nd` false. A scene is cut into several
shards, PREFIX_00.msgpack.zst and so on.
"""

import re

import numpy as np

import sequence
from errors import ConvertError, read_file, warn

SUFFIX = ".msgpack.zst"
LIQUID3D_SPACING = 0.05  # the published generator's constant: radius 0.025 m
MAX_BYTES = 1 << 33
CHUNK = 1 << 24
NEEDED = ("scene_id", "frame_id", "pos", "vel")


def decompress(path):
    """The bytes of the one zstd frame of a file; a frame cut short is an error, not less data."""
    import zstandard

    data = read_file(path)
    stream = zstandard.ZstdDecompressor().decompressobj()
    pieces, total = [], 0
    try:
        for begin in range(0, len(data), CHUNK):
            pieces.append(stream.decompress(data[begin : begin + CHUNK]))
            total += len(pieces[-1])
            if total > MAX_BYTES:
                raise ConvertError(path, "zstd", f"more than {MAX_BYTES} bytes when unpacked")
    except zstandard.ZstdError as error:
        raise ConvertError(path, "zstd", str(error)) from None
    if not stream.eof:
        raise ConvertError(
            path, "zstd", f"truncated: the frame does not end within {len(data)} bytes"
        )
    if stream.unused_data:
        raise ConvertError(path, "zstd", "bytes after the end of the frame")
    return b"".join(pieces)


def entry(value, key):
    """A value of an encoded array; its keys are bytes or text by the writer's version."""
    return value.get(key.encode(), value.get(key))


def decode(path, field, value):
    """A msgpack-numpy value as a numpy array; plain numbers and lists of them too."""
    if not isinstance(value, dict):
        try:
            return np.asarray(value, np.float64)
        except (TypeError, ValueError):
            raise ConvertError(path, field, f"not an array: {type(value).__name__}") from None
    kind, data, is_array = entry(value, "type"), entry(value, "data"), entry(value, "nd")
    if isinstance(kind, bytes):
        kind = kind.decode("ascii", "replace")
    if not isinstance(kind, str) or not re.fullmatch(r"[<>|=]?[fiu][1248]", kind):
        raise ConvertError(path, field, f"array of type {kind!r}; only plain numbers are read")
    if not isinstance(data, bytes):
        raise ConvertError(path, field, "array without data")
    shape = entry(value, "shape") if is_array else ()
    if not isinstance(shape, (list, tuple)) or any(type(n) is not int or n < 0 for n in shape):
        raise ConvertError(path, field, f"array of shape {shape!r}")
    kind = np.dtype(kind)
    count = 1
    for size in shape:
        count *= size
    if count * kind.itemsize != len(data):
        raise ConvertError(path, field, f"{len(data)} bytes for shape {list(shape)} of {kind.str}")
    return np.frombuffer(data, kind).reshape(shape)


def records(path):
    """The frames of one shard."""
    import msgpack

    try:
        value = msgpack.unpackb(decompress(path), raw=False, strict_map_key=False)
    except (msgpack.exceptions.UnpackException, ValueError, TypeError) as error:
        raise ConvertError(path, "msgpack", str(error) or type(error).__name__) from None
    if not isinstance(value, list) or not value:
        raise ConvertError(path, "msgpack", "expected a list of frames")
    if all(isinstance(scene, list) for scene in value):  # DMCF's cached sets: a list of scenes
        value = [frame for scene in value for frame in scene]
    for i, frame in enumerate(value):
        if not isinstance(frame, dict):
            raise ConvertError(path, f"[{i}]", "expected a map")
        for key in NEEDED:
            if key not in frame:
                raise ConvertError(path, f"[{i}].{key}", "missing")
        rigid = frame.get("num_rigid_bodies")
        if rigid is not None and decode(path, f"[{i}].num_rigid_bodies", rigid).max(initial=0) != 0:
            raise ConvertError(
                path,
                f"[{i}].num_rigid_bodies",
                "moving rigid bodies; a sequence file has no place for them",
            )
    return value


def rows(where, field, array):
    """An array of vectors as [n][3]; leading axes are joined."""
    if array.ndim == 0 or array.shape[-1] != 3:
        raise ConvertError(where, field, f"shape {list(array.shape)}, expected [any, 3]")
    return array.reshape(-1, 3)


class Scene:
    """The frames of one scene as they come, from one shard or more."""

    def __init__(self, path, name):
        self.path, self.name = path, name
        self.frames = []  # (frame_id, file, arrays)
        self.box = None

    def add(self, path, i, frame):
        def get(key):
            return decode(path, f"[{i}].{key}", frame[key])

        number = get("frame_id")
        if number.shape != () or not np.isfinite(number) or number != np.floor(number):
            raise ConvertError(path, f"[{i}].frame_id", "expected a whole number")
        arrays = {key: get(key) for key in ("pos", "vel", "m", "grav") if key in frame}
        where = f"{path}[{i}]"
        sequence.check_shape(where, "pos", arrays["pos"], (None, 3))
        sequence.check_shape(where, "vel", arrays["vel"], (len(arrays["pos"]), 3))
        for key, array in arrays.items():
            sequence.check_finite(where, key, array)
        if "grav" in arrays:
            arrays["grav"] = rows(where, "grav", arrays["grav"])
        if len(arrays["pos"]) == 0:
            raise ConvertError(path, f"[{i}].pos", "no fluid particles")
        if self.frames and len(arrays["pos"]) != len(self.frames[0][2]["pos"]):
            raise ConvertError(
                path,
                f"[{i}].pos",
                f"{len(arrays['pos'])} particles; the scene began "
                f"with {len(self.frames[0][2]['pos'])}, and a sequence keeps its count",
            )
        self.frames.append((int(number), path, arrays))
        if ("box" in frame) != ("box_normals" in frame):
            raise ConvertError(path, f"[{i}].box", "box and box_normals come only together")
        if "box" in frame:
            box = tuple(rows(where, key, get(key)) for key in ("box", "box_normals"))
            sequence.check_shape(where, "box_normals", box[1], (len(box[0]), 3))
            if self.box is None:
                self.box = box
            elif not all(np.array_equal(a, b) for a, b in zip(self.box, box)):
                raise ConvertError(path, f"[{i}].box", "differs from the scene's earlier one")

    def ordered(self):
        """The frames by number; a gap or a repetition means a shard is missing or given twice."""
        self.frames.sort(key=lambda frame: frame[0])
        ids = [frame[0] for frame in self.frames]
        steps = {b - a for a, b in zip(ids, ids[1:])}
        if len(steps) > 1 or 0 in steps:
            step = min(steps - {0}, default=1)
            at = next(i for i, (a, b) in enumerate(zip(ids, ids[1:])) if b - a != step)
            raise ConvertError(
                self.frames[at + 1][1],
                "frame_id",
                f"{ids[at + 1]} follows {ids[at]} in "
                f"scene {self.name}: a shard is missing or given twice",
            )
        return self.frames


def is_flat(arrays):
    """All particles in one plane of constant z."""
    spread = max((float(np.ptp(a[..., 2])) for a in arrays if a.size), default=0.0)
    extent = max((float(np.ptp(a)) for a in arrays if a.size), default=0.0)
    return spread <= 1e-6 * extent


def frame_time(position, velocity):
    """The frame time that best explains the movement by the stored velocities; NaN if at rest."""
    if len(position) < 2:
        return float("nan")
    last = min(len(position), 32)
    moved = np.diff(position[:last].astype(np.float64), axis=0)
    mean = (velocity[1:last].astype(np.float64) + velocity[: last - 1]) / 2
    square = (mean * mean).sum()
    return float((moved * mean).sum() / square) if square > 1e-12 * mean.size else float("nan")


def gravity_of(scene, frames, dim, given):
    if given is not None:
        return given
    stored = [arrays["grav"] for _, _, arrays in frames if "grav" in arrays]
    if not stored:
        return (0.0, -9.81, 0.0)[:dim]
    if len(stored) != len(frames):
        raise ConvertError(scene.path, "grav", "only some frames have it")
    if not all(len(array) and (array == stored[0][0]).all() for array in stored):
        raise ConvertError(scene.path, "grav", "changes within the scene")
    return tuple(stored[0][0][:dim])


def to_sequence(scene, options):
    frames = scene.ordered()
    position = np.stack([arrays["pos"] for _, _, arrays in frames]).astype(np.float32)
    velocity = np.stack([arrays["vel"] for _, _, arrays in frames]).astype(np.float32)
    boundary, normal = scene.box or (np.zeros((0, 3)), np.zeros((0, 3)))
    dim = options.dim or (2 if is_flat([position, boundary]) else 3)
    position, velocity = position[..., :dim], velocity[..., :dim]
    boundary, normal = boundary[:, :dim].astype(np.float32), normal[:, :dim].astype(np.float32)

    dt = options.dt or (0.02 if dim == 3 else 0.0025)
    seen = frame_time(position, velocity)
    if np.isfinite(seen) and not 0.8 < seen / dt < 1.25:
        warn(
            scene.path,
            "dt",
            f"{dt:g} s, but positions and velocities suggest {seen:.3g} s; see --dt",
        )
    spacing, spacing_from = sequence.choose_spacing(
        scene.path,
        position[0],
        options.spacing,
        LIQUID3D_SPACING if dim == 3 else None,
        "the published generator",
    )

    extra = {"scene": scene.name, "frame_ids": f"{frames[0][0]} to {frames[-1][0]}"}
    zero = np.linalg.norm(normal, axis=1) < 1e-6
    if zero.any():
        normal[zero] = sequence.estimated_normals(boundary, position[0], spacing)[zero]
        warn(scene.path, "box_normals", f"{int(zero.sum())} of {len(zero)} are zero; estimated")
        extra["normals_estimated"] = str(int(zero.sum()))
    density, mass = options.rest_density or 1000.0, None
    if "m" in frames[0][2]:
        masses = frames[0][2]["m"].reshape(-1)
        sequence.check_shape(scene.path, "m", masses, (position.shape[1],))
        mass = np.float32(masses.mean(dtype=np.float64))
        if masses.min() != masses.max():
            extra["particle_mass_range"] = sequence.numbers((masses.min(), masses.max()))
        if options.rest_density is None:
            density = float(f"{mass / spacing ** dim:.6g}")
    if mass is None:
        mass = sequence.lattice_mass(density, spacing, dim)
    return sequence.Sequence(
        origin=scene.path,
        name=scene.name,
        position=position,
        velocity=velocity,
        boundary=boundary,
        normal=normal,
        dt=dt,
        gravity=gravity_of(scene, frames, dim, options.gravity),
        spacing=spacing,
        spacing_from=spacing_from,
        rest_density=density,
        particle_mass=mass,
        source=options.source
        or f"msgpack shards of DeepLagrangianFluids or DMCF, scene {scene.name}",
        extra=extra,
    )


def shard_order(path):
    """Numbers in names count as numbers: _2 before _10."""
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", str(path))]


def read(paths, options):
    """Yields a sequence for each scene; the shards of one scene must be neighbours by name."""
    scene, done = None, set()
    for path in sorted(paths, key=shard_order):
        for i, frame in enumerate(records(path)):
            name = frame["scene_id"]
            name = name.decode("utf-8", "replace") if isinstance(name, bytes) else str(name)
            if scene is None or name != scene.name:
                if scene is not None:
                    yield to_sequence(scene, options)
                    done.add(scene.name)
                if name in done:
                    raise ConvertError(
                        path,
                        f"[{i}].scene_id",
                        f"{name} was already complete; convert "
                        "folders with the same scene names one by one",
                    )
                scene = Scene(path, name)
            scene.add(path, i, frame)
    if scene is not None:
        yield to_sequence(scene, options)
