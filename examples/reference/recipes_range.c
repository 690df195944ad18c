/* Scenes over the range that people use: gravity of any direction and strength, obstacles, dams, drops, still and
 * tilted tanks, streams, films, jets, droplets in space, viscosities; in 2D and 3D. SPDX-License-Identifier: MIT
 *
 * Lengths are in units of 40 spacings of the usual size in 2D (0.5 m) and 20 in 3D (1 m).
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

static void room(maker *m, double low, double high)
{
    const double x = length(m, low, high), y = length(m, low, high), z = length(m, low, high);
    maker_room(m->r, x, y, z);
    maker_say(m, "room %.3f x %.3f", x, y);
    if (m->r->dimension == 3)
        maker_say(m, " x %.3f", z);
}

/* A direction, evenly distributed; zeros behind the dimension. */
static void direction(maker *m, double out[3])
{
    double square;
    do {
        square = 0.0;
        for (int c = 0; c < 3; c++) {
            out[c] = c < m->r->dimension ? draw(m, -1.0, 1.0) : 0.0;
            square += out[c] * out[c];
        }
    } while (square > 1.0 || square < 0.01);
    for (int c = 0; c < 3; c++)
        out[c] /= sqrt(square);
}

static void down(recipe *r)
{
    memset(r->gravity, 0, sizeof r->gravity);
    r->gravity[1] = -9.81;
}

/* Any direction; one scene of eight has none, the others up to one and a half times the earth's. */
static void any_gravity(maker *m)
{
    const double size = maker_choose(&m->state, 0, 7) ? draw(m, 1.0, 15.0) : 0.0;
    double way[3];
    direction(m, way);
    for (int c = 0; c < 3; c++)
        m->r->gravity[c] = size * way[c];
    maker_say(m, ", gravity %.2f along (%.2f, %.2f, %.2f)", size, way[0], way[1], way[2]);
}

/* Water in a box between two corners, all of one velocity. */
static void block(maker *m, const double low[3], const double high[3], const double velocity[3])
{
    body b = {.shape = SHAPE_BOX};
    maker_straight(&b);
    for (int c = 0; c < m->r->dimension; c++) {
        b.center[c] = 0.5 * (low[c] + high[c]);
        b.half[c] = 0.5 * (high[c] - low[c]) + 1e-6 * m->r->spacing;
        b.velocity[c] = velocity ? velocity[c] : 0.0;
    }
    maker_fill(m, &b);
}

/* The room filled to a level; it settles before the first frame. */
static void pool(maker *m, double level)
{
    const recipe *r = m->r;
    const double low[3] = {0}, high[3] = {side(r, 0), level, side(r, 2)};
    down(m->r);
    block(m, low, high, NULL);
    m->r->settle = 1.5 * unit_of(r);
    memcpy(m->r->settle_gravity, r->gravity, sizeof r->gravity);
    maker_say(m, ", pool %.3f deep", level);
}

/* A body of water of random shape in the upper part of the room, in free flight. */
static double drop(maker *m, double lowest, double size, double fastest)
{
    recipe *r = m->r;
    body b = {.shape = r->dimension == 2 ? (shape)maker_choose(&m->state, 0, 1)
                                         : (shape)maker_choose(&m->state, 0, 4)};
    double way[3];
    b.size = size;
    if (r->dimension == 3)
        maker_tumble(m, &b);
    else
        maker_straight(&b);
    direction(m, way);
    const double speed = draw(m, 0.0, fastest);
    for (int c = 0; c < r->dimension; c++) {
        const double room_side = side(r, c), reach = fmin(1.1 * size, 0.5 * room_side);
        const double least = c == 1 ? fmin(lowest + reach, room_side - reach) : reach;
        b.half[c] = size * draw(m, 0.5, 0.9);
        b.velocity[c] = speed * way[c];
        b.center[c] = draw(m, least, room_side - reach);
    }
    maker_fill(m, &b);
    maker_say(m, ", %s of %.3f at (%.2f, %.2f, %.2f), %.2f m/s", maker_shapes[b.shape], size,
              b.center[0], b.center[1], b.center[2], speed);
    return speed;
}

/* Boxes and balls that stand still; in 2D boxes are turned. */
static void obstacles(maker *m, int count)
{
    recipe *r = m->r;
    for (; count > 0 && r->solid_count < RECIPE_SOLIDS; count--) {
        solid s = {.kind = maker_choose(&m->state, 0, 2) ? SOLID_BOX : SOLID_BALL};
        s.radius = length(m, 0.12, 0.25);
        s.angle = r->dimension == 2 ? draw(m, 0.0, PI) : 0.0;
        for (int c = 0; c < r->dimension; c++) {
            const double cells = rint(side(r, c) / r->spacing);
            s.half[c] = length(m, 0.08, 0.2);
            s.center[c] = rint(draw(m, 0.0, 1.0) * cells) * r->spacing;
        }
        r->solids[r->solid_count++] = s;
        maker_say(m, ", %s at (%.3f, %.3f, %.3f)", s.kind == SOLID_BOX ? "box" : "ball",
                  s.center[0], s.center[1], s.center[2]);
    }
}

void make_obstacles(maker *m)
{
    room(m, 1.2, 2.0);
    any_gravity(m);
    obstacles(m, maker_choose(&m->state, 0, 3));
    double speed = 0.0;
    for (int k = maker_choose(&m->state, 1, 3); k > 0; k--)
        speed = fmax(speed, drop(m, 0.0, length(m, 0.25, 0.45), 1.5));
    maker_speed(m->r, speed, 1.5);
}

void make_dam(maker *m)
{
    recipe *r = m->r;
    room(m, 1.2, 2.0);
    down(r);
    if (maker_choose(&m->state, 0, 1))
        obstacles(m, 1);
    const double low[3] = {0};
    double high[3] = {length(m, 0.3, 0.8), length(m, 0.5, 1.1), side(r, 2)};
    if (maker_choose(&m->state, 0, 1)) /* a corner, not the whole width */
        high[2] = length(m, 0.4, 0.8);
    block(m, low, high, NULL);
    maker_say(m, ", column %.3f x %.3f x %.3f", high[0], high[1], high[2]);
    if (maker_choose(&m->state, 0, 2) == 0) { /* and one opposite */
        const double from[3] = {side(r, 0) - length(m, 0.2, 0.4), 0.0, 0.0};
        const double to[3] = {side(r, 0), length(m, 0.3, 0.8), side(r, 2)};
        block(m, from, to, NULL);
        maker_say(m, ", another at %.3f", from[0]);
    }
    maker_speed(r, 0.0, 1.5);
}

void make_drops(maker *m)
{
    room(m, 1.0, 1.5);
    const double level = length(m, 0.1, 0.45);
    pool(m, level);
    m->r->settled = m->r->count;
    double speed = 0.0;
    for (int k = maker_choose(&m->state, 1, 3); k > 0; k--)
        speed = fmax(speed, drop(m, level + 2.0 * m->r->spacing, length(m, 0.15, 0.3), 1.5));
    maker_speed(m->r, speed, 1.5);
}

void make_still(maker *m)
{
    recipe *r = m->r;
    const bool deep = maker_choose(&m->state, 0, 1) != 0;
    const double width = deep ? length(m, 0.4, 0.7) : length(m, 1.0, 1.8);
    const double level = deep ? length(m, 1.0, 1.8) : length(m, 0.1, 0.4);
    maker_room(r, width, 1.3 * level + 0.2 * unit_of(r), width);
    maker_say(m, "%s tank %.3f wide", deep ? "deep" : "shallow", width);
    pool(m, level);
    maker_speed(r, 0.0, 1.5);
}

void make_tilted(maker *m)
{
    recipe *r = m->r;
    room(m, 0.8, 1.4);
    pool(m, length(m, 0.3, 0.6));
    any_gravity(m);
    maker_speed(r, 0.0, 1.5);
}

void make_filling(maker *m)
{
    recipe *r = m->r;
    const double width = length(m, 0.7, 1.1), height = length(m, 1.8, 2.2);
    maker_room(r, width, height, width);
    down(r);
    maker_say(m, "stream into a tank %.3f wide", width);
    const double thick = length(m, 0.2, 0.4), x = draw(m, 0.1 * width, 0.9 * width - thick);
    const double low[3] = {x, 0.15 * height, 0.3 * width},
                 high[3] = {x + thick, height, low[2] + thick};
    const double velocity[3] = {draw(m, -0.5, 0.5), -draw(m, 1.0, 3.0), 0.0};
    block(m, low, high, velocity);
    maker_speed(r, fabs(velocity[1]), 1.5);
}

/* A shelf with a hole, from wall to wall. */
void make_draining(maker *m)
{
    recipe *r = m->r;
    const double width = length(m, 0.7, 1.0), height = length(m, 1.6, 2.0),
                 thick = 3.0 * r->spacing;
    const double shelf = length(m, 0.5, 0.8), hole = length(m, 0.2, 0.35);
    const double from = rint(draw(m, 0.2, 0.5) * width / r->spacing) * r->spacing;
    maker_room(r, width, height, width);
    down(r);
    const double low[4][2] = {{0.0, 0.0}, {from + hole, 0.0}, {from, 0.0}, {from, from + hole}};
    const double high[4][2] = {
        {from, width}, {width, width}, {from + hole, from}, {from + hole, width}};
    for (int k = 0; k < (r->dimension == 2 ? 2 : 4); k++) {
        solid s = {.kind = SOLID_BOX};
        for (int c = 0; c < r->dimension; c++) {
            const double a = c == 1 ? shelf : low[k][c / 2],
                         b = c == 1 ? shelf + thick : high[k][c / 2];
            s.center[c] = 0.5 * (a + b);
            s.half[c] = 0.5 * (b - a);
        }
        r->solids[r->solid_count++] = s;
    }
    const double bottom[3] = {0.0, shelf + thick, 0.0},
                 top[3] = {width, shelf + thick + length(m, 0.3, 0.6), width};
    block(m, bottom, top, NULL);
    maker_say(m, "tank %.3f wide that drains through a hole of %.3f", width, hole);
    maker_speed(r, 0.0, 1.5);
}

/* A current past a body that is held. */
void make_held(maker *m)
{
    recipe *r = m->r;
    room(m, 1.0, 1.5);
    down(r);
    solid s = {.kind = maker_choose(&m->state, 0, 1) ? SOLID_BOX : SOLID_BALL};
    const double level = length(m, 0.35, 0.6);
    s.radius = length(m, 0.15, 0.25);
    for (int c = 0; c < r->dimension; c++) {
        s.half[c] = length(m, 0.1, 0.25);
        s.center[c] = c == 1 ? rint(level * draw(m, 0.4, 1.2) / r->spacing) * r->spacing
                             : rint(0.5 * side(r, c) / r->spacing) * r->spacing;
    }
    r->solids[r->solid_count++] = s;
    maker_say(m, ", held %s at height %.3f", s.kind == SOLID_BOX ? "box" : "ball", s.center[1]);
    const double low[3] = {0}, high[3] = {side(r, 0), level, side(r, 2)};
    const double velocity[3] = {draw(m, 0.5, 2.0), 0.0, draw(m, -0.5, 0.5)};
    block(m, low, high, velocity);
    maker_say(m, ", pool %.3f deep at %.2f m/s", level, velocity[0]);
    maker_speed(r, velocity[0], 1.5);
}

/* One to three layers on the floor, and often a drop into it. */
void make_film(maker *m)
{
    recipe *r = m->r;
    const int layers = maker_choose(&m->state, 1, 3);
    room(m, 1.4, 2.0);
    down(r);
    const double low[3] = {0}, high[3] = {side(r, 0), (layers + 0.5) * r->spacing, side(r, 2)};
    const double velocity[3] = {draw(m, -0.5, 0.5), 0.0, draw(m, -0.5, 0.5)};
    block(m, low, high, velocity);
    maker_say(m, ", film of %d layers", layers);
    if (maker_choose(&m->state, 0, 2))
        (void)drop(m, high[1] + 3.0 * r->spacing, length(m, 0.1, 0.2), 1.0);
    maker_speed(r, 0.0, 1.5);
}

/* A fast bundle of water against a wall, two to ten spacings a frame of 0.02 s at 0.05 m. */
void make_jet(maker *m)
{
    recipe *r = m->r;
    room(m, 1.2, 1.6);
    if (maker_choose(&m->state, 0, 1))
        down(r);
    const double thick = length(m, 0.2, 0.35), speed = unit_of(r) * draw(m, 5.0, 25.0);
    double low[3], high[3];
    const double velocity[3] = {-speed, 0.15 * speed * draw(m, -1.0, 1.0), 0.0};
    for (int c = 0; c < 3; c++) {
        low[c] = c == 0 ? 0.2 * side(r, 0) : 0.5 * (side(r, c) - thick);
        high[c] = c == 0 ? 0.95 * side(r, 0) : low[c] + thick;
    }
    block(m, low, high, velocity);
    maker_say(m, ", jet %.3f thick at %.2f m/s", thick, speed);
    maker_speed(r, speed, 1.5);
}

/* Bodies that fly, spin and meet, without gravity or walls. */
void make_space(maker *m)
{
    recipe *r = m->r;
    const size_t d = (size_t)r->dimension;
    const int bodies = maker_choose(&m->state, 1, 4);
    for (int k = 0; k < bodies; k++) {
        body b = maker_ball(r, length(m, 0.2, 0.4), 0.0, 0.0);
        double axis[3], way[3];
        const size_t first = r->count;
        direction(m, way);
        for (int c = 0; c < r->dimension; c++) {
            b.center[c] = bodies > 1 ? 0.7 * unit_of(r) * way[c] : 0.0;
            b.velocity[c] = (bodies > 1 ? -draw(m, 0.0, 1.5) : 0.0) * way[c];
        }
        maker_fill(m, &b);
        direction(m, axis);
        const double spin = draw(m, -4.0, 4.0);
        for (size_t i = first; i < r->count;
             i++) { /* v += spin axis x (x - centre); about z in 2D */
            double arm[3] = {0};
            for (size_t c = 0; c < d; c++)
                arm[c] = r->position[i * d + c] - b.center[c];
            const double *a = d == 2 ? (const double[]){0.0, 0.0, 1.0} : axis;
            for (size_t c = 0; c < d; c++)
                r->velocity[i * d + c] +=
                    spin * (a[(c + 1) % 3] * arm[(c + 2) % 3] - a[(c + 2) % 3] * arm[(c + 1) % 3]);
        }
        maker_say(m, "%sdrop of %.3f at (%.2f, %.2f, %.2f) spinning at %.2f", k ? ", " : "", b.size,
                  b.center[0], b.center[1], b.center[2], spin);
    }
    maker_speed(r, 2.0, 2.0);
}

void make_viscous(maker *m)
{
    recipe *r = m->r;
    make_obstacles(m);
    r->viscosity *= exp(draw(m, log(0.1), log(50.0)));
    maker_say(m, ", viscosity %.3g m^2/s", r->viscosity);
}
