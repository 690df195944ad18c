/* The benchmarks: one command or all. SPDX-License-Identifier: MIT
 *
 *     bench all --quick
 *     bench kernel | step | threads | scale | roofline | load | train | bodies | pool   [options]
 */
#include "bench.h"

#include <string.h>

int main(int count, char **arguments)
{
    static const struct {
        const char *name;
        void (*run)(const bench_options *);
    } commands[] = {
        {"load", bench_load},   {"kernel", bench_kernel},   {"roofline", bench_roofline},
        {"step", bench_step},   {"threads", bench_threads}, {"scale", bench_scale},
        {"train", bench_train}, {"bodies", bench_bodies},   {"pool", bench_pool}};
    const bench_options options = bench_options_read(count, arguments);
    bool known = false;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        if (strcmp(options.command, "all") == 0 || strcmp(options.command, commands[i].name) == 0) {
            commands[i].run(&options);
            known = true;
        }
    if (!known)
        fputs(bench_usage, stderr);
    return known ? 0 : 2;
}
