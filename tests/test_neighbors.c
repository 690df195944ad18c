/* Neighbour search against brute force in any domain. SPDX-License-Identifier: MIT */
#include <math.h>

#include "support/tools.h"

/* Everything a search needs, from host positions. */
typedef struct search_case {
    ascc_scale scale;
    ascc_points query, source;
    ascc_extent extent;
    ascc_grid query_grid, source_grid;
    ascc_rows rows;
} search_case;

static ascc_status build(search_case *s, test_tools *t, const double *query, size_t queries,
                         const double *source, size_t sources, int dimension, double radius)
{
    s->scale = ascc_scale_for_radius(radius);
    s->query = points_of(t, &s->scale, query, queries, dimension);
    s->source = source ? points_of(t, &s->scale, source, sources, dimension) : s->query;
    ascc_extent_start(&s->extent);
    ascc_extent_add(&s->extent, &s->query);
    ascc_extent_add(&s->extent, &s->source);
    const double r = radius * s->scale.inverse;
    ascc_status status =
        ascc_grid_build(&s->query_grid, &t->search, &s->query, &s->extent, r, false);
    if (status == ASCC_OK)
        status = ascc_grid_build(&s->source_grid, &t->search, &s->source, &s->extent, r, false);
    s->rows = (ascc_rows){.query = &s->query,
                          .source = &s->source,
                          .query_grid = &s->query_grid,
                          .source_grid = &s->source_grid,
                          .radius = r,
                          .same = !source,
                          .max_neighbors = 100000};
    if (status == ASCC_OK)
        status = ascc_rows_open(&s->rows, &t->search, 1);
    return status;
}

/* Squared distance in units, exact while it fits a double. */
static double square_of(const search_case *s, size_t i, size_t j)
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        const double d = (double)(s->source.position[c][j] - s->query.position[c][i]);
        square += d * d;
    }
    return square;
}

static void check_rows(const search_case *s)
{
    const double limit = s->rows.radius * s->rows.radius;
    uint8_t *seen = calloc(s->source.count + 1, 1);
    for (size_t i = 0; i < s->query.count; i++) {
        memset(seen, 0, s->source.count);
        for (uint32_t k = 0; k < s->rows.count[i]; k++) {
            const uint32_t j = s->rows.neighbor[s->rows.start[i] + k];
            assert_true(j < s->source.count);
            assert_int_equal(seen[j], 0);
            seen[j] = 1;
        }
        for (size_t j = 0; j < s->source.count; j++) {
            const double square = square_of(s, i, j);
            if (fabs(square / limit - 1.0) < 1e-6)
                continue; /* on the radius: windows are zero there */
            const bool skipped = s->rows.skip_self && square == 0.0;
            assert_int_equal(seen[j], square < limit && !skipped);
        }
    }
    free(seen);
}

static double *cloud(dice *d, size_t count, int dimension, double low, double high)
{
    double *x = calloc(count * (size_t)dimension + 1, sizeof *x);
    for (size_t i = 0; i < count * (size_t)dimension; i++)
        x[i] = dice_uniform(d, low, high);
    return x;
}

static void rows_equal_brute_force_in_2d_and_3d(void **state)
{
    (void)state;
    dice d = {7};
    for (int dimension = 2; dimension <= 3; dimension++)
        for (int round = 0; round < 12; round++) {
            test_tools t;
            tools_open(&t, 1 + round % 3, round & 1 ? ASCC_CPU_AVX2 : 0);
            const size_t n = 20 + dice_next(&d) % 400, m = 1 + dice_next(&d) % 400;
            double *a = cloud(&d, n, dimension, -1.0, 0.7);
            double *b = cloud(&d, m, dimension, -0.5, 1.2);
            search_case s;
            assert_int_equal(build(&s, &t, a, n, round % 3 ? b : NULL, m, dimension,
                                   dice_uniform(&d, 0.02, 0.6)),
                             ASCC_OK);
            s.rows.skip_self = round % 4 == 1;
            assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
            check_rows(&s);
            free(a);
            free(b);
            tools_close(&t);
        }
}

static void sparse_points_far_apart_find_only_near_ones(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    dice d = {11};
    const size_t n = 600;
    double *x = calloc(n * 3, sizeof *x);
    for (size_t i = 0; i < n; i++)
        for (size_t c = 0; c < 3; c++) /* clusters up to a million radii apart */
            x[i * 3 + c] = (i % 5 == 0   ? 1e5
                            : i % 5 == 1 ? -3e4
                                         : 0.0) *
                               (c == 1 ? 1.0 : 0.5) +
                           dice_uniform(&d, -0.3, 0.3);
    search_case s;
    assert_int_equal(build(&s, &t, x, n, NULL, 0, 3, 0.1), ASCC_OK);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    check_rows(&s);
    free(x);
    tools_close(&t);
}

/* Rows of a search must be those of brute force, at any distance from each other. */
static void check_search(const double *query, size_t queries, const double *source, size_t sources,
                         int dimension, double radius, int32_t threads)
{
    test_tools t;
    tools_open(&t, threads, 0);
    search_case s;
    if (build(&s, &t, query, queries, source, sources, dimension, radius) != ASCC_OK)
        fail_msg("%s", t.message.text);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    check_rows(&s);
    tools_close(&t);
}

static void strays_on_every_axis_leave_the_neighbours_of_the_others(void **state)
{
    (void)state;
    dice d = {19};
    for (int dimension = 2; dimension <= 3; dimension++)
        for (double far = 1e3; far < 1e10; far *= 10.0) {
            const size_t n = 240, axes = (size_t)dimension;
            double *a = cloud(&d, n, dimension, -0.5, 0.5), *b = cloud(&d, n, dimension, -0.5, 0.5);
            for (size_t i = 0; i < 24; i++) { /* pairs, on one axis or on all, on both sides */
                const size_t axis = i / 2 % 4;
                for (size_t c = 0; c < axes; c++)
                    if (axis == 3 || axis == c)
                        a[i * axes + c] += i < 12 ? far : -far;
                if (i % 3)
                    memcpy(b + i * axes, a + i * axes, axes * sizeof *b);
            }
            check_search(a, n, NULL, 0, dimension, 0.1, 1);
            check_search(a, n, b, n, dimension, 0.1, 3);
            check_search(b, n, a, n, dimension, 0.1, 1);
            free(a);
            free(b);
        }
}

/* Gaps of no cell, of one, of two and of many, between points that only one of the sets may have. */
static void gaps_of_any_width_keep_neighbours_and_make_none(void **state)
{
    (void)state;
    dice d = {23};
    for (int round = 0; round < 60; round++) {
        const int dimension = 2 + round % 2;
        const size_t n = 60, m = 40;
        double *x = calloc((n + m) * 3, sizeof *x);
        double at[3] = {-1e8, -1e8, -1e8};
        for (size_t i = 0; i < n + m; i++)
            for (size_t c = 0; c < (size_t)dimension; c++) {
                static const double step[] = {0.0, 0.05, 0.1, 0.17, 0.25, 0.4, 0.45, 1e3, 4e6};
                at[c] += step[dice_next(&d) % (round % 3 ? 9 : 7)] * dice_uniform(&d, 0.9, 1.1);
                x[i * (size_t)dimension + c] = at[c];
            }
        for (size_t i = 0; i + 1 < n + m; i++) { /* both sets have some of every place */
            const size_t j = i + dice_next(&d) % (n + m - i);
            for (size_t c = 0; c < (size_t)dimension; c++) {
                const double swap = x[i * (size_t)dimension + c];
                x[i * (size_t)dimension + c] = x[j * (size_t)dimension + c];
                x[j * (size_t)dimension + c] = swap;
            }
        }
        check_search(x, n, x + n * (size_t)dimension, m, dimension, 0.1, 1);
        check_search(x, n + m, NULL, 0, dimension, 0.1, 2);
        free(x);
    }
}

/* Kernels see low words only: a cloud and its copy 2^32 units away look the same to them. */
static void copies_a_whole_low_word_away_are_no_neighbours(void **state)
{
    (void)state;
    dice d = {37};
    const size_t n = 40, copies = 12;
    for (int dimension = 2; dimension <= 3; dimension++)
        for (int axis = 0; axis < dimension; axis++) {
            const size_t axes = (size_t)dimension;
            double *x = calloc(n * copies * axes, sizeof *x);
            for (size_t i = 0; i < n * axes; i++)
                x[i] = dice_uniform(&d, -0.5, 0.5);
            for (size_t k = 1; k < copies; k++) /* a word is 8 m at this radius */
                for (size_t i = 0; i < n * axes; i++)
                    x[k * n * axes + i] =
                        x[i] + (i % axes == (size_t)axis || k % 2 ? ldexp(8.0, (int)k * 5 / 2) : 0);
            check_search(x, n * copies, NULL, 0, dimension, 0.125, 2);
            check_search(x, n, x + n * axes, n * (copies - 1), dimension, 0.125, 1);
            free(x);
        }
}

static void strays_leave_the_order_of_the_others(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 2, 0);
    dice d = {29};
    const size_t n = 500, strays = 6;
    double *x = cloud(&d, n + strays, 3, -1.0, 1.0);
    for (size_t i = 0; i < strays; i++)
        for (size_t c = 0; c < 3; c++)
            x[(n + i) * 3 + c] *= 1e9;
    const ascc_scale scale = ascc_scale_for_radius(0.2);
    const ascc_points p = points_of(&t, &scale, x, n, 3),
                      q = points_of(&t, &scale, x, n + strays, 3);
    ascc_extent near = ascc_extent_of(&p, t.search.workers),
                far = ascc_extent_of(&q, t.search.workers);
    const double cell = ascc_grid_cell(0.2 * scale.inverse);
    uint32_t a[500], b[506];
    assert_int_equal(ascc_points_order(&t.search, &p, &near, cell, a), ASCC_OK);
    assert_int_equal(ascc_points_order(&t.search, &q, &far, cell, b), ASCC_OK);
    size_t kept = 0;
    for (size_t i = 0; i < n + strays; i++)
        if (b[i] < n)
            assert_int_equal(b[i], a[kept++]);
    assert_int_equal(kept, n);
    free(x);
    tools_close(&t);
}

static void a_quarter_million_scattered_points_find_themselves(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 2, 0);
    const size_t n = (size_t)1 << 18;
    double *x = calloc(n * 3, sizeof *x);
    for (size_t i = 0; i < n * 3; i++)
        x[i] = (double)(i / 3) * 100.0;
    search_case s;
    assert_int_equal(build(&s, &t, x, n, NULL, 0, 3, 0.1), ASCC_OK);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    for (size_t i = 0; i < n; i++)
        assert_true(s.rows.count[i] == 1 && s.rows.neighbor[s.rows.start[i]] == i);
    free(x);
    tools_close(&t);
}

/* Two numbers for each of 2^20 points, and 22 bits on each axis: what a key cannot hold. */
static void more_scattered_points_than_keys_can_number_are_an_error(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 2, 0);
    const size_t n = ((size_t)1 << 20) + 8;
    double *x = calloc(n * 3, sizeof *x);
    for (size_t i = 0; i < n * 3; i++)
        x[i] = (double)(i / 3) * 100.0;
    search_case s;
    assert_int_equal(build(&s, &t, x, n, NULL, 0, 3, 0.1), ASCC_ERROR_RANGE);
    assert_non_null(strstr(t.message.text, "scattered over too many cells"));
    free(x);
    tools_close(&t);
}

static void sets_of_2_to_the_32_points_are_an_error(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    double x[3] = {0};
    const ascc_scale scale = ascc_scale_for_radius(0.1);
    ascc_points p = points_of(&t, &scale, x, 1, 3);
    ascc_extent extent = ascc_extent_of(&p, t.search.workers);
    ascc_grid grid;
    p.count = UINT32_MAX;
    assert_int_equal(ascc_grid_build(&grid, &t.search, &p, &extent, 1e6, false), ASCC_ERROR_RANGE);
    assert_non_null(strstr(t.message.text, "4294967295 points"));
    tools_close(&t);
}

static void coincident_points_are_all_neighbours(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 2, 0);
    double x[300];
    for (size_t i = 0; i < 300; i++)
        x[i] = 0.25;
    search_case s;
    assert_int_equal(build(&s, &t, x, 100, NULL, 0, 3, 0.1), ASCC_OK);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    for (size_t i = 0; i < 100; i++)
        assert_int_equal(s.rows.count[i], 100);
    tools_close(&t);
}

static void too_many_neighbours_are_an_error_not_an_overflow(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    double x[300] = {0};
    search_case s;
    assert_int_equal(build(&s, &t, x, 100, NULL, 0, 3, 0.1), ASCC_OK);
    s.rows.max_neighbors = 99;
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_ERROR_LIMIT);
    assert_true(strstr(t.message.text, "99") != NULL);
    tools_close(&t);
}

static void only_wanted_rows_are_made_and_more_can_follow(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 2, 0);
    dice d = {3};
    const size_t n = 500;
    double *x = cloud(&d, n, 3, 0.0, 1.0);
    uint8_t wanted[500];
    for (size_t i = 0; i < n; i++)
        wanted[i] = i % 7 == 0;
    search_case s;
    assert_int_equal(build(&s, &t, x, n, NULL, 0, 3, 0.2), ASCC_OK);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, wanted), ASCC_OK);
    for (size_t i = 0; i < n; i++)
        assert_int_equal(s.rows.count[i] == ASCC_ROW_ABSENT, i % 7 != 0);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    check_rows(&s);
    free(x);
    tools_close(&t);
}

/* ---- The mutual limit ---- */

static bool has(const ascc_rows *rows, size_t i, size_t j)
{
    for (uint32_t k = 0; k < rows->count[i]; k++)
        if (rows->neighbor[rows->start[i] + k] == j)
            return true;
    return false;
}

static void a_limit_keeps_the_nearest_and_only_mutual_neighbours(void **state)
{
    (void)state;
    dice d = {5};
    for (int32_t limit = 1; limit <= 20; limit += 6) {
        test_tools t;
        tools_open(&t, 3, 0);
        const size_t n = 400;
        double *x = cloud(&d, n, 3, 0.0, 1.0);
        search_case s;
        assert_int_equal(build(&s, &t, x, n, NULL, 0, 3, 0.3), ASCC_OK);
        s.rows.limit = limit;
        s.rows.max_neighbors = 30; /* crowds are thinned on the way */
        assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
        const double radius = s.rows.radius * s.rows.radius;
        for (size_t i = 0; i < n; i++) {
            assert_true(has(&s.rows, i, i));
            assert_true(s.rows.count[i] <= (uint32_t)limit + 1);
            for (size_t j = 0; j < n; j++) {
                if (j == i)
                    continue;
                size_t nearer_i = 0, nearer_j = 0;
                const double square = square_of(&s, i, j);
                for (size_t k = 0; k < n; k++) {
                    nearer_i += k != i && square_of(&s, i, k) < square;
                    nearer_j += k != j && square_of(&s, j, k) < square;
                }
                const bool kept =
                    square < radius && nearer_i < (size_t)limit && nearer_j < (size_t)limit;
                assert_int_equal(has(&s.rows, i, j), kept);
            }
        }
        free(x);
        tools_close(&t);
    }
}

/* ---- Order ---- */

static void the_order_of_points_follows_from_positions_alone(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    dice d = {13};
    const size_t n = 700;
    double *x = cloud(&d, n, 3, -1.0, 1.0), *y = calloc(n * 3, sizeof *y);
    uint32_t shuffle[700], a[700], b[700];
    for (size_t i = 0; i < n; i++)
        shuffle[i] = (uint32_t)i;
    for (size_t i = n - 1; i > 0; i--) {
        const size_t j = dice_next(&d) % (i + 1);
        const uint32_t swap = shuffle[i];
        shuffle[i] = shuffle[j];
        shuffle[j] = swap;
    }
    for (size_t i = 0; i < n; i++)
        memcpy(y + i * 3, x + shuffle[i] * 3, 3 * sizeof *y);
    const ascc_scale scale = ascc_scale_for_radius(0.2);
    const ascc_points p = points_of(&t, &scale, x, n, 3), q = points_of(&t, &scale, y, n, 3);
    ascc_extent extent, wide;
    ascc_extent_start(&extent);
    ascc_extent_add(&extent, &p);
    wide = extent; /* one far point changes the box, not the order */
    wide.box[0].high += (int64_t)1 << 40;
    const double cell = ascc_grid_cell(0.2 * scale.inverse);
    assert_int_equal(ascc_points_order(&t.search, &p, &extent, cell, a), ASCC_OK);
    assert_int_equal(ascc_points_order(&t.search, &q, &wide, cell, b), ASCC_OK);
    for (size_t i = 0; i < n; i++)
        assert_int_equal(a[i], shuffle[b[i]]);
    free(x);
    free(y);
    tools_close(&t);
}

static void a_crowded_cell_is_ordered_too(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    dice d = {17};
    const size_t n = 900;
    double *x = cloud(&d, n, 2, 0.0, 0.001);
    x[10] = x[400]; /* a coincident pair: rows decide */
    x[11] = x[401];
    uint32_t order[900];
    const ascc_scale scale = ascc_scale_for_radius(0.2);
    const ascc_points p = points_of(&t, &scale, x, n, 2);
    ascc_extent extent;
    ascc_extent_start(&extent);
    ascc_extent_add(&extent, &p);
    assert_int_equal(ascc_points_order(&t.search, &p, &extent, 1e9, order), ASCC_OK);
    for (size_t i = 1; i < n; i++) {
        const uint32_t a = order[i - 1], b = order[i];
        const int64_t *py = p.position[1], *px = p.position[0];
        assert_true(py[a] < py[b] || (py[a] == py[b] && px[a] < px[b]) ||
                    (py[a] == py[b] && px[a] == px[b] && a < b));
    }
    free(x);
    tools_close(&t);
}

static void no_points_have_no_rows(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    double x[3] = {0};
    search_case s;
    assert_int_equal(build(&s, &t, x, 0, NULL, 0, 3, 0.1), ASCC_OK);
    assert_int_equal(ascc_rows_make(&s.rows, &t.search, NULL), ASCC_OK);
    assert_int_equal(s.rows.used, 0);
    tools_close(&t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_equal_brute_force_in_2d_and_3d),
        cmocka_unit_test(sparse_points_far_apart_find_only_near_ones),
        cmocka_unit_test(strays_on_every_axis_leave_the_neighbours_of_the_others),
        cmocka_unit_test(gaps_of_any_width_keep_neighbours_and_make_none),
        cmocka_unit_test(copies_a_whole_low_word_away_are_no_neighbours),
        cmocka_unit_test(strays_leave_the_order_of_the_others),
        cmocka_unit_test(a_quarter_million_scattered_points_find_themselves),
        cmocka_unit_test(more_scattered_points_than_keys_can_number_are_an_error),
        cmocka_unit_test(sets_of_2_to_the_32_points_are_an_error),
        cmocka_unit_test(coincident_points_are_all_neighbours),
        cmocka_unit_test(too_many_neighbours_are_an_error_not_an_overflow),
        cmocka_unit_test(only_wanted_rows_are_made_and_more_can_follow),
        cmocka_unit_test(a_limit_keeps_the_nearest_and_only_mutual_neighbours),
        cmocka_unit_test(the_order_of_points_follows_from_positions_alone),
        cmocka_unit_test(a_crowded_cell_is_ordered_too),
        cmocka_unit_test(no_points_have_no_rows),
    };
    return cmocka_run_group_tests_name("neighbors", tests, NULL, NULL);
}
