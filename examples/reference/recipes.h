/* Random scenes to generate data from: what lies where, how it moves, how long it is watched.
 * SPDX-License-Identifier: MIT
 *
 * A recipe follows from its kind, seed and number alone.
 */
#ifndef REFERENCE_RECIPES_H
#define REFERENCE_RECIPES_H

#include "rigid.h"
#include "solids.h"
#include "sph.h"

/* What computes a recipe: places of walls and of the first particles depend on it. */
typedef enum recipe_solver_kind { RECIPE_DFSPH = 0, RECIPE_SPH = 1 } recipe_solver_kind;

#define RECIPE_SOLIDS 8

/* Zero is the kind's own choice. */
typedef struct recipe_options {
    uint64_t seed, number;
    int32_t dimension;
    int32_t frames;
    double spacing; /* m; lengths of the scene stay */
    double frame;   /* s between frames */
    double gravity; /* times the kind's; 0 = 1 */
    recipe_solver_kind solver;
    int32_t reserved;
} recipe_options;

/* How a solid moves; zero is at rest. It may not touch others. */
typedef struct recipe_motion {
    rigid_kind kind;
    int32_t reserved;
    double density;       /* kg/m^3, of a free one */
    double spin, spin_up; /* of a driven one: 1/s about z, with a delay of so many s */
    double reach, rate; /* likewise: its x goes to and fro as reach (1 - cos(rate t)), m and 1/s */
} recipe_motion;

typedef struct recipe {
    uint64_t number;
    int32_t dimension, frames;
    double spacing, frame; /* m; s between frames */
    double gravity[3];
    recipe_solver_kind solver;
    double volume;            /* of a particle, in spacing^dimension */
    double viscosity;         /* m^2/s, of DFSPH */
    double settle;            /* s that pass before the first frame, calmed; of DFSPH */
    double settle_gravity[3]; /* in that time */
    size_t settled; /* particles that settle: the first so many, the rest comes later; 0 = all */
    double speed;   /* m/s, that the flow may reach: the speed of sound is ten times that */
    solid solids[RECIPE_SOLIDS];
    recipe_motion motion[RECIPE_SOLIDS]; /* of DFSPH; they rest while water settles */
    size_t solid_count;
    size_t count;
    double *position, *velocity; /* [count][dimension] */
    double *depth;  /* [count] m of water at rest above; NULL = starts without pressure */
    char text[512]; /* the scene in words, for the file */
} recipe;

/* Names of the kinds, NULL at the end, and a line about each. */
extern const char *const recipe_kinds[][2];

/* errors: ARGUMENT (unknown kind, dimension, a solver that cannot), MEMORY. recipe_free after success only. */
ascc_status recipe_make(const char *kind, const recipe_options *options, recipe *made);
void recipe_free(recipe *made);

/* An SPH solver with the recipe's fluid and walls; walls receives them. errors: MEMORY. */
ascc_status recipe_solver(const recipe *made, int32_t thread_count, sph **solver,
                          wall_points *walls);

#endif
