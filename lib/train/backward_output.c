/* The reverse pass through the output: pair by pair, each unordered pair once.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "backward_parts.h"

/* What pairs read and write, in the order of the output's set. */
typedef struct pairs_pass {
    const ascc_passing *p;
    const ascc_rows *rows;
    int32_t set;
    const float *value;    /* [row][inputs] */
    float *value_gradient; /* or NULL */
    const double *g;       /* [row][3] gradient of the corrections times units; walls 0 */
    const double *place;   /* [row][3] before the step, or NULL: directions as the network sees */
    const uint8_t *fluid;  /* [row] */
    float *share[ASCC_PARTS], *share_gradient[ASCC_PARTS]; /* [row][8] */
} pairs_pass;

static bool take_pairs(pairs_pass *q)
{
    const ascc_passing *p = q->p;
    const ascc_hierarchy *h = p->run->hierarchy;
    const ascc_plan *plan = p->run->network->plan;
    const size_t count = h->set[q->set].count, d = (size_t)plan->dimension;
    double *g = ascc_arena_take(p->pass->arena, count, 3 * sizeof *g);
    double *place = ascc_arena_take(p->pass->arena, count, 3 * sizeof *place);
    uint8_t *fluid = ascc_arena_take(p->pass->arena, count, 1);
    if (!g || !place || !fluid)
        return false;
    const double steps = p->pass->step->time_step / plan->time_step / plan->time_step;
    for (size_t i = 0; i < count; i++) {
        const size_t row = ascc_hierarchy_host_row(h, q->set, i);
        fluid[i] = row < h->fluid_count;
        for (size_t c = 0; c < 3; c++) {
            const bool there = fluid[i] && c < d;
            g[i * 3 + c] =
                there ? p->pass->correction[row * d + c] * plan->output.scale[c] * steps : 0.0;
            place[i * 3 + c] = there ? p->pass->position[row * d + c] : 0.0;
        }
    }
    q->g = g;
    q->place = plan->output.current_direction ? place : NULL;
    q->fluid = fluid;
    return true;
}

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* ---- An output with a basis ---- */

/* The two bumps that a distance lies in. */
typedef struct bumps_at {
    size_t first, count;
    double value[2], slope[2]; /* slope: by rho */
} bumps_at;

static bumps_at find_bumps(double rho, int32_t bumps)
{
    bumps_at at = {.count = 0};
    const double x = rho * bumps;
    at.first = (size_t)x;
    for (size_t k = at.first; k < (size_t)bumps && k < at.first + 2; k++) {
        const double t = x - (double)k, u = 1.0 - t * t;
        at.value[at.count] = u * u;
        at.slope[at.count++] = -4.0 * t * u * bumps;
    }
    return at;
}

/* Sum over bumps of what row i and, unless it is a wall, row j give. */
static double strength_of(const pairs_pass *q, int part, size_t i, size_t j, bool both,
                          const bumps_at *at, double *slope)
{
    double sum = 0.0;
    *slope = 0.0;
    if (!q->share[part])
        return 0.0;
    for (size_t k = 0; k < at->count; k++) {
        const double a = (double)q->share[part][i * ASCC_MAX_BUMPS + at->first + k] +
                         (both ? (double)q->share[part][j * ASCC_MAX_BUMPS + at->first + k] : 0.0);
        sum += at->value[k] * a;
        *slope += at->slope[k] * a;
    }
    return sum;
}

static void add_share(const pairs_pass *q, int part, size_t i, const bumps_at *at, double g)
{
    for (size_t k = 0; q->share[part] && k < at->count; k++)
        q->share_gradient[part][i * ASCC_MAX_BUMPS + at->first + k] += (float)(at->value[k] * g);
}

/* One pair and what its impulse along u is made of: cosine * strength - damping * approach. */
typedef struct pair {
    size_t i, j;
    bool both;               /* j is fluid, too */
    double distance, length; /* of r, seen, and of d, along which the pair acts */
    double seen[3], u[3];    /* unit vectors of r and d */
    double cosine, strength, damping, approach;
    double slope, damping_slope;  /* of strength and damping by distance over radius */
    double force[3], relative[3]; /* gradient of the impulse; motion of i less that of j */
    double along;                 /* force . u */
    double total;                 /* the impulse along u, limited */
    bool limited;                 /* then nothing but u changes it */
} pair;

/* Gradients by r (seen) and d (the line), added to the positions'. */
static void pass_places(const pairs_pass *q, const pair *a, const ascc_filter *filter)
{
    const ascc_passing *p = q->p;
    const ascc_hierarchy *h = p->run->hierarchy;
    const size_t n = (size_t)p->run->network->plan->dimension;
    const bool before = q->place && a->both; /* walls push along the line that the network sees */
    const double by_cosine = a->along * a->strength;
    const double by_rho =
        a->along * (a->cosine * a->slope - a->damping_slope * a->approach) / filter->radius;
    double by_u[3], by_seen[3], seen_i[3], seen_j[3], turned = 0.0, seen_turned = 0.0;
    for (size_t c = 0; c < 3; c++) {
        by_u[c] = a->force[c] * a->total - a->damping * a->along * a->relative[c] +
                  (before ? by_cosine * a->seen[c] : 0.0);
        by_seen[c] = before ? by_cosine * a->u[c] : 0.0;
        turned += by_u[c] * a->u[c];
        seen_turned += by_seen[c] * a->seen[c];
    }
    for (size_t c = 0; c < 3; c++) {
        const double by_d = (by_u[c] - turned * a->u[c]) / a->length;
        seen_j[c] = by_rho * a->seen[c] + (before ? 0.0 : by_d);
        if (a->distance > 0.0)
            seen_j[c] += (by_seen[c] - seen_turned * a->seen[c]) / a->distance;
        seen_i[c] = -seen_j[c];
        if (before && c < n) {
            p->pass->place[ascc_hierarchy_host_row(h, q->set, a->i) * n + c] -= by_d;
            p->pass->place[ascc_hierarchy_host_row(h, q->set, a->j) * n + c] += by_d;
        }
    }
    ascc_backward_place(p, q->set, a->i, seen_i);
    if (a->both)
        ascc_backward_place(p, q->set, a->j, seen_j);
}

static void find_pair(const pairs_pass *q, int part, const bumps_at *at, const double r[3],
                      const double d[3], pair *a)
{
    const ascc_passing *p = q->p;
    const ascc_plan *plan = p->run->network->plan;
    for (size_t c = 0; c < 3; c++) {
        a->u[c] = d[c] / a->length;
        a->seen[c] = a->distance > 0.0 ? r[c] / a->distance : 0.0;
        a->force[c] = q->g[a->i * 3 + c] - (a->both ? q->g[a->j * 3 + c] : 0.0);
        a->relative[c] = 0.0;
    }
    a->cosine = q->place && a->both ? dot3(a->seen, a->u) : 1.0;
    a->strength = strength_of(q, part, a->i, a->j, a->both, at, &a->slope);
    a->damping = strength_of(q, part + 1, a->i, a->j, a->both, at, &a->damping_slope);
    a->along = dot3(a->force, a->u);
    a->approach = 0.0;
    if (q->share[part + 1]) {
        const size_t width = ascc_padded(plan->fluid_channels);
        const float *motion = p->run->value[0].raw + ascc_plan_motion(plan, 0);
        for (int32_t c = 0; c < plan->dimension; c++)
            a->relative[c] = (double)motion[a->i * width + (size_t)c] -
                             (a->both ? (double)motion[a->j * width + (size_t)c] : 0.0);
        a->approach = dot3(a->relative, a->u);
    }
    const double limit = ascc_output_limit(&plan->output);
    a->total = a->cosine * a->strength - a->damping * a->approach;
    a->limited = fabs(a->total) > limit;
    if (a->limited) {
        a->total = a->total > 0.0 ? limit : -limit;
        a->strength = a->slope = a->damping = a->damping_slope = 0.0;
    }
}

/* One pair: line d from i to j, displacement r seen; parts `part` (strength) and part + 1 (damping). */
static void pass_pair(const pairs_pass *q, int part, const ascc_filter *filter, size_t i, size_t j,
                      bool both, const double r[3], const double d[3])
{
    const ascc_passing *p = q->p;
    const ascc_plan *plan = p->run->network->plan;
    pair a = {
        .i = i, .j = j, .both = both, .distance = sqrt(dot3(r, r)), .length = sqrt(dot3(d, d))};
    if (a.length == 0.0)
        return;
    const bumps_at at = find_bumps(a.distance / filter->radius, filter->bumps);
    find_pair(q, part, &at, r, d, &a);
    for (int side = 0; side < (both ? 2 : 1) && !a.limited; side++) {
        add_share(q, part, side ? j : i, &at, a.cosine * a.along);
        add_share(q, part + 1, side ? j : i, &at, -a.approach * a.along);
    }
    if (q->share[part + 1] && p->value[0].raw) {
        const size_t width = ascc_padded(plan->fluid_channels);
        float *motion = p->value[0].raw + ascc_plan_motion(plan, 0);
        for (int32_t c = 0; c < plan->dimension; c++) {
            const float g = (float)(-a.damping * a.along * a.u[c]);
            motion[i * width + (size_t)c] += g;
            if (both)
                motion[j * width + (size_t)c] -= g;
        }
    }
    if (p->pass->seen)
        pass_places(q, &a, filter);
}

static bool take_shares(pairs_pass *q)
{
    const ascc_passing *p = q->p;
    const ascc_network *network = p->run->network;
    const size_t count = p->run->hierarchy->set[q->set].count;
    const size_t a = ascc_padded(network->plan->output.inputs);
    const uint8_t *active = p->run->value[network->plan->output.source].active;
    for (int part = 0; part < ASCC_PARTS; part++) {
        if (!network->part_weight[part])
            continue;
        const size_t size = count * ASCC_MAX_BUMPS;
        q->share[part] = ascc_arena_take(p->pass->arena, size, sizeof(float));
        q->share_gradient[part] = ascc_arena_take(p->pass->arena, size, sizeof(float));
        if (!q->share[part] || !q->share_gradient[part])
            return false;
        memset(q->share[part], 0, size * sizeof(float));
        memset(q->share_gradient[part], 0, size * sizeof(float));
        for (size_t i = 0; i < count; i++)
            if (active[i])
                p->run->tools->kernels->multiply(
                    q->value + i * a, a, 1, a, network->part_weight[part], ASCC_MAX_BUMPS,
                    q->share[part] + i * ASCC_MAX_BUMPS, ASCC_MAX_BUMPS);
    }
    return true;
}

/* From the shares to the source's rows and the parts' weights. */
static void pass_shares(const pairs_pass *q)
{
    const ascc_passing *p = q->p;
    const ascc_network *network = p->run->network;
    const size_t count = p->run->hierarchy->set[q->set].count;
    const size_t a = ascc_padded(network->plan->output.inputs);
    const uint8_t *active = p->run->value[network->plan->output.source].active;
    for (int part = 0; part < ASCC_PARTS; part++) {
        const float *share = q->share_gradient[part];
        if (!share)
            continue;
        if (q->value_gradient)
            p->run->tools->kernels->multiply(share, ASCC_MAX_BUMPS, count, ASCC_MAX_BUMPS,
                                             p->pass->transposed->part[part], a, q->value_gradient,
                                             a);
        float *to = p->pass->arranged + (network->part_weight[part] - network->weights);
        for (size_t i = 0; i < count; i++)
            for (size_t c = 0; active[i] && c < a; c++)
                for (size_t k = 0; k < ASCC_MAX_BUMPS; k++)
                    to[c * ASCC_MAX_BUMPS + k] +=
                        q->value[i * a + c] * share[i * ASCC_MAX_BUMPS + k];
    }
}

static void pass_walls(const pairs_pass *q)
{
    const ascc_passing *p = q->p;
    const ascc_network *network = p->run->network;
    const ascc_filter *filter = &network->plan->output.walls.filter;
    const ascc_rows *rows = &p->run->rows[network->wall_key];
    for (size_t i = 0; i < rows->query->count; i++)
        for (size_t k = rows->start[i]; k < rows->start[i] + rows->count[i]; k++) {
            const size_t j = rows->neighbor[k];
            double r[3];
            ascc_seen_displacement(q->p, rows, i, j, r);
            pass_pair(q, ASCC_PART_WALL, filter, i, j, false, r, r);
        }
}

/* ---- An output with a grid ---- */

/* One pair: terms t = window * sum of trilinear weight * kernel . (f_i + f_j), turned along r if radial. */
static void pass_grid_pair(const pairs_pass *q, size_t i, size_t j, const double r[3])
{
    const ascc_passing *p = q->p;
    const ascc_network *network = p->run->network;
    const ascc_plan *plan = network->plan;
    const size_t a = ascc_padded(plan->output.inputs), b = (size_t)plan->dimension;
    const float *weight = network->term_weight[plan->term_count];
    float *weight_gradient = p->pass->arranged + (weight - network->weights);
    double force[3];
    for (size_t c = 0; c < 3; c++)
        force[c] = q->g[i * 3 + c] - q->g[j * 3 + c];
    double by_term[3] = {force[0], force[1], force[2]};
    const double square = dot3(r, r), along = square > 0.0 ? dot3(force, r) / square : 0.0;
    for (int c = 0; plan->output.radial && c < 3; c++)
        by_term[c] = along * r[c];
    ascc_place_in_cube at;
    ascc_trilinear t;
    ascc_place_in_cube_of(&plan->output.filter, r, &at);
    ascc_trilinear_at(plan->output.filter.cells, at.at, &t);
    const float *fi = q->value + i * a, *fj = q->value + j * a;
    double term[3] = {0.0, 0.0, 0.0}, by_cube[3] = {0.0, 0.0, 0.0}, by_window = 0.0;
    for (int n = 0; n < t.count; n++)
        for (size_t o = 0; o < b; o++) {
            const float *w = weight + (t.cell[n] * b + o) * a;
            float *g = weight_gradient + (t.cell[n] * b + o) * a;
            const float share = (float)(at.window * t.weight[n] * by_term[o]);
            for (size_t c = 0; c < a; c++)
                g[c] += share * (fi[c] + fj[c]);
            for (size_t c = 0; q->value_gradient && c < a; c++) {
                q->value_gradient[i * a + c] += share * w[c];
                q->value_gradient[j * a + c] += share * w[c];
            }
            if (!p->pass->seen)
                continue;
            double sum = 0.0;
            for (size_t c = 0; c < a; c++)
                sum += (double)w[c] * ((double)fi[c] + (double)fj[c]);
            term[o] += at.window * t.weight[n] * sum;
            by_window += t.weight[n] * sum * by_term[o];
            for (int c = 0; c < 3; c++)
                by_cube[c] += at.window * t.slope[n][c] * sum * by_term[o];
        }
    if (!p->pass->seen)
        return;
    double seen_i[3], seen_j[3];
    const double inside = plan->output.radial && square > 0.0 ? dot3(term, r) / square : 0.0;
    for (int c = 0; c < 3; c++) {
        seen_j[c] = by_window * at.window_slope[c];
        for (int k = 0; k < 3; k++)
            seen_j[c] += by_cube[k] * at.slope[k][c];
        /* force . (r (t . r) / r^2) by r, t held */
        if (plan->output.radial)
            seen_j[c] += force[c] * inside + along * term[c] - 2.0 * along * inside * r[c];
        seen_i[c] = -seen_j[c];
    }
    ascc_backward_place(p, q->set, i, seen_i);
    ascc_backward_place(p, q->set, j, seen_j);
}

/* ---- Both ---- */

static void pass_pairs(const pairs_pass *q)
{
    const ascc_filter *filter = &q->p->run->network->plan->output.filter;
    const ascc_rows *rows = q->rows;
    for (size_t i = 0; i < rows->query->count; i++) {
        if (!q->fluid[i])
            continue;
        for (size_t k = rows->start[i]; k < rows->start[i] + rows->count[i]; k++) {
            const size_t j = rows->neighbor[k];
            if (j == i || (j < i && q->fluid[j]))
                continue;
            double r[3], d[3];
            ascc_seen_displacement(q->p, rows, i, j, r);
            if (!q->place && dot3(r, r) == 0.0)
                continue; /* coincident: no impulse */
            for (size_t c = 0; c < 3; c++)
                d[c] = q->place ? q->place[j * 3 + c] - q->place[i * 3 + c] : r[c];
            if (filter->bumps)
                pass_pair(q, ASCC_PART_STRENGTH, filter, i, j, true, r, d);
            else
                pass_grid_pair(q, i, j, r);
        }
    }
}

static void pass_plain(const pairs_pass *q)
{
    const ascc_plan *plan = q->p->run->network->plan;
    const size_t a = ascc_padded(plan->output.inputs);
    for (size_t i = 0; i < q->p->run->hierarchy->set[q->set].count; i++)
        for (size_t c = 0; q->value_gradient && q->fluid[i] && c < (size_t)plan->dimension; c++)
            q->value_gradient[i * a + c] += (float)q->g[i * 3 + c];
}

ascc_status ascc_backward_output(ascc_passing *p)
{
    const ascc_network *network = p->run->network;
    const ascc_output *output = &network->plan->output;
    const ascc_value *value = &p->run->value[output->source];
    const ascc_value_gradient *gradient = &p->value[output->source];
    pairs_pass q = {.p = p,
                    .set = ascc_network_set(network, output->source),
                    .value = output->rectify ? value->rectified : value->raw,
                    .value_gradient = output->rectify ? gradient->rectified : gradient->raw};
    if (!take_pairs(&q))
        return ASCC_ERROR_MEMORY;
    if (output->kind == ASCC_OUTPUT_PLAIN) {
        pass_plain(&q);
        return ASCC_OK;
    }
    q.rows = &p->run->rows[network->term_key[network->plan->term_count]];
    if (output->filter.bumps && !take_shares(&q))
        return ASCC_ERROR_MEMORY;
    pass_pairs(&q);
    if (network->wall_key >= 0)
        pass_walls(&q);
    if (output->filter.bumps)
        pass_shares(&q);
    return ASCC_OK;
}
