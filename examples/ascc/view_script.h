/* What is done in a window, read from a file: to show the same again, and for tests.
 * SPDX-License-Identifier: MIT
 *
 *     FRAME key K | press X Y | move X Y | release X Y | wheel N | picture FILE | quit
 *
 * One a line, frames counted from 0 and in order; lines that begin with # are notes. */
#ifndef ASCC_VIEW_SCRIPT_H
#define ASCC_VIEW_SCRIPT_H

#include "window.h"

typedef struct ascc_script_line {
    long frame;
    ascc_input input;
    char *picture; /* a file to write instead, or NULL */
} ascc_script_line;

typedef struct ascc_script {
    ascc_script_line *line;
    size_t count, next;
} ascc_script;

/* False with one line in error that has file and line. ascc_script_free either way. */
bool ascc_script_read(ascc_script *script, const char *path, char *error, size_t capacity);
void ascc_script_free(ascc_script *script);

/* The next line that is due at this frame, or NULL. */
const ascc_script_line *ascc_script_due(ascc_script *script, long frame);

#endif
