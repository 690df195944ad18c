/* Runs small scenes on every set of kernels that this machine has, and prints a hash of each final
 * state: "SCENE CPU HASH". The hashes are the same on every machine and from every compiler
 * (tests/data/state-hashes.txt). Needs no test framework. SPDX-License-Identifier: MIT */
#include <ascc/ascc.h>

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "../examples/demo_model.h"
#include "support/model_builder.h"

static const double spacing = 0.05;

typedef struct scene {
    const char *name;
    int dimension;
    int side; /* of the block of fluid, particles */
    int32_t steps;
    const model_random *network; /* NULL = the demonstration model */
} scene;

static const model_random flat = {
    .seed = 11, .dimension = 2, .levels = 3, .channels = 16, .spacing = 0.05, .half_axis = "x"};
static const model_random farthest = {.seed = 12,
                                      .dimension = 2,
                                      .levels = 2,
                                      .channels = 12,
                                      .spacing = 0.05,
                                      .method = "farthest",
                                      .window = "peak",
                                      .mapping = "radial",
                                      .neighbor_limit = 9};
static const model_random solid = {
    .seed = 13, .dimension = 3, .levels = 2, .channels = 24, .spacing = 0.05, .cells = 3};
static const model_random plain = {.seed = 14,
                                   .dimension = 3,
                                   .levels = 1,
                                   .channels = 8,
                                   .spacing = 0.05,
                                   .projection = "none",
                                   .mapping = "identity",
                                   .plain = 1,
                                   .skip_self = 1};
static const model_random graph = {.seed = 15,
                                   .dimension = 2,
                                   .channels = 16,
                                   .spacing = 0.05,
                                   .radius = 1.45,
                                   .graph = 3,
                                   .history = 5,
                                   .plain = 1};
static const model_random abstraction = {.seed = 16,
                                         .dimension = 3,
                                         .levels = 2,
                                         .channels = 16,
                                         .spacing = 0.05,
                                         .method = "farthest",
                                         .abstraction = 1 + 2 + 32,
                                         .plain = 1};

static const scene scenes[] = {
    {"dam-2d", 2, 12, 60, NULL},    {"dam-3d", 3, 5, 20, NULL},
    {"random-2d", 2, 8, 4, &flat},  {"farthest-2d", 2, 8, 4, &farthest},
    {"random-3d", 3, 4, 3, &solid}, {"plain-3d", 3, 4, 3, &plain},
    {"graph-2d", 2, 8, 6, &graph},  {"abstraction-3d", 3, 4, 3, &abstraction},
};

static void check(ascc_status status, const char *what)
{
    if (status == ASCC_OK)
        return;
    (void)fprintf(stderr, "%s: %s\n", what, ascc_status_text(status));
    exit(1);
}

/* Numbers in [-0.5, 0.5), the same everywhere. */
static double jitter(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(uint32_t)(*seed >> 33) / 2147483648.0 - 0.5;
}

/* A block of fluid in the corner of a floor and a wall, thrown at the wall. */
static ascc_particles *fill(ascc_context *context, const scene *s)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = s->dimension, .spacing = spacing, .mass = 0.125};
    ascc_particles *particles;
    check(ascc_particles_create(context, &options, &particles), "particles");
    double at[3], speed[3], normal[3];
    const ascc_const_array position = {.data = at, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = speed, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    uint64_t seed = 7;
    const int layers = s->dimension == 2 ? 1 : s->side;
    for (int n = 0; n < s->side * s->side * layers; n++) {
        const int cell[3] = {n % s->side, n / s->side % s->side, n / s->side / s->side};
        for (int c = 0; c < 3; c++) {
            at[c] = (cell[c] + 0.5 + 0.2 * jitter(&seed)) * spacing;
            speed[c] = 0.1 * jitter(&seed) - (c == 0 ? 0.5 : 0.0);
        }
        check(ascc_particles_add_fluid(particles, 1, &position, &velocity, NULL, NULL), "fluid");
    }
    const int wide = s->side + 4, deep = s->dimension == 2 ? 1 : wide;
    for (int body = 0; body < 2; body++)
        for (int n = 0; n < wide * deep; n++) {
            for (int c = 0; c < 3; c++)
                normal[c] = c == body ? 1.0 : 0.0;
            at[body] = -0.25 * spacing;
            at[1 - body] = (n % wide) * 0.7 * spacing;
            at[2] = (n / wide - 1) * 0.7 * spacing;
            check(ascc_particles_add_boundary(particles, 1, &position, &normals, body, NULL),
                  "walls");
        }
    return particles;
}

static uint64_t hash_after(ascc_context *context, const scene *s)
{
    size_t size;
    unsigned char *bytes = s->network ? model_builder_random(s->network, &size)
                                      : demo_model_bytes(s->dimension, spacing, &size);
    ascc_model *model;
    const ascc_status loaded = ascc_model_load_memory(context, bytes, size, &model);
    free(bytes);
    if (loaded != ASCC_OK) {
        char text[256];
        ascc_context_message(context, text, sizeof text);
        check(loaded, text);
    }
    ascc_particles *particles = fill(context, s);
    ascc_step *step;
    check(ascc_step_create(context, model, NULL, &step), "step");
    const double gravity[3] = {0.0, -9.81, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    check(ascc_step_run(step, particles, &forces, s->steps), ascc_step_message(step));
    const uint64_t hash = ascc_particles_hash(particles);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    return hash;
}

int main(void)
{
    const uint32_t all = ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128;
    for (uint32_t use = 0; use <= all; use++) {
        const ascc_context_options options = {
            .size = sizeof options, .thread_count = 1, .cpu_disable = all & ~use};
        ascc_context *context;
        check(ascc_context_create(&options, &context), "context");
        if (ascc_context_cpu(context) == use)
            for (size_t i = 0; i < sizeof scenes / sizeof *scenes; i++)
                printf("%s %" PRIu32 " %016" PRIx64 "\n", scenes[i].name, use,
                       hash_after(context, &scenes[i]));
        ascc_context_destroy(&context);
    }
    return 0;
}
