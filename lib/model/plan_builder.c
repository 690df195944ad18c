/* Collects the layers of a network and checks each against the tensors of its file, or lists them.
 * SPDX-License-Identifier: MIT */
#include "plan_builder.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "operation.h"

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)
#define UNUSED SIZE_MAX
#define MAX_WEIGHTS ((size_t)1 << 29)

ascc_status ascc_plan_open(const ascc_allocator *allocator, const ascc_safetensors *file,
                           ascc_plan_builder *builder, ascc_message *message)
{
    *builder = (ascc_plan_builder){.allocator = *allocator, .file = file, .message = message};
    builder->plan.level_count = 1;
    builder->plan.output.term.source = -1;
    builder->tensor_capacity = file ? file->tensor_count : ASCC_SAFETENSORS_MAX_TENSORS;
    builder->tensor_count = file ? file->tensor_count : 0;
    builder->offset = ascc_allocate(allocator, builder->tensor_capacity, sizeof *builder->offset);
    builder->tensor =
        file ? file->tensor
             : ascc_allocate(allocator, builder->tensor_capacity, sizeof *builder->tensor);
    if (!builder->offset || !builder->tensor) {
        ascc_plan_close(builder);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for the plan");
    }
    for (size_t i = 0; i < builder->tensor_capacity; i++)
        builder->offset[i] = UNUSED;
    return ASCC_OK;
}

static void release_tensors(ascc_plan_builder *builder)
{
    for (size_t i = 0; i < builder->tensor_count; i++)
        ascc_release(&builder->allocator, (char *)builder->tensor[i].name,
                     strlen(builder->tensor[i].name) + 1, 1);
    ascc_release(&builder->allocator, builder->tensor, builder->tensor_capacity,
                 sizeof *builder->tensor);
}

void ascc_plan_close(ascc_plan_builder *builder)
{
    if (builder->layer)
        ascc_release(&builder->allocator, builder->layer, builder->layer_capacity,
                     sizeof *builder->layer);
    if (builder->term)
        ascc_release(&builder->allocator, builder->term, builder->term_capacity,
                     sizeof *builder->term);
    if (builder->offset)
        ascc_release(&builder->allocator, builder->offset, builder->tensor_capacity,
                     sizeof *builder->offset);
    if (builder->tensor && !builder->file)
        release_tensors(builder);
    builder->layer = NULL;
    builder->term = NULL;
    builder->offset = NULL;
    builder->tensor = NULL;
}

ascc_status ascc_plan_text(ascc_plan_builder *builder, const char *what, const char *text,
                           char *into, size_t capacity)
{
    const size_t length = strlen(text);
    if (length >= capacity)
        return FAIL("%s '%s' has %zu bytes; at most %zu fit", what, ascc_quote(text).text, length,
                    capacity - 1);
    memcpy(into, text, length + 1);
    return ASCC_OK;
}

/* ---- What the plan says about itself ------------------------------------------------------------ */

static bool positive(double value)
{
    return value >= ASCC_PLAN_MIN && value <= ASCC_PLAN_MAX;
}

static ascc_status check_features(ascc_plan_builder *builder, const char *whose,
                                  const int32_t *feature, int32_t count, ascc_feature vector,
                                  int32_t *channels)
{
    *channels = 0;
    if (count < 0 || count > ASCC_MAX_FEATURES)
        return FAIL("%d features of the %s; at most %d", (int)count, whose, ASCC_MAX_FEATURES);
    for (int32_t i = 0; i < count; i++) {
        if (feature[i] != ASCC_FEATURE_ONE && feature[i] != ASCC_FEATURE_MOTION &&
            feature[i] != (int32_t)vector &&
            !((feature[i] == ASCC_FEATURE_GRAVITY || feature[i] == ASCC_FEATURE_HISTORY) &&
              vector == ASCC_FEATURE_VELOCITY) &&
            !(feature[i] == ASCC_FEATURE_AREA && vector == ASCC_FEATURE_NORMAL))
            return FAIL("a feature that the %s does not have", whose);
        for (int32_t j = 0; j < i; j++)
            if (feature[i] == feature[j])
                return FAIL("a feature of the %s is given twice", whose);
        *channels += ascc_feature_channels(&builder->plan, feature[i]);
    }
    return ASCC_OK;
}

static ascc_status check_levels(ascc_plan_builder *builder)
{
    const ascc_plan *plan = &builder->plan;
    if (plan->level_count < 1 || plan->level_count > ASCC_MAX_LEVELS)
        return FAIL("%d levels; at most %d, the particles included", (int)plan->level_count,
                    ASCC_MAX_LEVELS);
    for (int32_t i = 1; i < plan->level_count; i++) {
        if (plan->sampling == ASCC_SAMPLING_FARTHEST) {
            if (!(plan->level[i].ratio > 0.0 && plan->level[i].ratio <= 1.0))
                return FAIL("level %d: 'ratio' must be within (0, 1]", (int)i);
        } else if (!positive(plan->level[i].voxel)) {
            return FAIL("level %d: 'voxel' must be a positive length", (int)i);
        }
    }
    if (plan->level_count > 1 && plan->centroid_anchor && plan->sampling != ASCC_SAMPLING_CORNERS)
        return FAIL("the anchor 'centroid' is for 'voxel_corners' only");
    if (!(plan->hysteresis >= 0.0 && plan->hysteresis <= 0.5))
        return FAIL("hysteresis is %g voxels, but must be within [0, 0.5]", plan->hysteresis);
    return ASCC_OK;
}

ascc_status ascc_plan_begin(ascc_plan_builder *builder)
{
    ascc_plan *plan = &builder->plan;
    if (plan->dimension != 2 && plan->dimension != 3)
        return FAIL("dimension is %d, but must be 2 or 3", (int)plan->dimension);
    if (!positive(plan->time_step) || !positive(plan->spacing) || !positive(plan->rest_density))
        return FAIL("time step, particle spacing and rest density must be positive");
    for (int i = 0; i < 3; i++)
        if (!(fabs(plan->gravity[i]) <= ASCC_PLAN_MAX))
            return FAIL("gravity is not finite");
    if (!(plan->boundary_crop <= ASCC_PLAN_MAX))
        return FAIL("the boundary crop is not finite");
    ascc_status status =
        check_features(builder, "fluid", plan->fluid_features, plan->fluid_feature_count,
                       ASCC_FEATURE_VELOCITY, &plan->fluid_channels);
    if (status == ASCC_OK)
        status = check_features(builder, "boundary", plan->boundary_features,
                                plan->boundary_feature_count, ASCC_FEATURE_NORMAL,
                                &plan->boundary_channels);
    const bool reads = ascc_plan_feature(plan, 0, ASCC_FEATURE_HISTORY) >= 0;
    if (status == ASCC_OK && reads != (plan->history > 0))
        return FAIL("'history' is %d, but the fluid has %s feature 'history'", (int)plan->history,
                    reads ? "a" : "no");
    return status == ASCC_OK ? check_levels(builder) : status;
}

/* ---- Values ------------------------------------------------------------------------------------- */

int32_t ascc_plan_find_value(const ascc_plan_builder *builder, const char *name)
{
    if (strcmp(name, "fluid") == 0)
        return 0;
    if (strcmp(name, "boundary") == 0)
        return 1;
    for (int32_t i = 0; i < builder->plan.layer_count; i++)
        if (strcmp(name, builder->layer[i].name) == 0)
            return i + 2;
    return -1;
}

/* Two sets have rows in common that a dense or identity term can act on. */
static bool share_rows(int32_t a, int32_t b)
{
    return a == b || (a == ASCC_SET_ALL && b < ASCC_SET_ALL) ||
           (b == ASCC_SET_ALL && a < ASCC_SET_ALL);
}

/* ---- Tensors ------------------------------------------------------------------------------------ */

static int32_t find_by_name(const ascc_plan_builder *builder, const char *name)
{
    if (builder->file)
        return ascc_safetensors_find(builder->file, name);
    for (size_t i = 0; i < builder->tensor_count; i++)
        if (strcmp(builder->tensor[i].name, name) == 0)
            return (int32_t)i;
    return -1;
}

/* "[4, ?, 8]", with the text given for 0. */
typedef struct shape_text {
    char text[8 * 24];
} shape_text;

static shape_text shape_of(int32_t rank, const size_t *shape, const char *zero)
{
    shape_text t = {"["};
    size_t used = 1;
    for (int32_t i = 0; i < rank; i++) {
        char number[24];
        snprintf(number, sizeof number, "%zu", shape[i]);
        used += (size_t)snprintf(t.text + used, sizeof t.text - used, "%s%s", i ? ", " : "",
                                 shape[i] ? number : zero);
    }
    snprintf(t.text + used, sizeof t.text - used, "]");
    return t;
}

/* Lists a tensor of that shape, all of which the description tells. */
static ascc_status list_tensor(ascc_plan_builder *builder, const char *name,
                               const ascc_tensor_wanted *wanted, int32_t *index)
{
    ascc_tensor tensor = {
        .type = "F32", .element_size = sizeof(float), .rank = wanted->rank, .count = 1};
    for (int32_t i = 0; i < wanted->rank; i++) {
        if (!wanted->shape[i])
            return FAIL(
                "tensor '%s' must have the shape %s (%s), of which the description does not "
                "tell all: 'cells' and 'outputs' do",
                ascc_quote(name).text, shape_of(wanted->rank, wanted->shape, "?").text,
                wanted->dimensions);
        tensor.shape[i] = wanted->shape[i];
        if (!ascc_multiply_size(tensor.count, wanted->shape[i], &tensor.count))
            return FAIL("tensor '%s' is too large", ascc_quote(name).text);
    }
    if (strcmp(name, "__metadata__") == 0)
        return FAIL("a tensor cannot be called '%s'", name);
    if (builder->tensor_count == builder->tensor_capacity)
        return FAIL("more than %d tensors", ASCC_SAFETENSORS_MAX_TENSORS);
    char *copy = ascc_allocate(&builder->allocator, strlen(name) + 1, 1);
    if (!copy)
        return ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for tensors");
    tensor.name = strcpy(copy, name);
    *index = (int32_t)builder->tensor_count;
    builder->tensor[builder->tensor_count++] = tensor;
    return ASCC_OK;
}

static ascc_status find_tensor(ascc_plan_builder *builder, const char *name,
                               const ascc_tensor_wanted *wanted, int32_t *index)
{
    *index = find_by_name(builder, name);
    if (*index < 0) {
        if (builder->file)
            return FAIL("tensor '%s' is missing", ascc_quote(name).text);
        const ascc_status status = list_tensor(builder, name, wanted, index);
        if (status != ASCC_OK)
            return status;
    }
    const ascc_tensor *tensor = &builder->tensor[*index];
    if (!ascc_tensor_is_float(tensor))
        return FAIL("tensor '%s' is %s; weights must be F32, F16 or BF16", ascc_quote(name).text,
                    tensor->type);
    bool fits = tensor->rank == wanted->rank;
    for (int32_t i = 0; i < wanted->rank; i++)
        fits = fits && wanted->shape[i] && tensor->shape[i] == wanted->shape[i];
    if (!fits)
        return FAIL("tensor '%s' has the shape %s, but must have %s: %s", ascc_quote(name).text,
                    shape_of(tensor->rank, tensor->shape, "0").text,
                    shape_of(wanted->rank, wanted->shape, "?").text, wanted->dimensions);
    builder->offset[*index] = 0;
    return ASCC_OK;
}

/* Tensors of a term, and the numbers that the description leaves open, from the first one's shape. */
static ascc_status find_tensors(ascc_plan_builder *builder, ascc_term_entry *entry,
                                const char *const name[ASCC_MAX_TENSORS])
{
    static const size_t nothing[ASCC_SAFETENSORS_MAX_RANK];
    const ascc_operation *operation = entry->term.operation;
    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS] = {{0}};
    ascc_status status = ASCC_OK;
    if (!operation->tensors)
        return ASCC_OK;
    const int32_t first = name[0] ? find_by_name(builder, name[0]) : -1;
    operation->tensors(&builder->plan, &entry->term,
                       first < 0 ? nothing : builder->tensor[first].shape, wanted);
    for (int i = 0; i < ASCC_MAX_TENSORS && status == ASCC_OK; i++)
        if (name[i])
            status = find_tensor(builder, name[i], &wanted[i], &entry->tensor[i]);
    return status;
}

void ascc_plan_take_outputs(ascc_term *term, size_t stored)
{
    if (term->outputs == 0 && stored <= ASCC_MAX_CHANNELS)
        term->outputs = (int32_t)stored;
}

void ascc_plan_want_bias(const ascc_term *term, ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    wanted[ASCC_TENSOR_BIAS] =
        (ascc_tensor_wanted){.dimensions = "outputs", .rank = 1, .shape = {(size_t)term->outputs}};
}

void ascc_plan_want_matrix(ascc_term *term, const size_t *stored,
                           ascc_tensor_wanted wanted[ASCC_MAX_TENSORS])
{
    ascc_plan_take_outputs(term, stored[1]);
    wanted[ASCC_TENSOR_WEIGHT] =
        (ascc_tensor_wanted){.dimensions = "inputs, outputs",
                             .rank = 2,
                             .shape = {(size_t)term->inputs, (size_t)term->outputs}};
    ascc_plan_want_bias(term, wanted);
}

/* Cells of a kernel: known, in no greater number than fits. */
static ascc_status check_cells(ascc_plan_builder *builder, const ascc_filter *filter,
                               const char *name)
{
    int64_t total = 1;
    for (int axis = 0; axis < 3; axis++) {
        total *= filter->cells[axis];
        if (filter->cells[axis] < 1 || total > ASCC_MAX_CELLS)
            return FAIL("%s: a kernel of no or more than %d cells", name, ASCC_MAX_CELLS);
    }
    if (builder->plan.dimension == 2 && filter->cells[2] != 1)
        return FAIL("%s: a kernel has %d cells along z, but must have 1 in 2D", name,
                    (int)filter->cells[2]);
    return ASCC_OK;
}

ascc_status ascc_plan_check_filter(ascc_plan_builder *builder, const ascc_filter *filter,
                                   const char *name)
{
    if (!positive(filter->radius))
        return FAIL("%s: 'radius' must be a positive length", name);
    if (filter->neighbor_limit < 0)
        return FAIL("%s: the neighbour limit is negative", name);
    if (filter->bumps < 0 || filter->bumps > ASCC_MAX_BUMPS)
        return FAIL("%s: 'bumps' must be within 1 and %d", name, ASCC_MAX_BUMPS);
    if (filter->order < 0 || filter->order > ASCC_MAX_ORDER)
        return FAIL("%s: 'order' must be within 0 and %d", name, ASCC_MAX_ORDER);
    return check_cells(builder, filter, name);
}

ascc_status ascc_plan_check_shared(ascc_plan_builder *builder, const ascc_layer *layer,
                                   const ascc_term *term)
{
    if (share_rows(ascc_plan_value_set(builder->layer, term->source), layer->set))
        return ASCC_OK;
    return FAIL("layer '%s': a source that shares no points with the layer",
                ascc_quote(layer->name).text);
}

/* ---- Layers and terms --------------------------------------------------------------------------- */

static ascc_status check_layer_name(ascc_plan_builder *builder, const char *name)
{
    if (name[0] == '\0' || strcmp(name, "all") == 0 || ascc_plan_find_value(builder, name) >= 0)
        return FAIL("layer name '%s' is empty, taken or reserved", ascc_quote(name).text);
    return ASCC_OK;
}

ascc_status ascc_plan_add_layer(ascc_plan_builder *builder, const char *name, int32_t set,
                                int32_t channels)
{
    ascc_plan *plan = &builder->plan;
    ascc_layer layer = {.set = set, .channels = channels, .first_term = plan->term_count};
    ascc_status status = check_layer_name(builder, name);
    if (status == ASCC_OK)
        status = ascc_plan_text(builder, "layer name", name, layer.name, sizeof layer.name);
    if (status != ASCC_OK)
        return status;
    if (set == ASCC_SET_EDGES && !(plan->edge_radius > 0.0))
        return FAIL("layer '%s' lies on 'edges', but the network does not say which: 'edges'",
                    ascc_quote(name).text);
    if (set < 0 || (set >= ASCC_SET_LEVEL + plan->level_count - 1 && set != ASCC_SET_EDGES))
        return FAIL("layer '%s': no such level", ascc_quote(name).text);
    if (channels < 1 || channels > ASCC_MAX_CHANNELS)
        return FAIL("layer '%s': channels must be within 1 and %d", ascc_quote(name).text,
                    ASCC_MAX_CHANNELS);
    if (plan->layer_count > 0 && builder->layer[plan->layer_count - 1].term_count == 0)
        return FAIL("layer '%s' has no terms",
                    ascc_quote(builder->layer[plan->layer_count - 1].name).text);
    if (plan->layer_count == ASCC_MAX_LAYERS)
        return FAIL("more than %d layers", ASCC_MAX_LAYERS);
    void *memory = builder->layer;
    if (!ascc_grow(&builder->allocator, &memory, &builder->layer_capacity,
                   (size_t)plan->layer_count + 1, sizeof layer))
        return ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for layers");
    builder->layer = memory;
    builder->layer[plan->layer_count++] = layer;
    return ASCC_OK;
}

/* What every term obeys, whatever its operation. */
static ascc_status check_term(ascc_plan_builder *builder, ascc_term_entry *entry,
                              const char *const name[ASCC_MAX_TENSORS])
{
    ascc_plan *plan = &builder->plan;
    ascc_term *term = &entry->term;
    const ascc_layer *layer = &builder->layer[plan->layer_count - 1];
    if (term->source < 0 || term->source >= plan->layer_count + 1)
        return FAIL("layer '%s': a source that is not made before it",
                    ascc_quote(layer->name).text);
    term->inputs = ascc_plan_value_channels(plan, builder->layer, term->source);
    term->gathered = term->inputs;
    if (term->inputs == 0)
        return FAIL("layer '%s': a source without channels", ascc_quote(layer->name).text);
    if ((layer->set == ASCC_SET_EDGES ||
         ascc_plan_value_set(builder->layer, term->source) == ASCC_SET_EDGES) &&
        term->operation->lists && !term->operation->ends)
        return FAIL("layer '%s': '%s' neither reads edges nor lies on them",
                    ascc_quote(layer->name).text, term->operation->type);
    const int32_t given = term->outputs;
    if (!term->operation->tensors || !name[0])
        term->outputs = term->inputs;
    else if (!given && !builder->file)
        term->outputs = layer->channels > term->column ? layer->channels - term->column : 0;
    ascc_status status = find_tensors(builder, entry, name);
    if (status == ASCC_OK)
        status = term->operation->check(builder, layer, entry, name);
    if (status != ASCC_OK)
        return status;
    if (given && given != term->outputs)
        return FAIL("layer '%s': 'outputs' is %d, but a term gives %d channels",
                    ascc_quote(layer->name).text, (int)given, (int)term->outputs);
    if (term->column < 0 || term->column > layer->channels - term->outputs)
        return FAIL("layer '%s': columns [%ld, %ld) of a term lie beyond its %d channels",
                    ascc_quote(layer->name).text, (long)term->column,
                    (long)term->column + term->outputs, (int)layer->channels);
    return ASCC_OK;
}

static void open_entry(ascc_term_entry *entry, const ascc_term *term)
{
    entry->term = *term;
    for (int i = 0; i < ASCC_MAX_TENSORS; i++)
        entry->tensor[i] = -1;
}

ascc_status ascc_plan_add_term(ascc_plan_builder *builder, const ascc_term *term,
                               const char *const name[ASCC_MAX_TENSORS])
{
    ascc_plan *plan = &builder->plan;
    ascc_term_entry entry;
    assert(plan->layer_count > 0 && term->operation->forward);
    open_entry(&entry, term);
    if (plan->term_count == ASCC_MAX_TERMS)
        return FAIL("more than %d terms", ASCC_MAX_TERMS);
    const ascc_status status = check_term(builder, &entry, name);
    if (status != ASCC_OK)
        return status;
    void *memory = builder->term;
    if (!ascc_grow(&builder->allocator, &memory, &builder->term_capacity,
                   (size_t)plan->term_count + 1, sizeof entry))
        return ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for terms");
    builder->term = memory;
    builder->term[plan->term_count++] = entry;
    builder->layer[plan->layer_count - 1].term_count++;
    return ASCC_OK;
}

ascc_status ascc_plan_set_output(ascc_plan_builder *builder, const ascc_output *output,
                                 const char *const name[ASCC_MAX_TENSORS])
{
    ascc_plan *plan = &builder->plan;
    plan->output = *output;
    open_entry(&builder->output, &output->term);
    ascc_term *term = &builder->output.term;
    if (plan->layer_count > 0 && builder->layer[plan->layer_count - 1].term_count == 0)
        return FAIL("layer '%s' has no terms",
                    ascc_quote(builder->layer[plan->layer_count - 1].name).text);
    if (term->source < 0 || term->source >= plan->layer_count + 2)
        return FAIL("output: a source that does not exist");
    const int32_t set = ascc_plan_value_set(builder->layer, term->source);
    if (set != ASCC_SET_FLUID && set != ASCC_SET_ALL)
        return FAIL("output: its source must lie on the points 'fluid' or 'all'");
    term->inputs = ascc_plan_value_channels(plan, builder->layer, term->source);
    term->outputs = term->operation->tensors ? plan->dimension : term->inputs;
    if (term->inputs == 0)
        return FAIL("output: a source without channels");
    for (int i = 0; i < 3; i++)
        if (!(fabs(plan->output.scale[i]) <= ASCC_PLAN_MAX))
            return FAIL("output: 'scale' is not finite");
    ascc_status status = find_tensors(builder, &builder->output, name);
    if (status == ASCC_OK)
        status = term->operation->check(builder, NULL, &builder->output, name);
    if (status != ASCC_OK)
        return status;
    if (term->outputs != plan->dimension)
        return FAIL("output: %d channels, but the dimension is %d", (int)term->outputs,
                    (int)plan->dimension);
    return ASCC_OK;
}

/* ---- Weights ------------------------------------------------------------------------------------ */

/* A term whose tensors lie in the weights. */
static ascc_term placed_term(const ascc_plan_builder *builder, const ascc_term_entry *entry,
                             const float *weights)
{
    ascc_term term = entry->term;
    for (int i = 0; i < ASCC_MAX_TENSORS; i++)
        term.tensor[i] = entry->tensor[i] < 0 ? NULL : weights + builder->offset[entry->tensor[i]];
    return term;
}

/* Numbers that a tensor may not hold, once it has been read. */
static ascc_status check_numbers(ascc_plan_builder *builder, const ascc_plan *plan,
                                 const ascc_term *term, const ascc_term_entry *entry)
{
    for (int i = 0; i < ASCC_MAX_TENSORS; i++) {
        if (!term->tensor[i] || !(term->operation->not_negative >> i & 1))
            continue;
        const ascc_tensor *tensor = &builder->tensor[entry->tensor[i]];
        for (size_t k = 0; k < tensor->count; k++)
            if (term->tensor[i][k] < 0.0f)
                return FAIL("tensor '%s' has a negative number, but damps",
                            ascc_quote(tensor->name).text);
    }
    const char *why =
        term->operation->check_numbers ? term->operation->check_numbers(plan, term) : NULL;
    if (!why)
        return ASCC_OK;
    return FAIL("tensor '%s' %s",
                ascc_quote(builder->tensor[entry->tensor[ASCC_TENSOR_WEIGHT]].name).text, why);
}

/* Where each tensor will lie; refuses one that nobody reads. */
static ascc_status place_tensors(ascc_plan_builder *builder, size_t *count, uint64_t *parameters)
{
    *count = 0;
    *parameters = 0;
    for (size_t i = 0; i < builder->tensor_count; i++) {
        const ascc_tensor *tensor = &builder->tensor[i];
        if (builder->offset[i] == UNUSED)
            return FAIL("tensor '%s' is not used by the network", ascc_quote(tensor->name).text);
        if (tensor->count > MAX_WEIGHTS - *count)
            return FAIL("the network has more than %zu weights", MAX_WEIGHTS);
        builder->offset[i] = *count;
        *count += ascc_plan_align(tensor->count);
        *parameters += tensor->count;
    }
    return ASCC_OK;
}

ascc_status ascc_plan_finish(ascc_plan_builder *builder, ascc_plan *plan, float **weights,
                             size_t *weight_count)
{
    size_t count;
    *plan = builder->plan;
    *weights = NULL;
    *weight_count = 0;
    ascc_status status = place_tensors(builder, &count, &plan->parameter_count);
    if (status != ASCC_OK)
        return status;
    const size_t layers = (size_t)plan->layer_count, terms = (size_t)plan->term_count;
    plan->layer = ascc_allocate(&builder->allocator, layers, sizeof *plan->layer);
    plan->term = ascc_allocate(&builder->allocator, terms, sizeof *plan->term);
    float *block = ascc_allocate(&builder->allocator, count, sizeof *block);
    if (!plan->layer || !plan->term || !block)
        status = ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for %zu weights", count);
    if (status == ASCC_OK && layers > 0)
        memcpy(plan->layer, builder->layer, layers * sizeof *plan->layer);
    for (size_t i = 0; i < terms && status == ASCC_OK; i++)
        plan->term[i] = placed_term(builder, &builder->term[i], block);
    if (status == ASCC_OK && !builder->file)
        memset(block, 0, count * sizeof *block);
    for (size_t i = 0; builder->file && i < builder->tensor_count && status == ASCC_OK; i++)
        status = ascc_tensor_read_floats(&builder->tensor[i], block + builder->offset[i],
                                         builder->message);
    if (status == ASCC_OK)
        plan->output.term = placed_term(builder, &builder->output, block);
    for (size_t i = 0; i < terms && status == ASCC_OK; i++)
        status = check_numbers(builder, plan, &plan->term[i], &builder->term[i]);
    if (status == ASCC_OK)
        status = check_numbers(builder, plan, &plan->output.term, &builder->output);
    if (status != ASCC_OK) {
        ascc_plan_release(&builder->allocator, plan, block, count);
        return status;
    }
    *weights = block;
    *weight_count = count;
    return ASCC_OK;
}

void ascc_plan_release(const ascc_allocator *allocator, ascc_plan *plan, float *weights,
                       size_t weight_count)
{
    if (plan->layer)
        ascc_release(allocator, plan->layer, (size_t)plan->layer_count, sizeof *plan->layer);
    if (plan->term)
        ascc_release(allocator, plan->term, (size_t)plan->term_count, sizeof *plan->term);
    if (weights)
        ascc_release(allocator, weights, weight_count, sizeof *weights);
    plan->layer = NULL;
    plan->term = NULL;
}
