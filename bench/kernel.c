/* Every kernel alone, and how near it comes to what the machine allows. SPDX-License-Identifier: MIT
 *
 * A block of 50,000 jittered particles, radius 0.1 = 2 spacings, about 28 neighbours.
 * Useful flops: 16 Cin for each neighbour, 2 * 64 * Cin * Cout for each row; nothing for geometry,
 * search, the antisymmetric layer's mapping, or for padding.
 */
#include <stdlib.h>
#include <string.h>

#include "bench.h"
#include "model/plan.h"

#ifdef BENCH_HAVE_OPENBLAS
#include <cblas.h>
#endif

#define TILE                                                                                       \
    24 /* rows that a layer gathers before it multiplies, and their padding, as in network.c */
#define PADDING 16
#define CELLS 64
#define BLAS_ROWS 4096
#define TAPS 27

static const int32_t cells[3] = {4, 4, 4};

typedef struct kernel_job {
    bench_field field;
    const ascc_kernels *kernels;
    size_t pairs, longest;
    size_t a, b, stride; /* channels, floats from column to column */
    float *feature, *weight, *column, *out, *big;
    float *geometry; /* x, y, z, window of all pairs */
    float scratch[4][4096 + 16];
} kernel_job;

static float *floats(size_t count)
{
    float *f = aligned_alloc(64, (count * sizeof *f + 127) / 64 * 64);
    if (!f)
        bench_fail("no memory for %zu floats", count);
    for (size_t i = 0; i < count; i++)
        f[i] = (float)(i * 2654435761u % 1024) / 1024.0f - 0.5f;
    return f;
}

static ascc_pairs pairs_at(float *x, float *y, float *z, float *window)
{
    return (ascc_pairs){.x = x, .y = y, .z = z, .window = {NULL, window, NULL}};
}

static void geometry_of(const kernel_job *j, size_t row, const ascc_pairs *to)
{
    const ascc_rows *rows = &j->field.rows;
    const ascc_points *p = &j->field.points;
    const ascc_coordinates points = {p->low[0], p->low[1], p->low[2]};
    j->kernels->geometry(&points, rows->neighbor + rows->start[row], rows->count[row],
                         p->low[0][row], p->low[1][row], p->low[2][row],
                         (float)(1.0 / rows->radius), ASCC_MAPPING_VOLUME, to);
}

static void run_search(void *data)
{
    bench_field_search(&((kernel_job *)data)->field);
}

static void run_geometry(void *data)
{
    kernel_job *j = data;
    const ascc_pairs g = pairs_at(j->scratch[0], j->scratch[1], j->scratch[2], j->scratch[3]);
    for (size_t i = 0; i < j->field.points.count; i++)
        geometry_of(j, i, &g);
}

static void gather_row(const kernel_job *j, size_t row, const ascc_pairs *g)
{
    const ascc_rows *rows = &j->field.rows;
    j->kernels->gather(g, g->window[1], rows->neighbor + rows->start[row], rows->count[row],
                       j->feature, j->a, cells, j->column + row % TILE * j->stride);
}

/* With the geometry read from memory, 16 bytes a pair. */
static void run_gather(void *data)
{
    const kernel_job *j = data;
    const size_t room = j->pairs + 16;
    for (size_t i = 0; i < j->field.points.count; i++) {
        float *x = j->geometry + j->field.rows.start[i];
        const ascc_pairs g = pairs_at(x, x + room, x + 2 * room, x + 3 * room);
        gather_row(j, i, &g);
    }
}

static void multiply_tile(const kernel_job *j, size_t row, size_t n)
{
    memset(j->out + row * j->b, 0, n * j->b * sizeof(float));
    j->kernels->multiply(j->column, j->stride, n, CELLS * j->a, j->weight, j->b,
                         j->out + row * j->b, j->b);
}

static void run_multiply(void *data)
{
    const kernel_job *j = data;
    for (size_t i = 0; i < j->field.points.count; i += TILE)
        multiply_tile(j, i, ascc_min_size(TILE, j->field.points.count - i));
}

/* Geometry on the fly, gather and multiply: a layer as the network runs it. */
static void run_layer(void *data)
{
    kernel_job *j = data;
    const ascc_pairs g = pairs_at(j->scratch[0], j->scratch[1], j->scratch[2], j->scratch[3]);
    for (size_t i = 0; i < j->field.points.count; i += TILE) {
        const size_t n = ascc_min_size(TILE, j->field.points.count - i);
        for (size_t r = i; r < i + n; r++) {
            geometry_of(j, r, &g);
            gather_row(j, r, &g);
        }
        multiply_tile(j, i, n);
    }
}

/* A stencil over rows that lie anywhere, as many as each has taps. */
static void run_stencil(void *data)
{
    const kernel_job *j = data;
    const ascc_rows *rows = &j->field.rows;
    const float *in[TILE * TAPS];
    for (size_t i = 0; i < j->field.points.count; i += TILE) {
        const size_t n = ascc_min_size(TILE, j->field.points.count - i);
        for (size_t r = i; r < i + n; r++)
            for (size_t t = 0; t < TAPS; t++)
                in[(r - i) * TAPS + t] =
                    j->feature +
                    rows->neighbor[rows->start[r] + (t < rows->count[r] ? t : 0)] * j->a;
        memset(j->out + i * j->b, 0, n * j->b * sizeof(float));
        j->kernels->multiply_blocks(in, TAPS, n, j->a, j->weight, j->b, j->out + i * j->b, j->b);
    }
}

#ifdef BENCH_HAVE_OPENBLAS
static void sgemm(const kernel_job *j, const float *in, size_t stride, size_t n)
{
    cblas_sgemm(CblasRowMajor, CblasNoTrans, CblasNoTrans, (int)n, (int)j->b, (int)(CELLS * j->a),
                1.0f, in, (int)stride, j->weight, (int)j->b, 0.0f, j->out, (int)j->b);
}

/* The same tile again and again, as run_multiply. */
static void run_sgemm_tile(void *data)
{
    const kernel_job *j = data;
    for (size_t i = 0; i < j->field.points.count; i += TILE)
        sgemm(j, j->column, j->stride, ascc_min_size(TILE, j->field.points.count - i));
}

/* Many rows at once, which must have been gathered to memory before. */
static void run_sgemm(void *data)
{
    const kernel_job *j = data;
    for (size_t i = 0; i < j->field.points.count; i += BLAS_ROWS)
        sgemm(j, j->big, CELLS * j->a, ascc_min_size(BLAS_ROWS, j->field.points.count - i));
}
#endif

static void open_job(kernel_job *j, size_t count, uint32_t cpu)
{
    memset(j, 0, sizeof *j);
    bench_field_open(&j->field, count, cpu);
    j->kernels = &j->field.context->kernels;
    j->pairs = j->field.rows.used;
    if (j->field.rows.longest > 4096)
        bench_fail("rows are too long");
    j->feature = floats(count * 32);
    j->weight = floats((size_t)CELLS * 32 * 32);
    j->column = floats((size_t)TILE * (CELLS * 32 + PADDING));
    j->big = floats((size_t)BLAS_ROWS * CELLS * 32);
    j->out = floats(ascc_max_size(count, BLAS_ROWS) * 32);
    const size_t room = j->pairs + 16;
    j->geometry = floats(4 * room);
    for (size_t i = 0; i < count; i++) {
        float *x = j->geometry + j->field.rows.start[i];
        const ascc_pairs g = pairs_at(x, x + room, x + 2 * room, x + 3 * room);
        geometry_of(j, i, &g);
    }
}

/* Weights and columns to pages of their own choosing. */
static void move_arrays(void *data)
{
    kernel_job *j = data;
    float *weight = j->weight, *column = j->column;
    j->weight = floats((size_t)CELLS * 32 * 32);
    j->column = floats((size_t)TILE * (CELLS * 32 + PADDING));
    free(weight);
    free(column);
}

static void close_job(kernel_job *j)
{
    bench_field_close(&j->field);
    float *const all[] = {j->feature, j->weight, j->column, j->big, j->out, j->geometry};
    for (size_t i = 0; i < sizeof all / sizeof *all; i++)
        free(all[i]);
}

/* ---- The list ---- */

enum { NONE, GATHER, MULTIPLY, LAYER, STENCIL };

static const struct kernel_case {
    const char *name;
    void (*run)(void *);
    int work;
    size_t a, b;
} cases[] = {
    {"search", run_search, NONE, 8, 8},
    {"geometry", run_geometry, NONE, 8, 8},
    {"gather 32", run_gather, GATHER, 32, 32},
    {"gather 16", run_gather, GATHER, 16, 16},
    {"gather 8", run_gather, GATHER, 8, 8},
    {"multiply 32->32", run_multiply, MULTIPLY, 32, 32},
    {"multiply 16->16", run_multiply, MULTIPLY, 16, 16},
    {"multiply 8->8", run_multiply, MULTIPLY, 8, 8},
    {"layer 32->32", run_layer, LAYER, 32, 32},
    {"layer 16->16", run_layer, LAYER, 16, 16},
    {"layer 8->8", run_layer, LAYER, 8, 8},
    {"stencil 32->32", run_stencil, STENCIL, 32, 32},
    {"stencil 16->16", run_stencil, STENCIL, 16, 16},
};

static double gather_flops(const kernel_job *j, size_t a)
{
    return 16.0 * (double)a * (double)j->pairs;
}

static double multiply_flops(const kernel_job *j, size_t a, size_t b)
{
    return 2.0 * CELLS * (double)(a * b) * (double)j->field.points.count;
}

static double flops_of(const kernel_job *j, const struct kernel_case *c)
{
    if (c->work == STENCIL)
        return 2.0 * TAPS * (double)(c->a * c->b) * (double)j->field.points.count;
    return (c->work & GATHER ? gather_flops(j, c->a) : 0.0) +
           (c->work & MULTIPLY ? multiply_flops(j, c->a, c->b) : 0.0);
}

static bool wanted(const bench_options *o, const char *name)
{
    return !o->only || strstr(name, o->only) != NULL;
}

static void report(bench_table *table, const char *name, const char *variant, size_t particles,
                   size_t pairs, const bench_result *r)
{
    const double ns = 1e9 / (double)particles;
    char flops[128] = ",,,";
    if (r->flops > 0.0)
        (void)snprintf(flops, sizeof flops, "%.2f,%.3f,%.3f,%.3f",
                       r->flops / r->seconds.median * 1e-9, r->share.median, r->share.min,
                       r->share.max);
    bench_row(table, "%s,%s,%zu,%.2f,%.1f,%.1f,%.1f,%.2f,%s", name, variant, particles,
              (double)pairs / (double)particles, r->seconds.median * ns, r->seconds.min * ns,
              r->seconds.max * ns, r->seconds.median * 1e9 / (double)pairs, flops);
}

static void set_channels(kernel_job *j, size_t a, size_t b)
{
    j->a = a;
    j->b = b;
    j->stride = CELLS * a + PADDING;
}

static void run_cases(const bench_options *o, bench_table *table, kernel_job *j,
                      const char *variant)
{
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct kernel_case *c = &cases[i];
        if (!wanted(o, c->name))
            continue;
        set_channels(j, c->a, c->b);
        const bench_result r =
            bench_measure(o, c->run, c->work ? move_arrays : NULL, j, flops_of(j, c));
        report(table, c->name, variant, j->field.points.count, j->pairs, &r);
    }
}

static void run_openblas(const bench_options *o, bench_table *table, kernel_job *j)
{
#ifdef BENCH_HAVE_OPENBLAS
    openblas_set_num_threads(1);
    for (size_t a = 32; a >= 8; a /= 2) {
        char name[32];
        (void)snprintf(name, sizeof name, "multiply %zu->%zu", a, a);
        if (!wanted(o, name))
            continue;
        set_channels(j, a, a);
        const double flops = multiply_flops(j, a, a);
        bench_result r = bench_measure(o, run_sgemm_tile, move_arrays, j, flops);
        report(table, name, "openblas 24 rows", j->field.points.count, j->pairs, &r);
        r = bench_measure(o, run_sgemm, move_arrays, j, flops);
        report(table, name, "openblas 4096 rows", j->field.points.count, j->pairs, &r);
    }
#else
    (void)j;
    if (wanted(o, "multiply"))
        bench_row(table, "# no OpenBLAS was found when this was built");
#endif
}

/* Kernel value 2 * 8 * 3 * 32, features added 32, products 2 * 3 * 32. */
#define PAIR_FLOPS (16.0 * 3 * 32 + 32 + 6 * 32)

static void run_pairs(const bench_options *o, bench_table *table, size_t count, uint32_t cpu,
                      const char *variant)
{
    if (!wanted(o, "antisymmetric 32->3"))
        return;
    bench_pairs *p = bench_pairs_open(count, cpu);
    const size_t pairs = bench_pairs_count(p);
    const double flops = PAIR_FLOPS * (double)pairs;
    bench_result r = bench_measure(o, bench_pairs_exact, NULL, p, flops);
    report(table, "antisymmetric 32->3 exact", variant, count, pairs, &r);
    r = bench_measure(o, bench_pairs_float, NULL, p, flops);
    report(table, "antisymmetric 32->3 float", variant, count, pairs, &r);
    bench_row(table, "# momentum of %s: exact sums 0, float sums off by %.2g of their magnitudes",
              variant, bench_pairs_drift(p));
    bench_pairs_close(p);
}

static size_t block_size(const bench_options *o, const bench_isa *isa)
{
    const size_t count = o->particles ? o->particles : o->quick ? 8000 : 50000;
    return isa->cpu ? count : count / 10 + 1; /* portable C has no fma instruction */
}

void bench_kernel(const bench_options *o)
{
    const bench_isa *isas;
    const size_t count = bench_isas(&isas);
    kernel_job *j = malloc(sizeof *j);
    if (!j)
        bench_fail("no memory");
    bench_table table = bench_table_open(
        o, "kernel",
        "thread CPU time; GFLOP/s from the median; each share against a peak measured next to it",
        "kernel,variant,particles,neighbours,ns_per_particle,min,max,ns_per_pair,gflops,"
        "peak_share,share_min,share_max");
    for (size_t i = 0; i < count; i++) {
        if (o->one_cpu && o->cpu != isas[i].cpu)
            continue;
        const size_t particles = block_size(o, &isas[i]);
        open_job(j, particles, isas[i].cpu);
        run_cases(o, &table, j, isas[i].name);
        if (i == count - 1)
            run_openblas(o, &table, j);
        close_job(j);
        run_pairs(o, &table, particles, isas[i].cpu, isas[i].name);
    }
    bench_table_close(&table);
    free(j);
}

/* ---- Roofline ---- */

/* Bytes that must cross from the second cache to the first: each array an inner pass touches once, a
 * column written and read once, the multiply's weights once for each tile. */
static double bytes_of(const kernel_job *j, const struct kernel_case *c)
{
    const double rows = (double)j->field.points.count, a = (double)c->a, b = (double)c->b;
    const double pairs = (double)j->pairs;
    const double gather = 4.0 * (pairs * (5.0 + a) + rows * CELLS * a);
    const double multiply = 4.0 * rows * (CELLS * a + 2.0 * b + CELLS * a * b / TILE);
    return (c->work & GATHER ? gather : 0.0) + (c->work & MULTIPLY ? multiply : 0.0);
}

static void roof_points(const bench_options *o, bench_table *table, kernel_job *j)
{
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const struct kernel_case *c = &cases[i];
        if (c->work == NONE)
            continue;
        set_channels(j, c->a, c->b);
        const bench_result r =
            bench_measure(o, c->run, c->work ? move_arrays : NULL, j, flops_of(j, c));
        bench_row(table, "%s,%.3f,%.2f,%.3f", c->name, r.flops / bytes_of(j, c),
                  r.flops / r.seconds.median * 1e-9, r.share.median);
    }
    bench_pairs *p = bench_pairs_open(j->field.points.count, o->cpu);
    const double pairs = (double)bench_pairs_count(p);
    const bench_result r = bench_measure(o, bench_pairs_exact, NULL, p, PAIR_FLOPS * pairs);
    bench_row(table, "antisymmetric 32->3,%.3f,%.2f,%.3f",
              PAIR_FLOPS / (4.0 * (8 * 3 * 32 + 32 + 9)), r.flops / r.seconds.median * 1e-9,
              r.share.median);
    bench_pairs_close(p);
}

static const struct roof {
    const char *name;
    size_t bytes;
} roofs[] = {{"L1", 24 << 10}, {"L2", 300 << 10}, {"L3", 12 << 20}, {"memory", 384 << 20}};
#define ROOFS (sizeof roofs / sizeof *roofs)

static const char roof_script[] =
    "set title 'Kernels against the roofs of '.cpu.', one thread' font ',15'\n"
    "set logscale xy 2\nset xrange [0.25:16]\nset yrange [4:160]\n"
    "set xlabel 'useful flops per byte between first and second cache'\n"
    "set ylabel 'GFLOP/s'\nset grid lc '#e0e0e0' lt 1\nset key off\nset border 3\n"
    "set tics nomirror\nset ytics (4,8,16,32,64,128)\nset xtics (0.25,0.5,1,2,4,8,16)\n"
    "low(x, y) = x < y ? x : y\n"
    "is(what) = strcol(1)[1:strlen(what)] eq what\n"
    "crowded(c) = strcol(c) eq 'multiply 16->16'\n"
    "do for [i = 1:4] { x = 0.28 * (i == 4 ? 2.1 : 1); y = bandwidth[i] * x\n"
    "  set label i level[i].sprintf(' %.0f GB/s', bandwidth[i]) at x, y * 1.08 rotate by 37 "
    "tc '#606060' font ',11' }\n"
    "set label 9 sprintf('measured FMA peak %.0f GFLOP/s', peak) at 15.5, peak * 1.07 right "
    "tc '#606060' font ',11'\n"
    "points = \"gather multiply layer antisymmetric\"\n"
    "colour = \"#0072b2 #d55e00 #009e73 #aa4499\"\n"
    "plot for [i = 1:4] low(peak, bandwidth[i] * x) with lines lw 1.5 lc '#909090' dt 2, \\\n"
    "  for [i = 1:4] '%DATA%' using (is(word(points, i)) ? $2 : NaN):3 with points pt 7 ps 1.2 "
    "lc rgb word(colour, i), \\\n"
    "  for [i = 1:3] '%DATA%' using (is(word(points, i)) && !crowded(1) ? $2 : NaN):3:1 "
    "with labels left offset 0.9,0 tc rgb word(colour, i) font ',10', \\\n"
    "  '%DATA%' using (crowded(1) ? $2 : NaN):3:1 "
    "with labels right offset -0.9,0 tc rgb word(colour, 2) font ',10', \\\n"
    "  '%DATA%' using (is(word(points, 4)) ? $2 : NaN):3:1 "
    "with labels left offset 0.9,0.25 tc rgb word(colour, 4) font ',10'\n";

static void draw_roofs(const bench_options *o, double peak, const double bandwidth[ROOFS])
{
    char script[sizeof roof_script + 512];
    size_t used = (size_t)snprintf(script, sizeof script,
                                   "peak = %.2f\narray level[4]\narray bandwidth[4]\n", peak);
    for (size_t i = 0; i < ROOFS; i++)
        used += (size_t)snprintf(script + used, sizeof script - used,
                                 "level[%zu] = '%s'\nbandwidth[%zu] = %.2f\n", i + 1, roofs[i].name,
                                 i + 1, bandwidth[i]);
    (void)snprintf(script + used, sizeof script - used, "%s", roof_script);
    bench_chart(o, "roofline", 900, 620, script);
}

void bench_roofline(const bench_options *o)
{
    kernel_job *j = malloc(sizeof *j);
    if (!j)
        bench_fail("no memory");
    bench_table table = bench_table_open(
        o, "roofline", "intensity: useful flops per byte between first and second cache",
        "kernel,intensity,gflops,peak_share");
    const double peak = bench_peak();
    double bandwidth[ROOFS];
    bench_row(&table, "roof FMA,,%.1f,", peak);
    for (size_t i = 0; i < ROOFS; i++) {
        bandwidth[i] = bench_bandwidth(roofs[i].bytes);
        bench_row(&table, "roof %s triad GB/s,,%.1f,", roofs[i].name, bandwidth[i]);
    }
    open_job(j, o->particles ? o->particles : o->quick ? 8000 : 50000, o->cpu);
    roof_points(o, &table, j);
    close_job(j);
    free(j);
    bench_table_close(&table);
    draw_roofs(o, peak, bandwidth);
}
