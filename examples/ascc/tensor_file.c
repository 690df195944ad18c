/* Safetensors files as the program holds them: bytes, of which the header is JSON.
 * SPDX-License-Identifier: MIT */
#include "tensor_file.h"

#include <errno.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

#define MAX_HEADER ((size_t)16 << 20)

unsigned char *ascc_tensor_file_read(const char *path, size_t *size, char *error, size_t capacity)
{
    ascc_about about;
    FILE *in = ascc_system_open(path, "rb");
    if (!in || !ascc_system_look(path, &about)) {
        (void)snprintf(error, capacity, "%s", strerror(errno));
        if (in)
            (void)fclose(in);
        return NULL;
    }
    if (!about.regular) {
        (void)fclose(in);
        (void)snprintf(error, capacity, "is no regular file");
        return NULL;
    }
    *size = (size_t)about.size;
    unsigned char *bytes = malloc(*size + 1);
    const bool good = bytes && fread(bytes, 1, *size, in) == *size;
    (void)fclose(in);
    if (good)
        return bytes;
    free(bytes);
    (void)snprintf(error, capacity, "cannot be read");
    return NULL;
}

json_t *ascc_tensor_file_header(const unsigned char *bytes, size_t size, size_t *data, char *error,
                                size_t capacity)
{
    uint64_t length = 0;
    if (size < 8) {
        (void)snprintf(error, capacity, "is too short for a safetensors file");
        return NULL;
    }
    for (int i = 0; i < 8; i++)
        length |= (uint64_t)bytes[i] << 8 * i;
    if (length > MAX_HEADER || length > size - 8) {
        (void)snprintf(error, capacity, "the header of %llu bytes is longer than the file",
                       (unsigned long long)length);
        return NULL;
    }
    *data = 8 + (size_t)length;
    json_error_t why = {.text = "no object"};
    json_t *header =
        json_loadb((const char *)bytes + 8, (size_t)length, JSON_REJECT_DUPLICATES, &why);
    if (json_is_object(header))
        return header;
    json_decref(header);
    (void)snprintf(error, capacity, "the header is not JSON: %s",
                   ascc_tensor_file_harmless(why.text));
    return NULL;
}

const char *ascc_tensor_file_metadata(const json_t *header, const char *key)
{
    return json_string_value(json_object_get(json_object_get(header, "__metadata__"), key));
}

unsigned char *ascc_tensor_file_build(const json_t *header, const void *data, size_t data_size,
                                      size_t *size)
{
    const size_t length = json_dumpb(header, NULL, 0, JSON_COMPACT);
    const size_t padded = (length + 7) & ~(size_t)7;
    unsigned char *bytes = length ? malloc(8 + padded + data_size) : NULL;
    if (!bytes)
        return NULL;
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)((uint64_t)padded >> 8 * i);
    memset(bytes + 8, ' ', padded);
    if (json_dumpb(header, (char *)bytes + 8, padded, JSON_COMPACT) != length) {
        free(bytes);
        return NULL;
    }
    if (data_size > 0) /* there may be no data at all */
        memcpy(bytes + 8 + padded, data, data_size);
    *size = 8 + padded + data_size;
    return bytes;
}

char *ascc_tensor_file_harmless(char *text)
{
    for (char *c = text; *c; c++)
        if (*c < 0x20 || *c > 0x7e)
            *c = '?';
    return text;
}
