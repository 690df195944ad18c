/* Floating point environments that a host may have, each as one number, and the CPU's own read so.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_FLOAT_MODES_H
#define ASCC_TEST_FLOAT_MODES_H

#include <stdint.h>

typedef struct float_mode {
    const char *name;
    uint64_t state;
} float_mode;

#if defined(__x86_64__) || defined(__i386__)

/* From the lowest bit: MXCSR, 32 bits; x87's control word, 16; its exceptions, 7. */
#define FLOAT_STATE(mxcsr, control, status)                                                        \
    ((uint64_t)(mxcsr) | (uint64_t)(control) << 32 | (uint64_t)(status) << 48)
#define FLOAT_DEFAULT FLOAT_STATE(0x1f80, 0x037f, 0)

static const float_mode float_modes[] = {
    {"default", FLOAT_DEFAULT},
    {"upwards", FLOAT_STATE(0x5f80, 0x0b7f, 0)},
    {"downwards", FLOAT_STATE(0x3f80, 0x077f, 0)},
    {"towards zero", FLOAT_STATE(0x7f80, 0x0f7f, 0)},
    {"invalid, division by zero and overflow trap", FLOAT_STATE(0x1900, 0x0372, 0)},
    {"all exceptions trap", FLOAT_STATE(0x0000, 0x0340, 0)},
    {"flush to zero, subnormals are zero", FLOAT_STATE(0x9fc0, 0x037f, 0)},
    {"x87 in single precision", FLOAT_STATE(0x1f80, 0x007f, 0)},
    {"exceptions pending", FLOAT_STATE(0x1f95, 0x037f, 0x2a)},
};

static uint64_t float_state(void)
{
    uint32_t mxcsr;
    uint16_t control, status;
    __asm__ volatile("stmxcsr %0\n\tfnstcw %1\n\tfnstsw %2"
                     : "=m"(mxcsr), "=m"(control), "=m"(status)
                     :
                     : "memory");
    return FLOAT_STATE(mxcsr, control, status & 0x7f);
}

static void float_state_set(uint64_t state)
{
    const uint32_t mxcsr = (uint32_t)state;
    uint32_t x87[7];
    __asm__ volatile("fnstenv %0" : "=m"(x87) : : "memory");
    x87[0] = (x87[0] & 0xffff0000u) | (uint16_t)(state >> 32);
    x87[1] = (x87[1] & ~0x7fu) | (uint32_t)(state >> 48);
    __asm__ volatile("fldenv %0\n\tldmxcsr %1" : : "m"(x87), "m"(mxcsr) : "memory");
}

#elif defined(__aarch64__)

/* FPCR, 32 bits; FPSR, 32. */
#define FLOAT_STATE(control, status) ((uint64_t)(control) | (uint64_t)(status) << 32)
#define FLOAT_DEFAULT FLOAT_STATE(0, 0)

static const float_mode float_modes[] = {
    {"default", FLOAT_DEFAULT},
    {"upwards", FLOAT_STATE(1u << 22, 0)},
    {"downwards", FLOAT_STATE(2u << 22, 0)},
    {"towards zero", FLOAT_STATE(3u << 22, 0)},
    {"flush to zero, default NaN", FLOAT_STATE(3u << 24, 0)},
    {"exceptions pending", FLOAT_STATE(0, 0x13)},
};

static uint64_t float_state(void)
{
    uint64_t control, status;
    __asm__ volatile("mrs %0, fpcr\n\tmrs %1, fpsr" : "=r"(control), "=r"(status) : : "memory");
    return FLOAT_STATE(control, status);
}

static void float_state_set(uint64_t state)
{
    __asm__ volatile("msr fpcr, %0\n\tmsr fpsr, %1"
                     :
                     : "r"(state & UINT32_MAX), "r"(state >> 32)
                     : "memory");
}

#else

#include <fenv.h>

/* C's rounding mode, 16 bits, and its pending exceptions. */
#define FLOAT_STATE(rounding, status) ((uint64_t)(rounding) | (uint64_t)(status) << 16)
#define FLOAT_DEFAULT FLOAT_STATE(FE_TONEAREST, 0)

static const float_mode float_modes[] = {
    {"default", FLOAT_DEFAULT},
#if defined(FE_UPWARD)
    {"upwards", FLOAT_STATE(FE_UPWARD, 0)},
    {"downwards", FLOAT_STATE(FE_DOWNWARD, 0)},
    {"towards zero", FLOAT_STATE(FE_TOWARDZERO, 0)},
    {"exceptions pending", FLOAT_STATE(FE_TONEAREST, FE_DIVBYZERO | FE_INEXACT)},
#endif
};

static uint64_t float_state(void)
{
    return FLOAT_STATE(fegetround(), fetestexcept(FE_ALL_EXCEPT));
}

static void float_state_set(uint64_t state)
{
    feclearexcept(FE_ALL_EXCEPT);
    feraiseexcept((int)(state >> 16));
    fesetround((int)(state & 0xffff));
}

#endif

#define FLOAT_MODE_COUNT (sizeof float_modes / sizeof *float_modes)

#endif
