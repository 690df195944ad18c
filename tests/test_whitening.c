/* What whitening promises: white inputs, the same network, steps that are those of the whitened weights.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <unistd.h>

#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"
#include "train/trainer.h"

#define SPACING 0.05
#define TIME_STEP 0.005 /* of model_builder_random */
#define FRAMES 6
#define MAX_POINTS 64

/* ---- A sequence: each particle keeps its own velocity, so that all frames have the same ---- */

typedef struct motion {
    size_t dimension, fluid_count, wall_count;
    double velocity[MAX_POINTS * 3]; /* as floats of positions have it, m/s */
    float position[FRAMES * MAX_POINTS * 3], wall[MAX_POINTS * 3], normal[MAX_POINTS * 3];
    ascc_training_sequence sequence;
} motion;

static motion *make_motion(uint64_t seed, size_t dimension, size_t walls)
{
    motion *m = calloc(1, sizeof *m);
    assert_non_null(m);
    dice d = {seed * 31 + 7};
    m->dimension = dimension;
    m->fluid_count = dimension == 2 ? 20 : 27;
    m->wall_count = walls;
    for (size_t i = 0; i < m->fluid_count; i++) {
        const size_t side = dimension == 2 ? 5 : 3;
        const size_t at[3] = {i % side, dimension == 2 ? i / side : i / 9, i / 3 % 3};
        for (size_t c = 0; c < dimension; c++) {
            const double x = ((double)at[c] + 0.4 + dice_uniform(&d, -0.2, 0.2)) * SPACING;
            const double v = dice_uniform(&d, -0.1, 0.1) * SPACING;
            m->velocity[i * dimension + c] = v / TIME_STEP;
            for (size_t t = 0; t < FRAMES; t++)
                m->position[(t * m->fluid_count + i) * dimension + c] = (float)(x + v * (double)t);
        }
    }
    for (size_t i = 0; i < walls; i++) {
        m->wall[i * dimension] = (float)(((double)(i % 4) + dice_uniform(&d, -0.2, 0.2)) * SPACING);
        m->wall[i * dimension + 1] = (float)(-0.3 * SPACING);
        m->normal[i * dimension + 1] = 1.0f;
    }
    m->sequence = (ascc_training_sequence){.size = sizeof m->sequence,
                                           .name = "drifting",
                                           .frame_count = FRAMES,
                                           .fluid_count = m->fluid_count,
                                           .boundary_count = walls,
                                           .position = m->position,
                                           .boundary_position = m->wall,
                                           .boundary_normal = m->normal,
                                           .time_step = TIME_STEP,
                                           .gravity = {0.0, -9.0, 0.0}};
    return m;
}

/* ---- Networks and trainers ---- */

/* Kernels on grids, with dense terms that read features. */
static model_random grids(uint64_t seed, int dimension)
{
    return (model_random){.seed = seed,
                          .dimension = dimension,
                          .spacing = SPACING,
                          .channels = 8,
                          .trunk_layers = 1,
                          .cells = 3,
                          .output_cells = 4,
                          .scale = 0.02};
}

static model_random bases(uint64_t seed, int dimension)
{
    model_random r = grids(seed, dimension);
    r.bumps = 2;
    r.order = 1;
    r.fluid_only = r.relative = r.damping = r.walls = r.transfer = 1;
    r.motion = 2;
    r.levels = 2;
    r.trunk_layers = 2;
    r.method = "voxel_corners";
    r.no_hysteresis = 1;
    r.evaluate = "advected";
    return r;
}

static model_random moments(uint64_t seed, int dimension)
{
    model_random r = grids(seed, dimension);
    r.bumps = 2;
    r.order = 1;
    r.fluid_only = r.walls = 1;
    r.motion = 2;
    r.moments = 3;
    r.evaluate = "advected";
    return r;
}

/* A trunk of stencils that reads sums of features and of moments. */
static model_random lattice(uint64_t seed, int dimension)
{
    model_random r = moments(seed, dimension);
    r.lattice = 1;
    r.levels = 3;
    r.motion = 3;
    r.method = "voxel_corners";
    r.no_hysteresis = 1;
    return r;
}

static const ascc_training_stage only_stage = {.end = 1000, .unroll = 1, .learning_rate = 1e-3};

static ascc_trainer_options options_of(int32_t whiten)
{
    return (ascc_trainer_options){.size = sizeof(ascc_trainer_options),
                                  .seed = 3,
                                  .batch = 3,
                                  .stage = &only_stage,
                                  .stage_size = sizeof only_stage,
                                  .stage_count = 1,
                                  .average = 0.9,
                                  .clip = 1e30,
                                  .whiten = whiten};
}

static ascc_trainer *open_in(const ascc_context_options *context,
                             const ascc_trainer_options *options, const model_random *random,
                             const motion *m)
{
    ascc_train_context *train = NULL;
    ascc_trainer *trainer = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    assert_int_equal(ascc_train_context_create(context, &train), ASCC_OK);
    assert_int_equal(ascc_trainer_create(train, options, bytes, size, &trainer), ASCC_OK);
    ascc_train_context_destroy(&train); /* the trainer lives on */
    free(bytes);
    assert_int_equal(ascc_trainer_add_sequence(trainer, &m->sequence), ASCC_OK);
    return trainer;
}

static ascc_trainer *open_trainer(const ascc_trainer_options *options, const model_random *random,
                                  const motion *m)
{
    return open_in(NULL, options, random, m);
}

static void iterate(ascc_trainer *trainer, int count)
{
    ascc_training_report report = {.size = sizeof report};
    for (int i = 0; i < count; i++)
        if (ascc_trainer_iterate(trainer, &report) != ASCC_OK)
            fail_msg("iterate: %s", ascc_trainer_message(trainer));
}

static double *random_numbers(dice *d, size_t count)
{
    double *values = malloc((count + 1) * sizeof *values);
    assert_non_null(values);
    for (size_t i = 0; i < count; i++)
        values[i] = dice_uniform(d, -1.0, 1.0);
    return values;
}

static const float *mean_of(const ascc_trainer *t, size_t i)
{
    return t->whitening.number + t->whitening.term[i].number;
}

/* T[i][k] of a term. */
static double transform_at(const ascc_trainer *t, const ascc_whitened_term *term, size_t i,
                           size_t k)
{
    const float *transform = t->whitening.number + term->number + term->length;
    return term->full ? (double)transform[i * term->length + k]
           : i == k   ? (double)transform[i]
                      : 0.0;
}

/* ---- White ---- */

enum { SIZE = 30, STILL = 11 };

/* sum over i, j of left[i][k] middle[i][j] left[j][l] */
static double sandwich(const double *left, const double *middle, size_t k, size_t l)
{
    double sum = 0.0;
    for (size_t i = 0; i < SIZE; i++)
        for (size_t j = 0; j < SIZE; j++)
            sum += left[i * SIZE + k] * middle[i * SIZE + j] * left[j * SIZE + l];
    return sum;
}

/* With the floor added, T^T C T is diagonal; without it, its diagonal is 1. Sizes differ by a factor of 1000, and
 * with fewer vectors than columns most eigenvalues are 0. */
static void transforms_are_white_up_to_the_floor(void **state)
{
    (void)state;
    for (size_t vectors = 5; vectors < 100; vectors += 40) {
        dice d = {vectors};
        double c[SIZE * SIZE] = {0.0}, floored[SIZE * SIZE], used[SIZE * SIZE], scale[2 * SIZE];
        double transform[SIZE * SIZE];
        for (size_t v = 0; v < vectors; v++) {
            double x[SIZE], common = dice_uniform(&d, -1.0, 1.0);
            for (size_t i = 0; i < SIZE; i++)
                x[i] = i == STILL ? 0.0
                                  : pow(10.0, (double)(i % 4) - 2.0) *
                                        (common + dice_uniform(&d, -1.0, 1.0));
            for (size_t i = 0; i < SIZE; i++)
                for (size_t j = 0; j < SIZE; j++)
                    c[i * SIZE + j] += x[i] * x[j] / (double)vectors;
        }
        memcpy(used, c, sizeof c);
        memcpy(floored, c, sizeof c);
        for (size_t i = 0; i < SIZE; i++)
            floored[i * SIZE + i] += ASCC_WHITENING_FLOOR * pow(sqrt(c[i * SIZE + i]) + 1e-3, 2.0);
        ascc_whitening_transform(used, SIZE, scale, transform);
        for (size_t k = 0; k < SIZE; k++) {
            const double own = sandwich(transform, floored, k, k);
            if (k != STILL)
                assert_true(fabs(sandwich(transform, c, k, k) - 1.0) < 1e-9);
            for (size_t l = 0; l < SIZE; l++) {
                const double other = sandwich(transform, floored, l, l);
                if (k == STILL || l == STILL)
                    assert_true(transform[k * SIZE + l] == (k == l ? 1.0 : 0.0));
                else if (k != l)
                    assert_true(fabs(sandwich(transform, floored, k, l)) <
                                1e-9 * sqrt(own * other));
            }
        }
    }
}

/* A dense term that reads the features: its columns are 1 and the velocities after a step of gravity. */
static void measured_columns_become_white(void **state)
{
    (void)state;
    for (int dimension = 2; dimension < 4; dimension++) {
        const size_t n = (size_t)dimension;
        const model_random random = grids(3, dimension);
        const ascc_trainer_options o = options_of(0);
        motion *m = make_motion(4, n, 12);
        ascc_trainer *t = open_trainer(&o, &random, m);
        iterate(t, 1);
        size_t k = 0;
        while (t->model->plan.term[t->whitening.term[k].term].source != 0 ||
               strcmp(t->model->plan.term[t->whitening.term[k].term].operation->name, "dense") != 0)
            assert_true(++k < t->whitening.term_count);
        const ascc_whitened_term *term = &t->whitening.term[k];
        const float *mean = mean_of(t, k);
        assert_int_equal(term->length, 1 + n);
        double want[3] = {0.0}, c[3][3] = {{0.0}};
        for (size_t i = 0; i < m->fluid_count; i++)
            for (size_t a = 0; a < n; a++)
                want[a] += (m->velocity[i * n + a] + (a == 1 ? -9.0 * TIME_STEP : 0.0)) /
                           (double)m->fluid_count;
        for (size_t i = 0; i < m->fluid_count; i++)
            for (size_t a = 0; a < n; a++)
                for (size_t b = 0; b < n; b++)
                    c[a][b] +=
                        (m->velocity[i * n + a] + (a == 1 ? -9.0 * TIME_STEP : 0.0) - want[a]) *
                        (m->velocity[i * n + b] + (b == 1 ? -9.0 * TIME_STEP : 0.0) - want[b]) /
                        (double)m->fluid_count;
        /* "one" does not vary and stays as it is */
        assert_true(mean[0] == 0.0f && transform_at(t, term, 0, 0) == 1.0);
        for (size_t a = 0; a < n; a++) {
            assert_true(fabs((double)mean[1 + a] - want[a]) < 1e-4);
            assert_true(transform_at(t, term, 0, 1 + a) == 0.0);
            for (size_t b = 0; b < n; b++) {
                double white = 0.0;
                for (size_t i = 0; i < n; i++)
                    for (size_t j = 0; j < n; j++)
                        white += transform_at(t, term, 1 + i, 1 + a) * c[i][j] *
                                 transform_at(t, term, 1 + j, 1 + b);
                /* eigenvalues are about 1, the floor is 0.03 of that */
                assert_true(fabs(white - (a == b ? 1.0 : 0.0)) < (a == b ? 1e-3 : 0.03));
            }
        }
        ascc_trainer_destroy(&t);
        free(m);
    }
}

/* First layers alone: what reads features or moments, and nothing that reads a layer with weights. */
static void first_layers_are_found(void **state)
{
    (void)state;
    const model_random random[4] = {grids(5, 2), bases(5, 2), moments(5, 2), lattice(5, 2)};
    static const char *const want[4] = {
        "conv_fluid.kernel conv_boundary.kernel dense_fluid.kernel dense_boundary.kernel ",
        "conv_fluid.kernel conv_boundary.kernel dense_fluid.kernel ",
        "dense_sums.kernel dense_fluid.kernel ",
        "d1.stencil d1.sums.kernel d2.stencil dense_sums.kernel dense_fluid.kernel "};
    for (size_t v = 0; v < 4; v++) {
        const ascc_trainer_options o = options_of(0);
        motion *m = make_motion(4, 2, 12);
        ascc_trainer *t = open_trainer(&o, &random[v], m);
        char found[512] = "";
        for (size_t i = 0; i < t->whitening.term_count; i++)
            for (size_t k = 0; k < t->tensor_count; k++)
                if (t->tensor[k].first == t->whitening.term[i].weight) {
                    strcat(found, t->file.tensor[k].name);
                    strcat(found, " ");
                }
        assert_string_equal(found, want[v]);
        ascc_trainer_destroy(&t);
        free(m);
    }
}

/* ---- The same network, steps of the whitened weights ---- */

/* y = z W' + b' = x W + b for any x. */
static void folded_weights_give_the_same_values(void **state)
{
    (void)state;
    const model_random random[3] = {bases(6, 3), moments(6, 3), lattice(6, 3)};
    for (size_t v = 0; v < 3; v++) {
        const ascc_trainer_options o = options_of(0);
        motion *m = make_motion(5, 3, 12);
        ascc_trainer *t = open_trainer(&o, &random[v], m);
        iterate(t, 1);
        dice d = {7};
        for (size_t k = 0; k < t->whitening.term_count; k++) {
            const ascc_whitened_term *term = &t->whitening.term[k];
            const size_t n = term->length, b = term->outputs;
            const bool biased = term->bias != ASCC_WHITENING_NONE;
            double *white = random_numbers(&d, t->parameter_count);
            double *folded = calloc(t->parameter_count, sizeof *folded);
            double *x = random_numbers(&d, n);
            assert_non_null(folded);
            /* only this term's: others share its bias */
            memcpy(folded + term->weight, white + term->weight, n * b * sizeof *folded);
            if (biased)
                memcpy(folded + term->bias, white + term->bias, b * sizeof *folded);
            ascc_whitening_step(&t->whitening, folded);
            for (size_t i = 0; i < n; i++) /* as large as such columns are */
                x[i] = (double)mean_of(t, k)[i] + x[i] / transform_at(t, term, i, i);
            for (size_t o2 = 0; o2 < b; o2++) {
                double a = biased ? white[term->bias + o2] : 0.0, size = fabs(a);
                double y = biased ? folded[term->bias + o2] : 0.0;
                for (size_t i = 0; i < n; i++) {
                    y += x[i] * folded[term->weight + i * b + o2];
                    for (size_t j = 0; j < n; j++) {
                        const double part = (x[i] - (double)mean_of(t, k)[i]) *
                                            transform_at(t, term, i, j) *
                                            white[term->weight + j * b + o2];
                        a += part;
                        size += fabs(part);
                    }
                }
                assert_true(fabs(a - y) < 1e-9 * size);
            }
            free(white);
            free(folded);
            free(x);
        }
        ascc_trainer_destroy(&t);
        free(m);
    }
}

/* 1 for the weights and biases of first layers, for others 0. */
static double in_first_layer(const ascc_trainer *t, size_t parameter)
{
    for (size_t i = 0; i < t->whitening.term_count; i++) {
        const ascc_whitened_term *w = &t->whitening.term[i];
        if ((parameter >= w->weight && parameter < w->weight + w->length * w->outputs) ||
            (w->bias != ASCC_WHITENING_NONE && parameter >= w->bias &&
             parameter < w->bias + w->outputs))
            return 1.0;
    }
    return 0.0;
}

/* The central difference of the loss along a direction of the model's weights. */
static double slope_along(ascc_trainer *t, const float *start, const double *direction,
                          double length)
{
    const size_t count = t->parameter_count;
    float *moved = malloc(count * sizeof *moved);
    double loss[2];
    assert_non_null(moved);
    for (int s = 0; s < 2; s++) {
        for (size_t i = 0; i < count; i++)
            moved[i] = (float)((double)start[i] + (s ? -length : length) * direction[i]);
        assert_int_equal(ascc_trainer_set_parameters(t, moved), ASCC_OK);
        assert_int_equal(ascc_trainer_gradient(t, 0, 1, 0, 1, &loss[s], NULL), ASCC_OK);
    }
    free(moved);
    return (loss[0] - loss[1]) / (2.0 * length);
}

/* Along a direction of W' and b' that all of the gradient has a part in, the loss changes as it says; kinks of the
 * network spoil long differences, rounding short ones. */
static void gradients_are_those_of_the_whitened_weights(void **state)
{
    (void)state;
    const model_random random[4] = {grids(8, 2), bases(8, 3), moments(8, 2), lattice(8, 2)};
    for (size_t v = 0; v < 4; v++) {
        const ascc_trainer_options o = options_of(0);
        motion *m = make_motion(6, v == 1 ? 3 : 2, 12);
        ascc_trainer *t = open_trainer(&o, &random[v], m);
        iterate(t, 1);
        const size_t count = t->parameter_count;
        float *gradient = malloc(count * sizeof *gradient), *start = malloc(count * sizeof *start);
        assert_true(gradient && start);
        dice d = {9};
        double loss, way = 0.0, largest = 0.0, best = INFINITY;
        assert_int_equal(ascc_trainer_get_parameters(t, start), ASCC_OK);
        assert_int_equal(ascc_trainer_gradient(t, 0, 1, 0, 1, &loss, gradient), ASCC_OK);
        ascc_whitening_gradient(&t->whitening, gradient);
        double *direction = random_numbers(&d, count);
        for (size_t i = 0; i < count; i++) {
            direction[i] = copysign(direction[i], (double)gradient[i]) * in_first_layer(t, i);
            way += (double)gradient[i] * direction[i];
        }
        ascc_whitening_step(&t->whitening, direction);
        for (size_t i = 0; i < count; i++)
            largest = fmax(largest, fabs(direction[i]));
        for (double length = 1e-2; length > 1e-5; length *= 0.5)
            best = fmin(best, fabs(slope_along(t, start, direction, length / largest) / way - 1.0));
        if (!(best < 3e-3))
            fail_msg("network %zu: a slope is off by %.2g of it", v, best);
        free(gradient);
        free(start);
        free(direction);
        ascc_trainer_destroy(&t);
        free(m);
    }
}

/* Adam's first step on W' and b', carried over. */
static void an_iteration_is_a_step_of_the_whitened_weights(void **state)
{
    (void)state;
    const model_random random = bases(10, 2);
    const ascc_trainer_options white = options_of(0), plain = options_of(-1);
    motion *m = make_motion(7, 2, 12);
    ascc_trainer *a = open_trainer(&white, &random, m), *b = open_trainer(&plain, &random, m);
    const size_t count = a->parameter_count;
    float *before = malloc(count * sizeof *before);
    double *step = malloc(count * sizeof *step);
    assert_true(before && step);
    assert_int_equal(ascc_trainer_get_parameters(a, before), ASCC_OK);
    iterate(a, 1);
    iterate(b, 1);
    /* the gradient of the same rollouts, by W */
    float *gradient = b->gradient;
    ascc_whitening_gradient(&a->whitening, gradient);
    for (size_t i = 0; i < count; i++) {
        const double g = (double)gradient[i];
        assert_true((double)a->moment1[i] == (double)(float)((1.0 - 0.9) * g));
        step[i] = only_stage.learning_rate * g / (fabs(g) + 1e-8);
    }
    ascc_whitening_step(&a->whitening, step);
    for (size_t i = 0; i < a->tensor_count; i++)
        for (size_t k = a->tensor[i].first; k < a->tensor[i].first + a->tensor[i].count; k++) {
            double want = (double)before[k] - step[k];
            if (a->tensor[i].damps && want < 0.0)
                want = 0.0;
            assert_true(fabs((double)a->weights[k] - want) < 1e-6 * fmax(fabs(want), 1.0));
        }
    free(before);
    free(step);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    free(m);
}

/* ---- Bits ---- */

static void assert_same_bits(const ascc_trainer *a, const ascc_trainer *b)
{
    assert_int_equal(a->parameter_count, b->parameter_count);
    assert_memory_equal(a->weights, b->weights, 4 * a->parameter_count * sizeof *a->weights);
    assert_memory_equal(a->whitening.number, b->whitening.number,
                        a->whitening.number_count * sizeof *a->whitening.number);
}

static void threads_do_not_change_the_bits(void **state)
{
    (void)state;
    const model_random random = moments(11, 3);
    motion *m = make_motion(8, 3, 12);
    ascc_trainer *t[3];
    for (int32_t i = 0; i < 3; i++) {
        const ascc_context_options threads = {.size = sizeof threads, .thread_count = 1 + i};
        ascc_trainer_options o = options_of(0);
        o.rotate = o.mirror = 1;
        o.jitter = 0.01;
        t[i] = open_in(&threads, &o, &random, m);
        iterate(t[i], 3);
    }
    assert_same_bits(t[0], t[1]);
    assert_same_bits(t[0], t[2]);
    for (int i = 0; i < 3; i++)
        ascc_trainer_destroy(&t[i]);
    free(m);
}

/* A state has its whitening: the same bits even where the sequences are not the same any more. */
static void a_saved_state_goes_on_with_its_own_whitening(void **state)
{
    (void)state;
    char path[] = "/tmp/ascc-whitening-XXXXXX";
    const int file = mkstemp(path);
    assert_true(file >= 0);
    (void)close(file);
    const model_random random = bases(12, 2);
    const ascc_trainer_options white = options_of(0), plain = options_of(-1);
    motion *m = make_motion(9, 2, 12), *other = make_motion(10, 2, 12);
    ascc_trainer *a = open_trainer(&white, &random, m), *b = open_trainer(&white, &random, m);
    ascc_trainer *c = open_trainer(&plain, &random, m);
    ascc_trainer *d = open_trainer(&white, &random, other);
    assert_int_equal(ascc_trainer_save(a, path), ASCC_OK); /* nothing is measured yet */
    assert_int_equal(ascc_trainer_load(b, path), ASCC_OK);
    assert_int_equal(ascc_trainer_load(c, path), ASCC_OK);
    iterate(a, 2);
    assert_int_equal(ascc_trainer_save(a, path), ASCC_OK);
    assert_int_equal(ascc_trainer_load(d, path), ASCC_OK);
    assert_memory_equal(a->whitening.number, d->whitening.number,
                        a->whitening.number_count * sizeof *a->whitening.number);
    iterate(b, 2);
    assert_same_bits(a, b);
    iterate(b, 2);
    assert_int_equal(ascc_trainer_load(b, path), ASCC_OK);
    iterate(a, 2);
    iterate(b, 2);
    assert_same_bits(a, b);
    /* moments of whitened weights are none of others */
    iterate(c, 1);
    assert_int_equal(ascc_trainer_load(c, path), ASCC_ERROR_MISMATCH);
    assert_non_null(strstr(ascc_trainer_message(c), "with whitened inputs"));
    assert_int_equal(ascc_trainer_save(c, path), ASCC_OK);
    assert_int_equal(ascc_trainer_load(a, path), ASCC_ERROR_MISMATCH);
    assert_non_null(strstr(ascc_trainer_message(a), "without whitened inputs"));
    assert_same_bits(a, b);
    assert_int_equal(remove(path), 0);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    ascc_trainer_destroy(&c);
    ascc_trainer_destroy(&d);
    free(m);
    free(other);
}

/* ---- Little to go by ---- */

/* No walls, a single particle, a fluid without motion: what does not vary stays as it is. */
static void columns_that_do_not_vary_stay_as_they_are(void **state)
{
    (void)state;
    for (int v = 0; v < 3; v++) {
        const model_random random = v == 2 ? moments(13, 2) : bases(13, 2);
        const ascc_trainer_options o = options_of(0);
        motion *m = make_motion(11, 2, 0);
        if (v == 1)
            m->sequence.fluid_count = 1;
        for (size_t i = 0; v == 2 && i < FRAMES; i++)
            memcpy(m->position + i * m->fluid_count * 2, m->position,
                   m->fluid_count * 2 * sizeof *m->position);
        ascc_trainer *t = open_trainer(&o, &random, m);
        iterate(t, 2);
        size_t still = 0, moving = 0;
        for (size_t k = 0; k < t->whitening.term_count; k++) {
            const ascc_whitened_term *term = &t->whitening.term[k];
            const bool walls = t->model->plan.term[term->term].source == 1;
            for (size_t i = 0; i < term->length; i++) {
                const bool same = mean_of(t, k)[i] == 0.0f && transform_at(t, term, i, i) == 1.0;
                still += same;
                moving += !same;
                assert_true(isfinite(transform_at(t, term, i, i)) && isfinite(mean_of(t, k)[i]));
                assert_true(same || !walls);
            }
        }
        assert_true(still > 0 && (moving > 0 || v == 1));
        for (size_t i = 0; i < t->parameter_count; i++)
            assert_true(isfinite(t->weights[i]));
        ascc_trainer_destroy(&t);
        free(m);
    }
}

/* ---- Memory ---- */

static void without_memory_nothing_is_measured_and_it_is_said(void **state)
{
    (void)state;
    const model_random random = moments(14, 2);
    const ascc_trainer_options o = options_of(0);
    test_memory memory = {0};
    const ascc_context_options context = test_memory_options(&memory);
    motion *m = make_motion(12, 2, 12);
    ascc_trainer *a = open_in(&context, &o, &random, m), *b = open_trainer(&o, &random, m);
    ascc_training_report report = {.size = sizeof report};
    ascc_status status = ASCC_ERROR_MEMORY;
    size_t failures = 0;
    for (; status != ASCC_OK; failures++) {
        memory.fail_at = memory.calls + 1 + failures;
        status = ascc_trainer_iterate(a, &report);
        if (status == ASCC_OK)
            break;
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_non_null(strstr(ascc_trainer_message(a), "no memory"));
        assert_int_equal(a->iteration, 0);
    }
    memory.fail_at = 0;
    assert_true(failures > 10);
    iterate(b, 1);
    assert_same_bits(a, b);
    ascc_trainer_destroy(&a);
    ascc_trainer_destroy(&b);
    assert_true(test_memory_is_clean(&memory));
    free(m);
}

/* ---- Statistics of training, which steps are measured by ---- */

/* The mean distance of the sequence's states by a step of the model with these statistics. */
static double distance_of_states(const void *bytes, size_t size, const char *text, const motion *m)
{
    ascc_context *context;
    ascc_model *model = NULL;
    ascc_message message;
    double sum = 0.0;
    uint64_t count = 0;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    assert_int_equal(model->trust.layer, -1);
    const unsigned char *data = bytes;
    const size_t header = 8 + data[0] + ((size_t)data[1] << 8) + ((size_t)data[2] << 16);
    assert_int_equal(ascc_trust_read(&context->allocator, text,
                                     ascc_trust_sum(data + header, size - header), &model->plan,
                                     &model->trust, &message),
                     ASCC_OK);
    assert_int_equal(model->trust.layer, ascc_trust_layer(&model->plan));
    assert_true(model->trust.threshold == 1.25);
    const ascc_step_options options = {.size = sizeof options, .measure_distance = 1};
    for (size_t t = 1; t + 1 < FRAMES; t++) {
        ascc_particles_options set = {.size = sizeof set};
        ascc_particles *p;
        ascc_step *step;
        ascc_step_statistics told = {.size = sizeof told};
        const size_t d = m->dimension;
        const ascc_const_array x = {.data = m->position + t * m->fluid_count * d};
        const ascc_const_array v = {.data = m->velocity, .scalar = ASCC_DOUBLE};
        const ascc_const_array wall = {.data = m->wall}, normal = {.data = m->normal};
        assert_int_equal(ascc_model_particles_options(model, 0, &set), ASCC_OK);
        assert_int_equal(ascc_particles_create(context, &set, &p), ASCC_OK);
        assert_int_equal(ascc_particles_add_fluid(p, m->fluid_count, &x, &v, NULL, NULL), ASCC_OK);
        assert_int_equal(ascc_particles_add_boundary(p, m->wall_count, &wall, &normal, 0, NULL),
                         ASCC_OK);
        assert_int_equal(ascc_step_create(context, model, &options, &step), ASCC_OK);
        const ascc_forces forces = {.size = sizeof forces, .gravity = m->sequence.gravity};
        assert_int_equal(ascc_step_run(step, p, &forces, 1), ASCC_OK);
        assert_int_equal(ascc_step_get_statistics(step, &told), ASCC_OK);
        sum += told.distance_mean * (double)told.distance_count;
        count += told.distance_count;
        ascc_step_destroy(&step);
        ascc_particles_destroy(&p);
    }
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return sum / (double)count;
}

/* A sequence's states are measured by a step as training measured them: 1 in the mean, but for which of them
 * were drawn, and for velocities that are differences of floats. */
static void states_of_training_are_as_far_as_usual(void **state)
{
    (void)state;
    const model_random networks[] = {bases(5, 2), moments(6, 3), lattice(7, 3)};
    for (size_t k = 0; k < sizeof networks / sizeof *networks; k++) {
        motion *m = make_motion(40 + k, (size_t)networks[k].dimension, 12);
        const ascc_trainer_options options = options_of(-1);
        ascc_trainer *t = open_trainer(&options, &networks[k], m);
        iterate(t, 2);
        const char *text = ascc_trainer_trust(t, 0, 200, 1.25);
        assert_non_null(text);
        char *kept = strdup(text);
        assert_string_equal(kept, ascc_trainer_trust(t, 0, 200, 1.25));
        assert_string_not_equal(kept, ascc_trainer_trust(t, 1, 200, 1.25)); /* averaged weights */
        size_t size;
        const void *bytes = ascc_trainer_model(t, 0, &size);
        const double mean = distance_of_states(bytes, size, kept, m);
        print_message("# distance of training's states: %.4f\n", mean);
        assert_true(fabs(mean - 1.0) < 0.05);
        ascc_trainer_destroy(&t);
        free(kept);
        free(m);
    }
}

static void statistics_that_cannot_be_taken_are_refused(void **state)
{
    (void)state;
    const model_random network = bases(5, 2);
    motion *m = make_motion(9, 2, 12);
    const ascc_trainer_options options = options_of(-1);
    ascc_trainer *t = open_trainer(&options, &network, m);
    assert_null(ascc_trainer_trust(NULL, 0, 10, 0.0));
    assert_null(ascc_trainer_trust(t, 0, 0, 0.0));
    assert_non_null(strstr(ascc_trainer_message(t), "frames"));
    assert_null(ascc_trainer_trust(t, 0, 10001, 0.0));
    assert_null(ascc_trainer_trust(t, 0, 10, -1.0));
    assert_null(ascc_trainer_trust(t, 0, 10, NAN));
    assert_non_null(ascc_trainer_trust(t, 0, 10, 0.0));
    ascc_trainer_destroy(&t);
    free(m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(transforms_are_white_up_to_the_floor),
        cmocka_unit_test(measured_columns_become_white),
        cmocka_unit_test(first_layers_are_found),
        cmocka_unit_test(folded_weights_give_the_same_values),
        cmocka_unit_test(gradients_are_those_of_the_whitened_weights),
        cmocka_unit_test(an_iteration_is_a_step_of_the_whitened_weights),
        cmocka_unit_test(threads_do_not_change_the_bits),
        cmocka_unit_test(a_saved_state_goes_on_with_its_own_whitening),
        cmocka_unit_test(columns_that_do_not_vary_stay_as_they_are),
        cmocka_unit_test(without_memory_nothing_is_measured_and_it_is_said),
        cmocka_unit_test(states_of_training_are_as_far_as_usual),
        cmocka_unit_test(statistics_that_cannot_be_taken_are_refused),
    };
    return cmocka_run_group_tests_name("whitening", tests, NULL, NULL);
}
