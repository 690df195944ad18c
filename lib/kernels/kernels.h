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

/* Points [begin, end). */
typedef struct ascc_run {
    size_t begin, end;
} ascc_run;

/* Geometry of neighbour pairs, one entry a pair: where the neighbour lies in the kernel's cube
 * [-1, 1]^3, and the value of each window there (by ascc_window; NULL = not wanted). Every array can
 * be read to the next multiple of 8 pairs; what lies there does not matter. */
typedef struct ascc_pairs {
    float *x, *y, *z;
    float *window[4]; /* the last: the hat, (1 - |x|) (1 - |y|) (1 - |z|), no factor below 0 */
    float *distance;  /* with mapping 3, which turns x, y, z into unit vectors (0 at the centre) */
} ascc_pairs;

/* A gradient for each pair of each row: row i has those from start[i] to end[i], filled up to a multiple
 * of 8 with zeros; neighbours are rows below 2^31. */
typedef struct ascc_gradients {
    const size_t *start, *end;
    const uint32_t *neighbor;
    const float *g[3];
    const float *weight; /* or NULL */
} ascc_gradients;

/* What pressures give pairs: see pressure_impulses. */
typedef struct ascc_pressures {
    const float *pressure; /* of rows */
    float limit;
    double factor;
    const double *mass;  /* of rows, or of all */
    int uniform;         /* the latter */
    const double *place; /* [row][3] or NULL */
} ascc_pressures;

/* Pairs of one row that are evaluated together. */
#define ASCC_PAIR_BATCH 64

/* Rows whose pairs act along the lines to their neighbours: all but the rows' own coefficients. Those are of
 * each bump strength and damping in turn, 16 numbers, zeros where there are fewer. */
typedef struct ascc_lines {
    const int32_t *row, *neighbor; /* places as the network sees them, [row][4] */
    float inverse_radius;
    size_t bumps, dimension;
    int both; /* neighbours are rows of the same set; else they are walls, and have no coefficients */
    const float *coefficient; /* [row][16], if both */
    /* Motions of rows, a apart: `dimension` numbers are read, but 4 loaded; NULL = no damping. */
    const float *motion;
    size_t a;
    const float *drift; /* motions of walls, [row][4]; NULL = 0 */
    /* Of neighbours, so far apart, what strength and damping are multiplied by; NULL = 1. */
    const float *area;
    size_t area_stride;
    /* [row][3], if both: between these the lines run, turned; NULL = as seen. */
    const double *place;
    double factor, limit;
} ascc_lines;

typedef struct ascc_kernels {
    /* Writes to found[] those points of some runs whose squared distance from (x, y, z) is at most limit (in
     * squared units of the integers); in order. Returns how many. found has room for all points of the runs
     * + 16. */
    size_t (*search)(const ascc_coordinates *points, const ascc_run *runs, size_t count, int32_t x,
                     int32_t y, int32_t z, float limit, uint32_t *found);

    /* The same of those within a cube: all of |x|, |y|, |z| times inverse below 1, the hat above 0. */
    size_t (*search_cube)(const ascc_coordinates *points, const ascc_run *runs, size_t count,
                          int32_t x, int32_t y, int32_t z, float inverse, uint32_t *found);

    /* pairs[k] of the displacements neighbour[k] - (x, y, z), scaled by inverse_radius into the unit
     * ball and mapped to the cube (or to directions). mapping is an ascc_mapping. */
    void (*geometry)(const ascc_coordinates *points, const uint32_t *neighbor, size_t k, int32_t x,
                     int32_t y, int32_t z, float inverse_radius, int mapping,
                     const ascc_pairs *pairs);

    /* The same with mapping 3 of places [row][4], of which the first three count. Fills up to a multiple of 8
     * pairs. */
    void (*directions)(const int32_t *place, const uint32_t *neighbor, size_t k,
                       const int32_t at[3], float inverse_radius, const ascc_pairs *pairs);

    /* column[c][a] = sum over k of window * trilinear weight * feature[neighbor[k]][a], neighbours in
     * order; window NULL = 1. cells: along x, y, z. column is overwritten. */
    void (*gather)(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor, size_t k,
                   const float *feature, size_t a, const int32_t cells[3], float *column);

    /* out[n][out_stride] += in[n][a] * weight[a][b]: each output one chain of fma over ascending a. */
    void (*multiply)(const float *in, size_t in_stride, size_t n, size_t a, const float *weight,
                     size_t b, float *out, size_t out_stride);

    /* The same of inputs in blocks that lie anywhere: out[n][out_stride] += in[n][block][a] *
     * weight[block][a][b]. */
    void (*multiply_blocks)(const float *const *in, size_t blocks, size_t n, size_t a,
                            const float *weight, size_t b, float *out, size_t out_stride);

    /* factor[m * stride + j] = basis function m of pair j, m = bump * harmonics + harmonic:
     * (1 - (bumps * distance - bump)^2)^2 where that square is below 1, else 0, times a harmonic of
     * the direction (docs/file-format.md): 1; 3 or 5 of them in the plane; 4 or 9 in space. Fills up
     * to the next multiple of 8 pairs. */
    void (*basis)(const ascc_pairs *pairs, size_t k, size_t bumps, size_t harmonics, float *factor,
                  size_t stride);

    /* column[m][a] = sum over k of factor[m * stride + k] * feature[neighbor[k]][a], m < bumps *
     * harmonics: one chain of fma over neighbours in order. Pairs whose first harmonic is 0 are left
     * out. column is overwritten. */
    void (*gather_basis)(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                         const uint32_t *neighbor, size_t k, const float *feature, size_t a,
                         float *column);

    /* impulse[c][j] = mass[j * mass_step] * share * line[c], the line from the row to neighbour j < k,
     * share = factor * strength over the line's length, 0 without one. strength = sum over bumps of its
     * function of the distance, as in basis, times both sides' coefficients; turned, times the cosine between the line and
     * the displacement; less as much damping times the speed of approach; cut off at limit. */
    void (*pair_lines)(const ascc_lines *lines, size_t row, const float own[16],
                       const uint32_t *neighbor, size_t k, const double *mass, size_t mass_step,
                       double impulse[3][ASCC_PAIR_BATCH]);

    /* sum[bump][8] = sum over the pairs j < k in order of a bump (as in basis, of the distance) times the
     * eight numbers 1, x, y, z, w, each times weight, and d[3]. fluid: d = feature[neighbor[j]] - own; wall: d =
     * feature[neighbor[j]]; w, the speed of approach, is -(d . xyz), of a wall (own - drift) . xyz. One chain of
     * fma a number. feature rows are a apart, of which `dimension` numbers are read (but 4 are loaded);
     * weight[neighbor[j] * stride], NULL = 1; drift[neighbor[j]][4] of walls, NULL = 0. With 2 dimensions z and
     * d[2] are 0. */
    void (*moments)(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k,
                    const float *feature, size_t a, const float own[3], int wall, size_t dimension,
                    const float *weight, size_t stride, const float *drift, size_t bumps,
                    float *sum);

    /* out[j][b] = window * sum over a of (center[a] + feature[neighbor[j]][a]) * kernel(j)[b][a],
     * kernel(j) = sum over c of trilinear weight * weight[c][b][a], for each pair j < k on its own.
     * 8 partial sums by a mod 8; b <= 3 is not filled up here; out is [k][4], the rest zeros. */
    void (*pair_terms)(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor,
                       size_t k, const float *center, const float *feature, size_t a,
                       const int32_t cells[3], const float *weight, size_t b, float *out);

    /* own[4] += q(j), sum[neighbor[j]][4] -= q(j) for each pair j < k, no neighbour being the row
     * itself: q(j)[c] is the integer nearest to term[j][c] * factor[c] * mass[j * mass_step], ties to
     * even. 0 if a product is not below limit <= 2^50 or a sum does not fit (then it has wrapped),
     * else 1. */
    int (*pair_impulses)(const float *term, const double factor[4], const double *mass,
                         size_t mass_step, double limit, const uint32_t *neighbor, size_t k,
                         int64_t own[4], int64_t *sum);

    /* The same for q(j)[c], the integer nearest to impulse[c][j]; c < 3. */
    int (*add_impulses)(double impulse[3][ASCC_PAIR_BATCH], double limit, const uint32_t *neighbor,
                        size_t k, int64_t own[4], int64_t *sum);

    /* The cubic spline w = 2 (1 - q)^3 - 8 (1/2 - q)^3, no bracket below 0, of k pairs with unit vectors and
     * distances q (geometry, mapping 3), times volume, or with volumes times volumes[neighbor]: distance
     * becomes that value, x, y, z minus its slope times the unit vector. sum[8] = the sums of value, x,
     * y, z, and of x^2 + y^2 + z^2, then zeros; 8 partial sums by pair mod 8. Fills up with zeros. */
    void (*spline)(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k, float volume,
                   const float *volumes, float sum[8]);

    /* Keeps of a row's k pairs those whose x, y, z are not all 0: in order, neighbours at `to`, filled up to a
     * multiple of 8 with the row and zeros; returns how many that makes. Room for k, filled up likewise. */
    size_t (*keep_gradients)(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k,
                             uint32_t row, uint32_t *to, float *const g[3]);

    /* Of rows [begin, end): move[i][c] = -(pressure[i] own[c][i] + sum over pairs of weight
     * pressure[neighbor] g[c]); a pair's weight is 1 without weights. 8 partial sums by pair mod 8.
     * Rows of move are 4 wide. */
    void (*push)(const ascc_gradients *pairs, size_t begin, size_t end, const float *pressure,
                 float *const own[3], float *move);

    /* Of rows [begin, end): change[i] = own[i] . move[i] - sum over pairs of g . move[neighbor]. */
    void (*divergence)(const ascc_gradients *pairs, size_t begin, size_t end, float *const own[3],
                       const float *move, float *change);

    /* Pairs of a row with neighbours after it: impulses -(both pressures) g, cut off at limit, turned into
     * the line between their places, times factor and the masses that ascc_pair_mass makes of both. Added to the
     * row's sums and taken from the neighbours', [row][4], as add_impulses does, with its limit of quanta. */
    int (*pressure_impulses)(const ascc_gradients *pairs, const ascc_pressures *pressures,
                             size_t row, double limit, int64_t *sum);

    /* Of rows [begin, end): rough[i][c] = sum over pairs of weight (move[i] - move[neighbor])[c]. Weights are those
     * of the pairs, or if weigh is not NULL |g|^2 times the smaller of both rows' fourth numbers of move, which is
     * written there; it may be g[0]. 8 partial sums by pair mod 8. Rows of move and rough are 4 wide, the last of rough 0. */
    void (*roughness)(const ascc_gradients *pairs, size_t begin, size_t end, const float *move,
                      float *weigh, float *rough);

    /* Pairs of a row with neighbours after it: impulses factor weight (rough[neighbor] - rough[row]), added and taken
     * as add_impulses does. */
    int (*rough_impulses)(const ascc_gradients *pairs, const float *rough, double factor,
                          size_t row, double limit, int64_t *sum);

    /* Of the way back: gradient[neighbor[i]][a] += sum over members m of factor[m * stride + i] *
     * column[m][a], pairs in order; members come in bumps of so many harmonics, and a bump whose
     * first factor is 0 is left out. */
    void (*scatter)(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                    const uint32_t *neighbor, size_t k, const float *column, size_t a,
                    float *gradient);

    /* dot[m * stride + i] = sum over a of column[m][a] * feature[neighbor[i]][a]. */
    void (*dot)(const float *column, size_t members, const uint32_t *neighbor, size_t k,
                const float *feature, size_t a, float *dot, size_t stride);
} ascc_kernels;

/* Fills the table with the best variants among the bits of cpu (ASCC_CPU_*). */
void ascc_kernels_select(ascc_kernels *kernels, uint32_t cpu);
/* The ASCC_CPU_* bits that this CPU and operating system can run and this build has. */
uint32_t ascc_kernels_available(void);

void ascc_kernels_portable(ascc_kernels *kernels);
void ascc_kernels_avx2(ascc_kernels *kernels);
void ascc_kernels_avx512(ascc_kernels *kernels);
void ascc_kernels_neon(ascc_kernels *kernels);
void ascc_kernels_simd128(ascc_kernels *kernels);

#endif
