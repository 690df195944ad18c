/* An allocator that counts what is held and fails one chosen call. SPDX-License-Identifier: MIT */
#ifndef FAILING_ALLOCATOR_H
#define FAILING_ALLOCATOR_H

#include <stddef.h>
#include <stdlib.h>
#include <string.h>

typedef struct failing_allocator {
    long calls;   /* made so far */
    long fail_at; /* this call gets NULL; 0 = none */
    long blocks;  /* held now */
    size_t bytes; /* held now, by the sizes given on allocation and on release */
} failing_allocator;

static inline void *failing_allocate(void *user, size_t size, size_t alignment)
{
    failing_allocator *a = user;
    if (++a->calls == a->fail_at)
        return NULL;
    void *memory = NULL;
    if (posix_memalign(&memory, alignment, size) != 0)
        return NULL;
    a->blocks++;
    a->bytes += size;
    return memory;
}

static inline void failing_release(void *user, void *memory, size_t size)
{
    failing_allocator *a = user;
    if (!memory)
        return;
    a->blocks--;
    a->bytes -= size;
    free(memory);
}

static inline void *failing_reallocate(void *user, void *memory, size_t old_size, size_t size,
                                       size_t alignment)
{
    void *moved = failing_allocate(user, size, alignment);
    if (moved && memory) {
        memcpy(moved, memory, old_size < size ? old_size : size);
        failing_release(user, memory, old_size);
    }
    return moved;
}

#endif
