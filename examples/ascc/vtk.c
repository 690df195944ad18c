/* VTK XML: a text that describes arrays, then their little-endian bytes. SPDX-License-Identifier: MIT
 *
 * Each array is a block behind the text: its length in 8 bytes, then its numbers. The text tells where in the
 * blocks each one begins.
 */
#include "vtk.h"
#include "little_endian.h"
#include "new_file.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>

/* What is written of a cloud; walls are a cloud whose velocities are the normals. */
enum { POINTS, VECTORS, SPEED, ID, CONNECTIVITY, OFFSETS, ARRAYS };

static const struct {
    const char *type;
    size_t size, components; /* of a number, bytes; of a row */
} layout[ARRAYS] = {{"Float32", 4, 3}, {"Float32", 4, 3}, {"Float32", 4, 1},
                    {"Int64", 8, 1},   {"Int32", 4, 1},   {"Int32", 4, 1}};

static size_t row_size(int which)
{
    return layout[which].size * layout[which].components;
}

/* One row of an array; returns its bytes. */
static size_t put_row(unsigned char *row, const ascc_cloud *cloud, int which, size_t i)
{
    const float *values = which == POINTS ? cloud->position : cloud->velocity;
    double square = 0.0;
    switch (which) {
    case SPEED:
        for (size_t c = 0; c < 3; c++)
            square += pow((double)ascc_cloud_at(cloud, values, i, c), 2.0);
        ascc_put_float(row, (float)sqrt(square));
        break;
    case ID:
        ascc_put_long(row, cloud->id[i]);
        break;
    case CONNECTIVITY:
        ascc_put_word(row, (uint32_t)i);
        break;
    case OFFSETS:
        ascc_put_word(row, (uint32_t)i + 1);
        break;
    default:
        for (size_t c = 0; c < 3; c++)
            ascc_put_float(row + 4 * c, ascc_cloud_at(cloud, values, i, c));
    }
    return row_size(which);
}

static bool write_block(FILE *out, const ascc_cloud *cloud, int which)
{
    unsigned char row[16];
    ascc_put_long(row, (uint64_t)cloud->count * row_size(which));
    bool good = fwrite(row, 1, 8, out) == 8;
    for (size_t i = 0; good && i < cloud->count; i++) {
        const size_t size = put_row(row, cloud, which, i);
        good = fwrite(row, 1, size, out) == size;
    }
    return good;
}

/* Describes an array whose block begins at *offset, and moves *offset behind it. */
static bool describe(FILE *out, const ascc_cloud *cloud, int which, const char *name,
                     size_t *offset)
{
    const size_t at = *offset;
    *offset += 8 + cloud->count * row_size(which);
    return fprintf(out,
                   "<DataArray type=\"%s\" Name=\"%s\" NumberOfComponents=\"%zu\" "
                   "format=\"appended\" offset=\"%zu\"/>\n",
                   layout[which].type, name, layout[which].components, at) > 0;
}

/* The text: of a cloud with speed and id, or of walls. */
static bool write_text(FILE *out, const ascc_cloud *cloud, bool walls)
{
    size_t offset = 0;
    bool good = fprintf(out, "<?xml version=\"1.0\"?>\n"
                             "<VTKFile type=\"PolyData\" version=\"1.0\" "
                             "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
                             "<PolyData>\n") > 0;
    if (!walls)
        good = good && fprintf(out,
                               "<FieldData>\n<DataArray type=\"Float64\" Name=\"TimeValue\" "
                               "NumberOfTuples=\"1\" format=\"ascii\">%.17g</DataArray>\n"
                               "</FieldData>\n",
                               cloud->time) > 0;
    good = good &&
           fprintf(out,
                   "<Piece NumberOfPoints=\"%zu\" NumberOfVerts=\"%zu\" NumberOfLines=\"0\" "
                   "NumberOfStrips=\"0\" NumberOfPolys=\"0\">\n<Points>\n",
                   cloud->count, cloud->count) > 0 &&
           describe(out, cloud, POINTS, "Points", &offset) &&
           fprintf(out, "</Points>\n<PointData %s>\n",
                   walls ? "Normals=\"Normals\"" : "Vectors=\"velocity\" Scalars=\"speed\"") > 0 &&
           describe(out, cloud, VECTORS, walls ? "Normals" : "velocity", &offset);
    if (!walls)
        good = good && describe(out, cloud, SPEED, "speed", &offset) &&
               describe(out, cloud, ID, "id", &offset);
    return good && fprintf(out, "</PointData>\n<Verts>\n") > 0 &&
           describe(out, cloud, CONNECTIVITY, "connectivity", &offset) &&
           describe(out, cloud, OFFSETS, "offsets", &offset) &&
           fprintf(out, "</Verts>\n</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_") > 0;
}

static bool write_cloud(const char *path, const ascc_cloud *cloud, bool walls, char *error,
                        size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    bool good = write_text(output.stream, cloud, walls);
    for (int which = 0; which < ARRAYS; which++)
        if (!walls || (which != SPEED && which != ID))
            good = good && write_block(output.stream, cloud, which);
    good = good && fprintf(output.stream, "\n</AppendedData>\n</VTKFile>\n") > 0;
    if (!good)
        (void)snprintf(error, capacity, "%s: cannot be written: %s", path, strerror(errno));
    return ascc_new_file_close(&output, good, error, capacity) && good;
}

bool ascc_vtp_write(const char *path, const ascc_cloud *cloud, char *error, size_t capacity)
{
    return write_cloud(path, cloud, false, error, capacity);
}

bool ascc_vtp_write_walls(const char *path, int32_t dimension, const float *position,
                          const float *normal, size_t count, char *error, size_t capacity)
{
    const ascc_cloud walls = {
        .dimension = dimension, .count = count, .position = position, .velocity = normal};
    return write_cloud(path, &walls, true, error, capacity);
}

bool ascc_pvd_write(const char *path, size_t frames, size_t every, double time_step, char *error,
                    size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    FILE *out = output.stream;
    bool good = fprintf(out, "<?xml version=\"1.0\"?>\n"
                             "<VTKFile type=\"Collection\" version=\"1.0\">\n<Collection>\n") > 0;
    for (size_t i = 0; good && i < frames; i++)
        good = fprintf(out, "<DataSet timestep=\"%.17g\" part=\"0\" file=\"frame_%05zu.vtp\"/>\n",
                       (double)(i * every) * time_step, i * every) > 0;
    good = good && fprintf(out, "</Collection>\n</VTKFile>\n") > 0;
    if (!good)
        (void)snprintf(error, capacity, "%s: cannot be written: %s", path, strerror(errno));
    return ascc_new_file_close(&output, good, error, capacity) && good;
}
