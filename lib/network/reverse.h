/* The reverse pass through a network that the forward pass computed: from the gradient of the velocity
 * corrections to those of weights, velocities and positions.
 * SPDX-License-Identifier: MIT
 *
 * Values are those of the forward pass, kept in its arena; columns and geometry are computed again, row
 * by row, as forwards. Neighbour lists, lattices and rounding count as constants.
 */
#ifndef ASCC_REVERSE_H
#define ASCC_REVERSE_H

#include "network.h"

/* Packed weights once more, transposed by their operations: d(column) = d(out) W^T. */
typedef struct ascc_transposed {
    float *block; /* laid out as the packed block */
    size_t count;
} ascc_transposed;

bool ascc_transposed_create(ascc_transposed *transposed, const ascc_allocator *allocator,
                            const ascc_plan *plan, const ascc_packed *packed);
void ascc_transposed_update(ascc_transposed *transposed, const ascc_plan *plan,
                            const ascc_packed *packed);
void ascc_transposed_destroy(ascc_transposed *transposed, const ascc_allocator *allocator);

/* What one reverse pass reads and writes. Vectors are [host's fluid rows][dimension]. */
typedef struct ascc_backward {
    const ascc_network_run *run;
    const ascc_transposed *transposed;
    ascc_arena *arena;        /* scratch */
    double time_step;         /* s */
    const double *position;   /* before the step */
    const double *correction; /* gradient of the velocity corrections, per m/s */
    const double *guess;      /* [host's fluid rows] of what pressures begin with; or NULL */
    float *packed;            /* += gradient of the packed weights */
    double *velocity;         /* += gradient of the velocities seen, per m/s; or NULL */
    double *past; /* += gradient of earlier velocities, [fluid][history][dimension]; or NULL */
    double *seen, *place; /* += gradient of positions seen and before the step, per m; or NULL */
} ascc_backward;

/* errors: MEMORY. */
ascc_status ascc_backward_run(const ascc_backward *pass);

/* ---- What operations read and write ---- */

typedef struct ascc_value_gradient {
    float *raw, *rectified; /* of what readers saw; NULL where nobody reads or wants it */
} ascc_value_gradient;

/* One reverse pass under way. */
typedef struct ascc_reverse {
    const ascc_backward *pass;
    const ascc_network_run *run;
    ascc_value_gradient *value; /* [value_count] */
    /* Of the layer at hand: */
    int32_t set;
    float *tile;            /* [tile][padded outputs of a term] gradient */
    float *column;          /* of one row */
    float *column_gradient; /* [tile][column] */
    float *columns;         /* [column][tile]: the tile's columns, transposed */
    float *scratch;         /* as the operation asked for forwards ... */
    float *dot;             /* ... and for the way back */
    size_t room;
    bool *wants;              /* [value] whether anything needs its gradient */
    const uint32_t *sequence; /* 0, 1, 2, ... [room] */
    float *joined;            /* [tile][channels] gradient */
} ascc_reverse;

/* Gradient of the value that a term reads, or NULL. */
static inline float *ascc_reverse_source(const ascc_reverse *pass, const ascc_term *term)
{
    const ascc_value_gradient *value = &pass->value[term->source];
    return term->rectify ? value->rectified : value->raw;
}

/* Where a term's packed weights have their gradient, and where they stand transposed. */
static inline size_t ascc_reverse_offset(const ascc_reverse *pass, const ascc_term *term)
{
    return (size_t)(ascc_term_packed(pass->run, term) - pass->run->network->packed->block);
}

static inline float *ascc_reverse_packed(const ascc_reverse *pass, const ascc_term *term)
{
    return pass->pass->packed + ascc_reverse_offset(pass, term);
}

static inline const float *ascc_reverse_transposed(const ascc_reverse *pass, const ascc_term *term)
{
    return pass->pass->transposed->block + ascc_reverse_offset(pass, term);
}

/* to[c][r] = from[r][c] */
void ascc_transpose(const float *from, size_t rows, size_t columns, float *to);

/* From a query row to a source row as the network sees them, m. */
static inline void ascc_seen_displacement(const ascc_network_run *run, const ascc_rows *rows,
                                          size_t row, size_t j, double r[3])
{
    for (int c = 0; c < 3; c++)
        r[c] = run->hierarchy->scale.unit * (double)(int32_t)((uint32_t)rows->source->low[c][j] -
                                                              (uint32_t)rows->query->low[c][row]);
}

/* Adds to the gradient of a row's position as the network sees it. */
void ascc_reverse_place(const ascc_reverse *pass, int32_t set, size_t row,
                        const double gradient[3]);

#endif
