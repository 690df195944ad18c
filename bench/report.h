/* Tables as CSV files and on standard output, and charts of them. SPDX-License-Identifier: MIT */
#ifndef BENCH_REPORT_H
#define BENCH_REPORT_H

#include <stdio.h>

#include "options.h"

typedef struct bench_table {
    FILE *file;
} bench_table;

/* The file is OUTPUT/<cpu>_<bits>/NAME.csv; a header tells machine, version, compiler, load. */
bench_table bench_table_open(const bench_options *options, const char *name, const char *note,
                             const char *columns);
void bench_row(bench_table *table, const char *format, ...) __attribute__((format(printf, 2, 3)));
void bench_table_close(bench_table *table);
/* Runs gnuplot over script, once for SVG, once for PNG. %DATA% in it becomes the table's file; the
 * variable cpu names the machine. */
void bench_chart(const bench_options *options, const char *name, int width, int height,
                 const char *script);

#endif
