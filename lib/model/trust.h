/* What a model's first layer made of the states it was trained on, and how far another row is from that.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TRUST_H
#define ASCC_TRUST_H

#include "file/safetensors.h"
#include "plan.h"

#define ASCC_TRUST_CHANNELS 64 /* at most */

/* distance of x = |F (x - mean)| / sqrt(channels), F below its diagonal and on it; 1 in the mean of training. */
typedef struct ascc_trust {
    int32_t layer; /* on the fluid; -1 = nothing is known */
    int32_t channels;
    double threshold; /* of a mean distance, where errors double; 0 = not stated */
    float mean[ASCC_TRUST_CHANNELS];
    float column[ASCC_TRUST_CHANNELS][ASCC_TRUST_CHANNELS]; /* of F, over sqrt(channels) */
} ascc_trust;

/* The first layer on the fluid with weights, -1 = none of as many channels at most. */
int32_t ascc_trust_layer(const ascc_plan *plan);

/* Of the bytes of all tensors: statistics of other weights say nothing. */
uint64_t ascc_trust_sum(const unsigned char *bytes, size_t count);

/* From the text `trust` of a file's metadata, NULL = none. errors: FORMAT, MEMORY. */
ascc_status ascc_trust_read(const ascc_allocator *allocator, const char *text, uint64_t sum,
                            const ascc_plan *plan, ascc_trust *trust, ascc_message *message);

#endif
