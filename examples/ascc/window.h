/* A window for a canvas, and what people do in it: the seam to the system. SPDX-License-Identifier: MIT
 *
 * window_sdl.c has it by SDL2; window_none.c, in a program built without, has none to open. */
#ifndef ASCC_WINDOW_H
#define ASCC_WINDOW_H

#include "canvas.h"
#include <stddef.h>

typedef enum ascc_input_kind {
    ASCC_INPUT_QUIT,
    ASCC_INPUT_KEY,
    ASCC_INPUT_PRESS, /* of the left button */
    ASCC_INPUT_RELEASE,
    ASCC_INPUT_MOVE,
    ASCC_INPUT_WHEEL,
} ascc_input_kind;

typedef struct ascc_input {
    ascc_input_kind kind;
    char key;    /* its letter; '.' and ',' also for right and left, 'q' for escape */
    double x, y; /* where, in pixels of the canvas */
    double turn; /* of the wheel: positive away from the hand */
} ascc_input;

typedef struct ascc_window ascc_window;

/* NULL with one line in error. */
ascc_window *ascc_window_open(const char *title, int width, int height, char *error,
                              size_t capacity);
void ascc_window_close(ascc_window *window);

void ascc_window_show(ascc_window *window, const ascc_canvas *canvas);
/* The next thing that was done, in order; false if there is none yet. */
bool ascc_window_next(ascc_window *window, ascc_input *input);
/* Does it, as if by hand. */
void ascc_window_do(ascc_window *window, const ascc_input *input);

/* Seconds since some instant, and a rest of so many. */
double ascc_window_clock(void);
void ascc_window_rest(double seconds);

#endif
