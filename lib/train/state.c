/* The trainer's files: the model as it is now, and all that training goes on from.
 * SPDX-License-Identifier: MIT */
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "trainer.h"

#define FAIL(status, ...) ascc_fail(&t->message, status, __VA_ARGS__)

/* The arrays of one block, in its order. */
static const char *const names[] = {"weights", "average", "moment1", "moment2"};

const void *ascc_trainer_model(ascc_trainer *t, int32_t averaged, size_t *size)
{
    if (!ascc_trainer_alive(t) || !size)
        return NULL;
    const bool average = averaged && t->options.average > 0.0;
    ascc_safetensors *file = average ? &t->averaged_file : &t->file;
    for (size_t i = 0; i < t->tensor_count; i++)
        memcpy((unsigned char *)file->tensor[i].data,
               (average ? t->average : t->weights) + t->tensor[i].first,
               t->tensor[i].count * sizeof(float));
    *size = t->byte_count;
    return average ? t->averaged_bytes : t->bytes;
}

/* Of the network, whatever its weights: FNV-1a of the file's header. */
static uint64_t network_hash(const ascc_trainer *t)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (size_t i = 0; i < t->header_count; i++)
        hash = (hash ^ t->bytes[i]) * 0x100000001b3u;
    return hash;
}

static bool write_state(const ascc_trainer *t, FILE *file)
{
    char header[1024];
    const size_t bytes = t->parameter_count * sizeof(float);
    int length = snprintf(header, sizeof header,
                          "{\"__metadata__\":{\"format\":\"ascc.trainer\",\"version\":\"1\","
                          "\"iteration\":\"%" PRIu64 "\",\"network\":\"%016" PRIx64 "\"}",
                          t->iteration, network_hash(t));
    for (size_t i = 0; i < 4; i++)
        length += snprintf(header + length, sizeof header - (size_t)length,
                           ",\"%s\":{\"dtype\":\"F32\",\"shape\":[%zu],\"data_offsets\":[%zu,%zu]}",
                           names[i], t->parameter_count, i * bytes, (i + 1) * bytes);
    length += snprintf(header + length, sizeof header - (size_t)length, "}");
    while (length % 8)
        header[length++] = ' ';
    unsigned char size[8];
    for (int i = 0; i < 8; i++)
        size[i] = (unsigned char)((uint64_t)length >> (8 * i));
    return fwrite(size, 1, 8, file) == 8 &&
           fwrite(header, 1, (size_t)length, file) == (size_t)length &&
           fwrite(t->weights, sizeof(float), 4 * t->parameter_count, file) ==
               4 * t->parameter_count &&
           fflush(file) == 0 && fsync(fileno(file)) == 0;
}

ascc_status ascc_trainer_save(const ascc_trainer *trainer, const char *path)
{
    if (!ascc_trainer_alive(trainer) || !path)
        return ASCC_ERROR_ARGUMENT;
    ascc_trainer *t = (ascc_trainer *)trainer; /* a failure's message is the one change */
    const size_t length = strlen(path) + 5;
    char *beside = ascc_allocate(&t->allocator, length, 1);
    if (!beside)
        return FAIL(ASCC_ERROR_MEMORY, "no memory to save");
    snprintf(beside, length, "%s.tmp", path);
    errno = 0;
    FILE *file = fopen(beside, "wb");
    bool good = file && write_state(t, file);
    int why = errno;
    if (file && fclose(file) != 0 && good) {
        good = false;
        why = errno;
    }
    if (good && rename(beside, path) != 0) {
        good = false;
        why = errno;
    }
    if (!good && file)
        remove(beside);
    ascc_release(&t->allocator, beside, length, 1);
    if (!good)
        return FAIL(ASCC_ERROR_FILE, "cannot write '%s': %s", path, strerror(why));
    return ASCC_OK;
}

static ascc_status read_state(ascc_trainer *t, const char *path, ascc_safetensors *file)
{
    const char *format = ascc_safetensors_metadata(file, "format");
    const char *version = ascc_safetensors_metadata(file, "version");
    const char *iteration = ascc_safetensors_metadata(file, "iteration");
    const char *network = ascc_safetensors_metadata(file, "network");
    if (!format || strcmp(format, "ascc.trainer") != 0 || !version || strcmp(version, "1") != 0 ||
        !iteration || !network)
        return FAIL(ASCC_ERROR_FORMAT, "'%s' is not the state of a trainer", path);
    if (strtoull(network, NULL, 16) != network_hash(t))
        return FAIL(ASCC_ERROR_MISMATCH, "'%s' is the state of another network", path);
    for (size_t i = 0; i < 4; i++) {
        const int32_t k = ascc_safetensors_find(file, names[i]);
        if (k < 0 || file->tensor[k].count != t->parameter_count)
            return FAIL(ASCC_ERROR_FORMAT, "'%s': tensor '%s' is missing or of another size", path,
                        names[i]);
        if (strcmp(file->tensor[k].type, "F32") != 0)
            return FAIL(ASCC_ERROR_FORMAT, "'%s': tensor '%s' is not F32", path, names[i]);
    }
    for (size_t i = 0; i < 4; i++)
        memcpy(t->weights + i * t->parameter_count,
               file->tensor[ascc_safetensors_find(file, names[i])].data,
               t->parameter_count * sizeof(float));
    t->iteration = strtoull(iteration, NULL, 10);
    t->changed = false;
    t->in_vain = t->deaf = 0;
    ascc_trainer_apply(t);
    return ASCC_OK;
}

ascc_status ascc_trainer_load(ascc_trainer *t, const char *path)
{
    if (!ascc_trainer_alive(t) || !path)
        return ASCC_ERROR_ARGUMENT;
    FILE *stream = fopen(path, "rb");
    if (!stream)
        return FAIL(ASCC_ERROR_FILE, "cannot open '%s': %s", path, strerror(errno));
    const size_t most = 16 * t->parameter_count + 65536;
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
