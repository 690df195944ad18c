/* Tests of lib/context.c and lib/status.c: options, messages, lifetimes, structs of other sizes.
 * SPDX-License-Identifier: MIT */
#include "support/test.h"

#include "base/context.h"
#include "support/counting.h"
#include "support/failing_threads.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

/* ---- A log ----------------------------------------------------------------------------------- */

typedef struct log_book {
    test_memory memory; /* first: the user pointer serves both */
    int lines;
    char last[ASCC_MESSAGE_CAPACITY];
} log_book;

static void note_line(void *user, const char *line)
{
    log_book *const book = user;
    book->lines++;
    snprintf(book->last, sizeof book->last, "%s", line);
}

static ascc_context_options logged(log_book *book)
{
    ascc_context_options options = test_memory_options(&book->memory);
    options.user = book;
    options.log = note_line;
    return options;
}

static void *some_enqueue(void *user, ascc_task task, void *work, int32_t count)
{
    (void)user;
    for (int32_t i = 0; i < count; i++)
        task(work, i);
    return NULL;
}

static void some_finish(void *user, void *token)
{
    (void)user;
    (void)token;
}

/* ---- Facts: status --------------------------------------------------------------------------- */

static void every_status_has_a_text_of_its_own(void **state)
{
    (void)state;
    for (int a = ASCC_ERROR_LIMIT; a <= ASCC_OK; a++) {
        assert_true(strlen(ascc_status_text((ascc_status)a)) > 0);
        assert_string_not_equal(ascc_status_text((ascc_status)a), "unknown status");
        for (int b = a + 1; b <= ASCC_OK; b++)
            assert_string_not_equal(ascc_status_text((ascc_status)a),
                                    ascc_status_text((ascc_status)b));
    }
    assert_string_equal(ascc_status_text((ascc_status)-999), "unknown status");
    assert_string_equal(ascc_status_text((ascc_status)7), "unknown status");
}

static void the_library_has_the_version_of_its_header(void **state)
{
    (void)state;
    assert_int_equal(ascc_version(),
                     ASCC_VERSION_MAJOR * 10000 + ASCC_VERSION_MINOR * 100 + ASCC_VERSION_PATCH);
}

static void a_message_is_one_line_that_fits(void **state)
{
    (void)state;
    ascc_message message;
    char longer[2 * ASCC_MESSAGE_CAPACITY];
    memset(longer, 'x', sizeof longer);
    longer[sizeof longer - 1] = '\0';
    assert_int_equal(ascc_fail(&message, ASCC_ERROR_FILE, "%s", longer), ASCC_ERROR_FILE);
    assert_int_equal(strlen(message.text), ASCC_MESSAGE_CAPACITY - 1);
    ascc_fail(&message, ASCC_ERROR_FILE, "path 'a\nb\tc' of %d", 7);
    assert_string_equal(message.text, "path 'a?b?c' of 7");
    ascc_fail(&message, ASCC_ERROR_FILE, "again: %s", message.text);
    assert_string_equal(message.text, "again: path 'a?b?c' of 7");
}

static void a_message_holds_nothing_that_a_terminal_obeys(void **state)
{
    (void)state;
    static const char *const texts[][2] = {
        {"\x1b[31mred\x07", "?[31mred?"},
        {"\xc2\x9b"
         "31m",
         "??31m"}, /* CSI in UTF-8 */
        {"\x9b"
         "31m",
         "?31m"}, /* and as one byte */
        {"a\xe2\x80\xae"
         "b",
         "a???b"}, /* right to left from here */
        {"a\xe2\x80\xa8"
         "b",
         "a???b"},                         /* end of the line */
        {"\xc0\x9b\xe0\x82\x9b", "?????"}, /* too long for what they mean */
        {"\xed\xa0\x80\xf4\x90\x80\x80", "???????"},
        {"cut \xe6\xb0", "cut ??"},
        {"mod\xc3\xa8le \xe6\xb0\xb4 \xf0\x9f\x92\xa7",
         "mod\xc3\xa8le \xe6\xb0\xb4 \xf0\x9f\x92\xa7"},
    };
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        ascc_message message;
        ascc_fail(&message, ASCC_ERROR_FILE, "%s", texts[i][0]);
        assert_string_equal(message.text, texts[i][1]);
    }
}

/* A struct as an older, this, and a newer program know it. */
typedef struct old_thing {
    size_t size;
    int64_t first;
} old_thing;

typedef struct thing {
    size_t size;
    int64_t first, second;
} thing;

typedef struct new_thing {
    size_t size;
    int64_t first, second, third;
} new_thing;

static void structs_of_other_sizes_are_read_as_far_as_known(void **state)
{
    (void)state;
    thing read;
    const old_thing older = {sizeof older, 1};
    assert_true(ascc_read_struct(&read, sizeof read, &older, sizeof older));
    assert_int_equal(read.first, 1);
    assert_int_equal(read.second, 0);

    const thing same = {sizeof same, 1, 2};
    assert_true(ascc_read_struct(&read, sizeof read, &same, sizeof older));
    assert_int_equal(read.second, 2);

    new_thing newer = {sizeof newer, 3, 4, 0};
    assert_true(ascc_read_struct(&read, sizeof read, &newer, sizeof older));
    assert_int_equal(read.first, 3);
    assert_int_equal(read.second, 4);
    newer.third = 1;
    assert_false(ascc_read_struct(&read, sizeof read, &newer, sizeof older));

    const thing small = {sizeof older - 1, 1, 2}, unset = {0, 1, 2}, wild = {SIZE_MAX, 1, 2};
    assert_false(ascc_read_struct(&read, sizeof read, &small, sizeof older));
    assert_false(ascc_read_struct(&read, sizeof read, &unset, sizeof older));
    assert_false(ascc_read_struct(&read, sizeof read, &wild, sizeof older));
}

static void structs_of_other_sizes_are_written_as_far_as_known(void **state)
{
    (void)state;
    const thing result = {sizeof result, 1, 2};
    struct {
        old_thing thing;
        int64_t guard;
    } older = {{sizeof older.thing, 0}, 77};
    assert_true(ascc_write_struct(&older.thing, &result, sizeof result, sizeof older.thing));
    assert_int_equal(older.thing.size, sizeof older.thing);
    assert_int_equal(older.thing.first, 1);
    assert_int_equal(older.guard, 77);

    new_thing newer = {sizeof newer, 0, 0, 5};
    assert_true(ascc_write_struct(&newer, &result, sizeof result, sizeof older.thing));
    assert_int_equal(newer.size, sizeof newer);
    assert_int_equal(newer.second, 2);
    assert_int_equal(newer.third, 5);

    thing unset = {0, 9, 9};
    assert_false(ascc_write_struct(&unset, &result, sizeof result, sizeof older.thing));
    assert_int_equal(unset.first, 9);
}

/* ---- Facts: context -------------------------------------------------------------------------- */

static void a_context_needs_no_options(void **state)
{
    (void)state;
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_workers_count(context->workers), 1);
    assert_int_equal(ascc_context_cpu(context), ascc_kernels_available());
    assert_int_equal(ascc_context_message(context, NULL, 0), 0);
    ascc_context_destroy(&context);
    assert_null(context);
    ascc_context_destroy(&context);
    ascc_context_destroy(NULL);

    const ascc_context_options zero = {.size = sizeof zero};
    assert_int_equal(ascc_context_create(&zero, &context), ASCC_OK);
    assert_int_equal(ascc_workers_count(context->workers), 1);
    ascc_context_destroy(&context);
}

static void bits_of_the_cpu_can_be_disabled(void **state)
{
    (void)state;
    static const uint32_t bits[] = {0,
                                    ASCC_CPU_AVX2,
                                    ASCC_CPU_AVX512,
                                    ASCC_CPU_NEON,
                                    ASCC_CPU_SIMD128,
                                    ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON |
                                        ASCC_CPU_SIMD128};
    for (size_t i = 0; i < COUNT_OF(bits); i++) {
        const ascc_context_options options = {.size = sizeof options, .cpu_disable = bits[i]};
        ascc_context *context;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        assert_int_equal(ascc_context_cpu(context), ascc_kernels_available() & ~bits[i]);
        ascc_context_destroy(&context);
    }
}

/* Creation fails with ARGUMENT and one line that has `part` in it. */
static void refuses(const ascc_context_options *options, log_book *book, const char *part)
{
    ascc_context *context = (ascc_context *)book;
    book->lines = 0;
    assert_int_equal(ascc_context_create(options, &context), ASCC_ERROR_ARGUMENT);
    assert_null(context);
    assert_int_equal(book->lines, 1);
    if (strstr(book->last, part) == NULL)
        fail_msg("'%s' does not name %s", book->last, part);
}

static void options_out_of_range_are_refused_and_named(void **state)
{
    (void)state;
    log_book book = {0};
    ascc_context_options options = logged(&book);
    options.thread_count = -1;
    refuses(&options, &book, "thread_count is -1");
    options.thread_count = 1025;
    refuses(&options, &book, "thread_count is 1025");
    options.thread_count = 2;
    options.cpu_disable = 16;
    refuses(&options, &book, "cpu_disable is 0x10");
    options.cpu_disable = 0;
    options.enqueue = some_enqueue;
    refuses(&options, &book, "enqueue and finish");
    options.enqueue = NULL;
    options.finish = some_finish;
    refuses(&options, &book, "enqueue and finish");
    options.finish = NULL;

    for (int given = 1; given < 7; given++) { /* all but none and all three */
        options.allocate = given & 1 ? test_memory_allocate : NULL;
        options.reallocate = given & 2 ? test_memory_reallocate : NULL;
        options.release = given & 4 ? test_memory_release : NULL;
        refuses(&options, &book, "go together");
    }
    assert_int_equal(book.memory.calls, 0);
}

static void a_thousand_threads_of_a_host_are_accepted(void **state)
{
    (void)state;
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = 1024,
                                          .enqueue = some_enqueue,
                                          .finish = some_finish};
    ascc_context *context;
    assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
    ascc_context_destroy(&context);
}

static void options_of_another_size_are_read_or_refused(void **state)
{
    (void)state;
    struct {
        ascc_context_options options;
        uint64_t unknown;
    } newer = {{.size = sizeof newer}, 0};
    ascc_context *context;
    assert_int_equal(ascc_context_create(&newer.options, &context), ASCC_OK);
    ascc_context_destroy(&context);
    newer.unknown = 1;
    assert_int_equal(ascc_context_create(&newer.options, &context), ASCC_ERROR_ARGUMENT);
    assert_null(context);
    newer.options.size = sizeof newer.options - 1; /* before the first layout */
    assert_int_equal(ascc_context_create(&newer.options, &context), ASCC_ERROR_ARGUMENT);
    newer.options.size = 0;
    assert_int_equal(ascc_context_create(&newer.options, &context), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_context_create(NULL, NULL), ASCC_ERROR_ARGUMENT);
}

static void every_failed_allocation_is_reported_and_leaks_nothing(void **state)
{
    (void)state;
    for (size_t n = 1;; n++) {
        log_book book = {.memory = {.fail_at = n}};
        ascc_context_options options = logged(&book);
        options.thread_count = 3;
        ascc_context *context;
        const ascc_status status = ascc_context_create(&options, &context);
        if (status == ASCC_OK) {
            assert_true(n > 1);
            ascc_context_destroy(&context);
            assert_true(test_memory_is_clean(&book.memory));
            break;
        }
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_null(context);
        assert_int_equal(book.lines, 1);
        assert_true(test_memory_is_clean(&book.memory));
    }
}

static void a_thread_that_does_not_start_is_reported_and_leaks_nothing(void **state)
{
    (void)state;
    for (int started = 0; started < 2; started++) {
        log_book book = {0};
        ascc_context_options options = logged(&book);
        options.thread_count = 3;
        ascc_context *context;
        test_threads_until_failure = started;
        const ascc_status status = ascc_context_create(&options, &context);
        test_threads_until_failure = -1;
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_null(context);
        assert_string_equal(book.last, "context: 3 threads could not be started");
        assert_true(test_memory_is_clean(&book.memory));
    }
}

static void a_context_lives_as_long_as_what_was_made_from_it(void **state)
{
    (void)state;
    test_memory memory = {0};
    const ascc_context_options options = test_memory_options(&memory);
    const ascc_particles_options set = {.size = sizeof set, .dimension = 2, .spacing = 1};
    ascc_context *context;
    ascc_particles *a, *b;
    assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &set, &a), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &set, &b), ASCC_OK);
    ascc_context_destroy(&context);
    assert_null(context);
    ascc_particles_destroy(&a);
    assert_int_equal(ascc_particles_reserve(b, 100, 100), ASCC_OK);
    assert_true(memory.blocks > 0);
    ascc_particles_destroy(&b);
    assert_true(test_memory_is_clean(&memory));
}

static void a_message_is_kept_logged_and_copied_with_its_length(void **state)
{
    (void)state;
    log_book book = {0};
    const ascc_context_options options = logged(&book);
    ascc_context *context;
    assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
    char text[32] = "before";
    assert_int_equal(ascc_context_message(context, text, sizeof text), 0);
    assert_string_equal(text, "");

    ascc_message message;
    ascc_fail(&message, ASCC_ERROR_FORMAT, "tensor 'a' is missing");
    assert_int_equal(ascc_context_fail(context, ASCC_ERROR_FORMAT, &message), ASCC_ERROR_FORMAT);
    assert_string_equal(book.last, "tensor 'a' is missing");
    assert_int_equal(ascc_context_message(context, text, sizeof text), 21);
    assert_string_equal(text, "tensor 'a' is missing");
    assert_int_equal(ascc_context_message(context, text, 7), 21);
    assert_string_equal(text, "tensor");
    text[0] = 'x';
    assert_int_equal(ascc_context_message(context, text, 0), 21);
    assert_int_equal(text[0], 'x');
    assert_int_equal(ascc_context_message(context, NULL, 0), 21);
    ascc_context_destroy(&context);

    assert_int_equal(ascc_context_message(NULL, text, sizeof text), 0);
    assert_string_equal(text, "");
}

static void a_handle_of_another_type_is_refused(void **state)
{
    (void)state;
    ascc_context *context;
    ascc_particles *particles, *more;
    const ascc_particles_options set = {.size = sizeof set, .dimension = 2, .spacing = 1};
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    assert_int_equal(ascc_particles_create(context, &set, &particles), ASCC_OK);
    ascc_context *wrong = (ascc_context *)particles;
    assert_int_equal(ascc_context_cpu(wrong), 0);
    assert_int_equal(ascc_context_message(wrong, NULL, 0), 0);
    assert_int_equal(ascc_particles_create(wrong, &set, &more), ASCC_ERROR_ARGUMENT);
    assert_null(more);
    ascc_context_destroy(&wrong);
    assert_non_null(wrong);
    assert_int_equal(ascc_context_cpu(NULL), 0);
    ascc_particles_destroy(&particles);
    ascc_context_destroy(&context);
}

static void add_up(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    for (size_t i = begin; i < end; i++)
        atomic_fetch_add((atomic_size_t *)data, i);
}

static void *use_a_context(void *failed)
{
    const ascc_context_options options = {.size = sizeof options, .thread_count = 2};
    for (int turn = 0; turn < 20; turn++) {
        ascc_context *context;
        if (ascc_context_create(&options, &context) != ASCC_OK) {
            *(bool *)failed = true;
            return NULL;
        }
        atomic_size_t sum = 0;
        ascc_workers_run(context->workers, 1000, 10, add_up, &sum);
        if (atomic_load(&sum) != 999 * 1000 / 2)
            *(bool *)failed = true;
        ascc_context_destroy(&context);
    }
    return NULL;
}

static void contexts_on_two_threads_know_nothing_of_each_other(void **state)
{
    (void)state;
    pthread_t thread;
    bool failed[2] = {false, false};
    assert_int_equal(pthread_create(&thread, NULL, use_a_context, &failed[0]), 0);
    use_a_context(&failed[1]);
    pthread_join(thread, NULL);
    assert_false(failed[0]);
    assert_false(failed[1]);
}

static void *make_and_fail_often(void *argument)
{
    ascc_context *const context = argument;
    const ascc_particles_options set = {.size = sizeof set, .dimension = 2, .spacing = 1};
    for (int turn = 0; turn < 200; turn++) {
        ascc_particles *particles;
        char text[ASCC_MESSAGE_CAPACITY];
        if (ascc_particles_create(context, NULL, &particles) != ASCC_ERROR_ARGUMENT ||
            ascc_context_message(context, text, sizeof text) != strlen(text))
            return context;
        if (ascc_particles_create(context, &set, &particles) != ASCC_OK)
            return context;
        ascc_particles_destroy(&particles);
    }
    return NULL;
}

static void a_context_may_be_used_and_fail_on_several_threads_at_once(void **state)
{
    (void)state;
    ascc_context *context;
    assert_int_equal(ascc_context_create(NULL, &context), ASCC_OK);
    pthread_t thread;
    void *wrong;
    assert_int_equal(pthread_create(&thread, NULL, make_and_fail_often, context), 0);
    assert_null(make_and_fail_often(context));
    pthread_join(thread, &wrong);
    assert_null(wrong);
    ascc_context_destroy(&context);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_status_has_a_text_of_its_own),
        cmocka_unit_test(the_library_has_the_version_of_its_header),
        cmocka_unit_test(a_message_is_one_line_that_fits),
        cmocka_unit_test(a_message_holds_nothing_that_a_terminal_obeys),
        cmocka_unit_test(structs_of_other_sizes_are_read_as_far_as_known),
        cmocka_unit_test(structs_of_other_sizes_are_written_as_far_as_known),
        cmocka_unit_test(a_context_needs_no_options),
        cmocka_unit_test(bits_of_the_cpu_can_be_disabled),
        cmocka_unit_test(options_out_of_range_are_refused_and_named),
        cmocka_unit_test(a_thousand_threads_of_a_host_are_accepted),
        cmocka_unit_test(options_of_another_size_are_read_or_refused),
        cmocka_unit_test(every_failed_allocation_is_reported_and_leaks_nothing),
        cmocka_unit_test(a_thread_that_does_not_start_is_reported_and_leaks_nothing),
        cmocka_unit_test(a_context_lives_as_long_as_what_was_made_from_it),
        cmocka_unit_test(a_message_is_kept_logged_and_copied_with_its_length),
        cmocka_unit_test(a_handle_of_another_type_is_refused),
        cmocka_unit_test(contexts_on_two_threads_know_nothing_of_each_other),
        cmocka_unit_test(a_context_may_be_used_and_fail_on_several_threads_at_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
