/* What `ascc eval` and the charts run: any way to advance a fluid by one frame.
 * SPDX-License-Identifier: MIT
 *
 * A new method is one ascc_method in a file of its own, a declaration below, and a line in methods.c.
 * Positions and velocities are packed double[fluid_count][dimension], SI units.
 */
#ifndef ASCC_METHOD_H
#define ASCC_METHOD_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/** What a scene's velocities are: it decides how far a particle flies freely in one frame. */
typedef enum ascc_velocity_kind {
    ASCC_VELOCITY_STORED = 0,     /* at the frame's instant: x' = x + dt v + dt^2 g / 2 */
    ASCC_VELOCITY_DIFFERENCE = 1, /* (x_t - x_(t-1)) / dt:   x' = x + dt (v + dt g) */
} ascc_velocity_kind;

/** What a method is opened with; lives as long as the method's state does. */
typedef struct ascc_method_scene {
    int32_t dimension;
    int32_t threads;
    double time_step;    /* s from frame to frame */
    double spacing;      /* m */
    double mass;         /* kg, of a particle */
    double rest_density; /* kg/m^3 */
    double gravity[3];
    size_t fluid_count, wall_count;
    const double *wall, *normal; /* [wall_count][dimension] */
    size_t first_layer;          /* wall points that touch the fluid: the first so many */
    size_t body_count;           /* wall points of a body that moves: the last so many */
    double body_center[3];       /* what it turns about, and takes along */
    double sleep_speed;          /* fluid slower than this stops, if the method can; 0 = none */
    const char *
        below; /* a cheaper model for frames that may not cost more, if the method has one; or NULL */
} ascc_method_scene;

/** What a method chose that has a cheaper model below its own. */
typedef struct ascc_method_choices {
    bool below;             /* the last frame ran on it */
    uint64_t changes, late; /* so far; frames that cost more than they might */
} ascc_method_choices;

/** Why a method failed. */
typedef struct ascc_method_error {
    char text[256];
} ascc_method_error;

typedef struct ascc_method {
    const char *prefix; /* "sph:"; what follows it is the settings. "" takes all that is left */
    const char *help;   /* one line */

    /* Makes a state for the scene, without fluid yet. */
    bool (*open)(const char *settings, const ascc_method_scene *scene, void **state,
                 ascc_method_error *error);
    /* Places the fluid; may be called many times, and forgets what was before. */
    bool (*set)(void *state, const double *position, const double *velocity,
                ascc_velocity_kind kind, ascc_method_error *error);
    /* Velocities of the fluid that was set before its last frames, the latest, 0 frames ago, first; NULL if the method
     * does not look back. */
    bool (*look_back)(void *state, size_t ago, const double *velocity, ascc_method_error *error);
    /* One frame; false if the method cannot go on (the state is then as good as closed). */
    bool (*advance)(void *state, ascc_method_error *error);
    void (*read)(const void *state, double *position, double *velocity);
    /* Momentum that gravity gave to the fluid and that the fluid gave to walls in the last frame, kg
     * m/s; NULL if the method cannot tell. */
    void (*impulses)(const void *state, double external[3], double wall[3]);
    /* How the scene's body moves in the next frame, m/s and 1/s; it then stands still until the next call. And
     * what the fluid gave to it in the last frame, kg m/s. Both NULL if the method has no such bodies. */
    bool (*drive_body)(void *state, const double velocity[3], const double spin[3],
                       ascc_method_error *error);
    void (*body_impulse)(const void *state, double impulse[3]);
    /* Adds fluid behind what there is; the caller then raises the scene's count. NULL if the method cannot. */
    bool (*add_fluid)(void *state, size_t count, const double *position, const double *velocity,
                      ascc_method_error *error);
    /* Particles that sleep after the last frame; NULL if the method knows no sleep. */
    size_t (*asleep)(const void *state);
    /* With a model below: what a frame may cost from now on, in particles that the method's own model steps; each that
     * the one below steps counts as a third of one. Any cost until the first call. Which of the two ran. And how much
     * of each particle the method's own computes while the one below runs, from 0 to 1, [fluid_count]. All NULL if the
     * method has no cheaper model. */
    bool (*set_budget)(void *state, double particles, ascc_method_error *error);
    void (*choices)(const void *state, ascc_method_choices *choices);
    bool (*set_detail)(void *state, const double *weight, ascc_method_error *error);
    void (*close)(void *state);
} ascc_method;

/* ---- The short way: a method that needs no more state than its fluid ------------------------- */

/** The fluid of such a method. */
typedef struct ascc_plain {
    const ascc_method_scene *scene;
    const char *settings;    /* what follows the prefix */
    ascc_velocity_kind kind; /* of the velocities it was set with */
    size_t count;            /* numbers in each of the two: fluid_count * dimension */
    double *position, *velocity;
    void (*frame)(struct ascc_plain *fluid);
} ascc_plain;

/** For the method's `open`: `frame` moves the fluid by scene->time_step. */
bool ascc_plain_open(void (*frame)(ascc_plain *fluid), const char *settings,
                     const ascc_method_scene *scene, void **state, ascc_method_error *error);
bool ascc_plain_set(void *state, const double *position, const double *velocity,
                    ascc_velocity_kind kind, ascc_method_error *error);
bool ascc_plain_advance(void *state, ascc_method_error *error);
void ascc_plain_read(const void *state, double *position, double *velocity);
void ascc_plain_close(void *state);

/** All that is left of such an ascc_method behind .open. */
#define ASCC_PLAIN                                                                                 \
    .set = ascc_plain_set, .advance = ascc_plain_advance, .read = ascc_plain_read,                 \
    .close = ascc_plain_close

/* ---- All of them ----------------------------------------------------------------------------- */

/** All methods, NULL at the end: a word means the first whose prefix it begins with. */
extern const ascc_method *const ascc_methods[];

extern const ascc_method ascc_method_ballistic, ascc_method_sph, ascc_method_dfsph, ascc_method_pbf,
    ascc_method_model;

#endif
