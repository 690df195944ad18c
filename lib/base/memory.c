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
    size_t size;     /* header included */
    uint64_t number; /* of all pieces of the arena: later ones are first in their list */
};

#define OVERFLOW_HEADER ((size_t)ASCC_ALIGNMENT)
_Static_assert(sizeof(ascc_arena_overflow) <= ASCC_ALIGNMENT, "the piece must stay aligned");

void ascc_arena_open(ascc_arena *arena, const ascc_allocator *allocator)
{
    *arena = (ascc_arena){.allocator = allocator};
}

static void *take_overflow(ascc_arena *arena, ascc_arena_overflow **list, size_t size)
{
    if (size > PTRDIFF_MAX - OVERFLOW_HEADER)
        return NULL;
    ascc_arena_overflow *const piece = ascc_allocate(arena->allocator, 1, OVERFLOW_HEADER + size);
    if (piece == NULL)
        return NULL;
    piece->next = *list;
    piece->size = OVERFLOW_HEADER + size;
    piece->number = arena->pieces++;
    *list = piece;
    return (unsigned char *)piece + OVERFLOW_HEADER;
}

/* Down to the piece that was first in the list then. */
static void release_overflow(ascc_arena *arena, ascc_arena_overflow **list,
                             const ascc_arena_overflow *then)
{
    while (*list != then) {
        ascc_arena_overflow *const piece = *list;
        *list = piece->next;
        ascc_release(arena->allocator, piece, 1, piece->size);
    }
}

static void release_all_overflow(ascc_arena *arena)
{
    release_overflow(arena, &arena->taken_overflow, NULL);
    release_overflow(arena, &arena->lent_overflow, NULL);
}

static void release_block(ascc_arena *arena)
{
    ascc_release(arena->allocator, arena->block, 1, arena->block_size);
    arena->block = NULL;
    arena->block_size = 0;
}

void ascc_arena_close(ascc_arena *arena)
{
    release_all_overflow(arena);
    release_block(arena);
    arena->front = arena->back = arena->taken = arena->lent = arena->needed = 0;
}

/* Bytes of a piece, in whole alignments. */
static bool piece_size(size_t count, size_t element, size_t *size)
{
    if (!array_size(count, element, size))
        return false;
    *size = (*size + ASCC_ALIGNMENT - 1) & ~(size_t)(ASCC_ALIGNMENT - 1);
    return true;
}

/* The part of the block that pieces fill from both ends. */
static size_t whole_block(const ascc_arena *arena)
{
    return arena->block_size & ~(size_t)(ASCC_ALIGNMENT - 1);
}

static void count_needed(ascc_arena *arena)
{
    arena->needed = ascc_max_size(arena->needed, arena->taken + arena->lent);
}

void *ascc_arena_take(ascc_arena *arena, size_t count, size_t element)
{
    size_t size;
    if (!piece_size(count, element, &size))
        return NULL;
    void *piece;
    if (size <= whole_block(arena) - arena->front - arena->back) {
        piece = arena->block + arena->front;
        arena->front += size;
    } else {
        piece = take_overflow(arena, &arena->taken_overflow, size);
    }
    if (piece == NULL)
        return NULL;
    arena->taken += size;
    count_needed(arena);
    return piece;
}

/* Gives an overflow piece back; false if it is none. */
static bool drop_overflow(ascc_arena *arena, const void *piece)
{
    ascc_arena_overflow **at = &arena->taken_overflow;
    while (*at != NULL && (unsigned char *)*at + OVERFLOW_HEADER != piece)
        at = &(*at)->next;
    ascc_arena_overflow *const found = *at;
    if (found == NULL)
        return false;
    *at = found->next;
    ascc_release(arena->allocator, found, 1, found->size);
    return true;
}

void *ascc_arena_grow(ascc_arena *arena, void *piece, size_t count, size_t grown, size_t element)
{
    size_t size = 0, more;
    if (piece == NULL)
        return ascc_arena_take(arena, grown, element);
    if (!piece_size(count, element, &size) || !piece_size(grown, element, &more))
        return NULL;
    const size_t needed = arena->needed;
    const bool last = size <= arena->front && piece == arena->block + (arena->front - size);
    if (last) {
        arena->front -= size;
        arena->taken -= size;
    }
    void *moved = ascc_arena_take(arena, grown, element);
    if (moved == NULL) {
        arena->front += last ? size : 0;
        arena->taken += last ? size : 0;
        return NULL;
    }
    if (moved != piece)
        memcpy(moved, piece, count * element);
    if (!last && drop_overflow(arena, piece)) {
        arena->taken -= size;
        arena->needed = needed;
        count_needed(arena);
    }
    return moved;
}

ascc_arena_point ascc_arena_point_of(const ascc_arena *arena)
{
    return (ascc_arena_point){arena->front, arena->taken, arena->pieces};
}

void ascc_arena_drop(ascc_arena *arena, ascc_arena_point point)
{
    while (arena->taken_overflow && arena->taken_overflow->number >= point.pieces) {
        ascc_arena_overflow *const piece = arena->taken_overflow;
        arena->taken_overflow = piece->next;
        ascc_release(arena->allocator, piece, 1, piece->size);
    }
    arena->front = ascc_min_size(arena->front, point.front);
    arena->taken = ascc_min_size(arena->taken, point.taken);
}

void *ascc_arena_lend(ascc_arena *arena, size_t count, size_t element)
{
    size_t size;
    if (!piece_size(count, element, &size))
        return NULL;
    void *piece;
    if (size <= whole_block(arena) - arena->front - arena->back) {
        arena->back += size;
        piece = arena->block + whole_block(arena) - arena->back;
    } else {
        piece = take_overflow(arena, &arena->lent_overflow, size);
    }
    if (piece == NULL)
        return NULL;
    arena->lent += size;
    count_needed(arena);
    return piece;
}

ascc_arena_mark ascc_arena_mark_of(const ascc_arena *arena)
{
    return (ascc_arena_mark){arena->back, arena->lent, arena->lent_overflow};
}

void ascc_arena_return(ascc_arena *arena, ascc_arena_mark mark)
{
    assert(mark.back <= arena->back && mark.lent <= arena->lent);
    release_overflow(arena, &arena->lent_overflow, mark.overflow);
    arena->back = mark.back;
    arena->lent = mark.lent;
}

bool ascc_arena_reserve(ascc_arena *arena, size_t size)
{
    assert(arena->taken == 0 && arena->lent == 0);
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
    release_all_overflow(arena);
    const size_t needed = arena->needed;
    arena->front = arena->back = arena->taken = arena->lent = arena->needed = 0;
    if (needed > arena->block_size)
        (void)ascc_arena_reserve(arena, needed + needed / 8); /* else the next step asks again */
}

size_t ascc_arena_size(const ascc_arena *arena)
{
    size_t size = arena->block_size;
    for (const ascc_arena_overflow *p = arena->taken_overflow; p != NULL; p = p->next)
        size += p->size;
    for (const ascc_arena_overflow *p = arena->lent_overflow; p != NULL; p = p->next)
        size += p->size;
    return size;
}
