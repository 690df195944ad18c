/* Eight floats as one value, for each instruction set: what body.h is written in.
 * SPDX-License-Identifier: MIT
 *
 * Every operation is elementwise and correctly rounded, so the bits are those of eight scalars. The
 * file of a variant picks its branch, whatever the compiler's flags allow, with ASCC_USE_AVX2 (AVX2 and
 * FMA) or ASCC_USE_NEON; without either it is plain C.
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

static inline vector gather_lanes(const float *p, const uint32_t *index)
{
    float lane[LANES];
    for (int i = 0; i < LANES; i++)
        lane[i] = p[index[i]];
    return load(lane);
}

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
