/* The kernels for NEON: the common text. SPDX-License-Identifier: MIT */
#define ASCC_USE_NEON
#define ASCC_VARIANT ascc_kernels_neon
#include "body.h"
