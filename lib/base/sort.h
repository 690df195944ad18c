/* Sorts: integer keys on all workers, anything else in place. The result depends on the input alone.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_SORT_H
#define ASCC_SORT_H

#include "workers.h"

/* ---- Any array, in place, by one thread ---- */

/* Sorts as qsort does, element by `before` (true: a must come before b), but with a context and a bound:
 * heap sort, O(count log count) for any input, no recursion, no memory. Elements take at most 16 bytes;
 * equal ones may change order. */
void ascc_heap_sort(void *array, size_t count, size_t size,
                    bool (*before)(const void *context, const void *a, const void *b),
                    const void *context);

/* ---- Integer keys, on all workers ---- */

typedef struct ascc_keys {
    size_t count;
    uint64_t *key;
    uint32_t *row; /* goes where its key goes; or NULL */
} ascc_keys;

/* Keys, with rows if wanted, lent by the arena and not set. */
bool ascc_keys_lend(ascc_keys *keys, ascc_arena *arena, size_t count, bool rows);

/* Sorts by the low `bits` bits, which hold all that is set; equal keys keep their order. Lends more,
 * and keys may lie there afterwards. False without memory. */
bool ascc_keys_sort(ascc_keys *keys, ascc_arena *arena, ascc_workers *workers, int bits);

/* Keys that differ from the one before. */
typedef struct ascc_distinct {
    size_t count;
    uint64_t *key;
    uint32_t *start; /* [count + 1]: where in the keys each begins */
} ascc_distinct;

/* Of sorted keys. room: ascc_arena_take or ascc_arena_lend, where the result is to live. False without
 * memory. */
bool ascc_keys_distinct(const ascc_keys *keys, ascc_arena *arena, ascc_workers *workers,
                        void *(*room)(ascc_arena *, size_t, size_t), ascc_distinct *distinct);

/* Cuts [0, count) for work in two passes, where the second needs what all parts of the first found:
 * parts of this size are at most ASCC_SORT_PARTS. */
#define ASCC_SORT_PARTS 32
size_t ascc_part_size(size_t count);
/* Numbers found by parts become sums of those before; returns the sum of all. */
size_t ascc_part_sums(size_t number[ASCC_SORT_PARTS]);

#endif
