/* Walls that move during a step: where they go, what they take with them, and what is undone.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "model/model.h"
#include "points/particles.h"
#include "step/substeps.h"
#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05
#define SIDE 14 /* wall points along an edge */

typedef struct basin {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    size_t d, walls;
} basin;

static const double down[3] = {0.0, -9.81, 0.0};

/* A block of fluid a spacing above a floor, of a model's file. */
static basin open_basik_of(unsigned char *bytes, size_t size, int32_t threads)
{
    basin b = {0};
    const ascc_context_options context = {.size = sizeof context, .thread_count = threads};
    ascc_particles_options set = {.size = sizeof set};
    double x[64 * 3], w[SIDE * SIDE * 3] = {0}, normal[SIDE * SIDE * 3] = {0};
    dice r = {19};
    size_t n = 0;
    assert_int_equal(ascc_context_create(&context, &b.context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(b.context, bytes, size, &b.model), ASCC_OK);
    free(bytes);
    assert_int_equal(ascc_model_particles_options(b.model, 0.0, &set), ASCC_OK);
    assert_int_equal(ascc_particles_create(b.context, &set, &b.particles), ASCC_OK);
    b.d = (size_t)set.dimension;
    const int deep = b.d == 3 ? 4 : 1, wide = b.d == 3 ? SIDE : 1;
    for (int k = 0; k < deep; k++)
        for (int j = 0; j < 4; j++)
            for (int i = 0; i < 4; i++, n++) {
                const double at[3] = {i - 1.5, j + 1.0, k - 1.5};
                for (size_t c = 0; c < b.d; c++)
                    x[n * b.d + c] = (at[c] + dice_uniform(&r, -0.1, 0.1)) * set.spacing;
            }
    for (int k = 0; k < wide; k++)
        for (int i = 0; i < SIDE; i++, b.walls++) {
            w[b.walls * b.d] = 0.64 * set.spacing * (i - 0.5 * (SIDE - 1));
            if (b.d == 3)
                w[b.walls * b.d + 2] = 0.64 * set.spacing * (k - 0.5 * (SIDE - 1));
            normal[b.walls * b.d + 1] = 1.0;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = w, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(b.particles, n, &position, NULL, NULL, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(b.particles, b.walls, &wall, &normals, 0, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_step_create(b.context, b.model, NULL, &b.step), ASCC_OK);
    return b;
}

static basin open_basin(const model_random *random, int32_t threads)
{
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    return open_basik_of(bytes, size, threads);
}

static void close_basin(basin *b)
{
    ascc_step_destroy(&b->step);
    ascc_particles_destroy(&b->particles);
    ascc_model_destroy(&b->model);
    ascc_context_destroy(&b->context);
}

static model_random moments_with_walls(int32_t dimension)
{
    return (model_random){.seed = 4,
                          .dimension = dimension,
                          .channels = 8,
                          .spacing = SPACING,
                          .scale = 0.001,
                          .bumps = 3,
                          .order = 1,
                          .fluid_only = 1,
                          .walls = 1,
                          .contact = 0.5};
}

/* Sets the velocity of rows [first, first + count) of the walls. */
static void drive(basin *b, size_t first, size_t count, const double velocity[3])
{
    for (size_t i = first; i < first + count; i++) {
        const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_set(b->particles, ASCC_BOUNDARY, ASCC_VELOCITY, i, 1, &v),
                         ASCC_OK);
    }
}

static double *walls_of(const basin *b)
{
    double *x = malloc(b->walls * b->d * sizeof *x);
    const ascc_array to = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(
        ascc_particles_get(b->particles, ASCC_BOUNDARY, ASCC_POSITION, 0, b->walls, &to), ASCC_OK);
    return x;
}

/* ---- Where walls go ---- */

static void walls_go_on_with_their_velocity_through_steps_and_substeps(void **state)
{
    (void)state;
    const double velocity[3] = {0.3, -0.25, 0.125};
    for (int32_t dimension = 2; dimension <= 3; dimension++)
        for (int substeps = 1; substeps <= 4; substeps += 3) {
            const model_random random = moments_with_walls(dimension);
            basin b = open_basin(&random, 2);
            ascc_model_info info = {.size = sizeof info};
            assert_int_equal(ascc_model_get_info(b.model, &info), ASCC_OK);
            const ascc_step_options options = {.size = sizeof options,
                                               .time_step = info.time_step * substeps};
            ascc_step *step;
            assert_int_equal(ascc_step_create(b.context, b.model, &options, &step), ASCC_OK);
            drive(&b, 3, 5, velocity);
            double *want = walls_of(&b);
            assert_int_equal(ascc_step_run(step, b.particles, NULL, 3), ASCC_OK);
            double *got = walls_of(&b);
            for (size_t i = 0; i < b.walls; i++)
                for (size_t c = 0; c < b.d; c++) {
                    for (int n = 0; n < 3 * substeps && i >= 3 && i < 8; n++)
                        want[i * b.d + c] += info.time_step * velocity[c];
                    assert_true(got[i * b.d + c] == want[i * b.d + c]);
                }
            free(want);
            free(got);
            ascc_step_destroy(&step);
            close_basin(&b);
        }
}

static void walls_without_fluid_move_too(void **state)
{
    (void)state;
    const model_random random = moments_with_walls(2);
    basin b = open_basin(&random, 1);
    const double velocity[3] = {1.0, 0.0, 0.0};
    assert_int_equal(ascc_particles_clear(b.particles, ASCC_FLUID), ASCC_OK);
    drive(&b, 0, 1, velocity);
    const double x = b.particles->wall_position[0];
    assert_int_equal(ascc_step_run(b.step, b.particles, NULL, 1), ASCC_OK);
    assert_true(b.particles->wall_position[0] > x);
    close_basin(&b);
}

static void a_restored_run_with_moving_walls_goes_on_bit_for_bit(void **state)
{
    (void)state;
    const model_random random = moments_with_walls(3);
    basin b = open_basin(&random, 2);
    const ascc_forces forces = {.size = sizeof forces, .gravity = down};
    const double velocity[3] = {0.1, 0.4, 0.0};
    drive(&b, 0, b.walls, velocity);
    assert_int_equal(ascc_step_run(b.step, b.particles, &forces, 3), ASCC_OK);
    const size_t size = ascc_particles_snapshot_size(b.particles);
    void *memory = malloc(size);
    assert_int_equal(ascc_particles_snapshot(b.particles, memory, size), ASCC_OK);
    assert_int_equal(ascc_step_run(b.step, b.particles, &forces, 5), ASCC_OK);
    const uint64_t want = ascc_particles_hash(b.particles);
    assert_int_equal(ascc_particles_restore(b.particles, memory, size), ASCC_OK);
    assert_int_equal(ascc_step_run(b.step, b.particles, &forces, 5), ASCC_OK);
    assert_true(ascc_particles_hash(b.particles) == want);
    free(memory);
    close_basin(&b);
}

/* ---- Only relative motion counts ---- */

/* A shipped model that sees particles where they are in place of where they fly; or as it is. */
static unsigned char *shipped(const char *name, bool stays, size_t *size)
{
    char path[1024];
    snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    fseek(file, 0, SEEK_END);
    *size = (size_t)ftell(file);
    rewind(file);
    unsigned char *bytes = malloc(*size);
    assert_int_equal(fread(bytes, 1, *size, file), *size);
    fclose(file);
    for (size_t i = 0; stays && i + 12 < *size; i++) /* within JSON in JSON */
        if (memcmp(bytes + i, "\\\"advected\\\"", 12) == 0)
            memcpy(bytes + i, "\\\"current\\\" ", 12);
    return bytes;
}

/* Positions after some steps in which walls do (or do not) move with the frame, as seen from the frame; malloc. */
static double *seen_from_frame(const char *name, bool stays, const double frame[3], bool walls_too,
                               size_t *numbers)
{
    size_t size;
    unsigned char *bytes = shipped(name, stays, &size);
    basin b = open_basik_of(bytes, size, 2);
    const ascc_motion motion = {.time_step = b.model->plan.time_step,
                                .gravity = {0.0, -9.81, 0.0},
                                .advection = b.model->plan.advection};
    ascc_find_units(b.step, b.particles);
    const double spacing = b.model->plan.spacing;
    const size_t n = b.particles->fluid_count;
    const int steps = 4;
    double *x = malloc(n * b.d * sizeof *x);
    for (size_t i = 0; i < n; i++) {
        const double unit = spacing / b.model->plan.time_step;
        const double fall[3] = {frame[0] + 0.1 * unit, frame[1] - 0.5 * unit,
                                frame[2] - 0.05 * unit};
        const ascc_const_array v = {.data = fall, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_set(b.particles, ASCC_FLUID, ASCC_VELOCITY, i, 1, &v),
                         ASCC_OK);
    }
    if (walls_too)
        drive(&b, 0, b.walls, frame);
    for (int k_of = 0; k_of < steps; k_of++) { /* uncut, though the frame is fast */
        ascc_step_state state;
        if (ascc_step_once(b.step, b.particles, &motion, k_of == 0, &b.step->arena, &state) !=
            ASCC_OK)
            fail_msg("%s", ascc_step_message(b.step));
    }
    *numbers = n * b.d;
    for (size_t k = 0; k < *numbers; k++)
        x[k] = b.particles->position[k] - steps * b.model->plan.time_step * frame[k % b.d];
    close_basin(&b);
    return x;
}

static double farthest(const double *a, const double *b, size_t numbers)
{
    double most = 0.0;
    for (size_t k = 0; k < numbers; k++)
        most = fmax(most, fabs(a[k] - b[k]));
    return most;
}

/* A lattice stands still in the world: its network sees the same from a frame that moves on by a whole voxel of
 * the coarsest one a step. */
static void fluid_and_walls_in_a_moving_frame_do_as_they_do_at_rest(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        bool stays;
        double way[3]; /* of the frame in a step, spacings */
    } cases[] = {{"pbf2d", false, {0.7, 0.4, 0.0}},    {"pbf3d", false, {0.7, 0.4, -0.6}},
                 {"pbf3d", true, {0.7, 0.4, -0.6}},    {"water2d", false, {-8.0, 0.0, 0.0}},
                 {"water3d-tiny", false, {8.0, 0, 0}}, {"water3d", false, {16.0, 0.0, -16.0}}};
    const double rest[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const bool flat = strchr(cases[i].name, '2') != NULL;
        const double unit = flat ? 0.0125 / 0.005 : 0.05 / 0.02;
        double frame[3];
        size_t numbers;
        for (int c = 0; c < 3; c++)
            frame[c] = cases[i].way[c] * unit;
        double *want = seen_from_frame(cases[i].name, cases[i].stays, rest, true, &numbers);
        double *got = seen_from_frame(cases[i].name, cases[i].stays, frame, true, &numbers);
        double *alone = seen_from_frame(cases[i].name, cases[i].stays, frame, false, &numbers);
        const double off = farthest(want, got, numbers);
        print_message("# %s: off by %.1e spacings, %.2g if walls stay behind\n", cases[i].name, off,
                      farthest(want, alone, numbers));
        assert_true(off < 1e-4);
        assert_true(farthest(want, alone, numbers) > 0.01);
        free(want);
        free(got);
        free(alone);
    }
}

/* ---- Contact ---- */

/* The least that a particle over the floor's points is above it, in spacings. */
static double lowest(const basin *b)
{
    const double *wall = b->particles->wall_position, spacing = b->model->plan.spacing;
    const double reach = 0.64 * 0.5 * (SIDE - 1) * spacing;
    const size_t middle = b->d == 3 ? b->walls / 2 + SIDE / 2 : SIDE / 2;
    double least = INFINITY;
    for (size_t i = 0; i < b->particles->fluid_count; i++) {
        const double *x = b->particles->position + i * b->d;
        bool over = true;
        for (size_t c = 0; c < b->d; c += 2)
            over &= fabs(x[c] - wall[middle * b->d + c]) < reach;
        if (over)
            least = fmin(least, (x[1] - wall[1]) / spacing);
    }
    return least;
}

static void check_momentum(const basin *b)
{
    ascc_step_statistics s = {.size = sizeof s};
    int64_t body[3];
    assert_int_equal(ascc_step_get_statistics(b->step, &s), ASCC_OK);
    assert_int_equal(ascc_particles_body_impulse(b->particles, -1, NULL, body, NULL), ASCC_OK);
    for (size_t c = 0; c < b->d; c++) {
        assert_true(s.momentum_before[c] + s.external_impulse[c] - s.wall_impulse[c] ==
                    s.momentum_after[c]);
        assert_true(body[c] == s.wall_impulse[c]);
    }
}

/* Fluid at `fluid` spacings a step towards a floor at `wall` spacings a step: the hash when all have met. */
static uint64_t collide(const model_random *random, double fluid, double wall, int32_t threads)
{
    basin b = open_basin(random, threads);
    const ascc_plan *plan = &b.model->plan;
    const double unit = plan->spacing / plan->time_step;
    const double rises[3] = {0.0, wall * unit, 0.0};
    drive(&b, 0, b.walls, rises);
    for (size_t i = 0; i < b.particles->fluid_count; i++) {
        /* some far off, some askew */
        const double falls[3] = {(double)(i % 3) * 0.05 * fluid * unit, -fluid * unit, 0.0};
        const ascc_const_array v = {.data = falls, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_set(b.particles, ASCC_FLUID, ASCC_VELOCITY, i, 1, &v),
                         ASCC_OK);
        b.particles->position[i * b.d + 1] += (double)(i % 5) * 0.4 * fluid * plan->spacing;
    }
    const ascc_forces forces = {.size = sizeof forces, .gravity = down};
    for (int n = 0; n < 6; n++) {
        if (ascc_step_run(b.step, b.particles, &forces, 1) != ASCC_OK)
            fail_msg("%s", ascc_step_message(b.step));
        check_momentum(&b);
        assert_true(lowest(&b) > 0.5 - 1e-6);
    }
    const uint64_t hash = ascc_particles_hash(b.particles);
    close_basin(&b);
    return hash;
}

static void nothing_passes_a_wall_however_fast_it_or_the_fluid_is(void **state)
{
    (void)state;
    static const double speeds[][2] = {{0.0, 0.5},  {0.0, 3.0},  {2.0, -0.5}, {3.0, 0.0},
                                       {20.0, 0.0}, {20.0, 4.0}, {60.0, 0.0}};
    for (int32_t dimension = 2; dimension <= 3; dimension++)
        for (size_t i = 0; i < sizeof speeds / sizeof *speeds; i++) {
            model_random random = moments_with_walls(dimension);
            random.evaluate = i % 2 ? "advected" : "current";
            const uint64_t one = collide(&random, speeds[i][0], speeds[i][1], 1);
            assert_true(collide(&random, speeds[i][0], speeds[i][1], 3) == one);
        }
}

/* ---- What is refused, and undone ---- */

static void a_failing_substep_takes_walls_back(void **state)
{
    (void)state;
    const model_random random = moments_with_walls(3);
    basin b = open_basin(&random, 1);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(b.model, &info), ASCC_OK);
    const double dt = info.time_step, velocity[3] = {0.1, 0.0, 0.0};
    drive(&b, 0, b.walls, velocity);
    const ascc_forces forces = {.size = sizeof forces, .gravity = info.gravity};
    double way[4];
    ascc_measures m = {.size = sizeof m};
    basin other = open_basin(&random, 1);
    drive(&other, 0, other.walls, velocity);
    for (int n = 0; n < 4; n++) {
        assert_int_equal(ascc_step_run(other.step, other.particles, &forces, 1), ASCC_OK);
        assert_int_equal(ascc_particles_measure(other.particles, &m), ASCC_OK);
        way[n] = m.max_speed * dt;
    }
    close_basin(&other);
    assert_true(way[2] > 1.001 * fmax(way[0], way[1])); /* the third moves a particle too far */
    const ascc_step_options far = {.size = sizeof far,
                                   .time_step = 4.0 * dt,
                                   .max_displacement = 0.5 * (way[2] + fmax(way[0], way[1]))};
    ascc_step *step;
    assert_int_equal(ascc_step_create(b.context, b.model, &far, &step), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(b.particles);
    assert_int_equal(ascc_step_run(step, b.particles, &forces, 1), ASCC_ERROR_RANGE);
    assert_true(ascc_particles_hash(b.particles) == hash);
    ascc_step_destroy(&step);
    close_basin(&b);
}

static void a_wall_too_fast_is_named_and_nothing_moves(void **state)
{
    (void)state;
    for (int32_t threads = 1; threads <= 3; threads += 2) {
        const model_random random = moments_with_walls(3);
        basin b = open_basin(&random, threads);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(b.model, &info), ASCC_OK);
        const double velocity[3] = {0.0, 65.0 * SPACING / info.time_step, 0.0};
        drive(&b, 7, 9, velocity);
        const uint64_t hash = ascc_particles_hash(b.particles);
        assert_int_equal(ascc_step_run(b.step, b.particles, NULL, 1), ASCC_ERROR_RANGE);
        assert_non_null(strstr(ascc_step_message(b.step), "boundary row 7 would move"));
        assert_true(ascc_particles_hash(b.particles) == hash);
        const double beyond[3] = {0.0, 0.0, 0x1p39 * SPACING};
        drive(&b, 7, 9, down); /* no longer too fast */
        drive(&b, 9, 1, beyond);
        b.particles->wall_position[9 * 3 + 2] = 0x1.fffffffffp39 * SPACING;
        assert_int_equal(ascc_step_run(b.step, b.particles, NULL, 1), ASCC_ERROR_RANGE);
        assert_non_null(strstr(ascc_step_message(b.step), "boundary row 9"));
        close_basin(&b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(walls_go_on_with_their_velocity_through_steps_and_substeps),
        cmocka_unit_test(walls_without_fluid_move_too),
        cmocka_unit_test(a_restored_run_with_moving_walls_goes_on_bit_for_bit),
        cmocka_unit_test(fluid_and_walls_in_a_moving_frame_do_as_they_do_at_rest),
        cmocka_unit_test(nothing_passes_a_wall_however_fast_it_or_the_fluid_is),
        cmocka_unit_test(a_failing_substep_takes_walls_back),
        cmocka_unit_test(a_wall_too_fast_is_named_and_nothing_moves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
