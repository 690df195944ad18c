/* What kinds of scenes are made with: chance, bodies of water, rooms. SPDX-License-Identifier: MIT */
#ifndef REFERENCE_RECIPE_MAKER_H
#define REFERENCE_RECIPE_MAKER_H

#include "base/common.h"
#include "recipes.h"

#define PI 3.14159265358979323846

/* What is being made: the recipe, its chance, and room for more particles. */
typedef struct maker {
    recipe *r;
    uint64_t state;
    size_t capacity;
    size_t text_length;
    bool out_of_memory;
} maker;

typedef enum shape { SHAPE_BOX, SHAPE_BALL, SHAPE_CYLINDER, SHAPE_CONE, SHAPE_TORUS } shape;
extern const char *const maker_shapes[];

typedef struct body {
    shape shape;
    double center[3], velocity[3]; /* m, m/s */
    double half[3];                /* m, of a box */
    double size;                   /* m: radius of the others */
    double axes[3][3];             /* orthonormal rows; the shape's own axes */
} body;

/* Splitmix64, so that a scene is the same everywhere. */
uint64_t maker_bits(uint64_t *state);
double maker_chance(uint64_t *state, double low, double high);
int maker_choose(uint64_t *state, int low, int high); /* both included */

/* Adds to the scene in words. */
void maker_say(maker *m, const char *format, ...) ASCC_PRINTF(2, 3);

/* Fills a body with particles on the world's lattice, where there is room and no fluid already. */
void maker_fill(maker *m, const body *b);
void maker_straight(body *b);         /* axes of the world */
void maker_tumble(maker *m, body *b); /* random axes */
body maker_ball(const recipe *r, double radius, double x, double y);

/* A room of about that size from the origin, its sides multiples of the spacing. */
void maker_room(recipe *r, double x, double y, double z);
/* The speed that water from rest, or with this speed, can reach in the room. */
void maker_speed(recipe *r, double speed, double lowest);

/* Kinds of recipes_range.c. */
void make_obstacles(maker *m);
void make_dam(maker *m);
void make_drops(maker *m);
void make_still(maker *m);
void make_tilted(maker *m);
void make_filling(maker *m);
void make_draining(maker *m);
void make_held(maker *m);
void make_film(maker *m);
void make_jet(maker *m);
void make_space(maker *m);
void make_viscous(maker *m);

/* Kinds of recipes_moving.c. */
void make_paddle(maker *m);
void make_turning(maker *m);
void make_floating(maker *m);
void make_sinking(maker *m);

#endif
