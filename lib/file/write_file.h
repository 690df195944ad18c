/* Writes a file whole or not at all: beside its place, synced, renamed.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_WRITE_FILE_H
#define ASCC_WRITE_FILE_H

#include "base/common.h"
#include "paths.h"

typedef struct ascc_bytes {
    const void *data;
    size_t size;
} ascc_bytes;

/* piece[count], one behind the other, become the file `path`. A file that was there is replaced in one
 * instant and lends the new one its mode; links are followed. A folder, a FIFO, a device and a file
 * that may not be written are refused. On failure nothing is left beside, and what was there is as it
 * was; only where the folder cannot be synced the new file is there, whole, but may not outlive a loss of
 * power. errors: FILE, the message has the reason and the path. */
ascc_status ascc_write_file(const char *path, const ascc_bytes *piece, size_t count,
                            ascc_message *message);

/* The same by and by. */
typedef struct ascc_file_place {
    char path[ASCC_PATH_SIZE];   /* of the file, links followed */
    char folder[ASCC_PATH_SIZE]; /* that it lies in */
    char part[ASCC_PATH_SIZE];   /* where it is written */
    unsigned mode;               /* of the file that is there */
    bool there;
} ascc_file_place;

typedef struct ascc_file_writer {
    const char *path; /* as given; the caller's */
    ascc_file_place place;
    int number; /* -1: ended */
} ascc_file_writer;

/* After a failure of any of these it has ended, and nothing is left. errors: FILE. */
ascc_status ascc_file_begin(ascc_file_writer *file, const char *path, ascc_message *message);
ascc_status ascc_file_add(ascc_file_writer *file, const void *data, size_t size,
                          ascc_message *message);
ascc_status ascc_file_finish(ascc_file_writer *file, ascc_message *message);
void ascc_file_drop(ascc_file_writer *file);

#endif
