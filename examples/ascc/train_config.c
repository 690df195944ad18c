/* Reads the config file of `ascc train`. SPDX-License-Identifier: MIT */
#include "train_config.h"

#include <errno.h>
#include <glob.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "file/json_reader.h"

static const char SUFFIX[] = ".safetensors";
static const double MANY = 1e9;

typedef struct reading {
    ascc_reader r;
    char folder[ASCC_TRAIN_PATH]; /* ends in a slash, or is empty */
} reading;

/* ---- Members that may be missing ------------------------------------------------------------------ */

static double number_or(ascc_reader *r, uint32_t object, const char *key, double low, double high,
                        double otherwise)
{
    return ascc_reader_has(r, object, key) ? ascc_reader_number(r, object, key, low, high)
                                           : otherwise;
}

static int32_t integer_or(ascc_reader *r, uint32_t object, const char *key, int32_t low,
                          int32_t high, int32_t otherwise)
{
    return ascc_reader_has(r, object, key) ? ascc_reader_integer(r, object, key, low, high)
                                           : otherwise;
}

static bool flag_or(ascc_reader *r, uint32_t object, const char *key, bool otherwise)
{
    return ascc_reader_has(r, object, key) ? ascc_reader_flag(r, object, key) : otherwise;
}

static int32_t choice_or(ascc_reader *r, uint32_t object, const char *key,
                         const char *const *choices, int32_t count, int32_t otherwise)
{
    return ascc_reader_has(r, object, key) ? ascc_reader_choice(r, object, key, choices, count)
                                           : otherwise;
}

static void text_of(ascc_reader *r, uint32_t object, const char *key, char *into, size_t capacity)
{
    const char *text = ascc_reader_text(r, object, key);
    if (strlen(text) >= capacity)
        ascc_reader_fail(r, "'%s' is longer than %zu bytes", key, capacity - 1);
    else
        (void)snprintf(into, capacity, "%s", text);
}

/* ---- Paths ---------------------------------------------------------------------------------------- */

static bool has_controls(const char *path)
{
    for (; *path; path++)
        if ((unsigned char)*path < 0x20 || *path == 0x7f)
            return true;
    return false;
}

static void join(reading *g, const char *path, char into[ASCC_TRAIN_PATH])
{
    const char *folder = path[0] == '/' ? "" : g->folder;
    if (!path[0])
        ascc_reader_fail(&g->r, "a path is empty");
    else if (has_controls(
                 path)) /* a program that is told of the file would read on in a new line */
        ascc_reader_fail(&g->r, "a path holds a control character");
    else if (strlen(folder) + strlen(path) + 32 > ASCC_TRAIN_PATH)
        ascc_reader_fail(&g->r, "a path is too long");
    else
        (void)snprintf(into, ASCC_TRAIN_PATH, "%.2000s%.2000s", folder, path);
}

static void path_of(reading *g, uint32_t object, const char *key, char into[ASCC_TRAIN_PATH])
{
    const char *path = ascc_reader_text(&g->r, object, key);
    if (g->r.status == ASCC_OK)
        join(g, path, into);
}

/* `path` with `end` in place of its suffix. */
static void derive(const char *path, const char *suffix, const char *end,
                   char into[ASCC_TRAIN_PATH])
{
    const size_t length = strlen(path), tail = strlen(suffix);
    const bool ends = length > tail && strcmp(path + length - tail, suffix) == 0;
    (void)snprintf(into, ASCC_TRAIN_PATH, "%.*s%s", (int)(ends ? length - tail : length), path,
                   end);
}

/* ---- Sequences ------------------------------------------------------------------------------------ */

static void add_source(reading *g, ascc_train_sources *list, const char *path, double share,
                       int32_t every)
{
    char *copy = malloc(strlen(path) + 1);
    ascc_train_source *grown = realloc(list->source, (list->count + 1) * sizeof *list->source);
    if (grown)
        list->source = grown;
    if (!grown || !copy || list->count == ASCC_TRAIN_SOURCES) {
        free(copy);
        ascc_reader_fail(&g->r, "no memory, or more than %d sequences", ASCC_TRAIN_SOURCES);
        return;
    }
    (void)strcpy(copy, path);
    list->source[list->count++] = (ascc_train_source){copy, share, every};
}

/* The folder is meant as it is, only what the file says is a pattern. */
static bool write_pattern(const reading *g, const char *path, char *into, size_t capacity)
{
    size_t used = 0;
    for (const char *c = path[0] == '/' ? "" : g->folder; *c && used + 2 < capacity; c++) {
        if (strchr("*?[]\\", *c))
            into[used++] = '\\';
        into[used++] = *c;
    }
    return snprintf(into + used, capacity - used, "%s", path) < (int)(capacity - used);
}

/* All files that a path or pattern means, in the order of their names. */
static void add_matches(reading *g, ascc_train_sources *list, const char *path, double share,
                        int32_t every)
{
    char pattern[2 * ASCC_TRAIN_PATH];
    glob_t found = {0};
    if (g->r.status != ASCC_OK)
        return;
    if (!path[0] || !write_pattern(g, path, pattern, sizeof pattern) ||
        glob(pattern, 0, NULL, &found) != 0 || found.gl_pathc == 0)
        ascc_reader_fail(&g->r, "%.150s: there is no such file", path);
    for (size_t i = 0; i < found.gl_pathc; i++)
        add_source(g, list, found.gl_pathv[i], share, every);
    globfree(&found);
}

static void read_sources(reading *g, uint32_t data, const char *key, ascc_train_sources *list)
{
    ascc_reader *r = &g->r;
    const uint32_t array = ascc_reader_array(r, data, key);
    if (r->status != ASCC_OK)
        return;
    if (r->json->value[array].count == 0)
        ascc_reader_fail(r, "'%s' is empty", key);
    for (uint32_t i = ascc_json_first(r->json, array); i && r->status == ASCC_OK;
         i = r->json->value[i].next) {
        const ascc_json_value *value = &r->json->value[i];
        ascc_reader_where(r, "data: %s", key);
        if (value->kind == ASCC_JSON_STRING) {
            add_matches(g, list, value->text, 1.0, 1);
        } else if (value->kind == ASCC_JSON_OBJECT) {
            const char *path = ascc_reader_text(r, i, "path");
            const double share = number_or(r, i, "share", 1e-6, 1e6, 1.0);
            const int32_t every = integer_or(r, i, "every", 1, 1000, 1);
            ascc_reader_end(r, i);
            add_matches(g, list, path, share, every);
        } else {
            ascc_reader_fail(r, "a path or an object with a path is wanted");
        }
    }
}

static void read_data(reading *g, uint32_t root, ascc_train_config *c)
{
    ascc_reader_where(&g->r, "config");
    const uint32_t data = ascc_reader_object(&g->r, root, "data");
    ascc_reader_where(&g->r, "data");
    const bool valid = ascc_reader_has(&g->r, data, "valid");
    read_sources(g, data, "train", &c->train);
    if (valid)
        read_sources(g, data, "valid", &c->valid);
    ascc_reader_where(&g->r, "data");
    ascc_reader_end(&g->r, data);
}

/* ---- The network ---------------------------------------------------------------------------------- */

static void read_coarse(ascc_reader *r, uint32_t o, ascc_architecture *a)
{
    double channels[ASCC_ARCHITECTURE_LEVELS] = {0.0};
    a->levels = integer_or(r, o, "levels", 0, ASCC_ARCHITECTURE_LEVELS, 0);
    a->coarse_layers = integer_or(r, o, "coarse_layers", 1, 16, a->coarse_layers);
    if (a->levels || ascc_reader_has(r, o, "coarse_channels"))
        ascc_reader_numbers(r, o, "coarse_channels", a->levels, 1.0, ASCC_ARCHITECTURE_CHANNELS,
                            channels);
    for (int32_t i = 0; i < a->levels; i++)
        a->coarse_channels[i] = (int32_t)channels[i];
}

static void read_scene(ascc_reader *r, uint32_t o, ascc_architecture *a)
{
    a->spacing = ascc_reader_number(r, o, "spacing", 1e-6, 1e6);
    a->time_step = ascc_reader_number(r, o, "time_step", 1e-9, 1e6);
    a->rest_density = number_or(r, o, "rest_density", 1e-6, 1e9, a->rest_density);
    if (ascc_reader_has(r, o, "gravity"))
        ascc_reader_numbers(r, o, "gravity", a->dimension, -1e6, 1e6, a->gravity);
}

static void read_network(reading *g, uint32_t root, int32_t seed, ascc_architecture *a)
{
    ascc_reader *r = &g->r;
    const uint32_t o = ascc_reader_object(r, root, "network");
    ascc_reader_where(r, "network");
    const int32_t dimension = ascc_reader_integer(r, o, "dimension", 2, 3);
    const int32_t kernel = choice_or(r, o, "kernel", ascc_architecture_kernels, 2, 0);
    *a = ascc_architecture_default(dimension, (ascc_architecture_family)kernel);
    text_of(r, o, "name", a->name, sizeof a->name);
    if (ascc_reader_has(r, o, "description"))
        text_of(r, o, "description", a->description, sizeof a->description);
    read_scene(r, o, a);
    a->channels = integer_or(r, o, "channels", 1, ASCC_ARCHITECTURE_CHANNELS, a->channels);
    a->fine_layers = integer_or(r, o, "fine_layers", 2, 16, a->fine_layers);
    read_coarse(r, o, a);
    a->radius = number_or(r, o, "radius", 0.1, 100.0, a->radius);
    a->wall_radius = number_or(r, o, "wall_radius", 0.1, 100.0, a->wall_radius);
    a->bumps = integer_or(r, o, "bumps", 1, ASCC_ARCHITECTURE_BUMPS, a->bumps);
    a->order = integer_or(r, o, "order", 0, ASCC_ARCHITECTURE_ORDER, a->order);
    a->wall_bumps = integer_or(r, o, "wall_bumps", 1, ASCC_ARCHITECTURE_BUMPS, a->wall_bumps);
    a->output_radius = number_or(r, o, "output_radius", 0.0, 100.0, a->output_radius);
    a->output_bumps = integer_or(r, o, "output_bumps", 1, ASCC_ARCHITECTURE_BUMPS, a->output_bumps);
    a->gravity_seen = flag_or(r, o, "gravity_seen", false);
    a->impulse_limit = number_or(r, o, "impulse_limit", 0.0, 1e6, 0.0);
    a->contact = number_or(r, o, "contact", 0.0, 100.0, 0.0);
    a->seen_direction =
        choice_or(r, o, "direction", ascc_architecture_directions, 2, a->seen_direction) == 1;
    a->output = (ascc_architecture_output)choice_or(r, o, "output", ascc_architecture_outputs, 2,
                                                    (int32_t)a->output);
    const bool plain = a->output == ASCC_OUTPUT_PLAIN;
    a->radial =
        choice_or(r, o, "projection", ascc_architecture_projections, 2, a->radial && !plain) == 1;
    a->damping = flag_or(r, o, "damping", a->damping && !plain);
    a->sampling = (ascc_architecture_sampling)choice_or(
        r, o, "sampling", ascc_architecture_samplings, 3, (int32_t)a->sampling);
    a->advected = choice_or(r, o, "evaluate", ascc_architecture_evaluates, 2, a->advected) == 1;
    a->seed = (uint64_t)integer_or(r, o, "seed", 0, INT32_MAX, seed);
    ascc_reader_end(r, o);
}

/* ---- Schedule and options ------------------------------------------------------------------------- */

static void read_stages(reading *g, uint32_t root, ascc_train_config *c)
{
    ascc_reader *r = &g->r;
    uint64_t end = 0;
    int32_t count = 0;
    ascc_reader_where(r, "config");
    const uint32_t array = ascc_reader_array(r, root, "stages");
    for (uint32_t i = array ? ascc_json_first(r->json, array) : 0; i && r->status == ASCC_OK;
         i = r->json->value[i].next) {
        ascc_reader_where(r, "stage %d", count + 1);
        if (count == ASCC_TRAIN_STAGES || r->json->value[i].kind != ASCC_JSON_OBJECT) {
            ascc_reader_fail(r, "stages are objects, at most %d", ASCC_TRAIN_STAGES);
            break;
        }
        ascc_training_stage *s = &c->stage[count++];
        end += (uint64_t)ascc_reader_integer(r, i, "iterations", 1, 1000000000);
        s->end = end;
        s->horizon = ascc_reader_integer(r, i, "horizon", 1, 10000);
        s->presteps = integer_or(r, i, "presteps", 0, 10000, 0);
        s->learning_rate = ascc_reader_number(r, i, "learning_rate", 0.0, 1.0);
        s->learning_rate_end = number_or(r, i, "learning_rate_end", 1e-30, 1.0, 0.0);
        ascc_reader_end(r, i);
    }
    ascc_reader_where(r, "config");
    if (count == 0)
        ascc_reader_fail(r, "'stages' is empty");
    c->options.stage = c->stage;
    c->options.stage_count = count;
}

static void read_options(reading *g, uint32_t root, ascc_trainer_options *o)
{
    ascc_reader *r = &g->r;
    o->size = sizeof *o;
    o->seed = (uint64_t)integer_or(r, root, "seed", 0, INT32_MAX, 1);
    o->batch = integer_or(r, root, "batch", 1, 4096, 8);
    o->clip = number_or(r, root, "clip", 1e-30, 1e30, 0.0);
    o->average = number_or(r, root, "average", 0.0, 1.0, 0.0);
    o->jitter = number_or(r, root, "jitter", 0.0, 10.0, 0.0);
    o->rotate = flag_or(r, root, "rotate", false);
    o->mirror = flag_or(r, root, "mirror", false);
    const double weight = number_or(r, root, "neighbor_weight", 0.0, 100.0, 1.0);
    o->neighbor_weight = weight > 0.0 ? weight : -1.0;
    o->density_weight = number_or(r, root, "density_weight", 0.0, MANY, 0.0);
    o->wall_weight = number_or(r, root, "wall_weight", 0.0, MANY, 0.0);
    o->truth_share = number_or(r, root, "truth_share", 0.0, 1.0, 0.0);
    o->whiten = flag_or(r, root, "whiten", true) ? 0 : -1;
    o->position_gradients = flag_or(r, root, "position_gradients", false);
    const double gib = number_or(r, root, "memory", 1e-3, 1e6, 0.0);
    o->memory_limit = (size_t)(gib * 1024.0 * 1024.0 * 1024.0);
}

static void read_outputs(reading *g, uint32_t root, ascc_train_config *c)
{
    ascc_reader *r = &g->r;
    ascc_reader_where(r, "config");
    path_of(g, root, "output", c->output);
    derive(c->output, SUFFIX, c->valid.count ? "-latest.safetensors" : SUFFIX, c->latest);
    derive(c->output, SUFFIX, ".csv", c->log);
    derive(c->output, SUFFIX, ".checkpoint", c->checkpoint);
    if (ascc_reader_has(r, root, "log"))
        path_of(g, root, "log", c->log);
    derive(c->log, ".csv", ".svg", c->chart);
    c->checkpoint_seconds = 600.0;
    if (ascc_reader_has(r, root, "checkpoint")) {
        const uint32_t o = ascc_reader_object(r, root, "checkpoint");
        ascc_reader_where(r, "checkpoint");
        if (ascc_reader_has(r, o, "path"))
            path_of(g, o, "path", c->checkpoint);
        c->checkpoint_seconds = number_or(r, o, "every_seconds", 0.0, MANY, 600.0);
        ascc_reader_end(r, o);
        ascc_reader_where(r, "config");
    }
}

static void read_validation(reading *g, uint32_t root, ascc_train_config *c)
{
    ascc_reader *r = &g->r;
    c->validate_every = 500;
    c->validate_frames = 20;
    c->validate_starts = 10;
    c->validate_rollouts = 1;
    if (!ascc_reader_has(r, root, "validate"))
        return;
    const uint32_t o = ascc_reader_object(r, root, "validate");
    ascc_reader_where(r, "validate");
    if (!c->valid.count)
        ascc_reader_fail(r, "there is no 'valid' in 'data'");
    c->validate_every = (uint64_t)integer_or(r, o, "every_iterations", 1, 1000000000, 500);
    c->validate_frames = integer_or(r, o, "frames", 0, 1000000, 20);
    c->validate_starts = integer_or(r, o, "starts", 1, 1000000, 10);
    c->validate_rollouts = integer_or(r, o, "rollouts", 0, 1000000, 1);
    ascc_reader_end(r, o);
    ascc_reader_where(r, "config");
}

static void read_all(reading *g, ascc_train_config *c)
{
    ascc_reader *r = &g->r;
    ascc_reader_where(r, "config");
    if (r->json->value[0].kind != ASCC_JSON_OBJECT)
        ascc_reader_fail(r, "not an object");
    read_options(g, 0, &c->options);
    c->described = ascc_reader_has(r, 0, "network");
    if (ascc_reader_has(r, 0, "model"))
        path_of(g, 0, "model", c->model);
    else if (!c->described)
        ascc_reader_fail(r, "'network' or 'model' is wanted");
    if (c->described)
        read_network(g, 0, (int32_t)c->options.seed, &c->architecture);
    read_data(g, 0, c);
    read_stages(g, 0, c);
    read_outputs(g, 0, c);
    read_validation(g, 0, c);
    ascc_reader_end(r, 0);
}

/* ---- The file ------------------------------------------------------------------------------------- */

static char *read_text(const char *path, size_t *size, char *error, size_t capacity)
{
    enum { MOST = 1 << 20 };
    FILE *file = fopen(path, "rb");
    char *text = file ? malloc(MOST) : NULL;
    *size = text ? fread(text, 1, MOST, file) : 0;
    const bool good = text && !ferror(file) && *size < MOST;
    if (!good) {
        (void)snprintf(error, capacity, "%.300s: %s", path,
                       file && text && !ferror(file) ? "too long" : strerror(errno));
        free(text);
    }
    if (file)
        (void)fclose(file);
    return good ? text : NULL;
}

bool ascc_train_config_read(const char *path, ascc_train_config *c, char *error, size_t capacity)
{
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_message message = {""};
    ascc_json json;
    size_t size;
    memset(c, 0, sizeof *c);
    char *text = read_text(path, &size, error, capacity);
    if (!text)
        return false;
    ascc_status status = ascc_json_open(&allocator, text, size, &json, &message);
    if (status == ASCC_OK) {
        reading g = {.r = {.json = &json, .message = &message}};
        const char *slash = strrchr(path, '/');
        if (slash)
            (void)snprintf(g.folder, sizeof g.folder, "%.*s", (int)(slash - path + 1), path);
        read_all(&g, c);
        status = g.r.status;
        ascc_json_close(&json);
    }
    free(text);
    if (status != ASCC_OK)
        (void)snprintf(error, capacity, "%.300s: %s", path, message.text);
    return status == ASCC_OK;
}

static void free_sources(ascc_train_sources *list)
{
    for (size_t i = 0; i < list->count; i++)
        free(list->source[i].path);
    free(list->source);
}

void ascc_train_config_free(ascc_train_config *c)
{
    free_sources(&c->train);
    free_sources(&c->valid);
}
