/* The kernels of the reverse pass for AVX2 and FMA. SPDX-License-Identifier: MIT */
#define ASCC_USE_AVX2
#define ASCC_TRAIN_VARIANT ascc_train_kernels_avx2
#include "body.h"
