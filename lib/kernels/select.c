/* From the CPU's features to the kernel table. SPDX-License-Identifier: MIT */
#include <ascc/ascc.h>

#include "kernels.h"

uint32_t ascc_kernels_available(void)
{
    uint32_t cpu = 0;
#if defined(ASCC_HAVE_AVX2)
    __builtin_cpu_init();
    if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") &&
        __builtin_cpu_supports("bmi2"))
        cpu |= ASCC_CPU_AVX2;
#endif
#if defined(ASCC_HAVE_AVX512)
    if ((cpu & ASCC_CPU_AVX2) && __builtin_cpu_supports("avx512f") &&
        __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
        __builtin_cpu_supports("avx512vl"))
        cpu |= ASCC_CPU_AVX512;
#endif
#if defined(ASCC_HAVE_NEON)
    cpu |= ASCC_CPU_NEON; /* every aarch64 has it */
#endif
#if defined(ASCC_HAVE_SIMD128)
    cpu |= ASCC_CPU_SIMD128; /* else the engine would not have taken the module */
#endif
    return cpu;
}

void ascc_kernels_select(ascc_kernels *kernels, uint32_t cpu)
{
    (void)cpu;
    ascc_kernels_portable(kernels);
#if defined(ASCC_HAVE_AVX2)
    if (cpu & ASCC_CPU_AVX2)
        ascc_kernels_avx2(kernels);
#endif
#if defined(ASCC_HAVE_AVX512)
    if (cpu & ASCC_CPU_AVX512)
        ascc_kernels_avx512(kernels);
#endif
#if defined(ASCC_HAVE_NEON)
    if (cpu & ASCC_CPU_NEON)
        ascc_kernels_neon(kernels);
#endif
#if defined(ASCC_HAVE_SIMD128)
    if (cpu & ASCC_CPU_SIMD128)
        ascc_kernels_simd128(kernels);
#endif
}
