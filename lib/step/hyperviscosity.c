/* Sweeps of a hyperviscosity. SPDX-License-Identifier: MIT
 *
 * With w_ij = min(s_i, s_j) |g_ij|^2, s_i = 1 / max(sum_j |g_ij|^2, D_lattice), 0 at free surfaces, and masses 1:
 *
 *     R_i = sum_j w_ij (v_i - v_j)                      how much rougher v_i is than those around it
 *     R_i = R_i max(0, 1 - |R_i|^2 / below^2)^2         a splash is left alone, and all where nothing falls
 *     v_i = v_i - share sum_j w_ij (R_i - R_j)
 *
 * The matrix of the first line, A, is symmetric with eigenvalues in [0, 2], and the second line is a diagonal F in
 * [0, 1]: so 1 - share A F A adds no energy for shares of at most a half. Of unequal masses the same holds with
 * min(m_i s_i, m_j s_j) and what each row receives divided by its mass.
 *
 * Weights stay as they are while sweeps go on, so a pair gives w_ij (S_i - S_j) in all, S the sum of share R over
 * sweeps: velocities follow in floats, and impulses are rounded once, at the end.
 */
#include "hyperviscosity.h"

#include "network/early_rows.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

#define ROWS 256 /* of a block of work */

typedef struct sweep {
    const ascc_smoothing *of;
    double heaviest, factor; /* kg; quanta per support a step of roughness */
    ascc_gradients pairs;    /* with weights, once they are known */
    float *weigh;            /* else where they go */
    float bound, share;
    int32_t k; /* of sweeps */
    bool last;
    /* Rows of 4: velocities and coefficients; R; S; what a sweep takes. */
    float *velocity, *rough, *sum, *taken;
} sweep;

void ascc_relaxation_velocity(const ascc_step_state *state, size_t row, float velocity[4])
{
    const ascc_particles *p = state->particles;
    const size_t d = (size_t)p->dimension;
    const size_t at = ascc_hierarchy_host_row(&state->hierarchy, ASCC_SET_FLUID, row);
    const double unit =
        state->motion->time_step * p->quantum * state->length_unit / state->relaxation->support;
    const bool moves = !ascc_hierarchy_is_idle(&state->hierarchy, row);
    for (size_t c = 0; c < 4; c++)
        velocity[c] =
            c < d && moves
                ? (float)((double)state->advance.momentum[at * d + c] * unit / p->mass[at])
                : 0.0f;
}

double ascc_relaxation_quanta(const ascc_step_state *state)
{
    return state->relaxation->support / state->length_unit / state->motion->time_step /
           state->particles->quantum;
}

ascc_status ascc_relaxation_add(ascc_step_state *state, const int64_t *given)
{
    const ascc_particles *p = state->particles;
    int64_t *momentum = state->advance.momentum;
    for (size_t k = 0; k < p->fluid_count * (size_t)p->dimension; k++)
        if (__builtin_add_overflow(momentum[k], given[k], &momentum[k]) ||
            momentum[k] > ASCC_MOMENTUM_LIMIT || momentum[k] < -ASCC_MOMENTUM_LIMIT)
            return ascc_fail(state->tools.message, ASCC_ERROR_RANGE,
                             "fluid particle %" PRIu64 ": momentum too large to hold",
                             p->id[k / (size_t)p->dimension]);
    return ASCC_OK;
}

double ascc_smoothing_share(const ascc_step_state *state, double share)
{
    const double steps =
        state->motion->time_step * state->time_unit / state->network->plan->time_step;
    return share * (steps < 1.0 ? steps : 1.0);
}

float ascc_smoothing_bound(const ascc_step_state *state)
{
    const ascc_plan *plan = state->network->plan;
    const double trained = ascc_vector_length(plan->gravity), unit = state->time_unit;
    const double gravity =
        ascc_vector_length(state->motion->gravity) * state->length_unit / (unit * unit);
    const double below =
        state->relaxation->viscosity_below * (trained > 0.0 ? gravity / trained : 1.0);
    return (float)(below * state->motion->time_step * unit / state->relaxation->support);
}

int32_t ascc_smoothing_sweeps(const ascc_step_state *state)
{
    return ascc_smoothing_bound(state) > 0.0f ? state->relaxation->viscosity.count : 0;
}

/* Of all fluid, that of other processes, too. */
static ascc_status find_heaviest(const ascc_smoothing *s, double *heaviest)
{
    ascc_halo *halo = s->state->halo;
    *heaviest = 0.0;
    for (size_t i = 0; i < (s->sum->uniform && s->count ? 1 : s->count); i++)
        *heaviest = s->sum->mass[i] > *heaviest ? s->sum->mass[i] : *heaviest;
    return halo && !s->sum->uniform ? ascc_halo_largest(halo, heaviest, 1) : ASCC_OK;
}

static void velocity_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    const ascc_smoothing *s = w->of;
    for (size_t i = begin; i < end; i++) {
        ascc_relaxation_velocity(s->state, i, w->velocity + i * 4);
        w->velocity[i * 4 + 3] =
            s->sum->uniform ? s->coefficient[i]
                            : (float)((double)s->coefficient[i] * (s->sum->mass[i] / w->heaviest));
    }
    memset(w->sum + begin * 4, 0, (end - begin) * 4 * sizeof *w->sum);
}

/* How much rows of `of` differ from those around, by their masses. */
static void differ(const sweep *w, size_t begin, size_t end, const float *of, float *to)
{
    const ascc_smoothing *s = w->of;
    s->state->tools.kernels->roughness(&w->pairs, begin, end, of, w->weigh, to);
    for (size_t i = begin; !s->sum->uniform && i < end; i++)
        for (size_t c = 0; c < 3; c++)
            to[i * 4 + c] *= (float)(w->heaviest / s->sum->mass[i]);
}

/* One factor a row, so that no sweep adds energy. */
static void fade_row(const sweep *w, float *rough)
{
    const float square = rough[0] * rough[0] + rough[1] * rough[1] + rough[2] * rough[2];
    const float left = 1.0f - square / (w->bound * w->bound);
    const float share = left > 0.0f ? left * left : 0.0f;
    for (size_t c = 0; c < 3; c++)
        rough[c] *= share;
}

/* Sweep k has begun with these velocities and found this roughness. */
static void trace_rows(const sweep *w, size_t begin, size_t end)
{
    const ascc_relaxation_trace *t = w->of->trace;
    const size_t first = (size_t)w->k * w->of->count * 4 + begin * 4;
    const size_t size = (end - begin) * 4 * sizeof *w->velocity;
    memcpy(t->smoothed + first, w->velocity + begin * 4, size);
    memcpy(t->rough + first, w->rough + begin * 4, size);
}

static void rough_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    differ(w, begin, end, w->velocity, w->rough);
    if (w->of->trace)
        trace_rows(w, begin, end);
    for (size_t i = begin; i < end; i++)
        fade_row(w, w->rough + i * 4);
}

static void smooth_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const sweep *w = data;
    for (size_t k = begin * 4; k < end * 4; k++)
        w->sum[k] += w->share * w->rough[k];
    if (w->last)
        return;
    differ(w, begin, end, w->rough, w->taken);
    for (size_t i = begin; i < end; i++)
        for (size_t c = 0; c < 3; c++)
            w->velocity[i * 4 + c] -= w->share * w->taken[i * 4 + c];
}

/* Pairs with rows before i that have no turn of their own: of other processes; those that sleep have no coefficient. */
static bool add_idle_pairs(const sweep *w, ascc_pair_sum *sum, size_t i)
{
    const ascc_hierarchy *h = &w->of->state->hierarchy;
    const float *here = w->sum + i * 4;
    bool good = true;
    for (size_t k = w->pairs.start[i]; h->idle && k < w->pairs.end[i]; k++) {
        const size_t j = w->pairs.neighbor[k];
        if (j >= i || !ascc_hierarchy_is_idle(h, j))
            continue;
        const float *there = w->sum + j * 4;
        for (size_t c = 0; c < 3; c++) {
            const double impulse = (double)(w->pairs.weight[k] * (here[c] - there[c])) * -w->factor;
            int64_t quanta = 0;
            good &= ascc_round_quanta(&impulse, 1, &quanta);
            sum->sum[i * sum->stride + c] += quanta;
        }
    }
    return good;
}

static bool evaluate(ascc_pair_sum *sum, size_t i)
{
    const sweep *w = sum->data;
    const ascc_smoothing *s = w->of;
    if (!s->state->tools.kernels->rough_impulses(&w->pairs, w->sum, w->factor, i,
                                                 ASCC_IMPULSE_LIMIT, sum->sum) ||
        !add_idle_pairs(w, sum, i))
        ascc_pair_sum_note_bad(sum, i);
    return true;
}

/* Computes rows and refreshes ghosts of what it writes. sure: nothing can have failed since the last time. */
static ascc_status run_rows(sweep *w, ascc_range_function function, float *writes, bool sure)
{
    const ascc_halo_refresh refresh = {ASCC_SET_FLUID, sure, 1, {{writes, 4 * sizeof *writes}}};
    return ascc_early_rows_run(&w->of->state->hierarchy, &w->of->state->tools, ROWS, function, w,
                               &refresh);
}

static void smooth(sweep *w)
{
    const ascc_smoothing *s = w->of;
    const ascc_sweeps *sweeps = &s->state->relaxation->viscosity;
    w->share = (float)ascc_smoothing_share(s->state, sweeps->omega[w->k]);
    w->last = w->k + 1 == sweeps->count;
    (void)run_rows(w, rough_rows, w->rough, true);
    w->pairs.weight = s->weight;
    w->weigh = NULL;
    if (w->last)
        ascc_workers_run(s->state->tools.workers, s->count, ROWS, smooth_rows, w);
    else
        (void)run_rows(w, smooth_rows, w->velocity, true);
}

/* Momenta become what all sweeps make of them. */
static ascc_status give(sweep *w)
{
    const ascc_smoothing *s = w->of;
    const ascc_impulses to = {s->given, NULL};
    uint64_t pairs;
    w->factor = ascc_relaxation_quanta(s->state) * w->heaviest;
    memset(s->sum->sum, 0, s->count * s->sum->stride * sizeof *s->sum->sum);
    s->sum->data = w;
    s->sum->whole = evaluate;
    ascc_pair_sum_run(s->sum, s->rows, NULL);
    const ascc_status status = ascc_pair_sum_give(s->sum, w->sum, 4, &to, &pairs);
    return status == ASCC_OK ? ascc_relaxation_add(s->state, s->given) : status;
}

static bool keep_sweeps(const ascc_smoothing *s, int32_t sweeps)
{
    ascc_relaxation_trace *t = s->trace;
    const size_t rows = (size_t)sweeps * s->count;
    if (!t)
        return true;
    t->coefficient = s->coefficient;
    t->weight = s->weight;
    t->smoothed = ascc_arena_take(s->state->tools.arena, rows, 4 * sizeof *t->smoothed);
    t->rough = ascc_arena_take(s->state->tools.arena, rows, 4 * sizeof *t->rough);
    return t->smoothed && t->rough;
}

ascc_status ascc_smooth_velocities(const ascc_smoothing *s)
{
    ascc_arena *arena = s->state->tools.arena;
    const int32_t sweeps = ascc_smoothing_sweeps(s->state);
    sweep w = {
        .of = s, .pairs = s->pairs, .weigh = s->weight, .bound = ascc_smoothing_bound(s->state)};
    float **const rows[] = {&w.velocity, &w.rough, &w.sum, &w.taken};
    bool room = keep_sweeps(s, sweeps);
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
        room &= (*rows[i] = ascc_arena_lend(arena, s->count, 4 * sizeof(float))) != NULL;
    if (!room)
        return ascc_fail(s->state->tools.message, ASCC_ERROR_MEMORY, "no memory for a viscosity");
    ascc_status status = find_heaviest(s, &w.heaviest);
    if (status != ASCC_OK || sweeps == 0)
        return status;
    status = run_rows(&w, velocity_rows, w.velocity, false);
    for (; w.k < sweeps && status == ASCC_OK; w.k++)
        smooth(&w);
    return status == ASCC_OK ? give(&w) : status;
}
