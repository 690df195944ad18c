/* The network description of libascc's own model files: JSON text to plan (docs/file-format.md).
 * SPDX-License-Identifier: MIT */
#include "description.h"

#include <math.h>
#include <string.h>

#include "operation.h"
#include "relaxation.h"

#define SHORTEST_STEP 0.1  /* of the time step stated */
#define USUAL_WAY 3.0      /* spacings a step, that a particle goes in what models learn from */
#define USUAL_GRAVITY 1.25 /* times the model's own, which is 9.8, 9.80665 or 9.81 */
#define ASCC_MAX_TYPES 32  /* words that `type` may be */
#define COUNT(list) ((int32_t)(sizeof(list) / sizeof *(list)))

static const char *const evaluations[] = {"current", "advected", "advected_mean"};
static const char *const features[] = {"one",     "velocity", "normal", "motion",
                                       "gravity", "area",     "history"};
static const char *const samplings[] = {"voxel_centers", "voxel_corners", "farthest"};
static const char *const sampled[] = {"all", "fluid"};
static const char *const anchors[] = {"world", "centroid"};
static const char *const connected[] = {"fluid", "all"};

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
    if (ascc_reader_has(reader, sampling, "points"))
        plan->fluid_sampled =
            ascc_reader_choice(reader, sampling, "points", sampled, COUNT(sampled));
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

/* Which pairs of points are edges. */
static void read_edges(ascc_reader *reader, ascc_plan *plan)
{
    static const int32_t sets[] = {ASCC_SET_FLUID, ASCC_SET_ALL};
    if (!ascc_reader_has(reader, 0, "edges"))
        return;
    const uint32_t object = ascc_reader_object(reader, 0, "edges");
    ascc_reader_where(reader, "network 'edges'");
    plan->edge_set =
        sets[ascc_reader_choice(reader, object, "points", connected, COUNT(connected))];
    plan->edge_radius = ascc_reader_number(reader, object, "radius", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    ascc_reader_end(reader, object);
    ascc_reader_where(reader, "network");
}

/* The range of time steps that the weights were trained in; without it only the one stated, but shorter
 * ones scale like an acceleration. */
static void read_range(ascc_reader *reader, ascc_plan *plan)
{
    double range[2] = {SHORTEST_STEP * plan->time_step, plan->time_step};
    if (ascc_reader_has(reader, 0, "time_step_range"))
        ascc_reader_numbers(reader, 0, "time_step_range", 2, ASCC_PLAN_MIN, ASCC_PLAN_MAX, range);
    if (reader->status == ASCC_OK && !(range[0] <= plan->time_step && plan->time_step <= range[1]))
        ascc_reader_fail(reader, "'time_step_range' does not hold 'time_step'");
    plan->time_step_min = range[0];
    plan->time_step_max = range[1];
}

/* How much gravity and how fast a particle, in spacings and steps; without it what the model's own gravity comes to
 * in its longest step, and less. */
static void read_trained(ascc_reader *reader, ascc_plan *plan)
{
    double square = 0.0, gravity[2] = {0.0, INFINITY};
    for (int c = 0; c < 3; c++)
        square += plan->gravity[c] * plan->gravity[c];
    if (square > 0.0)
        gravity[1] = USUAL_GRAVITY * sqrt(square) * plan->time_step_max * plan->time_step_max /
                     plan->spacing;
    plan->way_max = USUAL_WAY;
    if (ascc_reader_has(reader, 0, "trained")) {
        const uint32_t trained = ascc_reader_object(reader, 0, "trained");
        ascc_reader_where(reader, "network 'trained'");
        if (ascc_reader_has(reader, trained, "gravity"))
            ascc_reader_numbers(reader, trained, "gravity", 2, 0.0, ASCC_PLAN_MAX, gravity);
        if (ascc_reader_has(reader, trained, "way"))
            plan->way_max =
                ascc_reader_number(reader, trained, "way", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
        ascc_reader_end(reader, trained);
        ascc_reader_where(reader, "network");
    }
    if (reader->status == ASCC_OK && !(gravity[0] <= gravity[1] && gravity[1] > 0.0))
        ascc_reader_fail(reader, "'trained' has no range of 'gravity'");
    plan->gravity_min = gravity[0];
    plan->gravity_max = gravity[1];
}

static void read_head(ascc_plan_builder *builder, ascc_reader *reader)
{
    ascc_plan *plan = &builder->plan;
    read_text(builder, reader, 0, "name", plan->name, sizeof plan->name);
    if (ascc_reader_has(reader, 0, "description"))
        read_text(builder, reader, 0, "description", plan->description, sizeof plan->description);
    plan->dimension = ascc_reader_integer(reader, 0, "dimension", 2, 3);
    plan->time_step = ascc_reader_number(reader, 0, "time_step", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    read_range(reader, plan);
    ascc_reader_numbers(reader, 0, "gravity", plan->dimension, -ASCC_PLAN_MAX, ASCC_PLAN_MAX,
                        plan->gravity);
    plan->spacing = ascc_reader_number(reader, 0, "particle_spacing", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    read_trained(reader, plan);
    plan->rest_density =
        ascc_reader_number(reader, 0, "rest_density", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    plan->advection =
        (ascc_advection)ascc_reader_choice(reader, 0, "evaluate", evaluations, COUNT(evaluations));
    if (ascc_reader_has(reader, 0, "boundary_crop"))
        plan->boundary_crop =
            ascc_reader_number(reader, 0, "boundary_crop", ASCC_PLAN_MIN, ASCC_PLAN_MAX);

    if (ascc_reader_has(reader, 0, "history"))
        plan->history = ascc_reader_integer(reader, 0, "history", 1, ASCC_MAX_HISTORY);
    const uint32_t object = ascc_reader_object(reader, 0, "features");
    ascc_reader_where(reader, "network 'features'");
    read_features(reader, object, "fluid", plan->fluid_features, &plan->fluid_feature_count);
    read_features(reader, object, "boundary", plan->boundary_features,
                  &plan->boundary_feature_count);
    ascc_reader_end(reader, object);
    ascc_reader_where(reader, "network");
    read_levels(reader, 0, plan);
    read_edges(reader, plan);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_begin(builder);
}

/* "fluid", "boundary", "all", "level1" to "level7", "edges". Whether they exist is checked later. */
static int32_t read_set(ascc_reader *reader, uint32_t object)
{
    static const char *const sets[] = {"fluid",  "boundary", "all",    "level1", "level2", "level3",
                                       "level4", "level5",   "level6", "level7", "edges"};
    _Static_assert(sizeof sets / sizeof *sets == ASCC_SET_EDGES + 1, "a name for each set");
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

/* The operation that `type` and the other members of the object mean: of a term, or of an output. */
static const ascc_operation *read_operation(ascc_reader *reader, uint32_t object, bool output)
{
    const char *types[ASCC_MAX_TYPES] = {NULL};
    int32_t count = 0;
    for (const ascc_operation *const *o = ascc_operations; *o; o++) {
        bool known = !(*o)->impulses == output;
        for (int32_t i = 0; i < count; i++)
            known |= strcmp(types[i], (*o)->type) == 0;
        if (!known && count < ASCC_MAX_TYPES)
            types[count++] = (*o)->type;
    }
    const char *type = types[ascc_reader_choice(reader, object, "type", types, count)];
    for (const ascc_operation *const *o = ascc_operations; *o; o++)
        if (!(*o)->impulses != output && strcmp((*o)->type, type) == 0 &&
            (!(*o)->with || ascc_reader_has(reader, object, (*o)->with)))
            return *o;
    ascc_reader_fail(reader, "'%s' lacks what says which kind of it", type);
    return ascc_operations[0];
}

static void read_term(ascc_plan_builder *builder, ascc_reader *reader, uint32_t object)
{
    const char *name[ASCC_MAX_TENSORS] = {NULL};
    ascc_term term = {.operation = read_operation(reader, object, false)};
    term.source = read_source(builder, reader, object);
    term.rectify = ascc_reader_optional_flag(reader, object, "relu");
    term.column = ascc_reader_optional_integer(reader, object, "column");
    if (ascc_reader_has(reader, object, "outputs"))
        term.outputs = ascc_reader_integer(reader, object, "outputs", 1, ASCC_MAX_CHANNELS);
    if (term.operation->read)
        term.operation->read(reader, object, &builder->plan, &term, name);
    ascc_reader_end(reader, object);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_add_term(builder, &term, name);
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

/* The operation of an output by its type. */
static const ascc_operation *find_operation(const char *type)
{
    const ascc_operation *const *o = ascc_operations;
    while (!(*o)->impulses || strcmp((*o)->type, type) != 0)
        o++;
    return *o;
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

static void read_output(ascc_plan_builder *builder, ascc_reader *reader)
{
    const char *name[ASCC_MAX_TENSORS] = {NULL};
    ascc_output output = {.half_axis = -1};
    ascc_reader_where(reader, "network");
    if (builder->plan.relaxation.pressure.count && !ascc_reader_has(reader, 0, "output")) {
        output.term.operation = find_operation("none");
        if (reader->status == ASCC_OK)
            reader->status = ascc_plan_set_output(builder, &output, name);
        return;
    }
    const uint32_t object = ascc_reader_object(reader, 0, "output");
    ascc_reader_where(reader, "output");
    if (reader->status != ASCC_OK)
        return;
    output.term.operation = read_operation(reader, object, true);
    output.term.source = read_source(builder, reader, object);
    output.term.rectify = ascc_reader_optional_flag(reader, object, "relu");
    read_scale(reader, object, builder->plan.dimension, output.scale);
    if (output.term.operation->read)
        output.term.operation->read(reader, object, &builder->plan, &output.term, name);
    ascc_reader_end(reader, object);
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_set_output(builder, &output, name);
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
        ascc_relaxation_read(&reader, 0, builder);
        read_output(builder, &reader);
        ascc_reader_where(&reader, "network");
        ascc_reader_end(&reader, 0);
    }
    ascc_json_close(&json);
    return reader.status;
}
