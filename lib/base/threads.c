/* Threads, locks and conditions of the system: pthreads, Win32, or C11 where there is neither.
 * SPDX-License-Identifier: MIT */
#include "threads.h"

#if defined(_WIN32)
#include <windows.h>

_Static_assert(sizeof(SRWLOCK) == sizeof(ascc_lock), "a lock is a pointer");
_Static_assert(sizeof(CONDITION_VARIABLE) == sizeof(ascc_condition), "a condition is a pointer");

bool ascc_lock_open(ascc_lock *lock)
{
    InitializeSRWLock((SRWLOCK *)lock);
    return true;
}

void ascc_lock_close(ascc_lock *lock)
{
    (void)lock;
}

void ascc_lock_take(ascc_lock *lock)
{
    AcquireSRWLockExclusive((SRWLOCK *)lock);
}

void ascc_lock_give(ascc_lock *lock)
{
    ReleaseSRWLockExclusive((SRWLOCK *)lock);
}

bool ascc_condition_open(ascc_condition *condition)
{
    InitializeConditionVariable((CONDITION_VARIABLE *)condition);
    return true;
}

void ascc_condition_close(ascc_condition *condition)
{
    (void)condition;
}

void ascc_condition_wait(ascc_condition *condition, ascc_lock *lock)
{
    (void)SleepConditionVariableSRW((CONDITION_VARIABLE *)condition, (SRWLOCK *)lock, INFINITE, 0);
}

void ascc_condition_wake_one(ascc_condition *condition)
{
    WakeConditionVariable((CONDITION_VARIABLE *)condition);
}

void ascc_condition_wake_all(ascc_condition *condition)
{
    WakeAllConditionVariable((CONDITION_VARIABLE *)condition);
}

static DWORD WINAPI run(void *argument)
{
    const ascc_thread *const thread = argument;
    thread->function(thread->argument);
    return 0;
}

static bool start(ascc_thread *thread)
{
    thread->native = CreateThread(NULL, 0, run, thread, 0, NULL);
    return thread->native != NULL;
}

void ascc_thread_join(ascc_thread *thread)
{
    (void)WaitForSingleObject(thread->native, INFINITE);
    (void)CloseHandle(thread->native);
}

void ascc_thread_yield(void)
{
    (void)SwitchToThread();
}

#elif !defined(ASCC_C11_THREADS)
#include <sched.h>
#include <stddef.h>

bool ascc_lock_open(ascc_lock *lock)
{
    return pthread_mutex_init(&lock->native, NULL) == 0;
}

void ascc_lock_close(ascc_lock *lock)
{
    pthread_mutex_destroy(&lock->native);
}

void ascc_lock_take(ascc_lock *lock)
{
    pthread_mutex_lock(&lock->native);
}

void ascc_lock_give(ascc_lock *lock)
{
    pthread_mutex_unlock(&lock->native);
}

bool ascc_condition_open(ascc_condition *condition)
{
    return pthread_cond_init(&condition->native, NULL) == 0;
}

void ascc_condition_close(ascc_condition *condition)
{
    pthread_cond_destroy(&condition->native);
}

void ascc_condition_wait(ascc_condition *condition, ascc_lock *lock)
{
    pthread_cond_wait(&condition->native, &lock->native);
}

void ascc_condition_wake_one(ascc_condition *condition)
{
    pthread_cond_signal(&condition->native);
}

void ascc_condition_wake_all(ascc_condition *condition)
{
    pthread_cond_broadcast(&condition->native);
}

static void *run(void *argument)
{
    const ascc_thread *const thread = argument;
    thread->function(thread->argument);
    return NULL;
}

static bool start(ascc_thread *thread)
{
    return pthread_create(&thread->native, NULL, run, thread) == 0;
}

void ascc_thread_join(ascc_thread *thread)
{
    pthread_join(thread->native, NULL);
}

void ascc_thread_yield(void)
{
    sched_yield();
}

#else
#include <stddef.h>

bool ascc_lock_open(ascc_lock *lock)
{
    return mtx_init(&lock->native, mtx_plain) == thrd_success;
}

void ascc_lock_close(ascc_lock *lock)
{
    mtx_destroy(&lock->native);
}

void ascc_lock_take(ascc_lock *lock)
{
    (void)mtx_lock(&lock->native);
}

void ascc_lock_give(ascc_lock *lock)
{
    (void)mtx_unlock(&lock->native);
}

bool ascc_condition_open(ascc_condition *condition)
{
    return cnd_init(&condition->native) == thrd_success;
}

void ascc_condition_close(ascc_condition *condition)
{
    cnd_destroy(&condition->native);
}

void ascc_condition_wait(ascc_condition *condition, ascc_lock *lock)
{
    (void)cnd_wait(&condition->native, &lock->native);
}

void ascc_condition_wake_one(ascc_condition *condition)
{
    (void)cnd_signal(&condition->native);
}

void ascc_condition_wake_all(ascc_condition *condition)
{
    (void)cnd_broadcast(&condition->native);
}

static int run(void *argument)
{
    const ascc_thread *const thread = argument;
    thread->function(thread->argument);
    return 0;
}

static bool start(ascc_thread *thread)
{
    return thrd_create(&thread->native, run, thread) == thrd_success;
}

void ascc_thread_join(ascc_thread *thread)
{
    (void)thrd_join(thread->native, NULL);
}

void ascc_thread_yield(void)
{
    thrd_yield();
}
#endif

bool ascc_thread_start(ascc_thread *thread, void (*function)(void *argument), void *argument)
{
    thread->function = function;
    thread->argument = argument;
    return start(thread);
}
