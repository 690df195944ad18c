/* A search at once against brute force in double precision. SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/search.h"
#include "support/counting.h"
#include "support/tools.h"

static double square_of(const ascc_search_options *o, size_t i, size_t j)
{
    const double *to = o->source.at ? o->source.at : o->query.at;
    double square = 0.0;
    for (int c = 0; c < o->dimension; c++) {
        const size_t d = (size_t)o->dimension, k = (size_t)c;
        const double e = (to[j * d + k] - o->query.at[i * d + k]) / o->radius;
        square += e * e;
    }
    return square;
}

/* Every pair but those within rounding (2^-26 of the radius) of the sphere is where it belongs. */
static void check_lists(const ascc_search *s, const ascc_search_options *o)
{
    const size_t sources = o->source.at ? o->source.count : o->query.count;
    uint8_t *seen = calloc(sources + 1, 1);
    for (size_t i = 0; i < o->query.count; i++) {
        if (o->wanted && !o->wanted[i]) {
            assert_int_equal(s->rows.count[i], ASCC_ROW_ABSENT);
            continue;
        }
        memset(seen, 0, sources);
        for (uint32_t k = 0; k < s->rows.count[i]; k++) {
            const uint32_t j = s->rows.neighbor[s->rows.start[i] + k];
            double e[3];
            assert_true(j < sources && !seen[j]);
            seen[j] = 1;
            assert_true(fabs(ascc_search_separation(s, i, j, e) - square_of(o, i, j)) < 1e-7);
        }
        for (size_t j = 0; j < sources; j++)
            if (fabs(square_of(o, i, j) - 1.0) > 1e-6)
                assert_int_equal(seen[j], square_of(o, i, j) < 1.0 &&
                                              !(o->skip_self && !o->source.at && i == j));
    }
    free(seen);
}

static void lists_equal_brute_force_in_one_set_and_between_two(void **state)
{
    (void)state;
    dice d = {51};
    for (int round = 0; round < 32; round++) {
        test_tools t;
        tools_open(&t, 1 + round % 3, 0);
        double a[300 * 3], b[200 * 3];
        uint8_t wanted[300];
        for (size_t i = 0; i < 900; i++)
            a[i] = dice_uniform(&d, -1.0, 1.0) * (i % 31 ? 1.0 : 1e6); /* some far away */
        for (size_t i = 0; i < 600; i++) /* some of them where others are, some where none is */
            b[i] = i % 20   ? dice_uniform(&d, -1.0, 1.0)
                   : i % 40 ? dice_uniform(&d, -3e6, 3e6)
                            : a[i];
        for (size_t i = 0; i < 300; i++)
            wanted[i] = dice_next(&d) % 2 != 0;
        ascc_search_options o = {.dimension = 2 + round % 2,
                                 .radius = dice_uniform(&d, 0.05, 0.5),
                                 .query = {a, 300, NULL},
                                 .skip_self = round & 2,
                                 .expected = (size_t)round % 5,
                                 .wanted = round & 4 ? wanted : NULL};
        if (round & 8)
            o.source = (ascc_positions){b, 200, NULL};
        o.skip_self = o.skip_self && !o.source.at;
        ascc_search s;
        assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_OK);
        check_lists(&s, &o);
        tools_close(&t);
    }
}

static void no_points_find_nothing(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    const double x[3] = {0};
    ascc_search s;
    ascc_search_options o = {.dimension = 3, .radius = 1.0, .query = {x, 0, NULL}};
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_OK);
    o.query.count = 1;
    o.source = (ascc_positions){x, 0, NULL};
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_OK);
    assert_int_equal(s.rows.count[0], 0);
    tools_close(&t);
}

static void a_position_that_cannot_be_searched_is_named(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    const double near[4] = {0.0, 1.0, 2.0, 3.0}, far[4] = {0.0, 1.0, 2.0, -1e12},
                 nothing[4] = {0.0, 1.0, (double)NAN, 0.0};
    ascc_search s;
    ascc_search_options o = {.dimension = 2, .radius = 1.0, .query = {far, 2, "fluid row"}};
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_ERROR_RANGE);
    assert_string_equal(t.message.text, "fluid row 1 is too far from the origin");
    o.query.at = near;
    o.source = (ascc_positions){nothing, 2, NULL};
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_ERROR_RANGE);
    assert_string_equal(t.message.text, "point 1 is not finite");
    tools_close(&t);
}

static void a_crowd_is_an_error_only_beyond_the_limit(void **state)
{
    (void)state;
    test_tools t;
    tools_open(&t, 1, 0);
    const double x[60] = {0};
    ascc_search s;
    ascc_search_options o = {
        .dimension = 3, .radius = 1.0, .query = {x, 20, NULL}, .max_neighbors = 19};
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_ERROR_LIMIT);
    o.max_neighbors = 20;
    assert_int_equal(ascc_search_run(&s, &t.search, &o), ASCC_OK);
    tools_close(&t);
}

/* Strays too, so that the stretches of the axes need memory. */
static void every_allocation_that_fails_is_an_error_with_a_message(void **state)
{
    (void)state;
    dice d = {53};
    double x[200 * 3];
    for (size_t i = 0; i < 600; i++)
        x[i] = dice_uniform(&d, 0.0, 1.0) * (i % 31 ? 1.0 : 1e9);
    const ascc_search_options o = {.dimension = 3, .radius = 0.2, .query = {x, 200, NULL}};
    size_t calls = 1;
    for (size_t fail = 0; fail <= calls; fail++) {
        test_memory memory = {0};
        const ascc_allocator allocator = test_memory_allocator(&memory);
        test_tools t;
        tools_open(&t, 1, 0);
        ascc_arena arena;
        ascc_arena_open(&arena, &allocator);
        const ascc_search_tools tools = {&arena, t.search.workers, t.search.kernels, &t.message};
        memory.fail_at = fail;
        ascc_search s;
        const ascc_status status = ascc_search_run(&s, &tools, &o);
        if (fail == 0) {
            assert_int_equal(status, ASCC_OK);
            calls = memory.calls;
            assert_true(calls > 10);
        } else {
            assert_int_equal(status, ASCC_ERROR_MEMORY);
            assert_non_null(strstr(t.message.text, "no memory"));
        }
        ascc_arena_close(&arena);
        assert_true(test_memory_is_clean(&memory));
        tools_close(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lists_equal_brute_force_in_one_set_and_between_two),
        cmocka_unit_test(no_points_find_nothing),
        cmocka_unit_test(a_position_that_cannot_be_searched_is_named),
        cmocka_unit_test(a_crowd_is_an_error_only_beyond_the_limit),
        cmocka_unit_test(every_allocation_that_fails_is_an_error_with_a_message),
    };
    return cmocka_run_group_tests_name("search", tests, NULL, NULL);
}
