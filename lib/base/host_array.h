/* Numbers in the host's arrays: float or double, at any distance from each other.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_HOST_ARRAY_H
#define ASCC_HOST_ARRAY_H

#include <string.h>

#include "common.h"

/* An array whose strides are known. Strides of zero repeat one number for ever. */
typedef struct ascc_host_array {
    const char *name; /* of the argument, for messages */
    const unsigned char *data;
    ptrdiff_t row, component; /* bytes from one to the next */
    ascc_scalar scalar;
} ascc_host_array;

/* Whether an array that a call may go without is not there. */
static inline bool ascc_host_array_is_absent(const ascc_const_array *array)
{
    return array == NULL || (array->data == NULL && array->reserved == 0);
}

/* Whether the host's struct is one known here; `name` is the argument's. ARGUMENT if not. */
ascc_status ascc_host_array_check(const char *name, const ascc_const_array *array,
                                  ascc_message *message);

/* Checks the struct and works out its strides, for rows of that many components. */
ascc_status ascc_host_array_open(const char *name, const ascc_const_array *array,
                                 int32_t components, ascc_host_array *opened,
                                 ascc_message *message);

/* One number for all rows and components; read when they are. */
ascc_host_array ascc_host_array_repeat(const char *name, const double *value);

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

static inline double ascc_host_array_read(const ascc_host_array *from, size_t row,
                                          int32_t component)
{
    return ascc_scalar_read(from->data + (ptrdiff_t)row * from->row + component * from->component,
                            from->scalar);
}

#endif
