/* Earth mover's distance: exact by assignment, and entropic by Sinkhorn's iteration.
 * SPDX-License-Identifier: MIT
 *
 * Exact: Jonker and Volgenant, "A shortest augmenting path algorithm for dense and sparse linear
 * assignment problems" (1987), without the reduction transfer. Entropic: Feydy and others,
 * "Interpolating between optimal transport and MMD using Sinkhorn divergences" (2019).
 */
#include <float.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

/* ---- Exact ----------------------------------------------------------------------------------- */

typedef struct assignment {
    size_t n;
    const ascc_measure_set *a, *b;
    double *cost;     /* [n][n] distances */
    double *price;    /* [n] of columns */
    double *distance; /* [n] shortest path to a column */
    int32_t *column;  /* [n] of a row; -1 = free */
    int32_t *row;     /* [n] of a column; -1 = free */
    int32_t *from;    /* [n] the row before a column on its path */
    int32_t *order;   /* [n] columns: scanned first, then the others */
    int32_t *free_row;
} assignment;

static void fill_cost(void *data, size_t begin, size_t end)
{
    assignment *s = data;
    const size_t d = (size_t)s->a->dimension;
    for (size_t i = begin; i < end; i++)
        for (size_t j = 0; j < s->n; j++) {
            double sum = 0.0;
            for (size_t c = 0; c < d; c++) {
                const double e = s->a->position[i * d + c] - s->b->position[j * d + c];
                sum += e * e;
            }
            s->cost[i * s->n + j] = sqrt(sum);
        }
}

static void match(assignment *s, int32_t row, int32_t column)
{
    s->column[row] = column;
    s->row[column] = row;
}

/* Each column's price is its least cost; its row takes it if it has no column yet. */
static void reduce_columns(assignment *s)
{
    for (size_t j = 0; j < s->n; j++) {
        s->price[j] = s->cost[j];
        s->from[j] = 0;
    }
    for (size_t i = 1; i < s->n; i++)
        for (size_t j = 0; j < s->n; j++)
            if (s->cost[i * s->n + j] < s->price[j]) {
                s->price[j] = s->cost[i * s->n + j];
                s->from[j] = (int32_t)i;
            }
    for (size_t j = 0; j < s->n; j++)
        if (s->column[s->from[j]] < 0)
            match(s, s->from[j], (int32_t)j);
}

/* Free rows bid for their best column up to the second best, and drive out who had it; a row driven
 * out bids next. Returns the number of rows still free. */
static size_t bid(assignment *s, size_t free_count)
{
    size_t next = 0, left = 0, bids = 0;
    while (next < free_count && bids++ < 8 * s->n) {
        const int32_t row = s->free_row[next++];
        const double *cost = &s->cost[(size_t)row * s->n];
        double best = DBL_MAX, second = DBL_MAX;
        size_t best_column = 0, second_column = 0;
        for (size_t j = 0; j < s->n; j++) {
            const double reduced = cost[j] - s->price[j];
            if (reduced < best) {
                second = best;
                second_column = best_column;
                best = reduced;
                best_column = j;
            } else if (reduced < second) {
                second = reduced;
                second_column = j;
            }
        }
        int32_t driven_out = s->row[best_column];
        const bool gains = best < second && s->n > 1;
        if (gains)
            s->price[best_column] -= second - best;
        else if (driven_out >= 0 && s->n > 1) {
            best_column = second_column;
            driven_out = s->row[best_column];
        }
        match(s, row, (int32_t)best_column);
        if (driven_out < 0)
            continue;
        s->column[driven_out] = -1;
        if (gains)
            s->free_row[--next] = driven_out;
        else
            s->free_row[left++] = driven_out;
    }
    while (next < free_count)
        s->free_row[left++] = s->free_row[next++];
    return left;
}

/* Dijkstra from a free row to the nearest free column, then the path changes hands. */
static void augment(assignment *s, int32_t start)
{
    const size_t n = s->n;
    size_t scanned = 0;
    int32_t row = start, column = -1;
    double least = 0.0, base = 0.0;
    for (size_t j = 0; j < n; j++) {
        s->order[j] = (int32_t)j;
        s->distance[j] = DBL_MAX;
    }
    for (;;) {
        const double *cost = &s->cost[(size_t)row * n];
        size_t found = scanned;
        double nearest = DBL_MAX;
        for (size_t k = scanned; k < n; k++) {
            const size_t j = (size_t)s->order[k];
            const double through = cost[j] - s->price[j] - base;
            if (through < s->distance[j]) {
                s->distance[j] = through;
                s->from[j] = row;
            }
            /* Among equals a free column ends the search soonest. */
            if (s->distance[j] < nearest || (s->distance[j] == nearest && s->row[j] < 0)) {
                nearest = s->distance[j];
                found = k;
            }
        }
        column = s->order[found];
        s->order[found] = s->order[scanned];
        s->order[scanned++] = column;
        least = nearest;
        row = s->row[column];
        if (row < 0)
            break;
        base = s->cost[(size_t)row * n + (size_t)column] - s->price[column] - least;
    }
    for (size_t k = 0; k < scanned; k++)
        s->price[s->order[k]] += s->distance[s->order[k]] - least;
    while (column >= 0) {
        row = s->from[column];
        const int32_t freed = s->column[row];
        match(s, row, column);
        column = row == start ? -1 : freed;
    }
}

static void assign(assignment *s)
{
    for (size_t i = 0; i < s->n; i++)
        s->column[i] = s->row[i] = -1;
    reduce_columns(s);
    size_t free_count = 0;
    for (size_t i = 0; i < s->n; i++)
        if (s->column[i] < 0)
            s->free_row[free_count++] = (int32_t)i;
    for (int pass = 0; pass < 2; pass++)
        free_count = bid(s, free_count);
    for (size_t k = 0; k < free_count; k++)
        augment(s, s->free_row[k]);
}

ascc_status ascc_measure_emd_exact(const ascc_measure_set *a, const ascc_measure_set *b,
                                   int32_t threads, double *emd, uint32_t *assigned)
{
    if (!emd)
        return ASCC_ERROR_ARGUMENT;
    *emd = NAN;
    if (!ascc_measure_valid(a) || !ascc_measure_valid(b) || a->dimension != b->dimension ||
        a->count != b->count || !a->count)
        return ASCC_ERROR_ARGUMENT;
    if (a->count > ASCC_MEASURE_EMD_LIMIT)
        return ASCC_ERROR_LIMIT;
    const size_t n = a->count, d = (size_t)a->dimension;
    if (!ascc_measure_finite(a->position, n * d) || !ascc_measure_finite(b->position, n * d))
        return ASCC_ERROR_NOT_FINITE;
    assignment s = {.n = n, .a = a, .b = b};
    double *numbers = malloc((n + 2) * n * sizeof *numbers);
    int32_t *indices = malloc(5 * n * sizeof *indices);
    if (numbers && indices) {
        s.cost = numbers;
        s.price = numbers + n * n;
        s.distance = s.price + n;
        s.column = indices;
        s.row = indices + n;
        s.from = indices + 2 * n;
        s.order = indices + 3 * n;
        s.free_row = indices + 4 * n;
        ascc_measure_parallel(threads, n, 16, fill_cost, &s);
        assign(&s);
        double sum = 0.0;
        for (size_t i = 0; i < n; i++) {
            sum += s.cost[i * n + (size_t)s.column[i]];
            if (assigned)
                assigned[i] = (uint32_t)s.column[i];
        }
        *emd = sum / (double)n;
    }
    const bool memory = numbers && indices;
    free(numbers);
    free(indices);
    return memory ? ASCC_OK : ASCC_ERROR_MEMORY;
}

/* ---- Entropic -------------------------------------------------------------------------------- */

enum { CHUNK = 64, WARM_ITERATIONS = 2 };
/* Terms below exp(-NEGLIGIBLE) of the greatest are left out, a whole chunk at a time. */
static const double NEGLIGIBLE = 45.0;

/* One side: its points as separate coordinates, in an order in which chunks are compact, and its
 * potential. */
typedef struct side {
    size_t count;
    double *x, *y, *z, *potential, *update;
} side;

typedef struct soft_job {
    const side *to, *from;
    double epsilon;
} soft_job;

/* exp(x) for -700 <= x <= 0 within 2e-16 relative: x = k log 2 + r, Taylor to r^13, exponent bits. No
 * branch and no call, so that loops over it vectorise. */
static inline double exp_small(double x)
{
    const double shift = 6755399441055744.0; /* 1.5 * 2^52: the sum's low bits are round(k) */
    const double k = x * 1.4426950408889634 + shift;
    const double whole = k - shift;
    const double r = (x - whole * 6.93147180369123816490e-01) - whole * 1.90821492927058770002e-10;
    double p = 1.0 / 6227020800.0;
    p = p * r + 1.0 / 479001600.0;
    p = p * r + 1.0 / 39916800.0;
    p = p * r + 1.0 / 3628800.0;
    p = p * r + 1.0 / 362880.0;
    p = p * r + 1.0 / 40320.0;
    p = p * r + 1.0 / 5040.0;
    p = p * r + 1.0 / 720.0;
    p = p * r + 1.0 / 120.0;
    p = p * r + 1.0 / 24.0;
    p = p * r + 1.0 / 6.0;
    p = p * r + 0.5;
    p = p * r + 1.0;
    p = p * r + 1.0;
    union {
        double number;
        uint64_t bits;
    } power, result;
    power.number = k;
    result.number = p;
    result.bits += power.bits << 52;
    return result.number;
}

/* update_i = -epsilon log of the mean over j of exp((potential_j - |x_i - y_j|) / epsilon), with a
 * running maximum over chunks. */
static void soft_minimum(void *data, size_t begin, size_t end)
{
    const soft_job *job = data;
    const side *from = job->from;
    const double inverse = 1.0 / job->epsilon;
    for (size_t i = begin; i < end; i++) {
        const double x = job->to->x[i], y = job->to->y[i], z = job->to->z[i];
        double greatest = -DBL_MAX, sum = 0.0, value[CHUNK];
        for (size_t first = 0; first < from->count; first += CHUNK) {
            const size_t count = from->count - first < CHUNK ? from->count - first : CHUNK;
            for (size_t j = 0; j < count; j++) {
                const double ex = from->x[first + j] - x, ey = from->y[first + j] - y,
                             ez = from->z[first + j] - z;
                value[j] =
                    (from->potential[first + j] - sqrt(ex * ex + ey * ey + ez * ez)) * inverse;
            }
            double highest = -DBL_MAX;
            for (size_t j = 0; j < count; j++)
                highest = value[j] > highest ? value[j] : highest;
            if (highest < greatest - NEGLIGIBLE)
                continue;
            highest = highest > greatest ? highest : greatest;
            for (size_t j = 0; j < count; j++) {
                const double e = value[j] - highest;
                value[j] = exp_small(e > -700.0 ? e : -700.0);
            }
            double lane[4] = {0};
            for (size_t j = 0; j < count; j++)
                lane[j % 4] += value[j];
            sum = sum * exp(greatest - highest) + ((lane[0] + lane[1]) + (lane[2] + lane[3]));
            greatest = highest;
        }
        job->to->update[i] = -job->epsilon * (greatest + log(sum / (double)from->count));
    }
}

static void update(const side *to, const side *from, double epsilon, int32_t threads)
{
    soft_job job = {to, from, epsilon};
    ascc_measure_parallel(threads, to->count, 16, soft_minimum, &job);
}

static double mean_of(const double *values, size_t count)
{
    double sum = 0.0;
    for (size_t i = 0; i < count; i++)
        sum += values[i];
    return sum / (double)count;
}

/* Total mass by which the plan's marginal on this side misses, before the update is taken. */
static double residual_of(const side *s, double epsilon)
{
    double sum = 0.0;
    for (size_t i = 0; i < s->count; i++)
        sum += fabs(expm1((s->potential[i] - s->update[i]) / epsilon));
    return sum / (double)s->count;
}

typedef struct schedule {
    double extent, epsilon, tolerance;
    int32_t iterations, threads;
} schedule;

static void take(const side *s)
{
    memcpy(s->potential, s->update, s->count * sizeof *s->potential);
}

/* OT of two different sides: potentials in turn. Ends with b's potential made from a's. */
static double transport(const side *a, const side *b, const schedule *plan, double *residual,
                        int32_t *used)
{
    memset(a->potential, 0, a->count * sizeof *a->potential);
    memset(b->potential, 0, b->count * sizeof *b->potential);
    *residual = INFINITY;
    *used = 0;
    for (double epsilon = plan->extent;; epsilon *= 0.5) {
        const bool last = epsilon <= plan->epsilon;
        if (last)
            epsilon = plan->epsilon;
        for (int32_t k = 0; k < (last ? plan->iterations : WARM_ITERATIONS); k++) {
            update(a, b, epsilon, plan->threads);
            if (last) { /* columns are exact, so rows tell what is missing */
                *residual = k ? residual_of(a, epsilon) : INFINITY;
                *used = k + 1;
            }
            take(a);
            update(b, a, epsilon, plan->threads);
            take(b);
            if (last && *residual <= plan->tolerance)
                break;
        }
        if (last)
            return mean_of(a->potential, a->count) + mean_of(b->potential, b->count);
    }
}

/* OT of a side with itself: one potential, the average of old and new. */
static double transport_self(const side *a, const schedule *plan, double *residual)
{
    memset(a->potential, 0, a->count * sizeof *a->potential);
    *residual = INFINITY;
    for (double epsilon = plan->extent;; epsilon *= 0.5) {
        const bool last = epsilon <= plan->epsilon;
        if (last)
            epsilon = plan->epsilon;
        for (int32_t k = 0; k < (last ? plan->iterations : WARM_ITERATIONS); k++) {
            update(a, a, epsilon, plan->threads);
            if (last)
                *residual = residual_of(a, epsilon);
            for (size_t i = 0; i < a->count; i++)
                a->potential[i] = 0.5 * (a->potential[i] + a->update[i]);
            if (last && *residual <= plan->tolerance)
                break;
        }
        if (last)
            break;
    }
    update(a, a, plan->epsilon, plan->threads);
    return mean_of(a->potential, a->count) + mean_of(a->update, a->count);
}

static ascc_status open_side(side *s, const ascc_measure_set *set)
{
    const size_t n = set->count, d = (size_t)set->dimension;
    ascc_measure_tree tree;
    const ascc_status status =
        ascc_measure_tree_build(&tree, set->dimension, set->count, set->position);
    if (status != ASCC_OK)
        return status;
    s->count = n;
    s->x = calloc(5 * n, sizeof *s->x);
    if (s->x) {
        s->y = s->x + n;
        s->z = s->y + n;
        s->potential = s->z + n;
        s->update = s->potential + n;
        for (size_t i = 0; i < n; i++) {
            s->x[i] = tree.position[i * d];
            s->y[i] = tree.position[i * d + 1];
            s->z[i] = d == 3 ? tree.position[i * d + 2] : 0.0;
        }
    }
    ascc_measure_tree_free(&tree);
    return s->x ? ASCC_OK : ASCC_ERROR_MEMORY;
}

/* Diagonal of the box around both. */
static double extent_of(const ascc_measure_set *a, const ascc_measure_set *b)
{
    const size_t d = (size_t)a->dimension;
    double sum = 0.0;
    for (size_t c = 0; c < d; c++) {
        double low = a->position[c], high = low;
        for (size_t i = 0; i < a->count + b->count; i++) {
            const double x =
                i < a->count ? a->position[i * d + c] : b->position[(i - a->count) * d + c];
            low = fmin(low, x);
            high = fmax(high, x);
        }
        sum += (high - low) * (high - low);
    }
    return sqrt(sum);
}

ascc_status ascc_measure_sinkhorn(const ascc_measure_set *a, const ascc_measure_set *b,
                                  const ascc_measure_sinkhorn_options *options,
                                  ascc_measure_sinkhorn_result *result)
{
    if (!result)
        return ASCC_ERROR_ARGUMENT;
    *result = (ascc_measure_sinkhorn_result){.divergence = NAN, .transport = NAN, .residual = NAN};
    if (!ascc_measure_valid(a) || !ascc_measure_valid(b) || a->dimension != b->dimension ||
        !a->count || !b->count || !options || !(options->epsilon > 0.0) ||
        !(options->tolerance >= 0.0) || options->iterations < 0)
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)a->dimension;
    if (!ascc_measure_finite(a->position, a->count * d) ||
        !ascc_measure_finite(b->position, b->count * d))
        return ASCC_ERROR_NOT_FINITE;
    const schedule plan = {fmax(extent_of(a, b), options->epsilon), options->epsilon,
                           options->tolerance > 0.0 ? options->tolerance : 1e-3,
                           options->iterations ? options->iterations : 1000, options->threads};
    side side_a = {0}, side_b = {0};
    ascc_status status = open_side(&side_a, a);
    if (status == ASCC_OK)
        status = open_side(&side_b, b);
    if (status == ASCC_OK) {
        double residual_a, residual_b;
        const double self_a = transport_self(&side_a, &plan, &residual_a);
        const double self_b = transport_self(&side_b, &plan, &residual_b);
        result->transport =
            transport(&side_a, &side_b, &plan, &result->residual, &result->iterations);
        result->divergence = result->transport - 0.5 * (self_a + self_b);
        result->residual = fmax(result->residual, fmax(residual_a, residual_b));
        status = result->residual <= plan.tolerance ? ASCC_OK : ASCC_ERROR_LIMIT;
    }
    free(side_a.x);
    free(side_b.x);
    return status;
}
