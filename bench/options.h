/* The command line of the benchmarks. SPDX-License-Identifier: MIT */
#ifndef BENCH_OPTIONS_H
#define BENCH_OPTIONS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct bench_options {
    const char *command;
    const char *only;             /* kernels whose names hold this text; NULL = all */
    const char *output;           /* folder of the CSV files; NULL = do not write */
    const char *figures;          /* folder of the charts; NULL = do not draw */
    const char *scene, *model;    /* of `step` and `threads`; NULL = the usual */
    const char *shared, *library; /* folder of published networks; libascc.so */
    size_t particles;             /* 0 = the usual */
    int32_t threads, dimension, repeats;
    uint32_t cpu; /* ASCC_CPU_* bits to use, of those that can be */
    bool quick, one_cpu;
} bench_options;

extern const char bench_usage[];

/* Ends the program where the line is wrong. */
bench_options bench_options_read(int count, char **arguments);

/* Of each measurement, at most BENCH_REPEATS. */
#define BENCH_REPEATS 64
size_t bench_repeats(const bench_options *options);

#endif
