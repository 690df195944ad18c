/* Momenta of particles as whole quanta: made from velocities, and summed exactly.
 * SPDX-License-Identifier: MIT */
#include <string.h>

#include "particles.h"

/* ---- Velocities ------------------------------------------------------------------------------ */

/* Dividing by a power of two and rounding to integer are exact but for the one rounding meant. */
bool ascc_to_quanta(double momentum, double quantum, int64_t *quanta)
{
    const double units = rint(momentum / quantum);
    if (!(fabs(units) <= (double)ASCC_MOMENTUM_LIMIT))
        return false;
    *quanta = (int64_t)units;
    return true;
}

ascc_status ascc_velocity_check(const ascc_particles *particles, const ascc_host_array *from,
                                const ascc_host_array *mass, size_t count, ascc_message *message)
{
    for (size_t row = 0; row < count; row++) {
        for (int32_t c = 0; c < particles->dimension; c++) {
            const double value = ascc_host_array_read(from, row, c);
            int64_t quanta;
            if (!isfinite(value))
                return ascc_fail_number(message, ASCC_ERROR_NOT_FINITE, from->name, row, c, value,
                                        "");
            if (!ascc_to_quanta(value * ascc_host_array_read(mass, row, 0), particles->quantum,
                                &quanta))
                return ascc_fail_number(message, ASCC_ERROR_RANGE, from->name, row, c, value,
                                        ", beyond 2^61 quanta of momentum");
        }
    }
    return ASCC_OK;
}

void ascc_velocity_store(ascc_particles *particles, const ascc_host_array *from, size_t first,
                         size_t count)
{
    const size_t d = ascc_particles_width(particles);
    int64_t *const momentum = particles->momentum + first * d;
    for (size_t row = 0; row < count; row++)
        for (int32_t c = 0; c < particles->dimension; c++)
            (void)ascc_to_quanta(ascc_host_array_read(from, row, c) * particles->mass[first + row],
                                 particles->quantum, &momentum[row * d + (size_t)c]);
}

/* ---- Masses ---------------------------------------------------------------------------------- */

/* Momentum of a fluid row at its velocity with another mass. */
static bool with_mass(const ascc_particles *particles, size_t row, int32_t c, double mass,
                      int64_t *quanta)
{
    *quanta = particles->momentum[row * ascc_particles_width(particles) + (size_t)c];
    return mass == particles->mass[row] ||
           ascc_to_quanta(ascc_velocity(particles, row, c) * mass, particles->quantum, quanta);
}

ascc_status ascc_new_mass_check(const ascc_particles *particles, const ascc_host_array *from,
                                size_t first, size_t count, ascc_message *message)
{
    const ascc_status status = ascc_field_check(particles, ASCC_FIELD_mass, from, count, message);
    if (status != ASCC_OK)
        return status;
    for (size_t row = 0; row < count; row++) {
        const double mass = ascc_host_array_read(from, row, 0);
        for (int32_t c = 0; c < particles->dimension; c++) {
            int64_t quanta;
            if (!with_mass(particles, first + row, c, mass, &quanta))
                return ascc_fail(message, ASCC_ERROR_RANGE,
                                 "%s: row %zu is %g, its momentum would be beyond 2^61 quanta",
                                 from->name, row, mass);
        }
    }
    return ASCC_OK;
}

void ascc_new_mass_store(ascc_particles *particles, const ascc_host_array *from, size_t first,
                         size_t count)
{
    for (size_t row = first; row < first + count; row++) {
        const double mass = ascc_host_array_read(from, row - first, 0);
        for (int32_t c = 0; c < particles->dimension; c++) {
            int64_t quanta;
            (void)with_mass(particles, row, c, mass, &quanta);
            particles->momentum[row * ascc_particles_width(particles) + (size_t)c] = quanta;
        }
        particles->mass[row] = mass;
    }
}

/* ---- Sums ------------------------------------------------------------------------------------ */

/* A sum of 64-bit integers in 128 bits, two's complement, exact for any number of rows. Only the end
 * has to fit 64 bits, so that the order of the rows does not matter. */
typedef struct wide_sum {
    int64_t high;
    uint64_t low;
} wide_sum;

static void add_wide(wide_sum *sum, int64_t value)
{
    const uint64_t low = sum->low + (uint64_t)value;
    sum->high += (low < sum->low) - (value < 0);
    sum->low = low;
}

static bool narrow(const wide_sum *sum, int64_t *value)
{
    *value = (int64_t)sum->low;
    return sum->high == (*value < 0 ? -1 : 0);
}

/* All three, or none. */
static bool narrow_all(const wide_sum sum[3], int64_t values[3])
{
    int64_t narrowed[3];
    for (int c = 0; c < 3; c++)
        if (!narrow(&sum[c], &narrowed[c]))
            return false;
    memcpy(values, narrowed, sizeof narrowed);
    return true;
}

ascc_status ascc_particles_total_momentum(const ascc_particles *particles, int64_t total[3])
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (total == NULL)
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT, "total: NULL");
    const size_t d = ascc_particles_width(particles);
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    for (size_t row = 0; row < particles->fluid_count; row++)
        for (size_t c = 0; c < d; c++)
            add_wide(&sum[c], particles->momentum[row * d + c]);
    if (!narrow_all(sum, total))
        return ascc_particles_fail_reading(particles, ASCC_ERROR_RANGE,
                                           "total: the momentum does not fit 64 bits");
    return ASCC_OK;
}

bool ascc_wall_impulse_sum(const ascc_particles *particles, size_t first, size_t count,
                           int64_t impulse[3])
{
    const size_t d = ascc_particles_width(particles);
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    for (size_t row = first; row < first + count; row++)
        for (size_t c = 0; c < d; c++)
            add_wide(&sum[c], particles->wall_impulse[row * d + c]);
    return narrow_all(sum, impulse);
}

/* torque += (x - point) cross the impulse of a boundary row. */
static void add_torque(const ascc_particles *particles, size_t row, const double point[3],
                       double torque[3])
{
    const size_t d = ascc_particles_width(particles);
    double arm[3] = {0}, impulse[3] = {0};
    for (size_t c = 0; c < d; c++) {
        arm[c] = particles->wall_position[row * d + c] - point[c];
        impulse[c] = (double)particles->wall_impulse[row * d + c] * particles->quantum;
    }
    torque[0] += arm[1] * impulse[2] - arm[2] * impulse[1];
    torque[1] += arm[2] * impulse[0] - arm[0] * impulse[2];
    torque[2] += arm[0] * impulse[1] - arm[1] * impulse[0];
}

static ascc_status check_body_and_point(const ascc_particles *particles, int32_t body,
                                        const double point[3])
{
    if (body < -1)
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                           "body: %ld is neither a body nor -1", (long)body);
    for (size_t c = 0; c < ascc_particles_width(particles); c++)
        if (!isfinite(point[c]))
            return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                               "point: component %zu is %g", c,
                                               ascc_readable(point[c]));
    return ASCC_OK;
}

ascc_status ascc_particles_body_impulse(const ascc_particles *particles, int32_t body,
                                        const double point[3], int64_t impulse[3], double torque[3])
{
    ASCC_FLOAT_SCOPE;
    static const double origin[3] = {0};
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (point == NULL)
        point = origin;
    const ascc_status status = check_body_and_point(particles, body, point);
    if (status != ASCC_OK)
        return status;

    const size_t d = ascc_particles_width(particles);
    wide_sum sum[3] = {{0, 0}, {0, 0}, {0, 0}};
    double turn[3] = {0};
    for (size_t row = 0; row < particles->boundary_count; row++) {
        if (body != -1 && particles->wall_body[row] != body)
            continue;
        for (size_t c = 0; c < d; c++)
            add_wide(&sum[c], particles->wall_impulse[row * d + c]);
        add_torque(particles, row, point, turn);
    }
    if (impulse != NULL && !narrow_all(sum, impulse))
        return ascc_particles_fail_reading(particles, ASCC_ERROR_RANGE,
                                           "impulse: that of body %ld does not fit 64 bits",
                                           (long)body);
    if (torque != NULL)
        memcpy(torque, turn, sizeof turn);
    return ASCC_OK;
}
