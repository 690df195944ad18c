/* A recipe in motion, by whichever solver it is for. SPDX-License-Identifier: MIT */
#ifndef REFERENCE_FLOW_H
#define REFERENCE_FLOW_H

#include "recipes.h"

typedef struct flow flow;

/* A solver with the recipe's fluid, settled where it says so; *walls receives the wall points, for
 * wall_points_free. The recipe stays the caller's, and as it is. errors: MEMORY, and those of the solver. */
ascc_status flow_create(const recipe *made, int32_t thread_count, flow **created,
                        wall_points *walls);
void flow_destroy(flow **f);

ascc_status flow_advance(flow *f, double dt);

/* Positions and velocities into frame[2][count * dimension]. */
void flow_read(const flow *f, float *frame);
/* Whether walls move, and where they are: [walls][dimension] each, in the order that flow_create gave. */
bool flow_walls_move(const flow *f);
void flow_read_walls(const flow *f, float *position, float *normal);
double flow_mass(const flow *f);
/* The solver and its settings in words. */
void flow_describe(const flow *f, const wall_points *walls, char *text, size_t capacity);
const char *flow_message(const flow *f);

#endif
