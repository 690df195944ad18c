/* Gravity along any axis: a scene and the same scene turned are one to the bit. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "points/particles.h"
#include "step/turn.h"
#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05
#define FLUID 64
#define WALLS 100
#define STEPS 12

/* Every turn of a model whose gravity is along -y. */
static const ascc_turn turns[] = {{0, 1, false}, {0, 1, true},  {1, 1, false},
                                  {1, 1, true},  {2, 1, false}, {2, 1, true}};

typedef struct scene {
    size_t fluid, walls;
    double position[FLUID * 3], velocity[FLUID * 3], push[FLUID * 3], wall[WALLS * 3],
        normal[WALLS * 3];
    double wall_velocity[3], gravity[3];
} scene;

/* A block that moves, over a floor that does, pushed besides. */
static scene make_scene(size_t d)
{
    scene s = {.fluid = d == 2 ? 16 : FLUID,
               .walls = d == 2 ? 10 : WALLS,
               .gravity = {1.5, -9.81, 0.5},
               .wall_velocity = {0.1, 0.05, -0.05}};
    dice r = {5};
    for (size_t i = 0; i < s.fluid; i++) {
        const double at[3] = {(double)(i % 4), (double)(i / 4 % 4), (double)(i / 16)};
        for (size_t c = 0; c < d; c++) {
            s.position[i * d + c] = (at[c] + dice_uniform(&r, -0.1, 0.1)) * SPACING;
            s.velocity[i * d + c] = dice_uniform(&r, -0.5, 0.5);
            s.push[i * d + c] = dice_uniform(&r, -2.0, 2.0);
        }
    }
    for (size_t i = 0; i < s.walls; i++) {
        const double at[3] = {(double)(i % 10) - 3.0, -0.7, (double)(i / 10) - 3.0};
        for (size_t c = 0; c < d; c++) {
            s.wall[i * d + c] = at[c] * SPACING;
            s.normal[i * d + c] = c == 1 ? 1.0 : 0.0;
        }
    }
    return s;
}

/* The scene as a host has it whose step turns like this. */
static scene turned(const scene *from, const ascc_turn *turn, int32_t d)
{
    scene s = *from;
    ascc_turn_reals(turn, true, s.position, s.fluid, d);
    ascc_turn_reals(turn, true, s.velocity, s.fluid, d);
    ascc_turn_reals(turn, true, s.push, s.fluid, d);
    ascc_turn_reals(turn, true, s.wall, s.walls, d);
    ascc_turn_reals(turn, true, s.normal, s.walls, d);
    ascc_turn_reals(turn, true, s.wall_velocity, 1, d);
    ascc_turn_reals(turn, true, s.gravity, 1, d);
    return s;
}

static ascc_particles *fill(ascc_context *context, const scene *s, int32_t dimension)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = SPACING, .mass = 0.125};
    const ascc_const_array position = {.data = s->position, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = s->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = s->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = s->normal, .scalar = ASCC_DOUBLE};
    const ascc_const_array moving = {.data = s->wall_velocity, .scalar = ASCC_DOUBLE};
    ascc_particles *p = NULL;
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, s->fluid, &position, &velocity, NULL, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, s->walls, &wall, &normal, 3, NULL), ASCC_OK);
    for (size_t i = 0; i < s->walls; i++)
        assert_int_equal(ascc_particles_set(p, ASCC_BOUNDARY, ASCC_VELOCITY, i, 1, &moving),
                         ASCC_OK);
    return p;
}

typedef struct outcome {
    ascc_particles *particles;
    int64_t impulse[3], external[3];
} outcome;

static ascc_model *random_model(ascc_context *context, int32_t dimension)
{
    const model_random random = {
        .seed = 7,
        .dimension = dimension,
        .channels = 8,
        .spacing = SPACING,
        .scale = 0.001,
        .moments = 2,
        .lattice = 1,
        .levels = 3,
        .transfer = 1,
        .method = "voxel_corners",
        .no_hysteresis = 1,
        .bumps = 3,
        .order = 1,
        .fluid_only = 1,
        .motion = 3,
        .walls = 1,
        .area = 1,
        .contact = 0.4,
        .evaluate = "advected",
        .relaxation = dimension == 2 ? "{\"support\":0.1,\"rest_volume\":0.002,\"omega\":[0.5],"
                                       "\"epsilon\":0.1,\"limit\":0.0075}"
                                     : "{\"support\":0.1,\"rest_volume\":0.0001,\"omega\":[0.5],"
                                       "\"epsilon\":0.1,\"limit\":0.0075}"};
    ascc_model *model = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(&random, &size);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    free(bytes);
    return model;
}

static outcome run(ascc_context *context, const ascc_model *model, const scene *s,
                   int32_t dimension)
{
    outcome o = {.particles = fill(context, s, dimension)};
    const ascc_const_array push = {.data = s->push, .scalar = ASCC_DOUBLE};
    const ascc_forces forces = {
        .size = sizeof forces, .gravity = s->gravity, .acceleration = &push};
    ascc_step_statistics statistics = {.size = sizeof statistics};
    ascc_step *step = NULL;
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    if (ascc_step_run(step, o.particles, &forces, STEPS) != ASCC_OK)
        fail_msg("%s", ascc_step_message(step));
    assert_int_equal(ascc_step_get_statistics(step, &statistics), ASCC_OK);
    memcpy(o.external, statistics.external_impulse, sizeof o.external);
    assert_int_equal(ascc_particles_body_impulse(o.particles, 3, NULL, o.impulse, NULL), ASCC_OK);
    ascc_step_destroy(&step);
    return o;
}

static void a_scene_and_the_same_scene_turned_are_one_to_the_bit(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        ascc_context *context = NULL;
        assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
        ascc_model *model = random_model(context, d);
        const scene given = make_scene((size_t)d);
        outcome first = run(context, model, &given, d);
        int tried = 0;
        for (size_t t = 0; t < sizeof turns / sizeof *turns; t++) {
            if (turns[t].shift >= d)
                continue;
            const scene other = turned(&given, &turns[t], d);
            outcome o = run(context, model, &other, d);
            ascc_turn_particles(&turns[t], false, o.particles);
            ascc_turn_integers(&turns[t], false, o.impulse, 1, d);
            ascc_turn_integers(&turns[t], false, o.external, 1, d);
            assert_true(ascc_particles_hash(o.particles) == ascc_particles_hash(first.particles));
            assert_memory_equal(o.impulse, first.impulse, sizeof o.impulse);
            assert_memory_equal(o.external, first.external, sizeof o.external);
            ascc_particles_destroy(&o.particles);
            tried++;
        }
        assert_int_equal(tried, 2 * d);
        assert_true(first.impulse[1] != 0);
        ascc_particles_destroy(&first.particles);
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
    }
}

static void a_turned_step_that_fails_leaves_the_particles_as_they_were(void **state)
{
    (void)state;
    ascc_context *context = NULL;
    ascc_step *step = NULL;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    ascc_model *model = random_model(context, 3);
    scene s = make_scene(3);
    s.velocity[4] = 1e6; /* farther in a step than a particle may go */
    ascc_particles *p = fill(context, &s, 3);
    const double up[3] = {0.3, 0.2, 9.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = up};
    const size_t size = ascc_particles_snapshot_size(p);
    unsigned char *before = malloc(size), *after = malloc(size);
    assert_int_equal(ascc_particles_snapshot(p, before, size), ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, p, &forces, 1), ASCC_ERROR_RANGE);
    assert_int_equal(ascc_particles_snapshot(p, after, size), ASCC_OK);
    assert_memory_equal(before, after, size);
    free(before);
    free(after);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

/* What is between axes is turned to the nearer one; a model without a way down is never turned. */
static void steps_turn_where_gravity_is_nearer_to_another_axis(void **state)
{
    (void)state;
    ascc_plan plan = {.dimension = 3, .gravity = {0.0, -9.81, 0.0}};
    const struct {
        double gravity[3];
        ascc_turn turn;
    } cases[] = {{{0.0, -9.81, 0.0}, {0, 1, false}}, {{-6.0, -7.0, 2.0}, {0, 1, false}},
                 {{0.0, 3.0, 0.0}, {0, 1, true}},    {{-8.0, -7.0, 2.0}, {2, 1, false}},
                 {{8.0, -7.0, 2.0}, {2, 1, true}},   {{0.0, 0.0, -1.0}, {1, 1, false}},
                 {{0.0, 0.0, 0.0}, {0, 0, false}}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const ascc_turn turn = ascc_turn_find(&plan, cases[i].gravity);
        double g[3];
        memcpy(g, cases[i].gravity, sizeof g);
        assert_int_equal(turn.shift, cases[i].turn.shift);
        assert_int_equal(turn.flip, cases[i].turn.flip);
        ascc_turn_reals(&turn, false, g, 1, 3);
        assert_true(g[1] <= -fabs(g[0]) && g[1] <= -fabs(g[2]));
        ascc_turn_reals(&turn, true, g, 1, 3);
        assert_memory_equal(g, cases[i].gravity, sizeof g);
    }
    const double across[3] = {5.0, 1.0, 0.0};
    plan.gravity[0] = 0.1;
    assert_false(ascc_turns(&(ascc_turn){0}) || ascc_turn_find(&plan, across).shift);
    memset(plan.gravity, 0, sizeof plan.gravity);
    assert_int_equal(ascc_turn_find(&plan, across).shift, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scene_and_the_same_scene_turned_are_one_to_the_bit),
        cmocka_unit_test(a_turned_step_that_fails_leaves_the_particles_as_they_were),
        cmocka_unit_test(steps_turn_where_gravity_is_nearer_to_another_axis),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
