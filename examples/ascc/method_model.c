/* A model file, or the demonstration model, as a method, run by libascc.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/ascc.h>

#include "host.h"
#include "method.h"

enum { RUNGS = 2 };
#define BELOW (1.0 / 3.0) /* what a particle costs there */

typedef struct learned {
    const ascc_method_scene *scene;
    ascc_context *context;
    ascc_model *model;
    ascc_step *step; /* or, with a model below: */
    ascc_model *below;
    ascc_ladder *ladder;
    double work,
        seen[RUNGS]; /* what the ladder's clock counts, and the rungs' own times when it last looked */
    ascc_particles *particles;
    double time_step; /* of the model */
    int32_t body;     /* of the scene's body, which has a frame of its own */
    bool driven;      /* for the next frame */
} learned;

static bool context_failed(const learned *m, const char *what, ascc_method_error *error)
{
    char line[256] = "";
    if (m->context)
        (void)ascc_context_message(m->context, line, sizeof line);
    snprintf(error->text, sizeof error->text, "%s: %.220s", what, line);
    return false;
}

static void learned_close(void *state)
{
    learned *m = state;
    ascc_particles_destroy(&m->particles);
    ascc_step_destroy(&m->step);
    ascc_ladder_destroy(&m->ladder);
    ascc_model_destroy(&m->model);
    ascc_model_destroy(&m->below);
    ascc_context_destroy(&m->context);
    free(m);
}

static bool learned_load(learned *m, const char *path, ascc_method_error *error)
{
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = m->scene->threads};
    ascc_model_info info = {.size = sizeof info};
    ascc_host_error why;
    if (ascc_context_create(&options, &m->context) != ASCC_OK)
        return context_failed(m, "model", error);
    if (ascc_host_model(m->context, path, m->scene->dimension, m->scene->spacing, &m->model,
                        &why) != ASCC_OK) {
        snprintf(error->text, sizeof error->text, "model: %.220s", why.text);
        return false;
    }
    (void)ascc_model_get_info(m->model, &info);
    if (info.dimension != m->scene->dimension) {
        snprintf(error->text, sizeof error->text, "a model for %dD, a scene in %dD",
                 (int)info.dimension, (int)m->scene->dimension);
        return false;
    }
    m->time_step = info.time_step;
    return true;
}

/* The model below: in the folder of the model's own file, or by name. */
static bool load_below(learned *m, const char *path, ascc_method_error *error)
{
    const char *slash = strrchr(path, '/'), *name = m->scene->below;
    const int folder = slash ? (int)(slash + 1 - path) : 0;
    ascc_host_error why;
    char beside[ASCC_HOST_PATH];
    snprintf(beside, sizeof beside, "%.*s%s.safetensors", folder, path, name);
    if (ascc_host_load(m->context, beside, &m->below, &why) == ASCC_OK ||
        ascc_host_load(m->context, name, &m->below, &why) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "model below: %.220s", why.text);
    return false;
}

static bool learned_open(const char *settings, const ascc_method_scene *scene, void **state,
                         ascc_method_error *error)
{
    learned *m = calloc(1, sizeof *m);
    if (!m) {
        snprintf(error->text, sizeof error->text, "no memory");
        return false;
    }
    m->scene = scene;
    if (!learned_load(m, settings, error) || (scene->below && !load_below(m, settings, error))) {
        learned_close(m);
        return false;
    }
    *state = m;
    return true;
}

enum { WALLS = 0 };

static ascc_status add_fluid(learned *m, size_t count, const double *position,
                             const double *velocity)
{
    const ascc_const_array x = {.data = position, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    return ascc_particles_add_fluid(m->particles, count, &x, &v, NULL, NULL);
}

static ascc_status add_walls(learned *m, size_t count)
{
    const ascc_const_array wall = {.data = m->scene->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = m->scene->normal, .scalar = ASCC_DOUBLE};
    return count ? ascc_particles_add_boundary(m->particles, count, &wall, &normal, WALLS, NULL)
                 : ASCC_OK;
}

/* The scene's last wall points, about its centre. */
static ascc_status add_body(learned *m, size_t first)
{
    const ascc_method_scene *scene = m->scene;
    const size_t d = (size_t)scene->dimension, count = scene->wall_count - first;
    double *own = malloc((count * d + 1) * sizeof *own);
    if (!own)
        return ASCC_ERROR_MEMORY;
    for (size_t k = 0; k < count * d; k++)
        own[k] = scene->wall[first * d + k] - scene->body_center[k % d];
    const ascc_const_array position = {.data = own, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = scene->normal + first * d, .scalar = ASCC_DOUBLE};
    const ascc_shape shape = {.size = sizeof shape,
                              .kind = ASCC_SHAPE_POINTS,
                              .count = count,
                              .position = &position,
                              .normal = &normal};
    ascc_pose pose = {.size = sizeof pose};
    memcpy(pose.position, scene->body_center, d * sizeof *pose.position);
    const ascc_status status = ascc_body_add(m->particles, &shape, &pose, &m->body);
    free(own);
    return status;
}

static ascc_status learned_fill(learned *m, const double *position, const double *velocity)
{
    const size_t body = m->scene->wall_count - m->scene->body_count;
    ascc_status status = add_fluid(m, m->scene->fluid_count, position, velocity);
    if (status == ASCC_OK)
        status = add_walls(m, body);
    if (status == ASCC_OK && m->scene->body_count)
        status = add_body(m, body);
    return status;
}

/* The step that ran last. */
static const ascc_step *step_of(const learned *m)
{
    ascc_ladder_statistics told = {.size = sizeof told};
    if (!m->ladder)
        return m->step;
    (void)ascc_ladder_get_statistics(m->ladder, &told);
    return ascc_ladder_step(m->ladder, told.rung);
}

/* Counts particles that were stepped, so that choices are the same on every machine: a rung whose own time has gone
 * on has run. */
static double count_work(void *user)
{
    learned *m = user;
    for (int32_t r = 0; r < RUNGS && m->ladder; r++) {
        ascc_step_statistics told = {.size = sizeof told};
        (void)ascc_step_get_statistics(ascc_ladder_step(m->ladder, r), &told);
        if (told.seconds_total != m->seen[r] && told.steps > 0)
            m->work += (r ? 1.0 : BELOW) * (double)m->scene->fluid_count;
        m->seen[r] = told.seconds_total;
    }
    return m->work;
}

static ascc_status make_step(learned *m, const ascc_step_options *options)
{
    const ascc_model *models[RUNGS] = {m->below, m->model};
    const ascc_ladder_options ladder = {
        .size = sizeof ladder, .clock = count_work, .user = m, .step = options};
    return m->below ? ascc_ladder_create(m->context, RUNGS, models, &ladder, &m->ladder)
                    : ascc_step_create(m->context, m->model, options, &m->step);
}

/* Everything anew, so that nothing of an earlier start can reach this one. */
static bool learned_set(void *state, const double *position, const double *velocity,
                        ascc_velocity_kind kind, ascc_method_error *error)
{
    learned *m = state;
    const double dt = m->scene->time_step;
    const ascc_particles_options particles = {.size = sizeof particles,
                                              .dimension = m->scene->dimension,
                                              .spacing = m->scene->spacing,
                                              .mass = m->scene->mass};
    const ascc_step_options step = {.size = sizeof step,
                                    .time_step = fabs(dt - m->time_step) > 1e-6 * dt ? dt : 0.0,
                                    .sleep_speed = m->scene->sleep_speed};
    (void)kind;
    m->driven = false;
    ascc_particles_destroy(&m->particles);
    if (!m->step && !m->ladder && make_step(m, &step) != ASCC_OK)
        return context_failed(m, "step", error);
    if (ascc_particles_create(m->context, &particles, &m->particles) != ASCC_OK)
        return context_failed(m, "particles", error);
    if (learned_fill(m, position, velocity) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return false;
}

static bool move_body(learned *m, const double velocity[3], const double spin[3],
                      ascc_method_error *error)
{
    ascc_body_info now = {.size = sizeof now};
    ascc_pose pose = {.size = sizeof pose};
    const size_t d = (size_t)m->scene->dimension;
    ascc_status status = ascc_body_get(m->particles, m->body, &now);
    memcpy(pose.position, now.position, sizeof pose.position);
    memcpy(pose.rotation, now.rotation, sizeof pose.rotation);
    pose.angle = now.angle;
    if (d == 2)
        memset(pose.rotation, 0, sizeof pose.rotation);
    memcpy(pose.velocity, velocity, d * sizeof *pose.velocity);
    memcpy(pose.spin, spin, sizeof pose.spin);
    if (status == ASCC_OK)
        status = ascc_body_move(m->particles, m->body, &pose);
    if (status != ASCC_OK)
        snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return status == ASCC_OK;
}

static bool learned_look_back(void *state, size_t ago, const double *velocity,
                              ascc_method_error *error)
{
    const learned *m = state;
    const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    const ascc_field field = (ascc_field)(ASCC_EARLIER_VELOCITY + (int)ago);
    if (ascc_particles_set(m->particles, ASCC_FLUID, field, 0, m->scene->fluid_count, &v) ==
        ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return false;
}

static bool learned_advance(void *state, ascc_method_error *error)
{
    learned *m = state;
    const double still[3] = {0.0, 0.0, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = m->scene->gravity};
    const ascc_status status = m->ladder ? ascc_ladder_run(m->ladder, m->particles, &forces, 1)
                                         : ascc_step_run(m->step, m->particles, &forces, 1);
    if (status != ASCC_OK) {
        snprintf(error->text, sizeof error->text, "%s",
                 m->ladder ? ascc_ladder_message(m->ladder) : ascc_step_message(m->step));
        return false;
    }
    const bool stops = m->driven;
    m->driven = false;
    return !stops || move_body(m, still, still, error);
}

static void learned_read(const void *state, double *position, double *velocity)
{
    const learned *m = state;
    const ascc_array x = {.data = position, .scalar = ASCC_DOUBLE};
    const ascc_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    (void)ascc_particles_get(m->particles, ASCC_FLUID, ASCC_POSITION, 0, m->scene->fluid_count, &x);
    (void)ascc_particles_get(m->particles, ASCC_FLUID, ASCC_VELOCITY, 0, m->scene->fluid_count, &v);
}

static void learned_impulses(const void *state, double external[3], double wall[3])
{
    const learned *m = state;
    const double quantum = ascc_particles_momentum_quantum(m->particles);
    ascc_step_statistics statistics = {.size = sizeof statistics};
    (void)ascc_step_get_statistics(step_of(m), &statistics);
    for (int c = 0; c < 3; c++) {
        external[c] = (double)statistics.external_impulse[c] * quantum;
        wall[c] = (double)statistics.wall_impulse[c] * quantum;
    }
}

static bool learned_drive_body(void *state, const double velocity[3], const double spin[3],
                               ascc_method_error *error)
{
    learned *m = state;
    m->driven = true;
    return move_body(m, velocity, spin, error);
}

static void learned_body_impulse(const void *state, double impulse[3])
{
    const learned *m = state;
    const double quantum = ascc_particles_momentum_quantum(m->particles);
    int64_t quanta[1][3] = {{0}};
    (void)ascc_bodies_impulse(m->particles, 1, &m->body, quanta, NULL);
    for (int c = 0; c < 3; c++)
        impulse[c] = (double)quanta[0][c] * quantum;
}

static size_t learned_asleep(const void *state)
{
    const learned *m = state;
    ascc_step_statistics told = {.size = sizeof told};
    return ascc_step_get_statistics(step_of(m), &told) == ASCC_OK ? (size_t)told.asleep : 0;
}

static bool learned_add_fluid(void *state, size_t count, const double *position,
                              const double *velocity, ascc_method_error *error)
{
    learned *m = state;
    if (add_fluid(m, count, position, velocity) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return false;
}

static bool learned_set_budget(void *state, double particles, ascc_method_error *error)
{
    learned *m = state;
    if (ascc_ladder_set_budget(m->ladder, particles) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_ladder_message(m->ladder));
    return false;
}

static void learned_choices(const void *state, ascc_method_choices *choices)
{
    const learned *m = state;
    ascc_ladder_statistics told = {.size = sizeof told};
    (void)ascc_ladder_get_statistics(m->ladder, &told);
    *choices = (ascc_method_choices){told.rung == 0, told.changes, told.late};
}

static bool learned_set_detail(void *state, const double *weight, ascc_method_error *error)
{
    learned *m = state;
    const ascc_const_array rows = {.data = weight, .scalar = ASCC_DOUBLE};
    if (ascc_particles_set(m->particles, ASCC_FLUID, ASCC_DETAIL, 0, m->scene->fluid_count,
                           &rows) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return false;
}

const ascc_method ascc_method_model = {
    .prefix = "",
    .help = "MODEL          a model by name (water3d) or file, or a published network; demo: the "
            "demonstration model",
    .open = learned_open,
    .set = learned_set,
    .look_back = learned_look_back,
    .advance = learned_advance,
    .read = learned_read,
    .impulses = learned_impulses,
    .drive_body = learned_drive_body,
    .body_impulse = learned_body_impulse,
    .add_fluid = learned_add_fluid,
    .asleep = learned_asleep,
    .set_budget = learned_set_budget,
    .choices = learned_choices,
    .set_detail = learned_set_detail,
    .close = learned_close,
};
