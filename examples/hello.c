/* The smallest host: a moving block of water without gravity. SPDX-License-Identifier: MIT */
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
    char message[256] = "", path[4096];

    const ascc_context_options options = {.size = sizeof options, .thread_count = 2};
    check(ascc_context_create(&options, &context), "context", message);
    ascc_status status = ascc_model_find(context, argv[1], path, sizeof path);
    if (status == ASCC_OK)
        status = ascc_model_load(context, path, &model);
    ascc_context_message(context, message, sizeof message);
    check(status, argv[1], message);

    ascc_model_info info = {.size = sizeof info};
    check(ascc_model_get_info(model, &info), "info", message);
    const double h = info.particle_spacing;
    ascc_particles_options fluid = {.size = sizeof fluid};
    check(ascc_model_particles_options(model, 1.0, &fluid), "options", message);
    check(ascc_particles_create(context, &fluid, &particles), "particles", message);

    /* In 2D the third number of a row is left out. */
    static float position[SIDE * SIDE * SIDE][3], velocity[SIDE * SIDE * SIDE][3];
    size_t count = 0;
    for (int k = 0; k < (info.dimension == 3 ? SIDE : 1); k++)
        for (int j = 0; j < SIDE; j++)
            for (int i = 0; i < SIDE; i++, count++) {
                position[count][0] = (float)(i * h);
                position[count][1] = (float)(j * h);
                position[count][2] = (float)(k * h);
                velocity[count][0] = 1.0f; /* m/s */
            }
    const ascc_const_array positions = {.data = position, .stride = sizeof position[0]};
    const ascc_const_array velocities = {.data = velocity, .stride = sizeof velocity[0]};
    check(ascc_particles_add_fluid(particles, count, &positions, &velocities, NULL, NULL), "fluid",
          ascc_particles_message(particles));

    /* Without gravity and walls the momentum stays what it is, to the last quantum. */
    const double none[3] = {0.0, 0.0, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = none};
    int64_t before[3], after[3];
    check(ascc_particles_total_momentum(particles, before), "momentum", message);
    check(ascc_step_create(context, model, NULL, &step), "step", message);
    check(ascc_step_run(step, particles, &forces, 100), "run", ascc_step_message(step));
    check(ascc_particles_total_momentum(particles, after), "momentum", message);
    printf("%zu particles, 100 steps; momentum in quanta of %g kg m/s:\n", count,
           ascc_particles_momentum_quantum(particles));
    printf("before %" PRId64 " %" PRId64 " %" PRId64 "\n", before[0], before[1], before[2]);
    printf("after  %" PRId64 " %" PRId64 " %" PRId64 "\n", after[0], after[1], after[2]);

    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return 0;
}
