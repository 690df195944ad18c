/* One rollout: steps forwards with the run-time's own step, the loss, and the way back.
 * SPDX-License-Identifier: MIT */
#include "rollout.h"

#include <math.h>
#include <string.h>

/* Steps without gradient have blown up where particles are this far off on average, spacings. */
#define BLOWN_UP 2.0

bool ascc_rollout_worker_open(ascc_rollout_worker *w, ascc_context *context,
                              const ascc_model *model, int32_t longest_unroll)
{
    memset(w, 0, sizeof *w);
    w->context = context;
    w->model = model;
    w->kept_count = (size_t)longest_unroll;
    ascc_arena_open(&w->scratch, &context->allocator);
    ascc_arena_open(&w->loss_scratch, &context->allocator);
    w->kept = ascc_allocate(&context->allocator, w->kept_count, sizeof *w->kept);
    w->state = ascc_allocate(&context->allocator, w->kept_count, sizeof *w->state);
    for (size_t i = 0; w->kept && i < w->kept_count; i++)
        ascc_arena_open(&w->kept[i], &context->allocator);
    if (w->kept && w->state && ascc_step_create(context, model, NULL, &w->step) == ASCC_OK) {
        w->step->network.keeps_values = true;
        return true;
    }
    ascc_rollout_worker_close(w);
    return false;
}

void ascc_rollout_worker_close(ascc_rollout_worker *w)
{
    if (!w->context)
        return;
    const ascc_allocator *allocator = &w->context->allocator;
    ascc_step_destroy(&w->step);
    for (size_t i = 0; w->kept && i < w->kept_count; i++)
        ascc_arena_close(&w->kept[i]);
    if (w->kept)
        ascc_release(allocator, w->kept, w->kept_count, sizeof *w->kept);
    if (w->state)
        ascc_release(allocator, w->state, w->kept_count, sizeof *w->state);
    if (w->memory)
        ascc_release(allocator, w->memory, w->memory_count, sizeof *w->memory);
    ascc_arena_close(&w->scratch);
    ascc_arena_close(&w->loss_scratch);
    memset(w, 0, sizeof *w);
}

/* A rollout under way. Arrays are [fluid][dimension] unless said. */
typedef struct rollout {
    ascc_rollout_worker *worker;
    const ascc_transposed *transposed;
    const ascc_rollout_task *task;
    const ascc_plan *plan;
    ascc_particles *particles;
    ascc_motion motion;
    size_t numbers, walls; /* coordinates of the fluid, of the walls */
    double *wall, *normal; /* [boundary][dimension] */
    bool walls_placed;
    double *truth;
    double *state;     /* [unroll + 1] positions before each step, and after the last */
    int64_t *momentum; /* [unroll] before each step */
    double *by_position, *by_velocity, *seen, *place, *velocity;
    double *by_guess;    /* [fluid] */
    size_t past_numbers; /* velocities of earlier steps: [fluid][history][dimension] */
    double *past;        /* [unroll] before each step */
    double *by_past;     /* of one step */
    double *
        owed; /* [history][fluid][dimension] what later steps read of velocities that are still to come */
    size_t first_frame; /* of the first step with gradient: state 0 is there */
} rollout;

static bool take_memory(rollout *r)
{
    ascc_rollout_worker *w = r->worker;
    const size_t states = (size_t)r->task->unroll + 1, n = r->numbers;
    const size_t past = r->past_numbers;
    const size_t count = 2 * r->walls + n + 2 * states * n + 6 * n + (states + 2) * past;
    void *memory = w->memory;
    if (!ascc_grow(&w->context->allocator, &memory, &w->memory_count, count, sizeof *w->memory))
        return false;
    double *at = w->memory = memory;
    double **const part[] = {&r->by_position, &r->by_velocity, &r->seen,
                             &r->place,       &r->velocity,    &r->by_guess};
    r->wall = at;
    r->normal = at += r->walls;
    r->truth = at += r->walls;
    r->state = at += n;
    at += states * n;
    r->momentum = (int64_t *)(void *)at;
    at += states * n;
    for (size_t i = 0; i < sizeof part / sizeof *part; i++, at += n)
        *part[i] = at;
    r->past = at;
    r->by_past = at += states * past;
    r->owed = at + past;
    return true;
}

static void truth_at(const rollout *r, size_t frame, double *to)
{
    const ascc_kept_sequence *s = r->task->sequence;
    ascc_rigid_transform_apply(&r->task->transform, s->dimension, s->position + frame * r->numbers,
                               s->fluid_count, false, to);
}

/* How walls move from a frame to the next, m/s. */
static void find_wall_velocities(rollout *r, size_t frame)
{
    const ascc_kept_sequence *s = r->task->sequence;
    const size_t next = frame + 1 < s->frame_count ? frame + 1 : frame;
    double *velocity = r->particles->wall_velocity;
    ascc_rigid_transform_apply(&r->task->transform, s->dimension,
                               s->wall + ascc_kept_sequence_walls(s, next), s->boundary_count,
                               false, velocity);
    for (size_t k = 0; k < r->walls; k++)
        velocity[k] = (velocity[k] - r->wall[k]) / r->motion.time_step;
}

/* The walls where a frame has them, for losses, and for a step from that frame. */
static void place_walls(rollout *r, size_t frame)
{
    const ascc_kept_sequence *s = r->task->sequence;
    const ascc_rigid_transform *transform = &r->task->transform;
    const size_t at = ascc_kept_sequence_walls(s, frame);
    if (s->wall_frames == 1 && r->walls_placed)
        return;
    ascc_rigid_transform_apply(transform, s->dimension, s->wall + at, s->boundary_count, false,
                               r->wall);
    ascc_rigid_transform_apply(transform, s->dimension, s->normal + at, s->boundary_count, true,
                               r->normal);
    r->walls_placed = true;
    if (!r->particles || !r->walls)
        return;
    memcpy(r->particles->wall_position, r->wall, r->walls * sizeof *r->wall);
    memcpy(r->particles->wall_normal, r->normal, r->walls * sizeof *r->normal);
    find_wall_velocities(r, frame);
}

/* Velocities of earlier steps by frame difference; before the sequence begins they were the same. */
static void start_past(rollout *r, size_t frame)
{
    ascc_particles *p = r->particles;
    const size_t d = (size_t)p->dimension, history = (size_t)r->plan->history;
    ascc_particles_fill_past(p, 0, p->fluid_count, 0);
    for (size_t age = 0; age < history && frame >= age + 2; age++) {
        truth_at(r, frame - age - 1, r->truth);
        truth_at(r, frame - age - 2, r->state); /* free until the first step */
        for (size_t k = 0; k < r->numbers; k++)
            p->past[(k / d * history + age) * d + k % d] =
                (r->truth[k] - r->state[k]) / r->motion.time_step;
        ascc_particles_fill_past(p, 0, p->fluid_count, (int32_t)age + 1);
    }
}

/* Noise of a coordinate whose past the network sees: velocities walk at random, and the network has to end that.
 * Places have none: what it could not know it is not asked to correct. Returns what is added to the velocity. */
static double add_walk(rollout *r, size_t k, ascc_random *random)
{
    ascc_particles *p = r->particles;
    const size_t d = (size_t)p->dimension, history = (size_t)r->plan->history;
    const double step = r->task->jitter / r->motion.time_step / sqrt((double)history + 1.0);
    double noise = 0.0;
    for (size_t age = history + 1; age-- > 0;) {
        noise += step * ascc_random_normal(random);
        if (age > 0)
            p->past[(k / d * history + age - 1) * d + k % d] += noise;
    }
    return noise;
}

/* Puts the particles where the sequence has them, with velocities by frame difference. */
static void start_at(rollout *r, size_t frame, ascc_random *random)
{
    ascc_particles *p = r->particles;
    const double dt = r->motion.time_step, jitter = r->task->jitter;
    truth_at(r, frame - 1, r->truth);
    truth_at(r, frame, p->position);
    for (size_t k = 0; k < r->numbers; k++) {
        double velocity = (p->position[k] - r->truth[k]) / dt;
        (void)ascc_to_quanta(p->mass[k / (size_t)p->dimension] * velocity, p->quantum,
                             &p->momentum[k]);
    }
    if (r->plan->history)
        start_past(r, frame);
    truth_at(r, frame - 1, r->truth);
    for (size_t k = 0; jitter > 0.0 && k < r->numbers; k++) {
        double velocity = (p->position[k] - r->truth[k]) / dt;
        if (r->plan->history) {
            velocity += add_walk(r, k, random);
        } else {
            p->position[k] += jitter * ascc_random_normal(random);
            velocity += jitter / dt * ascc_random_normal(random);
        }
        (void)ascc_to_quanta(p->mass[k / (size_t)p->dimension] * velocity, p->quantum,
                             &p->momentum[k]);
    }
}

static ascc_status open_particles(rollout *r)
{
    const ascc_kept_sequence *s = r->task->sequence;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = s->dimension,
                                            .spacing = r->plan->spacing,
                                            .mass = 1, /* equal masses cancel */
                                            .fluid_capacity = s->fluid_count,
                                            .boundary_capacity = s->boundary_count};
    place_walls(r, r->task->frame);
    truth_at(r, r->task->frame, r->truth);
    const ascc_const_array position = {.data = r->truth, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = r->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = r->normal, .scalar = ASCC_DOUBLE};
    ascc_status status = ascc_particles_create(r->worker->context, &options, &r->particles);
    if (status == ASCC_OK && !ascc_particles_arrange(r->particles, 0, 0, r->plan->history))
        status = ASCC_ERROR_MEMORY;
    if (status == ASCC_OK)
        status =
            ascc_particles_add_fluid(r->particles, s->fluid_count, &position, NULL, NULL, NULL);
    if (status == ASCC_OK && s->boundary_count)
        status =
            ascc_particles_add_boundary(r->particles, s->boundary_count, &wall, &normal, 0, NULL);
    return status;
}

/* A step from a frame into this arena. */
static ascc_status step_into(rollout *r, size_t frame, size_t arena)
{
    place_walls(r, frame);
    return ascc_step_once(r->worker->step, r->particles, &r->motion, true, &r->worker->kept[arena],
                          &r->worker->state[arena]);
}

static bool blown_up(const rollout *r, size_t frame)
{
    const size_t d = (size_t)r->plan->dimension;
    double sum = 0.0;
    truth_at(r, frame, r->truth);
    for (size_t i = 0; i < r->numbers; i += d) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += (r->particles->position[i + c] - r->truth[i + c]) *
                      (r->particles->position[i + c] - r->truth[i + c]);
        sum += sqrt(square);
    }
    return !(sum * (double)d <= BLOWN_UP * r->plan->spacing * (double)r->numbers);
}

/* Warm-up: steps without gradient; where they blow up, the rest begins at the true state. */
static void prepare(rollout *r, ascc_rollout_result *result)
{
    ascc_random random = r->task->random;
    start_at(r, r->task->frame, &random);
    r->first_frame = r->task->frame;
    for (int32_t w = 0; w < r->task->warm_up; w++) {
        const ascc_status status = step_into(r, r->first_frame, 0);
        r->first_frame++;
        result->steps++;
        if (status == ASCC_OK && !blown_up(r, r->first_frame))
            continue;
        result->ended_early = true;
        start_at(r, r->first_frame, &random);
        return;
    }
}

static void keep_state(rollout *r, size_t t)
{
    memcpy(r->state + t * r->numbers, r->particles->position, r->numbers * sizeof *r->state);
    memcpy(r->momentum + t * r->numbers, r->particles->momentum, r->numbers * sizeof *r->momentum);
    if (r->past_numbers)
        memcpy(r->past + t * r->past_numbers, r->particles->past,
               r->past_numbers * sizeof *r->past);
}

static void restore_state(rollout *r, size_t t)
{
    memcpy(r->particles->position, r->state + t * r->numbers, r->numbers * sizeof *r->state);
    memcpy(r->particles->momentum, r->momentum + t * r->numbers, r->numbers * sizeof *r->momentum);
    if (r->past_numbers)
        memcpy(r->particles->past, r->past + t * r->past_numbers,
               r->past_numbers * sizeof *r->past);
}

/* Steps whose arenas are kept: the last ones, as many as fit. */
static size_t count_kept(const rollout *r, size_t unroll)
{
    const size_t size = ascc_arena_size(&r->worker->kept[0]) + 1;
    const size_t fit = r->task->memory_limit / size;
    return fit < 1 ? 1 : fit < unroll ? fit : unroll;
}

/* Velocities after step t against the truth's way there; gradient as of velocities. */
static double velocity_loss_at(rollout *r, size_t t, size_t unroll, double *gradient)
{
    const double dt = r->motion.time_step, quantum = r->particles->quantum; /* masses are 1 */
    double *way = r->velocity, *from = r->place, *by_way = r->seen; /* free between two steps */
    if (!(r->task->velocity_weight > 0.0))
        return 0.0;
    truth_at(r, r->first_frame + t - 1, from);
    for (size_t k = 0; k < r->numbers; k++) {
        way[k] = (double)r->momentum[t * r->numbers + k] * quantum * dt;
        by_way[k] = 0.0;
    }
    const double loss = ascc_velocity_loss_of(r->task, r->plan, way, from, r->truth,
                                              1.0 / (double)unroll, gradient ? by_way : NULL);
    for (size_t k = 0; gradient && k < r->numbers; k++)
        gradient[k] += by_way[k] * dt;
    return loss;
}

/* by_position, by_velocity: NULL, or what their gradients are added to. */
static ascc_status loss_at(rollout *r, size_t t, size_t unroll, double *loss, double *by_position,
                           double *by_velocity)
{
    ascc_message message;
    const ascc_search_tools tools = {&r->worker->loss_scratch, r->worker->context->workers,
                                     &r->worker->context->kernels, &message};
    truth_at(r, r->first_frame + t, r->truth);
    place_walls(r, r->first_frame + t);
    *loss += velocity_loss_at(r, t, unroll, by_velocity);
    return ascc_loss_of(r->task, r->plan, &tools, r->state + t * r->numbers, r->truth, r->wall,
                        r->normal, r->first_frame + t, 1.0 / (double)unroll, loss, by_position);
}

/* Adds to the gradient of velocities before a step what later steps read of them, and notes what this one read of
 * those before. */
static void settle_past(rollout *r)
{
    const size_t n = r->numbers, d = (size_t)r->plan->dimension, history = (size_t)r->plan->history;
    for (size_t k = 0; k < n; k++)
        r->by_velocity[k] += r->owed[k];
    for (size_t age = 0; age < history; age++)
        for (size_t k = 0; k < n; k++)
            r->owed[age * n + k] = (age + 1 < history ? r->owed[(age + 1) * n + k] : 0.0) +
                                   r->by_past[(k / d * history + age) * d + k % d];
}

/* Gradients after a step become those before it. */
static ascc_status step_back(rollout *r, size_t t, const ascc_step_state *state, float *packed,
                             ascc_constant_gradients *by_constants)
{
    ascc_rollout_worker *w = r->worker;
    const size_t n = r->numbers;
    const double dt = r->motion.time_step;
    memset(r->seen, 0, 4 * n * sizeof *r->seen); /* seen, place, velocity, by_guess lie together */
    const ascc_relaxation_gradients relaxed = {.before = r->state + t * n,
                                               .position = r->by_position,
                                               .velocity = r->by_velocity,
                                               .by_guess = r->by_guess,
                                               .by_before = r->place,
                                               .by_constants = by_constants};
    if (r->task->relaxation_gradients &&
        ascc_relaxation_backward(state, &w->scratch, &relaxed) != ASCC_OK)
        return ASCC_ERROR_MEMORY;
    /* x' = x + dt v', v' = v* + dv: by_velocity is from here on of v', and of dv */
    for (size_t k = 0; k < n; k++)
        r->by_velocity[k] += dt * r->by_position[k];
    ascc_arena_reset(&w->scratch);
    if (r->past_numbers)
        memset(r->by_past, 0, r->past_numbers * sizeof *r->by_past);
    const bool first = t == 0;
    const bool places = r->task->position_gradients && !first;
    const ascc_backward pass = {.run = &state->run,
                                .transposed = r->transposed,
                                .arena = &w->scratch,
                                .time_step = dt,
                                .position = r->state + t * n,
                                .correction = r->by_velocity,
                                .guess = r->by_guess,
                                .packed = packed,
                                .velocity = first ? NULL : r->velocity,
                                .past = r->past_numbers ? r->by_past : NULL,
                                .seen = places ? r->seen : NULL,
                                .place = places ? r->place : NULL};
    const ascc_status status = ascc_backward_run(&pass);
    const double carried = r->motion.advection == ASCC_ADVECT_NONE ? 0.0 : dt;
    for (size_t k = 0; k < n; k++) {
        r->by_velocity[k] += r->velocity[k] + carried * r->seen[k];
        r->by_position[k] += r->seen[k] + r->place[k];
    }
    if (r->past_numbers)
        settle_past(r);
    return status;
}

/* Steps with gradient, forwards. Returns how many could be computed. */
static size_t go_forwards(rollout *r, ascc_rollout_result *result, size_t *kept_from)
{
    const size_t unroll = (size_t)r->task->unroll;
    size_t kept = unroll;
    for (size_t t = 0; t < unroll; t++) {
        keep_state(r, t);
        const bool kept_step = t == 0 || t >= unroll - kept;
        const ascc_status status =
            step_into(r, r->first_frame + t, kept_step ? t % r->worker->kept_count : 0);
        if (t == 0)
            kept = count_kept(r, unroll);
        result->status = status == ASCC_ERROR_MEMORY ? status : result->status;
        if (status != ASCC_OK)
            return t;
        result->steps++;
    }
    keep_state(r, unroll);
    *kept_from = unroll - kept;
    return unroll;
}

static void go_back(rollout *r, ascc_rollout_result *result, size_t kept_from, float *packed,
                    float *gradient)
{
    const size_t unroll = (size_t)r->task->unroll, n = r->numbers;
    const ascc_model *model = r->worker->model;
    double unused = 0.0;
    memset(packed, 0, model->packed.count * sizeof *packed);
    memset(r->by_position, 0, n * sizeof *r->by_position);
    memset(r->by_velocity, 0, n * sizeof *r->by_velocity);
    if (r->past_numbers)
        memset(r->owed, 0, r->past_numbers * sizeof *r->owed);
    for (size_t t = unroll; t > 0 && result->status == ASCC_OK; t--) {
        size_t arena = t - 1;
        result->status = loss_at(r, t, unroll, &unused, r->by_position, r->by_velocity);
        if (result->status == ASCC_OK && t - 1 < kept_from && t - 1 > 0) {
            arena = unroll - 1; /* the last step's: no longer needed */
            restore_state(r, t - 1);
            result->status = step_into(r, r->first_frame + t - 1, arena);
        } else if (result->status == ASCC_OK && t == 1 && kept_from > 0) {
            restore_state(r, 0); /* its arena served other steps meanwhile */
            result->status = step_into(r, r->first_frame, 0);
        }
        if (result->status == ASCC_OK)
            result->status =
                step_back(r, t - 1, &r->worker->state[arena], packed, &result->constants);
    }
    if (result->status == ASCC_OK)
        ascc_packed_fold(&model->packed, &model->plan, model->weights, packed, gradient);
}

/* Everything but the particles' first state. */
static ascc_status open_rollout(rollout *r, ascc_rollout_worker *worker,
                                const ascc_rollout_task *task)
{
    const ascc_plan *plan = &worker->model->plan;
    const size_t d = (size_t)plan->dimension;
    *r = (rollout){.worker = worker, .task = task, .plan = plan};
    r->numbers = task->sequence->fluid_count * d;
    r->walls = task->sequence->boundary_count * d;
    r->past_numbers = r->numbers * (size_t)plan->history;
    r->motion = (ascc_motion){.time_step = task->sequence->time_step, .advection = plan->advection};
    for (size_t c = 0; c < d; c++)
        for (size_t k = 0; k < d; k++)
            r->motion.gravity[c] += task->transform.turn[c][k] * task->sequence->gravity[k];
    return take_memory(r) ? open_particles(r) : ASCC_ERROR_MEMORY;
}

/* An engine that computes the network and moves nothing by it. */
static ascc_status look(ascc_step_state *state)
{
    ascc_status status = ascc_stage_sight(state);
    if (status == ASCC_OK)
        status = ascc_network_demand(&state->run, state->network, &state->hierarchy, &state->tools,
                                     state->expected);
    if (status == ASCC_OK)
        status = ascc_network_forward(&state->run, state->fluid_features, state->boundary_features);
    ascc_arena_return(state->tools.arena, state->before_features);
    return status;
}

ascc_status ascc_rollout_look(ascc_rollout_worker *worker, const ascc_rollout_task *task)
{
    rollout r;
    ascc_random random = task->random;
    const ascc_engine own = worker->step->engine;
    ascc_status status = open_rollout(&r, worker, task);
    if (status == ASCC_OK) {
        start_at(&r, task->frame, &random);
        worker->step->engine = look;
        status = step_into(&r, task->frame, 0);
        worker->step->engine = own;
    }
    ascc_particles_destroy(&r.particles);
    return status;
}

ascc_rollout_result ascc_rollout_run(ascc_rollout_worker *worker, const ascc_transposed *transposed,
                                     const ascc_rollout_task *task, float *packed, float *gradient)
{
    const size_t unroll = (size_t)task->unroll;
    rollout r;
    ascc_rollout_result result = {.status = open_rollout(&r, worker, task)};
    r.transposed = transposed;
    if (result.status == ASCC_OK) {
        size_t kept_from = 0;
        prepare(&r, &result);
        const size_t done = go_forwards(&r, &result, &kept_from);
        result.failed_frame = r.first_frame + done;
        for (size_t t = 1; t <= done && done == unroll && result.status == ASCC_OK; t++)
            result.status = loss_at(&r, t, unroll, &result.loss, NULL, NULL);
        result.skipped = done < unroll;
        if (!result.skipped && result.status == ASCC_OK && task->backward && isfinite(result.loss))
            go_back(&r, &result, kept_from, packed, gradient);
        if (result.status == ASCC_ERROR_RANGE) { /* a loss of particles beyond all bounds */
            result.skipped = true;
            result.status = ASCC_OK;
        }
    }
    ascc_particles_destroy(&r.particles);
    return result;
}
