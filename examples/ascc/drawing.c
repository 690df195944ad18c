/* Particles and walls drawn as one sees them from a side. SPDX-License-Identifier: MIT */
#include "drawing.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define MARGIN 40

/* From world to screen: a turned and tilted parallel view in 3D, straight on in 2D. */
typedef struct camera {
    double center[3], right[3], up[3], toward[3]; /* toward: out of the picture */
    double scale, middle_x, middle_y;
} camera;

/* Eleven points of a perceptual dark-blue to yellow scale. */
static const unsigned char colour_points[][3] = {
    {48, 18, 120},   {50, 60, 170},  {38, 104, 190}, {24, 142, 188}, {28, 172, 172}, {60, 196, 146},
    {112, 214, 112}, {168, 226, 82}, {218, 228, 62}, {248, 216, 56}, {254, 240, 140}};

static void colour_of(double t, double colour[3])
{
    const double at = fmin(fmax(t, 0.0), 1.0) * 10.0;
    const int i = at >= 10.0 ? 9 : (int)at;
    for (int c = 0; c < 3; c++)
        colour[c] = colour_points[i][c] +
                    (at - i) * ((double)colour_points[i + 1][c] - colour_points[i][c]);
}

static const double home[] = {0.5, 0.35}; /* turn and tilt in 3D */

ascc_view ascc_view_of(const ascc_sequence *first)
{
    ascc_view v = {.dimension = first->dimension,
                   .radius = first->radius,
                   .wall = first->wall,
                   .walls = first->walls,
                   .turn = first->dimension == 3 ? home[0] : 0.0,
                   .tilt = first->dimension == 3 ? home[1] : 0.0,
                   .zoom = 1.0};
    const size_t d = (size_t)first->dimension;
    for (size_t c = 0; c < d; c++) {
        v.low[c] = INFINITY;
        v.high[c] = -INFINITY;
    }
    for (size_t i = 0; i < first->count + first->walls; i++)
        for (size_t c = 0; c < d; c++) {
            const float *row =
                i < first->count ? first->position + i * d : first->wall + (i - first->count) * d;
            v.low[c] = fmin(v.low[c], (double)row[c]);
            v.high[c] = fmax(v.high[c], (double)row[c]);
        }
    double deepest = 0.0;
    for (size_t c = 0; c < d; c++)
        deepest = fmax(deepest, v.high[c] - v.low[c]);
    if (!first->walls)
        for (size_t c = 0; c < d; c++) {
            v.low[c] -= 0.35 * deepest;
            v.high[c] += 0.35 * deepest;
        }
    double g = 0.0;
    for (size_t c = 0; c < d; c++)
        g += first->gravity[c] * first->gravity[c];
    v.fastest = g > 0.0 ? 0.8 * sqrt(2.0 * sqrt(g) * (v.high[1] - v.low[1])) : 1.5;
    return v;
}

static double dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static void project(const camera *cam, const double x[3], double out[3])
{
    const double r[3] = {x[0] - cam->center[0], x[1] - cam->center[1], x[2] - cam->center[2]};
    out[0] = cam->middle_x + cam->scale * dot(r, cam->right);
    out[1] = cam->middle_y - cam->scale * dot(r, cam->up);
    out[2] = dot(r, cam->toward);
}

static void corner_of(const ascc_view *v, int k, double x[3])
{
    for (int c = 0; c < 3; c++)
        x[c] = c >= v->dimension ? 0.0 : k >> c & 1 ? v->high[c] : v->low[c];
}

static void turn_to(camera *cam, double turn, double tilt)
{
    const double right[3] = {cos(turn), 0.0, sin(turn)};
    const double up[3] = {sin(tilt) * sin(turn), cos(tilt), -sin(tilt) * cos(turn)};
    const double toward[3] = {-sin(turn) * cos(tilt), sin(tilt), cos(turn) * cos(tilt)};
    memcpy(cam->right, right, sizeof right);
    memcpy(cam->up, up, sizeof up);
    memcpy(cam->toward, toward, sizeof toward);
}

/* The scale is that of the home position, so that the box keeps its size while it is turned. */
static camera aim(const ascc_view *v, const ascc_canvas *c)
{
    const bool deep = v->dimension == 3;
    camera cam = {.scale = 1.0, .middle_x = c->width / 2.0, .middle_y = c->height / 2.0};
    turn_to(&cam, deep ? home[0] : 0.0, deep ? home[1] : 0.0);
    for (int k = 0; k < v->dimension; k++)
        cam.center[k] = 0.5 * (v->low[k] + v->high[k]);
    double half_x = 0.0, half_y = 0.0;
    for (int k = 0; k < 8; k++) {
        double x[3], p[3];
        corner_of(v, k, x);
        project(&cam, x, p);
        half_x = fmax(half_x, fabs(p[0] - cam.middle_x));
        half_y = fmax(half_y, fabs(p[1] - cam.middle_y));
    }
    cam.scale = v->zoom *
                fmin((c->width / 2.0 - MARGIN) / half_x, (c->height / 2.0 - 1.6 * MARGIN) / half_y);
    turn_to(&cam, v->turn, v->tilt);
    return cam;
}

double ascc_view_pixel(const ascc_view *v, const ascc_canvas *c, const double *point,
                       double pixel[2])
{
    const camera cam = aim(v, c);
    double x[3] = {0.0, 0.0, 0.0}, p[3];
    memcpy(x, point, (size_t)v->dimension * sizeof *x);
    project(&cam, x, p);
    memcpy(pixel, p, 2 * sizeof *pixel);
    return cam.scale;
}

void ascc_view_shift(const ascc_view *v, const ascc_canvas *c, const double pixels[2],
                     double shift[3])
{
    const camera cam = aim(v, c);
    for (int k = 0; k < 3; k++)
        shift[k] = (pixels[0] * cam.right[k] - pixels[1] * cam.up[k]) / cam.scale;
}

static void draw_box(ascc_canvas *c, const ascc_view *v, const camera *cam)
{
    static const double ink[3] = {120, 132, 150};
    for (int k = 0; v->walls && k < 8; k++)
        for (int axis = 0; axis < v->dimension; axis++) {
            double a[3], b[3], p[3], q[3];
            if (k >> axis & 1)
                continue;
            corner_of(v, k, a);
            corner_of(v, k | 1 << axis, b);
            project(cam, a, p);
            project(cam, b, q);
            ascc_canvas_line(c, p[0], p[1], q[0], q[1], ink, 0.55);
        }
}

/* Wall points: discs in 2D; in 3D only those that face away, as faint dots, so the fluid is seen. */
static void draw_walls(ascc_canvas *c, const ascc_view *v, const camera *cam)
{
    static const double ink[3] = {126, 138, 156};
    for (size_t i = 0; i < v->walls; i++) {
        double x[3] = {0.0, 0.0, 0.0}, p[3];
        for (int k = 0; k < v->dimension; k++)
            x[k] = (double)v->wall[i * (size_t)v->dimension + (size_t)k];
        project(cam, x, p);
        if (v->dimension == 2)
            ascc_canvas_disc(c, p[0], p[1], fmax(1.5, v->radius * cam->scale * 0.7), ink, 0.9, 1.0);
        else if (p[2] <= 0.0)
            ascc_canvas_dot(c, (int)lround(p[0]), (int)lround(p[1]), ink, 0.30);
    }
}

typedef struct mark_at {
    double x, y, depth, value;
    bool body;
} mark_at;

static int by_depth(const void *a, const void *b)
{
    const double x = ((const mark_at *)a)->depth, y = ((const mark_at *)b)->depth;
    return (x > y) - (x < y);
}

static mark_at place(const camera *cam, size_t d, const float *position, size_t i)
{
    double x[3] = {0.0, 0.0, 0.0}, p[3];
    for (size_t k = 0; k < d; k++)
        x[k] = (double)position[i * d + k];
    project(cam, x, p);
    return (mark_at){.x = p[0], .y = p[1], .depth = p[2]};
}

static void draw_mark(ascc_canvas *c, const mark_at *mark, double radius, double shade)
{
    static const double solid[3] = {226, 122, 92};
    double colour[3];
    colour_of(mark->value, colour);
    ascc_canvas_disc(c, mark->x, mark->y, radius, mark->body ? solid : colour, shade, 1.0);
}

/* Fluid and body, the farthest first. */
static bool draw_marks(ascc_canvas *c, const ascc_view *v, const camera *cam, const ascc_marks *m)
{
    const size_t d = (size_t)v->dimension, count = m->count + m->body_count;
    mark_at *all = malloc((count + 1) * sizeof *all);
    if (!all)
        return false;
    double near = -INFINITY, far = INFINITY;
    for (size_t i = 0; i < count; i++) {
        const bool body = i >= m->count;
        all[i] = place(cam, d, body ? m->body : m->position, body ? i - m->count : i);
        all[i].body = body;
        all[i].value = body ? 0.0 : ((double)m->value[i] - m->low) / (m->high - m->low);
        near = fmax(near, all[i].depth);
        far = fmin(far, all[i].depth);
    }
    if (d == 3)
        qsort(all, count, sizeof *all, by_depth);
    const double radius = fmax(1.3, v->radius * cam->scale * (d == 3 ? 1.15 : 1.0));
    for (size_t i = 0; i < count; i++) {
        const double depth = near > far ? (all[i].depth - far) / (near - far) : 1.0;
        draw_mark(c, &all[i], radius, d == 3 ? 0.62 + 0.46 * depth : 1.05);
    }
    free(all);
    return true;
}

static void draw_scale(ascc_canvas *c, const ascc_marks *m)
{
    const int left = c->width - MARGIN - 240;
    char text[48];
    for (int i = 0; i < 240; i++) {
        double colour[3];
        colour_of(i / 239.0, colour);
        for (int j = 0; j < 12; j++)
            ascc_canvas_dot(c, left + i, 22 + j, colour, 1.0);
    }
    (void)snprintf(text, sizeof text, "%g", m->low);
    ascc_canvas_text(c, left, 40, 2, text);
    (void)snprintf(text, sizeof text, "%.1f %s", m->high, m->unit);
    ascc_canvas_text(c, c->width - MARGIN - 12 * (int)strlen(text) + 2, 40, 2, text);
}

bool ascc_draw(ascc_canvas *c, const ascc_view *v, const ascc_marks *m)
{
    const camera cam = aim(v, c);
    ascc_canvas_clear(c);
    draw_walls(c, v, &cam);
    draw_box(c, v, &cam);
    const bool good = draw_marks(c, v, &cam, m);
    draw_scale(c, m);
    return good;
}

void ascc_speeds(int32_t dimension, size_t count, const float *velocity, float *speed)
{
    const size_t d = (size_t)dimension;
    for (size_t i = 0; i < count; i++) {
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += (double)velocity[i * d + c] * (double)velocity[i * d + c];
        speed[i] = (float)sqrt(square);
    }
}
