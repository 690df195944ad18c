/* Tables and charts. SPDX-License-Identifier: MIT */
#include "report.h"

#include <ctype.h>
#include <errno.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <ascc/ascc.h>

#include "clock.h"
#include "kernels/kernels.h"
#include "machine.h"

static void folder_name(const char *output, char *path, size_t capacity)
{
    char name[256];
    const bench_isa *isas;
    const size_t last = bench_isas(&isas) - 1;
    bench_cpu_name(name, sizeof name);
    for (char *c = name; *c; c++)
        *c = isalnum((unsigned char)*c) ? (char)tolower((unsigned char)*c) : '-';
    (void)snprintf(path, capacity, "%s/%s_%s", output, name, isas[last].name);
}

/* ---- Tables ---- */

static void make_folder(const char *path)
{
    char part[1024];
    (void)snprintf(part, sizeof part, "%s", path);
    for (char *c = part + 1;; c++) {
        const char end = *c;
        if (end != '/' && end != '\0')
            continue;
        *c = '\0';
        if (mkdir(part, 0777) != 0 && errno != EEXIST)
            bench_fail("%s: %s", part, strerror(errno));
        *c = end;
        if (end == '\0')
            return;
    }
}

static void header(bench_table *table, const bench_options *o, const char *note)
{
    char cpu[256], load[64] = "unknown";
    bench_cpu_name(cpu, sizeof cpu);
    FILE *file = fopen("/proc/loadavg", "r");
    if (file && fgets(load, sizeof load, file)) /* "1.00 2.00 3.00 ..." */
        load[strcspn(load, " ")] = '\0';
    if (file)
        fclose(file);
    const int32_t version = ascc_version();
    bench_row(table, "# cpu: %s, %ld cores, ASCC_CPU bits %u", cpu, sysconf(_SC_NPROCESSORS_ONLN),
              ascc_kernels_available());
    bench_row(table, "# ascc %d.%d.%d, %s, threads: %d, load average at start: %s", version / 10000,
              version / 100 % 100, version % 100,
#ifdef __clang__
              "clang " __clang_version__,
#else
              "gcc " __VERSION__,
#endif
              o->threads, load);
    bench_row(table, "# repeats: %zu%s; FMA peak now: %.1f GFLOP/s; %s", bench_repeats(o),
              o->quick ? " (quick)" : "", bench_peak(), note);
}

bench_table bench_table_open(const bench_options *o, const char *name, const char *note,
                             const char *columns)
{
    bench_table table = {NULL};
    char path[1024];
    if (o->output) {
        folder_name(o->output, path, sizeof path - 64);
        make_folder(path);
        (void)snprintf(path + strlen(path), 64, "/%s.csv", name);
        table.file = fopen(path, "w");
        if (!table.file)
            bench_fail("%s: %s", path, strerror(errno));
    }
    header(&table, o, note);
    bench_row(&table, "%s", columns);
    return table;
}

void bench_row(bench_table *table, const char *format, ...)
{
    char line[1024];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    puts(line);
    fflush(stdout);
    if (table->file)
        fprintf(table->file, "%s\n", line);
}

void bench_table_close(bench_table *table)
{
    if (table->file && fclose(table->file) != 0)
        bench_fail("a table could not be written");
    table->file = NULL;
}

/* ---- Charts ---- */

/* Writes script with %DATA% replaced. */
static void put_script(FILE *to, const char *script, const char *data)
{
    static const char mark[] = "%DATA%";
    for (const char *found; (found = strstr(script, mark)) != NULL;
         script = found + sizeof mark - 1)
        fprintf(to, "%.*s%s", (int)(found - script), script, data);
    fputs(script, to);
}

void bench_chart(const bench_options *o, const char *name, int width, int height,
                 const char *script)
{
    char data[1024], cpu[256];
    const bench_isa *isas;
    const size_t best = bench_isas(&isas) - 1;
    bench_cpu_name(cpu, sizeof cpu);
    if (!o->figures || !o->output)
        return;
    make_folder(o->figures);
    folder_name(o->output, data, sizeof data - 64);
    (void)snprintf(data + strlen(data), 64, "/%s.csv", name);
    static const char *const kinds[][2] = {{"svg", "svg noenhanced"},
                                           {"png", "pngcairo noenhanced"}};
    for (int k = 0; k < 2; k++) {
        FILE *plot = popen("gnuplot", "w");
        if (!plot) {
            fputs("bench: no gnuplot, no chart\n", stderr);
            return;
        }
        fprintf(plot,
                "set terminal %s size %d,%d font 'DejaVu Sans,13' background '#ffffff'\n"
                "set output '%s/%s.%s'\nset datafile separator ','\n"
                "set datafile commentschars '#'\ncpu = '%s (%s)'\n",
                kinds[k][1], width, height, o->figures, name, kinds[k][0], cpu, isas[best].name);
        put_script(plot, script, data);
        if (pclose(plot) != 0)
            fprintf(stderr, "bench: gnuplot did not draw %s.%s\n", name, kinds[k][0]);
    }
}
