/* The antisymmetric output on a block, with integer sums and with floats. SPDX-License-Identifier: MIT */
#ifndef BENCH_PAIRS_H
#define BENCH_PAIRS_H

#include <stddef.h>
#include <stdint.h>

/* The antisymmetric layer 32 -> 3, kernel 6x6x6, on a block: the library's with integer sums, and a
 * twin that sums floats. */
typedef struct bench_pairs bench_pairs;
bench_pairs *bench_pairs_open(size_t count, uint32_t cpu);
void bench_pairs_exact(void *pairs);
void bench_pairs_float(void *pairs);
size_t bench_pairs_count(const bench_pairs *pairs);
/* What the momenta of the twin's floats add up to, over the sum of their magnitudes. */
double bench_pairs_drift(const bench_pairs *pairs);
void bench_pairs_close(bench_pairs *pairs);

#endif
