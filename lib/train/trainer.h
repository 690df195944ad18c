/* The trainer's insides. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_TRAINER_H
#define ASCC_TRAIN_TRAINER_H

#include <ascc/train.h>

#include "model/model.h"
#include "model/operation.h"
#include "learned.h"
#include "rollout.h"
#include "train_context.h"
#include "whitening.h"

#define ASCC_TRAINER_MAGIC 0x54435341u /* "ASCT" */

struct ascc_trainer {
    uint32_t magic;
    int32_t thread_count, batch, stage_count;
    ascc_allocator allocator;
    ascc_context *shared;  /* retained: workers, log */
    ascc_context *context; /* retained, one thread: rollouts run side by side, each on its own */
    ascc_model *model;     /* its weights are the ones being trained */
    unsigned char *bytes, *averaged_bytes; /* the model file, filled in when asked for */
    size_t byte_count, header_count; /* header_count: of the bytes that weights do not change */
    ascc_safetensors file, averaged_file;
    ascc_trained_tensor *tensor;
    size_t tensor_count, parameter_count; /* those of tensors come first */
    ascc_learned learned;
    ascc_trainer_options options; /* defaults filled in */
    ascc_training_stage *stage;
    ascc_kept_sequence *sequence;
    size_t sequence_count, sequence_capacity;

    ascc_transposed transposed;
    ascc_rollout_worker *worker; /* [threads] */
    float *packed;               /* [threads][packed weights] */
    float *gradients;            /* [batch][model weights] */
    float *gradient;             /* [parameters] */
    double *step;                /* [parameters] of Adam */
    ascc_whitening whitening;    /* of no terms where it is not wanted */
    ascc_rollout_task *task;     /* [batch] */
    ascc_rollout_result *result; /* [batch] */

    uint64_t iteration;
    /* [parameters] each, one block: */
    float *weights, *average, *moment1, *moment2;
    float *before; /* the same four before the weights last changed */
    uint64_t before_iteration;
    int32_t failed_iterations;   /* iterations of late without any rollout */
    int32_t zero_gradient_count; /* iterations of late without any gradient */
    bool changed;                /* there is a before */
    char *text;                  /* of statistics, for the caller */
    size_t text_capacity;
    ascc_message message;
};

static inline bool ascc_trainer_alive(const ascc_trainer *t)
{
    return t && t->magic == ASCC_TRAINER_MAGIC;
}

/* Keeps the line of a call that fails as the trainer's message and logs it; returns the status. */
ascc_status ascc_trainer_fail(ascc_trainer *t, ascc_status status, const char *format, ...)
    ASCC_PRINTF(3, 4);

/* A rollout of this stage, drawn. errors: ARGUMENT (no sequence is long enough). */
ascc_status ascc_trainer_draw(ascc_trainer *t, const ascc_training_stage *stage, ascc_random random,
                              ascc_rollout_task *task);

/* The model takes over t->weights. */
void ascc_trainer_apply(ascc_trainer *t);

#endif
