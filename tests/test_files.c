/* Files that the libraries write and read: whole or not at all, whatever the disk does; and states of a
 * trainer that nobody saved. SPDX-License-Identifier: MIT */
#include <ascc/train.h>
#include <dirent.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "support/failing_files.h"
#include "support/model_builder.h"
#include "support/test.h"

static char folder[64], path[128];
static ascc_context *context;
static ascc_model *model;
static ascc_train_context *train;
static ascc_trainer *trainer;
static char message[256];

/* ---- A folder, a model and a trainer ---- */

static int open_all(void **state)
{
    (void)state;
    strcpy(folder, "/tmp/ascc-files-XXXXXX");
    if (!mkdtemp(folder))
        return -1;
    (void)snprintf(path, sizeof path, "%s/file", folder);
    size_t size;
    const model_random random = {.channels = 4, .trunk_layers = 1, .cells = 3, .output_cells = 4};
    unsigned char *bytes = model_builder_random(&random, &size);
    const ascc_training_stage stage = {.end = 10, .unroll = 1, .learning_rate = 0.001};
    const ascc_trainer_options options = {.size = sizeof options,
                                          .stage = &stage,
                                          .stage_size = sizeof stage,
                                          .stage_count = 1,
                                          .batch = 1,
                                          .whiten = -1};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    if (ascc_train_context_create(NULL, &train) != ASCC_OK ||
        ascc_trainer_create(train, &options, bytes, size, &trainer) != ASCC_OK)
        fail_msg("no trainer");
    free(bytes);
    return 0;
}

static int close_all(void **state)
{
    (void)state;
    ascc_trainer_destroy(&trainer);
    ascc_train_context_destroy(&train);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    (void)remove(path);
    return rmdir(folder); /* fails where something was left behind */
}

/* ---- The two that write ---- */

static ascc_status save_model(void)
{
    const ascc_status status = ascc_model_save(model, path);
    (void)ascc_context_message(context, message, sizeof message);
    return status;
}

static ascc_status save_trainer(void)
{
    const ascc_status status = ascc_trainer_save(trainer, path);
    (void)snprintf(message, sizeof message, "%s", ascc_trainer_message(trainer));
    return status;
}

static ascc_status (*const savers[])(void) = {save_model, save_trainer};

typedef struct content {
    unsigned char *bytes;
    size_t size;
} content;

static content content_of(const char *name)
{
    content c = {NULL, 0};
    FILE *file = fopen(name, "rb");
    assert_non_null(file);
    assert_int_equal(fseek(file, 0, SEEK_END), 0);
    c.size = (size_t)ftell(file);
    rewind(file);
    c.bytes = malloc(c.size + 1);
    assert_non_null(c.bytes);
    assert_int_equal(fread(c.bytes, 1, c.size, file), c.size);
    (void)fclose(file);
    return c;
}

static bool holds(const char *name, content wanted)
{
    content c = content_of(name);
    const bool same = c.size == wanted.size && memcmp(c.bytes, wanted.bytes, c.size) == 0;
    free(c.bytes);
    return same;
}

static void put(const char *name, content c)
{
    FILE *file = fopen(name, "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(c.bytes, 1, c.size, file), c.size);
    assert_int_equal(fclose(file), 0);
}

static int entries(void)
{
    int count = 0;
    DIR *open = opendir(folder);
    assert_non_null(open);
    while (readdir(open))
        count++;
    (void)closedir(open);
    return count - 2;
}

/* What the saver writes when all is well. */
static content whole(ascc_status (*save)(void))
{
    test_files = (failing_files){0};
    assert_int_equal(save(), ASCC_OK);
    return content_of(path);
}

/* ---- Disks that fail ---- */

static const content old = {(unsigned char *)(uintptr_t) "what was there", 14};

/* Fails every call in turn; there: a file is to be replaced. */
static void fail_every_call(ascc_status (*save)(void), int reason, bool there)
{
    content new = whole(save);
    int failed = 0;
    for (int n = 1;; n++) {
        assert_int_equal(remove(path), 0);
        if (there)
            put(path, old);
        test_files = (failing_files){.fail_at = n, .reason = reason};
        const ascc_status status = save();
        const bool reached = test_files.calls >= n;
        test_files = (failing_files){0};
        const bool is_new = access(path, F_OK) == 0 && holds(path, new);
        if (!is_new && (there ? !holds(path, old) : access(path, F_OK) == 0))
            fail_msg("call %d: neither the old file nor the new one", n);
        assert_int_equal(entries(), there || is_new ? 1 : 0);
        if (!is_new)
            put(path, old); /* for remove */
        if (!reached) {
            assert_int_equal(status, ASCC_OK);
            assert_true(is_new);
            break;
        }
        failed++;
        if (status != ASCC_OK) {
            assert_int_equal(status, ASCC_ERROR_FILE);
            assert_non_null(strstr(message, strerror(reason)));
            assert_non_null(strstr(message, path));
        } else {
            assert_true(is_new);
        }
    }
    assert_true(failed >= 7); /* open, write, sync, close, open, rename, sync */
    free(new.bytes);
}

static void a_disk_that_fails_anywhere_leaves_the_old_file_or_the_new_one(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT_OF(savers); i++)
        for (int there = 0; there < 2; there++) {
            fail_every_call(savers[i], ENOSPC, there == 1);
            fail_every_call(savers[i], EIO, there == 1);
        }
}

static void short_writes_and_interruptions_are_gone_on_from(void **state)
{
    (void)state;
    for (size_t i = 0; i < COUNT_OF(savers); i++) {
        content new = whole(savers[i]);
        assert_int_equal(remove(path), 0);
        test_files = (failing_files){.most = 7};
        assert_int_equal(savers[i](), ASCC_OK);
        assert_true(test_files.calls > (int)(new.size / 7));
        assert_true(holds(path, new));
        for (int every = 2; every < 6; every++) {
            put(path, old);
            test_files = (failing_files){.most = 1000, .interrupted = every};
            assert_int_equal(savers[i](), ASCC_OK);
            assert_true(holds(path, new));
        }
        assert_int_equal(entries(), 1);
        free(new.bytes);
    }
}

/* ---- What a path may be ---- */

static void links_are_followed(void **state)
{
    (void)state;
    char keep[160];
    (void)snprintf(keep, sizeof keep, "%s/kept", folder);
    for (size_t i = 0; i < COUNT_OF(savers); i++) {
        content new = whole(savers[i]);
        assert_int_equal(remove(path), 0);
        assert_int_equal(symlink("kept", path), 0);
        struct stat about;
        for (int there = 0; there < 2; there++) {
            if (there)
                put(keep, old);
            assert_int_equal(savers[i](), ASCC_OK);
            assert_int_equal(lstat(path, &about), 0);
            assert_true(S_ISLNK(about.st_mode));
            assert_true(holds(keep, new));
            assert_int_equal(entries(), 2);
        }
        assert_int_equal(remove(keep), 0);
        assert_int_equal(remove(path), 0);
        assert_int_equal(symlink("file", path), 0); /* to itself */
        assert_int_equal(savers[i](), ASCC_ERROR_FILE);
        assert_int_equal(remove(path), 0);
        free(new.bytes);
    }
}

static void a_replaced_file_keeps_its_mode(void **state)
{
    (void)state;
    const mode_t before = umask(027);
    for (size_t i = 0; i < COUNT_OF(savers); i++) {
        struct stat about;
        assert_int_equal(savers[i](), ASCC_OK);
        assert_int_equal(stat(path, &about), 0);
        assert_int_equal(about.st_mode & 07777, 0640);
        assert_int_equal(chmod(path, 0606), 0);
        assert_int_equal(savers[i](), ASCC_OK);
        assert_int_equal(stat(path, &about), 0);
        assert_int_equal(about.st_mode & 07777, 0606);
        assert_int_equal(remove(path), 0);
    }
    (void)umask(before);
}

static void what_is_no_regular_file_is_refused(void **state)
{
    (void)state;
    char keep[160];
    (void)snprintf(keep, sizeof keep, "%s/kept", folder);
    for (size_t i = 0; i < COUNT_OF(savers); i++) {
        struct stat about;
        assert_int_equal(mkdir(path, 0700), 0);
        assert_int_equal(savers[i](), ASCC_ERROR_FILE);
        assert_non_null(strstr(message, strerror(EISDIR)));
        assert_int_equal(rmdir(path), 0);
        assert_int_equal(mkfifo(path, 0600), 0);
        assert_int_equal(savers[i](), ASCC_ERROR_FILE);
        assert_non_null(strstr(message, "it is no regular file"));
        assert_int_equal(stat(path, &about), 0);
        assert_true(S_ISFIFO(about.st_mode));
        assert_int_equal(rename(path, keep), 0);
        assert_int_equal(symlink("kept", path), 0);
        assert_int_equal(savers[i](), ASCC_ERROR_FILE);
        assert_int_equal(stat(keep, &about), 0);
        assert_true(S_ISFIFO(about.st_mode));
        assert_int_equal(remove(path), 0);
        assert_int_equal(remove(keep), 0);
        assert_int_equal(entries(), 0);
    }
}

static void a_file_that_may_not_be_written_is_not_replaced(void **state)
{
    (void)state;
    if (geteuid() == 0)
        skip(); /* root may write everything */
    for (size_t i = 0; i < COUNT_OF(savers); i++) {
        put(path, old);
        assert_int_equal(chmod(path, 0400), 0);
        assert_int_equal(savers[i](), ASCC_ERROR_FILE);
        assert_true(holds(path, old));
        assert_int_equal(remove(path), 0);
    }
}

static void names_may_be_as_long_as_the_system_allows(void **state)
{
    (void)state;
    char name[400];
    (void)snprintf(name, sizeof name, "%s/%0255d", folder, 1);
    assert_int_equal(ascc_model_save(model, name), ASCC_OK);
    assert_int_equal(ascc_trainer_save(trainer, name), ASCC_OK);
    assert_int_equal(remove(name), 0);
    (void)snprintf(name, sizeof name, "%s/%0256d", folder, 1);
    assert_int_equal(ascc_model_save(model, name), ASCC_ERROR_FILE);
    (void)ascc_context_message(context, message, sizeof message);
    assert_non_null(strstr(message, strerror(ENAMETOOLONG)));
}

/* ---- States that nobody saved ---- */

/* The saved state with one float changed. */
static void save_changed(size_t array, size_t number, float value)
{
    content c = whole(save_trainer);
    const size_t count = ascc_trainer_parameter_count(trainer);
    memcpy(c.bytes + c.size - (4 * count - array * count - number) * sizeof value, &value,
           sizeof value);
    put(path, c);
    free(c.bytes);
}

/* Is refused by name, and the trainer saves what it saved before. */
static void refuses(const char *text)
{
    content before, after;
    char kept[160];
    (void)snprintf(kept, sizeof kept, "%s/kept", folder);
    assert_int_equal(rename(path, kept), 0);
    before = whole(save_trainer);
    const ascc_status status = ascc_trainer_load(trainer, kept);
    if (status != ASCC_ERROR_FORMAT || !strstr(ascc_trainer_message(trainer), text))
        fail_msg("status %d, '%s': not '%s'", status, ascc_trainer_message(trainer), text);
    after = whole(save_trainer);
    assert_int_equal(before.size, after.size);
    assert_memory_equal(before.bytes, after.bytes, after.size);
    free(before.bytes);
    free(after.bytes);
    assert_int_equal(remove(kept), 0);
}

static void a_state_with_numbers_that_nobody_trained_is_refused_by_name(void **state)
{
    (void)state;
    static const char *const names[] = {"'weights'", "'average'", "'moment1'", "'moment2'"};
    const float nan = strtof("nan", NULL), inf = strtof("inf", NULL);
    for (size_t array = 0; array < 4; array++) {
        save_changed(array, 3, nan);
        refuses(names[array]);
        save_changed(array, 0, -inf);
        refuses(names[array]);
    }
    save_changed(3, 5, -1.0f);
    refuses("'moment2'");
    save_changed(2, 5, -1.0f);
    assert_int_equal(ascc_trainer_load(trainer, path), ASCC_OK);
}

static void a_state_with_weights_that_no_model_has_is_refused(void **state)
{
    (void)state;
    /* The last kernel is stored whole: a weight alone makes it unlike its mirror image. */
    const size_t count = ascc_trainer_parameter_count(trainer);
    save_changed(0, count - 1, 7.0f);
    refuses("'weights'");
    save_changed(1, count - 1, 7.0f);
    refuses("'average'");
}

/* The saved state with another text for the iteration, 0. */
static void save_iteration(const char *text)
{
    content c = whole(save_trainer);
    const char *const key = "\"iteration\":\"";
    size_t at = 8;
    while (memcmp(c.bytes + at, key, strlen(key)) != 0)
        at++;
    at += strlen(key);
    const size_t more = strlen(text) - 1;
    content changed = {malloc(c.size + more), c.size + more};
    assert_non_null(changed.bytes);
    memcpy(changed.bytes, c.bytes, at);
    memcpy(changed.bytes + at, text, more + 1);
    memcpy(changed.bytes + at + more + 1, c.bytes + at + 1, c.size - at - 1);
    const size_t length = changed.bytes[0] + 256u * changed.bytes[1] + more;
    changed.bytes[0] = (unsigned char)length;
    changed.bytes[1] = (unsigned char)(length >> 8);
    put(path, changed);
    free(changed.bytes);
    free(c.bytes);
}

static void a_state_with_an_absurd_iteration_is_refused(void **state)
{
    (void)state;
    static const char *const wrong[] = {"-1",
                                        "x",
                                        " 1",
                                        "+1",
                                        "1 ",
                                        "1e3",
                                        "9007199254740993",
                                        "18446744073709551616",
                                        "99999999999999999999999999999999"};
    for (size_t i = 0; i < COUNT_OF(wrong); i++) {
        save_iteration(wrong[i]);
        refuses("iteration");
    }
    save_iteration("1000000");
    assert_int_equal(ascc_trainer_load(trainer, path), ASCC_OK);
    assert_int_equal(ascc_trainer_iteration(trainer), 1000000);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_all, close_all)
    const struct CMUnitTest tests[] = {
        TEST(a_disk_that_fails_anywhere_leaves_the_old_file_or_the_new_one),
        TEST(short_writes_and_interruptions_are_gone_on_from),
        TEST(links_are_followed),
        TEST(a_replaced_file_keeps_its_mode),
        TEST(what_is_no_regular_file_is_refused),
        TEST(a_file_that_may_not_be_written_is_not_replaced),
        TEST(names_may_be_as_long_as_the_system_allows),
        TEST(a_state_with_numbers_that_nobody_trained_is_refused_by_name),
        TEST(a_state_with_weights_that_no_model_has_is_refused),
        TEST(a_state_with_an_absurd_iteration_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
