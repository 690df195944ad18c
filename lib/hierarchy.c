/* Builds the point sets of one step: sorts level 0, samples the coarser levels.
 * SPDX-License-Identifier: MIT */
#include "hierarchy.h"

#include <math.h>
#include <string.h>

#include "resample.h"

void ascc_plan_radii(const ascc_plan *plan, double *smallest, double *largest)
{
    *smallest = INFINITY;
    *largest = 0.0;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const bool last = t == plan->term_count;
        if (last ? plan->output.kind != ASCC_OUTPUT_ANTISYMMETRIC
                 : !ascc_term_searches(&plan->term[t]))
            continue;
        const double radius = last ? plan->output.filter.radius : plan->term[t].filter.radius;
        *smallest = radius < *smallest ? radius : *smallest;
        *largest = radius > *largest ? radius : *largest;
    }
    *largest = fmax(*largest, plan->output.walls.filter.radius);
    if (*largest == 0.0) /* a network of dense layers: any scale will do */
        *smallest = *largest = plan->spacing > 0.0 ? plan->spacing : 1.0;
}

/* Which boundary particles the network sees: those within the crop of the fluid's bounding box. */
static size_t keep_boundary(uint32_t *kept, const ascc_plan *plan, const ascc_scene *scene)
{
    const size_t d = (size_t)plan->dimension;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (size_t i = 0; i < scene->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            low[c] = fmin(low[c], scene->fluid[i * d + c]);
            high[c] = fmax(high[c], scene->fluid[i * d + c]);
        }
    size_t count = 0;
    for (size_t i = 0; i < scene->boundary_count; i++) {
        bool inside = true;
        for (size_t c = 0; plan->boundary_crop > 0.0 && c < d; c++) {
            const double x = scene->boundary[i * d + c];
            inside &= x >= low[c] - plan->boundary_crop && x <= high[c] + plan->boundary_crop;
        }
        if (inside)
            kept[count++] = (uint32_t)i;
    }
    return count;
}

static ascc_status too_far(const ascc_search_tools *tools, const char *kind, size_t row)
{
    return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                     "%s row %zu is too far from the origin for this model's radius", kind, row);
}

/* Integer positions of fluid, then kept boundary, in the host's order. */
static ascc_status convert(ascc_points *points, const ascc_hierarchy *hierarchy,
                           const ascc_search_tools *tools, int32_t dimension,
                           const ascc_scene *scene, const uint32_t *kept)
{
    const size_t d = (size_t)dimension;
    for (size_t i = 0; i < points->count; i++) {
        const bool fluid = i < scene->fluid_count;
        const size_t row = fluid ? i : kept[i - scene->fluid_count];
        const double *x = (fluid ? scene->fluid : scene->boundary) + row * d;
        int64_t at[3] = {0};
        for (size_t c = 0; c < d; c++)
            if (!ascc_scale_apply(&hierarchy->scale, x[c], &at[c]))
                return too_far(tools, fluid ? "fluid" : "boundary", row);
        ascc_points_set(points, i, at);
    }
    return ASCC_OK;
}

/* Splits the sorted whole into its two parts and links the rows. */
static bool split(ascc_hierarchy *h, ascc_arena *arena, size_t kept_count)
{
    const ascc_points *all = &h->set[ASCC_SET_ALL];
    const size_t counts[2] = {h->fluid_count, kept_count};
    h->part = ascc_arena_take(arena, all->count, sizeof *h->part);
    if (!h->part)
        return false;
    for (int s = 0; s < 2; s++) {
        h->whole[s] = ascc_arena_take(arena, counts[s], sizeof *h->whole[s]);
        if (!h->whole[s] || !ascc_points_take(&h->set[s], arena, counts[s]))
            return false;
    }
    size_t next[2] = {0, 0};
    for (size_t i = 0; i < all->count; i++) {
        const int s = h->origin[i] < h->fluid_count ? ASCC_SET_FLUID : ASCC_SET_BOUNDARY;
        const int64_t at[3] = {all->position[0][i], all->position[1][i], all->position[2][i]};
        h->part[i] = (uint32_t)next[s];
        h->whole[s][next[s]] = (uint32_t)i;
        ascc_points_set(&h->set[s], next[s]++, at);
    }
    return true;
}

static ascc_status build_level_zero(ascc_hierarchy *h, const ascc_search_tools *tools,
                                    const ascc_plan *plan, const ascc_scene *scene)
{
    ascc_arena *arena = tools->arena;
    ascc_points raw;
    ascc_extent extent;
    uint32_t *kept = ascc_arena_take(arena, scene->boundary_count, sizeof *kept);
    if (!kept)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the boundary");
    const size_t kept_count = keep_boundary(kept, plan, scene);
    const size_t count = scene->fluid_count + kept_count;
    uint32_t *order = ascc_arena_take(arena, count, sizeof *order);
    h->origin = ascc_arena_take(arena, count, sizeof *h->origin);
    if (!order || !h->origin || !ascc_points_take(&raw, arena, count) ||
        !ascc_points_take(&h->set[ASCC_SET_ALL], arena, count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu points", count);

    ascc_status status = convert(&raw, h, tools, plan->dimension, scene, kept);
    if (status != ASCC_OK)
        return status;
    ascc_extent_start(&extent);
    ascc_extent_add(&extent, &raw);
    status = ascc_points_order(tools, &raw, &extent, ascc_grid_cell(h->base_radius), order);
    if (status != ASCC_OK)
        return status;
    for (size_t i = 0; i < count; i++) {
        const size_t row = order[i];
        const int64_t at[3] = {raw.position[0][row], raw.position[1][row], raw.position[2][row]};
        ascc_points_set(&h->set[ASCC_SET_ALL], i, at);
        h->origin[i] = row < scene->fluid_count
                           ? (uint32_t)row
                           : (uint32_t)scene->fluid_count + kept[row - scene->fluid_count];
    }
    if (!split(h, arena, kept_count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu points", count);
    return ASCC_OK;
}

static ascc_status build_level(ascc_hierarchy *h, const ascc_search_tools *tools,
                               const ascc_plan *plan, int level)
{
    const ascc_points *all = &h->set[ASCC_SET_ALL];
    ascc_points *samples = &h->set[ASCC_SET_LEVEL + level - 1];
    const double voxel = plan->level[level].voxel * h->scale.inverse;
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return ascc_sample_farthest(samples, tools, all,
                                    (size_t)ceil(plan->level[level].ratio * (double)all->count));
    if (plan->sampling == ASCC_SAMPLING_CENTERS)
        return ascc_sample_centers(samples, tools, all, plan->dimension, voxel);
    double anchor[3] = {0.0, 0.0, 0.0};
    if (plan->centroid_anchor)
        ascc_centroid(all, anchor);
    return ascc_sample_corners(samples, tools, all, plan->dimension, voxel, plan->hysteresis,
                               anchor);
}

ascc_status ascc_hierarchy_build(ascc_hierarchy *h, const ascc_search_tools *tools,
                                 const ascc_plan *plan, const ascc_scene *scene)
{
    memset(h, 0, sizeof *h);
    double smallest, largest;
    ascc_plan_radii(plan, &smallest, &largest);
    h->scale = ascc_scale_for_radius(largest);
    h->base_radius = smallest * h->scale.inverse;
    h->fluid_count = scene->fluid_count;
    if (scene->fluid_count + scene->boundary_count >= UINT32_MAX)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "more than 2^32 particles");
    ascc_status status = build_level_zero(h, tools, plan, scene);
    for (int level = 1; status == ASCC_OK && level < plan->level_count; level++)
        status = build_level(h, tools, plan, level);
    if (status != ASCC_OK)
        return status;
    ascc_extent_start(&h->extent);
    for (int s = ASCC_SET_ALL; s < ASCC_SET_LEVEL + plan->level_count - 1; s++)
        ascc_extent_add(&h->extent, &h->set[s]);
    return ASCC_OK;
}

ascc_status ascc_hierarchy_grid(ascc_hierarchy *h, const ascc_search_tools *tools, int set,
                                double radius, const ascc_grid **grid)
{
    for (int g = 0; g < h->grid_count; g++)
        if (h->grid[g].set == set && h->grid[g].radius == radius) {
            *grid = &h->grid[g].grid;
            return ASCC_OK;
        }
    if (h->grid_count == ASCC_MAX_GRIDS)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE, "the model uses too many radii");
    const bool sorted = set <= ASCC_SET_ALL && radius == h->base_radius;
    ascc_grid *made = &h->grid[h->grid_count].grid;
    const ascc_status status =
        ascc_grid_build(made, tools, &h->set[set], &h->extent, radius, sorted);
    if (status != ASCC_OK)
        return status;
    h->grid[h->grid_count].set = set;
    h->grid[h->grid_count].radius = radius;
    h->grid_count++;
    *grid = made;
    return ASCC_OK;
}
