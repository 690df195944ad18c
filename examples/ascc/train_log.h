/* The log of a training run: a CSV row an iteration, and a chart of it. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_LOG_H
#define ASCC_TRAIN_LOG_H

#include <stdbool.h>
#include <stdio.h>

#include <ascc/train.h>

/* What a model does on the valid sequences; NaN where nothing was measured. */
typedef struct ascc_validation {
    bool measured;
    double error[2];      /* after one and two frames, m: means over sequences */
    double last_frame;    /* that all rollouts reached */
    double escaped;       /* most particles outside at once, plus those not finite */
    double density_error; /* largest over rollouts of the mean error of the maximum */
    bool stable;          /* all rollouts got to their ends without a loss of particles */
} ascc_validation;

/* A stable model before one that is not, then the smaller error after two frames. */
bool ascc_validation_better(const ascc_validation *a, const ascc_validation *b);

typedef struct ascc_train_log {
    FILE *file;
    double seconds;             /* of training in all, CPU time of all threads */
    ascc_validation last, best; /* among the rows written */
} ascc_train_log;

/* Opens the log to go on behind iteration `iteration`: rows beyond are dropped, the others read for what
 * the struct holds. False with a line in error. */
bool ascc_train_log_open(const char *path, uint64_t iteration, ascc_train_log *log, char *error,
                         size_t capacity);
/* One row; seconds: that the iteration took. False when it cannot be written (errno tells). */
bool ascc_train_log_add(ascc_train_log *log, int32_t stage, const ascc_training_report *report,
                        double seconds, const ascc_validation *validation);
void ascc_train_log_close(ascc_train_log *log);

/* Draws the log's loss and errors with gnuplot; false when that is not installed or fails. */
bool ascc_train_log_chart(const char *log, const char *chart, bool validated);

#endif
