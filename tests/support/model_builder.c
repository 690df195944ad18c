/* Builds model files in memory for tests. SPDX-License-Identifier: MIT */
#include "model_builder.h"

#include "../../examples/demo_model.h"

#include <math.h>
#include <stdarg.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* ---- Text --------------------------------------------------------------------------------------- */

static void reserve(model_text *text, size_t more)
{
    if (text->length + more <= text->capacity)
        return;
    text->capacity = 2 * (text->length + more);
    text->text = realloc(text->text, text->capacity);
    if (!text->text)
        abort();
}

void model_text_add(model_text *text, const char *format, ...)
{
    va_list arguments, again;
    va_start(arguments, format);
    va_copy(again, arguments);
    char probe[1];
    const int length = vsnprintf(probe, sizeof probe, format, arguments);
    va_end(arguments);
    reserve(text, (size_t)length + 1);
    vsnprintf(text->text + text->length, (size_t)length + 1, format, again);
    va_end(again);
    text->length += (size_t)length;
}

static void add_bytes(model_text *text, const void *bytes, size_t size)
{
    reserve(text, size + 1);
    if (size > 0)
        memcpy(text->text + text->length, bytes, size);
    text->length += size;
    text->text[text->length] = '\0';
}

void model_text_free(model_text *text)
{
    free(text->text);
    *text = (model_text){NULL, 0, 0};
}

const char *model_number(double value)
{
    static _Thread_local char buffers[8][32];
    static _Thread_local unsigned next;
    char raw[32], *text = buffers[next++ % 8];
    size_t used = 0;
    snprintf(raw, sizeof raw, "%.17g", value);
    for (const char *c = raw; *c != '\0'; c++) {
        if (strchr("0123456789+-e", *c))
            text[used++] = *c;
        else if (used > 0 && text[used - 1] != '.')
            text[used++] = '.';
    }
    text[used] = '\0';
    return text;
}

static void add_escaped(model_text *text, const char *value)
{
    for (; *value != '\0'; value++) {
        if (*value == '"' || *value == '\\')
            add_bytes(text, "\\", 1);
        add_bytes(text, value, 1);
    }
}

/* ---- Files -------------------------------------------------------------------------------------- */

void model_builder_open(model_builder *builder)
{
    memset(builder, 0, sizeof *builder);
}

void model_builder_metadata(model_builder *builder, const char *key, const char *value)
{
    model_text_add(&builder->metadata, "%s\"%s\":\"", builder->metadata.length ? "," : "", key);
    add_escaped(&builder->metadata, value);
    model_text_add(&builder->metadata, "\"");
}

/* A float cut to a binary16; 0 below its normal range. */
static uint32_t half_of(uint32_t bits)
{
    const uint32_t sign = bits >> 16 & 0x8000u, size = bits & 0x7fffffffu;
    return size < 113u << 23 ? sign : sign | (size - (112u << 23)) >> 13;
}

void model_builder_tensor(model_builder *builder, const char *name, int rank, const size_t *shape,
                          const float *values)
{
    size_t count = 1;
    const size_t begin = builder->data.length;
    const char *type = builder->type ? builder->type : "F32";
    model_text_add(&builder->tensors, ",\"%s\":{\"dtype\":\"%s\",\"shape\":[", name, type);
    for (int i = 0; i < rank; i++) {
        model_text_add(&builder->tensors, "%s%zu", i ? "," : "", shape[i]);
        count *= shape[i];
    }
    for (size_t i = 0; i < count; i++) {
        uint32_t bits;
        memcpy(&bits, &values[i], sizeof bits);
        if (builder->coarse)
            bits &= (bits & 0x7fffffffu) < 113u << 23 ? 0 : 0xffff0000u;
        const unsigned char bytes[4] = {(unsigned char)bits, (unsigned char)(bits >> 8),
                                        (unsigned char)(bits >> 16), (unsigned char)(bits >> 24)};
        const uint32_t half = half_of(bits);
        const unsigned char short_bytes[2] = {(unsigned char)half, (unsigned char)(half >> 8)};
        if (strcmp(type, "F16") == 0)
            add_bytes(&builder->data, short_bytes, 2);
        else if (strcmp(type, "BF16") == 0)
            add_bytes(&builder->data, bytes + 2, 2);
        else
            add_bytes(&builder->data, bytes, 4);
    }
    model_text_add(&builder->tensors, "],\"data_offsets\":[%zu,%zu]}", begin, builder->data.length);
}

unsigned char *model_builder_raw(const char *header, const void *data, size_t data_size,
                                 size_t *size)
{
    const size_t length = strlen(header);
    unsigned char *bytes = malloc(8 + length + data_size);
    if (!bytes)
        abort();
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)((uint64_t)length >> 8 * i);
    memcpy(bytes + 8, header, length);
    if (data_size > 0)
        memcpy(bytes + 8 + length, data, data_size);
    *size = 8 + length + data_size;
    return bytes;
}

unsigned char *model_builder_finish(model_builder *builder, size_t *size)
{
    model_text header = {NULL, 0, 0};
    model_text_add(&header, "{\"__metadata__\":{%s}%s}",
                   builder->metadata.text ? builder->metadata.text : "",
                   builder->tensors.text ? builder->tensors.text : "");
    while (header.length % 8 != 0)
        model_text_add(&header, " ");
    unsigned char *bytes =
        model_builder_raw(header.text, builder->data.text, builder->data.length, size);
    model_text_free(&header);
    model_text_free(&builder->metadata);
    model_text_free(&builder->tensors);
    model_text_free(&builder->data);
    return bytes;
}

unsigned char *model_builder_demo(int dimension, double spacing, size_t *size)
{
    return demo_model_bytes(dimension, spacing, size);
}

/* ---- Random weights ----------------------------------------------------------------------------- */

static uint64_t next_random(uint64_t *state)
{
    uint64_t z = *state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    return z ^ z >> 31;
}

/* A tensor of values within +-amplitude. */
static void add_random(model_builder *builder, uint64_t *state, const char *name, int rank,
                       const size_t *shape, double amplitude)
{
    size_t count = 1;
    for (int i = 0; i < rank; i++)
        count *= shape[i];
    float *values = calloc(count + 1, sizeof *values);
    if (!values)
        abort();
    for (size_t i = 0; i < count; i++)
        values[i] = (float)(amplitude * ((double)(next_random(state) >> 11) * 0x1p-52 - 1.0));
    model_builder_tensor(builder, name, rank, shape, values);
    free(values);
}

/* A tensor [bumps][in] of values within 0 and the amplitude, or within +-amplitude. */
static void add_pairs(model_builder *builder, uint64_t *state, const char *name, int bumps, int in,
                      double amplitude, int positive)
{
    const size_t shape[2] = {(size_t)bumps, (size_t)in};
    float *values = calloc(shape[0] * shape[1], sizeof *values);
    if (!values)
        abort();
    for (size_t i = 0; i < shape[0] * shape[1]; i++) {
        const double random = (double)(next_random(state) >> 11) * 0x1p-52 - 1.0;
        values[i] = (float)(amplitude * (positive ? fabs(random) : random));
    }
    model_builder_tensor(builder, name, 2, shape, values);
    free(values);
}

/* name.kernel and name.bias of a convolution (cells > 0) or a dense term. */
static void add_weights(model_builder *builder, uint64_t *state, const char *name, int dimension,
                        int cells, int in, int out, double gain)
{
    char text[64];
    const size_t c = (size_t)cells, depth = dimension == 3 ? c : 1;
    const size_t kernel[5] = {depth, c, c, (size_t)in, (size_t)out};
    const size_t *shape = cells ? kernel : kernel + 3;
    snprintf(text, sizeof text, "%s.kernel", name);
    add_random(builder, state, text, cells ? 5 : 2, shape, gain / sqrt(in));
    snprintf(text, sizeof text, "%s.bias", name);
    add_random(builder, state, text, 1, kernel + 4, 0.1 * gain);
}

/* Harmonics up to an order. */
static size_t harmonics_of(int order, int dimension)
{
    return (size_t)(dimension == 2 ? 2 * order + 1 : (order + 1) * (order + 1));
}

/* name.kernel and name.bias of a convolution with a basis. */
static void add_basis_weights(model_builder *builder, uint64_t *state, const char *name,
                              int dimension, int bumps, int order, int in, int out, double gain)
{
    char text[64];
    const size_t shape[4] = {(size_t)bumps, harmonics_of(order, dimension), (size_t)in,
                             (size_t)out};
    snprintf(text, sizeof text, "%s.kernel", name);
    add_random(builder, state, text, 4, shape, gain / sqrt(in));
    snprintf(text, sizeof text, "%s.bias", name);
    add_random(builder, state, text, 1, shape + 3, 0.1 * gain);
}

/* The last kernel: whole and exactly antisymmetric, or its half along an axis. */
static void add_output_kernel(model_builder *builder, uint64_t *state, const model_random *o)
{
    const size_t c = (size_t)o->output_cells, depth = o->dimension == 3 ? c : 1;
    const size_t in = (size_t)o->channels, values = in * (size_t)o->dimension;
    size_t shape[5] = {depth, c, c, in, (size_t)o->dimension};
    const double amplitude = o->gain / sqrt((double)in);
    if (o->bumps) {
        add_random(builder, state, "output.kernel", 2, (const size_t[]){(size_t)o->bumps, in},
                   amplitude);
        return;
    }
    if (o->half_axis) {
        shape[2 - (o->half_axis[0] - 'x')] /= 2;
        add_random(builder, state, "output.kernel", 5, shape, amplitude);
        return;
    }
    const size_t count = depth * c * c;
    float *kernel = calloc(count * values, sizeof *kernel);
    if (!kernel)
        abort();
    for (size_t i = 0; i < count / 2; i++)
        for (size_t j = 0; j < values; j++) {
            const double random = (double)(next_random(state) >> 11) * 0x1p-52 - 1.0;
            kernel[i * values + j] = (float)(amplitude * random);
            kernel[(count - 1 - i) * values + j] = -kernel[i * values + j];
        }
    model_builder_tensor(builder, "output.kernel", 5, shape, kernel);
    free(kernel);
}

/* ---- The random network ------------------------------------------------------------------------- */

typedef struct random_network {
    model_random o; /* with the defaults filled in */
    model_builder builder;
    model_text text;
    uint64_t state;
    int terms; /* of the layer being written */
    int graph_layers;
} random_network;

/* window NULL: the output's. */
static void add_filter(random_network *n, int level, const char *window)
{
    model_text_add(&n->text, ",\"radius\":%s",
                   model_number(n->o.spacing * n->o.radius * (double)(1 << level)));
    const int cells = window ? n->o.cells : n->o.output_cells;
    if (!n->o.bumps)
        model_text_add(&n->text, ",\"window\":\"%s\",\"mapping\":\"%s\",\"cells\":[%d,%d,%d]",
                       window ? window : "peak", n->o.mapping, cells, cells,
                       n->o.dimension == 3 ? cells : 1);
    else if (window)
        model_text_add(&n->text, ",\"basis\":{\"bumps\":%d,\"order\":%d}", n->o.bumps, n->o.order);
    else
        model_text_add(&n->text, ",\"basis\":{\"bumps\":%d}", n->o.bumps);
    if (n->o.neighbor_limit)
        model_text_add(&n->text, ",\"neighbor_limit\":%d", n->o.neighbor_limit);
}

static void add_convolution(random_network *n, const char *name, const char *source, int relu,
                            int column, int level, int in, int out)
{
    const int features = strcmp(source, "fluid") == 0 || strcmp(source, "boundary") == 0;
    model_text_add(&n->text,
                   "%s{\"type\":\"convolution\",\"source\":\"%s\",\"relu\":%s,\"column\":%d,"
                   "\"outputs\":%d,\"kernel\":\"%s.kernel\",\"bias\":\"%s.bias\"",
                   n->terms++ ? "," : "", source, relu ? "true" : "false", column, out, name, name);
    add_filter(n, level, n->o.window);
    if (n->o.relative && features)
        model_text_add(&n->text, ",\"relative\":true");
    model_text_add(&n->text, ",\"skip_self\":%s}", n->o.skip_self ? "true" : "false");
    if (n->o.bumps)
        add_basis_weights(&n->builder, &n->state, name, n->o.dimension, n->o.bumps, n->o.order, in,
                          out, n->o.gain / 4.0);
    else
        add_weights(&n->builder, &n->state, name, n->o.dimension, n->o.cells, in, out,
                    n->o.gain / 4.0);
}

static void add_transfer(random_network *n, const char *name, const char *source, int in, int out)
{
    model_text_add(&n->text,
                   "%s{\"type\":\"transfer\",\"source\":\"%s\",\"relu\":true,"
                   "\"weight\":\"%s.kernel\",\"bias\":\"%s.bias\",\"normalize\":%s}",
                   n->terms++ ? "," : "", source, name, name,
                   n->o.transfer == 2 ? "true" : "false");
    add_weights(&n->builder, &n->state, name, n->o.dimension, 0, in, out, n->o.gain);
}

static void add_dense(random_network *n, const char *name, const char *source, int relu, int column,
                      int in, int out)
{
    model_text_add(&n->text,
                   "%s{\"type\":\"dense\",\"source\":\"%s\",\"relu\":%s,\"column\":%d,"
                   "\"outputs\":%d,\"weight\":\"%s.kernel\",\"bias\":\"%s.bias\"}",
                   n->terms++ ? "," : "", source, relu ? "true" : "false", column, out, name, name);
    add_weights(&n->builder, &n->state, name, n->o.dimension, 0, in, out, n->o.gain);
}

static void add_stencil(random_network *n, const char *name, const char *source,
                        const char *options, int in, int out)
{
    const size_t taps = n->o.dimension == 2 ? 9 : 27;
    const size_t shape[3] = {taps, (size_t)in, (size_t)out};
    model_text_add(&n->text,
                   "%s{\"type\":\"stencil\",\"source\":\"%s\",%s\"kernel\":\"%s.stencil\"}",
                   n->terms++ ? "," : "", source, options, name);
    char tensor[64];
    snprintf(tensor, sizeof tensor, "%s.stencil", name);
    add_random(&n->builder, &n->state, tensor, 3, shape, n->o.gain / sqrt((double)taps * in));
}

static void open_lattice_layer(random_network *n, const char *name, int level, int channels)
{
    model_text_add(&n->text, "{\"name\":\"%s\",\"points\":\"level%d\",\"channels\":%d,\"terms\":[",
                   name, level, channels);
    n->terms = 0;
}

/* A small lattice trunk of two levels: sums, stencils, restriction and prolongation. */
static void add_lattice(random_network *n)
{
    const int d = n->o.dimension, sums = 2 + 2 * d, moments = sums * (2 * n->o.moments + 1);
    const char *relative = "\"relative\":true,", *relu = "\"relu\":true,";
    open_lattice_layer(n, "s1", 1, sums);
    model_text_add(&n->text,
                   "{\"type\":\"transfer\",\"source\":\"fluid\"},"
                   "{\"type\":\"transfer\",\"source\":\"boundary\",\"column\":%d}]},",
                   1 + d);
    open_lattice_layer(n, "s2", 2, sums);
    model_text_add(&n->text, "{\"type\":\"transfer\",\"source\":\"s1\"}]},");
    open_lattice_layer(n, "d1", 1, 8);
    add_stencil(n, "d1", "s1", relative, sums + d, 8);
    add_transfer(n, "d1.sums", "sums", moments, 8);
    model_text_add(&n->text, "]},");
    open_lattice_layer(n, "d2", 2, 8);
    add_stencil(n, "d2", "s2", relative, sums + d, 8);
    add_transfer(n, "d2.down", "d1", 8, 8);
    model_text_add(&n->text, "]},");
    open_lattice_layer(n, "v1", 1, 8);
    add_stencil(n, "v1", "d1", relu, 8, 8);
    add_transfer(n, "v1.up", "d2", 8, 8);
    model_text_add(&n->text, ",{\"type\":\"identity\",\"source\":\"d1\"}]},");
}

/* Moments of fluid and walls, and the first layer that reads them. */
static void add_moments(random_network *n)
{
    const int d = n->o.dimension, quarter = n->o.channels / 4;
    const int sums = (2 + 2 * d) * (2 * n->o.moments + 1), in = 1 + 2 * d + (n->o.gravity ? d : 0);
    model_text_add(
        &n->text,
        "{\"name\":\"sums\",\"points\":\"fluid\",\"channels\":%d,\"terms\":["
        "{\"type\":\"moments\",\"source\":\"fluid\",\"radius\":%s,"
        "\"basis\":{\"bumps\":%d},\"walls\":{\"radius\":%s,\"basis\":{\"bumps\":%d}}}]},",
        sums, model_number(n->o.radius * n->o.spacing), n->o.moments,
        model_number(1.2 * n->o.radius * n->o.spacing), n->o.moments + 1);
    if (n->o.lattice)
        add_lattice(n);
    model_text_add(&n->text, "{\"name\":\"l0.0\",\"points\":\"fluid\",\"channels\":%d,\"terms\":[",
                   n->o.channels);
    n->terms = 0;
    if (n->o.lattice)
        add_transfer(n, "up", "v1", 8, n->o.channels);
    add_dense(n, "dense_sums", "sums", 0, 0, sums, 2 * quarter);
    add_dense(n, "dense_fluid", "fluid", 0, 2 * quarter, n->o.motion > 1 ? in - d : in,
              2 * quarter);
    model_text_add(&n->text, "]}");
}

/* A set abstraction of 8 hidden channels; options begin with a comma, or are none. */
static void add_abstraction(random_network *n, const char *name, const char *source, double radius,
                            const char *options, int mean, int in, int out)
{
    const size_t d = (size_t)n->o.dimension, hidden[2] = {(size_t)in + d, 8};
    const size_t last[2] = {8, (size_t)out};
    char text[64];
    model_text_add(
        &n->text,
        "%s{\"type\":\"set_abstraction\",\"source\":\"%s\",\"radius\":%s,\"hidden\":8,"
        "\"pool\":\"%s\",\"hidden_weight\":\"%s.hidden\",\"hidden_bias\":\"%s.hidden_bias\","
        "\"weight\":\"%s.weight\",\"bias\":\"%s.bias\"%s}",
        n->terms++ ? "," : "", source, model_number(radius * n->o.spacing),
        mean ? "mean" : "maximum", name, name, name, name, options);
    snprintf(text, sizeof text, "%s.hidden", name);
    add_random(&n->builder, &n->state, text, 2, hidden, n->o.gain / sqrt((double)in));
    snprintf(text, sizeof text, "%s.hidden_bias", name);
    add_random(&n->builder, &n->state, text, 1, hidden + 1, 0.1 * n->o.gain);
    snprintf(text, sizeof text, "%s.weight", name);
    add_random(&n->builder, &n->state, text, 2, last, n->o.gain / sqrt(8.0));
    snprintf(text, sizeof text, "%s.bias", name);
    add_random(&n->builder, &n->state, text, 1, last + 1, 0.1 * n->o.gain);
}

/* Particles, farthest points among them, and back: an hourglass of set abstractions. */
static void add_hourglass(random_network *n)
{
    const int d = n->o.dimension, in = 2 + 2 * d, bits = n->o.abstraction;
    const char *points = n->o.fluid_only ? "fluid" : "all", *matrix = bits & 32 ? "up" : NULL;
    model_text_add(&n->text,
                   "{\"name\":\"joined\",\"points\":\"all\",\"channels\":%d,\"terms\":["
                   "{\"type\":\"identity\",\"source\":\"fluid\"},"
                   "{\"type\":\"identity\",\"source\":\"boundary\",\"column\":%d}]},"
                   "{\"name\":\"s1\",\"points\":\"%s\",\"channels\":6,\"terms\":[",
                   in, 1 + d, points);
    n->terms = 0;
    add_abstraction(n, "s1", "joined", n->o.radius, bits & 2 ? ",\"relative\":true" : "", bits & 4,
                    in, 6);
    model_text_add(&n->text,
                   "]},{\"name\":\"s2\",\"points\":\"level1\",\"channels\":%d,\"terms\":[",
                   n->o.channels);
    n->terms = 0;
    add_abstraction(n, "s2", "s1", 2.0 * n->o.radius, bits & 16 ? ",\"neighbor_limit\":8" : "",
                    bits & 8, 6, n->o.channels);
    model_text_add(&n->text,
                   "]},{\"name\":\"l0.0\",\"points\":\"%s\",\"channels\":%d,\"terms\":["
                   "{\"type\":\"interpolation\",\"source\":\"s2\",\"nearest\":3,\"radius\":%s",
                   points, n->o.channels, model_number(3.0 * n->o.radius * n->o.spacing));
    if (matrix) {
        model_text_add(&n->text, ",\"weight\":\"up.kernel\",\"bias\":\"up.bias\"");
        add_weights(&n->builder, &n->state, matrix, d, 0, n->o.channels, n->o.channels, n->o.gain);
    }
    model_text_add(&n->text, "}");
    n->terms = 1;
    add_dense(n, "skip", "s1", 0, 0, 6, n->o.channels);
    model_text_add(&n->text, "]}");
}

static void add_first_layer(random_network *n)
{
    const int d = n->o.dimension, quarter = n->o.channels / 4;
    const int in = 1 + (n->o.motion == 1 ? 2 * d : d) + (n->o.gravity ? d : 0);
    const int wall_in = 1 + (n->o.motion ? 2 * d : d);
    model_text_add(&n->text, "{\"name\":\"l0.0\",\"points\":\"%s\",\"channels\":%d,\"terms\":[",
                   n->o.fluid_only ? "fluid" : "all", n->o.channels);
    n->terms = 0;
    add_convolution(n, "conv_fluid", "fluid", 0, 0, 0, in, quarter);
    add_convolution(n, "conv_boundary", "boundary", 0, quarter, 0, wall_in, quarter);
    add_dense(n, "dense_fluid", "fluid", 0, 2 * quarter, in, 2 * quarter);
    if (!n->o.fluid_only)
        add_dense(n, "dense_boundary", "boundary", 0, 2 * quarter, wall_in, 2 * quarter);
    model_text_add(&n->text, "]}");
}

/* Layer `layer` on each level, from every level that the layer before has. */
static void add_trunk_layer(random_network *n, int layer)
{
    const int last = layer == n->o.trunk_layers, c = n->o.channels;
    const int levels = n->o.lattice || n->o.abstraction ? 1 : n->o.levels;
    const int sources = layer == 1 ? 1 : levels;
    for (int d = 0; d < (last ? 1 : levels); d++) {
        char points[16], name[48], source[48];
        snprintf(points, sizeof points, d ? "level%d" : n->o.fluid_only ? "fluid" : "all", d);
        const int width = last && n->o.plain ? n->o.dimension : c;
        model_text_add(&n->text,
                       ",{\"name\":\"l%d.%d\",\"points\":\"%s\",\"channels\":%d,\"terms\":[", layer,
                       d, points, width);
        n->terms = 0;
        for (int s = 0; s < sources; s++) {
            snprintf(name, sizeof name, "l%d.conv_%d_%d", layer, s, d);
            snprintf(source, sizeof source, "l%d.%d", layer - 1, s);
            if (n->o.transfer && s != d)
                add_transfer(n, name, source, c, width);
            else
                add_convolution(n, name, source, 1, 0, s > d ? s : d, c, width);
        }
        if (d < sources) {
            snprintf(name, sizeof name, "l%d.dense_%d", layer, d);
            snprintf(source, sizeof source, "l%d.%d", layer - 1, d);
            add_dense(n, name, source, 1, 0, c, width);
            if (width == c)
                model_text_add(&n->text, ",{%s,\"source\":\"%s\"}",
                               n->o.residual ? n->o.residual : "\"type\":\"identity\"", source);
        }
        model_text_add(&n->text, "]}");
    }
}

/* ---- A graph network ---- */

static void open_graph_layer(random_network *n, const char *name, const char *points, int channels)
{
    model_text_add(&n->text, "%s{\"name\":\"%s\",\"points\":\"%s\",\"channels\":%d,\"terms\":[",
                   n->graph_layers++ ? "]}," : "", name, points, channels);
    n->terms = 0;
}

static void add_plain_term(random_network *n, const char *type, const char *source,
                           const char *members)
{
    model_text_add(&n->text, "%s{\"type\":\"%s\",\"source\":\"%s\"%s}", n->terms++ ? "," : "", type,
                   source, members);
}

static void add_normalize(random_network *n, const char *name, const char *source)
{
    const size_t c = (size_t)n->o.channels;
    char members[128], tensor[64];
    snprintf(members, sizeof members, ",\"scale\":\"%s.scale\",\"offset\":\"%s.offset\"", name,
             name);
    add_plain_term(n, "normalize", source, members);
    snprintf(tensor, sizeof tensor, "%s.scale", name);
    add_random(&n->builder, &n->state, tensor, 1, &c, 1.0);
    snprintf(tensor, sizeof tensor, "%s.offset", name);
    add_random(&n->builder, &n->state, tensor, 1, &c, 0.1);
}

/* The second matrix of a perceptron and its normalisation: layers NAMEx and, still open, NAME. */
static void add_second(random_network *n, const char *hidden, const char *name, const char *points)
{
    const int c = n->o.channels;
    char last[32];
    snprintf(last, sizeof last, "%sx", name);
    open_graph_layer(n, last, points, c);
    add_dense(n, last, hidden, 1, 0, c, c);
    open_graph_layer(n, name, points, c);
    add_normalize(n, name, last);
}

static void add_message_passing(random_network *n, int step, const char *points)
{
    const int c = n->o.channels;
    char node[16], edge[16], name[7][16], node_name[24];
    for (int i = 0; i < 7; i++)
        snprintf(name[i], sizeof name[i], "%c%d", "srhmaun"[i], step);
    snprintf(node, sizeof node, "n%d", step - 1);
    snprintf(edge, sizeof edge, "e%d", step - 1);
    open_graph_layer(n, name[0], points, c);
    add_dense(n, name[0], node, 0, 0, c, c);
    open_graph_layer(n, name[1], points, c);
    add_dense(n, name[1], node, 0, 0, c, c);
    open_graph_layer(n, name[2], "edges", c);
    add_plain_term(n, "gather", name[0], ",\"end\":\"sender\"");
    add_plain_term(n, "gather", name[1], ",\"end\":\"receiver\"");
    add_dense(n, name[2], edge, 0, 0, c, c);
    add_second(n, name[2], name[3], "edges");
    open_graph_layer(n, name[4], points, c);
    add_plain_term(n, "sum", name[3], step % 2 ? "" : ",\"relu\":true");
    open_graph_layer(n, name[5], points, c);
    snprintf(node_name, sizeof node_name, "u%d.node", step);
    add_dense(n, node_name, node, 0, 0, c, c);
    add_dense(n, name[5], name[4], 0, 0, c, c);
    add_second(n, name[5], name[6], points);
    add_plain_term(n, "identity", node, "");
    snprintf(edge, sizeof edge, "e%d", step);
    open_graph_layer(n, edge, "edges", c);
    snprintf(edge, sizeof edge, "e%d", step - 1);
    add_plain_term(n, "identity", edge, "");
    add_plain_term(n, "identity", name[3], "");
}

static void add_graph(random_network *n)
{
    const int d = n->o.dimension, c = n->o.channels;
    const char *points = n->o.fluid_only ? "fluid" : "all";
    char last[16];
    open_graph_layer(n, "i", points, c);
    add_dense(n, "i.fluid", "fluid", 0, 0, 1 + d + n->o.history * d, c);
    if (!n->o.fluid_only)
        add_dense(n, "i.boundary", "boundary", 0, 0, 1 + d, c);
    add_second(n, "i", "n0", points);
    open_graph_layer(n, "way", "edges", d + 1);
    add_plain_term(n, "displacement", "fluid", "");
    open_graph_layer(n, "j", "edges", c);
    add_dense(n, "j", "way", 0, 0, d + 1, c);
    add_second(n, "j", "e0", "edges");
    for (int step = 1; step <= n->o.graph; step++)
        add_message_passing(n, step, points);
    snprintf(last, sizeof last, "n%d", n->o.graph);
    open_graph_layer(n, "k", points, c);
    add_dense(n, "k", last, 0, 0, c, c);
    open_graph_layer(n, "l0.0", points, d);
    add_dense(n, "l0.0", "k", 1, 0, c, d);
    model_text_add(&n->text, "]}");
}

static void add_head(random_network *n)
{
    const model_random *o = &n->o;
    const char *third = o->dimension == 3 ? ",0" : "";
    model_text_add(&n->text,
                   "{\"name\":\"random\",\"description\":\"random weights, for tests\","
                   "\"dimension\":%d,\"time_step\":%s,\"gravity\":[0,-9.8125%s],"
                   "\"particle_spacing\":%s,\"rest_density\":1000,\"evaluate\":\"%s\","
                   "\"features\":{\"fluid\":[%s%s%s],\"boundary\":[\"%s\",\"normal\"%s]}",
                   o->dimension, model_number(0.005), third, model_number(o->spacing), o->evaluate,
                   o->motion == 3   ? "\"one\",\"motion\""
                   : o->motion == 2 ? "\"motion\",\"one\""
                   : o->motion == 1 ? "\"one\",\"velocity\",\"motion\""
                                    : "\"one\",\"velocity\"",
                   o->gravity ? ",\"gravity\"" : "", o->history ? ",\"history\"" : "",
                   o->area ? "area" : "one", o->motion && o->motion < 3 ? ",\"motion\"" : "");
    if (o->boundary_crop > 0.0)
        model_text_add(&n->text, ",\"boundary_crop\":%s",
                       model_number(o->boundary_crop * o->spacing));
    if (o->relaxation)
        model_text_add(&n->text, ",\"relaxation\":%s", o->relaxation);
    if (o->history)
        model_text_add(&n->text, ",\"history\":%d", o->history);
    if (o->graph)
        model_text_add(&n->text, ",\"edges\":{\"points\":\"%s\",\"radius\":%s}",
                       o->fluid_only ? "fluid" : "all", model_number(o->radius * o->spacing));
    if (o->levels == 1)
        return;
    const int farthest = strcmp(o->method, "farthest") == 0;
    model_text_add(&n->text, ",\"levels\":[");
    for (int i = 1; i < o->levels; i++)
        model_text_add(
            &n->text, "%s{\"%s\":%s}", i > 1 ? "," : "", farthest ? "ratio" : "voxel",
            model_number(farthest ? 1.0 / (double)(1 << i) : o->spacing * (double)(1 << i)));
    model_text_add(&n->text, "],\"sampling\":{\"method\":\"%s\"%s", o->method,
                   o->lattice || o->abstraction & 64 ? ",\"points\":\"fluid\"" : "");
    if (!farthest)
        model_text_add(&n->text, ",\"anchor\":\"%s\"", o->anchor);
    if (strcmp(o->method, "voxel_corners") == 0)
        model_text_add(&n->text, ",\"hysteresis\":%s", model_number(o->no_hysteresis ? 0.0 : 0.1));
    model_text_add(&n->text, "}");
}

/* What only an output with a basis has. */
static void add_central(random_network *n)
{
    const model_random *o = &n->o;
    const double amplitude = o->gain / sqrt((double)o->channels);
    if (o->direction)
        model_text_add(&n->text, ",\"direction\":\"current\"");
    if (o->limit > 0.0)
        model_text_add(&n->text, ",\"limit\":%s", model_number(o->limit * o->spacing));
    if (o->damping) {
        model_text_add(&n->text, ",\"damping\":\"output.damping\"");
        add_pairs(&n->builder, &n->state, "output.damping", o->bumps, o->channels, amplitude, 1);
    }
    if (!o->walls)
        return;
    model_text_add(&n->text,
                   ",\"walls\":{\"kernel\":\"walls.kernel\",\"radius\":%s,\"basis\":{\"bumps\":%d}",
                   model_number(1.3 * o->radius * o->spacing), o->bumps + 1);
    add_pairs(&n->builder, &n->state, "walls.kernel", o->bumps + 1, o->channels, amplitude, 0);
    if (o->contact > 0.0)
        model_text_add(&n->text, ",\"contact\":%s", model_number(o->contact * o->spacing));
    if (o->damping) {
        model_text_add(&n->text, ",\"damping\":\"walls.damping\"");
        add_pairs(&n->builder, &n->state, "walls.damping", o->bumps + 1, o->channels, amplitude, 1);
    }
    model_text_add(&n->text, "}");
}

static void add_output(random_network *n)
{
    const model_random *o = &n->o;
    model_text_add(&n->text,
                   "],\"output\":{\"type\":\"%s\",\"source\":\"l%d.0\",\"relu\":%s,\"scale\":%s",
                   o->plain ? "plain" : "antisymmetric", o->trunk_layers,
                   o->plain ? "false" : "true", model_number(o->scale * o->spacing));
    if (!o->plain) {
        model_text_add(&n->text, ",\"kernel\":\"output.kernel\"");
        if (!o->bumps)
            model_text_add(&n->text, ",\"projection\":\"%s\"", o->projection);
        if (o->bumps)
            ;
        else if (o->half_axis)
            model_text_add(&n->text, ",\"stored\":\"half\",\"half_axis\":\"%s\"", o->half_axis);
        else
            model_text_add(&n->text, ",\"stored\":\"full\"");
        add_filter(n, 0, NULL);
        add_output_kernel(&n->builder, &n->state, o);
        add_central(n);
    }
    model_text_add(&n->text, "}}");
}

/* With `network` the file describes itself by that text; with `described` the right one is handed
 * out. */
static unsigned char *random_file(const model_random *options, const char *network,
                                  char **described, size_t *size)
{
    random_network n = {.o = *options, .state = options->seed};
    model_random *o = &n.o;
    o->dimension = o->dimension ? o->dimension : 2;
    o->levels = o->levels ? o->levels : 1;
    o->channels = o->channels ? o->channels : 8;
    o->trunk_layers = o->trunk_layers ? o->trunk_layers : 2;
    o->cells = o->cells ? o->cells : 4;
    o->output_cells = o->output_cells ? o->output_cells : 6;
    o->spacing = o->spacing > 0.0 ? o->spacing : 0.05;
    o->radius = o->radius > 0.0 ? o->radius : 2.0;
    o->gain = o->gain > 0.0 ? o->gain : 1.0;
    o->scale = o->scale > 0.0 ? o->scale : 0.01;
    o->evaluate = o->evaluate ? o->evaluate : "current";
    o->projection = o->projection ? o->projection : "radial";
    o->method = o->method ? o->method : "voxel_centers";
    o->anchor = o->anchor ? o->anchor : "world";
    o->window = o->window ? o->window : "poly6";
    o->mapping = o->mapping ? o->mapping : "volume";

    model_builder_open(&n.builder);
    n.builder.type = o->type;
    n.builder.coarse = o->coarse;
    add_head(&n);
    model_text_add(&n.text, ",\"layers\":[");
    if (o->graph)
        add_graph(&n);
    else if (o->moments)
        add_moments(&n);
    else if (o->abstraction)
        add_hourglass(&n);
    else
        add_first_layer(&n);
    if (o->graph)
        o->trunk_layers = 0;
    for (int layer = 1; layer <= o->trunk_layers; layer++)
        add_trunk_layer(&n, layer);
    if (o->guess) {
        char last[16];
        snprintf(last, sizeof last, "l%d.0", o->trunk_layers);
        model_text_add(&n.text,
                       ",{\"name\":\"guess\",\"points\":\"fluid\",\"channels\":1,\"terms\":[");
        n.terms = 0;
        add_dense(&n, "guess", last, 1, 0, o->channels, 1);
        model_text_add(&n.text, "]}");
    }
    add_output(&n);
    model_builder_metadata(&n.builder, "format", "ascc.model");
    model_builder_metadata(&n.builder, "version", "1");
    model_builder_metadata(&n.builder, "network", network ? network : n.text.text);
    if (o->trust)
        model_builder_metadata(&n.builder, "trust", o->trust);
    if (described)
        *described = n.text.text;
    else
        model_text_free(&n.text);
    return model_builder_finish(&n.builder, size);
}

unsigned char *model_builder_random(const model_random *options, size_t *size)
{
    return random_file(options, NULL, NULL, size);
}

/* ---- A cheap network for benchmarks -------------------------------------------------------------- */

static void tiny_layer(random_network *n, const char *name, const char *points, int first)
{
    model_text_add(&n->text, "%s{\"name\":\"%s\",\"points\":\"%s\",\"channels\":16,\"terms\":[",
                   first ? "" : "]},", name, points);
    n->terms = 0;
}

unsigned char *model_builder_tiny(double spacing, size_t *size)
{
    random_network n = {.o = {.dimension = 3,
                              .levels = 2,
                              .spacing = spacing,
                              .gain = 1.0,
                              .scale = 1e-6,
                              .evaluate = "advected",
                              .method = "voxel_corners",
                              .window = "none",
                              .anchor = "world",
                              .no_hysteresis = 1,
                              .bumps = 3,
                              .order = 1,
                              .transfer = 1,
                              .radius = 2.0,
                              .channels = 16},
                        .state = 7};
    model_builder_open(&n.builder);
    add_head(&n);
    model_text_add(&n.text, ",\"layers\":[");
    tiny_layer(&n, "a", "fluid", 1);
    add_convolution(&n, "a.fluid", "fluid", 0, 0, 0, 4, 16);
    add_convolution(&n, "a.boundary", "boundary", 0, 0, 0, 4, 16);
    add_dense(&n, "a.dense", "fluid", 0, 0, 4, 16);
    tiny_layer(&n, "down", "level1", 0);
    add_transfer(&n, "down.a", "a", 16, 16);
    tiny_layer(&n, "coarse", "level1", 0);
    add_convolution(&n, "coarse.down", "down", 1, 0, 1, 16, 16);
    add_dense(&n, "coarse.dense", "down", 1, 0, 16, 16);
    tiny_layer(&n, "b", "fluid", 0);
    add_convolution(&n, "b.a", "a", 1, 0, 0, 16, 16);
    add_dense(&n, "b.dense", "a", 1, 0, 16, 16);
    add_transfer(&n, "b.coarse", "coarse", 16, 16);
    tiny_layer(&n, "c", "fluid", 0);
    add_convolution(&n, "c.b", "b", 1, 0, 0, 16, 16);
    add_dense(&n, "c.dense", "b", 1, 0, 16, 16);
    model_text_add(&n.text,
                   "]}],\"output\":{\"type\":\"antisymmetric\",\"source\":\"c\","
                   "\"relu\":true,\"scale\":%s,\"kernel\":\"output.kernel\"",
                   model_number(n.o.scale * spacing));
    add_filter(&n, 0, NULL);
    add_output_kernel(&n.builder, &n.state, &n.o);
    model_text_add(&n.text, "}}");
    model_builder_metadata(&n.builder, "format", "ascc.model");
    model_builder_metadata(&n.builder, "version", "1");
    model_builder_metadata(&n.builder, "network", n.text.text);
    model_text_free(&n.text);
    return model_builder_finish(&n.builder, size);
}

/* ---- Small networks described as the published ones --------------------------------------------- */

/* Metadata with one piece of text replaced. */
static void add_replaced(model_builder *builder, const char *key, const char *value,
                         const char *from, const char *to)
{
    const char *found = from ? strstr(value, from) : NULL;
    model_text text = {NULL, 0, 0};
    if (found)
        model_text_add(&text, "%.*s%s%s", (int)(found - value), value, to, found + strlen(from));
    else
        model_text_add(&text, "%s", value);
    model_builder_metadata(builder, key, text.text);
    model_text_free(&text);
}

static void add_published(model_builder *builder, const char *architecture, const char *floats,
                          const char *from, const char *to)
{
    add_replaced(builder, "format", "ascc.weights", NULL, NULL);
    add_replaced(builder, "version", "1", NULL, NULL);
    add_replaced(builder, "model", "small", NULL, NULL);
    add_replaced(builder, "dim", "3", from, to);
    add_replaced(builder, "kernel_axis_order", "[z,y,x,in,out] row-major: axis 0 is z (slowest)",
                 from, to);
    add_replaced(builder, "floats", floats, from, to);
    add_replaced(builder, "architecture", architecture, from, to);
}

static const char dmcf_architecture[] =
    "{\"network\": \"DMCF SymNet (HRNet trunk + antisymmetric output convolution), dim 3\", "
    "\"timestep\": 0.02, \"gravity\": [0, -9.81, 0], "
    "\"integration\": \"v2=v1+dt*g; p2=p1+dt*v2; p=p2+correction; v=(p-p1)/dt\", "
    "\"features\": {\"fluid\": [\"1\", \"v2.x\", \"v2.y\", \"v2.z\"], "
    "\"boundary\": [\"1\", \"n.x\", \"n.y\", \"n.z\"], \"use_vel\": true, \"use_acc\": false, "
    "\"use_feats\": false, \"use_box_feats\": true, \"density_features\": false}, "
    "\"use_boundary_in_all_layers\": true, "
    "\"boundary_crop\": \"keep b iff min(p2)-0.8 <= b <= max(p2)+0.8 per axis\", "
    "\"branches\": [{\"stride\": 1, \"radius\": 0.1, \"points\": \"fluid then kept "
    "boundary\"}, {\"stride\": 2, \"radius\": 0.2, \"voxel\": 0.05}], "
    "\"sampling\": {\"base_voxel\": 0.025, \"centralize\": true, \"hysteresis\": 0.1, "
    "\"pad\": 0, \"source\": \"branch 0 points for every branch\"}, "
    "\"cross_branch_radius\": \"radius of the coarser of the two branches\", "
    "\"conv\": {\"kernel_size\": [2, 2, 2], \"window\": \"poly6: clip((1-q)^3,0,1), "
    "q=d^2/r^2\", \"coordinate_mapping\": \"ball_to_cube_volume_preserving\", "
    "\"interpolation\": \"trilinear, clamped\", \"align_corners\": true, "
    "\"normalize\": false, \"ignore_query_point\": false, \"bias\": true}, "
    "\"antisymmetric\": {\"kernel_size\": [2, 4, 2], "
    "\"stored\": \"sym0.kernel_half [2,2,2,2,3]\", \"sym_axis\": 1, "
    "\"full\": \"concat(axis=1: -half[::-1,::-1,::-1], half)\", "
    "\"window\": \"peak: (1-sqrt(q))^2\", \"radius\": 0.1, \"ignore_query_point\": true, "
    "\"bias\": false, "
    "\"formula\": \"out_i = sum_k a_ik (f_i+f_k) g(x_k-x_i), f=relu(l2.out_0)\"}, "
    "\"merge\": \"sum (add_merge)\", "
    "\"activation\": \"relu on the input of every l1,l2 convolution/dense and of the "
    "antisymmetric convolution; none on inputs of layer 0 and none on outputs\", "
    "\"residual\": \"l2.out_0 += l1.out_0 (before relu); no other layer has equal widths\", "
    "\"dense\": \"fluid and boundary rows each have their own layer-0 dense; l1.dense_0, "
    "l2.dense_0 act on relu(features) of the same branch and are added\", "
    "\"layers\": [{\"name\": \"l0\", \"out\": 3, \"concat\": [\"conv_fluid(1)\", "
    "\"conv_obstacle(1)\", \"dense_fluid|dense_obstacle(1)\"]}, "
    "{\"name\": \"l1\", \"inputs\": {\"0\": 3}, \"outputs\": {\"0\": 2, \"1\": 1}}, "
    "{\"name\": \"l2\", \"inputs\": {\"0\": 2, \"1\": 1}, \"outputs\": {\"0\": 2}}, "
    "{\"name\": \"sym0\", \"inputs\": {\"0\": 2}, \"outputs\": {\"0\": 3}}], "
    "\"out_scale\": [0.0078125, 0.0078125, 0.0078125]}";

unsigned char *model_builder_dmcf(const char *from, const char *to, size_t *size)
{
    static const struct {
        const char *name;
        int cells, in, out;
    } terms[] = {{"conv_fluid", 2, 4, 1},     {"conv_obstacle", 2, 4, 1}, {"dense_fluid", 0, 4, 1},
                 {"dense_obstacle", 0, 4, 1}, {"l1.conv_0_0", 2, 3, 2},   {"l1.conv_0_1", 2, 3, 1},
                 {"l1.dense_0", 0, 3, 2},     {"l2.conv_0_0", 2, 2, 2},   {"l2.conv_1_0", 2, 1, 2},
                 {"l2.dense_0", 0, 2, 2}};
    model_builder builder;
    uint64_t state = 1;
    model_builder_open(&builder);
    for (size_t i = 0; i < sizeof terms / sizeof *terms; i++)
        add_weights(&builder, &state, terms[i].name, 3, terms[i].cells, terms[i].in, terms[i].out,
                    1.0);
    add_random(&builder, &state, "sym0.kernel_half", 5, (const size_t[]){2, 2, 2, 2, 3}, 1.0);
    char floats[32];
    snprintf(floats, sizeof floats, "%zu", builder.data.length / 4);
    add_published(&builder, dmcf_architecture, floats, from, to);
    add_replaced(&builder, "trained_with",
                 "gravity -9.81 along y, particle spacing 0.0625 m, boundary about 970 points per "
                 "m^2, dt 0.02 s",
                 from, to);
    return model_builder_finish(&builder, size);
}

static const char cconv_architecture[] =
    "{\"network\": \"CConv (Ummenhofer et al. ICLR 2020), dim 3\", \"timestep\": 0.02, "
    "\"gravity\": [0, -9.81, 0], "
    "\"integration\": \"v2=v1+dt*g; p2=p1+dt*(v1+v2)/2; p=p2+correction; v=(p-p1)/dt\", "
    "\"features\": {\"fluid\": [\"1\", \"v2.x\", \"v2.y\", \"v2.z\"], "
    "\"boundary\": [\"n.x\", \"n.y\", \"n.z\"]}, \"boundary_crop\": \"none\", "
    "\"conv\": {\"kernel_size\": [2, 2, 2], \"radius\": 0.1125, \"extent\": 0.225, "
    "\"window\": \"poly6: clip((1-q)^3,0,1), q=d^2/r^2\", "
    "\"coordinate_mapping\": \"ball_to_cube_volume_preserving\", "
    "\"interpolation\": \"trilinear, clamped\", \"align_corners\": true, "
    "\"normalize\": false, \"ignore_query_point\": true, \"bias\": true}, "
    "\"layers\": \"A0=concat(conv0_obstacle(1),conv0_fluid(1),dense0_fluid(1)) at fluid "
    "points; for i=1..3: f=relu(A_{i-1}); A_i=conv_i(f)+dense_i(f) (+A_{i-1} if widths are "
    "equal, i.e. only i=2); widths 3,2,2,3; correction=A_3/128\", "
    "\"out_scale\": [0.0078125, 0.0078125, 0.0078125]}";

unsigned char *model_builder_cconv(const char *from, const char *to, size_t *size)
{
    static const struct {
        const char *name;
        int cells, in, out;
    } terms[] = {{"conv0_fluid", 2, 4, 1}, {"conv0_obstacle", 2, 3, 1}, {"dense0_fluid", 0, 4, 1},
                 {"conv1", 2, 3, 2},       {"conv2", 2, 2, 2},          {"conv3", 2, 2, 3},
                 {"dense1", 0, 3, 2},      {"dense2", 0, 2, 2},         {"dense3", 0, 2, 3}};
    model_builder builder;
    uint64_t state = 2;
    model_builder_open(&builder);
    for (size_t i = 0; i < sizeof terms / sizeof *terms; i++)
        add_weights(&builder, &state, terms[i].name, 3, terms[i].cells, terms[i].in, terms[i].out,
                    1.0);
    char floats[32];
    snprintf(floats, sizeof floats, "%zu", builder.data.length / 4);
    add_published(&builder, cconv_architecture, floats, from, to);
    return model_builder_finish(&builder, size);
}

/* ---- Right tensors under another description ---------------------------------------------------- */

static const model_random small = {
    .levels = 2, .channels = 4, .cells = 2, .output_cells = 2, .neighbor_limit = 8};
static const model_random small_basis = {
    .levels = 2, .channels = 4, .bumps = 2, .order = 1, .transfer = 1, .type = "BF16"};
static const model_random small_hourglass = {.levels = 2,
                                             .channels = 4,
                                             .cells = 2,
                                             .trunk_layers = 1,
                                             .method = "farthest",
                                             .abstraction = 1 + 2 + 16 + 32,
                                             .plain = 1};

static const model_random small_graph = {
    .channels = 4, .graph = 1, .history = 2, .plain = 1, .radius = 1.45};

static const model_random small_trusted = {
    .channels = 4, .bumps = 2, .fluid_only = 1, .trunk_layers = 1, .motion = 1};

static const model_random *small_of(char kind)
{
    return kind == 'b'   ? &small_basis
           : kind == 'p' ? &small_hourglass
           : kind == 'g' ? &small_graph
                         : &small;
}

static unsigned char *trusted_file(const char *trust, size_t *size)
{
    model_random o = small_trusted;
    o.trust = trust;
    return random_file(&o, NULL, NULL, size);
}

/* FNV-1a of a file's tensors, which are all that follows its header. */
static uint64_t sum_of_tensors(const unsigned char *bytes, size_t size)
{
    uint64_t length = 0, sum = UINT64_C(0xcbf29ce484222325);
    for (int k = 7; k >= 0; k--)
        length = length << 8 | bytes[k];
    for (size_t i = 8 + (size_t)length; i < size; i++)
        sum = (sum ^ bytes[i]) * UINT64_C(0x100000001b3);
    return sum;
}

/* Statistics of the first layer that any numbers may be. */
static char *trusted_description(void)
{
    size_t size;
    model_text text = {NULL, 0, 0};
    unsigned char *bytes = trusted_file(NULL, &size);
    model_text_add(&text,
                   "{\"layer\":0,\"weights\":\"%016" PRIx64 "\",\"threshold\":1.5,\"mean\":[0.1",
                   sum_of_tensors(bytes, size));
    free(bytes);
    for (int c = 1; c < small_trusted.channels; c++)
        model_text_add(&text, ",%s", model_number(0.1 - 0.05 * c));
    model_text_add(&text, "],\"factor\":[");
    for (int i = 0; i < small_trusted.channels; i++)
        for (int j = 0; j <= i; j++)
            model_text_add(&text, "%s%s", i ? "," : "", model_number(i == j ? 2.0 : -0.25 * j));
    model_text_add(&text, "]}");
    return text.text;
}

unsigned char *model_builder_described(char kind, const char *text, size_t *size)
{
    return kind == 'd'   ? model_builder_dmcf(dmcf_architecture, text, size)
           : kind == 'c' ? model_builder_cconv(cconv_architecture, text, size)
           : kind == 't' ? trusted_file(text, size)
                         : random_file(small_of(kind), text, NULL, size);
}

char *model_builder_description(char kind)
{
    model_text text = {NULL, 0, 0};
    size_t size;
    if (kind == 't')
        return trusted_description();
    if (kind != 'd' && kind != 'c') {
        free(random_file(small_of(kind), NULL, &text.text, &size));
        return text.text;
    }
    model_text_add(&text, "%s", kind == 'd' ? dmcf_architecture : cconv_architecture);
    return text.text;
}
