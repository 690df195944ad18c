/* Rows that sweeps of a relaxation change, where most stay as they are: loose fluid has no pressure.
 * SPDX-License-Identifier: MIT
 *
 * A row's push is 0 unless it or one of its pairs has a pressure, and its divergence is 0 unless it or one of its
 * pairs has a push. Rows that may be neither are marked, once and for all sweeps, so that marks cost in all
 * what a sweep over the marked rows does.
 */
#ifndef ASCC_STEP_ACTIVE_ROWS_H
#define ASCC_STEP_ACTIVE_ROWS_H

#include "base/memory.h"
#include "base/workers.h"
#include "kernels/kernels.h"

typedef struct ascc_active_rows {
    size_t count;
    uint8_t *pushed, *moved; /* [count] 1 = its push, its divergence may be other than 0 */
    uint8_t *told;           /* [count] whose pairs are marked: 1 as pushed, 2 as moved */
    const ascc_gradients *pairs;
    const float *pressure;
} ascc_active_rows;

/* Lends memory; false without. */
bool ascc_active_rows_open(ascc_active_rows *rows, ascc_arena *arena, size_t count);
/* None is marked. */
void ascc_active_rows_clear(ascc_active_rows *rows);
/* Marks what these pressures push. Each row of a pair must have the pair. */
void ascc_active_rows_press(ascc_active_rows *rows, ascc_workers *workers,
                            const ascc_gradients *pairs, const float *pressure);
/* Marks what the pushes change. */
void ascc_active_rows_move(ascc_active_rows *rows, ascc_workers *workers,
                           const ascc_gradients *pairs);

/* The end of the run of rows marked like row i. */
static inline size_t ascc_active_run(const uint8_t *marks, size_t i, size_t end)
{
    size_t k = i + 1;
    while (k < end && marks[k] == marks[i])
        k++;
    return k;
}

#endif
