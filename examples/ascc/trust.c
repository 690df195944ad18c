/* `ascc trust`: gives a model file statistics of the states it was trained on (docs/trust.md).
 * SPDX-License-Identifier: MIT
 *
 * Only the metadata in the file changes: network and weights stay as they are, byte for byte.
 */
#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/train.h>
#include <jansson.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "evaluate.h"
#include "host.h"
#include "new_file.h"
#include "sequence.h"
#include "system.h"
#include "tensor_file.h"
#include "training_sequence.h"

enum { MOST_SEQUENCES = 1024, FRAMES = 400 };

typedef struct trust {
    const char *model, *output;
    const char *sequence[MOST_SEQUENCES];
    size_t sequence_count, every;
    int32_t frames;
    double threshold;
    ascc_train_context *context;
    ascc_trainer *trainer;
    char why[512];
} trust;

static const char help[] =
    "usage: ascc trust MODEL SEQUENCE... -o FILE [options]\n"
    "  Writes MODEL with statistics of what its first layer makes of these sequences, those that "
    "it "
    "was\n"
    "  trained on: steps tell by them how far what they see is from that.\n"
    "\n"
    "options\n"
    "  --frames N     states that are looked at (400)\n"
    "  --every K      take each K-th frame of the sequences (1)\n"
    "  --threshold X  mean distance at which errors double, for hosts to begin with\n";

static bool read_option(trust *t, const char *name, const char *value)
{
    char *end;
    errno = 0;
    const double number = strtod(value, &end);
    const bool whole = end != value && !*end && !errno;
    if (strcmp(name, "-o") == 0)
        t->output = value;
    else if (strcmp(name, "--frames") == 0 && whole && number >= 1.0 && number <= 10000.0)
        t->frames = (int32_t)number;
    else if (strcmp(name, "--every") == 0 && whole && number >= 1.0 && number <= 100000.0)
        t->every = (size_t)number;
    else if (strcmp(name, "--threshold") == 0 && whole && number > 0.0 && number <= 1e6)
        t->threshold = number;
    else
        return false;
    return true;
}

static bool read_arguments(trust *t, int argc, char **argv)
{
    static const char *const options[] = {"-o", "--frames", "--every", "--threshold", NULL};
    for (int i = 0; i < argc; i++) {
        if (argv[i][0] == '-') {
            if (i + 1 == argc || !read_option(t, argv[i], argv[i + 1]))
                return ascc_bad_option("trust", options, argv[i], argv[i + 1]);
            i++;
        } else if (!t->model) {
            t->model = argv[i];
        } else if (t->sequence_count < MOST_SEQUENCES) {
            t->sequence[t->sequence_count++] = argv[i];
        } else {
            return ascc_bad_use("trust", "one sequence too many", argv[i], NULL);
        }
    }
    return (t->sequence_count && t->output) ||
           ascc_bad_use("trust", "a MODEL, a SEQUENCE and -o are wanted", NULL, NULL);
}

static bool failed(trust *t, const char *what, const char *why)
{
    (void)snprintf(t->why, sizeof t->why, "%.200s: %.300s", what, why);
    return false;
}

static bool add_sequence(trust *t, const char *path)
{
    ascc_sequence s;
    ascc_training_sequence given;
    char why[256];
    if (!ascc_training_sequence_read(path, t->every, &s, &given, why, sizeof why))
        return failed(t, "sequence", why);
    const ascc_status status = ascc_trainer_add_sequence(t->trainer, &given);
    ascc_sequence_free(&s);
    return status == ASCC_OK || failed(t, path, ascc_trainer_message(t->trainer));
}

/* The bytes of the model file of that name or path, from malloc; NULL after failed. */
static unsigned char *read_model(trust *t, size_t *size)
{
    char path[ASCC_HOST_PATH], why[256];
    ascc_host_error error = {"no memory"};
    ascc_context *context = NULL;
    unsigned char *bytes = NULL;
    ascc_status status = ascc_context_create(NULL, &context);
    if (status == ASCC_OK)
        status = ascc_host_find(context, t->model, path, &error);
    ascc_context_destroy(&context);
    if (status != ASCC_OK)
        (void)failed(t, t->model, error.text);
    else if (!(bytes = ascc_tensor_file_read(path, size, why, sizeof why)))
        (void)failed(t, path, why);
    return bytes;
}

static bool open_trainer(trust *t, const unsigned char *bytes, size_t size)
{
    char why[256];
    const ascc_training_stage stage = {.end = 1, .unroll = 1, .learning_rate = 1e-3};
    const ascc_trainer_options options = {.size = sizeof options,
                                          .seed = 1,
                                          .stage = &stage,
                                          .stage_size = sizeof stage,
                                          .stage_count = 1,
                                          .batch = 1,
                                          .rotate = 1,
                                          .mirror = 1,
                                          .whiten = -1};
    const ascc_context_options one = {.size = sizeof one, .thread_count = 1};
    if (ascc_train_context_create(&one, &t->context) != ASCC_OK)
        return failed(t, t->model, "no memory");
    if (ascc_trainer_create(t->context, &options, bytes, size, &t->trainer) == ASCC_OK)
        return true;
    (void)ascc_train_context_message(t->context, why, sizeof why);
    return failed(t, t->model, why);
}

/* The file with this text in its metadata, from malloc; NULL after failed. */
static unsigned char *add_text(trust *t, const unsigned char *bytes, size_t size, const char *text,
                               size_t *made_size)
{
    char why[256] = "no memory";
    size_t data = 0;
    json_t *header = ascc_tensor_file_header(bytes, size, &data, why, sizeof why);
    unsigned char *made = NULL;
    if (header) {
        json_object_set_new(json_object_get(header, "__metadata__"), "trust", json_string(text));
        made = ascc_tensor_file_build(header, bytes + data, size - data, made_size);
    }
    if (!made)
        (void)failed(t, t->model, why);
    json_decref(header);
    return made;
}

static bool write_file(trust *t, const unsigned char *bytes, size_t size)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, t->output, t->why, sizeof t->why))
        return false;
    (void)fwrite(bytes, 1, size, output.stream); /* closing tells whether it succeeded */
    return ascc_new_file_close(&output, true, t->why, sizeof t->why);
}

static bool run(trust *t)
{
    size_t size = 0, made_size = 0;
    unsigned char *bytes = read_model(t, &size), *made = NULL;
    bool good = bytes && open_trainer(t, bytes, size);
    for (size_t i = 0; i < t->sequence_count && good; i++)
        good = add_sequence(t, t->sequence[i]);
    const char *text = good ? ascc_trainer_trust(t->trainer, 0, t->frames, t->threshold) : NULL;
    if (good && !text)
        (void)failed(t, t->model, ascc_trainer_message(t->trainer));
    if (text)
        made = add_text(t, bytes, size, text, &made_size);
    good = made && write_file(t, made, made_size);
    free(made);
    free(bytes);
    ascc_trainer_destroy(&t->trainer);
    ascc_train_context_destroy(&t->context);
    return good;
}

int ascc_command_trust(int argc, char **argv)
{
    if (argc == 1 && strcmp(argv[0], "--help") == 0) {
        fputs(help, stdout);
        return 0;
    }
    trust t = {.frames = FRAMES, .every = 1};
    if (!read_arguments(&t, argc, argv))
        return 2;
    if (!ascc_new_file_check(t.output, t.why, sizeof t.why) || !run(&t)) {
        ascc_line(stderr, "ascc trust: %s", t.why);
        return 1;
    }
    return 0;
}
