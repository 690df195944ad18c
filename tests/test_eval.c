/* `ascc eval` on sequences whose errors are known, with a method added as a newcomer would.
 * SPDX-License-Identifier: MIT
 *
 * Linked with eval.c but not with methods.c: the table of methods is this file's.
 */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "commands.h"
#include "method_walls.h"
#include "sequence.h"

/* ---- A method of one's own: the fluid stays where it is (docs/measures.md shows this) --------- */

static void frozen_frame(ascc_plain *fluid)
{
    for (size_t i = 0; i < fluid->count; i++)
        fluid->velocity[i] = 0.0;
}

static bool frozen_open(const char *settings, const ascc_method_scene *scene, void **state,
                        ascc_method_error *error)
{
    return ascc_plain_open(frozen_frame, settings, scene, state, error);
}

static const ascc_method method_frozen = {
    .prefix = "frozen", .help = "frozen         nothing moves", .open = frozen_open, ASCC_PLAIN};

/* ---- Methods that fail ----------------------------------------------------------------------- */

static bool broken_advance(void *state, ascc_method_error *error)
{
    (void)state;
    snprintf(error->text, sizeof error->text, "it \"broke\"");
    return false;
}

static void lost_read(const void *state, double *position, double *velocity)
{
    ascc_plain_read(state, position, velocity);
    position[3] = NAN;
}

static const ascc_method method_broken = {.prefix = "broken",
                                          .help = "",
                                          .open = frozen_open,
                                          .set = ascc_plain_set,
                                          .advance = broken_advance,
                                          .read = ascc_plain_read,
                                          .close = ascc_plain_close};
static const ascc_method method_lost = {.prefix = "lost",
                                        .help = "",
                                        .open = frozen_open,
                                        .set = ascc_plain_set,
                                        .advance = ascc_plain_advance,
                                        .read = lost_read,
                                        .close = ascc_plain_close};

const ascc_method *const ascc_methods[] = {
    &ascc_method_ballistic, &ascc_method_sph, &ascc_method_dfsph, &ascc_method_pbf,
    &method_frozen,         &method_broken,   &method_lost,       NULL};

/* ---- Sequences ------------------------------------------------------------------------------- */

enum { SIDE = 5, COUNT = SIDE * SIDE * SIDE, FRAMES = 61 };

static const double DT = 0.02, SPEED = 0.5, GRAVITY = -9.81;

/* Position of a row in free flight from a lattice, thrown along x. */
static void flight(size_t row, double time, float position[3], float velocity[3])
{
    const double at[3] = {(double)(row % SIDE), (double)(row / SIDE % SIDE),
                          (double)(row / SIDE / SIDE)};
    for (size_t c = 0; c < 3; c++) {
        const double v = c == 0 ? SPEED : 0.0, g = c == 1 ? GRAVITY : 0.0;
        position[c] = (float)(0.05 * at[c] + time * (v + 0.5 * time * g));
        velocity[c] = (float)(v + time * g);
    }
}

static int write_sequence(void **state)
{
    char error[256] = "";
    static float position[COUNT * 3], velocity[COUNT * 3], nothing[3];
    ascc_sequence header = {.dimension = 3,
                            .time_step = DT,
                            .gravity = {0.0, GRAVITY, 0.0},
                            .radius = 0.025,
                            .mass = 0.1,
                            .rest_density = 1000.0,
                            .count = COUNT,
                            .wall = nothing,
                            .normal = nothing,
                            .source = "thrown lattice"};
    (void)state;
    ascc_sequence_writer *writer =
        ascc_sequence_create("test_eval.safetensors", &header, true, error, sizeof error);
    for (size_t k = 0; k < FRAMES && writer; k++) {
        for (size_t i = 0; i < COUNT; i++)
            flight(i, (double)k * DT, &position[3 * i], &velocity[3 * i]);
        if (!ascc_sequence_append(writer, position, velocity, error, sizeof error))
            return -1;
    }
    if (!writer || !ascc_sequence_finish(writer, true, error, sizeof error)) {
        fprintf(stderr, "%s\n", error);
        return -1;
    }
    return 0;
}

static int remove_files(void **state)
{
    (void)state;
    (void)remove("test_eval.safetensors");
    (void)remove("test_eval.json");
    (void)remove("test_eval_2.json");
    (void)remove("test_eval.csv");
    return 0;
}

static char *read_text(const char *path)
{
    static char text[2][65536];
    static int turn;
    char *into = text[turn = !turn];
    FILE *file = fopen(path, "r");
    assert_non_null(file);
    into[fread(into, 1, sizeof text[0] - 1, file)] = 0;
    fclose(file);
    return into;
}

/* Runs `ascc eval METHOD test_eval.safetensors --json PATH ...`. */
static int evaluate(const char *method, const char *json, const char *option, const char *value)
{
    const char *arguments[7] = {method, "test_eval.safetensors", "--quiet", "--json", json, option,
                                value};
    char copy[7][64], *argv[8];
    int argc = 0;
    for (; argc < 7 && arguments[argc]; argc++) {
        snprintf(copy[argc], sizeof copy[argc], "%s", arguments[argc]);
        argv[argc] = copy[argc];
    }
    argv[argc] = NULL;
    return ascc_command_eval(argc, argv);
}

static bool has(const char *text, const char *name, const char *value)
{
    char line[128];
    snprintf(line, sizeof line, "\"%s\": %s", name, value);
    return strstr(text, line) != NULL;
}

static double figure(const char *text, const char *name)
{
    char line[64];
    snprintf(line, sizeof line, "\"%s\": ", name);
    const char *at = strstr(text, line);
    if (!at)
        fail_msg("no figure %s", name);
    return strtod(at + strlen(line), NULL);
}

static void assert_near(double got, double expected, double bound)
{
    if (!(fabs(got - expected) <= bound))
        fail_msg("got %.9g, expected %.9g within %.3g", got, expected, bound);
}

/* Files hold floats of up to 8 m: off by 2.4e-7 m each, so differences over dt by 5e-5 m/s. */
static const double ROUNDING = 1e-6;

static void free_flight_has_no_error(void **state)
{
    (void)state;
    assert_int_equal(evaluate("ballistic", "test_eval.json", NULL, NULL), 0);
    const char *text = read_text("test_eval.json");
    assert_near(figure(text, "starts_stored"), 12.0, 0.0);    /* 0, 5, ... 55 */
    assert_near(figure(text, "starts_difference"), 5.0, 0.0); /* 10, 20, ... 50 */
    assert_near(figure(text, "err_n1_stored"), 0.0, ROUNDING);
    assert_near(figure(text, "err_n2_stored"), 0.0, ROUNDING);
    assert_near(figure(text, "err_n2_difference"), 0.0, 4 * ROUNDING);
    assert_near(figure(text, "gt2pred_mean"), 0.0, ROUNDING);
    assert_near(figure(text, "chamfer_final_pred2gt"), 0.0, ROUNDING);
    assert_near(figure(text, "density_max_error"), 0.0, 1e-4);
    assert_near(figure(text, "jsd_mean"), 0.0, 0.0);
    assert_near(figure(text, "min_pair_distance"), 0.05, ROUNDING);
    assert_near(figure(text, "kinetic_0"), 0.5 * 0.1 * COUNT * SPEED * SPEED, 1e-9);
    assert_near(figure(text, "momentum_drift_max"), 0.0, 1e-11);
    assert_near(figure(text, "energy_gain_max"), 0.0, 1e-9);
    assert_near(figure(text, "last_frame"), FRAMES - 1, 0.0);
}

static void a_method_of_ones_own_is_measured(void **state)
{
    (void)state;
    assert_int_equal(evaluate("frozen", "test_eval.json", "--frames", "0:1:1"), 0);
    const char *text = read_text("test_eval.json");
    const double one = hypot(DT * SPEED, 0.5 * DT * DT * GRAVITY);
    const double two = hypot(2 * DT * SPEED, 2.0 * DT * DT * GRAVITY);
    assert_near(figure(text, "starts_stored"), 1.0, 0.0);
    assert_near(figure(text, "err_n1_stored"), one, ROUNDING);
    assert_near(figure(text, "err_n2_stored"), two, ROUNDING);
    assert_near(figure(text, "mean_error_2"), two, ROUNDING);
    assert_near(figure(text, "rmse_1"), one, ROUNDING);
    assert_near(figure(text, "com_offset_x"), -SPEED * DT * (FRAMES - 1), ROUNDING);
    assert_near(figure(text, "kinetic_50"), 0.0, 0.0);
    assert_true(has(text, "momentum_drift_max", "null"));
}

/* A loose lattice has no pressure: both solvers must fly it as the equation says. PBF's first stored
 * velocity is moved back half a step for that, see method_pbf.c. */
static void reference_solvers_fly_freely(void **state)
{
    static const char *const methods[] = {"sph:cs=20", "sph:cs=20,contact=-1,coarse=1.5",
                                          "pbf:", "pbf:iterations=2,substeps=3"};
    (void)state;
    for (size_t k = 0; k < sizeof methods / sizeof *methods; k++) {
        assert_int_equal(evaluate(methods[k], "test_eval.json", "--frames", "0:20:10"), 0);
        const char *text = read_text("test_eval.json");
        assert_near(figure(text, "err_n2_stored"), 0.0, 4 * ROUNDING);
        assert_near(figure(text, "err_n2_difference"), 0.0, 4 * ROUNDING);
    }
    /* DFSPH takes stored velocities as those of its own last step: half a step of gravity ahead. */
    assert_int_equal(evaluate("dfsph:step=0.001", "test_eval.json", "--frames", "0:20:10"), 0);
    assert_near(figure(read_text("test_eval.json"), "err_n2_difference"), 0.0, 4 * ROUNDING);
    assert_near(figure(read_text("test_eval.json"), "err_n2_stored"), -0.0005 * 2 * DT * GRAVITY,
                4 * ROUNDING);
    assert_int_equal(evaluate("dfsph:iterations=-1", "test_eval.json", NULL, NULL), 1);
    assert_int_equal(evaluate("sph:cs=20,none=1", "test_eval.json", NULL, NULL), 1);
    assert_int_equal(evaluate("sph:cs=fast", "test_eval.json", NULL, NULL), 1);
    assert_int_equal(evaluate("pbf:iterations=0", "test_eval.json", NULL, NULL), 1);
}

/* A box of 4 x 3 x 2 spacings: cells around it, layer by layer, and none inside. */
static void walls_become_layers(void **state)
{
    enum { STEP = 2 }; /* wall points per spacing */
    static double wall[4096][3], normal[4096][3];
    static const int size[3] = {4, 3, 2};
    size_t walls = 0, count;
    double *layer;
    ascc_method_error error;
    (void)state;
    for (int axis = 0; axis < 3; axis++)
        for (int upper = 0; upper < 2; upper++)
            for (int a = 0; a < size[(axis + 1) % 3] * STEP; a++)
                for (int b = 0; b < size[(axis + 2) % 3] * STEP; b++, walls++) {
                    wall[walls][axis] = upper ? size[axis] : 0.0;
                    wall[walls][(axis + 1) % 3] = (a + 0.5) / STEP;
                    wall[walls][(axis + 2) % 3] = (b + 0.5) / STEP;
                    normal[walls][axis] = upper ? -1.0 : 1.0;
                }
    const ascc_method_scene scene = {.dimension = 3,
                                     .spacing = 1.0,
                                     .wall_count = walls,
                                     .first_layer = walls,
                                     .wall = *wall,
                                     .normal = *normal};
    assert_true(ascc_method_layers(&scene, 1.0, 2, &layer, &count, &error));
    size_t beside = 0; /* particles right behind a face, where no edge bends the normal */
    for (size_t i = 0; i < count; i++) {
        const double *x = layer + 3 * i;
        assert_false(x[0] > 0 && x[0] < 4 && x[1] > 0 && x[1] < 3 && x[2] > 0 && x[2] < 2);
        beside += fabs(x[1] + 0.5) < 1e-9 && x[0] > 0 && x[0] < 4 && x[2] > 0 && x[2] < 2;
    }
    assert_int_equal(beside, 4 * 2);
    assert_int_equal(count, 8 * 7 * 6 - 4 * 3 * 2);
    free(layer);
}

static void the_same_input_gives_the_same_bytes(void **state)
{
    (void)state;
    assert_int_equal(evaluate("frozen", "test_eval.json", "--threads", "1"), 0);
    assert_int_equal(evaluate("frozen", "test_eval_2.json", "--threads", "3"), 0);
    assert_string_equal(read_text("test_eval.json"), read_text("test_eval_2.json"));
}

static void a_method_that_stops_says_why(void **state)
{
    (void)state;
    assert_int_equal(evaluate("broken", "test_eval.json", NULL, NULL), 0);
    const char *text = read_text("test_eval.json");
    assert_true(has(text, "note", "\"stopped after frame 0: it \\\"broke\\\"\""));
    assert_true(has(text, "err_n1_stored", "null"));
    assert_true(has(text, "chamfer_final_gt2pred", "null"));
    assert_true(has(text, "last_frame", "0"));
}

static void a_lost_particle_is_counted_and_hides_nothing(void **state)
{
    (void)state;
    assert_int_equal(evaluate("lost", "test_eval.json", NULL, NULL), 0);
    const char *text = read_text("test_eval.json");
    assert_true(has(text, "non_finite_max", "1"));
    assert_true(has(text, "err_n1_stored", "null"));
    assert_true(has(text, "gt2pred_mean", "null"));
    assert_true(has(text, "density_max_error", "null"));
    assert_true(has(text, "published_density_error", "null"));
    assert_true(has(text, "min_pair_distance", "null"));
    assert_true(has(text, "max_speed", "null"));
    assert_true(has(text, "momentum_error", "null"));
    assert_true(has(text, "kinetic_50", "null"));
}

static void figures_are_lines_of_csv(void **state)
{
    (void)state;
    assert_int_equal(evaluate("frozen", "test_eval.json", "--csv", "test_eval.csv"), 0);
    const char *text = read_text("test_eval.csv");
    assert_memory_equal(text, "method,sequence,figure,value\n", 29);
    assert_non_null(strstr(text, "\n\"frozen\",\"test_eval\",frames,61\n"));
    assert_non_null(strstr(text, "\n\"frozen\",\"test_eval\",momentum_drift_max,\n"));
}

static void what_is_not_understood_is_refused(void **state)
{
    (void)state;
    assert_int_equal(evaluate("frozen", "test_eval.json", "--threads", "0"), 2);
    assert_int_equal(evaluate("frozen", "test_eval.json", "--frames", "1:2"), 2);
    assert_int_equal(evaluate("frozen", "test_eval.json", "--velocity", "any"), 2);
    assert_int_equal(evaluate("frozen", "test_eval.json", "--none", "1"), 2);
    assert_int_equal(evaluate("nobody", "test_eval.json", NULL, NULL), 2);
    assert_int_equal(evaluate("frozen", "no/such/folder.json", NULL, NULL), 1);
    assert_int_equal(evaluate("frozen", "test_eval.json", "absent.safetensors", NULL), 1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(free_flight_has_no_error),
        cmocka_unit_test(a_method_of_ones_own_is_measured),
        cmocka_unit_test(reference_solvers_fly_freely),
        cmocka_unit_test(walls_become_layers),
        cmocka_unit_test(the_same_input_gives_the_same_bytes),
        cmocka_unit_test(a_method_that_stops_says_why),
        cmocka_unit_test(a_lost_particle_is_counted_and_hides_nothing),
        cmocka_unit_test(figures_are_lines_of_csv),
        cmocka_unit_test(what_is_not_understood_is_refused),
    };
    return cmocka_run_group_tests(tests, write_sequence, remove_files);
}
