/* Walls that nothing passes: motion through a wall ends at a distance from it, momentum goes to the wall.
 * SPDX-License-Identifier: MIT
 *
 * Each wall particle w with normal n stands for a disc. What moves from x0 to x1 meets it where it comes
 * closer to the disc's plane than the contact distance c, no farther from the axis than its radius:
 *
 *         x0 .                    the rest of the way goes on along the wall,
 *             \      n            from p to x1 + (c - (x1 - w).n) n,
 *      c ......p..+..^......      where it may meet the next one
 *               \    |
 *      ----------\---w------
 */
#ifndef ASCC_CONTACT_H
#define ASCC_CONTACT_H

#include "network/antisymmetric.h"
#include "integrate.h"

/* After ascc_integrate_end: changes positions and momenta in `advance`, and gives walls[] of `impulses` what the
 * fluid lost. unit: metres in the host's length. Needs plan->output.walls.contact > 0.
 * errors: RANGE; the message names the particle. */
ascc_status ascc_contact(const ascc_network_run *run, const ascc_particles *particles,
                         double time_step, double unit, ascc_advance *advance,
                         const ascc_impulses *impulses);

#endif
