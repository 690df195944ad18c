/* Pair by pair from kernel terms to integer impulses. SPDX-License-Identifier: MIT */
#include "antisymmetric.h"

#include <math.h>
#include <string.h>

#define BATCH 64
#define SMALLEST_CHUNK 256
/* Rounds |x| < 2^51 to the nearest integer, ties to even, in any build. */
#define ROUND_MAGIC 6755399441055744.0

typedef struct pair_job {
    const ascc_network_run *run;
    const ascc_rows *rows;
    const ascc_impulse_scale *scale;
    const uint8_t *fluid; /* [set rows] 1 = a fluid particle */
    const double *mass;   /* [set rows] 0 for walls */
    int64_t *sum;         /* [set rows][dimension] */
    float *share;         /* [set rows][8]: what each row gives each bump of a basis, else NULL */
    size_t chunk, phase;
    atomic_uint_least64_t pairs;
    atomic_size_t reach;
    atomic_uint_least64_t bad_row; /* 1 + smallest set row with a value that cannot be held */
} pair_job;

/* Pairs of one row, copied together for the kernel. */
typedef struct batch {
    size_t count;
    uint32_t neighbor[BATCH];
    float geometry[ASCC_GEOMETRY_ARRAYS * BATCH];
    float term[BATCH][4];  /* of a grid: a vector for each pair */
    float strength[BATCH]; /* of a basis: along the line from the row to the neighbour */
} batch;

/* Mass that turns a velocity correction into an impulse: the particles' own if they agree, else twice
 * the reduced mass; a wall counts as the fluid particle's equal (METHOD section 4). */
static double pair_mass(double a, double b)
{
    return a == b || b == 0.0 ? a : 2.0 * (a * b) / (a + b);
}

static bool add_impulse(int64_t *sum, int64_t impulse)
{
    return !__builtin_add_overflow(*sum, impulse, sum);
}

static void note_bad_row(pair_job *job, size_t row)
{
    uint_least64_t seen = atomic_load_explicit(&job->bad_row, memory_order_relaxed);
    while ((seen == 0 || seen > row + 1) &&
           !atomic_compare_exchange_weak_explicit(&job->bad_row, &seen, row + 1,
                                                  memory_order_relaxed, memory_order_relaxed))
        ;
}

/* Displacement from row i to a neighbour in units, and its square. */
static double displacement(const pair_job *job, size_t i, size_t j, double d[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        d[c] = (double)(int32_t)((uint32_t)job->rows->source->low[c][j] -
                                 (uint32_t)job->rows->query->low[c][i]);
        square += d[c] * d[c];
    }
    return square;
}

/* The impulse on row i from neighbour k of the batch in quanta, before rounding. */
static void impulse_of(const pair_job *job, size_t i, const batch *b, size_t k, double impulse[3])
{
    const ascc_plan *plan = job->run->network->plan;
    const size_t j = b->neighbor[k];
    const double mass = pair_mass(job->mass[i], job->mass[j]);
    double t[3] = {0.0, 0.0, 0.0}, d[3];
    if (job->share) {
        const double length = sqrt(displacement(job, i, j, d));
        const double strength = (double)b->strength[k] * job->scale->factor[0];
        for (int c = 0; c < 3; c++)
            t[c] = strength / length * d[c];
    } else {
        for (int c = 0; c < plan->dimension; c++)
            t[c] = (double)b->term[k][c] * job->scale->factor[c];
        if (plan->output.radial) {
            const double square = displacement(job, i, j, d);
            double along = 0.0;
            for (int c = 0; c < 3; c++)
                along += d[c] * t[c];
            for (int c = 0; c < 3; c++)
                t[c] = along / square * d[c];
        }
    }
    for (int c = 0; c < 3; c++)
        impulse[c] = t[c] * mass;
}

/* What the last layer reads. */
static const float *output_values(const ascc_network_run *run)
{
    const ascc_output *output = &run->network->plan->output;
    const ascc_value *value = &run->value[output->source];
    return output->rectify ? value->rectified : value->raw;
}

/* What the kernel gives for each pair of the batch. */
static void evaluate_kernel(const pair_job *job, size_t i, batch *b)
{
    const ascc_network_run *run = job->run;
    const ascc_kernels *kernels = run->tools->kernels;
    const ascc_plan *plan = run->network->plan;
    const ascc_filter *filter = &plan->output.filter;
    const size_t d = (size_t)plan->dimension, a = ascc_padded(plan->output.inputs);
    const float *value = output_values(run);
    const ascc_geometry g =
        ascc_network_geometry(run, job->rows, filter, i, b->neighbor, b->count, b->geometry, BATCH);
    if (job->share)
        kernels->pair_strengths(g.pairs.distance, b->neighbor, b->count,
                                job->share + i * ASCC_MAX_BUMPS, job->share, (size_t)filter->bumps,
                                b->strength);
    else
        kernels->pair_terms(&g.pairs, g.window, b->neighbor, b->count, value + i * a, value, a,
                            filter->cells, run->network->term_weight[plan->term_count], d,
                            b->term[0]);
}

static void flush(pair_job *job, size_t i, batch *b)
{
    const size_t d = (size_t)job->run->network->plan->dimension;
    evaluate_kernel(job, i, b);
    for (size_t k = 0; k < b->count; k++) {
        const size_t j = b->neighbor[k];
        double impulse[3];
        impulse_of(job, i, b, k, impulse);
        for (size_t c = 0; c < d; c++) {
            if (!(fabs(impulse[c]) < ASCC_IMPULSE_LIMIT)) {
                note_bad_row(job, i);
                continue;
            }
            const int64_t quanta = (int64_t)((impulse[c] + ROUND_MAGIC) - ROUND_MAGIC);
            if (!add_impulse(&job->sum[i * d + c], quanta) ||
                !add_impulse(&job->sum[j * d + c], -quanta))
                note_bad_row(job, i);
        }
    }
    b->count = 0;
}

static void evaluate_row(pair_job *job, size_t i, batch *b)
{
    const ascc_rows *rows = job->rows;
    const size_t start = rows->start[i];
    for (size_t k = start; k < start + rows->count[i]; k++) {
        const uint32_t j = rows->neighbor[k];
        if (job->fluid[j] && j <= i)
            continue; /* that pair belongs to row j */
        if (rows->source->low[0][j] == rows->query->low[0][i] &&
            rows->source->low[1][j] == rows->query->low[1][i] &&
            rows->source->low[2][j] == rows->query->low[2][i])
            continue; /* coincident: no direction, no impulse */
        b->neighbor[b->count] = j;
        if (++b->count == BATCH)
            flush(job, i, b);
    }
    if (b->count)
        flush(job, i, b);
}

static void evaluate_chunks(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pair_job *job = data;
    const size_t count = job->rows->query->count;
    for (size_t c = begin; c < end; c++) {
        const size_t first = (c * 3 + job->phase) * job->chunk;
        batch b;
        b.count = 0;
        for (size_t i = first; i < ascc_min_size(first + job->chunk, count); i++)
            if (job->fluid[i])
                evaluate_row(job, i, &b);
    }
}

/* Shares of the rows that are active, stretch by stretch. */
static void compute_shares(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const pair_job *job = data;
    const ascc_network_run *run = job->run;
    const ascc_plan *plan = run->network->plan;
    const size_t a = ascc_padded(plan->output.inputs);
    const uint8_t *active = run->value[plan->output.source].active;
    const float *value = output_values(run);
    memset(job->share + begin * ASCC_MAX_BUMPS, 0,
           (end - begin) * ASCC_MAX_BUMPS * sizeof *job->share);
    for (size_t i = begin, stop; i < end; i = stop) {
        for (stop = i + 1; stop < end && active[i] && active[stop];)
            stop++;
        if (active[i])
            run->tools->kernels->multiply(
                value + i * a, a, stop - i, a, run->network->term_weight[plan->term_count],
                ASCC_MAX_BUMPS, job->share + i * ASCC_MAX_BUMPS, ASCC_MAX_BUMPS);
    }
}

/* Counts the pairs, and how far apart two neighbours are at most in the order of rows. */
static void survey(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pair_job *job = data;
    const ascc_rows *rows = job->rows;
    size_t pairs = 0, reach = 1;
    for (size_t i = begin; i < end; i++)
        for (size_t k = 0; job->fluid[i] && k < rows->count[i]; k++) {
            const size_t j = rows->neighbor[rows->start[i] + k];
            reach = ascc_max_size(reach, j > i ? j - i : i - j);
            pairs += !job->fluid[j] || j > i;
        }
    atomic_fetch_add_explicit(&job->pairs, pairs, memory_order_relaxed);
    size_t seen = atomic_load_explicit(&job->reach, memory_order_relaxed);
    while (seen < reach &&
           !atomic_compare_exchange_weak_explicit(&job->reach, &seen, reach, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
}

/* Host's fluid row of a set row, or fluid_count + boundary row. */
static size_t host_row(const ascc_hierarchy *h, int32_t set, size_t row)
{
    return h->origin[set == ASCC_SET_ALL ? row : h->whole[set][row]];
}

static ascc_status bad_value(const ascc_network_run *run, const float *values, size_t channels,
                             size_t set_row, size_t fluid_row)
{
    bool finite = true;
    for (size_t c = 0; c < channels; c++)
        finite &= isfinite(values[set_row * channels + c]) != 0;
    return ascc_fail(run->tools->message, finite ? ASCC_ERROR_RANGE : ASCC_ERROR_NOT_FINITE,
                     finite ? "the network gives fluid row %zu an impulse too large to hold"
                            : "the network's values for fluid row %zu are not finite",
                     fluid_row);
}

static ascc_status take_job(pair_job *job, int32_t set, const ascc_impulse_scale *scale)
{
    const ascc_hierarchy *h = job->run->hierarchy;
    ascc_arena *arena = job->run->tools->arena;
    const size_t count = h->set[set].count, d = (size_t)job->run->network->plan->dimension;
    uint8_t *fluid = ascc_arena_take(arena, count, 1);
    double *mass = ascc_arena_take(arena, count, sizeof *mass);
    job->sum = ascc_arena_take(arena, count, d * sizeof(int64_t));
    const bool basis = job->run->network->plan->output.filter.bumps > 0;
    if (basis)
        job->share = ascc_arena_take(arena, count, ASCC_MAX_BUMPS * sizeof *job->share);
    if (!fluid || !mass || !job->sum || (basis && !job->share))
        return ascc_fail(job->run->tools->message, ASCC_ERROR_MEMORY, "no memory for the impulses");
    memset(job->sum, 0, count * d * sizeof(int64_t));
    for (size_t i = 0; i < count; i++) {
        const size_t row = host_row(h, set, i);
        fluid[i] = row < h->fluid_count;
        mass[i] = fluid[i] ? scale->mass[row] : 0.0;
    }
    job->fluid = fluid;
    job->mass = mass;
    return ASCC_OK;
}

ascc_status ascc_antisymmetric_impulses(const ascc_network_run *run,
                                        const ascc_impulse_scale *scale,
                                        const ascc_impulses *impulses, uint64_t *pair_count)
{
    const ascc_network *network = run->network;
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t set = ascc_network_set(network, network->plan->output.source);
    const size_t count = h->set[set].count, d = (size_t)network->plan->dimension;
    pair_job job = {.run = run,
                    .rows = &run->rows[network->term_key[network->plan->term_count]],
                    .scale = scale};
    const ascc_status status = take_job(&job, set, scale);
    if (status != ASCC_OK)
        return status;
    if (job.share)
        ascc_workers_run(run->tools->workers, count, 1024, compute_shares, &job);
    ascc_workers_run(run->tools->workers, count, 1024, survey, &job);
    job.chunk = ascc_max_size(atomic_load(&job.reach), SMALLEST_CHUNK);
    const size_t chunks = (count + job.chunk - 1) / job.chunk;
    for (job.phase = 0; job.phase < 3 && job.phase < chunks; job.phase++)
        ascc_workers_run(run->tools->workers, (chunks - job.phase + 2) / 3, 1, evaluate_chunks,
                         &job);
    const uint64_t bad = atomic_load(&job.bad_row);
    if (bad)
        return bad_value(run, output_values(run), ascc_padded(network->plan->output.inputs),
                         (size_t)bad - 1, host_row(h, set, (size_t)bad - 1));
    for (size_t i = 0; i < count; i++) {
        const size_t row = host_row(h, set, i);
        int64_t *to =
            job.fluid[i] ? impulses->fluid + row * d : impulses->wall + (row - h->fluid_count) * d;
        memcpy(to, job.sum + i * d, d * sizeof *to);
    }
    *pair_count = atomic_load(&job.pairs);
    return ASCC_OK;
}

ascc_status ascc_plain_impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                                const ascc_impulses *impulses)
{
    const ascc_network *network = run->network;
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t source = network->plan->output.source;
    const int32_t set = ascc_network_set(network, source);
    const size_t d = (size_t)network->plan->dimension;
    const float *value = output_values(run);
    const size_t a = ascc_padded(network->plan->output.inputs);
    for (size_t i = 0; i < h->fluid_count; i++) {
        const size_t from = set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i];
        const size_t row = host_row(h, set, from);
        for (size_t c = 0; c < d; c++) {
            const double impulse =
                (double)value[from * a + c] * scale->factor[c] * scale->mass[row];
            if (!(fabs(impulse) < ASCC_IMPULSE_LIMIT))
                return bad_value(run, value, a, from, row);
            impulses->fluid[row * d + c] = (int64_t)((impulse + ROUND_MAGIC) - ROUND_MAGIC);
        }
    }
    return ASCC_OK;
}
