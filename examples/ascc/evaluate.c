/* Measuring a method on a sequence, in every measure of docs/measures.md.
 * SPDX-License-Identifier: MIT
 *
 *   one and two frames   from many true states: err_n1, err_n2
 *   rollout              from frame 0 to the end, on its own: everything else
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "evaluate.h"
#include "measures.h"
#include "progress.h"
#include "sequence.h"

/* Frames whose kinetic energy is reported. */
static const size_t ENERGY_FRAMES[] = {0,  5,   10,  20,  30,  40,  50, 75,
                                       99, 100, 125, 149, 150, 175, 199};
/* Frames after which the mean error of the rollout is reported. */
static const size_t ERROR_FRAMES[] = {1, 2, 5, 10, 20, 50};

enum {
    ENERGY_COUNT = sizeof ENERGY_FRAMES / sizeof *ENERGY_FRAMES,
    ERROR_COUNT = sizeof ERROR_FRAMES / sizeof *ERROR_FRAMES,
    SUBSET = 2000, /* particles of an exact assignment where all are too many */
    LOOK_BACK = 8  /* frames before a true state that methods are told of */
};

const ascc_method *ascc_method_find(const char *word, const char **settings)
{
    for (size_t k = 0; ascc_methods[k]; k++) {
        const size_t length = strlen(ascc_methods[k]->prefix);
        *settings = word + length;
        if (strncmp(word, ascc_methods[k]->prefix, length) == 0)
            return ascc_methods[k];
    }
    return NULL;
}

/* ---- The truth ------------------------------------------------------------------------------- */

static double *to_double(const float *values, size_t count)
{
    double *copy = malloc((count + 1) * sizeof *copy);
    for (size_t i = 0; i < count && copy; i++)
        copy[i] = (double)values[i];
    return copy;
}

void ascc_truth_free(ascc_truth *t)
{
    free(t->position);
    free(t->velocity);
    free(t->wall);
    free(t->normal);
}

size_t ascc_thin_frames(void *rows, size_t row_size, size_t frames, size_t every)
{
    unsigned char *bytes = rows;
    for (size_t f = 1; f * every < frames; f++)
        memmove(bytes + f * row_size, bytes + f * every * row_size, row_size);
    return frames ? (frames - 1) / every + 1 : 0;
}

void ascc_truth_thin(ascc_truth *t, size_t every)
{
    const size_t row = t->scene.fluid_count * (size_t)t->scene.dimension * sizeof(double);
    const bool moving = t->velocity_frames == t->frames;
    const size_t frames = ascc_thin_frames(t->position, row, t->frames, every);
    if (moving)
        (void)ascc_thin_frames(t->velocity, row, t->frames, every);
    t->frames = frames;
    t->velocity_frames = moving ? frames : 1;
    t->scene.time_step *= (double)every;
}

bool ascc_truth_load(const char *path, int32_t threads, ascc_truth *t, ascc_method_error *error)
{
    ascc_sequence s;
    memset(t, 0, sizeof *t);
    if (!ascc_sequence_read(path, &s, error->text, sizeof error->text))
        return false;
    const size_t row = s.count * (size_t)s.dimension, walls = s.walls * (size_t)s.dimension;
    t->frames = s.frames;
    t->velocity_frames = s.velocity_frames;
    t->position = to_double(s.position, s.frames * row);
    t->velocity = to_double(s.velocity, s.velocity_frames * row);
    t->wall = to_double(s.wall, walls);
    t->normal = to_double(s.normal, walls);
    t->scene = (ascc_method_scene){.dimension = s.dimension,
                                   .threads = threads,
                                   .time_step = s.time_step,
                                   .spacing = 2.0 * s.radius,
                                   .mass = s.mass,
                                   .rest_density = s.rest_density,
                                   .gravity = {s.gravity[0], s.gravity[1], s.gravity[2]},
                                   .fluid_count = s.count,
                                   .wall_count = s.walls,
                                   .wall = t->wall,
                                   .normal = t->normal,
                                   .first_layer = s.first_layer};
    ascc_sequence_free(&s);
    if (t->position && t->velocity && t->wall && t->normal && t->frames > 0)
        return true;
    snprintf(error->text, sizeof error->text, "%.200s: empty, or no memory", path);
    ascc_truth_free(t);
    return false;
}

static size_t row_of(const ascc_truth *t)
{
    return t->scene.fluid_count * (size_t)t->scene.dimension;
}

/* Velocities of a frame, of the kind wanted: the file's, or made into `room`. NULL if there are none. */
static const double *true_velocity(const ascc_truth *t, size_t frame, ascc_velocity_kind kind,
                                   double *room)
{
    const size_t row = row_of(t);
    if (kind == ASCC_VELOCITY_STORED)
        return frame < t->velocity_frames ? t->velocity + frame * row : NULL;
    if (frame == 0)
        return NULL;
    for (size_t i = 0; i < row; i++)
        room[i] = (t->position[frame * row + i] - t->position[(frame - 1) * row + i]) /
                  t->scene.time_step;
    return room;
}

static ascc_measure_set set_of(const ascc_truth *t, const double *position, const double *velocity)
{
    return (ascc_measure_set){.dimension = t->scene.dimension,
                              .count = t->scene.fluid_count,
                              .position = position,
                              .velocity = velocity,
                              .particle_mass = t->scene.mass};
}

/* What a run works with. */
typedef struct bench {
    const ascc_evaluate_options *options;
    const ascc_truth *truth;
    const ascc_method *method;
    void *state;
    double *position, *velocity, *true_velocity; /* [row] */
    double *density[2];                          /* [count] of prediction and truth */
    ascc_progress *progress;
    ascc_report_run *run;
} bench;

/* ---- One and two frames ---------------------------------------------------------------------- */

/* What a method that looks back can know in a frame, by frame difference. */
static bool look_back(bench *b, size_t frame, ascc_method_error *why)
{
    for (size_t ago = 0; b->method->look_back && ago < LOOK_BACK && frame >= ago + 2; ago++) {
        const double *velocity =
            true_velocity(b->truth, frame - ago - 1, ASCC_VELOCITY_DIFFERENCE, b->true_velocity);
        if (!b->method->look_back(b->state, ago, velocity, why))
            return false;
    }
    return true;
}

/* Mean error after one and two frames from a true state. False: the method gave up. */
static bool two_frames(bench *b, size_t frame, ascc_velocity_kind kind, double error[2],
                       ascc_method_error *why)
{
    const ascc_truth *t = b->truth;
    const double *velocity = true_velocity(t, frame, kind, b->true_velocity);
    if (!b->method->set(b->state, t->position + frame * row_of(t), velocity, kind, why) ||
        !look_back(b, frame, why))
        return false;
    for (size_t n = 0; n < 2; n++) {
        if (!b->method->advance(b->state, why))
            return false;
        b->method->read(b->state, b->position, b->velocity);
        const ascc_measure_set predicted = set_of(t, b->position, NULL);
        const ascc_measure_set real = set_of(t, t->position + (frame + n + 1) * row_of(t), NULL);
        double mean;
        (void)ascc_measure_mean_distance(&predicted, &real, &mean); /* NaN tells */
        error[n] += mean;
    }
    return true;
}

/* Start frames: from the command line, else every 5th from 0, or every 10th from 10 for differences, as
 * the published networks' figures were made. */
static void start_frames(const ascc_evaluate_options *o, const ascc_truth *t,
                         ascc_velocity_kind kind, size_t *first, size_t *end, size_t *step)
{
    const bool stored = kind == ASCC_VELOCITY_STORED;
    *first = o->has_frames ? (size_t)o->first : stored ? 0 : 10;
    *step = o->has_frames ? (size_t)o->step : stored ? 5 : 10;
    *end = t->frames < 2 ? 0 : t->frames - 2;
    if (o->has_frames && o->end >= 0 && (size_t)o->end < *end)
        *end = (size_t)o->end;
    if (stored && t->velocity_frames < *end)
        *end = t->velocity_frames;
    if (!stored && *first == 0)
        *first = *step;
}

static bool wants(const ascc_evaluate_options *o, const ascc_truth *t, ascc_velocity_kind kind)
{
    if (o->velocity >= 0)
        return o->velocity == (int)kind;
    return kind == ASCC_VELOCITY_DIFFERENCE || t->velocity_frames == t->frames;
}

static void short_term(bench *b, ascc_velocity_kind kind)
{
    const char *name = kind == ASCC_VELOCITY_STORED ? "stored" : "difference";
    size_t first, end, step, count = 0;
    double error[2] = {0};
    ascc_method_error why = {""};
    if (!wants(b->options, b->truth, kind))
        return;
    start_frames(b->options, b->truth, kind, &first, &end, &step);
    for (size_t frame = first; frame < end; frame += step, count++) {
        if (!two_frames(b, frame, kind, error, &why)) {
            error[0] = error[1] = NAN;
            snprintf(b->run->note, sizeof b->run->note, "from frame %zu: %.200s", frame, why.text);
            break;
        }
        ascc_progress_add(b->progress, 2);
    }
    ascc_report_add(b->run, (double)count, "starts_%s", name);
    ascc_report_add(b->run, count ? error[0] / (double)count : NAN, "err_n1_%s", name);
    ascc_report_add(b->run, count ? error[1] / (double)count : NAN, "err_n2_%s", name);
}

/* ---- Rollout --------------------------------------------------------------------------------- */

/* What is gathered over the frames of a rollout. */
typedef struct rollout {
    size_t last;    /* frame reached */
    size_t counted; /* frames in the sums below: 1 to last */
    size_t published_count;
    size_t non_finite, escaped, escaped_most;
    double farthest, nearest_sum, jsd, jsd_sum;
    double density_most[2]; /* published kind, of prediction and truth, over all frames */
    double published_sum, density_maximum_sum, density_mean_sum;
    double min_distance, close_sum, tight_most;
    double energy_gain, max_speed;
    double momentum_sum, angular_sum, drift, balance;
    double start_energy, start_momentum[3], last_momentum[3], external[3];
    double kinetic[ENERGY_COUNT], error[ERROR_COUNT], rmse[ERROR_COUNT];
    double chamfer_second[2], density_second[2]; /* after one second */
    double chamfer_final[2], offset[3];
} rollout;

static size_t one_second(const ascc_truth *t)
{
    return (size_t)(1.0 / t->scene.time_step + 0.5);
}

/* The frames of the published networks' density figures: every other one, and the last. */
static bool published_samples(const ascc_truth *t, size_t frame)
{
    return frame % 2 == 0 || frame + 1 == t->frames;
}

/* fmax, but a NaN stays. */
static double greater(double a, double b)
{
    return isnan(a) || a >= b ? a : b;
}

static double greatest(const double *values, size_t count)
{
    double most = 0.0;
    for (size_t i = 0; i < count; i++)
        most = greater(most, values[i]);
    return most;
}

/* Densities of prediction and truth into b->density, and their errors; all NaN if one has none. */
static ascc_measure_density_error compare_densities(bench *b, const ascc_measure_set *predicted,
                                                    const ascc_measure_set *real, size_t walls)
{
    const ascc_method_scene *scene = &b->truth->scene;
    const double radius = 2.0 * scene->spacing;
    const int32_t threads = b->truth->scene.threads;
    const size_t n = scene->fluid_count;
    ascc_measure_density_error error = {NAN, NAN, NAN, NAN};
    if (ascc_measure_density(predicted, walls, scene->wall, radius, threads, b->density[0]) ==
            ASCC_OK &&
        ascc_measure_density(real, walls, scene->wall, radius, threads, b->density[1]) == ASCC_OK)
        (void)ascc_measure_compare_density(n, b->density[0], n, b->density[1],
                                           ascc_measure_rest_density(scene->dimension), &error);
    else
        b->density[0][0] = b->density[1][0] = NAN;
    return error;
}

static void measure_densities(bench *b, const ascc_measure_set *predicted,
                              const ascc_measure_set *real, size_t frame, rollout *r)
{
    const ascc_method_scene *scene = &b->truth->scene;
    ascc_measure_density_error error = compare_densities(b, predicted, real, 0);
    r->density_maximum_sum += error.maximum; /* 0 at frame 0 */
    r->density_mean_sum += error.mean;
    if (frame == one_second(b->truth)) {
        r->density_second[0] = error.maximum;
        r->density_second[1] = error.mean;
    }
    if (!published_samples(b->truth, frame))
        return;
    error = compare_densities(b, predicted, real, scene->wall_count);
    r->published_sum += error.published;
    r->published_count++;
    for (int k = 0; k < 2; k++)
        r->density_most[k] =
            greater(r->density_most[k], greatest(b->density[k], scene->fluid_count));
}

static void measure_shape(bench *b, const ascc_measure_set *predicted, const ascc_measure_set *real,
                          size_t frame, rollout *r)
{
    const int32_t threads = b->truth->scene.threads;
    const double spacing = b->truth->scene.spacing;
    double forth, back;
    ascc_measure_pair_spacing pairs;
    (void)ascc_measure_chamfer(real, predicted, threads, &forth, &back);
    r->nearest_sum += forth;
    for (size_t k = 0; k < ERROR_COUNT; k++)
        if (ERROR_FRAMES[k] == frame) {
            (void)ascc_measure_mean_distance(predicted, real, &r->error[k]);
            (void)ascc_measure_rmse(predicted, real, &r->rmse[k]);
        }
    if (frame == one_second(b->truth)) {
        r->chamfer_second[0] = forth;
        r->chamfer_second[1] = back;
    }
    r->chamfer_final[0] = forth;
    r->chamfer_final[1] = back;
    if (ascc_measure_pairs(predicted, spacing, threads, &pairs) == ASCC_OK) {
        r->min_distance = fmin(r->min_distance, pairs.min_distance);
        r->close_sum += pairs.close_fraction;
        r->tight_most = fmax(r->tight_most, pairs.tight_fraction);
    } else
        r->close_sum = NAN;
}

static void measure_speeds(const ascc_measure_set *predicted, const ascc_measure_set *real,
                           rollout *r)
{
    uint64_t bins[2][ASCC_MEASURE_SPEED_BINS];
    r->jsd = NAN;
    if (ascc_measure_speed_histogram(predicted, bins[0]) == ASCC_OK &&
        ascc_measure_speed_histogram(real, bins[1]) == ASCC_OK)
        r->jsd = ascc_measure_jsd(bins[0], bins[1], ASCC_MEASURE_SPEED_BINS);
    r->jsd_sum += r->jsd;
}

/* No sums from here on: a particle is lost. */
static void lose_motion(rollout *r)
{
    r->momentum_sum = r->angular_sum = NAN;
    r->energy_gain = r->max_speed = r->drift = r->balance = NAN;
    for (int c = 0; c < 3; c++)
        r->offset[c] = NAN;
}

/* Energy and momentum of the prediction, and against the truth if there is one to compare with. */
static void measure_motion(bench *b, const ascc_measure_set *predicted,
                           const ascc_measure_set *real, size_t frame, rollout *r)
{
    ascc_measure_motion_sums p, t;
    if (ascc_measure_motion(predicted, b->truth->scene.gravity, &p) != ASCC_OK ||
        ascc_measure_motion(real, b->truth->scene.gravity, &t) != ASCC_OK) {
        lose_motion(r);
        return;
    }
    for (size_t k = 0; k < ENERGY_COUNT; k++)
        if (ENERGY_FRAMES[k] == frame)
            r->kinetic[k] = p.kinetic;
    for (int c = 0; c < 3; c++)
        r->offset[c] = p.center[c] - t.center[c];
    r->max_speed = greater(r->max_speed, p.max_speed);
    if (frame == 0) {
        r->start_energy = p.kinetic + p.potential;
        memcpy(r->start_momentum, p.momentum, sizeof p.momentum);
        memcpy(r->last_momentum, p.momentum, sizeof p.momentum);
        return;
    }
    r->energy_gain = greater(r->energy_gain, p.kinetic + p.potential - r->start_energy);
    r->momentum_sum += ascc_measure_momentum_error(&p, &t);
    r->angular_sum += ascc_measure_angular_error(&p, &t);
    if (b->method->impulses) {
        double external[3], wall[3];
        b->method->impulses(b->state, external, wall);
        for (int c = 0; c < 3; c++)
            r->external[c] += external[c] - wall[c];
        r->drift =
            greater(r->drift, ascc_measure_drift(p.momentum, r->start_momentum, r->external));
        r->balance = greater(
            r->balance, ascc_measure_wall_balance(r->last_momentum, p.momentum, external, wall));
        memcpy(r->last_momentum, p.momentum, sizeof p.momentum);
    }
}

/* Escapes and non-finite values first, from the numbers as they are. */
static void measure_frame(bench *b, size_t frame, rollout *r)
{
    const ascc_truth *t = b->truth;
    const double *velocity = true_velocity(t, frame, ASCC_VELOCITY_STORED, b->true_velocity);
    if (!velocity)
        velocity = true_velocity(t, frame, ASCC_VELOCITY_DIFFERENCE, b->true_velocity);
    const ascc_measure_set predicted = set_of(t, b->position, b->velocity);
    const ascc_measure_set real = set_of(t, t->position + frame * row_of(t), velocity);
    ascc_measure_escape escape;
    const size_t bad = ascc_measure_non_finite(&predicted);
    r->non_finite = bad > r->non_finite ? bad : r->non_finite;
    (void)ascc_measure_escapes(&predicted, t->scene.first_layer, t->wall, t->normal,
                               t->scene.spacing, b->truth->scene.threads, &escape);
    r->escaped = escape.count;
    r->escaped_most = escape.count > r->escaped_most ? escape.count : r->escaped_most;
    r->farthest = fmax(r->farthest, escape.farthest);
    measure_motion(b, &predicted, &real, frame, r);
    measure_densities(b, &predicted, &real, frame, r);
    if (frame == 0)
        return;
    measure_shape(b, &predicted, &real, frame, r);
    measure_speeds(&predicted, &real, r);
    r->counted++;
}

static void measure_emd(bench *b)
{
    const ascc_truth *t = b->truth;
    const size_t n = t->scene.fluid_count, d = (size_t)t->scene.dimension;
    ascc_measure_set p = set_of(t, b->position, NULL);
    ascc_measure_set q = set_of(t, t->position + (t->frames - 1) * row_of(t), NULL);
    double emd = NAN;
    const size_t wanted = n > ASCC_MEASURE_EMD_LIMIT ? SUBSET : n;
    size_t *index = malloc((wanted + 1) * sizeof *index);
    double *copy = malloc(2 * wanted * d * sizeof *copy);
    if (index && copy) {
        ascc_measure_subset(n, wanted, index);
        for (size_t k = 0; k < wanted; k++) {
            memcpy(copy + k * d, p.position + index[k] * d, d * sizeof *copy);
            memcpy(copy + (wanted + k) * d, q.position + index[k] * d, d * sizeof *copy);
        }
        p.count = q.count = wanted;
        p.position = copy;
        q.position = copy + wanted * d;
        (void)ascc_measure_emd_exact(&p, &q, b->truth->scene.threads, &emd, NULL);
    }
    free(index);
    free(copy);
    ascc_report_add(b->run, emd, "emd_final");
    ascc_report_add(b->run, (double)wanted, "emd_particles");
}

static void measure_sinkhorn(bench *b)
{
    const ascc_truth *t = b->truth;
    const ascc_measure_set p = set_of(t, b->position, NULL);
    const ascc_measure_set q = set_of(t, t->position + (t->frames - 1) * row_of(t), NULL);
    const ascc_measure_sinkhorn_options sinkhorn = {.epsilon = 0.5 * t->scene.spacing,
                                                    .threads = b->truth->scene.threads};
    ascc_measure_sinkhorn_result result;
    (void)ascc_measure_sinkhorn(&p, &q, &sinkhorn, &result);
    ascc_report_add(b->run, result.divergence, "sinkhorn_final");
    ascc_report_add(b->run, sinkhorn.epsilon, "sinkhorn_epsilon");
    ascc_report_add(b->run, result.residual, "sinkhorn_residual");
}

/* The figures at certain frames; those beyond the sequence are left out, those not reached are NaN. */
static void report_frames(bench *b, const rollout *r)
{
    ascc_report_run *run = b->run;
    const size_t frames = b->truth->frames, second = one_second(b->truth);
    const bool complete = r->last + 1 == frames;
    for (size_t k = 0; k < ERROR_COUNT && ERROR_FRAMES[k] < frames; k++)
        ascc_report_add(run, r->error[k], "mean_error_%zu", ERROR_FRAMES[k]);
    for (size_t k = 0; k < ERROR_COUNT && ERROR_FRAMES[k] < frames; k++)
        ascc_report_add(run, r->rmse[k], "rmse_%zu", ERROR_FRAMES[k]);
    if (second < frames) {
        ascc_report_add(run, r->chamfer_second[0], "chamfer_1s_gt2pred");
        ascc_report_add(run, r->chamfer_second[1], "chamfer_1s_pred2gt");
        ascc_report_add(run, r->density_second[0], "density_max_error_1s");
        ascc_report_add(run, r->density_second[1], "density_mean_error_1s");
    }
    ascc_report_add(run, complete ? r->chamfer_final[0] : NAN, "chamfer_final_gt2pred");
    ascc_report_add(run, complete ? r->chamfer_final[1] : NAN, "chamfer_final_pred2gt");
    ascc_report_add(run, complete ? r->jsd : NAN, "jsd_final");
    for (int c = 0; c < b->truth->scene.dimension; c++)
        ascc_report_add(run, complete ? r->offset[c] : NAN, "com_offset_%c", "xyz"[c]);
    for (size_t k = 0; k < ENERGY_COUNT && ENERGY_FRAMES[k] < frames; k++)
        ascc_report_add(run, r->kinetic[k], "kinetic_%zu", ENERGY_FRAMES[k]);
}

static void report_rollout(bench *b, const rollout *r)
{
    ascc_report_run *run = b->run;
    const double n = r->counted ? (double)r->counted : NAN;
    const bool complete = r->last + 1 == b->truth->frames;
    ascc_report_add(run, (double)r->last, "last_frame");
    ascc_report_add(run, (double)r->non_finite, "non_finite_max");
    ascc_report_add(run, complete ? (double)r->escaped : NAN, "escaped_final");
    ascc_report_add(run, (double)r->escaped_most, "escaped_max");
    ascc_report_add(run, r->farthest, "farthest_outside");
    ascc_report_add(run, r->nearest_sum / n, "gt2pred_mean");
    ascc_report_add(run, fabs(r->density_most[0] - r->density_most[1]) / r->density_most[1],
                    "published_density_error");
    ascc_report_add(run, r->published_sum / (double)r->published_count, "published_density_frames");
    ascc_report_add(run, r->density_maximum_sum / n, "density_max_error");
    ascc_report_add(run, r->density_mean_sum / n, "density_mean_error");
    ascc_report_add(run, r->jsd_sum / n, "jsd_mean");
    ascc_report_add(run, isnan(r->close_sum) ? NAN : r->min_distance, "min_pair_distance");
    ascc_report_add(run, r->close_sum / n, "close_pairs_mean");
    ascc_report_add(run, isnan(r->close_sum) ? NAN : r->tight_most, "tight_pairs_max");
    ascc_report_add(run, r->energy_gain, "energy_gain_max");
    ascc_report_add(run, r->max_speed, "max_speed");
    ascc_report_add(run, r->momentum_sum / n, "momentum_error");
    ascc_report_add(run, r->angular_sum / n, "angular_error");
    ascc_report_add(run, b->method->impulses ? r->drift : NAN, "momentum_drift_max");
    ascc_report_add(run, b->method->impulses ? r->balance : NAN, "wall_balance_max");
    report_frames(b, r);
}

static void fill_nan(double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        values[i] = NAN;
}

static void run_rollout(bench *b)
{
    const ascc_truth *t = b->truth;
    rollout r = {.min_distance = INFINITY};
    ascc_method_error why = {""};
    fill_nan(r.kinetic, ENERGY_COUNT);
    fill_nan(r.error, ERROR_COUNT);
    fill_nan(r.rmse, ERROR_COUNT);
    fill_nan(r.chamfer_second, 2);
    fill_nan(r.density_second, 2);
    memcpy(b->position, t->position, row_of(t) * sizeof(double));
    memset(b->velocity, 0, row_of(t) * sizeof(double));
    if (t->velocity_frames)
        memcpy(b->velocity, t->velocity, row_of(t) * sizeof(double));
    bool going = b->method->set(b->state, b->position, b->velocity, ASCC_VELOCITY_STORED, &why);
    measure_frame(b, 0, &r);
    while (going && r.last + 1 < t->frames) {
        going = b->method->advance(b->state, &why);
        if (!going)
            break;
        b->method->read(b->state, b->position, b->velocity);
        measure_frame(b, ++r.last, &r);
        ascc_progress_add(b->progress, 1);
    }
    if (!going)
        snprintf(b->run->note, sizeof b->run->note, "stopped after frame %zu: %.200s", r.last,
                 why.text);
    report_rollout(b, &r);
    if (going && (b->options->transport || b->options->emd))
        measure_emd(b);
    if (going && b->options->transport)
        measure_sinkhorn(b);
}

static size_t frames_to_run(const ascc_evaluate_options *o, const ascc_truth *t)
{
    size_t total = o->no_rollout ? 0 : t->frames - 1;
    for (int kind = 0; kind < 2; kind++) {
        size_t first, end, step;
        start_frames(o, t, (ascc_velocity_kind)kind, &first, &end, &step);
        if (wants(o, t, (ascc_velocity_kind)kind) && first < end)
            total += 2 * ((end - first + step - 1) / step);
    }
    return total;
}

bool ascc_evaluate(const ascc_evaluate_options *o, const ascc_method *method, const char *settings,
                   const ascc_truth *t, ascc_report_run *run, ascc_method_error *error)
{
    const size_t row = row_of(t), n = t->scene.fluid_count;
    bench b = {.options = o, .truth = t, .method = method, .run = run};
    double *numbers = calloc(3 * row + 2 * n + 1, sizeof *numbers);
    if (!numbers) {
        snprintf(error->text, sizeof error->text, "no memory");
        return false;
    }
    b.position = numbers;
    b.velocity = numbers + row;
    b.true_velocity = numbers + 2 * row;
    b.density[0] = numbers + 3 * row;
    b.density[1] = b.density[0] + n;
    const bool opened = method->open(settings, &t->scene, &b.state, error);
    if (opened) {
        ascc_progress progress;
        ascc_progress_start(&progress, run->sequence, frames_to_run(o, t));
        b.progress = &progress;
        ascc_report_add(run, (double)n, "fluid");
        ascc_report_add(run, (double)t->frames, "frames");
        short_term(&b, ASCC_VELOCITY_STORED);
        short_term(&b, ASCC_VELOCITY_DIFFERENCE);
        if (!o->no_rollout)
            run_rollout(&b);
        ascc_progress_end(&progress);
        method->close(b.state);
    }
    free(numbers);
    return opened;
}
