/* The benchmarks' command line, clocks and blocks of particles. SPDX-License-Identifier: MIT
 *
 *     bench all --quick
 *     bench kernel | step | threads | scale | roofline | load   [options]
 */
#include "bench.h"

#include <math.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

static const char usage[] =
    "usage: bench kernel|step|threads|scale|roofline|load|train|all [options]\n"
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

/* ---- Clocks ---- */

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

size_t bench_repeats(const bench_options *options)
{
    const size_t wanted = options->repeats ? (size_t)options->repeats : options->quick ? 3 : 7;
    return wanted < BENCH_REPEATS ? wanted : BENCH_REPEATS;
}

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

/* ---- Particles ---- */

double *bench_block(size_t count, int32_t dimension)
{
    const size_t d = (size_t)dimension;
    const size_t side = (size_t)ceil(pow((double)count, 1.0 / (double)d) - 1e-9);
    double *x = malloc(count * d * sizeof *x);
    if (!x)
        bench_fail("no memory for %zu particles", count);
    uint64_t state = 1;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0, at = i; c < d; c++, at /= side) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            const double jitter = (double)(state >> 33) / 2147483648.0 - 0.5;
            x[i * d + c] = BENCH_SPACING * ((double)(at % side) + 0.4 * jitter);
        }
    return x;
}

ascc_context *bench_context(uint32_t cpu, int32_t threads)
{
    ascc_context *context;
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = threads,
                                          .cpu_disable = ascc_kernels_available() & ~cpu};
    if (ascc_context_create(&options, &context) != ASCC_OK)
        bench_fail("no context with %d threads", threads);
    return context;
}

void bench_field_open(bench_field *f, size_t count, uint32_t cpu)
{
    memset(f, 0, sizeof *f);
    f->context = bench_context(cpu, 1);
    ascc_arena_open(&f->arena, &f->context->allocator);
    f->tools =
        (ascc_search_tools){&f->arena, f->context->workers, &f->context->kernels, &f->message};
    f->scale = ascc_scale_for_radius(2.0 * BENCH_SPACING);
    double *x = bench_block(count, 3);
    for (int c = 0; c < 3; c++) {
        f->host.position[c] = malloc(count * sizeof(int64_t));
        f->host.low[c] = malloc(count * sizeof(int32_t));
        if (!f->host.position[c] || !f->host.low[c])
            bench_fail("no memory for %zu particles", count);
    }
    f->host.count = count;
    for (size_t i = 0; i < count; i++) {
        int64_t at[3];
        for (size_t c = 0; c < 3; c++)
            if (!ascc_scale_apply(&f->scale, x[i * 3 + c], &at[c]))
                bench_fail("a position is out of range");
        ascc_points_set(&f->host, i, at);
    }
    free(x);
    bench_field_search(f);
}

/* All that a step does to find the rows of its particles: order, cells, rows. */
void bench_field_search(bench_field *f)
{
    ascc_arena_reset(&f->arena);
    const size_t count = f->host.count;
    const double radius = 2.0 * BENCH_SPACING * f->scale.inverse;
    uint32_t *order = ascc_arena_take(&f->arena, count, sizeof *order);
    ascc_extent_start(&f->extent);
    ascc_extent_add(&f->extent, &f->host);
    if (!order || !ascc_points_take(&f->points, &f->arena, count) ||
        ascc_points_order(&f->tools, &f->host, &f->extent, ascc_grid_cell(radius), order))
        bench_fail("search: %s", f->message.text);
    for (size_t i = 0; i < count; i++) {
        const int64_t at[3] = {f->host.position[0][order[i]], f->host.position[1][order[i]],
                               f->host.position[2][order[i]]};
        ascc_points_set(&f->points, i, at);
    }
    if (ascc_grid_build(&f->grid, &f->tools, &f->points, &f->extent, radius, true))
        bench_fail("search: %s", f->message.text);
    const size_t expected = f->rows.used;
    f->rows = (ascc_rows){.query = &f->points,
                          .source = &f->points,
                          .query_grid = &f->grid,
                          .source_grid = &f->grid,
                          .radius = radius,
                          .same = true,
                          .max_neighbors = 4096};
    if (ascc_rows_open(&f->rows, &f->tools, expected ? expected + expected / 8 : 32 * count) ||
        ascc_rows_make(&f->rows, &f->tools, NULL))
        bench_fail("search: %s", f->message.text);
}

void bench_field_close(bench_field *f)
{
    for (int c = 0; c < 3; c++) {
        free(f->host.position[c]);
        free(f->host.low[c]);
    }
    ascc_arena_close(&f->arena);
    ascc_context_destroy(&f->context);
}

/* ---- Command line ---- */

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
        bench_fail("%s: no such option\n%s", name, usage);
}

static bench_options read_options(int count, char **arguments)
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

int main(int count, char **arguments)
{
    static const struct {
        const char *name;
        void (*run)(const bench_options *);
    } commands[] = {{"load", bench_load},  {"kernel", bench_kernel},   {"roofline", bench_roofline},
                    {"step", bench_step},  {"threads", bench_threads}, {"scale", bench_scale},
                    {"train", bench_train}};
    const bench_options options = read_options(count, arguments);
    bool known = false;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        if (strcmp(options.command, "all") == 0 || strcmp(options.command, commands[i].name) == 0) {
            commands[i].run(&options);
            known = true;
        }
    if (!known)
        fputs(usage, stderr);
    return known ? 0 : 2;
}
