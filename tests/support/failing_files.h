/* open, write, fsync, rename and close that fail on demand, as on a full or broken disk. For one file of
 * a program linked with -Wl,--wrap of each. SPDX-License-Identifier: MIT */
#ifndef ASCC_TEST_FAILING_FILES_H
#define ASCC_TEST_FAILING_FILES_H

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdio.h>
#include <unistd.h>

typedef struct failing_files {
    int calls;       /* made so far */
    int fail_at;     /* this one fails; 0 = none */
    int reason;      /* its errno */
    int interrupted; /* every so many calls EINTR; 0 = none */
    size_t most;     /* bytes that a write takes; 0 = all */
} failing_files;

static failing_files test_files;

/* Shall this call fail? */
static int test_files_fail(void)
{
    test_files.calls++;
    if (test_files.interrupted && test_files.calls % test_files.interrupted == 0) {
        errno = EINTR;
        return 1;
    }
    if (test_files.calls != test_files.fail_at)
        return 0;
    errno = test_files.reason;
    return 1;
}

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __wrap_open64(const char *path, int flags, ...);
ssize_t __real_write(int file, const void *data, size_t size);
ssize_t __wrap_write(int file, const void *data, size_t size);
int __real_fsync(int file);
int __wrap_fsync(int file);
int __real_rename(const char *from, const char *to);
int __wrap_rename(const char *from, const char *to);
int __real_close(int file);
int __wrap_close(int file);

int __wrap_open(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const int mode = flags & O_CREAT ? va_arg(arguments, int) : 0;
    va_end(arguments);
    return test_files_fail() ? -1 : __real_open(path, flags, mode);
}

/* The same under the name that it has where offsets are asked to be 64 bits wide. */
int __wrap_open64(const char *path, int flags, ...)
{
    va_list arguments;
    va_start(arguments, flags);
    const int mode = flags & O_CREAT ? va_arg(arguments, int) : 0;
    va_end(arguments);
    return __wrap_open(path, flags, mode);
}

ssize_t __wrap_write(int file, const void *data, size_t size)
{
    if (test_files_fail())
        return -1;
    return __real_write(file, data,
                        test_files.most && size > test_files.most ? test_files.most : size);
}

int __wrap_fsync(int file)
{
    return test_files_fail() ? -1 : __real_fsync(file);
}

int __wrap_rename(const char *from, const char *to)
{
    /* No system interrupts a rename. */
    return test_files_fail() && errno != EINTR ? -1 : __real_rename(from, to);
}

/* The file is closed even where the call fails. */
int __wrap_close(int file)
{
    const int closed = __real_close(file);
    return test_files_fail() ? -1 : closed;
}

#endif
