/* Snapshot, restore and hash of a particle set. SPDX-License-Identifier: MIT */
#include "snapshot.h"
#include "base/words.h"
#include "bodies.h"
#include "rotation.h"

#include <inttypes.h>
#include <math.h>
#include <string.h>

/* ---- Snapshot -------------------------------------------------------------------------------- */

/*
 * A row of 64-bit words, little-endian on every machine; floats are their IEEE bits:
 *
 *   magic, version and (from bit 32 on) earlier velocities of each particle, dimension, fluid count, boundary count, next id, spacing, mass, quantum,
 *   every field of the list in fields.h that the version has, row by row,
 *   from version 3 on every body (number, whether it moved, first id, end of ids, its doubles in the order of
 *   bodies.h), the next body's number, the number of bodies,
 *   checksum of all before
 */
#define PAST_SHIFT 32
#define SNAPSHOT_FRAME (ASCC_SNAPSHOT_HEAD + 1) /* and the checksum */
#define BODY_WORDS (4 + ASCC_BODY_NUMBERS)
#define BODIES_FRAME 2 /* after the bodies, from version 3 on */

/* Words of one particle of a kind, in a snapshot with the first `fields` of the list. */
static size_t row_words(ascc_kind kind, int32_t dimension, int32_t past, size_t fields)
{
    size_t words = 0;
    for (size_t i = 0; i < fields; i++)
        if (ascc_particle_fields[i].kind == kind)
            words += (size_t)ascc_field_numbers(&ascc_particle_fields[i], dimension, past);
    return words;
}

size_t ascc_snapshot_tail_words(const ascc_particles *particles)
{
    return particles->body_count * BODY_WORDS + BODIES_FRAME;
}

static size_t snapshot_words(const ascc_particles *particles)
{
    const int32_t dimension = particles->dimension, past = particles->past_count;
    return SNAPSHOT_FRAME +
           particles->fluid_count * row_words(ASCC_FLUID, dimension, past, ASCC_FIELD_COUNT) +
           particles->boundary_count * row_words(ASCC_BOUNDARY, dimension, past, ASCC_FIELD_COUNT) +
           ascc_snapshot_tail_words(particles);
}

size_t ascc_particles_snapshot_size(const ascc_particles *particles)
{
    return ascc_particles_is_set(particles) ? 8 * snapshot_words(particles) : 0;
}

/* A number of a field as a word. */
static uint64_t number_word(const ascc_particle_field *field, const unsigned char *numbers,
                            size_t index)
{
    if (field->element == ASCC_SMALL_INTEGER) {
        int32_t small;
        memcpy(&small, numbers + index * sizeof small, sizeof small);
        return (uint64_t)small;
    }
    uint64_t word;
    memcpy(&word, numbers + index * sizeof word, sizeof word);
    return word;
}

/* And back; false when it does not fit. */
static bool number_from_word(const ascc_particle_field *field, unsigned char *numbers, size_t index,
                             uint64_t word)
{
    if (field->element == ASCC_SMALL_INTEGER) {
        const int32_t small = (int32_t)(uint32_t)word;
        memcpy(numbers + index * sizeof small, &small, sizeof small);
        return (uint64_t)small == word;
    }
    memcpy(numbers + index * sizeof word, &word, sizeof word);
    return true;
}

static unsigned char *put(unsigned char *into, uint64_t word)
{
    ascc_put_word(into, word);
    return into + 8;
}

static unsigned char *put_body(unsigned char *into, const struct ascc_body *body)
{
    into = put(into, (uint64_t)body->number);
    into = put(into, (uint64_t)body->moved);
    into = put(into, body->first_id);
    into = put(into, body->end_id);
    for (size_t k = 0; k < ASCC_BODY_NUMBERS; k++) {
        double number;
        memcpy(&number,
               (const unsigned char *)body + offsetof(struct ascc_body, position) +
                   k * sizeof number,
               sizeof number);
        into = put(into, ascc_bits_of(number));
    }
    return into;
}

unsigned char *ascc_snapshot_put_head(const ascc_particles *particles, size_t fluid,
                                      unsigned char *into)
{
    into = put(into, ASCC_SNAPSHOT_MAGIC);
    into = put(into, ASCC_SNAPSHOT_VERSION | (uint64_t)particles->past_count << PAST_SHIFT);
    into = put(into, ascc_particles_width(particles));
    into = put(into, fluid);
    into = put(into, particles->boundary_count);
    into = put(into, particles->next_id);
    into = put(into, ascc_bits_of(particles->spacing));
    into = put(into, ascc_bits_of(particles->default_mass));
    return put(into, ascc_bits_of(particles->quantum));
}

unsigned char *ascc_snapshot_put_numbers(const ascc_particle_field *field, const void *numbers,
                                         size_t count, unsigned char *into)
{
    for (size_t k = 0; k < count; k++)
        into = put(into, number_word(field, numbers, k));
    return into;
}

unsigned char *ascc_snapshot_put_tail(const ascc_particles *particles, unsigned char *into)
{
    for (size_t b = 0; b < particles->body_count; b++)
        into = put_body(into, &particles->bodies[b]);
    into = put(into, (uint64_t)particles->next_body);
    return put(into, particles->body_count);
}

ascc_status ascc_particles_snapshot(const ascc_particles *particles, void *memory, size_t capacity)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    const size_t size = ascc_particles_snapshot_size(particles);
    if (memory == NULL || capacity < size)
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                           "memory: NULL, or its %zu bytes are fewer than %zu",
                                           capacity, size);
    unsigned char *at = ascc_snapshot_put_head(particles, particles->fluid_count, memory);
    for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        at = ascc_snapshot_put_numbers(
            field, ascc_field_rows(particles, field),
            ascc_particles_count(particles, field->kind) *
                (size_t)ascc_field_numbers(field, particles->dimension, particles->past_count),
            at);
    }
    at = ascc_snapshot_put_tail(particles, at);
    put(at,
        ascc_sum_words(ASCC_SNAPSHOT_MAGIC, memory, (size_t)(at - (unsigned char *)memory) / 8));
    return ASCC_OK;
}

/* ---- Restore --------------------------------------------------------------------------------- */

/* A snapshot taken apart. */
typedef struct snapshot {
    int32_t dimension;
    int32_t past;
    size_t fields; /* of the list */
    size_t rows[ASCC_KIND_COUNT];
    uint64_t next_id;
    double spacing, mass, quantum;
    const unsigned char *words[ASCC_FIELD_COUNT]; /* where each field begins */
    size_t body_count;
    int64_t next_body;
    const unsigned char *bodies;
} snapshot;

bool ascc_snapshot_read_head(const unsigned char *head, uint64_t words,
                             ascc_snapshot_layout *layout, const char **why)
{
    *why = "not a snapshot";
    if (words < SNAPSHOT_FRAME || ascc_get_word(head) != ASCC_SNAPSHOT_MAGIC)
        return false;
    *why = "of a version not known here";
    const uint64_t version = ascc_get_word(head + 8), past = version >> PAST_SHIFT;
    const size_t fields = ascc_snapshot_fields(version & UINT32_MAX);
    if (fields == 0 || past > (fields > ASCC_FIELD_past ? ASCC_MAX_HISTORY : 0))
        return false;

    *why = "of no possible dimension or size";
    const uint64_t dimension = ascc_get_word(head + 16);
    const uint64_t fluid = ascc_get_word(head + 24), boundary = ascc_get_word(head + 32);
    if ((dimension != 2 && dimension != 3) || words > SIZE_MAX / 8)
        return false;
    const size_t fluid_words = row_words(ASCC_FLUID, (int32_t)dimension, (int32_t)past, fields);
    const size_t boundary_words =
        row_words(ASCC_BOUNDARY, (int32_t)dimension, (int32_t)past, fields);
    uint64_t left = words - SNAPSHOT_FRAME;
    if (fluid > left / fluid_words)
        return false;
    left -= fluid * fluid_words;
    if (boundary > left / boundary_words)
        return false;
    left -= boundary * boundary_words;
    if (fields > ASCC_FIELD_wall_own_position
            ? left < BODIES_FRAME || (left - BODIES_FRAME) % BODY_WORDS != 0
            : left != 0)
        return false;
    *layout = (ascc_snapshot_layout){.dimension = (int32_t)dimension,
                                     .past = (int32_t)past,
                                     .fields = fields,
                                     .rows = {(size_t)fluid, (size_t)boundary},
                                     .words = (size_t)words,
                                     .tail = (size_t)left};
    return true;
}

void ascc_snapshot_set_fluid(ascc_snapshot_layout *layout, unsigned char *head, size_t fluid)
{
    const size_t words = row_words(ASCC_FLUID, layout->dimension, layout->past, layout->fields);
    layout->words = layout->words - layout->rows[ASCC_FLUID] * words + fluid * words;
    layout->rows[ASCC_FLUID] = fluid;
    ascc_put_word(head + 24, fluid);
}

/* Reads head and sizes of untrusted bytes. On failure *why says what is wrong. */
static bool open_snapshot(const unsigned char *bytes, size_t size, snapshot *from, const char **why)
{
    ascc_snapshot_layout layout = {0};
    if (!ascc_snapshot_read_head(bytes, size % 8 == 0 ? size / 8 : 0, &layout, why))
        return false;
    *why = "damaged: its checksum is wrong";
    const unsigned char *const end = bytes + size - 8;
    if (ascc_get_word(end) != ascc_sum_words(ASCC_SNAPSHOT_MAGIC, bytes, size / 8 - 1))
        return false;
    *why = "of no possible dimension or size";
    const uint64_t bodies = layout.tail ? ascc_get_word(end - 8) : 0;
    const uint64_t next_body = layout.tail ? ascc_get_word(end - 16) : 0;
    if (layout.tail && (bodies != (layout.tail - BODIES_FRAME) / BODY_WORDS ||
                        next_body > (uint64_t)INT32_MAX + 1))
        return false;

    *from = (snapshot){.dimension = layout.dimension,
                       .past = layout.past,
                       .fields = layout.fields,
                       .rows = {layout.rows[ASCC_FLUID], layout.rows[ASCC_BOUNDARY]},
                       .next_id = ascc_get_word(bytes + 40),
                       .spacing = ascc_double_of(ascc_get_word(bytes + 48)),
                       .mass = ascc_double_of(ascc_get_word(bytes + 56)),
                       .quantum = ascc_double_of(ascc_get_word(bytes + 64)),
                       .body_count = (size_t)bodies,
                       .next_body = (int64_t)next_body,
                       .bodies = end - 8 * layout.tail};
    const unsigned char *at = bytes + 8 * ASCC_SNAPSHOT_HEAD;
    for (size_t i = 0; i < layout.fields; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        from->words[i] = at;
        at += 8 * from->rows[field->kind] *
              (size_t)ascc_field_numbers(field, from->dimension, from->past);
    }
    return true;
}

/* Whether every row of a field can be held. */
static ascc_status check_field(const snapshot *from, size_t index, ascc_message *message)
{
    const ascc_particle_field *const field = &ascc_particle_fields[index];
    union {
        double real[3 * ASCC_MAX_HISTORY];
        int64_t integer[3];
        int32_t small[3];
    } values;
    ascc_candidate row = {.name = field->name,
                          .values = &values,
                          .numbers = ascc_field_numbers(field, from->dimension, from->past),
                          .spacing = from->spacing};
    const unsigned char *at = from->words[index];
    for (row.row = 0; row.row < from->rows[field->kind]; row.row++) {
        bool fits = true;
        for (size_t c = 0; c < (size_t)row.numbers; c++, at += 8)
            fits &= number_from_word(field, (unsigned char *)&values, c, ascc_get_word(at));
        if (!fits)
            return ascc_fail(message, ASCC_ERROR_FORMAT, "%s: row %zu does not fit 32 bits",
                             field->name, row.row);
        if (field->check != NULL && field->check(&row, message) != ASCC_OK)
            return ASCC_ERROR_FORMAT;
    }
    return ASCC_OK;
}

/* Ids ascend in each kind, are in none twice, and were given out. */
static bool are_ids(const snapshot *from)
{
    const size_t fluid_count = from->rows[ASCC_FLUID], wall_count = from->rows[ASCC_BOUNDARY];
    const unsigned char *const fluid_ids = from->words[ASCC_FIELD_id];
    const unsigned char *const wall_ids = from->words[ASCC_FIELD_wall_id];
    size_t i = 0, k = 0;
    uint64_t last = 0;
    while (i < fluid_count || k < wall_count) {
        const uint64_t fluid = i < fluid_count ? ascc_get_word(fluid_ids + 8 * i) : UINT64_MAX;
        const uint64_t wall = k < wall_count ? ascc_get_word(wall_ids + 8 * k) : UINT64_MAX;
        const bool is_fluid = k == wall_count || (i < fluid_count && fluid < wall);
        const uint64_t id = is_fluid ? fluid : wall;
        if (id <= last || id >= from->next_id)
            return false;
        last = id;
        if (is_fluid)
            i++;
        else
            k++;
    }
    return from->next_id > 0 && from->next_id <= ASCC_ID_LIMIT;
}

static struct ascc_body get_body(const snapshot *from, size_t index)
{
    const unsigned char *at = from->bodies + 8 * BODY_WORDS * index;
    struct ascc_body body = {.number = (int32_t)ascc_get_word(at),
                             .moved = (int32_t)(ascc_get_word(at + 8) & 1),
                             .first_id = ascc_get_word(at + 16),
                             .end_id = ascc_get_word(at + 24)};
    for (size_t k = 0; k < ASCC_BODY_NUMBERS; k++) {
        const double number = ascc_double_of(ascc_get_word(at + 32 + 8 * k));
        memcpy((unsigned char *)&body + offsetof(struct ascc_body, position) + k * sizeof number,
               &number, sizeof number);
    }
    return body;
}

/* Bodies ascend in numbers and ids. */
static ascc_status check_bodies(const snapshot *from, ascc_message *message)
{
    int64_t number = -1;
    uint64_t id = 0;
    for (size_t b = 0; b < from->body_count; b++) {
        struct ascc_body body = get_body(from, b);
        const unsigned char *const at = from->bodies + 8 * BODY_WORDS * b;
        if (ascc_get_word(at) > INT32_MAX || ascc_get_word(at + 8) > 1 || body.number <= number ||
            body.number >= from->next_body || body.first_id < id || body.end_id < body.first_id ||
            body.end_id > from->next_id)
            return ascc_fail(message, ASCC_ERROR_FORMAT, "body %zu of %zu has impossible numbers",
                             b, from->body_count);
        for (int c = 0; c < 3; c++)
            if (!isfinite(body.torque[c]))
                return ascc_fail(message, ASCC_ERROR_FORMAT, "a body's torque is not finite");
        if (ascc_body_check(&body, from->dimension, from->spacing, "a body", message) != ASCC_OK)
            return ASCC_ERROR_FORMAT;
        number = body.number;
        id = body.end_id;
    }
    return ASCC_OK;
}

/* The body whose points have an id, or -1. Ids are asked in ascending order: `next` is where to look. */
static int64_t body_of_id(const snapshot *from, uint64_t id, size_t *next)
{
    while (*next < from->body_count) {
        const struct ascc_body body = get_body(from, *next);
        if (id < body.end_id)
            return id >= body.first_id ? body.number : -1;
        ++*next;
    }
    return -1;
}

static bool is_body_number(const snapshot *from, uint64_t number)
{
    size_t low = 0, high = from->body_count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const uint64_t found = ascc_get_word(from->bodies + 8 * BODY_WORDS * middle);
        if (found == number)
            return true;
        if (found < number)
            low = middle + 1;
        else
            high = middle;
    }
    return false;
}

/* Points are a body's by id and by number, and have a normal in its frame. Old snapshots have no bodies. */
static ascc_status check_points_of_bodies(const snapshot *from, ascc_message *message)
{
    const size_t d = (size_t)from->dimension;
    size_t next = 0;
    if (from->fields <= ASCC_FIELD_wall_own_position)
        return ASCC_OK;
    for (size_t row = 0; row < from->rows[ASCC_BOUNDARY]; row++) {
        const uint64_t number = ascc_get_word(from->words[ASCC_FIELD_wall_body] + 8 * row);
        const uint64_t id = ascc_get_word(from->words[ASCC_FIELD_wall_id] + 8 * row);
        const int64_t body = body_of_id(from, id, &next);
        const unsigned char *const own = from->words[ASCC_FIELD_wall_own_normal] + 8 * row * d;
        bool has_normal = false;
        for (size_t c = 0; c < d; c++)
            has_normal |= ascc_double_of(ascc_get_word(own + 8 * c)) != 0;
        if ((int64_t)number >= from->next_body ||
            (body >= 0 ? number != (uint64_t)body || !has_normal : is_body_number(from, number)))
            return ascc_fail(message, ASCC_ERROR_FORMAT,
                             "wall_body: row %zu is %llu, which its id contradicts", row,
                             (unsigned long long)number);
    }
    return ASCC_OK;
}

/* Whether a set can be this. */
static ascc_status check_snapshot(const snapshot *from, ascc_message *message)
{
    if (!ascc_is_spacing(from->spacing) || !ascc_is_mass(from->mass) ||
        !ascc_is_quantum(from->quantum))
        return ascc_fail(message, ASCC_ERROR_FORMAT, "an impossible spacing, mass or quantum");
    for (size_t i = 0; i < from->fields; i++) {
        const ascc_status status = check_field(from, i, message);
        if (status != ASCC_OK)
            return status;
    }
    if (!are_ids(from))
        return ascc_fail(message, ASCC_ERROR_FORMAT, "impossible ids; the next is %" PRIu64,
                         from->next_id);
    const ascc_status status = check_bodies(from, message);
    return status == ASCC_OK ? check_points_of_bodies(from, message) : status;
}

static void become_bodies(ascc_particles *particles, const snapshot *from)
{
    for (size_t b = 0; b < from->body_count; b++) {
        particles->bodies[b] = get_body(from, b);
        (void)ascc_rotation_normalize(particles->bodies[b].rotation);
    }
    particles->body_count = from->body_count;
    particles->next_body = from->next_body;
    for (size_t row = 0; row < particles->boundary_count; row++) /* old snapshots do not say */
        if (particles->wall_body[row] >= particles->next_body)
            particles->next_body = (int64_t)particles->wall_body[row] + 1;
}

static void become(ascc_particles *particles, const snapshot *from)
{
    particles->spacing = from->spacing;
    particles->default_mass = from->mass;
    particles->quantum = from->quantum;
    particles->next_id = from->next_id;
    particles->fluid_count = from->rows[ASCC_FLUID];
    particles->boundary_count = from->rows[ASCC_BOUNDARY];
    for (int kind = 0; kind < ASCC_KIND_COUNT; kind++)
        ascc_particles_zero_rows(particles, (ascc_kind)kind, 0, from->rows[kind]);
    for (size_t i = 0; i < from->fields; i++) {
        const ascc_particle_field *const field = &ascc_particle_fields[i];
        unsigned char *const numbers = ascc_field_rows(particles, field);
        const size_t count = from->rows[field->kind] *
                             (size_t)ascc_field_numbers(field, from->dimension, from->past);
        for (size_t k = 0; k < count; k++)
            (void)number_from_word(field, numbers, k, ascc_get_word(from->words[i] + 8 * k));
    }
    become_bodies(particles, from);
}

ascc_status ascc_particles_restore(ascc_particles *particles, const void *memory, size_t size)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    if (memory == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT, "memory: NULL");
    snapshot from = {0};
    const char *why = NULL;
    ascc_message message;
    if (!open_snapshot(memory, size, &from, &why))
        return ascc_particles_fail(particles, ASCC_ERROR_FORMAT, "memory: %s", why);
    if (from.dimension != particles->dimension)
        return ascc_particles_fail(particles, ASCC_ERROR_MISMATCH,
                                   "memory: a snapshot of dimension %ld, the set has %ld",
                                   (long)from.dimension, (long)particles->dimension);
    if (check_snapshot(&from, &message) != ASCC_OK)
        return ascc_particles_fail(particles, ASCC_ERROR_FORMAT, "memory: %s", message.text);
    const size_t fluid = from.rows[ASCC_FLUID], boundary = from.rows[ASCC_BOUNDARY];
    if (from.body_count > 0 &&
        !ascc_grow(&particles->context->allocator, (void **)&particles->bodies,
                   &particles->body_capacity, from.body_count, sizeof *particles->bodies))
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY, "out of memory for %zu bodies",
                                   from.body_count);
    if (!ascc_particles_arrange(particles, fluid, boundary, from.past))
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                   "out of memory for %zu fluid and %zu boundary particles", fluid,
                                   boundary);
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

/* What a row of a field adds to its particle's hash. */
static uint64_t mix_row(uint64_t hash, const ascc_particle_field *field, const unsigned char *rows,
                        size_t row, size_t numbers)
{
    uint64_t mixed = hash;
    bool zero = true;
    for (size_t k = row * numbers; k < (row + 1) * numbers; k++) {
        uint64_t word = number_word(field, rows, k);
        if (field->element == ASCC_REAL)
            word = ascc_bits_of(ascc_double_of(word) + 0.0); /* -0 + 0 is 0 */
        zero &= word == 0;
        mixed = mix(mixed, word);
    }
    return zero && field->hash == ASCC_HASH_NONZERO ? hash : mixed;
}

/* A sum over particles of what each one's hashed fields mix to, so that their order does not matter. */
static uint64_t sum_rows(const ascc_particles *particles, ascc_kind kind)
{
    uint64_t sum = 0;
    for (size_t row = 0; row < ascc_particles_count(particles, kind); row++) {
        uint64_t one = mix(0, kind);
        for (size_t i = 0; i < ASCC_FIELD_COUNT; i++) {
            const ascc_particle_field *const field = &ascc_particle_fields[i];
            if (field->kind == kind && field->hash != ASCC_HASH_NEVER)
                one = mix_row(
                    one, field, ascc_field_rows(particles, field), row,
                    (size_t)ascc_field_numbers(field, particles->dimension, particles->past_count));
        }
        sum += one;
    }
    return sum;
}

/* Likewise over bodies: nothing without any. */
static uint64_t sum_bodies(const ascc_particles *particles)
{
    uint64_t sum = 0;
    for (size_t b = 0; b < particles->body_count; b++) {
        const struct ascc_body *const body = &particles->bodies[b];
        uint64_t one = mix(0, ASCC_KIND_COUNT);
        one = mix(one, (uint64_t)body->number);
        for (int c = 0; c < 3; c++) {
            one = mix(one, ascc_bits_of(body->position[c] + 0.0));
            one = mix(one, ascc_bits_of(body->velocity[c] + 0.0));
            one = mix(one, ascc_bits_of(body->spin[c] + 0.0));
        }
        for (int c = 0; c < 4; c++)
            one = mix(one, ascc_bits_of(body->rotation[c] + 0.0));
        sum += mix(one, ascc_bits_of(body->angle + 0.0));
    }
    return sum;
}

uint64_t ascc_fluid_hash(const ascc_particles *particles)
{
    return sum_rows(particles, ASCC_FLUID);
}

uint64_t ascc_whole_hash(const ascc_particles *particles, size_t fluid, uint64_t fluid_hash)
{
    uint64_t hash = mix(0, ascc_particles_width(particles));
    hash = mix(hash, fluid);
    hash = mix(hash, particles->boundary_count);
    hash = mix(hash, ascc_bits_of(particles->quantum));
    return hash + fluid_hash + sum_rows(particles, ASCC_BOUNDARY) + sum_bodies(particles);
}

uint64_t ascc_particles_hash(const ascc_particles *particles)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return 0;
    return ascc_whole_hash(particles, particles->fluid_count, ascc_fluid_hash(particles));
}
