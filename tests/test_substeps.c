/* One number for time, gravity and size: other spacings are the same scene, and steps stay in the model's range.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/particles.h"
#include "support/model_builder.h"
#include "support/tools.h"

static const double spacing = 0.05;

/* ---- Scenes ---- */

/* A block that falls on a floor, as the model has it, in metres and seconds of other sizes. */
typedef struct scene {
    int32_t dimension, threads, substeps;
    double length, time; /* of the model's, in the host's units; 0 = 1 */
    double steps;        /* the time step, in the model's own; 0 = 1 */
    double speed;        /* of the block, spacings a model's step */
    double pull;         /* times the model's gravity; 0 = none of the host's */
    const char
        *trained; /* a model of a relaxation alone with these keys; NULL = a random network */
} scene;

typedef struct world {
    scene is;
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    ascc_model_info info;
} world;

static const char *relaxation_text(int d, const char *more)
{
    static char text[512];
    (void)snprintf(text, sizeof text,
                   "{\"support\":%s,\"rest_volume\":%s,\"omega\":[0.5,0.5],\"epsilon\":0.1,"
                   "\"limit\":%s,\"divergence\":[0.5,0.5]%s}",
                   model_number(2.0 * spacing), model_number(0.8 * pow(spacing, d)),
                   model_number(0.2 * spacing), more);
    return text;
}

/* Everything that has a length or a time: motion, damping, walls, contact, a relaxation with a guess. */
static unsigned char *network_bytes(int d, size_t *size)
{
    const model_random network = {.seed = 11,
                                  .dimension = d,
                                  .spacing = spacing,
                                  .bumps = 3,
                                  .fluid_only = 1,
                                  .walls = 1,
                                  .contact = 0.3,
                                  .scale = 0.001,
                                  .area = 1,
                                  .gravity = 1,
                                  .guess = 1,
                                  .relaxation = relaxation_text(d, ",\"guess\":\"guess\"")};
    return model_builder_random(&network, size);
}

static unsigned char *relaxation_bytes(int d, const char *trained, size_t *size)
{
    model_builder b;
    model_text t = {0};
    model_text_add(
        &t,
        "{\"name\":\"pbf\",\"dimension\":%d,\"time_step\":0.02,\"gravity\":[0,-8%s],"
        "\"particle_spacing\":%s,\"rest_density\":1000,\"evaluate\":\"advected\",%s"
        "\"features\":{\"fluid\":[\"one\"],\"boundary\":[]},\"layers\":[],\"relaxation\":%s}",
        d, d == 3 ? ",0" : "", model_number(spacing), trained, relaxation_text(d, ""));
    model_builder_open(&b);
    model_builder_metadata(&b, "format", "ascc.model");
    model_builder_metadata(&b, "version", "1");
    model_builder_metadata(&b, "network", t.text);
    unsigned char *bytes = model_builder_finish(&b, size);
    model_text_free(&t);
    return bytes;
}

static ascc_status load(ascc_context *context, const scene *is, ascc_model **model)
{
    size_t size;
    unsigned char *bytes = is->trained ? relaxation_bytes(is->dimension, is->trained, &size)
                                       : network_bytes(is->dimension, &size);
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    free(bytes);
    return status;
}

static void add_block(const world *w, double unit, double time)
{
    dice r = {5};
    const size_t d = (size_t)w->is.dimension, side = d == 2 ? 12 : 6;
    double x[216 * 3], v[216 * 3];
    size_t n = 0;
    for (size_t k = 0; k < (d == 2 ? 1 : side); k++)
        for (size_t j = 0; j < side; j++)
            for (size_t i = 0; i < side; i++, n++) {
                const double at[3] = {(double)i, 0.6 + (double)j, (double)k};
                for (size_t c = 0; c < d; c++) {
                    x[n * d + c] = (at[c] + dice_uniform(&r, -0.1, 0.1)) * spacing * unit;
                    v[n * d + c] = (c == 1 ? -w->is.speed : dice_uniform(&r, -0.02, 0.02)) *
                                   spacing / w->info.time_step * unit / time;
                }
            }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE},
                           velocity = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(w->particles, n, &position, &velocity, NULL, NULL),
                     ASCC_OK);
}

static void add_floor(const world *w, double unit)
{
    const size_t d = (size_t)w->is.dimension, side = 32;
    double x[32 * 32 * 3], normal[32 * 32 * 3];
    size_t n = 0;
    for (size_t k = 0; k < (d == 2 ? 1 : side); k++)
        for (size_t i = 0; i < side; i++, n++) {
            const double at[3] = {((double)i - 8.0) * 0.6, 0.0, ((double)k - 8.0) * 0.6};
            for (size_t c = 0; c < d; c++) {
                x[n * d + c] = at[c] * spacing * unit;
                normal[n * d + c] = c == 1 ? 1.0 : 0.0;
            }
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE},
                           normals = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_boundary(w->particles, n, &position, &normals, 0, NULL),
                     ASCC_OK);
}

static world open_world(const scene *is)
{
    world w = {.is = *is, .info = {.size = sizeof w.info}};
    const double unit = is->length > 0.0 ? is->length : 1.0, time = is->time > 0.0 ? is->time : 1.0;
    const ascc_context_options options = {.size = sizeof options, .thread_count = is->threads};
    assert_int_equal(ascc_context_create(&options, &w.context), ASCC_OK);
    assert_int_equal(load(w.context, is, &w.model), ASCC_OK);
    assert_int_equal(ascc_model_get_info(w.model, &w.info), ASCC_OK);
    /* the quantum goes with velocities, so that nothing is rounded otherwise */
    const ascc_particles_options set = {.size = sizeof set,
                                        .dimension = is->dimension,
                                        .spacing = spacing * unit,
                                        .mass = 0.125,
                                        .momentum_quantum = 0x1p-44 * unit / time};
    const double steps = is->steps > 0.0 ? is->steps : 1.0;
    const ascc_step_options step = {.size = sizeof step,
                                    .time_step = w.info.time_step * steps * time,
                                    .substeps = is->substeps};
    assert_int_equal(ascc_particles_create(w.context, &set, &w.particles), ASCC_OK);
    assert_int_equal(ascc_step_create(w.context, w.model, &step, &w.step), ASCC_OK);
    add_block(&w, unit, time);
    add_floor(&w, unit);
    return w;
}

static void close_world(world *w)
{
    ascc_step_destroy(&w->step);
    ascc_particles_destroy(&w->particles);
    ascc_model_destroy(&w->model);
    ascc_context_destroy(&w->context);
}

static ascc_status run(const world *w, int32_t count)
{
    double g[3];
    for (int c = 0; c < 3; c++)
        g[c] = w->is.pull * w->info.gravity[c];
    const ascc_forces forces = {.size = sizeof forces, .gravity = w->is.pull > 0.0 ? g : NULL};
    return ascc_step_run(w->step, w->particles, &forces, count);
}

static ascc_step_statistics statistics_of(const world *w)
{
    ascc_step_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_step_get_statistics(w->step, &s), ASCC_OK);
    return s;
}

/* ---- One scene in any units ---- */

/* Largest distance between two runs, in spacings of the first. */
static double apart(const world *a, const world *b)
{
    double most = 0.0;
    const double unit = b->is.length > 0.0 ? b->is.length : 1.0;
    for (size_t k = 0; k < a->particles->fluid_count * (size_t)a->is.dimension; k++)
        most = fmax(most, fabs(a->particles->position[k] - b->particles->position[k] / unit));
    return most / spacing;
}

static void other_spacings_are_the_same_scene_to_the_bit_for_powers_of_two(void **state)
{
    (void)state;
    static const double units[][2] = {{4.0, 2.0}, {0.25, 0.5}, {1.0 / 64.0, 0.125}};
    for (int32_t d = 2; d <= 3; d++) {
        const scene own = {.dimension = d, .threads = 1, .speed = 0.5};
        world a = open_world(&own);
        assert_int_equal(run(&a, 20), ASCC_OK);
        assert_true(statistics_of(&a).substeps_total == 20);
        for (size_t i = 0; i < sizeof units / sizeof *units; i++) {
            scene other = own;
            other.length = units[i][0];
            other.time = units[i][1];
            world b = open_world(&other);
            assert_int_equal(run(&b, 20), ASCC_OK);
            assert_true(apart(&a, &b) == 0.0);
            close_world(&b);
        }
        close_world(&a);
    }
}

/* With 0.025 and 0.1 m apart nothing is a power of two: 20 steps make rounding some hundred times larger. */
static void other_spacings_are_the_same_scene_to_rounding(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++)
        for (int fine = 0; fine < 2; fine++) {
            const scene own = {.dimension = d, .threads = 1, .speed = 0.5};
            scene other = own;
            other.length = fine ? 0.5 : 2.0;
            other.time = sqrt(other.length);
            world a = open_world(&own), b = open_world(&other);
            assert_int_equal(run(&a, 20), ASCC_OK);
            assert_int_equal(run(&b, 20), ASCC_OK);
            print_message("# %dD, spacing x %g: %.2g spacings apart\n", (int)d, other.length,
                          apart(&a, &b));
            assert_true(apart(&a, &b) < 1e-4);
            close_world(&a);
            close_world(&b);
        }
}

/* ---- Substeps ---- */

static void check_count(const scene *is, int32_t count)
{
    world w = open_world(is);
    if (run(&w, 1) != ASCC_OK)
        fail_msg("%s", ascc_step_message(w.step));
    const ascc_step_statistics s = statistics_of(&w);
    if (s.substeps != count || s.substeps_total != (uint64_t)count)
        fail_msg("%d substeps, not %d", (int)s.substeps, (int)count);
    close_world(&w);
}

static void steps_are_cut_until_time_gravity_and_ways_are_in_range(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        const scene own = {.dimension = d, .threads = 2};
        scene is = own;
        check_count(&is, 1);
        is.steps = 0.01; /* any short one */
        check_count(&is, 1);
        is.steps = 3.5;
        check_count(&is, 4);
        is = own;
        is.pull = 4.0; /* G is four times the model's */
        check_count(&is, 2);
        is.pull = 5.1; /* a quarter more than the model's is still its own */
        check_count(&is, 3);
        is.pull = 0.25;
        check_count(&is, 1);
        is = own;
        is.speed = 2.9;
        check_count(&is, 1);
        is.speed = 10.0; /* ways of at most 3 spacings */
        check_count(&is, 4);
        is = own;
        is.length = 0.5; /* half as wide: G is twice as large */
        check_count(&is, 2);
        is.length = 2.0;
        check_count(&is, 1);
    }
}

static void a_model_says_what_it_was_trained_for(void **state)
{
    (void)state;
    const scene own = {.dimension = 2,
                       .threads = 1,
                       .trained = "\"time_step_range\":[0.01,0.04],"
                                  "\"trained\":{\"gravity\":[0.01,0.09],\"way\":1.5},"};
    scene is = own;
    world w = open_world(&is);
    assert_true(w.info.gravity_min == 0.01 && w.info.gravity_max == 0.09 && w.info.way_max == 1.5);
    close_world(&w);
    check_count(&is, 1); /* 8 * 0.0004 / 0.05 = 0.064 */
    is.steps = 1.5;      /* 0.144 */
    check_count(&is, 2);
    is.steps = 0.0;
    is.speed = 2.9;
    check_count(&is, 2);
    is.speed = 0.0;
    is.pull = 0.1; /* 0.0064 */
    w = open_world(&is);
    const uint64_t hash = ascc_particles_hash(w.particles);
    assert_int_equal(run(&w, 1), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_step_message(w.step), "0.0064"));
    assert_true(ascc_particles_hash(w.particles) == hash);
    close_world(&w);
    static const char *const bad[] = {"\"trained\":{\"gravity\":[0.2,0.1]},",
                                      "\"trained\":{\"gravity\":[0,0]},",
                                      "\"trained\":{\"gravity\":[-1,1]},",
                                      "\"trained\":{\"gravity\":0.1},",
                                      "\"trained\":{\"way\":0},",
                                      "\"trained\":{\"ways\":1},",
                                      "\"trained\":[0,1],"};
    ascc_context *context;
    ascc_model *model;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        is.trained = bad[i];
        assert_int_equal(load(context, &is, &model), ASCC_ERROR_FORMAT);
    }
    ascc_context_destroy(&context);
}

/* Particles that go ten spacings a step, so many spacings from the block and from each other. */
static void add_fast(const world *w, size_t count, double from_block, double apart)
{
    const size_t d = (size_t)w->is.dimension;
    double x[70 * 3], v[70 * 3];
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++) {
            x[i * d + c] = c == 0 ? -(from_block + apart * (double)i) * spacing : 6.0 * spacing;
            v[i * d + c] = c == 1 ? -10.0 * spacing / w->info.time_step : 0.0;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE},
                           velocity = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(
        ascc_particles_add_fluid(w->particles, count, &position, &velocity, NULL, NULL), ASCC_OK);
}

static void fast_ones_that_nobody_meets_cut_no_steps(void **state)
{
    (void)state;
    static const struct {
        size_t count;
        double from_block, apart;
        int32_t substeps;
    } cases[] = {{1, 1e5, 0.0, 1}, {1, 10.0, 0.0, 4}, {2, 1e5, 10.0, 4},
                 {2, 1e5, 1e5, 1}, {64, 1e5, 1e5, 1}, {65, 1e5, 1e5, 4}};
    for (int32_t d = 2; d <= 3; d++)
        for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
            const scene is = {.dimension = d, .threads = 2};
            world w = open_world(&is), alone = open_world(&is);
            add_fast(&w, cases[k].count, cases[k].from_block, cases[k].apart);
            assert_int_equal(run(&w, 1), ASCC_OK);
            assert_int_equal(run(&alone, 1), ASCC_OK);
            if (statistics_of(&w).substeps != cases[k].substeps)
                fail_msg("case %zu: %d substeps", k, (int)statistics_of(&w).substeps);
            if (cases[k].substeps == 1) /* the block as without them, to the bit */
                assert_memory_equal(w.particles->position, alone.particles->position,
                                    alone.particles->fluid_count * (size_t)d * sizeof(double));
            close_world(&w);
            close_world(&alone);
        }
}

static void what_a_bound_forbids_is_refused_and_nothing_has_changed(void **state)
{
    (void)state;
    const struct {
        scene is;
        ascc_status status;
    } cases[] = {
        {{.pull = 4.0, .substeps = 1}, ASCC_ERROR_RANGE},
        {{.pull = 4.0, .substeps = 2}, ASCC_OK},
        {{.speed = 10.0, .substeps = 3}, ASCC_ERROR_RANGE},
        {{.speed = 10.0, .substeps = 4}, ASCC_OK},
        {{.steps = 5.0, .substeps = 4}, ASCC_ERROR_RANGE},
        {{.steps = 1001.0}, ASCC_ERROR_RANGE},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        scene is = cases[i].is;
        is.dimension = 2;
        world w = open_world(&is);
        const uint64_t hash = ascc_particles_hash(w.particles);
        assert_int_equal(run(&w, 1), cases[i].status);
        if (cases[i].status != ASCC_OK) {
            assert_non_null(strstr(ascc_step_message(w.step), "substeps"));
            assert_true(ascc_particles_hash(w.particles) == hash);
            assert_true(statistics_of(&w).substeps_total == 0);
        }
        close_world(&w);
    }
}

static void without_substeps_a_step_is_one_whatever_the_range(void **state)
{
    (void)state;
    scene is = {.dimension = 3, .threads = 1, .speed = 5.0, .pull = 6.0, .substeps = -1};
    check_count(&is, 1);
    const ascc_step_options bad = {.size = sizeof bad, .substeps = -2};
    world w = open_world(&is);
    ascc_step *step;
    assert_int_equal(ascc_step_create(w.context, w.model, &bad, &step), ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

/* The block begins a little slower than what asks for two substeps, and is pushed on. */
static void substeps_are_the_same_for_any_number_of_threads(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        uint64_t hash = 0, total = 0;
        for (int32_t threads = 1; threads <= 7; threads += 3) {
            const scene is = {.dimension = d, .threads = threads, .speed = -2.97};
            world w = open_world(&is);
            assert_int_equal(run(&w, 20), ASCC_OK);
            const ascc_step_statistics s = statistics_of(&w);
            assert_true(s.substeps_total > 20 && s.substeps_total < 40);
            if (threads > 1)
                assert_true(s.substeps_total == total && ascc_particles_hash(w.particles) == hash);
            hash = ascc_particles_hash(w.particles);
            total = s.substeps_total;
            close_world(&w);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(other_spacings_are_the_same_scene_to_the_bit_for_powers_of_two),
        cmocka_unit_test(other_spacings_are_the_same_scene_to_rounding),
        cmocka_unit_test(steps_are_cut_until_time_gravity_and_ways_are_in_range),
        cmocka_unit_test(a_model_says_what_it_was_trained_for),
        cmocka_unit_test(fast_ones_that_nobody_meets_cut_no_steps),
        cmocka_unit_test(what_a_bound_forbids_is_refused_and_nothing_has_changed),
        cmocka_unit_test(without_substeps_a_step_is_one_whatever_the_range),
        cmocka_unit_test(substeps_are_the_same_for_any_number_of_threads),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
