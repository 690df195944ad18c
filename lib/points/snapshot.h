/* A snapshot piece by piece, for who does not hold all of it. SPDX-License-Identifier: MIT
 *
 *     head | every field of fields.h, row by row | tail: the bodies | checksum of all before
 */
#ifndef ASCC_SNAPSHOT_H
#define ASCC_SNAPSHOT_H

#include "particles.h"

#define ASCC_SNAPSHOT_MAGIC UINT64_C(0x50414e5343435341) /* the bytes "ASCCSNAP" */
#define ASCC_SNAPSHOT_HEAD 9                             /* words */

/* What a head says. */
typedef struct ascc_snapshot_layout {
    int32_t dimension, past;
    size_t fields;                /* of the list */
    size_t rows[ASCC_KIND_COUNT]; /* of each kind */
    size_t words, tail;           /* of the whole, and of the bodies in it */
} ascc_snapshot_layout;

/* Of untrusted words; `words` is how many there are in all. False: *why says what is wrong. */
bool ascc_snapshot_read_head(const unsigned char *head, uint64_t words,
                             ascc_snapshot_layout *layout, const char **why);
/* The same snapshot with so much fluid. */
void ascc_snapshot_set_fluid(ascc_snapshot_layout *layout, unsigned char *head, size_t fluid);

/* Pieces of the snapshot of a set that has so much fluid, some of it elsewhere. Each returns where it ends. */
unsigned char *ascc_snapshot_put_head(const ascc_particles *particles, size_t fluid,
                                      unsigned char *into);
unsigned char *ascc_snapshot_put_numbers(const ascc_particle_field *field, const void *numbers,
                                         size_t count, unsigned char *into);
unsigned char *ascc_snapshot_put_tail(const ascc_particles *particles, unsigned char *into);
size_t ascc_snapshot_tail_words(const ascc_particles *particles);

#endif
