/* The laws of a step: momentum to the bit, determinism, transactions, steady memory.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "../examples/demo_model.h"
#include "points/particles.h"
#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

/* ---- Scenes and models ---- */

typedef struct world {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
} world;

typedef struct world_options {
    int32_t dimension, threads, neighbor_limit;
    uint32_t cpu_disable;
    bool radial, walls, unequal, random_network;
    bool gravity;       /* the random network sees it */
    const char *method; /* of sampling; NULL = voxel centres */
    int bumps, order, transfer, abstraction, graph,
        history;      /* of the random network: see model_random */
    const char *type; /* of its weights, all of which every type holds */
    uint32_t shuffle;
    double far;  /* one more particle this far away; 0 = none */
    double unit; /* metres in the host's length; 0 = 1 */
    ascc_context_options context;
} world_options;

static const double spacing = 0.05;

/* A small network with two levels and an antisymmetric last layer, or the demonstration model. */
static ascc_model *make_model(ascc_context *context, const world_options *o)
{
    ascc_model *model = NULL;
    size_t size;
    unsigned char *bytes;
    if (o->random_network) {
        const model_random r = {.seed = 5,
                                .dimension = o->dimension,
                                .levels = o->graph ? 1 : 2,
                                .channels = 8,
                                .spacing = spacing,
                                .graph = o->graph,
                                .history = o->history,
                                .plain = o->graph,
                                .projection = o->radial ? "radial" : "none",
                                .scale = o->bumps ? 0.001 : 0.0,
                                .bumps = o->bumps,
                                .order = o->order,
                                .transfer = o->transfer,
                                .abstraction = o->abstraction,
                                .method = o->method     ? o->method
                                          : o->transfer ? "voxel_corners"
                                                        : "voxel_centers",
                                .no_hysteresis = 1,
                                .type = o->type,
                                .coarse = o->type != NULL,
                                .gravity = o->gravity,
                                .neighbor_limit = o->neighbor_limit};
        bytes = model_builder_random(&r, &size);
    } else {
        bytes = demo_model_bytes(o->dimension, spacing, &size);
    }
    assert_non_null(bytes);
    if (ascc_model_load_memory(context, bytes, size, &model) != ASCC_OK) {
        char text[256];
        ascc_context_message(context, text, sizeof text);
        fail_msg("model: %s", text);
    }
    free(bytes);
    return model;
}

/* Two jittered blocks flying at each other, a little off centre. */
static size_t droplets(const world_options *o, double *x, double *v, double *m)
{
    dice d = {31};
    const int side = o->dimension == 2 ? 9 : 5;
    const double unit = o->unit > 0.0 ? o->unit : 1.0;
    size_t n = 0;
    for (int drop = 0; drop < 2; drop++)
        for (int k = 0; k < (o->dimension == 2 ? 1 : side); k++)
            for (int j = 0; j < side; j++)
                for (int i = 0; i < side; i++, n++) {
                    const int at[3] = {i, j, k};
                    for (int c = 0; c < o->dimension; c++) {
                        double p = (at[c] + dice_uniform(&d, -0.1, 0.1)) * spacing;
                        p += c == 0 ? drop * (side + 1) * spacing : c == 1 ? drop * 0.03 : 0.0;
                        x[n * (size_t)o->dimension + (size_t)c] = p / unit;
                        v[n * (size_t)o->dimension + (size_t)c] =
                            (c == 0 ? (drop ? -0.7 : 0.7) : dice_uniform(&d, -0.05, 0.05)) / unit;
                    }
                    m[n] = o->unequal ? 0.125 * (1.0 + (double)(dice_next(&d) % 7)) : 0.125;
                }
    return n;
}

static void shuffle_rows(double *x, double *v, double *m, size_t n, size_t d, uint32_t seed)
{
    dice r = {seed};
    for (size_t i = n - 1; i > 0; i--) {
        const size_t j = dice_next(&r) % (i + 1);
        for (size_t c = 0; c < d; c++) {
            const double sx = x[i * d + c], sv = v[i * d + c];
            x[i * d + c] = x[j * d + c];
            v[i * d + c] = v[j * d + c];
            x[j * d + c] = sx;
            v[j * d + c] = sv;
        }
        const double sm = m[i];
        m[i] = m[j];
        m[j] = sm;
    }
}

/* A floor and a side wall, bodies 3 and 8. */
static void add_walls(ascc_particles *p, const world_options *o)
{
    const size_t d = (size_t)o->dimension;
    const double unit = o->unit > 0.0 ? o->unit : 1.0;
    for (int body = 0; body < 2; body++) {
        double x[800 * 3], normal[800 * 3];
        size_t n = 0;
        for (int j = 0; j < (d == 2 ? 1 : 28); j++)
            for (int i = 0; i < 28; i++, n++) {
                const double a = (i - 6) * 0.64 * spacing, b = (j - 6) * 0.64 * spacing;
                const double floor_at[3] = {a, -0.7 * spacing, b};
                const double side_at[3] = {-0.7 * spacing, a, b};
                for (size_t c = 0; c < d; c++) {
                    x[n * d + c] = (body ? side_at : floor_at)[c] / unit;
                    normal[n * d + c] = c == (body ? 0u : 1u) ? 1.0 : 0.0;
                }
            }
        const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
        const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_add_boundary(p, n, &position, &normals, body ? 8 : 3, NULL),
                         ASCC_OK);
    }
}

static world open_world(const world_options *o)
{
    world w = {0};
    ascc_context_options context = o->context;
    context.size = sizeof context;
    if (!context.thread_count)
        context.thread_count = o->threads;
    context.cpu_disable = o->cpu_disable;
    assert_int_equal(ascc_context_create(&context, &w.context), ASCC_OK);
    w.model = make_model(w.context, o);
    const double unit = o->unit > 0.0 ? o->unit : 1.0;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = o->dimension,
                                            .spacing = spacing / unit,
                                            .mass = 0.125};
    assert_int_equal(ascc_particles_create(w.context, &options, &w.particles), ASCC_OK);
    const size_t d = (size_t)o->dimension;
    double x[300 * 3], v[300 * 3], m[300];
    size_t n = droplets(o, x, v, m);
    if (o->far != 0.0) {
        for (size_t c = 0; c < d; c++) {
            x[n * d + c] = o->far;
            v[n * d + c] = 0.0;
        }
        m[n++] = 0.125;
    }
    if (o->shuffle)
        shuffle_rows(x, v, m, n, d, o->shuffle);
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    const ascc_const_array mass = {.data = m, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(w.particles, n, &position, &velocity, &mass, NULL),
                     ASCC_OK);
    if (o->walls)
        add_walls(w.particles, o);
    const ascc_step_options step = {.size = sizeof step, .length_unit = o->unit};
    assert_int_equal(ascc_step_create(w.context, w.model, &step, &w.step), ASCC_OK);
    return w;
}

static void close_world(world *w)
{
    ascc_context_destroy(&w->context); /* in any order */
    ascc_model_destroy(&w->model);
    ascc_step_destroy(&w->step);
    ascc_particles_destroy(&w->particles);
}

static const double no_gravity[3] = {0.0, 0.0, 0.0};
static const double down[3] = {0.0, -9.81, 0.0};

static void run(world *w, const double *gravity, int32_t steps)
{
    const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    if (ascc_step_run(w->step, w->particles, &forces, steps) != ASCC_OK)
        fail_msg("step: %s", ascc_step_message(w->step));
}

static ascc_step_statistics statistics_of(const world *w)
{
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(w->step, &s), ASCC_OK);
    return s;
}

static void total_of(const world *w, int64_t total[3])
{
    assert_int_equal(ascc_particles_total_momentum(w->particles, total), ASCC_OK);
}

/* ---- Momentum ---- */

static void check_free_momentum(const world_options *o, int32_t steps)
{
    world w = open_world(o);
    int64_t before[3], after[3];
    total_of(&w, before);
    const uint64_t hash = ascc_particles_hash(w.particles);
    run(&w, no_gravity, steps);
    total_of(&w, after);
    assert_memory_equal(before, after, sizeof before);
    assert_true(hash != ascc_particles_hash(w.particles));
    const ascc_step_statistics s = statistics_of(&w);
    assert_true(s.pair_count > 100);
    close_world(&w);
}

static void momentum_is_the_same_integer_after_a_collision(void **state)
{
    (void)state;
    for (int32_t dimension = 2; dimension <= 3; dimension++)
        for (int variant = 0; variant < 16; variant++) {
            const world_options o = {.dimension = dimension,
                                     .threads = variant % 4 == 3 ? 7 : 1 + variant % 4 / 2,
                                     .unequal = variant & 1,
                                     .radial = variant & 2,
                                     .random_network = variant & 4,
                                     .neighbor_limit = variant & 8 ? 6 : 0};
            check_free_momentum(&o, o.random_network ? 20 : 100);
        }
}

static void momentum_is_the_same_integer_with_a_basis(void **state)
{
    (void)state;
    for (int variant = 0; variant < 24; variant++) {
        const world_options o = {.dimension = 2 + (variant & 1),
                                 .threads = variant % 3 == 2 ? 7 : 1 + variant % 3,
                                 .unequal = variant & 2,
                                 .random_network = true,
                                 .bumps = 1 + variant % 8,
                                 .order = variant / 2 % 3,
                                 .transfer = variant / 8,
                                 .neighbor_limit = variant & 4 ? 6 : 0};
        check_free_momentum(&o, 8); /* such networks tear the drops apart */
    }
}

static void fluid_and_wall_impulses_sum_to_the_external_impulse(void **state)
{
    (void)state;
    for (int variant = 0; variant < 16; variant++) {
        const world_options o = {.dimension = 3 - (variant & 1),
                                 .threads = variant & 2 ? 7 : 1,
                                 .walls = true,
                                 .unequal = variant & 4,
                                 .random_network = (variant & 2) || variant >= 8,
                                 .bumps = variant >= 8 ? 3 : 0,
                                 .order = 1,
                                 .transfer = variant >= 8};
        world w = open_world(&o);
        int64_t walls_felt = 0;
        for (int n = 0; n < 20; n++) {
            int64_t before[3], after[3], three[3], eight[3], both[3];
            total_of(&w, before);
            run(&w, down, 1);
            total_of(&w, after);
            const ascc_step_statistics s = statistics_of(&w);
            ascc_particles *p = w.particles;
            assert_int_equal(ascc_particles_body_impulse(p, 3, NULL, three, NULL), ASCC_OK);
            assert_int_equal(ascc_particles_body_impulse(p, 8, NULL, eight, NULL), ASCC_OK);
            assert_int_equal(ascc_particles_body_impulse(p, -1, NULL, both, NULL), ASCC_OK);
            for (int c = 0; c < 3; c++) {
                assert_true(before[c] + s.external_impulse[c] - both[c] == after[c]);
                assert_true(three[c] + eight[c] == both[c]);
                assert_true(both[c] == s.wall_impulse[c]);
                assert_true(before[c] == s.momentum_before[c] && after[c] == s.momentum_after[c]);
                walls_felt |= both[c];
            }
        }
        assert_true(walls_felt != 0);
        close_world(&w);
    }
}

static void radial_projection_conserves_angular_momentum(void **state)
{
    (void)state;
    for (int32_t dimension = 2; dimension <= 3; dimension++)
        for (int random = 0; random < 2; random++) {
            const world_options o = {
                .dimension = dimension, .threads = 2, .radial = true, .random_network = random};
            world w = open_world(&o);
            ascc_measures a = {.size = sizeof a}, b = {.size = sizeof b};
            int64_t before[3], after[3];
            total_of(&w, before);
            assert_int_equal(ascc_particles_measure(w.particles, &a), ASCC_OK);
            run(&w, no_gravity, dimension == 2 ? 2000 : 200);
            assert_int_equal(ascc_particles_measure(w.particles, &b), ASCC_OK);
            total_of(&w, after);
            assert_memory_equal(before, after, sizeof before);
            /* The demonstration model is evaluated at advected positions: the torque vanishes about
             * where the particles will be, not where they are. */
            const double bound = random ? 1e-6 : 2e-2;
            for (int c = 0; c < 3; c++)
                assert_true(fabs(a.angular_momentum[c] - b.angular_momentum[c]) <
                            bound * a.angular_scale);
            if (random)
                print_message("angular momentum error in %dD: %.2g\n", dimension,
                              fabs(a.angular_momentum[2] - b.angular_momentum[2]) /
                                  a.angular_scale);
            close_world(&w);
        }
}

static void a_basis_conserves_angular_momentum(void **state)
{
    (void)state;
    for (int variant = 0; variant < 8; variant++) {
        const world_options o = {.dimension = 2 + (variant & 1),
                                 .threads = 2,
                                 .unequal = variant & 2,
                                 .random_network = true,
                                 .bumps = 4,
                                 .order = 1,
                                 .transfer = variant & 4 ? 1 : 0};
        world w = open_world(&o);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
        assert_true(info.conserves_angular_momentum);
        ascc_measures a = {.size = sizeof a}, b = {.size = sizeof b};
        assert_int_equal(ascc_particles_measure(w.particles, &a), ASCC_OK);
        run(&w, no_gravity, 200);
        assert_int_equal(ascc_particles_measure(w.particles, &b), ASCC_OK);
        for (int c = 0; c < 3; c++)
            assert_true(fabs(a.angular_momentum[c] - b.angular_momentum[c]) <
                        1e-6 * a.angular_scale);
        close_world(&w);
    }
}

static void check_pair_impulse_is_along_the_line(const world_options *o)
{
    world w = open_world(o);
    const double x[6] = {0.01, 0.02, 0.03, 0.04, 0.05, 0.02};
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_clear(w.particles, ASCC_FLUID), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(w.particles, 2, &position, NULL, NULL, NULL),
                     ASCC_OK);
    run(&w, no_gravity, 1);
    int64_t p[6];
    assert_int_equal(ascc_particles_get_momentum(w.particles, 0, 2, p), ASCC_OK);
    assert_true(p[0] == -p[3] && p[1] == -p[4] && p[2] == -p[5]);
    assert_true(p[0] != 0);
    assert_true(fabs((double)p[1] / (double)p[0] - 1.0) < 1e-5);
    assert_true(fabs((double)p[2] / (double)p[0] + 1.0 / 3.0) < 1e-5);
    close_world(&w);
}

static void pair_impulses_are_along_the_line_with_radial_projection_or_a_basis(void **state)
{
    (void)state;
    world_options o = {.dimension = 3, .threads = 1, .radial = true, .random_network = true};
    check_pair_impulse_is_along_the_line(&o);
    o.radial = false;
    o.bumps = 2;
    check_pair_impulse_is_along_the_line(&o);
}

/* ---- Determinism ---- */

static uint64_t hash_after(const world_options *o, int32_t steps)
{
    world w = open_world(o);
    run(&w, o->walls ? down : no_gravity, steps);
    const uint64_t hash = ascc_particles_hash(w.particles);
    close_world(&w);
    return hash;
}

static void bits_do_not_depend_on_threads_cpu_or_order(void **state)
{
    (void)state;
    for (int variant = 0; variant < 16; variant++) {
        world_options o = {.dimension = 3 - (variant & 1),
                           .threads = 1,
                           .random_network = (variant & 2) || variant >= 8,
                           .walls = variant & 4,
                           .bumps = variant >= 8 ? variant - 7 : 0,
                           .order = variant % 3,
                           .transfer = variant >= 8 ? 1 + (variant & 1) : 0,
                           .neighbor_limit = variant & 2 ? 9 : 0};
        const int32_t steps = o.random_network ? 20 : 60;
        const uint64_t want = hash_after(&o, steps);
        for (int32_t threads = 2; threads <= 7; threads = threads * 2 + 1) {
            o.threads = threads;
            assert_true(hash_after(&o, steps) == want);
        }
        o.cpu_disable = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
        assert_true(hash_after(&o, steps) == want);
        o.cpu_disable = 0;
        for (o.shuffle = 1; o.shuffle < 4; o.shuffle++)
            assert_true(hash_after(&o, steps) == want);
    }
}

static void a_graph_network_gives_the_same_bits_for_threads_cpu_and_order(void **state)
{
    (void)state;
    for (int variant = 0; variant < 4; variant++) {
        world_options o = {.dimension = 3 - (variant & 1),
                           .threads = 1,
                           .random_network = true,
                           .walls = variant & 2,
                           .graph = 1 + variant % 2,
                           .history = 2 * variant};
        const uint64_t want = hash_after(&o, 5);
        for (o.threads = 2; o.threads <= 7; o.threads = o.threads * 2 + 1)
            assert_true(hash_after(&o, 5) == want);
        o.cpu_disable = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
        o.shuffle = 3;
        assert_true(hash_after(&o, 5) == want);
    }
}

static void every_way_of_sampling_steps_with_the_same_bits(void **state)
{
    (void)state;
    static const char *const methods[] = {"voxel_centers", "voxel_corners", "farthest", "farthest",
                                          "farthest"};
    static const int abstractions[] = {0, 0, 0, 1 + 2 + 16, 1 + 4 + 8 + 32};
    uint64_t seen[5];
    for (int m = 0; m < 5; m++) {
        world_options o = {.dimension = 3,
                           .threads = 1,
                           .random_network = true,
                           .walls = true,
                           .method = methods[m],
                           .abstraction = abstractions[m]};
        seen[m] = hash_after(&o, 5);
        for (int other = 0; other < m; other++)
            assert_true(seen[m] != seen[other]);
        o.threads = 3;
        o.shuffle = 7;
        assert_true(hash_after(&o, 5) == seen[m]);
        o.cpu_disable = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
        assert_true(hash_after(&o, 5) == seen[m]);
    }
}

static void short_weights_give_the_bits_of_the_floats_they_stand_for(void **state)
{
    (void)state;
    for (int bumps = 0; bumps < 3; bumps += 2) {
        world_options o = {.dimension = 2,
                           .threads = 1,
                           .random_network = true,
                           .walls = true,
                           .bumps = bumps,
                           .type = "F32"};
        const uint64_t want = hash_after(&o, 10);
        o.type = "F16";
        assert_true(hash_after(&o, 10) == want);
        o.type = "BF16";
        assert_true(hash_after(&o, 10) == want);
    }
}

/* A host's job system that runs tasks at once, last first. */
static void *enqueue_reversed(void *user, ascc_task task, void *work, int32_t count)
{
    (void)user;
    for (int32_t i = count; i-- > 0;)
        task(work, i);
    return NULL;
}

static void finish_nothing(void *user, void *token)
{
    (void)user;
    (void)token;
}

static void bits_do_not_depend_on_the_hosts_job_system(void **state)
{
    (void)state;
    world_options o = {.dimension = 3, .threads = 1, .random_network = true, .walls = true};
    const uint64_t want = hash_after(&o, 10);
    o.context.thread_count = 4;
    o.context.enqueue = enqueue_reversed;
    o.context.finish = finish_nothing;
    assert_true(hash_after(&o, 10) == want);
}

static void a_far_particle_changes_no_bit_of_the_others(void **state)
{
    (void)state;
    for (int32_t dimension = 2; dimension <= 3; dimension++) {
        const world_options near = {.dimension = dimension, .threads = 2, .random_network = true};
        world_options far = near;
        far.far = 2e5;
        world a = open_world(&near), b = open_world(&far);
        run(&a, no_gravity, 10);
        run(&b, no_gravity, 10);
        const size_t n = ascc_particles_count(a.particles, ASCC_FLUID);
        assert_int_equal(ascc_particles_count(b.particles, ASCC_FLUID), n + 1);
        const size_t d = (size_t)dimension;
        assert_memory_equal(a.particles->position, b.particles->position, n * d * sizeof(double));
        assert_memory_equal(a.particles->momentum, b.particles->momentum, n * d * sizeof(int64_t));
        close_world(&a);
        close_world(&b);
    }
}

static void many_steps_at_once_equal_single_steps(void **state)
{
    (void)state;
    const world_options o = {.dimension = 2, .threads = 1, .walls = true};
    world a = open_world(&o), b = open_world(&o);
    run(&a, down, 30);
    for (int n = 0; n < 30; n++)
        run(&b, down, 1);
    assert_true(ascc_particles_hash(a.particles) == ascc_particles_hash(b.particles));
    assert_int_equal(statistics_of(&a).steps, 30);
    close_world(&a);
    close_world(&b);
}

static void check_a_restored_run(bool history)
{
    const world_options o = {.dimension = 3,
                             .threads = 2,
                             .walls = true,
                             .random_network = history,
                             .graph = history,
                             .history = history ? 3 : 0};
    world w = open_world(&o);
    run(&w, down, 10);
    const size_t size = ascc_particles_snapshot_size(w.particles);
    void *memory = malloc(size);
    assert_int_equal(ascc_particles_snapshot(w.particles, memory, size), ASCC_OK);
    run(&w, down, 25);
    const uint64_t want = ascc_particles_hash(w.particles);
    assert_int_equal(ascc_particles_restore(w.particles, memory, size), ASCC_OK);
    assert_true(ascc_particles_hash(w.particles) != want);
    run(&w, down, 25);
    assert_true(ascc_particles_hash(w.particles) == want);
    free(memory);
    close_world(&w);
}

static void a_restored_run_goes_on_bit_for_bit(void **state)
{
    (void)state;
    check_a_restored_run(false);
    check_a_restored_run(true);
}

/* What a step has added to the past is told by the velocities before it; particles that come later and sets that
 * were never stepped have moved as they do. */
static void a_history_is_what_the_velocities_were(void **state)
{
    (void)state;
    const world_options o = {
        .dimension = 2, .threads = 2, .random_network = true, .graph = 1, .history = 3};
    world w = open_world(&o);
    const size_t n = w.particles->fluid_count;
    double *seen[4];
    for (int t = 0; t < 4; t++) {
        const ascc_array out = {.data = seen[t] = calloc(n * 2, sizeof(double)),
                                .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_get(w.particles, ASCC_FLUID, ASCC_VELOCITY, 0, n, &out),
                         ASCC_OK);
        run(&w, no_gravity, 1);
        assert_int_equal(w.particles->past_count, 3);
        for (size_t k = 0; k < n * 2; k++)
            for (int age = 0; age < 3; age++)
                assert_true(w.particles->past[(k / 2 * 3 + (size_t)age) * 2 + k % 2] ==
                            seen[t > age ? t - age : 0][k]);
    }
    const double place[2] = {9.0, 9.0}, fast[2] = {1.0, 0.5};
    const ascc_const_array x = {.data = place, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = fast, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(w.particles, 1, &x, &v, NULL, NULL), ASCC_OK);
    assert_true(fabs(w.particles->past[n * 6 + 4] - 1.0) < 1e-6);
    assert_true(fabs(w.particles->past[n * 6 + 5] - 0.5) < 1e-6);
    assert_true(w.particles->past[n * 6 - 2] == seen[1][n * 2 - 2]);
    for (int t = 0; t < 4; t++)
        free(seen[t]);
    close_world(&w);
}

static void copy_fluid_field(const world *from, const world *to, int field)
{
    double values[2 * 200];
    const size_t n = from->particles->fluid_count;
    const ascc_array out = {.data = values, .scalar = ASCC_DOUBLE};
    const ascc_const_array in = {.data = values, .scalar = ASCC_DOUBLE};
    assert_true(n <= 200);
    assert_int_equal(ascc_particles_get(from->particles, ASCC_FLUID, (ascc_field)field, 0, n, &out),
                     ASCC_OK);
    assert_int_equal(ascc_particles_set(to->particles, ASCC_FLUID, (ascc_field)field, 0, n, &in),
                     ASCC_OK);
}

static void a_run_goes_on_from_fields_that_the_host_has_read(void **state)
{
    (void)state;
    const world_options o = {
        .dimension = 2, .threads = 1, .random_network = true, .graph = 1, .history = 3};
    world a = open_world(&o), b = open_world(&o), forgets = open_world(&o);
    run(&a, no_gravity, 5);
    for (int field = ASCC_POSITION; field <= ASCC_VELOCITY; field++) {
        copy_fluid_field(&a, &b, field);
        copy_fluid_field(&a, &forgets, field);
    }
    for (int ago = 0; ago < 3; ago++)
        copy_fluid_field(&a, &b, ASCC_EARLIER_VELOCITY + ago);
    run(&a, no_gravity, 5);
    run(&b, no_gravity, 5);
    run(&forgets, no_gravity, 5);
    assert_true(ascc_particles_hash(a.particles) == ascc_particles_hash(b.particles));
    assert_true(ascc_particles_hash(a.particles) != ascc_particles_hash(forgets.particles));
    close_world(&a);
    close_world(&b);
    close_world(&forgets);
}

/* ---- Units and forces ---- */

static void a_host_in_centimetres_gets_the_same_motion(void **state)
{
    (void)state;
    const world_options metres = {.dimension = 3, .threads = 1, .walls = true};
    world_options centimetres = metres;
    centimetres.unit = 0.01;
    world a = open_world(&metres), b = open_world(&centimetres);
    const double down_cm[3] = {0.0, -981.0, 0.0};
    run(&a, down, 20);
    run(&b, down_cm, 20);
    const size_t n = ascc_particles_count(a.particles, ASCC_FLUID) * 3;
    for (size_t k = 0; k < n; k++)
        assert_true(fabs(a.particles->position[k] - b.particles->position[k] * 0.01) < 1e-6);
    close_world(&a);
    close_world(&b);
}

static void gravity_is_seen_alike_in_every_unit(void **state)
{
    (void)state;
    const world_options metres = {
        .dimension = 3, .threads = 1, .random_network = true, .gravity = true};
    world_options centimetres = metres;
    centimetres.unit = 0.01;
    world a = open_world(&metres), b = open_world(&centimetres);
    const double down_cm[3] = {0.0, -981.0, 0.0};
    run(&a, down, 3);
    run(&b, down_cm, 3);
    for (size_t k = 0; k < ascc_particles_count(a.particles, ASCC_FLUID) * 3; k++)
        assert_true(fabs(a.particles->position[k] - b.particles->position[k] * 0.01) < 1e-8);
    close_world(&a);
    close_world(&b);
}

static void the_models_gravity_is_the_default_in_the_hosts_unit(void **state)
{
    (void)state;
    world_options o = {.dimension = 3, .threads = 1, .unit = 0.01};
    world w = open_world(&o);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
    assert_int_equal(ascc_step_run(w.step, w.particles, NULL, 1), ASCC_OK);
    const ascc_step_statistics s = statistics_of(&w);
    ascc_measures m = {.size = sizeof m};
    assert_int_equal(ascc_particles_measure(w.particles, &m), ASCC_OK);
    const double q = ascc_particles_momentum_quantum(w.particles);
    for (int c = 0; c < 3; c++)
        assert_true(fabs((double)s.external_impulse[c] * q / m.mass -
                         info.gravity[c] * 100.0 * info.time_step) < 1e-6);
    close_world(&w);
}

static void free_fall_follows_gravity_and_acceleration(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    const double x[6] = {0, 0, 0, 5, 0, 0}; /* apart: no pair */
    const float push[8] = {1.0f, 2.0f, 3.0f, 99.0f, 0.0f, 0.0f, -4.0f, 99.0f};
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array acceleration = {.data = push, .stride = 4 * sizeof(float)};
    assert_int_equal(ascc_particles_clear(w.particles, ASCC_FLUID), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(w.particles, 2, &position, NULL, NULL, NULL),
                     ASCC_OK);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
    const ascc_forces forces = {
        .size = sizeof forces, .gravity = down, .acceleration = &acceleration};
    assert_int_equal(ascc_step_run(w.step, w.particles, &forces, 50), ASCC_OK);
    double v[6];
    const ascc_array out = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(w.particles, ASCC_FLUID, ASCC_VELOCITY, 0, 2, &out),
                     ASCC_OK);
    const double time = 50.0 * info.time_step;
    assert_true(fabs(v[0] - time) < 1e-6 && fabs(v[1] + 7.81 * time) < 1e-6);
    assert_true(fabs(v[3]) < 1e-9 && fabs(v[4] + 9.81 * time) < 1e-6);
    assert_true(fabs(v[5] + 4.0 * time) < 1e-6);
    close_world(&w);
}

/* ---- Bad input: an error, and nothing has changed ---- */

static void check_refused(world *w, const ascc_forces *forces, ascc_status status, const char *word)
{
    const uint64_t before = ascc_particles_hash(w->particles);
    assert_int_equal(ascc_step_run(w->step, w->particles, forces, 3), status);
    assert_true(ascc_particles_hash(w->particles) == before);
    if (!strstr(ascc_step_message(w->step), word))
        fail_msg("the message does not say %s: %s", word, ascc_step_message(w->step));
    assert_int_equal(statistics_of(w).steps, 0);
}

static void bad_forces_are_refused(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    const double bad[3] = {0.0, NAN, 0.0};
    ascc_forces forces = {.size = sizeof forces, .gravity = bad};
    check_refused(&w, &forces, ASCC_ERROR_NOT_FINITE, "gravity");
    float push[300 * 3] = {0};
    push[100] = INFINITY;
    const ascc_const_array acceleration = {.data = push};
    forces = (ascc_forces){.size = sizeof forces, .acceleration = &acceleration};
    check_refused(&w, &forces, ASCC_ERROR_NOT_FINITE, "acceleration");
    push[100] = 0.0f;
    const ascc_const_array unknown = {.data = push, .scalar = (ascc_scalar)2},
                           later = {.data = push, .reserved = 1};
    forces = (ascc_forces){.size = sizeof forces, .acceleration = &unknown};
    check_refused(&w, &forces, ASCC_ERROR_ARGUMENT, "acceleration: scalar 2");
    forces.acceleration = &later;
    check_refused(&w, &forces, ASCC_ERROR_ARGUMENT, "reserved 1");
    const double huge[3] = {1e300, 0.0, 0.0};
    forces = (ascc_forces){.size = sizeof forces, .gravity = huge};
    check_refused(&w, &forces, ASCC_ERROR_RANGE, "momentum");
    forces = (ascc_forces){.size = 3};
    check_refused(&w, &forces, ASCC_ERROR_ARGUMENT, "size");
    assert_int_equal(ascc_step_run(w.step, w.particles, NULL, -1), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_step_run(w.step, NULL, NULL, 1), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_step_run(NULL, w.particles, NULL, 1), ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

static void bad_step_options_are_refused(void **state)
{
    (void)state;
    const world_options o = {.dimension = 2, .threads = 1};
    world w = open_world(&o);
    const ascc_step_options bad[] = {{.size = sizeof(ascc_step_options), .time_step = -1.0},
                                     {.size = sizeof(ascc_step_options), .time_step = NAN},
                                     {.size = sizeof(ascc_step_options), .length_unit = -2.0},
                                     {.size = sizeof(ascc_step_options), .max_neighbors = -1},
                                     {.size = 1}};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        ascc_step *step = (ascc_step *)&w;
        assert_int_equal(ascc_step_create(w.context, w.model, &bad[i], &step), ASCC_ERROR_ARGUMENT);
        assert_null(step);
    }
    ascc_step *step;
    assert_int_equal(ascc_step_create(w.context, NULL, NULL, &step), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_step_create(NULL, w.model, NULL, &step), ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

static void a_model_of_another_dimension_is_refused(void **state)
{
    (void)state;
    const world_options two = {.dimension = 2, .threads = 1},
                        three = {.dimension = 3, .threads = 1};
    world a = open_world(&two), b = open_world(&three);
    assert_int_equal(ascc_step_run(a.step, b.particles, NULL, 1), ASCC_ERROR_MISMATCH);
    close_world(&a);
    close_world(&b);
}

static void a_handle_of_another_kind_is_refused(void **state)
{
    (void)state;
    const world_options o = {.dimension = 2, .threads = 1};
    world w = open_world(&o);
    assert_int_equal(ascc_step_run((ascc_step *)w.particles, w.particles, NULL, 1),
                     ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_step_run(w.step, (ascc_particles *)w.step, NULL, 1), ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

static void set_all_positions(world *w, const double at[3], double spread)
{
    const size_t d = (size_t)w->particles->dimension;
    for (size_t i = 0; i < w->particles->fluid_count; i++)
        for (size_t c = 0; c < d; c++)
            w->particles->position[i * d + c] = at[c] + spread * (double)(i % 2);
}

static void all_particles_at_one_point_feel_no_pair(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .random_network = true};
    world w = open_world(&o);
    const double at[3] = {0.1, -0.2, 0.3};
    set_all_positions(&w, at, 0.0);
    memset(w.particles->momentum, 0, w.particles->fluid_count * 3 * sizeof(int64_t));
    const uint64_t before = ascc_particles_hash(w.particles);
    run(&w, no_gravity, 1);
    assert_true(ascc_particles_hash(w.particles) == before);
    close_world(&w);
}

static void particles_a_million_radii_apart_step_apart(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .random_network = true};
    world w = open_world(&o);
    const double at[3] = {0.0, 0.0, 0.0};
    set_all_positions(&w, at, 1e5);
    run(&w, no_gravity, 2);
    const double out[3] = {1e13, 0.0, 0.0};
    set_all_positions(&w, out, -2e13);
    const ascc_forces forces = {.size = sizeof forces, .gravity = no_gravity};
    check_refused(&w, &forces, ASCC_ERROR_RANGE, "");
    close_world(&w);
}

static void no_particles_and_one_particle_step(void **state)
{
    (void)state;
    for (int32_t dimension = 2; dimension <= 3; dimension++) {
        const world_options o = {.dimension = dimension, .threads = 2, .random_network = true};
        world w = open_world(&o);
        const double x[3] = {0.3, 0.3, 0.3};
        const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_clear(w.particles, ASCC_FLUID), ASCC_OK);
        run(&w, no_gravity, 2);
        assert_int_equal(ascc_particles_add_fluid(w.particles, 1, &position, NULL, NULL, NULL),
                         ASCC_OK);
        const uint64_t before = ascc_particles_hash(w.particles);
        run(&w, no_gravity, 2);
        assert_true(ascc_particles_hash(w.particles) == before);
        close_world(&w);
    }
}

static void a_crowd_beyond_max_neighbors_is_an_error(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    ascc_step_destroy(&w.step);
    const ascc_step_options options = {.size = sizeof options, .max_neighbors = 5};
    assert_int_equal(ascc_step_create(w.context, w.model, &options, &w.step), ASCC_OK);
    check_refused(&w, NULL, ASCC_ERROR_LIMIT, "max_neighbors = 5");
    close_world(&w);
}

static void a_jump_beyond_max_displacement_is_an_error(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    ascc_step_destroy(&w.step);
    const ascc_step_options options = {.size = sizeof options, .max_displacement = 1e-4};
    assert_int_equal(ascc_step_create(w.context, w.model, &options, &w.step), ASCC_OK);
    check_refused(&w, NULL, ASCC_ERROR_RANGE, "max_displacement");
    close_world(&w);
}

static void values_too_large_for_an_impulse_are_an_error(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .random_network = true};
    world w = open_world(&o);
    w.particles->quantum = 1e-300; /* any impulse is beyond what integers of this quantum hold */
    memset(w.particles->momentum, 0, w.particles->fluid_count * 3 * sizeof(int64_t));
    const ascc_forces forces = {.size = sizeof forces, .gravity = no_gravity};
    check_refused(&w, &forces, ASCC_ERROR_RANGE, "impulse");
    close_world(&w);
}

/* ---- Memory ---- */

static world_options counted(test_memory *memory, world_options o)
{
    o.context = test_memory_options(memory);
    o.context.thread_count = 2;
    return o;
}

static void a_steady_step_allocates_nothing(void **state)
{
    (void)state;
    for (int random = 0; random < 4; random++) {
        test_memory c = {0};
        const world_options o = counted(&c, (world_options){.dimension = 3,
                                                            .walls = true,
                                                            .random_network = random,
                                                            .graph = random == 3 ? 2 : 0,
                                                            .history = random == 3,
                                                            .bumps = random == 2 ? 3 : 0,
                                                            .transfer = random == 2});
        world w = open_world(&o);
        run(&w, down, 6); /* the scene settles into its memory */
        ascc_const_array still = {.data = w.particles->position, .scalar = ASCC_DOUBLE};
        const size_t n = w.particles->fluid_count;
        double *copy = malloc(n * 3 * sizeof *copy);
        memcpy(copy, w.particles->position, n * 3 * sizeof *copy);
        still.data = copy;
        const size_t before = c.calls;
        for (int k = 0; k < 10; k++) { /* the same scene again and again */
            assert_int_equal(
                ascc_particles_set(w.particles, ASCC_FLUID, ASCC_POSITION, 0, n, &still), ASCC_OK);
            memset(w.particles->momentum, 0, n * 3 * sizeof(int64_t));
            run(&w, no_gravity, 1);
        }
        const size_t first = c.calls - before;
        for (int k = 0; k < 10; k++) {
            assert_int_equal(
                ascc_particles_set(w.particles, ASCC_FLUID, ASCC_POSITION, 0, n, &still), ASCC_OK);
            memset(w.particles->momentum, 0, n * 3 * sizeof(int64_t));
            run(&w, no_gravity, 1);
        }
        assert_int_equal(c.calls - before - first, 0);
        free(copy);
        close_world(&w);
        assert_true(test_memory_is_clean(&c));
    }
}

static void check_each_failing_allocation(int bumps, int graph)
{
    test_memory c = {0};
    const world_options o = counted(&c, (world_options){.dimension = 3,
                                                        .walls = true,
                                                        .random_network = true,
                                                        .graph = graph,
                                                        .history = graph,
                                                        .bumps = bumps,
                                                        .transfer = bumps > 0});
    world w = open_world(&o);
    const uint64_t before = ascc_particles_hash(w.particles);
    size_t failures = 0;
    for (size_t n = 1;; n++) {
        c.calls = 0;
        c.fail_at = n;
        ascc_step *step = NULL;
        const ascc_forces forces = {.size = sizeof forces, .gravity = down};
        ascc_status status = ascc_step_create(w.context, w.model, NULL, &step);
        ascc_measures m = {.size = sizeof m};
        if (status == ASCC_OK)
            status = ascc_particles_measure(w.particles, &m);
        if (status == ASCC_OK)
            status = ascc_step_run(step, w.particles, &forces, 1);
        c.fail_at = 0;
        ascc_step_destroy(&step);
        if (status == ASCC_OK)
            break;
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_true(ascc_particles_hash(w.particles) == before);
        failures++;
    }
    assert_true(failures > 30);
    close_world(&w);
    assert_true(test_memory_is_clean(&c));
}

static void each_failing_allocation_leaves_the_particles_as_they_were(void **state)
{
    (void)state;
    check_each_failing_allocation(0, 0);
    check_each_failing_allocation(0, 2);
    check_each_failing_allocation(3, 0);
}

/* A jittered block of side^dimension particles. */
static void set_block(world *w, int side)
{
    const int d = w->particles->dimension;
    dice r = {77};
    size_t count = 0;
    double *x = malloc((size_t)(side * side * side * 3) * sizeof *x);
    for (int k = 0; k < (d == 3 ? side : 1); k++)
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++, count++) {
                const int at[3] = {i, j, k};
                for (int c = 0; c < d; c++)
                    x[count * (size_t)d + (size_t)c] =
                        (at[c] + dice_uniform(&r, -0.2, 0.2)) * spacing;
            }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_clear(w->particles, ASCC_FLUID), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(w->particles, count, &position, NULL, NULL, NULL),
                     ASCC_OK);
    free(x);
}

static void the_first_bad_row_is_named_for_any_number_of_threads(void **state)
{
    (void)state;
    for (int32_t threads = 1; threads <= 4; threads++) {
        const world_options o = {.dimension = 3, .threads = threads};
        world w = open_world(&o);
        set_block(&w, 16);
        double *push = calloc((size_t)16 * 16 * 16 * 3, sizeof *push);
        assert_non_null(push);
        push[3900 * 3] = push[1500 * 3 + 1] = push[1501 * 3] = push[2100 * 3 + 2] = 1e300;
        const ascc_const_array acceleration = {.data = push, .scalar = ASCC_DOUBLE};
        const ascc_forces forces = {.size = sizeof forces, .acceleration = &acceleration};
        check_refused(&w, &forces, ASCC_ERROR_RANGE, "(row 1500)");
        free(push);
        close_world(&w);
    }
}

static void the_estimate_of_scratch_is_within_a_factor_of_two(void **state)
{
    (void)state;
    for (int variant = 0; variant < 6; variant++) {
        test_memory c = {0};
        const world_options o = counted(&c, (world_options){.dimension = 2 + variant % 2,
                                                            .random_network = variant > 1,
                                                            .graph = variant > 3 ? 3 : 0});
        world w = open_world(&o);
        set_block(&w, o.dimension == 2 ? 60 : 16);
        const size_t count = ascc_particles_count(w.particles, ASCC_FLUID);
        const size_t estimate = ascc_step_estimate(w.step, count, 0);
        run(&w, no_gravity, 3);
        const size_t held = statistics_of(&w).scratch_size;
        print_message("%zu particles in %dD: %zu bytes of scratch, %zu estimated\n", count,
                      o.dimension, held, estimate);
        assert_true(estimate < 2 * held && held < 2 * estimate);
        close_world(&w);
    }
}

static void a_reserved_step_grows_once(void **state)
{
    (void)state;
    test_memory c = {0};
    const world_options o = counted(&c, (world_options){.dimension = 3, .random_network = true});
    world w = open_world(&o);
    set_block(&w, 12);
    assert_int_equal(ascc_step_reserve(w.step, 4 * 12 * 12 * 12, 0), ASCC_OK);
    const size_t before = c.calls;
    run(&w, no_gravity, 1);
    assert_int_equal(c.calls, before);
    c.calls = 0;
    c.fail_at = 1;
    assert_int_equal(ascc_step_reserve(w.step, 1000000, 0), ASCC_ERROR_MEMORY);
    c.fail_at = 0;
    run(&w, no_gravity, 1);
    close_world(&w);
    assert_true(test_memory_is_clean(&c));
}

/* ---- What a step tells ---- */

static void statistics_tell_what_happened(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .walls = true, .random_network = true};
    world w = open_world(&o);
    run(&w, down, 3);
    const ascc_step_statistics s = statistics_of(&w);
    assert_int_equal(s.steps, 3);
    assert_int_equal(s.level_count, 2);
    assert_true(s.level_points[0] >= w.particles->fluid_count);
    assert_true(s.level_points[1] > 0 && s.level_points[1] < s.level_points[0]);
    assert_true(s.max_neighbors > 5 && s.neighbor_count > s.pair_count);
    assert_true(s.scratch_size > 10000);
    static const char *const names[] = {"forces", "sight",   "search",  "network",
                                        "pairs",  "advance", "contact", "commit"};
    double sum = 0.0;
    assert_int_equal(s.stage_count, 8);
    for (int i = 0; i < 8; i++) {
        assert_string_equal(s.stage[i].name, names[i]);
        sum += s.stage[i].seconds;
    }
    assert_true(sum > 0.5 * s.seconds_total && sum <= 1.0001 * s.seconds_total);
    close_world(&w);
}

static void sums_and_times_are_of_the_whole_run(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 2, .walls = true, .random_network = true};
    world whole = open_world(&o), parts = open_world(&o);
    int64_t external[3] = {0}, wall[3] = {0}, body[3] = {0}, all[3];
    for (int n = 0; n < 4; n++) {
        int64_t impulse[3];
        run(&parts, down, 1);
        const ascc_step_statistics s = statistics_of(&parts);
        assert_int_equal(ascc_particles_body_impulse(parts.particles, -1, NULL, impulse, NULL),
                         ASCC_OK);
        for (int c = 0; c < 3; c++) {
            external[c] += s.external_impulse[c];
            wall[c] += s.wall_impulse[c];
            body[c] += impulse[c];
        }
    }
    int64_t before[3];
    assert_int_equal(ascc_particles_total_momentum(whole.particles, before), ASCC_OK);
    run(&whole, down, 4);
    const ascc_step_statistics s = statistics_of(&whole);
    assert_int_equal(ascc_particles_body_impulse(whole.particles, -1, NULL, all, NULL), ASCC_OK);
    assert_true(wall[1] != 0);
    for (int c = 0; c < 3; c++) {
        assert_true(s.external_impulse[c] == external[c] && s.wall_impulse[c] == wall[c]);
        assert_true(all[c] == body[c] && s.momentum_before[c] == before[c]);
        assert_true(before[c] + external[c] - wall[c] == s.momentum_after[c]);
    }
    close_world(&whole);
    close_world(&parts);
}

static void a_run_of_nothing_leaves_no_old_statistics(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .walls = true, .random_network = true};
    world w = open_world(&o);
    run(&w, down, 2);
    assert_int_equal(ascc_step_run(w.step, w.particles, NULL, 0), ASCC_OK);
    ascc_step_statistics s = statistics_of(&w);
    assert_true(s.steps == 0 && s.seconds_total == 0.0 && s.pair_count == 0 && s.stage_count == 0);
    assert_true(s.wall_impulse[1] == 0 && s.external_impulse[1] == 0);
    run(&w, down, 2);
    assert_int_equal(ascc_particles_clear(w.particles, ASCC_FLUID), ASCC_OK);
    run(&w, down, 1);
    s = statistics_of(&w);
    assert_true(s.steps == 1 && s.pair_count == 0 && s.neighbor_count == 0);
    assert_true(s.momentum_before[1] == 0 && s.momentum_after[1] == 0 && s.wall_impulse[1] == 0);
    close_world(&w);
}

/* What 0.05 m apart is the model's own, whatever the host's unit. */
static void a_set_of_any_spacing_is_stepped(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    const struct {
        double spacing, unit;
        ascc_status status;
    } cases[] = {{5.0, 0.0, ASCC_OK},           {5.0, 0.01, ASCC_OK},
                 {0.05, 0.01, ASCC_OK},         {0.051, 1.0, ASCC_OK},
                 {(double)0.05f, 1.0, ASCC_OK}, {1e-300, 1.0, ASCC_ERROR_RANGE}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const ascc_particles_options p = {.size = sizeof p,
                                          .dimension = 3,
                                          .spacing = cases[i].spacing,
                                          .mass = 1.0,
                                          .momentum_quantum = 1e-9};
        const ascc_step_options s = {.size = sizeof s, .length_unit = cases[i].unit};
        const double x[3] = {0.0, 0.0, 0.0};
        const ascc_const_array at = {.data = x, .scalar = ASCC_DOUBLE};
        ascc_particles *set;
        ascc_step *step;
        assert_int_equal(ascc_particles_create(w.context, &p, &set), ASCC_OK);
        assert_int_equal(ascc_particles_add_fluid(set, 1, &at, NULL, NULL, NULL), ASCC_OK);
        assert_int_equal(ascc_step_create(w.context, w.model, &s, &step), ASCC_OK);
        const uint64_t hash = ascc_particles_hash(set);
        assert_int_equal(ascc_step_run(step, set, NULL, 1), cases[i].status);
        if (cases[i].status != ASCC_OK) {
            assert_true(ascc_particles_hash(set) == hash);
        }
        ascc_step_destroy(&step);
        ascc_particles_destroy(&set);
    }
    close_world(&w);
}

static void particle_options_of_a_model_are_those_it_steps(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++) {
        const world_options o = {.dimension = dimension, .threads = 1};
        world w = open_world(&o);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
        ascc_particles_options p = {.size = sizeof p};
        assert_int_equal(ascc_model_particles_options(w.model, 0.01, &p), ASCC_OK);
        const double h = info.particle_spacing;
        assert_true(p.dimension == dimension && fabs(p.spacing - 100.0 * h) < 1e-12 * p.spacing);
        assert_true(fabs(p.mass - info.rest_density * pow(h, dimension)) < 1e-12 * p.mass);
        ascc_particles *set;
        ascc_step *step;
        const ascc_step_options s = {.size = sizeof s, .length_unit = 0.01};
        assert_int_equal(ascc_particles_create(w.context, &p, &set), ASCC_OK);
        assert_int_equal(ascc_step_create(w.context, w.model, &s, &step), ASCC_OK);
        assert_int_equal(ascc_step_run(step, set, NULL, 1), ASCC_OK);
        ascc_step_destroy(&step);
        ascc_particles_destroy(&set);
        assert_int_equal(ascc_model_particles_options(NULL, 1.0, &p), ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_model_particles_options(w.model, -1.0, &p), ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_model_particles_options(w.model, NAN, &p), ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_model_particles_options(w.model, 1.0, NULL), ASCC_ERROR_ARGUMENT);
        close_world(&w);
    }
}

/* A step of the world's model with another time step. */
static ascc_status step_of(const world *w, double time_step, ascc_step **step)
{
    const ascc_step_options o = {.size = sizeof o, .time_step = time_step};
    return ascc_step_create(w->context, w->model, &o, step);
}

static void a_long_time_step_is_cut_into_steps_of_the_model(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 2, .walls = true, .random_network = true};
    world whole = open_world(&o), parts = open_world(&o);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(whole.model, &info), ASCC_OK);
    assert_true(info.time_step_max == info.time_step && info.time_step_min < info.time_step);
    ascc_step *step;
    assert_int_equal(step_of(&whole, 5.0 * info.time_step, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, whole.particles, NULL, 2), ASCC_OK);
    run(&parts, NULL, 10);
    assert_true(ascc_particles_hash(whole.particles) == ascc_particles_hash(parts.particles));
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(step, &s), ASCC_OK);
    const ascc_step_statistics t = statistics_of(&parts);
    assert_true(s.steps == 2 && s.substeps == 5 && t.steps == 10 && t.substeps == 1);
    for (int c = 0; c < 3; c++)
        assert_true(s.wall_impulse[c] == t.wall_impulse[c] &&
                    s.external_impulse[c] == t.external_impulse[c]);
    ascc_step_destroy(&step);
    /* out of every range */
    const uint64_t hash = ascc_particles_hash(whole.particles);
    assert_int_equal(step_of(&whole, 1001.0 * info.time_step, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, whole.particles, NULL, 1), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_step_message(step), "substeps"));
    assert_true(ascc_particles_hash(whole.particles) == hash);
    ascc_step_destroy(&step);
    close_world(&whole);
    close_world(&parts);
}

/* How far the fastest particle goes in each of four steps. */
static void find_ways(const world_options *o, double dt, double way[4])
{
    world w = open_world(o);
    ascc_measures m = {.size = sizeof m};
    for (int n = 0; n < 4; n++) {
        run(&w, NULL, 1);
        assert_int_equal(ascc_particles_measure(w.particles, &m), ASCC_OK);
        way[n] = m.max_speed * dt;
    }
    close_world(&w);
}

static void a_failing_substep_takes_all_of_its_step_back(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1, .walls = true, .random_network = true};
    world w = open_world(&o);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
    double way[4];
    find_ways(&o, info.time_step, way);
    assert_true(way[2] > 1.001 * fmax(way[0], way[1])); /* the third is the first too far */
    const ascc_step_options far = {.size = sizeof far,
                                   .time_step = 4.0 * info.time_step,
                                   .max_displacement = 0.5 * (way[2] + fmax(way[0], way[1]))};
    ascc_step *step;
    assert_int_equal(ascc_step_create(w.context, w.model, &far, &step), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(w.particles);
    assert_int_equal(ascc_step_run(step, w.particles, NULL, 3), ASCC_ERROR_RANGE);
    assert_true(ascc_particles_hash(w.particles) == hash);
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(step, &s), ASCC_OK);
    assert_true(s.steps == 0 && s.substeps_total == 0 && s.external_impulse[1] == 0);
    ascc_step_destroy(&step);
    close_world(&w);
}

static uint64_t past_of(const ascc_particles *p)
{
    uint64_t sum = 0, bits;
    for (size_t k = 0; k < p->fluid_count * (size_t)(p->past_count * p->dimension); k++) {
        memcpy(&bits, &p->past[k], sizeof bits);
        sum = sum * 31 + bits;
    }
    return sum;
}

static void a_failing_step_leaves_histories_as_they_were(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3,
                             .threads = 1,
                             .walls = true,
                             .random_network = true,
                             .graph = 1,
                             .history = 3};
    world w = open_world(&o);
    run(&w, no_gravity, 3);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
    const double dt = info.time_step, start = 0.2 * spacing / dt;
    double v[3] = {0.0, -start, 0.0};
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    for (size_t i = 0; i < w.particles->fluid_count; i++)
        assert_int_equal(
            ascc_particles_set(w.particles, ASCC_FLUID, ASCC_VELOCITY, i, 1, &velocity), ASCC_OK);
    /* falls faster with each substep, until one moves a particle too far */
    const double pull[3] = {0.0, -4.0 * spacing / dt / dt, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = pull};
    const ascc_step_options far = {
        .size = sizeof far, .time_step = 4.0 * dt, .max_displacement = 10.0 * spacing};
    ascc_step *step;
    assert_int_equal(ascc_step_create(w.context, w.model, &far, &step), ASCC_OK);
    ascc_status status = ASCC_OK;
    for (int n = 0; n < 20 && status == ASCC_OK; n++) {
        const uint64_t hash = ascc_particles_hash(w.particles), past = past_of(w.particles);
        status = ascc_step_run(step, w.particles, &forces, 1);
        const bool same = ascc_particles_hash(w.particles) == hash && past_of(w.particles) == past;
        assert_true(same == (status != ASCC_OK));
    }
    assert_int_equal(status, ASCC_ERROR_RANGE);
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(step, &s), ASCC_OK);
    assert_true(s.steps == 0 && s.external_impulse[1] == 0);
    ascc_step_destroy(&step);
    close_world(&w);
}

static void a_way_of_more_than_64_spacings_is_an_error_unless_allowed(void **state)
{
    (void)state;
    for (int allowed = 0; allowed < 2; allowed++) {
        const world_options o = {.dimension = 2, .threads = 1};
        world w = open_world(&o);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(w.model, &info), ASCC_OK);
        const double v[2] = {65.0 * spacing / info.time_step, 0.0};
        const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
        assert_int_equal(
            ascc_particles_set(w.particles, ASCC_FLUID, ASCC_VELOCITY, 0, 1, &velocity), ASCC_OK);
        const ascc_step_options options = {.size = sizeof options,
                                           .max_displacement = allowed ? INFINITY : 0.0};
        ascc_step *step;
        assert_int_equal(ascc_step_create(w.context, w.model, &options, &step), ASCC_OK);
        assert_int_equal(ascc_step_run(step, w.particles, NULL, 1),
                         allowed ? ASCC_OK : ASCC_ERROR_RANGE);
        ascc_step_destroy(&step);
        close_world(&w);
    }
}

static void measures_of_a_lattice_at_rest_are_those_of_rest(void **state)
{
    (void)state;
    const world_options o = {.dimension = 3, .threads = 1};
    world w = open_world(&o);
    assert_int_equal(ascc_particles_clear(w.particles, ASCC_FLUID), ASCC_OK);
    double x[7 * 7 * 7 * 3];
    for (int i = 0; i < 343; i++) {
        x[i * 3] = i % 7 * spacing;
        x[i * 3 + 1] = i / 7 % 7 * spacing;
        x[i * 3 + 2] = i / 49 * spacing;
    }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(w.particles, 343, &position, NULL, NULL, NULL),
                     ASCC_OK);
    ascc_measures m = {.size = sizeof m};
    assert_int_equal(ascc_particles_measure(w.particles, &m), ASCC_OK);
    assert_true(fabs(m.max_density - 1.0) < 1e-6);
    assert_true(m.mean_density < 1.0 && m.mean_density > 0.6);
    assert_true(fabs(m.min_distance - spacing) < 1e-6);
    assert_int_equal(m.close_count, 0);
    assert_true(fabs(m.mass - 343 * 0.125) < 1e-9);
    assert_true(m.kinetic_energy == 0.0 && m.max_speed == 0.0);
    close_world(&w);
}

/* ---- Contact with walls ---- */

#define ROOM 5 /* spacings along each edge */
#define SHOTS 40

typedef struct room {
    world w;
    size_t d;
    double unit, contact; /* metres in the host's length; spacings */
} room;

/* A closed room, walls 0.8 spacings apart, of which particles fly at up to 1.5 spacings a step, and what a
 * random network does to them. */
static room open_room(int32_t dimension, double contact, int32_t threads, double unit)
{
    room r = {.d = (size_t)dimension, .unit = unit, .contact = contact};
    const model_random random = {.seed = 9,
                                 .dimension = dimension,
                                 .channels = 8,
                                 .spacing = spacing,
                                 .scale = 0.003,
                                 .bumps = 3,
                                 .order = 1,
                                 .fluid_only = 1,
                                 .walls = 1,
                                 .contact = contact};
    const ascc_context_options context = {.size = sizeof context, .thread_count = threads};
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = spacing / unit, .mass = 0.125};
    const ascc_step_options step = {.size = sizeof step, .length_unit = unit};
    double x[1200 * 3], v[1200 * 3];
    dice random_numbers = {77};
    size_t size;
    unsigned char *bytes = model_builder_random(&random, &size);
    assert_int_equal(ascc_context_create(&context, &r.w.context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(r.w.context, bytes, size, &r.w.model), ASCC_OK);
    free(bytes);
    assert_int_equal(ascc_particles_create(r.w.context, &options, &r.w.particles), ASCC_OK);
    for (size_t k = 0; k < SHOTS * r.d; k++) {
        x[k] = dice_uniform(&random_numbers, 1.0, ROOM - 1.0) * spacing / unit;
        v[k] = dice_uniform(&random_numbers, -1.5, 1.5) * spacing / 0.005 / unit;
    }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(
        ascc_particles_add_fluid(r.w.particles, SHOTS, &position, &velocity, NULL, NULL), ASCC_OK);
    size_t n = 0;
    const int side = (int)(ROOM / 0.8) + 1;
    for (size_t face = 0; face < 2 * r.d; face++)
        for (int j = 0; j < (r.d == 2 ? 1 : side); j++)
            for (int i = 0; i < side; i++, n++) {
                const size_t axis = face / 2;
                for (size_t c = 0; c < r.d; c++) {
                    x[n * r.d + c] = (c == (axis + 1) % r.d ? i : j) * 0.8 * spacing / unit;
                    v[n * r.d + c] = 0.0;
                }
                x[n * r.d + axis] = face % 2 ? ROOM * spacing / unit : 0.0;
                v[n * r.d + axis] = face % 2 ? -1.0 : 1.0;
            }
    assert_int_equal(ascc_particles_add_boundary(r.w.particles, n, &position, &velocity, 0, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_step_create(r.w.context, r.w.model, &step, &r.w.step), ASCC_OK);
    return r;
}

/* The closest that a particle is to a wall, or the farthest beyond it (negative), in spacings. */
static double closest(const room *r)
{
    double least = ROOM;
    for (size_t k = 0; k < SHOTS * r->d; k++) {
        const double at = r->w.particles->position[k] * r->unit / spacing;
        least = fmin(least, fmin(at, ROOM - at));
    }
    return least;
}

static void nothing_passes_a_wall_with_contact(void **state)
{
    (void)state;
    for (int32_t dimension = 2; dimension <= 3; dimension++) {
        const double gravity[3] = {0.0, -9.81, 0.0};
        room with = open_room(dimension, 0.4, 1, 1.0), without = open_room(dimension, 0.0, 1, 1.0);
        int hits = 0;
        for (int n = 0; n < 60; n++) {
            run(&with.w, gravity, 1);
            run(&without.w, gravity, 1);
            const ascc_step_statistics s = statistics_of(&with.w);
            for (size_t c = 0; c < with.d; c++) {
                assert_true(s.momentum_before[c] + s.external_impulse[c] - s.wall_impulse[c] ==
                            s.momentum_after[c]);
                hits += s.wall_impulse[c] != 0;
            }
            assert_true(closest(&with) > 0.4 - 1e-6);
        }
        assert_true(hits > 30);
        assert_true(closest(&without) < -0.5); /* so there was something to hold */
        close_world(&with.w);
        close_world(&without.w);
    }
}

static void contact_gives_the_same_bits_for_any_number_of_threads(void **state)
{
    (void)state;
    const double gravity[3] = {1.0, -9.81, 2.0};
    room one = open_room(3, 0.4, 1, 1.0), four = open_room(3, 0.4, 4, 1.0);
    run(&one.w, gravity, 40);
    run(&four.w, gravity, 40);
    assert_true(ascc_particles_hash(one.w.particles) == ascc_particles_hash(four.w.particles));
    for (size_t k = 0; k < one.w.particles->boundary_count * 3; k++)
        assert_true(one.w.particles->wall_impulse[k] == four.w.particles->wall_impulse[k]);
    close_world(&one.w);
    close_world(&four.w);
}

/* The walls' rows the other way round. */
static void turn_walls(ascc_particles *p)
{
    const size_t n = p->boundary_count * 3;
    for (size_t k = 0; k < n / 2; k++) {
        const size_t other = (p->boundary_count - 1 - k / 3) * 3 + k % 3;
        const double x = p->wall_position[k], normal = p->wall_normal[k];
        p->wall_position[k] = p->wall_position[other];
        p->wall_normal[k] = p->wall_normal[other];
        p->wall_position[other] = x;
        p->wall_normal[other] = normal;
    }
}

static void contact_does_not_ask_in_which_order_the_walls_came(void **state)
{
    (void)state;
    const double gravity[3] = {1.0, -9.81, 2.0};
    room a = open_room(3, 0.4, 1, 1.0), b = open_room(3, 0.4, 1, 1.0);
    const size_t n = a.w.particles->boundary_count;
    assert_int_equal(n % 2, 0); /* so that a row in the middle is not turned twice */
    turn_walls(b.w.particles);
    size_t hits = 0;
    for (int step = 0; step < 40; step++) {
        run(&a.w, gravity, 1);
        run(&b.w, gravity, 1);
        assert_memory_equal(a.w.particles->position, b.w.particles->position,
                            SHOTS * 3 * sizeof(double));
        for (size_t k = 0; k < n * 3; k++) {
            hits += a.w.particles->wall_impulse[k] != 0;
            assert_true(a.w.particles->wall_impulse[k] ==
                        b.w.particles->wall_impulse[(n - 1 - k / 3) * 3 + k % 3]);
        }
    }
    assert_true(hits > 100);
    close_world(&a.w);
    close_world(&b.w);
}

static void contact_holds_alike_in_every_unit(void **state)
{
    (void)state;
    const double down_cm[3] = {0.0, -981.0, 0.0};
    room metres = open_room(2, 0.4, 1, 1.0), centimetres = open_room(2, 0.4, 1, 0.01);
    run(&metres.w, down, 3);
    run(&centimetres.w, down_cm, 3);
    for (size_t k = 0; k < SHOTS * 2; k++)
        assert_true(fabs(metres.w.particles->position[k] -
                         centimetres.w.particles->position[k] * 0.01) < 1e-7);
    assert_true(closest(&metres) < 0.41); /* something was held */
    close_world(&metres.w);
    close_world(&centimetres.w);
}

static void contact_takes_what_points_into_the_wall_and_nothing_else(void **state)
{
    (void)state;
    room r = open_room(2, 0.4, 1, 1.0);
    const double v = 0.5 * spacing / 0.005; /* half a spacing a step */
    for (size_t i = 0; i < SHOTS; i++) { /* one is near the wall x = 0, the others rest far away */
        const double x[2] = {i ? 2.5 * spacing + 100.0 * (double)i : 0.6 * spacing, 2.4 * spacing};
        for (size_t c = 0; c < 2; c++) {
            r.w.particles->position[i * 2 + c] = x[c];
            (void)ascc_to_quanta(i ? 0.0 : 0.125 * (c ? v : -v), r.w.particles->quantum,
                                 &r.w.particles->momentum[i * 2 + c]);
        }
    }
    room free = open_room(2, 0.0, 1, 1.0);
    memcpy(free.w.particles->position, r.w.particles->position, SHOTS * 2 * sizeof(double));
    memcpy(free.w.particles->momentum, r.w.particles->momentum, SHOTS * 2 * sizeof(int64_t));
    run(&r.w, no_gravity, 1);
    run(&free.w, no_gravity, 1);
    assert_true(free.w.particles->position[0] < 0.3 * spacing);
    assert_true(fabs(r.w.particles->position[0] - 0.4 * spacing) < 1e-9);
    assert_true(fabs(r.w.particles->position[1] - free.w.particles->position[1]) < 1e-9);
    close_world(&r.w);
    close_world(&free.w);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(momentum_is_the_same_integer_after_a_collision),
        cmocka_unit_test(momentum_is_the_same_integer_with_a_basis),
        cmocka_unit_test(fluid_and_wall_impulses_sum_to_the_external_impulse),
        cmocka_unit_test(radial_projection_conserves_angular_momentum),
        cmocka_unit_test(a_basis_conserves_angular_momentum),
        cmocka_unit_test(pair_impulses_are_along_the_line_with_radial_projection_or_a_basis),
        cmocka_unit_test(bits_do_not_depend_on_threads_cpu_or_order),
        cmocka_unit_test(a_graph_network_gives_the_same_bits_for_threads_cpu_and_order),
        cmocka_unit_test(every_way_of_sampling_steps_with_the_same_bits),
        cmocka_unit_test(short_weights_give_the_bits_of_the_floats_they_stand_for),
        cmocka_unit_test(bits_do_not_depend_on_the_hosts_job_system),
        cmocka_unit_test(a_far_particle_changes_no_bit_of_the_others),
        cmocka_unit_test(many_steps_at_once_equal_single_steps),
        cmocka_unit_test(a_restored_run_goes_on_bit_for_bit),
        cmocka_unit_test(a_history_is_what_the_velocities_were),
        cmocka_unit_test(a_run_goes_on_from_fields_that_the_host_has_read),
        cmocka_unit_test(a_host_in_centimetres_gets_the_same_motion),
        cmocka_unit_test(gravity_is_seen_alike_in_every_unit),
        cmocka_unit_test(nothing_passes_a_wall_with_contact),
        cmocka_unit_test(contact_gives_the_same_bits_for_any_number_of_threads),
        cmocka_unit_test(contact_does_not_ask_in_which_order_the_walls_came),
        cmocka_unit_test(contact_holds_alike_in_every_unit),
        cmocka_unit_test(contact_takes_what_points_into_the_wall_and_nothing_else),
        cmocka_unit_test(the_models_gravity_is_the_default_in_the_hosts_unit),
        cmocka_unit_test(free_fall_follows_gravity_and_acceleration),
        cmocka_unit_test(bad_forces_are_refused),
        cmocka_unit_test(bad_step_options_are_refused),
        cmocka_unit_test(a_model_of_another_dimension_is_refused),
        cmocka_unit_test(a_handle_of_another_kind_is_refused),
        cmocka_unit_test(all_particles_at_one_point_feel_no_pair),
        cmocka_unit_test(particles_a_million_radii_apart_step_apart),
        cmocka_unit_test(no_particles_and_one_particle_step),
        cmocka_unit_test(a_crowd_beyond_max_neighbors_is_an_error),
        cmocka_unit_test(a_jump_beyond_max_displacement_is_an_error),
        cmocka_unit_test(values_too_large_for_an_impulse_are_an_error),
        cmocka_unit_test(a_steady_step_allocates_nothing),
        cmocka_unit_test(each_failing_allocation_leaves_the_particles_as_they_were),
        cmocka_unit_test(the_first_bad_row_is_named_for_any_number_of_threads),
        cmocka_unit_test(the_estimate_of_scratch_is_within_a_factor_of_two),
        cmocka_unit_test(a_reserved_step_grows_once),
        cmocka_unit_test(statistics_tell_what_happened),
        cmocka_unit_test(a_way_of_more_than_64_spacings_is_an_error_unless_allowed),
        cmocka_unit_test(a_failing_substep_takes_all_of_its_step_back),
        cmocka_unit_test(a_failing_step_leaves_histories_as_they_were),
        cmocka_unit_test(a_long_time_step_is_cut_into_steps_of_the_model),
        cmocka_unit_test(particle_options_of_a_model_are_those_it_steps),
        cmocka_unit_test(a_set_of_any_spacing_is_stepped),
        cmocka_unit_test(a_run_of_nothing_leaves_no_old_statistics),
        cmocka_unit_test(sums_and_times_are_of_the_whole_run),
        cmocka_unit_test(measures_of_a_lattice_at_rest_are_those_of_rest),
    };
    return cmocka_run_group_tests_name("step", tests, NULL, NULL);
}
