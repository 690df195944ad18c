/* No window: the program was built without SDL2. SPDX-License-Identifier: MIT */
#include "window.h"

#include <stdio.h>

ascc_window *ascc_window_open(const char *title, int width, int height, char *error,
                              size_t capacity)
{
    (void)title, (void)width, (void)height;
    (void)snprintf(error, capacity, "no window: this program was built without SDL2");
    return NULL;
}

void ascc_window_close(ascc_window *window)
{
    (void)window;
}

void ascc_window_show(ascc_window *window, const ascc_canvas *canvas)
{
    (void)window, (void)canvas;
}

bool ascc_window_next(ascc_window *window, ascc_input *input)
{
    (void)window, (void)input;
    return false;
}

void ascc_window_do(ascc_window *window, const ascc_input *input)
{
    (void)window, (void)input;
}

double ascc_window_clock(void)
{
    return 0.0;
}

void ascc_window_rest(double seconds)
{
    (void)seconds;
}
