/* Restriction and prolongation: features carried between scales by trilinear hats as wide as the coarser
 * one's voxels. SPDX-License-Identifier: MIT */
#include <math.h>

#include "column.h"
#include "model/cost.h"
#include "model/initial.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static void read_transfer(ascc_reader *reader, uint32_t object, const ascc_plan *plan,
                          ascc_term *term, const char *name[ASCC_MAX_TENSORS])
{
    (void)plan;
    name[ASCC_TENSOR_WEIGHT] = ascc_reader_optional_text(reader, object, "weight");
    if (name[ASCC_TENSOR_WEIGHT])
        name[ASCC_TENSOR_BIAS] = ascc_reader_optional_text(reader, object, "bias");
    term->option[ASCC_OPTION_NORMALIZE] = ascc_reader_optional_flag(reader, object, "normalize");
}

/* Lengths come from the coarser of the two lattices. */
static ascc_status find_lengths(ascc_plan_builder *builder, const ascc_layer *layer,
                                ascc_term *term)
{
    const ascc_plan *plan = &builder->plan;
    const int32_t set[2] = {ascc_plan_value_set(builder->layer, term->source), layer->set};
    double voxel = 0.0;
    for (int i = 0; i < 2; i++)
        if (set[i] >= ASCC_SET_LEVEL)
            voxel = fmax(voxel, plan->level[set[i] - ASCC_SET_LEVEL + 1].voxel);
    if ((set[0] < ASCC_SET_LEVEL && set[1] < ASCC_SET_LEVEL) || set[0] == set[1])
        return FAIL("layer '%s': a transfer goes from particles to a level, from a level to "
                    "particles or between two levels",
                    ascc_quote(layer->name).text);
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return FAIL("layer '%s': a transfer needs levels on a lattice, not 'farthest'",
                    ascc_quote(layer->name).text);
    term->option[ASCC_OPTION_VOXEL] = voxel;
    term->filter = (ascc_filter){.cells = {1, 1, 1},
                                 .window = ASCC_WINDOW_HAT,
                                 .radius = voxel * sqrt((double)plan->dimension)};
    return ASCC_OK;
}

static void tensors(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    (void)plan;
    ascc_plan_want_matrix(term, stored, wanted);
}

static ascc_status check(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS])
{
    (void)name;
    return find_lengths(builder, layer, &entry->term);
}

/* From a finer set a point hears of as many as its voxels hold, else of itself. */
static void fill_initial(ascc_initial *initial)
{
    const ascc_term *term = initial->term;
    const double ratio = term->option[ASCC_OPTION_VOXEL] /
                         ascc_initial_spacing(initial->plan, ascc_initial_source(initial));
    const double hats = initial->plan->dimension == 2 ? ratio * ratio : ratio * ratio * ratio;
    const bool sums = term->option[ASCC_OPTION_NORMALIZE] == 0.0;
    if (initial->number == ASCC_TENSOR_WEIGHT)
        ascc_initial_fill(initial, 0, initial->count,
                          sqrt(2.0 / term->inputs) / (sums ? fmax(hats, 1.0) : 1.0));
    else
        ascc_initial_default(initial);
}

static int lists(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS])
{
    ascc_convolution_lists(plan, term, set, key);
    key[0].cube = term->option[ASCC_OPTION_VOXEL];
    return 1;
}

/* Each point of the finer set has 2^d corners of the coarser. */
static double cost(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term)
{
    const int32_t source = ascc_plan_value_set(plan->layer, term->source);
    const double points = ascc_cost_points(counts, set), from = ascc_cost_points(counts, source);
    const bool up = ascc_cost_voxel(plan, set) < ascc_cost_voxel(plan, source);
    const bool weight = term->tensor[ASCC_TENSOR_WEIGHT] != NULL;
    return (up ? points : from) * (double)(1 << plan->dimension) * term->inputs +
           (weight ? points * term->inputs * term->outputs : 0.0);
}

/* Hats become shares of their sum. */
static void normalize_hats(float *hat, size_t count)
{
    float sum = 0.0f;
    for (size_t k = 0; k < count; k++)
        sum += hat[k];
    for (size_t k = 0; k < count; k++)
        hat[k] /= sum;
}

static void gather(const ascc_network_run *run, const ascc_term *term,
                   const ascc_neighborhood *around, float *column)
{
    float *hat = around->geometry.pairs.window[ASCC_WINDOW_HAT];
    if (term->option[ASCC_OPTION_NORMALIZE] != 0.0)
        normalize_hats(hat, around->count);
    run->tools->kernels->gather_basis(hat, around->room, 1, 1, around->read, around->count,
                                      around->feature, ascc_padded(term->inputs), column);
}

/* ---- The way back ---- */

static void scatter(const ascc_reverse *pass, const ascc_term *term,
                    const ascc_neighborhood *around, const uint32_t *write,
                    const float *column_gradient, float *gradient)
{
    pass->run->tools->kernels->scatter(around->geometry.window, around->room, 1, 1, write,
                                       around->count, column_gradient, ascc_padded(term->inputs),
                                       gradient);
}

static void places(const ascc_reverse *pass, const ascc_term *term, const ascc_neighborhood *around,
                   size_t row, const float *column_gradient)
{
    const ascc_rows *rows = ascc_term_list(pass->run, term, 0);
    const size_t count = around->count;
    const uint32_t *neighbor = around->neighbor;
    const float *share = around->geometry.window;
    const double voxel = term->option[ASCC_OPTION_VOXEL];
    const bool normalizes = term->option[ASCC_OPTION_NORMALIZE] != 0.0;
    pass->run->tools->kernels->dot(column_gradient, 1, around->read, count, around->feature,
                                   ascc_padded(term->inputs), pass->dot, around->room);
    double sum = 0.0, mean = 0.0;
    for (int round = 0; round < 2; round++) {
        if (round && !normalizes) {
            sum = 1.0;
            mean = 0.0;
        }
        for (size_t k = 0; k < count; k++) {
            double r[3], hat[3], slope[3], g[3];
            ascc_seen_displacement(pass->run, rows, row, neighbor[k], r);
            for (int c = 0; c < 3; c++) {
                hat[c] = fmax(1.0 - fabs(r[c]) / voxel, 0.0);
                slope[c] = hat[c] > 0.0 ? (r[c] > 0.0   ? -1.0
                                           : r[c] < 0.0 ? 1.0
                                                        : 0.0) /
                                              voxel
                                        : 0.0;
            }
            if (!round) {
                sum += hat[0] * hat[1] * hat[2];
                mean += (double)pass->dot[k] * (double)share[k];
                continue;
            }
            const double e = ((double)pass->dot[k] - mean) / sum;
            g[0] = e * slope[0] * hat[1] * hat[2];
            g[1] = e * hat[0] * slope[1] * hat[2];
            g[2] = e * hat[0] * hat[1] * slope[2];
            ascc_column_add_displacement(pass, term, row, neighbor[k], g);
        }
    }
}

static const ascc_column_functions around = {gather, scatter, places};

const ascc_operation ascc_op_transfer = {.name = "transfer",
                                         .type = "transfer",
                                         .read = read_transfer,
                                         .tensors = tensors,
                                         .check = check,
                                         .initial = fill_initial,
                                         .lists = lists,
                                         ASCC_MATRIX_PACKING,
                                         .cost = cost,
                                         .scratch = ascc_column_scratch,
                                         .around = &around,
                                         .columns = ascc_column_gather,
                                         .forward = ascc_column_forward,
                                         .backward = ascc_column_backward};
