/* Runs a function over [0, count) in blocks fixed by index, on all workers of a context.
 * SPDX-License-Identifier: MIT
 *
 * One job at a time. A ticket says which job it is and how many of its blocks nobody has taken yet:
 *
 *     ticket = | number of the job, 32 bits | blocks left, 32 bits |
 *
 * A worker reads the ticket, then the job, and takes a block by exchanging the ticket for one with
 * a block less. If that succeeds the ticket did not change in between, so the job had an unfinished
 * block all the time and what was read of it is whole. Who comes late finds no block left and
 * touches nothing: so a job is over when its blocks are done, and nobody waits for a sleeper.
 */
#include "workers.h"

#include <stdatomic.h>

#include "threads.h"

/* Turns of yielding before an idle thread goes to sleep: some microseconds. */
#define IDLE_TURNS 32

typedef struct worker {
    ascc_thread thread;
    ascc_workers *workers;
    int32_t slot;
} worker;

struct ascc_workers {
    _Alignas(ASCC_ALIGNMENT) _Atomic uint64_t ticket;
    _Alignas(ASCC_ALIGNMENT) _Atomic uint32_t done; /* blocks of the job that are finished */
    _Atomic bool caller_sleeps;
    atomic_flag taken; /* a caller has the pool */

    /* The job. Atomic only because late workers may read it while the next one is written. */
    _Alignas(ASCC_ALIGNMENT) _Atomic(ascc_range_function) function;
    _Atomic(void *) data;
    _Atomic size_t count, block;
    _Atomic uint32_t blocks;

    /* Sleep and waking. */
    ascc_lock lock;
    ascc_condition wake, finished;
    _Atomic int32_t sleepers;
    bool stop; /* under lock */

    ascc_allocator allocator;
    void *(*enqueue)(void *, ascc_task, void *, int32_t);
    void (*finish)(void *, void *);
    void *user;
    size_t size; /* of this struct with its threads */
    int32_t thread_count;
    int32_t started; /* entries of own that run */
    worker own[];    /* thread_count - 1, without a host's job system */
};

static uint32_t blocks_left(uint64_t ticket)
{
    return (uint32_t)ticket;
}

/* Counts a block as done, and wakes the caller after the last one. Sequential consistency: either
 * we see that the caller sleeps, or it sees our count before it goes to sleep. */
static void finish_block(ascc_workers *workers, uint32_t blocks)
{
    if (atomic_fetch_add(&workers->done, 1) + 1 == blocks && atomic_load(&workers->caller_sleeps)) {
        ascc_lock_take(&workers->lock);
        ascc_condition_wake_one(&workers->finished);
        ascc_lock_give(&workers->lock);
    }
}

/* Does blocks until none is left. */
static void take_blocks(ascc_workers *workers, int32_t slot)
{
    ASCC_FLOAT_SCOPE; /* the thread is the host's, or as the host's was when it started ours */
    uint64_t ticket = atomic_load_explicit(&workers->ticket, memory_order_acquire);
    while (blocks_left(ticket) != 0) {
        const ascc_range_function function =
            atomic_load_explicit(&workers->function, memory_order_relaxed);
        void *const data = atomic_load_explicit(&workers->data, memory_order_relaxed);
        const size_t count = atomic_load_explicit(&workers->count, memory_order_relaxed);
        const size_t block = atomic_load_explicit(&workers->block, memory_order_relaxed);
        const uint32_t blocks = atomic_load_explicit(&workers->blocks, memory_order_relaxed);
        if (!atomic_compare_exchange_weak_explicit(&workers->ticket, &ticket, ticket - 1,
                                                   memory_order_acq_rel, memory_order_acquire))
            continue;
        const size_t begin = (size_t)(blocks - blocks_left(ticket)) * block;
        function(data, begin, begin + ascc_min_size(block, count - begin), slot);
        finish_block(workers, blocks);
        ticket = atomic_load_explicit(&workers->ticket, memory_order_acquire);
    }
}

/* ---- Own threads ----------------------------------------------------------------------------- */

/* Waits until there is a block to take; false: stop. */
static bool wait_for_blocks(ascc_workers *workers)
{
    for (int turn = 0; turn < IDLE_TURNS; turn++) {
        if (blocks_left(atomic_load_explicit(&workers->ticket, memory_order_relaxed)) != 0)
            return true;
        ascc_thread_yield();
    }
    ascc_lock_take(&workers->lock);
    atomic_fetch_add(&workers->sleepers, 1);
    while (!workers->stop && blocks_left(atomic_load(&workers->ticket)) == 0)
        ascc_condition_wait(&workers->wake, &workers->lock);
    atomic_fetch_sub(&workers->sleepers, 1);
    const bool stop = workers->stop;
    ascc_lock_give(&workers->lock);
    return !stop;
}

static void work(void *argument)
{
    const worker *const self = argument;
    while (wait_for_blocks(self->workers))
        take_blocks(self->workers, self->slot);
}

/* Wakes no more sleepers than there are blocks for. */
static void wake_sleepers(ascc_workers *workers, uint32_t blocks)
{
    const int32_t sleepers = atomic_load(&workers->sleepers);
    if (sleepers == 0)
        return;
    ascc_lock_take(&workers->lock);
    for (int32_t i = 0; i < sleepers && (uint32_t)i + 1 < blocks; i++)
        ascc_condition_wake_one(&workers->wake);
    ascc_lock_give(&workers->lock);
}

/* Waits for blocks that other workers still have in hand. */
static void wait_for_done(ascc_workers *workers, uint32_t blocks)
{
    for (int turn = 0; turn < IDLE_TURNS; turn++) {
        if (atomic_load_explicit(&workers->done, memory_order_acquire) == blocks)
            return;
        ascc_thread_yield();
    }
    ascc_lock_take(&workers->lock);
    atomic_store(&workers->caller_sleeps, true);
    while (atomic_load(&workers->done) != blocks)
        ascc_condition_wait(&workers->finished, &workers->lock);
    atomic_store(&workers->caller_sleeps, false);
    ascc_lock_give(&workers->lock);
}

/* ---- The host's job system ------------------------------------------------------------------- */

static void host_task(void *argument, int32_t index)
{
    take_blocks(argument, index);
}

/* ---- Life ------------------------------------------------------------------------------------ */

static bool start_threads(ascc_workers *workers)
{
    while (workers->started < workers->thread_count - 1) {
        worker *const next = &workers->own[workers->started];
        *next = (worker){.workers = workers, .slot = workers->started + 1};
        if (!ascc_thread_start(&next->thread, work, next))
            return false;
        workers->started++;
    }
    return true;
}

static bool open_locks(ascc_workers *workers)
{
    if (!ascc_lock_open(&workers->lock))
        return false;
    if (ascc_condition_open(&workers->wake)) {
        if (ascc_condition_open(&workers->finished))
            return true;
        ascc_condition_close(&workers->wake);
    }
    ascc_lock_close(&workers->lock);
    return false;
}

ascc_status ascc_workers_create(const ascc_allocator *allocator, int32_t thread_count,
                                void *(*enqueue)(void *, ascc_task, void *, int32_t),
                                void (*finish)(void *, void *), void *user, ascc_workers **workers)
{
    *workers = NULL;
    const size_t own = enqueue == NULL ? (size_t)thread_count - 1 : 0;
    const size_t size = sizeof(ascc_workers) + own * sizeof(worker);
    ascc_workers *made = ascc_allocate(allocator, 1, size);
    if (made == NULL)
        return ASCC_ERROR_MEMORY;

    atomic_init(&made->ticket, 0);
    atomic_init(&made->done, 0);
    atomic_init(&made->caller_sleeps, false);
    atomic_flag_clear(&made->taken);
    atomic_init(&made->function, NULL);
    atomic_init(&made->data, NULL);
    atomic_init(&made->count, 0);
    atomic_init(&made->block, 0);
    atomic_init(&made->blocks, 0);
    atomic_init(&made->sleepers, 0);
    made->stop = false;
    made->allocator = *allocator;
    made->enqueue = enqueue;
    made->finish = finish;
    made->user = user;
    made->size = size;
    made->thread_count = thread_count;
    made->started = 0;

    if (!open_locks(made)) {
        ascc_release(allocator, made, 1, size);
        return ASCC_ERROR_MEMORY;
    }
    if (enqueue == NULL && !start_threads(made)) {
        ascc_workers_destroy(&made);
        return ASCC_ERROR_MEMORY;
    }
    *workers = made;
    return ASCC_OK;
}

void ascc_workers_destroy(ascc_workers **workers)
{
    ascc_workers *const old = *workers;
    if (old == NULL)
        return;
    *workers = NULL;
    ascc_lock_take(&old->lock);
    old->stop = true;
    ascc_condition_wake_all(&old->wake);
    ascc_lock_give(&old->lock);
    for (int32_t i = 0; i < old->started; i++)
        ascc_thread_join(&old->own[i].thread);
    ascc_condition_close(&old->finished);
    ascc_condition_close(&old->wake);
    ascc_lock_close(&old->lock);
    const ascc_allocator allocator = old->allocator;
    ascc_release(&allocator, old, 1, old->size);
}

int32_t ascc_workers_count(const ascc_workers *workers)
{
    return workers->thread_count;
}

/* ---- Run ------------------------------------------------------------------------------------- */

static void run_alone(size_t count, size_t block, ascc_range_function function, void *data)
{
    for (size_t begin = 0; begin < count;) {
        const size_t end = begin + ascc_min_size(block, count - begin);
        function(data, begin, end, 0);
        begin = end;
    }
}

static void publish(ascc_workers *workers, size_t count, size_t block, uint32_t blocks,
                    ascc_range_function function, void *data)
{
    atomic_store_explicit(&workers->function, function, memory_order_relaxed);
    atomic_store_explicit(&workers->data, data, memory_order_relaxed);
    atomic_store_explicit(&workers->count, count, memory_order_relaxed);
    atomic_store_explicit(&workers->block, block, memory_order_relaxed);
    atomic_store_explicit(&workers->blocks, blocks, memory_order_relaxed);
    atomic_store_explicit(&workers->done, 0, memory_order_relaxed);
    const uint64_t number =
        (atomic_load_explicit(&workers->ticket, memory_order_relaxed) >> 32) + 1;
    atomic_store(&workers->ticket, number << 32 | blocks);
}

void ascc_workers_run(ascc_workers *workers, size_t count, size_t block,
                      ascc_range_function function, void *data)
{
    assert(block > 0);
    const size_t blocks = count / block + (count % block != 0);
    if (blocks <= 1 || blocks > UINT32_MAX || workers->thread_count == 1 ||
        atomic_flag_test_and_set_explicit(&workers->taken, memory_order_acquire)) {
        run_alone(count, block, function, data);
        return;
    }

    publish(workers, count, block, (uint32_t)blocks, function, data);
    if (workers->enqueue != NULL) {
        void *const token =
            workers->enqueue(workers->user, host_task, workers, workers->thread_count);
        workers->finish(workers->user, token);
    } else {
        wake_sleepers(workers, (uint32_t)blocks);
    }
    take_blocks(workers, 0); /* with a host's job system none is left */
    wait_for_done(workers, (uint32_t)blocks);
    atomic_flag_clear_explicit(&workers->taken, memory_order_release);
}
