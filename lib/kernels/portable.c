/* The kernels in plain C for any CPU: the definition of right. SPDX-License-Identifier: MIT */
#define ASCC_VARIANT ascc_kernels_portable
#include "body.h"
