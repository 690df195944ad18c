/* Cells in a file, so that a run goes on where an earlier one was stopped. SPDX-License-Identifier: MIT */
#include "kept.h"

#include <stdio.h>
#include <string.h>

enum { LINE = 512 };

/* What a line begins with: the cell that it is of. Returns its length. */
static size_t key(char line[LINE], const char *scene, const char *method, const cell *c)
{
    const int length =
        snprintf(line, LINE, "%s\t%s\t%d\t%ld\t", scene, method, c->dimension, c->frames);
    return length > 0 && length < LINE ? (size_t)length : 0;
}

bool kept_find(const char *path, const char *scene, const char *method, cell *c, double *seconds)
{
    char line[LINE], wanted[LINE];
    const size_t length = key(wanted, scene, method, c);
    bool found = false;
    FILE *f = fopen(path, "r");
    while (f && length > 0 && !found && fgets(line, sizeof line, f)) {
        int ended = 0, text = 0;
        line[strcspn(line, "\n")] = 0;
        found = strncmp(line, wanted, length) == 0 &&
                sscanf(line + length, "%d\t%ld\t%lf\t%n", &ended, &c->frame, seconds, &text) == 3 &&
                text > 0 && ended >= PASS && ended <= NONE;
        if (found) {
            c->verdict = (enum verdict)ended;
            snprintf(c->text, sizeof c->text, "%.*s", (int)sizeof c->text - 1,
                     line + length + text);
        }
    }
    if (f)
        fclose(f);
    return found;
}

bool kept_add(const char *path, const char *scene, const char *method, const cell *c,
              double seconds)
{
    char line[LINE];
    const size_t length = key(line, scene, method, c);
    FILE *f = length > 0 ? fopen(path, "a") : NULL;
    if (!f)
        return false;
    snprintf(line + length, sizeof line - length, "%d\t%ld\t%.1f\t%s\n", (int)c->verdict, c->frame,
             seconds, c->text);
    fputs(line, f); /* one write: it is shorter than the buffer */
    return fclose(f) == 0;
}
