/* A model file with initial weights, from the description of its network. SPDX-License-Identifier: MIT */
#include "initial_model.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/float_env.h"
#include "model/description.h"
#include "model/initial.h"
#include "train_context.h"

static const double SMALL = 0.01; /* of the layer that is the correction itself */

/* ---- Weights ---- */

/* A layer that a plain output reads begins near 0, as pairs do. */
static double gain_of(const ascc_plan *plan, int32_t layer)
{
    const ascc_term *output = &plan->output.term;
    const bool last = layer >= 0 && layer + 2 == output->source && !output->operation->tensors;
    return last ? SMALL * ascc_initial_output(plan) : 1.0;
}

static uint64_t hash_of(const char *name)
{
    uint64_t hash = 0xcbf29ce484222325u;
    for (; *name; name++)
        hash = (hash ^ (unsigned char)*name) * 0x100000001b3u;
    return hash;
}

/* The tensors of one term, of a layer or (-1) the output, but those that an earlier one has filled. */
static void fill_term(const ascc_plan_builder *builder, const ascc_plan *plan, int32_t layer,
                      const ascc_term *term, const ascc_term_entry *entry, uint64_t seed,
                      float *weights, bool *filled)
{
    for (int32_t i = 0; i < ASCC_MAX_TENSORS; i++) {
        const int32_t index = entry->tensor[i];
        if (index < 0 || filled[index])
            continue;
        const ascc_tensor *tensor = &builder->tensor[index];
        ascc_initial initial = {.plan = plan,
                                .layer = layer < 0 ? NULL : &plan->layer[layer],
                                .term = term,
                                .number = i,
                                .rank = tensor->rank,
                                .gain = gain_of(plan, layer),
                                .random = ascc_random_open(seed, hash_of(tensor->name), 0),
                                .value = weights + builder->offset[index],
                                .count = tensor->count,
                                .shape = tensor->shape};
        if (term->operation->initial)
            term->operation->initial(&initial);
        else
            ascc_initial_default(&initial);
        filled[index] = true;
    }
}

static ascc_status fill(const ascc_plan_builder *builder, const ascc_plan *plan, uint64_t seed,
                        float *weights)
{
    bool *filled = ascc_allocate(&builder->allocator, builder->tensor_count, sizeof *filled);
    if (!filled)
        return ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for the initial weights");
    memset(filled, 0, builder->tensor_count * sizeof *filled);
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t i = 0; i < plan->layer[l].term_count; i++) {
            const int32_t t = plan->layer[l].first_term + i;
            fill_term(builder, plan, l, &plan->term[t], &builder->term[t], seed, weights, filled);
        }
    fill_term(builder, plan, -1, &plan->output.term, &builder->output, seed, weights, filled);
    ascc_release(&builder->allocator, filled, builder->tensor_count, sizeof *filled);
    return ASCC_OK;
}

/* ---- The file ---- */

/* Bytes that grow; the first failure sticks. */
typedef struct writer {
    const ascc_allocator *allocator;
    ascc_model_file *file;
    bool failed;
} writer;

static void put(writer *w, const void *bytes, size_t size)
{
    ascc_model_file *f = w->file;
    void *data = f->data;
    w->failed = w->failed || size > SIZE_MAX - f->size ||
                !ascc_grow(w->allocator, &data, &f->capacity, f->size + size, 1);
    if (w->failed)
        return;
    f->data = data;
    memcpy(f->data + f->size, bytes, size);
    f->size += size;
}

static void put_text(writer *w, const char *text)
{
    put(w, text, strlen(text));
}

static void put_number(writer *w, uint64_t number)
{
    char text[24];
    snprintf(text, sizeof text, "%" PRIu64, number);
    put_text(w, text);
}

/* With the escapes that a JSON text needs. */
static void put_escaped(writer *w, const char *text)
{
    for (; *text; text++) {
        const unsigned char c = (unsigned char)*text;
        char escape[8];
        if (c < 0x20)
            snprintf(escape, sizeof escape, "\\u%04x", c);
        else
            snprintf(escape, sizeof escape, c == '"' || c == '\\' ? "\\%c" : "%c", c);
        put_text(w, escape);
    }
}

static void put_header(writer *w, const ascc_plan_builder *builder, const char *description,
                       uint64_t seed)
{
    size_t at = 0;
    put(w, (const char[8]){0}, 8);
    put_text(w, "{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":\"");
    put_escaped(w, description);
    put_text(w, "\",\"initial_weights\":\"ascc train, seed ");
    put_number(w, seed);
    put_text(w, "\"}");
    for (size_t i = 0; i < builder->tensor_count; i++) {
        const ascc_tensor *tensor = &builder->tensor[i];
        put_text(w, ",\"");
        put_escaped(w, tensor->name);
        put_text(w, "\":{\"dtype\":\"F32\",\"shape\":[");
        for (int32_t k = 0; k < tensor->rank; k++) {
            put_text(w, k ? "," : "");
            put_number(w, tensor->shape[k]);
        }
        put_text(w, "],\"data_offsets\":[");
        put_number(w, at);
        at += tensor->count * sizeof(float);
        put_text(w, ",");
        put_number(w, at);
        put_text(w, "]}");
    }
    put_text(w, "}");
    while (!w->failed && w->file->size % 8)
        put_text(w, " ");
    const uint64_t length = w->failed ? 0 : w->file->size - 8;
    for (int i = 0; i < 8 && !w->failed; i++)
        w->file->data[i] = (unsigned char)(length >> 8 * i);
}

static void put_weights(writer *w, const ascc_plan_builder *builder, const float *weights)
{
    for (size_t i = 0; i < builder->tensor_count; i++)
        for (size_t k = 0; k < builder->tensor[i].count; k++) {
            uint32_t bits;
            memcpy(&bits, &weights[builder->offset[i] + k], sizeof bits);
            put(w,
                (const unsigned char[4]){(unsigned char)bits, (unsigned char)(bits >> 8),
                                         (unsigned char)(bits >> 16), (unsigned char)(bits >> 24)},
                4);
        }
}

static ascc_status write_file(const ascc_plan_builder *builder, const float *weights,
                              const char *description, uint64_t seed, ascc_model_file *file)
{
    writer w = {.allocator = &builder->allocator, .file = file};
    put_header(&w, builder, description, seed);
    const size_t header = file->size;
    put_weights(&w, builder, weights);
    if (w.failed)
        return ascc_fail(builder->message, ASCC_ERROR_MEMORY, "no memory for the model file");
    return header > ASCC_SAFETENSORS_MAX_HEADER
               ? ascc_fail(builder->message, ASCC_ERROR_FORMAT, "the description is too long")
               : ASCC_OK;
}

void ascc_model_file_release(ascc_model_file *file, const ascc_allocator *allocator)
{
    if (file->data)
        ascc_release(allocator, file->data, file->capacity, 1);
    *file = (ascc_model_file){NULL, 0, 0};
}

ascc_status ascc_initial_model_make(const ascc_allocator *allocator, const char *description,
                                    uint64_t seed, ascc_model_file *file, ascc_message *message)
{
    ascc_plan_builder builder;
    ascc_plan plan;
    float *weights;
    size_t count;
    *file = (ascc_model_file){NULL, 0, 0};
    ascc_status status = ascc_plan_open(allocator, NULL, &builder, message);
    if (status != ASCC_OK)
        return status;
    status = ascc_description_read(&builder, description);
    if (status == ASCC_OK)
        status = ascc_plan_finish(&builder, &plan, &weights, &count);
    if (status == ASCC_OK) {
        status = fill(&builder, &plan, seed, weights);
        if (status == ASCC_OK)
            status = write_file(&builder, weights, description, seed, file);
        if (status != ASCC_OK)
            ascc_model_file_release(file, allocator);
        ascc_plan_release(allocator, &plan, weights, count);
    }
    ascc_plan_close(&builder);
    return status;
}

/* ---- The call ---- */

static ascc_status copy_model(const ascc_model_file *file, void *model, size_t capacity,
                              size_t *size, ascc_message *message)
{
    if (model && capacity < file->size)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "initial model: it has %zu bytes, more than the %zu given", file->size,
                         capacity);
    if (model)
        memcpy(model, file->data, file->size);
    *size = file->size;
    return ASCC_OK;
}

ascc_status ascc_train_initial_model(ascc_train_context *context, const char *description,
                                     uint64_t seed, void *model, size_t capacity, size_t *size)
{
    ASCC_FLOAT_SCOPE;
    ascc_message message = {""};
    ascc_model_file file;
    if (!ascc_train_context_alive(context))
        return ASCC_ERROR_ARGUMENT;
    const ascc_allocator *allocator = &context->shared->allocator;
    ascc_status status = ASCC_OK;
    if (!description || !size) {
        status = ascc_fail(&message, ASCC_ERROR_ARGUMENT, "initial model: a NULL argument");
    } else {
        status = ascc_initial_model_make(allocator, description, seed, &file, &message);
        if (status == ASCC_OK) {
            status = copy_model(&file, model, capacity, size, &message);
            ascc_model_file_release(&file, allocator);
        }
    }
    return status == ASCC_OK ? status : ascc_train_context_fail(context, status, &message);
}
