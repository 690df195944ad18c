/* PLY: a text header and packed little-endian rows. SPDX-License-Identifier: MIT */
#include "ply.h"
#include "little_endian.h"
#include "new_file.h"

#include <errno.h>
#include <stdio.h>

bool ascc_ply_write(const char *path, const ascc_cloud *cloud, char *error, size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    FILE *out = output.stream;
    bool good = fprintf(out,
                        "ply\nformat binary_little_endian 1.0\nelement vertex %zu\n"
                        "property float x\nproperty float y\nproperty float z\n"
                        "property float nx\nproperty float ny\nproperty float nz\n"
                        "property float vx\nproperty float vy\nproperty float vz\n"
                        "property uint id\nend_header\n",
                        cloud->count) > 0;
    for (size_t i = 0; good && i < cloud->count; i++) {
        unsigned char row[40];
        for (size_t c = 0; c < 3; c++) {
            const float v = ascc_cloud_at(cloud, cloud->velocity, i, c);
            ascc_put_float(row + 4 * c, ascc_cloud_at(cloud, cloud->position, i, c));
            ascc_put_float(row + 12 + 4 * c, v);
            ascc_put_float(row + 24 + 4 * c, v);
        }
        ascc_put_word(row + 36, (uint32_t)cloud->id[i]);
        good = fwrite(row, 1, sizeof row, out) == sizeof row;
    }
    if (!good)
        (void)snprintf(error, capacity, "%s: cannot be written: %s", path, strerror(errno));
    return ascc_new_file_close(&output, good, error, capacity) && good;
}
