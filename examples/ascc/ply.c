/* PLY: a text header and packed little-endian rows. SPDX-License-Identifier: MIT */
#include "ply.h"
#include "new_file.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static void put_word(unsigned char *to, uint32_t word)
{
    for (int i = 0; i < 4; i++)
        to[i] = (unsigned char)(word >> 8 * i);
}

static void put_float(unsigned char *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    put_word(to, bits);
}

bool ascc_ply_write(const char *path, int32_t dimension, const float *position,
                    const float *velocity, const uint64_t *id, size_t count, char *error,
                    size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    FILE *out = output.stream;
    bool good = fprintf(out,
                        "ply\nformat binary_little_endian 1.0\nelement vertex %zu\n"
                        "property float x\nproperty float y\nproperty float z\n"
                        "property float vx\nproperty float vy\nproperty float vz\n"
                        "property uint id\nend_header\n",
                        count) > 0;
    const size_t d = (size_t)dimension;
    for (size_t i = 0; good && i < count; i++) {
        unsigned char row[28];
        for (size_t c = 0; c < 3; c++) {
            put_float(row + 4 * c, c < d ? position[i * d + c] : 0.0f);
            put_float(row + 12 + 4 * c, c < d ? velocity[i * d + c] : 0.0f);
        }
        put_word(row + 24, (uint32_t)id[i]);
        good = fwrite(row, 1, sizeof row, out) == sizeof row;
    }
    if (!good)
        (void)snprintf(error, capacity, "%s: cannot be written: %s", path, strerror(errno));
    return ascc_new_file_close(&output, good, error, capacity) && good;
}
