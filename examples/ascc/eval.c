/* `ascc eval`: a method against true sequences.
 * SPDX-License-Identifier: MIT
 *
 * The same input gives the same numbers, for any number of threads.
 */
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "evaluate.h"
#include "new_file.h"
#include "system.h"

enum { MOST_SEQUENCES = 256, COLUMNS = 5 };

typedef struct options {
    ascc_evaluate_options measure;
    const char *method, *json, *csv;
    const char *sequence[MOST_SEQUENCES];
    size_t sequence_count;
    int32_t threads;
    size_t every;
    bool quiet;
} options;

static int usage(void)
{
    fputs("usage: ascc eval METHOD SEQUENCE... [options]\n"
          "  Runs METHOD on true sequences (docs/measures.md says what is measured).\n\n"
          "METHOD\n",
          stdout);
    for (size_t k = 0; ascc_methods[k]; k++)
        fprintf(stdout, "  %s\n", ascc_methods[k]->help);
    fputs("\noptions\n"
          "  --every K          take each K-th frame of the sequences (1)\n"
          "  --threads N        threads to use (1); numbers do not depend on it\n"
          "  --json FILE        figures as JSON\n"
          "  --csv FILE         figures as CSV, one a line\n"
          "  --frames A:B:STEP  start frames of one- and two-frame errors, B not included\n"
          "  --velocity KIND    stored or difference: velocities these start with (both)\n"
          "  --transport        earth mover's distances of the last frame too: minutes\n"
          "  --emd              the exact one of these alone: seconds for a thousand particles\n"
          "  --no-rollout       one- and two-frame errors only\n"
          "  --quiet            no table\n",
          stdout);
    return 0;
}

static bool read_long(const char *text, long least, long *value)
{
    char *end;
    errno = 0;
    *value = strtol(text, &end, 10);
    return end != text && !*end && !errno && *value >= least;
}

static bool read_frames(const char *text, options *o)
{
    char end;
    o->measure.has_frames = true;
    return sscanf(text, "%ld:%ld:%ld%c", &o->measure.first, &o->measure.end, &o->measure.step,
                  &end) == 3 &&
           o->measure.first >= 0 && o->measure.step > 0;
}

/* An option with a value; false if it is none, or its value is not understood. */
static bool read_option(const char *name, const char *value, options *o)
{
    long number;
    if (strcmp(name, "--every") == 0 && read_long(value, 1, &number) && number <= 100000)
        o->every = (size_t)number;
    else if (strcmp(name, "--threads") == 0 && read_long(value, 1, &number) && number <= 1024)
        o->threads = (int32_t)number;
    else if (strcmp(name, "--json") == 0)
        o->json = value;
    else if (strcmp(name, "--csv") == 0)
        o->csv = value;
    else if (strcmp(name, "--velocity") == 0 && strcmp(value, "stored") == 0)
        o->measure.velocity = ASCC_VELOCITY_STORED;
    else if (strcmp(name, "--velocity") == 0 && strcmp(value, "difference") == 0)
        o->measure.velocity = ASCC_VELOCITY_DIFFERENCE;
    else
        return strcmp(name, "--frames") == 0 && read_frames(value, o);
    return true;
}

static bool read_arguments(int argc, char **argv, options *o)
{
    static const char *const names[] = {"--every",      "--threads",  "--json",      "--csv",
                                        "--frames",     "--velocity", "--transport", "--emd",
                                        "--no-rollout", "--quiet",    NULL};
    for (int i = 0; i < argc; i++) {
        if (strcmp(argv[i], "--emd") == 0)
            o->measure.emd = true;
        else if (strcmp(argv[i], "--transport") == 0)
            o->measure.transport = true;
        else if (strcmp(argv[i], "--quiet") == 0)
            o->quiet = true;
        else if (strcmp(argv[i], "--no-rollout") == 0)
            o->measure.no_rollout = true;
        else if (argv[i][0] == '-') {
            if (i + 1 == argc || !read_option(argv[i], argv[i + 1], o))
                return ascc_bad_option("eval", names, argv[i], argv[i + 1]);
            i++;
        } else if (!o->method)
            o->method = argv[i];
        else if (o->sequence_count < MOST_SEQUENCES)
            o->sequence[o->sequence_count++] = argv[i];
        else
            return ascc_bad_use("eval", "one sequence too many", argv[i], NULL);
    }
    return (o->method && o->sequence_count) ||
           ascc_bad_use("eval", "a METHOD and a SEQUENCE are wanted", NULL, NULL);
}

/* "some/folder/name.safetensors" is called "folder/name". */
static void name_sequence(const char *path, char *name, size_t capacity)
{
    const char *start = path + strlen(path);
    for (int slashes = 0; start > path; start--)
        if (start[-1] == '/' && ++slashes == 2)
            break;
    snprintf(name, capacity, "%s", start);
    char *end = strrchr(name, '.');
    if (end && strcmp(end, ".safetensors") == 0)
        *end = 0;
}

static bool write_reports(const options *o, const ascc_report_run *runs)
{
    const size_t n = o->sequence_count;
    if (!o->quiet)
        ascc_report_table(stdout, o->method, runs, n, COLUMNS);
    char error[512];
    const bool good =
        (!o->json || ascc_report_json(o->json, o->method, runs, n, error, sizeof error)) &&
        (!o->csv || ascc_report_csv(o->csv, o->method, runs, n, error, sizeof error));
    if (!good)
        ascc_line(stderr, "ascc eval: %s", error);
    return good;
}

/* Told before the work what would fail after it. */
static bool check_reports(const options *o)
{
    char error[512];
    const bool good = (!o->json || ascc_new_file_check(o->json, error, sizeof error)) &&
                      (!o->csv || ascc_new_file_check(o->csv, error, sizeof error));
    if (!good)
        ascc_line(stderr, "ascc eval: %s", error);
    return good;
}

/* What a run failed of. A word that is no method's is a model's: where there is none, the method that was
 * probably meant is told. */
static void print_failure(const char *sequence, const ascc_method *method, const char *word,
                          const char *why)
{
    enum { MOST = 16 };
    const char *known[MOST + 2] = {"demo"}, *meant = NULL;
    for (size_t k = 0; k < MOST && ascc_methods[k]; k++)
        known[k + 1] = ascc_methods[k]->prefix;
    if (!method->prefix[0] && !ascc_system_there(word))
        meant = ascc_nearest(word, known);
    ascc_line(stderr, "ascc eval: %s: %s%s%s%s", sequence, why, meant ? "; did you mean '" : "",
              meant ? meant : "", meant ? "'?" : "");
}

int ascc_command_eval(int argc, char **argv)
{
    options o = {.threads = 1, .every = 1, .measure.velocity = -1};
    if (argc == 1 && strcmp(argv[0], "--help") == 0)
        return usage();
    if (!read_arguments(argc, argv, &o))
        return 2;
    const char *settings;
    const ascc_method *method = ascc_method_find(o.method, &settings);
    if (!method) {
        ascc_line(stderr, "ascc eval: %s: no such method", o.method);
        return 2;
    }
    if (!check_reports(&o))
        return 1;
    ascc_report_run *runs = calloc(o.sequence_count, sizeof *runs);
    bool fine = runs != NULL;
    for (size_t k = 0; k < o.sequence_count && fine; k++) {
        ascc_truth t;
        ascc_method_error error = {""};
        name_sequence(o.sequence[k], runs[k].sequence, sizeof runs[k].sequence);
        const bool loaded = ascc_truth_load(o.sequence[k], o.threads, &t, &error);
        fine = loaded;
        if (fine) {
            ascc_truth_thin(&t, o.every);
            fine = ascc_evaluate(&o.measure, method, settings, &t, &runs[k], &error);
            ascc_truth_free(&t);
        }
        if (!fine && loaded)
            print_failure(o.sequence[k], method, o.method, error.text);
        else if (!fine)
            ascc_line(stderr, "ascc eval: %s", error.text); /* has the path */
    }
    fine = fine && write_reports(&o, runs);
    free(runs);
    return fine ? 0 : 1;
}
