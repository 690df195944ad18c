/* Time, the spread of repeats, and the end of a program that cannot go on.
 * SPDX-License-Identifier: MIT */
#ifndef BENCH_CLOCK_H
#define BENCH_CLOCK_H

#include <stdbool.h>
#include <stddef.h>

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

/* Sorts values[count]. */
bench_spread bench_spread_of(double *values, size_t count);

/* Ends the program with a line. */
_Noreturn void bench_fail(const char *format, ...) __attribute__((format(printf, 1, 2)));

#endif
