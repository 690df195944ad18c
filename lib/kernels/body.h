/* Every kernel, written once in plain C and compiled for each instruction set.
 * SPDX-License-Identifier: MIT
 *
 * All variants give the same bits because they are this text: only correctly rounded operations, fma
 * exactly where fmaf stands, every sum in the order written here, and no libm transcendental.
 */
#include <math.h>
#include <string.h>

#include "kernels.h"

#define RESTRICT restrict

/* Largest kernel cell position handled in one go by pair_terms: a * b floats. */
#define PAIR_CAPACITY 3072

static size_t search(const ascc_coordinates *points, size_t begin, size_t end, int32_t x, int32_t y,
                     int32_t z, float limit, uint32_t *RESTRICT found)
{
    size_t count = 0;
    const uint32_t ux = (uint32_t)x, uy = (uint32_t)y, uz = (uint32_t)z;
    for (size_t i = begin; i < end; i++) {
        const float dx = (float)(int32_t)((uint32_t)points->x[i] - ux);
        const float dy = (float)(int32_t)((uint32_t)points->y[i] - uy);
        const float dz = (float)(int32_t)((uint32_t)points->z[i] - uz);
        found[count] = (uint32_t)i;
        count += dx * dx + dy * dy + dz * dz <= limit;
    }
    return count;
}

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

/* Volume preserving map of the unit ball to the cube: ball to cylinder, cylinder to cube (SEMANTICS
 * section 2). In place. */
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
        const float s_cap = sqrtf(3.0f * n / (center ? 1.0f : n + az));
        const float s_side = n / (cap | center ? 1.0f : sqrtf(h2));
        const float s = center ? 0.0f : cap ? s_cap : s_side;
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
    if (mapping == 2)
        map_volume(px, py, pz, k);
    else if (mapping == 1)
        map_radial(px, py, pz, k);
}

/* The cells around one kernel position and their weights: 8 of them, or 4 in a flat kernel. */
typedef struct corners {
    size_t cell[8];
    float weight[8];
    int count;
} corners;

/* Lower cell, upper cell and fraction along an axis of `size` cells (align corners). */
static inline void axis_cells(float p, int32_t size, int32_t *low, int32_t *high, float *fraction)
{
    const float c = (p * 0.5f + 0.5f) * (float)(size - 1);
    int32_t i = (int32_t)c;
    i = i < 0 ? 0 : i > size - 1 ? size - 1 : i;
    *low = i;
    *high = i + 1 < size ? i + 1 : i;
    const float t = c - (float)i;
    *fraction = t < 0.0f ? 0.0f : t > 1.0f ? 1.0f : t;
}

static inline void find_corners(float x, float y, float z, const int32_t cells[3], corners *out)
{
    int32_t x0, x1, y0, y1, z0, z1;
    float tx, ty, tz;
    axis_cells(x, cells[0], &x0, &x1, &tx);
    axis_cells(y, cells[1], &y0, &y1, &ty);
    const size_t w = (size_t)cells[0], wh = w * (size_t)cells[1];
    const size_t y0w = (size_t)y0 * w, y1w = (size_t)y1 * w;
    const float sx = 1.0f - tx, sy = 1.0f - ty;
    const size_t plane[4] = {y0w + (size_t)x0, y0w + (size_t)x1, y1w + (size_t)x0,
                             y1w + (size_t)x1};
    const float flat[4] = {sx * sy, tx * sy, sx * ty, tx * ty};
    if (cells[2] == 1) {
        for (int i = 0; i < 4; i++) {
            out->cell[i] = plane[i];
            out->weight[i] = flat[i];
        }
        out->count = 4;
        return;
    }
    axis_cells(z, cells[2], &z0, &z1, &tz);
    const float sz = 1.0f - tz;
    for (int i = 0; i < 4; i++) {
        out->cell[i] = (size_t)z0 * wh + plane[i];
        out->cell[4 + i] = (size_t)z1 * wh + plane[i];
        out->weight[i] = flat[i] * sz;
        out->weight[4 + i] = flat[i] * tz;
    }
    out->count = 8;
}

static void gather(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor, size_t k,
                   const float *feature, size_t a, const int32_t cells[3], float *column)
{
    const size_t cell_count = (size_t)cells[0] * (size_t)cells[1] * (size_t)cells[2];
    memset(column, 0, cell_count * a * sizeof *column);
    for (size_t i = 0; i < k; i++) {
        corners at;
        find_corners(pairs->x[i], pairs->y[i], pairs->z[i], cells, &at);
        const float *RESTRICT f = feature + (size_t)neighbor[i] * a;
        const float scale = window ? window[i] : 1.0f;
        for (int c = 0; c < at.count; c++) {
            const float weight = at.weight[c] * scale;
            float *RESTRICT cell = column + at.cell[c] * a;
            for (size_t j = 0; j < a; j++)
                cell[j] = fmaf(weight, f[j], cell[j]);
        }
    }
}

/* out[rows][columns] += in * weight for a tile held in registers. */
#define TILE_COLUMNS 16
#define TILE(rows, columns)                                                                        \
    static void tile_##rows##_##columns(const float *RESTRICT in, size_t in_stride, size_t a,      \
                                        const float *RESTRICT weight, size_t b,                    \
                                        float *RESTRICT out, size_t out_stride)                    \
    {                                                                                              \
        float sum[rows][columns];                                                                  \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < columns; c++)                                                   \
                sum[r][c] = out[r * out_stride + c];                                               \
        for (size_t i = 0; i < a; i++)                                                             \
            for (size_t r = 0; r < rows; r++) {                                                    \
                const float value = in[r * in_stride + i];                                         \
                for (size_t c = 0; c < columns; c++)                                               \
                    sum[r][c] = fmaf(value, weight[i * b + c], sum[r][c]);                         \
            }                                                                                      \
        for (size_t r = 0; r < rows; r++)                                                          \
            for (size_t c = 0; c < columns; c++)                                                   \
                out[r * out_stride + c] = sum[r][c];                                               \
    }
TILE(4, 16)
TILE(1, 16)
TILE(4, 8)
TILE(1, 8)
TILE(4, 4)
TILE(1, 4)
TILE(1, 1)

static void multiply(const float *in, size_t in_stride, size_t n, size_t a, const float *weight,
                     size_t b, float *out, size_t out_stride)
{
    size_t c = 0;
#define COLUMNS(width)                                                                             \
    for (; c + width <= b; c += width) {                                                           \
        size_t r = 0;                                                                              \
        for (; r + 4 <= n; r += 4)                                                                 \
            tile_4_##width(in + r * in_stride, in_stride, a, weight + c, b,                        \
                           out + r * out_stride + c, out_stride);                                  \
        for (; r < n; r++)                                                                         \
            tile_1_##width(in + r * in_stride, in_stride, a, weight + c, b,                        \
                           out + r * out_stride + c, out_stride);                                  \
    }
    COLUMNS(16)
    COLUMNS(8)
    COLUMNS(4)
#undef COLUMNS
    for (; c < b; c++)
        for (size_t r = 0; r < n; r++)
            tile_1_1(in + r * in_stride, in_stride, a, weight + c, b, out + r * out_stride + c,
                     out_stride);
}

static void pair_terms(const ascc_pairs *pairs, const float *window, const uint32_t *neighbor,
                       size_t k, const float *RESTRICT center, const float *feature, size_t a,
                       const int32_t cells[3], const float *weight, size_t b, float *RESTRICT out)
{
    float kernel[PAIR_CAPACITY];
    const size_t ab = a * b;
    for (size_t i = 0; i < k; i++) {
        corners at;
        find_corners(pairs->x[i], pairs->y[i], pairs->z[i], cells, &at);
        const float *RESTRICT w0 = weight + at.cell[0] * ab;
        for (size_t j = 0; j < ab; j++)
            kernel[j] = at.weight[0] * w0[j];
        for (int c = 1; c < at.count; c++) {
            const float *RESTRICT w = weight + at.cell[c] * ab;
            for (size_t j = 0; j < ab; j++)
                kernel[j] = fmaf(at.weight[c], w[j], kernel[j]);
        }
        const float *RESTRICT f = feature + (size_t)neighbor[i] * a;
        const float scale = window ? window[i] : 1.0f;
        for (size_t o = 0; o < b; o++) {
            float lane[8] = {0};
            const float *RESTRICT g = kernel + o * a;
            for (size_t j = 0; j < a; j += 8)
                for (size_t l = 0; l < 8; l++)
                    lane[l] = fmaf(center[j + l] + f[j + l], g[j + l], lane[l]);
            const float sum = ((lane[0] + lane[4]) + (lane[2] + lane[6])) +
                              ((lane[1] + lane[5]) + (lane[3] + lane[7]));
            out[i * 4 + o] = scale * sum;
        }
    }
}

void ASCC_VARIANT(ascc_kernels *kernels)
{
    kernels->search = search;
    kernels->geometry = geometry;
    kernels->gather = gather;
    kernels->multiply = multiply;
    kernels->pair_terms = pair_terms;
}
