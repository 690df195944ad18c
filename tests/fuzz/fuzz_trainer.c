/* Trains hostile networks on hostile sequences with odd options: each call succeeds with finite weights, or
 * is refused by name. SPDX-License-Identifier: MIT
 *
 * First byte: 'm' a network of trainees.h, chosen by the next; 't' a text that describes one, which follows a
 * zero byte behind all else. Then options, then the numbers of a sequence.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/train.h>

#include "fuzz.h"
#include "trainees.h"

typedef struct choices {
    ascc_trainer_options options;
    ascc_training_stage stage;
    int32_t threads;
} choices;

/* An odd number now and then. */
static double odd(fuzz_input *in, double usual)
{
    const uint64_t which = fuzz_take(in, 1);
    return which == 255 ? (double)fuzz_take_float(in) : which == 254 ? -1.0 : usual;
}

static void read_options(fuzz_input *in, choices *c)
{
    const uint64_t flags = fuzz_take(in, 1), counts = fuzz_take(in, 1);
    memset(c, 0, sizeof *c);
    c->threads = 1 + (int32_t)(counts >> 2 & 1);
    c->stage = (ascc_training_stage){.end = 1000,
                                     .unroll = 1 + (int32_t)(counts & 1),
                                     .warm_up = (int32_t)(counts >> 1 & 1),
                                     .learning_rate = odd(in, 1e-3),
                                     .learning_rate_end = odd(in, 0.0)};
    c->options = (ascc_trainer_options){.size = sizeof c->options,
                                        .seed = fuzz_take(in, 1),
                                        .batch = 1 + (int32_t)(counts >> 3 & 1),
                                        .stage = &c->stage,
                                        .stage_size = sizeof c->stage,
                                        .stage_count = 1,
                                        .position_gradients = flags & 1,
                                        .rotate = flags >> 1 & 1,
                                        .mirror = flags >> 2 & 1,
                                        .average = flags & 8 ? 0.9 : 0.0,
                                        .density_weight = flags & 16 ? odd(in, 1.0) : 0.0,
                                        .wall_weight = flags & 32 ? odd(in, 1.0) : 0.0,
                                        .jitter = flags & 64 ? odd(in, 0.1) : 0.0,
                                        .memory_limit = flags & 128 ? 1 : 0,
                                        .clip = odd(in, 0.0),
                                        .truth_share = odd(in, 0.0),
                                        .neighbor_weight = odd(in, 0.0)};
}

enum { FRAMES = 5, FLUID = 9, WALLS = 6 };

/* A block that falls, in units of the spacing, and what the input adds to each number: a byte's worth, or any
 * float. */
static void read_sequence(fuzz_input *in, size_t d, ascc_training_sequence *s, float *position,
                          float *wall, float *normal)
{
    const float spacing = 0.05f;
    for (size_t k = 0; k < FRAMES * FLUID * d; k++) {
        const size_t c = k % d, i = k / d % FLUID, f = k / d / FLUID;
        const uint64_t change = fuzz_take(in, 1);
        const float at = (float)(c == 0 ? i % 3 : c == 1 ? i / 3 : i % 2);
        position[k] =
            change == 255 ? fuzz_take_float(in) : (at + 0.7f + (float)change * 0.002f) * spacing;
        position[k] -= c == 1 ? 0.0001f * (float)(f * f) : 0.0f;
    }
    for (size_t k = 0; k < WALLS * d; k++) {
        const size_t c = k % d, i = k / d;
        const uint64_t change = fuzz_take(in, 1);
        wall[k] = change == 255 ? fuzz_take_float(in) : c == 0 ? 0.6f * (float)i * spacing : 0.0f;
        normal[k] = change == 254 ? fuzz_take_float(in) : c == 1 ? 1.0f : 0.0f;
    }
    *s = (ascc_training_sequence){.size = sizeof *s,
                                  .name = "s",
                                  .frame_count = FRAMES,
                                  .fluid_count = FLUID,
                                  .boundary_count = WALLS,
                                  .position = position,
                                  .boundary_position = wall,
                                  .boundary_normal = normal,
                                  .time_step = odd(in, 0.005),
                                  .gravity = {0.0, odd(in, -9.81), 0.0},
                                  .share = odd(in, 0.0)};
}

static void check_weights(ascc_trainer *trainer)
{
    const size_t count = ascc_trainer_parameter_count(trainer);
    float *values = malloc(count * sizeof *values + 1);
    fuzz_require(values != NULL);
    fuzz_require(ascc_trainer_get_parameters(trainer, values) == ASCC_OK);
    for (size_t i = 0; i < count; i++)
        fuzz_require(isfinite(values[i]));
    free(values);
}

static void train(ascc_trainer *trainer, const choices *c)
{
    ascc_training_report report = {.size = sizeof report};
    double loss;
    for (int n = 0; n < 3; n++) {
        fuzz_named(ascc_trainer_iterate(trainer, &report), ascc_trainer_message(trainer));
        check_weights(trainer);
    }
    float *gradient = malloc(ascc_trainer_parameter_count(trainer) * sizeof *gradient + 1);
    fuzz_require(gradient != NULL);
    fuzz_named(
        ascc_trainer_gradient(trainer, 0, 1, c->stage.warm_up, c->stage.unroll, &loss, gradient),
        ascc_trainer_message(trainer));
    free(gradient);
    size_t size;
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    const void *bytes = ascc_trainer_model(trainer, 1, &size);
    fuzz_require(bytes != NULL && ascc_context_create(NULL, &context) == ASCC_OK);
    fuzz_load(context, bytes, size, &model);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

static unsigned char *network_of(const uint8_t *data, size_t size, fuzz_input *in, size_t *made)
{
    const uint8_t *end = data[0] == 't' ? memchr(data, '\0', size) : NULL;
    if (!end) {
        *in = (fuzz_input){data + 1, size - 1};
        return model_builder_random(&trainees[fuzz_take(in, 1) % TRAINEES], made);
    }
    *in = (fuzz_input){data + 1, (size_t)(end - data) - 1};
    char *text = malloc(size);
    fuzz_require(text != NULL);
    memcpy(text, end + 1, size - (size_t)(end - data) - 1);
    text[size - (size_t)(end - data) - 1] = '\0';
    for (char *c = text; *c; c++)
        *c = (unsigned char)*c < 0x20 ? ' ' : *c;
    unsigned char *bytes = model_builder_described('n', text, made);
    free(text);
    return bytes;
}

/* Leaves NULL where it is refused by name. */
static void create(const choices *c, const unsigned char *bytes, size_t size,
                   ascc_trainer **trainer)
{
    const ascc_context_options options = {.size = sizeof options, .thread_count = c->threads};
    ascc_train_context *context = NULL;
    char message[256] = "";
    fuzz_require(ascc_train_context_create(&options, &context) == ASCC_OK);
    const ascc_status status = ascc_trainer_create(context, &c->options, bytes, size, trainer);
    (void)ascc_train_context_message(context, message, sizeof message);
    fuzz_named(status, message);
    ascc_train_context_destroy(&context);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 2 || (data[0] != 'm' && data[0] != 't'))
        return 0;
    fuzz_input in;
    choices c;
    size_t made;
    ascc_trainer *trainer = NULL;
    ascc_training_sequence sequence;
    float position[FRAMES * FLUID * 3], wall[WALLS * 3], normal[WALLS * 3];
    unsigned char *bytes = network_of(data, size, &in, &made);
    read_options(&in, &c);
    create(&c, bytes, made, &trainer);
    free(bytes);
    if (!trainer)
        return 0;
    read_sequence(&in, 2, &sequence, position, wall, normal);
    const ascc_status added = ascc_trainer_add_sequence(trainer, &sequence);
    fuzz_named(added, ascc_trainer_message(trainer));
    if (added == ASCC_OK)
        train(trainer, &c);
    ascc_trainer_destroy(&trainer);
    return 0;
}
