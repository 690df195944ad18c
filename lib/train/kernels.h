/* Kernels of the reverse pass beside those of the run-time; same bits from every variant.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_TRAIN_KERNELS_H
#define ASCC_TRAIN_KERNELS_H

#include <stddef.h>
#include <stdint.h>

typedef struct ascc_train_kernels {
    /* gradient[neighbor[i]][a] += sum over members m of factor[m * stride + i] * column[m][a], pairs in
     * order; members come in bumps of so many harmonics, and a bump whose first factor is 0 is left
     * out. */
    void (*scatter)(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                    const uint32_t *neighbor, size_t k, const float *column, size_t a,
                    float *gradient);

    /* dot[m * stride + i] = sum over a of column[m][a] * feature[neighbor[i]][a]. */
    void (*dot)(const float *column, size_t members, const uint32_t *neighbor, size_t k,
                const float *feature, size_t a, float *dot, size_t stride);
} ascc_train_kernels;

/* Fills the table with the best variant among the bits of cpu (ASCC_CPU_*). */
void ascc_train_kernels_select(ascc_train_kernels *kernels, uint32_t cpu);
void ascc_train_kernels_portable(ascc_train_kernels *kernels);
void ascc_train_kernels_avx2(ascc_train_kernels *kernels);

#endif
