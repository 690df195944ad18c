/* A sequence as frames for other programs. SPDX-License-Identifier: MIT */
#include "export.h"

#include <stdio.h>
#include <stdlib.h>

#include "console.h"
#include "progress.h"

static bool write_frames(const ascc_sequence *s, ascc_frames *frames, char *error, size_t capacity)
{
    const size_t n = s->count * (size_t)s->dimension;
    float *velocity = malloc((n + 1) * sizeof *velocity);
    uint64_t *id = malloc((s->count + 1) * sizeof *id);
    bool good = velocity && id;
    if (!good)
        (void)snprintf(error, capacity, "no memory for %zu particles", s->count);
    for (size_t i = 0; good && i < s->count; i++)
        id[i] = i + 1; /* as a run numbers them */
    ascc_progress progress;
    ascc_progress_start(&progress, "writing", (s->frames + frames->every - 1) / frames->every);
    for (size_t f = 0; good && f < s->frames; f += frames->every) {
        ascc_sequence_velocities(s, f, velocity);
        ascc_cloud cloud = {.dimension = s->dimension,
                            .count = s->count,
                            .position = s->position + f * n,
                            .velocity = velocity,
                            .id = id};
        good = ascc_frames_add(frames, &cloud, error, capacity);
        ascc_progress_add(&progress, 1);
    }
    ascc_progress_end(&progress);
    free(velocity);
    free(id);
    return good;
}

int ascc_export(const char *sequence, ascc_frames *frames)
{
    ascc_sequence s;
    char error[768];
    bool good = ascc_sequence_read(sequence, &s, error, sizeof error);
    if (good) {
        frames->time_step = s.time_step;
        good = ascc_frames_open(frames, &s, error, sizeof error) &&
               write_frames(&s, frames, error, sizeof error) &&
               ascc_frames_close(frames, error, sizeof error);
        ascc_sequence_free(&s);
    }
    if (!good)
        ascc_line(stderr, "ascc convert: %s", error);
    else
        ascc_line(stdout, "%s: %zu frames", sequence, frames->written);
    return good ? 0 : 1;
}
