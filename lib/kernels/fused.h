/* fmaf for CPUs without it, in operations that compilers vectorise. SPDX-License-Identifier: MIT */
#ifndef ASCC_FUSED_H
#define ASCC_FUSED_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* a * b + c, rounded once: fmaf(a, b, c) for every input, but for the payload of a NaN.
 *
 *   a * b    exact in double: 24 + 24 bits of 53, exponents far inside double's
 *   s + e    the exact sum: s rounded to nearest, e what that left over (Knuth's TwoSum). Nothing
 *            underflows: all are multiples of 2^-298; nothing overflows: all are below 2^257
 *   odd      where e is not zero, s becomes the neighbour of the exact sum, towards e, whose last bit
 *            is 1: (bits - 1) | 1 where e points to zero, bits | 1 elsewhere; an odd s stays
 *   (float)  then rounds as the exact sum does: 53 bits rounded to odd are at least two more than
 *            any float's, so no sum crosses, reaches or leaves a midpoint of floats. Subnormal results
 *            and the limit of overflow are coarser or equal grids, so they need no case of their own
 *
 * With an infinity or NaN among the inputs e is NaN, s is the result already and is left alone. */
static inline float fused_in_double(float a, float b, float c)
{
    const double product = (double)a * (double)b, addend = (double)c;
    const double sum = product + addend;
    const double from_addend = sum - product;
    const double error = (product - (sum - from_addend)) + (addend - from_addend);
    const double flag = fabs(error) > 0.0 ? 0x1p-1074 : 0.0; /* as bits 1 or 0 */
    uint64_t bits, error_bits, inexact;
    memcpy(&bits, &sum, sizeof bits);
    memcpy(&error_bits, &error, sizeof error_bits);
    memcpy(&inexact, &flag, sizeof inexact);
    const uint64_t inward = (bits ^ error_bits) >> 63 & inexact;
    bits = (bits - inward) | inexact;
    double odd;
    memcpy(&odd, &bits, sizeof odd);
    return (float)odd;
}

/* fmaf itself where it is one instruction; elsewhere the C library may be ten times slower than this. */
static inline float fused_once(float a, float b, float c)
{
#if defined(__FP_FAST_FMAF) || defined(__FMA__) || defined(__aarch64__)
    return fmaf(a, b, c);
#else
    return fused_in_double(a, b, c);
#endif
}

#endif
