/* Walls of points and normals, turned into layers of particles. SPDX-License-Identifier: MIT
 *
 *     o   o   o   fluid
 *   . . . . . . . wall points of the scene, dense, one layer
 *     x   x   x   layer 0: cells of a lattice that starts in the walls' low corner,
 *     x   x   x   layer 1  moved along the normal to the middle of their layer, but for edges
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "method_walls.h"
#include "search.h"

double ascc_method_spacing(const ascc_method_scene *scene)
{
    return pow(scene->mass / scene->rest_density, 1.0 / scene->dimension);
}

enum { MOST_CELLS = 1 << 26 };

typedef struct lattice {
    const ascc_method_scene *scene;
    const ascc_measure_tree *tree;
    int32_t layers;
    double spacing; /* of the layers */
    double low[3];
    size_t cells[3];
    /* Of the query: sums over the wall points about as near as the nearest. */
    const double *point;
    double nearest, side, weight, normal[3], outside;
} lattice;

/* All of them tell on which side the point is; where it is behind, those in front of it tell how far and
 * which way: beyond an edge both faces do, beside one only the near face. */
static void gather(void *data, size_t row, double square)
{
    lattice *l = data;
    const size_t d = (size_t)l->scene->dimension;
    const double *n = l->scene->normal + row * d, *w = l->scene->wall + row * d;
    const double part = 1.0 - (sqrt(square) - l->nearest) / (0.75 * l->scene->spacing);
    const double weight = part > 0.0 ? part * part : 0.0;
    double behind = 0.0;
    for (size_t c = 0; c < d; c++)
        behind -= n[c] * (l->point[c] - w[c]);
    l->side += weight * behind;
    if (!(behind > 0.0))
        return;
    for (size_t c = 0; c < d; c++)
        l->normal[c] += weight * n[c];
    l->outside += weight * behind;
    l->weight += weight;
}

/* Moves a lattice point to the middle of its layer; false if it is in the fluid, too far behind, or
 * beside the wall's edge. */
static bool place(lattice *l, double point[3])
{
    const double s = l->spacing;
    const double square = ascc_measure_tree_nearest(l->tree, point, SIZE_MAX);
    l->nearest = sqrt(square);
    if (!(l->nearest < 2.0 * l->layers * s))
        return false;
    const double reach = l->nearest + 0.75 * l->scene->spacing;
    l->point = point;
    l->side = l->weight = l->outside = 0.0;
    memset(l->normal, 0, sizeof l->normal);
    ascc_measure_tree_within(l->tree, point, reach * reach, gather, l);
    if (!(l->side > 0.0))
        return false;
    double length = 0.0;
    for (int c = 0; c < 3; c++)
        length += l->normal[c] * l->normal[c];
    length = sqrt(length) / l->weight; /* 1 on a flat wall, 0.7 in a right angle */
    const double behind = l->outside / l->weight;
    if (!(length > 0.3) || !(behind < l->layers * s))
        return false;
    if (length < 0.95) /* beyond an edge: the lattice as it is */
        return true;
    if (square - behind * behind > s * s) /* not behind the wall but beside it */
        return false;
    const double shift = ((floor(behind / s) + 0.5) * s - behind) / length;
    for (int c = 0; c < l->scene->dimension; c++)
        point[c] -= shift * l->normal[c] / (l->weight * length);
    return true;
}

static bool size_lattice(lattice *l)
{
    const ascc_method_scene *scene = l->scene;
    const size_t d = (size_t)scene->dimension;
    double total = 1.0;
    for (size_t c = 0; c < 3; c++)
        l->cells[c] = 1;
    for (size_t c = 0; c < d; c++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < scene->wall_count; i++) {
            low = fmin(low, scene->wall[i * d + c]);
            high = fmax(high, scene->wall[i * d + c]);
        }
        const double cells = ceil((high - low) / l->spacing - 1e-3) + 2.0 * l->layers;
        l->low[c] = low - (l->layers - 0.5) * l->spacing;
        total *= cells;
        if (!(total < MOST_CELLS))
            return false;
        l->cells[c] = (size_t)cells;
    }
    return true;
}

static size_t fill_lattice(lattice *l, double *position)
{
    const size_t d = (size_t)l->scene->dimension;
    size_t count = 0;
    for (size_t k = 0; k < l->cells[2]; k++)
        for (size_t j = 0; j < l->cells[1]; j++)
            for (size_t i = 0; i < l->cells[0]; i++) {
                const size_t at[3] = {i, j, k};
                double point[3] = {0.0, 0.0, 0.0};
                for (size_t c = 0; c < d; c++)
                    point[c] = l->low[c] + (double)at[c] * l->spacing;
                if (place(l, point))
                    memcpy(position + d * count++, point, d * sizeof *point);
            }
    return count;
}

static bool copy_layers(const ascc_method_scene *scene, double **position, size_t *count)
{
    const size_t bytes = scene->wall_count * (size_t)scene->dimension * sizeof(double);
    *position = malloc(bytes + 1);
    if (*position && bytes)
        memcpy(*position, scene->wall, bytes);
    *count = scene->wall_count;
    return *position != NULL;
}

bool ascc_method_layers(const ascc_method_scene *scene, double spacing, int32_t layers,
                        double **position, size_t *count, ascc_method_error *error)
{
    ascc_measure_tree tree = {0};
    lattice l = {.scene = scene, .tree = &tree, .layers = layers, .spacing = spacing};
    *position = NULL;
    *count = 0;
    snprintf(error->text, sizeof error->text, "no memory for the walls, or they are too large");
    if (scene->first_layer < scene->wall_count)
        return copy_layers(scene, position, count);
    if (scene->wall_count == 0)
        return true;
    if (!size_lattice(&l) ||
        ascc_measure_tree_build(&tree, scene->dimension, scene->wall_count, scene->wall) != ASCC_OK)
        return false;
    const size_t cells = l.cells[0] * l.cells[1] * l.cells[2];
    *position = malloc(cells * (size_t)scene->dimension * sizeof **position);
    if (*position)
        *count = fill_lattice(&l, *position);
    ascc_measure_tree_free(&tree);
    return *position != NULL;
}

/* ---- Settings -------------------------------------------------------------------------------- */

static bool read_one(const char *text, size_t length, const ascc_method_setting *known)
{
    const char *equal = memchr(text, '=', length);
    for (; known->name && equal; known++) {
        const size_t name = (size_t)(equal - text);
        if (strlen(known->name) != name || memcmp(known->name, text, name) != 0)
            continue;
        char *end;
        *known->value = strtod(equal + 1, &end);
        return end == text + length && end > equal + 1 && isfinite(*known->value);
    }
    return false;
}

bool ascc_method_settings(const char *text, const ascc_method_setting *known,
                          ascc_method_error *error)
{
    while (*text) {
        const size_t length = strcspn(text, ",");
        if (!read_one(text, length, known)) {
            size_t used = (size_t)snprintf(error->text, sizeof error->text,
                                           "%.*s: not a setting; there are", (int)length, text);
            for (size_t k = 0; known[k].name && used < sizeof error->text; k++)
                used += (size_t)snprintf(error->text + used, sizeof error->text - used,
                                         " %s=", known[k].name);
            return false;
        }
        text += length + (text[length] == ',');
    }
    return true;
}
