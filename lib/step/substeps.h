/* How the host's time step becomes steps that the network was trained for. SPDX-License-Identifier: MIT */
#ifndef ASCC_SUBSTEPS_H
#define ASCC_SUBSTEPS_H

#include "step.h"

/* The model's units in those of a set: a scene of other spacings is the same scene at the model's, with time as
 * the root of length, so that gravity is what it was. */
void ascc_find_units(ascc_step *step, const ascc_particles *p);

/* Into how many equal steps the next one is cut. errors: RANGE (more than are allowed, or than make sense). */
ascc_status ascc_count_substeps(ascc_step *step, const ascc_particles *p, const ascc_motion *motion,
                                int32_t *count);

#endif
