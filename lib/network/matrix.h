/* What operations with one weight matrix and a bias have in common: packing, and the way back.
 * SPDX-License-Identifier: MIT
 *
 * Packed: [length][padded outputs], length = cells * padded numbers of a cell, then the bias [padded outputs].
 */
#ifndef ASCC_MATRIX_H
#define ASCC_MATRIX_H

#include "network.h"
#include "reverse.h"

/* Of one row's column: what is multiplied with the matrix. */
static inline size_t ascc_matrix_length(const ascc_term *term)
{
    return ascc_cell_count(&term->filter) * ascc_padded(term->gathered);
}

size_t ascc_matrix_packed_size(const ascc_plan *plan, const ascc_term *term);
void ascc_matrix_pack(const ascc_plan *plan, const ascc_term *term, float *packed);
void ascc_matrix_unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                        float *const gradient[ASCC_MAX_TENSORS]);

/* [padded outputs][length] */
void ascc_matrix_transpose(const ascc_plan *plan, const ascc_term *term, const float *packed,
                           float *to);

/* The packing of an operation with one matrix, among its members. */
#define ASCC_MATRIX_PACKING                                                                        \
    .packed_size = ascc_matrix_packed_size, .pack = ascc_matrix_pack,                              \
    .unpack = ascc_matrix_unpack, .transpose = ascc_matrix_transpose

/* Adds the bias to the term's columns of a row. */
static inline void ascc_matrix_add_bias(const ascc_network_run *run, const ascc_term *term,
                                        float *restrict row)
{
    if (!term->tensor[ASCC_TENSOR_BIAS])
        return;
    const float *restrict bias =
        ascc_term_packed(run, term) + ascc_matrix_length(term) * ascc_padded(term->outputs);
    for (int32_t c = 0; c < term->outputs; c++)
        row[c] += bias[c];
}

/* d(column) = d(out) W^T for the tile: pass->column_gradient[n][length]. */
void ascc_matrix_back(const ascc_reverse *pass, const ascc_term *term, size_t n);
/* Row r of the tile read pass->column: keeps it for the next call. */
void ascc_matrix_keep_column(const ascc_reverse *pass, const ascc_term *term, size_t r);
/* Gradients of matrix and bias from n kept columns and the term's tile of gradients. */
void ascc_matrix_back_weights(const ascc_reverse *pass, const ascc_term *term, size_t n);

#endif
