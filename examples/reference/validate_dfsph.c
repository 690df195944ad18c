/* validate-reference: what is known of water, and the DFSPH solver. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph.h"
#include "solids.h"
#include "validate.h"

typedef struct pool {
    dfsph *solver;
    size_t count;
    double *position;
} pool;

static void pool_close(pool *p)
{
    dfsph_destroy(&p->solver);
    free(p->position);
}

/* Water of cells[0] x cells[1] in a room of so many cells, walls in layers. Particles fill 0.9 of their cells at
 * first, so that nothing is compressed, unless `full`. */
static bool pool_open(pool *p, int32_t threads, double spacing, const int cells[2],
                      const int room[2], bool full)
{
    const dfsph_options options = {.dimension = 2,
                                   .thread_count = threads,
                                   .spacing = spacing,
                                   .volume = full ? 1.0 : 0.9,
                                   .gravity = {0.0, -G, 0.0},
                                   .viscosity = 1e-3,
                                   .time_step = 0.002};
    solid tank = {.kind = SOLID_ROOM};
    wall_points walls = {0};
    for (int c = 0; c < 2; c++)
        tank.center[c] = tank.half[c] = 0.5 * room[c] * spacing;
    p->count = (size_t)cells[0] * (size_t)cells[1];
    p->position = malloc(2 * p->count * sizeof *p->position);
    p->solver = dfsph_create(&options);
    for (size_t i = 0; p->position && i < p->count; i++) {
        p->position[2 * i] = ((double)(i % (size_t)cells[0]) + 0.5) * spacing;
        p->position[2 * i + 1] = ((double)(i / (size_t)cells[0]) + 0.5) * spacing;
    }
    const bool good = p->solver && p->position && solids_sample(&tank, 1, 2, spacing, 2, &walls) &&
                      dfsph_set_walls(p->solver, walls.count, walls.position) == ASCC_OK &&
                      dfsph_set_fluid(p->solver, p->count, p->position, NULL) == ASCC_OK;
    wall_points_free(&walls);
    return good;
}

/* A column of 2 m x 1 m: the pressure half-way down, away from the side walls, and what the walls carry. */
static void hydrostatic(report *r)
{
    const double spacing = 0.025;
    const int cells[2] = {40, 80}, room[2] = {40, 120};
    pool p = {0};
    bool good = pool_open(&p, r->threads, spacing, cells, room, false) &&
                dfsph_advance(p.solver, 3.0) == ASCC_OK;
    const double before = good ? dfsph_wall_impulse(p.solver)[1] : 0.0;
    double pressure = 0.0, depth = 0.0, compression = 0.0, level = 0.0;
    for (int f = 0; f < 100 && good; f++) {
        good = dfsph_advance(p.solver, 0.01) == ASCC_OK;
        const double(*x)[3] = dfsph_positions(p.solver);
        level = 0.0;
        for (size_t i = 0; i < p.count; i++) {
            level += 2.0 * x[i][1] / (double)p.count;
            compression += fmax(dfsph_densities(p.solver)[i] - 1.0, 0.0) / (double)p.count / 100.0;
        }
        for (size_t i = 0; i < p.count; i++)
            if (fabs(x[i][1] / level - 0.5) < 0.2 && fabs(x[i][0] - 0.5) < 0.4) {
                pressure += dfsph_pressure(p.solver, i) / (1000.0 * G);
                depth += level - x[i][1];
            }
    }
    if (good) {
        const double weight = dfsph_mass(p.solver) * (double)p.count * G;
        const double carried = (before - dfsph_wall_impulse(p.solver)[1]) / weight;
        validate_row(r, "DFSPH: hydrostatic column, pressure half-way down, mean of 3 to 4 s",
                     fabs(pressure / depth - 1.0) < 0.02, "1 within 2 %",
                     "%.4f rho g h (%.0f spacings deep)", pressure / depth, level / spacing);
        validate_row(r, "DFSPH: the same, what the walls carry", fabs(carried - 1.0) < 0.005,
                     "1 within 0.5 %", "%.4f of the weight", carried);
        validate_row(r, "DFSPH: the same, volume", compression < 1e-3, "compression below 0.1 %",
                     "mean compression %.1e, level %.4f of 0.9 x 2 m", compression, level / 1.8);
    }
    pool_close(&p);
}

/* How deep a body of 12 x 12 points lies in a pool of 60 x 30, in shares of its height. */
static double draft(const report *r, double density)
{
    const double spacing = 0.025, side = 12 * spacing;
    const int cells[2] = {60, 30}, room[2] = {60, 70};
    const double mass = 1000.0 * density * side * side;
    rigid body = {.kind = RIGID_FREE,
                  .mass = mass,
                  .inertia = {0.0, 0.0, mass * side * side / 6.0},
                  .center = {0.75, 30.5 * spacing + 0.5 * side, 0.0}};
    double points[144 * 2], height = 0.0;
    for (int i = 0; i < 144; i++) {
        points[2 * i] = body.center[0] + (i % 12 - 5.5) * spacing;
        points[2 * i + 1] = body.center[1] + (i / 12 - 5.5) * spacing;
    }
    pool p = {0};
    bool good = pool_open(&p, r->threads, spacing, cells, room, false) &&
                dfsph_add_body(p.solver, 144, points, &body) == ASCC_OK &&
                dfsph_advance(p.solver, 5.0) == ASCC_OK;
    for (int f = 0; f < 100 && good; f++) {
        good = dfsph_advance(p.solver, 0.01) == ASCC_OK;
        height += dfsph_body(p.solver, 0)->center[1] / 100.0;
    }
    pool_close(&p);
    const double level = 0.9 * 30 * spacing + density * side * side / (60 * spacing);
    return good ? (level - height + 0.5 * side) / side : NAN;
}

static void floating(report *r)
{
    const double light = draft(r, 0.1), half = draft(r, 0.5), heavy = draft(r, 0.8);
    const double off = fmax(fabs(light - 0.1), fmax(fabs(half - 0.5), fabs(heavy - 0.8)));
    validate_row(r, "DFSPH: draft of free bodies of density 0.1, 0.5, 0.8, 12 spacings high",
                 off < 0.5 / 12, "their density, within half a spacing: 0.042", "%.3f, %.3f, %.3f",
                 light, half, heavy);
}

void validate_dfsph(report *r)
{
    hydrostatic(r);
    floating(r);
}

bool validate_dfsph_dam(int32_t threads, double front[DAM_FRAMES])
{
    const int cells[2] = {50, 100}, room[2] = {200, 150};
    pool p = {0};
    bool good = pool_open(&p, threads, 0.02, cells, room, true);
    for (int f = 0; good && f < DAM_FRAMES; f++) {
        front[f] = 0.01;
        for (size_t i = 0; i < p.count; i++)
            front[f] = fmax(front[f], dfsph_positions(p.solver)[i][0] + 0.01);
        good = dfsph_advance(p.solver, DAM_STEP) == ASCC_OK;
    }
    pool_close(&p);
    return good;
}
