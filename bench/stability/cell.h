/* One cell of the stability matrix: a method in a scene, until it fails, is done or out of time.
 * SPDX-License-Identifier: MIT */
#ifndef STABILITY_CELL_H
#define STABILITY_CELL_H

#include "measures.h"
#include "world.h"

typedef enum verdict {
    PASS = 0,
    FAIL = 1,
    CUT = 2, /* no failure until the time was up */
    NONE = 3 /* the method does not do what the scene asks */
} verdict;

typedef struct cell {
    const ascc_method *method;
    const char *settings;
    int dimension;
    long frames;          /* wanted */
    long frame;           /* run: of the longest simulation of the scene */
    double budget, start; /* CPU seconds */
    verdict verdict;
    char text[128]; /* why it failed, or a remark on a pass */
} cell;

/* A running simulation of a world, which must outlive it. Rows are of three numbers, as the world's. */
typedef struct simulation {
    world *world;
    ascc_method_scene scene; /* the method's: rows of two numbers in a flat world */
    double *flat[4];         /* walls, normals, and what is read */
    void *state;
    long frame;
    double *position, *velocity;
} simulation;

/* Calls the cell failed, if it is not yet; returns false. */
bool cell_fail(cell *c, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/* A remark that stands behind a pass. */
void cell_say(cell *c, const char *format, ...)
#if defined(__GNUC__)
    __attribute__((format(printf, 2, 3)))
#endif
    ;

/* False: the method refused the world, and the cell has failed. Close either way. */
bool cell_open(cell *c, world *w, simulation *s);
/* False: the method moves no bodies, takes no fluid on the way, or knows no sleep, and the cell says so. */
bool cell_has_bodies(cell *c);
bool cell_takes_fluid(cell *c);
bool cell_sleeps(cell *c);
/* The share of the fluid that sleeps. */
double cell_asleep(const cell *c, const simulation *s);
/* False: the method has no cheaper model below its own, and the cell says so. */
bool cell_has_ladder(cell *c);
/* A cell that failed since two models cannot be one ladder has not been asked anything. */
void cell_excuse_ladder(cell *c);
/* What a frame may cost from now on, in particles; what ran; how much of each particle the method's own model computes. */
bool cell_set_budget(cell *c, simulation *s, double particles);
ascc_method_choices cell_choices(const cell *c, const simulation *s);
bool cell_set_detail(cell *c, simulation *s, const double *weight);
/* Moves the body of the world in the next frame; its wall points are then where it ends. */
bool cell_drive_body(cell *c, simulation *s, const double velocity[3], const double spin[3]);
/* The body at its mass, kg, for a frame: what the fluid gave it in the last one and gravity. */
bool cell_free_body(cell *c, simulation *s, double mass, double velocity[3]);
/* What the fluid gave to the body in the last frame, kg m/s. */
void cell_body_impulse(const cell *c, const simulation *s, double impulse[3]);
/* Adds fluid at rows of three numbers behind what there is, to the world as well. */
bool cell_add_fluid(cell *c, simulation *s, size_t count, const double *position,
                    const double *velocity);
/* One frame. False: the cell has failed (a step that fails, a number that is not finite), has run all
 * its frames, or is out of time. */
bool cell_step(cell *c, simulation *s);
void cell_close(cell *c, simulation *s);
/* Whether all frames were run without a failure: what is asked of the end can be asked. */
bool cell_complete(const cell *c, const simulation *s);

ascc_measure_motion_sums cell_motion(const simulation *s);
/* Nothing beyond the walls by half a spacing. */
bool cell_nothing_escapes(cell *c, const simulation *s);
/* At most one in 1,000 pairs nearer than a fifth of the spacing. */
bool cell_nothing_clumps(cell *c, const simulation *s);
/* The distance of the nearest pair, m. */
double cell_nearest_pair(const simulation *s);
/* Mean density of the fluid by the poly6 window, of rest density: of all, or of what is between two corners. */
double cell_density(const simulation *s);
double cell_density_between(const simulation *s, const double low[3], const double high[3]);
bool cell_slower_than(cell *c, const simulation *s, double speed);

#endif
