/* Random scenes to generate data from. SPDX-License-Identifier: MIT */
#include "recipes.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "recipe_maker.h"

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
        solid s = {.kind = maker_choose(&m->state, 0, 1) ? SOLID_BALL : SOLID_BOX};
        s.center[0] = maker_chance(&m->state, 0.0, 1.0);
        s.center[1] = maker_chance(&m->state, 0.0, 1.0);
        s.radius = maker_chance(&m->state, 0.06, 0.12);
        s.half[0] = maker_chance(&m->state, 0.05, 0.12);
        s.half[1] = maker_chance(&m->state, 0.05, 0.12);
        s.angle = maker_chance(&m->state, 0.0, PI);
        if (!add_obstacle(r, &s, 0.08))
            continue;
        if (s.kind == SOLID_BALL)
            maker_say(m, ", ball (%.3f, %.3f) radius %.3f", s.center[0], s.center[1], s.radius);
        else
            maker_say(m, ", box (%.3f, %.3f) half (%.3f, %.3f) turned %.2f", s.center[0],
                      s.center[1], s.half[0], s.half[1], s.angle);
    }
}

static void add_ramps(maker *m, int count)
{
    recipe *r = m->r;
    for (int tries = 0; tries < 100 && (int)r->solid_count - 1 < count; tries++) {
        solid s = {.kind = SOLID_BOX};
        s.half[0] = maker_chance(&m->state, 0.1, 0.22);
        s.half[1] = 3.0 * r->spacing;
        s.center[0] = maker_chance(&m->state, 0.1, 0.9);
        s.center[1] = maker_chance(&m->state, 0.1, 0.6);
        s.angle = maker_chance(&m->state, 0.2, 1.0) * (maker_choose(&m->state, 0, 1) ? 1.0 : -1.0);
        if (add_obstacle(r, &s, 0.04))
            maker_say(m, ", ramp (%.3f, %.3f) half length %.3f turned %.2f", s.center[0],
                      s.center[1], s.half[0], s.angle);
    }
}

/* A block of water in the box, about `area` m^2, at or above `floor`. Returns its speed. */
static double add_block(maker *m, double area, double floor, double fastest)
{
    recipe *r = m->r;
    const double dp = r->spacing, side = 2.0 * r->solids[0].half[0];
    const double width = fmin(side, sqrt(area * maker_chance(&m->state, 0.4, 2.5)));
    const int nx = (int)fmax(4.0, rint(width / dp));
    const int ny = (int)fmax(4.0, fmin(rint((side - floor) / dp), rint(area / (nx * dp * dp))));
    const int cells = (int)rint(side / dp), lowest = (int)rint(floor / dp);
    const int x = maker_choose(&m->state, 0, cells - nx);
    const int y = lowest + maker_choose(&m->state, 0, cells - lowest - ny);
    body b = {.shape = SHAPE_BOX};
    maker_straight(&b);
    b.center[0] = (x + 0.5 * nx) * dp;
    b.center[1] = (y + 0.5 * ny) * dp;
    b.half[0] = 0.5 * nx * dp;
    b.half[1] = 0.5 * ny * dp;
    const double speed =
        maker_choose(&m->state, 0, 1) ? maker_chance(&m->state, 0.0, fastest) : 0.0;
    const double heading = maker_chance(&m->state, 0.0, 2.0 * PI);
    b.velocity[0] = speed * cos(heading);
    b.velocity[1] = speed * sin(heading);
    maker_fill(m, &b);
    maker_say(m, ", block %dx%d at (%.3f, %.3f) velocity (%.2f, %.2f)", nx, ny, x * dp, y * dp,
              b.velocity[0], b.velocity[1]);
    return speed;
}

static void add_blocks(maker *m, int count, double area, double floor, double fastest)
{
    double speed = 0.0;
    for (int i = 0; i < count; i++)
        speed = fmax(speed, add_block(m, area / count, floor, fastest));
    maker_speed(m->r, speed, 3.0);
}

static void make_wbc(maker *m)
{
    recipe *r = m->r;
    maker_room(r, 1.0, 1.0, 0.0);
    const double size =
        maker_choose(&m->state, 0, 7) == 0 ? 0.0 : maker_chance(&m->state, 3.0, 12.0);
    const double heading = maker_chance(&m->state, 0.0, 2.0 * PI);
    r->gravity[0] = size * cos(heading);
    r->gravity[1] = size * sin(heading);
    maker_say(m, "unit box");
    add_obstacles(m, maker_choose(&m->state, 0, 3));
    /* without gravity something has to move */
    add_blocks(m, maker_choose(&m->state, 1, 2), maker_chance(&m->state, 0.17, 0.25), 0.0,
               size > 0.0 ? 1.0 : 1.5);
}

static void make_ramps(maker *m)
{
    maker_room(m->r, 1.0, 1.0, 0.0);
    m->r->gravity[1] = -9.81;
    maker_say(m, "unit box");
    add_ramps(m, maker_choose(&m->state, 1, 3));
    add_blocks(m, maker_choose(&m->state, 1, 2), maker_chance(&m->state, 0.12, 0.22), 0.5, 1.0);
}

/* ---- 3D: bodies of water in a room with blocks ---- */

static void add_pedestal(maker *m)
{
    recipe *r = m->r;
    const double dp = r->spacing;
    solid s = {.kind = SOLID_BOX};
    for (int c = 0; c < 3; c++) {
        const int room = (int)rint(2.0 * r->solids[0].half[c] / dp);
        const int cells = maker_choose(&m->state, room / 6, c == 1 ? room / 3 : room / 2);
        const int first = c == 1 ? 0 : maker_choose(&m->state, 0, room - cells);
        s.half[c] = 0.5 * cells * dp;
        s.center[c] = (first + 0.5 * cells) * dp;
    }
    r->solids[r->solid_count++] = s;
    maker_say(m, ", block (%.3f, %.3f, %.3f) half (%.3f, %.3f, %.3f)", s.center[0], s.center[1],
              s.center[2], s.half[0], s.half[1], s.half[2]);
}

static double add_body(maker *m)
{
    recipe *r = m->r;
    body b = {.shape = (shape)maker_choose(&m->state, 0, 4)};
    const double size = maker_chance(&m->state, 0.3, 0.5);
    b.size = b.shape == SHAPE_TORUS ? 1.25 * size : size;
    maker_tumble(m, &b);
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        b.half[c] = size * maker_chance(&m->state, 0.6, 1.0);
        b.velocity[c] = maker_chance(&m->state, -1.5, c == 1 ? 0.5 : 1.5);
        square += b.velocity[c] * b.velocity[c];
        const double room = 2.0 * r->solids[0].half[c], reach = fmin(size, 0.5 * room);
        b.center[c] = maker_chance(&m->state, c == 1 ? 0.5 * room : reach, room - reach);
    }
    maker_fill(m, &b);
    maker_say(m, ", %s of %.2f at (%.2f, %.2f, %.2f) velocity (%.2f, %.2f, %.2f)",
              maker_shapes[b.shape], size, b.center[0], b.center[1], b.center[2], b.velocity[0],
              b.velocity[1], b.velocity[2]);
    return sqrt(square);
}

static void make_liquid(maker *m)
{
    recipe *r = m->r;
    maker_room(r, maker_chance(&m->state, 1.1, 2.0), maker_chance(&m->state, 1.4, 2.0),
               maker_chance(&m->state, 1.1, 2.0));
    r->gravity[1] = -9.81;
    maker_say(m, "room %.2f x %.2f x %.2f", 2 * r->solids[0].half[0], 2 * r->solids[0].half[1],
              2 * r->solids[0].half[2]);
    for (int i = maker_choose(&m->state, 0, 2); i > 0; i--)
        add_pedestal(m);
    double speed = 0.0;
    for (int i = maker_choose(&m->state, 1, 3); i > 0; i--)
        speed = fmax(speed, add_body(m));
    maker_speed(r, speed, 1.5);
}

/* ---- Generalisation: 2D or 3D ---- */

static void make_fall(maker *m)
{
    recipe *r = m->r;
    r->gravity[1] = -9.81;
    body b = maker_ball(r, (r->dimension == 2 ? 0.25 : 0.4) * maker_chance(&m->state, 0.8, 1.0),
                        0.0, 0.0);
    b.velocity[0] = maker_chance(&m->state, -1.0, 1.0);
    b.velocity[1] = maker_chance(&m->state, 0.0, 2.0);
    maker_fill(m, &b);
    r->speed = 2.0; /* within the drop there is none; the fall itself makes no pressure */
    maker_say(m, "free fall without walls, drop of radius %.3f velocity (%.2f, %.2f)", b.size,
              b.velocity[0], b.velocity[1]);
}

static void make_droplets(maker *m)
{
    recipe *r = m->r;
    const double radius = (r->dimension == 2 ? 0.15 : 0.3) * maker_chance(&m->state, 0.8, 1.1);
    const double speed = maker_chance(&m->state, 0.5, 1.5);
    const double off = radius * maker_chance(&m->state, 0.0, 1.0), apart = 1.2 * radius;
    body left = maker_ball(r, radius, -apart, 0.5 * off),
         right = maker_ball(r, radius, apart, -0.5 * off);
    left.center[2] = right.center[2] = 0.0;
    left.velocity[0] = speed;
    right.velocity[0] = -speed;
    maker_fill(m, &left);
    maker_fill(m, &right);
    r->speed = fmax(1.5, 2.0 * speed);
    maker_say(m, "two drops of radius %.3f without gravity or walls, +-%.2f m/s, %.3f off axis",
              radius, speed, off);
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
    maker_room(r, width, height, width);
    const double full = rint(level / r->spacing) * r->spacing;
    body b = {.shape = SHAPE_BOX};
    maker_straight(&b);
    for (int c = 0; c < 3; c++) {
        b.half[c] = c == 1 ? 0.5 * full : r->solids[0].half[c];
        b.center[c] = c < r->dimension ? b.half[c] : 0.0;
    }
    maker_fill(m, &b);
    if (!add_depth(m, full))
        m->out_of_memory = true;
    return full;
}

static void make_column(maker *m)
{
    const double unit = m->r->dimension == 2 ? 0.5 : 1.0;
    const double width = unit * maker_chance(&m->state, 0.6, 0.9),
                 level = unit * maker_chance(&m->state, 0.7, 1.2);
    const double full = add_pool(m, width, 1.5 * level, level);
    m->r->speed = fmax(1.5, sqrt(2.0 * 9.81 * full));
    maker_say(m, "water at rest, %.3f m wide and %.3f m deep", width, full);
}

static void make_pool(maker *m)
{
    recipe *r = m->r;
    const double unit = r->dimension == 2 ? 0.5 : 1.0;
    const double width = unit * maker_chance(&m->state, 1.1, 1.5),
                 level = unit * maker_chance(&m->state, 0.3, 0.5);
    const double full = add_pool(m, width, 2.0 * unit, level);
    const double radius = unit * maker_chance(&m->state, 0.2, 0.3);
    body b = maker_ball(r, radius, 0.5 * width,
                        full + radius + unit * maker_chance(&m->state, 0.1, 0.5));
    b.velocity[0] = maker_chance(&m->state, -0.5, 0.5);
    b.velocity[1] = maker_chance(&m->state, -1.5, 0.0);
    const size_t pool = r->count;
    maker_fill(m, &b);
    double *depth = realloc(r->depth, (r->count + 1) * sizeof *depth);
    if (depth)
        r->depth = depth;
    else
        m->out_of_memory = true;
    for (size_t i = pool; depth && i < r->count; i++)
        depth[i] = 0.0;
    maker_speed(r, 1.5, 1.5);
    maker_say(
        m,
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
    {"obstacles",
     "1 to 3 bodies among boxes and balls, gravity of any direction and size, or none"},
    {"dam-break", "one or two columns that collapse, often before an obstacle"},
    {"drops", "1 to 3 drops into a pool at rest"},
    {"still-tank", "deep and shallow tanks, settled"},
    {"tilted-tank", "a settled tank whose gravity turns"},
    {"filling", "a stream that fills a tank"},
    {"draining", "a tank that drains through a hole into another"},
    {"held-body", "a current past a body that is held"},
    {"film", "1 to 3 layers on a floor, often a drop into them"},
    {"jet", "a jet of 5 to 25 m/s against a wall (half of that in 2D)"},
    {"space", "1 to 4 drops that spin and meet, without gravity or walls"},
    {"viscous", "as obstacles, with 0.1 to 50 times the viscosity"},
    {"paddle", "a plate that goes to and fro in a pool"},
    {"turning-tank", "a tank that begins to turn about a level axis"},
    {"floating-body",
     "a box or ball of 0.2 to 0.8 of water's density, let go at the surface of a pool"},
    {"sinking-body", "the same of 1.5 to 4 times water's density"},
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
    {make_pool, 3, 100, true, 0, 0},          {make_obstacles, 3, 100, true, 600, 4000},
    {make_dam, 3, 100, true, 600, 4000},      {make_drops, 3, 100, true, 600, 5000},
    {make_still, 3, 60, true, 400, 5000},     {make_tilted, 3, 100, true, 400, 5000},
    {make_filling, 3, 100, true, 200, 3000},  {make_draining, 3, 150, true, 400, 4000},
    {make_held, 3, 100, true, 400, 5000},     {make_film, 3, 80, true, 300, 5000},
    {make_jet, 3, 40, true, 200, 3000},       {make_space, 3, 100, true, 200, 5000},
    {make_viscous, 3, 100, true, 600, 4000},  {make_paddle, 3, 100, true, 400, 5000},
    {make_turning, 3, 100, true, 300, 5000},  {make_floating, 3, 80, true, 400, 5000},
    {make_sinking, 3, 25, true, 400, 5000},
};

/* Walls of DFSPH can. */
static bool moves(const recipe *r)
{
    bool any = false;
    for (size_t i = 0; i < r->solid_count; i++)
        any |= r->motion[i].kind != RIGID_STILL;
    return any;
}

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
    m.state = maker_bits(&m.state) + k;
    for (int tries = 0; tries < 200; tries++) {
        *made =
            (recipe){.dimension = d, .spacing = options->spacing > 0.0 ? options->spacing : usual};
        made->frames = options->frames > 0 ? options->frames : kinds[k].frames;
        made->frame = options->frame > 0.0 ? options->frame : d == 2 ? 0.0025 : 0.02;
        made->solver = options->solver;
        /* as the given sequences have them: DFSPH's in 3D, two-dimensional ones at the density of rest */
        made->volume = d == 3 && options->solver == RECIPE_DFSPH ? 0.8 : 1.0;
        made->viscosity = 0.18 * pow(made->spacing, 1.5);
        m.capacity = m.text_length = 0;
        kinds[k].make(&m);
        if (made->solver != RECIPE_DFSPH && moves(made)) {
            recipe_free(made);
            return ASCC_ERROR_ARGUMENT;
        }
        for (int c = 0; c < 3 && options->gravity > 0.0; c++) {
            made->gravity[c] *= options->gravity;
            made->settle_gravity[c] *= options->gravity;
        }
        made->speed *= sqrt(fmax(1.0, options->gravity));
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
