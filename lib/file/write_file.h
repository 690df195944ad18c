/* Writes a file whole or not at all: beside its place, synced, renamed.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_WRITE_FILE_H
#define ASCC_WRITE_FILE_H

#include "base/common.h"

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

#endif
