/* The config file of `ascc train` (docs/training.md), read once and strictly. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_CONFIG_H
#define ASCC_TRAIN_CONFIG_H

#include <ascc/train.h>
#include <stdbool.h>

enum { ASCC_TRAIN_PATH = 4096, ASCC_TRAIN_STAGES = 64, ASCC_TRAIN_SOURCES = 4096 };

/* A sequence to read: every so many of its frames. */
typedef struct ascc_train_source {
    char *path;
    double share;
    int32_t every;
    int32_t warm_up; /* at most; 0 = the stage's */
    double jitter;   /* up to; 0 = the config's */
} ascc_train_source;

typedef struct ascc_train_sources {
    ascc_train_source *source;
    size_t count;
} ascc_train_sources;

typedef struct ascc_train_config {
    char *network; /* its description, to begin with random weights; NULL = none */
    uint64_t network_seed;
    char model[ASCC_TRAIN_PATH]; /* a file in place of it, or with it for the weights; or "" */
    ascc_train_sources train, valid;
    ascc_training_stage stage[ASCC_TRAIN_STAGES];
    ascc_trainer_options options; /* `stage` points to the above */
    char output[ASCC_TRAIN_PATH]; /* the model: the best one, or without `valid` the latest */
    char latest[ASCC_TRAIN_PATH]; /* the latest model; = output without `valid` */
    char log[ASCC_TRAIN_PATH], chart[ASCC_TRAIN_PATH], checkpoint[ASCC_TRAIN_PATH];
    double checkpoint_seconds;
    uint64_t validate_every; /* iterations */
    int32_t validate_frames; /* of a rollout */
    int32_t
        validate_starts; /* each so many frames of a valid sequence, one- and two-frame errors start */
    int32_t validate_rollouts; /* so many of the valid sequences are rolled out */
} ascc_train_config;

/* Relative paths are relative to the file's folder. False with one line in error. `config` is freed by
 * ascc_train_config_free either way. */
bool ascc_train_config_read(const char *path, ascc_train_config *config, char *error,
                            size_t capacity);
void ascc_train_config_free(ascc_train_config *config);

#endif
