/* The text of each status, failure messages, and structs that begin with their size.
 * SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "common.h"

const char *ascc_status_text(ascc_status status)
{
    switch (status) {
    case ASCC_OK:
        return "success";
    case ASCC_ERROR_ARGUMENT:
        return "an argument is not accepted";
    case ASCC_ERROR_MEMORY:
        return "out of memory";
    case ASCC_ERROR_FILE:
        return "a file could not be opened, read or written";
    case ASCC_ERROR_FORMAT:
        return "not a format this version understands";
    case ASCC_ERROR_NOT_FINITE:
        return "a number is not finite";
    case ASCC_ERROR_RANGE:
        return "a number is out of range";
    case ASCC_ERROR_MISMATCH:
        return "handles do not go together";
    case ASCC_ERROR_LIMIT:
        return "more neighbours than allowed";
    }
    return "unknown status";
}

int32_t ascc_version(void)
{
    return ASCC_VERSION_MAJOR * 10000 + ASCC_VERSION_MINOR * 100 + ASCC_VERSION_PATCH;
}

ascc_status ascc_fail(ascc_message *message, ascc_status status, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(message->text, sizeof message->text, format, arguments);
    va_end(arguments);
    return status;
}

bool ascc_read_struct(void *into, size_t into_size, const void *from, size_t first_size)
{
    size_t size;
    memcpy(&size, from, sizeof size);
    if (size < first_size || size > 65536)
        return false;
    const unsigned char *bytes = from;
    for (size_t i = into_size; i < size; i++)
        if (bytes[i])
            return false;
    memset(into, 0, into_size);
    memcpy(into, from, ascc_min_size(size, into_size));
    return true;
}

bool ascc_write_struct(void *into, const void *from, size_t from_size, size_t first_size)
{
    size_t size;
    memcpy(&size, into, sizeof size);
    if (size < first_size)
        return false;
    memcpy(into, from, ascc_min_size(size, from_size));
    memcpy(into, &size, sizeof size);
    return true;
}
