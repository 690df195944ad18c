/* One file for each instruction set. SPDX-License-Identifier: MIT */
#ifndef BENCH_PEAK_H
#define BENCH_PEAK_H

#include <stddef.h>

/* Each does rounds of independent multiply-adds and returns how many flops that were. */
double bench_multiply_add_portable(size_t rounds);
double bench_multiply_add_avx2(size_t rounds);
double bench_multiply_add_avx512(size_t rounds);
double bench_multiply_add_neon(size_t rounds);

void bench_triad_portable(float *a, const float *b, const float *c, size_t n);
void bench_triad_avx2(float *a, const float *b, const float *c, size_t n);
void bench_triad_avx512(float *a, const float *b, const float *c, size_t n);
void bench_triad_neon(float *a, const float *b, const float *c, size_t n);

extern volatile float bench_sink; /* keeps results alive */

#endif
