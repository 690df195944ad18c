/* Integer sums of pair impulses, as pair_sum.h draws them. SPDX-License-Identifier: MIT */
#include "pair_sum.h"

#include <math.h>
#include <string.h>

#define SMALLEST_CHUNK 256
/* Rounds |x| < 2^51 to the nearest integer, ties to even, in any build. */
#define ROUND_MAGIC 6755399441055744.0

bool ascc_round_quanta(const double *x, size_t count, int64_t *quanta)
{
    uint64_t zero;
    const double magic = ROUND_MAGIC;
    memcpy(&zero, &magic, sizeof zero);
    int good = 1;
    for (size_t k = 0; k < count; k++) { /* the low bits of x + 1.5 * 2^52 */
        const double shifted = x[k] + ROUND_MAGIC;
        uint64_t bits;
        memcpy(&bits, &shifted, sizeof bits);
        bits -= zero; /* wraps where x is too large, which is told */
        memcpy(&quanta[k], &bits, sizeof bits);
        good &= fabs(x[k]) < ASCC_IMPULSE_LIMIT;
    }
    return good;
}

static bool add_impulse(int64_t *sum, int64_t impulse)
{
    return !__builtin_add_overflow(*sum, impulse, sum);
}

void ascc_pair_sum_note_bad(ascc_pair_sum *sum, size_t i)
{
    ascc_note_first(&sum->bad_row, i);
}

void ascc_pair_displacements(const ascc_rows *rows, const double *place, size_t i,
                             const ascc_pair_batch *batch, ascc_pair_impulses d,
                             double square[ASCC_PAIR_BATCH])
{
    for (size_t k = 0; k < batch->count; k++)
        square[k] = 0.0;
    for (size_t c = 0; c < 3; c++) {
        const int32_t *source = rows->source->low[c];
        const uint32_t here = (uint32_t)rows->query->low[c][i];
        for (size_t k = 0; k < batch->count; k++) {
            const size_t j = batch->neighbor[k];
            d[c][k] = place ? place[j * 3 + c] - place[i * 3 + c]
                            : (double)(int32_t)((uint32_t)source[j] - here);
            square[k] += d[c][k] * d[c][k];
        }
    }
}

void ascc_pair_sum_add(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *batch,
                       ascc_pair_impulses impulse)
{
    const size_t d = (size_t)sum->run->plan->dimension;
    int64_t quanta[ASCC_PAIR_BATCH];
    for (size_t c = 0; c < d; c++) {
        if (!ascc_round_quanta(impulse[c], batch->count, quanta)) {
            ascc_pair_sum_note_bad(sum, i);
            return;
        }
        int64_t own = 0; /* 64 impulses below 2^50 */
        bool good = true;
        for (size_t k = 0; k < batch->count; k++) {
            own += quanta[k];
            good &= add_impulse(&sum->sum[batch->neighbor[k] * sum->stride + c], -quanta[k]);
        }
        if (!add_impulse(&sum->sum[i * sum->stride + c], own) || !good)
            ascc_pair_sum_note_bad(sum, i);
    }
}

/* Adds to a wall that several threads may push at once: integers, so their order does not matter.
 * False when the sum comes near what can be held: one more pair cannot overflow it. */
static bool push_wall(int64_t *sum, int64_t impulse)
{
    const int64_t before = __atomic_fetch_add(sum, impulse, __ATOMIC_RELAXED);
    return before < ASCC_WALL_LIMIT && before > -ASCC_WALL_LIMIT;
}

void ascc_pair_sum_add_walls(ascc_pair_sum *sum, size_t i, const ascc_pair_batch *batch,
                             ascc_pair_impulses impulse)
{
    const size_t d = (size_t)sum->run->plan->dimension;
    int64_t quanta[ASCC_PAIR_BATCH], *wall[ASCC_PAIR_BATCH];
    bool good = true;
    for (size_t k = 0; k < batch->count; k++)
        wall[k] = sum->wall + ascc_hierarchy_wall_row(sum->run->hierarchy, batch->neighbor[k]) * d;
    for (size_t c = 0; c < d && good; c++) {
        good = ascc_round_quanta(impulse[c], batch->count, quanta);
        for (size_t k = 0; k < batch->count && good; k++)
            good = add_impulse(&sum->sum[i * sum->stride + c], quanta[k]) &&
                   push_wall(&wall[k][c], -quanta[k]);
    }
    if (!good)
        ascc_pair_sum_note_bad(sum, i);
}

/* ---- Fluid pairs, chunk by chunk ---- */

static bool is_idle(const ascc_pair_sum *sum, size_t i)
{
    return sum->idle && sum->idle[i];
}

static bool coincident(const ascc_rows *rows, size_t i, uint32_t j)
{
    return rows->source->low[0][j] == rows->query->low[0][i] &&
           rows->source->low[1][j] == rows->query->low[1][i] &&
           rows->source->low[2][j] == rows->query->low[2][i];
}

/* Evaluates the batch and empties it; returns its pairs. */
static size_t flush(ascc_pair_sum *sum, size_t i, ascc_pair_batch *batch)
{
    const size_t count = batch->count;
    sum->evaluate(sum, i, batch);
    batch->count = 0;
    return count;
}

/* The first row after i that lies elsewhere: rows at one place follow one another. */
static size_t first_apart(const ascc_pair_sum *sum, size_t i)
{
    const ascc_rows *rows = sum->rows;
    size_t j = i + 1;
    while (sum->skip_coincident && j < rows->source->count && coincident(rows, i, (uint32_t)j))
        j++;
    return j;
}

/* Whether a pair belongs to row i though j comes first: an idle row has no turn of its own. */
static bool stands_in(const ascc_pair_sum *sum, size_t i, uint32_t j)
{
    return j < i && is_idle(sum, j) && !(sum->skip_coincident && coincident(sum->rows, i, j));
}

/* A pair of fluid particles belongs to the first of its rows; at one place they have no direction. */
static size_t evaluate_row(ascc_pair_sum *sum, size_t i)
{
    const ascc_rows *rows = sum->rows;
    const uint32_t *neighbor = rows->neighbor + rows->start[i];
    const size_t count = rows->count[i], first = first_apart(sum, i);
    const bool elsewhere = sum->run->hierarchy->halo != NULL;
    ascc_pair_batch batch;
    size_t pairs = 0, stood = 0;
    batch.count = 0;
    for (size_t k = 0; k < count;) {
        const size_t stop = ascc_min_size(count, k + ASCC_PAIR_BATCH - batch.count);
        for (; k < stop; k++) {
            const uint32_t j = neighbor[k];
            const bool stands = j < first && sum->idle && stands_in(sum, i, j);
            batch.neighbor[batch.count] = j;
            batch.count += j >= first || stands;
            stood += stands && elsewhere; /* where the other row is */
        }
        if (batch.count == ASCC_PAIR_BATCH || (k == count && batch.count))
            pairs += flush(sum, i, &batch);
    }
    return pairs - stood;
}

/* The same of a set with walls, whose pairs with fluid belong to the fluid's row. */
static size_t evaluate_mixed_row(ascc_pair_sum *sum, size_t i)
{
    const ascc_rows *rows = sum->rows;
    const uint32_t *neighbor = rows->neighbor + rows->start[i];
    ascc_pair_batch batch;
    size_t pairs = 0;
    batch.count = 0;
    for (size_t k = 0; k < rows->count[i]; k++) {
        const uint32_t j = neighbor[k];
        if ((j <= i && sum->fluid[j] && !is_idle(sum, j)) ||
            (sum->skip_coincident && coincident(rows, i, j)))
            continue;
        batch.neighbor[batch.count] = j;
        if (++batch.count == ASCC_PAIR_BATCH)
            pairs += flush(sum, i, &batch);
    }
    return batch.count ? pairs + flush(sum, i, &batch) : pairs;
}

static void evaluate_chunks(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    ascc_pair_sum *sum = data;
    const size_t count = sum->rows->query->count;
    for (size_t c = begin; c < end; c++) {
        const size_t first = (c * 3 + sum->phase) * sum->chunk;
        size_t pairs = 0;
        for (size_t i = first; i < ascc_min_size(first + sum->chunk, count); i++) {
            if (is_idle(sum, i) || (sum->whole && sum->whole(sum, i)))
                continue;
            if (sum->set == ASCC_SET_FLUID)
                pairs += evaluate_row(sum, i);
            else if (sum->fluid[i])
                pairs += evaluate_mixed_row(sum, i);
        }
        atomic_fetch_add_explicit(&sum->pairs, pairs, memory_order_relaxed);
    }
}

/* Rows of a chunk, at least `least`: in each of the three phases as many chunks for one worker as for
 * another, if that leaves any. Sums are integers, so where chunks end does not matter. */
static size_t chunk_size(size_t count, size_t least, size_t workers)
{
    const size_t round = 3 * workers, chunks = count / least / round * round;
    return chunks ? (count + chunks - 1) / chunks : least;
}

void ascc_pair_sum_run(ascc_pair_sum *sum, const ascc_rows *rows, ascc_pair_function evaluate)
{
    ascc_workers *workers = sum->run->tools->workers;
    const size_t count = rows->query->count;
    sum->rows = rows;
    sum->evaluate = evaluate;
    sum->chunk = chunk_size(count, ascc_max_size(rows->span, SMALLEST_CHUNK),
                            (size_t)ascc_workers_count(workers));
    const size_t chunks = (count + sum->chunk - 1) / sum->chunk;
    for (sum->phase = 0; sum->phase < 3 && sum->phase < chunks; sum->phase++)
        ascc_workers_run(workers, (chunks - sum->phase + 2) / 3, 1, evaluate_chunks, sum);
}

/* ---- Pairs of a fluid particle and a wall ---- */

static void evaluate_walls(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    ascc_pair_sum *sum = data;
    const ascc_rows *rows = sum->rows;
    ascc_pair_batch batch;
    size_t pairs = 0;
    batch.count = 0;
    for (size_t i = begin; i < end; i++) {
        if (is_idle(sum, i))
            continue;
        const uint32_t *neighbor = rows->neighbor + rows->start[i];
        for (size_t k = 0; k < rows->count[i]; k++) {
            batch.neighbor[batch.count] = neighbor[k];
            if (++batch.count == ASCC_PAIR_BATCH)
                pairs += flush(sum, i, &batch);
        }
        if (batch.count)
            pairs += flush(sum, i, &batch);
    }
    atomic_fetch_add_explicit(&sum->pairs, pairs, memory_order_relaxed);
}

void ascc_pair_sum_run_walls(ascc_pair_sum *sum, const ascc_rows *rows, int64_t *wall,
                             ascc_pair_function evaluate)
{
    sum->rows = rows;
    sum->wall = wall;
    sum->evaluate = evaluate;
    ascc_workers_run(sum->run->tools->workers, rows->query->count, 256, evaluate_walls, sum);
}

/* ---- From open to give ---- */

ascc_status ascc_pair_sum_open(ascc_pair_sum *sum, const ascc_network_run *run, int32_t set,
                               const double *fluid_mass, size_t stride)
{
    const ascc_hierarchy *h = run->hierarchy;
    ascc_arena *arena = run->tools->arena;
    const size_t count = h->set[set].count;
    uint8_t *fluid = ascc_arena_lend(arena, count, 1);
    double *mass = ascc_arena_lend(arena, count, sizeof *mass);
    const bool some = h->idle || h->share;
    uint8_t *idle = some ? ascc_arena_lend(arena, count, 1) : NULL;
    int64_t *sums = ascc_arena_lend(arena, count, stride * sizeof *sums);
    if (!fluid || !mass || !sums || (some && !idle))
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the impulses");
    memset(sums, 0, count * stride * sizeof *sums);
    for (size_t i = 0; i < count; i++) {
        const size_t row = ascc_hierarchy_host_row(h, set, i);
        fluid[i] = row < h->fluid_count;
        mass[i] = fluid[i] ? fluid_mass[row] : 0.0;
        if (idle)
            idle[i] = fluid[i] && ascc_hierarchy_is_quiet(h, set == ASCC_SET_ALL ? h->part[i] : i);
    }
    *sum = (ascc_pair_sum){.run = run,
                           .set = set,
                           .fluid = fluid,
                           .mass = mass,
                           .idle = idle,
                           .uniform = true,
                           .sum = sums,
                           .stride = stride,
                           .skip_coincident = true};
    for (size_t i = 1; i < h->fluid_count; i++)
        sum->uniform &= fluid_mass[i] == fluid_mass[0];
    sum->uniform = h->halo ? h->halo->uniform : sum->uniform;
    return ASCC_OK;
}

typedef struct give_job {
    const ascc_pair_sum *sum;
    const ascc_impulses *impulses;
} give_job;

/* Sums in the host's order. */
static void give_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const give_job *job = data;
    const ascc_pair_sum *sum = job->sum;
    const ascc_hierarchy *h = sum->run->hierarchy;
    const size_t d = (size_t)sum->run->plan->dimension;
    for (size_t i = begin; i < end; i++) {
        const size_t row = ascc_hierarchy_host_row(h, sum->set, i);
        int64_t *to = sum->fluid[i] ? job->impulses->fluid + row * d
                                    : job->impulses->wall + (row - h->fluid_count) * d;
        memcpy(to, sum->sum + i * sum->stride, d * sizeof *to);
    }
}

ascc_status ascc_pair_sum_fail(const ascc_network_run *run, int32_t set, size_t row,
                               const float *values, size_t channels)
{
    bool finite = true;
    for (size_t c = 0; c < channels; c++)
        finite &= isfinite(values[row * channels + c]) != 0;
    return ascc_fail(run->tools->message, finite ? ASCC_ERROR_RANGE : ASCC_ERROR_NOT_FINITE,
                     finite ? "the network gives fluid row %zu an impulse too large to hold"
                            : "the network's values for fluid row %zu are not finite",
                     ascc_hierarchy_host_row(run->hierarchy, set, row));
}

ascc_status ascc_pair_sum_give(ascc_pair_sum *sum, const float *values, size_t channels,
                               const ascc_impulses *impulses, uint64_t *pair_count)
{
    const size_t bad = atomic_load(&sum->bad_row);
    if (bad)
        return ascc_pair_sum_fail(sum->run, sum->set, bad - 1, values, channels);
    give_job job = {sum, impulses};
    ascc_workers_run(sum->run->tools->workers, sum->run->hierarchy->set[sum->set].count, 4096,
                     give_rows, &job);
    *pair_count = atomic_load(&sum->pairs);
    return ASCC_OK;
}
