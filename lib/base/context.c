/* Ties allocator, log, workers and kernel table together; counted, so that handles may be destroyed
 * in any order. SPDX-License-Identifier: MIT */
#include "context.h"

#include <stdatomic.h>
#include <string.h>

#include "threads.h"

#define MAX_THREADS 1024
#define KNOWN_CPU_BITS (ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON | ASCC_CPU_SIMD128)

/* The first released layout. */
#define FIRST_OPTIONS_SIZE sizeof(ascc_context_options)
_Static_assert(sizeof(void *) != 8 || FIRST_OPTIONS_SIZE == 72, "layout is part of the ABI");

struct ascc_context_shared {
    atomic_size_t references;
    ascc_lock lock; /* of message */
    ascc_message message;
};

/* One block holds both. */
typedef struct context_block {
    ascc_context context;
    struct ascc_context_shared shared;
} context_block;

static bool is_context(const ascc_context *context)
{
    return context != NULL && context->magic == ASCC_CONTEXT_MAGIC;
}

static ascc_status check_options(const ascc_context_options *options, ascc_message *message)
{
    if (options->thread_count < 0 || options->thread_count > MAX_THREADS)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "context: thread_count is %ld, not in [0, %d]",
                         (long)options->thread_count, MAX_THREADS);
    if ((options->cpu_disable & ~KNOWN_CPU_BITS) != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "context: cpu_disable is 0x%lx, a bit of it does not exist",
                         (unsigned long)options->cpu_disable);
    const int memory =
        (options->allocate != NULL) + (options->reallocate != NULL) + (options->release != NULL);
    if (memory != 0 && memory != 3)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "context: allocate, reallocate and release go together, %d given", memory);
    if ((options->enqueue != NULL) != (options->finish != NULL))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "context: enqueue and finish go together, one given");
    return ASCC_OK;
}

static ascc_status make(const ascc_context_options *options, ascc_context **context,
                        ascc_message *message)
{
    ascc_allocator allocator = ascc_allocator_default();
    if (options->allocate != NULL)
        allocator = (ascc_allocator){options->allocate, options->reallocate, options->release,
                                     options->user};
    context_block *const block = ascc_allocate(&allocator, 1, sizeof *block);
    if (block == NULL)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "context: out of memory");
    memset(block, 0, sizeof *block);
    if (!ascc_lock_open(&block->shared.lock)) {
        ascc_release(&allocator, block, 1, sizeof *block);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "context: no lock");
    }
    atomic_init(&block->shared.references, 1);

    ascc_context *const made = &block->context;
    made->allocator = allocator;
    made->log = options->log;
    made->user = options->user;
    made->cpu = ascc_kernels_available() & ~options->cpu_disable;
    made->shared = &block->shared;
    ascc_kernels_select(&made->kernels, made->cpu);

    const int32_t threads = options->thread_count == 0 ? 1 : options->thread_count;
    const ascc_status status = ascc_workers_create(&allocator, threads, options->enqueue,
                                                   options->finish, options->user, &made->workers);
    if (status != ASCC_OK) {
        ascc_lock_close(&block->shared.lock);
        ascc_release(&allocator, block, 1, sizeof *block);
        return ascc_fail(message, status, "context: %ld threads could not be started",
                         (long)threads);
    }
    made->magic = ASCC_CONTEXT_MAGIC;
    made->version = ASCC_CONTEXT_VERSION;
    *context = made;
    return ASCC_OK;
}

ascc_status ascc_context_create(const ascc_context_options *options, ascc_context **context)
{
    if (context == NULL)
        return ASCC_ERROR_ARGUMENT;
    *context = NULL;
    ascc_context_options read = {0};
    if (options != NULL && !ascc_read_struct(&read, sizeof read, options, FIRST_OPTIONS_SIZE))
        return ASCC_ERROR_ARGUMENT;

    ascc_message message;
    ascc_status status = check_options(&read, &message);
    if (status == ASCC_OK)
        status = make(&read, context, &message);
    if (status != ASCC_OK && read.log != NULL)
        read.log(read.user, message.text);
    return status;
}

void ascc_context_destroy(ascc_context **context)
{
    if (context == NULL || !is_context(*context))
        return;
    ascc_context_release(*context);
    *context = NULL;
}

void ascc_context_retain(ascc_context *context)
{
    atomic_fetch_add_explicit(&context->shared->references, 1, memory_order_relaxed);
}

void ascc_context_release(ascc_context *context)
{
    if (atomic_fetch_sub_explicit(&context->shared->references, 1, memory_order_acq_rel) != 1)
        return;
    ascc_workers_destroy(&context->workers);
    ascc_lock_close(&context->shared->lock);
    context->magic = 0;
    const ascc_allocator allocator = context->allocator;
    ascc_release(&allocator, context, 1, sizeof(context_block));
}

uint32_t ascc_context_cpu(const ascc_context *context)
{
    return is_context(context) ? context->cpu : 0;
}

ascc_status ascc_context_fail(ascc_context *context, ascc_status status,
                              const ascc_message *message)
{
    ascc_lock_take(&context->shared->lock);
    context->shared->message = *message;
    ascc_lock_give(&context->shared->lock);
    ascc_context_log(context, message->text);
    return status;
}

void ascc_context_log(const ascc_context *context, const char *line)
{
    if (context->log != NULL)
        context->log(context->user, line);
}

size_t ascc_context_message(const ascc_context *context, char *text, size_t capacity)
{
    ascc_message message = {""};
    if (is_context(context)) {
        ascc_lock_take(&context->shared->lock);
        message = context->shared->message;
        ascc_lock_give(&context->shared->lock);
    }
    const size_t length = strlen(message.text);
    if (text != NULL && capacity > 0) {
        const size_t copied = ascc_min_size(length, capacity - 1);
        memcpy(text, message.text, copied);
        text[copied] = '\0';
    }
    return length;
}
