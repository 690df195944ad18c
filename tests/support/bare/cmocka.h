/* As much of cmocka as test_kernels.c and test_fused.c need, for machines without it: the first failure
 * of a test ends the program. Prints TAP. SPDX-License-Identifier: MIT */
#ifndef BARE_CMOCKA_H
#define BARE_CMOCKA_H

#include <stdio.h>
#include <stdlib.h>

struct CMUnitTest {
    const char *name;
    void (*run)(void **state);
};

#define cmocka_unit_test(f)                                                                        \
    {                                                                                              \
#f, f                                                                                      \
    }
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
#define assert_int_equal(a, b) assert_true((a) == (b))

#define cmocka_run_group_tests_name(group, tests, setup, teardown)                                 \
    bare_run(group, tests, sizeof(tests) / sizeof *(tests))

static inline int bare_run(const char *group, const struct CMUnitTest *tests, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        tests[i].run(NULL);
        printf("ok %zu - %s: %s\n", i + 1, group, tests[i].name);
    }
    return 0;
}

#endif
