/* A step of the whole fluid: the run-time's own, with a halo. SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "base/float_env.h"
#include "base/words.h"
#include "set.h"

/* ---- What the halo asks for ---- */

static ascc_status agree(ascc_halo *halo, ascc_status own)
{
    return ascc_mpi_agree(ascc_mpi_of_halo(halo), own);
}

/* Fluid that gets faster outgrows its ghosts, which costs a step that begins again: so they grow with it. */
static bool serve(ascc_halo *halo, double distance)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    set->farthest = fmax(set->farthest, distance);
    set->went[1] = fmax(set->went[1], distance);
    if (distance <= halo->reached || set->size == 1)
        return true;
    halo->reached = ASCC_MPI_SPARE * distance;
    set->statistics.repeats++;
    set->again = true;
    return false;
}

static bool keep(ascc_halo *halo, const ascc_particles *particles)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    set->kept_size = ascc_particles_snapshot_size(particles);
    return ascc_mpi_room(set, &set->kept, set->kept_size, 1) &&
           ascc_particles_snapshot(particles, set->kept.at, set->kept_size) == ASCC_OK;
}

/* There is as much room as there was: it cannot fail. */
static void take_back(ascc_halo *halo, ascc_particles *particles)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    (void)ascc_particles_restore(particles, set->kept.at, set->kept_size);
}

static ascc_status largest(ascc_halo *halo, uint64_t *numbers, size_t count)
{
    return ascc_mpi_agree_on(ascc_mpi_of_halo(halo), ASCC_OK, numbers, count);
}

static ascc_status sum(ascc_halo *halo, uint64_t *numbers, size_t count)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    const ascc_status status = ascc_mpi_agree(set, count <= INT32_MAX ? ASCC_OK : ASCC_ERROR_RANGE);
    if (status == ASCC_OK)
        ascc_mpi_reduce(set, numbers, count, MPI_UINT64_T, MPI_SUM);
    return status;
}

static ascc_status join(ascc_halo *halo, uint64_t *numbers, size_t most, size_t *count,
                        size_t *first)
{
    ascc_mpi_particles *set = ascc_mpi_of_halo(halo);
    const size_t own = *count;
    uint64_t before = own, all = own;
    const ascc_status status = ascc_mpi_agree(set, ASCC_OK);
    if (status != ASCC_OK)
        return status;
    MPI_Scan(MPI_IN_PLACE, &before, 1, MPI_UINT64_T, MPI_SUM, set->comm);
    set->statistics.collectives++;
    ascc_mpi_reduce(set, &all, 1, MPI_UINT64_T, MPI_SUM);
    *count = (size_t)all;
    *first = (size_t)before - own;
    if (all > most)
        return ASCC_OK;
    memmove(numbers + *first, numbers, own * sizeof *numbers);
    memset(numbers, 0, *first * sizeof *numbers);
    memset(numbers + before, 0, (size_t)(all - before) * sizeof *numbers);
    ascc_mpi_reduce(set, numbers, (size_t)all, MPI_UINT64_T, MPI_BOR);
    return ASCC_OK;
}

static void open_halo(ascc_mpi_particles *set, ascc_step *step)
{
    const double reached = set->halo.reached;
    set->halo = (ascc_halo){.own = set->local->fluid_count,
                            .reached = fmax(reached, ASCC_MPI_NEAR * set->local->spacing),
                            .begin = ascc_mpi_ghosts_begin,
                            .end = ascc_mpi_ghosts_end,
                            .serve = serve,
                            .keep = keep,
                            .take_back = take_back,
                            .agree = agree,
                            .sent = ascc_mpi_sent,
                            .send = ascc_mpi_send,
                            .poll = ascc_mpi_poll,
                            .receive = ascc_mpi_receive,
                            .corners = ascc_mpi_corners,
                            .largest = largest,
                            .sum = sum,
                            .join = join};
    set->step = step;
    set->stopped = set->by_other = false;
}

/* ---- What can be distributed ---- */

static const char *obstacle(const ascc_step *step)
{
    const ascc_plan *plan = &step->model->plan;
    const ascc_network *network = &step->network;
    if (step->sleep_speed > 0.0)
        return "fluid cannot sleep among processes: sleep_speed must be 0";
    if (plan->level_count > 1 && (plan->sampling != ASCC_SAMPLING_CORNERS ||
                                  plan->hysteresis > 0.0 || plan->centroid_anchor))
        return "the model's levels are no corners anchored to the world without hysteresis";
    if (plan->boundary_crop > 0.0)
        return "the model crops walls to the bounding box of the fluid";
    if (plan->history > 0)
        return "the model reads earlier velocities";
    for (int32_t l = 0; l < plan->layer_count; l++)
        if (plan->layer[l].set != ASCC_SET_FLUID &&
            (plan->layer[l].set < ASCC_SET_LEVEL || plan->layer[l].set == ASCC_SET_EDGES))
            return "the model has layers on walls or on edges";
    for (int32_t k = 0; k < network->key_count; k++)
        if (network->key[k].limit || network->key[k].source == ASCC_SET_ALL ||
            network->key[k].query == ASCC_SET_ALL || network->key[k].query == ASCC_SET_BOUNDARY)
            return "the model reads walls as fluid, or a limited number of neighbours";
    return NULL;
}

/* What all processes must have alike. */
static bool are_alike(const ascc_mpi_particles *set, const ascc_step *step,
                      const ascc_forces *forces, int32_t count)
{
    const ascc_model *model = step->model;
    uint64_t word[] = {ascc_bits_of(step->time_step),
                       ascc_bits_of(step->length_unit),
                       ascc_bits_of(step->max_displacement),
                       (uint64_t)step->most_substeps,
                       (uint64_t)count,
                       (uint64_t)model->byte_count,
                       ascc_sum_words(0, model->bytes, model->byte_count / 8),
                       ascc_whole_hash(set->local, 0, 0),
                       0,
                       0,
                       0};
    const size_t words = sizeof word / sizeof *word;
    for (int32_t c = 0; c < set->local->dimension; c++)
        word[words - 3 + (size_t)c] =
            ascc_bits_of(forces && forces->gravity ? forces->gravity[c]
                                                   : model->plan.gravity[c] / step->length_unit);
    return ascc_mpi_alike(set->comm, word, words);
}

/* What is known before anything is told to others. */
static ascc_status check(const ascc_step *step, const ascc_mpi_particles *set,
                         const ascc_forces *forces, const char **why)
{
    *why = "step: not a step";
    if (!step || step->magic != ASCC_STEP_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    *why = "step: of a libascc of another version";
    if (step->context->version != ASCC_CONTEXT_VERSION)
        return ASCC_ERROR_MISMATCH;
    *why = "ascc_forces.size is not understood";
    if (forces && !ascc_struct_is_known(forces, sizeof *forces))
        return ASCC_ERROR_ARGUMENT;
    *why = "the dimensions of model and set differ";
    if (step->model->plan.dimension != set->local->dimension)
        return ASCC_ERROR_MISMATCH;
    *why = obstacle(step);
    return *why ? ASCC_ERROR_MISMATCH : ASCC_OK;
}

static bool has_acceleration(const ascc_forces *forces)
{
    return forces && !ascc_host_array_is_absent(forces->acceleration);
}

static ascc_status prepare(ascc_step *step, ascc_mpi_particles *set, const ascc_forces *forces,
                           int32_t count)
{
    const char *why;
    const ascc_status good = check(step, set, forces, &why);
    const ascc_status status = ascc_mpi_conclude(set, good, why);
    if (status != ASCC_OK)
        return status;
    if (!are_alike(set, step, forces, count))
        return ascc_fail(&set->message, ASCC_ERROR_MISMATCH,
                         "processes do not agree on model, step, walls, gravity or count");
    uint64_t sum[2] = {set->local->fluid_count, has_acceleration(forces)};
    ascc_mpi_reduce(set, sum, 2, MPI_UINT64_T, MPI_SUM);
    open_halo(set, step);
    set->halo.total = (size_t)sum[0];
    set->accelerates = sum[1] != 0;
    return ASCC_OK;
}

ascc_status ascc_mpi_step_run(ascc_step *step, ascc_mpi_particles *set, const ascc_forces *forces,
                              int32_t count)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    ascc_status status = prepare(step, set, forces, count);
    if (status != ASCC_OK)
        return status;
    step->halo = &set->halo;
    status = ascc_step_run(step, set->local, forces, count);
    step->halo = NULL;
    set->accelerates = false;
    set->step = NULL;
    return ascc_mpi_conclude(set, set->by_other ? ASCC_OK : status, step->message.text);
}

/* ---- Statistics ---- */

/* Sums and maxima over all processes. */
static void join_statistics(ascc_mpi_particles *set, ascc_step_statistics *s)
{
    int64_t *const quanta[] = {s->momentum_before, s->momentum_after, s->external_impulse,
                               s->wall_impulse};
    for (size_t i = 0; i < 4; i++)
        ascc_mpi_reduce(set, quanta[i], 3, MPI_UINT64_T, MPI_SUM);
    uint64_t sums[3] = {s->pair_count, s->neighbor_count, s->scratch_size};
    ascc_mpi_reduce(set, sums, 3, MPI_UINT64_T, MPI_SUM);
    s->pair_count = sums[0];
    s->neighbor_count = sums[1];
    s->scratch_size = (size_t)sums[2];
    ascc_mpi_reduce(set, &s->max_neighbors, 1, MPI_UINT64_T, MPI_MAX);
    double seconds[ASCC_MAX_STAGES + 1];
    for (int32_t i = 0; i < ASCC_MAX_STAGES; i++)
        seconds[i] = s->stage[i].seconds;
    seconds[ASCC_MAX_STAGES] = s->seconds_total;
    ascc_mpi_reduce(set, seconds, ASCC_MAX_STAGES + 1, MPI_DOUBLE, MPI_MAX);
    for (int32_t i = 0; i < ASCC_MAX_STAGES; i++)
        s->stage[i].seconds = seconds[i];
    s->seconds_total = seconds[ASCC_MAX_STAGES];
    s->level_points[0] =
        set->rank == 0 ? s->level_points[0] - set->statistics.ghosts : set->statistics.own;
    ascc_mpi_reduce(set, s->level_points, 16, MPI_UINT64_T, MPI_SUM);
}

ascc_status ascc_mpi_step_get_statistics(const ascc_step *step, ascc_mpi_particles *set,
                                         ascc_step_statistics *statistics)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    const bool good = step && step->magic == ASCC_STEP_MAGIC && statistics &&
                      ascc_struct_is_known(statistics, sizeof *statistics);
    const ascc_status status =
        ascc_mpi_conclude(set, good ? ASCC_OK : ASCC_ERROR_ARGUMENT,
                          "step: not a step, or statistics: NULL or of a size not understood");
    if (status != ASCC_OK)
        return status;
    ascc_step_statistics s = step->statistics;
    join_statistics(set, &s);
    (void)ascc_write_struct(statistics, &s, sizeof s, sizeof s);
    return ASCC_OK;
}
