/* The filters of convolutions, as filter.h draws them. SPDX-License-Identifier: MIT */
#include "filter.h"

#include <string.h>

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)
#define COUNT(list) ((int32_t)(sizeof(list) / sizeof *(list)))

static void read_common(ascc_reader *reader, uint32_t object, ascc_filter *filter)
{
    filter->radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    filter->neighbor_limit = ascc_reader_optional_integer(reader, object, "neighbor_limit");
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
}

void ascc_filter_read_basis(ascc_reader *reader, uint32_t object, ascc_filter *filter, bool central)
{
    read_common(reader, object, filter);
    const uint32_t basis = ascc_reader_object(reader, object, "basis");
    filter->bumps = ascc_reader_integer(reader, basis, "bumps", 1, ASCC_MAX_BUMPS);
    if (!central)
        filter->order = ascc_reader_integer(reader, basis, "order", 0, ASCC_MAX_ORDER);
    ascc_reader_end(reader, basis);
}

/* A basis as cells: harmonics, then bumps. */
static void set_cells(ascc_filter *filter, int32_t harmonics)
{
    const int32_t cells[3] = {harmonics, filter->bumps, 1};
    memcpy(filter->cells, cells, sizeof cells);
    filter->mapping = ASCC_MAPPING_DIRECTION;
    filter->window = ASCC_WINDOW_NONE;
}

ascc_status ascc_filter_check_basis(ascc_plan_builder *builder, const ascc_tensor *tensor,
                                    ascc_filter *filter)
{
    const int32_t order = filter->order;
    const int32_t harmonics =
        builder->plan.dimension == 2 ? 2 * order + 1 : (order + 1) * (order + 1);
    if (tensor->shape[0] != (size_t)filter->bumps || tensor->shape[1] != (size_t)harmonics)
        return FAIL("tensor '%s' is for %zu bumps and %zu harmonics, but its basis has %d and %d",
                    ascc_quote(tensor->name).text, tensor->shape[0], tensor->shape[1],
                    (int)filter->bumps, (int)harmonics);
    set_cells(filter, harmonics);
    return ASCC_OK;
}

ascc_status ascc_filter_check_central(ascc_plan_builder *builder, int32_t inputs,
                                      ascc_filter *filter, const char *name, int32_t *index)
{
    const ascc_status status = ascc_plan_find_tensor(builder, name, 2, index);
    if (status != ASCC_OK)
        return status;
    const ascc_tensor *tensor = &builder->file->tensor[*index];
    if (tensor->shape[0] != (size_t)filter->bumps || tensor->shape[1] != (size_t)inputs)
        return FAIL("tensor '%s' has the shape [%zu, %zu], but must have [%d, %d]: bumps, channels",
                    ascc_quote(tensor->name).text, tensor->shape[0], tensor->shape[1],
                    (int)filter->bumps, (int)inputs);
    set_cells(filter, 1);
    return ASCC_OK;
}
