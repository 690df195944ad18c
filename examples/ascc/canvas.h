/* Pixels to draw into: discs, lines, letters. SPDX-License-Identifier: MIT
 *
 * Colours are red, green, blue from 0 to 255; cover says how much of a pixel they take, 1 = all. What lies
 * outside is not drawn. */
#ifndef ASCC_CANVAS_H
#define ASCC_CANVAS_H

#include <stdbool.h>

typedef struct ascc_canvas {
    int width, height;
    unsigned char *pixel; /* [height][width][3], the top row first */
} ascc_canvas;

/* False without memory; ascc_canvas_close either way. */
bool ascc_canvas_open(ascc_canvas *canvas, int width, int height);
void ascc_canvas_close(ascc_canvas *canvas);

/* The ground. */
void ascc_canvas_clear(ascc_canvas *canvas);

void ascc_canvas_dot(ascc_canvas *canvas, int x, int y, const double colour[3], double cover);
/* Lit from the upper left, with a soft rim. */
void ascc_canvas_disc(ascc_canvas *canvas, double x, double y, double radius,
                      const double colour[3], double shade, double cover);
void ascc_canvas_line(ascc_canvas *canvas, double x0, double y0, double x1, double y1,
                      const double colour[3], double cover);
/* Letters of 5 x 7 dots, `size` pixels each, 6 from one to the next; x, y: the upper left corner. */
void ascc_canvas_text(ascc_canvas *canvas, int x, int y, int size, const char *text);

#endif
