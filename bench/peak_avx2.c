/* Multiply-adds and triads of AVX2 with FMA. SPDX-License-Identifier: MIT */
#include <immintrin.h>

#include "peak.h"

#define SUMS 12 /* enough to hide the latency */

double bench_multiply_add_avx2(size_t rounds)
{
    __m256 sum[SUMS];
    for (int i = 0; i < SUMS; i++)
        sum[i] = _mm256_set1_ps((float)i);
    const __m256 m = _mm256_set1_ps(0.5f);
    for (size_t r = 0; r < rounds; r++)
        for (int i = 0; i < SUMS; i++)
            sum[i] = _mm256_fmadd_ps(sum[i], m, m);
    for (int i = 1; i < SUMS; i++)
        sum[0] = _mm256_add_ps(sum[0], sum[i]);
    bench_sink = _mm256_cvtss_f32(sum[0]);
    return (double)rounds * SUMS * (sizeof sum[0] / sizeof(float)) * 2.0;
}

void bench_triad_avx2(float *restrict a, const float *restrict b, const float *restrict c, size_t n)
{
    const size_t lanes = sizeof(__m256) / sizeof(float);
    const __m256 three = _mm256_set1_ps(3.0f);
    for (size_t i = 0; i + lanes <= n; i += lanes)
        _mm256_storeu_ps(a + i,
                         _mm256_fmadd_ps(_mm256_loadu_ps(c + i), three, _mm256_loadu_ps(b + i)));
}
