/*
 * libascc-mpi: one fluid on many processes, with the bits of one.
 * SPDX-License-Identifier: MIT
 *
 * A distributed particle set lies over a communicator of the host's. Each process has the fluid of its part of space and
 * copies of all walls and bodies; models and steps are those of libascc, made alike on every process. What comes out
 * of a step is bit for bit what one process computes of the whole, whatever the number of processes and of their
 * threads: docs/mpi.md says how.
 *
 * All calls but those marked `local` are collective: every process of the communicator makes them, in the same order.
 * They return the same status everywhere; on an error every process has its set as it was, and the message names the
 * process that failed. MPI's own errors are handled as the communicator says: by default they end the job.
 *
 * libascc-mpi brings its own copy of the run-time's code and works on the handles of a libascc of the same version. MPI
 * must have been started with MPI_THREAD_FUNNELED or more where contexts have several threads: only the calling
 * thread calls MPI.
 */
#ifndef ASCC_MPI_H
#define ASCC_MPI_H

#include <mpi.h>

#include "ascc.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct ascc_mpi_particles ascc_mpi_particles;

/**
 * Makes an empty set. options: as of ascc_particles_create, the same on every process. communicator: is duplicated.
 * errors: ARGUMENT, MEMORY, as ascc_particles_create; told to the context's log.
 */
ASCC_API ascc_status ascc_mpi_particles_create(ascc_context *context,
                                               const ascc_particles_options *options,
                                               MPI_Comm communicator, ascc_mpi_particles **set);
ASCC_API void ascc_mpi_particles_destroy(ascc_mpi_particles **set);

/**
 * Local. The set of this process: its fluid, in the order of ids, all walls and all bodies. Read it with the functions of
 * ascc.h. Walls and bodies are added, moved and removed there too, by the same calls on every process; fluid is
 * not. A step, and ascc_mpi_particles_scatter, move fluid from process to process: rows of it mean something until
 * the next one, ids for ever. The set's.
 */
ASCC_API ascc_particles *ascc_mpi_particles_local(ascc_mpi_particles *set);

/** Local. The message of the last call on this set that failed, or "". The set's, until its next call. */
ASCC_API const char *ascc_mpi_particles_message(const ascc_mpi_particles *set);

/**
 * Adds fluid, as ascc_particles_add_fluid: each process a part of it, from anywhere in space, or none. Ids count up from
 * process to process as if one had added all parts in order of ranks.
 */
ASCC_API ascc_status ascc_mpi_particles_add_fluid(ascc_mpi_particles *set, size_t count,
                                                  const ascc_const_array *position,
                                                  const ascc_const_array *velocity,
                                                  const ascc_const_array *mass, uint64_t *ids);

/**
 * Removes fluid by ids: each process names some, wherever they are, none twice. errors: ARGUMENT (an id that no fluid has,
 * or named twice; the message names it), MEMORY.
 */
ASCC_API ascc_status ascc_mpi_particles_remove_fluid(ascc_mpi_particles *set, size_t count,
                                                     const uint64_t *ids);

/** Fluid of all processes. */
ASCC_API ascc_status ascc_mpi_particles_count(ascc_mpi_particles *set, uint64_t *fluid);

/** What ascc_particles_hash is of the whole set. */
ASCC_API ascc_status ascc_mpi_particles_hash(ascc_mpi_particles *set, uint64_t *hash);

/** What ascc_particles_total_momentum is of the whole set, quanta. errors: RANGE. */
ASCC_API ascc_status ascc_mpi_particles_total_momentum(ascc_mpi_particles *set, int64_t total[3]);

/** What ascc_particles_body_impulse is of the whole set, on every process. */
ASCC_API ascc_status ascc_mpi_particles_body_impulse(ascc_mpi_particles *set, int32_t body,
                                                     const double point[3], int64_t impulse[3],
                                                     double torque[3]);

/** What ascc_bodies_impulse is of the whole set, on every process: of the local set it tells a part. */
ASCC_API ascc_status ascc_mpi_bodies_impulse(ascc_mpi_particles *set, size_t count,
                                             const int32_t *bodies, int64_t (*impulse)[3],
                                             double (*torque)[3]);

/**
 * Writes the snapshot of the whole into the file `path` of process 0, which alone writes: the bytes are those of
 * ascc_particles_snapshot of the whole, for any number of processes. It takes its place when it is complete and on disk; what
 * was there is replaced in one instant, or stays as it was when any process fails.
 *
 * path      in UTF-8; read on process 0 alone
 * errors    ARGUMENT, MEMORY, FILE (the message has the path and the reason), RANGE
 * cost      all fluid goes to process 0, a few MiB at a time: it needs no memory for the whole
 */
ASCC_API ascc_status ascc_mpi_particles_save(ascc_mpi_particles *set, const char *path);

/**
 * The set becomes what a snapshot in the file `path` of process 0 says, whoever wrote it, on how many processes: each has
 * its share of the fluid, and all have the walls and bodies. A run goes on from there bit for bit.
 *
 * path      in UTF-8; read on process 0 alone
 * errors    ARGUMENT, MEMORY, FILE, FORMAT and MISMATCH as of ascc_particles_restore; the set is as it was
 * cost      as of ascc_mpi_particles_save; each process for a while has its share three times
 */
ASCC_API ascc_status ascc_mpi_particles_load(ascc_mpi_particles *set, const char *path);

/**
 * Makes an ordinary set on process `root` what the whole is: for snapshots, which are the same bytes for any number of
 * processes, sequences, measures. whole: a set of that dimension; read on root alone. errors: ARGUMENT, MEMORY, MISMATCH,
 * RANGE (an impulse of a wall beyond what can be held).
 * cost: all fluid goes to root.
 */
ASCC_API ascc_status ascc_mpi_particles_gather(ascc_mpi_particles *set, ascc_particles *whole,
                                               int root);

/**
 * And back: the set becomes what an ordinary set on process `root` is, each process has its part. To go on from a snapshot
 * on any number of processes, restore it on root and scatter. errors: ARGUMENT, MEMORY, MISMATCH.
 */
ASCC_API ascc_status ascc_mpi_particles_scatter(ascc_mpi_particles *set,
                                                const ascc_particles *whole, int root);

/**
 * Advances the whole fluid, as ascc_step_run advances an ordinary set.
 *
 * step      of this process; made of the same model with the same options on all
 * forces    the same gravity on all; acceleration, of the fluid of this process in the order of its rows, may be
 *           absent on some: there it is 0
 * errors    as ascc_step_run; MISMATCH where processes do not agree on step, gravity or count, and where the model
 *           is of a kind that cannot be distributed: its layers lie on fluid and on levels of corners anchored to the
 *           world without hysteresis, it keeps no limited number of neighbours, remembers no earlier velocities,
 *           and crops no walls. Nothing sleeps: sleep_speed is 0.
 * message   ascc_mpi_particles_message
 */
ASCC_API ascc_status ascc_mpi_step_run(ascc_step *step, ascc_mpi_particles *set,
                                       const ascc_forces *forces, int32_t count);

/**
 * What ascc_step_get_statistics tells, of the whole: sums of quanta, pair_count and points of levels above 0 are those of
 * one process; level_points[0] are all fluid and the walls that process 0 sees; neighbor_count and scratch_size
 * are sums of what all processes hold, times and max_neighbors the largest.
 */
ASCC_API ascc_status ascc_mpi_step_get_statistics(const ascc_step *step, ascc_mpi_particles *set,
                                                  ascc_step_statistics *statistics);

/** What this process did, all of it since the set was made but for `own` and `ghosts`. */
typedef struct ascc_mpi_statistics {
    size_t size;        /* sizeof(ascc_mpi_statistics) */
    uint64_t own;       /* fluid of this process in the last step */
    uint64_t ghosts;    /* copies of others' fluid in it */
    uint64_t migrated;  /* particles that came from other processes */
    uint64_t messages;  /* that it sent to other processes, but for collective calls of MPI */
    uint64_t bytes;     /* of these */
    uint64_t refreshes; /* exchanges of values of ghosts */
    uint64_t
        collectives;  /* calls of MPI_Allreduce, MPI_Alltoall and the like, of a few bytes mostly */
    uint64_t repeats; /* steps begun again, with copies from farther away */
    double seconds;   /* wall clock in messages and collective calls: most of it is waiting */
} ascc_mpi_statistics;

/** Local. */
ASCC_API ascc_status ascc_mpi_particles_get_statistics(const ascc_mpi_particles *set,
                                                       ascc_mpi_statistics *statistics);

#ifdef __cplusplus
}
#endif

#endif
