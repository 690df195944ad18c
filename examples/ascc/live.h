/* What `ascc view` shows: a model that runs, or a sequence that is played; stopped, restarted, and stirred
 * with a ball. SPDX-License-Identifier: MIT
 *
 * Calls that can fail return false with one line in live->error; what is shown is then as it was. */
#ifndef ASCC_LIVE_H
#define ASCC_LIVE_H

#include <ascc/ascc.h>

#include "drawing.h"
#include "sequence.h"

enum { ASCC_LIVE_MODELS = 16 };

typedef struct ascc_live_options {
    const char *model[ASCC_LIVE_MODELS];
    size_t models;     /* 0: the scene is a sequence, and is played */
    const char *scene; /* as ascc_scene_load takes it */
    int32_t size, threads;
    double spacing; /* m, of a built-in scene; 0 = the first model's */
    double ball;    /* radius, m; 0 = four spacings, less in a narrow box */
} ascc_live_options;

/* A ball of wall points in the fluid, a disc in 2D. */
typedef struct ascc_live_ball {
    bool there;
    double radius, center[3], target[3]; /* m */
    size_t count;
    float *around, *normal; /* [count][dimension], from the center */
    float *position;        /* [count][dimension] */
} ascc_live_ball;

typedef struct ascc_live {
    ascc_live_options options;
    ascc_sequence scene;
    ascc_view view;
    /* What is shown now. */
    size_t count, step;
    double time;                /* s */
    float *position, *velocity; /* [count][dimension] */
    float *value;               /* [count]: speed, or density over rest density */
    bool density;               /* which of the two */
    ascc_live_ball ball;
    ascc_stage_time stage[ASCC_MAX_STAGES + 1]; /* of a step, smoothed; the last is "total" */
    size_t stages;
    size_t model; /* in options.model */
    char error[512];
    /* The run. */
    ascc_context *context;
    ascc_model *loaded[ASCC_LIVE_MODELS];
    ascc_step *stepper[ASCC_LIVE_MODELS];
    double time_step[ASCC_LIVE_MODELS];
    ascc_particles *particles;
} ascc_live;

/* ascc_live_close frees either way. */
bool ascc_live_open(ascc_live *live, const ascc_live_options *options);
void ascc_live_close(ascc_live *live);

/* A step, or the next frame; false also where a sequence has ended, then without an error. */
bool ascc_live_advance(ascc_live *live);
/* The frame before, of a sequence. */
bool ascc_live_back(ascc_live *live);
bool ascc_live_restart(ascc_live *live);
/* The next model goes on from here. */
bool ascc_live_switch(ascc_live *live);
/* Puts the ball where there is most room, or takes it away. */
bool ascc_live_toggle_ball(ascc_live *live);
/* Where the ball is wanted: it goes there at up to a quarter of a spacing a step, and never through the box. */
void ascc_live_pull(ascc_live *live, const double target[3]);
/* Colours tell density in place of speed, or speed again. */
bool ascc_live_toggle_density(ascc_live *live);

/* What to draw now. */
ascc_marks ascc_live_marks(const ascc_live *live);

#endif
