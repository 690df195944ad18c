/* An allocator that counts what is out, fails when told to, and checks the sizes it is given back.
 * SPDX-License-Identifier: MIT */
#include "counting.h"

#include <stdlib.h>
#include <string.h>

/* Before each block lies its size. */
#define HEADER ASCC_ALIGNMENT

void *test_memory_allocate(void *user, size_t size, size_t alignment)
{
    test_memory *const memory = user;
    memory->calls++;
    if (alignment != ASCC_ALIGNMENT || size == 0)
        memory->faults++;
    void *block;
    if (memory->calls == memory->fail_at || size > SIZE_MAX - HEADER ||
        posix_memalign(&block, ASCC_ALIGNMENT, HEADER + size) != 0)
        return NULL;
    memory->blocks++;
    memory->bytes += size;
    memcpy(block, &size, sizeof size);
    unsigned char *const given = (unsigned char *)block + HEADER;
    memset(given, 0xa5, size); /* so that nobody relies on zeros */
    return given;
}

void test_memory_release(void *user, void *given, size_t size)
{
    test_memory *const memory = user;
    unsigned char *const block = (unsigned char *)given - HEADER;
    size_t asked;
    memcpy(&asked, block, sizeof asked);
    if (asked != size)
        memory->faults++;
    memory->blocks--;
    memory->bytes -= asked;
    free(block);
}

void *test_memory_reallocate(void *user, void *given, size_t old_size, size_t size,
                             size_t alignment)
{
    void *const moved = test_memory_allocate(user, size, alignment);
    if (moved == NULL)
        return NULL;
    memcpy(moved, given, ascc_min_size(old_size, size));
    test_memory_release(user, given, old_size);
    return moved;
}

ascc_allocator test_memory_allocator(test_memory *memory)
{
    return (ascc_allocator){test_memory_allocate, test_memory_reallocate, test_memory_release,
                            memory};
}

ascc_context_options test_memory_options(test_memory *memory)
{
    return (ascc_context_options){.size = sizeof(ascc_context_options),
                                  .allocate = test_memory_allocate,
                                  .reallocate = test_memory_reallocate,
                                  .release = test_memory_release,
                                  .user = memory};
}

bool test_memory_is_clean(const test_memory *memory)
{
    return memory->blocks == 0 && memory->bytes == 0 && memory->faults == 0;
}
