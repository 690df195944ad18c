/* Model files with one byte changed: none may crash, leak or break a promise.
 * SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fuzz/fuzz.h"
#include "fuzz/fuzz_model.h"
#include "support/model_builder.h"

/* Changes each byte to each of these. Frees the file. */
static void check_every_changed_byte(unsigned char *file, size_t size, const char *changes)
{
    uint8_t *input = malloc(size + 1);
    assert_non_null(input);
    input[0] = 'f';
    for (size_t i = 0; i < size; i++)
        input[i + 1] = file[i];
    for (size_t i = 1; i <= size; i++)
        for (size_t c = 0; c <= strlen(changes); c++) {
            const uint8_t kept = input[i];
            input[i] = (uint8_t)changes[c]; /* the last is 0 */
            LLVMFuzzerTestOneInput(input, size + 1);
            input[i] = kept;
        }
    free(input);
    free(file);
}

static void every_changed_byte_of_a_file_is_survived(void **state)
{
    (void)state;
    const model_random grid = {.channels = 4, .cells = 1, .output_cells = 2, .trunk_layers = 1};
    const model_random basis = {
        .channels = 4, .trunk_layers = 1, .bumps = 1, .levels = 2, .transfer = 2, .type = "F16"};
    size_t size;
    unsigned char *file = model_builder_random(&grid, &size);
    check_every_changed_byte(file, size, "\xff\"{9");
    file = model_builder_random(&basis, &size);
    check_every_changed_byte(file, size, "\xff\"{9");
}

static void every_changed_byte_of_a_graph_network_is_survived(void **state)
{
    (void)state;
    const model_random graph = {
        .channels = 4, .graph = 1, .history = 2, .plain = 1, .radius = 1.45};
    size_t size;
    unsigned char *file = model_builder_random(&graph, &size);
    check_every_changed_byte(file, size, "9");
}

static void every_changed_byte_of_set_abstractions_is_survived(void **state)
{
    (void)state;
    const model_random abstraction = {
        .channels = 4, .levels = 2, .method = "farthest", .abstraction = 1, .plain = 1};
    size_t size;
    unsigned char *file = model_builder_random(&abstraction, &size);
    check_every_changed_byte(file, size, "9");
}

static void every_changed_byte_of_a_published_network_is_survived(void **state)
{
    (void)state;
    size_t size;
    unsigned char *file = model_builder_dmcf(NULL, NULL, &size);
    check_every_changed_byte(file, size, "\xff\"{9");
}

int main(void)
{
    fuzz_model_runs = 0; /* what is read is the matter here */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_changed_byte_of_a_file_is_survived),
        cmocka_unit_test(every_changed_byte_of_a_graph_network_is_survived),
        cmocka_unit_test(every_changed_byte_of_set_abstractions_is_survived),
        cmocka_unit_test(every_changed_byte_of_a_published_network_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
