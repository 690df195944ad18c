/* DFSPH: making, walls and bodies, and one step (Bender and Koschier 2015, 2017).
 * SPDX-License-Identifier: MIT
 *
 *     pairs, densities                       dfsph_look
 *     v += change that ends divergence       dfsph_end_divergence
 *     v += dt (g + viscosity)
 *     v += change that ends compression      dfsph_end_compression
 *     x += dt v, bodies move
 */
#include "dfsph.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "dfsph_state.h"

#define PI 3.14159265358979323846

/* ---- Making ---- */

static void set_default(double *value, double otherwise)
{
    if (*value == 0.0)
        *value = otherwise;
}

dfsph *dfsph_create(const dfsph_options *options)
{
    if ((options->dimension != 2 && options->dimension != 3) || !(options->spacing > 0.0) ||
        !(options->volume >= 0.0) || !(options->time_step >= 0.0) || !(options->viscosity >= 0.0))
        return NULL;
    dfsph *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->options = *options;
    dfsph_options *o = &s->options;
    set_default(&o->volume, 0.8);
    set_default(&o->rest_density, 1000.0);
    set_default(&o->courant, 0.4);
    set_default(&o->density_error, 1e-4);
    set_default(&o->divergence_error, 1e-3);
    set_default(&o->release, 1.0);
    set_default(&o->skin, 0.3);
    o->iterations = o->iterations > 0 ? o->iterations : 100;
    s->support = 2.0 * o->spacing;
    s->volume = o->volume * pow(o->spacing, o->dimension);
    s->mass = o->rest_density * s->volume;
    s->normalisation = o->dimension == 2 ? 40.0 / (7.0 * PI * pow(s->support, 2))
                                         : 8.0 / (PI * pow(s->support, 3));
    const near_options near = {.dimension = o->dimension,
                               .thread_count = o->thread_count,
                               .radius = s->support,
                               .skin = o->skin * o->spacing};
    s->lists = near_create(&near);
    if (!s->lists)
        dfsph_destroy(&s);
    return s;
}

/* Every array with a row for each point. */
#define ARRAYS(X)                                                                                  \
    X(x);                                                                                          \
    X(v);                                                                                          \
    X(own);                                                                                        \
    X(wall_volume);                                                                                \
    X(wall_body);                                                                                  \
    X(density);                                                                                    \
    X(change);                                                                                     \
    X(wall_sum);                                                                                   \
    X(near_count);                                                                                 \
    X(pair_count);                                                                                 \
    X(slope);                                                                                      \
    X(push);                                                                                       \
    X(inverse);                                                                                    \
    X(wanted);                                                                                     \
    X(residual);                                                                                   \
    X(hold);                                                                                       \
    X(calm)

void dfsph_destroy(dfsph **solver)
{
    dfsph *s = *solver;
    if (!s)
        return;
    near_destroy(&s->lists);
#define FREE(name) free(s->name)
    ARRAYS(FREE);
#undef FREE
    free(s->pair);
    free(s->pair_row);
    free(s->touch);
    free(s);
    *solver = NULL;
}

static bool grow(void **array, size_t old, size_t count, size_t element)
{
    unsigned char *grown = realloc(*array, (count ? count : 1) * element);
    if (!grown)
        return false;
    memset(grown + old * element, 0, (count - old) * element);
    *array = grown;
    return true;
}

ascc_status dfsph_reserve(dfsph *s, size_t count)
{
    bool good = true;
    if (count > s->capacity) {
#define GROW(name) good = good && grow((void **)&s->name, s->capacity, count, sizeof *s->name)
        ARRAYS(GROW);
#undef GROW
        s->capacity = good ? count : s->capacity;
    }
    return good ? ASCC_OK
                : ascc_fail(&s->message, ASCC_ERROR_MEMORY, "no memory for %zu points", count);
}

static ascc_status reserve_touch(dfsph *s)
{
    const size_t wanted = s->body_count * s->fluid;
    if (wanted > s->touch_capacity && !grow((void **)&s->touch, 0, wanted, sizeof *s->touch))
        return ascc_fail(&s->message, ASCC_ERROR_MEMORY, "no memory for %zu bodies", s->body_count);
    s->touch_capacity = wanted > s->touch_capacity ? wanted : s->touch_capacity;
    return ASCC_OK;
}

static void place(double (*to)[3], size_t count, int32_t d, const double *from)
{
    if (count)
        memset(to, 0, count * sizeof *to);
    for (size_t i = 0; from && i < count; i++)
        memcpy(to[i], from + i * (size_t)d, (size_t)d * sizeof(double));
}

ascc_status dfsph_set_fluid(dfsph *s, size_t count, const double *position, const double *velocity)
{
    const ascc_status status = dfsph_reserve(s, count + s->walls);
    if (status != ASCC_OK)
        return status;
    if (s->walls)
        memmove(s->x + count, s->x + s->fluid, s->walls * sizeof *s->x);
    s->fluid = count;
    place(s->x, count, s->options.dimension, position);
    place(s->v, count, s->options.dimension, velocity);
    for (size_t i = 0; i < count; i++)
        s->hold[i] = s->calm[i] = 0.0f;
    s->totals = (dfsph_totals){0};
    memset(s->wall_impulse, 0, sizeof s->wall_impulse);
    near_forget(s->lists);
    return reserve_touch(s);
}

void dfsph_set_forces(dfsph *s, const double gravity[3], double viscosity)
{
    memcpy(s->options.gravity, gravity, sizeof s->options.gravity);
    s->options.viscosity = viscosity;
}

/* ---- Walls and bodies ---- */

static ascc_status add_points(dfsph *s, size_t count, const double *position, uint8_t body)
{
    ascc_status status = dfsph_reserve(s, s->fluid + s->walls + count);
    if (status != ASCC_OK)
        return status;
    place(s->x + s->fluid + s->walls, count, s->options.dimension, position);
    status = count ? dfsph_weigh_walls(s, s->walls, count) : ASCC_OK;
    if (status != ASCC_OK)
        return status;
    for (size_t w = 0; w < count; w++)
        s->wall_body[s->walls + w] = body;
    s->walls += count;
    near_forget(s->lists);
    return ASCC_OK;
}

ascc_status dfsph_set_walls(dfsph *s, size_t count, const double *position)
{
    s->walls = s->body_count = 0;
    return add_points(s, count, position, 0);
}

ascc_status dfsph_add_body(dfsph *s, size_t count, const double *position, const rigid *body)
{
    rigid b = *body;
    if (s->body_count == DFSPH_BODIES || count == 0 || !rigid_begin(&b, s->options.dimension))
        return ascc_fail(&s->message, ASCC_ERROR_ARGUMENT,
                         "body %zu: one too many, or without points, mass or inertia",
                         s->body_count);
    const size_t first = s->walls;
    s->body[s->body_count++] = b;
    ascc_status status = reserve_touch(s);
    if (status == ASCC_OK)
        status = add_points(s, count, position, (uint8_t)s->body_count);
    if (status != ASCC_OK) {
        s->body_count--;
        return status;
    }
    for (size_t w = first; w < s->walls; w++)
        for (int c = 0; c < 3; c++)
            s->own[w][c] = s->x[s->fluid + w][c] - b.center[c];
    return ASCC_OK;
}

const rigid *dfsph_body(const dfsph *s, size_t number)
{
    return &s->body[number];
}

void dfsph_drive_body(dfsph *s, size_t number, const double velocity[3], const double spin[3])
{
    memcpy(s->body[number].velocity, velocity, sizeof s->body->velocity);
    memcpy(s->body[number].spin, spin, sizeof s->body->spin);
}

/* Their points follow; tells by how much the farthest moved. */
static void move_bodies(dfsph *s, double dt)
{
    double most = 0.0;
    for (size_t k = 0; k < s->body_count; k++)
        rigid_move(&s->body[k], dt);
    for (size_t w = 0; w < s->walls && s->body_count; w++) {
        double *x = s->x[s->fluid + w], old[3] = {x[0], x[1], x[2]}, square = 0.0;
        if (s->wall_body[w] == 0)
            continue;
        rigid_point(&s->body[s->wall_body[w] - 1], s->own[w], x);
        for (int c = 0; c < 3; c++)
            square += (x[c] - old[c]) * (x[c] - old[c]);
        most = fmax(most, square);
    }
    s->wall_drift += sqrt(most);
}

/* ---- Steps ---- */

static double size_of(const double a[3])
{
    return sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
}

/* Fastest point of fluid and bodies, m/s. */
static double fastest(const dfsph *s)
{
    double most = 0.0;
    for (size_t i = 0; i < s->fluid; i++)
        most = size_of(s->v[i]) > most ? size_of(s->v[i]) : most;
    for (size_t w = 0; w < s->walls && s->body_count; w++)
        if (s->wall_body[w]) {
            const rigid *b = &s->body[s->wall_body[w] - 1];
            most = fmax(most, size_of(b->velocity) + size_of(b->spin) * size_of(s->own[w]));
        }
    return most;
}

static double longest_step(const dfsph *s, double speed)
{
    const dfsph_options *o = &s->options;
    double step = o->time_step > 0.0 ? o->time_step : INFINITY;
    const double gravity = size_of(o->gravity);
    if (speed > 0.0)
        step = fmin(step, o->courant * o->spacing / speed);
    if (gravity > 0.0)
        step = fmin(step, 0.1 * sqrt(o->spacing / gravity));
    if (o->viscosity > 0.0)
        step = fmin(step, 0.1 * o->spacing * o->spacing / o->viscosity);
    return step;
}

/* Accelerations by viscosity, central and opposite for i and j (Monaghan's Laplacian). */
static void find_drag(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    dfsph *s = data;
    const double factor = 2.0 * (s->options.dimension + 2) * s->options.viscosity,
                 blur = 0.01 * s->support * s->support;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *row = s->pair_row + s->lists->start[i];
        const dfsph_four *pair = s->pair + s->lists->start[i];
        double sum[3] = {0};
        for (uint32_t k = 0; k < s->pair_count[i]; k++) {
            const size_t j = row[k];
            double square = blur, along = 0.0;
            for (int c = 0; c < 3; c++) {
                const double r = s->x[i][c] - s->x[j][c];
                square += r * r;
                along += r * (s->v[i][c] - s->v[j][c]);
            }
            for (int c = 0; c < 3; c++)
                sum[c] += along / square * (double)pair[k][c];
        }
        for (int c = 0; c < 3; c++)
            s->change[i][c] = factor * sum[c];
    }
}

static void add_forces(dfsph *s, double dt)
{
    if (s->options.viscosity > 0.0)
        near_run(s->lists, s->fluid, find_drag, s);
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < s->options.dimension; c++)
            s->v[i][c] +=
                dt * (s->options.gravity[c] + (s->options.viscosity > 0.0 ? s->change[i][c] : 0.0));
    for (size_t k = 0; k < s->body_count; k++)
        for (int c = 0; c < 3 && s->body[k].kind == RIGID_FREE; c++)
            s->body[k].velocity[c] += dt * s->options.gravity[c];
}

static ascc_status step(dfsph *s, double dt)
{
    const ascc_status status = dfsph_look(s);
    if (status != ASCC_OK)
        return status;
    if (s->options.divergence_error > 0.0)
        dfsph_end_divergence(s, dt);
    add_forces(s, dt);
    dfsph_end_compression(s, dt);
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < 3; c++)
            s->x[i][c] += dt * s->v[i][c];
    move_bodies(s, dt);
    s->totals.time += dt;
    s->totals.steps++;
    s->totals.rebuilds = s->lists->rebuilds;
    return ASCC_OK;
}

ascc_status dfsph_advance(dfsph *s, double dt)
{
    ascc_status status = ASCC_OK;
    for (double left = dt; left > 1e-9 * dt && s->fluid && status == ASCC_OK;) {
        const double speed = fastest(s), longest = longest_step(s, speed);
        const double part = left / fmax(1.0, ceil(left / longest - 1e-6));
        s->totals.fastest = fmax(s->totals.fastest, speed);
        status = step(s, part);
        left -= part;
    }
    return status;
}

/* ---- Reading ---- */

const double (*dfsph_positions(const dfsph *s))[3]
{
    return (const double(*)[3])s->x;
}

const double (*dfsph_velocities(const dfsph *s))[3]
{
    return (const double(*)[3])s->v;
}

const double *dfsph_densities(const dfsph *s)
{
    return s->density;
}

double dfsph_pressure(const dfsph *s, size_t row)
{
    return s->options.rest_density * s->density[row] * s->density[row] *
           (double)(s->hold[row] + s->calm[row]);
}

const double *dfsph_wall_impulse(const dfsph *s)
{
    return s->wall_impulse;
}

double dfsph_mass(const dfsph *s)
{
    return s->mass;
}

dfsph_totals dfsph_get_totals(const dfsph *s)
{
    return s->totals;
}

const char *dfsph_message(const dfsph *s)
{
    return s->message.text;
}
