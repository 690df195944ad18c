/* Pictures of particles as PNG files. SPDX-License-Identifier: MIT */
#ifndef ASCC_PICTURE_H
#define ASCC_PICTURE_H

#include "sequence.h"

/* What stays the same through the frames of a run. */
typedef struct ascc_view {
    int32_t dimension;
    double low[3], high[3]; /* the box shown */
    double radius;          /* of a particle, m */
    double fastest;         /* speed at the end of the colour bar, m/s */
    const float *wall;      /* [walls][dimension] */
    size_t walls;
} ascc_view;

/* The box that holds a first frame and its walls, with room to move where there are none. */
ascc_view ascc_view_of(const ascc_sequence *first);

/* Draws one frame: particles shaded by speed, walls, colour bar, and a line of text. */
bool ascc_picture_write(const char *path, const ascc_view *view, const float *position,
                        const float *velocity, size_t count, const char *text, char *error,
                        size_t capacity);

#endif
