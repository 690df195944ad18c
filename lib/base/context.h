/* Ties allocator, log, workers and kernel table together; counted, so that handles may be destroyed
 * in any order. SPDX-License-Identifier: MIT */
#ifndef ASCC_CONTEXT_H
#define ASCC_CONTEXT_H

#include "kernels/kernels.h"
#include "memory.h"
#include "workers.h"

struct ascc_context {
    uint32_t magic; /* ASCC_CONTEXT_MAGIC while alive */
    uint32_t
        version; /* ASCC_CONTEXT_VERSION of the library that made it: others that share handles compare it */
    ascc_allocator allocator;
    void (*log)(void *user, const char *line);
    void *user;
    ascc_workers *workers;
    ascc_kernels kernels;
    uint32_t cpu;
    struct ascc_context_shared *shared; /* reference count, lock and last message */
};

#define ASCC_CONTEXT_VERSION                                                                       \
    ((uint32_t)ASCC_VERSION_MAJOR << 24 | (uint32_t)ASCC_VERSION_MINOR << 12 | ASCC_VERSION_PATCH)
#define ASCC_CONTEXT_MAGIC 0x43435341u   /* "ASCC" */
#define ASCC_MODEL_MAGIC 0x4d435341u     /* "ASCM" */
#define ASCC_PARTICLES_MAGIC 0x50435341u /* "ASCP" */
#define ASCC_STEP_MAGIC 0x53435341u      /* "ASCS" */

void ascc_context_retain(ascc_context *context);
void ascc_context_release(ascc_context *context);

/* Keeps the line as the context's message and logs it; returns the status. */
ascc_status ascc_context_fail(ascc_context *context, ascc_status status,
                              const ascc_message *message);
/* Hands a line to the log callback, if there is one. */
void ascc_context_log(const ascc_context *context, const char *line);

#endif
