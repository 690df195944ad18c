/* Whitens the inputs of first layers, as whitening.h draws it. SPDX-License-Identifier: MIT */
#include "whitening.h"

#include <math.h>
#include <string.h>

#include "network/matrix.h"

#define LONGEST 640    /* columns that are rotated, too: an eigenproblem of a few seconds */
#define ROWS 1000      /* of a layer that are looked at in a frame */
#define SMALL 1e-3     /* beside deviations, in units of the features */
#define CONSTANT 1e-4  /* deviations beside the mean or 1 that are none */
#define SWEEPS 40      /* of Jacobi's rotations; about 10 are enough */
#define ACCURACY 1e-13 /* cosines that count as 0 there */

/* ---- Which terms ---- */

/* Does a value depend on the data alone, and on no weight? */
static bool is_data(const ascc_plan *plan, int32_t value)
{
    if (value < 2)
        return true;
    const ascc_layer *layer = &plan->layer[value - 2];
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
        if (plan->term[t].tensor[ASCC_TENSOR_WEIGHT] || !is_data(plan, plan->term[t].source))
            return false;
    return true;
}

/* The parameters that are these weights, if no other term has them, too. */
static size_t own_parameters(const ascc_model *model, const ascc_trained_tensor *tensor,
                             size_t tensor_count, const float *weights)
{
    int uses = 0;
    for (int32_t t = 0; t <= model->plan.term_count; t++)
        for (int i = 0; i < ASCC_MAX_TENSORS; i++)
            uses += ascc_plan_term(&model->plan, t)->tensor[i] == weights;
    for (size_t i = 0; weights && uses == 1 && i < tensor_count; i++)
        if (model->weights + tensor[i].offset == weights)
            return tensor[i].first;
    return ASCC_WHITENING_NONE;
}

/* A bias that is added to the very rows and columns that the term adds to: its own, or, as terms that look around
 * add to every row, that of another such term. */
static const float *find_bias(const ascc_plan *plan, const ascc_layer *layer, const ascc_term *term)
{
    const float *bias = term->tensor[ASCC_TENSOR_BIAS];
    for (int32_t t = 0; !bias && term->operation->lists && t < layer->term_count; t++) {
        const ascc_term *other = &plan->term[layer->first_term + t];
        if (other->operation->columns && other->operation->lists && other->column == term->column &&
            other->outputs == term->outputs)
            bias = other->tensor[ASCC_TENSOR_BIAS];
    }
    return bias;
}

/* Terms to whiten; with `to` NULL only how many. */
static size_t find_terms(const ascc_model *model, const ascc_trained_tensor *tensor,
                         size_t tensor_count, ascc_whitened_term *to)
{
    const ascc_plan *plan = &model->plan;
    size_t count = 0;
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t t = 0; t < plan->layer[l].term_count; t++) {
            const int32_t number = plan->layer[l].first_term + t;
            const ascc_term *term = &plan->term[number];
            if (!term->operation->columns || !term->tensor[ASCC_TENSOR_WEIGHT] ||
                !is_data(plan, term->source))
                continue;
            const size_t weight =
                own_parameters(model, tensor, tensor_count, term->tensor[ASCC_TENSOR_WEIGHT]);
            if (weight == ASCC_WHITENING_NONE)
                continue;
            if (to)
                to[count] = (ascc_whitened_term){
                    .term = number,
                    .layer = l,
                    .length = ascc_cell_count(&term->filter) * (size_t)term->gathered,
                    .outputs = (size_t)term->outputs,
                    .weight = weight,
                    .bias = own_parameters(model, tensor, tensor_count,
                                           find_bias(plan, &plan->layer[l], term))};
            count++;
        }
    return count;
}

ascc_status ascc_whitening_create(ascc_whitening *w, const ascc_allocator *allocator,
                                  const ascc_model *model, const ascc_trained_tensor *tensor,
                                  size_t tensor_count)
{
    *w = (ascc_whitening){.term_count = 0};
    const size_t count = find_terms(model, tensor, tensor_count, NULL);
    w->term = ascc_allocate(allocator, count, sizeof *w->term);
    if (!w->term)
        return ASCC_ERROR_MEMORY;
    w->term_count = find_terms(model, tensor, tensor_count, w->term);
    for (size_t i = 0; i < w->term_count; i++) {
        ascc_whitened_term *term = &w->term[i];
        term->full = term->length <= LONGEST;
        term->number = w->number_count;
        w->number_count += term->length * (1 + (term->full ? term->length : 1));
        w->matrix_count = ascc_max_size(w->matrix_count, 2 * term->length * term->outputs);
    }
    w->number = ascc_allocate(allocator, w->number_count, sizeof *w->number);
    w->matrix = ascc_allocate(allocator, w->matrix_count, sizeof *w->matrix);
    if (w->number && w->matrix)
        return ASCC_OK;
    ascc_whitening_destroy(w, allocator);
    return ASCC_ERROR_MEMORY;
}

void ascc_whitening_destroy(ascc_whitening *w, const ascc_allocator *allocator)
{
    if (w->term)
        ascc_release(allocator, w->term, w->term_count, sizeof *w->term);
    if (w->number)
        ascc_release(allocator, w->number, w->number_count, sizeof *w->number);
    if (w->matrix)
        ascc_release(allocator, w->matrix, w->matrix_count, sizeof *w->matrix);
    *w = (ascc_whitening){.term_count = 0};
}

/* ---- What columns are like ---- */

/* Sums over the columns of one term. */
typedef struct column_sums {
    double count;
    double *sum, *product; /* [length]; [length][length] above the diagonal, or [length] squares */
    double *column;        /* [2 length] scratch */
} column_sums;

/* Numbers of a covariance, or of squares alone. */
static size_t product_count(const ascc_whitened_term *term)
{
    return term->length * (term->full ? term->length : 1);
}

static void add_column(const ascc_whitened_term *term, column_sums *s)
{
    const size_t n = term->length;
    s->count += 1.0;
    for (size_t i = 0; i < n; i++) {
        const double x = s->column[i];
        if (x == 0.0) /* where no neighbour is: most of a column near walls */
            continue;
        s->sum[i] += x;
        for (size_t j = i; term->full && j < n; j++)
            s->product[i * n + j] += x * s->column[j];
        if (!term->full)
            s->product[i] += x * x;
    }
}

/* Adds the columns of a tile's rows, without padding. */
static void add_tile(const ascc_whitened_term *term, const ascc_term *plan_term,
                     const ascc_tile *tile, column_sums *s)
{
    const size_t cell = (size_t)plan_term->gathered, padded = ascc_padded(plan_term->gathered);
    const size_t stride = ascc_matrix_length(plan_term) + ASCC_COLUMN_PADDING;
    const size_t count = plan_term->operation->columns(tile, plan_term);
    for (size_t r = 0; r < count; r++) {
        for (size_t i = 0; i < term->length; i++)
            s->column[i] = (double)tile->column[r * stride + i / cell * padded + i % cell];
        add_column(term, s);
    }
}

/* Rows of a layer that count, evenly spread if they are many; returns how many. */
static size_t list_rows(const uint8_t *active, size_t rows, uint32_t list[ROWS])
{
    size_t count = 0, listed = 0;
    for (size_t i = 0; i < rows; i++)
        count += active[i];
    const size_t want = ascc_min_size(count, ROWS);
    for (size_t i = 0, k = 0; i < rows && listed < want; i++)
        if (active[i] && k++ == listed * count / want)
            list[listed++] = (uint32_t)i;
    return listed;
}

static ascc_status add_term(const ascc_whitened_term *term, const ascc_network_run *run,
                            ascc_arena *arena, column_sums *s)
{
    const ascc_layer *layer = &run->plan->layer[term->layer];
    const ascc_scratch_sizes sizes = ascc_network_sizes(run, layer);
    uint32_t list[ROWS];
    uint32_t *sequence = ascc_arena_take(arena, sizes.room, sizeof *sequence);
    ascc_tile tile = {
        .run = run,
        .layer = layer,
        .column = ascc_arena_take(arena, ASCC_TILE_ROWS * (sizes.column + ASCC_COLUMN_PADDING),
                                  sizeof(float)),
        .scratch = ascc_arena_take(arena, sizes.scratch, sizeof(float)),
        .room = sizes.room,
        .sequence = sequence};
    if (!sequence || !tile.column || !tile.scratch)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < sizes.room; i++)
        sequence[i] = (uint32_t)i;
    const size_t rows = ascc_network_rows(run, layer->set);
    const size_t count = list_rows(run->value[term->layer + 2].active, rows, list);
    for (size_t at = 0; at < count; at += tile.n) {
        tile.list = list + at;
        tile.n = ascc_min_size(ASCC_TILE_ROWS, count - at);
        add_tile(term, &run->plan->term[term->term], &tile, s);
    }
    return ASCC_OK;
}

static ascc_status add_frame(const ascc_whitening *w, ascc_rollout_worker *worker,
                             const ascc_rollout_task *task, column_sums *sums)
{
    ascc_status status = ascc_rollout_look(worker, task);
    if (status != ASCC_OK)
        return status == ASCC_ERROR_MEMORY ? status : ASCC_OK;
    for (size_t i = 0; i < w->term_count && status == ASCC_OK; i++) {
        ascc_arena_reset(&worker->scratch);
        status = add_term(&w->term[i], &worker->state[0].run, &worker->scratch, &sums[i]);
    }
    return status;
}

/* ---- From moments to a transform ---- */

/* Rotates rows p and q of a[n][n] so that they become orthogonal; false if they are. */
static bool rotate_rows(double *p, double *q, size_t n)
{
    double pp = 0.0, qq = 0.0, pq = 0.0;
    for (size_t i = 0; i < n; i++) {
        pp += p[i] * p[i];
        qq += q[i] * q[i];
        pq += p[i] * q[i];
    }
    if (fabs(pq) <= ACCURACY * sqrt(pp * qq))
        return false;
    const double half = (qq - pp) / (2.0 * pq);
    const double tangent = (half < 0.0 ? -1.0 : 1.0) / (fabs(half) + sqrt(1.0 + half * half));
    const double cosine = 1.0 / sqrt(1.0 + tangent * tangent), sine = cosine * tangent;
    for (size_t i = 0; i < n; i++) {
        const double a = p[i], b = q[i];
        p[i] = cosine * a - sine * b;
        q[i] = sine * a + cosine * b;
    }
    return true;
}

/* Of a symmetric, positive a[n][n]: row k becomes the k-th eigenvector times its eigenvalue (Hestenes:
 * rotations V^T with orthogonal rows of V^T a = diag(e) V^T). */
static void find_eigenvectors(double *a, size_t n)
{
    bool rotated = true;
    for (int sweep = 0; rotated && sweep < SWEEPS; sweep++) {
        rotated = false;
        for (size_t p = 0; p < n; p++)
            for (size_t q = p + 1; q < n; q++)
                rotated |= rotate_rows(a + p * n, a + q * n, n);
    }
}

void ascc_whitening_transform(double *a, size_t n, double *scale, double *transform)
{
    double *variance = scale + n; /* of what comes out */
    for (size_t i = 0; i < n; i++) {
        scale[i] = a[i * n + i] > 0.0 ? 1.0 / (sqrt(a[i * n + i]) + SMALL) : 0.0;
        variance[i] = 0.0;
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            a[i * n + j] =
                scale[i] * a[i * n + j] * scale[j] + (i == j ? ASCC_WHITENING_FLOOR : 0.0);
    find_eigenvectors(a, n);
    memset(transform, 0, n * n * sizeof *transform);
    for (size_t k = 0; k < n; k++) {
        const double *row = a + k * n; /* e v */
        double square = 0.0;
        for (size_t i = 0; i < n; i++)
            square += row[i] * row[i];
        const double e = sqrt(square), share = fmax(e - ASCC_WHITENING_FLOOR, 0.0) / e / square;
        for (size_t i = 0; i < n; i++) {
            const double factor = row[i] / (square * sqrt(e));
            variance[i] += share * row[i] * row[i];
            for (size_t j = 0; j < n; j++)
                transform[i * n + j] += factor * row[j];
        }
    }
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j < n; j++)
            transform[i * n + j] = scale[i] > 0.0 && scale[j] > 0.0
                                       ? scale[i] * transform[i * n + j] / sqrt(variance[j])
                                       : (i == j ? 1.0 : 0.0);
}

/* Sums become moments: the mean in `sum` (0 without a bias), the covariance or squares in `product`. What does
 * not vary has none, and no mean. */
static void find_moments(const ascc_whitened_term *term, column_sums *s)
{
    const size_t n = term->length, step = term->full ? n + 1 : 1;
    const double share = s->count > 0.0 ? 1.0 / s->count : 0.0;
    for (size_t i = 0; i < n; i++)
        s->sum[i] *= term->bias == ASCC_WHITENING_NONE ? 0.0 : share;
    for (size_t i = 0; i < n; i++) {
        double *variance = &s->product[i * step];
        const double least = CONSTANT * fmax(1.0, fabs(s->sum[i]));
        *variance = share * *variance - s->sum[i] * s->sum[i];
        if (*variance <= least * least)
            *variance = 0.0;
    }
    for (size_t i = 0; term->full && i < n; i++)
        for (size_t j = i + 1; j < n; j++) {
            const bool vary = s->product[i * step] > 0.0 && s->product[j * step] > 0.0;
            const double covariance = share * s->product[i * n + j] - s->sum[i] * s->sum[j];
            s->product[i * n + j] = s->product[j * n + i] = vary ? covariance : 0.0;
        }
    for (size_t i = 0; i < n; i++)
        if (s->product[i * step] == 0.0)
            s->sum[i] = 0.0;
}

/* number[] = m and T. transform: [length][length], column: [2 length]. */
static void finish_term(const ascc_whitened_term *term, column_sums *s, double *transform,
                        float *number)
{
    const size_t n = term->length;
    find_moments(term, s);
    if (term->full)
        ascc_whitening_transform(s->product, n, s->column, transform);
    for (size_t i = 0; i < n && !term->full; i++)
        transform[i] = s->product[i] > 0.0 ? 1.0 / sqrt(s->product[i]) : 1.0;
    for (size_t i = 0; i < n; i++)
        number[i] = (float)s->sum[i];
    for (size_t i = 0; i < product_count(term); i++)
        number[n + i] = (float)transform[i];
}

/* Doubles for the sums of all terms, and for one transform. */
static size_t count_doubles(const ascc_whitening *w, size_t *longest)
{
    size_t count = 0;
    *longest = 0;
    for (size_t i = 0; i < w->term_count; i++) {
        count += 3 * w->term[i].length + product_count(&w->term[i]);
        *longest = ascc_max_size(*longest, product_count(&w->term[i]));
    }
    return count + *longest;
}

ascc_status ascc_whitening_measure(ascc_whitening *w, ascc_rollout_worker *worker,
                                   const ascc_rollout_task *task, size_t task_count)
{
    const ascc_allocator *allocator = &worker->context->allocator;
    size_t longest;
    const size_t doubles = count_doubles(w, &longest);
    column_sums *sums = ascc_allocate(allocator, w->term_count, sizeof *sums);
    double *block = ascc_allocate(allocator, doubles, sizeof *block);
    ascc_status status = sums && block ? ASCC_OK : ASCC_ERROR_MEMORY;
    if (block)
        memset(block, 0, doubles * sizeof *block);
    double *at = block + longest; /* the transform comes first */
    for (size_t i = 0; status == ASCC_OK && i < w->term_count; i++) {
        const size_t n = w->term[i].length;
        sums[i] = (column_sums){.sum = at, .column = at + n, .product = at + 3 * n};
        at += 3 * n + product_count(&w->term[i]);
    }
    for (size_t i = 0; status == ASCC_OK && i < task_count; i++)
        status = add_frame(w, worker, &task[i], sums);
    for (size_t i = 0; status == ASCC_OK && i < w->term_count; i++)
        finish_term(&w->term[i], &sums[i], block, w->number + w->term[i].number);
    w->ready = status == ASCC_OK;
    if (block)
        ascc_release(allocator, block, doubles, sizeof *block);
    if (sums)
        ascc_release(allocator, sums, w->term_count, sizeof *sums);
    return status;
}

/* ---- There and back ---- */

/* matrix[length][outputs] = T^T from[length][outputs], or T from[]. */
static void multiply(const ascc_whitening *w, const ascc_whitened_term *term, bool transposed,
                     const double *from, double *matrix)
{
    const size_t n = term->length, b = term->outputs;
    const float *transform = w->number + term->number + n;
    memset(matrix, 0, n * b * sizeof *matrix);
    for (size_t i = 0; i < n; i++)
        for (size_t k = 0; k < n; k++) {
            if (!term->full && i != k)
                continue;
            const double factor = (double)transform[!term->full  ? i
                                                    : transposed ? k * n + i
                                                                 : i * n + k];
            for (size_t o = 0; o < b; o++)
                matrix[i * b + o] += factor * from[k * b + o];
        }
}

void ascc_whitening_gradient(const ascc_whitening *w, float *gradient)
{
    for (size_t t = 0; t < w->term_count; t++) {
        const ascc_whitened_term *term = &w->term[t];
        const size_t n = term->length, b = term->outputs;
        const float *mean = w->number + term->number;
        double *own = w->matrix, *white = w->matrix + n * b;
        float *weight = gradient + term->weight;
        for (size_t i = 0; i < n * b; i++)
            own[i] = (double)weight[i];
        for (size_t i = 0; i < n * b && term->bias != ASCC_WHITENING_NONE; i++)
            own[i] -= (double)mean[i / b] * (double)gradient[term->bias + i % b];
        multiply(w, term, true, own, white);
        for (size_t i = 0; i < n * b; i++)
            weight[i] = (float)white[i];
    }
}

void ascc_whitening_step(const ascc_whitening *w, double *step)
{
    for (size_t t = 0; t < w->term_count; t++) {
        const ascc_whitened_term *term = &w->term[t];
        const size_t n = term->length, b = term->outputs;
        const float *mean = w->number + term->number;
        double *weight = step + term->weight;
        multiply(w, term, false, weight, w->matrix);
        memcpy(weight, w->matrix, n * b * sizeof *weight);
        for (size_t i = 0; i < n * b && term->bias != ASCC_WHITENING_NONE; i++)
            step[term->bias + i % b] -= (double)mean[i / b] * weight[i];
    }
}
