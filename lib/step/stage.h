/* A step as a list of stages over one state, and what they hand on.
 * SPDX-License-Identifier: MIT
 *
 * Each stage is a file that exports one function; step.c lists them. Until the last one, commit, nothing
 * has touched the particles, so a stage that fails leaves them as they were.
 */
#ifndef ASCC_STAGE_H
#define ASCC_STAGE_H

#include <math.h>

#include "network/pair_sum.h"
#include "points/particles.h"
#include "present.h"
#include "turn.h"
#include "wall_volumes.h"

/* What one step does from outside, in the host's units. */
typedef struct ascc_motion {
    double time_step;
    double gravity[3];
    const double *acceleration; /* [fluid][dimension] or NULL */
    ascc_advection advection;
    double max_displacement; /* 0 = none */
    double sleep_speed;      /* in what gravity gives in a step; 0 = nothing sleeps */
} ascc_motion;

static inline double ascc_vector_length(const double v[3])
{
    return sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2]);
}

/* One step's state while it is not yet the particles' own. All [fluid count][dimension]. */
typedef struct ascc_advance {
    double *seen;     /* where the network sees the fluid; its memory becomes position's */
    double *position; /* where it ends */
    double *velocity; /* after external forces: what the network sees; a relaxation overwrites it */
    int64_t *momentum; /* at the end */
    int64_t *external; /* impulse of gravity and acceleration, quanta */
    /* Where walls end, [boundary count][dimension]: the particles' own array while none moves. */
    double *wall;
    const double *wall_velocity; /* as it was when the step began; NULL: all rest */
    double wall_way;             /* the farthest that one goes */
    bool walls_move;
} ascc_advance;

/* What a step looks at. */
typedef struct ascc_sight {
    const uint32_t *row; /* [row_count] the host's rows of fluid, ascending; NULL = all */
    size_t row_count;
    const ascc_points *far; /* what the rest of the fluid is to coarser levels */
    ascc_kept *kept;        /* values of an earlier step; NULL = none are kept */
} ascc_sight;

/* Fluid that sleeps, all in the host's order. */
typedef struct ascc_sleep {
    size_t count; /* rows */
    size_t idle_count;
    const uint8_t *still; /* 1 = sleeps: stays where it is; NULL = none */
    const uint8_t *idle;  /* 1 = and so do all that could push it: nothing is computed for it */
    int32_t *rest;        /* what the particles' own become; NULL = they stay as they are */
    struct ascc_sleep_blocks *blocks; /* sleep.c's own */
    int64_t support[3];               /* what sleeping rows had and received, quanta */
} ascc_sleep;

/* At a free surface, where density lacks more than this, a divergence means nothing. */
#define ASCC_SURFACE 0.35f

/* What the sweeps of a relaxation leave for a way back, of rows of ASCC_SET_FLUID; lengths in supports. */
typedef struct ascc_relaxation_trace {
    const int32_t *low; /* [row][4] places as the hierarchy has them; NULL: nothing was kept */
    const int32_t *wall_low[3];              /* of walls */
    const float *wall_volume, *wall_move[3]; /* wall_move: NULL = none is on velocities */
    ascc_gradients pairs;
    float *own[3]; /* sums of gradients, walls included */
    const float *excess, *response;
    const uint8_t *near; /* rows with neighbours within the repulsion */
    const float *move;   /* [row][4] of velocities, before their divergence was taken from them */
    float *pressure;     /* [sweep + 1][row] */
    float *change;       /* [sweep][row] */
    float *push;         /* [sweep][row][4] by the pressures before it */
    bool guessed;        /* else the first sweep begins with 0 and changes nothing */
    /* Of a hyperviscosity: */
    const float *coefficient; /* [row] NULL = there is none */
    const float *weight;      /* of pairs */
    float *smoothed,
        *rough; /* [sweep][row][4] velocities that it began with; how rough they were */
} ascc_relaxation_trace;

/* What a round of the relaxation began with. */
typedef struct ascc_relaxation_round {
    const ascc_rows *rows[2]; /* neighbours among fluid and walls */
    ascc_relaxation_trace trace;
} ascc_relaxation_round;

/* What the relaxation did; the divergence has the neighbours of its last round. */
typedef struct ascc_relaxed {
    int32_t rounds;
    ascc_relaxation_round round[ASCC_MAX_ROUNDS];
    ascc_relaxation_trace divergence;
} ascc_relaxed;

/* All intermediate results of one step, in its arena: valid until that is reset. */
typedef struct ascc_step_state {
    /* What a step begins with: */
    const ascc_network *network;
    const ascc_particles *particles;
    const ascc_motion *motion;
    ascc_halo *halo;               /* fluid of other processes; NULL = there is none */
    ascc_turn turn;                /* of all that stages see, from the host's axes */
    double length_unit, time_unit; /* m and s of the model in the host's unit and second */
    size_t *expected;              /* of the network's neighbour lists */
    size_t *expected_pairs;        /* that the last relaxation kept */
    ascc_status (*engine)(struct ascc_step_state *state); /* engine.h */
    const struct ascc_trust *trust; /* what the step's input is measured by; NULL = it is not */
    ascc_wall_volumes *walls;       /* kept while they rest */
    ascc_memory *memory;            /* kept while fluid rests; NULL = nothing is */
    ascc_search_tools tools;
    ascc_step_statistics *statistics; /* also the times of stages */
    double since;                     /* when the stage under way began, s */
    bool looks;                       /* only: the step ends with what the network sees */
    const ascc_relaxation
        *relaxation; /* the model's; of two models (detail.h) what both ask for together, */
    const ascc_relaxation
        *part[2];             /* and each one's, of rows by `shares` and the rest; NULL = of one */
    struct ascc_step *detail; /* whose network has a share of the fluid (detail.h); NULL = none */
    const float *share;       /* [host's fluid rows] of what this network gives; NULL = all of it */
    const uint8_t
        *walls_seen; /* [host's boundary rows] 1 = by this network; NULL = all that are near */
    bool joins;      /* what it gives is added to another's step, which has the relaxation */
    /* What stages make: */
    ascc_sleep sleep;
    ascc_advance advance;
    ascc_sight sight;
    ascc_impulses impulses;
    float *fluid_features, *boundary_features; /* lent until the network has run */
    ascc_arena_mark before_features;
    ascc_hierarchy hierarchy;
    const float *shares; /* [rows of fluid] `share` in the order of the set */
    ascc_network_run run;
    ascc_relaxed relaxed;
    const float *wall_volume; /* of the host's boundary rows, where they end */
} ascc_step_state;

/* What a step of this length does of a displacement that the network gives for the model's: as much as an
 * acceleration would. */
static inline double ascc_step_share(const ascc_step_state *state)
{
    const double steps =
        state->motion->time_step * state->time_unit / state->network->plan->time_step;
    return steps * steps;
}

/* Where the network sees walls, [boundary count][dimension]: moved on if the fluid is. */
static inline const double *ascc_walls_seen(const ascc_step_state *state)
{
    return state->motion->advection == ASCC_ADVECT_NONE ? state->particles->wall_position
                                                        : state->advance.wall;
}

/* What walls stand for where they end: state->wall_volume. errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_find_wall_volumes(ascc_step_state *state, double support);

/* Is there no fluid, here or anywhere else? */
static inline bool ascc_step_is_empty(const ascc_step_state *state)
{
    return (state->halo ? state->halo->total : state->particles->fluid_count) == 0;
}

/* Positions and momenta of ghosts, as their owners have them now. errors: those of any process. */
ascc_status ascc_advance_refresh(ascc_step_state *state);

typedef ascc_status (*ascc_stage)(ascc_step_state *state);

/* v* = v + dt g, and where the network sees the particles. errors: MEMORY, RANGE. */
ascc_status ascc_stage_forces(ascc_step_state *state);
/* Where walls end, if any moves. errors: MEMORY, RANGE; the message names the row. */
ascc_status ascc_stage_wall_motion(ascc_step_state *state);
/* Which fluid sleeps (docs/sleeping.md); no time of its own where none may. errors: MEMORY. */
ascc_status ascc_stage_sleep(ascc_step_state *state);
/* Takes what sleeping rows have received. */
ascc_status ascc_stage_support(ascc_step_state *state);
/* Marks the walls that fluid may see, in memory that the arena lends: *near stays NULL where it may see all, or where
 * finding out would not pay. False without memory. */
bool ascc_near_walls(ascc_step_state *state, uint8_t **near);
/* Which fluid has to be looked at: state->sight. errors: MEMORY. */
ascc_status ascc_find_present(ascc_step_state *state);
/* Row n of those that are looked at, of so many. */
static inline size_t ascc_sight_count(const ascc_step_state *state)
{
    return state->sight.row ? state->sight.row_count : state->particles->fluid_count;
}
static inline size_t ascc_sight_row(const ascc_step_state *state, size_t n)
{
    return state->sight.row ? state->sight.row[n] : n;
}
/* Features, and the point sets of the scene (paper sections 3.3, 3.4). errors: MEMORY, RANGE. */
ascc_status ascc_stage_sight(ascc_step_state *state);
/* New momenta and positions. errors: RANGE, NOT_FINITE; the message names the particle. */
ascc_status ascc_stage_advance(ascc_step_state *state);
/* The same by more impulses, [fluid count][dimension], from what the step has reached. errors: RANGE. */
ascc_status ascc_advance_further(ascc_step_state *state, const int64_t *impulse);
/* Pressure from densities, and what it moves (docs/method.md); nothing, and no time of its own, without a
 * relaxation in the model. errors: MEMORY, RANGE, LIMIT. */
ascc_status ascc_stage_relaxation(ascc_step_state *state);
/* The same for the velocities at the new positions, which stay. errors: MEMORY, RANGE. */
ascc_status ascc_stage_divergence(ascc_step_state *state);
/* Walls that nothing passes. errors: RANGE. */
ascc_status ascc_stage_contact(ascc_step_state *state);

/* After the network: how far its input is from training's, into the statistics. */
void ascc_measure_trust(ascc_step_state *state);

/* Monotonic seconds. */
double ascc_clock(void);
/* Adds the time since the last call to the stage of this name. */
void ascc_stage_lap(ascc_step_state *state, const char *name);

#endif
