/* Position based fluids (Macklin and Mueller 2013), in 2D and 3D. SPDX-License-Identifier: MIT */
#ifndef REFERENCE_PBF_H
#define REFERENCE_PBF_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

typedef struct pbf pbf;

/* Zero is the default wherever one is named. */
typedef struct pbf_options {
    int32_t dimension;    /* 2 or 3 */
    int32_t thread_count; /* 0 = 1 */
    double spacing;       /* m between particles */
    double gravity[3];    /* m/s^2 */
    int32_t iterations;   /* of the density constraint, a step; 0 = 4 */
    int32_t substeps;     /* steps of pbf_advance; 0 = 1 */
    double relaxation;    /* epsilon of eq. 11, in the sum's own unit at rest; 0 = 0.05 */
    double tension;       /* k of eq. 13, against clumps; 0 = none */
    double viscosity;     /* c of eq. 17 (XSPH); 0 = 0.01, negative = none */
} pbf_options;

/* NULL on bad options or without memory. */
pbf *pbf_create(const pbf_options *options);
void pbf_destroy(pbf **solver);

/* Replaces fluid or walls: double[count][dimension], velocity NULL = at rest. Walls in layers as for
 * the SPH solver; their particles count in the density and do not move. */
ascc_status pbf_set_fluid(pbf *solver, size_t count, const double *position,
                          const double *velocity);
ascc_status pbf_set_walls(pbf *solver, size_t count, const double *position);

/* Advances by dt seconds. errors: MEMORY, RANGE, LIMIT. */
ascc_status pbf_advance(pbf *solver, double dt);

/* Rows of three numbers, m and m/s; density, 1 = rest, as the last step left it. */
const double (*pbf_positions(const pbf *solver))[3];
const double (*pbf_velocities(const pbf *solver))[3];
/* Mean of max(density - 1, 0) over the fluid, at the present positions. errors as pbf_advance. */
ascc_status pbf_density_error(pbf *solver, double *mean);
const char *pbf_message(const pbf *solver);

#endif
