/* Files that the program writes: whole or not at all. SPDX-License-Identifier: MIT */
#include "new_file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_LINKS = 40, MAX_TRIES = 10 };

static const char SUFFIX[] = ".part";

static bool fail(const char *path, const char *why, char *error, size_t capacity)
{
    (void)snprintf(error, capacity, "%.2000s: cannot be written: %s", path, why);
    return false;
}

/* ---- Where ---- */

/* Path of what a chain of links leads to, which need not be there. */
static bool follow_links(char path[ASCC_NEW_FILE_PATH])
{
    char link[ASCC_NEW_FILE_PATH];
    for (int i = 0; i < MAX_LINKS; i++) {
        const ssize_t read = readlink(path, link, sizeof link);
        if (read < 0)
            return true; /* no link; or not there, or not to be reached, which opening will tell */
        const size_t length = (size_t)read;
        const char *slash = strrchr(path, '/');
        const size_t folder = link[0] == '/' || !slash ? 0 : (size_t)(slash - path) + 1;
        if (folder + length >= ASCC_NEW_FILE_PATH) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(path + folder, link, length);
        path[folder + length] = '\0';
    }
    errno = ELOOP;
    return false;
}

static void folder_of(const char *path, char folder[ASCC_NEW_FILE_PATH])
{
    const char *slash = strrchr(path, '/');
    if (slash == path || !slash)
        strcpy(folder, slash ? "/" : ".");
    else
        (void)snprintf(folder, ASCC_NEW_FILE_PATH, "%.*s", (int)(slash - path), path);
}

/* The file's own path, and the mode it has or 0. NULL, or why nothing can be written there. */
static const char *find_place(const char *path, char real[ASCC_NEW_FILE_PATH], mode_t *mode)
{
    struct stat about;
    if (strlen(path) + sizeof SUFFIX > ASCC_NEW_FILE_PATH)
        return strerror(ENAMETOOLONG);
    strcpy(real, path);
    const bool there = stat(path, &about) == 0;
    if (there && S_ISDIR(about.st_mode))
        return strerror(EISDIR);
    if (there && !S_ISREG(about.st_mode))
        return "it is no regular file";
    if (there && access(path, W_OK) != 0)
        return strerror(errno);
    *mode = there ? about.st_mode & 0777 : 0;
    if (!follow_links(real))
        return strerror(errno);
    return strlen(real) + sizeof SUFFIX > ASCC_NEW_FILE_PATH ? strerror(ENAMETOOLONG) : NULL;
}

bool ascc_new_file_check(const char *path, char *error, size_t capacity)
{
    char real[ASCC_NEW_FILE_PATH], folder[ASCC_NEW_FILE_PATH];
    mode_t mode;
    const char *why = find_place(path, real, &mode);
    if (why)
        return fail(path, why, error, capacity);
    folder_of(real, folder);
    return access(folder, W_OK | X_OK) == 0 || fail(path, strerror(errno), error, capacity);
}

bool ascc_make_folder(const char *path, char *error, size_t capacity)
{
    struct stat about;
    bool good = mkdir(path, 0777) == 0 || errno == EEXIST;
    if (good && stat(path, &about) == 0 && !S_ISDIR(about.st_mode)) {
        errno = ENOTDIR;
        good = false;
    }
    good = good && access(path, W_OK | X_OK) == 0;
    if (!good)
        (void)snprintf(error, capacity, "%.2000s: %s", path, strerror(errno));
    return good;
}

/* ---- The file beside ---- */

/* Only one program at a time; a system that has no locks has no say. */
static bool lock(int file)
{
    const struct flock all = {.l_type = F_WRLCK, .l_whence = SEEK_SET};
    return fcntl(file, F_SETLK, &all) == 0 || (errno != EACCES && errno != EAGAIN);
}

static bool is_named(int file, const char *path)
{
    struct stat own, named;
    return fstat(file, &own) == 0 && lstat(path, &named) == 0 && own.st_ino == named.st_ino &&
           own.st_dev == named.st_dev;
}

/* Removes what a program that was killed left behind; false if one is writing it. */
static bool remove_left(const char *part)
{
    const int file = open(part, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    const bool left = file < 0 || lock(file);
    const bool removed = left && unlink(part) == 0;
    const int why = errno;
    if (file >= 0)
        (void)close(file);
    errno = left ? why : EBUSY;
    return removed || (left && why == ENOENT);
}

static int open_part(const char *part, mode_t mode)
{
    for (int i = 0; i < MAX_TRIES; i++) {
        const int file = open(part, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                              mode ? mode : (mode_t)0666);
        if (file < 0 && (errno != EEXIST || !remove_left(part)))
            return -1;
        if (file < 0)
            continue;
        if (lock(file) && is_named(file, part)) {
            if (mode)
                (void)fchmod(file, mode);
            return file;
        }
        (void)close(file);
    }
    errno = EBUSY;
    return -1;
}

bool ascc_new_file_open(ascc_new_file *o, const char *path, char *error, size_t capacity)
{
    mode_t mode = 0;
    o->stream = NULL;
    const char *why = find_place(path, o->path, &mode);
    if (why)
        return fail(path, why, error, capacity);
    (void)snprintf(o->part, sizeof o->part, "%.*s%s", (int)(sizeof o->part - sizeof SUFFIX),
                   o->path, SUFFIX);
    const int file = open_part(o->part, mode);
    if (file < 0)
        return fail(path, errno == EBUSY ? "another program is writing it" : strerror(errno), error,
                    capacity);
    o->stream = fdopen(file, "wb+");
    if (o->stream)
        return true;
    (void)fail(path, strerror(errno), error, capacity);
    (void)close(file);
    (void)unlink(o->part);
    return false;
}

/* The name outlives a loss of power when the folder is on disk. Some can be written but not read, or are
 * synced by no system: no reason to fail. */
static bool sync_folder(const char *path)
{
    char folder[ASCC_NEW_FILE_PATH];
    folder_of(path, folder);
    const int file = open(folder, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return errno == EACCES;
    const bool good = fsync(file) == 0 || errno == EINVAL;
    const int why = errno;
    (void)close(file);
    errno = why;
    return good;
}

bool ascc_new_file_close(ascc_new_file *o, bool keep, char *error, size_t capacity)
{
    if (!o->stream)
        return true;
    errno = 0;
    bool good =
        keep && !ferror(o->stream) && fflush(o->stream) == 0 && fsync(fileno(o->stream)) == 0;
    int why = errno;
    if (fclose(o->stream) != 0 && good) {
        why = errno;
        good = false;
    }
    o->stream = NULL;
    if (good && (rename(o->part, o->path) != 0 || !sync_folder(o->path))) {
        why = errno;
        good = false;
    }
    if (!good)
        (void)unlink(o->part);
    return good || !keep ||
           fail(o->path, why ? strerror(why) : "not all was written", error, capacity);
}

FILE *ascc_new_file_scratch(const ascc_new_file *o)
{
    char path[ASCC_NEW_FILE_PATH + 8];
    (void)snprintf(path, sizeof path, "%s.XXXXXX", o->part);
    const int file = mkstemp(path);
    FILE *stream = file < 0 ? NULL : fdopen(file, "wb+");
    if (file >= 0) {
        const int why = errno;
        (void)unlink(path);
        if (!stream)
            (void)close(file);
        errno = why;
    }
    return stream;
}
