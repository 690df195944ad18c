/* A run in this process alone. SPDX-License-Identifier: MIT */
#include "processes.h"

#include <stdio.h>
#include <stdlib.h>

struct ascc_spread {
    ascc_particles *whole;
};

int ascc_processes_count(void)
{
    return 1;
}

bool ascc_processes_lead(void)
{
    return true;
}

bool ascc_processes_agree(bool good, char *error, size_t capacity)
{
    (void)error;
    (void)capacity;
    return good;
}

void ascc_processes_share(void *bytes, size_t size)
{
    (void)bytes;
    (void)size;
}

ascc_status ascc_spread_open(ascc_context *context, const ascc_particles_options *options,
                             ascc_particles *whole, ascc_spread **spread, char *error,
                             size_t capacity)
{
    (void)context;
    (void)options;
    *spread = malloc(sizeof **spread);
    if (!*spread) {
        (void)snprintf(error, capacity, "no memory");
        return ASCC_ERROR_MEMORY;
    }
    (*spread)->whole = whole;
    return ASCC_OK;
}

void ascc_spread_close(ascc_spread **spread)
{
    free(*spread);
    *spread = NULL;
}

ascc_status ascc_spread_run(ascc_spread *spread, ascc_step *step, const ascc_forces *forces)
{
    return ascc_step_run(step, spread->whole, forces, 1);
}

ascc_status ascc_spread_statistics(ascc_spread *spread, const ascc_step *step,
                                   ascc_step_statistics *statistics)
{
    (void)spread;
    return ascc_step_get_statistics(step, statistics);
}

const char *ascc_spread_message(const ascc_spread *spread, const ascc_step *step)
{
    (void)spread;
    return ascc_step_message(step);
}

ascc_status ascc_spread_gather(ascc_spread *spread)
{
    (void)spread;
    return ASCC_OK;
}
