/* The table made of the list of particle fields, and what a row of each may be.
 * SPDX-License-Identifier: MIT */
#include "fields.h"

#include <string.h>

#include "particles.h"

double ascc_readable(double value)
{
    return isnan(value) ? fabs(value) : value;
}

ascc_status ascc_fail_number(ascc_message *message, ascc_status status, const char *name,
                             size_t row, int32_t component, double value, const char *why)
{
    return ascc_fail(message, status, "%s: row %zu component %ld is %g%s", name, row,
                     (long)component, ascc_readable(value), why);
}

/* ---- Checks ---------------------------------------------------------------------------------- */

static ascc_status check_position(const ascc_candidate *row, ascc_message *message)
{
    const double *const at = row->values;
    for (int32_t c = 0; c < row->numbers; c++) {
        if (!isfinite(at[c]))
            return ascc_fail_number(message, ASCC_ERROR_NOT_FINITE, row->name, row->row, c, at[c],
                                    "");
        if (fabs(at[c]) > ASCC_POSITION_LIMIT * row->spacing)
            return ascc_fail_number(message, ASCC_ERROR_RANGE, row->name, row->row, c, at[c],
                                    ", beyond 2^40 spacings");
    }
    return ASCC_OK;
}

static ascc_status check_momentum(const ascc_candidate *row, ascc_message *message)
{
    const int64_t *const momentum = row->values;
    for (int32_t c = 0; c < row->numbers; c++)
        if (momentum[c] < -ASCC_MOMENTUM_LIMIT || momentum[c] > ASCC_MOMENTUM_LIMIT)
            return ascc_fail_number(message, ASCC_ERROR_RANGE, row->name, row->row, c,
                                    (double)momentum[c], ", beyond 2^61 quanta");
    return ASCC_OK;
}

static ascc_status check_mass(const ascc_candidate *row, ascc_message *message)
{
    const double *const mass = row->values;
    if (ascc_is_mass(*mass))
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: row %zu is %g, not a mass", row->name,
                     row->row, ascc_readable(*mass));
}

/* Normals may be a little off: they are rounded by the host's tools. */
static ascc_status check_normal(const ascc_candidate *row, ascc_message *message)
{
    const double *const normal = row->values;
    double square = 0;
    for (int32_t c = 0; c < row->numbers; c++) {
        if (!isfinite(normal[c]))
            return ascc_fail_number(message, ASCC_ERROR_NOT_FINITE, row->name, row->row, c,
                                    normal[c], "");
        square += normal[c] * normal[c];
    }
    if (fabs(sqrt(square) - 1) <= 1e-3)
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: row %zu has length %g, not 1", row->name,
                     row->row, sqrt(square));
}

/* Of a point without a frame all zeros. */
static ascc_status check_own_normal(const ascc_candidate *row, ascc_message *message)
{
    const double *const normal = row->values;
    for (int32_t c = 0; c < row->numbers; c++)
        if (normal[c] != 0)
            return check_normal(row, message);
    return ASCC_OK;
}

static ascc_status check_velocity(const ascc_candidate *row, ascc_message *message)
{
    const double *const velocity = row->values;
    for (int32_t c = 0; c < row->numbers; c++) {
        if (!isfinite(velocity[c]))
            return ascc_fail_number(message, ASCC_ERROR_NOT_FINITE, row->name, row->row, c,
                                    velocity[c], "");
        if (fabs(velocity[c]) > ASCC_POSITION_LIMIT * row->spacing)
            return ascc_fail_number(message, ASCC_ERROR_RANGE, row->name, row->row, c, velocity[c],
                                    ", beyond 2^40 spacings a second");
    }
    return ASCC_OK;
}

static ascc_status check_past(const ascc_candidate *row, ascc_message *message)
{
    const double *const past = row->values;
    for (int32_t c = 0; c < row->numbers; c++)
        if (!isfinite(past[c]))
            return ascc_fail_number(message, ASCC_ERROR_NOT_FINITE, row->name, row->row, c, past[c],
                                    "");
    return ASCC_OK;
}

static ascc_status check_detail(const ascc_candidate *row, ascc_message *message)
{
    const double *const weight = row->values;
    if (*weight >= 0.0 && *weight <= 1.0)
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: row %zu is %g, not from 0 to 1", row->name,
                     row->row, ascc_readable(*weight));
}

static ascc_status check_body(const ascc_candidate *row, ascc_message *message)
{
    const int32_t *const body = row->values;
    if (*body >= 0)
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: row %zu is %ld, negative", row->name,
                     row->row, (long)*body);
}

/* ---- Table ----------------------------------------------------------------------------------- */

#define VECTOR ASCC_WIDTH_VECTOR
#define SCALAR ASCC_WIDTH_SCALAR
#define PAST ASCC_WIDTH_PAST
#define HASHED ASCC_HASH_ALWAYS
#define UNHASHED ASCC_HASH_NEVER
#define NONZERO ASCC_HASH_NONZERO
#define PRIVATE (-1)
#define ELEMENT(type)                                                                              \
    _Generic((type)0, double                                                                       \
             : ASCC_REAL, int64_t                                                                  \
             : ASCC_INTEGER, uint64_t                                                              \
             : ASCC_INTEGER, int32_t                                                               \
             : ASCC_SMALL_INTEGER)
#define LISTED(kind, member, type, numbers, hash, access, check)                                   \
    {#member, kind, ELEMENT(type), numbers, hash, access, offsetof(ascc_particles, member), check},

const ascc_particle_field ascc_particle_fields[ASCC_FIELD_COUNT] = {ASCC_PARTICLE_FIELDS(LISTED)};

/* Pointers are copied as bytes, since each has a type of its own. */
void *ascc_field_rows(const ascc_particles *particles, const ascc_particle_field *field)
{
    void *rows;
    memcpy(&rows, (const unsigned char *)particles + field->offset, sizeof rows);
    return rows;
}

void ascc_field_point(ascc_particles *particles, const ascc_particle_field *field, void *rows)
{
    memcpy((unsigned char *)particles + field->offset, &rows, sizeof rows);
}
