/* A recipe in motion, by whichever solver it is for. SPDX-License-Identifier: MIT */
#include "flow.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph.h"

#define WALL_SPACING                                                                               \
    0.64 /* spacings between points on DFSPH's walls: 980 a square metre at 0.05 m */
#define PI 3.14159265358979323846
#define CALM 10.0 /* times the viscosity, in the first two thirds of settling */

#define SLICE 0.002 /* s between two velocities of what is driven */

struct flow {
    const recipe *made;
    sph *weak;
    dfsph *strict; /* one of the two */
    size_t count;
    double time;                 /* s since the first frame */
    size_t bodies;               /* solids that move, in the order of the recipe */
    size_t solid[RECIPE_SOLIDS]; /* each body's */
    size_t walls;                /* of moving scenes: */
    size_t *row;                 /* [walls] of the solver's, which has them body by body */
    unsigned char *body;         /* [walls] 0 = at rest, else 1 + its number */
    double *normal;              /* [walls][3] in the body's own axes */
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
    free((*f)->row);
    free((*f)->body);
    free((*f)->normal);
    free(*f);
    *f = NULL;
}

/* ---- Walls, at rest and moving ---- */

static bool sample(const recipe *r, const solid *solids, size_t count, wall_points *walls)
{
    return r->dimension == 2 ? solids_sample(solids, count, 2, r->spacing, 3, walls)
                             : solids_sample_faces(solids, count, WALL_SPACING * r->spacing, walls);
}

/* Mass and inertia of a solid that its motion moves. */
static rigid rigid_of(const recipe *r, size_t number)
{
    const solid *s = &r->solids[number];
    const bool flat = r->dimension == 2, ball = s->kind == SOLID_BALL;
    const double radius = s->radius, *h = s->half;
    const double volume = ball ? (flat ? PI * radius * radius : 4.0 / 3.0 * PI * pow(radius, 3.0))
                               : 4.0 * h[0] * h[1] * (flat ? 1.0 : 2.0 * h[2]);
    rigid b = {.kind = r->motion[number].kind, .mass = r->motion[number].density * volume};
    for (int c = 0; c < 3; c++) {
        const double one = h[(c + 1) % 3], two = h[(c + 2) % 3];
        b.center[c] = s->center[c];
        b.inertia[c] =
            b.mass * (ball ? (flat ? 0.5 : 0.4) * radius * radius : (one * one + two * two) / 3.0);
    }
    return b;
}

/* All points, those of a layer together, and where the solver has them. part[0] is at rest. */
static bool join(flow *f, const wall_points *part, wall_points *walls)
{
    const size_t d = (size_t)f->made->dimension;
    size_t begin[RECIPE_SOLIDS + 1] = {0}, count = 0;
    for (size_t g = 0; g <= f->bodies; g++) {
        begin[g] = count;
        count += part[g].count;
        walls->layers = part[g].layers > walls->layers ? part[g].layers : walls->layers;
    }
    walls->position = malloc((count + 1) * d * sizeof *walls->position);
    walls->normal = malloc((count + 1) * d * sizeof *walls->normal);
    f->row = malloc((count + 1) * sizeof *f->row);
    f->body = malloc(count + 1);
    f->normal = calloc(3 * (count + 1), sizeof *f->normal);
    if (!walls->position || !walls->normal || !f->row || !f->body || !f->normal)
        return false;
    size_t done[RECIPE_SOLIDS + 1] = {0};
    for (int32_t layer = 0; layer < walls->layers; layer++)
        for (size_t g = 0; g <= f->bodies; g++)
            for (size_t k = 0; k < part[g].layer_count[layer]; k++, done[g]++) {
                const size_t to = walls->count++, from = done[g] * d;
                memcpy(walls->position + to * d, part[g].position + from, d * sizeof(double));
                memcpy(walls->normal + to * d, part[g].normal + from, d * sizeof(double));
                memcpy(f->normal + to * 3, part[g].normal + from, d * sizeof(double));
                f->row[to] = begin[g] + done[g];
                f->body[to] = (unsigned char)g;
                walls->layer_count[layer]++;
            }
    f->walls = count;
    return true;
}

/* The solver's walls: what rests, then the bodies, from where they are in the recipe. */
static ascc_status set_walls(flow *f, const wall_points *part)
{
    ascc_status status = dfsph_set_walls(f->strict, part[0].count, part[0].position);
    for (size_t b = 0; b < f->bodies && status == ASCC_OK; b++) {
        const rigid body = rigid_of(f->made, f->solid[b]);
        status = dfsph_add_body(f->strict, part[b + 1].count, part[b + 1].position, &body);
    }
    return status;
}

/* Solids that rest into part[0], each other into the next. */
static bool sample_parts(flow *f, wall_points *part)
{
    const recipe *r = f->made;
    solid still[RECIPE_SOLIDS];
    size_t count = 0;
    bool good = true;
    for (size_t i = 0; i < r->solid_count; i++) {
        if (r->motion[i].kind == RIGID_STILL)
            still[count++] = r->solids[i];
        else
            f->solid[f->bodies++] = i;
    }
    for (size_t b = 0; b < f->bodies && good; b++)
        good = sample(r, &r->solids[f->solid[b]], 1, &part[b + 1]);
    return good && (count == 0 || sample(r, still, count, &part[0]));
}

/* ---- Fluid ---- */

/* The particles that settle have done so; those that come later join them. */
static ascc_status settle(flow *f, const wall_points *part)
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
    if (status == ASCC_OK && f->bodies)
        status = set_walls(f, part);
    if (status == ASCC_OK && (first < r->count || f->bodies))
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
    wall_points part[RECIPE_SOLIDS + 1] = {0};
    bool good = f->strict && sample_parts(f, part);
    if (good && f->bodies) {
        good = join(f, part, walls);
    } else if (good) {
        *walls = part[0];
        part[0] = (wall_points){0};
    }
    ascc_status status =
        good ? dfsph_set_walls(f->strict, walls->count, walls->position) : ASCC_ERROR_MEMORY;
    if (status == ASCC_OK && r->settle > 0.0) {
        status = settle(f, part);
    } else if (status == ASCC_OK) {
        if (f->bodies)
            status = set_walls(f, part);
        if (status == ASCC_OK)
            status = dfsph_set_fluid(f->strict, r->count, r->position, r->velocity);
    }
    for (size_t g = 0; g <= RECIPE_SOLIDS; g++)
        wall_points_free(&part[g]);
    return status;
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

/* How far a driven body has gone along x, and has turned about z. */
static void driven_at(const recipe_motion *m, double time, double *way, double *angle)
{
    const double late = m->spin_up > 0.0 ? m->spin_up * (1.0 - exp(-time / m->spin_up)) : 0.0;
    *way = m->reach * (1.0 - cos(m->rate * time));
    *angle = m->spin * (time - late);
}

/* Mean velocities of what is driven, over the next dt. */
static void drive(flow *f, double dt)
{
    for (size_t b = 0; b < f->bodies; b++) {
        const recipe_motion *m = &f->made->motion[f->solid[b]];
        double way[2], angle[2];
        if (m->kind != RIGID_DRIVEN)
            continue;
        driven_at(m, f->time, &way[0], &angle[0]);
        driven_at(m, f->time + dt, &way[1], &angle[1]);
        const double velocity[3] = {(way[1] - way[0]) / dt, 0.0, 0.0},
                     spin[3] = {0.0, 0.0, (angle[1] - angle[0]) / dt};
        dfsph_drive_body(f->strict, b, velocity, spin);
    }
}

ascc_status flow_advance(flow *f, double dt)
{
    const int slices = f->bodies ? (int)ceil(dt / SLICE - 1e-9) : 1;
    ascc_status status = ASCC_OK;
    for (int k = 0; k < slices && status == ASCC_OK; k++) {
        drive(f, dt / slices);
        status =
            f->weak ? sph_advance(f->weak, dt / slices) : dfsph_advance(f->strict, dt / slices);
        f->time += dt / slices;
    }
    return status;
}

bool flow_walls_move(const flow *f)
{
    return f->bodies > 0;
}

void flow_read_walls(const flow *f, float *position, float *normal)
{
    const size_t d = (size_t)f->made->dimension;
    const double(*x)[3] = dfsph_positions(f->strict) + f->count;
    for (size_t w = 0; w < f->walls; w++) {
        double n[3] = {f->normal[w * 3], f->normal[w * 3 + 1], f->normal[w * 3 + 2]};
        if (f->body[w])
            rigid_direction(dfsph_body(f->strict, f->body[w] - 1u), f->normal + w * 3, n);
        for (size_t c = 0; c < d; c++) {
            position[w * d + c] = (float)x[f->row[w]][c];
            normal[w * d + c] = (float)n[c];
        }
    }
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
