/* Whitens the inputs of first layers: the optimiser sees columns without correlation and of equal size.
 * SPDX-License-Identifier: MIT
 *
 * A first layer's matrix W multiplies columns x that depend on the data alone, and those differ in size by
 * factors of hundreds, which Adam cannot repair. With a constant mean m and matrix T from true states,
 * z = (x - m) T is white, and the optimiser moves W' and b' of
 *
 *     y = z W' + b'        that is        W = T W',   b = b' - m W
 *
 * All of it is linear, so the weights are kept as the model has them, and only what the optimiser moves by
 * is carried over: gradients to W' and b', steps back to W and b.
 *
 *     T = diag(1 / (std + 1e-3)) V diag((e + 0.03)^-1/2) V^T diag(1 / std_z)
 *
 * with e, V of the covariance of columns divided by std + 1e-3, and std_z of what would come out. Where no bias
 * is added to the very rows and columns that W adds to, m = 0, and moments about 0 take covariance's place.
 */
#ifndef ASCC_TRAIN_WHITENING_H
#define ASCC_TRAIN_WHITENING_H

#include "parameters.h"
#include "rollout.h"

#define ASCC_WHITENING_FRAMES 40  /* true states that are looked at */
#define ASCC_WHITENING_FLOOR 0.03 /* of eigenvalues */
#define ASCC_WHITENING_NONE SIZE_MAX

typedef struct ascc_whitened_term {
    int32_t term, layer;    /* of the plan */
    size_t length, outputs; /* of its matrix, without padding */
    size_t weight, bias;    /* first parameters of both; bias: or ASCC_WHITENING_NONE */
    size_t number;          /* where m[length] and T[length][length], or its diagonal, begin */
    bool full;              /* false: a long column is only scaled, and T is diagonal */
} ascc_whitened_term;

typedef struct ascc_whitening {
    ascc_whitened_term *term;
    size_t term_count;
    float *number; /* m and T of all terms: what a saved state has to hold */
    size_t number_count;
    double *matrix; /* [matrix_count] scratch */
    size_t matrix_count;
    bool ready; /* numbers are there */
} ascc_whitening;

/* Finds the first layers of a model whose tensors are parameters like this. errors: MEMORY. */
ascc_status ascc_whitening_create(ascc_whitening *whitening, const ascc_allocator *allocator,
                                  const ascc_model *model, const ascc_trained_tensor *tensor,
                                  size_t tensor_count);
void ascc_whitening_destroy(ascc_whitening *whitening, const ascc_allocator *allocator);

/* Finds m and T where these tasks begin; a state that cannot be seen is left out. errors: MEMORY. */
ascc_status ascc_whitening_measure(ascc_whitening *whitening, ascc_rollout_worker *worker,
                                   const ascc_rollout_task *task, size_t task_count);

/* By parameter, in place: the gradient by W and b becomes that by W' and b' ... */
void ascc_whitening_gradient(const ascc_whitening *whitening, float *gradient);
/* ... and a step of W' and b' that of W and b. */
void ascc_whitening_step(const ascc_whitening *whitening, double *step);

/* transform[n][n] from a covariance [n][n], which is overwritten; scale: [2 n] scratch. What does not vary has
 * zeros there: its row and column become the identity's. */
void ascc_whitening_transform(double *covariance, size_t n, double *scale, double *transform);

#endif
