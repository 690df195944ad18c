/* Columns gathered from neighbours, as column.h draws them. SPDX-License-Identifier: MIT */
#include "column.h"

#include <stdio.h>
#include <string.h>

#include "model/cost.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

void ascc_geometry_of(ascc_geometry *g, const ascc_network_run *run, const ascc_rows *rows,
                      const ascc_filter *filter, size_t query, const uint32_t *neighbor,
                      size_t count, float *scratch, size_t room)
{
    *g = (ascc_geometry){{scratch, scratch + room, scratch + 2 * room, {NULL}, NULL}, NULL};
    if (filter->window != ASCC_WINDOW_NONE)
        g->window = g->pairs.window[filter->window] = scratch + 3 * room;
    else if (filter->mapping == ASCC_MAPPING_DIRECTION)
        g->pairs.distance = scratch + 3 * room;
    const float inverse =
        rows->inverse_cube > 0.0f ? rows->inverse_cube : (float)(1.0 / rows->radius);
    const ascc_points *s = rows->source, *q = rows->query;
    const ascc_coordinates source = {s->low[0], s->low[1], s->low[2]};
    run->tools->kernels->geometry(&source, neighbor, count, q->low[0][query], q->low[1][query],
                                  q->low[2][query], inverse, (int)filter->mapping, &g->pairs);
}

/* Features of a row's neighbours, their motion less the row's own. The feature of walls is 0, so that who reads
 * it as it is does not ask in which frame they move. */
static void relative_features(const ascc_network_run *run, const ascc_term *term, size_t row,
                              const uint32_t *neighbor, size_t count, float *restrict to)
{
    const ascc_plan *plan = run->plan;
    const size_t a = ascc_padded(term->inputs), own_a = ascc_padded(plan->fluid_channels);
    const int32_t motion = ascc_plan_motion(plan, term->source);
    const float *own = run->value[0].raw + row * own_a + ascc_plan_motion(plan, 0);
    const float *feature = run->value[term->source].raw;
    const float *drift = term->source == 1 ? run->hierarchy->drift : NULL;
    for (size_t k = 0; k < count; k++, to += a) {
        const float *restrict from = feature + neighbor[k] * a;
        for (size_t c = 0; c < a; c += 8) /* rows are whole vectors */
            for (size_t n = 0; n < 8; n++)
                to[c + n] = from[c + n];
        for (int32_t c = 0; c < plan->dimension; c++)
            to[motion + c] -= drift ? own[c] - drift[neighbor[k] * 4 + (size_t)c] : own[c];
    }
}

void ascc_column_scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)plan;
    const size_t members = term->filter.bumps ? ascc_cell_count(&term->filter) : 0;
    const size_t relative = ascc_term_is_relative(term) ? ascc_padded(term->inputs) : 0;
    const size_t floats = (ASCC_GEOMETRY_ARRAYS + members + relative) * sizes->room;
    sizes->column = ascc_max_size(sizes->column, ascc_matrix_length(term));
    sizes->scratch = ascc_max_size(sizes->scratch, floats);
    sizes->reverse = ascc_max_size(sizes->reverse, ascc_max_size(members, 8) * sizes->room);
}

void ascc_column_look(ascc_neighborhood *around, const ascc_network_run *run, const ascc_term *term,
                      size_t row, float *scratch, size_t room, const uint32_t *sequence)
{
    const ascc_rows *rows = ascc_term_list(run, term, 0);
    const size_t members = term->filter.bumps ? ascc_cell_count(&term->filter) : 0;
    around->neighbor = around->read = rows->neighbor + rows->start[row];
    around->count = rows->count[row];
    around->room = room;
    around->feature = ascc_term_source(run, term);
    around->relative = NULL;
    around->factor = scratch + ASCC_GEOMETRY_ARRAYS * room;
    if (ascc_term_is_relative(term)) {
        around->relative = around->factor + members * room;
        relative_features(run, term, row, around->neighbor, around->count, around->relative);
        around->feature = around->relative;
        around->read = sequence;
    }
    ascc_geometry_of(&around->geometry, run, rows, &term->filter, row, around->neighbor,
                     around->count, scratch, room);
}

size_t ascc_column_gather(const ascc_tile *tile, const ascc_term *term)
{
    const size_t stride = ascc_matrix_length(term) + ASCC_COLUMN_PADDING;
    ascc_neighborhood around;
    for (size_t r = 0; r < tile->n; r++) {
        ascc_column_look(&around, tile->run, term, tile->list[r], tile->scratch, tile->room,
                         tile->sequence);
        term->operation->around->gather(tile->run, term, &around, tile->column + r * stride);
    }
    return tile->n;
}

void ascc_column_forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const size_t length = ascc_matrix_length(term), stride = length + ASCC_COLUMN_PADDING;
    (void)ascc_column_gather(tile, term);
    for (size_t r = 0; r < tile->n; r++) {
        float *to = tile->sum + r * tile->width + term->column;
        ascc_matrix_add_bias(run, term, to);
        for (int32_t c = 0; !term->tensor[ASCC_TENSOR_WEIGHT] && c < term->outputs; c++)
            to[c] += tile->column[r * stride + (size_t)c];
    }
    if (!term->tensor[ASCC_TENSOR_WEIGHT])
        return;
    run->tools->kernels->multiply(tile->column, stride, tile->n, length,
                                  ascc_term_packed(run, term), ascc_padded(term->outputs),
                                  tile->sum + term->column, tile->width);
}

/* ---- The way back ---- */

/* Gradients of relative features: the neighbours' own, and less of the row's motion. */
static void scatter_relative(const ascc_reverse *pass, const ascc_term *term,
                             const ascc_neighborhood *around, size_t row)
{
    const ascc_plan *plan = pass->run->plan;
    float *gradient = ascc_reverse_source(pass, term);
    const float *to = around->relative;
    const size_t a = ascc_padded(term->inputs), own_a = ascc_padded(plan->fluid_channels);
    const int32_t from = ascc_plan_motion(plan, term->source);
    float *own = pass->value[0].raw + row * own_a + ascc_plan_motion(plan, 0);
    for (size_t k = 0; k < around->count; k++) {
        for (int32_t c = 0; c < plan->dimension; c++)
            own[c] -= to[k * a + (size_t)(from + c)];
        for (size_t c = 0; term->source == 0 && c < a; c++) /* other channels are as they were */
            gradient[around->neighbor[k] * a + c] += to[k * a + c];
    }
}

static void scatter_row(const ascc_reverse *pass, const ascc_term *term,
                        const ascc_neighborhood *around, size_t row, const float *column_gradient)
{
    if (!around->relative) {
        term->operation->around->scatter(pass, term, around, around->neighbor, column_gradient,
                                         ascc_reverse_source(pass, term));
        return;
    }
    /* the features there have been used */
    memset(around->relative, 0, around->count * ascc_padded(term->inputs) * sizeof(float));
    term->operation->around->scatter(pass, term, around, pass->sequence, column_gradient,
                                     around->relative);
    scatter_relative(pass, term, around, row);
}

void ascc_column_backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                          const uint32_t *list, size_t n)
{
    (void)layer;
    const size_t length = ascc_matrix_length(term);
    const bool scatters =
        ascc_reverse_source(pass, term) || (ascc_term_is_relative(term) && pass->pass->velocity);
    const bool weightless = !term->tensor[ASCC_TENSOR_WEIGHT];
    if (weightless)
        memcpy(pass->column_gradient, pass->tile, n * length * sizeof(float));
    else if (scatters || pass->pass->seen)
        ascc_matrix_back(pass, term, n);
    for (size_t r = 0; r < n; r++) {
        const float *column_gradient = pass->column_gradient + r * length;
        ascc_neighborhood around;
        ascc_column_look(&around, pass->run, term, list[r], pass->scratch, pass->room,
                         pass->sequence);
        term->operation->around->gather(pass->run, term, &around, pass->column);
        if (!weightless)
            ascc_matrix_keep_column(pass, term, r);
        if (pass->pass->seen)
            term->operation->around->places(pass, term, &around, list[r], column_gradient);
        if (scatters)
            scatter_row(pass, term, &around, list[r], column_gradient);
    }
    if (!weightless)
        ascc_matrix_back_weights(pass, term, n);
}

void ascc_column_add_displacement(const ascc_reverse *pass, const ascc_term *term, size_t row,
                                  size_t neighbor, const double gradient[3])
{
    const double back[3] = {-gradient[0], -gradient[1], -gradient[2]};
    ascc_reverse_place(pass, ascc_network_set(pass->run->network, term->source), neighbor,
                       gradient);
    ascc_reverse_place(pass, pass->set, row, back);
}

/* ---- Convolutions ---- */

int ascc_convolution_lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                           ascc_list_key key[ASCC_MAX_LISTS])
{
    key[0] = (ascc_list_key){.query = set,
                             .source = ascc_plan_value_set(plan->layer, term->source),
                             .skip_self = term->filter.skip_self,
                             .limit = term->filter.neighbor_limit,
                             .radius = term->filter.radius};
    return 1;
}

void ascc_convolution_read(ascc_reader *reader, uint32_t object, ascc_term *term,
                           const char *name[ASCC_MAX_TENSORS])
{
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "kernel");
    name[ASCC_TENSOR_BIAS] = ascc_reader_optional_text(reader, object, "bias");
    term->filter.skip_self = ascc_reader_optional_flag(reader, object, "skip_self");
    term->option[ASCC_OPTION_RELATIVE] = ascc_reader_optional_flag(reader, object, "relative");
}

static ascc_status check_relative(ascc_plan_builder *builder, const ascc_term *term,
                                  const ascc_layer *layer)
{
    const ascc_plan *plan = &builder->plan;
    if (term->source > 1 || layer->set != ASCC_SET_FLUID || term->rectify ||
        ascc_plan_motion(plan, 0) < 0 || ascc_plan_motion(plan, term->source) < 0)
        return FAIL("layer '%s': 'relative' is for convolutions of the features 'motion', without "
                    "'relu', on the points 'fluid'",
                    ascc_quote(layer->name).text);
    return ASCC_OK;
}

ascc_status ascc_convolution_check(ascc_plan_builder *builder, const ascc_layer *layer,
                                   ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    const ascc_term *term = &entry->term;
    const ascc_status status =
        ascc_term_is_relative(term) ? check_relative(builder, term, layer) : ASCC_OK;
    if (status != ASCC_OK)
        return status;
    char where[64];
    snprintf(where, sizeof where, "layer '%.31s'", ascc_quote(layer->name).text);
    return ascc_plan_check_filter(builder, &term->filter, where);
}

bool ascc_convolution_reads_features(const ascc_term *term)
{
    return ascc_term_is_relative(term);
}

double ascc_convolution_cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                             const ascc_term *term, double reached)
{
    const int32_t source = ascc_plan_value_set(plan->layer, term->source);
    const double neighbors = ascc_cost_neighbors(plan, counts, source, term->filter.radius);
    const double cells = (double)ascc_cell_count(&term->filter);
    return ascc_cost_points(counts, set) * (neighbors * reached + cells * (double)term->outputs) *
           (double)term->inputs;
}
