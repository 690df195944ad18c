# SPDX-License-Identifier: MIT
"""What the two formats that store positions only have in common: metadata.json and velocities.

Without velocities the first frame is spent on one: the sequence begins with the second frame, and
its velocity is (x1 - x0) / dt, exactly what a learned solver would have.
"""

import json
import os

import numpy as np

from errors import ConvertError, read_file


def read_metadata(data_path, given):
    """(path, metadata) of the metadata.json beside a data file, or of the one given."""
    path = given or os.path.join(os.path.dirname(os.path.abspath(data_path)), "metadata.json")
    try:
        value = json.loads(read_file(path, 1 << 24))
    except ValueError as error:
        raise ConvertError(path, "", f"not JSON: {error}") from None
    if not isinstance(value, dict):
        raise ConvertError(path, "", "expected a JSON object")
    return path, value


def get(path, metadata, key, kind, default=None):
    """metadata[key] as int or float (kind); default where it is absent and one is given."""
    value = metadata.get(key, default)
    if value is None:
        raise ConvertError(path, key, "missing")
    if type(value) not in (int, float) or kind(value) != value:
        raise ConvertError(path, key, f"expected a number, got {value!r}")
    return kind(value)


def dimension(path, metadata, option):
    dim = get(path, metadata, "dim", int)
    if dim not in (2, 3):
        raise ConvertError(path, "dim", f"{dim}, expected 2 or 3")
    if option not in (None, dim):
        raise ConvertError(path, "dim", f"{dim}; --dim {option} does not fit")
    return dim


def bounds(path, metadata, dim):
    """(low, high) of the box."""
    try:
        low, high = np.array(metadata["bounds"], np.float64).T
    except KeyError:
        raise ConvertError(path, "bounds", "missing") from None
    except (TypeError, ValueError):
        raise ConvertError(path, "bounds", "expected [low, high] per axis") from None
    if len(low) < dim or not (np.isfinite(low).all() and (high > low)[:dim].all()):
        raise ConvertError(path, "bounds", f"no box: {metadata['bounds']!r}")
    return low[:dim], high[:dim]


def unwrap(position, size, periodic):
    """Positions without jumps: each step is the shortest one through the periodic axes."""
    if not any(periodic):
        return position
    step = np.diff(position.astype(np.float64), axis=0)
    crossings = np.where(periodic, np.round(step / size), 0.0)
    shifted = position.astype(np.float64)
    shifted[1:] -= np.cumsum(crossings, axis=0) * size
    return shifted.astype(np.float32)


def with_first_velocity(path, position, dt):
    """(position, velocity) of the frames from the second on."""
    if len(position) < 2:
        raise ConvertError(
            path, "position", f"{len(position)} frames; two are needed for a velocity"
        )
    velocity = (position[1:2].astype(np.float64) - position[0:1]) / dt
    return position[1:], velocity.astype(np.float32)


def still(path, name, position):
    """The one place of particles that must not move, [M][dim] of [T][M][dim]."""
    if position.size == 0:
        return position[0]
    moved = float(np.ptp(position, axis=0).max())
    if moved > 1e-5 * float(np.abs(position).max()):
        raise ConvertError(
            path,
            name,
            f"boundary particles move by up to {moved:g} m; a sequence file's boundary is at rest",
        )
    return position[0]
