/* What the library asks of the system, on any machine: files with names beyond ASCII, files replaced, models
 * found by name, threads. Leaves nothing behind; prints what is wrong. Needs no test framework.
 * SPDX-License-Identifier: MIT */
#include <ascc/ascc.h>

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../examples/demo_model.h"

#if defined(_WIN32)
#include <windows.h>
#define BETWEEN "\\"
#else
#include <sys/stat.h>
#include <unistd.h>
#define BETWEEN "/"
#endif

/* "modèle 水" and "dossier é" in UTF-8. */
#define NAME "mod\xc3\xa8le \xe6\xb0\xb4"
#define FOLDER "dossier \xc3\xa9"
#define FILE_NAME FOLDER BETWEEN NAME ".safetensors"

static int faults;

static void expect(int good, const char *what)
{
    if (good)
        return;
    printf("wrong: %s\n", what);
    faults++;
}

/* The folder is made and removed by calls that are not the library's own. */
static void make_folder(void)
{
#if defined(_WIN32)
    (void)CreateDirectoryW(L"dossier \u00e9", NULL);
    (void)SetEnvironmentVariableW(L"ASCC_MODEL_PATH", L"nowhere;dossier \u00e9");
#else
    (void)mkdir(FOLDER, 0777);
    (void)setenv("ASCC_MODEL_PATH", "nowhere:" FOLDER, 1);
#endif
}

static int file_is_there(void)
{
#if defined(_WIN32)
    return GetFileAttributesW(L"dossier \u00e9\\mod\u00e8le \u6c34.safetensors") !=
           INVALID_FILE_ATTRIBUTES;
#else
    return access(FILE_NAME, F_OK) == 0;
#endif
}

/* 1: the folder held the file and nothing else. */
static int remove_folder(void)
{
#if defined(_WIN32)
    return DeleteFileW(L"dossier \u00e9\\mod\u00e8le \u6c34.safetensors") &&
           RemoveDirectoryW(L"dossier \u00e9");
#else
    return unlink(FILE_NAME) == 0 && rmdir(FOLDER) == 0;
#endif
}

static void check_files(ascc_context *context, ascc_model *model)
{
    char path[4096] = "", message[256];
    ascc_model *again = NULL;
    size_t size, again_size;
    const void *bytes = ascc_model_bytes(model, &size);
    make_folder();
    expect(ascc_model_save(model, FILE_NAME) == ASCC_OK, "a file with a name in UTF-8 is written");
    expect(file_is_there(), "it has that name");
    expect(ascc_model_save(model, FILE_NAME) == ASCC_OK, "it is replaced");
    expect(ascc_model_load(context, FILE_NAME, &again) == ASCC_OK, "it is read");
    expect(again && memcmp(ascc_model_bytes(again, &again_size), bytes, size) == 0 &&
               again_size == size,
           "it has the bytes that were written");
    ascc_model_destroy(&again);
    expect(ascc_model_find(context, NAME, path, sizeof path) == ASCC_OK &&
               strstr(path, NAME ".safetensors") != NULL,
           "it is found by name in ASCC_MODEL_PATH");
    expect(ascc_model_load(context, path, &again) == ASCC_OK, "and read from where it was found");
    ascc_model_destroy(&again);
    expect(ascc_model_save(model, FOLDER) == ASCC_ERROR_FILE, "a folder is refused");
    expect(ascc_model_save(model, "nowhere/m") == ASCC_ERROR_FILE,
           "so is a folder that is not there");
    ascc_context_message(context, message, sizeof message);
    expect(strstr(message, "nowhere/m") != NULL, "and named");
    expect(remove_folder(), "nothing is left beside the file");
}

static uint64_t run(ascc_model *model, int32_t threads)
{
    const ascc_context_options options = {.size = sizeof options, .thread_count = threads};
    ascc_context *context = NULL;
    ascc_particles *particles = NULL;
    ascc_step *step = NULL;
    ascc_particles_options fluid = {.size = sizeof fluid};
    static float position[30 * 30][2];
    for (size_t i = 0; i < sizeof position / sizeof *position; i++) {
        position[i][0] = 0.045f * (float)(i % 30);
        position[i][1] = 0.05f * (float)(i / 30);
    }
    const ascc_const_array positions = {.data = position};
    uint64_t hash = 0;
    if (ascc_context_create(&options, &context) == ASCC_OK &&
        ascc_model_particles_options(model, 1.0, &fluid) == ASCC_OK &&
        ascc_particles_create(context, &fluid, &particles) == ASCC_OK &&
        ascc_particles_add_fluid(particles, sizeof position / sizeof *position, &positions, NULL,
                                 NULL, NULL) == ASCC_OK &&
        ascc_step_create(context, model, NULL, &step) == ASCC_OK &&
        ascc_step_run(step, particles, NULL, 20) == ASCC_OK)
        hash = ascc_particles_hash(particles);
    ascc_step_destroy(&step);
    ascc_particles_destroy(&particles);
    ascc_context_destroy(&context);
    return hash;
}

int main(void)
{
    size_t size;
    unsigned char *bytes = demo_model_bytes(2, 0.05, &size);
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    if (!bytes || ascc_context_create(NULL, &context) != ASCC_OK ||
        ascc_model_load_memory(context, bytes, size, &model) != ASCC_OK) {
        puts("wrong: no model");
        return 1;
    }
    free(bytes);
    check_files(context, model);
    const uint64_t alone = run(model, 1);
    expect(alone != 0, "a scene runs");
    expect(run(model, 4) == alone, "four threads give the bits of one");
    for (int i = 0; i < 50 && faults == 0; i++) /* starting and stopping threads is what may hang */
        expect(run(model, 1 + i % 3) == alone, "again and again");
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return faults != 0;
}
