/* Reference solver: divergence-free SPH (Bender and Koschier 2015, 2017) in 2D and 3D, with moving walls
 * and rigid bodies (docs/reference.md has the equations). SPDX-License-Identifier: MIT
 *
 * Same bits for any thread count. Fluid pairs act on each other with exactly opposite forces, and so do fluid
 * and bodies.
 */
#ifndef REFERENCE_DFSPH_H
#define REFERENCE_DFSPH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

#include "rigid.h"

typedef struct dfsph dfsph;

#define DFSPH_BODIES 16

/* Zero is the default wherever one is named. */
typedef struct dfsph_options {
    int32_t dimension;    /* 2 or 3 */
    int32_t thread_count; /* 0 = 1 */
    double spacing;       /* m between particles, twice their radius; the support is two of them */
    double volume;        /* of a particle, in spacing^dimension; 0 = 0.8 */
    double rest_density;  /* kg/m^3; 0 = 1000 */
    double gravity[3];    /* m/s^2 */
    double viscosity;     /* kinematic, m^2/s, among fluid; walls slip */
    double time_step;     /* s, at most; 0 = no bound but the others */
    double courant;       /* spacings that the fastest particle goes in a step; 0 = 0.4 */
    double density_error; /* compression left, mean; 0 = 1e-4 */
    double
        divergence_error; /* the same of rates, in one step; 0 = 1e-3, negative = no such solver */
    int32_t iterations;   /* of each solver at most; 0 = 100 */
    int32_t reserved;
    double release; /* 1/s, of the density: more compression than that is not let go at once, as
                                overlap would burst; 0 = 1 */
    double skin;    /* of the neighbour lists, in spacings; 0 = 0.3 */
} dfsph_options;

/* What dfsph_advance has done since dfsph_set_fluid. */
typedef struct dfsph_totals {
    double time; /* s */
    uint64_t steps, rebuilds, density_iterations, divergence_iterations;
    double fastest; /* m/s, of any particle at any step */
} dfsph_totals;

/* NULL on bad options or without memory. */
dfsph *dfsph_create(const dfsph_options *options);
void dfsph_destroy(dfsph **solver);

/* Replaces the fluid: double[count][dimension], velocity NULL = at rest. */
ascc_status dfsph_set_fluid(dfsph *solver, size_t count, const double *position,
                            const double *velocity);

/* Replaces the walls that stand still: points on the surface or in layers behind it; what each stands for
 * follows from how dense they are (Akinci et al. 2012). Removes all bodies. */
ascc_status dfsph_set_walls(dfsph *solver, size_t count, const double *position);

/* Adds a body of points; of *body, kind, mass, inertia, centre, velocity and spin are read. Its number is
 * that of the bodies before it. errors: MEMORY, ARGUMENT (more than DFSPH_BODIES, or without mass). */
ascc_status dfsph_add_body(dfsph *solver, size_t count, const double *position, const rigid *body);

/* A body's present state; velocity and spin of it may be set at any time, with dfsph_drive_body. */
const rigid *dfsph_body(const dfsph *solver, size_t number);
void dfsph_drive_body(dfsph *solver, size_t number, const double velocity[3], const double spin[3]);

/* Gravity and viscosity from now on. */
void dfsph_set_forces(dfsph *solver, const double gravity[3], double viscosity);

/* Advances by dt seconds in steps of its own. errors: MEMORY, RANGE (positions), LIMIT; the state is then of
 * no use. */
ascc_status dfsph_advance(dfsph *solver, double dt);

/* Rows of three numbers, m and m/s: fluid, and points of walls and bodies behind it. */
const double (*dfsph_positions(const dfsph *solver))[3];
const double (*dfsph_velocities(const dfsph *solver))[3];
/* Of the last step: density, 1 = rest; pressure, Pa. */
const double *dfsph_densities(const dfsph *solver);
double dfsph_pressure(const dfsph *solver, size_t row);
/* What the fluid gave to the walls that stand still since dfsph_set_fluid, kg m/s. */
const double *dfsph_wall_impulse(const dfsph *solver);
double dfsph_mass(const dfsph *solver);
dfsph_totals dfsph_get_totals(const dfsph *solver);
const char *dfsph_message(const dfsph *solver);

#endif
