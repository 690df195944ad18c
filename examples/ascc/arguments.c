/* What a command line got wrong, in one line: the word, what was meant, where more is told.
 * SPDX-License-Identifier: MIT */
#include "arguments.h"

#include <errno.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "console.h"

enum { LONGEST = 40 };

static size_t least(size_t a, size_t b)
{
    return a < b ? a : b;
}

/* Letters to change, add, drop or swap with the next to get from one word to the other: three rows of the
 * usual table. Of words up to LONGEST. */
static size_t distance(const char *a, const char *b)
{
    size_t row[3][LONGEST + 1];
    const size_t m = strlen(a), n = strlen(b);
    for (size_t j = 0; j <= n; j++)
        row[0][j] = j;
    for (size_t i = 1; i <= m; i++) {
        size_t *now = row[i % 3], *before = row[(i + 2) % 3], *earlier = row[(i + 1) % 3];
        now[0] = i;
        for (size_t j = 1; j <= n; j++) {
            now[j] = least(least(before[j], now[j - 1]) + 1,
                           before[j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                now[j] = least(now[j], earlier[j - 2] + 1);
        }
    }
    return row[m % 3][n];
}

const char *ascc_nearest(const char *word, const char *const *known)
{
    const size_t length = strlen(word);
    const char *nearest = NULL;
    size_t best = (length + 2) / 3 + 1; /* a third of its letters may be wrong */
    if (length > LONGEST)
        return NULL;
    for (; *known; known++) {
        if (!**known || strlen(*known) > LONGEST || strcmp(word, *known) == 0)
            continue;
        const bool begun = length > 2 && strncmp(word, *known, length) == 0;
        const size_t off = begun ? 1 : distance(word, *known);
        if (off < best) {
            best = off;
            nearest = *known;
        }
    }
    return nearest;
}

bool ascc_bad_use(const char *command, const char *what, const char *word, const char *const *known)
{
    const char *space = *command ? " " : "",
               *meant = word && known ? ascc_nearest(word, known) : NULL;
    char end[160];
    if (meant)
        (void)snprintf(end, sizeof end, "did you mean '%s'?", meant);
    else
        (void)snprintf(end, sizeof end, "ascc%s%s --help tells more", space, command);
    ascc_line(stderr, "ascc%s%s: %s%s%s; %s", space, command, what, word ? ": " : "",
              word ? word : "", end);
    return false;
}

bool ascc_bad_option(const char *command, const char *const *known, const char *name,
                     const char *value)
{
    const char *const *at = known;
    while (*at && strcmp(*at, name) != 0)
        at++;
    if (!*at)
        return ascc_bad_use(command, name[0] == '-' ? "unknown option" : "one argument too many",
                            name, name[0] == '-' ? known : NULL);
    if (!value)
        return ascc_bad_use(command, "a value is missing behind", name, NULL);
    ascc_line(stderr, "ascc %s: %s %s: no value that it takes; ascc %s --help tells more", command,
              name, value, command);
    return false;
}

bool ascc_read_whole(const char *command, const char *name, const char *text, long low, long high,
                     int32_t *value)
{
    char *end;
    errno = 0;
    const long n = strtol(text, &end, 10);
    if (errno || *end || end == text || n < low || n > high) {
        ascc_line(stderr, "ascc %s: %s %s: a whole number from %ld to %ld is wanted", command, name,
                  text, low, high);
        return false;
    }
    *value = (int32_t)n;
    return true;
}

bool ascc_read_real(const char *command, const char *name, const char *text, double low,
                    double high, double *value)
{
    char *end;
    const double x = strtod(text, &end);
    if (*end || end == text || !(x >= low && x <= high)) {
        ascc_line(stderr, "ascc %s: %s %s: a number from %g to %g is wanted", command, name, text,
                  low, high);
        return false;
    }
    *value = x;
    return true;
}
