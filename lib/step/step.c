/* One time step from beginning to end: a list of stages. SPDX-License-Identifier: MIT */
#include "step.h"

#include <math.h>
#include <string.h>
#include <time.h>

#include "base/host_array.h"
#include "commit.h"
#include "detail.h"
#include "estimate.h"
#include "points/bodies.h"
#include "substeps.h"

#define DEFAULT_MAX_NEIGHBORS 4096
#define DEFAULT_DISPLACEMENT 64.0 /* spacings a step */

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_step_options) == 56, "released layout");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_forces) == 24, "released layout");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_stage_time) == 16, "released layout");

/* ---- Making one ---- */

static ascc_status read_options(const ascc_step_options *given, ascc_step_options *o,
                                ascc_message *message)
{
    *o = (ascc_step_options){0};
    if (given && !ascc_read_struct(o, sizeof *o, given, offsetof(ascc_step_options, sleep_speed)))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "ascc_step_options.size is not understood");
    if (!(o->time_step >= 0.0 && isfinite(o->time_step)) ||
        !(o->length_unit >= 0.0 && isfinite(o->length_unit)) || !(o->max_displacement >= 0.0) ||
        !(o->sleep_speed >= 0.0 && isfinite(o->sleep_speed)) || o->max_neighbors < 0 ||
        o->max_neighbors > 1 << 20 || o->substeps < -1 || o->measure_distance < 0 ||
        o->measure_distance > 1)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "step options: time_step %g, length_unit %g, max_displacement %g, "
                         "max_neighbors %d, sleep_speed %g: each must be finite and >= 0; substeps "
                         "%d: at least -1; measure_distance %d: 0 or 1",
                         o->time_step, o->length_unit, o->max_displacement, o->max_neighbors,
                         o->sleep_speed, o->substeps, o->measure_distance);
    return ASCC_OK;
}

static ascc_status fill_step(ascc_step *step, const ascc_step_options *o, ascc_message *message)
{
    ascc_context *context = step->context;
    const ascc_model *model = step->model;
    step->time_step = o->time_step > 0.0 ? o->time_step : model->plan.time_step;
    step->most_substeps = o->substeps;
    step->length_unit = o->length_unit > 0.0 ? o->length_unit : 1.0;
    step->model_length = step->length_unit;
    step->model_time = 1.0;
    step->max_displacement = o->max_displacement;
    step->sleep_speed = o->sleep_speed;
    step->measures = o->measure_distance && model->trust.layer >= 0;
    step->engine = ascc_engine_cpu;
    const ascc_status status =
        ascc_network_create(&step->network, &context->allocator, &model->plan, &model->packed,
                            o->max_neighbors ? o->max_neighbors : DEFAULT_MAX_NEIGHBORS, message);
    if (status != ASCC_OK)
        return status;
    if (step->measures)
        ascc_network_look_at(&step->network, model->trust.layer);
    const size_t keys = (size_t)step->network.key_count;
    step->expected = ascc_allocate(&context->allocator, keys, sizeof *step->expected);
    if (!step->expected || !ascc_memory_open(&step->memory, &step->network)) {
        if (step->expected)
            ascc_release(&context->allocator, step->expected, keys, sizeof *step->expected);
        ascc_network_destroy(&step->network);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for a step");
    }
    memset(step->expected, 0, keys * sizeof *step->expected);
    ascc_arena_open(&step->arena, &context->allocator);
    step->walls.allocator = &context->allocator;
    step->statistics.level_count = model->plan.level_count;
    return ASCC_OK;
}

ascc_status ascc_step_create(ascc_context *context, const ascc_model *model,
                             const ascc_step_options *options, ascc_step **step)
{
    ASCC_FLOAT_SCOPE;
    if (step)
        *step = NULL;
    if (!context || context->magic != ASCC_CONTEXT_MAGIC || !step)
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_step_options o;
    ascc_status status = model && model->magic == ASCC_MODEL_MAGIC
                             ? read_options(options, &o, &message)
                             : ascc_fail(&message, ASCC_ERROR_ARGUMENT, "not a model");
    if (status != ASCC_OK)
        return ascc_context_fail(context, status, &message);
    ascc_step *made = ascc_allocate(&context->allocator, 1, sizeof *made);
    if (made) {
        memset(made, 0, sizeof *made);
        made->magic = ASCC_STEP_MAGIC;
        made->context = context;
        made->model = (ascc_model *)model;
        status = fill_step(made, &o, &message);
    } else {
        status = ascc_fail(&message, ASCC_ERROR_MEMORY, "no memory for a step");
    }
    if (status != ASCC_OK) {
        if (made)
            ascc_release(&context->allocator, made, 1, sizeof *made);
        return ascc_context_fail(context, status, &message);
    }
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
    ascc_release(&context->allocator, s->kept, s->kept_capacity, 1);
    ascc_release(&context->allocator, s->expected, (size_t)s->network.key_count,
                 sizeof *s->expected);
    ascc_arena_close(&s->arena);
    ascc_wall_volumes_close(&s->walls);
    ascc_memory_close(&s->memory);
    ascc_network_destroy(&s->network);
    ascc_model_release(s->model);
    s->magic = 0;
    ascc_release(&context->allocator, s, 1, sizeof *s);
    ascc_context_release(context);
}

size_t ascc_step_estimate(const ascc_step *step, size_t fluid, size_t boundary)
{
    ASCC_FLOAT_SCOPE;
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return 0;
    return ascc_estimate_scratch(&step->network, fluid, boundary,
                                 ascc_workers_count(step->context->workers));
}

ascc_status ascc_step_reserve(ascc_step *step, size_t fluid, size_t boundary)
{
    ASCC_FLOAT_SCOPE;
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

/* ---- One step ---- */

double ascc_clock(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

void ascc_stage_lap(ascc_step_state *state, const char *name)
{
    ascc_step_statistics *s = state->statistics;
    const double now = ascc_clock(), seconds = now - state->since;
    int32_t i = 0;
    state->since = now;
    while (i < s->stage_count && strcmp(s->stage[i].name, name) != 0)
        i++;
    if (i == ASCC_MAX_STAGES)
        return;
    if (i == s->stage_count)
        s->stage[s->stage_count++].name = name;
    s->stage[i].seconds += seconds;
}

/* Without fluid there is nothing to see. */
static ascc_status run_engine(ascc_step_state *state)
{
    return ascc_step_is_empty(state) ? ASCC_OK
           : state->detail           ? ascc_engine_detail(state)
                                     : state->engine(state);
}

/* What a step is, but for the last stage, which alone changes the particles. */
static const struct {
    const char *name; /* NULL: it names its own */
    ascc_stage run;
    bool moves; /* only where some fluid is awake */
} stages[] = {
    {"forces", ascc_stage_wall_motion, false}, {NULL, ascc_stage_sleep, false},
    {"forces", ascc_stage_forces, false},      {NULL, run_engine, true},
    {"advance", ascc_stage_advance, false},    {NULL, ascc_stage_relaxation, true},
    {"contact", ascc_stage_contact, true},     {NULL, ascc_stage_divergence, true},
    {NULL, ascc_stage_support, false},
};

/* Nothing has been seen yet. */
static void forget_distance(ascc_step_statistics *s)
{
    s->distance_mean = s->distance_worst = 0.0;
    s->distance_row = s->distance_count = 0;
}

static bool all_sleeps(const ascc_step_state *state)
{
    return state->sleep.count > 0 && state->sleep.count == state->particles->fluid_count;
}

/* Makes the set keep as many velocities as the model reads; that changes nothing that anyone can tell. */
static ascc_status remember(ascc_step *step, ascc_particles *p)
{
    const int32_t history = step->model->plan.history;
    if (history <= p->past_count || ascc_particles_arrange(p, 0, 0, history))
        return ASCC_OK;
    return ascc_fail(&step->message, ASCC_ERROR_MEMORY,
                     "no memory for %d velocities of %zu particles", history, p->fluid_count);
}

static ascc_status run_stages(ascc_step_state *state)
{
    ascc_status status = ASCC_OK;
    for (size_t i = 0; i < sizeof stages / sizeof *stages && status == ASCC_OK; i++) {
        if (stages[i].moves && all_sleeps(state))
            continue;
        status = stages[i].run(state);
        if (stages[i].name)
            ascc_stage_lap(state, stages[i].name);
        if (state->looks && stages[i].run == run_engine)
            break;
    }
    return status;
}

/* All that the state holds of a step until it is committed. */
static void turn_back(ascc_step_state *state)
{
    const ascc_turn *turn = &state->turn;
    const ascc_particles *p = state->particles;
    const ascc_advance *a = &state->advance;
    ascc_turn_reals(turn, true, a->position, p->fluid_count, p->dimension);
    ascc_turn_integers(turn, true, a->momentum, p->fluid_count, p->dimension);
    ascc_turn_integers(turn, true, a->external, p->fluid_count, p->dimension);
    ascc_turn_integers(turn, true, state->impulses.wall, p->boundary_count, p->dimension);
    ascc_turn_integers(turn, true, state->sleep.support, 1, p->dimension);
    if (a->walls_move)
        ascc_turn_reals(turn, true, a->wall, p->boundary_count, p->dimension);
}

/* All stages in turned axes; the particles are in the host's again when this returns. */
static ascc_status run_turned(const ascc_step *step, ascc_particles *p, ascc_step_state *state)
{
    const ascc_turn *turn = &state->turn;
    const int32_t d = p->dimension;
    const ascc_motion *given = state->motion;
    double *acceleration = given->acceleration ? step->acceleration : NULL;
    ascc_motion motion = *given;
    ascc_turn_reals(turn, false, motion.gravity, 1, d);
    ascc_turn_particles(turn, false, p);
    if (acceleration)
        ascc_turn_reals(turn, false, acceleration, p->fluid_count, d);
    state->motion = &motion;
    const ascc_status status = run_stages(state);
    state->motion = given;
    if (acceleration)
        ascc_turn_reals(turn, true, acceleration, p->fluid_count, d);
    ascc_turn_particles(turn, true, p);
    if (status == ASCC_OK && !state->looks)
        turn_back(state);
    return status;
}

ascc_step_state ascc_step_open(ascc_step *step, const ascc_particles *p, const ascc_motion *motion)
{
    return (ascc_step_state){
        .network = &step->network,
        .particles = p,
        .motion = motion,
        .turn = step->turn,
        .length_unit = step->model_length,
        .time_unit = step->model_time,
        .expected = step->expected,
        .expected_pairs = &step->expected_pairs,
        .engine = step->engine,
        .trust = step->measures ? &step->model->trust : NULL,
        .walls = &step->walls,
        .tools = {&step->arena, step->context->workers, &step->context->kernels, &step->message},
        .statistics = &step->statistics,
        .since = ascc_clock()};
}

ascc_status ascc_step_once(ascc_step *step, ascc_particles *p, const ascc_motion *motion,
                           bool first, ascc_arena *arena, ascc_step_state *state)
{
    ascc_arena_reset(arena);
    *state = ascc_step_open(step, p, motion);
    state->relaxation = &step->model->plan.relaxation;
    state->halo = step->halo;
    state->looks = step->looks;
    state->detail = step->detail;
    state->memory = &step->memory;
    state->tools.arena = arena;
    const double begin = state->since;
    ascc_status status = remember(step, p);
    forget_distance(state->statistics);
    if (status == ASCC_OK)
        status = ascc_turns(&state->turn) ? run_turned(step, p, state) : run_stages(state);
    if (status == ASCC_OK && !state->looks)
        status = ascc_stage_commit(state, p, first);
    else if (step->halo)
        status = step->halo->agree(step->halo, status);
    ascc_stage_lap(state, "commit");
    step->statistics.seconds_total += state->since - begin;
    step->statistics.scratch_size = ascc_arena_size(arena);
    return status;
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
    if (ascc_host_array_is_absent(f.acceleration))
        return ASCC_OK;
    ascc_host_array from;
    const ascc_status status =
        ascc_host_array_open("acceleration", f.acceleration, p->dimension, &from, &step->message);
    if (status != ASCC_OK)
        return status;
    if (!ascc_grow(&step->context->allocator, (void **)&step->acceleration,
                   &step->acceleration_capacity, p->fluid_count * d, sizeof(double)))
        return ascc_fail(&step->message, ASCC_ERROR_MEMORY, "no memory for the acceleration");
    for (size_t i = 0; i < p->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            const double a = ascc_host_array_read(&from, i, (int32_t)c);
            if (!isfinite(a))
                return ascc_fail(&step->message, ASCC_ERROR_NOT_FINITE,
                                 "acceleration: row %zu component %zu is not finite", i, c);
            step->acceleration[i * d + c] = a;
        }
    motion->acceleration = step->acceleration;
    return ASCC_OK;
}

/* Handles that go together. */
static ascc_status check_particles(ascc_step *step, const ascc_particles *p)
{
    const ascc_plan *plan = &step->model->plan;
    if (!ascc_particles_is_set(p))
        return ascc_fail(&step->message, ASCC_ERROR_ARGUMENT, "not a particle set");
    if (p->dimension != plan->dimension)
        return ascc_fail(&step->message, ASCC_ERROR_MISMATCH,
                         "a %dD model cannot step a %dD particle set", plan->dimension,
                         p->dimension);
    return ASCC_OK;
}

/* What a step changes, each in the step's own memory until all substeps have succeeded. */
typedef struct kept_field {
    void *rows;
    size_t size;
} kept_field;

#define KEPT_FIELDS 9

static size_t find_kept(const ascc_particles *p, kept_field field[KEPT_FIELDS])
{
    const size_t d = (size_t)p->dimension;
    const size_t n = p->fluid_count * d * 8, w = p->boundary_count * d * 8;
    field[0] = (kept_field){p->position, n};
    field[1] = (kept_field){p->momentum, n};
    field[2] = (kept_field){p->wall_impulse, w};
    field[3] = (kept_field){p->wall_position, w};
    field[4] = (kept_field){p->wall_normal, w};
    field[5] = (kept_field){p->wall_velocity, w};
    field[6] = (kept_field){p->bodies, p->body_count * sizeof *p->bodies};
    field[7] = (kept_field){p->rest, p->fluid_count * sizeof *p->rest};
    field[8] = (kept_field){p->past, n * (size_t)p->past_count};
    return 2 * n + 4 * w + field[6].size + field[7].size + field[8].size;
}

static bool keep(ascc_step *step, const ascc_particles *p)
{
    kept_field field[KEPT_FIELDS];
    if (!ascc_grow(&step->context->allocator, (void **)&step->kept, &step->kept_capacity,
                   find_kept(p, field), 1))
        return false;
    unsigned char *at = step->kept;
    for (int i = 0; i < KEPT_FIELDS; at += field[i++].size)
        if (field[i].size)
            memcpy(at, field[i].rows, field[i].size);
    return true;
}

static void take_back(const ascc_step *step, ascc_particles *p)
{
    kept_field field[KEPT_FIELDS];
    (void)find_kept(p, field);
    const unsigned char *at = step->kept;
    for (int i = 0; i < KEPT_FIELDS; at += field[i++].size)
        if (field[i].size)
            memcpy(field[i].rows, at, field[i].size);
}

/* A particle may move so far in a step, in the host's unit; 0 = as far as it likes. */
static double most_displacement(const ascc_step *step, const ascc_particles *p)
{
    if (isinf(step->max_displacement))
        return 0.0;
    const bool given = step->max_displacement > 0.0;
    return given ? step->max_displacement : DEFAULT_DISPLACEMENT * p->spacing;
}

/* A step among processes: with ghosts while it lasts, and once more where they did not reach. */
static ascc_status run_with_ghosts(ascc_step *step, ascc_particles *p, ascc_motion *motion,
                                   bool first, ascc_step_state *state)
{
    ascc_halo *halo = step->halo;
    double reached;
    ascc_status status;
    do {
        const ascc_step_statistics before = step->statistics;
        status = halo->begin(halo, step, p, motion);
        reached = halo->reached;
        if (status == ASCC_OK)
            status = ascc_step_once(step, p, motion, first, &step->arena, state);
        halo->end(halo, p);
        if (status != ASCC_OK && halo->reached > reached)
            step->statistics = before;
    } while (status != ASCC_OK && halo->reached > reached);
    return status;
}

static bool keep_all(ascc_step *step, const ascc_particles *p)
{
    return step->halo ? step->halo->keep(step->halo, p) : keep(step, p);
}

static void take_all_back(const ascc_step *step, ascc_particles *p)
{
    if (step->halo)
        step->halo->take_back(step->halo, p);
    else
        take_back(step, p);
}

/* Into how many steps, and memory for all of them. */
static ascc_status prepare(ascc_step *step, ascc_particles *p, const ascc_motion *motion,
                           int32_t *count)
{
    ascc_step *const detail = step->detail;
    int32_t own = 1;
    ascc_status status = ascc_count_substeps(step, p, motion, count);
    if (status == ASCC_OK)
        status = remember(step, p);
    if (status == ASCC_OK && detail) {
        ascc_find_units(detail, p);
        detail->statistics = (ascc_step_statistics){.level_count = detail->model->plan.level_count};
        status = ascc_count_substeps(detail, p, motion, &own);
        if (status == ASCC_OK)
            status = remember(detail, p);
        if (status != ASCC_OK)
            step->message = detail->message;
        *count = own > *count ? own : *count;
    }
    if (status == ASCC_OK && *count > 1 && !keep_all(step, p))
        status = ascc_fail(&step->message, ASCC_ERROR_MEMORY, "no memory to keep %zu particles",
                           p->fluid_count);
    return step->halo ? step->halo->agree(step->halo, status) : status;
}

/* One time step of the host's: all of its substeps, or none. */
static ascc_status run_once(ascc_step *step, ascc_particles *p, ascc_motion *motion)
{
    ascc_step_state state;
    int32_t count;
    ascc_status status = prepare(step, p, motion, &count);
    if (status != ASCC_OK)
        return status;
    motion->time_step = step->time_step / count;
    const bool first = step->statistics.steps == 0 && !step->continues;
    const ascc_step_statistics before = step->statistics;
    step->statistics.substeps = count;
    count = step->looks ? 1 : count;
    for (int32_t n = 0; n < count && status == ASCC_OK; n++, step->statistics.substeps_total++) {
        status = step->halo
                     ? run_with_ghosts(step, p, motion, first && n == 0, &state)
                     : ascc_step_once(step, p, motion, first && n == 0, &step->arena, &state);
        if (status != ASCC_OK && n > 0)
            take_all_back(step, p);
    }
    if (status != ASCC_OK)
        step->statistics = before;
    return status;
}

ascc_status ascc_step_run(ascc_step *step, ascc_particles *particles, const ascc_forces *forces,
                          int32_t count)
{
    ASCC_FLOAT_SCOPE;
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    step->statistics = (ascc_step_statistics){.level_count = step->model->plan.level_count};
    ascc_motion motion = {.advection = step->model->plan.advection,
                          .sleep_speed = step->sleep_speed};
    ascc_status status = check_particles(step, particles);
    if (status == ASCC_OK) {
        ascc_find_units(step, particles);
        motion.max_displacement = most_displacement(step, particles);
    }
    if (status == ASCC_OK && count < 0)
        status = ascc_fail(&step->message, ASCC_ERROR_ARGUMENT, "count = %d is negative", count);
    if (status == ASCC_OK)
        status = read_forces(step, particles, forces, &motion);
    if (status == ASCC_OK) {
        step->turn = ascc_turn_find(&step->model->plan, motion.gravity);
        ascc_step_statistics *s = &step->statistics;
        ascc_totals(step->context->workers, s->momentum_before, particles->momentum,
                    particles->fluid_count, (size_t)particles->dimension);
        memcpy(s->momentum_after, s->momentum_before, sizeof s->momentum_after);
    }
    if (step->halo)
        status = step->halo->agree(step->halo, status);
    for (int32_t n = 0; status == ASCC_OK && n < count; n++) {
        status = run_once(step, particles, &motion);
        if (status == ASCC_OK)
            step->statistics.steps++;
    }
    if (status != ASCC_OK)
        ascc_context_log(step->context, step->message.text);
    return status;
}

ascc_status ascc_step_look(ascc_step *step, ascc_particles *particles, const ascc_forces *forces)
{
    const ascc_step_statistics before = step->statistics;
    step->looks = true;
    const ascc_status status = ascc_step_run(step, particles, forces, 1);
    const ascc_step_statistics seen = step->statistics;
    step->looks = false;
    step->statistics = before;
    step->statistics.distance_mean = seen.distance_mean;
    step->statistics.distance_worst = seen.distance_worst;
    step->statistics.distance_row = seen.distance_row;
    step->statistics.distance_count = seen.distance_count;
    return status;
}

ascc_status ascc_step_get_statistics(const ascc_step *step, ascc_step_statistics *statistics)
{
    ASCC_FLOAT_SCOPE;
    if (!step || step->magic != ASCC_STEP_MAGIC || !statistics)
        return ASCC_ERROR_ARGUMENT;
    return ascc_write_struct(statistics, &step->statistics, sizeof step->statistics,
                             sizeof step->statistics)
               ? ASCC_OK
               : ASCC_ERROR_ARGUMENT;
}
