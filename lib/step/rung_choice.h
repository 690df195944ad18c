/* Which rung of a ladder a step takes: measured times in, a choice with hysteresis out. Knows no clock and no
 * model. SPDX-License-Identifier: MIT */
#ifndef ASCC_RUNG_CHOICE_H
#define ASCC_RUNG_CHOICE_H

#include "base/common.h"

/* Shares of the budget: above the first a rung is left, up to the second one is taken. */
#define ASCC_RUNG_LEAVE 0.92
#define ASCC_RUNG_TAKE 0.80
/* Of the times of one rung, the middle one counts: one step that something else held up decides nothing. */
#define ASCC_RUNG_RECENT 3

typedef struct ascc_rung_choice {
    int32_t count, rung, reason; /* reason: of the last choice, an ascc_ladder_reason */
    int32_t doubted;             /* the lowest rung that is not to be trusted; count = all are */
    int32_t doubter;             /* the one that saw why */
    uint64_t doubts;             /* steps since then */
    uint64_t dwell;              /* steps between two changes, at least */
    uint64_t stood; /* steps since the last change, or since the beginning: then as if long */
    double cost[ASCC_MAX_RUNGS]; /* s a fluid particle, smoothed; 0 = not known */
    double recent[ASCC_RUNG_RECENT];
    uint64_t recent_count; /* of steps measured since the last change */
} ascc_rung_choice;

/* Begins with the top rung, free to change at once. */
void ascc_rung_choice_open(ascc_rung_choice *choice, int32_t count, uint64_t dwell);

/* What the rungs cost, as measured beside the run. */
void ascc_rung_choice_know(ascc_rung_choice *choice, int32_t rung, double cost);

/* Takes in the time of a step on the rung that stands. */
void ascc_rung_choice_learn(ascc_rung_choice *choice, double seconds, size_t particles);

/* This rung saw what it was not trained on: until ascc_rung_choice_trust the rungs from the one
 * above `refuge` on are not taken. */
void ascc_rung_choice_doubt(ascc_rung_choice *choice, int32_t rung, int32_t refuge);
/* All rungs may be taken again. */
void ascc_rung_choice_trust(ascc_rung_choice *choice);

/* The rung of the next step. budget: s, 0 = none. */
int32_t ascc_rung_choice_make(ascc_rung_choice *choice, double budget, size_t particles);

/* The next step takes this one, whatever it costs. */
void ascc_rung_choice_take(ascc_rung_choice *choice, int32_t rung);

#endif
