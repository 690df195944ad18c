/* A scene's fluid as fewer, larger particles: a solver at another resolution as a method.
 * SPDX-License-Identifier: MIT
 *
 * Particles close together become one at their centre of mass, with their mean velocity; the solver moves
 * those. The scene's own particles are carried in the flow that these make, so that every measure still
 * has each particle: x' = x + mean displacement of the large ones around it, v' = their mean velocity. One
 * with none within reach flies freely. What is smaller than the large particles is lost, as it should be.
 */
#ifndef ASCC_METHOD_COARSE_H
#define ASCC_METHOD_COARSE_H

#include "method.h"

typedef struct ascc_coarse {
    const ascc_method_scene *scene;
    double reach;                        /* m, of a mean */
    size_t count;                        /* large particles */
    double *position, *velocity;         /* of these; velocities are given once, at the start */
    double *row_position, *row_velocity; /* [fluid_count][dimension], the scene's, carried */
} ascc_coarse;

/** factor   edge of a large particle's cell over that of a small one, 1 or more. False: no memory. */
bool ascc_coarse_open(ascc_coarse *c, const ascc_method_scene *scene, double factor,
                      double spacing);
void ascc_coarse_close(ascc_coarse *c);

/** Makes the large particles, the same for the same input. False: no memory. */
bool ascc_coarse_set(ascc_coarse *c, const double *position, const double *velocity);

/** Carries the scene's particles along for a frame; `position` and `velocity` are those of the large ones
 * after it. False: a number is not finite, or no memory. */
bool ascc_coarse_carry(ascc_coarse *c, const double *position, const double *velocity);

#endif
