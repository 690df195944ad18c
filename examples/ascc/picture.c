/* A small software renderer: discs sorted by depth, a bitmap font, libpng.
 * SPDX-License-Identifier: MIT */
#include "picture.h"
#include "new_file.h"

#include <math.h>
#include <png.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define WIDTH 1280
#define HEIGHT 720
#define MARGIN 40

typedef struct canvas {
    unsigned char *pixel; /* [HEIGHT][WIDTH][3] */
} canvas;

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

static void blend(canvas *c, int x, int y, const double colour[3], double cover)
{
    if (x < 0 || y < 0 || x >= WIDTH || y >= HEIGHT)
        return;
    unsigned char *p = c->pixel + ((size_t)y * WIDTH + (size_t)x) * 3;
    for (int k = 0; k < 3; k++)
        p[k] = (unsigned char)lround(fmin(255.0, fmax(0.0, p[k] + cover * (colour[k] - p[k]))));
}

/* A disc lit from the upper left, with a soft rim. */
static void disc(canvas *c, double x, double y, double radius, const double colour[3], double shade,
                 double cover)
{
    for (int py = (int)floor(y - radius); py <= (int)ceil(y + radius); py++)
        for (int px = (int)floor(x - radius); px <= (int)ceil(x + radius); px++) {
            const double dx = (px - x) / radius, dy = (py - y) / radius;
            const double d = sqrt(dx * dx + dy * dy);
            const double inside = fmin(1.0, (1.0 - d) * radius + 0.5);
            if (inside <= 0.0)
                continue;
            const double light = shade * (1.0 - 0.38 * d * d - 0.16 * (dx + dy));
            const double lit[3] = {colour[0] * light, colour[1] * light, colour[2] * light};
            blend(c, px, py, lit, inside * cover);
        }
}

static void line(canvas *c, double x0, double y0, double x1, double y1, const double colour[3],
                 double cover)
{
    const int steps = (int)ceil(fmax(fabs(x1 - x0), fabs(y1 - y0))) + 1;
    for (int i = 0; i <= steps; i++) {
        const double t = (double)i / steps;
        blend(c, (int)lround(x0 + t * (x1 - x0)), (int)lround(y0 + t * (y1 - y0)), colour, cover);
    }
}

/* ---- Text: 5 x 7 dots a letter, one byte a column, lowest bit on top ---- */

static const char letters[] = " 0123456789.,:-+/=%()abcdefghijklmnopqrstuvwxyz";
static const unsigned char dots[][5] = {
    {0x00, 0x00, 0x00, 0x00, 0x00}, {0x3e, 0x51, 0x49, 0x45, 0x3e}, {0x00, 0x42, 0x7f, 0x40, 0x00},
    {0x42, 0x61, 0x51, 0x49, 0x46}, {0x21, 0x41, 0x45, 0x4b, 0x31}, {0x18, 0x14, 0x12, 0x7f, 0x10},
    {0x27, 0x45, 0x45, 0x45, 0x39}, {0x3c, 0x4a, 0x49, 0x49, 0x30}, {0x01, 0x71, 0x09, 0x05, 0x03},
    {0x36, 0x49, 0x49, 0x49, 0x36}, {0x06, 0x49, 0x49, 0x29, 0x1e}, {0x00, 0x60, 0x60, 0x00, 0x00},
    {0x00, 0x50, 0x30, 0x00, 0x00}, {0x00, 0x36, 0x36, 0x00, 0x00}, {0x08, 0x08, 0x08, 0x08, 0x08},
    {0x08, 0x08, 0x3e, 0x08, 0x08}, {0x20, 0x10, 0x08, 0x04, 0x02}, {0x14, 0x14, 0x14, 0x14, 0x14},
    {0x23, 0x13, 0x08, 0x64, 0x62}, {0x00, 0x1c, 0x22, 0x41, 0x00}, {0x00, 0x41, 0x22, 0x1c, 0x00},
    {0x20, 0x54, 0x54, 0x54, 0x78}, {0x7f, 0x48, 0x44, 0x44, 0x38}, {0x38, 0x44, 0x44, 0x44, 0x20},
    {0x38, 0x44, 0x44, 0x48, 0x7f}, {0x38, 0x54, 0x54, 0x54, 0x18}, {0x08, 0x7e, 0x09, 0x01, 0x02},
    {0x08, 0x54, 0x54, 0x54, 0x3c}, {0x7f, 0x08, 0x04, 0x04, 0x78}, {0x00, 0x44, 0x7d, 0x40, 0x00},
    {0x20, 0x40, 0x44, 0x3d, 0x00}, {0x7f, 0x10, 0x28, 0x44, 0x00}, {0x00, 0x41, 0x7f, 0x40, 0x00},
    {0x7c, 0x04, 0x18, 0x04, 0x78}, {0x7c, 0x08, 0x04, 0x04, 0x78}, {0x38, 0x44, 0x44, 0x44, 0x38},
    {0x7c, 0x14, 0x14, 0x14, 0x08}, {0x08, 0x14, 0x14, 0x18, 0x7c}, {0x7c, 0x08, 0x04, 0x04, 0x08},
    {0x48, 0x54, 0x54, 0x54, 0x20}, {0x04, 0x3f, 0x44, 0x40, 0x20}, {0x3c, 0x40, 0x40, 0x20, 0x7c},
    {0x1c, 0x20, 0x40, 0x20, 0x1c}, {0x3c, 0x40, 0x30, 0x40, 0x3c}, {0x44, 0x28, 0x10, 0x28, 0x44},
    {0x0c, 0x50, 0x50, 0x50, 0x3c}, {0x44, 0x64, 0x54, 0x4c, 0x44}};

static void write_text(canvas *c, int x, int y, int size, const char *text)
{
    static const double ink[3] = {215, 222, 232};
    for (; *text; text++, x += 6 * size) {
        const char lower = *text >= 'A' && *text <= 'Z' ? (char)(*text + 32) : *text;
        const char *at = strchr(letters, lower);
        const unsigned char *shape = dots[at ? at - letters : 0];
        for (int i = 0; i < 5 * size; i++)
            for (int j = 0; j < 7 * size; j++)
                if (shape[i / size] >> (j / size) & 1)
                    blend(c, x + i, y + j, ink, 1.0);
    }
}

/* ---- The view ---- */

ascc_view ascc_view_of(const ascc_sequence *first)
{
    ascc_view v = {.dimension = first->dimension,
                   .radius = first->radius,
                   .wall = first->wall,
                   .walls = first->walls};
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

static camera aim(const ascc_view *v)
{
    const double turn = v->dimension == 3 ? 0.5 : 0.0, tilt = v->dimension == 3 ? 0.35 : 0.0;
    camera cam = {.right = {cos(turn), 0.0, sin(turn)},
                  .up = {-sin(tilt) * -sin(turn), cos(tilt), -sin(tilt) * cos(turn)},
                  .toward = {-sin(turn) * cos(tilt), sin(tilt), cos(turn) * cos(tilt)},
                  .scale = 1.0,
                  .middle_x = WIDTH / 2.0,
                  .middle_y = HEIGHT / 2.0};
    for (int c = 0; c < v->dimension; c++)
        cam.center[c] = 0.5 * (v->low[c] + v->high[c]);
    double half_x = 0.0, half_y = 0.0;
    for (int k = 0; k < 8; k++) {
        double x[3], p[3];
        corner_of(v, k, x);
        project(&cam, x, p);
        half_x = fmax(half_x, fabs(p[0] - cam.middle_x));
        half_y = fmax(half_y, fabs(p[1] - cam.middle_y));
    }
    cam.scale = fmin((WIDTH / 2.0 - MARGIN) / half_x, (HEIGHT / 2.0 - 1.6 * MARGIN) / half_y);
    return cam;
}

static void draw_box(canvas *c, const ascc_view *v, const camera *cam)
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
            line(c, p[0], p[1], q[0], q[1], ink, 0.55);
        }
}

/* Wall points: discs in 2D; in 3D only those that face away, as faint dots, so the fluid is seen. */
static void draw_walls(canvas *c, const ascc_view *v, const camera *cam)
{
    static const double ink[3] = {126, 138, 156};
    for (size_t i = 0; i < v->walls; i++) {
        double x[3] = {0.0, 0.0, 0.0}, p[3];
        for (int k = 0; k < v->dimension; k++)
            x[k] = (double)v->wall[i * (size_t)v->dimension + (size_t)k];
        project(cam, x, p);
        if (v->dimension == 2)
            disc(c, p[0], p[1], fmax(1.5, v->radius * cam->scale * 0.7), ink, 0.9, 1.0);
        else if (p[2] <= 0.0)
            blend(c, (int)lround(p[0]), (int)lround(p[1]), ink, 0.30);
    }
}

typedef struct dot_at {
    double x, y, depth, speed;
} dot_at;

static int by_depth(const void *a, const void *b)
{
    const double x = ((const dot_at *)a)->depth, y = ((const dot_at *)b)->depth;
    return (x > y) - (x < y);
}

static bool draw_fluid(canvas *c, const ascc_view *v, const camera *cam, const float *position,
                       const float *velocity, size_t count)
{
    const size_t d = (size_t)v->dimension;
    dot_at *dots_at = malloc((count + 1) * sizeof *dots_at);
    if (!dots_at)
        return false;
    double near = -INFINITY, far = INFINITY;
    for (size_t i = 0; i < count; i++) {
        double x[3] = {0.0, 0.0, 0.0}, p[3], square = 0.0;
        for (size_t k = 0; k < d; k++) {
            x[k] = (double)position[i * d + k];
            square += (double)velocity[i * d + k] * (double)velocity[i * d + k];
        }
        project(cam, x, p);
        dots_at[i] = (dot_at){p[0], p[1], p[2], sqrt(square)};
        near = fmax(near, p[2]);
        far = fmin(far, p[2]);
    }
    if (d == 3)
        qsort(dots_at, count, sizeof *dots_at, by_depth);
    const double radius = fmax(1.3, v->radius * cam->scale * (d == 3 ? 1.15 : 1.0));
    for (size_t i = 0; i < count; i++) {
        double colour[3];
        colour_of(dots_at[i].speed / v->fastest, colour);
        const double depth = near > far ? (dots_at[i].depth - far) / (near - far) : 1.0;
        disc(c, dots_at[i].x, dots_at[i].y, radius, colour, d == 3 ? 0.62 + 0.46 * depth : 1.05,
             1.0);
    }
    free(dots_at);
    return true;
}

static void draw_scale(canvas *c, const ascc_view *v)
{
    char text[48];
    for (int i = 0; i < 240; i++) {
        double colour[3];
        colour_of(i / 239.0, colour);
        for (int j = 0; j < 12; j++)
            blend(c, WIDTH - MARGIN - 240 + i, 22 + j, colour, 1.0);
    }
    write_text(c, WIDTH - MARGIN - 240, 40, 2, "0");
    (void)snprintf(text, sizeof text, "%.1f m/s", v->fastest);
    write_text(c, WIDTH - MARGIN - 12 * (int)strlen(text) + 2, 40, 2, text);
}

static bool write_png(const char *path, png_image *image, const unsigned char *pixel, char *error,
                      size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    const bool good = png_image_write_to_stdio(image, output.stream, 0, pixel, 0, NULL) != 0;
    if (!good)
        (void)snprintf(error, capacity, "%s: the picture cannot be written: %s", path,
                       image->message);
    return ascc_new_file_close(&output, good, error, capacity) && good;
}

bool ascc_picture_write(const char *path, const ascc_view *view, const float *position,
                        const float *velocity, size_t count, const char *text, char *error,
                        size_t capacity)
{
    canvas c = {malloc((size_t)WIDTH * HEIGHT * 3)};
    if (!c.pixel) {
        (void)snprintf(error, capacity, "%s: no memory for a picture", path);
        return false;
    }
    for (int y = 0; y < HEIGHT; y++) /* a dark ground, lighter towards the floor */
        for (int x = 0; x < WIDTH; x++) {
            unsigned char *p = c.pixel + ((size_t)y * WIDTH + (size_t)x) * 3;
            p[0] = (unsigned char)(16 + 12 * y / HEIGHT);
            p[1] = (unsigned char)(20 + 14 * y / HEIGHT);
            p[2] = (unsigned char)(30 + 16 * y / HEIGHT);
        }
    const camera cam = aim(view);
    draw_walls(&c, view, &cam);
    draw_box(&c, view, &cam);
    bool good = draw_fluid(&c, view, &cam, position, velocity, count);
    draw_scale(&c, view);
    write_text(&c, MARGIN, 22, 2, text);
    png_image image = {
        .version = PNG_IMAGE_VERSION, .width = WIDTH, .height = HEIGHT, .format = PNG_FORMAT_RGB};
    if (!good)
        (void)snprintf(error, capacity, "%s: no memory for a picture", path);
    good = good && write_png(path, &image, c.pixel, error, capacity);
    free(c.pixel);
    return good;
}
