/* A dam break on the processes of an mpirun, which goes on from its last snapshot. SPDX-License-Identifier: MIT
 *
 *   mpirun -n 4 host_mpi MODEL STEPS PREFIX
 *
 * Every ten steps the whole fluid goes into the file PREFIX.STEP. A job that was killed goes on from the last of them,
 * on any number of processes, and ends with the same hash.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include <ascc/mpi.h>

enum { COLUMNS = 24, ROWS = 36, DEEP = 8 };
static int rank, size;

/* The library returns the same status on all processes: one of them tells, all end. */
static void check(ascc_status status, const char *what, const char *message)
{
    if (status == ASCC_OK)
        return;
    if (rank == 0)
        (void)fprintf(stderr, "%s: %s: %s\n", what, ascc_status_text(status), message);
    (void)MPI_Finalize();
    exit(1);
}

/* A tank, on every process, and of each some columns of the water. */
static void build(ascc_mpi_particles *set, double h, int deep)
{
    static float position[COLUMNS * ROWS * DEEP][3];
    size_t count = 0;
    int32_t tank;
    const ascc_shape box = {.size = sizeof box,
                            .kind = ASCC_SHAPE_BOX,
                            .water = ASCC_WATER_INSIDE,
                            .half = {32 * h, 24 * h, 4 * h}};
    const ascc_pose pose = {.size = sizeof pose, .position = {32 * h, 24 * h, deep / 2 * h}};
    ascc_particles *local = ascc_mpi_particles_local(set);
    check(ascc_body_add(local, &box, &pose, &tank), "tank", ascc_particles_message(local));
    for (int i = COLUMNS * rank / size; i < COLUMNS * (rank + 1) / size; i++)
        for (int j = 0; j < ROWS; j++)
            for (int k = 0; k < deep; k++, count++) {
                position[count][0] = (float)((i + 0.5) * h);
                position[count][1] = (float)((j + 0.5) * h);
                position[count][2] = (float)((k + 0.5) * h);
            }
    const ascc_const_array rows = {.data = position, .stride = sizeof *position};
    const ascc_status status = ascc_mpi_particles_add_fluid(set, count, &rows, NULL, NULL, NULL);
    check(status, "fluid", ascc_mpi_particles_message(set));
}

int main(int argc, char **argv)
{
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    ascc_mpi_particles *set;
    uint64_t hash;
    char path[4096];
    MPI_Init(&argc, &argv);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    check(argc == 4 ? ASCC_OK : ASCC_ERROR_ARGUMENT, "usage", "host_mpi MODEL STEPS PREFIX");
    check(ascc_context_create(NULL, &context), "context", "");
    check(ascc_model_find(context, argv[1], path, sizeof path), "no such model", argv[1]);
    check(ascc_model_load(context, path, &model), "no model", path);
    ascc_particles_options fluid = {.size = sizeof fluid};
    check(ascc_model_particles_options(model, 1.0, &fluid), "options", "");
    check(ascc_step_create(context, model, NULL, &step), "step", "");
    check(ascc_mpi_particles_create(context, &fluid, MPI_COMM_WORLD, &set), "set", "");

    int steps = atoi(argv[2]), done = steps + 1;
    for (FILE *file = NULL; rank == 0 && !file && --done > 0;) { /* the last snapshot */
        (void)snprintf(path, sizeof path, "%s.%d", argv[3], done);
        if ((file = fopen(path, "rb")) != NULL)
            (void)fclose(file);
    }
    MPI_Bcast(&done, 1, MPI_INT, 0, MPI_COMM_WORLD);
    const int first = done;
    if (done > 0)
        check(ascc_mpi_particles_load(set, path), "load", ascc_mpi_particles_message(set));
    else
        build(set, fluid.spacing, fluid.dimension == 3 ? DEEP : 1);
    while (done < steps) {
        check(ascc_mpi_step_run(step, set, NULL, 1), "step", ascc_mpi_particles_message(set));
        (void)snprintf(path, sizeof path, "%s.%d", argv[3], ++done);
        if (done % 10 == 0)
            check(ascc_mpi_particles_save(set, path), "save", ascc_mpi_particles_message(set));
    }
    check(ascc_mpi_particles_hash(set, &hash), "hash", ascc_mpi_particles_message(set));
    if (rank == 0)
        printf("steps %d to %d, %d processes: hash %016" PRIx64 "\n", first, done, size, hash);
    ascc_mpi_particles_destroy(&set);
    ascc_step_destroy(&step);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return MPI_Finalize();
}
