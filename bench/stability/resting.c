/* Scenes of the stability suite whose fluid may fall asleep. SPDX-License-Identifier: MIT */
#include "suite.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define SLEEP_SPEED 0.5
#define STILL_FRAMES 10 /* that a sleeping pool is looked at */

static const double still[3] = {0.0, 0.0, 0.0};

static double fastest(const simulation *s, size_t count)
{
    double square = 0.0;
    for (size_t i = 0; i < count; i++) {
        const double *v = s->velocity + 3 * i;
        square = fmax(square, v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
    }
    return sqrt(square);
}

/* ---- A pool sleeps until a plate moves --------------------------------------------------------- */

/* Runs to half of the frames and STILL_FRAMES more: all sleeps, and nothing moves. */
static bool falls_asleep(cell *c, simulation *s)
{
    const size_t size = 3 * s->scene.fluid_count * sizeof *s->position;
    double *before = NULL;
    bool good = true;
    while (good && s->frame < c->frames / 2)
        good = cell_step(c, s) && cell_nothing_escapes(c, s);
    if (good && cell_asleep(c, s) < 1.0)
        good = cell_fail(c, "%.0f %% asleep at half", 100.0 * cell_asleep(c, s));
    if (good && !(before = malloc(size)))
        good = cell_fail(c, "no memory");
    if (good)
        memcpy(before, s->position, size);
    for (int n = 0; n < STILL_FRAMES && good; n++)
        good = cell_step(c, s);
    if (good && memcmp(before, s->position, size) != 0)
        good = cell_fail(c, "moves asleep");
    free(before);
    return good;
}

void stability_sleep_and_wake(cell *c)
{
    enum { PUSHES = 20 };
    const double begin = 1.0, high[3] = {begin, 14.0, 11.0};
    world w = world_empty(c->dimension, SPACING);
    simulation s = {.world = &w};
    const double push[3] = {0.1 * SPACING / w.scene.time_step, 0.0, 0.0};
    double least = 1.0;
    world_box(&w, (double[]){13, 14, 11});
    world_paddle(&w, begin, still, high);
    world_block(&w, (double[]){(begin + 0.5) * SPACING, 0.5 * SPACING, 0.5 * SPACING},
                (int[]){11, 6, 10}, still);
    w.scene.sleep_speed = SLEEP_SPEED;
    bool good = cell_sleeps(c) && cell_has_bodies(c) && cell_open(c, &w, &s);
    good = good && falls_asleep(c, &s);
    const long woken = s.frame;
    good = good && cell_drive_body(c, &s, push, still);
    while (good && cell_step(c, &s)) {
        least = fmin(least, cell_asleep(c, &s));
        good = cell_nothing_escapes(c, &s) && cell_slower_than(c, &s, 0.5 * FALL);
        if (good && s.frame < woken + PUSHES)
            good = cell_drive_body(c, &s, push, still);
    }
    if (good && cell_complete(c, &s) && !(least <= 0.5))
        cell_fail(c, "%.0f %% sleep on", 100.0 * least);
    cell_close(c, &s);
    world_free(&w);
}

/* ---- A drop falls on it ------------------------------------------------------------------------ */

/* A drop of 4 particles along each axis, let go where a pool had half of the frames to come to rest: what the pool's
 * fastest particle makes after that, m/s. */
static double fastest_after_drop(cell *c, double sleep_speed, double *asleep)
{
    enum { DROP = 4 };
    world w = world_tank(c->dimension, SPACING, (int[]){11, 7, 11}, (double[]){12, 24, 12});
    world drop = world_empty(c->dimension, SPACING);
    simulation s = {.world = &w};
    const size_t pool = w.scene.fluid_count;
    double most = 0.0;
    world_block(&drop, (double[]){4 * SPACING, 12 * SPACING, 4 * SPACING},
                (int[]){DROP, DROP, DROP}, still);
    w.scene.sleep_speed = sleep_speed;
    bool good = cell_open(c, &w, &s);
    while (good && s.frame < c->frames / 2)
        good = cell_step(c, &s) && cell_nothing_escapes(c, &s);
    *asleep = good ? cell_asleep(c, &s) : 0.0;
    if (good && sleep_speed > 0.0 && !(*asleep > 0.0))
        good = cell_fail(c, "none asleep at half");
    good = good && cell_add_fluid(c, &s, drop.scene.fluid_count, drop.position, drop.velocity);
    while (good && cell_step(c, &s)) {
        most = fmax(most, fastest(&s, pool));
        good = cell_nothing_escapes(c, &s) && cell_nothing_clumps(c, &s);
    }
    good = good && cell_complete(c, &s);
    cell_close(c, &s);
    world_free(&drop);
    world_free(&w);
    return good ? most : (double)NAN;
}

void stability_pool_with_a_drop(cell *c)
{
    double asleep, none;
    if (!cell_sleeps(c) || !cell_takes_fluid(c))
        return;
    const double slept = fastest_after_drop(c, SLEEP_SPEED, &asleep);
    const double awake = c->verdict == PASS ? fastest_after_drop(c, 0.0, &none) : (double)NAN;
    if (c->verdict == PASS && !(slept <= 1.1 * awake))
        cell_fail(c, "%.2f m/s, %.2f awake", slept, awake);
    cell_say(c, "%.0f %% slept; %.2f m/s, %.2f awake", 100.0 * asleep, slept, awake);
}
