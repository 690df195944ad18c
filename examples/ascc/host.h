/* What every subcommand that drives the library shares: models by name, particles from a scene.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_HOST_H
#define ASCC_HOST_H

#include <ascc/ascc.h>

#include "sequence.h"

/* Why a model was not loaded. */
typedef struct ascc_host_error {
    char text[256];
} ascc_host_error;

enum { ASCC_HOST_PATH = 4096 };

/* The file of a model by name (ascc_model_find), or by path. */
ascc_status ascc_host_find(ascc_context *context, const char *name, char path[ASCC_HOST_PATH],
                           ascc_host_error *error);

/* A model file, by name or path, or a published network (published.h). */
ascc_status ascc_host_load(ascc_context *context, const char *name, ascc_model **model,
                           ascc_host_error *error);

/* The same, or `demo`: the demonstration model for that dimension and spacing. */
ascc_status ascc_host_model(ascc_context *context, const char *name, int32_t dimension,
                            double spacing, ascc_model **model, ascc_host_error *error);

/* A particle set with the fluid of one frame, its velocities, and all walls as body 0.
 * position, velocity: [count][dimension]. */
ascc_status ascc_host_particles(ascc_context *context, const ascc_sequence *scene,
                                const float *position, const float *velocity,
                                ascc_particles **particles);

/* Prints "ascc: WHAT: status: message" on stderr; the message may be empty. */
void ascc_host_complain(const char *what, ascc_status status, const char *message);

#endif
