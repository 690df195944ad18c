/* One fluid on the processes of an mpirun against the same fluid in an ordinary set on process 0: hash by hash.
 * Prints TAP on process 0. SPDX-License-Identifier: MIT
 *
 *   mpirun -n N mpi_check THREADS MODEL SCENE STEPS [MODEL SCENE STEPS ...]
 */
#include "support/distributed.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

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
    add_all(&s, one);
    int equal = 0;
    bool same;
    while ((same = same_hash(set, one)) && equal < steps) {
        equal++;
        need(ascc_mpi_step_run(step, set, NULL, 1), "step", ascc_mpi_particles_message(set));
        if (rank == 0)
            need(ascc_step_run(one_step, one, NULL, 1), "step", ascc_step_message(one_step));
    }
    ascc_mpi_statistics own = {.size = sizeof own};
    need(ascc_mpi_particles_get_statistics(set, &own), "statistics", "");
    for (int r = 0; r < processes; r++) {
        MPI_Barrier(MPI_COMM_WORLD);
        if (r == rank && getenv("MPI_CHECK_VERBOSE"))
            (void)fprintf(stderr,
                          "# %s rank %d: own %" PRIu64 " ghosts %" PRIu64 " migrated %" PRIu64
                          " messages %" PRIu64 " bytes %" PRIu64 " refreshes %" PRIu64
                          " collectives %" PRIu64 "\n",
                          label, rank, own.own, own.ghosts, own.migrated, own.messages, own.bytes,
                          own.refreshes, own.collectives);
    }
    tell(same, "%s: the hash is that of one process (%d of %d steps)", label, equal, steps);
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
    open_world(&argc, &argv);
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = argc > 1 ? atoi(argv[1]) : 1};
    ascc_context *context;
    need(ascc_context_create(&options, &context), "context", "");
    for (int i = 2; i + 2 < argc; i += 3)
        run_case(context, argv[i], argv[i + 1], atoi(argv[i + 2]));
    ascc_context_destroy(&context);
    return close_world();
}
