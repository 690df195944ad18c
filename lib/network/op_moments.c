/* Pair moments: sums over neighbours of a radial basis times what is known of a pair, without weights
 * (the first convolution of order 1 with its matrix taken out of the sum: a dense layer follows).
 * SPDX-License-Identifier: MIT
 *
 * Of a fluid pair: 1, the unit vector to the neighbour, the speed of approach, the difference of velocities;
 * of a wall: 1, the unit vector, the speed at which it and the particle approach, its normal, each times its area where the boundary has
 * that feature. Galilean invariant by construction.
 * Channels: [bump][number] of the fluid, then of walls. A particle is a neighbour of its own, at no distance.
 */
#include <math.h>

#include "column.h"
#include "model/cost.h"
#include "model/filter.h"

/* Of the walls' list; no bumps, no walls. */
enum { OPTION_WALL_BUMPS = 0, OPTION_WALL_RADIUS = 1 };

static int32_t wall_bumps(const ascc_term *term)
{
    return (int32_t)term->option[OPTION_WALL_BUMPS];
}

/* Numbers of a pair. */
static int32_t numbers(const ascc_plan *plan)
{
    return 2 + 2 * plan->dimension;
}

static int32_t normal_channel(const ascc_plan *plan)
{
    return ascc_plan_feature(plan, 1, ASCC_FEATURE_NORMAL);
}

static void read_moments(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                         ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)name;
    ascc_filter_read_basis(reader, object, plan->dimension, &term->filter, true);
    if (!ascc_reader_has(reader, object, "walls"))
        return;
    ascc_filter walls = {.radius = 0.0};
    const uint32_t inside = ascc_reader_object(reader, object, "walls");
    if (reader->status == ASCC_OK)
        ascc_filter_read_basis(reader, inside, plan->dimension, &walls, true);
    ascc_reader_end(reader, inside);
    term->option[OPTION_WALL_BUMPS] = walls.bumps;
    term->option[OPTION_WALL_RADIUS] = walls.radius;
}

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    const ascc_plan *plan = &builder->plan;
    ascc_term *term = &entry->term;
    const ascc_quoted quoted = ascc_quote(layer->name);
    if (term->source != 0 || layer->set != ASCC_SET_FLUID || term->rectify ||
        ascc_plan_motion(plan, 0) < 0)
        return FAIL("layer '%s': 'moments' are of 'fluid' with the feature 'motion', without "
                    "'relu', on the points 'fluid'",
                    quoted.text);
    if (wall_bumps(term) && normal_channel(plan) < 0)
        return FAIL("layer '%s': moments of 'walls' need the boundary's feature 'normal'",
                    quoted.text);
    if (term->filter.neighbor_limit)
        return FAIL("layer '%s': moments have no 'neighbor_limit'", quoted.text);
    term->outputs = numbers(plan) * (term->filter.bumps + wall_bumps(term));
    return ascc_plan_check_filter(builder, &term->filter, quoted.text);
}

static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    (void)plan;
    (void)set;
    key[0] = (ascc_list_key){
        .query = ASCC_SET_FLUID, .source = ASCC_SET_FLUID, .radius = term->filter.radius};
    key[1] = (ascc_list_key){.query = ASCC_SET_FLUID,
                             .source = ASCC_SET_BOUNDARY,
                             .radius = term->option[OPTION_WALL_RADIUS]};
    return wall_bumps(term) ? 2 : 1;
}

/* Two bumps reach a pair. */
static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const double pairs = ascc_cost_neighbors(plan, counts, ASCC_SET_FLUID, term->filter.radius) +
                         (wall_bumps(term) ? ascc_cost_neighbors(plan, counts, ASCC_SET_BOUNDARY,
                                                                 term->option[OPTION_WALL_RADIUS])
                                           : 0.0);
    return ascc_cost_points(counts, set) * pairs * 2.0 * numbers(plan);
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)plan;
    (void)term;
    sizes->scratch = ascc_max_size(sizes->scratch, ASCC_GEOMETRY_ARRAYS * sizes->room);
}

static bool always(const ascc_term *term)
{
    (void)term;
    return true;
}

/* The term's filter, or that of its walls. */
static ascc_filter filter_of(const ascc_term *term, int list)
{
    ascc_filter filter = term->filter;
    if (list) {
        filter.bumps = wall_bumps(term);
        filter.radius = term->option[OPTION_WALL_RADIUS];
    }
    return filter;
}

/* What the second vector of a pair is read from: motion of the fluid, normals of walls. */
static const float *vectors_of(const ascc_network_run *run, int list, size_t *stride)
{
    const ascc_plan *plan = run->plan;
    *stride = ascc_padded(list ? plan->boundary_channels : plan->fluid_channels);
    return run->value[list].raw + (list ? normal_channel(plan) : ascc_plan_motion(plan, 0));
}

/* Moments of one row over one list, [bump][8]. */
static void sum_row(const ascc_tile *tile, const ascc_term *term, int list, size_t row, float *sum)
{
    const ascc_network_run *run = tile->run;
    const ascc_rows *rows = ascc_term_list(run, term, list);
    const ascc_filter filter = filter_of(term, list);
    const uint32_t *neighbor = rows->neighbor + rows->start[row];
    const size_t count = rows->count[row], d = (size_t)run->plan->dimension;
    size_t stride, own_stride;
    const float *vectors = vectors_of(run, list, &stride);
    const float *motion = vectors_of(run, 0, &own_stride) + row * own_stride;
    const float own[3] = {motion[0], motion[1], d > 2 ? motion[2] : 0.0f};
    float *scratch = tile->scratch;
    const ascc_pairs pairs = {.x = scratch,
                              .y = scratch + tile->room,
                              .z = scratch + 2 * tile->room,
                              .distance = scratch + 3 * tile->room};
    run->tools->kernels->directions(run->hierarchy->place[list], neighbor, count,
                                    run->hierarchy->place[0] + row * 4, (float)(1.0 / rows->radius),
                                    &pairs);
    run->tools->kernels->moments(&pairs, neighbor, count, vectors, stride, own, list, d,
                                 list ? ascc_wall_areas(run) : NULL, stride,
                                 list ? run->hierarchy->drift : NULL, (size_t)filter.bumps, sum);
}

/* The numbers of bumps, in a plane without those that it does not have. */
static void add_bumps(const float *restrict from, int32_t bumps, int32_t dimension,
                      float *restrict to)
{
    for (int32_t n = 0; dimension == 3 && n < 8 * bumps; n++)
        to[n] += from[n];
    for (int32_t n = 0; dimension < 3 && n < 8 * bumps; n++)
        if (n % 8 != 3 && n % 8 != 7)
            *to++ += from[n];
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_plan *plan = tile->run->plan;
    for (size_t r = 0; r < tile->n; r++) {
        float *to = tile->sum + r * tile->width + term->column, sum[ASCC_MAX_BUMPS * 8];
        for (int list = 0; list < (wall_bumps(term) ? 2 : 1); list++) {
            const int32_t bumps = list ? wall_bumps(term) : term->filter.bumps;
            if (ascc_term_list(tile->run, term, list)->count[tile->list[r]]) { /* mostly no walls */
                sum_row(tile, term, list, tile->list[r], sum);
                add_bumps(sum, bumps, plan->dimension, to);
            }
            to += bumps * numbers(plan);
        }
    }
}

/* ---- The way back: with gradients of positions only ---- */

/* What a pair's bumps and numbers give, against the gradient of a row's moments. */
typedef struct pair_gradient {
    double by_rho, by_number[8]; /* numbers as in kernels.h */
} pair_gradient;

/* Reads the gradient of a bump's number; there are fewer in a plane. */
static double gradient_at(const float *gradient, int32_t dimension, int32_t bump, int number)
{
    if (dimension == 3)
        return (double)gradient[bump * 8 + number];
    return number == 3 || number == 7 ? 0.0
                                      : (double)gradient[bump * 6 + number - (number > 3 ? 1 : 0)];
}

static pair_gradient gradient_of_pair(const float *gradient, int32_t dimension, int32_t bumps,
                                      double rho, const double q[8])
{
    pair_gradient g = {0.0, {0.0}};
    for (int32_t b = 0; b < bumps; b++) {
        const double t = bumps * rho - b, u = 1.0 - t * t;
        if (u <= 0.0)
            continue;
        for (int n = 0; n < 8; n++) {
            const double e = gradient_at(gradient, dimension, b, n);
            g.by_rho += e * q[n] * -4.0 * t * u * bumps;
            g.by_number[n] += e * u * u;
        }
    }
    return g;
}

static void backward_pair(const ascc_reverse *pass, const ascc_term *term, int list, size_t row,
                          size_t j, const float *gradient)
{
    const ascc_network_run *run = pass->run;
    const ascc_rows *rows = ascc_term_list(run, term, list);
    const ascc_filter filter = filter_of(term, list);
    const int32_t d = run->plan->dimension;
    size_t stride, own_stride;
    const float *vectors = vectors_of(run, list, &stride) + j * stride;
    const float *own = vectors_of(run, 0, &own_stride) + row * own_stride;
    const float *areas = list ? ascc_wall_areas(run) : NULL;
    const double area = areas ? (double)areas[j * stride] : 1.0;
    double r[3], u[3] = {0.0, 0.0, 0.0}, relative[3] = {0.0, 0.0, 0.0}, q[8] = {area},
                 drift[3] = {0.0};
    if (list)
        ascc_wall_drift(run, j, drift);
    ascc_seen_displacement(run, rows, row, j, r);
    const double distance = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
    for (int32_t c = 0; c < d; c++) {
        u[c] = distance > 0.0 ? r[c] / distance : 0.0;
        relative[c] = (list ? drift[c] : (double)vectors[c]) - (double)own[c];
        q[1 + c] = area * u[c];
        q[4] -= area * u[c] * relative[c];
        q[5 + c] = list ? (double)vectors[c] : relative[c];
    }
    const pair_gradient g =
        gradient_of_pair(gradient, d, filter.bumps, distance / filter.radius, q);
    double by_u[3] = {0.0, 0.0, 0.0}, along = 0.0, by_r[3] = {0.0, 0.0, 0.0}, back[3];
    float *motion = pass->value[0].raw ? pass->value[0].raw + ascc_plan_motion(run->plan, 0) : NULL;
    for (int32_t c = 0; c < d; c++) {
        by_u[c] = area * (g.by_number[1 + c] - g.by_number[4] * relative[c]);
        along += by_u[c] * u[c];
        const float by_relative =
            (float)((list ? 0.0 : g.by_number[5 + c]) - area * g.by_number[4] * u[c]);
        if (motion)
            motion[row * own_stride + (size_t)c] -= by_relative;
        if (motion && !list)
            motion[j * own_stride + (size_t)c] += by_relative;
    }
    for (int c = 0; c < 3; c++) {
        if (distance > 0.0)
            by_r[c] = g.by_rho * u[c] / filter.radius + (by_u[c] - along * u[c]) / distance;
        back[c] = -by_r[c];
    }
    ascc_reverse_place(pass, list ? ASCC_SET_BOUNDARY : ASCC_SET_FLUID, j, by_r);
    ascc_reverse_place(pass, ASCC_SET_FLUID, row, back);
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    const size_t b = ascc_padded(term->outputs);
    const size_t walls = (size_t)(term->filter.bumps * numbers(pass->run->plan));
    for (size_t r = 0; pass->pass->seen && r < n; r++)
        for (int l = 0; l < (wall_bumps(term) ? 2 : 1); l++) {
            const ascc_rows *rows = ascc_term_list(pass->run, term, l);
            const uint32_t *neighbor = rows->neighbor + rows->start[list[r]];
            for (size_t k = 0; k < rows->count[list[r]]; k++)
                if (l || neighbor[k] != list[r])
                    backward_pair(pass, term, l, list[r], neighbor[k],
                                  pass->tile + r * b + (l ? walls : 0));
        }
}

const ascc_operation ascc_op_moments = {.name = "pair moments",
                                        .type = "moments",
                                        .read = read_moments,
                                        .check = check,
                                        .lists = lists,
                                        .cost = cost,
                                        .scratch = scratch,
                                        .reads_features = always,
                                        .forward = forward,
                                        .leads_to_places = true,
                                        .backward = backward};
