/* What an edge knows of itself: the way from its receiver to its sender, and how far that is, in radii of edges.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "network.h"
#include "reverse.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    ascc_term *term = &entry->term;
    if (layer->set != ASCC_SET_EDGES || term->source != 0 || term->rectify)
        return FAIL("layer '%s': a 'displacement' lies on 'edges', has the source 'fluid' and no "
                    "'relu'",
                    ascc_quote(layer->name).text);
    term->outputs = builder->plan.dimension + 1;
    term->filter = (ascc_filter){.cells = {1, 1, 1}, .radius = builder->plan.edge_radius};
    return ASCC_OK;
}

static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    (void)term;
    (void)set;
    key[0] = ascc_edges_list(plan);
    return 1;
}

static int ends(const ascc_term *term)
{
    (void)term;
    return 0;
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const ascc_rows *rows = ascc_term_list(run, term, 0);
    const float scale = (float)(1.0 / rows->radius);
    const int32_t d = run->plan->dimension;
    for (size_t r = 0; r < tile->n; r++) {
        const uint32_t from = run->edges.receiver[tile->list[r]];
        const uint32_t to = run->edges.sender[tile->list[r]];
        float *out = tile->sum + r * tile->width + term->column, square = 0.0f;
        for (int32_t c = 0; c < d; c++) {
            const int32_t way = (int32_t)((uint32_t)rows->source->low[c][to] -
                                          (uint32_t)rows->source->low[c][from]);
            const float x = (float)way * scale;
            out[c] += x;
            square += x * x;
        }
        out[d] += sqrtf(square);
    }
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const ascc_network_run *run = pass->run;
    const ascc_rows *rows = ascc_term_list(run, term, 0);
    const size_t b = ascc_padded(term->outputs);
    const int32_t d = run->plan->dimension, set = run->plan->edge_set;
    for (size_t r = 0; pass->pass->seen && r < n; r++) {
        const uint32_t from = run->edges.receiver[list[r]], to = run->edges.sender[list[r]];
        const float *g = pass->tile + r * b;
        double way[3], by_way[3] = {0.0, 0.0, 0.0}, back[3];
        if (from == to)
            continue;
        ascc_seen_displacement(run, rows, from, to, way);
        const double length = sqrt(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]);
        for (int c = 0; c < d; c++) {
            const double u = length > 0.0 ? way[c] / length : 0.0;
            by_way[c] = ((double)g[c] + (double)g[d] * u) / run->plan->edge_radius;
        }
        for (int c = 0; c < 3; c++)
            back[c] = -by_way[c];
        ascc_reverse_place(pass, set, to, by_way);
        ascc_reverse_place(pass, set, from, back);
    }
}

const ascc_operation ascc_op_displacement = {.name = "displacement of edges",
                                             .type = "displacement",
                                             .check = check,
                                             .lists = lists,
                                             .ends = ends,
                                             .forward = forward,
                                             .backward = backward};
