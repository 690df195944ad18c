/* Cost against accuracy of every method on true sequences, as one CSV file.
 * SPDX-License-Identifier: MIT
 *
 *   chart SHARED OUT.csv [FILE...]
 *
 * FILEs are models, one point each, called by their names. A method or a sequence more is a line in the tables below. What is not there is left out with a line.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include <unistd.h>

#include "evaluate.h"

enum { REPEATS = 5, TIMED = 2, START = 40, MOST_ROWS = 256, MOST_MODELS = 64 };

/* Family (a colour in the chart), label, method; @ is the folder of shared data. */
static const char *const methods[][3] = {
    {"floor", "ballistic", "ballistic"},
    {"network", "DMCF", "@/data/weights/dmcf-liquid3d.safetensors"},
    {"network", "CConv", "@/data/weights/cconv-liquid3d.safetensors"},
    {"network", "demo", "demo"},
    {"SPH", "c 10", "sph:cs=10,contact=-1"},
    {"SPH", "c 20", "sph:cs=20,contact=-1"},
    {"SPH", "c 20, dt/2", "sph:cs=20,contact=-1,courant=0.25"},
    {"SPH", "c 20, dt x 2", "sph:cs=20,contact=-1,courant=1"},
    {"SPH", "c 20, contact", "sph:cs=20"},
    {"SPH", "c 40", "sph:cs=40,contact=-1"},
    {"SPH", "c 20, dx x 1.5", "sph:cs=20,contact=-1,coarse=1.5"},
    {"SPH", "c 20, dx x 2", "sph:cs=20,contact=-1,coarse=2"},
    {"SPH", "c 20, dx x 2, dt/2", "sph:cs=20,contact=-1,coarse=2,courant=0.25"},
    {"SPH", "c 20, dx x 3", "sph:cs=20,contact=-1,coarse=3"},
    {"DFSPH", "20 steps", "dfsph:"},
    {"DFSPH", "10 steps", "dfsph:step=0.002"},
    {"DFSPH", "5 steps", "dfsph:step=0.004"},
    {"DFSPH", "5 steps, 1 %", "dfsph:step=0.004,density=0.01,divergence=0.01"},
    {"PBF", "1 x 4", "pbf:iterations=4"},
    {"PBF", "1 x 16", "pbf:iterations=16"},
    {"PBF", "4 x 1", "pbf:iterations=1,substeps=4"},
    {"PBF", "4 x 2", "pbf:iterations=2,substeps=4"},
    {"PBF", "4 x 4", "pbf:iterations=4,substeps=4"},
    {"PBF", "4 x 8", "pbf:iterations=8,substeps=4"},
    {"PBF", "10 x 2", "pbf:iterations=2,substeps=10"},
};

static const char *const sequences[] = {"@/data/liquid3d/test/test_000.safetensors",
                                        "@/data/liquid3d/general/dam_break.safetensors"};

enum {
    METHODS = sizeof methods / sizeof *methods,
    SEQUENCES = sizeof sequences / sizeof *sequences,
    ERRORS = 3
};

typedef struct row {
    const char *sequence, *family, *label, *method;
    size_t particles;
    double cpu_one, wall_all;          /* us per particle and frame */
    double error[ERRORS];              /* err_n2, Chamfer and density error after one second */
    double density_max, escaped, last; /* figures that come along */
    bool front[ERRORS];
    char note[256];
} row;

typedef struct chart {
    const char *shared;
    size_t frames;
    int32_t cores;
    size_t count;
    row rows[MOST_ROWS];
} chart;

static void expand(const chart *c, const char *text, char *into, size_t capacity)
{
    if (text[0] == '@')
        snprintf(into, capacity, "%s%s", c->shared, text + 1);
    else
        snprintf(into, capacity, "%s", text);
}

/* ---- Cost ------------------------------------------------------------------------------------ */

static double seconds(clockid_t clock)
{
    struct timespec t;
    (void)clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* Median over REPEATS of the time of TIMED frames behind one that warms up, from true frame START. */
static double cost(const ascc_truth *t, const ascc_method *method, const char *settings,
                   int32_t threads, clockid_t clock)
{
    const size_t numbers = t->scene.fluid_count * (size_t)t->scene.dimension;
    const double *now = t->position + START * numbers, *before = now - numbers;
    ascc_method_scene scene = t->scene;
    ascc_method_error why;
    double sample[REPEATS], *velocity = malloc(numbers * sizeof *velocity);
    void *state = NULL;
    size_t done = 0;
    scene.threads = threads;
    for (size_t i = 0; i < numbers && velocity; i++)
        velocity[i] = (now[i] - before[i]) / scene.time_step;
    bool good = velocity && method->open(settings, &scene, &state, &why);
    while (good && done < REPEATS) {
        good = method->set(state, now, velocity, ASCC_VELOCITY_DIFFERENCE, &why) &&
               method->advance(state, &why);
        const double start = seconds(clock);
        for (int k = 0; k < TIMED && good; k++)
            good = method->advance(state, &why);
        sample[done++] = seconds(clock) - start;
    }
    if (state)
        method->close(state);
    free(velocity);
    if (!good)
        return NAN;
    qsort(sample, REPEATS, sizeof *sample, ascending);
    return 1e6 * sample[REPEATS / 2] / TIMED / (double)scene.fluid_count;
}

/* ---- Accuracy -------------------------------------------------------------------------------- */

static double figure(const ascc_report_run *run, const char *name)
{
    for (size_t k = 0; k < run->count; k++)
        if (strcmp(run->figure[k].name, name) == 0)
            return run->figure[k].value;
    return NAN;
}

static bool accuracy(const ascc_truth *t, const ascc_method *method, const char *settings, row *r)
{
    const ascc_evaluate_options options = {.has_frames = true,
                                           .first = 10,
                                           .end = 50,
                                           .step = 10,
                                           .velocity = ASCC_VELOCITY_DIFFERENCE};
    ascc_method_error why;
    ascc_report_run *run = calloc(1, sizeof *run);
    const bool good = run && ascc_evaluate(&options, method, settings, t, run, &why);
    if (good) {
        r->error[0] = figure(run, "err_n2_difference");
        r->error[1] = 0.5 * (figure(run, "chamfer_1s_gt2pred") + figure(run, "chamfer_1s_pred2gt"));
        /* Carried particles (method_coarse.h): nothing keeps them apart or draws them together. */
        const bool carried = strstr(settings, "coarse=") != NULL;
        r->error[2] = carried ? NAN : figure(run, "density_mean_error_1s");
        r->density_max = carried ? NAN : figure(run, "density_max_error_1s");
        r->escaped = figure(run, "escaped_max");
        r->last = figure(run, "last_frame");
        snprintf(r->note, sizeof r->note, "%s", run->note);
    }
    free(run);
    return good;
}

/* ---- All of it ------------------------------------------------------------------------------- */

/* On the front: nothing is both cheaper and better. The floor is not a method to choose. */
static bool leads(const chart *c, const row *r, int error)
{
    if (strcmp(r->family, "floor") == 0 || !(r->error[error] >= 0.0))
        return false;
    for (const row *o = c->rows; o < c->rows + c->count; o++)
        if (o != r && strcmp(o->family, "floor") != 0 && strcmp(o->sequence, r->sequence) == 0 &&
            o->cpu_one <= r->cpu_one && o->error[error] <= r->error[error])
            return false;
    return true;
}

static bool write_csv(const chart *c, const char *path)
{
    FILE *f = fopen(path, "w");
    if (!f)
        return false;
    fputs("sequence,family,label,method,particles,cpu_us_one_thread,wall_us_all_cores,cores,err_n2,"
          "chamfer_1s,density_mean_error_1s,density_max_error_1s,escaped_max,last_frame,"
          "front_err_n2,front_chamfer,front_density,note\n",
          f);
    for (const row *r = c->rows; r < c->rows + c->count; r++) {
        const char *slash = strrchr(r->method, '/'), *name = slash ? slash + 1 : r->method;
        fprintf(f,
                "%s,%s,\"%s\",\"%s\",%zu,%.4g,%.4g,%d,%.6g,%.6g,%.6g,%.6g,%g,%g,%d,%d,%d,\"%s\"\n",
                r->sequence, r->family, r->label, name, r->particles, r->cpu_one, r->wall_all,
                (int)c->cores, r->error[0], r->error[1], r->error[2], r->density_max, r->escaped,
                r->last, r->front[0], r->front[1], r->front[2], r->note);
    }
    return fclose(f) == 0;
}

static void measure(chart *c, const ascc_truth *t, const char *sequence,
                    const char *const method[3])
{
    char word[512];
    const char *settings;
    row *r = &c->rows[c->count];
    expand(c, method[2], word, sizeof word);
    if (strchr(word, '/') && access(word, R_OK) != 0) {
        fprintf(stderr, "chart: no %s: left out\n", word);
        return;
    }
    if (c->count == MOST_ROWS)
        return;
    const ascc_method *how = ascc_method_find(word, &settings);
    *r = (row){.sequence = sequence,
               .family = method[0],
               .label = method[1],
               .method = method[2],
               .particles = t->scene.fluid_count};
    r->cpu_one = cost(t, how, settings, 1, CLOCK_PROCESS_CPUTIME_ID);
    r->wall_all = cost(t, how, settings, c->cores, CLOCK_MONOTONIC);
    if (!accuracy(t, how, settings, r))
        return;
    fprintf(stderr, "%-10s %-8s %-18s %9.3g us %9.3g us  %.5f m  %.4f m  %.4f\n", sequence,
            r->family, r->label, r->cpu_one, r->wall_all, r->error[0], r->error[1], r->error[2]);
    c->count++;
}

/* "some/folder/name.safetensors" is called "name". */
static void name_of(const char *path, char *name, size_t capacity)
{
    const char *slash = strrchr(path, '/');
    slash = slash ? slash + 1 : path;
    snprintf(name, capacity, "%.*s", (int)strcspn(slash, "."), slash);
}

int main(int argc, char **argv)
{
    static chart c = {.frames = 52};
    static char model[MOST_MODELS][64];
    if (argc < 3 || argc > 3 + MOST_MODELS) {
        fprintf(stderr, "usage: chart SHARED OUT.csv [FILE...]\n");
        return 2;
    }
    for (int k = 3; k < argc; k++)
        name_of(argv[k], model[k - 3], sizeof model[k - 3]);
    c.shared = argv[1];
    c.cores = (int32_t)sysconf(_SC_NPROCESSORS_ONLN);
    for (size_t s = 0; s < SEQUENCES; s++) {
        char path[512];
        static char names[SEQUENCES][64];
        ascc_truth t;
        ascc_method_error error;
        expand(&c, sequences[s], path, sizeof path);
        if (!ascc_truth_load(path, c.cores, &t, &error)) {
            fprintf(stderr, "chart: %s: left out\n", error.text);
            continue;
        }
        name_of(path, names[s], sizeof names[s]);
        t.frames = t.frames < c.frames ? t.frames : c.frames;
        if (t.velocity_frames > t.frames)
            t.velocity_frames = t.frames;
        for (size_t m = 0; m < METHODS; m++)
            measure(&c, &t, names[s], methods[m]);
        for (int k = 3; k < argc; k++)
            measure(&c, &t, names[s], (const char *[3]){"network", model[k - 3], argv[k]});
        ascc_truth_free(&t);
    }
    for (row *r = c.rows; r < c.rows + c.count; r++)
        for (int e = 0; e < ERRORS; e++)
            r->front[e] = leads(&c, r, e);
    if (c.count == 0 || !write_csv(&c, argv[2])) {
        fprintf(stderr, "chart: nothing measured, or cannot write %s\n", argv[2]);
        return 1;
    }
    return 0;
}
