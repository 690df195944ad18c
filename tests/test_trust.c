/* How far a step's input is from training's, and what a ladder makes of it. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>

#include "step/ladder.h"
#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

enum { CHANNELS = 11, INPUTS = 3, SIDE = 15, FLUID = SIDE * SIDE };

static const double spacing = 0.05, time_step = 0.005;

/* ---- A network whose first layer is one matrix, and numbers that it is measured by ---- */

typedef struct statistics {
    float weight[INPUTS][CHANNELS], bias[CHANNELS];
    double mean[CHANNELS], factor[CHANNELS][CHANNELS]; /* below the diagonal and on it */
} statistics;

static statistics random_statistics(uint64_t seed)
{
    statistics s = {0};
    dice d = {seed};
    for (int c = 0; c < CHANNELS; c++) {
        s.bias[c] = (float)dice_uniform(&d, -0.2, 0.2);
        s.mean[c] = dice_uniform(&d, -0.3, 0.3);
        for (int i = 0; i < INPUTS; i++)
            s.weight[i][c] = (float)dice_uniform(&d, -1.0, 1.0);
        for (int j = 0; j <= c; j++)
            s.factor[c][j] = dice_uniform(&d, -2.0, 2.0);
    }
    return s;
}

/* The distance is the speed of v* in spacings a step. */
static statistics speedometer(void)
{
    statistics s = {0};
    const double root = sqrt(CHANNELS);
    s.weight[1][0] = s.weight[2][1] = 1.0f; /* features: one, motion */
    s.factor[0][0] = s.factor[1][1] = root;
    return s;
}

static const char network_text[] =
    "{\"name\":\"measured\",\"dimension\":2,\"time_step\":0.005,\"gravity\":[0,-9.81],"
    "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"advected\","
    "\"features\":{\"fluid\":[\"one\",\"motion\"],\"boundary\":[\"normal\"]},"
    "\"layers\":[{\"name\":\"p\",\"points\":\"fluid\",\"channels\":11,\"terms\":[{\"type\":"
    "\"dense\","
    "\"source\":\"fluid\",\"weight\":\"p.weight\",\"bias\":\"p.bias\"}]}],"
    "\"output\":{\"type\":\"antisymmetric\",\"source\":\"p\",\"relu\":true,\"scale\":1e-4,"
    "\"kernel\":\"output.kernel\",\"radius\":0.1,\"basis\":{\"bumps\":2}}}";

static const char pressure_text[] =
    "{\"name\":\"refuge\",\"dimension\":2,\"time_step\":0.005,\"gravity\":[0,-9.81],"
    "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"advected\","
    "\"features\":{\"fluid\":[\"one\"],\"boundary\":[]},\"layers\":[],"
    "\"relaxation\":{\"support\":0.1,\"rest_volume\":0.002,\"omega\":[0.5],\"epsilon\":0.1,"
    "\"limit\":0.01}}";

/* FNV-1a of all tensors, which are the end of a file. */
static void write_sum(char text[17], const unsigned char *bytes, size_t size)
{
    uint64_t header = 0, sum = UINT64_C(14695981039346656037);
    for (int k = 7; k >= 0; k--)
        header = header << 8 | bytes[k];
    for (size_t i = 8 + (size_t)header; i < size; i++) {
        sum ^= bytes[i];
        sum *= UINT64_C(1099511628211);
    }
    (void)snprintf(text, 17, "%016" PRIx64, sum);
}

/* The file; trust: text of its metadata, NULL = none. */
static unsigned char *build_file(const statistics *s, const char *trust, size_t *size)
{
    model_builder b;
    float kernel[2 * CHANNELS];
    for (int k = 0; k < 2 * CHANNELS; k++)
        kernel[k] = 0.1f * (float)(k % 5 - 2);
    model_builder_open(&b);
    model_builder_metadata(&b, "format", "ascc.model");
    model_builder_metadata(&b, "version", "1");
    model_builder_metadata(&b, "network", network_text);
    if (trust)
        model_builder_metadata(&b, "trust", trust);
    model_builder_tensor(&b, "p.weight", 2, (size_t[]){INPUTS, CHANNELS}, s->weight[0]);
    model_builder_tensor(&b, "p.bias", 1, (size_t[]){CHANNELS}, s->bias);
    model_builder_tensor(&b, "output.kernel", 2, (size_t[]){2, CHANNELS}, kernel);
    return model_builder_finish(&b, size);
}

/* The text of `trust`, free() it. threshold: 0 = none. */
static char *trust_text(const statistics *s, double threshold)
{
    size_t size;
    char sum[17];
    unsigned char *bytes = build_file(s, NULL, &size);
    model_text t = {0};
    write_sum(sum, bytes, size);
    free(bytes);
    model_text_add(&t, "{\"layer\":0,\"weights\":\"%s\"", sum);
    if (threshold > 0.0)
        model_text_add(&t, ",\"threshold\":%s", model_number(threshold));
    model_text_add(&t, ",\"mean\":[");
    for (int c = 0; c < CHANNELS; c++)
        model_text_add(&t, "%s%s", c ? "," : "", model_number(s->mean[c]));
    model_text_add(&t, "],\"factor\":[");
    for (int i = 0; i < CHANNELS; i++)
        for (int j = 0; j <= i; j++)
            model_text_add(&t, "%s%s", i ? "," : "", model_number(s->factor[i][j]));
    model_text_add(&t, "]}");
    return t.text;
}

static ascc_status load(ascc_context *context, const statistics *s, const char *trust,
                        ascc_model **model)
{
    size_t size;
    unsigned char *bytes = build_file(s, trust, &size);
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    free(bytes);
    return status;
}

static ascc_model *load_measured(ascc_context *context, const statistics *s, double threshold)
{
    ascc_model *model = NULL;
    char *text = trust_text(s, threshold);
    assert_int_equal(load(context, s, text, &model), ASCC_OK);
    free(text);
    return model;
}

static ascc_model *load_pressure(ascc_context *context)
{
    size_t size;
    ascc_model *model = NULL;
    model_builder b;
    model_builder_open(&b);
    model_builder_metadata(&b, "format", "ascc.model");
    model_builder_metadata(&b, "version", "1");
    model_builder_metadata(&b, "network", pressure_text);
    unsigned char *bytes = model_builder_finish(&b, &size);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    free(bytes);
    return model;
}

/* ---- Fluid ---- */

/* A loose block, each particle with a velocity of its own of at most `speed` spacings a step. */
static ascc_particles *make_fluid(ascc_context *context, double speed, double v[FLUID][2])
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 2, .spacing = spacing};
    ascc_particles *p;
    double x[FLUID][2];
    dice d = {5};
    for (int i = 0; i < FLUID; i++)
        for (int c = 0; c < 2; c++) {
            x[i][c] = spacing * ((c ? i / SIDE : i % SIDE) + dice_uniform(&d, -0.2, 0.2));
            v[i][c] = dice_uniform(&d, -0.7, 0.7) * speed * spacing / time_step;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    assert_int_equal(ascc_particles_add_fluid(p, FLUID, &position, &velocity, NULL, NULL), ASCC_OK);
    return p;
}

static ascc_step *make_step(ascc_context *context, const ascc_model *model, int32_t measure)
{
    const ascc_step_options options = {.size = sizeof options, .measure_distance = measure};
    ascc_step *step;
    assert_int_equal(ascc_step_create(context, model, &options, &step), ASCC_OK);
    return step;
}

static ascc_step_statistics run(ascc_step *step, ascc_particles *p, int32_t steps)
{
    ascc_step_statistics s = {.size = sizeof s};
    if (ascc_step_run(step, p, NULL, steps) != ASCC_OK)
        fail_msg("%s", ascc_step_message(step));
    assert_int_equal(ascc_step_get_statistics(step, &s), ASCC_OK);
    return s;
}

/* In doubles, from the formulas of docs/trust.md. */
static double true_distance(const statistics *s, const double v[2])
{
    const double input[INPUTS] = {1.0, v[0] * time_step / spacing,
                                  (v[1] - 9.81 * time_step) * time_step / spacing};
    double difference[CHANNELS], square = 0.0;
    for (int c = 0; c < CHANNELS; c++) {
        difference[c] = (double)s->bias[c] - s->mean[c];
        for (int i = 0; i < INPUTS; i++)
            difference[c] += (double)s->weight[i][c] * input[i];
    }
    for (int c = 0; c < CHANNELS; c++) {
        double y = 0.0;
        for (int j = 0; j <= c; j++)
            y += s->factor[c][j] * difference[j];
        square += y * y;
    }
    return sqrt(square / CHANNELS);
}

/* ---- The measure ---- */

static void the_distance_is_that_of_doubles_on_every_machine(void **state)
{
    (void)state;
    static const uint32_t all = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
    const statistics s = random_statistics(3);
    ascc_step_statistics first = {0};
    for (int k = 0; k < 4; k++) {
        const ascc_context_options options = {
            .size = sizeof options, .thread_count = k % 2 ? 3 : 1, .cpu_disable = k < 2 ? 0 : all};
        ascc_context *context;
        double v[FLUID][2], sum = 0.0, worst = -1.0;
        uint64_t row = 0;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        ascc_model *model = load_measured(context, &s, 0.0);
        ascc_particles *p = make_fluid(context, 1.0, v);
        ascc_step *step = make_step(context, model, 1);
        for (uint64_t i = 0; i < FLUID; i++) {
            const double distance = true_distance(&s, v[i]);
            sum += distance;
            row = distance > worst ? i : row;
            worst = fmax(worst, distance);
        }
        const ascc_step_statistics told = run(step, p, 1);
        assert_int_equal(told.distance_count, FLUID);
        assert_int_equal(told.distance_row, row);
        /* Products of eleven floats of order one, and their roots. */
        assert_true(fabs(told.distance_mean * FLUID / sum - 1.0) < 2e-6);
        assert_true(fabs(told.distance_worst / worst - 1.0) < 5e-6);
        first = k ? first : told;
        assert_memory_equal(&first.distance_mean, &told.distance_mean, sizeof(double));
        assert_memory_equal(&first.distance_worst, &told.distance_worst, sizeof(double));
        ascc_step_destroy(&step);
        ascc_particles_destroy(&p);
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
    }
}

static bool has_stage(const ascc_step_statistics *s, const char *name)
{
    for (int32_t i = 0; i < s->stage_count; i++)
        if (strcmp(s->stage[i].name, name) == 0)
            return true;
    return false;
}

/* What a set becomes, and the step's last statistics. */
static uint64_t hash_of_run(ascc_context *context, const ascc_model *model, int32_t measure,
                            ascc_step_statistics *told)
{
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    ascc_particles_options options = {.size = sizeof options};
    assert_int_equal(ascc_model_particles_options(model, 0, &options), ASCC_OK);
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(context, &options, &p), ASCC_OK);
    double x[216][3];
    const ascc_const_array position = {.data = x, .stride = sizeof x[0], .scalar = ASCC_DOUBLE};
    for (int i = 0; i < 216; i++)
        for (int c = 0, n = i; c < 3; c++, n /= 6)
            x[i][c] = n % 6 * info.particle_spacing;
    assert_int_equal(ascc_particles_add_fluid(p, 216, &position, NULL, NULL, NULL), ASCC_OK);
    ascc_step *step = make_step(context, model, measure);
    *told = run(step, p, 4);
    const uint64_t hash = ascc_particles_hash(p);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    return hash;
}

static void measuring_changes_no_bit_and_costs_nothing_where_it_is_off(void **state)
{
    (void)state;
    ascc_context *context;
    ascc_step_statistics on, off, plain;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    /* A shipped one, whose first layer's value nobody else keeps; and one that cannot tell. */
    ascc_model *model = NULL;
    assert_int_equal(
        ascc_model_load(context, SOURCE_ROOT "/examples/models/water3d.safetensors", &model),
        ASCC_OK);
    assert_true(hash_of_run(context, model, 1, &on) == hash_of_run(context, model, 0, &off));
    assert_int_equal(on.distance_count, 216);
    assert_true(on.distance_mean > 0.3 && on.distance_mean < 3.0);
    assert_true(has_stage(&on, "trust"));
    assert_int_equal(off.distance_count, 0);
    assert_true(off.distance_mean == 0.0 && off.distance_worst == 0.0);
    assert_false(has_stage(&off, "trust"));
    assert_true(off.scratch_size <= on.scratch_size);
    ascc_model_destroy(&model);
    const statistics s = random_statistics(4);
    assert_int_equal(load(context, &s, NULL, &model), ASCC_OK);
    (void)hash_of_run(context, model, 1, &plain);
    assert_int_equal(plain.distance_count, 0);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

static void no_fluid_has_no_distance(void **state)
{
    (void)state;
    const statistics s = speedometer();
    ascc_context *context;
    double v[FLUID][2];
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    ascc_model *model = load_measured(context, &s, 0.0);
    ascc_particles *p = make_fluid(context, 1.0, v);
    ascc_step *step = make_step(context, model, 1);
    ascc_step_statistics told = run(step, p, 1);
    assert_int_equal(told.distance_count, FLUID);
    assert_int_equal(ascc_particles_clear(p, ASCC_FLUID), ASCC_OK);
    told = run(step, p, 1);
    assert_int_equal(told.distance_count, 0);
    assert_true(told.distance_mean == 0.0 && told.distance_worst == 0.0);
    const ascc_step_options bad = {.size = sizeof bad, .measure_distance = 2};
    ascc_step *none = NULL;
    assert_int_equal(ascc_step_create(context, model, &bad, &none), ASCC_ERROR_ARGUMENT);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

/* ---- Files ---- */

/* The text with the first `from` become `to`. */
static char *replaced(const char *text, const char *from, const char *to)
{
    const char *at = strstr(text, from);
    model_text t = {0};
    if (!at)
        fail_msg("no %s", from);
    model_text_add(&t, "%.*s%s%s", (int)(at - text), text, to, at + strlen(from));
    return t.text;
}

static void statistics_that_are_wrong_are_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *says;
    } cases[] = {
        {"\"layer\":0", "\"layer\":1", "'layer' is 1"},
        {"\"layer\":0,", "", "'layer' is missing"},
        {"\"layer\":0", "\"layer\":-1", "'layer'"},
        {"\"weights\":", "\"weight\":", "'weights' is missing"},
        {"\"weights\":\"", "\"weights\":7,\"x\":\"", "'weights' must be a text"},
        {"\"threshold\":1.5", "\"threshold\":0", "'threshold'"},
        {"\"threshold\":1.5", "\"threshold\":\"high\"", "'threshold'"},
        {"\"mean\":[", "\"mean\":[1,", "'mean'"},
        {"\"mean\":[", "\"mean\":[[],", "'mean'"},
        {"\"mean\":[", "\"means\":[", "'mean' is missing"},
        {"\"factor\":[", "\"factor\":[1,", "'factor'"},
        {"\"factor\":[", "\"factor\":[1e99,", "'factor'"},
        {"]}", "],\"licence\":1}", "'licence'"},
        {"]}", "]", "trust"},
        {"{", "[{", "trust"},
    };
    const statistics s = random_statistics(5);
    char *right = trust_text(&s, 1.5);
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; k++) {
        ascc_model *model = NULL;
        char message[512], *text = replaced(right, cases[k].from, cases[k].to);
        assert_int_equal(load(context, &s, text, &model), ASCC_ERROR_FORMAT);
        assert_null(model);
        ascc_context_message(context, message, sizeof message);
        if (!strstr(message, cases[k].says) || !strstr(message, "trust"))
            fail_msg("case %zu: %s", k, message);
        free(text);
    }
    free(right);
    ascc_context_destroy(&context);
}

static void statistics_of_other_weights_say_nothing(void **state)
{
    (void)state;
    const statistics s = random_statistics(6);
    statistics other = s;
    ascc_context *context;
    ascc_model *model = NULL;
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    char *text = trust_text(&s, 1.75);
    assert_int_equal(load(context, &s, text, &model), ASCC_OK);
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(info.tells_distance, 1);
    assert_true(info.distance_threshold == 1.75);
    ascc_model_destroy(&model);
    other.bias[3] = nextafterf(other.bias[3], 1.0f);
    assert_int_equal(load(context, &other, text, &model), ASCC_OK);
    assert_int_equal(ascc_model_get_info(model, &info), ASCC_OK);
    assert_int_equal(info.tells_distance, 0);
    assert_true(info.distance_threshold == 0.0);
    ascc_step *step = make_step(context, model, 1);
    double v[FLUID][2];
    ascc_particles *p = make_fluid(context, 1.0, v);
    assert_int_equal(run(step, p, 1).distance_count, 0);
    free(text);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

/* ---- Ladders ---- */

enum { DWELL = 10 }; /* steps */

typedef struct world {
    ascc_context *context;
    ascc_model *model[2];
    ascc_particles *particles;
    ascc_ladder *ladder;
    char log[4096];
    bool listens;
} world;

static const double none[2] = {0.0, 0.0};
static const ascc_forces still = {.size = sizeof still, .gravity = none};

static void hear(void *user, const char *line)
{
    world *w = user;
    const size_t used = strlen(w->log);
    if (w->listens)
        (void)snprintf(w->log + used, sizeof w->log - used, "%s\n", line);
}

static ascc_status open_ladder(world *w, double most, bool refuge, bool tells)
{
    const ascc_context_options options = {.size = sizeof options, .log = hear, .user = w};
    const statistics s = speedometer();
    memset(w, 0, sizeof *w);
    assert_int_equal(ascc_context_create(&options, &w->context), ASCC_OK);
    w->model[0] = load_pressure(w->context);
    if (tells)
        w->model[1] = load_measured(w->context, &s, 0.0);
    else
        assert_int_equal(load(w->context, &s, NULL, &w->model[1]), ASCC_OK);
    const ascc_ladder_options ladder = {
        .size = sizeof ladder, .dwell = DWELL * time_step, .max_distance = most};
    const ascc_model *models[2] = {w->model[0], w->model[1]};
    return ascc_ladder_create(w->context, refuge ? 2 : 1, models + !refuge, &ladder, &w->ladder);
}

static void close_ladder(world *w)
{
    ascc_ladder_destroy(&w->ladder);
    ascc_particles_destroy(&w->particles);
    for (int k = 0; k < 2; k++)
        ascc_model_destroy(&w->model[k]);
    ascc_context_destroy(&w->context);
}

static ascc_ladder_statistics climb(world *w, int32_t steps)
{
    ascc_ladder_statistics s = {.size = sizeof s};
    if (ascc_ladder_run(w->ladder, w->particles, &still, steps) != ASCC_OK)
        fail_msg("%s", ascc_ladder_message(w->ladder));
    assert_int_equal(ascc_ladder_get_statistics(w->ladder, &s), ASCC_OK);
    return s;
}

/* All fluid flies at this speed, spacings a step. */
static void set_speed(world *w, double speed)
{
    double v[FLUID][2];
    for (int i = 0; i < FLUID; i++) {
        v[i][0] = speed * spacing / time_step;
        v[i][1] = 0.0;
    }
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    assert_int_equal(
        ascc_particles_set(w->particles, ASCC_FLUID, ASCC_VELOCITY, 0, FLUID, &velocity), ASCC_OK);
}

static void a_ladder_falls_back_says_so_and_looks_again(void **state)
{
    (void)state;
    world w;
    double v[FLUID][2];
    assert_int_equal(open_ladder(&w, 0.5, true, true), ASCC_OK);
    w.particles = make_fluid(w.context, 0.0, v);
    w.listens = true;
    ascc_ladder_statistics s = climb(&w, 5);
    assert_int_equal(s.rung, 1);
    assert_int_equal(s.reason, ASCC_LADDER_FITS);
    assert_int_equal(s.distance_count, FLUID);
    assert_true(s.distance_mean < 0.5);
    assert_string_equal(w.log, "");
    set_speed(&w, 1.0);
    s = climb(&w, 1); /* sees it */
    assert_int_equal(s.rung, 1);
    assert_true(s.distance_mean > 0.9 && s.distance_mean < 1.1);
    s = climb(&w, 1);
    assert_int_equal(s.rung, 0);
    assert_int_equal(s.reason, ASCC_LADDER_STRANGE);
    assert_int_equal(s.changes, 1);
    assert_non_null(strstr(w.log, "from measured to refuge"));
    assert_non_null(strstr(w.log, "times as far as usual"));
    s = climb(&w, 3 * DWELL); /* looks every now and then */
    assert_int_equal(s.rung, 0);
    assert_int_equal(s.reason, ASCC_LADDER_STRANGE);
    assert_int_equal(s.steps_on[1], 6);
    set_speed(&w, 0.1);
    s = climb(&w, DWELL + 1);
    assert_int_equal(s.rung, 1);
    assert_true(s.distance_mean < 0.5);
    assert_int_equal(s.changes, 2);
    close_ladder(&w);
}

static void a_look_moves_nothing(void **state)
{
    (void)state;
    world w;
    double v[FLUID][2];
    assert_int_equal(open_ladder(&w, 0.5, true, true), ASCC_OK);
    w.particles = make_fluid(w.context, 1.0, v);
    ascc_step *step = make_step(w.context, w.model[1], 1),
              *other = make_step(w.context, w.model[1], 1);
    const ascc_step_statistics before = run(step, w.particles, 1);
    (void)run(other, w.particles, 1);
    const uint64_t hash = ascc_particles_hash(w.particles);
    assert_int_equal(ascc_step_look(step, w.particles, NULL), ASCC_OK);
    assert_true(hash == ascc_particles_hash(w.particles));
    assert_int_equal(step->statistics.steps, before.steps);
    assert_memory_equal(step->statistics.momentum_after, before.momentum_after,
                        sizeof before.momentum_after);
    const double seen = step->statistics.distance_mean;
    assert_true(seen > 0.0);
    assert_true(run(other, w.particles, 1).distance_mean == seen);
    ascc_step_destroy(&step);
    ascc_step_destroy(&other);
    close_ladder(&w);
}

static void doubts_are_in_snapshots_and_choices_run_again(void **state)
{
    (void)state;
    world w, other, third;
    double v[FLUID][2];
    int32_t choice[40];
    assert_int_equal(open_ladder(&w, 0.5, true, true), ASCC_OK);
    assert_int_equal(open_ladder(&other, 0.5, true, true), ASCC_OK);
    assert_int_equal(open_ladder(&third, 0.5, true, true), ASCC_OK);
    w.particles = make_fluid(w.context, 0.0, v);
    other.particles = make_fluid(other.context, 0.0, v);
    third.particles = make_fluid(third.context, 0.0, v);
    set_speed(&w, 1.0);
    set_speed(&third, 1.0);
    (void)climb(&w, 4);
    set_speed(&w, 0.1);
    const size_t size = ascc_ladder_snapshot_size(w.ladder);
    const size_t set_size = ascc_particles_snapshot_size(w.particles);
    unsigned char *bytes = malloc(size), *set = malloc(set_size);
    assert_int_equal(ascc_ladder_snapshot(w.ladder, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_snapshot(w.particles, set, set_size), ASCC_OK);
    assert_int_equal(ascc_ladder_restore(other.ladder, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_restore(other.particles, set, set_size), ASCC_OK);
    const ascc_ladder_statistics a = climb(&w, 20), b = climb(&other, 20);
    assert_int_equal(a.rung, 1);
    assert_true(a.steps_on[0] >= DWELL - 1);
    assert_memory_equal(a.steps_on, b.steps_on, sizeof a.steps_on);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    assert_int_equal(ascc_ladder_get_choices(w.ladder, 0, 24, choice), ASCC_OK);
    assert_int_equal(ascc_ladder_replay(third.ladder, third.particles, &still, choice, 4), ASCC_OK);
    set_speed(&third, 0.1);
    assert_int_equal(ascc_ladder_replay(third.ladder, third.particles, &still, choice + 4, 20),
                     ASCC_OK);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(third.particles));
    free(bytes);
    free(set);
    close_ladder(&w);
    close_ladder(&other);
    close_ladder(&third);
}

static void ladders_that_cannot_tell_or_have_no_refuge_are_refused(void **state)
{
    (void)state;
    char text[512];
    world w;
    assert_int_equal(open_ladder(&w, 0.5, true, false), ASCC_ERROR_MISMATCH);
    ascc_context_message(w.context, text, sizeof text);
    assert_non_null(strstr(text, "measured, has no statistics"));
    close_ladder(&w);
    assert_int_equal(open_ladder(&w, 0.5, false, true), ASCC_ERROR_MISMATCH);
    ascc_context_message(w.context, text, sizeof text);
    assert_non_null(strstr(text, "below rung 0 there is none without a network"));
    close_ladder(&w);
    assert_int_equal(open_ladder(&w, -1.0, true, true), ASCC_ERROR_ARGUMENT);
    close_ladder(&w);
    assert_int_equal(open_ladder(&w, 0.0, false, false), ASCC_OK);
    close_ladder(&w);
}

static void without_memory_nothing_changes_and_nothing_leaks(void **state)
{
    (void)state;
    const statistics s = random_statistics(8);
    char *text = trust_text(&s, 1.5);
    for (size_t fail_at = 1;; fail_at++) {
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        ascc_context *context;
        ascc_model *model = NULL;
        ascc_step *step = NULL;
        double v[FLUID][2];
        const ascc_step_options measured = {.size = sizeof measured, .measure_distance = 1};
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        ascc_particles *p = make_fluid(context, 1.0, v);
        const uint64_t hash = ascc_particles_hash(p);
        memory.fail_at = memory.calls + fail_at;
        ascc_status status = load(context, &s, text, &model);
        if (status == ASCC_OK)
            status = ascc_step_create(context, model, &measured, &step);
        if (status == ASCC_OK)
            status = ascc_step_run(step, p, NULL, 1);
        memory.fail_at = 0;
        assert_true(status == ASCC_OK || status == ASCC_ERROR_MEMORY);
        assert_true(status == ASCC_OK || hash == ascc_particles_hash(p));
        ascc_step_destroy(&step);
        ascc_particles_destroy(&p);
        ascc_model_destroy(&model);
        ascc_context_destroy(&context);
        assert_true(test_memory_is_clean(&memory));
        if (status == ASCC_OK)
            break;
    }
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_distance_is_that_of_doubles_on_every_machine),
        cmocka_unit_test(measuring_changes_no_bit_and_costs_nothing_where_it_is_off),
        cmocka_unit_test(no_fluid_has_no_distance),
        cmocka_unit_test(statistics_that_are_wrong_are_refused_by_name),
        cmocka_unit_test(statistics_of_other_weights_say_nothing),
        cmocka_unit_test(a_ladder_falls_back_says_so_and_looks_again),
        cmocka_unit_test(a_look_moves_nothing),
        cmocka_unit_test(doubts_are_in_snapshots_and_choices_run_again),
        cmocka_unit_test(ladders_that_cannot_tell_or_have_no_refuge_are_refused),
        cmocka_unit_test(without_memory_nothing_changes_and_nothing_leaks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
