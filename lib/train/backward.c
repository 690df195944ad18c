/* The reverse pass through layers: terms, residuals, transfers. SPDX-License-Identifier: MIT */
#include "backward.h"

#include <math.h>
#include <string.h>

#include "backward_parts.h"

#define TILE ASCC_BACKWARD_TILE

/* ---- Weights turned over ---- */

static size_t transposed_size(const ascc_plan *plan, int32_t t)
{
    const ascc_term *term = &plan->term[t];
    if (term->kind == ASCC_TERM_IDENTITY)
        return 0;
    const size_t cells = term->kind == ASCC_TERM_CONVOLUTION ? ascc_cell_count(&term->filter) : 1;
    return cells * ascc_padded(term->inputs) * ascc_padded(term->outputs);
}

static size_t part_size(const ascc_plan *plan)
{
    return ASCC_MAX_BUMPS * ascc_padded(plan->output.inputs);
}

bool ascc_transposed_create(ascc_transposed *transposed, const ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    memset(transposed, 0, sizeof *transposed);
    transposed->count = ASCC_PARTS * part_size(plan);
    for (int32_t t = 0; t < plan->term_count; t++)
        transposed->count += transposed_size(plan, t);
    transposed->block = ascc_allocate(network->allocator, transposed->count, sizeof(float));
    transposed->term =
        ascc_allocate(network->allocator, (size_t)plan->term_count, sizeof *transposed->term);
    if (!transposed->block || !transposed->term) {
        ascc_transposed_destroy(transposed, network);
        return false;
    }
    ascc_transposed_update(transposed, network);
    return true;
}

void ascc_transposed_destroy(ascc_transposed *transposed, const ascc_network *network)
{
    if (transposed->block)
        ascc_release(network->allocator, transposed->block, transposed->count, sizeof(float));
    if (transposed->term)
        ascc_release(network->allocator, (void *)transposed->term,
                     (size_t)network->plan->term_count, sizeof *transposed->term);
    memset(transposed, 0, sizeof *transposed);
}

static void turn(const float *from, size_t rows, size_t columns, float *to)
{
    for (size_t r = 0; r < rows; r++)
        for (size_t c = 0; c < columns; c++)
            to[c * rows + r] = from[r * columns + c];
}

void ascc_transposed_update(ascc_transposed *transposed, const ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    float *to = transposed->block;
    for (int32_t t = 0; t < plan->term_count; t++) {
        const size_t size = transposed_size(plan, t), b = ascc_padded(plan->term[t].outputs);
        transposed->term[t] = size ? to : NULL;
        if (size)
            turn(network->term_weight[t], size / b, b, to);
        to += size;
    }
    for (int p = 0; p < ASCC_PARTS; p++, to += part_size(plan)) {
        const float *part = network->part_weight[p];
        transposed->part[p] = part ? to : NULL;
        if (part)
            turn(part, ascc_padded(plan->output.inputs), ASCC_MAX_BUMPS, to);
    }
}

/* ---- Back to the layout of the model ---- */

static void fold_output(const ascc_plan *plan, const float *base, const float *arranged,
                        float *gradient)
{
    const ascc_output *output = &plan->output;
    const size_t a = (size_t)output->inputs, a8 = ascc_padded(output->inputs);
    if (output->filter.bumps) {
        for (int p = 0; p < ASCC_PARTS; p++, arranged += part_size(plan)) {
            size_t bumps;
            const float *part = ascc_output_part(output, p, &bumps);
            for (size_t k = 0; part && k < bumps; k++)
                for (size_t i = 0; i < a; i++)
                    gradient[(size_t)(part - base) + k * a + i] += arranged[i * ASCC_MAX_BUMPS + k];
        }
        return;
    }
    const size_t b = (size_t)plan->dimension, cells = ascc_cell_count(&output->filter);
    float *to = gradient + (output->weight - base);
    for (size_t c = 0; c < cells; c++)
        for (size_t i = 0; i < a; i++)
            for (size_t o = 0; o < b; o++)
                to[(c * a + i) * b + o] += arranged[(c * b + o) * a8 + i];
}

void ascc_backward_fold(const ascc_network *network, const ascc_model *model, const float *arranged,
                        float *gradient)
{
    const ascc_plan *plan = network->plan;
    const float *base = model->weights;
    for (int32_t t = 0; t < plan->term_count; t++) {
        const ascc_term *term = &plan->term[t];
        const size_t size = transposed_size(plan, t);
        if (!size)
            continue;
        const size_t a = (size_t)term->inputs, b = (size_t)term->outputs;
        const size_t a8 = ascc_padded(term->inputs), b8 = ascc_padded(term->outputs);
        const float *from = arranged + (network->term_weight[t] - network->weights);
        float *to = gradient + (term->weight - base);
        for (size_t c = 0; c < size / (a8 * b8); c++)
            for (size_t i = 0; i < a; i++)
                for (size_t o = 0; o < b; o++)
                    to[(c * a + i) * b + o] += from[(c * a8 + i) * b8 + o];
    }
    if (plan->output.kind == ASCC_OUTPUT_ANTISYMMETRIC)
        fold_output(plan, base,
                    arranged + (network->term_weight[plan->term_count] - network->weights),
                    gradient);
}

/* ---- Gradients of values ---- */

/* Does anything need the gradient of this value? Features: only for the velocities in them. */
static bool wants_value(const ascc_passing *p, int32_t value)
{
    return value >= 2 || (value == 0 && p->pass->velocity);
}

static bool take_gradient(const ascc_passing *p, const float *value, size_t size, float **gradient)
{
    *gradient = NULL;
    if (!value)
        return true;
    *gradient = ascc_arena_take(p->pass->arena, size, sizeof **gradient);
    if (*gradient)
        memset(*gradient, 0, size * sizeof **gradient);
    return *gradient != NULL;
}

static bool take_gradients(ascc_passing *p)
{
    const ascc_network_run *run = p->run;
    for (int32_t v = 0; v < run->network->value_count; v++) {
        const size_t rows = run->hierarchy->set[ascc_network_set(run->network, v)].count;
        const size_t size = rows * ascc_padded(ascc_network_channels(run->network, v));
        if (wants_value(p, v) &&
            (!take_gradient(p, run->value[v].raw, size, &p->value[v].raw) ||
             !take_gradient(p, run->value[v].rectified, size, &p->value[v].rectified)))
            return false;
    }
    return true;
}

static float *source_gradient(const ascc_passing *p, const ascc_term *term)
{
    const ascc_value_gradient *value = &p->value[term->source];
    return term->rectify ? value->rectified : value->raw;
}

/* Gradient of a row as it was before it was read raw and rectified. */
static void join_row(const ascc_passing *p, int32_t v, size_t row, size_t channels, float *to)
{
    const ascc_value_gradient *gradient = &p->value[v];
    const ascc_value *value = &p->run->value[v];
    const size_t padded = ascc_padded((int32_t)channels);
    for (size_t c = 0; c < channels; c++) {
        float g = gradient->raw ? gradient->raw[row * padded + c] : 0.0f;
        if (gradient->rectified && value->rectified[row * padded + c] > 0.0f)
            g += gradient->rectified[row * padded + c];
        to[c] = g;
    }
}

/* ---- Places ---- */

void ascc_backward_place(const ascc_passing *p, int32_t set, size_t row, const double gradient[3])
{
    const ascc_hierarchy *h = p->run->hierarchy;
    if (set != ASCC_SET_FLUID && set != ASCC_SET_ALL)
        return; /* walls and lattices stay where they are */
    const size_t origin = ascc_hierarchy_host_row(h, set, row);
    const size_t d = (size_t)p->run->network->plan->dimension;
    if (origin < h->fluid_count)
        for (size_t c = 0; c < d; c++)
            p->pass->seen[origin * d + c] += gradient[c];
}

/* ---- Terms ---- */

/* One tile of rows of one term: the columns' gradient and the columns, turned over. */
static void multiply_back(const ascc_passing *p, const ascc_term *term, size_t n)
{
    const ascc_kernels *kernels = p->run->tools->kernels;
    const size_t t = (size_t)(term - p->run->network->plan->term);
    const size_t b = ascc_padded(term->outputs);
    const size_t cells = term->kind == ASCC_TERM_CONVOLUTION ? ascc_cell_count(&term->filter) : 1;
    const size_t length = cells * ascc_padded(term->inputs);
    memset(p->column_gradient, 0, n * length * sizeof(float));
    kernels->multiply(p->tile, b, n, b, p->pass->transposed->term[t], length, p->column_gradient,
                      length);
}

static void add_weights(const ascc_passing *p, const ascc_term *term, size_t n)
{
    const ascc_network *network = p->run->network;
    const size_t b = ascc_padded(term->outputs);
    const size_t cells = term->kind == ASCC_TERM_CONVOLUTION ? ascc_cell_count(&term->filter) : 1;
    const size_t length = cells * ascc_padded(term->inputs);
    float *to =
        p->pass->arranged + (network->term_weight[term - network->plan->term] - network->weights);
    p->run->tools->kernels->multiply(p->turned, TILE, length, n, p->tile, b, to, b);
    if (term->bias) {
        float *bias = p->pass->bias + (term->bias - p->pass->step->model->weights);
        for (size_t r = 0; r < n; r++)
            for (int32_t c = 0; c < term->outputs; c++)
                bias[c] += p->tile[r * b + (size_t)c];
    }
}

static void turn_column(const ascc_passing *p, size_t r, size_t length)
{
    for (size_t i = 0; i < length; i++)
        p->turned[i * TILE + r] = p->column[i];
}

/* A row's gradient to the features of its neighbours. */
static void scatter_row(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                        size_t row, const float *column_gradient)
{
    float *gradient = source_gradient(p, term);
    const ascc_plan *plan = p->run->network->plan;
    const size_t a = ascc_padded(term->inputs), count = rows->count[row];
    const size_t room = p->scratch.room;
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    float *to = gradient;
    const uint32_t *write = neighbor;
    if (term->relative) {
        to = p->scratch.relative; /* the features there have been used */
        write = p->scratch.sequence;
        memset(to, 0, count * a * sizeof *to);
    }
    if (term->kind == ASCC_TERM_TRANSFER)
        p->run->tools->kernels->scatter(p->scratch.geometry + 3 * room, room, 1, 1, write, count,
                                        column_gradient, a, to);
    else if (term->filter.bumps)
        p->run->tools->kernels->scatter(p->scratch.factor, room, (size_t)term->filter.bumps,
                                        (size_t)term->filter.cells[0], write, count,
                                        column_gradient, a, to);
    else
        ascc_backward_scatter_grid(p, term, write, count, column_gradient, to);
    if (!term->relative)
        return;
    const size_t own_a = ascc_padded(plan->fluid_channels);
    const int32_t from = ascc_plan_motion(plan, term->source);
    float *own = p->value[0].raw + row * own_a + ascc_plan_motion(plan, 0);
    for (size_t k = 0; k < count; k++) {
        for (int32_t c = 0; c < plan->dimension; c++)
            own[c] -= to[k * a + (size_t)(from + c)];
        for (size_t c = 0; term->source == 0 && c < a; c++) /* other channels are as they were */
            gradient[neighbor[k] * a + c] += to[k * a + c];
    }
}

static void search_term(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                        const uint32_t *list, size_t n)
{
    const size_t length = ascc_cell_count(&term->filter) * ascc_padded(term->inputs);
    const bool scatters = source_gradient(p, term) || (term->relative && p->pass->velocity);
    if (scatters || p->pass->seen)
        multiply_back(p, term, n);
    for (size_t r = 0; r < n; r++) {
        ascc_network_column(p->run, term, rows, list[r], &p->scratch, p->column);
        turn_column(p, r, length);
        if (p->pass->seen)
            ascc_backward_geometry(p, term, rows, list[r], p->column_gradient + r * length);
        if (scatters)
            scatter_row(p, term, rows, list[r], p->column_gradient + r * length);
    }
    add_weights(p, term, n);
}

/* Dense and identity: rows that the source's set shares with the layer's. */
static void pointwise_term(const ascc_passing *p, const ascc_layer *layer, const ascc_term *term,
                           const uint32_t *list, size_t n)
{
    const ascc_network_run *run = p->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs), b = ascc_padded(term->outputs);
    const float *source = ascc_network_source(run, term);
    float *gradient = source_gradient(p, term);
    const bool dense = term->kind == ASCC_TERM_DENSE;
    if (dense)
        multiply_back(p, term, n);
    for (size_t r = 0, j; r < n; r++) {
        if (!ascc_network_shared_row(run->hierarchy, layer->set, set, list[r], &j)) {
            memset(p->tile + r * b, 0, b * sizeof *p->tile); /* this row has no such term */
            memset(p->column, 0, a * sizeof *p->column);
        } else {
            const float *g = dense ? p->column_gradient + r * a : p->tile + r * b;
            for (size_t c = 0; gradient && c < a; c++)
                gradient[j * a + c] += g[c];
            memcpy(p->column, source + j * a, a * sizeof *p->column);
        }
        if (dense)
            turn_column(p, r, a);
    }
    if (dense)
        add_weights(p, term, n);
}

/* The term's columns of the layer's gradient, filled up with zeros. */
static void fill_tile(const ascc_passing *p, const ascc_layer *layer, const ascc_term *term,
                      size_t n)
{
    const size_t b = ascc_padded(term->outputs), width = ascc_padded(layer->channels);
    memset(p->tile, 0, n * b * sizeof *p->tile);
    for (size_t r = 0; r < n; r++)
        memcpy(p->tile + r * b, p->joined + r * width + term->column,
               (size_t)term->outputs * sizeof *p->tile);
}

static ascc_status take_scratch(ascc_passing *p, const ascc_layer *layer)
{
    const ascc_plan *plan = p->run->network->plan;
    ascc_arena *arena = p->pass->arena;
    const ascc_column_sizes sizes = ascc_network_sizes(p->run, layer);
    size_t column = sizes.column, outputs = ascc_padded(layer->channels);
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        column = ascc_max_size(column, ascc_padded(plan->term[t].inputs));
        outputs = ascc_max_size(outputs, ascc_padded(plan->term[t].outputs));
    }
    uint32_t *sequence = ascc_arena_take(arena, sizes.room, sizeof *sequence);
    float *memory = ascc_arena_take(arena, sizes.scratch, sizeof *memory);
    p->dot = ascc_arena_take(arena, ascc_max_size(sizes.members, 8) * sizes.room, sizeof(float));
    p->column = ascc_arena_take(arena, column, sizeof(float));
    p->turned = ascc_arena_take(arena, column * TILE, sizeof(float));
    p->column_gradient = ascc_arena_take(arena, column * TILE, sizeof(float));
    p->tile = ascc_arena_take(arena, outputs * TILE, sizeof(float));
    p->joined = ascc_arena_take(arena, ascc_padded(layer->channels) * TILE, sizeof(float));
    if (!sequence || !memory || !p->dot || !p->column || !p->turned || !p->column_gradient ||
        !p->tile || !p->joined)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < sizes.room; i++)
        sequence[i] = (uint32_t)i;
    p->scratch = ascc_network_scratch(&sizes, memory, sequence);
    return ASCC_OK;
}

static ascc_status pass_layer(ascc_passing *p, int32_t l)
{
    const ascc_plan *plan = p->run->network->plan;
    const ascc_layer *layer = &plan->layer[l];
    const size_t rows = p->run->hierarchy->set[layer->set].count;
    const uint8_t *active = p->run->value[l + 2].active;
    const size_t channels = (size_t)layer->channels, width = ascc_padded(layer->channels);
    p->set = layer->set;
    if (take_scratch(p, layer) != ASCC_OK)
        return ASCC_ERROR_MEMORY;
    memset(p->joined, 0, width * TILE * sizeof *p->joined);
    for (size_t at = 0; at < rows;) {
        uint32_t list[TILE];
        size_t n = 0;
        for (; at < rows && n < TILE; at++)
            if (active[at])
                list[n++] = (uint32_t)at;
        for (size_t r = 0; r < n; r++)
            join_row(p, l + 2, list[r], channels, p->joined + r * width);
        for (int32_t t = layer->first_term; n && t < layer->first_term + layer->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            const int32_t key = p->run->network->term_key[t];
            fill_tile(p, layer, term, n);
            if (key >= 0)
                search_term(p, term, &p->run->rows[key], list, n);
            else
                pointwise_term(p, layer, term, list, n);
        }
    }
    return ASCC_OK;
}

/* From features to the velocities they were made of. */
static void add_velocities(const ascc_passing *p)
{
    const ascc_plan *plan = p->run->network->plan;
    const ascc_hierarchy *h = p->run->hierarchy;
    const size_t d = (size_t)plan->dimension;
    const double motion = plan->time_step / plan->spacing;
    for (size_t i = 0; i < h->set[ASCC_SET_FLUID].count; i++) {
        double *to = p->pass->velocity + h->origin[h->whole[ASCC_SET_FLUID][i]] * d;
        float channel[ASCC_MAX_FEATURES * 3], *g = channel;
        join_row(p, 0, i, (size_t)plan->fluid_channels, channel);
        for (int32_t f = 0; f < plan->fluid_feature_count; f++) {
            const int32_t feature = plan->fluid_features[f];
            const double factor = feature == ASCC_FEATURE_MOTION ? motion : 1.0;
            const bool moves = feature != ASCC_FEATURE_ONE && feature != ASCC_FEATURE_GRAVITY;
            for (size_t c = 0; moves && c < d; c++)
                to[c] += factor * (double)g[c];
            g += feature == ASCC_FEATURE_ONE ? 1 : d;
        }
    }
}

ascc_status ascc_backward_run(const ascc_backward *pass)
{
    ascc_passing p = {.pass = pass, .run = &pass->trace->run};
    const ascc_plan *plan = p.run->network->plan;
    p.value = ascc_arena_take(pass->arena, (size_t)p.run->network->value_count, sizeof *p.value);
    if (!p.value)
        return ASCC_ERROR_MEMORY;
    memset(p.value, 0, (size_t)p.run->network->value_count * sizeof *p.value);
    if (!take_gradients(&p))
        return ASCC_ERROR_MEMORY;
    ascc_status status = ascc_backward_output(&p);
    for (int32_t l = plan->layer_count - 1; l >= 0 && status == ASCC_OK; l--)
        status = pass_layer(&p, l);
    if (status == ASCC_OK && pass->velocity && (p.value[0].raw || p.value[0].rectified))
        add_velocities(&p);
    return status;
}
