/* What systems do differently, on Windows. SPDX-License-Identifier: MIT */
#include "system.h"

#include <errno.h>
#include <fcntl.h>
#include <io.h>
#include <share.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <wchar.h>
#include <windows.h>

#include <shellapi.h>

enum { LONGEST = 4096, MAX_TRIES = 100 };

static bool widen(const char *text, wchar_t wide[LONGEST])
{
    if (MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, text, -1, wide, LONGEST) > 0)
        return true;
    errno = GetLastError() == ERROR_INSUFFICIENT_BUFFER ? ENAMETOOLONG : EILSEQ;
    return false;
}

/* From malloc; NULL without memory. */
static char *narrow(const wchar_t *wide)
{
    const int size = WideCharToMultiByte(CP_UTF8, 0, wide, -1, NULL, 0, NULL, NULL);
    char *text = size > 0 ? malloc((size_t)size) : NULL;
    if (text)
        (void)WideCharToMultiByte(CP_UTF8, 0, wide, -1, text, size, NULL, NULL);
    return text;
}

/* The words stay as they are, in the system's code page, where there is no memory. */
static void find_words(int *argc, char ***argv)
{
    int count = 0;
    wchar_t **wide = CommandLineToArgvW(GetCommandLineW(), &count);
    char **words = wide ? calloc((size_t)count + 1, sizeof *words) : NULL;
    bool good = words != NULL;
    for (int i = 0; good && i < count; i++)
        good = (words[i] = narrow(wide[i])) != NULL;
    if (good) {
        *argc = count;
        *argv = words; /* as long as the program runs */
    }
    (void)LocalFree((HLOCAL)wide);
}

void ascc_system_start(int *argc, char ***argv)
{
    find_words(argc, argv);
    _fmode = _O_BINARY;
    (void)_setmode(_fileno(stdin), _O_BINARY);
    (void)_setmode(_fileno(stdout), _O_BINARY);
    (void)_setmode(_fileno(stderr), _O_BINARY);
    (void)SetConsoleOutputCP(CP_UTF8);
}

/* Or on a drive of its own. */
bool ascc_system_is_absolute(const char *path)
{
    return path[0] == '/' || path[0] == '\\' || strchr(path, ':') != NULL;
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
    wchar_t wide[LONGEST];
    struct _stat64 found;
    if (!widen(path, wide) || _wstat64(wide, &found) != 0)
        return false;
    *about = (ascc_about){(found.st_mode & S_IFMT) == S_IFDIR, (found.st_mode & S_IFMT) == S_IFREG,
                          found.st_mode & 0777, (uint64_t)found.st_size};
    return true;
}

bool ascc_system_there(const char *path)
{
    wchar_t wide[LONGEST];
    return widen(path, wide) && _waccess(wide, 0) == 0;
}

static bool identify(const char *path, BY_HANDLE_FILE_INFORMATION *about)
{
    wchar_t wide[LONGEST];
    const DWORD share = FILE_SHARE_READ | FILE_SHARE_WRITE | FILE_SHARE_DELETE;
    if (!widen(path, wide))
        return false;
    HANDLE file =
        CreateFileW(wide, 0, share, NULL, OPEN_EXISTING, FILE_FLAG_BACKUP_SEMANTICS, NULL);
    if (file == INVALID_HANDLE_VALUE)
        return false;
    const bool good = GetFileInformationByHandle(file, about) != 0;
    (void)CloseHandle(file);
    return good;
}

bool ascc_system_same(const char *a, const char *b)
{
    BY_HANDLE_FILE_INFORMATION x, y;
    return identify(a, &x) && identify(b, &y) && x.dwVolumeSerialNumber == y.dwVolumeSerialNumber &&
           x.nFileIndexHigh == y.nFileIndexHigh && x.nFileIndexLow == y.nFileIndexLow;
}

bool ascc_system_may_write(const char *path)
{
    wchar_t wide[LONGEST];
    return widen(path, wide) && _waccess(wide, 2) == 0;
}

bool ascc_system_may_fill(const char *folder)
{
    ascc_about about;
    if (!ascc_system_look(folder, &about))
        return false;
    errno = ENOTDIR;
    return about.folder;
}

bool ascc_system_make_folder(const char *path)
{
    wchar_t wide[LONGEST];
    return widen(path, wide) && _wmkdir(wide) == 0;
}

FILE *ascc_system_open(const char *path, const char *mode)
{
    wchar_t wide[LONGEST], wide_mode[LONGEST];
    return widen(path, wide) && widen(mode, wide_mode) ? _wfopen(wide, wide_mode) : NULL;
}

bool ascc_system_cut(FILE *file, long length)
{
    return _chsize_s(_fileno(file), length) == 0;
}

bool ascc_system_follow_links(char *path, size_t capacity)
{
    (void)path, (void)capacity; /* the system's calls do */
    return true;
}

static int by_bytes(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

/* The folder of a pattern, its separator included, and then the name. */
static char *beside(const char *pattern, const wchar_t *wide_name)
{
    size_t length = strlen(pattern);
    char *name = narrow(wide_name), *path = NULL;
    while (length > 0 && !strchr(ASCC_SEPARATORS, pattern[length - 1]))
        length--;
    if (name && (path = malloc(length + strlen(name) + 1)) != NULL) {
        memcpy(path, pattern, length);
        strcpy(path + length, name);
    }
    free(name);
    return path;
}

/* The system knows patterns in a path's last part alone. */
char **ascc_system_match(const char *folder, const char *pattern, size_t *count)
{
    char whole[LONGEST], **paths = NULL;
    wchar_t wide[LONGEST];
    WIN32_FIND_DATAW found;
    *count = 0;
    if (snprintf(whole, sizeof whole, "%s%s", ascc_system_is_absolute(pattern) ? "" : folder,
                 pattern) >= LONGEST ||
        !widen(whole, wide))
        return NULL;
    HANDLE search = FindFirstFileW(wide, &found);
    if (search == INVALID_HANDLE_VALUE)
        return NULL;
    do {
        char **more = realloc(paths, (*count + 1) * sizeof *paths);
        char *path = more ? beside(whole, found.cFileName) : NULL;
        paths = more ? more : paths;
        if (!path)
            break;
        paths[(*count)++] = path;
    } while (FindNextFileW(search, &found));
    (void)FindClose(search);
    if (paths)
        qsort(paths, *count, sizeof *paths, by_bytes);
    return paths;
}

static FILE *stream_of(int file)
{
    FILE *stream = file < 0 ? NULL : _fdopen(file, "wb+");
    if (file >= 0 && !stream)
        (void)_close(file);
    return stream;
}

FILE *ascc_system_create(const char *path, unsigned mode)
{
    wchar_t wide[LONGEST];
    if (!widen(path, wide))
        return NULL;
    const int file =
        _wsopen(wide, _O_RDWR | _O_CREAT | _O_TRUNC | _O_BINARY | _O_NOINHERIT, _SH_DENYWR,
                mode ? (int)mode & (_S_IREAD | _S_IWRITE) : _S_IREAD | _S_IWRITE);
    if (file < 0 && errno == EACCES && GetFileAttributesW(wide) != INVALID_FILE_ATTRIBUTES)
        errno = EBUSY;
    return stream_of(file);
}

FILE *ascc_system_scratch(const char *path)
{
    wchar_t wide[LONGEST];
    char name[LONGEST];
    for (int i = 0; i < MAX_TRIES; i++) {
        (void)snprintf(name, sizeof name, "%.3900s.%lu.%d", path, GetCurrentProcessId(), i);
        if (!widen(name, wide))
            return NULL;
        const int file =
            _wopen(wide, _O_RDWR | _O_CREAT | _O_EXCL | _O_BINARY | _O_NOINHERIT | _O_TEMPORARY,
                   _S_IREAD | _S_IWRITE);
        if (file >= 0 || errno != EEXIST)
            return stream_of(file);
    }
    return NULL;
}

bool ascc_system_sync(FILE *file)
{
    return _commit(_fileno(file)) == 0;
}

bool ascc_system_replace(const char *from, const char *to, const char *folder)
{
    wchar_t wide_from[LONGEST], wide_to[LONGEST];
    (void)folder; /* the name is on disk when the call returns */
    if (!widen(from, wide_from) || !widen(to, wide_to))
        return false;
    if (MoveFileExW(wide_from, wide_to, MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH))
        return true;
    errno = GetLastError() == ERROR_ACCESS_DENIED ? EACCES : EIO;
    return false;
}

void ascc_system_remove(const char *path)
{
    wchar_t wide[LONGEST];
    if (widen(path, wide))
        (void)_wunlink(wide);
}

bool ascc_system_is_terminal(FILE *stream)
{
    return _isatty(_fileno(stream)) != 0;
}

void ascc_system_become(const char *self, const char *name, char **words)
{
    (void)self;
    (void)name;
    (void)words;
}

bool ascc_system_feed(const char *program, void (*write)(FILE *to, const void *data),
                      const void *data)
{
    char command[128];
    (void)snprintf(command, sizeof command, "where %.40s >NUL 2>&1", program);
    if (system(command) != 0)
        return false;
    (void)snprintf(command, sizeof command, "%.40s >NUL 2>&1", program);
    FILE *pipe = _popen(command, "w");
    if (!pipe)
        return false;
    write(pipe, data);
    return _pclose(pipe) == 0;
}

void ascc_system_on_interrupt(void (*handler)(int number))
{
    (void)signal(SIGINT, handler);
    (void)signal(SIGTERM, handler);
}

int32_t ascc_system_processors(void)
{
    SYSTEM_INFO info;
    GetSystemInfo(&info);
    return info.dwNumberOfProcessors > 0 ? (int32_t)info.dwNumberOfProcessors : 1;
}
