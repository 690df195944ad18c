/* Rows for the entries of a neighbour list. SPDX-License-Identifier: MIT */
#include "edges.h"

#define MOST_EDGES ((size_t)INT32_MAX) /* rows are 32-bit numbers everywhere */

ascc_list_key ascc_edges_list(const ascc_plan *plan)
{
    return (ascc_list_key){
        .query = plan->edge_set, .source = plan->edge_set, .radius = plan->edge_radius};
}

typedef struct edges_job {
    const ascc_edges *edges;
    const ascc_rows *rows;
} edges_job;

static size_t count_of(const ascc_rows *rows, size_t row)
{
    return rows->count[row] == ASCC_ROW_ABSENT ? 0 : rows->count[row];
}

static void fill_edges(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const edges_job *job = data;
    const ascc_rows *rows = job->rows;
    for (size_t i = begin; i < end; i++)
        for (size_t k = 0; k < count_of(rows, i); k++) {
            job->edges->sender[job->edges->first[i] + k] = rows->neighbor[rows->start[i] + k];
            job->edges->receiver[job->edges->first[i] + k] = (uint32_t)i;
        }
}

ascc_status ascc_edges_number(ascc_edges *edges, const ascc_rows *rows,
                              const ascc_search_tools *tools)
{
    const size_t points = rows->query->count;
    *edges = (ascc_edges){0};
    edges->first = ascc_arena_take(tools->arena, points, sizeof *edges->first);
    if (!edges->first)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for edges");
    for (size_t i = 0; i < points; i++) {
        edges->first[i] = edges->count;
        edges->count += count_of(rows, i);
    }
    if (edges->count > MOST_EDGES)
        return ascc_fail(tools->message, ASCC_ERROR_LIMIT, "%zu edges; at most %zu", edges->count,
                         MOST_EDGES);
    edges->sender = ascc_arena_take(tools->arena, edges->count, sizeof *edges->sender);
    edges->receiver = ascc_arena_take(tools->arena, edges->count, sizeof *edges->receiver);
    if (!edges->sender || !edges->receiver)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu edges",
                         edges->count);
    edges_job job = {edges, rows};
    ascc_workers_run(tools->workers, points, 4096, fill_edges, &job);
    return ASCC_OK;
}

ascc_status ascc_edges_flags(const ascc_edges *edges, const ascc_search_tools *tools,
                             uint8_t **active)
{
    uint8_t *flags = ascc_arena_take(tools->arena, edges->count, 1);
    if (!flags)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu edges",
                         edges->count);
    for (size_t e = 0; e < edges->count; e++)
        flags[e] = (*active)[edges->receiver[e]];
    *active = flags;
    return ASCC_OK;
}
