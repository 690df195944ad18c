/* Every operation of the table, in whole networks, against the oracle: forwards on every instruction set,
 * backwards against central differences. An operation is in here by its recipe; without one it fails.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "network/operations.h"
#include "network/reverse.h"
#include "step/step.h"
#include "support/model_builder.h"
#include "support/oracle.h"
#include "support/tools.h"

#define SPACING 0.05
#define MAX_POINTS 64
#define CPUS (ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128)

/* Of the largest correction, or of a tensor's largest gradient. Floats are 6e-8 apart; sums of some hundred
 * products through up to four layers lose a digit or two. Hats that are divided by their sum lose more where it
 * is small: seeds are such that it is not. */
#define BOUND 1e-5

/* The library's table, and one that is only here: this definition replaces the library's when linking. */
extern const ascc_operation ascc_op_scale;
#define OPERATION(name) &ascc_op_##name,
const ascc_operation *const ascc_operations[] = {
#include "network/operations.list"
    &ascc_op_scale, NULL};
#undef OPERATION

/* ---- Recipes: small networks that an operation is in, one for each variant ---- */

static const char *const windows[] = {"poly6", "peak", "none"};
static const char *const mappings[] = {"volume", "radial", "identity"};
static const char *const evaluations[] = {"current", "advected", "advected_mean"};
static const char *const samplings[] = {"voxel_centers", "voxel_corners", "farthest"};

static void grid(int v, model_random *r)
{
    r->plain = 1;
    r->window = windows[v / 2 % 3];
    r->mapping = mappings[v / 6 % 3];
    r->cells = 2 + v % 3;
    r->skip_self = v / 4 % 2;
    r->fluid_only = v / 5 % 2;
    r->boundary_crop = v % 3 ? 2.5 : 0.0;
    r->evaluate = evaluations[v / 3 % 3];
}

static void basis(int v, model_random *r)
{
    r->plain = v % 5 != 0;
    r->bumps = 1 + v % 8;
    r->order = v / 2 % 3;
    r->fluid_only = v / 6 % 2;
    r->motion = r->fluid_only ? 1 + v / 2 % 2 : 0;
    r->relative = r->fluid_only && v / 4 % 2;
    r->gravity = v / 3 % 2;
    r->evaluate = evaluations[v / 3 % 2];
    r->scale = r->plain ? 0.0 : 0.001;
}

static void levels(int v, model_random *r)
{
    r->levels = 2 + v / 4 % 2;
    r->channels = 4;
    r->cells = 3;
    r->method = samplings[v / 2 % 3];
    r->anchor = v / 3 % 2 && v / 2 % 3 == 1 ? "centroid" : "world";
    r->no_hysteresis = v / 8 % 2;
    r->skip_self = v / 2 % 3 == 2; /* else a kernel's centre, where it has no slope */
    r->fluid_only = v / 9 % 2;
    r->evaluate = evaluations[v % 5 ? 0 : 1];
    r->boundary_crop = v % 3 ? 0.0 : 2.5;
}

static void basis_levels(int v, model_random *r)
{
    levels(v, r);
    r->bumps = 2;
    r->order = 1;
}

static void transfer(int v, model_random *r)
{
    basis_levels(v, r);
    r->trunk_layers = 3;
    r->method = samplings[v / 2 % 2];
    r->anchor = v / 3 % 2 && v / 2 % 2 ? "centroid" : "world";
    r->skip_self = v / 7 % 2;
    r->transfer = 1 + v / 6 % 2;
    r->plain = v / 4 % 2;
}

static void moments(int v, model_random *r)
{
    r->moments = 1 + v % 7;
    r->bumps = 2 + v % 3;
    r->fluid_only = 1;
    r->motion = 1 + v / 3 % 2;
    r->damping = v / 2 % 2;
    r->walls = v / 5 % 2;
    r->area = v / 6 % 2;
    r->scale = 0.001;
    r->evaluate = evaluations[v / 4 % 2];
    r->trunk_layers = 1;
}

static void stencil(int v, model_random *r)
{
    r->moments = 1 + v % 3;
    r->lattice = 1;
    r->levels = 3;
    r->transfer = 1 + v / 2 % 2;
    r->method = "voxel_corners";
    r->no_hysteresis = 1;
    r->bumps = 3;
    r->order = 1;
    r->fluid_only = 1;
    r->motion = 3;
    r->walls = v / 4 % 2;
    r->area = v / 5 % 2;
    r->scale = 0.001;
    r->evaluate = evaluations[v / 3 % 2];
}

static void hourglass(int v, model_random *r)
{
    r->abstraction = 1 + 2 * (v / 2 % 64);
    r->levels = 2;
    r->method = "farthest";
    r->fluid_only = v / 3 % 2;
    r->trunk_layers = 1;
    r->plain = v / 5 % 2;
    r->bumps = 2;
    r->order = 1;
    r->evaluate = evaluations[v / 7 % 2];
}

static void rows(int v, model_random *r)
{
    r->plain = 1;
    r->bumps = 2;
    r->fluid_only = v / 2 % 2;
    r->trunk_layers = 3;
}

static void scale(int v, model_random *r)
{
    rows(v, r);
    r->residual = "\"type\":\"scale\",\"factor\":-1.75";
}

static void pairs_grid(int v, model_random *r)
{
    static const char *const halves[] = {NULL, "x", "y", NULL, "z"};
    const char *half = halves[v % 5];
    r->bumps = 0;
    r->mapping = mappings[v / 6 % 3];
    r->output_cells = 2 + 2 * (v % 3);
    r->projection = v % 4 < 2 ? "radial" : "none";
    r->half_axis = v % 2 || !half || half[0] != 'z' ? half : NULL;
    r->fluid_only = v / 5 % 2;
    r->trunk_layers = 1;
    r->evaluate = evaluations[v / 3 % 3];
}

static void pairs_basis(int v, model_random *r)
{
    r->fluid_only = v % 8 != 7;
    r->bumps = 1 + v % 5;
    r->order = v / 2 % 3;
    r->motion = 1 + v / 2 % 2;
    r->relative = r->fluid_only && v / 4 % 2;
    r->damping = r->fluid_only && v / 3 % 2;
    r->walls = r->fluid_only && v / 5 % 2;
    r->direction = r->fluid_only && v / 7 % 2;
    r->limit = v % 4 == 1 ? 5e-4 : 0.0;
    r->evaluate = evaluations[v % 3 ? 1 : 0];
    r->trunk_layers = 1;
}

static void graph(int v, model_random *r)
{
    r->plain = 1;
    r->graph = 1 + v / 2 % 2;
    r->history = v / 3 % 3;
    r->fluid_only = v / 4 % 2;
    r->radius = 1.45;
    r->evaluate = evaluations[v / 3 % 3];
}

static void plain(int v, model_random *r)
{
    r->plain = 1;
    r->bumps = v / 2 % 2 * 3;
    r->order = 1;
    r->fluid_only = v / 4 % 2;
    r->evaluate = evaluations[v / 3 % 3];
}

static void add_scaled(const ascc_term *term, const double *in, double *out)
{
    for (int32_t a = 0; a < term->inputs; a++)
        out[a] += term->option[0] * in[a];
}

typedef struct recipe {
    const char *operation; /* its name */
    int variants;          /* even ones are 2D, odd ones 3D; 0: its own test is elsewhere */
    uint64_t seed;
    void (*make)(int variant, model_random *random);
    /* What it does, where the oracle does not know it. */
    void (*add)(const ascc_term *term, const double *in, double *out);
} recipe;

static const recipe recipes[] = {
    {"convolution on a grid", 18, 0, grid, NULL},
    {"convolution on a grid", 8, 100, levels, NULL},
    {"convolution in a basis", 24, 200, basis, NULL},
    {"convolution in a basis", 6, 300, basis_levels, NULL},
    {"pair moments", 24, 400, moments, NULL},
    {"stencil", 16, 1200, stencil, NULL},
    {"set abstraction", 32, 1300, hourglass, NULL},
    {"interpolation", 0, 0, NULL, NULL}, /* likewise */
    {"dense", 4, 500, rows, NULL},
    {"identity", 4, 600, rows, NULL},
    {"transfer", 16, 700, transfer, NULL},
    {"pairs on a grid", 20, 800, pairs_grid, NULL},
    {"pairs in a basis", 32, 900, pairs_basis, NULL},
    {"displacement of edges", 8, 1300, graph, NULL},
    {"gather to edges", 0, 0, NULL, NULL}, /* the same networks */
    {"sum over edges", 0, 0, NULL, NULL},
    {"layer normalisation", 0, 0, NULL, NULL},
    {"plain output", 8, 1000, plain, NULL},
    {"no output", 0, 0, NULL, NULL}, /* tests/test_relaxation.c */
    {"scale", 4, 1100, scale, add_scaled},
};
#define RECIPES (sizeof recipes / sizeof *recipes)

/* ---- A scene ---- */

/* Not the models' own: what knows gravity must take the step's. */
static const double tilted[3] = {4.0, -7.0, 0.0};

typedef struct scene {
    size_t fluid_count, wall_count;
    double fluid[MAX_POINTS * 3], velocity[MAX_POINTS * 3];
    double wall[MAX_POINTS * 3], normal[MAX_POINTS * 3];
    /* Of each correction in the number that has a gradient: grows with the place, so that what pairs give and
     * take does not cancel. */
    double share[MAX_POINTS * 3];
} scene;

/* A jittered block over a jittered floor, in the corner of the world's lattices. */
static void make_scene(scene *s, uint64_t seed, int dimension)
{
    *s = (scene){.fluid_count = dimension == 2 ? 36 : 45, .wall_count = dimension == 2 ? 10 : 16};
    dice d = {seed * 77 + 5};
    const size_t n = (size_t)dimension, side = dimension == 2 ? 6 : 3, across = n == 2 ? 10 : 4;
    for (size_t i = 0; i < s->fluid_count; i++) {
        const size_t at[3] = {i % side, n == 2 ? i / side : i / 9, i / 3 % 3};
        for (size_t c = 0; c < n; c++) {
            s->fluid[i * n + c] = ((double)at[c] + 0.37 + dice_uniform(&d, -0.3, 0.3)) * SPACING;
            s->velocity[i * n + c] = dice_uniform(&d, -1.0, 1.0);
            s->share[i * n + c] = (double)at[c] + dice_uniform(&d, 0.0, 1.0);
        }
    }
    for (size_t i = 0; i < s->wall_count; i++) {
        const double at[3] = {(double)(i % across), -0.5, (double)(i / across)};
        double length = 0.0;
        for (size_t c = 0; c < n; c++) {
            s->wall[i * n + c] = (0.9 * at[c] + dice_uniform(&d, -0.2, 0.2)) * SPACING;
            s->normal[i * n + c] = (c == 1 ? 1.0 : 0.0) + dice_uniform(&d, -0.2, 0.2);
            length += s->normal[i * n + c] * s->normal[i * n + c];
        }
        for (size_t c = 0; c < n; c++)
            s->normal[i * n + c] /= sqrt(length);
    }
}

/* ---- The library's step, and its way back ---- */

typedef struct result {
    double position[MAX_POINTS * 3]; /* after the step */
    float *weight; /* gradients by weights, positions and velocities before the step */
    double by_position[MAX_POINTS * 3], by_velocity[MAX_POINTS * 3];
} result;

static ascc_model *load(ascc_context *context, const model_random *random)
{
    ascc_model *model = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    if (ascc_model_load_memory(context, bytes, size, &model) != ASCC_OK) {
        char text[256];
        ascc_context_message(context, text, sizeof text);
        fail_msg("model: %s", text);
    }
    free(bytes);
    return model;
}

static ascc_particles *fill(ascc_context *context, const scene *s, int32_t dimension)
{
    ascc_particles *p = NULL;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = SPACING, .mass = 0.125};
    const ascc_const_array position = {.data = s->fluid, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = s->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = s->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = s->normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, s->fluid_count, &position, &velocity, NULL, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, s->wall_count, &wall, &normal, 0, NULL),
                     ASCC_OK);
    return p;
}

/* From shares of the velocity corrections back to what they were made of. */
static void go_back(const ascc_context *context, const ascc_model *model, const scene *s,
                    const ascc_step_state *state, const ascc_motion *motion, result *r)
{
    double seen[MAX_POINTS * 3] = {0.0}, place[MAX_POINTS * 3] = {0.0};
    double velocity[MAX_POINTS * 3] = {0.0};
    ascc_transposed transposed;
    ascc_arena arena;
    float *packed = calloc(model->packed.count + 1, sizeof *packed);
    r->weight = calloc(model->weight_count + 1, sizeof *r->weight);
    assert_non_null(packed);
    assert_non_null(r->weight);
    ascc_arena_open(&arena, &context->allocator);
    assert_true(
        ascc_transposed_create(&transposed, &context->allocator, &model->plan, &model->packed));
    const ascc_backward pass = {.run = &state->run,
                                .transposed = &transposed,
                                .arena = &arena,
                                .time_step = motion->time_step,
                                .position = s->fluid,
                                .correction = s->share,
                                .packed = packed,
                                .velocity = velocity,
                                .seen = seen,
                                .place = place};
    assert_int_equal(ascc_backward_run(&pass), ASCC_OK);
    ascc_packed_fold(&model->packed, &model->plan, model->weights, packed, r->weight);
    const double carried = motion->advection == ASCC_ADVECT_NONE ? 0.0 : motion->time_step;
    for (size_t k = 0; k < s->fluid_count * (size_t)model->plan.dimension; k++) {
        r->by_position[k] = seen[k] + place[k];
        r->by_velocity[k] = velocity[k] + carried * seen[k];
    }
    ascc_transposed_destroy(&transposed, &context->allocator);
    ascc_arena_close(&arena);
    free(packed);
}

/* keeps: stores all values, as a way back needs them, and goes it. */
static void run_library(ascc_context *context, const ascc_model *model, const scene *s, bool keeps,
                        result *r)
{
    const ascc_plan *plan = &model->plan;
    ascc_particles *particles = fill(context, s, plan->dimension);
    ascc_step *step = NULL;
    ascc_step_state state;
    ascc_motion motion = {.time_step = plan->time_step, .advection = plan->advection};
    const ascc_array out = {.data = r->position, .scalar = ASCC_DOUBLE};
    memcpy(motion.gravity, tilted, sizeof tilted);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    step->network.keeps_values = keeps;
    if (ascc_step_once(step, particles, &motion, true, &step->arena, &state) != ASCC_OK)
        fail_msg("step: %s", ascc_step_message(step));
    assert_int_equal(
        ascc_particles_get(particles, ASCC_FLUID, ASCC_POSITION, 0, s->fluid_count, &out), ASCC_OK);
    if (keeps)
        go_back(context, model, s, &state, &motion, r);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
}

/* ---- The oracle's step, and its differences ---- */

typedef struct bench {
    const ascc_model *model;
    const scene *s;
    double *weight;
    double position[MAX_POINTS * 3], velocity[MAX_POINTS * 3];
    oracle o;
} bench;

/* One step from the bench's numbers; returns the sum of shares of velocity corrections. */
static double step_of(bench *b, oracle_mode mode, double *after, double *correction)
{
    const size_t numbers = b->s->fluid_count * (size_t)b->model->plan.dimension;
    double velocity[MAX_POINTS * 3], sum = 0.0;
    memcpy(after, b->position, sizeof b->position);
    memcpy(velocity, b->velocity, sizeof velocity);
    double past[MAX_POINTS * 3 * ASCC_MAX_HISTORY]; /* a set that has not been stepped yet */
    const size_t history = (size_t)b->model->plan.history, d = (size_t)b->model->plan.dimension;
    for (size_t k = 0; k < numbers * history; k++)
        past[k] = b->s->velocity[k / d / history * d + k % d];
    b->o.past = past;
    b->o.mode = mode;
    b->o.step = 0;
    oracle_step(&b->o, after, velocity, correction);
    for (size_t k = 0; k < numbers; k++)
        sum += b->s->share[k] * correction[k] / b->model->plan.time_step;
    return sum;
}

static double slope_of(bench *b, double *number, double step)
{
    double unused[2][MAX_POINTS * 3];
    const double is = *number;
    *number = is + step;
    const double above = step_of(b, ORACLE_LATTICES, unused[0], unused[1]);
    *number = is - step;
    const double below = step_of(b, ORACLE_LATTICES, unused[0], unused[1]);
    *number = is;
    return (above - below) / (2.0 * step);
}

/* Some numbers of a kind; returns the largest difference relative to the largest gradient. A step over a kink
 * (a ReLU, a cell of a kernel) spoils a difference: then a shorter one has to agree. */
static double check_slopes(bench *b, double *number, size_t count, double longest,
                           double (*got_of)(const void *gradient, size_t i), const void *gradient)
{
    double largest = 0.0, worst = 0.0;
    for (size_t i = 0; i < count; i++)
        largest = fmax(largest, fabs(got_of(gradient, i)));
    for (size_t i = 0; i<count; i += count> 4 ? count / 4 : 1) {
        double best = INFINITY;
        const double got = got_of(gradient, i);
        for (int power = 0; power < 5 && !(best < 0.1 * BOUND); power++) {
            const double slope = slope_of(b, &number[i], longest * pow(0.1, power));
            best = fmin(best, slope == got ? 0.0 : fabs(slope - got) / fmax(largest, fabs(slope)));
        }
        worst = fmax(worst, best);
    }
    return worst;
}

static double float_at(const void *gradient, size_t i)
{
    return (double)((const float *)gradient)[i];
}

static double double_at(const void *gradient, size_t i)
{
    return ((const double *)gradient)[i];
}

/* ---- Comparing ---- */

static bool uses(const ascc_plan *plan, const char *operation)
{
    for (int32_t t = 0; t <= plan->term_count; t++)
        if (strcmp(ascc_plan_term(plan, t)->operation->name, operation) == 0)
            return true;
    return false;
}

static void expect(const recipe *from, int variant, const char *what, double error, double *worst)
{
    *worst = fmax(*worst, error);
    if (!(error < BOUND))
        fail_msg("operation '%s', variant %d: %s is off by %.3g of the largest", from->operation,
                 variant, what, error);
}

static void check_gradients(const recipe *from, int variant, bench *b, const result *r,
                            double *worst)
{
    const size_t numbers = b->s->fluid_count * (size_t)b->model->plan.dimension;
    oracle_tensor list[ORACLE_MAX_TENSORS];
    const size_t tensors = oracle_tensors(b->model, list);
    for (size_t t = 0; t < tensors; t++)
        expect(from, variant, list[t].name,
               check_slopes(b, b->weight + list[t].offset, list[t].count, 1e-5, float_at,
                            r->weight + list[t].offset),
               worst);
    expect(from, variant, "the gradient of positions",
           check_slopes(b, b->position, numbers, 1e-6, double_at, r->by_position), worst);
    expect(from, variant, "the gradient of velocities",
           check_slopes(b, b->velocity, numbers, 1e-4, double_at, r->by_velocity), worst);
}

/* Weights packed and transposed fill what an operation says they take up, and not a float more. */
static void check_packing(const ascc_plan *plan)
{
    enum { MORE = 8192 };
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const ascc_term *term = ascc_plan_term(plan, t);
        const ascc_operation *operation = term->operation;
        const size_t size = operation->packed_size ? operation->packed_size(plan, term) : 0;
        float *packed = calloc(size + MORE, sizeof *packed);
        float *transposed = calloc(size + MORE, sizeof *transposed);
        assert_non_null(packed);
        assert_non_null(transposed);
        for (size_t i = 0; i < MORE; i++)
            packed[size + i] = transposed[size + i] = -7.0f;
        if (operation->pack && size)
            operation->pack(plan, term, packed);
        if (operation->transpose)
            operation->transpose(plan, term, packed, transposed);
        for (size_t i = 0; i < MORE; i++)
            assert_true(packed[size + i] == -7.0f && transposed[size + i] == -7.0f);
        free(transposed);
        free(packed);
    }
}

/* One variant: the first instruction set against the oracle, the others against the first, to the bit. */
static void check_variant(const recipe *from, int variant, double worst[2])
{
    model_random random = {
        .seed = from->seed + (uint64_t)variant, .dimension = 2 + variant % 2, .spacing = SPACING};
    scene s;
    result first = {.weight = NULL};
    from->make(variant, &random);
    make_scene(&s, random.seed, random.dimension);
    int sets = 0;
    for (uint32_t use = 0; use <= CPUS; use++) {
        ascc_context *context = NULL;
        const ascc_context_options options = {.size = sizeof options, .cpu_disable = CPUS & ~use};
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        if (ascc_context_cpu(context) != use) { /* this CPU has it not */
            ascc_context_destroy(&context);
            continue;
        }
        ascc_model *model = load(context, &random);
        result r = {.weight = NULL}, passed_on = {.weight = NULL};
        if (!uses(&model->plan, from->operation))
            fail_msg("operation '%s': its recipe makes no network with it", from->operation);
        run_library(context, model, &s, true, &r);
        run_library(context, model, &s, false, &passed_on);
        assert_memory_equal(r.position, passed_on.position, sizeof r.position);
        if (sets++) {
            assert_memory_equal(r.position, first.position, sizeof r.position);
            assert_memory_equal(r.by_position, first.by_position, sizeof r.by_position);
            assert_memory_equal(r.by_velocity, first.by_velocity, sizeof r.by_velocity);
            assert_memory_equal(r.weight, first.weight, model->weight_count * sizeof(float));
            free(r.weight);
        } else {
            first = r;
            check_packing(&model->plan);
            bench b = {.model = model, .s = &s, .weight = oracle_weights(model)};
            double after[MAX_POINTS * 3], correction[MAX_POINTS * 3], error = 0.0, largest = 0.0;
            memcpy(b.position, s.fluid, sizeof s.fluid);
            memcpy(b.velocity, s.velocity, sizeof s.velocity);
            b.o = oracle_open(model, b.weight);
            memcpy(b.o.gravity, tilted, sizeof tilted);
            b.o.fluid_count = s.fluid_count;
            b.o.wall_count = s.wall_count;
            b.o.wall = s.wall;
            b.o.normal = s.normal;
            b.o.add_other = from->add;
            oracle_set_half(&b.o, random.half_axis);
            (void)step_of(&b, ORACLE_RECORD, after, correction);
            for (size_t k = 0; k < s.fluid_count * (size_t)random.dimension; k++) {
                largest = fmax(largest, fabs(correction[k]));
                error = fmax(error, fabs(r.position[k] - after[k]));
            }
            assert_true(largest > 1e-6 * SPACING);
            expect(from, variant, "the step", error / largest, &worst[0]);
            check_gradients(from, variant, &b, &r, &worst[1]);
            oracle_close(&b.o);
            free(b.weight);
        }
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
    }
    free(first.weight);
}

static void every_operation_has_a_recipe(void **state)
{
    (void)state;
    for (const ascc_operation *const *o = ascc_operations; *o; o++) {
        size_t found = 0;
        for (size_t i = 0; i < RECIPES; i++)
            found += strcmp(recipes[i].operation, (*o)->name) == 0;
        if (!found)
            fail_msg("operation '%s': no recipe in tests/test_operations.c", (*o)->name);
    }
}

static void operations_and_their_gradients_equal_doubles(void **state)
{
    (void)state;
    for (size_t i = 0; i < RECIPES; i++) {
        double worst[2] = {0.0, 0.0};
        for (int v = 0; v < recipes[i].variants; v++)
            check_variant(&recipes[i], v, worst);
        print_message("# %s: step %.2g, gradients %.2g\n", recipes[i].operation, worst[0],
                      worst[1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_operation_has_a_recipe),
        cmocka_unit_test(operations_and_their_gradients_equal_doubles),
    };
    return cmocka_run_group_tests_name("operations", tests, NULL, NULL);
}
