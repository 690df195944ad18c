/* Reference solver: weakly compressible SPH in 2D and 3D (docs/reference.md has the equations).
 * SPDX-License-Identifier: MIT
 *
 * Double precision; every sum over neighbours is made by one worker in list order, so results have
 * the same bits for any thread count. Fluid pairs act on each other with exactly opposite forces.
 */
#ifndef REFERENCE_SPH_H
#define REFERENCE_SPH_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

typedef struct sph sph;

/* Zero is the default wherever one is named. */
typedef struct sph_options {
    int32_t dimension;    /* 2 or 3 */
    int32_t thread_count; /* 0 = 1 */
    double spacing;       /* m between particles; their mass is rest_density * spacing^dimension */
    double sound_speed;   /* m/s; ten times the fastest flow keeps density within 1 % */
    double rest_density;  /* kg/m^3; 0 = 1000 */
    double gravity[3];    /* m/s^2 */
    double smoothing;     /* smoothing length in spacings, support is twice that; 0 = 1.5 */
    double viscosity;     /* kinematic, m^2/s; no-slip walls unless it is 0 */
    double artificial_viscosity; /* alpha of Monaghan, against noise */
    double impact_viscosity;     /* beta of Monaghan, against impacts; 0 = 1.5, negative = none */
    double density_diffusion;    /* delta; 0 = 0.1, negative = none */
    double shifting;      /* times the displacement of Sun et al. 2017; 0 = 1, negative = none */
    double contact;       /* spacings below which pairs push each other; 0 = 0.7, negative = none */
    int32_t keep_tension; /* 0 = negative pressure is clipped, 1 = kept */
    int32_t reserved;
    double period[3]; /* m; box [0, period) repeats, then without walls; 0 = does not */
    double courant;   /* time step in units of smoothing length / signal speed; 0 = 0.5 */
    double skin;      /* of the neighbour lists, in spacings; 0 = 0.3 */
} sph_options;

/* One particle, as sweeps read it: one cache line. */
typedef struct sph_particle {
    double position[3]; /* m */
    double velocity[3]; /* m/s; of walls: the one that makes the mean at the wall zero */
    double density;     /* kg/m^3 */
    double pressure;    /* Pa */
} sph_particle;

/* What sph_advance has done since sph_set_fluid. */
typedef struct sph_totals {
    double time; /* s */
    uint64_t steps, rebuilds;
    double fastest; /* m/s, of any particle at any step */
} sph_totals;

/* NULL on bad options or without memory. */
sph *sph_create(const sph_options *options);
void sph_destroy(sph **solver);

/* Replaces fluid or walls; position and velocity are double[count][dimension], velocity NULL = at
 * rest. The fluid starts at rest density. Walls are dummy particles, the first layer half a spacing
 * behind the surface, as many layers as the support reaches (sph_wall_layers). */
ascc_status sph_set_fluid(sph *solver, size_t count, const double *position,
                          const double *velocity);
ascc_status sph_set_walls(sph *solver, size_t count, const double *position);
int32_t sph_wall_layers(const sph_options *options);

/* Gives each fluid particle the density of water at rest under `depth[i]` metres of fluid. */
void sph_set_depth(sph *solver, const double *depth);

/* Advances by dt seconds in steps of its own. errors: MEMORY, RANGE, NOT_FINITE; the state is then of
 * no use. */
ascc_status sph_advance(sph *solver, double dt);

/* Fluid particles, then walls; valid until the next call that changes the solver. */
const sph_particle *sph_particles(const sph *solver, size_t *fluid_count, size_t *wall_count);
double sph_mass(const sph *solver);
sph_totals sph_get_totals(const sph *solver);
const char *sph_message(const sph *solver);

#endif
