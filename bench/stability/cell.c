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

bool cell_open(cell *c, const world *w, simulation *s)
{
    ascc_method_error error = {"refused"};
    const size_t bytes = (w->scene.fluid_count + 1) * 3 * sizeof(double);
    *s = (simulation){.world = w, .position = malloc(bytes), .velocity = malloc(bytes)};
    if (!s->position || !s->velocity)
        return cell_fail(c, "no memory");
    memcpy(s->position, w->position, bytes - 3 * sizeof(double));
    memcpy(s->velocity, w->velocity, bytes - 3 * sizeof(double));
    if (!c->method->open(c->settings, &w->scene, &s->state, &error))
        return cell_fail(c, "%.100s", error.text);
    if (!c->method->set(s->state, w->position, w->velocity, ASCC_VELOCITY_STORED, &error))
        return cell_fail(c, "%.100s", error.text);
    return true;
}

bool cell_has_bodies(cell *c)
{
    if (c->method->move_body)
        return true;
    c->verdict = NONE;
    snprintf(c->text, sizeof c->text, "no bodies that move");
    return false;
}

bool cell_move_body(cell *c, simulation *s, world *w, double mass, double velocity[3])
{
    const ascc_method_scene *scene = &w->scene;
    ascc_method_error error = {"the body cannot be moved"};
    double impulse[3], by[3];
    c->method->body_impulse(s->state, impulse);
    for (int a = 0; a < 3; a++) {
        velocity[a] += impulse[a] / mass + scene->time_step * scene->gravity[a];
        by[a] = scene->time_step * velocity[a];
        for (size_t i = scene->wall_count - scene->body_count; i < scene->wall_count; i++)
            w->wall[3 * i + (size_t)a] += by[a];
    }
    return c->method->move_body(s->state, by, &error) || cell_fail(c, "%.100s", error.text);
}

void cell_close(cell *c, simulation *s)
{
    if (s->state)
        c->method->close(s->state);
    free(s->position);
    free(s->velocity);
}

static ascc_measure_set set_of(const simulation *s)
{
    return (ascc_measure_set){.dimension = 3,
                              .count = s->world->scene.fluid_count,
                              .position = s->position,
                              .velocity = s->velocity,
                              .particle_mass = s->world->scene.mass};
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
    c->method->read(s->state, s->position, s->velocity);
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

double cell_density(const simulation *s)
{
    const ascc_measure_set set = set_of(s);
    double sum = 0.0, *density = calloc(set.count + 1, sizeof *density);
    if (!density ||
        ascc_measure_density(&set, 0, NULL, 2.0 * s->world->scene.spacing, 1, density) != ASCC_OK)
        sum = NAN;
    for (size_t i = 0; i < set.count && density; i++)
        sum += density[i];
    free(density);
    return sum / (double)set.count / ascc_measure_rest_density(3);
}

bool cell_slower_than(cell *c, const simulation *s, double speed)
{
    const double fastest = cell_motion(s).max_speed;
    return !(fastest > speed) || cell_fail(c, "%.3g m/s", fastest);
}
