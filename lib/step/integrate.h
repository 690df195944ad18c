/* Forces and advection before the network, new momenta and positions after it (METHOD section 1).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_INTEGRATE_H
#define ASCC_INTEGRATE_H

#include "model/model.h"
#include "points/particles.h"

/* What one step does from outside, in the host's units. */
typedef struct ascc_motion {
    double time_step;
    double gravity[3];
    const double *acceleration; /* [fluid][dimension] or NULL */
    ascc_advection advection;
    double max_displacement; /* 0 = none */
} ascc_motion;

/* One step's state while it is not yet the particles' own. All [fluid count][dimension]. */
typedef struct ascc_advance {
    double *position; /* first where the network sees the fluid, then where it ends */
    double *velocity; /* after external forces: what the network sees */
    int64_t *momentum;
    int64_t *external; /* impulse of gravity and acceleration, quanta */
} ascc_advance;

/* v* = v + dt g, and where the network sees the particles. errors: RANGE, by fluid row. */
ascc_status ascc_integrate_begin(ascc_workers *workers, const ascc_particles *particles,
                                 const ascc_motion *motion, ascc_advance *advance,
                                 ascc_message *message);

/* New momentum = old + external + impulse, new position from its velocity.
 * errors: RANGE, NOT_FINITE; the message names the particle. */
ascc_status ascc_integrate_end(ascc_workers *workers, const ascc_particles *particles,
                               const ascc_motion *motion, const int64_t *impulse,
                               ascc_advance *advance, ascc_message *message);

#endif
