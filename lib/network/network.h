/* Runs a layer plan over a hierarchy: demand backwards, values forwards.
 * SPDX-License-Identifier: MIT
 *
 * Backwards: from the rows of the last layer that fluid particles need, through the neighbour lists, to
 * the rows of every value that can reach a fluid particle; only those are searched and computed.
 */
#ifndef ASCC_NETWORK_H
#define ASCC_NETWORK_H

#include "edges.h"
#include "hierarchy.h"
#include "model/operation.h"
#include "model/packed.h"

/* Which copies of a value its readers want: as it is, and with negative numbers read as 0. */
#define ASCC_WANTS_RAW 1
#define ASCC_WANTS_RECTIFIED 2
/* And what it would be of walls' motions in place of their normals, where any moves. */
#define ASCC_WANTS_DRIFT 4

/* What follows from the plan alone, prepared once and then constant. */
typedef struct ascc_network {
    const ascc_allocator *allocator;
    const ascc_plan *plan;
    const ascc_packed *packed;
    int32_t value_count;
    int32_t key_count;
    ascc_list_key *key;                  /* [key_count] of all neighbour lists */
    int32_t (*term_key)[ASCC_MAX_LISTS]; /* [term_count + 1], last: the output; -1 = none */
    int32_t edge_key;                    /* whose entries are the edges; -1 = there are none */
    /* m: a wall farther than this from all fluid, on every axis, is not seen; or INFINITY */
    double wall_reach;
    int32_t relaxation_key[2]; /* fluid and walls around the fluid; -1 = there is no relaxation */
    uint8_t *wants;            /* [value_count] ASCC_WANTS_* */
    int32_t *last_reader;      /* [value_count] layers; layer_count: the output or the relaxation */
    int32_t max_neighbors;     /* of a point, before LIMIT */
    int32_t looked_at;         /* value that is kept as it is, whoever reads it; 0 = none */
    bool
        keeps_values; /* also those that readers are given tile by tile: for a way back, as all of a step then */
} ascc_network;

ascc_status ascc_network_create(ascc_network *network, const ascc_allocator *allocator,
                                const ascc_plan *plan, const ascc_packed *packed,
                                int32_t max_neighbors, ascc_message *message);
void ascc_network_destroy(ascc_network *network);
/* From now on this layer's value is kept as it is, for one who reads it after the network. */
void ascc_network_look_at(ascc_network *network, int32_t layer);

static inline int32_t ascc_network_set(const ascc_network *network, int32_t value)
{
    return ascc_plan_value_set(network->plan->layer, value);
}

static inline int32_t ascc_network_channels(const ascc_network *network, int32_t value)
{
    return ascc_plan_value_channels(network->plan, network->plan->layer, value);
}

/* One value in one step; rows that nobody reads hold garbage. */
typedef struct ascc_value {
    uint8_t *active;  /* [rows] */
    float *raw;       /* [rows][padded channels], NULL if only the rectified are read */
    float *rectified; /* or NULL */
    float
        *drift; /* of walls' motions in place of their normals and nothing else; NULL: none moves */
    bool fresh; /* with a halo: ghosts are what their owners have */
} ascc_value;

typedef struct ascc_network_run {
    const ascc_network *network;
    const ascc_plan *plan;
    ascc_hierarchy *hierarchy;
    const ascc_search_tools *tools;
    ascc_value *value;
    ascc_rows *rows; /* [key_count] */
    ascc_edges edges;
    uint32_t **table; /* [key_count] what operations make of a list, else NULL */
    float *
        guess; /* [fluid rows] the pressure that a relaxation begins with, 0 where none; NULL: it has none */
    ascc_arena_point
        before_layers; /* what was taken since is read by layers and the output alone */
    size_t neighbor_count;
    uint32_t longest;
} ascc_network_run;

/* Rows of a value on this set. */
static inline size_t ascc_network_rows(const ascc_network_run *run, int32_t set)
{
    return set == ASCC_SET_EDGES ? run->edges.count : run->hierarchy->set[set].count;
}

/* Finds the rows every value needs and searches them. expected: [key_count] neighbours of each list in
 * the last step, kept by the caller; or NULL. errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_network_demand(ascc_network_run *run, const ascc_network *network,
                                ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                size_t *expected);

/* Computes all values from the features, [host's rows][channels] of fluid and boundary.
 * errors: MEMORY. */
ascc_status ascc_network_forward(ascc_network_run *run, const float *fluid_features,
                                 const float *boundary_features);

/* Gives back what only layers and the output read, once impulses are there: values, and lists of their own. What
 * stays are flags, counts, and the lists of fluid that relaxation and contact read. Nothing, if values are kept. */
void ascc_network_done(ascc_network_run *run);

/* Is the value of a layer given to its readers tile by tile, and never stored? */
bool ascc_network_passes_on(const ascc_network *network, int32_t layer);

/* Does a term sum motions of walls where it sums normals? */
bool ascc_network_carries(const ascc_network *network, const ascc_term *term);

/* ---- What operations read ---- */

/* Rows of a layer that are computed together: their columns share one pass over the weights. */
#define ASCC_TILE_ROWS 24
/* Floats between the columns of a tile beyond their length, so that they do not collide in the cache. */
#define ASCC_COLUMN_PADDING 16

typedef struct ascc_tile {
    const ascc_network_run *run;
    const ascc_layer *layer;
    const uint32_t *list; /* rows of the layer's set */
    size_t n;
    float *sum; /* [n][width]: what terms add to, each from its column on; 8 more may be written */
    size_t width;
    float *column;  /* scratch: [n][column + ASCC_COLUMN_PADDING] */
    float *scratch; /* as the operation asked for */
    size_t room;
    const uint32_t *sequence; /* 0, 1, 2, ... [room] */
    const float
        *given; /* rows of the source as they come, given_width apart; NULL = from its value */
    size_t given_width;
} ascc_tile;

/* The value that a term reads, rectified if it wants that. */
static inline const float *ascc_term_source(const ascc_network_run *run, const ascc_term *term)
{
    const ascc_value *value = &run->value[term->source];
    return term->rectify ? value->rectified : value->raw;
}

static inline const float *ascc_term_packed(const ascc_network_run *run, const ascc_term *term)
{
    return run->network->packed->term[ascc_plan_term_number(run->plan, term)];
}

/* A term's neighbour list of this number. */
static inline const ascc_rows *ascc_term_list(const ascc_network_run *run, const ascc_term *term,
                                              int list)
{
    return &run->rows[run->network->term_key[ascc_plan_term_number(run->plan, term)][list]];
}

/* Areas that walls count by, their features' rows apart, in the order of their set; NULL = each counts once. */
static inline const float *ascc_wall_areas(const ascc_network_run *run)
{
    const int32_t channel = ascc_plan_feature(run->plan, 1, ASCC_FEATURE_AREA);
    return channel >= 0 ? run->value[1].raw + channel : NULL;
}

/* How a row of the boundary moves, spacings a time step. */
static inline void ascc_wall_drift(const ascc_network_run *run, size_t row, double drift[3])
{
    for (int c = 0; c < 3; c++)
        drift[c] = run->hierarchy->drift ? (double)run->hierarchy->drift[row * 4 + (size_t)c] : 0.0;
}

/* What the terms of a layer need at most. */
ascc_scratch_sizes ascc_network_sizes(const ascc_network_run *run, const ascc_layer *layer);

/* The row of `to` that is the same particle as this row of `from`; false if there is none. */
bool ascc_network_shared_row(const ascc_hierarchy *hierarchy, int32_t from, int32_t to, size_t row,
                             size_t *shared);

#endif
