/* Thin walls: two layers of points at the same places, with normals to either side, and fluid on both.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "points/particles.h"
#include "support/tools.h"

typedef struct basin {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    size_t d;
    double spacing;
} basin;

static basin open_basin(const char *name, int32_t threads)
{
    basin b = {0};
    char path[1024];
    const ascc_context_options context = {.size = sizeof context, .thread_count = threads};
    ascc_particles_options set = {.size = sizeof set};
    snprintf(path, sizeof path, SOURCE_ROOT "/examples/models/%s.safetensors", name);
    assert_int_equal(ascc_context_create(&context, &b.context), ASCC_OK);
    assert_int_equal(ascc_model_load(b.context, path, &b.model), ASCC_OK);
    assert_int_equal(ascc_model_particles_options(b.model, 0.0, &set), ASCC_OK);
    assert_int_equal(ascc_particles_create(b.context, &set, &b.particles), ASCC_OK);
    assert_int_equal(ascc_step_create(b.context, b.model, NULL, &b.step), ASCC_OK);
    b.d = (size_t)set.dimension;
    b.spacing = set.spacing;
    return b;
}

static void close_basin(basin *b)
{
    ascc_step_destroy(&b->step);
    ascc_particles_destroy(&b->particles);
    ascc_model_destroy(&b->model);
    ascc_context_destroy(&b->context);
}

/* All in spacings. A particle at rest. */
static void add_fluid(basin *b, double x, double y, double z)
{
    const double at[3] = {x * b->spacing, y * b->spacing, z * b->spacing};
    const ascc_const_array position = {.data = at, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(b->particles, 1, &position, NULL, NULL, NULL),
                     ASCC_OK);
}

/* Points across an axis at `at`, between low and high along the others, of one layer or of a sheet's two. */
static void add_plane(basin *b, size_t axis, double at, double side, const double low[3],
                      const double high[3], bool sheet)
{
    const size_t p = (axis + 1) % b->d, q = b->d == 3 ? (axis + 2) % 3 : 2;
    const int m = (int)ceil((high[p] - low[p]) / 0.64);
    const int n = b->d == 3 ? (int)ceil((high[q] - low[q]) / 0.64) : 1;
    for (int i = 0; i < m; i++)
        for (int j = 0; j < n; j++)
            for (int layer = 0; layer < (sheet ? 2 : 1); layer++) {
                double x[3] = {0.0, 0.0, 0.0}, normal[3] = {0.0, 0.0, 0.0};
                x[axis] = at * b->spacing;
                x[p] = (low[p] + (i + 0.5) * (high[p] - low[p]) / m) * b->spacing;
                if (b->d == 3)
                    x[q] = (low[q] + (j + 0.5) * (high[q] - low[q]) / n) * b->spacing;
                normal[axis] = layer ? -side : side;
                const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
                const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
                assert_int_equal(
                    ascc_particles_add_boundary(b->particles, 1, &position, &normals, 0, NULL),
                    ASCC_OK);
            }
}

/* A box 16 wide and 10 high, cut in two by a sheet at x = 8; water left of it 5 deep, right of it as deep as said. */
static void fill_two_rooms(basin *b, int right)
{
    const double low[3] = {0.0, 0.0, 0.0}, high[3] = {16.0, 10.0, 5.0};
    for (size_t axis = 0; axis < b->d; axis++) {
        add_plane(b, axis, low[axis], 1.0, low, high, false);
        add_plane(b, axis, high[axis], -1.0, low, high, false);
    }
    add_plane(b, 0, 8.0, 1.0, low, high, true);
    for (int room = 0; room < 2; room++)
        for (int y = 0; y < (room ? right : 5); y++)
            for (int x = 0; x < 7; x++)
                for (int z = 0; z < (b->d == 3 ? 4 : 1); z++)
                    add_fluid(b, 8 * room + x + 1, y + 1, b->d == 3 ? z + 1 : 0);
}

static void run(basin *b, int32_t steps)
{
    if (ascc_step_run(b->step, b->particles, NULL, steps) != ASCC_OK)
        fail_msg("%s", ascc_step_message(b->step));
}

static void water_does_not_feel_what_is_beyond_a_sheet(void **state)
{
    (void)state;
    static const char *const names[] = {"pbf2d",
                                        "pbf3d"}; /* no lattice, whose voxels have two sides */
    for (size_t i = 0; i < 2; i++) {
        basin alone = open_basin(names[i], 1), both = open_basin(names[i], 2);
        fill_two_rooms(&alone, 0);
        fill_two_rooms(&both, 2);
        const size_t n = alone.particles->fluid_count * alone.d;
        for (int step = 0; step < 10; step++) {
            run(&alone, 1);
            run(&both, 1);
            assert_memory_equal(alone.particles->position, both.particles->position,
                                n * sizeof(double));
        }
        close_basin(&alone);
        close_basin(&both);
    }
}

static void a_sheet_is_to_each_side_what_a_wall_of_one_layer_is(void **state)
{
    (void)state;
    static const char *const names[] = {"pbf2d", "pbf3d"};
    for (size_t i = 0; i < 2; i++) {
        const double low[3] = {-3.0, -3.0, -3.0}, high[3] = {9.0, 9.0, 9.0};
        uint64_t hash[2];
        for (int sheet = 0; sheet < 2; sheet++) {
            basin b = open_basin(names[i], 1);
            add_plane(&b, 1, 0.0, 1.0, low, high, sheet != 0);
            for (int x = 0; x < 6; x++)
                for (int y = 0; y < 4; y++)
                    add_fluid(&b, x + 0.1 * y, y + 0.7, b.d == 3 ? 0.3 * x : 0.0);
            run(&b, 5);
            ascc_particles_clear(b.particles, ASCC_BOUNDARY);
            hash[sheet] = ascc_particles_hash(b.particles);
            close_basin(&b);
        }
        assert_true(hash[0] == hash[1]);
    }
}

static void nothing_crosses_a_sheet_and_levels_stay(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int32_t steps;
    } cases[] = {{"pbf2d", 300}, {"water2d", 300}, {"pbf3d", 40}, {"water3d", 40}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        uint64_t hash[2];
        for (int run_of = 0; run_of < 2; run_of++) {
            basin b = open_basin(cases[i].name, run_of ? 3 : 1);
            fill_two_rooms(&b, 2);
            run(&b, cases[i].steps);
            double height[2] = {0.0, 0.0}, count[2] = {0.0, 0.0};
            const size_t left = 7 * 5 * (b.d == 3 ? 4 : 1);
            for (size_t k = 0; k < b.particles->fluid_count; k++) {
                const double *x = b.particles->position + k * b.d;
                const int room = x[0] > 8 * b.spacing;
                assert_int_equal(room, k >= left);
                assert_true(x[0] > 0.0 && x[0] < 16 * b.spacing && x[1] > 0.0);
                height[room] += x[1] / b.spacing;
                count[room]++;
            }
            print_message("# %s: mean heights %.2f and %.2f\n", cases[i].name, height[0] / count[0],
                          height[1] / count[1]);
            assert_true(height[0] / count[0] > height[1] / count[1] + 1.0);
            ascc_step_statistics s = {.size = sizeof s};
            assert_int_equal(ascc_step_get_statistics(b.step, &s), ASCC_OK);
            for (size_t c = 0; c < b.d; c++)
                assert_true(s.momentum_before[c] + s.external_impulse[c] - s.wall_impulse[c] ==
                            s.momentum_after[c]);
            hash[run_of] = ascc_particles_hash(b.particles);
            close_basin(&b);
        }
        assert_true(hash[0] == hash[1]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(water_does_not_feel_what_is_beyond_a_sheet),
        cmocka_unit_test(a_sheet_is_to_each_side_what_a_wall_of_one_layer_is),
        cmocka_unit_test(nothing_crosses_a_sheet_and_levels_stay),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
