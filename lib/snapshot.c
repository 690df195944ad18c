/* Snapshot, restore and hash of a particle set. SPDX-License-Identifier: MIT
 *
 * A snapshot is little-endian words of 8 bytes: header, fluid columns, boundary columns, checksum.
 */
#include <inttypes.h>
#include <math.h>
#include <string.h>

#include "particles.h"

#define SNAPSHOT_MAGIC 0x31706e7363736173u /* "sascsnp1" */
#define HEADER_WORDS 9

static bool valid(const ascc_particles *p)
{
    return p && p->magic == ASCC_PARTICLES_MAGIC;
}

static uint64_t mix(uint64_t h)
{
    h ^= h >> 30;
    h *= 0xbf58476d1ce4e5b9u;
    h ^= h >> 27;
    h *= 0x94d049bb133111ebu;
    return h ^ h >> 31;
}

static uint64_t chain(uint64_t h, uint64_t word)
{
    return mix(h + 0x9e3779b97f4a7c15u + word) + word * 0xd6e8feb86659fd93u;
}

static uint64_t bits_of(double x)
{
    uint64_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

static double double_of(uint64_t bits)
{
    double x;
    memcpy(&x, &bits, sizeof x);
    return x;
}

/* ---- Hash ---- */

uint64_t ascc_particles_hash(const ascc_particles *p)
{
    if (!valid(p))
        return 0;
    const size_t d = (size_t)p->dimension;
    uint64_t sum = 0; /* of the particles' own hashes: order does not matter */
    for (size_t i = 0; i < p->fluid_count; i++) {
        uint64_t h = chain(1, bits_of(p->mass[i]));
        for (size_t c = 0; c < d; c++) {
            h = chain(h, bits_of(p->position[i * d + c] + 0.0)); /* -0 is 0 */
            h = chain(h, (uint64_t)p->momentum[i * d + c]);
        }
        sum += mix(h);
    }
    for (size_t i = 0; i < p->boundary_count; i++) {
        uint64_t h = chain(2, (uint64_t)p->wall_body[i]);
        for (size_t c = 0; c < d; c++) {
            h = chain(h, bits_of(p->wall_position[i * d + c] + 0.0));
            h = chain(h, bits_of(p->wall_normal[i * d + c] + 0.0));
        }
        sum += mix(h);
    }
    uint64_t h = chain(3, (uint64_t)p->dimension);
    h = chain(h, p->fluid_count);
    h = chain(h, p->boundary_count);
    return chain(h, sum);
}

/* ---- Words ---- */

static void put(unsigned char **at, uint64_t word)
{
    for (int i = 0; i < 8; i++)
        (*at)[i] = (unsigned char)(word >> 8 * i);
    *at += 8;
}

static uint64_t take(const unsigned char **at)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++)
        word |= (uint64_t)(*at)[i] << 8 * i;
    *at += 8;
    return word;
}

static uint64_t checksum(const unsigned char *bytes, size_t words)
{
    uint64_t h = 4;
    for (size_t i = 0; i < words; i++)
        h = chain(h, take(&bytes));
    return h;
}

/* Words of all columns: fluid x p m id, boundary x n body id impulse. False if that does not fit. */
static bool body_words(size_t d, size_t fluid, size_t boundary, size_t *words)
{
    size_t a, b;
    if (!ascc_multiply_size(fluid, 2 * d + 2, &a) || !ascc_multiply_size(boundary, 3 * d + 2, &b) ||
        a > SIZE_MAX / 16 || b > SIZE_MAX / 16)
        return false;
    *words = a + b;
    return true;
}

size_t ascc_particles_snapshot_size(const ascc_particles *p)
{
    size_t words;
    if (!valid(p) || !body_words((size_t)p->dimension, p->fluid_count, p->boundary_count, &words))
        return 0;
    return (HEADER_WORDS + words + 1) * 8;
}

/* ---- Snapshot ---- */

static void put_doubles(unsigned char **at, const double *x, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put(at, bits_of(x[i]));
}

static void put_integers(unsigned char **at, const int64_t *x, size_t count)
{
    for (size_t i = 0; i < count; i++)
        put(at, (uint64_t)x[i]);
}

ascc_status ascc_particles_snapshot(const ascc_particles *p, void *memory, size_t capacity)
{
    if (!valid(p) || !memory || capacity < ascc_particles_snapshot_size(p))
        return ASCC_ERROR_ARGUMENT;
    const size_t d = (size_t)p->dimension, n = p->fluid_count, w = p->boundary_count;
    unsigned char *at = memory;
    put(&at, SNAPSHOT_MAGIC);
    put(&at, 1); /* version */
    put(&at, (uint64_t)p->dimension);
    put(&at, n);
    put(&at, w);
    put(&at, bits_of(p->spacing));
    put(&at, bits_of(p->default_mass));
    put(&at, bits_of(p->quantum));
    put(&at, p->next_id);
    put_doubles(&at, p->position, n * d);
    put_integers(&at, p->momentum, n * d);
    put_doubles(&at, p->mass, n);
    for (size_t i = 0; i < n; i++)
        put(&at, p->id[i]);
    put_doubles(&at, p->wall_position, w * d);
    put_doubles(&at, p->wall_normal, w * d);
    for (size_t i = 0; i < w; i++)
        put(&at, (uint64_t)p->wall_body[i]);
    for (size_t i = 0; i < w; i++)
        put(&at, p->wall_id[i]);
    put_integers(&at, p->wall_impulse, w * d);
    const size_t words = (size_t)(at - (unsigned char *)memory) / 8;
    put(&at, checksum(memory, words));
    return ASCC_OK;
}

/* ---- Restore ---- */

/* A snapshot's header, and its columns as words. */
typedef struct snapshot {
    uint64_t dimension, fluid, boundary, next_id;
    double spacing, mass, quantum;
    const unsigned char *position, *momentum, *masses, *id;
    const unsigned char *wall_position, *wall_normal, *body, *wall_id, *impulse;
} snapshot;

static double double_at(const unsigned char *column, size_t i)
{
    const unsigned char *at = column + i * 8;
    return double_of(take(&at));
}

static uint64_t word_at(const unsigned char *column, size_t i)
{
    const unsigned char *at = column + i * 8;
    return take(&at);
}

static ascc_status read_header(ascc_particles *p, const unsigned char *memory, size_t size,
                               snapshot *s)
{
    const unsigned char *at = memory;
    size_t words;
    if (size < (HEADER_WORDS + 1) * 8 || take(&at) != SNAPSHOT_MAGIC)
        return ascc_particles_fail(p, ASCC_ERROR_FORMAT, "snapshot: not one of these");
    const uint64_t version = take(&at);
    if (version != 1)
        return ascc_particles_fail(p, ASCC_ERROR_FORMAT,
                                   "snapshot: version %" PRIu64 " is not known", version);
    s->dimension = take(&at);
    s->fluid = take(&at);
    s->boundary = take(&at);
    s->spacing = double_of(take(&at));
    s->mass = double_of(take(&at));
    s->quantum = double_of(take(&at));
    s->next_id = take(&at);
    if (s->dimension != (uint64_t)p->dimension)
        return ascc_particles_fail(p, ASCC_ERROR_MISMATCH,
                                   "snapshot: of dimension %" PRIu64 ", the set has %d",
                                   s->dimension, p->dimension);
    const size_t d = (size_t)p->dimension;
    if (s->fluid >= UINT32_MAX || s->boundary >= UINT32_MAX ||
        !body_words(d, (size_t)s->fluid, (size_t)s->boundary, &words) ||
        size != (HEADER_WORDS + words + 1) * 8)
        return ascc_particles_fail(p, ASCC_ERROR_FORMAT,
                                   "snapshot: %zu bytes do not hold %" PRIu64 " fluid and %" PRIu64
                                   " boundary particles",
                                   size, s->fluid, s->boundary);
    if (word_at(memory, HEADER_WORDS + words) != checksum(memory, HEADER_WORDS + words))
        return ascc_particles_fail(p, ASCC_ERROR_FORMAT, "snapshot: the checksum does not match");
    const size_t n = (size_t)s->fluid, w = (size_t)s->boundary;
    s->position = at;
    s->momentum = s->position + n * d * 8;
    s->masses = s->momentum + n * d * 8;
    s->id = s->masses + n * 8;
    s->wall_position = s->id + n * 8;
    s->wall_normal = s->wall_position + w * d * 8;
    s->body = s->wall_normal + w * d * 8;
    s->wall_id = s->body + w * 8;
    s->impulse = s->wall_id + w * 8;
    return ASCC_OK;
}

static bool ids_ascend(const unsigned char *column, size_t count, uint64_t next_id)
{
    uint64_t last = 0;
    for (size_t i = 0; i < count; i++) {
        const uint64_t id = word_at(column, i);
        if (id <= last || id >= next_id)
            return false;
        last = id;
    }
    return true;
}

/* Whether every number is one that the set could hold. */
static bool content_valid(const snapshot *s, size_t d)
{
    const size_t n = (size_t)s->fluid, w = (size_t)s->boundary;
    bool good = s->spacing > 0.0 && isfinite(s->spacing) && s->mass > 0.0 && isfinite(s->mass) &&
                s->quantum > 0.0 && isfinite(s->quantum);
    const double far = ASCC_POSITION_LIMIT * s->spacing;
    for (size_t k = 0; good && k < n * d; k++) {
        const int64_t p = (int64_t)word_at(s->momentum, k);
        good = fabs(double_at(s->position, k)) <= far && p <= ASCC_MOMENTUM_LIMIT &&
               p >= -ASCC_MOMENTUM_LIMIT;
    }
    for (size_t i = 0; good && i < n; i++)
        good = double_at(s->masses, i) > 0.0 && isfinite(double_at(s->masses, i));
    for (size_t k = 0; good && k < w * d; k++)
        good = fabs(double_at(s->wall_position, k)) <= far &&
               fabs(double_at(s->wall_normal, k)) <= 1.01;
    for (size_t i = 0; good && i < w; i++)
        good = word_at(s->body, i) <= INT32_MAX;
    return good && ids_ascend(s->id, n, s->next_id) && ids_ascend(s->wall_id, w, s->next_id);
}

static void copy_content(ascc_particles *p, const snapshot *s)
{
    const size_t d = (size_t)p->dimension, n = (size_t)s->fluid, w = (size_t)s->boundary;
    p->fluid_count = n;
    p->boundary_count = w;
    p->spacing = s->spacing;
    p->default_mass = s->mass;
    p->quantum = s->quantum;
    p->next_id = s->next_id;
    for (size_t k = 0; k < n * d; k++) {
        p->position[k] = double_at(s->position, k);
        p->momentum[k] = (int64_t)word_at(s->momentum, k);
    }
    for (size_t i = 0; i < n; i++) {
        p->mass[i] = double_at(s->masses, i);
        p->id[i] = word_at(s->id, i);
    }
    for (size_t k = 0; k < w * d; k++) {
        p->wall_position[k] = double_at(s->wall_position, k);
        p->wall_normal[k] = double_at(s->wall_normal, k);
        p->wall_impulse[k] = (int64_t)word_at(s->impulse, k);
    }
    for (size_t i = 0; i < w; i++) {
        p->wall_body[i] = (int32_t)word_at(s->body, i);
        p->wall_id[i] = word_at(s->wall_id, i);
    }
}

ascc_status ascc_particles_restore(ascc_particles *p, const void *memory, size_t size)
{
    if (!valid(p))
        return ASCC_ERROR_ARGUMENT;
    if (!memory)
        return ascc_particles_fail(p, ASCC_ERROR_ARGUMENT, "memory: missing");
    snapshot s = {0};
    ascc_status status = read_header(p, memory, size, &s);
    if (status != ASCC_OK)
        return status;
    if (!content_valid(&s, (size_t)p->dimension))
        return ascc_particles_fail(p, ASCC_ERROR_FORMAT,
                                   "snapshot: a value in it is one that no set holds");
    status = ascc_particles_reserve(p, (size_t)s.fluid, (size_t)s.boundary);
    if (status == ASCC_OK)
        copy_content(p, &s);
    return status;
}
