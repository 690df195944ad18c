/* Every method in every scene where methods fail: a matrix of pass, or when and how it failed.
 * SPDX-License-Identifier: MIT
 *
 *   stability [--quick] [--shared DIR] [--docs DIR] [--scenes 'A;B'] [--methods 'A;B']
 *             [--model FILE]... [--dimension 2] [--frames N] [--minutes M] [--budget SECONDS]
 *             [--jobs N] [--keep FILE]
 *
 * The whole may take M minutes on idle cores. A cell may use four times its part of the time that is left,
 * since most end early, the last ones a third of it. Scenes of few frames come first, so the long ones get
 * nearly all; in a scene the methods at the end of the table, which are cheap, and models given.
 * With --keep a run that was stopped goes on: cells that the file has are taken from there, others added.
 */
#define _DEFAULT_SOURCE /* MAP_ANONYMOUS, getloadavg */
#include <glob.h>
#include <math.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "evaluate.h"
#include "kept.h"
#include "suite.h"

/* Name, method; @ is the folder of shared data, whose models are in 3D. */
static const char *const methods[][2] = {
    {"DMCF", "@/data/weights/dmcf-liquid3d.safetensors"},
    {"CConv", "@/data/weights/cconv-liquid3d.safetensors"},
    {"demo", "demo"},
    {"SPH", "sph:cs=25"},
    {"SPH, step x 8", "sph:cs=25,courant=4"},
    {"DFSPH", "dfsph:"},
    {"PBF", "pbf:iterations=4,substeps=4"},
    {"ballistic", "ballistic"},
};

enum { METHODS = sizeof methods / sizeof *methods, MOST_METHODS = 32, MOST_SCENES = 64 };

typedef struct suite {
    const char *shared, *docs, *only_scenes, *only_methods, *keep;
    bool quick;
    int dimension;
    long frames;
    double minutes; /* of all processes together, idle cores */
    double budget;  /* CPU seconds of every cell instead, or 0 */
    int jobs;
    size_t scene_count, method_count, model_count;
    size_t order[MOST_SCENES]; /* scenes, those of few frames first */
    const stability_scene *scene[MOST_SCENES];
    const char *method[MOST_METHODS], *model[MOST_METHODS];
    char words[MOST_METHODS][512], names[MOST_METHODS][64];
} suite;

/* What the processes share. */
typedef struct board {
    atomic_size_t next, ended;
    atomic_llong spent; /* CPU microseconds of the cells that ended */
    cell cells[MOST_SCENES][MOST_METHODS];
    double seconds[MOST_SCENES][MOST_METHODS];
} board;

/* ---- What to run ----------------------------------------------------------------------------- */

static bool listed(const char *list, const char *name)
{
    const size_t length = strlen(name);
    for (const char *at = list; at && *at; at += strcspn(at, ";"), at += *at == ';')
        if (strcspn(at, ";") == length && memcmp(at, name, length) == 0)
            return true;
    return !list;
}

static long frames_of(const suite *s, const stability_scene *scene)
{
    return s->frames > 0 ? s->frames : s->quick ? scene->quick : scene->full;
}

static void choose_scenes(suite *s)
{
    for (const stability_scene *scene = stability_scenes; scene->name; scene++) {
        size_t k = s->scene_count;
        if (k == MOST_SCENES || !listed(s->only_scenes, scene->name))
            continue;
        s->scene[s->scene_count++] = scene;
        for (; k > 0 && frames_of(s, s->scene[s->order[k - 1]]) > frames_of(s, scene); k--)
            s->order[k] = s->order[k - 1];
        s->order[k] = s->scene_count - 1;
    }
}

static void add_method(suite *s, const char *name, const char *word)
{
    char *into = s->words[s->method_count];
    if (s->method_count == MOST_METHODS)
        return;
    snprintf(into, sizeof *s->words, "%s", word);
    snprintf(s->names[s->method_count], sizeof *s->names, "%s", name);
    s->method[s->method_count] = s->names[s->method_count];
    s->method_count++;
}

static void add_model(suite *s, const char *path)
{
    s->model[s->model_count++] = path;
}

/* Files given with --model run whatever --methods names; "some/folder/name.safetensors" is `name`. */
static void choose_methods(suite *s)
{
    for (size_t m = 0; m < METHODS; m++) {
        const bool shared = methods[m][1][0] == '@';
        char path[512];
        snprintf(path, sizeof path, "%s%s", s->shared, methods[m][1] + 1);
        if (!listed(s->only_methods, methods[m][0]) || (shared && s->dimension == 2))
            continue;
        if (shared && access(path, R_OK) != 0)
            fprintf(stderr, "stability: %s: no %s, left out\n", methods[m][0], path);
        else
            add_method(s, methods[m][0], shared ? path : methods[m][1]);
    }
    /* The project's own models, as the chart has them; kept until the end. */
    static glob_t own;
    if (!s->only_methods && !s->model_count &&
        glob(s->dimension == 2 ? "examples/models/*2d*.safetensors"
                               : "examples/models/*3d*.safetensors",
             0, NULL, &own) == 0)
        while (s->model_count < own.gl_pathc && s->model_count < MOST_METHODS)
            add_model(s, own.gl_pathv[s->model_count]);
    for (size_t k = 0; k < s->model_count; k++) {
        const char *slash = strrchr(s->model[k], '/');
        char name[64];
        snprintf(name, sizeof name, "%s", slash ? slash + 1 : s->model[k]);
        name[strcspn(name, ".")] = 0;
        add_method(s, name, s->model[k]);
    }
}

/* ---- Running --------------------------------------------------------------------------------- */

/* CPU seconds for the next cell. */
static double share(const suite *s, const board *b)
{
    const size_t cells = s->scene_count * s->method_count - atomic_load(&b->ended);
    const double left = 60.0 * s->minutes * s->jobs - 1e-6 * (double)atomic_load(&b->spent);
    return s->budget > 0.0 ? s->budget
                           : left / fmax(0.25 * (double)cells, fmin((double)cells, 3.0 * s->jobs));
}

static void run_cell(const suite *s, board *b, size_t i, size_t j)
{
    cell *c = &b->cells[i][j];
    *c = (cell){.dimension = s->dimension,
                .frames = frames_of(s, s->scene[i]),
                .budget = share(s, b),
                .start = (double)clock() / CLOCKS_PER_SEC};
    c->method = ascc_method_find(s->words[j], &c->settings);
    if (!s->keep || !kept_find(s->keep, s->scene[i]->name, s->method[j], c, &b->seconds[i][j])) {
        s->scene[i]->run(c);
        b->seconds[i][j] = (double)clock() / CLOCKS_PER_SEC - c->start;
        if (s->keep && !kept_add(s->keep, s->scene[i]->name, s->method[j], c, b->seconds[i][j]))
            fprintf(stderr, "stability: cannot write to %s\n", s->keep);
    }
    atomic_fetch_add(&b->spent, (long long)(1e6 * b->seconds[i][j]));
    atomic_fetch_add(&b->ended, 1);
}

static void verdict_text(const cell *c, char *text, size_t capacity)
{
    if (c->verdict == FAIL)
        snprintf(text, capacity, "frame %ld of %ld: %s", c->frame, c->frames, c->text);
    else if (c->verdict == CUT)
        snprintf(text, capacity, "no failure in %ld of %ld", c->frame, c->frames);
    else if (c->verdict == NONE)
        snprintf(text, capacity, "%s", c->text);
    else
        snprintf(text, capacity, "pass: %ld of %ld%s%s", c->frame, c->frames,
                 c->text[0] ? ", " : "", c->text);
}

static void work(const suite *s, board *b)
{
    const size_t count = s->scene_count * s->method_count;
    for (size_t k; (k = atomic_fetch_add(&b->next, 1)) < count;) {
        char text[256];
        const size_t i = s->order[k / s->method_count];
        const size_t j = s->method_count - 1 - k % s->method_count;
        run_cell(s, b, i, j);
        verdict_text(&b->cells[i][j], text, sizeof text);
        printf("%-18s %-14s %6.1f s  %s\n", s->scene[i]->name, s->method[j], b->seconds[i][j],
               text);
        fflush(stdout);
    }
}

/* A method that crashes takes one process along; its cell says so. */
static bool run_all(const suite *s, board *b)
{
    bool good = true;
    for (size_t i = 0; i < s->scene_count; i++)
        for (size_t j = 0; j < s->method_count; j++)
            b->cells[i][j] = (cell){.verdict = FAIL, .text = "crashed, or was not run"};
    fflush(stdout);
    for (int k = 0; k < s->jobs; k++)
        if (fork() == 0) {
            work(s, b);
            _exit(0);
        }
    for (int status; wait(&status) > 0;)
        good = good && WIFEXITED(status);
    return good;
}

/* ---- Documents ------------------------------------------------------------------------------- */

/* Between these is what a run writes. */
static const char *const marks[2][2] = {
    {"<!-- matrix begins -->", "<!-- matrix ends -->"},
    {"<!-- flat matrix begins -->", "<!-- flat matrix ends -->"},
};

static void cpu_name(char *name, size_t capacity)
{
    char line[256];
    FILE *f = fopen("/proc/cpuinfo", "r");
    snprintf(name, capacity, "an unknown CPU");
    while (f && fgets(line, sizeof line, f))
        if (strncmp(line, "model name", 10) == 0 && strchr(line, ':')) {
            snprintf(name, capacity, "%.*s", (int)strcspn(strchr(line, ':') + 2, "\n"),
                     strchr(line, ':') + 2);
            break;
        }
    if (f)
        fclose(f);
}

static void write_table(FILE *f, const suite *s, const board *b)
{
    char text[256];
    fputs("| scene |", f);
    for (size_t j = 0; j < s->method_count; j++)
        fprintf(f, " %s |", s->method[j]);
    fputs("\n|---|", f);
    for (size_t j = 0; j < s->method_count; j++)
        fputs("---|", f);
    for (size_t i = 0; i < s->scene_count; i++) {
        fprintf(f, "\n| %s |", s->scene[i]->name);
        for (size_t j = 0; j < s->method_count; j++) {
            verdict_text(&b->cells[i][j], text, sizeof text);
            fprintf(f, b->cells[i][j].verdict == PASS ? " **%s** |" : " %s |", text);
        }
    }
    fputc('\n', f);
}

static void write_markdown(FILE *f, const suite *s, const board *b)
{
    char cpu[128], date[32];
    double load[3] = {NAN, NAN, NAN};
    const time_t now = time(NULL);
    (void)getloadavg(load, 3);
    (void)strftime(date, sizeof date, "%Y-%m-%d", gmtime(&now));
    cpu_name(cpu, sizeof cpu);
    fprintf(
        f,
        "%s\n%s run in %dD of %s, %s, %d process%s of one thread, load %.1f: %.1f minutes of CPU "
        "time, of ",
        marks[s->dimension == 2][0], s->quick ? "The quick" : "The full", s->dimension, date, cpu,
        s->jobs, s->jobs > 1 ? "es" : "", load[0], 1e-6 / 60.0 * (double)atomic_load(&b->spent));
    if (s->budget > 0.0)
        fprintf(f, "%.0f s for each cell.\n\n", s->budget);
    else
        fprintf(f, "%.0f that it may take.\n\n", s->minutes * s->jobs);
    write_table(f, s, b);
    fputs("\n| scene | passes when | frames, quick | full |\n|---|---|---|---|\n", f);
    for (size_t i = 0; i < s->scene_count; i++)
        fprintf(f, "| %s | %s | %ld | %ld |\n", s->scene[i]->name, s->scene[i]->line,
                s->scene[i]->quick, s->scene[i]->full);
    fputs("\n| method | is |\n|---|---|\n", f);
    for (size_t j = 0; j < s->method_count; j++) {
        const char *slash = strrchr(s->words[j], '/');
        fprintf(f, "| %s | `%s` |\n", s->method[j], slash ? slash + 1 : s->words[j]);
    }
    fprintf(f, "%s\n", marks[s->dimension == 2][1]);
}

/* The text of an SVG element, without what XML minds. */
static void svg_text(FILE *f, int x, int y, const char *style, const char *text, size_t most)
{
    fprintf(f, "<text x=\"%d\" y=\"%d\" %s>", x, y, style);
    for (size_t k = 0; text[k] && k < most; k++)
        if (text[k] == '<')
            fputs("&lt;", f);
        else if (text[k] == '&')
            fputs("&amp;", f);
        else
            fputc(text[k], f);
    fputs("</text>\n", f);
}

static void write_svg(FILE *f, const suite *s, const board *b)
{
    enum { WIDE = 190, HIGH = 38, LEFT = 140, TOP = 34 };
    static const char *const colour[] = {"#b7e1b0", "#f4b6ae", "#f7e6a4", "#e4e4e4"};
    const int width = LEFT + WIDE * (int)s->method_count + 10,
              height = TOP + HIGH * (int)s->scene_count + 34;
    fprintf(f,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"%d\" height=\"%d\" "
            "font-family=\"sans-serif\" font-size=\"11\">\n<rect width=\"%d\" height=\"%d\" "
            "fill=\"white\"/>\n",
            width, height, width, height);
    for (size_t j = 0; j < s->method_count; j++)
        svg_text(f, LEFT + WIDE * (int)j + WIDE / 2, 22,
                 "text-anchor=\"middle\" font-weight=\"bold\" font-size=\"13\"", s->method[j], 40);
    for (size_t i = 0; i < s->scene_count; i++) {
        const int y = TOP + HIGH * (int)i;
        svg_text(f, LEFT - 8, y + HIGH / 2 + 4, "text-anchor=\"end\" font-size=\"13\"",
                 s->scene[i]->name, 40);
        for (size_t j = 0; j < s->method_count; j++) {
            const cell *c = &b->cells[i][j];
            const int x = LEFT + WIDE * (int)j;
            char first[64];
            fprintf(f,
                    "<rect x=\"%d\" y=\"%d\" width=\"%d\" height=\"%d\" rx=\"3\" fill=\"%s\"/>\n",
                    x + 1, y + 1, WIDE - 2, HIGH - 2, colour[c->verdict]);
            if (c->verdict == FAIL)
                snprintf(first, sizeof first, "failed: frame %ld of %ld", c->frame, c->frames);
            else if (c->verdict == CUT)
                snprintf(first, sizeof first, "out of time, no failure");
            else if (c->verdict == NONE)
                snprintf(first, sizeof first, "not asked");
            else
                snprintf(first, sizeof first, "pass");
            svg_text(f, x + 7, y + 16, c->verdict == PASS ? "font-weight=\"bold\"" : "", first, 40);
            if (c->verdict == FAIL || c->verdict == NONE)
                snprintf(first, sizeof first, "%.60s", c->text);
            else
                snprintf(first, sizeof first, "%ld of %ld frames", c->frame, c->frames);
            svg_text(f, x + 7, y + 30, "fill=\"#444\"", first, 36);
        }
    }
    svg_text(
        f, LEFT, height - 12, "fill=\"#444\"",
        "green: pass; red: failed; yellow: the time given ran out before all frames, without a "
        "failure until then",
        200);
    fputs("</svg>\n", f);
}

/* Replaces what stands between the marks of docs/stability.md; the words around it stay. */
static bool write_documents(const suite *s, const board *b)
{
    char path[600];
    static char old[1 << 20];
    snprintf(path, sizeof path, "%s/stability.md", s->docs);
    FILE *f = fopen(path, "r");
    old[f ? fread(old, 1, sizeof old - 1, f) : 0] = 0;
    if (f)
        fclose(f);
    const char *const *mark = marks[s->dimension == 2];
    char *begin = strstr(old, mark[0]), *end = strstr(old, mark[1]);
    f = fopen(path, "w");
    if (!f)
        return false;
    if (begin && end)
        fwrite(old, 1, (size_t)(begin - old), f);
    write_markdown(f, s, b);
    if (begin && end)
        fputs(end + strlen(mark[1]) + 1, f);
    bool good = fclose(f) == 0;
    snprintf(path, sizeof path, "%s/figures/stability%s.svg", s->docs,
             s->dimension == 2 ? "2d" : "");
    f = fopen(path, "w");
    if (!f)
        return false;
    write_svg(f, s, b);
    return fclose(f) == 0 && good;
}

/* ---- Arguments ------------------------------------------------------------------------------- */

static bool read_option(suite *s, const char *name, const char *value)
{
    if (strcmp(name, "--shared") == 0)
        s->shared = value;
    else if (strcmp(name, "--docs") == 0)
        s->docs = value;
    else if (strcmp(name, "--keep") == 0)
        s->keep = value;
    else if (strcmp(name, "--scenes") == 0)
        s->only_scenes = value;
    else if (strcmp(name, "--methods") == 0)
        s->only_methods = value;
    else if (strcmp(name, "--model") == 0 && s->model_count < MOST_METHODS)
        add_model(s, value);
    else if (strcmp(name, "--dimension") == 0)
        return (s->dimension = (int)strtol(value, NULL, 10)) == 2 || s->dimension == 3;
    else if (strcmp(name, "--frames") == 0)
        return (s->frames = strtol(value, NULL, 10)) > 0;
    else if (strcmp(name, "--minutes") == 0)
        return (s->minutes = strtod(value, NULL)) > 0.0;
    else if (strcmp(name, "--budget") == 0)
        return (s->budget = strtod(value, NULL)) > 0.0;
    else if (strcmp(name, "--jobs") == 0)
        return (s->jobs = (int)strtol(value, NULL, 10)) > 0;
    else
        return false;
    return true;
}

int main(int argc, char **argv)
{
    static suite s = {.shared = "../shared", .dimension = 3};
    s.jobs = (int)sysconf(_SC_NPROCESSORS_ONLN);
    for (int i = 1; i < argc; i++) {
        if (strcmp(argv[i], "--quick") == 0) {
            s.quick = true;
            continue;
        }
        if (i + 1 == argc || !read_option(&s, argv[i], argv[i + 1])) {
            fputs("usage: stability [--quick] [--shared DIR] [--docs DIR] [--scenes 'A;B']\n"
                  "                 [--methods 'A;B'] [--model FILE]... [--dimension 2] [--frames "
                  "N]\n"
                  "                 [--minutes M] [--budget SECONDS] [--jobs N] [--keep FILE]\n",
                  stderr);
            return 2;
        }
        i++;
    }
    (void)setenv("ASCC_MODEL_PATH", "examples/models", 0); /* pbf3d, pbf2d: the models below */
    if (!(s.minutes > 0.0))
        s.minutes = s.quick ? 2.5 : 55.0;
    choose_scenes(&s);
    choose_methods(&s);
    board *b = mmap(NULL, sizeof *b, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (b == MAP_FAILED || s.scene_count == 0 || s.method_count == 0) {
        fputs("stability: nothing to run, or no memory\n", stderr);
        return 1;
    }
    bool good = run_all(&s, b);
    if (s.docs && !write_documents(&s, b)) {
        fprintf(stderr, "stability: cannot write into %s\n", s.docs);
        good = false;
    }
    return good ? 0 : 1;
}
