/* Particles far from the rest: they fall freely, and the rest has the bits it has without them.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05
#define STEPS 4
#define MOST 400

static const double down[3] = {0.0, -9.81, 0.0};

typedef struct stray {
    double at[3];
} stray;

typedef struct scene {
    int dimension, threads;
    const stray *strays;
    size_t stray_count;
    bool as_walls; /* the strays are wall points */
} scene;

/* What a run leaves of the fluid, the strays last. */
typedef struct result {
    size_t count;
    double position[MOST * 3];
    int64_t momentum[MOST * 3];
    double quantum, time_step;
} result;

/* A jittered block over a floor. */
static size_t block(int dimension, double spacing, double *x)
{
    dice d = {91};
    const int side = dimension == 2 ? 12 : 6;
    size_t n = 0;
    for (int k = 0; k < (dimension == 2 ? 1 : side); k++)
        for (int j = 0; j < side; j++)
            for (int i = 0; i < side; i++, n++) {
                const int at[3] = {i, j, k};
                for (int c = 0; c < dimension; c++)
                    x[n * (size_t)dimension + (size_t)c] =
                        (at[c] + dice_uniform(&d, -0.1, 0.1)) * spacing;
            }
    return n;
}

static size_t floor_below(int dimension, double spacing, double *x)
{
    size_t n = 0;
    for (int k = 0; k < (dimension == 2 ? 1 : 14); k++)
        for (int i = 0; i < 14; i++, n++) {
            const double at[3] = {(i - 2) * 0.64 * spacing, -0.7 * spacing,
                                  (k - 2) * 0.64 * spacing};
            memcpy(x + n * (size_t)dimension, at, (size_t)dimension * sizeof *x);
        }
    return n;
}

static size_t add_strays(const scene *s, double *x, size_t n)
{
    for (size_t i = 0; i < s->stray_count; i++, n++)
        memcpy(x + n * (size_t)s->dimension, s->strays[i].at, (size_t)s->dimension * sizeof *x);
    return n;
}

static ascc_particles *make_particles(ascc_context *context, double spacing, const scene *s)
{
    double fluid[MOST * 3], wall[MOST * 3], normal[MOST * 3] = {0};
    size_t n = block(s->dimension, spacing, fluid),
           walls = floor_below(s->dimension, spacing, wall);
    if (s->as_walls)
        walls = add_strays(s, wall, walls);
    else
        n = add_strays(s, fluid, n);
    for (size_t i = 0; i < walls; i++)
        normal[i * (size_t)s->dimension + 1] = 1.0;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = s->dimension, .spacing = spacing, .mass = 0.125};
    const ascc_const_array x = {.data = fluid, .scalar = ASCC_DOUBLE},
                           w = {.data = wall, .scalar = ASCC_DOUBLE},
                           normals = {.data = normal, .scalar = ASCC_DOUBLE};
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, n, &x, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, walls, &w, &normals, 0, NULL), ASCC_OK);
    return p;
}

static void run(result *r, const unsigned char *model, size_t size, const scene *s)
{
    const ascc_context_options options = {.size = sizeof options, .thread_count = s->threads};
    ascc_context *context;
    ascc_model *m;
    ascc_step *step;
    memset(r, 0, sizeof *r);
    assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, model, size, &m), ASCC_OK);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(m, &info), ASCC_OK);
    ascc_particles *p = make_particles(context, info.particle_spacing, s);
    const ascc_step_options whole = {.size = sizeof whole,
                                     .substeps = -1}; /* whose fall is known */
    assert_int_equal(ascc_step_create(context, m, &whole, &step), ASCC_OK);
    const ascc_forces forces = {.size = sizeof forces, .gravity = down};
    if (ascc_step_run(step, p, &forces, STEPS) != ASCC_OK)
        fail_msg("step: %s", ascc_step_message(step));
    r->time_step = info.time_step;
    r->quantum = ascc_particles_momentum_quantum(p);
    r->count = ascc_particles_count(p, ASCC_FLUID);
    const ascc_array x = {.data = r->position, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(p, ASCC_FLUID, ASCC_POSITION, 0, r->count, &x), ASCC_OK);
    assert_int_equal(ascc_particles_get_momentum(p, 0, r->count, r->momentum), ASCC_OK);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&m);
    ascc_context_destroy(&context);
}

/* Strays far away on each axis and side alone, then two on all axes at once. */
static size_t place_strays(stray *strays, int dimension, double far)
{
    size_t n = 0;
    for (int c = 0; c < dimension; c++)
        for (int side = -1; side <= 1; side += 2, n++)
            for (int k = 0; k < 3; k++)
                strays[n].at[k] = k == c ? side * far : 0.1;
    for (int side = -1; side <= 1; side += 2, n++)
        for (int k = 0; k < 3; k++)
            strays[n].at[k] = side * far * (1.0 + 0.1 * k);
    return n;
}

/* p = m g t to a quantum a step, x as an integrator that moves by the new velocity has it. */
static void check_fall(const result *r, int dimension, size_t row, const stray *from)
{
    const size_t at = row * (size_t)dimension;
    const double fallen = -9.81 * r->time_step * r->time_step * STEPS * (STEPS + 1) / 2.0;
    for (int c = 0; c < dimension; c++) {
        const double p = c == 1 ? 0.125 * -9.81 * r->time_step * STEPS : 0.0;
        assert_true(fabs((double)r->momentum[at + (size_t)c] * r->quantum - p) <=
                    (c == 1 ? STEPS * r->quantum : 0.0));
        assert_true(fabs(r->position[at + (size_t)c] - from->at[c] - (c == 1 ? fallen : 0.0)) <
                    1e-9 + STEPS * 2.3e-16 * fabs(from->at[c]));
    }
}

/* same: the others' bits must be theirs without strays. falls: a particle alone feels gravity only. */
static void check_strays(const unsigned char *model, size_t size, int dimension, bool same,
                         bool falls)
{
    static result alone, with;
    scene s = {.dimension = dimension, .threads = 1};
    run(&alone, model, size, &s);
    stray strays[8];
    s.strays = strays;
    for (int variant = 0; variant < 6; variant++) {
        s.threads = variant % 2 ? 3 : 1;
        s.as_walls = variant >= 4;
        s.stray_count = place_strays(strays, dimension, variant % 4 < 2 ? 1e6 : 1e9);
        run(&with, model, size, &s);
        assert_int_equal(with.count, alone.count + (s.as_walls ? 0 : s.stray_count));
        const size_t numbers = alone.count * (size_t)dimension;
        if (same) {
            assert_memory_equal(with.position, alone.position, numbers * sizeof(double));
            assert_memory_equal(with.momentum, alone.momentum, numbers * sizeof(int64_t));
        }
        for (size_t i = 0; falls && !s.as_walls && i < s.stray_count; i++)
            check_fall(&with, dimension, alone.count + i, &strays[i]);
    }
}

static void check_random(const model_random *options, bool same, bool falls)
{
    size_t size;
    unsigned char *bytes = model_builder_random(options, &size);
    check_strays(bytes, size, options->dimension, same, falls);
    free(bytes);
}

static void strays_fall_and_leave_the_others_with_every_sampling(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++)
        for (int method = 0; method < 3; method++)
            for (int basis = 0; basis < 3; basis++) {
                const model_random r = {.seed = 5,
                                        .dimension = dimension,
                                        .levels = basis == 2 ? 4 : 2,
                                        .method = method ? "voxel_corners" : "voxel_centers",
                                        .no_hysteresis = method == 1,
                                        .bumps = basis ? 3 : 0,
                                        .order = 1,
                                        .transfer = method == 1 ? basis : 0};
                check_random(&r, true, true);
            }
}

static void strays_leave_the_others_with_a_plain_last_layer(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++) {
        const model_random r = {.seed = 6, .dimension = dimension, .levels = 2, .plain = 1};
        check_random(&r, true, false);
    }
}

/* Where each particle has a say in where the coarse points are, the others' bits may change. */
static void strays_fall_where_coarse_points_depend_on_all_particles(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++) {
        model_random r = {.seed = 7, .dimension = dimension, .levels = 3, .method = "farthest"};
        check_random(&r, false, true);
        r.method = "voxel_corners";
        r.anchor = "centroid";
        check_random(&r, false, true);
    }
}

static unsigned char *shipped(const char *name, size_t *size)
{
    char path[1024];
    snprintf(path, sizeof path, "%s/examples/models/%s.safetensors", SOURCE_ROOT, name);
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    const size_t room = (size_t)1 << 22;
    unsigned char *bytes = malloc(room);
    *size = fread(bytes, 1, room, f);
    assert_true(*size < room);
    fclose(f);
    return bytes;
}

/* A trunk whose levels have no corner, then those of one particle. */
static void a_lattice_without_fluid_steps_and_one_of_a_particle_lets_it_fall(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = shipped("water3d", &size);
    const double high[3] = {1.0, 5.0, 1.0};
    const ascc_const_array at = {.data = high, .scalar = ASCC_DOUBLE};
    const scene s = {.dimension = 3};
    double velocity[3];
    const ascc_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    ascc_particles *p = make_particles(context, info.particle_spacing, &s);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, p, NULL, 1), ASCC_OK);
    assert_int_equal(ascc_particles_clear(p, ASCC_FLUID), ASCC_OK);
    assert_int_equal(ascc_step_run(step, p, NULL, 2), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, 1, &at, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_step_run(step, p, NULL, 2), ASCC_OK);
    assert_int_equal(ascc_particles_get(p, ASCC_FLUID, ASCC_VELOCITY, 0, 1, &v), ASCC_OK);
    assert_true(velocity[0] == 0.0 && velocity[2] == 0.0);
    assert_true(fabs(velocity[1] + 2.0 * 9.81 * info.time_step) < 1e-9); /* quanta */
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(bytes);
}

static void strays_fall_and_leave_the_others_with_the_projects_networks(void **state)
{
    (void)state;
    static const char *const names[] = {"water2d", "water2d-tiny", "water3d", "water3d-tiny"};
    for (int i = 0; i < 4; i++) {
        size_t size;
        unsigned char *bytes = shipped(names[i], &size);
        check_strays(bytes, size, i < 2 ? 2 : 3, true, true);
        free(bytes);
    }
}

static void a_steady_step_with_strays_allocates_nothing(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++) {
        size_t size;
        const model_random r = {.seed = 8, .dimension = dimension, .levels = 3};
        unsigned char *bytes = model_builder_random(&r, &size);
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        ascc_context *context;
        ascc_model *model;
        ascc_step *step;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
        stray strays[8];
        const scene s = {.dimension = dimension,
                         .strays = strays,
                         .stray_count = place_strays(strays, dimension, 1e9)};
        ascc_particles *p = make_particles(context, SPACING, &s);
        assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
        assert_int_equal(ascc_step_run(step, p, NULL, 3), ASCC_OK);
        const size_t calls = memory.calls;
        assert_int_equal(ascc_step_run(step, p, NULL, 3), ASCC_OK);
        assert_int_equal(memory.calls, calls);
        ascc_step_destroy(&step);
        ascc_particles_destroy(&p);
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
        assert_true(test_memory_is_clean(&memory));
        free(bytes);
    }
}

static void a_stray_beyond_all_numbers_is_named_and_nothing_moves(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_demo(3, SPACING, &size);
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    const stray one = {{0.0, 1e10, 0.0}};
    const scene s = {.dimension = 3, .strays = &one, .stray_count = 1};
    ascc_particles *p = make_particles(context, SPACING, &s);
    const uint64_t hash = ascc_particles_hash(p);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, p, NULL, 1), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_step_message(step), "fluid row 216 is too far from the origin"));
    assert_true(ascc_particles_hash(p) == hash);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(strays_fall_and_leave_the_others_with_every_sampling),
        cmocka_unit_test(strays_leave_the_others_with_a_plain_last_layer),
        cmocka_unit_test(strays_fall_where_coarse_points_depend_on_all_particles),
        cmocka_unit_test(strays_fall_and_leave_the_others_with_the_projects_networks),
        cmocka_unit_test(a_lattice_without_fluid_steps_and_one_of_a_particle_lets_it_fall),
        cmocka_unit_test(a_steady_step_with_strays_allocates_nothing),
        cmocka_unit_test(a_stray_beyond_all_numbers_is_named_and_nothing_moves),
    };
    return cmocka_run_group_tests_name("strays", tests, NULL, NULL);
}
