/* Blocks of particles, searched as a step does it. SPDX-License-Identifier: MIT */
#include "field.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "clock.h"

double *bench_block(size_t count, int32_t dimension)
{
    const size_t d = (size_t)dimension;
    const size_t side = (size_t)ceil(pow((double)count, 1.0 / (double)d) - 1e-9);
    double *x = malloc(count * d * sizeof *x);
    if (!x)
        bench_fail("no memory for %zu particles", count);
    uint64_t state = 1;
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0, at = i; c < d; c++, at /= side) {
            state = state * 6364136223846793005u + 1442695040888963407u;
            const double jitter = (double)(state >> 33) / 2147483648.0 - 0.5;
            x[i * d + c] = BENCH_SPACING * ((double)(at % side) + 0.4 * jitter);
        }
    return x;
}

ascc_context *bench_context(uint32_t cpu, int32_t threads)
{
    ascc_context *context;
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = threads,
                                          .cpu_disable = ascc_kernels_available() & ~cpu};
    if (ascc_context_create(&options, &context) != ASCC_OK)
        bench_fail("no context with %d threads", threads);
    return context;
}

void bench_field_open(bench_field *f, size_t count, uint32_t cpu)
{
    memset(f, 0, sizeof *f);
    f->context = bench_context(cpu, 1);
    ascc_arena_open(&f->arena, &f->context->allocator);
    f->tools =
        (ascc_search_tools){&f->arena, f->context->workers, &f->context->kernels, &f->message};
    f->scale = ascc_scale_for_radius(2.0 * BENCH_SPACING);
    double *x = bench_block(count, 3);
    for (int c = 0; c < 3; c++) {
        f->host.position[c] = malloc(count * sizeof(int64_t));
        f->host.low[c] = malloc(count * sizeof(int32_t));
        if (!f->host.position[c] || !f->host.low[c])
            bench_fail("no memory for %zu particles", count);
    }
    f->host.count = count;
    for (size_t i = 0; i < count; i++) {
        int64_t at[3];
        for (size_t c = 0; c < 3; c++)
            if (!ascc_scale_apply(&f->scale, x[i * 3 + c], &at[c]))
                bench_fail("a position is out of range");
        ascc_points_set(&f->host, i, at);
    }
    free(x);
    bench_field_search(f);
}

/* All that a step does to find the rows of its particles: order, cells, rows. */
void bench_field_search(bench_field *f)
{
    ascc_arena_reset(&f->arena);
    const size_t count = f->host.count;
    const double radius = 2.0 * BENCH_SPACING * f->scale.inverse;
    uint32_t *order = ascc_arena_take(&f->arena, count, sizeof *order);
    ascc_extent_start(&f->extent);
    ascc_extent_add(&f->extent, &f->host);
    if (!order || !ascc_points_take(&f->points, &f->arena, count) ||
        ascc_points_order(&f->tools, &f->host, &f->extent, ascc_grid_cell(radius), order))
        bench_fail("search: %s", f->message.text);
    for (size_t i = 0; i < count; i++) {
        const int64_t at[3] = {f->host.position[0][order[i]], f->host.position[1][order[i]],
                               f->host.position[2][order[i]]};
        ascc_points_set(&f->points, i, at);
    }
    if (ascc_grid_build(&f->grid, &f->tools, &f->points, &f->extent, radius, true))
        bench_fail("search: %s", f->message.text);
    const size_t expected = f->rows.used;
    f->rows = (ascc_rows){.query = &f->points,
                          .source = &f->points,
                          .query_grid = &f->grid,
                          .source_grid = &f->grid,
                          .radius = radius,
                          .same = true,
                          .max_neighbors = 4096};
    if (ascc_rows_open(&f->rows, &f->tools, expected ? expected + expected / 8 : 32 * count) ||
        ascc_rows_make(&f->rows, &f->tools, NULL))
        bench_fail("search: %s", f->message.text);
}

void bench_field_close(bench_field *f)
{
    for (int c = 0; c < 3; c++) {
        free(f->host.position[c]);
        free(f->host.low[c]);
    }
    ascc_arena_close(&f->arena);
    ascc_context_destroy(&f->context);
}
