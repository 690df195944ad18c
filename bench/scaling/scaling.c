/* What processes exchange: a block of water in a tank, cut among those of an mpirun. One line of CSV on process 0.
 * SPDX-License-Identifier: MIT
 *
 *   mpirun -n N scaling MODEL SIDE STEPS THREADS      SIDE^3 particles (SIDE^2 in 2D); `scaling` alone prints the head
 *
 * The first step, in which fluid goes to its owners, is not counted. CPU time is that of all processes and their
 * threads, what they wait in included: an MPI waits by asking again and again.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include <ascc/mpi.h>

static int rank, size;

static void check(ascc_status status, const char *what, const char *message)
{
    if (status == ASCC_OK)
        return;
    (void)fprintf(stderr, "scaling: %s: %s: %s\n", what, ascc_status_text(status), message);
    MPI_Abort(MPI_COMM_WORLD, 1);
}

static double cpu_seconds(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* A tank half as high again as the water, on every process; of the water some layers each. */
static void build(ascc_mpi_particles *set, const ascc_particles_options *fluid, int side)
{
    const double h = fluid->spacing, half = 0.5 * side * h;
    const int deep = fluid->dimension == 3 ? side : 1;
    const ascc_shape box = {.size = sizeof box,
                            .kind = ASCC_SHAPE_BOX,
                            .water = ASCC_WATER_INSIDE,
                            .half = {half, 1.5 * half, half}};
    const ascc_pose pose = {.size = sizeof pose,
                            .position = {half, 1.5 * half, fluid->dimension == 3 ? half : 0.0}};
    int32_t tank;
    ascc_particles *local = ascc_mpi_particles_local(set);
    check(ascc_body_add(local, &box, &pose, &tank), "tank", ascc_particles_message(local));
    const int first = side * rank / size, end = side * (rank + 1) / size;
    float(*position)[3] =
        calloc((size_t)(end - first) * (size_t)side * (size_t)deep + 1, sizeof *position);
    size_t count = 0;
    check(position ? ASCC_OK : ASCC_ERROR_MEMORY, "fluid", "");
    for (int i = first; i < end; i++)
        for (int j = 0; j < side; j++)
            for (int k = 0; k < deep; k++, count++) {
                position[count][0] = (float)((i + 0.5) * h);
                position[count][1] = (float)((j + 0.5) * h);
                position[count][2] = (float)((k + 0.5) * h);
            }
    const ascc_const_array rows = {.data = position, .stride = sizeof *position};
    const ascc_status status = ascc_mpi_particles_add_fluid(set, count, &rows, NULL, NULL, NULL);
    check(status, "fluid", ascc_mpi_particles_message(set));
    free(position);
}

/* Counters of this process, from `begin` on: what a step does. */
enum { OWN, GHOSTS, BYTES, MESSAGES, COLLECTIVES, WAITING, CPU, NUMBERS };

static void count(const ascc_mpi_particles *set, double numbers[NUMBERS])
{
    ascc_mpi_statistics s = {.size = sizeof s};
    check(ascc_mpi_particles_get_statistics(set, &s), "statistics", "");
    numbers[OWN] = (double)s.own;
    numbers[GHOSTS] = (double)s.ghosts;
    numbers[BYTES] = (double)s.bytes;
    numbers[MESSAGES] = (double)s.messages;
    numbers[COLLECTIVES] = (double)s.collectives;
    numbers[WAITING] = s.seconds;
    numbers[CPU] = cpu_seconds();
}

/* Means over processes and the most of any, but of times: sums. */
static void print_row(const double a[NUMBERS], const double b[NUMBERS], uint64_t fluid, int steps,
                      int threads, double wall)
{
    double mean[NUMBERS], most[NUMBERS];
    for (int i = 0; i < NUMBERS; i++)
        mean[i] = most[i] = i <= GHOSTS ? b[i] : (b[i] - a[i]) / steps;
    MPI_Allreduce(MPI_IN_PLACE, mean, NUMBERS, MPI_DOUBLE, MPI_SUM, MPI_COMM_WORLD);
    MPI_Allreduce(MPI_IN_PLACE, most, NUMBERS, MPI_DOUBLE, MPI_MAX, MPI_COMM_WORLD);
    if (rank != 0)
        return;
    printf("%d,%d,%" PRIu64 ",%d", size, threads, fluid, steps);
    for (int i = 0; i < WAITING; i++)
        printf(",%.0f,%.0f", mean[i] / size, most[i]);
    printf(",%.4f,%.4f,%.4f\n", mean[WAITING], mean[CPU], wall / steps);
}

int main(int argc, char **argv)
{
    ascc_context *context;
    ascc_model *model;
    ascc_step *step;
    ascc_mpi_particles *set;
    int provided;
    char path[4096];
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    if (argc != 5) {
        if (rank == 0)
            printf("processes,threads,particles,steps,own,own_most,ghosts,ghosts_most,bytes,bytes_"
                   "most,"
                   "messages,messages_most,collectives,collectives_most,waiting_s,cpu_s,wall_s\n");
        return MPI_Finalize();
    }
    const int side = atoi(argv[2]), steps = atoi(argv[3]), threads = atoi(argv[4]);
    const ascc_context_options options = {.size = sizeof options, .thread_count = threads};
    check(ascc_context_create(&options, &context), "context", "");
    check(ascc_model_find(context, argv[1], path, sizeof path), "no such model", argv[1]);
    check(ascc_model_load(context, path, &model), "no model", path);
    ascc_particles_options fluid = {.size = sizeof fluid};
    check(ascc_model_particles_options(model, 1.0, &fluid), "options", "");
    check(ascc_step_create(context, model, NULL, &step), "step", "");
    check(ascc_mpi_particles_create(context, &fluid, MPI_COMM_WORLD, &set), "set", "");
    build(set, &fluid, side);
    check(ascc_mpi_step_run(step, set, NULL, 1), "step", ascc_mpi_particles_message(set));

    double before[NUMBERS], after[NUMBERS];
    uint64_t all;
    check(ascc_mpi_particles_count(set, &all), "count", "");
    count(set, before);
    const double begin = MPI_Wtime();
    check(ascc_mpi_step_run(step, set, NULL, steps), "step", ascc_mpi_particles_message(set));
    count(set, after);
    print_row(before, after, all, steps, threads, MPI_Wtime() - begin);

    ascc_mpi_particles_destroy(&set);
    ascc_step_destroy(&step);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return MPI_Finalize();
}
