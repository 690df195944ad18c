/* The reference solvers, the generator and the linter. SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../examples/ascc/commands.h"
#include "flow.h"
#include "inspect.h"
#include "pbf.h"
#include "sequence.h"
#include "recipes.h"

/* ---- SPH ---- */

static void make(const char *kind, int32_t dimension, uint64_t number, double spacing, recipe *r)
{
    const recipe_options options = {.seed = 7,
                                    .number = number,
                                    .dimension = dimension,
                                    .spacing = spacing,
                                    .solver = RECIPE_SPH};
    assert_int_equal(recipe_make(kind, &options, r), ASCC_OK);
}

static sph *start(const recipe *r, int32_t threads)
{
    sph *s;
    wall_points walls;
    assert_int_equal(recipe_solver(r, threads, &s, &walls), ASCC_OK);
    wall_points_free(&walls);
    return s;
}

/* Each pair's forces are opposite numbers, so only the sums of N terms and the kicks round: a few
 * hundred steps of 2^-53 relative to the sum of |v|. */
static void momentum_without_walls_is_kept_to_rounding(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        recipe r;
        make("droplets", d, 0, d == 2 ? 0.02 : 0.08, &r);
        sph *s = start(&r, 1);
        assert_int_equal(sph_advance(s, 0.2), ASCC_OK);
        const sph_particle *p = sph_particles(s, NULL, NULL);
        double sum[3] = {0}, size = 0.0;
        for (size_t i = 0; i < r.count; i++)
            for (int c = 0; c < d; c++) {
                sum[c] += p[i].velocity[c] - r.velocity[i * (size_t)d + (size_t)c];
                size += fabs(p[i].velocity[c]);
            }
        for (int c = 0; c < 3; c++)
            assert_true(fabs(sum[c]) < 1e-13 * size);
        sph_destroy(&s);
        recipe_free(&r);
    }
}

/* Pressure of the lowest row, continued to the floor, against the weight of the water. */
static void bottom_carries_the_weight_of_the_column(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        recipe r;
        make("still-column", d, 1, d == 2 ? 0.02 : 0.08, &r);
        const double level = r.depth[0] + r.position[1];
        sph *s = start(&r, 2);
        double mean = 0.0;
        for (int f = 0; f < 40; f++) {
            assert_int_equal(sph_advance(s, 0.025), ASCC_OK);
            const sph_particle *p = sph_particles(s, NULL, NULL);
            double sum = 0.0, count = 0.0;
            for (size_t i = 0; i < r.count; i++)
                if (p[i].position[1] < r.spacing) {
                    sum += p[i].pressure + 9810.0 * p[i].position[1];
                    count += 1.0;
                }
            assert_true(count > 0.0);
            mean += sum / count / 40.0;
        }
        /* the free surface is uncertain by half a spacing of some twenty or ten */
        assert_true(fabs(mean / (9810.0 * level) - 1.0) < 0.5 * r.spacing / level);
        sph_destroy(&s);
        recipe_free(&r);
    }
}

static void lattice_at_rest_keeps_its_density(void **state)
{
    (void)state;
    recipe r;
    make("still-column", 2, 0, 0.025, &r);
    r.gravity[1] = 0.0;
    free(r.depth);
    r.depth = NULL;
    sph *s = start(&r, 1);
    assert_int_equal(sph_advance(s, 0.1), ASCC_OK);
    const sph_particle *p = sph_particles(s, NULL, NULL);
    for (size_t i = 0; i < r.count; i++) {
        assert_true(fabs(p[i].density - 1000.0) < 1e-6);
        assert_true(hypot(p[i].velocity[0], p[i].velocity[1]) < 1e-6);
    }
    sph_destroy(&s);
    recipe_free(&r);
}

static void sph_bits_do_not_depend_on_threads(void **state)
{
    (void)state;
    recipe r;
    make("wbc2d", 0, 2, 0.025, &r);
    sph *first = start(&r, 1);
    assert_int_equal(sph_advance(first, 0.3), ASCC_OK);
    const sph_particle *p = sph_particles(first, NULL, NULL);
    for (int32_t threads = 2; threads <= 7; threads += 5) {
        sph *other = start(&r, threads);
        assert_int_equal(sph_advance(other, 0.3), ASCC_OK);
        assert_memory_equal(p, sph_particles(other, NULL, NULL), r.count * sizeof *p);
        sph_destroy(&other);
    }
    sph_destroy(&first);
    recipe_free(&r);
}

static void bad_options_make_no_solver(void **state)
{
    (void)state;
    const sph_options flat = {.dimension = 1, .spacing = 0.1, .sound_speed = 10.0};
    const sph_options silent = {.dimension = 2, .spacing = 0.1};
    const pbf_options small = {.dimension = 2};
    assert_null(sph_create(&flat));
    assert_null(sph_create(&silent));
    assert_null(pbf_create(&small));
}

static void a_position_that_is_no_number_is_an_error(void **state)
{
    (void)state;
    const sph_options options = {.dimension = 2, .spacing = 0.1, .sound_speed = 10.0};
    const double position[2][2] = {{0.0, 0.0}, {NAN, 0.0}};
    sph *s = sph_create(&options);
    assert_int_equal(sph_set_fluid(s, 2, position[0], NULL), ASCC_OK);
    assert_int_equal(sph_advance(s, 0.01), ASCC_ERROR_RANGE);
    assert_non_null(strstr(sph_message(s), "point 1"));
    sph_destroy(&s);
}

/* ---- PBF ---- */

/* Runs a drop into a pool for 60 frames; positions into *end if wanted. */
static double pool_error(int32_t iterations, int32_t threads, double (**end)[3], size_t *count)
{
    recipe r;
    make("pool-drop", 2, 1, 0.025, &r);
    const pbf_options o = {.dimension = 2,
                           .thread_count = threads,
                           .spacing = r.spacing,
                           .gravity = {0.0, -9.81},
                           .iterations = iterations};
    wall_points walls = {0};
    assert_true(solids_sample(r.solids, r.solid_count, 2, r.spacing, 3, &walls));
    pbf *p = pbf_create(&o);
    assert_int_equal(pbf_set_walls(p, walls.count, walls.position), ASCC_OK);
    assert_int_equal(pbf_set_fluid(p, r.count, r.position, r.velocity), ASCC_OK);
    double sum = 0.0, error;
    for (int f = 0; f < 60; f++) {
        assert_int_equal(pbf_advance(p, 0.005), ASCC_OK);
        assert_int_equal(pbf_density_error(p, &error), ASCC_OK);
        sum += error / 60.0;
    }
    if (end) {
        *count = r.count;
        *end = malloc(r.count * sizeof **end);
        memcpy(*end, pbf_positions(p), r.count * sizeof **end);
    }
    pbf_destroy(&p);
    wall_points_free(&walls);
    recipe_free(&r);
    return sum;
}

static void pbf_density_error_falls_with_iterations(void **state)
{
    (void)state;
    double last = INFINITY;
    for (int32_t iterations = 1; iterations <= 16; iterations *= 4) {
        const double error = pool_error(iterations, 1, NULL, NULL);
        assert_true(error < last);
        last = error;
    }
    assert_true(last < 0.005);
}

static void pbf_bits_do_not_depend_on_threads(void **state)
{
    (void)state;
    double(*one)[3], (*three)[3];
    size_t count;
    (void)pool_error(2, 1, &one, &count);
    (void)pool_error(2, 3, &three, &count);
    assert_memory_equal(one, three, count * sizeof *one);
    free(one);
    free(three);
}

static void pbf_lattice_has_rest_density(void **state)
{
    (void)state;
    const pbf_options o = {.dimension = 3, .spacing = 0.1};
    pbf *p = pbf_create(&o);
    double position[125][3], error;
    for (int i = 0; i < 125; i++)
        for (int c = 0; c < 3; c++)
            position[i][c] = 0.1 * (c == 0 ? i % 5 : c == 1 ? i / 5 % 5 : i / 25);
    assert_int_equal(pbf_set_fluid(p, 125, position[0], NULL), ASCC_OK);
    assert_int_equal(pbf_density_error(p, &error), ASCC_OK);
    assert_true(error < 1e-6); /* nowhere above 1: the outer ones miss neighbours */
    pbf_destroy(&p);
}

/* ---- Generator ---- */

static int generate(const char *kind, const char *seed, const char *threads, const char *directory)
{
    char *arguments[] = {(char *)(uintptr_t)kind,
                         "--seed",
                         (char *)(uintptr_t)seed,
                         "--count",
                         "3",
                         "--frames",
                         "4",
                         "--spacing",
                         "0.025",
                         "--threads",
                         (char *)(uintptr_t)threads,
                         "-o",
                         (char *)(uintptr_t)directory};
    return ascc_command_generate((int)(sizeof arguments / sizeof *arguments), arguments);
}

static char *read_all(const char *directory, const char *name, size_t *size)
{
    char path[512];
    (void)snprintf(path, sizeof path, "%s/%s", directory, name);
    FILE *file = fopen(path, "rb");
    assert_non_null(file);
    char *bytes = malloc(1 << 22);
    *size = fread(bytes, 1, 1 << 22, file);
    (void)fclose(file);
    return bytes;
}

static void same_seed_gives_same_bytes(void **state)
{
    (void)state;
    char one[] = "/tmp/ascc-one-XXXXXX", three[] = "/tmp/ascc-three-XXXXXX";
    assert_non_null(mkdtemp(one));
    assert_non_null(mkdtemp(three));
    assert_int_equal(generate("wbc2d", "5", "1", one), 0);
    assert_int_equal(generate("wbc2d", "5", "3", three), 0);
    assert_int_equal(generate("wbc2d", "6", "2", one), 0);
    size_t sizes[4];
    char *a = read_all(one, "wbc2d_5_0001.safetensors", &sizes[0]);
    char *b = read_all(three, "wbc2d_5_0001.safetensors", &sizes[1]);
    char *c = read_all(one, "wbc2d_6_0001.safetensors", &sizes[2]);
    char *d = read_all(one, "wbc2d_5_0002.safetensors", &sizes[3]);
    assert_int_equal(sizes[0], sizes[1]);
    assert_memory_equal(a, b, sizes[0]);
    assert_true(sizes[0] != sizes[2] || memcmp(a, c, sizes[0]) != 0);
    assert_true(sizes[0] != sizes[3] || memcmp(a, d, sizes[0]) != 0);
    free(a);
    free(b);
    free(c);
    free(d);
}

static void a_stopped_run_goes_on(void **state)
{
    (void)state;
    char directory[] = "/tmp/ascc-resume-XXXXXX", path[512];
    assert_non_null(mkdtemp(directory));
    assert_int_equal(generate("ramps2d", "5", "2", directory), 0);
    size_t size, again;
    char *before = read_all(directory, "ramps2d_5_0001.safetensors", &size);
    (void)snprintf(path, sizeof path, "%s/ramps2d_5_0001.safetensors", directory);
    assert_int_equal(unlink(path), 0);
    (void)snprintf(path, sizeof path, "%s/ramps2d_5_0000.safetensors", directory);
    FILE *mark = fopen(path, "wb"); /* stands for a finished file: it is left alone */
    (void)fputs("kept", mark);
    (void)fclose(mark);
    assert_int_equal(generate("ramps2d", "5", "2", directory), 0);
    char *after = read_all(directory, "ramps2d_5_0001.safetensors", &again);
    assert_int_equal(size, again);
    assert_memory_equal(before, after, size);
    free(after);
    after = read_all(directory, "ramps2d_5_0000.safetensors", &again);
    assert_int_equal(again, 4);
    free(before);
    free(after);
}

static void wrong_use_of_the_generator_is_refused(void **state)
{
    (void)state;
    char *unknown[] = {"lava", "-o", "/tmp"};
    char *nowhere[] = {"wbc2d"};
    char *deep[] = {"wbc2d", "-o", "/tmp", "--dimension", "3"};
    char *none[] = {"wbc2d", "-o", "/tmp", "--count", "0"};
    assert_int_equal(ascc_command_generate(3, unknown), 2);
    assert_int_equal(ascc_command_generate(1, nowhere), 2);
    assert_int_equal(ascc_command_generate(5, deep), 2);
    assert_int_equal(ascc_command_generate(5, none), 2);
}

static void options_of_the_generator_arrive(void **state)
{
    (void)state;
    char directory[] = "/tmp/ascc-options-XXXXXX", path[512], error[256];
    static const char *const solvers[] = {"sph", "dfsph"};
    assert_non_null(mkdtemp(directory));
    (void)snprintf(path, sizeof path, "%s/ramps2d_3_0000.safetensors", directory);
    for (int k = 0; k < 2; k++) {
        char *arguments[] = {"ramps2d",
                             "--seed",
                             "3",
                             "--frames",
                             "3",
                             "--spacing",
                             "0.025",
                             "--interval",
                             "0.004",
                             "--gravity",
                             "0.5",
                             "--solver",
                             (char *)(uintptr_t)solvers[k],
                             "-o",
                             directory};
        assert_int_equal(ascc_command_generate(15, arguments), 0);
        ascc_sequence s;
        assert_true(ascc_sequence_read(path, &s, error, sizeof error));
        assert_true(s.time_step == 0.004 && s.gravity[1] == -0.5 * 9.81);
        assert_true((strstr(s.source, "; DFSPH") != NULL) == (k == 1));
        ascc_sequence_free(&s);
        assert_int_equal(unlink(path), 0);
    }
    char *other[] = {"ramps2d", "--solver", "flip", "-o", directory};
    assert_int_equal(ascc_command_generate(5, other), 2);
}

/* Whether the kind's walls move, which only DFSPH computes. */
static bool moves(const char *kind)
{
    static const char *const kinds[] = {"paddle", "turning-tank", "floating-body", "sinking-body"};
    bool found = false;
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++)
        found |= strcmp(kind, kinds[i]) == 0;
    return found;
}

static void every_kind_makes_a_scene_clear_of_its_walls(void **state)
{
    (void)state;
    for (size_t k = 0; recipe_kinds[k][0]; k++)
        for (uint64_t number = 0; number < 20; number++) {
            const recipe_options options = {.seed = 7,
                                            .number = number,
                                            .dimension = k < 3        ? 0
                                                         : number % 2 ? 2
                                                                      : 3,
                                            .solver = number % 4 < 2 ? RECIPE_DFSPH : RECIPE_SPH};
            recipe r;
            const bool refused = options.solver == RECIPE_SPH && moves(recipe_kinds[k][0]);
            assert_int_equal(recipe_make(recipe_kinds[k][0], &options, &r),
                             refused ? ASCC_ERROR_ARGUMENT : ASCC_OK);
            if (refused)
                continue;
            assert_true(r.count > 100 && r.settled <= r.count &&
                        strlen(r.text) < sizeof r.text - 1);
            const double gap = r.dimension == 3 && r.solver == RECIPE_DFSPH ? 0.99 : 0.49;
            for (size_t i = 0; i < r.count && r.solid_count; i++) {
                double at[3] = {0}, normal[3];
                memcpy(at, r.position + i * (size_t)r.dimension, (size_t)r.dimension * sizeof *at);
                assert_true(solids_distance(r.solids, r.solid_count, r.dimension, at, normal) >
                            gap * r.spacing);
            }
            recipe_free(&r);
        }
}

/* A room of 10 x 10 x 10 with a block of 4 x 4 x 4 on its floor and a ball above. */
static void faces_have_their_points_where_fluid_can_be(void **state)
{
    (void)state;
    const solid solids[] = {{.kind = SOLID_ROOM, .center = {5, 5, 5}, .half = {5, 5, 5}},
                            {.kind = SOLID_BOX, .center = {5, 2, 5}, .half = {2, 2, 2}},
                            {.kind = SOLID_BALL, .center = {5, 7, 5}, .radius = 2}};
    wall_points w = {0};
    assert_true(solids_sample_faces(solids, 3, 0.5, &w));
    double at_floor = 0.0;
    for (size_t i = 0; i < w.count; i++) {
        const double *x = w.position + 3 * i, *n = w.normal + 3 * i;
        double away[3], out[3];
        assert_true(fabs(solids_distance(solids, 3, 3, x, away)) < 1e-9);
        for (int c = 0; c < 3; c++)
            out[c] = x[c] + 0.01 * n[c];
        assert_true(fabs(solids_distance(solids, 3, 3, out, away) - 0.01) < 1e-9);
        at_floor += x[1] == 0.0 ? 1.0 : 0.0;
    }
    assert_true(at_floor == 20.0 * 20.0 - 8.0 * 8.0);
    /* 600 of the room less the floor below the block, five sides of it, the ball: four points each */
    const double area = 600.0 - 16.0 + 80.0 + 16.0 * 3.14159265;
    assert_true(fabs((double)w.count / (4.0 * area) - 1.0) < 0.01);
    wall_points_free(&w);
}

/* Half a metre of water in its first frame: slower than a fall by a tenth of a spacing, and at the density of rest. */
static void still_tank_begins_at_rest(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        const recipe_options options = {.seed = 2, .dimension = d, .spacing = d == 2 ? 0.025 : 0.1};
        recipe r;
        flow *f;
        wall_points walls;
        assert_int_equal(recipe_make("still-tank", &options, &r), ASCC_OK);
        assert_int_equal(flow_create(&r, 2, &f, &walls), ASCC_OK);
        const size_t values = r.count * (size_t)d;
        float *frame = malloc(2 * values * sizeof *frame);
        flow_read(f, frame);
        double square = 0.0;
        for (size_t i = 0; i < values; i++)
            square += (double)frame[values + i] * (double)frame[values + i] / (double)r.count;
        assert_true(square < 2.0 * 9.81 * 0.1 * r.spacing);
        assert_true(fabs(flow_mass(f) / (1000.0 * pow(r.spacing, d)) - (d == 2 ? 1.0 : 0.8)) <
                    1e-9);
        free(frame);
        flow_destroy(&f);
        wall_points_free(&walls);
        recipe_free(&r);
    }
}

/* ---- Walls that move ---- */

typedef struct moving_scene {
    recipe r;
    flow *f;
    size_t walls;
    float *before, *after, *normal; /* [walls][dimension] */
} moving_scene;

/* The first scene of a kind, coarse, and its walls 0.1 s later. */
static moving_scene run_moving(const char *kind, int32_t d)
{
    const recipe_options options = {.seed = 4, .dimension = d, .spacing = d == 2 ? 0.025 : 0.1};
    moving_scene s;
    wall_points walls;
    assert_int_equal(recipe_make(kind, &options, &s.r), ASCC_OK);
    assert_int_equal(flow_create(&s.r, 2, &s.f, &walls), ASCC_OK);
    s.walls = walls.count;
    s.before = calloc(3 * s.walls * (size_t)d, sizeof *s.before);
    assert_non_null(s.before);
    s.after = s.before + s.walls * (size_t)d;
    s.normal = s.after + s.walls * (size_t)d;
    assert_true(flow_walls_move(s.f));
    flow_read_walls(s.f, s.before, s.normal);
    for (size_t k = 0; k < s.walls * (size_t)d; k++) {
        assert_true(s.before[k] == (float)walls.position[k]);
        assert_true(s.normal[k] == (float)walls.normal[k]);
    }
    for (int n = 0; n < 4; n++)
        assert_int_equal(flow_advance(s.f, 0.025), ASCC_OK);
    flow_read_walls(s.f, s.after, s.normal);
    wall_points_free(&walls);
    return s;
}

static void free_moving(moving_scene *s)
{
    free(s->before);
    flow_destroy(&s->f);
    recipe_free(&s->r);
}

static void a_paddle_goes_as_the_recipe_says_and_the_room_rests(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        moving_scene s = run_moving("paddle", d);
        const recipe_motion *m = &s.r.motion[1];
        const double way = m->reach * (1.0 - cos(m->rate * 0.1));
        size_t gone = 0;
        for (size_t w = 0; w < s.walls * (size_t)d; w += (size_t)d) {
            const double x = (double)s.after[w] - (double)s.before[w];
            assert_true(fabs(x) < 1e-6 || fabs(x - way) < 1e-6);
            assert_true(s.after[w + 1] == s.before[w + 1]);
            gone += fabs(x) > 1e-6;
        }
        assert_true(way > 0.001 && gone > 10 && gone < s.walls / 2);
        free_moving(&s);
    }
}

static void a_turning_tank_turns_all_of_its_points_and_normals(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        moving_scene s = run_moving("turning-tank", d);
        const recipe_motion *m = &s.r.motion[0];
        const double *c = s.r.solids[0].center;
        const double angle = m->spin * (0.1 - m->spin_up * (1.0 - exp(-0.1 / m->spin_up)));
        assert_true(fabs(angle) > 0.01);
        for (size_t w = 0; w < s.walls * (size_t)d; w += (size_t)d) {
            const double x = (double)s.before[w] - c[0], y = (double)s.before[w + 1] - c[1];
            assert_true(fabs(cos(angle) * x - sin(angle) * y + c[0] - (double)s.after[w]) < 1e-6);
            assert_true(fabs(sin(angle) * x + cos(angle) * y + c[1] - (double)s.after[w + 1]) <
                        1e-6);
            const double along = (double)s.normal[w] * ((double)s.after[w] - c[0]) +
                                 (double)s.normal[w + 1] * ((double)s.after[w + 1] - c[1]);
            assert_true(along < 1e-6); /* into the tank still */
        }
        free_moving(&s);
    }
}

static void a_heavy_body_sinks_slower_than_it_falls(void **state)
{
    (void)state;
    for (int32_t d = 2; d <= 3; d++) {
        moving_scene s = run_moving("sinking-body", d);
        double deepest = 0.0;
        for (size_t w = 0; w < s.walls * (size_t)d; w += (size_t)d)
            deepest = fmax(deepest, (double)s.before[w + 1] - (double)s.after[w + 1]);
        assert_true(deepest > 0.1 * 0.5 * 9.81 * 0.01 && deepest < 1.1 * 0.5 * 9.81 * 0.01);
        free_moving(&s);
    }
}

/* Frames of walls are in the file, whatever the number of threads, and the linter takes walls where they are. */
static void sequences_of_moving_walls_are_written_and_pass(void **state)
{
    (void)state;
    char one[] = "/tmp/ascc-one-XXXXXX", three[] = "/tmp/ascc-three-XXXXXX";
    char name[64], path[512], error[256], *folder[] = {one, three};
    static const char *const kinds[] = {"turning-tank", "floating-body"};
    for (size_t k = 0; k < 2; k++) {
        for (size_t t = 0; t < 2; t++) {
            char *arguments[] = {(char *)(uintptr_t)kinds[k],
                                 "--seed",
                                 "3",
                                 "--frames",
                                 "12",
                                 "--dimension",
                                 "2",
                                 "--spacing",
                                 "0.025",
                                 "--threads",
                                 t ? "3" : "1",
                                 "-o",
                                 folder[t]};
            if (k == 0)
                assert_non_null(mkdtemp(folder[t]));
            assert_int_equal(ascc_command_generate(13, arguments), 0);
        }
        (void)snprintf(name, sizeof name, "%s_3_0000.safetensors", kinds[k]);
        size_t sizes[2];
        char *a = read_all(one, name, &sizes[0]), *b = read_all(three, name, &sizes[1]);
        assert_int_equal(sizes[0], sizes[1]);
        assert_memory_equal(a, b, sizes[0]);
        free(a);
        free(b);
        (void)snprintf(path, sizeof path, "%s/%s", one, name);
        ascc_sequence s;
        assert_true(ascc_sequence_read(path, &s, error, sizeof error));
        assert_true(s.walls_move && s.frames == 12);
        assert_true(memcmp(s.wall, s.wall + 11 * s.walls * 2, s.walls * 2 * sizeof *s.wall) != 0);
        ascc_sequence_free(&s);
        char *arguments[] = {path};
        assert_int_equal(ascc_command_lint(1, arguments), 0);
    }
}

/* ---- Linter ---- */

#define FRAMES 20

/* Water falling for a moment in a box: 12 x 12 particles, 20 frames, and the walls below. */
typedef struct lint_case {
    float position[FRAMES][144][2];
    float wall[40][2], normal[40][2];
    inspect_input input;
} lint_case;

static lint_case *fall(void)
{
    lint_case *c = calloc(1, sizeof *c);
    for (int f = 0; f < FRAMES; f++)
        for (int i = 0; i < 144; i++) {
            const double t = 0.0025 * f;
            c->position[f][i][0] = (float)(0.1 + 0.0125 * (i % 12));
            c->position[f][i][1] = (float)(0.1 + 0.0125 * (i / 12) - 0.5 * 9.81 * t * t);
        }
    for (int i = 0; i < 40; i++) {
        const bool top = i >= 20; /* a floor and a lid, so that there is room to fall */
        c->wall[i][0] = (float)(0.025 * (i % 20));
        c->wall[i][1] = top ? 0.5f : -0.00625f;
        c->normal[i][1] = top ? -1.0f : 1.0f;
    }
    c->input = (inspect_input){.dimension = 2,
                               .frames = FRAMES,
                               .count = 144,
                               .time_step = 0.0025,
                               .spacing = 0.0125,
                               .gravity = {0.0, -9.81, 0.0},
                               .position = c->position[0][0],
                               .walls = 40,
                               .wall = c->wall[0],
                               .normal = c->normal[0]};
    return c;
}

static void expect(lint_case *c, const char *verdict)
{
    inspection f;
    assert_int_equal(inspect(&c->input, NULL, &f), ASCC_OK);
    if (verdict) {
        assert_non_null(f.verdict);
        assert_string_equal(f.verdict, verdict);
    } else {
        assert_null(f.verdict);
    }
    free(c);
}

static void linter_accepts_water_that_falls(void **state)
{
    (void)state;
    expect(fall(), NULL);
}

static void linter_rejects_a_spike(void **state)
{
    (void)state;
    lint_case *c = fall();
    c->position[10][5][0] += 0.06f; /* 24 m/s for one frame, where 3 m/s can be reached */
    expect(c, "spikes");
}

static void linter_rejects_an_escape(void **state)
{
    (void)state;
    lint_case *c = fall();
    for (int f = 0; f < FRAMES; f++) {
        c->position[f][3][1] = -0.02f; /* more than a spacing below the floor */
        c->position[f][3][0] = 0.3f;
    }
    expect(c, "escapes");
}

/* A floor that rises past a particle that rests leaves it outside; one that falls with the water does not. */
static void linter_has_walls_where_their_frame_has_them(void **state)
{
    (void)state;
    static float wall[2][FRAMES][40][2], normal[FRAMES][40][2];
    for (int rises = 0; rises < 2; rises++) {
        lint_case *c = fall();
        for (int f = 0; f < FRAMES; f++)
            for (int i = 0; i < 40; i++) {
                wall[rises][f][i][0] = c->wall[i][0];
                wall[rises][f][i][1] = c->wall[i][1] + 0.01f * (float)(rises && i < 20 ? f : 0);
                memcpy(normal[f][i], c->normal[i], sizeof normal[f][i]);
            }
        c->input.wall = wall[rises][0][0];
        c->input.normal = normal[0][0];
        c->input.wall_stride = 80;
        expect(c, rises ? "escapes" : NULL);
    }
}

static void linter_rejects_clumps(void **state)
{
    (void)state;
    lint_case *c = fall();
    for (int f = 0; f < FRAMES; f++)
        for (int i = 0; i < 3; i++)
            c->position[f][i][0] = 0.1f + 0.004f * (float)i;
    expect(c, "clumps");
}

static void linter_accepts_a_pair_that_meets(void **state)
{
    (void)state;
    lint_case *c = fall();
    c->position[7][1][0] = c->position[7][0][0] + 0.003f;
    expect(c, NULL);
}

static void linter_rejects_what_is_no_number(void **state)
{
    (void)state;
    lint_case *c = fall();
    c->position[7][1][0] = NAN;
    expect(c, "not finite");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(momentum_without_walls_is_kept_to_rounding),
        cmocka_unit_test(bottom_carries_the_weight_of_the_column),
        cmocka_unit_test(lattice_at_rest_keeps_its_density),
        cmocka_unit_test(sph_bits_do_not_depend_on_threads),
        cmocka_unit_test(bad_options_make_no_solver),
        cmocka_unit_test(a_position_that_is_no_number_is_an_error),
        cmocka_unit_test(pbf_density_error_falls_with_iterations),
        cmocka_unit_test(pbf_bits_do_not_depend_on_threads),
        cmocka_unit_test(pbf_lattice_has_rest_density),
        cmocka_unit_test(same_seed_gives_same_bytes),
        cmocka_unit_test(a_stopped_run_goes_on),
        cmocka_unit_test(wrong_use_of_the_generator_is_refused),
        cmocka_unit_test(options_of_the_generator_arrive),
        cmocka_unit_test(every_kind_makes_a_scene_clear_of_its_walls),
        cmocka_unit_test(faces_have_their_points_where_fluid_can_be),
        cmocka_unit_test(still_tank_begins_at_rest),
        cmocka_unit_test(a_paddle_goes_as_the_recipe_says_and_the_room_rests),
        cmocka_unit_test(a_turning_tank_turns_all_of_its_points_and_normals),
        cmocka_unit_test(a_heavy_body_sinks_slower_than_it_falls),
        cmocka_unit_test(sequences_of_moving_walls_are_written_and_pass),
        cmocka_unit_test(linter_accepts_water_that_falls),
        cmocka_unit_test(linter_rejects_a_spike),
        cmocka_unit_test(linter_rejects_an_escape),
        cmocka_unit_test(linter_has_walls_where_their_frame_has_them),
        cmocka_unit_test(linter_rejects_clumps),
        cmocka_unit_test(linter_accepts_a_pair_that_meets),
        cmocka_unit_test(linter_rejects_what_is_no_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
