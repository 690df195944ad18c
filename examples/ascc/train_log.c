/* Writes, reads and draws the log of a training run. SPDX-License-Identifier: MIT */
#include "train_log.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

#define COLUMNS(seconds)                                                                           \
    "learning_rate,loss,gradient_norm," seconds ",steps,ended_early,"                              \
    "skipped,err_n1,err_n2,rollout_last,escaped,density_error,stable\n"
static const char HEADER[] = "iteration,stage,unroll,warm_up," COLUMNS("cpu_seconds");
/* The same columns, seconds by the clock on the wall. */
static const char *const OLD_HEADERS[] = {"iteration,stage,unroll,warm_up," COLUMNS("seconds"),
                                          "iteration,stage,horizon,presteps," COLUMNS("seconds")};
enum { FIELDS = 17, SECONDS = 7, ERRORS = 11 };

bool ascc_validation_better(const ascc_validation *a, const ascc_validation *b)
{
    if (!a->measured || !isfinite(a->error[1]))
        return false;
    if (!b->measured || !isfinite(b->error[1]))
        return true;
    return a->stable != b->stable ? a->stable : a->error[1] < b->error[1];
}

static void take(ascc_train_log *log, const ascc_validation *v)
{
    if (!v->measured)
        return;
    log->last = *v;
    if (ascc_validation_better(v, &log->best))
        log->best = *v;
}

/* Fields of a line, empty ones as NaN; false if it is not a whole row. */
static bool parse(const char *line, double field[FIELDS])
{
    const char *c = line;
    for (int i = 0; i < FIELDS; i++) {
        char *end;
        field[i] = strtod(c, &end);
        if (end == c)
            field[i] = NAN;
        if (*end != (i + 1 < FIELDS ? ',' : '\n'))
            return false;
        c = end + 1;
    }
    return isfinite(field[0]);
}

static ascc_validation validation_of(const double field[FIELDS])
{
    const double *v = field + ERRORS;
    return (ascc_validation){.measured = !isnan(v[5]),
                             .error = {v[0], v[1]},
                             .last_frame = v[2],
                             .escaped = v[3],
                             .density_error = v[4],
                             .stable = v[5] == 1.0};
}

/* Reads rows up to `iteration`; the offset behind the last of them, 0 = an empty file, -1 = not a log. */
static long read_rows(FILE *file, uint64_t iteration, ascc_train_log *log)
{
    char line[1024];
    double field[FIELDS];
    if (!fgets(line, sizeof line, file))
        return 0;
    if (strcmp(line, HEADER) != 0 && strcmp(line, OLD_HEADERS[0]) != 0 &&
        strcmp(line, OLD_HEADERS[1]) != 0)
        return -1;
    if (iteration == 0)
        return 0;
    long end = ftell(file);
    while (fgets(line, sizeof line, file) && parse(line, field) && field[0] <= (double)iteration) {
        const ascc_validation v = validation_of(field);
        log->seconds = field[SECONDS];
        take(log, &v);
        end = ftell(file);
    }
    return end;
}

bool ascc_train_log_open(const char *path, uint64_t iteration, ascc_train_log *log, char *error,
                         size_t capacity)
{
    *log = (ascc_train_log){.file = ascc_system_open(path, "r+")};
    if (!log->file && errno == ENOENT)
        log->file = ascc_system_open(path, "w+");
    bool good = log->file != NULL;
    const char *why = NULL;
    if (good) {
        const long end = read_rows(log->file, iteration, log);
        if (end < 0)
            why = "is not the log of a training run, so it is left as it is";
        good = end >= 0 && fflush(log->file) == 0 && ascc_system_cut(log->file, end) &&
               fseek(log->file, end, SEEK_SET) == 0 && (end > 0 || fputs(HEADER, log->file) >= 0) &&
               fflush(log->file) == 0;
    }
    if (!good) {
        (void)snprintf(error, capacity, "%.300s: %s", path, why ? why : strerror(errno));
        ascc_train_log_close(log);
    }
    return good;
}

static void add_number(FILE *file, double value)
{
    if (isfinite(value))
        fprintf(file, ",%.9g", value);
    else
        fputc(',', file);
}

bool ascc_train_log_add(ascc_train_log *log, int32_t stage, const ascc_training_report *r,
                        double seconds, const ascc_validation *v)
{
    FILE *f = log->file;
    log->seconds += seconds;
    fprintf(f, "%" PRIu64 ",%d,%d,%d,%.9g", r->iteration, stage, r->unroll, r->warm_up,
            r->learning_rate);
    add_number(f, r->loss);
    add_number(f, r->gradient_norm);
    fprintf(f, ",%.6f,%.0f,%d,%d", log->seconds, r->steps, r->ended_early, r->skipped);
    if (v->measured) {
        /* All digits: a run that goes on compares with them. */
        for (int i = 0; i < 2; i++)
            if (isfinite(v->error[i]))
                fprintf(f, ",%.17g", v->error[i]);
            else
                fputc(',', f);
        add_number(f, v->last_frame);
        add_number(f, v->escaped);
        add_number(f, v->density_error);
        fprintf(f, ",%d\n", v->stable);
    } else {
        fputs(",,,,,,\n", f);
    }
    take(log, v);
    return fflush(f) == 0 && !ferror(f);
}

void ascc_train_log_close(ascc_train_log *log)
{
    if (log->file)
        (void)fclose(log->file);
    log->file = NULL;
}

/* ---- The chart ------------------------------------------------------------------------------------ */

/* A path in gnuplot's quotes. It takes a first '<' or '|' for a command to run, '-' for its own input. */
static void quoted(FILE *file, const char *path)
{
    fputs(ascc_system_is_absolute(path) ? "'" : "'./", file);
    for (; *path; path++) {
        if (*path == '\'')
            fputc('\'', file);
        fputc(*path, file);
    }
    fputc('\'', file);
}

static void write_script(FILE *g, const char *log, const char *chart, bool validated)
{
    fputs("set terminal svg size 900,640 background 'white'\nset output ", g);
    quoted(g, chart);
    fputs("\nset datafile separator ','\nset key top right\nset grid\nset xrange [0:*]\nset "
          "logscale y\n",
          g);
    fprintf(g, "set multiplot layout %d,1\nset ylabel 'loss, spacings'\n", validated ? 2 : 1);
    if (!validated)
        fputs("set xlabel 'iteration'\n", g);
    fputs("plot ", g);
    quoted(g, log);
    fputs(" every ::1 using 1:6 with dots lc rgb '#9ecae1' notitle, '' every ::1 using 1:6 smooth "
          "bezier lw 2 lc rgb '#08519c' title 'loss'\n",
          g);
    if (validated) {
        fputs("set xlabel 'iteration'\nset ylabel 'mean error, mm'\nplot ", g);
        quoted(g, log);
        fputs(" every ::1 using 1:($12*1000) with points pt 7 ps 0.5 title 'after one frame', '' "
              "every ::1 using 1:($13*1000) with points pt 7 ps 0.5 title 'after two frames'\n",
              g);
    }
    fputs("unset multiplot\n", g);
}

typedef struct chart_job {
    const char *log, *chart;
    bool validated;
} chart_job;

static void write_chart(FILE *gnuplot, const void *data)
{
    const chart_job *job = data;
    write_script(gnuplot, job->log, job->chart, job->validated);
}

bool ascc_train_log_chart(const char *log, const char *chart, bool validated)
{
    const chart_job job = {log, chart, validated};
    return ascc_system_feed("gnuplot", write_chart, &job);
}
