/* Whole layers in a basis and transfers between scales, against plain doubles over all pairs.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "network/column.h"
#include "model/model.h"
#include "network/operations.h"
#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05

/* A model run once over a cloud of fluid above a floor. */
typedef struct network_case {
    test_tools tools;
    ascc_context *context;
    ascc_model *model;
    ascc_network network;
    ascc_hierarchy hierarchy;
    ascc_network_run run;
    size_t fluid_count;
} network_case;

static double *lattice(dice *d, size_t count, int dimension, bool floor)
{
    double *x = calloc(count * (size_t)dimension + 1, sizeof *x);
    assert_non_null(x);
    const size_t side = dimension == 2 ? 12 : 6;
    for (size_t i = 0; i < count; i++) {
        const size_t at[3] = {i % side, i / side % side, i / side / side};
        for (size_t c = 0; c < (size_t)dimension; c++) {
            const size_t cell = !floor ? at[c] : c == 1 ? 0 : at[c > 1 ? 1 : 0];
            x[i * (size_t)dimension + c] =
                ((double)cell + (floor ? 0.0 : dice_uniform(d, -0.3, 0.3))) * SPACING -
                (floor && c == 1 ? 0.8 * SPACING : 0.0);
        }
    }
    return x;
}

static float *features(dice *d, size_t count)
{
    float *f = calloc(count + 1, sizeof *f);
    assert_non_null(f);
    for (size_t i = 0; i < count; i++)
        f[i] = (float)dice_uniform(d, -1.0, 1.0);
    return f;
}

static void open_case(network_case *c, const model_random *random, bool forward)
{
    memset(c, 0, sizeof *c);
    dice d = {77};
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    tools_open(&c->tools, 2, 0);
    assert_int_equal(ascc_context_create(NULL, &c->context), ASCC_OK);
    if (ascc_model_load_memory(c->context, bytes, size, &c->model) != ASCC_OK) {
        char text[256];
        ascc_context_message(c->context, text, sizeof text);
        fail_msg("model: %s", text);
    }
    free(bytes);
    const ascc_plan *plan = &c->model->plan;
    const size_t walls = plan->dimension == 2 ? 12 : 36;
    c->fluid_count = plan->dimension == 2 ? 132 : 180;
    double *fluid = lattice(&d, c->fluid_count, plan->dimension, false);
    double *boundary = lattice(&d, walls, plan->dimension, true);
    float *in = features(&d, c->fluid_count * (size_t)plan->fluid_channels);
    float *wall_in = features(&d, walls * (size_t)plan->boundary_channels);
    const ascc_scene scene = {.fluid_count = c->fluid_count,
                              .boundary_count = walls,
                              .fluid = fluid,
                              .boundary = boundary};
    ascc_message message;
    assert_int_equal(ascc_network_create(&c->network, &c->context->allocator, plan,
                                         &c->model->packed, 4096, &message),
                     ASCC_OK);
    assert_int_equal(ascc_hierarchy_build(&c->hierarchy, &c->tools.search, plan, &scene), ASCC_OK);
    assert_int_equal(
        ascc_network_demand(&c->run, &c->network, &c->hierarchy, &c->tools.search, NULL), ASCC_OK);
    if (forward)
        assert_int_equal(ascc_network_forward(&c->run, in, wall_in), ASCC_OK);
    free(fluid);
    free(boundary);
    free(in);
    free(wall_in);
}

static void close_case(network_case *c)
{
    ascc_network_destroy(&c->network);
    ascc_model_destroy(&c->model);
    ascc_context_destroy(&c->context);
    tools_close(&c->tools);
}

/* ---- The oracle ---- */

static double displacement(const ascc_points *to, size_t j, const ascc_points *from, size_t i,
                           double d[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        d[c] = (double)(to->position[c][j] - from->position[c][i]);
        square += d[c] * d[c];
    }
    return sqrt(square);
}

/* docs/file-format.md, "A small basis", word for word. */
static double kernel_of(const ascc_filter *filter, int dimension, int bump, int harmonic,
                        const double d[3], double length, double radius)
{
    const double rho = length / radius, t = filter->bumps * rho - bump;
    const double x = length > 0.0 ? d[0] / length : 0.0, y = length > 0.0 ? d[1] / length : 0.0;
    const double z = length > 0.0 ? d[2] / length : 0.0;
    const double flat[5] = {1.0, x, y, 2.0 * x * y, x * x - y * y};
    const double full[9] = {1.0,
                            x,
                            y,
                            z,
                            sqrt(3.0) * x * y,
                            sqrt(3.0) * y * z,
                            sqrt(3.0) * z * x,
                            sqrt(3.0) / 2.0 * (x * x - y * y),
                            z * z - (x * x + y * y) / 2.0};
    const double bell = fmax(0.0, 1.0 - t * t);
    return bell * bell * (dimension == 2 ? flat : full)[harmonic];
}

static double hat_of(int dimension, const double d[3], double voxel)
{
    double hat = 1.0;
    for (int c = 0; c < dimension; c++)
        hat *= fmax(0.0, 1.0 - fabs(d[c]) / voxel);
    return hat;
}

static double source_of(const network_case *c, const ascc_term *term, size_t row, int32_t channel)
{
    const ascc_value *v = &c->run.value[term->source];
    const float *from = term->rectify ? v->rectified : v->raw;
    return (double)from[row * ascc_padded(term->inputs) + (size_t)channel];
}

/* in[channel] * weight[channel][column] over the channels. */
static double product(const network_case *c, const ascc_term *term, size_t row, const float *weight,
                      int32_t column)
{
    double sum = 0.0;
    for (int32_t a = 0; a < term->inputs; a++)
        sum += source_of(c, term, row, a) * (double)weight[a * term->outputs + column];
    return sum;
}

/* What a term adds to a column of a row of its layer, from its definition. Hats are rounded as parts of
 * 1, so a normalised one is only as good as their sum is large: that goes to slack. */
static double term_of(const network_case *c, const ascc_layer *layer, const ascc_term *term,
                      size_t row, int32_t column, double *slack)
{
    const ascc_hierarchy *h = &c->hierarchy;
    const int dimension = c->model->plan.dimension;
    const int32_t set = ascc_network_set(&c->network, term->source);
    const double bias =
        term->tensor[ASCC_TENSOR_BIAS] ? (double)term->tensor[ASCC_TENSOR_BIAS][column] : 0.0;
    double sum = 0.0, hats = 0.0, d[3];
    if (!term->operation->lists) {
        size_t j = row;
        if (set != layer->set) { /* fluid or walls into all */
            if ((h->origin[row] < h->fluid_count) != (set == ASCC_SET_FLUID))
                return 0.0;
            j = h->part[row];
        }
        return term->operation == &ascc_op_identity
                   ? source_of(c, term, j, column)
                   : bias + product(c, term, j, term->tensor[ASCC_TENSOR_WEIGHT], column);
    }
    for (size_t j = 0; j < h->set[set].count; j++) {
        const double length = displacement(&h->set[set], j, &h->set[layer->set], row, d);
        const double radius = term->filter.radius * h->scale.inverse;
        if (term->operation == &ascc_op_transfer) {
            const double hat =
                hat_of(dimension, d, term->option[ASCC_OPTION_VOXEL] * h->scale.inverse);
            hats += hat;
            if (hat > 1e-7) /* at the edge a float may see none, and nobody computes that row */
                sum += hat * product(c, term, j, term->tensor[ASCC_TENSOR_WEIGHT], column);
            continue;
        }
        if (length > radius)
            continue;
        const int32_t harmonics = term->filter.cells[0];
        for (int32_t m = 0; m < term->filter.bumps * harmonics; m++)
            sum += kernel_of(&term->filter, dimension, m / harmonics, m % harmonics, d, length,
                             radius) *
                   product(c, term, j,
                           term->tensor[ASCC_TENSOR_WEIGHT] + m * term->inputs * term->outputs,
                           column);
    }
    if (term->option[ASCC_OPTION_NORMALIZE] != 0.0 && hats > 0.0)
        *slack += 1e-6 / hats;
    return bias + (term->option[ASCC_OPTION_NORMALIZE] != 0.0 && hats > 0.0 ? sum / hats : sum);
}

static size_t check_layers(const network_case *c)
{
    const ascc_plan *plan = &c->model->plan;
    size_t checked = 0;
    for (int32_t l = 0; l < plan->layer_count; l++) {
        const ascc_layer *layer = &plan->layer[l];
        const ascc_value *value = &c->run.value[l + 2];
        for (size_t row = 0; row < c->hierarchy.set[layer->set].count; row++)
            for (int32_t channel = 0; value->active[row] && channel < layer->channels; channel++) {
                double want = 0.0, slack = 0.0;
                for (int32_t t = 0; t < layer->term_count; t++) {
                    const ascc_term *term = &plan->term[layer->first_term + t];
                    if (channel >= term->column && channel < term->column + term->outputs)
                        want += term_of(c, layer, term, row, channel - term->column, &slack);
                }
                const float *from = value->raw ? value->raw : value->rectified;
                const double got =
                    (double)from[row * ascc_padded(layer->channels) + (size_t)channel];
                if (!value->raw)
                    want = fmax(0.0, want);
                if (!(fabs(got - want) < 3e-6 * (1.0 + fabs(want)) + slack))
                    fail_msg("layer %s row %zu channel %d: %.9g, not %.9g", layer->name, row,
                             (int)channel, got, want);
                checked++;
            }
    }
    return checked;
}

static void layers_in_a_basis_equal_doubles(void **state)
{
    (void)state;
    for (int variant = 0; variant < 24; variant++) {
        const model_random random = {.seed = 40 + (uint64_t)variant,
                                     .dimension = 2 + variant % 2,
                                     .channels = 8,
                                     .spacing = SPACING,
                                     .bumps = 1 + variant / 3,
                                     .order = variant % 3,
                                     .levels = 1 + variant / 6 % 2,
                                     .gain = 0.5};
        network_case c;
        open_case(&c, &random, true);
        assert_true(check_layers(&c) > 3000);
        close_case(&c);
    }
}

static void transfers_equal_doubles(void **state)
{
    (void)state;
    for (int variant = 0; variant < 12; variant++) {
        const model_random random = {.seed = 90 + (uint64_t)variant,
                                     .dimension = 2 + variant % 2,
                                     .levels = 3,
                                     .channels = 8,
                                     .trunk_layers = 3,
                                     .spacing = SPACING,
                                     .bumps = 2,
                                     .order = 1,
                                     .transfer = 1 + variant / 2 % 2,
                                     .method = variant < 4 ? "voxel_centers" : "voxel_corners",
                                     .anchor = variant < 8 ? "world" : "centroid",
                                     .gain = 0.5};
        network_case c;
        open_case(&c, &random, true);
        assert_true(check_layers(&c) > 3000);
        close_case(&c);
    }
}

/* ---- Hats ---- */

static void prolongation_of_a_linear_field_is_that_field(void **state)
{
    (void)state;
    for (int dimension = 2; dimension <= 3; dimension++) {
        const model_random random = {.seed = 3,
                                     .dimension = dimension,
                                     .levels = 2,
                                     .spacing = SPACING,
                                     .transfer = 1,
                                     .method = "voxel_corners",
                                     .no_hysteresis = 1};
        network_case c;
        open_case(&c, &random, false);
        const ascc_plan *plan = &c.model->plan;
        size_t checked = 0;
        for (int32_t t = 0; t < plan->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            const int32_t key = c.network.term_key[t][0];
            const ascc_rows *rows = &c.run.rows[key < 0 ? 0 : key];
            if (term->operation != &ascc_op_transfer || c.network.key[key].source != ASCC_SET_LEVEL)
                continue;
            for (size_t i = 0; i < rows->query->count; i++) {
                if (rows->count[i] == ASCC_ROW_ABSENT)
                    continue;
                const uint32_t *neighbor = rows->neighbor + rows->start[i];
                float scratch[ASCC_GEOMETRY_ARRAYS * 16];
                assert_true(rows->count[i] <= (dimension == 2 ? 4 : 8));
                const ascc_geometry g = ascc_geometry_of(&c.run, rows, &term->filter, i, neighbor,
                                                         rows->count[i], scratch, 16);
                double one = 0.0, offset[3] = {0.0, 0.0, 0.0}, d[3];
                for (size_t k = 0; k < rows->count[i]; k++) {
                    const double hat = (double)g.window[k];
                    assert_true(hat > 0.0);
                    displacement(rows->source, neighbor[k], rows->query, i, d);
                    one += hat;
                    for (int n = 0; n < dimension; n++)
                        offset[n] += hat * d[n] /
                                     (term->option[ASCC_OPTION_VOXEL] * c.hierarchy.scale.inverse);
                }
                /* 1, x, y, z at the lattice's points, in voxels: lattice points are whole units, 1e-8
                 * of a voxel, and the product of three float differences is within 4 of 2^-24. */
                assert_true(fabs(one - 1.0) < 1e-6);
                for (int n = 0; n < dimension; n++)
                    assert_true(fabs(offset[n]) < 1e-6);
                checked++;
            }
        }
        assert_true(checked >= c.fluid_count);
        close_case(&c);
    }
}

/* Sizes only: no row is read. The last sum wraps where size_t has 64 bits, the first where it has 32. */
static void more_than_2_to_the_32_rows_are_an_error(void **state)
{
    (void)state;
    static const size_t counts[][2] = {
        {UINT32_MAX - 1, 1}, {UINT32_MAX, 0}, {1, UINT32_MAX}, {SIZE_MAX, 2}, {2, SIZE_MAX}};
    const model_random random = {.seed = 3, .bumps = 2, .order = 1};
    network_case c;
    open_case(&c, &random, false);
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const ascc_scene scene = {.fluid_count = counts[i][0], .boundary_count = counts[i][1]};
        ascc_hierarchy h;
        assert_int_equal(ascc_hierarchy_build(&h, &c.tools.search, &c.model->plan, &scene),
                         ASCC_ERROR_RANGE);
        assert_non_null(strstr(c.tools.message.text, "are more than 2^32 - 2"));
    }
    close_case(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(layers_in_a_basis_equal_doubles),
        cmocka_unit_test(transfers_equal_doubles),
        cmocka_unit_test(prolongation_of_a_linear_field_is_that_field),
        cmocka_unit_test(more_than_2_to_the_32_rows_are_an_error),
    };
    return cmocka_run_group_tests_name("network", tests, NULL, NULL);
}
