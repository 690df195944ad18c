/* What trainers are made from: allocator, log, workers. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_CONTEXT_H
#define ASCC_TRAIN_CONTEXT_H

#include <ascc/train.h>

#include "base/context.h"

#define ASCC_TRAIN_CONTEXT_MAGIC 0x58435341u /* "ASCX" */

/* Rollouts run side by side, each on its own: steps are taken with `alone`, which has one thread. What is made
 * from a context retains the two, not this. */
struct ascc_train_context {
    uint32_t magic;
    ascc_context *shared; /* workers, log, message */
    ascc_context *alone;  /* silent */
};

static inline bool ascc_train_context_alive(const ascc_train_context *context)
{
    return context && context->magic == ASCC_TRAIN_CONTEXT_MAGIC;
}

/* Keeps the line as the context's message and logs it; returns the status. */
ascc_status ascc_train_context_fail(ascc_train_context *context, ascc_status status,
                                    const ascc_message *message);

#endif
