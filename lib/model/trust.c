/* Statistics of training states out of a model file. SPDX-License-Identifier: MIT */
#include "trust.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "file/json_reader.h"

#define LARGEST 1e15

int32_t ascc_trust_layer(const ascc_plan *plan)
{
    for (int32_t l = 0; l < plan->layer_count; l++) {
        const ascc_layer *layer = &plan->layer[l];
        bool weights = false;
        for (int32_t t = 0; t < layer->term_count; t++)
            weights |= plan->term[layer->first_term + t].tensor[ASCC_TENSOR_WEIGHT] != NULL;
        if (weights && layer->set == ASCC_SET_FLUID)
            return layer->channels <= ASCC_TRUST_CHANNELS ? l : -1;
    }
    return -1;
}

uint64_t ascc_trust_sum(const unsigned char *bytes, size_t count)
{
    uint64_t sum = UINT64_C(0xcbf29ce484222325); /* FNV-1a */
    for (size_t i = 0; i < count; i++)
        sum = (sum ^ bytes[i]) * UINT64_C(0x100000001b3);
    return sum;
}

/* F's rows, one after another, each up to its diagonal. */
static void read_factor(ascc_reader *reader, ascc_trust *trust)
{
    double numbers[ASCC_TRUST_CHANNELS * (ASCC_TRUST_CHANNELS + 1) / 2];
    const int32_t n = trust->channels;
    const double *from = numbers;
    ascc_reader_numbers(reader, 0, "factor", n * (n + 1) / 2, -LARGEST, LARGEST, numbers);
    for (int32_t i = 0; reader->status == ASCC_OK && i < n; i++)
        for (int32_t j = 0; j <= i; j++)
            trust->column[j][i] = (float)(*from++ / sqrt((double)n));
}

static void read_trust(ascc_reader *reader, const ascc_plan *plan, uint64_t sum, ascc_trust *trust)
{
    double mean[ASCC_TRUST_CHANNELS] = {0.0};
    char own[20];
    if (reader->json->value[0].kind != ASCC_JSON_OBJECT) {
        ascc_reader_fail(reader, "it must be a JSON object");
        return;
    }
    const int32_t layer = ascc_reader_integer(reader, 0, "layer", 0, ASCC_MAX_LAYERS);
    if (reader->status == ASCC_OK && (layer != ascc_trust_layer(plan) || layer < 0)) {
        ascc_reader_fail(reader,
                         "'layer' is %d, not the first on the fluid with weights and at most %d "
                         "channels",
                         (int)layer, ASCC_TRUST_CHANNELS);
        return;
    }
    const char *weights = ascc_reader_text(reader, 0, "weights");
    trust->channels = reader->status == ASCC_OK ? plan->layer[layer].channels : 1;
    ascc_reader_numbers(reader, 0, "mean", trust->channels, -LARGEST, LARGEST, mean);
    for (int32_t c = 0; c < trust->channels; c++)
        trust->mean[c] = (float)mean[c];
    read_factor(reader, trust);
    if (ascc_reader_has(reader, 0, "threshold"))
        trust->threshold = ascc_reader_number(reader, 0, "threshold", 1e-3, LARGEST);
    ascc_reader_end(reader, 0);
    (void)snprintf(own, sizeof own, "%016" PRIx64, sum);
    if (reader->status == ASCC_OK && strcmp(weights, own) == 0)
        trust->layer = layer;
}

ascc_status ascc_trust_read(const ascc_allocator *allocator, const char *text, uint64_t sum,
                            const ascc_plan *plan, ascc_trust *trust, ascc_message *message)
{
    ascc_json json;
    *trust = (ascc_trust){.layer = -1};
    if (!text)
        return ASCC_OK;
    ascc_message why;
    const ascc_status status = ascc_json_open(allocator, text, strlen(text), &json, &why);
    if (status != ASCC_OK)
        return ascc_fail(message, status, "trust: %s", why.text);
    ascc_reader reader = {.json = &json, .message = message, .status = ASCC_OK};
    ascc_reader_where(&reader, "trust");
    read_trust(&reader, plan, sum, trust);
    ascc_json_close(&json);
    return reader.status;
}
