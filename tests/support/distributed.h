/* What the programs that run under mpirun share: TAP of all processes, scenes, one set against another.
 * SPDX-License-Identifier: MIT */
#ifndef DISTRIBUTED_H
#define DISTRIBUTED_H

#include <ascc/mpi.h>

#include <stdbool.h>

extern int rank, processes, number, failed;

void open_world(int *count, char ***arguments);
/* Ends the TAP and MPI; the program's status. */
int close_world(void);

/* Prints a TAP line; every process says whether its part is good. */
void tell(bool good, const char *format, ...) __attribute__((format(printf, 2, 3)));
/* Ends the job where a status is not OK. */
void need(ascc_status status, const char *what, const char *message);

typedef struct scene {
    int dimension;
    double spacing;
    size_t count, capacity;
    double *position, *velocity, *mass;
} scene;

void add(scene *s, const double at[3], const double speed[3], double mass);
/* The fluid of a scene, dam, drops or tank; false: no such scene. */
bool fill(scene *s, const char *name);
void release(scene *s);
/* Its walls: a box, which turns in one of them. */
void build_walls(const scene *s, const char *name, ascc_particles *set, int32_t *body);

ascc_const_array doubles(const double *data);
ascc_particles *make_set(ascc_context *context, const scene *s);
/* Each process adds its share of the rows; an ordinary set all. */
void add_part(const scene *s, ascc_mpi_particles *set);
void add_all(const scene *s, ascc_particles *set);

/* The hash of an ordinary set on process 0? The same answer everywhere. */
bool same_hash(ascc_mpi_particles *set, const ascc_particles *one);

#endif
