/* Measures that are sums over particles or over their neighbours. Formulas: docs/measures.md.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

enum { BLOCK = 64 };

static bool alike(const ascc_measure_set *a, const ascc_measure_set *b)
{
    return ascc_measure_valid(a) && ascc_measure_valid(b) && a->dimension == b->dimension;
}

size_t ascc_measure_non_finite(const ascc_measure_set *set)
{
    if (!ascc_measure_valid(set))
        return 0;
    const size_t d = (size_t)set->dimension;
    size_t count = 0;
    for (size_t i = 0; i < set->count; i++)
        count += !ascc_measure_finite(&set->position[i * d], d) ||
                 (set->velocity && !ascc_measure_finite(&set->velocity[i * d], d));
    return count;
}

/* ---- Escapes --------------------------------------------------------------------------------- */

typedef struct escape_job {
    const ascc_measure_set *set;
    const ascc_measure_tree *tree;
    const double *wall, *normal;
    double width;    /* m, over which the weights fall to 0 */
    double *outside; /* [count], m; negative = inside */
    double *nearest; /* [count], m; to a wall point */
} escape_job;

/* Weighted mean of n . (x - w) over the wall points near the nearest one. */
typedef struct wall_mean {
    const escape_job *job;
    const double *point;
    double nearest, sum, weight;
} wall_mean;

static void add_wall(void *data, size_t row, double square)
{
    wall_mean *m = data;
    const size_t d = (size_t)m->job->set->dimension;
    const double t = 1.0 - (sqrt(square) - m->nearest) / m->job->width;
    double along = 0.0;
    for (size_t k = 0; k < d; k++)
        along += m->job->normal[row * d + k] * (m->point[k] - m->job->wall[row * d + k]);
    if (t > 0.0) {
        m->sum += t * t * along;
        m->weight += t * t;
    }
}

static void find_outside(void *data, size_t begin, size_t end)
{
    const escape_job *job = data;
    const size_t d = (size_t)job->set->dimension;
    for (size_t i = begin; i < end; i++) {
        const double *point = &job->set->position[i * d];
        job->outside[i] = -INFINITY;
        if (!ascc_measure_finite(point, d))
            continue;
        wall_mean mean = {job, point, sqrt(ascc_measure_tree_nearest(job->tree, point, SIZE_MAX)),
                          0.0, 0.0};
        const double reach = mean.nearest + job->width;
        ascc_measure_tree_within(job->tree, point, reach * reach, add_wall, &mean);
        job->outside[i] = -mean.sum / mean.weight;
        job->nearest[i] = mean.nearest;
    }
}

ascc_status ascc_measure_escapes(const ascc_measure_set *set, size_t wall_count, const double *wall,
                                 const double *normal, double spacing, int32_t threads,
                                 ascc_measure_escape *escape)
{
    if (!ascc_measure_valid(set) || !escape || !(spacing > 0.0) ||
        (wall_count && (!wall || !normal)))
        return ASCC_ERROR_ARGUMENT;
    memset(escape, 0, sizeof *escape);
    if (!wall_count || !set->count)
        return ASCC_OK;
    if (!ascc_measure_finite(normal, wall_count * (size_t)set->dimension))
        return ASCC_ERROR_NOT_FINITE;
    ascc_measure_tree tree;
    const ascc_status status = ascc_measure_tree_build(&tree, set->dimension, wall_count, wall);
    if (status != ASCC_OK)
        return status;
    escape_job job = {.set = set, .tree = &tree, .wall = wall, .normal = normal};
    job.width = 0.75 * spacing;
    job.outside = malloc(2 * set->count * sizeof *job.outside);
    if (job.outside) {
        job.nearest = job.outside + set->count;
        ascc_measure_parallel(threads, set->count, BLOCK, find_outside, &job);
        for (size_t i = 0; i < set->count; i++)
            if (job.outside[i] > 0.5 * spacing) {
                escape->count++;
                escape->farthest = fmax(escape->farthest, job.nearest[i]);
            }
    }
    ascc_measure_tree_free(&tree);
    free(job.outside);
    return job.outside ? ASCC_OK : ASCC_ERROR_MEMORY;
}

/* ---- Particle by particle -------------------------------------------------------------------- */

static ascc_status compare(const ascc_measure_set *a, const ascc_measure_set *b, double *mean,
                           double *mean_square)
{
    *mean = *mean_square = NAN;
    if (!alike(a, b) || a->count != b->count || !a->count)
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)a->dimension;
    double sum = 0.0, square_sum = 0.0;
    for (size_t i = 0; i < a->count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const double e = a->position[i * d + c] - b->position[i * d + c];
            square += e * e;
        }
        sum += sqrt(square);
        square_sum += square;
    }
    if (!isfinite(square_sum))
        return ASCC_ERROR_NOT_FINITE;
    *mean = sum / (double)a->count;
    *mean_square = square_sum / (double)a->count;
    return ASCC_OK;
}

ascc_status ascc_measure_rmse(const ascc_measure_set *a, const ascc_measure_set *b, double *rmse)
{
    double mean, mean_square;
    if (!rmse)
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = compare(a, b, &mean, &mean_square);
    *rmse = sqrt(mean_square);
    return status;
}

ascc_status ascc_measure_mean_distance(const ascc_measure_set *a, const ascc_measure_set *b,
                                       double *distance)
{
    double mean_square;
    return distance ? compare(a, b, distance, &mean_square) : ASCC_ERROR_ARGUMENT;
}

/* ---- Nearest --------------------------------------------------------------------------------- */

typedef struct nearest_job {
    const ascc_measure_set *from;
    const ascc_measure_tree *to;
    bool skip_self;
    double *distance;
} nearest_job;

static void find_nearest(void *data, size_t begin, size_t end)
{
    const nearest_job *job = data;
    const size_t d = (size_t)job->from->dimension;
    for (size_t i = begin; i < end; i++)
        job->distance[i] = sqrt(ascc_measure_tree_nearest(job->to, &job->from->position[i * d],
                                                          job->skip_self ? i : SIZE_MAX));
}

static ascc_status nearest_in(const ascc_measure_set *from, const ascc_measure_tree *to,
                              int32_t threads, double *distance, double *mean)
{
    if (!ascc_measure_finite(from->position, from->count * (size_t)from->dimension))
        return ASCC_ERROR_NOT_FINITE;
    double *found = distance ? distance : malloc((from->count + 1) * sizeof *found);
    if (!found)
        return ASCC_ERROR_MEMORY;
    nearest_job job = {from, to, false, found};
    ascc_measure_parallel(threads, from->count, BLOCK, find_nearest, &job);
    double sum = 0.0;
    for (size_t i = 0; i < from->count; i++)
        sum += found[i];
    if (mean)
        *mean = sum / (double)from->count;
    if (!distance)
        free(found);
    return ASCC_OK;
}

ascc_status ascc_measure_nearest(const ascc_measure_set *from, const ascc_measure_set *to,
                                 int32_t threads, double *distance, double *mean)
{
    if (mean)
        *mean = NAN;
    if (!alike(from, to) || !from->count || !to->count)
        return ASCC_ERROR_ARGUMENT;
    ascc_measure_tree tree;
    ascc_status status = ascc_measure_tree_build(&tree, to->dimension, to->count, to->position);
    if (status != ASCC_OK)
        return status;
    status = nearest_in(from, &tree, threads, distance, mean);
    ascc_measure_tree_free(&tree);
    return status;
}

ascc_status ascc_measure_chamfer(const ascc_measure_set *a, const ascc_measure_set *b,
                                 int32_t threads, double *a_to_b, double *b_to_a)
{
    if (!a_to_b || !b_to_a)
        return ASCC_ERROR_ARGUMENT;
    *b_to_a = NAN;
    const ascc_status status = ascc_measure_nearest(a, b, threads, NULL, a_to_b);
    return status == ASCC_OK ? ascc_measure_nearest(b, a, threads, NULL, b_to_a) : status;
}

/* ---- Speeds ---------------------------------------------------------------------------------- */

ascc_status ascc_measure_speed_histogram(const ascc_measure_set *set,
                                         uint64_t bins[ASCC_MEASURE_SPEED_BINS])
{
    if (!ascc_measure_valid(set) || !bins || (set->count && !set->velocity))
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)set->dimension;
    memset(bins, 0, ASCC_MEASURE_SPEED_BINS * sizeof *bins);
    if (!ascc_measure_finite(set->velocity, set->count * d))
        return ASCC_ERROR_NOT_FINITE;
    for (size_t i = 0; i < set->count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += set->velocity[i * d + c] * set->velocity[i * d + c];
        const double bin = sqrt(square) / ASCC_MEASURE_SPEED_BIN;
        bins[bin < ASCC_MEASURE_SPEED_BINS - 1 ? (size_t)bin : ASCC_MEASURE_SPEED_BINS - 1]++;
    }
    return ASCC_OK;
}

double ascc_measure_jsd(const uint64_t *a, const uint64_t *b, size_t bins)
{
    double total_a = 0.0, total_b = 0.0, sum = 0.0;
    for (size_t k = 0; k < bins; k++) {
        total_a += (double)a[k];
        total_b += (double)b[k];
    }
    if (!(total_a > 0.0 && total_b > 0.0))
        return NAN;
    for (size_t k = 0; k < bins; k++) {
        const double p = (double)a[k] / total_a, q = (double)b[k] / total_b, m = 0.5 * (p + q);
        sum += 0.5 * ((p > 0.0 ? p * log2(p / m) : 0.0) + (q > 0.0 ? q * log2(q / m) : 0.0));
    }
    return fmax(sum, 0.0);
}

/* ---- Density --------------------------------------------------------------------------------- */

typedef struct density_job {
    const ascc_measure_set *set;
    const ascc_measure_tree *tree[2];
    double square; /* of the radius */
    double *density;
} density_job;

typedef struct density_sum {
    double square, sum;
} density_sum;

static void add_poly6(void *data, size_t row, double square)
{
    density_sum *s = data;
    const double t = 1.0 - square / s->square;
    (void)row;
    s->sum += t * t * t;
}

static void sum_density(void *data, size_t begin, size_t end)
{
    const density_job *job = data;
    const size_t d = (size_t)job->set->dimension;
    for (size_t i = begin; i < end; i++) {
        density_sum s = {job->square, 0.0};
        for (int k = 0; k < 2; k++)
            ascc_measure_tree_within(job->tree[k], &job->set->position[i * d], job->square,
                                     add_poly6, &s);
        job->density[i] = s.sum;
    }
}

ascc_status ascc_measure_density(const ascc_measure_set *set, size_t source_count,
                                 const double *source, double radius, int32_t threads,
                                 double *density)
{
    if (!ascc_measure_valid(set) || !(radius > 0.0) || !density || (source_count && !source))
        return ASCC_ERROR_ARGUMENT;
    ascc_measure_tree fluid, wall;
    ascc_status status = ascc_measure_tree_build(&fluid, set->dimension, set->count, set->position);
    if (status != ASCC_OK)
        return status;
    status = ascc_measure_tree_build(&wall, set->dimension, source_count, source);
    if (status == ASCC_OK) {
        density_job job = {set, {&fluid, &wall}, radius * radius, density};
        ascc_measure_parallel(threads, set->count, BLOCK, sum_density, &job);
        ascc_measure_tree_free(&wall);
    }
    ascc_measure_tree_free(&fluid);
    return status;
}

double ascc_measure_rest_density(int32_t dimension)
{
    const int deep = dimension == 3 ? 2 : 0;
    double sum = 0.0;
    for (int z = -deep; z <= deep; z++)
        for (int y = -2; y <= 2; y++)
            for (int x = -2; x <= 2; x++) {
                const double t = 1.0 - (double)(x * x + y * y + z * z) / 4.0;
                sum += t > 0.0 ? t * t * t : 0.0;
            }
    return sum;
}

ascc_status ascc_measure_compare_density(size_t predicted_count, const double *predicted,
                                         size_t true_count, const double *truth, double rest,
                                         ascc_measure_density_error *error)
{
    if (!error)
        return ASCC_ERROR_ARGUMENT;
    *error = (ascc_measure_density_error){NAN, NAN, NAN, NAN};
    if (!predicted_count || !true_count || !predicted || !truth || !(rest > 0.0))
        return ASCC_ERROR_ARGUMENT;
    double max_p = 0.0, max_t = 0.0, sum_p = 0.0, sum_t = 0.0, sum = 0.0;
    for (size_t i = 0; i < predicted_count; i++) {
        max_p = fmax(max_p, predicted[i]);
        sum_p += predicted[i];
    }
    for (size_t i = 0; i < true_count; i++) {
        max_t = fmax(max_t, truth[i]);
        sum_t += truth[i];
        sum += predicted_count == true_count ? fabs(predicted[i] - truth[i]) : NAN;
    }
    error->maximum = fabs(max_p - max_t) / rest;
    error->mean = fabs(sum_p / (double)predicted_count - sum_t / (double)true_count) / rest;
    error->particle = sum / (double)true_count / rest;
    error->published = fabs(max_p - max_t) / max_t;
    return ASCC_OK;
}

/* ---- Spacing --------------------------------------------------------------------------------- */

typedef struct pairs_job {
    const ascc_measure_set *set;
    const ascc_measure_tree *tree;
    double wide, close, tight; /* squares */
    double *nearest;           /* [count] */
    uint32_t (*count)[3];      /* [count] of wide, close and tight neighbours, itself excluded */
} pairs_job;

typedef struct pairs_row {
    const pairs_job *job;
    size_t row;
    uint32_t *count;
} pairs_row;

static void count_pair(void *data, size_t row, double square)
{
    const pairs_row *r = data;
    if (row == r->row)
        return;
    r->count[0]++;
    r->count[1] += square < r->job->close;
    r->count[2] += square < r->job->tight;
}

static void count_pairs(void *data, size_t begin, size_t end)
{
    const pairs_job *job = data;
    const size_t d = (size_t)job->set->dimension;
    for (size_t i = begin; i < end; i++) {
        const double *point = &job->set->position[i * d];
        pairs_row row = {job, i, job->count[i]};
        memset(row.count, 0, sizeof job->count[i]);
        ascc_measure_tree_within(job->tree, point, job->wide, count_pair, &row);
        job->nearest[i] = sqrt(ascc_measure_tree_nearest(job->tree, point, i));
    }
}

static void sum_pairs(const pairs_job *job, ascc_measure_pair_spacing *pairs)
{
    uint64_t sum[3] = {0};
    pairs->min_distance = INFINITY;
    for (size_t i = 0; i < job->set->count; i++) {
        pairs->min_distance = fmin(pairs->min_distance, job->nearest[i]);
        for (int k = 0; k < 3; k++)
            sum[k] += job->count[i][k];
    }
    pairs->pair_count = sum[0] / 2; /* each was seen from both sides */
    pairs->close_count = sum[1] / 2;
    pairs->tight_count = sum[2] / 2;
    if (sum[0]) {
        pairs->close_fraction = (double)sum[1] / (double)sum[0];
        pairs->tight_fraction = (double)sum[2] / (double)sum[0];
    }
}

ascc_status ascc_measure_pairs(const ascc_measure_set *set, double spacing, int32_t threads,
                               ascc_measure_pair_spacing *pairs)
{
    if (!ascc_measure_valid(set) || !pairs || !(spacing > 0.0))
        return ASCC_ERROR_ARGUMENT;
    memset(pairs, 0, sizeof *pairs);
    pairs->min_distance = NAN;
    ascc_measure_tree tree;
    const ascc_status status =
        ascc_measure_tree_build(&tree, set->dimension, set->count, set->position);
    if (status != ASCC_OK)
        return status;
    pairs_job job = {.set = set,
                     .tree = &tree,
                     .wide = 4.0 * spacing * spacing,
                     .close = 0.25 * spacing * spacing,
                     .tight = 0.04 * spacing * spacing};
    job.nearest = malloc((set->count + 1) * sizeof *job.nearest);
    job.count = malloc((set->count + 1) * sizeof *job.count);
    const bool memory = job.nearest && job.count;
    if (memory) {
        ascc_measure_parallel(threads, set->count, BLOCK, count_pairs, &job);
        sum_pairs(&job, pairs);
    }
    free(job.nearest);
    free(job.count);
    ascc_measure_tree_free(&tree);
    return memory ? ASCC_OK : ASCC_ERROR_MEMORY;
}

/* ---- Energy and momentum --------------------------------------------------------------------- */

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static double length(const double a[3])
{
    return sqrt(dot(a, a));
}

static void add_cross(double sum[3], double scale, const double a[3], const double b[3])
{
    sum[0] += scale * (a[1] * b[2] - a[2] * b[1]);
    sum[1] += scale * (a[2] * b[0] - a[0] * b[2]);
    sum[2] += scale * (a[0] * b[1] - a[1] * b[0]);
}

/* Mass of particle i, its position and velocity with the third component 0 in 2D. */
static double row_of(const ascc_measure_set *set, size_t i, double x[3], double v[3])
{
    const size_t d = (size_t)set->dimension;
    x[2] = v[2] = 0.0;
    for (size_t c = 0; c < d; c++) {
        x[c] = set->position[i * d + c];
        v[c] = set->velocity ? set->velocity[i * d + c] : 0.0;
    }
    return set->mass ? set->mass[i] : set->particle_mass;
}

ascc_status ascc_measure_motion(const ascc_measure_set *set, const double *gravity,
                                ascc_measure_motion_sums *sums)
{
    if (!ascc_measure_valid(set) || !sums)
        return ASCC_ERROR_ARGUMENT;
    memset(sums, 0, sizeof *sums);
    if (ascc_measure_non_finite(set))
        return ASCC_ERROR_NOT_FINITE;
    double g[3] = {0}, x[3], v[3];
    for (int c = 0; c < set->dimension && gravity; c++)
        g[c] = gravity[c];
    for (size_t i = 0; i < set->count; i++) {
        const double m = row_of(set, i, x, v), speed = length(v);
        sums->mass += m;
        for (int c = 0; c < 3; c++) {
            sums->center[c] += m * x[c];
            sums->momentum[c] += m * v[c];
        }
        sums->momentum_scale += m * speed;
        sums->kinetic += 0.5 * m * speed * speed;
        sums->potential -= m * dot(g, x);
        sums->max_speed = fmax(sums->max_speed, speed);
        add_cross(sums->angular, m, x, v);
    }
    for (int c = 0; c < 3 && sums->mass > 0.0; c++)
        sums->center[c] /= sums->mass;
    for (size_t i = 0; i < set->count; i++) {
        const double m = row_of(set, i, x, v);
        const double r[3] = {x[0] - sums->center[0], x[1] - sums->center[1],
                             x[2] - sums->center[2]};
        sums->angular_scale += m * length(r) * length(v);
        add_cross(sums->angular_about_center, m, r, v);
    }
    return ASCC_OK;
}

static double relative(const double a[3], const double b[3], double scale)
{
    const double e[3] = {a[0] - b[0], a[1] - b[1], a[2] - b[2]};
    const double error = length(e);
    return error == 0.0 ? 0.0 : error / scale;
}

double ascc_measure_momentum_error(const ascc_measure_motion_sums *predicted,
                                   const ascc_measure_motion_sums *truth)
{
    return relative(predicted->momentum, truth->momentum, truth->momentum_scale);
}

double ascc_measure_angular_error(const ascc_measure_motion_sums *predicted,
                                  const ascc_measure_motion_sums *truth)
{
    return relative(predicted->angular, truth->angular, truth->angular_scale);
}

double ascc_measure_drift(const double now[3], const double start[3], const double external[3])
{
    const double e[3] = {now[0] - external[0], now[1] - external[1], now[2] - external[2]};
    return relative(e, start, length(start) + 1e-10);
}

double ascc_measure_wall_balance(const double before[3], const double after[3],
                                 const double external[3], const double wall[3])
{
    double given[3], change[3];
    for (int c = 0; c < 3; c++) {
        given[c] = external[c] - wall[c];
        change[c] = after[c] - before[c];
    }
    return relative(given, change, length(external) + length(wall) + length(change));
}

void ascc_measure_subset(size_t count, size_t wanted, size_t *index)
{
    for (size_t k = 0; k < wanted; k++)
        index[k] = (2 * k + 1) * count / (2 * wanted);
}
