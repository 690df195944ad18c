/* Tests of lib/base/sort.c against qsort. SPDX-License-Identifier: MIT */
#include "support/tools.h"

#include "base/sort.h"

/* ---- In place ---- */

static bool smaller_word(const void *context, const void *a, const void *b)
{
    (void)context;
    return *(const uint64_t *)a < *(const uint64_t *)b;
}

static int compare_words(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

static void any_words_are_sorted_and_their_neighbours_left(void **state)
{
    (void)state;
    dice d = {41};
    for (size_t count = 0; count < 70; count++)
        for (int kind = 0; kind < 4; kind++) { /* random, few values, ascending, descending */
            uint64_t word[72], want[72];
            for (size_t i = 0; i < 72; i++)
                word[i] = kind == 0   ? (uint64_t)dice_next(&d) << 32 | dice_next(&d)
                          : kind == 1 ? dice_next(&d) % 3
                          : kind == 2 ? i
                                      : 72 - i;
            memcpy(want, word, sizeof want);
            qsort(want + 1, count, sizeof *want, compare_words);
            ascc_heap_sort(word + 1, count, sizeof *word, smaller_word, NULL);
            assert_memory_equal(word, want, sizeof word);
        }
}

typedef struct pair {
    uint64_t key, row;
} pair;

static bool smaller_by_table(const void *context, const void *a, const void *b)
{
    const double *table = context;
    return table[*(const uint32_t *)a] < table[*(const uint32_t *)b];
}

static bool smaller_pair(const void *context, const void *a, const void *b)
{
    const pair *x = a, *y = b;
    assert_null(context);
    return x->key != y->key ? x->key < y->key : x->row < y->row;
}

static void elements_of_4_and_16_bytes_are_sorted_by_their_context(void **state)
{
    (void)state;
    dice d = {43};
    double table[200];
    uint32_t row[200];
    pair pairs[200];
    for (uint32_t i = 0; i < 200; i++) {
        table[i] = dice_uniform(&d, -1.0, 1.0);
        row[i] = i;
        pairs[i] = (pair){dice_next(&d) % 20, i};
    }
    ascc_heap_sort(row, 200, sizeof *row, smaller_by_table, table);
    ascc_heap_sort(pairs, 200, sizeof *pairs, smaller_pair, NULL);
    for (size_t i = 1; i < 200; i++) {
        assert_true(table[row[i - 1]] < table[row[i]]);
        assert_true(smaller_pair(NULL, &pairs[i - 1], &pairs[i]));
    }
}

/* ---- Keys ---- */

static int compare_pairs(const void *a, const void *b)
{
    return smaller_pair(NULL, a, b) ? -1 : 1;
}

static void keys_of_any_width_are_sorted_with_equal_ones_in_their_order(void **state)
{
    (void)state;
    dice d = {47};
    for (int bits = 1; bits <= 64; bits++) {
        test_tools t;
        tools_open(&t, 1 + bits % 3, 0);
        const size_t count = bits % 7 ? 500 : 20000; /* one part, or some */
        pair *want = calloc(count, sizeof *want);
        ascc_keys keys;
        assert_true(ascc_keys_lend(&keys, &t.arena, count, true));
        for (size_t i = 0; i < count; i++) {
            const uint64_t word =
                (uint64_t)dice_next(&d) << 33 ^ (uint64_t)dice_next(&d) << 11 ^ dice_next(&d) % 3;
            keys.key[i] = i % 3 ? word >> (64 - bits) : i % 2;
            keys.row[i] = (uint32_t)i;
            want[i] = (pair){keys.key[i], i};
        }
        qsort(want, count, sizeof *want, compare_pairs);
        assert_true(ascc_keys_sort(&keys, &t.arena, t.context->workers, bits));
        for (size_t i = 0; i < count; i++)
            assert_true(keys.key[i] == want[i].key && keys.row[i] == want[i].row);
        free(want);
        tools_close(&t);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(any_words_are_sorted_and_their_neighbours_left),
        cmocka_unit_test(elements_of_4_and_16_bytes_are_sorted_by_their_context),
        cmocka_unit_test(keys_of_any_width_are_sorted_with_equal_ones_in_their_order),
    };
    return cmocka_run_group_tests_name("sort", tests, NULL, NULL);
}
