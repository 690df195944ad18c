/* Reads the config of `ascc train` from bytes; a network that it describes is built, loaded and stepped.
 * SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "train_config.h"

static void check_path(const char path[ASCC_TRAIN_PATH])
{
    fuzz_require(memchr(path, '\0', ASCC_TRAIN_PATH) != NULL);
}

static void check(const ascc_train_config *c)
{
    uint64_t end = 0;
    check_path(c->model);
    check_path(c->output);
    check_path(c->latest);
    check_path(c->log);
    check_path(c->chart);
    check_path(c->checkpoint);
    fuzz_require(c->output[0] != '\0' && (c->described || c->model[0] != '\0'));
    fuzz_require(c->options.stage_count >= 1 && c->options.stage_count <= ASCC_TRAIN_STAGES);
    for (int32_t i = 0; i < c->options.stage_count; i++) {
        fuzz_require(c->stage[i].end > end && c->stage[i].horizon >= 1);
        end = c->stage[i].end;
    }
    for (size_t i = 0; i < c->train.count; i++)
        fuzz_require(c->train.source[i].path[0] != '\0' && c->train.source[i].every >= 1);
}

/* Small enough for a few milliseconds. */
static bool small(const ascc_architecture *a)
{
    bool is = a->channels <= 16 && a->fine_layers <= 4 && a->coarse_layers <= 3;
    for (int i = 0; i < ASCC_ARCHITECTURE_LEVELS; i++)
        is = is && a->coarse_channels[i] <= 16;
    return is;
}

static void build(const ascc_architecture *a)
{
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    size_t size;
    char error[256] = "";
    unsigned char *bytes = ascc_architecture_build(a, &size, error, sizeof error);
    fuzz_require(bytes || error[0]);
    if (!bytes)
        return;
    fuzz_require(ascc_context_create(NULL, &context) == ASCC_OK);
    if (ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK)
        fuzz_step_model(context, model); /* else a number fits the config, but no model */
    (void)ascc_context_message(context, error, sizeof error);
    fuzz_require(model || error[0]);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(bytes);
}

/* Patterns of several stars in several folders would search the whole disk. */
static bool searches(const uint8_t *data, size_t size)
{
    int stars = 0;
    for (size_t i = 0; i < size; i++)
        stars += data[i] == '*';
    return stars > 1;
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    ascc_train_config config;
    char error[768] = "";
    if (searches(data, size))
        return 0;
    (void)fuzz_file("a.safetensors", "", 0); /* data that a pattern finds */
    if (ascc_train_config_read(fuzz_file("c.json", data, size), &config, error, sizeof error)) {
        check(&config);
        if (config.described && small(&config.architecture))
            build(&config.architecture);
    } else {
        fuzz_require(error[0] != '\0');
    }
    ascc_train_config_free(&config);
    return 0;
}
