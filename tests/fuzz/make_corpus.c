/* Writes the seed corpus of fuzz_safetensors into the folder named. SPDX-License-Identifier: MIT
 *
 * tests/fuzz/corpus holds what this program wrote, and inputs that once found a fault.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "support/model_builder.h"

static int failures;

static void write_seed(const char *folder, const char *name, char kind, const void *data,
                       size_t size)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    if (!file || fputc(kind, file) == EOF || fwrite(data, 1, size, file) != size)
        failures++;
    if (file && fclose(file) != 0)
        failures++;
}

/* A whole file, or without its length and with a separator before the data. */
static void write_file(const char *folder, const char *name, char kind, unsigned char *bytes,
                       size_t size)
{
    if (kind == 'h') {
        size_t length = 0;
        for (int i = 7; i >= 0; i--)
            length = length << 8 | bytes[i];
        memmove(bytes, bytes + 8, length);
        bytes[length] = 0xff;
        memmove(bytes + length + 1, bytes + 8 + length, size - 8 - length);
        size -= 7;
    }
    write_seed(folder, name, kind, bytes, size);
    free(bytes);
}

int main(int argc, char **argv)
{
    static const char *const headers[] = {
        "{}",
        "{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":\"{}\"}}",
        "{\"a\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]},"
        "\"b\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[4,12]}}\xff"
        "012345678901",
        "{\"a\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]},"
        "\"b\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[12,20]}}\xff"
        "01234567890123456789",
        "{\"a\":{\"dtype\":\"F64\",\"shape\":[2147483648,1073741824],\"data_offsets\":[0,0]}}",
        "{\"a\":1,\"a\":2}",
        "{\"\\ud83d\\ude00\\u00e9\\n\":[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]",
        "{\"a\":[1e308,-0.1e-320,123456789012345678901234567890,5e-324,true,false,null]}",
    };
    static const char kinds[] = {'n', 'b', 'd', 'c'};
    const model_random tiny = {.channels = 4, .cells = 1, .output_cells = 2, .trunk_layers = 1};
    const model_random farthest = {.levels = 2,
                                   .channels = 4,
                                   .cells = 1,
                                   .output_cells = 2,
                                   .method = "farthest",
                                   .half_axis = "x",
                                   .plain = 1};
    if (argc != 2) {
        fprintf(stderr, "usage: make_corpus FOLDER\n");
        return 2;
    }
    for (int i = 0; i < 2; i++) {
        const char kind = "fh"[i];
        char name[32];
        size_t size;
        unsigned char *bytes = model_builder_random(&tiny, &size);
        snprintf(name, sizeof name, "random-%c", kind);
        write_file(argv[1], name, kind, bytes, size);
        bytes = model_builder_random(&farthest, &size);
        snprintf(name, sizeof name, "farthest-%c", kind);
        write_file(argv[1], name, kind, bytes, size);
        bytes = model_builder_cconv(NULL, NULL, &size);
        snprintf(name, sizeof name, "cconv-%c", kind);
        write_file(argv[1], name, kind, bytes, size);
    }
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        char name[32];
        snprintf(name, sizeof name, "header-%zu", i);
        write_seed(argv[1], name, 'h', headers[i], strlen(headers[i]));
    }
    for (size_t i = 0; i < sizeof kinds; i++) {
        char name[32], *text = model_builder_description(kinds[i]);
        snprintf(name, sizeof name, "description-%c", kinds[i]);
        write_seed(argv[1], name, kinds[i], text, strlen(text));
        free(text);
    }
    return failures != 0;
}
