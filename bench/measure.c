/* Repeats of a piece of work. SPDX-License-Identifier: MIT */
#include "measure.h"

#include "machine.h"

bench_result bench_measure(const bench_options *options, void (*work)(void *), void (*move)(void *),
                           void *data, double flops)
{
    double seconds[BENCH_REPEATS], share[BENCH_REPEATS];
    const size_t repeats = bench_repeats(options);
    double begin = bench_seconds();
    work(data); /* warms up, and tells how many calls a repeat needs */
    const double once = bench_seconds() - begin, enough = options->quick ? 0.01 : 0.1;
    const size_t calls = once < enough ? (size_t)(enough / (once + 1e-7)) + 1 : 1;
    for (size_t r = 0; r < repeats; r++) {
        if (move) {
            move(data);
            work(data);
        }
        begin = bench_seconds();
        for (size_t i = 0; i < calls; i++)
            work(data);
        seconds[r] = (bench_seconds() - begin) / (double)calls;
        share[r] = flops / seconds[r] * 1e-9 / bench_peak();
    }
    return (bench_result){bench_spread_of(seconds, repeats), bench_spread_of(share, repeats),
                          flops};
}
