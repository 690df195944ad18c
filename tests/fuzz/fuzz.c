/* What fuzz targets share. SPDX-License-Identifier: MIT */
#define _XOPEN_SOURCE 700 /* nftw */
#include "fuzz.h"

#include <ftw.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

void fuzz_check(int holds, const char *text, const char *file, int line)
{
    if (holds)
        return;
    fprintf(stderr, "%s:%d: does not hold: %s\n", file, line, text);
    abort();
}

/* ---- Numbers ---- */

uint64_t fuzz_take(fuzz_input *input, size_t bytes)
{
    uint64_t value = 0;
    for (size_t i = 0; i < bytes && input->left; i++, input->at++, input->left--)
        value |= (uint64_t)*input->at << 8 * i;
    return value;
}

float fuzz_take_float(fuzz_input *input)
{
    const uint32_t bits = (uint32_t)fuzz_take(input, 4);
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* ---- Files ---- */

static char folder[512];
static pid_t folder_owner;

static int remove_entry(const char *path, const struct stat *about, int type, struct FTW *walk)
{
    (void)about;
    (void)type;
    return walk->level > 0 ? remove(path) : 0;
}

void fuzz_clear_folder(void)
{
    (void)nftw(fuzz_folder(), remove_entry, 8, FTW_DEPTH | FTW_PHYS);
}

static void drop_folder(void)
{
    if (folder_owner == getpid()) {
        fuzz_clear_folder();
        (void)rmdir(folder);
    }
}

const char *fuzz_folder(void)
{
    if (!folder_owner) {
        const char *at = getenv("TMPDIR");
        (void)snprintf(folder, sizeof folder, "%s/ascc-fuzz-XXXXXX", at && *at ? at : "/tmp");
        fuzz_require(mkdtemp(folder) != NULL);
        folder_owner = getpid();
        (void)atexit(drop_folder);
    }
    return folder;
}

const char *fuzz_file(const char *name, const void *data, size_t size)
{
    static char path[600];
    (void)snprintf(path, sizeof path, "%s/%s", fuzz_folder(), name);
    FILE *file = fopen(path, "wb");
    fuzz_require(file != NULL);
    fuzz_require(fwrite(data, 1, size, file) == size);
    fuzz_require(fclose(file) == 0);
    return path;
}

unsigned char *fuzz_with_header(const uint8_t *data, size_t size, size_t *made)
{
    const uint8_t *end = size ? memchr(data, 0xff, size) : NULL;
    const size_t length = end ? (size_t)(end - data) : size, rest = end ? size - length - 1 : 0;
    unsigned char *bytes = malloc(8 + length + rest);
    fuzz_require(bytes != NULL);
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)((uint64_t)length >> 8 * i);
    memcpy(bytes + 8, data, length);
    if (rest > 0)
        memcpy(bytes + 8 + length, end + 1, rest);
    *made = 8 + length + rest;
    return bytes;
}

/* ---- Steps ---- */

void fuzz_named(ascc_status status, const char *message)
{
    if (status == ASCC_OK)
        return;
    fuzz_require(status < 0 && status >= ASCC_ERROR_LIMIT);
    fuzz_require(message != NULL && message[0] != '\0');
}

void fuzz_load(ascc_context *context, const void *bytes, size_t size, ascc_model **model)
{
    char text[256] = "";
    const ascc_status status = ascc_model_load_memory(context, bytes, size, model);
    (void)ascc_context_message(context, text, sizeof text);
    fuzz_check(status == ASCC_OK, text, __FILE__, __LINE__);
}

static void check_state(const ascc_particles *particles)
{
    const size_t count = ascc_particles_count(particles, ASCC_FLUID);
    for (size_t i = 0; i < count; i++) {
        double x[3] = {0}, v[3] = {0};
        const ascc_array position = {.data = x, .scalar = ASCC_DOUBLE};
        const ascc_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
        fuzz_require(ascc_particles_get(particles, ASCC_FLUID, ASCC_POSITION, i, 1, &position) ==
                     ASCC_OK);
        fuzz_require(ascc_particles_get(particles, ASCC_FLUID, ASCC_VELOCITY, i, 1, &velocity) ==
                     ASCC_OK);
        for (int c = 0; c < 3; c++)
            fuzz_require(isfinite(x[c]));
    }
}

void fuzz_step(ascc_step *step, ascc_particles *particles, const ascc_model *model)
{
    ascc_model_info info = {.size = sizeof info};
    ascc_step_statistics s = {.size = sizeof s};
    ascc_measures measures = {.size = sizeof measures};
    const uint64_t before = ascc_particles_hash(particles);
    const ascc_status status = ascc_step_run(step, particles, NULL, 1);
    fuzz_named(status, ascc_step_message(step));
    fuzz_require(ascc_step_get_statistics(step, &s) == ASCC_OK);
    fuzz_require(ascc_model_get_info(model, &info) == ASCC_OK);
    fuzz_require(status == ASCC_OK || ascc_particles_hash(particles) == before);
    fuzz_require(s.steps == (status == ASCC_OK));
    for (int c = 0; c < 3 && status == ASCC_OK && info.conserves_momentum; c++)
        fuzz_require((uint64_t)s.momentum_before[c] + (uint64_t)s.external_impulse[c] -
                         (uint64_t)s.wall_impulse[c] ==
                     (uint64_t)s.momentum_after[c]);
    check_state(particles);
    fuzz_named(ascc_particles_measure(particles, &measures), ascc_particles_message(particles));
}

/* A block of fluid over a floor with a corner. */
static ascc_status fill(ascc_particles *particles, int d, double spacing)
{
    double x[64][3], n[64][3] = {{0}};
    const ascc_const_array position = {.data = x, .stride = sizeof *x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = n, .stride = sizeof *n, .scalar = ASCC_DOUBLE};
    const int side = d == 2 ? 5 : 3;
    size_t count = 0;
    for (int i = 0; i < (d == 2 ? side * side : side * side * side); i++, count++) {
        const int at[3] = {i % side, i / side % side, i / side / side};
        for (int c = 0; c < 3; c++)
            x[count][c] = (at[c] + 0.1 * ((i * 7 + c * 3) % 5) + 0.5) * spacing;
    }
    x[1][0] = x[0][0]; /* two at one place */
    x[1][1] = x[0][1];
    x[1][2] = x[0][2];
    ascc_status status = ascc_particles_add_fluid(particles, count, &position, NULL, NULL, NULL);
    for (count = 0; count < 24; count++) {
        const int k = (int)count / 2;
        for (int c = 0; c < 3; c++)
            x[count][c] = n[count][c] = 0.0;
        x[count][count % 2] = (d == 2 ? k - 2 : k % 4 - 0.5) * 0.9 * spacing;
        x[count][2] = (d == 2 ? 0 : k / 4) * 0.9 * spacing;
        n[count][1 - count % 2] = 1.0;
    }
    if (status == ASCC_OK)
        status = ascc_particles_add_boundary(particles, count, &position, &normal, 0, NULL);
    return status;
}

void fuzz_step_model(ascc_context *context, const ascc_model *model)
{
    ascc_model_info info = {.size = sizeof info};
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    char text[256] = "";
    fuzz_require(ascc_model_get_info(model, &info) == ASCC_OK);
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = info.dimension,
                                            .spacing = info.particle_spacing,
                                            .mass = 0.125};
    ascc_status status = ascc_particles_create(context, &options, &particles);
    const ascc_step_options measured = {.size = sizeof measured, .measure_distance = 1};
    if (status == ASCC_OK)
        status = ascc_step_create(context, model, &measured, &step);
    (void)ascc_context_message(context, text, sizeof text);
    fuzz_named(status, text);
    if (status == ASCC_OK) {
        status = fill(particles, info.dimension, info.particle_spacing);
        fuzz_named(status, ascc_particles_message(particles));
    }
    for (int n = 0; n < 3 && status == ASCC_OK; n++)
        fuzz_step(step, particles, model);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
}
