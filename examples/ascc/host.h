/* What every subcommand that drives the library shares: models by name, particles from a scene.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_HOST_H
#define ASCC_HOST_H

#include <ascc/ascc.h>

#include "sequence.h"

/* A model file, or `demo`: the demonstration model for that dimension and spacing. */
ascc_status ascc_host_model(ascc_context *context, const char *name, int32_t dimension,
                            double spacing, ascc_model **model);

/* A particle set with the fluid of one frame, its velocities, and all walls as body 0.
 * position, velocity: [count][dimension]. */
ascc_status ascc_host_particles(ascc_context *context, const ascc_sequence *scene,
                                const float *position, const float *velocity,
                                ascc_particles **particles);

/* Prints "ascc: WHAT: status: the context's message" on stderr. */
void ascc_host_complain(ascc_context *context, const char *what, ascc_status status);

#endif
