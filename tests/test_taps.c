/* Taps let fluid in where there is room and as fast as they may; drains take out what they say.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/counting.h"
#include "support/random.h"
#include "support/test.h"

#define SPACING 0.1
#define MOST 4000

typedef struct fixture {
    test_memory memory;
    ascc_context *context;
    ascc_particles *set[4]; /* [dimension] */
} fixture;

static int open_fixture(void **state)
{
    fixture *self = calloc(1, sizeof *self);
    const ascc_context_options options = test_memory_options(&self->memory);
    assert_int_equal(ascc_context_create(&options, &self->context), ASCC_OK);
    for (int d = 2; d <= 3; d++) {
        const ascc_particles_options set = {
            .size = sizeof set, .dimension = d, .spacing = SPACING, .mass = 2};
        assert_int_equal(ascc_particles_create(self->context, &set, &self->set[d]), ASCC_OK);
    }
    *state = self;
    return 0;
}

static int close_fixture(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++)
        ascc_particles_destroy(&self->set[d]);
    ascc_context_destroy(&self->context);
    const bool clean = test_memory_is_clean(&self->memory);
    free(self);
    return clean ? 0 : 1;
}

static size_t run_tap(ascc_particles *set, ascc_tap *tap, double seconds)
{
    size_t count = 99;
    if (ascc_tap_run(set, tap, seconds, 0, NULL, &count) != ASCC_OK)
        fail_msg("%s", ascc_particles_message(set));
    return count;
}

static void read_fluid(const ascc_particles *set, ascc_field field, size_t first, size_t count,
                       double *into)
{
    const ascc_array to = {.data = into, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(set, ASCC_FLUID, field, first, count, &to), ASCC_OK);
}

/* Moves all fluid as its velocity says. */
static void drift(ascc_particles *set, int d, double seconds)
{
    static double x[3 * MOST], v[3 * MOST];
    const size_t n = ascc_particles_count(set, ASCC_FLUID);
    const ascc_const_array to = {.data = x, .scalar = ASCC_DOUBLE};
    assert_true(n <= MOST);
    read_fluid(set, ASCC_POSITION, 0, n, x);
    read_fluid(set, ASCC_VELOCITY, 0, n, v);
    for (size_t k = 0; k < n * (size_t)d; k++)
        x[k] += seconds * v[k];
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, ASCC_POSITION, 0, n, &to), ASCC_OK);
}

static void a_mouth_is_a_lattice_across_the_velocity(void **state)
{
    fixture *self = *state;
    double x[3 * MOST], v[3 * MOST], mass[MOST];
    for (int d = 2; d <= 3; d++) {
        ascc_particles *const set = self->set[d];
        ascc_tap tap = {.size = sizeof tap,
                        .position = {1, 2, d == 3 ? 3 : 0},
                        .radius = 2.5 * SPACING,
                        .velocity = {1, -2, d == 3 ? 0.5 : 0},
                        .mass = 0.25};
        const size_t n = run_tap(set, &tap, 1), places = d == 2 ? 5 : 21;
        assert_int_equal(n, places); /* i^2 + j^2 <= 6.25 */
        read_fluid(set, ASCC_POSITION, 0, n, x);
        read_fluid(set, ASCC_VELOCITY, 0, n, v);
        read_fluid(set, ASCC_MASS, 0, n, mass);
        for (size_t i = 0; i < n; i++) {
            double along = 0, square = 0, nearest = INFINITY;
            for (int c = 0; c < d; c++) {
                const double off = x[i * (size_t)d + (size_t)c] - tap.position[c];
                along += off * tap.velocity[c];
                square += off * off;
                assert_true(fabs(v[i * (size_t)d + (size_t)c] - tap.velocity[c]) < 1e-6);
            }
            for (size_t j = 0; j < n; j++) {
                double apart = 0;
                for (int c = 0; c < d; c++)
                    apart += pow(x[i * (size_t)d + (size_t)c] - x[j * (size_t)d + (size_t)c], 2);
                nearest = i != j ? fmin(nearest, sqrt(apart)) : nearest;
            }
            assert_true(fabs(along) < 1e-12 && sqrt(square) <= tap.radius);
            assert_true(fabs(nearest - SPACING) < 1e-12);
            assert_true(mass[i] == 0.25);
        }
        assert_int_equal(run_tap(set, &tap, 1), 0); /* no room */
        assert_int_equal(tap.emitted, places);
    }
}

static void a_box_is_filled_evenly(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++) {
        ascc_tap tap = {.size = sizeof tap, .half = {1.5 * SPACING, SPACING, 2.49 * SPACING}};
        assert_int_equal(run_tap(self->set[d], &tap, 1), d == 2 ? 4 * 3 : 4 * 3 * 5);
    }
}

static void what_comes_out_keeps_its_distance(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++) {
        ascc_particles *const set = self->set[d];
        ascc_measures measures = {.size = sizeof measures};
        ascc_tap tap = {.size = sizeof tap,
                        .radius = 2 * SPACING,
                        .velocity = {0, -3, 0},
                        .clearance = 0.85 * SPACING};
        size_t layers = 0;
        for (int n = 0; n < 60; n++) { /* 0.3 spacings each: a layer at each third */
            layers += run_tap(set, &tap, 0.01) > 0;
            drift(set, d, 0.01);
        }
        assert_int_equal(layers, 20);
        assert_int_equal(ascc_particles_measure(set, &measures), ASCC_OK);
        assert_true(fabs(measures.min_distance - 0.9 * SPACING) < 1e-6);
        assert_int_equal(ascc_particles_count(set, ASCC_FLUID), tap.emitted);
    }
}

static void the_rate_is_kept_and_what_has_no_room_waits(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[3];
    const ascc_drain all = {.size = sizeof all};
    ascc_tap tap = {.size = sizeof tap,
                    .radius = 2 * SPACING,
                    .velocity = {1, 0, 0},
                    .rate = 37}; /* 13 places */
    size_t count = 0, gone = 0, sum = 0;
    for (int n = 1; n <= 1000; n++) {
        sum += run_tap(set, &tap, 0.01);
        assert_true(fabs((double)sum - 0.37 * n) < 1 + 1e-9);
        assert_int_equal(ascc_drain_run(set, &all, 0, NULL, &gone), ASCC_OK);
        count += gone;
    }
    assert_int_equal(count, sum);
    assert_int_equal(sum, tap.emitted);
    /* Blocked for long, it owes no more than a mouthful. */
    for (int n = 0; n < 500; n++)
        (void)run_tap(set, &tap, 0.01);
    assert_int_equal(ascc_particles_count(set, ASCC_FLUID), 13);
    assert_int_equal(ascc_drain_run(set, &all, 0, NULL, NULL), ASCC_OK);
    assert_int_equal(run_tap(set, &tap, 0), 13);
}

static void nothing_comes_out_near_walls_or_beyond_the_ids(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[2];
    const double x[4] = {0.04, 0, -0.046, 0}, n[4] = {0, 1, 0, 1};
    const ascc_const_array at = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = n, .scalar = ASCC_DOUBLE};
    ascc_tap tap = {.size = sizeof tap, .radius = 2 * SPACING, .velocity = {0, 1, 0}};
    uint64_t ids[4], read[4];
    size_t count;
    assert_int_equal(ascc_particles_add_boundary(set, 2, &at, &normal, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_tap_run(set, &tap, 1, 3, ids, &count), ASCC_OK); /* of 5, one blocked */
    assert_int_equal(count, 3);
    assert_int_equal(ascc_particles_get_ids(set, ASCC_FLUID, 0, 3, read), ASCC_OK);
    assert_memory_equal(ids, read, 3 * sizeof *ids);
    assert_int_equal(ascc_tap_run(set, &tap, 1, 3, ids, &count), ASCC_OK);
    assert_int_equal(count, 1);
    assert_int_equal(run_tap(set, &tap, 1), 0);
}

static void drains_take_what_they_say(void **state)
{
    fixture *self = *state;
    static double x[3 * 1000];
    static uint64_t ids[1000], gone[1000], left[1000];
    for (int d = 2; d <= 3; d++)
        for (int kind = ASCC_DRAIN_ALL; kind <= ASCC_DRAIN_HALF_SPACE; kind++)
            for (int variant = 0; variant < 4; variant++) { /* outside, by age */
                ascc_particles *const set = self->set[d];
                test_random random = {7};
                const ascc_const_array at = {.data = x, .scalar = ASCC_DOUBLE};
                for (int k = 0; k < 1000 * d; k++)
                    x[k] = test_random_between(&random, -1, 1);
                assert_int_equal(ascc_particles_clear(set, ASCC_FLUID), ASCC_OK);
                assert_int_equal(ascc_particles_add_fluid(set, 1000, &at, NULL, NULL, ids),
                                 ASCC_OK);
                const ascc_drain drain = {.size = sizeof drain,
                                          .kind = (ascc_drain_kind)kind,
                                          .outside = kind != ASCC_DRAIN_ALL && variant % 2,
                                          .position = {0.1, -0.2, 0.3},
                                          .half = {0.5, 0.6, 0.7},
                                          .radius = 0.8,
                                          .normal = {1, -2, 0.5},
                                          .before = variant / 2 ? ids[400] : 0};
                size_t wanted = 0, kept = 0, count;
                uint64_t want[1000], keep[1000];
                for (size_t i = 0; i < 1000; i++) {
                    const double *p = x + i * (size_t)d;
                    double off[3] = {0}, r = 0, along = 0;
                    for (int c = 0; c < d; c++) {
                        off[c] = p[c] - drain.position[c];
                        r += off[c] * off[c];
                        along += off[c] * drain.normal[c];
                    }
                    const bool in =
                        kind == ASCC_DRAIN_ALL ? true
                        : kind == ASCC_DRAIN_BOX
                            ? fabs(off[0]) <= 0.5 && fabs(off[1]) <= 0.6 && fabs(off[2]) <= 0.7
                        : kind == ASCC_DRAIN_SPHERE ? r <= 0.64
                                                    : along > 0;
                    if (in != (drain.outside == 1) && (variant < 2 || i < 400))
                        want[wanted++] = ids[i];
                    else
                        keep[kept++] = ids[i];
                }
                assert_true(wanted > 50);
                assert_int_equal(ascc_drain_run(set, &drain, 30, gone, &count), ASCC_OK);
                assert_int_equal(count, 30); /* the oldest */
                assert_int_equal(ascc_drain_run(set, &drain, 1000, gone + 30, &count), ASCC_OK);
                assert_int_equal(count, wanted - 30);
                assert_memory_equal(gone, want, wanted * sizeof *want);
                assert_int_equal(ascc_particles_count(set, ASCC_FLUID), kept);
                assert_int_equal(ascc_particles_get_ids(set, ASCC_FLUID, 0, kept, left), ASCC_OK);
                assert_memory_equal(left, keep, kept * sizeof *keep);
            }
}

static void wrong_taps_and_drains_are_named_and_change_nothing(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[3];
    const ascc_tap good = {.size = sizeof good, .radius = 0.3, .velocity = {1, 0, 0}};
    const struct {
        size_t offset;
        double value;
        ascc_status status;
        const char *said;
    } cases[] = {
        {offsetof(ascc_tap, position), (double)NAN, ASCC_ERROR_NOT_FINITE, "position component 0"},
        {offsetof(ascc_tap, radius), -1, ASCC_ERROR_ARGUMENT, "radius is -1"},
        {offsetof(ascc_tap, radius), 1e9, ASCC_ERROR_RANGE, "2^20"},
        {offsetof(ascc_tap, half) + 8, -1, ASCC_ERROR_ARGUMENT, "half"},
        {offsetof(ascc_tap, velocity), 0, ASCC_ERROR_ARGUMENT, "velocity"},
        {offsetof(ascc_tap, velocity), (double)INFINITY, ASCC_ERROR_NOT_FINITE, "velocity"},
        {offsetof(ascc_tap, velocity), 1e30, ASCC_ERROR_RANGE, "velocity"},
        {offsetof(ascc_tap, rate), -1, ASCC_ERROR_ARGUMENT, "rate"},
        {offsetof(ascc_tap, pitch), 1e-9, ASCC_ERROR_RANGE, "places"},
        {offsetof(ascc_tap, clearance), (double)NAN, ASCC_ERROR_NOT_FINITE, "clearance"},
        {offsetof(ascc_tap, mass), -1, ASCC_ERROR_ARGUMENT, "mass"},
        {offsetof(ascc_tap, owed), -1, ASCC_ERROR_ARGUMENT, "owed"},
    };
    const uint64_t hash = ascc_particles_hash(set);
    size_t count = 99;
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        ascc_tap tap = good;
        memcpy((unsigned char *)&tap + cases[i].offset, &cases[i].value, sizeof(double));
        const ascc_tap before = tap;
        const ascc_status status = ascc_tap_run(set, &tap, 1, 0, NULL, &count);
        if (status != cases[i].status || !strstr(ascc_particles_message(set), cases[i].said))
            fail_msg("case %zu: %d, '%s'", i, (int)status, ascc_particles_message(set));
        assert_memory_equal(&tap, &before, sizeof tap);
    }
    ascc_tap tap = good;
    assert_int_equal(ascc_tap_run(set, &tap, -1, 0, NULL, &count), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_tap_run(set, NULL, 1, 0, NULL, &count), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_tap_run(set, &tap, 1, 0, NULL, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_tap_run(NULL, &tap, 1, 0, NULL, &count), ASCC_ERROR_ARGUMENT);
    const ascc_drain drains[] = {
        {.size = sizeof drains[0], .kind = (ascc_drain_kind)9},
        {.size = sizeof drains[0], .outside = 1},
        {.size = sizeof drains[0], .kind = ASCC_DRAIN_BOX, .outside = 2},
        {.size = sizeof drains[0], .kind = ASCC_DRAIN_BOX, .half = {-1, 1, 1}},
        {.size = sizeof drains[0], .kind = ASCC_DRAIN_SPHERE, .radius = -1},
        {.size = sizeof drains[0], .kind = ASCC_DRAIN_HALF_SPACE},
        {.size = 8},
    };
    for (size_t i = 0; i < COUNT_OF(drains); i++) {
        assert_int_equal(ascc_drain_run(set, &drains[i], 0, NULL, &count), ASCC_ERROR_ARGUMENT);
        assert_non_null(strstr(ascc_particles_message(set), "drain"));
    }
    assert_int_equal(count, 99);
    assert_true(ascc_particles_hash(set) == hash);
}

static void without_memory_nothing_has_changed(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[3];
    const ascc_tap good = {.size = sizeof good, .radius = 0.3, .velocity = {1, 0, 0}, .rate = 1e9};
    const ascc_drain all = {.size = sizeof all};
    size_t count, tries = 0;
    for (bool done = false; !done; tries++) {
        ascc_tap tap = good;
        const uint64_t hash = ascc_particles_hash(set);
        self->memory.fail_at = self->memory.calls + 1 + tries;
        const ascc_status status = ascc_tap_run(set, &tap, 1, 0, NULL, &count);
        done = self->memory.calls < self->memory.fail_at;
        self->memory.fail_at = 0;
        assert_int_equal(status, done ? ASCC_OK : ASCC_ERROR_MEMORY);
        assert_true(done || (ascc_particles_hash(set) == hash && tap.owed == 0));
    }
    assert_true(tries >= 4);
    self->memory.fail_at = self->memory.calls + 1;
    assert_int_equal(ascc_drain_run(set, &all, 0, NULL, &count), ASCC_ERROR_MEMORY);
    self->memory.fail_at = 0;
    assert_int_equal(ascc_particles_count(set, ASCC_FLUID), 29);
}

/* A tank with a tap above and a drain at one side. */
static void a_tap_fills_a_tank_of_a_shipped_network(void **state)
{
    fixture *self = *state;
    ascc_model *model;
    ascc_step *step;
    ascc_particles *set;
    ascc_model_info info = {.size = sizeof info};
    ascc_particles_options options = {.size = sizeof options};
    assert_int_equal(
        ascc_model_load(self->context, SOURCE_ROOT "/examples/models/water2d.safetensors", &model),
        ASCC_OK);
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(ascc_model_particles_options(model, 0, &options), ASCC_OK);
    assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_OK);
    assert_int_equal(ascc_step_create(self->context, model, NULL, &step), ASCC_OK);
    const double h = info.particle_spacing;
    const ascc_shape tank = {.size = sizeof tank,
                             .kind = ASCC_SHAPE_BOX,
                             .water = ASCC_WATER_INSIDE,
                             .half = {12 * h, 20 * h, 0},
                             .open = 8};
    const ascc_pose pose = {.size = sizeof pose, .position = {0, 20 * h, 0}};
    ascc_tap tap = {.size = sizeof tap,
                    .position = {5 * h, 12 * h, 0},
                    .radius = 2 * h,
                    .velocity = {0, -1, 0}};
    const ascc_drain drain = {.size = sizeof drain,
                              .kind = ASCC_DRAIN_BOX,
                              .position = {-11 * h, 2 * h, 0},
                              .half = {2 * h, 2 * h, 0}};
    int32_t body;
    size_t in = 0, out = 0;
    double nearest = INFINITY;
    assert_int_equal(ascc_body_add(set, &tank, &pose, &body), ASCC_OK);
    for (int frame = 0; frame < 250; frame++) {
        size_t gone;
        ascc_measures measures = {.size = sizeof measures};
        in += run_tap(set, &tap, info.time_step);
        if (ascc_step_run(step, set, NULL, 1) != ASCC_OK)
            fail_msg("frame %d: %s", frame, ascc_step_message(step));
        assert_int_equal(ascc_drain_run(set, &drain, 0, NULL, &gone), ASCC_OK);
        out += gone;
        assert_int_equal(ascc_particles_measure(set, &measures), ASCC_OK);
        nearest = fmin(nearest, measures.min_distance);
        assert_int_equal(ascc_particles_count(set, ASCC_FLUID), in - out);
    }
    print_message("%zu in, %zu out, nearest pair %.3f spacings\n", in, out, nearest / h);
    assert_true(in > 300 && out > 20);
    assert_true(nearest > 0.2 * h);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&set);
    ascc_model_destroy(&model);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_fixture, close_fixture)
    const struct CMUnitTest tests[] = {
        TEST(a_mouth_is_a_lattice_across_the_velocity),
        TEST(a_box_is_filled_evenly),
        TEST(what_comes_out_keeps_its_distance),
        TEST(the_rate_is_kept_and_what_has_no_room_waits),
        TEST(nothing_comes_out_near_walls_or_beyond_the_ids),
        TEST(drains_take_what_they_say),
        TEST(wrong_taps_and_drains_are_named_and_change_nothing),
        TEST(without_memory_nothing_has_changed),
        TEST(a_tap_fills_a_tank_of_a_shipped_network),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
