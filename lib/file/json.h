/* Reads JSON text from untrusted bytes into a flat list of values. SPDX-License-Identifier: MIT
 *
 * Strict: no duplicate keys, no trailing garbage, valid UTF-8, no NUL in strings, bounded depth and
 * number of values. Numbers are converted by exact integer arithmetic, rounded to nearest even,
 * whatever the host's locale.
 *
 *   {"a": [1, 2]}   values: 0 object, 1 array "a", 2 number 1, 3 number 2
 *                   first member of 0 is 1, of 1 is 2; `next` of 2 is 3
 */
#ifndef ASCC_JSON_H
#define ASCC_JSON_H

#include "base/memory.h"

#define ASCC_JSON_MAX_DEPTH 32
#define ASCC_JSON_MAX_VALUES ((size_t)1 << 18)
#define ASCC_JSON_MAX_DIGITS 64 /* significant ones of a number */

typedef enum ascc_json_kind {
    ASCC_JSON_NULL,
    ASCC_JSON_FALSE,
    ASCC_JSON_TRUE,
    ASCC_JSON_NUMBER,
    ASCC_JSON_STRING,
    ASCC_JSON_ARRAY,
    ASCC_JSON_OBJECT,
} ascc_json_kind;

typedef struct ascc_json_value {
    ascc_json_kind kind;
    uint32_t parent;
    uint32_t next;    /* sibling; 0 = none */
    uint32_t count;   /* members of an array or object */
    uint32_t last;    /* member; 0 = none */
    uint32_t used;    /* ascc_json_find found it */
    const char *name; /* key within an object, else "" */
    const char *text; /* of a string, else "" */
    double number;
    int64_t integer;     /* of a number written without fraction and exponent, if it fits */
    uint32_t is_integer; /* `integer` holds it */
    uint32_t reserved;
} ascc_json_value;

typedef struct ascc_json {
    ascc_allocator allocator;
    ascc_json_value *value; /* [0] is the text's one value */
    size_t count, capacity;
    char *text; /* decoded strings, each ended by NUL */
    size_t text_size;
} ascc_json;

/* Reads text[size]; errors: FORMAT with the offset of the fault, MEMORY. On error nothing is held. */
ascc_status ascc_json_open(const ascc_allocator *allocator, const char *text, size_t size,
                           ascc_json *json, ascc_message *message);
void ascc_json_close(ascc_json *json);

/* First member of an array or object, 0 = none. */
uint32_t ascc_json_first(const ascc_json *json, uint32_t parent);
/* The member of that name, marked as used; 0 = none. */
uint32_t ascc_json_find(ascc_json *json, uint32_t object, const char *name);

/* Reads the number that text begins with: its length, 0 = none. text ends with NUL. */
size_t ascc_json_number(const char *text, double *number);

/* Untrusted text made fit for one line of a message. */
typedef struct ascc_quoted {
    char text[72];
} ascc_quoted;
ascc_quoted ascc_quote(const char *text);

#endif
