/* Measures of a particle set: energy, momenta, density, distances.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "particles.h"
#include "search.h"

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_measures) == 144, "released layout");

static double poly6(double square)
{
    const double t = 1.0 - square;
    return t > 0.0 ? t * t * t : 0.0;
}

/* What the kernel sums to on an unbounded lattice of half the support radius. */
static double lattice_sum(int32_t dimension)
{
    double sum = 0.0;
    for (int z = dimension == 3 ? -2 : 0; z <= (dimension == 3 ? 2 : 0); z++)
        for (int y = -2; y <= 2; y++)
            for (int x = -2; x <= 2; x++)
                sum += poly6((double)(x * x + y * y + z * z) / 4.0);
    return sum;
}

static void measure_motion(const ascc_particles *p, ascc_measures *m)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < p->fluid_count; i++) {
        m->mass += p->mass[i];
        for (size_t c = 0; c < d; c++)
            m->center[c] += p->mass[i] * p->position[i * d + c];
    }
    for (size_t c = 0; c < d && m->mass > 0.0; c++)
        m->center[c] /= m->mass;
    for (size_t i = 0; i < p->fluid_count; i++) {
        double v[3] = {0}, x[3] = {0}, r[3] = {0}, square = 0.0, distance = 0.0;
        for (size_t c = 0; c < d; c++) {
            v[c] = ascc_velocity(p, i, (int32_t)c);
            x[c] = p->position[i * d + c];
            r[c] = x[c] - m->center[c];
            square += v[c] * v[c];
            distance += r[c] * r[c];
            m->momentum[c] += p->mass[i] * v[c];
        }
        m->kinetic_energy += 0.5 * p->mass[i] * square;
        m->max_speed = fmax(m->max_speed, sqrt(square));
        m->angular_scale += p->mass[i] * sqrt(distance) * sqrt(square);
        m->angular_momentum[0] += p->mass[i] * (x[1] * v[2] - x[2] * v[1]);
        m->angular_momentum[1] += p->mass[i] * (x[2] * v[0] - x[0] * v[2]);
        m->angular_momentum[2] += p->mass[i] * (x[0] * v[1] - x[1] * v[0]);
    }
}

/* Densities relative to a lattice at rest, and distances, of all lists within two spacings. */
static void measure_lists(const ascc_search *near, const ascc_particles *p, ascc_measures *m)
{
    const ascc_rows *rows = &near->rows;
    const double rest = lattice_sum(p->dimension);
    double nearest = INFINITY, sum = 0.0;
    for (size_t i = 0; i < rows->query->count; i++) {
        double density = 0.0;
        bool close = false;
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = rows->neighbor[rows->start[i] + k];
            double e[3];
            const double square = ascc_search_separation(near, i, j, e);
            density += poly6(square);
            if (j == i)
                continue;
            nearest = fmin(nearest, square);
            close |= square < 0.0625; /* half a spacing is a quarter of the radius */
        }
        m->close_count += close;
        m->max_density = fmax(m->max_density, density / rest);
        sum += density / rest;
    }
    m->mean_density = rows->query->count ? sum / (double)rows->query->count : 0.0;
    m->min_distance = isfinite(nearest) ? sqrt(nearest) * 2.0 * p->spacing : 0.0;
}

static ascc_status measure_density(const ascc_particles *p, ascc_arena *arena, ascc_measures *m,
                                   ascc_message *message)
{
    const ascc_search_tools tools = {arena, p->context->workers, &p->context->kernels, message};
    const ascc_search_options within = {.dimension = p->dimension,
                                        .radius = 2.0 * p->spacing,
                                        .query = {p->position, p->fluid_count, "fluid row"}};
    ascc_search near;
    const ascc_status status = ascc_search_run(&near, &tools, &within);
    if (status == ASCC_OK)
        measure_lists(&near, p, m);
    return status;
}

ascc_status ascc_particles_measure(ascc_particles *particles, ascc_measures *measures)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_measures m = {0};
    if (!measures || !ascc_struct_is_known(measures, sizeof m))
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                   "measures: NULL, or of a size not known here");
    measure_motion(particles, &m);
    ascc_arena arena;
    ascc_arena_open(&arena, &particles->context->allocator);
    ascc_message message;
    const ascc_status status = measure_density(particles, &arena, &m, &message);
    ascc_arena_close(&arena);
    if (status != ASCC_OK)
        return ascc_particles_fail(particles, status, "%s", message.text);
    (void)ascc_write_struct(measures, &m, sizeof m, sizeof m);
    return ASCC_OK;
}
