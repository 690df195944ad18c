/* The particles of one instant, as the writers of point clouds take them. SPDX-License-Identifier: MIT */
#ifndef ASCC_CLOUD_H
#define ASCC_CLOUD_H

#include <stddef.h>
#include <stdint.h>

typedef struct ascc_cloud {
    int32_t dimension;
    size_t count;
    double time;           /* s */
    const float *position; /* [count][dimension], m */
    const float *velocity; /* [count][dimension], m/s */
    const uint64_t *id;    /* [count] */
} ascc_cloud;

/* Component c of row i; in 2D the third is 0. */
static inline float ascc_cloud_at(const ascc_cloud *cloud, const float *values, size_t i, size_t c)
{
    const size_t d = (size_t)cloud->dimension;
    return c < d ? values[i * d + c] : 0.0f;
}

#endif
