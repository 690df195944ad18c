/* A run on the processes of an mpirun; process 0 leads. SPDX-License-Identifier: MIT */
#include "processes.h"

#include <ascc/mpi.h>

#include <stdio.h>
#include <stdlib.h>

struct ascc_spread {
    ascc_particles *whole;
    ascc_mpi_particles *set; /* NULL: there is one process, which does without */
};

static int told(int (*ask)(MPI_Comm, int *))
{
    int number;
    (void)ask(MPI_COMM_WORLD, &number);
    return number;
}

int ascc_processes_count(void)
{
    return told(MPI_Comm_size);
}

bool ascc_processes_lead(void)
{
    return told(MPI_Comm_rank) == 0;
}

bool ascc_processes_agree(bool good, char *error, size_t capacity)
{
    int first = good ? ascc_processes_count() : told(MPI_Comm_rank);
    (void)MPI_Allreduce(MPI_IN_PLACE, &first, 1, MPI_INT, MPI_MIN, MPI_COMM_WORLD);
    if (first == ascc_processes_count())
        return true;
    if (capacity)
        (void)MPI_Bcast(error, (int)capacity, MPI_CHAR, first, MPI_COMM_WORLD);
    return false;
}

void ascc_processes_share(void *bytes, size_t size)
{
    (void)MPI_Bcast(bytes, (int)size, MPI_BYTE, 0, MPI_COMM_WORLD);
}

/* The context's own line is what its last call left there. */
static ascc_status failed(ascc_context *context, ascc_status status, char *error, size_t capacity)
{
    char line[256] = "";
    (void)ascc_context_message(context, line, sizeof line);
    (void)snprintf(error, capacity, "processes: %s%s%s", ascc_status_text(status),
                   line[0] ? ": " : "", line);
    return status;
}

ascc_status ascc_spread_open(ascc_context *context, const ascc_particles_options *options,
                             ascc_particles *whole, ascc_spread **spread, char *error,
                             size_t capacity)
{
    *spread = calloc(1, sizeof **spread);
    if (!ascc_processes_agree(*spread != NULL, NULL, 0))
        return failed(context, ASCC_ERROR_MEMORY, error, capacity);
    (*spread)->whole = whole;
    if (ascc_processes_count() == 1)
        return ASCC_OK;
    ascc_status status =
        ascc_mpi_particles_create(context, options, MPI_COMM_WORLD, &(*spread)->set);
    if (status != ASCC_OK)
        return failed(context, status, error, capacity);
    status = ascc_mpi_particles_scatter((*spread)->set, whole, 0);
    if (status != ASCC_OK)
        (void)snprintf(error, capacity, "%s", ascc_mpi_particles_message((*spread)->set));
    return status;
}

void ascc_spread_close(ascc_spread **spread)
{
    if (*spread)
        ascc_mpi_particles_destroy(&(*spread)->set);
    free(*spread);
    *spread = NULL;
}

ascc_status ascc_spread_run(ascc_spread *spread, ascc_step *step, const ascc_forces *forces)
{
    return spread->set ? ascc_mpi_step_run(step, spread->set, forces, 1)
                       : ascc_step_run(step, spread->whole, forces, 1);
}

ascc_status ascc_spread_statistics(ascc_spread *spread, const ascc_step *step,
                                   ascc_step_statistics *statistics)
{
    return spread->set ? ascc_mpi_step_get_statistics(step, spread->set, statistics)
                       : ascc_step_get_statistics(step, statistics);
}

const char *ascc_spread_message(const ascc_spread *spread, const ascc_step *step)
{
    return spread->set ? ascc_mpi_particles_message(spread->set) : ascc_step_message(step);
}

ascc_status ascc_spread_gather(ascc_spread *spread)
{
    return spread->set ? ascc_mpi_particles_gather(spread->set, spread->whole, 0) : ASCC_OK;
}
