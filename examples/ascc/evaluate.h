/* Measuring a method on a sequence: what `ascc eval` and the charts have in common.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_EVALUATE_H
#define ASCC_EVALUATE_H

#include "method.h"
#include "report.h"

/** The method that a word means, and the settings in it; NULL if there is none. */
const ascc_method *ascc_method_find(const char *word, const char **settings);

/** A sequence in double, and the scene that a method sees. */
typedef struct ascc_truth {
    ascc_method_scene scene;
    size_t frames, velocity_frames;
    double *position, *velocity; /* [frames], [velocity_frames][fluid_count][dimension] */
    double *wall, *normal;
} ascc_truth;

/** Reads a sequence; `threads` is what methods and measures may use. */
bool ascc_truth_load(const char *path, int32_t threads, ascc_truth *truth,
                     ascc_method_error *error);
void ascc_truth_free(ascc_truth *truth);
/** Moves every k-th of `frames` rows of so many bytes to the front; returns how many those are. */
size_t ascc_thin_frames(void *rows, size_t row_size, size_t frames, size_t every);
/** Keeps every k-th frame, from the first: k times as long between frames. */
void ascc_truth_thin(ascc_truth *truth, size_t every);

/** What to measure; zero, but velocity = -1, is everything but transport, as docs/measures.md says. */
typedef struct ascc_evaluate_options {
    bool has_frames; /* start frames first, first + step, ... below end (< 0: the last) */
    bool transport;  /* earth mover's distances of the last frame, exact and Sinkhorn's */
    bool emd;        /* the exact one alone */
    bool no_rollout;
    long first, end, step;
    int velocity; /* an ascc_velocity_kind; -1 = both, as far as stored */
} ascc_evaluate_options;

/**
 * Runs and measures; run->sequence is set, figures are added. False only if the method cannot be opened
 * or there is no memory: a method that stops on the way is a result, and run->note says why.
 */
bool ascc_evaluate(const ascc_evaluate_options *options, const ascc_method *method,
                   const char *settings, const ascc_truth *truth, ascc_report_run *run,
                   ascc_method_error *error);

#endif
