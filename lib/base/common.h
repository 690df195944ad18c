/* What every file uses: assertions, checked sizes, the floating point environment, and the line that
 * says what went wrong.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_COMMON_H
#define ASCC_COMMON_H

#include <assert.h>
#include <float.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

#include "float_env.h"

/* A build that keeps more digits between operations, or reorders them, would compute other bits and
 * not know it. meson.build sets the flags that cure this where there are some. */
#if FLT_EVAL_METHOD != 0
#error "float and double must be computed in their own precision (32-bit x86: -msse2 -mfpmath=sse)"
#endif
#if defined(__FAST_MATH__) || (defined(__FINITE_MATH_ONLY__) && __FINITE_MATH_ONLY__ > 0)
#error "libascc cannot be built with -ffast-math: results would not be the same everywhere"
#endif

#define ASCC_MESSAGE_CAPACITY 256

/* One line of text about the last failure of a handle. */
typedef struct ascc_message {
    char text[ASCC_MESSAGE_CAPACITY];
} ascc_message;

#if defined(__MINGW32__) && defined(__GNUC__) && !defined(__clang__)
#define ASCC_PRINTF(text, first) __attribute__((format(gnu_printf, text, first)))
#elif defined(__GNUC__)
#define ASCC_PRINTF(text, first) __attribute__((format(printf, text, first)))
#else
#define ASCC_PRINTF(text, first)
#endif

/* What a terminal would obey and not show, and what is no UTF-8, becomes '?'. */
void ascc_make_printable(char *text);

/* Writes the line, made printable, and returns the status, so that failures read:
 * return ascc_fail(m, status, ...) */
ascc_status ascc_fail(ascc_message *message, ascc_status status, const char *format, ...)
    ASCC_PRINTF(3, 4);

/* Reads a struct that begins with its size: copies what the caller has over zeros. Refuses one
 * smaller than `first_size` (the first released layout), or longer with a tail that is not zero. */
bool ascc_read_struct(void *into, size_t into_size, const void *from, size_t first_size);

/* Whether a struct that begins with its size is none smaller than the first released layout. */
bool ascc_struct_is_known(const void *from, size_t first_size);

/* The same for results: writes min(the caller's size, from_size) bytes and keeps the caller's size.
 */
bool ascc_write_struct(void *into, const void *from, size_t from_size, size_t first_size);

/* *result = a * b, false if it does not fit. */
static inline bool ascc_multiply_size(size_t a, size_t b, size_t *result)
{
    if (b != 0 && a > SIZE_MAX / b)
        return false;
    *result = a * b;
    return true;
}

static inline size_t ascc_min_size(size_t a, size_t b)
{
    return a < b ? a : b;
}

static inline size_t ascc_max_size(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* Most velocities of earlier steps that particles keep and models read. */
#define ASCC_MAX_HISTORY 8

#endif
