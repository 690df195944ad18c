/* What networks make of walls that are sampled otherwise than in training.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05
#define FLUID 27

/* Velocities after one step above a floor whose points are `pitch` spacings apart in so many layers. */
static void step_above(const model_random *random, double pitch, int layers, double velocity[])
{
    const int side = (int)lround(12.0 / pitch);
    const size_t walls = (size_t)(layers * side * side);
    double *wall = calloc(3 * walls, sizeof *wall), *normal = calloc(3 * walls, sizeof *normal);
    double fluid[3 * FLUID];
    dice d = {11};
    assert_non_null(wall);
    assert_non_null(normal);
    for (size_t k = 0; k < walls; k++) {
        wall[3 * k] = SPACING * pitch * ((double)(k % (size_t)side) - 0.5 * (side - 1));
        wall[3 * k + 2] =
            SPACING * pitch * ((double)(k / (size_t)side % (size_t)side) - 0.5 * (side - 1));
        normal[3 * k + 1] = 1.0;
    }
    for (size_t i = 0; i < FLUID; i++) {
        const size_t at[3] = {i % 3, i / 9, i / 3 % 3};
        for (size_t c = 0; c < 3; c++)
            fluid[3 * i + c] =
                SPACING * ((double)at[c] - (c == 1 ? -0.7 : 1.0) + dice_uniform(&d, -0.1, 0.1));
    }
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    ascc_particles *particles;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = SPACING, .mass = 0.1};
    const ascc_const_array x = {.data = fluid, .scalar = ASCC_DOUBLE};
    const ascc_const_array b = {.data = wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array n = {.data = normal, .scalar = ASCC_DOUBLE};
    const ascc_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &options, &particles), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(particles, FLUID, &x, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(particles, walls, &b, &n, 0, NULL), ASCC_OK);
    if (ascc_step_run(step, particles, NULL, 1) != ASCC_OK)
        fail_msg("%s", ascc_step_message(step));
    assert_int_equal(ascc_particles_get(particles, ASCC_FLUID, ASCC_VELOCITY, 0, FLUID, &v),
                     ASCC_OK);
    ascc_particles_destroy(&particles);
    ascc_step_destroy(&step);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(bytes);
    free(normal);
    free(wall);
}

/* How far the corrections of a step over such a floor are from those over points one spacing apart, relative
 * to what walls change of these. */
static double change(const model_random *random, double pitch, int layers)
{
    double want[3 * FLUID], got[3 * FLUID], bare[3 * FLUID], off = 0.0, all = 0.0;
    step_above(random, 0.5, 1, want);
    step_above(random, pitch, layers, got);
    step_above(random, 120.0, 1, bare); /* no point at all */
    for (size_t k = 0; k < 3 * FLUID; k++) {
        off += (got[k] - want[k]) * (got[k] - want[k]);
        all += (bare[k] - want[k]) * (bare[k] - want[k]);
    }
    assert_true(all > 0.0);
    return sqrt(off / all);
}

/* Moments, and with a lattice its sums of walls, and an output that walls push. */
static model_random seeing(int area, int lattice)
{
    return (model_random){.seed = 5,
                          .dimension = 3,
                          .spacing = SPACING,
                          .moments = 4,
                          .bumps = 4,
                          .order = 1,
                          .radius = 2.25,
                          .fluid_only = 1,
                          .motion = 3,
                          .walls = 1,
                          .damping = 1,
                          .scale = 0.01,
                          .trunk_layers = 1,
                          .levels = lattice ? 3 : 1,
                          .lattice = lattice,
                          .transfer = 1,
                          .method = "voxel_corners",
                          .no_hysteresis = 1,
                          .evaluate = "advected",
                          .area = area};
}

static void with_areas_the_density_of_walls_does_not_matter(void **state)
{
    (void)state;
    for (int lattice = 0; lattice < 2; lattice++) {
        const model_random areas = seeing(1, lattice), counts = seeing(0, lattice);
        const double twice = change(&areas, 0.5, 2), dense = change(&areas, 0.2, 1);
        const double sparse = change(&areas, 0.8, 1);
        print_message(
            "# points 0.5 spacings apart in two layers, 0.2, 0.8 apart: off by %.2g, %.2g, "
            "%.2g of what walls do; counted: %.2g, %.2g\n",
            twice, dense, sparse, change(&counts, 0.5, 2), change(&counts, 0.2, 1));
        assert_true(twice < 1e-4);
        assert_true(dense < 0.05);
        assert_true(sparse < 0.2);
        assert_true(change(&counts, 0.5, 2) > 0.5);
    }
}

/* 4 x 4 x 4 particles at rest without gravity in a closed tank, as in a report of a user whose water left. */
static void rest_in_a_tank(const char *name, double pitch, int layers)
{
    const double edge = 5.0 * SPACING, gravity[3] = {0.0, 0.0, 0.0};
    const int side = (int)floor(5.0 / pitch + 1e-9) + 1;
    const size_t walls = (size_t)(6 * layers * side * side);
    double *wall = calloc(3 * walls, sizeof *wall), *normal = calloc(3 * walls, sizeof *normal);
    double fluid[3 * 64];
    char path[512];
    assert_non_null(wall);
    assert_non_null(normal);
    for (size_t k = 0; k < walls; k++) {
        const size_t place = k % (size_t)(side * side), face = k / (size_t)(side * side) % 6;
        const size_t axis = face / 2, layer = k / (size_t)(6 * side * side);
        const double out = 0.5 * SPACING * (double)layer;
        wall[3 * k + axis] = face % 2 ? edge + out : -out;
        wall[3 * k + (axis + 1) % 3] = SPACING * pitch * (double)(place % (size_t)side);
        wall[3 * k + (axis + 2) % 3] = SPACING * pitch * (double)(place / (size_t)side);
        normal[3 * k + axis] = face % 2 ? -1.0 : 1.0;
    }
    for (size_t i = 0; i < 64; i++)
        for (size_t c = 0; c < 3; c++)
            fluid[3 * i + c] = SPACING * (double)(1 + i / (size_t[]){1, 4, 16}[c] % 4);
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    ascc_particles *particles;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = SPACING, .mass = 0.125};
    const ascc_forces none = {.size = sizeof none, .gravity = gravity};
    const ascc_const_array x = {.data = fluid, .scalar = ASCC_DOUBLE};
    const ascc_const_array b = {.data = wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array n = {.data = normal, .scalar = ASCC_DOUBLE};
    const ascc_array to = {.data = fluid, .scalar = ASCC_DOUBLE};
    (void)snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", name);
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load(context, path, &model), ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &options, &particles), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(particles, 64, &x, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(particles, walls, &b, &n, 0, NULL), ASCC_OK);
    for (int t = 0; t < 50; t++) {
        ascc_measures m = {.size = sizeof m};
        assert_int_equal(ascc_step_run(step, particles, &none, 1), ASCC_OK);
        assert_int_equal(ascc_particles_measure(particles, &m), ASCC_OK);
        if (!(m.max_speed < 1.0)) /* 27 m/s in the report */
            fail_msg("%s, pitch %g, %d layers: %g m/s", name, pitch, layers, m.max_speed);
    }
    assert_int_equal(ascc_particles_get(particles, ASCC_FLUID, ASCC_POSITION, 0, 64, &to), ASCC_OK);
    for (size_t k = 0; k < 3 * 64; k++)
        assert_true(fluid[k] > -0.5 * SPACING && fluid[k] < edge + 0.5 * SPACING);
    ascc_particles_destroy(&particles);
    ascc_step_destroy(&step);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(normal);
    free(wall);
}

static void no_walls_however_dense_throw_out_the_water_of_water3d(void **state)
{
    (void)state;
    static const double pitches[] = {1.0, 0.64, 0.4, 0.2};
    for (size_t i = 0; i < sizeof pitches / sizeof *pitches; i++)
        rest_in_a_tank("water3d", pitches[i], 1);
    rest_in_a_tank("water3d", 0.5, 2);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(no_walls_however_dense_throw_out_the_water_of_water3d),
        cmocka_unit_test(with_areas_the_density_of_walls_does_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
