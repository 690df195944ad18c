/* What the parts of the reverse pass share. SPDX-License-Identifier: MIT */
#ifndef ASCC_BACKWARD_PARTS_H
#define ASCC_BACKWARD_PARTS_H

#include "backward.h"

#define ASCC_BACKWARD_TILE 24 /* rows that share one pass over the weights */

typedef struct ascc_value_gradient {
    float *raw, *rectified; /* of what readers saw; NULL where nobody reads or wants it */
} ascc_value_gradient;

/* One reverse pass under way. */
typedef struct ascc_passing {
    const ascc_backward *pass;
    const ascc_network_run *run;
    ascc_value_gradient *value; /* [value_count] */
    /* Of the layer at hand: */
    int32_t set;
    ascc_column_scratch scratch;
    float *column;          /* of one row */
    float *column_gradient; /* [tile][column] */
    float *turned;          /* [column][tile] */
    float *tile;            /* [tile][outputs of a term] gradient */
    float *joined;          /* [tile][channels] gradient */
    float *dot;             /* [member][room] */
} ascc_passing;

/* From a query row to a source row as the network sees them, m. */
static inline void ascc_seen_displacement(const ascc_passing *p, const ascc_rows *rows, size_t row,
                                          size_t j, double r[3])
{
    for (int c = 0; c < 3; c++)
        r[c] =
            p->run->hierarchy->scale.unit * (double)(int32_t)((uint32_t)rows->source->low[c][j] -
                                                              (uint32_t)rows->query->low[c][row]);
}

/* Gradients of the output layer: its source, its weights, velocities, positions. */
ascc_status ascc_backward_output(ascc_passing *p);

/* gradient[neighbour] += what a grid convolution's column took from it; geometry is in scratch. */
void ascc_backward_scatter_grid(const ascc_passing *p, const ascc_term *term,
                                const uint32_t *neighbor, size_t count,
                                const float *column_gradient, float *gradient);

/* Gradients of the positions that a row's geometry came from; geometry is in scratch. */
void ascc_backward_geometry(const ascc_passing *p, const ascc_term *term, const ascc_rows *rows,
                            size_t row, const float *column_gradient);

/* Adds to the gradient of a row's position as the network sees it. */
void ascc_backward_place(const ascc_passing *p, int32_t set, size_t row, const double gradient[3]);

/* Cells around a point of a kernel's cube, their weights, and the weights' derivatives. */
typedef struct ascc_trilinear {
    size_t cell[8];
    double weight[8], slope[8][3];
    int count;
} ascc_trilinear;
void ascc_trilinear_at(const int32_t cells[3], const double at[3], ascc_trilinear *t);

/* A grid filter's place in the cube and window for a displacement (m), with derivatives. */
typedef struct ascc_place_in_cube {
    double at[3], slope[3][3]; /* d at[i] / d r[j] */
    double window, window_slope[3];
} ascc_place_in_cube;
void ascc_place_in_cube_of(const ascc_filter *filter, const double r[3], ascc_place_in_cube *place);

#endif
