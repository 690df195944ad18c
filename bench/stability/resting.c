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

/* Runs the pool to half of the frames, and leaves in w how it is then. */
static bool comes_to_rest(cell *c, simulation *s, world *w, double *asleep)
{
    const size_t size = 3 * w->scene.fluid_count * sizeof *s->position;
    bool good = true;
    while (good && s->frame < c->frames / 2)
        good = cell_step(c, s) && cell_nothing_escapes(c, s);
    *asleep = good ? cell_asleep(c, s) : 0.0;
    if (good && !(*asleep > 0.0))
        good = cell_fail(c, "none asleep at half");
    if (good) {
        memcpy(w->position, s->position, size);
        memcpy(w->velocity, s->velocity, size);
    }
    return good;
}

/* Lets a drop of 4 particles along each axis fall: what the pool's fastest particle makes after that, m/s. */
static double fastest_after_drop(cell *c, simulation *s)
{
    enum { DROP = 4 };
    world drop = world_empty(c->dimension, SPACING);
    const size_t pool = s->world->scene.fluid_count;
    double most = 0.0;
    world_block(&drop, (double[]){4 * SPACING, 12 * SPACING, 4 * SPACING},
                (int[]){DROP, DROP, DROP}, still);
    bool good = cell_add_fluid(c, s, drop.scene.fluid_count, drop.position, drop.velocity);
    while (good && cell_step(c, s)) {
        most = fmax(most, fastest(s, pool));
        good = cell_nothing_escapes(c, s) && cell_nothing_clumps(c, s);
    }
    good = good && cell_complete(c, s);
    world_free(&drop);
    return good ? most : (double)NAN;
}

/* Into a pool that sleeps, and into the same pool that may not. */
void stability_pool_with_a_drop(cell *c)
{
    world w = world_tank(c->dimension, SPACING, (int[]){11, 7, 11}, (double[]){12, 24, 12});
    world other = world_copy(&w);
    simulation sleeper = {.world = &w}, waker = {.world = &other};
    double asleep = 0.0, slept = (double)NAN, awake = (double)NAN;
    w.scene.sleep_speed = SLEEP_SPEED;
    if (cell_sleeps(c) && cell_takes_fluid(c) && cell_open(c, &w, &sleeper) &&
        comes_to_rest(c, &sleeper, &other, &asleep))
        slept = fastest_after_drop(c, &sleeper);
    if (isfinite(slept) && cell_open(c, &other, &waker)) {
        waker.frame = c->frames / 2;
        awake = fastest_after_drop(c, &waker);
    }
    if (isfinite(awake) && !(slept <= 1.1 * awake))
        cell_fail(c, "%.2f m/s, %.2f awake", slept, awake);
    if (isfinite(awake))
        cell_say(c, "%.0f %% slept; %.2f m/s, %.2f awake", 100.0 * asleep, slept, awake);
    cell_close(c, &sleeper);
    cell_close(c, &waker);
    world_free(&other);
    world_free(&w);
}
