/* Worlds for stability scenes. SPDX-License-Identifier: MIT */
#include "world.h"

#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Of wall points, in particle spacings: what the published networks were trained with. */
#define WALL_SPACING 0.64

/* A bench gives up where memory does. */
static double *more(double *array, size_t rows)
{
    double *grown = realloc(array, (rows + 1) * 3 * sizeof *grown);
    if (!grown) {
        fputs("stability: no memory\n", stderr);
        exit(1);
    }
    return grown;
}

static void refer(world *w)
{
    w->scene.wall = w->wall;
    w->scene.normal = w->normal;
    w->scene.first_layer = w->scene.wall_count;
}

world world_empty(int dimension, double spacing)
{
    world w = {.scene = {.dimension = dimension,
                         .threads = 1,
                         .time_step = 0.02,
                         .spacing = spacing,
                         .mass = 1000.0 * pow(spacing, dimension),
                         .rest_density = 1000.0,
                         .gravity = {0.0, -9.81, 0.0}}};
    w.position = more(NULL, 0);
    w.velocity = more(NULL, 0);
    w.wall = more(NULL, 0);
    w.normal = more(NULL, 0);
    refer(&w);
    return w;
}

void world_free(world *w)
{
    free(w->position);
    free(w->velocity);
    free(w->wall);
    free(w->normal);
}

static bool is_flat(const world *w)
{
    return w->scene.dimension == 2;
}

/* A flat world has nothing along z. */
static void put_row(const world *w, double *row, const double from[3])
{
    memcpy(row, from, 3 * sizeof *row);
    row[2] = is_flat(w) ? 0.0 : row[2];
}

void world_add(world *w, const double position[3], const double velocity[3])
{
    const size_t n = w->scene.fluid_count++;
    w->position = more(w->position, n + 1);
    w->velocity = more(w->velocity, n + 1);
    put_row(w, w->position + 3 * n, position);
    put_row(w, w->velocity + 3 * n, velocity);
}

static void add_wall(world *w, const double position[3], const double normal[3])
{
    const size_t n = w->scene.wall_count++;
    w->wall = more(w->wall, n + 1);
    w->normal = more(w->normal, n + 1);
    put_row(w, w->wall + 3 * n, position);
    put_row(w, w->normal + 3 * n, normal);
    refer(w);
}

/* Points a length is cut into; one across a flat world. */
static int points_along(const world *w, int axis, double length)
{
    return is_flat(w) && axis == 2 ? 1 : (int)ceil(length / WALL_SPACING);
}

/* A rectangle from low to high, spacings, its normal along the axis, with this sign. */
static void add_rectangle(world *w, int axis, const double low[3], const double high[3],
                          double sign)
{
    const double s = w->scene.spacing;
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    const double width = high[p] - low[p], height = high[q] - low[q];
    const int m = points_along(w, p, width), n = points_along(w, q, height);
    for (int j = 0; j < m && !(is_flat(w) && axis == 2); j++)
        for (int k = 0; k < n; k++) {
            double x[3], normal[3] = {0.0, 0.0, 0.0};
            x[axis] = low[axis] * s;
            x[p] = (low[p] + (j + 0.5) * width / m) * s;
            x[q] = (low[q] + (k + 0.5) * height / n) * s;
            normal[axis] = sign;
            add_wall(w, x, normal);
        }
}

/* Both sides of the box across an axis. */
static void add_sides(world *w, const double edges[3], int axis)
{
    double low[3] = {0.0, 0.0, 0.0};
    add_rectangle(w, axis, low, edges, 1.0);
    low[axis] = edges[axis];
    add_rectangle(w, axis, low, edges, -1.0);
}

void world_box(world *w, const double edges[3])
{
    for (int axis = 0; axis < 3; axis++)
        add_sides(w, edges, axis);
}

void world_tube(world *w, const double edges[3])
{
    add_sides(w, edges, 1);
    add_sides(w, edges, 2);
}

void world_wedge(world *w, double middle, double half, double height, double depth)
{
    const double s = w->scene.spacing, slope = hypot(half, height);
    const int m = points_along(w, 0, slope), n = points_along(w, 2, depth);
    for (int side = -1; side <= 1; side += 2)
        for (int j = 0; j < m; j++)
            for (int k = 0; k < n; k++) {
                const double down = (j + 0.5) / m;
                const double x[3] = {(middle + side * down * half) * s, (1.0 - down) * height * s,
                                     (k + 0.5) * depth / n * s};
                add_wall(w, x, (double[]){side * height / slope, half / slope, 0.0});
            }
}

/* Fluid within a box, spacings. */
static void take_out(world *w, const double low[3], const double high[3])
{
    const double s = w->scene.spacing;
    size_t kept = 0;
    for (size_t i = 0; i < w->scene.fluid_count; i++) {
        const double *x = w->position + 3 * i;
        bool in = true;
        for (int c = 0; c < w->scene.dimension; c++)
            in = in && x[c] > low[c] * s && x[c] < high[c] * s;
        if (in)
            continue;
        memmove(w->position + 3 * kept, x, 3 * sizeof(double));
        memmove(w->velocity + 3 * kept, w->velocity + 3 * i, 3 * sizeof(double));
        kept++;
    }
    w->scene.fluid_count = kept;
}

#define CLEAR 0.99 /* spacings, around new walls */

static void add_plate(world *w, int axis, const double low[3], const double high[3])
{
    add_rectangle(w, axis, low, high, 1.0);
    add_rectangle(w, axis, low, high, -1.0);
}

void world_cup(world *w, const double low[3], const double high[3])
{
    for (int axis = 0; axis < 3; axis++) {
        double from[3] = {low[0], low[1], low[2]};
        add_plate(w, axis, from, high);
        from[axis] = high[axis];
        if (axis != 1)
            add_plate(w, axis, from, high);
    }
    take_out(w, (double[]){low[0] - CLEAR, low[1] - CLEAR, low[2] - CLEAR},
             (double[]){high[0] + CLEAR, high[1], high[2] + CLEAR});
}

void world_body(world *w, const double center[3], double edge, double inset)
{
    const double s = w->scene.spacing, half = 0.5 * edge - inset;
    const size_t walls = w->scene.wall_count;
    double low[3], high[3];
    for (int c = 0; c < 3; c++) {
        low[c] = center[c] / s - half;
        high[c] = center[c] / s + half;
    }
    for (int axis = 0; axis < 3; axis++) {
        double from[3] = {low[0], low[1], low[2]};
        add_rectangle(w, axis, from, high, -1.0);
        from[axis] = high[axis];
        add_rectangle(w, axis, from, high, 1.0);
    }
    w->scene.body_count = w->scene.wall_count - walls;
    put_row(w, w->scene.body_center, center);
    take_out(w, (double[]){low[0] - CLEAR, low[1] - CLEAR, low[2] - CLEAR},
             (double[]){high[0] + CLEAR, high[1] + CLEAR, high[2] + CLEAR});
}

void world_paddle(world *w, double x, const double low[3], const double high[3])
{
    const size_t walls = w->scene.wall_count;
    add_rectangle(w, 0, (const double[]){x, low[1], low[2]}, (const double[]){x, high[1], high[2]},
                  1.0);
    w->scene.body_count = w->scene.wall_count - walls;
}

void world_all_moves(world *w, const double center[3])
{
    w->scene.body_count = w->scene.wall_count;
    put_row(w, w->scene.body_center, center);
}

/* Turned about an axis of length 1 (Rodrigues). */
static void turn_row(double row[3], const double axis[3], double angle)
{
    const double x[3] = {row[0], row[1], row[2]};
    const double along = axis[0] * x[0] + axis[1] * x[1] + axis[2] * x[2];
    for (int c = 0; c < 3; c++) {
        const int p = (c + 1) % 3, q = (c + 2) % 3;
        row[c] = cos(angle) * x[c] + sin(angle) * (axis[p] * x[q] - axis[q] * x[p]) +
                 (1.0 - cos(angle)) * along * axis[c];
    }
}

void world_move_body(world *w, const double velocity[3], const double spin[3], double dt)
{
    double axis[3], *center = w->scene.body_center;
    const double rate = sqrt(spin[0] * spin[0] + spin[1] * spin[1] + spin[2] * spin[2]);
    for (int c = 0; c < 3; c++)
        axis[c] = rate > 0.0 ? spin[c] / rate : 0.0;
    for (size_t i = w->scene.wall_count - w->scene.body_count; i < w->scene.wall_count; i++) {
        double *x = w->wall + 3 * i;
        for (int c = 0; c < 3; c++)
            x[c] -= center[c];
        turn_row(x, axis, rate * dt);
        turn_row(w->normal + 3 * i, axis, rate * dt);
        for (int c = 0; c < 3; c++)
            x[c] += center[c] + dt * velocity[c];
    }
    for (int c = 0; c < 3; c++)
        center[c] += dt * velocity[c];
}

static double *duplicate(const double *array, size_t rows)
{
    double *copy = more(NULL, rows);
    memcpy(copy, array, rows * 3 * sizeof *copy);
    return copy;
}

world world_copy(const world *w)
{
    world copy = *w;
    copy.position = duplicate(w->position, w->scene.fluid_count);
    copy.velocity = duplicate(w->velocity, w->scene.fluid_count);
    copy.wall = duplicate(w->wall, w->scene.wall_count);
    copy.normal = duplicate(w->normal, w->scene.wall_count);
    refer(&copy);
    return copy;
}

void world_block(world *w, const double low[3], const int cells[3], const double velocity[3])
{
    const double s = w->scene.spacing;
    const int deep = is_flat(w) ? 1 : cells[2];
    for (int k = 0; k < deep; k++)
        for (int j = 0; j < cells[1]; j++)
            for (int i = 0; i < cells[0]; i++)
                world_add(w,
                          (double[]){low[0] + (i + 0.5) * s, low[1] + (j + 0.5) * s,
                                     low[2] + (k + 0.5) * s},
                          velocity);
}

world world_tank(int dimension, double spacing, const int cells[3], const double edges[3])
{
    const double corner[3] = {0.5 * spacing, 0.5 * spacing, 0.5 * spacing};
    world w = world_empty(dimension, spacing);
    world_box(&w, edges);
    world_block(&w, corner, cells, (const double[]){0.0, 0.0, 0.0});
    return w;
}

void world_ball(world *w, double radius)
{
    const double s = w->scene.spacing;
    const int n = (int)ceil(radius / s), deep = is_flat(w) ? 0 : n;
    for (int k = -deep; k <= deep; k++)
        for (int j = -n; j <= n; j++)
            for (int i = -n; i <= n; i++)
                if ((i * i + j * j + k * k) * s * s <= radius * radius)
                    world_add(w, (double[]){i * s, j * s, k * s}, (double[]){0.0, 0.0, 0.0});
}

void world_sheet(world *w, double half)
{
    const double step = WALL_SPACING * w->scene.spacing;
    for (double y = -half; y <= half; y += step)
        for (double z = -half; z <= half && (z == -half || !is_flat(w)); z += step)
            add_wall(w, (double[]){0.0, y, z}, (double[]){1.0, 0.0, 0.0});
}

void world_turn(double row[3])
{
    const double x = row[0];
    row[0] = row[1];
    row[1] = row[2];
    row[2] = x;
}

void world_turn_back(double row[3])
{
    const double z = row[2];
    row[2] = row[1];
    row[1] = row[0];
    row[0] = z;
}

void world_swap(double row[3])
{
    const double x = row[0];
    row[0] = row[1];
    row[1] = x;
}

void world_flip(double row[3])
{
    row[1] = -row[1];
}

void world_apply(world *w, world_map *map)
{
    map(w->scene.gravity);
    for (size_t i = 0; i < w->scene.fluid_count; i++) {
        map(w->position + 3 * i);
        map(w->velocity + 3 * i);
    }
    for (size_t i = 0; i < w->scene.wall_count; i++) {
        map(w->wall + 3 * i);
        map(w->normal + 3 * i);
    }
}
