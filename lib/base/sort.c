/* A heap sort of anything; a radix sort of keys from the lowest digit up, each pass in parts: the digits of a part are counted, so each
 * part knows where its keys go. SPDX-License-Identifier: MIT
 *
 *     keys   [ part 0 | part 1 | part 2 ]
 *     to     [ 0 of part 0, 0 of part 1, 0 of part 2 | 1 of part 0, ... ]
 */
#include "sort.h"

#include <string.h>

#define SMALLEST_PART 4096
#define DIGIT_BITS 11 /* at most */

/* ---- In place ---- */

#define LARGEST_ELEMENT 16 /* bytes */

typedef struct heap {
    unsigned char *array;
    size_t size; /* of an element */
    bool (*before)(const void *context, const void *a, const void *b);
    const void *context;
} heap;

static bool is_before(const heap *h, size_t a, size_t b)
{
    return h->before(h->context, h->array + a * h->size, h->array + b * h->size);
}

static void exchange(const heap *h, size_t a, size_t b)
{
    unsigned char kept[LARGEST_ELEMENT];
    memcpy(kept, h->array + a * h->size, h->size);
    memmove(h->array + a * h->size, h->array + b * h->size, h->size);
    memcpy(h->array + b * h->size, kept, h->size);
}

/* Restores the heap order (a parent is not before its children) under `root`. */
static void sift(const heap *h, size_t root, size_t count)
{
    for (size_t child; (child = 2 * root + 1) < count; root = child) {
        if (child + 1 < count && is_before(h, child, child + 1))
            child++;
        if (!is_before(h, root, child))
            return;
        exchange(h, root, child);
    }
}

void ascc_heap_sort(void *array, size_t count, size_t size,
                    bool (*before)(const void *context, const void *a, const void *b),
                    const void *context)
{
    assert(size <= LARGEST_ELEMENT);
    const heap h = {array, size, before, context};
    for (size_t root = count / 2; root-- > 0;)
        sift(&h, root, count);
    for (size_t last = count; last-- > 1;) {
        exchange(&h, 0, last);
        sift(&h, 0, last);
    }
}

/* ---- Keys ---- */

size_t ascc_part_size(size_t count)
{
    return ascc_max_size((count + ASCC_SORT_PARTS - 1) / ASCC_SORT_PARTS, SMALLEST_PART);
}

size_t ascc_part_sums(size_t number[ASCC_SORT_PARTS])
{
    size_t sum = 0;
    for (size_t p = 0; p < ASCC_SORT_PARTS; p++) {
        const size_t before = sum;
        sum += number[p];
        number[p] = before;
    }
    return sum;
}

bool ascc_keys_lend(ascc_keys *keys, ascc_arena *arena, size_t count, bool rows)
{
    if (count >= UINT32_MAX) /* rows and places have 32 bits */
        return false;
    keys->count = count;
    keys->key = ascc_arena_lend(arena, count, sizeof *keys->key);
    keys->row = rows ? ascc_arena_lend(arena, count, sizeof *keys->row) : NULL;
    return keys->key && (!rows || keys->row);
}

typedef struct sort_job {
    ascc_keys from, to;
    size_t part;
    int shift, bits;
    uint32_t *next; /* [parts][digits]: how many, then where the next one goes */
} sort_job;

static void count_digits(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sort_job *job = data;
    const uint64_t mask = ((uint64_t)1 << job->bits) - 1;
    uint32_t *next = job->next + (begin / job->part << job->bits);
    memset(next, 0, sizeof *next << job->bits);
    for (size_t i = begin; i < end; i++)
        next[job->from.key[i] >> job->shift & mask]++;
}

static void place_keys(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sort_job *job = data;
    const uint64_t mask = ((uint64_t)1 << job->bits) - 1;
    uint32_t *next = job->next + (begin / job->part << job->bits);
    for (size_t i = begin; i < end; i++) {
        const uint64_t key = job->from.key[i];
        const uint32_t at = next[key >> job->shift & mask]++;
        job->to.key[at] = key;
        if (job->from.row)
            job->to.row[at] = job->from.row[i];
    }
}

bool ascc_keys_sort(ascc_keys *keys, ascc_arena *arena, ascc_workers *workers, int bits)
{
    const int passes = (bits + DIGIT_BITS - 1) / DIGIT_BITS;
    if (!passes || keys->count < 2)
        return true;
    sort_job job = {.from = *keys, .part = ascc_part_size(keys->count)};
    job.bits = (bits + passes - 1) / passes;
    const size_t parts = (keys->count + job.part - 1) / job.part;
    job.next = ascc_arena_lend(arena, parts << job.bits, sizeof *job.next);
    if (!job.next || !ascc_keys_lend(&job.to, arena, keys->count, keys->row != NULL))
        return false;
    for (int pass = 0; pass < passes; pass++) {
        job.shift = pass * job.bits;
        ascc_workers_run(workers, keys->count, job.part, count_digits, &job);
        uint32_t sum = 0;
        for (size_t d = 0; d < (size_t)1 << job.bits; d++)
            for (size_t p = 0; p < parts; p++) {
                const uint32_t n = job.next[(p << job.bits) + d];
                job.next[(p << job.bits) + d] = sum;
                sum += n;
            }
        ascc_workers_run(workers, keys->count, job.part, place_keys, &job);
        const ascc_keys swap = job.from;
        job.from = job.to;
        job.to = swap;
    }
    *keys = job.from;
    return true;
}

/* ---- Without repeats ---- */

typedef struct distinct_job {
    const ascc_keys *keys;
    const ascc_distinct *distinct;
    size_t part;
    size_t first[ASCC_SORT_PARTS]; /* how many, then the number of the first */
} distinct_job;

static bool is_new(const ascc_keys *keys, size_t i)
{
    return i == 0 || keys->key[i] != keys->key[i - 1];
}

static void count_new(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    distinct_job *job = data;
    size_t count = 0;
    for (size_t i = begin; i < end; i++)
        count += is_new(job->keys, i);
    job->first[begin / job->part] = count;
}

static void copy_new(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const distinct_job *job = data;
    size_t next = job->first[begin / job->part];
    for (size_t i = begin; i < end; i++)
        if (is_new(job->keys, i)) {
            job->distinct->key[next] = job->keys->key[i];
            job->distinct->start[next++] = (uint32_t)i;
        }
}

bool ascc_keys_distinct(const ascc_keys *keys, ascc_arena *arena, ascc_workers *workers,
                        void *(*room)(ascc_arena *, size_t, size_t), ascc_distinct *distinct)
{
    distinct_job job = {.keys = keys, .distinct = distinct, .part = ascc_part_size(keys->count)};
    ascc_workers_run(workers, keys->count, job.part, count_new, &job);
    distinct->count = ascc_part_sums(job.first);
    distinct->key = room(arena, distinct->count, sizeof *distinct->key);
    distinct->start = room(arena, distinct->count + 1, sizeof *distinct->start);
    if (!distinct->key || !distinct->start)
        return false;
    ascc_workers_run(workers, keys->count, job.part, copy_new, &job);
    distinct->start[distinct->count] = (uint32_t)keys->count;
    return true;
}
