/* Measured times to a rung. SPDX-License-Identifier: MIT
 *
 * Estimates follow what rises at once and what falls slowly: they lie near the upper edge of the times, so that
 * few steps exceed a budget that they fit. Rungs that do not run are taken to become dearer as the one that does.
 */
#include "rung_choice.h"

#define RISE 0.5
#define FALL 0.0625
/* Steps after a change that only tell what the new rung costs. */
#define SETTLING 6

void ascc_rung_choice_open(ascc_rung_choice *choice, int32_t count, uint64_t dwell)
{
    *choice = (ascc_rung_choice){
        .count = count, .rung = count - 1, .doubted = count, .dwell = dwell, .stood = dwell};
}

void ascc_rung_choice_know(ascc_rung_choice *choice, int32_t rung, double cost)
{
    choice->cost[rung] = cost;
}

/* The middle one of the last three times; of two the shorter. */
static double typical(const ascc_rung_choice *choice)
{
    const double *t = choice->recent;
    if (choice->recent_count == 1)
        return t[0];
    const double low = t[0] < t[1] ? t[0] : t[1], high = t[0] < t[1] ? t[1] : t[0];
    if (choice->recent_count == 2)
        return low;
    return t[2] < low ? low : t[2] > high ? high : t[2];
}

void ascc_rung_choice_learn(ascc_rung_choice *choice, double seconds, size_t particles)
{
    if (particles == 0 || !(seconds > 0.0))
        return;
    /* The first step after a change may have had to make scratch. */
    const bool fresh = choice->stood <= 1 && choice->cost[choice->rung] > 0.0;
    if (fresh)
        return;
    choice->recent[choice->recent_count % ASCC_RUNG_RECENT] = seconds / (double)particles;
    choice->recent_count++;
    const double seen = typical(choice), known = choice->cost[choice->rung];
    if (!(known > 0.0)) {
        choice->cost[choice->rung] = seen;
        return;
    }
    const double next = known + (seen > known ? RISE : FALL) * (seen - known);
    const double change = choice->recent_count > SETTLING ? next / known : 1.0;
    for (int32_t r = 0; r < choice->count; r++)
        choice->cost[r] *= change;
    choice->cost[choice->rung] = next;
}

/* The highest of rungs [begin, end) whose step is expected to take at most this long, or -1. */
static int32_t highest(const ascc_rung_choice *choice, int32_t begin, int32_t end, double seconds,
                       size_t particles)
{
    for (int32_t r = end - 1; r >= begin; r--)
        if (choice->cost[r] * (double)particles <= seconds)
            return r;
    return -1;
}

static int32_t cheapest(const ascc_rung_choice *choice)
{
    int32_t best = 0;
    for (int32_t r = 1; r < choice->doubted; r++)
        best = choice->cost[r] < choice->cost[best] ? r : best;
    return best;
}

void ascc_rung_choice_take(ascc_rung_choice *choice, int32_t rung)
{
    if (rung != choice->rung) {
        choice->rung = rung;
        choice->stood = 0;
        choice->recent_count = 0;
    }
    choice->stood++;
    choice->doubts += choice->doubted < choice->count;
}

void ascc_rung_choice_doubt(ascc_rung_choice *choice, int32_t rung, int32_t refuge)
{
    choice->doubter = rung;
    choice->doubted = refuge + 1;
    choice->doubts = 0;
}

void ascc_rung_choice_trust(ascc_rung_choice *choice)
{
    choice->doubted = choice->count;
}

int32_t ascc_rung_choice_make(ascc_rung_choice *choice, double budget, size_t particles)
{
    const int32_t rung = choice->rung, top = choice->doubted - 1;
    const double now = choice->cost[rung] * (double)particles;
    int32_t wanted = rung;
    choice->reason = ASCC_LADDER_FITS;
    if (rung > top) { /* at once: waiting would be worse than a change too many */
        choice->reason = ASCC_LADDER_STRANGE;
        ascc_rung_choice_take(choice, top);
        return top;
    }
    if (!(budget > 0.0)) {
        wanted = top;
    } else if (now > ASCC_RUNG_LEAVE * budget) {
        wanted = highest(choice, 0, rung, ASCC_RUNG_TAKE * budget, particles);
        wanted = wanted < 0 ? cheapest(choice) : wanted;
    } else {
        const int32_t above =
            highest(choice, rung + 1, top + 1, ASCC_RUNG_TAKE * budget, particles);
        wanted = above < 0 ? rung : above;
    }
    if (wanted != rung && choice->stood < choice->dwell) {
        choice->reason = ASCC_LADDER_WAITS;
        wanted = rung;
    } else if (wanted != rung) {
        choice->reason = wanted < rung ? ASCC_LADDER_FELL : ASCC_LADDER_CLIMBED;
    } else if (budget > 0.0 && now > budget) {
        choice->reason = ASCC_LADDER_TOO_SLOW;
    } else if (choice->doubted < choice->count) {
        choice->reason = ASCC_LADDER_STRANGE;
    }
    ascc_rung_choice_take(choice, wanted);
    return wanted;
}
