/* The order in which rows are computed that ghosts are copies of. SPDX-License-Identifier: MIT */
#include "early_rows.h"

#define MOST 256 /* rows of a range */
#define GAP 8    /* rows between two early ones that go with them */
#define RANGES 4 /* of a block of work */
#define SLICES                                                                                     \
    4 /* of what is computed while messages travel: between two of them MPI is given a turn */

/* ---- Order ---- */

/* Marks the rows that are sent, and the few between two of them. */
static void mark_early(const ascc_hierarchy *h, int32_t set, uint8_t *early, size_t count)
{
    const uint32_t *sent;
    const size_t rows = h->halo->sent(h->halo, set, &sent);
    size_t next = SIZE_MAX; /* the first after the last one */
    memset(early, 0, count);
    for (size_t k = 0; k < rows; k++)
        early[set == ASCC_SET_FLUID ? h->halo_row[sent[k]] : sent[k]] = 1;
    for (size_t i = 0; i < count; i++) {
        if (!early[i])
            continue;
        if (next != SIZE_MAX && i - next <= GAP)
            memset(early + next, 1, i - next);
        next = i + 1;
    }
}

/* Ranges of rows with this mark; how many. */
static size_t cut_ranges(const uint8_t *mark, size_t count, uint8_t value, ascc_row_range *range)
{
    size_t found = 0;
    for (size_t i = 0, end; i < count; i = end) {
        for (end = i + 1; end < count && mark[end] == mark[i] && end - i < MOST;)
            end++;
        if (mark[i] != value)
            continue;
        if (range)
            range[found] = (ascc_row_range){(uint32_t)i, (uint32_t)end};
        found++;
    }
    return found;
}

ascc_status ascc_early_rows_find(ascc_hierarchy *h, const ascc_search_tools *tools, int32_t set)
{
    const size_t count = h->set[set].count;
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    ascc_row_order *order = &h->order[ascc_set_level(set)];
    uint8_t *early = ascc_arena_lend(tools->arena, count, 1);
    if (early) {
        mark_early(h, set, early, count);
        order->early = cut_ranges(early, count, 1, NULL);
        order->count = order->early + cut_ranges(early, count, 0, NULL);
        order->range = ascc_arena_take(tools->arena, order->count, sizeof *order->range);
    }
    if (!early || !order->range)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the order of %zu rows",
                         count);
    (void)cut_ranges(early, count, 1, order->range);
    (void)cut_ranges(early, count, 0, order->range + order->early);
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}

/* ---- Work ---- */

typedef struct slice {
    ascc_range_function function;
    void *data;
    size_t first; /* of the list */
} slice;

static void run_slice(void *data, size_t begin, size_t end, int32_t slot)
{
    const slice *part = data;
    part->function(part->data, part->first + begin, part->first + end, slot);
}

ascc_status ascc_early_list_run(const ascc_hierarchy *h, const ascc_search_tools *tools,
                                size_t early, size_t count, size_t block,
                                ascc_range_function function, void *data,
                                const ascc_halo_refresh *refresh)
{
    ascc_halo *halo = h->halo;
    slice part = {function, data, 0};
    if (!halo || !refresh) {
        ascc_workers_run(tools->workers, count, block, function, data);
        return ASCC_OK;
    }
    ascc_workers_run(tools->workers, early, block, function, data);
    const ascc_status status = halo->send(halo, refresh, ascc_hierarchy_halo_rows(h, refresh));
    if (status != ASCC_OK)
        return status;
    for (size_t s = 0, end; s < SLICES; s++) {
        part.first = early + (count - early) / block * s / SLICES * block;
        end = s + 1 < SLICES ? early + (count - early) / block * (s + 1) / SLICES * block : count;
        ascc_workers_run(tools->workers, end - part.first, block, run_slice, &part);
        halo->poll(halo);
    }
    halo->receive(halo);
    return ASCC_OK;
}

typedef struct range_job {
    ascc_range_function function;
    void *data;
    const ascc_row_range *range;
} range_job;

static void run_ranges(void *data, size_t begin, size_t end, int32_t slot)
{
    const range_job *job = data;
    for (size_t k = begin; k < end; k++)
        job->function(job->data, job->range[k].begin, job->range[k].end, slot);
}

ascc_status ascc_early_rows_run(const ascc_hierarchy *h, const ascc_search_tools *tools,
                                size_t block, ascc_range_function function, void *data,
                                const ascc_halo_refresh *refresh)
{
    const int32_t set = refresh->set;
    if (!h->halo) {
        ascc_workers_run(tools->workers, h->set[set].count, block, function, data);
        return ASCC_OK;
    }
    const ascc_row_order *order = &h->order[ascc_set_level(set)];
    range_job job = {function, data, order->range};
    return ascc_early_list_run(h, tools, order->early, order->count, RANGES, run_ranges, &job,
                               refresh);
}
