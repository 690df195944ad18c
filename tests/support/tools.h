/* What tests of internal units need: a context's tools with an arena, and repeatable random numbers.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_TOOLS_H
#define ASCC_TEST_TOOLS_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "points/neighbors.h"

typedef struct test_tools {
    ascc_context *context;
    ascc_arena arena;
    ascc_message message;
    ascc_search_tools search;
} test_tools;

static inline void tools_open(test_tools *t, int32_t threads, uint32_t cpu_disable)
{
    memset(t, 0, sizeof *t);
    const ascc_context_options options = {
        .size = sizeof options, .thread_count = threads, .cpu_disable = cpu_disable};
    assert_int_equal(ascc_context_create(&options, &t->context), ASCC_OK);
    ascc_arena_open(&t->arena, &t->context->allocator);
    const ascc_search_tools search = {&t->arena, t->context->workers, &t->context->kernels,
                                      &t->message};
    t->search = search;
}

static inline void tools_close(test_tools *t)
{
    ascc_arena_close(&t->arena);
    ascc_context_destroy(&t->context);
}

/* Equal numbers on every machine. */
typedef struct dice {
    uint64_t state;
} dice;

static inline uint32_t dice_next(dice *d)
{
    d->state = d->state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(d->state >> 33);
}

/* In [low, high). */
static inline double dice_uniform(dice *d, double low, double high)
{
    return low + (high - low) * ((double)dice_next(d) / 2147483648.0);
}

/* Points of these coordinates [count][dimension] on a scale. */
static inline ascc_points points_of(test_tools *t, const ascc_scale *scale, const double *x,
                                    size_t count, int dimension)
{
    ascc_points points;
    assert_true(ascc_points_take(&points, &t->arena, count));
    for (size_t i = 0; i < count; i++) {
        int64_t at[3] = {0};
        for (int c = 0; c < dimension; c++)
            assert_true(ascc_scale_apply(scale, x[i * (size_t)dimension + (size_t)c], &at[c]));
        ascc_points_set(&points, i, at);
    }
    return points;
}

#endif
