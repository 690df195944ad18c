/* A model file, or the demonstration model, as a method, run by libascc.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include <ascc/ascc.h>

#include "host.h"
#include "method.h"

typedef struct learned {
    const ascc_method_scene *scene;
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    ascc_particles *particles;
    double time_step; /* of the model */
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
    ascc_model_destroy(&m->model);
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

static bool learned_open(const char *settings, const ascc_method_scene *scene, void **state,
                         ascc_method_error *error)
{
    learned *m = calloc(1, sizeof *m);
    if (!m) {
        snprintf(error->text, sizeof error->text, "no memory");
        return false;
    }
    m->scene = scene;
    if (!learned_load(m, settings, error)) {
        learned_close(m);
        return false;
    }
    *state = m;
    return true;
}

enum { WALLS = 0, BODY = 1 };

static ascc_status add_walls(learned *m, size_t first, size_t end, int32_t body)
{
    const size_t d = (size_t)m->scene->dimension;
    const ascc_const_array wall = {.data = m->scene->wall + first * d, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = m->scene->normal + first * d, .scalar = ASCC_DOUBLE};
    if (first == end)
        return ASCC_OK;
    return ascc_particles_add_boundary(m->particles, end - first, &wall, &normal, body, NULL);
}

static ascc_status learned_fill(learned *m, const double *position, const double *velocity)
{
    const ascc_const_array x = {.data = position, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    const size_t body = m->scene->wall_count - m->scene->body_count;
    ascc_status status =
        ascc_particles_add_fluid(m->particles, m->scene->fluid_count, &x, &v, NULL, NULL);
    if (status == ASCC_OK)
        status = add_walls(m, 0, body, WALLS);
    if (status == ASCC_OK)
        status = add_walls(m, body, m->scene->wall_count, BODY);
    return status;
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
                                    .time_step = fabs(dt - m->time_step) > 1e-6 * dt ? dt : 0.0};
    (void)kind;
    ascc_particles_destroy(&m->particles);
    if (!m->step && ascc_step_create(m->context, m->model, &step, &m->step) != ASCC_OK)
        return context_failed(m, "step", error);
    if (ascc_particles_create(m->context, &particles, &m->particles) != ASCC_OK)
        return context_failed(m, "particles", error);
    if (learned_fill(m, position, velocity) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
    return false;
}

static bool learned_advance(void *state, ascc_method_error *error)
{
    learned *m = state;
    const ascc_forces forces = {.size = sizeof forces, .gravity = m->scene->gravity};
    if (ascc_step_run(m->step, m->particles, &forces, 1) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%s", ascc_step_message(m->step));
    return false;
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
    (void)ascc_step_get_statistics(m->step, &statistics);
    for (int c = 0; c < 3; c++) {
        external[c] = (double)statistics.external_impulse[c] * quantum;
        wall[c] = (double)statistics.wall_impulse[c] * quantum;
    }
}

/* Point by point: bodies of a few hundred points. */
static bool learned_move_body(void *state, const double by[3], ascc_method_error *error)
{
    learned *m = state;
    for (size_t i = m->scene->wall_count - m->scene->body_count; i < m->scene->wall_count; i++) {
        double x[3];
        const ascc_array read = {.data = x, .scalar = ASCC_DOUBLE};
        const ascc_const_array moved = {.data = x, .scalar = ASCC_DOUBLE};
        (void)ascc_particles_get(m->particles, ASCC_BOUNDARY, ASCC_POSITION, i, 1, &read);
        for (int c = 0; c < m->scene->dimension; c++)
            x[c] += by[c];
        if (ascc_particles_set(m->particles, ASCC_BOUNDARY, ASCC_POSITION, i, 1, &moved) !=
            ASCC_OK) {
            snprintf(error->text, sizeof error->text, "%s", ascc_particles_message(m->particles));
            return false;
        }
    }
    return true;
}

static void learned_body_impulse(const void *state, double impulse[3])
{
    const learned *m = state;
    const double quantum = ascc_particles_momentum_quantum(m->particles);
    int64_t quanta[3] = {0};
    (void)ascc_particles_body_impulse(m->particles, BODY, NULL, quanta, NULL);
    for (int c = 0; c < 3; c++)
        impulse[c] = (double)quanta[c] * quantum;
}

const ascc_method ascc_method_model = {
    .prefix = "",
    .help = "MODEL          a model by name (water3d) or file, or a published network; demo: the "
            "demonstration model",
    .open = learned_open,
    .set = learned_set,
    .advance = learned_advance,
    .read = learned_read,
    .impulses = learned_impulses,
    .move_body = learned_move_body,
    .body_impulse = learned_body_impulse,
    .close = learned_close,
};
