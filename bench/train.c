/* Training against running: one rollout of a step with its gradient, and the step alone.
 * SPDX-License-Identifier: MIT */
#include <stdlib.h>
#include <string.h>

#include <ascc/train.h>

#include "../examples/ascc/host.h"
#include "../tests/support/model_builder.h"
#include "bench.h"

typedef struct lesson {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    ascc_train_context *training;
    ascc_trainer *trainer;
    unsigned char *state;
    size_t state_size;
    float *gradient;
} lesson;

/* Frames of a block in which every particle flies on with a velocity of its own. */
static float *make_frames(size_t count, size_t frames, double time_step)
{
    double *x = bench_block(count, 3);
    float *to = malloc(frames * count * 3 * sizeof *to);
    if (!to)
        bench_fail("no memory for %zu particles", count);
    for (size_t f = 0; f < frames; f++)
        for (size_t k = 0; k < count * 3; k++) {
            const double speed = 0.2 * (double)(k * 2654435761u % 1000u) / 1000.0 - 0.1;
            to[f * count * 3 + k] = (float)(x[k] + (double)f * time_step * speed);
        }
    free(x);
    return to;
}

static void open_lesson(lesson *s, const bench_options *o, size_t count)
{
    size_t size;
    memset(s, 0, sizeof *s);
    s->context = bench_context(o->cpu, 1);
    ascc_status status;
    ascc_host_error why;
    if (o->model)
        status = ascc_host_load(s->context, o->model, &s->model, &why);
    else {
        unsigned char *bytes = model_builder_tiny(BENCH_SPACING, &size);
        status = ascc_model_load_memory(s->context, bytes, size, &s->model);
        free(bytes);
    }
    if (status)
        bench_fail("no model to train");
    ascc_model_info info = {.size = sizeof info};
    (void)ascc_model_get_info(s->model, &info);
    float *frames = make_frames(count, 4, info.time_step);
    const ascc_training_stage stage = {.end = 1, .unroll = 2, .learning_rate = 1e-3};
    const ascc_trainer_options options = {.size = sizeof options,
                                          .stage = &stage,
                                          .stage_size = sizeof stage,
                                          .stage_count = 1,
                                          .batch = 1};
    const ascc_training_sequence sequence = {.size = sizeof sequence,
                                             .name = "block",
                                             .frame_count = 4,
                                             .fluid_count = count,
                                             .position = frames,
                                             .time_step = info.time_step};
    const void *bytes = ascc_model_bytes(s->model, &size);
    if (ascc_train_context_create(NULL, &s->training) ||
        ascc_trainer_create(s->training, &options, bytes, size, &s->trainer) ||
        ascc_trainer_add_sequence(s->trainer, &sequence))
        bench_fail("trainer: %s", ascc_trainer_message(s->trainer));
    s->gradient = malloc(ascc_trainer_parameter_count(s->trainer) * sizeof *s->gradient);
    const ascc_particles_options particles = {
        .size = sizeof particles, .dimension = 3, .spacing = info.particle_spacing};
    const ascc_const_array x = {.data = frames + 3 * count};
    if (ascc_particles_create(s->context, &particles, &s->particles) ||
        ascc_particles_add_fluid(s->particles, count, &x, NULL, NULL, NULL) ||
        ascc_step_create(s->context, s->model, NULL, &s->step))
        bench_fail("no particles");
    s->state_size = ascc_particles_snapshot_size(s->particles);
    s->state = malloc(s->state_size);
    if (!s->state || !s->gradient || ascc_particles_snapshot(s->particles, s->state, s->state_size))
        bench_fail("no snapshot");
    free(frames);
}

static void close_lesson(lesson *s)
{
    ascc_trainer_destroy(&s->trainer);
    ascc_train_context_destroy(&s->training);
    ascc_step_destroy(&s->step);
    ascc_particles_destroy(&s->particles);
    ascc_model_destroy(&s->model);
    ascc_context_destroy(&s->context);
    free(s->state);
    free(s->gradient);
}

static double time_step(lesson *s)
{
    if (ascc_particles_restore(s->particles, s->state, s->state_size))
        bench_fail("restore");
    const double begin = bench_seconds();
    if (ascc_step_run(s->step, s->particles, NULL, 1))
        bench_fail("step: %s", ascc_step_message(s->step));
    return bench_seconds() - begin;
}

static double time_gradient(lesson *s, int32_t unroll)
{
    double loss;
    const double begin = bench_seconds();
    if (ascc_trainer_gradient(s->trainer, 0, 1, 0, unroll, &loss, s->gradient))
        bench_fail("gradient: %s", ascc_trainer_message(s->trainer));
    return bench_seconds() - begin;
}

void bench_train(const bench_options *o)
{
    const size_t count = o->particles ? o->particles : o->quick ? 2000 : 5000;
    const size_t repeats = bench_repeats(o);
    bench_table table = bench_table_open(
        o, "train",
        "one thread; ratios within a run; a rollout of so many steps, loss and gradient",
        "particles,steps,step_ns_per_particle,gradient_ns_per_particle_and_step,ratio,min,max");
    lesson s;
    open_lesson(&s, o, count);
    for (int32_t unroll = 1; unroll <= 2; unroll++) {
        double step[BENCH_REPEATS], gradient[BENCH_REPEATS], ratio[BENCH_REPEATS];
        (void)time_step(&s);
        (void)time_gradient(&s, unroll);
        for (size_t r = 0; r < repeats; r++) {
            step[r] = time_step(&s);
            gradient[r] = time_gradient(&s, unroll) / unroll;
            ratio[r] = gradient[r] / step[r];
        }
        const bench_spread a = bench_spread_of(step, repeats),
                           b = bench_spread_of(gradient, repeats);
        const bench_spread c = bench_spread_of(ratio, repeats);
        const double ns = 1e9 / (double)count;
        bench_row(&table, "%zu,%d,%.1f,%.1f,%.2f,%.2f,%.2f", count, unroll, a.median * ns,
                  b.median * ns, c.median, c.min, c.max);
    }
    close_lesson(&s);
    bench_table_close(&table);
}
