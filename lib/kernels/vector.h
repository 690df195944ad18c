/* Eight floats as one value, for each instruction set: what body.h is written in.
 * SPDX-License-Identifier: MIT
 *
 * Every operation is elementwise and correctly rounded, so the bits are those of eight scalars. The
 * file of a variant picks its branch, whatever the compiler's flags allow, with ASCC_USE_AVX2 (AVX2 and
 * FMA), ASCC_USE_NEON or ASCC_USE_SIMD128 (WebAssembly); without any it is plain C.
 */
#ifndef ASCC_VECTOR_H
#define ASCC_VECTOR_H

#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#define LANES 8

#if defined(ASCC_USE_AVX2)
#include <immintrin.h>

typedef __m256 vector;

static inline vector load(const float *p)
{
    return _mm256_loadu_ps(p);
}

static inline void store(float *p, vector a)
{
    _mm256_storeu_ps(p, a);
}

static inline vector fill(float a)
{
    return _mm256_set1_ps(a);
}

static inline vector add(vector a, vector b)
{
    return _mm256_add_ps(a, b);
}

static inline vector times(vector a, vector b)
{
    return _mm256_mul_ps(a, b);
}

/* p[index[lane]], indices below 2^31. */
static inline vector gather_lanes(const float *p, const uint32_t *index)
{
    return _mm256_i32gather_ps(p, _mm256_loadu_si256((const __m256i *)index), 4);
}

/* a * b + c, rounded once. */
static inline vector fused(vector a, vector b, vector c)
{
    return _mm256_fmadd_ps(a, b, c);
}

static inline vector minus(vector a, vector b)
{
    return _mm256_sub_ps(a, b);
}

/* a > b ? a : b, so b where a is no number; and a < b ? a : b. */
static inline vector larger(vector a, vector b)
{
    return _mm256_max_ps(a, b);
}

static inline vector smaller(vector a, vector b)
{
    return _mm256_min_ps(a, b);
}

/* The whole part of 0 <= a < 2^24, and that as integers. */
static inline vector whole(vector a)
{
    return _mm256_round_ps(a, _MM_FROUND_TO_ZERO | _MM_FROUND_NO_EXC);
}

static inline void store_whole(int32_t *p, vector a)
{
    _mm256_storeu_si256((__m256i *)p, _mm256_cvttps_epi32(a));
}

/* first + the numbers of the set bits of a byte, lowest first; returns how many. p has room for 8. */
static inline size_t store_lanes(uint32_t *p, uint32_t first, unsigned mask)
{
    const __m256i nibble = _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28);
    const uint32_t packed = _pext_u32(0x76543210u, _pdep_u32(mask, 0x11111111u) * 0xfu);
    const __m256i lanes = _mm256_and_si256(
        _mm256_srlv_epi32(_mm256_set1_epi32((int)packed), nibble), _mm256_set1_epi32(7));
    _mm256_storeu_si256((__m256i *)p, _mm256_add_epi32(_mm256_set1_epi32((int)first), lanes));
    return (size_t)_mm_popcnt_u32(mask);
}

/* first + the numbers of the lanes above 0, ascending; returns how many. p has room for 8. */
static inline size_t store_positive(uint32_t *p, uint32_t first, vector a)
{
    const __m256 positive = _mm256_cmp_ps(a, _mm256_setzero_ps(), _CMP_GT_OQ);
    return store_lanes(p, first, (unsigned)_mm256_movemask_ps(positive));
}

#elif defined(ASCC_USE_NEON)
#include <arm_neon.h>

typedef struct vector {
    float32x4_t low, high;
} vector;

static inline vector load(const float *p)
{
    return (vector){vld1q_f32(p), vld1q_f32(p + 4)};
}

static inline void store(float *p, vector a)
{
    vst1q_f32(p, a.low);
    vst1q_f32(p + 4, a.high);
}

static inline vector fill(float a)
{
    return (vector){vdupq_n_f32(a), vdupq_n_f32(a)};
}

static inline vector add(vector a, vector b)
{
    return (vector){vaddq_f32(a.low, b.low), vaddq_f32(a.high, b.high)};
}

static inline vector times(vector a, vector b)
{
    return (vector){vmulq_f32(a.low, b.low), vmulq_f32(a.high, b.high)};
}

static inline vector fused(vector a, vector b, vector c)
{
    return (vector){vfmaq_f32(c.low, a.low, b.low), vfmaq_f32(c.high, a.high, b.high)};
}

static inline vector minus(vector a, vector b)
{
    return (vector){vsubq_f32(a.low, b.low), vsubq_f32(a.high, b.high)};
}

static inline vector larger(vector a, vector b)
{
    return (vector){vbslq_f32(vcgtq_f32(a.low, b.low), a.low, b.low),
                    vbslq_f32(vcgtq_f32(a.high, b.high), a.high, b.high)};
}

static inline vector smaller(vector a, vector b)
{
    return (vector){vbslq_f32(vcltq_f32(a.low, b.low), a.low, b.low),
                    vbslq_f32(vcltq_f32(a.high, b.high), a.high, b.high)};
}

static inline vector whole(vector a)
{
    return (vector){vrndq_f32(a.low), vrndq_f32(a.high)};
}

static inline void store_whole(int32_t *p, vector a)
{
    vst1q_s32(p, vcvtq_s32_f32(a.low));
    vst1q_s32(p + 4, vcvtq_s32_f32(a.high));
}

#elif defined(ASCC_USE_SIMD128)
#include <wasm_simd128.h>

#include "fused.h"

typedef struct vector {
    v128_t low, high;
} vector;

static inline vector load(const float *p)
{
    return (vector){wasm_v128_load(p), wasm_v128_load(p + 4)};
}

static inline void store(float *p, vector a)
{
    wasm_v128_store(p, a.low);
    wasm_v128_store(p + 4, a.high);
}

static inline vector fill(float a)
{
    return (vector){wasm_f32x4_splat(a), wasm_f32x4_splat(a)};
}

static inline vector add(vector a, vector b)
{
    return (vector){wasm_f32x4_add(a.low, b.low), wasm_f32x4_add(a.high, b.high)};
}

static inline vector times(vector a, vector b)
{
    return (vector){wasm_f32x4_mul(a.low, b.low), wasm_f32x4_mul(a.high, b.high)};
}

static inline vector minus(vector a, vector b)
{
    return (vector){wasm_f32x4_sub(a.low, b.low), wasm_f32x4_sub(a.high, b.high)};
}

static inline vector larger(vector a, vector b)
{
    return (vector){wasm_f32x4_pmax(b.low, a.low), wasm_f32x4_pmax(b.high, a.high)};
}

static inline vector smaller(vector a, vector b)
{
    return (vector){wasm_f32x4_pmin(b.low, a.low), wasm_f32x4_pmin(b.high, a.high)};
}

static inline vector whole(vector a)
{
    return (vector){wasm_f32x4_trunc(a.low), wasm_f32x4_trunc(a.high)};
}

static inline void store_whole(int32_t *p, vector a)
{
    wasm_v128_store(p, wasm_i32x4_trunc_sat_f32x4(a.low));
    wasm_v128_store(p + 4, wasm_i32x4_trunc_sat_f32x4(a.high));
}

/* a * b + c of two lanes, rounded to double: the product is exact there. */
static inline v128_t sum_in_double(v128_t a, v128_t b, v128_t c)
{
    return wasm_f64x2_add(
        wasm_f64x2_mul(wasm_f64x2_promote_low_f32x4(a), wasm_f64x2_promote_low_f32x4(b)),
        wasm_f64x2_promote_low_f32x4(c));
}

static inline v128_t upper_lanes(v128_t a)
{
    return wasm_i32x4_shuffle(a, a, 2, 3, 2, 3);
}

/* Four lanes of fused, from sums in double. Rounding twice is rounding once unless the double lies on a midpoint
 * of floats: the exact sum, off it by less than the double's last digit, may belong to the other side. A midpoint
 * ends in 1 and 28 zeros, which sets lanes of *middle, or the result is subnormal: then lanes of *size, twice its
 * bits less 1, are small. Zeros, the largest there, are right: what rounds to zero is exact as a double. */
static inline v128_t round_sums(v128_t low, v128_t high, v128_t *middle, v128_t *size)
{
    const v128_t result = wasm_i32x4_shuffle(wasm_f32x4_demote_f64x2_zero(low),
                                             wasm_f32x4_demote_f64x2_zero(high), 0, 1, 4, 5);
    const v128_t digits = wasm_i32x4_shl(wasm_i32x4_shuffle(low, high, 0, 2, 4, 6), 3);
    *middle = wasm_i32x4_eq(digits, wasm_i32x4_splat(INT32_MIN));
    *size = wasm_i32x4_sub(wasm_i32x4_shl(result, 1), wasm_i32x4_splat(1));
    return result;
}

/* The long way, which is always right. */
static __attribute__((noinline)) vector fused_again(vector a, vector b, vector c)
{
    float x[LANES], y[LANES], z[LANES];
    store(x, a);
    store(y, b);
    store(z, c);
    for (int i = 0; i < LANES; i++)
        z[i] = fused_in_double(x[i], y[i], z[i]);
    return load(z);
}

static inline vector fused(vector a, vector b, vector c)
{
    const v128_t s0 = sum_in_double(a.low, b.low, c.low);
    const v128_t s1 = sum_in_double(upper_lanes(a.low), upper_lanes(b.low), upper_lanes(c.low));
    const v128_t s2 = sum_in_double(a.high, b.high, c.high);
    const v128_t s3 = sum_in_double(upper_lanes(a.high), upper_lanes(b.high), upper_lanes(c.high));
    vector middle, size, result;
    result.low = round_sums(s0, s1, &middle.low, &size.low);
    result.high = round_sums(s2, s3, &middle.high, &size.high);
    const v128_t subnormal = wasm_u32x4_le(wasm_u32x4_min(size.low, size.high),
                                           wasm_i32x4_splat(0x00ffffff)); /* 2^-126, too */
    if (__builtin_expect(
            wasm_v128_any_true(wasm_v128_or(wasm_v128_or(middle.low, middle.high), subnormal)), 0))
        return fused_again(a, b, c);
    return result;
}

#else
#include "fused.h"

typedef struct vector {
    float lane[LANES];
} vector;

static inline vector load(const float *p)
{
    vector a;
    memcpy(a.lane, p, sizeof a.lane);
    return a;
}

static inline void store(float *p, vector a)
{
    memcpy(p, a.lane, sizeof a.lane);
}

static inline vector fill(float a)
{
    vector r;
    for (int i = 0; i < LANES; i++)
        r.lane[i] = a;
    return r;
}

static inline vector add(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] += b.lane[i];
    return a;
}

static inline vector times(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] *= b.lane[i];
    return a;
}

static inline vector fused(vector a, vector b, vector c)
{
#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC unroll 1
#endif
    for (int i = 0; i < LANES; i++)
        c.lane[i] = fused_once(a.lane[i], b.lane[i], c.lane[i]);
    return c;
}

static inline vector minus(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] -= b.lane[i];
    return a;
}

static inline vector larger(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] = a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i];
    return a;
}

static inline vector smaller(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] = a.lane[i] < b.lane[i] ? a.lane[i] : b.lane[i];
    return a;
}

static inline vector whole(vector a)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] = (float)(int32_t)a.lane[i];
    return a;
}

static inline void store_whole(int32_t *p, vector a)
{
    for (int i = 0; i < LANES; i++)
        p[i] = (int32_t)a.lane[i];
}

#endif

#if defined(ASCC_USE_SIMD128)
static inline vector gather_lanes(const float *p, const uint32_t *i)
{
    return (vector){wasm_f32x4_make(p[i[0]], p[i[1]], p[i[2]], p[i[3]]),
                    wasm_f32x4_make(p[i[4]], p[i[5]], p[i[6]], p[i[7]])};
}
#elif !defined(ASCC_USE_AVX2)
static inline vector gather_lanes(const float *p, const uint32_t *index)
{
    float lane[LANES];
    for (int i = 0; i < LANES; i++)
        lane[i] = p[index[i]];
    return load(lane);
}
#endif

#if !defined(ASCC_USE_AVX2)
static inline size_t store_positive(uint32_t *p, uint32_t first, vector a)
{
    float lane[LANES];
    size_t count = 0;
    store(lane, a);
    for (uint32_t i = 0; i < LANES; i++) {
        p[count] = first + i;
        count += lane[i] > 0.0f;
    }
    return count;
}
#endif

/* Eight rows of eight become eight columns, in place. */
static inline void transpose_lanes(vector a[LANES])
{
#if defined(ASCC_USE_AVX2)
    vector b[LANES], c[LANES];
    for (int i = 0; i < 4; i++) {
        b[2 * i] = _mm256_unpacklo_ps(a[2 * i], a[2 * i + 1]);
        b[2 * i + 1] = _mm256_unpackhi_ps(a[2 * i], a[2 * i + 1]);
    }
    for (int i = 0; i < 2; i++) {
        c[4 * i] = _mm256_shuffle_ps(b[4 * i], b[4 * i + 2], _MM_SHUFFLE(1, 0, 1, 0));
        c[4 * i + 1] = _mm256_shuffle_ps(b[4 * i], b[4 * i + 2], _MM_SHUFFLE(3, 2, 3, 2));
        c[4 * i + 2] = _mm256_shuffle_ps(b[4 * i + 1], b[4 * i + 3], _MM_SHUFFLE(1, 0, 1, 0));
        c[4 * i + 3] = _mm256_shuffle_ps(b[4 * i + 1], b[4 * i + 3], _MM_SHUFFLE(3, 2, 3, 2));
    }
    for (int i = 0; i < 4; i++) {
        a[i] = _mm256_permute2f128_ps(c[i], c[4 + i], 0x20);
        a[4 + i] = _mm256_permute2f128_ps(c[i], c[4 + i], 0x31);
    }
#elif defined(ASCC_USE_SIMD128)
    for (int i = 0; i < LANES; i += 4)
        for (int half = 0; half < 2; half++) {
            v128_t row[4], pair[4];
            for (int j = 0; j < 4; j++)
                row[j] = half ? a[i + j].high : a[i + j].low;
            pair[0] = wasm_i32x4_shuffle(row[0], row[1], 0, 4, 1, 5);
            pair[1] = wasm_i32x4_shuffle(row[0], row[1], 2, 6, 3, 7);
            pair[2] = wasm_i32x4_shuffle(row[2], row[3], 0, 4, 1, 5);
            pair[3] = wasm_i32x4_shuffle(row[2], row[3], 2, 6, 3, 7);
            for (int j = 0; j < 4; j++) {
                const v128_t x = pair[j / 2], y = pair[2 + j / 2];
                const v128_t column =
                    j % 2 ? wasm_i64x2_shuffle(x, y, 1, 3) : wasm_i64x2_shuffle(x, y, 0, 2);
                if (half)
                    a[i + j].high = column;
                else
                    a[i + j].low = column;
            }
        }
    for (int j = 0; j < 4; j++) { /* the two squares off the diagonal change places */
        const v128_t square = a[j].high;
        a[j].high = a[4 + j].low;
        a[4 + j].low = square;
    }
#else
    float from[LANES][LANES], to[LANES][LANES];
    for (int i = 0; i < LANES; i++)
        store(from[i], a[i]);
    for (int i = 0; i < LANES; i++)
        for (int j = 0; j < LANES; j++)
            to[j][i] = from[i][j];
    for (int i = 0; i < LANES; i++)
        a[i] = load(to[i]);
#endif
}

/* The sum of the lanes, always in this order: ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)). */
static inline float total(vector a)
{
#if defined(ASCC_USE_AVX2)
    const __m128 four = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    const __m128 two = _mm_add_ps(four, _mm_movehl_ps(four, four));
    return _mm_cvtss_f32(_mm_add_ss(two, _mm_shuffle_ps(two, two, 1)));
#elif defined(ASCC_USE_SIMD128)
    const v128_t four = wasm_f32x4_add(a.low, a.high);
    const v128_t two = wasm_f32x4_add(four, upper_lanes(four));
    return wasm_f32x4_extract_lane(two, 0) + wasm_f32x4_extract_lane(two, 1);
#else
    float l[LANES];
    store(l, a);
    return ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]));
#endif
}

/* p[4] = the sums of the lanes of three, and 0. */
static inline void store_totals(float *p, vector a, vector b, vector c)
{
#if defined(ASCC_USE_AVX2)
    const __m128 x = _mm_add_ps(_mm256_castps256_ps128(a), _mm256_extractf128_ps(a, 1));
    const __m128 y = _mm_add_ps(_mm256_castps256_ps128(b), _mm256_extractf128_ps(b, 1));
    const __m128 z = _mm_add_ps(_mm256_castps256_ps128(c), _mm256_extractf128_ps(c, 1));
    const __m128 zero = _mm_setzero_ps();
    const __m128 xy = _mm_add_ps(_mm_movelh_ps(x, y), _mm_movehl_ps(y, x));
    const __m128 z0 = _mm_add_ps(_mm_movelh_ps(z, zero), _mm_movehl_ps(zero, z));
    _mm_storeu_ps(p, _mm_add_ps(_mm_shuffle_ps(xy, z0, _MM_SHUFFLE(2, 0, 2, 0)),
                                _mm_shuffle_ps(xy, z0, _MM_SHUFFLE(3, 1, 3, 1))));
#else
    p[0] = total(a);
    p[1] = total(b);
    p[2] = total(c);
    p[3] = 0.0f;
#endif
}

#endif
