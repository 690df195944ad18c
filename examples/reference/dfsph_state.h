/* What the parts of the DFSPH solver share. SPDX-License-Identifier: MIT
 *
 * All fluid particles have the volume V. For a pair, g_ij = V grad W(x_i - x_j); the walls around particle i
 * come to one vector B_i = sum_b V_b grad W(x_i - x_b), those of body k to B_ik and to T_ik, the same sum
 * of (x_b - c_k) x. So a pressure acts on a body with V rho_0 p_i (B_ik, T_ik), and a body that moves
 * with (u, w) changes the density of i at the rate -(u . B_ik + w . T_ik).
 */
#ifndef REFERENCE_DFSPH_STATE_H
#define REFERENCE_DFSPH_STATE_H

#include "base/common.h"
#include "dfsph.h"
#include "near.h"

/* Four numbers side by side; the last is of no use. */
typedef float dfsph_four __attribute__((vector_size(16)));

/* B_ik and T_ik. */
typedef struct dfsph_touch {
    double force[3], torque[3];
} dfsph_touch;

struct dfsph {
    dfsph_options options;
    near_lists *lists;
    size_t fluid, walls, capacity, pair_capacity, touch_capacity;
    double (*x)[3];        /* [fluid | walls] */
    double (*v)[3];        /* [fluid] */
    double (*own)[3];      /* [walls] from the centre of their body, in its axes */
    double *wall_volume;   /* [walls] */
    uint8_t *wall_body;    /* [walls] 0 = stands still, k + 1 = body k */
    double *density;       /* [fluid] 1 = rest */
    double (*change)[3];   /* [fluid] of a velocity in a step */
    double (*wall_sum)[3]; /* [fluid] B_i of all walls and bodies */
    uint32_t *near_count;  /* [fluid] all points within the support */
    uint32_t *pair_count;  /* [fluid] of them fluid: pairs of row i from lists->start[i] on */
    uint32_t *pair_row;    /* [pairs] */
    dfsph_four *pair;      /* [pairs] g_ij */
    dfsph_four *slope;     /* [fluid] sum_j g_ij + B_i */
    dfsph_four *push;      /* [fluid] acceleration by the present pressures */
    float *inverse;        /* [fluid] 1 / (|slope|^2 + sum_j |g_ij|^2) */
    float *wanted;         /* [fluid] what is to change, see solve */
    float *residual;       /* [fluid] */
    float *hold,
        *calm; /* [fluid] pressures of the last step, against compression and its rate: rest density
                           times p / rho^2, m^2/s^2 */
    rigid body[DFSPH_BODIES];
    size_t body_count;
    dfsph_touch *touch;                          /* [body_count][fluid] of bodies that move */
    double support, volume, mass, normalisation; /* m, m^d, kg, 1/m^d */
    double wall_drift;                           /* m that walls moved since the lists were made */
    double wall_impulse[3];
    dfsph_totals totals;
    ascc_message message;
};

/* Room for `count` rows in all arrays of rows. */
ascc_status dfsph_reserve(dfsph *s, size_t count);

/* Lists, pairs and densities at the present positions. */
ascc_status dfsph_look(dfsph *s);

/* The two solvers, each a change of velocities in a step of dt: no compression after it, and no rate of
 * compression now. */
void dfsph_end_compression(dfsph *s, double dt);
void dfsph_end_divergence(dfsph *s, double dt);

/* Volumes of wall points [first, first + count), which are of one body. errors: MEMORY, RANGE, LIMIT. */
ascc_status dfsph_weigh_walls(dfsph *s, size_t first, size_t count);

#endif
