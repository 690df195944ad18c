/* Reading sequences for a trainer. SPDX-License-Identifier: MIT */
#include "training_sequence.h"

#include "evaluate.h"
#include "system.h"

bool ascc_training_sequence_read(const char *path, size_t every, ascc_sequence *s,
                                 ascc_training_sequence *given, char *error, size_t size)
{
    if (!ascc_sequence_read(path, s, error, size))
        return false;
    const size_t d = (size_t)s->dimension, walls = s->walls * d * sizeof *s->wall;
    const size_t frames =
        ascc_thin_frames(s->position, s->count * d * sizeof *s->position, s->frames, every);
    if (s->walls_move) {
        (void)ascc_thin_frames(s->wall, walls, s->frames, every);
        (void)ascc_thin_frames(s->normal, walls, s->frames, every);
    }
    *given = (ascc_training_sequence){.size = sizeof *given,
                                      .name = ascc_system_name(path),
                                      .frame_count = frames,
                                      .fluid_count = s->count,
                                      .boundary_count = s->walls,
                                      .position = s->position,
                                      .boundary_position = s->wall,
                                      .boundary_normal = s->normal,
                                      .time_step = s->time_step * (double)every,
                                      .gravity = {s->gravity[0], s->gravity[1], s->gravity[2]},
                                      .spacing = 2.0 * s->radius,
                                      .boundary_moves = s->walls_move,
                                      .dimension = s->dimension};
    return true;
}
