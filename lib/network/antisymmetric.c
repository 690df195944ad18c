/* Pair by pair from kernel terms to integer impulses. SPDX-License-Identifier: MIT */
#include "antisymmetric.h"

#include <math.h>
#include <string.h>

#define BATCH 64
#define SMALLEST_CHUNK 256
/* Where a wall's sum of impulses is called full: one more pair cannot overflow it. */
#define ASCC_WALL_LIMIT ((int64_t)1 << 62)
/* Rounds |x| < 2^51 to the nearest integer, ties to even, in any build. */
#define ROUND_MAGIC 6755399441055744.0

typedef struct pair_job {
    const ascc_network_run *run;
    const ascc_rows *rows;
    const ascc_impulse_scale *scale;
    const uint8_t *fluid; /* [set rows] 1 = a fluid particle */
    const double *mass;   /* [set rows] 0 for walls */
    bool uniform;         /* all fluid particles have one mass */
    int64_t *sum;         /* [set rows][stride] */
    bool direct;          /* terms of a grid become impulses in the kernel table */
    size_t stride;        /* 4 if direct, else the dimension */
    /* What each row gives each bump of a part of a basis, [set rows][8], else NULL */
    float *share[ASCC_PARTS];
    const double *place; /* [set rows][3] positions that directions come from, else NULL */
    int64_t *wall;       /* [boundary rows of the host][dimension] */
    size_t chunk, phase;
    atomic_uint_least64_t pairs;
    atomic_size_t reach;           /* rows that neighbours are apart at most */
    atomic_uint_least64_t bad_row; /* 1 + smallest set row with a value that cannot be held */
} pair_job;

/* Pairs of one row, copied together for the kernel. */
typedef struct batch {
    size_t count;
    size_t pairs; /* so far, of all batches */
    uint32_t neighbor[BATCH];
    float geometry[ASCC_GEOMETRY_ARRAYS * BATCH];
    float term[BATCH][4];  /* of a grid: a vector for each pair */
    float strength[BATCH]; /* of a basis: along the line from the row to the neighbour */
    float damping[BATCH];
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

/* Displacements from row i to the batch's neighbours and their squares: at their places, in the host's
 * unit, or as the network sees them, in units (place NULL). */
static void displacements(const ascc_rows *rows, const double *place, size_t i, const batch *b,
                          double d[3][BATCH], double square[BATCH])
{
    for (size_t k = 0; k < b->count; k++)
        square[k] = 0.0;
    for (size_t c = 0; c < 3; c++) {
        const int32_t *source = rows->source->low[c];
        const uint32_t here = (uint32_t)rows->query->low[c][i];
        for (size_t k = 0; k < b->count; k++) {
            const size_t j = b->neighbor[k];
            d[c][k] = place ? place[j * 3 + c] - place[i * 3 + c]
                            : (double)(int32_t)((uint32_t)source[j] - here);
            square[k] += d[c][k] * d[c][k];
        }
    }
}

/* Terms turned to lie along the lines between the particles. */
static void make_central(const pair_job *job, size_t i, const batch *b, double t[3][BATCH])
{
    double d[3][BATCH], square[BATCH];
    displacements(job->rows, NULL, i, b, d, square);
    for (size_t k = 0; k < b->count; k++) {
        const double along = d[0][k] * t[0][k] + d[1][k] * t[1][k] + d[2][k] * t[2][k];
        const double share = along / square[k];
        for (int c = 0; c < 3; c++)
            t[c][k] = share * d[c][k];
    }
}

/* Strengths times the cosine between the line before the step, d of these squares, and the line that the
 * network sees. */
static void turn_strengths(const pair_job *job, size_t i, batch *b, double d[3][BATCH],
                           const double square[BATCH])
{
    double seen[3][BATCH], seen_square[BATCH];
    displacements(job->rows, NULL, i, b, seen, seen_square);
    for (size_t k = 0; k < b->count; k++) {
        const double lengths = sqrt(seen_square[k] * square[k]);
        const double along = d[0][k] * seen[0][k] + d[1][k] * seen[1][k] + d[2][k] * seen[2][k];
        b->strength[k] *= lengths > 0.0 ? (float)(along / lengths) : 0.0f;
    }
}

/* Strengths along the lines d, of these squares, become vectors, damping and limit included. Particles at
 * one place have no line. Walls do not move. */
static void point_strengths(const pair_job *job, size_t i, const batch *b, bool damped, bool fluid,
                            const double square[BATCH], double t[3][BATCH])
{
    const ascc_plan *plan = job->run->network->plan;
    const int32_t d = plan->dimension;
    const double factor = job->scale->factor[0];
    const double limit = ascc_output_limit(&plan->output);
    const size_t width = ascc_padded(plan->fluid_channels);
    const float *motion = damped ? job->run->value[0].raw + ascc_plan_motion(plan, 0) : NULL;
    const float *own = damped ? motion + i * width : NULL;
    for (size_t k = 0; k < b->count; k++) {
        const double length = sqrt(square[k]), inverse = length > 0.0 ? 1.0 / length : 0.0;
        double strength = (double)b->strength[k];
        if (damped) {
            const float *other = fluid ? motion + b->neighbor[k] * width : NULL;
            double approach = 0.0;
            for (int32_t c = 0; c < d; c++)
                approach += ((double)own[c] - (other ? (double)other[c] : 0.0)) * t[c][k];
            strength -= (double)b->damping[k] * (approach * inverse);
        }
        strength = strength > limit ? limit : strength < -limit ? -limit : strength;
        const double share = strength * factor * inverse;
        for (int c = 0; c < 3; c++)
            t[c][k] *= share;
    }
}

/* Impulses on row i from the neighbours of the batch in quanta, before rounding. */
static void impulses_of(const pair_job *job, size_t i, batch *b, double t[3][BATCH])
{
    const ascc_plan *plan = job->run->network->plan;
    const double *factor = job->scale->factor;
    if (job->share[0]) {
        double square[BATCH];
        displacements(job->rows, job->place, i, b, t, square);
        if (job->place)
            turn_strengths(job, i, b, t, square);
        point_strengths(job, i, b, job->share[ASCC_PART_DAMPING] != NULL, true, square, t);
    } else {
        for (int c = 0; c < 3; c++)
            for (size_t k = 0; k < b->count; k++)
                t[c][k] = c < plan->dimension ? (double)b->term[k][c] * factor[c] : 0.0;
        if (plan->output.radial)
            make_central(job, i, b, t);
    }
    double mass[BATCH];
    for (size_t k = 0; k < b->count; k++)
        mass[k] = job->uniform ? job->mass[i] : pair_mass(job->mass[i], job->mass[b->neighbor[k]]);
    for (int c = 0; c < 3; c++)
        for (size_t k = 0; k < b->count; k++)
            t[c][k] *= mass[k];
}

/* Nearest integers, ties to even: the low bits of x + 1.5 * 2^52 for |x| < 2^51. False when a value
 * is beyond what one pair may give. */
static bool round_all(const double *x, size_t count, int64_t *quanta)
{
    int64_t zero;
    const double magic = ROUND_MAGIC;
    memcpy(&zero, &magic, sizeof zero);
    int good = 1;
    for (size_t k = 0; k < count; k++) {
        const double shifted = x[k] + ROUND_MAGIC;
        int64_t bits;
        memcpy(&bits, &shifted, sizeof bits);
        quanta[k] = bits - zero;
        good &= fabs(x[k]) < ASCC_IMPULSE_LIMIT;
    }
    return good;
}

/* What the last layer reads. */
static const float *output_values(const ascc_network_run *run)
{
    const ascc_output *output = &run->network->plan->output;
    const ascc_value *value = &run->value[output->source];
    return output->rectify ? value->rectified : value->raw;
}

/* Fills the batch up to whole vectors, so that no pair is mapped on its own; returns the count. */
static size_t fill_up(batch *b)
{
    size_t count = b->count;
    for (; count % 8; count++)
        b->neighbor[count] = b->neighbor[0];
    return count;
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
    const ascc_geometry g = ascc_network_geometry(run, job->rows, filter, i, b->neighbor,
                                                  fill_up(b), b->geometry, BATCH);
    for (int part = 0; part <= ASCC_PART_DAMPING; part++)
        if (job->share[part])
            kernels->pair_strengths(g.pairs.distance, b->neighbor, b->count,
                                    job->share[part] + i * ASCC_MAX_BUMPS, job->share[part],
                                    (size_t)filter->bumps, part ? b->damping : b->strength);
    if (!job->share[0])
        kernels->pair_terms(&g.pairs, g.window, b->neighbor, b->count, value + i * a, value, a,
                            filter->cells, run->network->term_weight[plan->term_count], d,
                            b->term[0]);
}

/* Impulses of a grid's terms, where nothing turns them. */
static void give_terms(pair_job *job, size_t i, batch *b)
{
    const double *scale = job->scale->factor;
    const size_t d = (size_t)job->run->network->plan->dimension;
    const double factor[4] = {scale[0], scale[1], d > 2 ? scale[2] : 0.0, 0.0};
    double mass[BATCH];
    mass[0] = job->mass[i];
    for (size_t k = 0; k < b->count && !job->uniform; k++)
        mass[k] = pair_mass(job->mass[i], job->mass[b->neighbor[k]]);
    if (!job->run->tools->kernels->pair_impulses(b->term[0], factor, mass, !job->uniform,
                                                 ASCC_IMPULSE_LIMIT, b->neighbor, b->count,
                                                 job->sum + i * 4, job->sum))
        note_bad_row(job, i);
    b->count = 0;
}

static void flush(pair_job *job, size_t i, batch *b)
{
    const size_t d = (size_t)job->run->network->plan->dimension;
    double impulse[3][BATCH];
    int64_t quanta[BATCH];
    b->pairs += b->count;
    evaluate_kernel(job, i, b);
    if (job->direct) {
        give_terms(job, i, b);
        return;
    }
    impulses_of(job, i, b, impulse);
    for (size_t c = 0; c < d; c++) {
        if (!round_all(impulse[c], b->count, quanta)) {
            note_bad_row(job, i);
            break;
        }
        int64_t own = 0; /* 64 impulses below 2^50 */
        bool good = true;
        for (size_t k = 0; k < b->count; k++) {
            own += quanta[k];
            good &= add_impulse(&job->sum[b->neighbor[k] * job->stride + c], -quanta[k]);
        }
        if (!add_impulse(&job->sum[i * job->stride + c], own) || !good)
            note_bad_row(job, i);
    }
    b->count = 0;
}

static void evaluate_row(pair_job *job, size_t i, batch *b)
{
    const ascc_rows *rows = job->rows;
    const size_t start = rows->start[i];
    for (size_t k = start; k < start + rows->count[i]; k++) {
        const uint32_t j = rows->neighbor[k];
        if (j <= i && job->fluid[j])
            continue; /* that pair belongs to row j */
        if (!job->place && rows->source->low[0][j] == rows->query->low[0][i] &&
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
        b.count = b.pairs = 0;
        for (size_t i = first; i < ascc_min_size(first + job->chunk, count); i++)
            if (job->fluid[i])
                evaluate_row(job, i, &b);
        atomic_fetch_add_explicit(&job->pairs, b.pairs, memory_order_relaxed);
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
    for (size_t i = begin, stop; i < end; i = stop) {
        for (stop = i + 1; stop < end && active[i] && active[stop];)
            stop++;
        for (int part = 0; part < ASCC_PARTS; part++) {
            float *share = job->share[part] ? job->share[part] + i * ASCC_MAX_BUMPS : NULL;
            if (share)
                memset(share, 0, (stop - i) * ASCC_MAX_BUMPS * sizeof *share);
            if (share && active[i])
                run->tools->kernels->multiply(value + i * a, a, stop - i, a,
                                              run->network->part_weight[part], ASCC_MAX_BUMPS,
                                              share, ASCC_MAX_BUMPS);
        }
    }
}

/* ---- Walls: pairs of a fluid particle and a wall ---- */

/* Adds to a wall that several threads may push at once: integers, so their order does not matter.
 * False when the sum comes near what can be held. */
static bool push_wall(int64_t *sum, int64_t impulse)
{
    const int64_t before = __atomic_fetch_add(sum, impulse, __ATOMIC_RELAXED);
    return before < ASCC_WALL_LIMIT && before > -ASCC_WALL_LIMIT;
}

/* From row i to host's boundary rows wall[]. */
static void flush_walls(pair_job *job, size_t i, const size_t *wall, batch *b)
{
    static const float nothing[ASCC_MAX_BUMPS];
    static const uint32_t nobody[BATCH];
    const ascc_network_run *run = job->run;
    const ascc_plan *plan = run->network->plan;
    const size_t d = (size_t)plan->dimension;
    double t[3][BATCH], square[BATCH];
    int64_t quanta[BATCH];
    const ascc_geometry g = ascc_network_geometry(run, job->rows, &plan->output.walls.filter, i,
                                                  b->neighbor, b->count, b->geometry, BATCH);
    for (int part = ASCC_PART_WALL; part <= ASCC_PART_WALL_DAMPING; part++)
        if (job->share[part])
            run->tools->kernels->pair_strengths(g.pairs.distance, nobody, b->count,
                                                job->share[part] + i * ASCC_MAX_BUMPS, nothing,
                                                (size_t)plan->output.walls.filter.bumps,
                                                part == ASCC_PART_WALL ? b->strength : b->damping);
    displacements(job->rows, NULL, i, b, t, square);
    point_strengths(job, i, b, job->share[ASCC_PART_WALL_DAMPING] != NULL, false, square, t);
    bool good = true;
    for (size_t c = 0; c < d; c++) {
        for (size_t k = 0; k < b->count; k++)
            t[c][k] *= job->mass[i];
        good &= round_all(t[c], b->count, quanta);
        for (size_t k = 0; k < b->count && good; k++)
            good = add_impulse(&job->sum[i * job->stride + c], quanta[k]) &&
                   push_wall(&job->wall[wall[k] * d + c], -quanta[k]);
    }
    if (!good)
        note_bad_row(job, i);
    b->pairs += b->count;
    b->count = 0;
}

static void evaluate_walls(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pair_job *job = data;
    const ascc_rows *rows = job->rows;
    const ascc_hierarchy *h = job->run->hierarchy;
    size_t wall[BATCH];
    batch b;
    b.count = b.pairs = 0;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *neighbor = rows->neighbor + rows->start[i];
        for (size_t k = 0; k < rows->count[i]; k++) {
            wall[b.count] = h->origin[h->whole[ASCC_SET_BOUNDARY][neighbor[k]]] - h->fluid_count;
            b.neighbor[b.count] = neighbor[k];
            if (++b.count == BATCH)
                flush_walls(job, i, wall, &b);
        }
        if (b.count)
            flush_walls(job, i, wall, &b);
    }
    atomic_fetch_add_explicit(&job->pairs, b.pairs, memory_order_relaxed);
}

/* The farthest that two neighbours are apart in the order of rows. Where slots are rows, neighbours
 * ascend, so the first and the last tell. */
static void measure_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pair_job *job = data;
    const ascc_rows *rows = job->rows;
    const bool ascending = rows->source_grid->order == NULL;
    size_t reach = 1;
    for (size_t i = begin; i < end; i++) {
        if (!job->fluid[i])
            continue;
        const uint32_t *neighbor = rows->neighbor + rows->start[i];
        const size_t count = rows->count[i], stride = ascending && count > 1 ? count - 1 : 1;
        for (size_t k = 0; k < count; k += stride) {
            const size_t j = neighbor[k], apart = j > i ? j - i : i - j;
            reach = apart > reach ? apart : reach;
        }
    }
    size_t seen = atomic_load_explicit(&job->reach, memory_order_relaxed);
    while (seen < reach &&
           !atomic_compare_exchange_weak_explicit(&job->reach, &seen, reach, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
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
    uint8_t *fluid = ascc_arena_lend(arena, count, 1);
    double *mass = ascc_arena_lend(arena, count, sizeof *mass);
    const ascc_output *output = &job->run->network->plan->output;
    job->direct = !output->filter.bumps && !output->radial;
    job->stride = job->direct ? 4 : d;
    job->sum = ascc_arena_lend(arena, count, job->stride * sizeof(int64_t));
    bool taken = fluid && mass && job->sum;
    for (int part = 0; part < ASCC_PARTS && output->filter.bumps; part++)
        if (job->run->network->part_weight[part]) {
            job->share[part] = ascc_arena_lend(arena, count, ASCC_MAX_BUMPS * sizeof(float));
            taken &= job->share[part] != NULL;
        }
    double *place = NULL;
    if (output->current_direction) {
        place = ascc_arena_lend(arena, count, 3 * sizeof *place);
        taken &= place != NULL;
    }
    if (!taken)
        return ascc_fail(job->run->tools->message, ASCC_ERROR_MEMORY, "no memory for the impulses");
    memset(job->sum, 0, count * job->stride * sizeof(int64_t));
    for (size_t i = 0; i < count; i++) {
        const size_t row = ascc_hierarchy_host_row(h, set, i);
        fluid[i] = row < h->fluid_count;
        mass[i] = fluid[i] ? scale->mass[row] : 0.0;
        for (size_t c = 0; place && c < 3; c++)
            place[i * 3 + c] = c < d ? scale->position[row * d + c] : 0.0;
    }
    job->place = place;
    job->fluid = fluid;
    job->mass = mass;
    job->uniform = true;
    for (size_t i = 1; i < h->fluid_count; i++)
        job->uniform &= scale->mass[i] == scale->mass[0];
    return ASCC_OK;
}

/* Rows of a chunk, at least `least`: in each of the three phases as many chunks for one worker as for
 * another, if that leaves any. Sums are integers, so where chunks end does not matter. */
static size_t chunk_size(size_t count, size_t least, size_t workers)
{
    const size_t round = 3 * workers, chunks = count / least / round * round;
    return chunks ? (count + chunks - 1) / chunks : least;
}

typedef struct sums_job {
    const pair_job *from;
    const ascc_impulses *impulses;
    int32_t set;
} sums_job;

/* Sums in the host's order. */
static void give_sums(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sums_job *job = data;
    const ascc_hierarchy *h = job->from->run->hierarchy;
    const size_t d = (size_t)job->from->run->network->plan->dimension;
    for (size_t i = begin; i < end; i++) {
        const size_t row = ascc_hierarchy_host_row(h, job->set, i);
        int64_t *to = job->from->fluid[i] ? job->impulses->fluid + row * d
                                          : job->impulses->wall + (row - h->fluid_count) * d;
        memcpy(to, job->from->sum + i * job->from->stride, d * sizeof *to);
    }
}

ascc_status ascc_antisymmetric_impulses(const ascc_network_run *run,
                                        const ascc_impulse_scale *scale,
                                        const ascc_impulses *impulses, uint64_t *pair_count)
{
    const ascc_network *network = run->network;
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t set = ascc_network_set(network, network->plan->output.source);
    const size_t count = h->set[set].count;
    pair_job job = {.run = run,
                    .rows = &run->rows[network->term_key[network->plan->term_count]],
                    .scale = scale,
                    .wall = impulses->wall};
    const ascc_status status = take_job(&job, set, scale);
    if (status != ASCC_OK)
        return status;
    if (job.share[0])
        ascc_workers_run(run->tools->workers, count, 1024, compute_shares, &job);
    ascc_workers_run(run->tools->workers, count, 1024, measure_rows, &job);
    job.chunk = chunk_size(count, ascc_max_size(atomic_load(&job.reach), SMALLEST_CHUNK),
                           (size_t)ascc_workers_count(run->tools->workers));
    const size_t chunks = (count + job.chunk - 1) / job.chunk;
    for (job.phase = 0; job.phase < 3 && job.phase < chunks; job.phase++)
        ascc_workers_run(run->tools->workers, (chunks - job.phase + 2) / 3, 1, evaluate_chunks,
                         &job);
    if (network->wall_key >= 0) {
        job.rows = &run->rows[network->wall_key];
        ascc_workers_run(run->tools->workers, count, 256, evaluate_walls, &job);
    }
    const uint64_t bad = atomic_load(&job.bad_row);
    if (bad)
        return bad_value(run, output_values(run), ascc_padded(network->plan->output.inputs),
                         (size_t)bad - 1, ascc_hierarchy_host_row(h, set, (size_t)bad - 1));
    sums_job sums = {&job, impulses, set};
    ascc_workers_run(run->tools->workers, count, 4096, give_sums, &sums);
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
        const size_t row = ascc_hierarchy_host_row(h, set, from);
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
