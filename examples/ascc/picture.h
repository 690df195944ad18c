/* Pictures of particles as PNG files. SPDX-License-Identifier: MIT */
#ifndef ASCC_PICTURE_H
#define ASCC_PICTURE_H

#include "drawing.h"

/* Draws one frame: particles shaded by speed, walls, colour bar, and a line of text. */
bool ascc_picture_write(const char *path, const ascc_view *view, const float *position,
                        const float *velocity, size_t count, const char *text, char *error,
                        size_t capacity);
bool ascc_picture_save(const char *path, const ascc_canvas *canvas, char *error, size_t capacity);

#endif
