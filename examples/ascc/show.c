/* ascc show: pictures of a sequence's frames. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "new_file.h"
#include "picture.h"
#include "progress.h"

typedef struct options {
    const char *sequence, *folder;
    size_t every;
} options;

static int usage(void)
{
    fprintf(stdout, "usage: ascc show SEQUENCE -o DIR [--every K]\n\n"
                    "Writes every K-th frame (1) as a PNG picture.\n");
    return 0;
}

static bool read_option(options *o, const char *name, const char *value)
{
    static const char *const names[] = {"-o", "--every", NULL};
    char *end = NULL;
    if (value && strcmp(name, "-o") == 0)
        return (o->folder = value) != NULL;
    if (value && strcmp(name, "--every") == 0) {
        const long k = strtol(value, &end, 10);
        if (!*end && end != value && k >= 1) {
            o->every = (size_t)k;
            return true;
        }
    }
    return ascc_bad_option("show", names, name, value);
}

static bool read_arguments(options *o, int argc, char **argv)
{
    for (int i = 0; i < argc; i++)
        if (argv[i][0] != '-' && !o->sequence)
            o->sequence = argv[i];
        else if (!read_option(o, argv[i], argv[i + 1])) /* argv ends with NULL */
            return false;
        else
            i++;
    return (o->sequence && o->folder) ||
           ascc_bad_use("show", "a SEQUENCE and -o DIR are wanted", NULL, NULL);
}

static bool show(const options *o, const ascc_sequence *s, char *error, size_t capacity)
{
    if (!ascc_make_folder(o->folder, error, capacity))
        return false;
    const size_t n = s->count * (size_t)s->dimension;
    float *v = malloc((n + 1) * sizeof *v);
    if (!v) {
        (void)snprintf(error, capacity, "no memory for %zu particles", s->count);
        return false;
    }
    const ascc_view view = ascc_view_of(s);
    ascc_progress progress;
    ascc_progress_start(&progress, "drawing", (s->frames + o->every - 1) / o->every);
    bool good = true;
    for (size_t f = 0; good && f < s->frames; f += o->every) {
        char path[600], text[96];
        ascc_sequence_velocities(s, f, v);
        (void)snprintf(path, sizeof path, "%s/frame_%05zu.png", o->folder, f);
        (void)snprintf(text, sizeof text, "t = %.3f s   frame %zu   %zu particles",
                       (double)f * s->time_step, f, s->count);
        good = ascc_picture_write(path, &view, s->position + f * n, v, s->count, text, error,
                                  capacity);
        ascc_progress_add(&progress, 1);
    }
    ascc_progress_end(&progress);
    free(v);
    return good;
}

int ascc_command_show(int argc, char **argv)
{
    options o = {.every = 1};
    if (argc == 1 && strcmp(argv[0], "--help") == 0)
        return usage();
    if (!read_arguments(&o, argc, argv))
        return 2;
    ascc_sequence s;
    char error[768];
    if (!ascc_sequence_read(o.sequence, &s, error, sizeof error)) {
        ascc_line(stderr, "ascc show: %s", error);
        return 1;
    }
    const bool good = show(&o, &s, error, sizeof error);
    if (!good)
        ascc_line(stderr, "ascc show: %s", error);
    ascc_sequence_free(&s);
    return good ? 0 : 1;
}
