/* Texts: what a status means, which version runs, and the line about a failure; and public structs
 * of other sizes than ours. SPDX-License-Identifier: MIT */
#include "common.h"

#include <stdio.h>
#include <string.h>

/* A size above this was never a struct of ours but memory that nobody set. */
#define PLAUSIBLE_STRUCT_SIZE 4096

const char *ascc_status_text(ascc_status status)
{
    switch (status) {
    case ASCC_OK:
        return "ok";
    case ASCC_ERROR_ARGUMENT:
        return "argument not accepted";
    case ASCC_ERROR_MEMORY:
        return "out of memory";
    case ASCC_ERROR_FILE:
        return "file could not be opened, read or written";
    case ASCC_ERROR_FORMAT:
        return "content not understood";
    case ASCC_ERROR_NOT_FINITE:
        return "value not finite";
    case ASCC_ERROR_RANGE:
        return "value out of range";
    case ASCC_ERROR_MISMATCH:
        return "handles do not go together";
    case ASCC_ERROR_LIMIT:
        return "too many neighbours";
    }
    return "unknown status";
}

int32_t ascc_version(void)
{
    return ASCC_VERSION_MAJOR * 10000 + ASCC_VERSION_MINOR * 100 + ASCC_VERSION_PATCH;
}

/* ---- Text that a terminal may have ------------------------------------------------------------- */

/* Characters that move the cursor, end the line or turn the direction of writing. */
static bool controls(uint32_t code)
{
    return code < 0x20 || (code >= 0x7f && code < 0xa0) || code == 0x61c || code == 0x200e ||
           code == 0x200f || (code >= 0x2028 && code <= 0x202e) ||
           (code >= 0x2066 && code <= 0x2069);
}

/* Bytes of the well-formed UTF-8 character at c, if it controls nothing; else 0. */
static size_t printable(const unsigned char *c)
{
    static const uint32_t least[] = {0, 0, 0x80, 0x800, 0x10000}; /* by length */
    if (c[0] < 0x80)
        return controls(c[0]) ? 0 : 1;
    const size_t length = c[0] < 0xc2 ? 0 : c[0] < 0xe0 ? 2 : c[0] < 0xf0 ? 3 : c[0] < 0xf5 ? 4 : 0;
    uint32_t code = c[0] & (0x7fu >> length);
    for (size_t i = 1; i < length; i++) {
        if ((c[i] & 0xc0) != 0x80)
            return 0;
        code = code << 6 | (c[i] & 0x3fu);
    }
    if (code < least[length] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000))
        return 0;
    return controls(code) ? 0 : length;
}

void ascc_make_printable(char *text)
{
    unsigned char *c = (unsigned char *)text;
    while (*c != '\0') {
        const size_t length = printable(c);
        if (length == 0)
            *c = '?';
        c += length ? length : 1;
    }
}

/* Formats beside the message first: an argument may be the message itself. */
ascc_status ascc_fail(ascc_message *message, ascc_status status, const char *format, ...)
{
    char text[ASCC_MESSAGE_CAPACITY];
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(text, sizeof text, format, arguments) < 0)
        text[0] = '\0';
    va_end(arguments);
    ascc_make_printable(text); /* a path may hold anything, and the end may be cut */
    memcpy(message->text, text, sizeof text);
    return status;
}

static size_t struct_size(const void *from)
{
    size_t size;
    memcpy(&size, from, sizeof size);
    return size;
}

bool ascc_struct_is_known(const void *from, size_t first_size)
{
    const size_t size = struct_size(from);
    return size >= first_size && size <= PLAUSIBLE_STRUCT_SIZE;
}

bool ascc_read_struct(void *into, size_t into_size, const void *from, size_t first_size)
{
    const size_t size = struct_size(from);
    if (!ascc_struct_is_known(from, first_size))
        return false;
    const unsigned char *const bytes = from;
    for (size_t i = into_size; i < size; i++)
        if (bytes[i] != 0)
            return false;
    memset(into, 0, into_size);
    memcpy(into, from, ascc_min_size(size, into_size));
    return true;
}

bool ascc_write_struct(void *into, const void *from, size_t from_size, size_t first_size)
{
    const size_t size = struct_size(into);
    if (!ascc_struct_is_known(into, first_size))
        return false;
    memcpy(into, from, ascc_min_size(size, from_size));
    memcpy(into, &size, sizeof size);
    return true;
}
