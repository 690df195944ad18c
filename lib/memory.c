/* The caller's allocator, and the arena that a step takes its scratch from.
 * SPDX-License-Identifier: MIT */
#include "memory.h"

#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#include <malloc.h>
#endif

/* ---- The C library's allocator --------------------------------------------------------------- */

/* posix_memalign takes any size, so that sanitizers see the very end of a block. */
static void *default_allocate(void *user, size_t size, size_t alignment)
{
    (void)user;
#if defined(_WIN32)
    return _aligned_malloc(size, alignment);
#else
    void *memory = NULL;
    return posix_memalign(&memory, alignment, size) == 0 ? memory : NULL;
#endif
}

static void default_release(void *user, void *memory, size_t size)
{
    (void)user;
    (void)size;
#if defined(_WIN32)
    _aligned_free(memory);
#else
    free(memory);
#endif
}

static void *default_reallocate(void *user, void *memory, size_t old_size, size_t size,
                                size_t alignment)
{
    void *const moved = default_allocate(user, size, alignment);
    if (moved != NULL) {
        memcpy(moved, memory, ascc_min_size(old_size, size));
        default_release(user, memory, old_size);
    }
    return moved;
}

ascc_allocator ascc_allocator_default(void)
{
    return (ascc_allocator){default_allocate, default_reallocate, default_release, NULL};
}

/* ---- Arrays ---------------------------------------------------------------------------------- */

/* Bytes of an array; a byte for an empty one, so that it has an address. */
static bool array_size(size_t count, size_t element, size_t *size)
{
    if (!ascc_multiply_size(count, element, size) || *size > PTRDIFF_MAX)
        return false;
    *size = ascc_max_size(*size, 1);
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
    if (memory != NULL && array_size(count, element, &size))
        allocator->release(allocator->user, memory, size);
}

bool ascc_grow(const ascc_allocator *allocator, void **memory, size_t *capacity, size_t count,
               size_t element)
{
    if (count <= *capacity)
        return true;
    size_t size, old_size, grown = *capacity + *capacity / 2;
    if (grown < count || !array_size(grown, element, &size))
        grown = count;
    if (!array_size(grown, element, &size))
        return false;

    void *moved;
    if (*memory == NULL || !array_size(*capacity, element, &old_size))
        moved = allocator->allocate(allocator->user, size, ASCC_ALIGNMENT);
    else
        moved = allocator->reallocate(allocator->user, *memory, old_size, size, ASCC_ALIGNMENT);
    if (moved == NULL)
        return false;
    *memory = moved;
    *capacity = grown;
    return true;
}

/* ---- Arena ----------------------------------------------------------------------------------- */

/* One piece that did not fit into the block; the piece follows this header. */
struct ascc_arena_overflow {
    ascc_arena_overflow *next;
    size_t size; /* header included */
};

#define OVERFLOW_HEADER ((size_t)ASCC_ALIGNMENT)
_Static_assert(sizeof(ascc_arena_overflow) <= ASCC_ALIGNMENT, "the piece must stay aligned");

void ascc_arena_open(ascc_arena *arena, const ascc_allocator *allocator)
{
    *arena = (ascc_arena){.allocator = allocator};
}

static void *take_overflow(ascc_arena *arena, size_t size)
{
    if (size > PTRDIFF_MAX - OVERFLOW_HEADER)
        return NULL;
    ascc_arena_overflow *const piece = ascc_allocate(arena->allocator, 1, OVERFLOW_HEADER + size);
    if (piece == NULL)
        return NULL;
    piece->next = arena->overflow;
    piece->size = OVERFLOW_HEADER + size;
    arena->overflow = piece;
    return (unsigned char *)piece + OVERFLOW_HEADER;
}

static void release_overflow(ascc_arena *arena)
{
    while (arena->overflow != NULL) {
        ascc_arena_overflow *const piece = arena->overflow;
        arena->overflow = piece->next;
        ascc_release(arena->allocator, piece, 1, piece->size);
    }
}

static void release_block(ascc_arena *arena)
{
    ascc_release(arena->allocator, arena->block, 1, arena->block_size);
    arena->block = NULL;
    arena->block_size = 0;
}

void ascc_arena_close(ascc_arena *arena)
{
    release_overflow(arena);
    release_block(arena);
    arena->used = arena->needed = 0;
}

void *ascc_arena_take(ascc_arena *arena, size_t count, size_t element)
{
    size_t size;
    if (!array_size(count, element, &size))
        return NULL;
    size = (size + ASCC_ALIGNMENT - 1) & ~(size_t)(ASCC_ALIGNMENT - 1);

    void *piece;
    if (size <= arena->block_size - arena->used) {
        piece = arena->block + arena->used;
        arena->used += size;
    } else {
        piece = take_overflow(arena, size);
    }
    if (piece != NULL)
        arena->needed += size;
    return piece;
}

bool ascc_arena_reserve(ascc_arena *arena, size_t size)
{
    assert(arena->used == 0 && arena->overflow == NULL);
    if (size <= arena->block_size)
        return true;
    unsigned char *const block = ascc_allocate(arena->allocator, 1, size);
    if (block == NULL)
        return false;
    release_block(arena);
    arena->block = block;
    arena->block_size = size;
    return true;
}

void ascc_arena_reset(ascc_arena *arena)
{
    release_overflow(arena);
    const size_t needed = arena->needed;
    arena->used = arena->needed = 0;
    if (needed > arena->block_size)
        (void)ascc_arena_reserve(arena, needed + needed / 8); /* else the next step asks again */
}

size_t ascc_arena_size(const ascc_arena *arena)
{
    size_t size = arena->block_size;
    for (const ascc_arena_overflow *piece = arena->overflow; piece != NULL; piece = piece->next)
        size += piece->size;
    return size;
}
