/* A network as the solver runs it: an immutable plan of layers, checked once when it is loaded.
 * SPDX-License-Identifier: MIT
 *
 * The plan is a list of values. Value 0 holds the features of the fluid particles, value 1 those of
 * the boundary particles; layer i makes value i + 2, on one point set, as a sum of terms:
 *
 *     value[row][column ..] += term(source value)
 *
 * so "concat" is terms with different columns, "sum" terms with the same.
 */
#ifndef ASCC_MODEL_H
#define ASCC_MODEL_H

#include <math.h>
#include "base/context.h"

#define ASCC_MAX_LEVELS 8
#define ASCC_MAX_CHANNELS 1024
#define ASCC_MAX_CELLS 4096 /* of one kernel */
#define ASCC_MAX_BUMPS 8
#define ASCC_MAX_ORDER 2

/* Point sets. Level 0 is fluid + boundary; set ASCC_SET_LEVEL + l - 1 is level l >= 1. */
enum { ASCC_SET_FLUID = 0, ASCC_SET_BOUNDARY = 1, ASCC_SET_ALL = 2, ASCC_SET_LEVEL = 3 };
#define ASCC_MAX_SETS (ASCC_SET_LEVEL + ASCC_MAX_LEVELS - 1)

typedef enum ascc_window {
    ASCC_WINDOW_NONE,
    ASCC_WINDOW_POLY6,
    ASCC_WINDOW_PEAK,
    ASCC_WINDOW_HAT, /* of a transfer: trilinear within a cube */
} ascc_window;

typedef enum ascc_mapping {
    ASCC_MAPPING_IDENTITY,  /* the ball's bounding cube */
    ASCC_MAPPING_RADIAL,    /* r scaled so that the ball fills the cube */
    ASCC_MAPPING_VOLUME,    /* volume preserving (SEMANTICS 2) */
    ASCC_MAPPING_DIRECTION, /* of a basis: unit vector and distance */
} ascc_mapping;

/* How a convolution looks around a point. */
typedef struct ascc_filter {
    /* Of a grid: along x, y, z; 2D: z = 1. Of a basis: harmonics, bumps, 1. */
    int32_t cells[3];
    int32_t neighbor_limit; /* mutual where source and query are one set; 0 = none */
    ascc_window window;
    ascc_mapping mapping;
    int32_t skip_self;    /* a point with the query's very position is no neighbour */
    int32_t bumps, order; /* of a basis in place of a grid, else 0 */
    int32_t reserved;
    double radius; /* m */
} ascc_filter;

typedef enum ascc_term_kind {
    ASCC_TERM_CONVOLUTION,
    ASCC_TERM_DENSE,    /* on the rows that source set and layer set share */
    ASCC_TERM_IDENTITY, /* residual: likewise, without weights */
    ASCC_TERM_TRANSFER, /* between scales: trilinear hats as wide as the coarser one's voxels */
} ascc_term_kind;

typedef struct ascc_term {
    ascc_term_kind kind;
    int32_t source;  /* value, made earlier */
    int32_t rectify; /* ReLU on the source's values as they are read */
    int32_t column;  /* first column of the layer it adds to */
    int32_t inputs;  /* channels of the source */
    int32_t outputs; /* columns it adds to; column + outputs <= layer's channels */
    const float *
        weight; /* convolution [z][y][x][inputs][outputs] or, with a basis, [bump][harmonic][inputs]
                    [outputs]; dense, transfer [inputs][outputs]; else NULL */
    const float
        *bias; /* [outputs] or NULL; added to every row the term reaches, also without neighbours */
    int32_t normalize; /* of a transfer: hats are divided by their sum */
    int32_t
        relative; /* of a convolution of features: motion is taken relative to the query's own */
    double voxel; /* of a transfer, m: hats are 0 this far away along any axis */
    ascc_filter filter; /* of a convolution or transfer */
} ascc_term;

/* The term reads neighbours, not rows of its own. */
static inline bool ascc_term_searches(const ascc_term *term)
{
    return term->kind == ASCC_TERM_CONVOLUTION || term->kind == ASCC_TERM_TRANSFER;
}

typedef struct ascc_layer {
    char name[32];
    int32_t set;
    int32_t channels;
    int32_t first_term, term_count;
} ascc_layer;

typedef enum ascc_output_kind {
    ASCC_OUTPUT_PLAIN,         /* the source value is the correction; dimension channels */
    ASCC_OUTPUT_ANTISYMMETRIC, /* Eq. 2 on the source value */
} ascc_output_kind;

/* Pairs of a fluid particle and a wall, from the fluid particle's values alone. */
typedef struct ascc_wall_output {
    int32_t present, reserved;
    ascc_filter filter;            /* a basis */
    const float *weight, *damping; /* [bump][inputs]; damping or NULL */
    double contact; /* m: no particle comes closer (contact.h); 0 = walls have no contact */
} ascc_wall_output;

typedef struct ascc_output {
    ascc_output_kind kind;
    int32_t source;
    int32_t rectify;
    int32_t inputs;
    int32_t radial;            /* pair terms projected on the line between the particles */
    int32_t current_direction; /* that line is taken before the step, whatever the network sees */
    ascc_filter filter;
    /* antisymmetric: the whole kernel [z][y][x][inputs][dimension]; with a basis [bump][inputs], whose
     * pair terms lie on the line between the particles by themselves */
    const float *weight;
    const float *half; /* what `weight` is made of, if half of it is stored; else NULL */
    int32_t half_axis, reserved;
    const float
        *damping; /* [bump][inputs], none negative, times the pair's speed of approach; or NULL */
    ascc_wall_output walls;
    double scale[3]; /* metres of position correction in one time step per unit of output */
    double limit;    /* of a basis: the greatest such correction by one pair, m; 0 = none */
} ascc_output;

/* The greatest strength of a pair, in units of output. */
static inline double ascc_output_limit(const ascc_output *output)
{
    return output->limit > 0.0 ? output->limit / fabs(output->scale[0]) : HUGE_VAL;
}

typedef enum ascc_feature {
    ASCC_FEATURE_ONE,
    ASCC_FEATURE_VELOCITY, /* fluid: after external forces, m/s; dimension channels */
    ASCC_FEATURE_NORMAL,   /* boundary; dimension channels */
    ASCC_FEATURE_MOTION,   /* velocity in spacings a time step; walls 0; dimension channels */
    ASCC_FEATURE_GRAVITY, /* fluid: the step's, in spacings a squared time step; dimension channels */
} ascc_feature;
#define ASCC_MAX_FEATURES 8

typedef enum ascc_sampling {
    ASCC_SAMPLING_CENTERS,  /* centres of occupied voxels (the paper) */
    ASCC_SAMPLING_CORNERS,  /* corners of cells with hysteresis (the published networks) */
    ASCC_SAMPLING_FARTHEST, /* farthest points (the paper's ablation) */
} ascc_sampling;

typedef struct ascc_level {
    double voxel; /* m, level >= 1 */
    double ratio; /* farthest: points kept of level 0, in (0, 1] */
} ascc_level;

typedef enum ascc_advection {
    ASCC_ADVECT_NONE, /* the network sees x (the paper, figure 1) */
    ASCC_ADVECT_END,  /* x + dt v*; v* = v + dt g */
    ASCC_ADVECT_MEAN, /* x + dt (v + v*) / 2, and that mean is the velocity corrected (CConv) */
} ascc_advection;

typedef struct ascc_plan {
    char name[64];
    char description[512];
    int32_t dimension;
    ascc_advection advection;
    double time_step, gravity[3], spacing, rest_density;
    int32_t fluid_features[ASCC_MAX_FEATURES], fluid_feature_count, fluid_channels;
    int32_t boundary_features[ASCC_MAX_FEATURES], boundary_feature_count, boundary_channels;
    double boundary_crop; /* m: walls farther than this from the fluid's bounding box are left out;
                             <= 0: none are */
    int32_t level_count;
    ascc_sampling sampling;
    int32_t
        centroid_anchor; /* voxel grids hang on the mean of level 0 instead of the world's origin */
    int32_t reserved;
    double hysteresis; /* of ASCC_SAMPLING_CORNERS, in voxels */
    ascc_level level[ASCC_MAX_LEVELS];
    int32_t layer_count, term_count;
    ascc_layer *layer;
    ascc_term *term;
    ascc_output output;
    uint64_t parameter_count;
} ascc_plan;

/* First channel of the feature motion of value 0 (fluid) or 1 (boundary), -1 = none. */
static inline int32_t ascc_plan_motion(const ascc_plan *plan, int32_t value)
{
    const int32_t *feature = value == 0 ? plan->fluid_features : plan->boundary_features;
    const int32_t count = value == 0 ? plan->fluid_feature_count : plan->boundary_feature_count;
    int32_t channel = 0;
    for (int32_t i = 0; i < count; i++) {
        if (feature[i] == ASCC_FEATURE_MOTION)
            return channel;
        channel += feature[i] == ASCC_FEATURE_ONE ? 1 : plan->dimension;
    }
    return -1;
}

struct ascc_model {
    uint32_t magic;
    ascc_context *context;            /* retained */
    struct ascc_model_shared *shared; /* reference count */
    unsigned char *bytes;             /* the file as it was read */
    size_t byte_count;
    float *weights; /* all tensors, arranged and aligned; the plan points into it */
    size_t weight_count;
    ascc_plan plan;
};

void ascc_model_retain(ascc_model *model);
void ascc_model_release(ascc_model *model);

#endif
