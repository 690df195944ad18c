/* Random small scenes with every shipped network: sparse, dense, coincident, on walls, absurdly fast. Each step is
 * done with finite results and exact momentum, or refused by name with nothing changed; and once more the same
 * with other numbers of threads. SPDX-License-Identifier: MIT
 *
 * A failure prints its seed; ASCC_TEST_SEED=N runs that scene alone.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/random.h"
#include "support/test.h"

#if defined(__SANITIZE_ADDRESS__)
#define SCENES 40 /* for each network */
#else
#define SCENES 200
#endif

enum { NETWORKS = 5, MOST = 120, WALLS = 160, STEPS = 3 };

static const char *const names[NETWORKS] = {"water2d", "water2d-tiny", "water3d", "water3d-tiny",
                                            "paper3d"};

typedef struct shipped {
    ascc_context *one, *three; /* of so many threads */
    ascc_model *model[NETWORKS];
} shipped;

typedef struct scene {
    test_random random;
    uint64_t seed;
    ascc_model_info info;
    ascc_particles *particles[2];
    ascc_step *step[2];
    double gravity[3];
} scene;

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition))                                                                          \
            fail_msg("network %s, seed %" PRIu64 ": does not hold: %s; last message '%s'",         \
                     s->info.name, s->seed, #condition, ascc_step_message(s->step[0]));            \
    } while (0)

static double between(scene *s, double low, double high)
{
    return test_random_between(&s->random, low, high);
}

/* Evenly in the exponent. */
static double of_any_size(scene *s, double low, double high)
{
    return exp(between(s, log(low), log(high)));
}

static bool once_in(scene *s, uint64_t times)
{
    return test_random_below(&s->random, times) == 0;
}

/* ---- A scene ---- */

typedef struct points {
    size_t count;
    double x[WALLS][3], v[WALLS][3];
} points;

/* Particles at `density` times rest in a cube, some of them at one place, some far out, some on the floor. */
static void scatter(scene *s, points *p)
{
    const double h = s->info.particle_spacing;
    const double density = once_in(s, 2) ? between(s, 0.9, 1.1) : of_any_size(s, 0.02, 20.0);
    const int d = s->info.dimension;
    p->count = 1 + (size_t)test_random_below(&s->random, MOST);
    const double side = pow((double)p->count / density, 1.0 / d) * h;
    const double speed = once_in(s, 4) ? of_any_size(s, 1.0, 1e12) : between(s, 0.0, 2.0);
    const bool coincident = once_in(s, 4), floored = once_in(s, 4), far = once_in(s, 6);
    for (size_t i = 0; i < p->count; i++)
        for (int c = 0; c < 3; c++) {
            p->x[i][c] = between(s, 0.0, side);
            p->v[i][c] = between(s, -speed, speed);
            if (coincident && i % 3 == 1)
                p->x[i][c] = p->x[i - 1][c];
            if (floored && i % 4 == 0 && c == 1)
                p->x[i][c] = 0.0;
            if (far && i == 0)
                p->x[i][c] = of_any_size(s, h, 1e15 * h);
        }
}

/* A floor and a side, of some pitch, in one layer or two at one place with opposite normals. */
static void wall_in(scene *s, points *p)
{
    const double h = s->info.particle_spacing, pitch = of_any_size(s, 0.2, 3.0) * h;
    const bool doubled = once_in(s, 5);
    const int d = s->info.dimension, row = d == 2 ? WALLS / 2 : 8;
    p->count = once_in(s, 4) ? 0 : (size_t)test_random_below(&s->random, WALLS);
    for (size_t i = 0; i < p->count; i++) {
        const int k = (int)i / 2, axis = 1 - (int)i % 2;
        const double along[3] = {(k % row - 2) * pitch, (k % row - 2) * pitch,
                                 d == 2 ? 0.0 : (k / row - 2) * pitch};
        for (int c = 0; c < 3; c++) {
            p->x[i][c] = c == axis ? 0.0 : along[c];
            p->v[i][c] = c != axis ? 0.0 : doubled && k % 2 ? -1.0 : 1.0;
        }
    }
}

static void open_scene(scene *s, const shipped *all, int network, uint64_t seed)
{
    static points fluid, walls;
    memset(s, 0, sizeof *s);
    s->seed = seed;
    s->random.state = seed * NETWORKS + (uint64_t)network;
    (void)test_random_bits(&s->random);
    s->info.size = sizeof s->info;
    CHECK(ascc_model_get_info(all->model[network], &s->info) == ASCC_OK);
    const double h = s->info.particle_spacing;
    scatter(s, &fluid);
    wall_in(s, &walls);
    const bool still = once_in(s, 4);
    for (int c = 0; c < 3; c++)
        s->gravity[c] = still ? 0.0 : between(s, -1.0, 1.0) * of_any_size(s, 0.1, 1e3);
    const ascc_const_array x = {.data = fluid.x, .stride = sizeof *fluid.x, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = fluid.v, .stride = sizeof *fluid.v, .scalar = ASCC_DOUBLE};
    const ascc_const_array w = {.data = walls.x, .stride = sizeof *walls.x, .scalar = ASCC_DOUBLE};
    const ascc_const_array n = {.data = walls.v, .stride = sizeof *walls.v, .scalar = ASCC_DOUBLE};
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = s->info.dimension,
                                            .spacing = h,
                                            .mass =
                                                s->info.rest_density * pow(h, s->info.dimension)};
    const double time_step = s->info.time_step * of_any_size(s, 0.1, 3.0);
    const ascc_step_options step = {
        .size = sizeof step,
        .time_step = once_in(s, 3) ? fmax(time_step, s->info.time_step_min) : 0.0};
    for (int twin = 0; twin < 2; twin++) {
        ascc_context *context = twin ? all->three : all->one;
        CHECK(ascc_particles_create(context, &options, &s->particles[twin]) == ASCC_OK);
        CHECK(ascc_step_create(context, all->model[network], &step, &s->step[twin]) == ASCC_OK);
        const ascc_status status =
            ascc_particles_add_fluid(s->particles[twin], fluid.count, &x, &v, NULL, NULL);
        CHECK(status == ASCC_OK || status == ASCC_ERROR_RANGE);
        CHECK(ascc_particles_add_boundary(s->particles[twin], walls.count, &w, &n, 1, NULL) ==
              ASCC_OK);
    }
}

static void close_scene(scene *s)
{
    for (int twin = 0; twin < 2; twin++) {
        ascc_step_destroy(&s->step[twin]);
        ascc_particles_destroy(&s->particles[twin]);
    }
}

/* ---- What must hold ---- */

static void check_finite(scene *s)
{
    const size_t count = ascc_particles_count(s->particles[0], ASCC_FLUID);
    for (size_t i = 0; i < count; i++) {
        double x[3] = {0}, v[3] = {0};
        const ascc_array position = {.data = x, .scalar = ASCC_DOUBLE};
        const ascc_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
        CHECK(ascc_particles_get(s->particles[0], ASCC_FLUID, ASCC_POSITION, i, 1, &position) ==
              ASCC_OK);
        CHECK(ascc_particles_get(s->particles[0], ASCC_FLUID, ASCC_VELOCITY, i, 1, &velocity) ==
              ASCC_OK);
        for (int c = 0; c < 3; c++)
            CHECK(isfinite(x[c]) && isfinite(v[c]));
    }
}

/* False when the step is refused. */
static bool run_step(scene *s)
{
    const ascc_forces forces = {.size = sizeof forces, .gravity = s->gravity};
    const uint64_t before = ascc_particles_hash(s->particles[0]);
    const ascc_status status = ascc_step_run(s->step[0], s->particles[0], &forces, 1);
    CHECK(ascc_step_run(s->step[1], s->particles[1], &forces, 1) == status);
    CHECK(ascc_particles_hash(s->particles[0]) == ascc_particles_hash(s->particles[1]));
    check_finite(s);
    if (status != ASCC_OK) {
        CHECK(status == ASCC_ERROR_RANGE || status == ASCC_ERROR_NOT_FINITE ||
              status == ASCC_ERROR_LIMIT);
        CHECK(strcmp(ascc_step_message(s->step[0]), ascc_step_message(s->step[1])) == 0);
        CHECK(ascc_step_message(s->step[0])[0] != '\0');
        CHECK(ascc_particles_hash(s->particles[0]) == before);
        return false;
    }
    ascc_step_statistics t = {.size = sizeof t};
    CHECK(ascc_step_get_statistics(s->step[0], &t) == ASCC_OK);
    for (int c = 0; c < 3; c++)
        CHECK(t.momentum_before[c] + t.external_impulse[c] - t.wall_impulse[c] ==
              t.momentum_after[c]);
    return true;
}

/* Steps that were done. */
static int run_scene(const shipped *all, int network, uint64_t seed)
{
    static scene one;
    scene *s = &one;
    int done = 0;
    open_scene(s, all, network, seed);
    while (done < STEPS && run_step(s))
        done++;
    close_scene(s);
    return done;
}

static void open_shipped(shipped *all)
{
    const ascc_context_options one = {.size = sizeof one, .thread_count = 1};
    const ascc_context_options three = {.size = sizeof three, .thread_count = 3};
    assert_int_equal(ascc_context_create(&one, &all->one), ASCC_OK);
    assert_int_equal(ascc_context_create(&three, &all->three), ASCC_OK);
    for (int i = 0; i < NETWORKS; i++) {
        char path[1024];
        (void)snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", names[i]);
        assert_int_equal(ascc_model_load(all->one, path, &all->model[i]), ASCC_OK);
    }
}

static void close_shipped(shipped *all)
{
    for (int i = 0; i < NETWORKS; i++)
        ascc_model_destroy(&all->model[i]);
    ascc_context_destroy(&all->one);
    ascc_context_destroy(&all->three);
}

static void random_scenes_step_or_are_refused_by_name(void **state)
{
    (void)state;
    shipped all = {0};
    const char *alone = getenv("ASCC_TEST_SEED"), *more = getenv("ASCC_TEST_LONG");
    const uint64_t first = alone ? strtoull(alone, NULL, 10) : 1;
    const uint64_t count = alone ? 1 : more && *more ? 10 * SCENES : SCENES;
    open_shipped(&all);
    for (int network = 0; network < NETWORKS; network++) {
        int done = 0;
        const uint64_t scenes = network == NETWORKS - 1 ? (count + 7) / 8 : count; /* is slow */
        for (uint64_t seed = first; seed < first + scenes; seed++)
            done += run_scene(&all, network, seed);
        print_message("%s: seeds %" PRIu64 " to %" PRIu64 ", %d steps done, others refused\n",
                      names[network], first, first + scenes - 1, done);
        assert_true(alone || done > (int)scenes);
    }
    close_shipped(&all);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_scenes_step_or_are_refused_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
