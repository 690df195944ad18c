/* Where a displacement lies in a grid kernel's cube, and how that changes with it: for the way back.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_CUBE_H
#define ASCC_CUBE_H

#include "model/plan.h"

/* Cells around a point of a kernel's cube, their weights, and the weights' derivatives. */
typedef struct ascc_trilinear {
    size_t cell[8];
    double weight[8], slope[8][3];
    int count;
} ascc_trilinear;
void ascc_trilinear_at(const int32_t cells[3], const double at[3], ascc_trilinear *t);

/* A grid filter's place in the cube and window for a displacement (m), with derivatives. */
typedef struct ascc_place_in_cube {
    double at[3], slope[3][3]; /* d at[i] / d r[j] */
    double window, window_slope[3];
} ascc_place_in_cube;
void ascc_place_in_cube_of(const ascc_filter *filter, const double r[3], ascc_place_in_cube *place);

#endif
