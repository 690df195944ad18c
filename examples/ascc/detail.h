/* Where a simulation wants detail: weights of particles by place, speed and depth. SPDX-License-Identifier: MIT */
#ifndef ASCC_DETAIL_WISH_H
#define ASCC_DETAIL_WISH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { ASCC_DETAIL_WISHES = 16 };
enum { ASCC_DETAIL_NEAR = 0, ASCC_DETAIL_FAST = 1, ASCC_DETAIL_SURFACE = 2 };

/** The largest of what each asks for. */
typedef struct ascc_detail {
    size_t count;
    struct {
        int kind;         /* ASCC_DETAIL_NEAR, ... */
        double number[4]; /* a place and a radius, m; a speed, m/s; a depth, m */
    } wish[ASCC_DETAIL_WISHES];
} ascc_detail;

/** Fluid in rows of `dimension` numbers. */
typedef struct ascc_detail_fluid {
    int32_t dimension;
    size_t count;
    const float *position, *velocity;
    double spacing, gravity[3];
} ascc_detail_fluid;

/** near:X,Y[,Z],R  fast:V  surface:D, pluses between them. False if it is none of these. */
bool ascc_detail_read(const char *text, int32_t dimension, ascc_detail *detail);

/** weight[count], from 0 to 1. False without memory. */
bool ascc_detail_weigh(const ascc_detail *detail, const ascc_detail_fluid *fluid, double *weight);

#endif
