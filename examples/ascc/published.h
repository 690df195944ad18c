/* The published pretrained networks as model files.
 * SPDX-License-Identifier: MIT
 *
 * Their metadata (format `ascc.weights`, made by examples/convert) describe the architecture partly in
 * numbers and partly in sentences. Every number is read from them, and a sentence that is not
 * understood, or that contradicts the rest, is refused.
 */
#ifndef ASCC_PUBLISHED_H
#define ASCC_PUBLISHED_H

#include <stdbool.h>
#include <stddef.h>

/* Bytes of a safetensors file of format `ascc.weights`. */
bool ascc_published_is(const unsigned char *bytes, size_t size);

/* The same tensors under the description of a model file (docs/file-format.md): from malloc. NULL with
 * one line in error[capacity] that names what is wrong. Whether each tensor fits the description is
 * left to ascc_model_load_memory. */
unsigned char *ascc_published_convert(const unsigned char *bytes, size_t size, size_t *converted,
                                      char *error, size_t capacity);

#endif
