/* The way back of the kernel pair_lines. SPDX-License-Identifier: MIT
 *
 * A pair gives strength - damping * approach along its line u, both linear in the coefficients of its two sides. With
 * f the difference of both sides' gradients, a coefficient of strength has f . u times its bump, one of damping
 * -approach times that. What is cut off at the limit has none.
 */
#include "line_reverse.h"

#include <math.h>

#define WIDTH 16

typedef struct batch {
    size_t count;
    uint32_t neighbor[ASCC_PAIR_BATCH];
    float x[ASCC_PAIR_BATCH], y[ASCC_PAIR_BATCH], z[ASCC_PAIR_BATCH], distance[ASCC_PAIR_BATCH];
} batch;

/* One side of a pair. */
typedef struct side {
    const float *force, *motion, *coefficient;
    float *by_coefficient, *by_motion;
} side;

static const float none[WIDTH];

static side side_of(const ascc_line_reverse *r, size_t i)
{
    const ascc_lines *l = r->lines;
    return (side){.force = r->force + i * 4,
                  .motion = l->motion ? l->motion + i * l->a : none,
                  .coefficient = l->coefficient + i * WIDTH,
                  .by_coefficient = r->coefficient + i * WIDTH,
                  .by_motion = r->motion ? r->motion + i * l->a : NULL};
}

static side wall_side(const ascc_line_reverse *r, size_t j)
{
    return (side){.force = none,
                  .motion = r->lines->drift ? r->lines->drift + j * 4 : none,
                  .coefficient = none};
}

static float dot(const float a[3], const float b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

/* By what the first bump and the next multiply. */
static void add_coefficients(float *to, bool next, const float value[2], float strength,
                             float damping)
{
    to[0] += value[0] * strength;
    to[1] += value[0] * damping;
    if (next) {
        to[2] += value[1] * strength;
        to[3] += value[1] * damping;
    }
}

static inline void pass_pair(const ascc_line_reverse *r, const side *a, const side *b,
                             const float u[3], float distance, float area, bool both)
{
    const ascc_lines *l = r->lines;
    const float x = distance * (float)l->bumps;
    const size_t first = (size_t)x, at = 2 * first;
    const bool next = first + 1 < l->bumps;
    float value[2], force[3], relative[3] = {0.0f, 0.0f, 0.0f};
    if (first >= l->bumps)
        return;
    for (int k = 0; k < 2; k++) {
        const float t = x - (float)(first + (size_t)k), square = 1.0f - t * t;
        value[k] = area * square * square;
    }
    for (int c = 0; c < 3; c++)
        force[c] = a->force[c] - b->force[c];
    for (size_t c = 0; l->motion && c < l->dimension; c++)
        relative[c] = a->motion[c] - b->motion[c];
    const float along = dot(force, u), approach = dot(relative, u);
    float strength = value[0] * (a->coefficient[at] + b->coefficient[at]);
    float damping = value[0] * (a->coefficient[at + 1] + b->coefficient[at + 1]);
    if (next) {
        strength += value[1] * (a->coefficient[at + 2] + b->coefficient[at + 2]);
        damping += value[1] * (a->coefficient[at + 3] + b->coefficient[at + 3]);
    }
    if (fabsf(strength - damping * approach) > l->limit)
        return;
    add_coefficients(a->by_coefficient + at, next, value, along, -approach * along);
    if (both)
        add_coefficients(b->by_coefficient + at, next, value, along, -approach * along);
    for (size_t c = 0; a->by_motion && c < l->dimension; c++) {
        const float by = -damping * along * u[c];
        a->by_motion[c] += by;
        if (both)
            b->by_motion[c] -= by;
    }
}

/* Neighbours of row i from *at on: of its own set those after it. False if none is left. */
static bool next_batch(const ascc_line_reverse *r, size_t i, size_t *at, batch *b)
{
    const ascc_rows *rows = r->rows;
    const uint32_t *neighbor = rows->neighbor + rows->start[i];
    const ascc_pairs pairs = {.x = b->x, .y = b->y, .z = b->z, .distance = b->distance};
    b->count = 0;
    while (*at < rows->count[i] && b->count < ASCC_PAIR_BATCH) {
        const uint32_t j = neighbor[(*at)++];
        b->neighbor[b->count] = j;
        b->count += !r->lines->both || j > i;
    }
    if (b->count)
        r->kernels->directions(r->lines->neighbor, b->neighbor, b->count, r->lines->row + i * 4,
                               r->lines->inverse_radius, &pairs);
    return b->count > 0;
}

void ascc_line_reverse_run(const ascc_line_reverse *r)
{
    const ascc_lines *l = r->lines;
    batch b;
    for (size_t i = 0; i < r->rows->query->count; i++) {
        const side a = side_of(r, i);
        for (size_t at = 0; next_batch(r, i, &at, &b);)
            for (size_t k = 0; k < b.count; k++) {
                const float u[3] = {b.x[k], b.y[k], b.z[k]};
                const size_t j = b.neighbor[k];
                const side other = l->both ? side_of(r, j) : wall_side(r, j);
                const float area = l->area ? l->area[j * l->area_stride] : 1.0f;
                pass_pair(r, &a, &other, u, b.distance[k], area, l->both);
            }
    }
}
