/* Prolongation between scales, from inside a network. SPDX-License-Identifier: MIT */
#include <math.h>

#include "network/column.h"
#include "model/model.h"
#include "network/operations.h"
#include "support/model_builder.h"
#include "support/tools.h"

#define SPACING 0.05

/* A model's neighbour lists over a cloud of fluid above a floor. */
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

static void open_case(network_case *c, const model_random *random)
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
    free(fluid);
    free(boundary);
}

static void close_case(network_case *c)
{
    ascc_network_destroy(&c->network);
    ascc_model_destroy(&c->model);
    ascc_context_destroy(&c->context);
    tools_close(&c->tools);
}

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
        open_case(&c, &random);
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
                ascc_geometry g;
                ascc_geometry_of(&g, &c.run, rows, &term->filter, i, neighbor, rows->count[i],
                                 scratch, 16);
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
    open_case(&c, &random);
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
        cmocka_unit_test(prolongation_of_a_linear_field_is_that_field),
        cmocka_unit_test(more_than_2_to_the_32_rows_are_an_error),
    };
    return cmocka_run_group_tests_name("network", tests, NULL, NULL);
}
