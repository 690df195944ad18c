/* Scenes of the stability suite with a cheaper model below the method's own. SPDX-License-Identifier: MIT */
#include "suite.h"

#include <math.h>
#include <stdlib.h>

static const char *below_of(const cell *c)
{
    return c->dimension == 2 ? "pbf2d" : "pbf3d";
}

/* ---- A budget that is cut while water falls -------------------------------------------------------- */

/* The method's own model costs a particle of the budget, and a rung is taken up to 0.8 of that. */
#define ROOMY 1.4

/* Frames from here to there; none is faster than the fastest before, or half of a fall. */
static bool run_third(cell *c, simulation *s, long end, double *fastest)
{
    const double most = s->frame == 0 ? INFINITY : fmax(*fastest, 0.5 * FALL);
    while (s->frame < end && cell_step(c, s)) {
        *fastest = fmax(*fastest, cell_motion(s).max_speed);
        if (!cell_nothing_escapes(c, s) || !cell_nothing_clumps(c, s) ||
            !cell_slower_than(c, s, most))
            return false;
    }
    return c->verdict == PASS && s->frame >= end;
}

void stability_budget(cell *c)
{
    world w = world_tank(c->dimension, SPACING, (int[]){12, 10, 10}, (double[]){24, 16, 11});
    simulation s = {.world = &w};
    const double all = ROOMY * (double)w.scene.fluid_count;
    double fastest = 0.0;
    bool below = false;
    w.scene.below = below_of(c);
    bool good = cell_has_ladder(c) && cell_open(c, &w, &s) && cell_set_budget(c, &s, all);
    good = good && run_third(c, &s, c->frames / 3, &fastest) && cell_set_budget(c, &s, 0.5 * all);
    if (good && run_third(c, &s, 2 * c->frames / 3, &fastest))
        below = cell_choices(c, &s).below;
    good = good && c->verdict == PASS && cell_set_budget(c, &s, all) &&
           run_third(c, &s, c->frames, &fastest);
    if (good && cell_complete(c, &s)) {
        const ascc_method_choices told = cell_choices(c, &s);
        if (!below || told.below || told.changes != 2)
            cell_fail(c, "%d changes, %s below", (int)told.changes, below ? "then" : "never");
        else if (told.late)
            cell_fail(c, "%d frames beyond the budget", (int)told.late);
    }
    cell_excuse_ladder(c);
    cell_close(c, &s);
    world_free(&w);
}

/* ---- A seam that water crosses --------------------------------------------------------------------- */

enum { TROUGH = 40, SLICE = 2, SLICES = TROUGH / SLICE };
#define BAND 4.0 /* spacings of the ramp between the two */

typedef struct profile {
    double density[SLICES], speed[SLICES];
} profile;

/* Weights: 0, 1, or 1 on the left and a ramp in the middle (negative). */
static bool weigh(cell *c, simulation *s, double weight)
{
    const size_t count = s->scene.fluid_count;
    double *rows = malloc((count + 1) * sizeof *rows);
    for (size_t i = 0; rows && i < count; i++)
        rows[i] =
            weight >= 0.0
                ? weight
                : fmin(1.0, fmax(0.0, 0.5 + (0.5 * TROUGH - s->position[3 * i] / SPACING) / BAND));
    const bool good = rows ? cell_set_detail(c, s, rows) : cell_fail(c, "no memory");
    free(rows);
    return good;
}

/* Adds what a frame shows: densities away from floor and surface, and velocities along the trough. */
static void add_frame(const simulation *s, profile *p)
{
    size_t count[SLICES] = {0};
    double sum[SLICES] = {0.0};
    for (size_t i = 0; i < s->scene.fluid_count; i++) {
        const int k = (int)floor(s->position[3 * i] / SPACING / SLICE);
        if (k < 0 || k >= SLICES)
            continue;
        count[k]++;
        sum[k] += s->velocity[3 * i];
    }
    for (int k = 0; k < SLICES; k++) {
        const double low[3] = {k * SLICE * SPACING, 2 * SPACING, -INFINITY};
        const double high[3] = {(k + 1) * SLICE * SPACING, 5 * SPACING, INFINITY};
        p->density[k] += cell_density_between(s, low, high);
        p->speed[k] += count[k] ? fabs(sum[k]) / (double)count[k] : 0.0;
    }
}

/* Water that slides to and fro, its ends at rest. */
static bool find_profile(cell *c, double weight, profile *p)
{
    static const double pi = 3.14159265358979323846;
    world w =
        world_tank(c->dimension, SPACING, (int[]){TROUGH - 1, 7, 5}, (double[]){TROUGH, 14, 6});
    simulation s = {.world = &w};
    *p = (profile){{0.0}, {0.0}};
    w.scene.below = below_of(c);
    for (size_t i = 0; i < w.scene.fluid_count; i++)
        w.velocity[3 * i] = sin(pi * w.position[3 * i] / (TROUGH * SPACING));
    bool good = cell_open(c, &w, &s) && cell_set_budget(c, &s, 1e-9);
    while (good && weigh(c, &s, weight) && cell_step(c, &s)) {
        add_frame(&s, p);
        good = cell_nothing_escapes(c, &s);
    }
    good = good && cell_complete(c, &s);
    for (int k = 0; k < SLICES; k++) {
        p->density[k] /= (double)c->frames;
        p->speed[k] /= (double)c->frames;
    }
    cell_close(c, &s);
    world_free(&w);
    return good;
}

/* How far a number is from between two others. */
static double outside(double number, double a, double b)
{
    return fmax(0.0, fmax(number - fmax(a, b), fmin(a, b) - number));
}

void stability_seam(cell *c)
{
    profile below, own, both;
    double density = 0.0, speed = 0.0, fastest = 0.0;
    const bool good = cell_has_ladder(c) && find_profile(c, -1.0, &both) &&
                      find_profile(c, 0.0, &below) && find_profile(c, 1.0, &own);
    cell_excuse_ladder(c);
    if (!good)
        return;
    for (int k = 1; k < SLICES - 1; k++) {
        fastest = fmax(fastest, own.speed[k]);
        density = fmax(density, outside(both.density[k], own.density[k], below.density[k]));
        speed = fmax(speed, outside(both.speed[k], own.speed[k], below.speed[k]));
    }
    if (!(density <= 0.03 && speed <= 0.03 * fastest))
        cell_fail(c, "density %.1f %%, speed %.1f %%", 100.0 * density, 100.0 * speed / fastest);
    cell_say(c, "density %.1f %%, speed %.1f %%", 100.0 * density, 100.0 * speed / fastest);
}
