/* The ladder handle: several models of one fluid, and the choice between them.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_LADDER_H
#define ASCC_LADDER_H

#include "rung_choice.h"
#include "step.h"

/* From this step on, a rung. */
typedef struct ascc_rung_change {
    uint64_t step;
    int32_t rung, reserved;
} ascc_rung_change;

struct ascc_ladder {
    uint32_t magic;
    ascc_context *context; /* retained */
    int32_t count;
    ascc_step *rung[ASCC_MAX_RUNGS];
    double (*clock)(void *user); /* NULL = ascc_clock */
    void *user;
    double budget, max_distance; /* the latter: 0 = none */
    ascc_rung_choice choice;
    int32_t ran;              /* whose step was the last: of the best where all is detail */
    ascc_rung_change *change; /* [change_count], the first at step 0 */
    size_t change_count, change_capacity;
    unsigned char *kept; /* a set's snapshot while rungs are measured on it */
    size_t kept_capacity;
    ascc_ladder_statistics statistics;
    ascc_message message;
};

#define ASCC_LADDER_MAGIC 0x4c435341u /* "ASCL" */

/* Logs and keeps the line; returns the status. */
ascc_status ascc_ladder_fail(ascc_ladder *ladder, ascc_status status, const char *format, ...)
    ASCC_PRINTF(3, 4);

#endif
