/* Looks through a sequence for what must not be in training data: spikes, escapes, clumps.
 * SPDX-License-Identifier: MIT */
#include "inspect.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "near.h"

#define RADIUS 2.0 /* spacings, of the search and of the density */

typedef struct work {
    const inspect_input *input;
    inspect_limits limits;
    near_lists *lists;
    double *point;          /* [count + walls][3] */
    uint8_t *fast, *out;    /* [count] particles already counted */
    double *density;        /* [count] of one frame */
    double low[3], high[3]; /* of the walls, in all frames */
    const float *normal;    /* of the walls, in this one */
    inspection *found;
} work;

static double poly6(double square)
{
    const double t = 1.0 - square / (RADIUS * RADIUS);
    return t > 0.0 ? t * t * t : 0.0;
}

/* What poly6 sums to on an unbounded lattice. */
static double lattice_sum(int32_t d)
{
    double sum = 0.0;
    for (int z = d == 3 ? -2 : 0; z <= (d == 3 ? 2 : 0); z++)
        for (int y = -2; y <= 2; y++)
            for (int x = -2; x <= 2; x++)
                sum += poly6(x * x + y * y + z * z);
    return sum;
}

static size_t count_bad(const float *values, size_t count)
{
    size_t bad = 0;
    for (size_t i = 0; values && i < count; i++)
        bad += isfinite(values[i]) ? 0 : 1;
    return bad;
}

/* Bounds of what the fluid does: of the walls, or where there are none, of the fluid. */
static void find_reach(work *w)
{
    const inspect_input *in = w->input;
    const size_t d = (size_t)in->dimension;
    const float *points = in->walls ? in->wall : in->position;
    const size_t count = in->walls ? in->walls : in->count;
    const size_t stride = in->walls ? in->wall_stride : in->count * d;
    const size_t frames = stride ? in->frames : 1;
    double fall = 0.0, speed = 0.0;
    for (size_t c = 0; c < d; c++) {
        w->low[c] = INFINITY;
        w->high[c] = -INFINITY;
        for (size_t k = 0; k < frames * count; k++) {
            const double x = points[k / count * stride + k % count * d + c];
            w->low[c] = fmin(w->low[c], x);
            w->high[c] = fmax(w->high[c], x);
        }
        fall += 2.0 * fabs(in->gravity[c]) * (w->high[c] - w->low[c]);
    }
    for (size_t i = 0; i < in->count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const float *x = in->position + i * d + c;
            const double v = in->velocity      ? in->velocity[i * d + c]
                             : in->frames == 1 ? 0.0
                                               : (x[in->count * d] - x[0]) / in->time_step;
            square += v * v;
        }
        speed = fmax(speed, square);
    }
    w->found->reach = sqrt(speed + fall);
}

static void look_at_motion(work *w, size_t frame)
{
    const inspect_input *in = w->input;
    const size_t d = (size_t)in->dimension;
    const double limit = w->limits.speed * w->found->reach;
    double energy = 0.0;
    for (size_t i = 0; i < in->count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const float *x = in->position + (frame * in->count + i) * d + c;
            const double v = ((double)x[0] - (double)*(x - in->count * d)) / in->time_step;
            square += v * v;
        }
        energy += 0.5 * square / (double)in->count;
        w->found->fastest = fmax(w->found->fastest, sqrt(square));
        w->fast[i] |= sqrt(square) > limit;
    }
    if (frame == 1)
        w->found->energy_first = energy;
    w->found->energy_last = energy;
}

/* How far particle i is in front of wall point j, m. */
static double height_above(const work *w, size_t i, size_t j)
{
    const inspect_input *in = w->input;
    const float *normal = w->normal + (j - in->count) * (size_t)in->dimension;
    double above = 0.0;
    for (int c = 0; c < in->dimension; c++)
        above += (w->point[i * 3 + (size_t)c] - w->point[j * 3 + (size_t)c]) * normal[c];
    return above;
}

/* A particle is out when it is half a spacing behind every wall point within the radius (one is not
 * enough: at an edge the normals differ), or outside the walls' bounds by as much. */
static bool is_out(const work *w, size_t i, double height)
{
    const double margin = 0.5 * w->input->spacing;
    for (int c = 0; c < w->input->dimension; c++) {
        const double x = w->point[i * 3 + (size_t)c];
        if (x < w->low[c] - margin || x > w->high[c] + margin)
            return true;
    }
    return isfinite(height) && height < -margin;
}

typedef struct frame_sums {
    size_t pairs, clumps;
} frame_sums;

static void look_at_particle(work *w, size_t i, double rest, frame_sums *sums)
{
    const inspect_input *in = w->input;
    const near_lists *l = w->lists;
    const double scale = 1.0 / (in->spacing * in->spacing);
    double density = poly6(0.0), height = -INFINITY;
    size_t half = 0;
    bool close = false;
    for (uint32_t k = 0; k < l->count[i]; k++) {
        const size_t j = l->index[l->start[i] + k];
        double square = 0.0;
        for (int c = 0; c < in->dimension; c++) {
            const double e = w->point[i * 3 + (size_t)c] - w->point[j * 3 + (size_t)c];
            square += e * e;
        }
        square *= scale;
        if (j >= in->count) {
            height = fmax(height, height_above(w, i, j));
            continue;
        }
        density += poly6(square);
        half += square < 0.25;
        close |= square < 0.09;
    }
    sums->pairs += close;
    sums->clumps += half >= 2;
    w->density[i] = density / rest;
    if (in->walls)
        w->out[i] |= is_out(w, i, height);
}

static int descending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? 1 : x > y ? -1 : 0;
}

static ascc_status look_at_frame(work *w, size_t frame)
{
    const inspect_input *in = w->input;
    inspection *f = w->found;
    const size_t d = (size_t)in->dimension;
    for (size_t i = 0; i < in->count; i++)
        for (size_t c = 0; c < d; c++)
            w->point[i * 3 + c] = in->position[(frame * in->count + i) * d + c];
    for (size_t i = 0; i < in->walls; i++)
        for (size_t c = 0; c < d; c++)
            w->point[(in->count + i) * 3 + c] = in->wall[frame * in->wall_stride + i * d + c];
    w->normal = in->normal + frame * in->wall_stride;
    near_forget(w->lists);
    const ascc_status status = near_update(w->lists, in->count, in->walls, w->point, 3);
    if (status != ASCC_OK)
        return status;
    const double rest = lattice_sum(in->dimension);
    frame_sums sums = {0};
    double mean = 0.0, worst = 0.0;
    for (size_t i = 0; i < in->count; i++) {
        look_at_particle(w, i, rest, &sums);
        mean += w->density[i];
    }
    const double count = (double)in->count, share = 1.0 / (double)in->frames;
    const size_t top = 1 + in->count / 100;
    qsort(w->density, in->count, sizeof *w->density, descending);
    for (size_t i = 0; i < top; i++)
        worst += w->density[i] / (double)top;
    f->density_mean += share * mean / count;
    f->density_worst = fmax(f->density_worst, worst);
    f->pair_mean += share * (double)sums.pairs / count;
    f->pair_worst = fmax(f->pair_worst, (double)sums.pairs / count);
    f->clump_mean += share * (double)sums.clumps / count;
    if ((double)sums.clumps / count > f->clump_worst) {
        f->clump_worst = (double)sums.clumps / count;
        f->worst_frame = frame;
    }
    return ASCC_OK;
}

static void judge(const work *w, inspection *f)
{
    for (size_t i = 0; i < w->input->count; i++) {
        f->spikes += w->fast[i];
        f->escapes += w->out[i];
    }
    f->verdict = f->spikes                          ? "spikes"
                 : f->escapes                       ? "escapes"
                 : f->clump_mean > w->limits.clump  ? "clumps"
                 : f->clump_worst > w->limits.worst ? "clumps in a frame"
                                                    : NULL;
}

static ascc_status look(work *w)
{
    const inspect_input *in = w->input;
    const near_options options = {.dimension = in->dimension, .radius = RADIUS * in->spacing};
    const size_t points = in->count + in->walls;
    w->lists = near_create(&options);
    w->point = calloc(points, 3 * sizeof *w->point);
    w->fast = calloc(in->count, 1);
    w->out = calloc(in->count, 1);
    w->density = calloc(in->count, sizeof *w->density);
    if (!w->lists || !w->point || !w->fast || !w->out || !w->density)
        return ASCC_ERROR_MEMORY;
    find_reach(w);
    ascc_status status = ASCC_OK;
    for (size_t frame = 0; status == ASCC_OK && frame < in->frames; frame++) {
        status = look_at_frame(w, frame);
        if (frame > 0)
            look_at_motion(w, frame);
    }
    judge(w, w->found);
    return status;
}

ascc_status inspect(const inspect_input *input, const inspect_limits *limits, inspection *found)
{
    *found = (inspection){0};
    if (input->frames == 0 || input->count == 0)
        return ASCC_ERROR_ARGUMENT;
    work w = {.input = input, .found = found};
    if (limits)
        w.limits = *limits;
    if (w.limits.speed == 0.0)
        w.limits.speed = 5.0;
    if (w.limits.clump == 0.0)
        w.limits.clump = 0.005;
    if (w.limits.worst == 0.0)
        w.limits.worst = 0.05;
    const size_t d = (size_t)input->dimension;
    found->not_finite = count_bad(input->position, input->frames * input->count * d) +
                        count_bad(input->velocity, input->count * d) +
                        count_bad(input->wall, input->walls * d);
    if (found->not_finite) {
        found->verdict = "not finite";
        return ASCC_OK;
    }
    const ascc_status status = look(&w);
    near_destroy(&w.lists);
    free(w.point);
    free(w.fast);
    free(w.out);
    free(w.density);
    return status;
}
