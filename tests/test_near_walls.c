/* Walls that no fluid can see cost nothing and change nothing. SPDX-License-Identifier: MIT */
#include <math.h>

#include "step/step.h"
#include "support/model_builder.h"
#include "support/tools.h"

static const double spacing = 0.05;

static ascc_context *open_context(void)
{
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    return context;
}

/* Fluid on a floor, and if far: three times as many points of walls on all sides, none near. */
static ascc_particles *make_scene(ascc_context *context, const ascc_model *model, bool far)
{
    static double x[4000][3], floor[900][3], up[900][3], out[3000][3], in[3000][3];
    ascc_particles_options options = {.size = sizeof options};
    assert_int_equal(ascc_model_particles_options(model, 1.0, &options), ASCC_OK);
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    size_t n = 0, walls = 0, outside = 0;
    for (int i = 0; i < 8; i++)
        for (int j = 0; j < 6; j++)
            for (int k = 0; k < 8; k++, n++)
                for (int c = 0; c < 3; c++)
                    x[n][c] = spacing * ((c == 0 ? i : c == 1 ? j : k) + 1.1);
    for (int i = 0; i < 20; i++)
        for (int j = 0; j < 20; j++, walls++) {
            floor[walls][0] = 0.03 * i - 0.05;
            floor[walls][2] = 0.03 * j - 0.05;
            up[walls][1] = 1.0;
        }
    for (int i = 0; i < 1200; i++, outside++) {
        const double angle = 2.39996 * i, height = 0.004 * i;
        out[outside][0] = 4.0 * cos(angle);
        out[outside][1] = height;
        out[outside][2] = 4.0 * sin(angle);
        in[outside][0] = -cos(angle);
        in[outside][2] = -sin(angle);
    }
    const ascc_const_array fluid = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array a = {.data = floor, .scalar = ASCC_DOUBLE};
    const ascc_const_array b = {.data = up, .scalar = ASCC_DOUBLE};
    const ascc_const_array c = {.data = out, .scalar = ASCC_DOUBLE};
    const ascc_const_array d = {.data = in, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(p, n, &fluid, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, walls, &a, &b, 0, NULL), ASCC_OK);
    if (far)
        assert_int_equal(ascc_particles_add_boundary(p, outside, &c, &d, 1, NULL), ASCC_OK);
    return p;
}

static void a_network_sees_only_walls_near_fluid(void **state)
{
    (void)state;
    static const char *const names[] = {"water3d", "water3d-large", "pbf3d"};
    for (size_t m = 0; m < sizeof names / sizeof *names; m++) {
        ascc_context *context = open_context();
        ascc_model *model;
        char path[1024];
        (void)snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", names[m]);
        assert_int_equal(ascc_model_load(context, path, &model), ASCC_OK);
        ascc_particles *sets[2];
        ascc_step_statistics s[2];
        bool all = false; /* are seen: their own values reach farther than lists do */
        for (int far = 0; far < 2; far++) {
            ascc_step *step;
            sets[far] = make_scene(context, model, far);
            assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
            assert_int_equal(ascc_step_run(step, sets[far], NULL, 3), ASCC_OK);
            s[far].size = sizeof s[far];
            all = isinf(step->network.wall_reach);
            assert_int_equal(ascc_step_get_statistics(step, &s[far]), ASCC_OK);
            ascc_step_destroy(&step);
        }
        const size_t numbers = sets[0]->fluid_count * 3;
        assert_memory_equal(sets[0]->position, sets[1]->position, numbers * sizeof(double));
        assert_memory_equal(sets[0]->momentum, sets[1]->momentum, numbers * sizeof(int64_t));
        assert_memory_equal(s[0].wall_impulse, s[1].wall_impulse, sizeof s[0].wall_impulse);
        assert_true(s[0].wall_impulse[1] != 0);
        assert_true(s[0].level_points[0] == s[1].level_points[0] || all);
        assert_true(!all || m == 1);
        ascc_particles_destroy(&sets[0]);
        ascc_particles_destroy(&sets[1]);
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
    }
}

/* Points at random: all within reach of fluid are marked, none that is farther than two reaches on an axis. */
static void what_is_within_reach_is_near(void **state)
{
    (void)state;
    dice d = {17};
    for (int32_t dimension = 2; dimension <= 3; dimension++) {
        test_tools t;
        tools_open(&t, 1, 0);
        static double x[200][3], w[2000][3];
        ascc_particles p = {.dimension = dimension, .fluid_count = 200, .boundary_count = 2000};
        double *fluid = &x[0][0], *walls = &w[0][0];
        for (int i = 0; i < 200 * dimension; i++)
            fluid[i] = dice_uniform(&d, -3.0, 3.0);
        for (int i = 0; i < 2000 * dimension; i++)
            walls[i] = dice_uniform(&d, -5.0, 5.0);
        p.wall_position = walls;
        static double resting[600];
        const ascc_plan plan = {.spacing = 0.025}; /* and so a margin of 0.1 */
        const ascc_network network = {.wall_reach = 0.2, .plan = &plan};
        const ascc_motion motion = {.time_step = 0.02};
        ascc_step_state s = {.network = &network,
                             .particles = &p,
                             .motion = &motion,
                             .length_unit = 1.0,
                             .tools = t.search,
                             .advance = {.seen = fluid, .velocity = resting}};
        uint8_t *near = NULL;
        size_t marked = 0;
        assert_true(ascc_near_walls(&s, &near));
        assert_non_null(near);
        for (int32_t i = 0; i < 2000; i++) {
            double closest = INFINITY;
            for (int32_t j = 0; j < 200; j++) {
                double apart = 0.0;
                for (int32_t c = 0; c < dimension; c++)
                    apart = fmax(apart, fabs(walls[i * dimension + c] - fluid[j * dimension + c]));
                closest = fmin(closest, apart);
            }
            assert_true(near[i] || closest > 0.3);
            assert_true(!near[i] || closest < 0.3 * 2.01);
            marked += near[i];
        }
        assert_true(marked > 50 && marked < 1950);
        /* What goes far may meet any wall, and walls that move any fluid. */
        near = NULL;
        resting[7] = -5.5;
        assert_true(ascc_near_walls(&s, &near));
        assert_null(near);
        resting[7] = 0.0;
        s.advance.walls_move = true;
        assert_true(ascc_near_walls(&s, &near));
        assert_null(near);
        tools_close(&t);
    }
}

/* Networks in which walls tell one another reach farther than a list does. */
static void walls_with_values_of_their_own_are_all_seen(void **state)
{
    (void)state;
    ascc_context *context = open_context();
    const model_random r = {.seed = 3, .dimension = 3, .scale = 1e-5};
    size_t size;
    unsigned char *bytes = model_builder_random(&r, &size);
    ascc_model *model;
    ascc_step *step;
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_true(isinf(step->network.wall_reach));
    free(bytes);
    ascc_step_destroy(&step);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_network_sees_only_walls_near_fluid),
        cmocka_unit_test(what_is_within_reach_is_near),
        cmocka_unit_test(walls_with_values_of_their_own_are_all_seen),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
