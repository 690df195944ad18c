/* Points on a ball, or on a disc's rim in 2D. SPDX-License-Identifier: MIT */
#include "ball.h"

#include <math.h>
#include <stdlib.h>

#define PI 3.14159265358979323846

size_t ascc_ball_points(int32_t dimension, double radius, double spacing, float **normal)
{
    const double golden = PI * (3.0 - sqrt(5.0)), ratio = radius / spacing;
    const double wanted = dimension == 2 ? 2.0 * PI * ratio : 4.0 * PI * ratio * ratio;
    const size_t count = wanted < 6.0 ? 6 : wanted > 1e6 ? 1000000 : (size_t)ceil(wanted);
    float *n = malloc(count * (size_t)dimension * sizeof *n);
    *normal = n;
    for (size_t i = 0; n && i < count; i++) {
        const double along = ((double)i + 0.5) / (double)count, height = 1.0 - 2.0 * along;
        const double turn = dimension == 2 ? 2.0 * PI * along : golden * (double)i;
        const double wide = dimension == 2 ? 1.0 : sqrt(1.0 - height * height);
        n[i * (size_t)dimension] = (float)(wide * cos(turn));
        n[i * (size_t)dimension + 1] = (float)(wide * sin(turn));
        if (dimension == 3)
            n[i * 3 + 2] = (float)height;
    }
    return n ? count : 0;
}
