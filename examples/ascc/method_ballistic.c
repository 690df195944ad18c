/* The floor of all methods: every particle in free flight, through everything.
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "method.h"

typedef struct ballistic {
    const ascc_method_scene *scene;
    ascc_velocity_kind kind;
    double position[]; /* then velocity */
} ballistic;

static size_t numbers_of(const ascc_method_scene *scene)
{
    return scene->fluid_count * (size_t)scene->dimension;
}

static bool ballistic_open(const char *settings, const ascc_method_scene *scene, void **state,
                           ascc_method_error *error)
{
    ballistic *b = calloc(1, sizeof *b + 2 * numbers_of(scene) * sizeof(double));
    (void)settings;
    if (!b) {
        snprintf(error->text, sizeof error->text, "no memory for %zu particles",
                 scene->fluid_count);
        return false;
    }
    b->scene = scene;
    *state = b;
    return true;
}

static bool ballistic_set(void *state, const double *position, const double *velocity,
                          ascc_velocity_kind kind, ascc_method_error *error)
{
    ballistic *b = state;
    const size_t n = numbers_of(b->scene);
    (void)error;
    memcpy(b->position, position, n * sizeof(double));
    memcpy(b->position + n, velocity, n * sizeof(double));
    b->kind = kind;
    return true;
}

static bool ballistic_advance(void *state, ascc_method_error *error)
{
    ballistic *b = state;
    const size_t n = numbers_of(b->scene), d = (size_t)b->scene->dimension;
    const double dt = b->scene->time_step, part = b->kind == ASCC_VELOCITY_STORED ? 0.5 : 1.0;
    double *velocity = b->position + n;
    (void)error;
    for (size_t i = 0; i < n; i++) {
        const double gain = dt * b->scene->gravity[i % d];
        b->position[i] += dt * (velocity[i] + part * gain);
        velocity[i] += gain;
    }
    return true;
}

static void ballistic_read(const void *state, double *position, double *velocity)
{
    const ballistic *b = state;
    const size_t n = numbers_of(b->scene);
    memcpy(position, b->position, n * sizeof(double));
    memcpy(velocity, b->position + n, n * sizeof(double));
}

static void ballistic_impulses(const void *state, double external[3], double wall[3])
{
    const ascc_method_scene *scene = ((const ballistic *)state)->scene;
    for (int c = 0; c < 3; c++) {
        external[c] =
            (double)scene->fluid_count * scene->mass * scene->time_step * scene->gravity[c];
        wall[c] = 0.0;
    }
}

const ascc_method ascc_method_ballistic = {
    .prefix = "ballistic",
    .help = "ballistic      every particle in free flight, through everything: the floor",
    .open = ballistic_open,
    .set = ballistic_set,
    .advance = ballistic_advance,
    .read = ballistic_read,
    .impulses = ballistic_impulses,
    .close = free,
};
