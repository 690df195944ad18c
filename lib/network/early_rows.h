/* Rows that other processes wait for are computed first, so that messages travel while the rest is computed.
 * SPDX-License-Identifier: MIT
 *
 *     rows of a set    e e . . . e . . . . e e e .       e: copies of it are ghosts elsewhere
 *     computed         e e e e e e | send | . . . . . . . . | receive: ghosts here are what their owners have
 */
#ifndef ASCC_EARLY_ROWS_H
#define ASCC_EARLY_ROWS_H

#include "hierarchy.h"

/* With a halo: the order of a set's rows, fluid or level. errors: MEMORY. */
ascc_status ascc_early_rows_find(ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                 int32_t set);

/* Runs a function over all rows of a set, in blocks of at most so many, and refreshes ghosts in these arrays, which it
 * writes. Rows are in any order; nothing may read what other rows of it have written. errors: those of
 * any process that it had before its rows were sent; none if `refresh` is sure. */
ascc_status ascc_early_rows_run(const ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                size_t block, ascc_range_function function, void *data,
                                const ascc_halo_refresh *refresh);

/* The same over a list, of which the first are early; blocks are of the list. refresh: NULL = none. */
ascc_status ascc_early_list_run(const ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                size_t early, size_t count, size_t block,
                                ascc_range_function function, void *data,
                                const ascc_halo_refresh *refresh);

#endif
