/* Models and particle sets for the subcommands. SPDX-License-Identifier: MIT */
#include "host.h"
#include "console.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../demo_model.h"

ascc_status ascc_host_model(ascc_context *context, const char *name, int32_t dimension,
                            double spacing, ascc_model **model)
{
    if (strcmp(name, "demo") != 0)
        return ascc_model_load(context, name, model);
    size_t size;
    unsigned char *bytes = demo_model_bytes(dimension, spacing, &size);
    if (!bytes)
        return ASCC_ERROR_MEMORY;
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    free(bytes);
    return status;
}

ascc_status ascc_host_particles(ascc_context *context, const ascc_sequence *scene,
                                const float *position, const float *velocity,
                                ascc_particles **particles)
{
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = scene->dimension,
                                            .spacing = 2.0 * scene->radius,
                                            .mass = scene->mass,
                                            .fluid_capacity = scene->count,
                                            .boundary_capacity = scene->walls};
    ascc_status status = ascc_particles_create(context, &options, particles);
    if (status != ASCC_OK)
        return status;
    const ascc_const_array x = {.data = position}, v = {.data = velocity};
    const ascc_const_array wall = {.data = scene->wall}, normal = {.data = scene->normal};
    status = ascc_particles_add_fluid(*particles, scene->count, &x, &v, NULL, NULL);
    if (status == ASCC_OK)
        status = ascc_particles_add_boundary(*particles, scene->walls, &wall, &normal, 0, NULL);
    if (status != ASCC_OK) {
        ascc_line(stderr, "ascc: %s", ascc_particles_message(*particles));
        ascc_particles_destroy(particles);
    }
    return status;
}

void ascc_host_complain(ascc_context *context, const char *what, ascc_status status)
{
    char text[256] = "";
    if (context)
        (void)ascc_context_message(context, text, sizeof text);
    ascc_line(stderr, "ascc: %s: %s%s%s", what, ascc_status_text(status), text[0] ? ": " : "",
              text);
}
