/* A better network where detail is wanted, in the step of another model (docs/budget.md). SPDX-License-Identifier: MIT */
#ifndef ASCC_DETAIL_H
#define ASCC_DETAIL_H

#include "step.h"

/* Why two models cannot have one step together; NULL = they can. */
const char *ascc_detail_obstacle(const ascc_plan *base, const ascc_plan *better);

/* The engine of a step whose fluid is partly another step's: state->detail. errors: those of both networks. */
ascc_status ascc_engine_detail(ascc_step_state *state);

#endif
