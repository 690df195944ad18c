/* A model file with initial weights, from the description of its network. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_INITIAL_MODEL_H
#define ASCC_TRAIN_INITIAL_MODEL_H

#include "base/memory.h"

/* Bytes of a file: data[size] in a block of `capacity`, released by the caller with it. */
typedef struct ascc_model_file {
    unsigned char *data;
    size_t size, capacity;
} ascc_model_file;

/* Every tensor that the description names, filled as its operation says (model/initial.h) with random numbers
 * that depend on the seed and the tensor's name alone. errors: FORMAT, MEMORY; nothing is held then. */
ascc_status ascc_initial_model_make(const ascc_allocator *allocator, const char *description,
                                    uint64_t seed, ascc_model_file *file, ascc_message *message);
void ascc_model_file_release(ascc_model_file *file, const ascc_allocator *allocator);

#endif
