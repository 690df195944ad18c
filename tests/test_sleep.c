/* Fluid at rest stops, wakes, and gives every quantum that it receives to its support.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/rest.h"
#include "step/step.h"
#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

static const double spacing = 0.05;

typedef struct world {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
} world;

/* A tank without a lid and what stands in it, particles along each axis; mirrored: rows in reverse order. */
typedef struct pool {
    int cells[3];
    bool mirrored;
    int32_t threads;
    double sleep_speed;
    unsigned char *model; /* bytes of a network, which free() takes; NULL = water3d */
    size_t model_size;
} pool;

enum { WALLS_FINER = 3, MOST = 20000 };

static void add_walls(ascc_particles *p, const int cells[3])
{
    static double x[MOST][3], normal[MOST][3];
    const double size[3] = {(cells[0] + 1) * spacing, (cells[1] + 10) * spacing,
                            (cells[2] + 1) * spacing};
    size_t n = 0;
    for (int axis = 0; axis < 3; axis++)
        for (int side = 0; side < (axis == 1 ? 1 : 2); side++) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            const int nu = (int)(size[u] / spacing * WALLS_FINER / 2),
                      nv = (int)(size[v] / spacing * WALLS_FINER / 2);
            for (int i = 0; i <= nu; i++)
                for (int j = 0; j <= nv; j++, n++) {
                    assert_true(n < MOST);
                    memset(normal[n], 0, sizeof normal[n]);
                    normal[n][axis] = side ? -1.0 : 1.0;
                    x[n][axis] = side ? size[axis] : 0.0;
                    x[n][u] = size[u] * i / nu;
                    x[n][v] = size[v] * j / nv;
                }
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_boundary(p, n, &position, &normals, 3, NULL), ASCC_OK);
}

static void add_block(ascc_particles *p, const int cells[3], const double low[3], bool mirrored)
{
    static double x[MOST][3];
    size_t n = 0;
    for (int i = 0; i < cells[0]; i++)
        for (int j = 0; j < cells[1]; j++)
            for (int k = 0; k < cells[2]; k++, n++) {
                const int at[3] = {i, j, k};
                assert_true(n < MOST);
                for (int c = 0; c < 3; c++)
                    x[n][c] = low[c] + spacing * at[c];
            }
    const ascc_const_array position = {.data = mirrored ? x[n - 1] : x[0],
                                       .stride = (mirrored ? -1 : 1) * (ptrdiff_t)sizeof x[0],
                                       .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(p, n, &position, NULL, NULL, NULL), ASCC_OK);
}

static world open_pool(const pool *o)
{
    world w = {0};
    const ascc_context_options context = {.size = sizeof context, .thread_count = o->threads};
    assert_int_equal(ascc_context_create(&context, &w.context), ASCC_OK);
    if (o->model)
        assert_int_equal(ascc_model_load_memory(w.context, o->model, o->model_size, &w.model),
                         ASCC_OK);
    else
        assert_int_equal(ascc_model_load(w.context,
                                         SOURCE_ROOT "/examples/models/water3d.safetensors",
                                         &w.model),
                         ASCC_OK);
    ascc_particles_options options = {.size = sizeof options};
    assert_int_equal(ascc_model_particles_options(w.model, 1.0, &options), ASCC_OK);
    assert_int_equal(ascc_particles_create(w.context, &options, &w.particles), ASCC_OK);
    add_block(w.particles, o->cells, (const double[]){spacing, spacing, spacing}, o->mirrored);
    add_walls(w.particles, o->cells);
    const ascc_step_options step = {.size = sizeof step, .sleep_speed = o->sleep_speed};
    assert_int_equal(ascc_step_create(w.context, w.model, &step, &w.step), ASCC_OK);
    return w;
}

static void close_pool(world *w)
{
    ascc_context_destroy(&w->context);
    ascc_model_destroy(&w->model);
    ascc_step_destroy(&w->step);
    ascc_particles_destroy(&w->particles);
}

/* Runs steps one by one; momentum adds up in each. Returns how many sleep in the end. */
static size_t run(world *w, const ascc_forces *forces, int steps)
{
    ascc_step_statistics s = {.size = sizeof s};
    for (int n = 0; n < steps; n++) {
        if (ascc_step_run(w->step, w->particles, forces, 1) != ASCC_OK)
            fail_msg("step: %s", ascc_step_message(w->step));
        assert_int_equal(ascc_step_get_statistics(w->step, &s), ASCC_OK);
        for (int c = 0; c < 3; c++)
            assert_true(s.momentum_before[c] + s.external_impulse[c] - s.wall_impulse[c] -
                            s.support_impulse[c] ==
                        s.momentum_after[c]);
        assert_true(s.asleep >= ascc_rest_count(w->particles)); /* more may wake at the end of it */
    }
    return (size_t)s.asleep;
}

/* As if all had been calm for long. */
static void calm_down(ascc_particles *p)
{
    memset(p->momentum, 0, p->fluid_count * 3 * sizeof *p->momentum);
    for (size_t i = 0; i < p->fluid_count; i++)
        p->rest[i] = 1000000;
}

/* Rows asleep beyond x, and before. */
static void count_sides(const ascc_particles *p, double x, size_t asleep[2])
{
    static uint8_t flag[MOST];
    asleep[0] = asleep[1] = 0;
    assert_int_equal(ascc_particles_get_asleep(p, 0, p->fluid_count, flag), ASCC_OK);
    for (size_t i = 0; i < p->fluid_count; i++)
        asleep[p->position[i * 3] > x] += flag[i];
}

static const pool small = {.cells = {8, 6, 8}, .threads = 1, .sleep_speed = 0.5};
/* Ten blocks long. */
static const pool channel = {.cells = {40, 4, 4}, .threads = 1, .sleep_speed = 0.5};

/* ---- To sleep ---- */

static void a_pool_comes_to_rest_and_then_nothing_changes(void **state)
{
    (void)state;
    world w = open_pool(&small);
    size_t asleep = 0;
    int steps = 0;
    for (; steps < 400 && asleep < w.particles->fluid_count; steps++)
        asleep = run(&w, NULL, 1);
    assert_int_equal(asleep, w.particles->fluid_count);
    assert_true(steps > 25); /* half a second of calm at least */
    const uint64_t hash = ascc_particles_hash(w.particles);
    assert_int_equal(run(&w, NULL, 10), asleep);
    assert_true(hash == ascc_particles_hash(w.particles));
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(w.step, &s), ASCC_OK);
    assert_true(s.external_impulse[1] < 0); /* gravity, and what holds against it */
    assert_memory_equal(s.external_impulse, s.support_impulse, sizeof s.support_impulse);
    for (int c = 0; c < 3; c++)
        assert_true(s.momentum_after[c] == 0 && s.wall_impulse[c] == 0);
    close_pool(&w);
}

static void nothing_sleeps_unless_it_may(void **state)
{
    (void)state;
    pool o = small;
    o.sleep_speed = 0.0;
    world w = open_pool(&o);
    assert_int_equal(run(&w, NULL, 40), 0);
    for (size_t i = 0; i < w.particles->fluid_count; i++)
        assert_int_equal(w.particles->rest[i], 0);
    /* And a step without wakes what another put to sleep: as if it had never slept. */
    const size_t size = ascc_particles_snapshot_size(w.particles);
    unsigned char *bytes = malloc(size);
    for (size_t i = 0; i < w.particles->fluid_count; i++)
        memset(w.particles->momentum + 3 * i, 0, 3 * sizeof(int64_t));
    assert_int_equal(ascc_particles_snapshot(w.particles, bytes, size), ASCC_OK);
    assert_int_equal(run(&w, NULL, 5), 0);
    const uint64_t hash = ascc_particles_hash(w.particles);
    assert_int_equal(ascc_particles_restore(w.particles, bytes, size), ASCC_OK);
    memset(w.particles->rest, 0xff, w.particles->fluid_count * sizeof(int32_t));
    assert_int_equal(run(&w, NULL, 5), 0);
    assert_true(hash == ascc_particles_hash(w.particles));
    free(bytes);
    close_pool(&w);
}

/* ---- And to wake ---- */

static void a_drop_wakes_a_pool(void **state)
{
    (void)state;
    world w = open_pool(&small);
    calm_down(w.particles);
    const size_t all = w.particles->fluid_count;
    assert_int_equal(run(&w, NULL, 1), all);
    const double high[3] = {4 * spacing, 13 * spacing, 4 * spacing};
    add_block(w.particles, (const int[]){2, 2, 2}, high, false);
    assert_int_equal(run(&w, NULL, 3), all); /* it falls, and is not near yet */
    size_t least = all;
    double fastest = 0.0;
    for (int n = 0; n < 60; n++) {
        const size_t asleep = run(&w, NULL, 1);
        least = asleep < least ? asleep : least;
        for (size_t i = 0; i < all; i++)
            for (int32_t c = 0; c < 3; c++)
                fastest = fmax(fastest, fabs(ascc_velocity(w.particles, i, c)));
    }
    assert_true(least < all / 2);
    assert_true(fastest > 0.1 && fastest < 3.0); /* pushed, and by no more than what fell */
    close_pool(&w);
}

/* What happens at one end of the channel wakes that end alone. */
static world open_asleep(const pool *o)
{
    world w = open_pool(o);
    calm_down(w.particles);
    assert_int_equal(run(&w, NULL, 1), w.particles->fluid_count);
    return w;
}

static void check_one_end(world *w)
{
    size_t asleep[2];
    (void)run(w, NULL, 1);
    count_sides(w->particles, 20 * spacing, asleep);
    assert_true(asleep[0] < 320 && asleep[1] == 320);
    close_pool(w);
}

static void what_the_host_changes_wakes_what_is_near(void **state)
{
    (void)state;
    const double place[3] = {spacing, 7 * spacing, spacing}, fast[3] = {0.5, 0.0, 0.0};
    const ascc_const_array at = {.data = place, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = fast, .scalar = ASCC_DOUBLE};
    uint64_t drained[2];
    world w = open_asleep(&channel);
    assert_int_equal(ascc_particles_add_fluid(w.particles, 1, &at, NULL, NULL, NULL), ASCC_OK);
    assert_true(ascc_rest_count(w.particles) < 640);
    check_one_end(&w);

    w = open_asleep(&channel);
    assert_int_equal(ascc_particles_set(w.particles, ASCC_FLUID, ASCC_VELOCITY, 0, 1, &velocity),
                     ASCC_OK);
    check_one_end(&w);

    w = open_asleep(&channel);
    assert_int_equal(ascc_particles_set(w.particles, ASCC_FLUID, ASCC_POSITION, 0, 1, &at),
                     ASCC_OK);
    check_one_end(&w);

    w = open_asleep(&channel);
    const uint64_t id = w.particles->id[1];
    assert_int_equal(ascc_particles_remove(w.particles, 1, &id), ASCC_OK);
    check_one_end(&w);

    w = open_asleep(&channel);
    const ascc_drain drain = {.size = sizeof drain,
                              .kind = ASCC_DRAIN_SPHERE,
                              .position = {spacing, spacing, spacing},
                              .radius = 1.8 * spacing};
    assert_int_equal(ascc_drain_run(w.particles, &drain, 2, drained, NULL), ASCC_OK);
    assert_int_equal(w.particles->fluid_count, 638);
    (void)run(&w, NULL, 1);
    size_t asleep[2];
    count_sides(w.particles, 20 * spacing, asleep);
    assert_true(asleep[0] < 318 && asleep[1] == 320);
    close_pool(&w);

    w = open_asleep(&channel);
    const double floor[3] = {spacing, 0.0, spacing}, up[3] = {0.0, 1.0, 0.0};
    const ascc_const_array wall = {.data = floor, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = up, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_boundary(w.particles, 1, &wall, &normal, 4, NULL), ASCC_OK);
    check_one_end(&w);

    w = open_asleep(&channel);
    assert_int_equal(ascc_particles_resize_fluid(w.particles, 641), ASCC_OK);
    assert_int_equal(ascc_particles_set(w.particles, ASCC_FLUID, ASCC_POSITION, 640, 1, &at),
                     ASCC_OK);
    check_one_end(&w);
}

static void a_wall_that_moves_wakes_what_is_near(void **state)
{
    (void)state;
    world w = open_asleep(&channel);
    const ascc_particles *p = w.particles;
    const double slow[3] = {0.01, 0.0, 0.0};
    const ascc_const_array velocity = {.data = slow, .scalar = ASCC_DOUBLE};
    for (size_t i = 0; i < p->boundary_count; i++) /* the wall at the low end */
        if (p->wall_normal[i * 3] == 1.0)
            assert_int_equal(
                ascc_particles_set(w.particles, ASCC_BOUNDARY, ASCC_VELOCITY, i, 1, &velocity),
                ASCC_OK);
    assert_int_equal(ascc_rest_count(p), 640); /* not before it moves */
    check_one_end(&w);
}

static void gravity_acceleration_and_the_host_wake_all(void **state)
{
    (void)state;
    static double push[MOST][3];
    const double aside[3] = {1.0, -9.81, 0.0};
    const ascc_forces tilted = {.size = sizeof tilted, .gravity = aside};
    world w = open_asleep(&channel);
    assert_int_equal(run(&w, &tilted, 1), 0);
    close_pool(&w);

    w = open_asleep(&channel);
    assert_int_equal(ascc_particles_wake(w.particles), ASCC_OK);
    assert_int_equal(ascc_rest_count(w.particles), 0);
    assert_int_equal(run(&w, NULL, 1), 0);
    close_pool(&w);

    w = open_asleep(&channel);
    push[0][0] = 1.0; /* at one end */
    const ascc_const_array rows = {.data = push, .scalar = ASCC_DOUBLE};
    const ascc_forces pushed = {.size = sizeof pushed, .acceleration = &rows};
    size_t asleep[2];
    (void)run(&w, &pushed, 1);
    count_sides(w.particles, 20 * spacing, asleep);
    assert_true(asleep[0] < 320 && asleep[1] == 320);
    assert_int_equal(ascc_particles_get_asleep(w.particles, 1, 640, (uint8_t *)push),
                     ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_get_asleep(w.particles, 0, 1, NULL), ASCC_ERROR_ARGUMENT);
    close_pool(&w);
}

/* ---- The same for everyone ---- */

static void bits_depend_on_neither_threads_nor_order(void **state)
{
    (void)state;
    uint64_t hash[3];
    for (int variant = 0; variant < 3; variant++) {
        pool o = channel;
        o.threads = variant == 1 ? 3 : 1;
        o.mirrored = variant == 2;
        world w = open_pool(&o);
        calm_down(w.particles);
        (void)run(&w, NULL, 1);
        const double above[3] = {spacing, 6 * spacing, spacing};
        add_block(w.particles, (const int[]){4, 2, 4}, above, o.mirrored);
        const size_t asleep = run(&w, NULL, 30);
        assert_true(asleep > 100 && asleep < 640);
        hash[variant] = ascc_particles_hash(w.particles);
        close_pool(&w);
    }
    assert_true(hash[0] == hash[1] && hash[0] == hash[2]);
}

static void a_snapshot_knows_what_sleeps(void **state)
{
    (void)state;
    world w = open_asleep(&channel), other = open_pool(&channel);
    const double above[3] = {spacing, 6 * spacing, spacing};
    const uint64_t before = ascc_particles_hash(w.particles);
    ascc_rest_end(w.particles);
    assert_true(before != ascc_particles_hash(w.particles));
    calm_down(w.particles);
    (void)run(&w, NULL, 1);
    add_block(w.particles, (const int[]){4, 2, 4}, above, false);
    (void)run(&w, NULL, 10);
    const size_t size = ascc_particles_snapshot_size(w.particles);
    unsigned char *bytes = malloc(size);
    assert_int_equal(ascc_particles_snapshot(w.particles, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_restore(other.particles, bytes, size), ASCC_OK);
    assert_true(run(&w, NULL, 10) > 0);
    (void)run(&other, NULL, 10);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    free(bytes);
    close_pool(&w);
    close_pool(&other);
}

/* ---- What the others see ---- */

/* Half of the channel sleeps: the other half moves as if all were awake, but for the seam. */
static void fluid_beside_what_sleeps_moves_as_beside_what_rests(void **state)
{
    (void)state;
    world asleep = open_pool(&channel), awake = open_pool(&channel);
    ascc_particles *p = asleep.particles, *q = awake.particles;
    (void)run(&awake, NULL, 40); /* off its lattice */
    const size_t n = p->fluid_count;
    memset(q->momentum, 0, n * 3 * sizeof *q->momentum);
    memcpy(p->position, q->position, n * 3 * sizeof *p->position);
    calm_down(p);
    (void)run(&asleep, NULL, 1);
    size_t sides[2];
    for (size_t i = 0; i < n; i++)
        if (p->position[i * 3] > 20 * spacing)
            p->rest[i] = 0;
    ascc_rest_end(q);
    (void)run(&asleep, NULL, 1);
    (void)run(&awake, NULL, 1);
    count_sides(p, 20 * spacing, sides);
    assert_true(sides[0] > 200 && sides[1] == 0);
    double sum = 0.0;
    size_t rows = 0;
    for (size_t i = 0; i < n; i++) {
        double square = 0.0;
        if (p->rest[i] < 0 || q->position[i * 3] < 20 * spacing)
            continue;
        for (int32_t c = 0; c < 3; c++)
            square += pow(ascc_velocity(p, i, c) - ascc_velocity(q, i, c), 2.0);
        sum += square;
        rows++;
    }
    assert_true(sqrt(sum / (double)rows) < 0.02 * 9.81 * 0.02); /* of what gravity gives */
    close_pool(&asleep);
    close_pool(&awake);
}

/* Steps of a handle that remembers the last one, and of new ones, which cannot: the same bits. Returns the least
 * share of the points that a step looked at. */
static double run_as_if_new(world *w, const ascc_forces *forces, int steps)
{
    const size_t size = ascc_particles_snapshot_size(w->particles);
    unsigned char *bytes = malloc(size);
    ascc_step_statistics s = {.size = sizeof s};
    double least = 1.0;
    for (int n = 0; n < steps; n++) {
        const ascc_step_options options = {.size = sizeof options, .sleep_speed = 0.5};
        ascc_step *kept = w->step;
        assert_int_equal(ascc_particles_snapshot(w->particles, bytes, size), ASCC_OK);
        assert_int_equal(ascc_step_create(w->context, w->model, &options, &w->step), ASCC_OK);
        (void)run(w, forces, 1);
        const uint64_t hash = ascc_particles_hash(w->particles);
        assert_int_equal(ascc_step_get_statistics(w->step, &s), ASCC_OK);
        const double all = (double)s.level_points[0];
        ascc_step_destroy(&w->step);
        w->step = kept;
        assert_int_equal(ascc_particles_restore(w->particles, bytes, size), ASCC_OK);
        (void)run(w, forces, 1);
        assert_true(ascc_particles_hash(w->particles) == hash);
        assert_int_equal(ascc_step_get_statistics(w->step, &s), ASCC_OK);
        least = fmin(least, (double)s.level_points[0] / all);
    }
    free(bytes);
    return least;
}

static void what_a_step_remembers_changes_no_bit(void **state)
{
    (void)state;
    const pool long_channel = {.cells = {100, 4, 4}, .threads = 2, .sleep_speed = 0.5};
    world w = open_asleep(&long_channel);
    ascc_particles *p = w.particles;
    add_block(p, (const int[]){2, 2, 2}, (const double[]){0.3, 0.25, 0.1}, false);
    assert_true(run_as_if_new(&w, NULL, 12) < 0.6);
    /* Whatever the host changes, near the fluid that moves and far away. */
    const double mass = 0.15, v[3] = {0.3, 0.2, 0.0}, down[3] = {0.0, -9.0, 0.0};
    const ascc_const_array heavy = {.data = &mass, .scalar = ASCC_DOUBLE};
    const ascc_const_array kick = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_set(p, ASCC_FLUID, ASCC_MASS, 40, 1, &heavy), ASCC_OK);
    (void)run_as_if_new(&w, NULL, 2);
    assert_int_equal(ascc_particles_set(p, ASCC_FLUID, ASCC_VELOCITY, 1500, 1, &kick), ASCC_OK);
    (void)run_as_if_new(&w, NULL, 2);
    uint64_t id[20];
    memcpy(id, p->id + 700, sizeof id);
    assert_int_equal(ascc_particles_remove(p, 20, id), ASCC_OK);
    (void)run_as_if_new(&w, NULL, 2);
    add_block(p, (const int[]){2, 1, 2}, (const double[]){4.0, 0.3, 0.1}, false);
    (void)run_as_if_new(&w, NULL, 4);
    memcpy(p->wall_normal, p->wall_normal + 3, 3 * sizeof *p->wall_normal); /* behind its back */
    p->wall_position[0] += 0.01;
    (void)run_as_if_new(&w, NULL, 2);
    const ascc_forces forces = {.size = sizeof forces, .gravity = down};
    (void)run_as_if_new(&w, &forces, 2);
    close_pool(&w);
}

/* Outputs over fluid alone and over fluid and walls, kernels in grids and in a basis, pairs and none. */
static void momentum_adds_up_with_every_kind_of_output(void **state)
{
    (void)state;
    const model_random kinds[] = {
        {.seed = 3, .dimension = 3, .scale = 1e-5},
        {.seed = 4, .dimension = 3, .scale = 1e-5, .bumps = 4},
        {.seed = 5, .dimension = 3, .scale = 1e-5, .fluid_only = 1},
        {.seed = 6, .dimension = 3, .scale = 1e-5, .bumps = 3, .fluid_only = 1, .walls = 1},
    };
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        pool o = channel;
        o.cells[1] = o.cells[2] = 3;
        o.sleep_speed = 3.0;
        o.model = model_builder_random(&kinds[k], &o.model_size);
        world w = open_pool(&o);
        calm_down(w.particles);
        (void)run(&w, NULL, 1);
        for (size_t i = 0; i < w.particles->fluid_count; i++)
            if (w.particles->position[i * 3] > 20 * spacing)
                w.particles->rest[i] = 0;
        assert_true(run(&w, NULL, 3) > 60);
        close_pool(&w);
        free(o.model);
    }
}

static void without_memory_nothing_is_lost(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_context_options options = test_memory_options(&memory);
    ascc_context *context;
    assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
    const ascc_particles_options set = {.size = sizeof set, .dimension = 3, .spacing = spacing};
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(context, &set, &p), ASCC_OK);
    add_block(p, channel.cells, (const double[]){spacing, spacing, spacing}, false);
    for (size_t fail = 0; fail < 3; fail++) {
        const double mass = 0.125;
        const ascc_const_array values = {.data = &mass, .scalar = ASCC_DOUBLE};
        memset(p->rest, 0xff, p->fluid_count * sizeof *p->rest);
        memory.fail_at = fail ? memory.calls + fail : 0;
        assert_int_equal(ascc_particles_set(p, ASCC_FLUID, ASCC_MASS, 0, 1, &values), ASCC_OK);
        memory.fail_at = 0;
        assert_true(fail ? ascc_rest_count(p) == 0 : ascc_rest_count(p) > 320);
    }
    ascc_particles_destroy(&p);
    ascc_context_destroy(&context);
    assert_true(test_memory_is_clean(&memory));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_pool_comes_to_rest_and_then_nothing_changes),
        cmocka_unit_test(nothing_sleeps_unless_it_may),
        cmocka_unit_test(a_drop_wakes_a_pool),
        cmocka_unit_test(what_the_host_changes_wakes_what_is_near),
        cmocka_unit_test(a_wall_that_moves_wakes_what_is_near),
        cmocka_unit_test(gravity_acceleration_and_the_host_wake_all),
        cmocka_unit_test(bits_depend_on_neither_threads_nor_order),
        cmocka_unit_test(a_snapshot_knows_what_sleeps),
        cmocka_unit_test(fluid_beside_what_sleeps_moves_as_beside_what_rests),
        cmocka_unit_test(what_a_step_remembers_changes_no_bit),
        cmocka_unit_test(momentum_adds_up_with_every_kind_of_output),
        cmocka_unit_test(without_memory_nothing_is_lost),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
