/* The kernels of the reverse pass in plain C. SPDX-License-Identifier: MIT */
#include <ascc/ascc.h>

#define ASCC_TRAIN_VARIANT ascc_train_kernels_portable
#include "body.h"

void ascc_train_kernels_select(ascc_train_kernels *kernels, uint32_t cpu)
{
    (void)cpu;
    ascc_train_kernels_portable(kernels);
#if defined(ASCC_HAVE_AVX2)
    if (cpu & ASCC_CPU_AVX2)
        ascc_train_kernels_avx2(kernels);
#endif
}
