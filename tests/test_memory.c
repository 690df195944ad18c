/* Tests of lib/memory.c: arrays, growth and the arena. SPDX-License-Identifier: MIT */
#include "support/test.h"

#include "support/counting.h"
#include "base/memory.h"

#include <string.h>

static bool is_aligned(const void *memory)
{
    return (uintptr_t)memory % ASCC_ALIGNMENT == 0;
}

static void an_array_comes_aligned_and_goes_back_with_its_size(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    double *const array = ascc_allocate(&allocator, 100, sizeof *array);
    assert_non_null(array);
    assert_true(is_aligned(array));
    assert_int_equal(memory.bytes, 100 * sizeof *array);
    ascc_release(&allocator, array, 100, sizeof *array);
    assert_true(test_memory_is_clean(&memory));
}

static void an_empty_array_has_an_address(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    void *const array = ascc_allocate(&allocator, 0, 8);
    assert_non_null(array);
    ascc_release(&allocator, array, 0, 8);
    ascc_release(&allocator, NULL, 5, 8);
    assert_true(test_memory_is_clean(&memory));
}

static void a_size_that_does_not_fit_is_no_memory(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    assert_null(ascc_allocate(&allocator, SIZE_MAX / 8 + 1, 8));
    assert_null(ascc_allocate(&allocator, SIZE_MAX, SIZE_MAX));
    assert_null(ascc_allocate(&allocator, SIZE_MAX / 2 + 1, 1));
    assert_int_equal(memory.calls, 0);
}

static void the_c_librarys_allocator_keeps_contents_when_it_grows(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    void *memory = NULL;
    size_t capacity = 0;
    for (size_t i = 0; i < 5000; i++) {
        assert_true(ascc_grow(&allocator, &memory, &capacity, i + 1, sizeof i));
        assert_true(is_aligned(memory));
        ((size_t *)memory)[i] = i;
    }
    for (size_t i = 0; i < 5000; i++)
        assert_int_equal(((size_t *)memory)[i], i);
    ascc_release(&allocator, memory, capacity, sizeof(size_t));
}

static void growing_one_by_one_takes_few_allocations(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    void *array = NULL;
    size_t capacity = 0;
    for (size_t count = 1; count <= 100000; count++)
        assert_true(ascc_grow(&allocator, &array, &capacity, count, 4));
    /* 1.5^n = 100000 for n = 28.4, and a few more while half of the capacity rounds down. */
    assert_in_range(memory.calls, 1, 32);
    ascc_release(&allocator, array, capacity, 4);
    assert_true(test_memory_is_clean(&memory));
}

static void growth_without_memory_changes_nothing(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    void *array = NULL;
    size_t capacity = 0;
    assert_true(ascc_grow(&allocator, &array, &capacity, 10, 4));
    memset(array, 7, 40);
    const void *const before = array;
    const size_t old = capacity;
    memory.fail_at = memory.calls + 1;
    assert_false(ascc_grow(&allocator, &array, &capacity, 1000, 4));
    assert_false(ascc_grow(&allocator, &array, &capacity, SIZE_MAX / 2, 4));
    assert_ptr_equal(array, before);
    assert_int_equal(capacity, old);
    assert_int_equal(((unsigned char *)array)[39], 7);
    assert_true(ascc_grow(&allocator, &array, &capacity, 5, 4)); /* enough already */
    assert_int_equal(capacity, old);
    ascc_release(&allocator, array, capacity, 4);
    assert_true(test_memory_is_clean(&memory));
}

/* Takes pieces of odd sizes, fills each with its number, and looks whether all stay so. */
static void take_and_check(ascc_arena *arena, size_t pieces)
{
    unsigned char *piece[40];
    for (size_t i = 0; i < pieces; i++) {
        piece[i] = ascc_arena_take(arena, 37 * i, 3);
        assert_non_null(piece[i]);
        assert_true(is_aligned(piece[i]));
        memset(piece[i], (int)i, 37 * i * 3);
    }
    for (size_t i = 0; i < pieces; i++)
        for (size_t k = 0; k < 37 * i * 3; k++)
            assert_int_equal(piece[i][k], i);
}

static void arena_pieces_do_not_overlap(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    assert_int_equal(memory.calls, 0);
    take_and_check(&arena, 20);
    ascc_arena_reset(&arena);
    take_and_check(&arena, 40); /* block and overflow */
    assert_int_equal(ascc_arena_size(&arena), memory.bytes);
    ascc_arena_close(&arena);
    assert_true(test_memory_is_clean(&memory));
}

static void a_steady_arena_allocates_nothing(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    take_and_check(&arena, 40);
    ascc_arena_reset(&arena);
    assert_int_equal(memory.blocks, 1); /* what was needed is one block now */
    const size_t calls = memory.calls;
    for (int turn = 0; turn < 10; turn++) {
        take_and_check(&arena, 40);
        ascc_arena_reset(&arena);
    }
    assert_int_equal(memory.calls, calls);
    ascc_arena_close(&arena);
    assert_int_equal(ascc_arena_size(&arena), 0);
    assert_true(test_memory_is_clean(&memory));
}

static void an_arena_lives_on_without_memory(void **state)
{
    (void)state;
    for (size_t n = 1;; n++) {
        test_memory memory = {.fail_at = n};
        const ascc_allocator allocator = test_memory_allocator(&memory);
        ascc_arena arena;
        ascc_arena_open(&arena, &allocator);
        size_t missing = 0;
        for (int turn = 0; turn < 3; turn++) {
            for (size_t i = 0; i < 5; i++)
                if (ascc_arena_take(&arena, 100 * (size_t)(turn + 1), 4) == NULL)
                    missing++;
            ascc_arena_reset(&arena);
        }
        assert_in_range(missing, 0, 1);
        const bool failed = memory.calls >= n;
        ascc_arena_close(&arena);
        assert_true(test_memory_is_clean(&memory));
        if (!failed)
            break;
    }
}

static void an_arena_refuses_sizes_that_do_not_fit(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    assert_null(ascc_arena_take(&arena, SIZE_MAX, 2));
    assert_null(ascc_arena_take(&arena, PTRDIFF_MAX, 1));
    assert_int_equal(memory.calls, 0);
    ascc_arena_reset(&arena);
    ascc_arena_close(&arena);
    assert_true(test_memory_is_clean(&memory));
}

static void what_is_lent_is_lent_again_after_its_return(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    for (int turn = 0; turn < 3; turn++) {
        unsigned char *const kept = ascc_arena_take(&arena, 100, 1);
        memset(kept, 1, 100);
        for (int k = 0; k < 50; k++) {
            const ascc_arena_mark mark = ascc_arena_mark_of(&arena);
            unsigned char *const first = ascc_arena_lend(&arena, 1000, 1);
            unsigned char *const between = ascc_arena_take(&arena, 10, 1);
            unsigned char *const second = ascc_arena_lend(&arena, 77, 3);
            assert_true(is_aligned(first) && is_aligned(between) && is_aligned(second));
            memset(first, 2, 1000);
            memset(between, 3, 10);
            memset(second, 4, 77 * 3);
            assert_int_equal(first[999], 2);
            assert_int_equal(between[9], 3);
            ascc_arena_return(&arena, mark);
        }
        assert_int_equal(kept[99], 1);
        /* 100 in 128, 50 times 10 in 64, and once 1000 in 1024 and 231 in 256; after the first turn
         * one block of an eighth more */
        assert_int_equal(arena.needed, 128 + 50 * 64 + 1024 + 256);
        ascc_arena_reset(&arena);
        assert_int_equal(memory.bytes, 4608 + 4608 / 8);
        assert_int_equal(ascc_arena_size(&arena), memory.bytes);
    }
    ascc_arena_close(&arena);
    assert_true(test_memory_is_clean(&memory));
}

static void a_piece_that_grows_keeps_its_contents_and_gives_back_the_rest(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    for (int turn = 0; turn < 3; turn++) {
        uint32_t *const other = ascc_arena_take(&arena, 64, 4);
        uint32_t *piece = NULL;
        size_t count = 0;
        for (size_t grown = 64; grown <= 64 * 8; grown *= 2) {
            piece = ascc_arena_grow(&arena, piece, count, grown, 4);
            assert_non_null(piece);
            for (size_t i = 0; i < count; i++)
                assert_int_equal(piece[i], i);
            for (size_t i = 0; i < grown; i++)
                piece[i] = (uint32_t)i;
            count = grown;
        }
        assert_int_equal(arena.taken, 64 * 4 + 64 * 8 * 4);
        memory.fail_at = memory.calls + 1;
        assert_null(ascc_arena_grow(&arena, piece, count, count * 100, 4));
        memory.fail_at = 0;
        assert_int_equal(arena.taken, 64 * 4 + 64 * 8 * 4);
        assert_int_equal(piece[count - 1], count - 1);
        assert_null(ascc_arena_grow(&arena, piece, count, SIZE_MAX, 4));
        (void)other;
        ascc_arena_reset(&arena);
        assert_int_equal(memory.bytes, 2304 + 2304 / 8);
    }
    ascc_arena_close(&arena);
    assert_true(test_memory_is_clean(&memory));
}

/* In overflow blocks at first, then in one block. */
static void what_was_taken_since_a_point_is_dropped(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_arena arena;
    ascc_arena_open(&arena, &allocator);
    for (int turn = 0; turn < 3; turn++) {
        unsigned char *const kept = ascc_arena_take(&arena, 100, 1);
        unsigned char *grown = ascc_arena_take(&arena, 64, 1);
        memset(kept, 1, 100);
        const ascc_arena_mark mark = ascc_arena_mark_of(&arena);
        unsigned char *const lent = ascc_arena_lend(&arena, 200, 1);
        memset(lent, 2, 200);
        const ascc_arena_point point = ascc_arena_point_of(&arena);
        for (int k = 0; k < 50; k++) {
            memset(ascc_arena_take(&arena, 1000, 1), 3, 1000);
            if (k == 0) {
                grown = ascc_arena_grow(&arena, grown, 64, 640, 1); /* goes with the rest */
                memset(grown, 4, 640);
            }
            ascc_arena_drop(&arena, point);
        }
        assert_int_equal(kept[99], 1);
        assert_int_equal(lent[199], 2);
        assert_true(arena.taken <= 128 + 64);
        assert_true(arena.needed <= 128 + 64 + 256 + 1024 + 640);
        assert_true(ascc_arena_size(&arena) < 4096);
        ascc_arena_return(&arena, mark);
        ascc_arena_reset(&arena);
    }
    ascc_arena_close(&arena);
    assert_true(test_memory_is_clean(&memory));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_array_comes_aligned_and_goes_back_with_its_size),
        cmocka_unit_test(an_empty_array_has_an_address),
        cmocka_unit_test(a_size_that_does_not_fit_is_no_memory),
        cmocka_unit_test(the_c_librarys_allocator_keeps_contents_when_it_grows),
        cmocka_unit_test(growing_one_by_one_takes_few_allocations),
        cmocka_unit_test(growth_without_memory_changes_nothing),
        cmocka_unit_test(arena_pieces_do_not_overlap),
        cmocka_unit_test(a_steady_arena_allocates_nothing),
        cmocka_unit_test(an_arena_lives_on_without_memory),
        cmocka_unit_test(what_is_lent_is_lent_again_after_its_return),
        cmocka_unit_test(a_piece_that_grows_keeps_its_contents_and_gives_back_the_rest),
        cmocka_unit_test(what_was_taken_since_a_point_is_dropped),
        cmocka_unit_test(an_arena_refuses_sizes_that_do_not_fit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
