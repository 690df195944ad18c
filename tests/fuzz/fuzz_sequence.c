/* Reads a sequence file from bytes; what is read is stepped, inspected, and written again.
 * SPDX-License-Identifier: MIT
 *
 * The first byte says what the rest is: 'f' a whole file, 'h' a header; what follows a byte 0xff is the data.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../../examples/demo_model.h"
#include "fuzz.h"
#include "inspect.h"
#include "sequence.h"

enum { MOST = 300 /* particles, of either kind, that are stepped */ };

static void check_floats(const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        fuzz_require(isfinite(values[i]));
}

static void check(const ascc_sequence *s)
{
    const size_t d = (size_t)s->dimension;
    fuzz_require(d == 2 || d == 3);
    fuzz_require(s->time_step > 0.0 && s->radius > 0.0 && s->mass > 0.0 && s->rest_density > 0.0);
    fuzz_require(s->frames > 0 && s->first_layer <= s->walls);
    fuzz_require(s->velocity_frames == 1 || s->velocity_frames == s->frames);
    check_floats(s->position, s->frames * s->count * d);
    check_floats(s->velocity, s->velocity_frames * s->count * d);
    check_floats(s->wall, s->walls * d);
    check_floats(s->normal, s->walls * d);
    fuzz_require(memchr(s->source, '\0', sizeof s->source) != NULL);
}

/* As `ascc sim demo SEQUENCE` does. */
static void step(const ascc_sequence *s)
{
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    size_t size;
    unsigned char *bytes = demo_model_bytes(s->dimension, 2.0 * s->radius, &size);
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = s->dimension,
                                            .spacing = 2.0 * s->radius,
                                            .mass = s->mass};
    const ascc_const_array x = {.data = s->position}, v = {.data = s->velocity};
    const ascc_const_array wall = {.data = s->wall}, normal = {.data = s->normal};
    fuzz_require(ascc_context_create(NULL, &context) == ASCC_OK);
    if (bytes && ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK &&
        ascc_particles_create(context, &options, &particles) == ASCC_OK &&
        ascc_particles_add_fluid(particles, s->count, &x, &v, NULL, NULL) == ASCC_OK &&
        ascc_particles_add_boundary(particles, s->walls, &wall, &normal, 0, NULL) == ASCC_OK &&
        ascc_step_create(context, model, NULL, &step) == ASCC_OK)
        fuzz_step(step, particles, model);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    free(bytes);
}

/* As `ascc lint SEQUENCE` does. */
static void look(const ascc_sequence *s)
{
    inspect_input input = {.dimension = s->dimension,
                           .frames = s->frames,
                           .count = s->count,
                           .time_step = s->time_step,
                           .spacing = 2.0 * s->radius,
                           .position = s->position,
                           .velocity = s->velocity_frames ? s->velocity : NULL,
                           .walls = s->first_layer,
                           .wall = s->wall,
                           .normal = s->normal};
    const inspect_limits limits = {0};
    inspection found;
    memcpy(input.gravity, s->gravity, sizeof input.gravity);
    (void)inspect(&input, &limits, &found);
}

/* What is written is what was read. */
static void write_again(const ascc_sequence *s)
{
    char error[768] = "", path[600];
    const size_t n = s->count * (size_t)s->dimension;
    const bool all = s->velocity_frames == s->frames;
    (void)snprintf(path, sizeof path, "%s/again.safetensors", fuzz_folder());
    ascc_sequence_writer *writer = ascc_sequence_create(path, s, all, error, sizeof error);
    fuzz_require(writer != NULL);
    for (size_t f = 0; f < s->frames; f++)
        fuzz_require(ascc_sequence_append(writer, s->position + f * n,
                                          all || f == 0 ? s->velocity + (all ? f * n : 0) : NULL,
                                          error, sizeof error));
    fuzz_require(ascc_sequence_finish(writer, true, error, sizeof error));
    ascc_sequence again;
    fuzz_require(ascc_sequence_read(path, &again, error, sizeof error));
    fuzz_require(again.frames == s->frames && again.count == s->count && again.walls == s->walls);
    fuzz_require(memcmp(again.position, s->position, s->frames * n * sizeof(float)) == 0);
    fuzz_require(memcmp(again.velocity, s->velocity, s->velocity_frames * n * sizeof(float)) == 0);
    ascc_sequence_free(&again);
}

static void read_bytes(const void *bytes, size_t size)
{
    ascc_sequence s;
    char error[768] = "";
    if (!ascc_sequence_read(fuzz_file("s.safetensors", bytes, size), &s, error, sizeof error)) {
        fuzz_require(error[0] != '\0');
        return;
    }
    check(&s);
    if (s.count <= MOST && s.walls <= MOST) {
        step(&s);
        look(&s);
    }
    if (s.frames <= MOST)
        write_again(&s);
    ascc_sequence_free(&s);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size > 0 && data[0] == 'f')
        read_bytes(data + 1, size - 1);
    if (size > 0 && data[0] == 'h') {
        size_t made;
        unsigned char *bytes = fuzz_with_header(data + 1, size - 1, &made);
        read_bytes(bytes, made);
        free(bytes);
    }
    return 0;
}
