/* What the program says: lines that a terminal shows and never obeys, and whether they arrived.
 * SPDX-License-Identifier: MIT */
#include "console.h"

#include <errno.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

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

void ascc_printable(char *text)
{
    unsigned char *c = (unsigned char *)text;
    while (*c != '\0') {
        const size_t length = printable(c);
        if (length == 0)
            *c = '?';
        c += length ? length : 1;
    }
}

static bool muted;

void ascc_console_mute(void)
{
    muted = true;
}

void ascc_line(FILE *to, const char *format, ...)
{
    char text[16384]; /* longer lines are cut: a few paths fit */
    if (muted)
        return;
    va_list arguments;
    va_start(arguments, format);
    if (vsnprintf(text, sizeof text, format, arguments) < 0)
        text[0] = '\0';
    va_end(arguments);
    ascc_printable(text);
    (void)fputs(text, to);
    (void)fputc('\n', to);
}

int ascc_console_close(int status)
{
    errno = 0;
    const bool flushed = fflush(stdout) == 0;
    if (flushed && !ferror(stdout))
        return status;
    ascc_line(stderr, "ascc: standard output: %s", errno ? strerror(errno) : "not all was written");
    return status ? status : EXIT_FAILURE;
}
