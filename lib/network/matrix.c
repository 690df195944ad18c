/* One weight matrix and a bias, as matrix.h draws them. SPDX-License-Identifier: MIT */
#include "matrix.h"

#include <string.h>

size_t ascc_matrix_packed_size(const ascc_plan *plan, const ascc_term *term)
{
    (void)plan;
    const size_t bias = term->tensor[ASCC_TENSOR_BIAS] ? 1 : 0;
    if (!term->tensor[ASCC_TENSOR_WEIGHT])
        return 0;
    return (ascc_matrix_length(term) + bias) * ascc_padded(term->outputs);
}

/* Walks the numbers of tensor [cells][inputs][outputs] and their places in the packed matrix. */
#define EACH_WEIGHT(term)                                                                          \
    const size_t cells = ascc_cell_count(&(term)->filter), a = (size_t)(term)->gathered;           \
    const size_t b = (size_t)(term)->outputs, a8 = ascc_padded((term)->gathered);                  \
    const size_t b8 = ascc_padded((term)->outputs), bias = cells * a8 * b8;                        \
    for (size_t c = 0; c < cells; c++)                                                             \
        for (size_t i = 0; i < a; i++)                                                             \
            for (size_t o = 0; o < b; o++)

void ascc_matrix_pack(const ascc_plan *plan, const ascc_term *term, float *packed)
{
    (void)plan;
    const float *weight = term->tensor[ASCC_TENSOR_WEIGHT];
    EACH_WEIGHT(term)
    packed[(c * a8 + i) * b8 + o] = weight[(c * a + i) * b + o];
    if (term->tensor[ASCC_TENSOR_BIAS])
        memcpy(packed + bias, term->tensor[ASCC_TENSOR_BIAS], b * sizeof *packed);
}

void ascc_matrix_unpack(const ascc_plan *plan, const ascc_term *term, const float *packed,
                        float *const gradient[ASCC_MAX_TENSORS])
{
    (void)plan;
    float *weight = gradient[ASCC_TENSOR_WEIGHT];
    EACH_WEIGHT(term)
    weight[(c * a + i) * b + o] += packed[(c * a8 + i) * b8 + o];
    for (size_t o = 0; gradient[ASCC_TENSOR_BIAS] && o < b; o++)
        gradient[ASCC_TENSOR_BIAS][o] += packed[bias + o];
}

/* ---- The way back ---- */

void ascc_matrix_transpose(const ascc_plan *plan, const ascc_term *term, const float *packed,
                           float *to)
{
    (void)plan;
    if (term->tensor[ASCC_TENSOR_WEIGHT])
        ascc_transpose(packed, ascc_matrix_length(term), ascc_padded(term->outputs), to);
}

void ascc_matrix_back(const ascc_reverse *pass, const ascc_term *term, size_t n)
{
    const size_t b = ascc_padded(term->outputs), length = ascc_matrix_length(term);
    memset(pass->column_gradient, 0, n * length * sizeof(float));
    pass->run->tools->kernels->multiply(pass->tile, b, n, b, ascc_reverse_transposed(pass, term),
                                        length, pass->column_gradient, length);
}

void ascc_matrix_keep_column(const ascc_reverse *pass, const ascc_term *term, size_t r)
{
    const size_t length = ascc_matrix_length(term);
    for (size_t i = 0; i < length; i++)
        pass->columns[i * ASCC_TILE_ROWS + r] = pass->column[i];
}

void ascc_matrix_back_weights(const ascc_reverse *pass, const ascc_term *term, size_t n)
{
    const size_t b = ascc_padded(term->outputs), length = ascc_matrix_length(term);
    float *to = ascc_reverse_packed(pass, term);
    pass->run->tools->kernels->multiply(pass->columns, ASCC_TILE_ROWS, length, n, pass->tile, b, to,
                                        b);
    for (size_t r = 0; term->tensor[ASCC_TENSOR_BIAS] && r < n; r++)
        for (int32_t c = 0; c < term->outputs; c++)
            to[length * b + (size_t)c] += pass->tile[r * b + (size_t)c];
}
