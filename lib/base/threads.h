/* Threads, locks and conditions of the system: pthreads, Win32, or C11 where there is neither.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_THREADS_H
#define ASCC_THREADS_H

#include <stdbool.h>

#if defined(_WIN32)
/* An SRWLOCK, a CONDITION_VARIABLE and a HANDLE, which are pointers: windows.h stays in threads.c. */
typedef struct ascc_lock {
    void *native;
} ascc_lock;
typedef struct ascc_condition {
    void *native;
} ascc_condition;
typedef void *ascc_native_thread;
#elif !defined(ASCC_C11_THREADS) && (defined(__unix__) || defined(__APPLE__) ||                    \
                                     defined(__EMSCRIPTEN__) || defined(__STDC_NO_THREADS__))
#include <pthread.h>

typedef struct ascc_lock {
    pthread_mutex_t native;
} ascc_lock;
typedef struct ascc_condition {
    pthread_cond_t native;
} ascc_condition;
typedef pthread_t ascc_native_thread;
#else
#undef ASCC_C11_THREADS
#define ASCC_C11_THREADS
#include <threads.h>

typedef struct ascc_lock {
    mtx_t native;
} ascc_lock;
typedef struct ascc_condition {
    cnd_t native;
} ascc_condition;
typedef thrd_t ascc_native_thread;
#endif

/* false where the system has no more; nothing is to be closed then. */
bool ascc_lock_open(ascc_lock *lock);
void ascc_lock_close(ascc_lock *lock);
void ascc_lock_take(ascc_lock *lock);
void ascc_lock_give(ascc_lock *lock);

bool ascc_condition_open(ascc_condition *condition);
void ascc_condition_close(ascc_condition *condition);
/* Gives the lock while it waits. May return without cause. */
void ascc_condition_wait(ascc_condition *condition, ascc_lock *lock);
void ascc_condition_wake_one(ascc_condition *condition);
void ascc_condition_wake_all(ascc_condition *condition);

typedef struct ascc_thread {
    ascc_native_thread native;
    void (*function)(void *argument);
    void *argument;
} ascc_thread;

/* The struct stays where it is until the thread is joined. */
bool ascc_thread_start(ascc_thread *thread, void (*function)(void *argument), void *argument);
void ascc_thread_join(ascc_thread *thread);

/* Lets another thread have the processor. */
void ascc_thread_yield(void);

#endif
