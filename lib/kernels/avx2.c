/* The kernels for AVX2 and FMA: the common text, and searches that compact eight candidates at once.
 * SPDX-License-Identifier: MIT */
#include <immintrin.h>
#include <stddef.h>
#include <stdint.h>

#include "kernels.h"
#define ASCC_USE_AVX2
#include "vector.h"

/* The loops of search() and, with cube, search_cube() in body.h, same operations in the same order. */
static inline size_t search_lanes(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                                  int32_t x, int32_t y, int32_t z, float limit, int cube,
                                  uint32_t *restrict found)
{
    const __m256i qx = _mm256_set1_epi32(x), qy = _mm256_set1_epi32(y), qz = _mm256_set1_epi32(z);
    const __m256 limits = _mm256_set1_ps(limit), one = _mm256_set1_ps(1.0f);
    const __m256 sign = _mm256_set1_ps(-0.0f);
    const __m256i steps = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
    size_t count = 0;
    for (size_t r = 0; r < n; r++)
        for (size_t i = runs[r].begin; i < runs[r].end; i += 8) {
            const size_t left = runs[r].end - i;
            const __m256i valid =
                _mm256_cmpgt_epi32(_mm256_set1_epi32(left < 8 ? (int)left : 8), steps);
            const __m256 dx = _mm256_cvtepi32_ps(
                _mm256_sub_epi32(_mm256_maskload_epi32(points->x + i, valid), qx));
            const __m256 dy = _mm256_cvtepi32_ps(
                _mm256_sub_epi32(_mm256_maskload_epi32(points->y + i, valid), qy));
            const __m256 dz = _mm256_cvtepi32_ps(
                _mm256_sub_epi32(_mm256_maskload_epi32(points->z + i, valid), qz));
            __m256 near;
            if (cube) {
                const __m256 ax = _mm256_andnot_ps(sign, _mm256_mul_ps(dx, limits));
                const __m256 ay = _mm256_andnot_ps(sign, _mm256_mul_ps(dy, limits));
                const __m256 az = _mm256_andnot_ps(sign, _mm256_mul_ps(dz, limits));
                near = _mm256_cmp_ps(_mm256_max_ps(_mm256_max_ps(ax, ay), az), one, _CMP_LT_OQ);
            } else {
                const __m256 square =
                    _mm256_add_ps(_mm256_add_ps(_mm256_mul_ps(dx, dx), _mm256_mul_ps(dy, dy)),
                                  _mm256_mul_ps(dz, dz));
                near = _mm256_cmp_ps(square, limits, _CMP_LE_OQ);
            }
            near = _mm256_and_ps(near, _mm256_castsi256_ps(valid));
            count += store_lanes(found + count, (uint32_t)i, (unsigned)_mm256_movemask_ps(near));
        }
    return count;
}

static size_t search_avx2(const ascc_coordinates *points, const ascc_run *runs, size_t n, int32_t x,
                          int32_t y, int32_t z, float limit, uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, limit, 0, found);
}

static size_t search_cube_avx2(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                               int32_t x, int32_t y, int32_t z, float inverse,
                               uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, inverse, 1, found);
}

#define SEARCH search_avx2
#define SEARCH_CUBE search_cube_avx2
#define ASCC_VARIANT ascc_kernels_avx2
#include "body.h"
