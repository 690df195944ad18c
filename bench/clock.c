/* Clocks, spreads, failure. SPDX-License-Identifier: MIT */
#include "clock.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

_Noreturn void bench_fail(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    fputs("bench: ", stderr);
    (void)vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    va_end(arguments);
    exit(1);
}

static double seconds_of(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double bench_seconds(void)
{
    return seconds_of(CLOCK_THREAD_CPUTIME_ID);
}

double bench_process_seconds(void)
{
    return seconds_of(CLOCK_PROCESS_CPUTIME_ID);
}

double bench_wall_seconds(void)
{
    return seconds_of(CLOCK_MONOTONIC_RAW);
}

bool bench_laps_in_cpu_time;

/* The linker sends the library's readings of the clock here. */
int __real_clock_gettime(clockid_t clock, struct timespec *t);
int __wrap_clock_gettime(clockid_t clock, struct timespec *t);

#ifdef BENCH_WRAPS_CLOCK
int __wrap_clock_gettime(clockid_t clock, struct timespec *t)
{
    const bool swap = bench_laps_in_cpu_time && clock == CLOCK_MONOTONIC;
    return __real_clock_gettime(swap ? CLOCK_THREAD_CPUTIME_ID : clock, t);
}
#endif

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

bench_spread bench_spread_of(double *values, size_t count)
{
    qsort(values, count, sizeof *values, ascending);
    const double middle = 0.5 * (values[(count - 1) / 2] + values[count / 2]);
    return (bench_spread){middle, values[0], values[count - 1]};
}
