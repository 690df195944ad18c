/* Which fluid a step looks at, where the rest is as it was before (network/kept.h draws it).
 * SPDX-License-Identifier: MIT
 *
 * A row is as it was if its position, velocity and mass are, to the bit. Nothing else is trusted: not that it sleeps, nor
 * that it is the same particle.
 */
#include "present.h"

#include <string.h>

#include "stage.h"

/* One in so many rows must be idle for the last step to be remembered, and absent for the rest to be looked at alone. */
#define WORTH 8

bool ascc_memory_open(ascc_memory *memory, const ascc_network *network)
{
    memset(memory, 0, sizeof *memory);
    return ascc_kept_open(&memory->kept, network);
}

void ascc_memory_close(ascc_memory *memory)
{
    const ascc_allocator *a = memory->kept.allocator;
    ascc_past_sight *past = &memory->past;
    if (!a)
        return;
    ascc_release(a, past->position, past->position_capacity, sizeof(double));
    ascc_release(a, past->velocity, past->velocity_capacity, sizeof(double));
    ascc_release(a, past->mass, past->mass_capacity, sizeof(double));
    ascc_release(a, past->voxel, past->voxel_capacity, sizeof *past->voxel);
    ascc_release(a, past->wall_position, past->wall_capacity, sizeof(double));
    ascc_release(a, past->wall_normal, past->normal_capacity, sizeof(double));
    memset(past, 0, sizeof *past);
    ascc_kept_close(&memory->kept);
}

/* ---- What is as it was ---- */

typedef struct looking {
    ascc_step_state *state;
    ascc_memory *memory;
    ascc_scale scale;
    size_t rows, d;
    uint8_t *same;     /* [rows] */
    uint32_t *number;  /* [rows] of its voxel */
    ascc_blocks holds; /* voxels that hold fluid */
} looking;

static bool make_room(ascc_memory *m, size_t rows, size_t walls, size_t d)
{
    const ascc_allocator *a = m->kept.allocator;
    ascc_past_sight *p = &m->past;
    return ascc_grow(a, (void **)&p->position, &p->position_capacity, rows * d, sizeof(double)) &&
           ascc_grow(a, (void **)&p->velocity, &p->velocity_capacity, rows * d, sizeof(double)) &&
           ascc_grow(a, (void **)&p->mass, &p->mass_capacity, rows, sizeof(double)) &&
           ascc_grow(a, (void **)&p->voxel, &p->voxel_capacity, rows, sizeof *p->voxel) &&
           ascc_grow(a, (void **)&p->wall_position, &p->wall_capacity, walls * d, sizeof(double)) &&
           ascc_grow(a, (void **)&p->wall_normal, &p->normal_capacity, walls * d, sizeof(double));
}

/* Walls and all that is the same for all rows. Remembers them. */
static bool surroundings_are_known(const looking *l)
{
    const ascc_step_state *state = l->state;
    const ascc_particles *p = state->particles;
    ascc_past_sight *past = &l->memory->past;
    const size_t size = p->boundary_count * l->d * sizeof(double);
    const double constant[6] = {state->motion->gravity[0], state->motion->gravity[1],
                                state->motion->gravity[2], state->motion->time_step,
                                state->length_unit,        state->time_unit};
    const bool known = past->wall_count == p->boundary_count &&
                       memcmp(past->constant, constant, sizeof constant) == 0 &&
                       (!size || (memcmp(past->wall_position, p->wall_position, size) == 0 &&
                                  memcmp(past->wall_normal, p->wall_normal, size) == 0));
    if (known)
        return true;
    memcpy(past->constant, constant, sizeof constant);
    past->wall_count = p->boundary_count;
    if (size) {
        memcpy(past->wall_position, p->wall_position, size);
        memcpy(past->wall_normal, p->wall_normal, size);
    }
    return false;
}

/* Rows in [begin, end) that are as they were. */
static void compare_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const looking *l = data;
    const ascc_particles *p = l->state->particles;
    const ascc_past_sight *past = &l->memory->past;
    const size_t size = l->d * sizeof(double);
    for (size_t i = begin; i < end; i++)
        l->same[i] =
            i < past->count &&
            memcmp(past->position + i * l->d, p->position + i * l->d, size) == 0 &&
            memcmp(past->velocity + i * l->d, l->state->advance.velocity + i * l->d, size) == 0 &&
            memcmp(&past->mass[i], &p->mass[i], sizeof *p->mass) == 0;
}

/* Remembers a row that is not. False if it has no voxel: the step will say so. */
static bool note_row(const looking *l, size_t i)
{
    const ascc_step_state *state = l->state;
    const ascc_particles *p = state->particles;
    const ascc_memory *m = l->memory;
    const ascc_past_sight *past = &m->past;
    const size_t size = l->d * sizeof(double);
    double place[3] = {0.0, 0.0, 0.0};
    for (size_t c = 0; c < l->d; c++)
        place[c] = state->advance.seen[i * l->d + c] * state->length_unit;
    memcpy(past->position + i * l->d, p->position + i * l->d, size);
    memcpy(past->velocity + i * l->d, state->advance.velocity + i * l->d, size);
    past->mass[i] = p->mass[i];
    return ascc_kept_voxel(&m->kept, &l->scale, place, (int32_t)l->d, past->voxel[i]);
}

/* Voxels that rows have changed in, where they were and where they are, in blocks with room for all of them. False if
 * a row has none. */
static bool note_rows(looking *l, ascc_blocks *changed)
{
    ascc_past_sight *past = &l->memory->past;
    bool good = true;
    for (size_t i = 0; i < past->count; i++)
        if (i >= l->rows || !l->same[i])
            (void)ascc_blocks_add(changed, past->voxel[i]);
    for (size_t i = 0; i < l->rows; i++) {
        if (!l->same[i]) {
            good &= note_row(l, i);
            (void)ascc_blocks_add(changed, past->voxel[i]);
        }
        l->number[i] = ascc_blocks_add(&l->holds, past->voxel[i]);
    }
    past->count = l->rows;
    return good;
}

/* ---- What has to be looked at ---- */

/* Blocks and those within so many below and above them along each axis, one axis after another. */
static bool widen(ascc_blocks *to, const ascc_blocks *from, const looking *l, int64_t below,
                  int64_t above)
{
    ascc_blocks now = *from;
    for (size_t c = 0; c < l->d; c++) {
        ascc_blocks wide;
        if (!ascc_blocks_lend(&wide, l->state->tools.arena,
                              now.count * (size_t)(below + above + 1)))
            return false;
        for (size_t b = 0; b < now.count; b++)
            for (int64_t k = -below; k <= above; k++) {
                int64_t at[3] = {now.at[b][0], now.at[b][1], now.at[b][2]};
                at[c] += k;
                (void)ascc_blocks_add(&wide, at);
            }
        now = wide;
    }
    *to = now;
    return true;
}

/* Voxels of all that is computed in this step: values of corners that are dirty, and rows that are not idle. */
static bool find_computed(const looking *l, const ascc_blocks *dirty, ascc_blocks *computed)
{
    ascc_arena *arena = l->state->tools.arena;
    const ascc_kept *kept = &l->memory->kept;
    const uint8_t *idle = l->state->sleep.idle;
    const int64_t more = kept->around > kept->reach ? kept->around - kept->reach : 0;
    ascc_blocks rows, wide;
    if (!ascc_blocks_lend(&rows, arena, l->holds.count))
        return false;
    for (size_t i = 0; i < l->rows; i++)
        if (!idle[i])
            (void)ascc_blocks_add(&rows, l->holds.at[l->number[i]]);
    if (!widen(&wide, &rows, l, more, more) ||
        !ascc_blocks_lend(computed, arena, dirty->count + wide.count))
        return false;
    for (size_t b = 0; b < dirty->count; b++)
        (void)ascc_blocks_add(computed, dirty->at[b]);
    for (size_t b = 0; b < wide.count; b++)
        (void)ascc_blocks_add(computed, wide.at[b]);
    return true;
}

/* Middles of the voxels that are not among these. */
static bool place_far(const looking *l, const uint8_t *present, ascc_points *far)
{
    size_t n = 0;
    *far = (ascc_points){.count = l->holds.count};
    for (int c = 0; c < 3; c++) {
        far->position[c] = ascc_arena_take(l->state->tools.arena, far->count, sizeof(int64_t));
        if (!far->position[c])
            return false;
    }
    for (size_t b = 0; b < l->holds.count; b++) {
        int64_t middle[3];
        if (present[b])
            continue;
        ascc_kept_middle(&l->memory->kept, &l->scale, l->holds.at[b], (int32_t)l->d, middle);
        for (int c = 0; c < 3; c++)
            far->position[c][n] = middle[c];
        n++;
    }
    far->count = n;
    return true;
}

/* Rows in those voxels; the rest is far, if it is worth it. */
static bool choose_rows(const looking *l, const ascc_blocks *looked_at)
{
    ascc_sight *sight = &l->state->sight;
    ascc_arena *arena = l->state->tools.arena;
    uint8_t *present = ascc_arena_lend(arena, l->holds.count, 1);
    uint32_t *row = ascc_arena_take(arena, l->rows, sizeof *row);
    ascc_points *far = ascc_arena_take(arena, 1, sizeof *far);
    size_t count = 0;
    if (!present || !row || !far)
        return false;
    for (size_t b = 0; b < l->holds.count; b++)
        present[b] = ascc_blocks_find(looked_at, l->holds.at[b]) != ASCC_NO_BLOCK;
    for (size_t i = 0; i < l->rows; i++)
        if (present[l->number[i]])
            row[count++] = (uint32_t)i;
    if ((l->rows - count) * WORTH < l->rows)
        return true;
    sight->row = row;
    sight->row_count = count;
    sight->far = far;
    return place_far(l, present, far);
}

/* Dirty voxels outlive the sight: what they are found with is taken, not lent. */
static bool keep_dirty(ascc_kept *kept, const ascc_blocks *dirty, ascc_arena *arena)
{
    ascc_blocks *copy = ascc_arena_take(arena, 1, sizeof *copy);
    int64_t(*at)[3] = ascc_arena_take(arena, dirty->count, sizeof *at);
    uint32_t *slot = ascc_arena_take(arena, dirty->slots, sizeof *slot);
    if (!copy || !at || !slot)
        return false;
    memcpy(at, dirty->at, dirty->count * sizeof *at);
    memcpy(slot, dirty->slot, dirty->slots * sizeof *slot);
    *copy = (ascc_blocks){.count = dirty->count, .slots = dirty->slots, .at = at, .slot = slot};
    kept->dirty = copy;
    return true;
}

static bool find_present(looking *l, bool known)
{
    ascc_memory *m = l->memory;
    ascc_arena *arena = l->state->tools.arena;
    ascc_blocks changed, dirty, computed, looked_at;
    size_t others = 0;
    if (!known)
        m->past.count = 0;
    ascc_workers_run(l->state->tools.workers, l->rows, 4096, compare_rows, l);
    for (size_t i = 0; i < l->rows; i++)
        others += !l->same[i];
    const size_t gone = m->past.count > l->rows ? m->past.count - l->rows : 0;
    if (!ascc_blocks_lend(&l->holds, arena, l->rows) ||
        !ascc_blocks_lend(&changed, arena, 2 * others + gone))
        return false;
    if (!note_rows(l, &changed) || !known)
        return true;
    const int64_t reach = m->kept.reach;
    return widen(&dirty, &changed, l, reach, reach + 1) && keep_dirty(&m->kept, &dirty, arena) &&
           find_computed(l, &dirty, &computed) &&
           widen(&looked_at, &computed, l, reach + 1, reach) && choose_rows(l, &looked_at);
}

/* Whether anything may be kept of this step. */
static bool may_keep(const ascc_step_state *state)
{
    return state->memory && state->memory->kept.serves && state->sleep.idle && !state->halo &&
           state->sleep.idle_count >= state->particles->fluid_count / WORTH && !state->looks &&
           !state->trust && !state->detail && !state->share && !state->network->keeps_values &&
           !state->advance.walls_move;
}

ascc_status ascc_find_present(ascc_step_state *state)
{
    const ascc_particles *p = state->particles;
    ascc_arena *arena = state->tools.arena;
    ascc_memory *m = state->memory;
    if (!may_keep(state)) {
        if (m)
            m->kept.valid = false;
        return ASCC_OK;
    }
    looking l = {.state = state,
                 .memory = m,
                 .scale = ascc_hierarchy_scale(state->network->plan),
                 .rows = p->fluid_count,
                 .d = (size_t)p->dimension};
    const ascc_arena_mark mark = ascc_arena_mark_of(arena);
    bool known = m->kept.valid;
    m->kept.valid = false; /* until all is well */
    m->kept.dirty = NULL;
    l.same = ascc_arena_lend(arena, l.rows, 1);
    l.number = ascc_arena_lend(arena, l.rows, sizeof *l.number);
    bool room = l.same && l.number && make_room(m, l.rows, p->boundary_count, l.d);
    if (room) {
        known &= surroundings_are_known(&l);
        room = find_present(&l, known);
    }
    ascc_arena_return(arena, mark);
    if (!room)
        return ascc_fail(state->tools.message, ASCC_ERROR_MEMORY, "no memory to see %zu particles",
                         l.rows);
    state->sight.kept = &m->kept;
    return ASCC_OK;
}
