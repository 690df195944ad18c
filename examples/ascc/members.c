/* Takes typed members out of JSON objects; the first fault sticks and names the key.
 * SPDX-License-Identifier: MIT */
#include "members.h"

#include <stdarg.h>
#include <stdio.h>

#include "tensor_file.h"

void ascc_members_where(ascc_members *members, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(members->where, sizeof members->where, format, arguments);
    va_end(arguments);
}

void ascc_members_fail(ascc_members *members, const char *format, ...)
{
    char text[180];
    va_list arguments;
    if (!ascc_members_good(members))
        return;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    (void)snprintf(members->error, sizeof members->error, "%s: %s", members->where,
                   ascc_tensor_file_harmless(text));
}

bool ascc_members_good(const ascc_members *members)
{
    return members->error[0] == '\0';
}

/* NULL after a fault. `wanted` names the type. */
static json_t *take(ascc_members *members, json_t *object, const char *key, json_type type,
                    const char *wanted)
{
    if (!ascc_members_good(members))
        return NULL;
    json_t *value = json_object_get(object, key);
    if (!value) {
        ascc_members_fail(members, "'%s' is missing", key);
        return NULL;
    }
    const bool fits = type == JSON_REAL   ? json_is_number(value)
                      : type == JSON_TRUE ? json_is_boolean(value)
                                          : json_typeof(value) == type;
    if (!fits) {
        ascc_members_fail(members, "'%s' must be %s", key, wanted);
        return NULL;
    }
    if (json_array_append(members->taken, value) != 0) {
        ascc_members_fail(members, "no memory");
        return NULL;
    }
    (void)json_object_del(object, key);
    return value;
}

json_t *ascc_members_object(ascc_members *members, json_t *object, const char *key)
{
    return take(members, object, key, JSON_OBJECT, "an object");
}

json_t *ascc_members_array(ascc_members *members, json_t *object, const char *key)
{
    return take(members, object, key, JSON_ARRAY, "a list");
}

const char *ascc_members_text(ascc_members *members, json_t *object, const char *key)
{
    const json_t *value = take(members, object, key, JSON_STRING, "a text");
    return value ? json_string_value(value) : "";
}

double ascc_members_number(ascc_members *members, json_t *object, const char *key, double low,
                           double high)
{
    const json_t *value = take(members, object, key, JSON_REAL, "a number");
    const double number = value ? json_number_value(value) : low;
    if (number >= low && number <= high)
        return number;
    ascc_members_fail(members, "'%s' is %g, but must be within [%g, %g]", key, number, low, high);
    return low;
}

int ascc_members_integer(ascc_members *members, json_t *object, const char *key, int low, int high)
{
    const json_t *value = take(members, object, key, JSON_REAL, "a number");
    const json_int_t integer = json_is_integer(value) ? json_integer_value(value) : low;
    if ((!value || json_is_integer(value)) && integer >= low && integer <= high)
        return (int)integer;
    ascc_members_fail(members, "'%s' is %g, but must be an integer within [%d, %d]", key,
                      json_number_value(value), low, high);
    return low;
}

bool ascc_members_flag(ascc_members *members, json_t *object, const char *key)
{
    const json_t *value = take(members, object, key, JSON_TRUE, "true or false");
    return json_is_true(value);
}

void ascc_members_numbers(ascc_members *members, json_t *object, const char *key, size_t count,
                          double low, double high, double *numbers)
{
    const json_t *list = ascc_members_array(members, object, key);
    if (!list)
        return;
    if (json_array_size(list) != count)
        ascc_members_fail(members, "'%s' must be a list of %zu numbers", key, count);
    for (size_t i = 0; i < count && ascc_members_good(members); i++) {
        const json_t *value = json_array_get(list, i);
        const double number = json_number_value(value);
        if (json_is_number(value) && number >= low && number <= high)
            numbers[i] = number;
        else
            ascc_members_fail(members, "'%s' must be a list of numbers within [%g, %g]", key, low,
                              high);
    }
}

void ascc_members_end(ascc_members *members, json_t *object)
{
    void *first = json_object_iter(object);
    if (first)
        ascc_members_fail(members, "unknown key '%.70s'", json_object_iter_key(first));
}
