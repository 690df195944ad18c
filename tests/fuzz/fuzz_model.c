/* Loads a model from bytes, as they are and as a published network; if it loads, checks what every plan promises
 * and runs it on a small scene.
 * SPDX-License-Identifier: MIT
 *
 * The first byte says what the rest is, so that the fuzzer reaches beyond the header's length field
 * and the escaping of texts within texts:
 *   'f'  a whole file
 *   'h'  a header; what follows a byte 0xff is the data
 *   'n'  the network of a file of libascc's own, whose tensors are right for the corpus
 *   'b'  the same of one in a basis, with transfers and BF16 tensors
 *   'p'  the same of one with set abstractions on farthest points
 *   'g'  that of a graph network
 *   'd'  the architecture of a published DMCF network, likewise
 *   'c'  that of a published CConv network
 *   't'  the statistics of training of a network's file
 */
#include <stdlib.h>
#include <string.h>

#include "fuzz.h"
#include "fuzz_model.h"
#include "model/model.h"
#include "model/operation.h"
#include "published.h"
#include "support/model_builder.h"

int fuzz_model_runs = 1;

static float sum; /* keeps the reads below */

static void read_all(const float *values, size_t count)
{
    for (size_t i = 0; i < count; i++)
        sum += values[i];
}

/* All numbers of a term's tensors, of the shapes that its operation wants. */
static void read_tensors(const ascc_plan *plan, const ascc_term *term)
{
    static const size_t nothing[ASCC_SAFETENSORS_MAX_RANK];
    ascc_tensor_wanted wanted[ASCC_MAX_TENSORS] = {{0}};
    ascc_term copy = *term;
    if (term->operation->tensors)
        term->operation->tensors(plan, &copy, nothing, wanted);
    for (int i = 0; i < ASCC_MAX_TENSORS; i++) {
        size_t count = 1;
        for (int32_t k = 0; k < wanted[i].rank; k++)
            count *= wanted[i].shape[k];
        if (term->tensor[i])
            read_all(term->tensor[i], count);
    }
}

static size_t cell_count(const ascc_filter *filter)
{
    return (size_t)filter->cells[0] * (size_t)filter->cells[1] * (size_t)filter->cells[2];
}

static void check_plan(const ascc_plan *plan)
{
    for (int32_t i = 0; i < plan->layer_count; i++) {
        const ascc_layer *layer = &plan->layer[i];
        fuzz_require(layer->set >= 0 &&
                     (layer->set < ASCC_SET_LEVEL + plan->level_count - 1 ||
                      (layer->set == ASCC_SET_EDGES && plan->edge_radius > 0.0)));
        fuzz_require(layer->term_count > 0 && layer->channels > 0);
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            fuzz_require(term->source >= 0 && term->source <= i + 1);
            fuzz_require(term->column >= 0 && term->column + term->outputs <= layer->channels);
            read_tensors(plan, term);
        }
    }
    const ascc_output *output = &plan->output;
    fuzz_require(output->term.source >= 0 && output->term.source < plan->layer_count + 2);
    if (output->conserves)
        read_all(output->term.tensor[ASCC_TENSOR_WEIGHT],
                 cell_count(&output->term.filter) * (size_t)output->term.inputs *
                     (size_t)(output->term.filter.bumps ? 1 : plan->dimension) /
                     (output->half_axis < 0 ? 1 : 2));
}

static void load_model(const void *bytes, size_t size)
{
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    if (ascc_context_create(NULL, &context) != ASCC_OK)
        return;
    if (ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK) {
        ascc_model_info info = {.size = sizeof info};
        size_t kept = 0;
        fuzz_require(ascc_model_get_info(model, &info) == ASCC_OK);
        fuzz_require(memcmp(ascc_model_bytes(model, &kept), bytes, size) == 0 && kept == size);
        check_plan(&model->plan);
        if (fuzz_model_runs)
            fuzz_step_model(context, model);
    } else {
        char text[16];
        fuzz_require(model == NULL && ascc_context_message(context, text, sizeof text) > 0);
    }
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
}

static void load(const void *bytes, size_t size)
{
    size_t made = 0;
    char why[256] = "";
    unsigned char *converted = ascc_published_convert(bytes, size, &made, why, sizeof why);
    fuzz_require(converted || why[0]);
    load_model(bytes, size);
    if (converted)
        load_model(converted, made);
    free(converted);
}

static void load_header(const uint8_t *data, size_t size)
{
    size_t made;
    unsigned char *bytes = fuzz_with_header(data, size, &made);
    load(bytes, made);
    free(bytes);
}

/* The network or architecture of a file with the right tensors, given as text. */
static void load_text(const uint8_t *data, size_t size, char kind)
{
    char *text = malloc(size + 1);
    size_t made;
    fuzz_require(text != NULL);
    memcpy(text, data, size);
    text[size] = '\0';
    for (size_t i = 0; i < size; i++)
        if ((unsigned char)text[i] < 0x20)
            text[i] = ' ';
    unsigned char *bytes = model_builder_described(kind, text, &made);
    load(bytes, made);
    free(bytes);
    free(text);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    if (size == 0)
        return 0;
    switch (data[0]) {
    case 'f':
        load(data + 1, size - 1);
        break;
    case 'h':
        load_header(data + 1, size - 1);
        break;
    case 'n':
    case 'b':
    case 'p':
    case 'g':
    case 'd':
    case 'c':
    case 't':
        load_text(data + 1, size - 1, (char)data[0]);
        break;
    default:
        break;
    }
    return 0;
}
