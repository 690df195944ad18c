/* The trainer's gradients against central differences of the oracle, and what it promises besides.
 * SPDX-License-Identifier: MIT */
#include <ascc/train.h>
#include <math.h>
#include <unistd.h>

#include "model/model.h"
#include "model/relaxation.h"
#include "support/float_modes.h"
#include "support/model_builder.h"
#include "support/oracle.h"
#include "support/tools.h"

#define SPACING 0.05
#define TIME_STEP 0.005 /* of model_builder_random */
#define FRAMES 8
#define MAX_POINTS 64

/* ---- A sequence ---- */

typedef struct motion {
    int dimension;
    size_t fluid_count, wall_count;
    float position[FRAMES * MAX_POINTS * 3], wall[MAX_POINTS * 3], normal[MAX_POINTS * 3];
    double wide_wall[MAX_POINTS * 3], wide_normal[MAX_POINTS * 3];
    ascc_training_sequence sequence;
} motion;

/* Particles that drift and shake above a floor: nothing a network could ever learn, and no particle of a
 * rollout ever near its true place, where a distance has no derivative. */
static motion *make_motion(uint64_t seed, int dimension)
{
    motion *m = calloc(1, sizeof *m);
    assert_non_null(m);
    dice d = {seed * 31 + 7};
    const size_t n = (size_t)dimension, side = n == 2 ? 5 : 3, across = n == 2 ? 8 : 4;
    m->dimension = dimension;
    m->fluid_count = n == 2 ? 20 : 27;
    m->wall_count = n == 2 ? 8 : 16;
    for (size_t i = 0; i < m->fluid_count; i++) {
        const size_t at[3] = {i % side, n == 2 ? i / side : i / 9, i / 3 % 3};
        for (size_t c = 0; c < n; c++) {
            double x = ((double)at[c] + 0.4 + dice_uniform(&d, -0.2, 0.2)) * SPACING;
            const double v = dice_uniform(&d, -0.1, 0.1) * SPACING;
            for (size_t t = 0; t < FRAMES; t++, x += v)
                m->position[(t * m->fluid_count + i) * n + c] =
                    (float)(x + dice_uniform(&d, -0.1, 0.1) * SPACING);
        }
    }
    for (size_t i = 0; i < m->wall_count; i++) {
        const double at[3] = {(double)(i % across) - 0.5, -0.3, (double)(i / across) - 0.5};
        double length = 0.0, normal[3];
        for (size_t c = 0; c < n; c++) {
            m->wall[i * n + c] = (float)((at[c] + dice_uniform(&d, -0.2, 0.2)) * SPACING);
            normal[c] = (c == 1 ? 1.0 : 0.0) + dice_uniform(&d, -0.2, 0.2);
            length += normal[c] * normal[c];
        }
        for (size_t c = 0; c < n; c++) {
            m->normal[i * n + c] = (float)(normal[c] / sqrt(length));
            m->wide_wall[i * n + c] = (double)m->wall[i * n + c];
            m->wide_normal[i * n + c] = (double)m->normal[i * n + c];
        }
    }
    m->sequence = (ascc_training_sequence){.size = sizeof m->sequence,
                                           .name = "shaken",
                                           .frame_count = FRAMES,
                                           .fluid_count = m->fluid_count,
                                           .boundary_count = m->wall_count,
                                           .position = m->position,
                                           .boundary_position = m->wall,
                                           .boundary_normal = m->normal,
                                           .time_step = TIME_STEP,
                                           .gravity = {0.5, -9.0, 0.25}};
    if (dimension == 2)
        m->sequence.gravity[2] = 0.0;
    return m;
}

/* ---- Trainers ---- */

static const ascc_training_stage only_stage = {
    .end = 1000, .unroll = 3, .warm_up = 1, .learning_rate = 1e-3};

static ascc_trainer_options default_options(void)
{
    return (ascc_trainer_options){.size = sizeof(ascc_trainer_options),
                                  .seed = 3,
                                  .batch = 3,
                                  .stage = &only_stage,
                                  .stage_size = sizeof only_stage,
                                  .stage_count = 1,
                                  .position_gradients = 1};
}

/* With so many threads. */
static ascc_trainer *open_threaded(int32_t threads, const ascc_trainer_options *options,
                                   const model_random *random, const motion *m)
{
    char message[256] = "";
    const ascc_context_options wanted = {.size = sizeof wanted, .thread_count = threads};
    ascc_train_context *train = NULL;
    ascc_trainer *trainer = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    assert_int_equal(ascc_train_context_create(&wanted, &train), ASCC_OK);
    const ascc_status status = ascc_trainer_create(train, options, bytes, size, &trainer);
    ascc_train_context_message(train, message, sizeof message);
    ascc_train_context_destroy(&train); /* the trainer lives on */
    if (status != ASCC_OK)
        fail_msg("trainer: %s", message);
    free(bytes);
    if (m && ascc_trainer_add_sequence(trainer, &m->sequence) != ASCC_OK)
        fail_msg("sequence: %s", ascc_trainer_message(trainer));
    return trainer;
}

static ascc_trainer *open_trainer(const ascc_trainer_options *options, const model_random *random,
                                  const motion *m)
{
    return open_threaded(1, options, random, m);
}

/* The parameters, from malloc. */
static float *parameters_of(const ascc_trainer *trainer)
{
    float *values = malloc((ascc_trainer_parameter_count(trainer) + 1) * sizeof *values);
    assert_non_null(values);
    assert_int_equal(ascc_trainer_get_parameters(trainer, values), ASCC_OK);
    return values;
}

static void iterate(ascc_trainer *trainer, int count)
{
    ascc_training_report report = {.size = sizeof report};
    for (int i = 0; i < count; i++)
        if (ascc_trainer_iterate(trainer, &report) != ASCC_OK)
            fail_msg("iterate: %s", ascc_trainer_message(trainer));
}

/* ---- Gradients ---- */

typedef struct gradient_case {
    const char *name;
    model_random random;
    oracle_loss_options loss;
    int warm_up, unroll;
    int constant_positions;
    int samples; /* of each tensor; 0 = 12 */
    uint32_t learn;
} gradient_case;

typedef struct bench {
    const gradient_case *c;
    motion *m;
    ascc_context *context;
    ascc_model *model;
    double *weight, *still;
    oracle o;
    oracle_references references;
    int dead; /* tensors without any gradient: rectified away */
} bench;

static void open_bench(bench *b, const gradient_case *c)
{
    size_t size;
    unsigned char *bytes = model_builder_random(&c->random, &size);
    *b = (bench){.c = c, .m = make_motion(c->random.seed, c->random.dimension)};
    assert_int_equal(ascc_context_create(NULL, &b->context), ASCC_OK);
    if (ascc_model_load_memory(b->context, bytes, size, &b->model) != ASCC_OK) {
        char text[256];
        ascc_context_message(b->context, text, sizeof text);
        fail_msg("model: %s", text);
    }
    free(bytes);
    b->weight = oracle_weights(b->model);
    b->still = oracle_weights(b->model);
    b->o = oracle_open(b->model, b->weight);
    b->o.still = b->still;
    b->o.fluid_count = b->m->fluid_count;
    b->o.wall_count = b->m->wall_count;
    b->o.wall = b->m->wide_wall;
    b->o.normal = b->m->wide_normal;
    memcpy(b->o.gravity, b->m->sequence.gravity, sizeof b->o.gravity);
    oracle_set_half(&b->o, c->random.half_axis);
    b->references = oracle_measure(&b->o, &(oracle_sequence){FRAMES, b->m->position});
}

static void close_bench(bench *b)
{
    oracle_close(&b->o);
    free(b->weight);
    free(b->still);
    free(b->m);
    ascc_model_destroy(&b->model);
    ascc_context_destroy(&b->context);
}

static double loss_of(bench *b, oracle_mode mode)
{
    const oracle_sequence sequence = {FRAMES, b->m->position};
    b->o.mode = mode;
    return oracle_loss(&b->o, &sequence, &b->references, &b->c->loss, 2, b->c->warm_up,
                       b->c->unroll);
}

/* Central difference of the loss by one weight. */
static double slope_of(bench *b, size_t at, double step)
{
    const oracle_mode mode = b->c->constant_positions ? ORACLE_POSITIONS : ORACLE_LATTICES;
    const double weight = b->weight[at];
    b->weight[at] = weight + step;
    const double above = loss_of(b, mode);
    b->weight[at] = weight - step;
    const double below = loss_of(b, mode);
    b->weight[at] = weight;
    return (above - below) / (2.0 * step);
}

#define GRADIENT_BOUND 1e-5

/* One tensor; returns the largest difference relative to its largest gradient. A step over a kink (a ReLU,
 * a cell of a kernel) spoils a difference: then a shorter step has to agree. */
static double check_tensor(bench *b, const oracle_tensor *tensor, const float *gradient)
{
    const size_t samples = b->c->samples ? (size_t)b->c->samples : 12;
    const size_t stride = tensor->count > samples ? tensor->count / samples : 1;
    double largest = 0.0, worst = 0.0;
    for (size_t i = 0; i < tensor->count; i++)
        largest = fmax(largest, fabs((double)gradient[i]));
    b->dead += !(largest > 0.0);
    for (size_t i = 0; i < tensor->count; i += stride) {
        double best = INFINITY, got = (double)gradient[i], want = 0.0;
        for (double step = 1e-5; step > 5e-9 && !(best < 0.1 * GRADIENT_BOUND); step *= 0.1) {
            const double slope = slope_of(b, tensor->offset + i, step);
            const double error =
                slope == got ? 0.0 : fabs(slope - got) / fmax(largest, fabs(slope));
            if (error < best) {
                best = error;
                want = slope;
            }
        }
        if (!(best < GRADIENT_BOUND))
            print_error("%s: %s[%zu]: %.9g, not %.9g; largest %.3g\n", b->c->name, tensor->name, i,
                        got, want, largest);
        worst = fmax(worst, best);
    }
    return worst;
}

/* Constants of the relaxation, one of which is the parameter: value at which it is, gradient there. */
static double slope_of_constant(bench *b, double *value, double step)
{
    const oracle_mode mode = b->c->constant_positions ? ORACLE_POSITIONS : ORACLE_LATTICES;
    const int32_t d = b->model->plan.dimension;
    const double was = *value;
    double loss[2];
    for (int k = 0; k < 2; k++) {
        *value = was * (1.0 + (k ? step : -step));
        ascc_relaxation_derive(&b->model->plan.relaxation, d);
        loss[k] = loss_of(b, mode);
    }
    *value = was;
    ascc_relaxation_derive(&b->model->plan.relaxation, d);
    return (loss[1] - loss[0]) / (2.0 * step);
}

/* All that are learned, relative to the largest: each is by the logarithm of its value. */
static double check_constants(bench *b, const float *gradient)
{
    ascc_relaxation *r = &b->model->plan.relaxation;
    double *const value[] = {&r->rest_volume, &r->epsilon, r->pressure.omega, r->divergence.omega};
    const int32_t count[] = {1, 1, r->pressure.count, r->divergence.count};
    double worst = 0.0, largest = 0.0;
    size_t all = 0;
    for (int k = 0; k < 4; k++)
        all += b->c->learn >> k & 1 ? (size_t)count[k] : 0;
    for (size_t i = 0; i < all; i++)
        largest = fmax(largest, fabs((double)gradient[i]));
    for (int k = 0; k < 4; k++) {
        for (int32_t i = 0; b->c->learn >> k & 1 && i < count[k]; i++, gradient++) {
            double best = INFINITY, slope = 0.0;
            for (double step = 1e-5; step > 5e-9 && !(best < 0.1 * GRADIENT_BOUND); step *= 0.1) {
                slope = slope_of_constant(b, &value[k][i], step);
                best = fmin(best, slope == (double)*gradient ? 0.0
                                                             : fabs(slope - (double)*gradient) /
                                                                   fmax(largest, fabs(slope)));
            }
            if (!(best < GRADIENT_BOUND))
                print_error("%s: constant %d, %d: %.9g, not %.9g\n", b->c->name, k, (int)i,
                            (double)*gradient, slope);
            worst = fmax(worst, best);
        }
    }
    return worst;
}

static double check_gradient(const gradient_case *c)
{
    bench b;
    open_bench(&b, c);
    ascc_trainer_options options = default_options();
    options.position_gradients = !c->constant_positions;
    options.neighbor_weight = c->loss.neighbor_weight;
    options.density_weight = c->loss.density_weight;
    options.wall_weight = c->loss.wall_weight;
    options.velocity_weight = c->loss.velocity_weight;
    options.learn = c->learn;
    ascc_trainer *trainer = open_trainer(&options, &c->random, b.m);
    const size_t count = ascc_trainer_parameter_count(trainer);
    float *gradient = calloc(count + 1, sizeof *gradient), *values = parameters_of(trainer);
    double loss = 0.0, alone = 0.0, worst = 0.0;
    assert_non_null(gradient);
    if (ascc_trainer_gradient(trainer, 0, 2, c->warm_up, c->unroll, &loss, gradient) != ASCC_OK)
        fail_msg("%s: %s", c->name, ascc_trainer_message(trainer));
    assert_int_equal(ascc_trainer_gradient(trainer, 0, 2, c->warm_up, c->unroll, &alone, NULL),
                     ASCC_OK);
    assert_true(loss == alone);
    const double want = loss_of(&b, ORACLE_RECORD);
    if (!(fabs(loss - want) < 1e-5 * want))
        fail_msg("%s: loss %.9g, not %.9g", c->name, loss, want);

    oracle_tensor list[ORACLE_MAX_TENSORS];
    const size_t tensors = oracle_tensors(b.model, list);
    size_t at = 0;
    for (size_t t = 0; t < tensors; at += list[t++].count) {
        for (size_t i = 0; i < list[t].count; i++)
            assert_true((double)values[at + i] == b.weight[list[t].offset + i]);
        worst = fmax(worst, check_tensor(&b, &list[t], gradient + at));
    }
    worst = fmax(worst, check_constants(&b, gradient + at));
    assert_true(c->learn ? at < count : at == count);
    assert_true(!c->learn || values[at] == 0.0f);
    assert_true(2 * (size_t)b.dead < tensors);
    if (!(worst < GRADIENT_BOUND))
        fail_msg("%s: a gradient is off by %.3g of its tensor's largest", c->name, worst);
    free(values);
    free(gradient);
    ascc_trainer_destroy(&trainer);
    close_bench(&b);
    return worst;
}

/* A small network, one layer after the first. Each case sets its scale so that corrections are some tenths
 * of a spacing: a second step then depends on where the first one led. */
static model_random small(uint64_t seed, int dimension)
{
    return (model_random){.seed = seed,
                          .dimension = dimension,
                          .spacing = SPACING,
                          .channels = 8,
                          .trunk_layers = 1,
                          .cells = 3,
                          .output_cells = 4,
                          .gain = 3.0,
                          .scale = 0.2};
}

static model_random small_basis(uint64_t seed, int dimension)
{
    model_random r = small(seed, dimension);
    r.bumps = 2;
    r.order = 1;
    r.gain = 1.0;
    r.scale = dimension == 2 ? 0.05 : 0.015;
    return r;
}

/* Everything at once. */
static model_random everything(uint64_t seed, int dimension)
{
    model_random r = small_basis(seed, dimension);
    r.fluid_only = r.relative = r.damping = r.walls = r.direction = r.transfer = 1;
    r.bumps = 3;
    r.area = seed / 2 % 2 == 1;
    r.motion = 2;
    r.gravity = 1;
    r.levels = 2;
    r.trunk_layers = 2;
    r.method = "voxel_corners";
    r.no_hysteresis = 1;
    r.evaluate = "advected";
    return r;
}

static void gradients_of_rollouts_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 8; v++) {
        gradient_case c = {.name = "rollout",
                           .random = everything(1500 + (uint64_t)v, 2 + v % 2),
                           .warm_up = v / 4,
                           .unroll = 2 + v / 6,
                           .constant_positions = v / 2 % 2,
                           .samples = 24};
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# rollouts: %.2g\n", worst);
}

static void gradients_with_positions_as_constants_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 6; v++) {
        const uint64_t seed = 1600 + (uint64_t)v;
        gradient_case c = {.name = "constant positions",
                           .random = v / 2 == 0   ? small(seed, 2 + v % 2)
                                     : v / 2 == 1 ? small_basis(seed, 2 + v % 2)
                                                  : everything(seed, 2 + v % 2),
                           .unroll = 3,
                           .constant_positions = 1};
        c.random.evaluate = "advected";
        c.random.direction = 0; /* pairs act as seen */
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# constant positions: %.2g\n", worst);
}

static void gradients_of_rollouts_through_set_abstractions_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 4; v++) {
        gradient_case c = {.name = "set abstractions",
                           .random = small_basis(1900 + (uint64_t)v, 2 + v % 2),
                           .unroll = 2,
                           .constant_positions = v / 2,
                           .samples = 24};
        c.random.abstraction = v % 3 ? 1 + 2 + 16 : 1 + 4 + 8 + 32;
        c.random.levels = 2;
        c.random.method = "farthest";
        c.random.fluid_only = v / 2;
        c.random.plain = 1;
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# set abstractions: %.2g\n", worst);
}

static void gradients_of_rollouts_through_graphs_and_histories_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 4; v++) {
        gradient_case c = {.name = "graph",
                           .random = small_basis(2000 + (uint64_t)v, 2 + v % 2),
                           .warm_up = v / 3,
                           .unroll = 2 + v % 2,
                           .constant_positions = v / 2,
                           .samples = 6};
        c.random.graph = 1 + v / 2;
        c.random.history = v % 2 ? 3 : v;
        c.random.radius = 1.45;
        c.random.fluid_only = v / 2;
        c.random.plain = 1;
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# graphs: %.2g\n", worst);
}

static void gradients_of_penalties_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 6; v++) {
        gradient_case c = {.name = "penalties",
                           .random = everything(1700 + (uint64_t)v, 2 + v % 2),
                           .loss = {v % 3 == 0   ? 0.5
                                    : v % 3 == 1 ? -1.0
                                                 : 0.0,
                                    v % 2 ? 3.0 : 0.0, v % 3 ? 2.0 : 0.0, v / 2 % 2 ? 1.5 : 0.0},
                           .unroll = 2};
        c.random.scale *= 2.0;
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# penalties: %.2g\n", worst);
}

/* Clamps, limits, repulsion and surfaces included, each of which some of these cases meet. */
static void gradients_through_the_relaxation_are_right(void **state)
{
    (void)state;
    double worst = 0.0;
    for (int v = 0; v < 8; v++) {
        const int d = 2 + v % 2;
        char text[768];
        (void)snprintf(text, sizeof text,
                       "{\"support\":%s,\"rest_volume\":%s,\"omega\":[0.5,0.4%s],\"epsilon\":0.1,"
                       "\"limit\":%s%s%s%s}",
                       model_number(2.0 * SPACING),
                       model_number((v % 5 == 2 ? 1.6
                                     : v / 4    ? 0.6
                                                : 0.9) *
                                    pow(SPACING, d)),
                       v / 2 % 2 ? "" : ",0.5", model_number((v % 3 ? 0.2 : 0.02) * SPACING),
                       v % 4 ? ",\"divergence\":[0.5,0.5,0.3]" : "",
                       v / 2 % 2 ? ",\"direction\":\"current\"" : "",
                       v % 3 ? ",\"repulsion\":{\"distance\":0.04,\"stiffness\":0.7}" : "");
        if (v > 4)
            (void)snprintf(text + strlen(text) - 1, sizeof text - strlen(text) + 1,
                           ",\"guess\":\"guess\"}");
        if (v % 2)
            (void)snprintf(text + strlen(text) - 1, sizeof text - strlen(text) + 1,
                           ",\"rounds\":{\"most\":%d,\"above\":0.3,\"left\":%s}}", 2 + v / 4,
                           v % 4 == 1 ? "0.1" : "0.3");
        if (v % 4 != 1)
            (void)snprintf(text + strlen(text) - 1, sizeof text - strlen(text) + 1,
                           ",\"hyperviscosity\":{\"shares\":[0.5%s],\"below\":%s}}",
                           v / 2 % 2 ? ",0.3" : "", v % 2 ? "20" : "0.5");
        gradient_case c = {.name = "relaxation",
                           .random = everything(1800 + (uint64_t)v, d),
                           .unroll = 1 + v % 3,
                           .constant_positions = v / 3 % 2,
                           .loss = {.velocity_weight = v % 4 ? 0.7 : 0.0},
                           .samples = 10};
        c.random.relaxation = text;
        c.random.guess = v > 4;
        c.learn = v % 4 ? 15 : 7;
        worst = fmax(worst, check_gradient(&c));
    }
    print_message("# relaxation: %.2g\n", worst);
}

/* ---- Promises ---- */

static ascc_trainer_options augmented(void)
{
    static const ascc_training_stage stages[2] = {
        {.end = 3, .unroll = 1, .learning_rate = 1e-3, .learning_rate_end = 5e-4},
        {.end = 1000, .unroll = 2, .warm_up = 2, .learning_rate = 5e-4}};
    ascc_trainer_options o = default_options();
    o.stage = stages;
    o.stage_count = 2;
    o.batch = 4;
    o.average = 0.9;
    o.jitter = 0.02;
    o.rotate = 1;
    o.mirror = 1;
    o.density_weight = 0.1;
    o.wall_weight = 0.1;
    return o;
}

static void assert_same_models(ascc_trainer *a, ascc_trainer *b)
{
    for (int32_t averaged = 0; averaged < 2; averaged++) {
        size_t size, other;
        const void *x = ascc_trainer_model(a, averaged, &size);
        const void *y = ascc_trainer_model(b, averaged, &other);
        assert_non_null(x);
        assert_non_null(y);
        assert_int_equal(size, other);
        assert_memory_equal(x, y, size);
    }
}

static void same_seed_gives_the_same_weights_for_any_threads(void **state)
{
    (void)state;
    for (int v = 0; v < 2; v++) {
        const model_random random = everything(21, 2 + v);
        motion *m = make_motion(5, 2 + v);
        ascc_trainer_options one = augmented(), two = augmented(), other = augmented();
        other.seed++;
        two.memory_limit = (size_t)v; /* and for any memory */
        ascc_trainer *a = open_trainer(&one, &random, m);
        ascc_trainer *b = open_threaded(2, &two, &random, m);
        ascc_trainer *c = open_trainer(&other, &random, m);
        float *before = parameters_of(a);
        iterate(a, 5);
        iterate(b, 5);
        iterate(c, 5);
        assert_same_models(a, b);
        const size_t size = ascc_trainer_parameter_count(a) * sizeof(float);
        float *after = parameters_of(a), *differ = parameters_of(c);
        assert_memory_not_equal(before, after, size);
        assert_memory_not_equal(differ, after, size);
        free(before);
        free(after);
        free(differ);
        ascc_trainer_destroy(&a);
        ascc_trainer_destroy(&b);
        ascc_trainer_destroy(&c);
        free(m);
    }
}

static void a_sequence_may_have_fewer_steps_before_and_noise_of_its_own(void **state)
{
    (void)state;
    static const ascc_training_stage many = {
        .end = 1000, .unroll = 1, .warm_up = 4, .learning_rate = 1e-3};
    static const ascc_training_stage few = {
        .end = 1000, .unroll = 1, .warm_up = 2, .learning_rate = 1e-3};
    const model_random random = small(27, 2);
    motion *m = make_motion(9, 2);
    ascc_trainer_options o = augmented();
    o.stage_count = 1;
    o.truth_share = 0.25;
    o.stage = &few;
    ascc_trainer *a = open_trainer(&o, &random, m);
    o.stage = &many;
    ascc_trainer *other = open_trainer(&o, &random, m);
    m->sequence.warm_up = 2;
    ascc_trainer *b = open_trainer(&o, &random, m);
    iterate(a, 3);
    iterate(b, 3);
    iterate(other, 3);
    assert_same_models(a, b);
    float *x = parameters_of(a), *y = parameters_of(other);
    assert_memory_not_equal(x, y, ascc_trainer_parameter_count(a) * sizeof *x);
    free(x);
    free(y);
    m->sequence.jitter = 0.1;
    ascc_trainer *noisy = open_trainer(&o, &random, m);
    iterate(noisy, 3);
    float *z = parameters_of(noisy);
    float *of_b = parameters_of(b);
    assert_memory_not_equal(z, of_b, ascc_trainer_parameter_count(a) * sizeof *z);
    free(z);
    free(of_b);
    ascc_trainer_destroy(&noisy);
    m->sequence.jitter = -0.1;
    assert_int_equal(ascc_trainer_add_sequence(b, &m->sequence), ASCC_ERROR_ARGUMENT);
    m->sequence.jitter = 0.0;
    m->sequence.warm_up = -1;
    assert_int_equal(ascc_trainer_add_sequence(b, &m->sequence), ASCC_ERROR_ARGUMENT);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    ascc_trainer_destroy(&other);
    free(m);
}

/* In one of the host's floating point environments; false: it failed, or left another one. */
#define IN_MODE(mode, call)                                                                        \
    (float_state_set(mode), kept = (call) == ASCC_OK && float_state() == (mode),                   \
     float_state_set(FLOAT_DEFAULT), kept)

static void the_hosts_floating_point_environment_changes_no_weight(void **state)
{
    (void)state;
    char path[] = "/tmp/ascc-train-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    const model_random random = everything(25, 2);
    motion *m = make_motion(8, 2);
    size_t size;
    unsigned char *bytes = model_builder_random(&random, &size);
    const ascc_trainer_options options = augmented();
    ascc_trainer *right = open_trainer(&options, &random, m);
    iterate(right, 2);
    float *values = parameters_of(right);
    for (size_t i = 0; i < 2 * FLOAT_MODE_COUNT; i++) {
        const uint64_t mode = float_modes[i / 2].state;
        const ascc_context_options threads = {.size = sizeof threads,
                                              .thread_count = 1 + (int32_t)(i % 2)};
        ascc_train_context *train = NULL;
        ascc_trainer *t;
        ascc_training_report report = {.size = sizeof report};
        double loss;
        bool kept;
        assert_true(IN_MODE(mode, ascc_train_context_create(&threads, &train)));
        assert_true(IN_MODE(mode, ascc_trainer_create(train, &options, bytes, size, &t)));
        assert_true(IN_MODE(mode, ascc_trainer_add_sequence(t, &m->sequence)));
        assert_true(IN_MODE(mode, ascc_trainer_gradient(t, 0, 1, 0, 1, &loss, NULL)));
        assert_true(IN_MODE(mode, ascc_trainer_iterate(t, &report)));
        assert_true(IN_MODE(mode, ascc_trainer_save(t, path)));
        assert_true(IN_MODE(mode, ascc_trainer_load(t, path)));
        assert_true(IN_MODE(mode, ascc_trainer_iterate(t, &report)));
        assert_same_models(t, right);
        assert_true(IN_MODE(mode, ascc_trainer_get_parameters(t, values)));
        assert_true(IN_MODE(mode, ascc_trainer_set_parameters(t, values)));
        ascc_trainer_destroy(&t);
        ascc_train_context_destroy(&train);
    }
    remove(path);
    free(values);
    free(bytes);
    ascc_trainer_destroy(&right);
    free(m);
}

static void going_on_from_a_saved_state_gives_the_same_bits(void **state)
{
    (void)state;
    char path[] = "/tmp/ascc-train-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    const model_random random = everything(22, 2), another = small(22, 2);
    motion *m = make_motion(6, 2);
    const ascc_trainer_options o = augmented();
    ascc_trainer *a = open_threaded(2, &o, &random, m);
    ascc_trainer *b = open_threaded(2, &o, &random, m);
    ascc_trainer *c = open_trainer(&o, &another, m);
    iterate(a, 3);
    assert_int_equal(ascc_trainer_save(a, path), ASCC_OK);
    iterate(a, 3);
    assert_int_equal(ascc_trainer_load(b, path), ASCC_OK);
    assert_int_equal(ascc_trainer_iteration(b), 3);
    iterate(b, 3);
    assert_same_models(a, b);
    assert_int_equal(ascc_trainer_load(c, path), ASCC_ERROR_MISMATCH);
    assert_int_equal(ascc_trainer_iteration(c), 0);
    assert_int_equal(ascc_trainer_load(c, "/nowhere/at/all"), ASCC_ERROR_FILE);
    assert_int_equal(ascc_trainer_save(c, "/nowhere/at/all"), ASCC_ERROR_FILE);
    assert_int_equal(truncate(path, 100), 0); /* it is another file than the one made first */
    assert_int_equal(ascc_trainer_load(c, path), ASCC_ERROR_FORMAT);
    assert_int_equal(remove(path), 0);
    (void)close(file);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    ascc_trainer_destroy(&c);
    free(m);
}

static void a_sequence_with_a_nan_is_refused_by_name(void **state)
{
    (void)state;
    const model_random random = small(23, 2);
    const ascc_trainer_options o = default_options();
    motion *m = make_motion(7, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, NULL);
    m->position[(3 * m->fluid_count + 4) * 2] = NAN;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_NOT_FINITE);
    assert_non_null(strstr(ascc_trainer_message(trainer), "shaken"));
    assert_non_null(strstr(ascc_trainer_message(trainer), "frame 3"));
    m->position[(3 * m->fluid_count + 4) * 2] = 0.01f;
    m->wall[3] = INFINITY;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_NOT_FINITE);
    assert_non_null(strstr(ascc_trainer_message(trainer), "shaken"));
    ascc_training_report report = {.size = sizeof report}; /* none was added */
    assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_ERROR_ARGUMENT);
    ascc_trainer_destroy(&trainer);
    free(m);
}

static void a_sequence_of_another_dimension_is_refused_by_name(void **state)
{
    (void)state;
    const model_random random = small(24, 3);
    const ascc_trainer_options o = default_options();
    motion *m = make_motion(8, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, NULL);
    m->sequence.dimension = 2;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_MISMATCH);
    assert_non_null(strstr(ascc_trainer_message(trainer), m->sequence.name));
    assert_non_null(strstr(ascc_trainer_message(trainer), "a 3D model cannot learn from 2D"));
    ascc_trainer_destroy(&trainer);
    free(m);
    m = make_motion(8, 3);
    trainer = open_trainer(&o, &random, NULL);
    m->sequence.dimension = 3;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_OK);
    ascc_trainer_destroy(&trainer);
    free(m);
}

static void a_sequence_without_interval_or_too_long_a_one_or_too_short_is_refused(void **state)
{
    (void)state;
    const model_random random = small(24, 2);
    const ascc_trainer_options o = default_options();
    const double bad[] = {0.0, -TIME_STEP, NAN, INFINITY};
    motion *m = make_motion(8, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, NULL);
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        m->sequence.time_step = bad[i];
        m->sequence.spacing = 0.0;
        assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_ARGUMENT);
        m->sequence.time_step = TIME_STEP;
        m->sequence.spacing = bad[i] == 0.0 ? -1.0 : bad[i];
        assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_ARGUMENT);
    }
    m->sequence.spacing = 0.0;
    m->sequence.time_step = 1.001 * TIME_STEP;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_MISMATCH);
    m->sequence.time_step = TIME_STEP;
    m->sequence.spacing = 0.99 * SPACING;
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_ERROR_MISMATCH);
    m->sequence.spacing = 0.0;
    m->sequence.frame_count =
        3; /* one before the start, the start, one after: unroll 2 needs more */
    (void)ascc_trainer_add_sequence(trainer, &m->sequence);
    ascc_training_report report = {.size = sizeof report};
    assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_ERROR_ARGUMENT);
    ascc_trainer_destroy(&trainer);
    free(m);
}

/* The same motion in other metres and seconds: powers of two, so that nothing is rounded otherwise. */
static void rescale(motion *m, float unit, double time)
{
    for (size_t k = 0; k < sizeof m->position / sizeof *m->position; k++)
        m->position[k] *= unit;
    for (size_t k = 0; k < sizeof m->wall / sizeof *m->wall; k++)
        m->wall[k] *= unit;
    m->sequence.spacing = SPACING * (double)unit;
    m->sequence.time_step = TIME_STEP * time;
    for (int c = 0; c < 3; c++)
        m->sequence.gravity[c] *= (double)unit / (time * time); /* what it was */
}

/* Of a rollout; the gradient is from malloc. */
static float *gradient_of(ascc_trainer *trainer, int32_t warm_up, double *loss)
{
    float *gradient = malloc((ascc_trainer_parameter_count(trainer) + 1) * sizeof *gradient);
    assert_non_null(gradient);
    if (ascc_trainer_gradient(trainer, 0, 2, warm_up, 3, loss, gradient) != ASCC_OK)
        fail_msg("gradient: %s", ascc_trainer_message(trainer));
    return gradient;
}

static void
a_scene_in_other_spacings_has_the_same_gradient_where_time_goes_with_the_root(void **state)
{
    (void)state;
    static const struct {
        float unit;
        double time;
    } cases[] = {{4.0f, 2.0}, {0.25f, 0.5}, {1.0f / 64.0f, 0.125}};
    for (int d = 2; d <= 3; d++)
        for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
            const model_random random = everything(1900 + (uint64_t)i, d);
            ascc_trainer_options o = default_options();
            o.density_weight = o.wall_weight = o.velocity_weight = 0.3;
            motion *m = make_motion(12 + (uint64_t)i, d);
            ascc_trainer *a = open_trainer(&o, &random, m);
            rescale(m, cases[i].unit, cases[i].time);
            ascc_trainer *b = open_trainer(&o, &random, m);
            double loss[2];
            float *one = gradient_of(a, 1, &loss[0]), *two = gradient_of(b, 1, &loss[1]);
            assert_true(loss[0] == loss[1] && loss[0] > 0.0);
            assert_memory_equal(one, two, ascc_trainer_parameter_count(a) * sizeof *one);
            free(one);
            free(two);
            ascc_trainer_destroy(&a);
            ascc_trainer_destroy(&b);
            free(m);
        }
}

/* A floor that rises and slides by a twentieth of a spacing a frame. */
static void move_walls(motion *m, float *wall, float *normal)
{
    const size_t d = (size_t)m->dimension, n = m->wall_count * d;
    for (size_t f = 0; f < FRAMES; f++)
        for (size_t k = 0; k < n; k++) {
            wall[f * n + k] = m->wall[k] + (float)f * (float)SPACING * (k % d < 2 ? 0.05f : 0.0f);
            normal[f * n + k] = m->normal[k];
        }
    m->sequence.boundary_position = wall;
    m->sequence.boundary_normal = normal;
    m->sequence.boundary_moves = 1;
}

static float moving_wall[FRAMES * MAX_POINTS * 3], moving_normal[FRAMES * MAX_POINTS * 3];

static model_random relaxed(uint64_t seed, int d, char *text, size_t capacity)
{
    (void)snprintf(text, capacity,
                   "{\"support\":%s,\"rest_volume\":%s,\"omega\":[0.5,0.4],\"epsilon\":0.1,"
                   "\"limit\":%s,\"divergence\":[0.5,0.5],\"guess\":\"guess\"}",
                   model_number(2.0 * SPACING), model_number(0.8 * pow(SPACING, d)),
                   model_number(0.2 * SPACING));
    model_random random = everything(seed, d);
    random.relaxation = text;
    random.guess = 1;
    return random;
}

/* Where steps are kept and where they are computed again, walls are where their frame has them. */
static void walls_that_move_give_the_same_weights_for_any_memory(void **state)
{
    (void)state;
    for (int d = 2; d <= 3; d++) {
        char text[512];
        const model_random random = relaxed(1950, d, text, sizeof text);
        ascc_trainer_options kept = augmented(), again = augmented();
        again.memory_limit = 1;
        motion *m = make_motion(13, d);
        ascc_trainer *still = open_trainer(&kept, &random, m);
        move_walls(m, moving_wall, moving_normal);
        ascc_trainer *a = open_trainer(&kept, &random, m);
        ascc_trainer *b = open_threaded(2, &again, &random, m);
        iterate(a, 5);
        iterate(b, 5);
        iterate(still, 5);
        assert_same_models(a, b);
        float *moved = parameters_of(a), *rested = parameters_of(still);
        assert_memory_not_equal(moved, rested, ascc_trainer_parameter_count(a) * sizeof *moved);
        free(moved);
        free(rested);
        ascc_trainer_destroy(&a);
        ascc_trainer_destroy(&b);
        ascc_trainer_destroy(&still);
        free(m);
    }
}

/* A step along the gradient changes the loss as its norm says. */
static void gradients_beside_walls_that_move_and_of_short_steps_are_right(void **state)
{
    (void)state;
    for (int v = 0; v < 4; v++) {
        const int d = 2 + v / 2;
        char text[512];
        const model_random random = relaxed(1960 + (uint64_t)d, d, text, sizeof text);
        ascc_trainer_options o = default_options();
        o.wall_weight = 0.3;
        motion *m = make_motion(14, d);
        if (v % 2)
            m->sequence.time_step = 0.6 * TIME_STEP;
        else
            move_walls(m, moving_wall, moving_normal);
        ascc_trainer *t = open_trainer(&o, &random, m);
        const size_t count = ascc_trainer_parameter_count(t);
        double loss, side[2], square = 0.0;
        float *g = gradient_of(t, 0, &loss), *w = parameters_of(t), *moved = parameters_of(t);
        for (size_t k = 0; k < count; k++)
            square += (double)g[k] * (double)g[k];
        const double length = 1e-4 / sqrt(square); /* short of most kinks */
        for (int s = 0; s < 2; s++) {
            for (size_t k = 0; k < count; k++)
                moved[k] = w[k] + (float)((s ? length : -length) * (double)g[k]);
            assert_int_equal(ascc_trainer_set_parameters(t, moved), ASCC_OK);
            assert_int_equal(ascc_trainer_gradient(t, 0, 2, 0, 3, &side[s], NULL), ASCC_OK);
        }
        const double slope = (side[1] - side[0]) / (2.0 * length);
        print_message("# moving walls, short steps: %.6g against %.6g\n", slope, square);
        assert_true(fabs(slope - square) < 2e-2 * square);
        free(g);
        free(w);
        free(moved);
        ascc_trainer_destroy(&t);
        free(m);
    }
}

static void a_rollout_that_blows_up_leaves_the_weights_alone(void **state)
{
    (void)state;
    static const float sizes[] = {1e12f, 1e30f, 3e38f};
    for (int v = 0; v < 6; v++) {
        const model_random random = v / 3 ? everything(25, 2) : small(25, 2);
        const ascc_trainer_options o = default_options();
        motion *m = make_motion(9, 2);
        ascc_trainer *trainer = open_trainer(&o, &random, m);
        float *good = parameters_of(trainer);
        const size_t count = ascc_trainer_parameter_count(trainer);
        float *values = malloc(count * sizeof *values);
        assert_non_null(values);
        for (size_t i = 0; i < count; i++)
            values[i] = good[i] * (good[i] < 1.0f && good[i] > -1.0f ? sizes[v % 3] : 1.0f);
        assert_int_equal(ascc_trainer_set_parameters(trainer, values), ASCC_OK);
        ascc_training_report report = {.size = sizeof report};
        const ascc_status status = ascc_trainer_iterate(trainer, &report);
        assert_true(status != ASCC_OK || report.skipped == o.batch);
        assert_true(status == ASCC_OK || strstr(ascc_trainer_message(trainer), "shaken"));
        float *after = parameters_of(trainer);
        assert_memory_equal(values, after, count * sizeof *values);
        /* and training goes on with better ones as if nothing had been */
        assert_int_equal(ascc_trainer_set_parameters(trainer, good), ASCC_OK);
        iterate(trainer, 1);
        free(after);
        after = parameters_of(trainer);
        for (size_t i = 0; i < count; i++)
            assert_true(isfinite(after[i]));
        assert_memory_not_equal(good, after, count * sizeof *good);
        free(after);
        free(values);
        free(good);
        ascc_trainer_destroy(&trainer);
        free(m);
    }
}

static void weights_that_compute_nothing_are_taken_back(void **state)
{
    (void)state;
    const model_random random = small(25, 2);
    ascc_training_stage stages[] = {{.end = 3, .unroll = 1, .learning_rate = 1e-3},
                                    {.end = 90, .unroll = 1, .learning_rate = 1e30}};
    ascc_trainer_options o = default_options();
    o.stage = stages;
    o.stage_count = 2;
    motion *m = make_motion(9, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, m);
    iterate(trainer, 3);
    float *good = parameters_of(trainer);
    size_t size;
    const void *model = ascc_trainer_model(trainer, 1, &size);
    unsigned char *kept = malloc(size);
    assert_non_null(kept);
    memcpy(kept, model, size);

    iterate(trainer, 1); /* beyond all bounds */
    ascc_training_report report = {.size = sizeof report};
    for (int i = 0; i < 19; i++) {
        assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_OK);
        assert_int_equal(report.skipped, o.batch);
    }
    assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_ERROR_NOT_FINITE);
    assert_non_null(strstr(ascc_trainer_message(trainer), "sequence shaken, frame "));
    assert_non_null(strstr(ascc_trainer_message(trainer), "back at iteration 3,"));
    assert_int_equal(ascc_trainer_iteration(trainer), 3);
    float *after = parameters_of(trainer);
    assert_memory_equal(good, after, ascc_trainer_parameter_count(trainer) * sizeof *good);
    size_t size_after;
    model = ascc_trainer_model(trainer, 1, &size_after);
    assert_int_equal(size_after, size);
    assert_memory_equal(kept, model, size);
    free(after);
    free(kept);
    free(good);
    ascc_trainer_destroy(&trainer);
    free(m);
}

static void twenty_iterations_without_a_gradient_stop_training(void **state)
{
    (void)state;
    const model_random random = small(25, 2);
    ascc_trainer_options o = default_options();
    motion *m = make_motion(9, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, m);
    float *nothing = calloc(ascc_trainer_parameter_count(trainer), sizeof *nothing);
    assert_non_null(nothing);
    assert_int_equal(ascc_trainer_set_parameters(trainer, nothing), ASCC_OK);
    ascc_training_report report = {.size = sizeof report};
    for (int i = 0; i < 19; i++)
        assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_OK);
    assert_true(report.loss > 0.0 && report.gradient_norm == 0.0);
    assert_int_equal(ascc_trainer_iterate(trainer, &report), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_trainer_message(trainer), "exactly 0"));
    free(nothing);
    ascc_trainer_destroy(&trainer);
    free(m);
}

/* The weights after five iterations with so many steps before. */
static float *learned_with(int32_t warm_up, double truth_share, size_t *count)
{
    const model_random random = small(26, 2);
    const ascc_training_stage stage = {
        .end = 9, .unroll = 1, .warm_up = warm_up, .learning_rate = 1e-3};
    ascc_trainer_options o = default_options();
    o.stage = &stage;
    o.truth_share = truth_share;
    motion *m = make_motion(9, 2);
    ascc_trainer *trainer = open_trainer(&o, &random, m);
    iterate(trainer, 5);
    float *values = parameters_of(trainer);
    *count = ascc_trainer_parameter_count(trainer);
    ascc_trainer_destroy(&trainer);
    free(m);
    return values;
}

static void the_share_of_true_states_takes_no_steps_before(void **state)
{
    (void)state;
    size_t count;
    float *none = learned_with(0, 0.0, &count), *all = learned_with(3, 1.0, &count);
    float *half = learned_with(3, 0.5, &count), *usual = learned_with(3, 0.0, &count);
    assert_memory_equal(none, all, count * sizeof *none);
    assert_memory_not_equal(none, half, count * sizeof *none);
    assert_memory_not_equal(usual, half, count * sizeof *none);
    free(none);
    free(all);
    free(half);
    free(usual);
}

static void training_lowers_the_loss(void **state)
{
    (void)state;
    const model_random random = everything(26, 2);
    ascc_trainer_options o = default_options();
    ascc_training_stage stage = {.end = 1000, .unroll = 2, .learning_rate = 3e-3};
    o.stage = &stage;
    motion *m = make_motion(10, 2);
    for (size_t t = 1; t < FRAMES; t++) /* it rests: weights may learn to hold it against gravity */
        memcpy(m->position + t * m->fluid_count * 2, m->position,
               m->fluid_count * 2 * sizeof *m->position);
    ascc_trainer *trainer = open_trainer(&o, &random, m);
    double before, after;
    assert_int_equal(ascc_trainer_gradient(trainer, 0, 1, 0, 2, &before, NULL), ASCC_OK);
    iterate(trainer, 60);
    assert_int_equal(ascc_trainer_gradient(trainer, 0, 1, 0, 2, &after, NULL), ASCC_OK);
    print_message("# loss: %.4g before, %.4g after\n", before, after);
    assert_true(after < 0.7 * before);
    ascc_trainer_destroy(&trainer);
    free(m);
}

/* What a reader makes of the file that a trainer gives, in a context of its own. */
static ascc_model *read_model(ascc_trainer *trainer, ascc_context **context)
{
    size_t size;
    const void *bytes = ascc_trainer_model(trainer, 0, &size);
    assert_non_null(bytes);
    ascc_model *model = NULL;
    assert_int_equal(ascc_context_create(NULL, context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(*context, bytes, size, &model), ASCC_OK);
    return model;
}

/* A relaxation in 2D with these sweeps, as a description has it. */
static void describe_relaxation(char text[320], const char *omega)
{
    (void)snprintf(text, 320,
                   "{\"support\":%s,\"rest_volume\":%s,\"omega\":[%s],"
                   "\"epsilon\":0.1,\"limit\":%s,\"divergence\":[0.5,0.5]}",
                   model_number(2.0 * SPACING), model_number(0.8 * SPACING * SPACING), omega,
                   model_number(0.2 * SPACING));
}

/* Computed forwards, passed through by the gradient: weights learn all the same, and the file keeps it. */
static void a_relaxation_is_trained_with_and_kept(void **state)
{
    (void)state;
    model_random random = everything(26, 2);
    char text[320];
    describe_relaxation(text, "1.862,0.259,0.346,0.662");
    random.relaxation = text;
    const ascc_trainer_options options = augmented();
    motion *m = make_motion(10, 2);
    ascc_trainer *a = open_trainer(&options, &random, m);
    ascc_trainer *b = open_threaded(2, &options, &random, m);
    double before, after;
    assert_int_equal(ascc_trainer_gradient(a, 0, 1, 0, 2, &before, NULL), ASCC_OK);
    iterate(a, 20);
    iterate(b, 20);
    assert_same_models(a, b);
    assert_int_equal(ascc_trainer_gradient(a, 0, 1, 0, 2, &after, NULL), ASCC_OK);
    print_message("# loss: %.4g before, %.4g after\n", before, after);
    assert_true(after < before);
    ascc_context *context = NULL;
    ascc_model *model = read_model(a, &context);
    assert_int_equal(model->plan.relaxation.pressure.count, 4);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    free(m);
}

/* Constants that a model may not have are refused, those that training comes to are taken by a reader, and a state
 * holds them. */
static void constants_of_a_relaxation_are_learned_within_what_a_model_may_have(void **state)
{
    (void)state;
    model_random random = everything(31, 2);
    char text[320];
    describe_relaxation(text, "0.5,0.5,0.5");
    random.relaxation = text;
    ascc_trainer_options options = augmented();
    static const ascc_training_stage fast = {.end = 1000, .unroll = 1, .learning_rate = 0.05};
    motion *m = make_motion(10, 2);
    options.stage = &fast;
    options.stage_count = 1;
    options.learn = 15;
    options.velocity_weight = 1.0; /* divergence changes velocities alone */
    ascc_trainer *a = open_trainer(&options, &random, m);
    ascc_trainer *b = open_threaded(2, &options, &random, m);
    const size_t count = ascc_trainer_parameter_count(a), first = count - 7;
    float *values = parameters_of(a);
    values[first] = 0.1f;
    assert_int_equal(ascc_trainer_set_parameters(a, values), ASCC_OK);
    values[first + 2] = 0.5f; /* sweeps of 0.75, 0.5, 0.5 do not settle */
    assert_int_equal(ascc_trainer_set_parameters(a, values), ASCC_ERROR_ARGUMENT);
    values[first + 2] = (float)NAN;
    assert_int_equal(ascc_trainer_set_parameters(a, values), ASCC_ERROR_ARGUMENT);
    values[first + 2] = values[first] = 0.0f;
    assert_int_equal(ascc_trainer_set_parameters(a, values), ASCC_OK);
    iterate(a, 20);
    iterate(b, 20);
    assert_same_models(a, b);
    ascc_context *context = NULL;
    ascc_model *model = read_model(a, &context);
    const ascc_relaxation *r = &model->plan.relaxation;
    free(values);
    values = parameters_of(a);
    assert_true(r->rest_volume == 0.8 * SPACING * SPACING * (1.0 + (double)values[first]));
    assert_true(r->epsilon == 0.1 * (1.0 + (double)values[first + 1]));
    for (size_t i = 0; i < 3; i++)
        assert_true(r->pressure.omega[i] == 0.5 * (1.0 + (double)values[first + 2 + i]));
    for (size_t i = 0; i < 2; i++)
        assert_true(r->divergence.omega[i] == 0.5 * (1.0 + (double)values[first + 5 + i]));
    for (size_t i = first; i < count; i++)
        assert_true(values[i] != 0.0f);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);

    char path[] = "/tmp/ascc-learned-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    (void)close(file);
    assert_int_equal(ascc_trainer_save(a, path), ASCC_OK);
    ascc_trainer *c = open_trainer(&options, &random, m);
    assert_int_equal(ascc_trainer_load(c, path), ASCC_OK);
    iterate(a, 2);
    iterate(c, 2);
    assert_same_models(a, c);
    (void)unlink(path);
    free(values);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    ascc_trainer_destroy(&c);
    free(m);
}

/* Cuts the network off from every channel that is a vector's: it sees distances alone. */
static void blind(ascc_trainer *trainer, size_t d)
{
    const struct {
        const char *name;
        size_t inputs, seen, outputs; /* one channel is seen */
    } cut[] = {{"conv_fluid.kernel", d + 1, d, 2},
               {"conv_boundary.kernel", 2 * d + 1, 0, 2},
               {"dense_fluid.kernel", d + 1, d, 4}};
    float *values = parameters_of(trainer);
    size_t at = 0;
    ascc_context *context = NULL;
    ascc_model *model = read_model(trainer, &context);
    oracle_tensor list[ORACLE_MAX_TENSORS];
    const size_t tensors = oracle_tensors(model, list);
    for (size_t t = 0; t < tensors; at += list[t++].count)
        for (size_t k = 0; k < sizeof cut / sizeof *cut; k++)
            for (size_t i = 0; strcmp(list[t].name, cut[k].name) == 0 && i < list[t].count; i++)
                if (i / cut[k].outputs % cut[k].inputs != cut[k].seen)
                    values[at + i] = 0.0f;
    assert_int_equal(ascc_trainer_set_parameters(trainer, values), ASCC_OK);
    free(values);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

/* The loss of an iteration, turned and mirrored or not. */
static double augmented_loss(const model_random *random, const motion *m, int rotate, int mirror,
                             bool blinded)
{
    ascc_trainer_options o = default_options();
    o.batch = 8; /* each is mirrored or not by chance */
    o.rotate = rotate;
    o.mirror = mirror;
    o.density_weight = o.wall_weight = 1.0;
    ascc_trainer *trainer = open_trainer(&o, random, m);
    if (blinded)
        blind(trainer, (size_t)m->dimension);
    ascc_training_report report = {.size = sizeof report};
    if (ascc_trainer_iterate(trainer, &report) != ASCC_OK)
        fail_msg("iterate: %s", ascc_trainer_message(trainer));
    ascc_trainer_destroy(&trainer);
    return report.loss;
}

/* What sees distances alone cannot tell when everything is turned, gravity and walls included; what sees
 * vectors can. */
static void augmentation_turns_the_whole_world(void **state)
{
    (void)state;
    for (int v = 0; v < 4; v++) {
        model_random random = small_basis(28, 2 + v % 2);
        random.order = 0;
        random.fluid_only = random.damping = random.walls = random.relative = 1;
        random.motion = 2;
        motion *m = make_motion(12, 2 + v % 2);
        if (v > 1) /* turned about any axis */
            memset(m->sequence.gravity, 0, sizeof m->sequence.gravity);
        const double blinded = augmented_loss(&random, m, 0, 0, true);
        const double seeing = augmented_loss(&random, m, 0, 0, false);
        for (int turned = 1; turned < 4; turned++) {
            const int rotate = turned & 1, mirror = turned >> 1;
            const double error = augmented_loss(&random, m, rotate, mirror, true) - blinded;
            assert_true(fabs(error) < 1e-7 * blinded);
            if (v || mirror) /* in 2D nothing turns about gravity */
                assert_true(fabs(augmented_loss(&random, m, rotate, mirror, false) - seeing) >
                            1e-6 * seeing);
        }
        free(m);
    }
}

static void the_model_that_comes_out_has_the_weights(void **state)
{
    (void)state;
    const model_random random = everything(27, 3);
    const ascc_trainer_options o = default_options();
    motion *m = make_motion(11, 3);
    ascc_trainer *trainer = open_trainer(&o, &random, m);
    iterate(trainer, 2);
    float *values = parameters_of(trainer);
    size_t at = 0;
    ascc_context *context = NULL;
    ascc_model *model = read_model(trainer, &context);
    oracle_tensor list[ORACLE_MAX_TENSORS];
    const size_t tensors = oracle_tensors(model, list);
    for (size_t t = 0; t < tensors; at += list[t++].count) {
        assert_memory_equal(model->weights + list[t].offset, values + at,
                            list[t].count * sizeof(float));
        for (size_t i = 0; strstr(list[t].name, "damping") && i < list[t].count; i++)
            assert_true(values[at + i] >= 0.0f);
    }
    assert_int_equal(at, ascc_trainer_parameter_count(trainer));
    free(values);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    ascc_trainer_destroy(&trainer);
    free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(gradients_of_rollouts_are_right),
        cmocka_unit_test(gradients_with_positions_as_constants_are_right),
        cmocka_unit_test(gradients_of_rollouts_through_set_abstractions_are_right),
        cmocka_unit_test(gradients_of_rollouts_through_graphs_and_histories_are_right),
        cmocka_unit_test(gradients_of_penalties_are_right),
        cmocka_unit_test(gradients_through_the_relaxation_are_right),
        cmocka_unit_test(same_seed_gives_the_same_weights_for_any_threads),
        cmocka_unit_test(a_sequence_may_have_fewer_steps_before_and_noise_of_its_own),
        cmocka_unit_test(the_hosts_floating_point_environment_changes_no_weight),
        cmocka_unit_test(going_on_from_a_saved_state_gives_the_same_bits),
        cmocka_unit_test(a_sequence_with_a_nan_is_refused_by_name),
        cmocka_unit_test(a_sequence_of_another_dimension_is_refused_by_name),
        cmocka_unit_test(a_sequence_without_interval_or_too_long_a_one_or_too_short_is_refused),
        cmocka_unit_test(
            a_scene_in_other_spacings_has_the_same_gradient_where_time_goes_with_the_root),
        cmocka_unit_test(walls_that_move_give_the_same_weights_for_any_memory),
        cmocka_unit_test(gradients_beside_walls_that_move_and_of_short_steps_are_right),
        cmocka_unit_test(a_rollout_that_blows_up_leaves_the_weights_alone),
        cmocka_unit_test(weights_that_compute_nothing_are_taken_back),
        cmocka_unit_test(twenty_iterations_without_a_gradient_stop_training),
        cmocka_unit_test(the_share_of_true_states_takes_no_steps_before),
        cmocka_unit_test(training_lowers_the_loss),
        cmocka_unit_test(a_relaxation_is_trained_with_and_kept),
        cmocka_unit_test(constants_of_a_relaxation_are_learned_within_what_a_model_may_have),
        cmocka_unit_test(augmentation_turns_the_whole_world),
        cmocka_unit_test(the_model_that_comes_out_has_the_weights),
    };
    return cmocka_run_group_tests_name("train", tests, NULL, NULL);
}
