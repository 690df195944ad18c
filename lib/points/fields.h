/* The arrays of a particle set, each listed once. SPDX-License-Identifier: MIT */
#ifndef ASCC_FIELDS_H
#define ASCC_FIELDS_H

#include "base/common.h"

/*
 * To add a field, add a line: its member of struct ascc_particles, place in the block, growing,
 * copying, removal, snapshot, restore and hash follow from it. Its rows are added as zeros.
 *
 *   kind     of particle that has it
 *   member   of struct ascc_particles: a pointer to the first row
 *   type     of a number: double, int64_t, uint64_t or int32_t
 *   numbers  of a row: VECTOR (`dimension`), SCALAR (one) or PAST (a vector for each earlier step that the set keeps)
 *   hash     HASHED, or UNHASHED: what depends on the order of rows or on the past; NONZERO: rows of zeros are
 *            left out, so that hashes taken before there was the field stay what they were
 *   access   what ascc_particles_set and ascc_particles_get call it, or PRIVATE
 *   check    a function of fields.c that says what a row may be, for the host's numbers and for
 *            snapshots; NULL = anything
 *
 * The order is that of memory, snapshot and hash. A line more is a snapshot of another version: put it last, and
 * say in ascc_snapshot_fields how many fields older versions have.
 */
#define ASCC_PARTICLE_FIELDS(X)                                                                    \
    X(ASCC_FLUID, position, double, VECTOR, HASHED, ASCC_POSITION, check_position)                 \
    X(ASCC_FLUID, momentum, int64_t, VECTOR, HASHED, ASCC_VELOCITY, check_momentum) /* quanta */   \
    X(ASCC_FLUID, mass, double, SCALAR, HASHED, ASCC_MASS, check_mass)                             \
    X(ASCC_FLUID, id, uint64_t, SCALAR, UNHASHED, PRIVATE, NULL) /* ascend: see snapshot.c */      \
    X(ASCC_BOUNDARY, wall_position, double, VECTOR, HASHED, ASCC_POSITION, check_position)         \
    X(ASCC_BOUNDARY, wall_normal, double, VECTOR, HASHED, ASCC_NORMAL, check_normal)               \
    X(ASCC_BOUNDARY, wall_impulse, int64_t, VECTOR, UNHASHED, PRIVATE, NULL) /* quanta */          \
    X(ASCC_BOUNDARY, wall_id, uint64_t, SCALAR, UNHASHED, PRIVATE, NULL)                           \
    X(ASCC_BOUNDARY, wall_body, int32_t, SCALAR, HASHED, PRIVATE, check_body)                      \
    X(ASCC_BOUNDARY, wall_velocity, double, VECTOR, NONZERO, ASCC_VELOCITY, check_velocity)        \
    /* In the frame of a body (bodies.h); zeros where there is none. */                            \
    X(ASCC_BOUNDARY, wall_own_position, double, VECTOR, UNHASHED, PRIVATE, check_position)         \
    X(ASCC_BOUNDARY, wall_own_normal, double, VECTOR, UNHASHED, PRIVATE, check_own_normal)         \
    X(ASCC_FLUID, rest, int32_t, SCALAR, NONZERO, PRIVATE, NULL)     /* rest.h */                  \
    X(ASCC_FLUID, past, double, PAST, UNHASHED, PRIVATE, check_past) /* the last step's first */   \
    X(ASCC_FLUID, detail, double, SCALAR, NONZERO, ASCC_DETAIL, check_detail)

/* Raise it with every change of the list. */
#define ASCC_SNAPSHOT_VERSION 5

/* Where a field stands in the list: ASCC_FIELD_position and so on. */
typedef enum ascc_field_index {
#define ASCC_LISTED(kind, member, ...) ASCC_FIELD_##member,
    ASCC_PARTICLE_FIELDS(ASCC_LISTED)
#undef ASCC_LISTED
        ASCC_FIELD_COUNT
} ascc_field_index;

/* How many of the list a snapshot of an older version or this one has; 0: no such version. */
static inline size_t ascc_snapshot_fields(uint64_t version)
{
    return version == ASCC_SNAPSHOT_VERSION ? ASCC_FIELD_COUNT
           : version == 4                   ? ASCC_FIELD_detail
           : version == 3                   ? ASCC_FIELD_rest
           : version == 2                   ? ASCC_FIELD_wall_own_position
           : version == 1                   ? ASCC_FIELD_wall_velocity
                                            : 0;
}

/* What a number is; all but the last take eight bytes. */
typedef enum ascc_element { ASCC_REAL, ASCC_INTEGER, ASCC_SMALL_INTEGER } ascc_element;

/* Of a row's numbers. */
typedef enum ascc_width { ASCC_WIDTH_SCALAR, ASCC_WIDTH_VECTOR, ASCC_WIDTH_PAST } ascc_width;

/* Whether the hash sees a row: never, always, or where it is not zero. */
typedef enum ascc_hashing { ASCC_HASH_NEVER, ASCC_HASH_ALWAYS, ASCC_HASH_NONZERO } ascc_hashing;

/* A row that is to be stored. */
typedef struct ascc_candidate {
    const char *name; /* of its array, for the message */
    size_t row;
    const void *values; /* as the field holds them */
    int32_t numbers;
    double spacing;
} ascc_candidate;

typedef ascc_status ascc_row_check(const ascc_candidate *row, ascc_message *message);

typedef struct ascc_particle_field {
    const char *name;
    ascc_kind kind;
    ascc_element element;
    ascc_width width;
    ascc_hashing hash;
    int32_t access; /* an ascc_field, or negative */
    size_t offset;  /* of the pointer in struct ascc_particles */
    ascc_row_check *check;
} ascc_particle_field;

extern const ascc_particle_field ascc_particle_fields[ASCC_FIELD_COUNT];

static inline size_t ascc_field_element_size(const ascc_particle_field *field)
{
    return field->element == ASCC_SMALL_INTEGER ? sizeof(int32_t) : sizeof(int64_t);
}

/* Numbers of a row; past: the earlier steps that the set keeps. */
static inline int32_t ascc_field_numbers(const ascc_particle_field *field, int32_t dimension,
                                         int32_t past)
{
    return field->width == ASCC_WIDTH_SCALAR   ? 1
           : field->width == ASCC_WIDTH_VECTOR ? dimension
                                               : past * dimension;
}

/* Bytes of a row. */
static inline size_t ascc_field_row_size(const ascc_particle_field *field, int32_t dimension,
                                         int32_t past)
{
    return (size_t)ascc_field_numbers(field, dimension, past) * ascc_field_element_size(field);
}

/* The first row. */
void *ascc_field_rows(const ascc_particles *particles, const ascc_particle_field *field);
void ascc_field_point(ascc_particles *particles, const ascc_particle_field *field, void *rows);

/* "NAME: row ROW component C is VALUE", and why that is not right. */
ascc_status ascc_fail_number(ascc_message *message, ascc_status status, const char *name,
                             size_t row, int32_t component, double value, const char *why);

/* For messages: a NaN has a sign, which nobody wants to read. */
double ascc_readable(double value);

#endif
