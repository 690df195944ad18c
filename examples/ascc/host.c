/* Models and particle sets for the subcommands. SPDX-License-Identifier: MIT */
#include "host.h"
#include "console.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../demo_model.h"
#include "published.h"
#include "tensor_file.h"

/* The context's message is the error's. */
static ascc_status told(ascc_context *context, ascc_status status, ascc_host_error *error)
{
    if (status != ASCC_OK)
        (void)ascc_context_message(context, error->text, sizeof error->text);
    return status;
}

/* From bytes of malloc, which are freed. */
static ascc_status load_bytes(ascc_context *context, unsigned char *bytes, size_t size,
                              ascc_model **model, ascc_host_error *error)
{
    if (!bytes)
        return ASCC_ERROR_FORMAT;
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    free(bytes);
    return told(context, status, error);
}

ascc_status ascc_host_find(ascc_context *context, const char *name, char path[ASCC_HOST_PATH],
                           ascc_host_error *error)
{
    return told(context, ascc_model_find(context, name, path, ASCC_HOST_PATH), error);
}

ascc_status ascc_host_load(ascc_context *context, const char *name, ascc_model **model,
                           ascc_host_error *error)
{
    size_t size;
    ascc_host_error why;
    char path[ASCC_HOST_PATH];
    ascc_status status = ascc_host_find(context, name, path, error);
    if (status == ASCC_OK)
        status = told(context, ascc_model_load(context, path, model), error);
    if (status != ASCC_ERROR_FORMAT)
        return status;
    unsigned char *bytes = ascc_tensor_file_read(path, &size, why.text, sizeof why.text);
    if (!bytes || !ascc_published_is(bytes, size)) {
        free(bytes);
        return status;
    }
    unsigned char *converted =
        ascc_published_convert(bytes, size, &size, error->text, sizeof error->text);
    free(bytes);
    return load_bytes(context, converted, size, model, error);
}

ascc_status ascc_host_model(ascc_context *context, const char *name, int32_t dimension,
                            double spacing, ascc_model **model, ascc_host_error *error)
{
    if (strcmp(name, "demo") != 0)
        return ascc_host_load(context, name, model, error);
    size_t size;
    unsigned char *bytes = demo_model_bytes(dimension, spacing, &size);
    if (bytes)
        return load_bytes(context, bytes, size, model, error);
    (void)snprintf(error->text, sizeof error->text, "no memory");
    return ASCC_ERROR_MEMORY;
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

void ascc_host_complain(const char *what, ascc_status status, const char *message)
{
    ascc_line(stderr, "ascc: %s: %s%s%s", what, ascc_status_text(status), message[0] ? ": " : "",
              message);
}
