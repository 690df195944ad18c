/* Nearest and fixed-radius search for measures, and the threads they share.
 * SPDX-License-Identifier: MIT
 *
 * The tree is the order of its points: the middle of [begin, end) splits it along the axis in which
 * the range is widest, ties by row, and both halves are trees of their own. The axis is found again
 * from a table of one byte a point.
 */
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#include "search.h"

enum { LEAF = 8, MOST_THREADS = 64 };

typedef struct entry {
    double at[3];
    size_t row;
} entry;

bool ascc_measure_finite(const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return false;
    return true;
}

bool ascc_measure_valid(const ascc_measure_set *set)
{
    return set && (set->dimension == 2 || set->dimension == 3) && (set->position || !set->count);
}

static bool before(const entry *a, const entry *b, int axis)
{
    if (a->at[axis] != b->at[axis])
        return a->at[axis] < b->at[axis];
    return a->row < b->row;
}

/* Hoare's selection with the middle of three as pivot; keys are distinct, so the result is one. */
static void select_middle(entry *e, size_t count, size_t middle, int axis)
{
    size_t low = 0, high = count - 1;
    while (low < high) {
        const size_t center = low + (high - low) / 2;
        const entry *a = &e[low], *b = &e[center], *c = &e[high];
        const entry *median = before(a, b, axis) ? (before(b, c, axis)   ? b
                                                    : before(a, c, axis) ? c
                                                                         : a)
                                                 : (before(a, c, axis)   ? a
                                                    : before(b, c, axis) ? c
                                                                         : b);
        const entry pivot = *median;
        size_t i = low, j = high;
        while (i <= j) {
            while (before(&e[i], &pivot, axis))
                i++;
            while (before(&pivot, &e[j], axis))
                j--;
            if (i <= j) {
                const entry swap = e[i];
                e[i] = e[j];
                e[j] = swap;
                i++;
                if (j == 0)
                    return;
                j--;
            }
        }
        if (middle <= j)
            high = j;
        else if (middle >= i)
            low = i;
        else
            return;
    }
}

static int widest(const entry *e, size_t count, int32_t dimension)
{
    int axis = 0;
    double width = -1.0;
    for (int c = 0; c < dimension; c++) {
        double low = e[0].at[c], high = low;
        for (size_t i = 1; i < count; i++) {
            low = fmin(low, e[i].at[c]);
            high = fmax(high, e[i].at[c]);
        }
        if (high - low > width) {
            width = high - low;
            axis = c;
        }
    }
    return axis;
}

static void arrange(entry *e, unsigned char *axes, size_t begin, size_t end, int32_t dimension)
{
    while (end - begin > LEAF) {
        const size_t middle = begin + (end - begin) / 2;
        const int axis = widest(e + begin, end - begin, dimension);
        select_middle(e + begin, end - begin, middle - begin, axis);
        axes[middle] = (unsigned char)axis;
        arrange(e, axes, begin, middle, dimension);
        begin = middle + 1;
    }
}

ascc_status ascc_measure_tree_build(ascc_measure_tree *tree, int32_t dimension, size_t count,
                                    const double *position)
{
    const size_t d = (size_t)dimension;
    memset(tree, 0, sizeof *tree);
    if (!ascc_measure_finite(position, count * d))
        return ASCC_ERROR_NOT_FINITE;
    entry *e = malloc((count + 1) * sizeof *e);
    tree->position = malloc((count * d + 1) * sizeof *tree->position);
    tree->row = malloc((count + 1) * sizeof *tree->row);
    tree->axis = calloc(count + 1, 1);
    if (!e || !tree->position || !tree->row || !tree->axis) {
        free(e);
        ascc_measure_tree_free(tree);
        return ASCC_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        for (size_t c = 0; c < 3; c++)
            e[i].at[c] = c < d ? position[i * d + c] : 0.0;
        e[i].row = i;
    }
    arrange(e, tree->axis, 0, count, dimension);
    for (size_t i = 0; i < count; i++) {
        memcpy(&tree->position[i * d], e[i].at, d * sizeof(double));
        tree->row[i] = e[i].row;
    }
    free(e);
    tree->dimension = dimension;
    tree->count = count;
    return ASCC_OK;
}

void ascc_measure_tree_free(ascc_measure_tree *tree)
{
    free(tree->position);
    free(tree->row);
    free(tree->axis);
    memset(tree, 0, sizeof *tree);
}

static double square_distance(const ascc_measure_tree *tree, size_t slot, const double *point)
{
    double sum = 0.0;
    for (size_t c = 0, d = (size_t)tree->dimension; c < d; c++) {
        const double e = tree->position[slot * d + c] - point[c];
        sum += e * e;
    }
    return sum;
}

typedef struct search {
    const ascc_measure_tree *tree;
    const double *point;
    size_t skip;
    double square;
    ascc_measure_visit visit; /* NULL: nearest, square shrinks */
    void *data;
} search;

static void look_at(search *s, size_t slot)
{
    const double square = square_distance(s->tree, slot, s->point);
    if (!(square < s->square) || s->tree->row[slot] == s->skip)
        return;
    if (s->visit)
        s->visit(s->data, s->tree->row[slot], square);
    else
        s->square = square;
}

static void descend(search *s, size_t begin, size_t end)
{
    if (end - begin <= LEAF) {
        for (size_t i = begin; i < end; i++)
            look_at(s, i);
        return;
    }
    const size_t middle = begin + (end - begin) / 2, axis = s->tree->axis[middle];
    const double offset =
        s->point[axis] - s->tree->position[middle * (size_t)s->tree->dimension + axis];
    const bool right = offset > 0.0;
    descend(s, right ? middle + 1 : begin, right ? end : middle);
    if (offset * offset < s->square || offset == 0.0) {
        look_at(s, middle);
        descend(s, right ? begin : middle + 1, right ? middle : end);
    }
}

double ascc_measure_tree_nearest(const ascc_measure_tree *tree, const double *point, size_t skip)
{
    search s = {.tree = tree, .point = point, .skip = skip, .square = INFINITY};
    descend(&s, 0, tree->count);
    return s.square;
}

void ascc_measure_tree_within(const ascc_measure_tree *tree, const double *point, double square,
                              ascc_measure_visit visit, void *data)
{
    search s = {tree, point, SIZE_MAX, square, visit, data};
    descend(&s, 0, tree->count);
}

typedef struct job {
    atomic_size_t next;
    size_t count, block;
    ascc_measure_range function;
    void *data;
} job;

static void *work(void *argument)
{
    job *j = argument;
    for (;;) {
        const size_t begin = atomic_fetch_add(&j->next, j->block);
        if (begin >= j->count)
            return NULL;
        const size_t end = j->count - begin < j->block ? j->count : begin + j->block;
        j->function(j->data, begin, end);
    }
}

void ascc_measure_parallel(int32_t threads, size_t count, size_t block, ascc_measure_range function,
                           void *data)
{
    job j = {.count = count, .block = block, .function = function, .data = data};
    pthread_t id[MOST_THREADS];
    int started = 0;
    atomic_init(&j.next, 0);
    while (started + 1 < threads && started < MOST_THREADS && (size_t)started + 1 < count / block &&
           pthread_create(&id[started], NULL, work, &j) == 0)
        started++;
    work(&j);
    for (int i = 0; i < started; i++)
        pthread_join(id[i], NULL);
}
