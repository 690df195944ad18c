/* Tests of lib/workers.c: every block once, by own threads and by a host's.
 * SPDX-License-Identifier: MIT */
#include "support/test.h"

#include "support/counting.h"
#include "support/failing_threads.h"
#include "base/workers.h"

#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>

/* ---- Hosts ----------------------------------------------------------------------------------- */

#define MAX_TASKS 16

/* What a host's job system was given. */
typedef struct host {
    ascc_task task;
    void *work;
    int32_t count;
    int jobs;
    pthread_t thread[MAX_TASKS];
    struct host_call {
        struct host *host;
        int32_t index;
    } call[MAX_TASKS];
} host;

/* Runs nothing before finish, and then backwards. */
static void *lazy_enqueue(void *user, ascc_task task, void *work, int32_t count)
{
    host *const self = user;
    self->task = task;
    self->work = work;
    self->count = count;
    self->jobs++;
    return self;
}

static void lazy_finish(void *user, void *token)
{
    host *const self = token;
    if (user != token) /* which enqueue returned */
        abort();
    for (int32_t i = self->count; i-- > 0;)
        self->task(self->work, i);
}

/* Runs everything at once; its token is NULL. */
static void *eager_enqueue(void *user, ascc_task task, void *work, int32_t count)
{
    ((host *)user)->jobs++;
    for (int32_t i = 0; i < count; i++)
        task(work, i);
    return NULL;
}

static void eager_finish(void *user, void *token)
{
    (void)user;
    (void)token;
}

/* A thread for each task. */
static void *call_task(void *argument)
{
    const struct host_call *const call = argument;
    call->host->task(call->host->work, call->index);
    return NULL;
}

static void *threaded_enqueue(void *user, ascc_task task, void *work, int32_t count)
{
    host *const self = lazy_enqueue(user, task, work, count);
    if (count > MAX_TASKS)
        abort();
    for (int32_t i = 0; i < count; i++) {
        self->call[i] = (struct host_call){self, i};
        if (pthread_create(&self->thread[i], NULL, call_task, &self->call[i]) != 0)
            abort();
    }
    return self;
}

static void threaded_finish(void *user, void *token)
{
    (void)user;
    host *const self = token;
    for (int32_t i = 0; i < self->count; i++)
        pthread_join(self->thread[i], NULL);
}

/* ---- A job that watches how it is run -------------------------------------------------------- */

typedef struct job {
    size_t count, block;
    int32_t slots;
    _Atomic unsigned char *visits; /* of each index */
    atomic_int slot_users[MAX_TASKS];
    atomic_int faults; /* asserts do not work on other threads */
} job;

static void visit(void *data, size_t begin, size_t end, int32_t slot)
{
    job *const self = data;
    const size_t whole = begin + self->block;
    if (begin % self->block != 0 || end != (whole < self->count ? whole : self->count) ||
        slot < 0 || slot >= self->slots) {
        atomic_fetch_add(&self->faults, 1);
        return;
    }
    if (atomic_fetch_add(&self->slot_users[slot], 1) != 0)
        atomic_fetch_add(&self->faults, 1); /* two at once in one slot */
    for (size_t i = begin; i < end; i++)
        atomic_fetch_add(&self->visits[i], 1);
    atomic_fetch_sub(&self->slot_users[slot], 1);
}

/* Runs a job and counts what went wrong. Any thread. */
static int run_watched(ascc_workers *workers, size_t count, size_t block)
{
    job *const watched = calloc(1, sizeof *watched);
    watched->count = count;
    watched->block = block;
    watched->slots = ascc_workers_count(workers);
    watched->visits = calloc(count + 1, sizeof *watched->visits);
    ascc_workers_run(workers, count, block, visit, watched);
    int faults = atomic_load(&watched->faults);
    for (size_t i = 0; i < count; i++)
        faults += atomic_load(&watched->visits[i]) != 1;
    free((void *)watched->visits);
    free(watched);
    return faults;
}

static void run_all_sizes(ascc_workers *workers)
{
    static const size_t counts[] = {0, 1, 2, 63, 64, 65, 1000, 10007};
    static const size_t blocks[] = {1, 3, 64, 5000, 20000};
    for (size_t i = 0; i < COUNT_OF(counts); i++)
        for (size_t k = 0; k < COUNT_OF(blocks); k++)
            assert_int_equal(run_watched(workers, counts[i], blocks[k]), 0);
}

static const int32_t thread_counts[] = {1, 2, 3, 7};

/* ---- Facts ----------------------------------------------------------------------------------- */

static void own_threads_do_every_block_once(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    for (size_t i = 0; i < COUNT_OF(thread_counts); i++) {
        ascc_workers *workers;
        assert_int_equal(
            ascc_workers_create(&allocator, thread_counts[i], NULL, NULL, NULL, &workers), ASCC_OK);
        assert_int_equal(ascc_workers_count(workers), thread_counts[i]);
        run_all_sizes(workers);
        ascc_workers_destroy(&workers);
        assert_null(workers);
    }
}

static void a_hosts_tasks_do_every_block_once_in_any_order(void **state)
{
    (void)state;
    static const struct {
        void *(*enqueue)(void *, ascc_task, void *, int32_t);
        void (*finish)(void *, void *);
    } hosts[] = {{lazy_enqueue, lazy_finish},
                 {eager_enqueue, eager_finish},
                 {threaded_enqueue, threaded_finish}};
    const ascc_allocator allocator = ascc_allocator_default();
    for (size_t h = 0; h < COUNT_OF(hosts); h++) {
        for (size_t i = 0; i < COUNT_OF(thread_counts); i++) {
            host user = {0};
            ascc_workers *workers;
            assert_int_equal(ascc_workers_create(&allocator, thread_counts[i], hosts[h].enqueue,
                                                 hosts[h].finish, &user, &workers),
                             ASCC_OK);
            run_all_sizes(workers);
            assert_true(thread_counts[i] == 1 ? user.jobs == 0 : user.jobs > 0);
            ascc_workers_destroy(&workers);
        }
    }
}

static void a_host_is_given_a_task_for_each_thread(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    host user = {0};
    ascc_workers *workers;
    assert_int_equal(ascc_workers_create(&allocator, 5, lazy_enqueue, lazy_finish, &user, &workers),
                     ASCC_OK);
    assert_int_equal(run_watched(workers, 100, 1), 0);
    assert_int_equal(user.count, 5);
    assert_int_equal(user.jobs, 1);
    ascc_workers_destroy(&workers);
}

/* Each thread waits until the other has a block too: that needs both. */
static void meet(void *data, size_t begin, size_t end, int32_t slot)
{
    atomic_int *const present = data;
    (void)begin;
    (void)end;
    (void)slot;
    atomic_fetch_add(present, 1);
    while (atomic_load(present) < 2)
        sched_yield();
}

static void own_threads_work_at_the_same_time(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_workers *workers;
    assert_int_equal(ascc_workers_create(&allocator, 2, NULL, NULL, NULL, &workers), ASCC_OK);
    for (int turn = 0; turn < 100; turn++) {
        atomic_int present = 0;
        ascc_workers_run(workers, 2, 1, meet, &present);
        assert_int_equal(atomic_load(&present), 2);
    }
    ascc_workers_destroy(&workers);
}

static void many_short_jobs_lose_nothing(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_workers *workers;
    assert_int_equal(ascc_workers_create(&allocator, 3, NULL, NULL, NULL, &workers), ASCC_OK);
    for (int turn = 0; turn < 3000; turn++)
        assert_int_equal(run_watched(workers, (size_t)(turn % 17), 1), 0);
    ascc_workers_destroy(&workers);
}

static void note_thread(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)begin;
    (void)end;
    if (slot == 0)
        *(pthread_t *)data = pthread_self();
}

static void a_single_block_runs_on_the_callers_thread(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    host user = {0};
    ascc_workers *own, *hosted;
    assert_int_equal(ascc_workers_create(&allocator, 7, NULL, NULL, NULL, &own), ASCC_OK);
    assert_int_equal(ascc_workers_create(&allocator, 7, lazy_enqueue, lazy_finish, &user, &hosted),
                     ASCC_OK);
    ascc_workers *const both[] = {own, hosted};
    for (int i = 0; i < 2; i++) {
        pthread_t thread;
        ascc_workers_run(both[i], 100, 100, note_thread, &thread);
        assert_true(pthread_equal(thread, pthread_self()));
    }
    assert_int_equal(user.jobs, 0);
    ascc_workers_destroy(&own);
    ascc_workers_destroy(&hosted);
}

typedef struct caller {
    ascc_workers *workers;
    int faults;
} caller;

static void *call_often(void *argument)
{
    caller *const self = argument;
    for (size_t turn = 0; turn < 300; turn++)
        self->faults += run_watched(self->workers, turn, 2);
    return NULL;
}

static void callers_on_several_threads_do_not_disturb_each_other(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    for (int hosted = 0; hosted < 2; hosted++) {
        host user = {0};
        ascc_workers *workers;
        assert_int_equal(ascc_workers_create(&allocator, 3, hosted ? lazy_enqueue : NULL,
                                             hosted ? lazy_finish : NULL, &user, &workers),
                         ASCC_OK);
        caller callers[3] = {{workers, 0}, {workers, 0}, {workers, 0}};
        pthread_t thread[3];
        for (int i = 0; i < 3; i++)
            assert_int_equal(pthread_create(&thread[i], NULL, call_often, &callers[i]), 0);
        for (int i = 0; i < 3; i++) {
            pthread_join(thread[i], NULL);
            assert_int_equal(callers[i].faults, 0);
        }
        ascc_workers_destroy(&workers);
    }
}

static void run_within(void *data, size_t begin, size_t end, int32_t slot)
{
    caller *const self = data;
    (void)begin;
    (void)end;
    if (slot == 0)
        self->faults += run_watched(self->workers, 100, 3);
}

static void a_job_may_run_another(void **state)
{
    (void)state;
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_workers *workers;
    assert_int_equal(ascc_workers_create(&allocator, 3, NULL, NULL, NULL, &workers), ASCC_OK);
    caller self = {workers, 0};
    ascc_workers_run(workers, 50, 1, run_within, &self);
    assert_int_equal(self.faults, 0);
    ascc_workers_destroy(&workers);
}

static void a_thread_that_does_not_start_is_an_error_that_leaks_nothing(void **state)
{
    (void)state;
    for (int started = 0; started < 6; started++) {
        test_memory memory = {0};
        const ascc_allocator allocator = test_memory_allocator(&memory);
        ascc_workers *workers;
        test_threads_until_failure = started;
        const ascc_status status = ascc_workers_create(&allocator, 7, NULL, NULL, NULL, &workers);
        test_threads_until_failure = -1;
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_null(workers);
        assert_true(test_memory_is_clean(&memory));
    }
}

static void a_lock_that_is_not_made_is_an_error_that_leaks_nothing(void **state)
{
    (void)state;
    for (int made = 0; made < 3; made++) { /* a mutex, then two conditions */
        test_memory memory = {0};
        const ascc_allocator allocator = test_memory_allocator(&memory);
        ascc_workers *workers;
        test_locks_held = 0;
        test_locks_until_failure = made;
        const ascc_status status = ascc_workers_create(&allocator, 2, NULL, NULL, NULL, &workers);
        test_locks_until_failure = -1;
        assert_int_equal(status, ASCC_ERROR_MEMORY);
        assert_null(workers);
        assert_int_equal(test_locks_held, 0);
        assert_true(test_memory_is_clean(&memory));
    }
}

static void without_memory_there_are_no_workers(void **state)
{
    (void)state;
    test_memory memory = {.fail_at = 1};
    const ascc_allocator allocator = test_memory_allocator(&memory);
    ascc_workers *workers;
    assert_int_equal(ascc_workers_create(&allocator, 2, NULL, NULL, NULL, &workers),
                     ASCC_ERROR_MEMORY);
    assert_null(workers);
    assert_int_equal(ascc_workers_create(&allocator, 2, NULL, NULL, NULL, &workers), ASCC_OK);
    const size_t calls = memory.calls;
    assert_int_equal(run_watched(workers, 1000, 3), 0);
    assert_int_equal(memory.calls, calls); /* running takes none */
    ascc_workers_destroy(&workers);
    ascc_workers_destroy(&workers);
    assert_true(test_memory_is_clean(&memory));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(own_threads_do_every_block_once),
        cmocka_unit_test(a_hosts_tasks_do_every_block_once_in_any_order),
        cmocka_unit_test(a_host_is_given_a_task_for_each_thread),
        cmocka_unit_test(own_threads_work_at_the_same_time),
        cmocka_unit_test(many_short_jobs_lose_nothing),
        cmocka_unit_test(a_single_block_runs_on_the_callers_thread),
        cmocka_unit_test(callers_on_several_threads_do_not_disturb_each_other),
        cmocka_unit_test(a_job_may_run_another),
        cmocka_unit_test(a_thread_that_does_not_start_is_an_error_that_leaks_nothing),
        cmocka_unit_test(a_lock_that_is_not_made_is_an_error_that_leaks_nothing),
        cmocka_unit_test(without_memory_there_are_no_workers),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
