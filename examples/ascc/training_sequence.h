/* A sequence file as what a trainer learns from. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAINING_SEQUENCE_H
#define ASCC_TRAINING_SEQUENCE_H

#include <stdbool.h>

#include <ascc/train.h>

#include "sequence.h"

/* Each `every`-th frame of a file; `given` points into s, which is the caller's to free, and at path. False with a line in
 * error, and nothing to free. */
bool ascc_training_sequence_read(const char *path, size_t every, ascc_sequence *s,
                                 ascc_training_sequence *given, char *error, size_t size);

#endif
