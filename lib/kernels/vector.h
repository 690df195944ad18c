/* Eight floats as one value, for each instruction set: what body.h is written in.
 * SPDX-License-Identifier: MIT
 *
 * Every operation is elementwise and correctly rounded, so the bits are those of eight scalars.
 */
#ifndef ASCC_VECTOR_H
#define ASCC_VECTOR_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#define LANES 8

#if defined(__AVX2__) && defined(__FMA__)
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

/* a * b + c, rounded once. */
static inline vector fused(vector a, vector b, vector c)
{
    return _mm256_fmadd_ps(a, b, c);
}

#elif defined(__aarch64__)
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

#else

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
    for (int i = 0; i < LANES; i++)
        c.lane[i] = fmaf(a.lane[i], b.lane[i], c.lane[i]);
    return c;
}

#endif

/* The sum of the lanes, always in this order. */
static inline float total(vector a)
{
    float l[LANES];
    store(l, a);
    return ((l[0] + l[4]) + (l[2] + l[6])) + ((l[1] + l[5]) + (l[3] + l[7]));
}

#endif
