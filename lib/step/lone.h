/* The fast particles that nobody meets. SPDX-License-Identifier: MIT */
#ifndef ASCC_LONE_H
#define ASCC_LONE_H

#include "base/context.h"
#include "points/particles.h"

/* The greatest speed of the fluid without those few particles above `slow` that are farther than `reach` from all
 * others and from walls; `fastest` where there are more than a few. Host's units. */
double ascc_speed_in_company(ascc_context *context, const ascc_particles *p, double fastest,
                             double slow, double reach);

#endif
