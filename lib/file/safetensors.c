/* Untrusted safetensors bytes to named, bounds-checked tensor views. SPDX-License-Identifier: MIT */
#include "safetensors.h"

#include <string.h>

#define FAIL(...) ascc_fail(message, ASCC_ERROR_FORMAT, __VA_ARGS__)

static const struct {
    const char *name;
    size_t size;
} types[] = {{"F32", 4}, {"F64", 8}, {"F16", 2},  {"BF16", 2},    {"I8", 1},
             {"I16", 2}, {"I32", 4}, {"I64", 8},  {"U8", 1},      {"U16", 2},
             {"U32", 4}, {"U64", 8}, {"BOOL", 1}, {"F8_E5M2", 1}, {"F8_E4M3", 1}};

/* A member that is a list of sizes; -1 = it is not. At most `capacity` of them. */
static int32_t read_sizes(ascc_json *json, uint32_t object, const char *key, int32_t capacity,
                          size_t *sizes)
{
    const uint32_t list = ascc_json_find(json, object, key);
    int32_t count = 0;
    if (list == 0 || json->value[list].kind != ASCC_JSON_ARRAY ||
        json->value[list].count > (uint32_t)capacity)
        return -1;
    for (uint32_t i = ascc_json_first(json, list); i != 0; i = json->value[i].next) {
        const ascc_json_value *value = &json->value[i];
        if (!value->is_integer || value->integer < 0 || (uint64_t)value->integer > SIZE_MAX)
            return -1;
        sizes[count++] = (size_t)value->integer;
    }
    return count;
}

static ascc_status read_tensor(ascc_json *json, uint32_t object, const unsigned char *data,
                               size_t data_size, ascc_tensor *tensor, ascc_message *message)
{
    size_t offset[2];
    tensor->name = json->value[object].name;
    const ascc_quoted name = ascc_quote(tensor->name);
    if (json->value[object].kind != ASCC_JSON_OBJECT)
        return FAIL("tensor '%s': its entry is no object", name.text);

    const uint32_t type = ascc_json_find(json, object, "dtype");
    if (type == 0 || json->value[type].kind != ASCC_JSON_STRING)
        return FAIL("tensor '%s': 'dtype' is missing or no text", name.text);
    for (size_t i = 0; i < sizeof types / sizeof *types; i++)
        if (strcmp(json->value[type].text, types[i].name) == 0) {
            tensor->type = types[i].name;
            tensor->element_size = types[i].size;
        }
    if (!tensor->type)
        return FAIL("tensor '%s': unknown dtype '%s'", name.text,
                    ascc_quote(json->value[type].text).text);

    tensor->rank = read_sizes(json, object, "shape", ASCC_SAFETENSORS_MAX_RANK, tensor->shape);
    if (tensor->rank < 0)
        return FAIL("tensor '%s': 'shape' must be a list of at most %d sizes", name.text,
                    ASCC_SAFETENSORS_MAX_RANK);
    if (read_sizes(json, object, "data_offsets", 2, offset) != 2)
        return FAIL("tensor '%s': 'data_offsets' must be a list of 2 offsets", name.text);
    for (uint32_t i = ascc_json_first(json, object); i != 0; i = json->value[i].next)
        if (!json->value[i].used)
            return FAIL("tensor '%s': unknown key '%s'", name.text,
                        ascc_quote(json->value[i].name).text);

    if (offset[0] > offset[1] || offset[1] > data_size)
        return FAIL("tensor '%s': data_offsets [%zu, %zu] are not within the %zu bytes of data",
                    name.text, offset[0], offset[1], data_size);
    size_t bytes = tensor->element_size;
    for (int32_t i = 0; i < tensor->rank; i++)
        if (!ascc_multiply_size(bytes, tensor->shape[i], &bytes))
            return FAIL("tensor '%s': its shape overflows", name.text);
    if (bytes != offset[1] - offset[0])
        return FAIL("tensor '%s': its shape needs %zu bytes, its data_offsets hold %zu", name.text,
                    bytes, offset[1] - offset[0]);
    tensor->count = bytes / tensor->element_size;
    tensor->begin = offset[0];
    tensor->data = data + offset[0];
    return ASCC_OK;
}

/* Stable order by offset; files are nearly always in order already. */
static void sort(ascc_tensor *tensor, size_t count)
{
    for (size_t i = 1; i < count; i++) {
        const ascc_tensor moved = tensor[i];
        size_t j = i;
        for (; j > 0 && (tensor[j - 1].begin > moved.begin ||
                         (tensor[j - 1].begin == moved.begin && tensor[j - 1].count != 0 &&
                          moved.count == 0));
             j--)
            tensor[j] = tensor[j - 1];
        tensor[j] = moved;
    }
}

static ascc_status check_tiling(const ascc_safetensors *file, size_t data_size,
                                ascc_message *message)
{
    size_t end = 0;
    for (size_t i = 0; i < file->tensor_count; i++) {
        const ascc_tensor *tensor = &file->tensor[i];
        if (tensor->begin != end)
            return FAIL("tensor '%s' begins at byte %zu of the data, but the one before ends at "
                        "%zu",
                        ascc_quote(tensor->name).text, tensor->begin, end);
        end += tensor->count * tensor->element_size;
    }
    if (end != data_size)
        return FAIL("%zu bytes follow the last tensor", data_size - end);
    return ASCC_OK;
}

static ascc_status check_metadata(const ascc_json *json, uint32_t metadata, ascc_message *message)
{
    if (json->value[metadata].kind != ASCC_JSON_OBJECT)
        return FAIL("__metadata__ is no object");
    for (uint32_t i = ascc_json_first(json, metadata); i != 0; i = json->value[i].next)
        if (json->value[i].kind != ASCC_JSON_STRING)
            return FAIL("__metadata__ '%s' is no text", ascc_quote(json->value[i].name).text);
    return ASCC_OK;
}

static ascc_status read_header(ascc_safetensors *file, const unsigned char *data, size_t data_size,
                               ascc_message *message)
{
    ascc_json *json = &file->header;
    ascc_status status = ASCC_OK;
    if (json->value[0].kind != ASCC_JSON_OBJECT)
        return FAIL("the header is no JSON object");
    file->metadata = ascc_json_find(json, 0, "__metadata__");
    if (file->metadata)
        status = check_metadata(json, file->metadata, message);
    if (status != ASCC_OK)
        return status;
    const size_t count = json->value[0].count - (file->metadata ? 1 : 0);
    if (count > ASCC_SAFETENSORS_MAX_TENSORS)
        return FAIL("%zu tensors; at most %d are read", count, ASCC_SAFETENSORS_MAX_TENSORS);
    file->tensor = ascc_allocate(&json->allocator, count, sizeof *file->tensor);
    if (!file->tensor)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for %zu tensors", count);
    file->tensor_count = count;
    memset(file->tensor, 0, count * sizeof *file->tensor);
    ascc_tensor *next = file->tensor;
    for (uint32_t i = ascc_json_first(json, 0); i != 0; i = json->value[i].next) {
        if (i == file->metadata)
            continue;
        status = read_tensor(json, i, data, data_size, next++, message);
        if (status != ASCC_OK)
            return status;
    }
    sort(file->tensor, count);
    return check_tiling(file, data_size, message);
}

ascc_status ascc_safetensors_open(const ascc_allocator *allocator, const void *data, size_t size,
                                  ascc_safetensors *file, ascc_message *message)
{
    const unsigned char *bytes = data;
    uint64_t length = 0;
    *file = (ascc_safetensors){.tensor = NULL};
    if (size < 8)
        return FAIL("%zu bytes are too few for a safetensors file", size);
    for (int i = 7; i >= 0; i--)
        length = length << 8 | bytes[i];
    if (length > size - 8)
        return FAIL("the header is said to have %llu bytes, but %zu follow",
                    (unsigned long long)length, size - 8);
    if (length > ASCC_SAFETENSORS_MAX_HEADER)
        return FAIL("the header has %llu bytes; at most %zu are read", (unsigned long long)length,
                    ASCC_SAFETENSORS_MAX_HEADER);
    const size_t header_size = (size_t)length;
    if (header_size == 0 || bytes[8] != '{')
        return FAIL("the header does not begin with '{': not a safetensors file");
    ascc_status status =
        ascc_json_open(allocator, (const char *)bytes + 8, header_size, &file->header, message);
    if (status != ASCC_OK)
        return status;
    status = read_header(file, bytes + 8 + header_size, size - 8 - header_size, message);
    if (status != ASCC_OK)
        ascc_safetensors_close(file);
    return status;
}

void ascc_safetensors_close(ascc_safetensors *file)
{
    if (file->tensor)
        ascc_release(&file->header.allocator, file->tensor, file->tensor_count,
                     sizeof *file->tensor);
    ascc_json_close(&file->header);
    *file = (ascc_safetensors){.tensor = NULL};
}

const char *ascc_safetensors_metadata(ascc_safetensors *file, const char *key)
{
    if (file->metadata == 0)
        return NULL;
    const uint32_t index = ascc_json_find(&file->header, file->metadata, key);
    return index ? file->header.value[index].text : NULL;
}

int32_t ascc_safetensors_find(const ascc_safetensors *file, const char *name)
{
    for (size_t i = 0; i < file->tensor_count; i++)
        if (strcmp(file->tensor[i].name, name) == 0)
            return (int32_t)i;
    return -1;
}

bool ascc_tensor_is_float(const ascc_tensor *tensor)
{
    return strcmp(tensor->type, "F32") == 0 || strcmp(tensor->type, "F16") == 0 ||
           strcmp(tensor->type, "BF16") == 0;
}

/* The bits of a float from those of a binary16: every one of them has its equal. */
static uint32_t widen_half(uint32_t half)
{
    const uint32_t sign = (half & 0x8000u) << 16, exponent = half >> 10 & 31u;
    uint32_t fraction = half & 0x3ffu;
    if (exponent == 31)
        return sign | 0x7f800000u | fraction << 13;
    if (exponent > 0)
        return sign | (exponent + 112) << 23 | fraction << 13;
    if (fraction == 0)
        return sign;
    uint32_t scale = 113; /* of a subnormal: shifted up until its leading one is the hidden one */
    for (; !(fraction & 0x400u); fraction <<= 1)
        scale--;
    return sign | scale << 23 | (fraction & 0x3ffu) << 13;
}

ascc_status ascc_tensor_read_floats(const ascc_tensor *tensor, float *values, ascc_message *message)
{
    const ascc_quoted name = ascc_quote(tensor->name);
    const bool half = strcmp(tensor->type, "F16") == 0;
    if (!ascc_tensor_is_float(tensor))
        return FAIL("tensor '%s' is %s; weights must be F32, F16 or BF16", name.text, tensor->type);
    uint32_t bad = 0;
    for (size_t i = 0; i < tensor->count; i++) {
        const unsigned char *b = tensor->data + tensor->element_size * i;
        uint32_t bits = (uint32_t)b[0] | (uint32_t)b[1] << 8;
        if (tensor->element_size == 4)
            bits |= (uint32_t)b[2] << 16 | (uint32_t)b[3] << 24;
        else
            bits = half ? widen_half(bits) : bits << 16;
        bad |= (bits & 0x7f800000u) == 0x7f800000u;
        memcpy(values + i, &bits, sizeof bits);
    }
    return bad ? FAIL("tensor '%s' holds a value that is not finite", name.text) : ASCC_OK;
}
