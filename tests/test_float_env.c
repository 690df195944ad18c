/* Tests of lib/base/float_env.c and of every call that uses it: same bits in any floating point
 * environment of the host, which is afterwards what it was. SPDX-License-Identifier: MIT */
#include "support/test.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/demo_model.h"
#include "base/float_env.h"
#include "support/float_modes.h"
#include "support/model_builder.h"

#define SPACING 0.05
#define MAX_FLUID 75
#define WALL_SIDE 9
#define STEPS 2

/* ---- A scene ------------------------------------------------------------------------------------ */

/* Made in the default environment; nothing is computed on the way from here into the library. */
typedef struct scene {
    double position[MAX_FLUID][3], velocity[MAX_FLUID][3];
    double wall[WALL_SIDE * WALL_SIDE][3], normal[WALL_SIDE * WALL_SIDE][3];
    unsigned char *model;
    size_t model_size;
} scene;

/* A block of fluid above a floor; the first particle has a subnormal height. */
static int make_scene(void **state)
{
    static const model_random network = {
        .seed = 13, .dimension = 3, .levels = 2, .channels = 8, .spacing = SPACING, .cells = 3};
    scene *const s = calloc(1, sizeof *s);
    for (int i = 0; i < MAX_FLUID; i++) {
        const int at[3] = {i % 5, i / 25, i / 5 % 5};
        for (int c = 0; c < 3; c++) {
            s->position[i][c] = (at[c] + 0.5 + 0.01 * ((i * 7 + c * 3) % 11)) * SPACING;
            s->velocity[i][c] = 0.01 * ((i * 5 + c) % 7) - 0.03;
        }
    }
    s->position[0][1] = 1e-310;
    for (int i = 0; i < WALL_SIDE * WALL_SIDE; i++) {
        s->wall[i][0] = (i % WALL_SIDE - 1) * 0.64 * SPACING;
        s->wall[i][1] = -0.25 * SPACING;
        s->wall[i][2] = (i / WALL_SIDE - 1) * 0.64 * SPACING;
        s->normal[i][1] = 1.0;
    }
    s->model = model_builder_random(&network, &s->model_size);
    *state = s;
    return 0;
}

static int free_scene(void **state)
{
    free(((scene *)*state)->model);
    free(*state);
    return 0;
}

/* ---- A host whose job system has threads of every kind ------------------------------------------- */

#define TASKS 4

typedef struct host {
    ascc_task task;
    void *work;
    atomic_int next_mode, faults;
    pthread_t thread[TASKS];
    struct host_call {
        struct host *host;
        int32_t index;
    } call[TASKS];
} host;

static void *call_task(void *argument)
{
    const struct host_call *const call = argument;
    const int mode = atomic_fetch_add(&call->host->next_mode, 1) % (int)FLOAT_MODE_COUNT;
    float_state_set(float_modes[mode].state);
    call->host->task(call->host->work, call->index);
    if (float_state() != float_modes[mode].state)
        atomic_fetch_add(&call->host->faults, 1);
    return NULL;
}

static void *enqueue(void *user, ascc_task task, void *work, int32_t count)
{
    host *const self = user;
    if (count != TASKS)
        abort();
    self->task = task;
    self->work = work;
    for (int32_t i = 0; i < count; i++) {
        self->call[i] = (struct host_call){self, i};
        if (pthread_create(&self->thread[i], NULL, call_task, &self->call[i]) != 0)
            abort();
    }
    return self;
}

static void finish(void *user, void *token)
{
    (void)user;
    for (int i = 0; i < TASKS; i++)
        pthread_join(((host *)token)->thread[i], NULL);
}

/* ---- Same bits ----------------------------------------------------------------------------------- */

typedef struct setting {
    int32_t threads;
    bool hosted;
    uint32_t cpu_disable;
} setting;

static const setting settings[] = {
    {1, false, 0},
    {1, false, ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128},
    {2, false, 0},
    {TASKS, true, 0},
};

/* Hash of a run: all handles made and filled in one environment, the steps taken in another. */
static uint64_t run_scene(const scene *s, size_t fluid, const setting *with, uint64_t creation,
                          uint64_t run)
{
    host user = {0};
    const ascc_context_options context_options = {.size = sizeof context_options,
                                                  .thread_count = with->threads,
                                                  .cpu_disable = with->cpu_disable,
                                                  .enqueue = with->hosted ? enqueue : NULL,
                                                  .finish = with->hosted ? finish : NULL,
                                                  .user = &user};
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = SPACING, .mass = 0.125};
    const ascc_const_array position = {.data = s->position, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = s->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = s->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = s->normal, .scalar = ASCC_DOUBLE};
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    ascc_measures measures = {.size = sizeof measures};
    int failures = 0;

    float_state_set(creation);
    failures += ascc_context_create(&context_options, &context) != ASCC_OK;
    failures += ascc_model_load_memory(context, s->model, s->model_size, &model) != ASCC_OK;
    failures += ascc_particles_create(context, &options, &particles) != ASCC_OK;
    failures += ascc_particles_add_fluid(particles, fluid, &position, &velocity, NULL, NULL) != 0;
    failures += ascc_particles_add_boundary(particles, COUNT_OF(s->wall), &wall, &normal, 0, NULL);
    failures += ascc_step_create(context, model, NULL, &step) != ASCC_OK;
    float_state_set(run);
    uint64_t hash = ascc_particles_hash(particles);
    failures += ascc_step_run(step, particles, NULL, STEPS) != ASCC_OK;
    failures += ascc_particles_measure(particles, &measures) != ASCC_OK;
    hash = hash * 31 + ascc_particles_hash(particles);
    const uint64_t after = float_state();
    float_state_set(FLOAT_DEFAULT);

    /* Sums of the measures may lie between floats: their bits count. */
    uint64_t energy;
    memcpy(&energy, &measures.kinetic_energy, sizeof energy);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    assert_int_equal(failures, 0);
    assert_int_equal(atomic_load(&user.faults), 0);
    assert_true(after == run);
    return hash * 31 + energy;
}

static void the_hosts_environment_does_not_change_a_bit(void **state)
{
    static const size_t counts[] = {1, 7, 8, 9, 17, MAX_FLUID};
    const scene *const s = *state;
    for (size_t n = 0; n < COUNT_OF(counts); n++) {
        const uint64_t right = run_scene(s, counts[n], &settings[0], FLOAT_DEFAULT, FLOAT_DEFAULT);
        for (size_t k = 0; k < COUNT_OF(settings); k++)
            for (size_t m = 0; m < FLOAT_MODE_COUNT; m++) {
                const uint64_t mode = float_modes[m].state, none = FLOAT_DEFAULT;
                const bool threads = settings[k].threads > 1; /* that begin in one or the other */
                const uint64_t both = run_scene(s, counts[n], &settings[k], mode, mode);
                const uint64_t made =
                    threads ? run_scene(s, counts[n], &settings[k], mode, none) : right;
                const uint64_t ran =
                    threads ? run_scene(s, counts[n], &settings[k], none, mode) : right;
                if (both != right || made != right || ran != right)
                    fail_msg("%s: %zu particles, setting %zu: other bits%s%s%s",
                             float_modes[m].name, counts[n], k, both != right ? ", whole" : "",
                             made != right ? ", creation" : "", ran != right ? ", run" : "");
            }
    }
}

/* ---- A walk through the whole API ---------------------------------------------------------------- */

static const float_mode *present; /* of the walk */
static char called[16384];        /* names, each with a space before and behind */

static void enter(void)
{
    float_state_set(present->state);
}

/* Whether the call left the environment as it was; notes its name. */
static void leave(const char *call)
{
    const uint64_t after = float_state();
    float_state_set(FLOAT_DEFAULT);
    const char *const name = strstr(call, "ascc_");
    const int length = (int)strcspn(name, "(");
    if (after != present->state)
        fail_msg("%.*s in '%s' leaves %llx, not %llx", length, name, present->name,
                 (unsigned long long)after, (unsigned long long)present->state);
    const size_t used = strlen(called);
    assert_true(used + (size_t)length + 3 < sizeof called);
    (void)snprintf(called + used, sizeof called - used, " %.*s ", length, name);
}

/* A call in the present environment: DO(result = ascc_...(...)). */
#define DO(call)                                                                                   \
    do {                                                                                           \
        enter();                                                                                   \
        call;                                                                                      \
        leave(#call);                                                                              \
    } while (0)

/* The same, and it succeeds. */
#define GOOD(call)                                                                                 \
    do {                                                                                           \
        ascc_status result_;                                                                       \
        DO(result_ = call);                                                                        \
        assert_int_equal(result_, ASCC_OK);                                                        \
    } while (0)

#define BAD(call)                                                                                  \
    do {                                                                                           \
        ascc_status result_;                                                                       \
        DO(result_ = call);                                                                        \
        assert_int_not_equal(result_, ASCC_OK);                                                    \
    } while (0)

static void walk_models(ascc_context *context, const scene *s, ascc_model **model)
{
    char path[] = "/tmp/ascc-float-env-XXXXXX", found[4096];
    const int file = mkstemp(path);
    assert_true(file >= 0);
    ascc_model_info info = {.size = sizeof info};
    ascc_particles_options options = {.size = sizeof options};
    size_t size;
    const void *bytes;
    GOOD(ascc_model_load_memory(context, s->model, s->model_size, model));
    BAD(ascc_model_load_memory(context, s->model, s->model_size / 2, &(ascc_model *){NULL}));
    GOOD(ascc_model_save(*model, path));
    DO(ascc_model_destroy(model));
    GOOD(ascc_model_find(context, path, found, sizeof found));
    BAD(ascc_model_find(context, "no model of this name", found, sizeof found));
    GOOD(ascc_model_load(context, path, model));
    remove(path);
    BAD(ascc_model_load(context, path, &(ascc_model *){NULL}));
    GOOD(ascc_model_get_info(*model, &info));
    GOOD(ascc_model_particles_options(*model, 0, &options));
    DO(bytes = ascc_model_bytes(*model, &size));
    assert_memory_equal(bytes, s->model, s->model_size);
}

static void walk_changes(ascc_particles *particles, const scene *s)
{
    const ascc_const_array position = {.data = s->position, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = s->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = s->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = s->normal, .scalar = ASCC_DOUBLE};
    const uint64_t none = UINT64_MAX;
    uint64_t id[MAX_FLUID];
    GOOD(ascc_particles_reserve(particles, 10, 10));
    GOOD(ascc_particles_add_fluid(particles, 50, &position, &velocity, NULL, id));
    GOOD(ascc_particles_add_boundary(particles, COUNT_OF(s->wall), &wall, &normal, 3, NULL));
    BAD(ascc_particles_add_boundary(particles, 1, &wall, &wall, 3, NULL));
    GOOD(ascc_particles_remove(particles, 2, id));
    BAD(ascc_particles_remove(particles, 1, &none));
    GOOD(ascc_particles_resize_fluid(particles, 55));
    GOOD(ascc_particles_set(particles, ASCC_FLUID, ASCC_POSITION, 0, 55, &position));
    GOOD(ascc_particles_set(particles, ASCC_FLUID, ASCC_VELOCITY, 0, 55, &velocity));
    GOOD(ascc_particles_set(particles, ASCC_BOUNDARY, ASCC_NORMAL, 0, 9, &normal));
    BAD(ascc_particles_set(particles, ASCC_FLUID, ASCC_MASS, 0, 9, &velocity));
}

/* A body and a tap come, move and go: the set is as before in all that others look at. */
static void walk_bodies(ascc_particles *particles)
{
    const ascc_shape ball = {
        .size = sizeof ball, .kind = ASCC_SHAPE_SPHERE, .radius = 2.3 * SPACING};
    const ascc_pose pose = {
        .size = sizeof pose, .position = {9.0, 9.0, 9.0}, .spin = {0.1, 0.2, 1e-310}};
    const ascc_drain drain = {.size = sizeof drain,
                              .kind = ASCC_DRAIN_SPHERE,
                              .position = {3.0, 3.0, 3.0},
                              .radius = 4.0 * SPACING};
    ascc_tap tap = {.size = sizeof tap,
                    .position = {3.0, 3.0, 3.0},
                    .radius = 1.2 * SPACING,
                    .velocity = {0.0, -1.0, 0.1}};
    ascc_body_info info = {.size = sizeof info};
    int32_t body = -1;
    int64_t impulse[1][3];
    double torque[1][3];
    size_t count;
    GOOD(ascc_body_add(particles, &ball, &pose, &body));
    BAD(ascc_body_add(particles, &ball, &(ascc_pose){0}, &(int32_t){0}));
    GOOD(ascc_body_move(particles, body, &pose));
    BAD(ascc_body_move(particles, body + 1, &pose));
    GOOD(ascc_body_get(particles, body, &info));
    BAD(ascc_body_get(particles, body + 1, &info));
    DO(count = ascc_bodies_list(particles, 1, &body));
    assert_int_equal(count, 1);
    GOOD(ascc_bodies_impulse(particles, 1, &body, impulse, torque));
    GOOD(ascc_body_remove(particles, body));
    BAD(ascc_body_remove(particles, body));
    GOOD(ascc_tap_run(particles, &tap, 0.1, 0, NULL, &count));
    assert_true(count > 0);
    tap.radius = -1.0;
    BAD(ascc_tap_run(particles, &tap, 0.1, 0, NULL, &count));
    GOOD(ascc_drain_run(particles, &drain, 0, NULL, &count));
    assert_true(count > 0);
    BAD(ascc_drain_run(particles, &(ascc_drain){0}, 0, NULL, &count));
}

static void walk_sleep(ascc_particles *particles)
{
    uint8_t asleep[MAX_FLUID];
    GOOD(ascc_particles_get_asleep(particles, 0, 55, asleep));
    BAD(ascc_particles_get_asleep(particles, 50, 55, asleep));
    GOOD(ascc_particles_wake(particles));
}

static void walk_ladder(ascc_context *context, const ascc_model *model, ascc_particles *particles)
{
    const ascc_model *const models[] = {model, model};
    const int32_t rungs[] = {1, 0}, none[] = {2};
    ascc_ladder_statistics statistics = {.size = sizeof statistics};
    ascc_ladder *ladder;
    const ascc_step *step;
    const char *message;
    int32_t chosen[3];
    uint64_t steps;
    size_t size;
    GOOD(ascc_ladder_create(context, 2, models, NULL, &ladder));
    BAD(ascc_ladder_create(context, 0, models, NULL, &(ascc_ladder *){NULL}));
    GOOD(ascc_ladder_set_budget(ladder, 1.0));
    BAD(ascc_ladder_set_budget(ladder, -1.0));
    GOOD(ascc_ladder_measure(ladder, particles, NULL));
    GOOD(ascc_ladder_run(ladder, particles, NULL, 1));
    GOOD(ascc_ladder_replay(ladder, particles, NULL, rungs, 2));
    BAD(ascc_ladder_replay(ladder, particles, NULL, none, 1));
    GOOD(ascc_ladder_get_statistics(ladder, &statistics));
    DO(step = ascc_ladder_step(ladder, 1));
    assert_non_null(step);
    DO(steps = ascc_ladder_step_count(ladder));
    assert_int_equal(steps, 3);
    GOOD(ascc_ladder_get_choices(ladder, 0, 3, chosen));
    BAD(ascc_ladder_get_choices(ladder, 1, 3, chosen));
    DO(size = ascc_ladder_snapshot_size(ladder));
    void *const memory = malloc(size);
    GOOD(ascc_ladder_snapshot(ladder, memory, size));
    GOOD(ascc_ladder_restore(ladder, memory, size));
    BAD(ascc_ladder_restore(ladder, memory, size - 1));
    free(memory);
    DO(message = ascc_ladder_message(ladder));
    assert_true(message[0] != '\0');
    DO(ascc_ladder_destroy(&ladder));
}

static void walk_readings(ascc_particles *particles)
{
    double values[3 * MAX_FLUID], torque[3], quantum;
    const double point[3] = {0.1, 1e-310, 0.3};
    const ascc_array array = {.data = values, .scalar = ASCC_DOUBLE};
    const ascc_array floats = {.data = values, .scalar = ASCC_FLOAT};
    int64_t quanta[3 * MAX_FLUID];
    uint64_t id[MAX_FLUID], hash;
    int32_t body[9], dimension;
    ascc_kind kind;
    size_t row, count;
    const char *message;
    ascc_measures measures = {.size = sizeof measures};
    DO(count = ascc_particles_count(particles, ASCC_FLUID));
    assert_int_equal(count, 55);
    DO(count = ascc_particles_capacity(particles, ASCC_FLUID));
    assert_true(count >= 55);
    DO(dimension = ascc_particles_dimension(particles));
    assert_int_equal(dimension, 3);
    DO(quantum = ascc_particles_momentum_quantum(particles));
    assert_true(quantum > 0);
    GOOD(ascc_particles_get(particles, ASCC_FLUID, ASCC_VELOCITY, 0, 55, &array));
    GOOD(ascc_particles_get(particles, ASCC_FLUID, ASCC_POSITION, 0, 55, &floats));
    GOOD(ascc_particles_get_ids(particles, ASCC_FLUID, 0, 55, id));
    GOOD(ascc_particles_get_bodies(particles, 0, 9, body));
    GOOD(ascc_particles_find(particles, id[7], &kind, &row));
    assert_int_equal(row, 7);
    GOOD(ascc_particles_get_momentum(particles, 0, 55, quanta));
    GOOD(ascc_particles_total_momentum(particles, quanta));
    GOOD(ascc_particles_body_impulse(particles, 3, point, quanta, torque));
    GOOD(ascc_particles_measure(particles, &measures));
    DO(hash = ascc_particles_hash(particles));
    assert_true(hash != 0);
    DO(message = ascc_particles_message(particles));
    assert_non_null(message);
}

static void walk_snapshots(ascc_particles *particles)
{
    size_t size;
    DO(size = ascc_particles_snapshot_size(particles));
    void *const memory = malloc(size);
    GOOD(ascc_particles_snapshot(particles, memory, size));
    GOOD(ascc_particles_restore(particles, memory, size));
    BAD(ascc_particles_restore(particles, memory, size - 8));
    free(memory);
    GOOD(ascc_particles_clear(particles, ASCC_BOUNDARY));
}

static void walk_steps(ascc_context *context, const ascc_model *model, ascc_particles *particles)
{
    const double gravity[3] = {0.3, -9.81, 1e-310};
    const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    ascc_step_statistics statistics = {.size = sizeof statistics};
    ascc_step *step;
    size_t size;
    const char *message;
    const ascc_step_options measured = {.size = sizeof measured, .measure_distance = 1};
    GOOD(ascc_step_create(context, model, &measured, &step));
    BAD(ascc_step_create(context, NULL, NULL, &(ascc_step *){NULL}));
    DO(size = ascc_step_estimate(step, 1000, 1000));
    assert_true(size > 0);
    GOOD(ascc_step_reserve(step, 100, 100));
    GOOD(ascc_step_run(step, particles, &forces, 2));
    BAD(ascc_step_run(step, NULL, &forces, 2));
    GOOD(ascc_step_get_statistics(step, &statistics));
    DO(message = ascc_step_message(step));
    assert_non_null(message);
    DO(ascc_step_destroy(&step));
}

/* Names of tests/exports.txt that the walk did not call. */
static int count_not_called(void)
{
    FILE *const file = fopen(SOURCE_ROOT "/tests/exports.txt", "r");
    assert_non_null(file);
    int missing = 0;
    char name[128], spaced[131];
    while (fscanf(file, "%127s", name) == 1) {
        (void)snprintf(spaced, sizeof spaced, " %s ", name);
        if (strstr(called, spaced) == NULL) {
            print_message("not called: %s\n", name);
            missing++;
        }
    }
    (void)fclose(file);
    return missing;
}

static void every_call_leaves_the_environment_as_it_was(void **state)
{
    const scene *const s = *state;
    for (size_t m = 0; m < FLOAT_MODE_COUNT; m++) {
        present = &float_modes[m];
        called[0] = '\0';
        const ascc_context_options context_options = {.size = sizeof context_options,
                                                      .thread_count = 2};
        const ascc_particles_options options = {
            .size = sizeof options, .dimension = 3, .spacing = SPACING, .mass = 0.125};
        ascc_context *context;
        ascc_model *model;
        ascc_particles *particles;
        char text[64];
        const char *words;
        int32_t version;
        size_t length;
        uint32_t cpu;
        DO(version = ascc_version());
        assert_true(version > 0);
        DO(words = ascc_status_text(ASCC_OK));
        assert_non_null(words);
        GOOD(ascc_context_create(&context_options, &context));
        DO(cpu = ascc_context_cpu(context));
        (void)cpu;
        GOOD(ascc_particles_create(context, &options, &particles));
        BAD(ascc_particles_create(context, NULL, &(ascc_particles *){NULL}));
        DO(length = ascc_context_message(context, text, sizeof text));
        assert_true(length > 0);
        walk_models(context, s, &model);
        walk_changes(particles, s);
        walk_steps(context, model, particles);
        walk_ladder(context, model, particles);
        walk_bodies(particles);
        walk_sleep(particles);
        walk_readings(particles);
        walk_snapshots(particles);
        DO(ascc_particles_destroy(&particles));
        DO(ascc_model_destroy(&model));
        DO(ascc_context_destroy(&context));
        assert_int_equal(count_not_called(), 0);
    }
}

/* ---- The scope itself ---------------------------------------------------------------------------- */

/* Raises exceptions, and leaves by a return in the middle. */
static double divide(const volatile double *a, const volatile double *b, uint64_t *inside)
{
    ASCC_FLOAT_SCOPE;
    *inside = float_state();
    if (*b == 0.0)
        return *a / *b;
    return *a / *b * 3.0;
}

/* What is inside has modes of its own, and pending exceptions that nobody looks at. */
static void a_scope_is_the_default_environment_and_ends_at_any_return(void **state)
{
    (void)state;
    float_state_set(FLOAT_DEFAULT);
    uint64_t inside;
    const volatile double one = 1.0, zero = 0.0, seven = 7.0;
    (void)divide(&one, &zero, &inside);
    assert_true(float_state() == FLOAT_DEFAULT);
    for (size_t m = 0; m < FLOAT_MODE_COUNT; m++) {
        float_state_set(float_modes[m].state);
        (void)divide(&one, &zero, &inside);
        (void)divide(&one, &seven, &inside);
        const uint64_t after = float_state();
        float_state_set(inside);
        const volatile double third = one / 3.0, product = third * 3.0, tiny = 1e-310 * 0.5;
        float_state_set(FLOAT_DEFAULT);
        assert_true(after == float_modes[m].state);
        assert_true(third == 1.0 / 3.0 && product == 1.0 && tiny > 0.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scope_is_the_default_environment_and_ends_at_any_return),
        cmocka_unit_test(the_hosts_environment_does_not_change_a_bit),
        cmocka_unit_test(every_call_leaves_the_environment_as_it_was),
    };
    return cmocka_run_group_tests_name("float_env", tests, make_scene, free_scene);
}
