/* A model as a handle: loads, keeps and writes its file. SPDX-License-Identifier: MIT */
#include "model.h"
#include "cost.h"
#include "description.h"
#include "file/paths.h"
#include "file/safetensors.h"
#include "file/write_file.h"

#include <math.h>
#include <stdatomic.h>
#include <errno.h>
#include <stdio.h>
#include <string.h>

#define MAX_FILE (1L << 30)

struct ascc_model_shared {
    atomic_int references;
};

static bool alive(const ascc_model *model)
{
    return model && model->magic == ASCC_MODEL_MAGIC;
}

/* ---- Lifetime ----------------------------------------------------------------------------------- */

void ascc_model_retain(ascc_model *model)
{
    atomic_fetch_add_explicit(&model->shared->references, 1, memory_order_relaxed);
}

static void free_model(ascc_model *model)
{
    ascc_context *context = model->context;
    const ascc_allocator *allocator = &context->allocator;
    ascc_packed_destroy(&model->packed, allocator);
    ascc_plan_release(allocator, &model->plan, model->weights, model->weight_count);
    if (model->bytes)
        ascc_release(allocator, model->bytes, model->byte_count, 1);
    if (model->shared)
        ascc_release(allocator, model->shared, 1, sizeof *model->shared);
    model->magic = 0;
    ascc_release(allocator, model, 1, sizeof *model);
    ascc_context_release(context);
}

void ascc_model_release(ascc_model *model)
{
    if (atomic_fetch_sub_explicit(&model->shared->references, 1, memory_order_acq_rel) == 1)
        free_model(model);
}

void ascc_model_destroy(ascc_model **model)
{
    if (!model || !*model)
        return;
    ascc_model *old = *model;
    *model = NULL;
    if (alive(old))
        ascc_model_release(old);
}

/* ---- Reading ------------------------------------------------------------------------------------ */

static ascc_status read_plan(ascc_safetensors *file, ascc_plan_builder *builder,
                             ascc_message *message)
{
    const char *format = ascc_safetensors_metadata(file, "format");
    const char *version = ascc_safetensors_metadata(file, "version");
    if (!format || !version)
        return ascc_fail(message, ASCC_ERROR_FORMAT,
                         "__metadata__ states no '%s': not a model of libascc",
                         format ? "version" : "format");
    if (strcmp(format, "ascc.weights") == 0)
        return ascc_fail(message, ASCC_ERROR_FORMAT,
                         "weights as they were published: 'ascc convert' makes a model of them");
    if (strcmp(format, "ascc.model") != 0)
        return ascc_fail(message, ASCC_ERROR_FORMAT, "format '%s' is not a model's",
                         ascc_quote(format).text);
    if (strcmp(version, "1") != 0)
        return ascc_fail(message, ASCC_ERROR_FORMAT, "version '%s' of %s is not known; 1 is",
                         ascc_quote(version).text, format);
    const char *network = ascc_safetensors_metadata(file, "network");
    if (!network)
        return ascc_fail(message, ASCC_ERROR_FORMAT, "__metadata__ states no 'network'");
    return ascc_description_read(builder, network);
}

/* Tensors are the end of the file, one after another. */
static ascc_status read_trust(ascc_model *model, ascc_safetensors *file, ascc_message *message)
{
    const char *text = ascc_safetensors_metadata(file, "trust");
    const unsigned char *data = file->tensor_count ? file->tensor[0].data : NULL;
    const size_t count = data ? (size_t)(model->bytes + model->byte_count - data) : 0;
    return ascc_trust_read(&model->context->allocator, text, text ? ascc_trust_sum(data, count) : 0,
                           &model->plan, &model->trust, message);
}

static ascc_status read_model(ascc_model *model, ascc_message *message)
{
    const ascc_allocator *allocator = &model->context->allocator;
    ascc_safetensors file;
    ascc_plan_builder builder;
    ascc_status status =
        ascc_safetensors_open(allocator, model->bytes, model->byte_count, &file, message);
    if (status != ASCC_OK)
        return status;
    status = ascc_plan_open(allocator, &file, &builder, message);
    if (status == ASCC_OK) {
        status = read_plan(&file, &builder, message);
        if (status == ASCC_OK)
            status =
                ascc_plan_finish(&builder, &model->plan, &model->weights, &model->weight_count);
        ascc_plan_close(&builder);
    }
    if (status == ASCC_OK)
        status = read_trust(model, &file, message);
    if (status == ASCC_OK)
        status = ascc_packed_create(&model->packed, allocator, &model->plan, message);
    ascc_safetensors_close(&file);
    return status;
}

/* Takes bytes[size], which the context's allocator gave; on failure they are released too. */
static ascc_status load_bytes(ascc_context *context, unsigned char *bytes, size_t size,
                              ascc_model **model)
{
    const ascc_allocator *allocator = &context->allocator;
    ascc_message message = {""};
    ascc_status status = ASCC_OK;
    ascc_model *made = ascc_allocate(allocator, 1, sizeof *made);
    if (!made) {
        ascc_release(allocator, bytes, size, 1);
        ascc_fail(&message, ASCC_ERROR_MEMORY, "model: no memory");
        return ascc_context_fail(context, ASCC_ERROR_MEMORY, &message);
    }
    *made = (ascc_model){
        .magic = ASCC_MODEL_MAGIC, .context = context, .bytes = bytes, .byte_count = size};
    ascc_context_retain(context);
    made->shared = ascc_allocate(allocator, 1, sizeof *made->shared);
    if (made->shared) {
        atomic_init(&made->shared->references, 1);
        status = read_model(made, &message);
    } else {
        status = ascc_fail(&message, ASCC_ERROR_MEMORY, "model: no memory");
    }
    if (status != ASCC_OK) {
        ascc_context_fail(context, status, &message);
        free_model(made);
        return status;
    }
    *model = made;
    return ASCC_OK;
}

/* The checks that both loaders begin with. */
static ascc_status begin_load(ascc_context *context, const void *source, ascc_model **model)
{
    ascc_message message = {""};
    if (model)
        *model = NULL;
    if (!context || context->magic != ASCC_CONTEXT_MAGIC)
        return ASCC_ERROR_ARGUMENT;
    if (model && source)
        return ASCC_OK;
    ascc_fail(&message, ASCC_ERROR_ARGUMENT, "model: a NULL argument");
    return ascc_context_fail(context, ASCC_ERROR_ARGUMENT, &message);
}

ascc_status ascc_model_load_memory(ascc_context *context, const void *data, size_t size,
                                   ascc_model **model)
{
    ASCC_FLOAT_SCOPE;
    ascc_message message = {""};
    const ascc_status status = begin_load(context, data, model);
    if (status != ASCC_OK)
        return status;
    unsigned char *bytes = ascc_allocate(&context->allocator, size, 1);
    if (!bytes) {
        ascc_fail(&message, ASCC_ERROR_MEMORY, "model: no memory for %zu bytes", size);
        return ascc_context_fail(context, ASCC_ERROR_MEMORY, &message);
    }
    memcpy(bytes, data, size);
    return load_bytes(context, bytes, size, model);
}

/* The whole file, *size bytes. */
static ascc_status read_file(const ascc_allocator *allocator, FILE *file, unsigned char **bytes,
                             size_t *size)
{
    if (fseek(file, 0, SEEK_END) != 0)
        return ASCC_ERROR_FILE;
    const long end = ftell(file);
    if (end < 0 || end > MAX_FILE || fseek(file, 0, SEEK_SET) != 0)
        return ASCC_ERROR_FILE;
    *size = (size_t)end;
    *bytes = ascc_allocate(allocator, *size, 1);
    if (!*bytes)
        return ASCC_ERROR_MEMORY;
    if (fread(*bytes, 1, *size, file) == *size)
        return ASCC_OK;
    ascc_release(allocator, *bytes, *size, 1);
    return ASCC_ERROR_FILE;
}

ascc_status ascc_model_load(ascc_context *context, const char *path, ascc_model **model)
{
    ASCC_FLOAT_SCOPE;
    ascc_message message = {""};
    unsigned char *bytes = NULL;
    size_t size = 0;
    ascc_status status = begin_load(context, path, model);
    if (status != ASCC_OK)
        return status;
    FILE *file = ascc_path_open(path);
    if (!file) {
        ascc_fail(&message, ASCC_ERROR_FILE, "model: cannot open '%s': %s", path, strerror(errno));
        return ascc_context_fail(context, ASCC_ERROR_FILE, &message);
    }
    status = read_file(&context->allocator, file, &bytes, &size);
    fclose(file);
    if (status == ASCC_OK)
        return load_bytes(context, bytes, size, model);
    ascc_fail(&message, status, "model: %s '%s'",
              status == ASCC_ERROR_MEMORY ? "no memory for" : "cannot read", path);
    return ascc_context_fail(context, status, &message);
}

/* ---- Writing and telling ------------------------------------------------------------------------ */

ascc_status ascc_model_save(const ascc_model *model, const char *path)
{
    ascc_message message = {""};
    if (!alive(model))
        return ASCC_ERROR_ARGUMENT;
    if (!path) {
        ascc_fail(&message, ASCC_ERROR_ARGUMENT, "model: a NULL argument");
        return ascc_context_fail(model->context, ASCC_ERROR_ARGUMENT, &message);
    }
    const ascc_bytes bytes = {model->bytes, model->byte_count};
    if (ascc_write_file(path, &bytes, 1, &message) == ASCC_OK)
        return ASCC_OK;
    ascc_fail(&message, ASCC_ERROR_FILE, "model: %s", message.text);
    return ascc_context_fail(model->context, ASCC_ERROR_FILE, &message);
}

const void *ascc_model_bytes(const ascc_model *model, size_t *size)
{
    if (size)
        *size = alive(model) ? model->byte_count : 0;
    return alive(model) ? model->bytes : NULL;
}

ascc_status ascc_model_get_info(const ascc_model *model, ascc_model_info *info)
{
    ASCC_FLOAT_SCOPE;
    if (!alive(model) || !info)
        return ASCC_ERROR_ARGUMENT;
    const ascc_plan *plan = &model->plan;
    const bool antisymmetric = plan->output.conserves;
    const ascc_cost_counts counts = ascc_cost_counts_default(plan->dimension);
    const ascc_model_info own = {
        .dimension = plan->dimension,
        .level_count = plan->level_count,
        .layer_count = plan->layer_count + (antisymmetric ? 1 : 0),
        .conserves_momentum = antisymmetric,
        /* Central impulses at x make no torque about x; at advected positions they do. */
        .conserves_angular_momentum =
            antisymmetric && plan->output.central &&
            (plan->advection == ASCC_ADVECT_NONE || plan->output.current_direction) &&
            (!plan->relaxation.pressure.count ||
             (plan->relaxation.current_direction && !plan->relaxation.viscosity.count)),
        .advected = plan->advection != ASCC_ADVECT_NONE,
        .neighbor_limit = ascc_plan_neighbor_limit(plan),
        .parameter_count = plan->parameter_count,
        .time_step = plan->time_step,
        .gravity = {plan->gravity[0], plan->gravity[1], plan->gravity[2]},
        .particle_spacing = plan->spacing,
        .rest_density = plan->rest_density,
        .support_radius = ascc_plan_support_radius(plan),
        .receptive_radius = ascc_plan_receptive_radius(plan),
        .name = plan->name,
        .description = plan->description,
        .time_step_min = plan->time_step_min,
        .time_step_max = plan->time_step_max,
        .gravity_min = plan->gravity_min,
        .gravity_max = plan->gravity_max,
        .way_max = plan->way_max,
        .multiply_adds = ascc_cost(plan, &counts),
        .tells_distance = model->trust.layer >= 0,
        .distance_threshold = model->trust.layer >= 0 ? model->trust.threshold : 0.0,
    };
    return ascc_write_struct(info, &own, sizeof own, sizeof own) ? ASCC_OK : ASCC_ERROR_ARGUMENT;
}

ascc_status ascc_model_particles_options(const ascc_model *model, double length_unit,
                                         ascc_particles_options *options)
{
    ASCC_FLOAT_SCOPE;
    if (!alive(model) || !options || !(length_unit >= 0.0 && isfinite(length_unit)))
        return ASCC_ERROR_ARGUMENT;
    const ascc_plan *plan = &model->plan;
    const double area = plan->spacing * plan->spacing;
    const double volume = plan->dimension == 2 ? area : area * plan->spacing;
    const ascc_particles_options own = {.dimension = plan->dimension,
                                        .spacing =
                                            plan->spacing / (length_unit > 0.0 ? length_unit : 1.0),
                                        .mass = plan->rest_density * volume};
    return ascc_write_struct(options, &own, sizeof own, sizeof own) ? ASCC_OK : ASCC_ERROR_ARGUMENT;
}
