/* The corners of a level that a process reads or computes. SPDX-License-Identifier: MIT
 *
 * A corner belongs to the owner of the block that it lies in. Who finds it, since its fluid is around it, tells all
 * owners of blocks that it can be read from; so each has all corners within that reach of its blocks, in the one
 * order of a level: by z, y, x.
 */
#include <stdlib.h>
#include <string.h>

#include "set.h"

typedef struct corner {
    int64_t at[3]; /* units, in the axes of the step */
} corner;

/* The processes that read a corner; the first block's owner is its own. */
static int find_readers(ascc_mpi_particles *set, const corner *one, int level, double unit)
{
    double place[3];
    for (int c = 0; c < 3; c++)
        place[c] = (double)one->at[c] * unit;
    ascc_turn_reals(&set->step->turn, true, place, 1, set->curve.dimension);
    ascc_owners_find(&set->owners, &set->curve, place, set->reach[level]);
    return ascc_curve_owner_of(&set->curve, place);
}

static int by_place(const void *a, const void *b)
{
    const corner *x = a, *y = b;
    for (int c = 2; c >= 0; c--)
        if (x->at[c] != y->at[c])
            return x->at[c] < y->at[c] ? -1 : 1;
    return 0;
}

static bool add_pair(ascc_mpi_particles *set, size_t *count, int rank, size_t row)
{
    if (!ascc_mpi_room(set, &set->pairs, *count + 1, sizeof(ascc_mpi_pair)))
        return false;
    ((ascc_mpi_pair *)set->pairs.at)[(*count)++] = (ascc_mpi_pair){(uint32_t)rank, (uint32_t)row};
    return true;
}

static corner corner_of(const ascc_points *points, size_t i)
{
    return (corner){{points->position[0][i], points->position[1][i], points->position[2][i]}};
}

/* Packs what this process found for all who read it, itself included. */
static bool pack_found(ascc_mpi_particles *set, int level, double unit, const ascc_points *samples)
{
    ascc_mpi_lists *found = &set->ghosts[level].send;
    size_t count = 0;
    set->owners.known = false;
    for (size_t i = 0; i < samples->count; i++) {
        const corner one = corner_of(samples, i);
        (void)find_readers(set, &one, level, unit);
        for (int k = 0; k < set->owners.count; k++)
            if (!add_pair(set, &count, set->owners.rank[k], i))
                return false;
    }
    if (!ascc_mpi_sort_pairs(set, set->pairs.at, count, found) ||
        !ascc_mpi_room(set, &set->outgoing, count * sizeof(corner), 1))
        return false;
    for (size_t i = 0; i < count; i++)
        ((corner *)set->outgoing.at)[i] = corner_of(samples, ((uint32_t *)found->row.at)[i]);
    for (int r = 0; r < set->size; r++)
        set->counts[r] = found->start[r + 1] - found->start[r];
    return true;
}

/* What was found here and is read here: no message brings it. */
static void copy_own(ascc_mpi_particles *set)
{
    const size_t ranks = (size_t)set->size;
    size_t from = 0, to = 0;
    for (int r = 0; r < set->rank; r++) {
        from += set->counts[r];
        to += set->counts[ranks + (size_t)r];
    }
    if (set->counts[set->rank])
        memcpy((corner *)set->incoming.at + to, (corner *)set->outgoing.at + from,
               set->counts[set->rank] * sizeof(corner));
}

static size_t sort_corners(corner *all, size_t count)
{
    size_t kept = 0;
    if (count)
        qsort(all, count, sizeof *all, by_place);
    for (size_t i = 0; i < count; i++)
        if (kept == 0 || by_place(&all[i], &all[kept - 1]) != 0)
            all[kept++] = all[i];
    return kept;
}

/* Who refreshes which rows, both sides in the order of the level. */
static bool list_ghosts(ascc_mpi_particles *set, int level, double unit, const corner *all,
                        size_t count, uint8_t *own)
{
    ascc_mpi_ghosts *ghosts = &set->ghosts[level];
    size_t sent = 0, received = 0;
    for (size_t i = 0; i < count; i++) {
        const int owner = find_readers(set, &all[i], level, unit);
        own[i] = owner == set->rank;
        for (int k = 0; own[i] && k < set->owners.count; k++)
            if (set->owners.rank[k] != set->rank && !add_pair(set, &sent, set->owners.rank[k], i))
                return false;
    }
    if (!ascc_mpi_sort_pairs(set, set->pairs.at, sent, &ghosts->send))
        return false;
    for (size_t i = 0; i < count; i++)
        if (!own[i]) {
            const int owner = find_readers(set, &all[i], level, unit);
            if (!add_pair(set, &received, owner, i))
                return false;
        }
    return ascc_mpi_sort_pairs(set, set->pairs.at, received, &ghosts->receive);
}

ascc_status ascc_mpi_corners(ascc_halo *halo, int level, double unit,
                             const ascc_search_tools *tools, ascc_points *samples,
                             const uint8_t **own)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    const double host = unit / set->step->model_length;
    size_t count;
    bool room = pack_found(set, level, host, samples);
    ascc_status status = ASCC_OK;
    if (!room)
        status = ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for coarse points");
    status = ascc_mpi_agree(set, status);
    if (status == ASCC_OK)
        status = ascc_mpi_swap(set, sizeof(corner), &count);
    if (status != ASCC_OK)
        return status;
    copy_own(set);
    corner *all = set->incoming.at;
    count = sort_corners(all, count);
    uint8_t *flags = ascc_arena_take(tools->arena, count, 1);
    room = flags && ascc_points_take(samples, tools->arena, count) &&
           list_ghosts(set, level, host, all, count, flags);
    for (size_t i = 0; room && i < count; i++)
        ascc_points_set(samples, i, all[i].at);
    *own = flags;
    return room ? ASCC_OK
                : ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for coarse points");
}
