/* Multiply-adds and triads of NEON. SPDX-License-Identifier: MIT */
#include <arm_neon.h>

#include "peak.h"

#define SUMS 16 /* enough to hide the latency */

double bench_multiply_add_neon(size_t rounds)
{
    float32x4_t sum[SUMS];
    for (int i = 0; i < SUMS; i++)
        sum[i] = vdupq_n_f32((float)i);
    const float32x4_t m = vdupq_n_f32(0.5f);
    for (size_t r = 0; r < rounds; r++)
        for (int i = 0; i < SUMS; i++)
            sum[i] = vfmaq_f32(m, sum[i], m);
    for (int i = 1; i < SUMS; i++)
        sum[0] = vaddq_f32(sum[0], sum[i]);
    bench_sink = vgetq_lane_f32(sum[0], 0);
    return (double)rounds * SUMS * (sizeof sum[0] / sizeof(float)) * 2.0;
}

void bench_triad_neon(float *restrict a, const float *restrict b, const float *restrict c, size_t n)
{
    const float32x4_t three = vdupq_n_f32(3.0f);
    for (size_t i = 0; i + 4 <= n; i += 4)
        vst1q_f32(a + i, vfmaq_f32(vld1q_f32(b + i), vld1q_f32(c + i), three));
}
