/* The kernels for AVX-512 F, BW, DQ and VL: the common text in registers of eight floats, of which there
 * are 32 now; products sixteen columns wide; searches that compact sixteen candidates at once.
 * SPDX-License-Identifier: MIT
 *
 * Where a machine has AVX-512, every test runs this; elsewhere tests/cross_test.sh runs the text over
 * intrinsics emulated lane by lane. */
#include <immintrin.h>
#include <stddef.h>
#include <stdint.h>

#include "kernels.h"

/* The loops of search() and, with cube, search_cube() in body.h, same operations in the same order. */
static inline size_t search_lanes(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                                  int32_t x, int32_t y, int32_t z, float limit, int cube,
                                  uint32_t *restrict found)
{
    const __m512i qx = _mm512_set1_epi32(x), qy = _mm512_set1_epi32(y), qz = _mm512_set1_epi32(z);
    const __m512 limits = _mm512_set1_ps(limit), one = _mm512_set1_ps(1.0f);
    const __m512i steps = _mm512_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15);
    size_t count = 0;
    for (size_t r = 0; r < n; r++)
        for (size_t i = runs[r].begin; i < runs[r].end; i += 16) {
            const size_t left = runs[r].end - i;
            const __mmask16 valid = (__mmask16)(left < 16 ? (1u << left) - 1u : 0xffffu);
            const __m512 dx = _mm512_cvtepi32_ps(
                _mm512_sub_epi32(_mm512_maskz_loadu_epi32(valid, points->x + i), qx));
            const __m512 dy = _mm512_cvtepi32_ps(
                _mm512_sub_epi32(_mm512_maskz_loadu_epi32(valid, points->y + i), qy));
            const __m512 dz = _mm512_cvtepi32_ps(
                _mm512_sub_epi32(_mm512_maskz_loadu_epi32(valid, points->z + i), qz));
            __mmask16 near;
            if (cube) {
                const __m512 ax = _mm512_abs_ps(_mm512_mul_ps(dx, limits));
                const __m512 ay = _mm512_abs_ps(_mm512_mul_ps(dy, limits));
                const __m512 az = _mm512_abs_ps(_mm512_mul_ps(dz, limits));
                near = _mm512_mask_cmp_ps_mask(valid, _mm512_max_ps(_mm512_max_ps(ax, ay), az), one,
                                               _CMP_LT_OQ);
            } else {
                const __m512 square =
                    _mm512_add_ps(_mm512_add_ps(_mm512_mul_ps(dx, dx), _mm512_mul_ps(dy, dy)),
                                  _mm512_mul_ps(dz, dz));
                near = _mm512_mask_cmp_ps_mask(valid, square, limits, _CMP_LE_OQ);
            }
            const __m512i rows = _mm512_add_epi32(_mm512_set1_epi32((int)(uint32_t)i), steps);
            /* Compressed in a register: found has room for a whole one, and that store is the fast one. */
            _mm512_storeu_si512(found + count, _mm512_maskz_compress_epi32(near, rows));
            count += (size_t)_mm_popcnt_u32(near);
        }
    return count;
}

static size_t search_avx512(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                            int32_t x, int32_t y, int32_t z, float limit, uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, limit, 0, found);
}

static size_t search_cube_avx512(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                                 int32_t x, int32_t y, int32_t z, float inverse,
                                 uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, inverse, 1, found);
}

/* TILE of body.h with registers of sixteen floats: out[rows][vectors * 16] += in * weight. */
#define WIDE_TILE(name, rows, vectors)                                                             \
    static void name(const float *restrict in, size_t in_stride, size_t a,                         \
                     const float *restrict weight, size_t b, float *restrict out,                  \
                     size_t out_stride)                                                            \
    {                                                                                              \
        __m512 sum[rows][vectors];                                                                 \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                sum[r][c] = _mm512_loadu_ps(out + r * out_stride + c * 16);                        \
        for (size_t i = 0; i < a; i++) {                                                           \
            __m512 w[vectors];                                                                     \
            for (size_t c = 0; c < vectors; c++)                                                   \
                w[c] = _mm512_loadu_ps(weight + i * b + c * 16);                                   \
            for (size_t r = 0; r < rows; r++) {                                                    \
                const __m512 value = _mm512_set1_ps(in[r * in_stride + i]);                        \
                for (size_t c = 0; c < vectors; c++)                                               \
                    sum[r][c] = _mm512_fmadd_ps(value, w[c], sum[r][c]);                           \
            }                                                                                      \
        }                                                                                          \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                _mm512_storeu_ps(out + r * out_stride + c * 16, sum[r][c]);                        \
    }
WIDE_TILE(wide_8_2, 8, 2)
WIDE_TILE(wide_4_2, 4, 2)
WIDE_TILE(wide_1_2, 1, 2)
WIDE_TILE(wide_8_1, 8, 1)
WIDE_TILE(wide_4_1, 4, 1)
WIDE_TILE(wide_1_1, 1, 1)

/* The columns of multiply() in whole sixteens; returns how many. At most eight are left. */
static size_t multiply_wide(const float *in, size_t in_stride, size_t n, size_t a,
                            const float *weight, size_t b, float *out, size_t out_stride)
{
    size_t c = 0;
#define ROWS(tile, rows)                                                                           \
    for (; r + rows <= n; r += rows)                                                               \
        tile(in + r * in_stride, in_stride, a, weight + c, b, out + r * out_stride + c, out_stride);
    for (; c + 32 <= b; c += 32) {
        size_t r = 0;
        ROWS(wide_8_2, 8)
        ROWS(wide_4_2, 4)
        ROWS(wide_1_2, 1)
    }
    if (c + 16 <= b) {
        size_t r = 0;
        ROWS(wide_8_1, 8)
        ROWS(wide_4_1, 4)
        ROWS(wide_1_1, 1)
        c += 16;
    }
#undef ROWS
    return c;
}

/* BLOCKS of body.h likewise. */
#define WIDE_BLOCKS(name, rows, vectors)                                                           \
    static void name(const float *const *in, size_t blocks, size_t a,                              \
                     const float *restrict weight, size_t b, float *restrict out,                  \
                     size_t out_stride)                                                            \
    {                                                                                              \
        __m512 sum[rows][vectors];                                                                 \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                sum[r][c] = _mm512_loadu_ps(out + r * out_stride + c * 16);                        \
        for (size_t k = 0; k < blocks; k++) {                                                      \
            const float *from[rows];                                                               \
            for (size_t r = 0; r < rows; r++)                                                      \
                from[r] = in[r * blocks + k];                                                      \
            for (size_t i = 0; i < a; i++, weight += b) {                                          \
                __m512 w[vectors];                                                                 \
                for (size_t c = 0; c < vectors; c++)                                               \
                    w[c] = _mm512_loadu_ps(weight + c * 16);                                       \
                for (size_t r = 0; r < rows; r++) {                                                \
                    const __m512 value = _mm512_set1_ps(from[r][i]);                               \
                    for (size_t c = 0; c < vectors; c++)                                           \
                        sum[r][c] = _mm512_fmadd_ps(value, w[c], sum[r][c]);                       \
                }                                                                                  \
            }                                                                                      \
        }                                                                                          \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                _mm512_storeu_ps(out + r * out_stride + c * 16, sum[r][c]);                        \
    }
WIDE_BLOCKS(wide_blocks_6_2, 6, 2)
WIDE_BLOCKS(wide_blocks_1_2, 1, 2)
WIDE_BLOCKS(wide_blocks_8_1, 8, 1)
WIDE_BLOCKS(wide_blocks_1_1, 1, 1)

/* The columns of multiply_blocks() in whole sixteens; returns how many. */
static size_t multiply_wide_blocks(const float *const *in, size_t blocks, size_t n, size_t a,
                                   const float *weight, size_t b, float *out, size_t out_stride)
{
    size_t c = 0;
#define ROWS(tile, rows)                                                                           \
    for (; r + rows <= n; r += rows)                                                               \
        tile(in + r * blocks, blocks, a, weight + c, b, out + r * out_stride + c, out_stride);
    for (; c + 32 <= b; c += 32) {
        size_t r = 0;
        ROWS(wide_blocks_6_2, 6)
        ROWS(wide_blocks_1_2, 1)
    }
    if (c + 16 <= b) {
        size_t r = 0;
        ROWS(wide_blocks_8_1, 8)
        ROWS(wide_blocks_1_1, 1)
        c += 16;
    }
#undef ROWS
    return c;
}

#define ASCC_USE_AVX2
#define SEARCH search_avx512
#define SEARCH_CUBE search_cube_avx512
#define MULTIPLY_FIRST multiply_wide
#define MULTIPLY_BLOCKS_FIRST multiply_wide_blocks
#define ASCC_VARIANT ascc_kernels_avx512
#include "body.h"
