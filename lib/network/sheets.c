/* Sheets: finding them, and what they hide. SPDX-License-Identifier: MIT */
#include "sheets.h"

#include <math.h>
#include <string.h>

/* Of the disc that a sheet's point covers, in spacings: as of contact. */
#define DISC 0.71
/* Cosine of the angle between normals of one place that are opposite. */
#define OPPOSITE (-0.99)

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* How far a place is in front of a sheet's point. */
static double height_over(const struct ascc_sheets *s, const double place[3], size_t wall)
{
    const double *at = s->wall + wall * 3, *normal = s->normal + wall * 3;
    const double from[3] = {place[0] - at[0], place[1] - at[1], place[2] - at[2]};
    return dot(from, normal);
}

/* ---- What is hidden ---- */

/* The other side of a sheet. */
static bool is_behind(const void *data, uint32_t fluid, uint32_t wall)
{
    const struct ascc_sheets *s = data;
    return s->is_sheet[wall] && height_over(s, s->fluid + (size_t)fluid * 3, wall) < 0.0;
}

/* All but the sheet points of one of the two layers. */
static bool is_other(const void *data, uint32_t fluid, uint32_t wall)
{
    (void)fluid;
    const struct ascc_sheets *s = data;
    const double *n = s->normal + (size_t)wall * 3;
    const double first = n[0] != 0.0 ? n[0] : n[1] != 0.0 ? n[1] : n[2];
    return !s->is_sheet[wall] || first < 0.0;
}

/* Does the line between two places go through the disc of a sheet's point? */
static bool crosses(const struct ascc_sheets *s, const double a[3], const double b[3], size_t wall)
{
    const double above = height_over(s, a, wall), below = height_over(s, b, wall);
    if (!(above * below < 0.0))
        return false;
    const double share = above / (above - below), *at = s->wall + wall * 3;
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        const double d = a[c] + share * (b[c] - a[c]) - at[c];
        square += d * d;
    }
    return square <= s->disc * s->disc;
}

/* A sheet between two particles; the same from both, since the lower row is always the first. */
static bool is_parted(const void *data, uint32_t i, uint32_t j)
{
    const struct ascc_sheets *s = data;
    const uint32_t side[2] = {i < j ? i : j, i < j ? j : i};
    const double *a = s->fluid + (size_t)side[0] * 3, *b = s->fluid + (size_t)side[1] * 3;
    for (int k = 0; k < 2 && i != j; k++) {
        const uint32_t *wall = s->near.neighbor + s->near.start[side[k]];
        for (uint32_t n = 0; n < s->near.count[side[k]]; n++)
            if (crosses(s, a, b, wall[n]))
                return true;
    }
    return false;
}

void ascc_sheets_veil(const ascc_hierarchy *h, ascc_rows *rows)
{
    const bool fluid = rows->query == &h->set[ASCC_SET_FLUID];
    if (!h->sheets || !fluid)
        return;
    rows->hides_data = h->sheets;
    rows->hides = rows->source == &h->set[ASCC_SET_BOUNDARY] ? is_behind
                  : rows->source == rows->query              ? is_parted
                                                             : NULL;
}

ascc_status ascc_sheets_prepare(ascc_hierarchy *h, const ascc_search_tools *tools, double radius,
                                int32_t max_neighbors)
{
    struct ascc_sheets *s = h->sheets;
    if (!s || !(radius > 0.0))
        return ASCC_OK;
    /* a disc around the middle of the pair, and as far again for what flies */
    const double reach = hypot(0.5 * radius, 0.5 * radius) + 0.5 * radius;
    s->near = (ascc_rows){.query = &h->set[ASCC_SET_FLUID],
                          .source = &h->set[ASCC_SET_BOUNDARY],
                          .radius = reach,
                          .max_neighbors = max_neighbors,
                          .hides = is_other,
                          .hides_data = s};
    ascc_status status = ascc_hierarchy_grid(h, tools, ASCC_SET_FLUID, reach, &s->near.query_grid);
    if (status == ASCC_OK)
        status = ascc_hierarchy_grid(h, tools, ASCC_SET_BOUNDARY, reach, &s->near.source_grid);
    if (status == ASCC_OK)
        status = ascc_rows_open(&s->near, tools, 0);
    return status == ASCC_OK ? ascc_rows_make(&s->near, tools, NULL) : status;
}

/* ---- Finding them ---- */

static bool at_one_place(const ascc_points *p, size_t a, size_t b)
{
    return p->position[0][a] == p->position[0][b] && p->position[1][a] == p->position[1][b] &&
           p->position[2][a] == p->position[2][b];
}

static bool are_opposite(const ascc_hierarchy *h, const ascc_scene *scene, size_t d, size_t a,
                         size_t b)
{
    const double *m = scene->normal + ascc_hierarchy_wall_row(h, a) * d;
    const double *n = scene->normal + ascc_hierarchy_wall_row(h, b) * d;
    double cosine = 0.0;
    for (size_t c = 0; c < d; c++)
        cosine += m[c] * n[c];
    return cosine < OPPOSITE;
}

/* Marks opposite points, which lie together in the order of the set. Returns how many there are; mark NULL: only
 * whether there is one. */
static size_t mark_sheets(const ascc_hierarchy *h, const ascc_scene *scene, size_t d, uint8_t *mark)
{
    const ascc_points *p = &h->set[ASCC_SET_BOUNDARY];
    size_t count = 0;
    for (size_t i = 1; i < p->count; i++)
        for (size_t j = i; j-- > 0 && at_one_place(p, i, j);)
            if (are_opposite(h, scene, d, i, j)) {
                if (!mark)
                    return 1;
                mark[i] = mark[j] = 1;
                count += 2;
            }
    return count;
}

/* Rows of the host in the order of a set, three numbers each; NULL without memory. */
static double *arrange(const ascc_hierarchy *h, const ascc_search_tools *tools, int32_t set,
                       const double *from, size_t d)
{
    const size_t count = h->set[set].count;
    double *to = ascc_arena_take(tools->arena, count, 3 * sizeof *to);
    for (size_t i = 0; to && i < count; i++) {
        const size_t host = ascc_hierarchy_host_row(h, set, i);
        const size_t row = set == ASCC_SET_FLUID ? host : host - h->fluid_count;
        for (size_t c = 0; c < 3; c++)
            to[i * 3 + c] = c < d ? from[row * d + c] : 0.0;
    }
    return to;
}

ascc_status ascc_sheets_find(ascc_hierarchy *h, const ascc_search_tools *tools,
                             const ascc_plan *plan, const ascc_scene *scene)
{
    const size_t d = (size_t)plan->dimension, count = h->set[ASCC_SET_BOUNDARY].count;
    if (!scene->fluid_before || !scene->normal || !mark_sheets(h, scene, d, NULL))
        return ASCC_OK;
    struct ascc_sheets *s = ascc_arena_take(tools->arena, 1, sizeof *s);
    uint8_t *mark = ascc_arena_take(tools->arena, count, 1);
    if (s && mark) {
        memset(mark, 0, count);
        (void)mark_sheets(h, scene, d, mark);
        *s = (struct ascc_sheets){
            .is_sheet = mark,
            .fluid = arrange(h, tools, ASCC_SET_FLUID, scene->fluid_before, d),
            .wall = arrange(h, tools, ASCC_SET_BOUNDARY, scene->boundary_before, d),
            .normal = arrange(h, tools, ASCC_SET_BOUNDARY, scene->normal, d),
            .disc = DISC * plan->spacing / scene->unit};
    }
    if (!s || !mark || !s->fluid || !s->wall || !s->normal)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu walls", count);
    h->sheets = s;
    return ASCC_OK;
}
