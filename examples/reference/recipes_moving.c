/* Scenes whose solids move: paddles, turning tanks, bodies that float and sink; in 2D and 3D.
 * SPDX-License-Identifier: MIT
 *
 * Lengths are in units of 40 spacings of the usual size in 2D (0.5 m) and 20 in 3D (1 m). Solids that move keep two
 * spacings from others, since nothing but water pushes them.
 */
#include <math.h>
#include <string.h>

#include "recipe_maker.h"

static double unit_of(const recipe *r)
{
    return r->dimension == 2 ? 0.5 : 1.0;
}

static double draw(maker *m, double low, double high)
{
    return maker_chance(&m->state, low, high);
}

/* A length between so many units, a multiple of the spacing. */
static double length(maker *m, double low, double high)
{
    return rint(unit_of(m->r) * draw(m, low, high) / m->r->spacing) * m->r->spacing;
}

static double side(const recipe *r, int c)
{
    return 2.0 * r->solids[0].half[c];
}

static void down(recipe *r)
{
    memset(r->gravity, 0, sizeof r->gravity);
    r->gravity[1] = -9.81;
}

/* The room filled to a level around what is in it; it settles before the first frame. */
static void pool(maker *m, double level)
{
    recipe *r = m->r;
    body b = {.shape = SHAPE_BOX};
    maker_straight(&b);
    for (int c = 0; c < r->dimension; c++) {
        const double high = c == 1 ? level : side(r, c);
        b.center[c] = b.half[c] = 0.5 * high;
        b.half[c] += 1e-6 * r->spacing;
    }
    maker_fill(m, &b);
    r->settle = 1.5 * unit_of(r);
    memcpy(r->settle_gravity, r->gravity, sizeof r->gravity);
    maker_say(m, ", pool %.3f deep", level);
}

/* The room's next solid and its motion. */
static solid *next(recipe *r, recipe_motion **motion)
{
    *motion = &r->motion[r->solid_count];
    return &r->solids[r->solid_count++];
}

void make_paddle(maker *m)
{
    recipe *r = m->r;
    const double h = r->spacing, level = length(m, 0.3, 0.5);
    maker_room(r, length(m, 1.3, 1.9), level + length(m, 0.4, 0.6), length(m, 0.4, 0.7));
    down(r);
    recipe_motion *motion;
    solid *s = next(r, &motion);
    *motion = (recipe_motion){.kind = RIGID_DRIVEN,
                              .reach = length(m, 0.08, 0.2),
                              .rate = draw(m, 2.0, 6.0) / sqrt(unit_of(r))};
    *s = (solid){.kind = SOLID_BOX};
    s->half[0] = 1.5 * h;
    s->half[1] = 0.5 * (level + length(m, 0.1, 0.2) - 2.0 * h);
    s->half[2] = r->solids[0].half[2] - 2.0 * h;
    s->center[0] = length(m, 0.2, 0.4) + 2.0 * h;
    s->center[1] = 2.0 * h + s->half[1];
    s->center[2] = r->solids[0].center[2];
    maker_say(m, "room %.3f x %.3f, plate at %.3f that goes %.3f to and fro at %.2f 1/s",
              side(r, 0), side(r, 1), s->center[0], 2.0 * motion->reach, motion->rate);
    pool(m, level);
    maker_speed(r, motion->reach * motion->rate, 1.5);
}

void make_turning(maker *m)
{
    recipe *r = m->r;
    const double high = length(m, 0.7, 1.1);
    maker_room(r, length(m, 0.7, 1.1), high, length(m, 0.4, 0.8));
    down(r);
    r->motion[0] = (recipe_motion){.kind = RIGID_DRIVEN,
                                   .spin = draw(m, 1.0, 4.0) / sqrt(unit_of(r)) *
                                           (maker_choose(&m->state, 0, 1) ? 1.0 : -1.0),
                                   .spin_up = 0.2};
    maker_say(m, "room %.3f x %.3f that turns at %.2f 1/s", side(r, 0), side(r, 1),
              r->motion[0].spin);
    pool(m, rint(high * draw(m, 0.3, 0.6) / r->spacing) * r->spacing);
    maker_speed(r, fabs(r->motion[0].spin) * high, 1.5);
}

/* A free body of so much of water's density, `above` its own size over the surface. */
static void free_body(maker *m, double level, double density, double above)
{
    recipe *r = m->r;
    recipe_motion *motion;
    solid *s = next(r, &motion);
    *motion = (recipe_motion){.kind = RIGID_FREE, .density = 1000.0 * density};
    *s = (solid){.kind = maker_choose(&m->state, 0, 1) ? SOLID_BOX : SOLID_BALL};
    s->radius = length(m, 0.12, 0.2);
    for (int c = 0; c < r->dimension; c++) {
        s->half[c] = length(m, 0.1, 0.2);
        s->center[c] = r->solids[0].center[c];
    }
    s->center[1] = level + above * (s->kind == SOLID_BOX ? s->half[1] : s->radius);
    maker_say(m, ", %s of density %.2f at height %.3f", s->kind == SOLID_BOX ? "box" : "ball",
              density, s->center[1]);
}

static void tank(maker *m, double level)
{
    const double width = length(m, 0.8, 1.1);
    maker_room(m->r, width, level + length(m, 0.6, 0.8), width);
    down(m->r);
    maker_say(m, "tank %.3f wide", width);
}

void make_floating(maker *m)
{
    const double level = length(m, 0.4, 0.7);
    tank(m, level);
    free_body(m, level, draw(m, 0.2, 0.8), draw(m, -0.5, 1.5));
    pool(m, level);
    maker_speed(m->r, 0.0, 1.5);
}

void make_sinking(maker *m)
{
    const double level = length(m, 0.9, 1.2);
    tank(m, level);
    free_body(m, level, draw(m, 1.5, 4.0), draw(m, -0.5, 1.0));
    pool(m, level);
    maker_speed(m->r, 0.0, 1.5);
}
