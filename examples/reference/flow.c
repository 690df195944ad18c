/* A recipe in motion, by whichever solver it is for. SPDX-License-Identifier: MIT */
#include "flow.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph.h"

#define WALL_SPACING                                                                               \
    0.64          /* spacings between points on DFSPH's walls: 980 a square metre at 0.05 m */
#define CALM 10.0 /* times the viscosity, in the first two thirds of settling */

struct flow {
    const recipe *made;
    sph *weak;
    dfsph *strict; /* one of the two */
    size_t count;
};

/* 1 ms at 0.05 m, as the given sequences; as gravity scales for other sizes. */
static double step_of(const recipe *r)
{
    return 0.001 * sqrt(r->spacing / 0.05);
}

void flow_destroy(flow **f)
{
    if (!*f)
        return;
    sph_destroy(&(*f)->weak);
    dfsph_destroy(&(*f)->strict);
    free(*f);
    *f = NULL;
}

/* The particles that settle have done so; those that come later join them. */
static ascc_status settle(flow *f)
{
    const recipe *r = f->made;
    const size_t d = (size_t)r->dimension, first = r->settled ? r->settled : r->count;
    ascc_status status = dfsph_set_fluid(f->strict, first, r->position, NULL);
    double *x = malloc(2 * (r->count + 1) * d * sizeof *x), *v = x + r->count * d;
    dfsph_set_forces(f->strict, r->settle_gravity, CALM * r->viscosity);
    if (status == ASCC_OK)
        status = dfsph_advance(f->strict, r->settle * 2.0 / 3.0);
    dfsph_set_forces(f->strict, r->settle_gravity, r->viscosity);
    if (status == ASCC_OK)
        status = dfsph_advance(f->strict, r->settle / 3.0);
    dfsph_set_forces(f->strict, r->gravity, r->viscosity);
    for (size_t i = 0; x && i < r->count; i++)
        for (size_t c = 0; c < d; c++) {
            const size_t k = i * d + c;
            x[k] = i < first ? dfsph_positions(f->strict)[i][c] : r->position[k];
            v[k] = i < first ? dfsph_velocities(f->strict)[i][c] : r->velocity[k];
        }
    if (status == ASCC_OK && first < r->count)
        status = x ? dfsph_set_fluid(f->strict, r->count, x, v) : ASCC_ERROR_MEMORY;
    free(x);
    return status;
}

static ascc_status start_strict(flow *f, int32_t thread_count, wall_points *walls)
{
    const recipe *r = f->made;
    dfsph_options options = {.dimension = r->dimension,
                             .thread_count = thread_count,
                             .spacing = r->spacing,
                             .volume = r->volume,
                             .viscosity = r->viscosity,
                             .time_step = step_of(r)};
    memcpy(options.gravity, r->gravity, sizeof options.gravity);
    f->strict = dfsph_create(&options);
    const bool good =
        f->strict &&
        (r->dimension == 2
             ? solids_sample(r->solids, r->solid_count, 2, r->spacing, 3, walls)
             : solids_sample_faces(r->solids, r->solid_count, WALL_SPACING * r->spacing, walls));
    if (!good)
        return ASCC_ERROR_MEMORY;
    const ascc_status status = dfsph_set_walls(f->strict, walls->count, walls->position);
    if (status != ASCC_OK)
        return status;
    return r->settle > 0.0 ? settle(f)
                           : dfsph_set_fluid(f->strict, r->count, r->position, r->velocity);
}

ascc_status flow_create(const recipe *made, int32_t thread_count, flow **created,
                        wall_points *walls)
{
    flow *f = calloc(1, sizeof *f);
    *walls = (wall_points){0};
    if (!f)
        return ASCC_ERROR_MEMORY;
    f->made = made;
    f->count = made->count;
    const ascc_status status = made->solver == RECIPE_SPH
                                   ? recipe_solver(made, thread_count, &f->weak, walls)
                                   : start_strict(f, thread_count, walls);
    if (status != ASCC_OK) {
        flow_destroy(&f);
        wall_points_free(walls);
    }
    *created = f;
    return status;
}

ascc_status flow_advance(flow *f, double dt)
{
    return f->weak ? sph_advance(f->weak, dt) : dfsph_advance(f->strict, dt);
}

void flow_read(const flow *f, float *frame)
{
    const size_t d = (size_t)f->made->dimension;
    const sph_particle *p = f->weak ? sph_particles(f->weak, NULL, NULL) : NULL;
    for (size_t i = 0; i < f->count; i++) {
        const double *x = p ? p[i].position : dfsph_positions(f->strict)[i];
        const double *v = p ? p[i].velocity : dfsph_velocities(f->strict)[i];
        for (size_t c = 0; c < d; c++) {
            frame[i * d + c] = (float)x[c];
            frame[(f->count + i) * d + c] = (float)v[c];
        }
    }
}

double flow_mass(const flow *f)
{
    return f->weak ? sph_mass(f->weak) : dfsph_mass(f->strict);
}

void flow_describe(const flow *f, const wall_points *walls, char *text, size_t capacity)
{
    const recipe *r = f->made;
    if (f->weak)
        (void)snprintf(text, capacity,
                       "weakly compressible SPH of examples/reference (Wendland C2, h = 1.5 "
                       "spacings, speed of sound %.3g m/s, alpha 0.05, walls of Adami et al. 2012, "
                       "%d layers, the first half a spacing behind the surface)",
                       10.0 * r->speed, walls->layers);
    else
        (void)snprintf(text, capacity,
                       "DFSPH of examples/reference (cubic spline, support 2 spacings, steps of at "
                       "most %.3g s, errors 1e-4 and 1e-3, viscosity %.3g m^2/s, walls of Akinci "
                       "et al. 2012, %s%s)",
                       step_of(r), r->viscosity,
                       r->dimension == 2 ? "3 layers, the first half a spacing behind the surface"
                                         : "points on the surface",
                       r->settle > 0.0 ? ", settled" : "");
}

const char *flow_message(const flow *f)
{
    return f->weak ? sph_message(f->weak) : dfsph_message(f->strict);
}
