/* A host that trains: loads a model file, shows it a drop in free fall, and moves its weights.
 * SPDX-License-Identifier: MIT
 *
 *   cc learn.c $(pkg-config --cflags --libs ascc-train) -o learn && ./learn MODEL.safetensors
 */
#include <ascc/train.h>

#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 16, FRAMES = 20 };

static void *read_file(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    char *bytes = malloc(8 << 20);
    *size = file && bytes ? fread(bytes, 1, 8 << 20, file) : 0;
    if (file)
        fclose(file);
    return bytes;
}

int main(int count, char **arguments)
{
    static float position[FRAMES][SIDE * SIDE][2];
    const double spacing = 0.0125, dt = 0.005, gravity = -9.81;
    size_t size;
    void *model = read_file(count > 1 ? arguments[1] : "model.safetensors", &size);

    const ascc_training_stage stage = {
        .end = 10, .horizon = 2, .presteps = 2, .learning_rate = 1e-4};
    char why[256] = "";
    const ascc_trainer_options options = {.size = sizeof options,
                                          .stage = &stage,
                                          .stage_count = 1,
                                          .batch = 2,
                                          .seed = 1,
                                          .message = why,
                                          .message_size = sizeof why};
    ascc_trainer *trainer;
    if (ascc_trainer_create(&options, model, size, &trainer) != ASCC_OK) {
        fprintf(stderr, "learn: %s\n", why);
        free(model);
        return 1;
    }
    for (int t = 0; t < FRAMES; t++)
        for (int i = 0; i < SIDE * SIDE; i++) {
            position[t][i][0] = (float)(spacing * (i % SIDE));
            position[t][i][1] = (float)(spacing * (i / SIDE) + 0.5 * gravity * dt * dt * t * t);
        }
    const ascc_training_sequence sequence = {.size = sizeof sequence,
                                             .name = "drop",
                                             .frame_count = FRAMES,
                                             .fluid_count = SIDE * SIDE,
                                             .position = &position[0][0][0],
                                             .time_step = dt,
                                             .gravity = {0.0, gravity, 0.0}};
    ascc_training_report report = {.size = sizeof report};
    ascc_status status = ascc_trainer_add_sequence(trainer, &sequence);
    while (status == ASCC_OK && ascc_trainer_iteration(trainer) < stage.end) {
        status = ascc_trainer_iterate(trainer, &report);
        printf("iteration %llu: loss %.6f spacings\n", (unsigned long long)report.iteration,
               report.loss);
    }
    if (status != ASCC_OK)
        fprintf(stderr, "learn: %s\n", ascc_trainer_message(trainer));
    ascc_trainer_destroy(&trainer);
    free(model);
    return status != ASCC_OK;
}
