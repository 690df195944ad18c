/* A pool that rests, takes a block of water, loses it again and takes another: what each frame costs, on which rung it
 * ran, and how far it is from another run. SPDX-License-Identifier: MIT
 *
 *   budget MODEL[,MODEL...] [--budget MS] [--sleep V] [--detail X] [--size N] [--frames N] [--keep FILE] [--like FILE]
 *          [--slices FILE] [--slide V]
 *
 * The pool has N x N / 2 x N particles, a block an eighth of N^3, which falls after a sixth of the frames, is taken
 * out after a half and let in again after two thirds. A line of CSV for each frame; time is CPU time of the one
 * thread, so that other programs on the machine count little. --keep writes the places of every tenth frame, --like
 * reads those of another run: the Chamfer distance to it, both ways in the mean. --detail: the first model runs, the last
 * one the share X of the pool's length, and a ramp of four spacings between them. --slices: mean density and speed of
 * slices across that length, of all frames. --slide: no block falls, and the pool begins to slide at this speed, m/s, in
 * the middle, less towards its ends.
 */
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <ascc/ascc.h>

#include "host.h"
#include "measures.h"

#define WALL_SPACING 0.64 /* in particle spacings */
#define PI 3.14159265358979323846
#define RAMP 4.0                      /* spacings */
enum { EVERY = 10 };                  /* frames from one that is kept to the next */
enum { SLICE = 2, MOST_SLICES = 64 }; /* spacings */

typedef struct options {
    const char *models, *keep, *like, *slices;
    double budget, sleep, detail, slide;
    int size, frames;
} options;

typedef struct run {
    const options *o;
    double spacing;
    ascc_context *context;
    ascc_model *model[ASCC_MAX_RUNGS];
    size_t rungs;
    ascc_particles *particles;
    ascc_ladder *ladder;
    size_t block;   /* particles of one */
    uint64_t *ids;  /* [block] of the one that is there */
    double *places; /* room for all */
    FILE *kept, *other;
    double density[MOST_SLICES], speed[MOST_SLICES], rows[MOST_SLICES]; /* sums */
} run;

static _Noreturn void fail(const run *r, const char *what)
{
    char line[256] = "";
    if (r->context)
        (void)ascc_context_message(r->context, line, sizeof line);
    fprintf(stderr, "budget: %s: %s\n", what, line);
    exit(1);
}

static double cpu_time(void *user)
{
    struct timespec t;
    (void)user;
    (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- The scene ---- */

static size_t fill(double *x, const int cells[3], const double low[3], double spacing)
{
    size_t n = 0;
    for (int k = 0; k < cells[2]; k++)
        for (int j = 0; j < cells[1]; j++)
            for (int i = 0; i < cells[0]; i++, n++) {
                const int at[3] = {i, j, k};
                for (int c = 0; c < 3; c++)
                    x[3 * n + (size_t)c] = (low[c] + at[c]) * spacing;
            }
    return n;
}

/* Both sides of a box across an axis; the upper one is left out along y. */
static size_t add_sides(double *x, double *normal, size_t n, const double edge[3], int axis,
                        double spacing)
{
    const int p = (axis + 1) % 3, q = (axis + 2) % 3;
    const int columns = (int)ceil(edge[p] / WALL_SPACING), rows = (int)ceil(edge[q] / WALL_SPACING);
    for (int side = 0; side < (axis == 1 ? 1 : 2); side++)
        for (int j = 0; j < rows; j++)
            for (int i = 0; i < columns; i++, n++) {
                double *at = x + 3 * n, *up = normal + 3 * n;
                up[0] = up[1] = up[2] = 0.0;
                up[axis] = side ? -1.0 : 1.0;
                at[axis] = side * edge[axis] * spacing;
                at[p] = (i + 0.5) * edge[p] / columns * spacing;
                at[q] = (j + 0.5) * edge[q] / rows * spacing;
            }
    return n;
}

static void add_pool(run *r)
{
    const int n = r->o->size;
    const double edge[3] = {n + 1.0, 2.0 * n, n + 1.0};
    const size_t most = (size_t)(24.0 * (n + 2) * (n + 2) / (WALL_SPACING * WALL_SPACING));
    double *wall = malloc(most * 3 * sizeof *wall), *normal = malloc(most * 3 * sizeof *normal);
    size_t walls = 0;
    if (!wall || !normal)
        fail(r, "no memory");
    for (int axis = 0; axis < 3; axis++)
        walls = add_sides(wall, normal, walls, edge, axis, r->spacing);
    const size_t fluid =
        fill(r->places, (int[]){n, n / 2, n}, (const double[]){1, 1, 1}, r->spacing);
    double *velocity = calloc(3 * fluid, sizeof *velocity);
    if (!velocity)
        fail(r, "no memory");
    for (size_t i = 0; i < fluid; i++)
        velocity[3 * i] = r->o->slide * sin(PI * r->places[3 * i] / (edge[0] * r->spacing));
    const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array x = {.data = r->places, .scalar = ASCC_DOUBLE};
    const ascc_const_array w = {.data = wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array up = {.data = normal, .scalar = ASCC_DOUBLE};
    if (ascc_particles_add_fluid(r->particles, fluid, &x, &v, NULL, NULL) != ASCC_OK ||
        ascc_particles_add_boundary(r->particles, walls, &w, &up, 0, NULL) != ASCC_OK)
        fail(r, "particles");
    free(velocity);
    free(wall);
    free(normal);
}

/* Half of the pool's height above it. */
static void add_block(run *r)
{
    const int n = r->o->size;
    const double low[3] = {1 + n / 4, n, 1 + n / 4};
    (void)fill(r->places, (int[]){n / 2, n / 2, n / 2}, low, r->spacing);
    const ascc_const_array x = {.data = r->places, .scalar = ASCC_DOUBLE};
    if (ascc_particles_add_fluid(r->particles, r->block, &x, NULL, NULL, r->ids) != ASCC_OK)
        fail(r, "the block");
}

static void change_scene(run *r, int frame)
{
    const int all = r->o->frames;
    if (frame == all / 6 || frame == 2 * all / 3)
        add_block(r);
    if (frame == all / 2 && ascc_particles_remove(r->particles, r->block, r->ids) != ASCC_OK)
        fail(r, "the block");
}

/* ---- The run ---- */

static void open_models(run *r)
{
    char names[512], *save = NULL;
    ascc_host_error why;
    snprintf(names, sizeof names, "%s", r->o->models);
    for (char *name = strtok_r(names, ",", &save); name && r->rungs < ASCC_MAX_RUNGS;
         name = strtok_r(NULL, ",", &save), r->rungs++)
        if (ascc_host_load(r->context, name, &r->model[r->rungs], &why) != ASCC_OK)
            fail(r, why.text);
}

static void open_run(run *r)
{
    const ascc_context_options context = {.size = sizeof context, .thread_count = 1};
    ascc_model_info info = {.size = sizeof info};
    if (ascc_context_create(&context, &r->context) != ASCC_OK)
        fail(r, "context");
    open_models(r);
    (void)ascc_model_get_info(r->model[0], &info);
    r->spacing = info.particle_spacing;
    r->block = (size_t)(r->o->size / 2 * (r->o->size / 2) * (r->o->size / 2));
    r->ids = malloc(r->block * sizeof *r->ids);
    r->places = malloc((size_t)(r->o->size * r->o->size * r->o->size) * 3 * sizeof *r->places);
    const ascc_particles_options set = {.size = sizeof set,
                                        .dimension = 3,
                                        .spacing = r->spacing,
                                        .mass = info.rest_density * pow(r->spacing, 3.0)};
    const ascc_step_options step = {.size = sizeof step, .sleep_speed = r->o->sleep};
    const ascc_ladder_options ladder = {
        .size = sizeof ladder, .budget = 1e-3 * r->o->budget, .clock = cpu_time, .step = &step};
    if (!r->ids || !r->places ||
        ascc_particles_create(r->context, &set, &r->particles) != ASCC_OK ||
        ascc_ladder_create(r->context, r->rungs, (const ascc_model *const *)r->model, &ladder,
                           &r->ladder) != ASCC_OK)
        fail(r, "the run");
    add_pool(r);
    if ((r->o->keep && !(r->kept = fopen(r->o->keep, "wb"))) ||
        (r->o->like && !(r->other = fopen(r->o->like, "rb"))))
        fail(r, "places");
}

/* The places of now; how far they are from the other run's, m, or NaN. */
static double compare(run *r, size_t count)
{
    double there = NAN, back = NAN;
    const ascc_array x = {.data = r->places, .scalar = ASCC_DOUBLE};
    if (ascc_particles_get(r->particles, ASCC_FLUID, ASCC_POSITION, 0, count, &x) != ASCC_OK)
        fail(r, "places");
    if (r->kept && fwrite(r->places, 3 * sizeof(double), count, r->kept) != count)
        fail(r, "the kept places cannot be written");
    if (!r->other)
        return NAN;
    double *theirs = malloc(count * 3 * sizeof *theirs);
    if (!theirs || fread(theirs, 3 * sizeof(double), count, r->other) != count)
        fail(r, "the other run has other frames");
    const ascc_measure_set a = {.dimension = 3, .count = count, .position = r->places};
    const ascc_measure_set b = {.dimension = 3, .count = count, .position = theirs};
    (void)ascc_measure_chamfer(&a, &b, 1, &there, &back);
    free(theirs);
    return 0.5 * (there + back);
}

/* Adds a frame to the sums of the slices. */
static void add_slices(run *r, size_t count)
{
    double *velocity = malloc(count * 3 * sizeof *velocity),
           *density = malloc(count * sizeof *density);
    const ascc_array x = {.data = r->places, .scalar = ASCC_DOUBLE};
    const ascc_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
    const ascc_measure_set set = {.dimension = 3, .count = count, .position = r->places};
    if (!velocity || !density ||
        ascc_particles_get(r->particles, ASCC_FLUID, ASCC_POSITION, 0, count, &x) != ASCC_OK ||
        ascc_particles_get(r->particles, ASCC_FLUID, ASCC_VELOCITY, 0, count, &v) != ASCC_OK ||
        ascc_measure_density(&set, 0, NULL, 2.0 * r->spacing, 1, density) != ASCC_OK)
        fail(r, "slices");
    for (size_t i = 0; i < count; i++) {
        const double at = floor(r->places[3 * i] / r->spacing / SLICE), *w = velocity + 3 * i;
        if (!(at >= 0.0 && at < MOST_SLICES))
            continue;
        r->density[(int)at] += density[i] / ascc_measure_rest_density(3);
        r->speed[(int)at] += sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
        r->rows[(int)at] += 1.0;
    }
    free(velocity);
    free(density);
}

static void write_slices(const run *r)
{
    FILE *f = fopen(r->o->slices, "w");
    if (!f)
        fail(r, r->o->slices);
    fputs("spacings,density,speed\n", f);
    for (int k = 0; k < MOST_SLICES; k++)
        if (r->rows[k] > 0.0)
            fprintf(f, "%d,%.5f,%.5f\n", SLICE * k + SLICE / 2, r->density[k] / r->rows[k],
                    r->speed[k] / r->rows[k]);
    if (fclose(f) != 0)
        fail(r, r->o->slices);
}

/* A step on the first rung, with the last one's share by place. */
static ascc_status run_detailed(run *r)
{
    const size_t count = ascc_particles_count(r->particles, ASCC_FLUID);
    const double end = r->o->detail * (r->o->size + 1);
    const int32_t first = 0;
    const ascc_array x = {.data = r->places, .scalar = ASCC_DOUBLE};
    if (ascc_particles_get(r->particles, ASCC_FLUID, ASCC_POSITION, 0, count, &x) != ASCC_OK)
        fail(r, "places");
    for (size_t i = 0; i < count; i++)
        r->places[i] = fmin(1.0, fmax(0.0, 0.5 + (end - r->places[3 * i] / r->spacing) / RAMP));
    const ascc_const_array weight = {.data = r->places, .scalar = ASCC_DOUBLE};
    if (ascc_particles_set(r->particles, ASCC_FLUID, ASCC_DETAIL, 0, count, &weight) != ASCC_OK)
        fail(r, "weights");
    return ascc_ladder_replay(r->ladder, r->particles, NULL, &first, 1);
}

static void run_frame(run *r, int frame)
{
    ascc_ladder_statistics told = {.size = sizeof told};
    ascc_step_statistics step = {.size = sizeof step};
    ascc_measures motion = {.size = sizeof motion};
    if (r->o->slide == 0.0)
        change_scene(r, frame);
    const ascc_status status =
        r->o->detail > 0.0 ? run_detailed(r) : ascc_ladder_run(r->ladder, r->particles, NULL, 1);
    if (status != ASCC_OK)
        fail(r, ascc_ladder_message(r->ladder));
    (void)ascc_ladder_get_statistics(r->ladder, &told);
    (void)ascc_step_get_statistics(ascc_ladder_step(r->ladder, told.rung), &step);
    (void)ascc_particles_measure(r->particles, &motion);
    const size_t count = ascc_particles_count(r->particles, ASCC_FLUID);
    printf("%d,%.3f,%d,%d,%zu,%.3f,%.4f,", frame, 1e3 * told.seconds, (int)told.rung,
           (int)told.reason, count, (double)step.asleep / (double)count, motion.kinetic_energy);
    if (frame % EVERY == EVERY - 1)
        printf("%.6f", compare(r, count));
    printf("\n");
    if (r->o->slices)
        add_slices(r, count);
}

static void close_run(run *r)
{
    if (r->o->slices)
        write_slices(r);
    if (r->kept && fclose(r->kept) != 0)
        fail(r, "the kept places cannot be written");
    if (r->other)
        (void)fclose(r->other);
    ascc_ladder_destroy(&r->ladder);
    ascc_particles_destroy(&r->particles);
    for (size_t i = 0; i < r->rungs; i++)
        ascc_model_destroy(&r->model[i]);
    ascc_context_destroy(&r->context);
    free(r->ids);
    free(r->places);
}

int main(int argc, char **argv)
{
    options o = {.models = argc > 1 ? argv[1] : NULL, .size = 16, .frames = 600};
    bool good = argc > 1 && argc % 2 == 0;
    for (int i = 2; good && i + 1 < argc; i += 2) {
        const char *name = argv[i], *value = argv[i + 1];
        if (strcmp(name, "--budget") == 0)
            o.budget = atof(value);
        else if (strcmp(name, "--sleep") == 0)
            o.sleep = atof(value);
        else if (strcmp(name, "--detail") == 0)
            o.detail = atof(value);
        else if (strcmp(name, "--size") == 0)
            o.size = atoi(value);
        else if (strcmp(name, "--frames") == 0)
            o.frames = atoi(value);
        else if (strcmp(name, "--keep") == 0)
            o.keep = value;
        else if (strcmp(name, "--like") == 0)
            o.like = value;
        else if (strcmp(name, "--slide") == 0)
            o.slide = atof(value);
        else if (strcmp(name, "--slices") == 0)
            o.slices = value;
        else
            good = false;
    }
    if (!good || o.size < 4 || o.frames < 6) {
        fprintf(stderr,
                "usage: budget MODEL[,MODEL...] [--budget MS] [--sleep V] [--detail X] [--size N] "
                "[--frames N] [--keep FILE] [--like FILE] [--slices FILE] [--slide V]\n");
        return 2;
    }
    run r = {.o = &o};
    open_run(&r);
    printf("frame,ms,rung,reason,particles,asleep,kinetic_energy,chamfer\n");
    for (int frame = 0; frame < o.frames; frame++)
        run_frame(&r, frame);
    close_run(&r);
    return 0;
}
