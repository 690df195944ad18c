/* The filters of convolutions: read from a description, checked against the tensor of a kernel.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_FILTER_H
#define ASCC_FILTER_H

#include "file/json_reader.h"
#include "plan_builder.h"

/* radius, window, mapping and neighbour limit of a grid. */
void ascc_filter_read_grid(ascc_reader *reader, uint32_t object, ascc_filter *filter);
/* radius, neighbour limit and basis; a central one has radial members only. */
void ascc_filter_read_basis(ascc_reader *reader, uint32_t object, ascc_filter *filter,
                            bool central);

/* A tensor [bump][harmonic][inputs][outputs] makes the basis' cells. errors: FORMAT. */
ascc_status ascc_filter_check_basis(ascc_plan_builder *builder, const ascc_tensor *tensor,
                                    ascc_filter *filter);
/* A tensor [bump][inputs] of a central basis, found by name, likewise. errors: FORMAT. */
ascc_status ascc_filter_check_central(ascc_plan_builder *builder, int32_t inputs,
                                      ascc_filter *filter, const char *name, int32_t *index);

#endif
