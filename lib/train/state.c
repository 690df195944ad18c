/* The trainer's files: the model as it is now, and all that training goes on from.
 * SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "file/paths.h"
#include "file/write_file.h"
#include "trainer.h"

#define FAIL(...) ascc_trainer_fail(t, __VA_ARGS__)

/* The arrays of one block, in its order. */
enum { WEIGHTS, AVERAGE, MOMENT1, MOMENT2, ARRAYS };
static const char *const names[] = {"weights", "average", "moment1", "moment2"};
static const char WHITENING[] = "whitening"; /* what the moments are seen through, if anything */

#define MAX_ITERATION ((uint64_t)1 << 53)

/* The model file of these weights, in bytes[byte_count] that hold its header. */
static void fill_model(const ascc_trainer *t, const float *weights, unsigned char *bytes)
{
    for (size_t i = 0; i < t->tensor_count; i++)
        memcpy(bytes + (t->file.tensor[i].data - t->bytes), weights + t->tensor[i].first,
               t->tensor[i].count * sizeof(float));
    ascc_learned_write(&t->learned, weights + t->learned.first, bytes);
}

const void *ascc_trainer_model(ascc_trainer *t, int32_t averaged, size_t *size)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t) || !size)
        return NULL;
    const bool average = averaged && t->options.average > 0.0;
    unsigned char *bytes = average ? t->averaged_bytes : t->bytes;
    fill_model(t, average ? t->average : t->weights, bytes);
    *size = t->byte_count;
    return bytes;
}

/* Of the network, whatever its weights and what it learns besides: FNV-1a of the file's header. */
static uint64_t network_hash(const ascc_trainer *t)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < t->header_count; i++)
        hash = (hash ^ (ascc_learned_covers(&t->learned, i) ? ' ' : t->bytes[i])) * 0x100000001b3u;
    return hash;
}

/* ---- Saving ---- */

ascc_status ascc_trainer_save(ascc_trainer *t, const char *path)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!path)
        return FAIL(ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    char header[1024];
    const size_t bytes = t->parameter_count * sizeof(float);
    const size_t white = t->whitening.ready ? t->whitening.number_count * sizeof(float) : 0;
    int length = snprintf(header, sizeof header,
                          "{\"__metadata__\":{\"format\":\"ascc.trainer\",\"version\":\"1\","
                          "\"iteration\":\"%" PRIu64 "\",\"network\":\"%016" PRIx64 "\"}",
                          t->iteration, network_hash(t));
    for (size_t i = 0; i < ARRAYS; i++)
        length += snprintf(header + length, sizeof header - (size_t)length,
                           ",\"%s\":{\"dtype\":\"F32\",\"shape\":[%zu],\"data_offsets\":[%zu,%zu]}",
                           names[i], t->parameter_count, i * bytes, (i + 1) * bytes);
    if (white)
        length +=
            snprintf(header + length, sizeof header - (size_t)length,
                     ",\"%s\":{\"dtype\":\"F32\",\"shape\":[%zu],\"data_offsets\":[%zu,%zu]}",
                     WHITENING, t->whitening.number_count, ARRAYS * bytes, ARRAYS * bytes + white);
    length += snprintf(header + length, sizeof header - (size_t)length, "}");
    while (length % 8)
        header[length++] = ' ';
    unsigned char size[8];
    for (int i = 0; i < 8; i++)
        size[i] = (unsigned char)((uint64_t)length >> (8 * i));
    const ascc_bytes piece[] = {{size, sizeof size},
                                {header, (size_t)length},
                                {t->weights, ARRAYS * bytes},
                                {t->whitening.number, white}};
    const ascc_status status =
        ascc_write_file(path, piece, sizeof piece / sizeof *piece, &t->message);
    return status == ASCC_OK ? status : FAIL(status, "%s", t->message.text);
}

/* ---- Loading ---- */

/* Digits alone. 2^53 is beyond all training, and a log counts in doubles. */
static bool read_iteration(const char *text, uint64_t *iteration)
{
    uint64_t value = 0;
    const char *c = text;
    for (; *c >= '0' && *c <= '9' && value <= MAX_ITERATION; c++)
        value = 10 * value + (uint64_t)(*c - '0');
    *iteration = value;
    return c != text && *c == '\0' && value <= MAX_ITERATION;
}

static ascc_status check_metadata(ascc_trainer *t, const char *path, ascc_safetensors *file,
                                  uint64_t *iteration)
{
    const char *format = ascc_safetensors_metadata(file, "format");
    const char *version = ascc_safetensors_metadata(file, "version");
    const char *count = ascc_safetensors_metadata(file, "iteration");
    const char *network = ascc_safetensors_metadata(file, "network");
    char own[20];
    if (!format || strcmp(format, "ascc.trainer") != 0 || !version || strcmp(version, "1") != 0 ||
        !count || !network)
        return FAIL(ASCC_ERROR_FORMAT, "'%s' is not the state of a trainer", path);
    (void)snprintf(own, sizeof own, "%016" PRIx64, network_hash(t));
    if (strcmp(network, own) != 0)
        return FAIL(ASCC_ERROR_MISMATCH, "'%s' is the state of another network", path);
    if (!read_iteration(count, iteration))
        return FAIL(ASCC_ERROR_FORMAT, "'%s': iteration '%s' is none", path,
                    ascc_quote(count).text);
    return ASCC_OK;
}

/* values[count] = the array of that name. */
static ascc_status read_array(ascc_trainer *t, const char *path, const ascc_safetensors *file,
                              const char *name, size_t count, float *values)
{
    ascc_message why = {""};
    const int32_t k = ascc_safetensors_find(file, name);
    if (k < 0 || file->tensor[k].count != count)
        return FAIL(ASCC_ERROR_FORMAT, "'%s': tensor '%s' is missing or of another size", path,
                    name);
    if (strcmp(file->tensor[k].type, "F32") != 0)
        return FAIL(ASCC_ERROR_FORMAT, "'%s': tensor '%s' is not F32", path, name);
    if (ascc_tensor_read_floats(&file->tensor[k], values, &why) != ASCC_OK)
        return FAIL(ASCC_ERROR_FORMAT, "'%s': %s", path, why.text);
    return ASCC_OK;
}

/* Weights that no model may have are none of a state either. */
static ascc_status check_weights(ascc_trainer *t, const char *path, const char *name,
                                 const float *weights)
{
    ascc_model *model = NULL;
    unsigned char *bytes = ascc_allocate(&t->allocator, t->byte_count, 1);
    if (!bytes)
        return FAIL(ASCC_ERROR_MEMORY, "no memory to check '%s'", path);
    memcpy(bytes, t->bytes, t->byte_count);
    fill_model(t, weights, bytes);
    ascc_status status = ascc_model_load_memory(t->context, bytes, t->byte_count, &model);
    ascc_release(&t->allocator, bytes, t->byte_count, 1);
    ascc_model_destroy(&model);
    if (status != ASCC_OK) {
        char why[ASCC_MESSAGE_CAPACITY];
        (void)ascc_context_message(t->context, why, sizeof why);
        FAIL(status, "'%s': tensor '%s': %s", path, name, why);
    }
    return status;
}

/* state[ARRAYS][parameter_count] = the file's, if training can go on from it. */
static ascc_status read_arrays(ascc_trainer *t, const char *path, const ascc_safetensors *file,
                               float *state)
{
    const size_t n = t->parameter_count;
    ascc_status status = ASCC_OK;
    for (size_t i = 0; i < ARRAYS && status == ASCC_OK; i++)
        status = read_array(t, path, file, names[i], n, state + i * n);
    for (size_t i = 0; i < n && status == ASCC_OK; i++)
        if (state[MOMENT2 * n + i] < 0.0f)
            status = FAIL(ASCC_ERROR_FORMAT, "'%s': tensor '%s': value %zu is negative", path,
                          names[MOMENT2], i);
    if (status == ASCC_OK && !ascc_learned_takes(&t->learned, state + t->learned.first))
        status = FAIL(ASCC_ERROR_FORMAT, "'%s': constants that no model may have", path);
    for (size_t i = 0; i < MOMENT1 && status == ASCC_OK; i++)
        status = check_weights(t, path, names[i], state + i * n);
    return status;
}

/* Moments mean something only through the whitening that they were made with. Before the first iteration there are
 * none, and whitening is measured then. */
static ascc_status read_whitening(ascc_trainer *t, const char *path, const ascc_safetensors *file,
                                  uint64_t iteration, float *number, bool *there)
{
    const bool wanted = t->whitening.term_count > 0;
    *there = ascc_safetensors_find(file, WHITENING) >= 0;
    if (*there != wanted && (*there || iteration > 0))
        return FAIL(ASCC_ERROR_MISMATCH, "'%s' is of training %s whitened inputs", path,
                    *there ? "with" : "without");
    return *there ? read_array(t, path, file, WHITENING, t->whitening.number_count, number)
                  : ASCC_OK;
}

/* Everything is read and checked before anything changes. */
static ascc_status read_state(ascc_trainer *t, const char *path, ascc_safetensors *file)
{
    uint64_t iteration = 0;
    ascc_status status = check_metadata(t, path, file, &iteration);
    if (status != ASCC_OK)
        return status;
    const size_t own = ARRAYS * t->parameter_count, white = t->whitening.number_count;
    bool whitened = false;
    float *state = ascc_allocate(&t->allocator, own + white, sizeof *state);
    if (!state)
        return FAIL(ASCC_ERROR_MEMORY, "no memory to read '%s'", path);
    status = read_arrays(t, path, file, state);
    if (status == ASCC_OK)
        status = read_whitening(t, path, file, iteration, state + own, &whitened);
    if (status == ASCC_OK) {
        memcpy(t->weights, state, own * sizeof *state);
        if (whitened)
            memcpy(t->whitening.number, state + own, white * sizeof *state);
        t->whitening.ready = whitened;
        t->iteration = iteration;
        t->changed = false;
        t->failed_iterations = t->zero_gradient_count = 0;
        ascc_trainer_apply(t);
    }
    ascc_release(&t->allocator, state, own + white, sizeof *state);
    return status;
}

ascc_status ascc_trainer_load(ascc_trainer *t, const char *path)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_trainer_alive(t))
        return ASCC_ERROR_ARGUMENT;
    if (!path)
        return FAIL(ASCC_ERROR_ARGUMENT, "trainer: a NULL argument");
    FILE *stream = ascc_path_open(path);
    if (!stream)
        return FAIL(ASCC_ERROR_FILE, "cannot open '%s': %s", path, strerror(errno));
    const size_t most = 16 * t->parameter_count + 4 * t->whitening.number_count + 65536;
    unsigned char *bytes = ascc_allocate(&t->allocator, most, 1);
    const size_t size = bytes ? fread(bytes, 1, most, stream) : 0;
    const bool broken = ferror(stream) != 0;
    fclose(stream);
    ascc_safetensors file;
    ascc_status status = ASCC_OK;
    if (!bytes)
        return FAIL(ASCC_ERROR_MEMORY, "no memory to read '%s'", path);
    if (broken)
        status = FAIL(ASCC_ERROR_FILE, "cannot read '%s'", path);
    if (status == ASCC_OK) {
        ascc_message why;
        status = ascc_safetensors_open(&t->allocator, bytes, size, &file, &why);
        if (status != ASCC_OK)
            FAIL(status, "'%s': %s", path, why.text);
        else {
            status = read_state(t, path, &file);
            ascc_safetensors_close(&file);
        }
    }
    ascc_release(&t->allocator, bytes, most, 1);
    return status;
}
