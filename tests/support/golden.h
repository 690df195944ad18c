/* Golden tensors: a safetensors file in memory and its values as doubles.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_GOLDEN_H
#define ASCC_TEST_GOLDEN_H

#include "file/safetensors.h"
#include "support/tools.h"

typedef struct golden {
    ascc_allocator allocator;
    unsigned char *bytes;
    size_t size;
    ascc_safetensors file;
} golden;

/* The folder of shared data: the environment's ASCC_SHARED, or the one beside the source. */
static inline const char *shared_path(char *path, size_t capacity, const char *name)
{
    const char *root = getenv("ASCC_SHARED");
    (void)snprintf(path, capacity, "%s/data/%s", root ? root : SOURCE_ROOT "/../shared", name);
    return path;
}

/* False, with a line that says so, where the file is not there. */
static inline bool golden_open(golden *g, const char *path)
{
    memset(g, 0, sizeof *g);
    FILE *f = fopen(path, "rb");
    if (!f) {
        print_message("SKIP: %s is not there\n", path);
        return false;
    }
    (void)fseek(f, 0, SEEK_END);
    g->size = (size_t)ftell(f);
    rewind(f);
    g->bytes = malloc(g->size);
    assert_int_equal(fread(g->bytes, 1, g->size, f), g->size);
    (void)fclose(f);
    g->allocator = ascc_allocator_default();
    ascc_message message = {""};
    if (ascc_safetensors_open(&g->allocator, g->bytes, g->size, &g->file, &message) != ASCC_OK)
        fail_msg("%s: %s", path, message.text);
    return true;
}

static inline void golden_close(golden *g)
{
    ascc_safetensors_close(&g->file);
    free(g->bytes);
}

static inline const ascc_tensor *golden_tensor(const golden *g, const char *name)
{
    const int32_t index = ascc_safetensors_find(&g->file, name);
    return index < 0 ? NULL : &g->file.tensor[index];
}

/* Values of a tensor of F32, F64, I32 or U8 as doubles; the caller's, from malloc. */
static inline double *golden_values(const golden *g, const char *name, size_t *count)
{
    const ascc_tensor *t = golden_tensor(g, name);
    if (!t)
        fail_msg("no tensor %s", name);
    double *values = malloc((t->count + 1) * sizeof *values);
    for (size_t i = 0; i < t->count; i++) {
        const unsigned char *at = t->data + i * t->element_size;
        if (strcmp(t->type, "F32") == 0) {
            float x;
            memcpy(&x, at, 4);
            values[i] = (double)x;
        } else if (strcmp(t->type, "F64") == 0) {
            memcpy(&values[i], at, 8);
        } else if (strcmp(t->type, "I32") == 0) {
            int32_t x;
            memcpy(&x, at, 4);
            values[i] = x;
        } else {
            assert_string_equal(t->type, "U8");
            values[i] = *at;
        }
    }
    if (count)
        *count = t->count;
    return values;
}

#endif
