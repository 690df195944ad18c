/* Walls that fluid may see: all others cost next to nothing. SPDX-License-Identifier: MIT
 *
 * Fluid and walls fall into blocks as wide as walls can be seen from, and somewhat wider; a wall is near if there is fluid in its
 * block or in one beside it.
 */
#include <math.h>
#include <string.h>

#include "points/blocks.h"
#include "stage.h"

/* Fewer walls than a share of the fluid are not worth the look at it. */
#define WORTH 8
/* Spacings beyond the reach: contact follows a particle's whole way. Where one goes farther even without what the
 * network gives, all walls are near. */
#define MARGIN 4.0

/* The blocks of fluid that is looked at; rows that follow one another are mostly in one block. */
static void add_places(ascc_blocks *blocks, const ascc_step_state *state, double edge)
{
    const int32_t dimension = state->particles->dimension;
    int64_t at[3], last[3] = {INT64_MAX, 0, 0};
    for (size_t n = 0; n < ascc_sight_count(state); n++) {
        const size_t i = ascc_sight_row(state, n);
        ascc_block_of(state->advance.seen + i * (size_t)dimension, dimension, edge, at);
        if (memcmp(at, last, sizeof at) != 0)
            (void)ascc_blocks_add(blocks, at);
        memcpy(last, at, sizeof last);
    }
}

/* And those beside them. */
static void widen(ascc_blocks *wide, const ascc_blocks *blocks, int32_t dimension)
{
    const int64_t deep = dimension == 3;
    for (size_t b = 0; b < blocks->count; b++)
        for (int64_t z = -deep; z <= deep; z++)
            for (int64_t y = -1; y <= 1; y++)
                for (int64_t x = -1; x <= 1; x++)
                    (void)ascc_blocks_add(wide, (const int64_t[]){blocks->at[b][0] + x,
                                                                  blocks->at[b][1] + y,
                                                                  blocks->at[b][2] + z});
}

/* Which walls are near. */
static void mark(uint8_t *near, const ascc_blocks *wide, const ascc_particles *p, double edge)
{
    int64_t at[3], last[3] = {INT64_MAX, 0, 0};
    uint8_t found = 0;
    for (size_t i = 0; i < p->boundary_count; i++) {
        ascc_block_of(p->wall_position + i * (size_t)p->dimension, p->dimension, edge, at);
        if (memcmp(at, last, sizeof at) != 0)
            found = ascc_blocks_find(wide, at) != ASCC_NO_BLOCK;
        memcpy(last, at, sizeof last);
        near[i] = found;
    }
}

/* Whether a particle goes so far. However walls bend a way, it stays within its length of the end that is seen. */
static bool goes_far(const ascc_step_state *state, double far)
{
    const size_t d = (size_t)state->particles->dimension;
    const double dt = state->motion->time_step;
    bool goes = false;
    for (size_t n = 0; n < ascc_sight_count(state); n++) {
        const double *const v = state->advance.velocity + ascc_sight_row(state, n) * d;
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += v[c] * v[c];
        goes |= !(dt * dt * square <= far * far);
    }
    return goes;
}

bool ascc_near_walls(ascc_step_state *state, uint8_t **near)
{
    const ascc_particles *p = state->particles;
    ascc_arena *arena = state->tools.arena;
    if (state->walls_seen) {
        *near = ascc_arena_lend(arena, p->boundary_count, 1);
        if (*near)
            memcpy(*near, state->walls_seen, p->boundary_count);
        return *near != NULL;
    }
    const double margin = MARGIN * state->network->plan->spacing / state->length_unit;
    const double edge = margin + state->network->wall_reach / state->length_unit;
    if (!(state->network->wall_reach > 0.0) || isinf(edge) || state->advance.walls_move ||
        p->boundary_count < ascc_sight_count(state) / WORTH || goes_far(state, margin))
        return true;
    *near = ascc_arena_lend(arena, p->boundary_count, 1);
    const ascc_arena_mark mark_of = ascc_arena_mark_of(arena);
    ascc_blocks blocks, wide;
    bool room = *near && ascc_blocks_lend(&blocks, arena, ascc_sight_count(state));
    if (room) {
        add_places(&blocks, state, edge);
        room = ascc_blocks_lend(&wide, arena, blocks.count * (p->dimension == 3 ? 27 : 9));
    }
    if (room) {
        widen(&wide, &blocks, p->dimension);
        mark(*near, &wide, p, edge);
    }
    ascc_arena_return(arena, mark_of);
    return room;
}
