/* Every call of a distributed set beside the same calls of an ordinary one on process 0, and what fails: on one process,
 * for one reason, with the same status on all and nothing changed. Prints TAP on process 0. SPDX-License-Identifier: MIT
 *
 *   mpirun -n N mpi_calls THREADS MODEL [MODEL ...]
 */
#include "support/distributed.h"

#include <float.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/failing_allocator.h"
#include "support/float_modes.h"

/* ---- A fluid twice ---- */

typedef struct pair {
    const char *name; /* of the model */
    ascc_context *context;
    ascc_model *model;
    scene scene;
    ascc_mpi_particles *set;
    ascc_particles *one;
    ascc_step *step, *one_step;
    int32_t body;
} pair;

static const char *scene_name;

static void open_pair(pair *p, ascc_context *context, const char *file,
                      const ascc_step_options *options)
{
    ascc_model_info info = {.size = sizeof info};
    const char *slash = strrchr(file, '/');
    memset(p, 0, sizeof *p);
    p->name = slash ? slash + 1 : file;
    p->context = context;
    need(ascc_model_load(context, file, &p->model), "model", file);
    need(ascc_model_get_info(p->model, &info), "model", file);
    p->scene = (scene){.dimension = info.dimension, .spacing = info.particle_spacing};
    if (!fill(&p->scene, scene_name))
        need(ASCC_ERROR_ARGUMENT, "scene", scene_name);
    const ascc_particles_options particles = {
        .size = sizeof particles, .dimension = info.dimension, .spacing = info.particle_spacing};
    need(ascc_mpi_particles_create(context, &particles, MPI_COMM_WORLD, &p->set), "set", "");
    p->one = make_set(context, &p->scene);
    need(ascc_step_create(context, p->model, options, &p->step), "step", "");
    need(ascc_step_create(context, p->model, options, &p->one_step), "step", "");
    build_walls(&p->scene, scene_name, ascc_mpi_particles_local(p->set), &p->body);
    build_walls(&p->scene, scene_name, p->one, &p->body);
    add_part(&p->scene, p->set);
    add_all(&p->scene, p->one);
}

static void close_pair(pair *p)
{
    ascc_mpi_particles_destroy(&p->set);
    ascc_particles_destroy(&p->one);
    ascc_step_destroy(&p->step);
    ascc_step_destroy(&p->one_step);
    ascc_model_destroy(&p->model);
    release(&p->scene);
}

static const char *message_of(const pair *p)
{
    return ascc_mpi_particles_message(p->set);
}

/* Both go on; whether they are the same after each step. */
static bool go_on(pair *p, const ascc_forces *forces, const ascc_forces *one_forces, int steps)
{
    bool same = true;
    for (int n = 0; n < steps && same; n++) {
        need(ascc_mpi_step_run(p->step, p->set, forces, 1), "step", message_of(p));
        if (rank == 0)
            need(ascc_step_run(p->one_step, p->one, one_forces, 1), "step",
                 ascc_step_message(p->one_step));
        same = same_hash(p->set, p->one);
    }
    return same;
}

/* All processes have this status, the same message, which holds a text, and the set is what it was. */
static void refused(pair *p, ascc_status status, ascc_status expected, const char *text,
                    const char *what)
{
    char told[512] = "";
    (void)snprintf(told, sizeof told, "%s", message_of(p));
    MPI_Bcast(told, sizeof told, MPI_CHAR, 0, MPI_COMM_WORLD);
    const bool good =
        status == expected && strcmp(told, message_of(p)) == 0 && strstr(told, text) != NULL;
    if (!good)
        printf("# rank %d: %d (%s), %s\n", rank, (int)status, ascc_status_text(status),
               message_of(p));
    tell(good && same_hash(p->set, p->one), "%s: %s", p->name, what);
}

/* ---- Adding, removing ---- */

static void ids_are_those_of_one(pair *p)
{
    const size_t d = (size_t)p->scene.dimension, count = (size_t)(rank + 1);
    const double h = p->scene.spacing, still[3] = {0.0, 0.0, 0.0};
    uint64_t ids[64], expected[64 * 64];
    scene more = {.dimension = p->scene.dimension, .spacing = h};
    size_t first = 0, all = 0;
    for (int r = 0; r < processes; r++) {
        first = r == rank ? all : first;
        for (int k = 0; k <= r; k++, all++) {
            const double at[3] = {(2.0 + (double)all) * h, 17.0 * h, 3.0 * h};
            add(&more, at, still, 1000.0 * pow(h, (double)d));
        }
    }
    const ascc_const_array own = doubles(more.position + first * d), whole = doubles(more.position);
    const ascc_const_array mass = doubles(more.mass);
    need(ascc_mpi_particles_add_fluid(p->set, count, &own, NULL, &mass, ids), "add", message_of(p));
    need(ascc_particles_add_fluid(p->one, all, &whole, NULL, &mass, expected), "add", "");
    const bool same = memcmp(ids, expected + first, count * sizeof *ids) == 0;
    tell(same && same_hash(p->set, p->one), "%s: ids of added fluid are those of one process",
         p->name);
    uint64_t fluid;
    need(ascc_mpi_particles_count(p->set, &fluid), "count", message_of(p));
    tell(fluid == ascc_particles_count(p->one, ASCC_FLUID) && go_on(p, NULL, NULL, 2),
         "%s: fluid added on the way", p->name);
    release(&more);
}

static void removal_by_anyone(pair *p)
{
    /* Each process names ids that are anywhere. */
    uint64_t ids[8], all[8 * 64];
    int count = 8, total = count * processes;
    uint64_t some[8 * 64];
    need(ascc_particles_get_ids(p->one, ASCC_FLUID, 0, (size_t)total, some), "ids", "");
    for (int k = 0; k < count; k++)
        ids[k] = some[k * processes + rank];
    MPI_Allgather(ids, count, MPI_UINT64_T, all, count, MPI_UINT64_T, MPI_COMM_WORLD);
    need(ascc_mpi_particles_remove_fluid(p->set, (size_t)count, ids), "remove", message_of(p));
    need(ascc_particles_remove(p->one, (size_t)total, all), "remove", "");
    tell(same_hash(p->set, p->one) && go_on(p, NULL, NULL, 2),
         "%s: each process removes fluid that is anywhere", p->name);
    const uint64_t gone = ids[0], nobody = UINT64_C(1) << 40;
    const bool last = rank == processes - 1;
    char named[64];
    (void)snprintf(named, sizeof named, "rank %d: ids: %" PRIu64, processes - 1, nobody);
    refused(p, ascc_mpi_particles_remove_fluid(p->set, last, &nobody), ASCC_ERROR_ARGUMENT, named,
            "an id that nobody has is told with who names it");
    refused(p, ascc_mpi_particles_remove_fluid(p->set, last, &gone), ASCC_ERROR_ARGUMENT,
            "which no", "an id that is gone");
    refused(p, ascc_mpi_particles_remove_fluid(p->set, 1, &some[total - 1]), ASCC_ERROR_ARGUMENT,
            "", "an id twice");
    refused(p, ascc_mpi_particles_remove_fluid(p->set, last, NULL), ASCC_ERROR_ARGUMENT,
            "ids: NULL", "no ids where some are wanted");
    need(ascc_mpi_particles_remove_fluid(p->set, 0, NULL), "remove", message_of(p));
    tell(same_hash(p->set, p->one), "%s: nobody names an id", p->name);
}

/* ---- Forces ---- */

/* A field of accelerations; none for rows whose id is marked. */
static double *accelerations(const ascc_particles *set, const uint8_t *without)
{
    const size_t count = ascc_particles_count(set, ASCC_FLUID);
    const size_t d = (size_t)ascc_particles_dimension(set);
    double *a = malloc((count * d + 1) * sizeof *a);
    uint64_t *id = malloc((count + 1) * sizeof *id);
    if (!a || !id)
        MPI_Abort(MPI_COMM_WORLD, 1);
    ascc_array to = {.data = a, .scalar = ASCC_DOUBLE};
    need(ascc_particles_get(set, ASCC_FLUID, ASCC_POSITION, 0, count, &to), "positions", "");
    need(ascc_particles_get_ids(set, ASCC_FLUID, 0, count, id), "ids", "");
    for (size_t i = 0; i < count; i++)
        for (size_t c = 0; c < d; c++) {
            const double x = a[i * d + c];
            a[i * d + c] = without && without[id[i]] ? 0.0 : (double)(c + 1) - 2.0 * x;
        }
    free(id);
    return a;
}

static void forces_on_some(pair *p)
{
    uint8_t *without = calloc(1, 1 << 16);
    uint64_t id[1 << 13];
    bool same = true;
    for (int n = 0; n < 4 && same; n++) {
        ascc_particles *local = ascc_mpi_particles_local(p->set);
        const size_t count = ascc_particles_count(local, ASCC_FLUID);
        need(ascc_particles_get_ids(local, ASCC_FLUID, 0, count, id), "ids", "");
        memset(without, 0, 1 << 16);
        const bool absent = rank == 0 && n % 2 == 1; /* then this one gives no acceleration */
        for (size_t i = 0; absent && i < count; i++)
            without[id[i]] = 1;
        double *own = accelerations(local, NULL), *all = accelerations(p->one, without);
        const ascc_const_array given = doubles(own), whole = doubles(all);
        const ascc_forces forces = {.size = sizeof forces, .acceleration = absent ? NULL : &given},
                          one_forces = {.size = sizeof forces, .acceleration = &whole};
        need(ascc_mpi_step_run(p->step, p->set, &forces, 2), "step", message_of(p));
        if (rank == 0)
            need(ascc_step_run(p->one_step, p->one, &one_forces, 2), "step",
                 ascc_step_message(p->one_step));
        same = same_hash(p->set, p->one);
        free(own);
        free(all);
    }
    tell(same, "%s: accelerations go with fluid that changes its process; some have none", p->name);
    free(without);
}

static void gravity_turns(pair *p)
{
    const double strength = 9.81;
    bool same = true;
    for (int c = 0; c < p->scene.dimension && same; c++)
        for (int sign = -1; sign <= 1 && same; sign += 2) {
            double gravity[3] = {0.0, 0.0, 0.0};
            gravity[c] = sign * strength;
            const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
            same = go_on(p, &forces, &forces, 1);
        }
    tell(same, "%s: gravity along every axis", p->name);
}

static void bodies_come_and_go(pair *p)
{
    const double h = p->scene.spacing;
    ascc_particles *const sets[2] = {ascc_mpi_particles_local(p->set), p->one};
    const ascc_shape shape = {
        .size = sizeof shape, .kind = ASCC_SHAPE_BOX, .half = {2.0 * h, 1.5 * h, 2.0 * h}};
    ascc_pose pose = {.size = sizeof pose,
                      .position = {6.0 * h, 9.0 * h, 4.0 * h},
                      .velocity = {0.0, -1.0, 0.0},
                      .spin = {0.0, 0.0, 3.0}};
    if (p->scene.dimension == 2)
        pose.position[2] = 0.0;
    int32_t body[2];
    char named[64];
    for (int i = 0; i < 2; i++)
        need(ascc_body_add(sets[i], &shape, &pose, &body[i]), "body",
             ascc_particles_message(sets[i]));
    bool same = go_on(p, NULL, NULL, 3);
    int64_t impulse[3], wanted[3];
    double torque[3], turned[3];
    need(ascc_mpi_particles_body_impulse(p->set, body[0], NULL, impulse, torque), "impulse", "");
    need(ascc_particles_body_impulse(p->one, body[1], NULL, wanted, turned), "impulse", "");
    bool pushed = wanted[0] || wanted[1] || wanted[2];
    same &= rank != 0 || (pushed && memcmp(impulse, wanted, sizeof wanted) == 0 &&
                          memcmp(torque, turned, sizeof turned) == 0);
    int64_t all[1][3];
    double torques[1][3], expected[1][3];
    need(ascc_mpi_bodies_impulse(p->set, 1, body, all, torques), "impulses", message_of(p));
    need(ascc_bodies_impulse(p->one, 1, body, NULL, expected), "impulses", "");
    same &= rank != 0 || (memcmp(all[0], wanted, sizeof wanted) == 0 &&
                          memcmp(torques, expected, sizeof torques) == 0);
    tell(same, "%s: a body moves in the fluid, and receives what one process gives it", p->name);
    pose.position[1] -= 1.0 * h;
    pose.spin[2] = -2.0;
    for (int i = 0; i < (rank == 0 ? 2 : 1); i++) /* elsewhere the other one has not moved */
        need(ascc_body_move(sets[i], body[i], &pose), "move", ascc_particles_message(sets[i]));
    same = go_on(p, NULL, NULL, 2);
    for (int i = 0; i < 2; i++)
        need(ascc_body_remove(sets[i], body[i]), "remove", ascc_particles_message(sets[i]));
    tell(same && go_on(p, NULL, NULL, 1), "%s: it is moved, and removed", p->name);
    body[0] = rank == processes - 1 ? 99 : p->body;
    (void)snprintf(named, sizeof named, "rank %d: ", processes - 1);
    refused(p, ascc_mpi_bodies_impulse(p->set, 1, body, all, torques), ASCC_ERROR_ARGUMENT, named,
            "a body that one process has made up");
}

/* ---- To one process and back ---- */

static void from_one_and_back(pair *p)
{
    const int root = processes - 1;
    ascc_particles *whole = make_set(p->context, &p->scene);
    need(ascc_mpi_particles_gather(p->set, rank == root ? whole : NULL, root), "gather",
         message_of(p));
    bool same = go_on(p, NULL, NULL, 2); /* away from what was gathered, and back to it */
    need(ascc_mpi_particles_scatter(p->set, rank == root ? whole : NULL, root), "scatter",
         message_of(p));
    uint64_t hash = rank == root ? ascc_particles_hash(whole) : 0, found;
    MPI_Bcast(&hash, 1, MPI_UINT64_T, root, MPI_COMM_WORLD);
    need(ascc_mpi_particles_hash(p->set, &found), "hash", "");
    same &= found == hash;
    for (int n = 0; n < 2; n++)
        need(ascc_mpi_step_run(p->step, p->set, NULL, 1), "step", message_of(p));
    tell(same && same_hash(p->set, p->one), "%s: gathered, scattered again, it goes on alike",
         p->name);
    int64_t sum[3], expected[3];
    need(ascc_mpi_particles_total_momentum(p->set, sum), "momentum", "");
    need(ascc_particles_total_momentum(p->one, expected), "momentum", "");
    tell(rank != 0 || memcmp(sum, expected, sizeof sum) == 0, "%s: momentum is that of one process",
         p->name);
    refused(p, ascc_mpi_particles_gather(p->set, NULL, 0), ASCC_ERROR_MISMATCH, "rank 0: whole",
            "nothing to gather into");
    refused(p, ascc_mpi_particles_scatter(p->set, NULL, root), ASCC_ERROR_MISMATCH, "whole",
            "nothing to scatter");
    if (processes > 1)
        refused(p, ascc_mpi_particles_gather(p->set, whole, rank), ASCC_ERROR_ARGUMENT, "root",
                "every process is root");
    ascc_particles_destroy(&whole);
}

/* ---- Bad input of one process ---- */

static void bad_input(pair *p)
{
    const bool last = rank == processes - 1;
    const size_t d = (size_t)p->scene.dimension;
    double at[3] = {p->scene.spacing, 18.0 * p->scene.spacing, p->scene.spacing};
    const ascc_const_array place = doubles(at);
    char named[64];
    at[1] = last ? NAN : at[1];
    (void)snprintf(named, sizeof named, "rank %d: position: row 0", processes - 1);
    refused(p, ascc_mpi_particles_add_fluid(p->set, 1, &place, NULL, NULL, NULL),
            ASCC_ERROR_NOT_FINITE, named, "a place that is no number");
    const double gravity[3] = {0.0, last ? -9.0 : -9.81, 0.0}, none[3] = {NAN, NAN, NAN};
    ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    if (processes > 1) {
        refused(p, ascc_mpi_step_run(p->step, p->set, &forces, 1), ASCC_ERROR_MISMATCH, "gravity",
                "gravity of their own");
        refused(p, ascc_mpi_step_run(p->step, p->set, NULL, last ? 2 : 1), ASCC_ERROR_MISMATCH,
                "count", "a count of its own");
        refused(p, ascc_mpi_step_run(last ? NULL : p->step, p->set, NULL, 1), ASCC_ERROR_ARGUMENT,
                "step", "no step");
        double *wall = calloc(d, sizeof *wall);
        const ascc_const_array point = doubles(wall);
        double normal[3] = {1.0, 0.0, 0.0};
        const ascc_const_array normals = doubles(normal);
        uint64_t id;
        ascc_particles *local = ascc_mpi_particles_local(p->set);
        if (last)
            need(ascc_particles_add_boundary(local, 1, &point, &normals, 7, &id), "wall", "");
        const ascc_status status = ascc_mpi_step_run(p->step, p->set, NULL, 1);
        if (last)
            need(ascc_particles_remove(local, 1, &id), "wall", "");
        free(wall);
        tell(status == ASCC_ERROR_MISMATCH, "%s: a wall that one process has", p->name);
    }
    forces.gravity = none;
    refused(p, ascc_mpi_step_run(p->step, p->set, &forces, 1), ASCC_ERROR_NOT_FINITE,
            "rank 0: gravity", "gravity that is no number");
    refused(p, ascc_mpi_step_run(p->step, p->set, NULL, -1), ASCC_ERROR_ARGUMENT, "rank 0: count",
            "a negative count");
    double *own = accelerations(ascc_mpi_particles_local(p->set), NULL);
    int bad = -1; /* the last process with fluid gives the bad one */
    if (ascc_particles_count(ascc_mpi_particles_local(p->set), ASCC_FLUID) > 2)
        bad = rank;
    MPI_Allreduce(MPI_IN_PLACE, &bad, 1, MPI_INT, MPI_MAX, MPI_COMM_WORLD);
    if (rank == bad)
        own[2 * d] = INFINITY;
    const ascc_const_array given = doubles(own);
    forces = (ascc_forces){.size = sizeof forces, .acceleration = &given};
    (void)snprintf(named, sizeof named, "rank %d: acceleration: row 2 component 0", bad);
    refused(p, ascc_mpi_step_run(p->step, p->set, &forces, 1), ASCC_ERROR_NOT_FINITE, named,
            "an acceleration that is no number");
    free(own);
    uint64_t hash;
    refused(p, ascc_mpi_particles_hash(p->set, last ? NULL : &hash), ASCC_ERROR_ARGUMENT, "hash",
            "no place for a hash");
    tell(go_on(p, NULL, NULL, 1), "%s: it goes on as if nothing had been", p->name);
}

/* A particle that one process has flies off. */
static void strays(pair *p)
{
    const double h = p->scene.spacing, far = 400.0 * h;
    ascc_step_options options = {.size = sizeof options, .max_displacement = 2.0 * h};
    double at[3] = {far, far, far}, speed[3] = {0.0, 1e5 * h, 0.0};
    const ascc_const_array place = doubles(at), velocity = doubles(speed);
    uint64_t id = 0, one_id;
    ascc_step *step;
    char named[64];
    need(ascc_step_create(p->context, p->model, &options, &step), "step", "");
    need(ascc_mpi_particles_add_fluid(p->set, rank == 0, &place, &velocity, NULL, &id), "add", "");
    need(ascc_particles_add_fluid(p->one, 1, &place, &velocity, NULL, &one_id), "add", "");
    MPI_Bcast(&id, 1, MPI_UINT64_T, 0, MPI_COMM_WORLD);
    (void)snprintf(named, sizeof named, "particle %" PRIu64 " ", id);
    const ascc_status status = ascc_mpi_step_run(step, p->set, NULL, 1);
    tell(strstr(message_of(p), "rank ") == message_of(p), "%s: who has the stray is named",
         p->name);
    refused(p, status, ASCC_ERROR_RANGE, named, "a particle that flies off is named");
    need(ascc_mpi_particles_remove_fluid(p->set, rank == processes - 1, &id), "remove",
         message_of(p));
    need(ascc_particles_remove(p->one, 1, &one_id), "remove", "");
    tell(go_on(p, NULL, NULL, 1), "%s: without it the others go on", p->name);
    ascc_step_destroy(&step);
}

/* ---- Time steps ---- */

/* A step cut into several; in a later one of which a particle goes too far. */
static void substeps(ascc_context *context, const char *file)
{
    pair p;
    ascc_model *model;
    ascc_model_info info = {.size = sizeof info};
    ascc_step_statistics s = {.size = sizeof s};
    need(ascc_model_load(context, file, &model), "model", file);
    need(ascc_model_get_info(model, &info), "model", file);
    ascc_model_destroy(&model);
    ascc_step_options options = {.size = sizeof options, .time_step = 3.0 * info.time_step};
    open_pair(&p, context, file, &options);
    const bool same = go_on(&p, NULL, NULL, 2);
    need(ascc_mpi_step_get_statistics(p.step, p.set, &s), "statistics", message_of(&p));
    tell(same && s.substeps > 1, "%s: a time step in %d substeps", p.name, s.substeps);

    /* Far from all others it falls freely, by g dt^2 more in each substep. */
    const double dt = options.time_step / s.substeps, h = p.scene.spacing;
    double way = 0.1 * h + 0.5 * 9.81 * dt * dt, at[3] = {0.0, -500.0 * h, 0.0};
    double speed[3] = {0.0, -0.1 * h / dt, 0.0};
    const ascc_const_array place = doubles(at), velocity = doubles(speed);
    options.max_displacement = way + 0.5 * 9.81 * dt * dt; /* between the first and the second */
    ascc_particles *empty = make_set(context, &p.scene);
    need(ascc_mpi_particles_scatter(p.set, empty, 0), "scatter", message_of(&p));
    need(ascc_particles_clear(p.one, ASCC_FLUID), "clear", "");
    need(ascc_particles_clear(p.one, ASCC_BOUNDARY), "clear", "");
    ascc_step *step, *one_step;
    need(ascc_step_create(context, p.model, &options, &step), "step", "");
    need(ascc_step_create(context, p.model, &options, &one_step), "step", "");
    const bool last = rank == processes - 1;
    need(ascc_mpi_particles_add_fluid(p.set, last, &place, &velocity, NULL, NULL), "add", "");
    need(ascc_particles_add_fluid(p.one, 1, &place, &velocity, NULL, NULL), "add", "");
    const ascc_status expected = ascc_step_run(one_step, p.one, NULL, 1);
    refused(&p, ascc_mpi_step_run(step, p.set, NULL, 1), ASCC_ERROR_RANGE, "max_displacement",
            "what goes too far in a later substep takes all of them back");
    tell(expected == ASCC_ERROR_RANGE, "%s: as one process finds", p.name);
    ascc_step_destroy(&step);
    ascc_step_destroy(&one_step);
    ascc_particles_destroy(&empty);
    close_pair(&p);
}

/* Fast fluid: a lone drop that cuts nobody's steps, and many that do. */
static void fast_fluid(pair *p)
{
    const double h = p->scene.spacing;
    ascc_step_statistics s = {.size = sizeof s}, wanted = {.size = sizeof wanted};
    bool same = true;
    int substeps[2] = {0, 0};
    for (int round = 0; round < 2; round++) {
        double at[3] = {(400.0 + rank) * h, 300.0 * h, 0.0}, speed[3] = {0.0, 900.0 * h, 0.0};
        const ascc_const_array place = doubles(at), velocity = doubles(speed);
        const bool adds = round == 1 || rank == processes - 1; /* alone; then beside others */
        need(ascc_mpi_particles_add_fluid(p->set, adds, &place, &velocity, NULL, NULL), "add", "");
        for (int r = round == 1 ? 0 : processes - 1; r < processes; r++) {
            at[0] = (400.0 + r) * h;
            need(ascc_particles_add_fluid(p->one, 1, &place, &velocity, NULL, NULL), "add", "");
        }
        same &= go_on(p, NULL, NULL, 1);
        need(ascc_mpi_step_get_statistics(p->step, p->set, &s), "statistics", message_of(p));
        need(ascc_step_get_statistics(p->one_step, &wanted), "statistics", "");
        same &= rank != 0 || s.substeps == wanted.substeps;
        substeps[round] = s.substeps;
    }
    tell(same, "%s: fast particles cut steps where they meet others, of any process (%d, %d)",
         p->name, substeps[0], substeps[1]);
}

/* A dam breaks, and each process keeps its share of the work. */
static void shares(ascc_context *context, const char *file)
{
    pair p;
    ascc_mpi_statistics s = {.size = sizeof s};
    scene_name = "dam";
    open_pair(&p, context, file, NULL);
    const bool same = go_on(&p, NULL, NULL, 70);
    need(ascc_mpi_particles_get_statistics(p.set, &s), "statistics", "");
    uint64_t most = s.own;
    MPI_Allreduce(MPI_IN_PLACE, &most, 1, MPI_UINT64_T, MPI_MAX, MPI_COMM_WORLD);
    const double uneven = (double)most * processes / (double)p.scene.count;
    /* A tenth is tolerated, and half of a block is more or less. */
    const double block = pow(8.0, p.scene.dimension) / (double)p.scene.count;
    tell(same && uneven < 1.1 + 0.5 * block * processes,
         "%s: the fluid is shared evenly still (the most: %.2f shares)", p.name, uneven);
    close_pair(&p);
}

/* Fluid that goes far before a pressure looks for neighbours once more. */
static void far_fluid(ascc_context *context, const char *file)
{
    pair p;
    ascc_mpi_statistics before = {.size = sizeof before}, after = {.size = sizeof after};
    scene_name = "drops";
    const ascc_step_options options = {.size = sizeof options, .substeps = -1};
    open_pair(&p, context, file, &options);
    need(ascc_mpi_particles_get_statistics(p.set, &before), "statistics", "");
    const double h = p.scene.spacing, still[3] = {0.0, 0.0, 0.0};
    scene crowd = {.dimension = p.scene.dimension, .spacing = h};
    for (int i = 0; i < 160; i++) { /* much too dense: it bursts */
        const double at[3] = {(12.0 + 0.31 * (i % 5)) * h, (9.0 + 0.29 * (i / 5 % 4)) * h,
                              (3.0 + 0.33 * (i / 20)) * h};
        add(&crowd, at, still, 1000.0 * pow(h, (double)p.scene.dimension));
    }
    add_part(&crowd, p.set);
    add_all(&crowd, p.one);
    const bool same = go_on(&p, NULL, NULL, 4);
    need(ascc_mpi_particles_get_statistics(p.set, &after), "statistics", "");
    const bool again = after.repeats > before.repeats, rounds = strncmp(p.name, "water3d.", 8) == 0;
    tell(same && again == (rounds && processes > 1),
         "%s: what bursts is searched again with wider ghosts", p.name);
    release(&crowd);
    close_pair(&p);
}

/* ---- Allocations that fail ---- */

typedef struct refusal {
    long at, calls;
    ascc_status worst;
    bool good;
} refusal;

/* A new fluid whose process `which` fails the n-th allocation of a few calls; whether that many were made. */
static bool fail_at(const char *file, int which, long n, bool *good)
{
    pair p;
    failing_allocator memory = {0};
    const ascc_context_options options = {.size = sizeof options,
                                          .allocate = failing_allocate,
                                          .reallocate = failing_reallocate,
                                          .release = failing_release,
                                          .user = &memory};
    ascc_context *context;
    need(ascc_context_create(&options, &context), "context", "");
    open_pair(&p, context, file, NULL);
    ascc_particles *whole = make_set(context, &p.scene);
    memory.fail_at = rank == which ? memory.calls + n : 0;
    ascc_status status = ascc_mpi_step_run(p.step, p.set, NULL, 1);
    int stage = 0;
    bool alike = true;
    uint64_t ids[2];
    need(ascc_particles_get_ids(p.one, ASCC_FLUID, 0, 2, ids), "ids", "");
    if (status != ASCC_OK)
        alike = same_hash(p.set, p.one);
    if (status == ASCC_OK && rank == 0) { /* the next is compared with it */
        const long at = memory.fail_at, calls = memory.calls;
        memory.fail_at = 0;
        need(ascc_step_run(p.one_step, p.one, NULL, 1), "step", "");
        memory.fail_at = at;
        memory.calls = calls;
    }
    double at[3] = {p.scene.spacing, 18.0 * p.scene.spacing, p.scene.spacing};
    ascc_const_array place = doubles(at);
    if (status == ASCC_OK && ++stage)
        status = ascc_mpi_particles_add_fluid(p.set, 1, &place, NULL, NULL, NULL);
    if (status == ASCC_OK && ++stage)
        status = ascc_mpi_particles_remove_fluid(p.set, rank == 0 ? 2 : 0, ids);
    if (status == ASCC_OK && ++stage)
        status = ascc_mpi_particles_gather(p.set, rank == 0 ? whole : NULL, 0);
    if (status == ASCC_OK && ++stage)
        status = ascc_mpi_particles_scatter(p.set, rank == 0 ? whole : NULL, 0);
    const long made = memory.calls;
    const bool reached = rank != which || made >= memory.fail_at;
    memory.fail_at = 0;
    int32_t low = (int32_t)status, high = (int32_t)status;
    MPI_Allreduce(MPI_IN_PLACE, &low, 1, MPI_INT32_T, MPI_MIN, MPI_COMM_WORLD);
    MPI_Allreduce(MPI_IN_PLACE, &high, 1, MPI_INT32_T, MPI_MAX, MPI_COMM_WORLD);
    alike &= low == high && (status == ASCC_OK || status == ASCC_ERROR_MEMORY);
    if (stage == 1 && status != ASCC_OK)
        alike &= same_hash(p.set, p.one);
    if (!alike)
        printf("# rank %d: allocation %ld: stage %d, status %d: %s\n", rank, n, stage, (int)status,
               message_of(&p));
    /* And then it goes on. */
    if (status != ASCC_OK && stage == 0)
        alike &= go_on(&p, NULL, NULL, 1);
    else if (status != ASCC_OK)
        need(ascc_mpi_step_run(p.step, p.set, NULL, 1), "step", message_of(&p));
    ascc_particles_destroy(&whole);
    close_pair(&p);
    ascc_context_destroy(&context);
    alike &= memory.blocks == 0;
    *good &= alike;
    int any = reached;
    MPI_Bcast(&any, 1, MPI_INT, which, MPI_COMM_WORLD);
    return any != 0;
}

static void allocations(const char *file, int which, int stride)
{
    bool good = true;
    long n = 1, tried = 0;
    const char *slash = strrchr(file, '/');
    for (; fail_at(file, which, n, &good); n += stride)
        tried++;
    tell(good && tried > 2,
         "%s: without memory on one process all have what they had, and go on (%ld of %ld)",
         slash ? slash + 1 : file, tried, n);
}

/* ---- Sets that cannot be made, or stepped ---- */

static void unlike_sets(ascc_context *context, const char *file)
{
    const bool last = rank == processes - 1;
    ascc_particles_options options = {
        .size = sizeof options, .dimension = last ? 3 : 2, .spacing = 0.05};
    ascc_mpi_particles *set;
    if (processes > 1)
        tell(ascc_mpi_particles_create(context, &options, MPI_COMM_WORLD, &set) ==
                     ASCC_ERROR_MISMATCH &&
                 !set,
             "sets of two dimensions are none");
    options.dimension = 2;
    tell(ascc_mpi_particles_create(last ? NULL : context, &options, MPI_COMM_WORLD, &set) ==
                 ASCC_ERROR_ARGUMENT &&
             !set,
         "a process without a context");
    uint32_t *words =
        (uint32_t *)(void *)context; /* of the context the second is its library's version */
    words[1] ^= last;
    tell(ascc_mpi_particles_create(context, &options, MPI_COMM_WORLD, &set) ==
                 ASCC_ERROR_MISMATCH &&
             !set,
         "a libascc of another version on one process");
    words[1] ^= last;
    scene_name = "dam";
    pair p;
    const ascc_step_options sleeps = {.size = sizeof sleeps, .sleep_speed = 0.5};
    open_pair(&p, context, file, &sleeps);
    refused(&p, ascc_mpi_step_run(p.step, p.set, NULL, 1), ASCC_ERROR_MISMATCH, "sleep",
            "fluid that would sleep");
    ascc_step_destroy(&p.step);
    need(ascc_step_create(context, p.model, NULL, &p.step), "step", "");
    words[1] ^= last;
    refused(&p, ascc_mpi_step_run(p.step, p.set, NULL, 1), ASCC_ERROR_MISMATCH, "version",
            "a step of another version");
    words[1] ^= last;
    close_pair(&p);
}

/* No fluid at all; less of it than processes. */
static void little_fluid(ascc_context *context, const char *file)
{
    pair p;
    open_pair(&p, context, file, NULL);
    ascc_particles *empty = make_set(context, &p.scene);
    need(ascc_mpi_particles_scatter(p.set, empty, 0), "scatter", message_of(&p));
    need(ascc_particles_clear(p.one, ASCC_FLUID), "clear", "");
    need(ascc_particles_clear(p.one, ASCC_BOUNDARY), "clear", "");
    bool same = go_on(&p, NULL, NULL, 1);
    const double at[3] = {0.0, 0.0, 0.0};
    const ascc_const_array place = doubles(at);
    need(ascc_mpi_particles_add_fluid(p.set, rank == 0, &place, NULL, NULL, NULL), "add", "");
    need(ascc_particles_add_fluid(p.one, 1, &place, NULL, NULL, NULL), "add", "");
    same &= go_on(&p, NULL, NULL, 2);
    tell(same, "%s: no fluid, and one particle", p.name);
    ascc_particles_destroy(&empty);
    close_pair(&p);
}

/* The host of this process rounds otherwise, and is left as it was. */
static void float_modes_of_hosts(pair *p)
{
    const size_t modes = sizeof float_modes / sizeof *float_modes;
    const float_mode *mode = &float_modes[((size_t)rank + 1) % modes];
    const double gravity[3] = {0.0, -9.81, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    float_state_set(mode->state);
    const ascc_status status = ascc_mpi_step_run(p->step, p->set, &forces, 1);
    const uint64_t left = float_state();
    float_state_set(FLOAT_DEFAULT);
    need(status, "step", message_of(p));
    if (rank == 0)
        need(ascc_step_run(p->one_step, p->one, &forces, 1), "step", "");
    tell(left == mode->state && same_hash(p->set, p->one),
         "%s: processes whose hosts round differently", p->name);
}

int main(int argc, char **argv)
{
    open_world(&argc, &argv);
    const ascc_context_options options = {.size = sizeof options,
                                          .thread_count = argc > 1 ? atoi(argv[1]) : 1};
    ascc_context *context;
    need(ascc_context_create(&options, &context), "context", "");
    for (int i = 2; i < argc; i++) {
        static void (*const facts[])(pair *) = {
            ids_are_those_of_one, removal_by_anyone, forces_on_some, gravity_turns,
            bodies_come_and_go,   from_one_and_back, bad_input,      strays,
            float_modes_of_hosts, fast_fluid};
        pair p;
        scene_name = "dam";
        open_pair(&p, context, argv[i], NULL);
        for (size_t k = 0; k < sizeof facts / sizeof *facts; k++)
            facts[k](&p);
        close_pair(&p);
        little_fluid(context, argv[i]);
        substeps(context, argv[i]);
        far_fluid(context, argv[i]);
        if (strstr(argv[i], "2d"))
            shares(context, argv[i]);
        scene_name = "dam";
        allocations(argv[i], i % 2 ? 0 : processes - 1, getenv("ASCC_TEST_LONG") ? 1 : 37);
    }
    unlike_sets(context, argv[argc - 1]);
    ascc_context_destroy(&context);
    return close_world();
}
