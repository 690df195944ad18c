/* Writes the description of a network as model files have it (docs/file-format.md).
 * SPDX-License-Identifier: MIT
 *
 * What is put into something lives there; a function returns it, to be added to, or NULL without
 * memory. Then `failed` stays true, and adding to NULL does nothing: a caller looks once, at the end.
 */
#ifndef ASCC_NETWORK_WRITER_H
#define ASCC_NETWORK_WRITER_H

#include <stdbool.h>
#include <stddef.h>

#include <jansson.h>

typedef struct ascc_network_writer {
    json_t *network; /* an object; the caller's to make and to free */
    json_t *terms;   /* of the layer added last */
    bool failed;
} ascc_network_writer;

/* Into an object under a key, or at the end of a list. */
json_t *ascc_network_put(ascc_network_writer *writer, json_t *object, const char *key,
                         json_t *value);
json_t *ascc_network_append(ascc_network_writer *writer, json_t *list, json_t *value);
void ascc_network_put_text(ascc_network_writer *writer, json_t *object, const char *key,
                           const char *text);
void ascc_network_put_numbers(ascc_network_writer *writer, json_t *object, const char *key,
                              size_t count, const double *number);

/* A layer on the particles, with walls or without, or on a level >= 1; then its terms. */
void ascc_network_add_layer(ascc_network_writer *writer, const char *name, int level, bool walls,
                            int channels);
json_t *ascc_network_add_term(ascc_network_writer *writer, const char *type, const char *source,
                              bool relu, int column);

/* As text that reads back the same, with as few digits as that takes: from malloc, NULL = no memory. */
char *ascc_network_text(const ascc_network_writer *writer);

#endif
