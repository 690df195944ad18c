/* What a model's first layer makes of the states it is trained on: mean and covariance, for model/trust.h.
 * SPDX-License-Identifier: MIT */
#include "model/trust.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "trainer.h"

#define FAIL(...) ascc_trainer_fail(t, __VA_ARGS__)
#define ROWS 1000         /* of a frame that are looked at */
#define RIDGE 0.01        /* on a correlation's diagonal */
#define NUMBER 28         /* bytes of one, written */
#define MOST_FRAMES 10000 /* in one measurement */

/* Rows of the layer in many true states. */
typedef struct samples {
    size_t channels, count, capacity;
    float *row; /* [count][channels] */
} samples;

static void add_rows(samples *s, const ascc_network_run *run, int32_t layer)
{
    const ascc_value *value = &run->value[layer + 2];
    const size_t rows = ascc_network_rows(run, run->plan->layer[layer].set);
    const size_t stride = ascc_padded((int32_t)s->channels);
    size_t active = 0, seen = 0, taken = 0;
    for (size_t i = 0; i < rows; i++)
        active += value->active[i];
    const size_t want = ascc_min_size(active, ROWS);
    for (size_t i = 0; i < rows && taken < want; i++)
        if (value->active[i] && seen++ == taken * active / want) {
            memcpy(s->row + s->count++ * s->channels, value->raw + i * stride,
                   s->channels * sizeof *s->row);
            taken++;
        }
}

/* Mean [n] and covariance [n][n]. */
static void find_moments(const samples *s, double *mean, double *covariance)
{
    const size_t n = s->channels;
    memset(mean, 0, n * sizeof *mean);
    memset(covariance, 0, n * n * sizeof *covariance);
    for (size_t r = 0; r < s->count; r++)
        for (size_t i = 0; i < n; i++)
            mean[i] += (double)s->row[r * n + i] / (double)s->count;
    for (size_t r = 0; r < s->count; r++)
        for (size_t i = 0; i < n; i++)
            for (size_t j = 0; j <= i; j++)
                covariance[i * n + j] += ((double)s->row[r * n + i] - mean[i]) *
                                         ((double)s->row[r * n + j] - mean[j]) / (double)s->count;
}

/* a = L L^T of a symmetric positive matrix, in place, of which the lower half is read. */
static void factorize(double *a, size_t n)
{
    for (size_t j = 0; j < n; j++)
        for (size_t i = j; i < n; i++) {
            double sum = a[i * n + j];
            for (size_t k = 0; k < j; k++)
                sum -= a[i * n + k] * a[j * n + k];
            a[i * n + j] = i == j ? sqrt(sum) : sum / a[j * n + j];
        }
}

/* The inverse of a lower triangular matrix, in place. */
static void invert(double *a, size_t n)
{
    for (size_t j = 0; j < n; j++) {
        a[j * n + j] = 1.0 / a[j * n + j];
        for (size_t i = j + 1; i < n; i++) {
            double sum = 0.0;
            for (size_t k = j; k < i; k++)
                sum -= a[i * n + k] * a[k * n + j];
            a[i * n + j] = sum / a[i * n + i];
        }
    }
}

static double mean_distance(const samples *s, const double *mean, const double *factor)
{
    const size_t n = s->channels;
    double sum = 0.0;
    for (size_t r = 0; r < s->count; r++) {
        double square = 0.0;
        for (size_t i = 0; i < n; i++) {
            double y = 0.0;
            for (size_t j = 0; j <= i; j++)
                y += factor[i * n + j] * ((double)s->row[r * n + j] - mean[j]);
            square += y * y;
        }
        sum += sqrt(square / (double)n);
    }
    return sum / (double)s->count;
}

/* factor[n][n]: from a covariance to what whitens, such that the mean distance is 1. scale: [n]. */
static void find_factor(const samples *s, const double *mean, double *scale, double *factor)
{
    const size_t n = s->channels;
    for (size_t i = 0; i < n; i++)
        scale[i] = 1.0 / (sqrt(factor[i * n + i]) + 1e-6);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++)
            factor[i * n + j] = factor[i * n + j] * scale[i] * scale[j] + (i == j ? RIDGE : 0.0);
    factorize(factor, n);
    invert(factor, n);
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++)
            factor[i * n + j] *= scale[j];
    const double distance = mean_distance(s, mean, factor);
    for (size_t i = 0; i < n * n; i++)
        factor[i] /= distance > 0.0 ? distance : 1.0;
}

/* ---- As text ---- */

/* Nine digits, in any locale. */
static int write_number(char *text, size_t capacity, double number)
{
    if (number == 0.0)
        return snprintf(text, capacity, "0");
    const int exponent = (int)floor(log10(fabs(number))) - 8;
    return snprintf(text, capacity, "%" PRId64 "e%d",
                    (int64_t)llround(number / pow(10.0, exponent)), exponent);
}

static const char *write_text(ascc_trainer *t, int32_t layer, uint64_t sum, double threshold,
                              const double *mean, const double *factor)
{
    const size_t n = (size_t)t->model->plan.layer[layer].channels;
    void *memory = t->text;
    if (!ascc_grow(&t->allocator, &memory, &t->text_capacity, 200 + NUMBER * n * (n + 3) / 2, 1)) {
        FAIL(ASCC_ERROR_MEMORY, "no memory to write statistics");
        return NULL;
    }
    t->text = memory;
    char *at = t->text, *end = t->text + t->text_capacity;
    at += snprintf(at, (size_t)(end - at), "{\"layer\": %d, \"weights\": \"%016" PRIx64 "\"",
                   (int)layer, sum);
    if (threshold > 0.0) {
        at += snprintf(at, (size_t)(end - at), ", \"threshold\": ");
        at += write_number(at, (size_t)(end - at), threshold);
    }
    at += snprintf(at, (size_t)(end - at), ", \"mean\": [");
    for (size_t i = 0; i < n; i++) {
        at += snprintf(at, (size_t)(end - at), "%s", i ? ", " : "");
        at += write_number(at, (size_t)(end - at), mean[i]);
    }
    at += snprintf(at, (size_t)(end - at), "], \"factor\": [");
    for (size_t i = 0; i < n; i++)
        for (size_t j = 0; j <= i; j++) {
            at += snprintf(at, (size_t)(end - at), "%s", i ? ", " : "");
            at += write_number(at, (size_t)(end - at), factor[i * n + j]);
        }
    (void)snprintf(at, (size_t)(end - at), "]}");
    return t->text;
}

/* ---- The call ---- */

/* True states as rollouts begin with, drawn apart from all iterations'; those that cannot be seen are left out. */
static ascc_status look_at_states(ascc_trainer *t, int32_t frames, int32_t layer, samples *s)
{
    const ascc_training_stage stage = {.unroll = 1};
    ascc_rollout_worker *worker = &t->worker[0];
    ascc_status status = ASCC_OK;
    ascc_network_look_at(&worker->step->network, layer);
    for (int32_t i = 0; i < frames && status == ASCC_OK; i++) {
        ascc_rollout_task task;
        status = ascc_trainer_draw(
            t, &stage, ascc_random_open(t->options.seed, UINT64_MAX - 1, (uint64_t)i), &task);
        if (status != ASCC_OK)
            return status;
        const ascc_status seen = ascc_rollout_look(worker, &task);
        if (seen == ASCC_OK)
            add_rows(s, &worker->state[0].run, layer);
        else if (seen == ASCC_ERROR_MEMORY)
            status =
                FAIL(seen, "no memory to look at frame %zu of %s", task.frame, task.sequence->name);
    }
    if (status == ASCC_OK && s->count == 0)
        status = FAIL(ASCC_ERROR_RANGE, "no state of the sequences could be seen");
    return status;
}

static void use_weights(ascc_trainer *t, const float *weights)
{
    const float *own = t->weights;
    t->weights = (float *)weights;
    ascc_trainer_apply(t);
    t->weights = (float *)own;
}

const char *ascc_trainer_trust(ascc_trainer *t, int32_t averaged, int32_t frames, double threshold)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return NULL;
    const int32_t layer = ascc_trust_layer(&t->model->plan);
    if (layer < 0 || frames < 1 || frames > MOST_FRAMES ||
        !(threshold >= 0.0 && threshold <= 1e15)) {
        FAIL(ASCC_ERROR_ARGUMENT,
             layer < 0 ? "trust: no layer on the fluid with weights and at most %d channels"
                       : "trust: frames must be within 1 and %d, the threshold positive or 0",
             layer < 0 ? ASCC_TRUST_CHANNELS : MOST_FRAMES);
        return NULL;
    }
    const bool average = averaged && t->options.average > 0.0;
    const size_t n = (size_t)t->model->plan.layer[layer].channels;
    samples s = {.channels = n, .capacity = (size_t)frames * ROWS};
    const size_t doubles = 2 * n + n * n;
    const char *text = NULL;
    size_t size;
    const unsigned char *bytes = ascc_trainer_model(t, averaged, &size);
    s.row = ascc_allocate(&t->allocator, s.capacity, n * sizeof *s.row);
    double *mean = ascc_allocate(&t->allocator, doubles, sizeof *mean);
    if (average)
        use_weights(t, t->average);
    ascc_status status = s.row && mean ? look_at_states(t, frames, layer, &s) : ASCC_ERROR_MEMORY;
    if (!s.row || !mean)
        FAIL(status, "no memory for %zu rows", s.capacity);
    if (average)
        ascc_trainer_apply(t);
    if (status == ASCC_OK) {
        find_moments(&s, mean, mean + 2 * n);
        find_factor(&s, mean, mean + n, mean + 2 * n);
        text = write_text(t, layer, ascc_trust_sum(bytes + t->header_count, size - t->header_count),
                          threshold, mean, mean + 2 * n);
    }
    if (mean)
        ascc_release(&t->allocator, mean, doubles, sizeof *mean);
    if (s.row)
        ascc_release(&t->allocator, s.row, s.capacity, n * sizeof *s.row);
    return text;
}
