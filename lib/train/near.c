/* Who is near whom among the particles of a loss. SPDX-License-Identifier: MIT */
#include "near.h"

#include <string.h>

static ascc_status fill(ascc_points *points, const ascc_search_tools *tools,
                        const ascc_scale *scale, int32_t dimension, const double *position,
                        size_t count)
{
    const size_t d = (size_t)dimension;
    if (!ascc_points_take(points, tools->arena, count))
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < count; i++) {
        int64_t at[3] = {0};
        for (size_t c = 0; c < d; c++)
            if (!ascc_scale_apply(scale, position[i * d + c], &at[c]))
                return ASCC_ERROR_RANGE;
        ascc_points_set(points, i, at);
    }
    return ASCC_OK;
}

ascc_status ascc_near_find(ascc_near *near, const ascc_search_tools *tools, int32_t dimension,
                           double radius, const double *query, size_t query_count,
                           const double *source, size_t source_count)
{
    const ascc_scale scale = ascc_scale_for_radius(radius);
    const int sets = source ? 2 : 1;
    ascc_extent extent;
    ascc_extent_start(&extent);
    memset(near, 0, sizeof *near);
    ascc_status status = fill(&near->points[0], tools, &scale, dimension, query, query_count);
    if (status == ASCC_OK && source)
        status = fill(&near->points[1], tools, &scale, dimension, source, source_count);
    for (int s = 0; s < sets && status == ASCC_OK; s++)
        ascc_extent_add(&extent, &near->points[s]);
    const double units = radius * scale.inverse;
    for (int s = 0; s < sets && status == ASCC_OK; s++)
        status = ascc_grid_build(&near->grid[s], tools, &near->points[s], &extent, units, false);
    near->rows = (ascc_rows){.query = &near->points[0],
                             .source = &near->points[sets - 1],
                             .query_grid = &near->grid[0],
                             .source_grid = &near->grid[sets - 1],
                             .radius = units,
                             .same = !source,
                             .max_neighbors = 1 << 20};
    if (status == ASCC_OK)
        status = ascc_rows_open(&near->rows, tools, query_count * 36);
    if (status == ASCC_OK)
        status = ascc_rows_make(&near->rows, tools, NULL);
    return status;
}
