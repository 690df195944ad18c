/* What a pool costs that moves, that sleeps, and that a drop falls into. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/ascc/host.h"
#include "bench.h"

/* Particles of a pool along each axis, of a drop; frames that the pool has to fall asleep, that a part is, of the drop. */
typedef struct plan {
    int wide, deep, drop, most, part, splash;
} plan;

static const plan whole = {62, 13, 5, 400, 20, 60}, quick = {14, 6, 3, 20, 10, 10};

#define SLEEP_SPEED 0.5

typedef struct basin {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    ascc_model_info info;
    size_t count, walls; /* of the pool */
    double awake;        /* s a step, of it moving */
} basin;

static void check(const basin *b, ascc_status status, const char *what)
{
    if (status != ASCC_OK)
        bench_fail("%s: %s %s", what, b->particles ? ascc_particles_message(b->particles) : "",
                   b->step ? ascc_step_message(b->step) : "");
}

static void open_step(basin *b, double sleep_speed)
{
    const ascc_step_options options = {.size = sizeof options, .sleep_speed = sleep_speed};
    ascc_step_destroy(&b->step);
    check(b, ascc_step_create(b->context, b->model, &options, &b->step), "step");
}

static void add_block(basin *b, const int n[3], const double low[3])
{
    const double h = b->info.particle_spacing;
    const size_t count = (size_t)n[0] * (size_t)n[1] * (size_t)n[2];
    double *x = malloc(count * 3 * sizeof *x);
    if (!x)
        bench_fail("no memory for a block");
    for (size_t i = 0; i < count; i++) {
        const size_t at[3] = {i % (size_t)n[0], i / (size_t)n[0] % (size_t)n[1],
                              i / (size_t)(n[0] * n[1])};
        for (int c = 0; c < 3; c++)
            x[3 * i + (size_t)c] = h * (low[c] + (double)at[c]);
    }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    check(b, ascc_particles_add_fluid(b->particles, count, &position, NULL, NULL, NULL), "fluid");
    free(x);
}

/* The tank is open, and twelve spacings higher than the water. */
static void fill(basin *b, const plan *p)
{
    const double h = b->info.particle_spacing, side = 0.5 * (p->wide + 1) * h,
                 up = 0.5 * (p->deep + 12) * h;
    const ascc_shape tank = {.size = sizeof tank,
                             .kind = ASCC_SHAPE_BOX,
                             .water = ASCC_WATER_INSIDE,
                             .half = {side, up, side},
                             .open = 1 << 3};
    const ascc_pose pose = {.size = sizeof pose, .position = {side, up, side}};
    int32_t body;
    ascc_particles_options set = {.size = sizeof set};
    check(b, ascc_model_particles_options(b->model, 0.0, &set), "model");
    check(b, ascc_particles_create(b->context, &set, &b->particles), "particles");
    add_block(b, (int[]){p->wide, p->deep, p->wide}, (double[]){1.0, 1.0, 1.0});
    check(b, ascc_body_add(b->particles, &tank, &pose, &body), "tank");
    b->count = ascc_particles_count(b->particles, ASCC_FLUID);
    b->walls = ascc_particles_count(b->particles, ASCC_BOUNDARY);
}

static void add_drop(basin *b, const plan *p)
{
    const double low = 0.5 * (p->wide - p->drop) + 1.0;
    add_block(b, (int[]){p->drop, p->drop, p->drop}, (double[]){low, p->deep + 5.0, low});
}

/* Of the pool; the drop's own rows come after. */
static double fastest(const basin *b)
{
    const size_t n = ascc_particles_count(b->particles, ASCC_FLUID);
    double *v = malloc(n * 3 * sizeof *v), most = 0.0;
    if (!v)
        bench_fail("no memory for velocities");
    const ascc_array to = {.data = v, .scalar = ASCC_DOUBLE};
    check(b, ascc_particles_get(b->particles, ASCC_FLUID, ASCC_VELOCITY, 0, n, &to), "velocity");
    for (size_t i = 0; i < b->count; i++)
        most = fmax(most, v[3 * i] * v[3 * i] + v[3 * i + 1] * v[3 * i + 1] +
                              v[3 * i + 2] * v[3 * i + 2]);
    free(v);
    return sqrt(most);
}

/* Runs steps and writes a row of them. Returns how many sleep at the end; the pool's fastest in *most. */
static size_t run(basin *b, bench_table *table, const char *phase, int steps, double *most)
{
    ascc_step_statistics s = {.size = sizeof s};
    double seconds = 0.0, top = 0.0;
    for (int n = 0; n < steps; n++) {
        const double begin = bench_process_seconds();
        check(b, ascc_step_run(b->step, b->particles, NULL, 1), "step");
        seconds += bench_process_seconds() - begin;
        top = fmax(top, fastest(b));
    }
    check(b, ascc_step_get_statistics(b->step, &s), "statistics");
    seconds /= steps;
    if (b->awake == 0.0)
        b->awake = seconds;
    bench_row(table, "%s,%d,%.1f,%.3f,%zu,%.2f", phase, steps, seconds * 1e3, seconds / b->awake,
              s.asleep, top);
    *most = fmax(*most, top);
    return s.asleep;
}

/* The drop, in parts, and all of it. */
static void splash(basin *b, const plan *p, bench_table *table, const char *phase)
{
    double most = 0.0, begin = bench_process_seconds();
    add_drop(b, p);
    for (int n = 0; n < p->splash; n += p->part / 2)
        (void)run(b, table, phase, p->part / 2, &most);
    const double seconds = (bench_process_seconds() - begin) / p->splash;
    bench_row(table, "%s in all,%d,%.1f,%.3f,0,%.2f", phase, p->splash, seconds * 1e3,
              seconds / b->awake, most);
}

/* The state is kept before the drop, so that the same pool can be woken. */
static void measure(basin *b, const plan *p, bench_table *table)
{
    double most = 0.0;
    run(b, table, "moving", p->part, &most);
    open_step(b, SLEEP_SPEED);
    for (int n = 0; n < p->most; n += p->part)
        if (run(b, table, "comes to rest", p->part, &most) == b->count)
            break;
    (void)run(b, table, "at rest", p->part, &most);
    const size_t size = ascc_particles_snapshot_size(b->particles);
    void *state = malloc(size);
    if (!state)
        bench_fail("no memory for a snapshot");
    check(b, ascc_particles_snapshot(b->particles, state, size), "snapshot");
    splash(b, p, table, "drop");
    check(b, ascc_particles_restore(b->particles, state, size), "restore");
    free(state);
    open_step(b, 0.0);
    splash(b, p, table, "drop awake");
}

void bench_pool(const bench_options *o)
{
    const plan *p = o->quick ? &quick : &whole;
    basin b = {.context = bench_context(o->cpu, o->threads), .info = {.size = sizeof b.info}};
    ascc_host_error why = {""};
    if (ascc_host_load(b.context, o->model ? o->model : "water3d", &b.model, &why) != ASCC_OK)
        bench_fail("model: %s", why.text);
    check(&b, ascc_model_get_info(b.model, &b.info), "model");
    fill(&b, p);
    open_step(&b, 0.0);
    char note[128];
    snprintf(note, sizeof note, "%s, %zu particles, %zu wall points; CPU time of all threads",
             o->model ? o->model : "water3d", b.count, b.walls);
    bench_table table =
        bench_table_open(o, "pool", note, "phase,steps,step_ms,of_moving,asleep,fastest");
    measure(&b, p, &table);
    bench_table_close(&table);
    ascc_step_destroy(&b.step);
    ascc_particles_destroy(&b.particles);
    ascc_model_destroy(&b.model);
    ascc_context_destroy(&b.context);
}
