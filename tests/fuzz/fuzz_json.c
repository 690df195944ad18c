/* Reads JSON from bytes; what is read is walked, looked up and asked for as every kind of value.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "file/json_reader.h"
#include "fuzz.h"

/* Members count, name their parent, and can be found; returns the members below. */
static size_t walk(ascc_json *json, uint32_t parent)
{
    const ascc_json_value *value = json->value;
    size_t members = 0, below = 0;
    for (uint32_t i = ascc_json_first(json, parent); i; i = value[i].next) {
        fuzz_require(i < json->count && value[i].parent == parent);
        members++;
        below += 1 + walk(json, i);
        if (value[parent].kind == ASCC_JSON_OBJECT && members < 50)
            fuzz_require(ascc_json_find(json, parent, value[i].name) == i);
        if (value[i].kind == ASCC_JSON_NUMBER)
            fuzz_require(isfinite(value[i].number));
        const ascc_quoted quoted = ascc_quote(value[i].text);
        fuzz_require(memchr(quoted.text, '\0', sizeof quoted.text) != NULL);
        for (const char *c = quoted.text; *c; c++)
            fuzz_require((unsigned char)*c >= 0x20 && *c != 0x7f);
    }
    fuzz_require(members == value[parent].count);
    return below;
}

/* Every typed question about one member: an answer within what was asked for, or a fault that sticks. */
static void ask(ascc_json *json, uint32_t object, const char *key)
{
    static const char *const choices[] = {"fluid", "boundary"};
    for (int kind = 0; kind < 8; kind++) {
        ascc_message message = {""};
        ascc_reader r = {.json = json, .message = &message};
        double three[3] = {0.0, 0.0, 0.0};
        ascc_reader_where(&r, "%s", "here");
        if (kind == 0)
            (void)ascc_reader_object(&r, object, key);
        else if (kind == 1)
            (void)ascc_reader_array(&r, object, key);
        else if (kind == 2)
            fuzz_require(strlen(ascc_reader_text(&r, object, key)) < json->text_size + 1);
        else if (kind == 3)
            fuzz_require(fabs(ascc_reader_number(&r, object, key, -5.0, 5.0)) <= 5.0);
        else if (kind == 4)
            fuzz_require(labs((long)ascc_reader_integer(&r, object, key, -9, 9)) <= 9);
        else if (kind == 5)
            (void)ascc_reader_flag(&r, object, key);
        else if (kind == 6)
            ascc_reader_numbers(&r, object, key, 3, -1e300, 1e300, three);
        else
            (void)ascc_reader_choice(&r, object, key, choices, 2);
        fuzz_named(r.status, message.text);
        ascc_reader_end(&r, object);
    }
}

static void read_number(const uint8_t *data, size_t size)
{
    char text[256];
    double number = 0.0;
    size = size < sizeof text - 1 ? size : sizeof text - 1;
    memcpy(text, data, size);
    text[size] = '\0';
    fuzz_require(ascc_json_number(text, &number) <= strlen(text));
    (void)ascc_quote(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_message message = {""};
    ascc_json json;
    read_number(data, size);
    const ascc_status status =
        ascc_json_open(&allocator, (const char *)data, size, &json, &message);
    fuzz_named(status, message.text);
    if (status != ASCC_OK)
        return 0;
    fuzz_require(1 + walk(&json, 0) == json.count);
    if (json.value[0].kind == ASCC_JSON_OBJECT)
        for (uint32_t i = ascc_json_first(&json, 0), n = 0; i && n < 50;
             i = json.value[i].next, n++)
            ask(&json, 0, json.value[i].name);
    ascc_json_close(&json);
    return 0;
}
