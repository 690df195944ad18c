/* What the benchmarks share: clock, spread, tables, the machine, a block of particles.
 * SPDX-License-Identifier: MIT */
#ifndef BENCH_H
#define BENCH_H

#include <ascc/ascc.h>

#include <stdbool.h>
#include <stdio.h>

#include "network/network.h"

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

/* Seconds of CPU time of this thread: other programs on the machine are not in it. */
double bench_seconds(void);
/* Of all threads of the process. */
double bench_process_seconds(void);
double bench_wall_seconds(void);
/* While set, the library's own laps are in CPU time of the calling thread too. */
extern bool bench_laps_in_cpu_time;

typedef struct bench_spread {
    double median, min, max;
} bench_spread;

#define BENCH_REPEATS 64 /* at most */

/* Sorts values[count]. */
bench_spread bench_spread_of(double *values, size_t count);
size_t bench_repeats(const bench_options *options);

/* ---- The machine ---- */

/* Instruction sets that this CPU can run and this build has, weakest first. */
typedef struct bench_isa {
    const char *name;
    uint32_t cpu;                          /* ASCC_CPU_* bits of a context */
    double (*multiply_add)(size_t rounds); /* returns the flops done */
    void (*triad)(float *a, const float *b, const float *c, size_t n); /* a = b + 3 c */
} bench_isa;

size_t bench_isas(const bench_isa **isas);
/* The best multiply-adds per second that the machine does now, GFLOP/s, over some milliseconds. */
double bench_peak(void);
/* Triad bandwidth with three arrays of this many bytes in all, GB/s. */
double bench_bandwidth(size_t bytes);

/* ---- Output: a CSV file and the same lines on stdout ---- */

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

/* Ends the program with a line. */
_Noreturn void bench_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

/* ---- Particles ---- */

#define BENCH_SPACING 0.05

/* Positions [count][dimension] of a jittered cube or square; free() it. */
double *bench_block(size_t count, int32_t dimension);

/* A block with its neighbour rows of radius 0.1, as a layer reads them. */
typedef struct bench_field {
    ascc_context *context;
    ascc_arena arena;
    ascc_message message;
    ascc_search_tools tools;
    ascc_scale scale;
    ascc_points host, points; /* as given; in cell order */
    ascc_extent extent;
    ascc_grid grid;
    ascc_rows rows;
} bench_field;

void bench_field_open(bench_field *field, size_t count, uint32_t cpu);
void bench_field_search(bench_field *field);
void bench_field_close(bench_field *field);

ascc_context *bench_context(uint32_t cpu, int32_t threads);

/* ---- The commands ---- */

typedef struct bench_result {
    bench_spread seconds, share;
    double flops;
} bench_result;

/* Times work(data) of so many useful flops, each repeat with its own measurement of the peak.
 * move(data), if given, moves arrays to other pages before each repeat: which pages an array got tells
 * in the second cache. */
bench_result bench_measure(const bench_options *options, void (*work)(void *), void (*move)(void *),
                           void *data, double flops);

void bench_kernel(const bench_options *options);
void bench_roofline(const bench_options *options);
void bench_step(const bench_options *options);
void bench_threads(const bench_options *options);
void bench_scale(const bench_options *options);
void bench_load(const bench_options *options);
void bench_train(const bench_options *options);

/* The antisymmetric layer 32 -> 3, kernel 6x6x6, on a block: the library's with integer sums, and a
 * twin that sums floats. */
typedef struct bench_pairs bench_pairs;
bench_pairs *bench_pairs_open(size_t count, uint32_t cpu);
void bench_pairs_exact(void *pairs);
void bench_pairs_float(void *pairs);
size_t bench_pairs_count(const bench_pairs *pairs);
/* What the momenta of the twin's floats add up to, over the sum of their magnitudes. */
double bench_pairs_drift(const bench_pairs *pairs);
void bench_pairs_close(bench_pairs *pairs);

#endif
