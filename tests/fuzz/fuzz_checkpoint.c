/* Loads a trainer's state from bytes; if it loads, its weights are finite and an iteration runs or is refused by
 * name. SPDX-License-Identifier: MIT
 *
 * The first byte says what the rest is: 'f' a whole file; 'h' a header, what follows a byte 0xff is the data;
 * 'w' eight bytes of an iteration and floats that repeat over all weights and moments, in a right file.
 */
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/train.h>

#include "fuzz.h"
#include "trainees.h"

static ascc_trainer *open_trainer(void)
{
    static const ascc_training_stage stage = {.end = 1000, .unroll = 1, .learning_rate = 1e-3};
    const ascc_trainer_options options = {.size = sizeof options,
                                          .batch = 1,
                                          .stage = &stage,
                                          .stage_size = sizeof stage,
                                          .stage_count = 1,
                                          .average = 0.9};
    float x[3 * 4 * 2];
    for (size_t k = 0; k < 3 * 4 * 2; k++)
        x[k] = 0.05f * (float)(k % 2 ? k / 4 % 2 : k / 2 % 2) + 1e-4f * (float)(k / 8);
    const ascc_training_sequence sequence = {.size = sizeof sequence,
                                             .name = "s",
                                             .frame_count = 3,
                                             .fluid_count = 4,
                                             .position = x,
                                             .time_step = 0.005,
                                             .gravity = {0.0, -9.81, 0.0}};
    ascc_train_context *context = NULL;
    ascc_trainer *trainer = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(&trainees[1], &size);
    fuzz_require(ascc_train_context_create(NULL, &context) == ASCC_OK);
    fuzz_require(ascc_trainer_create(context, &options, bytes, size, &trainer) == ASCC_OK);
    ascc_train_context_destroy(&context);
    fuzz_require(ascc_trainer_add_sequence(trainer, &sequence) == ASCC_OK);
    free(bytes);
    return trainer;
}

static void check_weights(ascc_trainer *trainer)
{
    const size_t count = ascc_trainer_parameter_count(trainer);
    float *values = malloc(count * sizeof *values);
    fuzz_require(values != NULL);
    fuzz_require(ascc_trainer_get_parameters(trainer, values) == ASCC_OK);
    for (size_t i = 0; i < count; i++)
        fuzz_require(isfinite(values[i]));
    free(values);
}

static void load(const void *bytes, size_t size)
{
    ascc_trainer *trainer = open_trainer();
    const ascc_status status =
        ascc_trainer_load(trainer, fuzz_file("state.safetensors", bytes, size));
    fuzz_named(status, ascc_trainer_message(trainer));
    if (status != ASCC_OK)
        fuzz_require(ascc_trainer_iteration(trainer) == 0);
    check_weights(trainer);
    ascc_training_report report = {.size = sizeof report};
    fuzz_named(ascc_trainer_iterate(trainer, &report), ascc_trainer_message(trainer));
    check_weights(trainer);
    ascc_trainer_destroy(&trainer);
}

/* A file that the trainer saves, with numbers of the input in it. */
static void load_numbers(const uint8_t *data, size_t size)
{
    char path[600], iteration[64];
    static unsigned char bytes[1 << 20];
    ascc_trainer *trainer = open_trainer();
    (void)snprintf(path, sizeof path, "%s/saved.safetensors", fuzz_folder());
    fuzz_require(ascc_trainer_save(trainer, path) == ASCC_OK);
    ascc_trainer_destroy(&trainer);
    FILE *file = fopen(path, "rb");
    fuzz_require(file != NULL);
    const size_t made = fread(bytes, 1, sizeof bytes, file);
    (void)fclose(file);
    fuzz_input in = {data, size};
    size_t header = 8;
    for (int i = 7; i >= 0; i--)
        header += (size_t)bytes[i] << 8 * i;
    const uint64_t number = fuzz_take(&in, 8);
    (void)snprintf(iteration, sizeof iteration, "\"iteration\":\"%" PRIu64 "\"", number % 10);
    unsigned char *at = bytes + 8; /* of one digit: the file keeps its length */
    while (at + strlen(iteration) < bytes + header && memcmp(at, iteration, 13) != 0)
        at++;
    if (at + strlen(iteration) < bytes + header)
        memcpy(at, iteration, strlen(iteration));
    for (size_t k = header; k < made && in.left; k += 4) {
        const uint32_t bits = (uint32_t)fuzz_take(&in, 4);
        memcpy(bytes + k, &bits, made - k < 4 ? made - k : 4);
        if (!in.left)
            in = (fuzz_input){data + (size > 8 ? 8 : 0), size > 8 ? size - 8 : 0};
    }
    load(bytes, made);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size > 0 && data[0] == 'f')
        load(data + 1, size - 1);
    if (size > 0 && data[0] == 'w')
        load_numbers(data + 1, size - 1);
    if (size > 0 && data[0] == 'h') {
        size_t made;
        unsigned char *bytes = fuzz_with_header(data + 1, size - 1, &made);
        load(bytes, made);
        free(bytes);
    }
    return 0;
}
