/* Files that the program writes: whole or not at all. SPDX-License-Identifier: MIT */
#include "new_file.h"

#include <errno.h>
#include <string.h>

#include "system.h"

static const char SUFFIX[] = ".part";

static bool fail(const char *path, const char *why, char *error, size_t capacity)
{
    (void)snprintf(error, capacity, "%.2000s: cannot be written: %s", path, why);
    return false;
}

/* ---- Where ---- */

void ascc_folder_of(const char *path, char folder[ASCC_NEW_FILE_PATH])
{
    const int length = (int)(ascc_system_name(path) - path);
    if (length == 0)
        strcpy(folder, ".");
    else /* without the last separator, but for the root's */
        (void)snprintf(folder, ASCC_NEW_FILE_PATH, "%.*s", length > 1 ? length - 1 : 1, path);
}

/* The file's own path, and the mode it has or 0. NULL, or why nothing can be written there. */
static const char *find_place(const char *path, char real[ASCC_NEW_FILE_PATH], unsigned *mode)
{
    ascc_about about;
    if (strlen(path) + sizeof SUFFIX > ASCC_NEW_FILE_PATH)
        return strerror(ENAMETOOLONG);
    strcpy(real, path);
    const bool there = ascc_system_look(path, &about);
    if (there && about.folder)
        return strerror(EISDIR);
    if (there && !about.regular)
        return "it is no regular file";
    if (there && !ascc_system_may_write(path))
        return strerror(errno);
    *mode = there ? about.mode : 0;
    if (!ascc_system_follow_links(real, ASCC_NEW_FILE_PATH))
        return strerror(errno);
    return strlen(real) + sizeof SUFFIX > ASCC_NEW_FILE_PATH ? strerror(ENAMETOOLONG) : NULL;
}

bool ascc_new_file_check(const char *path, char *error, size_t capacity)
{
    char real[ASCC_NEW_FILE_PATH], folder[ASCC_NEW_FILE_PATH];
    unsigned mode;
    const char *why = find_place(path, real, &mode);
    if (why)
        return fail(path, why, error, capacity);
    ascc_folder_of(real, folder);
    return ascc_system_may_fill(folder) || fail(path, strerror(errno), error, capacity);
}

bool ascc_make_folder(const char *path, char *error, size_t capacity)
{
    ascc_about about;
    bool good = ascc_system_make_folder(path) || errno == EEXIST;
    if (good && ascc_system_look(path, &about) && !about.folder) {
        errno = ENOTDIR;
        good = false;
    }
    good = good && ascc_system_may_fill(path);
    if (!good)
        (void)snprintf(error, capacity, "%.2000s: %s", path, strerror(errno));
    return good;
}

/* ---- The file beside ---- */

bool ascc_new_file_open(ascc_new_file *o, const char *path, char *error, size_t capacity)
{
    unsigned mode = 0;
    o->stream = NULL;
    const char *why = find_place(path, o->path, &mode);
    if (why)
        return fail(path, why, error, capacity);
    (void)snprintf(o->part, sizeof o->part, "%.*s%s", (int)(sizeof o->part - sizeof SUFFIX),
                   o->path, SUFFIX);
    o->stream = ascc_system_create(o->part, mode);
    return o->stream ||
           fail(path, errno == EBUSY ? "another program is writing it" : strerror(errno), error,
                capacity);
}

bool ascc_new_file_close(ascc_new_file *o, bool keep, char *error, size_t capacity)
{
    if (!o->stream)
        return true;
    errno = 0;
    bool good = keep && !ferror(o->stream) && fflush(o->stream) == 0 && ascc_system_sync(o->stream);
    int why = errno;
    if (fclose(o->stream) != 0 && good) {
        why = errno;
        good = false;
    }
    o->stream = NULL;
    char folder[ASCC_NEW_FILE_PATH];
    ascc_folder_of(o->path, folder);
    if (good && !ascc_system_replace(o->part, o->path, folder)) {
        why = errno;
        good = false;
    }
    if (!good)
        ascc_system_remove(o->part);
    return good || !keep ||
           fail(o->path, why ? strerror(why) : "not all was written", error, capacity);
}

FILE *ascc_new_file_scratch(const ascc_new_file *o)
{
    return ascc_system_scratch(o->part);
}
