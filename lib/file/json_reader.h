/* Takes typed members out of a JSON object; the first fault sticks and names the key.
 * SPDX-License-Identifier: MIT
 *
 * After a fault every further call returns an empty result, so that a caller may read a whole
 * object and ask for the status once. ascc_reader_end refuses the members nobody asked for.
 */
#ifndef ASCC_JSON_READER_H
#define ASCC_JSON_READER_H

#include "json.h"

typedef struct ascc_reader {
    ascc_json *json;
    ascc_message *message;
    ascc_status status;
    char where[64]; /* begins every message */
} ascc_reader;

void ascc_reader_where(ascc_reader *reader, const char *format, ...) ASCC_PRINTF(2, 3);
ascc_status ascc_reader_fail(ascc_reader *reader, const char *format, ...) ASCC_PRINTF(2, 3);

/* The member is there; asking does not mark it as used. */
bool ascc_reader_has(const ascc_reader *reader, uint32_t object, const char *key);

/* Required members. Numbers must lie in [low, high]. */
uint32_t ascc_reader_object(ascc_reader *reader, uint32_t object, const char *key);
uint32_t ascc_reader_array(ascc_reader *reader, uint32_t object, const char *key);
const char *ascc_reader_text(ascc_reader *reader, uint32_t object, const char *key);
double ascc_reader_number(ascc_reader *reader, uint32_t object, const char *key, double low,
                          double high);
int32_t ascc_reader_integer(ascc_reader *reader, uint32_t object, const char *key, int32_t low,
                            int32_t high);
bool ascc_reader_flag(ascc_reader *reader, uint32_t object, const char *key);
/* Members that need not be there: false, 0, NULL. */
bool ascc_reader_optional_flag(ascc_reader *reader, uint32_t object, const char *key);
int32_t ascc_reader_optional_integer(ascc_reader *reader, uint32_t object, const char *key);
const char *ascc_reader_optional_text(ascc_reader *reader, uint32_t object, const char *key);
/* Exactly `count` numbers. */
void ascc_reader_numbers(ascc_reader *reader, uint32_t object, const char *key, int32_t count,
                         double low, double high, double *numbers);
/* Index of the text among `count` choices. */
int32_t ascc_reader_choice(ascc_reader *reader, uint32_t object, const char *key,
                           const char *const *choices, int32_t count);

/* Refuses members that were not read. */
void ascc_reader_end(ascc_reader *reader, uint32_t object);

#endif
