/* A whole step and the loss of training from their definitions alone: docs/file-format.md and
 * docs/training.md in doubles over all pairs, without a grid, a kernel or a demand of the library's.
 * SPDX-License-Identifier: MIT
 *
 * Weights come as doubles beside the model's own block, so that they can be moved by less than a float.
 * Running out of memory aborts: these are tests.
 */
#ifndef ASCC_ORACLE_H
#define ASCC_ORACLE_H

#include "model/model.h"

/* What stays as it was in an earlier, recorded rollout: gradients do not flow through it. */
typedef enum oracle_mode {
    ORACLE_LIVE,
    ORACLE_RECORD,    /* live, and remembered */
    ORACLE_LATTICES,  /* points of levels and the walls in sight are the recorded ones */
    ORACLE_POSITIONS, /* so are all positions that geometry is made of */
} oracle_mode;

#define ORACLE_MAX_STEPS 16

typedef struct oracle_record oracle_record; /* of one step */

typedef struct oracle {
    const ascc_model *model;
    const double *weight; /* [model->weight_count], beside model->weights */
    const double *still;  /* the weights of steps that no gradient flows through; NULL = the same */
    int half_axis;        /* of the output's kernel stored as a half: 0, 1, 2; -1 = stored whole */
    size_t half;          /* where that half begins in the block */
    double gravity[3];
    size_t fluid_count, wall_count;
    const double *wall, *normal; /* [wall_count][dimension] */
    double *
        past; /* [fluid_count][history][dimension] velocities before earlier steps, the last first; steps add to it */
    /* Adds the term of an operation that the oracle does not know, from the source's row; or NULL. */
    void (*add_other)(const ascc_term *term, const double *in, double *out);
    oracle_mode mode;
    int step; /* of the rollout: which record */
    oracle_record *record[ORACLE_MAX_STEPS];
} oracle;

/* For a model with its weights as doubles, the caller's; the rest is set in the struct. */
oracle oracle_open(const ascc_model *model, const double *weight);
void oracle_close(oracle *o);

/* One step of positions and velocities [fluid_count][dimension] in place. correction receives what the
 * network moved each particle by, or is NULL. */
void oracle_step(oracle *o, double *position, double *velocity, double *correction);

/* Tensors of the model's file in the order of its data, and where they lie in the block of weights. */
typedef struct oracle_tensor {
    char name[64];
    size_t offset, count;
} oracle_tensor;
#define ORACLE_MAX_TENSORS 64
size_t oracle_tensors(const ascc_model *model, oracle_tensor list[ORACLE_MAX_TENSORS]);
/* For a last kernel "output.kernel" stored as a half along "x", "y" or "z"; NULL = whole. */
void oracle_set_half(oracle *o, const char *half_axis);
/* The block of weights as doubles; the caller's to free. */
double *oracle_weights(const ascc_model *model);

typedef struct oracle_sequence {
    size_t frame_count;
    const float *position; /* [frame][fluid][dimension]; walls are the oracle's */
} oracle_sequence;

typedef struct oracle_loss_options {
    double neighbor_weight, density_weight, wall_weight, velocity_weight;
} oracle_loss_options;

/* What the loss compares with, over all particles and frames. */
typedef struct oracle_references {
    double density;   /* rho_95 */
    double clearance; /* s_05, m; no wall anywhere near: -infinity */
} oracle_references;
oracle_references oracle_measure(const oracle *o, const oracle_sequence *sequence);

/* The loss of docs/training.md: `warm_up` steps from a frame, then `unroll` that count. */
double oracle_loss(oracle *o, const oracle_sequence *sequence, const oracle_references *references,
                   const oracle_loss_options *options, size_t frame, int warm_up, int unroll);

#endif
