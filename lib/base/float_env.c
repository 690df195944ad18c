/* The CPU's floating point environment: set for a call or a task, and the host's put back after it.
 * SPDX-License-Identifier: MIT */
#include "float_env.h"

#if defined(__x86_64__) || defined(__i386__)

#define MXCSR_STATUS 0x3fu
#define MXCSR_CONTROL 0x1f80u /* all exceptions masked, to nearest, neither flush nor DAZ */
#define X87_STATUS 0x7fu      /* six exceptions and the stack fault */
#define X87_CONTROL 0x033fu   /* all exceptions masked, 64 bits of precision, to nearest */
#define X87_CONTROL_MASK 0x0f3fu

static ascc_float_env read_env(void)
{
    ascc_float_env env;
    __asm__ volatile("stmxcsr %0\n\tfnstcw %1\n\tfnstsw %2"
                     : "=m"(env.mxcsr), "=m"(env.x87_control), "=m"(env.x87_status)
                     :
                     : "memory");
    return env;
}

static void load_mxcsr(uint32_t mxcsr)
{
    __asm__ volatile("ldmxcsr %0" : : "m"(mxcsr) : "memory");
}

/* Status can be loaded only with the whole of x87's environment. That masks all exceptions while it
 * is out, so nothing traps in between. */
static void load_x87(uint16_t control, uint16_t status)
{
    struct {
        uint32_t control, status, rest[5];
    } env;
    __asm__ volatile("fnstenv %0" : "=m"(env) : : "memory");
    env.control = (env.control & 0xffff0000u) | control;
    env.status = (env.status & ~X87_STATUS) | (status & X87_STATUS);
    __asm__ volatile("fldenv %0" : : "m"(env) : "memory");
}

ascc_float_env ascc_float_enter(void)
{
    const ascc_float_env host = read_env();
    if ((host.mxcsr & ~MXCSR_STATUS) != MXCSR_CONTROL)
        load_mxcsr(MXCSR_CONTROL);
    if ((host.x87_control & X87_CONTROL_MASK) != X87_CONTROL)
        load_x87((uint16_t)((host.x87_control & ~X87_CONTROL_MASK) | X87_CONTROL), host.x87_status);
    return host;
}

void ascc_float_leave(const ascc_float_env *host)
{
    const ascc_float_env ours = read_env();
    if (ours.mxcsr != host->mxcsr)
        load_mxcsr(host->mxcsr);
    if (ours.x87_control != host->x87_control ||
        ((ours.x87_status ^ host->x87_status) & X87_STATUS) != 0)
        load_x87(host->x87_control, host->x87_status);
}

#elif defined(__aarch64__)

/* FPCR 0: to nearest, no traps, subnormals kept. FPSR holds the pending exceptions. */
static void load_control(uint64_t control)
{
    __asm__ volatile("msr fpcr, %0" : : "r"(control) : "memory");
}

static ascc_float_env read_env(void)
{
    ascc_float_env env;
    __asm__ volatile("mrs %0, fpcr\n\tmrs %1, fpsr"
                     : "=r"(env.control), "=r"(env.status)
                     :
                     : "memory");
    return env;
}

ascc_float_env ascc_float_enter(void)
{
    const ascc_float_env host = read_env();
    if (host.control != 0)
        load_control(0);
    return host;
}

void ascc_float_leave(const ascc_float_env *host)
{
    const ascc_float_env ours = read_env();
    if (ours.status != host->status)
        __asm__ volatile("msr fpsr, %0" : : "r"(host->status) : "memory");
    if (ours.control != host->control)
        load_control(host->control);
}

#else

ascc_float_env ascc_float_enter(void)
{
    ascc_float_env host;
    (void)fegetenv(&host.whole);
    (void)fesetenv(FE_DFL_ENV);
    return host;
}

void ascc_float_leave(const ascc_float_env *host)
{
    (void)fesetenv(&host->whole);
}

#endif
