/* Worlds for stability scenes: fluid, walls, gravity, in SI units. SPDX-License-Identifier: MIT
 *
 * One text for 2D and 3D: rows are of three numbers, and a flat world is what of a deep one lies at z = 0.
 */
#ifndef STABILITY_WORLD_H
#define STABILITY_WORLD_H

#include "method.h"

typedef struct world {
    ascc_method_scene scene;                     /* points into the arrays below */
    double *position, *velocity, *wall, *normal; /* [count][3] */
} world;

/* Without fluid and walls: gravity along -y, frames of 0.02 s. */
world world_empty(int dimension, double spacing);
world world_copy(const world *w);
void world_free(world *w);

void world_add(world *w, const double position[3], const double velocity[3]);
/* A lattice block; its low corner is half a spacing outside the first particle. */
void world_block(world *w, const double low[3], const int cells[3], const double velocity[3]);
void world_ball(world *w, double radius);
/* A box with a block of fluid in its low corner, which starts a spacing off the walls, as in the data that networks
 * learn from. */
world world_tank(int dimension, double spacing, const int cells[3], const double edges[3]);
/* A one-layer wall in the plane x = 0, fluid at x > 0: [-half, half] in y and z. */
void world_sheet(world *w, double half);

/* The walls of a closed box from the origin, its edges so many spacings. */
void world_box(world *w, const double edges[3]);
/* The same without its two sides across x. */
void world_tube(world *w, const double edges[3]);
/* A wedge on the floor, its edge along z: where its middle is, half its width at the floor, its height
 * and length, in spacings. */
void world_wedge(world *w, double middle, double half, double height, double depth);

/* A thin cup without its upper side, from low to high, spacings: two layers of points back to back. Fluid in it, and
 * nearer than a spacing to it, is taken out. */
void world_cup(world *w, const double low[3], const double high[3]);

/* A cube in the fluid that may move, its edge in spacings, its points `inset` spacings behind its surface: fluid
 * nearer than a spacing to these is taken out. */
void world_body(world *w, const double center[3], double edge, double inset);
/* A plate across x that may move: normal along x. */
void world_paddle(world *w, double x, const double low[3], const double high[3]);
/* All walls are the body, which turns about this. */
void world_all_moves(world *w, const double center[3]);
/* Moves the body's points for a time. */
void world_move_body(world *w, const double velocity[3], const double spin[3], double dt);

/* Turned world: y becomes x, z becomes y, x becomes z. Upside down: y becomes -y. On one row of three
 * numbers and on a whole world; back undoes. */
typedef void world_map(double row[3]);
void world_turn(double row[3]);
void world_turn_back(double row[3]);
void world_swap(double row[3]); /* x and y: the turn of a flat world, its own way back */
void world_flip(double row[3]);
void world_apply(world *w, world_map *map);

#endif
