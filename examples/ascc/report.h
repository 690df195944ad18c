/* Named figures of several runs: as a table, as JSON, as CSV.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_REPORT_H
#define ASCC_REPORT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

#include "system.h"

enum { ASCC_REPORT_FIGURES = 96 };

typedef struct ascc_figure {
    char name[40];
    double value; /* NaN = none; null in JSON, empty in CSV */
} ascc_figure;

/** One run of one method on one sequence. */
typedef struct ascc_report_run {
    char sequence[128];
    char note[256]; /* why it stopped, or "" */
    size_t count;
    ascc_figure figure[ASCC_REPORT_FIGURES];
} ascc_report_run;

/** Adds a figure; the name is formatted. */
void ascc_report_add(ascc_report_run *run, double value, const char *name, ...) ASCC_FORMAT(3, 4);

/** Rows are figures, columns are runs, `columns` at a time. */
void ascc_report_table(FILE *file, const char *method, const ascc_report_run *runs, size_t count,
                       size_t columns);
/* Both: false with one line in error. */
/** {"method": ..., "runs": [{"sequence": ..., "note": ..., figures}]}; numbers read back exactly. */
bool ascc_report_json(const char *path, const char *method, const ascc_report_run *runs,
                      size_t count, char *error, size_t capacity);
/** One line a figure: method,sequence,figure,value. */
bool ascc_report_csv(const char *path, const char *method, const ascc_report_run *runs,
                     size_t count, char *error, size_t capacity);

#endif
