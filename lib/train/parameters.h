/* What is trained: the tensors of a file, one after another. SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_PARAMETERS_H
#define ASCC_TRAIN_PARAMETERS_H

#include "base/common.h"

/* Where a tensor of the file lies among the model's weights. */
typedef struct ascc_trained_tensor {
    size_t first, count; /* parameters */
    size_t offset;       /* in the model's weights */
    bool damps;          /* must not become negative */
} ascc_trained_tensor;

#endif
