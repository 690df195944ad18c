/* Checks of the structs that say where a host's numbers lie. SPDX-License-Identifier: MIT */
#include "host_array.h"

ascc_status ascc_host_array_check(const char *name, const ascc_const_array *array,
                                  ascc_message *message)
{
    if (array == NULL)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: NULL", name);
    if ((array->scalar != ASCC_FLOAT && array->scalar != ASCC_DOUBLE) || array->reserved != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "%s: scalar %d, reserved %ld: not an array known here", name,
                         (int)array->scalar, (long)array->reserved);
    if (array->stride == 0 && array->component_stride != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "%s: component_stride is %lld, which needs a stride too", name,
                         (long long)array->component_stride);
    if (array->data == NULL)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: NULL", name);
    return ASCC_OK;
}

ascc_status ascc_host_array_open(const char *name, const ascc_const_array *array,
                                 int32_t components, ascc_host_array *opened, ascc_message *message)
{
    const ascc_status status = ascc_host_array_check(name, array, message);
    if (status != ASCC_OK)
        return status;
    const ptrdiff_t size = ascc_scalar_size(array->scalar);
    *opened = (ascc_host_array){
        .name = name,
        .data = array->data,
        .row = array->stride != 0 ? array->stride : components * size,
        .component = array->component_stride != 0 ? array->component_stride : size,
        .scalar = array->scalar,
    };
    return ASCC_OK;
}

ascc_host_array ascc_host_array_repeat(const char *name, const double *value)
{
    return (ascc_host_array){name, (const unsigned char *)value, 0, 0, ASCC_DOUBLE};
}
