/* The AVX-512 intrinsics that avx512.c uses, lane by lane, for x86-64 machines without them. It shows
 * that the code is right if the instructions are what Intel's manual says; it cannot show that they are.
 *   cc -include avx512_emulated.h -mavx2 -mfma -mpopcnt avx512.c
 * SPDX-License-Identifier: MIT */
#include <immintrin.h>
#include <math.h>
#include <stdint.h>
#include <string.h>

typedef struct wide_floats {
    float lane[16];
} wide_floats;

typedef struct wide_integers {
    int32_t lane[16];
} wide_integers;

#define __m512 wide_floats
#define __m512i wide_integers
#define __mmask16 uint16_t

#define EACH(result, expression)                                                                   \
    result r;                                                                                      \
    for (int i = 0; i < 16; i++)                                                                   \
        r.lane[i] = (expression);                                                                  \
    return r
#define NAMED(name) emulated_##name

static inline wide_integers NAMED(set1_epi32)(int32_t a)
{
    EACH(wide_integers, a);
}
static inline wide_floats NAMED(set1_ps)(float a)
{
    EACH(wide_floats, a);
}
static inline wide_integers NAMED(maskz_loadu_epi32)(uint16_t mask, const int32_t *p)
{
    EACH(wide_integers, mask >> i & 1 ? p[i] : 0);
}
static inline wide_integers NAMED(sub_epi32)(wide_integers a, wide_integers b)
{
    EACH(wide_integers, (int32_t)((uint32_t)a.lane[i] - (uint32_t)b.lane[i]));
}
static inline wide_integers NAMED(add_epi32)(wide_integers a, wide_integers b)
{
    EACH(wide_integers, (int32_t)((uint32_t)a.lane[i] + (uint32_t)b.lane[i]));
}
static inline wide_floats NAMED(cvtepi32_ps)(wide_integers a)
{
    EACH(wide_floats, (float)a.lane[i]);
}
static inline wide_floats NAMED(add_ps)(wide_floats a, wide_floats b)
{
    EACH(wide_floats, a.lane[i] + b.lane[i]);
}
static inline wide_floats NAMED(mul_ps)(wide_floats a, wide_floats b)
{
    EACH(wide_floats, a.lane[i] * b.lane[i]);
}
static inline wide_floats NAMED(fmadd_ps)(wide_floats a, wide_floats b, wide_floats c)
{
    EACH(wide_floats, fmaf(a.lane[i], b.lane[i], c.lane[i]));
}
static inline wide_floats NAMED(loadu_ps)(const float *p)
{
    EACH(wide_floats, p[i]);
}
static inline void NAMED(storeu_ps)(float *p, wide_floats a)
{
    memcpy(p, a.lane, sizeof a.lane);
}
static inline void NAMED(storeu_si512)(void *p, wide_integers a)
{
    memcpy(p, a.lane, sizeof a.lane);
}
static inline wide_floats NAMED(abs_ps)(wide_floats a)
{
    EACH(wide_floats, fabsf(a.lane[i]));
}
static inline wide_floats NAMED(max_ps)(wide_floats a, wide_floats b)
{
    EACH(wide_floats, a.lane[i] > b.lane[i] ? a.lane[i] : b.lane[i]);
}
/* _CMP_LE_OQ and _CMP_LT_OQ only. */
static inline uint16_t NAMED(mask_compare)(uint16_t mask, wide_floats a, wide_floats b,
                                           int comparison)
{
    unsigned r = 0;
    for (int i = 0; i < 16; i++)
        r |= (unsigned)(comparison == _CMP_LT_OQ ? a.lane[i] < b.lane[i] : a.lane[i] <= b.lane[i])
             << i;
    return (uint16_t)(r & mask);
}
static inline wide_integers NAMED(maskz_compress_epi32)(uint16_t mask, wide_integers a)
{
    wide_integers r = {{0}};
    for (int i = 0, n = 0; i < 16; i++)
        if (mask >> i & 1)
            r.lane[n++] = a.lane[i];
    return r;
}

#define _mm512_set1_epi32 NAMED(set1_epi32)
#define _mm512_setr_epi32(...) ((wide_integers){{__VA_ARGS__}})
#define _mm512_set1_ps NAMED(set1_ps)
#define _mm512_maskz_loadu_epi32 NAMED(maskz_loadu_epi32)
#define _mm512_sub_epi32 NAMED(sub_epi32)
#define _mm512_add_epi32 NAMED(add_epi32)
#define _mm512_cvtepi32_ps NAMED(cvtepi32_ps)
#define _mm512_add_ps NAMED(add_ps)
#define _mm512_mul_ps NAMED(mul_ps)
#define _mm512_fmadd_ps NAMED(fmadd_ps)
#define _mm512_loadu_ps NAMED(loadu_ps)
#define _mm512_storeu_ps NAMED(storeu_ps)
#define _mm512_storeu_si512 NAMED(storeu_si512)
#define _mm512_abs_ps NAMED(abs_ps)
#define _mm512_max_ps NAMED(max_ps)
#define _mm512_mask_cmp_ps_mask NAMED(mask_compare)
#define _mm512_maskz_compress_epi32 NAMED(maskz_compress_epi32)
