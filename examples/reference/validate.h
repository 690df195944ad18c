/* What the parts of validate-reference share. SPDX-License-Identifier: MIT */
#ifndef REFERENCE_VALIDATE_H
#define REFERENCE_VALIDATE_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "base/common.h"

#define G 9.81
#define DAM_FRAMES 80
#define DAM_STEP 0.01 /* s from frame to frame */

typedef struct report {
    const char *docs; /* NULL = no files */
    int32_t threads;
    char table[16384];
    size_t length;
    bool good;
} report;

/* A line of the table: what was looked at, whether it is as wanted, what is wanted, what was found. */
void validate_row(report *r, const char *what, bool passes, const char *bound, const char *format,
                  ...) ASCC_PRINTF(5, 6);

/* The cases of the DFSPH solver, and its front of a column of 1 m x 2 m in a tank of 4 m x 3 m. */
void validate_dfsph(report *r);
bool validate_dfsph_dam(int32_t threads, double front[DAM_FRAMES]);

#endif
