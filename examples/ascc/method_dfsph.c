/* The reference DFSPH solver as a method. SPDX-License-Identifier: MIT
 *
 *   dfsph:step=0.001,nu=0.002,density=1e-4,divergence=1e-3,iterations=100,courant=0.4
 *
 * step is the longest time step, s; its default is a twentieth of a frame, that of nu NU spacing^2 a frame. Walls
 * are the scene's own points, whatever their density; a body that the scene moves is one that the host drives.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph.h"
#include "method_walls.h"

#define NU 0.016 /* nearest to truth made with another viscosity, docs/reference.md */

typedef struct method_dfsph {
    const ascc_method_scene *scene;
    dfsph_options options;
    dfsph *solver;
    double *velocity;
    double wall_before[3], body_before[3]; /* impulses until the last frame */
    double wall_last[3], body_last[3];     /* of the last frame */
} method_dfsph;

static void method_dfsph_close(void *state)
{
    method_dfsph *m = state;
    dfsph_destroy(&m->solver);
    free(m->velocity);
    free(m);
}

static bool read_settings(method_dfsph *m, const char *settings, ascc_method_error *error)
{
    const ascc_method_scene *scene = m->scene;
    double iterations = 0.0;
    m->options = (dfsph_options){.dimension = scene->dimension,
                                 .thread_count = scene->threads,
                                 .spacing = scene->spacing,
                                 .rest_density = scene->rest_density,
                                 .time_step = scene->time_step / 20.0};
    dfsph_options *o = &m->options;
    o->viscosity = NU * scene->spacing * scene->spacing / scene->time_step;
    o->volume = scene->mass / (scene->rest_density * pow(scene->spacing, scene->dimension));
    memcpy(o->gravity, scene->gravity, sizeof o->gravity);
    const ascc_method_setting known[] = {{"step", &o->time_step},
                                         {"courant", &o->courant},
                                         {"nu", &o->viscosity},
                                         {"density", &o->density_error},
                                         {"divergence", &o->divergence_error},
                                         {"iterations", &iterations},
                                         {NULL, NULL}};
    if (!ascc_method_settings(settings, known, error))
        return false;
    snprintf(error->text, sizeof error->text,
             "step, courant, density: above 0; nu: not below; iterations: 0 to 10000");
    o->iterations = (int32_t)fmin(iterations, 10000.0);
    return o->time_step > 0.0 && o->courant >= 0.0 && o->density_error >= 0.0 &&
           iterations >= 0.0 && iterations <= 10000.0;
}

/* Walls that stand still, and the scene's body as one that is driven. */
static bool place_walls(method_dfsph *m)
{
    const ascc_method_scene *scene = m->scene;
    const size_t still = scene->wall_count - scene->body_count;
    rigid body = {.kind = RIGID_DRIVEN};
    memcpy(body.center, scene->body_center, sizeof body.center);
    return dfsph_set_walls(m->solver, still, scene->wall) == ASCC_OK &&
           (scene->body_count == 0 ||
            dfsph_add_body(m->solver, scene->body_count,
                           scene->wall + still * (size_t)scene->dimension, &body) == ASCC_OK);
}

static bool method_dfsph_open(const char *settings, const ascc_method_scene *scene, void **state,
                              ascc_method_error *error)
{
    method_dfsph *m = calloc(1, sizeof *m);
    if (!m)
        return false;
    m->scene = scene;
    m->velocity = malloc((scene->fluid_count + 1) * (size_t)scene->dimension * sizeof *m->velocity);
    if (!m->velocity || !read_settings(m, settings, error)) {
        method_dfsph_close(m);
        return false;
    }
    m->solver = dfsph_create(&m->options);
    if (!m->solver || !place_walls(m)) {
        snprintf(error->text, sizeof error->text, "%.200s",
                 m->solver ? dfsph_message(m->solver) : "settings out of range, or no memory");
        method_dfsph_close(m);
        return false;
    }
    *state = m;
    return true;
}

/* A difference is the mean of a frame's steps, and the last of them is half a frame less half a step on. */
static bool method_dfsph_set(void *state, const double *position, const double *velocity,
                             ascc_velocity_kind kind, ascc_method_error *error)
{
    method_dfsph *m = state;
    const ascc_method_scene *scene = m->scene;
    const size_t d = (size_t)scene->dimension;
    const double behind = 0.5 * (scene->time_step - fmin(scene->time_step, m->options.time_step));
    for (size_t i = 0; i < scene->fluid_count * d; i++)
        m->velocity[i] =
            velocity[i] + (kind == ASCC_VELOCITY_DIFFERENCE ? behind : 0.0) * scene->gravity[i % d];
    if (place_walls(m) &&
        dfsph_set_fluid(m->solver, scene->fluid_count, position, m->velocity) == ASCC_OK) {
        memset(m->wall_before, 0, sizeof m->wall_before);
        memset(m->body_before, 0, sizeof m->body_before);
        return true;
    }
    snprintf(error->text, sizeof error->text, "%.200s", dfsph_message(m->solver));
    return false;
}

static void since(const double *now, double before[3], double last[3])
{
    for (int c = 0; c < 3; c++) {
        last[c] = now[c] - before[c];
        before[c] = now[c];
    }
}

static bool method_dfsph_advance(void *state, ascc_method_error *error)
{
    method_dfsph *m = state;
    const double still[3] = {0};
    if (dfsph_advance(m->solver, m->scene->time_step) != ASCC_OK) {
        snprintf(error->text, sizeof error->text, "%.200s", dfsph_message(m->solver));
        return false;
    }
    since(dfsph_wall_impulse(m->solver), m->wall_before, m->wall_last);
    if (m->scene->body_count) {
        since(dfsph_body(m->solver, 0)->impulse, m->body_before, m->body_last);
        dfsph_drive_body(m->solver, 0, still, still);
    }
    return true;
}

static void method_dfsph_read(const void *state, double *position, double *velocity)
{
    const method_dfsph *m = state;
    const size_t d = (size_t)m->scene->dimension;
    const double(*x)[3] = dfsph_positions(m->solver);
    const double(*v)[3] = dfsph_velocities(m->solver);
    for (size_t i = 0; i < m->scene->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            position[i * d + c] = x[i][c];
            velocity[i * d + c] = v[i][c];
        }
}

static void method_dfsph_impulses(const void *state, double external[3], double wall[3])
{
    const method_dfsph *m = state;
    const double mass = dfsph_mass(m->solver) * (double)m->scene->fluid_count;
    for (int c = 0; c < 3; c++) {
        external[c] = mass * m->scene->time_step * m->scene->gravity[c];
        wall[c] = m->wall_last[c] + m->body_last[c];
    }
}

static bool method_dfsph_drive_body(void *state, const double velocity[3], const double spin[3],
                                    ascc_method_error *error)
{
    const method_dfsph *m = state;
    (void)error;
    dfsph_drive_body(m->solver, 0, velocity, spin);
    return true;
}

static void method_dfsph_body_impulse(const void *state, double impulse[3])
{
    memcpy(impulse, ((const method_dfsph *)state)->body_last, 3 * sizeof *impulse);
}

/* All fluid anew, which begins without a pressure to start from. */
static bool method_dfsph_add_fluid(void *state, size_t count, const double *position,
                                   const double *velocity, ascc_method_error *error)
{
    method_dfsph *m = state;
    const size_t d = (size_t)m->scene->dimension, before = m->scene->fluid_count;
    const size_t all = before + count;
    double *x = malloc((all * d + 1) * sizeof *x), *v = malloc((all * d + 1) * sizeof *v);
    bool good = x && v;
    snprintf(error->text, sizeof error->text, "no memory for %zu particles", all);
    if (good) {
        method_dfsph_read(m, x, v);
        memcpy(x + before * d, position, count * d * sizeof *x);
        memcpy(v + before * d, velocity, count * d * sizeof *v);
        good = dfsph_set_fluid(m->solver, all, x, v) == ASCC_OK;
        memset(m->wall_before, 0, sizeof m->wall_before);
    }
    free(x);
    if (!good) {
        free(v);
        return false;
    }
    free(m->velocity); /* as large as what may be set */
    m->velocity = v;
    return true;
}

const ascc_method ascc_method_dfsph = {
    .prefix = "dfsph:",
    .help = "dfsph:SETTINGS reference DFSPH: step=, courant=, nu=, density=, divergence=, "
            "iterations=",
    .open = method_dfsph_open,
    .set = method_dfsph_set,
    .advance = method_dfsph_advance,
    .read = method_dfsph_read,
    .impulses = method_dfsph_impulses,
    .drive_body = method_dfsph_drive_body,
    .body_impulse = method_dfsph_body_impulse,
    .add_fluid = method_dfsph_add_fluid,
    .close = method_dfsph_close,
};
