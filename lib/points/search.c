/* Positions to integers, cells, neighbour lists: all at once. SPDX-License-Identifier: MIT */
#include "search.h"

#include <math.h>
#include <string.h>

static ascc_status too_far(const ascc_search_tools *tools, const ascc_positions *from, size_t row,
                           double x)
{
    return ascc_fail(tools->message, ASCC_ERROR_RANGE, "%s %zu is %s",
                     from->name ? from->name : "point", row,
                     isfinite(x) ? "too far from the origin" : "not finite");
}

static ascc_status convert(ascc_points *points, const ascc_search_tools *tools,
                           const ascc_scale *scale, int32_t dimension, const ascc_positions *from)
{
    const size_t d = (size_t)dimension;
    if (!ascc_points_take(points, tools->arena, from->count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory to search %zu points",
                         from->count);
    for (size_t i = 0; i < from->count; i++) {
        int64_t at[3] = {0};
        for (size_t c = 0; c < d; c++)
            if (!ascc_scale_apply(scale, from->at[i * d + c], &at[c]))
                return too_far(tools, from, i, from->at[i * d + c]);
        ascc_points_set(points, i, at);
    }
    return ASCC_OK;
}

ascc_status ascc_search_run(ascc_search *search, const ascc_search_tools *tools,
                            const ascc_search_options *o)
{
    memset(search, 0, sizeof *search);
    const ascc_scale scale = ascc_scale_for_radius(o->radius);
    const double radius = o->radius * scale.inverse;
    const ascc_positions *from[2] = {&o->query, &o->source};
    const int sets = o->source.at ? 2 : 1;
    ascc_extent extent;
    ascc_extent_start(&extent);
    ascc_status status = ASCC_OK;
    for (int s = 0; s < sets && status == ASCC_OK; s++) {
        status = convert(&search->points[s], tools, &scale, o->dimension, from[s]);
        if (status == ASCC_OK)
            ascc_extent_add(&extent, &search->points[s]);
    }
    for (int s = 0; s < sets && status == ASCC_OK; s++)
        status =
            ascc_grid_build(&search->grid[s], tools, &search->points[s], &extent, radius, false);
    search->rows = (ascc_rows){.query = &search->points[0],
                               .source = &search->points[sets - 1],
                               .query_grid = &search->grid[0],
                               .source_grid = &search->grid[sets - 1],
                               .radius = radius,
                               .same = sets == 1,
                               .skip_self = o->skip_self,
                               .max_neighbors = o->max_neighbors ? o->max_neighbors : 1 << 20};
    if (status == ASCC_OK)
        status =
            ascc_rows_open(&search->rows, tools, o->expected ? o->expected : o->query.count * 36);
    return status == ASCC_OK ? ascc_rows_make(&search->rows, tools, o->wanted) : status;
}
