/* Sequence files: what is written is read again, and every malformed file is refused by name.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <signal.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cmocka.h>

#include "../examples/ascc/sequence.h"

static char folder[64];
static char path[128];

static int open_folder(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/ascc-sequence-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    (void)snprintf(path, sizeof path, "%s/s.safetensors", folder);
    return 0;
}

static int close_folder(void **state)
{
    (void)state;
    (void)remove(path);
    return rmdir(folder); /* fails when a temporary file was left behind */
}

static const float wall[] = {0.0f, 0.5f, 1.0f, 0.5f}, normal[] = {1.0f, 0.0f, -1.0f, 0.0f};

static ascc_sequence header_2d(size_t count)
{
    return (ascc_sequence){.dimension = 2,
                           .time_step = 0.1,
                           .gravity = {0.25, -9.81, 0.0},
                           .radius = 0.0125,
                           .mass = 0.625,
                           .rest_density = 1000.0,
                           .count = count,
                           .walls = 2,
                           .first_layer = 1,
                           .wall = (float *)(uintptr_t)wall,
                           .normal = (float *)(uintptr_t)normal,
                           .source = "a \"test\"\n"};
}

static void write_two_frames(bool all_velocities)
{
    char error[256] = "";
    (void)remove(path);
    const ascc_sequence header = header_2d(3);
    ascc_sequence_writer *writer =
        ascc_sequence_create(path, &header, all_velocities, error, sizeof error);
    assert_non_null(writer);
    for (int t = 0; t < 2; t++) {
        float x[6], v[6];
        for (int k = 0; k < 6; k++) {
            x[k] = (float)(10 * t + k) + 0.1f;
            v[k] = -x[k];
        }
        assert_true(ascc_sequence_append(writer, x, v, error, sizeof error));
    }
    assert_int_not_equal(access(path, F_OK), 0);
    assert_true(ascc_sequence_finish(writer, true, error, sizeof error));
}

static void test_what_is_written_is_read_again(void **state)
{
    (void)state;
    for (int all = 0; all < 2; all++) {
        write_two_frames(all == 1);
        char error[256] = "";
        ascc_sequence s;
        assert_true(ascc_sequence_read(path, &s, error, sizeof error));
        assert_int_equal(s.dimension, 2);
        assert_true(s.time_step == 0.1 && s.radius == 0.0125 && s.mass == 0.625);
        assert_true(s.rest_density == 1000.0 && s.gravity[0] == 0.25 && s.gravity[1] == -9.81);
        assert_int_equal(s.frames, 2);
        assert_int_equal(s.count, 3);
        assert_int_equal(s.walls, 2);
        assert_int_equal(s.first_layer, 1);
        assert_int_equal(s.velocity_frames, all ? 2 : 1);
        assert_string_equal(s.source, "a \"test\"\n");
        for (int k = 0; k < 12; k++) {
            const float x = (float)(k < 6 ? k : k + 4) + 0.1f;
            assert_memory_equal(&s.position[k], &x, sizeof x);
            if (k < 6 || all)
                assert_true(s.velocity[k] == -x);
        }
        assert_memory_equal(s.wall, wall, sizeof wall);
        assert_memory_equal(s.normal, normal, sizeof normal);
        ascc_sequence_free(&s);
    }
}

static void test_walls_that_move_are_read_again(void **state)
{
    (void)state;
    char error[256] = "";
    ascc_sequence header = header_2d(1), s;
    header.walls_move = true;
    header.wall = header.normal = NULL;
    for (int missing = 0; missing < 2; missing++) {
        ascc_sequence_writer *w = ascc_sequence_create(path, &header, false, error, sizeof error);
        assert_non_null(w);
        for (int t = 0; t < 3; t++) {
            const float x[2] = {(float)t, 0.0f};
            const float moved[4] = {(float)t, 0.5f, 1.0f, 0.5f + (float)t};
            assert_true(ascc_sequence_append(w, x, x, error, sizeof error));
            assert_true((missing && t == 2) ||
                        ascc_sequence_append_walls(w, moved, normal, error, sizeof error));
        }
        assert_true(ascc_sequence_finish(w, true, error, sizeof error) == !missing);
    }
    assert_true(ascc_sequence_read(path, &s, error, sizeof error));
    assert_true(s.frames == 3 && s.walls == 2 && s.walls_move);
    for (int t = 0; t < 3; t++) {
        assert_true(s.wall[4 * t] == (float)t && s.wall[4 * t + 3] == 0.5f + (float)t);
        assert_memory_equal(s.normal + 4 * t, normal, sizeof normal);
    }
    ascc_sequence_free(&s);
}

static void test_an_empty_scene_is_read_again(void **state)
{
    (void)state;
    char error[256] = "";
    ascc_sequence header = header_2d(0), s;
    header.walls = 0;
    ascc_sequence_writer *writer = ascc_sequence_create(path, &header, true, error, sizeof error);
    assert_non_null(writer);
    const float nothing[1] = {0.0f};
    assert_true(ascc_sequence_append(writer, nothing, nothing, error, sizeof error));
    assert_true(ascc_sequence_finish(writer, true, error, sizeof error));
    assert_true(ascc_sequence_read(path, &s, error, sizeof error));
    assert_true(s.frames == 1 && s.count == 0 && s.walls == 0);
    ascc_sequence_free(&s);
}

static void test_a_dropped_file_leaves_the_old_one(void **state)
{
    (void)state;
    char error[256] = "";
    write_two_frames(true);
    const ascc_sequence header = header_2d(3);
    const float x[6] = {0};
    ascc_sequence_writer *writer = ascc_sequence_create(path, &header, true, error, sizeof error);
    assert_non_null(writer);
    assert_true(ascc_sequence_append(writer, x, x, error, sizeof error));
    assert_true(ascc_sequence_finish(writer, false, error, sizeof error));
    ascc_sequence s;
    assert_true(ascc_sequence_read(path, &s, error, sizeof error));
    assert_int_equal(s.frames, 2);
    ascc_sequence_free(&s);
}

/* Files of a few blocks at most: what did not reach the disk is never given the file's name. */
static void test_a_full_disk_is_reported(void **state)
{
    (void)state;
    char error[256] = "";
    write_two_frames(true);
    struct rlimit before, little;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    little = before;
    little.rlim_cur = 20000;
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &little), 0);
    (void)signal(SIGXFSZ, SIG_IGN);
    const ascc_sequence header = header_2d(3);
    const float x[6] = {0};
    ascc_sequence_writer *writer = ascc_sequence_create(path, &header, true, error, sizeof error);
    assert_non_null(writer);
    bool good = true;
    for (int t = 0; good && t < 100000; t++)
        good = ascc_sequence_append(writer, x, x, error, sizeof error);
    assert_false(good);
    assert_false(ascc_sequence_finish(writer, true, error, sizeof error));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    assert_non_null(strstr(error, "cannot be written"));
    ascc_sequence s;
    assert_true(ascc_sequence_read(path, &s, error, sizeof error));
    assert_int_equal(s.frames, 2);
    ascc_sequence_free(&s);
}

static void test_what_a_killed_program_left_is_no_hindrance(void **state)
{
    (void)state;
    char part[160];
    struct stat about;
    (void)snprintf(part, sizeof part, "%s.part", path);
    assert_int_equal(symlink("/dev/full", part), 0);
    write_two_frames(true);
    FILE *left = fopen(part, "wb");
    assert_non_null(left);
    assert_true(fputs("left behind", left) >= 0);
    assert_int_equal(fclose(left), 0);
    write_two_frames(true);
    assert_int_not_equal(lstat(part, &about), 0);
}

static void test_two_programs_do_not_write_one_file(void **state)
{
    (void)state;
    char error[256] = "";
    const ascc_sequence header = header_2d(3);
    ascc_sequence_writer *writer = ascc_sequence_create(path, &header, true, error, sizeof error);
    assert_non_null(writer);
    const pid_t other = fork();
    if (other == 0) {
        const bool refused = !ascc_sequence_create(path, &header, true, error, sizeof error) &&
                             strstr(error, "another program is writing it");
        _exit(refused ? 0 : 1);
    }
    int status = -1;
    assert_int_equal(waitpid(other, &status, 0), other);
    assert_int_equal(status, 0);
    const float x[6] = {0};
    assert_true(ascc_sequence_append(writer, x, x, error, sizeof error));
    assert_true(ascc_sequence_finish(writer, true, error, sizeof error));
}

static void test_a_folder_that_is_not_there_is_reported(void **state)
{
    (void)state;
    char error[256] = "";
    const ascc_sequence header = header_2d(3);
    assert_null(ascc_sequence_create("/nonexistent/s", &header, true, error, sizeof error));
    assert_non_null(strstr(error, "/nonexistent/s: cannot be written: No such file"));
}

/* ---- Files that are refused ---- */

#define META                                                                                       \
    "\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"2\",\"dt\":\"0.1\","                 \
    "\"gravity\":\"0 -9.81\",\"particle_radius\":\"0.01\",\"particle_mass\":\"1\","                \
    "\"rest_density\":\"1000\""
#define META_WITHOUT_GRAVITY                                                                       \
    "\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"2\",\"dt\":\"0.1\","                 \
    "\"particle_radius\":\"0.01\",\"particle_mass\":\"1\",\"rest_density\":\"1000\""
#define F32 "\"dtype\":\"F32\",\"shape\":"
#define POSITION "\"fluid.position\":{" F32 "[1,2,2],\"data_offsets\":[0,16]}"
#define VELOCITY "\"fluid.velocity\":{" F32 "[1,2,2],\"data_offsets\":[16,32]}"
#define WALL "\"boundary.position\":{" F32 "[1,2],\"data_offsets\":[32,40]}"
#define NORMAL "\"boundary.normal\":{" F32 "[1,2],\"data_offsets\":[40,48]}"
#define FILE_OF(meta, position, velocity, wall_, normal_)                                          \
    "{\"__metadata__\":{" meta "}," position "," velocity "," wall_ "," normal_ "}"

static void write_raw(const char *header, uint64_t length, size_t data)
{
    FILE *out = fopen(path, "wb");
    assert_non_null(out);
    for (int i = 0; i < 8; i++)
        (void)fputc((int)(length >> 8 * i & 255), out);
    (void)fputs(header, out);
    for (size_t i = 0; i < data; i++)
        (void)fputc(0, out);
    assert_int_equal(fclose(out), 0);
}

static void expect_refusal(const char *expected)
{
    char error[512] = "";
    ascc_sequence s;
    const bool read = ascc_sequence_read(path, &s, error, sizeof error);
    if (read || !strstr(error, expected) || strncmp(error, path, strlen(path)) != 0)
        fail_msg("expected '%s', got '%s'", expected, read ? "success" : error);
    assert_null(s.position);
}

static void test_a_well_formed_header_is_accepted(void **state)
{
    (void)state;
    const char *text = FILE_OF(META, POSITION, VELOCITY, WALL, NORMAL);
    char error[256] = "";
    ascc_sequence s;
    write_raw(text, strlen(text), 48);
    assert_true(ascc_sequence_read(path, &s, error, sizeof error));
    ascc_sequence_free(&s);
}

static void test_a_malformed_header_is_refused_by_name(void **state)
{
    (void)state;
    static const struct {
        const char *header, *expected;
    } cases[] = {
        {"[]", "not JSON"},
        {"{\"a\":1,\"a\":2}", "not JSON: duplicate"},
        {"{", "not JSON"},
        {"{}", "metadata format"},
        {"{\"__metadata__\":3}", "metadata format"},
        {"{\"__metadata__\":{\"format\":\"other\"}}", "'other', not 'ascc.sequence'"},
        {"{\"__metadata__\":{\"format\":\"\\u001b[31m\\n\\u009b\"}}", "is '?[31m?"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\"}}", "no version"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"2\"}}", "no dim"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"2\",\"dim\":\"2\"}}",
         "version 2"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"4\"}}",
         "dim = 4"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"2\","
         "\"dt\":\"nan\"}}",
         "dt = 'nan'"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"2\","
         "\"dt\":\"-1\"}}",
         "dt = -1 is not within"},
        {"{\"__metadata__\":{\"format\":\"ascc.sequence\",\"version\":\"1\",\"dim\":\"2\","
         "\"dt\":\"1 2\"}}",
         "dt = '1 2'"},
        {"{\"__metadata__\":{" META_WITHOUT_GRAVITY "}}", "no gravity"},
        {"{\"__metadata__\":{" META_WITHOUT_GRAVITY ",\"gravity\":\"1\"}}", "gravity = '1'"},
        {"{\"__metadata__\":{" META_WITHOUT_GRAVITY ",\"gravity\":7}}", "no gravity"},
        {"{\"__metadata__\":{" META "}}", "fluid.position is missing"},
        {"{\"__metadata__\":{" META "}," POSITION "}", "fluid.velocity is missing"},
        {"{\"__metadata__\":{" META "}," POSITION "," VELOCITY "}", "boundary.position is missing"},
        {"{\"__metadata__\":{" META "}," POSITION "," VELOCITY "," WALL "}",
         "boundary.normal is missing"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_raw(cases[i].header, strlen(cases[i].header), 48);
        expect_refusal(cases[i].expected);
    }
}

/* Each number of the metadata out of its range, in a file that is right in all else. */
static void test_absurd_numbers_are_refused_by_name(void **state)
{
    (void)state;
    static const char *const keys[] = {"dt", "particle_radius", "particle_mass", "rest_density",
                                       "gravity"};
    static const char *const wrong[][4] = {{"0", "-0.1", "1e308", "1e-308"},
                                           {"0", "-0.1", "1e308", "1e-308"},
                                           {"0", "-1", "1e308", "1e-308"},
                                           {"0", "-1", "1e308", "1e-308"},
                                           {"0 1e308", "-1e7 0", "0 inf", "nan 0"}};
    for (size_t k = 0; k < 5; k++)
        for (size_t i = 0; i < 4; i++) {
            char header[1024], expected[64];
            int length = snprintf(header, sizeof header,
                                  "{\"__metadata__\":{\"format\":\"ascc.sequence\","
                                  "\"version\":\"1\",\"dim\":\"2\"");
            for (size_t j = 0; j < 5; j++)
                length += snprintf(header + length, sizeof header - (size_t)length,
                                   ",\"%s\":\"%s\"", keys[j],
                                   j == k   ? wrong[k][i]
                                   : j == 4 ? "0 -9.81"
                                            : "1");
            (void)snprintf(header + length, sizeof header - (size_t)length,
                           "}," POSITION "," VELOCITY "," WALL "," NORMAL "}");
            write_raw(header, strlen(header), 48);
            (void)snprintf(expected, sizeof expected, "metadata %s = ", keys[k]);
            expect_refusal(expected);
        }
}

static void test_a_malformed_tensor_is_refused_by_name(void **state)
{
    (void)state;
#define WITH_POSITION(body) FILE_OF(META, "\"fluid.position\":" body, VELOCITY, WALL, NORMAL)
    static const struct {
        const char *header, *expected;
    } cases[] = {
        {WITH_POSITION("3"), "fluid.position has type ?"},
        {WITH_POSITION("{\"dtype\":\"F64\",\"shape\":[1,1,2],\"data_offsets\":[0,16]}"),
         "type F64, not F32"},
        {WITH_POSITION("{" F32 "[2,2],\"data_offsets\":[0,16]}"), "a shape of 3 numbers"},
        {WITH_POSITION("{" F32 "[1,2,2]}"), "two offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[0]}"), "two offsets"},
        {WITH_POSITION("{" F32 "[1,-2,2],\"data_offsets\":[0,16]}"), "does not fit"},
        {WITH_POSITION("{" F32 "[1,2.5,2],\"data_offsets\":[0,16]}"), "does not fit"},
        {WITH_POSITION("{" F32 "[1,\"2\",2],\"data_offsets\":[0,16]}"), "does not fit"},
        {WITH_POSITION("{" F32 "[4611686018427387904,4,2],\"data_offsets\":[0,16]}"),
         "does not fit"},
        {WITH_POSITION("{" F32 "[1,2,3],\"data_offsets\":[0,24]}"), "last extent is 3"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[0,15]}"), "offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[-16,0]}"), "offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[16,0]}"), "offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[40,56]}"), "offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[9223372036854775792,"
                       "9223372036854775807]}"),
         "offsets"},
        {WITH_POSITION("{" F32 "[1,2,2],\"data_offsets\":[\"0\",16.0]}"), "offsets"},
        {WITH_POSITION("{" F32 "[0,2,2],\"data_offsets\":[0,0]}"), "has no frames"},
        {WITH_POSITION("{" F32 "[1,1,2],\"data_offsets\":[0,8]}"), "fluid.velocity is [1, 2]"},
        {WITH_POSITION("{" F32 "[1,9223372036854775807,2],\"data_offsets\":[0,16]}"),
         "does not fit"},
        {FILE_OF(META, POSITION, "\"fluid.velocity\":{" F32 "[2,2,2],\"data_offsets\":[0,32]}",
                 WALL, NORMAL),
         "fluid.velocity is [2, 2]"},
        {FILE_OF(META, POSITION, VELOCITY, WALL,
                 "\"boundary.normal\":{" F32 "[0,2],\"data_offsets\":[40,40]}"),
         "boundary.normal has 0 rows"},
        {FILE_OF(META, POSITION, VELOCITY,
                 "\"boundary.position\":{" F32 "[2,1,2],\"data_offsets\":[32,48]}",
                 "\"boundary.normal\":{" F32 "[2,1,2],\"data_offsets\":[32,48]}"),
         "boundary.position has 2 frames, fluid.position 1"},
        {FILE_OF(META, POSITION, VELOCITY,
                 "\"boundary.position\":{" F32 "[1,1,2],\"data_offsets\":[32,40]}", NORMAL),
         "boundary.normal: a shape of 3 numbers"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        write_raw(cases[i].header, strlen(cases[i].header), 48);
        expect_refusal(cases[i].expected);
    }
}

static void test_a_header_longer_than_the_file_is_refused(void **state)
{
    (void)state;
    static const uint64_t lengths[] = {3, 100, (uint64_t)1 << 40, UINT64_MAX, UINT64_MAX - 7};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        write_raw("{}", lengths[i], 0);
        expect_refusal("longer than the file");
    }
}

static void test_every_cut_of_a_file_is_refused(void **state)
{
    (void)state;
    write_two_frames(true);
    FILE *in = fopen(path, "rb");
    assert_non_null(in);
    static char bytes[16384];
    const size_t size = fread(bytes, 1, sizeof bytes, in);
    assert_int_equal(fclose(in), 0);
    assert_true(size > 8192 && size < sizeof bytes);
    for (size_t cut = 0; cut < size; cut += cut < 600 || cut > size - 150 ? 1 : 97) {
        FILE *out = fopen(path, "wb");
        assert_non_null(out);
        assert_int_equal(fwrite(bytes, 1, cut, out), cut);
        assert_int_equal(fclose(out), 0);
        expect_refusal(": ");
    }
}

static void test_values_that_are_not_finite_are_refused(void **state)
{
    (void)state;
    const char *text = FILE_OF(META, POSITION, VELOCITY, WALL, NORMAL);
    static const char *const expected[] = {"fluid.position: value 0", "fluid.position: value 3",
                                           "fluid.velocity: value 0", "boundary.position: value 1",
                                           "boundary.normal: value 1"};
    static const long at[] = {0, 3, 4, 9, 11};
    for (int i = 0; i < 5; i++) {
        write_raw(text, strlen(text), 48);
        FILE *file = fopen(path, "rb+");
        assert_non_null(file);
        const float bad = i % 2 ? INFINITY : NAN;
        assert_int_equal(fseek(file, (long)(8 + strlen(text)) + 4 * at[i], SEEK_SET), 0);
        assert_int_equal(fwrite(&bad, sizeof bad, 1, file), 1);
        assert_int_equal(fclose(file), 0);
        expect_refusal(expected[i]);
    }
}

static void test_what_is_no_file_is_refused(void **state)
{
    (void)state;
    char error[256] = "";
    ascc_sequence s;
    assert_false(ascc_sequence_read("/nonexistent", &s, error, sizeof error));
    assert_string_equal(error, "/nonexistent: No such file or directory");
    assert_false(ascc_sequence_read("/tmp", &s, error, sizeof error));
    assert_string_equal(error, "/tmp: is no regular file");
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_folder, close_folder)
    const struct CMUnitTest tests[] = {
        TEST(test_what_is_written_is_read_again),
        TEST(test_walls_that_move_are_read_again),
        TEST(test_an_empty_scene_is_read_again),
        TEST(test_a_dropped_file_leaves_the_old_one),
        TEST(test_a_full_disk_is_reported),
        TEST(test_what_a_killed_program_left_is_no_hindrance),
        TEST(test_two_programs_do_not_write_one_file),
        TEST(test_a_folder_that_is_not_there_is_reported),
        TEST(test_a_well_formed_header_is_accepted),
        TEST(test_a_malformed_header_is_refused_by_name),
        TEST(test_absurd_numbers_are_refused_by_name),
        TEST(test_a_malformed_tensor_is_refused_by_name),
        TEST(test_a_header_longer_than_the_file_is_refused),
        TEST(test_every_cut_of_a_file_is_refused),
        TEST(test_values_that_are_not_finite_are_refused),
        TEST(test_what_is_no_file_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
