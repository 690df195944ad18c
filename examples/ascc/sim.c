/* ascc sim: runs a model on a scene and writes what happens. SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "detail.h"
#include "frames.h"
#include "host.h"
#include "new_file.h"
#include "picture.h"
#include "processes.h"
#include "progress.h"
#include "scenes.h"
#include "system.h"

typedef struct options {
    const char *model, *scene, *out, *frames, *ply, *vtk;
    const char *rungs;  /* models by name, commas between them, in place of one */
    double budget;      /* ms a step, 0 = none */
    const char *detail; /* where the best of them is wanted; NULL = as the budget says */
    int32_t steps, every, threads, size;
    double time_step, spacing, sleep_speed, max_distance;
    bool trust;            /* measured */
    int32_t gravity_count; /* 0 = the scene's */
    bool difference;
    double gravity[3];
} options;

static void usage(FILE *to)
{
    fprintf(
        to,
        "usage: ascc sim MODEL SCENE -n STEPS [-o OUT] [options]\n"
        "       ascc sim --ladder MODEL,MODEL... --budget MS SCENE -n STEPS [-o OUT] [options]\n\n"
        "MODEL  a model by name (water3d) or file, a published network, or demo (a demonstration\n"
        "       model, not trained)\n"
        "SCENE  a sequence file, whose first frame starts the run, or one of (3D without -2d)\n");
    ascc_scene_list(to);
    fprintf(
        to,
        "\n"
        "  -n STEPS           time steps\n"
        "  -o OUT             a sequence file of all frames\n"
        "  --frames DIR       one PNG picture a frame\n"
        "  --ply DIR          one binary PLY file a frame\n"
        "  --vtk DIR          one VTK file a frame, and frames.pvd for ParaView\n"
        "  --every K          a frame every K steps (1)\n"
        "  --threads N        threads to use (1)\n"
        "  --dt S             time step, seconds (the model's)\n"
        "  --gravity X,Y[,Z]  m/s^2 (the scene's)\n"
        "  --ladder M,M...    several models, the best last: each step runs the best that the\n"
        "                     budget allows\n"
        "  --budget MS        milliseconds that a step may take, for --ladder\n"
        "  --detail WHERE     with --ladder: fluid there is the best model's, the rest the first\n"
        "                     one's, or what the budget allows: near:X,Y,Z,R (metres), fast:V "
        "(m/s),\n"
        "                     surface:D (metres below it); several with + between them\n"
        "  --sleep V          parts of the fluid slower than V times what gravity gives in a\n"
        "                     step stop until something wakes them (0 = none)\n"
        "  --trust X          tells how far what the model sees is from what it was trained on;\n"
        "                     with --ladder: beyond X, the best model below without a network\n"
        "                     runs (0 = any distance)\n"
        "  --size N           particles along a named scene's longest edge\n"
        "  --spacing S        particle spacing of a named scene, metres (the model's)\n"
        "  --velocity KIND    of a sequence: stored (default), or difference of its first\n"
        "                     two frames, starting from the second\n");
}

static const char *const option_names[] = {
    "-n",        "-o",       "--frames",  "--ply",   "--vtk",     "--every",
    "--threads", "--dt",     "--gravity", "--size",  "--spacing", "--velocity",
    "--sleep",   "--ladder", "--budget",  "--trust", "--detail",  NULL};

static bool bad_use(const char *what, const char *value)
{
    return ascc_bad_use("sim", what, value, NULL);
}

/* ---- Arguments ---- */

/* Two or three numbers; *count says how many. */
static bool vector(const char *name, const char *text, double value[3], int32_t *count)
{
    const char *at = text;
    for (int c = 0; c < 3; c++) {
        char *end;
        value[c] = strtod(at, &end);
        if (end == at || !isfinite(value[c]))
            break;
        *count = c + 1;
        if (*end == '\0' && c > 0)
            return true;
        if (*end != ',')
            break;
        at = end + 1;
    }
    ascc_line(stderr, "ascc sim: %s %s: two or three numbers with commas are wanted", name, text);
    return false;
}

static bool read_option(options *o, const char *name, const char *value)
{
    if (strcmp(name, "-n") == 0)
        return ascc_read_whole("sim", name, value, 1, 100000000, &o->steps);
    if (strcmp(name, "-o") == 0)
        return (o->out = value) != NULL;
    if (strcmp(name, "--frames") == 0)
        return (o->frames = value) != NULL;
    if (strcmp(name, "--ply") == 0)
        return (o->ply = value) != NULL;
    if (strcmp(name, "--vtk") == 0)
        return (o->vtk = value) != NULL;
    if (strcmp(name, "--every") == 0)
        return ascc_read_whole("sim", name, value, 1, 100000000, &o->every);
    if (strcmp(name, "--threads") == 0)
        return ascc_read_whole("sim", name, value, 1, 1024, &o->threads);
    if (strcmp(name, "--size") == 0)
        return ascc_read_whole("sim", name, value, 4, 1000, &o->size);
    if (strcmp(name, "--dt") == 0)
        return ascc_read_real("sim", name, value, 1e-9, 1e9, &o->time_step);
    if (strcmp(name, "--spacing") == 0)
        return ascc_read_real("sim", name, value, 1e-6, 1e6, &o->spacing);
    if (strcmp(name, "--ladder") == 0)
        return (o->rungs = value) != NULL;
    if (strcmp(name, "--budget") == 0)
        return ascc_read_real("sim", name, value, 1e-3, 1e9, &o->budget);
    if (strcmp(name, "--detail") == 0)
        return (o->detail = value) != NULL;
    if (strcmp(name, "--gravity") == 0)
        return vector(name, value, o->gravity, &o->gravity_count);
    if (strcmp(name, "--velocity") == 0 && strcmp(value, "stored") == 0)
        return true;
    if (strcmp(name, "--velocity") == 0 && strcmp(value, "difference") == 0)
        return o->difference = true;
    if (strcmp(name, "--sleep") == 0) {
        char *end;
        o->sleep_speed = strtod(value, &end);
        return (end != value && !*end && o->sleep_speed >= 0.0 && o->sleep_speed <= 1e3) ||
               bad_use("--sleep takes a number from 0 to 1000", value);
    }
    if (strcmp(name, "--trust") == 0) {
        char *end;
        o->max_distance = strtod(value, &end);
        o->trust = true;
        return (end != value && !*end && o->max_distance >= 0.0 && o->max_distance <= 1e6) ||
               bad_use("--trust takes a number from 0 to 1000000", value);
    }
    if (strcmp(name, "--velocity") == 0)
        return bad_use("--velocity takes stored or difference", value);
    return ascc_bad_option("sim", option_names, name, value);
}

static bool read_arguments(options *o, int argc, char **argv)
{
    for (int i = 0; i < argc; i++) {
        if (argv[i][0] == '-') {
            if (i + 1 >= argc)
                return ascc_bad_option("sim", option_names, argv[i], NULL);
            if (!read_option(o, argv[i], argv[i + 1]))
                return false;
            i++;
        } else if (!o->model) {
            o->model = argv[i];
        } else if (!o->scene) {
            o->scene = argv[i];
        } else {
            return bad_use("one argument too many", argv[i]);
        }
    }
    if (o->rungs && o->scene)
        return bad_use("with --ladder there is no MODEL before SCENE", o->model);
    if (o->rungs) {
        o->scene = o->model;
        o->model = o->rungs;
    }
    if (!o->model || !o->scene)
        return bad_use(o->rungs ? "SCENE is wanted" : "MODEL and SCENE are wanted", NULL);
    if (o->budget > 0.0 && !o->rungs)
        return bad_use("--budget takes a --ladder", NULL);
    if (o->detail && !o->rungs)
        return bad_use("--detail takes a --ladder", NULL);
    return o->steps > 0 || bad_use("-n STEPS is wanted", NULL);
}

/* ---- The scene ---- */

/* Positions and velocities that start the run; from differences: frame 1, (frame 1 - frame 0) / dt. */
static bool start_of(const options *o, ascc_sequence *s, const float **position, char *error,
                     size_t capacity)
{
    const size_t n = s->count * (size_t)s->dimension;
    *position = s->position;
    if (!o->difference)
        return true;
    if (s->frames < 2) {
        (void)snprintf(error, capacity, "%s: --velocity difference takes two frames", o->scene);
        return false;
    }
    for (size_t k = 0; k < n; k++)
        s->velocity[k] =
            (float)(((double)s->position[n + k] - (double)s->position[k]) / s->time_step);
    *position = s->position + n;
    return true;
}

/* ---- The run ---- */

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number)
{
    (void)number;
    interrupted = 1;
}

typedef struct simulation {
    const options *o;
    ascc_sequence scene;
    ascc_view view;
    ascc_context *context;
    ascc_model *model; /* of a ladder: the best */
    ascc_model *rung[ASCC_MAX_RUNGS];
    char rung_name[ASCC_MAX_RUNGS][64];
    size_t rung_count;
    ascc_particles *particles; /* the lead's: all of it */
    ascc_spread *spread;       /* it among processes */
    ascc_step *step;           /* or: */
    ascc_ladder *ladder;       /* which was told */
    ascc_sequence_writer *writer;
    ascc_frames exported;
    ascc_detail detail;
    double *weight; /* with --detail */
    float *position, *velocity;
    uint64_t *id;
    double time_step;
    uint64_t detailed; /* particles of all steps that the best model computed; of what all had */
    uint64_t stepped;
    /* Sums over the run. */
    int32_t steps;
    double seconds[ASCC_MAX_STAGES], seconds_total;
    const char *stage[ASCC_MAX_STAGES];
    int32_t stage_count;
    int64_t drift[3]; /* quanta: what is left of before + external - wall - support - after */
    uint64_t asleep;  /* in the last step */
    double distance_sum, distance_most, distance_worst; /* of steps' means; of a particle */
    uint64_t distance_steps;
    ascc_measures first, last;
    double max_density;
    bool stopped; /* interrupted on some process */
    char error[768];
} simulation;

static bool read_state(simulation *s)
{
    const ascc_array x = {.data = s->position}, v = {.data = s->velocity};
    return ascc_particles_get(s->particles, ASCC_FLUID, ASCC_POSITION, 0, s->scene.count, &x) ==
               ASCC_OK &&
           ascc_particles_get(s->particles, ASCC_FLUID, ASCC_VELOCITY, 0, s->scene.count, &v) ==
               ASCC_OK;
}

static bool write_frame(simulation *s)
{
    char path[600], text[96];
    const size_t room = sizeof s->error;
    if (!read_state(s))
        return false;
    if (s->writer && !ascc_sequence_append(s->writer, s->position, s->velocity, s->error, room))
        return false;
    if (s->o->frames) {
        (void)snprintf(path, sizeof path, "%s/frame_%05d.png", s->o->frames, s->steps);
        (void)snprintf(text, sizeof text, "t = %.3f s   step %d   %zu particles",
                       s->steps * s->time_step, s->steps, s->scene.count);
        if (!ascc_picture_write(path, &s->view, s->position, s->velocity, s->scene.count, text,
                                s->error, room))
            return false;
    }
    ascc_cloud cloud = {.dimension = s->scene.dimension,
                        .count = s->scene.count,
                        .position = s->position,
                        .velocity = s->velocity,
                        .id = s->id};
    return ascc_frames_add(&s->exported, &cloud, s->error, room);
}

static bool measure(simulation *s, ascc_measures *m)
{
    m->size = sizeof *m;
    if (ascc_particles_measure(s->particles, m) != ASCC_OK) {
        (void)snprintf(s->error, sizeof s->error, "%s", ascc_particles_message(s->particles));
        return false;
    }
    s->max_density = fmax(s->max_density, m->max_density);
    return true;
}

/* Rungs of a ladder have different stages. */
static void add_stage(simulation *s, const ascc_stage_time *stage)
{
    int32_t i = 0;
    while (i < s->stage_count && strcmp(s->stage[i], stage->name) != 0)
        i++;
    if (i == ASCC_MAX_STAGES)
        return;
    s->stage_count += i == s->stage_count;
    s->stage[i] = stage->name;
    s->seconds[i] += stage->seconds;
}

static void add_distance(simulation *s, uint64_t count, double mean, double worst)
{
    if (count == 0)
        return;
    s->distance_sum += mean;
    s->distance_steps++;
    s->distance_most = fmax(s->distance_most, mean);
    s->distance_worst = fmax(s->distance_worst, worst);
}

/* Weights of the fluid as it is. */
static ascc_status set_detail(simulation *s)
{
    const double *g = s->o->gravity_count ? s->o->gravity : s->scene.gravity;
    ascc_detail_fluid fluid = {.dimension = s->scene.dimension,
                               .count = s->scene.count,
                               .position = s->position,
                               .velocity = s->velocity,
                               .spacing = 2.0 * s->scene.radius};
    const ascc_const_array rows = {.data = s->weight, .scalar = ASCC_DOUBLE};
    memcpy(fluid.gravity, g, sizeof fluid.gravity);
    if (!read_state(s) || !ascc_detail_weigh(&s->detail, &fluid, s->weight))
        return ASCC_ERROR_MEMORY;
    return ascc_particles_set(s->particles, ASCC_FLUID, ASCC_DETAIL, 0, s->scene.count, &rows);
}

/* Without a budget the first rung runs where no detail is wanted. */
static ascc_status run_detailed(simulation *s, const ascc_forces *forces)
{
    const int32_t first = 0;
    const ascc_status status = set_detail(s);
    if (status != ASCC_OK)
        return status;
    return s->o->budget > 0.0 ? ascc_ladder_run(s->ladder, s->particles, forces, 1)
                              : ascc_ladder_replay(s->ladder, s->particles, forces, &first, 1);
}

static ascc_status run_step(simulation *s, const ascc_forces *forces)
{
    if (s->weight)
        return run_detailed(s, forces);
    return s->ladder ? ascc_ladder_run(s->ladder, s->particles, forces, 1)
                     : ascc_spread_run(s->spread, s->step, forces);
}

static void count_step(simulation *s)
{
    ascc_step_statistics t = {.size = sizeof t};
    ascc_ladder_statistics l = {.size = sizeof l};
    if (s->ladder)
        (void)ascc_ladder_get_statistics(s->ladder, &l);
    (void)ascc_spread_statistics(s->spread,
                                 s->ladder ? ascc_ladder_step(s->ladder, l.rung) : s->step, &t);
    for (int32_t i = 0; i < t.stage_count; i++)
        add_stage(s, &t.stage[i]);
    s->seconds_total += t.seconds_total;
    s->asleep = t.asleep;
    if (s->ladder) {
        s->detailed += l.particles_on[l.rung_count - 1];
        s->stepped += s->scene.count;
    }
    add_distance(s, t.distance_count, t.distance_mean, t.distance_worst);
    for (int c = 0; c < 3; c++)
        s->drift[c] += t.momentum_before[c] + t.external_impulse[c] - t.wall_impulse[c] -
                       t.support_impulse[c] - t.momentum_after[c];
}

/* Something that the lead does with the whole fluid as it is now; all know whether it did. */
static bool let_lead(simulation *s, bool (*act)(simulation *s))
{
    if (ascc_spread_gather(s->spread) != ASCC_OK) {
        (void)snprintf(s->error, sizeof s->error, "%s", ascc_spread_message(s->spread, s->step));
        return false;
    }
    return ascc_processes_agree(!ascc_processes_lead() || act(s), s->error, sizeof s->error);
}

static bool measure_first(simulation *s)
{
    return measure(s, &s->first);
}

static bool measure_last(simulation *s)
{
    return measure(s, &s->last);
}

static bool write_and_measure(simulation *s)
{
    return write_frame(s) && measure_last(s);
}

static bool is_interrupted(void)
{
    return !ascc_processes_agree(!interrupted, NULL, 0);
}

static bool advance(simulation *s)
{
    const ascc_forces forces = {.size = sizeof forces,
                                .gravity = s->o->gravity_count ? s->o->gravity : s->scene.gravity};
    ascc_progress progress;
    ascc_progress_start(&progress, "stepping", (size_t)s->o->steps);
    bool good = let_lead(s, write_frame);
    progress.visible = progress.visible && ascc_processes_lead();
    while (good && s->steps < s->o->steps) {
        s->stopped = is_interrupted();
        if (s->stopped)
            break;
        if (run_step(s, &forces) != ASCC_OK) {
            (void)snprintf(s->error, sizeof s->error, "step %d: %s", s->steps + 1,
                           s->ladder ? ascc_ladder_message(s->ladder)
                                     : ascc_spread_message(s->spread, s->step));
            good = false;
            break;
        }
        s->steps++;
        count_step(s);
        if (s->steps % s->o->every == 0)
            good = let_lead(s, write_and_measure);
        ascc_progress_add(&progress, 1);
    }
    ascc_progress_end(&progress);
    return let_lead(s, measure_last) && good;
}

/* ---- The table at the end ---- */

static double potential(const simulation *s, const ascc_measures *m)
{
    const double *g = s->o->gravity_count ? s->o->gravity : s->scene.gravity;
    double energy = 0.0;
    for (int c = 0; c < s->scene.dimension; c++)
        energy -= m->mass * g[c] * m->center[c];
    return energy;
}

static bool weightless(const simulation *s)
{
    const double *g = s->o->gravity_count ? s->o->gravity : s->scene.gravity;
    return s->scene.walls == 0 && g[0] == 0.0 && g[1] == 0.0 &&
           (s->scene.dimension == 2 || g[2] == 0.0);
}

static void print_momentum(const simulation *s)
{
    ascc_model_info info = {.size = sizeof info};
    (void)ascc_model_get_info(s->model, &info);
    const double q = ascc_particles_momentum_quantum(s->particles);
    double drift = 0.0, start = 0.0;
    for (int c = 0; c < 3; c++) {
        drift += (double)s->drift[c] * q * (double)s->drift[c] * q;
        start += s->first.momentum[c] * s->first.momentum[c];
    }
    ascc_line(stdout,
              "momentum error      %.3g  (%" PRId64 " %" PRId64 " %" PRId64
              " quanta of %.3g kg m/s%s)",
              sqrt(drift) / (sqrt(start) + 1e-10), s->drift[0], s->drift[1], s->drift[2], q,
              info.conserves_momentum ? "" : "; this model does not conserve it");
    if (!weightless(s)) {
        ascc_line(stdout, "angular mom. error  not measured: gravity or walls turn the fluid");
        return;
    }
    double turn = 0.0;
    for (int c = 0; c < 3; c++)
        turn += pow(s->last.angular_momentum[c] - s->first.angular_momentum[c], 2.0);
    ascc_line(stdout, "angular mom. error  %.3g  of sum m |x| |v|%s",
              sqrt(turn) / (s->first.angular_scale + 1e-10),
              info.conserves_angular_momentum ? "" : "; this model does not conserve it");
}

/* Which rungs ran, and how often that was too slow. */
static void print_ladder(const simulation *s)
{
    ascc_ladder_statistics l = {.size = sizeof l};
    if (!s->ladder || ascc_ladder_get_statistics(s->ladder, &l) != ASCC_OK)
        return;
    for (int32_t r = 0; r < l.rung_count; r++)
        ascc_line(stdout, "  %-17s %9" PRIu64 " steps, %.3f ms expected now", s->rung_name[r],
                  l.steps_on[r], 1e3 * l.predicted[r]);
    if (s->weight)
        ascc_line(stdout, "detail              %.1f %% of the fluid by %s",
                  100.0 * (double)s->detailed / (double)s->stepped, s->rung_name[l.rung_count - 1]);
    ascc_line(stdout, "changes of model    %" PRIu64 ", at most one a second simulated", l.changes);
    if (l.reason == ASCC_LADDER_STRANGE)
        ascc_line(stdout, "trust               none in a network now: too far from its training");
    if (l.budget > 0.0)
        ascc_line(stdout, "over the budget     %" PRIu64 " of %d steps took more than %g ms%s",
                  l.late, s->steps, 1e3 * l.budget,
                  l.reason == ASCC_LADDER_TOO_SLOW ? "; no model of the ladder is fast enough now"
                                                   : "");
}

static void print_table(const simulation *s)
{
    const double n = s->steps ? s->steps : 1;
    ascc_line(stdout, "particles           %zu fluid, %zu boundary", s->scene.count,
              s->scene.walls);
    char processes[32] = "";
    if (ascc_processes_count() > 1)
        (void)snprintf(processes, sizeof processes, "%d processes of ", ascc_processes_count());
    ascc_line(stdout, "steps               %d of %g s, %s%d threads", s->steps, s->time_step,
              processes, s->o->threads);
    for (int32_t i = 0; i < s->stage_count; i++)
        ascc_line(stdout, "  %-17s %9.3f ms a step", s->stage[i], 1e3 * s->seconds[i] / n);
    ascc_line(stdout, "  %-17s %9.3f ms a step", "total", 1e3 * s->seconds_total / n);
    if (s->scene.count)
        ascc_line(stdout, "  %-17s %9.3f us a step", "per particle",
                  1e6 * s->seconds_total / n / (double)s->scene.count);
    print_ladder(s);
    if (s->distance_steps)
        ascc_line(
            stdout,
            "from training       %.2f times as far as usual in the mean, %.2f in the farthest "
            "step; farthest particle %.1f",
            s->distance_sum / (double)s->distance_steps, s->distance_most, s->distance_worst);
    else if (s->o->trust)
        ascc_line(stdout, "from training       the model has no statistics of it");
    if (s->o->sleep_speed > 0.0)
        ascc_line(stdout, "asleep              %" PRIu64 " of %zu particles in the last step",
                  s->asleep, s->scene.count);
    print_momentum(s);
    ascc_line(stdout, "max. density error  %.1f %%  of rest density, over all frames",
              100.0 * fmax(0.0, s->max_density - 1.0));
    ascc_line(stdout, "energy              kinetic %.4g to %.4g J, potential %.4g to %.4g J",
              s->first.kinetic_energy, s->last.kinetic_energy, potential(s, &s->first),
              potential(s, &s->last));
}

/* ---- From arguments to table ---- */

/* The models of a ladder, loaded; the last also becomes s->model. Complains itself. */
static ascc_status open_rungs(simulation *s, ascc_host_error *why)
{
    ascc_status status = ASCC_OK;
    for (const char *at = s->o->rungs; status == ASCC_OK && *at;) {
        const size_t length = strcspn(at, ",");
        char name[ASCC_HOST_PATH];
        if (length == 0 || length >= sizeof name || s->rung_count == ASCC_MAX_RUNGS) {
            (void)snprintf(why->text, sizeof why->text, "--ladder takes 1 to %d models",
                           ASCC_MAX_RUNGS);
            return ASCC_ERROR_ARGUMENT;
        }
        (void)snprintf(name, sizeof name, "%.*s", (int)length, at);
        (void)snprintf(s->rung_name[s->rung_count], sizeof *s->rung_name, "%.60s",
                       ascc_system_name(name));
        status = ascc_host_load(s->context, name, &s->rung[s->rung_count], why);
        s->rung_count += status == ASCC_OK;
        at += length + (at[length] == ',');
    }
    s->model = s->rung_count ? s->rung[s->rung_count - 1] : NULL;
    return status;
}

static bool failed(simulation *s, const char *what, ascc_status status, const char *message)
{
    (void)snprintf(s->error, sizeof s->error, "%s: %s%s%s", what, ascc_status_text(status),
                   message[0] ? ": " : "", message);
    return false;
}

/* The lead's scene; others know all of it but its particles. */
static bool open_scene(simulation *s, double spacing)
{
    const options *o = s->o;
    const bool lead = ascc_processes_lead();
    const bool good =
        !lead || ascc_scene_load(o->scene, o->size, spacing, &s->scene, s->error, sizeof s->error);
    if (!ascc_processes_agree(good, s->error, sizeof s->error))
        return false;
    ascc_sequence shared = s->scene;
    ascc_processes_share(&shared, sizeof shared);
    if (!lead) {
        shared.position = shared.velocity = shared.wall = shared.normal = NULL;
        s->scene = shared;
    }
    return true;
}

/* Models from files; the demonstration model is made for a scene. */
static bool open_model(simulation *s, ascc_model_info *info)
{
    const options *o = s->o;
    const bool demo = strcmp(o->model, "demo") == 0 && !o->rungs;
    ascc_host_error why = {""};
    ascc_status status;
    if (demo)
        status = ascc_host_model(s->context, o->model, s->scene.dimension, 2.0 * s->scene.radius,
                                 &s->model, &why);
    else if (o->rungs)
        status = open_rungs(s, &why);
    else
        status = ascc_host_load(s->context, o->model, &s->model, &why);
    if (status == ASCC_OK)
        status = ascc_model_get_info(s->model, info);
    const bool good = status == ASCC_OK || failed(s, o->model, status, why.text);
    return ascc_processes_agree(good, s->error, sizeof s->error);
}

/* The scene and the model. A model file says what spacing a built-in scene gets. */
static bool open_both(simulation *s)
{
    const options *o = s->o;
    const bool demo = strcmp(o->model, "demo") == 0 && !o->rungs;
    const ascc_context_options context = {.size = sizeof context, .thread_count = o->threads};
    ascc_model_info info = {.size = sizeof info, .particle_spacing = 0.05};
    const ascc_status status = ascc_context_create(&context, &s->context);
    const bool good = status == ASCC_OK || failed(s, "context", status, "");
    if (!ascc_processes_agree(good, s->error, sizeof s->error) || (!demo && !open_model(s, &info)))
        return false;
    const double spacing = o->spacing > 0.0 ? o->spacing : info.particle_spacing;
    if (!open_scene(s, spacing) || (demo && !open_model(s, &info)))
        return false;
    if (info.dimension != s->scene.dimension)
        (void)snprintf(s->error, sizeof s->error, "%s is a model in %dD, %s a scene in %dD",
                       o->model, info.dimension, o->scene, s->scene.dimension);
    else if (o->gravity_count && o->gravity_count != s->scene.dimension)
        (void)snprintf(s->error, sizeof s->error, "--gravity has %d numbers, %s %d dimensions",
                       o->gravity_count, o->scene, s->scene.dimension);
    else if (s->scene.count == 0)
        (void)snprintf(s->error, sizeof s->error, "%s: there is no fluid", o->scene);
    else if (o->rungs && ascc_processes_count() > 1)
        (void)snprintf(s->error, sizeof s->error, "a --ladder runs on one process");
    else if (o->detail && !ascc_detail_read(o->detail, s->scene.dimension, &s->detail))
        (void)snprintf(
            s->error, sizeof s->error,
            "--detail %s: near:X,Y%s,R, fast:V and surface:D are known, with + between them",
            o->detail, s->scene.dimension == 3 ? ",Z" : "");
    s->time_step = o->time_step > 0.0 ? o->time_step : info.time_step;
    return !s->error[0];
}

/* The lead's particles. */
static bool open_particles(simulation *s)
{
    const float *position;
    return start_of(s->o, &s->scene, &position, s->error, sizeof s->error) &&
           ascc_host_particles(s->context, &s->scene, position, s->scene.velocity, &s->particles) ==
               ASCC_OK;
}

static bool open_step(simulation *s)
{
    const ascc_step_options settings = {.size = sizeof settings,
                                        .time_step = s->o->time_step,
                                        .sleep_speed = s->o->sleep_speed,
                                        .measure_distance = s->o->trust};
    const ascc_ladder_options ladder = {.size = sizeof ladder,
                                        .budget = 1e-3 * s->o->budget,
                                        .step = &settings,
                                        .max_distance = s->o->max_distance};
    const ascc_status status =
        s->o->rungs ? ascc_ladder_create(s->context, s->rung_count,
                                         (const ascc_model *const *)s->rung, &ladder, &s->ladder)
                    : ascc_step_create(s->context, s->model, &settings, &s->step);
    char message[256] = "";
    if (status != ASCC_OK)
        (void)ascc_context_message(s->context, message, sizeof message);
    const bool good =
        status == ASCC_OK || failed(s, s->o->rungs ? "ladder" : "step", status, message);
    return ascc_processes_agree(good, s->error, sizeof s->error);
}

static bool open_fluid(simulation *s)
{
    const bool good = !ascc_processes_lead() || open_particles(s);
    const ascc_particles_options fluid = {.size = sizeof fluid,
                                          .dimension = s->scene.dimension,
                                          .spacing = 2.0 * s->scene.radius,
                                          .mass = s->scene.mass};
    return ascc_processes_agree(good, s->error, sizeof s->error) && open_step(s) &&
           ascc_spread_open(s->context, &fluid, s->particles, &s->spread, s->error,
                            sizeof s->error) == ASCC_OK;
}

static bool open_outputs(simulation *s)
{
    const size_t floats = s->scene.count * (size_t)s->scene.dimension + 1;
    s->position = malloc(floats * sizeof *s->position);
    s->velocity = malloc(floats * sizeof *s->velocity);
    s->id = malloc((s->scene.count + 1) * sizeof *s->id);
    if (s->o->detail)
        s->weight = malloc((s->scene.count + 1) * sizeof *s->weight);
    if (!s->position || !s->velocity || !s->id || (s->o->detail && !s->weight)) {
        (void)snprintf(s->error, sizeof s->error, "no memory for %zu particles", s->scene.count);
        return false;
    }
    (void)ascc_particles_get_ids(s->particles, ASCC_FLUID, 0, s->scene.count, s->id);
    s->view = ascc_view_of(&s->scene);
    s->exported = (ascc_frames){.ply = s->o->ply,
                                .vtk = s->o->vtk,
                                .every = (size_t)s->o->every,
                                .time_step = s->time_step};
    if ((s->o->frames && !ascc_make_folder(s->o->frames, s->error, sizeof s->error)) ||
        !ascc_frames_open(&s->exported, &s->scene, s->error, sizeof s->error))
        return false;
    if (!s->o->out)
        return true;
    ascc_sequence header = s->scene;
    header.walls_move = false;
    header.time_step = s->time_step * s->o->every;
    if (s->o->gravity_count)
        memcpy(header.gravity, s->o->gravity, sizeof header.gravity);
    (void)snprintf(header.source, sizeof header.source, "ascc sim %s %s", s->o->model, s->o->scene);
    s->writer = ascc_sequence_create(s->o->out, &header, true, s->error, sizeof s->error);
    return s->writer != NULL;
}

static void close_all(simulation *s)
{
    ascc_spread_close(&s->spread);
    ascc_step_destroy(&s->step);
    ascc_ladder_destroy(&s->ladder);
    ascc_particles_destroy(&s->particles);
    if (!s->rung_count)
        ascc_model_destroy(&s->model);
    for (size_t r = 0; r < s->rung_count; r++)
        ascc_model_destroy(&s->rung[r]);
    ascc_context_destroy(&s->context);
    ascc_sequence_free(&s->scene);
    free(s->weight);
    free(s->position);
    free(s->velocity);
    free(s->id);
}

/* What the lead has to say and to complete. What was computed before a step failed is kept. */
static bool report(simulation *s, bool good)
{
    char finish[512] = "";
    if (s->steps)
        print_table(s);
    if (s->writer &&
        !ascc_sequence_finish(s->writer, s->steps > 0 || good, finish, sizeof finish)) {
        ascc_line(stderr, "ascc sim: %s", finish);
        good = false;
    }
    if (s->error[0])
        ascc_line(stderr, "ascc sim: %s", s->error);
    if (!ascc_frames_close(&s->exported, finish, sizeof finish)) {
        ascc_line(stderr, "ascc sim: %s", finish);
        good = false;
    }
    if (s->stopped)
        ascc_line(stderr, "ascc sim: interrupted after %d steps", s->steps);
    return good;
}

int ascc_command_sim(int argc, char **argv)
{
    if (argc == 1 && strcmp(argv[0], "--help") == 0) {
        usage(stdout);
        return 0;
    }
    options o = {.every = 1, .threads = 1};
    if (!read_arguments(&o, argc, argv))
        return 2;
    simulation s = {.o = &o};
    bool good = open_both(&s) && open_fluid(&s) && let_lead(&s, open_outputs) &&
                let_lead(&s, measure_first);
    if (good) {
        (void)signal(SIGINT, on_interrupt);
        (void)signal(SIGTERM, on_interrupt);
        good = advance(&s);
        (void)signal(SIGINT, SIG_DFL);
        (void)signal(SIGTERM, SIG_DFL);
    }
    if (ascc_processes_lead())
        good = report(&s, good);
    good = ascc_processes_agree(good, NULL, 0);
    const bool stopped = s.stopped;
    close_all(&s);
    return !good ? 1 : stopped ? 130 : 0;
}
