/* The smallest host: a block of water falls into nothing. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <ascc/ascc.h>

#define SIDE 8 /* particles along an edge */

static void check(ascc_status status, const char *what, const char *message)
{
    if (status == ASCC_OK)
        return;
    fprintf(stderr, "%s: %s: %s\n", what, ascc_status_text(status), message);
    exit(1);
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: hello MODEL\n");
        return 2;
    }
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    char message[256] = "";

    const ascc_context_options options = {.size = sizeof options, .thread_count = 2};
    check(ascc_context_create(&options, &context), "context", message);
    ascc_status status = ascc_model_load(context, argv[1], &model);
    ascc_context_message(context, message, sizeof message);
    check(status, argv[1], message);

    ascc_model_info info = {.size = sizeof info};
    check(ascc_model_get_info(model, &info), "info", message);
    const double h = info.particle_spacing;
    const ascc_particles_options fluid = {.size = sizeof fluid,
                                          .dimension = info.dimension,
                                          .spacing = h,
                                          .mass = info.rest_density * h * h * h};
    check(ascc_particles_create(context, &fluid, &particles), "particles", message);

    static float position[SIDE * SIDE * SIDE][3]; /* in 2D the third number is left out */
    size_t count = 0;
    for (int k = 0; k < (info.dimension == 3 ? SIDE : 1); k++)
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++, count++) {
                position[count][0] = (float)(i * h);
                position[count][1] = (float)(j * h);
                position[count][2] = (float)(k * h);
            }
    const ascc_const_array positions = {.data = position, .stride = sizeof position[0]};
    check(ascc_particles_add_fluid(particles, count, &positions, NULL, NULL, NULL), "fluid",
          ascc_particles_message(particles));

    check(ascc_step_create(context, model, NULL, &step), "step", message);
    check(ascc_step_run(step, particles, NULL, 100), "run", ascc_step_message(step));

    int64_t momentum[3];
    check(ascc_particles_total_momentum(particles, momentum), "momentum", message);
    const double quantum = ascc_particles_momentum_quantum(particles);
    printf("%zu particles, 100 steps: momentum %" PRId64 " %" PRId64 " %" PRId64
           " quanta of %g kg m/s\n",
           count, momentum[0], momentum[1], momentum[2], quantum);

    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return 0;
}
