/* Tests of particle sets: what a set holds, refuses, forgets and remembers.
 * SPDX-License-Identifier: MIT */
#include "support/test.h"

#include "support/counting.h"
#include "points/particles.h"
#include "support/random.h"

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Fixture --------------------------------------------------------------------------------- */

/* A context on counting memory and a set in it. */
typedef struct fixture {
    test_memory memory; /* first: the user pointer serves both */
    int lines;
    ascc_context *context;
    ascc_particles *set;
} fixture;

static void count_line(void *user, const char *line)
{
    fixture *const self = user;
    self->lines += line[0] != '\0' && strchr(line, '\n') == NULL;
}

static fixture *open_fixture(int32_t dimension)
{
    fixture *const self = calloc(1, sizeof *self);
    ascc_context_options options = test_memory_options(&self->memory);
    options.log = count_line;
    options.user = self;
    const ascc_particles_options set = {
        .size = sizeof set, .dimension = dimension, .spacing = 0.1, .mass = 2};
    assert_int_equal(ascc_context_create(&options, &self->context), ASCC_OK);
    assert_int_equal(ascc_particles_create(self->context, &set, &self->set), ASCC_OK);
    return self;
}

static int open_2d(void **state)
{
    *state = open_fixture(2);
    return 0;
}

static int open_3d(void **state)
{
    *state = open_fixture(3);
    return 0;
}

static int close_fixture(void **state)
{
    fixture *const self = *state;
    ascc_particles_destroy(&self->set);
    ascc_context_destroy(&self->context);
    const bool clean = test_memory_is_clean(&self->memory);
    free(self);
    return clean ? 0 : -1;
}

/* ---- Helpers --------------------------------------------------------------------------------- */

static ascc_const_array doubles(const double *values)
{
    return (ascc_const_array){.data = values, .scalar = ASCC_DOUBLE};
}

static ascc_array into_doubles(double *values)
{
    return (ascc_array){.data = values, .scalar = ASCC_DOUBLE};
}

/* All bytes of the state, and the capacities, for "nothing changed". */
typedef struct picture {
    unsigned char *bytes;
    size_t size, fluid_capacity, boundary_capacity;
} picture;

static picture take_picture(const ascc_particles *set)
{
    picture taken = {.size = ascc_particles_snapshot_size(set),
                     .fluid_capacity = ascc_particles_capacity(set, ASCC_FLUID),
                     .boundary_capacity = ascc_particles_capacity(set, ASCC_BOUNDARY)};
    taken.bytes = malloc(taken.size);
    assert_int_equal(ascc_particles_snapshot(set, taken.bytes, taken.size), ASCC_OK);
    return taken;
}

/* Compares and frees. */
static void assert_same_picture(const ascc_particles *set, picture before)
{
    const picture now = take_picture(set);
    assert_int_equal(now.size, before.size);
    assert_memory_equal(now.bytes, before.bytes, now.size);
    assert_int_equal(now.fluid_capacity, before.fluid_capacity);
    assert_int_equal(now.boundary_capacity, before.boundary_capacity);
    free(now.bytes);
    free(before.bytes);
}

/* The call failed as it should, and its line names what is wrong. */
static void assert_refused(fixture *self, ascc_status status, ascc_status expected,
                           const char *part)
{
    assert_int_equal(status, expected);
    if (strstr(ascc_particles_message(self->set), part) == NULL)
        fail_msg("'%s' does not name '%s'", ascc_particles_message(self->set), part);
}

/* The context's line names what is wrong. */
static void assert_context_names(fixture *self, const char *part)
{
    char text[ASCC_MESSAGE_CAPACITY];
    ascc_context_message(self->context, text, sizeof text);
    if (strstr(text, part) == NULL)
        fail_msg("'%s' does not name '%s'", text, part);
}

/* A reader failed as it should: its line is the context's, and the set's is as before. */
static void assert_reader_refused(fixture *self, ascc_status status, ascc_status expected,
                                  const char *part)
{
    assert_int_equal(status, expected);
    assert_context_names(self, part);
}

/* Adds some fluid and two bodies with momenta, masses and wall impulses all over. */
static void add_scene(ascc_particles *set, uint64_t seed, size_t fluid, size_t boundary)
{
    test_random random = {seed};
    const size_t d = (size_t)ascc_particles_dimension(set);
    for (size_t i = 0; i < fluid; i++) {
        double position[3], velocity[3], mass = test_random_between(&random, 0.5, 2);
        for (size_t c = 0; c < d; c++) {
            position[c] = test_random_between(&random, -10, 10);
            velocity[c] = test_random_between(&random, -3, 3);
        }
        const ascc_const_array p = doubles(position), v = doubles(velocity), m = doubles(&mass);
        assert_int_equal(ascc_particles_add_fluid(set, 1, &p, &v, &m, NULL), ASCC_OK);
    }
    for (size_t i = 0; i < boundary; i++) {
        double position[3], normal[3] = {0};
        for (size_t c = 0; c < d; c++)
            position[c] = test_random_between(&random, -10, 10);
        normal[i % d] = i % 2 ? -1 : 1;
        const ascc_const_array p = doubles(position), n = doubles(normal);
        assert_int_equal(ascc_particles_add_boundary(set, 1, &p, &n, (int32_t)(i % 2), NULL),
                         ASCC_OK);
        for (size_t c = 0; c < d; c++)
            set->wall_impulse[i * d + c] = (int64_t)test_random_below(&random, 2000) - 1000;
    }
}

static void assert_ids(const ascc_particles *set, ascc_kind kind, const uint64_t *expected,
                       size_t count)
{
    uint64_t ids[64];
    assert_int_equal(ascc_particles_count(set, kind), count);
    assert_int_equal(ascc_particles_get_ids(set, kind, 0, count, ids), ASCC_OK);
    for (size_t i = 0; i < count; i++)
        assert_int_equal(ids[i], expected[i]);
}

/* ---- Creation -------------------------------------------------------------------------------- */

static void a_new_set_is_empty(void **state)
{
    fixture *const self = *state;
    int64_t total[3] = {1, 1, 1};
    assert_int_equal(ascc_particles_count(self->set, ASCC_FLUID), 0);
    assert_int_equal(ascc_particles_count(self->set, ASCC_BOUNDARY), 0);
    assert_int_equal(ascc_particles_dimension(self->set), 3);
    assert_string_equal(ascc_particles_message(self->set), "");
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_OK);
    assert_true(total[0] == 0 && total[1] == 0 && total[2] == 0);
    assert_int_equal(ascc_particles_body_impulse(self->set, -1, NULL, total, NULL), ASCC_OK);
}

static void an_earlier_velocity_is_that_of_all_steps_before_it(void **state)
{
    fixture *const self = *state;
    double x[2][3] = {{0}, {1, 0, 0}}, v[2][3] = {{1, 2, 3}, {4, 5, 6}}, read[2][3];
    const ascc_const_array place = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array in = {.data = v, .scalar = ASCC_DOUBLE};
    const ascc_const_array second = {.data = v[1], .scalar = ASCC_DOUBLE};
    const ascc_array out = {.data = read, .scalar = ASCC_DOUBLE};
    const ascc_particles_options options = {.size = sizeof options, .dimension = 3, .spacing = 1};
    ascc_particles *set;
    assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(set, 2, &place, &in, NULL, NULL), ASCC_OK);
#define EARLIER(ago) ((ascc_field)(ASCC_EARLIER_VELOCITY + (ago)))
#define READS(ago, row, number)                                                                    \
    do {                                                                                           \
        assert_int_equal(ascc_particles_get(set, ASCC_FLUID, EARLIER(ago), 0, 2, &out), ASCC_OK);  \
        assert_true(fabs(read[row][0] - (number)) < 1e-6);                                         \
    } while (0)
    READS(7, 1, 4.0); /* as it does now */
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, EARLIER(2), 0, 1, &second), ASCC_OK);
    READS(1, 0, 1.0);
    READS(2, 0, 4.0);
    READS(7, 0, 4.0);
    READS(2, 1, 4.0);
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, EARLIER(0), 0, 2, &in), ASCC_OK);
    READS(7, 0, 1.0);
    v[0][0] = 7;
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, ASCC_VELOCITY, 0, 2, &in), ASCC_OK);
    READS(0, 0, 7.0);
    v[1][2] = (double)NAN;
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, EARLIER(0), 0, 2, &in),
                     ASCC_ERROR_NOT_FINITE);
    v[1][2] = 1e300;
    assert_int_equal(ascc_particles_set(set, ASCC_FLUID, EARLIER(0), 0, 2, &in), ASCC_ERROR_RANGE);
    READS(0, 0, 7.0);
    assert_int_equal(ascc_particles_get(set, ASCC_FLUID, EARLIER(8), 0, 2, &out),
                     ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_get(set, ASCC_BOUNDARY, EARLIER(0), 0, 0, &out),
                     ASCC_ERROR_ARGUMENT);
    ascc_particles_destroy(&set);
#undef READS
#undef EARLIER
}

static void options_out_of_range_are_refused(void **state)
{
    fixture *const self = *state;
    const ascc_particles_options good = {.size = sizeof good, .dimension = 3, .spacing = 0.1};
    ascc_particles_options bad[18];
    const char *names[18];
    size_t count = 0;
#define BAD(member, value, name)                                                                   \
    do {                                                                                           \
        bad[count] = good;                                                                         \
        bad[count].member = (value);                                                               \
        names[count++] = (name);                                                                   \
    } while (0)
    BAD(dimension, 0, "dimension is 0");
    BAD(dimension, 1, "dimension is 1");
    BAD(dimension, 4, "dimension is 4");
    BAD(reserved, 1, "reserved is 1");
    BAD(spacing, 0, "spacing is 0");
    BAD(spacing, -1, "spacing is -1");
    BAD(spacing, (double)NAN, "spacing is nan");
    BAD(spacing, (double)INFINITY, "spacing is inf");
    BAD(spacing, DBL_MAX, "spacing");
    BAD(mass, -1, "mass is -1");
    BAD(mass, (double)NAN, "mass is nan");
    BAD(momentum_quantum, -1, "momentum_quantum is -1");
    BAD(momentum_quantum, (double)INFINITY, "momentum_quantum is inf");
    BAD(mass, DBL_MIN, "momentum_quantum"); /* the default quantum would be too small */
    BAD(spacing, 1e200, "spacing 1e+200 has no default mass: inf kg");
    BAD(spacing, 1e-200, "spacing 1e-200 has no default mass: 0 kg");
    BAD(size, sizeof good - 1, "size");
    BAD(size, 0, "size");
#undef BAD
    for (size_t i = 0; i < count; i++) {
        ascc_particles *set = self->set;
        self->lines = 0;
        assert_int_equal(ascc_particles_create(self->context, &bad[i], &set), ASCC_ERROR_ARGUMENT);
        assert_null(set);
        assert_int_equal(self->lines, 1);
        assert_context_names(self, names[i]);
    }
    ascc_particles *set;
    assert_int_equal(ascc_particles_create(self->context, NULL, &set), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_create(NULL, &good, &set), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_create(self->context, &good, NULL), ASCC_ERROR_ARGUMENT);
    ascc_particles_options huge = good;
    huge.boundary_capacity = SIZE_MAX / 16;
    assert_int_equal(ascc_particles_create(self->context, &huge, &set), ASCC_ERROR_MEMORY);
    huge.fluid_capacity = SIZE_MAX;
    assert_int_equal(ascc_particles_create(self->context, &huge, &set), ASCC_ERROR_MEMORY);
}

static void longer_options_are_read_if_their_tail_is_zero(void **state)
{
    fixture *const self = *state;
    struct {
        ascc_particles_options options;
        uint64_t unknown;
    } newer = {{.size = sizeof newer, .dimension = 2, .spacing = 1}, 0};
    ascc_particles *set;
    assert_int_equal(ascc_particles_create(self->context, &newer.options, &set), ASCC_OK);
    ascc_particles_destroy(&set);
    newer.unknown = 1;
    assert_int_equal(ascc_particles_create(self->context, &newer.options, &set),
                     ASCC_ERROR_ARGUMENT);
}

static void the_default_quantum_is_2_to_the_minus_28_of_the_power_of_two_below(void **state)
{
    fixture *const self = *state;
    static const struct {
        double mass, spacing, power;
    } cases[] = {{1, 1, 1},       {1, 2, 2},        {1, 1.99, 1},
                 {3, 1, 2},       {0.5, 0.5, 0.25}, {0.125, 0.1, 0x1p-7},
                 {1000, 1e-3, 1}, {1, 0.999, 0.5}};
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        const ascc_particles_options options = {.size = sizeof options,
                                                .dimension = 2,
                                                .spacing = cases[i].spacing,
                                                .mass = cases[i].mass};
        ascc_particles *set;
        assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_OK);
        assert_true(ascc_particles_momentum_quantum(set) == cases[i].power / (1 << 28));
        ascc_particles_destroy(&set);
    }
    const ascc_particles_options given = {
        .size = sizeof given, .dimension = 2, .spacing = 1, .momentum_quantum = 0.3};
    ascc_particles *set;
    assert_int_equal(ascc_particles_create(self->context, &given, &set), ASCC_OK);
    assert_true(ascc_particles_momentum_quantum(set) == 0.3);
    ascc_particles_destroy(&set);
}

static void a_product_that_has_no_default_quantum_is_refused_by_both_names(void **state)
{
    fixture *const self = *state;
    static const struct {
        double mass, spacing;
        const char *message;
    } cases[] = {
        {1e308, 100, "mass 1e+308 times spacing 100 has no default momentum_quantum"},
        {1e-300, 1e-20, "mass 1e-300 times spacing 1e-20 has"}, /* not even a product */
        {1e-300, 1e-3, "mass 1e-300 times spacing 0.001 has"},  /* a product, no quantum */
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        ascc_particles_options options = {.size = sizeof options,
                                          .dimension = 2,
                                          .spacing = cases[i].spacing,
                                          .mass = cases[i].mass};
        ascc_particles *set;
        assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_ERROR_ARGUMENT);
        assert_context_names(self, cases[i].message);
        options.momentum_quantum = 1;
        assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_OK);
        ascc_particles_destroy(&set);
    }
}

static void the_default_mass_is_that_of_water(void **state)
{
    fixture *const self = *state;
    for (int32_t dimension = 2; dimension <= 3; dimension++) {
        const ascc_particles_options options = {
            .size = sizeof options, .dimension = dimension, .spacing = 0.5};
        ascc_particles *set;
        double mass;
        const ascc_array out = into_doubles(&mass);
        assert_int_equal(ascc_particles_create(self->context, &options, &set), ASCC_OK);
        assert_int_equal(ascc_particles_resize_fluid(set, 1), ASCC_OK);
        assert_int_equal(ascc_particles_get(set, ASCC_FLUID, ASCC_MASS, 0, 1, &out), ASCC_OK);
        assert_true(mass == (dimension == 2 ? 250 : 125));
        assert_true(ascc_particles_momentum_quantum(set) == (dimension == 2 ? 0x1p-22 : 0x1p-23));
        ascc_particles_destroy(&set);
    }
}

static void handles_that_are_no_sets_are_refused(void **state)
{
    fixture *const self = *state;
    ascc_particles *const wrong[] = {(ascc_particles *)self->context};
    const double numbers[3] = {0};
    double out[3];
    const ascc_const_array in = doubles(numbers);
    const ascc_array values = into_doubles(out);
    uint64_t id = 1;
    int64_t quanta[3];
    int32_t body;
    ascc_kind kind;
    size_t row;
    for (size_t i = 0; i < COUNT_OF(wrong); i++) {
        ascc_particles *set = wrong[i];
        const ascc_status refused[] = {
            ascc_particles_reserve(set, 1, 1),
            ascc_particles_add_fluid(set, 1, &in, NULL, NULL, NULL),
            ascc_particles_add_boundary(set, 1, &in, &in, 0, NULL),
            ascc_particles_remove(set, 1, &id),
            ascc_particles_clear(set, ASCC_FLUID),
            ascc_particles_resize_fluid(set, 1),
            ascc_particles_set(set, ASCC_FLUID, ASCC_POSITION, 0, 1, &in),
            ascc_particles_get(set, ASCC_FLUID, ASCC_POSITION, 0, 1, &values),
            ascc_particles_get_ids(set, ASCC_FLUID, 0, 1, &id),
            ascc_particles_get_bodies(set, 0, 1, &body),
            ascc_particles_find(set, 1, &kind, &row),
            ascc_particles_get_momentum(set, 0, 1, quanta),
            ascc_particles_total_momentum(set, quanta),
            ascc_particles_body_impulse(set, -1, NULL, quanta, NULL),
            ascc_particles_snapshot(set, out, sizeof out),
            ascc_particles_restore(set, out, sizeof out),
        };
        for (size_t k = 0; k < COUNT_OF(refused); k++)
            assert_int_equal(refused[k], ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_particles_count(set, ASCC_FLUID), 0);
        assert_int_equal(ascc_particles_capacity(set, ASCC_FLUID), 0);
        assert_int_equal(ascc_particles_dimension(set), 0);
        assert_int_equal(ascc_particles_snapshot_size(set), 0);
        assert_int_equal(ascc_particles_hash(set), 0);
        assert_true(ascc_particles_momentum_quantum(set) == 0);
        assert_string_equal(ascc_particles_message(set), "");
        ascc_particles_destroy(&set);
        assert_ptr_equal(set, wrong[i]);
    }
    ascc_particles_destroy(NULL);
}

/* ---- Adding and reading ---------------------------------------------------------------------- */

static void what_is_added_is_read_again(void **state)
{
    fixture *const self = *state;
    const double position[6] = {1, 2, 3, -4, 5e-300, 6}, velocity[6] = {0.5, 0, -1, 8, 2, 0.25};
    const double mass[2] = {1, 4}, normal[6] = {0, 1, 0, 0.6, 0.8, 0};
    const ascc_const_array p = doubles(position), v = doubles(velocity), m = doubles(mass),
                           n = doubles(normal);
    uint64_t ids[2], wall_ids[2];
    assert_int_equal(ascc_particles_add_fluid(self->set, 2, &p, &v, &m, ids), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(self->set, 2, &p, &n, 7, wall_ids), ASCC_OK);
    assert_int_equal(ids[0], 1);
    assert_int_equal(ids[1], 2);
    assert_int_equal(wall_ids[0], 3);
    assert_int_equal(wall_ids[1], 4);

    double out[6];
    const ascc_array values = into_doubles(out);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, 0, 2, &values),
                     ASCC_OK);
    assert_memory_equal(out, position, sizeof out);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_VELOCITY, 0, 2, &values),
                     ASCC_OK);
    assert_memory_equal(out, velocity, sizeof out); /* they are whole quanta */
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_MASS, 0, 2, &values), ASCC_OK);
    assert_memory_equal(out, mass, sizeof mass);
    assert_int_equal(ascc_particles_get(self->set, ASCC_BOUNDARY, ASCC_POSITION, 0, 2, &values),
                     ASCC_OK);
    assert_memory_equal(out, position, sizeof out);
    assert_int_equal(ascc_particles_get(self->set, ASCC_BOUNDARY, ASCC_NORMAL, 1, 1, &values),
                     ASCC_OK);
    assert_memory_equal(out, normal + 3, 3 * sizeof *out);
    int32_t bodies[2];
    assert_int_equal(ascc_particles_get_bodies(self->set, 0, 2, bodies), ASCC_OK);
    assert_true(bodies[0] == 7 && bodies[1] == 7);
}

static void without_velocity_and_mass_fluid_rests_with_the_sets_mass(void **state)
{
    fixture *const self = *state;
    const float position[2] = {1, 2};
    const ascc_const_array p = {.data = position}, absent = {0};
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, &absent, &absent, NULL), ASCC_OK);
    double mass[2], velocity[4];
    const ascc_array m = into_doubles(mass), v = into_doubles(velocity);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_MASS, 0, 2, &m), ASCC_OK);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_VELOCITY, 0, 2, &v), ASCC_OK);
    assert_true(mass[0] == 2 && mass[1] == 2);
    for (int i = 0; i < 4; i++)
        assert_true(velocity[i] == 0);
}

/* A host's particle: an array of these is read and written in place. */
typedef struct host_particle {
    char tag;
    float position[3];
    char guard;
    double velocity[3];
} host_particle;

static void arrays_of_structs_are_read_and_written_in_place(void **state)
{
    fixture *const self = *state;
    host_particle host[3];
    memset(host, 0x5a, sizeof host);
    for (int i = 0; i < 3; i++)
        for (int c = 0; c < 3; c++) {
            host[i].position[c] = (float)(10 * i + c);
            host[i].velocity[c] = -(double)(10 * i + c);
        }
    const ascc_const_array p = {.data = host[0].position, .stride = sizeof *host};
    const ascc_const_array v = {
        .data = host[0].velocity, .stride = sizeof *host, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(self->set, 3, &p, &v, NULL, NULL), ASCC_OK);

    host_particle back[3], expected[3];
    memset(back, 0x77, sizeof back);
    memcpy(expected, back, sizeof back);
    for (int i = 0; i < 3; i++)
        memcpy(expected[i].position, host[i].position, sizeof host[i].position);
    const ascc_array out = {.data = back[0].position, .stride = sizeof *back};
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, 0, 3, &out), ASCC_OK);
    assert_memory_equal(back, expected, sizeof back);
    double velocity[9];
    const ascc_array all = into_doubles(velocity);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_VELOCITY, 0, 3, &all), ASCC_OK);
    for (int i = 0; i < 9; i++)
        assert_true(velocity[i] == -(double)(10 * (i / 3) + i % 3));
}

static void separate_and_reversed_arrays_are_read_and_written(void **state)
{
    fixture *const self = *state;
    /* x of three particles, then y, then z; the second call reads the rows backwards. */
    const float separate[9] = {1, 2, 3, 10, 20, 30, 100, 200, 300};
    const ascc_const_array forward = {
        .data = separate, .stride = sizeof(float), .component_stride = 3 * sizeof(float)};
    const ascc_const_array backward = {.data = separate + 2,
                                       .stride = -(ptrdiff_t)sizeof(float),
                                       .component_stride = 3 * sizeof(float)};
    assert_int_equal(ascc_particles_add_fluid(self->set, 3, &forward, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(self->set, 3, &backward, NULL, NULL, NULL), ASCC_OK);
    for (int i = 0; i < 6; i++) {
        const int row = i < 3 ? i : 5 - i;
        for (int c = 0; c < 3; c++)
            assert_true(self->set->position[3 * i + c] == (double)separate[3 * c + row]);
    }
    double out[9];
    const ascc_array last_first = {.data = out + 8,
                                   .stride = -3 * (ptrdiff_t)sizeof(double),
                                   .component_stride = -(ptrdiff_t)sizeof(double),
                                   .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, 0, 3, &last_first),
                     ASCC_OK);
    for (int i = 0; i < 9; i++)
        assert_true(out[8 - i] == self->set->position[i]);
}

static void unaligned_arrays_are_read(void **state)
{
    fixture *const self = *state;
    unsigned char bytes[2 * sizeof(double) + 1];
    const double position[2] = {3, -7};
    memcpy(bytes + 1, position, sizeof position);
    const ascc_const_array p = {.data = bytes + 1, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, NULL, NULL, NULL), ASCC_OK);
    assert_true(self->set->position[0] == 3 && self->set->position[1] == -7);
}

/* ---- Momentum -------------------------------------------------------------------------------- */

static void velocities_round_to_the_nearest_quantum_and_ties_to_even(void **state)
{
    (void)state;
    static const struct {
        double momentum, quantum;
        int64_t quanta;
    } cases[] = {
        {0, 1, 0},
        {-0.0, 1, 0},
        {0.5, 1, 0},
        {1.5, 1, 2},
        {2.5, 1, 2},
        {-0.5, 1, 0},
        {-1.5, 1, -2},
        {-2.5, 1, -2},
        {0.49999999999999994, 1, 0},
        {1, 0x1p-28, 1 << 28},
        {0x1p61, 1, INT64_C(1) << 61},
        {-0x1p61, 1, -(INT64_C(1) << 61)},
        {0x1p-29, 0x1p-28, 0},
        {3 * 0x1p-29, 0x1p-28, 2},
        {1e-320, 1, 0},
        {0.9, 0.3, 3},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        int64_t quanta = -1;
        assert_true(ascc_to_quanta(cases[i].momentum, cases[i].quantum, &quanta));
        assert_int_equal(quanta, cases[i].quanta);
    }
    int64_t quanta = 5;
    assert_false(ascc_to_quanta(0x1.0000000000001p61, 1, &quanta));
    assert_false(ascc_to_quanta(-0x1.0000000000001p61, 1, &quanta));
    assert_false(ascc_to_quanta((double)NAN, 1, &quanta));
    assert_false(ascc_to_quanta((double)INFINITY, 1, &quanta));
    assert_false(ascc_to_quanta(1e300, 1e-300, &quanta));
    assert_int_equal(quanta, 5);
}

static void velocity_is_held_within_half_a_quantum(void **state)
{
    fixture *const self = *state;
    test_random random = {1};
    const double quantum = ascc_particles_momentum_quantum(self->set);
    for (int i = 0; i < 1000; i++) {
        const double position[3] = {0}, mass = test_random_between(&random, 0.1, 10);
        double velocity[3];
        for (int c = 0; c < 3; c++)
            velocity[c] = test_random_between(&random, -100, 100);
        const ascc_const_array p = doubles(position), v = doubles(velocity), m = doubles(&mass);
        assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, &v, &m, NULL), ASCC_OK);
        int64_t momentum[3];
        assert_int_equal(ascc_particles_get_momentum(self->set, (size_t)i, 1, momentum), ASCC_OK);
        for (int c = 0; c < 3; c++) {
            const double exact = velocity[c] * mass / quantum;
            assert_true(fabs((double)momentum[c] - exact) <= 0.5);
        }
    }
}

static void setting_velocity_sets_momentum(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 2, 5, 0);
    const double velocity[2] = {0.75, -2}, mass = 4;
    const ascc_const_array v = doubles(velocity), m = doubles(&mass);
    assert_int_equal(ascc_particles_set(self->set, ASCC_FLUID, ASCC_MASS, 3, 1, &m), ASCC_OK);
    assert_int_equal(ascc_particles_set(self->set, ASCC_FLUID, ASCC_VELOCITY, 3, 1, &v), ASCC_OK);
    int64_t momentum[2];
    assert_int_equal(ascc_particles_get_momentum(self->set, 3, 1, momentum), ASCC_OK);
    const double quantum = ascc_particles_momentum_quantum(self->set);
    assert_true((double)momentum[0] * quantum == 3);
    assert_true((double)momentum[1] * quantum == -8);
}

static void setting_mass_keeps_the_velocity(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 3, 50, 0);
    double before[100], after[100], mass[50];
    const ascc_array out_before = into_doubles(before), out_after = into_doubles(after);
    test_random random = {4};
    for (int i = 0; i < 50; i++)
        mass[i] = test_random_between(&random, 0.1, 10);
    const ascc_const_array m = doubles(mass);
    ascc_particles_get(self->set, ASCC_FLUID, ASCC_VELOCITY, 0, 50, &out_before);
    assert_int_equal(ascc_particles_set(self->set, ASCC_FLUID, ASCC_MASS, 0, 50, &m), ASCC_OK);
    ascc_particles_get(self->set, ASCC_FLUID, ASCC_VELOCITY, 0, 50, &out_after);
    /* Half a quantum of momentum, and roundings of a velocity of at most 3 m/s. */
    for (int i = 0; i < 100; i++)
        assert_true(fabs(after[i] - before[i]) <=
                    ascc_particles_momentum_quantum(self->set) / mass[i / 2] / 2 + 1e-15);
    self->set->momentum[7] = (INT64_C(1) << 60) + 1; /* more bits than a velocity has */
    const picture taken = take_picture(self->set);
    assert_int_equal(ascc_particles_set(self->set, ASCC_FLUID, ASCC_MASS, 0, 50, &m), ASCC_OK);
    assert_same_picture(self->set, taken); /* the same masses change no bit */
}

static void total_momentum_is_exact(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 5, 4, 0);
    const int64_t limit = ASCC_MOMENTUM_LIMIT;
    /* Partial sums go beyond 64 bits; the whole does not. */
    const int64_t x[] = {limit, limit, -limit, -limit + 1}, y[] = {3, -4, 5, -6};
    for (int i = 0; i < 4; i++) {
        self->set->momentum[2 * i] = x[i];
        self->set->momentum[2 * i + 1] = y[i];
    }
    int64_t total[3] = {9, 9, 9};
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_OK);
    assert_true(total[0] == 1 && total[1] == -2 && total[2] == 0);
}

static void partial_sums_may_overflow_and_totals_may_not(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 6, 10, 0);
    for (int i = 0; i < 10; i++) { /* the first four reach 2^63 */
        self->set->momentum[2 * i] = i < 5 ? ASCC_MOMENTUM_LIMIT : -ASCC_MOMENTUM_LIMIT;
        self->set->momentum[2 * i + 1] = -ASCC_MOMENTUM_LIMIT;
    }
    self->set->momentum[0] -= 1;
    int64_t total[3] = {7, 7, 7};
    assert_reader_refused(self, ascc_particles_total_momentum(self->set, total), ASCC_ERROR_RANGE,
                          "total");
    assert_true(total[0] == 7);
    for (int i = 4; i < 10; i++)
        self->set->momentum[2 * i + 1] = 0; /* 4 * -2^61 = INT64_MIN fits */
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_OK);
    assert_true(total[0] == -1 && total[1] == INT64_MIN);
    self->set->momentum[9] = -1;
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_ERROR_RANGE);
    for (int i = 0; i < 4; i++)
        self->set->momentum[2 * i + 1] = ASCC_MOMENTUM_LIMIT; /* 2^63 - 1 fits, 2^63 does not */
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_OK);
    assert_true(total[1] == INT64_MAX);
    self->set->momentum[9] = 0;
    assert_int_equal(ascc_particles_total_momentum(self->set, total), ASCC_ERROR_RANGE);
    assert_int_equal(ascc_particles_total_momentum(self->set, NULL), ASCC_ERROR_ARGUMENT);
}

/* ---- Refusals -------------------------------------------------------------------------------- */

static void a_failed_add_of_fluid_changes_nothing(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 7, 8, 4);
    static const struct {
        int array, index; /* of position, velocity, mass: which number is bad */
        double value;
        ascc_status status;
        const char *message;
    } cases[] = {
        {0, 3 * 17 + 1, NAN, ASCC_ERROR_NOT_FINITE, "position: row 17 component 1 is nan"},
        {0, 3 * 19 + 2, INFINITY, ASCC_ERROR_NOT_FINITE, "position: row 19 component 2 is inf"},
        {0, 5, -0x1.0000001p40 * 0.1, ASCC_ERROR_RANGE, "position: row 1 component 2"},
        {1, 0, NAN, ASCC_ERROR_NOT_FINITE, "velocity: row 0 component 0 is nan"},
        {1, 4, -INFINITY, ASCC_ERROR_NOT_FINITE, "velocity: row 1 component 1 is -inf"},
        {1, 4, 1e300, ASCC_ERROR_RANGE, "velocity: row 1 component 1 is 1e+300"},
        {2, 3, 0, ASCC_ERROR_ARGUMENT, "mass: row 3 is 0"},
        {2, 19, -1, ASCC_ERROR_ARGUMENT, "mass: row 19 is -1"},
        {2, 0, NAN, ASCC_ERROR_ARGUMENT, "mass: row 0 is nan"},
        {2, 0, INFINITY, ASCC_ERROR_ARGUMENT, "mass: row 0 is inf"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        double numbers[3][60];
        for (int k = 0; k < 60; k++) {
            numbers[0][k] = k;
            numbers[1][k] = -k;
            numbers[2][k] = 1;
        }
        numbers[cases[i].array][cases[i].index] = cases[i].value;
        const ascc_const_array p = doubles(numbers[0]), v = doubles(numbers[1]),
                               m = doubles(numbers[2]);
        uint64_t ids[20] = {0};
        const picture before = take_picture(self->set);
        self->lines = 0;
        assert_refused(self, ascc_particles_add_fluid(self->set, 20, &p, &v, &m, ids),
                       cases[i].status, cases[i].message);
        assert_int_equal(self->lines, 1);
        assert_int_equal(ids[0], 0);
        assert_same_picture(self->set, before);
    }
}

static void a_failed_add_of_boundary_changes_nothing(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 8, 3, 4);
    static const struct {
        int array, index;
        double value;
        ascc_status status;
        const char *message;
    } cases[] = {
        {0, 3, NAN, ASCC_ERROR_NOT_FINITE, "position: row 1 component 1 is nan"},
        {0, 3, 1e300, ASCC_ERROR_RANGE, "position: row 1 component 1 is 1e+300"},
        {1, 5, NAN, ASCC_ERROR_NOT_FINITE, "normal: row 2 component 1 is nan"},
        {1, 4, 1.0011, ASCC_ERROR_ARGUMENT, "normal: row 2 has length 1.0011"},
        {1, 4, -0.9989, ASCC_ERROR_ARGUMENT, "normal: row 2 has length 0.9989"},
        {1, 4, 1e200, ASCC_ERROR_ARGUMENT, "normal: row 2 has length inf"},
        {1, 4, 0, ASCC_ERROR_ARGUMENT, "normal: row 2 has length 0"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        double numbers[2][40] = {{0}};
        for (int k = 0; k < 20; k++)
            numbers[1][2 * k] = 1;
        numbers[cases[i].array][cases[i].index] = cases[i].value;
        const ascc_const_array p = doubles(numbers[0]), n = doubles(numbers[1]);
        const picture before = take_picture(self->set);
        assert_refused(self, ascc_particles_add_boundary(self->set, 20, &p, &n, 0, NULL),
                       cases[i].status, cases[i].message);
        assert_same_picture(self->set, before);
    }
    const double point[2] = {0, 1};
    const ascc_const_array p = doubles(point);
    assert_refused(self, ascc_particles_add_boundary(self->set, 1, &p, &p, -1, NULL),
                   ASCC_ERROR_ARGUMENT, "body: -1");
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &p, INT32_MAX, NULL), ASCC_OK);
    const double near[2] = {0, 1.0009};
    const ascc_const_array n = doubles(near);
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &n, 0, NULL), ASCC_OK);
}

static void arrays_that_are_missing_or_unknown_are_refused(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 9, 3, 3);
    const double numbers[3] = {1, 0, 0};
    double out[3];
    const ascc_const_array good = doubles(numbers), missing = {0};
    ascc_const_array odd = good, reserved = good, later_absent = missing, broadcast = good;
    odd.scalar = (ascc_scalar)2;
    reserved.reserved = later_absent.reserved = 1;
    broadcast.component_stride = sizeof(double); /* a stride of 0 is no broadcast row */
    const ascc_const_array *const bad[] = {NULL,      &missing,      &odd,
                                           &reserved, &later_absent, &broadcast};
    const picture before = take_picture(self->set);
    for (size_t i = 0; i < COUNT_OF(bad); i++) {
        assert_refused(self, ascc_particles_add_fluid(self->set, 1, bad[i], NULL, NULL, NULL),
                       ASCC_ERROR_ARGUMENT, "position");
        assert_refused(self, ascc_particles_add_boundary(self->set, 1, bad[i], &good, 0, NULL),
                       ASCC_ERROR_ARGUMENT, "position");
        assert_refused(self, ascc_particles_add_boundary(self->set, 1, &good, bad[i], 0, NULL),
                       ASCC_ERROR_ARGUMENT, "normal");
        assert_refused(self, ascc_particles_set(self->set, ASCC_FLUID, ASCC_POSITION, 0, 1, bad[i]),
                       ASCC_ERROR_ARGUMENT, "values");
        if (i >= 2) { /* without them fluid rests, with the set's mass */
            assert_refused(self, ascc_particles_add_fluid(self->set, 1, &good, bad[i], NULL, NULL),
                           ASCC_ERROR_ARGUMENT, "velocity");
            assert_refused(self, ascc_particles_add_fluid(self->set, 1, &good, NULL, bad[i], NULL),
                           ASCC_ERROR_ARGUMENT, "mass");
        }
    }
    const ascc_array nowhere = {0}, unknown = {.data = out, .scalar = (ascc_scalar)-1},
                     later = {.data = out, .reserved = 5},
                     overlaid = {.data = out, .component_stride = sizeof(float)};
    const ascc_array *const bad_out[] = {NULL, &nowhere, &unknown, &later, &overlaid};
    for (size_t i = 0; i < COUNT_OF(bad_out); i++)
        assert_reader_refused(
            self, ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, 0, 1, bad_out[i]),
            ASCC_ERROR_ARGUMENT, "values");
    assert_reader_refused(self, ascc_particles_get_ids(self->set, ASCC_FLUID, 0, 1, NULL),
                          ASCC_ERROR_ARGUMENT, "ids");
    assert_reader_refused(self, ascc_particles_get_bodies(self->set, 0, 1, NULL),
                          ASCC_ERROR_ARGUMENT, "bodies");
    assert_reader_refused(self, ascc_particles_get_momentum(self->set, 0, 1, NULL),
                          ASCC_ERROR_ARGUMENT, "momentum");
    assert_same_picture(self->set, before);
}

static void no_rows_need_no_arrays(void **state)
{
    fixture *const self = *state;
    assert_int_equal(ascc_particles_add_fluid(self->set, 0, NULL, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(self->set, 0, NULL, NULL, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_remove(self->set, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_set(self->set, ASCC_FLUID, ASCC_POSITION, 0, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, 0, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_get_ids(self->set, ASCC_FLUID, 0, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_get_bodies(self->set, 0, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_get_momentum(self->set, 0, 0, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_resize_fluid(self->set, 0), ASCC_OK);
}

static void rows_beyond_the_end_and_fields_a_kind_lacks_are_refused(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 10, 5, 3);
    double numbers[20] = {0};
    numbers[0] = 1;
    const ascc_const_array in = doubles(numbers);
    const ascc_array out = into_doubles(numbers);
    uint64_t ids[8];
    int32_t bodies[8];
    int64_t momentum[24];
    static const struct {
        size_t first, count;
    } beyond[] = {{0, 6}, {5, 1}, {6, 0}, {1, SIZE_MAX}, {SIZE_MAX, 1}, {SIZE_MAX, SIZE_MAX}};
    const picture before = take_picture(self->set);
    for (size_t i = 0; i < COUNT_OF(beyond); i++) {
        const size_t first = beyond[i].first, count = beyond[i].count;
        assert_refused(self,
                       ascc_particles_set(self->set, ASCC_FLUID, ASCC_POSITION, first, count, &in),
                       ASCC_ERROR_ARGUMENT, "rows");
        const ascc_status refused[] = {
            ascc_particles_get(self->set, ASCC_FLUID, ASCC_POSITION, first, count, &out),
            ascc_particles_get_ids(self->set, ASCC_FLUID, first, count, ids),
            ascc_particles_get_bodies(self->set, first, count, bodies),
            ascc_particles_get_momentum(self->set, first, count, momentum),
            ascc_particles_get(self->set, ASCC_BOUNDARY, ASCC_NORMAL, first, count, &out),
        };
        for (size_t k = 0; k < COUNT_OF(refused); k++)
            assert_reader_refused(self, refused[k], ASCC_ERROR_ARGUMENT, "rows");
    }
    static const struct {
        int kind, field;
    } lacking[] = {{ASCC_FLUID, ASCC_NORMAL}, {ASCC_BOUNDARY, ASCC_MASS}, {ASCC_FLUID, 5},
                   {ASCC_FLUID, -1},          {2, ASCC_POSITION},         {-1, ASCC_POSITION}};
    for (size_t i = 0; i < COUNT_OF(lacking); i++) {
        const ascc_kind kind = (ascc_kind)lacking[i].kind;
        const ascc_field field = (ascc_field)lacking[i].field;
        const char *const named = i < 4 ? "field" : "kind";
        assert_refused(self, ascc_particles_set(self->set, kind, field, 0, 1, &in),
                       ASCC_ERROR_ARGUMENT, named);
        assert_reader_refused(self, ascc_particles_get(self->set, kind, field, 0, 1, &out),
                              ASCC_ERROR_ARGUMENT, named);
    }
    assert_refused(self, ascc_particles_clear(self->set, (ascc_kind)2), ASCC_ERROR_ARGUMENT,
                   "kind");
    assert_reader_refused(self, ascc_particles_get_ids(self->set, (ascc_kind)2, 0, 0, ids),
                          ASCC_ERROR_ARGUMENT, "kind");
    assert_int_equal(ascc_particles_count(self->set, (ascc_kind)2), 0);
    assert_int_equal(ascc_particles_capacity(self->set, (ascc_kind)2), 0);
    assert_same_picture(self->set, before);
}

static void a_failed_set_changes_nothing(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 11, 6, 6);
    static const struct {
        int kind, field, index;
        double value;
        ascc_status status;
    } cases[] = {
        {ASCC_FLUID, ASCC_POSITION, 5, NAN, ASCC_ERROR_NOT_FINITE},
        {ASCC_FLUID, ASCC_POSITION, 5, 0.1 * 0x1.1p40, ASCC_ERROR_RANGE},
        {ASCC_FLUID, ASCC_VELOCITY, 5, INFINITY, ASCC_ERROR_NOT_FINITE},
        {ASCC_FLUID, ASCC_VELOCITY, 5, 1e30, ASCC_ERROR_RANGE},
        {ASCC_FLUID, ASCC_MASS, 3, 0, ASCC_ERROR_ARGUMENT},
        {ASCC_FLUID, ASCC_MASS, 3, NAN, ASCC_ERROR_ARGUMENT},
        {ASCC_FLUID, ASCC_MASS, 3, 1e30, ASCC_ERROR_RANGE},
        {ASCC_BOUNDARY, ASCC_POSITION, 7, -INFINITY, ASCC_ERROR_NOT_FINITE},
        {ASCC_BOUNDARY, ASCC_NORMAL, 7, 2, ASCC_ERROR_ARGUMENT},
        {ASCC_BOUNDARY, ASCC_VELOCITY, 7, NAN, ASCC_ERROR_NOT_FINITE},
        {ASCC_BOUNDARY, ASCC_VELOCITY, 7, -0.1 * 0x1.1p40, ASCC_ERROR_RANGE},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        double numbers[8] = {1, 0, 0, 1, -1, 0, 0, -1};
        if (cases[i].field == ASCC_MASS)
            for (int k = 0; k < 8; k++)
                numbers[k] = 3;
        numbers[cases[i].index] = cases[i].value;
        const ascc_const_array in = doubles(numbers);
        const picture before = take_picture(self->set);
        assert_refused(self,
                       ascc_particles_set(self->set, (ascc_kind)cases[i].kind,
                                          (ascc_field)cases[i].field, 1, 4, &in),
                       cases[i].status, "values: row");
        assert_same_picture(self->set, before);
    }
}

static void setting_changes_the_rows_named_and_no_others(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 12, 6, 6);
    double before[12], after[12];
    const double numbers[4] = {0.6, 0.8, -1, 0};
    const ascc_const_array in = doubles(numbers);
    const ascc_array out_before = into_doubles(before), out_after = into_doubles(after);
    static const struct {
        ascc_kind kind;
        ascc_field field;
    } fields[] = {
        {ASCC_FLUID, ASCC_POSITION}, {ASCC_BOUNDARY, ASCC_POSITION}, {ASCC_BOUNDARY, ASCC_NORMAL}};
    for (size_t i = 0; i < COUNT_OF(fields); i++) {
        const ascc_kind kind = fields[i].kind;
        const ascc_field field = fields[i].field;
        ascc_particles_get(self->set, kind, field, 0, 6, &out_before);
        assert_int_equal(ascc_particles_set(self->set, kind, field, 2, 2, &in), ASCC_OK);
        ascc_particles_get(self->set, kind, field, 0, 6, &out_after);
        memcpy(before + 4, numbers, sizeof numbers);
        assert_memory_equal(after, before, sizeof after);
    }
}

/* ---- Removal --------------------------------------------------------------------------------- */

static void removal_keeps_order_and_ids(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 13, 6, 6); /* fluid 1 to 6, boundary 7 to 12 */
    double position[12];
    memcpy(position, self->set->position, sizeof position);
    const uint64_t gone[] = {9, 2, 12, 5, 7, 1};
    assert_int_equal(ascc_particles_remove(self->set, 6, gone), ASCC_OK);
    const uint64_t fluid[] = {3, 4, 6}, boundary[] = {8, 10, 11};
    assert_ids(self->set, ASCC_FLUID, fluid, 3);
    assert_ids(self->set, ASCC_BOUNDARY, boundary, 3);
    for (size_t i = 0; i < 3; i++) /* id k was added as row k - 1 */
        assert_memory_equal(self->set->position + 2 * i, position + 2 * (fluid[i] - 1),
                            2 * sizeof(double));
    const int32_t bodies[] = {1, 1, 0};
    assert_memory_equal(self->set->wall_body, bodies, sizeof bodies);

    uint64_t id;
    const double origin[2] = {0};
    const ascc_const_array p = doubles(origin);
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, NULL, NULL, &id), ASCC_OK);
    assert_int_equal(id, 13); /* never one that was used */
}

static void a_removal_of_unknown_or_repeated_ids_removes_nothing(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 14, 5, 5);
    const uint64_t unknown[] = {1, 2, 11, 3}, zero[] = {0}, last[] = {UINT64_MAX},
                   twice[] = {1, 2, 3, 2}, wall_twice[] = {7, 1, 7};
    const picture before = take_picture(self->set);
    assert_refused(self, ascc_particles_remove(self->set, 4, unknown), ASCC_ERROR_ARGUMENT,
                   "ids: row 2 is 11");
    assert_refused(self, ascc_particles_remove(self->set, 1, zero), ASCC_ERROR_ARGUMENT, "is 0");
    assert_refused(self, ascc_particles_remove(self->set, 1, last), ASCC_ERROR_ARGUMENT, "row 0");
    assert_refused(self, ascc_particles_remove(self->set, 4, twice), ASCC_ERROR_ARGUMENT,
                   "ids: 2 is given twice");
    assert_refused(self, ascc_particles_remove(self->set, 3, wall_twice), ASCC_ERROR_ARGUMENT,
                   "ids: 7 is given twice");
    assert_refused(self, ascc_particles_remove(self->set, 1, NULL), ASCC_ERROR_ARGUMENT, "ids");
    const uint64_t one[] = {3};
    self->memory.fail_at = self->memory.calls + 1;
    assert_refused(self, ascc_particles_remove(self->set, 1, one), ASCC_ERROR_MEMORY, "memory");
    assert_same_picture(self->set, before);
}

/* The obvious model of a set: a list of ids, in order. */
typedef struct list {
    uint64_t id[2][400];
    size_t count[2];
} list;

static void list_remove(list *self, uint64_t id)
{
    for (int kind = 0; kind < 2; kind++) {
        size_t kept = 0;
        for (size_t i = 0; i < self->count[kind]; i++)
            if (self->id[kind][i] != id)
                self->id[kind][kept++] = self->id[kind][i];
        self->count[kind] = kept;
    }
}

static void long_lives_of_adding_and_removing_follow_a_plain_list(void **state)
{
    fixture *const self = *state;
    test_random random = {15};
    list model = {.count = {0, 0}};
    for (int turn = 0; turn < 300; turn++) {
        const size_t total = model.count[0] + model.count[1];
        if (total < 20 || (total < 300 && test_random_below(&random, 2) == 0)) {
            double position[40] = {0}, normal[40] = {0};
            uint64_t ids[20];
            const size_t count = 1 + test_random_below(&random, 20);
            const int kind = (int)test_random_below(&random, 2);
            for (size_t i = 0; i < count; i++) {
                position[2 * i] = (double)model.count[kind];
                normal[2 * i] = 1;
            }
            const ascc_const_array p = doubles(position), n = doubles(normal);
            assert_int_equal(kind == ASCC_FLUID
                                 ? ascc_particles_add_fluid(self->set, count, &p, NULL, NULL, ids)
                                 : ascc_particles_add_boundary(self->set, count, &p, &n, turn, ids),
                             ASCC_OK);
            for (size_t i = 0; i < count; i++)
                model.id[kind][model.count[kind]++] = ids[i];
        } else {
            uint64_t gone[20];
            const size_t count = 1 + test_random_below(&random, 19);
            for (size_t i = 0; i < count; i++) {
                const int kind = model.count[1] == 0 ||
                                         (model.count[0] != 0 && test_random_below(&random, 2) == 0)
                                     ? 0
                                     : 1;
                gone[i] = model.id[kind][test_random_below(&random, model.count[kind])];
                list_remove(&model, gone[i]);
            }
            assert_int_equal(ascc_particles_remove(self->set, count, gone), ASCC_OK);
        }
        for (int kind = 0; kind < 2; kind++) {
            assert_int_equal(ascc_particles_count(self->set, (ascc_kind)kind), model.count[kind]);
            for (size_t i = 0; i < model.count[kind]; i++) {
                ascc_kind found;
                size_t row;
                assert_int_equal(ascc_particles_find(self->set, model.id[kind][i], &found, &row),
                                 ASCC_OK);
                assert_int_equal(found, kind);
                assert_int_equal(row, i);
            }
        }
    }
}

static void an_id_that_is_gone_is_not_found(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 16, 3, 3);
    const uint64_t gone = 2;
    ascc_kind kind = ASCC_BOUNDARY;
    size_t row = 77;
    assert_int_equal(ascc_particles_find(self->set, 2, &kind, &row), ASCC_OK);
    assert_true(kind == ASCC_FLUID && row == 1);
    assert_int_equal(ascc_particles_find(self->set, 6, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_remove(self->set, 1, &gone), ASCC_OK);
    assert_reader_refused(self, ascc_particles_find(self->set, 2, &kind, &row), ASCC_ERROR_ARGUMENT,
                          "2");
    assert_reader_refused(self, ascc_particles_find(self->set, 0, &kind, &row), ASCC_ERROR_ARGUMENT,
                          "0");
    assert_true(kind == ASCC_FLUID && row == 1);
}

static void clearing_drops_a_kind_and_keeps_its_memory(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 17, 9, 5);
    const size_t capacity = ascc_particles_capacity(self->set, ASCC_FLUID);
    assert_int_equal(ascc_particles_clear(self->set, ASCC_FLUID), ASCC_OK);
    assert_int_equal(ascc_particles_count(self->set, ASCC_FLUID), 0);
    assert_int_equal(ascc_particles_count(self->set, ASCC_BOUNDARY), 5);
    assert_int_equal(ascc_particles_capacity(self->set, ASCC_FLUID), capacity);
    assert_int_equal(ascc_particles_clear(self->set, ASCC_BOUNDARY), ASCC_OK);
    assert_int_equal(ascc_particles_count(self->set, ASCC_BOUNDARY), 0);
}

static void resizing_drops_the_last_or_adds_at_rest(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 18, 5, 0);
    assert_int_equal(ascc_particles_resize_fluid(self->set, 3), ASCC_OK);
    assert_int_equal(ascc_particles_resize_fluid(self->set, 6), ASCC_OK);
    const uint64_t ids[] = {1, 2, 3, 6, 7, 8};
    assert_ids(self->set, ASCC_FLUID, ids, 6);
    for (size_t row = 3; row < 6; row++) {
        assert_true(self->set->mass[row] == 2);
        for (size_t c = 0; c < 2; c++) {
            assert_true(self->set->position[2 * row + c] == 0);
            assert_true(self->set->momentum[2 * row + c] == 0);
        }
    }
    const picture before = take_picture(self->set);
    assert_int_equal(ascc_particles_resize_fluid(self->set, SIZE_MAX), ASCC_ERROR_MEMORY);
    self->memory.fail_at = self->memory.calls + 1;
    assert_int_equal(ascc_particles_resize_fluid(self->set, 1000), ASCC_ERROR_MEMORY);
    assert_same_picture(self->set, before);
}

/* ---- Memory ---------------------------------------------------------------------------------- */

static void adding_within_the_reserve_allocates_nothing(void **state)
{
    fixture *const self = *state;
    assert_int_equal(ascc_particles_reserve(self->set, 100, 50), ASCC_OK);
    assert_int_equal(ascc_particles_capacity(self->set, ASCC_FLUID), 100);
    assert_int_equal(ascc_particles_capacity(self->set, ASCC_BOUNDARY), 50);
    const size_t calls = self->memory.calls;
    add_scene(self->set, 19, 100, 50);
    assert_int_equal(ascc_particles_reserve(self->set, 10, 50), ASCC_OK);
    picture taken = take_picture(self->set);
    ascc_particles_clear(self->set, ASCC_FLUID);
    assert_int_equal(ascc_particles_restore(self->set, taken.bytes, taken.size), ASCC_OK);
    assert_int_equal(ascc_particles_resize_fluid(self->set, 100), ASCC_OK);
    assert_int_equal(self->memory.calls, calls);
    free(taken.bytes);
}

static void adding_one_by_one_takes_few_allocations(void **state)
{
    fixture *const self = *state;
    const size_t calls = self->memory.calls;
    add_scene(self->set, 20, 2000, 0);
    /* 1.5^n = 2000 for n = 18.7, and a few more while half of the capacity rounds down. */
    assert_in_range(self->memory.calls - calls, 1, 23);
}

static void sizes_that_fit_no_memory_are_refused_before_reading(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 21, 2, 2);
    const double one[2] = {1, 0};
    const ascc_const_array in = doubles(one);
    static const size_t counts[] = {SIZE_MAX, SIZE_MAX - 1, SIZE_MAX / 8, SIZE_MAX / 16};
    const picture before = take_picture(self->set);
    for (size_t i = 0; i < COUNT_OF(counts); i++) {
        assert_int_equal(ascc_particles_add_fluid(self->set, counts[i], &in, NULL, NULL, NULL),
                         ASCC_ERROR_MEMORY);
        assert_int_equal(ascc_particles_add_boundary(self->set, counts[i], &in, &in, 0, NULL),
                         ASCC_ERROR_MEMORY);
        assert_int_equal(ascc_particles_reserve(self->set, counts[i], 0), ASCC_ERROR_MEMORY);
        assert_int_equal(ascc_particles_reserve(self->set, 0, counts[i]), ASCC_ERROR_MEMORY);
    }
    assert_same_picture(self->set, before);
}

/* One life of a set; false at the first call without memory, after which nothing has changed. */
static bool live_once(ascc_context *context, ascc_particles **set, size_t *successes)
{
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = 2,
                                            .spacing = 1,
                                            .fluid_capacity = 2,
                                            .boundary_capacity = 2};
    double numbers[200] = {0};
    for (int i = 0; i < 100; i++)
        numbers[2 * i] = 1;
    const ascc_const_array in = doubles(numbers);
    const uint64_t gone[] = {3, 50, 120};

    ascc_status status = ascc_particles_create(context, &options, set);
    for (int call = 0; status == ASCC_OK && call < 8; call++) {
        ++*successes;
        const picture before = take_picture(*set);
        switch (call) {
        case 0:
            status = ascc_particles_add_fluid(*set, 10, &in, &in, NULL, NULL);
            break;
        case 1:
            status = ascc_particles_reserve(*set, 20, 20); /* both kinds grow */
            break;
        case 2:
            status = ascc_particles_add_fluid(*set, 90, &in, &in, NULL, NULL);
            break;
        case 3:
            status = ascc_particles_add_boundary(*set, 100, &in, &in, 1, NULL);
            break;
        case 4:
            status = ascc_particles_remove(*set, 3, gone);
            break;
        case 5:
            status = ascc_particles_resize_fluid(*set, 1000);
            break;
        case 6: { /* into a set without room: both kinds grow at once */
            ascc_particles *other;
            status = ascc_particles_create(context, &options, &other);
            if (status == ASCC_OK) {
                const picture empty = take_picture(other);
                status = ascc_particles_restore(other, before.bytes, before.size);
                if (status == ASCC_OK)
                    free(empty.bytes);
                else
                    assert_same_picture(other, empty);
                ascc_particles_destroy(&other);
            }
            break;
        }
        default:
            break;
        }
        if (status == ASCC_OK)
            free(before.bytes);
        else
            assert_same_picture(*set, before);
    }
    assert_true(status == ASCC_OK || status == ASCC_ERROR_MEMORY);
    return status == ASCC_OK;
}

static void every_failed_allocation_changes_and_leaks_nothing(void **state)
{
    (void)state;
    size_t last = 0;
    for (size_t n = 2;; n++) {
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        ascc_context *context;
        ascc_particles *set;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        memory.fail_at = memory.calls + n - 1;
        size_t successes = 0;
        const bool done = live_once(context, &set, &successes);
        assert_true(successes >= last);
        last = successes;
        ascc_particles_destroy(&set);
        ascc_context_destroy(&context);
        assert_true(test_memory_is_clean(&memory));
        if (done)
            break;
    }
    assert_int_equal(last, 8);
}

/* ---- Bodies ---------------------------------------------------------------------------------- */

static void body_impulse_and_torque_are_sums_over_the_rows_of_a_body(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 22, 2, 30);
    const double point[3] = {0.5, -1, 2}, quantum = ascc_particles_momentum_quantum(self->set);
    for (int32_t body = -1; body < 3; body++) {
        int64_t expected[3] = {0}, impulse[3];
        double turn[3] = {0}, torque[3];
        for (size_t row = 0; row < 30; row++) {
            if (body != -1 && (int32_t)(row % 2) != body)
                continue;
            double x[3], j[3];
            for (size_t c = 0; c < 3; c++) {
                expected[c] += self->set->wall_impulse[3 * row + c];
                x[c] = self->set->wall_position[3 * row + c] - point[c];
                j[c] = (double)self->set->wall_impulse[3 * row + c] * quantum;
            }
            for (size_t c = 0; c < 3; c++) {
                const size_t a = (c + 1) % 3, b = (c + 2) % 3;
                turn[c] += x[a] * j[b] - x[b] * j[a];
            }
        }
        assert_int_equal(ascc_particles_body_impulse(self->set, body, point, impulse, torque),
                         ASCC_OK);
        assert_memory_equal(impulse, expected, sizeof expected);
        for (size_t c = 0; c < 3; c++)
            assert_true(torque[c] == turn[c]);
        if (body == 2)
            assert_true(impulse[0] == 0 && torque[0] == 0);
    }
    int64_t impulse[3];
    double torque[3], about_origin[3];
    const double origin[3] = {0};
    assert_int_equal(ascc_particles_body_impulse(self->set, 0, NULL, NULL, torque), ASCC_OK);
    assert_int_equal(ascc_particles_body_impulse(self->set, 0, origin, impulse, about_origin),
                     ASCC_OK);
    assert_memory_equal(torque, about_origin, sizeof torque);
    const double nowhere[3] = {0, NAN, 0};
    assert_reader_refused(self, ascc_particles_body_impulse(self->set, 0, nowhere, impulse, torque),
                          ASCC_ERROR_ARGUMENT, "point: component 1 is nan");
    assert_reader_refused(self, ascc_particles_body_impulse(self->set, -2, NULL, impulse, torque),
                          ASCC_ERROR_ARGUMENT, "body: -2");
    for (size_t row = 0; row < 30; row++)
        self->set->wall_impulse[3 * row] = INT64_MAX;
    impulse[0] = 5;
    assert_reader_refused(self, ascc_particles_body_impulse(self->set, 0, NULL, impulse, torque),
                          ASCC_ERROR_RANGE, "impulse");
    assert_int_equal(impulse[0], 5);
    assert_int_equal(ascc_particles_body_impulse(self->set, 0, NULL, NULL, torque), ASCC_OK);
}

static void torque_in_the_plane_is_its_third_component(void **state)
{
    fixture *const self = *state;
    const double position[2] = {2, 0}, normal[2] = {0, 1};
    const ascc_const_array p = doubles(position), n = doubles(normal);
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &n, 3, NULL), ASCC_OK);
    int64_t impulse[3] = {1, 1, 1};
    double torque[3] = {1, 1, 1};
    assert_int_equal(ascc_particles_body_impulse(self->set, 3, NULL, impulse, torque), ASCC_OK);
    for (int c = 0; c < 3; c++)
        assert_true(impulse[c] == 0 && torque[c] == 0); /* before the first step */
    self->set->wall_impulse[1] = -8;
    assert_int_equal(ascc_particles_body_impulse(self->set, 3, NULL, impulse, torque), ASCC_OK);
    assert_true(impulse[0] == 0 && impulse[1] == -8 && impulse[2] == 0);
    assert_true(torque[0] == 0 && torque[1] == 0);
    assert_true(torque[2] == -16 * ascc_particles_momentum_quantum(self->set));
    const double ignored[3] = {1, 0, NAN};
    assert_int_equal(ascc_particles_body_impulse(self->set, 3, ignored, NULL, torque), ASCC_OK);
    assert_true(torque[2] == -8 * ascc_particles_momentum_quantum(self->set));
}

/* ---- Measures -------------------------------------------------------------------------------- */

static void a_failed_measure_leaves_its_output_untouched(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 40, 20, 0);
    ascc_measures before, measures;
    memset(&before, 0x5a, sizeof before);
    before.size = sizeof before;
    bool failed = true;
    size_t failures = 0;
    while (failed) {
        measures = before;
        self->memory.fail_at = self->memory.calls + failures + 1;
        const ascc_status status = ascc_particles_measure(self->set, &measures);
        failed = status != ASCC_OK;
        failures += failed;
        if (failed) {
            assert_refused(self, status, ASCC_ERROR_MEMORY, "memory");
            assert_memory_equal(&measures, &before, sizeof before);
        }
    }
    self->memory.fail_at = 0;
    assert_true(failures > 2);
    assert_true(measures.size == sizeof measures && measures.mass > 0);

    measures = before;
    self->set->position[5] = 1e300;
    assert_refused(self, ascc_particles_measure(self->set, &measures), ASCC_ERROR_RANGE,
                   "fluid row 2");
    assert_memory_equal(&measures, &before, sizeof before);
}

static void measures_of_no_known_size_are_refused(void **state)
{
    fixture *const self = *state;
    ascc_measures measures = {.size = sizeof measures - 1};
    assert_refused(self, ascc_particles_measure(self->set, &measures), ASCC_ERROR_ARGUMENT,
                   "measures");
    measures.size = SIZE_MAX;
    assert_refused(self, ascc_particles_measure(self->set, &measures), ASCC_ERROR_ARGUMENT,
                   "measures");
    assert_refused(self, ascc_particles_measure(self->set, NULL), ASCC_ERROR_ARGUMENT, "measures");
    assert_int_equal(ascc_particles_measure(NULL, &measures), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_measure((ascc_particles *)self->context, &measures),
                     ASCC_ERROR_ARGUMENT);
    assert_true(measures.mass == 0 && measures.size == SIZE_MAX);
}

/* ---- Snapshot -------------------------------------------------------------------------------- */

static void a_restored_set_is_what_it_was(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 23, 20, 11);
    const uint64_t gone[] = {4, 25};
    assert_int_equal(ascc_particles_remove(self->set, 2, gone), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(self->set);
    const picture before = take_picture(self->set);
    add_scene(self->set, 24, 1, 1);
    ascc_particles_resize_fluid(self->set, 7);
    assert_true(ascc_particles_hash(self->set) != hash);
    assert_int_equal(ascc_particles_restore(self->set, before.bytes, before.size), ASCC_OK);
    assert_true(ascc_particles_hash(self->set) == hash);
    uint64_t id;
    const double origin[3] = {0};
    const ascc_const_array p = doubles(origin);

    /* Another set, of other options, becomes the same, down to the next id. */
    const ascc_particles_options other = {.size = sizeof other, .dimension = 3, .spacing = 5};
    ascc_particles *copy;
    assert_int_equal(ascc_particles_create(self->context, &other, &copy), ASCC_OK);
    assert_int_equal(ascc_particles_restore(copy, before.bytes, before.size), ASCC_OK);
    assert_true(ascc_particles_momentum_quantum(copy) ==
                ascc_particles_momentum_quantum(self->set));
    const picture copied = take_picture(copy);
    assert_int_equal(copied.size, before.size);
    assert_memory_equal(copied.bytes, before.bytes, before.size);
    free(copied.bytes);
    assert_int_equal(ascc_particles_add_fluid(copy, 1, &p, NULL, NULL, &id), ASCC_OK);
    assert_int_equal(id, 32);
    assert_true(copy->mass[copy->fluid_count - 1] == 2);
    ascc_particles_destroy(&copy);
    assert_same_picture(self->set, before);
}

static void an_empty_set_has_a_snapshot(void **state)
{
    fixture *const self = *state;
    const picture before = take_picture(self->set);
    add_scene(self->set, 25, 3, 3);
    assert_int_equal(ascc_particles_restore(self->set, before.bytes, before.size), ASCC_OK);
    assert_int_equal(ascc_particles_count(self->set, ASCC_FLUID), 0);
    assert_int_equal(ascc_particles_count(self->set, ASCC_BOUNDARY), 0);
    free(before.bytes);
}

static void a_snapshot_needs_its_size(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 26, 3, 3);
    const size_t size = ascc_particles_snapshot_size(self->set);
    unsigned char *const bytes = malloc(size + 1);
    memset(bytes, 0x42, size + 1);
    assert_reader_refused(self, ascc_particles_snapshot(self->set, bytes, size - 1),
                          ASCC_ERROR_ARGUMENT, "memory");
    assert_reader_refused(self, ascc_particles_snapshot(self->set, NULL, size), ASCC_ERROR_ARGUMENT,
                          "memory");
    assert_int_equal(bytes[0], 0x42);
    assert_int_equal(ascc_particles_snapshot(self->set, bytes, size + 1), ASCC_OK);
    assert_int_equal(bytes[size], 0x42);
    free(bytes);
}

/* The layout in words, written down a second time. */
static void put_test_word(unsigned char *bytes, size_t word, uint64_t value)
{
    for (size_t i = 0; i < 8; i++)
        bytes[8 * word + i] = (unsigned char)(value >> (8 * i));
}

static uint64_t test_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static void seal(unsigned char *bytes, size_t words)
{
    uint64_t sum = UINT64_C(0x50414e5343435341);
    for (size_t i = 0; i + 1 < words; i++) {
        uint64_t word = 0;
        for (size_t k = 8; k-- > 0;)
            word = word << 8 | bytes[8 * i + k];
        sum = (sum ^ word) * UINT64_C(0x9e3779b97f4a7c15);
        sum ^= sum >> 32;
    }
    put_test_word(bytes, words - 1, sum);
}

static void the_snapshot_is_the_documented_words(void **state)
{
    fixture *const self = *state; /* 2D, spacing 0.1, mass 2: quantum 2^-3 * 2^-28 */
    const double position[2] = {1.5, -2}, velocity[2] = {0.25, 0}, mass = 0.5, normal[2] = {0, -1};
    const ascc_const_array p = doubles(position), v = doubles(velocity), m = doubles(&mass),
                           n = doubles(normal);
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, &v, &m, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &n, 6, NULL), ASCC_OK);
    self->set->wall_impulse[1] = -2;
    self->set->wall_velocity[0] = 0.75;
    self->set->rest[0] = -9;
    self->set->detail[0] = 0.25;
    const uint64_t expected[] = {UINT64_C(0x50414e5343435341),
                                 5,
                                 2,
                                 1,
                                 1,
                                 3,
                                 test_bits(0.1),
                                 test_bits(2),
                                 test_bits(0x1p-31),
                                 test_bits(1.5),
                                 test_bits(-2),
                                 1 << 28,
                                 0,
                                 test_bits(0.5),
                                 1,
                                 test_bits(1.5),
                                 test_bits(-2),
                                 test_bits(0),
                                 test_bits(-1),
                                 0,
                                 (uint64_t)-2,
                                 2,
                                 6,
                                 test_bits(0.75),
                                 0,
                                 0,
                                 0,
                                 0,
                                 0, /* in no body's frame */
                                 (uint64_t)-9,
                                 test_bits(0.25),
                                 7, /* the next body, and no body */
                                 0,
                                 0};
    unsigned char bytes[sizeof expected];
    for (size_t i = 0; i < COUNT_OF(expected); i++)
        put_test_word(bytes, i, expected[i]);
    seal(bytes, COUNT_OF(expected));
    assert_memory_equal(bytes, "ASCCSNAP", 8);
    const picture taken = take_picture(self->set);
    assert_int_equal(taken.size, sizeof bytes);
    assert_memory_equal(taken.bytes, bytes, sizeof bytes);
    free(taken.bytes);
}

static void every_damaged_bit_of_a_snapshot_is_seen(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 27, 2, 2);
    const picture good = take_picture(self->set);
    add_scene(self->set, 28, 1, 0);
    const picture before = take_picture(self->set);
    for (size_t bit = 0; bit < 8 * good.size; bit++) {
        good.bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
        assert_int_equal(ascc_particles_restore(self->set, good.bytes, good.size),
                         ASCC_ERROR_FORMAT);
        good.bytes[bit / 8] ^= (unsigned char)(1 << bit % 8);
    }
    for (size_t size = 0; size < good.size; size++) {
        unsigned char *const part = malloc(size + 1); /* exact, for the sanitizer's sake */
        memcpy(part, good.bytes, size);
        assert_int_equal(ascc_particles_restore(self->set, part, size), ASCC_ERROR_FORMAT);
        free(part);
    }
    unsigned char *const longer = calloc(1, good.size + 8);
    memcpy(longer, good.bytes, good.size);
    for (size_t more = 1; more <= 8; more++)
        assert_int_equal(ascc_particles_restore(self->set, longer, good.size + more),
                         ASCC_ERROR_FORMAT);
    free(longer);
    assert_refused(self, ascc_particles_restore(self->set, NULL, 100), ASCC_ERROR_ARGUMENT,
                   "memory");
    assert_same_picture(self->set, before);
    assert_int_equal(ascc_particles_restore(self->set, good.bytes, good.size), ASCC_OK);
    free(good.bytes);
}

static void impossible_snapshots_with_a_right_checksum_are_refused(void **state)
{
    fixture *const self = *state; /* 2D: header 9 words, then the arrays of 2 + 2 particles */
    add_scene(self->set, 29, 2, 2);
    enum { FLUID = 9, POSITION = 9, MOMENTUM = 13, MASS = 17, ID = 19, WALL_POSITION = 21 };
    enum { NORMAL = 25, WALL_ID = 33, BODY = 35, WALL_VELOCITY = 37 };
    enum { OWN_POSITION = 41, OWN_NORMAL = 45, REST = 49 };
    enum { DETAIL = 51, NEXT_BODY = 53, BODIES = 54, WORDS = 56 };
    static const struct {
        size_t word;
        uint64_t value;
        ascc_status status;
    } cases[] = {
        {1, 0, ASCC_ERROR_FORMAT}, /* version */
        {1, 1, ASCC_ERROR_FORMAT}, /* which has fewer words */
        {1, 2, ASCC_ERROR_FORMAT},
        {1, 3, ASCC_ERROR_FORMAT},
        {1, 4, ASCC_ERROR_FORMAT},
        {1, 6, ASCC_ERROR_FORMAT},
        {2, 1, ASCC_ERROR_FORMAT}, /* dimension */
        {2, 4, ASCC_ERROR_FORMAT},
        {2, UINT64_MAX, ASCC_ERROR_FORMAT},
        {3, 3, ASCC_ERROR_FORMAT}, /* counts */
        {3, 0, ASCC_ERROR_FORMAT},
        {3, UINT64_MAX, ASCC_ERROR_FORMAT},
        {3, UINT64_C(1) << 61, ASCC_ERROR_FORMAT},
        {4, 1, ASCC_ERROR_FORMAT},
        {4, UINT64_C(1) << 61, ASCC_ERROR_FORMAT},
        {5, 0, ASCC_ERROR_FORMAT}, /* next id */
        {5, 4, ASCC_ERROR_FORMAT},
        {5, UINT64_MAX, ASCC_ERROR_FORMAT}, /* beyond 2^63 */
        {5, (UINT64_C(1) << 63) + 1, ASCC_ERROR_FORMAT},
        {6, 0, ASCC_ERROR_FORMAT}, /* spacing 0 */
        {6, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {7, UINT64_C(0xbff0000000000000), ASCC_ERROR_FORMAT}, /* mass -1 */
        {8, 0, ASCC_ERROR_FORMAT},                            /* quantum 0 */
        {8, 1, ASCC_ERROR_FORMAT},                            /* the smallest number */
        {POSITION + 3, UINT64_C(0x7ff0000000000000), ASCC_ERROR_FORMAT},
        {POSITION, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {POSITION, UINT64_C(0x7fe0000000000000), ASCC_ERROR_FORMAT},
        {MOMENTUM, (UINT64_C(1) << 61) + 1, ASCC_ERROR_FORMAT},
        {MOMENTUM + 3, UINT64_C(1) << 63, ASCC_ERROR_FORMAT},
        {MASS + 1, 0, ASCC_ERROR_FORMAT},
        {MASS, UINT64_C(0x7ff0000000000000), ASCC_ERROR_FORMAT},
        {ID, 0, ASCC_ERROR_FORMAT},
        {ID, 2, ASCC_ERROR_FORMAT},     /* as the next one */
        {ID + 1, 3, ASCC_ERROR_FORMAT}, /* as a wall's */
        {ID + 1, 9, ASCC_ERROR_FORMAT}, /* not given out yet */
        {WALL_POSITION, UINT64_C(0xfff0000000000000), ASCC_ERROR_FORMAT},
        {NORMAL, UINT64_C(0x4000000000000000), ASCC_ERROR_FORMAT}, /* 2 */
        {NORMAL, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {WALL_ID, 4, ASCC_ERROR_FORMAT},
        {WALL_ID + 1, UINT64_MAX, ASCC_ERROR_FORMAT},
        {BODY, UINT64_C(1) << 31, ASCC_ERROR_FORMAT},
        {BODY + 1, UINT64_MAX, ASCC_ERROR_FORMAT},
        {WALL_VELOCITY, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {WALL_VELOCITY + 3, UINT64_C(0x7fe0000000000000), ASCC_ERROR_FORMAT},
        {OWN_POSITION, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {OWN_NORMAL + 1, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {OWN_NORMAL, UINT64_C(0x4000000000000000), ASCC_ERROR_FORMAT},
        {REST + 1, UINT64_C(1) << 32, ASCC_ERROR_FORMAT},
        {DETAIL, UINT64_C(0x7ff8000000000000), ASCC_ERROR_FORMAT},
        {DETAIL + 1, UINT64_C(0x3ff0000000000001), ASCC_ERROR_FORMAT}, /* above 1 */
        {DETAIL, UINT64_C(0xbff0000000000000), ASCC_ERROR_FORMAT},
        {NEXT_BODY, 0, ASCC_ERROR_FORMAT}, /* which points have */
        {NEXT_BODY, (UINT64_C(1) << 31) + 1, ASCC_ERROR_FORMAT},
        {BODIES, 1, ASCC_ERROR_FORMAT},
        {BODIES, UINT64_MAX, ASCC_ERROR_FORMAT},
    };
    const picture good = take_picture(self->set);
    assert_int_equal(good.size, 8 * WORDS);
    add_scene(self->set, 30, 1, 1);
    const picture before = take_picture(self->set);
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        unsigned char bytes[8 * WORDS];
        memcpy(bytes, good.bytes, sizeof bytes);
        put_test_word(bytes, cases[i].word, cases[i].value);
        seal(bytes, WORDS);
        if (ascc_particles_restore(self->set, bytes, sizeof bytes) != cases[i].status)
            fail_msg("word %zu = %llx was not refused", cases[i].word,
                     (unsigned long long)cases[i].value);
    }
    assert_same_picture(self->set, before);
    free(good.bytes);
}

static void a_refused_snapshot_is_told_its_field_and_row(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 38, 2, 2); /* 2D, as above */
    static const struct {
        size_t word;
        uint64_t value;
        const char *message;
    } cases[] = {
        {5, UINT64_MAX, "memory: impossible ids; the next is 18446744073709551615"},
        {12, UINT64_C(0x7ff0000000000000), "memory: position: row 1 component 1 is inf"},
        {15, UINT64_C(1) << 62, "memory: momentum: row 1 component 0 is"},
        {18, 0, "memory: mass: row 1 is 0, not a mass"},
        {27, UINT64_C(0x4000000000000000), "memory: wall_normal: row 1 has length"},
        {35, UINT64_C(1) << 32, "memory: wall_body: row 0 does not fit 32 bits"},
        {36, UINT64_MAX, "memory: wall_body: row 1 is -1, negative"},
        {40, UINT64_C(0x7ff0000000000000), "memory: wall_velocity: row 1 component 1 is inf"},
    };
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        const picture taken = take_picture(self->set);
        put_test_word(taken.bytes, cases[i].word, cases[i].value);
        seal(taken.bytes, taken.size / 8);
        assert_refused(self, ascc_particles_restore(self->set, taken.bytes, taken.size),
                       ASCC_ERROR_FORMAT, cases[i].message);
        free(taken.bytes);
    }
}

static void ids_end_at_2_to_the_63_and_never_wrap(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 39, 2, 2);
    self->set->next_id = (UINT64_C(1) << 63) - 3;
    const double one[8] = {1, 0, 1, 0, 1, 0, 1, 0};
    const ascc_const_array in = doubles(one);
    uint64_t ids[3] = {0};
    const picture before = take_picture(self->set);
    assert_refused(self, ascc_particles_add_fluid(self->set, 4, &in, NULL, NULL, ids),
                   ASCC_ERROR_RANGE, "ids: the next is 9223372036854775805");
    assert_refused(self, ascc_particles_add_boundary(self->set, 4, &in, &in, 0, ids),
                   ASCC_ERROR_RANGE, "ids");
    assert_refused(self, ascc_particles_resize_fluid(self->set, 6), ASCC_ERROR_RANGE, "ids");
    assert_same_picture(self->set, before);
    assert_int_equal(ids[0], 0);

    assert_int_equal(ascc_particles_add_fluid(self->set, 3, &in, NULL, NULL, ids), ASCC_OK);
    assert_true(ids[2] == INT64_MAX);
    assert_refused(self, ascc_particles_resize_fluid(self->set, 6), ASCC_ERROR_RANGE, "ids");
    assert_int_equal(ascc_particles_find(self->set, ids[1], NULL, NULL), ASCC_OK);
    const picture full = take_picture(self->set); /* what it writes it takes */
    assert_int_equal(ascc_particles_restore(self->set, full.bytes, full.size), ASCC_OK);
    assert_same_picture(self->set, full);
}

static void a_snapshot_of_another_dimension_does_not_match(void **state)
{
    fixture *const self = *state;
    const ascc_particles_options other = {.size = sizeof other, .dimension = 2, .spacing = 1};
    ascc_particles *flat;
    assert_int_equal(ascc_particles_create(self->context, &other, &flat), ASCC_OK);
    add_scene(flat, 31, 4, 4);
    add_scene(self->set, 32, 4, 4);
    const picture taken = take_picture(flat), before = take_picture(self->set);
    assert_refused(self, ascc_particles_restore(self->set, taken.bytes, taken.size),
                   ASCC_ERROR_MISMATCH, "dimension 2");
    assert_same_picture(self->set, before);
    free(taken.bytes);
    ascc_particles_destroy(&flat);
}

/* ---- Hash ------------------------------------------------------------------------------------ */

static void the_hash_does_not_depend_on_order_or_ids(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 33, 30, 20);
    const uint64_t hash = ascc_particles_hash(self->set);
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = 0.1, .mass = 2};
    ascc_particles *other;
    assert_int_equal(ascc_particles_create(self->context, &options, &other), ASCC_OK);
    for (size_t i = 20; i-- > 0;) {
        const ascc_const_array p = doubles(self->set->wall_position + 3 * i),
                               n = doubles(self->set->wall_normal + 3 * i);
        ascc_particles_add_boundary(other, 1, &p, &n, self->set->wall_body[i], NULL);
    }
    ascc_particles_resize_fluid(other, 30);
    for (size_t i = 0; i < 30; i++) {
        const size_t from = (7 * i + 3) % 30;
        memcpy(other->position + 3 * i, self->set->position + 3 * from, 3 * sizeof(double));
        memcpy(other->momentum + 3 * i, self->set->momentum + 3 * from, 3 * sizeof(int64_t));
        other->mass[i] = self->set->mass[from];
    }
    assert_true(ascc_particles_hash(other) == hash); /* wall impulses differ too */
    ascc_particles_destroy(&other);
}

static void the_hash_sees_every_number_of_the_state(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 34, 3, 3);
    ascc_particles *const set = self->set;
    const uint64_t hash = ascc_particles_hash(set);
    uint64_t seen[100];
    size_t count = 0;
    seen[count++] = hash;
#define SEES(place, change)                                                                        \
    do {                                                                                           \
        const picture before = take_picture(set);                                                  \
        (place) = (change);                                                                        \
        seen[count++] = ascc_particles_hash(set);                                                  \
        assert_int_equal(ascc_particles_restore(set, before.bytes, before.size), ASCC_OK);         \
        free(before.bytes);                                                                        \
        assert_true(ascc_particles_hash(set) == hash);                                             \
    } while (0)
    for (size_t i = 0; i < 9; i++) {
        SEES(set->position[i], nextafter(set->position[i], 100));
        SEES(set->momentum[i], set->momentum[i] + 1);
        SEES(set->wall_position[i], nextafter(set->wall_position[i], 100));
        SEES(set->wall_normal[i], nextafter(set->wall_normal[i], 100));
        SEES(set->wall_velocity[i], 0x1p-60);
    }
    for (size_t i = 0; i < 3; i++) {
        SEES(set->mass[i], nextafter(set->mass[i], 100));
        SEES(set->rest[i], set->rest[i] + 5);
        SEES(set->wall_body[i], set->wall_body[i] + 5);
    }
    SEES(set->fluid_count, 2);
    SEES(set->boundary_count, 2);
#undef SEES
    for (size_t a = 0; a < count; a++)
        for (size_t b = a + 1; b < count; b++)
            assert_true(seen[a] != seen[b]);
}

static void zero_has_no_sign_for_the_hash(void **state)
{
    fixture *const self = *state;
    const double plus[3] = {0, 1, 0}, minus[3] = {-0.0, 1, -0.0};
    const ascc_const_array p = doubles(plus), m = doubles(minus);
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &p, 0, NULL), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(self->set);
    ascc_particles_set(self->set, ASCC_FLUID, ASCC_POSITION, 0, 1, &m);
    ascc_particles_set(self->set, ASCC_BOUNDARY, ASCC_POSITION, 0, 1, &m);
    ascc_particles_set(self->set, ASCC_BOUNDARY, ASCC_NORMAL, 0, 1, &m);
    memcpy(self->set->wall_velocity, (const double[]){-0.0, 0, -0.0}, 3 * sizeof(double));
    assert_true(ascc_particles_hash(self->set) == hash);
}

static void equal_particles_do_not_cancel_in_the_hash(void **state)
{
    fixture *const self = *state;
    const double twice[4] = {1, 2, 1, 2};
    const ascc_const_array p = doubles(twice);
    const uint64_t empty = ascc_particles_hash(self->set);
    assert_int_equal(ascc_particles_add_fluid(self->set, 2, &p, NULL, NULL, NULL), ASCC_OK);
    const uint64_t two = ascc_particles_hash(self->set);
    assert_int_equal(ascc_particles_add_fluid(self->set, 2, &p, NULL, NULL, NULL), ASCC_OK);
    assert_true(two != empty && ascc_particles_hash(self->set) != two);
}

/* The number comes from a second implementation, in Python: sum of chained splitmix64 finalisers of
 * (2, 1, 1, quantum), (0, position, momentum, mass) and (1, position, normal, body). */
static void the_hash_is_the_same_everywhere(void **state)
{
    fixture *const self = *state;
    const double position[2] = {1.5, -2}, velocity[2] = {0.25, 0}, mass = 0.5, normal[2] = {0, -1};
    const ascc_const_array p = doubles(position), v = doubles(velocity), m = doubles(&mass),
                           n = doubles(normal);
    assert_int_equal(ascc_particles_add_fluid(self->set, 1, &p, &v, &m, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(self->set, 1, &p, &n, 6, NULL), ASCC_OK);
    assert_true(ascc_particles_hash(self->set) == UINT64_C(0x08e4fd2a444bebb7));
}

/* ---- Golden ---------------------------------------------------------------------------------- */

/* FNV-1a. */
static uint64_t fingerprint(const unsigned char *bytes, size_t size)
{
    uint64_t sum = UINT64_C(0xcbf29ce484222325);
    for (size_t i = 0; i < size; i++)
        sum = (sum ^ bytes[i]) * UINT64_C(0x100000001b3);
    return sum;
}

/* Taken when every array was still written by hand: snapshots of that time must be read for ever. They end before
 * what versions added: velocities of walls, then places in the frames of bodies, and bodies, then how long fluid has been at rest, then
 * how much detail is wanted of it. */
static void assert_golden(fixture *self, uint64_t snapshot, uint64_t hash)
{
    add_scene(self->set, 36, 37, 23);
    const uint64_t gone[] = {5, 40, 1, 37};
    assert_int_equal(ascc_particles_remove(self->set, 4, gone), ASCC_OK);
    assert_int_equal(ascc_particles_resize_fluid(self->set, 35), ASCC_OK);
    const picture taken = take_picture(self->set);
    const size_t vectors = self->set->boundary_count * (size_t)self->set->dimension * 8;
    if (ascc_particles_hash(self->set) != hash)
        fail_msg("hash %llx", (unsigned long long)ascc_particles_hash(self->set));
    for (size_t version = 1; version <= 4; version++) {
        const size_t bodies = version < 3 ? 0 : 16, scalars = self->set->fluid_count * 8;
        const size_t fields = taken.size - 24 - (version < 4 ? 2 : 1) * scalars -
                              (version < 3 ? 4 - version : 0) * vectors;
        const size_t size = fields + bodies + 8;
        unsigned char *const old = malloc(size);
        memcpy(old, taken.bytes, fields);
        memcpy(old + fields, taken.bytes + taken.size - 24, bodies);
        put_test_word(old, 1, version);
        seal(old, size / 8);
        if (version == 1 && fingerprint(old, size) != snapshot)
            fail_msg("snapshot %llx", (unsigned long long)fingerprint(old, size));
        self->set->wall_velocity[2] = self->set->wall_own_position[1] =
            1; /* which goes away again */
        self->set->rest[3] = version < 4 ? 5 : self->set->rest[3];
        self->set->detail[3] = 0.5;
        self->set->next_body = 0;
        assert_int_equal(ascc_particles_restore(self->set, old, size), ASCC_OK);
        const picture now = take_picture(self->set);
        assert_int_equal(now.size, taken.size);
        assert_memory_equal(now.bytes, taken.bytes, now.size);
        free(now.bytes);
        free(old);
    }
    free(taken.bytes);
}

static void snapshot_and_hash_in_2d_are_those_of_version_1(void **state)
{
    assert_golden(*state, UINT64_C(0x3158528c3905c96b), UINT64_C(0x2dd5e149cdd307d8));
}

static void snapshot_and_hash_in_3d_are_those_of_version_1(void **state)
{
    assert_golden(*state, UINT64_C(0x4e3755e5c883bd07), UINT64_C(0x54441510d7e777c3));
}

/* ---- Messages -------------------------------------------------------------------------------- */

/* Every reader fails once. Returns how many did not. */
static int fail_readers(const ascc_particles *set)
{
    double out[6];
    uint64_t ids[2];
    int32_t bodies[2];
    int64_t quanta[6];
    const ascc_array values = into_doubles(out);
    int accepted = 0;
    accepted += ascc_particles_get(set, ASCC_FLUID, ASCC_MASS, 1, 2, &values) == ASCC_OK;
    accepted += ascc_particles_get_ids(set, ASCC_FLUID, 1, 2, ids) == ASCC_OK;
    accepted += ascc_particles_get_bodies(set, 1, 2, bodies) == ASCC_OK;
    accepted += ascc_particles_get_momentum(set, 1, 2, quanta) == ASCC_OK;
    accepted += ascc_particles_total_momentum(set, NULL) == ASCC_OK;
    accepted += ascc_particles_body_impulse(set, -2, NULL, quanta, NULL) == ASCC_OK;
    accepted += ascc_particles_snapshot(set, out, sizeof out) == ASCC_OK;
    accepted += ascc_particles_find(set, 1000, NULL, NULL) == ASCC_OK;
    return accepted;
}

static void a_reading_that_fails_changes_no_bit_of_the_set(void **state)
{
    fixture *const self = *state;
    add_scene(self->set, 35, 2, 0);
    assert_int_equal(ascc_particles_remove(self->set, 1, NULL), ASCC_ERROR_ARGUMENT);
    assert_string_equal(ascc_particles_message(self->set), "ids: NULL");
    struct ascc_particles before;
    memcpy(&before, self->set, sizeof before);
    self->lines = 0;
    assert_int_equal(fail_readers(self->set), 0);
    assert_memory_equal(&before, self->set, sizeof before);
    assert_string_equal(ascc_particles_message(self->set), "ids: NULL");
    assert_int_equal(self->lines, 8);
    assert_reader_refused(self, ascc_particles_get_ids(self->set, ASCC_FLUID, 1, 2, NULL),
                          ASCC_ERROR_ARGUMENT, "fluid: rows [1, + 2) go beyond the 2 there are");
}

static void *read_in_vain(void *user)
{
    intptr_t accepted = 0;
    for (int turn = 0; turn < 200; turn++)
        accepted += fail_readers(user);
    return (void *)accepted;
}

/* ThreadSanitizer sees a race of the two. */
static void readers_that_fail_do_not_race(void **state)
{
    (void)state;
    ascc_context *context;
    ascc_particles *set;
    const ascc_particles_options options = {.size = sizeof options, .dimension = 2, .spacing = 1};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &options, &set), ASCC_OK);
    add_scene(set, 37, 2, 2);
    pthread_t thread;
    void *accepted;
    assert_int_equal(pthread_create(&thread, NULL, read_in_vain, set), 0);
    assert_ptr_equal(read_in_vain(set), NULL);
    assert_int_equal(pthread_join(thread, &accepted), 0);
    assert_ptr_equal(accepted, NULL);
    assert_string_equal(ascc_particles_message(set), "");
    ascc_particles_destroy(&set);
    ascc_context_destroy(&context);
}

#define IN_2D(fact) cmocka_unit_test_setup_teardown(fact, open_2d, close_fixture)
#define IN_3D(fact) cmocka_unit_test_setup_teardown(fact, open_3d, close_fixture)

int main(void)
{
    const struct CMUnitTest tests[] = {
        IN_3D(a_new_set_is_empty),
        IN_3D(an_earlier_velocity_is_that_of_all_steps_before_it),
        IN_3D(options_out_of_range_are_refused),
        IN_3D(longer_options_are_read_if_their_tail_is_zero),
        IN_2D(the_default_quantum_is_2_to_the_minus_28_of_the_power_of_two_below),
        IN_2D(a_product_that_has_no_default_quantum_is_refused_by_both_names),
        IN_2D(the_default_mass_is_that_of_water),
        IN_3D(handles_that_are_no_sets_are_refused),
        IN_3D(what_is_added_is_read_again),
        IN_2D(without_velocity_and_mass_fluid_rests_with_the_sets_mass),
        IN_3D(arrays_of_structs_are_read_and_written_in_place),
        IN_3D(separate_and_reversed_arrays_are_read_and_written),
        IN_2D(unaligned_arrays_are_read),
        cmocka_unit_test(velocities_round_to_the_nearest_quantum_and_ties_to_even),
        IN_3D(velocity_is_held_within_half_a_quantum),
        IN_2D(setting_velocity_sets_momentum),
        IN_2D(setting_mass_keeps_the_velocity),
        IN_2D(total_momentum_is_exact),
        IN_2D(partial_sums_may_overflow_and_totals_may_not),
        IN_3D(a_failed_add_of_fluid_changes_nothing),
        IN_2D(a_failed_add_of_boundary_changes_nothing),
        IN_3D(arrays_that_are_missing_or_unknown_are_refused),
        IN_2D(no_rows_need_no_arrays),
        IN_3D(rows_beyond_the_end_and_fields_a_kind_lacks_are_refused),
        IN_2D(a_failed_set_changes_nothing),
        IN_2D(setting_changes_the_rows_named_and_no_others),
        IN_2D(removal_keeps_order_and_ids),
        IN_3D(a_removal_of_unknown_or_repeated_ids_removes_nothing),
        IN_2D(long_lives_of_adding_and_removing_follow_a_plain_list),
        IN_3D(an_id_that_is_gone_is_not_found),
        IN_3D(clearing_drops_a_kind_and_keeps_its_memory),
        IN_2D(resizing_drops_the_last_or_adds_at_rest),
        IN_3D(adding_within_the_reserve_allocates_nothing),
        IN_2D(adding_one_by_one_takes_few_allocations),
        IN_2D(sizes_that_fit_no_memory_are_refused_before_reading),
        cmocka_unit_test(every_failed_allocation_changes_and_leaks_nothing),
        IN_3D(body_impulse_and_torque_are_sums_over_the_rows_of_a_body),
        IN_2D(torque_in_the_plane_is_its_third_component),
        IN_2D(a_failed_measure_leaves_its_output_untouched),
        IN_3D(measures_of_no_known_size_are_refused),
        IN_3D(a_restored_set_is_what_it_was),
        IN_2D(an_empty_set_has_a_snapshot),
        IN_3D(a_snapshot_needs_its_size),
        IN_2D(the_snapshot_is_the_documented_words),
        IN_3D(every_damaged_bit_of_a_snapshot_is_seen),
        IN_2D(impossible_snapshots_with_a_right_checksum_are_refused),
        IN_2D(a_refused_snapshot_is_told_its_field_and_row),
        IN_2D(ids_end_at_2_to_the_63_and_never_wrap),
        IN_3D(a_snapshot_of_another_dimension_does_not_match),
        IN_3D(the_hash_does_not_depend_on_order_or_ids),
        IN_3D(the_hash_sees_every_number_of_the_state),
        IN_3D(zero_has_no_sign_for_the_hash),
        IN_2D(equal_particles_do_not_cancel_in_the_hash),
        IN_2D(the_hash_is_the_same_everywhere),
        IN_2D(snapshot_and_hash_in_2d_are_those_of_version_1),
        IN_3D(snapshot_and_hash_in_3d_are_those_of_version_1),
        IN_2D(a_reading_that_fails_changes_no_bit_of_the_set),
        cmocka_unit_test(readers_that_fail_do_not_race),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
