/* What the reference solvers need as methods: layers of wall particles, and settings.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_METHOD_WALLS_H
#define ASCC_METHOD_WALLS_H

#include "method.h"

/** Spacing of a lattice whose particles have the scene's mass at rest density, m: what a solver that
 * computes densities takes. A scene's own spacing may be wider: see `particle_mass` of sequences. */
double ascc_method_spacing(const ascc_method_scene *scene);

/**
 * Wall particles in layers behind the scene's walls, as the reference solvers want them: `spacing`
 * apart, layer k (k + 1/2) spacings behind. A scene whose walls come in layers already gives those.
 *
 * position  receives [count][dimension], to be given to free(); NULL without walls
 */
bool ascc_method_layers(const ascc_method_scene *scene, double spacing, int32_t layers,
                        double **position, size_t *count, ascc_method_error *error);

/** A setting "name=number". */
typedef struct ascc_method_setting {
    const char *name;
    double *value;
} ascc_method_setting;

/** Reads "a=1,b=2"; what is not named stays. The list ends with a NULL name. */
bool ascc_method_settings(const char *text, const ascc_method_setting *known,
                          ascc_method_error *error);

#endif
