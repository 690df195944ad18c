/* From points to edges: each edge gets what its sender or its receiver has. SPDX-License-Identifier: MIT */
#include "network.h"
#include "reverse.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

enum { OPTION_END = 0 }; /* ASCC_END_* */

static void read_gather(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                        ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    static const char *const names[] = {"sender", "receiver"};
    static const int end[] = {ASCC_END_SENDER, ASCC_END_RECEIVER};
    (void)plan;
    (void)name;
    term->option[OPTION_END] = end[ascc_reader_choice(reader, object, "end", names, 2)];
}

static int ends(const ascc_term *term)
{
    return (int)term->option[OPTION_END];
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    const ascc_plan *plan = &builder->plan;
    ascc_term *term = &entry->term;
    if (layer->set != ASCC_SET_EDGES ||
        ascc_plan_value_set(builder->layer, term->source) != plan->edge_set)
        return FAIL("layer '%s': 'gather' goes to 'edges' from the points that they connect",
                    ascc_quote(layer->name).text);
    term->filter = (ascc_filter){.cells = {1, 1, 1},
                                 .radius = ends(term) == ASCC_END_SENDER ? plan->edge_radius : 0.0};
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

static const uint32_t *points_of(const ascc_network_run *run, const ascc_term *term)
{
    return ends(term) == ASCC_END_SENDER ? run->edges.sender : run->edges.receiver;
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const uint32_t *point = points_of(tile->run, term);
    const size_t a = ascc_padded(term->inputs);
    const float *source = ascc_term_source(tile->run, term);
    for (size_t r = 0; r < tile->n; r++) {
        const float *restrict from = source + point[tile->list[r]] * a;
        float *restrict to = tile->sum + r * tile->width + term->column;
        for (int32_t c = 0; c < term->inputs; c++)
            to[c] += from[c];
    }
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const uint32_t *point = points_of(pass->run, term);
    const size_t a = ascc_padded(term->inputs);
    float *gradient = ascc_reverse_source(pass, term);
    for (size_t r = 0; gradient && r < n; r++)
        for (size_t c = 0; c < a; c++)
            gradient[point[list[r]] * a + c] += pass->tile[r * a + c];
}

const ascc_operation ascc_op_gather = {.name = "gather to edges",
                                       .type = "gather",
                                       .read = read_gather,
                                       .check = check,
                                       .lists = lists,
                                       .ends = ends,
                                       .forward = forward,
                                       .backward = backward};
