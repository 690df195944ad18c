/* Reading and writing the host's strided arrays. SPDX-License-Identifier: MIT */
#ifndef ASCC_ARRAYS_H
#define ASCC_ARRAYS_H

#include <string.h>

#include "common.h"

/* Where component c of row i lies, for an array whose strides may be 0 = packed. */
static inline ptrdiff_t ascc_array_offset(ptrdiff_t stride, ptrdiff_t component_stride,
                                          ascc_scalar scalar, size_t row, size_t c,
                                          size_t components)
{
    const ptrdiff_t size =
        scalar == ASCC_DOUBLE ? (ptrdiff_t)sizeof(double) : (ptrdiff_t)sizeof(float);
    const ptrdiff_t across = component_stride ? component_stride : size;
    const ptrdiff_t down = stride ? stride : size * (ptrdiff_t)components;
    return (ptrdiff_t)row * down + (ptrdiff_t)c * across;
}

static inline double ascc_array_read(const ascc_const_array *array, size_t row, size_t c,
                                     size_t components)
{
    const unsigned char *at = (const unsigned char *)array->data +
                              ascc_array_offset(array->stride, array->component_stride,
                                                array->scalar, row, c, components);
    if (array->scalar == ASCC_DOUBLE) {
        double value;
        memcpy(&value, at, sizeof value);
        return value;
    }
    float value;
    memcpy(&value, at, sizeof value);
    return (double)value;
}

static inline void ascc_array_write(const ascc_array *array, size_t row, size_t c,
                                    size_t components, double value)
{
    unsigned char *at =
        (unsigned char *)array->data + ascc_array_offset(array->stride, array->component_stride,
                                                         array->scalar, row, c, components);
    if (array->scalar == ASCC_DOUBLE) {
        memcpy(at, &value, sizeof value);
        return;
    }
    const float rounded = (float)value;
    memcpy(at, &rounded, sizeof rounded);
}

#endif
