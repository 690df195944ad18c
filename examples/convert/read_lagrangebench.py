# SPDX-License-Identifier: MIT
"""LagrangeBench: train.h5, valid.h5 and test.h5 beside metadata.json.

Each group of a file is a trajectory: `position` float32 [T][N][dim] and `particle_type` int [N]
(0 fluid, 1 wall, 2 moving wall, 3 rigid body, -1 padding). metadata.json gives the solver's `dt`,
`write_every` (solver steps per stored frame; 1 if absent), `dx` (spacing), `bounds` and
`periodic_boundary_conditions`.

Through periodic axes a particle reappears on the other side; here its path is made continuous, and
metadata `periodic` says which axes wrap at box_min and box_max.
"""

import os

import numpy as np

import hdf5
import positions
import sequence
from errors import ConvertError

SUFFIX = ".h5"
PADDING, FLUID, WALL, MOVING_WALL, RIGID = -1, 0, 1, 2, 3


def periodic_axes(path, metadata, dim):
    value = metadata.get("periodic_boundary_conditions", [False] * dim)
    if not isinstance(value, list) or len(value) < dim or any(type(v) is not bool for v in value):
        raise ConvertError(
            path, "periodic_boundary_conditions", f"{value!r}, expected {dim} booleans"
        )
    return value[:dim]


def gravity_of(path, metadata, dim, given):
    """Given, or none, or straight down where the case is the dam break; others are no gravity."""
    if given is not None:
        return given
    magnitude = positions.get(path, metadata, "g_ext_magnitude", float, 0.0)
    case = str(metadata.get("case", ""))
    if magnitude == 0:
        return (0.0,) * dim
    if case.upper() in ("DB", "DAM"):
        return (0.0, -magnitude, 0.0)[:dim]
    raise ConvertError(
        path,
        "g_ext_magnitude",
        f"{magnitude:g} in case {case!r}: the direction is not "
        "in the data (it may vary in space); give --gravity",
    )


def split_types(where, kind, position, moving_is_static):
    """(fluid [T][N][dim], boundary [M][dim])."""
    unknown = sorted(set(kind.tolist()) - {PADDING, FLUID, WALL, MOVING_WALL})
    if unknown:
        raise ConvertError(
            where,
            "particle_type",
            f"{unknown}: rigid bodies and unknown types have no place in a sequence file",
        )
    if (kind == MOVING_WALL).any() and not moving_is_static:
        raise ConvertError(
            where,
            "particle_type",
            f"{int((kind == MOVING_WALL).sum())} particles of a "
            "moving wall; --moving-walls-at-rest converts them as a wall at rest",
        )
    fluid = position[:, kind == FLUID]
    if fluid.shape[1] == 0:
        raise ConvertError(where, "particle_type", "no fluid particles")
    wall = positions.still(where, "position", position[:, kind == WALL])
    lid = position[0, kind == MOVING_WALL]
    return fluid, np.concatenate([wall, lid])


def trajectory(where, stem, key, group, meta_path, metadata, options):
    dim = positions.dimension(meta_path, metadata, options.dim)
    position = hdf5.numbers(where, group, "position")
    kind = hdf5.numbers(where, group, "particle_type")
    sequence.check_shape(where, "position", position, (None, None, dim))
    sequence.check_shape(where, "particle_type", kind, (position.shape[1],))
    sequence.check_finite(where, "position", position)
    position = position.astype(np.float32)
    low, high = positions.bounds(meta_path, metadata, dim)
    periodic = periodic_axes(meta_path, metadata, dim)
    every = positions.get(meta_path, metadata, "write_every", int, 1)
    dt = options.dt or positions.get(meta_path, metadata, "dt", float) * every

    fluid, boundary = split_types(where, kind, position, options.moving_walls_at_rest)
    spacing, spacing_from = sequence.choose_spacing(
        where,
        fluid[0],
        options.spacing,
        positions.get(meta_path, metadata, "dx", float),
        "dx of metadata.json",
    )
    fluid, velocity = positions.with_first_velocity(
        where, positions.unwrap(fluid, high - low, periodic), dt
    )
    normal = sequence.estimated_normals(boundary, fluid[0], spacing)
    density = options.rest_density or 1.0  # these sets are without dimensions
    extra = {
        "periodic": " ".join("1" if p else "0" for p in periodic),
        "box_min": sequence.numbers(low),
        "box_max": sequence.numbers(high),
        "particle_types": f"{fluid.shape[1]} fluid, {len(boundary)} boundary (normals estimated)",
    }
    return sequence.Sequence(
        origin=where,
        name=f"{stem}_{key}",
        position=fluid,
        velocity=velocity,
        boundary=boundary,
        normal=normal.astype(np.float32),
        dt=dt,
        gravity=gravity_of(meta_path, metadata, dim, options.gravity),
        spacing=spacing,
        spacing_from=spacing_from,
        rest_density=density,
        particle_mass=sequence.lattice_mass(density, spacing, dim),
        source=options.source
        or f"LagrangeBench {metadata.get('case', '')} {stem}, trajectory {key}".replace("  ", " "),
        extra=extra,
    )


def read(paths, options):
    for path in sorted(paths):
        meta_path, metadata = positions.read_metadata(path, options.metadata)
        stem = os.path.basename(path).removesuffix(SUFFIX)
        with hdf5.opened(path) as file:
            with hdf5.reading(path, "/"):
                groups = {key: file[key] for key in sorted(file)}
            if not groups:
                raise ConvertError(path, "/", "no trajectories")
            for key, group in groups.items():
                yield trajectory(f"{path}: {key}", stem, key, group, meta_path, metadata, options)
