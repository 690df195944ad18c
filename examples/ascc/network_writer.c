/* Writes the description of a network as model files have it (docs/file-format.md).
 * SPDX-License-Identifier: MIT */
#include "network_writer.h"

#include <stdio.h>
#include <stdlib.h>

json_t *ascc_network_put(ascc_network_writer *writer, json_t *object, const char *key,
                         json_t *value)
{
    if (json_object_set_new(object, key, value) == 0)
        return value;
    writer->failed = true;
    return NULL;
}

json_t *ascc_network_append(ascc_network_writer *writer, json_t *list, json_t *value)
{
    if (json_array_append_new(list, value) == 0)
        return value;
    writer->failed = true;
    return NULL;
}

void ascc_network_put_text(ascc_network_writer *writer, json_t *object, const char *key,
                           const char *text)
{
    (void)ascc_network_put(writer, object, key, json_string(text));
}

void ascc_network_put_numbers(ascc_network_writer *writer, json_t *object, const char *key,
                              size_t count, const double *number)
{
    json_t *list = ascc_network_put(writer, object, key, json_array());
    for (size_t i = 0; i < count; i++)
        (void)ascc_network_append(writer, list, json_real(number[i]));
}

void ascc_network_add_layer(ascc_network_writer *writer, const char *name, int level, bool walls,
                            int channels)
{
    char points[16];
    json_t *layer =
        ascc_network_append(writer, json_object_get(writer->network, "layers"), json_object());
    (void)snprintf(points, sizeof points, level ? "level%d" : walls ? "all" : "fluid", level);
    ascc_network_put_text(writer, layer, "name", name);
    ascc_network_put_text(writer, layer, "points", points);
    (void)ascc_network_put(writer, layer, "channels", json_integer(channels));
    writer->terms = ascc_network_put(writer, layer, "terms", json_array());
}

json_t *ascc_network_add_term(ascc_network_writer *writer, const char *type, const char *source,
                              bool relu, int column)
{
    json_t *term = ascc_network_append(writer, writer->terms, json_object());
    ascc_network_put_text(writer, term, "type", type);
    ascc_network_put_text(writer, term, "source", source);
    if (relu)
        (void)ascc_network_put(writer, term, "relu", json_true());
    if (column)
        (void)ascc_network_put(writer, term, "column", json_integer(column));
    return term;
}

char *ascc_network_text(const ascc_network_writer *writer)
{
    for (size_t digits = 15; digits <= 17; digits++) {
        char *text = json_dumps(writer->network, JSON_COMPACT | JSON_REAL_PRECISION(digits));
        json_t *again = text ? json_loads(text, 0, NULL) : NULL;
        const bool same = json_equal(again, writer->network) == 1, read = again != NULL;
        json_decref(again);
        if (same)
            return text;
        free(text);
        if (!read)
            break;
    }
    return NULL;
}
