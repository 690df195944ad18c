/* Walls that move during a step: where they go, what they take with them, and what is undone.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/particles.h"
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

/* A block of fluid a spacing above a floor. options: of the step, or NULL. */
static basin open_basin(const model_random *random, int32_t threads,
                        const ascc_step_options *options)
{
    basin b = {.d = (size_t)random->dimension};
    const ascc_context_options context = {.size = sizeof context, .thread_count = threads};
    const ascc_particles_options set = {.size = sizeof set,
                                        .dimension = random->dimension,
                                        .spacing = random->spacing,
                                        .mass = 0.125};
    const int deep = random->dimension == 3 ? 4 : 1, wide = random->dimension == 3 ? SIDE : 1;
    double x[64 * 3], w[SIDE * SIDE * 3] = {0}, normal[SIDE * SIDE * 3] = {0};
    dice r = {19};
    size_t size, n = 0;
    unsigned char *bytes = model_builder_random(random, &size);
    assert_int_equal(ascc_context_create(&context, &b.context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(b.context, bytes, size, &b.model), ASCC_OK);
    free(bytes);
    assert_int_equal(ascc_particles_create(b.context, &set, &b.particles), ASCC_OK);
    for (int k = 0; k < deep; k++)
        for (int j = 0; j < 4; j++)
            for (int i = 0; i < 4; i++, n++) {
                const double at[3] = {i - 1.5, j + 1.0, k - 1.5};
                for (size_t c = 0; c < b.d; c++)
                    x[n * b.d + c] = (at[c] + dice_uniform(&r, -0.1, 0.1)) * SPACING;
            }
    for (int k = 0; k < wide; k++)
        for (int i = 0; i < SIDE; i++, b.walls++) {
            w[b.walls * b.d] = 0.64 * SPACING * (i - 0.5 * (SIDE - 1));
            if (b.d == 3)
                w[b.walls * b.d + 2] = 0.64 * SPACING * (k - 0.5 * (SIDE - 1));
            normal[b.walls * b.d + 1] = 1.0;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = w, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(b.particles, n, &position, NULL, NULL, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(b.particles, b.walls, &wall, &normals, 0, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_step_create(b.context, b.model, options, &b.step), ASCC_OK);
    return b;
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
            basin b = open_basin(&random, 2, NULL);
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
    basin b = open_basin(&random, 1, NULL);
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
    basin b = open_basin(&random, 2, NULL);
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

/* ---- What is refused, and undone ---- */

static void a_failing_substep_takes_walls_back(void **state)
{
    (void)state;
    const model_random random = moments_with_walls(3);
    basin b = open_basin(&random, 1, NULL);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(b.model, &info), ASCC_OK);
    const double dt = info.time_step, velocity[3] = {0.1, 0.0, 0.0};
    drive(&b, 0, b.walls, velocity);
    const ascc_forces forces = {.size = sizeof forces, .gravity = info.gravity};
    double way[4];
    ascc_measures m = {.size = sizeof m};
    basin other = open_basin(&random, 1, NULL);
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
        basin b = open_basin(&random, threads, NULL);
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
        cmocka_unit_test(a_failing_substep_takes_walls_back),
        cmocka_unit_test(a_wall_too_fast_is_named_and_nothing_moves),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
