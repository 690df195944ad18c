/* Scenes of the stability suite whose walls move, carry, are thin or near each other, and whose fluid comes
 * on the way. SPDX-License-Identifier: MIT */
#include "suite.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

static const double still[3] = {0.0, 0.0, 0.0};

/* ---- A body in the fluid ----------------------------------------------------------------------- */

/* In 3D tanks are as narrow as they may be. Flat ones cost nothing, and fluid that is a lattice between walls a
 * few spacings apart carries bodies as a solid does. */
static world body_tank(int dimension, int deep, int flat, double tall)
{
    const int across = dimension == 3 ? deep : flat;
    return world_tank(dimension, SPACING, (int[]){across, 12, across},
                      (double[]){across + 1, tall, across + 1});
}

/* How far behind its surface a flat body's points lie, spacings: what docs/bodies.md gives networks. To other
 * methods a wall point is a particle, half of which reaches to the surface. */
static double flat_inset(const cell *c)
{
    return c->method == &ascc_method_model ? 1.0 : 0.5;
}

/* Whether the body has moved by a spacing; fails the cell if that was the wrong way, or so fast that
 * the fluid does not carry it. */
static bool body_arrived(cell *c, double ratio, double moved, double frame, long frames)
{
    const double flight = 0.5 * G * frame * frame * (double)(frames * (frames + 1));
    if (!(fabs(moved) > SPACING))
        return false;
    if ((moved > 0.0) != (ratio < 1.0))
        cell_fail(c, "body moves %+.1f spacings", moved / SPACING);
    else if (moved < -0.8 * flight)
        cell_fail(c, "body falls as if without fluid");
    cell_say(c, "%ld after it is free", frames);
    return true;
}

/* A cube in the middle of a tank, held for half of the frames, then free. In 3D its points are on its surface, and
 * its mass is that of the fluid taken out for it times `ratio`. It ends where it has moved by a spacing: nothing
 * holds it at the floor. */
static void buoyancy(cell *c, double ratio)
{
    const bool flat = c->dimension == 2;
    const double x = flat ? 14.5 * SPACING : 5.5 * SPACING, edge = flat ? 5.0 : 3.0;
    world w = body_tank(c->dimension, 10, 28, 18);
    const size_t full = w.scene.fluid_count;
    double velocity[3] = {0.0, 0.0, 0.0}, moved = 0.0;
    simulation s = {.world = &w};
    world_body(&w, (double[]){x, 6.5 * SPACING, x}, edge, flat ? flat_inset(c) : 0.0);
    const double particles = flat ? edge * edge : (double)(full - w.scene.fluid_count);
    const double mass = ratio * w.scene.mass * particles;
    const double *first = w.wall + 3 * (w.scene.wall_count - w.scene.body_count);
    const double start = first[1];
    bool good = cell_has_bodies(c);
    good = good && cell_open(c, &w, &s);
    while (good && cell_step(c, &s)) {
        const long loose = s.frame - c->frames / 2;
        good = cell_nothing_escapes(c, &s);
        if (!good || loose <= 0)
            continue;
        good = cell_free_body(c, &s, mass, velocity);
        moved = first[1] - start;
        if (body_arrived(c, ratio, moved, w.scene.time_step, loose))
            break;
    }
    if (good && cell_complete(c, &s) && !(fabs(moved) > SPACING))
        cell_fail(c, "body moved %+.2g spacings", moved / SPACING);
    cell_close(c, &s);
    world_free(&w);
}

void stability_light_body(cell *c)
{
    buoyancy(c, 0.5);
}

void stability_heavy_body(cell *c)
{
    buoyancy(c, 2.0);
}

/* Its impulse over that of Archimedes, mean over the last third. */
void stability_held_box(cell *c)
{
    const bool flat = c->dimension == 2;
    const double x = flat ? 14.5 * SPACING : 6.5 * SPACING, edge = 4.0;
    world w = body_tank(c->dimension, 12, 28, 17);
    simulation s = {.world = &w};
    double sum = 0.0;
    long counted = 0;
    world_body(&w, (double[]){x, 6.5 * SPACING, x}, edge, flat ? flat_inset(c) : 0.6);
    const double weight = w.scene.rest_density * pow(edge * SPACING, c->dimension) * G;
    bool good = cell_has_bodies(c);
    good = good && cell_open(c, &w, &s);
    while (good && cell_step(c, &s)) {
        double impulse[3];
        good = cell_nothing_escapes(c, &s);
        cell_body_impulse(c, &s, impulse);
        if (s.frame > c->frames - c->frames / 3) {
            sum += impulse[1] / (weight * w.scene.time_step);
            counted++;
        }
    }
    const double ratio = sum / (double)counted;
    if (good && cell_complete(c, &s) && !(fabs(ratio - 1.0) <= 0.05))
        cell_fail(c, "receives %.2f of its water's weight", ratio);
    cell_say(c, "%.2f", ratio);
    cell_close(c, &s);
    world_free(&w);
}

/* ---- Thin and narrow --------------------------------------------------------------------------- */

/* Whether a place is in the box, grown by so many spacings; a cup has no upper side. */
static bool in_cup(const double *x, const double low[3], const double high[3], double margin,
                   int dimension)
{
    bool in = true;
    for (int a = 0; a < dimension; a++)
        in = in && x[a] > (low[a] - margin) * SPACING &&
             (a == 1 || x[a] < (high[a] + margin) * SPACING);
    return in;
}

/* Fluid from row `inside` on began in the cup. */
static bool cup_holds(cell *c, const simulation *s, size_t inside, const double low[3],
                      const double high[3])
{
    size_t in = 0, out = 0;
    for (size_t i = 0; i < s->scene.fluid_count; i++) {
        const double *x = s->position + 3 * i;
        if (i < inside)
            in += in_cup(x, low, high, -0.5, c->dimension);
        else
            out += !in_cup(x, low, high, 0.5, c->dimension);
    }
    return in + out == 0 || cell_fail(c, "%zu in, %zu out", in, out);
}

void stability_thin_cup(cell *c)
{
    const int around = c->dimension == 2 ? 10 : 4; /* spacings: in 2D as wide as it costs nothing */
    const double low[3] = {around, 3.0, around}, high[3] = {around + 6.0, 12.0, around + 6.0};
    const int across = 2 * around + 6;
    world w = world_tank(c->dimension, SPACING, (int[]){across - 1, 6, across - 1},
                         (double[]){across, 18, across});
    simulation s;
    world_cup(&w, low, high);
    const size_t inside = w.scene.fluid_count;
    world_block(&w, (double[]){(around + 0.5) * SPACING, 3.5 * SPACING, (around + 0.5) * SPACING},
                (int[]){5, 6, 5}, still);
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cup_holds(c, &s, inside, low, high) &&
               cell_slower_than(c, &s, FALL);
    cell_close(c, &s);
    world_free(&w);
}

/* One gap. A cell's failure says which. */
static void fall_between_plates(cell *c, double gap)
{
    const double fast = 2.0 * sqrt(2.0 * G * 12 * SPACING);
    world w = world_empty(c->dimension, SPACING);
    simulation s;
    char why[sizeof c->text];
    world_box(&w, (double[]){gap, 16, 9});
    world_block(&w, (double[]){(0.5 * gap - 0.5) * SPACING, 6 * SPACING, 0.5 * SPACING},
                (int[]){1, 6, 8}, still);
    bool good = cell_open(c, &w, &s);
    const double start = cell_motion(&s).center[1];
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, fast);
    const double fell = (start - cell_motion(&s).center[1]) / SPACING;
    if (good && cell_complete(c, &s) && !(fell > 2.0))
        cell_fail(c, "fell by %.2g spacings", fell);
    if (c->verdict == FAIL) {
        memcpy(why, c->text, sizeof why);
        snprintf(c->text, sizeof c->text, "%g apart: %.100s", gap, why);
    }
    cell_close(c, &s);
    world_free(&w);
}

void stability_narrow_slab(cell *c)
{
    const double gaps[] = {2.0, 1.5, 1.0};
    for (size_t k = 0; k < sizeof gaps / sizeof *gaps && c->verdict == PASS; k++)
        fall_between_plates(c, gaps[k]);
}

/* ---- Driven walls ------------------------------------------------------------------------------ */

void stability_paddle(cell *c)
{
    enum { PUSHES = 20 };
    const double begin = 1.0, high[3] = {begin, 16.0, 7.0};
    world w = world_empty(c->dimension, SPACING);
    simulation s = {.world = &w};
    const double push[3] = {0.5 * SPACING / w.scene.time_step, 0.0, 0.0};
    world_box(&w, (double[]){26, 16, 7});
    world_paddle(&w, begin, still, high);
    world_block(&w, (double[]){(begin + 0.5) * SPACING, 0.5 * SPACING, 0.5 * SPACING},
                (int[]){16, 6, 6}, still);
    const double *paddle = w.wall + 3 * (w.scene.wall_count - 1);
    bool good = cell_has_bodies(c) && cell_open(c, &w, &s);
    good = good && cell_drive_body(c, &s, push, still);
    while (good && cell_step(c, &s)) {
        size_t behind = 0;
        for (size_t i = 0; i < s.scene.fluid_count; i++)
            behind += s.position[3 * i] < paddle[0];
        good = behind == 0 || cell_fail(c, "%zu behind it", behind);
        good = good && cell_nothing_escapes(c, &s);
        if (good && s.frame < PUSHES)
            good = cell_drive_body(c, &s, push, still);
    }
    cell_close(c, &s);
    world_free(&w);
}

void stability_turned_tank(cell *c)
{
    enum { TURNS = 100 };
    world w = world_tank(c->dimension, SPACING, (int[]){11, 6, 7}, (double[]){12, 12, 8});
    simulation s = {.world = &w};
    const double spin[3] = {0.0, 0.0, 0.5 * PI / TURNS / w.scene.time_step};
    world_all_moves(&w, (double[]){6 * SPACING, 6 * SPACING, 4 * SPACING});
    bool good = cell_has_bodies(c) && cell_open(c, &w, &s);
    good = good && cell_drive_body(c, &s, still, spin);
    while (good && cell_step(c, &s)) {
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, 2.0 * FALL);
        if (good && s.frame < TURNS)
            good = cell_drive_body(c, &s, still, spin);
    }
    cell_close(c, &s);
    world_free(&w);
}

/* ---- Fluid that comes -------------------------------------------------------------------------- */

/* A tap of the library beside any method: a particle set that is filled with the method's fluid, and what the
 * tap adds to it is given to the method. */
typedef struct faucet {
    ascc_context *context;
    ascc_particles *particles;
    ascc_tap tap;
    double nearest; /* pair so far, spacings */
} faucet;

enum { MOST_PLACES = 64 };

static bool open_faucet(cell *c, const world *w, faucet *f)
{
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = w->scene.dimension,
                                            .spacing = w->scene.spacing,
                                            .mass = w->scene.mass};
    return (ascc_context_create(NULL, &f->context) == ASCC_OK &&
            ascc_particles_create(f->context, &options, &f->particles) == ASCC_OK) ||
           cell_fail(c, "no memory for the tap");
}

static void close_faucet(faucet *f)
{
    ascc_particles_destroy(&f->particles);
    ascc_context_destroy(&f->context);
}

static bool run_faucet(cell *c, simulation *s, faucet *f)
{
    const ptrdiff_t row = 3 * sizeof(double);
    const size_t before = s->scene.fluid_count;
    const ascc_const_array fluid = {.data = s->position, .stride = row, .scalar = ASCC_DOUBLE};
    double x[3 * MOST_PLACES] = {0}, v[3 * MOST_PLACES] = {0};
    const ascc_array position = {.data = x, .stride = row, .scalar = ASCC_DOUBLE};
    const ascc_array velocity = {.data = v, .stride = row, .scalar = ASCC_DOUBLE};
    uint64_t ids[MOST_PLACES];
    size_t came = 0;
    ascc_status status = ascc_particles_clear(f->particles, ASCC_FLUID);
    if (status == ASCC_OK)
        status = ascc_particles_add_fluid(f->particles, before, &fluid, NULL, NULL, NULL);
    if (status == ASCC_OK)
        status = ascc_tap_run(f->particles, &f->tap, s->scene.time_step, MOST_PLACES, ids, &came);
    if (status == ASCC_OK)
        status =
            ascc_particles_get(f->particles, ASCC_FLUID, ASCC_POSITION, before, came, &position);
    if (status == ASCC_OK)
        status =
            ascc_particles_get(f->particles, ASCC_FLUID, ASCC_VELOCITY, before, came, &velocity);
    if (status != ASCC_OK)
        return cell_fail(c, "tap: %.100s", ascc_particles_message(f->particles));
    return came == 0 || cell_add_fluid(c, s, came, x, v);
}

/* Of the fluid that has all its neighbours: two spacings and a half off walls and surface. */
static double inner_density(const simulation *s)
{
    const double top = 2.0 * cell_motion(s).center[1] - 0.5 * SPACING;
    const double low[3] = {2.5 * SPACING, 2.5 * SPACING, 2.5 * SPACING};
    const double high[3] = {6.5 * SPACING, top - 2.5 * SPACING, 6.5 * SPACING};
    return cell_density_between(s, low, high);
}

/* That of a tank, mean over the last tenth of the frames; what comes in on the way is let in. */
static double tank_density(cell *c, world *w, faucet *f)
{
    simulation s = {.world = w};
    const size_t first = w->scene.fluid_count;
    double density = 0.0;
    bool good = cell_open(c, w, &s) && (!f || run_faucet(c, &s, f));
    while (good && cell_step(c, &s)) {
        const double due = f ? f->tap.rate * w->scene.time_step * (double)s.frame : 0.0;
        good = cell_nothing_escapes(c, &s);
        if (f)
            f->nearest = fmin(f->nearest, cell_nearest_pair(&s) / SPACING);
        if (good && f && !(f->nearest >= 0.2))
            good = cell_fail(c, "nearest pair %.2g spacings", f->nearest);
        if (good && !(fabs((double)(w->scene.fluid_count - first) - due) < 1.0 + 1e-6))
            good = cell_fail(c, "%zu came, of %.0f", w->scene.fluid_count - first, due);
        if (s.frame > c->frames - c->frames / 10)
            density += inner_density(&s) / (double)(c->frames / 10);
        good = good && (!f || run_faucet(c, &s, f));
    }
    good = good && cell_complete(c, &s);
    cell_close(c, &s);
    return good ? density : (double)NAN;
}

/* The water that a tap brings is in the end as dense as that of a tank that had it from the beginning. */
void stability_tap(cell *c)
{
    const double edges[3] = {9, 24, 9};
    world w = world_tank(c->dimension, SPACING, (int[]){8, 4, 8}, edges);
    faucet f = {.tap = {.size = sizeof f.tap,
                        .position = {4.5 * SPACING, 18 * SPACING, 4.5 * SPACING},
                        .radius = 2 * SPACING,
                        .velocity = {0.0, -1.0, 0.0},
                        .rate = c->dimension == 2 ? 8.0 : 40.0},
                .nearest = (double)INFINITY};
    f.tap.position[2] *= c->dimension == 3;
    bool good = cell_takes_fluid(c) && open_faucet(c, &w, &f);
    const double density = good ? tank_density(c, &w, &f) : (double)NAN;
    const int layers = (int)(w.scene.fluid_count / (c->dimension == 2 ? 8 : 64));
    world poured = world_tank(c->dimension, SPACING, (int[]){8, layers, 8}, edges);
    if (c->verdict == PASS) {
        const double rest = tank_density(c, &poured, NULL);
        if (c->verdict == PASS && !(fabs(density - rest) <= 0.03 * rest))
            cell_fail(c, "mean density %.2f, %.2f at rest", density, rest);
        cell_say(c, "density %.2f, %.2f at rest, nearest pair %.2g spacings", density, rest,
                 f.nearest);
    }
    close_faucet(&f);
    world_free(&poured);
    world_free(&w);
}
