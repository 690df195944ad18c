/* Worlds for stability scenes. SPDX-License-Identifier: MIT */
#include "world.h"

#include <math.h>
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

world world_empty(double spacing)
{
    world w = {.scene = {.dimension = 3,
                         .threads = 1,
                         .time_step = 0.02,
                         .spacing = spacing,
                         .mass = 1000.0 * spacing * spacing * spacing,
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

void world_add(world *w, const double position[3], const double velocity[3])
{
    const size_t n = w->scene.fluid_count++;
    w->position = more(w->position, n + 1);
    w->velocity = more(w->velocity, n + 1);
    memcpy(w->position + 3 * n, position, 3 * sizeof(double));
    memcpy(w->velocity + 3 * n, velocity, 3 * sizeof(double));
}

static void add_wall(world *w, const double position[3], const double normal[3])
{
    const size_t n = w->scene.wall_count++;
    w->wall = more(w->wall, n + 1);
    w->normal = more(w->normal, n + 1);
    memcpy(w->wall + 3 * n, position, 3 * sizeof(double));
    memcpy(w->normal + 3 * n, normal, 3 * sizeof(double));
    refer(w);
}

/* Both sides of the box across an axis. */
static void add_sides(world *w, const double edges[3], int axis)
{
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    const int m = (int)ceil(edges[p] / WALL_SPACING), n = (int)ceil(edges[q] / WALL_SPACING);
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < m; j++)
            for (int k = 0; k < n; k++) {
                double x[3], normal[3] = {0.0, 0.0, 0.0};
                x[axis] = side * edges[axis] * w->scene.spacing;
                x[p] = (j + 0.5) * edges[p] * w->scene.spacing / m;
                x[q] = (k + 0.5) * edges[q] * w->scene.spacing / n;
                normal[axis] = side ? -1.0 : 1.0;
                add_wall(w, x, normal);
            }
}

void world_box(world *w, const int edges[3])
{
    for (int axis = 0; axis < 3; axis++)
        add_sides(w, (double[]){edges[0], edges[1], edges[2]}, axis);
}

void world_tube(world *w, const double edges[3])
{
    add_sides(w, edges, 1);
    add_sides(w, edges, 2);
}

void world_wedge(world *w, double middle, double half, double height, double depth)
{
    const double s = w->scene.spacing, slope = hypot(half, height);
    const int m = (int)ceil(slope / WALL_SPACING), n = (int)ceil(depth / WALL_SPACING);
    for (int side = -1; side <= 1; side += 2)
        for (int j = 0; j < m; j++)
            for (int k = 0; k < n; k++) {
                const double down = (j + 0.5) / m;
                const double x[3] = {(middle + side * down * half) * s, (1.0 - down) * height * s,
                                     (k + 0.5) * depth / n * s};
                add_wall(w, x, (double[]){side * height / slope, half / slope, 0.0});
            }
}

static void take_out(world *w, const double center[3], double half)
{
    size_t kept = 0;
    for (size_t i = 0; i < w->scene.fluid_count; i++) {
        const double *x = w->position + 3 * i;
        if (fabs(x[0] - center[0]) < half && fabs(x[1] - center[1]) < half &&
            fabs(x[2] - center[2]) < half)
            continue;
        memmove(w->position + 3 * kept, x, 3 * sizeof(double));
        memmove(w->velocity + 3 * kept, w->velocity + 3 * i, 3 * sizeof(double));
        kept++;
    }
    w->scene.fluid_count = kept;
}

void world_body(world *w, const double center[3], double edge)
{
    const double s = w->scene.spacing;
    const int m = (int)ceil(edge / WALL_SPACING);
    const size_t walls = w->scene.wall_count;
    for (int axis = 0; axis < 3; axis++)
        for (int side = -1; side <= 1; side += 2)
            for (int j = 0; j < m; j++)
                for (int k = 0; k < m; k++) {
                    double x[3], normal[3] = {0.0, 0.0, 0.0};
                    x[axis] = center[axis] + 0.5 * side * edge * s;
                    x[(axis + 1) % 3] = center[(axis + 1) % 3] + ((j + 0.5) / m - 0.5) * edge * s;
                    x[(axis + 2) % 3] = center[(axis + 2) % 3] + ((k + 0.5) / m - 0.5) * edge * s;
                    normal[axis] = side;
                    add_wall(w, x, normal);
                }
    w->scene.body_count = w->scene.wall_count - walls;
    take_out(w, center, (0.5 * edge + 0.99) * s);
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
    for (int k = 0; k < cells[2]; k++)
        for (int j = 0; j < cells[1]; j++)
            for (int i = 0; i < cells[0]; i++)
                world_add(w,
                          (double[]){low[0] + (i + 0.5) * s, low[1] + (j + 0.5) * s,
                                     low[2] + (k + 0.5) * s},
                          velocity);
}

void world_ball(world *w, double radius)
{
    const double s = w->scene.spacing;
    const int n = (int)ceil(radius / s);
    for (int k = -n; k <= n; k++)
        for (int j = -n; j <= n; j++)
            for (int i = -n; i <= n; i++)
                if ((i * i + j * j + k * k) * s * s <= radius * radius)
                    world_add(w, (double[]){i * s, j * s, k * s}, (double[]){0.0, 0.0, 0.0});
}

void world_sheet(world *w, double half)
{
    const double step = WALL_SPACING * w->scene.spacing;
    for (double y = -half; y <= half; y += step)
        for (double z = -half; z <= half; z += step)
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
