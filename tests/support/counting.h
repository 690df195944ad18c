/* An allocator that counts what is out, fails when told to, and checks the sizes it is given back.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_COUNTING_H
#define ASCC_TEST_COUNTING_H

#include "base/memory.h"

/* Zero is a good start. Not for several threads at once. */
typedef struct test_memory {
    size_t blocks, bytes; /* out now */
    size_t calls;         /* allocate and reallocate so far */
    size_t fail_at;       /* the call that gets no memory, counted from 1; 0 = none */
    size_t faults;        /* wrong sizes or alignments seen */
} test_memory;

/* Callbacks whose user pointer is a test_memory. */
void *test_memory_allocate(void *user, size_t size, size_t alignment);
void *test_memory_reallocate(void *user, void *memory, size_t old_size, size_t size,
                             size_t alignment);
void test_memory_release(void *user, void *memory, size_t size);

ascc_allocator test_memory_allocator(test_memory *memory);

/* Options of a context on this memory; all else is default. */
ascc_context_options test_memory_options(test_memory *memory);

/* Everything came back, and nothing was wrong. */
bool test_memory_is_clean(const test_memory *memory);

#endif
