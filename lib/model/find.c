/* Where a model file is that a host knows by name. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include "base/context.h"
#include "file/paths.h"

#define SUFFIX ".safetensors"

typedef struct search {
    const char *name, *suffix;
    char path[ASCC_PATH_SIZE]; /* of the last file tried */
    bool found;
} search;

/* FOLDER[length]/BELOW/name.safetensors; a path that is too long is no file. */
static void try_folder(search *s, const char *folder, size_t length, const char *below)
{
    if (s->found || length == 0)
        return;
    const int written = snprintf(s->path, sizeof s->path, "%.*s%s/%s%s", (int)length, folder, below,
                                 s->name, s->suffix);
    s->found = written > 0 && (size_t)written < sizeof s->path && ascc_path_is_file(s->path);
}

/* The host's folders, those about the program, and the one that was installed. */
static void try_all(search *s)
{
    char text[ASCC_PATH_SIZE];
    if (ascc_path_environment("ASCC_MODEL_PATH", text))
        for (const char *at = text, *end; at; at = end ? end + 1 : NULL) {
            end = strchr(at, ASCC_PATH_LIST_SEPARATOR);
            try_folder(s, at, end ? (size_t)(end - at) : strlen(at), "");
        }
    if (ascc_path_program_folder(text)) {
        static const char *const below[] = {"", "/models", "/../share/ascc/models"};
        for (size_t i = 0; i < sizeof below / sizeof *below; i++)
            try_folder(s, text, strlen(text), below[i]);
    }
#if defined(ASCC_MODEL_FOLDER)
    try_folder(s, ASCC_MODEL_FOLDER, strlen(ASCC_MODEL_FOLDER), "");
#endif
}

static bool ends_with(const char *text, const char *end)
{
    const size_t length = strlen(text), wanted = strlen(end);
    return length >= wanted && strcmp(text + length - wanted, end) == 0;
}

static ascc_status find(const char *name, char *path, size_t capacity, ascc_message *message)
{
    if (!name || !path)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "model: a NULL argument");
    search s = {.name = name, .suffix = ends_with(name, SUFFIX) ? "" : SUFFIX};
    const char *found = name;
    if (!strpbrk(name, ASCC_PATH_SEPARATORS) && !ascc_path_is_file(name)) {
        try_all(&s);
        found = s.path;
        if (!s.found)
            return ascc_fail(message, ASCC_ERROR_FILE,
                             "model: cannot open '%.100s', and no folder of models has '%.100s%s'",
                             name, name, s.suffix);
    }
    const size_t length = strlen(found);
    if (length >= capacity)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "model: a path of %zu bytes does not fit in %zu", length, capacity);
    memcpy(path, found, length + 1);
    return ASCC_OK;
}

ascc_status ascc_model_find(ascc_context *context, const char *name, char *path, size_t capacity)
{
    ascc_message message = {""};
    if (!context || context->magic != ASCC_CONTEXT_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = find(name, path, capacity, &message);
    return status == ASCC_OK ? status : ascc_context_fail(context, status, &message);
}
