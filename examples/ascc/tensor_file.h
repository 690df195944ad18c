/* Safetensors files as the program holds them: bytes, of which the header is JSON.
 * SPDX-License-Identifier: MIT
 *
 * A function that fails leaves one line in error[capacity], without the file's name.
 */
#ifndef ASCC_TENSOR_FILE_H
#define ASCC_TENSOR_FILE_H

#include <stddef.h>

#include <jansson.h>

/* A whole regular file: from malloc, NULL on failure. */
unsigned char *ascc_tensor_file_read(const char *path, size_t *size, char *error, size_t capacity);

/* The header of bytes[size], an object, and where tensor data begins. NULL on failure. */
json_t *ascc_tensor_file_header(const unsigned char *bytes, size_t size, size_t *data, char *error,
                                size_t capacity);

/* A text of the metadata; NULL = none. */
const char *ascc_tensor_file_metadata(const json_t *header, const char *key);

/* A file of this header and data[data_size]: from malloc, NULL = no memory. */
unsigned char *ascc_tensor_file_build(const json_t *header, const void *data, size_t data_size,
                                      size_t *size);

/* Makes text from a file fit for a terminal: what is no printable ASCII becomes '?'. Returns text. */
char *ascc_tensor_file_harmless(char *text);

#endif
