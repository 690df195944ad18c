/* One rollout: steps forwards with the run-time's own step, the loss, and the way back.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_ROLLOUT_H
#define ASCC_TRAIN_ROLLOUT_H

#include "network/reverse.h"
#include "step/step.h"
#include "data.h"
#include "relaxation_reverse.h"

/* What a rollout asks for. */
typedef struct ascc_rollout_task {
    const ascc_kept_sequence *sequence;
    size_t frame; /* where it starts, >= 1 */
    int32_t warm_up, unroll;
    ascc_rigid_transform transform;
    double jitter;      /* m and, over a time step, m/s */
    ascc_random random; /* of the jitter */
    double neighbor_weight, density_weight, wall_weight, velocity_weight;
    bool position_gradients, relaxation_gradients;
    bool backward;       /* false: the loss alone */
    size_t memory_limit; /* of kept steps, bytes */
} ascc_rollout_task;

/* What became of it. */
typedef struct ascc_rollout_result {
    ascc_constant_gradients constants; /* of the relaxation */
    double loss;
    int32_t steps;    /* computed forwards, again for the way back not counted */
    bool ended_early; /* steps without gradient blew up: the rest began at the true state */
    bool skipped;     /* a step with gradient could not be computed: no gradient */
    size_t failed_frame;
    ascc_status status; /* MEMORY ends an iteration */
} ascc_rollout_result;

/* What one thread needs for its rollouts. */
typedef struct ascc_rollout_worker {
    ascc_context *context;
    const ascc_model *model;
    ascc_step *step;
    ascc_arena scratch, loss_scratch; /* of reverse passes, of losses */
    ascc_arena *kept;       /* [kept_count] arenas of steps, by number modulo their count */
    ascc_step_state *state; /* [kept_count] */
    size_t kept_count;
    double *memory; /* states and gradients */
    size_t memory_count;
} ascc_rollout_worker;

bool ascc_rollout_worker_open(ascc_rollout_worker *worker, ascc_context *context,
                              const ascc_model *model, int32_t longest_unroll);
void ascc_rollout_worker_close(ascc_rollout_worker *worker);

/* gradient: [weight count of the model], laid out as its weights, is added to; packed: scratch, as large as
 * the model's packed weights. */
ascc_rollout_result ascc_rollout_run(ascc_rollout_worker *worker, const ascc_transposed *transposed,
                                     const ascc_rollout_task *task, float *packed, float *gradient);

/* One step from the true state that the task begins with, whose network moves nothing: what it saw is in
 * worker->state[0] until the worker is used again. errors: as of a step. */
ascc_status ascc_rollout_look(ascc_rollout_worker *worker, const ascc_rollout_task *task);

/* Mean distance of velocities times the time step, way [fluid][dimension], from the way between two true
 * states, in spacings; gradient (NULL = not wanted), by way, times `share`. */
double ascc_velocity_loss_of(const ascc_rollout_task *task, const ascc_plan *plan,
                             const double *way, const double *from, const double *to, double share,
                             double *gradient);

/* Loss of one state against the truth and its gradient (NULL = not wanted), [fluid][dimension], times
 * `share`. errors: MEMORY, RANGE. */
ascc_status ascc_loss_of(const ascc_rollout_task *task, const ascc_plan *plan,
                         const ascc_search_tools *tools, const double *position,
                         const double *truth, const double *wall, const double *normal,
                         size_t frame, double share, double *loss, double *gradient);

#endif
