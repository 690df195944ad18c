/* The floor of all methods: every particle in free flight, through everything.
 * SPDX-License-Identifier: MIT */
#include "method.h"

static void ballistic_frame(ascc_plain *fluid)
{
    const ascc_method_scene *scene = fluid->scene;
    const size_t d = (size_t)scene->dimension;
    const double dt = scene->time_step, part = fluid->kind == ASCC_VELOCITY_STORED ? 0.5 : 1.0;
    for (size_t i = 0; i < fluid->count; i++) {
        const double gain = dt * scene->gravity[i % d];
        fluid->position[i] += dt * (fluid->velocity[i] + part * gain);
        fluid->velocity[i] += gain;
    }
}

static bool ballistic_open(const char *settings, const ascc_method_scene *scene, void **state,
                           ascc_method_error *error)
{
    return ascc_plain_open(ballistic_frame, settings, scene, state, error);
}

static void ballistic_impulses(const void *state, double external[3], double wall[3])
{
    const ascc_method_scene *scene = ((const ascc_plain *)state)->scene;
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
    .impulses = ballistic_impulses,
    ASCC_PLAIN,
};
