/* The last layer: pair impulses that cancel to the bit (paper Eq. 2, METHOD section 4).
 * SPDX-License-Identifier: MIT
 *
 * Each unordered pair is evaluated once, rounded to whole quanta once, and added to one side and taken
 * from the other. Integer sums do not depend on order, so neither do they on threads:
 *
 *     rows in cell order   | chunk 0 | chunk 1 | chunk 2 | chunk 3 | ...
 *
 * no neighbour is farther than one chunk away, so chunks 0, 3, 6, ... touch nothing in common, then
 * 1, 4, 7, ..., then 2, 5, 8, ...
 */
#ifndef ASCC_ANTISYMMETRIC_H
#define ASCC_ANTISYMMETRIC_H

#include "network.h"

/* Impulses in quanta, [host's rows][dimension]. */
typedef struct ascc_impulses {
    int64_t *fluid, *wall;
} ascc_impulses;

/* From outputs to quanta. */
typedef struct ascc_impulse_scale {
    const double *mass;     /* of fluid rows, kg */
    double factor[3];       /* quanta per kg and unit of output */
    const double *position; /* of fluid rows, before the step */
} ascc_impulse_scale;

/* The greatest impulse of one pair, quanta. */
#define ASCC_IMPULSE_LIMIT ((double)((int64_t)1 << 50))

/* Fills impulses (cleared by the caller) of an antisymmetric last layer, and counts its pairs.
 * errors: MEMORY, NOT_FINITE, RANGE; the message names the fluid row. */
ascc_status ascc_antisymmetric_impulses(const ascc_network_run *run,
                                        const ascc_impulse_scale *scale,
                                        const ascc_impulses *impulses, uint64_t *pair_count);

/* The same for a plain last layer, which conserves nothing and tells walls nothing. */
ascc_status ascc_plain_impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                                const ascc_impulses *impulses);

#endif
