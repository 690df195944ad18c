/* The kernels for AVX2 and FMA: the same text, compiled for that CPU. SPDX-License-Identifier: MIT */
#define ASCC_VARIANT ascc_kernels_avx2
#include "body.h"
