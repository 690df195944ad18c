/* Takes typed members out of JSON objects; the first fault sticks and names the key.
 * SPDX-License-Identifier: MIT
 *
 * A member that was taken is gone from its object, so that ascc_members_end can refuse what nobody
 * asked for. After a fault every further call returns an empty result: a caller may read a whole
 * object and look at `error` once.
 */
#ifndef ASCC_MEMBERS_H
#define ASCC_MEMBERS_H

#include <stdbool.h>
#include <stddef.h>

#include <jansson.h>

#include "system.h"

typedef struct ascc_members {
    json_t *taken;   /* a list that keeps alive what was taken; the caller's to make and to free */
    char where[64];  /* begins every message */
    char error[256]; /* "" = no fault so far */
} ascc_members;

void ascc_members_where(ascc_members *members, const char *format, ...) ASCC_FORMAT(2, 3);
void ascc_members_fail(ascc_members *members, const char *format, ...) ASCC_FORMAT(2, 3);
bool ascc_members_good(const ascc_members *members);

/* Required members. Numbers must lie in [low, high]. Objects and lists are NULL after a fault. */
json_t *ascc_members_object(ascc_members *members, json_t *object, const char *key);
json_t *ascc_members_array(ascc_members *members, json_t *object, const char *key);
const char *ascc_members_text(ascc_members *members, json_t *object, const char *key);
double ascc_members_number(ascc_members *members, json_t *object, const char *key, double low,
                           double high);
int ascc_members_integer(ascc_members *members, json_t *object, const char *key, int low, int high);
bool ascc_members_flag(ascc_members *members, json_t *object, const char *key);
/* Exactly `count` numbers; what does not fit leaves its place as it was, so that all stay within the bounds. */
void ascc_members_numbers(ascc_members *members, json_t *object, const char *key, size_t count,
                          double low, double high, double *numbers);

/* Refuses members that were not taken. */
void ascc_members_end(ascc_members *members, json_t *object);

#endif
