/* Writes the description of a network from a few numbers. SPDX-License-Identifier: MIT */
#include "architecture.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

const char *const ascc_architecture_kernels[2] = {"basis", "grid"};
const char *const ascc_architecture_outputs[2] = {"plain", "antisymmetric"};
const char *const ascc_architecture_projections[2] = {"none", "radial"};
const char *const ascc_architecture_samplings[3] = {"centers", "corners", "farthest"};
const char *const ascc_architecture_evaluates[2] = {"current", "advected"};
const char *const ascc_architecture_directions[2] = {"current", "seen"};

static const double COARSE_RADIUS = 2.25; /* voxels */
static const double SCALE = 0.05;         /* of the output, spacings */

ascc_architecture ascc_architecture_default(int32_t dimension, ascc_architecture_family kernel)
{
    const bool basis = kernel == ASCC_FAMILY_BASIS;
    return (ascc_architecture){.dimension = dimension,
                               .kernel = kernel,
                               .gravity = {0.0, -9.81, 0.0},
                               .rest_density = 1000.0,
                               .channels = 16,
                               .fine_layers = 3,
                               .coarse_channels = {16, 16, 16},
                               .coarse_layers = 1,
                               .radius = 2.25,
                               .wall_radius = 3.2,
                               .bumps = 3,
                               .order = 1,
                               .wall_bumps = 4,
                               .output_bumps = 4,
                               .output = ASCC_OUTPUT_ANTISYMMETRIC,
                               .radial = !basis,
                               .damping = basis,
                               .sampling = basis ? ASCC_SAMPLE_CORNERS : ASCC_SAMPLE_CENTERS,
                               .advected = basis};
}

/* ---- Text and bytes that grow ------------------------------------------------------------------- */

typedef struct bytes {
    char *data;
    size_t length, capacity;
    bool failed;
} bytes;

static bool grow(bytes *b, size_t more)
{
    if (b->failed || b->length + more <= b->capacity)
        return !b->failed;
    const size_t capacity = 2 * (b->length + more);
    char *data = realloc(b->data, capacity);
    b->failed = !data;
    if (b->failed)
        return false;
    b->data = data;
    b->capacity = capacity;
    return true;
}

static void put(bytes *b, const void *from, size_t size)
{
    if (!grow(b, size + 1))
        return;
    memcpy(b->data + b->length, from, size);
    b->length += size;
    b->data[b->length] = '\0';
}

static void add(bytes *b, const char *format, ...) ASCC_FORMAT(2, 3);
static void add(bytes *b, const char *format, ...)
{
    char text[512];
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(text, sizeof text, format, arguments);
    va_end(arguments);
    b->failed = b->failed || length < 0 || length >= (int)sizeof text;
    if (!b->failed)
        put(b, text, (size_t)length);
}

/* With the escapes that a JSON text needs. */
static void add_escaped(bytes *b, const char *text)
{
    for (; *text; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c < 0x20)
            add(b, "\\u%04x", c);
        else if (c == '"' || c == '\\')
            add(b, "\\%c", c);
        else
            put(b, text, 1);
    }
}

typedef struct writer {
    const ascc_architecture *a;
    bytes network;
    bool layers; /* there is one already */
    bool terms;  /* of the layer being written */
} writer;

/* ---- Layers and terms ---------------------------------------------------------------------------- */

static double voxel_of(const ascc_architecture *a, int32_t level)
{
    return a->spacing * (double)(1 << level);
}

static void begin_layer(writer *w, const char *name, const char *points, int32_t channels)
{
    add(&w->network, "%s{\"name\":\"%s\",\"points\":\"%s\",\"channels\":%d,\"terms\":[",
        w->layers ? "]}," : "", name, points, channels);
    w->layers = true;
    w->terms = false;
}

static void begin_term(writer *w, const char *type, const char *source, bool relu)
{
    add(&w->network, "%s{\"type\":\"%s\",\"source\":\"%s\"%s", w->terms ? "," : "", type, source,
        relu ? ",\"relu\":true" : "");
    w->terms = true;
}

static void add_bias(writer *w, const char *name)
{
    add(&w->network, ",\"bias\":\"%s.bias\"", name);
}

typedef struct convolution {
    const char *name, *source;
    bool relu, relative, bias;
    int32_t bumps;
    double radius; /* m */
} convolution;

static void add_convolution(writer *w, const convolution *c)
{
    begin_term(w, "convolution", c->source, c->relu);
    add(&w->network, ",\"kernel\":\"%s.kernel\"", c->name);
    if (c->bias)
        add_bias(w, c->name);
    add(&w->network, ",\"radius\":%.9g,\"basis\":{\"bumps\":%d,\"order\":%d}%s}", c->radius,
        c->bumps, w->a->order, c->relative ? ",\"relative\":true" : "");
}

static void add_dense(writer *w, const char *name, const char *source, bool relu)
{
    begin_term(w, "dense", source, relu);
    add(&w->network, ",\"weight\":\"%s\"}", name);
}

static void add_identity(writer *w, const char *source)
{
    begin_term(w, "identity", source, false);
    add(&w->network, "}");
}

/* Between two sets of the BASIS family: a transfer, or a convolution where transfers cannot go. level: the
 * coarser of the two. */
static void add_crossing(writer *w, const char *name, const char *source, int32_t level, bool relu)
{
    if (w->a->sampling == ASCC_SAMPLE_FARTHEST) {
        add_convolution(w, &(convolution){.name = name,
                                          .source = source,
                                          .relu = relu,
                                          .bumps = w->a->bumps,
                                          .radius = COARSE_RADIUS * voxel_of(w->a, level)});
        return;
    }
    begin_term(w, "transfer", source, relu);
    add(&w->network, ",\"weight\":\"%s.weight\"}", name);
}

/* ---- The BASIS family ---------------------------------------------------------------------------- */

static int32_t channels_of(const ascc_architecture *a, int32_t level)
{
    return level ? a->coarse_channels[level - 1] : a->channels;
}

static void points_of(int32_t level, const char *fine, char text[16])
{
    if (level)
        (void)snprintf(text, 16, "level%d", level);
    else
        (void)snprintf(text, 16, "%s", fine);
}

/* Walls as a particle sees them, or as a level does. */
static void add_wall_convolution(writer *w, const char *layer, int32_t level)
{
    const ascc_architecture *a = w->a;
    char name[64];
    (void)snprintf(name, sizeof name, "%s.boundary", layer);
    add_convolution(w, &(convolution){.name = name,
                                      .source = "boundary",
                                      .relative = level == 0,
                                      .bumps = level ? a->bumps : a->wall_bumps,
                                      .radius = level ? COARSE_RADIUS * voxel_of(a, level)
                                                      : a->wall_radius * a->spacing});
}

static void first_layer(writer *w)
{
    const ascc_architecture *a = w->a;
    begin_layer(w, "l0", "fluid", a->channels);
    add_convolution(w, &(convolution){.name = "l0.fluid",
                                      .source = "fluid",
                                      .relative = true,
                                      .bias = true,
                                      .bumps = a->bumps,
                                      .radius = a->radius * a->spacing});
    add_wall_convolution(w, "l0", 0);
}

/* A layer that reads the one before it on the same set: convolution + dense + identity. */
static void same_layer(writer *w, const char *name, const char *source, int32_t level)
{
    const ascc_architecture *a = w->a;
    char points[16], part[64];
    points_of(level, "fluid", points);
    begin_layer(w, name, points, channels_of(a, level));
    add_convolution(
        w, &(convolution){.name = name,
                          .source = source,
                          .relu = true,
                          .bias = true,
                          .bumps = a->bumps,
                          .radius = (level ? COARSE_RADIUS : a->radius) * voxel_of(a, level)});
    (void)snprintf(part, sizeof part, "%s.dense", name);
    add_dense(w, part, source, true);
    add_identity(w, source);
}

/* From `source`, one level finer, to layer d on `level` and those that follow there; `last` receives
 * the name of the last. */
static void go_down(writer *w, int32_t level, const char *source, char last[32])
{
    const ascc_architecture *a = w->a;
    char points[16], name[32], part[64];
    points_of(level, "fluid", points);
    (void)snprintf(name, sizeof name, "d%d", level);
    (void)snprintf(part, sizeof part, "%s.down", name);
    begin_layer(w, name, points, channels_of(a, level));
    add_crossing(w, part, source, level, true);
    if (a->sampling == ASCC_SAMPLE_FARTHEST) {
        add_wall_convolution(w, name, level);
    } else if (level == 1) { /* coarser ones hear of the walls from there */
        (void)snprintf(part, sizeof part, "%s.walls", name);
        add_crossing(w, part, "boundary", level, false);
    }
    for (int32_t k = 1; k <= a->coarse_layers; k++) {
        char next[32];
        (void)snprintf(next, sizeof next, "c%d_%d", level, k);
        same_layer(w, next, name, level);
        memcpy(name, next, sizeof name);
    }
    memcpy(last, name, sizeof name);
}

static void add_up(writer *w, const char *layer, int32_t level, const char *source)
{
    char part[64];
    (void)snprintf(part, sizeof part, "%s.up", layer);
    add_crossing(w, part, source, level + 1, true);
}

/* From `source`, one level coarser, to layers u and v on `level`, beside `own`, the last on the way
 * down. */
static void go_up(writer *w, int32_t level, const char *source, const char *own, char last[32])
{
    char points[16], name[32], part[64];
    points_of(level, "fluid", points);
    (void)snprintf(name, sizeof name, "u%d", level);
    (void)snprintf(part, sizeof part, "%s.dense", name);
    begin_layer(w, name, points, channels_of(w->a, level));
    add_up(w, name, level, source);
    add_dense(w, part, own, true);
    add_identity(w, own);
    (void)snprintf(last, 32, "v%d", level);
    same_layer(w, last, name, level);
}

/* All levels; `last` receives the name of the last layer on level 1. */
static void coarse_layers(writer *w, char last[32])
{
    char own[ASCC_ARCHITECTURE_LEVELS + 1][32] = {"l0"};
    const int32_t levels = w->a->levels;
    for (int32_t level = 1; level <= levels; level++)
        go_down(w, level, own[level - 1], own[level]);
    memcpy(last, own[levels], 32);
    for (int32_t level = levels - 1; level >= 1; level--) {
        char source[32];
        memcpy(source, last, sizeof source);
        go_up(w, level, source, own[level], last);
    }
}

static void end_plain(writer *w)
{
    add(&w->network, "]}],\"output\":{\"type\":\"plain\",\"source\":\"correction\",\"scale\":%.9g}",
        SCALE * w->a->spacing);
}

/* The last value is the correction itself. */
static void plain_output(writer *w, const char *last)
{
    const ascc_architecture *a = w->a;
    begin_layer(w, "correction", "fluid", a->dimension);
    add_convolution(w, &(convolution){.name = "correction.fluid",
                                      .source = last,
                                      .relu = true,
                                      .bias = true,
                                      .bumps = a->bumps,
                                      .radius = a->radius * a->spacing});
    add_wall_convolution(w, "correction", 0);
    end_plain(w);
}

static void output_kernels(writer *w, const char *prefix)
{
    add(&w->network, "\"kernel\":\"%s.kernel\"", prefix);
    if (w->a->damping)
        add(&w->network, ",\"damping\":\"%s.damping\"", prefix);
}

static void central_output(writer *w, const char *last)
{
    const ascc_architecture *a = w->a;
    add(&w->network,
        "]}],\"output\":{\"type\":\"antisymmetric\",\"source\":\"%s\",\"relu\":true,\"scale\":%.9g,"
        "\"radius\":%.9g,\"basis\":{\"bumps\":%d},",
        last, SCALE * a->spacing,
        (a->output_radius > 0.0 ? a->output_radius : a->radius) * a->spacing, a->output_bumps);
    output_kernels(w, "output");
    if (a->impulse_limit > 0.0)
        add(&w->network, ",\"limit\":%.9g", a->impulse_limit * a->spacing);
    add(&w->network, ",\"walls\":{\"radius\":%.9g,\"basis\":{\"bumps\":%d},",
        a->wall_radius * a->spacing, a->wall_bumps);
    output_kernels(w, "output.walls");
    if (a->contact > 0.0)
        add(&w->network, ",\"contact\":%.9g", a->contact * a->spacing);
    add(&w->network, "}%s}", a->advected && !a->seen_direction ? ",\"direction\":\"current\"" : "");
}

static void basis_network(writer *w)
{
    const ascc_architecture *a = w->a;
    char coarse[32], last[32] = "l0";
    add(&w->network,
        ",\"features\":{\"fluid\":[\"one\",\"motion\"%s],"
        "\"boundary\":[\"one\",\"normal\",\"motion\"]},\"layers\":[",
        a->gravity_seen ? ",\"gravity\"" : "");
    first_layer(w);
    if (a->levels)
        coarse_layers(w, coarse);
    for (int32_t k = 1; k < a->fine_layers; k++) {
        char name[32];
        (void)snprintf(name, sizeof name, "l%d", k);
        same_layer(w, name, last, 0);
        if (k == 1 && a->levels)
            add_up(w, name, 0, coarse);
        memcpy(last, name, sizeof last);
    }
    if (a->output == ASCC_OUTPUT_PLAIN)
        plain_output(w, last);
    else
        central_output(w, last);
}

/* ---- The GRID family ----------------------------------------------------------------------------- */

/* Cells along each axis of a filter. */
static void add_cells(writer *w, int32_t cells)
{
    add(&w->network, ",\"cells\":[%d,%d,%d]", cells, cells, w->a->dimension == 2 ? 1 : cells);
}

typedef struct grid_term {
    const char *name, *source;
    bool relu;
    int32_t column, outputs;
    int32_t level; /* the coarser of source and layer */
} grid_term;

/* A filter of the paper: cells along each axis, the ball mapped to the cube keeping volumes. */
static void add_grid_convolution(writer *w, const grid_term *t)
{
    const ascc_architecture *a = w->a;
    begin_term(w, "convolution", t->source, t->relu);
    add(&w->network, ",\"column\":%d,\"outputs\":%d,\"kernel\":\"%s.kernel\"", t->column,
        t->outputs, t->name);
    add_bias(w, t->name);
    add(&w->network, ",\"radius\":%.9g,\"window\":\"poly6\",\"mapping\":\"volume\"",
        a->radius * voxel_of(a, t->level));
    add_cells(w, a->dimension == 2 ? 8 : 4);
    add(&w->network, "}");
}

static void add_grid_dense(writer *w, const char *name, const char *source, int32_t column,
                           int32_t outputs)
{
    begin_term(w, "dense", source, false);
    add(&w->network, ",\"column\":%d,\"outputs\":%d,\"weight\":\"%s\"}", column, outputs, name);
}

/* Side by side: what the fluid around, the walls around and the point itself say. */
static void grid_first_layer(writer *w)
{
    const ascc_architecture *a = w->a;
    const int32_t part = a->channels / 4;
    begin_layer(w, "l0", "all", a->channels);
    add_grid_convolution(
        w, &(grid_term){.name = "l0.fluid", .source = "fluid", .outputs = a->channels - 2 * part});
    add_grid_convolution(w, &(grid_term){.name = "l0.boundary",
                                         .source = "boundary",
                                         .column = a->channels - 2 * part,
                                         .outputs = part});
    add_grid_dense(w, "l0.fluid.dense", "fluid", a->channels - part, part);
    add_grid_dense(w, "l0.boundary.dense", "boundary", a->channels - part, part);
}

static void grid_name(char name[32], int32_t layer, int32_t branch)
{
    if (layer)
        (void)snprintf(name, 32, "l%d_%d", layer, branch);
    else
        (void)snprintf(name, 32, "l0");
}

/* A branch sees those at most APART levels finer or coarser: farther, a point would have many thousands
 * of neighbours. So branches come one layer after another, and go likewise before the last. */
enum { APART = 2 };

static bool branch_exists(const ascc_architecture *a, int32_t layer, int32_t branch)
{
    const int32_t last = a->fine_layers - 1;
    return branch <= a->levels && branch <= APART * layer && branch <= APART * (last - layer);
}

static bool branch_sees(const ascc_architecture *a, int32_t layer, int32_t branch, int32_t from)
{
    return branch_exists(a, layer - 1, from) && abs(branch - from) <= APART;
}

static void grid_branch(writer *w, int32_t layer, int32_t branch)
{
    const ascc_architecture *a = w->a;
    const int32_t outputs = channels_of(a, branch);
    char name[32], source[32], points[16], part[64];
    grid_name(name, layer, branch);
    points_of(branch, "all", points);
    begin_layer(w, name, points, outputs);
    for (int32_t from = 0; from <= a->levels; from++) {
        if (!branch_sees(a, layer, branch, from))
            continue;
        grid_name(source, layer - 1, from);
        (void)snprintf(part, sizeof part, "%s.%d", name, from);
        add_grid_convolution(w, &(grid_term){.name = part,
                                             .source = source,
                                             .relu = true,
                                             .outputs = outputs,
                                             .level = from > branch ? from : branch});
    }
    if (!branch_exists(a, layer - 1, branch))
        return;
    grid_name(source, layer - 1, branch);
    (void)snprintf(part, sizeof part, "%s.dense", name);
    add_dense(w, part, source, true);
    add_identity(w, source);
}

static void grid_antisymmetric_output(writer *w, const char *last)
{
    const ascc_architecture *a = w->a;
    add(&w->network,
        "]}],\"output\":{\"type\":\"antisymmetric\",\"source\":\"%s\",\"relu\":true,\"scale\":%.9g,"
        "\"kernel\":\"output.kernel\",\"stored\":\"half\",\"half_axis\":\"y\",\"radius\":%.9g,"
        "\"window\":\"peak\",\"mapping\":\"volume\",\"projection\":\"%s\"",
        last, SCALE * a->spacing, a->radius * a->spacing,
        ascc_architecture_projections[a->radial ? 1 : 0]);
    add_cells(w, a->dimension == 2 ? 8 : 6);
    add(&w->network, "}");
}

static void grid_plain_output(writer *w, const char *last)
{
    begin_layer(w, "correction", "fluid", w->a->dimension);
    add_grid_convolution(
        w, &(grid_term){
               .name = "correction", .source = last, .relu = true, .outputs = w->a->dimension});
    end_plain(w);
}

static void grid_network(writer *w)
{
    const ascc_architecture *a = w->a;
    const int32_t last = a->fine_layers - 1;
    char name[32];
    add(&w->network, ",\"features\":{\"fluid\":[\"one\",\"velocity\"],"
                     "\"boundary\":[\"one\",\"normal\"]},\"layers\":[");
    grid_first_layer(w);
    for (int32_t layer = 1; layer <= last; layer++)
        for (int32_t branch = 0; branch_exists(a, layer, branch); branch++)
            grid_branch(w, layer, branch);
    grid_name(name, last, 0);
    if (a->output == ASCC_OUTPUT_PLAIN)
        grid_plain_output(w, name);
    else
        grid_antisymmetric_output(w, name);
}

/* ---- The whole description ------------------------------------------------------------------------------ */

static void add_levels(writer *w)
{
    static const char *const methods[3] = {"voxel_centers", "voxel_corners", "farthest"};
    const ascc_architecture *a = w->a;
    const bool farthest = a->sampling == ASCC_SAMPLE_FARTHEST;
    add(&w->network, ",\"levels\":[");
    for (int32_t level = 1; level <= a->levels; level++)
        add(&w->network, "%s{\"%s\":%.9g}", level > 1 ? "," : "", farthest ? "ratio" : "voxel",
            farthest ? pow(0.5, level * a->dimension) : voxel_of(a, level));
    add(&w->network, "],\"sampling\":{\"method\":\"%s\"%s%s}", methods[a->sampling],
        farthest ? "" : ",\"anchor\":\"world\"",
        a->sampling == ASCC_SAMPLE_CORNERS ? ",\"hysteresis\":0" : "");
}

static void add_head(writer *w)
{
    const ascc_architecture *a = w->a;
    bytes *b = &w->network;
    add(b, "{\"name\":\"");
    add_escaped(b, a->name);
    add(b, "\",\"description\":\"");
    add_escaped(b, a->description);
    add(b, "\",\"dimension\":%d,\"time_step\":%.9g,\"gravity\":[%.9g,%.9g", a->dimension,
        a->time_step, a->gravity[0], a->gravity[1]);
    if (a->dimension == 3)
        add(b, ",%.9g", a->gravity[2]);
    add(b, "],\"particle_spacing\":%.9g,\"rest_density\":%.9g,\"evaluate\":\"%s\"", a->spacing,
        a->rest_density, ascc_architecture_evaluates[a->advected ? 1 : 0]);
    if (a->levels)
        add_levels(w);
}

static const char *basis_fault(const ascc_architecture *a)
{
    if (a->bumps < 1 || a->bumps > ASCC_ARCHITECTURE_BUMPS || a->wall_bumps < 1 ||
        a->wall_bumps > ASCC_ARCHITECTURE_BUMPS || a->order < 0 ||
        a->order > ASCC_ARCHITECTURE_ORDER)
        return "there are 1 to 8 bumps and wall_bumps, and orders 0 to 2";
    if (a->radial)
        return "projection is for kernel grid: a basis is central by itself";
    if (a->damping && a->output == ASCC_OUTPUT_PLAIN)
        return "damping needs output antisymmetric";
    if (!(a->contact >= 0.0) || a->contact > a->wall_radius)
        return "contact is within 0 and wall_radius";
    if (!(a->impulse_limit >= 0.0) || a->impulse_limit > 1e6)
        return "impulse_limit is within 0 and 1e6";
    if ((a->contact > 0.0 || a->impulse_limit > 0.0) && a->output == ASCC_OUTPUT_PLAIN)
        return "contact and impulse_limit need output antisymmetric";
    return NULL;
}

static const char *grid_fault(const ascc_architecture *a)
{
    if (a->damping)
        return "damping needs kernel basis";
    if (a->gravity_seen || a->contact != 0.0 || a->impulse_limit != 0.0)
        return "gravity_seen, contact and impulse_limit need kernel basis";
    if (a->channels < 4)
        return "kernel grid takes at least 4 channels";
    if (a->levels > APART * ((a->fine_layers - 1) / 2))
        return "kernel grid takes 3 fine_layers for 2 levels, 5 for 3";
    if (a->radial && a->output == ASCC_OUTPUT_PLAIN)
        return "projection needs output antisymmetric";
    return NULL;
}

/* What is wrong with the numbers, NULL = nothing. */
static const char *fault(const ascc_architecture *a)
{
    if (a->dimension != 2 && a->dimension != 3)
        return "dimension must be 2 or 3";
    if (!(a->spacing > 0.0) || !(a->time_step > 0.0) || !(a->rest_density > 0.0))
        return "spacing, time_step and rest_density must be positive";
    if (a->channels < 1 || a->channels > ASCC_ARCHITECTURE_CHANNELS || a->fine_layers < 2 ||
        a->fine_layers > 16)
        return "there are 1 to 1024 channels and 2 to 16 fine_layers";
    if (a->levels < 0 || a->levels > ASCC_ARCHITECTURE_LEVELS || a->coarse_layers < 1 ||
        a->coarse_layers > 16)
        return "there are 0 to 3 levels and 1 to 16 coarse_layers";
    for (int32_t level = 0; level < a->levels; level++)
        if (a->coarse_channels[level] < 1 || a->coarse_channels[level] > ASCC_ARCHITECTURE_CHANNELS)
            return "each level has 1 to 1024 coarse_channels";
    if (!(a->radius > 0.0) || !(a->wall_radius > 0.0))
        return "radius and wall_radius must be positive";
    return a->kernel == ASCC_FAMILY_BASIS ? basis_fault(a) : grid_fault(a);
}

char *ascc_architecture_describe(const ascc_architecture *a, char *error, size_t capacity)
{
    writer w = {.a = a};
    const char *wrong = fault(a);
    if (!wrong) {
        add_head(&w);
        if (a->kernel == ASCC_FAMILY_BASIS)
            basis_network(&w);
        else
            grid_network(&w);
        add(&w.network, "}");
        wrong = w.network.failed ? "no memory" : NULL;
    }
    if (!wrong)
        return w.network.data;
    (void)snprintf(error, capacity, "%s", wrong);
    free(w.network.data);
    return NULL;
}
