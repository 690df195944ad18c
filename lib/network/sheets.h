/* Thin walls with fluid on both sides: what lies beyond one is not seen. SPDX-License-Identifier: MIT
 *
 * A sheet is made of points at the same places with opposite normals, a layer for each side. Sides are those of the
 * beginning of the step: where the network sees a particle that flies at a sheet may be beyond it.
 */
#ifndef ASCC_SHEETS_H
#define ASCC_SHEETS_H

#include "hierarchy.h"

struct ascc_sheets {
    const uint8_t *is_sheet; /* [boundary set row] */
    /* When the step begins, in the host's unit, [set row][3]: */
    const double *fluid, *wall, *normal;
    double disc;    /* what a point covers around itself */
    ascc_rows near; /* sheet points around fluid, one of each place */
};

/* Looks for sheets among the boundary of a hierarchy; sets hierarchy->sheets if there is one. errors: MEMORY. */
ascc_status ascc_sheets_find(ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                             const ascc_plan *plan, const ascc_scene *scene);

/* Prepares lists of pairs of fluid no farther apart than this, units, to leave out what sheets hide. errors: MEMORY,
 * RANGE, LIMIT. */
ascc_status ascc_sheets_prepare(ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                double radius, int32_t max_neighbors);

/* Makes these lists leave out what sheets hide. */
void ascc_sheets_veil(const ascc_hierarchy *hierarchy, ascc_rows *rows);

#endif
