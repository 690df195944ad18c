/* From the host's axes to those a step computes in, and back, as turn.h draws them. SPDX-License-Identifier: MIT */
#include "turn.h"

#include <math.h>

/* The axis that a vector is most along; -1: it is 0. */
static int32_t main_axis(const double vector[3], int32_t dimension)
{
    int32_t axis = -1;
    for (int32_t c = 0; c < dimension; c++)
        if (fabs(vector[c]) > (axis < 0 ? 0.0 : fabs(vector[axis])))
            axis = c;
    return axis;
}

ascc_turn ascc_turn_find(const ascc_plan *plan, const double gravity[3])
{
    const ascc_turn none = {0, 0, false};
    const int32_t d = plan->dimension;
    const int32_t own = main_axis(plan->gravity, d), now = main_axis(gravity, d);
    if (own < 0 || now < 0)
        return none;
    for (int32_t c = 0; c < d; c++)
        if (c != own && plan->gravity[c] != 0.0)
            return none;
    return (ascc_turn){.shift = (now - own + d) % d,
                       .axis = own,
                       .flip = (plan->gravity[own] < 0.0) != (gravity[now] < 0.0)};
}

#define TURN_ROWS(type)                                                                            \
    const size_t d = (size_t)dimension, shift = (size_t)turn->shift;                               \
    for (size_t i = 0; i < count; i++, rows += d) {                                                \
        type row[3] = {0, 0, 0};                                                                   \
        for (size_t c = 0; c < d; c++) {                                                           \
            const size_t host = (c + shift) % d, from = back ? c : host, to = back ? host : c;     \
            row[to] = turn->flip && c == (size_t)turn->axis ? -rows[from] : rows[from];            \
        }                                                                                          \
        for (size_t c = 0; c < d; c++)                                                             \
            rows[c] = row[c];                                                                      \
    }

void ascc_turn_reals(const ascc_turn *turn, bool back, double *rows, size_t count,
                     int32_t dimension)
{
    TURN_ROWS(double)
}

void ascc_turn_integers(const ascc_turn *turn, bool back, int64_t *rows, size_t count,
                        int32_t dimension)
{
    TURN_ROWS(int64_t)
}

void ascc_turn_particles(const ascc_turn *turn, bool back, ascc_particles *particles)
{
    const int32_t d = particles->dimension;
    for (size_t f = 0; f < ASCC_FIELD_COUNT; f++) {
        const ascc_particle_field *field = &ascc_particle_fields[f];
        const size_t count =
            field->kind == ASCC_FLUID ? particles->fluid_count : particles->boundary_count;
        void *rows = ascc_field_rows(particles, field);
        const size_t vectors =
            count * (size_t)ascc_field_numbers(field, d, particles->past_count) / (size_t)d;
        if (field->width == ASCC_WIDTH_SCALAR || !vectors)
            continue;
        if (field->element == ASCC_REAL)
            ascc_turn_reals(turn, back, rows, vectors, d);
        else
            ascc_turn_integers(turn, back, rows, vectors, d);
    }
}
