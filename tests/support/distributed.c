/* TAP, scenes and sets of the programs that run under mpirun. SPDX-License-Identifier: MIT */
#include "distributed.h"

#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

int rank, processes, number, failed;

void open_world(int *count, char ***arguments)
{
    int provided;
    MPI_Init_thread(count, arguments, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &processes);
}

int close_world(void)
{
    if (rank == 0)
        printf("1..%d\n", number);
    MPI_Finalize();
    return failed != 0;
}

void tell(bool good, const char *format, ...)
{
    int bad = !good;
    MPI_Allreduce(MPI_IN_PLACE, &bad, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    failed += bad;
    number++;
    if (rank != 0)
        return;
    va_list arguments;
    va_start(arguments, format);
    printf("%sok %d - ", bad ? "not " : "", number);
    vprintf(format, arguments);
    printf(", %d processes\n", processes);
    va_end(arguments);
    (void)fflush(stdout);
}

void need(ascc_status status, const char *what, const char *message)
{
    if (status == ASCC_OK)
        return;
    (void)fprintf(stderr, "# rank %d: %s: %s: %s\n", rank, what, ascc_status_text(status), message);
    MPI_Abort(MPI_COMM_WORLD, 1);
}

/* ---- Scenes ---- */

static double jitter(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(uint32_t)(*seed >> 33) / 2147483648.0 - 0.5;
}

void add(scene *s, const double at[3], const double speed[3], double mass)
{
    const size_t d = (size_t)s->dimension;
    if (s->count == s->capacity) {
        s->capacity = 2 * s->capacity + 64;
        s->position = realloc(s->position, s->capacity * d * sizeof(double));
        s->velocity = realloc(s->velocity, s->capacity * d * sizeof(double));
        s->mass = realloc(s->mass, s->capacity * sizeof(double));
        if (!s->position || !s->velocity || !s->mass)
            MPI_Abort(MPI_COMM_WORLD, 1);
    }
    memcpy(s->position + s->count * d, at, d * sizeof(double));
    memcpy(s->velocity + s->count * d, speed, d * sizeof(double));
    s->mass[s->count++] = mass;
}

/* Fluid on a lattice with corner `low`, so many particles along each axis. */
static void block(scene *s, const double low[3], const int cells[3], const double speed[3],
                  double mass)
{
    uint64_t seed = 7;
    const int deep = s->dimension == 3 ? cells[2] : 1;
    for (int z = 0; z < deep; z++)
        for (int y = 0; y < cells[1]; y++)
            for (int x = 0; x < cells[0]; x++) {
                const int cell[3] = {x, y, z};
                double at[3], v[3];
                for (int c = 0; c < 3; c++) {
                    at[c] = low[c] + (cell[c] + 0.5 + 0.1 * jitter(&seed)) * s->spacing;
                    v[c] = speed[c] + 0.1 * jitter(&seed);
                }
                add(s, at, v, mass);
            }
}

void release(scene *s)
{
    free(s->position);
    free(s->velocity);
    free(s->mass);
}

/* The fluid of a scene; false: no such scene. */
bool fill(scene *s, const char *name)
{
    const double h = s->spacing, still[3] = {0, 0, 0}, thrown[3] = {-3.0, 1.0, 0.5};
    const double mass = s->dimension == 3 ? 1000.0 * h * h * h : 1000.0 * h * h;
    const bool flat = s->dimension == 2;
    const double zero[3] = {0, 0, 0}, middle[3] = {20 * h, 8 * h, 3 * h};
    const double far[3] = {33 * h, 16 * h, 3 * h};
    if (strcmp(name, "dam") == 0) {
        block(s, zero, flat ? (int[]){24, 36, 1} : (int[]){10, 12, 8}, still, mass);
    } else if (strcmp(name, "drops") == 0) {
        block(s, zero, flat ? (int[]){40, 4, 1} : (int[]){24, 3, 8}, still, mass);
        block(s, middle, flat ? (int[]){8, 8, 1} : (int[]){5, 5, 5}, thrown, 0.5 * mass);
        block(s, far, (int[]){1, 1, 1}, still, mass);
    } else if (strcmp(name, "tank") == 0) {
        const double left[3] = {-12 * h, -6 * h, -4 * h};
        block(s, left, flat ? (int[]){24, 8, 1} : (int[]){16, 6, 8}, still, mass);
    } else {
        return false;
    }
    return true;
}

/* Walls of a scene: a tank, which turns in one of them, or a floor with walls. */
void build_walls(const scene *s, const char *name, ascc_particles *set, int32_t *body)
{
    const double h = s->spacing;
    const bool turns = strcmp(name, "tank") == 0;
    ascc_shape shape = {.size = sizeof shape,
                        .kind = ASCC_SHAPE_BOX,
                        .water = ASCC_WATER_INSIDE,
                        .half = {20 * h, 20 * h, 4.5 * h}};
    ascc_pose pose = {.size = sizeof pose, .position = {19.5 * h, 19.5 * h, 4 * h}};
    pose.position[2] = s->dimension == 3 ? pose.position[2] : 0.0;
    if (turns) {
        shape.half[0] = shape.half[1] = 14 * h;
        pose.position[0] = pose.position[1] = pose.position[2] = 0.0;
        pose.spin[2] = 2.0;
    }
    need(ascc_body_add(set, &shape, &pose, body), "walls", ascc_particles_message(set));
}

/* ---- Sets ---- */

ascc_const_array doubles(const double *data)
{
    return (ascc_const_array){.data = data, .scalar = ASCC_DOUBLE};
}

ascc_particles *make_set(ascc_context *context, const scene *s)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = s->dimension, .spacing = s->spacing};
    ascc_particles *set;
    need(ascc_particles_create(context, &options, &set), "set", "");
    return set;
}

void add_part(const scene *s, ascc_mpi_particles *set)
{
    const size_t d = (size_t)s->dimension;
    const size_t first = s->count * (size_t)rank / (size_t)processes,
                 end = s->count * (size_t)(rank + 1) / (size_t)processes;
    const ascc_const_array position = doubles(s->position + first * d),
                           velocity = doubles(s->velocity + first * d),
                           mass = doubles(s->mass + first);
    need(ascc_mpi_particles_add_fluid(set, end - first, &position, &velocity, &mass, NULL), "fluid",
         ascc_mpi_particles_message(set));
}

void add_all(const scene *s, ascc_particles *set)
{
    const ascc_const_array position = doubles(s->position), velocity = doubles(s->velocity),
                           mass = doubles(s->mass);
    need(ascc_particles_add_fluid(set, s->count, &position, &velocity, &mass, NULL), "fluid", "");
}

bool same_hash(ascc_mpi_particles *set, const ascc_particles *one)
{
    uint64_t hash, expected = 0;
    need(ascc_mpi_particles_hash(set, &hash), "hash", ascc_mpi_particles_message(set));
    if (rank == 0)
        expected = ascc_particles_hash(one);
    MPI_Bcast(&expected, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    return hash == expected;
}
