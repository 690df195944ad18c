/* The step handle, and one step as the trainer runs it. SPDX-License-Identifier: MIT */
#ifndef ASCC_STEP_H
#define ASCC_STEP_H

#include "engine.h"
#include "model/model.h"
#include "turn.h"

struct ascc_step {
    uint32_t magic;
    int32_t most_substeps;                /* of a time step; 0 = as many as it takes, -1 = one */
    ascc_context *context;                /* retained */
    ascc_model *model;                    /* retained */
    double time_step;                     /* the host's, s */
    double length_unit, max_displacement; /* m; the host's, 0 = by spacings */
    double sleep_speed;
    double model_length, model_time; /* the model's m and s in the host's unit and second */
    ascc_network network;
    size_t *expected;      /* [key_count of the network] neighbours of the last step */
    size_t expected_pairs; /* that its relaxation kept */
    ascc_engine engine;
    ascc_arena arena;
    ascc_wall_volumes walls;
    ascc_memory memory;   /* of what it saw */
    double *acceleration; /* the host's, [fluid][dimension] */
    size_t acceleration_capacity;
    unsigned char *kept; /* the state before the first of several substeps */
    size_t kept_capacity;
    ascc_turn turn;  /* of the run under way; none for a trainer's steps */
    ascc_halo *halo; /* of the run under way: fluid of other processes; NULL = there is none */
    struct ascc_step *detail; /* of the run under way: whose network has a share; NULL = none */
    bool measures;            /* how far its input is from training's */
    bool looks;               /* the next run sees and moves nothing */
    bool continues;           /* the next run adds to impulses of walls that another step's began */
    ascc_step_statistics statistics;
    ascc_message message;
};

/* What a step of a handle begins with, with its own arena; what only some steps have is left empty. */
ascc_step_state ascc_step_open(ascc_step *step, const ascc_particles *p, const ascc_motion *motion);

/* One step of a particle set that suits the model, with an arena that is reset first. On failure the
 * particles stay as they were. first: of a run, whose sums begin with it. */
ascc_status ascc_step_once(ascc_step *step, ascc_particles *p, const ascc_motion *motion,
                           bool first, ascc_arena *arena, ascc_step_state *state);

/* Sees the set as the next step would, and moves nothing: the statistics' distances are of it, all else in them
 * stays. errors: as ascc_step_run. */
ascc_status ascc_step_look(ascc_step *step, ascc_particles *particles, const ascc_forces *forces);

#endif
