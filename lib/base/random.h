/* Streams of random numbers, the same on every machine. SPDX-License-Identifier: MIT */
#ifndef ASCC_RANDOM_H
#define ASCC_RANDOM_H

#include <stdint.h>

/* A stream that depends on the three numbers that it is opened with alone. */
typedef struct ascc_random {
    uint64_t state;
} ascc_random;

ascc_random ascc_random_open(uint64_t seed, uint64_t first, uint64_t second);
double ascc_random_uniform(ascc_random *random); /* [0, 1) */
double ascc_random_normal(ascc_random *random);

#endif
