/* What fuzz targets share: promises, numbers from the input, files, and a small scene to step.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_FUZZ_H
#define ASCC_FUZZ_H

#include <stddef.h>
#include <stdint.h>

#include <ascc/ascc.h>

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

/* Aborts with its place, so that a fuzzer keeps the input, where a promise is broken. */
#define fuzz_require(condition) fuzz_check((condition) != 0, #condition, __FILE__, __LINE__)
void fuzz_check(int holds, const char *text, const char *file, int line);

/* The rest of an input, taken from its beginning; zeros behind its end. */
typedef struct fuzz_input {
    const uint8_t *at;
    size_t left;
} fuzz_input;

uint64_t fuzz_take(fuzz_input *input, size_t bytes); /* little-endian */
float fuzz_take_float(fuzz_input *input);

/* A folder for this process and those that it starts from then on; it goes when the process ends. */
const char *fuzz_folder(void);
/* Removes everything that lies in it. */
void fuzz_clear_folder(void);
/* The bytes as the file of that name in the folder: its path, in one buffer. */
const char *fuzz_file(const char *name, const void *data, size_t size);

/* Bytes of a safetensors file around a header that may be anything; what follows a byte 0xff is the data.
 * The caller's, from malloc. */
unsigned char *fuzz_with_header(const uint8_t *data, size_t size, size_t *made);

/* A failure has a name and a message. */
void fuzz_named(ascc_status status, const char *message);

/* Loads bytes that must be a model. */
void fuzz_load(ascc_context *context, const void *bytes, size_t size, ascc_model **model);

/* Some steps of the model on a few particles and walls at its spacing: each done with finite results and
 * exact momentum, or refused by name with nothing changed. */
void fuzz_step_model(ascc_context *context, const ascc_model *model);
/* One such step of this set. */
void fuzz_step(ascc_step *step, ascc_particles *particles, const ascc_model *model);

#endif
