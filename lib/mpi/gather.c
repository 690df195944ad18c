/* A whole set on one process, and back: what snapshots and sequences are made from. SPDX-License-Identifier: MIT */
#include <string.h>

#include "base/float_env.h"
#include "set.h"

/* Bytes of one broadcast at most: MPI counts with int. */
#define PART ((size_t)1 << 30)

/* `whole` must be a set on root, and root the same on all. */
static ascc_status begin(ascc_mpi_particles *set, const ascc_particles *whole, int root)
{
    const uint64_t word = (uint64_t)(int64_t)root;
    const int dimension = set->local->dimension;
    ascc_mpi_open(set);
    if (!ascc_mpi_alike(set->comm, &word, 1) || root < 0 || root >= set->size)
        return ascc_fail(&set->message, ASCC_ERROR_ARGUMENT,
                         "root: not the same on all processes, or none of them");
    const bool good =
        set->rank != root || (ascc_particles_is_set(whole) && whole->dimension == dimension);
    return ascc_mpi_conclude(set, good ? ASCC_OK : ASCC_ERROR_MISMATCH,
                             "whole: not a set of this dimension");
}

/* A set but for its fluid, as bytes in set->kept; 0 without memory. */
static size_t keep_walls(ascc_mpi_particles *set, const ascc_particles *whole)
{
    ascc_particles walls = *whole;
    walls.fluid_count = 0;
    const size_t size = ascc_particles_snapshot_size(&walls);
    return ascc_mpi_room(set, &set->kept, size, 1) &&
                   ascc_particles_snapshot(&walls, set->kept.at, size) == ASCC_OK
               ? size
               : 0;
}

/* ---- Rows ---- */

/* Rows of `from`, of which counts[rank] are for each process, one after another, reach set->incoming; those for this
 * process, too. */
static ascc_status deal(ascc_mpi_particles *set, const ascc_particles *from, size_t *received)
{
    const size_t ranks = (size_t)set->size;
    ascc_particles view = *from, *local = set->local;
    size_t sent = 0, own = 0, to = 0;
    set->local = &view;
    const size_t size = ascc_mpi_row_size(set);
    for (size_t r = 0; r < ranks; sent += set->counts[r++])
        own = r == (size_t)set->rank ? sent : own;
    const bool room = ascc_mpi_room(set, &set->outgoing, sent * size, 1);
    for (size_t i = 0; room && i < sent; i++)
        ascc_mpi_pack_row(set, i, (unsigned char *)set->outgoing.at + i * size);
    set->local = local;
    ascc_status status = ascc_mpi_agree(set, room ? ASCC_OK : ASCC_ERROR_MEMORY);
    if (status == ASCC_OK)
        status = ascc_mpi_swap(set, size, received);
    for (size_t r = 0; r < (size_t)set->rank; r++)
        to += set->counts[ranks + r];
    if (status == ASCC_OK && set->counts[set->rank])
        memcpy((unsigned char *)set->incoming.at + to * size,
               (unsigned char *)set->outgoing.at + own * size, set->counts[set->rank] * size);
    return status;
}

/* The rows that arrived, in a set that has none. */
static ascc_status take(ascc_mpi_particles *set, ascc_particles *to, size_t count)
{
    ascc_particles *local = set->local;
    set->local = to;
    const bool room = ascc_mpi_rows_reserve(set, count);
    if (room)
        ascc_mpi_merge_rows(set, set->incoming.at, count);
    set->local = local;
    return room ? ASCC_OK : ASCC_ERROR_MEMORY;
}

/* ---- The calls ---- */

/* The parts of all become `whole` here; until there is room for all of it that stays as it was. */
static ascc_status assemble(ascc_mpi_particles *set, ascc_particles *whole, size_t rows)
{
    const ascc_particles *p = set->local;
    const size_t size = keep_walls(set, p), d = (size_t)p->dimension;
    if (size == 0 || !ascc_particles_arrange(whole, rows, p->boundary_count, p->past_count))
        return ASCC_ERROR_MEMORY;
    ascc_status status = ascc_particles_restore(whole, set->kept.at, size);
    if (status == ASCC_OK)
        status = take(set, whole, rows);
    if (status == ASCC_OK && p->boundary_count)
        memcpy(whole->wall_impulse, set->sums.at, p->boundary_count * d * sizeof(int64_t));
    return status;
}

ascc_status ascc_mpi_particles_gather(ascc_mpi_particles *set, ascc_particles *whole, int root)
{
    ASCC_FLOAT_SCOPE;
    size_t received = 0;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_status status = begin(set, whole, root);
    if (status == ASCC_OK)
        status = ascc_mpi_sum_wall_impulses(set);
    if (status != ASCC_OK)
        return status;
    memset(set->counts, 0, (size_t)set->size * sizeof *set->counts);
    set->counts[root] = set->local->fluid_count;
    status = deal(set, set->local, &received);
    if (status == ASCC_OK && set->rank == root)
        status = assemble(set, whole, received);
    /* Of those that failed one says so to all. */
    return ascc_mpi_conclude(set, set->by_other ? ASCC_OK : status, "no memory for the whole set");
}

/* Everybody gets what root has in set->kept, so many bytes. */
static ascc_status hand_out(ascc_mpi_particles *set, int root, size_t *bytes)
{
    uint64_t size = *bytes;
    MPI_Bcast(&size, 1, MPI_UINT64_T, root, set->comm);
    *bytes = (size_t)size;
    const bool room = size > 0 && ascc_mpi_room(set, &set->kept, (size_t)size, 1);
    const ascc_status status = ascc_mpi_conclude(set, room ? ASCC_OK : ASCC_ERROR_MEMORY,
                                                 "no memory for a copy of the walls");
    for (size_t at = 0; status == ASCC_OK && at < size; at += PART)
        MPI_Bcast((unsigned char *)set->kept.at + at, (int)ascc_min_size((size_t)size - at, PART),
                  MPI_BYTE, root, set->comm);
    return status;
}

/* At first each process has an equal share of rows; a step finds their owners. */
static ascc_status fill(ascc_mpi_particles *set, const ascc_particles *whole, int root,
                        ascc_particles *fresh)
{
    const uint64_t rows = set->rank == root ? whole->fluid_count : 0, ranks = (uint64_t)set->size;
    size_t received = 0;
    for (uint64_t r = 0; r < ranks; r++)
        set->counts[r] = (size_t)(rows * (r + 1) / ranks - rows * r / ranks);
    ascc_status status = deal(set, set->rank == root ? whole : fresh, &received);
    if (status == ASCC_OK)
        status = take(set, fresh, received);
    if (status == ASCC_OK && set->rank != root && fresh->boundary_count)
        memset(fresh->wall_impulse, 0, /* they are summed over processes */
               fresh->boundary_count * (size_t)fresh->dimension * sizeof(int64_t));
    return status;
}

void ascc_mpi_become(ascc_mpi_particles *set, ascc_particles *fresh)
{
    ascc_particles *p = set->local;
    const ascc_particles old = *p;
    *p = *fresh;
    *fresh = old;
    fresh->message = p->message;
    p->message = old.message;
    set->curve.edge = ASCC_MPI_EDGE * p->spacing;
    ascc_curve_forget(&set->curve);
    set->cut = false;
}

ascc_status ascc_mpi_particles_scatter(ascc_mpi_particles *set, const ascc_particles *whole,
                                       int root)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = set->local->dimension,
                                            .spacing = set->local->spacing,
                                            .mass = set->local->default_mass};
    ascc_particles *fresh = NULL;
    ascc_status status = begin(set, whole, root);
    size_t size = status == ASCC_OK && set->rank == root ? keep_walls(set, whole) : 0;
    if (status == ASCC_OK)
        status = hand_out(set, root, &size);
    if (status != ASCC_OK)
        return status;
    status = ascc_particles_create(set->context, &options, &fresh);
    if (status == ASCC_OK)
        status = ascc_particles_restore(fresh, set->kept.at, size);
    status = ascc_mpi_agree(set, status);
    if (status == ASCC_OK)
        status = fill(set, whole, root, fresh);
    status =
        ascc_mpi_conclude(set, set->by_other ? ASCC_OK : status, "no memory for a copy of the set");
    if (status == ASCC_OK)
        ascc_mpi_become(set, fresh);
    ascc_particles_destroy(&fresh);
    return status;
}
