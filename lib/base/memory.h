/* The caller's allocator, and the arena that a step takes its scratch from.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_MEMORY_H
#define ASCC_MEMORY_H

#include "common.h"

#define ASCC_ALIGNMENT 64

typedef struct ascc_allocator {
    void *(*allocate)(void *user, size_t size, size_t alignment);
    void *(*reallocate)(void *user, void *memory, size_t old_size, size_t size, size_t alignment);
    void (*release)(void *user, void *memory, size_t size);
    void *user;
} ascc_allocator;

/* The C library's allocator. */
ascc_allocator ascc_allocator_default(void);

/* count * element bytes, aligned; NULL when that does not fit or there is no memory. A count of
 * zero gives a valid pointer. release takes the same count and element. */
void *ascc_allocate(const ascc_allocator *allocator, size_t count, size_t element);
void ascc_release(const ascc_allocator *allocator, void *memory, size_t count, size_t element);

/* Makes room for `count` elements in an array that has room for *capacity; contents stay. Grows to
 * at least 1.5 times. False and unchanged when there is no memory. */
bool ascc_grow(const ascc_allocator *allocator, void **memory, size_t *capacity, size_t count,
               size_t element);

/*
 * Hands out aligned pieces: taken ones live until the next reset, or until what was taken since some point is
 * given back; lent ones until they are returned.
 *
 *   block:  [ taken | taken | taken |    free    | lent | lent ]    reset: all is free
 *   what does not fit goes into overflow blocks; reset replaces block and overflow by one block of
 *   1.125 times what was needed at once, so a steady user allocates nothing.
 */
typedef struct ascc_arena_overflow ascc_arena_overflow;

typedef struct ascc_arena {
    const ascc_allocator *allocator;
    unsigned char *block;
    size_t block_size;
    size_t front, back; /* of block: taken and lent */
    size_t taken, lent; /* overflow included */
    size_t needed;      /* the most of both together since the last reset */
    ascc_arena_overflow *taken_overflow, *lent_overflow;
    uint64_t pieces; /* in overflow blocks, so far */
} ascc_arena;

/* Where lending stood. */
typedef struct ascc_arena_mark {
    size_t back, lent;
    ascc_arena_overflow *overflow;
} ascc_arena_mark;

/* Where taking stood. */
typedef struct ascc_arena_point {
    size_t front, taken;
    uint64_t pieces;
} ascc_arena_point;

void ascc_arena_open(ascc_arena *arena, const ascc_allocator *allocator);
void ascc_arena_close(ascc_arena *arena);
/* count elements, not cleared; NULL when there is no memory. */
void *ascc_arena_take(ascc_arena *arena, size_t count, size_t element);
/* A taken piece, or NULL, with room for more elements; contents stay. The old piece is given back at
 * once only if it did not fit into the block or is the last in it. NULL and unchanged without memory. */
void *ascc_arena_grow(ascc_arena *arena, void *piece, size_t count, size_t grown, size_t element);
/* Gives back all that was taken since the point was read, and of pieces that have grown since then all of it. */
ascc_arena_point ascc_arena_point_of(const ascc_arena *arena);
void ascc_arena_drop(ascc_arena *arena, ascc_arena_point point);
/* Like take, but given back by return. */
void *ascc_arena_lend(ascc_arena *arena, size_t count, size_t element);
/* Gives back all that was lent since the mark was read; what was taken in between stays. */
ascc_arena_mark ascc_arena_mark_of(const ascc_arena *arena);
void ascc_arena_return(ascc_arena *arena, ascc_arena_mark mark);
/* Gives back everything handed out. Never fails: without memory for a larger block it keeps the
 * old. */
void ascc_arena_reset(ascc_arena *arena);
/* Makes the block at least this large, before anything is taken. False and unchanged without memory. */
bool ascc_arena_reserve(ascc_arena *arena, size_t size);
/* Bytes held now. */
size_t ascc_arena_size(const ascc_arena *arena);

#endif
