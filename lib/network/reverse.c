/* The reverse pass: layer by layer, from the output back. SPDX-License-Identifier: MIT */
#include "reverse.h"

#include <string.h>

#define TILE ASCC_TILE_ROWS

/* ---- Weights transposed ---- */

bool ascc_transposed_create(ascc_transposed *transposed, const ascc_allocator *allocator,
                            const ascc_plan *plan, const ascc_packed *packed)
{
    transposed->count = packed->count;
    transposed->block = ascc_allocate(allocator, packed->count, sizeof(float));
    if (transposed->block)
        ascc_transposed_update(transposed, plan, packed);
    return transposed->block != NULL;
}

void ascc_transposed_destroy(ascc_transposed *transposed, const ascc_allocator *allocator)
{
    if (transposed->block)
        ascc_release(allocator, transposed->block, transposed->count, sizeof(float));
    transposed->block = NULL;
}

void ascc_transpose(const float *from, size_t rows, size_t columns, float *to)
{
    for (size_t r = 0; r < rows; r++)
        for (size_t c = 0; c < columns; c++)
            to[c * rows + r] = from[r * columns + c];
}

void ascc_transposed_update(ascc_transposed *transposed, const ascc_plan *plan,
                            const ascc_packed *packed)
{
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const ascc_term *term = ascc_plan_term(plan, t);
        if (term->operation->transpose)
            term->operation->transpose(plan, term, packed->term[t],
                                       transposed->block + (packed->term[t] - packed->block));
    }
}

/* ---- Gradients of values ---- */

/* Does the gradient of a layer lead anywhere? Else everything before it is data. */
static bool leads_on(const ascc_reverse *p, int32_t l)
{
    const ascc_layer *layer = &p->run->plan->layer[l];
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        const ascc_term *term = &p->run->plan->term[t];
        if (p->pass->seen ||
            (!term->operation->leads_to_places && (p->pass->velocity || p->wants[term->source])))
            return true;
        for (int i = 0; i < ASCC_MAX_TENSORS; i++)
            if (term->tensor[i])
                return true;
    }
    return false;
}

/* Whether anything needs the gradients of values; of features: only for the velocities in them. */
static bool find_wants(ascc_reverse *p)
{
    const int32_t count = p->run->network->value_count;
    p->wants = ascc_arena_take(p->pass->arena, (size_t)count, sizeof *p->wants);
    for (int32_t v = 0; p->wants && v < count; v++)
        p->wants[v] = v >= 2 ? leads_on(p, v - 2) : v == 0 && p->pass->velocity;
    return p->wants != NULL;
}

static bool take_gradient(const ascc_reverse *p, const float *value, size_t size, float **gradient)
{
    *gradient = NULL;
    if (!value)
        return true;
    *gradient = ascc_arena_take(p->pass->arena, size, sizeof **gradient);
    if (*gradient)
        memset(*gradient, 0, size * sizeof **gradient);
    return *gradient != NULL;
}

static bool take_gradients(ascc_reverse *p)
{
    const ascc_network_run *run = p->run;
    for (int32_t v = 0; v < run->network->value_count; v++) {
        const size_t rows = ascc_network_rows(run, ascc_network_set(run->network, v));
        const size_t size = rows * ascc_padded(ascc_network_channels(run->network, v));
        if (p->wants[v] &&
            (!take_gradient(p, run->value[v].raw, size, &p->value[v].raw) ||
             !take_gradient(p, run->value[v].rectified, size, &p->value[v].rectified)))
            return false;
    }
    return true;
}

/* Gradient of a row as it was before it was read raw and rectified. */
static void join_row(const ascc_reverse *p, int32_t v, size_t row, size_t channels, float *to)
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

void ascc_reverse_place(const ascc_reverse *p, int32_t set, size_t row, const double gradient[3])
{
    const ascc_hierarchy *h = p->run->hierarchy;
    if (set != ASCC_SET_FLUID && set != ASCC_SET_ALL)
        return; /* walls and lattices stay where they are */
    const size_t origin = ascc_hierarchy_host_row(h, set, row);
    const size_t d = (size_t)p->run->plan->dimension;
    if (origin < h->fluid_count)
        for (size_t c = 0; c < d; c++)
            p->pass->seen[origin * d + c] += gradient[c];
}

/* ---- Layers ---- */

/* The term's columns of the layer's gradient, filled up with zeros. */
static void fill_tile(const ascc_reverse *p, const ascc_layer *layer, const ascc_term *term,
                      size_t n)
{
    const size_t b = ascc_padded(term->outputs), width = ascc_padded(layer->channels);
    memset(p->tile, 0, n * b * sizeof *p->tile);
    for (size_t r = 0; r < n; r++)
        memcpy(p->tile + r * b, p->joined + r * width + term->column,
               (size_t)term->outputs * sizeof *p->tile);
}

static ascc_status take_scratch(ascc_reverse *p, const ascc_layer *layer)
{
    const ascc_scratch_sizes sizes = ascc_network_sizes(p->run, layer);
    ascc_arena *arena = p->pass->arena;
    size_t outputs = ascc_padded(layer->channels);
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
        outputs = ascc_max_size(outputs, ascc_padded(p->run->plan->term[t].outputs));
    uint32_t *sequence = ascc_arena_take(arena, sizes.room, sizeof *sequence);
    p->scratch = ascc_arena_take(arena, sizes.scratch, sizeof(float));
    p->dot = ascc_arena_take(arena, sizes.reverse, sizeof(float));
    p->column = ascc_arena_take(arena, sizes.column, sizeof(float));
    p->columns = ascc_arena_take(arena, sizes.column * TILE, sizeof(float));
    p->column_gradient = ascc_arena_take(arena, sizes.column * TILE, sizeof(float));
    p->tile = ascc_arena_take(arena, outputs * TILE, sizeof(float));
    p->joined = ascc_arena_take(arena, ascc_padded(layer->channels) * TILE, sizeof(float));
    if (!sequence || !p->scratch || !p->dot || !p->column || !p->columns || !p->column_gradient ||
        !p->tile || !p->joined)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < sizes.room; i++)
        sequence[i] = (uint32_t)i;
    p->sequence = sequence;
    p->room = sizes.room;
    return ASCC_OK;
}

static ascc_status pass_layer(ascc_reverse *p, int32_t l)
{
    const ascc_plan *plan = p->run->plan;
    const ascc_layer *layer = &plan->layer[l];
    const size_t rows = ascc_network_rows(p->run, layer->set);
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
        for (int32_t t = 0; n && t < layer->term_count; t++) {
            const ascc_term *term = &plan->term[layer->first_term + t];
            fill_tile(p, layer, term, n);
            term->operation->backward(p, layer, term, list, n);
        }
    }
    return ASCC_OK;
}

/* From the pressures that a relaxation begins with to the value that they are. */
static void add_guesses(const ascc_reverse *p)
{
    const ascc_hierarchy *h = p->run->hierarchy;
    float *to = p->value[p->run->plan->relaxation.guess].rectified;
    for (size_t i = 0; to && i < h->set[ASCC_SET_FLUID].count; i++)
        to[i * ascc_padded(1)] +=
            (float)p->pass->guess[ascc_hierarchy_host_row(h, ASCC_SET_FLUID, i)];
}

/* From features to the velocities they were made of. */
static void add_velocities(const ascc_reverse *p)
{
    const ascc_plan *plan = p->run->plan;
    const ascc_hierarchy *h = p->run->hierarchy;
    const size_t d = (size_t)plan->dimension;
    const double motion = plan->time_step / plan->spacing;
    for (size_t i = 0; i < h->set[ASCC_SET_FLUID].count; i++) {
        const size_t row = h->origin[h->whole[ASCC_SET_FLUID][i]];
        double *to = p->pass->velocity + row * d;
        float channel[(ASCC_MAX_FEATURES + ASCC_MAX_HISTORY) * 3], *g = channel;
        join_row(p, 0, i, (size_t)plan->fluid_channels, channel);
        for (int32_t f = 0; f < plan->fluid_feature_count; f++) {
            const int32_t feature = plan->fluid_features[f];
            const double factor = feature == ASCC_FEATURE_MOTION ? motion : 1.0;
            const bool moves = feature != ASCC_FEATURE_ONE && feature != ASCC_FEATURE_GRAVITY &&
                               feature != ASCC_FEATURE_HISTORY;
            const size_t channels = (size_t)ascc_feature_channels(plan, feature);
            double *past = p->pass->past ? p->pass->past + row * channels : NULL;
            for (size_t c = 0; feature == ASCC_FEATURE_HISTORY && past && c < channels; c++)
                past[c] += motion * (double)g[c];
            for (size_t c = 0; moves && c < d; c++)
                to[c] += factor * (double)g[c];
            g += channels;
        }
    }
}

ascc_status ascc_backward_run(const ascc_backward *pass)
{
    ascc_reverse p = {.pass = pass, .run = pass->run};
    const ascc_plan *plan = p.run->plan;
    p.value = ascc_arena_take(pass->arena, (size_t)p.run->network->value_count, sizeof *p.value);
    if (!p.value)
        return ASCC_ERROR_MEMORY;
    memset(p.value, 0, (size_t)p.run->network->value_count * sizeof *p.value);
    if (!find_wants(&p) || !take_gradients(&p))
        return ASCC_ERROR_MEMORY;
    ascc_status status = plan->output.term.operation->backward_output(&p);
    if (plan->relaxation.guess && pass->guess)
        add_guesses(&p);
    for (int32_t l = plan->layer_count - 1; l >= 0 && status == ASCC_OK; l--)
        if (p.wants[l + 2])
            status = pass_layer(&p, l);
    if (status == ASCC_OK && pass->velocity && (p.value[0].raw || p.value[0].rectified))
        add_velocities(&p);
    return status;
}
