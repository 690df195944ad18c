/* The CPU's floating point environment: set for a call or a task, and the host's put back after it.
 * SPDX-License-Identifier: MIT
 *
 * Results need one environment: rounding to nearest, no exception that traps, nothing flushed to
 * zero, and full precision in x87. A host may have another, and each of its threads its own. So every
 * public function that computes or reads floating point begins with ASCC_FLOAT_SCOPE, and so does
 * every task, on whatever thread it runs. When the scope ends the host has everything back: modes and
 * pending exceptions as they were, and none of ours. Callbacks run in our environment.
 *
 * The compiler does not know that arithmetic depends on the environment. It may not carry memory
 * accesses across the two calls, though, and public functions take and give numbers through memory
 * (one argument apart, which meets numbers from memory at once): so operands are read after the one
 * call, and results written before the other.
 */
#ifndef ASCC_FLOAT_ENV_H
#define ASCC_FLOAT_ENV_H

#include <stdint.h>

#if defined(__x86_64__) || defined(__i386__)
typedef struct ascc_float_env {
    uint32_t mxcsr; /* control and status of SSE and AVX */
    uint16_t x87_control, x87_status;
} ascc_float_env;
#elif defined(__aarch64__)
typedef struct ascc_float_env {
    uint64_t control, status;
} ascc_float_env;
#else
#include <fenv.h>

typedef struct ascc_float_env {
    fenv_t whole;
} ascc_float_env;
#endif

/* Returns the environment that was there. A few nanoseconds where it is right already. */
ascc_float_env ascc_float_enter(void);
void ascc_float_leave(const ascc_float_env *host);

/* From here to the end of the block, whichever way that is left. */
#define ASCC_FLOAT_SCOPE                                                                           \
    __attribute__((unused, cleanup(ascc_float_leave))) const ascc_float_env host_float_env =       \
        ascc_float_enter()

#endif
