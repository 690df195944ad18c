/* Points on a ball, or on a disc's rim in 2D. SPDX-License-Identifier: MIT */
#ifndef ASCC_BALL_H
#define ASCC_BALL_H

#include <stddef.h>
#include <stdint.h>

/* Unit vectors [count][dimension] to points that lie about `spacing` apart on a ball of that radius, evenly
 * on a circle, by the golden angle on a sphere. *normal is from malloc, NULL without memory. Returns how
 * many. */
size_t ascc_ball_points(int32_t dimension, double radius, double spacing, float **normal);

#endif
