/* A model as a handle: its file, its plan, its weights. SPDX-License-Identifier: MIT */
#ifndef ASCC_MODEL_H
#define ASCC_MODEL_H

#include "packed.h"
#include "trust.h"

struct ascc_model {
    uint32_t magic;
    ascc_context *context;            /* retained */
    struct ascc_model_shared *shared; /* reference count */
    unsigned char *bytes;             /* the file as it was read */
    size_t byte_count;
    float *weights; /* all tensors, arranged and aligned; the plan points into it */
    size_t weight_count;
    ascc_plan plan;
    ascc_packed packed;
    ascc_trust trust;
};

void ascc_model_retain(ascc_model *model);
void ascc_model_release(ascc_model *model);

#endif
