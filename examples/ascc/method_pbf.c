/* Position based fluids as a method. SPDX-License-Identifier: MIT
 *
 *   pbf:iterations=4,substeps=1
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>

#include "method_walls.h"
#include "pbf.h"

enum { LAYERS = 2 /* the support reaches two spacings */ };

typedef struct method_pbf {
    const ascc_method_scene *scene;
    pbf *solver;
    double *wall, *velocity;
    size_t wall_count;
    double spacing; /* m */
    double lag;     /* s, by which velocities that are differences are behind */
} method_pbf;

static void method_pbf_close(void *state)
{
    method_pbf *m = state;
    pbf_destroy(&m->solver);
    free(m->wall);
    free(m->velocity);
    free(m);
}

static bool make_solver(method_pbf *m, const char *settings, ascc_method_error *error)
{
    const ascc_method_scene *scene = m->scene;
    pbf_options options = {.dimension = scene->dimension,
                           .thread_count = scene->threads,
                           .spacing = ascc_method_spacing(scene)};
    double iterations = 4.0, substeps = 1.0;
    const ascc_method_setting known[] = {{"iterations", &iterations},
                                         {"substeps", &substeps},
                                         {"relaxation", &options.relaxation},
                                         {"tension", &options.tension},
                                         {"viscosity", &options.viscosity},
                                         {"spacing", &options.spacing},
                                         {NULL, NULL}};
    for (int c = 0; c < scene->dimension; c++)
        options.gravity[c] = scene->gravity[c];
    if (!ascc_method_settings(settings, known, error))
        return false;
    if (!(iterations >= 1.0 && iterations <= 1000.0 && substeps >= 1.0 && substeps <= 1000.0)) {
        snprintf(error->text, sizeof error->text, "iterations and substeps: 1 to 1000");
        return false;
    }
    options.iterations = (int32_t)iterations;
    options.substeps = (int32_t)substeps;
    /* Velocities are differences over a substep, those of a frame over a whole one. */
    m->lag = 0.5 * scene->time_step * (1.0 - 1.0 / options.substeps);
    m->spacing = options.spacing;
    m->solver = pbf_create(&options);
    return m->solver != NULL;
}

static bool method_pbf_open(const char *settings, const ascc_method_scene *scene, void **state,
                            ascc_method_error *error)
{
    method_pbf *m = calloc(1, sizeof *m);
    if (!m)
        return false;
    m->scene = scene;
    m->velocity = malloc((scene->fluid_count + 1) * (size_t)scene->dimension * sizeof *m->velocity);
    if (!m->velocity || !make_solver(m, settings, error) ||
        !ascc_method_layers(scene, m->spacing, LAYERS, &m->wall, &m->wall_count, error) ||
        (m->wall_count && pbf_set_walls(m->solver, m->wall_count, m->wall) != ASCC_OK)) {
        method_pbf_close(m);
        return false;
    }
    *state = m;
    return true;
}

/* A step is x + h (v + h g): with a velocity of the instant, half of h g too much. */
static bool method_pbf_set(void *state, const double *position, const double *velocity,
                           ascc_velocity_kind kind, ascc_method_error *error)
{
    method_pbf *m = state;
    const size_t d = (size_t)m->scene->dimension, n = m->scene->fluid_count * d;
    const double half = 0.5 * m->scene->time_step;
    const double lag = kind == ASCC_VELOCITY_DIFFERENCE ? m->lag : m->lag - half;
    for (size_t i = 0; i < n; i++)
        m->velocity[i] = velocity[i] + lag * m->scene->gravity[i % d];
    if (pbf_set_fluid(m->solver, m->scene->fluid_count, position, m->velocity) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%.200s", pbf_message(m->solver));
    return false;
}

static bool method_pbf_advance(void *state, ascc_method_error *error)
{
    method_pbf *m = state;
    if (pbf_advance(m->solver, m->scene->time_step) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%.200s", pbf_message(m->solver));
    return false;
}

static void method_pbf_read(const void *state, double *position, double *velocity)
{
    const method_pbf *m = state;
    const size_t d = (size_t)m->scene->dimension;
    const double(*x)[3] = pbf_positions(m->solver);
    const double(*v)[3] = pbf_velocities(m->solver);
    for (size_t i = 0; i < m->scene->fluid_count; i++)
        for (size_t c = 0; c < d; c++) {
            position[i * d + c] = x[i][c];
            velocity[i * d + c] = v[i][c];
        }
}

const ascc_method ascc_method_pbf = {
    .prefix = "pbf:",
    .help = "pbf:SETTINGS   position based fluids: iterations=4, substeps=1, relaxation=, spacing=",
    .open = method_pbf_open,
    .set = method_pbf_set,
    .advance = method_pbf_advance,
    .read = method_pbf_read,
    .close = method_pbf_close,
};
