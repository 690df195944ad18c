/* A network as the solver runs it: an immutable plan of layers, checked once when it is loaded.
 * SPDX-License-Identifier: MIT
 *
 * The plan is a list of values. Value 0 holds the features of the fluid particles, value 1 those of
 * the boundary particles; layer i makes value i + 2, on one point set, as a sum of terms:
 *
 *     value[row][column ..] += operation(source value)
 *
 * so "concat" is terms with different columns, "sum" terms with the same. The output is the last term:
 * what it makes of its source are impulses. Which operations there are stands in network/operations.list.
 */
#ifndef ASCC_PLAN_H
#define ASCC_PLAN_H

#include <math.h>

#include "base/context.h"

#define ASCC_MAX_LEVELS 8
#define ASCC_MAX_CHANNELS 1024
#define ASCC_MAX_LAYERS 256
#define ASCC_MAX_TERMS 2048
#define ASCC_MAX_CELLS 4096 /* of one kernel */
#define ASCC_MAX_BUMPS 8    /* functions of a radial basis */
#define ASCC_MAX_ORDER 2
#define ASCC_MAX_FEATURES 8
#define ASCC_MAX_SWEEPS 32  /* of a relaxation */
#define ASCC_PLAN_MIN 1e-15 /* smallest and largest length, time or density a file may state */
#define ASCC_PLAN_MAX 1e15

/* Point sets. Level 0 is fluid + boundary; set ASCC_SET_LEVEL + l - 1 is level l >= 1. */
enum { ASCC_SET_FLUID = 0, ASCC_SET_BOUNDARY = 1, ASCC_SET_ALL = 2, ASCC_SET_LEVEL = 3 };
/* The level of a set of fluid or a level. */
static inline int32_t ascc_set_level(int32_t set)
{
    return set < ASCC_SET_LEVEL ? 0 : set - ASCC_SET_LEVEL + 1;
}

#define ASCC_MAX_SETS (ASCC_SET_LEVEL + ASCC_MAX_LEVELS - 1)
/* No points, but pairs of them: its rows are the entries of one neighbour list (network/edges.h). */
#define ASCC_SET_EDGES ASCC_MAX_SETS

typedef enum ascc_window {
    ASCC_WINDOW_NONE,
    ASCC_WINDOW_POLY6,
    ASCC_WINDOW_PEAK,
    ASCC_WINDOW_HAT, /* trilinear within a cube */
} ascc_window;

typedef enum ascc_mapping {
    ASCC_MAPPING_IDENTITY,  /* the ball's bounding cube */
    ASCC_MAPPING_RADIAL,    /* r scaled so that the ball fills the cube */
    ASCC_MAPPING_VOLUME,    /* volume preserving */
    ASCC_MAPPING_DIRECTION, /* of a basis: unit vector and distance */
} ascc_mapping;

/* How an operation looks around a point. */
typedef struct ascc_filter {
    /* Of a grid: along x, y, z; 2D: z = 1. Of a basis: harmonics, bumps, 1. */
    int32_t cells[3];
    int32_t neighbor_limit; /* mutual where source and query are one set; 0 = none */
    ascc_window window;
    ascc_mapping mapping;
    int32_t skip_self;    /* a point with the query's very position is no neighbour */
    int32_t bumps, order; /* of a basis in place of a grid, else 0 */
    int32_t reserved;
    double radius; /* m; 0 = it does not look around */
} ascc_filter;

/* Numbers of a filter's kernel: cells of a grid, members of a basis. */
static inline size_t ascc_cell_count(const ascc_filter *filter)
{
    return (size_t)filter->cells[0] * (size_t)filter->cells[1] * (size_t)filter->cells[2];
}

#define ASCC_MAX_TENSORS 4
enum { ASCC_TENSOR_WEIGHT = 0, ASCC_TENSOR_BIAS = 1 }; /* what most operations have */

struct ascc_operation;

typedef struct ascc_term {
    const struct ascc_operation *operation;
    int32_t source;  /* value, made earlier */
    int32_t rectify; /* ReLU on the source's values as they are read */
    int32_t column;  /* first column of the layer it adds to */
    int32_t inputs;  /* channels of the source */
    int32_t outputs; /* columns it adds to; column + outputs <= layer's channels */
    int32_t
        gathered; /* numbers of one cell of a column: the inputs, unless the operation says otherwise */
    const float *tensor[ASCC_MAX_TENSORS]; /* as in the file; which is which, the operation says */
    double option[4];                      /* the operation's own */
    ascc_filter filter;
} ascc_term;

typedef struct ascc_layer {
    char name[32];
    int32_t set;
    int32_t channels;
    int32_t first_term, term_count;
} ascc_layer;

/* The last term, and what follows it. */
typedef struct ascc_output {
    ascc_term term;
    int32_t conserves; /* momentum: each impulse is a pair's */
    int32_t central;   /* and lies on the line between the two, as the network sees them ... */
    int32_t current_direction; /* ... or, fluid pairs, as they are before the step */
    int32_t half_axis;         /* of a kernel of which half is stored; -1 = all of it is */
    int32_t has_walls;         /* pairs of a fluid particle and a wall are on their own */
    int32_t reserved;
    ascc_filter walls;
    double scale[3]; /* metres of position correction in one time step per unit of output */
    double limit;    /* the greatest such correction by one pair, m; 0 = none */
    double contact;  /* m: no particle comes closer to a wall (step/contact.h); 0 = no contact */
} ascc_output;

/* Tensors of an output with pairs; the latter three with a basis only. */
enum {
    ASCC_TENSOR_STRENGTH = 0,
    ASCC_TENSOR_DAMPING = 1,
    ASCC_TENSOR_WALL = 2,
    ASCC_TENSOR_WALL_DAMPING = 3
};

/* The greatest strength of a pair, in units of output. */
static inline double ascc_output_limit(const ascc_output *output)
{
    const double scale = output->scale[0] < 0.0 ? -output->scale[0] : output->scale[0];
    return output->limit > 0.0 ? output->limit / scale : HUGE_VAL;
}

/* A relaxation shares the neighbour list of a term that looks farther, by this factor at most. */
#define ASCC_LONGER 2.0

/* Jacobi sweeps of a relaxation. */
typedef struct ascc_sweeps {
    int32_t count;
    double omega[ASCC_MAX_SWEEPS]; /* of each: what its correction is multiplied with */
} ascc_sweeps;

#define ASCC_MAX_ROUNDS 8 /* of a relaxation */

/* Pressure from a few sweeps after the network, and one convolution of it (docs/method.md). */
typedef struct ascc_relaxation {
    ascc_sweeps pressure; /* none = there is no relaxation */
    ascc_sweeps divergence;
    ascc_sweeps viscosity;  /* of roughness: how much of its roughness each sweep takes */
    double viscosity_below; /* what is rougher than this is left alone, m/s */
    int32_t rounds;         /* of pressure sweeps at most: 1 or more */
    double again;           /* another one follows one that began with an excess above this */
    double left;        /* and only if those before left one above this; -1 = whatever they left */
    double epsilon;     /* of the lattice's response, added to each particle's own */
    double support;     /* of the cubic spline, m */
    double rest_volume; /* of a particle, m^dimension */
    double limit;       /* the greatest correction of a position by one pair, m */
    double repulsion, stiffness; /* pairs nearer than this, m, part by this share of the lack */
    double contact;              /* as of an output, for a model that has none there; m */
    int32_t current_direction;   /* corrections are turned to the lines before the step */
    int32_t
        guess; /* value that pressures begin with, rectified, in units of 1 / D of a lattice at rest; 0 =
                      none: they begin with 0 */
    /* What follows: */
    double reach;            /* of the neighbour lists, m */
    double amount;           /* the spline's middle times rest_volume */
    double lattice_response; /* D of a lattice at rest, supports^-2 */
} ascc_relaxation;

typedef enum ascc_feature {
    ASCC_FEATURE_ONE,
    ASCC_FEATURE_VELOCITY, /* fluid: after external forces, m/s; dimension channels */
    ASCC_FEATURE_NORMAL,   /* boundary; dimension channels */
    ASCC_FEATURE_MOTION,   /* velocity in spacings a time step; walls 0; dimension channels */
    ASCC_FEATURE_GRAVITY, /* fluid: the step's, in spacings a squared time step; dimension channels */
    ASCC_FEATURE_AREA,    /* boundary: what a point stands for, in spacings^(dimension - 1) */
    ASCC_FEATURE_HISTORY, /* fluid: velocities before the last steps, as motion; `dimension` channels each */
} ascc_feature;

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
    /* The range that the weights were trained in: time steps, s; gravity, spacings a squared step; the way of a
     * particle, spacings a step. */
    double time_step_min, time_step_max, gravity_min, gravity_max, way_max;
    int32_t fluid_features[ASCC_MAX_FEATURES], fluid_feature_count, fluid_channels;
    int32_t boundary_features[ASCC_MAX_FEATURES], boundary_feature_count, boundary_channels;
    int32_t history;      /* velocities of earlier steps that the feature has; 0 = there is none */
    double boundary_crop; /* m: walls farther than this from the fluid's bounding box are left out;
                             <= 0: none are */
    int32_t level_count;
    ascc_sampling sampling;
    int32_t
        centroid_anchor; /* voxel grids hang on the mean of level 0 instead of the world's origin */
    int32_t fluid_sampled; /* levels have points where fluid is, not where walls are */
    double hysteresis;     /* of ASCC_SAMPLING_CORNERS, in voxels */
    ascc_level level[ASCC_MAX_LEVELS];
    int32_t edge_set;   /* whose points edges connect */
    double edge_radius; /* m: of edges; 0 = the network has none */
    int32_t layer_count, term_count;
    ascc_layer *layer;
    ascc_term *term;
    ascc_output output;
    ascc_relaxation relaxation;
    uint64_t parameter_count;
} ascc_plan;

/* A term by number; number term_count is the output. */
static inline const ascc_term *ascc_plan_term(const ascc_plan *plan, int32_t t)
{
    return t < plan->term_count ? &plan->term[t] : &plan->output.term;
}

static inline int32_t ascc_plan_term_number(const ascc_plan *plan, const ascc_term *term)
{
    return term == &plan->output.term ? plan->term_count : (int32_t)(term - plan->term);
}

/* Set and channels of a value; layer: the plan's, or those of one that is being made. */
static inline int32_t ascc_plan_value_set(const ascc_layer *layer, int32_t value)
{
    return value < 2 ? value : layer[value - 2].set;
}

static inline int32_t ascc_plan_value_channels(const ascc_plan *plan, const ascc_layer *layer,
                                               int32_t value)
{
    return value == 0   ? plan->fluid_channels
           : value == 1 ? plan->boundary_channels
                        : layer[value - 2].channels;
}

/* Channels as they are stored: a multiple of 8, the rest zeros. */
static inline size_t ascc_padded(int32_t channels)
{
    return ((size_t)channels + 7) / 8 * 8;
}

static inline int32_t ascc_feature_channels(const ascc_plan *plan, int32_t feature)
{
    return feature == ASCC_FEATURE_ONE || feature == ASCC_FEATURE_AREA ? 1
           : feature == ASCC_FEATURE_HISTORY ? plan->history * plan->dimension
                                             : plan->dimension;
}

/* First channel of a feature of value 0 (fluid) or 1 (boundary), -1 = it has none. */
static inline int32_t ascc_plan_feature(const ascc_plan *plan, int32_t value, ascc_feature wanted)
{
    const int32_t *feature = value == 0 ? plan->fluid_features : plan->boundary_features;
    const int32_t count = value == 0 ? plan->fluid_feature_count : plan->boundary_feature_count;
    int32_t channel = 0;
    for (int32_t i = 0; i < count; i++) {
        if (feature[i] == (int32_t)wanted)
            return channel;
        channel += ascc_feature_channels(plan, feature[i]);
    }
    return -1;
}

static inline int32_t ascc_plan_motion(const ascc_plan *plan, int32_t value)
{
    return ascc_plan_feature(plan, value, ASCC_FEATURE_MOTION);
}

/* m: within this distance walls count when it is found what each stands for. */
static inline double ascc_plan_wall_support(const ascc_plan *plan)
{
    return plan->relaxation.support > 0.0 ? plan->relaxation.support : 2.0 * plan->spacing;
}

/* ---- Lengths that follow (plan_lengths.c) ---- */

/* m: of the last layer, and how far influence reaches in a step. */
double ascc_plan_support_radius(const ascc_plan *plan);
double ascc_plan_receptive_radius(const ascc_plan *plan);
/* Smallest and largest radius of any neighbour list, m. */
void ascc_plan_radii(const ascc_plan *plan, double *smallest, double *largest);
/* Most neighbours that any list keeps; 0 = all. */
int32_t ascc_plan_neighbor_limit(const ascc_plan *plan);

#endif
