/* Multiply-adds and triads of AVX-512. SPDX-License-Identifier: MIT */
#include <immintrin.h>

#include "peak.h"

#define SUMS 24 /* enough to hide the latency */

double bench_multiply_add_avx512(size_t rounds)
{
    __m512 sum[SUMS];
    for (int i = 0; i < SUMS; i++)
        sum[i] = _mm512_set1_ps((float)i);
    const __m512 m = _mm512_set1_ps(0.5f);
    for (size_t r = 0; r < rounds; r++) /* unrolled, so that sums are registers */
#pragma GCC unroll 24
        for (int i = 0; i < SUMS; i++)
            sum[i] = _mm512_fmadd_ps(sum[i], m, m);
    for (int i = 1; i < SUMS; i++)
        sum[0] = _mm512_add_ps(sum[0], sum[i]);
    bench_sink = _mm512_cvtss_f32(sum[0]);
    return (double)rounds * SUMS * (sizeof sum[0] / sizeof(float)) * 2.0;
}

void bench_triad_avx512(float *restrict a, const float *restrict b, const float *restrict c,
                        size_t n)
{
    const size_t lanes = sizeof(__m512) / sizeof(float);
    const __m512 three = _mm512_set1_ps(3.0f);
    for (size_t i = 0; i + lanes <= n; i += lanes)
        _mm512_storeu_ps(a + i,
                         _mm512_fmadd_ps(_mm512_loadu_ps(c + i), three, _mm512_loadu_ps(b + i)));
}
