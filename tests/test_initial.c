/* Initial weights: every description gives a model that loads, steps and trains; the same everywhere.
 * SPDX-License-Identifier: MIT */
#include "support/test.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/train.h>

#include "model/model.h"
#include "model/operation.h"
#include "published.h"
#include "support/counting.h"
#include "support/float_modes.h"
#include "support/model_builder.h"

static ascc_context *context;
static ascc_train_context *train;

static int open_contexts(void **state)
{
    (void)state;
    return ascc_context_create(NULL, &context) || ascc_train_context_create(NULL, &train);
}

static int close_contexts(void **state)
{
    (void)state;
    ascc_context_destroy(&context);
    ascc_train_context_destroy(&train);
    return 0;
}

/* ---- Descriptions and models --------------------------------------------------------------------- */

/* The description in a model file, from malloc. */
static char *description_of(const unsigned char *bytes, size_t size)
{
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_message message;
    ascc_safetensors file;
    assert_int_equal(ascc_safetensors_open(&allocator, bytes, size, &file, &message), ASCC_OK);
    const char *network = ascc_safetensors_metadata(&file, "network");
    assert_non_null(network);
    char *copy = malloc(strlen(network) + 1);
    assert_non_null(copy);
    (void)strcpy(copy, network);
    ascc_safetensors_close(&file);
    return copy;
}

/* A model file, from malloc. */
static unsigned char *initial(const char *description, uint64_t seed, size_t *size)
{
    char text[256];
    if (ascc_train_initial_model(train, description, seed, NULL, 0, size) != ASCC_OK) {
        ascc_train_context_message(train, text, sizeof text);
        fail_msg("%s\n%s", text, description);
    }
    unsigned char *bytes = malloc(*size);
    assert_non_null(bytes);
    assert_int_equal(ascc_train_initial_model(train, description, seed, bytes, *size, size),
                     ASCC_OK);
    return bytes;
}

static ascc_model *load(const unsigned char *bytes, size_t size, const char *what)
{
    char text[256];
    ascc_model *model = NULL;
    if (ascc_model_load_memory(context, bytes, size, &model) != ASCC_OK) {
        ascc_context_message(context, text, sizeof text);
        fail_msg("%s: %s", what, text);
    }
    return model;
}

/* A block of fluid above a floor, in free fall. */
enum { SIDE = 6, FRAMES = 4, WIDE = 10 };
typedef struct drop {
    size_t fluid_count, wall_count;
    float position[FRAMES * SIDE * SIDE * SIDE * 3];
    float wall[WIDE * WIDE * 3], normal[WIDE * WIDE * 3];
    ascc_training_sequence sequence;
} drop;

static void lattice(float *to, size_t count, size_t side, size_t dimension, size_t flat, double h)
{
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0, rest = i; c < dimension; c++) {
            const bool is_flat = c == flat;
            to[i * dimension + c] = is_flat ? 0.0f : (float)(h * (double)(rest % side));
            rest /= is_flat ? 1 : side;
        }
}

static drop *make_drop(const ascc_model_info *info)
{
    drop *d = calloc(1, sizeof *d);
    assert_non_null(d);
    const size_t dimension = (size_t)info->dimension, flat = dimension - 1;
    d->fluid_count = dimension == 2 ? SIDE * SIDE : SIDE * SIDE * SIDE;
    d->wall_count = dimension == 2 ? WIDE : WIDE * WIDE;
    const double h = info->particle_spacing, dt = info->time_step;
    lattice(d->position, d->fluid_count, SIDE, dimension, 3, h);
    lattice(d->wall, d->wall_count, WIDE, dimension, flat, h);
    for (size_t i = 0; i < d->wall_count; i++) {
        d->wall[i * dimension + flat] = (float)(-0.8 * h);
        d->normal[i * dimension + flat] = 1.0f;
    }
    const size_t n = d->fluid_count * dimension;
    for (size_t f = 1; f < FRAMES; f++)
        for (size_t i = 0; i < n; i++)
            d->position[f * n + i] = d->position[i] + (float)(0.5 * info->gravity[i % dimension] *
                                                              dt * dt * (double)(f * f));
    d->sequence =
        (ascc_training_sequence){.size = sizeof d->sequence,
                                 .name = "drop",
                                 .frame_count = FRAMES,
                                 .fluid_count = d->fluid_count,
                                 .boundary_count = d->wall_count,
                                 .position = d->position,
                                 .boundary_position = d->wall,
                                 .boundary_normal = d->normal,
                                 .time_step = info->time_step,
                                 .gravity = {info->gravity[0], info->gravity[1], info->gravity[2]}};
    return d;
}

static void steps(const ascc_model *model, const ascc_model_info *info, const drop *d,
                  const char *what)
{
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = info->dimension, .spacing = info->particle_spacing};
    const ascc_const_array x = {.data = d->position}, wall = {.data = d->wall},
                           normal = {.data = d->normal};
    assert_int_equal(ascc_particles_create(context, &options, &particles), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(particles, d->fluid_count, &x, NULL, NULL, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(particles, d->wall_count, &wall, &normal, 0, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_step_create(context, model, NULL, &step), ASCC_OK);
    if (ascc_step_run(step, particles, NULL, 2) != ASCC_OK)
        fail_msg("%s: %s", what, ascc_step_message(step));
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
}

static const ascc_training_stage stage = {.end = 2, .unroll = 1, .learning_rate = 1e-3};

static ascc_trainer_options training(void)
{
    return (ascc_trainer_options){.size = sizeof(ascc_trainer_options),
                                  .seed = 1,
                                  .stage = &stage,
                                  .stage_size = sizeof stage,
                                  .stage_count = 1,
                                  .batch = 1};
}

static void trains(const unsigned char *bytes, size_t size, const drop *d, const char *what)
{
    char text[256];
    const ascc_trainer_options options = training();
    ascc_trainer *trainer = NULL;
    ascc_training_report report = {.size = sizeof report};
    if (ascc_trainer_create(train, &options, bytes, size, &trainer) != ASCC_OK) {
        ascc_train_context_message(train, text, sizeof text);
        fail_msg("%s: %s", what, text);
    }
    if (ascc_trainer_add_sequence(trainer, &d->sequence) != ASCC_OK ||
        ascc_trainer_iterate(trainer, &report) != ASCC_OK)
        fail_msg("%s: %s", what, ascc_trainer_message(trainer));
    assert_int_equal(report.skipped, 0);
    if (!(report.loss >= 0.0 && report.loss < 1.0 && report.gradient_norm > 0.0))
        fail_msg("%s: loss %g, gradient %g", what, report.loss, report.gradient_norm);
    ascc_trainer_destroy(&trainer);
}

/* Takes the file that the description comes from. */
static void begins(const char *what, unsigned char *given, size_t given_size)
{
    size_t size;
    char *description = description_of(given, given_size);
    unsigned char *bytes = initial(description, 7, &size);
    ascc_model *model = load(bytes, size, what), *own = load(given, given_size, what);
    ascc_model_info info = {.size = sizeof info}, own_info = {.size = sizeof own_info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(ascc_model_get_info(own, &own_info), ASCC_OK);
    assert_int_equal(info.parameter_count, own_info.parameter_count);
    drop *d = make_drop(&info);
    steps(model, &info, d, what);
    trains(bytes, size, d, what);
    free(d);
    ascc_model_destroy(&model);
    ascc_model_destroy(&own);
    free(description);
    free(bytes);
    free(given);
}

/* ---- What begins --------------------------------------------------------------------------------- */

static void networks_of_all_shapes_begin(void **state)
{
    static const char *const methods[] = {"voxel_centers", "voxel_corners", "farthest"};
    static const char *const axes[] = {NULL, "x", "y"};
    static const char *const windows[] = {"poly6", "peak", "none"};
    (void)state;
    for (int v = 0; v < 24; v++) {
        char what[32];
        size_t size;
        model_random o = {.seed = 1,
                          .dimension = 2 + v % 2,
                          .levels = 1 + v % 3,
                          .channels = 8,
                          .method = methods[v / 2 % 3],
                          .half_axis = axes[v / 3 % 3],
                          .window = windows[v / 4 % 3],
                          .bumps = v / 2 % 2 ? 3 : 0,
                          .order = v % 3,
                          .plain = v % 5 == 4,
                          .skip_self = v % 7 == 1,
                          .scale = v % 4 == 3 ? 1.0 : 0.0};
        o.fluid_only = o.bumps != 0;
        o.motion = o.fluid_only ? 1 : 0;
        o.gravity = v % 3 == 1;
        o.relative = o.fluid_only && v % 2;
        o.walls = o.damping = o.fluid_only && !o.plain;
        o.transfer = o.levels > 1 && v / 2 % 3 != 2 ? v % 3 : 0;
        snprintf(what, sizeof what, "variant %d", v);
        unsigned char *bytes = model_builder_random(&o, &size);
        begins(what, bytes, size);
    }
}

static void other_descriptions_of_the_tests_begin(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_tiny(0.05, &size);
    begins("tiny", bytes, size);
    const model_random moments = {
        .bumps = 3, .moments = 2, .fluid_only = 1, .motion = 2, .walls = 1, .damping = 1};
    bytes = model_builder_random(&moments, &size);
    begins("moments", bytes, size);
    const model_random lattice = {.dimension = 3,
                                  .levels = 3,
                                  .bumps = 3,
                                  .moments = 2,
                                  .lattice = 1,
                                  .method = "voxel_corners",
                                  .no_hysteresis = 1,
                                  .transfer = 1,
                                  .fluid_only = 1,
                                  .motion = 3,
                                  .walls = 1,
                                  .damping = 1};
    bytes = model_builder_random(&lattice, &size);
    begins("lattice", bytes, size);
    bytes = model_builder_demo(3, 0.05, &size);
    begins("demo", bytes, size);
    for (const char *kind = "nb"; *kind; kind++) {
        char *text = model_builder_description(*kind);
        bytes = model_builder_described(*kind, text, &size);
        free(text);
        begins("described", bytes, size);
    }
}

static void published_networks_begin(void **state)
{
    (void)state;
    for (int v = 0; v < 2; v++) {
        char why[256];
        size_t size, converted_size;
        unsigned char *bytes =
            v ? model_builder_cconv(NULL, NULL, &size) : model_builder_dmcf(NULL, NULL, &size);
        unsigned char *converted =
            ascc_published_convert(bytes, size, &converted_size, why, sizeof why);
        free(bytes);
        if (!converted)
            fail_msg("%s", why);
        begins(v ? "cconv" : "dmcf", converted, converted_size);
    }
}

static void shipped_networks_begin(void **state)
{
    static const char *const names[] = {"water2d", "water2d-tiny", "water3d", "water3d-tiny",
                                        "paper3d"};
    (void)state;
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        char path[512];
        enum { MOST = 1 << 20 };
        unsigned char *bytes = malloc(MOST);
        snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", names[i]);
        FILE *file = fopen(path, "rb");
        assert_non_null(file);
        assert_non_null(bytes);
        const size_t size = fread(bytes, 1, MOST, file);
        assert_int_equal(fclose(file), 0);
        begins(names[i], bytes, size);
    }
}

/* ---- Values -------------------------------------------------------------------------------------- */

static const model_random mixed = {.seed = 1,
                                   .dimension = 3,
                                   .levels = 3,
                                   .channels = 8,
                                   .method = "farthest",
                                   .bumps = 3,
                                   .order = 1,
                                   .fluid_only = 1,
                                   .motion = 1,
                                   .walls = 1,
                                   .damping = 1};

static uint64_t hash_of(const unsigned char *bytes, size_t size)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < size; i++)
        hash = (hash ^ bytes[i]) * 0x100000001b3u;
    return hash;
}

/* The hashes were made by gcc on x86-64; no machine may differ. */
static void same_text_and_seed_give_the_same_bytes_everywhere(void **state)
{
    static const uint64_t known[2] = {0x1c46865f43d3b95a, 0x8e674514594b223b};
    const model_random grid = {.seed = 1, .levels = 2};
    (void)state;
    for (int v = 0; v < 2; v++) {
        size_t size[3], given_size;
        unsigned char *bytes[3], *given = model_builder_random(v ? &grid : &mixed, &given_size);
        char *text = description_of(given, given_size);
        for (int i = 0; i < 3; i++)
            bytes[i] = initial(text, i == 2 ? 8 : 7, &size[i]);
        assert_int_equal(size[0], size[1]);
        assert_memory_equal(bytes[0], bytes[1], size[0]);
        for (size_t mode = 0; mode < FLOAT_MODE_COUNT; mode++) {
            float_state_set(float_modes[mode].state);
            unsigned char *other = initial(text, 7, &size[1]);
            const bool kept = float_state() == float_modes[mode].state;
            float_state_set(FLOAT_DEFAULT);
            assert_true(kept);
            assert_memory_equal(bytes[0], other, size[0]);
            free(other);
        }
        assert_memory_not_equal(bytes[0] + size[0] / 2, bytes[2] + size[0] / 2, size[0] / 2);
        const uint64_t hash = hash_of(bytes[0], size[0]);
        if (hash != known[v])
            fail_msg("network %d: %016llx", v, (unsigned long long)hash);
        for (int i = 0; i < 3; i++)
            free(bytes[i]);
        free(text);
        free(given);
    }
}

static void biases_are_not_negative_and_dampings_neither(void **state)
{
    (void)state;
    size_t size, given_size;
    unsigned char *given = model_builder_random(&mixed, &given_size);
    char *text = description_of(given, given_size);
    unsigned char *bytes = initial(text, 3, &size);
    ascc_model *model = load(bytes, size, "mixed");
    int damped = 0;
    for (int32_t t = 0; t <= model->plan.term_count; t++) {
        const ascc_term *term = ascc_plan_term(&model->plan, t);
        const float *bias = t < model->plan.term_count ? term->tensor[ASCC_TENSOR_BIAS] : NULL;
        for (int32_t c = 0; bias && c < term->outputs; c++)
            assert_true(bias[c] >= 0.0f && bias[c] <= 0.1f && (bias[c] > 0.0f) == !term->rectify);
        for (int i = 0; i < ASCC_MAX_TENSORS; i++)
            if (term->operation->not_negative >> i & 1) {
                assert_true(term->tensor[i][0] >= 0.0f);
                damped++;
            }
    }
    assert_int_equal(damped, 2);
    ascc_model_destroy(&model);
    free(bytes);
    free(text);
    free(given);
}

/* ---- What is refused ------------------------------------------------------------------------------ */

static void refused(const char *description, const char *hint)
{
    char text[256];
    size_t size = 77;
    const ascc_status status = ascc_train_initial_model(train, description, 1, NULL, 0, &size);
    ascc_train_context_message(train, text, sizeof text);
    if (status != ASCC_ERROR_FORMAT || !strstr(text, hint))
        fail_msg("status %d, message '%s' without '%s'", (int)status, text, hint);
    assert_int_equal(size, 77);
}

#define HEAD                                                                                       \
    "{\"name\":\"n\",\"dimension\":2,\"time_step\":0.01,\"gravity\":[0,-9.81],"                    \
    "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"current\","                    \
    "\"features\":{\"fluid\":[\"one\",\"velocity\"],\"boundary\":[\"one\"]},\"layers\":["          \
    "{\"name\":\"a\",\"points\":\"fluid\",\"channels\":6,\"terms\":["
#define TAIL                                                                                       \
    "]}],\"output\":{\"type\":\"antisymmetric\",\"source\":\"a\",\"scale\":0.01,\"kernel\":\"o\"," \
    "\"radius\":0.1,\"basis\":{\"bumps\":2}}}"
#define GRID                                                                                       \
    "{\"type\":\"convolution\",\"source\":\"fluid\",\"kernel\":\"k\",\"radius\":0.1,"              \
    "\"window\":\"none\",\"mapping\":\"volume\""

static void descriptions_that_do_not_tell_a_shape_are_refused_by_name(void **state)
{
    (void)state;
    refused("", "JSON");
    refused("[]", "object");
    refused(HEAD GRID "}" TAIL, "tensor 'k' must have the shape [?, ?, ?, 3, 6]");
    refused(HEAD GRID ",\"cells\":[4,4,2]}" TAIL, "z");
    refused(HEAD GRID ",\"cells\":[4,4,1]},"
                      "{\"type\":\"dense\",\"source\":\"fluid\",\"weight\":\"k\"}" TAIL,
            "'k' has the shape [1, 4, 4, 3, 6], but must have [3, 6]");
    refused(HEAD GRID ",\"cells\":[4,4,1],\"outputs\":7}" TAIL, "columns [0, 7)");
    refused(HEAD "{\"type\":\"dense\",\"source\":\"fluid\",\"weight\":\"__metadata__\"}" TAIL,
            "'__metadata__'");
    refused(HEAD "{\"type\":\"identity\",\"source\":\"fluid\",\"outputs\":6}" TAIL,
            "'outputs' is 6, but a term gives 3 channels");
    refused(HEAD "{\"type\":\"dense\",\"source\":\"fluid\",\"column\":6,\"weight\":\"w\"}" TAIL,
            "tensor 'w' must have the shape [3, ?]");
}

static void a_term_without_outputs_takes_the_columns_that_are_left(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes =
        initial(HEAD GRID ",\"cells\":[4,3,1],\"outputs\":2},"
                          "{\"type\":\"dense\",\"source\":\"fluid\",\"column\":2,"
                          "\"weight\":\"w\",\"bias\":\"b\"}" TAIL,
                1, &size);
    ascc_model *model = load(bytes, size, "columns");
    assert_int_equal(model->plan.term[0].outputs, 2);
    assert_int_equal(model->plan.term[0].filter.cells[0], 4);
    assert_int_equal(model->plan.term[0].filter.cells[1], 3);
    assert_int_equal(model->plan.term[1].outputs, 4);
    ascc_model_destroy(&model);
    free(bytes);
}

/* The last line, and how many there were. */
typedef struct lines {
    int count;
    char last[256];
} lines;

static void keep_line(void *user, const char *line)
{
    lines *l = user;
    l->count++;
    snprintf(l->last, sizeof l->last, "%s", line);
}

#define SMALL HEAD GRID ",\"cells\":[4,4,1]}" TAIL

static void arguments_are_checked_and_failures_logged(void **state)
{
    (void)state;
    lines log = {0, ""};
    char text[256];
    size_t size, room;
    const ascc_context_options options = {.size = sizeof options, .log = keep_line, .user = &log};
    ascc_train_context *own = NULL;
    assert_int_equal(ascc_train_context_create(NULL, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_train_context_create(&options, &own), ASCC_OK);
    assert_int_equal(ascc_train_initial_model(NULL, SMALL, 1, NULL, 0, &size), ASCC_ERROR_ARGUMENT);
    assert_int_equal(
        ascc_train_initial_model((ascc_train_context *)context, SMALL, 1, NULL, 0, &size),
        ASCC_ERROR_ARGUMENT); /* of the other library */
    assert_int_equal(log.count, 0);
    assert_int_equal(ascc_train_initial_model(own, NULL, 1, NULL, 0, &size), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_train_initial_model(own, SMALL, 1, NULL, 0, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(log.count, 2);
    assert_int_equal(ascc_train_initial_model(own, SMALL, 1, NULL, 0, &size), ASCC_OK);
    room = size;
    assert_int_equal(ascc_train_initial_model(own, SMALL, 1, text, 1, &size), ASCC_ERROR_ARGUMENT);
    assert_int_equal(size, room);
    assert_non_null(strstr(log.last, "bytes"));
    unsigned char *bytes = initial(SMALL, 1, &size);

    const ascc_training_stage two[2] = {stage, {.end = 4, .unroll = 1, .learning_rate = 1.0}};
    ascc_trainer *trainer = NULL;
    ascc_trainer_options o = training();
    o.whiten = 1;
    assert_int_equal(ascc_trainer_create(own, &o, bytes, size, &trainer), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(log.last, "whiten"));
    o = training();
    o.stage_size = 8;
    assert_int_equal(ascc_trainer_create(own, &o, bytes, size, &trainer), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(log.last, "stage_size"));
    o.stage_size = 0;
    assert_int_equal(ascc_trainer_create(own, &o, bytes, size, &trainer), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(log.last, "stage_size"));
    ascc_train_context_message(own, text, sizeof text);
    assert_string_equal(text, log.last);
    o.stage = two;
    o.stage_size = 2 * sizeof stage; /* what follows is not of a stage that this version knows */
    assert_int_equal(ascc_trainer_create(own, &o, bytes, size, &trainer), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(log.last, "stage 0"));
    assert_int_equal(ascc_trainer_create(own, NULL, bytes, size, &trainer), ASCC_ERROR_ARGUMENT);
    assert_int_equal(log.count, 8);
    free(bytes);
    ascc_train_context_destroy(&own);
}

/* Stages of a later version, with members more that are zeros. */
static void stages_of_a_later_version_are_read(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = initial(SMALL, 1, &size);
    const struct later {
        ascc_training_stage stage;
        double more;
    } later[2] = {{{.end = 2, .unroll = 1, .learning_rate = 1e-3}, 0.0},
                  {{.end = 5, .unroll = 2, .learning_rate = 1e-3}, 0.0}};
    ascc_trainer_options o = training();
    o.stage = &later[0].stage;
    o.stage_size = sizeof later[0];
    o.stage_count = 2;
    ascc_trainer *trainer = NULL;
    assert_int_equal(ascc_trainer_create(train, &o, bytes, size, &trainer), ASCC_OK);
    lines log = {0, ""};
    (void)log;
    assert_int_equal(ascc_trainer_add_sequence(trainer, NULL), ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(ascc_trainer_message(trainer), "NULL"));
    ascc_trainer_destroy(&trainer);
    free(bytes);
}

/* Context, first model, trainer, a sequence and an iteration, on one thread. */
static ascc_status learn(test_memory *memory, const drop *d, char text[256])
{
    const ascc_context_options options = test_memory_options(memory);
    const ascc_trainer_options o = training();
    ascc_train_context *own = NULL;
    ascc_trainer *trainer = NULL;
    ascc_training_report report = {.size = sizeof report};
    static unsigned char bytes[8192];
    size_t size = 0;
    text[0] = '\0';
    ascc_status status = ascc_train_context_create(&options, &own);
    if (status != ASCC_OK)
        return status;
    status = ascc_train_initial_model(own, SMALL, 1, bytes, sizeof bytes, &size);
    if (status == ASCC_OK)
        status = ascc_trainer_create(own, &o, bytes, size, &trainer);
    if (status != ASCC_OK) {
        assert_null(trainer);
        ascc_train_context_message(own, text, 256);
    } else {
        status = ascc_trainer_add_sequence(trainer, &d->sequence);
        if (status == ASCC_OK)
            status = ascc_trainer_iterate(trainer, &report);
        if (status != ASCC_OK)
            snprintf(text, 256, "%s", ascc_trainer_message(trainer));
    }
    ascc_train_context_destroy(&own);
    ascc_trainer_destroy(&trainer);
    return status;
}

static void every_failing_allocation_leaves_a_message_and_leaks_nothing(void **state)
{
    (void)state;
    char text[256];
    test_memory memory = {0};
    const ascc_model_info info = {
        .dimension = 2, .particle_spacing = 0.05, .time_step = 0.01, .gravity = {0.0, -9.81, 0.0}};
    drop *d = make_drop(&info);
    if (learn(&memory, d, text) != ASCC_OK)
        fail_msg("%s", text);
    assert_true(test_memory_is_clean(&memory));
    const size_t calls = memory.calls;
    print_message("# %zu allocations\n", calls);
    size_t before_handle = 0;
    for (size_t n = 1; n <= calls; n++) {
        memory = (test_memory){.fail_at = n};
        const ascc_status status = learn(&memory, d, text);
        if (status == ASCC_OK && memory.calls >= n && n < calls)
            continue; /* what may do without, such as a larger block of scratch */
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        before_handle += text[0] == '\0'; /* no context yet to ask */
        if (text[0] && !strstr(text, "memory"))
            fail_msg("allocation %zu: '%s'", n, text);
        assert_true(test_memory_is_clean(&memory));
    }
    assert_true(before_handle < 10);
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(networks_of_all_shapes_begin),
        cmocka_unit_test(other_descriptions_of_the_tests_begin),
        cmocka_unit_test(published_networks_begin),
        cmocka_unit_test(shipped_networks_begin),
        cmocka_unit_test(same_text_and_seed_give_the_same_bytes_everywhere),
        cmocka_unit_test(biases_are_not_negative_and_dampings_neither),
        cmocka_unit_test(descriptions_that_do_not_tell_a_shape_are_refused_by_name),
        cmocka_unit_test(a_term_without_outputs_takes_the_columns_that_are_left),
        cmocka_unit_test(arguments_are_checked_and_failures_logged),
        cmocka_unit_test(stages_of_a_later_version_are_read),
        cmocka_unit_test(every_failing_allocation_leaves_a_message_and_leaks_nothing),
    };
    return cmocka_run_group_tests_name("initial", tests, open_contexts, close_contexts);
}
