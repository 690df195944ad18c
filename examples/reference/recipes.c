/* Random scenes to generate data from. SPDX-License-Identifier: MIT */
#include "recipes.h"

#include "base/common.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define PI 3.14159265358979323846

/* ---- Chance: splitmix64, so that a scene is the same everywhere ---- */

static uint64_t chance_bits(uint64_t *state)
{
    uint64_t z = (*state += 0x9e3779b97f4a7c15u);
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

static double chance(uint64_t *state, double low, double high)
{
    return low + (high - low) * (double)(chance_bits(state) >> 11) * 0x1p-53;
}

static int choose(uint64_t *state, int low, int high) /* both included */
{
    return low + (int)(chance_bits(state) % (uint64_t)(high - low + 1));
}

/* ---- Fluid ---- */

/* What is being made: the recipe, its chance, and room for more particles. */
typedef struct maker {
    recipe *r;
    uint64_t state;
    size_t capacity;
    size_t text_length;
    bool out_of_memory;
} maker;

static void say(maker *m, const char *format, ...) ASCC_PRINTF(2, 3);
static void say(maker *m, const char *format, ...)
{
    const size_t room = sizeof m->r->text - m->text_length;
    va_list arguments;
    va_start(arguments, format);
    const int n = vsnprintf(m->r->text + m->text_length, room, format, arguments);
    va_end(arguments);
    m->text_length += n < 0 ? 0 : (size_t)n < room ? (size_t)n : room - 1;
}

static void add_particle(maker *m, const double position[3], const double velocity[3])
{
    recipe *r = m->r;
    const size_t d = (size_t)r->dimension;
    if (r->count == m->capacity) {
        m->capacity = 2 * m->capacity + 1024;
        double *positions = realloc(r->position, m->capacity * d * sizeof(double));
        if (positions)
            r->position = positions;
        double *velocities = realloc(r->velocity, m->capacity * d * sizeof(double));
        if (velocities)
            r->velocity = velocities;
        if (!positions || !velocities) {
            m->out_of_memory = true;
            m->capacity = r->count;
            return;
        }
    }
    memcpy(r->position + r->count * d, position, d * sizeof(double));
    memcpy(r->velocity + r->count * d, velocity, d * sizeof(double));
    r->count++;
}

typedef enum shape { SHAPE_BOX, SHAPE_BALL, SHAPE_CYLINDER, SHAPE_CONE, SHAPE_TORUS } shape;
static const char *const shape_names[] = {"box", "ball", "cylinder", "cone", "torus"};

typedef struct body {
    shape shape;
    double center[3], velocity[3]; /* m, m/s */
    double half[3];                /* m, of a box */
    double size;                   /* m: radius of the others */
    double axes[3][3];             /* orthonormal rows; the shape's own axes */
} body;

static bool inside(const body *b, const double p[3], int32_t d)
{
    double local[3] = {0};
    for (int a = 0; a < d; a++)
        for (int c = 0; c < d; c++)
            local[a] += b->axes[a][c] * (p[c] - b->center[c]);
    const double across = hypot(local[0], local[1]), up = local[2];
    switch (b->shape) {
    case SHAPE_BOX:
        for (int c = 0; c < d; c++)
            if (fabs(local[c]) > b->half[c])
                return false;
        return true;
    case SHAPE_CYLINDER:
        return across < 0.7 * b->size && fabs(up) < b->size;
    case SHAPE_CONE:
        return fabs(up) < b->size && across < 0.5 * (b->size - up);
    case SHAPE_TORUS:
        return hypot(across - 0.65 * b->size, up) < 0.35 * b->size;
    case SHAPE_BALL:
        return across * across + up * up < b->size * b->size;
    }
    return false;
}

/* True if a particle of this recipe is closer than 0.9 spacings. */
static bool occupied(const recipe *r, size_t count, const double at[3])
{
    const size_t d = (size_t)r->dimension;
    for (size_t i = 0; i < count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++) {
            const double e = r->position[i * d + c] - at[c];
            square += e * e;
        }
        if (square < 0.81 * r->spacing * r->spacing)
            return true;
    }
    return false;
}

/* Fills a body with particles on the world's lattice, where there is room: half a spacing from flat
 * walls, three quarters from obstacles, and not where fluid is already. */
static void fill(maker *m, const body *b)
{
    recipe *r = m->r;
    const double reach =
        b->shape == SHAPE_BOX ? hypot(hypot(b->half[0], b->half[1]), b->half[2]) : 1.5 * b->size;
    const size_t before = r->count;
    int low[3] = {0}, high[3] = {0};
    for (int c = 0; c < r->dimension; c++) {
        low[c] = (int)floor((b->center[c] - reach) / r->spacing);
        high[c] = (int)ceil((b->center[c] + reach) / r->spacing);
    }
    for (int z = low[2]; z <= high[2]; z++)
        for (int y = low[1]; y <= high[1]; y++)
            for (int x = low[0]; x <= high[0]; x++) {
                const double at[3] = {(x + 0.5) * r->spacing, (y + 0.5) * r->spacing,
                                      r->dimension == 3 ? (z + 0.5) * r->spacing : 0.0};
                double normal[3] = {0};
                if (!inside(b, at, r->dimension) ||
                    solids_distance(r->solids, r->solid_count > 0, r->dimension, at, normal) <
                        0.499 * r->spacing ||
                    (r->solid_count > 1 &&
                     solids_distance(r->solids + 1, r->solid_count - 1, r->dimension, at, normal) <
                         (r->dimension == 2 ? 0.75 : 0.499) * r->spacing) ||
                    occupied(r, before, at))
                    continue;
                add_particle(m, at, b->velocity);
            }
}

static void straight(body *b)
{
    memset(b->axes, 0, sizeof b->axes);
    for (int c = 0; c < 3; c++)
        b->axes[c][c] = 1.0;
}

/* A random rotation, from a random unit quaternion. */
static void tumble(maker *m, body *b)
{
    double q[4], square;
    do {
        square = 0.0;
        for (int k = 0; k < 4; k++) {
            q[k] = chance(&m->state, -1.0, 1.0);
            square += q[k] * q[k];
        }
    } while (square > 1.0 || square < 0.01);
    const double s = 2.0 / square, w = q[0], x = q[1], y = q[2], z = q[3];
    const double axes[3][3] = {{1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)},
                               {s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)},
                               {s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)}};
    memcpy(b->axes, axes, sizeof axes);
}

/* The speed that water from rest, or with this speed, can reach in the room. */
static void set_speed(recipe *r, double speed, double lowest)
{
    double drop = 0.0;
    for (int c = 0; c < r->dimension && r->solid_count; c++)
        drop += 2.0 * fabs(r->gravity[c]) * 2.0 * r->solids[0].half[c];
    r->speed = fmax(lowest, sqrt(speed * speed + drop));
}

static void set_room(recipe *r, double x, double y, double z)
{
    const double size[3] = {x, y, z};
    r->solids[0] = (solid){.kind = SOLID_ROOM};
    for (int c = 0; c < r->dimension; c++) {
        const double half = 0.5 * rint(size[c] / r->spacing) * r->spacing;
        r->solids[0].center[c] = r->solids[0].half[c] = half;
    }
    r->solid_count = 1;
}

/* ---- 2D: obstacles and blocks in a box ---- */

/* Radius of a circle around a solid. */
static double reach_of(const solid *s)
{
    return s->kind == SOLID_BALL ? s->radius : hypot(s->half[0], s->half[1]);
}

/* Adds an obstacle if it leaves a gap of `gap` metres to the box and to the others. */
static bool add_obstacle(recipe *r, const solid *s, double gap)
{
    const double reach = reach_of(s) + gap;
    for (int c = 0; c < 2; c++)
        if (s->center[c] < reach || s->center[c] > 2.0 * r->solids[0].half[c] - reach)
            return false;
    for (size_t i = 1; i < r->solid_count; i++)
        if (hypot(s->center[0] - r->solids[i].center[0], s->center[1] - r->solids[i].center[1]) <
            reach + reach_of(&r->solids[i]))
            return false;
    r->solids[r->solid_count++] = *s;
    return true;
}

static void add_obstacles(maker *m, int count)
{
    recipe *r = m->r;
    for (int tries = 0; tries < 100 && (int)r->solid_count - 1 < count; tries++) {
        solid s = {.kind = choose(&m->state, 0, 1) ? SOLID_BALL : SOLID_BOX};
        s.center[0] = chance(&m->state, 0.0, 1.0);
        s.center[1] = chance(&m->state, 0.0, 1.0);
        s.radius = chance(&m->state, 0.06, 0.12);
        s.half[0] = chance(&m->state, 0.05, 0.12);
        s.half[1] = chance(&m->state, 0.05, 0.12);
        s.angle = chance(&m->state, 0.0, PI);
        if (!add_obstacle(r, &s, 0.08))
            continue;
        if (s.kind == SOLID_BALL)
            say(m, ", ball (%.3f, %.3f) radius %.3f", s.center[0], s.center[1], s.radius);
        else
            say(m, ", box (%.3f, %.3f) half (%.3f, %.3f) turned %.2f", s.center[0], s.center[1],
                s.half[0], s.half[1], s.angle);
    }
}

static void add_ramps(maker *m, int count)
{
    recipe *r = m->r;
    for (int tries = 0; tries < 100 && (int)r->solid_count - 1 < count; tries++) {
        solid s = {.kind = SOLID_BOX};
        s.half[0] = chance(&m->state, 0.1, 0.22);
        s.half[1] = 3.0 * r->spacing;
        s.center[0] = chance(&m->state, 0.1, 0.9);
        s.center[1] = chance(&m->state, 0.1, 0.6);
        s.angle = chance(&m->state, 0.2, 1.0) * (choose(&m->state, 0, 1) ? 1.0 : -1.0);
        if (add_obstacle(r, &s, 0.04))
            say(m, ", ramp (%.3f, %.3f) half length %.3f turned %.2f", s.center[0], s.center[1],
                s.half[0], s.angle);
    }
}

/* A block of water in the box, about `area` m^2, at or above `floor`. Returns its speed. */
static double add_block(maker *m, double area, double floor, double fastest)
{
    recipe *r = m->r;
    const double dp = r->spacing, side = 2.0 * r->solids[0].half[0];
    const double width = fmin(side, sqrt(area * chance(&m->state, 0.4, 2.5)));
    const int nx = (int)fmax(4.0, rint(width / dp));
    const int ny = (int)fmax(4.0, fmin(rint((side - floor) / dp), rint(area / (nx * dp * dp))));
    const int cells = (int)rint(side / dp), lowest = (int)rint(floor / dp);
    const int x = choose(&m->state, 0, cells - nx);
    const int y = lowest + choose(&m->state, 0, cells - lowest - ny);
    body b = {.shape = SHAPE_BOX};
    straight(&b);
    b.center[0] = (x + 0.5 * nx) * dp;
    b.center[1] = (y + 0.5 * ny) * dp;
    b.half[0] = 0.5 * nx * dp;
    b.half[1] = 0.5 * ny * dp;
    const double speed = choose(&m->state, 0, 1) ? chance(&m->state, 0.0, fastest) : 0.0;
    const double heading = chance(&m->state, 0.0, 2.0 * PI);
    b.velocity[0] = speed * cos(heading);
    b.velocity[1] = speed * sin(heading);
    fill(m, &b);
    say(m, ", block %dx%d at (%.3f, %.3f) velocity (%.2f, %.2f)", nx, ny, x * dp, y * dp,
        b.velocity[0], b.velocity[1]);
    return speed;
}

static void add_blocks(maker *m, int count, double area, double floor, double fastest)
{
    double speed = 0.0;
    for (int i = 0; i < count; i++)
        speed = fmax(speed, add_block(m, area / count, floor, fastest));
    set_speed(m->r, speed, 3.0);
}

static void make_wbc(maker *m)
{
    recipe *r = m->r;
    set_room(r, 1.0, 1.0, 0.0);
    const double size = choose(&m->state, 0, 7) == 0 ? 0.0 : chance(&m->state, 3.0, 12.0);
    const double heading = chance(&m->state, 0.0, 2.0 * PI);
    r->gravity[0] = size * cos(heading);
    r->gravity[1] = size * sin(heading);
    say(m, "unit box");
    add_obstacles(m, choose(&m->state, 0, 3));
    /* without gravity something has to move */
    add_blocks(m, choose(&m->state, 1, 2), chance(&m->state, 0.17, 0.25), 0.0,
               size > 0.0 ? 1.0 : 1.5);
}

static void make_ramps(maker *m)
{
    set_room(m->r, 1.0, 1.0, 0.0);
    m->r->gravity[1] = -9.81;
    say(m, "unit box");
    add_ramps(m, choose(&m->state, 1, 3));
    add_blocks(m, choose(&m->state, 1, 2), chance(&m->state, 0.12, 0.22), 0.5, 1.0);
}

/* ---- 3D: bodies of water in a room with blocks ---- */

static void add_pedestal(maker *m)
{
    recipe *r = m->r;
    const double dp = r->spacing;
    solid s = {.kind = SOLID_BOX};
    for (int c = 0; c < 3; c++) {
        const int room = (int)rint(2.0 * r->solids[0].half[c] / dp);
        const int cells = choose(&m->state, room / 6, c == 1 ? room / 3 : room / 2);
        const int first = c == 1 ? 0 : choose(&m->state, 0, room - cells);
        s.half[c] = 0.5 * cells * dp;
        s.center[c] = (first + 0.5 * cells) * dp;
    }
    r->solids[r->solid_count++] = s;
    say(m, ", block (%.3f, %.3f, %.3f) half (%.3f, %.3f, %.3f)", s.center[0], s.center[1],
        s.center[2], s.half[0], s.half[1], s.half[2]);
}

static double add_body(maker *m)
{
    recipe *r = m->r;
    body b = {.shape = (shape)choose(&m->state, 0, 4)};
    const double size = chance(&m->state, 0.3, 0.5);
    b.size = b.shape == SHAPE_TORUS ? 1.25 * size : size;
    tumble(m, &b);
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        b.half[c] = size * chance(&m->state, 0.6, 1.0);
        b.velocity[c] = chance(&m->state, -1.5, c == 1 ? 0.5 : 1.5);
        square += b.velocity[c] * b.velocity[c];
        const double room = 2.0 * r->solids[0].half[c], reach = fmin(size, 0.5 * room);
        b.center[c] = chance(&m->state, c == 1 ? 0.5 * room : reach, room - reach);
    }
    fill(m, &b);
    say(m, ", %s of %.2f at (%.2f, %.2f, %.2f) velocity (%.2f, %.2f, %.2f)", shape_names[b.shape],
        size, b.center[0], b.center[1], b.center[2], b.velocity[0], b.velocity[1], b.velocity[2]);
    return sqrt(square);
}

static void make_liquid(maker *m)
{
    recipe *r = m->r;
    set_room(r, chance(&m->state, 1.1, 2.0), chance(&m->state, 1.4, 2.0),
             chance(&m->state, 1.1, 2.0));
    r->gravity[1] = -9.81;
    say(m, "room %.2f x %.2f x %.2f", 2 * r->solids[0].half[0], 2 * r->solids[0].half[1],
        2 * r->solids[0].half[2]);
    for (int i = choose(&m->state, 0, 2); i > 0; i--)
        add_pedestal(m);
    double speed = 0.0;
    for (int i = choose(&m->state, 1, 3); i > 0; i--)
        speed = fmax(speed, add_body(m));
    set_speed(r, speed, 1.5);
}

/* ---- Generalisation: 2D or 3D ---- */

static body ball(const recipe *r, double radius, double x, double y)
{
    body b = {.shape = SHAPE_BALL, .size = radius, .center = {x, y, r->dimension == 3 ? x : 0.0}};
    straight(&b);
    return b;
}

static void make_fall(maker *m)
{
    recipe *r = m->r;
    r->gravity[1] = -9.81;
    body b = ball(r, (r->dimension == 2 ? 0.25 : 0.4) * chance(&m->state, 0.8, 1.0), 0.0, 0.0);
    b.velocity[0] = chance(&m->state, -1.0, 1.0);
    b.velocity[1] = chance(&m->state, 0.0, 2.0);
    fill(m, &b);
    r->speed = 2.0; /* within the drop there is none; the fall itself makes no pressure */
    say(m, "free fall without walls, drop of radius %.3f velocity (%.2f, %.2f)", b.size,
        b.velocity[0], b.velocity[1]);
}

static void make_droplets(maker *m)
{
    recipe *r = m->r;
    const double radius = (r->dimension == 2 ? 0.15 : 0.3) * chance(&m->state, 0.8, 1.1);
    const double speed = chance(&m->state, 0.5, 1.5);
    const double off = radius * chance(&m->state, 0.0, 1.0), apart = 1.2 * radius;
    body left = ball(r, radius, -apart, 0.5 * off), right = ball(r, radius, apart, -0.5 * off);
    left.center[2] = right.center[2] = 0.0;
    left.velocity[0] = speed;
    right.velocity[0] = -speed;
    fill(m, &left);
    fill(m, &right);
    r->speed = fmax(1.5, 2.0 * speed);
    say(m, "two drops of radius %.3f without gravity or walls, +-%.2f m/s, %.3f off axis", radius,
        speed, off);
}

static bool add_depth(maker *m, double level)
{
    recipe *r = m->r;
    r->depth = malloc((r->count ? r->count : 1) * sizeof *r->depth);
    for (size_t i = 0; r->depth && i < r->count; i++)
        r->depth[i] = fmax(0.0, level - r->position[i * (size_t)r->dimension + 1]);
    return r->depth != NULL;
}

/* Water at rest in a room, filled to a level that is a multiple of the spacing. */
static double add_pool(maker *m, double width, double height, double level)
{
    recipe *r = m->r;
    r->gravity[1] = -9.81;
    set_room(r, width, height, width);
    const double full = rint(level / r->spacing) * r->spacing;
    body b = {.shape = SHAPE_BOX};
    straight(&b);
    for (int c = 0; c < 3; c++) {
        b.half[c] = c == 1 ? 0.5 * full : r->solids[0].half[c];
        b.center[c] = c < r->dimension ? b.half[c] : 0.0;
    }
    fill(m, &b);
    if (!add_depth(m, full))
        m->out_of_memory = true;
    return full;
}

static void make_column(maker *m)
{
    const double unit = m->r->dimension == 2 ? 0.5 : 1.0;
    const double width = unit * chance(&m->state, 0.6, 0.9),
                 level = unit * chance(&m->state, 0.7, 1.2);
    const double full = add_pool(m, width, 1.5 * level, level);
    m->r->speed = fmax(1.5, sqrt(2.0 * 9.81 * full));
    say(m, "water at rest, %.3f m wide and %.3f m deep", width, full);
}

static void make_pool(maker *m)
{
    recipe *r = m->r;
    const double unit = r->dimension == 2 ? 0.5 : 1.0;
    const double width = unit * chance(&m->state, 1.1, 1.5),
                 level = unit * chance(&m->state, 0.3, 0.5);
    const double full = add_pool(m, width, 2.0 * unit, level);
    const double radius = unit * chance(&m->state, 0.2, 0.3);
    body b = ball(r, radius, 0.5 * width, full + radius + unit * chance(&m->state, 0.1, 0.5));
    b.velocity[0] = chance(&m->state, -0.5, 0.5);
    b.velocity[1] = chance(&m->state, -1.5, 0.0);
    const size_t pool = r->count;
    fill(m, &b);
    double *depth = realloc(r->depth, (r->count + 1) * sizeof *depth);
    if (depth)
        r->depth = depth;
    else
        m->out_of_memory = true;
    for (size_t i = pool; depth && i < r->count; i++)
        depth[i] = 0.0;
    set_speed(r, 1.5, 1.5);
    say(m,
        "pool %.3f m wide and %.3f m deep, drop of radius %.3f at height %.3f velocity (%.2f, "
        "%.2f)",
        width, full, radius, b.center[1], b.velocity[0], b.velocity[1]);
}

/* ---- Kinds ---- */

const char *const recipe_kinds[][2] = {
    {"wbc2d", "2D box, 0 to 3 obstacles, gravity of random direction and size, or none"},
    {"ramps2d", "2D box, blocks falling on random ramps"},
    {"liquid3d", "3D rooms with blocks, 1 to 3 bodies of random shape"},
    {"free-fall", "a drop without walls"},
    {"droplets", "two drops that collide without gravity or walls"},
    {"still-column", "water at rest"},
    {"pool-drop", "a drop falling into a pool"},
    {NULL, NULL}};

static const struct {
    void (*make)(maker *m);
    int32_t dimension, frames; /* by default */
    bool either;               /* both dimensions are possible */
    int32_t least, most;       /* particles of a scene at the default spacing; 0 = any number */
} kinds[] = {
    {make_wbc, 2, 400, false, 1000, 1600},    {make_ramps, 2, 400, false, 700, 1500},
    {make_liquid, 3, 100, false, 1500, 3500}, {make_fall, 3, 60, true, 0, 0},
    {make_droplets, 2, 200, true, 0, 0},      {make_column, 3, 100, true, 0, 0},
    {make_pool, 3, 100, true, 0, 0},
};

ascc_status recipe_make(const char *kind, const recipe_options *options, recipe *made)
{
    size_t k = 0;
    while (recipe_kinds[k][0] && strcmp(recipe_kinds[k][0], kind) != 0)
        k++;
    if (!recipe_kinds[k][0])
        return ASCC_ERROR_ARGUMENT;
    const int32_t d = options->dimension ? options->dimension : kinds[k].dimension;
    if (d != kinds[k].dimension && !(kinds[k].either && (d == 2 || d == 3)))
        return ASCC_ERROR_ARGUMENT;
    const double usual = d == 2 ? 0.0125 : 0.05;
    maker m = {.r = made, .state = options->seed * 0x9e3779b97f4a7c15u + options->number};
    m.state = chance_bits(&m.state) + k;
    for (int tries = 0; tries < 200; tries++) {
        *made =
            (recipe){.dimension = d, .spacing = options->spacing > 0.0 ? options->spacing : usual};
        made->frames = options->frames > 0 ? options->frames : kinds[k].frames;
        made->frame = d == 2 ? 0.0025 : 0.02;
        m.capacity = m.text_length = 0;
        kinds[k].make(&m);
        const double scale = pow(made->spacing / usual, d), count = (double)made->count * scale;
        if (!m.out_of_memory &&
            (kinds[k].most == 0 || (count >= kinds[k].least && count <= kinds[k].most)))
            return ASCC_OK;
        recipe_free(made);
        if (m.out_of_memory)
            break;
    }
    return ASCC_ERROR_MEMORY;
}

void recipe_free(recipe *made)
{
    free(made->position);
    free(made->velocity);
    free(made->depth);
    made->position = made->velocity = made->depth = NULL;
}

ascc_status recipe_solver(const recipe *made, int32_t thread_count, sph **solver,
                          wall_points *walls)
{
    sph_options options = {.dimension = made->dimension,
                           .thread_count = thread_count,
                           .spacing = made->spacing,
                           .sound_speed = 10.0 * made->speed,
                           .artificial_viscosity = 0.05};
    memcpy(options.gravity, made->gravity, sizeof options.gravity);
    *walls = (wall_points){0};
    *solver = sph_create(&options);
    bool good = *solver && solids_sample(made->solids, made->solid_count, made->dimension,
                                         made->spacing, sph_wall_layers(&options), walls);
    good = good && sph_set_walls(*solver, walls->count, walls->position) == ASCC_OK &&
           sph_set_fluid(*solver, made->count, made->position, made->velocity) == ASCC_OK;
    if (!good) {
        sph_destroy(solver);
        wall_points_free(walls);
        return ASCC_ERROR_MEMORY;
    }
    if (made->depth)
        sph_set_depth(*solver, made->depth);
    return ASCC_OK;
}
