/* Builds the point sets of one step: sorts level 0, samples the coarser levels.
 * SPDX-License-Identifier: MIT */
#include "early_rows.h"

#include <math.h>
#include <string.h>

#include "points/resample.h"
#include "sheets.h"

_Static_assert(ASCC_MAX_LEVELS < ASCC_EXTENT_SETS,
               "an extent takes fluid, walls and all coarser levels");

/* Which boundary particles the network sees: those within the crop of the fluid's bounding box. */
static size_t keep_boundary(uint32_t *kept, const ascc_plan *plan, const ascc_scene *scene)
{
    const size_t d = (size_t)plan->dimension;
    double low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    const bool crops = plan->boundary_crop > 0.0;
    for (size_t i = 0; crops && scene->boundary_count && i < scene->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            const double x = scene->fluid[i * d + c];
            low[c] = x < low[c] ? x : low[c];
            high[c] = x > high[c] ? x : high[c];
        }
    size_t count = 0;
    for (size_t i = 0; i < scene->boundary_count; i++) {
        bool inside = !scene->near || scene->near[i];
        for (size_t c = 0; crops && c < d; c++) {
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

typedef struct sort_in {
    ascc_hierarchy *hierarchy;
    const ascc_scene *scene;
    int32_t dimension;
    size_t fluid_count;    /* rows that are looked at */
    const uint32_t *kept;  /* boundary rows */
    const uint32_t *order; /* rows of raw in the order of the set */
    ascc_points raw;       /* fluid, then kept boundary, in the host's order; no low words */
    size_t part;
    size_t first[ASCC_SORT_PARTS]; /* fluid points of a part of the set, then of those before it */
    atomic_size_t too_far;         /* 1 + smallest row of raw */
} sort_in;

/* The host's row of a row of raw: of fluid, or fluid_count + of boundary. */
static size_t host_row(const sort_in *job, size_t row)
{
    const ascc_scene *scene = job->scene;
    if (row < job->fluid_count)
        return scene->row ? scene->row[row] : row;
    return scene->fluid_count + job->kept[row - job->fluid_count];
}

static const double *place_of(const sort_in *job, size_t row)
{
    const ascc_scene *scene = job->scene;
    const size_t d = (size_t)job->dimension, host = host_row(job, row);
    return host < scene->fluid_count ? scene->fluid + host * d
                                     : scene->boundary + (host - scene->fluid_count) * d;
}

static void convert(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    sort_in *job = data;
    const size_t d = (size_t)job->dimension;
    for (size_t i = begin; i < end; i++) {
        const double *x = place_of(job, i);
        bool good = true;
        for (size_t c = 0; c < 3; c++) {
            job->raw.position[c][i] = 0;
            good = good && (c >= d || ascc_scale_apply(&job->hierarchy->scale, x[c],
                                                       &job->raw.position[c][i]));
        }
        if (!good)
            ascc_note_first(&job->too_far, i);
    }
}

/* Points in the order of the set, the host's rows, and how many are fluid. */
static void gather(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    sort_in *job = data;
    ascc_hierarchy *h = job->hierarchy;
    size_t fluid = 0;
    for (size_t i = begin; i < end; i++) {
        const size_t row = job->order[i];
        const int64_t at[3] = {job->raw.position[0][row], job->raw.position[1][row],
                               job->raw.position[2][row]};
        ascc_points_set(&h->set[ASCC_SET_ALL], i, at);
        h->origin[i] = (uint32_t)host_row(job, row);
        fluid += row < job->fluid_count;
    }
    job->first[begin / job->part] = fluid;
}

/* a before b, or 0 where a row of numbers is the same. */
static int compare_rows(const double *from, size_t width, size_t a, size_t b)
{
    for (size_t c = 0; from && c < width; c++)
        if (from[a * width + c] != from[b * width + c])
            return from[a * width + c] < from[b * width + c] ? -1 : 1;
    return 0;
}

/* The order of two of the host's rows at one place: fluid first, then by all that is known of them. */
static bool comes_first(const sort_in *job, uint32_t a, uint32_t b)
{
    const ascc_scene *scene = job->scene;
    const size_t d = (size_t)job->dimension, fluid = scene->fluid_count;
    if ((a < fluid) != (b < fluid))
        return a < fluid;
    int order = 0;
    if (a < fluid) {
        order = compare_rows(scene->fluid, d, a, b);
        order = order ? order : compare_rows(scene->velocity, d, a, b);
        order = order ? order : compare_rows(scene->mass, 1, a, b);
        if (!order && scene->id)
            return scene->id[a] < scene->id[b];
    } else {
        order = compare_rows(scene->boundary, d, a - fluid, b - fluid);
        order = order ? order : compare_rows(scene->normal, d, a - fluid, b - fluid);
        order = order ? order : compare_rows(scene->wall_velocity, d, a - fluid, b - fluid);
    }
    return order ? order < 0 : a < b;
}

static bool at_one_place(const ascc_points *p, size_t a, size_t b)
{
    return p->position[0][a] == p->position[0][b] && p->position[1][a] == p->position[1][b] &&
           p->position[2][a] == p->position[2][b];
}

/* Points at one place that begin in [begin, end), in an order that is not the host's. */
static void break_ties(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sort_in *job = data;
    const ascc_points *all = &job->hierarchy->set[ASCC_SET_ALL];
    uint32_t *origin = job->hierarchy->origin;
    for (size_t i = begin; i < end; i++) {
        if (i > 0 && at_one_place(all, i - 1, i))
            continue; /* of a place that began earlier */
        for (size_t n = i + 1; n < all->count && at_one_place(all, i, n); n++) {
            const uint32_t moved = origin[n];
            size_t j = n;
            for (; j > i && comes_first(job, moved, origin[j - 1]); j--)
                origin[j] = origin[j - 1];
            origin[j] = moved;
        }
    }
}

/* Splits the whole into its two parts and links the rows. */
static void split(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sort_in *job = data;
    ascc_hierarchy *h = job->hierarchy;
    const ascc_points *all = &h->set[ASCC_SET_ALL];
    size_t next[2];
    next[ASCC_SET_FLUID] = job->first[begin / job->part];
    next[ASCC_SET_BOUNDARY] = begin - next[ASCC_SET_FLUID];
    for (size_t i = begin; i < end; i++) {
        const int s = h->origin[i] < h->fluid_count ? ASCC_SET_FLUID : ASCC_SET_BOUNDARY;
        const int64_t at[3] = {all->position[0][i], all->position[1][i], all->position[2][i]};
        h->part[i] = (uint32_t)next[s];
        h->whole[s][next[s]] = (uint32_t)i;
        for (size_t c = 0; c < 4; c++)
            h->place[s][next[s] * 4 + c] = c < 3 ? (int32_t)(uint32_t)(uint64_t)at[c] : 0;
        ascc_points_set(&h->set[s], next[s]++, at);
    }
}

bool ascc_hierarchy_reads_whole(const ascc_plan *plan)
{
    bool reads = (plan->level_count > 1 && !plan->fluid_sampled) || plan->edge_set == ASCC_SET_ALL;
    for (int32_t l = 0; l < plan->layer_count; l++)
        reads |= plan->layer[l].set == ASCC_SET_ALL;
    return reads;
}

/* Room for the sets of level 0 and the links between their rows. */
static bool take_sets(ascc_hierarchy *h, ascc_arena *arena, const ascc_plan *plan,
                      size_t fluid_count, size_t boundary_count)
{
    const size_t count = fluid_count + boundary_count;
    h->origin = ascc_arena_take(arena, count, sizeof *h->origin);
    h->part = ascc_arena_take(arena, count, sizeof *h->part);
    h->whole[0] = ascc_arena_take(arena, fluid_count, sizeof(uint32_t));
    h->whole[1] = ascc_arena_take(arena, boundary_count, sizeof(uint32_t));
    h->place[0] = ascc_arena_take(arena, fluid_count, 4 * sizeof(int32_t));
    h->place[1] = ascc_arena_take(arena, boundary_count, 4 * sizeof(int32_t));
    return h->origin && h->part && h->whole[0] && h->whole[1] && h->place[0] && h->place[1] &&
           ascc_points_room(&h->set[ASCC_SET_ALL], arena, count,
                            ascc_hierarchy_reads_whole(plan) ? ascc_arena_take : ascc_arena_lend) &&
           ascc_points_take(&h->set[ASCC_SET_FLUID], arena, fluid_count) &&
           ascc_points_take(&h->set[ASCC_SET_BOUNDARY], arena, boundary_count);
}

static bool lend_raw(ascc_points *raw, ascc_arena *arena, size_t count)
{
    raw->count = count;
    for (int c = 0; c < 3; c++)
        raw->position[c] = ascc_arena_lend(arena, count, sizeof(int64_t));
    return raw->position[0] && raw->position[1] && raw->position[2];
}

static ascc_status build_level_zero(ascc_hierarchy *h, const ascc_search_tools *tools,
                                    const ascc_plan *plan, const ascc_scene *scene)
{
    ascc_arena *arena = tools->arena;
    const ascc_arena_mark mark = ascc_arena_mark_of(arena);
    uint32_t *kept = ascc_arena_lend(arena, scene->boundary_count, sizeof *kept);
    if (!kept)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the boundary");
    const size_t kept_count = keep_boundary(kept, plan, scene);
    const size_t fluid = scene->row ? scene->row_count : scene->fluid_count;
    const size_t count = fluid + kept_count;
    uint32_t *order = ascc_arena_lend(arena, count, sizeof *order);
    sort_in job = {
        .hierarchy = h, .scene = scene, .dimension = plan->dimension, .fluid_count = fluid};
    job.kept = kept;
    job.order = order;
    job.part = ascc_part_size(count);
    if (!order || !lend_raw(&job.raw, arena, count) ||
        !take_sets(h, arena, plan, fluid, kept_count))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu points", count);

    ascc_workers_run(tools->workers, count, 4096, convert, &job);
    const size_t bad = atomic_load(&job.too_far);
    if (bad)
        return bad <= fluid ? too_far(tools, "fluid", host_row(&job, bad - 1))
                            : too_far(tools, "boundary", kept[bad - 1 - fluid]);
    h->extent = ascc_extent_of(&job.raw, tools->workers);
    const ascc_status status =
        ascc_points_order(tools, &job.raw, &h->extent, ascc_grid_cell(h->base_radius), order);
    if (status != ASCC_OK)
        return status;
    ascc_workers_run(tools->workers, count, job.part, gather, &job);
    (void)ascc_part_sums(job.first);
    ascc_workers_run(tools->workers, count, 4096, break_ties, &job);
    ascc_workers_run(tools->workers, count, job.part, split, &job);
    h->extent.set[0] = &h->set[ASCC_SET_FLUID]; /* the same points, where they stay */
    h->extent.set[h->extent.set_count++] = &h->set[ASCC_SET_BOUNDARY];
    ascc_arena_return(arena, mark);
    if (!ascc_hierarchy_reads_whole(plan))
        h->set[ASCC_SET_ALL] = (ascc_points){.count = count};
    return ASCC_OK;
}

/* How walls move, in the order of their set. */
static ascc_status find_drift(ascc_hierarchy *h, const ascc_search_tools *tools,
                              const ascc_plan *plan, const ascc_scene *scene)
{
    const size_t count = h->set[ASCC_SET_BOUNDARY].count, d = (size_t)plan->dimension;
    if (!scene->wall_velocity)
        return ASCC_OK;
    h->drift = ascc_arena_take(tools->arena, count, 4 * sizeof *h->drift);
    if (!h->drift)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 4; c++)
            h->drift[i * 4 + c] =
                c < d ? (float)(scene->wall_velocity[ascc_hierarchy_wall_row(h, i) * d + c] *
                                scene->motion)
                      : 0.0f;
    return ASCC_OK;
}

/* The points of a set without ghosts. */
static bool lend_own(ascc_points *own, const ascc_hierarchy *h, const ascc_search_tools *tools,
                     const ascc_points *all)
{
    const int32_t set = (int32_t)(all - h->set);
    const bool room = ascc_points_take(own, tools->arena, all->count);
    own->count = 0;
    for (size_t i = 0; room && i < all->count; i++) {
        const size_t row = ascc_hierarchy_host_row(h, set, i);
        const int64_t at[3] = {all->position[0][i], all->position[1][i], all->position[2][i]};
        if (row >= h->fluid_count || !h->halo->ghost[row])
            ascc_points_set(own, own->count++, at);
    }
    return room;
}

/* Where each row of the host's fluid is in its set. */
static ascc_status find_halo_rows(ascc_hierarchy *h, const ascc_search_tools *tools)
{
    const size_t count = h->set[ASCC_SET_FLUID].count;
    if (!h->halo)
        return ASCC_OK;
    h->halo_row = ascc_arena_take(tools->arena, count, sizeof *h->halo_row);
    if (!h->halo_row)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu rows", count);
    for (size_t i = 0; i < count; i++)
        h->halo_row[ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i)] = (uint32_t)i;
    return ascc_early_rows_find(h, tools, ASCC_SET_FLUID);
}

/* Fluid, and what stands for the rest of it. */
static bool lend_with_far(ascc_points *both, const ascc_search_tools *tools,
                          const ascc_points *fluid, const ascc_points *far)
{
    both->count = fluid->count + far->count;
    for (int c = 0; c < 3; c++) {
        both->low[c] = NULL;
        both->position[c] = ascc_arena_lend(tools->arena, both->count, sizeof(int64_t));
        if (!both->position[c])
            return false;
        memcpy(both->position[c], fluid->position[c], fluid->count * sizeof(int64_t));
        memcpy(both->position[c] + fluid->count, far->position[c], far->count * sizeof(int64_t));
    }
    return true;
}

/* all: what the level is sampled from. */
static ascc_status build_level(ascc_hierarchy *h, const ascc_search_tools *tools,
                               const ascc_plan *plan, const ascc_points *all, int level)
{
    ascc_points *samples = &h->set[ASCC_SET_LEVEL + level - 1];
    const double voxel = plan->level[level].voxel * h->scale.inverse;
    ascc_points own;
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return ascc_sample_farthest(samples, tools, all,
                                    (size_t)ceil(plan->level[level].ratio * (double)all->count));
    if (plan->sampling == ASCC_SAMPLING_CENTERS)
        return ascc_sample_centers(samples, tools, all, plan->dimension, voxel);
    double anchor[3] = {0.0, 0.0, 0.0};
    if (h->halo) {
        if (!lend_own(&own, h, tools, all))
            return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for coarse points");
        ascc_status status =
            ascc_sample_corners(samples, tools, &own, plan->dimension, voxel, 0.0, anchor);
        if (status == ASCC_OK)
            status =
                h->halo->corners(h->halo, level, h->scale.unit, tools, samples, &h->own[level]);
        return status == ASCC_OK ? ascc_early_rows_find(h, tools, ASCC_SET_LEVEL + level - 1)
                                 : status;
    }
    if (plan->centroid_anchor)
        ascc_centroid(all, anchor);
    return ascc_sample_corners(samples, tools, all, plan->dimension, voxel, plan->hysteresis,
                               anchor);
}

ascc_scale ascc_hierarchy_scale(const ascc_plan *plan)
{
    double smallest, largest;
    ascc_plan_radii(plan, &smallest, &largest);
    return ascc_scale_for_radius(largest);
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
    h->halo = scene->halo;
    if (scene->fluid_count >= UINT32_MAX ||
        scene->boundary_count >= UINT32_MAX - scene->fluid_count)
        return ascc_fail(tools->message, ASCC_ERROR_RANGE,
                         "%zu fluid and %zu boundary rows are more than 2^32 - 2",
                         scene->fluid_count, scene->boundary_count);
    ascc_status status = build_level_zero(h, tools, plan, scene);
    if (status == ASCC_OK)
        status = find_halo_rows(h, tools);
    if (status == ASCC_OK)
        status = find_drift(h, tools, plan, scene);
    if (status == ASCC_OK)
        status = ascc_sheets_find(h, tools, plan, scene);
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    const ascc_points *sampled = &h->set[plan->fluid_sampled ? ASCC_SET_FLUID : ASCC_SET_ALL];
    ascc_points both;
    if (status == ASCC_OK && scene->far) {
        if (!lend_with_far(&both, tools, sampled, scene->far))
            return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for coarse points");
        sampled = &both;
    }
    for (int level = 1; status == ASCC_OK && level < plan->level_count; level++)
        status = build_level(h, tools, plan, sampled, level);
    ascc_arena_return(tools->arena, mark);
    if (status != ASCC_OK)
        return status;
    for (int s = ASCC_SET_LEVEL; s < ASCC_SET_LEVEL + plan->level_count - 1; s++)
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
