/* The kernels for WebAssembly's SIMD: the common text, and searches of four candidates at once.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <wasm_simd128.h>

#include "kernels.h"

/* The loops of search() and, with cube, search_cube() in body.h, same operations in the same order. */
static inline size_t search_run(const ascc_coordinates *points, size_t begin, size_t end, int32_t x,
                                int32_t y, int32_t z, float limit, int cube,
                                uint32_t *restrict found)
{
    const v128_t qx = wasm_i32x4_splat(x), qy = wasm_i32x4_splat(y), qz = wasm_i32x4_splat(z);
    const v128_t limits = wasm_f32x4_splat(limit), one = wasm_f32x4_splat(1.0f);
    size_t count = 0, i = begin;
    for (; i + 4 <= end; i += 4) {
        const v128_t dx =
            wasm_f32x4_convert_i32x4(wasm_i32x4_sub(wasm_v128_load(points->x + i), qx));
        const v128_t dy =
            wasm_f32x4_convert_i32x4(wasm_i32x4_sub(wasm_v128_load(points->y + i), qy));
        const v128_t dz =
            wasm_f32x4_convert_i32x4(wasm_i32x4_sub(wasm_v128_load(points->z + i), qz));
        v128_t near;
        if (cube) {
            const v128_t ax = wasm_f32x4_abs(wasm_f32x4_mul(dx, limits));
            const v128_t ay = wasm_f32x4_abs(wasm_f32x4_mul(dy, limits));
            const v128_t az = wasm_f32x4_abs(wasm_f32x4_mul(dz, limits));
            near = wasm_f32x4_lt(wasm_f32x4_pmax(wasm_f32x4_pmax(ax, ay), az), one);
        } else {
            const v128_t square =
                wasm_f32x4_add(wasm_f32x4_add(wasm_f32x4_mul(dx, dx), wasm_f32x4_mul(dy, dy)),
                               wasm_f32x4_mul(dz, dz));
            near = wasm_f32x4_le(square, limits);
        }
        const uint32_t mask = wasm_i32x4_bitmask(near);
        for (uint32_t lane = 0; mask != 0 && lane < 4; lane++) {
            found[count] = (uint32_t)i + lane;
            count += mask >> lane & 1;
        }
    }
    for (; i < end; i++) {
        const float dx = (float)(int32_t)((uint32_t)points->x[i] - (uint32_t)x);
        const float dy = (float)(int32_t)((uint32_t)points->y[i] - (uint32_t)y);
        const float dz = (float)(int32_t)((uint32_t)points->z[i] - (uint32_t)z);
        const float ax = fabsf(dx * limit), ay = fabsf(dy * limit), az = fabsf(dz * limit);
        const float xy = ax > ay ? ax : ay;
        found[count] = (uint32_t)i;
        count += cube ? (xy > az ? xy : az) < 1.0f : dx * dx + dy * dy + dz * dz <= limit;
    }
    return count;
}

static inline size_t search_lanes(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                                  int32_t x, int32_t y, int32_t z, float limit, int cube,
                                  uint32_t *restrict found)
{
    size_t count = 0;
    for (size_t r = 0; r < n; r++)
        count +=
            search_run(points, runs[r].begin, runs[r].end, x, y, z, limit, cube, found + count);
    return count;
}

static size_t search_simd128(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                             int32_t x, int32_t y, int32_t z, float limit, uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, limit, 0, found);
}

static size_t search_cube_simd128(const ascc_coordinates *points, const ascc_run *runs, size_t n,
                                  int32_t x, int32_t y, int32_t z, float inverse,
                                  uint32_t *restrict found)
{
    return search_lanes(points, runs, n, x, y, z, inverse, 1, found);
}

#define SEARCH search_simd128
#define SEARCH_CUBE search_cube_simd128
#define ASCC_USE_SIMD128
#define ASCC_VARIANT ascc_kernels_simd128
#include "body.h"
