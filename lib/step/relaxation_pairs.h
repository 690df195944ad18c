/* Who is near whom as a round of the relaxation begins. SPDX-License-Identifier: MIT */
#ifndef ASCC_RELAXATION_PAIRS_H
#define ASCC_RELAXATION_PAIRS_H

#include "stage.h"

/* New neighbour lists of all fluid rows among fluid and walls, in the order of their sets, at the positions
 * that the step has reached; they last as long as the step. errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_relaxation_pairs_find(ascc_step_state *state, const ascc_rows *rows[2]);

#endif
