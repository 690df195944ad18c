/* Sequences: copied, checked, measured once. SPDX-License-Identifier: MIT */
#include "data.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "points/search.h"

#define BINS 4096 /* of the histograms that percentiles come from */
#define SAME 1e-4 /* of a spacing or time step: numbers of texts and floats are not exact */

/* ---- Copies ---- */

static float *copy(const ascc_allocator *allocator, const float *from, size_t count, double unit)
{
    float *to = ascc_allocate(allocator, count, sizeof *to);
    for (size_t i = 0; to && i < count; i++)
        to[i] = (float)((double)from[i] * unit);
    return to;
}

/* What one metre of the sequence is in the model's, whose spacing its own becomes. */
static double length_unit_of(const ascc_plan *plan, const ascc_training_sequence *g)
{
    const bool own =
        !(g->spacing > 0.0) || fabs(g->spacing - plan->spacing) <= SAME * plan->spacing;
    return own ? 1.0 : plan->spacing / g->spacing;
}

/* Of the interval, in the model's seconds: gravity stays what it is, so time goes with the root of length. */
static double time_step_of(const ascc_plan *plan, const ascc_training_sequence *g)
{
    const double step = g->time_step * sqrt(length_unit_of(plan, g));
    return fabs(step - plan->time_step) <= SAME * plan->time_step ? plan->time_step : step;
}

static size_t wall_frames_of(const ascc_training_sequence *g)
{
    return g->boundary_moves ? g->frame_count : 1;
}

static ascc_status check(const ascc_plan *plan, const ascc_training_sequence *g,
                         ascc_message *message)
{
    const size_t d = (size_t)plan->dimension;
    const char *name = g->name ? g->name : "(no name)";
    if (g->frame_count < 3 || !g->fluid_count || !g->position ||
        (g->boundary_count && (!g->boundary_position || !g->boundary_normal)))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "sequence %s: it needs at least 3 frames, fluid, and arrays of all it has",
                         name);
    if (g->dimension && g->dimension != plan->dimension)
        return ascc_fail(message, ASCC_ERROR_MISMATCH,
                         "sequence %s: a %dD model cannot learn from %dD", name, plan->dimension,
                         (int)g->dimension);
    if (!(g->time_step > 0.0) || !(g->spacing >= 0.0) || !isfinite(g->time_step + g->spacing) ||
        g->boundary_moves < 0 || g->boundary_moves > 1)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "sequence %s: time_step %g s, spacing %g m or boundary_moves %d makes no "
                         "sense",
                         name, g->time_step, g->spacing, (int)g->boundary_moves);
    if (time_step_of(plan, g) > plan->time_step_max * (1.0 + SAME))
        return ascc_fail(message, ASCC_ERROR_MISMATCH,
                         "sequence %s: %g s between frames of %g m are %g s of the model's, whose "
                         "steps take at most %g s",
                         name, g->time_step, g->spacing > 0.0 ? g->spacing : plan->spacing,
                         time_step_of(plan, g), plan->time_step_max);
    for (size_t i = 0; i < g->frame_count * g->fluid_count * d; i++)
        if (!isfinite(g->position[i]))
            return ascc_fail(message, ASCC_ERROR_NOT_FINITE,
                             "sequence %s: frame %zu, particle %zu: a position is not finite", name,
                             i / (g->fluid_count * d), i / d % g->fluid_count);
    for (size_t i = 0; i < wall_frames_of(g) * g->boundary_count * d; i++)
        if (!isfinite(g->boundary_position[i]) || !isfinite(g->boundary_normal[i]))
            return ascc_fail(message, ASCC_ERROR_NOT_FINITE,
                             "sequence %s: frame %zu, boundary row %zu is not finite", name,
                             i / d / g->boundary_count, i / d % g->boundary_count);
    for (int c = 0; c < 3; c++)
        if (!isfinite(g->gravity[c]) || !(g->share >= 0.0) || !isfinite(g->share) ||
            g->warm_up < 0 || !(g->jitter >= 0.0) || !isfinite(g->jitter))
            return ascc_fail(
                message, ASCC_ERROR_ARGUMENT,
                "sequence %s: gravity, share, warm_up or jitter is not a number that makes sense",
                name);
    return ASCC_OK;
}

/* ---- Measures ---- */

typedef struct histogram {
    double low, high;
    size_t count[BINS], total;
} histogram;

static void note(histogram *h, double x)
{
    const double at = (x - h->low) / (h->high - h->low) * BINS;
    h->count[(size_t)fmin(fmax(at, 0.0), BINS - 1.0)]++;
    h->total++;
}

static double percentile(const histogram *h, double share)
{
    size_t seen = 0;
    for (size_t i = 0; i < BINS; i++) {
        seen += h->count[i];
        if ((double)seen >= share * (double)h->total)
            return h->low + (h->high - h->low) * ((double)i + 0.5) / BINS;
    }
    return h->high;
}

static ascc_status measure_fluid(ascc_kept_sequence *s, const ascc_plan *plan, size_t frame,
                                 const double *x, const ascc_search_tools *tools, histogram *dense)
{
    ascc_search near;
    const double support = ascc_plan_support_radius(plan); /* 0: the last layer has no neighbours */
    ascc_search_options within = {.dimension = s->dimension,
                                  .radius = support > 0.0 ? support : 2.0 * plan->spacing,
                                  .query = {x, s->fluid_count, "fluid row"}};
    ascc_status status = ascc_search_run(&near, tools, &within);
    for (size_t i = 0; status == ASCC_OK && i < s->fluid_count; i++)
        s->near[frame * s->fluid_count + i] = (uint16_t)fmin(near.rows.count[i] - 1.0, 65535.0);
    within.radius = 2.0 * plan->spacing;
    if (status == ASCC_OK)
        status = ascc_search_run(&near, tools, &within);
    for (size_t i = 0; status == ASCC_OK && i < s->fluid_count; i++) {
        double rho = 0.0;
        for (uint32_t k = 0; k < near.rows.count[i]; k++) {
            double e[3];
            const double t = 1.0 - ascc_search_separation(
                                       &near, i, near.rows.neighbor[near.rows.start[i] + k], e);
            rho += t > 0.0 ? t * t * t : 0.0;
        }
        note(dense, rho);
    }
    return status;
}

static ascc_status measure_walls(const ascc_kept_sequence *s, const ascc_plan *plan,
                                 const double *x, const double *wall, const float *normal,
                                 const ascc_search_tools *tools, histogram *depth)
{
    const size_t d = (size_t)s->dimension;
    ascc_search near;
    const ascc_search_options within = {.dimension = s->dimension,
                                        .radius = plan->spacing,
                                        .query = {x, s->fluid_count, "fluid row"},
                                        .source = {wall, s->boundary_count, "boundary row"}};
    const ascc_status status = ascc_search_run(&near, tools, &within);
    for (size_t i = 0; status == ASCC_OK && i < s->fluid_count; i++) {
        double nearest = INFINITY, distance = 0.0;
        for (uint32_t k = 0; k < near.rows.count[i]; k++) {
            const size_t j = near.rows.neighbor[near.rows.start[i] + k];
            double e[3];
            const double square = ascc_search_separation(&near, i, j, e);
            if (square >= nearest)
                continue;
            nearest = square;
            distance = 0.0;
            for (size_t c = 0; c < d; c++)
                distance += (x[i * d + c] - wall[j * d + c]) * (double)normal[j * d + c];
        }
        if (isfinite(nearest))
            note(depth, distance / plan->spacing);
    }
    return status;
}

static ascc_status measure(ascc_kept_sequence *s, const ascc_allocator *allocator,
                           const ascc_plan *plan, const ascc_search_tools *tools)
{
    const size_t d = (size_t)s->dimension, n = s->fluid_count * d, w = s->boundary_count * d;
    const ascc_rigid_transform none = ascc_rigid_transform_none();
    histogram *h = ascc_allocate(allocator, 2, sizeof *h);
    double *x = ascc_allocate(allocator, n + w, sizeof *x);
    ascc_status status = h && x ? ASCC_OK : ASCC_ERROR_MEMORY;
    if (status == ASCC_OK) {
        memset(h, 0, 2 * sizeof *h);
        h[0].high = 64.0;
        h[1].low = -1.0;
        h[1].high = 1.0;
    }
    for (size_t f = 0; status == ASCC_OK && f < s->frame_count; f++) {
        ascc_arena_reset(tools->arena);
        ascc_rigid_transform_apply(&none, s->dimension, s->position + f * n, s->fluid_count, false,
                                   x);
        status = measure_fluid(s, plan, f, x, tools, &h[0]);
        const size_t walls = ascc_kept_sequence_walls(s, f);
        ascc_rigid_transform_apply(&none, s->dimension, s->wall + walls, s->boundary_count, false,
                                   x + n);
        if (status == ASCC_OK && s->boundary_count)
            status = measure_walls(s, plan, x, x + n, s->normal + walls, tools, &h[1]);
    }
    if (status == ASCC_OK) {
        s->dense = percentile(&h[0], 0.95);
        s->wall_depth = h[1].total ? percentile(&h[1], 0.05) * plan->spacing : -INFINITY;
    }
    if (x)
        ascc_release(allocator, x, n + w, sizeof *x);
    if (h)
        ascc_release(allocator, h, 2, sizeof *h);
    return status;
}

ascc_status ascc_kept_sequence_create(ascc_kept_sequence *s, const ascc_allocator *allocator,
                                      const ascc_plan *plan, const ascc_training_sequence *given,
                                      const ascc_search_tools *tools)
{
    memset(s, 0, sizeof *s);
    ascc_status status = check(plan, given, tools->message);
    if (status != ASCC_OK)
        return status;
    const size_t d = (size_t)plan->dimension;
    snprintf(s->name, sizeof s->name, "%s", given->name ? given->name : "(no name)");
    s->frame_count = given->frame_count;
    s->fluid_count = given->fluid_count;
    s->boundary_count = given->boundary_count;
    s->dimension = plan->dimension;
    s->share = given->share > 0.0 ? given->share : 1.0;
    s->warm_up = given->warm_up;
    s->jitter = given->jitter;
    s->wall_frames = wall_frames_of(given);
    const double unit = length_unit_of(plan, given);
    const size_t walls = s->wall_frames * s->boundary_count * d;
    s->time_step = time_step_of(plan, given);
    memcpy(s->gravity, given->gravity, sizeof s->gravity);
    s->position = copy(allocator, given->position, s->frame_count * s->fluid_count * d, unit);
    s->wall = copy(allocator, given->boundary_position, walls, unit);
    s->normal = copy(allocator, given->boundary_normal, walls, 1.0);
    s->near = ascc_allocate(allocator, s->frame_count * s->fluid_count, sizeof *s->near);
    status = s->position && s->wall && s->normal && s->near ? ASCC_OK : ASCC_ERROR_MEMORY;
    if (status == ASCC_OK)
        status = measure(s, allocator, plan, tools);
    if (status != ASCC_OK) {
        ascc_fail(tools->message, status, "sequence %s: %s", s->name, ascc_status_text(status));
        ascc_kept_sequence_destroy(s, allocator);
    }
    return status;
}

void ascc_kept_sequence_destroy(ascc_kept_sequence *s, const ascc_allocator *allocator)
{
    const size_t d = (size_t)s->dimension, walls = s->wall_frames * s->boundary_count * d;
    if (s->position)
        ascc_release(allocator, s->position, s->frame_count * s->fluid_count * d, sizeof(float));
    if (s->wall)
        ascc_release(allocator, s->wall, walls, sizeof(float));
    if (s->normal)
        ascc_release(allocator, s->normal, walls, sizeof(float));
    if (s->near)
        ascc_release(allocator, s->near, s->frame_count * s->fluid_count, sizeof *s->near);
    memset(s, 0, sizeof *s);
}

/* ---- Rigid transforms ---- */

ascc_rigid_transform ascc_rigid_transform_none(void)
{
    return (ascc_rigid_transform){.turn = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}}};
}

void ascc_rigid_transform_apply(const ascc_rigid_transform *p, int32_t dimension, const float *from,
                                size_t count, bool vectors, double *to)
{
    const size_t d = (size_t)dimension;
    for (size_t i = 0; i < count; i++, from += d, to += d)
        for (size_t c = 0; c < d; c++) {
            to[c] = vectors ? 0.0 : p->shift[c];
            for (size_t k = 0; k < d; k++)
                to[c] += p->turn[c][k] * (double)from[k];
        }
}

static double unit(double v[3])
{
    const double length = sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    for (int c = 0; c < 3 && length > 0.0; c++)
        v[c] /= length;
    return length;
}

/* Any unit vector: a point of the ball, drawn until it is inside and not too near the centre. */
static void draw_direction(ascc_random *random, double v[3])
{
    double square;
    do {
        square = 0.0;
        for (int c = 0; c < 3; c++) {
            v[c] = 2.0 * ascc_random_uniform(random) - 1.0;
            square += v[c] * v[c];
        }
    } while (square > 1.0 || square < 0.01);
    unit(v);
}

/* A unit vector at random in the plane: cosine and sine of an angle without a call to libm. */
static void draw_angle(ascc_random *random, double *cosine, double *sine)
{
    double square;
    do {
        *cosine = 2.0 * ascc_random_uniform(random) - 1.0;
        *sine = 2.0 * ascc_random_uniform(random) - 1.0;
        square = *cosine * *cosine + *sine * *sine;
    } while (square > 1.0 || square < 0.01);
    *cosine /= sqrt(square);
    *sine /= sqrt(square);
}

/* turn = rotation about the axis, after which points are mirrored along `across` (if given). */
static void make_turn(double turn[3][3], const double axis[3], double cosine, double sine,
                      const double *across)
{
    const double cross[3][3] = {
        {0.0, -axis[2], axis[1]}, {axis[2], 0.0, -axis[0]}, {-axis[1], axis[0], 0.0}};
    double rotation[3][3];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            rotation[i][j] =
                (i == j ? cosine : 0.0) + sine * cross[i][j] + (1.0 - cosine) * axis[i] * axis[j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) {
            turn[i][j] = rotation[i][j];
            for (int k = 0; across && k < 3; k++)
                turn[i][j] -= 2.0 * across[i] * across[k] * rotation[k][j];
        }
}

ascc_rigid_transform ascc_rigid_transform_draw(ascc_random *random, const ascc_kept_sequence *s,
                                               bool rotate, bool mirror, double edge)
{
    ascc_rigid_transform p = ascc_rigid_transform_none();
    const bool flat = s->dimension == 2;
    double axis[3] = {0.0, 0.0, 1.0}, down[3], across[3], cosine = 1.0, sine = 0.0;
    memcpy(down, s->gravity, sizeof down);
    const bool falls = unit(down) > 0.0;
    draw_direction(random, across);
    if (!flat && falls)
        memcpy(axis, down, sizeof axis);
    else if (!flat)
        draw_direction(random, axis);
    if (rotate && !(flat && falls))
        draw_angle(random, &cosine, &sine);
    /* a plane along gravity: across has nothing of it */
    if (flat)
        across[2] = 0.0;
    if (falls) {
        const double along = across[0] * down[0] + across[1] * down[1] + across[2] * down[2];
        for (int c = 0; c < 3; c++)
            across[c] -= along * down[c];
    }
    const bool mirrors = ascc_random_uniform(random) < 0.5 && unit(across) > 1e-3 && mirror;
    make_turn(p.turn, axis, cosine, sine, mirrors ? across : NULL);
    for (int c = 0; c < s->dimension; c++)
        p.shift[c] = edge * ascc_random_uniform(random);
    return p;
}
