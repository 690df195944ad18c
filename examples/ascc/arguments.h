/* What a command line got wrong, in one line: the word, what was meant, where more is told.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_ARGUMENTS_H
#define ASCC_ARGUMENTS_H

#include <stdbool.h>
#include <stdint.h>

/* The word of a NULL-terminated list that was probably meant: one begun but not finished, or a few letters
 * away. NULL if none is near. */
const char *ascc_nearest(const char *word, const char *const *known);

/* Tells on stderr that an option is none of those known, with the nearest; or that its value is missing
 * (NULL), or wrong. False, for the caller to return. */
bool ascc_bad_option(const char *command, const char *const *known, const char *name,
                     const char *value);

/* "ascc COMMAND: WHAT: WORD; did you mean 'NEAREST'?" on stderr, or without a near one where more is told.
 * WORD and known may be NULL. False. */
bool ascc_bad_use(const char *command, const char *what, const char *word,
                  const char *const *known);

/* The value of an option in [low, high]; false and a line on stderr where it is none. */
bool ascc_read_whole(const char *command, const char *name, const char *text, long low, long high,
                     int32_t *value);
bool ascc_read_real(const char *command, const char *name, const char *text, double low,
                    double high, double *value);

#endif
