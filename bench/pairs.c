/* The antisymmetric layer with integer sums, as the library has it, beside one that sums floats.
 * SPDX-License-Identifier: MIT
 *
 * The twin walks the same rows, calls the same kernels on the same batches, and keeps the momenta as
 * floats: what a solver would do that only promises momentum up to rounding. It is on one thread, so it
 * needs none of the passes that cut rows into independent chunks.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../tests/support/model_builder.h"
#include "network/column.h"
#include "model/model.h"
#include "network/pair_sum.h"
#include "bench.h"

#define BATCH 64

struct bench_pairs {
    ascc_context *context;
    ascc_model *model;
    ascc_arena scene_arena, arena;
    ascc_message message;
    ascc_search_tools tools;
    ascc_network network;
    ascc_hierarchy hierarchy;
    ascc_network_run run;
    size_t count;
    double *mass;
    int64_t *impulse;
    float *sum;
    uint64_t pair_count;
};

static void check(const bench_pairs *p, ascc_status status)
{
    if (status != ASCC_OK)
        bench_fail("antisymmetric: %s: %s", ascc_status_text(status), p->message.text);
}

static void run_network(bench_pairs *p)
{
    double *x = bench_block(p->count, 3);
    float *features = calloc(p->count, 4 * sizeof *features);
    if (!features)
        bench_fail("no memory for features");
    for (size_t i = 0; i < p->count; i++)
        for (size_t c = 0; c < 4; c++)
            features[i * 4 + c] = c == 0 ? 1.0f : (float)sin((double)(i * 3 + c));
    const ascc_scene scene = {.fluid_count = p->count, .fluid = x};
    p->tools.arena = &p->scene_arena;
    check(p, ascc_hierarchy_build(&p->hierarchy, &p->tools, &p->model->plan, &scene));
    check(p, ascc_network_demand(&p->run, &p->network, &p->hierarchy, &p->tools, NULL));
    check(p, ascc_network_forward(&p->run, features, features));
    p->tools.arena = &p->arena; /* what the layer takes is given back each time */
    free(features);
    free(x);
}

bench_pairs *bench_pairs_open(size_t count, uint32_t cpu)
{
    bench_pairs *p = calloc(1, sizeof *p);
    if (!p)
        bench_fail("no memory");
    p->count = count;
    p->context = bench_context(cpu, 1);
    const model_random options = {.dimension = 3,
                                  .channels = 32,
                                  .trunk_layers = 1,
                                  .cells = 2, /* only the last layer is timed */
                                  .projection = "none",
                                  .spacing = BENCH_SPACING};
    size_t size;
    unsigned char *file = model_builder_random(&options, &size);
    check(p, ascc_model_load_memory(p->context, file, size, &p->model));
    free(file);
    ascc_arena_open(&p->scene_arena, &p->context->allocator);
    ascc_arena_open(&p->arena, &p->context->allocator);
    p->tools = (ascc_search_tools){&p->scene_arena, p->context->workers, &p->context->kernels,
                                   &p->message};
    check(p, ascc_network_create(&p->network, &p->context->allocator, &p->model->plan,
                                 &p->model->packed, 4096, &p->message));
    p->mass = malloc(count * sizeof *p->mass);
    p->impulse = malloc(count * 3 * sizeof *p->impulse);
    p->sum = malloc(count * 3 * sizeof *p->sum);
    if (!p->mass || !p->impulse || !p->sum)
        bench_fail("no memory for %zu particles", count);
    for (size_t i = 0; i < count; i++)
        p->mass[i] = 1.0;
    run_network(p);
    bench_pairs_exact(p);
    return p;
}

void bench_pairs_exact(void *data)
{
    bench_pairs *p = data;
    const ascc_impulse_scale scale = {.mass = p->mass, .factor = {1e6, 1e6, 1e6}};
    const ascc_impulses impulses = {.fluid = p->impulse};
    ascc_arena_reset(&p->arena);
    check(p, p->model->plan.output.term.operation->impulses(&p->run, &scale, &impulses,
                                                            &p->pair_count));
}

/* One batch of the twin, its geometry filled up to whole vectors as the library's. */
static void flush(bench_pairs *p, const ascc_rows *rows, size_t i, uint32_t *neighbor, size_t count)
{
    size_t filled = count;
    for (; filled % 8; filled++)
        neighbor[filled] = neighbor[0];
    const ascc_term *output = &p->network.plan->output.term;
    const float *value = ascc_term_source(&p->run, output);
    const size_t a = ascc_padded(output->inputs);
    float geometry[ASCC_GEOMETRY_ARRAYS * BATCH], term[BATCH][4];
    ascc_geometry g;
    ascc_geometry_of(&g, &p->run, rows, &output->filter, i, neighbor, filled, geometry, BATCH);
    p->tools.kernels->pair_terms(&g.pairs, g.window, neighbor, count, value + i * a, value, a,
                                 output->filter.cells, ascc_term_packed(&p->run, output), 3,
                                 term[0]);
    for (size_t k = 0; k < count; k++)
        for (size_t c = 0; c < 3; c++) {
            const float impulse = term[k][c] * 1e6f;
            p->sum[i * 3 + c] += impulse;
            p->sum[neighbor[k] * 3 + c] -= impulse;
        }
}

void bench_pairs_float(void *data)
{
    bench_pairs *p = data;
    const ascc_rows *rows = ascc_term_list(&p->run, &p->network.plan->output.term, 0);
    memset(p->sum, 0, p->count * 3 * sizeof *p->sum);
    for (size_t i = 0; i < p->count; i++) {
        uint32_t batch[BATCH];
        size_t count = 0;
        for (size_t k = rows->start[i]; k < rows->start[i] + rows->count[i]; k++) {
            if (rows->neighbor[k] <= i)
                continue;
            batch[count] = rows->neighbor[k];
            if (++count == BATCH) {
                flush(p, rows, i, batch, count);
                count = 0;
            }
        }
        if (count)
            flush(p, rows, i, batch, count);
    }
}

size_t bench_pairs_count(const bench_pairs *p)
{
    return (size_t)p->pair_count;
}

double bench_pairs_drift(const bench_pairs *p)
{
    double total[3] = {0.0, 0.0, 0.0}, scale = 0.0;
    for (size_t i = 0; i < p->count * 3; i++) {
        total[i % 3] += (double)p->sum[i];
        scale += fabs((double)p->sum[i]);
    }
    return sqrt(total[0] * total[0] + total[1] * total[1] + total[2] * total[2]) / scale;
}

void bench_pairs_close(bench_pairs *p)
{
    ascc_network_destroy(&p->network);
    ascc_arena_close(&p->scene_arena);
    ascc_arena_close(&p->arena);
    ascc_model_destroy(&p->model);
    ascc_context_destroy(&p->context);
    free(p->mass);
    free(p->impulse);
    free(p->sum);
    free(p);
}
