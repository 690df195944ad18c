/* Pictures of particles as PNG files. SPDX-License-Identifier: MIT */
#include "picture.h"

#include <png.h>
#include <stdio.h>
#include <stdlib.h>

#include "new_file.h"

enum { WIDTH = 1280, HEIGHT = 720 };

bool ascc_picture_save(const char *path, const ascc_canvas *canvas, char *error, size_t capacity)
{
    ascc_new_file output;
    png_image image = {.version = PNG_IMAGE_VERSION,
                       .width = (png_uint_32)canvas->width,
                       .height = (png_uint_32)canvas->height,
                       .format = PNG_FORMAT_RGB};
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    const bool good =
        png_image_write_to_stdio(&image, output.stream, 0, canvas->pixel, 0, NULL) != 0;
    if (!good)
        (void)snprintf(error, capacity, "%s: the picture cannot be written: %s", path,
                       image.message);
    return ascc_new_file_close(&output, good, error, capacity) && good;
}

bool ascc_picture_write(const char *path, const ascc_view *view, const float *position,
                        const float *velocity, size_t count, const char *text, char *error,
                        size_t capacity)
{
    ascc_canvas canvas;
    float *speed = malloc((count + 1) * sizeof *speed);
    const ascc_marks marks = {
        .count = count, .position = position, .value = speed, .high = view->fastest, .unit = "m/s"};
    bool good = ascc_canvas_open(&canvas, WIDTH, HEIGHT) && speed != NULL;
    if (good) {
        ascc_speeds(view->dimension, count, velocity, speed);
        good = ascc_draw(&canvas, view, &marks);
    }
    if (good) {
        ascc_canvas_text(&canvas, 40, 22, 2, text);
        good = ascc_picture_save(path, &canvas, error, capacity);
    } else {
        (void)snprintf(error, capacity, "%s: no memory for a picture", path);
    }
    ascc_canvas_close(&canvas);
    free(speed);
    return good;
}
