/* Untrusted safetensors bytes to named, bounds-checked tensor views. SPDX-License-Identifier: MIT
 *
 *   [ 8 bytes: header length n, little-endian ][ n bytes: JSON ][ tensor data, little-endian ]
 *
 * Every byte after the header belongs to exactly one tensor.
 */
#ifndef ASCC_SAFETENSORS_H
#define ASCC_SAFETENSORS_H

#include "json.h"

#define ASCC_SAFETENSORS_MAX_HEADER ((size_t)16 << 20)
#define ASCC_SAFETENSORS_MAX_TENSORS 4096
#define ASCC_SAFETENSORS_MAX_RANK 8

typedef struct ascc_tensor {
    const char *name; /* the file's */
    const char *type; /* "F32", ... */
    size_t element_size;
    int32_t rank;
    int32_t reserved;
    size_t shape[ASCC_SAFETENSORS_MAX_RANK];
    size_t count;              /* of elements */
    size_t begin;              /* offset in the data, bytes */
    const unsigned char *data; /* [count * element_size], of any alignment */
} ascc_tensor;

typedef struct ascc_safetensors {
    ascc_json header;
    uint32_t metadata; /* index of its object in header; 0 = none */
    uint32_t reserved;
    ascc_tensor *tensor; /* in the order of their data */
    size_t tensor_count;
} ascc_safetensors;

/* The views point into data[size], which must outlive the file. errors: FORMAT, MEMORY; on error
 * nothing is held. */
ascc_status ascc_safetensors_open(const ascc_allocator *allocator, const void *data, size_t size,
                                  ascc_safetensors *file, ascc_message *message);
void ascc_safetensors_close(ascc_safetensors *file);

/* A text of __metadata__, NULL = none. */
const char *ascc_safetensors_metadata(ascc_safetensors *file, const char *key);
/* Index of the tensor with that name, -1 = none. */
int32_t ascc_safetensors_find(const ascc_safetensors *file, const char *name);

/* Its type is F32, F16 or BF16: what ascc_tensor_read_floats takes. */
bool ascc_tensor_is_float(const ascc_tensor *tensor);

/* values[count] = the tensor's, shorter floats widened exactly; errors: FORMAT when it is no float of
 * those or a value is not finite. */
ascc_status ascc_tensor_read_floats(const ascc_tensor *tensor, float *values,
                                    ascc_message *message);

#endif
