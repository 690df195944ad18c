/* ascc convert: a published network becomes a model file, a sequence frames for other programs. SPDX-License-Identifier: MIT */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "export.h"
#include "host.h"
#include "published.h"
#include "tensor_file.h"
#include "system.h"

static int usage(void)
{
    fprintf(stdout,
            "usage: ascc convert IN -o OUT\n"
            "       ascc convert SEQUENCE [--ply DIR] [--vtk DIR] [--every K]\n\n"
            "IN is a published network as examples/convert/convert.py writes it (format\n"
            "ascc.weights); OUT becomes a model file with the same weights, for hosts of the\n"
            "library. The other commands take published networks as they are.\n"
            "A file that is there is replaced, and only by a model that loads.\n\n"
            "A sequence becomes a file for each K-th frame (1), for other programs:\n"
            "  --ply DIR  binary PLY\n"
            "  --vtk DIR  VTK, and frames.pvd for ParaView\n"
            "  --every K  each K-th frame (1)\n");
    return 0;
}

static int failed(const char *path, const char *why)
{
    ascc_line(stderr, "ascc convert: %s: %s", path, why);
    return 1;
}

/* Bytes of the model file, from malloc; NULL after failed. */
static unsigned char *convert(const char *in, size_t *size)
{
    char why[256];
    unsigned char *converted = NULL, *bytes = ascc_tensor_file_read(in, size, why, sizeof why);
    if (bytes)
        converted = ascc_published_convert(bytes, *size, size, why, sizeof why);
    free(bytes);
    if (!converted)
        (void)failed(in, why);
    return converted;
}

/* Loads the model, which checks all of it, and writes it. */
static int write_model(const char *in, const char *out, const unsigned char *bytes, size_t size)
{
    char why[256];
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    ascc_model_info info = {.size = sizeof info};
    if (ascc_context_create(NULL, &context) != ASCC_OK)
        return failed(out, "no memory");
    const bool loaded = ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK;
    const bool good = loaded && ascc_model_save(model, out) == ASCC_OK;
    if (good && ascc_model_get_info(model, &info) == ASCC_OK)
        ascc_line(stdout, "%s: model %s, %llu parameters", out, info.name,
                  (unsigned long long)info.parameter_count);
    (void)ascc_context_message(context, why, sizeof why);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return good ? 0 : failed(loaded ? out : in, why);
}

static bool read_option(const char *name, const char *value, const char **out, ascc_frames *frames)
{
    static const char *const options[] = {"-o", "--ply", "--vtk", "--every", NULL};
    const char **texts[] = {out, &frames->ply, &frames->vtk};
    for (size_t i = 0; value && i < sizeof texts / sizeof *texts; i++)
        if (strcmp(name, options[i]) == 0)
            return (*texts[i] = value) != NULL;
    if (value && strcmp(name, "--every") == 0) {
        char *end;
        const long k = strtol(value, &end, 10);
        if (!*end && end != value && k >= 1) {
            frames->every = (size_t)k;
            return true;
        }
    }
    return ascc_bad_option("convert", options, name, value);
}

int ascc_command_convert(int argc, char **argv)
{
    const char *in = NULL, *out = NULL;
    ascc_frames frames = {.every = 1};
    if (argc == 1 && strcmp(argv[0], "--help") == 0)
        return usage();
    for (int i = 0; i < argc; i++)
        if (argv[i][0] != '-' && !in)
            in = argv[i];
        else if (!read_option(argv[i], argv[i + 1], &out, &frames)) /* argv ends with NULL */
            return 2;
        else
            i++;
    const bool exports = frames.ply || frames.vtk;
    if (in && exports && !out)
        return ascc_export(in, &frames);
    if (exports)
        return ascc_bad_use("convert", "one SEQUENCE is wanted, and no -o", NULL, NULL), 2;
    if (!in || !out)
        return ascc_bad_use("convert", "a network and -o FILE are wanted", NULL, NULL), 2;
    if (ascc_system_same(in, out))
        return failed(out, "is the network that is to be converted");
    size_t size;
    unsigned char *bytes = convert(in, &size);
    const int status = bytes ? write_model(in, out, bytes, size) : 1;
    free(bytes);
    return status;
}
