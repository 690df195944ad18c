/* What goes between processes, and what they agree on. SPDX-License-Identifier: MIT
 *
 * Everything that a step exchanges begins with an agreement, one number of each process. A process that has failed
 * takes part in the next one and in nothing more, so that nobody waits for it.
 */
#include <limits.h>
#include <stdio.h>
#include <string.h>

#include "set.h"

/* Of point to point messages. */
#define TAG 0x5c
/* Bytes of one at most: MPI counts with int. */
#define PART ((size_t)1 << 30)

bool ascc_mpi_room(ascc_mpi_particles *set, ascc_mpi_array *array, size_t count, size_t element)
{
    array->element = element;
    return ascc_grow(&set->context->allocator, &array->at, &array->capacity, count, element);
}

/* ---- Agreement ---- */

void ascc_mpi_reduce(ascc_mpi_particles *set, void *numbers, size_t count, MPI_Datatype type,
                     MPI_Op op)
{
    const double begin = MPI_Wtime();
    MPI_Allreduce(MPI_IN_PLACE, numbers, (int)count, type, op, set->comm);
    set->statistics.collectives++;
    set->statistics.seconds += MPI_Wtime() - begin;
}

bool ascc_mpi_alike(MPI_Comm comm, const uint64_t *words, size_t count)
{
    uint64_t most[2][ASCC_MPI_ALIKE];
    bool alike = true;
    assert(count <= ASCC_MPI_ALIKE);
    for (size_t i = 0; i < count; i++) {
        most[0][i] = words[i];
        most[1][i] = ~words[i];
    }
    MPI_Allreduce(MPI_IN_PLACE, most, 2 * ASCC_MPI_ALIKE, MPI_UINT64_T, MPI_MAX, comm);
    for (size_t i = 0; i < count; i++)
        alike &= most[0][i] == ~most[1][i];
    return alike;
}

void ascc_mpi_open(ascc_mpi_particles *set)
{
    set->step = NULL;
    set->motion = NULL;
    set->stopped = set->by_other = false;
    set->message.text[0] = '\0';
}

ascc_status ascc_mpi_agree_on(ascc_mpi_particles *set, ascc_status own, uint64_t *largest,
                              size_t count)
{
    uint64_t words[1 + ASCC_MPI_NUMBERS] = {own != ASCC_OK}; /* of whatever call: all are alike */
    assert(count <= ASCC_MPI_NUMBERS);
    if (set->stopped)
        return own != ASCC_OK ? own : ASCC_ERROR_MISMATCH;
    if (own == ASCC_OK && count)
        memcpy(words + 1, largest, count * sizeof *largest);
    ascc_mpi_reduce(set, words, 1 + ASCC_MPI_NUMBERS, MPI_UINT64_T, MPI_MAX);
    if (!words[0]) {
        if (count)
            memcpy(largest, words + 1, count * sizeof *largest);
        return ASCC_OK;
    }
    set->stopped = true;
    set->by_other = own == ASCC_OK;
    if (set->by_other && set->step)
        ascc_fail(&set->step->message, ASCC_ERROR_MISMATCH, "another process failed");
    return own != ASCC_OK ? own : ASCC_ERROR_MISMATCH;
}

ascc_status ascc_mpi_agree(ascc_mpi_particles *set, ascc_status own)
{
    return ascc_mpi_agree_on(set, own, NULL, 0);
}

ascc_status ascc_mpi_conclude(ascc_mpi_particles *set, ascc_status own, const char *text)
{
    struct {
        int32_t status;
        char text[ASCC_MESSAGE_CAPACITY];
    } told = {.status = (int32_t)own};
    int first = own != ASCC_OK ? set->rank : set->size;
    ascc_mpi_reduce(set, &first, 1, MPI_INT, MPI_MIN);
    if (first == set->size)
        return ASCC_OK;
    if (first == set->rank)
        (void)snprintf(told.text, sizeof told.text, "rank %d: %s", set->rank, text);
    MPI_Bcast(&told, (int)sizeof told, MPI_BYTE, first, set->comm);
    set->statistics.collectives++;
    (void)ascc_fail(&set->message, (ascc_status)told.status, "%s", told.text);
    if (set->rank == 0)
        ascc_context_log(set->context, set->message.text);
    return (ascc_status)told.status;
}

/* ---- Lists ---- */

bool ascc_mpi_sort_pairs(ascc_mpi_particles *set, const ascc_mpi_pair *pair, size_t count,
                         ascc_mpi_lists *lists)
{
    if (!ascc_mpi_room(set, &lists->row, count, sizeof(uint32_t)))
        return false;
    const size_t size = (size_t)set->size;
    memset(lists->start, 0, (size + 1) * sizeof *lists->start);
    for (size_t i = 0; i < count; i++)
        lists->start[pair[i].rank + 1]++;
    for (size_t r = 0; r < size; r++)
        lists->start[r + 1] += lists->start[r];
    uint32_t *row = lists->row.at;
    for (size_t i = 0; i < count; i++)
        row[lists->start[pair[i].rank]++] = pair[i].row;
    for (size_t r = size; r > 0; r--)
        lists->start[r] = lists->start[r - 1];
    lists->start[0] = 0;
    return true;
}

/* ---- Messages ---- */

/* Sends or receives so many bytes for each process, one part after another; none where there are none. */
static int start(ascc_mpi_particles *set, bool sends, unsigned char *bytes, const size_t *count,
                 size_t size, MPI_Request *request)
{
    int pending = 0;
    for (int r = 0; r < set->size; bytes += count[r] * size, r++)
        for (size_t at = 0, end = r == set->rank ? 0 : count[r] * size; at < end; at += PART) {
            const int part = (int)ascc_min_size(end - at, PART);
            if (sends)
                MPI_Isend(bytes + at, part, MPI_BYTE, r, TAG, set->comm, &request[pending++]);
            else
                MPI_Irecv(bytes + at, part, MPI_BYTE, r, TAG, set->comm, &request[pending++]);
            set->statistics.messages += sends;
            set->statistics.bytes += sends ? (uint64_t)part : 0;
        }
    return pending;
}

/* Receives from all and sends to all; how many messages are under way. */
static int post(ascc_mpi_particles *set, const size_t *out, const size_t *in, size_t size)
{
    const double begin = MPI_Wtime();
    MPI_Request *request = set->pending.at;
    int pending = start(set, false, set->incoming.at, in, size, request);
    pending += start(set, true, set->outgoing.at, out, size, request + pending);
    set->statistics.seconds += MPI_Wtime() - begin;
    return pending;
}

static void wait_for(ascc_mpi_particles *set, int pending)
{
    const double begin = MPI_Wtime();
    MPI_Waitall(pending, set->pending.at, MPI_STATUSES_IGNORE);
    set->statistics.seconds += MPI_Wtime() - begin;
}

/* Room for all of it. */
static ascc_status make_room(ascc_mpi_particles *set, const size_t *out, const size_t *in,
                             size_t size)
{
    size_t sent = 0, received = 0, messages = 0;
    for (int r = 0; r < set->size; r++) {
        sent += out[r];
        received += in[r];
        messages += 2 + out[r] * size / PART + in[r] * size / PART;
    }
    return ascc_mpi_room(set, &set->outgoing, sent * size, 1) &&
                   ascc_mpi_room(set, &set->incoming, received * size, 1) &&
                   ascc_mpi_room(set, &set->pending, messages, sizeof(MPI_Request))
               ? ASCC_OK
               : ASCC_ERROR_MEMORY;
}

static ascc_status explain(ascc_mpi_particles *set, ascc_status status)
{
    if (status != ASCC_OK)
        (void)ascc_fail(set->step ? &set->step->message : &set->message, status,
                        "no memory for what processes exchange");
    return status;
}

ascc_status ascc_mpi_swap(ascc_mpi_particles *set, size_t size, size_t *received)
{
    const size_t ranks = (size_t)set->size;
    size_t *out = set->counts, *in = set->counts + ranks;
    uint64_t *told = set->told, *heard = told + ranks;
    for (size_t r = 0; r < ranks; r++)
        told[r] = out[r];
    MPI_Alltoall(told, 1, MPI_UINT64_T, heard, 1, MPI_UINT64_T, set->comm);
    set->statistics.collectives++;
    *received = 0;
    for (size_t r = 0; r < ranks; r++) {
        in[r] = (size_t)heard[r];
        *received += in[r];
    }
    const ascc_status status = ascc_mpi_agree(set, explain(set, make_room(set, out, in, size)));
    if (status == ASCC_OK)
        wait_for(set, post(set, out, in, size));
    return status;
}

ascc_status ascc_mpi_share(ascc_mpi_particles *set, const void *rows, size_t count, size_t size,
                           size_t *all)
{
    const size_t ranks = (size_t)set->size;
    uint64_t *heard = set->told + ranks, own = count;
    int *each = set->parts, *first = each + ranks;
    MPI_Datatype row;
    MPI_Allgather(&own, 1, MPI_UINT64_T, heard, 1, MPI_UINT64_T, set->comm);
    set->statistics.collectives += 2;
    *all = 0;
    for (size_t r = 0; r < ranks; r++) {
        first[r] = (int)ascc_min_size(*all, INT_MAX);
        each[r] = (int)ascc_min_size((size_t)heard[r], INT_MAX);
        *all += (size_t)heard[r];
    }
    const bool room = *all <= INT_MAX && ascc_mpi_room(set, &set->incoming, *all * size, 1);
    const ascc_status status =
        ascc_mpi_agree(set, explain(set, room ? ASCC_OK : ASCC_ERROR_MEMORY));
    if (status != ASCC_OK)
        return status;
    MPI_Type_contiguous((int)size, MPI_BYTE, &row);
    MPI_Type_commit(&row);
    MPI_Allgatherv(rows, each[set->rank], row, set->incoming.at, each, first, row, set->comm);
    MPI_Type_free(&row);
    return ASCC_OK;
}

/* ---- Refresh ---- */

static void pack(const ascc_mpi_refresh *refresh, size_t ranks, unsigned char *to)
{
    const ascc_mpi_lists *lists = &refresh->ghosts->send;
    const uint32_t *list = lists->row.at, *map = refresh->map;
    for (size_t i = 0; i < lists->start[ranks]; i++) {
        const size_t row = map ? map[list[i]] : list[i];
        for (size_t a = 0; a < refresh->of.count; to += refresh->of.arrays[a++].size)
            memcpy(to,
                   (unsigned char *)refresh->of.arrays[a].rows + row * refresh->of.arrays[a].size,
                   refresh->of.arrays[a].size);
    }
}

static void unpack(const ascc_mpi_refresh *refresh, size_t ranks, const unsigned char *from)
{
    const ascc_mpi_lists *lists = &refresh->ghosts->receive;
    const uint32_t *list = lists->row.at, *map = refresh->map;
    for (size_t i = 0; i < lists->start[ranks]; i++) {
        const size_t row = map ? map[list[i]] : list[i];
        for (size_t a = 0; a < refresh->of.count; from += refresh->of.arrays[a++].size)
            memcpy((unsigned char *)refresh->of.arrays[a].rows + row * refresh->of.arrays[a].size,
                   from, refresh->of.arrays[a].size);
    }
}

static const ascc_mpi_ghosts *ghosts_of(const ascc_mpi_particles *set, int32_t of)
{
    return &set->ghosts[ascc_set_level(of)];
}

size_t ascc_mpi_sent(ascc_halo *halo, int32_t of, const uint32_t **rows)
{
    const ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    const ascc_mpi_lists *send = &ghosts_of(set, of)->send;
    *rows = send->row.at;
    return send->start[set->size];
}

ascc_status ascc_mpi_send(ascc_halo *halo, const ascc_halo_refresh *refresh, const uint32_t *map)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    const ascc_mpi_ghosts *ghosts = ghosts_of(set, refresh->set);
    const size_t ranks = (size_t)set->size;
    size_t *out = set->counts, *in = set->counts + ranks, size = 0;
    for (size_t a = 0; a < refresh->count; a++)
        size += refresh->arrays[a].size;
    for (size_t r = 0; r < ranks; r++) {
        out[r] = ghosts->send.start[r + 1] - ghosts->send.start[r];
        in[r] = ghosts->receive.start[r + 1] - ghosts->receive.start[r];
    }
    if (!refresh->sure) { /* there is room for those that are, from then on */
        const size_t most = ascc_max_size(size, ASCC_HALO_SURE);
        const ascc_status status = ascc_mpi_agree(set, explain(set, make_room(set, out, in, most)));
        if (status != ASCC_OK)
            return status;
    }
    set->refresh = (ascc_mpi_refresh){.of = *refresh, .ghosts = ghosts, .map = map};
    pack(&set->refresh, ranks, set->outgoing.at);
    set->refresh.pending = post(set, out, in, size);
    return ASCC_OK;
}

void ascc_mpi_poll(ascc_halo *halo)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    int done;
    MPI_Testall(set->refresh.pending, set->pending.at, &done, MPI_STATUSES_IGNORE);
}

void ascc_mpi_receive(ascc_halo *halo)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    wait_for(set, set->refresh.pending);
    unpack(&set->refresh, (size_t)set->size, set->incoming.at);
    set->statistics.refreshes++;
}
