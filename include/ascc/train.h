/*
 * libascc-train: trains networks for libascc over rollouts, with the run-time's own forward pass.
 * SPDX-License-Identifier: MIT
 *
 * A program makes a context, a model file with initial weights from the description of a network, a trainer
 * from that file, adds sequences, and iterates: each iteration draws `batch` stretches of the sequences, rolls
 * the present network out over each, and moves the weights once. examples/learn.c does all of it; `ascc train`
 * is such a program.
 *
 * libascc-train brings its own copy of the run-time: it shares no handle with libascc, only bytes of
 * model files. What ascc.h says of results, structs, destroy, errors, units and printing holds here, too.
 */
#ifndef ASCC_TRAIN_H
#define ASCC_TRAIN_H

#include "ascc.h"

#ifdef __cplusplus
extern "C" {
#endif

/* ---- Context: memory, log, workers ------------------------------------------------------------ */

typedef struct ascc_train_context ascc_train_context;

/**
 * Makes a context, with the options of libascc's: thread_count is the number of rollouts that are computed at
 * once (it has no influence on results). Rollouts allocate: with more than one thread, or a job system, the
 * memory callbacks are called on several threads at once. errors: ARGUMENT, MEMORY, told to the log.
 */
ASCC_API ascc_status ascc_train_context_create(const ascc_context_options *options,
                                               ascc_train_context **context);
ASCC_API void ascc_train_context_destroy(ascc_train_context **context);

/** Copies the message of the last failed ascc_train_initial_model or ascc_trainer_create of this context, or
 * "", into text[capacity], always terminated. Returns its whole length. Any thread. */
ASCC_API size_t ascc_train_context_message(const ascc_train_context *context, char *text,
                                           size_t capacity);

/* ---- Initial weights -------------------------------------------------------------------------- */

/**
 * Makes a model file with every tensor that a network's description names, filled with random values to begin
 * training with: weights sized by how many numbers and neighbours they sum over, biases 0 or small, damping not
 * negative. Same description and seed, same bytes, on any machine.
 *
 * description   the text of `network` in docs/file-format.md, with the keys `cells` and `outputs` where the
 *               shapes of tensors follow from nothing else
 * model         receives the file, at most capacity bytes; NULL to learn its size alone
 * errors        ARGUMENT (capacity too small), MEMORY, FORMAT; the context's message names the key
 */
ASCC_API ascc_status ascc_train_initial_model(ascc_train_context *context, const char *description,
                                              uint64_t seed, void *model, size_t capacity,
                                              size_t *size);

/* ---- Trainer ---------------------------------------------------------------------------------- */

typedef struct ascc_trainer ascc_trainer;

/** A sequence to learn from, in metres. Copied by ascc_trainer_add_sequence, in units of the model: with
 * other spacings as the scene that is the same in the model's, time with the root of length, so that gravity is
 * what it was. */
typedef struct ascc_training_sequence {
    size_t size;      /* sizeof(ascc_training_sequence) */
    const char *name; /* for messages */
    size_t frame_count, fluid_count, boundary_count;
    const float *position;          /* [frame][fluid][dimension] */
    const float *boundary_position; /* [boundary][dimension], or of every frame: boundary_moves */
    const float *boundary_normal;   /* likewise, unit, into the fluid */
    double time_step;  /* s between frames: one step, at most time_step_max of the model */
    double gravity[3]; /* m/s^2 */
    double share;      /* how often it is drawn, relative to the others; 0 = 1 */
    int32_t warm_up;   /* at most so many steps before those with gradient; 0 = the stage's W */
    int32_t reserved;
    double jitter;          /* in place of the options', up to so much, drawn; 0 = the options' */
    double spacing;         /* m between its particles; 0 = the model's */
    int32_t boundary_moves; /* 1: the boundary's arrays are [frame][boundary][dimension] */
    int32_t dimension;      /* of the arrays, 2 or 3, which must be the model's; 0 = the model's */
} ascc_training_sequence;

/** A stretch of the schedule: until iteration `end`. */
typedef struct ascc_training_stage {
    uint64_t end;         /* iterations done when it is over, from the very start */
    int32_t unroll;       /* T, the unroll length: steps of a rollout that the loss is taken over */
    int32_t warm_up;      /* W: steps before them without gradient; each rollout draws 0 to W */
    double learning_rate; /* at its beginning */
    double learning_rate_end; /* at its end, on a geometric path; 0 = as at its beginning */
} ascc_training_stage;

/** Constants of a model's relaxation that can be trained beside its weights. */
typedef enum ascc_learn {
    ASCC_LEARN_REST_VOLUME = 1,
    ASCC_LEARN_EPSILON = 2,
    ASCC_LEARN_OMEGA = 4,     /* of each pressure sweep */
    ASCC_LEARN_DIVERGENCE = 8 /* of each divergence sweep */
} ascc_learn;

/** Options of ascc_trainer_create. Zero means the default that is stated. */
typedef struct ascc_trainer_options {
    size_t size;                      /* sizeof(ascc_trainer_options) */
    uint64_t seed;                    /* same seed and options, same weights to the bit */
    const ascc_training_stage *stage; /* at least one, `end` ascending */
    size_t stage_size;                /* sizeof(ascc_training_stage) */
    int32_t stage_count;
    int32_t batch;                /* rollouts an iteration; 0 = 8 */
    double beta1, beta2, epsilon; /* Adam: 0.9, 0.999, 1e-8 */
    double clip;                  /* largest norm of a gradient; 0 = 1 */
    double average;     /* each iteration's share that the averaged weights keep, such as 0.999;
                                   0 = not averaged */
    double jitter;      /* noise on first positions and velocities, particle spacings (a step) */
    double truth_share; /* of rollouts begun at true states, without steps before them, [0, 1];
                                   the others draw 0 to W */
    double
        neighbor_weight; /* of exp(-w c / c_avg) in Eq. 3; 0 = 1; negative = all particles alike */
    double density_weight;      /* of the penalty on compression, see docs/training.md; 0 = none */
    double wall_weight;         /* of the penalty on particles in walls; 0 = none */
    size_t memory_limit;        /* bytes of kept steps in all rollouts at once; what does not fit is
                                   computed a second time; 0 = 4 GiB */
    int32_t position_gradients; /* 1: also through the places of particles; 0: as constants */
    int32_t rotate; /* 1: turn rollouts about gravity (without gravity: about any axis) */
    int32_t mirror; /* 1: mirror every second rollout in a plane along gravity */
    int32_t whiten; /* the inputs of first layers, for Adam (docs/training.md), as the sequences are
                         at the first iteration: 0 = yes, -1 = no */
    int32_t
        relaxation_gradients; /* through the relaxation: 0 = exact, -1 = as if there were none */
    double velocity_weight; /* of velocities that are not the truth's, docs/training.md; 0 = none */
    uint32_t
        learn; /* constants of the relaxation that are trained, a sum of ascc_learn; 0 = none */
    uint32_t reserved;
} ascc_trainer_options;

/** What an iteration did. */
typedef struct ascc_training_report {
    size_t size;          /* sizeof(ascc_training_report) */
    uint64_t iteration;   /* done in all */
    double loss;          /* mean of Eq. 3 over steps and rollouts, particle spacings */
    double gradient_norm; /* before clipping, by the whitened weights */
    double learning_rate;
    int32_t unroll, warm_up;
    int32_t ended_early; /* rollouts whose steps without gradient blew up and were cut */
    int32_t skipped;     /* rollouts left out: their steps could not be computed */
    double seconds;      /* wall clock */
    double steps;        /* computed forwards */
} ascc_training_report;

/**
 * Makes a trainer for a model file in memory (all tensors F32), which is copied.
 *
 * context   may be destroyed before the trainer; several trainers may share it.
 * threads   one trainer is used by one thread at a time.
 * errors    ARGUMENT, MEMORY, FORMAT; the context's message says what is wrong.
 */
ASCC_API ascc_status ascc_trainer_create(ascc_train_context *context,
                                         const ascc_trainer_options *options, const void *model,
                                         size_t model_size, ascc_trainer **trainer);
ASCC_API void ascc_trainer_destroy(ascc_trainer **trainer);

/** Adds a sequence to learn from. errors: ARGUMENT, MEMORY, MISMATCH (another dimension, an interval
 * longer than the model steps), NOT_FINITE (names the frame). */
ASCC_API ascc_status ascc_trainer_add_sequence(ascc_trainer *trainer,
                                               const ascc_training_sequence *sequence);

/**
 * One iteration: `batch` rollouts, their mean gradient, one step of Adam.
 * errors: ARGUMENT (no sequence long enough), MEMORY, NOT_FINITE (a loss or gradient that is not finite:
 * weights and optimiser stay as they were; or the twentieth iteration in a row of which no rollout could be
 * computed: weights, optimiser and iteration are again what they were before the last change of weights;
 * the message names sequence and frame), RANGE (the twentieth iteration in a row with a gradient of exactly 0:
 * all channels of a layer are off for good).
 */
ASCC_API ascc_status ascc_trainer_iterate(ascc_trainer *trainer, ascc_training_report *report);

/**
 * Loss and gradient of one rollout, not augmented: `warm_up` steps without gradient from `frame` >= 1,
 * then `unroll` with; the stages of the options have one as long. gradient:
 * [ascc_trainer_parameter_count] or NULL (then it is not computed).
 */
ASCC_API ascc_status ascc_trainer_gradient(ascc_trainer *trainer, size_t sequence, size_t frame,
                                           int32_t warm_up, int32_t unroll, double *loss,
                                           float *gradient);

/** Numbers that are trained: the tensors of the file, in the order of its data. */
ASCC_API size_t ascc_trainer_parameter_count(const ascc_trainer *trainer);
ASCC_API ascc_status ascc_trainer_get_parameters(const ascc_trainer *trainer, float *values);
ASCC_API ascc_status ascc_trainer_set_parameters(ascc_trainer *trainer, const float *values);

/** The model file with the present weights, or (averaged != 0) the averaged ones; valid until the next
 * call that changes the trainer. NULL without memory. */
ASCC_API const void *ascc_trainer_model(ascc_trainer *trainer, int32_t averaged, size_t *size);

/**
 * What the first layer of the model makes of the states it learns from: the text of `trust` in a model file's
 * metadata (docs/file-format.md), by which steps tell how far their input is from training's. It holds for these
 * weights alone: a file with others does not read it.
 *
 * averaged   as of ascc_trainer_model: whose statistics these are
 * frames     true states that are drawn from the sequences, turned and mirrored as in training; 1 to 10,000
 * threshold  mean distance at which errors double, if known; 0 = not stated
 *
 * Returns the text, the trainer's, valid until its next call; NULL on error: ARGUMENT (also a model without a layer
 * on the fluid with weights and at most 64 channels), MEMORY, RANGE, told by ascc_trainer_message.
 * cost       that many steps, on one thread.
 */
ASCC_API const char *ascc_trainer_trust(ascc_trainer *trainer, int32_t averaged, int32_t frames,
                                        double threshold);

/** Iterations done. */
ASCC_API uint64_t ascc_trainer_iteration(const ascc_trainer *trainer);

/**
 * Everything that the next iterations depend on besides options and sequences: weights, their average,
 * Adam's moments, the whitening that they are of, the iteration. Going on from a saved state gives the bits
 * of never having stopped.
 * save promises and refuses what ascc_model_save does. load reads and checks everything before it changes
 * anything: numbers that are not finite, moments that cannot be, weights that no model may have, an
 * iteration beyond 2^53 are FORMAT, and the message names the tensor.
 * errors: FILE, FORMAT, MISMATCH (of another network, or of training with whitening but without here, or the
 * other way round), MEMORY; after a failed load the trainer is as it was.
 */
ASCC_API ascc_status ascc_trainer_save(ascc_trainer *trainer, const char *path);
ASCC_API ascc_status ascc_trainer_load(ascc_trainer *trainer, const char *path);

/** One line about the last call with this trainer that failed, valid until the next; the log gets it, too. */
ASCC_API const char *ascc_trainer_message(const ascc_trainer *trainer);

#ifdef __cplusplus
}
#endif
#endif
