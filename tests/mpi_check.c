/* One fluid on the processes of an mpirun against the same fluid in an ordinary set on process 0: hash by hash.
 * Prints TAP on process 0. SPDX-License-Identifier: MIT
 *
 *   mpirun -n N mpi_check THREADS MODEL SCENE STEPS [MODEL SCENE STEPS ...]
 */
#include <ascc/mpi.h>

#include <inttypes.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

static int rank, size, number, failed;

/* Prints a TAP line; every process says whether its part is good. */
static void tell(bool good, const char *format, ...)
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
    printf(", %d processes\n", size);
    va_end(arguments);
    (void)fflush(stdout);
}

static void need(ascc_status status, const char *what, const char *message)
{
    if (status == ASCC_OK)
        return;
    (void)fprintf(stderr, "# rank %d: %s: %s: %s\n", rank, what, ascc_status_text(status), message);
    MPI_Abort(MPI_COMM_WORLD, 1);
}

/* ---- Scenes ---- */

typedef struct scene {
    int dimension;
    double spacing;
    size_t count, capacity;
    double *position, *velocity, *mass;
    size_t walls;
    double *wall, *normal;
    int32_t turning; /* a body that turns, or -1 */
} scene;

static double jitter(uint64_t *seed)
{
    *seed = *seed * 6364136223846793005u + 1442695040888963407u;
    return (double)(uint32_t)(*seed >> 33) / 2147483648.0 - 0.5;
}

static void add(scene *s, const double at[3], const double speed[3], double mass)
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

static void release(scene *s)
{
    free(s->position);
    free(s->velocity);
    free(s->mass);
}

/* The fluid of a scene; false: no such scene. */
static bool fill(scene *s, const char *name)
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
static void build_walls(const scene *s, const char *name, ascc_particles *set, int32_t *body)
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

/* ---- One case ---- */

static ascc_const_array doubles(const double *data)
{
    return (ascc_const_array){.data = data, .scalar = ASCC_DOUBLE};
}

static ascc_particles *make_set(ascc_context *context, const scene *s)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = s->dimension, .spacing = s->spacing};
    ascc_particles *set;
    need(ascc_particles_create(context, &options, &set), "set", "");
    return set;
}

static void add_part(const scene *s, ascc_mpi_particles *set)
{
    const size_t d = (size_t)s->dimension;
    const size_t first = s->count * (size_t)rank / (size_t)size,
                 end = s->count * (size_t)(rank + 1) / (size_t)size;
    const ascc_const_array position = doubles(s->position + first * d),
                           velocity = doubles(s->velocity + first * d),
                           mass = doubles(s->mass + first);
    need(ascc_mpi_particles_add_fluid(set, end - first, &position, &velocity, &mass, NULL), "fluid",
         ascc_mpi_particles_message(set));
}

static void same_snapshot(const scene *s, ascc_context *context, ascc_mpi_particles *set,
                          const ascc_particles *one, const char *label)
{
    ascc_particles *whole = make_set(context, s);
    need(ascc_mpi_particles_gather(set, rank == 0 ? whole : NULL, 0), "gather",
         ascc_mpi_particles_message(set));
    bool same = true;
    if (rank == 0) {
        const size_t bytes = ascc_particles_snapshot_size(one);
        unsigned char *a = malloc(bytes), *b = malloc(bytes);
        same = a && b && ascc_particles_snapshot_size(whole) == bytes &&
               ascc_particles_snapshot(one, a, bytes) == ASCC_OK &&
               ascc_particles_snapshot(whole, b, bytes) == ASCC_OK && memcmp(a, b, bytes) == 0;
        free(a);
        free(b);
    }
    tell(same, "%s: the snapshot has the bytes of one process", label);
    ascc_particles_destroy(&whole);
}

static void same_sums(const ascc_step *step, const ascc_step *one_step, ascc_mpi_particles *set,
                      const ascc_particles *one, int32_t body, const char *label)
{
    ascc_step_statistics all = {.size = sizeof all}, own = {.size = sizeof own};
    int64_t total[3], expected[3] = {0, 0, 0}, impulse[3], wanted[3] = {0, 0, 0};
    double torque[3], turned[3] = {0, 0, 0};
    need(ascc_mpi_step_get_statistics(step, set, &all), "statistics", "");
    need(ascc_mpi_particles_total_momentum(set, total), "momentum", "");
    need(ascc_mpi_particles_body_impulse(set, body, NULL, impulse, torque), "impulse", "");
    bool same = true;
    if (rank == 0) {
        need(ascc_step_get_statistics(one_step, &own), "statistics", "");
        need(ascc_particles_total_momentum(one, expected), "momentum", "");
        need(ascc_particles_body_impulse(one, body, NULL, wanted, turned), "impulse", "");
        same =
            memcmp(total, expected, sizeof total) == 0 &&
            memcmp(impulse, wanted, sizeof impulse) == 0 &&
            memcmp(torque, turned, sizeof torque) == 0 &&
            memcmp(all.momentum_after, own.momentum_after, sizeof total) == 0 &&
            memcmp(all.momentum_before, own.momentum_before, sizeof total) == 0 &&
            memcmp(all.external_impulse, own.external_impulse, sizeof total) == 0 &&
            memcmp(all.wall_impulse, own.wall_impulse, sizeof total) == 0 &&
            all.pair_count == own.pair_count && all.sweeps == own.sweeps &&
            all.max_neighbors == own.max_neighbors &&
            memcmp(all.level_points + 1, own.level_points + 1, sizeof own.level_points - 8) == 0 &&
            memcmp(&all.compression_after, &own.compression_after, sizeof own.compression_after) ==
                0;
    }
    tell(same, "%s: sums, impulses and statistics are those of one process", label);
}

static void run_case(ascc_context *context, const char *file, const char *name, int steps)
{
    ascc_model *model;
    ascc_model_info info = {.size = sizeof info};
    char label[128];
    const char *slash = strrchr(file, '/');
    (void)snprintf(label, sizeof label, "%s %s", slash ? slash + 1 : file, name);
    need(ascc_model_load(context, file, &model), "model", file);
    need(ascc_model_get_info(model, &info), "model", file);
    scene s = {.dimension = info.dimension, .spacing = info.particle_spacing};
    if (!fill(&s, name))
        need(ASCC_ERROR_ARGUMENT, "scene", name);
    ascc_step *step, *one_step;
    need(ascc_step_create(context, model, NULL, &step), "step", "");
    need(ascc_step_create(context, model, NULL, &one_step), "step", "");
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = s.dimension, .spacing = s.spacing};
    ascc_mpi_particles *set;
    need(ascc_mpi_particles_create(context, &options, MPI_COMM_WORLD, &set), "set", "");
    ascc_particles *one = make_set(context, &s);
    int32_t body;
    build_walls(&s, name, ascc_mpi_particles_local(set), &body);
    build_walls(&s, name, one, &body);
    add_part(&s, set);
    const ascc_const_array position = doubles(s.position), velocity = doubles(s.velocity),
                           mass = doubles(s.mass);
    need(ascc_particles_add_fluid(one, s.count, &position, &velocity, &mass, NULL), "fluid", "");
    uint64_t hash, expected = 0;
    int equal = 0, differs = 0;
    for (int n = 0; n <= steps && !differs; n++) {
        need(ascc_mpi_particles_hash(set, &hash), "hash", "");
        if (rank == 0)
            expected = ascc_particles_hash(one);
        differs = rank == 0 && hash != expected;
        MPI_Bcast(&differs, 1, MPI_INT, 0, MPI_COMM_WORLD);
        equal = n;
        if (differs || n == steps)
            break;
        need(ascc_mpi_step_run(step, set, NULL, 1), "step", ascc_mpi_particles_message(set));
        if (rank == 0)
            need(ascc_step_run(one_step, one, NULL, 1), "step", ascc_step_message(one_step));
    }
    ascc_mpi_statistics own = {.size = sizeof own};
    need(ascc_mpi_particles_get_statistics(set, &own), "statistics", "");
    for (int r = 0; r < size; r++) {
        MPI_Barrier(MPI_COMM_WORLD);
        if (r == rank && getenv("MPI_CHECK_VERBOSE"))
            (void)fprintf(stderr,
                          "# %s rank %d: own %" PRIu64 " ghosts %" PRIu64 " migrated %" PRIu64
                          " messages %" PRIu64 " bytes %" PRIu64 " refreshes %" PRIu64
                          " collectives %" PRIu64 "\n",
                          label, rank, own.own, own.ghosts, own.migrated, own.messages, own.bytes,
                          own.refreshes, own.collectives);
    }
    tell(!differs, "%s: the hash is that of one process (%d of %d steps)", label, equal, steps);
    same_sums(step, one_step, set, one, body, label);
    same_snapshot(&s, context, set, one, label);
    ascc_mpi_particles_destroy(&set);
    ascc_particles_destroy(&one);
    ascc_step_destroy(&step);
    ascc_step_destroy(&one_step);
    ascc_model_destroy(&model);
    release(&s);
}

int main(int argc, char **argv)
{
    int provided;
    MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided);
    MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    MPI_Comm_size(MPI_COMM_WORLD, &size);
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = argc > 1 ? atoi(argv[1]) : 1};
    ascc_context *context;
    need(ascc_context_create(&options, &context), "context", "");
    for (int i = 2; i + 2 < argc; i += 3)
        run_case(context, argv[i], argv[i + 1], atoi(argv[i + 2]));
    ascc_context_destroy(&context);
    if (rank == 0)
        printf("1..%d\n", number);
    MPI_Finalize();
    return failed != 0;
}
