/* Writes a file whole or not at all: beside its place, synced, renamed.
 * SPDX-License-Identifier: MIT */
#include "write_file.h"
#include "paths.h"

#include <errno.h>
#include <fcntl.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define PATH_SIZE ASCC_PATH_SIZE
#define MAX_LINKS 40
#define MAX_TRIES 1000
#define MAX_WRITE ((size_t)1 << 30) /* bytes that every system takes at once */
#define SHOWN_PATH 140              /* bytes of a path that leave room for the reason */

/* The systems differ here alone. */
#if defined(_WIN32)
#include <windows.h>
#define OUR_MODE (S_IREAD | S_IWRITE)

static bool look(const char *path, struct stat *about)
{
    wchar_t wide[PATH_SIZE];
    struct _stat64 found;
    if (!ascc_path_wide(path, wide) || _wstat64(wide, &found) != 0)
        return false;
    about->st_mode = found.st_mode;
    return true;
}

static bool may_write(const char *path)
{
    wchar_t wide[PATH_SIZE];
    return ascc_path_wide(path, wide) && _waccess(wide, W_OK) == 0;
}

static int make_file(const char *path, int mode)
{
    wchar_t wide[PATH_SIZE];
    return ascc_path_wide(path, wide)
               ? _wopen(wide, O_WRONLY | O_CREAT | O_EXCL | O_BINARY | O_NOINHERIT, mode & OUR_MODE)
               : -1;
}

static void discard(const char *path)
{
    wchar_t wide[PATH_SIZE];
    if (ascc_path_wide(path, wide))
        (void)_wunlink(wide);
}

static bool follow_links(char path[PATH_SIZE])
{
    (void)path;
    return true;
}

static void set_mode(int file, unsigned mode)
{
    (void)file;
    (void)mode;
}

static int sync_file(int file)
{
    return _commit(file);
}

/* The name is on disk when the call returns: there is no folder to sync. */
static bool open_folder(const char *path, int *folder)
{
    (void)path;
    *folder = -1;
    return true;
}

static bool replace(const char *part, const char *path)
{
    wchar_t from[PATH_SIZE], to[PATH_SIZE];
    if (!ascc_path_wide(part, from) || !ascc_path_wide(path, to))
        return false;
    if (MoveFileExW(from, to, MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH))
        return true;
    errno = GetLastError() == ERROR_ACCESS_DENIED ? EACCES : EIO;
    return false;
}
#else
#define OUR_MODE 0666

static bool look(const char *path, struct stat *about)
{
    return stat(path, about) == 0;
}

static bool may_write(const char *path)
{
    return access(path, W_OK) == 0;
}

static int make_file(const char *path, int mode)
{
    return open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC | O_NOFOLLOW, mode);
}

static void discard(const char *path)
{
    (void)unlink(path);
}

/* Path of what a chain of links leads to, which need not be there. */
static bool follow_links(char path[PATH_SIZE])
{
    char link[PATH_SIZE];
    for (int i = 0; i < MAX_LINKS; i++) {
        const ssize_t read = readlink(path, link, sizeof link);
        if (read < 0)
            return true; /* no link; or not there, or not to be reached, which opening will tell */
        const size_t length = (size_t)read;
        const char *slash = strrchr(path, '/');
        const size_t folder = link[0] == '/' || !slash ? 0 : (size_t)(slash - path) + 1;
        if (folder + length >= PATH_SIZE) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(path + folder, link, length);
        path[folder + length] = '\0';
    }
    errno = ELOOP;
    return false;
}

/* Where the mode cannot be set, that of the creation is narrower. */
static void set_mode(int file, unsigned mode)
{
    (void)fchmod(file, (mode_t)mode);
}

static int sync_file(int file)
{
    return fsync(file);
}

/* *folder = -1 for one that may be written but not read: it cannot be synced. */
static bool open_folder(const char *path, int *folder)
{
    do
        *folder = open(path, O_RDONLY | O_CLOEXEC);
    while (*folder < 0 && errno == EINTR);
    return *folder >= 0 || errno == EACCES;
}

static bool replace(const char *part, const char *path)
{
    return rename(part, path) == 0;
}
#endif

typedef ascc_file_place place;

/* The last part of a path; what goes before names its folder, separator included. */
static const char *name_of(const char *path)
{
    const char *name = path;
    for (const char *at = path; *at; at++)
        if (strchr(ASCC_PATH_SEPARATORS, *at))
            name = at + 1;
    return name;
}

/* Is there room for a file? Sets errno, or *why, when there is not. */
static bool find_place(place *p, const char *path, const char **why)
{
    if (strlen(path) >= sizeof p->path) {
        errno = ENAMETOOLONG;
        return false;
    }
    strcpy(p->path, path);
    struct stat about;
    p->there = look(path, &about);
    if (p->there && S_ISDIR(about.st_mode)) {
        errno = EISDIR;
        return false;
    }
    if (p->there && !S_ISREG(about.st_mode)) {
        *why = "it is no regular file";
        errno = 0;
        return false;
    }
    p->mode = p->there ? about.st_mode & 0777u : 0u;
    if (!follow_links(p->path) || (p->there && !may_write(path)))
        return false;
    const size_t length = (size_t)(name_of(p->path) - p->path);
    (void)snprintf(p->folder, sizeof p->folder, "%.*s", (int)length, p->path);
    if (length == 0)
        strcpy(p->folder, ".");
    return true;
}

/* A new file beside, under a name that nobody else has. */
static int open_part(place *p)
{
    const char *name = name_of(p->path);
    for (int i = 0; i < MAX_TRIES; i++) {
        const int length = snprintf(p->part, sizeof p->part, "%.*s%.200s.%ld.%d.part",
                                    (int)(name - p->path), p->path, name, (long)getpid(), i);
        if (length < 0 || (size_t)length >= sizeof p->part) {
            errno = ENAMETOOLONG;
            return -1;
        }
        const int file = make_file(p->part, p->there ? (int)p->mode : OUR_MODE);
        if (file >= 0 || (errno != EEXIST && errno != EINTR))
            return file;
    }
    return -1;
}

static bool write_piece(int file, const ascc_bytes *piece)
{
    const unsigned char *at = piece->data;
    size_t left = piece->size;
    while (left > 0) {
        const unsigned now = (unsigned)ascc_min_size(left, MAX_WRITE); /* Windows takes no size_t */
        const ssize_t written = write(file, at, now);
        if (written < 0 && errno == EINTR)
            continue;
        if (written <= 0) {
            errno = written < 0 ? errno : EIO;
            return false;
        }
        at += written;
        left -= (size_t)written;
    }
    return true;
}

static bool synced(int file)
{
    int result;
    do
        result = sync_file(file);
    while (result != 0 && errno == EINTR);
    return result == 0;
}

/* Syncs and closes. What was synced is not lost by a close that was interrupted. */
static bool complete(int file)
{
    const bool good = synced(file);
    const int why = errno;
    const bool closed = close(file) == 0 || errno == EINTR;
    if (!good)
        errno = why;
    return good && closed;
}

/* Renames, so that the name too outlives a loss of power. Some file systems sync no folder: EINVAL. */
static bool put_in_place(const place *p, const char **why)
{
    int folder;
    if (!open_folder(p->folder, &folder))
        return false;
    bool good = replace(p->part, p->path);
    int reason = errno;
    if (good && folder >= 0 && !synced(folder) && errno != EINVAL) {
        reason = errno;
        good = false;
        *why = "it is written, but its folder is not synced";
    }
    if (folder >= 0)
        (void)close(folder);
    errno = reason;
    return good;
}

static ascc_status explain(const char *path, const char *why, ascc_message *message)
{
    const char *reason = errno ? strerror(errno) : "";
    const size_t length = strlen(path);
    const size_t skipped = length > SHOWN_PATH ? length - SHOWN_PATH : 0;
    return ascc_fail(message, ASCC_ERROR_FILE, "cannot write '%s%s': %s%s%s", skipped ? "..." : "",
                     path + skipped, why ? why : "", why && errno ? ": " : "", reason);
}

ascc_status ascc_file_begin(ascc_file_writer *file, const char *path, ascc_message *message)
{
    const char *why = NULL;
    errno = 0;
    file->path = path;
    file->number = find_place(&file->place, path, &why) ? open_part(&file->place) : -1;
    if (file->number < 0)
        return explain(path, why, message);
    if (file->place.there)
        set_mode(file->number, file->place.mode);
    return ASCC_OK;
}

static void abandon(ascc_file_writer *file)
{
    const int reason = errno;
    if (file->number >= 0)
        (void)close(file->number);
    file->number = -1;
    discard(file->place.part); /* not there any more if it has its place */
    errno = reason;
}

ascc_status ascc_file_add(ascc_file_writer *file, const void *data, size_t size,
                          ascc_message *message)
{
    const ascc_bytes piece = {data, size};
    errno = 0;
    if (write_piece(file->number, &piece))
        return ASCC_OK;
    abandon(file);
    return explain(file->path, NULL, message);
}

ascc_status ascc_file_finish(ascc_file_writer *file, ascc_message *message)
{
    const char *why = NULL;
    errno = 0;
    const bool good = complete(file->number);
    file->number = -1;
    if (good && put_in_place(&file->place, &why))
        return ASCC_OK;
    abandon(file);
    return explain(file->path, why, message);
}

void ascc_file_drop(ascc_file_writer *file)
{
    if (file->number >= 0)
        abandon(file);
}

ascc_status ascc_write_file(const char *path, const ascc_bytes *piece, size_t count,
                            ascc_message *message)
{
    ascc_file_writer file;
    ascc_status status = ascc_file_begin(&file, path, message);
    for (size_t i = 0; status == ASCC_OK && i < count; i++)
        status = ascc_file_add(&file, piece[i].data, piece[i].size, message);
    return status == ASCC_OK ? ascc_file_finish(&file, message) : status;
}
