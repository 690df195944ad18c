# SPDX-License-Identifier: MIT
"""Shapes, poses, taps and drains: the structs of the C library, filled from Python's numbers."""

import ctypes
import enum
from dataclasses import dataclass
from typing import Optional, Sequence, Tuple

import numpy as np
from numpy.typing import ArrayLike

from . import _library
from ._arrays import Numbers, borrowed, rows_for, rows_of

Numbers3 = Sequence[float]


class ShapeKind(enum.IntEnum):
    POINTS = 0
    PLANE = 1
    BOX = 2
    SPHERE = 3
    CAPSULE = 4
    CYLINDER = 5
    MESH = 6


class Water(enum.IntEnum):
    """Where the water is: around a solid, in a container, on both sides of a sheet."""

    OUTSIDE = 0
    INSIDE = 1
    BOTH = 2


class DrainKind(enum.IntEnum):
    ALL = 0
    BOX = 1
    SPHERE = 2
    HALF_SPACE = 3


def _vector(values: Numbers3, count: int = 3) -> "ctypes.Array[ctypes.c_double]":
    given = [float(v) for v in values]
    if len(given) > count:
        raise ValueError(f"{given}: at most {count} numbers are wanted")
    return (ctypes.c_double * count)(*given)


@dataclass
class Shape:
    """What a body is made of, as ascc_shape has it. half, radius, pitch, inset in the length unit; 0 = the default.

    faces  of a BOX: those left away, such as ["+y"]; of a MESH: [count, dimension] rows of position
    """

    kind: ShapeKind
    half: Numbers3 = ()
    radius: float = 0.0
    water: Water = Water.OUTSIDE
    pitch: float = 0.0
    inset: float = 0.0
    open: Sequence[str] = ()
    position: Optional[ArrayLike] = None
    normal: Optional[ArrayLike] = None
    faces: Optional[ArrayLike] = None

    def _raw(self, dimension: int) -> Tuple[_library.Shape, Tuple[object, ...]]:
        """The struct, and what must live as long."""
        kept: Tuple[object, ...] = ()
        bits = 0
        for face in self.open:
            if face not in ("-x", "+x", "-y", "+y", "-z", "+z"):
                raise ValueError(f"open: {face!r}: one of -x, +x, ... is wanted")
            bits |= 1 << (2 * "xyz".index(face[1]) + (face[0] == "+"))
        raw = _library.Shape(
            kind=int(self.kind),
            water=int(self.water),
            half=_vector(self.half),
            radius=self.radius,
            pitch=self.pitch,
            inset=self.inset,
            open=bits,
        )
        if self.position is not None:
            x: Numbers = rows_of("position", self.position, dimension)
            at = borrowed(x)
            raw.count, raw.position = len(x), ctypes.pointer(at)
            kept += (x, at)
            if self.normal is not None:
                n = rows_for("normal", self.normal, len(x), dimension)
                towards = borrowed(n)
                raw.normal = ctypes.pointer(towards)
                kept += (n, towards)
        if self.faces is not None:
            whole = np.asarray(self.faces)
            if whole.ndim != 2 or whole.shape[1] != dimension or whole.dtype.kind not in "iu":
                raise ValueError(f"faces: whole numbers [count, {dimension}] are wanted")
            if whole.size and not -(2**31) <= int(whole.min()) <= int(whole.max()) < 2**31:
                raise ValueError("faces: they do not fit 32 bits")
            rows = np.ascontiguousarray(whole, np.int32)
            raw.face_count, raw.faces = len(rows), rows.ctypes.data
            kept += (rows,)
        return raw, kept


@dataclass
class Pose:
    """Where a body is and how it moves, as ascc_pose has it: rotation (x, y, z, w) and three spins in 3D, an
    angle and one spin, counterclockwise, in 2D."""

    position: Numbers3 = ()
    rotation: Sequence[float] = ()
    angle: float = 0.0
    velocity: Numbers3 = ()
    spin: Numbers3 = ()
    jump: float = 0.0

    def _raw(self, dimension: int) -> _library.Pose:
        spin = tuple(self.spin)
        if dimension == 2 and len(spin) == 1:
            spin = (0.0, 0.0, *spin)
        return _library.Pose(
            position=_vector(self.position),
            rotation=_vector(self.rotation, 4),
            angle=self.angle,
            velocity=_vector(self.velocity),
            spin=_vector(spin),
            jump=self.jump,
        )


@dataclass(frozen=True)
class Body:
    """A body as it is: rows of the boundary, and its pose."""

    first: int
    count: int
    pose: Pose


class Tap:
    """Where fluid comes in, as ascc_tap has it. It remembers what it owes; its members may be changed at any time."""

    def __init__(
        self,
        position: Numbers3,
        velocity: Numbers3 = (),
        radius: float = 0.0,
        half: Numbers3 = (),
        rate: float = 0.0,
        pitch: float = 0.0,
        clearance: float = 0.0,
        mass: float = 0.0,
    ) -> None:
        self._raw = _library.Tap(
            position=_vector(position),
            velocity=_vector(velocity),
            half=_vector(half),
            radius=radius,
            rate=rate,
            pitch=pitch,
            clearance=clearance,
            mass=mass,
        )

    @property
    def emitted(self) -> int:
        return int(self._raw.emitted)


@dataclass
class Drain:
    """Where fluid is taken out, as ascc_drain has it."""

    kind: DrainKind = DrainKind.ALL
    position: Numbers3 = ()
    half: Numbers3 = ()
    radius: float = 0.0
    normal: Numbers3 = ()
    outside: bool = False
    before: int = 0

    def _struct(self) -> _library.Drain:
        return _library.Drain(
            kind=int(self.kind),
            outside=int(self.outside),
            position=_vector(self.position),
            half=_vector(self.half),
            radius=self.radius,
            normal=_vector(self.normal),
            before=self.before,
        )
