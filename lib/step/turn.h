/* The axes a step computes in: turned so that gravity points as it did when the model was trained.
 * SPDX-License-Identifier: MIT
 *
 * A network knows one way down. Where the host's is nearer to another axis, the step runs in turned axes, component c
 * of which is the host's component c + shift, the one along gravity with the other sign where it is to be flipped:
 * no number is rounded, so that a scene and the same scene turned are one to the bit.
 */
#ifndef ASCC_TURN_H
#define ASCC_TURN_H

#include "model/plan.h"
#include "points/particles.h"

typedef struct ascc_turn {
    int32_t shift; /* all zeros: the host's own axes */
    int32_t axis;  /* along gravity, of the turned axes */
    bool flip;
} ascc_turn;

static inline bool ascc_turns(const ascc_turn *turn)
{
    return turn->shift != 0 || turn->flip;
}

/* None where the model's gravity is not along an axis, or the host's is 0. */
ascc_turn ascc_turn_find(const ascc_plan *plan, const double gravity[3]);

/* rows[count][dimension] to turned axes, or back, in place. */
void ascc_turn_reals(const ascc_turn *turn, bool back, double *rows, size_t count,
                     int32_t dimension);
void ascc_turn_integers(const ascc_turn *turn, bool back, int64_t *rows, size_t count,
                        int32_t dimension);
/* All vectors of a set. */
void ascc_turn_particles(const ascc_turn *turn, bool back, ascc_particles *particles);

#endif
