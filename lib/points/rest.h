/* Fluid that sleeps: what a row says of it, and what wakes it between steps (docs/sleeping.md).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_REST_H
#define ASCC_REST_H

#include "particles.h"

/* A row's `rest`: steps that it has been calm; negative: it sleeps, under the gravity of this code. */
static inline bool ascc_is_asleep(int32_t rest)
{
    return rest < 0;
}

/* Fluid stops and wakes by blocks of this edge, spacings. */
#define ASCC_REST_BLOCK 4.0

static inline double ascc_rest_edge(const ascc_particles *p)
{
    return ASCC_REST_BLOCK * p->spacing;
}

/* How many sleep. */
size_t ascc_rest_count(const ascc_particles *particles);

/* Nothing sleeps or is about to. */
void ascc_rest_end(ascc_particles *particles);

/* Rows of a kind that the host is about to change, or has changed: fluid is awake there and one block
 * around. Without memory for the blocks all wakes. */
void ascc_rest_disturb(ascc_particles *particles, ascc_kind kind, size_t first, size_t count);
/* The same of rows that are marked, one byte each. */
void ascc_rest_disturb_marked(ascc_particles *particles, ascc_kind kind,
                              const unsigned char *marked);

#endif
