/* Every kernel, written once in plain C and compiled for each instruction set.
 * SPDX-License-Identifier: MIT
 *
 * All variants give the same bits because they are this text: only correctly rounded operations, fma
 * exactly where fmaf stands, every sum in the order written here, and no libm transcendental.
 */
#include "kernels.h"
#include "vector.h"

#define RESTRICT restrict
#if defined(__clang__)
#define UNROLL _Pragma("clang loop unroll_count(4)")
#elif defined(__GNUC__)
#define UNROLL _Pragma("GCC unroll 4")
#else
#define UNROLL
#endif

/* A variant may bring searches of its own. */
#ifndef SEARCH
#define SEARCH search
static size_t search(const ascc_coordinates *points, const ascc_run *runs, size_t count, int32_t x,
                     int32_t y, int32_t z, float limit, uint32_t *RESTRICT found)
{
    size_t n = 0;
    const uint32_t ux = (uint32_t)x, uy = (uint32_t)y, uz = (uint32_t)z;
    for (size_t r = 0; r < count; r++)
        for (size_t i = runs[r].begin; i < runs[r].end; i++) {
            const float dx = (float)(int32_t)((uint32_t)points->x[i] - ux);
            const float dy = (float)(int32_t)((uint32_t)points->y[i] - uy);
            const float dz = (float)(int32_t)((uint32_t)points->z[i] - uz);
            found[n] = (uint32_t)i;
            n += dx * dx + dy * dy + dz * dz <= limit;
        }
    return n;
}
#endif

#ifndef SEARCH_CUBE
#define SEARCH_CUBE search_cube
static size_t search_cube(const ascc_coordinates *points, const ascc_run *runs, size_t count,
                          int32_t x, int32_t y, int32_t z, float inverse, uint32_t *RESTRICT found)
{
    size_t n = 0;
    const uint32_t ux = (uint32_t)x, uy = (uint32_t)y, uz = (uint32_t)z;
    for (size_t r = 0; r < count; r++)
        for (size_t i = runs[r].begin; i < runs[r].end; i++) {
            const float dx = fabsf((float)(int32_t)((uint32_t)points->x[i] - ux) * inverse);
            const float dy = fabsf((float)(int32_t)((uint32_t)points->y[i] - uy) * inverse);
            const float dz = fabsf((float)(int32_t)((uint32_t)points->z[i] - uz) * inverse);
            const float xy = dx > dy ? dx : dy;
            found[n] = (uint32_t)i;
            n += (xy > dz ? xy : dz) < 1.0f;
        }
    return n;
}
#endif

/* (4 / pi) atan(v) for |v| <= 1; odd, within 6e-8 of the truth, monotone enough for a cell lookup. */
static inline float octant(float v)
{
    const float u = v * v;
    float p = 0.0035417804028838873f;
    p = p * u + -0.02010933682322502f;
    p = p * u + 0.053782954812049866f;
    p = p * u + -0.09505724906921387f;
    p = p * u + 0.13525182008743286f;
    p = p * u + -0.18078626692295074f;
    p = p * u + 0.25454628467559814f;
    p = p * u + -0.42440950870513916f;
    p = p * u + 1.2732394933700562f;
    return v * p;
}

/* Volume preserving map of the unit ball to the cube: ball to cylinder, cylinder to cube
 * (docs/method.md). In place. */
static void map_volume(float *RESTRICT px, float *RESTRICT py, float *RESTRICT pz, size_t k)
{
    for (size_t i = 0; i < k; i++) {
        float x = px[i], y = py[i], z = pz[i];
        const float h2 = x * x + y * y;
        const float n2 = h2 + z * z;
        const float n = sqrtf(n2);
        const float az = fabsf(z);
        const int cap = 1.25f * (z * z) > h2;
        const int center = n2 < 1e-12f;
        const float above = cap ? 3.0f * n : n2, below = cap ? n + az : h2;
        const float s = center ? 0.0f : sqrtf(above / (center ? 1.0f : below));
        z = center ? 0.0f : cap ? copysignf(n, z) : 1.5f * z;
        x *= s;
        y *= s;

        const float c2 = x * x + y * y;
        const float h = sqrtf(c2);
        const int axis = c2 < 1e-12f;
        const int along_x = fabsf(y) <= fabsf(x);
        const float large = along_x ? x : y;
        const float small = along_x ? y : x;
        const float t = axis ? 0.0f : copysignf(h, large);
        const float o = t * octant(small / (axis ? 1.0f : large));
        px[i] = along_x ? t : o;
        py[i] = along_x ? o : t;
        pz[i] = z;
    }
}

/* Each ray of the ball is stretched to the cube's surface. In place. */
static void map_radial(float *RESTRICT px, float *RESTRICT py, float *RESTRICT pz, size_t k)
{
    for (size_t i = 0; i < k; i++) {
        const float x = px[i], y = py[i], z = pz[i];
        const float n2 = x * x + y * y + z * z;
        const float xy = fabsf(x) > fabsf(y) ? fabsf(x) : fabsf(y);
        const float largest = xy > fabsf(z) ? xy : fabsf(z);
        const int center = n2 < 1e-12f;
        const float s = center ? 0.0f : sqrtf(n2) / (center ? 1.0f : largest);
        px[i] = x * s;
        py[i] = y * s;
        pz[i] = z * s;
    }
}

/* Unit vectors and lengths; the centre has no direction. In place. */
static void map_direction(float *RESTRICT px, float *RESTRICT py, float *RESTRICT pz,
                          float *RESTRICT distance, size_t k)
{
    for (size_t i = 0; i < k; i++) {
        const float x = px[i], y = py[i], z = pz[i];
        const float n = sqrtf(x * x + y * y + z * z);
        const float s = 1.0f / (n > 0.0f ? n : 1.0f);
        px[i] = x * s;
        py[i] = y * s;
        pz[i] = z * s;
        distance[i] = n;
    }
}

static void geometry(const ascc_coordinates *points, const uint32_t *RESTRICT neighbor, size_t k,
                     int32_t x, int32_t y, int32_t z, float inverse_radius, int mapping,
                     const ascc_pairs *pairs)
{
    float *RESTRICT px = pairs->x, *RESTRICT py = pairs->y, *RESTRICT pz = pairs->z;
    const int32_t *RESTRICT sx = points->x, *RESTRICT sy = points->y, *RESTRICT sz = points->z;
    for (size_t i = 0; i < k; i++) {
        const uint32_t j = neighbor[i];
        px[i] = (float)(int32_t)((uint32_t)sx[j] - (uint32_t)x) * inverse_radius;
        py[i] = (float)(int32_t)((uint32_t)sy[j] - (uint32_t)y) * inverse_radius;
        pz[i] = (float)(int32_t)((uint32_t)sz[j] - (uint32_t)z) * inverse_radius;
    }
    float *RESTRICT poly6 = pairs->window[1], *RESTRICT peak = pairs->window[2];
    if (poly6)
        for (size_t i = 0; i < k; i++) {
            const float t = 1.0f - (px[i] * px[i] + py[i] * py[i] + pz[i] * pz[i]);
            const float c = t > 0.0f ? t : 0.0f;
            poly6[i] = c * c * c;
        }
    if (peak)
        for (size_t i = 0; i < k; i++) {
            const float t = 1.0f - sqrtf(px[i] * px[i] + py[i] * py[i] + pz[i] * pz[i]);
            const float c = t > 0.0f ? t : 0.0f;
            peak[i] = c * c;
        }
    float *RESTRICT hat = pairs->window[3];
    if (hat)
        for (size_t i = 0; i < k; i++) {
            const float hx = 1.0f - fabsf(px[i]), hy = 1.0f - fabsf(py[i]);
            const float hz = 1.0f - fabsf(pz[i]);
            hat[i] = (hx > 0.0f ? hx : 0.0f) * (hy > 0.0f ? hy : 0.0f) * (hz > 0.0f ? hz : 0.0f);
        }
    if (mapping == 3)
        map_direction(px, py, pz, pairs->distance, k);
    else if (mapping == 2)
        map_volume(px, py, pz, k);
    else if (mapping == 1)
        map_radial(px, py, pz, k);
}

/* Integers to load as vectors, moved as they are. */
static inline const float *integers(const int32_t *p)
{
    return (const float *)(const void *)p;
}

static void directions(const int32_t *place, const uint32_t *neighbor, size_t k,
                       const int32_t at[3], float inverse_radius, const ascc_pairs *pairs)
{
    const vector inverse = fill(inverse_radius);
    for (size_t i = 0; i < k; i += LANES) {
        const size_t last = k - i < LANES ? k - i - 1 : LANES - 1;
        const float *from[LANES];
        vector v[4];
        for (size_t l = 0; l < LANES; l++)
            from[l] =
                (const float *)(const void *)(place +
                                              (size_t)neighbor[i + (l < last ? l : last)] * 4);
        load_quads(from, v);
        const vector x = times(more_than(v[0], at[0]), inverse);
        const vector y = times(more_than(v[1], at[1]), inverse);
        const vector z = times(more_than(v[2], at[2]), inverse);
        const vector n = root(add(add(times(x, x), times(y, y)), times(z, z)));
        const vector s = over(fill(1.0f), larger(n, fill(1e-30f))); /* 0 of 0 */
        store(pairs->x + i, times(x, s));
        store(pairs->y + i, times(y, s));
        store(pairs->z + i, times(z, s));
        store(pairs->distance + i, n);
    }
}

/* Where eight neighbours lie among the cells: the lowest of the cells around each, and the weights of
 * all of them, window included. */
typedef struct corners {
    int32_t cell[LANES];
    float weight[8][LANES];
} corners;

/* Lower cells and fractions of eight neighbours along an axis of `size` cells (align corners). At the
 * upper end the last cell has the fraction 1. */
static inline vector axis_cells(const float *p, int32_t size, vector *fraction)
{
    const vector zero = fill(0.0f), half = fill(0.5f);
    const vector c = times(add(times(load(p), half), half), fill((float)(size - 1)));
    const vector low = whole(smaller(larger(c, zero), fill(size > 1 ? (float)(size - 2) : 0.0f)));
    *fraction = smaller(larger(minus(c, low), zero), fill(1.0f));
    return low;
}

/* Corners of eight neighbours. */
static inline void find_corners(const float *x, const float *y, const float *z, const float *window,
                                const int32_t cells[3], corners *out)
{
    const vector one = fill(1.0f), scale = window ? load(window) : one;
    vector tx, ty, tz;
    const vector ix = axis_cells(x, cells[0], &tx), iy = axis_cells(y, cells[1], &ty);
    const vector iz = axis_cells(z, cells[2], &tz);
    const vector row = fill((float)cells[0]);
    store_whole(out->cell, add(times(add(times(iz, fill((float)cells[1])), iy), row), ix));
    const vector sx = minus(one, tx), sy = minus(one, ty);
    const vector z0 = times(minus(one, tz), scale), z1 = times(tz, scale);
    const vector plane[4] = {times(sx, sy), times(tx, sy), times(sx, ty), times(tx, ty)};
    for (size_t i = 0; i < 4; i++) {
        store(out->weight[i], times(plane[i], z0));
        store(out->weight[4 + i], times(plane[i], z1));
    }
}

/* Distances of the corners from the lowest in cells, and how many there are: 4 in a flat kernel. */
static inline int corner_offsets(const int32_t cells[3], size_t offset[8])
{
    const size_t x = cells[0] > 1, y = cells[1] > 1 ? (size_t)cells[0] : 0;
    const size_t z = cells[2] > 1 ? (size_t)cells[0] * (size_t)cells[1] : 0;
    for (size_t i = 0; i < 8; i++)
        offset[i] = (i & 1) * x + (i >> 1 & 1) * y + (i >> 2) * z;
    return cells[2] > 1 ? 8 : 4;
}

/* Adds one neighbour's features to the cells around it: cells that are next to each other along x lie
 * next to each other in the column, so there are 4 pairs of them, or 2 in a flat kernel. */
#define SPREAD(name, vectors)                                                                      \
    static inline void name(const float *RESTRICT f, const float *RESTRICT weight, size_t x,       \
                            size_t y, size_t z, int planes, float *RESTRICT cell)                  \
    {                                                                                              \
        vector v[vectors];                                                                         \
        for (size_t j = 0; j < vectors; j++)                                                       \
            v[j] = load(f + j * LANES);                                                            \
        for (int plane = 0; plane < planes; plane++, cell += z, weight += 4 * LANES) {             \
            float *RESTRICT at[4] = {cell, cell + x, cell + y, cell + y + x};                      \
            for (size_t c = 0; c < 4; c++) {                                                       \
                const vector w = fill(weight[c * LANES]);                                          \
                for (size_t j = 0; j < vectors; j++)                                               \
                    store(at[c] + j * LANES, fused(w, v[j], load(at[c] + j * LANES)));             \
            }                                                                                      \
        }                                                                                          \
    }
SPREAD(spread_1, 1)
SPREAD(spread_2, 2)
SPREAD(spread_3, 3)
SPREAD(spread_4, 4)

static void gather(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor, size_t k,
                   const float *feature, size_t a, const int32_t cells[3], float *column)
{
    const size_t x = cells[0] > 1 ? a : 0, y = cells[1] > 1 ? (size_t)cells[0] * a : 0;
    const size_t z = cells[2] > 1 ? (size_t)cells[0] * (size_t)cells[1] * a : 0;
    const int planes = cells[2] > 1 ? 2 : 1;
    memset(column, 0, (size_t)cells[0] * (size_t)cells[1] * (size_t)cells[2] * a * sizeof *column);
    for (size_t i = 0; i < k; i += LANES) {
        const size_t n = k - i < LANES ? k - i : LANES;
        corners at;
        find_corners(pairs->x + i, pairs->y + i, pairs->z + i, window ? window + i : NULL, cells,
                     &at);
        for (size_t l = 0; l < n; l++) {
            const float *f = feature + (size_t)neighbor[i + l] * a, *w = at.weight[0] + l;
            float *cell = column + (size_t)at.cell[l] * a;
            size_t j = 0;
            for (; j + 4 * LANES <= a; j += 4 * LANES)
                spread_4(f + j, w, x, y, z, planes, cell + j);
            if (j + 3 * LANES <= a)
                spread_3(f + j, w, x, y, z, planes, cell + j);
            else if (j + 2 * LANES <= a)
                spread_2(f + j, w, x, y, z, planes, cell + j);
            else if (j < a)
                spread_1(f + j, w, x, y, z, planes, cell + j);
        }
    }
}

/* The radial basis function of this number, of so many, at eight distances. */
static inline vector bump_at(vector distance, vector bumps, vector number)
{
    const vector t = minus(times(bumps, distance), number);
    const vector u = larger(minus(fill(1.0f), times(t, t)), fill(0.0f));
    return times(u, u);
}

/* Harmonics after the first of eight directions; in each order the squares sum to 1. */
static inline void harmonics_of(vector x, vector y, vector z, size_t harmonics, vector *out)
{
    const vector half = fill(0.5f), root3 = fill(1.7320508075688772f);
    const vector xx = times(x, x), yy = times(y, y);
    if (harmonics > 1) {
        out[0] = x;
        out[1] = y;
    }
    if (harmonics == 5) {
        out[2] = times(add(x, x), y);
        out[3] = minus(xx, yy);
    }
    if (harmonics == 4 || harmonics == 9)
        out[2] = z;
    if (harmonics == 9) {
        out[3] = times(root3, times(x, y));
        out[4] = times(root3, times(y, z));
        out[5] = times(root3, times(z, x));
        out[6] = times(times(half, root3), minus(xx, yy));
        out[7] = minus(times(z, z), times(half, add(xx, yy)));
    }
}

static void basis(const ascc_pairs *pairs, size_t k, size_t bumps, size_t harmonics, float *factor,
                  size_t stride)
{
    const vector count = fill((float)bumps);
    for (size_t i = 0; i < k; i += LANES) {
        const vector distance = load(pairs->distance + i);
        vector y[8];
        harmonics_of(load(pairs->x + i), load(pairs->y + i), load(pairs->z + i), harmonics, y);
        float *to = factor + i;
        for (size_t b = 0; b < bumps; b++, to += stride) {
            const vector bump = bump_at(distance, count, fill((float)b));
            store(to, bump);
            for (size_t h = 1; h < harmonics; h++)
                store(to += stride, times(bump, y[h - 1]));
        }
    }
}

/* column[members][vectors * 8] += over the picked pairs, all sums in registers; rows of the column are
 * `a` apart. */
#define GATHER(name, members, vectors)                                                             \
    static void name(const float *RESTRICT factor, size_t stride, const uint32_t *RESTRICT pick,   \
                     size_t k, const uint32_t *RESTRICT neighbor, const float *RESTRICT feature,   \
                     size_t a, float *RESTRICT column)                                             \
    {                                                                                              \
        vector sum[members][vectors];                                                              \
        for (size_t m = 0; m < members; m++)                                                       \
            for (size_t c = 0; c < vectors; c++)                                                   \
                sum[m][c] = load(column + m * a + c * LANES);                                      \
        for (size_t i = 0; i < k; i++) {                                                           \
            const float *f = feature + (size_t)neighbor[pick[i]] * a;                              \
            vector v[vectors];                                                                     \
            for (size_t c = 0; c < vectors; c++)                                                   \
                v[c] = load(f + c * LANES);                                                        \
            for (size_t m = 0; m < members; m++) {                                                 \
                const vector w = fill(factor[m * stride + pick[i]]);                               \
                for (size_t c = 0; c < vectors; c++)                                               \
                    sum[m][c] = fused(w, v[c], sum[m][c]);                                         \
            }                                                                                      \
        }                                                                                          \
        for (size_t m = 0; m < members; m++)                                                       \
            for (size_t c = 0; c < vectors; c++)                                                   \
                store(column + m * a + c * LANES, sum[m][c]);                                      \
    }
GATHER(gather_6_2, 6, 2)
GATHER(gather_4_2, 4, 2)
GATHER(gather_3_2, 3, 2)
GATHER(gather_1_2, 1, 2)
GATHER(gather_9_1, 9, 1)
GATHER(gather_4_1, 4, 1)
GATHER(gather_3_1, 3, 1)
GATHER(gather_1_1, 1, 1)

/* Pairs that are picked in one go. */
#define PICKS 128

/* The members of one bump, over the pairs that it reaches: with many bumps those are few. */
static void gather_bump(const float *factor, size_t stride, size_t members, const uint32_t *pick,
                        size_t k, const uint32_t *neighbor, const float *feature, size_t a,
                        float *column)
{
    size_t c = 0;
#define MEMBERS(gather, count)                                                                     \
    for (; r + count <= members; r += count)                                                       \
        gather(factor + r * stride, stride, pick, k, neighbor, feature + c, a, column + r * a + c);
    for (; c + 2 * LANES <= a; c += 2 * LANES) {
        size_t r = 0;
        MEMBERS(gather_6_2, 6)
        MEMBERS(gather_4_2, 4)
        MEMBERS(gather_3_2, 3)
        MEMBERS(gather_1_2, 1)
    }
    if (c < a) {
        size_t r = 0;
        MEMBERS(gather_9_1, 9)
        MEMBERS(gather_4_1, 4)
        MEMBERS(gather_3_1, 3)
        MEMBERS(gather_1_1, 1)
    }
#undef MEMBERS
}

static void gather_basis(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                         const uint32_t *neighbor, size_t k, const float *feature, size_t a,
                         float *column)
{
    memset(column, 0, bumps * harmonics * a * sizeof *column);
    for (size_t b = 0; b < bumps; b++, factor += harmonics * stride, column += harmonics * a)
        for (size_t begin = 0; begin < k; begin += PICKS) {
            const size_t end = k - begin < PICKS ? k : begin + PICKS;
            uint32_t pick[PICKS + LANES];
            size_t count = 0, i = begin;
            for (; i + LANES <= end; i += LANES)
                count += store_positive(pick + count, (uint32_t)i, load(factor + i));
            for (; i < end; i++) {
                pick[count] = (uint32_t)i;
                count += factor[i] > 0.0f;
            }
            gather_bump(factor, stride, harmonics, pick, count, neighbor, feature, a, column);
        }
}

/* The numbers of eight pairs from i on, n of them there: 1, direction, speed of approach, and the vector of the
 * neighbour; all but that times a weight. */
static inline void pair_numbers(const ascc_pairs *pairs, size_t i, const uint32_t *neighbor,
                                size_t n, const float *feature, size_t a, const float own[3],
                                int wall, size_t dimension, const float *weight, size_t stride,
                                const float *drift, float number[LANES][LANES])
{
    const float *from[LANES];
    float scale[LANES] = {0.0f};
    vector v[4], relative[3], moved[4] = {fill(0.0f), fill(0.0f), fill(0.0f), fill(0.0f)};
    for (size_t l = 0; l < LANES; l++) {
        const size_t j = neighbor[i + (l < n ? l : 0)];
        from[l] = feature + j * a;
        if (weight)
            scale[l] = weight[j * stride];
    }
    load_quads(from, v);
    for (size_t l = 0; drift && l < LANES; l++)
        from[l] = drift + (size_t)neighbor[i + (l < n ? l : 0)] * 4;
    if (drift)
        load_quads(from, moved);
    if (dimension < 3)
        v[2] = fill(0.0f);
    for (size_t c = 0; c < 3; c++) {
        relative[c] = minus(wall ? moved[c] : v[c], fill(own[c]));
        store(number[5 + c], wall ? v[c] : relative[c]);
    }
    const vector s = weight ? load(scale) : fill(1.0f);
    const vector x = load(pairs->x + i), y = load(pairs->y + i), z = load(pairs->z + i);
    const vector along =
        add(add(times(x, relative[0]), times(y, relative[1])), times(z, relative[2]));
    store(number[0], s);
    store(number[1], times(x, s));
    store(number[2], times(y, s));
    store(number[3], times(z, s));
    store(number[4], times(minus(fill(0.0f), along), s));
}

/* A lane for each bump: those that a pair does not reach add 0. */
static void moments(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k,
                    const float *feature, size_t a, const float own[3], int wall, size_t dimension,
                    const float *weight, size_t stride, const float *drift, size_t bumps,
                    float *sum)
{
    static const float lanes[LANES] = {0.0f, 1.0f, 2.0f, 3.0f, 4.0f, 5.0f, 6.0f, 7.0f};
    const vector bump = load(lanes), count = fill((float)bumps);
    vector sums[LANES];
    for (size_t c = 0; c < LANES; c++)
        sums[c] = fill(0.0f);
    for (size_t i = 0; i < k; i += LANES) {
        const size_t n = k - i < LANES ? k - i : LANES;
        float number[LANES][LANES];
        pair_numbers(pairs, i, neighbor, n, feature, a, own, wall, dimension, weight, stride, drift,
                     number);
        UNROLL for (size_t l = 0; l < n; l++)
        {
            const vector w = bump_at(fill(pairs->distance[i + l]), count, bump);
            for (size_t c = 0; c < LANES; c++)
                sums[c] = fused(w, fill(number[c][l]), sums[c]);
        }
    }
    transpose_lanes(sums);
    for (size_t b = 0; b < bumps; b++)
        store(sum + b * LANES, sums[b]);
}

/* out[rows][vectors * 8] += in * weight with all sums in registers. */
#define TILE(name, rows, vectors)                                                                  \
    static void name(const float *RESTRICT in, size_t in_stride, size_t a,                         \
                     const float *RESTRICT weight, size_t b, float *RESTRICT out,                  \
                     size_t out_stride)                                                            \
    {                                                                                              \
        vector sum[rows][vectors];                                                                 \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                sum[r][c] = load(out + r * out_stride + c * LANES);                                \
        UNROLL for (size_t i = 0; i < a; i++)                                                      \
        {                                                                                          \
            vector w[vectors];                                                                     \
            for (size_t c = 0; c < vectors; c++)                                                   \
                w[c] = load(weight + i * b + c * LANES);                                           \
            for (size_t r = 0; r < rows; r++) {                                                    \
                const vector value = fill(in[r * in_stride + i]);                                  \
                for (size_t c = 0; c < vectors; c++)                                               \
                    sum[r][c] = fused(value, w[c], sum[r][c]);                                     \
            }                                                                                      \
        }                                                                                          \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                store(out + r * out_stride + c * LANES, sum[r][c]);                                \
    }
TILE(tile_6_2, 6, 2)
TILE(tile_4_2, 4, 2)
TILE(tile_1_2, 1, 2)
TILE(tile_8_1, 8, 1)
TILE(tile_4_1, 4, 1)
TILE(tile_1_1, 1, 1)

/* Inputs that are multiplied in one go, so that their weights and columns stay in the first cache. */
#define DEPTH 128

/* The sums of a stretch of inputs go on where those before it ended. */
static void multiply_stretch(const float *in, size_t in_stride, size_t n, size_t a,
                             const float *weight, size_t b, float *out, size_t out_stride)
{
    size_t c = 0;
#ifdef MULTIPLY_FIRST /* a variant may take the first columns with tiles of its own */
    c = MULTIPLY_FIRST(in, in_stride, n, a, weight, b, out, out_stride);
#endif
#define ROWS(tile, rows)                                                                           \
    for (; r + rows <= n; r += rows)                                                               \
        tile(in + r * in_stride, in_stride, a, weight + c, b, out + r * out_stride + c, out_stride);
    for (; c + 2 * LANES <= b; c += 2 * LANES) {
        size_t r = 0;
        ROWS(tile_6_2, 6)
        ROWS(tile_4_2, 4)
        ROWS(tile_1_2, 1)
    }
    if (c < b) {
        size_t r = 0;
        ROWS(tile_8_1, 8)
        ROWS(tile_4_1, 4)
        ROWS(tile_1_1, 1)
    }
#undef ROWS
}

static void multiply(const float *in, size_t in_stride, size_t n, size_t a, const float *weight,
                     size_t b, float *out, size_t out_stride)
{
    for (size_t i = 0; i < a; i += DEPTH) {
        const size_t depth = a - i < DEPTH ? a - i : DEPTH;
        multiply_stretch(in + i, in_stride, n, depth, weight + i * b, b, out, out_stride);
    }
}

/* TILE over blocks of inputs. */
#define BLOCKS(name, rows, vectors)                                                                \
    static void name(const float *const *in, size_t blocks, size_t a,                              \
                     const float *RESTRICT weight, size_t b, float *RESTRICT out,                  \
                     size_t out_stride)                                                            \
    {                                                                                              \
        vector sum[rows][vectors];                                                                 \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                sum[r][c] = load(out + r * out_stride + c * LANES);                                \
        for (size_t k = 0; k < blocks; k++) {                                                      \
            const float *from[rows];                                                               \
            for (size_t r = 0; r < rows; r++)                                                      \
                from[r] = in[r * blocks + k];                                                      \
            for (size_t i = 0; i < a; i++, weight += b) {                                          \
                vector w[vectors];                                                                 \
                for (size_t c = 0; c < vectors; c++)                                               \
                    w[c] = load(weight + c * LANES);                                               \
                for (size_t r = 0; r < rows; r++) {                                                \
                    const vector value = fill(from[r][i]);                                         \
                    for (size_t c = 0; c < vectors; c++)                                           \
                        sum[r][c] = fused(value, w[c], sum[r][c]);                                 \
                }                                                                                  \
            }                                                                                      \
        }                                                                                          \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < vectors; c++)                                                   \
                store(out + r * out_stride + c * LANES, sum[r][c]);                                \
    }
BLOCKS(blocks_4_2, 4, 2)
BLOCKS(blocks_1_2, 1, 2)
BLOCKS(blocks_6_1, 6, 1)
BLOCKS(blocks_1_1, 1, 1)

static void multiply_blocks(const float *const *in, size_t blocks, size_t n, size_t a,
                            const float *weight, size_t b, float *out, size_t out_stride)
{
    size_t c = 0;
#ifdef MULTIPLY_BLOCKS_FIRST
    c = MULTIPLY_BLOCKS_FIRST(in, blocks, n, a, weight, b, out, out_stride);
#endif
#define ROWS(tile, rows)                                                                           \
    for (; r + rows <= n; r += rows)                                                               \
        tile(in + r * blocks, blocks, a, weight + c, b, out + r * out_stride + c, out_stride);
    for (; c + 2 * LANES <= b; c += 2 * LANES) {
        size_t r = 0;
        ROWS(blocks_4_2, 4)
        ROWS(blocks_1_2, 1)
    }
    if (c < b) {
        size_t r = 0;
        ROWS(blocks_6_1, 6)
        ROWS(blocks_1_1, 1)
    }
#undef ROWS
}

/* out[outputs] of one pair: a kernel between `count` corners, times both sides' features. */
#define PAIR(name, outputs, count)                                                                 \
    static inline void name(const float *RESTRICT share, const size_t *RESTRICT offset,            \
                            const float *RESTRICT center, const float *RESTRICT f, size_t a,       \
                            const float *RESTRICT weight, float *RESTRICT out)                     \
    {                                                                                              \
        vector s[count], sum[outputs];                                                             \
        for (size_t c = 0; c < count; c++)                                                         \
            s[c] = fill(share[c * LANES]);                                                         \
        for (size_t o = 0; o < outputs; o++)                                                       \
            sum[o] = fill(0.0f);                                                                   \
        for (size_t j = 0; j < a; j += LANES) {                                                    \
            const vector both = add(load(center + j), load(f + j));                                \
            for (size_t o = 0; o < outputs; o++) {                                                 \
                const float *w = weight + o * a + j;                                               \
                vector g = times(s[0], load(w));                                                   \
                for (size_t c = 1; c < count; c++)                                                 \
                    g = fused(s[c], load(w + offset[c]), g);                                       \
                sum[o] = fused(both, g, sum[o]);                                                   \
            }                                                                                      \
        }                                                                                          \
        store_totals(out, sum[0], sum[1], outputs > 2 ? sum[outputs - 1] : fill(0.0f));            \
    }
PAIR(pair_3_8, 3, 8)
PAIR(pair_2_4, 2, 4)

/* The same for flat kernels in space and others that are seldom. */
static void pair_any(const float *share, const size_t *offset, int count, const float *center,
                     const float *f, size_t a, const float *weight, size_t outputs, float *out)
{
    for (size_t o = 0; o < 4; o++) {
        vector sum = fill(0.0f);
        for (size_t j = 0; o < outputs && j < a; j += LANES) {
            const float *w = weight + o * a + j;
            vector g = times(fill(share[0]), load(w));
            for (int c = 1; c < count; c++)
                g = fused(fill(share[c * LANES]), load(w + offset[c]), g);
            sum = fused(add(load(center + j), load(f + j)), g, sum);
        }
        out[o] = total(sum);
    }
}

static void pair_terms(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor,
                       size_t k, const float *center, const float *feature, size_t a,
                       const int32_t cells[3], const float *weight, size_t b, float *out)
{
    size_t offset[8];
    const int count = corner_offsets(cells, offset);
    for (int c = 0; c < count; c++)
        offset[c] *= a * b;
    for (size_t i = 0; i < k; i += LANES) {
        const size_t n = k - i < LANES ? k - i : LANES;
        corners at;
        find_corners(pairs->x + i, pairs->y + i, pairs->z + i, window ? window + i : NULL, cells,
                     &at);
        for (size_t l = 0; l < n; l++) {
            const float *f = feature + (size_t)neighbor[i + l] * a, *share = at.weight[0] + l;
            const float *base = weight + (size_t)at.cell[l] * a * b;
            float *to = out + (i + l) * 4;
            if (b == 3 && count == 8)
                pair_3_8(share, offset, center, f, a, base, to);
            else if (b == 2 && count == 4)
                pair_2_4(share, offset, center, f, a, base, to);
            else
                pair_any(share, offset, count, center, f, a, base, b, to);
        }
    }
}

/* ---- Pairs along lines ---- */

/* Strengths and dampings of eight pairs at these distances over the radius: of all bumps only two that lie next
 * to each other are not 0. */
static inline void find_strengths(const ascc_lines *l, float own[2][LANES],
                                  const uint32_t *neighbor, const float *rho, float *strength,
                                  float *damping)
{
    const vector one = fill(1.0f), zero = fill(0.0f);
    const vector t = times(fill((float)l->bumps), load(rho));
    const vector low = whole(smaller(t, fill(l->bumps > 1 ? (float)(l->bumps - 2) : 0.0f)));
    const vector f = minus(t, low), g = minus(t, add(low, one));
    const vector u = larger(minus(one, times(f, f)), zero);
    const vector v = larger(minus(one, times(g, g)), zero);
    int32_t first[LANES], second[LANES];
    vector both[4] = {zero, zero, zero, zero};
    store_whole(first, low);
    store_whole(second, add(low, one));
    if (l->both) {
        const float *from[LANES];
        for (size_t i = 0; i < LANES; i++)
            from[i] = l->coefficient + (size_t)neighbor[i] * 16 + (size_t)first[i] * 2;
        load_quads(from, both);
    }
    const vector s = add(times(times(u, u), add(pick_lanes(own[0], first), both[0])),
                         times(times(v, v), add(pick_lanes(own[0], second), both[2])));
    const vector d = add(times(times(u, u), add(pick_lanes(own[1], first), both[1])),
                         times(times(v, v), add(pick_lanes(own[1], second), both[3])));
    store(strength, s);
    store(damping, d);
}

/* Displacements of n pairs as the network sees them, and their distances over the radius. */
static void find_displacements(const ascc_lines *l, size_t row, const uint32_t *RESTRICT neighbor,
                               size_t n, double d[3][ASCC_PAIR_BATCH], float *RESTRICT rho)
{
    int32_t at[3][ASCC_PAIR_BATCH];
    const float inverse = l->inverse_radius;
    for (size_t i = 0; i < n; i += LANES) {
        const float *from[LANES];
        vector v[4];
        for (size_t j = 0; j < LANES; j++)
            from[j] = integers(l->neighbor + (size_t)neighbor[i + j] * 4);
        load_quads(from, v);
        for (size_t c = 0; c < 3; c++)
            store_more(at[c] + i, v[c], l->row[row * 4 + c]);
    }
    for (size_t i = 0; i < n; i++) {
        const float dx = (float)at[0][i] * inverse;
        const float dy = (float)at[1][i] * inverse;
        const float dz = (float)at[2][i] * inverse;
        rho[i] = sqrtf(dx * dx + dy * dy + dz * dz);
    }
    for (size_t c = 0; c < 3; c++)
        for (size_t i = 0; i < n; i++)
            d[c][i] = (double)at[c][i];
}

/* Lines from a row's place to those of n neighbours. */
static void find_lines(const double *place, size_t row, const uint32_t *neighbor, size_t n,
                       double line[3][ASCC_PAIR_BATCH])
{
    const double *here = place + row * 3;
    for (size_t i = 0; i < n; i++) {
        const double *there = place + (size_t)neighbor[i] * 3;
        for (size_t c = 0; c < 3; c++)
            line[c][i] = there[c] - here[c];
    }
}

/* Strengths times the cosine between what the network sees, d, and the lines between the places, which d
 * becomes. */
static void turn_lines(const ascc_lines *l, size_t row, const uint32_t *neighbor, size_t n,
                       double d[3][ASCC_PAIR_BATCH], float *strength)
{
    double line[3][ASCC_PAIR_BATCH];
    find_lines(l->place, row, neighbor, n, line);
    for (size_t i = 0; i < n; i++) {
        const double x = line[0][i], y = line[1][i], z = line[2][i];
        const double seen = d[0][i] * d[0][i] + d[1][i] * d[1][i] + d[2][i] * d[2][i];
        const double along = x * d[0][i] + y * d[1][i] + z * d[2][i];
        const double lengths = sqrt(seen * (x * x + y * y + z * z));
        strength[i] *= lengths > 0.0 ? (float)(along / lengths) : 0.0f;
    }
    for (size_t c = 0; c < 3; c++)
        memcpy(d[c], line[c], n * sizeof line[c][0]);
}

/* Speeds of approach of n pairs times the length of their line d. */
static void find_approach(const ascc_lines *l, size_t row, const uint32_t *neighbor, size_t n,
                          double d[3][ASCC_PAIR_BATCH], double *RESTRICT approach)
{
    float v[3][ASCC_PAIR_BATCH];
    double own[3] = {0.0, 0.0, 0.0};
    for (size_t c = 0; c < l->dimension; c++)
        own[c] = (double)l->motion[row * l->a + c];
    for (size_t i = 0; i < n; i += LANES) {
        const float *from[LANES];
        vector four[4] = {fill(0.0f), fill(0.0f), fill(0.0f), fill(0.0f)};
        for (size_t j = 0; j < LANES; j++)
            from[j] = l->both ? l->motion + (size_t)neighbor[i + j] * l->a
                              : (l->drift ? l->drift + (size_t)neighbor[i + j] * 4 : NULL);
        if (l->both || l->drift)
            load_quads(from, four);
        store(v[0] + i, four[0]);
        store(v[1] + i, four[1]);
        store(v[2] + i, l->dimension > 2 ? four[2] : fill(0.0f));
    }
    for (size_t i = 0; i < n; i++)
        approach[i] = (own[0] - (double)v[0][i]) * d[0][i] + (own[1] - (double)v[1][i]) * d[1][i] +
                      (own[2] - (double)v[2][i]) * d[2][i];
}

static void pair_lines(const ascc_lines *l, size_t row, const float coefficient[16],
                       const uint32_t *neighbor, size_t k, const double *mass, size_t mass_step,
                       double impulse[3][ASCC_PAIR_BATCH])
{
    float rho[ASCC_PAIR_BATCH], strength[ASCC_PAIR_BATCH], damping[ASCC_PAIR_BATCH], own[2][LANES];
    double approach[ASCC_PAIR_BATCH], masses[ASCC_PAIR_BATCH];
    uint32_t near[ASCC_PAIR_BATCH];
    const size_t n = (k + LANES - 1) / LANES * LANES;
    const double limit = l->limit, factor = l->factor;
    double *RESTRICT x = impulse[0], *RESTRICT y = impulse[1], *RESTRICT z = impulse[2];
    for (size_t i = 0; i < n; i++) {
        near[i] = neighbor[i < k ? i : 0];
        masses[i] = mass[i < k ? i * mass_step : 0];
    }
    for (size_t i = 0; i < LANES; i++) {
        own[0][i] = coefficient[2 * i];
        own[1][i] = coefficient[2 * i + 1];
    }
    find_displacements(l, row, near, n, impulse, rho);
    for (size_t i = 0; i < n; i += LANES)
        find_strengths(l, own, near + i, rho + i, strength + i, damping + i);
    for (size_t i = 0; l->area && i < n; i++) {
        const float area = l->area[near[i] * l->area_stride];
        strength[i] *= area;
        damping[i] *= area;
    }
    if (l->place)
        turn_lines(l, row, near, n, impulse, strength);
    if (l->motion)
        find_approach(l, row, near, n, impulse, approach);
    else
        memset(approach, 0, n * sizeof *approach);
    for (size_t i = 0; i < n; i++) {
        const double length = sqrt(x[i] * x[i] + y[i] * y[i] + z[i] * z[i]);
        const double inverse = length > 0.0 ? 1.0 / length : 0.0;
        double s = (double)strength[i] - (double)damping[i] * (approach[i] * inverse);
        s = s > limit ? limit : s < -limit ? -limit : s;
        const double share = length > 0.0 ? s * factor * inverse : 0.0;
        x[i] = x[i] * share * masses[i];
        y[i] = y[i] * share * masses[i];
        z[i] = z[i] * share * masses[i];
    }
}

/* ---- Impulses to integers ---- */

/* Rounds |x| < 2^51 to the nearest integer, ties to even, in any build: the low bits of x + this. */
#define ROUND_MAGIC 6755399441055744.0

/* What was given so far: to the row, and whether all of it could be held. Four doubles, and four integers, are
 * one value. */
#if defined(ASCC_USE_AVX2)
typedef __m256d quad;

typedef struct given {
    __m256i ours, wrong;
    __m256d good, limit;
} given;

static inline quad times_quads(quad a, quad b)
{
    return _mm256_mul_pd(a, b);
}

static inline quad load_quad(const double *p)
{
    return _mm256_loadu_pd(p);
}

static inline quad quad_of_floats(const float *p)
{
    return _mm256_cvtps_pd(_mm_loadu_ps(p));
}

static inline given begin_given(const int64_t own[4], double limit)
{
    return (given){_mm256_loadu_si256((const __m256i *)own), _mm256_setzero_si256(),
                   _mm256_castsi256_pd(_mm256_set1_epi64x(-1)), _mm256_set1_pd(limit)};
}

/* The integers nearest to x to the row, and from the neighbour's sums. */
static inline void give(given *g, quad x, int64_t *sum)
{
    const __m256d magic = _mm256_set1_pd(ROUND_MAGIC), sign = _mm256_set1_pd(-0.0);
    __m256i *to = (__m256i *)sum;
    const __m256i quanta =
        _mm256_sub_epi64(_mm256_castpd_si256(_mm256_add_pd(x, magic)), _mm256_castpd_si256(magic));
    const __m256i before = _mm256_loadu_si256(to), after = _mm256_sub_epi64(before, quanta);
    const __m256i sums = _mm256_add_epi64(g->ours, quanta);
    g->wrong = _mm256_or_si256(g->wrong, _mm256_and_si256(_mm256_xor_si256(before, quanta),
                                                          _mm256_xor_si256(before, after)));
    g->wrong = _mm256_or_si256(g->wrong, _mm256_and_si256(_mm256_xor_si256(g->ours, sums),
                                                          _mm256_xor_si256(quanta, sums)));
    g->good =
        _mm256_and_pd(g->good, _mm256_cmp_pd(_mm256_andnot_pd(sign, x), g->limit, _CMP_LT_OQ));
    _mm256_storeu_si256(to, after);
    g->ours = sums;
}

static inline int end_given(const given *g, int64_t own[4])
{
    _mm256_storeu_si256((__m256i *)own, g->ours);
    return _mm256_movemask_pd(_mm256_castsi256_pd(g->wrong)) == 0 &&
           _mm256_movemask_pd(g->good) == 15;
}

/* x, y, z of four pairs become four rows of x, y, z, 0. */
static inline void rows_of_quads(const double *x, const double *y, const double *z, quad to[4])
{
    const quad a = load_quad(x), b = load_quad(y), c = load_quad(z), zero = _mm256_setzero_pd();
    const quad ab0 = _mm256_unpacklo_pd(a, b), ab1 = _mm256_unpackhi_pd(a, b);
    const quad c0 = _mm256_unpacklo_pd(c, zero), c1 = _mm256_unpackhi_pd(c, zero);
    to[0] = _mm256_permute2f128_pd(ab0, c0, 0x20);
    to[1] = _mm256_permute2f128_pd(ab1, c1, 0x20);
    to[2] = _mm256_permute2f128_pd(ab0, c0, 0x31);
    to[3] = _mm256_permute2f128_pd(ab1, c1, 0x31);
}
#else
typedef struct quad {
    double lane[4];
} quad;

typedef struct given {
    uint64_t ours[4], wrong;
    double limit;
    int good;
} given;

static inline quad times_quads(quad a, quad b)
{
    for (int i = 0; i < 4; i++)
        a.lane[i] *= b.lane[i];
    return a;
}

static inline quad load_quad(const double *p)
{
    return (quad){{p[0], p[1], p[2], p[3]}};
}

static inline quad quad_of_floats(const float *p)
{
    return (quad){{(double)p[0], (double)p[1], (double)p[2], (double)p[3]}};
}

static inline given begin_given(const int64_t own[4], double limit)
{
    given g = {.limit = limit, .good = 1};
    memcpy(g.ours, own, sizeof g.ours);
    return g;
}

static inline void give(given *g, quad x, int64_t *sum)
{
    const double magic = ROUND_MAGIC;
    uint64_t zero;
    memcpy(&zero, &magic, sizeof zero);
    for (size_t c = 0; c < 4; c++) {
        const double shifted = x.lane[c] + magic;
        uint64_t quanta, before;
        memcpy(&quanta, &shifted, sizeof quanta);
        quanta -= zero;
        memcpy(&before, sum + c, sizeof before);
        const uint64_t after = before - quanta, ours = g->ours[c] + quanta;
        g->wrong |= (before ^ quanta) & (before ^ after);
        g->wrong |= (g->ours[c] ^ ours) & (quanta ^ ours);
        memcpy(sum + c, &after, sizeof after);
        g->ours[c] = ours;
        g->good &= fabs(x.lane[c]) < g->limit;
    }
}

static inline int end_given(const given *g, int64_t own[4])
{
    memcpy(own, g->ours, sizeof g->ours);
    return g->good && !(g->wrong >> 63);
}

static inline void rows_of_quads(const double *x, const double *y, const double *z, quad to[4])
{
    for (int i = 0; i < 4; i++)
        to[i] = (quad){{x[i], y[i], z[i], 0.0}};
}
#endif

static int pair_impulses(const float *term, const double factor[4], const double *mass,
                         size_t mass_step, double limit, const uint32_t *neighbor, size_t k,
                         int64_t own[4], int64_t *sum)
{
    const quad factors = load_quad(factor);
    given g = begin_given(own, limit);
    for (size_t j = 0; j < k; j++, mass += mass_step) {
        const double m[4] = {*mass, *mass, *mass, *mass};
        give(&g, times_quads(times_quads(quad_of_floats(term + j * 4), factors), load_quad(m)),
             sum + (size_t)neighbor[j] * 4);
    }
    return end_given(&g, own);
}

static int add_impulses(double impulse[3][ASCC_PAIR_BATCH], double limit, const uint32_t *neighbor,
                        size_t k, int64_t own[4], int64_t *sum)
{
    given g = begin_given(own, limit);
    for (size_t j = 0; j < k; j += 4) {
        quad rows[4];
        rows_of_quads(impulse[0] + j, impulse[1] + j, impulse[2] + j, rows);
        for (size_t i = 0; i < 4 && j + i < k; i++)
            give(&g, rows[i], sum + (size_t)neighbor[j + i] * 4);
    }
    return end_given(&g, own);
}

/* ---- Relaxation ---- */

static void spline(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k, float volume,
                   const float *volumes, float sum[8])
{
    const vector zero = fill(0.0f), one = fill(1.0f), half = fill(0.5f);
    vector value_sum = zero, x_sum = zero, y_sum = zero, z_sum = zero, square_sum = zero;
    for (size_t i = k; i % LANES; i++) {
        pairs->x[i] = pairs->y[i] = pairs->z[i] = 0.0f;
        pairs->distance[i] = 1.0f;
    }
    for (size_t i = 0; i < k; i += LANES) {
        vector amount = fill(volume);
        if (volumes && k - i >= LANES) {
            amount = gather_lanes(volumes, neighbor + i);
        } else if (volumes) {
            float lane[LANES] = {0};
            for (size_t l = 0; l < k - i; l++)
                lane[l] = volumes[neighbor[i + l]];
            amount = load(lane);
        }
        const vector q = load(pairs->distance + i);
        const vector far = larger(minus(one, q), zero), near = larger(minus(half, q), zero);
        const vector far2 = times(far, far), near2 = times(fill(4.0f), times(near, near));
        const vector value =
            times(times(fill(2.0f), amount), minus(times(far2, far), times(near2, near)));
        const vector slope = times(times(fill(6.0f), amount), minus(far2, near2));
        const vector x = times(slope, load(pairs->x + i)), y = times(slope, load(pairs->y + i));
        const vector z = times(slope, load(pairs->z + i));
        store(pairs->distance + i, value);
        store(pairs->x + i, x);
        store(pairs->y + i, y);
        store(pairs->z + i, z);
        value_sum = add(value_sum, value);
        x_sum = add(x_sum, x);
        y_sum = add(y_sum, y);
        z_sum = add(z_sum, z);
        square_sum = fused(x, x, fused(y, y, fused(z, z, square_sum)));
    }
    store_totals(sum, value_sum, x_sum, y_sum);
    store_totals(sum + 3, z_sum, square_sum, zero);
    sum[7] = 0.0f;
}

static size_t keep_gradients(const ascc_pairs *pairs, const uint32_t *neighbor, size_t k,
                             uint32_t row, uint32_t *to, float *const g[3])
{
    size_t count = 0;
    for (size_t i = 0; i < k; i += LANES) {
        const vector x = load(pairs->x + i), y = load(pairs->y + i), z = load(pairs->z + i);
        const unsigned there = k - i < LANES ? (1u << (k - i)) - 1 : 255u;
        const kept lanes = kept_lanes(not_zero(x, y, z) & there);
        uint32_t last[LANES];
        const uint32_t *from = neighbor + i;
        if (k - i < LANES) {
            memcpy(last, from, (k - i) * sizeof *from);
            memset(last + (k - i), 0, (LANES - (k - i)) * sizeof *last);
            from = last;
        }
        store_kept_integers(to + count, from, lanes);
        store_kept(g[0] + count, x, lanes);
        store_kept(g[1] + count, y, lanes);
        store_kept(g[2] + count, z, lanes);
        count += lanes.count;
    }
    for (; count % LANES; count++) {
        to[count] = row;
        g[0][count] = g[1][count] = g[2][count] = 0.0f;
    }
    return count;
}

static void push(const ascc_gradients *pairs, size_t begin, size_t end, const float *pressure,
                 float *const own[3], float *move)
{
    for (size_t i = begin; i < end; i++) {
        vector x = fill(0.0f), y = x, z = x;
        for (size_t k = pairs->start[i]; k < pairs->end[i]; k += LANES) {
            vector p = gather_lanes(pressure, pairs->neighbor + k);
            if (pairs->weight)
                p = times(p, load(pairs->weight + k));
            x = fused(p, load(pairs->g[0] + k), x);
            y = fused(p, load(pairs->g[1] + k), y);
            z = fused(p, load(pairs->g[2] + k), z);
        }
        float sum[4];
        store_totals(sum, x, y, z);
        for (size_t c = 0; c < 3; c++)
            move[i * 4 + c] = -(pressure[i] * own[c][i] + sum[c]);
        move[i * 4 + 3] = 0.0f;
    }
}

static void divergence(const ascc_gradients *pairs, size_t begin, size_t end, float *const own[3],
                       const float *move, float *change)
{
    for (size_t i = begin; i < end; i++) {
        vector sum = fill(0.0f);
        for (size_t k = pairs->start[i]; k < pairs->end[i]; k += LANES) {
            const float *from[LANES];
            vector v[4];
            for (size_t l = 0; l < LANES; l++)
                from[l] = move + (size_t)pairs->neighbor[k + l] * 4;
            load_quads(from, v);
            for (size_t c = 0; c < 3; c++)
                sum = fused(load(pairs->g[c] + k), v[c], sum);
        }
        const float *m = move + i * 4;
        change[i] = own[0][i] * m[0] + own[1][i] * m[1] + own[2][i] * m[2] - total(sum);
    }
}

/* Turned to lie along the lines between the places: no torque about these. */
static void turn_terms(const double *place, size_t row, const uint32_t *neighbor, size_t k,
                       float term[3][ASCC_PAIR_BATCH + LANES])
{
    double line[3][ASCC_PAIR_BATCH];
    find_lines(place, row, neighbor, k, line);
    for (size_t i = 0; i < k; i++) {
        const double x = line[0][i], y = line[1][i], z = line[2][i];
        const double along =
            x * (double)term[0][i] + y * (double)term[1][i] + z * (double)term[2][i];
        const double square = x * x + y * y + z * z;
        const double share = square > 0.0 ? along / square : 0.0;
        term[0][i] = (float)(share * x);
        term[1][i] = (float)(share * y);
        term[2][i] = (float)(share * z);
    }
}

/* Gradients of k pairs become what their pressures make of them. */
static void press(const ascc_pressures *p, size_t row, const uint32_t *neighbor, size_t k,
                  float g[3][ASCC_PAIR_BATCH + LANES])
{
    float *RESTRICT x = g[0], *RESTRICT y = g[1], *RESTRICT z = g[2];
    const float most = p->limit;
    const vector own = fill(p->pressure[row]);
    float both[ASCC_PAIR_BATCH + LANES];
    for (size_t i = 0; i < k; i += LANES)
        store(both + i, minus(fill(0.0f), add(own, gather_lanes(p->pressure, neighbor + i))));
    for (size_t i = 0; i < k; i++) {
        const float tx = both[i] * x[i], ty = both[i] * y[i], tz = both[i] * z[i];
        const float size = tx * tx + ty * ty + tz * tz;
        const float share = size > most * most ? most / sqrtf(size) : 1.0f;
        x[i] = tx * share;
        y[i] = ty * share;
        z[i] = tz * share;
    }
    if (p->place)
        turn_terms(p->place, row, neighbor, k, g);
}

static int pressure_impulses(const ascc_gradients *pairs, const ascc_pressures *p, size_t row,
                             double limit, int64_t *sum)
{
    int good = 1;
    for (size_t k = pairs->start[row]; k < pairs->end[row]; k += ASCC_PAIR_BATCH) {
        const size_t stop =
            pairs->end[row] - k < ASCC_PAIR_BATCH ? pairs->end[row] : k + ASCC_PAIR_BATCH;
        uint32_t near[ASCC_PAIR_BATCH + LANES];
        float g[3][ASCC_PAIR_BATCH + LANES];
        double impulse[3][ASCC_PAIR_BATCH];
        size_t n = 0;
        for (size_t i = k; i < stop; i += LANES) {
            const kept after = kept_lanes(above(pairs->neighbor + i, (uint32_t)row));
            store_kept_integers(near + n, pairs->neighbor + i, after);
            for (size_t c = 0; c < 3; c++)
                store_kept(g[c] + n, load(pairs->g[c] + i), after);
            n += after.count;
        }
        for (size_t i = n; i % LANES; i++)
            near[i] = (uint32_t)row;
        press(p, row, near, n, g);
        const double a = p->mass[p->uniform ? 0 : row];
        for (size_t c = 0; c < 3; c++)
            for (size_t i = 0; i < n; i++)
                impulse[c][i] = (double)g[c][i] * p->factor * a;
        for (size_t i = 0; !p->uniform && i < n; i++) {
            const double b = p->mass[near[i]], mass = a == b ? a : 2.0 * (a * b) / (a + b);
            for (size_t c = 0; c < 3; c++)
                impulse[c][i] = (double)g[c][i] * p->factor * mass;
        }
        good &= add_impulses(impulse, limit, near, n, sum + row * 4, sum);
    }
    return good;
}

/* Differences between a row and eight of its pairs; v: these. */
static inline void differences(const ascc_gradients *pairs, size_t k, const float *row,
                               const float *move, vector v[4], vector difference[3])
{
    const float *from[LANES];
    for (size_t l = 0; l < LANES; l++)
        from[l] = move + (size_t)pairs->neighbor[k + l] * 4;
    load_quads(from, v);
    for (size_t c = 0; c < 3; c++)
        difference[c] = minus(fill(row[c]), v[c]);
}

static inline vector weight_of(const ascc_gradients *pairs, size_t k, float own, vector others)
{
    vector square = fill(0.0f);
    for (size_t c = 0; c < 3; c++) {
        const vector g = load(pairs->g[c] + k);
        square = fused(g, g, square);
    }
    return times(square, smaller(fill(own), others));
}

static void roughness(const ascc_gradients *pairs, size_t begin, size_t end, const float *move,
                      float *weigh, float *rough)
{
    for (size_t i = begin; i < end; i++) {
        vector x = fill(0.0f), y = x, z = x, v[4], d[3];
        for (size_t k = pairs->start[i]; k < pairs->end[i]; k += LANES) {
            differences(pairs, k, move + i * 4, move, v, d);
            const vector weight =
                weigh ? weight_of(pairs, k, move[i * 4 + 3], v[3]) : load(pairs->weight + k);
            if (weigh)
                store(weigh + k, weight);
            x = add(x, times(weight, d[0]));
            y = add(y, times(weight, d[1]));
            z = add(z, times(weight, d[2]));
        }
        store_totals(rough + i * 4, x, y, z);
        rough[i * 4 + 3] = 0.0f;
    }
}

static int rough_impulses(const ascc_gradients *pairs, const float *rough, double factor,
                          size_t row, double limit, int64_t *sum)
{
    int good = 1;
    for (size_t k = pairs->start[row]; k < pairs->end[row]; k += ASCC_PAIR_BATCH) {
        const size_t stop =
            pairs->end[row] - k < ASCC_PAIR_BATCH ? pairs->end[row] : k + ASCC_PAIR_BATCH;
        uint32_t near[ASCC_PAIR_BATCH + LANES];
        float term[3][ASCC_PAIR_BATCH + LANES];
        double impulse[3][ASCC_PAIR_BATCH];
        size_t n = 0;
        for (size_t i = k; i < stop; i += LANES) {
            const kept after = kept_lanes(above(pairs->neighbor + i, (uint32_t)row));
            const vector weight = load(pairs->weight + i);
            vector v[4], d[3];
            differences(pairs, i, rough + row * 4, rough, v, d);
            store_kept_integers(near + n, pairs->neighbor + i, after);
            for (size_t c = 0; c < 3; c++)
                store_kept(term[c] + n, times(weight, d[c]), after);
            n += after.count;
        }
        for (size_t c = 0; c < 3; c++)
            for (size_t i = 0; i < n; i++)
                impulse[c][i] = (double)term[c][i] * -factor;
        good &= add_impulses(impulse, limit, near, n, sum + row * 4, sum);
    }
    return good;
}

/* ---- The way back, in training ---- */

/* One pair, `vectors` vectors of its row. */
#define SCATTER(name, vectors)                                                                     \
    static inline void name(const float *factor, size_t stride, size_t bumps, size_t harmonics,    \
                            const float *column, size_t a, float *to)                              \
    {                                                                                              \
        vector sum[vectors];                                                                       \
        for (size_t c = 0; c < vectors; c++)                                                       \
            sum[c] = load(to + c * LANES);                                                         \
        for (size_t b = 0; b < bumps;                                                              \
             b++, factor += harmonics * stride, column += harmonics * a) {                         \
            if (factor[0] == 0.0f)                                                                 \
                continue;                                                                          \
            for (size_t h = 0; h < harmonics; h++) {                                               \
                const vector w = fill(factor[h * stride]);                                         \
                for (size_t c = 0; c < vectors; c++)                                               \
                    sum[c] = fused(w, load(column + h * a + c * LANES), sum[c]);                   \
            }                                                                                      \
        }                                                                                          \
        for (size_t c = 0; c < vectors; c++)                                                       \
            store(to + c * LANES, sum[c]);                                                         \
    }
SCATTER(scatter_1, 1)
SCATTER(scatter_2, 2)
SCATTER(scatter_4, 4)

static void scatter(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                    const uint32_t *neighbor, size_t k, const float *column, size_t a,
                    float *gradient)
{
    for (size_t i = 0; i < k; i++) {
        float *to = gradient + (size_t)neighbor[i] * a;
        size_t c = 0;
        for (; c + 4 * LANES <= a; c += 4 * LANES)
            scatter_4(factor + i, stride, bumps, harmonics, column + c, a, to + c);
        for (; c + 2 * LANES <= a; c += 2 * LANES)
            scatter_2(factor + i, stride, bumps, harmonics, column + c, a, to + c);
        if (c < a)
            scatter_1(factor + i, stride, bumps, harmonics, column + c, a, to + c);
    }
}

static void dot(const float *column, size_t members, const uint32_t *neighbor, size_t k,
                const float *feature, size_t a, float *out, size_t stride)
{
    for (size_t i = 0; i < k; i++) {
        const float *f = feature + (size_t)neighbor[i] * a;
        for (size_t m = 0; m < members; m++) {
            vector sum = fill(0.0f);
            for (size_t c = 0; c < a; c += LANES)
                sum = fused(load(column + m * a + c), load(f + c), sum);
            out[m * stride + i] = total(sum);
        }
    }
}

void ASCC_VARIANT(ascc_kernels *kernels)
{
    kernels->search = SEARCH;
    kernels->search_cube = SEARCH_CUBE;
    kernels->geometry = geometry;
    kernels->directions = directions;
    kernels->gather = gather;
    kernels->basis = basis;
    kernels->gather_basis = gather_basis;
    kernels->pair_lines = pair_lines;
    kernels->moments = moments;
    kernels->multiply = multiply;
    kernels->multiply_blocks = multiply_blocks;
    kernels->pair_terms = pair_terms;
    kernels->pair_impulses = pair_impulses;
    kernels->add_impulses = add_impulses;
    kernels->spline = spline;
    kernels->keep_gradients = keep_gradients;
    kernels->push = push;
    kernels->divergence = divergence;
    kernels->roughness = roughness;
    kernels->rough_impulses = rough_impulses;
    kernels->pressure_impulses = pressure_impulses;
    kernels->scatter = scatter;
    kernels->dot = dot;
}
