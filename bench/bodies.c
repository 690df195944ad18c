/* What a body costs: steps of a pool around a box that rests, and that moves. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/ascc/host.h"
#include "../tests/support/model_builder.h"
#include "bench.h"

/* A pool and a box in it, in spacings: 45,760 particles and 10,086 points of the box; quick: 7,064 and 1,176. */
typedef struct pool {
    int wide, high;
    double box;
} pool;

static const pool whole = {46, 32, 27.4}, quick = {24, 14, 10.1};

typedef struct bath {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    ascc_model_info info;
    int32_t body;
    size_t count, points;
} bath;

static void check(const bath *b, ascc_status status, const char *what)
{
    if (status != ASCC_OK)
        bench_fail("%s: %s %s", what, b->particles ? ascc_particles_message(b->particles) : "",
                   b->step ? ascc_step_message(b->step) : "");
}

static void load(bath *b, const bench_options *o)
{
    ascc_host_error why = {""};
    ascc_status status;
    b->context = bench_context(o->cpu, o->threads);
    if (o->model)
        status = ascc_host_load(b->context, o->model, &b->model, &why);
    else {
        size_t size;
        unsigned char *bytes = model_builder_tiny(BENCH_SPACING, &size);
        status = ascc_model_load_memory(b->context, bytes, size, &b->model);
        free(bytes);
    }
    if (status != ASCC_OK)
        bench_fail("model: %s", why.text);
    b->info.size = sizeof b->info;
    check(b, ascc_model_get_info(b->model, &b->info), "model");
}

/* The water around the box, as a lattice. */
static void fill(bath *b, const pool *p)
{
    const double h = b->info.particle_spacing,
                 middle[3] = {0.5 * (p->wide + 1), 0.5 * (p->high + 1), 0.5 * (p->wide + 1)};
    double *x = malloc((size_t)(p->wide * p->wide * p->high) * 3 * sizeof *x);
    if (!x)
        bench_fail("no memory for a pool");
    for (int k = 1; k <= p->wide; k++)
        for (int j = 1; j <= p->high; j++)
            for (int i = 1; i <= p->wide; i++) {
                const double at[3] = {i, j, k};
                double away = 0.0;
                for (int c = 0; c < 3; c++)
                    away = fmax(away, fabs(at[c] - middle[c]));
                for (int c = 0; c < 3; c++)
                    x[3 * b->count + (size_t)c] = at[c] * h;
                b->count += away > 0.5 * p->box + 0.4;
            }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    check(b, ascc_particles_add_fluid(b->particles, b->count, &position, NULL, NULL, NULL),
          "fluid");
    free(x);
}

static void add_bodies(bath *b, const pool *p)
{
    const double h = b->info.particle_spacing, side = 0.5 * (p->wide + 1) * h, up = p->high * h;
    const ascc_shape tank = {.size = sizeof tank,
                             .kind = ASCC_SHAPE_BOX,
                             .water = ASCC_WATER_INSIDE,
                             .half = {side, up, side},
                             .open = 1 << 3};
    const ascc_pose around = {.size = sizeof around, .position = {side, up, side}};
    const ascc_shape box = {.size = sizeof box,
                            .kind = ASCC_SHAPE_BOX,
                            .half = {0.5 * p->box * h, 0.5 * p->box * h, 0.5 * p->box * h}};
    const ascc_pose in = {.size = sizeof in, .position = {side, 0.5 * (p->high + 1) * h, side}};
    int32_t walls;
    check(b, ascc_body_add(b->particles, &tank, &around, &walls), "tank");
    const size_t before = ascc_particles_count(b->particles, ASCC_BOUNDARY);
    check(b, ascc_body_add(b->particles, &box, &in, &b->body), "box");
    b->points = ascc_particles_count(b->particles, ASCC_BOUNDARY) - before;
}

/* Seconds of a step in which the box moves and turns by a thousandth of its size, or is told to rest. */
static double step(bath *b, bool moves)
{
    ascc_body_info now = {.size = sizeof now};
    check(b, ascc_body_get(b->particles, b->body, &now), "box");
    ascc_pose pose = {.size = sizeof pose};
    memcpy(pose.position, now.position, sizeof pose.position);
    memcpy(pose.rotation, now.rotation, sizeof pose.rotation);
    pose.velocity[1] = moves ? 0.02 * b->info.particle_spacing / b->info.time_step : 0.0;
    pose.spin[1] = moves ? 0.001 / b->info.time_step : 0.0;
    const double begin = bench_process_seconds();
    check(b, ascc_body_move(b->particles, b->body, &pose), "box");
    check(b, ascc_step_run(b->step, b->particles, NULL, 1), "step");
    return bench_process_seconds() - begin;
}

void bench_bodies(const bench_options *o)
{
    const pool *p = o->quick ? &quick : &whole;
    const size_t repeats = bench_repeats(o);
    double seconds[2][BENCH_REPEATS];
    bath b = {0};
    load(&b, o);
    ascc_particles_options set = {.size = sizeof set};
    check(&b, ascc_model_particles_options(b.model, 0.0, &set), "model");
    check(&b, ascc_particles_create(b.context, &set, &b.particles), "particles");
    fill(&b, p);
    add_bodies(&b, p);
    check(&b, ascc_step_create(b.context, b.model, NULL, &b.step), "step");
    for (int r = 0; r < 4; r++)
        (void)step(&b, r % 2);
    for (size_t r = 0; r < repeats; r++)
        for (int moves = 0; moves < 2; moves++)
            seconds[moves][r] = step(&b, moves);
    const bench_spread rest = bench_spread_of(seconds[0], repeats),
                       move = bench_spread_of(seconds[1], repeats);
    bench_table table = bench_table_open(
        o, "bodies", "steps in which a body rests and moves, in turn; CPU time of all threads",
        "model,particles,points,rest_ms,rest_min,moving_ms,moving_min,share_median,share_min");
    bench_row(&table, "%s,%zu,%zu,%.3f,%.3f,%.3f,%.3f,%+.4f,%+.4f", o->model ? o->model : "tiny",
              b.count, b.points, rest.median * 1e3, rest.min * 1e3, move.median * 1e3,
              move.min * 1e3, move.median / rest.median - 1.0, move.min / rest.min - 1.0);
    bench_table_close(&table);
    ascc_step_destroy(&b.step);
    ascc_particles_destroy(&b.particles);
    ascc_model_destroy(&b.model);
    ascc_context_destroy(&b.context);
}
