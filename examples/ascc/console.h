/* What the program says: lines that a terminal shows and never obeys, and whether they arrived.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_CONSOLE_H
#define ASCC_CONSOLE_H

#include <stdio.h>

#include "system.h"

/* Prints one line, whatever the texts in it hold: names, descriptions, paths and messages come from
 * files. The newline is added. Texts of the program's own may be printed as they are. */
void ascc_line(FILE *to, const char *format, ...) ASCC_FORMAT(2, 3);

/* From now on lines are dropped: another process prints the same. */
void ascc_console_mute(void);

/* What a terminal would obey and not show, and what is no UTF-8, becomes '?'. */
void ascc_printable(char *text);

/* At the program's end: the exit status, 1 in place of 0 where standard output did not take all. */
int ascc_console_close(int status);

#endif
