/* Numbers in the host's arrays: float or double, at any distance from each other.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_ARRAYS_H
#define ASCC_ARRAYS_H

#include <string.h>

#include "common.h"

static inline bool ascc_scalar_known(ascc_scalar scalar)
{
    return scalar == ASCC_FLOAT || scalar == ASCC_DOUBLE;
}

static inline ptrdiff_t ascc_scalar_size(ascc_scalar scalar)
{
    return scalar == ASCC_DOUBLE ? (ptrdiff_t)sizeof(double) : (ptrdiff_t)sizeof(float);
}

static inline double ascc_scalar_read(const unsigned char *at, ascc_scalar scalar)
{
    if (scalar == ASCC_DOUBLE) {
        double value;
        memcpy(&value, at, sizeof value);
        return value;
    }
    float value;
    memcpy(&value, at, sizeof value);
    return (double)value;
}

static inline void ascc_scalar_write(unsigned char *at, ascc_scalar scalar, double value)
{
    if (scalar == ASCC_DOUBLE) {
        memcpy(at, &value, sizeof value);
        return;
    }
    const float narrow = (float)value;
    memcpy(at, &narrow, sizeof narrow);
}

/* Component c of a row of an array whose strides may be 0 = packed. */
static inline double ascc_array_read(const ascc_const_array *array, size_t row, size_t c,
                                     size_t components)
{
    const ptrdiff_t size = ascc_scalar_size(array->scalar);
    const ptrdiff_t across = array->component_stride ? array->component_stride : size;
    const ptrdiff_t down = array->stride ? array->stride : size * (ptrdiff_t)components;
    return ascc_scalar_read((const unsigned char *)array->data + (ptrdiff_t)row * down +
                                (ptrdiff_t)c * across,
                            array->scalar);
}

#endif
