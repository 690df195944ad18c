/* Coarser point sets against the definitions, point by point. SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/resample.h"
#include "support/tools.h"

static double *cloud(dice *d, size_t count, int dimension, double low, double high)
{
    double *x = calloc(count * (size_t)dimension + 1, sizeof *x);
    for (size_t i = 0; i < count * (size_t)dimension; i++)
        x[i] = dice_uniform(d, low, high);
    return x;
}

static bool contains(const ascc_points *points, const double at[3], double tolerance)
{
    for (size_t i = 0; i < points->count; i++) {
        bool same = true;
        for (int c = 0; c < 3; c++)
            same &= fabs((double)points->position[c][i] - at[c]) <= tolerance;
        if (same)
            return true;
    }
    return false;
}

static void centers_are_those_of_the_occupied_voxels(void **state)
{
    (void)state;
    dice d = {21};
    for (int dimension = 2; dimension <= 3; dimension++) {
        test_tools t;
        tools_open(&t, 1, 0);
        const size_t n = 300;
        double *x = cloud(&d, n, dimension, -0.4, 0.3);
        const ascc_scale scale = ascc_scale_for_radius(0.4);
        const ascc_points p = points_of(&t, &scale, x, n, dimension);
        const double voxel = 0.1 * scale.inverse;
        ascc_points s;
        assert_int_equal(ascc_sample_centers(&s, &t.search, &p, dimension, voxel), ASCC_OK);
        for (size_t i = 0; i < n; i++) { /* every point's voxel is there */
            double center[3] = {0};
            for (int c = 0; c < dimension; c++)
                center[c] = (floor((double)p.position[c][i] / voxel) + 0.5) * voxel;
            assert_true(contains(&s, center, 1.0));
        }
        for (size_t k = 0; k < s.count; k++) { /* and no other */
            bool occupied = false;
            for (size_t i = 0; i < n && !occupied; i++) {
                occupied = true;
                for (int c = 0; c < dimension; c++)
                    occupied &= floor((double)p.position[c][i] / voxel) ==
                                floor((double)s.position[c][k] / voxel);
            }
            assert_true(occupied);
        }
        free(x);
        tools_close(&t);
    }
}

static void world_anchored_centers_do_not_move_with_a_far_point(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    dice d = {22};
    double *x = cloud(&d, 101, 3, 0.0, 0.5);
    x[300] = 700.0;
    const ascc_scale scale = ascc_scale_for_radius(0.4);
    const ascc_points far = points_of(&t, &scale, x, 101, 3),
                      near = points_of(&t, &scale, x, 100, 3);
    ascc_points a, b;
    assert_int_equal(ascc_sample_centers(&a, &t.search, &near, 3, 0.1 * scale.inverse), ASCC_OK);
    assert_int_equal(ascc_sample_centers(&b, &t.search, &far, 3, 0.1 * scale.inverse), ASCC_OK);
    assert_int_equal(a.count + 1, b.count);
    for (size_t i = 0; i < a.count; i++) {
        const double at[3] = {(double)a.position[0][i], (double)a.position[1][i],
                              (double)a.position[2][i]};
        assert_true(contains(&b, at, 0.0));
    }
    free(x);
    tools_close(&t);
}

static void corners_are_those_of_both_shifted_cells(void **state)
{
    (void)state;
    dice d = {23};
    for (int dimension = 2; dimension <= 3; dimension++) {
        test_tools t;
        tools_open(&t, 1, 0);
        const size_t n = 120;
        double *x = cloud(&d, n, dimension, -0.3, 0.3);
        const ascc_scale scale = ascc_scale_for_radius(0.4);
        const ascc_points p = points_of(&t, &scale, x, n, dimension);
        const double voxel = 0.1 * scale.inverse;
        double anchor[3];
        ascc_centroid(&p, anchor);
        ascc_points s;
        assert_int_equal(ascc_sample_corners(&s, &t.search, &p, dimension, voxel, 0.1, anchor),
                         ASCC_OK);
        uint8_t *reached = calloc(s.count, 1);
        for (size_t i = 0; i < n; i++)
            for (int side = -1; side <= 1; side += 2)
                for (int k = 0; k < 1 << dimension; k++) {
                    double at[3] = {0};
                    for (int c = 0; c < dimension; c++)
                        at[c] =
                            (floor(((double)p.position[c][i] - anchor[c]) / voxel + side * 0.1) +
                             (k >> c & 1)) *
                                voxel +
                            anchor[c];
                    bool found = false;
                    for (size_t j = 0; j < s.count; j++)
                        if (fabs((double)s.position[0][j] - at[0]) <= 1.0 &&
                            fabs((double)s.position[1][j] - at[1]) <= 1.0 &&
                            fabs((double)s.position[2][j] - at[2]) <= 1.0) {
                            found = true;
                            reached[j] = 1;
                        }
                    assert_true(found);
                }
        for (size_t j = 0; j < s.count; j++)
            assert_int_equal(reached[j], 1);
        free(reached);
        free(x);
        tools_close(&t);
    }
}

static void the_centroid_is_exact_whatever_the_order(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    const ascc_scale scale = {1.0, 1.0};
    double x[] = {-5, 1e15, 7, 3, -1e15, 9, -8, 6, 2, 14, -6, -14}, y[12];
    for (size_t i = 0; i < 4; i++)
        memcpy(y + i * 3, x + (3 - i) * 3, 3 * sizeof *x);
    const ascc_points p = points_of(&t, &scale, x, 4, 3), q = points_of(&t, &scale, y, 4, 3);
    double a[3], b[3];
    ascc_centroid(&p, a);
    ascc_centroid(&q, b);
    assert_true(a[0] == 1.0 && a[1] == 0.0 && a[2] == 1.0);
    assert_memory_equal(a, b, sizeof a);
    tools_close(&t);
}

static void farthest_points_are_each_the_farthest_from_those_before(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    dice d = {24};
    const size_t n = 200, m = 25;
    double *x = cloud(&d, n, 3, 0.0, 1.0);
    const ascc_scale scale = ascc_scale_for_radius(0.4);
    const ascc_points p = points_of(&t, &scale, x, n, 3);
    ascc_points s;
    assert_int_equal(ascc_sample_farthest(&s, &t.search, &p, m), ASCC_OK);
    assert_int_equal(s.count, m);
    size_t chosen[25] = {0}; /* the greedy choice, written plainly */
    for (size_t k = 1; k < m; k++) {
        double best = -1.0;
        for (size_t i = 0; i < n; i++) {
            double nearest = INFINITY;
            for (size_t j = 0; j < k; j++) {
                double square = 0.0;
                for (int c = 0; c < 3; c++)
                    square += pow((double)(p.position[c][i] - p.position[c][chosen[j]]), 2.0);
                nearest = fmin(nearest, square);
            }
            if (nearest > best) {
                best = nearest;
                chosen[k] = i;
            }
        }
    }
    for (size_t k = 0; k < m; k++) {
        const double at[3] = {(double)p.position[0][chosen[k]], (double)p.position[1][chosen[k]],
                              (double)p.position[2][chosen[k]]};
        assert_true(contains(&s, at, 0.0));
    }
    free(x);
    tools_close(&t);
}

/* The samples of a cloud with strays are those of the cloud, in their order, and those of the strays. */
static void strays_leave_the_voxels_of_the_others(void **state)
{
    (void)state;
    dice d = {26};
    for (int round = 0; round < 24; round++) {
        test_tools t;
        tools_open(&t, 1 + round % 3, 0);
        const int dimension = 2 + round % 2, corners = round / 2 % 3; /* 2: with hysteresis */
        const double far = pow(10.0, 2 + round / 3);
        const size_t n = 300, strays = 5, axes = (size_t)dimension;
        double *x = cloud(&d, n + strays, dimension, -0.4, 0.3);
        for (size_t i = 0; i < n * axes; i += 7) /* gaps within a wide voxel, and next to it */
            x[i] += 3.0 * (double)(i % 5);
        for (size_t i = 0; i < strays; i++)
            for (size_t c = 0; c < axes; c++)
                if (i % axes == c || i >= 3)
                    x[(n + i) * axes + c] += i % 2 ? far : -far;
        const ascc_scale scale = ascc_scale_for_radius(0.4);
        const ascc_points both = points_of(&t, &scale, x, n + strays, dimension),
                          near = points_of(&t, &scale, x, n, dimension),
                          away = points_of(&t, &scale, x + n * axes, strays, dimension);
        const ascc_points *from[3] = {&both, &near, &away};
        const double voxel = (round / 2 % 2 ? 0.1 : 4.0) * scale.inverse;
        ascc_points s[3];
        for (int k = 0; k < 3; k++)
            assert_int_equal(
                corners ? ascc_sample_corners(&s[k], &t.search, from[k], dimension, voxel,
                                              0.1 * (corners - 1), (const double[3]){0.0, 0.0, 0.0})
                        : ascc_sample_centers(&s[k], &t.search, from[k], dimension, voxel),
                ASCC_OK);
        assert_int_equal(s[0].count, s[1].count + s[2].count);
        size_t next[3] = {0, 0, 0};
        for (size_t i = 0; i < s[0].count; i++) {
            int owner = 0;
            for (int k = 1; k < 3; k++) {
                bool same = next[k] < s[k].count;
                for (int c = 0; c < 3 && same; c++)
                    same = s[k].position[c][next[k]] == s[0].position[c][i] &&
                           s[k].low[c][next[k]] == s[0].low[c][i];
                owner = same ? k : owner;
            }
            assert_true(owner);
            next[owner]++;
        }
        free(x);
        tools_close(&t);
    }
}

static void voxels_too_fine_or_too_wide_to_count_are_an_error(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    double x[6] = {-1e9, -1e9, -1e9, 1e9, 1e9, 1e9};
    const ascc_scale scale = ascc_scale_for_radius(0.4);
    const ascc_points p = points_of(&t, &scale, x, 2, 3);
    const double anchor[3] = {0.0, 0.0, 0.0};
    ascc_points s;
    assert_int_equal(ascc_sample_centers(&s, &t.search, &p, 3, 0.01), ASCC_ERROR_RANGE);
    assert_non_null(strstr(t.message.text, "voxels of 0.01 units"));
    assert_int_equal(ascc_sample_corners(&s, &t.search, &p, 3, 1e30, 0.1, anchor),
                     ASCC_ERROR_RANGE);
    tools_close(&t);
}

/* Kernel density at height y above a floor, over many places: poly6 of support 4 spacings. */
static double density_at(const ascc_points *points, double y, double support)
{
    double sum = 0.0;
    for (int u = 0; u < 12; u++) {
        const double x = (0.31 * u - 1.7) * 0.1 * support, z = (0.17 * u - 0.9) * 0.2 * support;
        for (size_t i = 0; i < points->count; i++) {
            const double dx = (double)points->position[0][i] - x,
                         dy = (double)points->position[1][i] - y,
                         dz = (double)points->position[2][i] - z;
            const double q = 1.0 - (dx * dx + dy * dy + dz * dz) / (support * support);
            sum += q > 0.0 ? q * q * q : 0.0;
        }
    }
    return sum;
}

/* A deep box of jittered fluid over a floor; the solid continues the lattice below y = 0, if there. */
static size_t fluid_over_floor(dice *d, double *x, double spacing, bool with_floor)
{
    size_t n = 0;
    for (int k = -14; k < 14; k++)
        for (int j = with_floor ? -8 : 0; j < 18; j++)
            for (int i = -14; i < 14; i++) {
                const double jitter = j < 0 ? 0.0 : 0.1;
                x[n * 3] = (i + 0.5 + dice_uniform(d, -jitter, jitter)) * spacing;
                x[n * 3 + 1] = (j + 0.5 + dice_uniform(d, -jitter, jitter)) * spacing;
                x[n * 3 + 2] = (k + 0.5 + dice_uniform(d, -jitter, jitter)) * spacing;
                n++;
            }
    return n;
}

/* Largest difference of the two normalised profiles from the floor to the middle of the fluid. */
static double profile_change(test_tools *t, bool with_floor)
{
    dice d = {25};
    const double spacing = 0.05;
    double *x = calloc((size_t)28 * 28 * 26 * 3, sizeof *x);
    const size_t n = fluid_over_floor(&d, x, spacing, with_floor);
    const ascc_scale scale = ascc_scale_for_radius(0.4);
    const ascc_points fine = points_of(t, &scale, x, n, 3);
    ascc_points coarse;
    assert_int_equal(
        ascc_sample_centers(&coarse, &t->search, &fine, 3, 2.0 * spacing * scale.inverse), ASCC_OK);
    const double support = 6.0 * spacing * scale.inverse, middle = 9.0 * spacing * scale.inverse;
    const double fine_rest = density_at(&fine, middle, support);
    const double coarse_rest = density_at(&coarse, middle, support);
    double largest = 0.0;
    for (int j = 0; j <= 8; j++) {
        const double y = (j + 0.5) * spacing * scale.inverse;
        largest = fmax(largest, fabs(density_at(&coarse, y, support) / coarse_rest -
                                     density_at(&fine, y, support) / fine_rest));
    }
    free(x);
    return largest;
}

static void density_near_a_wall_stays_within_2_percent_when_downsampled(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    const double change = profile_change(&t, true);
    print_message("largest change of the normalised density profile: %.4f\n", change);
    assert_true(change < 0.02);
    tools_close(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(centers_are_those_of_the_occupied_voxels),
        cmocka_unit_test(world_anchored_centers_do_not_move_with_a_far_point),
        cmocka_unit_test(corners_are_those_of_both_shifted_cells),
        cmocka_unit_test(the_centroid_is_exact_whatever_the_order),
        cmocka_unit_test(farthest_points_are_each_the_farthest_from_those_before),
        cmocka_unit_test(strays_leave_the_voxels_of_the_others),
        cmocka_unit_test(voxels_too_fine_or_too_wide_to_count_are_an_error),
        cmocka_unit_test(density_near_a_wall_stays_within_2_percent_when_downsampled),
    };
    return cmocka_run_group_tests_name("resample", tests, NULL, NULL);
}
