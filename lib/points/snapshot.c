/* Snapshot, restore and hash of a particle set. SPDX-License-Identifier: MIT */
#include "particles.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/* ---- Snapshot -------------------------------------------------------------------------------- */

/*
 * A row of 64-bit words, little-endian on every machine; floats are their IEEE bits:
 *
 *   magic, version, dimension, fluid count, boundary count, next id, spacing, mass, quantum,
 *   positions, momenta, masses, ids,
 *   wall positions, normals, impulses, ids, bodies,
 *   checksum of all before
 */
#define SNAPSHOT_MAGIC UINT64_C(0x50414e5343435341) /* the bytes "ASCCSNAP" */
#define SNAPSHOT_VERSION 1
#define SNAPSHOT_HEADER 9
#define SNAPSHOT_FRAME (SNAPSHOT_HEADER + 1) /* and the checksum */

static size_t fluid_words(size_t dimension)
{
    return 2 * dimension + 2;
}

static size_t boundary_words(size_t dimension)
{
    return 3 * dimension + 2;
}

static uint64_t bits_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static double double_of(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static void put_word(unsigned char *into, uint64_t word)
{
    for (int i = 0; i < 8; i++)
        into[i] = (unsigned char)(word >> 8 * i);
}

static uint64_t get_word(const unsigned char *from)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++)
        word |= (uint64_t)from[i] << 8 * i;
    return word;
}

/* Each step is a bijection of both the sum and the word, so no change of one word goes unseen. */
static uint64_t checksum(const unsigned char *bytes, size_t words)
{
    uint64_t sum = SNAPSHOT_MAGIC;
    for (size_t i = 0; i < words; i++) {
        sum = (sum ^ get_word(bytes + 8 * i)) * UINT64_C(0x9e3779b97f4a7c15);
        sum ^= sum >> 32;
    }
    return sum;
}

static size_t snapshot_words(const ascc_particles *particles)
{
    const size_t d = ascc_particles_width(particles);
    return SNAPSHOT_FRAME + particles->fluid_count * fluid_words(d) +
           particles->boundary_count * boundary_words(d);
}

size_t ascc_particles_snapshot_size(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? 8 * snapshot_words(particles) : 0;
}

static unsigned char *put(unsigned char *into, uint64_t word)
{
    put_word(into, word);
    return into + 8;
}

static unsigned char *put_doubles(unsigned char *into, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into = put(into, bits_of(values[i]));
    return into;
}

static unsigned char *put_integers(unsigned char *into, const int64_t *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into = put(into, (uint64_t)values[i]);
    return into;
}

static unsigned char *put_ids(unsigned char *into, const uint64_t *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into = put(into, values[i]);
    return into;
}

ascc_status ascc_particles_snapshot(const ascc_particles *particles, void *memory, size_t capacity)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const size_t size = ascc_particles_snapshot_size(particles);
    if (memory == NULL || capacity < size)
        return ascc_particles_fail(ascc_particles_writable(particles), ASCC_ERROR_ARGUMENT,
                                   "memory: NULL, or its %zu bytes are fewer than %zu", capacity,
                                   size);
    const size_t fluid = particles->fluid_count, boundary = particles->boundary_count;
    const size_t d = ascc_particles_width(particles);
    unsigned char *at = memory;
    at = put(at, SNAPSHOT_MAGIC);
    at = put(at, SNAPSHOT_VERSION);
    at = put(at, d);
    at = put(at, fluid);
    at = put(at, boundary);
    at = put(at, particles->next_id);
    at = put(at, bits_of(particles->spacing));
    at = put(at, bits_of(particles->default_mass));
    at = put(at, bits_of(particles->quantum));
    at = put_doubles(at, particles->position, fluid * d);
    at = put_integers(at, particles->momentum, fluid * d);
    at = put_doubles(at, particles->mass, fluid);
    at = put_ids(at, particles->id, fluid);
    at = put_doubles(at, particles->wall_position, boundary * d);
    at = put_doubles(at, particles->wall_normal, boundary * d);
    at = put_integers(at, particles->wall_impulse, boundary * d);
    at = put_ids(at, particles->wall_id, boundary);
    for (size_t i = 0; i < boundary; i++)
        at = put(at, (uint64_t)particles->wall_body[i]);
    put(at, checksum(memory, (size_t)(at - (unsigned char *)memory) / 8));
    return ASCC_OK;
}

/* A snapshot taken apart: where its arrays begin. */
typedef struct snapshot {
    size_t dimension, fluid, boundary;
    uint64_t next_id;
    double spacing, mass, quantum;
    const unsigned char *position, *momentum, *masses, *ids;
    const unsigned char *wall_position, *wall_normal, *wall_impulse, *wall_ids, *wall_bodies;
} snapshot;

/* Steps over an array of words. */
static const unsigned char *skip(const unsigned char **at, size_t words)
{
    const unsigned char *const begin = *at;
    *at += 8 * words;
    return begin;
}

/* Reads header and sizes of untrusted bytes. On failure *why says what is wrong. */
static bool open_snapshot(const unsigned char *bytes, size_t size, snapshot *from, const char **why)
{
    *why = "not a snapshot";
    if (size < 8 * SNAPSHOT_FRAME || size % 8 != 0 || get_word(bytes) != SNAPSHOT_MAGIC)
        return false;
    *why = "of a version not known here";
    if (get_word(bytes + 8) != SNAPSHOT_VERSION)
        return false;
    *why = "damaged: its checksum is wrong";
    if (get_word(bytes + size - 8) != checksum(bytes, size / 8 - 1))
        return false;

    *why = "of no possible dimension or size";
    const uint64_t dimension = get_word(bytes + 16);
    const uint64_t fluid = get_word(bytes + 24), boundary = get_word(bytes + 32);
    if (dimension != 2 && dimension != 3)
        return false;
    const size_t d = (size_t)dimension, words = size / 8 - SNAPSHOT_FRAME;
    if (fluid > words / fluid_words(d) || boundary > words / boundary_words(d) ||
        (size_t)fluid * fluid_words(d) + (size_t)boundary * boundary_words(d) != words)
        return false;

    const size_t n = (size_t)fluid, m = (size_t)boundary;
    *from = (snapshot){.dimension = d,
                       .fluid = n,
                       .boundary = m,
                       .next_id = get_word(bytes + 40),
                       .spacing = double_of(get_word(bytes + 48)),
                       .mass = double_of(get_word(bytes + 56)),
                       .quantum = double_of(get_word(bytes + 64))};
    const unsigned char *at = bytes + 8 * SNAPSHOT_HEADER;
    from->position = skip(&at, n * d);
    from->momentum = skip(&at, n * d);
    from->masses = skip(&at, n);
    from->ids = skip(&at, n);
    from->wall_position = skip(&at, m * d);
    from->wall_normal = skip(&at, m * d);
    from->wall_impulse = skip(&at, m * d);
    from->wall_ids = skip(&at, m);
    from->wall_bodies = skip(&at, m);
    return true;
}

static bool are_coordinates(const unsigned char *from, size_t count, double spacing)
{
    for (size_t i = 0; i < count; i++)
        if (!(fabs(double_of(get_word(from + 8 * i))) <= ASCC_POSITION_LIMIT * spacing))
            return false;
    return true;
}

static bool are_momenta(const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++) { /* -limit <= momentum <= limit, without sign changes */
        const uint64_t shifted = get_word(from + 8 * i) + (uint64_t)ASCC_MOMENTUM_LIMIT;
        if (shifted > 2 * (uint64_t)ASCC_MOMENTUM_LIMIT)
            return false;
    }
    return true;
}

static bool are_masses(const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (!ascc_is_mass(double_of(get_word(from + 8 * i))))
            return false;
    return true;
}

static bool are_normals(const unsigned char *from, size_t count, size_t dimension)
{
    for (size_t i = 0; i < count; i++) {
        double square = 0;
        for (size_t c = 0; c < dimension; c++) {
            const double value = double_of(get_word(from + 8 * (i * dimension + c)));
            square += value * value;
        }
        if (!ascc_is_normal_length(sqrt(square)))
            return false;
    }
    return true;
}

static bool are_bodies(const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        if (get_word(from + 8 * i) > INT32_MAX)
            return false;
    return true;
}

/* Ids ascend in each kind, are in none twice, and were given out. */
static bool are_ids(const snapshot *from)
{
    size_t i = 0, k = 0;
    uint64_t last = 0;
    while (i < from->fluid || k < from->boundary) {
        const uint64_t fluid = i < from->fluid ? get_word(from->ids + 8 * i) : UINT64_MAX;
        const uint64_t wall = k < from->boundary ? get_word(from->wall_ids + 8 * k) : UINT64_MAX;
        const bool is_fluid = k == from->boundary || (i < from->fluid && fluid < wall);
        const uint64_t id = is_fluid ? fluid : wall;
        if (id <= last || id >= from->next_id)
            return false;
        last = id;
        if (is_fluid)
            i++;
        else
            k++;
    }
    return from->next_id > 0;
}

/* NULL, or what cannot be. */
static const char *check_snapshot(const snapshot *from)
{
    const size_t d = from->dimension;
    if (!ascc_is_spacing(from->spacing) || !ascc_is_mass(from->mass) ||
        !ascc_is_quantum(from->quantum))
        return "has an impossible spacing, mass or quantum";
    if (!are_coordinates(from->position, from->fluid * d, from->spacing) ||
        !are_coordinates(from->wall_position, from->boundary * d, from->spacing))
        return "has an impossible position";
    if (!are_momenta(from->momentum, from->fluid * d))
        return "has an impossible momentum";
    if (!are_masses(from->masses, from->fluid))
        return "has an impossible mass";
    if (!are_normals(from->wall_normal, from->boundary, d))
        return "has an impossible normal";
    if (!are_bodies(from->wall_bodies, from->boundary))
        return "has an impossible body";
    if (!are_ids(from))
        return "has impossible ids";
    return NULL;
}

static void get_doubles(double *into, const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into[i] = double_of(get_word(from + 8 * i));
}

static void get_integers(int64_t *into, const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into[i] = (int64_t)get_word(from + 8 * i);
}

static void get_words(uint64_t *into, const unsigned char *from, size_t count)
{
    for (size_t i = 0; i < count; i++)
        into[i] = get_word(from + 8 * i);
}

static void become(ascc_particles *particles, const snapshot *from)
{
    const size_t n = from->fluid, m = from->boundary, d = from->dimension;
    particles->spacing = from->spacing;
    particles->default_mass = from->mass;
    particles->quantum = from->quantum;
    particles->next_id = from->next_id;
    particles->fluid_count = n;
    particles->boundary_count = m;
    get_doubles(particles->position, from->position, n * d);
    get_integers(particles->momentum, from->momentum, n * d);
    get_doubles(particles->mass, from->masses, n);
    get_words(particles->id, from->ids, n);
    get_doubles(particles->wall_position, from->wall_position, m * d);
    get_doubles(particles->wall_normal, from->wall_normal, m * d);
    get_integers(particles->wall_impulse, from->wall_impulse, m * d);
    get_words(particles->wall_id, from->wall_ids, m);
    for (size_t i = 0; i < m; i++)
        particles->wall_body[i] = (int32_t)get_word(from->wall_bodies + 8 * i);
}

ascc_status ascc_particles_restore(ascc_particles *particles, const void *memory, size_t size)
{
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (memory == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "memory: NULL");
    snapshot from = {0};
    const char *why = NULL;
    if (!open_snapshot(memory, size, &from, &why))
        return ascc_particles_fail(particles, ASCC_ERROR_FORMAT, "memory: %s", why);
    if (from.dimension != ascc_particles_width(particles))
        return ascc_particles_fail(particles, ASCC_ERROR_MISMATCH,
                                   "memory: a snapshot of dimension %zu, the set has %ld",
                                   from.dimension, (long)particles->dimension);
    why = check_snapshot(&from);
    if (why != NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_FORMAT, "memory: %s", why);
    if (!ascc_particles_make_room(particles, from.fluid, from.boundary))
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "out of memory for %zu fluid and %zu boundary particles",
                                   from.fluid, from.boundary);
    become(particles, &from);
    return ASCC_OK;
}

/* ---- Hash ------------------------------------------------------------------------------------ */

/* The finaliser of splitmix64: every bit of the input changes half of the output's. */
static uint64_t mix(uint64_t hash, uint64_t word)
{
    hash = (hash ^ word) + UINT64_C(0x9e3779b97f4a7c15);
    hash = (hash ^ hash >> 30) * UINT64_C(0xbf58476d1ce4e5b9);
    hash = (hash ^ hash >> 27) * UINT64_C(0x94d049bb133111eb);
    return hash ^ hash >> 31;
}

static uint64_t mix_doubles(uint64_t hash, const double *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        hash = mix(hash, bits_of(values[i] + 0.0)); /* -0 + 0 is 0 */
    return hash;
}

/* A sum over particles, so that their order does not matter. */
uint64_t ascc_particles_hash(const ascc_particles *particles)
{
    if (!ascc_particles_is_set(particles))
        return 0;
    const size_t d = ascc_particles_width(particles);
    uint64_t hash = mix(0, d);
    hash = mix(hash, particles->fluid_count);
    hash = mix(hash, particles->boundary_count);
    hash = mix(hash, bits_of(particles->quantum));
    for (size_t row = 0; row < particles->fluid_count; row++) {
        uint64_t one = mix_doubles(mix(0, ASCC_FLUID), particles->position + row * d, d);
        for (size_t c = 0; c < d; c++)
            one = mix(one, (uint64_t)particles->momentum[row * d + c]);
        hash += mix_doubles(one, particles->mass + row, 1);
    }
    for (size_t row = 0; row < particles->boundary_count; row++) {
        uint64_t one = mix_doubles(mix(0, ASCC_BOUNDARY), particles->wall_position + row * d, d);
        one = mix_doubles(one, particles->wall_normal + row * d, d);
        hash += mix(one, (uint64_t)particles->wall_body[row]);
    }
    return hash;
}
