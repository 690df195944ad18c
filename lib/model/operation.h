/* What an operation is: everything that the rest of the library asks of a kind of term.
 * SPDX-License-Identifier: MIT
 *
 * An operation is one file in network/ and one line in network/operations.list. A term, or the output,
 * points to its operation; nothing asks which one it is. An output has `impulses` and `backward_output`
 * in place of `forward` and `backward`. docs/contributing.md adds one step by step.
 */
#ifndef ASCC_OPERATION_H
#define ASCC_OPERATION_H

#include "file/json_reader.h"
#include "plan_builder.h"

/* Which neighbour list a term reads; terms that look alike share one. Geometry is not kept: computing it
 * where it is used costs less than its memory. */
typedef struct ascc_list_key {
    int32_t query, source; /* sets */
    int32_t skip_self, limit;
    double radius; /* m */
    double
        cube; /* m: half the edge of a cube that is searched in place of the ball; 0 = the ball */
} ascc_list_key;
#define ASCC_MAX_LISTS 2 /* of one term */

/* Points of an edge: the neighbour, and the one whose neighbour that is. */
#define ASCC_END_SENDER 1
#define ASCC_END_RECEIVER 2

/* Counted in multiply-adds by `cost`: points around a particle (model/cost.h). */
typedef struct ascc_cost_counts ascc_cost_counts;

/* Floats that the terms of a layer need at most. */
typedef struct ascc_scratch_sizes {
    size_t room;    /* pairs of the longest neighbour list, a multiple of 8 */
    size_t column;  /* of one row */
    size_t scratch; /* of one worker */
    size_t reverse; /* of the way back, besides */
} ascc_scratch_sizes;

struct ascc_initial;
struct ascc_network_run;
struct ascc_tile;
struct ascc_column_functions;
struct ascc_reverse;
struct ascc_impulse_scale;
struct ascc_impulses;

typedef struct ascc_operation {
    const char *name;
    /* In a description: `type`, of a term or output that has the member `with` (NULL = of any). */
    const char *type, *with;
    uint32_t not_negative; /* bit i: tensor i may hold no negative numbers */

    /* ---- From a file ---- */

    /* Takes its own members out of the description, and the names of its tensors. NULL = it has none. */
    void (*read)(ascc_reader *reader, uint32_t object, const ascc_plan *plan, ascc_term *term,
                 const char *name[ASCC_MAX_TENSORS]);
    /* Says what its tensors must be. `outputs` and cells that are 0 come from `stored`, the shape of its
     * first tensor, zeros without a file. NULL, or no first tensor: `outputs` are the inputs, or check's. */
    void (*tensors)(const ascc_plan *plan, ascc_term *term, const size_t *stored,
                    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS]);
    /* Finds the filter and refuses what does not fit. layer: NULL of an output. */
    ascc_status (*check)(ascc_plan_builder *builder, const ascc_layer *layer,
                         ascc_term_entry *entry, const char *const name[ASCC_MAX_TENSORS]);
    /* Refuses numbers of the tensors that cannot be; NULL = any can. */
    const char *(*check_numbers)(const ascc_plan *plan, const ascc_term *term);

    /* Values of a tensor to begin training with (model/initial.h); NULL: ascc_initial_default. */
    void (*initial)(struct ascc_initial *initial);

    /* ---- Lengths, sizes, cost ---- */

    /* Neighbour lists for rows of `set`; returns how many. The first leads to rows of its source, a second
     * to walls and their features. NULL: it reads rows that its source's set shares with its own. */
    int (*lists)(const ascc_plan *plan, const ascc_term *term, int32_t set,
                 ascc_list_key key[ASCC_MAX_LISTS]);
    /* Floats of all tensors as kernels read them: channels filled up to multiples of 8 with zeros. */
    size_t (*packed_size)(const ascc_plan *plan, const ascc_term *term);
    /* Of packed[], all zeros; and back: gradient[i], laid out as tensor i, += that of packed. */
    void (*pack)(const ascc_plan *plan, const ascc_term *term, float *packed);
    void (*unpack)(const ascc_plan *plan, const ascc_term *term, const float *packed,
                   float *const gradient[ASCC_MAX_TENSORS]);
    /* Of packed[] what the way back multiplies with, in as much room; NULL = nothing. */
    void (*transpose)(const ascc_plan *plan, const ascc_term *term, const float *packed, float *to);
    /* Multiply-adds of a fluid particle and step; NULL = none. */
    double (*cost)(const ascc_plan *plan, const ascc_cost_counts *counts, int32_t set,
                   const ascc_term *term);
    /* Raises what it needs; of an output: `column` is bytes of each row of its set. NULL = nothing. */
    void (*scratch)(const ascc_plan *plan, const ascc_term *term, ascc_scratch_sizes *sizes);
    /* Of a term that lies on edges or reads them from points: whose values it reads of an edge's two
     * (ASCC_END_*). NULL = it does not go from points to edges or back. */
    int (*ends)(const ascc_term *term);
    /* It reads the fluid's features besides its source. NULL = never. */
    bool (*reads_features)(const ascc_term *term);
    /* It reads `drift` of its source, too. NULL = never. */
    bool (*reads_drift)(const ascc_term *term);
    /* It can read its rows from a tile, ascc_tile.given, before their value is stored. */
    bool reads_tiles;

    /* ---- Running ---- */

    /* Makes what its forward and backward read besides, once a step; what terms share by their first list goes to
     * run->table. errors: MEMORY. NULL = nothing. */
    ascc_status (*prepare)(const struct ascc_network_run *run, const ascc_term *term);
    /* Adds to the tile's rows. */
    void (*forward)(const struct ascc_tile *tile, const ascc_term *term);
    /* The columns of the tile's rows that its matrix multiplies, one after another in tile->column; returns how
     * many: rows that have no such term have none. NULL = it never has a matrix. */
    size_t (*columns)(const struct ascc_tile *tile, const ascc_term *term);
    /* Of one whose columns are gathered from neighbours (network/column.h), else NULL. */
    const struct ascc_column_functions *around;
    /* Its way back leads to places alone, nowhere where these are constants. */
    bool leads_to_places;
    /* From the gradient of a tile to those of tensors, source and places. */
    void (*backward)(const struct ascc_reverse *pass, const ascc_layer *layer,
                     const ascc_term *term, const uint32_t *list, size_t n);
    /* Of an output: fills impulses, cleared by the caller. errors: MEMORY, NOT_FINITE, RANGE. */
    ascc_status (*impulses)(const struct ascc_network_run *run,
                            const struct ascc_impulse_scale *scale,
                            const struct ascc_impulses *impulses, uint64_t *pair_count);
    ascc_status (*backward_output)(struct ascc_reverse *pass);
} ascc_operation;

/* All of them, from network/operations.list; the last is NULL. */
extern const ascc_operation *const ascc_operations[];

#endif
