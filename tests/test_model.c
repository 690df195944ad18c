/* Models: what loads, what the plan then says, and that every wrong file is refused by name.
 * SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <math.h>

#include "model/model.h"
#include "network/column.h"
#include "network/operations.h"
#include "support/failing_allocator.h"
#include "support/model_builder.h"

#ifndef SOURCE_ROOT
#define SOURCE_ROOT "."
#endif

static ascc_context *context;
static char text[512];

static int open_context(void **state)
{
    (void)state;
    return ascc_context_create(NULL, &context) == ASCC_OK ? 0 : -1;
}

static int close_context(void **state)
{
    (void)state;
    ascc_context_destroy(&context);
    return 0;
}

/* Loads bytes from malloc and frees them. */
static ascc_status load(unsigned char *bytes, size_t size, ascc_model **model)
{
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    ascc_context_message(context, text, sizeof text);
    free(bytes);
    return status;
}

static ascc_model *must_load(unsigned char *bytes, size_t size)
{
    ascc_model *model = NULL;
    if (load(bytes, size, &model) != ASCC_OK)
        fail_msg("%s", text);
    return model;
}

/* Refused with a message that contains `hint`; `what` says which case it is. */
static void must_refuse(const char *what, unsigned char *bytes, size_t size, const char *hint)
{
    ascc_model *model = NULL;
    const ascc_status status = load(bytes, size, &model);
    if (status != ASCC_ERROR_FORMAT || !strstr(text, hint))
        fail_msg("%s: status %d, message '%s' without '%s'", what, (int)status, text, hint);
    assert_null(model);
}

static bool is_convolution(const ascc_term *term)
{
    return term->operation == &ascc_op_grid || term->operation == &ascc_op_basis;
}

static void must_have(const ascc_model *model, const float *weights, size_t count)
{
    const uintptr_t begin = (uintptr_t)model->weights;
    assert_true((uintptr_t)weights >= begin);
    assert_true((uintptr_t)(weights + count) <= begin + model->weight_count * sizeof(float));
    assert_int_equal((uintptr_t)weights % ASCC_ALIGNMENT, 0);
}

/* The whole kernel of an antisymmetric output as kernels read it, [cell][dimension][padded inputs]. */
static const float *packed_kernel(const ascc_model *model)
{
    return model->packed.term[model->plan.term_count];
}

static void check_packed_kernel(const ascc_model *model)
{
    const ascc_term *term = &model->plan.output.term;
    const size_t cells = ascc_cell_count(&term->filter);
    const size_t values = ascc_padded(term->inputs) * (size_t)model->plan.dimension;
    const float *kernel = packed_kernel(model);
    for (size_t c = 0; c < cells; c++)
        for (size_t v = 0; v < values; v++)
            assert_true(kernel[c * values + v] == -kernel[(cells - 1 - c) * values + v]);
}

/* Everything the solver relies on, for any plan. */
static void check_plan(const ascc_model *model)
{
    const ascc_plan *plan = &model->plan;
    for (int32_t i = 0; i < plan->layer_count; i++) {
        const ascc_layer *layer = &plan->layer[i];
        assert_in_range(layer->set, 0, ASCC_SET_LEVEL + plan->level_count - 2);
        assert_true(layer->term_count > 0);
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            const int32_t *cells = term->filter.cells;
            assert_in_range(term->source, 0, i + 1);
            assert_true(term->column + term->outputs <= layer->channels);
            if (is_convolution(term))
                must_have(model, term->tensor[ASCC_TENSOR_WEIGHT],
                          (size_t)(cells[0] * cells[1] * cells[2] * term->inputs * term->outputs));
            else if (term->operation != &ascc_op_identity)
                must_have(model, term->tensor[ASCC_TENSOR_WEIGHT],
                          (size_t)(term->inputs * term->outputs));
            else
                assert_null(term->tensor[ASCC_TENSOR_WEIGHT]);
            if (term->tensor[ASCC_TENSOR_BIAS])
                must_have(model, term->tensor[ASCC_TENSOR_BIAS], (size_t)term->outputs);
        }
    }
    const ascc_output *output = &plan->output;
    if (!output->conserves)
        return;
    if (output->term.filter.bumps) {
        must_have(model, output->term.tensor[ASCC_TENSOR_WEIGHT],
                  (size_t)(output->term.filter.bumps * output->term.inputs));
        assert_int_equal(output->central, 1);
        return;
    }
    const size_t stored = ascc_cell_count(&output->term.filter) / (output->half_axis < 0 ? 1 : 2);
    const size_t values = (size_t)output->term.inputs * (size_t)plan->dimension;
    must_have(model, output->term.tensor[ASCC_TENSOR_WEIGHT], stored * values);
    check_packed_kernel(model);
}

/* ---- What loads --------------------------------------------------------------------------------- */

static void random_models_of_all_shapes_load(void **state)
{
    (void)state;
    for (int i = 0; i < 2 * 3 * 2 * 2 * 2 * 2; i++) {
        const model_random options = {.seed = (uint64_t)i,
                                      .dimension = 2 + i % 2,
                                      .levels = 1 + i / 2 % 3,
                                      .plain = i / 6 % 2,
                                      .fluid_only = i / 12 % 2,
                                      .half_axis = i / 24 % 2 ? "y" : NULL,
                                      .bumps = i >= 48 ? 1 + i % 8 : 0,
                                      .order = i % 3,
                                      .transfer = i >= 48 && i % 3 != 2,
                                      .method = i % 3 == 0   ? "voxel_centers"
                                                : i % 3 == 1 ? "voxel_corners"
                                                             : "farthest",
                                      .boundary_crop = i % 5};
        size_t size;
        unsigned char *bytes = model_builder_random(&options, &size);
        ascc_model *model = must_load(bytes, size);
        check_plan(model);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
        assert_int_equal(info.dimension, options.dimension);
        assert_int_equal(info.level_count, options.levels);
        assert_int_equal(info.conserves_momentum, !options.plain);
        assert_int_equal(info.conserves_angular_momentum, !options.plain);
        assert_int_equal(info.advected, 0);
        assert_string_equal(info.name, "random");
        ascc_model_destroy(&model);
        assert_null(model);
    }
}

static void demonstration_models_are_antisymmetric_and_radial(void **state)
{
    (void)state;
    static const double spacings[] = {1e-3, 0.0125, 0.05, 1.0, 30.0};
    for (int dimension = 2; dimension <= 3; dimension++)
        for (size_t i = 0; i < sizeof spacings / sizeof *spacings; i++) {
            size_t size;
            unsigned char *bytes = model_builder_demo(dimension, spacings[i], &size);
            ascc_model *model = must_load(bytes, size);
            check_plan(model);
            ascc_model_info info = {.size = sizeof info};
            assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
            assert_int_equal(info.conserves_momentum, 1);
            assert_int_equal(info.advected, 1);
            /* Central impulses at advected positions: torque about those, not about the current. */
            assert_int_equal(model->plan.output.central, 1);
            assert_int_equal(info.conserves_angular_momentum, 0);
            assert_true(fabs(info.particle_spacing / spacings[i] - 1.0) < 1e-8);
            assert_true(fabs(info.support_radius / spacings[i] - 2.0) < 1e-8);
            assert_non_null(strstr(info.description, "not trained"));
            ascc_model_destroy(&model);
        }
    size_t size;
    assert_null(model_builder_demo(4, 0.05, &size));
    assert_null(model_builder_demo(2, 0.0, &size));
}

/* Half along `axis`, written out. */
static void halves_are_mirrored_along_each_axis(void **state)
{
    (void)state;
    for (int axis = 0; axis < 3; axis++) {
        static const char *const names[] = {"x", "y", "z"};
        const model_random options = {
            .dimension = 3, .half_axis = names[axis], .output_cells = 4, .channels = 4, .seed = 3};
        size_t size;
        unsigned char *bytes = model_builder_random(&options, &size);
        const size_t values = 4 * 3, stored_size = 4 * 4 * 2 * values;
        float *half = calloc(stored_size, sizeof *half);
        assert_non_null(half);
        memcpy(half, bytes + size - stored_size * sizeof *half, stored_size * sizeof *half);
        ascc_model *model = must_load(bytes, size);
        const float *full = packed_kernel(model);
        int shape[3] = {4, 4, 4}; /* x, y, z */
        shape[axis] = 2;
        for (int z = 0; z < 4; z++)
            for (int y = 0; y < 4; y++)
                for (int x = 0; x < 4; x++) {
                    int at[3] = {x, y, z};
                    const int upper = at[axis] >= 2;
                    if (!upper)
                        for (int a = 0; a < 3; a++)
                            at[a] = 3 - at[a];
                    at[axis] -= 2;
                    const int cell = (at[2] * shape[1] + at[1]) * shape[0] + at[0];
                    for (size_t v = 0; v < values; v++) {
                        const float stored = half[(size_t)cell * values + v];
                        const size_t whole = (size_t)((z * 4 + y) * 4 + x);
                        const float got = full[(whole * 3 + v % 3) * 8 + v / 3];
                        assert_true(got == (upper ? stored : -stored));
                    }
                }
        check_plan(model);
        free(half);
        ascc_model_destroy(&model);
    }
}

static void plan_says_what_the_file_says(void **state)
{
    (void)state;
    const model_random options = {.dimension = 2,
                                  .levels = 3,
                                  .channels = 8,
                                  .spacing = 0.5,
                                  .method = "voxel_corners",
                                  .anchor = "centroid",
                                  .evaluate = "advected_mean",
                                  .projection = "none",
                                  .window = "none",
                                  .mapping = "radial",
                                  .neighbor_limit = 64,
                                  .skip_self = 1,
                                  .boundary_crop = 16.0};
    size_t size;
    unsigned char *bytes = model_builder_random(&options, &size);
    ascc_model *model = must_load(bytes, size);
    const ascc_plan *plan = &model->plan;
    assert_int_equal(plan->advection, ASCC_ADVECT_MEAN);
    assert_true(plan->time_step == 0.005 && plan->gravity[1] == -9.8125);
    assert_true(plan->spacing == 0.5 && plan->rest_density == 1000.0);
    assert_true(plan->boundary_crop == 8.0 && plan->hysteresis == 0.1);
    assert_int_equal(plan->fluid_feature_count, 2);
    assert_int_equal(plan->fluid_features[1], ASCC_FEATURE_VELOCITY);
    assert_int_equal(plan->boundary_features[1], ASCC_FEATURE_NORMAL);
    assert_int_equal(plan->fluid_channels, 3);
    assert_int_equal(plan->boundary_channels, 3);
    assert_int_equal(plan->level_count, 3);
    assert_true(plan->level[1].voxel == 1.0 && plan->level[2].voxel == 2.0);
    assert_int_equal(plan->sampling, ASCC_SAMPLING_CORNERS);
    assert_int_equal(plan->centroid_anchor, 1);
    assert_int_equal(plan->layer_count, 5); /* l0; l1 on three levels; l2 on the particles */
    assert_string_equal(plan->layer[2].name, "l1.1");
    assert_int_equal(plan->layer[0].set, ASCC_SET_ALL);
    assert_int_equal(plan->layer[2].set, ASCC_SET_LEVEL);
    assert_int_equal(plan->layer[3].set, ASCC_SET_LEVEL + 1);

    const ascc_term *term = &plan->term[plan->layer[0].first_term + 1];
    assert_true(is_convolution(term));
    assert_int_equal(term->source, 1);
    assert_int_equal(term->rectify, 0);
    assert_int_equal(term->column, 2);
    assert_int_equal(term->inputs, 3);
    assert_int_equal(term->outputs, 2);
    assert_int_equal(term->filter.cells[0], 4);
    assert_int_equal(term->filter.cells[2], 1);
    assert_int_equal(term->filter.neighbor_limit, 64);
    assert_int_equal(term->filter.window, ASCC_WINDOW_NONE);
    assert_int_equal(term->filter.mapping, ASCC_MAPPING_RADIAL);
    assert_int_equal(term->filter.skip_self, 1);
    assert_true(term->filter.radius == 1.0);
    term = &plan->term[plan->layer[4].first_term + 2]; /* level 2 to the particles */
    assert_int_equal(term->source, 5);
    assert_int_equal(term->rectify, 1);
    assert_true(term->filter.radius == 4.0);
    assert_ptr_equal(plan->term[plan->layer[4].first_term + 4].operation, &ascc_op_identity);
    assert_int_equal(plan->output.conserves, 1);
    assert_int_equal(plan->output.term.source, 6);
    assert_int_equal(plan->output.term.rectify, 1);
    assert_int_equal(plan->output.central, 0);
    assert_int_equal(plan->output.term.inputs, 8);
    assert_int_equal(plan->output.term.filter.window, ASCC_WINDOW_PEAK);
    assert_int_equal(plan->output.term.filter.skip_self, 1);
    assert_true(plan->output.scale[0] == 0.005 && plan->output.scale[1] == 0.005 &&
                plan->output.scale[2] == 0.0);

    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(info.layer_count, 6);
    assert_int_equal(info.neighbor_limit, 64);
    assert_int_equal(info.conserves_momentum, 1);
    assert_int_equal(info.conserves_angular_momentum, 0);
    assert_true(info.support_radius == 1.0);
    /* Last layer 1, from level 2 4, to level 2 4, first layer 1: farther than what put the point
     * there, 2.2 sqrt 2. */
    assert_true(info.receptive_radius == 10.0);
    ascc_model_destroy(&model);
}

/* ---- Handles ------------------------------------------------------------------------------------ */

static void saved_again_is_byte_identical(void **state)
{
    (void)state;
    size_t size, kept_size, again_size;
    char path[] = "test_model_save_XXXXXX";
    unsigned char *bytes = model_builder_random(&(model_random){.levels = 2}, &size);
    unsigned char *copy = malloc(size);
    assert_non_null(copy);
    memcpy(copy, bytes, size);
    ascc_model *model = must_load(bytes, size), *again = NULL;
    const void *kept = ascc_model_bytes(model, &kept_size);
    assert_int_equal(kept_size, size);
    assert_memory_equal(kept, copy, size);
    const int file = mkstemp(path);
    assert_true(file >= 0);
    assert_int_equal(ascc_model_save(model, path), ASCC_OK);
    assert_int_equal(ascc_model_load(context, path, &again), ASCC_OK);
    assert_memory_equal(ascc_model_bytes(again, &again_size), copy, size);
    assert_int_equal(again_size, size);
    remove(path);
    ascc_model_destroy(&again);
    ascc_model_destroy(&model);
    free(copy);
}

/* Two folders of the test's own hold a file "findable.safetensors" each, or not. */
static void names_are_looked_for_in_order(void **state)
{
    (void)state;
    char folder[2][64] = {"test_find_a_XXXXXX", "test_find_b_XXXXXX"}, file[2][160], list[256];
    char path[4096] = "untouched", short_path[8] = "", wanted[128];
    for (int i = 0; i < 2; i++) {
        assert_non_null(mkdtemp(folder[i]));
        (void)snprintf(file[i], sizeof file[i], "%s/findable.safetensors", folder[i]);
        FILE *made = fopen(file[i], "wb");
        assert_non_null(made);
        fclose(made);
    }
    assert_int_equal(setenv("ASCC_MODEL_PATH", "", 1), 0);
    assert_int_equal(ascc_model_find(context, "findable", path, sizeof path), ASCC_ERROR_FILE);
    assert_string_equal(path, "untouched");
    ascc_context_message(context, text, sizeof text);
    assert_non_null(strstr(text, "'findable.safetensors'"));

    (void)snprintf(list, sizeof list, "/nowhere::%s:%s", folder[1], folder[0]);
    assert_int_equal(setenv("ASCC_MODEL_PATH", list, 1), 0);
    assert_int_equal(ascc_model_find(context, "findable", path, sizeof path), ASCC_OK);
    assert_string_equal(path, file[1]);
    remove(file[1]);
    assert_int_equal(ascc_model_find(context, "findable", path, sizeof path), ASCC_OK);
    assert_string_equal(path, file[0]);
    assert_int_equal(ascc_model_find(context, "findable.safetensors", path, sizeof path), ASCC_OK);
    assert_string_equal(path, file[0]);
    assert_int_equal(ascc_model_find(context, "findable", short_path, sizeof short_path),
                     ASCC_ERROR_ARGUMENT);
    assert_string_equal(short_path, "");
    (void)snprintf(wanted, sizeof wanted, "%.60s/findable", folder[0]);
    assert_int_equal(ascc_model_find(context, wanted, path, sizeof path), ASCC_OK);
    assert_string_equal(path, wanted); /* a path, whether there is a file or not */

    /* A file in the working directory has the last word; a folder of that name has none. */
    assert_int_equal(rename(file[0], "findable"), 0);
    assert_int_equal(ascc_model_find(context, "findable", path, sizeof path), ASCC_OK);
    assert_string_equal(path, "findable");
    remove("findable");
    assert_int_equal(ascc_model_find(context, folder[0], path, sizeof path), ASCC_ERROR_FILE);

    char long_name[5000];
    memset(long_name, 'x', sizeof long_name - 1);
    long_name[sizeof long_name - 1] = '\0';
    assert_int_equal(ascc_model_find(context, long_name, path, sizeof path), ASCC_ERROR_FILE);
    assert_int_equal(ascc_model_find(context, NULL, path, sizeof path), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_find(context, "x", NULL, 0), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_find(NULL, "x", path, sizeof path), ASCC_ERROR_ARGUMENT);
    assert_int_equal(unsetenv("ASCC_MODEL_PATH"), 0);
    for (int i = 0; i < 2; i++)
        remove(folder[i]);
}

static void arguments_and_paths_are_checked(void **state)
{
    (void)state;
    size_t size = 1;
    ascc_model *model = (ascc_model *)&size;
    assert_int_equal(ascc_model_load(NULL, "x", &model), ASCC_ERROR_ARGUMENT);
    assert_null(model);
    assert_int_equal(ascc_model_load(context, NULL, &model), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_load(context, "x", NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_load_memory(context, NULL, 0, &model), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_load_memory(NULL, "x", 1, &model), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_load(context, "no/such/file", &model), ASCC_ERROR_FILE);
    ascc_context_message(context, text, sizeof text);
    assert_non_null(strstr(text, "no/such/file"));
    assert_int_equal(ascc_model_load(context, ".", &model), ASCC_ERROR_FILE);
    assert_int_equal(ascc_model_load_memory(context, "", 0, &model), ASCC_ERROR_FORMAT);
    assert_null(model);
    ascc_model_destroy(NULL);
    ascc_model_destroy(&model);
    assert_int_equal(ascc_model_save(NULL, "x"), ASCC_ERROR_ARGUMENT);
    assert_null(ascc_model_bytes(NULL, &size));
    assert_int_equal(size, 0);

    unsigned char *bytes = model_builder_random(&(model_random){.dimension = 2}, &size);
    model = must_load(bytes, size);
    assert_int_equal(ascc_model_save(model, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_save(model, "no/such/folder/file"), ASCC_ERROR_FILE);
    ascc_model_info info = {.size = sizeof info - 8};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_get_info(model, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_model_get_info(NULL, &info), ASCC_ERROR_ARGUMENT);
    ascc_model_destroy(&model);
}

static void model_outlives_its_context(void **state)
{
    (void)state;
    ascc_context *own = NULL;
    ascc_model *model = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(&(model_random){.dimension = 3}, &size);
    assert_int_equal(ascc_context_create(NULL, &own), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(own, bytes, size, &model), ASCC_OK);
    memset(bytes, 0, size);
    free(bytes);
    ascc_context_destroy(&own);
    ascc_model *held = model;
    ascc_model_retain(held);
    ascc_model_destroy(&model);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(held, &info), ASCC_OK);
    check_plan(held);
    ascc_model_release(held);
}

typedef struct shaped {
    const char *name;
    int rank;
    size_t shape[5];
} shaped;

/* A network with tensors of the shapes that a table of docs/file-format.md states. */
static ascc_model *load_example(const char *network, const shaped *tensors, size_t count)
{
    static const float values[1024] = {1.0f};
    model_builder builder;
    model_builder_open(&builder);
    model_builder_metadata(&builder, "format", "ascc.model");
    model_builder_metadata(&builder, "version", "1");
    model_builder_metadata(&builder, "licence", "other keys are carried along");
    model_builder_metadata(&builder, "network", network);
    for (size_t i = 0; i < count; i++)
        model_builder_tensor(&builder, tensors[i].name, tensors[i].rank, tensors[i].shape, values);
    size_t size;
    unsigned char *bytes = model_builder_finish(&builder, &size);
    ascc_model *model = must_load(bytes, size);
    check_plan(model);
    assert_string_equal(model->plan.name, "example-2d");
    return model;
}

/* The next JSON text of the page, closed and on one line; *page moves behind it. */
static char *json_block(char **page)
{
    char *begin = strstr(*page, "```json\n");
    assert_non_null(begin);
    begin += 8;
    char *end = strstr(begin, "```");
    assert_non_null(end);
    *end = '\0';
    for (char *c = begin; *c != '\0'; c++)
        if (*c == '\n')
            *c = ' ';
    *page = end + 1;
    return begin;
}

static void documented_examples_load(void **state)
{
    (void)state;
    static const shaped grid[] = {{"l0.fluid.kernel", 5, {1, 4, 4, 3, 4}},
                                  {"l0.boundary.kernel", 5, {1, 4, 4, 3, 4}},
                                  {"l0.fluid.bias", 1, {4}},
                                  {"l0.boundary.bias", 1, {4}},
                                  {"l1.kernel", 5, {1, 4, 4, 8, 8}},
                                  {"l2.kernel", 5, {1, 4, 4, 8, 8}},
                                  {"l1.bias", 1, {8}},
                                  {"l2.bias", 1, {8}},
                                  {"l2.dense.bias", 1, {8}},
                                  {"l2.dense.weight", 2, {8, 8}},
                                  {"output.kernel", 5, {1, 3, 6, 8, 2}}};
    static const shaped basis[] = {{"l0.fluid.kernel", 4, {3, 3, 3, 4}},
                                   {"l0.boundary.kernel", 4, {4, 3, 3, 4}},
                                   {"l0.fluid.bias", 1, {4}},
                                   {"l0.boundary.bias", 1, {4}},
                                   {"down.weight", 2, {8, 8}},
                                   {"coarse.kernel", 4, {3, 3, 8, 8}},
                                   {"coarse.bias", 1, {8}},
                                   {"l1.up.weight", 2, {8, 8}},
                                   {"l1.up.bias", 1, {8}},
                                   {"l1.dense.weight", 2, {8, 8}},
                                   {"output.kernel", 2, {4, 8}}};
    static char page[1 << 16], whole[1 << 13];
    FILE *file = fopen(SOURCE_ROOT "/docs/file-format.md", "rb");
    assert_non_null(file);
    page[fread(page, 1, sizeof page - 1, file)] = '\0';
    fclose(file);
    char *at = page, *first = json_block(&at);
    ascc_model *model = load_example(first, grid, sizeof grid / sizeof *grid);
    ascc_model_destroy(&model);

    /* The second changes the last keys of the first. */
    const char *second = strstr(json_block(&at), "\"sampling\"");
    const char *changed = strstr(first, "\"sampling\"");
    assert_true(second && changed);
    snprintf(whole, sizeof whole, "%.*s%s", (int)(changed - first), first, second);
    model = load_example(whole, basis, sizeof basis / sizeof *basis);
    const ascc_plan *plan = &model->plan;
    assert_int_equal(plan->term[1].filter.bumps, 4);
    assert_int_equal(plan->term[1].filter.cells[0], 3);
    assert_int_equal(plan->term[1].filter.mapping, ASCC_MAPPING_DIRECTION);
    assert_ptr_equal(plan->term[2].operation, &ascc_op_transfer);
    assert_int_equal(plan->term[2].option[ASCC_OPTION_NORMALIZE], 1);
    assert_int_equal(plan->term[4].option[ASCC_OPTION_NORMALIZE], 0);
    assert_true(plan->term[4].option[ASCC_OPTION_VOXEL] == 0.04);
    assert_true(fabs(plan->term[4].filter.radius - 0.04 * sqrt(2.0)) < 1e-15);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(info.conserves_angular_momentum, 1);
    assert_int_equal(info.parameter_count, 108 + 144 + 8 + 64 + 576 + 8 + 64 + 8 + 64 + 32);
    ascc_model_destroy(&model);
}

/* ---- What is refused ---------------------------------------------------------------------------- */

static const char base_network[] =
    "{\"name\":\"n\",\"description\":\"d\",\"dimension\":2,\"time_step\":0.01,"
    "\"gravity\":[0,-9.81],\"particle_spacing\":0.05,\"rest_density\":1000,"
    "\"evaluate\":\"current\",\"boundary_crop\":0.5,"
    "\"features\":{\"fluid\":[\"one\",\"velocity\"],\"boundary\":[\"one\",\"normal\"]},"
    "\"levels\":[{\"voxel\":0.1}],\"sampling\":{\"method\":\"voxel_corners\","
    "\"anchor\":\"world\",\"hysteresis\":0.1},"
    "\"layers\":[{\"name\":\"a\",\"points\":\"all\",\"channels\":5,\"terms\":["
    "{\"type\":\"convolution\",\"source\":\"fluid\",\"kernel\":\"k\",\"bias\":\"kb\","
    "\"radius\":0.1,\"window\":\"poly6\",\"mapping\":\"volume\"},"
    "{\"type\":\"dense\",\"source\":\"boundary\",\"column\":2,\"weight\":\"w\"},"
    "{\"type\":\"identity\",\"source\":\"fluid\",\"column\":2,\"relu\":true}]},"
    "{\"name\":\"b\",\"points\":\"level1\",\"channels\":2,\"terms\":["
    "{\"type\":\"convolution\",\"source\":\"a\",\"relu\":true,\"kernel\":\"k2\","
    "\"radius\":0.2,\"window\":\"none\",\"mapping\":\"identity\",\"skip_self\":false,"
    "\"neighbor_limit\":9}]}],"
    "\"output\":{\"type\":\"antisymmetric\",\"source\":\"a\",\"kernel\":\"o\","
    "\"stored\":\"full\",\"radius\":0.1,\"window\":\"peak\",\"mapping\":\"volume\","
    "\"projection\":\"radial\",\"scale\":[0.01,0.02]}}";

/* Values 1, 2, 3 ...; the output kernel's second half is the negated mirror of its first. */
static void add_tensor(model_builder *builder, const char *name, int rank, const size_t *shape,
                       int antisymmetric)
{
    float values[1024];
    size_t count = 1;
    for (int i = 0; i < rank; i++)
        count *= shape[i];
    assert_true(count <= 1024);
    const size_t width = shape[rank - 1] * (rank > 1 ? shape[rank - 2] : 1);
    for (size_t i = 0; i < count; i++) {
        values[i] = (float)(i + 1);
        const size_t cell = i / width, cells = count / width;
        if (antisymmetric && cell >= cells / 2)
            values[i] = -values[(cells - 1 - cell) * width + i % width];
    }
    model_builder_tensor(builder, name, rank, shape, values);
}

/* The base file with the tensor `wrong` replaced by one of this shape (rank 0: left out). */
static unsigned char *build(const char *network, const char *wrong, int rank, const size_t *shape,
                            size_t *size)
{
    static const struct {
        const char *name;
        int rank;
        size_t shape[5];
    } tensors[] = {{"k", 5, {1, 3, 3, 3, 2}},
                   {"kb", 1, {2}},
                   {"w", 2, {3, 3}},
                   {"k2", 5, {1, 2, 2, 5, 2}},
                   {"o", 5, {1, 4, 4, 5, 2}}};
    model_builder builder;
    model_builder_open(&builder);
    model_builder_metadata(&builder, "format", "ascc.model");
    model_builder_metadata(&builder, "version", "1");
    model_builder_metadata(&builder, "network", network);
    for (size_t i = 0; i < sizeof tensors / sizeof *tensors; i++) {
        const int replaced = wrong && strcmp(wrong, tensors[i].name) == 0;
        if (!replaced)
            add_tensor(&builder, tensors[i].name, tensors[i].rank, tensors[i].shape,
                       tensors[i].name[0] == 'o');
        else if (rank > 0)
            add_tensor(&builder, wrong, rank, shape, 0);
    }
    return model_builder_finish(&builder, size);
}

static char *replaced(const char *whole, const char *from, const char *to)
{
    const char *found = strstr(whole, from);
    if (!found)
        fail_msg("'%s' is not in the base text", from);
    const size_t before = (size_t)(found - whole), size = strlen(whole) + strlen(to) + 1;
    char *result = malloc(size);
    assert_non_null(result);
    snprintf(result, size, "%.*s%s%s", (int)before, whole, to, found + strlen(from));
    return result;
}

static void base_network_loads(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = build(base_network, NULL, 0, NULL, &size);
    ascc_model *model = must_load(bytes, size);
    check_plan(model);
    assert_true(model->plan.output.scale[0] == 0.01 && model->plan.output.scale[1] == 0.02);
    assert_int_equal(model->plan.parameter_count, 54 + 2 + 9 + 40 + 160);
    assert_null(model->plan.term[1].tensor[ASCC_TENSOR_BIAS]);
    assert_true(model->plan.term[0].tensor[ASCC_TENSOR_BIAS][1] == 2.0f);
    ascc_model_destroy(&model);
}

static void cells_and_outputs_that_agree_with_the_tensors_load(void **state)
{
    (void)state;
    size_t size;
    char *cells = replaced(base_network, "\"kernel\":\"k\"",
                           "\"kernel\":\"k\",\"cells\":[3,3,1],\"outputs\":2");
    char *network = replaced(cells, "\"stored\":\"full\"",
                             "\"stored\":\"half\",\"half_axis\":\"y\",\"cells\":[4,8,1]");
    unsigned char *bytes = build(network, NULL, 0, NULL, &size);
    ascc_model *model = must_load(bytes, size);
    check_plan(model);
    assert_int_equal(model->plan.output.term.filter.cells[1], 8);
    ascc_model_destroy(&model);
    free(network);
    free(cells);
}

static void wrong_graph_networks_are_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"\"edges\":{\"points\":\"all\"", "\"edges\":{\"points\":\"level1\"", "'edges'"},
        {"\"history\":2", "\"history\":9", "'history'"},
        {"\"history\":2", "\"history\":0", "'history'"},
        {"\"history\":2", "\"history\":3",
         "'i.fluid.kernel' has the shape [7, 4], but must have [9, 4]"},
        {",\"history\":2", "", "'history' is 0, but the fluid has a feature 'history'"},
        {",\"history\"]", "]", "'history' is 2, but the fluid has no feature 'history'"},
        {"\"boundary\":[\"one\"", "\"boundary\":[\"history\"", "boundary"},
        {"\"edges\":{\"points\":\"all\"", "\"edges\":{\"points\":\"fluid\"", "'gather'"},
        {"\"edges\":{\"points\":\"all\"", "\"edges\":{\"limit\":3,\"points\":\"all\"", "'limit'"},
        {"\"edges\":{", "\"edges\":{\"radius\":0,", "'radius'"},
        {",\"layers\"", ",\"edges\":7,\"layers\"", "twice"},
        {"\"end\":\"sender\"", "\"end\":\"both\"", "'both'"},
        {",\"end\":\"sender\"", "", "'end'"},
        {"\"name\":\"a1\",\"points\":\"all\"", "\"name\":\"a1\",\"points\":\"edges\"", "'sum'"},
        {"\"name\":\"a1\",\"points\":\"all\"", "\"name\":\"a1\",\"points\":\"fluid\"", "'sum'"},
        {"\"name\":\"h1\",\"points\":\"edges\"", "\"name\":\"h1\",\"points\":\"all\"", "'gather'"},
        {"\"type\":\"displacement\",\"source\":\"fluid\"",
         "\"type\":\"displacement\",\"source\":\"boundary\"", "'displacement'"},
        {"\"name\":\"way\",\"points\":\"edges\"", "\"name\":\"way\",\"points\":\"all\"",
         "'displacement'"},
        {"\"name\":\"way\",\"points\":\"edges\",\"channels\":3",
         "\"name\":\"way\",\"points\":\"edges\",\"channels\":2", "columns"},
        {"\"offset\":\"m1.offset\"", "\"offset\":\"h1.kernel\"", "'h1.kernel' has the shape"},
        {",\"offset\":\"m1.offset\"", "", "'offset'"},
        {"\"source\":\"l0.0\",\"relu\":false", "\"source\":\"m1\",\"relu\":false", "output"},
        {"{\"type\":\"dense\",\"source\":\"i\"", "{\"type\":\"dense\",\"source\":\"way\"",
         "not made before"},
        {"{\"type\":\"identity\",\"source\":\"e0\"}", "{\"type\":\"identity\",\"source\":\"n0\"}",
         "shares no points"},
        {"{\"type\":\"displacement\",\"source\":\"fluid\"}",
         "{\"type\":\"moments\",\"source\":\"fluid\",\"radius\":1,\"basis\":{\"bumps\":1}}",
         "neither reads edges nor lies on them"},
    };
    char *description = model_builder_description('g');
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char *changed = replaced(description, cases[i].from, cases[i].to);
        size_t size;
        unsigned char *bytes = model_builder_described('g', changed, &size);
        must_refuse(cases[i].to, bytes, size, cases[i].hint);
        free(changed);
    }
    free(description);
}

static void wrong_descriptions_are_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        /* Text that is no JSON, or not the right kind. */
        {"{\"name\"", "[{\"name\"", "JSON"},
        {"\"name\":\"n\",", "\"name\":7,", "'name'"},
        {"\"name\":\"n\",", "", "'name' is missing"},
        {"\"name\":\"n\",", "\"name\":\"n\",\"nmae\":1,", "'nmae'"},
        {"\"name\":\"n\",", "\"name\":\"n\",\"name\":\"n\",", "twice"},
        {"\"n\",", "\"0123456789012345678901234567890123456789012345678901234567890123\",", "name"},
        {"\"d\",", "[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[", "deep"},
        /* The plan's own numbers. */
        {"\"dimension\":2", "\"dimension\":4", "'dimension'"},
        {"\"dimension\":2", "\"dimension\":2.5", "'dimension'"},
        {"\"dimension\":2", "\"dimension\":3", "'gravity'"},
        {"\"time_step\":0.01", "\"time_step\":0", "'time_step'"},
        {"\"time_step\":0.01", "\"time_step\":-1", "'time_step'"},
        {"\"time_step\":0.01", "\"time_step\":1e300", "'time_step'"},
        {"[0,-9.81]", "[0]", "'gravity'"},
        {"[0,-9.81]", "[0,\"down\"]", "'gravity'"},
        {"[0,-9.81]", "[0,1e99]", "'gravity'"},
        {"\"particle_spacing\":0.05", "\"particle_spacing\":-0.05", "'particle_spacing'"},
        {"\"rest_density\":1000,", "", "'rest_density'"},
        {"\"current\"", "\"sideways\"", "'sideways'"},
        {"\"boundary_crop\":0.5", "\"boundary_crop\":-1", "'boundary_crop'"},
        /* Features. */
        {"[\"one\",\"velocity\"]", "[\"one\",\"normal\"]", "fluid"},
        {"[\"one\",\"velocity\"]", "[\"one\",\"one\"]", "twice"},
        {"[\"one\",\"velocity\"]", "[\"one\",\"colour\"]", "'colour'"},
        {"[\"one\",\"velocity\"]", "[\"one\",1]", "fluid"},
        {"[\"one\",\"velocity\"]", "[]", "channels"},
        {"[\"one\",\"velocity\"]", "[\"one\"]",
         "'k' has the shape [1, 3, 3, 3, 2], but must have [1, 3, 3, 1, 2]"},
        {"[\"one\",\"normal\"]", "[\"one\",\"velocity\"]", "boundary"},
        {"\"boundary\":[\"one\",\"normal\"]", "\"wall\":[]", "'boundary'"},
        /* Levels and sampling. */
        {"\"levels\":[{\"voxel\":0.1}],", "", "'sampling'"},
        {"\"levels\":[{\"voxel\":0.1}]", "\"levels\":[]", "no such level"},
        {"[{\"voxel\":0.1}]", "[{\"voxel\":0}]", "'voxel'"},
        {"[{\"voxel\":0.1}]", "[{\"ratio\":0.5}]", "'voxel'"},
        {"[{\"voxel\":0.1}]", "[0.1]", "object"},
        {"[{\"voxel\":0.1}]", "[{\"voxel\":0.1,\"x\":1}]", "'x'"},
        {"[{\"voxel\":0.1}]",
         "[{\"voxel\":1},{\"voxel\":1},{\"voxel\":1},{\"voxel\":1},{\"voxel\":1},{\"voxel\":1},"
         "{\"voxel\":1},{\"voxel\":1}]",
         "more than 7"},
        {"\"voxel_corners\"", "\"dice\"", "'dice'"},
        {"\"voxel_corners\"", "\"farthest\"", "'anchor'"},
        {"\"voxel_corners\"", "\"voxel_centers\"", "'hysteresis'"},
        {"\"anchor\":\"world\",", "", "'anchor'"},
        {"\"hysteresis\":0.1", "\"hysteresis\":0.6", "'hysteresis'"},
        /* Layers. */
        {"\"name\":\"a\"", "\"name\":\"fluid\"", "reserved"},
        {"\"name\":\"a\"", "\"name\":\"all\"", "reserved"},
        {"\"name\":\"a\"", "\"name\":\"\"", "empty"},
        {"\"name\":\"b\"", "\"name\":\"a\"", "taken"},
        {"\"name\":\"a\"", "\"name\":\"a234567890123456789012345678901234567890\"", "layer"},
        {"\"points\":\"all\"", "\"points\":\"some\"", "'some'"},
        {"\"points\":\"level1\"", "\"points\":\"level2\"", "no such level"},
        {"\"points\":\"all\"", "\"points\":\"level1\"", "shares no points"},
        {"\"points\":\"all\"", "\"points\":\"boundary\"", "shares no points"},
        {"\"channels\":5", "\"channels\":4", "columns [2, 5)"},
        {"\"channels\":5", "\"channels\":0", "'channels'"},
        {"\"channels\":5", "\"channels\":1025", "'channels'"},
        {"\"channels\":5", "\"channels\":6", "but must have [1, 2, 2, 6, 2]: z, y, x, inputs"},
        {"\"channels\":2,\"terms\":[", "\"channels\":2,\"terms\":[],\"x\":[", "'x'"},
        /* Terms. */
        {"\"type\":\"convolution\"", "\"type\":\"attention\"", "'attention'"},
        {"\"source\":\"fluid\"", "\"source\":\"b\"", "'b'"},
        {"\"source\":\"fluid\"", "\"source\":\"a\"", "before"},
        {"\"source\":\"a\",\"relu\"", "\"source\":\"b\",\"relu\"", "before"},
        {"\"source\":\"fluid\",\"kernel\"", "\"source\":\"air\",\"kernel\"", "'air'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"none\"", "'none' is missing"},
        {"\"kernel\":\"k\"", "\"kernel\":\"w\"", "'w' has the shape [3, 3], but must"},
        {"\"bias\":\"kb\"", "\"bias\":\"w\"", "'w' has the shape [3, 3], but must"},
        {"\"bias\":\"kb\",", "", "'kb' is not used"},
        {"\"weight\":\"w\"", "\"weight\":\"w\",\"bias\":\"kb\"", "'kb' has the shape [2]"},
        {"\"weight\":\"w\"", "\"weight\":\"w\",\"radius\":1", "'radius'"},
        {"\"column\":2,\"relu\":true", "\"column\":3,\"relu\":true", "columns [3, 6)"},
        {"\"column\":2,\"relu\":true", "\"column\":-1,\"relu\":true", "'column'"},
        {"\"column\":2,\"relu\":true", "\"column\":2147483647,\"relu\":true", "columns"},
        {"\"column\":2,\"relu\":true", "\"column\":2,\"relu\":1", "'relu'"},
        {"\"radius\":0.1", "\"radius\":0", "'radius'"},
        {"\"radius\":0.1,", "", "'radius'"},
        {"\"window\":\"poly6\"", "\"window\":\"poly9\"", "'poly9'"},
        {"\"mapping\":\"volume\"", "\"mapping\":\"sphere\"", "'sphere'"},
        {"\"neighbor_limit\":9", "\"neighbor_limit\":-9", "'neighbor_limit'"},
        {"\"skip_self\":false", "\"skip_self\":null", "'skip_self'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"cells\":[3,4,1]",
         "'k' has the shape [1, 3, 3, 3, 2], but must have [1, 4, 3, 3, 2]"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"cells\":[3,3]", "'cells'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"cells\":[3,3,1.5]", "'cells'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"cells\":[3,3,0]", "'cells'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"outputs\":3",
         "'k' has the shape [1, 3, 3, 3, 2], but must have [1, 3, 3, 3, 3]"},
        {"\"kernel\":\"k\"", "\"kernel\":\"k\",\"outputs\":0", "'outputs'"},
        {"\"weight\":\"w\"", "\"weight\":\"w\",\"outputs\":2", "'w' has the shape [3, 3]"},
        {"\"weight\":\"w\"", "\"weight\":\"w\",\"cells\":[1,1,1]", "'cells'"},
        {"\"column\":2,\"relu\":true", "\"column\":2,\"outputs\":2", "'outputs' is 2"},
        /* The output. */
        {"\"stored\":\"full\"", "\"stored\":\"half\",\"half_axis\":\"y\",\"cells\":[4,9,1]",
         "not even"},
        {"\"stored\":\"full\"", "\"stored\":\"full\",\"cells\":[4,6,1]", "'o' has the shape"},
        {"\"stored\":\"full\"", "\"stored\":\"full\",\"outputs\":2", "'outputs'"},
        {"\"output\":{", "\"outputs\":{", "'output'"},
        {"\"type\":\"antisymmetric\"", "\"type\":\"symmetric\"", "'symmetric'"},
        {"\"type\":\"antisymmetric\"", "\"type\":\"plain\"", "output"},
        {"\"antisymmetric\",\"source\":\"a\"", "\"antisymmetric\",\"source\":\"b\"", "'fluid'"},
        {"\"antisymmetric\",\"source\":\"a\"", "\"antisymmetric\",\"source\":\"boundary\"",
         "'fluid'"},
        {"\"antisymmetric\",\"source\":\"a\"", "\"antisymmetric\",\"source\":\"c\"", "'c'"},
        {"\"antisymmetric\",\"source\":\"a\"", "\"antisymmetric\",\"source\":\"fluid\"",
         "'o' has the shape"},
        {"\"stored\":\"full\"", "\"stored\":\"quarter\"", "'quarter'"},
        {"\"stored\":\"full\"", "\"stored\":\"half\"", "'half_axis'"},
        {"\"stored\":\"full\"", "\"stored\":\"full\",\"half_axis\":\"x\"", "'half_axis'"},
        {"\"stored\":\"full\"", "\"stored\":\"half\",\"half_axis\":\"z\"", "along z"},
        {"\"projection\":\"radial\"", "\"projection\":\"axial\"", "'axial'"},
        {"[0.01,0.02]", "[0.01]", "'scale'"},
        {"[0.01,0.02]", "1e300", "'scale'"},
        {"[0.01,0.02]", "null", "'scale'"},
        {"[0.01,0.02]", "1,\"bias\":\"kb\"", "'bias'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        char *network = replaced(base_network, cases[i].from, cases[i].to);
        unsigned char *bytes = build(network, NULL, 0, NULL, &size);
        free(network);
        must_refuse(cases[i].to, bytes, size, cases[i].hint);
    }
}

/* The base network with its second layer in a basis, or a transfer, and a basis at the end. */
static void wrong_bases_and_transfers_are_refused_by_name(void **state)
{
    (void)state;
    static const char head[] =
        "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,-9.81],"
        "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"current\","
        "\"features\":{\"fluid\":[\"one\",\"velocity\"],\"boundary\":[]},"
        "\"levels\":[{\"voxel\":0.1}],\"sampling\":{\"method\":\"voxel_centers\","
        "\"anchor\":\"world\"},"
        "\"layers\":[{\"name\":\"a\",\"points\":\"fluid\",\"channels\":2,\"terms\":["
        "{\"type\":\"convolution\",\"source\":\"fluid\",\"kernel\":\"k\",\"radius\":0.1,"
        "\"basis\":{\"bumps\":3,\"order\":1}}]},"
        "{\"name\":\"b\",\"points\":\"level1\",\"channels\":2,\"terms\":["
        "{\"type\":\"transfer\",\"source\":\"a\",\"weight\":\"w\",\"normalize\":true}]}],"
        "\"output\":{\"type\":\"antisymmetric\",\"source\":\"a\",\"kernel\":\"o\","
        "\"radius\":0.1,\"basis\":{\"bumps\":4},\"scale\":[0.01,0.01]}}";
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"\"bumps\":3", "\"bumps\":0", "'bumps'"},
        {"\"bumps\":3", "\"bumps\":9", "'bumps'"},
        {"\"bumps\":3", "\"bumps\":2", "but must have [2, 3, 3, 2]: bumps, harmonics, inputs"},
        {"\"order\":1", "\"order\":3", "'order'"},
        {"\"order\":1", "\"order\":-1", "'order'"},
        {"\"order\":1", "\"order\":2", "but must have [3, 5, 3, 2]: bumps, harmonics, inputs"},
        {",\"order\":1", "", "'order'"},
        {"\"order\":1", "\"order\":1,\"width\":2", "'width'"},
        {"{\"bumps\":3,\"order\":1}", "3", "'basis'"},
        {"\"radius\":0.1,\"basis\"", "\"radius\":0.1,\"window\":\"peak\",\"basis\"", "'window'"},
        {"\"radius\":0.1,\"basis\"", "\"radius\":0.1,\"mapping\":\"volume\",\"basis\"",
         "'mapping'"},
        {",\"basis\":{\"bumps\":3,\"order\":1}", "", "'window'"},
        {"\"kernel\":\"k\"", "\"kernel\":\"w\"", "'w' has the shape [2, 2], but must"},
        {"[\"one\",\"velocity\"]", "[\"velocity\"]",
         "'k' has the shape [3, 3, 3, 2], but must have [3, 3, 2, 2]"},
        {"\"type\":\"transfer\"", "\"type\":\"dense\"", "'normalize'"},
        {"\"points\":\"level1\"", "\"points\":\"fluid\"", "transfer"},
        {"\"points\":\"level1\"", "\"points\":\"all\"", "transfer"},
        {"\"method\":\"voxel_centers\",\"anchor\":\"world\"", "\"method\":\"farthest\"", "'ratio'"},
        {"[{\"voxel\":0.1}],\"sampling\":{\"method\":\"voxel_centers\",\"anchor\":\"world\"}",
         "[{\"ratio\":0.5}],\"sampling\":{\"method\":\"farthest\"}", "'farthest'"},
        {"\"normalize\":true", "\"normalize\":1", "'normalize'"},
        {"\"normalize\":true", "\"radius\":1", "'radius'"},
        {"\"weight\":\"w\",", "", "'w' is not used"},
        {"\"weight\":\"w\"", "\"weight\":\"k\"", "but must have [2, 3]: inputs, outputs"},
        {"\"bumps\":4", "\"bumps\":4,\"order\":1", "'order'"},
        {"\"bumps\":4", "\"bumps\":3", "[4, 2], but must have [3, 2]"},
        {"\"kernel\":\"o\"", "\"kernel\":\"k\"", "but must have [4, 2]: bumps, inputs"},
        {"\"scale\":[0.01,0.01]", "\"scale\":[0.01,0.02]", "'scale'"},
        {"\"scale\"", "\"projection\":\"radial\",\"scale\"", "'projection'"},
        {"\"scale\"", "\"stored\":\"full\",\"scale\"", "'stored'"},
        {"\"name\":\"n\"", "\"name\":\"m\"", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        char *network = replaced(head, cases[i].from, cases[i].to);
        model_builder builder;
        model_builder_open(&builder);
        model_builder_metadata(&builder, "format", "ascc.model");
        model_builder_metadata(&builder, "version", "1");
        model_builder_metadata(&builder, "network", network);
        add_tensor(&builder, "k", 4, (const size_t[]){3, 3, 3, 2}, 0);
        add_tensor(&builder, "w", 2, (const size_t[]){2, 2}, 0);
        add_tensor(&builder, "o", 2, (const size_t[]){4, 2}, 0);
        unsigned char *bytes = model_builder_finish(&builder, &size);
        free(network);
        if (cases[i].hint) {
            must_refuse(cases[i].to, bytes, size, cases[i].hint);
            continue;
        }
        ascc_model *model = must_load(bytes, size); /* the last: it was right */
        check_plan(model);
        ascc_model_destroy(&model);
    }
}

/* Moments, sums on a lattice, and stencils over them. */
static const char trunk[] =
    "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,-9.81],"
    "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"advected\","
    "\"features\":{\"fluid\":[\"one\",\"motion\"],\"boundary\":[\"area\",\"normal\"]},"
    "\"levels\":[{\"voxel\":0.1},{\"voxel\":0.2}],\"sampling\":{\"method\":\"voxel_corners\","
    "\"anchor\":\"world\",\"hysteresis\":0,\"points\":\"fluid\"},\"layers\":["
    "{\"name\":\"sums\",\"points\":\"fluid\",\"channels\":12,\"terms\":[{\"type\":\"moments\","
    "\"source\":\"fluid\",\"radius\":0.1,\"basis\":{\"bumps\":1},"
    "\"walls\":{\"radius\":0.1,\"basis\":{\"bumps\":1}}}]},"
    "{\"name\":\"s0\",\"points\":\"level1\",\"channels\":6,\"terms\":[{\"type\":\"transfer\","
    "\"source\":\"fluid\"},{\"type\":\"transfer\",\"source\":\"boundary\",\"column\":3}]},"
    "{\"name\":\"l0\",\"points\":\"level1\",\"channels\":2,\"terms\":[{\"type\":\"stencil\","
    "\"source\":\"s0\",\"relative\":true,\"kernel\":\"k0\"}]},"
    "{\"name\":\"w0\",\"points\":\"level1\",\"channels\":2,\"terms\":[{\"type\":\"stencil\","
    "\"source\":\"l0\",\"relu\":true,\"kernel\":\"k1\",\"bias\":\"b1\"}]},"
    "{\"name\":\"h\",\"points\":\"fluid\",\"channels\":2,\"terms\":[{\"type\":\"dense\","
    "\"source\":\"sums\",\"weight\":\"hd\"},{\"type\":\"transfer\",\"source\":\"w0\"}]}],"
    "\"output\":{\"type\":\"antisymmetric\",\"source\":\"h\",\"relu\":true,\"kernel\":\"o\","
    "\"radius\":0.1,\"basis\":{\"bumps\":4},\"scale\":0.01}}";

static unsigned char *trunk_bytes(const char *network, size_t *size)
{
    model_builder builder;
    model_builder_open(&builder);
    model_builder_metadata(&builder, "format", "ascc.model");
    model_builder_metadata(&builder, "version", "1");
    model_builder_metadata(&builder, "network", network);
    add_tensor(&builder, "k0", 3, (const size_t[]){9, 8, 2}, 0);
    add_tensor(&builder, "k1", 3, (const size_t[]){9, 2, 2}, 0);
    add_tensor(&builder, "b1", 1, (const size_t[]){2}, 0);
    add_tensor(&builder, "hd", 2, (const size_t[]){12, 2}, 0);
    add_tensor(&builder, "o", 2, (const size_t[]){4, 2}, 0);
    return model_builder_finish(&builder, size);
}

static void wrong_moments_and_stencils_are_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        /* Bumps that do not agree with what reads them. */
        {"\"radius\":0.1,\"basis\":{\"bumps\":1},\"walls\"",
         "\"radius\":0.1,\"basis\":{\"bumps\":2},\"walls\"", "layer 'sums'"},
        {"\"walls\":{\"radius\":0.1,\"basis\":{\"bumps\":1}}",
         "\"walls\":{\"radius\":0.1,\"basis\":{\"bumps\":3}}", "layer 'sums'"},
        {"\"walls\":{\"radius\":0.1,\"basis\":{\"bumps\":1}}",
         "\"walls\":{\"radius\":0.1,\"basis\":{\"bumps\":9}}", "'bumps'"},
        {"\"basis\":{\"bumps\":4}", "\"basis\":{\"bumps\":5}", "[4, 2], but must have [5, 2]"},
        {"\"channels\":12", "\"channels\":18", "[12, 2], but must have [18, 2]"},
        /* What moments are of. */
        {"\"one\",\"motion\"", "\"one\",\"velocity\"", "with the feature 'motion'"},
        {"\"area\",\"normal\"", "\"area\",\"one\"", "the boundary's feature 'normal'"},
        {"\"type\":\"moments\",\"source\":\"fluid\"",
         "\"type\":\"moments\",\"source\":\"boundary\"", "'moments' are of 'fluid'"},
        /* Stencils across levels, and on what is no lattice. */
        {"{\"name\":\"w0\",\"points\":\"level1\"", "{\"name\":\"w0\",\"points\":\"level2\"",
         "layer 'w0': a stencil reads the level that it lies on"},
        {"{\"name\":\"w0\",\"points\":\"level1\"", "{\"name\":\"w0\",\"points\":\"fluid\"",
         "layer 'w0': a stencil reads the level that it lies on"},
        {"\"hysteresis\":0,", "\"hysteresis\":0.1,", "without hysteresis"},
        {"\"world\"", "\"centroid\"", "at the world's origin"},
        {"\"voxel_corners\",\"anchor\":\"world\",\"hysteresis\":0",
         "\"voxel_centers\",\"anchor\":\"world\"", "levels of 'voxel_corners'"},
        {"\"source\":\"s0\",\"relative\":true", "\"source\":\"s0\",\"relu\":true,\"relative\":true",
         "layer 'l0': a 'relative' stencil reads mass, momentum, walls and normals, 6 channels"},
        {"\"kernel\":\"k1\"", "\"kernel\":\"k0\"",
         "but must have [9, 2, 2]: taps, inputs, outputs"},
        {"\"dimension\":2", "\"dimension\":3", "'gravity'"},
        /* Lattices that are too fine, and levels that are not there. */
        {"[{\"voxel\":0.1},", "[{\"voxel\":0.0249},",
         "a lattice of 0.0249 m is finer than half a particle spacing"},
        {"{\"voxel\":0.1},", "{},", "'voxel'"},
        {"[{\"voxel\":0.1},{\"voxel\":0.2}]", "[]", "layer 's0': no such level"},
        {"{\"name\":\"l0\",\"points\":\"level1\"", "{\"name\":\"l0\",\"points\":\"level3\"",
         "layer \'l0\': no such level"},
        {"\"name\":\"n\"", "\"name\":\"m\"", NULL},
        {"[{\"voxel\":0.1},", "[{\"voxel\":0.025},", NULL}, /* half a spacing is not too fine */
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        char *network = replaced(trunk, cases[i].from, cases[i].to);
        unsigned char *bytes = trunk_bytes(network, &size);
        free(network);
        if (cases[i].hint) {
            must_refuse(cases[i].to, bytes, size, cases[i].hint);
            continue;
        }
        ascc_model *model = must_load(bytes, size);
        ascc_model_destroy(&model);
    }
}

static void wrong_motions_dampings_and_walls_are_refused_by_name(void **state)
{
    (void)state;
    static const char head[] =
        "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,-9.81],"
        "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"advected\","
        "\"features\":{\"fluid\":[\"one\",\"motion\"],\"boundary\":[\"motion\",\"normal\"]},"
        "\"layers\":[{\"name\":\"a\",\"points\":\"fluid\",\"channels\":2,\"terms\":["
        "{\"type\":\"convolution\",\"source\":\"fluid\",\"kernel\":\"k\",\"radius\":0.1,"
        "\"basis\":{\"bumps\":3,\"order\":1},\"relative\":true},"
        "{\"type\":\"convolution\",\"source\":\"boundary\",\"kernel\":\"b\",\"radius\":0.1,"
        "\"basis\":{\"bumps\":2,\"order\":0},\"relative\":true}]}],"
        "\"output\":{\"type\":\"antisymmetric\",\"source\":\"a\",\"relu\":true,\"kernel\":\"o\","
        "\"radius\":0.1,\"basis\":{\"bumps\":4},\"scale\":0.01,\"direction\":\"current\","
        "\"damping\":\"d\",\"walls\":{\"kernel\":\"wk\",\"damping\":\"wd\",\"radius\":0.12,"
        "\"basis\":{\"bumps\":5}}}}";
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"[\"one\",\"motion\"]", "[\"one\",\"velocity\"]", "motion"},
        {"[\"motion\",\"normal\"]", "[\"one\",\"one\"]", "twice"},
        {"[\"motion\",\"normal\"]", "[\"normal\",\"normal\"]", "twice"},
        {"\"motion\",\"normal\"", "\"motion\",\"velocity\"", "boundary"},
        {"\"motion\",\"normal\"", "\"motion\",\"gravity\"", "boundary"},
        {"\"points\":\"fluid\"", "\"points\":\"all\"", "'relative'"},
        {"\"relative\":true", "\"relative\":1", "'relative'"},
        {"\"relative\":true", "\"relativ\":true", "'relativ'"},
        {"\"direction\":\"current\"", "\"direction\":\"advected\"", "'direction'"},
        {"\"relu\":true,", "", "'relu'"},
        {"\"damping\":\"d\"", "\"damping\":\"gone\"", "'gone'"},
        {"\"damping\":\"d\"", "\"damping\":\"wd\"", "[5, 2], but must have [4, 2]"},
        {"\"damping\":\"d\"", "\"damping\":\"negative\"", "'negative'"},
        {"\"damping\":\"d\",", "", "'d' is not used"},
        {"\"damping\":\"wd\",", "", "'wd' is not used"},
        {"\"kernel\":\"wk\",", "", "'kernel'"},
        {"\"kernel\":\"wk\"", "\"kernel\":\"o\"", "[4, 2], but must have [5, 2]"},
        {"\"radius\":0.12,", "", "'radius'"},
        {"\"radius\":0.12", "\"radius\":0", "'radius'"},
        {"\"bumps\":5", "\"bumps\":9", "'bumps'"},
        {"\"bumps\":5", "\"bumps\":5,\"order\":1", "'order'"},
        {"\"radius\":0.12,\"basis\":{\"bumps\":5}",
         "\"radius\":0.12,\"window\":\"peak\",\"mapping\":\"volume\"", "basis"},
        {"\"radius\":0.12", "\"radius\":0.12,\"scale\":1", "'scale'"},
        {"\"radius\":0.12", "\"radius\":0.12,\"contact\":-0.01", "'contact'"},
        {"\"radius\":0.12", "\"radius\":0.12,\"contact\":0.13", "'contact'"},
        {"\"radius\":0.12", "\"radius\":0.12,\"limit\":0.01", "'limit'"},
        {"\"damping\":\"d\"", "\"damping\":\"d\",\"limit\":0", "'limit'"},
        {"\"damping\":\"d\"", "\"damping\":\"d\",\"limit\":[1]", "'limit'"},
        {"{\"kernel\":\"wk\",\"damping\":\"wd\",\"radius\":0.12,\"basis\":{\"bumps\":5}}", "true",
         "'walls'"},
        {"\"name\":\"n\"", "\"name\":\"m\"", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        char *network = replaced(head, cases[i].from, cases[i].to);
        const int negative = strstr(network, "negative") != NULL;
        float damping[8] = {0.0f, 0.5f, 1.0f, 0.0f, 0.0f, 2.0f, 0.0f, negative ? -1e-9f : 0.0f};
        model_builder builder;
        model_builder_open(&builder);
        model_builder_metadata(&builder, "format", "ascc.model");
        model_builder_metadata(&builder, "version", "1");
        model_builder_metadata(&builder, "network", network);
        add_tensor(&builder, "k", 4, (const size_t[]){3, 3, 3, 2}, 0);
        add_tensor(&builder, "b", 4, (const size_t[]){2, 1, 4, 2}, 0);
        add_tensor(&builder, "o", 2, (const size_t[]){4, 2}, 0);
        model_builder_tensor(&builder, negative ? "negative" : "d", 2, (const size_t[]){4, 2},
                             damping);
        add_tensor(&builder, "wk", 2, (const size_t[]){5, 2}, 0);
        add_tensor(&builder, "wd", 2, (const size_t[]){5, 2}, 0);
        unsigned char *bytes = model_builder_finish(&builder, &size);
        free(network);
        if (cases[i].hint) {
            must_refuse(cases[i].to, bytes, size, cases[i].hint);
            continue;
        }
        ascc_model *model = must_load(bytes, size); /* the last: it was right */
        const ascc_output *output = &model->plan.output;
        must_have(model, output->term.tensor[ASCC_TENSOR_DAMPING], 8);
        must_have(model, output->term.tensor[ASCC_TENSOR_WALL], 10);
        must_have(model, output->term.tensor[ASCC_TENSOR_WALL_DAMPING], 10);
        assert_true(output->term.tensor[ASCC_TENSOR_DAMPING][5] == 2.0f &&
                    output->term.tensor[ASCC_TENSOR_WALL_DAMPING][9] == 10.0f);
        assert_true(output->has_walls && output->current_direction);
        assert_true(model->plan.term[0].option[ASCC_OPTION_RELATIVE] &&
                    model->plan.term[1].option[ASCC_OPTION_RELATIVE]);
        ascc_model_destroy(&model);
    }
}

static void wrong_abstractions_and_interpolations_are_refused_by_name(void **state)
{
    (void)state;
    static const char head[] =
        "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,-9.81],"
        "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"current\","
        "\"features\":{\"fluid\":[\"one\",\"velocity\"],\"boundary\":[]},"
        "\"levels\":[{\"ratio\":0.5}],\"sampling\":{\"method\":\"farthest\"},"
        "\"layers\":[{\"name\":\"a\",\"points\":\"level1\",\"channels\":2,\"terms\":["
        "{\"type\":\"set_abstraction\",\"source\":\"fluid\",\"radius\":0.1,\"pool\":\"maximum\","
        "\"hidden\":4,\"hidden_weight\":\"h\",\"hidden_bias\":\"hb\",\"weight\":\"w\",\"bias\":"
        "\"b\","
        "\"neighbor_limit\":9}]},"
        "{\"name\":\"c\",\"points\":\"fluid\",\"channels\":2,\"terms\":["
        "{\"type\":\"interpolation\",\"source\":\"a\",\"nearest\":3,\"radius\":0.2,"
        "\"weight\":\"u\"}]}],"
        "\"output\":{\"type\":\"plain\",\"source\":\"c\",\"scale\":0.01}}";
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"\"radius\":0.1", "\"radius\":0", "'radius'"},
        {"\"radius\":0.1,", "", "'radius'"},
        {"\"pool\":\"maximum\"", "\"pool\":\"sum\"", "'pool'"},
        {"\"pool\":\"maximum\",", "", "'pool'"},
        {"\"hidden\":4", "\"hidden\":0", "'hidden'"},
        {"\"hidden\":4", "\"hidden\":1025", "'hidden'"},
        {"\"hidden\":4,", "", "'hidden'"},
        {"\"hidden\":4", "\"hidden\":5", "'w' has the shape [4, 2], but must have [5, 2]: hidden"},
        {"\"hidden_weight\":\"h\",", "", "'hidden_weight'"},
        {"\"hidden_bias\":\"hb\",", "", "'hidden_bias'"},
        {"\"hidden_bias\":\"hb\"", "\"hidden_bias\":\"b\"",
         "'b' has the shape [2], but must have [4]"},
        {"\"weight\":\"w\",", "", "'weight'"},
        {"\"bias\":\"b\",", "", "'bias'"},
        {"\"bias\":\"b\"", "\"bias\":\"gone\"", "'gone' is missing"},
        {"\"one\",\"velocity\"", "\"velocity\"",
         "'h' has the shape [5, 4], but must have [4, 4]: inputs + dimension"},
        {"\"neighbor_limit\":9", "\"neighbor_limit\":-1", "limit"},
        {"\"neighbor_limit\":9", "\"relative\":true", "'relative'"},
        {"\"points\":\"level1\",\"channels\":2,\"terms\":[{\"type\":\"set_abstraction\"",
         "\"points\":\"fluid\",\"channels\":2,\"terms\":[{\"type\":\"set_abstraction\","
         "\"relative\":true",
         "no 'neighbor_limit'"},
        {"\"neighbor_limit\":9", "\"skip_self\":true", "'skip_self'"},
        {"\"nearest\":3", "\"nearest\":0", "'nearest'"},
        {"\"nearest\":3", "\"nearest\":65", "'nearest'"},
        {"\"nearest\":3,", "", "'nearest'"},
        {"\"radius\":0.2", "\"radius\":-1", "'radius'"},
        {"\"weight\":\"u\"", "\"weight\":\"w\"", "[4, 2], but must have [2, 2]"},
        {"\"weight\":\"u\"", "\"normalize\":true", "'normalize'"},
        {",\"weight\":\"u\"", "", "'u' is not used"},
        {"\"name\":\"c\",\"points\":\"fluid\"", "\"name\":\"c\",\"points\":\"level1\"",
         "from one point set to another"},
        {"\"name\":\"n\"", "\"name\":\"m\"", NULL},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        char *network = replaced(head, cases[i].from, cases[i].to);
        model_builder builder;
        model_builder_open(&builder);
        model_builder_metadata(&builder, "format", "ascc.model");
        model_builder_metadata(&builder, "version", "1");
        model_builder_metadata(&builder, "network", network);
        add_tensor(&builder, "h", 2, (const size_t[]){5, 4}, 0);
        add_tensor(&builder, "hb", 1, (const size_t[]){4}, 0);
        add_tensor(&builder, "w", 2, (const size_t[]){4, 2}, 0);
        add_tensor(&builder, "b", 1, (const size_t[]){2}, 0);
        add_tensor(&builder, "u", 2, (const size_t[]){2, 2}, 0);
        unsigned char *bytes = model_builder_finish(&builder, &size);
        free(network);
        if (cases[i].hint) {
            must_refuse(cases[i].to, bytes, size, cases[i].hint);
            continue;
        }
        ascc_model *model = must_load(bytes, size); /* the last: it was right */
        assert_int_equal(model->plan.parameter_count, 20 + 4 + 8 + 2 + 4);
        ascc_model_destroy(&model);
    }
}

static void layers_without_terms_are_refused(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes;
    char *network = replaced(base_network, "\"layers\":[",
                             "\"layers\":[{\"name\":\"e\",\"points\":\"all\",\"channels\":1,"
                             "\"terms\":[]},");
    bytes = build(network, NULL, 0, NULL, &size);
    free(network);
    must_refuse("first", bytes, size, "'e' has no terms");
    network = replaced(base_network, "\"neighbor_limit\":9}]}],",
                       "\"neighbor_limit\":9}]},{\"name\":\"e\",\"points\":\"all\","
                       "\"channels\":1,\"terms\":[]}],");
    bytes = build(network, NULL, 0, NULL, &size);
    free(network);
    must_refuse("last", bytes, size, "'e' has no terms");
}

static void wrong_tensors_are_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int rank;
        size_t shape[5];
        const char *hint;
    } cases[] = {
        {"k", 0, {0}, "'k' is missing"},
        {"kb", 0, {0}, "'kb' is missing"},
        {"w", 0, {0}, "'w' is missing"},
        {"o", 0, {0}, "'o' is missing"},
        {"k", 4, {3, 3, 3, 2}, "'k' has the shape [3, 3, 3, 2], but must"},
        {"k", 5, {2, 3, 3, 3, 2}, "along z"},
        {"k", 5, {1, 3, 3, 4, 2}, "'k' has the shape [1, 3, 3, 4, 2]"},
        {"k", 5, {1, 3, 3, 3, 4}, "'kb' has the shape [2]"},
        {"k", 5, {1, 0, 3, 3, 2}, "'k' has the shape [1, 0, 3"},
        {"k", 5, {1, 3, 3, 3, 0}, "'k' has the shape [1, 3, 3, 3, 0]"},
        {"kb", 1, {3}, "'kb' has the shape [3]"},
        {"w", 2, {3, 4}, "columns [2, 6)"},
        {"w", 2, {2, 3}, "'w' has the shape [2, 3]"},
        {"w", 1, {3}, "'w' has the shape [3], but must"},
        {"o", 5, {1, 4, 4, 5, 3}, "'o' has the shape [1, 4, 4, 5, 3]"},
        {"o", 5, {1, 4, 4, 4, 2}, "'o' has the shape [1, 4, 4, 4, 2]"},
        {"o", 5, {1, 4, 4, 5, 2}, "'o' is not antisymmetric"},
        {"o", 5, {1, 3, 3, 5, 2}, "'o' is not antisymmetric"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        unsigned char *bytes =
            build(base_network, cases[i].name, cases[i].rank, cases[i].shape, &size);
        must_refuse(cases[i].name, bytes, size, cases[i].hint);
    }
}

static void kernels_have_a_bounded_number_of_cells(void **state)
{
    (void)state;
    for (size_t extra = 0; extra < 2; extra++) {
        const size_t cells = ASCC_MAX_CELLS / 64 + extra, shape[5] = {1, 64, cells, 1, 2};
        size_t size;
        model_builder builder;
        float *values = calloc(64 * cells * 2, sizeof *values);
        assert_non_null(values);
        model_builder_open(&builder);
        model_builder_metadata(&builder, "format", "ascc.model");
        model_builder_metadata(&builder, "version", "1");
        model_builder_metadata(
            &builder, "network",
            "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,0],"
            "\"particle_spacing\":1,\"rest_density\":1,\"evaluate\":\"current\","
            "\"features\":{\"fluid\":[\"one\"],\"boundary\":[]},\"layers\":[],"
            "\"output\":{\"type\":\"antisymmetric\",\"source\":\"fluid\",\"kernel\":\"o\","
            "\"stored\":\"full\",\"radius\":1,\"window\":\"none\",\"mapping\":\"radial\","
            "\"projection\":\"none\",\"scale\":1}}");
        model_builder_tensor(&builder, "o", 5, shape, values);
        free(values);
        unsigned char *bytes = model_builder_finish(&builder, &size);
        if (extra) {
            must_refuse("cells", bytes, size, "cells");
        } else {
            ascc_model *model = must_load(bytes, size);
            check_plan(model);
            ascc_model_destroy(&model);
        }
    }
}

static void weights_that_are_not_finite_are_refused_by_name(void **state)
{
    (void)state;
    static const uint32_t bad[] = {0x7f800000u, 0xff800000u, 0x7fc00000u};
    for (size_t i = 0; i < 3; i++) {
        size_t size;
        unsigned char *bytes = build(base_network, NULL, 0, NULL, &size);
        const size_t data = size - 4 * (54 + 2 + 9 + 40 + 160);
        for (int b = 0; b < 4; b++)
            bytes[data + 4 * 60 + (size_t)b] = (unsigned char)(bad[i] >> 8 * b);
        must_refuse("NaN", bytes, size, "'w' holds a value that is not finite");
    }
}

static void metadata_must_name_the_format(void **state)
{
    (void)state;
    static const struct {
        const char *header, *hint;
    } cases[] = {
        {"{}", "'format'"},
        {"{\"__metadata__\":{}}", "'format'"},
        {"{\"__metadata__\":{\"format\":\"ascc.model\"}}", "'version'"},
        {"{\"__metadata__\":{\"format\":\"pt\",\"version\":\"1\"}}", "'pt'"},
        {"{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"2\"}}", "'2'"},
        {"{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\"}}", "'network'"},
        {"{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":\"\"}}",
         "JSON"},
        {"{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":\"[]\"}}",
         "object"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\"}}", "'ascc convert'"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"1\"}}", "ascc.sequence"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        unsigned char *bytes = model_builder_raw(cases[i].header, NULL, 0, &size);
        must_refuse(cases[i].header, bytes, size, cases[i].hint);
    }
}

static void every_truncation_is_refused(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = build(base_network, NULL, 0, NULL, &size);
    for (size_t n = 0; n < size; n += n < 64 ? 1 : 7) {
        unsigned char *part = malloc(n ? n : 1);
        assert_non_null(part);
        memcpy(part, bytes, n);
        must_refuse("truncated", part, n, "");
    }
    free(bytes);
}

static void weights_of_other_types_are_refused_by_name(void **state)
{
    (void)state;
    static const char network[] =
        "{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":"
        "\"{\\\"name\\\":\\\"n\\\",\\\"dimension\\\":2,\\\"time_step\\\":1,\\\"gravity\\\":[0,0],"
        "\\\"particle_spacing\\\":1,\\\"rest_density\\\":1,\\\"evaluate\\\":\\\"current\\\","
        "\\\"features\\\":{\\\"fluid\\\":[\\\"velocity\\\"],\\\"boundary\\\":[]},\\\"layers\\\":[],"
        "\\\"output\\\":{\\\"type\\\":\\\"plain\\\",\\\"source\\\":\\\"fluid\\\",\\\"scale\\\":1}}"
        "\"}"
        "%s}";
    char header[1024];
    size_t size;
    unsigned char zeros[8] = {0};
    snprintf(header, sizeof header, network, "");
    unsigned char *bytes = model_builder_raw(header, NULL, 0, &size);
    ascc_model *model = must_load(bytes, size);
    check_plan(model);
    assert_int_equal(model->plan.parameter_count, 0);
    ascc_model_destroy(&model);
    snprintf(header, sizeof header, network,
             ",\"extra\":{\"dtype\":\"F16\",\"shape\":[4],\"data_offsets\":[0,8]}");
    bytes = model_builder_raw(header, zeros, 8, &size);
    must_refuse("unused", bytes, size, "'extra' is not used");

    static const char from[] = "{\"dtype\":\"F32\",\"shape\":[2]";
    bytes = build(base_network, NULL, 0, NULL, &size);
    for (size_t i = 8; i + sizeof from - 1 < size; i++)
        if (memcmp(bytes + i, from, sizeof from - 1) == 0)
            memcpy(bytes + i, "{\"dtype\":\"I32\"", 14);
    must_refuse("I32", bytes, size, "'kb' is I32");
}

static void descriptions_that_the_fuzzer_starts_from_load(void **state)
{
    (void)state;
    for (const char *kind = "nbp"; *kind != '\0'; kind++) {
        size_t size;
        char *description = model_builder_description(*kind);
        unsigned char *bytes = model_builder_described(*kind, description, &size);
        free(description);
        ascc_model *model = must_load(bytes, size);
        check_plan(model);
        ascc_model_destroy(&model);
    }
}

/* ---- Memory ------------------------------------------------------------------------------------- */

/* Fails the n-th allocation of a load for every n; nothing may stay behind. */
static void fail_every_allocation(unsigned char *bytes, size_t size)
{
    long n = 1;
    for (bool loaded = false; !loaded; n++) {
        failing_allocator failing = {.fail_at = 0};
        const ascc_context_options options = {.size = sizeof options,
                                              .allocate = failing_allocate,
                                              .reallocate = failing_reallocate,
                                              .release = failing_release,
                                              .user = &failing};
        ascc_context *own = NULL;
        ascc_model *model = NULL;
        assert_int_equal(ascc_context_create(&options, &own), ASCC_OK);
        const long blocks = failing.blocks;
        failing.calls = 0;
        failing.fail_at = n;
        const ascc_status status = ascc_model_load_memory(own, bytes, size, &model);
        loaded = failing.calls < n;
        assert_int_equal(status, loaded ? ASCC_OK : ASCC_ERROR_MEMORY);
        if (!loaded)
            assert_int_equal(failing.blocks, blocks);
        ascc_model_destroy(&model);
        ascc_context_destroy(&own);
        assert_int_equal(failing.blocks, 0);
        assert_int_equal(failing.bytes, 0);
    }
    assert_true(n > 12);
    free(bytes);
}

static void every_failing_allocation_is_reported(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_random(&(model_random){.levels = 2}, &size);
    fail_every_allocation(bytes, size);
    bytes = model_builder_random(&(model_random){.levels = 2, .bumps = 2, .transfer = 1}, &size);
    fail_every_allocation(bytes, size);
    bytes = model_builder_random(
        &(model_random){.levels = 2, .abstraction = 1, .method = "farthest", .plain = 1}, &size);
    fail_every_allocation(bytes, size);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(random_models_of_all_shapes_load),
        cmocka_unit_test(demonstration_models_are_antisymmetric_and_radial),
        cmocka_unit_test(halves_are_mirrored_along_each_axis),
        cmocka_unit_test(plan_says_what_the_file_says),
        cmocka_unit_test(documented_examples_load),
        cmocka_unit_test(saved_again_is_byte_identical),
        cmocka_unit_test(names_are_looked_for_in_order),
        cmocka_unit_test(arguments_and_paths_are_checked),
        cmocka_unit_test(model_outlives_its_context),
        cmocka_unit_test(base_network_loads),
        cmocka_unit_test(cells_and_outputs_that_agree_with_the_tensors_load),
        cmocka_unit_test(wrong_descriptions_are_refused_by_name),
        cmocka_unit_test(wrong_graph_networks_are_refused_by_name),
        cmocka_unit_test(wrong_bases_and_transfers_are_refused_by_name),
        cmocka_unit_test(wrong_moments_and_stencils_are_refused_by_name),
        cmocka_unit_test(wrong_motions_dampings_and_walls_are_refused_by_name),
        cmocka_unit_test(wrong_abstractions_and_interpolations_are_refused_by_name),
        cmocka_unit_test(layers_without_terms_are_refused),
        cmocka_unit_test(wrong_tensors_are_refused_by_name),
        cmocka_unit_test(kernels_have_a_bounded_number_of_cells),
        cmocka_unit_test(weights_that_are_not_finite_are_refused_by_name),
        cmocka_unit_test(metadata_must_name_the_format),
        cmocka_unit_test(every_truncation_is_refused),
        cmocka_unit_test(weights_of_other_types_are_refused_by_name),
        cmocka_unit_test(descriptions_that_the_fuzzer_starts_from_load),
        cmocka_unit_test(every_failing_allocation_is_reported),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
