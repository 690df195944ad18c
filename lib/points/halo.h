/* What a step asks of other processes that hold the rest of its fluid. SPDX-License-Identifier: MIT
 *
 * A process has fluid of its own and copies of all that its own can see, ghosts, which belong to others:
 *
 *     host's rows   [ own | ghosts ]        own: computed here          ghosts: read here, and
 *     coarse rows   in one order, marked                                refreshed from their owners
 *
 * A row of its own has all of its neighbours here, in the one order that follows from positions, so that its sums
 * are those of a single process. Whatever is read through neighbours is refreshed once it has been computed. All
 * processes make the same calls in the same order: whether one is made follows from what all of them know.
 */
#ifndef ASCC_HALO_H
#define ASCC_HALO_H

#include <string.h>

#include "extent.h"
#include "particles.h"

struct ascc_step;
struct ascc_motion;

/* Rows of `size` bytes. */
typedef struct ascc_halo_rows {
    void *rows;
    size_t size;
} ascc_halo_rows;

/* Ghosts of a set, fluid or a level, become what their owners have in arrays of its rows. sure: no process can have
 * failed since the last refresh of the same set, and a row has ASCC_HALO_SURE bytes at most. */
#define ASCC_HALO_SURE 64
typedef struct ascc_halo_refresh {
    int32_t set;
    bool sure;
    size_t count;
    ascc_halo_rows arrays[3];
} ascc_halo_refresh;

typedef struct ascc_halo ascc_halo;

struct ascc_halo {
    size_t own;           /* fluid rows that are not ghosts */
    size_t total;         /* fluid of all processes */
    const uint8_t *ghost; /* [fluid rows] */
    bool uniform;         /* all fluid of all processes has one mass */
    double reached; /* host's unit: the farthest that ghosts serve from where they were seen */

    /* Makes ghosts for a step of this length, and drops them again. Fluid may change its owner. errors: MEMORY. */
    ascc_status (*begin)(ascc_halo *halo, struct ascc_step *step, ascc_particles *particles,
                         struct ascc_motion *motion);
    void (*end)(ascc_halo *halo, ascc_particles *particles);
    /* Whether ghosts serve so far; where they do not, those of the next attempt do: `reached` is larger then. */
    bool (*serve)(ascc_halo *halo, double distance);
    /* The state before the first of several substeps, and back to it. */
    bool (*keep)(ascc_halo *halo, const ascc_particles *particles);
    void (*take_back)(ascc_halo *halo, ascc_particles *particles);

    /* OK if all processes say so. After a failure of any, nobody waits for another in this run. */
    ascc_status (*agree)(ascc_halo *halo, ascc_status own);
    /* The rows whose copies are ghosts elsewhere, some several times: of the host's fluid, or of a level. */
    size_t (*sent)(ascc_halo *halo, int32_t set, const uint32_t **rows);
    /* A refresh begins: rows that are sent are final, and the others may be written until `receive`, with which it ends.
     * row: of each host's row of the fluid its row in the arrays; NULL = the same, as of levels always. errors: those
     * of any process; then it has not begun. */
    ascc_status (*send)(ascc_halo *halo, const ascc_halo_refresh *refresh, const uint32_t *row);
    void (*poll)(
        ascc_halo *halo); /* now and then between both: messages travel while MPI is called */
    void (*receive)(ascc_halo *halo);
    /* The corners of a level that this process needs, of those that it and the others found, in the order of
     * samples; which are its own. unit: m of a unit. errors: MEMORY. */
    ascc_status (*corners)(ascc_halo *halo, int level, double unit, const ascc_search_tools *tools,
                           ascc_points *samples, const uint8_t **own);
    /* Over all processes: the largest of one or two numbers, and sums that wrap. errors: those of any process. */
    ascc_status (*largest)(ascc_halo *halo, uint64_t *numbers, size_t count);
    ascc_status (*sum)(ascc_halo *halo, uint64_t *numbers, size_t count);
    /* The numbers of all processes one after another, where they are at most `most`, and where those of this one
     * begin; always how many there are. errors: those of any process. */
    ascc_status (*join)(ascc_halo *halo, uint64_t *numbers, size_t most, size_t *count,
                        size_t *first);
};

/* A refresh at once: nobody works meanwhile. Nothing without a halo. */
static inline ascc_status ascc_halo_exchange(ascc_halo *halo, const ascc_halo_refresh *refresh,
                                             const uint32_t *row)
{
    const ascc_status status = halo ? halo->send(halo, refresh, row) : ASCC_OK;
    if (halo && status == ASCC_OK)
        halo->receive(halo);
    return status;
}

/* The largest of one or two numbers >= 0 over all processes: their bits are in the order of the numbers. */
static inline ascc_status ascc_halo_largest(ascc_halo *halo, double *number, size_t count)
{
    uint64_t bits[2];
    memcpy(bits, number, count * sizeof *bits);
    const ascc_status status = halo->largest(halo, bits, count);
    memcpy(number, bits, count * sizeof *bits);
    return status;
}

#endif
