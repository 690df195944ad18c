/* The distributed particle set, and what its parts share. SPDX-License-Identifier: MIT */
#ifndef ASCC_MPI_SET_H
#define ASCC_MPI_SET_H

#include <mpi.h>

#include <ascc/mpi.h>

#include "curve.h"
#include "points/halo.h"
#include "step/step.h"

/* An array that grows. */
typedef struct ascc_mpi_array {
    void *at;
    size_t capacity, element;
} ascc_mpi_array;

/* Rows for each process, or of each. */
typedef struct ascc_mpi_lists {
    ascc_mpi_array row; /* uint32_t */
    size_t *start;      /* [size + 1] */
} ascc_mpi_lists;

/* Ghosts of one point set: fluid, or a level. */
typedef struct ascc_mpi_ghosts {
    ascc_mpi_lists send, receive;
} ascc_mpi_ghosts;

/* A row and a process that it goes to. */
typedef struct ascc_mpi_pair {
    uint32_t rank, row;
} ascc_mpi_pair;

/* Messages under way. */
typedef struct ascc_mpi_refresh {
    ascc_halo_refresh of;
    const ascc_mpi_ghosts *ghosts;
    const uint32_t *map; /* NULL: rows of the host are those of the arrays */
    int pending;
} ascc_mpi_refresh;

struct ascc_mpi_particles {
    uint32_t magic;
    ascc_halo halo;
    MPI_Comm comm; /* the set's own */
    int rank, size;
    ascc_context *context; /* retained */
    ascc_particles
        *local; /* walls and bodies of all, fluid of this process; ghosts while a step lasts */
    ascc_curve curve;
    ascc_owners owners;
    bool cut;           /* the curve is cut by what fluid there is */
    double farthest;    /* that fluid has gone since then, host's unit */
    double went[2];     /* the same of the last step and of this one */
    bool again;         /* a step begins once more, with ghosts from farther away */
    size_t total;       /* fluid of all then */
    uint64_t neighbors; /* of fluid of this process in the last step */
    uint64_t age;       /* steps since the last look at the balance */
    ascc_mpi_ghosts ghosts[ASCC_MAX_LEVELS]; /* fluid, then levels by number */
    double reach[ASCC_MAX_LEVELS];           /* host's unit: how far a row of the set is read */
    ascc_mpi_array flags;                    /* uint8_t: ghosts among fluid rows */
    ascc_mpi_array pairs, outgoing, incoming, loads, kept, sums, pending;
    size_t kept_size;
    size_t *counts; /* [4][size] */
    uint64_t *told; /* [2][size] */
    int *parts;     /* [2][size] */
    /* Of the step under way: */
    struct ascc_step *step;
    const ascc_motion *motion;
    bool accelerates; /* some process has given an acceleration */
    bool stopped;     /* a process has failed */
    bool by_other;    /* and this one has not */
    ascc_mpi_refresh refresh;
    ascc_mpi_statistics statistics;
    ascc_message message;
};

#define ASCC_MPI_NUMBERS 2 /* that ascc_mpi_agree_on takes, at most */
#define ASCC_MPI_ALIKE 24  /* words that ascc_mpi_alike compares, at most */
#define ASCC_MPI_EDGE 8.0  /* of a block, spacings */
/* Ghosts serve so far, spacings, and by this factor farther than fluid has gone. */
#define ASCC_MPI_NEAR 0.5
#define ASCC_MPI_SPARE 1.25
#define ASCC_MPI_SURE 1.1          /* than they are expected to go: less is not enough */
#define ASCC_MPI_MAGIC 0x49435341u /* "ASCI" */

bool ascc_mpi_room(ascc_mpi_particles *set, ascc_mpi_array *array, size_t count, size_t element);

/* ---- particles.c ---- */

static inline bool ascc_mpi_is_set(const ascc_mpi_particles *set)
{
    return set && set->magic == ASCC_MPI_MAGIC;
}

/* What walls have received from all fluid, on every process, in set->sums. errors: MEMORY, RANGE. */
ascc_status ascc_mpi_sum_wall_impulses(ascc_mpi_particles *set);

/* ---- gather.c ---- */

/* The handle stays: what it has and what `fresh` has, of this process, change places. */
void ascc_mpi_become(ascc_mpi_particles *set, ascc_particles *fresh);

/* ---- exchange.c ---- */

/* MPI_Allreduce of numbers in place, counted. */
void ascc_mpi_reduce(ascc_mpi_particles *set, void *numbers, size_t count, MPI_Datatype type,
                     MPI_Op op);
/* Whether all processes give the same words. */
bool ascc_mpi_alike(MPI_Comm comm, const uint64_t *words, size_t count);
/* A call begins, which is no step. */
void ascc_mpi_open(ascc_mpi_particles *set);

/* OK where all are. */
ascc_status ascc_mpi_agree(ascc_mpi_particles *set, ascc_status own);
/* The same, and the largest of some numbers of all. */
ascc_status ascc_mpi_agree_on(ascc_mpi_particles *set, ascc_status own, uint64_t *largest,
                              size_t count);
/* The same, of a call that is no step: a failure is told to all, with the process that failed. */
ascc_status ascc_mpi_conclude(ascc_mpi_particles *set, ascc_status own, const char *text);
/* Pairs in any order become lists by process; within one the order stays. */
bool ascc_mpi_sort_pairs(ascc_mpi_particles *set, const ascc_mpi_pair *pair, size_t count,
                         ascc_mpi_lists *lists);
/* Rows of `size` bytes that were packed into set->outgoing by process, count[0][rank] of them, arrive in set->incoming,
 * count[1][rank] of them. errors: those of any process. */
ascc_status ascc_mpi_swap(ascc_mpi_particles *set, size_t size, size_t *received);
/* Rows of all processes in set->incoming, one after another. errors: those of any process. */
ascc_status ascc_mpi_share(ascc_mpi_particles *set, const void *rows, size_t count, size_t size,
                           size_t *all);
/* What a halo has of that name (points/halo.h). */
size_t ascc_mpi_sent(ascc_halo *halo, int32_t of, const uint32_t **rows);
ascc_status ascc_mpi_send(ascc_halo *halo, const ascc_halo_refresh *refresh, const uint32_t *map);
void ascc_mpi_poll(ascc_halo *halo);
void ascc_mpi_receive(ascc_halo *halo);

/* ---- rows.c: rows of fluid as bytes ---- */

/* Bytes of a row; with its acceleration while a step has one. */
size_t ascc_mpi_row_size(const ascc_mpi_particles *set);
void ascc_mpi_pack_row(const ascc_mpi_particles *set, size_t row, unsigned char *bytes);
void ascc_mpi_unpack_row(ascc_mpi_particles *set, size_t row, const unsigned char *bytes);
/* Room for so many rows. */
bool ascc_mpi_rows_reserve(ascc_mpi_particles *set, size_t rows);
/* Drops fluid rows that are marked, one byte each. */
void ascc_mpi_drop_rows(ascc_mpi_particles *set, const uint8_t *marked);
/* Puts `count` packed rows where their ids want them; there is room. */
void ascc_mpi_merge_rows(ascc_mpi_particles *set, const unsigned char *bytes, size_t count);

/* ---- ghosts.c ---- */

ascc_status ascc_mpi_ghosts_begin(ascc_halo *halo, struct ascc_step *step,
                                  ascc_particles *particles, ascc_motion *motion);
void ascc_mpi_ghosts_end(ascc_halo *halo, ascc_particles *particles);

/* ---- corners.c ---- */

ascc_status ascc_mpi_corners(ascc_halo *halo, int level, double unit,
                             const ascc_search_tools *tools, ascc_points *samples,
                             const uint8_t **own);

static inline ascc_mpi_particles *ascc_mpi_of_halo(ascc_halo *halo)
{
    return (ascc_mpi_particles *)(void *)((unsigned char *)halo -
                                          offsetof(ascc_mpi_particles, halo));
}

#endif
