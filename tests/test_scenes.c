/* Built-in scenes: size, spacing and walls are what the published networks were trained with.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "../examples/ascc/scenes.h"

static ascc_sequence made(const char *name, int32_t dimension, int32_t size, double spacing)
{
    char error[256] = "";
    ascc_sequence s;
    if (!ascc_scene_make(name, dimension, size, spacing, &s, error, sizeof error))
        fail_msg("%s: %s", name, error);
    return s;
}

static double distance(const float *a, const float *b, int32_t dimension)
{
    double square = 0.0;
    for (int32_t c = 0; c < dimension; c++)
        square += pow((double)a[c] - (double)b[c], 2.0);
    return sqrt(square);
}

static void test_every_scene_has_its_walls_and_gravity(void **state)
{
    (void)state;
    for (const ascc_scene_name *name = ascc_scene_names; name->name; name++)
        for (int32_t d = 2; d <= 3; d++) {
            ascc_sequence s = made(name->name, d, 0, 0.05);
            const bool open =
                strcmp(name->name, "droplets") == 0 || strcmp(name->name, "free-fall") == 0;
            assert_int_equal(s.dimension, d);
            assert_true(s.count > 100 && s.count < 20000);
            assert_int_equal(s.walls == 0, open);
            assert_true(s.gravity[1] == (strcmp(name->name, "droplets") == 0 ? 0.0 : -9.81));
            assert_true(s.frames == 1 && s.velocity_frames == 1);
            assert_true(fabs(s.mass - 1000.0 * pow(0.05, d)) < 1e-12);
            ascc_sequence_free(&s);
        }
}

static void test_no_two_particles_are_nearer_than_the_spacing(void **state)
{
    (void)state;
    for (const ascc_scene_name *name = ascc_scene_names; name->name; name++)
        for (int32_t d = 2; d <= 3; d++) {
            ascc_sequence s = made(name->name, d, 8, 0.02);
            const size_t n = (size_t)d;
            for (size_t i = 0; i < s.count; i++)
                for (size_t j = i + 1; j < s.count; j++)
                    assert_true(distance(s.position + i * n, s.position + j * n, d) > 0.0199);
            ascc_sequence_free(&s);
        }
}

/* A wall's point lies on a side of the box; every particle is half a spacing or more before it. */
static void test_fluid_lies_on_the_side_the_normals_point_to(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        ascc_sequence s = made("dam-break", d, 8, 0.05);
        const size_t n = (size_t)d;
        for (size_t w = 0; w < s.walls; w++) {
            double length = 0.0;
            for (size_t c = 0; c < n; c++)
                length += (double)s.normal[w * n + c] * (double)s.normal[w * n + c];
            assert_true(length == 1.0);
            for (size_t i = 0; i < s.count; i++) {
                double height = 0.0;
                for (size_t c = 0; c < n; c++)
                    height += (double)s.normal[w * n + c] *
                              ((double)s.position[i * n + c] - (double)s.wall[w * n + c]);
                assert_true(height > 0.0249);
            }
        }
        ascc_sequence_free(&s);
    }
}

/* 0.64 spacings apart is 977 points a square metre; whole numbers of points make it a little more. */
static void test_walls_are_as_dense_as_the_training_data(void **state)
{
    (void)state;
    ascc_sequence s = made("dam-break", 3, 20, 0.05);
    const double box[3] = {2.0, 1.5, 0.5};
    const double area = 2.0 * (box[0] * box[1] + box[1] * box[2] + box[2] * box[0]);
    const double density = (double)s.walls / area;
    assert_true(density >= 976.0 && density < 1050.0);
    ascc_sequence_free(&s);
}

static void test_droplets_have_no_total_momentum(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        ascc_sequence s = made("droplets", d, 0, 0.05);
        double sum[3] = {0.0, 0.0, 0.0};
        for (size_t k = 0; k < s.count * (size_t)d; k++)
            sum[k % (size_t)d] += (double)s.velocity[k];
        assert_true(sum[0] == 0.0 && sum[1] == 0.0 && sum[2] == 0.0);
        ascc_sequence_free(&s);
    }
}

static void test_sizes_scale_with_the_spacing(void **state)
{
    (void)state;
    ascc_sequence a = made("still-column", 3, 8, 0.05), b = made("still-column", 3, 8, 0.1);
    assert_int_equal(a.count, b.count);
    assert_int_equal(a.walls, b.walls);
    for (size_t k = 0; k < a.count * 3; k++)
        assert_true(fabs(2.0 * (double)a.position[k] - (double)b.position[k]) < 1e-6);
    ascc_sequence_free(&a);
    ascc_sequence_free(&b);
}

static void test_bad_names_and_sizes_are_refused(void **state)
{
    (void)state;
    char error[256] = "";
    ascc_sequence s;
    assert_false(ascc_scene_make("sea", 2, 0, 0.05, &s, error, sizeof error));
    assert_string_equal(error, "sea: neither a file nor a scene's name");
    assert_false(ascc_scene_make("dam-break", 2, 3, 0.05, &s, error, sizeof error));
    assert_string_equal(error, "--size 3: 4 to 1000 is wanted");
    assert_false(ascc_scene_make("dam-break", 2, 1001, 0.05, &s, error, sizeof error));
    assert_null(s.position);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_scene_has_its_walls_and_gravity),
        cmocka_unit_test(test_no_two_particles_are_nearer_than_the_spacing),
        cmocka_unit_test(test_fluid_lies_on_the_side_the_normals_point_to),
        cmocka_unit_test(test_walls_are_as_dense_as_the_training_data),
        cmocka_unit_test(test_droplets_have_no_total_momentum),
        cmocka_unit_test(test_sizes_scale_with_the_spacing),
        cmocka_unit_test(test_bad_names_and_sizes_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
