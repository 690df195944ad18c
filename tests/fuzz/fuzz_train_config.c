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
    fuzz_require(c->output[0] != '\0' && (c->network || c->model[0] != '\0'));
    fuzz_require(c->options.stage_count >= 1 && c->options.stage_count <= ASCC_TRAIN_STAGES);
    for (int32_t i = 0; i < c->options.stage_count; i++) {
        fuzz_require(c->stage[i].end > end && c->stage[i].unroll >= 1);
        end = c->stage[i].end;
    }
    for (size_t i = 0; i < c->train.count; i++)
        fuzz_require(c->train.source[i].path[0] != '\0' && c->train.source[i].every >= 1);
}

/* Memory for networks of a few milliseconds. */
enum { MOST = 1 << 20 };

static void *allocate(void *user, size_t size, size_t alignment)
{
    (void)user;
    return size <= MOST ? aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment)
                        : NULL;
}

static void release(void *user, void *memory, size_t size)
{
    (void)user;
    (void)size;
    free(memory);
}

static void *reallocate(void *user, void *memory, size_t old_size, size_t size, size_t alignment)
{
    void *moved = allocate(user, size, alignment);
    if (moved) {
        memcpy(moved, memory, old_size < size ? old_size : size);
        release(user, memory, old_size);
    }
    return moved;
}

/* What is described begins and steps, or is refused by name. */
static void begin(const ascc_train_config *c)
{
    static unsigned char bytes[MOST];
    const ascc_context_options options = {
        .size = sizeof options, .allocate = allocate, .reallocate = reallocate, .release = release};
    ascc_train_context *train = NULL;
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    size_t size;
    char error[256] = "";
    fuzz_require(ascc_train_context_create(&options, &train) == ASCC_OK);
    fuzz_require(ascc_context_create(NULL, &context) == ASCC_OK);
    const ascc_status status =
        ascc_train_initial_model(train, c->network, c->network_seed, bytes, sizeof bytes, &size);
    (void)ascc_train_context_message(train, error, sizeof error);
    fuzz_named(status, error);
    if (status == ASCC_OK) {
        fuzz_load(context, bytes, size, &model);
        fuzz_step_model(context, model);
    }
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    ascc_train_context_destroy(&train);
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
        if (config.network)
            begin(&config);
    } else {
        fuzz_require(error[0] != '\0');
    }
    ascc_train_config_free(&config);
    return 0;
}
