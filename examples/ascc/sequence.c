/* Sequence files: safetensors with a checked header, streamed out frame by frame.
 * SPDX-License-Identifier: MIT */
#include "sequence.h"
#include "console.h"
#include "new_file.h"

#include <errno.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "tensor_file.h"

#define HEADER_ROOM 8192 /* reserved for the header of a file that is being written */

/* Where messages go. */
typedef struct report {
    const char *path;
    char *error;
    size_t capacity;
} report;

static bool fail(const report *r, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    (void)snprintf(r->error, r->capacity, "%s: %s", r->path, text);
    ascc_printable(r->error); /* much of it is the file's */
    return false;
}

/* ---- Reading: bytes and header ---- */

typedef struct file {
    unsigned char *bytes;
    size_t size, data; /* where tensor data begins */
    json_t *header;
    report report;
} file;

static bool open_file(file *f)
{
    char why[300];
    f->bytes = ascc_tensor_file_read(f->report.path, &f->size, why, sizeof why);
    if (f->bytes)
        f->header = ascc_tensor_file_header(f->bytes, f->size, &f->data, why, sizeof why);
    return f->header || fail(&f->report, "%s", why);
}

static void close_file(file *f)
{
    json_decref(f->header);
    free(f->bytes);
}

/* ---- Reading: metadata ---- */

static const char *text_of(const file *f, const char *key)
{
    return ascc_tensor_file_metadata(f->header, key);
}

static bool numbers(const file *f, const char *key, size_t count, double *values)
{
    const char *text = text_of(f, key);
    if (!text)
        return fail(&f->report, "the metadata has no %s", key);
    for (size_t i = 0; i < count; i++) {
        char *end;
        values[i] = strtod(text, &end);
        if (end == text || !isfinite(values[i]))
            return fail(&f->report, "metadata %s = '%s': %zu finite numbers are wanted", key,
                        text_of(f, key), count);
        text = end;
    }
    while (*text == ' ')
        text++;
    return *text == '\0' || fail(&f->report, "metadata %s = '%s': %zu numbers are wanted", key,
                                 text_of(f, key), count);
}

/* Limits beyond all scenes, and so that energies of finite positions and velocities are finite. */
static bool within(const file *f, const char *key, size_t count, double low, double high,
                   double *values)
{
    if (!numbers(f, key, count, values))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!(values[i] >= low && values[i] <= high))
            return fail(&f->report, "metadata %s = %g is not within %g and %g", key, values[i], low,
                        high);
    return true;
}

static bool read_metadata(const file *f, ascc_sequence *s)
{
    double dimension, version;
    const char *format = text_of(f, "format");
    if (!format || strcmp(format, "ascc.sequence") != 0)
        return fail(&f->report, "metadata format is '%s', not 'ascc.sequence'",
                    format ? format : "");
    if (!numbers(f, "version", 1, &version) || !numbers(f, "dim", 1, &dimension))
        return false;
    if (version != 1.0)
        return fail(&f->report, "version %g is not known", version);
    if (dimension != 2.0 && dimension != 3.0)
        return fail(&f->report, "metadata dim = %g: 2 or 3 is wanted", dimension);
    s->dimension = (int32_t)dimension;
    if (!within(f, "dt", 1, 1e-9, 1e6, &s->time_step) ||
        !within(f, "particle_radius", 1, 1e-7, 1e6, &s->radius) ||
        !within(f, "particle_mass", 1, 1e-30, 1e30, &s->mass) ||
        !within(f, "rest_density", 1, 1e-6, 1e9, &s->rest_density) ||
        !within(f, "gravity", (size_t)s->dimension, -1e6, 1e6, s->gravity))
        return false;
    const char *source = text_of(f, "source");
    (void)snprintf(s->source, sizeof s->source, "%s", source ? source : "");
    return true;
}

/* ---- Reading: tensors ---- */

static size_t rank_of(const file *f, const char *name)
{
    return json_array_size(json_object_get(json_object_get(f->header, name), "shape"));
}

/* An F32 tensor of rank `rank` whose last extent is the dimension; copies its values. */
static bool tensor(const file *f, const char *name, size_t rank, size_t dimension, size_t shape[3],
                   float **values)
{
    const json_t *entry = json_object_get(f->header, name);
    if (!entry)
        return fail(&f->report, "tensor %s is missing", name);
    const char *type = json_string_value(json_object_get(entry, "dtype"));
    if (!type || strcmp(type, "F32") != 0)
        return fail(&f->report, "tensor %s has type %s, not F32", name, type ? type : "?");
    const json_t *sizes = json_object_get(entry, "shape"),
                 *offsets = json_object_get(entry, "data_offsets");
    if (json_array_size(sizes) != rank || json_array_size(offsets) != 2)
        return fail(&f->report, "tensor %s: a shape of %zu numbers and two offsets are wanted",
                    name, rank);
    size_t bytes = sizeof(float);
    for (size_t i = 0; i < rank; i++) {
        const json_int_t n = json_integer_value(json_array_get(sizes, i));
        if (!json_is_integer(json_array_get(sizes, i)) || n < 0 ||
            (n > 0 && bytes > f->size / (size_t)n && bytes > 0))
            return fail(&f->report, "tensor %s: its shape does not fit the file", name);
        shape[i] = (size_t)n;
        bytes *= (size_t)n;
    }
    if (shape[rank - 1] != dimension)
        return fail(&f->report, "tensor %s: its last extent is %zu, the dimension is %zu", name,
                    shape[rank - 1], dimension);
    const json_int_t begin = json_integer_value(json_array_get(offsets, 0)),
                     end = json_integer_value(json_array_get(offsets, 1));
    if (!json_is_integer(json_array_get(offsets, 0)) ||
        !json_is_integer(json_array_get(offsets, 1)) || begin < 0 || end < begin ||
        (size_t)end > f->size - f->data || (size_t)(end - begin) != bytes)
        return fail(&f->report, "tensor %s: its offsets do not hold its shape", name);
    *values = malloc(bytes + 1);
    if (!*values)
        return fail(&f->report, "no memory for tensor %s", name);
    memcpy(*values, f->bytes + f->data + (size_t)begin, bytes);
    for (size_t i = 0; i < bytes / sizeof(float); i++)
        if (!isfinite((*values)[i]))
            return fail(&f->report, "tensor %s: value %zu is not finite", name, i);
    return true;
}

/* [M, dim], walls at rest, or [T, M, dim]. */
static bool read_walls(const file *f, ascc_sequence *s)
{
    const size_t d = (size_t)s->dimension, rank = rank_of(f, "boundary.position") == 3 ? 3 : 2;
    size_t c[3], e[3];
    if (!tensor(f, "boundary.position", rank, d, c, &s->wall) ||
        !tensor(f, "boundary.normal", rank, d, e, &s->normal))
        return false;
    s->walls = c[rank - 2];
    s->walls_move = rank == 3;
    if (s->walls_move && c[0] != s->frames)
        return fail(&f->report, "tensor boundary.position has %zu frames, fluid.position %zu", c[0],
                    s->frames);
    return (e[rank - 2] == s->walls && (rank == 2 || e[0] == c[0])) ||
           fail(&f->report, "tensor boundary.normal has %zu rows, boundary.position %zu",
                e[rank - 2], s->walls);
}

static bool read_tensors(const file *f, ascc_sequence *s)
{
    const size_t d = (size_t)s->dimension;
    size_t a[3], b[3];
    if (!tensor(f, "fluid.position", 3, d, a, &s->position) ||
        !tensor(f, "fluid.velocity", 3, d, b, &s->velocity))
        return false;
    s->frames = a[0];
    s->count = a[1];
    s->velocity_frames = b[0];
    if (!s->frames)
        return fail(&f->report, "tensor fluid.position has no frames");
    if (b[1] != s->count || (b[0] != 1 && b[0] != s->frames))
        return fail(&f->report, "tensor fluid.velocity is [%zu, %zu], fluid.position is [%zu, %zu]",
                    b[0], b[1], s->frames, s->count);
    if (!read_walls(f, s))
        return false;
    const char *layers = text_of(f, "boundary_layers");
    s->first_layer = layers ? (size_t)strtoul(layers, NULL, 10) : s->walls;
    if (s->first_layer > s->walls)
        s->first_layer = s->walls;
    return true;
}

bool ascc_sequence_read(const char *path, ascc_sequence *sequence, char *error, size_t capacity)
{
    memset(sequence, 0, sizeof *sequence);
    file f = {.report = {path, error, capacity}};
    const bool good = open_file(&f) && read_metadata(&f, sequence) && read_tensors(&f, sequence);
    close_file(&f);
    if (!good)
        ascc_sequence_free(sequence);
    return good;
}

void ascc_sequence_free(ascc_sequence *sequence)
{
    free(sequence->position);
    free(sequence->velocity);
    free(sequence->wall);
    free(sequence->normal);
    memset(sequence, 0, sizeof *sequence);
}

void ascc_sequence_velocities(const ascc_sequence *s, size_t frame, float *velocity)
{
    const size_t n = s->count * (size_t)s->dimension;
    if (frame == 0 || s->velocity_frames == s->frames) {
        memcpy(velocity, s->velocity + frame * n, n * sizeof *velocity);
        return;
    }
    for (size_t k = 0; k < n; k++)
        velocity[k] = (float)(((double)s->position[frame * n + k] -
                               (double)s->position[(frame - 1) * n + k]) /
                              s->time_step);
}

/* ---- Writing ---- */

struct ascc_sequence_writer {
    ascc_new_file output;  /* positions behind room for the header */
    FILE *velocities;      /* apart till the end */
    FILE *walls, *normals; /* likewise, where they move */
    ascc_sequence header;  /* walls copied */
    bool all_velocities;
    size_t wall_frames; /* appended, of walls that move */
    bool broken;        /* a frame was written in part */
};

static bool out_of_order(const report *r)
{
    return fail(r, "cannot be written: %s", strerror(errno));
}

static float *copied(const float *from, size_t count)
{
    float *to = malloc(count * sizeof *to + 1);
    if (to && count)
        memcpy(to, from, count * sizeof *to);
    return to;
}

static void free_writer(ascc_sequence_writer *w)
{
    FILE *const apart[] = {w->velocities, w->walls, w->normals};
    for (size_t i = 0; i < sizeof apart / sizeof *apart; i++)
        if (apart[i])
            (void)fclose(apart[i]);
    free(w->header.wall);
    free(w->header.normal);
    free(w);
}

ascc_sequence_writer *ascc_sequence_create(const char *path, const ascc_sequence *header,
                                           bool all_velocities, char *error, size_t capacity)
{
    const report r = {path, error, capacity};
    ascc_sequence_writer *w = calloc(1, sizeof *w);
    if (!w) {
        (void)fail(&r, "no memory");
        return NULL;
    }
    const size_t walls = header->walls_move ? 0 : header->walls * (size_t)header->dimension;
    w->header = *header;
    w->header.position = w->header.velocity = NULL;
    w->header.frames = w->header.velocity_frames = 0;
    w->header.wall = copied(header->wall, walls);
    w->header.normal = copied(header->normal, walls);
    w->all_velocities = all_velocities;
    bool good = w->header.wall && w->header.normal;
    if (!good)
        (void)fail(&r, "no memory");
    good = good && ascc_new_file_open(&w->output, path, error, capacity);
    if (good) {
        static const char room[HEADER_ROOM];
        w->velocities = ascc_new_file_scratch(&w->output);
        if (header->walls_move) {
            w->walls = ascc_new_file_scratch(&w->output);
            w->normals = ascc_new_file_scratch(&w->output);
        }
        good = w->velocities && (!header->walls_move || (w->walls && w->normals)) &&
               fwrite(room, 1, sizeof room, w->output.stream) == sizeof room;
        if (!good)
            (void)out_of_order(&r);
    }
    if (good)
        return w;
    (void)ascc_new_file_close(&w->output, false, error, capacity);
    free_writer(w);
    return NULL;
}

bool ascc_sequence_append(ascc_sequence_writer *w, const float *position, const float *velocity,
                          char *error, size_t capacity)
{
    const report r = {w->output.path, error, capacity};
    const size_t n = w->header.count * (size_t)w->header.dimension;
    const bool moving = w->all_velocities || w->header.frames == 0;
    w->broken = w->broken || fwrite(position, sizeof(float), n, w->output.stream) != n ||
                (moving && fwrite(velocity, sizeof(float), n, w->velocities) != n);
    if (w->broken)
        return out_of_order(&r);
    w->header.velocity_frames += moving;
    w->header.frames++;
    return true;
}

bool ascc_sequence_append_walls(ascc_sequence_writer *w, const float *wall, const float *normal,
                                char *error, size_t capacity)
{
    const report r = {w->output.path, error, capacity};
    const size_t n = w->header.walls * (size_t)w->header.dimension;
    w->broken = w->broken || fwrite(wall, sizeof(float), n, w->walls) != n ||
                fwrite(normal, sizeof(float), n, w->normals) != n;
    if (w->broken)
        return out_of_order(&r);
    w->wall_frames++;
    return true;
}

static bool append_file(FILE *to, FILE *from)
{
    char block[65536];
    size_t n;
    rewind(from);
    while ((n = fread(block, 1, sizeof block, from)) > 0)
        if (fwrite(block, 1, n, to) != n)
            return false;
    return !ferror(from);
}

static void metadata_number(json_t *metadata, const char *key, double value)
{
    char text[40];
    (void)snprintf(text, sizeof text, "%.9g", value);
    json_object_set_new(metadata, key, json_string(text));
}

static void entry(json_t *header, const char *name, json_t *shape, size_t *offset, size_t floats)
{
    const size_t end = *offset + floats * sizeof(float);
    json_object_set_new(header, name,
                        json_pack("{s:s, s:o, s:[I, I]}", "dtype", "F32", "shape", shape,
                                  "data_offsets", (json_int_t)*offset, (json_int_t)end));
    *offset = end;
}

static char *header_text(const ascc_sequence_writer *w)
{
    const ascc_sequence *h = &w->header;
    const json_int_t d = h->dimension, n = (json_int_t)h->count, m = (json_int_t)h->walls;
    const size_t row = h->count * (size_t)h->dimension;
    const size_t frames = h->walls_move ? h->frames : 1, wall = frames * h->walls * (size_t)d;
    json_t *header = json_object(), *metadata = json_object();
    json_object_set_new(metadata, "format", json_string("ascc.sequence"));
    json_object_set_new(metadata, "version", json_string("1"));
    metadata_number(metadata, "dim", h->dimension);
    metadata_number(metadata, "dt", h->time_step);
    metadata_number(metadata, "particle_radius", h->radius);
    metadata_number(metadata, "particle_mass", h->mass);
    metadata_number(metadata, "rest_density", h->rest_density);
    char text[160];
    int length = 0;
    for (int c = 0; c < h->dimension; c++)
        length += snprintf(text + length, sizeof text - (size_t)length, "%s%.9g", c ? " " : "",
                           h->gravity[c]);
    json_object_set_new(metadata, "gravity", json_string(text));
    if (h->first_layer && h->first_layer < h->walls) {
        (void)snprintf(text, sizeof text, "%zu %zu", h->first_layer, h->walls - h->first_layer);
        json_object_set_new(metadata, "boundary_layers", json_string(text));
    }
    json_t *source = json_string(h->source);
    json_object_set_new(metadata, "source", source ? source : json_string("unknown"));
    json_object_set_new(header, "__metadata__", metadata);
    size_t offset = 0;
    entry(header, "fluid.position", json_pack("[I, I, I]", (json_int_t)h->frames, n, d), &offset,
          h->frames * row);
    entry(header, "fluid.velocity", json_pack("[I, I, I]", (json_int_t)h->velocity_frames, n, d),
          &offset, h->velocity_frames * row);
    static const char *const walls[] = {"boundary.position", "boundary.normal"};
    for (int i = 0; i < 2; i++)
        entry(header, walls[i],
              h->walls_move ? json_pack("[I, I, I]", (json_int_t)h->frames, m, d)
                            : json_pack("[I, I]", m, d),
              &offset, wall);
    char *written = json_dumps(header, JSON_COMPACT);
    json_decref(header);
    return written;
}

/* The header fills the room kept for it: JSON may end in spaces. */
static bool write_header(ascc_sequence_writer *w)
{
    char *text = header_text(w);
    const size_t length = text ? strlen(text) : HEADER_ROOM;
    if (length > HEADER_ROOM - 8) {
        free(text);
        errno = EOVERFLOW;
        return false;
    }
    unsigned char room[HEADER_ROOM];
    memset(room, ' ', sizeof room);
    for (int i = 0; i < 8; i++)
        room[i] = (unsigned char)((uint64_t)(HEADER_ROOM - 8) >> 8 * i);
    memcpy(room + 8, text, length);
    free(text);
    return fseek(w->output.stream, 0, SEEK_SET) == 0 &&
           fwrite(room, 1, sizeof room, w->output.stream) == sizeof room;
}

static bool append_walls(ascc_sequence_writer *w)
{
    const size_t walls = w->header.walls * (size_t)w->header.dimension;
    FILE *out = w->output.stream;
    if (w->header.walls_move)
        return w->wall_frames == w->header.frames && append_file(out, w->walls) &&
               append_file(out, w->normals);
    return fwrite(w->header.wall, sizeof(float), walls, out) == walls &&
           fwrite(w->header.normal, sizeof(float), walls, out) == walls;
}

bool ascc_sequence_finish(ascc_sequence_writer *w, bool keep, char *error, size_t capacity)
{
    if (!w)
        return false;
    const report r = {w->output.path, error, capacity};
    bool good = !keep || (!w->broken && append_file(w->output.stream, w->velocities) &&
                          append_walls(w) && write_header(w));
    if (!good)
        (void)out_of_order(&r);
    good = ascc_new_file_close(&w->output, keep && good, error, capacity) && good;
    free_writer(w);
    return good;
}
