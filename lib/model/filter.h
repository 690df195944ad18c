/* The filters of convolutions: read from a description; the kernels that they want.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_FILTER_H
#define ASCC_FILTER_H

#include "file/json_reader.h"
#include "plan_builder.h"

/* radius, window, mapping, neighbour limit and, if it is there, cells of a grid. */
void ascc_filter_read_grid(ascc_reader *reader, uint32_t object, ascc_filter *filter);
/* radius, neighbour limit and basis; a central one has radial members only. */
void ascc_filter_read_basis(ascc_reader *reader, uint32_t object, int32_t dimension,
                            ascc_filter *filter, bool central);

/* A kernel [z][y][x][inputs][outputs] of a grid, of which `half_axis` (-1 = none) is halved; cells and outputs
 * that are not known yet are those stored. */
void ascc_filter_want_grid(ascc_term *term, int32_t half_axis, const size_t *stored,
                           ascc_tensor_wanted *wanted);

#endif
