/* A stencil on a lattice: a convolution over a corner and its neighbours on the same level, 3 along each axis,
 * without geometry. SPDX-License-Identifier: MIT
 *
 * Corners that are not there are read as 0. With `relative` the source holds sums over particles and walls
 * (mass, momentum, walls, their normals), and the stencil reads them as seen from the mean motion u of the
 * corners around, so that it is Galilean invariant:
 *
 *     mass m, momentum p, walls b, normals n   ->   m, p - m u, b, n, q - b u    u = sum w p / sum w m
 *
 * with w the binomial weights 1/4, 1/2, 1/4 along each axis, and q the walls' motions, 0 while they rest.
 */
#include <math.h>
#include <string.h>

#include "column.h"
#include "model/cost.h"

#define MOST_TAPS 27

enum { OPTION_SUMS = 3 }; /* relative: the source holds sums */

static bool reads_sums(const ascc_term *term)
{
    return term->option[OPTION_SUMS] != 0.0;
}

static size_t taps_of(const ascc_plan *plan)
{
    return plan->dimension == 2 ? 9 : 27;
}

/* Numbers that a tap reads: the inputs, and of sums the walls' motion besides. */
static int32_t tap_inputs(const ascc_plan *plan, const ascc_term *term)
{
    return term->inputs + (reads_sums(term) ? plan->dimension : 0);
}

static double voxel_of(const ascc_plan *plan, int32_t set)
{
    return plan->level[set - ASCC_SET_LEVEL + 1].voxel;
}

static void read_stencil(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                         ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "kernel");
    name[ASCC_TENSOR_BIAS] = ascc_reader_optional_text(reader, object, "bias");
    term->option[OPTION_SUMS] = ascc_reader_optional_flag(reader, object, "relative");
}

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static ascc_status check_lattice(ascc_plan_builder *builder, const ascc_layer *layer,
                                 const ascc_term *term)
{
    const ascc_plan *plan = &builder->plan;
    const ascc_quoted name = ascc_quote(layer->name);
    const int32_t set = ascc_plan_value_set(builder->layer, term->source);
    if (set != layer->set || set < ASCC_SET_LEVEL)
        return FAIL("layer '%s': a stencil reads the level that it lies on", name.text);
    if (plan->sampling != ASCC_SAMPLING_CORNERS || plan->hysteresis > 0.0 || plan->centroid_anchor)
        return FAIL("layer '%s': a stencil needs levels of 'voxel_corners' at the world's origin, "
                    "without hysteresis",
                    name.text);
    if (voxel_of(plan, set) < 0.5 * plan->spacing)
        return FAIL("layer '%s': a lattice of %g m is finer than half a particle spacing",
                    name.text, voxel_of(plan, set));
    if (reads_sums(term) && (term->inputs != 2 + 2 * plan->dimension || term->rectify))
        return FAIL("layer '%s': a 'relative' stencil reads mass, momentum, walls and normals, %d "
                    "channels without 'relu'",
                    name.text, 2 + 2 * (int)plan->dimension);
    return ASCC_OK;
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    ascc_plan_take_outputs(term, stored[2]);
    wanted[ASCC_TENSOR_WEIGHT] = (ascc_tensor_wanted){
        .dimensions = "taps, inputs, outputs",
        .rank = 3,
        .shape = {taps_of(plan), (size_t)tap_inputs(plan, term), (size_t)term->outputs}};
    ascc_plan_want_bias(term, wanted);
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    const ascc_plan *plan = &builder->plan;
    ascc_term *term = &entry->term;
    const ascc_status status = check_lattice(builder, layer, term);
    if (status != ASCC_OK)
        return status;
    const double voxel = voxel_of(plan, layer->set);
    term->gathered = (int32_t)taps_of(plan) * tap_inputs(plan, term);
    term->filter =
        (ascc_filter){.cells = {1, 1, 1}, .radius = voxel * fmax(1.5, sqrt(plan->dimension))};
    return ASCC_OK;
}

/* Corners one voxel away along each axis, none two. */
static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    const int32_t level = ascc_plan_value_set(plan->layer, term->source);
    (void)set;
    key[0] = (ascc_list_key){.query = level,
                             .source = level,
                             .radius = term->filter.radius,
                             .cube = 1.5 * voxel_of(plan, level)};
    return 1;
}

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    (void)plan;
    return ascc_cost_points(counts, set) * term->gathered * term->outputs;
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)plan;
    sizes->column = ascc_max_size(sizes->column, ascc_matrix_length(term));
}

/* ---- Taps ---- */

/* Rows of the corners around one by tap, x fastest; UINT32_MAX = not there. */
static void find_taps(const ascc_rows *rows, int32_t dimension, int32_t voxel, size_t row,
                      uint32_t *tap)
{
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    for (size_t k = 0; k < rows->count[row]; k++) {
        size_t number = 0;
        for (int c = dimension - 1; c >= 0; c--) {
            const int32_t d = (int32_t)((uint32_t)rows->source->low[c][neighbor[k]] -
                                        (uint32_t)rows->query->low[c][row]);
            number = number * 3 + (d < -voxel / 2 ? 0u : d > voxel / 2 ? 2u : 1u);
        }
        tap[number] = neighbor[k];
    }
}

typedef struct taps_job {
    const ascc_rows *rows;
    int32_t dimension, voxel; /* voxel: units */
    size_t taps;
    uint32_t *table;
} taps_job;

static void fill_table(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const taps_job *job = data;
    memset(job->table + begin * job->taps, 0xff, (end - begin) * job->taps * sizeof *job->table);
    for (size_t i = begin; i < end; i++)
        if (job->rows->count[i] != ASCC_ROW_ABSENT)
            find_taps(job->rows, job->dimension, job->voxel, i, job->table + i * job->taps);
}

static int32_t key_of(const ascc_network_run *run, const ascc_term *term)
{
    return run->network->term_key[ascc_plan_term_number(run->plan, term)][0];
}

/* The table of a level's neighbours, for all stencils on it. */
static ascc_status prepare(const ascc_network_run *run, const ascc_term *term)
{
    const int32_t key = key_of(run, term);
    const ascc_rows *rows = &run->rows[key];
    const int32_t level = ascc_network_set(run->network, term->source);
    taps_job job = {.rows = rows,
                    .dimension = run->plan->dimension,
                    .voxel = (int32_t)(voxel_of(run->plan, level) * run->hierarchy->scale.inverse),
                    .taps = taps_of(run->plan)};
    if (run->table[key])
        return ASCC_OK;
    job.table =
        ascc_arena_take(run->tools->arena, rows->query->count, job.taps * sizeof *job.table);
    if (!job.table)
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for a stencil");
    ascc_workers_run(run->tools->workers, rows->query->count, 256, fill_table, &job);
    run->table[key] = job.table;
    return ASCC_OK;
}

static const uint32_t *taps_around(const ascc_network_run *run, const ascc_term *term, size_t row)
{
    return run->table[key_of(run, term)] + row * taps_of(run->plan);
}

/* The binomial weights of taps. */
static void find_weights(int32_t dimension, float weight[MOST_TAPS])
{
    for (size_t t = 0; t < MOST_TAPS; t++) {
        size_t place = t;
        weight[t] = 1.0f;
        for (int32_t c = 0; c < dimension; c++, place /= 3)
            weight[t] *= place % 3 == 1 ? 0.5f : 0.25f;
    }
}

/* Mean motion of the corners around, and their mean mass. */
static float mean_motion(const ascc_network_run *run, const ascc_term *term, const uint32_t *tap,
                         const float weight[MOST_TAPS], float u[3])
{
    const float *source = ascc_term_source(run, term);
    const size_t a = ascc_padded(term->inputs);
    const int32_t d = run->plan->dimension;
    float mass = 0.0f;
    u[0] = u[1] = u[2] = 0.0f;
    for (size_t t = 0; t < taps_of(run->plan); t++) {
        if (tap[t] == UINT32_MAX)
            continue;
        const float *from = source + tap[t] * a;
        mass += weight[t] * from[0];
        for (int32_t c = 0; c < d; c++)
            u[c] += weight[t] * from[1 + c];
    }
    for (int32_t c = 0; c < d; c++)
        u[c] = mass > 0.0f ? u[c] / mass : 0.0f;
    return mass;
}

/* ---- Columns ---- */

static void gather_row(const ascc_network_run *run, const ascc_term *term, size_t row,
                       const float weight[MOST_TAPS], float *column)
{
    const int32_t d = run->plan->dimension, walls = 1 + d;
    const size_t a = ascc_padded(term->inputs), in = (size_t)term->inputs;
    const size_t step = (size_t)tap_inputs(run->plan, term), taps = taps_of(run->plan);
    const float *source = ascc_term_source(run, term), *drift = run->value[term->source].drift;
    const uint32_t *tap = taps_around(run, term, row);
    float u[3] = {0.0f, 0.0f, 0.0f};
    if (reads_sums(term))
        (void)mean_motion(run, term, tap, weight, u);
    for (size_t i = taps * step; i < ascc_matrix_length(term); i++)
        column[i] = 0.0f;
    for (size_t t = 0; t < taps; t++, column += step) {
        if (tap[t] == UINT32_MAX) {
            memset(column, 0, step * sizeof *column);
            continue;
        }
        const float *from = source + tap[t] * a;
        for (size_t c = 0; c < in; c++)
            column[c] = from[c];
        for (int32_t c = 0; reads_sums(term) && c < d; c++) {
            column[1 + c] = from[1 + c] - from[0] * u[c];
            column[in + (size_t)c] =
                drift ? drift[tap[t] * a + (size_t)(walls + 1 + c)] - from[walls] * u[c]
                      : -(from[walls] * u[c]);
        }
    }
}

static size_t columns(const ascc_tile *tile, const ascc_term *term)
{
    const size_t stride = ascc_matrix_length(term) + ASCC_COLUMN_PADDING;
    float weight[MOST_TAPS];
    find_weights(tile->run->plan->dimension, weight);
    for (size_t r = 0; r < tile->n; r++)
        gather_row(tile->run, term, tile->list[r], weight, tile->column + r * stride);
    return tile->n;
}

/* Values are multiplied where they lie. */
static void multiply_taps(const ascc_tile *tile, const ascc_term *term)
{
    static const float nothing[ASCC_MAX_CHANNELS];
    const ascc_network_run *run = tile->run;
    const size_t a = ascc_padded(term->inputs), taps = taps_of(run->plan);
    const float *source = ascc_term_source(run, term), *in[ASCC_TILE_ROWS * MOST_TAPS];
    for (size_t r = 0; r < tile->n; r++) {
        const uint32_t *tap = taps_around(run, term, tile->list[r]);
        for (size_t t = 0; t < taps; t++)
            in[r * taps + t] = tap[t] == UINT32_MAX ? nothing : source + tap[t] * a;
    }
    run->tools->kernels->multiply_blocks(in, taps, tile->n, (size_t)term->inputs,
                                         ascc_term_packed(run, term), ascc_padded(term->outputs),
                                         tile->sum + term->column, tile->width);
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    const size_t length = ascc_matrix_length(term), stride = length + ASCC_COLUMN_PADDING;
    for (size_t r = 0; r < tile->n; r++)
        ascc_matrix_add_bias(run, term, tile->sum + r * tile->width + term->column);
    if (!reads_sums(term)) {
        multiply_taps(tile, term);
        return;
    }
    (void)columns(tile, term);
    run->tools->kernels->multiply(tile->column, stride, tile->n, length,
                                  ascc_term_packed(run, term), ascc_padded(term->outputs),
                                  tile->sum + term->column, tile->width);
}

/* ---- The way back ---- */

/* From the gradient of a column of sums to the sums: mass, momentum, walls, normals of each tap. */
static void scatter_sums(const ascc_network_run *run, const ascc_term *term, const uint32_t *tap,
                         const float *column_gradient, float *gradient)
{
    const int32_t d = run->plan->dimension, walls = 1 + d;
    const size_t a = ascc_padded(term->inputs), in = (size_t)term->inputs;
    const size_t step = (size_t)tap_inputs(run->plan, term);
    const float *source = ascc_term_source(run, term);
    float u[3], by_u[3] = {0.0f, 0.0f, 0.0f}, along = 0.0f, weights[MOST_TAPS];
    find_weights(d, weights);
    const float mass = mean_motion(run, term, tap, weights, u);
    for (size_t t = 0; t < taps_of(run->plan); t++) {
        if (tap[t] == UINT32_MAX)
            continue;
        const float *g = column_gradient + t * step, *from = source + tap[t] * a;
        float *to = gradient + tap[t] * a;
        for (size_t c = 0; c < in; c++)
            to[c] += g[c];
        for (int32_t c = 0; c < d; c++) {
            to[0] -= g[1 + c] * u[c];
            to[walls] -= g[in + (size_t)c] * u[c];
            by_u[c] -= from[0] * g[1 + c] + from[walls] * g[in + (size_t)c];
        }
    }
    for (int32_t c = 0; c < d; c++)
        along += by_u[c] * u[c];
    for (size_t t = 0; mass > 0.0f && t < taps_of(run->plan); t++) {
        if (tap[t] == UINT32_MAX)
            continue;
        const float weight = weights[t] / mass;
        float *to = gradient + tap[t] * a;
        to[0] -= weight * along;
        for (int32_t c = 0; c < d; c++)
            to[1 + c] += weight * by_u[c];
    }
}

static void scatter_row(const ascc_network_run *run, const ascc_term *term, size_t row,
                        const float *column_gradient, float *gradient)
{
    const size_t a = ascc_padded(term->inputs);
    const uint32_t *tap = taps_around(run, term, row);
    if (reads_sums(term)) {
        scatter_sums(run, term, tap, column_gradient, gradient);
        return;
    }
    for (size_t t = 0; t < taps_of(run->plan); t++, column_gradient += term->inputs)
        for (int32_t c = 0; tap[t] != UINT32_MAX && c < term->inputs; c++)
            gradient[tap[t] * a + (size_t)c] += column_gradient[c];
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const size_t length = ascc_matrix_length(term);
    float *gradient = ascc_reverse_source(pass, term);
    float weight[MOST_TAPS];
    find_weights(pass->run->plan->dimension, weight);
    if (gradient)
        ascc_matrix_back(pass, term, n);
    for (size_t r = 0; r < n; r++) {
        gather_row(pass->run, term, list[r], weight, pass->column);
        ascc_matrix_keep_column(pass, term, r);
        if (gradient)
            scatter_row(pass->run, term, list[r], pass->column_gradient + r * length, gradient);
    }
    ascc_matrix_back_weights(pass, term, n);
}

const ascc_operation ascc_op_stencil = {.name = "stencil",
                                        .type = "stencil",
                                        .read = read_stencil,
                                        .tensors = tensors,
                                        .check = check,
                                        .lists = lists,
                                        ASCC_MATRIX_PACKING,
                                        .cost = cost,
                                        .scratch = scratch,
                                        .columns = columns,
                                        .prepare = prepare,
                                        .reads_drift = reads_sums,
                                        .forward = forward,
                                        .backward = backward};
