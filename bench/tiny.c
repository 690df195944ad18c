/* How long a step of a tiny network takes: tiny [particles] [threads] [steps].
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <ascc/ascc.h>

#include "../tests/support/model_builder.h"

static const double spacing = 0.05;

static double seconds(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void check(ascc_status status, const char *what)
{
    if (status == ASCC_OK)
        return;
    fprintf(stderr, "%s: %s\n", what, ascc_status_text(status));
    exit(1);
}

/* A jittered cube of fluid. */
static size_t add_fluid(ascc_particles *p, size_t count, int side)
{
    double *x = calloc(count * 3, sizeof *x);
    uint32_t state = 1;
    if (!x)
        exit(1);
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < 3; c++) {
            const size_t at[3] = {i % (size_t)side, i / (size_t)(side * side),
                                  i / (size_t)side % (size_t)side};
            state = state * 1664525u + 1013904223u;
            x[i * 3 + c] = ((double)at[c] + 0.2 * ((double)(state >> 8) * 0x1p-24 - 0.5)) * spacing;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    check(ascc_particles_add_fluid(p, count, &position, NULL, NULL, NULL), "fluid");
    free(x);
    return count;
}

/* A floor and four sides around it, one layer of points a spacing apart. */
static size_t add_box(ascc_particles *p, int side)
{
    const size_t face = (size_t)(side + 2) * (size_t)(side + 2);
    double *x = calloc(face * 5 * 3, sizeof *x), *normal = calloc(face * 5 * 3, sizeof *normal);
    static const int axis[5] = {1, 0, 0, 2, 2}, far[5] = {0, 0, 1, 0, 1};
    if (!x || !normal)
        exit(1);
    for (size_t f = 0; f < 5; f++)
        for (size_t i = 0; i < face; i++) {
            double *at = x + (f * face + i) * 3;
            const int a = axis[f], u = (a + 1) % 3, v = (a + 2) % 3;
            at[a] = (far[f] ? side : -1) * spacing;
            at[u] = ((double)(i % (size_t)(side + 2)) - 1.0) * spacing;
            at[v] = ((double)(i / (size_t)(side + 2)) - 1.0) * spacing;
            normal[(f * face + i) * 3 + (size_t)a] = far[f] ? -1.0 : 1.0;
        }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    check(ascc_particles_add_boundary(p, face * 5, &position, &normals, 1, NULL), "walls");
    free(x);
    free(normal);
    return face * 5;
}

int main(int argc, char **argv)
{
    const size_t count = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : 50000;
    const int32_t threads = argc > 2 ? (int32_t)strtol(argv[2], NULL, 10) : 1;
    const int steps = argc > 3 ? (int)strtol(argv[3], NULL, 10) : 20;
    const int side = (int)ceil(cbrt((double)count));
    size_t size;
    unsigned char *bytes = model_builder_tiny(spacing, &size);
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    const ascc_context_options options = {.size = sizeof options, .thread_count = threads};
    check(ascc_context_create(&options, &context), "context");
    check(ascc_model_load_memory(context, bytes, size, &model), "model");
    const ascc_particles_options of = {
        .size = sizeof of, .dimension = 3, .spacing = spacing, .mass = 0.125};
    check(ascc_particles_create(context, &of, &particles), "particles");
    const size_t fluid = add_fluid(particles, count, side), walls = add_box(particles, side);
    check(ascc_step_create(context, model, NULL, &step), "step");
    check(ascc_step_run(step, particles, NULL, 2), "first steps");
    double best_wall = INFINITY, best_cpu = INFINITY;
    for (int i = 0; i < steps; i++) {
        const double wall = seconds(CLOCK_MONOTONIC), cpu = seconds(CLOCK_PROCESS_CPUTIME_ID);
        check(ascc_step_run(step, particles, NULL, 1), "step");
        best_wall = fmin(best_wall, seconds(CLOCK_MONOTONIC) - wall);
        best_cpu = fmin(best_cpu, seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu);
    }
    ascc_step_statistics s = {.size = sizeof s};
    check(ascc_step_get_statistics(step, &s), "statistics");
    printf("%zu fluid, %zu wall particles, %d threads: best step %.1f ms, CPU %.1f ms\n", fluid,
           walls, (int)threads, 1e3 * best_wall, 1e3 * best_cpu);
    printf(
        "last step, ms: prepare %.1f, hierarchy %.1f, search %.1f, network %.1f, last layer %.1f, "
        "commit %.1f; %.1f million neighbours, %llu coarse points\n",
        1e3 * s.seconds_prepare, 1e3 * s.seconds_hierarchy, 1e3 * s.seconds_search,
        1e3 * s.seconds_network, 1e3 * s.seconds_last_layer, 1e3 * s.seconds_commit,
        1e-6 * (double)s.neighbor_count, (unsigned long long)s.level_points[1]);
    free(bytes);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return 0;
}
