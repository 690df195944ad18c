/* Measures against hand cases and against values made with numpy and scipy (data/).
 * SPDX-License-Identifier: MIT
 *
 * Bounds: sums of at most a few hundred doubles of order 1 agree to 1e-12; what iterates to a
 * tolerance is compared at that tolerance's effect, stated there.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "measures.h"

enum { MOST_ENTRIES = 64 };

typedef struct golden_entry {
    char name[32];
    size_t rows, columns;
    double *value;
} golden_entry;

static golden_entry golden[MOST_ENTRIES];
static size_t golden_count;

static int load_golden(void **state)
{
    FILE *file = fopen(SOURCE_ROOT "/tests/data/measures-golden.txt", "r");
    (void)state;
    if (!file)
        return -1;
    for (golden_entry *e = golden; golden_count < MOST_ENTRIES; e++, golden_count++) {
        if (fscanf(file, "%31s %zu %zu", e->name, &e->rows, &e->columns) != 3)
            break;
        e->value = malloc(e->rows * e->columns * sizeof *e->value);
        for (size_t i = 0; i < e->rows * e->columns; i++)
            if (!e->value || fscanf(file, "%lf", &e->value[i]) != 1)
                return -1;
    }
    return fclose(file);
}

static int free_golden(void **state)
{
    (void)state;
    for (size_t i = 0; i < golden_count; i++)
        free(golden[i].value);
    return 0;
}

static const golden_entry *find(const char *name)
{
    for (size_t i = 0; i < golden_count; i++)
        if (strcmp(golden[i].name, name) == 0)
            return &golden[i];
    fail_msg("no golden entry %s", name);
    return NULL;
}

static double number(const char *name, size_t i)
{
    return find(name)->value[i];
}

static ascc_measure_set golden_set(const char *name)
{
    const golden_entry *e = find(name);
    return (ascc_measure_set){.dimension = (int32_t)e->columns,
                              .count = e->rows,
                              .position = e->value,
                              .particle_mass = 1.0};
}

static void assert_near(double got, double expected, double bound)
{
    if (!(fabs(got - expected) <= bound))
        fail_msg("got %.17g, expected %.17g, off by %.3g, bound %.3g", got, expected,
                 got - expected, bound);
}

#define BOUND 1e-12
#define SET3(array)                                                                                \
    {                                                                                              \
        .dimension = 3, .count = sizeof(array) / (3 * sizeof(double)), .position = (array),        \
        .particle_mass = 1.0                                                                       \
    }

/* Random points in a cube; the same on every machine. */
static void scatter(double *position, size_t count, uint64_t seed)
{
    for (size_t i = 0; i < count; i++) {
        seed = seed * 6364136223846793005u + 1442695040888963407u;
        position[i] = (double)(seed >> 11) * 0x1p-53;
    }
}

/* ---- First things ---------------------------------------------------------------------------- */

static void particles_that_are_not_finite_are_counted(void **state)
{
    const double x[] = {0, 0, 0, NAN, 0, 0, 0, INFINITY, 0, 0, 0, 0};
    const double v[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -INFINITY};
    ascc_measure_set set = SET3(x);
    (void)state;
    assert_int_equal(ascc_measure_non_finite(&set), 2);
    set.velocity = v;
    assert_int_equal(ascc_measure_non_finite(&set), 3);
}

static void sets_that_are_not_finite_have_no_distances(void **state)
{
    const double x[] = {0, 0, 0, NAN, 0, 0}, y[] = {0, 0, 0, 1, 1, 1};
    const ascc_measure_set bad = SET3(x), good = SET3(y);
    ascc_measure_sinkhorn_options options = {.epsilon = 0.1};
    ascc_measure_sinkhorn_result result;
    ascc_measure_pair_spacing pairs;
    ascc_measure_motion_sums sums;
    double value = 0.0, other = 0.0, density[2];
    (void)state;
    assert_int_equal(ascc_measure_rmse(&bad, &good, &value), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(value));
    assert_int_equal(ascc_measure_mean_distance(&good, &bad, &value), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(value));
    assert_int_equal(ascc_measure_chamfer(&good, &bad, 1, &value, &other), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(value) && isnan(other));
    assert_int_equal(ascc_measure_nearest(&bad, &good, 1, NULL, &value), ASCC_ERROR_NOT_FINITE);
    assert_int_equal(ascc_measure_emd_exact(&bad, &good, 1, &value, NULL), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(value));
    assert_int_equal(ascc_measure_sinkhorn(&bad, &good, &options, &result), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(result.divergence));
    assert_int_equal(ascc_measure_density(&bad, 0, NULL, 0.1, 1, density), ASCC_ERROR_NOT_FINITE);
    assert_int_equal(ascc_measure_pairs(&bad, 0.1, 1, &pairs), ASCC_ERROR_NOT_FINITE);
    assert_true(isnan(pairs.min_distance));
    assert_int_equal(ascc_measure_motion(&bad, NULL, &sums), ASCC_ERROR_NOT_FINITE);
}

/* The six faces of the unit cube, `side` points a row, normals inward. */
static size_t make_box(size_t side, double *wall, double *normal)
{
    size_t n = 0;
    for (size_t face = 0; face < 6; face++)
        for (size_t i = 0; i < side * side; i++, n++) {
            const size_t axis = face / 2, u = (axis + 1) % 3, w = (axis + 2) % 3;
            const double step = 1.0 / (double)side;
            wall[3 * n + axis] = (double)(face % 2);
            wall[3 * n + u] = ((double)(i % side) + 0.5) * step;
            wall[3 * n + w] = ((double)(i / side) + 0.5) * step;
            normal[3 * n + axis] = face % 2 ? -1.0 : 1.0;
            normal[3 * n + u] = normal[3 * n + w] = 0.0;
        }
    return n;
}

static void particles_beyond_a_closed_box_escape(void **state)
{
    enum { SIDE = 20 };
    static double wall[6 * SIDE * SIDE * 3], normal[6 * SIDE * SIDE * 3];
    const size_t walls = make_box(SIDE, wall, normal);
    const double x[] = {0.5,  0.5, 0.5,  0.01, 0.01, 0.99, -0.02, 0.5,  0.5,   /* three inside */
                        -0.2, 0.1, 0.5,  1.2,  1.3,  1.1,  0.5,   -9.0, 0.5,   /* three outside */
                        0.5,  0.5, 1e12, NAN,  0.5,  0.5,  0.97,  0.98, 0.02}; /* outside, -, in */
    const ascc_measure_set set = SET3(x);
    ascc_measure_escape escape;
    (void)state;
    assert_int_equal(ascc_measure_escapes(&set, walls, wall, normal, 0.05, 2, &escape), ASCC_OK);
    assert_int_equal(escape.count, 4);
    assert_near(escape.farthest, 1e12 - 1.0, 1e-3); /* doubles near 1e12 are 1.2e-4 apart */
}

static void escapes_begin_at_half_a_spacing(void **state)
{
    enum { SIDE = 20 };
    static double wall[6 * SIDE * SIDE * 3], normal[6 * SIDE * SIDE * 3];
    const size_t walls = make_box(SIDE, wall, normal);
    const double x[] = {-0.0249, 0.5, 0.5, 0.5, 1.0251, 0.5};
    const ascc_measure_set set = SET3(x);
    ascc_measure_escape escape;
    (void)state;
    assert_int_equal(ascc_measure_escapes(&set, walls, wall, normal, 0.05, 1, &escape), ASCC_OK);
    assert_int_equal(escape.count, 1);
    /* The nearest wall points lie half a step to both sides. */
    assert_near(escape.farthest, sqrt(0.0251 * 0.0251 + 2 * 0.025 * 0.025), BOUND);
}

static void obstacle_corners_do_not_swallow_the_fluid(void **state)
{
    /* A solid quadrant x < 0, y < 0 in 2D: fluid on its top and at its right. */
    double wall[80], normal[80];
    (void)state;
    for (size_t i = 0; i < 20; i++) {
        const double at = -((double)i + 0.5) * 0.05;
        wall[4 * i] = at, wall[4 * i + 1] = 0.0, normal[4 * i] = 0.0, normal[4 * i + 1] = 1.0;
        wall[4 * i + 2] = 0.0, wall[4 * i + 3] = at, normal[4 * i + 2] = 1.0, normal[4 * i + 3] = 0;
    }
    const double x[] = {-0.06, 0.1, 0.1, -0.06, 0.2, 0.2, -0.5, 0.01, -0.2, -0.3};
    const ascc_measure_set set = {.dimension = 2, .count = 5, .position = x};
    ascc_measure_escape escape;
    assert_int_equal(ascc_measure_escapes(&set, 40, wall, normal, 0.05, 1, &escape), ASCC_OK);
    assert_int_equal(escape.count, 1); /* the last: 0.2 deep in the solid */
    assert_near(escape.farthest, sqrt(0.2 * 0.2 + 0.025 * 0.025), BOUND);
}

static void nothing_escapes_without_walls_or_through_an_open_top(void **state)
{
    enum { SIDE = 20 };
    static double wall[6 * SIDE * SIDE * 3], normal[6 * SIDE * SIDE * 3];
    const size_t walls = make_box(SIDE, wall, normal);
    const double x[] = {0.5, 0.5, 7.0};
    const ascc_measure_set set = SET3(x);
    ascc_measure_escape escape;
    (void)state;
    assert_int_equal(ascc_measure_escapes(&set, 0, NULL, NULL, 0.05, 1, &escape), ASCC_OK);
    assert_int_equal(escape.count, 0);
    const size_t open = walls - SIDE * SIDE; /* the last face is the top, z = 1 */
    assert_int_equal(ascc_measure_escapes(&set, open, wall, normal, 0.05, 1, &escape), ASCC_OK);
    assert_int_equal(escape.count, 0);
}

/* ---- Distances ------------------------------------------------------------------------------- */

static void a_shift_is_its_own_error(void **state)
{
    const double x[] = {0, 0, 0, 5, 1, 2}, y[] = {3, 4, 0, 8, 5, 2};
    const ascc_measure_set a = SET3(x), b = SET3(y);
    double rmse, mean;
    (void)state;
    assert_int_equal(ascc_measure_rmse(&a, &b, &rmse), ASCC_OK);
    assert_int_equal(ascc_measure_mean_distance(&a, &b, &mean), ASCC_OK);
    assert_true(rmse == 5.0 && mean == 5.0);
}

static void distances_agree_with_numpy(void **state)
{
    const ascc_measure_set a = golden_set("a"), b = golden_set("b");
    double rmse, mean;
    (void)state;
    assert_int_equal(ascc_measure_rmse(&a, &b, &rmse), ASCC_OK);
    assert_int_equal(ascc_measure_mean_distance(&a, &b, &mean), ASCC_OK);
    assert_near(rmse, number("rmse_ab", 0), BOUND);
    assert_near(mean, number("mean_distance_ab", 0), BOUND);
}

static void nearest_distances_agree_with_scipy(void **state)
{
    const ascc_measure_set a = golden_set("a"), c = golden_set("c");
    double distance[60], mean, forth, back;
    (void)state;
    assert_int_equal(ascc_measure_nearest(&a, &c, 2, distance, &mean), ASCC_OK);
    for (size_t i = 0; i < 60; i++)
        assert_near(distance[i], number("nearest_a_to_c", i), BOUND);
    assert_int_equal(ascc_measure_chamfer(&a, &c, 2, &forth, &back), ASCC_OK);
    assert_near(forth, number("chamfer_ac", 0), BOUND);
    assert_near(back, number("chamfer_ac", 1), BOUND);
    assert_true(forth == mean);
    const ascc_measure_set p = golden_set("p"), q = golden_set("q");
    assert_int_equal(ascc_measure_chamfer(&p, &q, 1, &forth, &back), ASCC_OK);
    assert_near(forth, number("chamfer_pq", 0), BOUND);
    assert_near(back, number("chamfer_pq", 1), BOUND);
}

static void nearest_equals_brute_force_with_ties_and_outliers(void **state)
{
    enum { COUNT = 700 };
    static double x[COUNT * 3], y[COUNT * 3], distance[COUNT];
    const ascc_measure_set a = SET3(x), b = SET3(y);
    (void)state;
    scatter(x, COUNT * 3, 1);
    scatter(y, COUNT * 3, 2);
    for (size_t i = 0; i < COUNT; i++) { /* a lattice has many equal coordinates and distances */
        y[3 * i] = floor(8.0 * y[3 * i]);
        y[3 * i + 1] = floor(8.0 * y[3 * i + 1]);
        y[3 * i + 2] = i % 50 ? 0.5 : 1e6 * y[3 * i + 2];
    }
    assert_int_equal(ascc_measure_nearest(&a, &b, 3, distance, NULL), ASCC_OK);
    for (size_t i = 0; i < COUNT; i++) {
        double least = INFINITY;
        for (size_t j = 0; j < COUNT; j++) {
            double square = 0.0;
            for (size_t c = 0; c < 3; c++)
                square += (y[3 * j + c] - x[3 * i + c]) * (y[3 * j + c] - x[3 * i + c]);
            least = fmin(least, square);
        }
        assert_true(distance[i] == sqrt(least));
    }
}

static void exact_emd_agrees_with_scipy(void **state)
{
    const ascc_measure_set a = golden_set("a"), b = golden_set("b");
    const ascc_measure_set p = golden_set("p"), q = golden_set("q");
    uint32_t to[60];
    uint8_t seen[60] = {0};
    double emd;
    (void)state;
    assert_int_equal(ascc_measure_emd_exact(&a, &b, 1, &emd, to), ASCC_OK);
    assert_near(emd, number("emd_ab", 0), BOUND);
    for (size_t i = 0; i < 60; i++)
        assert_false(seen[to[i]]++);
    assert_int_equal(ascc_measure_emd_exact(&p, &q, 1, &emd, NULL), ASCC_OK);
    assert_near(emd, number("emd_pq", 0), BOUND);
}

static void exact_emd_of_a_shifted_set_is_the_shift(void **state)
{
    /* Whatever the assignment, the mean distance is at least the distance of the means. */
    enum { COUNT = 500 };
    static double x[COUNT * 3], y[COUNT * 3];
    const ascc_measure_set a = SET3(x), b = SET3(y);
    double emd;
    (void)state;
    scatter(x, COUNT * 3, 3);
    for (size_t i = 0; i < COUNT * 3; i++) /* backwards, shifted by (2, 3, 6) / 14 */
        y[i] = x[3 * (COUNT - 1 - i / 3) + i % 3] + (i % 3 == 0   ? 2.0
                                                     : i % 3 == 1 ? 3.0
                                                                  : 6.0) /
                                                        14;
    assert_int_equal(ascc_measure_emd_exact(&a, &b, 2, &emd, NULL), ASCC_OK);
    assert_near(emd, 0.5, BOUND);
    assert_int_equal(ascc_measure_emd_exact(&a, &a, 2, &emd, NULL), ASCC_OK);
    assert_true(emd == 0.0);
}

static void exact_emd_of_a_lattice_with_ties_is_exact(void **state)
{
    /* Lattice columns moved by one place: n - 1 stay, or all move by 1: both cost 1 per row. */
    enum { SIDE = 12 };
    static double x[SIDE * SIDE * 3], y[SIDE * SIDE * 3];
    const ascc_measure_set a = SET3(x), b = SET3(y);
    double emd;
    (void)state;
    for (size_t i = 0; i < SIDE * SIDE; i++) {
        x[3 * i] = (double)(i % SIDE);
        y[3 * i] = x[3 * i] + 1.0;
        x[3 * i + 1] = y[3 * i + 1] = (double)(i / SIDE);
    }
    assert_int_equal(ascc_measure_emd_exact(&a, &b, 1, &emd, NULL), ASCC_OK);
    assert_near(emd, 1.0, BOUND);
}

static void exact_emd_refuses_what_it_cannot_do(void **state)
{
    static double x[(ASCC_MEASURE_EMD_LIMIT + 1) * 3];
    const ascc_measure_set large = SET3(x);
    ascc_measure_set small = large;
    double emd;
    (void)state;
    small.count = 3;
    assert_int_equal(ascc_measure_emd_exact(&large, &small, 1, &emd, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_emd_exact(&large, &large, 1, &emd, NULL), ASCC_ERROR_LIMIT);
    small.count = 1;
    assert_int_equal(ascc_measure_emd_exact(&small, &small, 1, &emd, NULL), ASCC_OK);
    assert_true(emd == 0.0);
}

static void sinkhorn_agrees_with_scipy(void **state)
{
    /* Both iterate: here to a residual of 1e-9, times a potential of order 1. */
    const char *names[3][3] = {{"a", "b", "ab"}, {"a", "c", "ac"}, {"p", "q", "pq"}};
    const ascc_measure_sinkhorn_options options = {
        .epsilon = number("epsilon", 0), .tolerance = 1e-9, .iterations = 20000, .threads = 2};
    (void)state;
    for (size_t k = 0; k < 3; k++) {
        const ascc_measure_set x = golden_set(names[k][0]), y = golden_set(names[k][1]);
        ascc_measure_sinkhorn_result result;
        char name[32];
        assert_int_equal(ascc_measure_sinkhorn(&x, &y, &options, &result), ASCC_OK);
        snprintf(name, sizeof name, "transport_%s", names[k][2]);
        assert_near(result.transport, number(name, 0), 1e-9);
        snprintf(name, sizeof name, "sinkhorn_%s", names[k][2]);
        assert_near(result.divergence, number(name, 0), 1e-9);
    }
}

static void sinkhorn_of_equal_sets_is_zero_and_tends_to_the_emd(void **state)
{
    const ascc_measure_set a = golden_set("a"), b = golden_set("b");
    ascc_measure_sinkhorn_options options = {.epsilon = 0.02};
    ascc_measure_sinkhorn_result result;
    (void)state;
    assert_int_equal(ascc_measure_sinkhorn(&a, &a, &options, &result), ASCC_OK);
    assert_near(result.divergence, 0.0, 1e-4);
    options.epsilon = 1e-3;
    options.iterations = 20000;
    assert_int_equal(ascc_measure_sinkhorn(&a, &b, &options, &result), ASCC_OK);
    /* At most epsilon times the entropy, log 60, above; debiasing takes about half of it off. */
    assert_near(result.divergence, number("emd_ab", 0), 1e-3 * log(60.0));
}

static void sinkhorn_says_when_it_did_not_converge(void **state)
{
    const ascc_measure_set a = golden_set("a"), b = golden_set("b");
    const ascc_measure_sinkhorn_options options = {
        .epsilon = 1e-3, .tolerance = 1e-12, .iterations = 3};
    ascc_measure_sinkhorn_result result;
    (void)state;
    assert_int_equal(ascc_measure_sinkhorn(&a, &b, &options, &result), ASCC_ERROR_LIMIT);
    assert_true(result.residual > 1e-12);
    assert_int_equal(result.iterations, 3);
}

/* ---- Speeds and densities -------------------------------------------------------------------- */

static void speeds_fall_into_their_bins(void **state)
{
    const double x[15] = {0};
    const double v[] = {0, 0, 0, 0, 0, 0.25, 3, 4, 0, 0, -9.95, 0, 0, 300, 400};
    ascc_measure_set set = SET3(x);
    uint64_t bins[ASCC_MEASURE_SPEED_BINS];
    (void)state;
    set.velocity = v;
    assert_int_equal(ascc_measure_speed_histogram(&set, bins), ASCC_OK);
    assert_true(bins[0] == 1 && bins[2] == 1 && bins[50] == 1 && bins[99] == 1 && bins[100] == 1);
}

static void speed_divergence_agrees_with_scipy(void **state)
{
    ascc_measure_set a = golden_set("a"), b = golden_set("b");
    uint64_t bins_a[ASCC_MEASURE_SPEED_BINS], bins_b[ASCC_MEASURE_SPEED_BINS];
    (void)state;
    a.velocity = find("va")->value;
    b.velocity = find("vb")->value;
    assert_int_equal(ascc_measure_speed_histogram(&a, bins_a), ASCC_OK);
    assert_int_equal(ascc_measure_speed_histogram(&b, bins_b), ASCC_OK);
    for (size_t k = 0; k < ASCC_MEASURE_SPEED_BINS; k++)
        assert_true((double)bins_a[k] == number("histogram_va", k));
    assert_near(ascc_measure_jsd(bins_a, bins_b, ASCC_MEASURE_SPEED_BINS), number("jsd", 0), BOUND);
}

static void divergence_is_zero_for_equal_and_one_for_disjoint(void **state)
{
    const uint64_t a[] = {1, 2, 0, 0}, twice[] = {2, 4, 0, 0}, other[] = {0, 0, 5, 1},
                   none[4] = {0};
    (void)state;
    assert_near(ascc_measure_jsd(a, twice, 4), 0.0, BOUND);
    assert_near(ascc_measure_jsd(a, other, 4), 1.0, BOUND);
    assert_true(isnan(ascc_measure_jsd(a, none, 4)));
}

static void densities_agree_with_numpy(void **state)
{
    const ascc_measure_set a = golden_set("a"), p = golden_set("p");
    const double radius = 2.0 * number("spacing", 0);
    double density[60];
    (void)state;
    assert_int_equal(ascc_measure_density(&a, 0, NULL, radius, 2, density), ASCC_OK);
    for (size_t i = 0; i < 60; i++)
        assert_near(density[i], number("density_a", i), BOUND);
    assert_int_equal(ascc_measure_density(&a, 45, find("c")->value, radius, 2, density), ASCC_OK);
    for (size_t i = 0; i < 60; i++)
        assert_near(density[i], number("density_a_with_c", i), BOUND);
    assert_int_equal(ascc_measure_density(&p, 0, NULL, radius, 2, density), ASCC_OK);
    for (size_t i = 0; i < 50; i++)
        assert_near(density[i], number("density_p", i), BOUND);
}

static void a_lattice_is_at_rest_density(void **state)
{
    double x[343 * 3], density[343];
    const ascc_measure_set set = SET3(x);
    (void)state;
    for (size_t i = 0; i < 343; i++) {
        x[3 * i] = 0.5 * (double)(i % 7);
        x[3 * i + 1] = 0.5 * (double)(i / 7 % 7);
        x[3 * i + 2] = 0.5 * (double)(i / 49);
    }
    assert_int_equal(ascc_measure_density(&set, 0, NULL, 1.0, 1, density), ASCC_OK);
    assert_near(density[171], ascc_measure_rest_density(3), BOUND);
    assert_near(ascc_measure_rest_density(2), number("rest", 0), BOUND);
    assert_near(ascc_measure_rest_density(3), number("rest", 1), BOUND);
}

static void density_errors_agree_with_numpy(void **state)
{
    const ascc_measure_set a = golden_set("a"), b = golden_set("b");
    const double radius = 2.0 * number("spacing", 0), rest = ascc_measure_rest_density(3);
    double da[60], db[60];
    ascc_measure_density_error error;
    (void)state;
    assert_int_equal(ascc_measure_density(&a, 0, NULL, radius, 1, da), ASCC_OK);
    assert_int_equal(ascc_measure_density(&b, 0, NULL, radius, 1, db), ASCC_OK);
    assert_int_equal(ascc_measure_compare_density(60, da, 60, db, rest, &error), ASCC_OK);
    assert_near(error.maximum, number("density_error", 0), BOUND);
    assert_near(error.mean, number("density_error", 1), BOUND);
    assert_near(error.particle, number("density_error", 2), BOUND);
    assert_near(error.published, number("density_error", 3), BOUND);
    assert_int_equal(ascc_measure_compare_density(59, da, 60, db, rest, &error), ASCC_OK);
    assert_true(isnan(error.particle) && isfinite(error.mean));
}

static void pairs_agree_with_scipy(void **state)
{
    const char *names[2] = {"a", "p"};
    (void)state;
    for (size_t k = 0; k < 2; k++) {
        const ascc_measure_set set = golden_set(names[k]);
        ascc_measure_pair_spacing pairs;
        const double *expected = find(k ? "pairs_p" : "pairs_a")->value;
        assert_int_equal(ascc_measure_pairs(&set, number("spacing", 0), 2, &pairs), ASCC_OK);
        assert_near(pairs.min_distance, expected[0], BOUND);
        assert_true((double)pairs.pair_count == expected[1]);
        assert_true((double)pairs.close_count == expected[2]);
        assert_true((double)pairs.tight_count == expected[3]);
        assert_near(pairs.close_fraction, expected[2] / expected[1], BOUND);
        assert_near(pairs.tight_fraction, expected[3] / expected[1], BOUND);
    }
}

static void coincident_and_lonely_particles_have_spacings(void **state)
{
    const double x[] = {1, 1, 1, 1, 1, 1, 5, 5, 5};
    ascc_measure_set set = SET3(x);
    ascc_measure_pair_spacing pairs;
    (void)state;
    assert_int_equal(ascc_measure_pairs(&set, 0.1, 1, &pairs), ASCC_OK);
    assert_true(pairs.min_distance == 0.0 && pairs.pair_count == 1 && pairs.tight_fraction == 1.0);
    set.count = 1;
    assert_int_equal(ascc_measure_pairs(&set, 0.1, 1, &pairs), ASCC_OK);
    assert_true(isinf(pairs.min_distance) && pairs.close_fraction == 0.0);
}

/* ---- Energy and momentum --------------------------------------------------------------------- */

static void motion_agrees_with_numpy(void **state)
{
    ascc_measure_set set = golden_set("a");
    ascc_measure_motion_sums sums;
    (void)state;
    set.velocity = find("va")->value;
    set.mass = find("mass")->value;
    assert_int_equal(ascc_measure_motion(&set, find("gravity")->value, &sums), ASCC_OK);
    for (size_t c = 0; c < 3; c++) {
        assert_near(sums.center[c], number("center", c), BOUND);
        assert_near(sums.momentum[c], number("momentum", c), 1e-11); /* terms up to 10 */
        assert_near(sums.angular[c], number("angular", c), 1e-11);
        assert_near(sums.angular_about_center[c], number("angular_about_center", c), 1e-11);
    }
    const double got[6] = {sums.mass,    sums.momentum_scale, sums.angular_scale,
                           sums.kinetic, sums.potential,      sums.max_speed};
    for (size_t i = 0; i < 6; i++)
        assert_near(got[i], number("sums", i), 1e-10); /* sums of several hundred */
}

static void a_turning_pair_has_angular_momentum_only(void **state)
{
    const double x[] = {1, 0, -1, 0}, v[] = {0, 2, 0, -2}, g[] = {0, -10};
    const ascc_measure_set set = {
        .dimension = 2, .count = 2, .position = x, .velocity = v, .particle_mass = 3.0};
    ascc_measure_motion_sums sums, truth;
    (void)state;
    assert_int_equal(ascc_measure_motion(&set, g, &sums), ASCC_OK);
    assert_true(sums.momentum[0] == 0.0 && sums.momentum[1] == 0.0 && sums.angular[2] == 12.0);
    assert_true(sums.kinetic == 12.0 && sums.potential == 0.0 && sums.angular_scale == 12.0);
    truth = sums;
    assert_true(ascc_measure_angular_error(&sums, &truth) == 0.0);
    sums.angular[2] = 9.0;
    sums.momentum[1] = 3.0;
    assert_true(ascc_measure_angular_error(&sums, &truth) == 0.25);
    assert_true(ascc_measure_momentum_error(&sums, &truth) == 0.25); /* 3 / (2 * 3 * 2) */
}

static void potential_energy_released_by_a_fall_is_m_g_h(void **state)
{
    const double high[] = {0, 5, 0}, low[] = {0, 3, 0}, g[] = {0, -10, 0};
    ascc_measure_set set = SET3(high);
    ascc_measure_motion_sums before, after;
    (void)state;
    set.particle_mass = 2.0;
    assert_int_equal(ascc_measure_motion(&set, g, &before), ASCC_OK);
    set.position = low;
    assert_int_equal(ascc_measure_motion(&set, g, &after), ASCC_OK);
    assert_true(before.potential - after.potential == 40.0);
}

static void drift_and_wall_balance_see_what_is_missing(void **state)
{
    const double start[3] = {3, 4, 0}, now[3] = {3, 4, -1}, none[3] = {0}, gravity[3] = {0, 0, -2};
    const double half[3] = {0, 0, -1};
    (void)state;
    assert_near(ascc_measure_drift(now, start, none), 0.2, 1e-10); /* the 1e-10 in the definition */
    assert_true(ascc_measure_drift(start, start, none) == 0.0);
    assert_true(ascc_measure_drift(now, start, half) == 0.0);
    /* Gravity gave -2, the wall took -1, -1 remains: balanced. Without the wall 1 is missing of 3. */
    assert_true(ascc_measure_wall_balance(start, now, gravity, half) == 0.0);
    assert_near(ascc_measure_wall_balance(start, now, gravity, none), 1.0 / 3.0, BOUND);
    assert_true(ascc_measure_wall_balance(none, none, none, none) == 0.0);
}

/* ---- All ------------------------------------------------------------------------------------- */

static void results_do_not_depend_on_threads(void **state)
{
    enum { COUNT = 900 };
    static double x[COUNT * 3], y[COUNT * 3], density[COUNT], first_density[COUNT];
    const ascc_measure_set a = SET3(x), b = SET3(y);
    const int32_t threads[] = {1, 2, 3, 7};
    double first[6] = {0};
    (void)state;
    scatter(x, COUNT * 3, 11);
    scatter(y, COUNT * 3, 12);
    for (size_t k = 0; k < 4; k++) {
        double value[6] = {0};
        ascc_measure_sinkhorn_result sinkhorn;
        ascc_measure_pair_spacing pairs;
        const ascc_measure_sinkhorn_options options = {
            .epsilon = 0.1, .tolerance = 1e-3, .threads = threads[k]};
        assert_int_equal(ascc_measure_chamfer(&a, &b, threads[k], &value[0], &value[1]), ASCC_OK);
        assert_int_equal(ascc_measure_emd_exact(&a, &b, threads[k], &value[2], NULL), ASCC_OK);
        assert_int_equal(ascc_measure_sinkhorn(&a, &b, &options, &sinkhorn), ASCC_OK);
        assert_int_equal(ascc_measure_pairs(&a, 0.1, threads[k], &pairs), ASCC_OK);
        assert_int_equal(ascc_measure_density(&a, COUNT, y, 0.2, threads[k], density), ASCC_OK);
        value[3] = sinkhorn.divergence;
        value[4] = pairs.min_distance;
        value[5] = pairs.close_fraction;
        if (k == 0) {
            memcpy(first, value, sizeof first);
            memcpy(first_density, density, sizeof first_density);
        }
        assert_memory_equal(value, first, sizeof first);
        assert_memory_equal(density, first_density, sizeof first_density);
    }
}

static void subsets_are_even(void **state)
{
    const size_t expected[4] = {1, 3, 6, 8};
    size_t index[10];
    (void)state;
    ascc_measure_subset(10, 4, index);
    assert_memory_equal(index, expected, sizeof expected);
    ascc_measure_subset(10, 10, index);
    for (size_t i = 0; i < 10; i++)
        assert_int_equal(index[i], i);
}

static void arguments_that_do_not_fit_are_refused(void **state)
{
    const double x[] = {0, 0, 0, 1, 1, 1};
    const ascc_measure_set three = SET3(x);
    const ascc_measure_set flat = {.dimension = 2, .count = 2, .position = x};
    const ascc_measure_set line = {.dimension = 1, .count = 2, .position = x};
    const ascc_measure_set empty = {.dimension = 3};
    ascc_measure_sinkhorn_options options = {.epsilon = 0.0};
    ascc_measure_sinkhorn_result result;
    double value, other;
    (void)state;
    assert_int_equal(ascc_measure_rmse(&three, &flat, &value), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_rmse(&line, &line, &value), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_rmse(&three, NULL, &value), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_rmse(&three, &three, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_chamfer(&three, &empty, 1, &value, &other), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_emd_exact(&three, &flat, 1, &value, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_sinkhorn(&three, &three, &options, &result), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_density(&three, 1, NULL, 0.1, 1, &value), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_measure_motion(&line, NULL, NULL), ASCC_ERROR_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(particles_that_are_not_finite_are_counted),
        cmocka_unit_test(sets_that_are_not_finite_have_no_distances),
        cmocka_unit_test(particles_beyond_a_closed_box_escape),
        cmocka_unit_test(escapes_begin_at_half_a_spacing),
        cmocka_unit_test(obstacle_corners_do_not_swallow_the_fluid),
        cmocka_unit_test(nothing_escapes_without_walls_or_through_an_open_top),
        cmocka_unit_test(a_shift_is_its_own_error),
        cmocka_unit_test(distances_agree_with_numpy),
        cmocka_unit_test(nearest_distances_agree_with_scipy),
        cmocka_unit_test(nearest_equals_brute_force_with_ties_and_outliers),
        cmocka_unit_test(exact_emd_agrees_with_scipy),
        cmocka_unit_test(exact_emd_of_a_shifted_set_is_the_shift),
        cmocka_unit_test(exact_emd_of_a_lattice_with_ties_is_exact),
        cmocka_unit_test(exact_emd_refuses_what_it_cannot_do),
        cmocka_unit_test(sinkhorn_agrees_with_scipy),
        cmocka_unit_test(sinkhorn_of_equal_sets_is_zero_and_tends_to_the_emd),
        cmocka_unit_test(sinkhorn_says_when_it_did_not_converge),
        cmocka_unit_test(speeds_fall_into_their_bins),
        cmocka_unit_test(speed_divergence_agrees_with_scipy),
        cmocka_unit_test(divergence_is_zero_for_equal_and_one_for_disjoint),
        cmocka_unit_test(densities_agree_with_numpy),
        cmocka_unit_test(a_lattice_is_at_rest_density),
        cmocka_unit_test(density_errors_agree_with_numpy),
        cmocka_unit_test(pairs_agree_with_scipy),
        cmocka_unit_test(coincident_and_lonely_particles_have_spacings),
        cmocka_unit_test(motion_agrees_with_numpy),
        cmocka_unit_test(a_turning_pair_has_angular_momentum_only),
        cmocka_unit_test(potential_energy_released_by_a_fall_is_m_g_h),
        cmocka_unit_test(drift_and_wall_balance_see_what_is_missing),
        cmocka_unit_test(results_do_not_depend_on_threads),
        cmocka_unit_test(subsets_are_even),
        cmocka_unit_test(arguments_that_do_not_fit_are_refused),
    };
    return cmocka_run_group_tests(tests, load_golden, free_golden);
}
