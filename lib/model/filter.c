/* The filters of convolutions, as filter.h draws them. SPDX-License-Identifier: MIT */
#include "filter.h"

#define COUNT(list) ((int32_t)(sizeof(list) / sizeof *(list)))

static void read_common(ascc_reader *reader, uint32_t object, ascc_filter *filter)
{
    filter->radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    filter->neighbor_limit = ascc_reader_optional_integer(reader, object, "neighbor_limit");
}

/* [x, y, z] of the whole kernel. */
static void read_cells(ascc_reader *reader, uint32_t object, int32_t cells[3])
{
    double number[3] = {0.0, 0.0, 0.0};
    ascc_reader_numbers(reader, object, "cells", 3, 1.0, ASCC_MAX_CELLS, number);
    for (int axis = 0; axis < 3; axis++) {
        cells[axis] = (int32_t)number[axis];
        if ((double)cells[axis] != number[axis])
            ascc_reader_fail(reader, "'cells' must be integers");
    }
}

void ascc_filter_read_grid(ascc_reader *reader, uint32_t object, ascc_filter *filter)
{
    static const char *const windows[] = {"none", "poly6", "peak"};
    static const char *const mappings[] = {"identity", "radial", "volume"};
    read_common(reader, object, filter);
    filter->window =
        (ascc_window)ascc_reader_choice(reader, object, "window", windows, COUNT(windows));
    filter->mapping =
        (ascc_mapping)ascc_reader_choice(reader, object, "mapping", mappings, COUNT(mappings));
    if (ascc_reader_has(reader, object, "cells"))
        read_cells(reader, object, filter->cells);
}

void ascc_filter_read_basis(ascc_reader *reader, uint32_t object, int32_t dimension,
                            ascc_filter *filter, bool central)
{
    read_common(reader, object, filter);
    const uint32_t basis = ascc_reader_object(reader, object, "basis");
    filter->bumps = ascc_reader_integer(reader, basis, "bumps", 1, ASCC_MAX_BUMPS);
    if (!central)
        filter->order = ascc_reader_integer(reader, basis, "order", 0, ASCC_MAX_ORDER);
    ascc_reader_end(reader, basis);
    const int32_t order = filter->order;
    filter->cells[0] = central ? 1 : dimension == 2 ? 2 * order + 1 : (order + 1) * (order + 1);
    filter->cells[1] = filter->bumps;
    filter->cells[2] = 1;
    filter->mapping = ASCC_MAPPING_DIRECTION;
    filter->window = ASCC_WINDOW_NONE;
}

void ascc_filter_want_grid(ascc_term *term, int32_t half_axis, const size_t *stored,
                           ascc_tensor_wanted *wanted)
{
    *wanted = (ascc_tensor_wanted){.dimensions = "z, y, x, inputs, outputs", .rank = 5};
    for (int axis = 0; axis < 3; axis++) {
        int32_t *cells = &term->filter.cells[axis];
        const int32_t parts = axis == half_axis ? 2 : 1;
        if (*cells == 0 && stored[2 - axis] <= ASCC_MAX_CELLS)
            *cells = parts * (int32_t)stored[2 - axis];
        wanted->shape[2 - axis] = (size_t)(*cells / parts);
    }
    ascc_plan_take_outputs(term, stored[4]);
    wanted->shape[3] = (size_t)term->inputs;
    wanted->shape[4] = (size_t)term->outputs;
}
