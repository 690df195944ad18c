/* The reference SPH solver as a method. SPDX-License-Identifier: MIT
 *
 *   sph:cs=20,courant=0.5,alpha=0.05,shift=1,contact=0.7,coarse=1
 *
 * coarse=2 computes with particles twice as far apart (method_coarse.h), the scene's carried along.
 * Every start is at rest density: the first frames after it lack the pressure of water at rest.
 * cs is the speed of sound, m/s. Its default is ten times what the fluid can fall through the scene and
 * still adds its own greatest speed to, so that the density stays within about 1 %.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "method_coarse.h"
#include "method_walls.h"
#include "sph.h"

typedef struct method_sph {
    const ascc_method_scene *scene;
    sph_options options; /* sound_speed 0 = found when the fluid is placed */
    sph *solver;
    double *wall, *velocity;
    size_t wall_count;
    double factor;      /* of the spacing; above 1: */
    ascc_coarse coarse; /* what is computed with instead of the scene's particles */
    double *now[2];     /* position and velocity of these */
} method_sph;

static void sph_close(void *state)
{
    method_sph *m = state;
    sph_destroy(&m->solver);
    ascc_coarse_close(&m->coarse);
    free(m->now[0]);
    free(m->wall);
    free(m->velocity);
    free(m);
}

static bool open_coarse(method_sph *m, ascc_method_error *error)
{
    const size_t row = m->scene->fluid_count * (size_t)m->scene->dimension;
    snprintf(error->text, sizeof error->text, "coarse: 1 to 100, or no memory");
    if (!(m->factor >= 1.0 && m->factor <= 100.0))
        return false;
    m->options.spacing *= m->factor;
    if (m->factor == 1.0)
        return true;
    m->now[0] = malloc((2 * row + 1) * sizeof **m->now);
    m->now[1] = m->now[0] + row;
    return m->now[0] && ascc_coarse_open(&m->coarse, m->scene, m->factor, m->options.spacing);
}

static bool sph_open(const char *settings, const ascc_method_scene *scene, void **state,
                     ascc_method_error *error)
{
    method_sph *m = calloc(1, sizeof *m);
    if (!m)
        return false;
    m->scene = scene;
    m->factor = 1.0;
    m->options = (sph_options){.dimension = scene->dimension,
                               .thread_count = scene->threads,
                               .spacing = ascc_method_spacing(scene),
                               .rest_density = scene->rest_density,
                               .artificial_viscosity = 0.05};
    for (int c = 0; c < scene->dimension; c++)
        m->options.gravity[c] = scene->gravity[c];
    const ascc_method_setting known[] = {{"cs", &m->options.sound_speed},
                                         {"courant", &m->options.courant},
                                         {"alpha", &m->options.artificial_viscosity},
                                         {"nu", &m->options.viscosity},
                                         {"shift", &m->options.shifting},
                                         {"contact", &m->options.contact},
                                         {"spacing", &m->options.spacing},
                                         {"coarse", &m->factor},
                                         {NULL, NULL}};
    m->velocity = malloc((scene->fluid_count + 1) * (size_t)scene->dimension * sizeof *m->velocity);
    if (!m->velocity || !ascc_method_settings(settings, known, error) || !open_coarse(m, error) ||
        !ascc_method_layers(scene, m->options.spacing, sph_wall_layers(&m->options), &m->wall,
                            &m->wall_count, error)) {
        sph_close(m);
        return false;
    }
    *state = m;
    return true;
}

/* Ten times the speed that free fall through fluid and walls ends with, on top of the fastest. */
static double sound_speed(const method_sph *m, const double *position, const double *velocity)
{
    const ascc_method_scene *scene = m->scene;
    const size_t d = (size_t)scene->dimension;
    double fastest = 0.0, fall = 0.0;
    for (size_t i = 0; i < scene->fluid_count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += velocity[i * d + c] * velocity[i * d + c];
        fastest = fmax(fastest, square);
    }
    for (size_t c = 0; c < d && scene->wall_count; c++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < scene->fluid_count; i++) {
            low = fmin(low, position[i * d + c]);
            high = fmax(high, position[i * d + c]);
        }
        for (size_t i = 0; i < m->wall_count; i++) {
            low = fmin(low, scene->gravity[c] < 0.0 ? m->wall[i * d + c] : low);
            high = fmax(high, scene->gravity[c] > 0.0 ? m->wall[i * d + c] : high);
        }
        fall += 2.0 * fabs(scene->gravity[c]) * (high - low);
    }
    return 10.0 * fmax(1.0, sqrt(fastest + fall));
}

/* Velocities as differences lag half a frame: gravity makes up for it. */
static bool sph_set(void *state, const double *position, const double *velocity,
                    ascc_velocity_kind kind, ascc_method_error *error)
{
    method_sph *m = state;
    const ascc_method_scene *scene = m->scene;
    const size_t d = (size_t)scene->dimension, n = scene->fluid_count * d;
    const double lag = kind == ASCC_VELOCITY_DIFFERENCE ? 0.5 * scene->time_step : 0.0;
    for (size_t i = 0; i < n; i++)
        m->velocity[i] = velocity[i] + lag * scene->gravity[i % d];
    sph_options options = m->options;
    if (!(options.sound_speed > 0.0))
        options.sound_speed = sound_speed(m, position, m->velocity);
    const bool coarse = m->factor > 1.0;
    sph_destroy(&m->solver);
    m->solver = sph_create(&options);
    if (m->solver && (!coarse || ascc_coarse_set(&m->coarse, position, m->velocity)) &&
        (!m->wall_count || sph_set_walls(m->solver, m->wall_count, m->wall) == ASCC_OK) &&
        sph_set_fluid(m->solver, coarse ? m->coarse.count : scene->fluid_count,
                      coarse ? m->coarse.position : position,
                      coarse ? m->coarse.velocity : m->velocity) == ASCC_OK)
        return true;
    snprintf(error->text, sizeof error->text, "%.200s",
             m->solver ? sph_message(m->solver) : "settings out of range, or no memory");
    return false;
}

/* Of the particles that are computed with. */
static void read_solver(const method_sph *m, size_t count, double *position, double *velocity)
{
    const size_t d = (size_t)m->scene->dimension;
    const sph_particle *p = sph_particles(m->solver, NULL, NULL);
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++) {
            position[i * d + c] = p[i].position[c];
            velocity[i * d + c] = p[i].velocity[c];
        }
}

static bool sph_frame(void *state, ascc_method_error *error)
{
    method_sph *m = state;
    if (sph_advance(m->solver, m->scene->time_step) != ASCC_OK) {
        snprintf(error->text, sizeof error->text, "%.200s", sph_message(m->solver));
        return false;
    }
    if (m->factor == 1.0)
        return true;
    read_solver(m, m->coarse.count, m->now[0], m->now[1]);
    snprintf(error->text, sizeof error->text, "coarse particles: not finite, or no memory");
    return ascc_coarse_carry(&m->coarse, m->now[0], m->now[1]);
}

static void sph_read(const void *state, double *position, double *velocity)
{
    const method_sph *m = state;
    const size_t bytes = m->scene->fluid_count * (size_t)m->scene->dimension * sizeof(double);
    if (m->factor == 1.0) {
        read_solver(m, m->scene->fluid_count, position, velocity);
        return;
    }
    memcpy(position, m->coarse.row_position, bytes);
    memcpy(velocity, m->coarse.row_velocity, bytes);
}

const ascc_method ascc_method_sph = {
    .prefix = "sph:",
    .help = "sph:SETTINGS   reference SPH: cs=, courant=, alpha=, nu=, shift=, contact=, spacing=, "
            "coarse=",
    .open = sph_open,
    .set = sph_set,
    .advance = sph_frame,
    .read = sph_read,
    .close = sph_close,
};
