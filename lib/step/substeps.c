/* How the host's time step becomes steps that the network was trained for. SPDX-License-Identifier: MIT
 *
 * In spacings and steps gravity is G = g dt^2 / h and the way of a particle v dt / h. Both fall with the number of
 * steps that a time step is cut into, which so is the smallest that brings both into the model's range.
 */
#include "substeps.h"

#include <math.h>
#include <string.h>

#include "lone.h"

#define SPACING_TOLERANCE 1e-3 /* of the model's: spacings are told in floats, too */
#define ROUNDING 1e-6          /* of a count: what it rests on are quotients */
#define MAX_SUBSTEPS 1000

void ascc_find_units(ascc_step *step, const ascc_particles *p)
{
    const double spacing = step->model->plan.spacing, own = p->spacing * step->length_unit;
    const bool same = fabs(own - spacing) <= SPACING_TOLERANCE * spacing;
    step->model_length = same ? step->length_unit : spacing / p->spacing;
    step->model_time = same ? 1.0 : sqrt(spacing / own);
}

/* ---- What a step meets ---- */

typedef struct extremes_job {
    const ascc_particles *p;
    const double *acceleration;                    /* or NULL */
    atomic_uint_least64_t speed, wall_speed, push; /* squares of the largest, as bits */
} extremes_job;

/* Bits of numbers >= 0 are in the order of the numbers, so that no order of threads matters. */
static void raise_to(atomic_uint_least64_t *most, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    uint_least64_t before = atomic_load_explicit(most, memory_order_relaxed);
    while (before < bits && !atomic_compare_exchange_weak_explicit(
                                most, &before, bits, memory_order_relaxed, memory_order_relaxed))
        ;
}

static double root_of(atomic_uint_least64_t *most)
{
    const uint64_t bits = atomic_load_explicit(most, memory_order_relaxed);
    double square;
    memcpy(&square, &bits, sizeof square);
    return sqrt(square);
}

static double square_of(const double *vector, size_t d)
{
    double square = 0.0;
    for (size_t c = 0; c < d; c++)
        square += vector[c] * vector[c];
    return square;
}

static void look_at_fluid(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    extremes_job *job = data;
    const ascc_particles *p = job->p;
    const size_t d = (size_t)p->dimension;
    double speed = 0.0, push = 0.0;
    for (size_t i = begin; i < end; i++) {
        double v[3] = {0.0, 0.0, 0.0};
        for (int32_t c = 0; c < p->dimension; c++)
            v[c] = ascc_velocity(p, i, c);
        speed = fmax(speed, square_of(v, d));
        if (job->acceleration)
            push = fmax(push, square_of(job->acceleration + i * d, d));
    }
    raise_to(&job->speed, speed);
    raise_to(&job->push, push);
}

static void look_at_walls(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    extremes_job *job = data;
    const size_t d = (size_t)job->p->dimension;
    double speed = 0.0;
    for (size_t i = begin; i < end; i++)
        speed = fmax(speed, square_of(job->p->wall_velocity + i * d, d));
    raise_to(&job->wall_speed, speed);
}

/* ---- How many steps ---- */

static double steps_for(double ratio)
{
    return fmax(ceil(ratio * (1.0 - ROUNDING)), 1.0);
}

/* What goes this far has left the scene or blown up, or its gravity is no gravity: the step says which row it is. */
static bool is_too_far(const ascc_motion *motion, double way)
{
    return motion->max_displacement > 0.0 && !(way <= motion->max_displacement);
}

/* Of the fluid: a particle too fast for a whole step counts where it may meet another. */
static ascc_status find_speed_that_counts(const ascc_step *step, const ascc_particles *p,
                                          double push, double *fastest)
{
    const ascc_plan *plan = &step->model->plan;
    const double dt = step->time_step, slow = p->spacing * plan->way_max / dt - push * dt;
    if (!(*fastest > slow) || isinf(*fastest))
        return ASCC_OK;
    const double way = (*fastest + push * dt) * dt;
    return ascc_speed_in_company(step->context, p, step->halo, slow,
                                 ascc_plan_receptive_radius(plan) / step->model_length + 2.0 * way,
                                 fastest);
}

ascc_status ascc_count_substeps(ascc_step *step, const ascc_particles *p, const ascc_motion *motion,
                                int32_t *count)
{
    const ascc_plan *plan = &step->model->plan;
    const double dt = step->time_step, h = p->spacing;
    const double most = step->most_substeps > 0 ? step->most_substeps : MAX_SUBSTEPS;
    extremes_job job = {.p = p, .acceleration = motion->acceleration};
    *count = 1;
    if (step->most_substeps < 0)
        return ASCC_OK;
    ascc_workers_run(step->context->workers, p->fluid_count, 8192, look_at_fluid, &job);
    ascc_workers_run(step->context->workers, p->boundary_count, 8192, look_at_walls, &job);
    double extremes[2] = {root_of(&job.speed), root_of(&job.push)};
    ascc_status status = step->halo ? ascc_halo_largest(step->halo, extremes, 2) : ASCC_OK;
    double speed = extremes[0];
    const double push = sqrt(square_of(motion->gravity, 3)) + extremes[1];
    const double gravity = push * dt * dt / h;
    if (status == ASCC_OK)
        status = find_speed_that_counts(step, p, push, &speed);
    if (status != ASCC_OK)
        return status;
    speed = fmax(speed, root_of(&job.wall_speed));
    double steps = steps_for(dt * step->model_time / plan->time_step_max);
    if (!is_too_far(motion, (speed + push * dt / steps) * dt / steps)) {
        steps = fmax(steps, steps_for(sqrt(gravity / plan->gravity_max)));
        steps = fmax(steps, steps_for((speed + push * dt / steps) * dt / (h * plan->way_max)));
    }
    if (!(steps <= most))
        return ascc_fail(&step->message, ASCC_ERROR_RANGE,
                         "a step of %g s, gravity of %g spacings a squared step and ways of %g "
                         "spacings need %g substeps: at most %g are taken",
                         dt, gravity, speed * dt / h, steps, most);
    if (gravity / (steps * steps) < plan->gravity_min * (1.0 - ROUNDING))
        return ascc_fail(
            &step->message, ASCC_ERROR_RANGE,
            "gravity of %g spacings a squared step in %g substeps: the model was trained "
            "for at least %g",
            gravity / (steps * steps), steps, plan->gravity_min);
    *count = (int32_t)steps;
    return ASCC_OK;
}
