/* How much scratch a step of a given size needs, before there is a scene.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_ESTIMATE_H
#define ASCC_ESTIMATE_H

#include "network/network.h"

/* Bytes of scratch for one step of this many particles near rest density. */
size_t ascc_estimate_scratch(const ascc_network *network, size_t fluid, size_t boundary,
                             int32_t threads);

#endif
