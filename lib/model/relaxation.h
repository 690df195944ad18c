/* A pressure relaxation after the network: its constants, from a description (docs/method.md, section on
 * relaxation). SPDX-License-Identifier: MIT */
#ifndef ASCC_MODEL_RELAXATION_H
#define ASCC_MODEL_RELAXATION_H

#include "file/json_reader.h"
#include "plan_builder.h"

/* What the reader takes. Supports are in units of the distance at which a lattice of resting particles has them. */
#define ASCC_SMALLEST_SUPPORT 1.5
#define ASCC_LARGEST_SUPPORT 4.0
#define ASCC_SMALLEST_EPSILON 1e-3
#define ASCC_LARGEST_EPSILON 10.0
/* Of a sweep: a deep column at rest blew up with Chebyshev's weights that began with 4. */
#define ASCC_SMALLEST_OMEGA 1e-3
#define ASCC_LARGEST_OMEGA 2.0

/* Reads the member `relaxation` of the description, if it is there, and finds what follows from it. The layers
 * are known. */
void ascc_relaxation_read(ascc_reader *reader, uint32_t object, ascc_plan_builder *builder);

/* Finds amount and lattice_response from the support and the rest volume. */
void ascc_relaxation_derive(ascc_relaxation *r, int32_t dimension);
/* Do sweeps of these weights leave no excess larger than it was? */
bool ascc_sweeps_settle(const ascc_sweeps *sweeps);

#endif
