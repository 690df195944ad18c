# SPDX-License-Identifier: MIT
"""A sequence (format `ascc.sequence`): checked in one place, whatever it was read from.

`Sequence` is what a reader hands over; `write` refuses what would not be a valid file. Where the
published data leaves something unsaid (spacing, the container's walls, wall normals) the functions
below supply it, and the file's metadata says that they did.
"""

import os
import re
from dataclasses import dataclass, field

import numpy as np

import tensorfile
from errors import ConvertError, warn

VERSION = "1"


@dataclass
class Sequence:
    origin: str  # file it comes from, for messages
    name: str  # of the file to write, without extension
    position: np.ndarray  # [T][N][dim], m
    velocity: np.ndarray  # [T][N][dim] or [1][N][dim], m/s
    boundary: np.ndarray  # [M][dim], m
    normal: np.ndarray  # [M][dim], unit, into the fluid
    dt: float  # s between frames
    gravity: tuple  # m/s^2
    spacing: float  # m
    spacing_from: str  # where the spacing was taken from
    rest_density: float  # kg/m^3
    particle_mass: float  # kg; per metre of depth in 2D
    source: str
    extra: dict = field(default_factory=dict)  # further metadata, text to text


def number(value):
    """Shortest text that reads back as the same number: of its own precision."""
    kind = np.float32 if isinstance(value, np.float32) else np.float64
    return np.format_float_positional(kind(value), unique=True, trim="-")


def numbers(values):
    return " ".join(number(value) for value in values)


def check_finite(origin, name, array):
    """Names the first value that is no number."""
    bad = ~np.isfinite(array)
    if bad.any():
        where = tuple(int(i) for i in np.argwhere(bad)[0])
        raise ConvertError(origin, name, f"not finite: {array[where]} at {list(where)}")


def check_shape(origin, name, array, shape):
    """shape: a tuple of sizes, None where any will do."""
    if len(array.shape) != len(shape) or any(
        w not in (None, s) for s, w in zip(array.shape, shape)
    ):
        wanted = ", ".join("any" if size is None else str(size) for size in shape)
        raise ConvertError(origin, name, f"shape {list(array.shape)}, expected [{wanted}]")


def check_positive(origin, name, value):
    if not (np.isfinite(value) and value > 0):
        raise ConvertError(origin, name, f"{value} is not a positive number")


def check(s):
    """Everything a reader of the file may rely on."""
    check_shape(s.origin, "position", s.position, (None, None, None))
    frames, count, dim = s.position.shape
    if dim not in (2, 3):
        raise ConvertError(s.origin, "position", f"{dim} dimensions, expected 2 or 3")
    if frames == 0 or count == 0:
        raise ConvertError(s.origin, "position", f"{frames} frames of {count} fluid particles")
    check_shape(
        s.origin, "velocity", s.velocity, (frames if len(s.velocity) != 1 else 1, count, dim)
    )
    check_shape(s.origin, "boundary position", s.boundary, (None, dim))
    check_shape(s.origin, "boundary normal", s.normal, (len(s.boundary), dim))
    for name in ("position", "velocity", "boundary", "normal"):
        check_finite(s.origin, name, getattr(s, name))
    length = np.linalg.norm(s.normal.astype(np.float64), axis=1)
    if len(length) and np.abs(length - 1).max() > 1e-3:
        worst = int(np.abs(length - 1).argmax())
        raise ConvertError(s.origin, "boundary normal", f"row {worst} has length {length[worst]:g}")
    for name in ("dt", "spacing", "rest_density", "particle_mass"):
        check_positive(s.origin, name, getattr(s, name))
    if len(s.gravity) != dim:
        raise ConvertError(s.origin, "gravity", f"{len(s.gravity)} numbers in {dim} dimensions")
    check_finite(s.origin, "gravity", np.array(s.gravity))


def metadata(s):
    dim = s.position.shape[2]
    return {
        "format": "ascc.sequence",
        "version": VERSION,
        "dim": str(dim),
        "dt": number(s.dt),
        "gravity": numbers(s.gravity),
        "particle_radius": number(s.spacing / 2),
        "particle_mass": number(s.particle_mass),
        "rest_density": number(s.rest_density),
        "source": s.source,
        "spacing_from": s.spacing_from,
        "velocity_frames": "all" if len(s.velocity) == len(s.position) else "first",
        **s.extra,
    }


def write(s, folder):
    """Checks and writes one sequence; prints and returns its path."""
    check(s)
    if not re.fullmatch(r"[A-Za-z0-9][A-Za-z0-9._-]{0,127}", s.name):
        raise ConvertError(s.origin, "name", f"{s.name!r} cannot be the name of a file")
    path = os.path.join(folder, s.name + ".safetensors")
    tensors = {
        "fluid.position": s.position,
        "fluid.velocity": s.velocity,
        "boundary.position": s.boundary,
        "boundary.normal": s.normal,
    }
    tensorfile.write(path, tensors, metadata(s))
    frames, count, dim = s.position.shape
    print(
        f"{path}: {dim}D, {frames} frames of {number(s.dt)} s, {count} fluid and "
        f"{len(s.boundary)} boundary particles, spacing {number(s.spacing)} m ({s.spacing_from})"
    )
    return path


def lattice_mass(density, spacing, dim):
    """Mass of a particle that stands for one cell of the lattice, to nine figures."""
    return float(f"{density * spacing ** dim:.9g}")


def nearest_distance(points, chunk=256):
    """Distance of each point to its nearest other one; brute force, in pieces."""
    points = points.astype(np.float64)
    nearest = np.empty(len(points))
    for begin in range(0, len(points), chunk):
        rows = points[begin : begin + chunk]
        square = ((rows[:, None] - points[None]) ** 2).sum(-1)
        square[np.arange(len(rows)), begin + np.arange(len(rows))] = np.inf
        nearest[begin : begin + chunk] = square.min(1)
    return np.sqrt(nearest)


def measured_spacing(points, sample=4096):
    """Median distance to the nearest neighbour in one frame, rounded to three figures; NaN if one.

    Large frames are measured in a slab across the first axis, which keeps neighbours together."""
    if len(points) > sample:
        order = np.argsort(points[:, 0], kind="stable")
        points = points[order[(len(points) - sample) // 2 :][:sample]]
    if len(points) < 2:
        return float("nan")
    return float(f"{np.median(nearest_distance(points)):.3g}")


def choose_spacing(origin, first_frame, given, stated=None, stated_from=""):
    """(spacing, where from): the option, else what the data states, else as measured."""
    measured = measured_spacing(first_frame)
    if given is not None:
        return given, "given"
    if stated is not None:
        if np.isfinite(measured) and not 0.5 < measured / stated < 1.5:
            warn(
                origin,
                "spacing",
                f"{stated_from} says {stated:g} m, but the median distance to "
                f"the nearest particle in the first frame is {measured:g} m; see --spacing",
            )
        return stated, stated_from
    if not (np.isfinite(measured) and measured > 0):
        raise ConvertError(
            origin, "spacing", "cannot be measured in the first frame; give --spacing"
        )
    return measured, "measured in the first frame"


def walls_around(low, high, periodic, spacing, layers):
    """(points, normals) on a lattice outside the box [low, high]; normals point at the box.

    The first layer lies half a spacing outside. Periodic axes have no walls.

        o o o o o
        o +-----+     + corner of the box, o wall points; at corners
        o |     |     the normal is diagonal
    """
    low, high = np.asarray(low, np.float64), np.asarray(high, np.float64)
    axes = []
    for a in range(len(low)):
        cells = max(1, int(round((high[a] - low[a]) / spacing)))
        step = (high[a] - low[a]) / cells
        outside = 0 if periodic[a] else layers
        axes.append(low[a] + (np.arange(-outside, cells + outside) + 0.5) * step)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, len(low))
    offset = np.clip(points, low, high) - points
    outside = (offset != 0).any(1)
    points, offset = points[outside], offset[outside]
    return points, offset / np.linalg.norm(offset, axis=1, keepdims=True)


def estimated_normals(points, fluid, spacing):
    """Unit normals for boundary points that come without: away from the other boundary points.

    Where points lie on a line (2D) or sheet (3D) the normal is the direction of least spread, on
    the side away from the others, or, if neither side has more, on that of the nearest fluid."""
    points, fluid = points.astype(np.float64), fluid.astype(np.float64)
    width = 2 * spacing
    normal = np.empty_like(points)
    for i, point in enumerate(points):
        away = fluid[((fluid - point) ** 2).sum(1).argmin()] - point
        offset = points - point
        square = (offset**2).sum(1)
        near = (square < (3 * width) ** 2) & (square > 0)
        weight = np.exp(-square[near] / width**2)
        offset = offset[near]
        direction = away
        if len(offset):
            push = -(weight[:, None] * offset).sum(0) / weight.sum()
            spread = (weight[:, None, None] * offset[:, :, None] * offset[:, None, :]).sum(0)
            size, axis = np.linalg.eigh(spread / weight.sum())
            if size[0] < 0.2 * size[1]:
                side = push if abs(push @ axis[:, 0]) > 0.05 * width else away
                direction = axis[:, 0] * (1 if side @ axis[:, 0] >= 0 else -1)
            elif np.linalg.norm(push) > 0.02 * width:
                direction = push
        length = np.linalg.norm(direction)
        normal[i] = direction / length if length > 0 else np.eye(len(point))[-1]
    return normal
