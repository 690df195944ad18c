/* The adjoint of a hyperviscosity (step/hyperviscosity.c has the formulas). SPDX-License-Identifier: MIT
 *
 * With A the matrix of roughness, v' = v - share A F(A v). A is symmetric: for a gradient y of v', and z = - share y,
 *
 *     w = F'(A v)^T A z,   y of v = y + A w
 *
 * and what the loss has of A is z . A F(A v) + w . A v, a sum over pairs of their weight times differences.
 */
#include "hyperviscosity_reverse.h"

#include <string.h>

#include "step/hyperviscosity.h"

typedef struct reverse {
    const ascc_step_state *state;
    const ascc_relaxation_trace *trace;
    size_t count;
    float bound;
    /* Rows of 4, the last 0: z, A z and then w, A w, F(A v). */
    float *z, *w, *back, *faded;
    float *by_square; /* [pair] so far without the coefficient */
} reverse;

size_t ascc_smoothing_pairs(const ascc_relaxation_trace *trace, size_t rows)
{
    size_t count = 0;
    for (size_t i = 0; i < rows; i++)
        for (size_t k = trace->pairs.start[i]; k < trace->pairs.end[i]; k++)
            count += trace->pairs.neighbor[k] > i;
    return count;
}

/* Both ways through the fading of a row: what is left of its roughness, and from the gradient of that to its own. */
static void fade(const float rough[4], float bound, float faded[4], float by[4])
{
    const float square = bound * bound;
    float part = 0.0f, along = 0.0f;
    for (int c = 0; c < 3; c++) {
        part += rough[c] * rough[c] / square;
        along += rough[c] * by[c];
    }
    const float left = part < 1.0f ? 1.0f - part : 0.0f;
    for (int c = 0; c < 3; c++) {
        faded[c] = left * left * rough[c];
        by[c] = left * left * by[c] - 4.0f * left * along / square * rough[c];
    }
}

static float difference_of(const float *a, const float *b, size_t i, size_t j)
{
    float sum = 0.0f;
    for (size_t c = 0; c < 3; c++)
        sum += (a[i * 4 + c] - a[j * 4 + c]) * (b[i * 4 + c] - b[j * 4 + c]);
    return sum;
}

static void add_pairs(const reverse *r, const float *velocity)
{
    const ascc_gradients *pairs = &r->trace->pairs;
    size_t at = 0;
    for (size_t i = 0; i < r->count; i++)
        for (size_t k = pairs->start[i]; k < pairs->end[i]; k++) {
            const size_t j = pairs->neighbor[k];
            if (j > i)
                r->by_square[at++] +=
                    difference_of(r->z, r->faded, i, j) + difference_of(r->w, velocity, i, j);
        }
}

static void sweep_back(const reverse *r, int32_t k, float *by)
{
    const ascc_kernels *kernels = r->state->tools.kernels;
    ascc_gradients pairs = r->trace->pairs;
    const float *velocity = r->trace->smoothed + (size_t)k * r->count * 4;
    const float *rough = r->trace->rough + (size_t)k * r->count * 4;
    const double share = r->state->network->plan->relaxation.viscosity.omega[k];
    const float factor = -(float)ascc_smoothing_share(r->state, share);
    for (size_t i = 0; i < r->count; i++)
        for (size_t c = 0; c < 4; c++)
            r->z[i * 4 + c] = c < 3 ? factor * by[i * 4 + c] : 0.0f;
    pairs.weight = r->trace->weight;
    kernels->roughness(&pairs, 0, r->count, r->z, NULL, r->w);
    for (size_t i = 0; i < r->count; i++)
        fade(rough + i * 4, r->bound, r->faded + i * 4, r->w + i * 4);
    kernels->roughness(&pairs, 0, r->count, r->w, NULL, r->back);
    add_pairs(r, velocity);
    for (size_t i = 0; i < r->count; i++)
        for (size_t c = 0; c < 3; c++)
            by[i * 4 + c] += r->back[i * 4 + c];
}

/* A pair's weight is its square times the smaller coefficient, and a coefficient 1 over the sum of its row's squares,
 * if that is not cut. */
static void coefficients_back(const reverse *r, float *by_squares, double *by_lattice)
{
    const ascc_gradients *pairs = &r->trace->pairs;
    const float *own = r->trace->coefficient;
    const float least = 1.0f / (float)r->state->network->plan->relaxation.lattice_response;
    size_t at = 0;
    memset(by_squares, 0, r->count * sizeof *by_squares);
    for (size_t i = 0; i < r->count; i++)
        for (size_t k = pairs->start[i]; k < pairs->end[i]; k++) {
            const size_t j = pairs->neighbor[k], smaller = own[j] < own[i] ? j : i;
            if (j <= i)
                continue;
            float square = 0.0f;
            for (int c = 0; c < 3; c++)
                square += pairs->g[c][k] * pairs->g[c][k];
            const float by = r->by_square[at] * square * own[smaller] * own[smaller];
            if (own[smaller] < least)
                by_squares[smaller] -= by;
            else
                *by_lattice -= (double)by;
            r->by_square[at++] *= own[smaller];
        }
}

static float *rows_of_four(ascc_arena *arena, size_t count)
{
    return ascc_arena_take(arena, count, 4 * sizeof(float));
}

ascc_status ascc_smoothing_backward(const ascc_step_state *state, ascc_arena *arena,
                                    const ascc_smoothing_gradients *gradients)
{
    const ascc_relaxation_trace *trace = &state->relaxed.divergence;
    const size_t count = state->hierarchy.set[ASCC_SET_FLUID].count;
    const reverse r = {.state = state,
                       .trace = trace,
                       .count = count,
                       .bound = ascc_smoothing_bound(state),
                       .z = rows_of_four(arena, count),
                       .w = rows_of_four(arena, count),
                       .back = rows_of_four(arena, count),
                       .faded = rows_of_four(arena, count),
                       .by_square = gradients->by_square};
    if (!r.z || !r.w || !r.back || !r.faded)
        return ASCC_ERROR_MEMORY;
    memset(r.by_square, 0, ascc_smoothing_pairs(trace, count) * sizeof *r.by_square);
    for (int32_t k = ascc_smoothing_sweeps(state); k > 0; k--)
        sweep_back(&r, k - 1, gradients->velocity);
    coefficients_back(&r, gradients->by_squares, gradients->by_lattice);
    return ASCC_OK;
}
