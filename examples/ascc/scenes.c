/* Blocks of fluid, and boxes whose walls are one layer of points. SPDX-License-Identifier: MIT */
#include "scenes.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "system.h"

/* Wall points lie this far apart, in particle spacings: about 980 a square metre at 0.05 m, what the
 * published networks were trained with. */
#define WALL_SPACING 0.64

const ascc_scene_name ascc_scene_names[] = {
    {"dam-break", "a column collapses along a tank"},
    {"droplets", "two drops collide without gravity and walls"},
    {"free-fall", "a drop falls, no walls"},
    {"still-column", "water that should stay at rest in a tank"},
    {NULL, NULL},
};

/* A scene while it grows. */
typedef struct builder {
    ascc_sequence *scene;
    size_t room, wall_room;
    bool full; /* out of memory */
} builder;

static bool grow(float **array, size_t *room, size_t count, size_t d)
{
    if (count < *room)
        return true;
    const size_t wanted = *room ? *room * 2 : 1024;
    float *moved = realloc(*array, wanted * d * sizeof *moved);
    if (!moved)
        return false;
    *array = moved;
    *room = wanted;
    return true;
}

static void add_fluid(builder *b, const double x[3], const double v[3])
{
    ascc_sequence *s = b->scene;
    const size_t d = (size_t)s->dimension;
    size_t room = b->room;
    if (b->full || !grow(&s->position, &b->room, s->count, d) ||
        !grow(&s->velocity, &room, s->count, d)) {
        b->full = true;
        return;
    }
    for (size_t c = 0; c < d; c++) {
        s->position[s->count * d + c] = (float)x[c];
        s->velocity[s->count * d + c] = (float)v[c];
    }
    s->count++;
}

static void add_wall(builder *b, const double x[3], const double normal[3])
{
    ascc_sequence *s = b->scene;
    const size_t d = (size_t)s->dimension;
    size_t room = b->wall_room;
    if (b->full || !grow(&s->wall, &b->wall_room, s->walls, d) ||
        !grow(&s->normal, &room, s->walls, d)) {
        b->full = true;
        return;
    }
    for (size_t c = 0; c < d; c++) {
        s->wall[s->walls * d + c] = (float)x[c];
        s->normal[s->walls * d + c] = (float)normal[c];
    }
    s->walls++;
}

/* A lattice block of cells[] particles from its low corner. */
static void add_block(builder *b, const double low[3], const int cells[3], const double v[3])
{
    const double spacing = 2.0 * b->scene->radius;
    for (int k = 0; k < (b->scene->dimension == 3 ? cells[2] : 1); k++)
        for (int j = 0; j < cells[1]; j++)
            for (int i = 0; i < cells[0]; i++) {
                const double x[3] = {low[0] + (i + 0.5) * spacing, low[1] + (j + 0.5) * spacing,
                                     low[2] + (k + 0.5) * spacing};
                add_fluid(b, x, v);
            }
}

/* Lattice points within a ball (a disc in 2D). */
static void add_ball(builder *b, const double center[3], double radius, const double v[3])
{
    const double spacing = 2.0 * b->scene->radius;
    const int n = (int)ceil(radius / spacing);
    for (int k = b->scene->dimension == 3 ? -n : 0; k <= (b->scene->dimension == 3 ? n : 0); k++)
        for (int j = -n; j <= n; j++)
            for (int i = -n; i <= n; i++) {
                const double x[3] = {center[0] + i * spacing, center[1] + j * spacing,
                                     center[2] + k * spacing};
                if ((double)(i * i + j * j + k * k) * spacing * spacing <= radius * radius)
                    add_fluid(b, x, v);
            }
}

/* One side of the box [0, size]: points half a wall spacing from its edges on. */
static void add_side(builder *b, const double size[3], int axis, bool upper)
{
    const int d = b->scene->dimension;
    int count[3];
    double step[3];
    for (int c = 0; c < 3; c++) {
        count[c] =
            c == axis || c >= d ? 1 : (int)ceil(size[c] / (WALL_SPACING * 2.0 * b->scene->radius));
        step[c] = size[c] / count[c];
    }
    for (int k = 0; k < count[2]; k++)
        for (int j = 0; j < count[1]; j++)
            for (int i = 0; i < count[0]; i++) {
                const int at[3] = {i, j, k};
                double x[3], normal[3] = {0.0, 0.0, 0.0};
                for (int c = 0; c < 3; c++)
                    x[c] = c == axis ? (upper ? size[c] : 0.0) : (at[c] + 0.5) * step[c];
                normal[axis] = upper ? -1.0 : 1.0;
                add_wall(b, x, normal);
            }
}

/* A closed box from the origin. */
static void add_box(builder *b, const double size[3])
{
    for (int axis = 0; axis < b->scene->dimension; axis++) {
        add_side(b, size, axis, false);
        add_side(b, size, axis, true);
    }
}

static const double still[3] = {0.0, 0.0, 0.0};

static void dam_break(builder *b, int size)
{
    const double h = 2.0 * b->scene->radius;
    const int cells[3] = {size / 2 > 2 ? size / 2 : 2, size, size / 2 > 2 ? size / 2 : 2};
    const double low[3] = {0.0, 0.0, 0.0};
    const double box[3] = {cells[0] * 4.0 * h, cells[1] * 1.5 * h, cells[2] * h};
    add_block(b, low, cells, still);
    add_box(b, box);
}

static void still_column(builder *b, int size)
{
    const double h = 2.0 * b->scene->radius;
    const int side = size / 2 > 4 ? size / 2 : 4;
    const int cells[3] = {side, size, side};
    const double low[3] = {0.0, 0.0, 0.0};
    const double box[3] = {cells[0] * h, cells[1] * 1.5 * h, cells[2] * h};
    add_block(b, low, cells, still);
    add_box(b, box);
}

static void droplets(builder *b, int size)
{
    const double h = 2.0 * b->scene->radius, radius = 0.5 * size * h;
    const double left[3] = {-1.2 * radius, -0.3 * radius, 0.0};
    const double right[3] = {1.2 * radius, 0.3 * radius, 0.0};
    const double v[3] = {1.0, 0.0, 0.0}, w[3] = {-1.0, 0.0, 0.0};
    add_ball(b, left, radius, v);
    add_ball(b, right, radius, w);
    memset(b->scene->gravity, 0, sizeof b->scene->gravity);
}

static void free_fall(builder *b, int size)
{
    add_ball(b, still, 0.5 * size * 2.0 * b->scene->radius, still);
}

bool ascc_scene_make(const char *name, int32_t dimension, int32_t size, double spacing,
                     ascc_sequence *scene, char *error, size_t capacity)
{
    static void (*const makers[])(builder *, int) = {dam_break, droplets, free_fall, still_column};
    static const int sizes[][2] = {{40, 20}, {24, 12}, {24, 12}, {30, 20}}; /* 2D, 3D */
    memset(scene, 0, sizeof *scene);
    int which = 0;
    while (ascc_scene_names[which].name && strcmp(ascc_scene_names[which].name, name) != 0)
        which++;
    if (!ascc_scene_names[which].name) {
        (void)snprintf(error, capacity, "%s: neither a file nor a scene's name", name);
        return false;
    }
    if (size != 0 && (size < 4 || size > 1000)) {
        (void)snprintf(error, capacity, "--size %d: 4 to 1000 is wanted", size);
        return false;
    }
    builder b = {.scene = scene};
    scene->dimension = dimension;
    scene->radius = 0.5 * spacing;
    scene->rest_density = 1000.0;
    scene->mass = 1000.0 * pow(spacing, dimension);
    scene->time_step = 0.02;
    scene->gravity[1] = -9.81;
    makers[which](&b, size ? size : sizes[which][dimension - 2]);
    scene->frames = scene->velocity_frames = 1;
    scene->first_layer = scene->walls;
    (void)snprintf(scene->source, sizeof scene->source, "built-in scene %s", name);
    if (b.full) {
        (void)snprintf(error, capacity, "%s: no memory for the scene", name);
        ascc_sequence_free(scene);
        return false;
    }
    return true;
}

/* Adds the scene that was probably meant to an error. */
static void suggest_scene(const char *scene, char *error, size_t capacity)
{
    enum { MOST = 16 };
    char names[2 * MOST][64];
    const char *known[2 * MOST + 1] = {NULL};
    for (size_t i = 0; i < MOST && ascc_scene_names[i].name; i++)
        for (size_t k = 2 * i; k < 2 * i + 2; k++) {
            (void)snprintf(names[k], sizeof names[k], "%s-%dd", ascc_scene_names[i].name,
                           k % 2 ? 3 : 2);
            known[k] = names[k];
        }
    const char *meant = ascc_nearest(scene, known);
    const size_t length = strlen(error);
    if (meant)
        (void)snprintf(error + length, capacity - length, "; did you mean '%s'?", meant);
}

bool ascc_scene_load(const char *text, int32_t size, double spacing, ascc_sequence *scene,
                     char *error, size_t capacity)
{
    size_t length = strlen(text);
    const char *end = text + (length > 3 ? length - 3 : 0);
    const bool flat = strcmp(end, "-2d") == 0, deep = strcmp(end, "-3d") == 0;
    char name[64];
    length -= flat || deep ? 3 : 0;
    (void)snprintf(name, sizeof name, "%.*s", (int)(length < 63 ? length : 63), text);
    bool known = flat || deep;
    for (const ascc_scene_name *s = ascc_scene_names; s->name; s++)
        known = known || strcmp(s->name, name) == 0;
    const bool file = ascc_system_there(text);
    const bool good =
        known && !file ? ascc_scene_make(name, flat ? 2 : 3, size, spacing, scene, error, capacity)
                       : ascc_sequence_read(text, scene, error, capacity);
    if (!good && !file)
        suggest_scene(text, error, capacity);
    return good;
}

void ascc_scene_list(FILE *to)
{
    for (const ascc_scene_name *s = ascc_scene_names; s->name; s++)
        fprintf(to, "         %s-2d, %s-3d: %s\n", s->name, s->name, s->text);
}
