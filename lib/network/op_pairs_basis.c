/* An antisymmetric output in a radial basis: pairs pushed and damped along the line between them, and
 * walls likewise (docs/file-format.md). SPDX-License-Identifier: MIT
 *
 * The strength of a pair is linear in what the two particles hold, so each particle is multiplied with the
 * weights of all radial basis functions (`bumps`) once, and a pair costs the two that reach it.
 * Packed: of fluid pairs, then of walls [padded inputs][16]: strength and damping of each bump in turn.
 */
#include <math.h>
#include <string.h>

#include "column.h"
#include "line_reverse.h"
#include "model/cost.h"
#include "model/filter.h"
#include "model/initial.h"
#include "pair_reverse.h"
#include "pair_sum.h"

/* The parts are the tensors: strengths and dampings of fluid pairs and of walls; two make a side. */
#define PARTS ASCC_MAX_TENSORS
enum { FLUID = 0, WALLS = 1, SIDES = 2 };
/* Coefficients of a row and side, and where a part has that of a bump. */
#define WIDTH (2 * ASCC_MAX_BUMPS)

static size_t place_of(int part, size_t bump)
{
    return 2 * bump + (size_t)(part % 2);
}

static const ascc_filter *filter_of(const ascc_output *output, int part)
{
    return part < ASCC_TENSOR_WALL ? &output->term.filter : &output->walls;
}

static void read_pairs(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                       const char *name[ASCC_MAX_TENSORS])
{
    static const char *const directions[] = {"current"};
    ascc_output *output = (ascc_output *)term; /* its first member */
    name[ASCC_TENSOR_STRENGTH] = ascc_reader_text(reader, object, "kernel");
    ascc_filter_read_basis(reader, object, plan->dimension, &term->filter, true);
    if (ascc_reader_has(reader, object, "direction"))
        output->current_direction =
            1 + ascc_reader_choice(reader, object, "direction", directions, 1);
    name[ASCC_TENSOR_DAMPING] = ascc_reader_optional_text(reader, object, "damping");
    if (ascc_reader_has(reader, object, "limit"))
        output->limit = ascc_reader_number(reader, object, "limit", 1e-30, ASCC_PLAN_MAX);
    if (!ascc_reader_has(reader, object, "walls"))
        return;
    const uint32_t walls = ascc_reader_object(reader, object, "walls");
    ascc_reader_where(reader, "output 'walls'");
    output->has_walls = 1;
    name[ASCC_TENSOR_WALL] = ascc_reader_text(reader, walls, "kernel");
    name[ASCC_TENSOR_WALL_DAMPING] = ascc_reader_optional_text(reader, walls, "damping");
    if (ascc_reader_has(reader, walls, "basis"))
        ascc_filter_read_basis(reader, walls, plan->dimension, &output->walls, true);
    else
        ascc_reader_fail(reader, "a basis is missing");
    if (ascc_reader_has(reader, walls, "contact"))
        output->contact = ascc_reader_number(reader, walls, "contact", 0.0, output->walls.radius);
    ascc_reader_end(reader, walls);
    ascc_reader_where(reader, "output");
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)stored;
    for (int part = 0; part < PARTS; part++) {
        const ascc_filter *filter = part < ASCC_TENSOR_WALL ? &term->filter : &plan->output.walls;
        wanted[part] = (ascc_tensor_wanted){.dimensions = "bumps, inputs",
                                            .rank = 2,
                                            .shape = {(size_t)filter->bumps, (size_t)term->inputs}};
    }
}

/* Weak, so that training begins near a fluid that falls freely, and hardly bounces. */
static void fill_initial(ascc_initial *initial)
{
    const bool damps = initial->term->operation->not_negative >> initial->number & 1;
    ascc_initial_fill(initial, 0, initial->count,
                      (damps ? 0.05 : 0.02) * ascc_initial_output(initial->plan));
}

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

/* What needs one particle's values for each fluid row. */
static ascc_status check_options(ascc_plan_builder *builder, const ascc_term *term,
                                 const char *const name[ASCC_MAX_TENSORS])
{
    const ascc_output *output = &builder->plan.output;
    const bool damped = name[ASCC_TENSOR_DAMPING] || name[ASCC_TENSOR_WALL_DAMPING];
    const int32_t set = ascc_plan_value_set(builder->layer, term->source);
    for (int32_t i = 1; i < builder->plan.dimension; i++)
        if (output->scale[i] != output->scale[0])
            return FAIL("output: with a basis 'scale' must be the same in all directions");
    if ((output->has_walls || damped || output->current_direction) && set != ASCC_SET_FLUID)
        return FAIL(
            "output: 'walls', 'damping' and 'direction' need a source on the points 'fluid'");
    if (damped && (!term->rectify || ascc_plan_motion(&builder->plan, 0) < 0))
        return FAIL("output: 'damping' needs 'relu' and the feature 'motion'");
    return ASCC_OK;
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)layer;
    ascc_term *term = &entry->term;
    ascc_output *output = &builder->plan.output;
    output->conserves = output->central = 1;
    term->filter.skip_self = 1;
    ascc_status status = ascc_plan_check_filter(builder, &term->filter, "output");
    if (status == ASCC_OK && output->has_walls)
        status = ascc_plan_check_filter(builder, &output->walls, "output 'walls'");
    return status == ASCC_OK ? check_options(builder, term, name) : status;
}

static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    key[0] = (ascc_list_key){.query = set,
                             .source = set,
                             .limit = term->filter.neighbor_limit,
                             .radius = term->filter.radius};
    key[1] = (ascc_list_key){.query = ASCC_SET_FLUID,
                             .source = ASCC_SET_BOUNDARY,
                             .limit = plan->output.walls.neighbor_limit,
                             .radius = plan->output.walls.radius};
    return plan->output.has_walls ? 2 : 1;
}

/* ---- Weights ---- */

static size_t side_size(const ascc_term *term)
{
    return ascc_padded(term->inputs) * WIDTH;
}

static size_t packed_size(const ascc_plan *plan, const ascc_term *term)
{
    (void)plan;
    return SIDES * side_size(term);
}

static void pack(const ascc_plan *plan, const ascc_term *term, float *packed)
{
    const size_t a = (size_t)term->inputs;
    for (int part = 0; part < PARTS; part++) {
        const float *from = term->tensor[part];
        float *to = packed + (size_t)(part / 2) * side_size(term);
        for (size_t k = 0; from && k < (size_t)filter_of(&plan->output, part)->bumps; k++)
            for (size_t i = 0; i < a; i++)
                to[i * WIDTH + place_of(part, k)] = from[k * a + i];
    }
}

static void unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                   float *const gradient[ASCC_MAX_TENSORS])
{
    const size_t a = (size_t)term->inputs;
    for (int part = 0; part < PARTS; part++) {
        const float *from = packed + (size_t)(part / 2) * side_size(term);
        float *to = gradient[part];
        for (size_t k = 0; to && k < (size_t)filter_of(&plan->output, part)->bumps; k++)
            for (size_t i = 0; i < a; i++)
                to[k * a + i] += from[i * WIDTH + place_of(part, k)];
    }
}

static void transpose(const ascc_plan *plan, const ascc_term *term, const float *packed, float *to)
{
    (void)plan;
    for (int side = 0; side < SIDES; side++, packed += side_size(term), to += side_size(term))
        ascc_transpose(packed, ascc_padded(term->inputs), WIDTH, to);
}

static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    int32_t bumps = 0;
    for (int part = 0; part < PARTS; part++)
        bumps += term->tensor[part] ? filter_of(&plan->output, part)->bumps : 0;
    return ascc_cost_points(counts, set) * bumps * term->inputs;
}

static bool is_damped(const ascc_term *term)
{
    return term->tensor[ASCC_TENSOR_DAMPING] || term->tensor[ASCC_TENSOR_WALL_DAMPING];
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)term;
    sizes->column = 4 * sizeof(int64_t) + WIDTH * sizeof(float);
    if (plan->output.current_direction)
        sizes->column += 3 * sizeof(double);
}

/* ---- Coefficients: what each particle gives each radial basis function ---- */

typedef struct coefficients {
    const ascc_network_run *run;
    const ascc_impulse_scale *scale;
    const int32_t *seen; /* [set rows][4] where the network sees them */
    float *side[SIDES];  /* [set rows][WIDTH], NULL = not kept */
    const double *place; /* [set rows][3] positions that directions come from, else NULL */
} coefficients;

static bool has_side(const ascc_term *term, int side)
{
    return term->tensor[2 * side] || term->tensor[2 * side + 1];
}

/* Coefficients of n rows from i on. */
static void multiply_rows(const ascc_network_run *run, int side, size_t i, size_t n, float *to)
{
    const ascc_term *term = &run->plan->output.term;
    const size_t a = ascc_padded(term->inputs);
    memset(to, 0, n * WIDTH * sizeof *to);
    run->tools->kernels->multiply(ascc_term_source(run, term) + i * a, a, n, a,
                                  ascc_term_packed(run, term) + (size_t)side * side_size(term),
                                  WIDTH, to, WIDTH);
}

/* Of the rows that are active, stretch by stretch; 0 of the others. */
static void compute_coefficients(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const coefficients *job = data;
    const uint8_t *active = job->run->value[job->run->plan->output.term.source].active;
    for (size_t i = begin, stop; i < end; i = stop) {
        for (stop = i + 1; stop < end && active[i] && active[stop];)
            stop++;
        for (int side = 0; side < SIDES; side++) {
            float *to = job->side[side] ? job->side[side] + i * WIDTH : NULL;
            if (to && active[i])
                multiply_rows(job->run, side, i, stop - i, to);
            else if (to)
                memset(to, 0, WIDTH * sizeof *to);
        }
    }
}

/* Those of `sides`. take: ascc_arena_take or ascc_arena_lend. */
static bool find_coefficients(coefficients *c, const ascc_network_run *run, int sides,
                              ascc_arena *arena, void *(*take)(ascc_arena *, size_t, size_t))
{
    const ascc_term *term = &run->plan->output.term;
    const size_t count = run->hierarchy->set[ascc_network_set(run->network, term->source)].count;
    c->run = run;
    for (int side = 0; side < sides; side++) {
        if (!has_side(term, side))
            continue;
        c->side[side] = take(arena, count, WIDTH * sizeof(float));
        if (!c->side[side])
            return false;
    }
    ascc_workers_run(run->tools->workers, count, 1024, compute_coefficients, c);
    return true;
}

/* Positions before the step, in the order of the set. */
static bool find_places(coefficients *c, const ascc_pair_sum *sum)
{
    const size_t d = (size_t)c->run->plan->dimension;
    const size_t count = c->run->hierarchy->set[sum->set].count;
    double *place = ascc_arena_lend(c->run->tools->arena, count, 3 * sizeof *place);
    for (size_t i = 0; place && i < count; i++) {
        const size_t row = ascc_hierarchy_host_row(c->run->hierarchy, sum->set, i);
        for (size_t k = 0; k < 3; k++)
            place[i * 3 + k] = k < d ? c->scale->position[row * d + k] : 0.0;
    }
    c->place = place;
    return place != NULL;
}

/* Where the network sees the rows of the set; NULL without memory. */
static const int32_t *find_seen(const ascc_network_run *run, int32_t set)
{
    const ascc_points *points = &run->hierarchy->set[set];
    if (set <= ASCC_SET_BOUNDARY)
        return run->hierarchy->place[set];
    int32_t *seen = ascc_arena_lend(run->tools->arena, points->count, 4 * sizeof *seen);
    for (size_t i = 0; seen && i < points->count; i++)
        for (size_t c = 0; c < 4; c++)
            seen[i * 4 + c] = c < 3 ? points->low[c][i] : 0;
    return seen;
}

/* ---- Pairs ---- */

/* What pairs of a side read. */
static ascc_lines lines_of(const coefficients *c, int side)
{
    const ascc_plan *plan = c->run->plan;
    const ascc_term *term = &plan->output.term;
    const ascc_rows *rows = ascc_term_list(c->run, term, side);
    ascc_lines l = {.row = c->seen,
                    .neighbor =
                        side == FLUID ? c->seen : c->run->hierarchy->place[ASCC_SET_BOUNDARY],
                    .inverse_radius = (float)(1.0 / rows->radius),
                    .bumps = (size_t)filter_of(&plan->output, 2 * side)->bumps,
                    .dimension = (size_t)plan->dimension,
                    .both = side == FLUID,
                    .coefficient = c->side[side],
                    .place = side == FLUID ? c->place : NULL,
                    .factor = c->scale ? c->scale->factor[0] : 0.0, /* of impulses alone */
                    .limit = ascc_output_limit(&plan->output)};
    if (side == WALLS) {
        l.area = ascc_wall_areas(c->run);
        l.area_stride = ascc_padded(plan->boundary_channels);
    }
    if (term->tensor[2 * side + 1]) {
        l.a = ascc_padded(plan->fluid_channels);
        l.motion = c->run->value[0].raw + ascc_plan_motion(plan, 0);
        l.drift = side == WALLS ? c->run->hierarchy->drift : NULL;
    }
    return l;
}

static void evaluate(ascc_pair_sum *sum, size_t i, ascc_pair_batch *b)
{
    const ascc_kernels *kernels = sum->run->tools->kernels;
    const ascc_lines *lines = sum->data;
    ascc_pair_impulses impulse;
    double mass[ASCC_PAIR_BATCH];
    mass[0] = sum->mass[i];
    for (size_t k = 0; k < b->count && !sum->uniform; k++)
        mass[k] = ascc_pair_mass(sum->mass[i], sum->mass[b->neighbor[k]]);
    kernels->pair_lines(lines, i, lines->coefficient + i * WIDTH, b->neighbor, b->count, mass,
                        !sum->uniform, impulse);
    if (!kernels->add_impulses(impulse, ASCC_IMPULSE_LIMIT, b->neighbor, b->count, sum->sum + i * 4,
                               sum->sum))
        ascc_pair_sum_note_bad(sum, i);
}

static void evaluate_walls(ascc_pair_sum *sum, size_t i, ascc_pair_batch *b)
{
    ascc_pair_impulses impulse;
    float own[WIDTH];
    multiply_rows(sum->run, WALLS, i, 1, own);
    sum->run->tools->kernels->pair_lines(sum->data, i, own, b->neighbor, b->count, &sum->mass[i], 0,
                                         impulse);
    ascc_pair_sum_add_walls(sum, i, b, impulse);
}

static ascc_status impulses(const ascc_network_run *run, const ascc_impulse_scale *scale,
                            const ascc_impulses *to, uint64_t *pair_count)
{
    const ascc_output *output = &run->plan->output;
    const ascc_term *term = &output->term;
    coefficients c = {.scale = scale};
    ascc_pair_sum sum;
    const ascc_status status =
        ascc_pair_sum_open(&sum, run, ascc_network_set(run->network, term->source), scale->mass, 4);
    if (status != ASCC_OK)
        return status;
    c.seen = find_seen(run, sum.set);
    if (!c.seen || !find_coefficients(&c, run, WALLS, run->tools->arena, ascc_arena_lend) ||
        (output->current_direction && !find_places(&c, &sum)))
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the impulses");
    ascc_lines lines = lines_of(&c, FLUID);
    sum.data = &lines;
    sum.skip_coincident = !c.place;
    ascc_pair_sum_run(&sum, ascc_term_list(run, term, 0), evaluate);
    if (output->has_walls) {
        lines = lines_of(&c, WALLS);
        ascc_pair_sum_run_walls(&sum, ascc_term_list(run, term, 1), to->wall, evaluate_walls);
    }
    return ascc_pair_sum_give(&sum, ascc_term_source(run, term), ascc_padded(term->inputs), to,
                              pair_count);
}

/* ---- The way back ---- */

/* What the visitor of pairs reads and adds to. */
typedef struct gradients {
    coefficients c;
    float *side[SIDES]; /* [row][WIDTH] */
} gradients;

/* The two radial basis functions that reach a distance. */
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
static double strength_of(const ascc_pair_reverse *q, int part, size_t i, size_t j, bool both,
                          const bumps_at *at, double *slope)
{
    double sum = 0.0;
    *slope = 0.0;
    const float *share = ((const gradients *)q->data)->c.side[part / 2];
    for (size_t k = 0; k < at->count; k++) {
        const size_t place = place_of(part, at->first + k);
        const double a =
            (double)share[i * WIDTH + place] + (both ? (double)share[j * WIDTH + place] : 0.0);
        sum += at->value[k] * a;
        *slope += at->slope[k] * a;
    }
    return sum;
}

static void add_share(const ascc_pair_reverse *q, int part, size_t i, const bumps_at *at, double g)
{
    float *share = ((const gradients *)q->data)->side[part / 2];
    for (size_t k = 0; k < at->count; k++)
        share[i * WIDTH + place_of(part, at->first + k)] += (float)(at->value[k] * g);
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
    double area;                  /* of a wall */
    double total;                 /* the impulse along u, limited */
    bool limited;                 /* then nothing but u changes it */
} pair;

/* Gradients by r (seen) and d (the line), added to the positions'. */
static void pass_places(const ascc_pair_reverse *q, const pair *a, const ascc_filter *filter)
{
    const ascc_reverse *p = q->pass;
    const ascc_hierarchy *h = p->run->hierarchy;
    const size_t n = (size_t)p->run->plan->dimension;
    const bool before = q->place && a->both; /* walls push along the line that the network sees */
    const double by_cosine = a->along * a->strength;
    const double by_rho =
        a->along * (a->cosine * a->slope - a->damping_slope * a->approach) / filter->radius;
    double by_u[3], by_seen[3], seen_i[3], seen_j[3], radial = 0.0, seen_radial = 0.0;
    for (size_t c = 0; c < 3; c++) {
        by_u[c] = a->force[c] * a->total - a->damping * a->along * a->relative[c] +
                  (before ? by_cosine * a->seen[c] : 0.0);
        by_seen[c] = before ? by_cosine * a->u[c] : 0.0;
        radial += by_u[c] * a->u[c];
        seen_radial += by_seen[c] * a->seen[c];
    }
    for (size_t c = 0; c < 3; c++) {
        const double by_d = (by_u[c] - radial * a->u[c]) / a->length;
        seen_j[c] = by_rho * a->seen[c] + (before ? 0.0 : by_d);
        if (a->distance > 0.0)
            seen_j[c] += (by_seen[c] - seen_radial * a->seen[c]) / a->distance;
        seen_i[c] = -seen_j[c];
        if (before && c < n) {
            p->pass->place[ascc_hierarchy_host_row(h, q->set, a->i) * n + c] -= by_d;
            p->pass->place[ascc_hierarchy_host_row(h, q->set, a->j) * n + c] += by_d;
        }
    }
    ascc_reverse_place(p, q->set, a->i, seen_i);
    if (a->both)
        ascc_reverse_place(p, q->set, a->j, seen_j);
}

static void find_pair(const ascc_pair_reverse *q, int part, const bumps_at *at, const double r[3],
                      const double d[3], pair *a)
{
    const ascc_reverse *p = q->pass;
    const ascc_plan *plan = p->run->plan;
    for (size_t c = 0; c < 3; c++) {
        a->u[c] = d[c] / a->length;
        a->seen[c] = a->distance > 0.0 ? r[c] / a->distance : 0.0;
        a->force[c] = q->force[a->i * 3 + c] - (a->both ? q->force[a->j * 3 + c] : 0.0);
        a->relative[c] = 0.0;
    }
    a->cosine = q->place && a->both ? ascc_dot3(a->seen, a->u) : 1.0;
    a->strength = strength_of(q, part, a->i, a->j, a->both, at, &a->slope);
    a->damping = strength_of(q, part + 1, a->i, a->j, a->both, at, &a->damping_slope);
    if (!a->both) {
        const float *area = ascc_wall_areas(p->run);
        a->area = area ? (double)area[a->j * ascc_padded(plan->boundary_channels)] : 1.0;
        a->strength *= a->area;
        a->slope *= a->area;
        a->damping *= a->area;
        a->damping_slope *= a->area;
    }
    a->along = ascc_dot3(a->force, a->u);
    a->approach = 0.0;
    if (plan->output.term.tensor[part + 1]) {
        const size_t width = ascc_padded(plan->fluid_channels);
        const float *motion = p->run->value[0].raw + ascc_plan_motion(plan, 0);
        double drift[3] = {0.0, 0.0, 0.0};
        if (!a->both)
            ascc_wall_drift(p->run, a->j, drift);
        for (int32_t c = 0; c < plan->dimension; c++)
            a->relative[c] = (double)motion[a->i * width + (size_t)c] -
                             (a->both ? (double)motion[a->j * width + (size_t)c] : drift[c]);
        a->approach = ascc_dot3(a->relative, a->u);
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
static void pass_pair(const ascc_pair_reverse *q, int part, const ascc_filter *filter, size_t i,
                      size_t j, bool both, const double r[3], const double d[3])
{
    const ascc_reverse *p = q->pass;
    const ascc_plan *plan = p->run->plan;
    pair a = {.i = i,
              .j = j,
              .both = both,
              .area = 1.0,
              .distance = sqrt(ascc_dot3(r, r)),
              .length = sqrt(ascc_dot3(d, d))};
    if (a.length == 0.0)
        return;
    const bumps_at at = find_bumps(a.distance / filter->radius, filter->bumps);
    find_pair(q, part, &at, r, d, &a);
    for (int side = 0; side < (both ? 2 : 1) && !a.limited; side++) {
        add_share(q, part, side ? j : i, &at, a.area * a.cosine * a.along);
        add_share(q, part + 1, side ? j : i, &at, -a.area * a.approach * a.along);
    }
    if (plan->output.term.tensor[part + 1] && p->value[0].raw) {
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

static void visit(const ascc_pair_reverse *q, size_t i, size_t j, const double r[3],
                  const double d[3])
{
    pass_pair(q, ASCC_TENSOR_STRENGTH, &q->pass->run->plan->output.term.filter, i, j, true, r, d);
}

static void visit_walls(const ascc_pair_reverse *q)
{
    const ascc_network_run *run = q->pass->run;
    const ascc_rows *rows = ascc_term_list(run, &run->plan->output.term, 1);
    for (size_t i = 0; i < rows->query->count; i++)
        for (size_t k = rows->start[i]; k < rows->start[i] + rows->count[i]; k++) {
            double r[3];
            ascc_seen_displacement(run, rows, i, rows->neighbor[k], r);
            pass_pair(q, ASCC_TENSOR_WALL, &run->plan->output.walls, i, rows->neighbor[k], false, r,
                      r);
        }
}

static bool take_gradients(gradients *g, const ascc_reverse *pass, size_t count)
{
    for (int side = 0; side < SIDES; side++) {
        if (!has_side(&pass->run->plan->output.term, side))
            continue;
        g->side[side] = ascc_arena_take(pass->pass->arena, count, WIDTH * sizeof(float));
        if (!g->side[side])
            return false;
        memset(g->side[side], 0, count * WIDTH * sizeof(float));
    }
    return true;
}

/* From the coefficients to the source's rows and the parts' weights. */
static void pass_coefficients(const ascc_pair_reverse *q, const gradients *g)
{
    const ascc_reverse *pass = q->pass;
    const ascc_term *term = &pass->run->plan->output.term;
    const size_t count = pass->run->hierarchy->set[q->set].count, a = ascc_padded(term->inputs);
    const uint8_t *active = pass->run->value[term->source].active;
    for (int side = 0; side < SIDES; side++) {
        const float *from = g->side[side];
        if (!from)
            continue;
        const size_t offset = (size_t)side * side_size(term);
        if (q->value_gradient)
            pass->run->tools->kernels->multiply(from, WIDTH, count, WIDTH,
                                                ascc_reverse_transposed(pass, term) + offset, a,
                                                q->value_gradient, a);
        float *to = ascc_reverse_packed(pass, term) + offset;
        for (size_t i = 0; i < count; i++)
            for (size_t c = 0; active[i] && c < a; c++)
                for (size_t k = 0; k < WIDTH; k++)
                    to[c * WIDTH + k] += q->value[i * a + c] * from[i * WIDTH + k];
    }
}

/* Pairs whose lines are as the network sees them, positions constants. */
static bool is_simple(const ascc_pair_reverse *q)
{
    return !q->place && !q->pass->pass->seen && q->set == ASCC_SET_FLUID;
}

static ascc_status pass_lines(const ascc_pair_reverse *q, gradients *g)
{
    const ascc_reverse *pass = q->pass;
    const ascc_network_run *run = pass->run;
    const size_t count = run->hierarchy->set[q->set].count;
    float *motion = pass->value[0].raw, *force;
    force = ascc_arena_take(pass->pass->arena, count, 4 * sizeof *force);
    if (!force)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 4; c++)
            force[i * 4 + c] = c < 3 ? (float)q->force[i * 3 + c] : 0.0f;
    g->c.seen = find_seen(run, q->set);
    for (int side = 0; side < (run->plan->output.has_walls ? SIDES : 1); side++) {
        const ascc_lines lines = lines_of(&g->c, side);
        if (!g->side[side])
            continue;
        ascc_line_reverse_run(&(ascc_line_reverse){
            .lines = &lines,
            .rows = ascc_term_list(run, &run->plan->output.term, side),
            .kernels = run->tools->kernels,
            .force = force,
            .coefficient = g->side[side],
            .motion = lines.motion && motion ? motion + ascc_plan_motion(run->plan, 0) : NULL});
    }
    return ASCC_OK;
}

static ascc_status backward(ascc_reverse *pass)
{
    gradients g = {.side = {NULL}};
    ascc_status status = ASCC_OK;
    ascc_pair_reverse pairs;
    if (!ascc_pair_reverse_open(&pairs, pass) ||
        !find_coefficients(&g.c, pass->run, SIDES, pass->pass->arena, ascc_arena_take) ||
        !take_gradients(&g, pass, pass->run->hierarchy->set[pairs.set].count))
        return ASCC_ERROR_MEMORY;
    pairs.data = &g;
    if (is_simple(&pairs)) {
        status = pass_lines(&pairs, &g);
    } else {
        ascc_pair_reverse_run(&pairs, visit);
        if (pass->run->plan->output.has_walls)
            visit_walls(&pairs);
    }
    pass_coefficients(&pairs, &g);
    return status;
}

const ascc_operation ascc_op_pairs_basis = {.name = "pairs in a basis",
                                            .type = "antisymmetric",
                                            .with = "basis",
                                            .not_negative = 1u << ASCC_TENSOR_DAMPING |
                                                            1u << ASCC_TENSOR_WALL_DAMPING,
                                            .read = read_pairs,
                                            .tensors = tensors,
                                            .check = check,
                                            .initial = fill_initial,
                                            .lists = lists,
                                            .packed_size = packed_size,
                                            .pack = pack,
                                            .unpack = unpack,
                                            .transpose = transpose,
                                            .cost = cost,
                                            .scratch = scratch,
                                            .reads_features = is_damped,
                                            .impulses = impulses,
                                            .backward_output = backward};
