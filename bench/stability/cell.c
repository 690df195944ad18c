/* Running and judging one cell of the stability matrix. SPDX-License-Identifier: MIT */
#include "cell.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

bool cell_fail(cell *c, const char *format, ...)
{
    va_list arguments;
    if (c->verdict == FAIL)
        return false;
    c->verdict = FAIL;
    va_start(arguments, format);
    (void)vsnprintf(c->text, sizeof c->text, format, arguments);
    va_end(arguments);
    return false;
}

void cell_say(cell *c, const char *format, ...)
{
    va_list arguments;
    if (c->verdict != PASS)
        return;
    va_start(arguments, format);
    (void)vsnprintf(c->text, sizeof c->text, format, arguments);
    va_end(arguments);
}

/* Rows of three numbers as rows of two; at one place, too. */
static void flatten(const double *from, size_t rows, double *to)
{
    for (size_t i = 0; i < rows; i++) {
        to[2 * i] = from[3 * i];
        to[2 * i + 1] = from[3 * i + 1];
    }
}

static void deepen(const double *from, size_t rows, double *to)
{
    for (size_t i = 0; i < rows; i++) {
        to[3 * i] = from[2 * i];
        to[3 * i + 1] = from[2 * i + 1];
        to[3 * i + 2] = 0.0;
    }
}

static bool is_flat(const simulation *s)
{
    return s->scene.dimension == 2;
}

/* Room for what is read of so many particles; what was there stays. */
static bool make_room(simulation *s, size_t rows)
{
    double **const arrays[] = {&s->position, &s->velocity, &s->flat[2], &s->flat[3]};
    for (size_t k = 0; k < 4; k++) {
        double *grown = realloc(*arrays[k], (rows + 1) * 3 * sizeof *grown);
        if (!grown)
            return false;
        *arrays[k] = grown;
    }
    return true;
}

/* The scene as the method has it. */
static bool hand_over(simulation *s)
{
    const size_t walls = s->scene.wall_count;
    if (!is_flat(s))
        return true;
    for (int k = 0; k < 2; k++) {
        s->flat[k] = malloc((walls + 1) * 2 * sizeof **s->flat);
        if (!s->flat[k])
            return false;
        flatten(k ? s->scene.normal : s->scene.wall, walls, s->flat[k]);
    }
    s->scene.wall = s->flat[0];
    s->scene.normal = s->flat[1];
    return true;
}

/* Rows in the method's layout: in one of the buffers for what is read. */
static const double *as_method(const simulation *s, const double *rows, size_t count, int buffer)
{
    if (!is_flat(s))
        return rows;
    flatten(rows, count, s->flat[buffer]);
    return s->flat[buffer];
}

bool cell_open(cell *c, world *w, simulation *s)
{
    ascc_method_error error = {"refused"};
    const size_t count = w->scene.fluid_count;
    *s = (simulation){.world = w, .scene = w->scene};
    if (!make_room(s, count) || !hand_over(s))
        return cell_fail(c, "no memory");
    memcpy(s->position, w->position, count * 3 * sizeof(double));
    memcpy(s->velocity, w->velocity, count * 3 * sizeof(double));
    if (!c->method->open(c->settings, &s->scene, &s->state, &error))
        return cell_fail(c, "%.100s", error.text);
    if (!c->method->set(s->state, as_method(s, w->position, count, 2),
                        as_method(s, w->velocity, count, 3), ASCC_VELOCITY_STORED, &error))
        return cell_fail(c, "%.100s", error.text);
    return true;
}

static bool cannot(cell *c, const char *what)
{
    c->verdict = NONE;
    snprintf(c->text, sizeof c->text, "cannot: %.110s", what);
    return false;
}

bool cell_has_bodies(cell *c)
{
    return c->method->drive_body || cannot(c, "no bodies that move");
}

bool cell_takes_fluid(cell *c)
{
    return c->method->add_fluid || cannot(c, "no fluid on the way");
}

bool cell_sleeps(cell *c)
{
    return c->method->asleep || cannot(c, "no sleep");
}

double cell_asleep(const cell *c, const simulation *s)
{
    return (double)c->method->asleep(s->state) / (double)s->scene.fluid_count;
}

bool cell_has_ladder(cell *c)
{
    return c->method->set_budget || cannot(c, "no cheaper model");
}

void cell_excuse_ladder(cell *c)
{
    char why[sizeof c->text];
    const char *refusal = strstr(c->text, "detail: ");
    if (!refusal)
        refusal = strstr(c->text, "step: rung ");
    if (c->verdict != FAIL || !refusal)
        return;
    snprintf(why, sizeof why, "%s", refusal);
    (void)cannot(c, why);
}

bool cell_set_budget(cell *c, simulation *s, double particles)
{
    ascc_method_error error = {"no budget can be set"};
    return c->method->set_budget(s->state, particles, &error) || cell_fail(c, "%.100s", error.text);
}

ascc_method_choices cell_choices(const cell *c, const simulation *s)
{
    ascc_method_choices choices = {false, 0, 0};
    c->method->choices(s->state, &choices);
    return choices;
}

bool cell_set_detail(cell *c, simulation *s, const double *weight)
{
    ascc_method_error error = {"no detail can be set"};
    return c->method->set_detail(s->state, weight, &error) || cell_fail(c, "%.100s", error.text);
}

bool cell_drive_body(cell *c, simulation *s, const double velocity[3], const double spin[3])
{
    ascc_method_error error = {"the body cannot be moved"};
    world_move_body(s->world, velocity, spin, s->scene.time_step);
    return c->method->drive_body(s->state, velocity, spin, &error) ||
           cell_fail(c, "%.100s", error.text);
}

void cell_body_impulse(const cell *c, const simulation *s, double impulse[3])
{
    memset(impulse, 0, 3 * sizeof *impulse);
    c->method->body_impulse(s->state, impulse);
}

bool cell_free_body(cell *c, simulation *s, double mass, double velocity[3])
{
    const double still[3] = {0.0, 0.0, 0.0};
    double impulse[3];
    cell_body_impulse(c, s, impulse);
    for (int a = 0; a < s->scene.dimension; a++)
        velocity[a] += impulse[a] / mass + s->scene.time_step * s->scene.gravity[a];
    return cell_drive_body(c, s, velocity, still);
}

bool cell_add_fluid(cell *c, simulation *s, size_t count, const double *position,
                    const double *velocity)
{
    ascc_method_error error = {"no fluid can be added"};
    if (!make_room(s, s->scene.fluid_count + count))
        return cell_fail(c, "no memory");
    if (!c->method->add_fluid(s->state, count, as_method(s, position, count, 2),
                              as_method(s, velocity, count, 3), &error))
        return cell_fail(c, "%.100s", error.text);
    for (size_t i = 0; i < count; i++)
        world_add(s->world, position + 3 * i, velocity + 3 * i);
    s->scene.fluid_count += count;
    return true;
}

void cell_close(cell *c, simulation *s)
{
    if (s->state)
        c->method->close(s->state);
    for (int k = 0; k < 4; k++)
        free(s->flat[k]);
    free(s->position);
    free(s->velocity);
}

/* Flat rows lie at z = 0: but for densities, measures are the same. */
static ascc_measure_set set_of(const simulation *s)
{
    return (ascc_measure_set){.dimension = 3,
                              .count = s->world->scene.fluid_count,
                              .position = s->position,
                              .velocity = s->velocity,
                              .particle_mass = s->world->scene.mass};
}

static void read_fluid(const cell *c, simulation *s)
{
    const size_t count = s->scene.fluid_count;
    c->method->read(s->state, is_flat(s) ? s->flat[2] : s->position,
                    is_flat(s) ? s->flat[3] : s->velocity);
    if (!is_flat(s))
        return;
    deepen(s->flat[2], count, s->position);
    deepen(s->flat[3], count, s->velocity);
}

bool cell_step(cell *c, simulation *s)
{
    ascc_method_error error = {""};
    if (c->verdict != PASS || s->frame >= c->frames)
        return false;
    if ((double)clock() / CLOCKS_PER_SEC - c->start > c->budget) {
        c->verdict = CUT;
        return false;
    }
    s->frame++;
    c->frame = s->frame > c->frame ? s->frame : c->frame;
    if (!c->method->advance(s->state, &error))
        return cell_fail(c, "%.100s", error.text);
    read_fluid(c, s);
    const ascc_measure_set set = set_of(s);
    const size_t bad = ascc_measure_non_finite(&set);
    return bad == 0 || cell_fail(c, "%zu not finite", bad);
}

bool cell_complete(const cell *c, const simulation *s)
{
    return c->verdict == PASS && s->frame == c->frames;
}

ascc_measure_motion_sums cell_motion(const simulation *s)
{
    ascc_measure_motion_sums sums;
    const ascc_measure_set set = set_of(s);
    (void)ascc_measure_motion(&set, s->world->scene.gravity, &sums);
    return sums;
}

bool cell_nothing_escapes(cell *c, const simulation *s)
{
    const ascc_method_scene *scene = &s->world->scene;
    const ascc_measure_set set = set_of(s);
    ascc_measure_escape escape = {0};
    (void)ascc_measure_escapes(&set, scene->wall_count, scene->wall, scene->normal, scene->spacing,
                               1, &escape);
    return escape.count == 0 || cell_fail(c, "%zu escaped", escape.count);
}

bool cell_nothing_clumps(cell *c, const simulation *s)
{
    const ascc_measure_set set = set_of(s);
    ascc_measure_pair_spacing pairs = {0};
    (void)ascc_measure_pairs(&set, s->world->scene.spacing, 1, &pairs);
    return !(pairs.tight_fraction > 0.001) ||
           cell_fail(c, "%.2g %% of pairs < spacing / 5", 100.0 * pairs.tight_fraction);
}

double cell_nearest_pair(const simulation *s)
{
    const ascc_measure_set set = set_of(s);
    ascc_measure_pair_spacing pairs = {0};
    return ascc_measure_pairs(&set, s->world->scene.spacing, 1, &pairs) == ASCC_OK
               ? pairs.min_distance
               : (double)NAN;
}

double cell_density_between(const simulation *s, const double low[3], const double high[3])
{
    const ascc_measure_set set = set_of(s);
    double sum = 0.0, *density = calloc(set.count + 1, sizeof *density);
    size_t count = 0;
    if (!density ||
        ascc_measure_density(&set, 0, NULL, 2.0 * s->world->scene.spacing, 1, density) != ASCC_OK)
        sum = NAN;
    for (size_t i = 0; i < set.count && density; i++) {
        const double *x = s->position + 3 * i;
        bool in = true;
        for (int a = 0; a < s->scene.dimension; a++)
            in = in && x[a] >= low[a] && x[a] <= high[a];
        sum += in ? density[i] : 0.0;
        count += in;
    }
    free(density);
    return sum / (double)count / ascc_measure_rest_density(s->scene.dimension);
}

double cell_density(const simulation *s)
{
    const double low[3] = {-INFINITY, -INFINITY, -INFINITY},
                 high[3] = {INFINITY, INFINITY, INFINITY};
    return cell_density_between(s, low, high);
}

bool cell_slower_than(cell *c, const simulation *s, double speed)
{
    const double fastest = cell_motion(s).max_speed;
    return !(fastest > speed) || cell_fail(c, "%.3g m/s", fastest);
}
