/* Multiply-adds and triads without any special instruction. SPDX-License-Identifier: MIT */
#include "peak.h"

typedef float vector __attribute__((vector_size(16)));

/* Plain x86-64 has no fused multiply-add: two instructions each. */
double bench_multiply_add_portable(size_t rounds)
{
    vector sum[10];
    for (int i = 0; i < 10; i++)
        sum[i] = (vector){1.0f, 2.0f, 3.0f, (float)i};
    const vector m = {0.5f, 0.25f, 0.5f, 0.25f};
    for (size_t r = 0; r < rounds; r++)
        for (int i = 0; i < 10; i++)
            sum[i] = sum[i] * m + m;
    float total = 0.0f;
    for (int i = 0; i < 10; i++)
        total += sum[i][0] + sum[i][3];
    bench_sink = total;
    return (double)rounds * 10.0 * 4.0 * 2.0;
}

volatile float bench_sink;

void bench_triad_portable(float *restrict a, const float *restrict b, const float *restrict c,
                          size_t n)
{
    for (size_t i = 0; i < n; i++)
        a[i] = b[i] + 3.0f * c[i];
}
