/* The scenes of the stability suite: each where methods like these are known to fail, each with a pass
 * line that is a number. SPDX-License-Identifier: MIT
 *
 * A scene makes a world, steps a simulation of it as long as the cell lets it, and fails the cell where
 * the line is crossed.
 */
#include "suite.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static const double still[3] = {0.0, 0.0, 0.0};

static world dam(const cell *c, double spacing)
{
    return world_tank(c->dimension, spacing, (int[]){7, 8, 7}, (double[]){24, 14, 8});
}

static world column(const cell *c)
{
    return world_tank(c->dimension, SPACING, (int[]){6, 10, 6}, (double[]){7, 16, 7});
}

/* ---- A dam break, as it is and with what nobody trained -------------------------------------- */

/* Kinetic energy may exceed the potential energy released by 5 % of what there is to release. */
static void break_dam(cell *c, world w)
{
    simulation s;
    bool good = cell_open(c, &w, &s);
    const double start = cell_motion(&s).potential;
    while (good && cell_step(c, &s)) {
        const ascc_measure_motion_sums m = cell_motion(&s);
        good = cell_nothing_escapes(c, &s) && cell_nothing_clumps(c, &s);
        if (good && m.kinetic > start - m.potential + 0.05 * start)
            good = cell_fail(c, "energy %+.0f %% of the potential",
                             100.0 * (m.kinetic + m.potential - start) / start);
    }
    cell_close(c, &s);
    world_free(&w);
}

static void dam_break(cell *c)
{
    break_dam(c, dam(c, SPACING));
}

static void short_step(cell *c)
{
    world w = dam(c, SPACING);
    w.scene.time_step *= 0.5;
    break_dam(c, w);
}

static void long_step(cell *c)
{
    world w = dam(c, SPACING);
    w.scene.time_step *= 2.0;
    break_dam(c, w);
}

static void fine(cell *c)
{
    break_dam(c, dam(c, 0.5 * SPACING));
}

static void coarse(cell *c)
{
    break_dam(c, dam(c, 2.0 * SPACING));
}

/* ---- At rest --------------------------------------------------------------------------------- */

static void still_column(cell *c)
{
    world w = column(c);
    simulation s;
    bool good = cell_open(c, &w, &s);
    double kinetic = 0.0;                  /* greatest in the last tenth */
    double middle = NAN, dense_then = NAN; /* height and mean density half way */
    while (good && cell_step(c, &s)) {
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, FALL);
        if (s.frame == c->frames / 2) {
            middle = cell_motion(&s).center[1];
            dense_then = cell_density(&s);
        }
        if (s.frame > c->frames - c->frames / 10)
            kinetic = fmax(kinetic, cell_motion(&s).kinetic);
    }
    if (good && cell_complete(c, &s)) {
        const ascc_measure_motion_sums m = cell_motion(&s);
        const double change = m.center[1] / middle - 1.0;
        const double drift = cell_density(&s) / dense_then - 1.0;
        if (!(fabs(change) < 0.01))
            cell_fail(c, "height %+.1f %% in the second half", 100.0 * change);
        else if (!(fabs(drift) < 0.01))
            cell_fail(c, "mean density %+.1f %% in the second half", 100.0 * drift);
        else if (kinetic > 1e-4 * m.potential)
            cell_fail(c, "kinetic / potential %.1e", kinetic / m.potential);
    }
    cell_close(c, &s);
    world_free(&w);
}

/* ---- Without gravity ------------------------------------------------------------------------- */

static double distance(const double a[3], const double b[3])
{
    return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
                (a[2] - b[2]) * (a[2] - b[2]));
}

static double farthest(const simulation *s, const double from[3])
{
    double most = 0.0;
    for (size_t i = 0; i < s->world->scene.fluid_count; i++)
        most = fmax(most, distance(s->position + 3 * i, from));
    return most;
}

static void blob(cell *c)
{
    world w = world_empty(c->dimension, SPACING);
    simulation s;
    w.scene.gravity[1] = 0.0;
    world_block(&w, (double[]){-4 * SPACING, -4 * SPACING, -4 * SPACING}, (int[]){8, 8, 8}, still);
    bool good = cell_open(c, &w, &s);
    const double reach = farthest(&s, still);
    while (good && cell_step(c, &s)) {
        const ascc_measure_motion_sums m = cell_motion(&s);
        if (distance(m.center, still) > 1e-5 * SPACING)
            good = cell_fail(c, "centre moved %.1e spacings", distance(m.center, still) / SPACING);
        else if (farthest(&s, m.center) > reach + SPACING)
            good = cell_fail(c, "spread by more than a spacing");
    }
    cell_close(c, &s);
    world_free(&w);
}

static void rotating_drop(cell *c)
{
    const double omega = 2.0;
    world w = world_empty(c->dimension, SPACING);
    simulation s;
    w.scene.gravity[1] = 0.0;
    world_ball(&w, 4 * SPACING);
    for (size_t i = 0; i < w.scene.fluid_count; i++) {
        w.velocity[3 * i] = -omega * w.position[3 * i + 1];
        w.velocity[3 * i + 1] = omega * w.position[3 * i];
    }
    bool good = cell_open(c, &w, &s);
    const double start = cell_motion(&s).angular_about_center[2];
    while (good && cell_step(c, &s)) {
        const double change = cell_motion(&s).angular_about_center[2] / start - 1.0;
        good = fabs(change) < 0.01 || cell_fail(c, "angular momentum %+.1f %%", 100.0 * change);
    }
    cell_close(c, &s);
    world_free(&w);
}

/* ---- Turned and mirrored --------------------------------------------------------------------- */

static void map_back(simulation *s, world_map *back)
{
    for (size_t i = 0; i < s->world->scene.fluid_count; i++) {
        back(s->position + 3 * i);
        back(s->velocity + 3 * i);
    }
}

/* Fails where the second run, mapped back, is not like the first. */
static void compare(cell *c, const simulation *s, const simulation *t)
{
    ascc_measure_set a = {.dimension = 3, .count = s->world->scene.fluid_count}, b = a;
    double there = NAN, back = NAN;
    a.position = s->position;
    b.position = t->position;
    (void)ascc_measure_chamfer(&a, &b, 1, &there, &back);
    const double kinetic = cell_motion(t).kinetic / cell_motion(s).kinetic - 1.0;
    if (!(fmax(there, back) < 0.25 * SPACING))
        cell_fail(c, "Chamfer %.2g spacings", fmax(there, back) / SPACING);
    else if (!(fabs(kinetic) < 0.1))
        cell_fail(c, "kinetic energy %+.0f %%", 100.0 * kinetic);
}

static void mapped(cell *c, world_map *map, world_map *back)
{
    world w = dam(c, SPACING), other = world_copy(&w);
    simulation s, t;
    world_apply(&other, map);
    bool good = cell_open(c, &w, &s);
    good = cell_open(c, &other, &t) && good;
    while (good && cell_step(c, &s) && cell_step(c, &t))
        ;
    if (good && s.frame > 0 && s.frame == t.frame && c->verdict != FAIL) {
        map_back(&t, back);
        compare(c, &s, &t);
    }
    cell_close(c, &s);
    cell_close(c, &t);
    world_free(&w);
    world_free(&other);
}

static void sideways(cell *c)
{
    if (c->dimension == 2)
        mapped(c, world_swap, world_swap);
    else
        mapped(c, world_turn, world_turn_back);
}

static void reversed(cell *c)
{
    mapped(c, world_flip, world_flip);
}

/* ---- Same bits ------------------------------------------------------------------------------- */

/* Row i of the first is row n - 1 - i of the second, or row i. */
static bool same_bits(cell *c, const simulation *s, const simulation *t, bool reverse)
{
    const size_t n = s->world->scene.fluid_count;
    for (size_t i = 0; i < n; i++) {
        const size_t j = reverse ? n - 1 - i : i;
        if (memcmp(s->position + 3 * i, t->position + 3 * j, 3 * sizeof(double)) != 0)
            return cell_fail(c, "other bits, by %.1e spacings",
                             distance(s->position + 3 * i, t->position + 3 * j) / SPACING);
    }
    return true;
}

static void bits(cell *c, world *w, world *other, bool reverse)
{
    simulation s, t;
    bool good = cell_open(c, w, &s);
    good = cell_open(c, other, &t) && good;
    while (good && cell_step(c, &s) && cell_step(c, &t))
        good = same_bits(c, &s, &t, reverse);
    cell_close(c, &s);
    cell_close(c, &t);
    world_free(w);
    world_free(other);
}

static void order(cell *c)
{
    world w = dam(c, SPACING), other = world_copy(&w);
    const size_t n = w.scene.fluid_count;
    for (size_t i = 0; i < n; i++)
        memcpy(other.position + 3 * i, w.position + 3 * (n - 1 - i), 3 * sizeof(double));
    bits(c, &w, &other, true);
}

static void far_particle(cell *c)
{
    world w = dam(c, SPACING), other = world_copy(&w);
    world_add(&other, (double[]){500.0 * SPACING, 1.0, 0.0}, still);
    bits(c, &w, &other, false);
}

/* ---- Pressure must arrive -------------------------------------------------------------------- */

#define BAR 24    /* layers of the bar that is pushed */
#define PISTON 6  /* of them, those that push */
#define SECTION 5 /* particles along an edge of its cross section */

/* A bar of fluid at rest in a tube with open ends, without gravity; its first layers may move. It all
 * but fills the tube, else it would give way sideways: 3/4 of a spacing off the walls is between where
 * lattices begin (1/2) and where the fluid rests that networks learn from (0.9). */
static world bar(const cell *c, double speed)
{
    world w = world_empty(c->dimension, SPACING);
    w.scene.gravity[1] = 0.0;
    world_tube(&w, (double[]){BAR + 8, SECTION + 0.5, SECTION + 0.5});
    world_block(&w, (double[]){0.0, 0.25 * SPACING, 0.25 * SPACING}, (int[]){BAR, SECTION, SECTION},
                still);
    for (size_t i = 0; i < w.scene.fluid_count; i++)
        if (i % BAR < PISTON)
            w.velocity[3 * i] = speed;
    return w;
}

/* Mean x of the last two layers. */
static double far_end(const simulation *s)
{
    double sum = 0.0;
    for (size_t i = 0; i < s->world->scene.fluid_count; i++)
        sum += i % BAR >= BAR - 2 ? s->position[3 * i] : 0.0;
    return sum / (2.0 * (double)s->scene.fluid_count / BAR);
}

/* What the same bar does without the push is taken off: what moves by itself is no arrival. */
static void piston(cell *c)
{
    world w = bar(c, 0.0), pushed = bar(c, 2.0);
    simulation s, t;
    long arrival = 0;
    double moved = 0.0;
    bool good = cell_open(c, &w, &s);
    good = cell_open(c, &pushed, &t) && good;
    const double start = far_end(&s);
    while (good && cell_step(c, &s) && cell_step(c, &t)) {
        const double alone = far_end(&s) - start;
        if (fabs(alone) > 2.0 * SPACING)
            good = cell_fail(c, "far end moves %+.1f spacings without a push", alone / SPACING);
        moved = far_end(&t) - far_end(&s);
        arrival = !arrival && moved > 0.1 * SPACING ? s.frame : arrival;
    }
    if (good && cell_complete(c, &t) && !arrival)
        cell_fail(c, "far end moved by %.2g spacings", moved / SPACING);
    cell_say(c, "after %ld frames", arrival);
    cell_close(c, &s);
    cell_close(c, &t);
    world_free(&w);
    world_free(&pushed);
}

/* ---- Violence -------------------------------------------------------------------------------- */

static void jet(cell *c)
{
    const double half = 12.0 * SPACING;
    world w = world_empty(c->dimension, SPACING);
    simulation s;
    w.scene.gravity[1] = 0.0;
    world_sheet(&w, half);
    /* 20 radii a step */
    world_block(&w, (double[]){11 * SPACING, -2 * SPACING, -2 * SPACING}, (int[]){8, 4, 4},
                (double[]){-10.0 * SPACING / w.scene.time_step, 0.0, 0.0});
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s)) {
        size_t through = 0;
        for (const double *x = s.position; x < s.position + 3 * w.scene.fluid_count; x += 3)
            through += x[0] < -0.5 * SPACING && fabs(x[1]) < half && fabs(x[2]) < half;
        good = through == 0 || cell_fail(c, "%zu of %zu through", through, w.scene.fluid_count);
    }
    cell_close(c, &s);
    world_free(&w);
}

static void emission(cell *c)
{
    world w = column(c);
    simulation s;
    /* the middle of the lattice's cells, where there is fluid */
    world_block(&w, (double[]){2 * SPACING, 4 * SPACING, 2 * SPACING}, (int[]){2, 2, 2}, still);
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, FALL);
    cell_close(c, &s);
    world_free(&w);
}

static void coincident(cell *c)
{
    world w = column(c);
    simulation s;
    memcpy(w.position, w.position + 3, 3 * sizeof(double));
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, FALL);
    cell_close(c, &s);
    world_free(&w);
}

static void single(cell *c)
{
    world w = column(c);
    simulation s;
    w.scene.fluid_count = 0;
    world_add(&w, (double[]){3 * SPACING, 12 * SPACING, 3 * SPACING}, still);
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, FALL);
    cell_close(c, &s);
    world_free(&w);
}

/* ---- Shapes that are hard to hold ------------------------------------------------------------ */

static void thin_film(cell *c)
{
    world w = world_tank(c->dimension, SPACING, (int[]){11, 1, 11}, (double[]){12, 6, 12});
    simulation s;
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s)) {
        double highest = 0.0;
        for (size_t i = 0; i < w.scene.fluid_count; i++)
            highest = fmax(highest, s.position[3 * i + 1]);
        good = cell_nothing_escapes(c, &s) && cell_nothing_clumps(c, &s);
        if (good && highest > 2.0 * SPACING)
            good = cell_fail(c, "rises to %.3g spacings", highest / SPACING);
    }
    cell_close(c, &s);
    world_free(&w);
}

static void sharp_edge(cell *c)
{
    world w = world_empty(c->dimension, SPACING);
    simulation s;
    world_box(&w, (double[]){14, 16, 8});
    world_wedge(&w, 7.0, 2.5, 7.0, 8.0);
    world_block(&w, (double[]){4 * SPACING, 9 * SPACING, 0.5 * SPACING}, (int[]){6, 6, 7}, still);
    bool good = cell_open(c, &w, &s);
    while (good && cell_step(c, &s))
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, 2.0 * FALL);
    cell_close(c, &s);
    world_free(&w);
}

/* ---- The table ------------------------------------------------------------------------------- */

#define DAM                                                                                        \
    "no escape; pairs below spacing / 5 at most 0.1 %; kinetic at most what was released + 5 % "   \
    "of what there is"

const stability_scene stability_scenes[] = {
    {"dam break", DAM, 60, 3200, dam_break},
    {"dt x 0.5", DAM, 40, 400, short_step},
    {"dt x 2", DAM, 40, 400, long_step},
    {"spacing x 0.5", DAM, 40, 400, fine},
    {"spacing x 2", DAM, 40, 400, coarse},
    {"still column",
     "no escape; height of the centre and mean density change by less than 1 % in the "
     "second half; kinetic / potential below 1e-4 in the last tenth",
     200, 10000, still_column},
    {"zero gravity blob", "centre fixed to 1e-5 spacings, reach grows by less than a spacing", 60,
     1000, blob},
    {"rotating drop", "angular momentum within 1 %", 60, 500, rotating_drop},
    {"sideways gravity",
     "as the turned run: Chamfer below spacing / 4, kinetic energy within 10 % at the end", 20, 20,
     sideways},
    {"reversed gravity", "as the mirrored run: the same line", 20, 20, reversed},
    {"particle order", "reversed order of particles: same bits", 10, 50, order},
    {"far particle", "one particle 1,000 radii away: others' bits the same", 10, 50, far_particle},
    {"far-end piston",
     "6 of 24 layers in a tube move at 2 m/s: within 12 frames the far end moves spacing / 10 more "
     "than without them; without them at most 2 spacings",
     12, 12, piston},
    {"jet at a sheet", "20 radii a step at one layer of wall points: nothing through", 10, 20, jet},
    {"emission",
     "8 particles where fluid is: no escape, nothing faster than a fall through the box", 20, 200,
     emission},
    {"coincident", "two particles in one place: the same line", 20, 200, coincident},
    {"single particle", "one particle falls: the same line", 40, 200, single},
    {"thin film",
     "one layer on the floor: no escape; pairs below spacing / 5 at most 0.1 %; nothing a spacing "
     "higher than it began",
     40, 400, thin_film},
    {"sharp edge",
     "a block falls on a wedge of 39 degrees: no escape, nothing twice as fast as a fall through "
     "the box",
     40, 200, sharp_edge},
    {"light body",
     "a cube of half the fluid's density (2D: its points behind its surface as docs/bodies.md "
     "says), held, then free for as long: no escape, up by a spacing",
     40, 200, stability_light_body},
    {"heavy body", "twice the density: down, by at most 0.8 of a free fall", 40, 200,
     stability_heavy_body},
    {"held box",
     "a cube of 4 spacings, its points 0.6 spacings (2D: 1, to reference solvers 0.5) behind its "
     "surface: no escape; in the last third it receives the weight of as much water within 5 %",
     150, 300, stability_held_box},
    {"thin cup",
     "a cup of one sheet in water, fuller than the water around it: nothing in, nothing out, "
     "nothing "
     "faster than a fall through the box",
     40, 400, stability_thin_cup},
    {"narrow slab",
     "one layer between plates 1, 1.5 and 2 spacings apart: falls by 2 spacings, no escape, "
     "nothing "
     "twice as fast as the fall",
     40, 200, stability_narrow_slab},
    {"paddle",
     "a plate across the tank goes 10 spacings in 20 frames: nothing behind it, no escape", 40, 200,
     stability_paddle},
    {"turned tank",
     "half full, a quarter turn in 100 frames: no escape, nothing twice as fast as a fall through "
     "the box",
     40, 200, stability_turned_tank},
    {"tap",
     "fluid falls into a tank: no escape; as many as the rate says; no pair ever nearer than "
     "spacing / 5; "
     "in the end mean density within 3 % of that of as much fluid that was there from the "
     "beginning, "
     "away from walls and surface",
     200, 500, stability_tap},
    {"sleep and wake",
     "a pool may sleep: all of it does by half of the frames, then stays to the bit; a plate that "
     "goes 2 "
     "spacings in 20 frames wakes a half at least; no escape, nothing half as fast as a fall "
     "through the box",
     200, 600, stability_sleep_and_wake},
    {"pool with a drop",
     "a drop falls on a pool of which some fell asleep in half of the frames: nothing faster by a "
     "tenth than "
     "in the same pool awake, no escape, no pair in 1,000 below spacing / 5",
     200, 400, stability_pool_with_a_drop},
    {"budget",
     "a dam breaks, in the middle third of the frames with half of what they may cost, pbf below: "
     "changes to it and "
     "back, no frame beyond the budget, no escape, pairs below spacing / 5 at most 0.1 %, nothing "
     "faster after a "
     "change than before, nor than half of a fall through the box",
     180, 600, stability_budget},
    {"seam",
     "water slides through a trough, half of it computed by the model, half by pbf: density (of "
     "rest) and speed (of "
     "the fastest) of slices of 2 spacings within 3 % of what either model makes alone, or between "
     "the two",
     60, 60, stability_seam},
    {NULL, NULL, 0, 0, NULL},
};
