/* Life of a distributed particle set: making it, adding and removing, sums over all processes.
 * SPDX-License-Identifier: MIT */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "base/float_env.h"
#include "base/words.h"
#include "set.h"

_Static_assert(sizeof(ascc_mpi_statistics) == 72 + sizeof(size_t) || sizeof(void *) != 8,
               "released layout");

/* ---- Making one ---- */

static void release_array(ascc_mpi_particles *set, ascc_mpi_array *array)
{
    if (array->at)
        ascc_release(&set->context->allocator, array->at, array->capacity, array->element);
}

static bool open_lists(ascc_mpi_particles *set)
{
    const ascc_allocator *a = &set->context->allocator;
    const size_t size = (size_t)set->size;
    bool room = true;
    set->counts = ascc_allocate(a, 4 * size, sizeof *set->counts);
    set->told = ascc_allocate(a, 2 * size, sizeof *set->told);
    set->curve.first = ascc_allocate(a, size, sizeof *set->curve.first);
    set->curve.cut = ascc_allocate(a, size, sizeof *set->curve.cut);
    set->parts = ascc_allocate(a, 2 * size, sizeof *set->parts);
    set->owners.rank = ascc_allocate(a, size, sizeof *set->owners.rank);
    set->owners.is = ascc_allocate(a, size, 1);
    for (int l = 0; l < ASCC_MAX_LEVELS; l++) {
        ascc_mpi_lists *lists[2] = {&set->ghosts[l].send, &set->ghosts[l].receive};
        for (int i = 0; i < 2; i++) {
            lists[i]->start = ascc_allocate(a, size + 1, sizeof *lists[i]->start);
            room &= lists[i]->start != NULL;
        }
    }
    for (size_t r = 0; set->curve.first && r < size; r++)
        set->curve.first[r] = r == 0 ? 0 : UINT64_MAX;
    return room && set->counts && set->told && set->curve.first && set->curve.cut && set->parts &&
           set->owners.rank && set->owners.is;
}

static void close_lists(ascc_mpi_particles *set)
{
    const ascc_allocator *a = &set->context->allocator;
    const size_t size = (size_t)set->size;
    ascc_mpi_array *const arrays[] = {&set->flags, &set->pairs, &set->outgoing, &set->incoming,
                                      &set->loads, &set->kept,  &set->sums,     &set->pending};
    for (size_t i = 0; i < sizeof arrays / sizeof *arrays; i++)
        release_array(set, arrays[i]);
    for (int l = 0; l < ASCC_MAX_LEVELS; l++) {
        ascc_mpi_lists *lists[2] = {&set->ghosts[l].send, &set->ghosts[l].receive};
        for (int i = 0; i < 2; i++) {
            release_array(set, &lists[i]->row);
            if (lists[i]->start)
                ascc_release(a, lists[i]->start, size + 1, sizeof *lists[i]->start);
        }
    }
    if (set->counts)
        ascc_release(a, set->counts, 4 * size, sizeof *set->counts);
    if (set->told)
        ascc_release(a, set->told, 2 * size, sizeof *set->told);
    if (set->curve.first)
        ascc_release(a, set->curve.first, size, sizeof *set->curve.first);
    if (set->curve.cut)
        ascc_release(a, set->curve.cut, size, sizeof *set->curve.cut);
    ascc_curve_release(&set->curve, a);
    if (set->parts)
        ascc_release(a, set->parts, 2 * size, sizeof *set->parts);
    if (set->owners.rank)
        ascc_release(a, set->owners.rank, size, sizeof *set->owners.rank);
    if (set->owners.is)
        ascc_release(a, set->owners.is, size, 1);
}

static void free_set(ascc_mpi_particles *set)
{
    ascc_context *context = set->context;
    MPI_Comm comm = set->comm;
    close_lists(set);
    ascc_particles_destroy(&set->local);
    set->magic = 0;
    ascc_release(&context->allocator, set, 1, sizeof *set);
    ascc_context_release(context);
    MPI_Comm_free(&comm);
}

static ascc_mpi_particles *make_set(ascc_context *context, MPI_Comm comm)
{
    ascc_mpi_particles *set = ascc_allocate(&context->allocator, 1, sizeof *set);
    if (!set)
        return NULL;
    memset(set, 0, sizeof *set);
    ascc_context_retain(context);
    set->context = context;
    set->comm = comm;
    MPI_Comm_rank(comm, &set->rank);
    MPI_Comm_size(comm, &set->size);
    set->curve.size = set->size;
    set->magic = ASCC_MPI_MAGIC;
    return set;
}

/* The same set on all processes? */
static bool is_alike(const ascc_particles *p, MPI_Comm comm)
{
    const uint64_t word[] = {(uint64_t)p->dimension, ascc_bits_of(p->spacing),
                             ascc_bits_of(p->default_mass), ascc_bits_of(p->quantum)};
    return ascc_mpi_alike(comm, word, sizeof word / sizeof *word);
}

static ascc_status open_set(ascc_context *context, const ascc_particles_options *options,
                            MPI_Comm comm, ascc_mpi_particles **set)
{
    if (!context || context->magic != ASCC_CONTEXT_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    if (context->version != ASCC_CONTEXT_VERSION) {
        ascc_context_log(context, "context: of a libascc of another version than libascc-mpi");
        return ASCC_ERROR_MISMATCH;
    }
    *set = make_set(context, comm);
    if (!*set)
        return ASCC_ERROR_MEMORY;
    const ascc_status status = ascc_particles_create(context, options, &(*set)->local);
    return status == ASCC_OK && !open_lists(*set) ? ASCC_ERROR_MEMORY : status;
}

ascc_status ascc_mpi_particles_create(ascc_context *context, const ascc_particles_options *options,
                                      MPI_Comm communicator, ascc_mpi_particles **set)
{
    ASCC_FLOAT_SCOPE;
    ascc_mpi_particles *made = NULL;
    MPI_Comm comm;
    if (set)
        *set = NULL;
    MPI_Comm_dup(communicator, &comm);
    int32_t worst =
        set ? (int32_t)open_set(context, options, comm, &made) : (int32_t)ASCC_ERROR_ARGUMENT;
    MPI_Allreduce(MPI_IN_PLACE, &worst, 1, MPI_INT32_T, MPI_MIN, comm);
    if (worst == ASCC_OK && !is_alike(made->local, comm)) {
        ascc_context_log(context, "options: not the same on all processes");
        worst = ASCC_ERROR_MISMATCH;
    }
    if (worst != ASCC_OK) {
        if (made)
            free_set(made);
        else
            MPI_Comm_free(&comm);
        return (ascc_status)worst;
    }
    made->curve.dimension = made->local->dimension;
    made->curve.edge = ASCC_MPI_EDGE * made->local->spacing;
    *set = made;
    return ASCC_OK;
}

void ascc_mpi_particles_destroy(ascc_mpi_particles **set)
{
    if (!set || !*set)
        return;
    free_set(*set);
    *set = NULL;
}

ascc_particles *ascc_mpi_particles_local(ascc_mpi_particles *set)
{
    return ascc_mpi_is_set(set) ? set->local : NULL;
}

const char *ascc_mpi_particles_message(const ascc_mpi_particles *set)
{
    return ascc_mpi_is_set(set) ? set->message.text : "";
}

ascc_status ascc_mpi_particles_get_statistics(const ascc_mpi_particles *set,
                                              ascc_mpi_statistics *statistics)
{
    if (!ascc_mpi_is_set(set) || !statistics)
        return ASCC_ERROR_ARGUMENT;
    return ascc_write_struct(statistics, &set->statistics, sizeof set->statistics,
                             sizeof set->statistics)
               ? ASCC_OK
               : ASCC_ERROR_ARGUMENT;
}

/* ---- Adding and removing ---- */

ascc_status ascc_mpi_particles_add_fluid(ascc_mpi_particles *set, size_t count,
                                         const ascc_const_array *position,
                                         const ascc_const_array *velocity,
                                         const ascc_const_array *mass, uint64_t *ids)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    ascc_particles *p = set->local;
    uint64_t before = count, total = count, next = p->next_id;
    MPI_Scan(MPI_IN_PLACE, &before, 1, MPI_UINT64_T, MPI_SUM, set->comm);
    set->statistics.collectives++;
    ascc_mpi_reduce(set, &total, 1, MPI_UINT64_T, MPI_SUM);
    ascc_mpi_reduce(set, &next, 1, MPI_UINT64_T, MPI_MAX);
    const bool fits = total <= ASCC_ID_LIMIT - next;
    p->next_id = fits ? next + (before - count) : next;
    ascc_status status = fits ? ASCC_OK : ASCC_ERROR_RANGE;
    if (status == ASCC_OK && count)
        status = ascc_particles_add_fluid(p, count, position, velocity, mass, NULL);
    const size_t added = status == ASCC_OK ? count : 0;
    status = ascc_mpi_conclude(set, status, fits ? p->message.text : "ids would pass 2^63");
    p->next_id = status == ASCC_OK ? next + total : next;
    if (status != ASCC_OK)
        p->fluid_count -= added;
    else if (count && ids)
        memcpy(ids, p->id + p->fluid_count - count, count * sizeof *ids);
    return status;
}

static int by_value(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return x < y ? -1 : x > y;
}

/* The ids that all processes name, sorted, in set->incoming. errors: MEMORY. */
static ascc_status collect_ids(ascc_mpi_particles *set, size_t count, const uint64_t *ids,
                               size_t *all)
{
    const ascc_status status = ascc_mpi_share(set, ids, count, sizeof *ids, all);
    if (status != ASCC_OK)
        return set->by_other ? ASCC_OK : status;
    if (*all)
        qsort(set->incoming.at, *all, sizeof *ids, by_value);
    return ASCC_OK;
}

/* Marks the rows of this process that have one of the ids; those that nobody has are told by who names them. */
static ascc_status mark_ids(ascc_mpi_particles *set, size_t all, size_t count, const uint64_t *ids,
                            ascc_message *message)
{
    const ascc_particles *p = set->local;
    const uint64_t *id = set->incoming.at;
    uint8_t *found = set->outgoing.at, *marked = set->flags.at;
    memset(marked, 0, p->fluid_count);
    memset(found, 0, all);
    for (size_t i = 0; i < all; i++) {
        ascc_kind kind;
        size_t row;
        if (ascc_particles_locate(p, id[i], &kind, &row) && kind == ASCC_FLUID)
            marked[row] = found[i] = 1;
    }
    ascc_mpi_reduce(set, found, all, MPI_UINT8_T, MPI_MAX);
    for (size_t i = 0; i < all; i++) {
        const bool twice = i > 0 && id[i] == id[i - 1];
        for (size_t k = 0; (twice || !found[i]) && k < count; k++)
            if (ids[k] == id[i])
                return twice ? ascc_fail(message, ASCC_ERROR_ARGUMENT,
                                         "ids: %" PRIu64 " is given twice", id[i])
                             : ascc_fail(message, ASCC_ERROR_ARGUMENT,
                                         "ids: %" PRIu64 ", which no fluid particle has", id[i]);
    }
    return ASCC_OK;
}

ascc_status ascc_mpi_particles_remove_fluid(ascc_mpi_particles *set, size_t count,
                                            const uint64_t *ids)
{
    ASCC_FLOAT_SCOPE;
    ascc_message message = {"no memory to remove particles"};
    size_t all = 0;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    ascc_status status =
        ascc_mpi_conclude(set, count && !ids ? ASCC_ERROR_ARGUMENT : ASCC_OK, "ids: NULL");
    if (status != ASCC_OK)
        return status;
    status = collect_ids(set, count, ids, &all);
    if (status == ASCC_OK && !set->stopped &&
        (!ascc_mpi_room(set, &set->flags, set->local->fluid_count + 1, 1) ||
         !ascc_mpi_room(set, &set->outgoing, all + 1, 1) || all > INT32_MAX))
        status = ASCC_ERROR_MEMORY;
    status = ascc_mpi_conclude(set, status, message.text);
    if (status == ASCC_OK)
        status = ascc_mpi_conclude(set, mark_ids(set, all, count, ids, &message), message.text);
    if (status == ASCC_OK)
        ascc_particles_drop_rows(set->local, ASCC_FLUID, set->flags.at);
    return status;
}

/* ---- Sums ---- */

/* A call that writes a result: every process must have a place for it. */
static ascc_status begin_sum(ascc_mpi_particles *set, const void *result, const char *name)
{
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    return ascc_mpi_conclude(set, result ? ASCC_OK : ASCC_ERROR_ARGUMENT, name);
}

ascc_status ascc_mpi_particles_count(ascc_mpi_particles *set, uint64_t *fluid)
{
    const ascc_status status = begin_sum(set, fluid, "fluid: NULL");
    if (status != ASCC_OK)
        return status;
    *fluid = set->local->fluid_count;
    ascc_mpi_reduce(set, fluid, 1, MPI_UINT64_T, MPI_SUM);
    return ASCC_OK;
}

ascc_status ascc_mpi_particles_hash(ascc_mpi_particles *set, uint64_t *hash)
{
    ASCC_FLOAT_SCOPE;
    const ascc_status status = begin_sum(set, hash, "hash: NULL");
    if (status != ASCC_OK)
        return status;
    uint64_t sum[2] = {set->local->fluid_count, ascc_fluid_hash(set->local)};
    ascc_mpi_reduce(set, sum, 2, MPI_UINT64_T, MPI_SUM);
    *hash = ascc_whole_hash(set->local, (size_t)sum[0], sum[1]);
    return ASCC_OK;
}

/* Numbers of 64 bits in two halves, so that their sums are exact: the upper signed, the lower not. */
static void add_halves(int64_t halves[2], int64_t number)
{
    const int64_t low = (int64_t)((uint64_t)number & 0xffffffffu);
    halves[0] += (number - low) / ((int64_t)1 << 32);
    halves[1] += low;
}

static bool join_halves(const int64_t halves[2], int64_t *number)
{
    const int64_t carry = halves[1] >> 32, high = halves[0] + carry;
    const int64_t low = halves[1] & (int64_t)0xffffffffu;
    if (high > INT32_MAX || high < INT32_MIN)
        return false;
    *number = high * ((int64_t)1 << 32) + low;
    return true;
}

ascc_status ascc_mpi_particles_total_momentum(ascc_mpi_particles *set, int64_t total[3])
{
    const ascc_status status = begin_sum(set, total, "total: NULL");
    if (status != ASCC_OK)
        return status;
    const ascc_particles *p = set->local;
    const size_t d = (size_t)p->dimension;
    int64_t halves[3][2] = {{0, 0}, {0, 0}, {0, 0}}, found[3] = {0, 0, 0};
    for (size_t i = 0; i < p->fluid_count; i++)
        for (size_t c = 0; c < d; c++)
            add_halves(halves[c], p->momentum[i * d + c]);
    ascc_mpi_reduce(set, halves, 6, MPI_INT64_T, MPI_SUM);
    for (size_t c = 0; c < d; c++)
        if (!join_halves(halves[c], &found[c]))
            return ascc_fail(&set->message, ASCC_ERROR_RANGE,
                             "total: the momentum does not fit 64 bits");
    memcpy(total, found, sizeof found);
    return ASCC_OK;
}

ascc_status ascc_mpi_sum_wall_impulses(ascc_mpi_particles *set)
{
    const ascc_particles *p = set->local;
    const size_t numbers = p->boundary_count * (size_t)p->dimension;
    const bool room =
        numbers <= INT32_MAX / 2 && ascc_mpi_room(set, &set->sums, numbers * 16 + 16, 1);
    const ascc_status status = ascc_mpi_conclude(set, room ? ASCC_OK : ASCC_ERROR_MEMORY,
                                                 "no memory for the impulses of walls");
    if (status != ASCC_OK)
        return status;
    int64_t(*halves)[2] = set->sums.at, *sum = set->sums.at;
    memset(halves, 0, numbers * sizeof *halves);
    for (size_t k = 0; k < numbers; k++)
        add_halves(halves[k], p->wall_impulse[k]);
    ascc_mpi_reduce(set, halves, 2 * numbers, MPI_INT64_T, MPI_SUM);
    for (size_t k = 0; k < numbers; k++) {
        int64_t number;
        if (!join_halves(halves[k], &number))
            return ascc_fail(&set->message, ASCC_ERROR_RANGE,
                             "boundary row %zu: its impulse does not fit 64 bits",
                             k / (size_t)p->dimension);
        sum[k] = number;
    }
    return ASCC_OK;
}

/* Every process asks its own set, which for a while has what all fluid gave to walls. */
static ascc_status ask(ascc_mpi_particles *set, ascc_status (*question)(ascc_particles *, void *),
                       void *data)
{
    char text[ASCC_MESSAGE_CAPACITY] = "";
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    ascc_status status = ascc_mpi_sum_wall_impulses(set);
    if (status != ASCC_OK)
        return status;
    ascc_particles *p = set->local;
    int64_t *own = p->wall_impulse;
    p->wall_impulse = set->sums.at;
    status = question(p, data);
    p->wall_impulse = own;
    if (status != ASCC_OK)
        ascc_context_message(set->context, text, sizeof text);
    return ascc_mpi_conclude(set, status, text);
}

typedef struct body_question {
    int32_t body;
    const double *point;
    int64_t *impulse;
    double *torque;
} body_question;

static ascc_status ask_body(ascc_particles *p, void *data)
{
    const body_question *q = data;
    return ascc_particles_body_impulse(p, q->body, q->point, q->impulse, q->torque);
}

ascc_status ascc_mpi_particles_body_impulse(ascc_mpi_particles *set, int32_t body,
                                            const double point[3], int64_t impulse[3],
                                            double torque[3])
{
    ASCC_FLOAT_SCOPE;
    body_question question = {body, point, impulse, torque};
    return ask(set, ask_body, &question);
}

typedef struct bodies_question {
    size_t count;
    const int32_t *bodies;
    int64_t (*impulse)[3];
    double (*torque)[3];
} bodies_question;

static ascc_status ask_bodies(ascc_particles *p, void *data)
{
    const bodies_question *q = data;
    return ascc_bodies_impulse(p, q->count, q->bodies, q->impulse, q->torque);
}

ascc_status ascc_mpi_bodies_impulse(ascc_mpi_particles *set, size_t count, const int32_t *bodies,
                                    int64_t (*impulse)[3], double (*torque)[3])
{
    ASCC_FLOAT_SCOPE;
    bodies_question question = {count, bodies, impulse, torque};
    return ask(set, ask_bodies, &question);
}
