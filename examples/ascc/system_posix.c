/* What systems do differently, on those of POSIX. SPDX-License-Identifier: MIT */
#include "system.h"

#include <errno.h>
#include <fcntl.h>
#include <glob.h>
#include <limits.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

enum { MAX_LINKS = 40, MAX_TRIES = 10 };

/* Opened so that what is meant for the stream fails, as it does on a closed one. */
void ascc_system_start(int *argc, char ***argv)
{
    (void)argc, (void)argv;
    for (int stream = 0; stream < 3; stream++)
        if (fcntl(stream, F_GETFD) < 0)
            (void)open("/dev/null", stream == 0 ? O_WRONLY : O_RDONLY);
}

bool ascc_system_is_absolute(const char *path)
{
    return path[0] == '/';
}

const char *ascc_system_name(const char *path)
{
    const char *name = path;
    for (const char *at = path; *at; at++)
        if (strchr(ASCC_SEPARATORS, *at))
            name = at + 1;
    return name;
}

bool ascc_system_look(const char *path, ascc_about *about)
{
    struct stat found;
    if (stat(path, &found) != 0)
        return false;
    *about = (ascc_about){S_ISDIR(found.st_mode), S_ISREG(found.st_mode), found.st_mode & 0777,
                          (uint64_t)found.st_size};
    return true;
}

bool ascc_system_there(const char *path)
{
    return access(path, F_OK) == 0;
}

bool ascc_system_same(const char *a, const char *b)
{
    struct stat x, y;
    return stat(a, &x) == 0 && stat(b, &y) == 0 && x.st_dev == y.st_dev && x.st_ino == y.st_ino;
}

bool ascc_system_may_write(const char *path)
{
    return access(path, W_OK) == 0;
}

bool ascc_system_may_fill(const char *folder)
{
    return access(folder, W_OK | X_OK) == 0;
}

bool ascc_system_make_folder(const char *path)
{
    return mkdir(path, 0777) == 0;
}

FILE *ascc_system_open(const char *path, const char *mode)
{
    return fopen(path, mode);
}

bool ascc_system_cut(FILE *file, long length)
{
    return ftruncate(fileno(file), length) == 0;
}

bool ascc_system_follow_links(char *path, size_t capacity)
{
    char link[PATH_MAX];
    for (int i = 0; i < MAX_LINKS; i++) {
        const ssize_t read = readlink(path, link, sizeof link);
        if (read < 0)
            return true; /* no link; or not there, or not to be reached, which opening will tell */
        const size_t length = (size_t)read;
        const char *slash = strrchr(path, '/');
        const size_t folder = link[0] == '/' || !slash ? 0 : (size_t)(slash - path) + 1;
        if (folder + length >= capacity) {
            errno = ENAMETOOLONG;
            return false;
        }
        memcpy(path + folder, link, length);
        path[folder + length] = '\0';
    }
    errno = ELOOP;
    return false;
}

/* ---- Patterns ---- */

/* The folder with its letters escaped, and the pattern; from malloc. */
static char *whole_pattern(const char *folder, const char *pattern)
{
    const char *before = pattern[0] == '/' ? "" : folder;
    char *whole = malloc(2 * strlen(before) + strlen(pattern) + 1), *at = whole;
    for (const char *c = before; whole && *c; c++) {
        if (strchr("*?[]\\", *c))
            *at++ = '\\';
        *at++ = *c;
    }
    if (whole)
        strcpy(at, pattern);
    return whole;
}

char **ascc_system_match(const char *folder, const char *pattern, size_t *count)
{
    glob_t found = {0};
    char *whole = whole_pattern(folder, pattern), **paths = NULL;
    *count = 0;
    if (whole && glob(whole, 0, NULL, &found) == 0 && found.gl_pathc > 0)
        paths = malloc(found.gl_pathc * sizeof *paths);
    for (size_t i = 0; paths && i < found.gl_pathc; i++)
        if ((paths[*count] = strdup(found.gl_pathv[i])) != NULL)
            (*count)++;
    globfree(&found);
    free(whole);
    return paths;
}

/* ---- A file that only one program writes ---- */

/* A system that has no locks has no say. */
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
static bool remove_left(const char *path)
{
    const int file = open(path, O_RDWR | O_NOFOLLOW | O_NONBLOCK | O_CLOEXEC);
    const bool left = file < 0 || lock(file);
    const bool removed = left && unlink(path) == 0;
    const int why = errno;
    if (file >= 0)
        (void)close(file);
    errno = left ? why : EBUSY;
    return removed || (left && why == ENOENT);
}

static int create(const char *path, mode_t mode)
{
    for (int i = 0; i < MAX_TRIES; i++) {
        const int file = open(path, O_RDWR | O_CREAT | O_EXCL | O_NOFOLLOW | O_CLOEXEC,
                              mode ? mode : (mode_t)0666);
        if (file < 0 && (errno != EEXIST || !remove_left(path)))
            return -1;
        if (file < 0)
            continue;
        if (lock(file) && is_named(file, path)) {
            if (mode)
                (void)fchmod(file, mode);
            return file;
        }
        (void)close(file);
    }
    errno = EBUSY;
    return -1;
}

/* A stream of a file that goes by that path. */
static FILE *stream_of(int file, const char *path, bool nameless)
{
    FILE *stream = file < 0 ? NULL : fdopen(file, "wb+");
    const int why = errno;
    if (file >= 0 && (nameless || !stream))
        (void)unlink(path);
    if (file >= 0 && !stream)
        (void)close(file);
    errno = why;
    return stream;
}

FILE *ascc_system_create(const char *path, unsigned mode)
{
    return stream_of(create(path, (mode_t)mode), path, false);
}

FILE *ascc_system_scratch(const char *path)
{
    char name[PATH_MAX + 8];
    (void)snprintf(name, sizeof name, "%s.XXXXXX", path);
    return stream_of(mkstemp(name), name, true);
}

bool ascc_system_sync(FILE *file)
{
    return fsync(fileno(file)) == 0;
}

/* The name outlives a loss of power when the folder is on disk. Some can be written but not read, or are
 * synced by no system: no reason to fail. */
static bool sync_folder(const char *folder)
{
    const int file = open(folder, O_RDONLY | O_CLOEXEC);
    if (file < 0)
        return errno == EACCES;
    const bool good = fsync(file) == 0 || errno == EINVAL;
    const int why = errno;
    (void)close(file);
    errno = why;
    return good;
}

bool ascc_system_replace(const char *from, const char *to, const char *folder)
{
    return rename(from, to) == 0 && sync_folder(folder);
}

void ascc_system_remove(const char *path)
{
    (void)unlink(path);
}

/* ---- Terminal, programs, signals ---- */

bool ascc_system_is_terminal(FILE *stream)
{
    return isatty(fileno(stream)) != 0;
}

void ascc_system_become(const char *self, const char *name, char **words)
{
    char path[4096];
    const int folder = (int)(ascc_system_name(self) - self);
    if (snprintf(path, sizeof path, "%.*s%s", folder, self, name) < (int)sizeof path)
        (void)execvp(path, words);
}

bool ascc_system_feed(const char *program, void (*write)(FILE *to, const void *data),
                      const void *data)
{
    char command[128];
    (void)snprintf(command, sizeof command, "command -v %.40s >/dev/null 2>&1", program);
    if (system(command) != 0)
        return false;
    struct sigaction ignore = {.sa_handler = SIG_IGN}, before;
    (void)sigaction(SIGPIPE, &ignore, &before);
    (void)snprintf(command, sizeof command, "%.40s >/dev/null 2>&1", program);
    FILE *pipe = popen(command, "w");
    bool good = pipe != NULL;
    if (good) {
        write(pipe, data);
        good = pclose(pipe) == 0;
    }
    (void)sigaction(SIGPIPE, &before, NULL);
    return good;
}

void ascc_system_on_interrupt(void (*handler)(int number))
{
    const struct sigaction catch = {.sa_handler = handler, .sa_flags = (int)SA_RESETHAND};
    const struct sigaction ignore = {.sa_handler = SIG_IGN};
    (void)sigaction(SIGINT, &catch, NULL);
    (void)sigaction(SIGTERM, &catch, NULL);
    (void)sigaction(SIGXFSZ, &ignore, NULL); /* a file too large is an error like a full disk */
}

int32_t ascc_system_processors(void)
{
    const long count = sysconf(_SC_NPROCESSORS_ONLN);
    return count > 0 ? (int32_t)count : 1;
}
