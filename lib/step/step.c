/* One time step from beginning to end: validate, compute, commit. SPDX-License-Identifier: MIT */
#include "step.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>
#include <time.h>

#include "base/host_array.h"
#include "contact.h"
#include "estimate.h"

#define DEFAULT_MAX_NEIGHBORS 4096

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_step_options) == 40, "released layout");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_forces) == 24, "released layout");
_Static_assert(sizeof(ascc_step_statistics) == 328 || sizeof(void *) != 8, "released layout");

ascc_status ascc_step_create(ascc_context *context, const ascc_model *model,
                             const ascc_step_options *options, ascc_step **step)
{
    if (step)
        *step = NULL;
    if (!context || context->magic != ASCC_CONTEXT_MAGIC || !step)
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_step_options o = {0};
    if (!model || model->magic != ASCC_MODEL_MAGIC)
        return ascc_context_fail(context, ascc_fail(&message, ASCC_ERROR_ARGUMENT, "not a model"),
                                 &message);
    if (options && !ascc_read_struct(&o, sizeof o, options, sizeof o))
        return ascc_context_fail(
            context,
            ascc_fail(&message, ASCC_ERROR_ARGUMENT, "ascc_step_options.size is not understood"),
            &message);
    if (!(o.time_step >= 0.0 && isfinite(o.time_step)) ||
        !(o.length_unit >= 0.0 && isfinite(o.length_unit)) ||
        !(o.max_displacement >= 0.0 && isfinite(o.max_displacement)) || o.max_neighbors < 0 ||
        o.max_neighbors > 1 << 20)
        return ascc_context_fail(
            context,
            ascc_fail(&message, ASCC_ERROR_ARGUMENT,
                      "step options: time_step %g, length_unit %g, max_displacement %g, "
                      "max_neighbors %d: each must be finite and >= 0",
                      o.time_step, o.length_unit, o.max_displacement, o.max_neighbors),
            &message);
    ascc_step *made = ascc_allocate(&context->allocator, 1, sizeof *made);
    if (!made)
        return ascc_context_fail(
            context, ascc_fail(&message, ASCC_ERROR_MEMORY, "no memory for a step"), &message);
    memset(made, 0, sizeof *made);
    made->magic = ASCC_STEP_MAGIC;
    made->context = context;
    made->model = (ascc_model *)model;
    made->time_step = o.time_step > 0.0 ? o.time_step : model->plan.time_step;
    made->length_unit = o.length_unit > 0.0 ? o.length_unit : 1.0;
    made->max_displacement = o.max_displacement;
    const ascc_status status =
        ascc_network_create(&made->network, &context->allocator, &model->plan,
                            o.max_neighbors ? o.max_neighbors : DEFAULT_MAX_NEIGHBORS, &message);
    if (status != ASCC_OK) {
        ascc_release(&context->allocator, made, 1, sizeof *made);
        return ascc_context_fail(context, status, &message);
    }
    ascc_arena_open(&made->arena, &context->allocator);
    made->statistics.level_count = model->plan.level_count;
    ascc_context_retain(context);
    ascc_model_retain(made->model);
    *step = made;
    return ASCC_OK;
}

void ascc_step_destroy(ascc_step **step)
{
    if (!step || !*step)
        return;
    ascc_step *s = *step;
    *step = NULL;
    ascc_context *context = s->context;
    ascc_release(&context->allocator, s->acceleration, s->acceleration_capacity,
                 sizeof *s->acceleration);
    ascc_arena_close(&s->arena);
    ascc_network_destroy(&s->network);
    ascc_model_release(s->model);
    s->magic = 0;
    ascc_release(&context->allocator, s, 1, sizeof *s);
    ascc_context_release(context);
}

size_t ascc_step_estimate(const ascc_step *step, size_t fluid, size_t boundary)
{
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return 0;
    return ascc_estimate_scratch(&step->network, fluid, boundary,
                                 ascc_workers_count(step->context->workers));
}

ascc_status ascc_step_reserve(ascc_step *step, size_t fluid, size_t boundary)
{
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    const size_t size = ascc_step_estimate(step, fluid, boundary);
    ascc_arena_reset(&step->arena);
    if (!ascc_arena_reserve(&step->arena, size)) {
        ascc_fail(&step->message, ASCC_ERROR_MEMORY, "no memory for %zu bytes of scratch", size);
        ascc_context_log(step->context, step->message.text);
        return ASCC_ERROR_MEMORY;
    }
    return ASCC_OK;
}

const char *ascc_step_message(const ascc_step *step)
{
    return step && step->magic == ASCC_STEP_MAGIC ? step->message.text : "";
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Seconds since the last lap, and starts the next. */
static double lap(double *since)
{
    const double t = now(), seconds = t - *since;
    *since = t;
    return seconds;
}

/* ---- What the network sees ---- */

/* vector: m/s of fluid, a normal of boundary, in units of `factor`; motion: the factor that makes of it
 * spacings a time step; gravity: in spacings a squared time step. */
static void features_of(const ascc_plan *plan, const int32_t *feature, int32_t feature_count,
                        const double *vector, double factor, double motion, const double *gravity,
                        float *to)
{
    for (int32_t f = 0; f < feature_count; f++) {
        const double scale = feature[f] == ASCC_FEATURE_MOTION ? motion : factor;
        if (feature[f] == ASCC_FEATURE_ONE)
            *to++ = 1.0f;
        else if (feature[f] == ASCC_FEATURE_GRAVITY)
            for (int32_t c = 0; c < plan->dimension; c++)
                *to++ = (float)gravity[c];
        else
            for (int32_t c = 0; c < plan->dimension; c++)
                *to++ = (float)(vector[c] * scale);
    }
}

/* Features of all particles in the host's order; vectors in metres. */
static bool take_features(const ascc_step *step, ascc_arena *arena, const ascc_particles *p,
                          const ascc_motion *outside, const ascc_advance *advance, float **fluid,
                          float **boundary)
{
    const ascc_plan *plan = &step->model->plan;
    const size_t d = (size_t)p->dimension;
    *fluid = ascc_arena_lend(arena, p->fluid_count, (size_t)plan->fluid_channels * sizeof(float));
    *boundary =
        ascc_arena_lend(arena, p->boundary_count, (size_t)plan->boundary_channels * sizeof(float));
    if (!*fluid || !*boundary)
        return false;
    const double motion = step->length_unit * plan->time_step / plan->spacing;
    double gravity[3];
    for (size_t c = 0; c < d; c++)
        gravity[c] = outside->gravity[c] * plan->time_step * motion;
    for (size_t i = 0; i < p->fluid_count; i++)
        features_of(plan, plan->fluid_features, plan->fluid_feature_count,
                    advance->velocity + i * d, step->length_unit, motion, gravity,
                    *fluid + i * (size_t)plan->fluid_channels);
    for (size_t i = 0; i < p->boundary_count; i++)
        features_of(plan, plan->boundary_features, plan->boundary_feature_count,
                    p->wall_normal + i * d, 1.0, 0.0, gravity,
                    *boundary + i * (size_t)plan->boundary_channels);
    return true;
}

typedef struct scale_job {
    const double *from;
    double *to, unit;
} scale_job;

static void scale_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const scale_job *job = data;
    for (size_t i = begin; i < end; i++)
        job->to[i] = job->from[i] * job->unit;
}

/* Positions in metres. */
static double *scaled(const ascc_search_tools *tools, const double *position, size_t count,
                      double unit)
{
    scale_job job = {position, ascc_arena_lend(tools->arena, count, sizeof(double)), unit};
    if (job.to)
        ascc_workers_run(tools->workers, count, 16384, scale_part, &job);
    return job.to;
}

/* Quanta per kilogram and unit of the network's output: the output is a displacement during the
 * model's time step; with another one, the velocity it stands for is scaled as an acceleration. */
static ascc_impulse_scale impulse_scale(const ascc_step *step, const ascc_particles *p)
{
    const ascc_plan *plan = &step->model->plan;
    ascc_impulse_scale scale = {.mass = p->mass, .position = p->position};
    for (int c = 0; c < 3; c++)
        scale.factor[c] = plan->output.scale[c] / plan->time_step *
                          (step->time_step / plan->time_step) / step->length_unit / p->quantum;
    return scale;
}

/* Sums for the statistics: they wrap instead of failing. */
typedef struct totals_job {
    const int64_t *rows;
    size_t dimension;
    atomic_uint_least64_t sum[3];
} totals_job;

static void add_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    totals_job *job = data;
    const size_t d = job->dimension;
    uint64_t sum[3] = {0, 0, 0};
    for (size_t i = begin; i < end; i++)
        for (size_t c = 0; c < d; c++)
            sum[c] += (uint64_t)job->rows[i * d + c];
    for (size_t c = 0; c < d; c++)
        atomic_fetch_add_explicit(&job->sum[c], sum[c], memory_order_relaxed);
}

static void add_totals(ascc_workers *workers, int64_t total[3], const int64_t *rows, size_t count,
                       size_t d)
{
    totals_job job = {.rows = rows, .dimension = d};
    ascc_workers_run(workers, count, 8192, add_rows, &job);
    for (size_t c = 0; c < 3; c++)
        total[c] = (int64_t)atomic_load(&job.sum[c]);
}

static bool take_advance(ascc_advance *advance, ascc_impulses *impulses, ascc_arena *arena,
                         const ascc_particles *p)
{
    const size_t d = (size_t)p->dimension, n = p->fluid_count * d, w = p->boundary_count * d;
    advance->position = ascc_arena_take(arena, n, sizeof(double));
    advance->velocity = ascc_arena_take(arena, n, sizeof(double));
    advance->momentum = ascc_arena_take(arena, n, sizeof(int64_t));
    advance->external = ascc_arena_take(arena, n, sizeof(int64_t));
    impulses->fluid = ascc_arena_take(arena, n, sizeof(int64_t));
    impulses->wall = ascc_arena_take(arena, w, sizeof(int64_t));
    if (!advance->position || !advance->velocity || !advance->momentum || !advance->external ||
        !impulses->fluid || !impulses->wall)
        return false;
    memset(impulses->fluid, 0, n * sizeof(int64_t));
    memset(impulses->wall, 0, w * sizeof(int64_t));
    return true;
}

/* Hierarchy, demand, layers, pair impulses: everything the model does. */
static ascc_status run_network(ascc_step *step, const ascc_particles *p, const ascc_motion *motion,
                               ascc_step_trace *trace, double *since)
{
    const ascc_search_tools *tools = &trace->tools;
    const ascc_advance *advance = &trace->advance;
    const ascc_impulses *impulses = &trace->impulses;
    ascc_hierarchy *hierarchy = &trace->hierarchy;
    ascc_network_run *run = &trace->run;
    ascc_step_statistics *s = &step->statistics;
    const size_t d = (size_t)p->dimension;
    float *fluid, *boundary;
    ascc_scene scene = {.fluid_count = p->fluid_count, .boundary_count = p->boundary_count};
    const ascc_arena_mark before_features = ascc_arena_mark_of(tools->arena);
    const bool room = take_features(step, tools->arena, p, motion, advance, &fluid, &boundary);
    const ascc_arena_mark before_scene = ascc_arena_mark_of(tools->arena);
    scene.fluid = scaled(tools, advance->position, p->fluid_count * d, step->length_unit);
    scene.boundary = scaled(tools, p->wall_position, p->boundary_count * d, step->length_unit);
    if (!room || !scene.fluid || !scene.boundary)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the features");
    s->seconds_prepare = lap(since);

    ascc_status status = ascc_hierarchy_build(hierarchy, tools, &step->model->plan, &scene);
    ascc_arena_return(tools->arena, before_scene);
    s->seconds_hierarchy = lap(since);
    if (status == ASCC_OK)
        status = ascc_network_demand(run, &step->network, hierarchy, tools);
    s->seconds_search = lap(since);
    if (status == ASCC_OK)
        status = ascc_network_forward(run, fluid, boundary);
    ascc_arena_return(tools->arena, before_features);
    s->seconds_network = lap(since);
    if (status != ASCC_OK)
        return status;

    const ascc_impulse_scale scale = impulse_scale(step, p);
    s->pair_count = 0;
    if (step->model->plan.output.kind == ASCC_OUTPUT_ANTISYMMETRIC)
        status = ascc_antisymmetric_impulses(run, &scale, impulses, &s->pair_count);
    else
        status = ascc_plain_impulses(run, &scale, impulses);
    s->seconds_last_layer = lap(since);
    s->neighbor_count = run->neighbor_count;
    s->max_neighbors = run->longest;
    s->level_points[0] = hierarchy->set[ASCC_SET_ALL].count;
    for (int32_t l = 1; l < step->model->plan.level_count; l++)
        s->level_points[l] = hierarchy->set[ASCC_SET_LEVEL + l - 1].count;
    return status;
}

typedef struct commit_job {
    ascc_particles *particles;
    const ascc_advance *advance;
} commit_job;

static void commit_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const commit_job *job = data;
    const size_t d = (size_t)job->particles->dimension, n = (end - begin) * d;
    memcpy(job->particles->position + begin * d, job->advance->position + begin * d,
           n * sizeof(double));
    memcpy(job->particles->momentum + begin * d, job->advance->momentum + begin * d,
           n * sizeof(int64_t));
}

/* The new state becomes the particles' own: nothing here can fail. */
static void commit(ascc_step *step, ascc_particles *p, const ascc_advance *advance,
                   const ascc_impulses *impulses)
{
    ascc_workers *workers = step->context->workers;
    ascc_step_statistics *s = &step->statistics;
    const size_t d = (size_t)p->dimension, n = p->fluid_count;
    add_totals(workers, s->momentum_before, p->momentum, n, d);
    add_totals(workers, s->momentum_after, advance->momentum, n, d);
    add_totals(workers, s->external_impulse, advance->external, n, d);
    add_totals(workers, s->wall_impulse, impulses->wall, p->boundary_count, d);
    commit_job job = {p, advance};
    ascc_workers_run(workers, n, 8192, commit_rows, &job);
    if (p->boundary_count)
        memcpy(p->wall_impulse, impulses->wall, p->boundary_count * d * sizeof(int64_t));
}

ascc_status ascc_step_once(ascc_step *step, ascc_particles *p, const ascc_motion *motion,
                           ascc_arena *arena, ascc_step_trace *trace)
{
    double since = now();
    const double begin = since;
    ascc_arena_reset(arena);
    trace->tools =
        (ascc_search_tools){arena, step->context->workers, &step->context->kernels, &step->message};
    ascc_advance *advance = &trace->advance;
    ascc_impulses *impulses = &trace->impulses;
    if (!take_advance(advance, impulses, arena, p))
        return ascc_fail(&step->message, ASCC_ERROR_MEMORY, "no memory for %zu particles",
                         p->fluid_count);
    const ascc_search_tools *tools = &trace->tools;
    ascc_status status = ascc_integrate_begin(tools->workers, p, motion, advance, &step->message);
    if (status == ASCC_OK && p->fluid_count)
        status = run_network(step, p, motion, trace, &since);
    if (status == ASCC_OK)
        status =
            ascc_integrate_end(tools->workers, p, motion, impulses->fluid, advance, &step->message);
    if (status == ASCC_OK && p->fluid_count && step->model->plan.output.walls.contact > 0.0)
        status =
            ascc_contact(&trace->run, p, motion->time_step, step->length_unit, advance, impulses);
    if (status != ASCC_OK)
        return status;
    commit(step, p, advance, impulses);
    step->statistics.seconds_commit = lap(&since);
    step->statistics.seconds_total = since - begin;
    step->statistics.scratch_size = ascc_arena_size(arena);
    return ASCC_OK;
}

/* ---- The call ---- */

/* Reads what acts from outside; the acceleration is copied once. */
static ascc_status read_forces(ascc_step *step, const ascc_particles *p, const ascc_forces *forces,
                               ascc_motion *motion)
{
    const size_t d = (size_t)p->dimension;
    ascc_forces f = {0};
    if (forces && !ascc_read_struct(&f, sizeof f, forces, sizeof f))
        return ascc_fail(&step->message, ASCC_ERROR_ARGUMENT, "ascc_forces.size is not understood");
    for (size_t c = 0; c < d; c++) {
        motion->gravity[c] =
            f.gravity ? f.gravity[c] : step->model->plan.gravity[c] / step->length_unit;
        if (!isfinite(motion->gravity[c]))
            return ascc_fail(&step->message, ASCC_ERROR_NOT_FINITE,
                             "gravity: component %zu is not finite", c);
    }
    if (!f.acceleration || !f.acceleration->data)
        return ASCC_OK;
    if (!ascc_scalar_known(f.acceleration->scalar) || f.acceleration->reserved != 0)
        return ascc_fail(&step->message, ASCC_ERROR_ARGUMENT,
                         "acceleration: scalar %d, reserved %ld: not an array known here",
                         (int)f.acceleration->scalar, (long)f.acceleration->reserved);
    if (!ascc_grow(&step->context->allocator, (void **)&step->acceleration,
                   &step->acceleration_capacity, p->fluid_count * d, sizeof(double)))
        return ascc_fail(&step->message, ASCC_ERROR_MEMORY, "no memory for the acceleration");
    for (size_t i = 0; i < p->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            const double a = ascc_array_read(f.acceleration, i, c, d);
            if (!isfinite(a))
                return ascc_fail(&step->message, ASCC_ERROR_NOT_FINITE,
                                 "acceleration: row %zu component %zu is not finite", i, c);
            step->acceleration[i * d + c] = a;
        }
    motion->acceleration = step->acceleration;
    return ASCC_OK;
}

ascc_status ascc_step_run(ascc_step *step, ascc_particles *particles, const ascc_forces *forces,
                          int32_t count)
{
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    step->statistics.steps = 0;
    ascc_step_trace trace;
    ascc_status status = ASCC_OK;
    ascc_motion motion = {.time_step = step->time_step,
                          .advection = step->model->plan.advection,
                          .max_displacement = step->max_displacement};
    if (!particles || particles->magic != ASCC_PARTICLES_MAGIC)
        status = ascc_fail(&step->message, ASCC_ERROR_ARGUMENT, "not a particle set");
    else if (count < 0)
        status = ascc_fail(&step->message, ASCC_ERROR_ARGUMENT, "count = %d is negative", count);
    else if (particles->dimension != step->model->plan.dimension)
        status = ascc_fail(&step->message, ASCC_ERROR_MISMATCH,
                           "a %dD model cannot step a %dD particle set",
                           step->model->plan.dimension, particles->dimension);
    else
        status = read_forces(step, particles, forces, &motion);
    for (int32_t n = 0; status == ASCC_OK && n < count; n++) {
        status = ascc_step_once(step, particles, &motion, &step->arena, &trace);
        if (status == ASCC_OK)
            step->statistics.steps++;
    }
    if (status != ASCC_OK)
        ascc_context_log(step->context, step->message.text);
    return status;
}

ascc_status ascc_step_get_statistics(const ascc_step *step, ascc_step_statistics *statistics)
{
    if (!step || step->magic != ASCC_STEP_MAGIC || !statistics)
        return ASCC_ERROR_ARGUMENT;
    return ascc_write_struct(statistics, &step->statistics, sizeof step->statistics,
                             sizeof step->statistics)
               ? ASCC_OK
               : ASCC_ERROR_ARGUMENT;
}
