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

/* p[index[lane]] of eight floats, indices below 8. */
static inline vector pick_lanes(const float p[LANES], const int32_t index[LANES])
{
    return _mm256_permutevar8x32_ps(_mm256_loadu_ps(p), _mm256_loadu_si256((const __m256i *)index));
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

static inline vector over(vector a, vector b)
{
    return _mm256_div_ps(a, b);
}

static inline vector root(vector a)
{
    return _mm256_sqrt_ps(a);
}

/* Of lanes that hold integers: how much they are more than one, modulo 2^32, as integers, as floats. */
static inline void store_more(int32_t *p, vector a, int32_t b)
{
    _mm256_storeu_si256((__m256i *)p,
                        _mm256_sub_epi32(_mm256_castps_si256(a), _mm256_set1_epi32(b)));
}

static inline vector more_than(vector a, int32_t b)
{
    return _mm256_cvtepi32_ps(_mm256_sub_epi32(_mm256_castps_si256(a), _mm256_set1_epi32(b)));
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

/* Which lanes are not 0 in any of three, and which integers are above another, all below 2^31: a bit each. */
static inline unsigned not_zero(vector a, vector b, vector c)
{
    const __m256 zero = _mm256_setzero_ps();
    const __m256 ab =
        _mm256_or_ps(_mm256_cmp_ps(a, zero, _CMP_NEQ_UQ), _mm256_cmp_ps(b, zero, _CMP_NEQ_UQ));
    return (unsigned)_mm256_movemask_ps(_mm256_or_ps(ab, _mm256_cmp_ps(c, zero, _CMP_NEQ_UQ)));
}

static inline unsigned above(const uint32_t *p, uint32_t least)
{
    const __m256i more =
        _mm256_cmpgt_epi32(_mm256_loadu_si256((const __m256i *)p), _mm256_set1_epi32((int)least));
    return (unsigned)_mm256_movemask_ps(_mm256_castsi256_ps(more));
}

/* The set bits of such a byte: their numbers, lowest first, and how many. */
typedef struct kept {
    __m256i lane;
    size_t count;
} kept;

static inline kept kept_lanes(unsigned mask)
{
    const __m256i nibble = _mm256_setr_epi32(0, 4, 8, 12, 16, 20, 24, 28);
    const uint32_t packed = _pext_u32(0x76543210u, _pdep_u32(mask, 0x11111111u) * 0xfu);
    const __m256i lane = _mm256_and_si256(_mm256_srlv_epi32(_mm256_set1_epi32((int)packed), nibble),
                                          _mm256_set1_epi32(7));
    return (kept){lane, (size_t)_mm_popcnt_u32(mask)};
}

/* Those lanes first; what comes after them does not matter. */
static inline void store_kept(float *p, vector a, kept k)
{
    _mm256_storeu_ps(p, _mm256_permutevar8x32_ps(a, k.lane));
}

static inline void store_kept_integers(uint32_t *p, const uint32_t *from, kept k)
{
    _mm256_storeu_si256((__m256i *)p, _mm256_permutevar8x32_epi32(
                                          _mm256_loadu_si256((const __m256i *)from), k.lane));
}

/* first + the numbers of the set bits of a byte, lowest first; returns how many. p has room for 8. */
static inline size_t store_lanes(uint32_t *p, uint32_t first, unsigned mask)
{
    const kept k = kept_lanes(mask);
    _mm256_storeu_si256((__m256i *)p, _mm256_add_epi32(_mm256_set1_epi32((int)first), k.lane));
    return k.count;
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

static inline vector over(vector a, vector b)
{
    return (vector){vdivq_f32(a.low, b.low), vdivq_f32(a.high, b.high)};
}

static inline vector root(vector a)
{
    return (vector){vsqrtq_f32(a.low), vsqrtq_f32(a.high)};
}

static inline vector more_than(vector a, int32_t b)
{
    const int32x4_t from = vdupq_n_s32(b);
    return (vector){vcvtq_f32_s32(vsubq_s32(vreinterpretq_s32_f32(a.low), from)),
                    vcvtq_f32_s32(vsubq_s32(vreinterpretq_s32_f32(a.high), from))};
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

static inline vector over(vector a, vector b)
{
    return (vector){wasm_f32x4_div(a.low, b.low), wasm_f32x4_div(a.high, b.high)};
}

static inline vector root(vector a)
{
    return (vector){wasm_f32x4_sqrt(a.low), wasm_f32x4_sqrt(a.high)};
}

static inline vector more_than(vector a, int32_t b)
{
    const v128_t from = wasm_i32x4_splat(b);
    return (vector){wasm_f32x4_convert_i32x4(wasm_i32x4_sub(a.low, from)),
                    wasm_f32x4_convert_i32x4(wasm_i32x4_sub(a.high, from))};
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

static inline vector over(vector a, vector b)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] /= b.lane[i];
    return a;
}

static inline vector root(vector a)
{
    for (int i = 0; i < LANES; i++)
        a.lane[i] = sqrtf(a.lane[i]);
    return a;
}

static inline vector more_than(vector a, int32_t b)
{
    uint32_t bits[LANES];
    memcpy(bits, a.lane, sizeof bits);
    for (int i = 0; i < LANES; i++)
        a.lane[i] = (float)(int32_t)(bits[i] - (uint32_t)b);
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

#if !defined(ASCC_USE_AVX2)
static inline void store_more(int32_t *p, vector a, int32_t b)
{
    float lane[LANES];
    uint32_t bits[LANES];
    store(lane, a);
    memcpy(bits, lane, sizeof bits);
    for (int i = 0; i < LANES; i++)
        p[i] = (int32_t)(bits[i] - (uint32_t)b);
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
static inline unsigned not_zero(vector a, vector b, vector c)
{
    float lane[3][LANES];
    unsigned mask = 0;
    store(lane[0], a);
    store(lane[1], b);
    store(lane[2], c);
    for (int i = 0; i < LANES; i++)
        mask |= (unsigned)(lane[0][i] != 0.0f || lane[1][i] != 0.0f || lane[2][i] != 0.0f) << i;
    return mask;
}

static inline unsigned above(const uint32_t *p, uint32_t least)
{
    unsigned mask = 0;
    for (int i = 0; i < LANES; i++)
        mask |= (unsigned)(p[i] > least) << i;
    return mask;
}

typedef struct kept {
    int lane[LANES];
    size_t count;
} kept;

static inline kept kept_lanes(unsigned mask)
{
    kept k = {{0}, 0};
    for (int i = 0; i < LANES; i++)
        if (mask >> i & 1)
            k.lane[k.count++] = i;
    return k;
}

static inline void store_kept(float *p, vector a, kept k)
{
    float lane[LANES];
    store(lane, a);
    for (int i = 0; i < LANES; i++)
        p[i] = lane[k.lane[i]];
}

static inline void store_kept_integers(uint32_t *p, const uint32_t *from, kept k)
{
    uint32_t lane[LANES];
    memcpy(lane, from, sizeof lane);
    for (int i = 0; i < LANES; i++)
        p[i] = lane[k.lane[i]];
}

static inline vector pick_lanes(const float p[LANES], const int32_t index[LANES])
{
    float lane[LANES];
    for (int i = 0; i < LANES; i++)
        lane[i] = p[index[i]];
    return load(lane);
}

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

/* Four floats, or integers, from each of eight places become four vectors of eight. */
static inline void load_quads(const float *const from[LANES], vector to[4])
{
#if defined(ASCC_USE_AVX2)
    vector a[4];
    for (int i = 0; i < 4; i++)
        a[i] = _mm256_insertf128_ps(_mm256_castps128_ps256(_mm_loadu_ps(from[i])),
                                    _mm_loadu_ps(from[i + 4]), 1);
    const vector low = _mm256_unpacklo_ps(a[0], a[1]), high = _mm256_unpackhi_ps(a[0], a[1]);
    const vector low2 = _mm256_unpacklo_ps(a[2], a[3]), high2 = _mm256_unpackhi_ps(a[2], a[3]);
    to[0] = _mm256_shuffle_ps(low, low2, _MM_SHUFFLE(1, 0, 1, 0));
    to[1] = _mm256_shuffle_ps(low, low2, _MM_SHUFFLE(3, 2, 3, 2));
    to[2] = _mm256_shuffle_ps(high, high2, _MM_SHUFFLE(1, 0, 1, 0));
    to[3] = _mm256_shuffle_ps(high, high2, _MM_SHUFFLE(3, 2, 3, 2));
#else
    for (int c = 0; c < 4; c++) {
        float lane[LANES];
        for (int i = 0; i < LANES; i++)
            memcpy(&lane[i], from[i] + c, sizeof lane[i]);
        to[c] = load(lane);
    }
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
