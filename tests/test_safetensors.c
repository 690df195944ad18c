/* The safetensors reader: every malformed header is refused and every good byte is found.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "file/safetensors.h"
#include "support/failing_allocator.h"
#include "support/model_builder.h"

static ascc_message message;

/* Data for the headers of these tests: float i is i. */
static const float *numbers(void)
{
    static float values[64];
    for (int i = 0; i < 64; i++)
        values[i] = (float)i;
    return values;
}

static ascc_status open_raw(const char *header, size_t data_size)
{
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_safetensors file;
    size_t size;
    unsigned char *bytes = model_builder_raw(header, numbers(), data_size, &size);
    message.text[0] = '\0';
    const ascc_status status = ascc_safetensors_open(&allocator, bytes, size, &file, &message);
    if (status == ASCC_OK)
        ascc_safetensors_close(&file);
    free(bytes);
    return status;
}

/* Refused, and the message contains `hint`. */
static void refuse(const char *header, size_t data_size, const char *hint)
{
    const ascc_status status = open_raw(header, data_size);
    if (status != ASCC_ERROR_FORMAT || !strstr(message.text, hint))
        fail_msg("%.80s: status %d, message '%s' without '%s'", header, (int)status, message.text,
                 hint);
}

static void accept(const char *header, size_t data_size)
{
    if (open_raw(header, data_size) != ASCC_OK)
        fail_msg("%.80s: %s", header, message.text);
}

static void tensors_are_found_where_they_are(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_safetensors file;
    size_t size;
    unsigned char *bytes = model_builder_raw(
        "{\"second\":{\"dtype\":\"F32\",\"shape\":[2,2],\"data_offsets\":[12,28]},"
        "\"__metadata__\":{\"k\":\"v\"},"
        "\"first\":{\"dtype\":\"F32\",\"shape\":[3],\"data_offsets\":[0,12]}}  ",
        numbers(), 28, &size);
    assert_int_equal(ascc_safetensors_open(&allocator, bytes, size, &file, &message), ASCC_OK);
    assert_int_equal(file.tensor_count, 2);
    assert_string_equal(file.tensor[0].name, "first");
    assert_int_equal(ascc_safetensors_find(&file, "second"), 1);
    assert_int_equal(ascc_safetensors_find(&file, "third"), -1);
    assert_int_equal(file.tensor[1].rank, 2);
    assert_int_equal(file.tensor[1].count, 4);
    float values[4];
    assert_int_equal(ascc_tensor_read_floats(&file.tensor[1], values, &message), ASCC_OK);
    for (int i = 0; i < 4; i++)
        assert_true(values[i] == (float)(i + 3));
    assert_string_equal(ascc_safetensors_metadata(&file, "k"), "v");
    assert_null(ascc_safetensors_metadata(&file, "v"));
    ascc_safetensors_close(&file);
    free(bytes);
}

static void small_and_empty_files_are_handled(void **state)
{
    (void)state;
    accept("{}", 0);
    accept("{\"__metadata__\":{}}", 0);
    accept("{\"a\":{\"dtype\":\"F32\",\"shape\":[],\"data_offsets\":[0,4]}}", 4);
    accept("{\"a\":{\"dtype\":\"F32\",\"shape\":[0],\"data_offsets\":[0,0]}}", 0);
    accept("{\"b\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4]},"
           "\"a\":{\"dtype\":\"F32\",\"shape\":[2,0],\"data_offsets\":[0,0]}}",
           4);
}

static void all_dtypes_are_recognised(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int size;
    } types[] = {{"F64", 8}, {"F32", 4}, {"F16", 2},  {"BF16", 2},    {"I64", 8},
                 {"I32", 4}, {"I16", 2}, {"I8", 1},   {"U64", 8},     {"U32", 4},
                 {"U16", 2}, {"U8", 1},  {"BOOL", 1}, {"F8_E5M2", 1}, {"F8_E4M3", 1}};
    for (size_t i = 0; i < sizeof types / sizeof *types; i++) {
        char header[128];
        snprintf(header, sizeof header,
                 "{\"a\":{\"dtype\":\"%s\",\"shape\":[3],\"data_offsets\":[0,%d]}}", types[i].name,
                 3 * types[i].size);
        accept(header, (size_t)(3 * types[i].size));
    }
    refuse("{\"a\":{\"dtype\":\"f32\",\"shape\":[1],\"data_offsets\":[0,4]}}", 4, "'f32'");
    refuse("{\"a\":{\"dtype\":32,\"shape\":[1],\"data_offsets\":[0,4]}}", 4, "dtype");
    refuse("{\"a\":{\"shape\":[1],\"data_offsets\":[0,4]}}", 4, "dtype");
}

static void malformed_entries_are_refused(void **state)
{
    (void)state;
    refuse("[]", 0, "'{'");
    refuse(" {}", 0, "'{'");
    refuse("{} x", 0, "after the end");
    refuse("{\"a\":1}", 0, "'a'");
    refuse("{\"__metadata__\":[]}", 0, "__metadata__");
    refuse("{\"__metadata__\":{\"k\":1}}", 0, "'k'");
    refuse("{\"a\":{\"dtype\":\"F32\",\"data_offsets\":[0,4]}}", 4, "shape");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":1,\"data_offsets\":[0,4]}}", 4, "shape");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[-1],\"data_offsets\":[0,4]}}", 4, "shape");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1.0],\"data_offsets\":[0,4]}}", 4, "shape");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[\"1\"],\"data_offsets\":[0,4]}}", 4, "shape");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1,1,1,1,1,1,1,1,1],\"data_offsets\":[0,4]}}", 4,
           "shape");
    accept("{\"a\":{\"dtype\":\"F32\",\"shape\":[1,1,1,1,1,1,1,1],\"data_offsets\":[0,4]}}", 4);
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1]}}", 4, "data_offsets");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0]}}", 4, "data_offsets");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4,8]}}", 4, "data_offsets");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4],\"x\":0}}", 4, "'x'");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[0,4]},"
           "\"a\":{\"dtype\":\"F32\",\"shape\":[1],\"data_offsets\":[4,8]}}",
           8, "twice");
}

static void offsets_must_tile_the_data(void **state)
{
    (void)state;
    static const struct {
        const char *a, *b;
        size_t data;
        const char *hint;
    } cases[] = {
        {"0,8", "8,16", 16, NULL},
        {"8,16", "0,8", 16, NULL},
        {"0,8", "4,12", 12, "begins"},     /* overlap */
        {"0,8", "0,8", 8, "begins"},       /* the same bytes */
        {"0,8", "12,20", 20, "begins"},    /* a hole */
        {"4,12", "12,20", 20, "begins"},   /* a hole at the start */
        {"0,8", "8,16", 20, "follow"},     /* a hole at the end */
        {"0,8", "8,16", 12, "not within"}, /* truncated */
        {"0,8", "16,8", 16, "not within"}, /* reversed */
        {"0,8", "8,18446744073709551616", 16, "'b'"},
        {"0,8", "8,999999999999999999", 16, "not within"},
        {"0,8", "8,20", 20, "needs 8 bytes"},
        {"0,8", "8,12", 12, "needs 8 bytes"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        char header[256];
        snprintf(header, sizeof header,
                 "{\"a\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[%s]},"
                 "\"b\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[%s]}}",
                 cases[i].a, cases[i].b);
        if (cases[i].hint)
            refuse(header, cases[i].data, cases[i].hint);
        else
            accept(header, cases[i].data);
    }
}

static void shapes_that_overflow_are_refused(void **state)
{
    (void)state;
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[4611686018427387904],\"data_offsets\":[0,0]}}", 0,
           "'a'");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[999999999999999999,999999999999999999],"
           "\"data_offsets\":[0,0]}}",
           0, "overflows");
    refuse("{\"a\":{\"dtype\":\"F32\",\"shape\":[65536,65536,65536,65536],\"data_offsets\":[0,0]}}",
           0, "overflows");
    refuse("{\"a\":{\"dtype\":\"F64\",\"shape\":[2147483648,1073741824],\"data_offsets\":[0,0]}}",
           0, "overflows");
}

static void header_length_is_checked(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_safetensors file;
    static const unsigned char lengths[][9] = {{3, 0, 0, 0, 0, 0, 0, 0},
                                               {2, 0, 0, 0, 0, 0, 0, 1},
                                               {255, 255, 255, 255, 255, 255, 255, 255},
                                               {0, 0, 0, 0, 0, 0, 0, 0},
                                               {1, 0, 0, 0, 0, 0, 0, 0},
                                               {248, 255, 255, 255, 255, 255, 255, 255}};
    for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++) {
        unsigned char *bytes = malloc(10);
        assert_non_null(bytes);
        memcpy(bytes, lengths[i], 8);
        memcpy(bytes + 8, "{}", 2);
        assert_int_equal(ascc_safetensors_open(&allocator, bytes, 10, &file, &message),
                         ASCC_ERROR_FORMAT);
        free(bytes);
    }
    const size_t size = 8 + ASCC_SAFETENSORS_MAX_HEADER + 8;
    unsigned char *large = malloc(size);
    assert_non_null(large);
    memset(large, ' ', size);
    large[8] = '{';
    large[9] = '}';
    const uint64_t length = ASCC_SAFETENSORS_MAX_HEADER;
    for (int i = 0; i < 8; i++)
        large[i] = (unsigned char)(length >> 8 * i);
    assert_int_equal(ascc_safetensors_open(&allocator, large, size - 8, &file, &message), ASCC_OK);
    ascc_safetensors_close(&file);
    large[0]++;
    assert_int_equal(ascc_safetensors_open(&allocator, large, size, &file, &message),
                     ASCC_ERROR_FORMAT);
    assert_non_null(strstr(message.text, "at most"));
    free(large);
}

static void every_truncation_is_refused(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    size_t size;
    unsigned char *bytes =
        model_builder_raw("{\"__metadata__\":{\"k\":\"v\"},"
                          "\"a\":{\"dtype\":\"F32\",\"shape\":[3],\"data_offsets\":[0,12]}}",
                          numbers(), 12, &size);
    for (size_t n = 0; n < size; n++) {
        ascc_safetensors file;
        unsigned char *part = malloc(n ? n : 1);
        assert_non_null(part);
        memcpy(part, bytes, n);
        assert_int_equal(ascc_safetensors_open(&allocator, part, n, &file, &message),
                         ASCC_ERROR_FORMAT);
        free(part);
    }
    free(bytes);
}

static void too_many_tensors_are_refused(void **state)
{
    (void)state;
    model_text header = {NULL, 0, 0};
    for (int extra = 0; extra < 2; extra++) {
        model_text_add(&header, "{");
        for (int i = 0; i < ASCC_SAFETENSORS_MAX_TENSORS + extra; i++)
            model_text_add(&header,
                           "%s\"t%d\":{\"dtype\":\"F32\",\"shape\":[0],\"data_offsets\":[0,0]}",
                           i ? "," : "", i);
        model_text_add(&header, "}");
        if (extra)
            refuse(header.text, 0, "tensors");
        else
            accept(header.text, 0);
        model_text_free(&header);
    }
}

static ascc_tensor tensor_of(const char *type, size_t size, size_t count, const void *data)
{
    return (ascc_tensor){.name = "t",
                         .type = type,
                         .element_size = size,
                         .rank = 1,
                         .shape = {count},
                         .count = count,
                         .data = data};
}

/* A short float of `fraction` bits after its exponent, by the definition of the format. */
static double value_of(unsigned bits, int fraction)
{
    const int exponent_bits = 15 - fraction, bias = (1 << (exponent_bits - 1)) - 1;
    const int exponent = (int)(bits >> fraction) & ((1 << exponent_bits) - 1);
    const int tail = (int)bits & ((1 << fraction) - 1);
    const double size = exponent ? ldexp(tail + (1 << fraction), exponent - bias - fraction)
                                 : ldexp(tail, 1 - bias - fraction);
    return bits >> 15 ? -size : size;
}

static void every_short_float_is_widened_exactly(void **state)
{
    (void)state;
    static const struct {
        const char *type;
        int fraction;
    } formats[] = {{"F16", 10}, {"BF16", 7}};
    for (size_t f = 0; f < 2; f++)
        for (unsigned bits = 0; bits < 65536; bits++) {
            const unsigned char bytes[3] = {0, (unsigned char)bits, (unsigned char)(bits >> 8)};
            const ascc_tensor tensor = tensor_of(formats[f].type, 2, 1, bytes + 1);
            float read;
            const ascc_status status = ascc_tensor_read_floats(&tensor, &read, &message);
            const unsigned exponent = (bits & 0x7fffu) >> formats[f].fraction;
            if (exponent + 1 == 1u << (15 - formats[f].fraction)) { /* infinite or no number */
                assert_int_equal(status, ASCC_ERROR_FORMAT);
                continue;
            }
            assert_int_equal(status, ASCC_OK);
            assert_true((double)read == value_of(bits, formats[f].fraction));
            assert_true((signbit(read) != 0) == (bits >> 15 != 0));
        }
}

static void floats_must_be_finite(void **state)
{
    (void)state;
    float values[3], read[3];
    static const uint32_t bad[] = {0x7f800000u, 0xff800000u, 0x7fc00000u, 0x7f800001u};
    for (size_t i = 0; i < 4; i++) {
        memcpy(values, numbers(), sizeof values);
        memcpy(&values[2], &bad[i], 4);
        const ascc_tensor tensor = tensor_of("F32", 4, 3, values);
        assert_int_equal(ascc_tensor_read_floats(&tensor, read, &message), ASCC_ERROR_FORMAT);
        assert_non_null(strstr(message.text, "'t'"));
    }
    const ascc_tensor whole = tensor_of("I16", 2, 0, values);
    assert_int_equal(ascc_tensor_read_floats(&whole, read, &message), ASCC_ERROR_FORMAT);
    assert_non_null(strstr(message.text, "I16"));
}

static void every_failing_allocation_is_reported(void **state)
{
    (void)state;
    size_t size;
    unsigned char *bytes = model_builder_raw(
        "{\"a\":{\"dtype\":\"F32\",\"shape\":[3],\"data_offsets\":[0,12]}}", numbers(), 12, &size);
    long calls = 1;
    for (long n = 1; n <= calls; n++) {
        failing_allocator failing = {.fail_at = n};
        const ascc_allocator allocator = {failing_allocate, failing_reallocate, failing_release,
                                          &failing};
        ascc_safetensors file;
        const ascc_status status = ascc_safetensors_open(&allocator, bytes, size, &file, &message);
        if (failing.calls >= n) {
            assert_int_equal(status, ASCC_ERROR_MEMORY);
            calls = n + 1;
        } else {
            assert_int_equal(status, ASCC_OK);
            ascc_safetensors_close(&file);
        }
        assert_int_equal(failing.blocks, 0);
        assert_int_equal(failing.bytes, 0);
    }
    assert_true(calls > 3);
    free(bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tensors_are_found_where_they_are),
        cmocka_unit_test(small_and_empty_files_are_handled),
        cmocka_unit_test(all_dtypes_are_recognised),
        cmocka_unit_test(malformed_entries_are_refused),
        cmocka_unit_test(offsets_must_tile_the_data),
        cmocka_unit_test(shapes_that_overflow_are_refused),
        cmocka_unit_test(header_length_is_checked),
        cmocka_unit_test(every_truncation_is_refused),
        cmocka_unit_test(too_many_tensors_are_refused),
        cmocka_unit_test(every_short_float_is_widened_exactly),
        cmocka_unit_test(floats_must_be_finite),
        cmocka_unit_test(every_failing_allocation_is_reported),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
