/* Measures of a particle set: energy, momenta, density, distances (METHOD section 9).
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "neighbors.h"
#include "particles.h"

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

static ascc_status convert(const ascc_particles *p, const ascc_scale *scale, ascc_points *points,
                           ascc_message *message)
{
    const size_t d = (size_t)p->dimension;
    for (size_t i = 0; i < p->fluid_count; i++) {
        int64_t at[3] = {0};
        for (size_t c = 0; c < d; c++)
            if (!ascc_scale_apply(scale, p->position[i * d + c], &at[c]))
                return ascc_fail(message, ASCC_ERROR_RANGE,
                                 "fluid row %zu is too far from the origin", i);
        ascc_points_set(points, i, at);
    }
    return ASCC_OK;
}

static void measure_rows(const ascc_particles *p, const ascc_rows *rows, ascc_measures *m)
{
    const double radius = rows->radius, rest = lattice_sum(p->dimension);
    double nearest = INFINITY, sum = 0.0;
    for (size_t i = 0; i < rows->query->count; i++) {
        double density = 0.0;
        bool close = false;
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = rows->neighbor[rows->start[i] + k];
            double square = 0.0;
            for (int c = 0; c < 3; c++) {
                const double e =
                    (double)(rows->source->position[c][j] - rows->query->position[c][i]) / radius;
                square += e * e;
            }
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
    const double radius = 2.0 * p->spacing;
    const ascc_scale scale = ascc_scale_for_radius(radius);
    ascc_points points;
    if (!ascc_points_take(&points, arena, p->fluid_count))
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory to measure %zu particles",
                         p->fluid_count);
    ascc_status status = convert(p, &scale, &points, message);
    if (status != ASCC_OK)
        return status;
    ascc_extent extent;
    ascc_extent_start(&extent);
    ascc_extent_add(&extent, &points);
    ascc_grid grid;
    ascc_rows rows = {.query = &points,
                      .source = &points,
                      .query_grid = &grid,
                      .source_grid = &grid,
                      .radius = radius * scale.inverse,
                      .same = true,
                      .max_neighbors = 1 << 20};
    status = ascc_grid_build(&grid, &tools, &points, &extent, rows.radius, false);
    if (status == ASCC_OK)
        status = ascc_rows_open(&rows, &tools, p->fluid_count * 36);
    if (status == ASCC_OK)
        status = ascc_rows_make(&rows, &tools, NULL);
    if (status == ASCC_OK)
        measure_rows(p, &rows, m);
    return status;
}

ascc_status ascc_particles_measure(ascc_particles *particles, ascc_measures *measures)
{
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
