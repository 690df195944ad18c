/* What meets a wall on its way, and what becomes of the way. SPDX-License-Identifier: MIT
 *
 * Each wall particle w with normal n stands for a disc. What moves from x0 to x1 while the wall goes its own way
 * meets it where it comes closer to the disc's plane than the contact distance c, no farther from the axis than
 * its radius:
 *
 *         x0 .                    the rest of the way goes on along the wall,
 *             \      n            from p to x1 + (c - (x1 - w).n) n,
 *      c ......p..+..^......      where it may meet the next one
 *               \    |
 *      ----------\---w------
 */
#ifndef ASCC_CONTACT_H
#define ASCC_CONTACT_H

#include "stage.h"

/* Walls that one particle may meet in a step, one after the other: three make a corner. */
#define ASCC_MEETINGS 4

typedef struct ascc_contact {
    ascc_step_state *state;
    const ascc_rows *rows; /* walls around the fluid */
    double distance, disc, slack, nothing;
    double seen_unit; /* of the places where the network sees fluid */
    double reach; /* of the lists, from where the network sees a particle; 0: they may lack walls */
    double near;  /* a wall that is met is no farther from the place where it ends */
    atomic_size_t bad; /* 1 + first set row that fails */
} ascc_contact;

/* What is left of a particle's way; `when` of the step has passed at `from`. */
typedef struct ascc_way {
    double from[3], to[3], when;
    int32_t meetings;
} ascc_way;

/* Of a way and a wall. */
typedef struct ascc_meeting {
    double share; /* of the way, > 1 = none */
    double push;  /* along `normal`, at the end of the way */
    double normal[3];
    uint32_t wall; /* in the step's own order, which the host's rows do not decide */
} ascc_meeting;

static inline ascc_meeting ascc_no_meeting(void)
{
    return (ascc_meeting){.share = 2.0};
}

/* Makes *first the meeting with this wall, if it comes before; of walls met at once the one that pushes most
 * comes first, then the one of the lower row. */
void ascc_contact_try(const ascc_contact *contact, const ascc_way *way, uint32_t wall,
                      ascc_meeting *first);
/* Bends a fluid particle's way, of the host's row, at a meeting, which gives the wall what it takes from the particle; false where that
 * cannot be held. */
bool ascc_contact_bend(const ascc_contact *contact, size_t row, const ascc_meeting *meeting,
                       ascc_way *way);

/* Follows ways that lists do not cover, of these rows of the fluid's set, to their ends. errors: MEMORY, RANGE,
 * LIMIT; or notes a bad row. */
ascc_status ascc_contact_far(ascc_contact *contact, ascc_way *way, const size_t *row, size_t count);

#endif
