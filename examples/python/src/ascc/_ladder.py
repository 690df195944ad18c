# SPDX-License-Identifier: MIT
"""Several models of one fluid, the best that a budget of time allows: ascc_ladder."""

import ctypes
from dataclasses import dataclass
from typing import Any, Dict, List, Optional, Sequence, Tuple

from . import _library
from ._library import LadderReason, Status, library
from ._objects import Context, Error, Model, Particles, Quanta, _Handle, _int32


@dataclass(frozen=True)
class LadderStatistics:
    """What Ladder.statistics tells: ascc_ladder_statistics. Arrays have an entry for each rung."""

    steps: int
    rung: int
    reason: LadderReason
    seconds: float
    budget: float
    predicted: Tuple[float, ...]
    steps_on: Tuple[int, ...]
    changes: int
    late: int
    momentum_before: Quanta
    momentum_after: Quanta
    external_impulse: Quanta
    wall_impulse: Quanta
    support_impulse: Quanta
    distance_mean: float
    distance_worst: float
    distance_row: int
    distance_count: int
    particles_on: Tuple[int, ...]


class Ladder(_Handle):
    """Steps with the best of several models that stays within a budget.

    models     of one dimension, spacing and time step, the best last
    budget     s that a step may take; 0 = any: always the last model
    dwell      s of simulated time between two changes, at least
    time_step  s; 0 = the models'
    length_unit  metres in one unit of length, as the particles'
    max_distance  mean distance from training beyond which the rung without a network runs; 0 = any
    context    whose threads are used; None = the last model's
    """

    _kind = "ladder"

    def __init__(
        self,
        models: Sequence[Model],
        *,
        budget: float = 0.0,
        dwell: float = 1.0,
        time_step: float = 0.0,
        length_unit: float = 1.0,
        max_distance: float = 0.0,
        context: Optional[Context] = None,
    ) -> None:
        if not models:
            raise ValueError("models: none")
        self.context = context or models[-1].context
        step = _library.StepOptions(time_step=time_step, length_unit=length_unit)
        options = _library.LadderOptions(
            budget=budget, dwell=dwell, step=ctypes.pointer(step), max_distance=max_distance
        )
        raw = (ctypes.c_void_p * len(models))(*[model._handle.value for model in models])
        handle = ctypes.c_void_p()
        self.context._check(
            library.ladder_create(
                self.context._handle, len(models), raw, ctypes.byref(options), ctypes.byref(handle)
            )
        )
        self._own(handle, self.context._callback)

    def _check(self, status: int) -> None:
        if status != Status.OK:
            raise Error(status, library.ladder_message(self._handle).decode("utf-8", "replace"))

    def _forces(self, particles: Particles, gravity: Optional[Sequence[float]]) -> _library.Forces:
        forces = _library.Forces()
        if gravity is not None:
            if len(gravity) != particles.dimension:
                raise ValueError(f"gravity: {len(gravity)} numbers in {particles.dimension}D")
            forces.gravity = (ctypes.c_double * len(gravity))(*gravity)
        return forces

    def run(
        self, particles: Particles, count: int = 1, *, gravity: Optional[Sequence[float]] = None
    ) -> None:
        """Advances the fluid by `count` time steps, each on the rung that the budget allows."""
        forces = self._forces(particles, gravity)
        with self._guard, particles._guard:
            self._check(
                library.ladder_run(
                    self._handle, particles._handle, ctypes.byref(forces), _int32("count", count)
                )
            )

    def replay(
        self,
        particles: Particles,
        rungs: Sequence[int],
        *,
        gravity: Optional[Sequence[float]] = None,
    ) -> None:
        """The same on given rungs, one for each step: `choices` of a run give its bits again."""
        forces = self._forces(particles, gravity)
        raw = (ctypes.c_int32 * len(rungs))(*rungs)
        with self._guard, particles._guard:
            self._check(
                library.ladder_replay(
                    self._handle, particles._handle, ctypes.byref(forces), raw, len(rungs)
                )
            )

    def measure(self, particles: Particles, *, gravity: Optional[Sequence[float]] = None) -> None:
        """Takes the time of each rung on this set, which stays as it is."""
        forces = self._forces(particles, gravity)
        with self._guard, particles._guard:
            self._check(
                library.ladder_measure(self._handle, particles._handle, ctypes.byref(forces))
            )

    def set_budget(self, seconds: float) -> None:
        with self._guard:
            self._check(library.ladder_set_budget(self._handle, seconds))

    @property
    def choices(self) -> List[int]:
        """The rung of every step so far."""
        with self._guard:
            count = int(library.ladder_step_count(self._handle))
            rungs = (ctypes.c_int32 * count)()
            self._check(library.ladder_get_choices(self._handle, 0, count, rungs))
        return list(rungs)

    def snapshot(self) -> bytes:
        """Choices and costs so far, to be kept beside a snapshot of the particles."""
        with self._guard:
            size = int(library.ladder_snapshot_size(self._handle))
            memory = ctypes.create_string_buffer(size)
            self._check(library.ladder_snapshot(self._handle, memory, size))
        return memory.raw

    def restore(self, snapshot: bytes) -> None:
        whole = bytes(snapshot)
        with self._guard:
            self._check(library.ladder_restore(self._handle, whole, len(whole)))

    @property
    def statistics(self) -> LadderStatistics:
        raw = _library.LadderStatistics()
        with self._guard:
            self.context._check(library.ladder_get_statistics(self._handle, ctypes.byref(raw)))
        values: Dict[str, Any] = {
            name: getattr(raw, name) for name in LadderStatistics.__dataclass_fields__
        }
        for name in (
            "momentum_before",
            "momentum_after",
            "external_impulse",
            "wall_impulse",
            "support_impulse",
        ):
            values[name] = tuple(values[name])
        for name in ("predicted", "steps_on", "particles_on"):
            values[name] = tuple(values[name][: raw.rung_count])
        values["reason"] = LadderReason(raw.reason)
        return LadderStatistics(**values)
