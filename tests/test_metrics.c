/* Measures of a particle set against plain sums over all pairs. SPDX-License-Identifier: MIT */
#include <math.h>

#include "support/counting.h"
#include "support/tools.h"

#define SPACING 0.05
#define MOST 300

static ascc_particles *make(ascc_context *context, int dimension, size_t count, const double *x)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = SPACING, .mass = 0.125};
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, count, &position, NULL, NULL, NULL), ASCC_OK);
    return p;
}

static double weight(double square)
{
    const double t = 1.0 - square;
    return t > 0.0 ? t * t * t : 0.0;
}

/* The sum of weights on a lattice, a particle at its node: support is two spacings. */
static double rest_density(int dimension)
{
    double sum = 0.0;
    for (int i = 0; i < 125; i++) {
        const int x = i % 5 - 2, y = i / 5 % 5 - 2, z = i / 25 - 2;
        if (dimension == 3 || z == 0)
            sum += weight((x * x + y * y + z * z) / 4.0);
    }
    return sum;
}

static void densities_and_distances_are_those_of_all_pairs(void **state)
{
    (void)state;
    dice d = {61};
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    for (int round = 0; round < 12; round++) {
        const int dimension = 2 + round % 2;
        const size_t n = 200, axes = (size_t)dimension;
        double x[MOST * 3];
        for (size_t i = 0; i < n * axes; i++)
            x[i] = dice_uniform(&d, 0.0, 0.4) + (round > 5 && i / axes == n - 1 ? 1e9 : 0.0);
        ascc_particles *p = make(context, dimension, n, x);
        ascc_measures m = {.size = sizeof m};
        assert_int_equal(ascc_particles_measure(p, &m), ASCC_OK);
        double mean = 0.0, most = 0.0, nearest = INFINITY;
        uint64_t close = 0;
        for (size_t i = 0; i < n; i++) {
            double density = 0.0, own = INFINITY;
            for (size_t j = 0; j < n; j++) {
                double square = 0.0;
                for (size_t c = 0; c < axes; c++)
                    square += pow((x[i * axes + c] - x[j * axes + c]) / SPACING, 2.0);
                density += weight(square / 4.0) / rest_density(dimension);
                own = j == i ? own : fmin(own, square);
            }
            mean += density / (double)n;
            most = fmax(most, density);
            nearest = fmin(nearest, sqrt(own) * SPACING);
            close += own < 0.25;
        }
        assert_true(fabs(m.mean_density - mean) < 1e-6 * mean);
        assert_true(fabs(m.max_density - most) < 1e-6 * most);
        assert_true(fabs(m.min_distance - nearest) < 6e-8 * SPACING); /* sqrt(3) units */
        assert_int_equal(m.close_count, close);
        ascc_particles_destroy(&p);
    }
    ascc_context_destroy(&context);
}

static void measures_that_cannot_be_written_are_refused_by_name(void **state)
{
    (void)state;
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    const double x[3] = {0};
    ascc_particles *p = make(context, 3, 1, x);
    ascc_measures m = {.size = sizeof m - 1}, before = m;
    assert_int_equal(ascc_particles_measure(NULL, &m), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_measure(p, NULL), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(ascc_particles_message(p), "measures"));
    assert_int_equal(ascc_particles_measure(p, &m), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(ascc_particles_message(p), "size"));
    assert_memory_equal(&m, &before, sizeof m);
    ascc_particles_destroy(&p);
    ascc_context_destroy(&context);
}

/* 2^40 spacings are a position, 2^36 can be searched. */
static void a_particle_too_far_to_be_searched_is_named(void **state)
{
    (void)state;
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    const double x[6] = {0.0, 0.0, 0.0, 0.0, -ldexp(SPACING, 39), 0.0};
    ascc_particles *p = make(context, 3, 2, x);
    ascc_measures m = {.size = sizeof m};
    assert_int_equal(ascc_particles_measure(p, &m), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_particles_message(p), "fluid row 1 is too far from the origin"));
    ascc_particles_destroy(&p);
    ascc_context_destroy(&context);
}

static void every_allocation_that_fails_is_an_error_that_leaks_nothing(void **state)
{
    (void)state;
    const double x[6] = {0.0, 0.0, 0.0, 0.01, 0.0, 0.0};
    size_t calls = 1;
    for (size_t fail = 0; fail <= calls; fail++) {
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        ascc_context *context;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        ascc_particles *p = make(context, 3, 2, x);
        const size_t before = memory.calls;
        memory.fail_at = fail ? before + fail : 0;
        ascc_measures m = {.size = sizeof m};
        assert_int_equal(ascc_particles_measure(p, &m), fail ? ASCC_ERROR_MEMORY : ASCC_OK);
        if (fail)
            assert_non_null(strstr(ascc_particles_message(p), "no memory"));
        else
            calls = memory.calls - before;
        ascc_particles_destroy(&p);
        ascc_context_destroy(&context);
        assert_true(test_memory_is_clean(&memory));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(densities_and_distances_are_those_of_all_pairs),
        cmocka_unit_test(measures_that_cannot_be_written_are_refused_by_name),
        cmocka_unit_test(a_particle_too_far_to_be_searched_is_named),
        cmocka_unit_test(every_allocation_that_fails_is_an_error_that_leaks_nothing),
    };
    return cmocka_run_group_tests_name("metrics", tests, NULL, NULL);
}
