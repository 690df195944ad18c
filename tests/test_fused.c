/* The emulated fused multiply-add equals fmaf in every bit. SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>

#include <cmocka.h>

#include "kernels/fused.h"

static uint64_t seed = 20261123;

static uint32_t next(void)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(seed >> 32);
}

static float as_float(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static uint32_t as_bits(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

/* Any sign, an exponent among [low, high], and a mantissa that ends in `zeros` zeros. */
static float number(int low, int high, int zeros)
{
    const uint32_t exponent = (uint32_t)low + next() % (uint32_t)(high - low + 1);
    const uint32_t mantissa = next() >> 9 >> zeros << zeros;
    return as_float((next() & 0x80000000u) | exponent << 23 | mantissa);
}

static void check(float a, float b, float c)
{
    const float want = fmaf(a, b, c), got = fused_in_double(a, b, c);
    if (as_bits(want) != as_bits(got) && !(isnan(want) && isnan(got)))
        fail_msg("%a * %a + %a: %a, not %a", (double)a, (double)b, (double)c, (double)got,
                 (double)want);
}

static void any_bits_round_as_fmaf(void **state)
{
    (void)state;
    for (int i = 0; i < 3000000; i++)
        check(as_float(next()), as_float(next()), as_float(next()));
}

/* Addends of the product's size, where all bits of both take part. */
static void sums_of_like_sizes_round_as_fmaf(void **state)
{
    (void)state;
    for (int i = 0; i < 3000000; i++)
        check(number(117, 137, 0), number(117, 137, 0), number(80, 170, 0));
}

/* Products of 25 bits are midpoints of floats, which an addend far below decides. */
static void midpoints_round_as_fmaf(void **state)
{
    (void)state;
    for (int i = 0; i < 2000000; i++)
        check(number(120, 134, 11), number(120, 134, 12), number(0, 160, i % 24));
}

static void subnormal_results_round_as_fmaf(void **state)
{
    (void)state;
    for (int i = 0; i < 2000000; i++)
        check(number(40, 70, i % 24), number(40, 70, i / 24 % 24), number(0, 12, i / 576 % 24));
}

static void results_near_overflow_round_as_fmaf(void **state)
{
    (void)state;
    for (int i = 0; i < 1000000; i++)
        check(number(185, 195, i % 24), number(185, 195, 0), number(225, 254, 0));
}

static void special_values_round_as_fmaf(void **state)
{
    (void)state;
    static const uint32_t magnitudes[] = {
        0x00000000, 0x00000001, 0x00000002, 0x00000003, 0x00400000, 0x007fffff, 0x00800000,
        0x00800001, 0x00ffffff, 0x01000000, 0x0c800000, 0x1f800000, 0x1fffffff, 0x20000000,
        0x33000000, 0x33800000, 0x33800001, 0x34000000, 0x3f000000, 0x3f7fffff, 0x3f800000,
        0x3f800001, 0x3f800003, 0x3fffffff, 0x40000000, 0x4b000001, 0x4b800000, 0x5f000000,
        0x5f7fffff, 0x5f800000, 0x7e800000, 0x7effffff, 0x7f000000, 0x7f7ffffe, 0x7f7fffff,
        0x7f800000, 0x7fc00000, 0x7fffffff};
    const size_t count = 2 * sizeof magnitudes / sizeof *magnitudes;
    for (size_t i = 0; i < count * count * count; i++) {
        const size_t at[3] = {i % count, i / count % count, i / count / count};
        float v[3];
        for (int k = 0; k < 3; k++)
            v[k] = as_float(magnitudes[at[k] / 2] | (at[k] % 2 ? 0x80000000u : 0));
        check(v[0], v[1], v[2]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_bits_round_as_fmaf),
        cmocka_unit_test(sums_of_like_sizes_round_as_fmaf),
        cmocka_unit_test(midpoints_round_as_fmaf),
        cmocka_unit_test(subnormal_results_round_as_fmaf),
        cmocka_unit_test(results_near_overflow_round_as_fmaf),
        cmocka_unit_test(special_values_round_as_fmaf),
    };
    return cmocka_run_group_tests_name("fused", tests, NULL, NULL);
}
