/* Kernels: every variant equals portable C bit for bit, and portable C equals plain doubles.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <ascc/ascc.h>

#include "kernels/kernels.h"

#define GUARD 0x7fc0dead /* a NaN no kernel makes */

static uint64_t seed = 20261122;

static uint32_t next(void)
{
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(seed >> 33);
}

static float uniform(void)
{
    return (float)next() / 1073741824.0f - 1.0f;
}

/* The tables to compare: portable first, then each set of variants that this machine can run. */
static int tables(ascc_kernels *table)
{
    const uint32_t available = ascc_kernels_available();
    int count = 0;
    ascc_kernels_select(&table[count++], 0);
    for (uint32_t cpu = 1; cpu <= available; cpu++)
        if ((cpu & available) == cpu)
            ascc_kernels_select(&table[count++], cpu);
    return count;
}

static float *floats(size_t count)
{
    float *p = aligned_alloc(64, (count * sizeof *p + 127) / 64 * 64);
    assert_non_null(p);
    for (size_t i = 0; i < count; i++)
        p[i] = uniform();
    return p;
}

static float *guarded(size_t count)
{
    float *p = floats(count + 8);
    const uint32_t guard = GUARD;
    for (size_t i = 0; i < count + 8; i++)
        memcpy(p + i, &guard, sizeof guard);
    return p;
}

static void check_guard(const float *p, size_t count)
{
    for (size_t i = count; i < count + 8; i++) {
        uint32_t bits;
        memcpy(&bits, p + i, sizeof bits);
        assert_int_equal(bits, GUARD);
    }
}

static void check_same_bits(const float *a, const float *b, size_t count, const char *what)
{
    for (size_t i = 0; i < count; i++)
        if (memcmp(a + i, b + i, sizeof *a) != 0)
            fail_msg("%s: index %zu: %.9g and %.9g", what, i, (double)a[i], (double)b[i]);
}

/* ---- search ---- */

static void search_finds_the_points_within_the_limit_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t n = 0; n < 70; n++) {
        int32_t x[72], y[72], z[72];
        for (size_t i = 0; i < n; i++) {
            x[i] = (int32_t)(next() << 1) / 64;
            y[i] = (int32_t)(next() << 1) / 64;
            z[i] = n % 3 ? (int32_t)(next() << 1) / 64 : 0;
        }
        const ascc_coordinates points = {x, y, z};
        const float limit = 4e14f;
        const int32_t q[3] = {n ? x[0] : 5, -7000000, 300};
        for (int t = 0; t < count; t++) {
            uint32_t found[100];
            const size_t begin = n / 5;
            const ascc_run runs[2] = {{begin, n / 2}, {n / 2, n}};
            const size_t got = table[t].search(&points, runs, 2, q[0], q[1], q[2], limit, found);
            size_t k = 0;
            for (size_t i = begin; i < n; i++) {
                const double dx = (double)x[i] - q[0], dy = (double)y[i] - q[1],
                             dz = (double)z[i] - q[2];
                const double square = dx * dx + dy * dy + dz * dz;
                if (fabs(square / (double)limit - 1.0) < 1e-6)
                    continue;
                const int inside = square < (double)limit;
                assert_int_equal(inside, k < got && found[k] == i);
                k += (size_t)inside;
            }
            assert_int_equal(k, got);
        }
    }
}

static void search_cube_finds_the_points_within_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    const float inverse = 1.0f / 7000000.0f;
    for (size_t n = 0; n < 70; n++) {
        int32_t x[72], y[72], z[72];
        for (size_t i = 0; i < n; i++) {
            x[i] = (int32_t)(next() << 1) / 200;
            y[i] = (int32_t)(next() << 1) / 200;
            z[i] = n % 3 ? (int32_t)(next() << 1) / 200 : 0;
        }
        if (n > 2) { /* on a face, and just inside */
            x[1] = 7000000;
            x[2] = -6999998;
            y[1] = y[2] = z[1] = z[2] = 0;
        }
        const ascc_coordinates points = {x, y, z};
        for (int t = 0; t < count; t++) {
            uint32_t found[100];
            const ascc_run runs[2] = {{n / 5, n / 3}, {n / 3, n}};
            const size_t got = table[t].search_cube(&points, runs, 2, 0, 0, 0, inverse, found);
            size_t k = 0;
            for (size_t i = n / 5; i < n; i++)
                if (abs(x[i]) < 6999999 && abs(y[i]) < 6999999 && abs(z[i]) < 6999999)
                    assert_true(k < got && found[k++] == i);
            assert_int_equal(k, got);
        }
    }
}

static void search_sees_across_the_wrap_of_the_low_words(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    int32_t x[1] = {INT32_MIN + 10}, zero[1] = {0};
    const ascc_coordinates points = {x, zero, zero};
    for (int t = 0; t < count; t++) {
        uint32_t found[20];
        const ascc_run all = {0, 1};
        assert_int_equal(
            table[t].search(&points, &all, 1, INT32_MAX - 10, 0, 0, 21.5f * 21.5f, found), 1);
        assert_int_equal(
            table[t].search(&points, &all, 1, INT32_MAX - 10, 0, 0, 20.5f * 20.5f, found), 0);
    }
}

/* ---- geometry ---- */

typedef struct pair_arrays {
    float *x, *y, *z, *poly6, *peak, *hat, *distance;
} pair_arrays;

static pair_arrays take_pairs(size_t k)
{
    const pair_arrays p = {guarded(k), guarded(k), guarded(k), guarded(k),
                           guarded(k), guarded(k), guarded(k)};
    return p;
}

static ascc_pairs as_pairs(const pair_arrays *p)
{
    const ascc_pairs pairs = {p->x, p->y, p->z, {NULL, p->poly6, p->peak, p->hat}, p->distance};
    return pairs;
}

static void drop_pairs(pair_arrays *p)
{
    free(p->x);
    free(p->y);
    free(p->z);
    free(p->poly6);
    free(p->peak);
    free(p->hat);
    free(p->distance);
}

static void geometry_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    int32_t x[64], y[64], z[64];
    for (size_t i = 0; i < 64; i++) {
        x[i] = (int32_t)(next() << 1) / 64;
        y[i] = (int32_t)(next() << 1) / 64;
        z[i] = (int32_t)(next() << 1) / 64;
    }
    x[3] = y[3] = z[3] = 0; /* the centre, an axis, a diagonal */
    x[4] = y[4] = 0;
    x[5] = y[5] = z[5] = 1 << 20;
    const ascc_coordinates points = {x, y, z};
    for (int mapping = 0; mapping < 4; mapping++)
        for (size_t k = 0; k < 40; k++) {
            uint32_t neighbor[40];
            for (size_t i = 0; i < k; i++)
                neighbor[i] = (uint32_t)(i < 3 ? i + 3 : next() % 64);
            pair_arrays want = take_pairs(k);
            const ascc_pairs a = as_pairs(&want);
            table[0].geometry(&points, neighbor, k, 0, 0, 0, 1.0f / 33554432.0f, mapping, &a);
            for (int t = 1; t < count; t++) {
                pair_arrays got = take_pairs(k);
                const ascc_pairs b = as_pairs(&got);
                table[t].geometry(&points, neighbor, k, 0, 0, 0, 1.0f / 33554432.0f, mapping, &b);
                check_same_bits(want.x, got.x, k + 8, "x");
                check_same_bits(want.y, got.y, k + 8, "y");
                check_same_bits(want.z, got.z, k + 8, "z");
                check_same_bits(want.poly6, got.poly6, k + 8, "poly6");
                check_same_bits(want.peak, got.peak, k + 8, "peak");
                check_same_bits(want.hat, got.hat, k + 8, "hat");
                check_same_bits(want.distance, got.distance, k + 8, "distance");
                drop_pairs(&got);
            }
            check_guard(want.x, k);
            drop_pairs(&want);
        }
}

static void directions_are_those_of_the_geometry_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    int32_t at[3][64], place[64 * 4];
    for (size_t i = 0; i < 64 * 4; i++) {
        place[i] = (int32_t)(next() << 1) / 64;
        if (i % 4 < 3)
            at[i % 4][i / 4] = place[i];
    }
    const ascc_coordinates points = {at[0], at[1], at[2]};
    for (size_t k = 0; k < 40; k++) {
        uint32_t neighbor[40];
        const size_t room = (k + 7) / 8 * 8;
        for (size_t i = 0; i < k; i++)
            neighbor[i] = i == 2 ? 7 : next() % 64; /* 7: the row itself */
        pair_arrays want = take_pairs(room);
        const ascc_pairs a = as_pairs(&want);
        table[0].geometry(&points, neighbor, k, place[28], place[29], place[30], 0x1p-25f, 3, &a);
        for (int t = 0; t < count; t++) {
            pair_arrays got = take_pairs(room);
            const ascc_pairs b = as_pairs(&got);
            table[t].directions(place, neighbor, k, place + 28, 0x1p-25f, &b);
            check_same_bits(want.x, got.x, k, "x");
            check_same_bits(want.y, got.y, k, "y");
            check_same_bits(want.z, got.z, k, "z");
            check_same_bits(want.distance, got.distance, k, "distance");
            check_guard(got.distance, room);
            drop_pairs(&got);
        }
        drop_pairs(&want);
    }
}

static void geometry_of_opposite_displacements_is_opposite(void **state)
{
    (void)state;
    ascc_kernels kernels;
    ascc_kernels_select(&kernels, ascc_kernels_available());
    for (int i = 0; i < 2000; i++) {
        int32_t at[3] = {(int32_t)(next() << 1) / 64, (int32_t)(next() << 1) / 64,
                         (int32_t)(next() << 1) / 64};
        int32_t x[2] = {at[0], -at[0]}, y[2] = {at[1], -at[1]}, z[2] = {at[2], -at[2]};
        const ascc_coordinates points = {x, y, z};
        const uint32_t neighbor[2] = {0, 1};
        pair_arrays p = take_pairs(2);
        const ascc_pairs pairs = as_pairs(&p);
        kernels.geometry(&points, neighbor, 2, 0, 0, 0, 1.0f / 67108864.0f, 2, &pairs);
        assert_true(p.x[0] == -p.x[1] && p.y[0] == -p.y[1] && p.z[0] == -p.z[1]);
        assert_true(p.poly6[0] == p.poly6[1] && p.peak[0] == p.peak[1]);
        kernels.geometry(&points, neighbor, 2, 0, 0, 0, 1.0f / 67108864.0f, 3, &pairs);
        assert_true(p.x[0] == -p.x[1] && p.y[0] == -p.y[1] && p.z[0] == -p.z[1]);
        assert_true(p.distance[0] == p.distance[1]);
        drop_pairs(&p);
    }
}

static void the_volume_map_fills_the_cube_and_stays_inside(void **state)
{
    (void)state;
    ascc_kernels kernels;
    ascc_kernels_select(&kernels, 0);
    double largest = 0.0;
    for (int i = 0; i < 3000; i++) {
        double d[3], square = 0.0;
        for (int c = 0; c < 3; c++) {
            d[c] = (double)uniform();
            square += d[c] * d[c];
        }
        int32_t x[1], y[1], z[1];
        const double scale = 33554432.0 / sqrt(square);
        x[0] = (int32_t)(d[0] * scale);
        y[0] = (int32_t)(d[1] * scale);
        z[0] = (int32_t)(d[2] * scale);
        const ascc_coordinates points = {x, y, z};
        const uint32_t neighbor[1] = {0};
        pair_arrays p = take_pairs(1);
        const ascc_pairs pairs = as_pairs(&p);
        kernels.geometry(&points, neighbor, 1, 0, 0, 0, 1.0f / 33554432.0f, 2, &pairs);
        const double m =
            fmax(fabs((double)p.x[0]), fmax(fabs((double)p.y[0]), fabs((double)p.z[0])));
        /* A point of the sphere lands on the cube's surface. */
        assert_true(fabs(m - 1.0) < 2e-6);
        largest = fmax(largest, m);
        drop_pairs(&p);
    }
    assert_true(largest > 0.999999);
}

/* ---- the basis ---- */

/* Bump and harmonic in doubles, straight from docs/file-format.md. */
static double bump_of(double distance, size_t bumps, size_t number)
{
    const double t = distance * (double)bumps - (double)number;
    return fabs(t) < 1.0 ? pow(1.0 - t * t, 2.0) : 0.0;
}

static double harmonic_of(const double u[3], size_t harmonics, size_t number)
{
    const bool plane = harmonics == 3 || harmonics == 5;
    const double x = u[0], y = u[1], z = u[2];
    const double flat[5] = {1.0, x, y, 2.0 * x * y, x * x - y * y};
    const double full[9] = {1.0,
                            x,
                            y,
                            z,
                            sqrt(3.0) * x * y,
                            sqrt(3.0) * y * z,
                            sqrt(3.0) * z * x,
                            sqrt(0.75) * (x * x - y * y),
                            (2.0 * z * z - x * x - y * y) / 2.0};
    return plane ? flat[number] : full[number];
}

/* Random displacements in the ball around the origin; the first is at its centre, the second on its
 * surface. */
typedef struct basis_case {
    int32_t x[64], y[64], z[64];
    uint32_t neighbor[64];
    ascc_coordinates points;
} basis_case;

#define BASIS_RADIUS 50000000

static void random_basis(basis_case *c, bool plane)
{
    c->points = (ascc_coordinates){c->x, c->y, c->z};
    for (size_t i = 0; i < 64; i++) {
        double d[3], length = 0.0;
        for (int n = 0; n < 3; n++) {
            d[n] = plane && n == 2 ? 0.0 : (double)uniform();
            length += d[n] * d[n];
        }
        const double scale = BASIS_RADIUS * ((double)uniform() + 1.0) / 2.0 / sqrt(length);
        c->x[i] = (int32_t)(d[0] * scale);
        c->y[i] = (int32_t)(d[1] * scale);
        c->z[i] = (int32_t)(d[2] * scale);
        c->neighbor[i] = (uint32_t)((i * 29 + 5) % 64);
    }
    c->x[5] = c->y[5] = c->z[5] = 0;
    c->x[34] = BASIS_RADIUS;
    c->y[34] = c->z[34] = 0;
}

static double unit_of(const basis_case *c, uint32_t row, double unit[3])
{
    const double d[3] = {c->x[row], c->y[row], c->z[row]};
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int n = 0; n < 3; n++)
        unit[n] = length > 0.0 ? d[n] / length : 0.0;
    return length / BASIS_RADIUS;
}

static void the_basis_equals_doubles_and_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    static const size_t harmonics[] = {1, 3, 5, 4, 9};
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t h = 0; h < 5; h++)
        for (size_t bumps = 1; bumps <= 8; bumps++)
            for (size_t k = 0; k < 40; k += 1 + k / 3)
                for (size_t a = 8; a <= 40; a += 8) {
                    const size_t members = bumps * harmonics[h], stride = (k + 15) / 8 * 8;
                    basis_case c;
                    random_basis(&c, harmonics[h] == 3 || harmonics[h] == 5);
                    float *feature = floats(64 * a), *want = guarded(members * a);
                    double *sum = calloc(members * a + 1, sizeof *sum);
                    assert_non_null(sum);
                    for (size_t i = 0; i < k; i++) {
                        double unit[3];
                        const double distance = unit_of(&c, c.neighbor[i], unit);
                        for (size_t m = 0; m < members; m++)
                            for (size_t j = 0; j < a; j++)
                                sum[m * a + j] +=
                                    bump_of(distance, bumps, m / harmonics[h]) *
                                    harmonic_of(unit, harmonics[h], m % harmonics[h]) *
                                    (double)feature[c.neighbor[i] * a + j];
                    }
                    for (int t = 0; t < count; t++) {
                        pair_arrays p = take_pairs(k);
                        const ascc_pairs pairs = as_pairs(&p);
                        float *factor = guarded(members * stride), *got = guarded(members * a);
                        table[t].geometry(&c.points, c.neighbor, k, 0, 0, 0,
                                          1.0f / (float)BASIS_RADIUS, 3, &pairs);
                        table[t].basis(&pairs, k, bumps, harmonics[h], factor, stride);
                        check_guard(factor, members * stride);
                        table[t].gather_basis(factor, stride, bumps, harmonics[h], c.neighbor, k,
                                              feature, a, got);
                        check_guard(got, members * a);
                        if (t == 0)
                            memcpy(want, got, members * a * sizeof *got);
                        check_same_bits(want, got, members * a, "column");
                        free(factor);
                        free(got);
                        drop_pairs(&p);
                    }
                    for (size_t n = 0; n < members * a; n++)
                        assert_true(fabs(sum[n] - (double)want[n]) <
                                    1e-6 * (double)bumps * (1.0 + (double)k));
                    free(sum);
                    free(want);
                    free(feature);
                }
}

static void at_the_centre_only_the_first_harmonic_counts(void **state)
{
    (void)state;
    ascc_kernels kernels;
    ascc_kernels_select(&kernels, ascc_kernels_available());
    int32_t zero[1] = {0};
    const ascc_coordinates points = {zero, zero, zero};
    const uint32_t neighbor[1] = {0};
    pair_arrays p = take_pairs(1);
    const ascc_pairs pairs = as_pairs(&p);
    float factor[27 * 8];
    kernels.geometry(&points, neighbor, 1, 0, 0, 0, 1e-6f, 3, &pairs);
    kernels.basis(&pairs, 1, 3, 9, factor, 8);
    for (size_t m = 0; m < 27; m++)
        assert_true(factor[m * 8] == (m == 0 ? 1.0f : 0.0f));
    drop_pairs(&p);
}

/* The numbers of a pair, as kernels.h states them. */
static void numbers_of(const float u[3], const float *vector, const float own[3], int wall,
                       const float *drift, size_t dimension, double q[8])
{
    double relative[3];
    for (size_t c = 0; c < 3; c++) {
        const double other = c < dimension ? (double)vector[c] : 0.0;
        const double moved = drift && c < dimension ? (double)drift[c] : 0.0;
        relative[c] = (wall ? moved : other) - (double)own[c];
        q[1 + c] = (double)u[c];
        q[5 + c] = wall ? other : relative[c];
    }
    q[0] = 1.0;
    q[4] = -((double)u[0] * relative[0] + (double)u[1] * relative[1] + (double)u[2] * relative[2]);
}

static void moments_equal_doubles_and_have_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t variant = 0; variant < 8 * 2 * 2 * 2 * 2; variant++) {
        const size_t bumps = 1 + variant % 8, dimension = 2 + variant / 8 % 2;
        const int wall = (int)(variant / 16 % 2), weighted = (int)(variant / 32 % 2);
        const int moves = (int)(variant / 64 % 2);
        for (size_t k = 0; k < 20; k++) {
            const size_t a = 8 + 8 * (k % 2);
            float *coordinate[4], *feature = floats(51 * a), *weight = floats(50 * 3);
            float *drift = moves ? floats(50 * 4) : NULL;
            float own[3] = {0.3f, -0.2f, dimension == 3 ? 0.9f : 0.0f};
            uint32_t neighbor[24];
            for (size_t c = 0; c < 4; c++) {
                coordinate[c] = floats(24);
                for (size_t i = 0; i < 24; i++)
                    coordinate[c][i] = c == 3   ? fabsf(coordinate[c][i])
                                       : c == 2 ? (dimension == 3 ? coordinate[c][i] : 0.0f)
                                                : coordinate[c][i];
            }
            coordinate[3][k % 20] = 1.0f; /* the very edge */
            for (size_t i = 0; i < 24; i++)
                neighbor[i] = next() % 50;
            const ascc_pairs pairs = {.x = coordinate[0],
                                      .y = coordinate[1],
                                      .z = coordinate[2],
                                      .distance = coordinate[3]};
            float *want = guarded(bumps * 8);
            table[0].moments(&pairs, neighbor, k, feature, a, own, wall, dimension,
                             weighted ? weight : NULL, 3, drift, bumps, want);
            check_guard(want, bumps * 8);
            for (size_t b = 0; b < bumps; b++) {
                double sum[8] = {0.0}, q[8];
                for (size_t i = 0; i < k; i++) {
                    const float u[3] = {coordinate[0][i], coordinate[1][i], coordinate[2][i]};
                    const double bump = bump_of((double)coordinate[3][i], bumps, b);
                    const double scale = weighted ? (double)weight[neighbor[i] * 3] : 1.0;
                    numbers_of(u, feature + neighbor[i] * a, own, wall,
                               moves ? drift + neighbor[i] * 4 : NULL, dimension, q);
                    for (size_t n = 0; n < 8; n++)
                        sum[n] += bump * (n < 5 ? scale : 1.0) * q[n];
                }
                for (size_t n = 0; n < 8; n++)
                    assert_true(fabs(sum[n] - (double)want[b * 8 + n]) < 1e-5 * (double)(k + 1));
            }
            for (int t = 1; t < count; t++) {
                float *got = guarded(bumps * 8);
                table[t].moments(&pairs, neighbor, k, feature, a, own, wall, dimension,
                                 weighted ? weight : NULL, 3, drift, bumps, got);
                check_same_bits(want, got, bumps * 8 + 8, "moments");
                free(got);
            }
            for (size_t c = 0; c < 4; c++)
                free(coordinate[c]);
            free(feature);
            free(drift);
            free(weight);
            free(want);
        }
    }
}

/* ---- pairs along lines ---- */

#define LINE_ROWS 50
#define LINE_RADIUS 50000000

typedef struct lines_case {
    int32_t at[LINE_ROWS * 4];
    float coefficient[(LINE_ROWS + 1) * 16], motion[(LINE_ROWS + 1) * 8];
    double place[LINE_ROWS * 3], mass[ASCC_PAIR_BATCH];
    uint32_t neighbor[ASCC_PAIR_BATCH];
    ascc_lines lines;
} lines_case;

/* options: 1 = neighbours are rows, 2 = damped, 4 = turned, 8 = in the plane, 16 = a limit that cuts off. */
static void random_lines(lines_case *c, size_t bumps, unsigned options)
{
    const size_t d = options & 8 ? 2 : 3;
    for (size_t i = 0; i < LINE_ROWS * 3; i++) {
        const size_t at = i / 3 * 4 + i % 3;
        c->at[at] = i % 3 < d ? (int32_t)(uniform() * LINE_RADIUS / 4) : 0;
        c->place[i] = c->at[at] + 1e6 * (double)uniform() * (i % 3 < d);
    }
    for (size_t i = 0; i < sizeof c->coefficient / sizeof *c->coefficient; i++) /* [row][bump][2] */
        c->coefficient[i] = i % 16 / 2 < bumps && (i % 2 == 0 || options & 2) ? uniform() : 0.0f;
    for (size_t i = 0; i < sizeof c->motion / sizeof *c->motion; i++)
        c->motion[i] = uniform();
    for (size_t k = 0; k < ASCC_PAIR_BATCH; k++) {
        c->neighbor[k] = 1 + next() % (LINE_ROWS - 1);
        c->mass[k] = 1.5 + (double)uniform();
    }
    for (int i = 0; i < 3; i++) { /* neighbour 1 lies where row 0 does; all others differ */
        c->at[4 + i] = c->at[i];
        c->place[3 + i] = c->place[i];
    }
    c->lines = (ascc_lines){.row = c->at,
                            .neighbor = c->at,
                            .inverse_radius = 1.0f / LINE_RADIUS,
                            .bumps = bumps,
                            .dimension = d,
                            .both = options & 1,
                            .coefficient = options & 1 ? c->coefficient : NULL,
                            .motion = options & 2 ? c->motion : NULL,
                            .a = 8,
                            .drift = options & 33 || !(options & 2) ? NULL : c->motion,
                            .area = options & 1 ? NULL : c->motion + 5,
                            .area_stride = 8,
                            .place = (options & 5) == 5 ? c->place : NULL,
                            .factor = 1e9,
                            .limit = options & 16 ? 0.2 : INFINITY};
}

/* The impulse of row 0 from neighbour j, from docs/method.md. */
static void impulse_of(const lines_case *c, size_t j, double mass, double impulse[3])
{
    const ascc_lines *l = &c->lines;
    double seen[3], line[3], u[3], distance = 0.0, length = 0.0, cosine = 0.0, approach = 0.0;
    double part[2] = {0.0, 0.0};
    for (size_t i = 0; i < 3; i++) {
        seen[i] = (double)c->at[j * 4 + i] - (double)c->at[i];
        line[i] = l->place ? c->place[j * 3 + i] - c->place[i] : seen[i];
        distance += seen[i] * seen[i];
        length += line[i] * line[i];
        cosine += seen[i] * line[i];
    }
    distance = sqrt(distance);
    length = sqrt(length);
    cosine = distance > 0.0 && length > 0.0 ? cosine / distance / length : 0.0;
    for (size_t i = 0; i < 3; i++) {
        u[i] = length > 0.0 ? line[i] / length : 0.0;
        if (l->motion && i < l->dimension)
            approach += u[i] * ((double)c->motion[i] - (l->both    ? (double)c->motion[j * 8 + i]
                                                        : l->drift ? (double)l->drift[j * 4 + i]
                                                                   : 0.0));
    }
    for (size_t b = 0; b < l->bumps; b++)
        for (size_t p = 0; p < 2; p++)
            part[p] += bump_of(distance / LINE_RADIUS, l->bumps, b) *
                       ((double)c->coefficient[b * 2 + p] +
                        (l->both ? (double)c->coefficient[j * 16 + b * 2 + p] : 0.0));
    const double area = l->area ? (double)c->motion[j * 8 + 5] : 1.0;
    const double strength = area * ((l->place ? cosine : 1.0) * part[0] - part[1] * approach);
    const double total = fmax(-l->limit, fmin(l->limit, strength));
    for (size_t i = 0; i < 3; i++)
        impulse[i] = total * l->factor * mass * u[i];
}

static void pair_lines_equal_doubles_and_have_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (unsigned options = 0; options < 64; options++)
        for (size_t bumps = 1; bumps <= 8; bumps++)
            for (size_t k = 0; k <= ASCC_PAIR_BATCH; k = k < 10 ? k + 1 : k + 9) {
                static lines_case c;
                double want[3][ASCC_PAIR_BATCH], got[3][ASCC_PAIR_BATCH];
                const size_t step = k % 2;
                random_lines(&c, bumps, options);
                table[0].pair_lines(&c.lines, 0, c.coefficient, c.neighbor, k, c.mass, step, want);
                for (size_t j = 0; j < k; j++) {
                    double right[3];
                    impulse_of(&c, c.neighbor[j], c.mass[step ? j : 0], right);
                    for (size_t i = 0; i < 3; i++)
                        assert_true(fabs(right[i] - want[i][j]) < 2e4);
                }
                for (int t = 1; t < count; t++) {
                    table[t].pair_lines(&c.lines, 0, c.coefficient, c.neighbor, k, c.mass, step,
                                        got);
                    for (size_t i = 0; i < 3; i++)
                        for (size_t j = 0; j < k; j++)
                            assert_true(memcmp(&want[i][j], &got[i][j], sizeof(double)) == 0);
                }
            }
}

/* ---- gather, multiply, pair terms ---- */

typedef struct gather_case {
    size_t k, a;
    int32_t cells[3];
    pair_arrays pairs;
    uint32_t neighbor[80];
    float *feature;
} gather_case;

static gather_case random_gather(size_t k, size_t a, const int32_t cells[3])
{
    gather_case c = {.k = k, .a = a, .cells = {cells[0], cells[1], cells[2]}};
    c.pairs = (pair_arrays){floats(k + 8), floats(k + 8), floats(k + 8), floats(k + 8),
                            floats(k + 8), floats(k + 8), floats(k + 8)};
    c.feature = floats(50 * a);
    for (size_t i = 0; i < k; i++)
        c.neighbor[i] = next() % 50;
    if (k > 3) { /* corners of the cube and its centre */
        c.pairs.x[0] = c.pairs.y[0] = c.pairs.z[0] = 1.0f;
        c.pairs.x[1] = c.pairs.y[1] = c.pairs.z[1] = -1.0f;
        c.pairs.x[2] = c.pairs.y[2] = c.pairs.z[2] = 0.0f;
    }
    return c;
}

static void drop_gather(gather_case *c)
{
    drop_pairs(&c->pairs);
    free(c->feature);
}

/* Trilinear weight of a cell in doubles, straight from the definition. */
static double weight_of(const float at[3], const int32_t cells[3], size_t cell)
{
    const size_t i[3] = {cell % (size_t)cells[0], cell / (size_t)cells[0] % (size_t)cells[1],
                         cell / ((size_t)cells[0] * (size_t)cells[1])};
    double w = 1.0;
    for (int c = 0; c < 3; c++) {
        const double coordinate = ((double)at[c] / 2.0 + 0.5) * (cells[c] - 1);
        w *= fmax(0.0, 1.0 - fabs(coordinate - (double)i[c]));
    }
    return w;
}

static const int32_t shapes[][3] = {{4, 4, 4}, {6, 6, 6}, {3, 4, 5},
                                    {8, 8, 1}, {1, 1, 1}, {2, 1, 3}};

static void gather_equals_doubles_and_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t s = 0; s < sizeof shapes / sizeof *shapes; s++)
        for (size_t a = 8; a <= 48; a += 8)
            for (size_t k = 0; k < 21; k += 1 + k / 3) {
                gather_case c = random_gather(k, a, shapes[s]);
                const size_t cells = (size_t)(shapes[s][0] * shapes[s][1] * shapes[s][2]);
                const ascc_pairs pairs = as_pairs(&c.pairs);
                float *want = guarded(cells * a);
                table[0].gather(&pairs, c.pairs.poly6, c.neighbor, k, c.feature, a, c.cells, want);
                check_guard(want, cells * a);
                for (size_t cell = 0; cell < cells; cell++)
                    for (size_t j = 0; j < a; j++) {
                        double sum = 0.0;
                        for (size_t i = 0; i < k; i++) {
                            const float at[3] = {c.pairs.x[i], c.pairs.y[i], c.pairs.z[i]};
                            sum += (double)c.pairs.poly6[i] * weight_of(at, c.cells, cell) *
                                   (double)c.feature[c.neighbor[i] * a + j];
                        }
                        assert_true(fabs(sum - (double)want[cell * a + j]) <
                                    1e-6 * (1.0 + (double)k));
                    }
                for (int t = 1; t < count; t++) {
                    float *got = guarded(cells * a);
                    table[t].gather(&pairs, c.pairs.poly6, c.neighbor, k, c.feature, a, c.cells,
                                    got);
                    check_same_bits(want, got, cells * a + 8, "column");
                    free(got);
                }
                free(want);
                drop_gather(&c);
            }
}

/* The same as of columns that hold the blocks one after another. */
static void blocks_are_multiplied_as_columns_on_every_cpu(void **state)
{
    (void)state;
    enum { MOST_ROWS = 19, MOST_BLOCKS = 27, PLACES = 40 };
    static const size_t blocks[] = {0, 1, 9, MOST_BLOCKS}, inputs[] = {1, 8, 11, 16};
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t n = 0; n <= MOST_ROWS; n++)
        for (size_t b = 8; b <= 56; b += 8)
            for (size_t i = 0; i < 16; i++) {
                const size_t m = blocks[i / 4], a = inputs[i % 4], stride = b + 5;
                float *source = floats(PLACES * 16), *weight = floats(m * a * b + 1);
                float *column = floats(n * m * a + 1), *begin = floats(n * stride + 8);
                float *want = guarded(n * stride);
                const float *in[MOST_ROWS * MOST_BLOCKS];
                for (size_t k = 0; k < n * m; k++) {
                    in[k] = source + next() % PLACES * 16;
                    memcpy(column + k * a, in[k], a * sizeof *column);
                }
                memcpy(want, begin, n * stride * sizeof *want);
                table[0].multiply(column, m * a, n, m * a, weight, b, want, stride);
                for (int t = 0; t < count; t++) {
                    float *got = guarded(n * stride);
                    memcpy(got, begin, n * stride * sizeof *got);
                    table[t].multiply_blocks(in, m, n, a, weight, b, got, stride);
                    check_same_bits(want, got, n * stride, "blocks");
                    check_guard(got, n * stride);
                    free(got);
                }
                free(source);
                free(weight);
                free(column);
                free(begin);
                free(want);
            }
}

/* Any sign, an exponent among [low, high], and a mantissa that ends in `zeros` zeros. */
static float number(uint32_t low, uint32_t high, int zeros)
{
    const uint32_t mantissa = (next() & 0x7fffffu) >> zeros << zeros;
    const uint32_t bits = (next() & 1u) << 31 | (low + next() % (high - low + 1)) << 23 | mantissa;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Sums that lie on midpoints of floats or right beside, that are subnormal, zero or exact. */
static void products_and_sums_are_rounded_once_on_every_cpu(void **state)
{
    (void)state;
    enum { A = 3, B = 8 };
    ascc_kernels table[16];
    const int count = tables(table);
    for (int i = 0; i < 300000; i++) {
        float in[A] = {0}, weight[A * B], want[B], begin[B];
        const int kind = i % 4, zeros = i % 24, k = 16 + i % 8;
        for (int j = 0; j < A * B; j++)
            weight[j] = kind == 0   ? number(120, 134, 12)
                        : kind == 1 ? number(20, 60, zeros)
                        : kind == 2 ? ldexpf(next() % 2 ? 1.0f - ldexpf(1.0f, -k) : -1.0f, -80)
                                    : (float)(next() % 3);
        for (int j = 0; j < (kind == 2 ? 1 : A); j++)
            in[j] = kind == 0   ? number(120, 134, 11)
                    : kind == 1 ? number(40, 80, 0)
                    : kind == 2 ? ldexpf(1.0f + ldexpf(1.0f, -k), -70) /* 2^-150 (1 - 2^-2k) */
                                : (float)(next() % 2);
        for (int j = 0; j < B; j++)
            want[j] = begin[j] = kind == 0   ? number(0, 160, zeros)
                                 : kind == 1 ? number(0, 3, 0)
                                 : kind == 2 ? number(0, 1, 0)
                                             : number(100, 127, zeros) * (float)(next() % 2);
        table[0].multiply(in, A, 1, A, weight, B, want, B);
        for (int t = 1; t < count; t++) {
            float out[B];
            memcpy(out, begin, sizeof out);
            table[t].multiply(in, A, 1, A, weight, B, out, B);
            check_same_bits(want, out, B, "product");
        }
    }
}

static void multiply_equals_doubles_and_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t n = 0; n <= 17; n++)
        for (size_t b = 8; b <= 56; b += 8)
            for (size_t a = 0; a <= 72; a += 24) {
                const size_t stride = a + 3, out_stride = b + 5;
                float *in = floats(n * stride + 1), *weight = floats(a * b + 1);
                float *begin = floats(n * out_stride + 8), *want = guarded(n * out_stride);
                memcpy(want, begin, n * out_stride * sizeof *want);
                table[0].multiply(in, stride, n, a, weight, b, want, out_stride);
                check_guard(want, n * out_stride);
                for (size_t r = 0; r < n; r++)
                    for (size_t o = 0; o < out_stride; o++) {
                        double sum = (double)begin[r * out_stride + o];
                        for (size_t i = 0; o < b && i < a; i++)
                            sum += (double)in[r * stride + i] * (double)weight[i * b + o];
                        assert_true(fabs(sum - (double)want[r * out_stride + o]) < 1e-5);
                    }
                for (int t = 1; t < count; t++) {
                    float *got = guarded(n * out_stride);
                    memcpy(got, begin, n * out_stride * sizeof *got);
                    table[t].multiply(in, stride, n, a, weight, b, got, out_stride);
                    check_same_bits(want, got, n * out_stride + 8, "product");
                    free(got);
                }
                free(in);
                free(weight);
                free(begin);
                free(want);
            }
}

static void pair_terms_equal_doubles_and_have_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t s = 0; s < sizeof shapes / sizeof *shapes; s++)
        for (size_t b = 1; b <= 3; b++)
            for (size_t k = 0; k < 20; k += 3) {
                const size_t a = 16, cells = (size_t)(shapes[s][0] * shapes[s][1] * shapes[s][2]);
                gather_case c = random_gather(k, a, shapes[s]);
                const ascc_pairs pairs = as_pairs(&c.pairs);
                float *center = floats(a), *weight = floats(cells * a * b);
                float *want = guarded(k * 4);
                table[0].pair_terms(&pairs, c.pairs.peak, c.neighbor, k, center, c.feature, a,
                                    c.cells, weight, b, want);
                check_guard(want, k * 4);
                for (size_t i = 0; i < k * 4; i++)
                    assert_true(i % 4 < b || want[i] == 0.0f);
                for (size_t i = 0; i < k; i++)
                    for (size_t o = 0; o < b; o++) {
                        const float at[3] = {c.pairs.x[i], c.pairs.y[i], c.pairs.z[i]};
                        double sum = 0.0;
                        for (size_t cell = 0; cell < cells; cell++)
                            for (size_t j = 0; j < a; j++)
                                sum +=
                                    weight_of(at, c.cells, cell) *
                                    ((double)center[j] + (double)c.feature[c.neighbor[i] * a + j]) *
                                    (double)weight[(cell * b + o) * a + j];
                        sum *= (double)c.pairs.peak[i];
                        assert_true(fabs(sum - (double)want[i * 4 + o]) < 1e-5);
                    }
                for (int t = 1; t < count; t++) {
                    float *got = guarded(k * 4);
                    table[t].pair_terms(&pairs, c.pairs.peak, c.neighbor, k, center, c.feature, a,
                                        c.cells, weight, b, got);
                    check_same_bits(want, got, k * 4 + 8, "pair terms");
                    free(got);
                }
                free(center);
                free(weight);
                free(want);
                drop_gather(&c);
            }
}

/* Pairs of one row: terms, masses, neighbours (some twice) and sums so far. */
#define MOST_PAIRS 21
#define SUM_ROWS 6

typedef struct impulse_case {
    float term[MOST_PAIRS * 4];
    double mass[MOST_PAIRS], factor[4];
    uint32_t neighbor[MOST_PAIRS];
    int64_t own[4], sum[SUM_ROWS * 4];
} impulse_case;

static void random_impulses(impulse_case *c)
{
    for (size_t i = 0; i < MOST_PAIRS * 4; i++)
        c->term[i] = i % 4 < 3 ? uniform() : 0.0f;
    for (size_t i = 0; i < MOST_PAIRS; i++) {
        c->mass[i] = 1.5 + (double)uniform();
        c->neighbor[i] = next() % SUM_ROWS;
    }
    for (size_t i = 0; i < 4; i++) {
        c->factor[i] = i < 3 ? 1e9 * (double)uniform() : 0.0;
        c->own[i] = (int64_t)next() - 1000;
    }
    for (size_t i = 0; i < SUM_ROWS * 4; i++)
        c->sum[i] = (int64_t)next() << 20;
    c->term[0] = 0.5f; /* ties: half a quantum to 0, one and a half to 2 */
    c->term[4] = 1.5f;
    c->factor[0] = c->mass[0] = c->mass[1] = 1.0;
}

/* Of both kernels that give impulses; added: what is given is made here, in space. */
static int impulses(const ascc_kernels *table, impulse_case *c, size_t step, size_t k, bool added)
{
    double x[3][ASCC_PAIR_BATCH];
    for (size_t j = 0; added && j < k; j++)
        for (size_t i = 0; i < 3; i++)
            x[i][j] = (double)c->term[j * 4 + i] * c->factor[i] * c->mass[step ? j : 0];
    return added ? table->add_impulses(x, 0x1p50, c->neighbor, k, c->own, c->sum)
                 : table->pair_impulses(c->term, c->factor, c->mass, step, 0x1p50, c->neighbor, k,
                                        c->own, c->sum);
}

static void pair_impulses_are_the_nearest_integers_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t k = 0; k <= MOST_PAIRS; k++)
        for (size_t step = 0; step < 2; step++) {
            impulse_case c;
            random_impulses(&c);
            impulse_case want = c;
            for (size_t j = 0; j < k; j++)
                for (size_t i = 0; i < 4; i++) {
                    const double x = (double)c.term[j * 4 + i] * c.factor[i] * c.mass[step ? j : 0];
                    want.own[i] += (int64_t)rint(x);
                    want.sum[c.neighbor[j] * 4 + i] -= (int64_t)rint(x);
                }
            for (int t = 0; t < 2 * count; t++) {
                impulse_case got = c;
                assert_int_equal(impulses(&table[t / 2], &got, step, k, t % 2), 1);
                assert_true(memcmp(got.own, want.own, sizeof want.own) == 0);
                assert_true(memcmp(got.sum, want.sum, sizeof want.sum) == 0);
            }
        }
}

static void an_impulse_that_does_not_fit_is_told_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t k = 1; k <= MOST_PAIRS; k++)
        for (int fault = 0; fault < 6; fault++)
            for (int t = 0; t < 2 * count; t++) {
                impulse_case c;
                random_impulses(&c);
                const size_t last = k - 1;
                c.mass[0] = 1.0;
                c.factor[1] = fault < 3 ? 0x1p50 : 1e3;
                for (size_t j = 0; j < k; j++)
                    c.term[j * 4 + 1] = fault < 3 ? 0.0f : 1.0f;
                if (fault == 0)
                    c.term[last * 4 + 1] = NAN;
                else if (fault == 1)
                    c.term[last * 4 + 1] = -INFINITY;
                else if (fault == 2)
                    c.term[last * 4 + 1] = 1.0f;
                else if (fault == 3)
                    c.own[1] = INT64_MAX - 1000 * (int64_t)k + 1;
                else if (fault == 4)
                    c.sum[c.neighbor[last] * 4 + 1] = INT64_MIN + 999;
                else {
                    c.own[1] = INT64_MIN + 1000 * (int64_t)k - 1;
                    c.factor[1] = -1e3;
                }
                assert_int_equal(impulses(&table[t / 2], &c, 0, k, t % 2), 0);
            }
}

/* ---- Relaxation ---- */

static void the_spline_equals_doubles_and_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    float volumes[50];
    uint32_t neighbor[80];
    for (size_t i = 0; i < 50; i++)
        volumes[i] = 0.5f + 0.4f * uniform();
    for (size_t k = 0; k < 70; k++) {
        float *first[4] = {NULL}, first_sum[8] = {0};
        for (size_t i = 0; i < k; i++)
            neighbor[i] = next() % 50;
        const uint64_t again = seed;
        for (int t = 0; t < count; t++) {
            float *array[4], sum[8];
            const size_t room = (k + 7) / 8 * 8;
            seed = again;
            for (int c = 0; c < 4; c++)
                array[c] = guarded(room);
            double expected[5] = {0}, size[5] = {0};
            for (size_t i = 0; i < k; i++) {
                float u[3] = {uniform(), uniform(), uniform()};
                const float q = i % 9 ? fabsf(uniform()) * 1.2f : 0.0f;
                const float n = sqrtf(u[0] * u[0] + u[1] * u[1] + u[2] * u[2]);
                const double far = fmax(1.0 - (double)q, 0.0), near = fmax(0.5 - (double)q, 0.0);
                const double volume = k % 2 ? 0.25 : (double)volumes[neighbor[i]];
                const double slope = volume * 6.0 * (far * far - 4.0 * near * near);
                double term[5] = {volume * 2.0 * (far * far * far - 4.0 * near * near * near)};
                for (int c = 0; c < 3; c++) {
                    array[c][i] = q > 0.0f ? u[c] / n : 0.0f;
                    term[1 + c] = slope * (double)array[c][i];
                    term[4] += term[1 + c] * term[1 + c];
                }
                array[3][i] = q;
                for (int c = 0; c < 5; c++) {
                    expected[c] += term[c];
                    size[c] += fabs(term[c]) + volume;
                }
            }
            const ascc_pairs pairs = {
                .x = array[0], .y = array[1], .z = array[2], .distance = array[3]};
            table[t].spline(&pairs, neighbor, k, 0.25f, k % 2 ? NULL : volumes, sum);
            for (int c = 0; c < 5; c++) /* a few roundings of each term, ten of each sum */
                assert_true(fabs((double)sum[c] - expected[c]) <= 40.0 * 0x1p-24 * size[c]);
            for (int c = 5; c < 8; c++)
                assert_true(sum[c] == 0.0f);
            for (int c = 0; c < 4; c++) {
                check_guard(array[c], room);
                for (size_t i = k; i < room; i++)
                    assert_true(array[c][i] == 0.0f);
                if (t > 0)
                    check_same_bits(first[c], array[c], room, "spline");
            }
            if (t > 0)
                check_same_bits(first_sum, sum, 8, "sums of the spline");
            else
                memcpy(first_sum, sum, sizeof sum);
            for (int c = 0; c < 4; c++) {
                if (t == 0)
                    first[c] = array[c];
                else
                    free(array[c]);
            }
        }
        for (int c = 0; c < 4; c++)
            free(first[c]);
    }
}

enum { SWEPT = 60, SWEPT_PAIRS = 3000 };

static void sweeps_equal_doubles_and_have_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    static float g[3][SWEPT_PAIRS], weight[SWEPT_PAIRS], pressure[SWEPT], numbers[3][SWEPT];
    static uint32_t neighbor[SWEPT_PAIRS];
    float *const own[3] = {numbers[0], numbers[1], numbers[2]};
    size_t start[SWEPT], end[SWEPT], at = 0;
    for (size_t i = 0; i < SWEPT; i++) {
        start[i] = at;
        const size_t pairs = next() % 45;
        for (size_t k = 0; k < (pairs + 7) / 8 * 8; k++, at++) {
            neighbor[at] = k < pairs ? next() % SWEPT : (uint32_t)i;
            weight[at] = 1.0f + uniform();
            for (int c = 0; c < 3; c++)
                g[c][at] = k < pairs ? uniform() : 0.0f;
        }
        end[i] = at;
        pressure[i] = fabsf(uniform());
        for (int c = 0; c < 3; c++)
            numbers[c][i] = uniform();
    }
    for (int weighted = 0; weighted < 2; weighted++) {
        static float first[4][SWEPT];
        const ascc_gradients pairs = {.start = start,
                                      .end = end,
                                      .neighbor = neighbor,
                                      .g = {g[0], g[1], g[2]},
                                      .weight = weighted ? weight : NULL};
        for (int t = 0; t < count; t++) {
            static float move[3][SWEPT], change[SWEPT], to[SWEPT * 4];
            table[t].push(&pairs, 0, 25, pressure, own, to);
            table[t].push(&pairs, 25, SWEPT, pressure, own, to);
            table[t].divergence(&pairs, 0, 31, own, to, change);
            table[t].divergence(&pairs, 31, SWEPT, own, to, change);
            for (size_t i = 0; i < SWEPT * 3; i++)
                move[i % 3][i / 3] = to[i / 3 * 4 + i % 3];
            for (size_t i = 0; i < SWEPT; i++) {
                double sum = 0.0, size = 1.0;
                for (int c = 0; c < 3; c++) {
                    double moved = -(double)pressure[i] * (double)own[c][i], most = 1.0;
                    sum += (double)own[c][i] * (double)move[c][i];
                    for (size_t k = start[i]; k < end[i]; k++) {
                        const double share = (weighted ? (double)weight[k] : 1.0) *
                                             (double)g[c][k] * (double)pressure[neighbor[k]];
                        moved -= share;
                        most += fabs(share);
                        sum -= (double)g[c][k] * (double)move[c][neighbor[k]];
                        size += fabs((double)g[c][k] * (double)move[c][neighbor[k]]);
                    }
                    assert_true(fabs((double)move[c][i] - moved) <= 16.0 * 0x1p-24 * most);
                }
                assert_true(fabs((double)change[i] - sum) <= 24.0 * 0x1p-24 * size);
            }
            for (int c = 0; c < 4; c++) {
                const float *got = c < 3 ? move[c] : change;
                if (t == 0)
                    memcpy(first[c], got, sizeof first[c]);
                check_same_bits(first[c], got, SWEPT, "sweeps");
            }
        }
    }
}

static void kept_gradients_are_those_that_are_not_0_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    for (size_t k = 0; k < 70; k++) {
        const size_t room = (k + 7) / 8 * 8;
        float *from[3] = {floats(room), floats(room), floats(room)};
        uint32_t neighbor[70];
        for (size_t i = 0; i < k; i++) {
            neighbor[i] = next();
            for (int c = 0; c < 3; c++)
                if (next() % 3 || k % 5 == 1)
                    from[c][i] = i % 2 ? 0.0f : -0.0f;
        }
        const ascc_pairs pairs = {.x = from[0], .y = from[1], .z = from[2]};
        for (int t = 0; t < count; t++) {
            float *g[3] = {guarded(room), guarded(room), guarded(room)};
            uint32_t to[72];
            const size_t got = table[t].keep_gradients(&pairs, neighbor, k, 777, to, g);
            size_t at = 0;
            for (size_t i = 0; i < k; i++) {
                if (from[0][i] == 0.0f && from[1][i] == 0.0f && from[2][i] == 0.0f)
                    continue;
                assert_true(at < got && to[at] == neighbor[i]);
                for (int c = 0; c < 3; c++)
                    assert_true(g[c][at] == from[c][i]);
                at++;
            }
            assert_int_equal(got, (at + 7) / 8 * 8);
            for (; at < got; at++)
                assert_true(to[at] == 777 && g[0][at] == 0.0f && g[1][at] == 0.0f &&
                            g[2][at] == 0.0f);
            for (int c = 0; c < 3; c++) {
                check_guard(g[c], room);
                free(g[c]);
            }
        }
        for (int c = 0; c < 3; c++)
            free(from[c]);
    }
}

enum { ROWS = 90, LONGEST = 88 }; /* rows of more than one batch */

static ascc_gradients random_gradients(void)
{
    static float g[3][ROWS * LONGEST];
    static uint32_t neighbor[ROWS * LONGEST];
    static size_t start[ROWS], end[ROWS];
    for (size_t i = 0; i < ROWS; i++) {
        const size_t pairs = i % 3 ? next() % 40 : LONGEST - 3;
        start[i] = i * LONGEST;
        end[i] = start[i] + (pairs + 7) / 8 * 8;
        for (size_t k = 0; k < end[i] - start[i]; k++) {
            neighbor[start[i] + k] = k < pairs ? (uint32_t)((i + 1 + k) % ROWS) : (uint32_t)i;
            for (int c = 0; c < 3; c++)
                g[c][start[i] + k] = k < pairs ? uniform() : 0.0f;
        }
    }
    return (ascc_gradients){
        .start = start, .end = end, .neighbor = neighbor, .g = {g[0], g[1], g[2]}};
}

/* Pairs of a row with rows after it, in doubles. */
static void press_in_doubles(const ascc_gradients *pairs, const ascc_pressures *p, size_t row,
                             double (*sum)[3])
{
    for (size_t k = pairs->start[row]; k < pairs->end[row]; k++) {
        const size_t j = pairs->neighbor[k];
        const double both = (double)p->pressure[row] + (double)p->pressure[j];
        const double a = p->mass[p->uniform ? 0 : row], b = p->mass[p->uniform ? 0 : j];
        double x[3], size = 0.0, along = 0.0, square = 0.0;
        for (size_t c = 0; c < 3; c++) {
            x[c] = -both * (double)pairs->g[c][k];
            size += x[c] * x[c];
        }
        for (size_t c = 0; c < 3; c++) {
            x[c] *= fmin(1.0, (double)p->limit / sqrt(size));
            if (p->place) {
                const double line = p->place[j * 3 + c] - p->place[row * 3 + c];
                along += line * x[c];
                square += line * line;
            }
        }
        for (size_t c = 0; j > row && c < 3; c++) {
            if (p->place)
                x[c] = along / square * (p->place[j * 3 + c] - p->place[row * 3 + c]);
            const double impulse = x[c] * p->factor * 2.0 * a * b / (a + b);
            sum[row][c] += impulse;
            sum[j][c] -= impulse;
        }
    }
}

static void pressure_impulses_equal_doubles_and_have_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    static float pressure[ROWS];
    static double mass[ROWS], place[ROWS * 3];
    const ascc_gradients pairs = random_gradients();
    for (size_t i = 0; i < ROWS; i++) {
        pressure[i] = next() % 3 ? fabsf(uniform()) : 0.0f;
        mass[i] = 1.5 + (double)uniform();
        for (int c = 0; c < 3; c++)
            place[i * 3 + (size_t)c] = (double)uniform();
    }
    for (int options = 0; options < 8; options++) {
        static double want[ROWS][3];
        static int64_t first[ROWS * 4], got[ROWS * 4];
        const ascc_pressures p = {.pressure = pressure,
                                  .limit = options & 1 ? 0.5f : 100.0f,
                                  .factor = 1e9,
                                  .mass = mass,
                                  .uniform = options & 2,
                                  .place = options & 4 ? place : NULL};
        memset(want, 0, sizeof want);
        for (size_t i = 0; i < ROWS; i++)
            press_in_doubles(&pairs, &p, i, want);
        for (int t = 0; t < count; t++) {
            memset(got, 0, sizeof got);
            for (size_t i = 0; i < ROWS; i++)
                assert_int_equal(table[t].pressure_impulses(&pairs, &p, i, 0x1p50, got), 1);
            for (size_t i = 0; i < ROWS * 4;
                 i++) /* some 200 impulses of up to 1e10, 4 roundings each */
                assert_true(i % 4 == 3 ? got[i] == 0
                                       : fabs((double)got[i] - want[i / 4][i % 4]) < 2e5);
            if (t == 0)
                memcpy(first, got, sizeof got);
            assert_memory_equal(first, got, sizeof got);
        }
        assert_int_equal(table[0].pressure_impulses(&pairs, &p, 0, 1.0, got), 0);
    }
}

/* by |g|^2 and the smaller coefficient: of row i, the difference to a neighbour */
static void weigh_in_doubles(const ascc_gradients *pairs, size_t i, size_t k, const float *move,
                             double difference[3])
{
    const float *row = move + i * 4, *other = move + (size_t)pairs->neighbor[k] * 4;
    double weight = 0.0;
    for (int c = 0; c < 3; c++)
        weight += (double)pairs->g[c][k] * (double)pairs->g[c][k];
    for (int c = 0; c < 3; c++)
        difference[c] =
            weight * (double)fminf(row[3], other[3]) * ((double)row[c] - (double)other[c]);
}

static void roughness_equals_doubles_and_has_the_same_bits_on_every_cpu(void **state)
{
    (void)state;
    ascc_kernels table[16];
    const int count = tables(table);
    const ascc_gradients pairs = random_gradients();
    static float move[ROWS * 4], rough[ROWS * 4], again[ROWS * 4], first[ROWS * 4];
    static float weight[ROWS * LONGEST];
    static double want[ROWS][3], impulse[ROWS][3];
    static int64_t given[ROWS * 4], first_given[ROWS * 4];
    for (size_t i = 0; i < ROWS * 4; i++)
        move[i] = i % 4 == 3 ? fabsf(uniform()) : uniform();
    for (size_t i = 0; i < ROWS; i++)
        for (size_t k = pairs.start[i]; k < pairs.end[i]; k++) {
            const size_t j = pairs.neighbor[k];
            double d[3];
            weigh_in_doubles(&pairs, i, k, move, d);
            for (int c = 0; c < 3; c++) {
                want[i][c] += d[c];
                impulse[i][c] -= j > i ? 1e9 * d[c] : 0.0;
                impulse[j][c] += j > i ? 1e9 * d[c] : 0.0;
            }
        }
    for (int t = 0; t < count; t++) {
        ascc_gradients weighed = pairs;
        weighed.weight = weight;
        table[t].roughness(&pairs, 0, 33, move, weight, rough);
        table[t].roughness(&pairs, 33, ROWS, move, weight, rough);
        table[t].roughness(&weighed, 0, ROWS, move, NULL, again);
        check_same_bits(rough, again, ROWS * 4, "roughness by weights");
        memset(given, 0, sizeof given);
        for (size_t i = 0; i < ROWS; i++)
            assert_int_equal(table[t].rough_impulses(&weighed, move, 1e9, i, 0x1p50, given), 1);
        /* 88 terms of at most 6, a chain of 11 and some roundings of each */
        for (size_t i = 0; i < ROWS * 4; i++) {
            assert_true(i % 4 == 3 ? rough[i] == 0.0f
                                   : fabs((double)rough[i] - want[i / 4][i % 4]) <
                                         88.0 * 6.0 * 20.0 * 0x1p-24);
            assert_true(i % 4 == 3 ? given[i] == 0
                                   : fabs((double)given[i] - impulse[i / 4][i % 4]) <
                                         1e9 * 88.0 * 6.0 * 6.0 * 0x1p-24);
        }
        if (t == 0) {
            memcpy(first, rough, sizeof first);
            memcpy(first_given, given, sizeof given);
        }
        check_same_bits(first, rough, ROWS * 4, "roughness");
        assert_memory_equal(first_given, given, sizeof given);
        assert_int_equal(table[t].rough_impulses(&weighed, move, 1e9, 0, 1.0, given), 0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(search_finds_the_points_within_the_limit_on_every_cpu),
        cmocka_unit_test(search_cube_finds_the_points_within_on_every_cpu),
        cmocka_unit_test(search_sees_across_the_wrap_of_the_low_words),
        cmocka_unit_test(geometry_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(directions_are_those_of_the_geometry_on_every_cpu),
        cmocka_unit_test(geometry_of_opposite_displacements_is_opposite),
        cmocka_unit_test(the_volume_map_fills_the_cube_and_stays_inside),
        cmocka_unit_test(the_basis_equals_doubles_and_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(at_the_centre_only_the_first_harmonic_counts),
        cmocka_unit_test(moments_equal_doubles_and_have_the_same_bits_on_every_cpu),
        cmocka_unit_test(pair_lines_equal_doubles_and_have_the_same_bits_on_every_cpu),
        cmocka_unit_test(gather_equals_doubles_and_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(blocks_are_multiplied_as_columns_on_every_cpu),
        cmocka_unit_test(products_and_sums_are_rounded_once_on_every_cpu),
        cmocka_unit_test(multiply_equals_doubles_and_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(pair_terms_equal_doubles_and_have_the_same_bits_on_every_cpu),
        cmocka_unit_test(pair_impulses_are_the_nearest_integers_on_every_cpu),
        cmocka_unit_test(an_impulse_that_does_not_fit_is_told_on_every_cpu),
        cmocka_unit_test(kept_gradients_are_those_that_are_not_0_on_every_cpu),
        cmocka_unit_test(pressure_impulses_equal_doubles_and_have_the_same_bits_on_every_cpu),
        cmocka_unit_test(roughness_equals_doubles_and_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(the_spline_equals_doubles_and_has_the_same_bits_on_every_cpu),
        cmocka_unit_test(sweeps_equal_doubles_and_have_the_same_bits_on_every_cpu),
    };
    return cmocka_run_group_tests_name("kernels", tests, NULL, NULL);
}
