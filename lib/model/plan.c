/* Collects the layers of a network and checks each against the tensors of its file.
 * SPDX-License-Identifier: MIT */
#include "plan.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define FAIL(...) ascc_fail(builder->message, ASCC_ERROR_FORMAT, __VA_ARGS__)
#define UNUSED SIZE_MAX

ascc_status ascc_plan_open(const ascc_allocator *allocator, const ascc_safetensors *file,
                           ascc_plan_builder *builder, ascc_message *message)
{
    *builder = (ascc_plan_builder){.allocator = *allocator,
                                   .file = file,
                                   .message = message,
                                   .output_tensor = -1,
                                   .damping_tensor = -1,
                                   .wall_tensor = -1,
                                   .wall_damping_tensor = -1};
    builder->plan.level_count = 1;
    builder->plan.output.source = -1;
    builder->offset = ascc_allocate(allocator, file->tensor_count, sizeof *builder->offset);
    if (!builder->offset)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for the plan");
    for (size_t i = 0; i < file->tensor_count; i++)
        builder->offset[i] = UNUSED;
    return ASCC_OK;
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
        ascc_release(&builder->allocator, builder->offset, builder->file->tensor_count,
                     sizeof *builder->offset);
    builder->layer = NULL;
    builder->term = NULL;
    builder->offset = NULL;
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
            !(feature[i] == ASCC_FEATURE_GRAVITY && vector == ASCC_FEATURE_VELOCITY))
            return FAIL("a feature that the %s does not have", whose);
        for (int32_t j = 0; j < i; j++)
            if (feature[i] == feature[j])
                return FAIL("a feature of the %s is given twice", whose);
        *channels += feature[i] == ASCC_FEATURE_ONE ? 1 : builder->plan.dimension;
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

int32_t ascc_plan_value_set(const ascc_layer *layer, int32_t value)
{
    return value < 2 ? value : layer[value - 2].set;
}

int32_t ascc_plan_value_channels(const ascc_plan *plan, const ascc_layer *layer, int32_t value)
{
    return value == 0   ? plan->fluid_channels
           : value == 1 ? plan->boundary_channels
                        : layer[value - 2].channels;
}

/* Two sets have rows in common that a dense or identity term can act on. */
static bool share_rows(int32_t a, int32_t b)
{
    return a == b || (a == ASCC_SET_ALL && b < ASCC_SET_ALL) ||
           (b == ASCC_SET_ALL && a < ASCC_SET_ALL);
}

/* ---- Tensors ------------------------------------------------------------------------------------ */

/* Finds a tensor of the stated rank whose last dimensions are [inputs][outputs]; outputs 0 = any. */
static ascc_status find_tensor(ascc_plan_builder *builder, const char *name, int32_t rank,
                               int32_t *index)
{
    *index = ascc_safetensors_find(builder->file, name);
    if (*index < 0)
        return FAIL("tensor '%s' is missing", ascc_quote(name).text);
    const ascc_tensor *tensor = &builder->file->tensor[*index];
    if (!ascc_tensor_is_float(tensor))
        return FAIL("tensor '%s' is %s; weights must be F32, F16 or BF16", ascc_quote(name).text,
                    tensor->type);
    if (tensor->rank != rank)
        return FAIL("tensor '%s' has %d dimensions, but must have %d", ascc_quote(name).text,
                    (int)tensor->rank, (int)rank);
    builder->offset[*index] = 0;
    return ASCC_OK;
}

static ascc_status check_inputs(ascc_plan_builder *builder, const ascc_tensor *tensor,
                                int32_t inputs, int32_t *outputs)
{
    const size_t in = tensor->shape[tensor->rank - 2], out = tensor->shape[tensor->rank - 1];
    if (in != (size_t)inputs)
        return FAIL("tensor '%s' takes %zu channels, but its source has %d",
                    ascc_quote(tensor->name).text, in, (int)inputs);
    if (out < 1 || out > ASCC_MAX_CHANNELS)
        return FAIL("tensor '%s' gives %zu channels, but must give 1 to %d",
                    ascc_quote(tensor->name).text, out, ASCC_MAX_CHANNELS);
    *outputs = (int32_t)out;
    return ASCC_OK;
}

/* Reads the cells of a kernel [z][y][x][in][out], of which `storage` halves one axis. */
static ascc_status check_cells(ascc_plan_builder *builder, const ascc_tensor *tensor,
                               int32_t storage, int32_t cells[3])
{
    size_t total = 1;
    for (int axis = 0; axis < 3; axis++) {
        const size_t stored = tensor->shape[2 - axis];
        const size_t whole = axis == storage ? 2 * stored : stored;
        if (stored < 1 || stored > ASCC_MAX_CELLS || whole * total > ASCC_MAX_CELLS)
            return FAIL("tensor '%s' is a kernel of no or more than %d cells",
                        ascc_quote(tensor->name).text, ASCC_MAX_CELLS);
        total *= whole;
        cells[axis] = (int32_t)whole;
    }
    if (builder->plan.dimension == 2 && cells[2] != 1)
        return FAIL("tensor '%s' has %d cells along z, but must have 1 in 2D",
                    ascc_quote(tensor->name).text, (int)cells[2]);
    return ASCC_OK;
}

static ascc_status check_filter(ascc_plan_builder *builder, const ascc_filter *filter,
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
    return ASCC_OK;
}

/* Harmonics of all orders up to this one. */
static int32_t harmonic_count(int32_t order, int32_t dimension)
{
    return dimension == 2 ? 2 * order + 1 : (order + 1) * (order + 1);
}

/* Checks a basis against its tensor [bump][harmonic][in][out] and makes it cells. */
static ascc_status check_basis(ascc_plan_builder *builder, const ascc_tensor *tensor,
                               ascc_filter *filter)
{
    const int32_t harmonics = harmonic_count(filter->order, builder->plan.dimension);
    if (tensor->shape[0] != (size_t)filter->bumps || tensor->shape[1] != (size_t)harmonics)
        return FAIL("tensor '%s' is for %zu bumps and %zu harmonics, but its basis has %d and %d",
                    ascc_quote(tensor->name).text, tensor->shape[0], tensor->shape[1],
                    (int)filter->bumps, (int)harmonics);
    const int32_t cells[3] = {harmonics, filter->bumps, 1};
    memcpy(filter->cells, cells, sizeof cells);
    filter->mapping = ASCC_MAPPING_DIRECTION;
    filter->window = ASCC_WINDOW_NONE;
    return ASCC_OK;
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
    if (set < 0 || set >= ASCC_SET_LEVEL + plan->level_count - 1)
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

/* Lengths of a transfer: from the coarser of the two lattices. */
static ascc_status check_transfer(ascc_plan_builder *builder, ascc_term *term, int32_t source_set,
                                  const ascc_layer *layer)
{
    const ascc_plan *plan = &builder->plan;
    const ascc_quoted name = ascc_quote(layer->name);
    const int32_t coarser = source_set > layer->set ? source_set : layer->set;
    term->voxel = 0.0;
    for (int i = 0; i < 2; i++) {
        const int32_t set = i ? layer->set : source_set;
        if (set >= ASCC_SET_LEVEL)
            term->voxel = fmax(term->voxel, plan->level[set - ASCC_SET_LEVEL + 1].voxel);
    }
    if (coarser < ASCC_SET_LEVEL || source_set == layer->set)
        return FAIL("layer '%s': a transfer goes from particles to a level, from a level to "
                    "particles or between two levels",
                    name.text);
    if (plan->sampling == ASCC_SAMPLING_FARTHEST)
        return FAIL("layer '%s': a transfer needs levels on a lattice, not 'farthest'", name.text);
    term->filter = (ascc_filter){.cells = {1, 1, 1},
                                 .window = ASCC_WINDOW_HAT,
                                 .radius = term->voxel * sqrt((double)plan->dimension)};
    return ASCC_OK;
}

static ascc_status check_relative(ascc_plan_builder *builder, const ascc_term *term,
                                  const ascc_layer *layer)
{
    const ascc_plan *plan = &builder->plan;
    if (term->source > 1 || layer->set != ASCC_SET_FLUID || term->rectify ||
        ascc_plan_motion(plan, 0) < 0 || ascc_plan_motion(plan, term->source) < 0)
        return FAIL("layer '%s': 'relative' is for convolutions of the features 'motion', without "
                    "'relu', on the points 'fluid'",
                    ascc_quote(layer->name).text);
    return ASCC_OK;
}

static ascc_status check_term(ascc_plan_builder *builder, ascc_plan_term *entry, const char *weight,
                              const char *bias)
{
    ascc_plan *plan = &builder->plan;
    ascc_term *term = &entry->term;
    const ascc_layer *layer = &builder->layer[plan->layer_count - 1];
    const ascc_quoted name = ascc_quote(layer->name);
    ascc_status status = ASCC_OK;

    if (term->source < 0 || term->source >= plan->layer_count + 1)
        return FAIL("layer '%s': a source that is not made before it", name.text);
    term->inputs = ascc_plan_value_channels(plan, builder->layer, term->source);
    term->outputs = term->inputs;
    if (term->inputs == 0)
        return FAIL("layer '%s': a source without channels", name.text);
    const int32_t source_set = ascc_plan_value_set(builder->layer, term->source);
    if (!ascc_term_searches(term) && !share_rows(source_set, layer->set))
        return FAIL("layer '%s': a source that shares no points with the layer", name.text);

    if (term->kind == ASCC_TERM_TRANSFER)
        status = check_transfer(builder, term, source_set, layer);
    else if (term->relative)
        status = check_relative(builder, term, layer);
    if (status != ASCC_OK)
        return status;

    if (weight) {
        const bool convolution = term->kind == ASCC_TERM_CONVOLUTION;
        const bool basis = convolution && term->filter.bumps > 0;
        status = find_tensor(builder, weight, basis ? 4 : convolution ? 5 : 2, &entry->weight);
        if (status != ASCC_OK)
            return status;
        const ascc_tensor *tensor = &builder->file->tensor[entry->weight];
        status = check_inputs(builder, tensor, term->inputs, &term->outputs);
        if (status == ASCC_OK && basis)
            status = check_basis(builder, tensor, &term->filter);
        else if (status == ASCC_OK && convolution)
            status = check_cells(builder, tensor, ASCC_FULL, term->filter.cells);
        if (status == ASCC_OK && convolution)
            status = check_filter(builder, &term->filter, name.text);
        if (status != ASCC_OK)
            return status;
    }
    if (bias) {
        status = find_tensor(builder, bias, 1, &entry->bias);
        if (status != ASCC_OK)
            return status;
        if (builder->file->tensor[entry->bias].count != (size_t)term->outputs)
            return FAIL("tensor '%s' has %zu values, but its term gives %d channels",
                        ascc_quote(bias).text, builder->file->tensor[entry->bias].count,
                        (int)term->outputs);
    }
    if (term->column < 0 || term->column > layer->channels - term->outputs)
        return FAIL("layer '%s': columns [%ld, %ld) of a term lie beyond its %d channels",
                    name.text, (long)term->column, (long)term->column + term->outputs,
                    (int)layer->channels);
    return ASCC_OK;
}

ascc_status ascc_plan_add_term(ascc_plan_builder *builder, const ascc_term *term,
                               const char *weight, const char *bias)
{
    ascc_plan *plan = &builder->plan;
    ascc_plan_term entry = {.term = *term, .weight = -1, .bias = -1};
    assert(plan->layer_count > 0 && (weight == NULL) == (term->kind == ASCC_TERM_IDENTITY));
    if (plan->term_count == ASCC_MAX_TERMS)
        return FAIL("more than %d terms", ASCC_MAX_TERMS);
    const ascc_status status = check_term(builder, &entry, weight, bias);
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

static ascc_status check_output_grid(ascc_plan_builder *builder, ascc_output *own,
                                     const char *weight, int32_t storage, int32_t *outputs)
{
    ascc_status status = find_tensor(builder, weight, 5, &builder->output_tensor);
    if (status != ASCC_OK)
        return status;
    const ascc_tensor *tensor = &builder->file->tensor[builder->output_tensor];
    builder->output_storage = storage;
    status = check_inputs(builder, tensor, own->inputs, outputs);
    return status == ASCC_OK ? check_cells(builder, tensor, storage, own->filter.cells) : status;
}

/* A tensor [bump][inputs] of a central output, whose basis is made cells here. */
static ascc_status check_central(ascc_plan_builder *builder, const ascc_output *own,
                                 ascc_filter *filter, const char *name, int32_t *index)
{
    const ascc_status status = find_tensor(builder, name, 2, index);
    if (status != ASCC_OK)
        return status;
    const ascc_tensor *tensor = &builder->file->tensor[*index];
    if (tensor->shape[0] != (size_t)filter->bumps || tensor->shape[1] != (size_t)own->inputs)
        return FAIL("tensor '%s' has the shape [%zu, %zu], but must have [%d, %d]: bumps, channels",
                    ascc_quote(tensor->name).text, tensor->shape[0], tensor->shape[1],
                    (int)filter->bumps, (int)own->inputs);
    const int32_t cells[3] = {1, filter->bumps, 1};
    memcpy(filter->cells, cells, sizeof cells);
    filter->mapping = ASCC_MAPPING_DIRECTION;
    filter->window = ASCC_WINDOW_NONE;
    return ASCC_OK;
}

/* What an output with a basis may have besides: each needs one particle's values for each fluid row. */
static ascc_status check_central_parts(ascc_plan_builder *builder, ascc_output *own,
                                       const ascc_output_names *names)
{
    const bool damped = names->damping || names->wall_damping;
    const int32_t set = ascc_plan_value_set(builder->layer, own->source);
    if ((own->walls.present || damped || own->current_direction) && set != ASCC_SET_FLUID)
        return FAIL(
            "output: 'walls', 'damping' and 'direction' need a source on the points 'fluid'");
    if (damped && (!own->rectify || ascc_plan_motion(&builder->plan, 0) < 0))
        return FAIL("output: 'damping' needs 'relu' and the feature 'motion'");
    ascc_status status = ASCC_OK;
    if (names->damping)
        status =
            check_central(builder, own, &own->filter, names->damping, &builder->damping_tensor);
    if (status != ASCC_OK || !own->walls.present)
        return status;
    status = check_filter(builder, &own->walls.filter, "output 'walls'");
    if (status == ASCC_OK && own->walls.filter.bumps == 0)
        return FAIL("output 'walls': a basis is missing");
    if (status == ASCC_OK)
        status = check_central(builder, own, &own->walls.filter, names->wall_weight,
                               &builder->wall_tensor);
    if (status == ASCC_OK && names->wall_damping)
        status = check_central(builder, own, &own->walls.filter, names->wall_damping,
                               &builder->wall_damping_tensor);
    return status;
}

/* Central impulses need one scale for all directions. */
static ascc_status check_output_basis(ascc_plan_builder *builder, ascc_output *own,
                                      const ascc_output_names *names)
{
    const ascc_status status =
        check_central(builder, own, &own->filter, names->weight, &builder->output_tensor);
    if (status != ASCC_OK)
        return status;
    for (int32_t i = 1; i < builder->plan.dimension; i++)
        if (own->scale[i] != own->scale[0])
            return FAIL("output: with a basis 'scale' must be the same in all directions");
    own->radial = 1;
    builder->output_storage = ASCC_FULL;
    return check_central_parts(builder, own, names);
}

ascc_status ascc_plan_set_output(ascc_plan_builder *builder, const ascc_output *output,
                                 const ascc_output_names *names, int32_t storage)
{
    ascc_plan *plan = &builder->plan;
    plan->output = *output;
    ascc_output *own = &plan->output;
    ascc_status status = ASCC_OK;
    int32_t outputs;
    if (plan->layer_count > 0 && builder->layer[plan->layer_count - 1].term_count == 0)
        return FAIL("layer '%s' has no terms",
                    ascc_quote(builder->layer[plan->layer_count - 1].name).text);
    if (own->source < 0 || own->source >= plan->layer_count + 2)
        return FAIL("output: a source that does not exist");
    const int32_t set = ascc_plan_value_set(builder->layer, own->source);
    if (set != ASCC_SET_FLUID && set != ASCC_SET_ALL)
        return FAIL("output: its source must lie on the points 'fluid' or 'all'");
    own->inputs = ascc_plan_value_channels(plan, builder->layer, own->source);
    outputs = own->inputs;
    if (own->inputs == 0)
        return FAIL("output: a source without channels");
    for (int i = 0; i < 3; i++)
        if (!(fabs(own->scale[i]) <= ASCC_PLAN_MAX))
            return FAIL("output: 'scale' is not finite");
    if (own->kind == ASCC_OUTPUT_ANTISYMMETRIC) {
        own->filter.skip_self = 1;
        status = check_filter(builder, &own->filter, "output");
        if (status == ASCC_OK)
            status = own->filter.bumps
                         ? check_output_basis(builder, own, names)
                         : check_output_grid(builder, own, names->weight, storage, &outputs);
        if (status != ASCC_OK || own->filter.bumps)
            return status;
    }
    if (outputs != plan->dimension)
        return FAIL("output: %d channels, but the dimension is %d", (int)outputs,
                    (int)plan->dimension);
    return ASCC_OK;
}

/* ---- Weights ------------------------------------------------------------------------------------ */

static size_t align_floats(size_t count)
{
    return (count + 15) & ~(size_t)15;
}

static size_t kernel_size(const ascc_output *output, int32_t dimension)
{
    return (size_t)output->filter.cells[0] * (size_t)output->filter.cells[1] *
           (size_t)output->filter.cells[2] * (size_t)output->inputs * (size_t)dimension;
}

/* whole[cell] and whole[mirrored cell] from the stored half (SEMANTICS 3): along the halved axis the
 * upper part is what is stored, the lower part its point mirror, negated. */
static void expand_half(const ascc_output *output, int32_t dimension, int32_t storage,
                        const float *half, float *whole)
{
    const int32_t *full = output->filter.cells;
    int32_t part[3] = {full[0], full[1], full[2]};
    part[storage] /= 2;
    const size_t values = (size_t)output->inputs * (size_t)dimension;
    for (int32_t z = 0; z < part[2]; z++)
        for (int32_t y = 0; y < part[1]; y++)
            for (int32_t x = 0; x < part[0]; x++, half += values) {
                int32_t at[3] = {x, y, z};
                at[storage] += part[storage];
                const int32_t cell = (at[2] * full[1] + at[1]) * full[0] + at[0];
                const int32_t mirror = full[0] * full[1] * full[2] - 1 - cell;
                for (size_t i = 0; i < values; i++) {
                    whole[(size_t)cell * values + i] = half[i];
                    whole[(size_t)mirror * values + i] = -half[i];
                }
            }
}

void ascc_plan_expand(const ascc_plan *plan, float *whole)
{
    if (plan->output.half)
        expand_half(&plan->output, plan->dimension, plan->output.half_axis, plan->output.half,
                    whole);
}

static bool is_antisymmetric(const float *kernel, size_t cells, size_t values)
{
    for (size_t c = 0; c < (cells + 1) / 2; c++)
        for (size_t i = 0; i < values; i++)
            if (kernel[c * values + i] != -kernel[(cells - 1 - c) * values + i])
                return false;
    return true;
}

/* Damping must not give energy: none of its weights is negative. */
static ascc_status fill_central_parts(ascc_plan_builder *builder, ascc_output *output,
                                      const float *weights)
{
    const int32_t index[3] = {builder->damping_tensor, builder->wall_damping_tensor,
                              builder->wall_tensor};
    const float **part[3] = {&output->damping, &output->walls.damping, &output->walls.weight};
    for (int i = 0; i < 3; i++) {
        if (index[i] < 0)
            continue;
        const ascc_tensor *tensor = &builder->file->tensor[index[i]];
        *part[i] = weights + builder->offset[index[i]];
        for (size_t k = 0; i < 2 && k < tensor->count; k++)
            if ((*part[i])[k] < 0.0f)
                return FAIL("tensor '%s' has a negative number, but damps",
                            ascc_quote(tensor->name).text);
    }
    return ASCC_OK;
}

static ascc_status fill_output(ascc_plan_builder *builder, ascc_plan *plan, float *weights,
                               size_t at)
{
    ascc_output *output = &plan->output;
    if (output->kind != ASCC_OUTPUT_ANTISYMMETRIC)
        return ASCC_OK;
    const ascc_tensor *tensor = &builder->file->tensor[builder->output_tensor];
    const float *stored = weights + builder->offset[builder->output_tensor];
    output->weight = stored;
    if (output->filter.bumps)
        return fill_central_parts(builder, output, weights);
    const size_t size = kernel_size(output, plan->dimension);
    const size_t values = (size_t)output->inputs * (size_t)plan->dimension;
    if (builder->output_storage != ASCC_FULL) {
        output->half = stored;
        output->half_axis = builder->output_storage;
        output->weight = weights + at;
        ascc_plan_expand(plan, weights + at);
    } else if (!is_antisymmetric(stored, size / values, values)) {
        return FAIL("tensor '%s' is not antisymmetric under point mirroring",
                    ascc_quote(tensor->name).text);
    }
    return ASCC_OK;
}

static void point_terms(const ascc_plan_builder *builder, ascc_plan *plan, const float *weights)
{
    for (int32_t i = 0; i < plan->term_count; i++) {
        const ascc_plan_term *entry = &builder->term[i];
        plan->term[i] = entry->term;
        plan->term[i].weight = entry->weight < 0 ? NULL : weights + builder->offset[entry->weight];
        plan->term[i].bias = entry->bias < 0 ? NULL : weights + builder->offset[entry->bias];
    }
}

ascc_status ascc_plan_finish(ascc_plan_builder *builder, ascc_plan *plan, float **weights,
                             size_t *weight_count)
{
    const ascc_safetensors *file = builder->file;
    size_t count = 0;
    *plan = builder->plan;
    *weights = NULL;
    *weight_count = 0;
    plan->parameter_count = 0;
    for (size_t i = 0; i < file->tensor_count; i++) {
        if (builder->offset[i] == UNUSED)
            return FAIL("tensor '%s' is not used by the network",
                        ascc_quote(file->tensor[i].name).text);
        builder->offset[i] = count;
        count += align_floats(file->tensor[i].count);
        plan->parameter_count += file->tensor[i].count;
    }
    const size_t expanded = count;
    if (plan->output.kind == ASCC_OUTPUT_ANTISYMMETRIC && builder->output_storage != ASCC_FULL)
        count += align_floats(kernel_size(&plan->output, plan->dimension));

    ascc_status status = ASCC_OK;
    const size_t layers = (size_t)plan->layer_count, terms = (size_t)plan->term_count;
    plan->layer = ascc_allocate(&builder->allocator, layers, sizeof *plan->layer);
    plan->term = ascc_allocate(&builder->allocator, terms, sizeof *plan->term);
    float *block = ascc_allocate(&builder->allocator, count, sizeof *block);
    if (!plan->layer || !plan->term || !block)
        status = ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for %zu weights", count);
    if (status == ASCC_OK) {
        if (layers > 0)
            memcpy(plan->layer, builder->layer, layers * sizeof *plan->layer);
        point_terms(builder, plan, block);
    }
    for (size_t i = 0; i < file->tensor_count && status == ASCC_OK; i++)
        status =
            ascc_tensor_read_floats(&file->tensor[i], block + builder->offset[i], builder->message);
    if (status == ASCC_OK)
        status = fill_output(builder, plan, block, expanded);
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

/* ---- Lengths that follow ------------------------------------------------------------------------ */

/* Largest radius among the convolutions of a layer. */
static double layer_radius(const ascc_plan *plan, const ascc_layer *layer)
{
    double radius = 0.0;
    for (int32_t i = 0; i < layer->term_count; i++) {
        const ascc_term *term = &plan->term[layer->first_term + i];
        if (ascc_term_searches(term))
            radius = fmax(radius, term->filter.radius);
    }
    return radius;
}

double ascc_plan_support_radius(const ascc_plan *plan)
{
    if (plan->output.kind == ASCC_OUTPUT_ANTISYMMETRIC)
        return plan->output.filter.radius;
    return plan->output.source < 2 ? 0.0
                                   : layer_radius(plan, &plan->layer[plan->output.source - 2]);
}

/* How far from a point of the set the particles lie that put it there. */
static double sampling_reach(const ascc_plan *plan, int32_t set)
{
    if (set < ASCC_SET_LEVEL)
        return 0.0;
    const double diagonal =
        plan->level[set - ASCC_SET_LEVEL + 1].voxel * sqrt((double)plan->dimension);
    return plan->sampling == ASCC_SAMPLING_CORNERS ? diagonal * (1.0 + plan->hysteresis) : diagonal;
}

double ascc_plan_receptive_radius(const ascc_plan *plan)
{
    double reach[ASCC_MAX_LAYERS + 2] = {0.0, 0.0};
    for (int32_t i = 0; i < plan->layer_count; i++) {
        const ascc_layer *layer = &plan->layer[i];
        double farthest = 0.0;
        for (int32_t t = 0; t < layer->term_count; t++) {
            const ascc_term *term = &plan->term[layer->first_term + t];
            const int32_t set = ascc_plan_value_set(plan->layer, term->source);
            const double radius = ascc_term_searches(term) ? term->filter.radius : 0.0;
            farthest =
                fmax(farthest, radius + fmax(reach[term->source], sampling_reach(plan, set)));
        }
        reach[i + 2] = farthest;
    }
    const double last = plan->output.kind == ASCC_OUTPUT_ANTISYMMETRIC
                            ? fmax(plan->output.filter.radius, plan->output.walls.filter.radius)
                            : 0.0;
    return last + reach[plan->output.source];
}

int32_t ascc_plan_neighbor_limit(const ascc_plan *plan)
{
    int32_t most = 0;
    for (int32_t i = 0; i < plan->term_count; i++) {
        const ascc_term *term = &plan->term[i];
        if (!ascc_term_searches(term))
            continue;
        if (term->filter.neighbor_limit == 0)
            return 0;
        most = most > term->filter.neighbor_limit ? most : term->filter.neighbor_limit;
    }
    if (plan->output.kind == ASCC_OUTPUT_ANTISYMMETRIC) {
        if (plan->output.filter.neighbor_limit == 0)
            return 0;
        if (plan->output.filter.neighbor_limit > most)
            most = plan->output.filter.neighbor_limit;
    }
    return most;
}
