/* Where a simulation wants detail: weights of particles by place, speed and depth. SPDX-License-Identifier: MIT */
#include "detail.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define RAMP 4.0   /* spacings from weight 1 to 0, in space */
#define COLUMN 2.0 /* spacings: columns of which the highest particle is the surface */
#define MOST_COLUMNS 1e6

/* ---- The text ---- */

/* Numbers with commas between them, up to a plus or the end. */
static int read_numbers(const char **text, double number[4])
{
    int count = 0;
    const char *at = *text;
    while (count < 4) {
        char *end;
        number[count] = strtod(at, &end);
        if (end == at || !isfinite(number[count]))
            return 0;
        count++;
        at = end;
        if (*at != ',')
            break;
        at++;
    }
    *text = at;
    return *at == '+' || *at == '\0' ? count : 0;
}

bool ascc_detail_read(const char *text, int32_t dimension, ascc_detail *detail)
{
    static const char *const kinds[] = {"near:", "fast:", "surface:"};
    const int wanted[] = {(int)dimension + 1, 1, 1};
    detail->count = 0;
    for (;; text++) {
        int kind = 0;
        while (kind < 3 && strncmp(text, kinds[kind], strlen(kinds[kind])) != 0)
            kind++;
        if (kind == 3 || detail->count == ASCC_DETAIL_WISHES)
            return false;
        double *number = detail->wish[detail->count].number;
        detail->wish[detail->count].kind = kind;
        text += strlen(kinds[kind]);
        if (read_numbers(&text, number) != wanted[kind] || !(number[wanted[kind] - 1] > 0.0))
            return false;
        detail->count++;
        if (*text == '\0')
            return true;
    }
}

/* ---- Weights ---- */

static double between(double value)
{
    return fmin(1.0, fmax(0.0, value));
}

/* The axis that gravity is most along. */
static int vertical(const ascc_detail_fluid *f)
{
    int axis = 1;
    for (int c = 0; c < f->dimension; c++)
        if (fabs(f->gravity[c]) > fabs(f->gravity[axis]))
            axis = c;
    return axis;
}

static double height(const ascc_detail_fluid *f, size_t i, int axis)
{
    const double x = (double)f->position[i * (size_t)f->dimension + (size_t)axis];
    return f->gravity[axis] > 0.0 ? -x : x;
}

typedef struct columns {
    int axis;
    double low[3], width;
    size_t cells[3];
    double *top; /* of each */
} columns;

static size_t column_of(const columns *c, const ascc_detail_fluid *f, size_t i)
{
    size_t cell = 0;
    for (int a = 0; a < f->dimension; a++) {
        const double x = (double)f->position[i * (size_t)f->dimension + (size_t)a];
        if (a != c->axis)
            cell = cell * c->cells[a] + (size_t)((x - c->low[a]) / c->width);
    }
    return cell;
}

/* Columns over all fluid, wider ones where that would be too many; false without memory. */
static bool open_columns(columns *c, const ascc_detail_fluid *f)
{
    double high[3], count;
    c->axis = vertical(f);
    c->width = COLUMN * f->spacing;
    for (int a = 0; a < f->dimension; a++) {
        c->low[a] = INFINITY;
        high[a] = -INFINITY;
        for (size_t i = 0; i < f->count; i++) {
            const double x = (double)f->position[i * (size_t)f->dimension + (size_t)a];
            c->low[a] = fmin(c->low[a], x);
            high[a] = fmax(high[a], x);
        }
    }
    do {
        count = 1.0;
        for (int a = 0; a < f->dimension; a++)
            count *= a == c->axis ? 1.0 : floor((high[a] - c->low[a]) / c->width) + 1.0;
        c->width *= count > MOST_COLUMNS ? 2.0 : 1.0;
    } while (count > MOST_COLUMNS);
    for (int a = 0; a < f->dimension; a++)
        c->cells[a] = (size_t)((high[a] - c->low[a]) / c->width) + 1;
    c->top = malloc((size_t)count * sizeof *c->top);
    for (size_t k = 0; c->top && k < (size_t)count; k++)
        c->top[k] = -INFINITY;
    return c->top != NULL;
}

static bool add_surface(const ascc_detail_fluid *f, double depth, double *weight)
{
    columns c;
    if (f->count == 0)
        return true;
    if (!open_columns(&c, f))
        return false;
    for (size_t i = 0; i < f->count; i++) {
        double *top = &c.top[column_of(&c, f, i)];
        *top = fmax(*top, height(f, i, c.axis));
    }
    for (size_t i = 0; i < f->count; i++) {
        const double below = c.top[column_of(&c, f, i)] - height(f, i, c.axis);
        weight[i] = fmax(weight[i], between(1.0 - (below - depth) / (RAMP * f->spacing)));
    }
    free(c.top);
    return true;
}

static double distance(const ascc_detail_fluid *f, size_t i, const double *place)
{
    double square = 0.0;
    for (int c = 0; c < f->dimension; c++)
        square += pow((double)f->position[i * (size_t)f->dimension + (size_t)c] - place[c], 2.0);
    return sqrt(square);
}

static double speed(const ascc_detail_fluid *f, size_t i)
{
    double square = 0.0;
    for (int c = 0; c < f->dimension; c++)
        square += pow((double)f->velocity[i * (size_t)f->dimension + (size_t)c], 2.0);
    return sqrt(square);
}

bool ascc_detail_weigh(const ascc_detail *detail, const ascc_detail_fluid *f, double *weight)
{
    for (size_t i = 0; i < f->count; i++)
        weight[i] = 0.0;
    for (size_t k = 0; k < detail->count; k++) {
        const double *number = detail->wish[k].number;
        if (detail->wish[k].kind == ASCC_DETAIL_SURFACE && !add_surface(f, number[0], weight))
            return false;
        for (size_t i = 0; detail->wish[k].kind == ASCC_DETAIL_NEAR && i < f->count; i++) {
            const double beyond = distance(f, i, number) - number[f->dimension];
            weight[i] = fmax(weight[i], between(1.0 - beyond / (RAMP * f->spacing)));
        }
        for (size_t i = 0; detail->wish[k].kind == ASCC_DETAIL_FAST && i < f->count; i++)
            weight[i] = fmax(weight[i], between(2.0 * speed(f, i) / number[0] - 1.0));
    }
    return true;
}
