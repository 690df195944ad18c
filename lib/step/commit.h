/* The last stage, the only one that changes the particles. SPDX-License-Identifier: MIT */
#ifndef ASCC_COMMIT_H
#define ASCC_COMMIT_H

#include "stage.h"

/* first: of a run, whose sums of impulses begin with this step. errors: RANGE (a sum that cannot be held),
 * and then nothing has changed. */
ascc_status ascc_stage_commit(ascc_step_state *state, ascc_particles *particles, bool first);

/* Sums of rows [count][dimension]; they wrap. */
void ascc_totals(ascc_workers *workers, int64_t total[3], const int64_t *rows, size_t count,
                 size_t dimension);

#endif
