/* Restores a particle set from bytes; what restores is stepped, and is its own snapshot's restoration.
 * SPDX-License-Identifier: MIT
 *
 * The first byte says what the rest is, so that the fuzzer reaches beyond the checksum and the counts:
 *   'r'  a whole snapshot
 *   's'  one whose last word becomes the right checksum
 *   'c'  dimension and earlier velocities, share of walls, then words from next id on; magic, version, counts, ids and checksum
 *        are made right
 * Bits 0 and 1 of the last byte choose a model.
 */
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "support/model_builder.h"

enum { HEADER = 9, BODY_WORDS = 21, MODELS = 4, MOST = 400 /* particles that are stepped */ };

static void put(unsigned char *bytes, size_t word, uint64_t value)
{
    for (int i = 0; i < 8; i++)
        bytes[8 * word + (size_t)i] = (unsigned char)(value >> 8 * i);
}

static uint64_t get(const unsigned char *bytes, size_t word)
{
    uint64_t value = 0;
    for (int i = 0; i < 8; i++)
        value |= (uint64_t)bytes[8 * word + (size_t)i] << 8 * i;
    return value;
}

static void seal(unsigned char *bytes, size_t words)
{
    uint64_t sum = UINT64_C(0x50414e5343435341);
    for (size_t i = 0; i + 1 < words; i++) {
        sum = (sum ^ get(bytes, i)) * UINT64_C(0x9e3779b97f4a7c15);
        sum ^= sum >> 32;
    }
    put(bytes, words - 1, sum);
}

/* Counts, ids and frame made right around words from next id on. The caller's, from malloc. */
static unsigned char *complete(const uint8_t *data, size_t size, size_t *made)
{
    fuzz_input in = {data, size};
    const uint64_t first = fuzz_take(&in, 1), past = first >> 1 & 3;
    const size_t d = 2 + (first & 1);
    const uint64_t share = fuzz_take(&in, 1);
    const size_t head = 4, given = in.left / 8, body = given > head ? given - head : 0;
    const size_t fluid_words = (2 + (size_t)past) * d + 3, wall_words = 6 * d + 2;
    const size_t walls = body * (size_t)share / 256 / wall_words;
    const size_t fluid = (body - walls * wall_words) / fluid_words;
    const size_t rows = HEADER + fluid * fluid_words + walls * wall_words;
    const size_t bodies = walls & 1, words = rows + bodies * BODY_WORDS + 3;
    unsigned char *bytes = calloc(words, 8);
    fuzz_require(bytes != NULL);
    put(bytes, 0, UINT64_C(0x50414e5343435341));
    put(bytes, 1, 4 | past << 32);
    put(bytes, 2, d);
    put(bytes, 3, fluid);
    put(bytes, 4, walls);
    for (size_t w = 5; w + 1 < words; w++)
        put(bytes, w, fuzz_take(&in, 8));
    const size_t fluid_ids = HEADER + fluid * (2 * d + 1);
    const size_t wall_ids = HEADER + fluid * (2 * d + 2) + walls * 3 * d;
    for (size_t i = 0; i < fluid; i++)
        put(bytes, fluid_ids + i, i + 1);
    for (size_t i = 0; i < walls; i++)
        put(bytes, wall_ids + i, fluid + i + 1);
    for (size_t w = rows - fluid; w < rows; w++) /* at rest: 32 bits */
        put(bytes, w, (uint64_t)(int64_t)(int32_t)(uint32_t)get(bytes, w));
    for (size_t i = 0; i < walls * bodies; i++) /* all of one body */
        put(bytes, wall_ids + walls + i, 0);
    if (bodies) {
        put(bytes, rows, 0);
        put(bytes, rows + 1, get(bytes, rows + 1) & 1);
        put(bytes, rows + 2, fluid + 1);
        put(bytes, rows + 3, fluid + walls + 1);
    }
    put(bytes, words - 3, UINT64_C(1) << 31);
    put(bytes, words - 2, bodies);
    seal(bytes, words);
    *made = 8 * words;
    return bytes;
}

typedef struct models {
    ascc_context *context;
    ascc_model *model[2][MODELS]; /* [dimension - 2] */
} models;

/* Made once: pairs by grid and by basis, walls that act, contact; a graph that sees the past. */
static const models *all_models(void)
{
    static models made;
    static const model_random kinds[MODELS] = {
        {.seed = 1, .levels = 2, .channels = 4, .cells = 2, .output_cells = 2},
        {.seed = 2, .channels = 4, .bumps = 2, .order = 1, .fluid_only = 1},
        {.seed = 3,
         .channels = 4,
         .bumps = 2,
         .order = 1,
         .fluid_only = 1,
         .motion = 1,
         .damping = 1,
         .walls = 1,
         .limit = 0.5,
         .contact = 0.4},
        {.seed = 4, .channels = 4, .graph = 1, .history = 2, .radius = 1.45, .plain = 1}};
    if (made.context)
        return &made;
    fuzz_require(ascc_context_create(NULL, &made.context) == ASCC_OK);
    for (int d = 2; d <= 3; d++)
        for (int k = 0; k < MODELS; k++) {
            model_random kind = kinds[k];
            size_t size;
            kind.dimension = d;
            unsigned char *bytes = model_builder_random(&kind, &size);
            fuzz_require(ascc_model_load_memory(made.context, bytes, size, &made.model[d - 2][k]) ==
                         ASCC_OK);
            free(bytes);
        }
    return &made;
}

static ascc_particles *empty_set(ascc_context *context, int32_t dimension)
{
    ascc_particles *particles = NULL;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = 0.05};
    fuzz_require(ascc_particles_create(context, &options, &particles) == ASCC_OK);
    return particles;
}

/* What a snapshot of the set restores is the set, to the byte. */
static void check_round_trip(ascc_context *context, const ascc_particles *particles)
{
    const size_t size = ascc_particles_snapshot_size(particles);
    unsigned char *first = malloc(size), *second = malloc(size);
    ascc_particles *twin = empty_set(context, ascc_particles_dimension(particles));
    fuzz_require(first && second);
    fuzz_require(ascc_particles_snapshot(particles, first, size) == ASCC_OK);
    fuzz_require(ascc_particles_restore(twin, first, size) == ASCC_OK);
    fuzz_require(ascc_particles_snapshot_size(twin) == size);
    fuzz_require(ascc_particles_snapshot(twin, second, size) == ASCC_OK);
    fuzz_require(memcmp(first, second, size) == 0);
    fuzz_require(ascc_particles_hash(twin) == ascc_particles_hash(particles));
    ascc_particles_destroy(&twin);
    free(first);
    free(second);
}

/* Readings, steps, one more particle, and a snapshot after each. */
static void use(const models *m, ascc_particles *particles, const ascc_model *model)
{
    ascc_step *step = NULL;
    int64_t total[3];
    uint64_t id = 0;
    const double at[3] = {0.0, 0.0, 0.0};
    const ascc_const_array position = {.data = at, .scalar = ASCC_DOUBLE};
    check_round_trip(m->context, particles);
    (void)ascc_particles_total_momentum(particles, total);
    (void)ascc_particles_body_impulse(particles, -1, NULL, total, NULL);
    fuzz_require(ascc_step_create(m->context, model, NULL, &step) == ASCC_OK);
    if (ascc_particles_count(particles, ASCC_FLUID) +
            ascc_particles_count(particles, ASCC_BOUNDARY) <=
        MOST)
        for (int n = 0; n < 2; n++) {
            fuzz_step(step, particles, model);
            check_round_trip(m->context, particles);
        }
    ascc_step_destroy(&step);
    const ascc_status added = ascc_particles_add_fluid(particles, 1, &position, NULL, NULL, &id);
    fuzz_named(added, ascc_particles_message(particles));
    if (added == ASCC_OK) {
        fuzz_require(ascc_particles_find(particles, id, NULL, NULL) == ASCC_OK);
        check_round_trip(m->context, particles);
        fuzz_require(ascc_particles_remove(particles, 1, &id) == ASCC_OK);
    }
}

static void restore(const unsigned char *bytes, size_t size, int choice)
{
    const models *m = all_models();
    for (int32_t d = 2; d <= 3; d++) {
        ascc_particles *particles = empty_set(m->context, d);
        const uint64_t before = ascc_particles_hash(particles);
        const ascc_status status = ascc_particles_restore(particles, bytes, size);
        fuzz_named(status, ascc_particles_message(particles));
        if (status == ASCC_OK)
            use(m, particles, m->model[d - 2][choice]);
        else
            fuzz_require(ascc_particles_hash(particles) == before);
        ascc_particles_destroy(&particles);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size < 2)
        return 0;
    const int choice = data[size - 1] % MODELS;
    if (data[0] == 'c') {
        size_t made;
        unsigned char *bytes = complete(data + 1, size - 1, &made);
        restore(bytes, made, choice);
        free(bytes);
    } else if (data[0] == 's' && size >= 9) {
        const size_t words = (size - 1) / 8;
        unsigned char *bytes = malloc(8 * words);
        fuzz_require(bytes != NULL);
        memcpy(bytes, data + 1, 8 * words);
        seal(bytes, words);
        restore(bytes, 8 * words, choice);
        free(bytes);
    } else if (data[0] == 'r') {
        restore(data + 1, size - 1, choice);
    }
    return 0;
}
