/* How far what a step sees is from what the model was trained on (docs/trust.md).
 * SPDX-License-Identifier: MIT
 *
 * The first layer with weights takes from each particle's surroundings the numbers that all others work with; their
 * distance from those of training states is a product with one small triangular matrix.
 */
#include <math.h>

#include "base/sort.h"
#include "model/trust.h"
#include "stage.h"

typedef struct trust_part {
    double sum;
    float worst;
    size_t count, row;
} trust_part;

typedef struct trust_job {
    const ascc_trust *trust;
    const ascc_value *value;
    const ascc_hierarchy *hierarchy;
    size_t own;          /* host rows of this process; those behind are ghosts */
    size_t stride, size; /* of a row; of a part */
    trust_part part[ASCC_SORT_PARTS];
} trust_job;

/* y[padded] = F (x - mean). */
static void whiten(const ascc_trust *trust, const float *restrict x, size_t padded,
                   float *restrict y)
{
    for (size_t i = 0; i < padded; i++)
        y[i] = 0.0f;
    for (size_t j = 0; j < (size_t)trust->channels; j++) {
        const float *restrict column = trust->column[j], d = x[j] - trust->mean[j];
        for (size_t i = j & ~(size_t)7; i < padded; i++)
            y[i] += column[i] * d;
    }
}

static float distance_of(const ascc_trust *trust, const float *x, size_t padded)
{
    float y[ASCC_TRUST_CHANNELS], sum[8] = {0.0f};
    whiten(trust, x, padded, y);
    for (size_t i = 0; i < padded; i += 8)
        for (size_t n = 0; n < 8; n++)
            sum[n] += y[i + n] * y[i + n];
    const float square =
        ((sum[0] + sum[4]) + (sum[2] + sum[6])) + ((sum[1] + sum[5]) + (sum[3] + sum[7]));
    return isnan(square) ? INFINITY : sqrtf(square);
}

static void measure_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    trust_job *job = data;
    trust_part part = {.worst = -1.0f};
    for (size_t i = begin; i < end; i++) {
        if (!job->value->active[i] ||
            ascc_hierarchy_host_row(job->hierarchy, ASCC_SET_FLUID, i) >= job->own)
            continue;
        const float distance =
            distance_of(job->trust, job->value->raw + i * job->stride, job->stride);
        part.sum += (double)distance;
        part.count++;
        if (distance > part.worst) {
            part.worst = distance;
            part.row = i;
        }
    }
    job->part[begin / job->size] = part;
}

void ascc_measure_trust(ascc_step_state *state)
{
    const ascc_network_run *run = &state->run;
    const ascc_trust *trust = state->trust;
    const size_t rows = run->hierarchy->set[ASCC_SET_FLUID].count;
    ascc_step_statistics *s = state->statistics;
    if (!trust)
        return;
    trust_job job = {.trust = trust,
                     .value = &run->value[trust->layer + 2],
                     .hierarchy = run->hierarchy,
                     .own = state->halo ? state->halo->own : SIZE_MAX,
                     .stride = ascc_padded(trust->channels),
                     .size = ascc_part_size(rows)};
    ascc_workers_run(state->tools.workers, rows, job.size, measure_part, &job);
    trust_part all = {.worst = -1.0f};
    for (int p = 0; p < ASCC_SORT_PARTS; p++) {
        const trust_part *part = &job.part[p];
        all.sum += part->sum;
        all.count += part->count;
        if (part->count && part->worst > all.worst) {
            all.worst = part->worst;
            all.row = part->row;
        }
    }
    s->distance_count = all.count;
    s->distance_mean = all.count ? all.sum / (double)all.count : 0.0;
    s->distance_worst = all.count ? (double)all.worst : 0.0;
    s->distance_row =
        all.count ? ascc_hierarchy_host_row(run->hierarchy, ASCC_SET_FLUID, all.row) : 0;
    ascc_stage_lap(state, "trust");
}
