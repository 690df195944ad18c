/* Worlds for stability scenes: fluid, walls, gravity, in SI units. SPDX-License-Identifier: MIT */
#ifndef STABILITY_WORLD_H
#define STABILITY_WORLD_H

#include "method.h"

typedef struct world {
    ascc_method_scene scene;                     /* points into the arrays below */
    double *position, *velocity, *wall, *normal; /* [count][3] */
} world;

/* Without fluid and walls: gravity along -y, frames of 0.02 s. */
world world_empty(double spacing);
world world_copy(const world *w);
void world_free(world *w);

void world_add(world *w, const double position[3], const double velocity[3]);
/* A lattice block; its low corner is half a spacing outside the first particle. */
void world_block(world *w, const double low[3], const int cells[3], const double velocity[3]);
void world_ball(world *w, double radius);
/* A one-layer wall in the plane x = 0, fluid at x > 0: [-half, half] in y and z. */
void world_sheet(world *w, double half);

/* The walls of a closed box from the origin, its edges so many spacings. */
void world_box(world *w, const int edges[3]);
/* The same without its two sides across x. */
void world_tube(world *w, const double edges[3]);
/* A wedge on the floor, its edge along z: where its middle is, half its width at the floor, its height
 * and length, in spacings. */
void world_wedge(world *w, double middle, double half, double height, double depth);

/* A cube in the fluid that may move, its edge in spacings: fluid nearer than a spacing is taken out. */
void world_body(world *w, const double center[3], double edge);

/* Turned world: y becomes x, z becomes y, x becomes z. Upside down: y becomes -y. On one row of three
 * numbers and on a whole world; back undoes. */
typedef void world_map(double row[3]);
void world_turn(double row[3]);
void world_turn_back(double row[3]);
void world_flip(double row[3]);
void world_apply(world *w, world_map *map);

#endif
