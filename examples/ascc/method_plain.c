/* Methods that need no more state than positions and velocities. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "method.h"

bool ascc_plain_open(void (*frame)(ascc_plain *fluid), const char *settings,
                     const ascc_method_scene *scene, void **state, ascc_method_error *error)
{
    const size_t count = scene->fluid_count * (size_t)scene->dimension;
    ascc_plain *fluid = malloc(sizeof *fluid);
    double *numbers = calloc(2 * count + 1, sizeof *numbers);
    if (!fluid || !numbers) {
        snprintf(error->text, sizeof error->text, "no memory for %zu particles",
                 scene->fluid_count);
        free(fluid);
        free(numbers);
        return false;
    }
    *fluid = (ascc_plain){.scene = scene,
                          .settings = settings,
                          .count = count,
                          .position = numbers,
                          .velocity = numbers + count,
                          .frame = frame};
    *state = fluid;
    return true;
}

bool ascc_plain_set(void *state, const double *position, const double *velocity,
                    ascc_velocity_kind kind, ascc_method_error *error)
{
    ascc_plain *fluid = state;
    (void)error;
    memcpy(fluid->position, position, fluid->count * sizeof(double));
    memcpy(fluid->velocity, velocity, fluid->count * sizeof(double));
    fluid->kind = kind;
    return true;
}

bool ascc_plain_advance(void *state, ascc_method_error *error)
{
    ascc_plain *fluid = state;
    (void)error;
    fluid->frame(fluid);
    return true;
}

void ascc_plain_read(const void *state, double *position, double *velocity)
{
    const ascc_plain *fluid = state;
    memcpy(position, fluid->position, fluid->count * sizeof(double));
    memcpy(velocity, fluid->velocity, fluid->count * sizeof(double));
}

void ascc_plain_close(void *state)
{
    ascc_plain *fluid = state;
    free(fluid->position);
    free(fluid);
}
