/* The point sets a network runs on: fluid, boundary, both, and the coarser levels (paper section 3.3).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_HIERARCHY_H
#define ASCC_HIERARCHY_H

#include "model/plan.h"
#include "points/halo.h"
#include "points/neighbors.h"

#define ASCC_MAX_GRIDS 64

/* With a halo: the rows of a set in the order in which they are computed (early_rows.h). */
typedef struct ascc_row_range {
    uint32_t begin, end;
} ascc_row_range;

typedef struct ascc_row_order {
    ascc_row_range *range; /* [count] the first `early` hold all that is sent */
    size_t early, count;
} ascc_row_order;

typedef struct ascc_hierarchy {
    ascc_scale scale;
    ascc_points
        set[ASCC_MAX_SETS]; /* ASCC_SET_ALL has but a count where no layer or level reads it */
    size_t fluid_count;     /* rows of the host's fluid, of which the set may have a part */
    /* Rows of ASCC_SET_ALL, fluid and boundary in one order: */
    uint32_t *origin;    /* the host's row: fluid row, or fluid_count + boundary row */
    uint32_t *part;      /* the row in ASCC_SET_FLUID or ASCC_SET_BOUNDARY */
    uint32_t *whole[2];  /* and back: [set row] of fluid, boundary */
    int32_t *place[2];   /* low words of fluid, boundary once more: [set row][4], the last 0 */
    const uint8_t *idle; /* rows of fluid whose impulses nobody wants; NULL = none */
    /* [rows of fluid] what of them the output takes, and what is 0 is not wanted; NULL = all of all */
    const float *share;
    bool joins;         /* only the output's impulses are wanted: no relaxation follows */
    ascc_halo *halo;    /* of fluid that other processes have, idle here; NULL = they have none */
    uint32_t *halo_row; /* with a halo: [host's fluid row] its row of the fluid */
    const uint8_t *own[ASCC_MAX_LEVELS];   /* with a halo: [rows of level] 1 = computed here */
    ascc_row_order order[ASCC_MAX_LEVELS]; /* with a halo: of fluid, then of levels */
    float *
        drift; /* motions of walls in spacings a time step, [boundary set row][4]; NULL: all rest */
    struct ascc_kept *kept; /* values of an earlier step that still hold (kept.h); NULL = none */
    struct ascc_sheets
        *sheets;        /* thin walls that hide what lies beyond (sheets.h); NULL: there is none */
    ascc_extent extent; /* of all sets */
    double base_radius; /* units: level 0 is in the order of cells for it */
    int grid_count;
    struct {
        int set;
        double radius;
        ascc_grid grid;
    } grid[ASCC_MAX_GRIDS];
} ascc_hierarchy;

/* Where the network sees the particles, metres. */
typedef struct ascc_scene {
    size_t fluid_count, boundary_count;
    const double *fluid, *boundary; /* [count][dimension] */
    const uint8_t *near;            /* [boundary count] 1 = fluid may see it; NULL = all */
    const uint32_t *row;            /* [row_count] fluid that is looked at, ascending; NULL = all */
    size_t row_count;
    const ascc_points
        *far; /* units: what else holds fluid as coarser levels see it; NULL = nothing */
    /* What tells particles at one place apart, so that the host's order does not; NULL = nothing: */
    const double *velocity, *mass, *normal; /* [fluid][dimension], [fluid], [boundary][dimension] */
    const double *wall_velocity;            /* [boundary][dimension]; NULL = all rest */
    double motion;                          /* what makes spacings a time step of it */
    /* Where they are when the step begins, in units of so many metres; NULL: thin walls hide nothing. */
    const double *fluid_before, *boundary_before;
    double unit;
    ascc_halo *halo;    /* NULL = all fluid is here */
    const uint64_t *id; /* of fluid, if some of it is not */
} ascc_scene;

/* Builds all sets the plan uses in the arena. errors: MEMORY, RANGE. */
ascc_status ascc_hierarchy_build(ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                 const ascc_plan *plan, const ascc_scene *scene);

/* The scale that the sets of a plan's hierarchies have. */
ascc_scale ascc_hierarchy_scale(const ascc_plan *plan);

/* Does anything look at places of fluid and walls as one set? */
bool ascc_hierarchy_reads_whole(const ascc_plan *plan);

/* The grid of a set for a search radius in units, made when first asked for. errors: MEMORY, RANGE. */
ascc_status ascc_hierarchy_grid(ascc_hierarchy *hierarchy, const ascc_search_tools *tools, int set,
                                double radius, const ascc_grid **grid);

/* Host's fluid row of a row of fluid, boundary or all, or fluid_count + boundary row. */
static inline size_t ascc_hierarchy_host_row(const ascc_hierarchy *hierarchy, int32_t set,
                                             size_t row)
{
    return hierarchy->origin[set == ASCC_SET_ALL ? row : hierarchy->whole[set][row]];
}

static inline bool ascc_hierarchy_is_idle(const ascc_hierarchy *hierarchy, size_t fluid_row)
{
    return hierarchy->idle && hierarchy->idle[fluid_row];
}

/* Is nothing wanted of a row's pairs? */
static inline bool ascc_hierarchy_is_quiet(const ascc_hierarchy *hierarchy, size_t fluid_row)
{
    return ascc_hierarchy_is_idle(hierarchy, fluid_row) ||
           (hierarchy->share && hierarchy->share[fluid_row] == 0.0f);
}

/* Host's boundary row of a row of the boundary. */
static inline size_t ascc_hierarchy_wall_row(const ascc_hierarchy *hierarchy, size_t row)
{
    return ascc_hierarchy_host_row(hierarchy, ASCC_SET_BOUNDARY, row) - hierarchy->fluid_count;
}

/* Which rows of the arrays of a refresh the host's rows of its set are. */
static inline const uint32_t *ascc_hierarchy_halo_rows(const ascc_hierarchy *hierarchy,
                                                       const ascc_halo_refresh *refresh)
{
    return refresh->set == ASCC_SET_FLUID ? hierarchy->halo_row : NULL;
}

/* Ghosts of a set become what their owners have, in arrays of its rows; nothing without a halo. */
static inline ascc_status ascc_hierarchy_refresh(const ascc_hierarchy *hierarchy,
                                                 const ascc_halo_refresh *refresh)
{
    return ascc_halo_exchange(hierarchy->halo, refresh,
                              ascc_hierarchy_halo_rows(hierarchy, refresh));
}

#endif
