/* Aligned memory that free takes, for tests on Windows, which keeps it apart from the rest: all memory is aligned.
 * Included before everything else. SPDX-License-Identifier: MIT */
#ifndef BARE_WINDOWS_H
#define BARE_WINDOWS_H

#include <malloc.h>
#include <stdlib.h>
#include <string.h>

static inline void *bare_calloc(size_t count, size_t size)
{
    void *memory = _aligned_malloc(count * size + 1, 64);
    return memory ? memset(memory, 0, count * size) : NULL;
}

#define aligned_alloc(alignment, size) _aligned_malloc(size, alignment)
#define posix_memalign(memory, alignment, size)                                                    \
    ((*(memory) = _aligned_malloc(size, alignment)) == NULL)
#define malloc(size) _aligned_malloc(size, 64)
#define calloc(count, size) bare_calloc(count, size)
#define realloc(memory, size) _aligned_realloc(memory, size, 64)
#define free(memory) _aligned_free(memory)

#endif
