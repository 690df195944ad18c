/* A small generator of random numbers, the same on every machine: splitmix64.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_RANDOM_H
#define ASCC_TEST_RANDOM_H

#include <stdint.h>

typedef struct test_random {
    uint64_t state; /* the seed; any number will do */
} test_random;

static inline uint64_t test_random_bits(test_random *random)
{
    uint64_t bits = random->state += UINT64_C(0x9e3779b97f4a7c15);
    bits = (bits ^ bits >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    bits = (bits ^ bits >> 27) * UINT64_C(0x94d049bb133111eb);
    return bits ^ bits >> 31;
}

/* In [0, limit); the bias is below 2^-32 for limits of tests. */
static inline uint64_t test_random_below(test_random *random, uint64_t limit)
{
    return test_random_bits(random) % limit;
}

/* In [low, high). */
static inline double test_random_between(test_random *random, double low, double high)
{
    return low + (high - low) * ((double)(test_random_bits(random) >> 11) * 0x1p-53);
}

#endif
