/* Whole steps of random networks against the oracle. SPDX-License-Identifier: MIT */
#include <math.h>

#include "support/model_builder.h"
#include "support/oracle.h"
#include "support/tools.h"

#define SPACING 0.05

/* ---- A scene ---- */

typedef struct scene {
    size_t fluid_count, wall_count;
    double fluid[64 * 3], velocity[64 * 3], wall[64 * 3], normal[64 * 3];
} scene;

/* A jittered block over a jittered floor, in the corner of the world's lattices. */
static scene make_scene(uint64_t seed, int dimension)
{
    scene s = {.fluid_count = dimension == 2 ? 36 : 45, .wall_count = dimension == 2 ? 10 : 16};
    dice d = {seed * 77 + 5};
    const size_t n = (size_t)dimension, side = dimension == 2 ? 6 : 3, across = n == 2 ? 10 : 4;
    for (size_t i = 0; i < s.fluid_count; i++) {
        const size_t at[3] = {i % side, n == 2 ? i / side : i / 9, i / 3 % 3};
        for (size_t c = 0; c < n; c++) {
            s.fluid[i * n + c] = ((double)at[c] + 0.37 + dice_uniform(&d, -0.3, 0.3)) * SPACING;
            s.velocity[i * n + c] = dice_uniform(&d, -1.0, 1.0);
        }
    }
    for (size_t i = 0; i < s.wall_count; i++) {
        const double at[3] = {(double)(i % across), -0.5, (double)(i / across)};
        double length = 0.0;
        for (size_t c = 0; c < n; c++) {
            s.wall[i * n + c] = (0.9 * at[c] + dice_uniform(&d, -0.2, 0.2)) * SPACING;
            s.normal[i * n + c] = (c == 1 ? 1.0 : 0.0) + dice_uniform(&d, -0.2, 0.2);
            length += s.normal[i * n + c] * s.normal[i * n + c];
        }
        for (size_t c = 0; c < n; c++)
            s.normal[i * n + c] /= sqrt(length);
    }
    return s;
}

/* ---- One step of both ---- */

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

/* Positions after one step of the library. */
static void run_library(ascc_context *context, const ascc_model *model, const scene *s, double *x)
{
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = model->plan.dimension,
                                            .spacing = SPACING,
                                            .mass = 0.125};
    const ascc_const_array position = {.data = s->fluid, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = s->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = s->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = s->normal, .scalar = ASCC_DOUBLE};
    const ascc_array out = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_create(context, &options, &particles), ASCC_OK);
    assert_int_equal(
        ascc_particles_add_fluid(particles, s->fluid_count, &position, &velocity, NULL, NULL),
        ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(particles, s->wall_count, &wall, &normal, 0, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    if (ascc_step_run(step, particles, NULL, 1) != ASCC_OK)
        fail_msg("step: %s", ascc_step_message(step));
    assert_int_equal(
        ascc_particles_get(particles, ASCC_FLUID, ASCC_POSITION, 0, s->fluid_count, &out), ASCC_OK);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
}

/* Largest difference of a particle's correction, relative to the largest correction. */
static double error_of(const model_random *random)
{
    ascc_context *context = NULL;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    ascc_model *model = load(context, random);
    scene s = make_scene(random->seed, model->plan.dimension);
    const size_t numbers = s.fluid_count * (size_t)model->plan.dimension;
    double got[64 * 3], correction[64 * 3], worst = 0.0, largest = 0.0;
    double *weight = oracle_weights(model);
    run_library(context, model, &s, got);
    oracle o = oracle_open(model, weight);
    o.fluid_count = s.fluid_count;
    o.wall_count = s.wall_count;
    o.wall = s.wall;
    o.normal = s.normal;
    oracle_set_half(&o, random->half_axis);
    oracle_step(&o, s.fluid, s.velocity, correction);
    for (size_t k = 0; k < numbers; k++) {
        largest = fmax(largest, fabs(correction[k]));
        worst = fmax(worst, fabs(got[k] - s.fluid[k]));
    }
    oracle_close(&o);
    free(weight);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    assert_true(largest > 1e-6 * SPACING);
    return worst / largest;
}

/* Floats are 6e-8 apart; sums of some hundred products through up to four layers lose a digit or two. */
#define BOUND 5e-6

static double check(const char *what, int variant, const model_random *random)
{
    const double error = error_of(random);
    if (!(error < BOUND))
        fail_msg("%s %d: %.3g of the largest correction", what, variant, error);
    return error;
}

/* ---- Kinds of networks ---- */

static void grids_equal_doubles(void **state)
{
    (void)state;
    static const char *const windows[] = {"poly6", "peak", "none"};
    static const char *const mappings[] = {"volume", "radial", "identity"};
    static const char *const evaluations[] = {"current", "advected", "advected_mean"};
    static const char *const halves[] = {NULL, "x", "y", NULL, "z"};
    double worst = 0.0;
    for (int v = 0; v < 36; v++) {
        const char *half = halves[v % 5];
        const model_random random = {.seed = 100 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .cells = 2 + v % 3,
                                     .output_cells = 2 + 2 * (v % 3),
                                     .window = windows[v / 2 % 3],
                                     .mapping = mappings[v / 6 % 3],
                                     .evaluate = evaluations[v / 3 % 3],
                                     .projection = v % 4 < 2 ? "radial" : "none",
                                     .half_axis = v % 2 || !half || half[0] != 'z' ? half : NULL,
                                     .skip_self = v / 4 % 2,
                                     .fluid_only = v / 5 % 2,
                                     .boundary_crop = v % 3 ? 2.5 : 0.0};
        worst = fmax(worst, check("grid", v, &random));
    }
    print_message("# grids: %.2g\n", worst);
}

static void plain_outputs_equal_doubles(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 12; v++) {
        const model_random random = {.seed = 200 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .plain = 1,
                                     .bumps = v / 2 % 2 * 3,
                                     .order = 1,
                                     .fluid_only = v / 4 % 2,
                                     .evaluate = v < 6 ? "current" : "advected"};
        worst = fmax(worst, check("plain", v, &random));
    }
    print_message("# plain: %.2g\n", worst);
}

static void levels_equal_doubles(void **state)
{
    (void)state;
    static const char *const methods[] = {"voxel_centers", "voxel_corners", "farthest"};
    double worst = 0.0;
    for (int v = 0; v < 36; v++) {
        const int method = v / 2 % 3, transfer = method == 2 ? 0 : v / 6 % 3;
        const model_random random = {.seed = 300 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .levels = 2 + v / 4 % 2,
                                     .channels = 4,
                                     .trunk_layers = 3,
                                     .cells = 3,
                                     .method = methods[method],
                                     .anchor = v / 3 % 2 || method == 0 ? "world" : "centroid",
                                     .transfer = transfer,
                                     .no_hysteresis = v / 8 % 2,
                                     .bumps = v / 5 % 2 * 2,
                                     .order = 1,
                                     .skip_self = v / 7 % 2,
                                     .fluid_only = v / 9 % 2,
                                     .evaluate = v % 5 ? "current" : "advected",
                                     .boundary_crop = v % 3 ? 0.0 : 2.5};
        worst = fmax(worst, check("levels", v, &random));
    }
    print_message("# levels: %.2g\n", worst);
}

static void moments_equal_doubles(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 24; v++) {
        const model_random random = {.seed = 500 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .moments = 1 + v % 7,
                                     .bumps = 2 + v % 3,
                                     .order = 1,
                                     .fluid_only = 1,
                                     .motion = 1 + v / 3 % 2,
                                     .damping = v / 2 % 2,
                                     .walls = v / 5 % 2,
                                     .scale = 0.001,
                                     .evaluate = v / 4 % 2 ? "current" : "advected"};
        worst = fmax(worst, check("moments", v, &random));
    }
    print_message("# moments: %.2g\n", worst);
}

static void lattice_trunks_equal_doubles(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 16; v++) {
        const model_random random = {.seed = 600 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .moments = 1 + v % 3,
                                     .lattice = 1,
                                     .levels = 3,
                                     .transfer = 1 + v / 2 % 2,
                                     .method = "voxel_corners",
                                     .no_hysteresis = 1,
                                     .bumps = 3,
                                     .order = 1,
                                     .fluid_only = 1,
                                     .motion = 3,
                                     .walls = v / 4 % 2,
                                     .scale = 0.001,
                                     .evaluate = v / 3 % 2 ? "current" : "advected"};
        worst = fmax(worst, check("lattice", v, &random));
    }
    print_message("# lattices: %.2g\n", worst);
}

static void bases_equal_doubles(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 24; v++) {
        const model_random random = {.seed = 400 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .bumps = 1 + v % 8,
                                     .order = v / 2 % 3,
                                     .fluid_only = v / 6 % 2,
                                     .scale = 0.001,
                                     .evaluate = v / 3 % 2 ? "current" : "advected"};
        worst = fmax(worst, check("basis", v, &random));
    }
    print_message("# bases: %.2g\n", worst);
}

static void motion_and_its_damping_equal_doubles(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 32; v++) {
        const model_random random = {.seed = 500 + (uint64_t)v,
                                     .dimension = 2 + v % 2,
                                     .spacing = SPACING,
                                     .fluid_only = 1,
                                     .bumps = 1 + v % 5,
                                     .order = v / 2 % 3,
                                     .levels = 1 + v / 8 % 2,
                                     .transfer = 1,
                                     .method = "voxel_corners",
                                     .motion = 1 + v / 2 % 2,
                                     .relative = v / 4 % 2,
                                     .damping = v / 3 % 2,
                                     .walls = v / 5 % 2,
                                     .direction = v / 7 % 2,
                                     .limit = v % 4 == 1 ? 2e-4 : 0.0,
                                     .evaluate = v % 3 ? "advected" : "current"};
        worst = fmax(worst, check("motion", v, &random));
    }
    print_message("# motion: %.2g\n", worst);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(grids_equal_doubles),
        cmocka_unit_test(plain_outputs_equal_doubles),
        cmocka_unit_test(levels_equal_doubles),
        cmocka_unit_test(bases_equal_doubles),
        cmocka_unit_test(lattice_trunks_equal_doubles),
        cmocka_unit_test(moments_equal_doubles),
        cmocka_unit_test(motion_and_its_damping_equal_doubles),
    };
    return cmocka_run_group_tests_name("oracle", tests, NULL, NULL);
}
