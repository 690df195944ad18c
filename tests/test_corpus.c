/* Model files with one byte changed: none may crash, leak or break a promise.
 * SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "fuzz/fuzz.h"
#include "fuzz/fuzz_model.h"
#include "support/model_builder.h"

/* Frees the file. */
static void check_every_changed_byte(unsigned char *file, size_t size)
{
    static const uint8_t changes[] = {0x00, 0xff, '"', '{', '9'};
    uint8_t *input = malloc(size + 1);
    assert_non_null(input);
    input[0] = 'f';
    for (size_t i = 0; i < size; i++)
        input[i + 1] = file[i];
    for (size_t i = 1; i <= size; i++)
        for (size_t c = 0; c < sizeof changes; c++) {
            const uint8_t kept = input[i];
            input[i] = changes[c];
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
    check_every_changed_byte(file, size);
    file = model_builder_random(&basis, &size);
    check_every_changed_byte(file, size);
}

static void every_changed_byte_of_a_published_network_is_survived(void **state)
{
    (void)state;
    size_t size;
    unsigned char *file = model_builder_dmcf(NULL, NULL, &size);
    check_every_changed_byte(file, size);
}

int main(void)
{
    fuzz_model_runs = 0; /* what is read is the matter here */
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_changed_byte_of_a_file_is_survived),
        cmocka_unit_test(every_changed_byte_of_a_published_network_is_survived),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
