/* The JSON reader: what it accepts, what it refuses, and that numbers are exact.
 * SPDX-License-Identifier: MIT */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include <locale.h>
#include <math.h>

#include "file/json.h"
#include "file/json_reader.h"
#include "support/failing_allocator.h"

static ascc_message message;

static ascc_status open_text(const char *text, size_t size, ascc_json *json)
{
    const ascc_allocator allocator = ascc_allocator_default();
    message.text[0] = '\0';
    /* An exact copy, so that a sanitizer sees every byte read beyond the end. */
    char *copy = malloc(size ? size : 1);
    assert_non_null(copy);
    memcpy(copy, text, size);
    const ascc_status status = ascc_json_open(&allocator, copy, size, json, &message);
    free(copy);
    return status;
}

static void expect(const char *text, ascc_status expected)
{
    ascc_json json;
    const ascc_status status = open_text(text, strlen(text), &json);
    if (status != expected)
        fail_msg("'%.60s' gave %d: %s", text, (int)status, message.text);
    if (status == ASCC_OK)
        ascc_json_close(&json);
    else
        assert_true(message.text[0] != '\0');
}

static void scalars_and_containers_are_read(void **state)
{
    (void)state;
    ascc_json json;
    const char *text = " {\"a\":[1,-2.5,true,false,null],\"b\":{},\"c\":[],\"d\":\"x\"}\n";
    assert_int_equal(open_text(text, strlen(text), &json), ASCC_OK);
    assert_int_equal(json.value[0].kind, ASCC_JSON_OBJECT);
    assert_int_equal(json.value[0].count, 4);
    const uint32_t a = ascc_json_find(&json, 0, "a");
    assert_int_equal(json.value[a].kind, ASCC_JSON_ARRAY);
    assert_int_equal(json.value[a].count, 5);
    static const ascc_json_kind kinds[] = {ASCC_JSON_NUMBER, ASCC_JSON_NUMBER, ASCC_JSON_TRUE,
                                           ASCC_JSON_FALSE, ASCC_JSON_NULL};
    int n = 0;
    for (uint32_t i = ascc_json_first(&json, a); i != 0; i = json.value[i].next)
        assert_int_equal(json.value[i].kind, kinds[n++]);
    assert_int_equal(n, 5);
    assert_true(json.value[a + 2].number == -2.5);
    assert_int_equal(ascc_json_first(&json, ascc_json_find(&json, 0, "b")), 0);
    assert_int_equal(ascc_json_first(&json, ascc_json_find(&json, 0, "c")), 0);
    assert_string_equal(json.value[ascc_json_find(&json, 0, "d")].text, "x");
    assert_int_equal(ascc_json_find(&json, 0, "e"), 0);
    ascc_json_close(&json);
}

static void escapes_are_decoded(void **state)
{
    (void)state;
    ascc_json json;
    const char *text = "\"\\\"\\\\\\/\\b\\f\\n\\r\\t\\u0041\\u00e9\\u20AC\\ud83d\\ude00\xc3\xa9\"";
    assert_int_equal(open_text(text, strlen(text), &json), ASCC_OK);
    assert_string_equal(json.value[0].text,
                        "\"\\/\b\f\n\r\tA\xc3\xa9\xe2\x82\xac\xf0\x9f\x98\x80\xc3\xa9");
    ascc_json_close(&json);
}

static void malformed_text_is_refused(void **state)
{
    (void)state;
    static const char *const texts[] = {"",
                                        " ",
                                        "{",
                                        "}",
                                        "[",
                                        "]",
                                        "[1",
                                        "[1,",
                                        "[1,]",
                                        "[,1]",
                                        "[1 2]",
                                        "{\"a\"}",
                                        "{\"a\":}",
                                        "{\"a\":1,}",
                                        "{a:1}",
                                        "{1:1}",
                                        "{\"a\":1]",
                                        "[1}",
                                        "tru",
                                        "nul",
                                        "falsy",
                                        "True",
                                        "NaN",
                                        "Infinity",
                                        "-",
                                        "+1",
                                        "01",
                                        "-01",
                                        "1.",
                                        ".5",
                                        "1e",
                                        "1e+",
                                        "0x1",
                                        "1.5.2",
                                        "--1",
                                        "1 2",
                                        "{} x",
                                        "[]]",
                                        "\"",
                                        "\"a",
                                        "\"\\",
                                        "\"\\x\"",
                                        "\"\\u12\"",
                                        "\"\\u12g4\"",
                                        "\"\\ud800\"",
                                        "\"\\ud800\\u0041\"",
                                        "\"\\ud800x\"",
                                        "\"\\udc00\"",
                                        "\"\\u0000\"",
                                        "\"\t\"",
                                        "\"\n\"",
                                        "\"\x80\"",
                                        "\"\xc3\"",
                                        "\"\xc0\x80\"",
                                        "\"\xed\xa0\x80\"",
                                        "\"\xf5\x80\x80\x80\"",
                                        "\"\xe0\x80\x80\"",
                                        "\"\xf0\x80\x80\x80\"",
                                        "\"\xf4\x90\x80\x80\"",
                                        "\"\xff\"",
                                        "\xef\xbb\xbf{}",
                                        "/* */1",
                                        "'a'"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        expect(texts[i], ASCC_ERROR_FORMAT);
    ascc_json json;
    assert_int_equal(open_text("\"a\0b\"", 5, &json), ASCC_ERROR_FORMAT);
    assert_int_equal(open_text("1\0", 2, &json), ASCC_ERROR_FORMAT);
}

static void every_prefix_is_refused(void **state)
{
    (void)state;
    const char *text = "{\"a\":[1,-2.5e-3,\"\\u20ac\\ud83d\\ude00\"],\"b\":{\"c\":true}}";
    for (size_t size = 0; size < strlen(text); size++) {
        ascc_json json;
        assert_int_equal(open_text(text, size, &json), ASCC_ERROR_FORMAT);
    }
    expect(text, ASCC_OK);
}

static void duplicate_keys_are_refused(void **state)
{
    (void)state;
    expect("{\"a\":1,\"b\":2,\"a\":3}", ASCC_ERROR_FORMAT);
    assert_non_null(strstr(message.text, "'a'"));
    expect("[{\"x\":{\"key\":1,\"\\u006bey\":2}}]", ASCC_ERROR_FORMAT);
    expect("{\"\":1,\"\":2}", ASCC_ERROR_FORMAT);
    expect("{\"a\":{\"a\":{\"a\":1}},\"b\":[{\"a\":1},{\"a\":1}]}", ASCC_OK);
}

static void many_keys_are_sorted_out_quickly(void **state)
{
    (void)state;
    const int count = 50000;
    char *text = malloc((size_t)count * 16 + 32), *end = text;
    assert_non_null(text);
    *end++ = '{';
    for (int i = 0; i < count; i++)
        end += sprintf(end, "\"k%d\":0,", i);
    strcpy(end, "\"k25000\":0}");
    expect(text, ASCC_ERROR_FORMAT);
    assert_non_null(strstr(message.text, "'k25000'"));
    strcpy(end, "\"k\":0}");
    expect(text, ASCC_OK);
    free(text);
}

static void depth_and_number_of_values_are_bounded(void **state)
{
    (void)state;
    char text[2 * ASCC_JSON_MAX_DEPTH + 4] = "";
    for (int depth = 1; depth <= ASCC_JSON_MAX_DEPTH + 1; depth++) {
        memset(text, '[', (size_t)depth);
        memset(text + depth, ']', (size_t)depth);
        text[2 * depth] = '\0';
        expect(text, depth <= ASCC_JSON_MAX_DEPTH ? ASCC_OK : ASCC_ERROR_FORMAT);
    }
    const size_t size = 1u << 20;
    char *bomb = malloc(size);
    assert_non_null(bomb);
    ascc_json json;
    memset(bomb, '[', size);
    assert_int_equal(open_text(bomb, size, &json), ASCC_ERROR_FORMAT);
    for (size_t i = 0; i < size; i++)
        bomb[i] = i == 0 ? '[' : i + 1 == size ? ']' : i % 2 ? '1' : ',';
    assert_int_equal(open_text(bomb, size, &json), ASCC_ERROR_FORMAT);
    assert_non_null(strstr(message.text, "too many values"));
    free(bomb);
}

/* ---- Numbers ------------------------------------------------------------------------------------ */

static void check_number(const char *text)
{
    double got = 0.0;
    const double expected = strtod(text, NULL);
    if (ascc_json_number(text, &got) != strlen(text) || memcmp(&got, &expected, sizeof got) != 0)
        fail_msg("%s is read as %.17g, not %.17g", text, got, expected);
}

static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

static void numbers_are_rounded_to_the_nearest_double(void **state)
{
    (void)state;
    static const char *const texts[] = {
        "0",
        "-0",
        "0.0",
        "-0.0e5",
        "1",
        "-1",
        "0.1",
        "0.02",
        "-9.81",
        "0.0078125",
        "1e22",
        "1e23",
        "123456789012345678",
        "9007199254740993",
        "9007199254740992.5",
        "9007199254740993.0000001",
        "5e-324",
        "4.9e-324",
        "2.4703282292062327e-324",
        "2.4703282292062328e-324",
        "1e-400",
        "2.2250738585072014e-308",
        "2.2250738585072011e-308",
        "2.225073858507201e-308",
        "1.7976931348623157e308",
        "1.7976931348623158e308",
        "8.41e21",
        "9.5e-4",
        "1e-320",
        "0.500000000000000166533453693773481063544750213623046875",
        "1.00000000000000011102230246251565404236316680908203125",
        "1.00000000000000011102230246251565404236316680908203124",
        "1.00000000000000011102230246251565404236316680908203126",
        "0.000000000000000000000000001",
        "100000000000000000000000000000000000000000000000000000000000000000000000000000000"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        check_number(texts[i]);
    uint64_t seed = 20;
    for (int i = 0; i < 20000; i++) {
        char text[64];
        double value;
        const uint64_t bits = next_random(&seed);
        memcpy(&value, &bits, sizeof value);
        if (!isfinite(value))
            continue;
        snprintf(text, sizeof text, "%.*g", (int)(next_random(&seed) % 19) + 1, value);
        if (isfinite(strtod(text, NULL)))
            check_number(text);
        snprintf(text, sizeof text, "%d.%06de%d", (int)(next_random(&seed) % 1000),
                 (int)(next_random(&seed) % 1000000), (int)(next_random(&seed) % 40) - 20);
        check_number(text);
    }
}

static void numbers_beyond_doubles_are_refused(void **state)
{
    (void)state;
    expect("1.7976931348623159e308", ASCC_ERROR_FORMAT);
    expect("1e309", ASCC_ERROR_FORMAT);
    expect("-1e309", ASCC_ERROR_FORMAT);
    expect("1e999999999999999999999", ASCC_ERROR_FORMAT);
    expect("1e-999999999999999999999", ASCC_OK);
    expect("0e999999999999999999999", ASCC_OK);
    char text[128];
    memset(text, '7', 100);
    text[ASCC_JSON_MAX_DIGITS] = '\0';
    expect(text, ASCC_OK);
    text[ASCC_JSON_MAX_DIGITS] = '7';
    text[100] = '\0';
    expect(text, ASCC_ERROR_FORMAT);
}

static void numbers_do_not_depend_on_the_locale(void **state)
{
    (void)state;
    static const char *const locales[] = {"de_DE.UTF-8", "de_DE.utf8", "fr_FR.UTF-8", "de_DE"};
    for (size_t i = 0; i < sizeof locales / sizeof *locales; i++)
        if (setlocale(LC_ALL, locales[i])) {
            double number = 0.0;
            assert_int_equal(ascc_json_number("2.5", &number), 3);
            assert_true(number == 2.5);
            setlocale(LC_ALL, "C");
            return;
        }
    print_message("SKIP: no locale with a decimal comma is installed\n");
}

static void integers_are_exact(void **state)
{
    (void)state;
    ascc_json json;
    const char *text = "[0,-7,999999999999999999,1000000000000000000,1.0,1e3,-0]";
    static const int exact[] = {1, 1, 1, 0, 0, 0, 1};
    static const int64_t value[] = {0, -7, 999999999999999999, 0, 0, 0, 0};
    assert_int_equal(open_text(text, strlen(text), &json), ASCC_OK);
    for (uint32_t i = 0; i < 7; i++) {
        assert_int_equal(json.value[i + 1].is_integer, exact[i]);
        assert_true(json.value[i + 1].integer == value[i]);
    }
    ascc_json_close(&json);
}

/* ---- The reader of members ---------------------------------------------------------------------- */

static void first_fault_sticks_and_names_the_key(void **state)
{
    (void)state;
    ascc_json json;
    const char *text = "{\"n\":3,\"t\":\"x\",\"f\":true,\"l\":[1,2],\"o\":{}}";
    assert_int_equal(open_text(text, strlen(text), &json), ASCC_OK);
    ascc_reader reader = {.json = &json, .message = &message, .status = ASCC_OK};
    double numbers[2];
    ascc_reader_where(&reader, "part %d", 7);
    assert_true(ascc_reader_has(&reader, 0, "n"));
    assert_int_equal(ascc_reader_integer(&reader, 0, "n", 0, 5), 3);
    assert_true(ascc_reader_flag(&reader, 0, "f"));
    assert_string_equal(ascc_reader_text(&reader, 0, "t"), "x");
    ascc_reader_numbers(&reader, 0, "l", 2, 0.0, 2.0, numbers);
    assert_true(numbers[0] == 1.0 && numbers[1] == 2.0);
    assert_int_equal(reader.status, ASCC_OK);
    ascc_reader_end(&reader, 0);
    assert_string_equal(message.text, "part 7: unknown key 'o'");
    assert_int_equal(ascc_reader_integer(&reader, 0, "n", 0, 5), 0);
    assert_string_equal(message.text, "part 7: unknown key 'o'");

    static const char *const keys[] = {"missing", "t", "f", "l", "o"};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; i++) {
        reader.status = ASCC_OK;
        ascc_reader_number(&reader, 0, keys[i], 0.0, 1.0);
        assert_int_equal(reader.status, ASCC_ERROR_FORMAT);
        assert_non_null(strstr(message.text, keys[i]));
    }
    reader.status = ASCC_OK;
    ascc_reader_integer(&reader, 0, "n", 0, 2);
    assert_int_equal(reader.status, ASCC_ERROR_FORMAT);
    reader.status = ASCC_OK;
    ascc_reader_numbers(&reader, 0, "l", 3, 0.0, 2.0, numbers);
    assert_int_equal(reader.status, ASCC_ERROR_FORMAT);
    reader.status = ASCC_OK;
    ascc_reader_numbers(&reader, 0, "l", 2, 0.0, 1.5, numbers);
    assert_int_equal(reader.status, ASCC_ERROR_FORMAT);
    ascc_json_close(&json);
}

static void quoted_text_is_one_printable_line(void **state)
{
    (void)state;
    assert_string_equal(ascc_quote("a\nb\x7f\xc3\xa9").text, "a?b???");
    char longer[200];
    memset(longer, 'x', sizeof longer);
    longer[199] = '\0';
    const ascc_quoted quoted = ascc_quote(longer);
    assert_int_equal(strlen(quoted.text), sizeof quoted.text - 1);
    assert_string_equal(quoted.text + sizeof quoted.text - 4, "...");
}

static void every_failing_allocation_is_reported(void **state)
{
    (void)state;
    const char *text = "{\"a\":[1,2,3,4,5,6,7,8,9,10,11,12,13,14],\"b\":\"text\",\"c\":{\"d\":{}}}";
    long calls = 1;
    for (long n = 1; n <= calls; n++) {
        failing_allocator failing = {.fail_at = n};
        const ascc_allocator allocator = {failing_allocate, failing_reallocate, failing_release,
                                          &failing};
        ascc_json json;
        const ascc_status status = ascc_json_open(&allocator, text, strlen(text), &json, &message);
        if (failing.calls >= n) {
            assert_int_equal(status, ASCC_ERROR_MEMORY);
            calls = n + 1;
        } else {
            assert_int_equal(status, ASCC_OK);
            ascc_json_close(&json);
        }
        assert_int_equal(failing.blocks, 0);
        assert_int_equal(failing.bytes, 0);
    }
    assert_true(calls > 3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scalars_and_containers_are_read),
        cmocka_unit_test(escapes_are_decoded),
        cmocka_unit_test(malformed_text_is_refused),
        cmocka_unit_test(every_prefix_is_refused),
        cmocka_unit_test(duplicate_keys_are_refused),
        cmocka_unit_test(many_keys_are_sorted_out_quickly),
        cmocka_unit_test(depth_and_number_of_values_are_bounded),
        cmocka_unit_test(numbers_are_rounded_to_the_nearest_double),
        cmocka_unit_test(numbers_beyond_doubles_are_refused),
        cmocka_unit_test(numbers_do_not_depend_on_the_locale),
        cmocka_unit_test(integers_are_exact),
        cmocka_unit_test(first_fault_sticks_and_names_the_key),
        cmocka_unit_test(quoted_text_is_one_printable_line),
        cmocka_unit_test(every_failing_allocation_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
