/* Published networks: what they become as model files, and that every sentence not understood is
 * refused by name. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <math.h>

#include <jansson.h>

#include "model/model.h"
#include "network/operations.h"
#include "published.h"
#include "support/model_builder.h"
#include "tensor_file.h"

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

/* Converts bytes from malloc, frees them and loads the model made; NULL with why in text. */
static ascc_model *load(unsigned char *bytes, size_t size)
{
    ascc_model *model = NULL;
    assert_true(ascc_published_is(bytes, size));
    text[0] = '\0';
    unsigned char *made = ascc_published_convert(bytes, size, &size, text, sizeof text);
    free(bytes);
    if (made && ascc_model_load_memory(context, made, size, &model) != ASCC_OK)
        ascc_context_message(context, text, sizeof text);
    free(made);
    return model;
}

static ascc_model *must_load(unsigned char *bytes, size_t size)
{
    ascc_model *model = load(bytes, size);
    if (!model)
        fail_msg("%s", text);
    return model;
}

/* Refused with a message that contains `hint`; `what` says which case it is. */
static void must_refuse(const char *what, unsigned char *bytes, size_t size, const char *hint)
{
    if (load(bytes, size) || !strstr(text, hint))
        fail_msg("%s: message '%s' without '%s'", what, text, hint);
}

/* ---- What it becomes ---------------------------------------------------------------------------- */

static void small_dmcf_becomes_the_plan_it_describes(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_dmcf(NULL, NULL, &size);
    ascc_model *model = must_load(bytes, size);
    const ascc_plan *plan = &model->plan;
    assert_int_equal(plan->advection, ASCC_ADVECT_END);
    assert_true(plan->boundary_crop == 0.8 && plan->hysteresis == 0.1 && plan->spacing == 0.0625);
    assert_int_equal(plan->sampling, ASCC_SAMPLING_CORNERS);
    assert_int_equal(plan->centroid_anchor, 1);
    assert_int_equal(plan->level_count, 2);
    assert_true(plan->level[1].voxel == 0.05);
    assert_int_equal(plan->layer_count, 4);
    static const char *const names[] = {"l0", "l1.out_0", "l1.out_1", "l2.out_0"};
    static const int32_t terms[] = {4, 2, 1, 4};
    for (int i = 0; i < 4; i++) {
        assert_string_equal(plan->layer[i].name, names[i]);
        assert_int_equal(plan->layer[i].term_count, terms[i]);
    }
    /* l2: convolution, dense and residual from branch 0, then the convolution from branch 1. */
    const ascc_term *term = &plan->term[plan->layer[3].first_term];
    const ascc_operation *const kinds[] = {&ascc_op_grid, &ascc_op_grid, &ascc_op_dense,
                                           &ascc_op_identity};
    static const int32_t sources[] = {3, 4, 3, 3}, rectified[] = {1, 1, 1, 0};
    for (int i = 0; i < 4; i++) {
        assert_ptr_equal(term[i].operation, kinds[i]);
        assert_int_equal(term[i].source, sources[i]);
        assert_int_equal(term[i].rectify, rectified[i]);
    }
    assert_true(term[0].filter.radius == 0.1 && term[1].filter.radius == 0.2);
    assert_int_equal(term[0].filter.skip_self, 0);
    assert_int_equal(term[0].filter.window, ASCC_WINDOW_POLY6);
    assert_int_equal(plan->term[0].rectify, 0);
    assert_int_equal(plan->output.term.filter.cells[1], 4);
    assert_int_equal(plan->output.term.filter.window, ASCC_WINDOW_PEAK);
    assert_int_equal(plan->output.central, 0);
    assert_true(plan->output.scale[2] == 0.0078125);
    ascc_model_destroy(&model);
}

static void small_cconv_becomes_the_plan_it_describes(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_cconv(NULL, NULL, &size);
    ascc_model *model = must_load(bytes, size);
    const ascc_plan *plan = &model->plan;
    assert_int_equal(plan->advection, ASCC_ADVECT_MEAN);
    assert_true(plan->boundary_crop <= 0.0);
    assert_true(fabs(plan->spacing - 0.05) < 1e-15);
    assert_int_equal(plan->boundary_channels, 3);
    assert_int_equal(plan->layer_count, 4);
    assert_int_equal(plan->layer[0].set, ASCC_SET_FLUID);
    assert_int_equal(plan->term[0].source, 1);
    assert_int_equal(plan->term[1].column, 1);
    assert_int_equal(plan->layer[2].term_count, 3);
    assert_int_equal(plan->term[0].filter.skip_self, 1);
    assert_int_equal(plan->output.conserves, 0);
    assert_int_equal(plan->output.term.source, 5);
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(info.conserves_momentum, 0);
    assert_true(info.support_radius == 0.1125);
    ascc_model_destroy(&model);
}

static void published_files_become_models(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        uint64_t parameters;
        int32_t levels, layers, conserves;
        double support, receptive;
    } files[] = {{"dmcf-liquid3d", 275084, 3, 9, 1, 0.1, 1.4},
                 {"cconv-liquid3d", 692902, 1, 4, 0, 0.1125, 0.45}};
    const char *root = getenv("ASCC_SHARED");
    for (size_t i = 0; i < 2; i++) {
        char path[512];
        snprintf(path, sizeof path, "%s/data/weights/%s.safetensors",
                 root ? root : SOURCE_ROOT "/../shared", files[i].name);
        size_t size;
        unsigned char *bytes = ascc_tensor_file_read(path, &size, text, sizeof text);
        if (!bytes) {
            print_message("SKIP: %s: %s\n", path, text);
            continue;
        }
        ascc_model *model = must_load(bytes, size);
        ascc_model_info info = {.size = sizeof info};
        assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
        assert_string_equal(info.name, files[i].name);
        assert_int_equal(info.parameter_count, files[i].parameters);
        assert_int_equal(info.dimension, 3);
        assert_int_equal(info.level_count, files[i].levels);
        assert_int_equal(info.layer_count, files[i].layers);
        assert_int_equal(info.conserves_momentum, files[i].conserves);
        assert_true(info.time_step == 0.02 && info.gravity[1] == -9.81);
        assert_true(fabs(info.particle_spacing - 0.05) < 1e-15 && info.rest_density == 1000.0);
        assert_true(info.support_radius == files[i].support);
        assert_true(fabs(info.receptive_radius - files[i].receptive) < 1e-12);
        ascc_model_destroy(&model);
    }
}

/* State of a block against two walls, no two points of which coincide, after some steps. */
static uint64_t hash_after_steps(const ascc_model *model)
{
    enum { SIDE = 5, WALL = 12 };
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = info.particle_spacing, .mass = 0.125};
    assert_int_equal(ascc_particles_create(context, &options, &particles), ASCC_OK);
    for (int i = 0; i < SIDE * SIDE * SIDE; i++) {
        const double jitter = 0.001 * (i * 7 % 11);
        const double x[3] = {0.03 + 0.05 * (i % SIDE) + jitter, 0.03 + 0.05 * (i / SIDE % SIDE),
                             0.05 * (i / SIDE / SIDE) - jitter};
        const double v[3] = {-0.5, 0.01 * (i % 3), 0.25};
        const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
        const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
        assert_int_equal(ascc_particles_add_fluid(particles, 1, &position, &velocity, NULL, NULL),
                         ASCC_OK);
    }
    for (int axis = 0; axis < 2; axis++)
        for (int i = 0; i < WALL * WALL; i++) {
            double x[3] = {0.0, 0.0, 0.032 * (i / WALL)}, n[3] = {0.0, 0.0, 0.0};
            x[1 - axis] = 0.032 * (i % WALL) + 0.016 * axis;
            n[axis] = 1.0;
            const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
            const ascc_const_array normal = {.data = n, .scalar = ASCC_DOUBLE};
            assert_int_equal(ascc_particles_add_boundary(particles, 1, &position, &normal, 0, NULL),
                             ASCC_OK);
        }
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    assert_int_equal(ascc_step_run(step, particles, NULL, 3), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(particles);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    return hash;
}

/* What they came to when the library itself read the published files. */
static void converted_networks_step_to_the_hashes_they_always_did(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_dmcf(NULL, NULL, &size);
    ascc_model *model = must_load(bytes, size);
    assert_int_equal(hash_after_steps(model), 0x353489813a9dfb8a);
    ascc_model_destroy(&model);
    bytes = model_builder_cconv(NULL, NULL, &size);
    model = must_load(bytes, size);
    assert_int_equal(hash_after_steps(model), 0x998d15f94d957a20);
    ascc_model_destroy(&model);
}

static void tensors_and_origin_are_kept(void **state)
{
    (void)state;
    size_t size, made_size, begin, made_begin;
    unsigned char *bytes = model_builder_dmcf(NULL, NULL, &size);
    unsigned char *made = ascc_published_convert(bytes, size, &made_size, text, sizeof text);
    assert_non_null(made);
    json_t *from = ascc_tensor_file_header(bytes, size, &begin, text, sizeof text);
    json_t *to = ascc_tensor_file_header(made, made_size, &made_begin, text, sizeof text);
    assert_int_equal(size - begin, made_size - made_begin);
    assert_memory_equal(bytes + begin, made + made_begin, size - begin);
    assert_string_equal(ascc_tensor_file_metadata(from, "trained_with"),
                        ascc_tensor_file_metadata(to, "trained_with"));
    assert_null(ascc_tensor_file_metadata(to, "architecture"));
    assert_string_equal(ascc_tensor_file_metadata(to, "format"), "ascc.model");
    json_object_del(from, "__metadata__");
    json_object_del(to, "__metadata__");
    assert_true(json_equal(from, to));
    json_decref(from);
    json_decref(to);
    free(made);
    free(bytes);
}

/* ---- What is refused ---------------------------------------------------------------------------- */

static void text_not_understood_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } both[] = {
        {"\"timestep\": 0.02", "\"timestep\": 0", "'timestep'"},
        {"[0, -9.81, 0]", "[0, -9.81]", "'gravity'"},
        {"p2=p1+dt*", "p2=p1-dt*", "'integration'"},
        {"v2.y", "v2.x", "'v2.x'"},
        {", \"v2.z\"]", "]", "within a vector"},
        {"n.z", "n.w", "'n.w'"},
        {"poly6", "poly7", "'window'"},
        {"[2, 2, 2], \"", "[2, 2, 3], \"", "'kernel_size'"},
        {"volume_preserving", "cubic", "'coordinate_mapping'"},
        {"trilinear", "nearest", "'interpolation'"},
        {"\"align_corners\": true", "\"align_corners\": false", "'align_corners'"},
        {"\"normalize\": false", "\"normalize\": true", "'normalize'"},
        {"\"timestep\"", "\"circular\": true, \"timestep\"", "'circular'"},
        {"dim 3", "dim 2", "contradict"},
        {"\"network\": \"", "\"network\": \"GNS ", "'network'"},
        {"[z,y,x,in,out]", "[x,y,z,in,out]", "'kernel_axis_order'"},
        {"row-major", "column-major", "'kernel_axis_order'"},
    };
    for (size_t i = 0; i < sizeof both / sizeof *both; i++) {
        size_t size;
        unsigned char *bytes = model_builder_cconv(both[i].from, both[i].to, &size);
        must_refuse(both[i].to, bytes, size, both[i].hint);
        bytes = model_builder_dmcf(both[i].from, both[i].to, &size);
        must_refuse(both[i].to, bytes, size, both[i].hint);
    }
}

static void dmcf_contradictions_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"max(p2)+0.8", "max(p2)+0.9", "'boundary_crop'"},
        {"\"use_vel\": true", "\"use_vel\": false", "'use_vel'"},
        {"\"use_acc\": false", "\"use_acc\": true", "'use_acc'"},
        {"\"stride\": 2", "\"stride\": 4", "'voxel'"},
        {"\"stride\": 1", "\"stride\": 2", "'stride'"},
        {"\"radius\": 0.2", "\"radius\": 0.05", "'radius'"},
        {"\"pad\": 0", "\"pad\": 1", "'pad'"},
        {"\"centralize\": true", "\"centralize\": false", "'centralize'"},
        {"branch 0 points for", "the finer branch for", "'source'"},
        {"coarser of the two", "finer of the two", "'cross_branch_radius'"},
        {"sum (add_merge)", "concat", "'merge'"},
        {"every l1,l2 conv", "every l1 conv", "'activation'"},
        {"l2.out_0 += l1.out_0", "l1.out_0 += l0", "'residual'"},
        {"l1.dense_0, l2.dense_0", "l1.dense_0/1, l2.dense_0", "'dense'"},
        {"\"out\": 3", "\"out\": 4", "'concat'"},
        {"conv_fluid(1)", "conv_fluid(2)", "'concat'"},
        {"\"inputs\": {\"0\": 3}", "\"inputs\": {\"0\": 4}", "'inputs'"},
        {"\"0\": 2, \"1\": 1}}", "\"0\": 3, \"1\": 1}}", "gives 2 channels, but 3"},
        {"\"0\": 2, \"1\": 1}}", "\"0\": 2, \"7\": 1}}", "'7'"},
        {"{\"name\": \"l2\"", "{\"name\": \"l3\"", "'name'"},
        {"\"outputs\": {\"0\": 3}}]", "\"outputs\": {\"0\": 2}}]", "sym0"},
        {"[2,2,2,2,3]", "[2,2,2,2,4]", "'stored'"},
        {"\"sym_axis\": 1", "\"sym_axis\": 0", "'sym_axis'"},
        {"\"sym_axis\": 1", "\"sym_axis\": 3", "'sym_axis'"},
        {"(f_i+f_k)", "(f_i-f_k)", "'formula'"},
        {"relu(l2.out_0)", "relu(l1.out_0)", "'formula'"},
        {"[2, 4, 2]", "[4, 4, 2]", "'kernel_size'"},
        {"peak: ", "peek: ", "'window'"},
        {"dt 0.02 s", "dt 0.03 s", "'trained_with'"},
        {"gravity -9.81 along", "gravity -1 along", "'trained_with'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        unsigned char *bytes = model_builder_dmcf(cases[i].from, cases[i].to, &size);
        must_refuse(cases[i].to, bytes, size, cases[i].hint);
    }
}

static void cconv_contradictions_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *hint;
    } cases[] = {
        {"\"extent\": 0.225", "\"extent\": 0.2", "'extent'"},
        {"widths 3,2,2,3", "widths 3,2,2", "'layers'"},
        {"widths 3,2,2,3", "widths 3,2,3,3", "'conv2' gives 2 channels"},
        {"widths 3,2,2,3", "widths 4,2,2,3", "'layers'"},
        {"i=1..3", "i=1..99", "'layers'"},
        {"only i=2", "only i=1", "residual"},
        {"A_3/128", "A_3/64", "'out_scale'"},
        {"A_3/128", "A_2/128", "'layers'"},
        {"conv0_fluid(1)", "conv0_fluid(2)", "'layers'"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        unsigned char *bytes = model_builder_cconv(cases[i].from, cases[i].to, &size);
        must_refuse(cases[i].to, bytes, size, cases[i].hint);
    }
}

static void metadata_not_understood_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *header, *hint;
    } cases[] = {
        {"{\"__metadata__\":{\"format\":\"ascc.weights\"}}", "'version'"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"2\"}}", "'version' is '2'"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\",\"dim\":\"4\"}}",
         "'dim'"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\",\"dim\":\"3\"}}",
         "'kernel_axis_order'"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\",\"dim\":\"3\","
         "\"kernel_axis_order\":\"[z,y,x,in,out] row-major\"}}",
         "'architecture'"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\",\"dim\":\"3\","
         "\"kernel_axis_order\":\"[z,y,x,in,out] row-major\",\"architecture\":\"[]\"}}",
         "object"},
        {"{\"__metadata__\":{\"format\":\"ascc.weights\",\"version\":\"1\",\"dim\":\"3\","
         "\"kernel_axis_order\":\"[z,y,x,in,out] row-major\",\"architecture\":\"{\"}}",
         "JSON"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        size_t size;
        unsigned char *bytes = model_builder_raw(cases[i].header, NULL, 0, &size);
        must_refuse(cases[i].header, bytes, size, cases[i].hint);
    }
}

static void other_files_are_not_published_networks(void **state)
{
    (void)state;
    static const char *const headers[] = {"{}", "[]", "{", "{\"__metadata__\":{}}",
                                          "{\"__metadata__\":{\"format\":\"ascc.model\"}}"};
    assert_false(ascc_published_is((const unsigned char *)"", 0));
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        size_t size;
        unsigned char *bytes = model_builder_raw(headers[i], NULL, 0, &size);
        assert_false(ascc_published_is(bytes, size));
        assert_null(ascc_published_convert(bytes, size, &size, text, sizeof text));
        assert_true(text[0] != '\0');
        free(bytes);
    }
}

static void messages_are_fit_for_a_terminal(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes =
        model_builder_cconv("\"network\": \"", "\"network\": \"\\u001b[2J", &size);
    must_refuse("escape", bytes, size, "'?[2JCConv");
    bytes = model_builder_cconv("\"timestep\"", "\"\\u001b\": 1, \"timestep\"", &size);
    must_refuse("escape", bytes, size, "unknown key '?'");
}

/* ---- Memory ------------------------------------------------------------------------------------- */

static long calls, fail_at;

static void *failing_malloc(size_t size)
{
    return ++calls == fail_at ? NULL : malloc(size);
}

/* Fails the n-th allocation of the JSON library for every n; a sanitizer sees what leaks. */
static void every_failing_allocation_is_survived(void **state)
{
    (void)state;
    size_t size, whole = 0, made = 0;
    unsigned char *bytes = model_builder_dmcf(NULL, NULL, &size);
    unsigned char *right = ascc_published_convert(bytes, size, &whole, text, sizeof text);
    assert_non_null(right);
    json_set_alloc_funcs(failing_malloc, free);
    bool done = false;
    for (fail_at = 1; !done; fail_at++) {
        calls = 0;
        unsigned char *got = ascc_published_convert(bytes, size, &made, text, sizeof text);
        done = calls < fail_at;
        if (got)
            assert_true(made == whole && memcmp(got, right, whole) == 0);
        else
            assert_false(done);
        free(got);
    }
    json_set_alloc_funcs(malloc, free);
    assert_true(fail_at > 100);
    free(right);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(small_dmcf_becomes_the_plan_it_describes),
        cmocka_unit_test(small_cconv_becomes_the_plan_it_describes),
        cmocka_unit_test(published_files_become_models),
        cmocka_unit_test(converted_networks_step_to_the_hashes_they_always_did),
        cmocka_unit_test(tensors_and_origin_are_kept),
        cmocka_unit_test(text_not_understood_is_refused),
        cmocka_unit_test(dmcf_contradictions_are_refused),
        cmocka_unit_test(cconv_contradictions_are_refused),
        cmocka_unit_test(metadata_not_understood_are_refused),
        cmocka_unit_test(other_files_are_not_published_networks),
        cmocka_unit_test(messages_are_fit_for_a_terminal),
        cmocka_unit_test(every_failing_allocation_is_survived),
    };
    return cmocka_run_group_tests(tests, open_context, close_context);
}
