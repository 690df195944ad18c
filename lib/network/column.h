/* What convolutions, restriction and prolongation have in common: a column of numbers gathered from the
 * neighbours of a row, times a matrix. SPDX-License-Identifier: MIT */
#ifndef ASCC_COLUMN_H
#define ASCC_COLUMN_H

#include "matrix.h"

/* Options. Of a convolution: the feature motion is taken relative to the query's own, which is Galilean
 * invariant. Of restriction and prolongation: hats are divided by their sum; they are 0 this far away along
 * any axis, m. */
enum { ASCC_OPTION_RELATIVE = 0, ASCC_OPTION_NORMALIZE = 1, ASCC_OPTION_VOXEL = 2 };

static inline bool ascc_term_is_relative(const ascc_term *term)
{
    return term->option[ASCC_OPTION_RELATIVE] != 0.0;
}

/* Geometry of up to `room` pairs in scratch, for one filter: scaled to its radius, or to its cube. */
typedef struct ascc_geometry {
    ascc_pairs pairs;
    const float *window; /* NULL = 1 */
} ascc_geometry;

#define ASCC_GEOMETRY_ARRAYS 4 /* floats of scratch for each pair */
/* Where the caller wants it: returned by value, as the next one too, it costs 7 % of a step in 2D. */
void ascc_geometry_of(ascc_geometry *g, const ascc_network_run *run, const ascc_rows *rows,
                      const ascc_filter *filter, size_t query, const uint32_t *neighbor,
                      size_t count, float *scratch, size_t room);

/* One row and its neighbours, as a column is gathered from them. */
typedef struct ascc_neighborhood {
    const uint32_t *neighbor; /* rows of the source */
    size_t count, room;
    const float *feature; /* of neighbour k: feature + read[k] * padded inputs */
    const uint32_t *read;
    ascc_geometry geometry;
    float *relative; /* features relative to the query's own, if the term wants that */
    float *factor;   /* members of a basis [member][room] */
} ascc_neighborhood;

/* What an operation does with a neighbourhood: column [cells][padded inputs]. */
typedef void (*ascc_gather_function)(const ascc_network_run *run, const ascc_term *term,
                                     const ascc_neighborhood *around, float *column);

/* The neighbourhood of a row in scratch that ascc_column_scratch asked for. */
void ascc_column_look(ascc_neighborhood *around, const ascc_network_run *run, const ascc_term *term,
                      size_t row, float *scratch, size_t room, const uint32_t *sequence);
void ascc_column_scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes);

/* The way back of one row: its column's gradient to the features of the neighbours ... */
typedef void (*ascc_scatter_function)(const ascc_reverse *pass, const ascc_term *term,
                                      const ascc_neighborhood *around, const uint32_t *write,
                                      const float *column_gradient, float *gradient);
/* ... and to their places. */
typedef void (*ascc_places_function)(const ascc_reverse *pass, const ascc_term *term,
                                     const ascc_neighborhood *around, size_t row,
                                     const float *column_gradient);

/* ascc_operation.around: all that such an operation does itself. The others are its columns, forward, backward. */
typedef struct ascc_column_functions {
    ascc_gather_function gather;
    ascc_scatter_function scatter;
    ascc_places_function places;
} ascc_column_functions;
size_t ascc_column_gather(const ascc_tile *tile, const ascc_term *term);
void ascc_column_forward(const ascc_tile *tile, const ascc_term *term);
void ascc_column_backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                          const uint32_t *list, size_t n);

/* Adds the gradient by the displacement from a row to its neighbour. */
void ascc_column_add_displacement(const ascc_reverse *pass, const ascc_term *term, size_t row,
                                  size_t neighbor, const double gradient[3]);

/* ---- Shared by the two kinds of convolutions ---- */

int ascc_convolution_lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                           ascc_list_key key[ASCC_MAX_LISTS]);
/* Its options and names beside those of the filter. */
void ascc_convolution_read(ascc_reader *reader, uint32_t object, ascc_term *term,
                           const char *name[ASCC_MAX_TENSORS]);
/* Filter and options. */
ascc_status ascc_convolution_check(ascc_plan_builder *builder, const ascc_layer *layer,
                                   ascc_term_entry *entry,
                                   const char *const name[ASCC_MAX_TENSORS]);
bool ascc_convolution_reads_features(const ascc_term *term);
/* reached: cells that a neighbour adds to. */
double ascc_convolution_cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                             const ascc_term *term, double reached);

#endif
