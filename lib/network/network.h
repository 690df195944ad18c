/* Runs a layer plan over a hierarchy: demand backwards, values forwards.
 * SPDX-License-Identifier: MIT
 *
 * Backwards: from the rows of the last layer that fluid particles need, through the neighbour rows, to
 * the rows of every value that can reach a fluid particle; only those are searched and computed.
 */
#ifndef ASCC_NETWORK_H
#define ASCC_NETWORK_H

#include "hierarchy.h"

/* Which rows a term reads; terms that look alike share them. Their geometry is not kept: computing it
 * where it is used costs less than its memory. */
typedef struct ascc_rows_key {
    int32_t query, source; /* sets */
    int32_t skip_self, limit;
    double radius;   /* m */
    double cube;     /* m: a transfer's voxel, half the edge of a cube; 0 = the ball */
    size_t expected; /* neighbours, from the last step */
} ascc_rows_key;

/* What an output with a basis is made of: strengths and dampings of fluid pairs and of walls. */
enum { ASCC_PART_STRENGTH, ASCC_PART_DAMPING, ASCC_PART_WALL, ASCC_PART_WALL_DAMPING, ASCC_PARTS };

/* What depends on the model alone, prepared once. */
typedef struct ascc_network {
    const ascc_allocator *allocator;
    const ascc_plan *plan;
    int32_t value_count;
    int32_t key_count;
    ascc_rows_key *key; /* [term_count + 2] */
    int32_t *term_key;  /* [term_count + 1], last: the output; -1 = none */
    uint8_t *wants;     /* [value_count] WANTS_*: a bit for each copy of the value */
    /* Weights as the kernels read them, channels filled up to multiples of 8: convolutions
     * [cell][inputs][outputs], dense [inputs][outputs], an antisymmetric output [cell][dimension][inputs] or,
     * with a basis, [inputs][8 bumps] */
    float *weights;
    size_t weight_count;
    const float **term_weight; /* [term_count + 1] */
    /* Parts of an output with a basis, [inputs][8 bumps] each; NULL = not there. */
    const float *part_weight[ASCC_PARTS];
    int32_t wall_key; /* of the output's walls; -1 = none */
    int32_t max_neighbors;
} ascc_network;

/* Copies the plan's weights once more, after they have changed. */
void ascc_network_arrange(ascc_network *network);

ascc_status ascc_network_create(ascc_network *network, const ascc_allocator *allocator,
                                const ascc_plan *plan, int32_t max_neighbors,
                                ascc_message *message);
void ascc_network_destroy(ascc_network *network);

int32_t ascc_network_set(const ascc_network *network, int32_t value);
int32_t ascc_network_channels(const ascc_network *network, int32_t value);

/* Channels as they are stored: a multiple of 8, the rest zeros. */
static inline size_t ascc_padded(int32_t channels)
{
    return ((size_t)channels + 7) / 8 * 8;
}

/* One value in one step; rows that nobody reads hold garbage. */
typedef struct ascc_value {
    uint8_t *active;  /* [rows] */
    float *raw;       /* [rows][padded channels], NULL if only the rectified are read */
    float *rectified; /* or NULL */
} ascc_value;

typedef struct ascc_network_run {
    ascc_network *network;
    ascc_hierarchy *hierarchy;
    const ascc_search_tools *tools;
    ascc_value *value;
    ascc_rows *rows; /* [key_count] */
    size_t neighbor_count;
    uint32_t longest;
} ascc_network_run;

/* Geometry of up to `room` pairs in scratch, for one filter: scaled to its radius, or to its cube. */
typedef struct ascc_geometry {
    ascc_pairs pairs;
    const float *window; /* NULL = 1 */
} ascc_geometry;

#define ASCC_GEOMETRY_ARRAYS 4 /* floats of scratch for each pair */
ascc_geometry ascc_network_geometry(const ascc_network_run *run, const ascc_rows *rows,
                                    const ascc_filter *filter, size_t query,
                                    const uint32_t *neighbor, size_t count, float *scratch,
                                    size_t room);

/* Weights of a part of an output with a basis [bump][inputs], NULL = not there, and its bumps. */
const float *ascc_output_part(const ascc_output *output, int part, size_t *bumps);
/* Numbers of a filter's kernel: cells of a grid, members of a basis. */
size_t ascc_cell_count(const ascc_filter *filter);
/* The row of `to` that is the same particle as this row of `from`; false if there is none. */
bool ascc_network_shared_row(const ascc_hierarchy *hierarchy, int32_t from, int32_t to, size_t row,
                             size_t *shared);
/* The value that a term reads, rectified if it wants that. */
const float *ascc_network_source(const ascc_network_run *run, const ascc_term *term);

/* What the terms of a layer need at most, in floats but for room. */
typedef struct ascc_column_sizes {
    size_t room;     /* pairs of the longest row */
    size_t column;   /* of one row */
    size_t members;  /* of a basis */
    size_t relative; /* inputs taken relative to the query's own */
    size_t scratch;  /* in all */
} ascc_column_sizes;

/* Scratch of one row: geometry, the members of a basis [member][room], relative features. */
typedef struct ascc_column_scratch {
    float *geometry, *factor, *relative;
    const uint32_t *sequence; /* 0, 1, 2, ... */
    size_t room;
} ascc_column_scratch;

ascc_column_sizes ascc_network_sizes(const ascc_network_run *run, const ascc_layer *layer);
ascc_column_scratch ascc_network_scratch(const ascc_column_sizes *sizes, float *memory,
                                         uint32_t *sequence);
/* What a term that searches reads around one row: column [cell][padded inputs]. */
void ascc_network_column(const ascc_network_run *run, const ascc_term *term, const ascc_rows *rows,
                         size_t row, const ascc_column_scratch *scratch, float *column);

/* Finds the rows every value needs and searches them. errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_network_demand(ascc_network_run *run, ascc_network *network,
                                ascc_hierarchy *hierarchy, const ascc_search_tools *tools);

/* Computes all values from the features, [host's rows][channels] of fluid and boundary.
 * errors: MEMORY. */
ascc_status ascc_network_forward(ascc_network_run *run, const float *fluid_features,
                                 const float *boundary_features);

#endif
