/* Networks to train: the description of one, from a few numbers.
 * SPDX-License-Identifier: MIT
 *
 *   family BASIS   cheap and central: layers on the fluid, scales connected by transfers,
 *
 *        fluid   l0 ─────────────────────────────► l1 ─► l2 ─► output
 *                 ▼                                 ▲
 *        level1  d1 ─► c1_1 ────────► u1 ─► v1 ─────┘
 *                       ▼             ▲
 *        level2        d2 ─► c2_1 ────┘             (walls enter at l0 and at d1)
 *
 *   family GRID    the paper's: layers on fluid and walls, every branch sees every branch of the
 *                  layer before that is at most two levels away.
 */
#ifndef ASCC_ARCHITECTURE_H
#define ASCC_ARCHITECTURE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum {
    ASCC_ARCHITECTURE_LEVELS = 3,
    ASCC_ARCHITECTURE_BUMPS = 8,
    ASCC_ARCHITECTURE_ORDER = 2,
    ASCC_ARCHITECTURE_CHANNELS = 1024
};

typedef enum ascc_architecture_family {
    ASCC_FAMILY_BASIS,
    ASCC_FAMILY_GRID
} ascc_architecture_family;

typedef enum ascc_architecture_output {
    ASCC_OUTPUT_PLAIN,
    ASCC_OUTPUT_ANTISYMMETRIC
} ascc_architecture_output;

typedef enum ascc_architecture_sampling {
    ASCC_SAMPLE_CENTERS,
    ASCC_SAMPLE_CORNERS,
    ASCC_SAMPLE_FARTHEST
} ascc_architecture_sampling;

/* Words of a config file for the members below, each list in the order of its numbers. */
extern const char *const ascc_architecture_kernels[2];     /* basis, grid */
extern const char *const ascc_architecture_outputs[2];     /* plain, antisymmetric */
extern const char *const ascc_architecture_projections[2]; /* none, radial */
extern const char *const ascc_architecture_samplings[3];   /* centers, corners, farthest */
extern const char *const ascc_architecture_evaluates[2];   /* current, advected */
extern const char *const ascc_architecture_directions[2];  /* current, seen */

typedef struct ascc_architecture {
    char name[64], description[256];
    int32_t dimension;
    ascc_architecture_family kernel;
    double spacing, time_step, gravity[3], rest_density;
    int32_t channels, fine_layers; /* on the particles; fine_layers >= 2 */
    int32_t levels;                /* coarser ones, of 2, 4, 8 spacings: 0 to 3 */
    int32_t coarse_channels[ASCC_ARCHITECTURE_LEVELS];
    int32_t coarse_layers;      /* of each level on the way down */
    double radius, wall_radius; /* spacings; wall_radius: of BASIS only */
    double output_radius;       /* of BASIS, spacings; 0 = radius */
    int32_t output_bumps;       /* of BASIS */
    bool gravity_seen;          /* of BASIS: a feature of the fluid */
    double impulse_limit;       /* of BASIS: of one pair in a step, as spacings moved; 0 = none */
    double
        contact; /* of BASIS with walls seen: how close the fluid comes to them, spacings; 0 = as close as it gets */
    bool seen_direction; /* of BASIS: pairs act along the line that the network sees */
    int32_t bumps, order, wall_bumps;
    ascc_architecture_output output;
    bool radial;                         /* projection, of GRID only */
    bool damping;                        /* of an antisymmetric BASIS output */
    ascc_architecture_sampling sampling; /* FARTHEST: convolutions in place of transfers */
    bool advected;                       /* where the network sees particles */
} ascc_architecture;

/* What stands where nothing else is said; name, spacing and time_step are 0. */
ascc_architecture ascc_architecture_default(int32_t dimension, ascc_architecture_family kernel);

/* The text of a description (docs/file-format.md), to be freed by free(); it tells the shapes of all tensors.
 * NULL with a line in error: a number that does not fit, no memory. */
char *ascc_architecture_describe(const ascc_architecture *architecture, char *error,
                                 size_t capacity);

#endif
