/* A pool of threads, or the host's job system, working off blocks. SPDX-License-Identifier: MIT */
#include "workers.h"

#include <pthread.h>
#include <stdatomic.h>
#include <string.h>

/* Looks at a flag this often before going to sleep: some microseconds. */
#define SPIN 2000

typedef struct job {
    size_t count, block;
    ascc_range_function function;
    void *data;
    atomic_size_t next; /* first index not yet taken */
} job;

struct ascc_workers {
    ascc_allocator allocator;
    int32_t count;
    void *(*enqueue)(void *, ascc_task, void *, int32_t);
    void (*finish)(void *, void *);
    void *user;

    pthread_mutex_t owner; /* held by the caller whose job the pool works on */
    pthread_mutex_t lock;  /* of the sleepers */
    pthread_cond_t wake, done;
    atomic_uint turn;   /* odd steps of two; bit 0: stop */
    atomic_int working; /* pool threads that have not finished this turn */
    job *current;
    int32_t started;
    pthread_t *thread;
    struct ascc_worker {
        ascc_workers *workers;
        int32_t slot;
    } * worker;
};

static inline void relax(void)
{
#if defined(__x86_64__) || defined(__i386__)
    __builtin_ia32_pause();
#endif
}

static void work(job *j, int32_t slot)
{
    for (;;) {
        const size_t begin = atomic_fetch_add_explicit(&j->next, j->block, memory_order_relaxed);
        if (begin >= j->count)
            return;
        const size_t left = j->count - begin;
        j->function(j->data, begin, begin + (left < j->block ? left : j->block), slot);
    }
}

/* Waits until the turn is another one and returns it. */
static unsigned next_turn(ascc_workers *w, unsigned seen)
{
    for (int i = 0; i < SPIN; i++) {
        const unsigned turn = atomic_load_explicit(&w->turn, memory_order_acquire);
        if (turn != seen)
            return turn;
        relax();
    }
    pthread_mutex_lock(&w->lock);
    while (atomic_load_explicit(&w->turn, memory_order_acquire) == seen)
        pthread_cond_wait(&w->wake, &w->lock);
    pthread_mutex_unlock(&w->lock);
    return atomic_load_explicit(&w->turn, memory_order_acquire);
}

static void *thread_main(void *argument)
{
    struct ascc_worker *self = argument;
    ascc_workers *w = self->workers;
    unsigned turn = 0;
    for (;;) {
        turn = next_turn(w, turn);
        if (turn & 1u)
            return NULL;
        work(w->current, self->slot);
        if (atomic_fetch_sub_explicit(&w->working, 1, memory_order_acq_rel) == 1) {
            pthread_mutex_lock(&w->lock);
            pthread_cond_signal(&w->done);
            pthread_mutex_unlock(&w->lock);
        }
    }
}

static void announce(ascc_workers *w, unsigned step)
{
    pthread_mutex_lock(&w->lock);
    atomic_fetch_add_explicit(&w->turn, step, memory_order_acq_rel);
    pthread_cond_broadcast(&w->wake);
    pthread_mutex_unlock(&w->lock);
}

static bool start_threads(ascc_workers *w)
{
    const size_t extra = (size_t)w->count - 1;
    w->thread = ascc_allocate(&w->allocator, extra, sizeof *w->thread);
    w->worker = ascc_allocate(&w->allocator, extra, sizeof *w->worker);
    if (!w->thread || !w->worker)
        return false;
    for (; w->started < w->count - 1; w->started++) {
        w->worker[w->started].workers = w;
        w->worker[w->started].slot = w->started + 1;
        if (pthread_create(&w->thread[w->started], NULL, thread_main, &w->worker[w->started]))
            return false;
    }
    return true;
}

ascc_status ascc_workers_create(const ascc_allocator *allocator, int32_t thread_count,
                                void *(*enqueue)(void *, ascc_task, void *, int32_t),
                                void (*finish)(void *, void *), void *user, ascc_workers **workers)
{
    assert(thread_count >= 1);
    ascc_workers *w = ascc_allocate(allocator, 1, sizeof *w);
    *workers = NULL;
    if (!w)
        return ASCC_ERROR_MEMORY;
    memset(w, 0, sizeof *w);
    w->allocator = *allocator;
    w->count = thread_count;
    w->enqueue = enqueue;
    w->finish = finish;
    w->user = user;
    pthread_mutex_init(&w->owner, NULL);
    pthread_mutex_init(&w->lock, NULL);
    pthread_cond_init(&w->wake, NULL);
    pthread_cond_init(&w->done, NULL);
    if (!enqueue && thread_count > 1 && !start_threads(w)) {
        ascc_workers_destroy(&w);
        return ASCC_ERROR_MEMORY;
    }
    *workers = w;
    return ASCC_OK;
}

void ascc_workers_destroy(ascc_workers **workers)
{
    ascc_workers *w = *workers;
    if (!w)
        return;
    *workers = NULL;
    if (w->started) {
        announce(w, 1);
        for (int32_t i = 0; i < w->started; i++)
            pthread_join(w->thread[i], NULL);
    }
    pthread_cond_destroy(&w->done);
    pthread_cond_destroy(&w->wake);
    pthread_mutex_destroy(&w->lock);
    pthread_mutex_destroy(&w->owner);
    const size_t extra = (size_t)w->count - 1;
    ascc_release(&w->allocator, w->thread, extra, sizeof *w->thread);
    ascc_release(&w->allocator, w->worker, extra, sizeof *w->worker);
    const ascc_allocator allocator = w->allocator;
    ascc_release(&allocator, w, 1, sizeof *w);
}

int32_t ascc_workers_count(const ascc_workers *workers)
{
    return workers->count;
}

static void host_task(void *data, int32_t index)
{
    work(data, index);
}

static void run_on_pool(ascc_workers *w, job *j)
{
    w->current = j;
    atomic_store_explicit(&w->working, w->count - 1, memory_order_relaxed);
    announce(w, 2);
    work(j, 0);
    for (int i = 0; i < SPIN; i++) {
        if (!atomic_load_explicit(&w->working, memory_order_acquire))
            return;
        relax();
    }
    pthread_mutex_lock(&w->lock);
    while (atomic_load_explicit(&w->working, memory_order_acquire))
        pthread_cond_wait(&w->done, &w->lock);
    pthread_mutex_unlock(&w->lock);
}

void ascc_workers_run(ascc_workers *w, size_t count, size_t block, ascc_range_function function,
                      void *data)
{
    job j = {.count = count, .block = block, .function = function, .data = data};
    if (count <= block || w->count == 1) {
        work(&j, 0);
        return;
    }
    if (w->enqueue) {
        w->finish(w->user, w->enqueue(w->user, host_task, &j, w->count));
        return;
    }
    if (pthread_mutex_trylock(&w->owner) != 0) { /* the pool is busy with another caller */
        work(&j, 0);
        return;
    }
    run_on_pool(w, &j);
    pthread_mutex_unlock(&w->owner);
}
