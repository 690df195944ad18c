/* A host that trains from nothing: describes a network, has its first weights made, shows it a drop in free
 * fall, and moves its weights. SPDX-License-Identifier: MIT
 *
 *   cc learn.c $(pkg-config --cflags --libs ascc-train) -o learn && ./learn OUT.safetensors
 */
#include <ascc/train.h>

#include <stdio.h>
#include <stdlib.h>

enum { SIDE = 16, FRAMES = 20 };

/* Two layers of convolutions in a small basis; docs/file-format.md has all that a description may say. */
static const char description[] =
    "{\"name\":\"learn\",\"dimension\":2,\"time_step\":0.005,\"gravity\":[0,-9.81],"
    "\"particle_spacing\":0.0125,\"rest_density\":1000,\"evaluate\":\"advected\","
    "\"features\":{\"fluid\":[\"one\",\"motion\"],\"boundary\":[\"one\",\"normal\"]},"
    "\"layers\":["
    "{\"name\":\"first\",\"points\":\"fluid\",\"channels\":8,\"terms\":["
    "{\"type\":\"convolution\",\"source\":\"fluid\",\"relative\":true,\"kernel\":\"first.kernel\","
    "\"bias\":\"first.bias\",\"radius\":0.028,\"basis\":{\"bumps\":3,\"order\":1}}]},"
    "{\"name\":\"second\",\"points\":\"fluid\",\"channels\":8,\"terms\":["
    "{\"type\":\"convolution\",\"source\":\"first\",\"relu\":true,\"kernel\":\"second.kernel\","
    "\"bias\":\"second.bias\",\"radius\":0.028,\"basis\":{\"bumps\":3,\"order\":1}},"
    "{\"type\":\"identity\",\"source\":\"first\"}]}],"
    "\"output\":{\"type\":\"antisymmetric\",\"source\":\"second\",\"relu\":true,\"scale\":0.000625,"
    "\"kernel\":\"output.kernel\",\"damping\":\"output.damping\",\"radius\":0.028,"
    "\"basis\":{\"bumps\":4},\"direction\":\"current\"}}";

static void print(void *user, const char *line)
{
    (void)user;
    fprintf(stderr, "learn: %s\n", line);
}

/* From malloc; NULL without memory, or where the description is wrong. */
static void *first_model(ascc_train_context *context, size_t *size)
{
    void *model = NULL;
    if (ascc_train_initial_model(context, description, 1, NULL, 0, size) == ASCC_OK)
        model = malloc(*size);
    if (model && ascc_train_initial_model(context, description, 1, model, *size, size) != ASCC_OK) {
        free(model);
        model = NULL;
    }
    return model;
}

static ascc_status add_drop(ascc_trainer *trainer)
{
    static float position[FRAMES][SIDE * SIDE][2];
    const double spacing = 0.0125, dt = 0.005, gravity = -9.81;
    const ascc_training_sequence sequence = {.size = sizeof sequence,
                                             .name = "drop",
                                             .frame_count = FRAMES,
                                             .fluid_count = SIDE * SIDE,
                                             .position = &position[0][0][0],
                                             .time_step = dt,
                                             .gravity = {0.0, gravity, 0.0}};
    for (int t = 0; t < FRAMES; t++)
        for (int i = 0; i < SIDE * SIDE; i++) {
            position[t][i][0] = (float)(spacing * (i % SIDE));
            position[t][i][1] = (float)(spacing * (i / SIDE) + 0.5 * gravity * dt * dt * t * t);
        }
    return ascc_trainer_add_sequence(trainer, &sequence);
}

static int write_model(ascc_trainer *trainer, const char *path)
{
    size_t size;
    const void *model = ascc_trainer_model(trainer, 0, &size);
    FILE *file = model ? fopen(path, "wb") : NULL;
    const int written = file && fwrite(model, 1, size, file) == size;
    if ((file && fclose(file) != 0) || !written) {
        fprintf(stderr, "learn: cannot write '%s'\n", path);
        return 0;
    }
    return 1;
}

int main(int count, char **arguments)
{
    const ascc_context_options options = {.size = sizeof options, .thread_count = 2, .log = print};
    const ascc_training_stage stage = {.end = 10, .unroll = 2, .warm_up = 2, .learning_rate = 1e-3};
    const ascc_trainer_options training = {.size = sizeof training,
                                           .seed = 1,
                                           .stage = &stage,
                                           .stage_size = sizeof stage,
                                           .stage_count = 1,
                                           .batch = 2};
    ascc_train_context *context = NULL;
    ascc_trainer *trainer = NULL;
    ascc_training_report report = {.size = sizeof report};
    size_t size;
    if (ascc_train_context_create(&options, &context) != ASCC_OK)
        return 1;
    void *model = first_model(context, &size);
    ascc_status status =
        model ? ascc_trainer_create(context, &training, model, size, &trainer) : ASCC_ERROR_MEMORY;
    if (status == ASCC_OK)
        status = add_drop(trainer);
    while (status == ASCC_OK && ascc_trainer_iteration(trainer) < stage.end) {
        status = ascc_trainer_iterate(trainer, &report);
        printf("iteration %llu: loss %.6f spacings\n", (unsigned long long)report.iteration,
               report.loss);
    }
    if (status == ASCC_OK && count > 1 && !write_model(trainer, arguments[1]))
        status = ASCC_ERROR_FILE;
    ascc_trainer_destroy(&trainer);
    ascc_train_context_destroy(&context);
    free(model);
    return status != ASCC_OK;
}
