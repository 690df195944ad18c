/* The network description of libascc's own model files: JSON text to plan (docs/file-format.md).
 * SPDX-License-Identifier: MIT */
#include "description.h"
#include "file/json_reader.h"

#include <string.h>

#define COUNT(list) ((int32_t)(sizeof(list) / sizeof *(list)))

static const char *const windows[] = {"none", "poly6", "peak"};
static const char *const mappings[] = {"identity", "radial", "volume"};
static const char *const evaluations[] = {"current", "advected", "advected_mean"};
static const char *const features[] = {"one", "velocity", "normal", "motion", "gravity"};
static const char *const samplings[] = {"voxel_centers", "voxel_corners", "farthest"};
static const char *const anchors[] = {"world", "centroid"};
static const char *const term_kinds[] = {"convolution", "dense", "identity", "transfer"};
static const char *const output_kinds[] = {"plain", "antisymmetric"};
static const char *const projections[] = {"none", "radial"};
static const char *const storages[] = {"half", "full"};
static const char *const axes[] = {"x", "y", "z"};

static bool optional_flag(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key) && ascc_reader_flag(reader, object, key);
}

static int32_t optional_integer(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key)
               ? ascc_reader_integer(reader, object, key, 0, INT32_MAX)
               : 0;
}

static void read_text(ascc_plan_builder *builder, ascc_reader *reader, uint32_t object,
                      const char *key, char *into, size_t capacity)
{
    const char *text = ascc_reader_text(reader, object, key);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_text(builder, key, text, into, capacity);
}

static void read_features(ascc_reader *reader, uint32_t object, const char *whose, int32_t *feature,
                          int32_t *count)
{
    const uint32_t list = ascc_reader_array(reader, object, whose);
    *count = 0;
    if (reader->status != ASCC_OK)
        return;
    for (uint32_t i = ascc_json_first(reader->json, list); i != 0;
         i = reader->json->value[i].next) {
        int32_t found = -1;
        for (int32_t f = 0; f < COUNT(features); f++)
            if (strcmp(reader->json->value[i].text, features[f]) == 0)
                found = f;
        if (found < 0 || *count == ASCC_MAX_FEATURES) {
            ascc_reader_fail(reader, "'%s' has too many features or one not understood: '%s'",
                             whose, ascc_quote(reader->json->value[i].text).text);
            return;
        }
        feature[(*count)++] = found;
    }
}

static void read_levels(ascc_reader *reader, uint32_t root, ascc_plan *plan)
{
    if (!ascc_reader_has(reader, root, "levels")) {
        if (ascc_reader_has(reader, root, "sampling"))
            ascc_reader_fail(reader, "'sampling' without 'levels'");
        return;
    }
    const uint32_t list = ascc_reader_array(reader, root, "levels");
    const uint32_t sampling = ascc_reader_object(reader, root, "sampling");
    if (reader->status != ASCC_OK)
        return;
    ascc_reader_where(reader, "network 'sampling'");
    plan->sampling =
        (ascc_sampling)ascc_reader_choice(reader, sampling, "method", samplings, COUNT(samplings));
    if (plan->sampling != ASCC_SAMPLING_FARTHEST)
        plan->centroid_anchor =
            ascc_reader_choice(reader, sampling, "anchor", anchors, COUNT(anchors));
    if (plan->sampling == ASCC_SAMPLING_CORNERS)
        plan->hysteresis = ascc_reader_number(reader, sampling, "hysteresis", 0.0, 0.5);
    ascc_reader_end(reader, sampling);

    ascc_reader_where(reader, "network 'levels'");
    for (uint32_t i = ascc_json_first(reader->json, list); i != 0 && reader->status == ASCC_OK;
         i = reader->json->value[i].next) {
        if (plan->level_count == ASCC_MAX_LEVELS) {
            ascc_reader_fail(reader, "more than %d", ASCC_MAX_LEVELS - 1);
        } else if (reader->json->value[i].kind != ASCC_JSON_OBJECT) {
            ascc_reader_fail(reader, "each must be an object");
        } else {
            ascc_level *level = &plan->level[plan->level_count++];
            if (plan->sampling == ASCC_SAMPLING_FARTHEST)
                level->ratio = ascc_reader_number(reader, i, "ratio", ASCC_PLAN_MIN, 1.0);
            else
                level->voxel = ascc_reader_number(reader, i, "voxel", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
            ascc_reader_end(reader, i);
        }
    }
    ascc_reader_where(reader, "network");
}

static void read_head(ascc_plan_builder *builder, ascc_reader *reader)
{
    ascc_plan *plan = &builder->plan;
    read_text(builder, reader, 0, "name", plan->name, sizeof plan->name);
    if (ascc_reader_has(reader, 0, "description"))
        read_text(builder, reader, 0, "description", plan->description, sizeof plan->description);
    plan->dimension = ascc_reader_integer(reader, 0, "dimension", 2, 3);
    plan->time_step = ascc_reader_number(reader, 0, "time_step", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    ascc_reader_numbers(reader, 0, "gravity", plan->dimension, -ASCC_PLAN_MAX, ASCC_PLAN_MAX,
                        plan->gravity);
    plan->spacing = ascc_reader_number(reader, 0, "particle_spacing", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    plan->rest_density =
        ascc_reader_number(reader, 0, "rest_density", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    plan->advection =
        (ascc_advection)ascc_reader_choice(reader, 0, "evaluate", evaluations, COUNT(evaluations));
    if (ascc_reader_has(reader, 0, "boundary_crop"))
        plan->boundary_crop =
            ascc_reader_number(reader, 0, "boundary_crop", ASCC_PLAN_MIN, ASCC_PLAN_MAX);

    const uint32_t object = ascc_reader_object(reader, 0, "features");
    ascc_reader_where(reader, "network 'features'");
    read_features(reader, object, "fluid", plan->fluid_features, &plan->fluid_feature_count);
    read_features(reader, object, "boundary", plan->boundary_features,
                  &plan->boundary_feature_count);
    ascc_reader_end(reader, object);
    ascc_reader_where(reader, "network");
    read_levels(reader, 0, plan);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_begin(builder);
}

/* "fluid", "boundary", "all", "level1" to "level7". Whether the level exists is checked later. */
static int32_t read_set(ascc_reader *reader, uint32_t object)
{
    static const char *const sets[] = {"fluid",  "boundary", "all",    "level1", "level2",
                                       "level3", "level4",   "level5", "level6", "level7"};
    _Static_assert(sizeof sets / sizeof *sets == ASCC_MAX_SETS, "a name for each set");
    return ascc_reader_choice(reader, object, "points", sets, COUNT(sets));
}

static int32_t read_source(ascc_plan_builder *builder, ascc_reader *reader, uint32_t object)
{
    const char *name = ascc_reader_text(reader, object, "source");
    const int32_t source = ascc_plan_find_value(builder, name);
    if (reader->status == ASCC_OK && source < 0)
        ascc_reader_fail(reader, "'source' is '%s', which is not made before it",
                         ascc_quote(name).text);
    return source;
}

/* The kernel of a filter: a grid with window and mapping, or a basis. Harmonics have an order only
 * where the kernel is not central. */
static void read_filter(ascc_reader *reader, uint32_t object, ascc_filter *filter, bool central)
{
    filter->radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    if (ascc_reader_has(reader, object, "basis")) {
        const uint32_t basis = ascc_reader_object(reader, object, "basis");
        filter->bumps = ascc_reader_integer(reader, basis, "bumps", 1, ASCC_MAX_BUMPS);
        if (!central)
            filter->order = ascc_reader_integer(reader, basis, "order", 0, ASCC_MAX_ORDER);
        ascc_reader_end(reader, basis);
    } else {
        filter->window =
            (ascc_window)ascc_reader_choice(reader, object, "window", windows, COUNT(windows));
        filter->mapping =
            (ascc_mapping)ascc_reader_choice(reader, object, "mapping", mappings, COUNT(mappings));
    }
    filter->neighbor_limit = optional_integer(reader, object, "neighbor_limit");
}

static void read_term(ascc_plan_builder *builder, ascc_reader *reader, uint32_t object)
{
    ascc_term term = {.kind = (ascc_term_kind)ascc_reader_choice(reader, object, "type", term_kinds,
                                                                 COUNT(term_kinds))};
    const char *weight = NULL, *bias = NULL;
    term.source = read_source(builder, reader, object);
    term.rectify = optional_flag(reader, object, "relu");
    term.column = optional_integer(reader, object, "column");
    if (term.kind == ASCC_TERM_CONVOLUTION) {
        weight = ascc_reader_text(reader, object, "kernel");
        read_filter(reader, object, &term.filter, false);
        term.filter.skip_self = optional_flag(reader, object, "skip_self");
        term.relative = optional_flag(reader, object, "relative");
    } else if (term.kind != ASCC_TERM_IDENTITY) {
        weight = ascc_reader_text(reader, object, "weight");
    }
    if (term.kind == ASCC_TERM_TRANSFER)
        term.normalize = optional_flag(reader, object, "normalize");
    if (weight && ascc_reader_has(reader, object, "bias"))
        bias = ascc_reader_text(reader, object, "bias");
    ascc_reader_end(reader, object);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_add_term(builder, &term, weight, bias);
}

static void read_layer(ascc_plan_builder *builder, ascc_reader *reader, uint32_t object)
{
    ascc_json *json = reader->json;
    const char *name = ascc_reader_text(reader, object, "name");
    ascc_reader_where(reader, "layer '%.31s'", ascc_quote(name).text);
    const int32_t set = read_set(reader, object);
    const int32_t channels = ascc_reader_integer(reader, object, "channels", 1, ASCC_MAX_CHANNELS);
    const uint32_t terms = ascc_reader_array(reader, object, "terms");
    ascc_reader_end(reader, object);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_add_layer(builder, name, set, channels);
    if (reader->status != ASCC_OK)
        return;
    int number = 0;
    for (uint32_t i = ascc_json_first(json, terms); i != 0 && reader->status == ASCC_OK;
         i = json->value[i].next) {
        ascc_reader_where(reader, "layer '%.31s' term %d", ascc_quote(name).text, number++);
        if (json->value[i].kind != ASCC_JSON_OBJECT)
            ascc_reader_fail(reader, "it must be an object");
        else
            read_term(builder, reader, i);
    }
}

static void read_layers(ascc_plan_builder *builder, ascc_reader *reader)
{
    ascc_json *json = reader->json;
    const uint32_t list = ascc_reader_array(reader, 0, "layers");
    if (reader->status != ASCC_OK)
        return;
    for (uint32_t i = ascc_json_first(json, list); i != 0 && reader->status == ASCC_OK;
         i = json->value[i].next) {
        ascc_reader_where(reader, "layer %d", (int)builder->plan.layer_count);
        if (json->value[i].kind != ASCC_JSON_OBJECT)
            ascc_reader_fail(reader, "it must be an object");
        else
            read_layer(builder, reader, i);
    }
}

/* One number for all directions, or one for each. */
static void read_scale(ascc_reader *reader, uint32_t object, int32_t dimension, double *scale)
{
    const ascc_json *json = reader->json;
    for (uint32_t i = ascc_json_first(json, object); i != 0; i = json->value[i].next)
        if (strcmp(json->value[i].name, "scale") == 0 && json->value[i].kind == ASCC_JSON_ARRAY) {
            ascc_reader_numbers(reader, object, "scale", dimension, -ASCC_PLAN_MAX, ASCC_PLAN_MAX,
                                scale);
            return;
        }
    const double number =
        ascc_reader_number(reader, object, "scale", -ASCC_PLAN_MAX, ASCC_PLAN_MAX);
    for (int32_t i = 0; i < dimension; i++)
        scale[i] = number;
}

static const char *optional_text(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_has(reader, object, key) ? ascc_reader_text(reader, object, key) : NULL;
}

/* What only an output with a basis has. */
static void read_central(ascc_reader *reader, uint32_t object, ascc_output *output,
                         ascc_output_names *names)
{
    static const char *const directions[] = {"current"};
    if (ascc_reader_has(reader, object, "direction"))
        output->current_direction =
            1 + ascc_reader_choice(reader, object, "direction", directions, COUNT(directions));
    names->damping = optional_text(reader, object, "damping");
    if (ascc_reader_has(reader, object, "limit"))
        output->limit = ascc_reader_number(reader, object, "limit", 1e-30, ASCC_PLAN_MAX);
    if (!ascc_reader_has(reader, object, "walls"))
        return;
    const uint32_t walls = ascc_reader_object(reader, object, "walls");
    ascc_reader_where(reader, "output 'walls'");
    output->walls.present = 1;
    names->wall_weight = ascc_reader_text(reader, walls, "kernel");
    names->wall_damping = optional_text(reader, walls, "damping");
    read_filter(reader, walls, &output->walls.filter, true);
    if (ascc_reader_has(reader, walls, "contact"))
        output->walls.contact =
            ascc_reader_number(reader, walls, "contact", 0.0, output->walls.filter.radius);
    ascc_reader_end(reader, walls);
    ascc_reader_where(reader, "output");
}

static void read_output(ascc_plan_builder *builder, ascc_reader *reader)
{
    ascc_output output = {.kind = ASCC_OUTPUT_PLAIN};
    ascc_output_names names = {NULL, NULL, NULL, NULL};
    int32_t storage = ASCC_FULL;
    ascc_reader_where(reader, "network");
    const uint32_t object = ascc_reader_object(reader, 0, "output");
    ascc_reader_where(reader, "output");
    if (reader->status != ASCC_OK)
        return;
    output.kind = (ascc_output_kind)ascc_reader_choice(reader, object, "type", output_kinds,
                                                       COUNT(output_kinds));
    output.source = read_source(builder, reader, object);
    output.rectify = optional_flag(reader, object, "relu");
    read_scale(reader, object, builder->plan.dimension, output.scale);
    if (output.kind == ASCC_OUTPUT_ANTISYMMETRIC) {
        names.weight = ascc_reader_text(reader, object, "kernel");
        read_filter(reader, object, &output.filter, true);
        if (output.filter.bumps)
            read_central(reader, object, &output, &names);
    }
    if (output.kind == ASCC_OUTPUT_ANTISYMMETRIC && !output.filter.bumps) {
        output.radial =
            ascc_reader_choice(reader, object, "projection", projections, COUNT(projections));
        if (ascc_reader_choice(reader, object, "stored", storages, COUNT(storages)) == 0)
            storage = ascc_reader_choice(reader, object, "half_axis", axes, COUNT(axes));
    }
    ascc_reader_end(reader, object);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_set_output(builder, &output, &names, storage);
}

ascc_status ascc_description_read(ascc_plan_builder *builder, const char *text)
{
    ascc_json json;
    const ascc_status status =
        ascc_json_open(&builder->allocator, text, strlen(text), &json, builder->message);
    if (status != ASCC_OK)
        return status;
    ascc_reader reader = {.json = &json, .message = builder->message, .status = ASCC_OK};
    ascc_reader_where(&reader, "network");
    if (json.value[0].kind != ASCC_JSON_OBJECT) {
        ascc_reader_fail(&reader, "it must be a JSON object");
    } else {
        read_head(builder, &reader);
        read_layers(builder, &reader);
        read_output(builder, &reader);
        ascc_reader_where(&reader, "network");
        ascc_reader_end(&reader, 0);
    }
    ascc_json_close(&json);
    return reader.status;
}
