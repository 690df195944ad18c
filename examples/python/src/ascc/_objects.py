# SPDX-License-Identifier: MIT
"""Context, model, particles, step: the handles of the C library as objects."""

import ctypes
import operator
import os
import threading
import weakref
from dataclasses import dataclass
from types import TracebackType
from typing import (
    Any,
    Callable,
    Dict,
    Optional,
    Sequence,
    SupportsIndex,
    Tuple,
    Type,
    TypeVar,
    Union,
)

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from . import _library
from ._arrays import Numbers, borrowed, rows_for, rows_of, written
from ._bodies import Body, Drain, Pose, Shape, Tap
from ._library import Field, Kind, Status, library

Vector = Tuple[float, float, float]
Quanta = Tuple[int, int, int]
Ids = NDArray[np.uint64]
Path = Union[str, "os.PathLike[str]"]


class Error(RuntimeError):
    """A call of the library that failed, and left what it was to change as it was."""

    def __init__(self, status: int, message: str) -> None:
        text: str = library.status_text(status).decode()
        super().__init__(f"{text}: {message}" if message else text)
        self.status = Status(status)


# ---- Whole numbers, which ctypes would wrap round ----


def _size(value: SupportsIndex) -> int:
    number = operator.index(value)
    if not 0 <= number < 2 ** (8 * ctypes.sizeof(ctypes.c_size_t)):
        raise ValueError(f"{number} is no count")
    return number


def _int32(name: str, value: SupportsIndex) -> int:
    number = operator.index(value)
    if not -(2**31) <= number < 2**31:
        raise ValueError(f"{name}: {number} does not fit 32 bits")
    return number


# ---- What all handles have in common ----


class _Guard:
    """One thread at a time. A callback that comes back to the same handle is told, not left waiting."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._owner = 0

    def __enter__(self) -> None:
        if self._owner == threading.get_ident():
            raise RuntimeError("this handle is in use by the call that called back")
        self._lock.acquire()
        self._owner = threading.get_ident()

    def __exit__(self, *_: object) -> None:
        self._owner = 0
        self._lock.release()


def _destroy(kind: str, handle: ctypes.c_void_p, *_: object) -> None:
    getattr(library, kind + "_destroy")(ctypes.byref(handle))


_Self = TypeVar("_Self", bound="_Handle")


class _Handle:
    """Owns one C handle. `kind` is the middle of its functions' names."""

    _kind = ""

    def _own(self, handle: ctypes.c_void_p, *keep: object) -> None:
        """keep: what C may call as long as the handle lives."""
        self._guard = _Guard()
        self._pointer = handle
        self._finalizer = weakref.finalize(self, _destroy, self._kind, handle, *keep)

    @property
    def _handle(self) -> ctypes.c_void_p:
        if not self._finalizer.alive:
            raise ValueError(f"this {self._kind} is closed")
        return self._pointer

    def close(self) -> None:
        """Frees the handle now; what still uses it in C lives on."""
        with self._guard:
            self._finalizer()

    def __enter__(self: _Self) -> _Self:
        return self

    def __exit__(
        self,
        kind: Optional[Type[BaseException]],
        error: Optional[BaseException],
        trace: Optional[TracebackType],
    ) -> None:
        self.close()


# ---- Context ----


class Context(_Handle):
    """Memory, log and threads, shared by everything made from it.

    threads  that a step may use at once, the caller's included
    log      called with a line for each failed call and each notable event; what it raises is printed
             by sys.unraisablehook and goes no further
    """

    _kind = "context"

    def __init__(
        self, threads: int = 1, *, log: Optional[Callable[[str], None]] = None, cpu_disable: int = 0
    ) -> None:
        options = _library.ContextOptions(
            thread_count=_int32("threads", threads), cpu_disable=cpu_disable
        )
        self._callback: Any = None
        if log is not None:
            call = log
            self._callback = _library.LOG(lambda _, line: call(line.decode("utf-8", "replace")))
            options.log = self._callback
        handle = ctypes.c_void_p()
        status = library.context_create(ctypes.byref(options), ctypes.byref(handle))
        if status != Status.OK:
            raise Error(status, f"context of {threads} threads")
        self._own(handle, self._callback)

    @property
    def cpu(self) -> int:
        """The ASCC_CPU_* bits in use."""
        return int(library.context_cpu(self._handle))

    def _check(self, status: int) -> None:
        if status != Status.OK:
            text = ctypes.create_string_buffer(1024)
            library.context_message(self._handle, text, len(text))
            raise Error(status, text.value.decode("utf-8", "replace"))


# ---- Model ----


def _coded(path: Path) -> bytes:
    """A path as C takes it."""
    name = os.fspath(path)
    coded = name.encode() if os.name == "nt" else os.fsencode(name)
    if b"\0" in coded:
        raise ValueError("path: holds a null character")
    return coded


@dataclass(frozen=True)
class ModelInfo:
    """What a model is: ascc_model_info. Lengths in metres, gravity with as many numbers as dimensions."""

    name: str
    description: str
    dimension: int
    level_count: int
    layer_count: int
    parameter_count: int
    multiply_adds: float
    conserves_momentum: bool
    conserves_angular_momentum: bool
    advected: bool
    neighbor_limit: int
    time_step: float
    time_step_min: float
    time_step_max: float
    gravity_min: float
    gravity_max: float
    way_max: float
    tells_distance: bool
    distance_threshold: float
    gravity: Tuple[float, ...]
    particle_spacing: float
    rest_density: float
    support_radius: float
    receptive_radius: float


class Model(_Handle):
    """Trained weights, read-only: any number of steps, in any threads, may share one."""

    _kind = "model"

    def __init__(self, path: Path, context: Optional[Context] = None) -> None:
        """Loads a model file, by its path or, where the library finds models, by its name ("water2d").

        Without a context the model makes its own, of one thread.
        """
        coded = _coded(path)

        def load(c: Any, handle: Any) -> int:
            found = ctypes.create_string_buffer(4096)
            status: int = library.model_find(c, coded, found, len(found))
            if status != Status.OK:
                return status
            return int(library.model_load(c, found.value, handle))

        self._open(context, load)

    @classmethod
    def from_bytes(cls, data: bytes, context: Optional[Context] = None) -> "Model":
        """As Model(path), of a file's bytes."""
        model = cls.__new__(cls)
        whole = bytes(data)
        model._open(
            context, lambda c, handle: library.model_load_memory(c, whole, len(whole), handle)
        )
        return model

    def _open(self, context: Optional[Context], load: Callable[[Any, Any], int]) -> None:
        self.context = context if context is not None else Context()
        handle = ctypes.c_void_p()
        self.context._check(load(self.context._handle, ctypes.byref(handle)))
        self._own(handle, self.context._callback)

    def __bytes__(self) -> bytes:
        """The model's file, byte for byte."""
        size = ctypes.c_size_t()
        data = library.model_bytes(self._handle, ctypes.byref(size))
        return ctypes.string_at(data, size.value)

    def save(self, path: Path) -> None:
        """Writes the model's file again, whole or not at all."""
        self.context._check(library.model_save(self._handle, _coded(path)))

    @property
    def info(self) -> ModelInfo:
        raw = _library.ModelInfo()
        self.context._check(library.model_get_info(self._handle, ctypes.byref(raw)))
        values: Dict[str, Any] = {
            name: getattr(raw, name) for name in ModelInfo.__dataclass_fields__
        }
        for name in ("name", "description"):
            values[name] = values[name].decode("utf-8", "replace")
        for name in (
            "conserves_momentum",
            "conserves_angular_momentum",
            "advected",
            "tells_distance",
        ):
            values[name] = bool(values[name])
        values["gravity"] = tuple(raw.gravity[: raw.dimension])
        return ModelInfo(**values)


# ---- Particles ----


@dataclass(frozen=True)
class Measures:
    """What Particles.measure finds: ascc_measures. Vectors have three numbers, in 2D the last is 0."""

    mass: float
    center: Vector
    momentum: Vector
    angular_momentum: Vector
    angular_scale: float
    kinetic_energy: float
    max_speed: float
    max_density: float
    mean_density: float
    min_distance: float
    close_count: int


@dataclass(frozen=True)
class BodyImpulse:
    """What a body received over the last run: quanta, exact; torque in kg length^2/s."""

    impulse: Quanta
    torque: Vector


class Particles(_Handle):
    """Fluid and boundary at one instant.

    Of a model: an empty set that suits it. Without one, dimension and spacing are wanted, and mass where
    the fluid is not water in SI units.

    length_unit       metres in one unit of length; give the step the same
    momentum_quantum  kg length/s; 0 = the default
    """

    _kind = "particles"

    def __init__(
        self,
        model: Optional[Model] = None,
        *,
        dimension: int = 0,
        spacing: float = 0.0,
        mass: float = 0.0,
        momentum_quantum: float = 0.0,
        length_unit: float = 1.0,
        context: Optional[Context] = None,
    ) -> None:
        self.context = context or (model.context if model is not None else Context())
        options = _library.ParticlesOptions()
        if model is not None:
            self.context._check(
                library.model_particles_options(model._handle, length_unit, ctypes.byref(options))
            )
        for name, value in (
            ("dimension", dimension),
            ("spacing", spacing),
            ("mass", mass),
            ("momentum_quantum", momentum_quantum),
        ):
            if value:
                setattr(options, name, value)
        handle = ctypes.c_void_p()
        self.context._check(
            library.particles_create(
                self.context._handle, ctypes.byref(options), ctypes.byref(handle)
            )
        )
        self._own(handle, self.context._callback)
        self.spacing = float(options.spacing)
        self.dimension = int(options.dimension)

    def _check(self, status: int) -> None:
        if status != Status.OK:
            message = library.particles_message(self._handle).decode("utf-8", "replace")
            raise Error(status, message)

    # How many

    def count(self, kind: Kind = Kind.FLUID) -> int:
        with self._guard:
            return int(library.particles_count(self._handle, kind))

    def __len__(self) -> int:
        """Fluid particles."""
        return self.count()

    def __bool__(self) -> bool:  # an empty set is a set
        return True

    def capacity(self, kind: Kind = Kind.FLUID) -> int:
        with self._guard:
            return int(library.particles_capacity(self._handle, kind))

    def reserve(self, fluid: int, boundary: int = 0) -> None:
        """Makes room so that adding up to these counts allocates nothing."""
        with self._guard:
            self._check(library.particles_reserve(self._handle, _size(fluid), _size(boundary)))

    # Adding and removing

    def add_fluid(
        self,
        position: ArrayLike,
        velocity: Optional[ArrayLike] = None,
        mass: Optional[ArrayLike] = None,
    ) -> Ids:
        """Adds fluid at the end; returns the ids.

        position  [count, dimension], length unit
        velocity  [count, dimension], length unit / s, or one row for all; None = at rest
        mass      [count], kg, or one number for all; None = the set's
        """
        x = rows_of("position", position, self.dimension)
        v = None if velocity is None else rows_for("velocity", velocity, len(x), self.dimension)
        m = None if mass is None else rows_for("mass", mass, len(x), 1)
        ids = np.empty(len(x), np.uint64)
        with self._guard:
            self._check(
                library.particles_add_fluid(
                    self._handle,
                    len(x),
                    ctypes.byref(borrowed(x)),
                    None if v is None else ctypes.byref(borrowed(v)),
                    None if m is None else ctypes.byref(borrowed(m)),
                    ids.ctypes.data,
                )
            )
        return ids

    def add_boundary(self, position: ArrayLike, normal: ArrayLike, body: int = 0) -> Ids:
        """Adds the points of one body at the end; returns the ids.

        position  [count, dimension], length unit
        normal    [count, dimension], unit vectors into the fluid, or one for all
        body      your number for the solid, >= 0
        """
        x = rows_of("position", position, self.dimension)
        n = rows_for("normal", normal, len(x), self.dimension)
        ids = np.empty(len(x), np.uint64)
        with self._guard:
            self._check(
                library.particles_add_boundary(
                    self._handle,
                    len(x),
                    ctypes.byref(borrowed(x)),
                    ctypes.byref(borrowed(n)),
                    _int32("body", body),
                    ids.ctypes.data,
                )
            )
        return ids

    def remove(self, ids: ArrayLike) -> None:
        """Removes particles of either kind by id; the others keep their order."""
        given = np.atleast_1d(np.asarray(ids))
        if given.size and given.dtype.kind not in "iu":
            raise TypeError(f"ids: {given.dtype}: whole numbers are wanted")
        if given.ndim != 1 or (given < 0).any():
            raise ValueError("ids: a list of numbers >= 0 is wanted")
        whole = np.ascontiguousarray(given, np.uint64)
        with self._guard:
            self._check(library.particles_remove(self._handle, len(whole), whole.ctypes.data))

    def clear(self, kind: Kind) -> None:
        """Drops all particles of a kind."""
        with self._guard:
            self._check(library.particles_clear(self._handle, kind))

    def resize_fluid(self, count: int) -> None:
        """Drops the last rows, or adds rows at the origin, at rest."""
        with self._guard:
            self._check(library.particles_resize_fluid(self._handle, _size(count)))

    # Fields

    def _components(self, field: int) -> int:
        return 1 if field in (Field.MASS, Field.DETAIL) else self.dimension

    def set(self, kind: Kind, field: int, values: ArrayLike, first: int = 0) -> None:
        """Sets a Field of as many rows as values has, from `first` on."""
        name = field.name.lower() if isinstance(field, Field) else f"field {field}"
        array = rows_of(name, values, self._components(field))
        with self._guard:
            self._check(
                library.particles_set(
                    self._handle,
                    kind,
                    field,
                    _size(first),
                    len(array),
                    ctypes.byref(borrowed(array)),
                )
            )

    def get(
        self,
        kind: Kind,
        field: int,
        first: int = 0,
        count: Optional[int] = None,
        *,
        out: Optional[Numbers] = None,
        dtype: DTypeLike = np.float32,
    ) -> Numbers:
        """A Field of rows [first, first + count); count None: of all from `first` on.

        out      array of float32 or float64 to write, of any strides; made if None
        returns  out, [count, dimension], or [count] of masses
        """
        with self._guard:
            rows = int(library.particles_count(self._handle, kind))
            if count is None:
                count = len(out) if out is not None else max(rows - _size(first), 0)
            components = self._components(field)
            shape = (_size(count),) if components == 1 else (_size(count), components)
            if _size(first) + count > rows:
                raise ValueError(f"rows [{first}, {first + count}) of {rows}")
            array, out = written("out", np.empty(shape, dtype) if out is None else out, shape)
            self.context._check(
                library.particles_get(self._handle, kind, field, first, count, ctypes.byref(array))
            )
        return out

    @property
    def position(self) -> Numbers:
        """Of the fluid, float32[count, dimension], a copy; setting it sets all rows."""
        return self.get(Kind.FLUID, Field.POSITION)

    @position.setter
    def position(self, values: ArrayLike) -> None:
        self._set_all(Field.POSITION, values)

    @property
    def velocity(self) -> Numbers:
        """Of the fluid, float32[count, dimension], a copy; setting it sets all rows."""
        return self.get(Kind.FLUID, Field.VELOCITY)

    @velocity.setter
    def velocity(self, values: ArrayLike) -> None:
        self._set_all(Field.VELOCITY, values)

    @property
    def mass(self) -> Numbers:
        """Of the fluid, float32[count], kg, a copy; setting it keeps velocities."""
        return self.get(Kind.FLUID, Field.MASS)

    @mass.setter
    def mass(self, values: ArrayLike) -> None:
        self._set_all(Field.MASS, values)

    def _set_all(self, field: Field, values: ArrayLike) -> None:
        self.set(
            Kind.FLUID,
            field,
            rows_for(field.name.lower(), values, self.count(), self._components(field)),
        )

    def ids(self, kind: Kind = Kind.FLUID) -> Ids:
        with self._guard:
            ids = np.empty(int(library.particles_count(self._handle, kind)), np.uint64)
            self.context._check(
                library.particles_get_ids(self._handle, kind, 0, len(ids), ids.ctypes.data)
            )
        return ids

    def bodies(self) -> NDArray[np.int32]:
        """Of each boundary row."""
        with self._guard:
            bodies = np.empty(int(library.particles_count(self._handle, Kind.BOUNDARY)), np.int32)
            self.context._check(
                library.particles_get_bodies(self._handle, 0, len(bodies), bodies.ctypes.data)
            )
        return bodies

    def find(self, id: int) -> Tuple[Kind, int]:
        """Kind and row of a particle; KeyError where no particle has this id."""
        kind, row = ctypes.c_int(), ctypes.c_size_t()
        with self._guard:
            number = operator.index(id)
            if not 0 <= number < 2**64 or library.particles_find(
                self._handle, number, ctypes.byref(kind), ctypes.byref(row)
            ):
                raise KeyError(id)
        return Kind(kind.value), row.value

    # Momentum, to the bit

    @property
    def momentum_quantum(self) -> float:
        """kg length/s that one unit of the integers below is worth."""
        return float(library.particles_momentum_quantum(self._handle))

    def momentum(self) -> NDArray[np.int64]:
        """Of each fluid row, int64[count, dimension], quanta: the state, of which velocities are readings."""
        with self._guard:
            rows = int(library.particles_count(self._handle, Kind.FLUID))
            quanta = np.empty((rows, self.dimension), np.int64)
            self.context._check(
                library.particles_get_momentum(self._handle, 0, rows, quanta.ctypes.data)
            )
        return quanta

    def total_momentum(self) -> Quanta:
        """Of the fluid, quanta, exact."""
        total = (ctypes.c_int64 * 3)()
        with self._guard:
            self.context._check(library.particles_total_momentum(self._handle, total))
        return total[0], total[1], total[2]

    def body_impulse(self, body: int = -1, point: Optional[Sequence[float]] = None) -> BodyImpulse:
        """What the last run gave to a body, -1 = all, with the torque about a point (the origin)."""
        about = None if point is None else (ctypes.c_double * 3)(*point)
        impulse, torque = (ctypes.c_int64 * 3)(), (ctypes.c_double * 3)()
        with self._guard:
            self.context._check(
                library.particles_body_impulse(
                    self._handle, _int32("body", body), about, impulse, torque
                )
            )
        return BodyImpulse((impulse[0], impulse[1], impulse[2]), (torque[0], torque[1], torque[2]))

    # Bodies

    def add_body(self, shape: Shape, pose: Optional[Pose] = None) -> int:
        """Adds a solid with a frame of its own at the end of the boundary; returns its number."""
        raw, kept = shape._raw(self.dimension)
        where = None if pose is None else ctypes.byref(pose._raw(self.dimension))
        body = ctypes.c_int32()
        with self._guard:
            self._check(library.body_add(self._handle, ctypes.byref(raw), where, ctypes.byref(body)))
        del kept
        return body.value

    def move_body(self, body: int, pose: Pose) -> None:
        """Says where a body is when the next step begins, and how it moves from then on."""
        raw = pose._raw(self.dimension)
        with self._guard:
            self._check(library.body_move(self._handle, _int32("body", body), ctypes.byref(raw)))

    def body(self, body: int) -> Body:
        """Where a body is now, and which rows of the boundary are its points."""
        info = _library.BodyInfo()
        with self._guard:
            self.context._check(
                library.body_get(self._handle, _int32("body", body), ctypes.byref(info))
            )
        pose = Pose(
            position=tuple(info.position),
            rotation=tuple(info.rotation),
            angle=info.angle,
            velocity=tuple(info.velocity),
            spin=tuple(info.spin),
        )
        return Body(int(info.first), int(info.count), pose)

    def remove_body(self, body: int) -> None:
        """Removes a body and its points."""
        with self._guard:
            self._check(library.body_remove(self._handle, _int32("body", body)))

    @property
    def body_numbers(self) -> Tuple[int, ...]:
        """Of all bodies with a frame, ascending."""
        with self._guard:
            count = int(library.bodies_list(self._handle, 0, None))
            numbers = (ctypes.c_int32 * max(count, 1))()
            library.bodies_list(self._handle, count, numbers)
        return tuple(numbers[:count])

    def body_impulses(self, bodies: Sequence[int]) -> Tuple[BodyImpulse, ...]:
        """What the last run gave to each of these bodies, with torques about their origins."""
        count = len(bodies)
        numbers = (ctypes.c_int32 * max(count, 1))(*(_int32("body", b) for b in bodies))
        impulse = (ctypes.c_int64 * (3 * max(count, 1)))()
        torque = (ctypes.c_double * (3 * max(count, 1)))()
        with self._guard:
            self.context._check(
                library.bodies_impulse(self._handle, count, numbers, impulse, torque)
            )
        return tuple(
            BodyImpulse(
                (impulse[3 * b], impulse[3 * b + 1], impulse[3 * b + 2]),
                (torque[3 * b], torque[3 * b + 1], torque[3 * b + 2]),
            )
            for b in range(count)
        )

    # Taps and drains

    def run_tap(self, tap: Tap, seconds: float) -> Ids:
        """Lets out what is due after some seconds, where there is room; returns the ids of what came."""
        count = ctypes.c_size_t()
        with self._guard:
            first = int(library.particles_count(self._handle, Kind.FLUID))
            self._check(
                library.tap_run(
                    self._handle, ctypes.byref(tap._raw), seconds, 0, None, ctypes.byref(count)
                )
            )
            ids = np.empty(count.value, np.uint64)
            self.context._check(
                library.particles_get_ids(
                    self._handle, Kind.FLUID, first, len(ids), ids.ctypes.data
                )
            )
        return ids

    def run_drain(self, drain: Drain) -> Ids:
        """Removes the fluid that a drain takes; returns the ids of what is gone."""
        raw, count = drain._struct(), ctypes.c_size_t()
        with self._guard:
            ids = np.empty(1 + int(library.particles_count(self._handle, Kind.FLUID)), np.uint64)
            self._check(
                library.drain_run(
                    self._handle, ctypes.byref(raw), len(ids), ids.ctypes.data, ctypes.byref(count)
                )
            )
        return ids[: count.value].copy()

    # The whole state

    @property
    def asleep(self) -> NDArray[np.bool_]:
        """Which fluid sleeps, after steps with a sleep_speed."""
        with self._guard:
            count = int(library.particles_count(self._handle, Kind.FLUID))
            flags = np.empty(count, np.uint8)
            self.context._check(
                library.particles_get_asleep(self._handle, 0, count, flags.ctypes.data)
            )
        return flags.astype(np.bool_)

    def wake(self) -> None:
        """Wakes all fluid."""
        with self._guard:
            self._check(library.particles_wake(self._handle))

    def snapshot(self) -> bytes:
        """The whole state: same bytes for same state, on any machine."""
        with self._guard:
            size = int(library.particles_snapshot_size(self._handle))
            memory = ctypes.create_string_buffer(size)
            self.context._check(library.particles_snapshot(self._handle, memory, size))
        return memory.raw

    def restore(self, snapshot: bytes) -> None:
        """Makes the set what it was; a run goes on from there bit for bit."""
        whole = bytes(snapshot)
        with self._guard:
            self._check(library.particles_restore(self._handle, whole, len(whole)))

    def hash(self) -> int:
        """Of all positions, momenta, masses, normals and bodies, in any order of rows."""
        with self._guard:
            return int(library.particles_hash(self._handle))

    def measure(self) -> Measures:
        """Energy, momenta, density, distances."""
        raw = _library.Measures()
        with self._guard:
            self._check(library.particles_measure(self._handle, ctypes.byref(raw)))
        values: Dict[str, Any] = {
            name: getattr(raw, name) for name in Measures.__dataclass_fields__
        }
        for name in ("center", "momentum", "angular_momentum"):
            values[name] = tuple(values[name])
        return Measures(**values)


# ---- Step ----


@dataclass(frozen=True)
class Compression:
    """Density over rest density less 1, where it is above 0."""

    mean: float
    largest: float


@dataclass(frozen=True)
class Statistics:
    """What Step.statistics tells of the last run: ascc_step_statistics. Momenta in quanta, exact."""

    steps: int
    substeps: int
    seconds_total: float
    stages: Dict[str, float]  # seconds by stage, in order
    level_points: Tuple[int, ...]
    pair_count: int
    neighbor_count: int
    max_neighbors: int
    scratch_size: int
    momentum_before: Quanta
    momentum_after: Quanta
    external_impulse: Quanta
    wall_impulse: Quanta
    compression_before: Compression
    compression_after: Compression
    sweeps: int
    substeps_total: int
    asleep: int
    support_impulse: Quanta
    distance_mean: float  # from training's states, with measure_distance (docs/trust.md)
    distance_worst: float
    distance_row: int
    distance_count: int


class Step(_Handle):
    """A model bound to the memory it needs to advance particles.

    time_step         s; 0 = the model's
    length_unit       metres in one unit of length, as the particles'
    max_displacement  length unit that a particle may move in a step; 0 = 64 spacings
    max_neighbors     of one point; 0 = 4096
    substeps          a time step is cut into: 0 = what the model's range asks for, n = at most n, -1 = none
    sleep_speed       fluid slower than this, in what gravity gives in a step, stops; 0 = none
    measure_distance  the statistics tell how far what is seen is from training's
    context           whose threads are used; None = the model's
    """

    _kind = "step"

    def __init__(
        self,
        model: Model,
        *,
        time_step: float = 0.0,
        length_unit: float = 1.0,
        max_displacement: float = 0.0,
        max_neighbors: int = 0,
        substeps: int = 0,
        sleep_speed: float = 0.0,
        measure_distance: bool = False,
        context: Optional[Context] = None,
    ) -> None:
        self.context = context or model.context
        options = _library.StepOptions(
            time_step=time_step,
            length_unit=length_unit,
            max_displacement=max_displacement,
            max_neighbors=_int32("max_neighbors", max_neighbors),
            substeps=_int32("substeps", substeps),
            sleep_speed=sleep_speed,
            measure_distance=int(measure_distance),
        )
        handle = ctypes.c_void_p()
        self.context._check(
            library.step_create(
                self.context._handle, model._handle, ctypes.byref(options), ctypes.byref(handle)
            )
        )
        self._own(handle, self.context._callback)

    def _check(self, status: int) -> None:
        if status != Status.OK:
            raise Error(status, library.step_message(self._handle).decode("utf-8", "replace"))

    def run(
        self,
        particles: Particles,
        count: int = 1,
        *,
        gravity: Optional[Sequence[float]] = None,
        acceleration: Optional[ArrayLike] = None,
    ) -> None:
        """Advances the fluid by `count` time steps. On an error the set is as after the last that succeeded.

        gravity       [dimension], length unit / s^2; None = the model's
        acceleration  [fluid count, dimension], or one row for all, added to gravity
        """
        steps = _int32("count", count)
        forces = _library.Forces()
        if gravity is not None:
            if len(gravity) != particles.dimension:
                raise ValueError(f"gravity: {len(gravity)} numbers in {particles.dimension}D")
            forces.gravity = (ctypes.c_double * len(gravity))(*gravity)
        with self._guard, particles._guard:
            if acceleration is not None:
                rows = int(library.particles_count(particles._handle, Kind.FLUID))
                a = rows_for("acceleration", acceleration, rows, particles.dimension)
                forces.acceleration = ctypes.pointer(borrowed(a))
            self._check(
                library.step_run(self._handle, particles._handle, ctypes.byref(forces), steps)
            )

    def estimate(self, fluid: int, boundary: int = 0) -> int:
        """Bytes of scratch that so many particles are expected to need."""
        return int(library.step_estimate(self._handle, _size(fluid), _size(boundary)))

    def reserve(self, fluid: int, boundary: int = 0) -> None:
        """Makes that much scratch at once."""
        with self._guard:
            self._check(library.step_reserve(self._handle, _size(fluid), _size(boundary)))

    @property
    def statistics(self) -> Statistics:
        raw = _library.StepStatistics()
        with self._guard:
            self.context._check(library.step_get_statistics(self._handle, ctypes.byref(raw)))
        values: Dict[str, Any] = {
            name: getattr(raw, name, None) for name in Statistics.__dataclass_fields__
        }
        for name in (
            "momentum_before",
            "momentum_after",
            "external_impulse",
            "wall_impulse",
            "support_impulse",
        ):
            values[name] = tuple(values[name])
        for name in ("compression_before", "compression_after"):
            values[name] = Compression(values[name].mean, values[name].largest)
        values["level_points"] = tuple(raw.level_points[: raw.level_count])
        values["stages"] = {s.name.decode(): s.seconds for s in raw.stage[: raw.stage_count]}
        return Statistics(**values)
