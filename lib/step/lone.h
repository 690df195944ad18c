/* The fast particles that nobody meets. SPDX-License-Identifier: MIT */
#ifndef ASCC_LONE_H
#define ASCC_LONE_H

#include "base/context.h"
#include "points/halo.h"

/* *speed, `fastest` of all fluid, becomes the greatest without those few particles above `slow` that are farther than
 * `reach` from all others and from walls; it stays where there are more than a few. halo: of a part of the fluid,
 * without ghosts; or NULL. Host's units. errors: those of other processes. */
ascc_status ascc_speed_in_company(ascc_context *context, const ascc_particles *p, ascc_halo *halo,
                                  double slow, double reach, double *speed);

#endif
