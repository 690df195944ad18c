/* The way back through an output: each unordered pair once. SPDX-License-Identifier: MIT */
#ifndef ASCC_PAIR_REVERSE_H
#define ASCC_PAIR_REVERSE_H

#include "reverse.h"

/* What pairs read and write, in the order of the output's set. */
typedef struct ascc_pair_reverse {
    const ascc_reverse *pass;
    int32_t set;
    const float *value;    /* [row][padded inputs] */
    float *value_gradient; /* or NULL */
    const double *force;   /* [row][3] gradient of the corrections times units; walls 0 */
    const double *place;   /* [row][3] before the step, or NULL: directions as the network sees */
    const uint8_t *fluid;  /* [row] */
    const void *data;      /* the visitor's own */
} ascc_pair_reverse;

bool ascc_pair_reverse_open(ascc_pair_reverse *pairs, const ascc_reverse *pass);

/* Visits every unordered pair of the output's list, walls with walls left out. r: as the network sees it,
 * m; d: the line along which a pair acts. */
typedef void (*ascc_pair_visitor)(const ascc_pair_reverse *pairs, size_t i, size_t j,
                                  const double r[3], const double d[3]);
void ascc_pair_reverse_run(const ascc_pair_reverse *pairs, ascc_pair_visitor visit);

static inline double ascc_dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

#endif
