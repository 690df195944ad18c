/* `ascc train`: trains a network as a config file says. SPDX-License-Identifier: MIT
 *
 *   iterate ─► validate, now and then ─► a row in the log ─► save, now and then
 *
 * What a run that goes on needs is in the checkpoint and, for the best model so far, in the log's rows up
 * to the checkpoint's iteration.
 */
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

#include <ascc/train.h>
#include <jansson.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "evaluate.h"
#include "new_file.h"
#include "progress.h"
#include "published.h"
#include "sequence.h"
#include "tensor_file.h"
#include "train_config.h"
#include "train_log.h"
#include "training_sequence.h"
#include "system.h"

typedef struct training {
    const char *path; /* of the config */
    ascc_train_config config;
    bool resume;
    uint64_t end; /* iterations in all, when this run stops */
    int32_t threads;
    ascc_train_context *context;
    ascc_trainer *trainer;
    ascc_train_log log;
    ascc_truth *truth; /* of the valid sequences */
    size_t truth_count;
    ascc_progress progress;
    char label[160];
    double loss;  /* of late */
    double speed; /* steps a second, of late */
    double saved; /* when the last checkpoint was written, s */
    char error[512];
} training;

static volatile sig_atomic_t interrupted;

/* A second Ctrl-C ends the program at once. */
static void on_interrupt(int number)
{
    (void)number;
    interrupted = 1;
}

static bool fail(training *t, const char *what, const char *why)
{
    (void)snprintf(t->error, sizeof t->error, "%.200s: %.300s", what, why);
    return false;
}

static double now(void)
{
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec + 1e-9 * (double)time.tv_nsec;
}

static uint64_t schedule_end(const training *t)
{
    return t->config.stage[t->config.options.stage_count - 1].end;
}

/* ---- Files ---------------------------------------------------------------------------------------- */

static unsigned char *read_whole(training *t, const char *path, size_t *size)
{
    FILE *file = ascc_system_open(path, "rb");
    unsigned char *bytes = NULL;
    *size = 0;
    if (file && fseek(file, 0, SEEK_END) == 0 && ftell(file) > 0) {
        *size = (size_t)ftell(file);
        rewind(file);
        bytes = malloc(*size);
    }
    if (!bytes || fread(bytes, 1, *size, file) != *size) {
        (void)fail(t, path, errno ? strerror(errno) : "cannot be read");
        free(bytes);
        bytes = NULL;
    }
    if (file)
        (void)fclose(file);
    return bytes;
}

static bool write_model(training *t, const char *path)
{
    size_t size;
    const void *bytes = ascc_trainer_model(t->trainer, t->config.options.average > 0.0, &size);
    if (!bytes)
        return fail(t, path, "no memory");
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, t->error, sizeof t->error))
        return false;
    (void)fwrite(bytes, 1, size, output.stream); /* closing tells whether it succeeded */
    return ascc_new_file_close(&output, true, t->error, sizeof t->error);
}

/* ---- Sequences ------------------------------------------------------------------------------------ */

static bool add_sequence(training *t, const ascc_train_source *source)
{
    ascc_sequence s;
    ascc_training_sequence given;
    char why[256];
    if (!ascc_training_sequence_read(source->path, (size_t)source->every, &s, &given, why,
                                     sizeof why))
        return fail(t, "train", why);
    given.share = source->share;
    given.warm_up = source->warm_up;
    given.jitter = source->jitter;
    const ascc_status status = ascc_trainer_add_sequence(t->trainer, &given);
    ascc_sequence_free(&s);
    return status == ASCC_OK || fail(t, source->path, ascc_trainer_message(t->trainer));
}

static bool add_sequences(training *t)
{
    for (size_t i = 0; i < t->config.train.count; i++)
        if (!add_sequence(t, &t->config.train.source[i]))
            return false;
    return true;
}

static bool load_truths(training *t)
{
    const ascc_train_sources *valid = &t->config.valid;
    t->truth = calloc(valid->count + 1, sizeof *t->truth);
    if (!t->truth)
        return fail(t, "valid", "no memory");
    for (size_t i = 0; i < valid->count; i++, t->truth_count++) {
        ascc_truth *truth = &t->truth[i];
        const size_t every = (size_t)valid->source[i].every;
        ascc_method_error why = {""};
        if (!ascc_truth_load(valid->source[i].path, t->threads, truth, &why))
            return fail(t, "valid", why.text);
        ascc_truth_thin(truth, every);
    }
    return true;
}

/* ---- Validation ----------------------------------------------------------------------------------- */

static double figure(const ascc_report_run *run, const char *name)
{
    for (size_t i = 0; i < run->count; i++)
        if (strcmp(run->figure[i].name, name) == 0)
            return run->figure[i].value;
    return NAN;
}

static bool measure_errors(training *t, const ascc_truth *truth, ascc_validation *v,
                           ascc_method_error *why)
{
    ascc_report_run run = {.sequence = "validation"};
    const ascc_evaluate_options options = {.has_frames = true,
                                           .no_rollout = true,
                                           .first = t->config.validate_starts,
                                           .end = -1,
                                           .step = t->config.validate_starts,
                                           .velocity = ASCC_VELOCITY_DIFFERENCE};
    if (!ascc_evaluate(&options, &ascc_method_model, t->config.latest, truth, &run, why))
        return false;
    v->error[0] += figure(&run, "err_n1_difference") / (double)t->truth_count;
    v->error[1] += figure(&run, "err_n2_difference") / (double)t->truth_count;
    return true;
}

static bool measure_rollout(training *t, const ascc_truth *truth, ascc_validation *v,
                            ascc_method_error *why)
{
    ascc_report_run run = {.sequence = "rollout"};
    /* No start frames: the rollout alone. */
    const ascc_evaluate_options options = {
        .has_frames = true, .first = 1, .end = 1, .step = 1, .velocity = ASCC_VELOCITY_DIFFERENCE};
    const size_t wanted = (size_t)t->config.validate_frames + 1;
    ascc_truth part = *truth;
    part.frames = truth->frames < wanted ? truth->frames : wanted;
    if (part.velocity_frames > part.frames)
        part.velocity_frames = part.frames;
    if (!ascc_evaluate(&options, &ascc_method_model, t->config.latest, &part, &run, why))
        return false;
    const double last = figure(&run, "last_frame");
    const double lost = figure(&run, "escaped_max") + figure(&run, "non_finite_max");
    v->last_frame = fmin(v->last_frame, last);
    v->escaped = fmax(v->escaped, lost);
    v->density_error = fmax(v->density_error, figure(&run, "density_max_error"));
    v->stable = v->stable && last == (double)(part.frames - 1) && lost == 0.0;
    return true;
}

/* Measures the latest model, and keeps it if it is the best so far. */
static bool validate(training *t, ascc_validation *v)
{
    ascc_method_error why = {""};
    bool good = write_model(t, t->config.latest);
    const size_t rollouts = (size_t)t->config.validate_rollouts;
    *v = (ascc_validation){.measured = true, .last_frame = INFINITY, .stable = true};
    for (size_t i = 0; i < t->truth_count && good; i++) {
        good = measure_errors(t, &t->truth[i], v, &why) &&
               (i >= rollouts || !t->config.validate_frames ||
                measure_rollout(t, &t->truth[i], v, &why));
        if (!good)
            (void)fail(t, "validation", why.text);
    }
    return good && (!ascc_validation_better(v, &t->log.best) || write_model(t, t->config.output));
}

/* ---- One iteration after another ------------------------------------------------------------------ */

static int32_t stage_of(const training *t, uint64_t iteration)
{
    int32_t stage = 0;
    while (stage + 1 < t->config.options.stage_count && iteration > t->config.stage[stage].end)
        stage++;
    return stage + 1;
}

/* Checkpoint, latest model and, while none is the best, that as the output. */
static bool save(training *t)
{
    const ascc_train_config *c = &t->config;
    t->saved = now();
    if (ascc_trainer_save(t->trainer, c->checkpoint) != ASCC_OK) {
        (void)snprintf(t->error, sizeof t->error, "%.200s: %.200s; %s", c->checkpoint,
                       ascc_trainer_message(t->trainer),
                       ascc_system_there(c->checkpoint) ? "the checkpoint from before is whole"
                                                        : "there is no checkpoint yet");
        return false;
    }
    return write_model(t, c->latest) && (t->log.best.measured || write_model(t, c->output));
}

/* What an iteration of a stage takes: steps back and forth, and on average half the steps before. */
static double work_of(const ascc_training_stage *stage)
{
    return 3.5 * stage->unroll + 0.5 * stage->warm_up;
}

static double work_between(const training *t, uint64_t first, uint64_t end)
{
    double work = 0.0;
    uint64_t begin = 0;
    for (int32_t i = 0; i < t->config.options.stage_count; i++) {
        const ascc_training_stage *stage = &t->config.stage[i];
        const uint64_t from = begin > first ? begin : first;
        const uint64_t to = stage->end < end ? stage->end : end;
        work += to > from ? (double)(to - from) * work_of(stage) : 0.0;
        begin = stage->end;
    }
    return work;
}

static void show(training *t, const ascc_training_report *report)
{
    const ascc_validation *v = &t->log.last;
    const double share = t->loss > 0.0 ? 0.05 : 1.0;
    const double speed = report->seconds > 0.0 ? report->steps / report->seconds : 0.0;
    if (isfinite(report->loss))
        t->loss += share * (report->loss - t->loss);
    t->speed += share * (speed - t->speed);
    int length = snprintf(t->label, sizeof t->label, "loss %.4f", t->loss);
    if (v->measured)
        length +=
            snprintf(t->label + length, sizeof t->label - (size_t)length, "  errors %.2f/%.2f mm%s",
                     1e3 * v->error[0], 1e3 * v->error[1], v->stable ? "" : " unstable");
    (void)snprintf(t->label + length, sizeof t->label - (size_t)length, "  %.1f steps/s", t->speed);
    t->progress.work = work_between(t, t->progress.before, report->iteration);
    t->progress.work_left = work_between(t, report->iteration, t->end);
    ascc_progress_add(&t->progress, 1);
}

static double cpu_seconds(void)
{
    struct timespec t;
    return clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t) == 0
               ? (double)t.tv_sec + 1e-9 * (double)t.tv_nsec
               : 0.0;
}

static bool iterate(training *t)
{
    ascc_training_report report = {.size = sizeof report};
    ascc_validation v = {.measured = false};
    const double begin = cpu_seconds();
    if (ascc_trainer_iterate(t->trainer, &report) != ASCC_OK) {
        (void)snprintf(t->error, sizeof t->error, "iteration %" PRIu64 ": %.400s",
                       ascc_trainer_iteration(t->trainer) + 1, ascc_trainer_message(t->trainer));
        return false;
    }
    const double seconds = cpu_seconds() - begin;
    const bool learned = report.skipped < t->config.options.batch;
    if (!learned) /* there is no loss, and weights that compute nothing are not to be kept */
        report.loss = NAN;
    const bool due =
        report.iteration % t->config.validate_every == 0 || report.iteration == schedule_end(t);
    if (t->truth_count && due && !validate(t, &v))
        return false;
    if (!ascc_train_log_add(&t->log, stage_of(t, report.iteration), &report, seconds, &v))
        return fail(t, t->config.log, strerror(errno));
    show(t, &report);
    return !learned || now() - t->saved < t->config.checkpoint_seconds || save(t);
}

/* Whatever ends the run, the weights that are there are good ones: they are saved. */
static bool run(training *t)
{
    ascc_system_on_interrupt(on_interrupt);
    t->saved = now();
    (void)snprintf(t->label, sizeof t->label, "training");
    ascc_progress_start(&t->progress, t->label, (size_t)t->end);
    t->progress.done = t->progress.before = (size_t)ascc_trainer_iteration(t->trainer);
    bool good = true;
    while (good && !interrupted && ascc_trainer_iteration(t->trainer) < t->end)
        good = iterate(t);
    ascc_progress_end(&t->progress);
    char first[sizeof t->error];
    memcpy(first, t->error, sizeof first);
    const bool saved = save(t);
    if (!good) /* the first error is the one to tell */
        memcpy(t->error, first, sizeof first);
    if (!good && saved)
        ascc_line(stderr, "ascc train: %s and %s hold iteration %" PRIu64, t->config.checkpoint,
                  t->config.latest, ascc_trainer_iteration(t->trainer));
    return saved && good;
}

/* ---- From config to trainer ----------------------------------------------------------------------- */

/* Where a tensor lies in the data. False: there is no such tensor, or it lies elsewhere. */
static bool place_of(const json_t *tensor, size_t size, size_t *begin, size_t *count)
{
    json_int_t from, to;
    if (json_unpack((json_t *)tensor, "{s:[I,I]}", "data_offsets", &from, &to) != 0 || from < 0 ||
        to < from || (uint64_t)to > size)
        return false;
    *begin = (size_t)from;
    *count = (size_t)(to - from);
    return true;
}

/* Gives the tensors of one model file the numbers of another's of the same names and shapes. */
static bool copy_weights(training *t, const unsigned char *from, size_t from_size,
                         unsigned char *to, size_t to_size)
{
    size_t from_data = 0, to_data = 0;
    char why[256];
    json_t *source = ascc_tensor_file_header(from, from_size, &from_data, why, sizeof why);
    json_t *target = ascc_tensor_file_header(to, to_size, &to_data, why, sizeof why);
    bool good = source && target;
    const char *name;
    json_t *own;
    json_object_foreach(target, name, own)
    {
        const json_t *other = json_object_get(source, name);
        size_t at, count, other_at, other_count;
        if (!good || strcmp(name, "__metadata__") == 0)
            continue;
        good = json_equal(json_object_get(own, "shape"), json_object_get(other, "shape")) &&
               json_equal(json_object_get(own, "dtype"), json_object_get(other, "dtype")) &&
               place_of(own, to_size - to_data, &at, &count) &&
               place_of(other, from_size - from_data, &other_at, &other_count) &&
               count == other_count;
        if (good)
            memcpy(to + to_data + at, from + from_data + other_at, count);
        else
            (void)snprintf(why, sizeof why,
                           "tensor '%s' of the network is not there, or of another shape or type",
                           name);
    }
    json_decref(source);
    json_decref(target);
    return good || fail(t, t->config.model, why);
}

/* The context's last message. */
static bool fail_made(training *t, const char *what)
{
    char why[256];
    (void)ascc_train_context_message(t->context, why, sizeof why);
    return fail(t, what, why);
}

/* A model file of the network that the config describes, from malloc; NULL after fail. */
static unsigned char *make_model(training *t, size_t *size)
{
    const ascc_train_config *c = &t->config;
    unsigned char *model = NULL;
    if (ascc_train_initial_model(t->context, c->network, c->network_seed, NULL, 0, size) ==
        ASCC_OK) {
        model = malloc(*size);
        if (model && ascc_train_initial_model(t->context, c->network, c->network_seed, model, *size,
                                              size) == ASCC_OK)
            return model;
    }
    (void)fail_made(t, "network");
    free(model);
    return NULL;
}

/* The bytes of a model file; a published network is converted. NULL after fail. */
static unsigned char *read_model(training *t, const char *path, size_t *size)
{
    char why[256] = "";
    unsigned char *bytes = read_whole(t, path, size);
    if (!bytes || !ascc_published_is(bytes, *size))
        return bytes;
    unsigned char *converted = ascc_published_convert(bytes, *size, size, why, sizeof why);
    if (!converted)
        (void)fail(t, path, why);
    free(bytes);
    return converted;
}

/* The model file that training begins with; NULL after fail. */
static unsigned char *first_model(training *t, size_t *size)
{
    const ascc_train_config *c = &t->config;
    size_t given_size = 0;
    unsigned char *given = c->model[0] ? read_model(t, c->model, &given_size) : NULL;
    if (c->model[0] && (!given || !c->network)) {
        *size = given_size;
        return given;
    }
    unsigned char *made = make_model(t, size);
    if (made && given && !copy_weights(t, given, given_size, made, *size)) {
        free(made);
        made = NULL;
    }
    free(given);
    return made;
}

static bool create_trainer(training *t)
{
    const ascc_train_config *c = &t->config;
    const ascc_context_options options = {.size = sizeof options, .thread_count = t->threads};
    size_t size;
    ascc_status status = ascc_train_context_create(&options, &t->context);
    if (status != ASCC_OK)
        return fail(t, "threads", ascc_status_text(status));
    unsigned char *bytes = first_model(t, &size);
    if (!bytes)
        return false;
    status = ascc_trainer_create(t->context, &c->options, bytes, size, &t->trainer);
    free(bytes);
    return status == ASCC_OK || fail_made(t, c->model[0] ? c->model : "network");
}

static bool load_checkpoint(training *t)
{
    const char *path = t->config.checkpoint;
    const bool there = ascc_system_there(path);
    if (there && !t->resume)
        return fail(t, path, "is there already: --resume goes on from it; move it to begin anew");
    if (!there && t->resume)
        ascc_line(stderr, "ascc train: %s: not there yet, training begins", path);
    if (there && ascc_trainer_load(t->trainer, path) != ASCC_OK)
        return fail(t, path, ascc_trainer_message(t->trainer));
    return true;
}

/* The folder of the output, if only that is missing. */
static void make_folder(const char *path)
{
    char folder[ASCC_NEW_FILE_PATH];
    ascc_folder_of(path, folder);
    (void)ascc_system_make_folder(folder);
}

/* Told before the work what would fail after it. */
static bool check_outputs(training *t)
{
    const ascc_train_config *c = &t->config;
    const char *const paths[] = {c->output, c->latest, c->checkpoint, c->log, c->chart};
    for (size_t i = 0; i < sizeof paths / sizeof *paths; i++)
        if (!ascc_new_file_check(paths[i], t->error, sizeof t->error))
            return false;
    return true;
}

static bool open_all(training *t)
{
    make_folder(t->config.output);
    if (!check_outputs(t))
        return false;
    char why[512];
    if (!create_trainer(t) || !load_checkpoint(t) || !add_sequences(t) || !load_truths(t))
        return false;
    if (ascc_train_log_open(t->config.log, ascc_trainer_iteration(t->trainer), &t->log, why,
                            sizeof why))
        return true;
    (void)snprintf(t->error, sizeof t->error, "%s", why);
    return false;
}

static void close_all(training *t)
{
    for (size_t i = 0; i < t->truth_count; i++)
        ascc_truth_free(&t->truth[i]);
    free(t->truth);
    ascc_train_log_close(&t->log);
    ascc_trainer_destroy(&t->trainer);
    ascc_train_context_destroy(&t->context);
    ascc_train_config_free(&t->config);
}

static void print_result(const training *t)
{
    const ascc_train_config *c = &t->config;
    const ascc_validation *best = &t->log.best;
    const uint64_t done = ascc_trainer_iteration(t->trainer);
    ascc_line(stdout, "%s: %" PRIu64 " iterations, %.0f CPU s", c->output, done, t->log.seconds);
    if (best->measured)
        ascc_line(stdout, "  best on valid      errors %.4g and %.4g mm, %s", 1e3 * best->error[0],
                  1e3 * best->error[1], best->stable ? "rollouts hold" : "rollouts lose particles");
    if (c->valid.count)
        ascc_line(stdout, "  latest             %s", c->latest);
    if (ascc_train_log_chart(c->log, c->chart, best->measured))
        ascc_line(stdout, "  log, chart         %s, %s", c->log, c->chart);
    else
        ascc_line(stdout, "  log                %s; no chart: gnuplot is not installed, or failed",
                  c->log);
    if (done < schedule_end(t))
        ascc_line(stdout, "stopped before %" PRIu64 " iterations; ascc train %s --resume goes on",
                  schedule_end(t), t->path);
}

/* ---- Arguments ------------------------------------------------------------------------------------ */

static int usage(void)
{
    fputs("usage: ascc train CONFIG [--resume] [--iterations N] [--threads N]\n\n"
          "Trains a network as the file CONFIG says (docs/training.md). Ctrl-C saves and stops.\n\n"
          "  --resume        goes on from the checkpoint; the result is that of never having "
          "stopped\n"
          "  --iterations N  stops (to be resumed) after N iterations in all\n"
          "  --threads N     threads to use (all); results do not depend on it\n",
          stdout);
    return 0;
}

static bool read_count(const char *text, uint64_t most, uint64_t *value)
{
    char *end;
    errno = 0;
    *value = strtoull(text, &end, 10);
    return *text >= '0' && *text <= '9' && !*end && !errno && *value >= 1 && *value <= most;
}

static bool read_arguments(training *t, int argc, char **argv)
{
    static const char *const options[] = {"--resume", "--iterations", "--threads", NULL};
    uint64_t threads = 0;
    for (int i = 0; i < argc; i++) {
        const bool value = i + 1 < argc;
        if (strcmp(argv[i], "--resume") == 0) {
            t->resume = true;
        } else if (strcmp(argv[i], "--iterations") == 0 && value &&
                   read_count(argv[i + 1], (uint64_t)1 << 40, &t->end)) {
            i++;
        } else if (strcmp(argv[i], "--threads") == 0 && value &&
                   read_count(argv[i + 1], 1024, &threads)) {
            i++;
        } else if (argv[i][0] != '-' && !t->path) {
            t->path = argv[i];
        } else {
            return ascc_bad_option("train", options, argv[i], argv[i + 1]);
        }
    }
    t->threads = threads ? (int32_t)threads : ascc_system_processors();
    return t->path || ascc_bad_use("train", "a CONFIG is wanted", NULL, NULL);
}

int ascc_command_train(int argc, char **argv)
{
    static training t; /* large: paths */
    if (argc == 1 && strcmp(argv[0], "--help") == 0)
        return usage();
    if (!read_arguments(&t, argc, argv))
        return 2;
    bool good = ascc_train_config_read(t.path, &t.config, t.error, sizeof t.error);
    if (good && (t.end == 0 || t.end > schedule_end(&t)))
        t.end = schedule_end(&t);
    good = good && open_all(&t);
    if (good) {
        good = run(&t);
        if (good)
            print_result(&t);
    }
    if (t.error[0])
        ascc_line(stderr, "ascc train: %s", t.error);
    close_all(&t);
    return good ? 0 : 1;
}
