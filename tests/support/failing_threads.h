/* pthread_create that fails on demand, and so do locks. For one file of a program linked with
 * -Wl,--wrap of each of these functions. SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_FAILING_THREADS_H
#define ASCC_TEST_FAILING_THREADS_H

#include <errno.h>
#include <pthread.h>
#include <stdbool.h>

/* Threads that still start, locks and conditions that are still made; negative: all. */
static int test_threads_until_failure = -1;
static int test_locks_until_failure = -1;
/* Locks and conditions that were made and not destroyed. */
static int test_locks_held;

static inline bool test_is_failure(int *until)
{
    if (*until == 0)
        return true;
    *until -= *until > 0;
    return false;
}

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument);
int __real_pthread_mutex_init(pthread_mutex_t *lock, const pthread_mutexattr_t *attributes);
int __wrap_pthread_mutex_init(pthread_mutex_t *lock, const pthread_mutexattr_t *attributes);
int __real_pthread_mutex_destroy(pthread_mutex_t *lock);
int __wrap_pthread_mutex_destroy(pthread_mutex_t *lock);
int __real_pthread_cond_init(pthread_cond_t *condition, const pthread_condattr_t *attributes);
int __wrap_pthread_cond_init(pthread_cond_t *condition, const pthread_condattr_t *attributes);
int __real_pthread_cond_destroy(pthread_cond_t *condition);
int __wrap_pthread_cond_destroy(pthread_cond_t *condition);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument)
{
    if (test_is_failure(&test_threads_until_failure))
        return EAGAIN;
    return __real_pthread_create(thread, attributes, start, argument);
}

int __wrap_pthread_mutex_init(pthread_mutex_t *lock, const pthread_mutexattr_t *attributes)
{
    if (test_is_failure(&test_locks_until_failure))
        return ENOMEM;
    test_locks_held++;
    return __real_pthread_mutex_init(lock, attributes);
}

int __wrap_pthread_mutex_destroy(pthread_mutex_t *lock)
{
    test_locks_held--;
    return __real_pthread_mutex_destroy(lock);
}

int __wrap_pthread_cond_init(pthread_cond_t *condition, const pthread_condattr_t *attributes)
{
    if (test_is_failure(&test_locks_until_failure))
        return ENOMEM;
    test_locks_held++;
    return __real_pthread_cond_init(condition, attributes);
}

int __wrap_pthread_cond_destroy(pthread_cond_t *condition)
{
    test_locks_held--;
    return __real_pthread_cond_destroy(condition);
}

#endif
