/* Networks to train: every variant describes a model that loads, of the size and the cost expected.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <ascc/train.h>

#include "architecture.h"
#include "model/cost.h"
#include "model/model.h"

static ascc_architecture some(int32_t dimension, ascc_architecture_family kernel)
{
    ascc_architecture a = ascc_architecture_default(dimension, kernel);
    (void)strcpy(a.name, "a \"test\"");
    a.spacing = 0.05;
    a.time_step = 0.02;
    a.channels = 8;
    return a;
}

/* A model file of random weights, from malloc, or a failure that says why not. */
static unsigned char *build(const ascc_architecture *a, size_t *size)
{
    char error[256] = "";
    ascc_train_context *train = NULL;
    char *text = ascc_architecture_describe(a, error, sizeof error);
    unsigned char *bytes = NULL;
    if (!text)
        fail_msg("%s", error);
    assert_int_equal(ascc_train_context_create(NULL, &train), ASCC_OK);
    if (ascc_train_initial_model(train, text, 5, NULL, 0, size) == ASCC_OK) {
        bytes = malloc(*size);
        assert_non_null(bytes);
        assert_int_equal(ascc_train_initial_model(train, text, 5, bytes, *size, size), ASCC_OK);
    }
    (void)ascc_train_context_message(train, error, sizeof error);
    ascc_train_context_destroy(&train);
    free(text);
    if (!bytes)
        fail_msg("%s", error);
    return bytes;
}

/* The model, or a failure that says why not. */
static ascc_model *load(ascc_context *context, const ascc_architecture *a)
{
    char error[256] = "";
    size_t size;
    ascc_model *model = NULL;
    unsigned char *bytes = build(a, &size);
    if (ascc_model_load_memory(context, bytes, size, &model) != ASCC_OK) {
        (void)ascc_context_message(context, error, sizeof error);
        fail_msg("dimension %d, kernel %d, levels %d, sampling %d: %s", a->dimension, a->kernel,
                 a->levels, a->sampling, error);
    }
    free(bytes);
    return model;
}

static void loads(ascc_context *context, const ascc_architecture *a)
{
    ascc_model *model = load(context, a);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_string_equal(info.name, a->name);
    assert_int_equal(info.dimension, a->dimension);
    assert_int_equal(info.conserves_momentum, a->output != ASCC_OUTPUT_PLAIN);
    ascc_model_destroy(&model);
}

static void test_every_variant_loads(void **state)
{
    ascc_context *context;
    (void)state;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    for (int32_t dimension = 2; dimension <= 3; dimension++)
        for (int kernel = 0; kernel < 2; kernel++)
            for (int32_t levels = 0; levels <= 3; levels++)
                for (int variant = 0; variant < 8; variant++) {
                    ascc_architecture a = some(dimension, (ascc_architecture_family)kernel);
                    a.levels = levels;
                    a.fine_layers = 5;
                    a.coarse_layers = 1 + (variant & 1);
                    if (variant & 2) {
                        a.output = ASCC_OUTPUT_PLAIN;
                        a.damping = a.radial = false;
                    }
                    a.advected = (variant & 4) != 0;
                    a.order = variant & 4 ? 2 : 1;
                    if (kernel == ASCC_FAMILY_BASIS && (variant & 3) == 1) {
                        a.impulse_limit = 0.15;
                        a.contact = 0.4;
                    }
                    for (int sampling = 0; sampling < 3; sampling++) {
                        a.sampling = (ascc_architecture_sampling)sampling;
                        loads(context, &a);
                    }
                }
    ascc_context_destroy(&context);
}

static void test_an_architecture_has_the_parameters_and_the_cost_worked_out_by_hand(void **state)
{
    ascc_context *context;
    ascc_architecture a = some(3, ASCC_FAMILY_BASIS);
    (void)state;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    a.levels = 1;
    a.coarse_channels[0] = 16;
    ascc_model *model = load(context, &a);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    const int first = 12 * 4 * 8 + 8 + 16 * 7 * 8;
    const int coarse = 8 * 16 + 7 * 16 + 12 * 16 * 16 + 16 + 16 * 16;
    const int fine = 2 * (12 * 8 * 8 + 8 + 8 * 8) + 16 * 8;
    assert_int_equal(info.parameter_count, first + coarse + fine + 4 * (4 * 8));

    /* One neighbour each, a fluid without walls, no coarse points: bumps reach 1 + (2/3)^3 times. */
    const ascc_cost_counts counts = {.fluid = 1.0};
    const double reach = 4.0 * (1.0 + 8.0 / 27.0), wall = 16.0 * 7 * 8;
    const double transfers = 8 * 8 + (8 * 16 + 16 * 8); /* down only the corners, up all */
    const double expected = 12 * 4 * 8 + wall + reach * 4 + 2 * (12 * 8 * 8 + 8 * 8 + reach * 8) +
                            transfers + 4 * (4 * 8);
    assert_true(fabs(ascc_cost(&model->plan, &counts) - expected) < 1e-9 * expected);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

static void test_the_ladder_stays_below_its_costs(void **state)
{
    static const struct {
        int32_t dimension, channels, levels, coarse[2];
        double most;
    } rungs[] = {{3, 16, 2, {24, 32}, 60000.0},
                 {3, 8, 1, {16, 0}, 15000.0},
                 {2, 16, 2, {16, 24}, 60000.0},
                 {2, 8, 1, {8, 0}, 15000.0}};
    ascc_context *context;
    (void)state;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    for (size_t i = 0; i < sizeof rungs / sizeof *rungs; i++) {
        ascc_architecture a = some(rungs[i].dimension, ASCC_FAMILY_BASIS);
        a.channels = rungs[i].channels;
        a.levels = rungs[i].levels;
        memcpy(a.coarse_channels, rungs[i].coarse, sizeof rungs[i].coarse);
        const ascc_cost_counts counts = ascc_cost_counts_default(a.dimension);
        ascc_model *model = load(context, &a);
        const double cost = ascc_cost(&model->plan, &counts);
        print_message("# rung %zu: %.0f multiply-adds\n", i, cost);
        assert_true(cost < rungs[i].most);
        ascc_model_destroy(&model);
    }
    ascc_context_destroy(&context);
}

static void refused(const ascc_architecture *a, const char *text)
{
    char error[128] = "";
    assert_null(ascc_architecture_describe(a, error, sizeof error));
    assert_non_null(strstr(error, text));
}

static void test_numbers_that_do_not_fit_are_refused_by_name(void **state)
{
    const ascc_architecture basis = some(3, ASCC_FAMILY_BASIS), grid = some(3, ASCC_FAMILY_GRID);
    (void)state;
    ascc_architecture a = basis;
    a.spacing = 0.0;
    refused(&a, "spacing");
    a = basis;
    a.levels = 4;
    refused(&a, "levels");
    a = basis;
    a.fine_layers = 1;
    refused(&a, "fine_layers");
    a = basis;
    a.bumps = 9;
    refused(&a, "bumps");
    a = basis;
    a.radial = true;
    refused(&a, "projection");
    a = basis;
    a.output = ASCC_OUTPUT_PLAIN;
    refused(&a, "damping");
    a.damping = false;
    a.contact = 0.4;
    refused(&a, "contact");
    a = basis;
    a.contact = 1.01 * a.wall_radius;
    refused(&a, "contact");
    a = basis;
    a.impulse_limit = -1.0;
    refused(&a, "impulse_limit");
    a = grid;
    a.contact = 0.4;
    refused(&a, "contact");
    a = grid;
    a.damping = true;
    refused(&a, "damping");
    a = grid;
    a.levels = 3;
    refused(&a, "fine_layers");
    a = grid;
    a.channels = 3;
    refused(&a, "channels");
    a = grid;
    a.output = ASCC_OUTPUT_PLAIN;
    refused(&a, "projection");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_variant_loads),
        cmocka_unit_test(test_an_architecture_has_the_parameters_and_the_cost_worked_out_by_hand),
        cmocka_unit_test(test_the_ladder_stays_below_its_costs),
        cmocka_unit_test(test_numbers_that_do_not_fit_are_refused_by_name),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
