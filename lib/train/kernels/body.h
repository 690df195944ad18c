/* The kernels of the reverse pass, written once and compiled for each instruction set.
 * SPDX-License-Identifier: MIT */
#include "../../kernels/vector.h"
#include "../kernels.h"

/* One pair, `vectors` vectors of its row. */
#define SCATTER(name, vectors)                                                                     \
    static inline void name(const float *factor, size_t stride, size_t bumps, size_t harmonics,    \
                            const float *column, size_t a, float *to)                              \
    {                                                                                              \
        vector sum[vectors];                                                                       \
        for (size_t c = 0; c < vectors; c++)                                                       \
            sum[c] = load(to + c * LANES);                                                         \
        for (size_t b = 0; b < bumps; b++, factor += harmonics * stride, column += harmonics * a) { \
            if (factor[0] == 0.0f)                                                                 \
                continue;                                                                          \
            for (size_t h = 0; h < harmonics; h++) {                                               \
                const vector w = fill(factor[h * stride]);                                         \
                for (size_t c = 0; c < vectors; c++)                                               \
                    sum[c] = fused(w, load(column + h * a + c * LANES), sum[c]);                   \
            }                                                                                      \
        }                                                                                          \
        for (size_t c = 0; c < vectors; c++)                                                       \
            store(to + c * LANES, sum[c]);                                                         \
    }
SCATTER(scatter_1, 1)
SCATTER(scatter_2, 2)
SCATTER(scatter_4, 4)

static void scatter(const float *factor, size_t stride, size_t bumps, size_t harmonics,
                    const uint32_t *neighbor, size_t k, const float *column, size_t a,
                    float *gradient)
{
    for (size_t i = 0; i < k; i++) {
        float *to = gradient + (size_t)neighbor[i] * a;
        size_t c = 0;
        for (; c + 4 * LANES <= a; c += 4 * LANES)
            scatter_4(factor + i, stride, bumps, harmonics, column + c, a, to + c);
        for (; c + 2 * LANES <= a; c += 2 * LANES)
            scatter_2(factor + i, stride, bumps, harmonics, column + c, a, to + c);
        if (c < a)
            scatter_1(factor + i, stride, bumps, harmonics, column + c, a, to + c);
    }
}

static void dot(const float *column, size_t members, const uint32_t *neighbor, size_t k,
                const float *feature, size_t a, float *out, size_t stride)
{
    for (size_t i = 0; i < k; i++) {
        const float *f = feature + (size_t)neighbor[i] * a;
        for (size_t m = 0; m < members; m++) {
            vector sum = fill(0.0f);
            for (size_t c = 0; c < a; c += LANES)
                sum = fused(load(column + m * a + c), load(f + c), sum);
            out[m * stride + i] = total(sum);
        }
    }
}

void ASCC_TRAIN_VARIANT(ascc_train_kernels *kernels)
{
    kernels->scatter = scatter;
    kernels->dot = dot;
}
