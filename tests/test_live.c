/* What `ascc view` shows: the bits of the steps it makes, restarted, switched, stirred; sequences played.
 * SPDX-License-Identifier: MIT */
#include "support/test.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../examples/ascc/host.h"
#include "../examples/ascc/live.h"
#include "../examples/ascc/scenes.h"

#define TINY SOURCE_ROOT "/examples/models/water2d-tiny.safetensors"
#define TINY_3D SOURCE_ROOT "/examples/models/water3d-tiny.safetensors"

static const ascc_live_options flat = {
    .model = {TINY, "demo"}, .models = 2, .scene = "dam-break-2d", .size = 12, .threads = 1};

static void assert_near(double a, double b, double tolerance)
{
    if (!(fabs(a - b) <= tolerance))
        fail_msg("%.9g is not %.9g within %g", a, b, tolerance);
}

static ascc_live opened(const ascc_live_options *options)
{
    ascc_live live;
    if (!ascc_live_open(&live, options))
        fail_msg("%s", live.error);
    return live;
}

static void advance(ascc_live *live, int steps)
{
    for (int i = 0; i < steps; i++)
        if (!ascc_live_advance(live))
            fail_msg("step %d: %s", i, live->error);
}

/* The same scene by the library: so many steps of the one model, then of the other. */
static uint64_t expected(int steps, int others)
{
    ascc_context *context = NULL;
    ascc_model *model = NULL, *demo = NULL;
    ascc_particles *particles = NULL;
    ascc_step *step = NULL, *other = NULL;
    ascc_sequence s;
    ascc_host_error why;
    char error[256];
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load(context, TINY, &model), ASCC_OK);
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_true(
        ascc_scene_make("dam-break", 2, 12, info.particle_spacing, &s, error, sizeof error));
    assert_int_equal(ascc_host_model(context, "demo", 2, 2.0 * s.radius, &demo, &why), ASCC_OK);
    assert_int_equal(ascc_host_particles(context, &s, s.position, s.velocity, &particles), ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_step_create(context, demo, NULL, &other), ASCC_OK);
    const ascc_forces forces = {.size = sizeof forces, .gravity = s.gravity};
    assert_int_equal(ascc_step_run(step, particles, &forces, steps), ASCC_OK);
    assert_int_equal(ascc_step_run(other, particles, &forces, others), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(particles);
    ascc_step_destroy(&step);
    ascc_step_destroy(&other);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_model_destroy(&demo);
    ascc_context_destroy(&context);
    ascc_sequence_free(&s);
    return hash;
}

static void test_a_run_has_the_bits_of_its_steps(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    advance(&live, 6);
    assert_int_equal(live.step, 6);
    assert_true(ascc_particles_hash(live.particles) == expected(6, 0));
    assert_true(live.stages > 5 && strcmp(live.stage[live.stages - 1].name, "total") == 0);
    ascc_live_close(&live);
}

static void test_a_restart_runs_again_from_the_first_bit(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    const uint64_t first = ascc_particles_hash(live.particles);
    advance(&live, 4);
    const uint64_t later = ascc_particles_hash(live.particles);
    assert_true(later != first);
    assert_true(ascc_live_restart(&live));
    assert_int_equal(live.step, 0);
    assert_true(ascc_particles_hash(live.particles) == first);
    advance(&live, 4);
    assert_true(ascc_particles_hash(live.particles) == later);
    ascc_live_close(&live);
}

static void test_another_model_goes_on_from_there(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    advance(&live, 3);
    assert_true(ascc_live_switch(&live));
    advance(&live, 2);
    assert_int_equal(live.model, 1);
    assert_true(ascc_particles_hash(live.particles) == expected(3, 2));
    assert_true(ascc_live_switch(&live));
    assert_int_equal(live.model, 0);
    ascc_live_close(&live);
}

static double to_ball(const ascc_live *live, size_t i)
{
    return hypot((double)live->position[2 * i] - live->ball.center[0],
                 (double)live->position[2 * i + 1] - live->ball.center[1]);
}

/* Pulled through still water the ball keeps it out, and goes no faster and no farther than it may. */
static void test_a_ball_pulled_through_water_pushes_it_aside(void **state)
{
    (void)state;
    ascc_live_options options = flat;
    options.size = 24;
    ascc_live live = opened(&options);
    const double h = 2.0 * live.scene.radius;
    assert_true(ascc_live_toggle_ball(&live));
    assert_true(live.ball.there && live.ball.count > 20);
    for (size_t i = 0; i < live.count; i++)
        assert_true(to_ball(&live, i) > live.ball.radius + 0.5 * h);
    const double target[3] = {6.0 * h, 7.0 * h, 0.0};
    double middle = 0.0;
    size_t inside = 0;
    for (int step = 0; step < 200; step++) {
        const double before[2] = {live.ball.center[0], live.ball.center[1]};
        ascc_live_pull(&live, target);
        advance(&live, 1);
        assert_true(hypot(live.ball.center[0] - before[0], live.ball.center[1] - before[1]) <=
                    0.25 * h * (1.0 + 1e-9));
    }
    assert_near(live.ball.center[0], target[0], 1e-9);
    assert_near(live.ball.center[1], target[1], 1e-9);
    for (size_t i = 0; i < live.count; i++) {
        inside += to_ball(&live, i) < live.ball.radius - 0.5 * h;
        middle += to_ball(&live, i) < live.ball.radius + 2.0 * h ? 1.0 : 0.0;
    }
    assert_true(middle > 10.0); /* it is in the water */
    if (inside > 2)
        fail_msg("%zu particles in the ball", inside);
    ascc_live_close(&live);
}

static void test_a_ball_stays_in_the_box(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    assert_true(ascc_live_toggle_ball(&live));
    const double room = live.ball.radius + live.scene.radius;
    ascc_live_pull(&live, (const double[3]){1e9, -1e9, 0.0});
    assert_near(live.ball.target[0], live.view.high[0] - room, 1e-12);
    assert_near(live.ball.target[1], live.view.low[1] + room, 1e-12);
    ascc_live_close(&live);
}

static void test_a_ball_taken_away_leaves_the_walls(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    const uint64_t before = ascc_particles_hash(live.particles);
    assert_true(ascc_live_toggle_ball(&live));
    assert_true(ascc_particles_hash(live.particles) != before);
    assert_int_equal(ascc_live_marks(&live).body_count, live.ball.count);
    assert_true(ascc_live_restart(&live));
    assert_true(live.ball.there); /* through a restart */
    assert_true(ascc_live_toggle_ball(&live));
    assert_true(ascc_particles_hash(live.particles) == before);
    assert_int_equal(ascc_live_marks(&live).body_count, 0);
    ascc_live_close(&live);
}

static void test_a_ball_that_fits_nowhere_is_refused(void **state)
{
    (void)state;
    ascc_live_options options = flat;
    options.ball = 10.0;
    ascc_live live = opened(&options);
    const uint64_t before = ascc_particles_hash(live.particles);
    assert_false(ascc_live_toggle_ball(&live));
    assert_string_equal(live.error, "no room for the ball");
    assert_true(!live.ball.there && ascc_particles_hash(live.particles) == before);
    ascc_live_close(&live);
}

static void test_colours_tell_speed_or_the_density_that_is_measured(void **state)
{
    (void)state;
    ascc_live live = opened(&flat);
    advance(&live, 5);
    ascc_measures m = {.size = sizeof m};
    double fastest = 0.0, densest = 0.0;
    assert_int_equal(ascc_particles_measure(live.particles, &m), ASCC_OK);
    for (size_t i = 0; i < live.count; i++)
        fastest = fmax(fastest, (double)live.value[i]);
    assert_true(ascc_live_toggle_density(&live));
    for (size_t i = 0; i < live.count; i++)
        densest = fmax(densest, (double)live.value[i]);
    assert_near(fastest, m.max_speed, 1e-5 * m.max_speed);
    assert_near(densest, m.max_density, 1e-4); /* from positions in float */
    assert_string_equal(ascc_live_marks(&live).unit, "of rest density");
    ascc_live_close(&live);
}

static void test_what_does_not_go_together_is_refused(void **state)
{
    (void)state;
    ascc_live live;
    ascc_live_options options = flat;
    options.model[1] = TINY_3D;
    assert_false(ascc_live_open(&live, &options));
    assert_non_null(strstr(live.error, "is a model in 3D, dam-break-2d a scene in 2D"));
    ascc_live_close(&live);
    options.models = 1;
    options.scene = "damn-break-2d";
    assert_false(ascc_live_open(&live, &options));
    assert_non_null(strstr(live.error, "did you mean 'dam-break-2d'?"));
    ascc_live_close(&live);
    options.scene = "dam-break-2d";
    live = opened(&options);
    assert_false(ascc_live_switch(&live));
    assert_false(ascc_live_back(&live));
    ascc_live_close(&live);
}

static void test_a_sequence_is_played_to_its_end_and_back(void **state)
{
    (void)state;
    char path[] = "/tmp/ascc-live-XXXXXX", error[256];
    ascc_sequence s;
    const int file = mkstemp(path);
    assert_true(file >= 0 && close(file) == 0);
    assert_true(ascc_scene_make("droplets", 2, 6, 0.05, &s, error, sizeof error));
    ascc_sequence_writer *writer = ascc_sequence_create(path, &s, true, error, sizeof error);
    for (int frame = 0; frame < 3; frame++) {
        s.position[0] = (float)frame;
        assert_true(ascc_sequence_append(writer, s.position, s.velocity, error, sizeof error));
    }
    assert_true(ascc_sequence_finish(writer, true, error, sizeof error));
    ascc_live live = opened(&(ascc_live_options){.scene = path, .threads = 1});
    advance(&live, 2);
    assert_near(live.position[0], 2.0, 0.0);
    assert_near(live.time, 2.0 * s.time_step, 1e-12);
    assert_false(ascc_live_advance(&live));
    assert_string_equal(live.error, "");
    assert_true(ascc_live_back(&live));
    assert_near(live.position[0], 1.0, 0.0);
    assert_true(ascc_live_restart(&live));
    assert_true(ascc_live_back(&live)); /* and no farther */
    assert_near(live.position[0], 0.0, 0.0);
    assert_false(ascc_live_toggle_ball(&live));
    ascc_live_close(&live);
    ascc_sequence_free(&s);
    (void)remove(path);
}

/* Turned any way, a point that is drawn by some pixels is seen there. */
static void test_what_is_drawn_with_the_mouse_follows_it(void **state)
{
    (void)state;
    ascc_view v = {.dimension = 3, .high = {2.0, 1.0, 0.5}, .zoom = 1.7, .turn = 2.1, .tilt = -0.8};
    const ascc_canvas canvas = {.width = 640, .height = 360};
    const double x[3] = {0.3, 0.9, 0.2}, pixels[2] = {37.0, -21.0};
    double shift[3], moved[3], from[2], to[2];
    ascc_view_shift(&v, &canvas, pixels, shift);
    for (int c = 0; c < 3; c++)
        moved[c] = x[c] + shift[c];
    (void)ascc_view_pixel(&v, &canvas, x, from);
    (void)ascc_view_pixel(&v, &canvas, moved, to);
    for (int c = 0; c < 2; c++)
        assert_near(to[c] - from[c], pixels[c], 1e-9);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_run_has_the_bits_of_its_steps),
        cmocka_unit_test(test_a_restart_runs_again_from_the_first_bit),
        cmocka_unit_test(test_another_model_goes_on_from_there),
        cmocka_unit_test(test_a_ball_pulled_through_water_pushes_it_aside),
        cmocka_unit_test(test_a_ball_stays_in_the_box),
        cmocka_unit_test(test_a_ball_taken_away_leaves_the_walls),
        cmocka_unit_test(test_a_ball_that_fits_nowhere_is_refused),
        cmocka_unit_test(test_colours_tell_speed_or_the_density_that_is_measured),
        cmocka_unit_test(test_what_does_not_go_together_is_refused),
        cmocka_unit_test(test_a_sequence_is_played_to_its_end_and_back),
        cmocka_unit_test(test_what_is_drawn_with_the_mouse_follows_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
