/* Rotations: unit quaternions (x, y, z, w), sines and cosines with the same bits everywhere.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_ROTATION_H
#define ASCC_ROTATION_H

#include <stdbool.h>

/* The largest angle whose sine means anything, radians. */
#define ASCC_ANGLE_LIMIT 1e6

/* Within 2^-50 of the true ones for |angle| <= ASCC_ANGLE_LIMIT. */
void ascc_sin_cos(double angle, double *sine, double *cosine);

/* Makes a quaternion's length 1; all zeros become no rotation. False if its length is off by over 1e-3. */
bool ascc_rotation_normalize(double rotation[4]);

/* What a frame turned by a quaternion becomes when it spins with `spin`, rad/s in the world's axes, for some
 * seconds: exact for any angle. */
void ascc_rotation_spin(double rotation[4], const double spin[3], double seconds);

/* The matrix that takes a vector from the frame to the world. */
void ascc_rotation_matrix(const double rotation[4], double matrix[3][3]);
/* In 2D, of an angle. */
void ascc_rotation_matrix_2d(double angle, double matrix[3][3]);

#endif
