/* The kernel table: pure functions from arrays to arrays. They know no handle, allocate nothing and
 * cannot fail. portable.c defines what is right; every variant gives the same bits.
 * SPDX-License-Identifier: MIT
 *
 * Shape letters: n rows, k neighbours, a input channels, b output channels, c kernel cells. Channels
 * come in multiples of 8, filled up with zeros where a network has fewer.
 */
#ifndef ASCC_KERNELS_H
#define ASCC_KERNELS_H

#include <stddef.h>
#include <stdint.h>

/* Positions as kernels see them: integers, so that differences are exact and exactly antisymmetric.
 * Only differences within a search are meaningful: coordinates wrap around modulo 2^32. */
typedef struct ascc_coordinates {
    const int32_t *x, *y, *z;
} ascc_coordinates;

/* Geometry of neighbour pairs, one entry a pair: where the neighbour lies in the kernel's cube
 * [-1, 1]^3, and the value of each window there (by ascc_window; NULL = not wanted). Every array can
 * be read to the next multiple of 8 pairs; what lies there does not matter. */
typedef struct ascc_pairs {
    float *x, *y, *z;
    float *window[3];
} ascc_pairs;

typedef struct ascc_kernels {
    /* Appends to found[] those of points [begin, end) whose squared distance from (x, y, z) is at
     * most limit (in squared units of the integers); ascending. Returns how many. found has room
     * for end - begin + 16. */
    size_t (*search)(const ascc_coordinates *points, size_t begin, size_t end, int32_t x, int32_t y,
                     int32_t z, float limit, uint32_t *found);

    /* pairs[k] of the displacements neighbour[k] - (x, y, z), scaled by inverse_radius into the unit
     * ball and mapped to the cube. mapping is an ascc_mapping. */
    void (*geometry)(const ascc_coordinates *points, const uint32_t *neighbor, size_t k, int32_t x,
                     int32_t y, int32_t z, float inverse_radius, int mapping,
                     const ascc_pairs *pairs);

    /* column[c][a] = sum over k of window * trilinear weight * feature[neighbor[k]][a], neighbours in
     * order; window NULL = 1. cells: along x, y, z. column is overwritten. */
    void (*gather)(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor, size_t k,
                   const float *feature, size_t a, const int32_t cells[3], float *column);

    /* out[n][out_stride] += in[n][a] * weight[a][b]: each output one chain of fma over ascending a. */
    void (*multiply)(const float *in, size_t in_stride, size_t n, size_t a, const float *weight,
                     size_t b, float *out, size_t out_stride);

    /* out[j][b] = window * sum over a of (center[a] + feature[neighbor[j]][a]) * kernel(j)[b][a],
     * kernel(j) = sum over c of trilinear weight * weight[c][b][a], for each pair j < k on its own.
     * 8 partial sums by a mod 8; b <= 3 is not filled up here, out is [k][4]. */
    void (*pair_terms)(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor,
                       size_t k, const float *center, const float *feature, size_t a,
                       const int32_t cells[3], const float *weight, size_t b, float *out);
} ascc_kernels;

/* Fills the table with the best variants among the bits of cpu (ASCC_CPU_*). */
void ascc_kernels_select(ascc_kernels *kernels, uint32_t cpu);
/* The ASCC_CPU_* bits that this CPU and operating system can run and this build has. */
uint32_t ascc_kernels_available(void);

void ascc_kernels_portable(ascc_kernels *kernels);
void ascc_kernels_avx2(ascc_kernels *kernels);
void ascc_kernels_avx512(ascc_kernels *kernels);
void ascc_kernels_neon(ascc_kernels *kernels);

#endif
