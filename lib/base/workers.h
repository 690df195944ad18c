/* Runs a function over [0, count) in blocks fixed by index, on all workers of a context.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_WORKERS_H
#define ASCC_WORKERS_H

#include <stdatomic.h>

#include "memory.h"

typedef struct ascc_workers ascc_workers;

/* Called for blocks [begin, end); slot < ascc_workers_count says which scratch is free to use.
 * Which worker gets a block is left to chance, so no result may depend on slot. */
typedef void (*ascc_range_function)(void *data, size_t begin, size_t end, int32_t slot);

/* thread_count >= 1; enqueue and finish both NULL: own threads. */
ascc_status ascc_workers_create(const ascc_allocator *allocator, int32_t thread_count,
                                void *(*enqueue)(void *, ascc_task, void *, int32_t),
                                void (*finish)(void *, void *), void *user, ascc_workers **workers);
void ascc_workers_destroy(ascc_workers **workers);

int32_t ascc_workers_count(const ascc_workers *workers);

/* Cuts [0, count) into blocks of `block` (the last may be shorter), calls the function once for
 * each and returns when all are done. The caller works too. Several threads may call at once: one
 * of them gets the pool, the others do their blocks alone, each with slot 0: what a slot stands for
 * belongs to one call. */
void ascc_workers_run(ascc_workers *workers, size_t count, size_t block,
                      ascc_range_function function, void *data);

/* Blocks tell which element failed: *first is 0, or 1 + the smallest index noted, whatever the order. */
static inline void ascc_note_first(atomic_size_t *first, size_t index)
{
    size_t seen = atomic_load_explicit(first, memory_order_relaxed);
    while ((seen == 0 || seen > index + 1) &&
           !atomic_compare_exchange_weak_explicit(first, &seen, index + 1, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
}

#endif
