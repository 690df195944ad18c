/* Builds model files in memory for tests. SPDX-License-Identifier: MIT
 *
 *   model_builder b;
 *   model_builder_open(&b);
 *   model_builder_metadata(&b, "format", "ascc.model");
 *   model_builder_tensor(&b, "kernel", 2, (const size_t[]){4, 8}, values);
 *   unsigned char *file = model_builder_finish(&b, &size);      free() it; b is closed
 *
 * Running out of memory aborts: these are tests.
 */
#ifndef MODEL_BUILDER_H
#define MODEL_BUILDER_H

#include <stddef.h>
#include <stdint.h>

typedef struct model_text {
    char *text;
    size_t length, capacity;
} model_text;

/* Appends as printf does, but numbers written with %s and model_number are locale independent. */
void model_text_add(model_text *text, const char *format, ...)
    __attribute__((format(printf, 2, 3)));
void model_text_free(model_text *text);
/* A number as JSON wants it, in one of a few buffers that are used in turn. */
const char *model_number(double value);

typedef struct model_builder {
    model_text metadata, tensors, data;
    const char *type; /* of the tensors: "F32", "F16" or "BF16", which cut values; NULL = "F32" */
    int coarse;       /* 1: values are cut so that all three hold them */
} model_builder;

void model_builder_open(model_builder *builder);
/* Escapes the value. */
void model_builder_metadata(model_builder *builder, const char *key, const char *value);
/* values[product of shape]. */
void model_builder_tensor(model_builder *builder, const char *name, int rank, const size_t *shape,
                          const float *values);
unsigned char *model_builder_finish(model_builder *builder, size_t *size);

/* Bytes around a header as it is given: for headers that are wrong. */
unsigned char *model_builder_raw(const char *header, const void *data, size_t data_size,
                                 size_t *size);

/* A network of random weights, shaped as the paper's: features of fluid and walls, convolutions
 * between all levels, an antisymmetric last layer. Zero is the default of every member. */
typedef struct model_random {
    uint64_t seed;
    int dimension;          /* 0 = 2 */
    int levels;             /* the particles included; 0 = 1 */
    int channels;           /* of each layer, a multiple of 4; 0 = 8 */
    int trunk_layers;       /* after the first; 0 = 2 */
    int cells;              /* of ordinary kernels along each axis; 0 = 4 */
    int output_cells;       /* of the last kernel, even; 0 = 6 */
    double spacing;         /* m; 0 = 0.05 */
    double radius;          /* of level 0, in spacings; 0 = 2 */
    double gain;            /* weights are about this over the square root of their number; 0 = 1 */
    double scale;           /* of the output in spacings; 0 = 0.01 */
    const char *evaluate;   /* NULL = "current" */
    const char *projection; /* NULL = "radial" */
    const char *method;     /* of sampling; NULL = "voxel_centers" */
    const char *anchor;     /* NULL = "world" */
    const char *window;     /* of ordinary convolutions; NULL = "poly6" */
    const char *mapping;    /* NULL = "volume" */
    const char *half_axis;  /* "x", "y", "z": store half the last kernel; NULL = all of it */
    double boundary_crop;   /* spacings; 0 = none */
    int neighbor_limit;     /* of all convolutions; 0 = none */
    int skip_self;          /* in ordinary convolutions */
    int plain;              /* 1: the last layer is a convolution, not an antisymmetric one */
    int fluid_only;         /* 1: layers lie on the fluid, walls only feed the first */
    int bumps;              /* of a basis in place of every grid; 0 = grids */
    int order;              /* of its harmonics */
    int transfer;           /* 1: hats between scales in place of convolutions; 2: normalised */
    int no_hysteresis;      /* of voxel_corners: 0 in place of 0.1 */
    const char *type;       /* of the tensors; NULL = "F32" */
    int coarse;             /* 1: weights that F16 and BF16 hold exactly */
    int motion; /* 1: the feature motion after the others; 2: in place of the velocity, before "one"; 3: likewise, after */
    int gravity;    /* 1: the feature gravity of the fluid, after the others */
    int relative;   /* 1: convolutions of features see motion relative to the query's; fluid_only */
    int damping;    /* 1: of the last layer's pairs, and of its walls'; bumps, fluid_only, motion */
    int walls;      /* 1: the last layer acts on walls, with one bump more; bumps, fluid_only */
    double limit;   /* of what a pair gives, spacings; bumps; 0 = none */
    double contact; /* with walls, spacings; 0 = none */
    int lattice; /* 1: with moments, levels 3, motion 3: a trunk of stencils on lattices where fluid is */
    int moments; /* bumps of a first layer of pair moments, walls' one more; fluid_only, motion */
    /* A first set abstraction, one on farthest points and the way back between three of them; levels 2, farthest.
     * bit 0: this; 1: relative; 2: means in the first, 3: in the second; 4: of the 8 nearest there; 5: a matrix
     * after the interpolation; 6: farthest points of the fluid alone. */
    int abstraction;
    int area;    /* 1: the boundary's feature area in place of one */
    int graph;   /* steps of message passing on a graph, in place of convolutions; plain */
    int history; /* velocities of earlier steps that it sees; graph */
    int guess;   /* 1: a layer "guess" of one channel for the relaxation */
    const char *relaxation; /* JSON object; NULL = none */
    int direction; /* 1: the last layer's pairs act along their present line; bumps, fluid_only */
    const char *trust;    /* statistics of its training, JSON; NULL = none */
    const char *residual; /* type and members of a layer's residual; NULL = identity */
} model_random;

unsigned char *model_builder_random(const model_random *options, size_t *size);

/* A cheap network for benchmarks: 3D, 16 channels, three layers of 3 bumps and order 1 on the fluid, one
 * within a level of twice the spacing, transfers between the two, an antisymmetric basis at the end. */
unsigned char *model_builder_tiny(double spacing, size_t *size);

/* The demonstration network of examples/demo_model.h (link demo_model.c too). */
unsigned char *model_builder_demo(int dimension, double spacing, size_t *size);

/* Small networks of random weights described as the published ones are. With `from`, the first
 * occurrence of that text in the architecture (or in the other metadata) becomes `to`. */
unsigned char *model_builder_dmcf(const char *from, const char *to, size_t *size);
unsigned char *model_builder_cconv(const char *from, const char *to, size_t *size);

/* For fuzzing: a file with the tensors of a small network and another description of it. kind 'n':
 * own format, two levels; 'b': the same in a basis; 'p': set abstractions; 'g': a graph network; 'd', 'c': published; 't': the text is the statistics of a network's training.
 * model_builder_description gives the right one, which is the caller's to free. */
unsigned char *model_builder_described(char kind, const char *text, size_t *size);
char *model_builder_description(char kind);

#endif
