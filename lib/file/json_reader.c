/* Takes typed members out of a JSON object; the first fault sticks and names the key.
 * SPDX-License-Identifier: MIT */
#include "json_reader.h"

#include <stdio.h>
#include <string.h>

void ascc_reader_where(ascc_reader *reader, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(reader->where, sizeof reader->where, format, arguments);
    va_end(arguments);
}

ascc_status ascc_reader_fail(ascc_reader *reader, const char *format, ...)
{
    char text[ASCC_MESSAGE_CAPACITY];
    va_list arguments;
    if (reader->status != ASCC_OK)
        return reader->status;
    va_start(arguments, format);
    vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    reader->status = ascc_fail(reader->message, ASCC_ERROR_FORMAT, "%s: %s", reader->where, text);
    return reader->status;
}

bool ascc_reader_has(const ascc_reader *reader, uint32_t object, const char *key)
{
    const ascc_json *json = reader->json;
    if (reader->status != ASCC_OK)
        return false;
    for (uint32_t i = ascc_json_first(json, object); i != 0; i = json->value[i].next)
        if (strcmp(json->value[i].name, key) == 0)
            return true;
    return false;
}

/* NULL after a fault. */
static const ascc_json_value *member(ascc_reader *reader, uint32_t object, const char *key,
                                     ascc_json_kind kind)
{
    static const char *const kinds[] = {
        [ASCC_JSON_NULL] = "null",          [ASCC_JSON_FALSE] = "true or false",
        [ASCC_JSON_TRUE] = "true or false", [ASCC_JSON_NUMBER] = "a number",
        [ASCC_JSON_STRING] = "a text",      [ASCC_JSON_ARRAY] = "a list",
        [ASCC_JSON_OBJECT] = "an object"};
    if (reader->status != ASCC_OK)
        return NULL;
    const uint32_t index = ascc_json_find(reader->json, object, key);
    if (index == 0) {
        ascc_reader_fail(reader, "'%s' is missing", key);
        return NULL;
    }
    const ascc_json_value *value = &reader->json->value[index];
    if (value->kind != kind && !(kind == ASCC_JSON_TRUE && value->kind == ASCC_JSON_FALSE)) {
        ascc_reader_fail(reader, "'%s' must be %s", key, kinds[kind]);
        return NULL;
    }
    return value;
}

uint32_t ascc_reader_object(ascc_reader *reader, uint32_t object, const char *key)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_OBJECT);
    return value ? (uint32_t)(value - reader->json->value) : 0;
}

uint32_t ascc_reader_array(ascc_reader *reader, uint32_t object, const char *key)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_ARRAY);
    return value ? (uint32_t)(value - reader->json->value) : 0;
}

const char *ascc_reader_text(ascc_reader *reader, uint32_t object, const char *key)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_STRING);
    return value ? value->text : "";
}

double ascc_reader_number(ascc_reader *reader, uint32_t object, const char *key, double low,
                          double high)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_NUMBER);
    if (!value)
        return low;
    if (!(value->number >= low && value->number <= high)) {
        ascc_reader_fail(reader, "'%s' is %g, but must be within [%g, %g]", key, value->number, low,
                         high);
        return low;
    }
    return value->number;
}

int32_t ascc_reader_integer(ascc_reader *reader, uint32_t object, const char *key, int32_t low,
                            int32_t high)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_NUMBER);
    if (!value)
        return low;
    if (!value->is_integer || value->integer < low || value->integer > high) {
        ascc_reader_fail(reader, "'%s' is %g, but must be an integer within [%ld, %ld]", key,
                         value->number, (long)low, (long)high);
        return low;
    }
    return (int32_t)value->integer;
}

bool ascc_reader_flag(ascc_reader *reader, uint32_t object, const char *key)
{
    const ascc_json_value *value = member(reader, object, key, ASCC_JSON_TRUE);
    return value && value->kind == ASCC_JSON_TRUE;
}

void ascc_reader_numbers(ascc_reader *reader, uint32_t object, const char *key, int32_t count,
                         double low, double high, double *numbers)
{
    const uint32_t array = ascc_reader_array(reader, object, key);
    if (reader->status != ASCC_OK)
        return;
    const ascc_json *json = reader->json;
    if (json->value[array].count != (uint32_t)count) {
        ascc_reader_fail(reader, "'%s' must be a list of %ld numbers", key, (long)count);
        return;
    }
    for (uint32_t i = ascc_json_first(json, array); i != 0; i = json->value[i].next) {
        const ascc_json_value *value = &json->value[i];
        if (value->kind != ASCC_JSON_NUMBER || !(value->number >= low && value->number <= high)) {
            ascc_reader_fail(reader, "'%s' must be a list of numbers within [%g, %g]", key, low,
                             high);
            return;
        }
        *numbers++ = value->number;
    }
}

int32_t ascc_reader_choice(ascc_reader *reader, uint32_t object, const char *key,
                           const char *const *choices, int32_t count)
{
    const char *text = ascc_reader_text(reader, object, key);
    for (int32_t i = 0; i < count && reader->status == ASCC_OK; i++)
        if (strcmp(text, choices[i]) == 0)
            return i;
    ascc_reader_fail(reader, "'%s' does not understand '%s'", key, ascc_quote(text).text);
    return 0;
}

void ascc_reader_end(ascc_reader *reader, uint32_t object)
{
    const ascc_json *json = reader->json;
    if (reader->status != ASCC_OK)
        return;
    for (uint32_t i = ascc_json_first(json, object); i != 0; i = json->value[i].next)
        if (!json->value[i].used) {
            ascc_reader_fail(reader, "unknown key '%s'", ascc_quote(json->value[i].name).text);
            return;
        }
}

bool ascc_reader_optional_flag(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key) && ascc_reader_flag(reader, object, key);
}

int32_t ascc_reader_optional_integer(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key)
               ? ascc_reader_integer(reader, object, key, 0, INT32_MAX)
               : 0;
}

const char *ascc_reader_optional_text(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key) ? ascc_reader_text(reader, object, key) : NULL;
}
