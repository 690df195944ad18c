/* Quaternions and their matrices; sine and cosine by polynomials, since those of libm differ between systems.
 * SPDX-License-Identifier: MIT */
#include "rotation.h"

#include <math.h>
#include <string.h>

#define TOLERANCE 1e-3 /* of a quaternion's length: hosts hold floats */

/* pi/2 as a sum: the first has 33 bits, so that its products with whole numbers below 2^20 are exact. */
#define HALF_PI_HIGH 0x1.921fb544p+0
#define HALF_PI_LOW 0x1.0b4611a626331p-34
#define TWO_OVER_PI 0x1.45f306dc9c883p-1

void ascc_sin_cos(double angle, double *sine, double *cosine)
{
    const double quarter = rint(angle * TWO_OVER_PI);
    const double x = (angle - quarter * HALF_PI_HIGH) - quarter * HALF_PI_LOW, s = x * x;
    /* The series as far as 17!: for |x| <= pi/4 what is left out is below half an ulp. */
    const double odd =
        x + x * s *
                (-1.0 / 6 +
                 s * (1.0 / 120 + s * (-1.0 / 5040 + s * (1.0 / 362880 +
                                                          s * (-1.0 / 39916800 +
                                                               s * (1.0 / 6227020800 -
                                                                    s * (1.0 / 1307674368000)))))));
    const double even =
        1 + s * (-1.0 / 2 +
                 s * (1.0 / 24 +
                      s * (-1.0 / 720 +
                           s * (1.0 / 40320 +
                                s * (-1.0 / 3628800 +
                                     s * (1.0 / 479001600 + s * (-1.0 / 87178291200 +
                                                                 s * (1.0 / 20922789888000))))))));
    const unsigned turn = (unsigned)(int)quarter & 3u;
    *sine = turn == 0 ? odd : turn == 1 ? even : turn == 2 ? -odd : -even;
    *cosine = turn == 0 ? even : turn == 1 ? -odd : turn == 2 ? -even : odd;
}

bool ascc_rotation_normalize(double rotation[4])
{
    double square = 0;
    for (int c = 0; c < 4; c++)
        square += rotation[c] * rotation[c];
    if (square == 0) {
        rotation[3] = 1;
        return true;
    }
    const double length = sqrt(square);
    if (!(fabs(length - 1) <= TOLERANCE))
        return false;
    if (fabs(length - 1) > 0x1p-52) /* one that is normalized stays as it is */
        for (int c = 0; c < 4; c++)
            rotation[c] /= length;
    return true;
}

void ascc_rotation_spin(double q[4], const double spin[3], double seconds)
{
    const double speed = sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]);
    if (speed == 0)
        return;
    double sine, w;
    ascc_sin_cos(0.5 * speed * seconds, &sine, &w);
    const double x = sine * (spin[0] / speed), y = sine * (spin[1] / speed),
                 z = sine * (spin[2] / speed);
    const double turned[4] = {
        w * q[0] + x * q[3] + (y * q[2] - z * q[1]),
        w * q[1] + y * q[3] + (z * q[0] - x * q[2]),
        w * q[2] + z * q[3] + (x * q[1] - y * q[0]),
        w * q[3] - (x * q[0] + y * q[1] + z * q[2]),
    };
    memcpy(q, turned, sizeof turned);
    (void)ascc_rotation_normalize(q);
}

void ascc_rotation_matrix(const double q[4], double matrix[3][3])
{
    const double x = q[0], y = q[1], z = q[2], w = q[3];
    const double of[3][3] = {
        {1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)},
        {2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)},
        {2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)},
    };
    memcpy(matrix, of, sizeof of);
}

void ascc_rotation_matrix_2d(double angle, double matrix[3][3])
{
    double sine, cosine;
    ascc_sin_cos(angle, &sine, &cosine);
    const double of[3][3] = {{cosine, -sine, 0}, {sine, cosine, 0}, {0, 0, 1}};
    memcpy(matrix, of, sizeof of);
}
