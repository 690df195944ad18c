/* Reads the command line. SPDX-License-Identifier: MIT */
#include "options.h"

#include <stdlib.h>
#include <string.h>

#include "clock.h"
#include "kernels/kernels.h"

const char bench_usage[] =
    "usage: bench kernel|step|threads|scale|roofline|load|train|bodies|pool|all [options]\n"
    "  --quick             smaller scenes, fewer repeats\n"
    "  --only TEXT         kernels whose names hold the text\n"
    "  --scene NAME        block, dam-break, still-column, droplets, free-fall or a sequence file\n"
    "  --model NAME        demo, tiny, a file, or dmcf, cconv: the published networks\n"
    "  --shared DIR        where the published networks are (../shared)\n"
    "  --dimension 2|3     --particles N     --threads N     --repeats N\n"
    "  --cpu BITS          instruction sets to use: 0 portable, 1 AVX2, 3 and AVX-512, 4 NEON\n"
    "  --library FILE      the shared library whose size `load` tells\n"
    "  --output DIR        where CSV files go (bench/results), none: nowhere\n"
    "  --figures DIR       where charts go (docs/figures), none: nowhere\n";

static long whole(const char *name, const char *text)
{
    char *end;
    const long value = text ? strtol(text, &end, 10) : -1;
    if (!text || *end || end == text || value < 0 || value > 100000000)
        bench_fail("%s: a whole number is wanted", name);
    return value;
}

static void read_option(bench_options *o, const char *name, const char *value)
{
    const struct {
        const char *name;
        const char **text;
    } texts[] = {{"--only", &o->only},      {"--scene", &o->scene},     {"--model", &o->model},
                 {"--shared", &o->shared},  {"--library", &o->library}, {"--output", &o->output},
                 {"--figures", &o->figures}};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++)
        if (strcmp(name, texts[i].name) == 0) {
            if (!value)
                bench_fail("value is missing behind: %s", name);
            *texts[i].text = value;
            return;
        }
    const long number = whole(name, value);
    if (strcmp(name, "--particles") == 0)
        o->particles = (size_t)number;
    else if (strcmp(name, "--threads") == 0)
        o->threads = (int32_t)number;
    else if (strcmp(name, "--repeats") == 0)
        o->repeats = (int32_t)number;
    else if (strcmp(name, "--dimension") == 0 && (number == 2 || number == 3))
        o->dimension = (int32_t)number;
    else if (strcmp(name, "--cpu") == 0) {
        o->cpu = (uint32_t)number;
        o->one_cpu = true;
    } else
        bench_fail("%s: no such option\n%s", name, bench_usage);
}

bench_options bench_options_read(int count, char **arguments)
{
    bench_options o = {.command = count > 1 ? arguments[1] : "",
                       .output = "bench/results",
                       .figures = "docs/figures",
                       .shared = "../shared",
                       .threads = 1,
                       .dimension = 3,
                       .cpu = ascc_kernels_available()};
    for (int i = 2; i < count; i++)
        if (strcmp(arguments[i], "--quick") == 0)
            o.quick = true;
        else {
            read_option(&o, arguments[i], i + 1 < count ? arguments[i + 1] : NULL);
            i++;
        }
    if (o.cpu & ~ascc_kernels_available())
        bench_fail("--cpu %u: this machine has only %u", o.cpu, ascc_kernels_available());
    if (strcmp(o.output, "none") == 0)
        o.output = NULL;
    if (strcmp(o.figures, "none") == 0)
        o.figures = NULL;
    return o;
}

size_t bench_repeats(const bench_options *options)
{
    const size_t wanted = options->repeats ? (size_t)options->repeats : options->quick ? 3 : 7;
    return wanted < BENCH_REPEATS ? wanted : BENCH_REPEATS;
}
