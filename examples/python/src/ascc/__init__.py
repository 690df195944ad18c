# SPDX-License-Identifier: MIT
"""libascc from Python: learned particle fluids that conserve momentum to the bit.

    model = ascc.Model("examples/models/water2d.safetensors")
    water = ascc.Particles(model)
    h = water.spacing
    water.add_fluid(ascc.block((h / 2, h / 2), (20, 40), h))
    water.add_boundary(*ascc.box((0, 0), (1, 0.6), h))
    step = ascc.Step(model)
    step.run(water, 100)
    water.position    # float32[800, 2]

Shapes, units, errors and costs are those of the C header, ascc/ascc.h, whose names are kept:
`Particles.add_fluid` is `ascc_particles_add_fluid`. What differs:

arrays   Any array of float32 or float64 is read and written where it is, whatever its strides; a copy is
         made only where that cannot be: other types, and axes that NumPy repeats (strides of 0).
         One number or one row stands for all rows where an argument says so.
errors   are `ascc.Error`, with `status` and the handle's message; nothing has changed then.
         Arrays that cannot be meant raise ValueError or TypeError.
threads  Calls run without the interpreter's lock. A particle set and a step serve one thread at a
         time: a second one waits. Do not fork while a context of several threads is alive.
life     Handles are freed with their objects, or earlier by close() or `with`.
"""

from ._bodies import Body, Drain, DrainKind, Pose, Shape, ShapeKind, Tap, Water
from ._ladder import Ladder, LadderStatistics
from ._library import Field, Kind, LadderReason, Status, version
from ._objects import (
    BodyImpulse,
    Compression,
    Context,
    Error,
    Measures,
    Model,
    ModelInfo,
    Particles,
    Statistics,
    Step,
)
from ._scenes import block, box, surface

FLUID, BOUNDARY = Kind.FLUID, Kind.BOUNDARY
POSITION, VELOCITY, MASS, NORMAL = Field.POSITION, Field.VELOCITY, Field.MASS, Field.NORMAL
DETAIL, EARLIER_VELOCITY = Field.DETAIL, Field.EARLIER_VELOCITY

__version__ = "0.1.0"
__all__ = [
    "BOUNDARY",
    "Body",
    "BodyImpulse",
    "Compression",
    "Context",
    "DETAIL",
    "Drain",
    "DrainKind",
    "Error",
    "FLUID",
    "Field",
    "Kind",
    "Ladder",
    "LadderReason",
    "LadderStatistics",
    "MASS",
    "Measures",
    "Model",
    "ModelInfo",
    "NORMAL",
    "POSITION",
    "Particles",
    "Pose",
    "Shape",
    "ShapeKind",
    "Statistics",
    "Status",
    "Step",
    "Tap",
    "VELOCITY",
    "Water",
    "block",
    "box",
    "surface",
    "version",
]
