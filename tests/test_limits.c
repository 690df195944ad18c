/* Steps at the ends of their ranges, through the public API: what cannot be held is an error that names
 * the particle, and nothing has changed. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/counting.h"
#include "support/model_builder.h"
#include "support/random.h"
#include "support/test.h"

static const double spacing = 0.05, time_step = 0.005; /* of the random models */

typedef struct world {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
} world;

static world open_world(const model_random *random, double mass, double quantum,
                        const ascc_context_options *options)
{
    world w = {0};
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    const ascc_particles_options set = {.size = sizeof set,
                                        .dimension = random->dimension ? random->dimension : 2,
                                        .spacing = spacing,
                                        .mass = mass,
                                        .momentum_quantum = quantum};
    assert_int_equal(ascc_context_create(options, &w.context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(w.context, bytes, size, &w.model), ASCC_OK);
    free(bytes);
    assert_int_equal(ascc_particles_create(w.context, &set, &w.particles), ASCC_OK);
    assert_int_equal(ascc_step_create(w.context, w.model, NULL, &w.step), ASCC_OK);
    return w;
}

static void close_world(world *w)
{
    ascc_step_destroy(&w->step);
    ascc_particles_destroy(&w->particles);
    ascc_model_destroy(&w->model);
    ascc_context_destroy(&w->context);
}

static void add_fluid(world *w, size_t count, const double *position, const double *velocity)
{
    const ascc_const_array x = {.data = position, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(w->particles, count, &x, &v, NULL, NULL), ASCC_OK);
}

static void add_wall(world *w, size_t count, const double *position, const double *normal)
{
    const ascc_const_array x = {.data = position, .scalar = ASCC_DOUBLE};
    const ascc_const_array n = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_boundary(w->particles, count, &x, &n, 0, NULL), ASCC_OK);
}

static ascc_status run(world *w, double gravity)
{
    const double g[3] = {gravity, 0.0, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = g};
    return ascc_step_run(w->step, w->particles, &forces, 1);
}

/* RANGE, with this word in the message, and a set that is as it was. */
static void check_out_of_range(world *w, double gravity, const char *word)
{
    const uint64_t before = ascc_particles_hash(w->particles);
    assert_int_equal(run(w, gravity), ASCC_ERROR_RANGE);
    if (!strstr(ascc_step_message(w->step), word))
        fail_msg("'%s' does not say '%s'", ascc_step_message(w->step), word);
    assert_true(ascc_particles_hash(w->particles) == before);
}

/* ---- Impulses ---- */

/* Particles and a wall within each other's reach, of masses that make every power of two of an impulse up to
 * 2^300 quanta and more: each step is done, or refused by name. */
static void check_heavy_particles(const model_random *random)
{
    static const double x[3][2] = {{0.0, 0.0}, {0.032, 0.016}, {0.008, 0.04}};
    static const double v[3][2] = {{0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}};
    static const double wall[2][2] = {{0.03, -0.02}, {0.0, -0.03}}, normal[2][2] = {{0, 1}, {0, 1}};
    int refused = 0;
    for (int exponent = 0; exponent < 320; exponent++) {
        world w = open_world(random, ldexp(1.0, exponent), ldexp(1.0, -40), NULL);
        add_fluid(&w, 3, x[0], v[0]);
        add_wall(&w, 2, wall[0], normal[0]);
        const uint64_t before = ascc_particles_hash(w.particles);
        const ascc_status status = run(&w, 0.0);
        if (status != ASCC_OK) {
            refused++;
            assert_int_equal(status, ASCC_ERROR_RANGE);
            assert_non_null(strstr(ascc_step_message(w.step), "fluid row"));
            assert_true(ascc_particles_hash(w.particles) == before);
        }
        close_world(&w);
    }
    assert_true(refused > 200 && refused < 320);
}

static void impulses_beyond_any_limit_are_an_error_without_overflow(void **state)
{
    (void)state;
    const model_random outputs[] = {
        {.seed = 3, .projection = "none"},
        {.seed = 3, .projection = "radial"},
        {.seed = 3, .plain = 1},
        {.seed = 3, .bumps = 3, .order = 1, .fluid_only = 1},
        {.seed = 3, .bumps = 3, .order = 1, .fluid_only = 1, .motion = 1, .damping = 1},
        {.seed = 3, .bumps = 3, .order = 1, .fluid_only = 1, .motion = 1, .direction = 1},
        {.seed = 3, .bumps = 3, .order = 1, .fluid_only = 1, .walls = 1},
        {.seed = 4, .bumps = 3, .order = 1, .fluid_only = 1, .walls = 1},
    };
    for (size_t i = 0; i < COUNT_OF(outputs); i++)
        check_heavy_particles(&outputs[i]);
}

/* ---- Momenta and positions ---- */

/* Gives next to nothing, so that what a test sets is what counts. */
static const model_random idle = {.dimension = 2,
                                  .scale = 1e-40,
                                  .bumps = 2,
                                  .order = 1,
                                  .fluid_only = 1,
                                  .walls = 1,
                                  .contact = 0.4};

static void the_largest_momentum_is_held_and_one_quantum_more_is_not(void **state)
{
    (void)state;
    const double quantum = 0x1p-61, one = quantum / time_step; /* mass 1: 2^61 quanta are 1 m/s */
    for (int sign = -1; sign <= 1; sign += 2) {
        world w = open_world(&idle, 1.0, quantum, NULL);
        const double x[2] = {0.0, 0.0}, v[2] = {sign, 0.0};
        int64_t momentum[2];
        add_fluid(&w, 1, x, v);
        assert_int_equal(run(&w, 0.0), ASCC_OK);
        assert_int_equal(ascc_particles_get_momentum(w.particles, 0, 1, momentum), ASCC_OK);
        assert_true(momentum[0] == sign * ((int64_t)1 << 61));
        check_out_of_range(&w, sign * one, "fluid particle 1 (row 0): momentum");
        check_out_of_range(&w, sign, "momentum");       /* not a quantum but a hundredth of all */
        check_out_of_range(&w, sign * 1e3, "momentum"); /* more than fits a particle at once */
        assert_int_equal(run(&w, -sign * one), ASCC_OK);
        assert_int_equal(ascc_particles_get_momentum(w.particles, 0, 1, momentum), ASCC_OK);
        assert_true(momentum[0] == sign * (((int64_t)1 << 61) - 1));
        close_world(&w);
    }
}

static void a_particle_that_leaves_the_range_of_positions_is_named(void **state)
{
    (void)state;
    model_random wide = idle; /* a network that sees this far finds its neighbours out there, too */
    wide.radius = 60.0;
    for (int sign = -1; sign <= 1; sign += 2) {
        world w = open_world(&wide, 1.0, 0.0, NULL);
        const double x[2] = {sign * 0x1p40 * spacing, 0.0}, v[2] = {sign * 100.0, 0.0};
        add_fluid(&w, 1, x, v);
        check_out_of_range(&w, 0.0, "fluid particle 1 (row 0): position out of range");
        close_world(&w);
    }
}

/* ---- Contact ---- */

/* A wall that turns a particle's way into one with a component beyond 2^61 quanta. */
static void a_momentum_that_contact_makes_too_large_is_an_error(void **state)
{
    (void)state;
    const double quantum = 0x1p-60 * spacing / time_step; /* 2^61 quanta: 2 spacings a step */
    const double full = 2.0 * spacing / time_step;
    for (int sign = -1; sign <= 1; sign += 2) {
        world w = open_world(&idle, 1.0, quantum, NULL);
        const double x[2] = {0.0, 0.0}, v[2] = {sign * 0.99 * full, 0.99 * full};
        const double normal[2] = {sign * 0.6, -0.8};
        const double at[2] = {-normal[0] * 0.5 * spacing + v[0] * 0.1 * time_step,
                              -normal[1] * 0.5 * spacing + v[1] * 0.1 * time_step};
        add_fluid(&w, 1, x, v);
        add_wall(&w, 1, at, normal);
        check_out_of_range(&w, 0.0, "fluid row 0: a wall gives it a momentum too large to hold");
        close_world(&w);
    }
}

/* Particles that give one wall more than it can hold: four of nearly 2^61 quanta each. */
static void a_wall_that_gets_more_than_it_can_hold_is_an_error(void **state)
{
    (void)state;
    const double quantum = 0x1p-60 * spacing / time_step, full = 2.0 * spacing / time_step;
    for (size_t count = 1; count <= 8; count++) {
        world w = open_world(&idle, 1.0, quantum, NULL);
        double x[8][2], v[8][2];
        for (size_t i = 0; i < count; i++) {
            x[i][0] = 0.05 * spacing * (double)i;
            x[i][1] = 0.5 * spacing;
            v[i][0] = 0.0;
            v[i][1] = -0.99 * full;
        }
        const double at[2] = {0.2 * spacing, 0.0}, normal[2] = {0.0, 1.0};
        add_fluid(&w, count, x[0], v[0]);
        add_wall(&w, 1, at, normal);
        if (count < 4)
            assert_int_equal(run(&w, 0.0), ASCC_OK);
        else
            check_out_of_range(&w, 0.0, "a wall gives it a momentum too large to hold");
        close_world(&w);
    }
}

/* ---- What a step tells and needs ---- */

static void levels_that_a_model_does_not_have_have_no_points(void **state)
{
    (void)state;
    const model_random two = {.levels = 2};
    world w = open_world(&two, 0.125, 0.0, NULL);
    double x[64][2], v[64][2];
    for (int i = 0; i < 64; i++) {
        x[i][0] = i % 8 * spacing;
        x[i][1] = i / 8 * spacing;
        v[i][0] = v[i][1] = 0.0;
    }
    add_fluid(&w, 64, x[0], v[0]);
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(run(&w, 0.0), ASCC_OK);
    assert_int_equal(ascc_step_get_statistics(w.step, &s), ASCC_OK);
    assert_int_equal(s.level_points[0], 64);
    assert_true(s.level_points[1] > 0);
    for (size_t level = 2; level < COUNT_OF(s.level_points); level++)
        assert_int_equal(s.level_points[level], 0);
    close_world(&w);
}

static void the_estimate_holds_with_farthest_points(void **state)
{
    (void)state;
    const model_random farthest = {
        .dimension = 3, .levels = 2, .channels = 8, .method = "farthest"};
    enum { SIDE = 14, COUNT = SIDE * SIDE * SIDE };
    static double x[COUNT][3], v[COUNT][3];
    for (int i = 0; i < COUNT; i++) {
        x[i][0] = i % SIDE * spacing;
        x[i][1] = i / SIDE % SIDE * spacing;
        x[i][2] = i / SIDE / SIDE * spacing;
    }
    world w = open_world(&farthest, 0.125, 0.0, NULL);
    add_fluid(&w, COUNT, x[0], v[0]);
    const size_t estimate = ascc_step_estimate(w.step, COUNT, 0);
    ascc_step_statistics s = {.size = sizeof s};
    for (int n = 0; n < 3; n++)
        assert_int_equal(run(&w, 0.0), ASCC_OK);
    assert_int_equal(ascc_step_get_statistics(w.step, &s), ASCC_OK);
    assert_true(estimate < 2 * s.scratch_size && s.scratch_size < 2 * estimate);
    close_world(&w);
}

static void an_acceleration_without_memory_is_an_error_and_moves_nothing(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_context_options options = test_memory_options(&memory);
    const double x[2] = {0.0, 0.0}, v[2] = {1.0, 0.0}, a[2] = {3.0, 4.0}, none[2] = {0.0, 0.0};
    const ascc_const_array acceleration = {.data = a, .scalar = ASCC_DOUBLE};
    const ascc_forces forces = {
        .size = sizeof forces, .gravity = none, .acceleration = &acceleration};
    world w = open_world(&idle, 0.125, 0.0, &options);
    add_fluid(&w, 1, x, v);
    const uint64_t before = ascc_particles_hash(w.particles);
    memory.fail_at = memory.calls + 1; /* the copy of the acceleration comes first */
    assert_int_equal(ascc_step_run(w.step, w.particles, &forces, 1), ASCC_ERROR_MEMORY);
    assert_non_null(strstr(ascc_step_message(w.step), "acceleration"));
    assert_true(ascc_particles_hash(w.particles) == before);
    memory.fail_at = 0;
    assert_int_equal(ascc_step_run(w.step, w.particles, &forces, 1), ASCC_OK);
    close_world(&w);
    assert_true(test_memory_is_clean(&memory));
}

/* ---- Measures ---- */

static void measures_of_nothing_or_into_nothing_are_refused(void **state)
{
    (void)state;
    world w = open_world(&idle, 0.125, 0.0, NULL);
    ascc_measures measures = {.size = sizeof measures}, short_one = {.size = sizeof(size_t)};
    assert_int_equal(ascc_particles_measure(NULL, &measures), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_measure(w.particles, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_measure(w.particles, &short_one), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(ascc_particles_message(w.particles), "size"));
    assert_int_equal(ascc_particles_measure(w.particles, &measures), ASCC_OK);
    close_world(&w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(impulses_beyond_any_limit_are_an_error_without_overflow),
        cmocka_unit_test(the_largest_momentum_is_held_and_one_quantum_more_is_not),
        cmocka_unit_test(a_particle_that_leaves_the_range_of_positions_is_named),
        cmocka_unit_test(a_momentum_that_contact_makes_too_large_is_an_error),
        cmocka_unit_test(a_wall_that_gets_more_than_it_can_hold_is_an_error),
        cmocka_unit_test(levels_that_a_model_does_not_have_have_no_points),
        cmocka_unit_test(the_estimate_holds_with_farthest_points),
        cmocka_unit_test(an_acceleration_without_memory_is_an_error_and_moves_nothing),
        cmocka_unit_test(measures_of_nothing_or_into_nothing_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
