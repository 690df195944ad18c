/* Files that the program writes: whole or not at all. SPDX-License-Identifier: MIT
 *
 * A file is written into PATH.part and takes its name when it is whole and on disk. A file that was there
 * lends it its mode; links are followed. What is no regular file (a folder, a FIFO, a device) is
 * refused, and so is a PATH.part that another program is writing.
 */
#ifndef ASCC_NEW_FILE_H
#define ASCC_NEW_FILE_H

#include <stdbool.h>
#include <stdio.h>

enum { ASCC_NEW_FILE_PATH = 4096 };

typedef struct ascc_new_file {
    FILE *stream; /* to write, and to read again what was written */
    char path[ASCC_NEW_FILE_PATH], part[ASCC_NEW_FILE_PATH];
} ascc_new_file;

/* False with one line in error[capacity] that has the path and the reason; so is it with all of these. */
bool ascc_new_file_open(ascc_new_file *file, const char *path, char *error, size_t capacity);
/* Gives the file its name, or with keep = false drops it. Of an output that is not open: true. */
bool ascc_new_file_close(ascc_new_file *file, bool keep, char *error, size_t capacity);

/* Could a file be written there? For what is written only after the work. */
bool ascc_new_file_check(const char *path, char *error, size_t capacity);
/* The folder that a path lies in. */
void ascc_folder_of(const char *path, char folder[ASCC_NEW_FILE_PATH]);
/* Makes the folder if it is not there, and tells whether files can be written into it. */
bool ascc_make_folder(const char *path, char *error, size_t capacity);
/* A nameless file on the same disk, gone when it is closed; NULL with errno. */
FILE *ascc_new_file_scratch(const ascc_new_file *file);

#endif
