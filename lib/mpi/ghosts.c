/* Fluid finds its owner, and owners give copies to all who can see it. SPDX-License-Identifier: MIT
 *
 * Fluid belongs to the process whose block it is in where the network sees it. What is within the reach of lists of
 * any block goes to that block's owner too, so that every row that is computed finds all of its neighbours at home.
 */
#include <math.h>
#include <string.h>

#include "set.h"

/* Steps between two looks at the balance, the imbalance that is mended, and how much of a process's share a cut may
 * move then; a change of all fluid that asks for a look at once, and has no such limit. */
#define LOOK 32
#define UNEVEN 1.1
#define FARTHEST 0.25
#define OTHER 0.125
/* Fluid that flies about is not expected to go on so: by what share it may get faster in a step. */
#define FASTER 0.25
/* What a row costs besides its neighbours, in neighbours: water3d's in a dam break. */
#define ROW 25
/* Lengths are rounded when they become integers: a share of them that covers it. */
#define COVER 1e-6

/* ---- Lengths ---- */

/* How far rows are read: of a list's source, from its query. Host's unit. */
static void find_reach(ascc_mpi_particles *set)
{
    const struct ascc_step *step = set->step;
    const ascc_network *network = &step->network;
    const ascc_relaxation *relaxation = &network->plan->relaxation;
    memset(set->reach, 0, sizeof set->reach);
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        const double reach =
            (1.0 + COVER) * (key->cube > 0.0 ? key->cube : key->radius) / step->model_length;
        if (key->source == ASCC_SET_BOUNDARY)
            continue;
        double *most = &set->reach[ascc_set_level(key->source)];
        *most = fmax(*most, reach);
    }
    if (relaxation->pressure.count && relaxation->rounds > 1)
        set->reach[0] =
            fmax(set->reach[0], (1.0 + COVER) * (relaxation->reach / step->model_length +
                                                 2.0 * set->halo.reached));
}

/* How far fluid will go in this step if it gets faster as it did in the last. Host's unit. */
static void foresee(ascc_mpi_particles *set)
{
    const double last = set->went[1], faster = fmax(last - set->went[0], 0.0);
    const double expected = last + fmin(faster, FASTER * last);
    const bool again = set->again;
    set->again = false;
    set->went[1] = 0.0;
    if (again)
        return;
    set->went[0] = last;
    if (ASCC_MPI_SURE * expected > set->halo.reached)
        set->halo.reached = ASCC_MPI_SPARE * expected;
}

/* Where fluid decides whose it is: where the network sees it in the step under way, or where it is. */
static void find_place(const ascc_mpi_particles *set, size_t row, double place[3])
{
    const ascc_particles *p = set->local;
    const ascc_motion *motion = set->motion;
    const size_t d = (size_t)p->dimension;
    for (size_t c = 0; c < d; c++) {
        place[c] = p->position[row * d + c];
        if (!motion || motion->advection == ASCC_ADVECT_NONE)
            continue;
        const double dt = motion->time_step,
                     share = motion->advection == ASCC_ADVECT_MEAN ? 0.5 : 1.0;
        const double pushed =
            motion->gravity[c] + (set->accelerates ? set->step->acceleration[row * d + c] : 0.0);
        place[c] += dt * (ascc_velocity(p, row, (int32_t)c) + share * dt * pushed);
    }
}

/* ---- Balance ---- */

/* What fluid of this process costs: its neighbours in the last step, and what rows need beside them. */
static uint64_t cost_of(const ascc_mpi_particles *set)
{
    return set->local->fluid_count * (uint64_t)ROW + set->neighbors;
}

/* Blocks with fluid of this process; false without memory. */
static bool find_loads(ascc_mpi_particles *set, size_t *count)
{
    const size_t rows = set->local->fluid_count;
    const uint64_t each = rows ? cost_of(set) / rows : 0;
    size_t found = 0;
    if (!ascc_mpi_room(set, &set->loads, rows, sizeof(ascc_load)))
        return false;
    ascc_load *load = set->loads.at;
    for (size_t i = 0; i < rows; i++) {
        double place[3];
        int64_t block[3];
        find_place(set, i, place);
        ascc_curve_block(&set->curve, place, block);
        const uint64_t key = ascc_curve_key(&set->curve, block);
        if (found == 0 || load[found - 1].key != key)
            load[found++] = (ascc_load){key, 0};
        load[found - 1].cost += each;
    }
    *count = ascc_loads_join(load, found);
    return true;
}

static ascc_status no_memory(ascc_mpi_particles *set)
{
    return ascc_fail(set->step ? &set->step->message : &set->message, ASCC_ERROR_MEMORY,
                     "no memory to share fluid among processes");
}

/* Has so much fluid come or gone that what was known of the balance is no use? */
static bool is_other_fluid(const ascc_mpi_particles *set)
{
    const double before = (double)set->total, now = (double)set->halo.total;
    return fabs(now - before) > OTHER * before;
}

/* Everybody has the loads of all, cuts the curve alike where it does not balance, and knows where fluid is. */
static ascc_status look(ascc_mpi_particles *set, bool room, bool anew)
{
    size_t count = 0, all;
    room = room && find_loads(set, &count);
    ascc_status status = ascc_mpi_agree(set, room ? ASCC_OK : no_memory(set));
    if (status == ASCC_OK)
        status = ascc_mpi_share(set, set->loads.at, count, sizeof(ascc_load), &all);
    if (status != ASCC_OK)
        return status;
    ascc_load *load = set->incoming.at;
    double total = 0.0;
    count = ascc_loads_join(load, all);
    for (size_t i = 0; i < count; i++)
        total += (double)load[i].cost;
    if (anew || ascc_curve_most(&set->curve, load, count) * set->size > UNEVEN * total)
        ascc_curve_cut(&set->curve, load, count, anew ? set->size : FARTHEST);
    const bool known = ascc_curve_know(&set->curve, &set->context->allocator, load, count);
    set->owners.known = false;
    status = ascc_mpi_agree(set, known ? ASCC_OK : no_memory(set));
    if (status != ASCC_OK)
        ascc_curve_forget(&set->curve);
    set->cut = status == ASCC_OK;
    return status;
}

static ascc_status balance(ascc_mpi_particles *set, bool room)
{
    const bool anew = !set->cut || is_other_fluid(set);
    if (!anew && ++set->age < LOOK)
        return ASCC_OK;
    set->age = 0;
    set->total = set->halo.total;
    set->halo.reached = fmax(ASCC_MPI_SPARE * set->farthest, ASCC_MPI_NEAR * set->local->spacing);
    set->farthest = 0.0;
    return look(set, room, anew);
}

/* ---- Owners ---- */

static bool add_pair(ascc_mpi_particles *set, size_t *count, int rank, size_t row)
{
    if (!ascc_mpi_room(set, &set->pairs, *count + 1, sizeof(ascc_mpi_pair)))
        return false;
    ((ascc_mpi_pair *)set->pairs.at)[(*count)++] = (ascc_mpi_pair){(uint32_t)rank, (uint32_t)row};
    return true;
}

/* Packs the rows of lists, and sends them. room: for all before this; largest: two numbers to agree on. */
static ascc_status send_rows(ascc_mpi_particles *set, const ascc_mpi_lists *lists, bool room,
                             uint64_t largest[2], size_t *received)
{
    const size_t ranks = (size_t)set->size, size = ascc_mpi_row_size(set);
    room = room && ascc_mpi_room(set, &set->outgoing, lists->start[ranks] * size, 1);
    const ascc_status status = ascc_mpi_agree_on(set, room ? ASCC_OK : no_memory(set), largest, 2);
    if (status != ASCC_OK)
        return status;
    const uint32_t *row = lists->row.at;
    for (size_t i = 0; i < lists->start[ranks]; i++)
        ascc_mpi_pack_row(set, row[i], (unsigned char *)set->outgoing.at + i * size);
    for (size_t r = 0; r < ranks; r++)
        set->counts[r] = lists->start[r + 1] - lists->start[r];
    return ascc_mpi_swap(set, size, received);
}

/* Fluid goes to whoever owns the block it is in; the curve is cut anew where that does not balance. room: for all
 * before this. */
static ascc_status settle(ascc_mpi_particles *set, bool room)
{
    const size_t rows = set->local->fluid_count;
    ascc_mpi_lists *leaving = &set->ghosts[0].send;
    uint64_t nothing[2] = {0, 0};
    size_t count = 0, received;
    ascc_status status = balance(set, room);
    if (status != ASCC_OK)
        return status;
    room = room && ascc_mpi_room(set, &set->flags, rows + 1, 1);
    uint8_t *leaves = set->flags.at;
    int owner = 0;
    int64_t block[3], last[3] = {INT64_MAX, 0, 0};
    for (size_t i = 0; room && i < rows; i++) {
        double place[3];
        find_place(set, i, place);
        ascc_curve_block(&set->curve, place, block);
        if (memcmp(block, last, sizeof last) != 0) /* rows follow one another mostly in one */
            owner = ascc_curve_owner(&set->curve, block);
        memcpy(last, block, sizeof last);
        leaves[i] = owner != set->rank;
        if (leaves[i])
            room = add_pair(set, &count, owner, i);
    }
    room = room && ascc_mpi_sort_pairs(set, set->pairs.at, count, leaving);
    status = send_rows(set, leaving, room, nothing, &received);
    if (status != ASCC_OK)
        return status;
    status =
        ascc_mpi_agree(set, ascc_mpi_rows_reserve(set, rows + received) ? ASCC_OK : no_memory(set));
    if (status != ASCC_OK) /* nobody has let go of anything */
        return status;
    if (count)
        ascc_mpi_drop_rows(set, leaves);
    ascc_mpi_merge_rows(set, set->incoming.at, received);
    set->statistics.migrated += received;
    return ASCC_OK;
}

/* ---- Ghosts ---- */

/* Of all fluid: bits of the greatest mass, and of the smallest, turned over. */
static void find_masses(const ascc_mpi_particles *set, uint64_t most[2])
{
    const ascc_particles *p = set->local;
    most[0] = most[1] = 0;
    for (size_t i = 0; i < p->fluid_count; i++) {
        uint64_t bits;
        memcpy(&bits, &p->mass[i], sizeof bits);
        most[0] = bits > most[0] ? bits : most[0];
        most[1] = ~bits > most[1] ? ~bits : most[1];
    }
}

/* What goes to whom. */
static bool list_ghosts(ascc_mpi_particles *set)
{
    size_t count = 0;
    set->owners.known = false;
    for (size_t i = 0; i < set->local->fluid_count; i++) {
        double place[3];
        find_place(set, i, place);
        ascc_owners_find(&set->owners, &set->curve, place, set->reach[0]);
        for (int k = 0; k < set->owners.count; k++)
            if (set->owners.rank[k] != set->rank && !add_pair(set, &count, set->owners.rank[k], i))
                return false;
    }
    return ascc_mpi_sort_pairs(set, set->pairs.at, count, &set->ghosts[0].send);
}

/* Rows that arrived become the last of the fluid. */
static ascc_status take_ghosts(ascc_mpi_particles *set, size_t received)
{
    const size_t own = set->local->fluid_count, size = ascc_mpi_row_size(set);
    const size_t ranks = (size_t)set->size;
    ascc_mpi_lists *from = &set->ghosts[0].receive;
    const bool room = ascc_mpi_rows_reserve(set, own + received) &&
                      ascc_mpi_room(set, &set->flags, own + received + 1, 1) &&
                      ascc_mpi_room(set, &from->row, received, sizeof(uint32_t));
    if (!room)
        return ascc_mpi_agree(set, no_memory(set));
    from->start[0] = 0;
    for (size_t r = 0; r < ranks; r++)
        from->start[r + 1] = from->start[r] + set->counts[ranks + r];
    for (size_t i = 0; i < received; i++) {
        ((uint32_t *)from->row.at)[i] = (uint32_t)(own + i);
        ascc_mpi_unpack_row(set, own + i, (const unsigned char *)set->incoming.at + i * size);
    }
    memset(set->flags.at, 0, own);
    memset((uint8_t *)set->flags.at + own, 1, received);
    set->local->fluid_count = own + received;
    set->halo.own = own;
    set->halo.ghost = set->flags.at;
    set->statistics.own = own;
    set->statistics.ghosts = received;
    return ASCC_OK;
}

/* Where only other processes were given accelerations, there are zeros. */
static bool rest_accelerations(ascc_mpi_particles *set)
{
    const size_t rows = set->local->fluid_count;
    if (!set->accelerates || set->motion->acceleration)
        return true;
    if (!ascc_mpi_rows_reserve(set, rows))
        return false;
    if (rows)
        memset(set->step->acceleration, 0,
               rows * (size_t)set->local->dimension * sizeof *set->step->acceleration);
    return true;
}

ascc_status ascc_mpi_ghosts_begin(ascc_halo *halo, struct ascc_step *step,
                                  ascc_particles *particles, ascc_motion *motion)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    uint64_t most[2]; /* of masses */
    size_t received;
    (void)particles;
    set->step = step;
    set->motion = motion;
    set->stopped = set->by_other = false;
    halo->own = set->local->fluid_count;
    foresee(set);
    find_reach(set);
    ascc_status status = settle(set, rest_accelerations(set));
    if (status != ASCC_OK)
        return status;
    halo->own = set->local->fluid_count;
    find_masses(set, most);
    status = send_rows(set, &set->ghosts[0].send, list_ghosts(set), most, &received);
    set->halo.uniform = most[0] == ~most[1];
    if (status == ASCC_OK)
        status = take_ghosts(set, received);
    motion->acceleration = set->accelerates ? step->acceleration : NULL;
    return status;
}

void ascc_mpi_ghosts_end(ascc_halo *halo, ascc_particles *particles)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    particles->fluid_count = halo->own;
    set->neighbors = set->step->statistics.neighbor_count;
    set->motion = NULL;
}
