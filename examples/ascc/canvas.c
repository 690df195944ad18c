/* Pixels to draw into: discs, lines, letters. SPDX-License-Identifier: MIT */
#include "canvas.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

bool ascc_canvas_open(ascc_canvas *c, int width, int height)
{
    *c = (ascc_canvas){width, height, malloc((size_t)width * (size_t)height * 3)};
    return c->pixel != NULL;
}

void ascc_canvas_close(ascc_canvas *c)
{
    free(c->pixel);
    c->pixel = NULL;
}

void ascc_canvas_clear(ascc_canvas *c)
{
    for (int y = 0; y < c->height; y++) /* a dark ground, lighter towards the floor */
        for (int x = 0; x < c->width; x++) {
            unsigned char *p = c->pixel + ((size_t)y * (size_t)c->width + (size_t)x) * 3;
            p[0] = (unsigned char)(16 + 12 * y / c->height);
            p[1] = (unsigned char)(20 + 14 * y / c->height);
            p[2] = (unsigned char)(30 + 16 * y / c->height);
        }
}

void ascc_canvas_dot(ascc_canvas *c, int x, int y, const double colour[3], double cover)
{
    if (x < 0 || y < 0 || x >= c->width || y >= c->height)
        return;
    unsigned char *p = c->pixel + ((size_t)y * (size_t)c->width + (size_t)x) * 3;
    for (int k = 0; k < 3; k++)
        p[k] = (unsigned char)(fmin(255.0, fmax(0.0, p[k] + cover * (colour[k] - p[k]))) + 0.5);
}

void ascc_canvas_disc(ascc_canvas *c, double x, double y, double radius, const double colour[3],
                      double shade, double cover)
{
    if (!(x > -radius && x < c->width + radius && y > -radius && y < c->height + radius))
        return;
    const int left = (int)fmax(floor(x - radius), 0.0), top = (int)fmax(floor(y - radius), 0.0);
    const int right = (int)fmin(ceil(x + radius), c->width - 1.0);
    const int bottom = (int)fmin(ceil(y + radius), c->height - 1.0);
    for (int py = top; py <= bottom; py++)
        for (int px = left; px <= right; px++) {
            const double dx = (px - x) / radius, dy = (py - y) / radius;
            const double d = sqrt(dx * dx + dy * dy);
            const double inside = fmin(1.0, (1.0 - d) * radius + 0.5);
            if (inside <= 0.0)
                continue;
            const double light = shade * (1.0 - 0.38 * d * d - 0.16 * (dx + dy));
            const double lit[3] = {colour[0] * light, colour[1] * light, colour[2] * light};
            ascc_canvas_dot(c, px, py, lit, inside * cover);
        }
}

void ascc_canvas_line(ascc_canvas *c, double x0, double y0, double x1, double y1,
                      const double colour[3], double cover)
{
    const double far = fmax(fmax(fabs(x0), fabs(y0)), fmax(fabs(x1), fabs(y1)));
    if (!(far < 1e6)) /* of a view that is zoomed in beyond all sense */
        return;
    const int steps = (int)ceil(fmax(fabs(x1 - x0), fabs(y1 - y0))) + 1;
    for (int i = 0; i <= steps; i++) {
        const double t = (double)i / steps;
        ascc_canvas_dot(c, (int)lround(x0 + t * (x1 - x0)), (int)lround(y0 + t * (y1 - y0)), colour,
                        cover);
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

void ascc_canvas_text(ascc_canvas *c, int x, int y, int size, const char *text)
{
    static const double ink[3] = {215, 222, 232};
    for (; *text; text++, x += 6 * size) {
        const char lower = *text >= 'A' && *text <= 'Z' ? (char)(*text + 32) : *text;
        const char *at = strchr(letters, lower);
        const unsigned char *shape = dots[at ? at - letters : 0];
        for (int i = 0; i < 5 * size; i++)
            for (int j = 0; j < 7 * size; j++)
                if (shape[i / size] >> (j / size) & 1)
                    ascc_canvas_dot(c, x + i, y + j, ink, 1.0);
    }
}
