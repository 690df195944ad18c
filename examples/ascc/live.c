/* What `ascc view` shows: a model that runs, or a sequence that is played; stopped, restarted, and stirred
 * with a ball. SPDX-License-Identifier: MIT */
#include "live.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "ball.h"
#include "host.h"
#include "measures.h"
#include "scenes.h"

#define WALL_SPACING                                                                               \
    0.64             /* of the ball's points, in particle spacings: that of the built-in scenes */
#define FASTEST 0.25 /* spacings a step that the ball moves at most */
#define SMOOTH 0.1   /* share of a new step in the times shown */

static bool fail(ascc_live *live, const char *what, const char *why)
{
    (void)snprintf(live->error, sizeof live->error, "%s%s%s", what, *what ? ": " : "", why);
    return false;
}

static size_t dimension(const ascc_live *live)
{
    return (size_t)live->scene.dimension;
}

static double spacing(const ascc_live *live)
{
    return 2.0 * live->scene.radius;
}

/* ---- What is shown ---- */

static bool find_density(ascc_live *live)
{
    const size_t n = live->count * dimension(live);
    double *x = malloc((n + 1) * sizeof *x), *density = malloc((live->count + 1) * sizeof *density);
    for (size_t k = 0; x && k < n; k++)
        x[k] = (double)live->position[k];
    const ascc_measure_set set = {
        .dimension = live->scene.dimension, .count = live->count, .position = x};
    const ascc_status status = x && density
                                   ? ascc_measure_density(&set, 0, NULL, 2.0 * spacing(live),
                                                          live->options.threads, density)
                                   : ASCC_ERROR_MEMORY;
    const double rest = ascc_measure_rest_density(live->scene.dimension);
    for (size_t i = 0; status == ASCC_OK && i < live->count; i++)
        live->value[i] = (float)(density[i] / rest);
    free(x);
    free(density);
    return status == ASCC_OK || fail(live, "density", ascc_status_text(status));
}

static bool find_values(ascc_live *live)
{
    if (live->density)
        return find_density(live);
    ascc_speeds(live->scene.dimension, live->count, live->velocity, live->value);
    return true;
}

static bool read_run(ascc_live *live)
{
    const ascc_array x = {.data = live->position}, v = {.data = live->velocity};
    return (ascc_particles_get(live->particles, ASCC_FLUID, ASCC_POSITION, 0, live->count, &x) ==
                ASCC_OK &&
            ascc_particles_get(live->particles, ASCC_FLUID, ASCC_VELOCITY, 0, live->count, &v) ==
                ASCC_OK &&
            find_values(live)) ||
           (!live->error[0] && fail(live, "", "the particles cannot be read"));
}

static bool read_frame(ascc_live *live)
{
    const size_t n = live->count * dimension(live);
    memcpy(live->position, live->scene.position + live->step * n, n * sizeof *live->position);
    ascc_sequence_velocities(&live->scene, live->step, live->velocity);
    live->time = (double)live->step * live->scene.time_step;
    return find_values(live);
}

static bool read_state(ascc_live *live)
{
    return live->options.models ? read_run(live) : read_frame(live);
}

ascc_marks ascc_live_marks(const ascc_live *live)
{
    return (ascc_marks){.count = live->count,
                        .position = live->position,
                        .value = live->value,
                        .low = live->density ? 0.5 : 0.0,
                        .high = live->density ? 1.5 : live->view.fastest,
                        .unit = live->density ? "of rest density" : "m/s",
                        .body_count = live->ball.there ? live->ball.count : 0,
                        .body = live->ball.position};
}

/* ---- The ball ---- */

static void place_ball(ascc_live *live)
{
    ascc_live_ball *ball = &live->ball;
    const size_t d = dimension(live);
    for (size_t k = 0; k < ball->count * d; k++)
        ball->position[k] = (float)(ball->center[k % d] + (double)ball->around[k]);
}

/* Squared distance from a point to the nearest of others, or `nearest` if that is less. */
static double near_square(const double x[3], const float *points, size_t count, size_t d,
                          double nearest)
{
    for (size_t i = 0; i < count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += pow(x[c] - (double)points[i * d + c], 2.0);
        nearest = fmin(nearest, square);
    }
    return nearest;
}

/* Of a lattice of places in the box, the one with most room around. False if the ball fits in none. */
static bool find_room(ascc_live *live)
{
    enum { PLACES = 13 }; /* odd: one in the middle */
    const size_t d = dimension(live);
    const ascc_view *v = &live->view;
    double best = pow(live->ball.radius + 0.9 * spacing(live), 2.0);
    bool found = false;
    for (int k = 0; k < PLACES * PLACES * (d == 3 ? PLACES : 1); k++) {
        const int at[3] = {k % PLACES, k / PLACES % PLACES, k / PLACES / PLACES};
        double x[3] = {0.0, 0.0, 0.0}, room = INFINITY;
        for (size_t c = 0; c < d; c++)
            x[c] = v->low[c] + (v->high[c] - v->low[c]) * (at[c] + 0.5) / PLACES;
        room = near_square(x, live->position, live->count, d, room);
        if (room > best)
            room = near_square(x, live->scene.wall, live->scene.walls, d, room);
        if (room <= best)
            continue;
        best = room;
        found = true;
        memcpy(live->ball.center, x, sizeof x);
    }
    return found;
}

/* Four spacings, less where the box is narrow. */
static double fitting_radius(const ascc_live *live)
{
    double narrowest = INFINITY;
    for (size_t c = 0; c < dimension(live); c++)
        narrowest = fmin(narrowest, live->view.high[c] - live->view.low[c]);
    return fmin(4.0 * spacing(live), 0.3 * narrowest);
}

static bool make_ball(ascc_live *live)
{
    ascc_live_ball *ball = &live->ball;
    if (ball->position)
        return true;
    ball->radius = live->options.ball > 0.0 ? live->options.ball : fitting_radius(live);
    ball->count = ascc_ball_points(live->scene.dimension, ball->radius,
                                   WALL_SPACING * spacing(live), &ball->normal);
    const size_t n = ball->count * dimension(live);
    ball->around = malloc((n + 1) * sizeof *ball->around);
    ball->position = malloc((n + 1) * sizeof *ball->position);
    if (!ball->normal || !ball->around || !ball->position)
        return fail(live, "", "no memory for the ball");
    for (size_t k = 0; k < n; k++)
        ball->around[k] = (float)(ball->radius * (double)ball->normal[k]);
    return true;
}

static bool add_ball(ascc_live *live)
{
    place_ball(live);
    const ascc_const_array x = {.data = live->ball.position}, n = {.data = live->ball.normal};
    if (ascc_particles_add_boundary(live->particles, live->ball.count, &x, &n, 1, NULL) != ASCC_OK)
        return fail(live, "the ball", ascc_particles_message(live->particles));
    memcpy(live->ball.target, live->ball.center, sizeof live->ball.target);
    return live->ball.there = true;
}

static bool remove_ball(ascc_live *live)
{
    uint64_t *ids = malloc((live->ball.count + 1) * sizeof *ids);
    const bool good = ids &&
                      ascc_particles_get_ids(live->particles, ASCC_BOUNDARY, live->scene.walls,
                                             live->ball.count, ids) == ASCC_OK &&
                      ascc_particles_remove(live->particles, live->ball.count, ids) == ASCC_OK;
    free(ids);
    live->ball.there = !good;
    return good || fail(live, "the ball", "it cannot be taken away");
}

bool ascc_live_toggle_ball(ascc_live *live)
{
    live->error[0] = '\0';
    if (!live->options.models)
        return fail(live, "", "a sequence that is played cannot be stirred");
    if (live->ball.there)
        return remove_ball(live);
    if (!make_ball(live))
        return false;
    return find_room(live) ? add_ball(live) : fail(live, "", "no room for the ball");
}

void ascc_live_pull(ascc_live *live, const double target[3])
{
    for (size_t c = 0; c < dimension(live); c++) {
        const double room = live->ball.radius + 0.5 * spacing(live);
        const double low = live->view.low[c] + room, high = live->view.high[c] - room;
        live->ball.target[c] = low < high ? fmin(fmax(target[c], low), high) : live->ball.center[c];
    }
}

/* How far the ball goes in the next step: towards where it is wanted. */
static void find_way(const ascc_live *live, double way[3])
{
    double length = 0.0;
    for (size_t c = 0; c < dimension(live); c++) {
        way[c] = live->ball.target[c] - live->ball.center[c];
        length += way[c] * way[c];
    }
    const double share = fmin(1.0, FASTEST * spacing(live) / (sqrt(length) + 1e-12));
    for (size_t c = 0; c < dimension(live); c++)
        way[c] *= share;
}

/* One velocity for all its points, by which the step moves them. */
static bool set_ball(ascc_live *live, const double way[3])
{
    const ascc_live_ball *ball = &live->ball;
    const size_t d = dimension(live);
    float *velocity = malloc((ball->count * d + 1) * sizeof *velocity);
    for (size_t k = 0; velocity && k < ball->count * d; k++)
        velocity[k] = (float)(way[k % d] / live->time_step[live->model]);
    const ascc_const_array x = {.data = ball->position}, v = {.data = velocity};
    const bool good = velocity &&
                      ascc_particles_set(live->particles, ASCC_BOUNDARY, ASCC_POSITION,
                                         live->scene.walls, ball->count, &x) == ASCC_OK &&
                      ascc_particles_set(live->particles, ASCC_BOUNDARY, ASCC_VELOCITY,
                                         live->scene.walls, ball->count, &v) == ASCC_OK;
    free(velocity);
    return good || fail(live, "the ball", "it cannot be moved");
}

/* ---- The run ---- */

bool ascc_live_restart(ascc_live *live)
{
    ascc_particles *fresh = NULL;
    live->error[0] = '\0';
    if (live->options.models &&
        ascc_host_particles(live->context, &live->scene, live->scene.position, live->scene.velocity,
                            &fresh) != ASCC_OK)
        return fail(live, "", "the scene cannot be set up");
    ascc_particles_destroy(&live->particles);
    live->particles = fresh;
    live->step = 0;
    live->time = 0.0;
    const bool ball = live->ball.there;
    live->ball.there = false;
    return read_state(live) && (!ball || ascc_live_toggle_ball(live));
}

/* Times of the last step, mixed into those shown. */
static void count_time(ascc_live *live)
{
    ascc_step_statistics t = {.size = sizeof t};
    (void)ascc_step_get_statistics(live->stepper[live->model], &t);
    const bool first = live->stages != (size_t)t.stage_count + 1;
    live->stages = (size_t)t.stage_count + 1;
    for (size_t i = 0; i < live->stages; i++) {
        const bool total = i + 1 == live->stages;
        const double seconds = total ? t.seconds_total : t.stage[i].seconds;
        live->stage[i].name = total ? "total" : t.stage[i].name;
        live->stage[i].seconds =
            first ? seconds : (1.0 - SMOOTH) * live->stage[i].seconds + SMOOTH * seconds;
    }
}

bool ascc_live_advance(ascc_live *live)
{
    live->error[0] = '\0';
    if (!live->options.models) {
        if (live->step + 1 >= live->scene.frames)
            return false;
        live->step++;
        return read_state(live);
    }
    const ascc_forces forces = {.size = sizeof forces, .gravity = live->scene.gravity};
    ascc_step *step = live->stepper[live->model];
    double way[3] = {0.0, 0.0, 0.0};
    if (live->ball.there)
        find_way(live, way);
    if (live->ball.there && !set_ball(live, way))
        return false;
    if (ascc_step_run(step, live->particles, &forces, 1) != ASCC_OK)
        return fail(live, "", ascc_step_message(step));
    for (size_t c = 0; c < 3; c++)
        live->ball.center[c] += way[c];
    if (live->ball.there)
        place_ball(live);
    live->step++;
    live->time += live->time_step[live->model];
    count_time(live);
    return read_state(live);
}

bool ascc_live_back(ascc_live *live)
{
    live->error[0] = '\0';
    if (live->options.models)
        return fail(live, "", "a run does not go back: restart it");
    live->step -= live->step > 0;
    return read_state(live);
}

bool ascc_live_switch(ascc_live *live)
{
    live->error[0] = '\0';
    if (live->options.models < 2)
        return fail(live, "", "there is no other model: --model adds some");
    live->model = (live->model + 1) % live->options.models;
    live->stages = 0;
    return true;
}

bool ascc_live_toggle_density(ascc_live *live)
{
    live->error[0] = '\0';
    live->density = !live->density;
    return find_values(live);
}

/* ---- From options to a scene ---- */

/* A model and its step; the first says what spacing a built-in scene has. */
static bool load_model(ascc_live *live, size_t i)
{
    const char *name = live->options.model[i];
    const bool demo = strcmp(name, "demo") == 0;
    ascc_model_info info = {.size = sizeof info, .particle_spacing = 0.05};
    ascc_host_error why = {""};
    ascc_status status = ASCC_OK;
    if (!demo)
        status = ascc_host_load(live->context, name, &live->loaded[i], &why);
    if (status == ASCC_OK && !demo)
        status = ascc_model_get_info(live->loaded[i], &info);
    const double space =
        live->options.spacing > 0.0 ? live->options.spacing : info.particle_spacing;
    if (status == ASCC_OK && i == 0 &&
        !ascc_scene_load(live->options.scene, live->options.size, space, &live->scene, live->error,
                         sizeof live->error))
        return false;
    if (status == ASCC_OK && demo)
        status = ascc_host_model(live->context, name, live->scene.dimension, spacing(live),
                                 &live->loaded[i], &why);
    if (status == ASCC_OK && demo)
        status = ascc_model_get_info(live->loaded[i], &info);
    if (status != ASCC_OK)
        return fail(live, name, why.text[0] ? why.text : ascc_status_text(status));
    if (info.dimension != live->scene.dimension) {
        (void)snprintf(live->error, sizeof live->error, "%s is a model in %dD, %s a scene in %dD",
                       name, info.dimension, live->options.scene, live->scene.dimension);
        return false;
    }
    live->time_step[i] = info.time_step;
    status = ascc_step_create(live->context, live->loaded[i], NULL, &live->stepper[i]);
    return status == ASCC_OK || fail(live, name, ascc_status_text(status));
}

static bool open_run(ascc_live *live)
{
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = live->options.threads};
    if (ascc_context_create(&options, &live->context) != ASCC_OK)
        return fail(live, "", "no memory");
    for (size_t i = 0; i < live->options.models; i++)
        if (!load_model(live, i))
            return false;
    return true;
}

bool ascc_live_open(ascc_live *live, const ascc_live_options *options)
{
    *live = (ascc_live){.options = *options};
    const bool good = options->models ? open_run(live)
                                      : ascc_sequence_read(options->scene, &live->scene,
                                                           live->error, sizeof live->error);
    if (!good)
        return false;
    live->count = live->scene.count;
    const size_t n = live->count * dimension(live) + 1;
    live->position = malloc(n * sizeof *live->position);
    live->velocity = malloc(n * sizeof *live->velocity);
    live->value = malloc((live->count + 1) * sizeof *live->value);
    if (!live->position || !live->velocity || !live->value)
        return fail(live, "", "no memory for the particles");
    if (live->count == 0)
        return fail(live, options->scene, "there is no fluid");
    live->view = ascc_view_of(&live->scene);
    return ascc_live_restart(live);
}

void ascc_live_close(ascc_live *live)
{
    for (size_t i = 0; i < ASCC_LIVE_MODELS; i++) {
        ascc_step_destroy(&live->stepper[i]);
        ascc_model_destroy(&live->loaded[i]);
    }
    ascc_particles_destroy(&live->particles);
    ascc_context_destroy(&live->context);
    ascc_sequence_free(&live->scene);
    free(live->position);
    free(live->velocity);
    free(live->value);
    free(live->ball.around);
    free(live->ball.normal);
    free(live->ball.position);
    *live = (ascc_live){.options = live->options};
}
