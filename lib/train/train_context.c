/* What trainers are made from: allocator, log, workers. SPDX-License-Identifier: MIT */
#include "train_context.h"

/* One thread without a log, on the same memory. */
static ascc_status make_alone(const ascc_context_options *given, ascc_context **context)
{
    ascc_context_options options = {.size = sizeof options};
    if (given && !ascc_read_struct(&options, sizeof options, given, sizeof options))
        return ASCC_ERROR_ARGUMENT;
    options.size = sizeof options;
    options.thread_count = 1;
    options.log = NULL;
    options.enqueue = NULL;
    options.finish = NULL;
    return ascc_context_create(&options, context);
}

ascc_status ascc_train_context_create(const ascc_context_options *options,
                                      ascc_train_context **context)
{
    if (!context)
        return ASCC_ERROR_ARGUMENT;
    *context = NULL;
    ascc_context *shared = NULL, *alone = NULL;
    ascc_status status = ascc_context_create(options, &shared);
    if (status != ASCC_OK)
        return status;
    ascc_train_context *made = ascc_allocate(&shared->allocator, 1, sizeof *made);
    status = made ? make_alone(options, &alone) : ASCC_ERROR_MEMORY;
    if (status == ASCC_OK) {
        *made = (ascc_train_context){ASCC_TRAIN_CONTEXT_MAGIC, shared, alone};
        *context = made;
        return ASCC_OK;
    }
    ascc_context_log(shared, "context: out of memory");
    if (made)
        ascc_release(&shared->allocator, made, 1, sizeof *made);
    ascc_context_destroy(&shared);
    return status;
}

void ascc_train_context_destroy(ascc_train_context **context)
{
    if (!context || !ascc_train_context_alive(*context))
        return;
    ascc_train_context *old = *context;
    *context = NULL;
    ascc_context *shared = old->shared;
    ascc_context_release(old->alone);
    old->magic = 0;
    ascc_release(&shared->allocator, old, 1, sizeof *old);
    ascc_context_release(shared);
}

size_t ascc_train_context_message(const ascc_train_context *context, char *text, size_t capacity)
{
    return ascc_context_message(ascc_train_context_alive(context) ? context->shared : NULL, text,
                                capacity);
}

ascc_status ascc_train_context_fail(ascc_train_context *context, ascc_status status,
                                    const ascc_message *message)
{
    return ascc_context_fail(context->shared, status, message);
}
