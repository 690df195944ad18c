/* Context: allocator, log, workers and kernels under one count. SPDX-License-Identifier: MIT */
#include "context.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <string.h>

#define MAX_THREADS 1024
#define KNOWN_CPU (ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON)

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_context_options) == 72, "released layout");

struct ascc_context_shared {
    atomic_int references;
    pthread_mutex_t lock; /* of message */
    ascc_message message;
};

static bool options_valid(const ascc_context_options *o)
{
    const int memory = !!o->allocate + !!o->reallocate + !!o->release;
    return o->thread_count >= 0 && o->thread_count <= MAX_THREADS && (memory == 0 || memory == 3) &&
           !o->enqueue == !o->finish && !(o->cpu_disable & ~KNOWN_CPU);
}

ascc_status ascc_context_create(const ascc_context_options *options, ascc_context **context)
{
    if (!context)
        return ASCC_ERROR_ARGUMENT;
    *context = NULL;
    ascc_context_options o = {0};
    if ((options && !ascc_read_struct(&o, sizeof o, options, sizeof o)) || !options_valid(&o)) {
        if (o.log)
            o.log(o.user, "ascc_context_options: thread_count, cpu_disable or an incomplete set "
                          "of callbacks is not accepted");
        return ASCC_ERROR_ARGUMENT;
    }
    ascc_allocator allocator = ascc_allocator_default();
    if (o.allocate)
        allocator = (ascc_allocator){o.allocate, o.reallocate, o.release, o.user};
    ascc_context *c = ascc_allocate(&allocator, 1, sizeof *c);
    struct ascc_context_shared *shared = ascc_allocate(&allocator, 1, sizeof *shared);
    ascc_workers *workers = NULL;
    if (!c || !shared ||
        ascc_workers_create(&allocator, o.thread_count ? o.thread_count : 1, o.enqueue, o.finish,
                            o.user, &workers) != ASCC_OK) {
        ascc_release(&allocator, shared, 1, sizeof *shared);
        ascc_release(&allocator, c, 1, sizeof *c);
        if (o.log)
            o.log(o.user, "no memory, or no threads, for a context");
        return ASCC_ERROR_MEMORY;
    }
    memset(c, 0, sizeof *c);
    memset(shared, 0, sizeof *shared);
    atomic_init(&shared->references, 1);
    pthread_mutex_init(&shared->lock, NULL);
    c->magic = ASCC_CONTEXT_MAGIC;
    c->allocator = allocator;
    c->log = o.log;
    c->user = o.user;
    c->workers = workers;
    c->cpu = ascc_kernels_available() & ~o.cpu_disable;
    ascc_kernels_select(&c->kernels, c->cpu);
    c->shared = shared;
    *context = c;
    return ASCC_OK;
}

void ascc_context_retain(ascc_context *context)
{
    atomic_fetch_add_explicit(&context->shared->references, 1, memory_order_relaxed);
}

void ascc_context_release(ascc_context *context)
{
    if (atomic_fetch_sub_explicit(&context->shared->references, 1, memory_order_acq_rel) != 1)
        return;
    const ascc_allocator allocator = context->allocator;
    ascc_workers_destroy(&context->workers);
    pthread_mutex_destroy(&context->shared->lock);
    ascc_release(&allocator, context->shared, 1, sizeof *context->shared);
    context->magic = 0;
    ascc_release(&allocator, context, 1, sizeof *context);
}

void ascc_context_destroy(ascc_context **context)
{
    if (!context || !*context)
        return;
    ascc_context *c = *context;
    *context = NULL;
    if (c->magic == ASCC_CONTEXT_MAGIC)
        ascc_context_release(c);
}

uint32_t ascc_context_cpu(const ascc_context *context)
{
    return context && context->magic == ASCC_CONTEXT_MAGIC ? context->cpu : 0;
}

void ascc_context_log(const ascc_context *context, const char *line)
{
    if (context->log)
        context->log(context->user, line);
}

ascc_status ascc_context_fail(ascc_context *context, ascc_status status,
                              const ascc_message *message)
{
    pthread_mutex_lock(&context->shared->lock);
    context->shared->message = *message;
    pthread_mutex_unlock(&context->shared->lock);
    ascc_context_log(context, message->text);
    return status;
}

size_t ascc_context_message(const ascc_context *context, char *text, size_t capacity)
{
    if (text && capacity)
        text[0] = '\0';
    if (!context || context->magic != ASCC_CONTEXT_MAGIC)
        return 0;
    pthread_mutex_lock(&context->shared->lock);
    const ascc_message message = context->shared->message;
    pthread_mutex_unlock(&context->shared->lock);
    const size_t length = strlen(message.text);
    if (text && capacity) {
        const size_t copied = ascc_min_size(length, capacity - 1);
        memcpy(text, message.text, copied);
        text[copied] = '\0';
    }
    return length;
}
