# SPDX-License-Identifier: MIT
"""The C library: found, its version checked, structs and functions declared as ascc/ascc.h has them."""

import ctypes
import os
import subprocess
import sys
from ctypes import c_char_p, c_double, c_int32, c_size_t, c_ssize_t, c_uint32, c_uint64, c_void_p
from enum import IntEnum
from typing import Any, Dict, Iterator, List, Tuple

VERSION = (0, 1)  # of the API below; until 1.0 each minor version may change it


class Status(IntEnum):
    """Result of a call of the library."""

    OK = 0
    ARGUMENT = -1
    MEMORY = -2
    FILE = -3
    FORMAT = -4
    NOT_FINITE = -5
    RANGE = -6
    MISMATCH = -7
    LIMIT = -8


class LadderReason(IntEnum):
    """Why a ladder's last step ran on its rung."""

    FITS = 0
    FELL = 1
    CLIMBED = 2
    WAITS = 3
    TOO_SLOW = 4
    GIVEN = 5
    STRANGE = 6


class Kind(IntEnum):
    """Which particles a call means."""

    FLUID = 0
    BOUNDARY = 1


class Field(IntEnum):
    """A property of a particle: POSITION of both kinds, VELOCITY and MASS of fluid, NORMAL of boundary,
    DETAIL of fluid: how much of it a ladder's best model computes.

    EARLIER_VELOCITY is that before the last step, EARLIER_VELOCITY + 1 that before the one before it, up to + 7:
    setting one sets those before it, too, setting VELOCITY all of them."""

    POSITION = 0
    VELOCITY = 1
    MASS = 2
    NORMAL = 3
    DETAIL = 4
    EARLIER_VELOCITY = 16


# ---- Structs ----

LOG = ctypes.CFUNCTYPE(None, c_void_p, c_char_p)


class Sized(ctypes.Structure):
    """A struct that begins with its size."""

    def __init__(self, **members: Any) -> None:
        super().__init__(size=ctypes.sizeof(type(self)), **members)


class ContextOptions(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("thread_count", c_int32),
        ("cpu_disable", c_uint32),
        ("allocate", c_void_p),
        ("reallocate", c_void_p),
        ("release", c_void_p),
        ("log", LOG),
        ("enqueue", c_void_p),
        ("finish", c_void_p),
        ("user", c_void_p),
    ]


class ModelInfo(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("dimension", c_int32),
        ("level_count", c_int32),
        ("layer_count", c_int32),
        ("conserves_momentum", c_int32),
        ("conserves_angular_momentum", c_int32),
        ("advected", c_int32),
        ("neighbor_limit", c_int32),
        ("reserved", c_int32),
        ("parameter_count", c_uint64),
        ("time_step", c_double),
        ("gravity", c_double * 3),
        ("particle_spacing", c_double),
        ("rest_density", c_double),
        ("support_radius", c_double),
        ("receptive_radius", c_double),
        ("name", c_char_p),
        ("description", c_char_p),
        ("time_step_min", c_double),
        ("time_step_max", c_double),
        ("multiply_adds", c_double),
        ("gravity_min", c_double),
        ("gravity_max", c_double),
        ("way_max", c_double),
        ("tells_distance", c_int32),
        ("reserved2", c_int32),
        ("distance_threshold", c_double),
    ]


class Array(ctypes.Structure):
    """ascc_array and ascc_const_array."""

    _fields_ = [
        ("data", c_void_p),
        ("stride", c_ssize_t),
        ("component_stride", c_ssize_t),
        ("scalar", ctypes.c_int),
        ("reserved", c_int32),
    ]


class ParticlesOptions(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("dimension", c_int32),
        ("reserved", c_int32),
        ("spacing", c_double),
        ("mass", c_double),
        ("momentum_quantum", c_double),
        ("fluid_capacity", c_size_t),
        ("boundary_capacity", c_size_t),
    ]


class Shape(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("kind", ctypes.c_int),
        ("water", ctypes.c_int),
        ("half", c_double * 3),
        ("radius", c_double),
        ("pitch", c_double),
        ("inset", c_double),
        ("open", c_uint32),
        ("reserved", c_int32),
        ("count", c_size_t),
        ("position", ctypes.POINTER(Array)),
        ("normal", ctypes.POINTER(Array)),
        ("face_count", c_size_t),
        ("faces", c_void_p),
    ]


class Pose(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("position", c_double * 3),
        ("rotation", c_double * 4),
        ("angle", c_double),
        ("velocity", c_double * 3),
        ("spin", c_double * 3),
        ("jump", c_double),
    ]


class BodyInfo(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("first", c_size_t),
        ("count", c_size_t),
        ("position", c_double * 3),
        ("rotation", c_double * 4),
        ("angle", c_double),
        ("velocity", c_double * 3),
        ("spin", c_double * 3),
    ]


class Tap(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("position", c_double * 3),
        ("radius", c_double),
        ("half", c_double * 3),
        ("velocity", c_double * 3),
        ("rate", c_double),
        ("pitch", c_double),
        ("clearance", c_double),
        ("mass", c_double),
        ("owed", c_double),
        ("emitted", c_uint64),
    ]


class Drain(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("kind", ctypes.c_int),
        ("outside", c_int32),
        ("position", c_double * 3),
        ("half", c_double * 3),
        ("radius", c_double),
        ("normal", c_double * 3),
        ("before", c_uint64),
    ]


class Measures(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("mass", c_double),
        ("center", c_double * 3),
        ("momentum", c_double * 3),
        ("angular_momentum", c_double * 3),
        ("angular_scale", c_double),
        ("kinetic_energy", c_double),
        ("max_speed", c_double),
        ("max_density", c_double),
        ("mean_density", c_double),
        ("min_distance", c_double),
        ("close_count", c_uint64),
    ]


class StepOptions(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("time_step", c_double),
        ("length_unit", c_double),
        ("max_displacement", c_double),
        ("max_neighbors", c_int32),
        ("substeps", c_int32),
        ("sleep_speed", c_double),
        ("measure_distance", c_int32),
        ("reserved", c_int32),
    ]


class Forces(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("gravity", ctypes.POINTER(c_double)),
        ("acceleration", ctypes.POINTER(Array)),
    ]


class StageTime(ctypes.Structure):
    _fields_ = [("name", c_char_p), ("seconds", c_double)]


class Compression(ctypes.Structure):
    _fields_ = [("mean", c_double), ("largest", c_double)]


class StepStatistics(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("steps", c_int32),
        ("level_count", c_int32),
        ("substeps", c_int32),
        ("stage_count", c_int32),
        ("seconds_total", c_double),
        ("stage", StageTime * 24),
        ("level_points", c_uint64 * 16),
        ("pair_count", c_uint64),
        ("neighbor_count", c_uint64),
        ("max_neighbors", c_uint64),
        ("scratch_size", c_uint64),
        ("momentum_before", ctypes.c_int64 * 3),
        ("momentum_after", ctypes.c_int64 * 3),
        ("external_impulse", ctypes.c_int64 * 3),
        ("wall_impulse", ctypes.c_int64 * 3),
        ("compression_before", Compression),
        ("compression_after", Compression),
        ("sweeps", c_uint64),
        ("substeps_total", c_uint64),
        ("asleep", c_uint64),
        ("support_impulse", ctypes.c_int64 * 3),
        ("distance_mean", c_double),
        ("distance_worst", c_double),
        ("distance_row", c_uint64),
        ("distance_count", c_uint64),
    ]


# Seconds that never run backwards.
CLOCK = ctypes.CFUNCTYPE(c_double, c_void_p)


class LadderOptions(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("budget", c_double),
        ("dwell", c_double),
        ("clock", CLOCK),
        ("user", c_void_p),
        ("step", ctypes.POINTER(StepOptions)),
        ("max_distance", c_double),
    ]


class LadderStatistics(Sized):
    _fields_ = [
        ("size", c_size_t),
        ("rung_count", c_int32),
        ("steps", c_int32),
        ("rung", c_int32),
        ("reason", c_int32),
        ("seconds", c_double),
        ("budget", c_double),
        ("predicted", c_double * 16),
        ("steps_on", c_uint64 * 16),
        ("changes", c_uint64),
        ("late", c_uint64),
        ("momentum_before", ctypes.c_int64 * 3),
        ("momentum_after", ctypes.c_int64 * 3),
        ("external_impulse", ctypes.c_int64 * 3),
        ("wall_impulse", ctypes.c_int64 * 3),
        ("support_impulse", ctypes.c_int64 * 3),
        ("distance_mean", c_double),
        ("distance_worst", c_double),
        ("distance_row", c_uint64),
        ("distance_count", c_uint64),
        ("particles_on", c_uint64 * 16),
    ]


# ---- Functions ----

_OUT = ctypes.POINTER(c_void_p)
_SIZE = ctypes.POINTER(c_size_t)
_INT = ctypes.c_int
_ARRAY = ctypes.POINTER(Array)
_RUNGS = ctypes.POINTER(c_int32)

_FUNCTIONS: Dict[str, Tuple[Any, List[Any]]] = {
    "status_text": (c_char_p, [_INT]),
    "version": (c_int32, []),
    "context_create": (_INT, [ctypes.POINTER(ContextOptions), _OUT]),
    "context_destroy": (None, [_OUT]),
    "context_cpu": (c_uint32, [c_void_p]),
    "context_message": (c_size_t, [c_void_p, c_char_p, c_size_t]),
    "model_find": (_INT, [c_void_p, c_char_p, c_char_p, c_size_t]),
    "model_load": (_INT, [c_void_p, c_char_p, _OUT]),
    "model_load_memory": (_INT, [c_void_p, c_char_p, c_size_t, _OUT]),
    "model_save": (_INT, [c_void_p, c_char_p]),
    "model_bytes": (c_void_p, [c_void_p, _SIZE]),
    "model_get_info": (_INT, [c_void_p, ctypes.POINTER(ModelInfo)]),
    "model_destroy": (None, [_OUT]),
    "model_particles_options": (_INT, [c_void_p, c_double, ctypes.POINTER(ParticlesOptions)]),
    "particles_create": (_INT, [c_void_p, ctypes.POINTER(ParticlesOptions), _OUT]),
    "particles_destroy": (None, [_OUT]),
    "particles_reserve": (_INT, [c_void_p, c_size_t, c_size_t]),
    "particles_add_fluid": (_INT, [c_void_p, c_size_t, _ARRAY, _ARRAY, _ARRAY, c_void_p]),
    "particles_add_boundary": (_INT, [c_void_p, c_size_t, _ARRAY, _ARRAY, c_int32, c_void_p]),
    "particles_remove": (_INT, [c_void_p, c_size_t, c_void_p]),
    "particles_clear": (_INT, [c_void_p, _INT]),
    "particles_resize_fluid": (_INT, [c_void_p, c_size_t]),
    "particles_count": (c_size_t, [c_void_p, _INT]),
    "particles_capacity": (c_size_t, [c_void_p, _INT]),
    "particles_dimension": (c_int32, [c_void_p]),
    "particles_set": (_INT, [c_void_p, _INT, _INT, c_size_t, c_size_t, _ARRAY]),
    "particles_get": (_INT, [c_void_p, _INT, _INT, c_size_t, c_size_t, _ARRAY]),
    "particles_get_ids": (_INT, [c_void_p, _INT, c_size_t, c_size_t, c_void_p]),
    "particles_get_bodies": (_INT, [c_void_p, c_size_t, c_size_t, c_void_p]),
    "particles_find": (_INT, [c_void_p, c_uint64, ctypes.POINTER(_INT), _SIZE]),
    "particles_momentum_quantum": (c_double, [c_void_p]),
    "particles_get_momentum": (_INT, [c_void_p, c_size_t, c_size_t, c_void_p]),
    "particles_total_momentum": (_INT, [c_void_p, c_void_p]),
    "particles_body_impulse": (_INT, [c_void_p, c_int32, c_void_p, c_void_p, c_void_p]),
    "particles_get_asleep": (_INT, [c_void_p, c_size_t, c_size_t, c_void_p]),
    "particles_wake": (_INT, [c_void_p]),
    "particles_snapshot_size": (c_size_t, [c_void_p]),
    "particles_snapshot": (_INT, [c_void_p, c_void_p, c_size_t]),
    "particles_restore": (_INT, [c_void_p, c_char_p, c_size_t]),
    "particles_hash": (c_uint64, [c_void_p]),
    "particles_message": (c_char_p, [c_void_p]),
    "particles_measure": (_INT, [c_void_p, ctypes.POINTER(Measures)]),
    "body_add": (_INT, [c_void_p, ctypes.POINTER(Shape), ctypes.POINTER(Pose), c_void_p]),
    "body_move": (_INT, [c_void_p, c_int32, ctypes.POINTER(Pose)]),
    "body_get": (_INT, [c_void_p, c_int32, ctypes.POINTER(BodyInfo)]),
    "body_remove": (_INT, [c_void_p, c_int32]),
    "bodies_list": (c_size_t, [c_void_p, c_size_t, c_void_p]),
    "bodies_impulse": (_INT, [c_void_p, c_size_t, c_void_p, c_void_p, c_void_p]),
    "tap_run": (_INT, [c_void_p, ctypes.POINTER(Tap), c_double, c_size_t, c_void_p, _SIZE]),
    "drain_run": (_INT, [c_void_p, ctypes.POINTER(Drain), c_size_t, c_void_p, _SIZE]),
    "step_create": (_INT, [c_void_p, c_void_p, ctypes.POINTER(StepOptions), _OUT]),
    "step_destroy": (None, [_OUT]),
    "step_estimate": (c_size_t, [c_void_p, c_size_t, c_size_t]),
    "step_reserve": (_INT, [c_void_p, c_size_t, c_size_t]),
    "step_run": (_INT, [c_void_p, c_void_p, ctypes.POINTER(Forces), c_int32]),
    "step_get_statistics": (_INT, [c_void_p, ctypes.POINTER(StepStatistics)]),
    "step_message": (c_char_p, [c_void_p]),
    "ladder_create": (_INT, [c_void_p, c_size_t, _OUT, ctypes.POINTER(LadderOptions), _OUT]),
    "ladder_destroy": (None, [_OUT]),
    "ladder_run": (_INT, [c_void_p, c_void_p, ctypes.POINTER(Forces), c_int32]),
    "ladder_replay": (_INT, [c_void_p, c_void_p, ctypes.POINTER(Forces), _RUNGS, c_int32]),
    "ladder_measure": (_INT, [c_void_p, c_void_p, ctypes.POINTER(Forces)]),
    "ladder_set_budget": (_INT, [c_void_p, c_double]),
    "ladder_get_statistics": (_INT, [c_void_p, ctypes.POINTER(LadderStatistics)]),
    "ladder_step": (c_void_p, [c_void_p, c_int32]),
    "ladder_step_count": (c_uint64, [c_void_p]),
    "ladder_get_choices": (_INT, [c_void_p, c_uint64, c_size_t, _RUNGS]),
    "ladder_snapshot_size": (c_size_t, [c_void_p]),
    "ladder_snapshot": (_INT, [c_void_p, c_void_p, c_size_t]),
    "ladder_restore": (_INT, [c_void_p, c_char_p, c_size_t]),
    "ladder_message": (c_char_p, [c_void_p]),
}


def _places() -> Iterator[str]:
    """Where the library may be: what ASCC_LIBRARY says alone, else the loader's places, then pkg-config's."""
    given = os.environ.get("ASCC_LIBRARY")
    if given:
        yield given
        return
    if sys.platform == "win32":
        yield from ("ascc-0.dll", "libascc-0.dll")
        return
    name = "libascc.0.dylib" if sys.platform == "darwin" else "libascc.so.0"
    yield name
    try:
        told = subprocess.run(
            ["pkg-config", "--variable=libdir", "ascc"], capture_output=True, text=True, check=True
        )
        yield os.path.join(told.stdout.strip(), name)
    except (OSError, subprocess.CalledProcessError):
        pass


def _load() -> ctypes.CDLL:
    reasons = []
    for name in _places():
        try:
            return ctypes.CDLL(name)
        except OSError as error:
            reasons.append(str(error))
    raise ImportError(
        "libascc was not found: install it, or set ASCC_LIBRARY to its file (%s)"
        % "; ".join(reasons)
    )


class _Library:
    """The functions of ascc.h by their names without ascc_."""

    def __init__(self) -> None:
        loaded = _load()
        for name, (result, arguments) in _FUNCTIONS.items():
            try:
                function = getattr(loaded, "ascc_" + name)
            except AttributeError:
                raise ImportError("%s has no ascc_%s" % (loaded._name, name)) from None
            function.restype, function.argtypes = result, arguments
            setattr(self, name, function)

    def __getattr__(self, name: str) -> Any:  # for those who check types
        raise AttributeError(name)


library = _Library()


def version() -> Tuple[int, int, int]:
    """The version of the C library that runs: (major, minor, patch)."""
    number: int = library.version()
    return number // 10000, number // 100 % 100, number % 100


if version()[:2] != VERSION and (VERSION[0] == 0 or version()[:2] < VERSION):
    raise ImportError(
        "libascc is version %d.%d.%d" % version() + ", this package is for %d.%d" % VERSION
    )
