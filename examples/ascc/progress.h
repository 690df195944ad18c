/* A progress bar on stderr, silent when that is no terminal. SPDX-License-Identifier: MIT */
#ifndef ASCC_PROGRESS_H
#define ASCC_PROGRESS_H

#include <stdbool.h>
#include <stddef.h>

typedef struct ascc_progress {
    const char *label;
    size_t done, total;
    size_t before;         /* done in an earlier run: without influence on the rate */
    double started, drawn; /* s */
    double work,
        work_left; /* set for unlike pieces: done in this run, and to do; 0 = all are alike */
    bool visible;
} ascc_progress;

/* The label is kept, not copied: its text may change while the bar is shown. */
void ascc_progress_start(ascc_progress *progress, const char *label, size_t total);
void ascc_progress_add(ascc_progress *progress, size_t count);
/* Clears the line. */
void ascc_progress_end(ascc_progress *progress);

#endif
