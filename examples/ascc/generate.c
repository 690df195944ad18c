/* ascc generate: sequences of random scenes, by the reference solvers. SPDX-License-Identifier: MIT */
#include <errno.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "flow.h"
#include "new_file.h"
#include "progress.h"
#include "recipes.h"
#include "sequence.h"
#include "system.h"

typedef struct request {
    const char *kind, *directory;
    recipe_options recipe;
    long count, threads;
    bool all_velocities;
} request;

/* What the threads share. */
typedef struct job {
    const request *request;
    int32_t solver_threads;
    pthread_mutex_t lock;
    long next, made, kept, failed;
    ascc_progress progress;
} job;

static void usage(void)
{
    fprintf(
        stdout,
        "usage: ascc generate KIND -o DIR [--seed S] [--count N] [--threads T] [--frames F]\n"
        "                     [--dimension 2|3] [--spacing METRES] [--all-velocities]\n"
        "                     [--solver dfsph|sph] [--interval SECONDS] [--gravity TIMES]\n\n"
        "Writes DIR/KIND_S_0000.safetensors and on. Files that exist are kept, so that the same\n"
        "command goes on where it was stopped. The same seed gives the same bytes for any T.\n"
        "dfsph, the default, is DFSPH as the given 3D sequences were made with; sph is weakly\n"
        "compressible SPH. --interval is the time between frames, --gravity a factor of the "
        "kind's.\n\n");
    for (size_t k = 0; recipe_kinds[k][0]; k++)
        fprintf(stdout, "  %-13s %s\n", recipe_kinds[k][0], recipe_kinds[k][1]);
}

/* ---- One sequence ---- */

static float *to_floats(const double *values, size_t count)
{
    float *floats = malloc((count ? count : 1) * sizeof *floats);
    for (size_t i = 0; floats && i < count; i++)
        floats[i] = (float)values[i];
    return floats;
}

static void describe(const request *q, const recipe *r, const flow *f, const wall_points *walls,
                     ascc_sequence *s)
{
    char solver[400];
    *s = (ascc_sequence){.dimension = r->dimension,
                         .time_step = r->frame,
                         .radius = 0.5 * r->spacing,
                         .mass = flow_mass(f),
                         .rest_density = 1000.0,
                         .count = r->count,
                         .walls = walls->count,
                         .first_layer = walls->layer_count[0],
                         .walls_move = flow_walls_move(f)};
    memcpy(s->gravity, r->gravity, sizeof s->gravity);
    flow_describe(f, walls, solver, sizeof solver);
    (void)snprintf(s->source, sizeof s->source,
                   "ascc generate %s, seed %llu, number %llu; %s; scene: %s", q->kind,
                   (unsigned long long)q->recipe.seed, (unsigned long long)r->number, solver,
                   r->text);
}

static bool write_frames(const request *q, const recipe *r, flow *solver, size_t wall_count,
                         ascc_sequence_writer *writer, char *error, size_t capacity)
{
    const size_t values = r->count * (size_t)r->dimension,
                 walls = wall_count * (size_t)r->dimension;
    float *frame = malloc(2 * (values + walls) * sizeof *frame), *wall = frame + 2 * values;
    bool good = frame != NULL;
    if (!good)
        (void)snprintf(error, capacity, "no memory for a frame");
    for (int32_t f = 0; f < r->frames && good; f++) {
        if (f > 0 && flow_advance(solver, r->frame) != ASCC_OK) {
            (void)snprintf(error, capacity, "frame %d: %s", (int)f, flow_message(solver));
            good = false;
            break;
        }
        flow_read(solver, frame);
        good = ascc_sequence_append(
            writer, frame, f == 0 || q->all_velocities ? frame + values : NULL, error, capacity);
        if (good && flow_walls_move(solver)) {
            flow_read_walls(solver, wall, wall + walls);
            good = ascc_sequence_append_walls(writer, wall, wall + walls, error, capacity);
        }
    }
    free(frame);
    return good;
}

static bool make_sequence(const request *q, const char *path, uint64_t number, int32_t threads,
                          char *error, size_t capacity)
{
    recipe_options options = q->recipe;
    options.number = number;
    recipe r;
    flow *solver;
    wall_points walls;
    (void)snprintf(error, capacity, "no memory for the scene");
    if (recipe_make(q->kind, &options, &r) != ASCC_OK)
        return false;
    if (flow_create(&r, threads, &solver, &walls) != ASCC_OK) {
        recipe_free(&r);
        return false;
    }
    ascc_sequence header;
    describe(q, &r, solver, &walls, &header);
    header.wall = to_floats(walls.position, walls.count * (size_t)r.dimension);
    header.normal = to_floats(walls.normal, walls.count * (size_t)r.dimension);
    bool good = header.wall && header.normal;
    ascc_sequence_writer *writer =
        good ? ascc_sequence_create(path, &header, q->all_velocities, error, capacity) : NULL;
    good = writer && write_frames(q, &r, solver, walls.count, writer, error, capacity);
    if (writer) {
        char late[256];
        const bool finished = ascc_sequence_finish(writer, good, late, sizeof late);
        if (good && !finished)
            (void)snprintf(error, capacity, "%s", late);
        good = good && finished;
    }
    free(header.wall);
    free(header.normal);
    flow_destroy(&solver);
    wall_points_free(&walls);
    recipe_free(&r);
    return good;
}

/* ---- All of them ---- */

static void *work(void *data)
{
    job *j = data;
    const request *q = j->request;
    for (;;) {
        pthread_mutex_lock(&j->lock);
        const long number = j->next++;
        pthread_mutex_unlock(&j->lock);
        if (number >= q->count)
            return NULL;
        char path[4096], error[512] = "";
        (void)snprintf(path, sizeof path, "%s/%s_%llu_%04ld.safetensors", q->directory, q->kind,
                       (unsigned long long)q->recipe.seed, number);
        const bool there = ascc_system_there(path);
        const bool good = there || make_sequence(q, path, (uint64_t)number, j->solver_threads,
                                                 error, sizeof error);
        pthread_mutex_lock(&j->lock);
        j->kept += there;
        j->made += good && !there;
        j->failed += !good;
        if (!good)
            ascc_line(stderr, "ascc generate: %s: %s", path, error);
        ascc_progress_add(&j->progress, 1);
        pthread_mutex_unlock(&j->lock);
    }
}

static int generate(const request *q)
{
    char error[512];
    if (!ascc_make_folder(q->directory, error, sizeof error)) {
        ascc_line(stderr, "ascc generate: %s", error);
        return 1;
    }
    const long teams = q->threads < q->count ? q->threads : q->count;
    job j = {.request = q, .solver_threads = (int32_t)(q->threads / teams)};
    pthread_mutex_init(&j.lock, NULL);
    ascc_progress_start(&j.progress, q->kind, (size_t)q->count);
    pthread_t thread[256];
    long started = 1;
    while (started < teams && pthread_create(&thread[started], NULL, work, &j) == 0)
        started++;
    (void)work(&j);
    for (long t = 1; t < started; t++)
        pthread_join(thread[t], NULL);
    ascc_progress_end(&j.progress);
    pthread_mutex_destroy(&j.lock);
    ascc_line(stdout, "%s: %ld made, %ld there already, %ld failed", q->directory, j.made, j.kept,
              j.failed);
    return j.failed ? 1 : 0;
}

/* ---- Arguments ---- */

static bool read_integer(const char *text, long low, long high, long *value)
{
    char *end;
    errno = 0;
    *value = strtol(text, &end, 10);
    return *text && !*end && errno == 0 && *value >= low && *value <= high;
}

/* Takes the option at argv[0] and its value at argv[1]; false if either is wrong. */
static bool take_option(request *q, const char *name, const char *value)
{
    long n;
    char *end;
    if (strcmp(name, "-o") == 0) {
        q->directory = value;
        return true;
    }
    if (strcmp(name, "--seed") == 0) {
        errno = 0;
        q->recipe.seed = strtoull(value, &end, 10);
        return *value >= '0' && *value <= '9' && !*end && errno == 0;
    }
    if (strcmp(name, "--count") == 0)
        return read_integer(value, 1, 1000000, &q->count);
    if (strcmp(name, "--threads") == 0)
        return read_integer(value, 1, 256, &q->threads);
    if (strcmp(name, "--frames") == 0 && read_integer(value, 1, 1000000, &n)) {
        q->recipe.frames = (int32_t)n;
        return true;
    }
    if (strcmp(name, "--dimension") == 0 && read_integer(value, 2, 3, &n)) {
        q->recipe.dimension = (int32_t)n;
        return true;
    }
    if (strcmp(name, "--solver") == 0) {
        q->recipe.solver = strcmp(value, "sph") == 0 ? RECIPE_SPH : RECIPE_DFSPH;
        return strcmp(value, "sph") == 0 || strcmp(value, "dfsph") == 0;
    }
    if (strcmp(name, "--interval") == 0) {
        q->recipe.frame = strtod(value, &end);
        return *value && !*end && q->recipe.frame > 1e-6 && q->recipe.frame < 1e3;
    }
    if (strcmp(name, "--gravity") == 0) {
        q->recipe.gravity = strtod(value, &end);
        return *value && !*end && q->recipe.gravity > 0.0 && q->recipe.gravity <= 100.0;
    }
    if (strcmp(name, "--spacing") == 0) {
        q->recipe.spacing = strtod(value, &end);
        return *value && !*end && q->recipe.spacing > 1e-6 && q->recipe.spacing < 1e3;
    }
    return false;
}

static bool is_known(const char *kind)
{
    for (size_t k = 0; recipe_kinds[k][0]; k++)
        if (strcmp(recipe_kinds[k][0], kind) == 0)
            return true;
    return false;
}

static void unknown_kind(const char *kind)
{
    enum { MOST = 32 };
    const char *known[MOST + 1] = {NULL};
    for (size_t k = 0; k < MOST && recipe_kinds[k][0]; k++)
        known[k] = recipe_kinds[k][0];
    (void)ascc_bad_use("generate", "there is no such kind", kind, known);
}

int ascc_command_generate(int argc, char **argv)
{
    static const char *const options[] = {
        "-o",        "--seed",           "--count",  "--threads",  "--frames",  "--dimension",
        "--spacing", "--all-velocities", "--solver", "--interval", "--gravity", NULL};
    request q = {.count = 1, .threads = 1};
    for (int i = 0; i < argc; i++) {
        if (strcmp(argv[i], "--help") == 0) {
            usage();
            return 0;
        }
        if (strcmp(argv[i], "--all-velocities") == 0) {
            q.all_velocities = true;
        } else if (argv[i][0] != '-' && !q.kind) {
            q.kind = argv[i];
        } else if (i + 1 >= argc || !take_option(&q, argv[i], argv[i + 1])) {
            return ascc_bad_option("generate", options, argv[i], argv[i + 1]), 2;
        } else {
            i++;
        }
    }
    if (!q.kind || !q.directory)
        return ascc_bad_use("generate", "a KIND and -o DIR are wanted", NULL, NULL), 2;
    if (!is_known(q.kind))
        return unknown_kind(q.kind), 2;
    recipe probe;
    const recipe_options probed = q.recipe;
    if (recipe_make(q.kind, &probed, &probe) != ASCC_OK) {
        ascc_line(stderr, "ascc generate: %s does not come in that dimension or spacing", q.kind);
        return 2;
    }
    recipe_free(&probe);
    return generate(&q);
}
