/* The way back through pairs along the lines that the network sees, where positions are constants: a few numbers
 * a pair, in floats. SPDX-License-Identifier: MIT */
#ifndef ASCC_LINE_REVERSE_H
#define ASCC_LINE_REVERSE_H

#include "network.h"

typedef struct ascc_line_reverse {
    const ascc_lines *lines; /* no places; with coefficients of walls, too */
    const ascc_rows *rows;   /* of a set in itself, or in walls */
    const ascc_kernels *kernels;
    const float *force; /* [row][4] gradient of impulses; walls have none */
    float *coefficient; /* [row][16] += gradient */
    float *motion;      /* rows as far apart as those of lines->motion, += gradient; or NULL */
} ascc_line_reverse;

void ascc_line_reverse_run(const ascc_line_reverse *reverse);

#endif
