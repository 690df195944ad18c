/* Particles and walls drawn as one sees them from a side. SPDX-License-Identifier: MIT */
#ifndef ASCC_DRAWING_H
#define ASCC_DRAWING_H

#include "canvas.h"
#include "sequence.h"

/* What stays the same through the frames of a run, and from where it is seen. */
typedef struct ascc_view {
    int32_t dimension;
    double low[3], high[3]; /* the box shown */
    double radius;          /* of a particle, m */
    double fastest;         /* speed at the end of the colour bar, m/s */
    const float *wall;      /* [walls][dimension] */
    size_t walls;
    double turn, tilt; /* about the vertical axis, and from above; radians. 0 in 2D */
    double zoom;       /* 1: the box fills the picture */
} ascc_view;

/* One instant. */
typedef struct ascc_marks {
    size_t count;
    const float *position; /* [count][dimension], m */
    const float *value;    /* [count], told by colours: */
    double low, high;      /* at the ends of their bar */
    const char *unit;
    size_t body_count; /* points of a body in the fluid */
    const float *body; /* [body_count][dimension] */
} ascc_marks;

/* The box that holds a first frame and its walls, with room to move where there are none. */
ascc_view ascc_view_of(const ascc_sequence *first);

/* Draws it all: ground, walls, fluid, colour bar. False without memory. */
bool ascc_draw(ascc_canvas *canvas, const ascc_view *view, const ascc_marks *marks);

/* Where a point [dimension] is seen, in pixels; returns how many pixels a metre is. */
double ascc_view_pixel(const ascc_view *view, const ascc_canvas *canvas, const double *point,
                       double pixel[2]);
/* How far a point moves in the picture's plane, m, where it is drawn by so many pixels. */
void ascc_view_shift(const ascc_view *view, const ascc_canvas *canvas, const double pixels[2],
                     double shift[3]);

/* Speeds [count] of velocities [count][dimension]. */
void ascc_speeds(int32_t dimension, size_t count, const float *velocity, float *speed);

#endif
