/* A bias that knows which way is down: the step's gravity times a matrix, the same for all rows of a layer.
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "matrix.h"

static void read_gravity(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                         ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    (void)term;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_text(reader, object, "weight");
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    ascc_plan_take_outputs(term, stored[1]);
    wanted[ASCC_TENSOR_WEIGHT] =
        (ascc_tensor_wanted){.dimensions = "axes, outputs",
                             .rank = 2,
                             .shape = {(size_t)plan->dimension, (size_t)term->outputs}};
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    if (entry->term.rectify)
        return ascc_fail(builder->message, ASCC_ERROR_FORMAT,
                         "layer '%s': gravity is read without 'relu'",
                         ascc_quote(layer->name).text);
    entry->term.filter = (ascc_filter){.cells = {1, 1, 1}};
    entry->term.gathered = builder->plan.dimension;
    return ascc_plan_check_shared(builder, layer, &entry->term);
}

static void scratch(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes)
{
    (void)plan;
    sizes->column = ascc_max_size(sizes->column, ascc_matrix_length(term));
}

static void forward(const ascc_tile *tile, const ascc_term *term)
{
    const ascc_network_run *run = tile->run;
    run->tools->kernels->multiply(run->gravity, 0, tile->n, ascc_matrix_length(term),
                                  ascc_term_packed(run, term), ascc_padded(term->outputs),
                                  tile->sum + term->column, tile->width);
}

static void backward(const ascc_reverse *pass, const ascc_layer *layer, const ascc_term *term,
                     const uint32_t *list, size_t n)
{
    (void)layer;
    (void)list;
    memcpy(pass->column, pass->run->gravity, ascc_matrix_length(term) * sizeof(float));
    for (size_t r = 0; r < n; r++)
        ascc_matrix_keep_column(pass, term, r);
    ascc_matrix_back_weights(pass, term, n);
}

const ascc_operation ascc_op_gravity = {.name = "gravity",
                                        .type = "gravity",
                                        .read = read_gravity,
                                        .tensors = tensors,
                                        .check = check,
                                        ASCC_MATRIX_PACKING,
                                        .scratch = scratch,
                                        .forward = forward,
                                        .backward = backward};
