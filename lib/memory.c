/* The only file that calls an allocator. SPDX-License-Identifier: MIT */
#include "memory.h"

#include <stdlib.h>
#include <string.h>

static void *default_allocate(void *user, size_t size, size_t alignment)
{
    (void)user;
    if (size > SIZE_MAX - alignment)
        return NULL;
    return aligned_alloc(alignment, (size + alignment - 1) / alignment * alignment);
}

static void *default_reallocate(void *user, void *memory, size_t old_size, size_t size,
                                size_t alignment)
{
    void *to = default_allocate(user, size, alignment); /* realloc does not keep the alignment */
    if (to) {
        memcpy(to, memory, ascc_min_size(old_size, size));
        free(memory);
    }
    return to;
}

static void default_release(void *user, void *memory, size_t size)
{
    (void)user;
    (void)size;
    free(memory);
}

ascc_allocator ascc_allocator_default(void)
{
    const ascc_allocator allocator = {default_allocate, default_reallocate, default_release, NULL};
    return allocator;
}

/* Bytes of an array, at least one alignment's worth; false if that does not fit. */
static bool array_size(size_t count, size_t element, size_t *size)
{
    if (!ascc_multiply_size(count, element, size) || *size > SIZE_MAX / 2)
        return false;
    *size = ascc_max_size(*size, ASCC_ALIGNMENT);
    return true;
}

void *ascc_allocate(const ascc_allocator *allocator, size_t count, size_t element)
{
    size_t size;
    if (!array_size(count, element, &size))
        return NULL;
    return allocator->allocate(allocator->user, size, ASCC_ALIGNMENT);
}

void ascc_release(const ascc_allocator *allocator, void *memory, size_t count, size_t element)
{
    size_t size;
    if (memory && array_size(count, element, &size))
        allocator->release(allocator->user, memory, size);
}

bool ascc_grow(const ascc_allocator *allocator, void **memory, size_t *capacity, size_t count,
               size_t element)
{
    size_t old_size = 0, size;
    if (*memory && count <= *capacity)
        return true;
    size_t wanted = ascc_max_size(count, *capacity + *capacity / 2);
    if (!array_size(wanted, element, &size)) {
        wanted = count;
        if (!array_size(wanted, element, &size))
            return false;
    }
    if (!*memory || !array_size(*capacity, element, &old_size)) {
        *memory = ascc_allocate(allocator, wanted, element);
        if (!*memory)
            return false;
        *capacity = wanted;
        return true;
    }
    void *moved = allocator->reallocate(allocator->user, *memory, old_size, size, ASCC_ALIGNMENT);
    if (!moved)
        return false;
    *memory = moved;
    *capacity = wanted;
    return true;
}

/* ---- Arena ---- */

struct ascc_arena_overflow {
    ascc_arena_overflow *next;
    size_t size; /* header included */
};

void ascc_arena_open(ascc_arena *arena, const ascc_allocator *allocator)
{
    memset(arena, 0, sizeof *arena);
    arena->allocator = allocator;
}

static void drop_overflow(ascc_arena *arena)
{
    while (arena->overflow) {
        ascc_arena_overflow *next = arena->overflow->next;
        ascc_release(arena->allocator, arena->overflow, arena->overflow->size, 1);
        arena->overflow = next;
    }
}

void ascc_arena_close(ascc_arena *arena)
{
    if (!arena->allocator)
        return;
    drop_overflow(arena);
    ascc_release(arena->allocator, arena->block, arena->block_size, 1);
    memset(arena, 0, sizeof *arena);
}

void *ascc_arena_take(ascc_arena *arena, size_t count, size_t element)
{
    size_t size;
    if (!array_size(count, element, &size) || size > SIZE_MAX / 4)
        return NULL;
    size = (size + ASCC_ALIGNMENT - 1) / ASCC_ALIGNMENT * ASCC_ALIGNMENT;
    arena->needed += size;
    if (arena->block && size <= arena->block_size - arena->used) {
        void *piece = arena->block + arena->used;
        arena->used += size;
        return piece;
    }
    ascc_arena_overflow *extra = ascc_allocate(arena->allocator, size + ASCC_ALIGNMENT, 1);
    if (!extra)
        return NULL;
    extra->next = arena->overflow;
    extra->size = size + ASCC_ALIGNMENT;
    arena->overflow = extra;
    return (unsigned char *)extra + ASCC_ALIGNMENT;
}

void ascc_arena_reset(ascc_arena *arena)
{
    arena->used = 0;
    if (arena->overflow) {
        drop_overflow(arena);
        const size_t size = arena->needed + arena->needed / 4;
        unsigned char *block = ascc_allocate(arena->allocator, size, 1);
        if (block) {
            ascc_release(arena->allocator, arena->block, arena->block_size, 1);
            arena->block = block;
            arena->block_size = size;
        }
    }
    arena->needed = 0;
}

size_t ascc_arena_size(const ascc_arena *arena)
{
    size_t size = arena->block_size;
    for (const ascc_arena_overflow *o = arena->overflow; o; o = o->next)
        size += o->size;
    return size;
}
