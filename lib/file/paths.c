/* Paths in UTF-8, whatever the system: files to read, the program's own folder, the environment.
 * SPDX-License-Identifier: MIT */
#include "paths.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#if defined(_WIN32)
#include <windows.h>

bool ascc_path_wide(const char *path, wchar_t wide[ASCC_PATH_SIZE])
{
    if (MultiByteToWideChar(CP_UTF8, MB_ERR_INVALID_CHARS, path, -1, wide, ASCC_PATH_SIZE) > 0)
        return true;
    errno = GetLastError() == ERROR_INSUFFICIENT_BUFFER ? ENAMETOOLONG : EILSEQ;
    return false;
}

static bool narrow(const wchar_t *wide, char path[ASCC_PATH_SIZE])
{
    return WideCharToMultiByte(CP_UTF8, 0, wide, -1, path, ASCC_PATH_SIZE, NULL, NULL) > 0;
}

FILE *ascc_path_open(const char *path)
{
    wchar_t wide[ASCC_PATH_SIZE];
    return ascc_path_wide(path, wide) ? _wfopen(wide, L"rb") : NULL;
}

bool ascc_path_is_file(const char *path)
{
    wchar_t wide[ASCC_PATH_SIZE];
    if (!ascc_path_wide(path, wide))
        return false;
    const DWORD about = GetFileAttributesW(wide);
    return about != INVALID_FILE_ATTRIBUTES && !(about & FILE_ATTRIBUTE_DIRECTORY);
}

static bool program_path(char path[ASCC_PATH_SIZE])
{
    wchar_t wide[ASCC_PATH_SIZE];
    const DWORD length = GetModuleFileNameW(NULL, wide, ASCC_PATH_SIZE);
    return length > 0 && length < ASCC_PATH_SIZE && narrow(wide, path);
}

bool ascc_path_environment(const char *name, char value[ASCC_PATH_SIZE])
{
    wchar_t wide_name[ASCC_PATH_SIZE], wide[ASCC_PATH_SIZE];
    if (!ascc_path_wide(name, wide_name))
        return false;
    const DWORD length = GetEnvironmentVariableW(wide_name, wide, ASCC_PATH_SIZE);
    return length > 0 && length < ASCC_PATH_SIZE && narrow(wide, value);
}
#else
#include <unistd.h>

FILE *ascc_path_open(const char *path)
{
    return fopen(path, "rb");
}

bool ascc_path_is_file(const char *path)
{
    struct stat about;
    return stat(path, &about) == 0 && S_ISREG(about.st_mode);
}

static bool program_path(char path[ASCC_PATH_SIZE])
{
    const ssize_t length = readlink("/proc/self/exe", path, ASCC_PATH_SIZE - 1);
    if (length <= 0 || length == ASCC_PATH_SIZE - 1)
        return false;
    path[length] = '\0';
    return true;
}

bool ascc_path_environment(const char *name, char value[ASCC_PATH_SIZE])
{
    const char *found = getenv(name);
    const size_t length = found ? strlen(found) : 0;
    if (length == 0 || length >= ASCC_PATH_SIZE)
        return false;
    memcpy(value, found, length + 1);
    return true;
}
#endif

bool ascc_path_program_folder(char folder[ASCC_PATH_SIZE])
{
    if (!program_path(folder))
        return false;
    size_t length = strlen(folder);
    while (length > 0 && !strchr(ASCC_PATH_SEPARATORS, folder[length - 1]))
        length--;
    if (length == 0)
        return false;
    folder[length - 1] = '\0';
    return true;
}
