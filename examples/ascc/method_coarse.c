/* A scene's fluid as fewer, larger particles. SPDX-License-Identifier: MIT
 *
 * The set is cut in two at its longest edge, and each part again, until there are as many parts as large
 * particles: equal masses to one particle, wherever the fluid is loose or dense. A lattice of cells would
 * beat against the lattice that scenes begin with.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "method_coarse.h"
#include "search.h"

typedef struct item {
    double key;
    size_t row;
} item;

bool ascc_coarse_open(ascc_coarse *c, const ascc_method_scene *scene, double factor, double spacing)
{
    const size_t row = scene->fluid_count * (size_t)scene->dimension;
    const double count = round((double)scene->fluid_count / pow(factor, scene->dimension));
    *c = (ascc_coarse){.scene = scene, .reach = 2.0 * spacing, .count = (size_t)fmax(1.0, count)};
    double *numbers = calloc(4 * row + 1, sizeof *numbers);
    if (!numbers)
        return false;
    c->position = numbers;
    c->velocity = numbers + row;
    c->row_position = numbers + 2 * row;
    c->row_velocity = numbers + 3 * row;
    return true;
}

void ascc_coarse_close(ascc_coarse *c)
{
    free(c->position);
    *c = (ascc_coarse){0};
}

/* ---- Fewer particles ------------------------------------------------------------------------- */

static int by_key(const void *a, const void *b)
{
    const item *x = a, *y = b;
    return x->key != y->key ? (x->key > y->key) - (x->key < y->key)
                            : (x->row > y->row) - (x->row < y->row);
}

static size_t longest(const ascc_coarse *c, const item *items, size_t n)
{
    const size_t d = (size_t)c->scene->dimension;
    size_t axis = 0;
    double most = -1.0;
    for (size_t a = 0; a < d; a++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < n; i++) {
            low = fmin(low, c->row_position[items[i].row * d + a]);
            high = fmax(high, c->row_position[items[i].row * d + a]);
        }
        if (high - low > most) {
            most = high - low;
            axis = a;
        }
    }
    return axis;
}

/* Items into `parts` large particles, the first of them `first`. */
static void divide(ascc_coarse *c, item *items, size_t n, size_t first, size_t parts)
{
    const size_t d = (size_t)c->scene->dimension;
    if (parts == 1) {
        for (size_t a = 0; a < d; a++) {
            double x = 0.0, v = 0.0;
            for (size_t i = 0; i < n; i++) {
                x += c->row_position[items[i].row * d + a];
                v += c->row_velocity[items[i].row * d + a];
            }
            c->position[first * d + a] = x / (double)n;
            c->velocity[first * d + a] = v / (double)n;
        }
        return;
    }
    const size_t axis = longest(c, items, n), left = parts / 2, m = n * left / parts;
    for (size_t i = 0; i < n; i++)
        items[i].key = c->row_position[items[i].row * d + axis];
    qsort(items, n, sizeof *items, by_key);
    divide(c, items, m, first, left);
    divide(c, items + m, n - m, first + left, parts - left);
}

bool ascc_coarse_set(ascc_coarse *c, const double *position, const double *velocity)
{
    const size_t n = c->scene->fluid_count,
                 bytes = n * (size_t)c->scene->dimension * sizeof(double);
    item *items = malloc((n + 1) * sizeof *items);
    if (!items)
        return false;
    memcpy(c->row_position, position, bytes);
    memcpy(c->row_velocity, velocity, bytes);
    for (size_t i = 0; i < n; i++)
        items[i].row = i;
    if (n)
        divide(c, items, n, 0, c->count);
    free(items);
    return true;
}

/* ---- The flow between them ------------------------------------------------------------------- */

typedef struct flow {
    const ascc_coarse *c;
    const ascc_measure_tree *tree; /* of the large ones before the frame */
    const double *position, *velocity;
} flow;

typedef struct mean {
    const flow *f;
    double weight, move[3], velocity[3];
} mean;

static void add(void *data, size_t row, double square)
{
    mean *m = data;
    const flow *f = m->f;
    const size_t d = (size_t)f->c->scene->dimension;
    const double part = 1.0 - square / (f->c->reach * f->c->reach), w = part * part * part;
    m->weight += w;
    for (size_t a = 0; a < d; a++) {
        m->move[a] += w * (f->position[row * d + a] - f->c->position[row * d + a]);
        m->velocity[a] += w * f->velocity[row * d + a];
    }
}

static void carry(void *data, size_t begin, size_t end)
{
    const flow *f = data;
    const ascc_method_scene *scene = f->c->scene;
    const size_t d = (size_t)scene->dimension;
    const double dt = scene->time_step;
    for (size_t i = begin; i < end; i++) {
        double *x = f->c->row_position + i * d, *v = f->c->row_velocity + i * d;
        mean m = {.f = f};
        ascc_measure_tree_within(f->tree, x, f->c->reach * f->c->reach, add, &m);
        for (size_t a = 0; a < d; a++) {
            const double gain = dt * scene->gravity[a];
            x[a] += m.weight > 0.0 ? m.move[a] / m.weight : dt * (v[a] + 0.5 * gain);
            v[a] = m.weight > 0.0 ? m.velocity[a] / m.weight : v[a] + gain;
        }
    }
}

bool ascc_coarse_carry(ascc_coarse *c, const double *position, const double *velocity)
{
    enum { BLOCK = 64 };
    const size_t row = c->count * (size_t)c->scene->dimension;
    ascc_measure_tree tree;
    flow f = {c, &tree, position, velocity};
    if (!ascc_measure_finite(position, row) ||
        ascc_measure_tree_build(&tree, c->scene->dimension, c->count, c->position) != ASCC_OK)
        return false;
    ascc_measure_parallel(c->scene->threads, c->scene->fluid_count, BLOCK, carry, &f);
    ascc_measure_tree_free(&tree);
    memcpy(c->position, position, row * sizeof *position);
    return true;
}
