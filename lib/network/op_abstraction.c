/* Set abstraction: one small network over each neighbour's features and relative position, and the maximum over
 * neighbours, or their mean. SPDX-License-Identifier: MIT
 *
 *     pair(i, j) = [f_j, (x_j - x_i) / radius]                  relative: f_j - f_i in place of f_j
 *     value(i)   = pool over j of relu(relu(pair A + a) B + b)
 *
 * What a maximum gives depends on no order; its gradient goes to the first neighbour that has it, in the order of
 * cells. A point without neighbours has 0.
 * Packed: A [padded pair][padded hidden], a [padded hidden], B [padded hidden][padded outputs], b [padded outputs].
 */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "column.h"
#include "model/cost.h"
#include "model/initial.h"

enum { OPTION_RELATIVE = 0, OPTION_HIDDEN = 1, OPTION_MEAN = 2 };
enum { TENSOR_HIDDEN = 2, TENSOR_HIDDEN_BIAS = 3 };

/* Pairs that are evaluated together. */
#define BATCH 32
/* Floats that geometry takes up in a worker's scratch. */
#define GEOMETRY (ASCC_GEOMETRY_ARRAYS * BATCH)

static bool is_relative(const ascc_term *term)
{
    return term->option[OPTION_RELATIVE] != 0.0;
}

static bool is_mean(const ascc_term *term)
{
    return term->option[OPTION_MEAN] != 0.0;
}

/* Numbers of a pair, of its hidden layer and of what comes out: as they are, and as they are stored. */
typedef struct widths {
    size_t pair, hidden, outputs;
    size_t pair8, hidden8, outputs8;
} widths;

static widths widths_of(const ascc_plan *plan, const ascc_term *term)
{
    const int32_t pair = term->inputs + plan->dimension,
                  hidden = (int32_t)term->option[OPTION_HIDDEN];
    return (widths){(size_t)pair,      (size_t)hidden,      (size_t)term->outputs,
                    ascc_padded(pair), ascc_padded(hidden), ascc_padded(term->outputs)};
}

/* ---- From a file ---- */

static void read_abstraction(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                             ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    static const char *const pools[] = {"maximum", "mean"};
    (void)plan;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "weight");
    name[ASCC_TENSOR_BIAS] = ascc_reader_text(reader, object, "bias");
    name[TENSOR_HIDDEN] = ascc_reader_text(reader, object, "hidden_weight");
    name[TENSOR_HIDDEN_BIAS] = ascc_reader_text(reader, object, "hidden_bias");
    term->option[OPTION_HIDDEN] =
        ascc_reader_integer(reader, object, "hidden", 1, ASCC_MAX_CHANNELS);
    term->option[OPTION_MEAN] = ascc_reader_choice(reader, object, "pool", pools, 2);
    term->option[OPTION_RELATIVE] = ascc_reader_optional_flag(reader, object, "relative");
    term->filter = (ascc_filter){
        .cells = {1, 1, 1},
        .mapping = ASCC_MAPPING_IDENTITY,
        .window = ASCC_WINDOW_NONE,
        .neighbor_limit = ascc_reader_optional_integer(reader, object, "neighbor_limit"),
        .radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX)};
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    ascc_plan_take_outputs(term, stored[1]);
    const widths w = widths_of(plan, term);
    ascc_plan_want_bias(term, wanted);
    wanted[ASCC_TENSOR_WEIGHT] = (ascc_tensor_wanted){
        .dimensions = "hidden, outputs", .rank = 2, .shape = {w.hidden, w.outputs}};
    wanted[TENSOR_HIDDEN] = (ascc_tensor_wanted){
        .dimensions = "inputs + dimension, hidden", .rank = 2, .shape = {w.pair, w.hidden}};
    wanted[TENSOR_HIDDEN_BIAS] =
        (ascc_tensor_wanted){.dimensions = "hidden", .rank = 1, .shape = {w.hidden}};
}

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    const ascc_term *term = &entry->term;
    const int32_t set = ascc_plan_value_set(builder->layer, term->source);
    const ascc_quoted quoted = ascc_quote(layer->name);
    char where[64];
    if (is_relative(term) && set != layer->set &&
        !(set == ASCC_SET_ALL && layer->set < ASCC_SET_ALL))
        return FAIL(
            "layer '%s': a 'relative' set abstraction reads a value that its own points have, "
            "too",
            quoted.text);
    if (is_relative(term) && term->filter.neighbor_limit)
        return FAIL("layer '%s': a 'relative' set abstraction has no 'neighbor_limit'",
                    quoted.text);
    snprintf(where, sizeof where, "layer '%.31s'", quoted.text);
    return ascc_plan_check_filter(builder, &term->filter, where);
}

/* Both matrices are read through ReLUs. */
static void fill_initial(ascc_initial *initial)
{
    if (initial->rank == 2)
        ascc_initial_fill(initial, 0, initial->count, sqrt(2.0 / (double)initial->shape[0]));
    else
        ascc_initial_default(initial);
}

/* ---- Sizes, packing, cost ---- */

/* Where the hidden bias, the second matrix and its bias begin in packed weights; how many those are. */
typedef struct places_of_weights {
    size_t hidden_bias, weight, bias, end;
} weight_places;

static weight_places find_weights(const widths *w)
{
    weight_places p;
    p.hidden_bias = w->pair8 * w->hidden8;
    p.weight = p.hidden_bias + w->hidden8;
    p.bias = p.weight + w->hidden8 * w->outputs8;
    p.end = p.bias + w->outputs8;
    return p;
}

static size_t packed_size(const ascc_plan *plan, const ascc_term *term)
{
    const widths w = widths_of(plan, term);
    return find_weights(&w).end;
}

static void spread_rows(const float *from, size_t rows, size_t columns, float *to, size_t stride)
{
    for (size_t r = 0; r < rows; r++)
        memcpy(to + r * stride, from + r * columns, columns * sizeof *to);
}

static void pack(const ascc_plan *plan, const ascc_term *term, float *packed)
{
    const widths w = widths_of(plan, term);
    const weight_places p = find_weights(&w);
    spread_rows(term->tensor[TENSOR_HIDDEN], w.pair, w.hidden, packed, w.hidden8);
    spread_rows(term->tensor[TENSOR_HIDDEN_BIAS], 1, w.hidden, packed + p.hidden_bias, 0);
    spread_rows(term->tensor[ASCC_TENSOR_WEIGHT], w.hidden, w.outputs, packed + p.weight,
                w.outputs8);
    spread_rows(term->tensor[ASCC_TENSOR_BIAS], 1, w.outputs, packed + p.bias, 0);
}

static void add_rows(const float *from, size_t stride, size_t rows, size_t columns, float *to)
{
    for (size_t r = 0; r < rows; r++)
        for (size_t c = 0; c < columns; c++)
            to[r * columns + c] += from[r * stride + c];
}

static void unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                   float *const gradient[ASCC_MAX_TENSORS])
{
    const widths w = widths_of(plan, term);
    const weight_places p = find_weights(&w);
    add_rows(packed, w.hidden8, w.pair, w.hidden, gradient[TENSOR_HIDDEN]);
    add_rows(packed + p.hidden_bias, 0, 1, w.hidden, gradient[TENSOR_HIDDEN_BIAS]);
    add_rows(packed + p.weight, w.outputs8, w.hidden, w.outputs, gradient[ASCC_TENSOR_WEIGHT]);
    add_rows(packed + p.bias, 0, 1, w.outputs, gradient[ASCC_TENSOR_BIAS]);
}

static void transpose(const ascc_plan *plan, const ascc_term *term, const float *packed, float *to)
{
    const widths w = widths_of(plan, term);
    const weight_places p = find_weights(&w);
    ascc_transpose(packed, w.pair8, w.hidden8, to);
    ascc_transpose(packed + p.weight, w.hidden8, w.outputs8, to + p.weight);
}

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const widths w = widths_of(plan, term);
    const int32_t source = ascc_plan_value_set(plan->layer, term->source);
    double neighbors = ascc_cost_neighbors(plan, counts, source, term->filter.radius);
    if (term->filter.neighbor_limit)
        neighbors = fmin(neighbors, term->filter.neighbor_limit);
    return ascc_cost_points(counts, set) * neighbors *
           (double)(w.pair * w.hidden + w.hidden * w.outputs);
}

/* Floats of a batch: its pairs, what is hidden, what comes out. */
static size_t batch_size(const widths *w)
{
    return GEOMETRY + BATCH * (w->pair8 + w->hidden8 + w->outputs8);
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    const widths w = widths_of(plan, term);
    sizes->scratch = ascc_max_size(sizes->scratch, batch_size(&w) + w.outputs8);
    sizes->reverse =
        ascc_max_size(sizes->reverse,
                      w.outputs8 + sizes->room + BATCH * (2 * (w.pair8 + w.hidden8) + w.outputs8));
}

/* ---- Pairs ---- */

typedef struct batch {
    float *geometry; /* [GEOMETRY] */
    float *pair;     /* [BATCH][pair8] */
    float *hidden;   /* [BATCH][hidden8] after the ReLU */
    float *value;    /* [BATCH][outputs8] likewise */
    float *end;
} batch;

static batch batch_in(float *scratch, const widths *w)
{
    batch b = {.geometry = scratch, .pair = scratch + GEOMETRY};
    b.hidden = b.pair + BATCH * w->pair8;
    b.value = b.hidden + BATCH * w->hidden8;
    b.end = b.value + BATCH * w->outputs8;
    return b;
}

/* The row of the source that is the query's own, with `relative`. */
static size_t own_row(const ascc_network_run *run, const ascc_term *term, size_t row)
{
    const int32_t key = run->network->term_key[ascc_plan_term_number(run->plan, term)][0];
    size_t own = row;
    (void)ascc_network_shared_row(run->hierarchy, run->network->key[key].query,
                                  ascc_network_set(run->network, term->source), row, &own);
    return own;
}

static void fill_pairs(const ascc_network_run *run, const ascc_term *term, const widths *w,
                       size_t row, const uint32_t *neighbor, size_t n, const batch *to)
{
    const ascc_rows *rows = ascc_term_list(run, term, 0);
    const size_t in = (size_t)term->inputs, a = ascc_padded(term->inputs);
    const size_t d = (size_t)run->plan->dimension;
    const float *source = ascc_term_source(run, term);
    const float *own = is_relative(term) ? source + own_row(run, term, row) * a : NULL;
    ascc_geometry g;
    ascc_geometry_of(&g, run, rows, &term->filter, row, neighbor, n, to->geometry, BATCH);
    const float *place[3] = {g.pairs.x, g.pairs.y, g.pairs.z};
    for (size_t k = 0; k < n; k++) {
        const float *from = source + neighbor[k] * a;
        float *pair = to->pair + k * w->pair8;
        for (size_t c = 0; c < in; c++)
            pair[c] = own ? from[c] - own[c] : from[c];
        for (size_t c = 0; c < d; c++)
            pair[in + c] = place[c][k];
        for (size_t c = w->pair; c < w->pair8; c++)
            pair[c] = 0.0f;
    }
}

/* out[n][b8] = relu(in[n][a] weight[a][b8] + bias[b8]) */
static void apply(const ascc_kernels *kernels, const float *in, size_t stride, size_t n, size_t a,
                  const float *weight, const float *bias, size_t b8, float *out)
{
    for (size_t k = 0; k < n; k++)
        memcpy(out + k * b8, bias, b8 * sizeof *out);
    kernels->multiply(in, stride, n, a, weight, b8, out, b8);
    for (size_t i = 0; i < n * b8; i++)
        out[i] = out[i] < 0.0f ? 0.0f : out[i];
}

static void evaluate(const ascc_network_run *run, const ascc_term *term, const widths *w,
                     size_t row, const uint32_t *neighbor, size_t n, const batch *to)
{
    const ascc_kernels *kernels = run->tools->kernels;
    const weight_places p = find_weights(w);
    const float *packed = ascc_term_packed(run, term);
    fill_pairs(run, term, w, row, neighbor, n, to);
    apply(kernels, to->pair, w->pair8, n, w->pair, packed, packed + p.hidden_bias, w->hidden8,
          to->hidden);
    apply(kernels, to->hidden, w->hidden8, n, w->hidden, packed + p.weight, packed + p.bias,
          w->outputs8, to->value);
}

/* Larger of two, or what is no number. */
static inline bool is_more(float a, float b)
{
    return a > b || a != a;
}

static void pool_row(const ascc_tile *tile, const ascc_term *term, const widths *w, size_t row,
                     float *pooled)
{
    const ascc_rows *rows = ascc_term_list(tile->run, term, 0);
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    const size_t count = rows->count[row], b = w->outputs8;
    const batch pairs = batch_in(tile->scratch, w);
    memset(pooled, 0, b * sizeof *pooled);
    for (size_t at = 0, n; at < count; at += n) {
        n = ascc_min_size(BATCH, count - at);
        evaluate(tile->run, term, w, row, neighbor + at, n, &pairs);
        for (size_t k = 0; k < n; k++)
            for (size_t c = 0; c < b; c++) {
                const float value = pairs.value[k * b + c];
                if (is_mean(term))
                    pooled[c] += value;
                else
                    pooled[c] = is_more(value, pooled[c]) ? value : pooled[c];
            }
    }
    for (size_t c = 0; is_mean(term) && count && c < b; c++)
        pooled[c] /= (float)count;
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const widths w = widths_of(tile->run->plan, term);
    float *pooled = batch_in(tile->scratch, &w).end;
    for (size_t r = 0; r < tile->n; r++) {
        float *to = tile->sum + r * tile->width + term->column;
        pool_row(tile, term, &w, tile->list[r], pooled);
        for (size_t c = 0; c < w.outputs; c++)
            to[c] += pooled[c];
    }
}

/* ---- The way back ---- */

/* One row on its way back, in pass->dot. */
typedef struct row_back {
    const ascc_reverse *pass;
    const ascc_term *term;
    widths w;
    batch pairs;
    size_t row, count;
    const uint32_t *neighbor;
    const float *gradient; /* [outputs8] of what was pooled */
    uint32_t *winner;      /* [outputs8] the neighbour that has the maximum, or NOBODY */
    uint32_t *chosen;      /* [room] neighbours with a gradient */
    size_t chosen_count;
    float *by_value;  /* [BATCH][outputs8] */
    float *by_hidden; /* [BATCH][hidden8] */
    float *by_pair;   /* [BATCH][pair8] */
    float *columns;   /* [hidden8 + pair8][BATCH] */
} row_back;

#define NOBODY UINT32_MAX

static row_back open_rows(const ascc_reverse *pass, const ascc_term *term)
{
    row_back b = {.pass = pass, .term = term, .w = widths_of(pass->run->plan, term)};
    b.pairs = batch_in(pass->scratch, &b.w);
    b.winner = (uint32_t *)pass->dot;
    b.chosen = b.winner + b.w.outputs8;
    b.by_value = pass->dot + b.w.outputs8 + pass->room;
    b.by_hidden = b.by_value + BATCH * b.w.outputs8;
    b.by_pair = b.by_hidden + BATCH * b.w.hidden8;
    b.columns = b.by_pair + BATCH * b.w.pair8;
    return b;
}

/* Who has the maximum of each output that has a gradient: the first of the largest, if above 0. */
static void find_winners(const row_back *b)
{
    const size_t width = b->w.outputs8;
    float *best = b->pairs.end;
    memset(best, 0, width * sizeof *best);
    for (size_t c = 0; c < width; c++)
        b->winner[c] = NOBODY;
    for (size_t at = 0, n; at < b->count; at += n) {
        n = ascc_min_size(BATCH, b->count - at);
        evaluate(b->pass->run, b->term, &b->w, b->row, b->neighbor + at, n, &b->pairs);
        for (size_t k = 0; k < n; k++)
            for (size_t c = 0; c < width; c++)
                if (b->gradient[c] != 0.0f && b->pairs.value[k * width + c] > best[c]) {
                    best[c] = b->pairs.value[k * width + c];
                    b->winner[c] = (uint32_t)(at + k);
                }
    }
}

/* Numbers, among the row's neighbours, of those with a gradient. */
static void choose(row_back *b)
{
    const bool all = is_mean(b->term);
    b->chosen_count = 0;
    if (!all)
        find_winners(b);
    for (uint32_t k = 0; k < b->count; k++) {
        bool wins = all;
        for (size_t c = 0; !wins && c < b->w.outputs; c++)
            wins = b->winner[c] == k;
        if (wins)
            b->chosen[b->chosen_count++] = k;
    }
}

/* Gradients of the values of n pairs, of the chosen ones from `at` on. */
static void spread_gradient(const row_back *b, size_t at, size_t n)
{
    const size_t width = b->w.outputs8;
    const float share = 1.0f / (float)b->count;
    for (size_t k = 0; k < n; k++)
        for (size_t c = 0; c < width; c++) {
            const bool takes = is_mean(b->term) ? b->pairs.value[k * width + c] > 0.0f
                                                : b->winner[c] == b->chosen[at + k];
            b->by_value[k * width + c] = !takes             ? 0.0f
                                         : is_mean(b->term) ? b->gradient[c] * share
                                                            : b->gradient[c];
        }
}

/* Gradients of one matrix and its bias: += in[n][a]^T by[n][b8], += by. */
static void add_weights(const row_back *b, const float *in, size_t a8, size_t n, const float *by,
                        size_t b8, float *weight, float *bias)
{
    for (size_t k = 0; k < n; k++)
        for (size_t c = 0; c < a8; c++)
            b->columns[c * BATCH + k] = in[k * a8 + c];
    b->pass->run->tools->kernels->multiply(b->columns, BATCH, a8, n, by, b8, weight, b8);
    for (size_t k = 0; k < n; k++)
        for (size_t c = 0; c < b8; c++)
            bias[c] += by[k * b8 + c];
}

/* to[n][a8] = by[n][b] transposed[b][a8] */
static void go_through(const row_back *b, const float *by, size_t b8, size_t n, size_t inner,
                       const float *transposed, size_t a8, float *to)
{
    memset(to, 0, n * a8 * sizeof *to);
    b->pass->run->tools->kernels->multiply(by, b8, n, inner, transposed, a8, to, a8);
}

/* From the gradient of pairs to features and places. */
static void scatter_pairs(const row_back *b, const uint32_t *neighbor, size_t n)
{
    const ascc_network_run *run = b->pass->run;
    const ascc_rows *rows = ascc_term_list(run, b->term, 0);
    const size_t in = (size_t)b->term->inputs, a = ascc_padded(b->term->inputs);
    float *gradient = ascc_reverse_source(b->pass, b->term);
    float *own =
        gradient && is_relative(b->term) ? gradient + own_row(run, b->term, b->row) * a : NULL;
    for (size_t k = 0; k < n; k++) {
        const float *by = b->by_pair + k * b->w.pair8;
        double r[3], g[3] = {0.0, 0.0, 0.0};
        for (size_t c = 0; gradient && c < in; c++) {
            gradient[neighbor[k] * a + c] += by[c];
            if (own)
                own[c] -= by[c];
        }
        if (!b->pass->pass->seen)
            continue;
        ascc_seen_displacement(run, rows, b->row, neighbor[k], r);
        if (r[0] == 0.0 && r[1] == 0.0 && r[2] == 0.0)
            continue; /* the point itself, or a sample of it that goes where it goes */
        for (size_t c = in; c < b->w.pair; c++)
            g[c - in] = (double)by[c] / b->term->filter.radius;
        ascc_column_add_displacement(b->pass, b->term, b->row, neighbor[k], g);
    }
}

static void back_batch(const row_back *b, size_t at, size_t n)
{
    const weight_places p = find_weights(&b->w);
    const size_t a = b->w.pair8, h = b->w.hidden8, o = b->w.outputs8;
    float *packed = ascc_reverse_packed(b->pass, b->term);
    const float *transposed = ascc_reverse_transposed(b->pass, b->term);
    uint32_t neighbor[BATCH];
    for (size_t k = 0; k < n; k++)
        neighbor[k] = b->neighbor[b->chosen[at + k]];
    evaluate(b->pass->run, b->term, &b->w, b->row, neighbor, n, &b->pairs);
    spread_gradient(b, at, n);
    add_weights(b, b->pairs.hidden, h, n, b->by_value, o, packed + p.weight, packed + p.bias);
    go_through(b, b->by_value, o, n, b->w.outputs, transposed + p.weight, h, b->by_hidden);
    for (size_t i = 0; i < n * h; i++)
        b->by_hidden[i] = b->pairs.hidden[i] > 0.0f ? b->by_hidden[i] : 0.0f;
    add_weights(b, b->pairs.pair, a, n, b->by_hidden, h, packed, packed + p.hidden_bias);
    if (!ascc_reverse_source(b->pass, b->term) && !b->pass->pass->seen)
        return;
    go_through(b, b->by_hidden, h, n, b->w.hidden, transposed, a, b->by_pair);
    scatter_pairs(b, neighbor, n);
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const ascc_rows *rows = ascc_term_list(pass->run, term, 0);
    row_back b = open_rows(pass, term);
    for (size_t r = 0; r < n; r++) {
        b.row = list[r];
        b.count = rows->count[b.row];
        b.neighbor = rows->neighbor + rows->start[b.row];
        b.gradient = pass->tile + r * b.w.outputs8;
        choose(&b);
        for (size_t at = 0; at < b.chosen_count; at += BATCH)
            back_batch(&b, at, ascc_min_size(BATCH, b.chosen_count - at));
    }
}

const ascc_operation ascc_op_abstraction = {.name = "set abstraction",
                                            .type = "set_abstraction",
                                            .read = read_abstraction,
                                            .tensors = tensors,
                                            .check = check,
                                            .initial = fill_initial,
                                            .lists = ascc_convolution_lists,
                                            .packed_size = packed_size,
                                            .pack = pack,
                                            .unpack = unpack,
                                            .transpose = transpose,
                                            .cost = cost,
                                            .scratch = scratch,
                                            .forward = forward,
                                            .backward = backward};
