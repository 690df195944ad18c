/* Reads the config file of `ascc train`. SPDX-License-Identifier: MIT */
#include "train_config.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "architecture.h"
#include "members.h"
#include "network_writer.h"
#include "system.h"

static const char SUFFIX[] = ".safetensors";
static const double MANY = 1e9;

typedef struct reading {
    ascc_members r;
    char folder[ASCC_TRAIN_PATH]; /* ends in a slash, or is empty */
} reading;

/* ---- Members that may be missing ------------------------------------------------------------------ */

static bool has(const ascc_members *r, const json_t *object, const char *key)
{
    return ascc_members_good(r) && json_object_get(object, key);
}

static double number_or(ascc_members *r, json_t *object, const char *key, double low, double high,
                        double otherwise)
{
    return has(r, object, key) ? ascc_members_number(r, object, key, low, high) : otherwise;
}

static int32_t integer_or(ascc_members *r, json_t *object, const char *key, int32_t low,
                          int32_t high, int32_t otherwise)
{
    return has(r, object, key) ? ascc_members_integer(r, object, key, low, high) : otherwise;
}

static bool flag_or(ascc_members *r, json_t *object, const char *key, bool otherwise)
{
    return has(r, object, key) ? ascc_members_flag(r, object, key) : otherwise;
}

static int32_t choice_or(ascc_members *r, json_t *object, const char *key,
                         const char *const *choices, int32_t count, int32_t otherwise)
{
    if (!has(r, object, key))
        return otherwise;
    const char *text = ascc_members_text(r, object, key);
    for (int32_t i = 0; i < count; i++)
        if (strcmp(text, choices[i]) == 0)
            return i;
    ascc_members_fail(r, "'%s' does not understand '%.60s'", key, text);
    return otherwise;
}

/* ---- Texts and paths ------------------------------------------------------------------------------ */

static void text_of(ascc_members *r, json_t *object, const char *key, char *into, size_t capacity)
{
    const char *text = ascc_members_text(r, object, key);
    if (strlen(text) >= capacity)
        ascc_members_fail(r, "'%s' is longer than %zu bytes", key, capacity - 1);
    else
        (void)snprintf(into, capacity, "%s", text);
}

static bool has_controls(const char *path)
{
    for (; *path; path++)
        if ((unsigned char)*path < 0x20 || *path == 0x7f)
            return true;
    return false;
}

static void join(reading *g, const char *path, char into[ASCC_TRAIN_PATH])
{
    const char *folder = ascc_system_is_absolute(path) ? "" : g->folder;
    if (!path[0])
        ascc_members_fail(&g->r, "a path is empty");
    else if (has_controls(
                 path)) /* a program that is told of the file would read on in a new line */
        ascc_members_fail(&g->r, "a path holds a control character");
    else if (strlen(folder) + strlen(path) + 32 > ASCC_TRAIN_PATH)
        ascc_members_fail(&g->r, "a path is too long");
    else
        (void)snprintf(into, ASCC_TRAIN_PATH, "%.2000s%.2000s", folder, path);
}

static void path_of(reading *g, json_t *object, const char *key, char into[ASCC_TRAIN_PATH])
{
    const char *path = ascc_members_text(&g->r, object, key);
    if (ascc_members_good(&g->r))
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

static void add_source(reading *g, ascc_train_sources *list, const char *path,
                       ascc_train_source source)
{
    char *copy = malloc(strlen(path) + 1);
    ascc_train_source *grown = realloc(list->source, (list->count + 1) * sizeof *list->source);
    if (grown)
        list->source = grown;
    if (!grown || !copy || list->count == ASCC_TRAIN_SOURCES) {
        free(copy);
        ascc_members_fail(&g->r, "no memory, or more than %d sequences", ASCC_TRAIN_SOURCES);
        return;
    }
    (void)strcpy(copy, path);
    source.path = copy;
    list->source[list->count++] = source;
}

/* All files that a path or pattern means, in the order of their names. */
static void add_matches(reading *g, ascc_train_sources *list, const char *path,
                        ascc_train_source source)
{
    size_t count = 0;
    if (!ascc_members_good(&g->r))
        return;
    char **found = path[0] ? ascc_system_match(g->folder, path, &count) : NULL;
    if (count == 0)
        ascc_members_fail(&g->r, "%.150s: there is no such file", path);
    for (size_t i = 0; i < count; i++) {
        add_source(g, list, found[i], source);
        free(found[i]);
    }
    free(found);
}

static void read_sources(reading *g, json_t *data, const char *key, ascc_train_sources *list)
{
    ascc_members *r = &g->r;
    const json_t *array = ascc_members_array(r, data, key);
    size_t i;
    json_t *value;
    if (array && json_array_size(array) == 0)
        ascc_members_fail(r, "'%s' is empty", key);
    json_array_foreach(array, i, value)
    {
        ascc_train_source source = {.share = 1.0, .every = 1};
        ascc_members_where(r, "data: %s", key);
        if (json_is_string(value)) {
            add_matches(g, list, json_string_value(value), source);
        } else if (json_is_object(value)) {
            const char *path = ascc_members_text(r, value, "path");
            source.share = number_or(r, value, "share", 1e-6, 1e6, 1.0);
            source.every = integer_or(r, value, "every", 1, 1000, 1);
            source.warm_up = integer_or(r, value, "warm_up", 0, 10000, 0);
            source.jitter = number_or(r, value, "jitter", 0.0, 1.0, 0.0);
            ascc_members_end(r, value);
            add_matches(g, list, path, source);
        } else {
            ascc_members_fail(r, "a path or an object with a path is wanted");
        }
    }
}

static void read_data(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members_where(&g->r, "config");
    json_t *data = ascc_members_object(&g->r, root, "data");
    ascc_members_where(&g->r, "data");
    const bool valid = has(&g->r, data, "valid");
    read_sources(g, data, "train", &c->train);
    if (valid)
        read_sources(g, data, "valid", &c->valid);
    ascc_members_where(&g->r, "data");
    ascc_members_end(&g->r, data);
}

/* A whole file, and a zero after it; NULL with an error. */
static char *read_text(const char *path, size_t *size, char *error, size_t capacity)
{
    enum { MOST = 1 << 20 };
    FILE *file = ascc_system_open(path, "rb");
    char *text = file ? malloc(MOST) : NULL;
    *size = text ? fread(text, 1, MOST - 1, file) : 0;
    const bool good = text && !ferror(file) && *size < MOST - 1;
    if (!good) {
        (void)snprintf(error, capacity, "%.300s: %s", path,
                       file && text && !ferror(file) ? "too long" : strerror(errno));
        free(text);
    }
    if (file)
        (void)fclose(file);
    if (good)
        text[*size] = '\0';
    return good ? text : NULL;
}

/* ---- The network ---------------------------------------------------------------------------------- */

static void read_coarse(ascc_members *r, json_t *o, ascc_architecture *a)
{
    double channels[ASCC_ARCHITECTURE_LEVELS] = {0.0};
    a->levels = integer_or(r, o, "levels", 0, ASCC_ARCHITECTURE_LEVELS, 0);
    a->coarse_layers = integer_or(r, o, "coarse_layers", 1, 16, a->coarse_layers);
    if (a->levels || has(r, o, "coarse_channels"))
        ascc_members_numbers(r, o, "coarse_channels", (size_t)a->levels, 1.0,
                             ASCC_ARCHITECTURE_CHANNELS, channels);
    for (int32_t i = 0; i < a->levels; i++) {
        a->coarse_channels[i] = (int32_t)channels[i];
        if ((double)a->coarse_channels[i] != channels[i])
            ascc_members_fail(r, "'coarse_channels' must be integers");
    }
}

static void read_scene(ascc_members *r, json_t *o, ascc_architecture *a)
{
    a->spacing = ascc_members_number(r, o, "spacing", 1e-6, 1e6);
    a->time_step = ascc_members_number(r, o, "time_step", 1e-9, 1e6);
    a->rest_density = number_or(r, o, "rest_density", 1e-6, 1e9, a->rest_density);
    if (has(r, o, "gravity"))
        ascc_members_numbers(r, o, "gravity", (size_t)a->dimension, -1e6, 1e6, a->gravity);
}

static void read_architecture(ascc_members *r, json_t *o, ascc_architecture *a)
{
    const int32_t dimension = ascc_members_integer(r, o, "dimension", 2, 3);
    const int32_t kernel = choice_or(r, o, "kernel", ascc_architecture_kernels, 2, 0);
    *a = ascc_architecture_default(dimension, (ascc_architecture_family)kernel);
    text_of(r, o, "name", a->name, sizeof a->name);
    if (has(r, o, "description"))
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
}

/* The text of the description that the architecture's numbers make. */
static void read_network(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    char why[256];
    ascc_architecture a;
    json_t *o = ascc_members_object(r, root, "network");
    ascc_members_where(r, "network");
    read_architecture(r, o, &a);
    c->network_seed = (uint64_t)integer_or(r, o, "seed", 0, INT32_MAX, (int32_t)c->options.seed);
    ascc_members_end(r, o);
    if (!ascc_members_good(r))
        return;
    c->network = ascc_architecture_describe(&a, why, sizeof why);
    if (!c->network)
        ascc_members_fail(r, "%s", why);
}

/* The description itself, or the path of a file of it. */
static void read_description(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    char path[ASCC_TRAIN_PATH] = "", why[ASCC_TRAIN_PATH + 64];
    size_t size;
    c->network_seed = c->options.seed;
    if (json_is_object(json_object_get(root, "description"))) {
        json_t *value = ascc_members_object(r, root, "description");
        c->network = ascc_network_text(&(ascc_network_writer){.network = value});
        if (!c->network)
            ascc_members_fail(r, "no memory");
        return;
    }
    path_of(g, root, "description", path);
    if (!ascc_members_good(r))
        return;
    c->network = read_text(path, &size, why, sizeof why);
    if (!c->network)
        ascc_members_fail(r, "%s", why);
}

/* ---- Schedule and options ------------------------------------------------------------------------- */

/* The key, or what it was called once if only that is there. */
static const char *key_of(const json_t *object, const char *key, const char *old)
{
    return !json_object_get(object, key) && json_object_get(object, old) ? old : key;
}

static void read_stages(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    uint64_t end = 0;
    int32_t count = 0;
    ascc_members_where(r, "config");
    const json_t *array = ascc_members_array(r, root, "stages");
    size_t i;
    json_t *stage;
    json_array_foreach(array, i, stage)
    {
        ascc_members_where(r, "stage %d", count + 1);
        if (count == ASCC_TRAIN_STAGES || !json_is_object(stage)) {
            ascc_members_fail(r, "stages are objects, at most %d", ASCC_TRAIN_STAGES);
            break;
        }
        ascc_training_stage *s = &c->stage[count++];
        end += (uint64_t)ascc_members_integer(r, stage, "iterations", 1, 1000000000);
        s->end = end;
        s->unroll = ascc_members_integer(r, stage, key_of(stage, "unroll", "horizon"), 1, 10000);
        s->warm_up = integer_or(r, stage, key_of(stage, "warm_up", "presteps"), 0, 10000, 0);
        s->learning_rate = ascc_members_number(r, stage, "learning_rate", 0.0, 1.0);
        s->learning_rate_end = number_or(r, stage, "learning_rate_end", 1e-30, 1.0, 0.0);
        ascc_members_end(r, stage);
    }
    ascc_members_where(r, "config");
    if (count == 0)
        ascc_members_fail(r, "'stages' is empty");
    c->options.stage = c->stage;
    c->options.stage_size = sizeof *c->stage;
    c->options.stage_count = count;
}

/* Constants of the relaxation that are trained, by their names in model files. */
static uint32_t read_learned(reading *g, json_t *root)
{
    static const struct {
        const char *name;
        uint32_t bit;
    } constants[] = {{"rest_volume", ASCC_LEARN_REST_VOLUME},
                     {"epsilon", ASCC_LEARN_EPSILON},
                     {"omega", ASCC_LEARN_OMEGA},
                     {"divergence", ASCC_LEARN_DIVERGENCE}};
    ascc_members *r = &g->r;
    uint32_t learn = 0;
    if (!has(r, root, "relaxation"))
        return 0;
    json_t *o = ascc_members_object(r, root, "relaxation");
    ascc_members_where(r, "relaxation");
    const json_t *array = ascc_members_array(r, o, "learn");
    size_t i;
    json_t *value;
    json_array_foreach(array, i, value)
    {
        uint32_t bit = 0;
        for (size_t k = 0; k < sizeof constants / sizeof *constants; k++)
            if (json_is_string(value) && strcmp(json_string_value(value), constants[k].name) == 0)
                bit = constants[k].bit;
        if (!bit)
            ascc_members_fail(r, "'learn' lists 'rest_volume', 'epsilon', 'omega', 'divergence'");
        learn |= bit;
    }
    ascc_members_end(r, o);
    ascc_members_where(r, "config");
    return learn;
}

static void read_options(reading *g, json_t *root, ascc_trainer_options *o)
{
    ascc_members *r = &g->r;
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
    o->velocity_weight = number_or(r, root, "velocity_weight", 0.0, MANY, 0.0);
    o->truth_share = number_or(r, root, "truth_share", 0.0, 1.0, 0.0);
    o->whiten = flag_or(r, root, "whiten", true) ? 0 : -1;
    o->relaxation_gradients = flag_or(r, root, "relaxation_gradients", true) ? 0 : -1;
    o->position_gradients = flag_or(r, root, "position_gradients", false);
    o->learn = read_learned(g, root);
    const double gib = number_or(r, root, "memory", 1e-3, 1e6, 0.0);
    o->memory_limit = (size_t)(gib * 1024.0 * 1024.0 * 1024.0);
}

static void read_outputs(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    ascc_members_where(r, "config");
    path_of(g, root, "output", c->output);
    derive(c->output, SUFFIX, c->valid.count ? "-latest.safetensors" : SUFFIX, c->latest);
    derive(c->output, SUFFIX, ".csv", c->log);
    derive(c->output, SUFFIX, ".checkpoint", c->checkpoint);
    if (has(r, root, "log"))
        path_of(g, root, "log", c->log);
    derive(c->log, ".csv", ".svg", c->chart);
    c->checkpoint_seconds = 600.0;
    if (has(r, root, "checkpoint")) {
        json_t *o = ascc_members_object(r, root, "checkpoint");
        ascc_members_where(r, "checkpoint");
        if (has(r, o, "path"))
            path_of(g, o, "path", c->checkpoint);
        c->checkpoint_seconds = number_or(r, o, "every_seconds", 0.0, MANY, 600.0);
        ascc_members_end(r, o);
        ascc_members_where(r, "config");
    }
}

static void read_validation(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    c->validate_every = 500;
    c->validate_frames = 20;
    c->validate_starts = 10;
    c->validate_rollouts = 1;
    if (!has(r, root, "validate"))
        return;
    json_t *o = ascc_members_object(r, root, "validate");
    ascc_members_where(r, "validate");
    if (!c->valid.count)
        ascc_members_fail(r, "there is no 'valid' in 'data'");
    c->validate_every = (uint64_t)integer_or(r, o, "every_iterations", 1, 1000000000, 500);
    c->validate_frames = integer_or(r, o, "frames", 0, 1000000, 20);
    c->validate_starts = integer_or(r, o, "starts", 1, 1000000, 10);
    c->validate_rollouts = integer_or(r, o, "rollouts", 0, 1000000, 1);
    ascc_members_end(r, o);
    ascc_members_where(r, "config");
}

static void read_all(reading *g, json_t *root, ascc_train_config *c)
{
    ascc_members *r = &g->r;
    ascc_members_where(r, "config");
    read_options(g, root, &c->options);
    const bool described = has(r, root, "description");
    const bool built = has(r, root, "network");
    if (has(r, root, "model"))
        path_of(g, root, "model", c->model);
    else if (!built && !described)
        ascc_members_fail(r, "'network', 'description' or 'model' is wanted");
    if (built && described)
        ascc_members_fail(r, "'network' and 'description' exclude each other");
    if (built)
        read_network(g, root, c);
    if (described)
        read_description(g, root, c);
    read_data(g, root, c);
    read_stages(g, root, c);
    read_outputs(g, root, c);
    read_validation(g, root, c);
    ascc_members_end(r, root);
}

/* ---- The file ------------------------------------------------------------------------------------- */

bool ascc_train_config_read(const char *path, ascc_train_config *c, char *error, size_t capacity)
{
    size_t size;
    memset(c, 0, sizeof *c);
    char *text = read_text(path, &size, error, capacity);
    if (!text)
        return false;
    json_error_t why;
    json_t *root = json_loadb(text, size, JSON_REJECT_DUPLICATES, &why);
    reading g = {.r = {.taken = json_array()}};
    (void)snprintf(g.folder, sizeof g.folder, "%.*s", (int)(ascc_system_name(path) - path), path);
    ascc_members_where(&g.r, "config");
    if (!root)
        ascc_members_fail(&g.r, "line %d: %s", why.line, why.text);
    else if (!json_is_object(root))
        ascc_members_fail(&g.r, "not an object");
    else
        read_all(&g, root, c);
    const bool good = ascc_members_good(&g.r);
    if (!good)
        (void)snprintf(error, capacity, "%.300s: %s", path, g.r.error);
    json_decref(root);
    json_decref(g.r.taken);
    free(text);
    return good;
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
    free(c->network);
    c->network = NULL;
}
