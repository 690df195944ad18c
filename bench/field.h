/* Blocks of particles and their neighbour lists. SPDX-License-Identifier: MIT */
#ifndef BENCH_FIELD_H
#define BENCH_FIELD_H

#include "points/neighbors.h"

#define BENCH_SPACING 0.05

/* Positions [count][dimension] of a jittered cube or square; free() it. */
double *bench_block(size_t count, int32_t dimension);

/* A block with its neighbour rows of radius 0.1, as a layer reads them. */
typedef struct bench_field {
    ascc_context *context;
    ascc_arena arena;
    ascc_message message;
    ascc_search_tools tools;
    ascc_scale scale;
    ascc_points host, points; /* as given; in cell order */
    ascc_extent extent;
    ascc_grid grid;
    ascc_rows rows;
} bench_field;

void bench_field_open(bench_field *field, size_t count, uint32_t cpu);
void bench_field_search(bench_field *field);
void bench_field_close(bench_field *field);

ascc_context *bench_context(uint32_t cpu, int32_t threads);

#endif
