# SPDX-License-Identifier: MIT
"""Positions to begin with: blocks of fluid, and walls as points with normals into the fluid."""

from typing import Iterable, List, Sequence, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float32]

# Distance of wall points, in particle spacings: what the shipped networks were trained with.
PITCH = 0.64


def block(corner: Sequence[float], cells: Sequence[int], spacing: float) -> Points:
    """A lattice of cells[0] x cells[1] (x cells[2]) particles from the block's low corner.

    The first particle is half a spacing inside. Begin half a spacing off a wall: a whole one is between
    them then, which is what the shipped networks keep.
    returns  float32[count, dimension]
    """
    if len(corner) != len(cells) or len(cells) not in (2, 3):
        raise ValueError("corner and cells: two or three numbers each are wanted")
    axes = [c + (np.arange(n) + 0.5) * spacing for c, n in zip(corner, cells)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1)
    return grid.reshape(-1, len(cells)).astype(np.float32)


def box(
    low: Sequence[float], high: Sequence[float], spacing: float, open: Iterable[str] = ()
) -> Tuple[Points, Points]:
    """The walls of a box, as points on its sides at 0.64 spacings or less.

    open     sides to leave away: "+y" is the lid where y points upwards
    returns  (position, normal), float32[count, dimension] each; normals point into the box
    """
    dimension = len(low)
    if len(high) != dimension or dimension not in (2, 3):
        raise ValueError("low and high: two or three numbers each are wanted")
    if not all(h > l for l, h in zip(low, high)):
        raise ValueError("high is not above low")
    open = set(open)
    positions: List[NDArray[np.float64]] = []
    normals: List[NDArray[np.float64]] = []
    for axis in range(dimension):
        for name, place, inwards in (("-", low[axis], 1.0), ("+", high[axis], -1.0)):
            if name + "xyz"[axis] in open:
                open.discard(name + "xyz"[axis])
                continue
            axes = []
            for c in range(dimension):
                count = int(np.ceil((high[c] - low[c]) / (PITCH * spacing)))
                step = (high[c] - low[c]) / count
                axes.append(
                    np.array([place]) if c == axis else low[c] + (np.arange(count) + 0.5) * step
                )
            side = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, dimension)
            normal = np.zeros_like(side)
            normal[:, axis] = inwards
            positions.append(side)
            normals.append(normal)
    if open:
        raise ValueError(f"open: {sorted(open)[0]!r} is no side of a box in {dimension}D")
    if not positions:
        return np.empty((0, dimension), np.float32), np.empty((0, dimension), np.float32)
    return np.concatenate(positions).astype(np.float32), np.concatenate(normals).astype(np.float32)


def surface(vertices: ArrayLike, triangles: ArrayLike, spacing: float) -> Tuple[Points, Points]:
    """Wall points on a triangle mesh, at 0.64 spacings or less.

    vertices   [count, 3]
    triangles  [count, 3], rows of vertices, counterclockwise seen from the fluid
    returns    (position, normal), float32[count, 3] each. Triangles without area give none.
    """
    corners = np.asarray(vertices, np.float64)[np.asarray(triangles, np.int64)]
    if corners.ndim != 3 or corners.shape[1:] != (3, 3):
        raise ValueError("vertices and triangles: [count, 3] each is wanted")
    positions, normals = [np.empty((0, 3))], [np.empty((0, 3))]
    for a, b, c in corners:
        normal = np.cross(b - a, c - a)
        area = float(np.linalg.norm(normal))
        longest = max(float(np.linalg.norm(e)) for e in (b - a, c - b, a - c))
        if not area > 0.0:
            continue
        # Cut into n^2 triangles like itself; each gives its middle, at most 0.6 of a cut edge from the next.
        n = max(1, int(np.ceil(0.6 * longest / (PITCH * spacing))))
        i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
        up, down = i + j < n, i + j < n - 1
        u = np.concatenate([i[up] + 1 / 3, i[down] + 2 / 3]) / n
        v = np.concatenate([j[up] + 1 / 3, j[down] + 2 / 3]) / n
        positions.append(a + u[:, None] * (b - a) + v[:, None] * (c - a))
        normals.append(np.repeat(normal[None] / area, len(u), 0))
    return np.concatenate(positions).astype(np.float32), np.concatenate(normals).astype(np.float32)
