/* Small networks to train for the fuzz targets of the trainer. SPDX-License-Identifier: MIT */
#ifndef ASCC_FUZZ_TRAINEES_H
#define ASCC_FUZZ_TRAINEES_H

#include "support/model_builder.h"

/* By number: pairs by grid and by basis, two levels, walls that act; a plain output, set abstractions. */
static const model_random trainees[] = {
    {.seed = 1, .channels = 4, .trunk_layers = 1, .cells = 2, .output_cells = 2},
    {.seed = 2,
     .channels = 4,
     .bumps = 2,
     .order = 1,
     .levels = 2,
     .transfer = 1,
     .method = "voxel_corners",
     .no_hysteresis = 1},
    {.seed = 3,
     .channels = 4,
     .trunk_layers = 1,
     .bumps = 2,
     .order = 1,
     .fluid_only = 1,
     .motion = 1,
     .damping = 1,
     .walls = 1,
     .limit = 0.5,
     .contact = 0.4},
    {.seed = 4, .channels = 4, .trunk_layers = 1, .cells = 2, .output_cells = 2, .plain = 1},
    {.seed = 5,
     .channels = 4,
     .trunk_layers = 1,
     .bumps = 2,
     .levels = 2,
     .method = "farthest",
     .abstraction = 1 + 2 + 32,
     .plain = 1},
};
enum { TRAINEES = sizeof trainees / sizeof *trainees };

#endif
