/* The processes that a run is spread over: this one (processes_one.c), or those of an mpirun (processes_mpi.c).
 * SPDX-License-Identifier: MIT
 *
 * One of them leads: it reads scenes, writes files and speaks. All calls but those marked `local` are made by all, in
 * the same order.
 */
#ifndef ASCC_PROCESSES_H
#define ASCC_PROCESSES_H

#include <stdbool.h>

#include <ascc/ascc.h>

/* Local. */
int ascc_processes_count(void);
bool ascc_processes_lead(void);

/* True where all say so. Else the line in error[capacity] of the first that does not becomes everybody's. */
bool ascc_processes_agree(bool good, char *error, size_t capacity);
/* What the lead has there, everybody has. */
void ascc_processes_share(void *bytes, size_t size);

/* A fluid that is spread over them; on the lead there is a set for the whole of it. */
typedef struct ascc_spread ascc_spread;

/* whole: the lead's, whose state the fluid gets; kept, not owned; others: NULL. error receives why it failed. */
ascc_status ascc_spread_open(ascc_context *context, const ascc_particles_options *options,
                             ascc_particles *whole, ascc_spread **spread, char *error,
                             size_t capacity);
void ascc_spread_close(ascc_spread **spread);

/* One step of ascc_step_run, and what ascc_step_get_statistics tells of it. */
ascc_status ascc_spread_run(ascc_spread *spread, ascc_step *step, const ascc_forces *forces);
ascc_status ascc_spread_statistics(ascc_spread *spread, const ascc_step *step,
                                   ascc_step_statistics *statistics);
/* Local. Why the last run failed. */
const char *ascc_spread_message(const ascc_spread *spread, const ascc_step *step);

/* The lead's set becomes what the fluid is now. */
ascc_status ascc_spread_gather(ascc_spread *spread);

#endif
