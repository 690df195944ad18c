/* Several models of one fluid: each step runs the best that a budget of time allows.
 * SPDX-License-Identifier: MIT */
#include "ladder.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commit.h"
#include "detail.h"

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_ladder_options) == 56, "released layout");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_ladder_statistics) % 8 == 0,
               "no padding at the end");

#define SAME 1e-6 /* relative: of two models' spacings, time steps, gravities */
/* Steps of each rung when it is measured: the first makes scratch. */
#define MEASURED 2

static bool is_ladder(const ascc_ladder *ladder)
{
    return ladder && ladder->magic == ASCC_LADDER_MAGIC;
}

ascc_status ascc_ladder_fail(ascc_ladder *ladder, ascc_status status, const char *format, ...)
{
    char text[ASCC_MESSAGE_CAPACITY];
    va_list list;
    va_start(list, format);
    (void)vsnprintf(text, sizeof text, format, list);
    va_end(list);
    ascc_fail(&ladder->message, status, "%s", text);
    ascc_context_log(ladder->context, ladder->message.text);
    return status;
}

const char *ascc_ladder_message(const ascc_ladder *ladder)
{
    return is_ladder(ladder) ? ladder->message.text : "";
}

/* ---- Making one ---- */

static bool alike(double a, double b)
{
    return fabs(a - b) <= SAME * fabs(a);
}

/* Models that a scene can change between; time steps: the host gives none. */
static ascc_status check_models(const ascc_model *const *models, size_t count, bool time_steps,
                                ascc_message *message)
{
    if (count < 1 || count > ASCC_MAX_RUNGS || !models)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "a ladder has 1 to %d models, not %zu",
                         ASCC_MAX_RUNGS, models ? count : (size_t)0);
    for (size_t i = 0; i < count; i++) {
        if (!models[i] || models[i]->magic != ASCC_MODEL_MAGIC)
            return ascc_fail(message, ASCC_ERROR_ARGUMENT, "rung %zu: not a model", i);
        const ascc_plan *a = &models[0]->plan, *b = &models[i]->plan;
        bool gravity = true;
        for (int c = 0; c < 3; c++)
            gravity &= alike(a->gravity[c], b->gravity[c]);
        const char *differs = a->dimension != b->dimension                       ? "dimension"
                              : !alike(a->spacing, b->spacing)                   ? "spacing"
                              : time_steps && !alike(a->time_step, b->time_step) ? "time step"
                              : !gravity                                         ? "gravity"
                                                                                 : NULL;
        if (differs)
            return ascc_fail(message, ASCC_ERROR_MISMATCH, "rung %zu: its %s is not that of rung 0",
                             i, differs);
    }
    return ASCC_OK;
}

/* Has it a network, whose input may be strange to it? */
static bool has_network(const ascc_model *model)
{
    return model->plan.layer_count > 0;
}

/* Networks tell how far their input is from training's, and have a rung without one below. */
static ascc_status check_distances(const ascc_model *const *models, size_t count,
                                   ascc_message *message)
{
    bool refuge = false;
    for (size_t i = 0; i < count; i++) {
        if (has_network(models[i]) && models[i]->trust.layer < 0)
            return ascc_fail(message, ASCC_ERROR_MISMATCH,
                             "max_distance: rung %zu, %s, has no statistics of its training "
                             "('ascc trust' gives it some)",
                             i, ascc_quote(models[i]->plan.name).text);
        if (has_network(models[i]) && !refuge)
            return ascc_fail(message, ASCC_ERROR_MISMATCH,
                             "max_distance: below rung %zu there is none without a network", i);
        refuge |= !has_network(models[i]);
    }
    return ASCC_OK;
}

static ascc_status read_options(const ascc_ladder_options *given, ascc_ladder_options *o,
                                ascc_message *message)
{
    *o = (ascc_ladder_options){0};
    if (given &&
        !ascc_read_struct(o, sizeof *o, given, offsetof(ascc_ladder_options, max_distance)))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "ascc_ladder_options.size is not understood");
    if (!(o->budget >= 0.0 && isfinite(o->budget)) || !(o->dwell >= 0.0 && isfinite(o->dwell)) ||
        !(o->max_distance >= 0.0 && isfinite(o->max_distance)))
        return ascc_fail(
            message, ASCC_ERROR_ARGUMENT,
            "ladder options: budget %g, dwell %g, max_distance %g: each must be finite and >= 0",
            o->budget, o->dwell, o->max_distance);
    return ASCC_OK;
}

static void release(ascc_ladder *ladder)
{
    const ascc_allocator *a = &ladder->context->allocator;
    for (int32_t r = 0; r < ladder->count; r++)
        ascc_step_destroy(&ladder->rung[r]);
    ascc_release(a, ladder->change, ladder->change_capacity, sizeof *ladder->change);
    ascc_release(a, ladder->kept, ladder->kept_capacity, 1);
    ladder->magic = 0;
    ascc_release(a, ladder, 1, sizeof *ladder);
}

/* The context has the message of a step that could not be made. */
static ascc_status make_rungs(ascc_ladder *ladder, const ascc_model *const *models, size_t count,
                              const ascc_ladder_options *o)
{
    ascc_status status = ASCC_OK;
    ascc_step_options options = {.size = sizeof options};
    if (o->step && !ascc_read_struct(&options, sizeof options, o->step,
                                     offsetof(ascc_step_options, sleep_speed))) {
        ascc_message message;
        status =
            ascc_fail(&message, ASCC_ERROR_ARGUMENT, "ascc_step_options.size is not understood");
        return ascc_context_fail(ladder->context, status, &message);
    }
    options.size = sizeof options;
    options.measure_distance |= o->max_distance > 0.0;
    for (size_t i = 0; i < count && status == ASCC_OK; i++) {
        status = ascc_step_create(ladder->context, models[i], &options, &ladder->rung[i]);
        ladder->count += status == ASCC_OK;
    }
    if (status != ASCC_OK)
        return status;
    const ascc_step *step = ladder->rung[0];
    const double dwell = o->dwell > 0.0 ? o->dwell : 1.0;
    ascc_rung_choice_open(&ladder->choice, ladder->count,
                          (uint64_t)fmin(ceil(dwell / (step->time_step)), 1e15));
    ladder->clock = o->clock;
    ladder->user = o->user;
    ladder->budget = o->budget;
    ladder->max_distance = o->max_distance;
    ladder->statistics.rung_count = ladder->count;
    ladder->statistics.rung = ladder->choice.rung;
    return ASCC_OK;
}

ascc_status ascc_ladder_create(ascc_context *context, size_t count, const ascc_model *const *models,
                               const ascc_ladder_options *options, ascc_ladder **ladder)
{
    ASCC_FLOAT_SCOPE;
    if (ladder)
        *ladder = NULL;
    if (!context || context->magic != ASCC_CONTEXT_MAGIC || !ladder)
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_ladder_options o;
    ascc_status status = read_options(options, &o, &message);
    if (status == ASCC_OK)
        status = check_models(models, count, !(o.step && o.step->time_step > 0.0), &message);
    if (status == ASCC_OK && o.max_distance > 0.0)
        status = check_distances(models, count, &message);
    ascc_ladder *made = NULL;
    if (status == ASCC_OK) {
        made = ascc_allocate(&context->allocator, 1, sizeof *made);
        if (!made)
            status = ascc_fail(&message, ASCC_ERROR_MEMORY, "no memory for a ladder");
    }
    if (status != ASCC_OK)
        return ascc_context_fail(context, status, &message);
    memset(made, 0, sizeof *made);
    made->magic = ASCC_LADDER_MAGIC;
    made->context = context;
    status = make_rungs(made, models, count, &o);
    if (status != ASCC_OK) {
        release(made);
        return status;
    }
    ascc_context_retain(context);
    *ladder = made;
    return ASCC_OK;
}

void ascc_ladder_destroy(ascc_ladder **ladder)
{
    if (!ladder || !*ladder)
        return;
    ascc_context *context = (*ladder)->context;
    release(*ladder);
    *ladder = NULL;
    ascc_context_release(context);
}

/* ---- One step ---- */

static double now(const ascc_ladder *ladder)
{
    return ladder->clock ? ladder->clock(ladder->user) : ascc_clock();
}

static const char *name_of(const ascc_ladder *ladder, int32_t rung)
{
    return ladder->rung[rung]->model->plan.name;
}

/* Adds what a step's run tells to that of the ladder. */
static void add_run(ascc_ladder_statistics *to, const ascc_step_statistics *from)
{
    if (to->steps == 0)
        memcpy(to->momentum_before, from->momentum_before, sizeof to->momentum_before);
    memcpy(to->momentum_after, from->momentum_after, sizeof to->momentum_after);
    for (int c = 0; c < 3; c++) {
        to->external_impulse[c] =
            (int64_t)((uint64_t)to->external_impulse[c] + (uint64_t)from->external_impulse[c]);
        to->wall_impulse[c] =
            (int64_t)((uint64_t)to->wall_impulse[c] + (uint64_t)from->wall_impulse[c]);
        to->support_impulse[c] =
            (int64_t)((uint64_t)to->support_impulse[c] + (uint64_t)from->support_impulse[c]);
    }
    to->steps++;
}

/* What of the fluid of a step on this rung the best model computes. */
typedef struct shares {
    bool some, all;
    uint64_t base, best; /* particles */
} shares;

static shares find_shares(const ascc_ladder *ladder, int32_t rung, const ascc_particles *p)
{
    shares s = {.base = p->fluid_count};
    if (rung == ladder->count - 1)
        return s;
    s.base = 0;
    for (size_t i = 0; i < p->fluid_count; i++) {
        s.best += p->detail[i] > 0.0;
        s.base += p->detail[i] < 1.0;
    }
    s.some = s.best > 0;
    s.all = s.some && s.base == 0;
    return s;
}

static ascc_status run_shares(ascc_ladder *ladder, int32_t rung, const shares *s, ascc_particles *p,
                              const ascc_forces *forces, bool continues)
{
    const int32_t top = ladder->count - 1, own = s->all ? top : rung;
    ascc_step *step = ladder->rung[own];
    const char *obstacle =
        s->some && !s->all
            ? ascc_detail_obstacle(&step->model->plan, &ladder->rung[top]->model->plan)
            : NULL;
    if (obstacle)
        return ascc_ladder_fail(ladder, ASCC_ERROR_MISMATCH, "detail: %s and %s: %s",
                                name_of(ladder, rung), name_of(ladder, top), obstacle);
    step->continues = continues;
    step->detail = s->some && !s->all ? ladder->rung[top] : NULL;
    const ascc_status status = ascc_step_run(step, p, forces, 1);
    step->continues = false;
    step->detail = NULL;
    if (status != ASCC_OK) /* logged by the step */
        return ascc_fail(&ladder->message, status, "%s: %s", name_of(ladder, own),
                         step->message.text);
    ladder->ran = own;
    memset(ladder->statistics.particles_on, 0, sizeof ladder->statistics.particles_on);
    ladder->statistics.particles_on[top] = s->best;
    ladder->statistics.particles_on[rung] = s->base;
    return ASCC_OK;
}

/* A step on a rung; its time. */
static ascc_status run_rung(ascc_ladder *ladder, int32_t rung, ascc_particles *p,
                            const ascc_forces *forces, bool continues, double *seconds)
{
    const double begin = now(ladder);
    const shares s = find_shares(ladder, rung, p);
    const ascc_status status = run_shares(ladder, rung, &s, p, forces, continues);
    *seconds = now(ladder) - begin;
    return status;
}

/* Notes a choice; room for it was made before the step. */
static void note(ascc_ladder *ladder, int32_t rung, double seconds)
{
    ascc_ladder_statistics *s = &ladder->statistics;
    if (ladder->change_count == 0 || ladder->change[ladder->change_count - 1].rung != rung) {
        s->changes += ladder->change_count > 0;
        ladder->change[ladder->change_count++] =
            (ascc_rung_change){.step = ascc_ladder_step_count(ladder), .rung = rung};
    }
    s->steps_on[rung]++;
    s->rung = ladder->ran;
    s->seconds = seconds;
    s->late += ladder->budget > 0.0 && seconds > ladder->budget;
}

/* Changes, and that nothing is fast enough, are lines in the log. */
static void tell(const ascc_ladder *ladder, int32_t before, int32_t reason_before)
{
    const ascc_rung_choice *choice = &ladder->choice;
    ascc_message line;
    if (choice->reason == ASCC_LADDER_TOO_SLOW && reason_before != ASCC_LADDER_TOO_SLOW)
        ascc_fail(&line, ASCC_OK,
                  "ladder: %s takes longer than the budget of %g s, and no rung is faster",
                  name_of(ladder, choice->rung), ladder->budget);
    else if (choice->rung != before && choice->reason == ASCC_LADDER_STRANGE)
        ascc_fail(&line, ASCC_OK,
                  "ladder: from %s to %s: what the fluid does is %.3g times as far as usual from "
                  "what the former was trained on",
                  name_of(ladder, before), name_of(ladder, choice->rung),
                  ladder->statistics.distance_mean);
    else if (choice->rung != before && ladder->change_count > 0)
        ascc_fail(&line, ASCC_OK, "ladder: from %s to %s, for a budget of %g s",
                  name_of(ladder, before), name_of(ladder, choice->rung), ladder->budget);
    else
        return;
    ascc_context_log(ladder->context, line.text);
}

/* ---- Trust ---- */

/* Takes over how far from its training a rung has seen its input. */
static void note_distance(ascc_ladder *ladder, int32_t rung)
{
    const ascc_step_statistics *from = &ladder->rung[rung]->statistics;
    ascc_ladder_statistics *s = &ladder->statistics;
    if (!ladder->rung[rung]->measures)
        return;
    s->distance_mean = from->distance_mean;
    s->distance_worst = from->distance_worst;
    s->distance_row = from->distance_row;
    s->distance_count = from->distance_count;
}

/* The best rung below this one that has no network. */
static int32_t refuge_of(const ascc_ladder *ladder, int32_t rung)
{
    while (rung > 0 && has_network(ladder->rung[rung]->model))
        rung--;
    return rung;
}

static void doubt_if_strange(ascc_ladder *ladder, int32_t rung)
{
    if (ladder->max_distance > 0.0 && ladder->rung[rung]->measures &&
        !(ladder->statistics.distance_mean <= ladder->max_distance))
        ascc_rung_choice_doubt(&ladder->choice, rung, refuge_of(ladder, rung));
}

/* Doubts last a dwell; then the network that had them looks again, once for each dwell. */
static ascc_status look_again(ascc_ladder *ladder, ascc_particles *p, const ascc_forces *forces,
                              double *seconds)
{
    ascc_rung_choice *choice = &ladder->choice;
    const int32_t rung = choice->doubter;
    if (choice->doubted >= ladder->count || choice->doubts < choice->dwell)
        return ASCC_OK;
    const double begin = now(ladder);
    const ascc_status status = ascc_step_look(ladder->rung[rung], p, forces);
    *seconds = now(ladder) - begin;
    if (status != ASCC_OK)
        return ascc_fail(&ladder->message, status, "%s: %s", name_of(ladder, rung),
                         ladder->rung[rung]->message.text);
    note_distance(ladder, rung);
    ascc_rung_choice_trust(choice);
    doubt_if_strange(ladder, rung);
    return ASCC_OK;
}

/* given: the rung, or negative: by the budget. */
static ascc_status run_once(ascc_ladder *ladder, ascc_particles *p, const ascc_forces *forces,
                            int32_t given)
{
    const ascc_rung_choice before = ladder->choice;
    if (!ascc_grow(&ladder->context->allocator, (void **)&ladder->change, &ladder->change_capacity,
                   ladder->change_count + 1, sizeof *ladder->change))
        return ascc_ladder_fail(ladder, ASCC_ERROR_MEMORY, "no memory for one more choice");
    double looked = 0.0;
    ascc_status status = given < 0 ? look_again(ladder, p, forces, &looked) : ASCC_OK;
    if (status != ASCC_OK) {
        ladder->choice = before;
        return status;
    }
    if (given < 0) {
        ascc_rung_choice_make(&ladder->choice, ladder->budget, p->fluid_count);
    } else {
        ladder->choice.reason = ASCC_LADDER_GIVEN;
        ascc_rung_choice_take(&ladder->choice, given);
    }
    const int32_t rung = ladder->choice.rung;
    double seconds;
    status = run_rung(ladder, rung, p, forces, ladder->statistics.steps > 0, &seconds);
    if (status != ASCC_OK) {
        ladder->choice = before;
        return status;
    }
    add_run(&ladder->statistics, &ladder->rung[ladder->ran]->statistics);
    tell(ladder, before.rung, before.reason);
    note(ladder, rung, seconds + looked);
    note_distance(ladder, ladder->ran);
    ascc_rung_choice_learn(&ladder->choice, seconds, p->fluid_count);
    if (given < 0)
        doubt_if_strange(ladder, ladder->ran);
    return ASCC_OK;
}

/* ---- The calls ---- */

static ascc_status check(ascc_ladder *ladder, const ascc_particles *p)
{
    return ascc_particles_is_set(p)
               ? ASCC_OK
               : ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "not a particle set");
}

/* rungs: NULL = by the budget. */
static ascc_status run(ascc_ladder *ladder, ascc_particles *p, const ascc_forces *forces,
                       const int32_t *rungs, int32_t count)
{
    ascc_ladder_statistics *s = &ladder->statistics;
    s->steps = 0;
    memset(s->external_impulse, 0, sizeof s->external_impulse);
    memset(s->wall_impulse, 0, sizeof s->wall_impulse);
    memset(s->support_impulse, 0, sizeof s->support_impulse);
    ascc_status status = check(ladder, p);
    if (status == ASCC_OK && count < 0)
        status = ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "count = %d is negative", count);
    for (int32_t i = 0; status == ASCC_OK && rungs && i < count; i++)
        if (rungs[i] < 0 || rungs[i] >= ladder->count)
            status = ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "rungs[%d] is %d, of %d", i,
                                      rungs[i], ladder->count);
    if (status != ASCC_OK)
        return status;
    ascc_totals(ladder->context->workers, s->momentum_before, p->momentum, p->fluid_count,
                (size_t)p->dimension);
    memcpy(s->momentum_after, s->momentum_before, sizeof s->momentum_after);
    bool known = true;
    for (int32_t r = 0; r < ladder->count; r++)
        known &= ladder->choice.cost[r] > 0.0;
    if (!rungs && ladder->budget > 0.0 && count > 0 && p->fluid_count > 0 && !known)
        status = ascc_ladder_measure(ladder, p, forces);
    for (int32_t n = 0; status == ASCC_OK && n < count; n++)
        status = run_once(ladder, p, forces, rungs ? rungs[n] : -1);
    s->reason = ladder->choice.reason;
    for (int32_t r = 0; r < ladder->count; r++)
        s->predicted[r] = ladder->choice.cost[r] * (double)p->fluid_count;
    return status;
}

ascc_status ascc_ladder_run(ascc_ladder *ladder, ascc_particles *particles,
                            const ascc_forces *forces, int32_t count)
{
    ASCC_FLOAT_SCOPE;
    return is_ladder(ladder) ? run(ladder, particles, forces, NULL, count) : ASCC_ERROR_ARGUMENT;
}

ascc_status ascc_ladder_replay(ascc_ladder *ladder, ascc_particles *particles,
                               const ascc_forces *forces, const int32_t *rungs, int32_t count)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder))
        return ASCC_ERROR_ARGUMENT;
    if (!rungs)
        return ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "rungs: NULL");
    return run(ladder, particles, forces, rungs, count);
}

ascc_status ascc_ladder_measure(ascc_ladder *ladder, ascc_particles *particles,
                                const ascc_forces *forces)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder))
        return ASCC_ERROR_ARGUMENT;
    ascc_status status = check(ladder, particles);
    const size_t size = ascc_particles_snapshot_size(particles);
    if (status == ASCC_OK && !ascc_grow(&ladder->context->allocator, (void **)&ladder->kept,
                                        &ladder->kept_capacity, size, 1))
        status = ascc_ladder_fail(ladder, ASCC_ERROR_MEMORY, "no memory to keep %zu particles",
                                  particles->fluid_count);
    if (status == ASCC_OK)
        status = ascc_particles_snapshot(particles, ladder->kept, size);
    if (status != ASCC_OK || particles->fluid_count == 0)
        return status;
    for (int32_t r = 0; r < ladder->count && status == ASCC_OK; r++) {
        double seconds = 0.0;
        for (int n = 0; n < MEASURED && status == ASCC_OK; n++)
            status = run_rung(ladder, r, particles, forces, false, &seconds);
        const ascc_status back = ascc_particles_restore(particles, ladder->kept, size);
        status = status == ASCC_OK ? back : status;
        if (status == ASCC_OK && seconds > 0.0)
            ascc_rung_choice_know(&ladder->choice, r, seconds / (double)particles->fluid_count);
    }
    return status;
}

ascc_status ascc_ladder_set_budget(ascc_ladder *ladder, double budget)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder))
        return ASCC_ERROR_ARGUMENT;
    if (!(budget >= 0.0 && isfinite(budget)))
        return ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "budget %g: must be finite and >= 0",
                                budget);
    ladder->budget = budget;
    return ASCC_OK;
}

ascc_status ascc_ladder_get_statistics(const ascc_ladder *ladder,
                                       ascc_ladder_statistics *statistics)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder) || !statistics)
        return ASCC_ERROR_ARGUMENT;
    ascc_ladder_statistics s = ladder->statistics;
    s.budget = ladder->budget;
    return ascc_write_struct(statistics, &s, sizeof s, sizeof s) ? ASCC_OK : ASCC_ERROR_ARGUMENT;
}

const ascc_step *ascc_ladder_step(const ascc_ladder *ladder, int32_t rung)
{
    return is_ladder(ladder) && rung >= 0 && rung < ladder->count ? ladder->rung[rung] : NULL;
}

uint64_t ascc_ladder_step_count(const ascc_ladder *ladder)
{
    uint64_t count = 0;
    for (int32_t r = 0; is_ladder(ladder) && r < ladder->count; r++)
        count += ladder->statistics.steps_on[r];
    return count;
}

ascc_status ascc_ladder_get_choices(const ascc_ladder *ladder, uint64_t first, size_t count,
                                    int32_t *rungs)
{
    if (!is_ladder(ladder) || (!rungs && count > 0))
        return ASCC_ERROR_ARGUMENT;
    const uint64_t steps = ascc_ladder_step_count(ladder);
    if (first > steps || count > steps - first)
        return ASCC_ERROR_ARGUMENT;
    for (size_t k = 0; k < ladder->change_count; k++) {
        const uint64_t begin = ladder->change[k].step;
        const uint64_t end = k + 1 < ladder->change_count ? ladder->change[k + 1].step : steps;
        for (uint64_t n = begin < first ? first : begin; n < end && n - first < count; n++)
            rungs[n - first] = ladder->change[k].rung;
    }
    return ASCC_OK;
}
