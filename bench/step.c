/* Whole steps: by phase, on more threads, from a thousand to a million particles, and loading.
 * SPDX-License-Identifier: MIT
 *
 * A step is always run from the same state: it is restored before each repeat. On one thread all times
 * are CPU time of that thread, the library's phases included; on more they are wall-clock time.
 */
#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../examples/ascc/host.h"
#include "../examples/ascc/scenes.h"
#include "../tests/support/model_builder.h"
#include "bench.h"
#include "model/model.h"
#include "network/network.h"
#include "network/operations.h"

typedef struct subject {
    ascc_context *context;
    ascc_model *model;
    ascc_model_info info;
    ascc_particles *particles;
    ascc_step *step;
    ascc_step_statistics last;
    unsigned char *state;
    size_t state_size, count, walls;
    int64_t drift; /* quanta, the worst seen */
} subject;

typedef struct subject_options {
    const char *scene, *model;
    int32_t dimension, threads;
    size_t particles;
    uint32_t cpu;
} subject_options;

/* ---- Models ---- */

/* 16 channels, 3 layers in the small basis, 2 scales joined by transfers (3D); weights not trained: how
 * much a small network costs. */
static unsigned char *tiny_model(int32_t dimension, size_t *size)
{
    if (dimension == 3)
        return model_builder_tiny(BENCH_SPACING, size);
    const model_random options = {.dimension = dimension,
                                  .levels = 2,
                                  .channels = 16,
                                  .trunk_layers = 2,
                                  .bumps = 3,
                                  .order = 1,
                                  .transfer = 1,
                                  .method = "voxel_corners",
                                  .no_hysteresis = 1,
                                  .scale = 1e-6,
                                  .spacing = BENCH_SPACING};
    return model_builder_random(&options, size);
}

/* False when a published network is not there. */
static bool load_model(const bench_options *o, const char *name, int32_t dimension, subject *s)
{
    char published[1024];
    const char *path = name;
    if (strcmp(name, "dmcf") == 0 || strcmp(name, "cconv") == 0) {
        (void)snprintf(published, sizeof published, "%s/data/weights/%s-liquid3d.safetensors",
                       o->shared, name);
        path = published;
        if (access(path, R_OK) != 0)
            return false;
    }
    ascc_status status;
    ascc_host_error why = {""};
    if (strcmp(name, "tiny") == 0) {
        size_t size;
        unsigned char *bytes = tiny_model(dimension, &size);
        status = ascc_model_load_memory(s->context, bytes, size, &s->model);
        free(bytes);
    } else
        status = ascc_host_model(s->context, path, dimension, BENCH_SPACING, &s->model, &why);
    if (status != ASCC_OK)
        bench_fail("model %s: %s", name, why.text);
    s->info.size = sizeof s->info;
    (void)ascc_model_get_info(s->model, &s->info);
    return true;
}

/* ---- Scenes ---- */

static void make_block(ascc_sequence *scene, size_t count, int32_t dimension, double spacing)
{
    const size_t n = count * (size_t)dimension;
    double *x = bench_block(count, dimension);
    *scene = (ascc_sequence){.dimension = dimension,
                             .radius = 0.5 * spacing,
                             .mass = 1.0,
                             .frames = 1,
                             .count = count,
                             .velocity_frames = 1,
                             .position = malloc(n * sizeof(float)),
                             .velocity = calloc(n, sizeof(float))};
    if (!scene->position || !scene->velocity)
        bench_fail("no memory for %zu particles", count);
    for (size_t i = 0; i < n; i++)
        scene->position[i] = (float)(x[i] * spacing / BENCH_SPACING);
    free(x);
}

/* Particles along the longest edge of a named scene for so many particles: the blocks are half as wide. */
static int32_t edge(size_t particles, int32_t dimension)
{
    const double most =
        dimension == 2 ? sqrt(2.0 * (double)particles) : cbrt(4.0 * (double)particles);
    return particles ? (int32_t)lround(most) : 0;
}

static void make_scene(const subject_options *o, const subject *s, ascc_sequence *scene)
{
    char error[256] = "";
    const double spacing = s->info.particle_spacing;
    if (strcmp(o->scene, "block") == 0)
        make_block(scene, o->particles, s->info.dimension, spacing);
    else if (strchr(o->scene, '.') || strchr(o->scene, '/')) {
        if (!ascc_sequence_read(o->scene, scene, error, sizeof error))
            bench_fail("%s", error);
    } else if (!ascc_scene_make(o->scene, s->info.dimension, edge(o->particles, s->info.dimension),
                                spacing, scene, error, sizeof error))
        bench_fail("%s", error);
}

static void fill_particles(subject *s, const ascc_sequence *scene)
{
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = scene->dimension,
                                            .spacing = 2.0 * scene->radius,
                                            .mass = scene->mass,
                                            .fluid_capacity = scene->count,
                                            .boundary_capacity = scene->walls};
    const ascc_const_array x = {.data = scene->position}, v = {.data = scene->velocity};
    const ascc_const_array wall = {.data = scene->wall}, normal = {.data = scene->normal};
    s->count = scene->count;
    s->walls = scene->walls;
    if (ascc_particles_create(s->context, &options, &s->particles) ||
        ascc_particles_add_fluid(s->particles, scene->count, &x, &v, NULL, NULL) ||
        (scene->walls &&
         ascc_particles_add_boundary(s->particles, scene->walls, &wall, &normal, 0, NULL)))
        bench_fail("particles: %s", s->particles ? ascc_particles_message(s->particles) : "");
    s->state_size = ascc_particles_snapshot_size(s->particles);
    s->state = malloc(s->state_size);
    if (!s->state || ascc_particles_snapshot(s->particles, s->state, s->state_size))
        bench_fail("no snapshot");
}

static bool open_subject(const bench_options *b, const subject_options *o, subject *s)
{
    memset(s, 0, sizeof *s);
    s->context = bench_context(o->cpu, o->threads);
    if (!load_model(b, o->model, o->dimension, s)) {
        ascc_context_destroy(&s->context);
        return false;
    }
    ascc_sequence scene;
    make_scene(o, s, &scene);
    fill_particles(s, &scene);
    ascc_sequence_free(&scene);
    const ascc_step_options options = {.size = sizeof options};
    if (ascc_step_create(s->context, s->model, &options, &s->step))
        bench_fail("no step");
    return true;
}

static void close_subject(subject *s)
{
    ascc_step_destroy(&s->step);
    ascc_particles_destroy(&s->particles);
    ascc_model_destroy(&s->model);
    ascc_context_destroy(&s->context);
    free(s->state);
}

/* One step from the first state. */
static void run_step(subject *s)
{
    if (ascc_particles_restore(s->particles, s->state, s->state_size))
        bench_fail("restore: %s", ascc_particles_message(s->particles));
    if (ascc_step_run(s->step, s->particles, NULL, 1))
        bench_fail("step: %s", ascc_step_message(s->step));
    s->last.size = sizeof s->last;
    (void)ascc_step_get_statistics(s->step, &s->last);
    for (int c = 0; c < 3; c++) {
        const int64_t drift = s->last.momentum_after[c] - s->last.momentum_before[c] -
                              s->last.external_impulse[c] + s->last.wall_impulse[c];
        const int64_t size = drift < 0 ? -drift : drift;
        s->drift = size > s->drift ? size : s->drift;
    }
}

/* ---- Useful flops of a step, counted over the rows that it computes ---- */

static double term_flops(const ascc_network_run *run, const ascc_term *term, int32_t key,
                         const uint8_t *active, size_t count)
{
    const double in = (double)term->inputs, out = (double)term->outputs;
    const int32_t *c = term->filter.cells;
    const double corners = c[2] > 1 ? 8.0 : 4.0, cells = (double)ascc_cell_count(&term->filter);
    double rows = 0.0, pairs = 0.0;
    for (size_t i = 0; i < count; i++)
        if (active[i]) {
            rows += 1.0;
            pairs += key >= 0 ? (double)run->rows[key].count[i] : 0.0;
        }
    const double reached = term->operation == &ascc_op_grid ? corners : cells;
    return term->tensor[ASCC_TENSOR_WEIGHT]
               ? 2.0 * reached * in * pairs + 2.0 * cells * in * out * rows
               : 0.0;
}

static double network_flops(const subject *s, const ascc_network_run *run)
{
    const ascc_plan *plan = &s->model->plan;
    const double d = plan->dimension, in = plan->output.term.inputs, corners = d > 2.0 ? 8.0 : 4.0;
    double flops = 0.0;
    for (int32_t l = 0; l < plan->layer_count; l++) {
        const ascc_layer *layer = &plan->layer[l];
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
            flops += term_flops(run, &plan->term[t], run->network->term_key[t][0],
                                run->value[l + 2].active, ascc_network_rows(run, layer->set));
    }
    const double bumps = plan->output.term.filter.bumps;
    if (bumps > 0.0)
        return flops + (double)s->last.pair_count * 3.0 * bumps;
    return flops + (double)s->last.pair_count * in * (2.0 * corners * d + 1.0 + 2.0 * d);
}

/* Finds the rows once more: which are computed is not among a step's statistics. */
static double count_flops(const subject *s)
{
    ascc_arena arena;
    ascc_message message;
    ascc_network network;
    ascc_hierarchy hierarchy;
    ascc_network_run run;
    ascc_arena_open(&arena, &s->context->allocator);
    const ascc_search_tools tools = {&arena, s->context->workers, &s->context->kernels, &message};
    const size_t d = (size_t)s->info.dimension;
    double *x = malloc((s->count + s->walls + 1) * d * sizeof *x);
    const ascc_array fluid = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_array wall = {.data = x + s->count * d, .scalar = ASCC_DOUBLE};
    const ascc_scene scene = {.fluid_count = s->count,
                              .boundary_count = s->walls,
                              .fluid = x,
                              .boundary = x + s->count * d};
    if (!x || ascc_particles_get(s->particles, ASCC_FLUID, ASCC_POSITION, 0, s->count, &fluid) ||
        (s->walls &&
         ascc_particles_get(s->particles, ASCC_BOUNDARY, ASCC_POSITION, 0, s->walls, &wall)))
        bench_fail("no positions");
    if (ascc_network_create(&network, &s->context->allocator, &s->model->plan, &s->model->packed,
                            4096, &message) ||
        ascc_hierarchy_build(&hierarchy, &tools, &s->model->plan, &scene) ||
        ascc_network_demand(&run, &network, &hierarchy, &tools, NULL))
        bench_fail("%s", message.text);
    const double flops = network_flops(s, &run);
    ascc_network_destroy(&network);
    ascc_arena_close(&arena);
    free(x);
    return flops;
}

/* ---- bench step ---- */

/* The whole step, then its stages. */
static const char *const phases[] = {"total",   "forces",     "sight",   "search",
                                     "network", "pairs",      "advance", "relaxation",
                                     "contact", "divergence", "commit"};
#define PHASES (sizeof phases / sizeof *phases)

static double seconds_of_phase(const ascc_step_statistics *s, size_t phase)
{
    for (int32_t i = 0; phase > 0 && i < s->stage_count; i++)
        if (strcmp(s->stage[i].name, phases[phase]) == 0)
            return s->stage[i].seconds;
    return phase == 0 ? s->seconds_total : 0.0;
}

typedef struct step_times {
    bench_spread phase[PHASES], share;
    double flops;
} step_times;

static step_times time_steps(subject *s, size_t repeats, int32_t threads)
{
    double seconds[PHASES][BENCH_REPEATS], share[BENCH_REPEATS];
    step_times times;
    run_step(s); /* takes the scratch, and gives it back as one block */
    run_step(s);
    times.flops = count_flops(s);
    bench_laps_in_cpu_time = threads == 1;
    for (size_t r = 0; r < repeats; r++) {
        run_step(s);
        for (size_t p = 0; p < PHASES; p++)
            seconds[p][r] = seconds_of_phase(&s->last, p);
        share[r] = times.flops / seconds[0][r] * 1e-9 / bench_peak() / threads;
    }
    bench_laps_in_cpu_time = false;
    for (size_t p = 0; p < PHASES; p++)
        times.phase[p] = bench_spread_of(seconds[p], repeats);
    times.share = bench_spread_of(share, repeats);
    return times;
}

static void step_row(const bench_options *b, bench_table *table, const subject_options *o,
                     const char *variant)
{
    subject *s = malloc(sizeof *s);
    if (!s || !open_subject(b, o, s)) {
        bench_row(table, "# %s: not there, not measured", o->model);
        free(s);
        return;
    }
    const step_times t = time_steps(s, bench_repeats(b), o->threads);
    const double ns = 1e9 / (double)s->count;
    char stages[256] = "";
    for (size_t p = 1, at = 0; p < PHASES; p++)
        at += (size_t)snprintf(stages + at, sizeof stages - at, "%.1f,", t.phase[p].median * ns);
    bench_row(table, "%s,%s,%d,%zu,%zu,%s,%d,%.1f,%.1f,%.1f,%s%.2f,%.3f,%.1f,%.0f,%lld,%.0f",
              o->scene, o->model, s->info.dimension, s->count, s->walls, variant, o->threads,
              t.phase[0].median * ns, t.phase[0].min * ns, t.phase[0].max * ns, stages,
              t.flops / t.phase[0].median * 1e-9, t.share.median,
              (double)s->last.neighbor_count / (double)s->count,
              (double)s->last.scratch_size / (double)s->count, (long long)s->drift,
              s->info.time_step / t.phase[0].median * (double)s->count);
    close_subject(s);
    free(s);
}

static const char step_columns[] =
    "scene,model,dimension,particles,walls,variant,threads,ns_per_particle,min,max,forces,"
    "sight,search,network,pairs,advance,relaxation,contact,divergence,commit,gflops,peak_share,"
    "neighbours_per_particle,scratch_bytes_per_particle,momentum_drift_quanta,real_time_particles";
static const char step_note[] =
    "ns per particle by phase; CPU time on one thread, wall-clock on more; drift is exact; "
    "real_time_particles: as many at this time each take the model's time step";

static const bench_isa *best_isa(const bench_options *o)
{
    const bench_isa *isas;
    size_t count = bench_isas(&isas);
    while (count > 1 && (isas[count - 1].cpu & ~o->cpu))
        count--;
    return &isas[count - 1];
}

void bench_step(const bench_options *o)
{
    static const char *const usual[][2] = {
        {"block", "demo"}, {"block", "tiny"},  {"dam-break", "demo"}, {"dam-break", "tiny"},
        {"block", "dmcf"}, {"block", "cconv"}, {"dam-break", "dmcf"}};
    const bench_isa *isa = best_isa(o);
    bench_table table = bench_table_open(o, "step", step_note, step_columns);
    subject_options s = {o->scene, o->model, o->dimension, o->threads, o->particles, isa->cpu};
    const size_t count = o->scene || o->model ? 1 : sizeof usual / sizeof *usual;
    for (size_t i = 0; i < count; i++) {
        s.scene = o->scene ? o->scene : o->model ? "block" : usual[i][0];
        s.model = o->model ? o->model : o->scene ? "demo" : usual[i][1];
        if (!o->particles)
            s.particles = o->quick ? 2000 : 50000;
        step_row(o, &table, &s, isa->name);
    }
    if (count > 1 && o->dimension == 3) { /* and one in 2D */
        s = (subject_options){"dam-break", "tiny", 2, o->threads, o->quick ? 2000 : 50000,
                              isa->cpu};
        step_row(o, &table, &s, isa->name);
    }
    bench_table_close(&table);
}

/* ---- bench threads ---- */

typedef struct thread_times {
    double wall[BENCH_REPEATS], cpu[BENCH_REPEATS], caller[BENCH_REPEATS];
} thread_times;

static void time_once(subject *s, thread_times *t, size_t r)
{
    run_step(s); /* the restored state is in the cache again */
    const double cpu = bench_process_seconds(), caller = bench_seconds();
    if (ascc_step_run(s->step, s->particles, NULL, 1))
        bench_fail("step: %s", ascc_step_message(s->step));
    t->caller[r] = bench_seconds() - caller;
    t->cpu[r] = bench_process_seconds() - cpu;
    s->last.size = sizeof s->last;
    (void)ascc_step_get_statistics(s->step, &s->last);
    t->wall[r] = s->last.seconds_total;
}

static void threads_row(const bench_options *o, bench_table *table, const char *model,
                        size_t particles)
{
    subject s[2];
    thread_times t[2];
    const int32_t threads[2] = {1, o->threads};
    for (int k = 0; k < 2; k++) {
        const subject_options with = {o->scene ? o->scene : "block",
                                      model,
                                      o->dimension,
                                      threads[k],
                                      particles,
                                      best_isa(o)->cpu};
        if (!open_subject(o, &with, &s[k])) {
            if (k)
                close_subject(&s[0]);
            return;
        }
        run_step(&s[k]);
        run_step(&s[k]);
    }
    const size_t repeats = bench_repeats(o);
    for (size_t r = 0; r < repeats; r++)
        for (int k = 0; k < 2; k++)
            time_once(&s[k], &t[k], r);
    bench_spread wall[2], cpu[2], caller[2];
    for (int k = 0; k < 2; k++) {
        wall[k] = bench_spread_of(t[k].wall, repeats);
        cpu[k] = bench_spread_of(t[k].cpu, repeats);
        caller[k] = bench_spread_of(t[k].caller, repeats);
    }
    const bool equal = ascc_particles_hash(s[0].particles) == ascc_particles_hash(s[1].particles);
    bench_row(table, "%s,%zu,%d,%.3f,%.3f,%.2f,%.2f,%.3f,%.2f,%s", model, s[0].count, threads[1],
              wall[0].min * 1e3, wall[1].min * 1e3, wall[0].median / wall[1].median,
              wall[0].min / wall[1].min, cpu[1].median / cpu[0].median,
              cpu[0].median / caller[1].median, equal ? "equal" : "DIFFERENT");
    close_subject(&s[0]);
    close_subject(&s[1]);
}

void bench_threads(const bench_options *options)
{
    bench_options own = *options; /* other load on the machine tells here: more repeats */
    const bench_options *o = &own;
    own.repeats = options->repeats ? options->repeats : options->quick ? 5 : 15;
    own.threads = options->threads > 1 ? options->threads : 2;
    bench_table table = bench_table_open(
        o, "threads",
        "one thread and more, in turn; speedups are wall-clock, so other load tells; cpu_ratio: "
        "CPU "
        "time of all threads over that of one alone; relief: CPU time of one alone over the "
        "caller's",
        "model,particles,threads,wall_ms_1,wall_ms_n,speedup_median,speedup_min,cpu_ratio,relief,"
        "state");
    const size_t count = o->particles ? o->particles : o->quick ? 2000 : 50000;
    if (o->model)
        threads_row(o, &table, o->model, count);
    else {
        threads_row(o, &table, "tiny", count / 10);
        threads_row(o, &table, "tiny", count);
        threads_row(o, &table, "dmcf", count / 10);
    }
    bench_table_close(&table);
}

/* ---- bench scale ---- */

static const char scale_script[] =
    "set multiplot layout 1,2 title 'A step on '.cpu.', one thread' font ',15'\n"
    "set logscale xy\nset xtics ('1k' 1e3, '10k' 1e4, '100k' 1e5, '1M' 1e6)\nset xrange "
    "[800:1.3e6]\n"
    "set grid lc '#e0e0e0' lt 1\nset border 3\nset tics nomirror\n"
    "set xlabel 'particles in a block'\nset key top right samplen 2 font ',11'\n"
    "model = \"demo-2d demo-3d tiny-3d dmcf-3d\"\n"
    "colour = \"#0072b2 #009e73 #d55e00 #aa4499\"\n"
    "title(i) = i == 1 ? 'demo, 2D' : i == 2 ? 'demo, 3D' : i == 3 ? 'tiny: 16 channels, 2 scales, "
    "3D' "
    ": 'published DMCF, 3D'\n"
    "row(i) = strcol(1) eq word(model, i) ? $2 : NaN\n"
    "set ylabel 'CPU time per particle, µs'\nset yrange [0.2:1000]\n"
    "plot for [i = 4:1:-1] '%DATA%' using (row(i)):($3 / 1000) with linespoints lw 2 pt 7 ps 0.8 "
    "lc rgb word(colour, i) title title(i)\n"
    "set ylabel 'scratch per particle, bytes'\nset yrange [200:100000]\nset key off\n"
    "plot for [i = 4:1:-1] '%DATA%' using (row(i)):6 with linespoints lw 2 pt 7 ps 0.8 "
    "lc rgb word(colour, i) title title(i)\n"
    "unset multiplot\n";

static void scale_row(const bench_options *o, bench_table *table, const char *model,
                      int32_t dimension, size_t particles)
{
    const subject_options with = {"block", model, dimension, 1, particles, best_isa(o)->cpu};
    subject s;
    if (!open_subject(o, &with, &s))
        return;
    const step_times t = time_steps(&s, bench_repeats(o), 1);
    const double ns = 1e9 / (double)s.count;
    bench_row(table, "%s-%dd,%zu,%.1f,%.1f,%.1f,%.0f,%.1f,%lld", model, s.info.dimension, s.count,
              t.phase[0].median * ns, t.phase[0].min * ns, t.phase[0].max * ns,
              (double)s.last.scratch_size / (double)s.count,
              (double)s.last.scratch_size / 1048576.0, (long long)s.drift);
    close_subject(&s);
}

void bench_scale(const bench_options *options)
{
    bench_options own = *options;
    const bench_options *o = &own;
    own.repeats = options->repeats ? options->repeats : options->quick ? 1 : 5;
    static const size_t sizes[] = {1000, 3000, 10000, 30000, 100000, 300000, 1000000};
    static const struct {
        const char *model;
        int32_t dimension;
        size_t most, quick;
    } series[] = {{"demo", 2, 1000000, 30000},
                  {"demo", 3, 1000000, 30000},
                  {"tiny", 3, 1000000, 10000},
                  {"dmcf", 3, 50000, 1000}};
    bench_table table = bench_table_open(
        o, "scale", "blocks of particles, one thread, CPU time of a step, scratch that it holds",
        "model,particles,ns_per_particle,min,max,scratch_bytes_per_particle,scratch_mib,"
        "momentum_drift_quanta");
    for (size_t k = 0; k < sizeof series / sizeof *series; k++) {
        const size_t most = o->quick ? series[k].quick : series[k].most;
        for (size_t i = 0; i < sizeof sizes / sizeof *sizes && sizes[i] <= most; i++)
            scale_row(o, &table, series[k].model, series[k].dimension, sizes[i]);
        if (most == 50000)
            scale_row(o, &table, series[k].model, series[k].dimension, most);
    }
    bench_table_close(&table);
    bench_chart(o, "scale", 1100, 520, scale_script);
}

/* ---- bench load ---- */

/* Bytes of the library after strip; 0 = could not be told. */
static long stripped_size(const char *path)
{
    char copy[] = "bench-stripped-XXXXXX", command[2048];
    const int file = mkstemp(copy);
    if (file < 0)
        return 0;
    (void)close(file);
    (void)snprintf(command, sizeof command, "strip -o '%s' '%s'", copy, path);
    long size = 0;
    FILE *stripped = system(command) == 0 ? fopen(copy, "rb") : NULL;
    if (stripped && fseek(stripped, 0, SEEK_END) == 0)
        size = ftell(stripped);
    if (stripped)
        fclose(stripped);
    (void)unlink(copy);
    return size;
}

typedef struct load_job {
    ascc_context *context;
    const unsigned char *file;
    size_t size;
} load_job;

static void run_load(void *data)
{
    const load_job *j = data;
    ascc_model *model;
    if (ascc_model_load_memory(j->context, j->file, j->size, &model))
        bench_fail("a model does not load");
    ascc_model_destroy(&model);
}

void bench_load(const bench_options *o)
{
    const model_random options = {
        .dimension = 3, .channels = 32, .trunk_layers = 4, .spacing = BENCH_SPACING};
    load_job job = {.context = bench_context(o->cpu, 1)};
    unsigned char *file = model_builder_random(&options, &job.size);
    job.file = file;
    bench_table table =
        bench_table_open(o, "load", "a model from memory, and the shared library after strip",
                         "what,bytes,ms,min,max");
    const bench_result r = bench_measure(o, run_load, NULL, &job, 0.0);
    bench_row(&table, "model,%zu,%.3f,%.3f,%.3f", job.size, r.seconds.median * 1e3,
              r.seconds.min * 1e3, r.seconds.max * 1e3);
    const long size = o->library ? stripped_size(o->library) : 0;
    if (size)
        bench_row(&table, "libascc.so,%ld,,,", size);
    bench_table_close(&table);
    free(file);
    ascc_context_destroy(&job.context);
}
