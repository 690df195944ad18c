/* pthread_create that fails on demand. For one file of a program linked with
 * -Wl,--wrap=pthread_create. SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_FAILING_THREADS_H
#define ASCC_TEST_FAILING_THREADS_H

#include <errno.h>
#include <pthread.h>

/* Threads that still start; negative: all do. */
static int test_threads_until_failure = -1;

int __real_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument);
int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument);

int __wrap_pthread_create(pthread_t *thread, const pthread_attr_t *attributes,
                          void *(*start)(void *), void *argument)
{
    if (test_threads_until_failure == 0)
        return EAGAIN;
    if (test_threads_until_failure > 0)
        test_threads_until_failure--;
    return __real_pthread_create(thread, attributes, start, argument);
}

#endif
