/* As much of cmocka as the tests of tests/cross_test.sh need, for machines without it: the first failure
 * of a test ends the program. Prints TAP. SPDX-License-Identifier: MIT */
#ifndef BARE_CMOCKA_H
#define BARE_CMOCKA_H

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

struct CMUnitTest {
    const char *name;
    void (*run)(void **state);
    int (*setup)(void **state), (*teardown)(void **state);
};

#define cmocka_unit_test_setup_teardown(f, setup, teardown)                                        \
    {                                                                                              \
#f, f, setup, teardown                                                                     \
    }
#define cmocka_unit_test(f) cmocka_unit_test_setup_teardown(f, NULL, NULL)
#define fail_msg(...)                                                                              \
    do {                                                                                           \
        printf("# %s:%d: ", __FILE__, __LINE__);                                                   \
        printf(__VA_ARGS__);                                                                       \
        printf("\nnot ok - %s\n", __func__);                                                       \
        exit(1);                                                                                   \
    } while (0)
#define assert_true(condition)                                                                     \
    do {                                                                                           \
        if (!(condition))                                                                          \
            fail_msg("%s", #condition);                                                            \
    } while (0)
#define assert_non_null(pointer) assert_true((pointer) != NULL)
#define assert_null(pointer) assert_true((pointer) == NULL)
#define assert_false(condition) assert_true(!(condition))
#define assert_string_equal(a, b) assert_true(strcmp(a, b) == 0)
#define assert_in_range(value, low, high) assert_true((value) >= (low) && (value) <= (high))
#define assert_int_equal(a, b) assert_true((a) == (b))
#define assert_ptr_equal(a, b) assert_true((const void *)(a) == (const void *)(b))
#define assert_int_not_equal(a, b) assert_true((a) != (b))
#define assert_memory_equal(a, b, size) assert_true(memcmp(a, b, size) == 0)
#define print_message(...) printf(__VA_ARGS__)

#define cmocka_run_group_tests_name(group, tests, setup, teardown)                                 \
    bare_run(group, tests, sizeof(tests) / sizeof *(tests), setup, teardown)
#define cmocka_run_group_tests(tests, setup, teardown)                                             \
    cmocka_run_group_tests_name(#tests, tests, setup, teardown)

static inline int bare_run(const char *group, const struct CMUnitTest *tests, size_t count,
                           int (*setup)(void **), int (*teardown)(void **))
{
    void *state = NULL;
    if (setup != NULL && setup(&state) != 0)
        return 1;
    for (size_t i = 0; i < count; i++) {
        if (tests[i].setup != NULL && tests[i].setup(&state) != 0)
            return 1;
        tests[i].run(&state);
        if (tests[i].teardown != NULL && tests[i].teardown(&state) != 0)
            return 1;
        printf("ok %zu - %s: %s\n", i + 1, group, tests[i].name);
    }
    return teardown != NULL ? teardown(&state) : 0;
}

#endif
