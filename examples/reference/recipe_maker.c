/* What kinds of scenes are made with: chance, bodies of water, rooms. SPDX-License-Identifier: MIT */
#include "recipe_maker.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

const char *const maker_shapes[] = {"box", "ball", "cylinder", "cone", "torus"};

/* ---- Chance: splitmix64, so that a scene is the same everywhere ---- */

uint64_t maker_bits(uint64_t *state)
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

double maker_chance(uint64_t *state, double low, double high)
{
    return low + (high - low) * (double)(maker_bits(state) >> 11) * 0x1p-53;
}

int maker_choose(uint64_t *state, int low, int high) /* both included */
{
    return low + (int)(maker_bits(state) % (uint64_t)(high - low + 1));
}

/* ---- Fluid ---- */

void maker_say(maker *m, const char *format, ...)
{
    const size_t room = sizeof m->r->text - m->text_length;
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(m->r->text + m->text_length, room, format, arguments);
    va_end(arguments);
    m->text_length += n < 0 ? 0 : (size_t)n < room ? (size_t)n : room - 1;
}

static void add_particle(maker *m, const double position[3], const double velocity[3])
{
    recipe *r = m->r;
    const size_t d = (size_t)r->dimension;
    if (r->count == m->capacity) {
        m->capacity = 2 * m->capacity + 1024;
        double *positions = realloc(r->position, m->capacity * d * sizeof(double));
        if (positions)
            r->position = positions;
        double *velocities = realloc(r->velocity, m->capacity * d * sizeof(double));
        if (velocities)
            r->velocity = velocities;
        if (!positions || !velocities) {
            m->out_of_memory = true;
            m->capacity = r->count;
            return;
        }
    }
    memcpy(r->position + r->count * d, position, d * sizeof(double));
    memcpy(r->velocity + r->count * d, velocity, d * sizeof(double));
    r->count++;
}

static bool inside(const body *b, const double p[3], int32_t d)
{
    double local[3] = {0};
    for (int a = 0; a < d; a++)
        for (int c = 0; c < d; c++)
            local[a] += b->axes[a][c] * (p[c] - b->center[c]);
    const double across = hypot(local[0], local[1]), up = local[2];
    switch (b->shape) {
    case SHAPE_BOX:
        for (int c = 0; c < d; c++)
            if (fabs(local[c]) > b->half[c])
                return false;
        return true;
    case SHAPE_CYLINDER:
        return across < 0.7 * b->size && fabs(up) < b->size;
    case SHAPE_CONE:
        return fabs(up) < b->size && across < 0.5 * (b->size - up);
    case SHAPE_TORUS:
        return hypot(across - 0.65 * b->size, up) < 0.35 * b->size;
    case SHAPE_BALL:
        return across * across + up * up < b->size * b->size;
    }
    return false;
}

/* True if a particle of this recipe is closer than 0.9 spacings. */
static bool occupied(const recipe *r, size_t count, const double at[3])
{
    const size_t d = (size_t)r->dimension;
    for (size_t i = 0; i < count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const double e = r->position[i * d + c] - at[c];
            square += e * e;
        }
        if (square < 0.81 * r->spacing * r->spacing)
            return true;
    }
    return false;
}

/* Lattices begin half a spacing from flat walls in layers, and three quarters from obstacles in 2D; a spacing from
 * DFSPH's walls in 3D, which are points on the surface: there water rests 0.9 spacings away. */
void maker_fill(maker *m, const body *b)
{
    recipe *r = m->r;
    const double reach =
        b->shape == SHAPE_BOX ? hypot(hypot(b->half[0], b->half[1]), b->half[2]) : 1.5 * b->size;
    const bool dense = r->dimension == 3 && r->solver == RECIPE_DFSPH;
    const double shift = dense ? 0.0 : 0.5, gap = (dense ? 0.999 : 0.499) * r->spacing;
    const double other = r->dimension == 2 ? 0.75 * r->spacing : gap;
    const size_t before = r->count;
    int low[3] = {0}, high[3] = {0};
    for (int c = 0; c < r->dimension; c++) {
        low[c] = (int)floor((b->center[c] - reach) / r->spacing);
        high[c] = (int)ceil((b->center[c] + reach) / r->spacing);
    }
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++)
            for (int x = low[0]; x <= high[0]; x++) {
                const double at[3] = {(x + shift) * r->spacing, (y + shift) * r->spacing,
                                      r->dimension == 3 ? (z + shift) * r->spacing : 0.0};
                double normal[3] = {0};
                if (!inside(b, at, r->dimension) ||
                    solids_distance(r->solids, r->solid_count > 0, r->dimension, at, normal) <
                        gap ||
                    (r->solid_count > 1 && solids_distance(r->solids + 1, r->solid_count - 1,
                                                           r->dimension, at, normal) < other) ||
                    occupied(r, before, at))
                    continue;
                add_particle(m, at, b->velocity);
            }
}

void maker_straight(body *b)
{
    memset(b->axes, 0, sizeof b->axes);
    for (int c = 0; c < 3; c++)
        b->axes[c][c] = 1.0;
}

/* A random rotation, from a random unit quaternion. */
void maker_tumble(maker *m, body *b)
{
    double q[4], square;
    do {
        square = 0.0;
        for (int k = 0; k < 4; k++) {
            q[k] = maker_chance(&m->state, -1.0, 1.0);
            square += q[k] * q[k];
        }
    } while (square > 1.0 || square < 0.01);
    const double s = 2.0 / square, w = q[0], x = q[1], y = q[2], z = q[3];
    const double axes[3][3] = {{1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
                               {s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)},
                               {s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)}};
    memcpy(b->axes, axes, sizeof axes);
}

/* The speed that water from rest, or with this speed, can reach in the room. */
void maker_speed(recipe *r, double speed, double lowest)
{
    double drop = 0.0;
    for (int c = 0; c < r->dimension && r->solid_count; c++)
        drop += 2.0 * fabs(r->gravity[c]) * 2.0 * r->solids[0].half[c];
    r->speed = fmax(lowest, sqrt(speed * speed + drop));
}

void maker_room(recipe *r, double x, double y, double z)
{
    const double size[3] = {x, y, z};
    r->solids[0] = (solid){.kind = SOLID_ROOM};
    for (int c = 0; c < r->dimension; c++) {
        const double half = 0.5 * rint(size[c] / r->spacing) * r->spacing;
        r->solids[0].center[c] = r->solids[0].half[c] = half;
    }
    r->solid_count = 1;
}

body maker_ball(const recipe *r, double radius, double x, double y)
{
    body b = {.shape = SHAPE_BALL, .size = radius, .center = {x, y, r->dimension == 3 ? x : 0.0}};
    maker_straight(&b);
    return b;
}
