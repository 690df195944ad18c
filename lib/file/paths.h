/* Paths in UTF-8, whatever the system: files to read, the program's own folder, the environment.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_PATHS_H
#define ASCC_PATHS_H

#include <stdio.h>

#include "base/common.h"

#define ASCC_PATH_SIZE 4096

#if defined(_WIN32)
#define ASCC_PATH_SEPARATORS "/\\:" /* the one behind a drive, too */
#define ASCC_PATH_LIST_SEPARATOR ';'

/* The path as Windows takes it; false with errno where it is no UTF-8 or too long. */
bool ascc_path_wide(const char *path, wchar_t wide[ASCC_PATH_SIZE]);
#else
#define ASCC_PATH_SEPARATORS "/"
#define ASCC_PATH_LIST_SEPARATOR ':'
#endif

/* A file to read; NULL with errno. */
FILE *ascc_path_open(const char *path);

/* Is there a regular file? */
bool ascc_path_is_file(const char *path);

/* Folder that the running program lies in, links followed; false where the system does not tell. */
bool ascc_path_program_folder(char folder[ASCC_PATH_SIZE]);

/* A variable of the environment; false if it is not set, empty or too long. */
bool ascc_path_environment(const char *name, char value[ASCC_PATH_SIZE]);

#endif
