/* A relaxation from its definition alone: docs/method.md in doubles over all pairs of particles of one mass.
 * SPDX-License-Identifier: MIT */
#ifndef RELAXATION_ORACLE_H
#define RELAXATION_ORACLE_H

#include "model/plan.h"

/* What a model's relaxation makes of positions and velocities [fluid][dimension] that the network left;
 * `before` are the positions that the step began with, gravity that of the step; guess, [fluid] or NULL, is the
 * value that pressures begin with. Without contact. */
void relaxation_oracle(const ascc_plan *plan, size_t fluid, size_t walls, const double *wall,
                       const double *before, const double *guess, const double gravity[3],
                       double *position, double *velocity);

#endif
