/* Times a piece of work against the peak of the same moment. SPDX-License-Identifier: MIT */
#ifndef BENCH_MEASURE_H
#define BENCH_MEASURE_H

#include "clock.h"
#include "options.h"

typedef struct bench_result {
    bench_spread seconds, share;
    double flops;
} bench_result;

/* Times work(data) of so many useful flops, each repeat with its own measurement of the peak.
 * move(data), if given, moves arrays to other pages before each repeat: which pages an array got tells
 * in the second cache. */
bench_result bench_measure(const bench_options *options, void (*work)(void *), void (*move)(void *),
                           void *data, double flops);

#endif
