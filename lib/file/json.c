/* Reads JSON text from untrusted bytes into a flat list of values. SPDX-License-Identifier: MIT */
#include "json.h"

#include <float.h>
#include <string.h>

#include "base/sort.h"

#define NONE UINT32_MAX

typedef struct parser {
    const unsigned char *text;
    size_t size, at;
    ascc_json *json;
    char *decoded; /* where the next string goes */
    ascc_message *message;
} parser;

static ascc_status fault(const parser *p, const char *what)
{
    return ascc_fail(p->message, ASCC_ERROR_FORMAT, "JSON at byte %zu: %s", p->at, what);
}

static int peek(const parser *p)
{
    return p->at < p->size ? p->text[p->at] : -1;
}

static void skip_space(parser *p)
{
    while (p->at < p->size && (p->text[p->at] == ' ' || p->text[p->at] == '\n' ||
                               p->text[p->at] == '\r' || p->text[p->at] == '\t'))
        p->at++;
}

/* ---- Numbers: an exact quotient of two large integers, rounded once ---------------------------- */

#define LIMBS 48 /* 1536 bits: 10^394 shifted by 64 bits at most */

typedef struct large {
    uint32_t limb[LIMBS]; /* least significant first */
} large;

static void multiply_add(large *a, uint32_t factor, uint32_t add)
{
    uint64_t carry = add;
    for (int i = 0; i < LIMBS; i++) {
        carry += (uint64_t)a->limb[i] * factor;
        a->limb[i] = (uint32_t)carry;
        carry >>= 32;
    }
    assert(carry == 0);
}

static void multiply_power_of_ten(large *a, int power)
{
    for (; power >= 9; power -= 9)
        multiply_add(a, 1000000000u, 0);
    for (; power > 0; power--)
        multiply_add(a, 10u, 0);
}

static int bit_length(const large *a)
{
    for (int i = LIMBS - 1; i >= 0; i--)
        for (int b = 31; a->limb[i] != 0 && b >= 0; b--)
            if (a->limb[i] >> b & 1u)
                return i * 32 + b + 1;
    return 0;
}

static void shift_left(large *a, int bits)
{
    const int whole = bits / 32, part = bits % 32;
    for (int i = LIMBS - 1; i >= 0; i--) {
        const uint64_t high = i >= whole ? a->limb[i - whole] : 0;
        const uint64_t low = i > whole ? a->limb[i - whole - 1] : 0;
        a->limb[i] = (uint32_t)((high << 32 | low) << part >> 32);
    }
}

static bool less(const large *a, const large *b)
{
    for (int i = LIMBS - 1; i >= 0; i--)
        if (a->limb[i] != b->limb[i])
            return a->limb[i] < b->limb[i];
    return false;
}

static void subtract(large *a, const large *b)
{
    uint64_t borrow = 0;
    for (int i = 0; i < LIMBS; i++) {
        const uint64_t difference = (uint64_t)a->limb[i] - b->limb[i] - borrow;
        a->limb[i] = (uint32_t)difference;
        borrow = difference >> 63;
    }
}

/* q 2^(exponent - 63), q in [2^63, 2^64), plus less than one unit of q if `more`, as a double's
 * bits, rounded to nearest even. */
static uint64_t round_to_double(uint64_t q, int exponent, bool more)
{
    int drop = 11;
    if (exponent < -1022)
        drop += -1022 - exponent;
    if (drop > 64)
        return 0;
    const uint64_t kept = drop == 64 ? 0 : q >> drop;
    const uint64_t half = (uint64_t)1 << (drop - 1);
    const uint64_t rest = q & (half | (half - 1));
    const bool up = rest > half || (rest == half && (more || (kept & 1u)));
    const uint64_t base = exponent < -1022 ? 0 : (uint64_t)(exponent + 1022) << 52;
    return base + kept + (up ? 1 : 0);
}

/* The usual case: an integer and a power of ten that doubles hold exactly need one rounding. */
static bool convert_short(const char *digits, int count, int power, double *result)
{
    static const double powers[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,
                                    1e8,  1e9,  1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
                                    1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    if (FLT_EVAL_METHOD != 0 || count > 15 || power < -22 || power > 22)
        return false;
    int64_t integer = 0;
    for (int i = 0; i < count; i++)
        integer = integer * 10 + (digits[i] - '0');
    *result = power < 0 ? (double)integer / powers[-power] : (double)integer * powers[power];
    return true;
}

/* digits 10^power, count <= ASCC_JSON_MAX_DIGITS digits of which the first is not 0. False if it is
 * too large for a double. */
static bool convert(const char *digits, int count, int power, double *result)
{
    *result = 0.0;
    if (count == 0 || count + power < -330)
        return true;
    if (count + power > 310)
        return false;
    if (convert_short(digits, count, power, result))
        return true;
    large n = {{0}}, m = {{1}};
    for (int i = 0; i < count; i++)
        multiply_add(&n, 10u, (uint32_t)(digits[i] - '0'));
    multiply_power_of_ten(power > 0 ? &n : &m, power > 0 ? power : -power);

    /* Scale so that n / m is in [1, 2), then take 64 bits of the quotient. */
    int exponent = bit_length(&n) - bit_length(&m);
    shift_left(exponent > 0 ? &m : &n, exponent > 0 ? exponent : -exponent);
    if (less(&n, &m)) {
        shift_left(&n, 1);
        exponent--;
    }
    uint64_t q = 0;
    for (int i = 0; i < 64; i++) {
        q <<= 1;
        if (!less(&n, &m)) {
            subtract(&n, &m);
            q |= 1u;
        }
        shift_left(&n, 1);
    }
    const uint64_t bits =
        exponent > 1023 ? (uint64_t)0x7ff << 52 : round_to_double(q, exponent, bit_length(&n) != 0);
    memcpy(result, &bits, sizeof bits);
    return bits < (uint64_t)0x7ff << 52;
}

static bool is_digit(int c)
{
    return c >= '0' && c <= '9';
}

/* Reads digits, counting them; keeps the significant ones. */
typedef struct decimal {
    char digit[ASCC_JSON_MAX_DIGITS];
    int count; /* kept; trailing zeros are held back */
    int zeros; /* held back */
    bool too_long;
} decimal;

static void take_digit(decimal *d, int c)
{
    if (c == '0') {
        if (d->count > 0 && d->zeros < 100000)
            d->zeros++;
        return;
    }
    if (d->count + d->zeros >= ASCC_JSON_MAX_DIGITS) {
        d->too_long = true;
        return;
    }
    for (; d->zeros > 0; d->zeros--)
        d->digit[d->count++] = '0';
    d->digit[d->count++] = (char)c;
}

static ascc_status parse_number(parser *p, ascc_json_value *value)
{
    decimal d = {{0}, 0, 0, false};
    const size_t start = p->at;
    const bool negative = peek(p) == '-';
    bool whole = true;
    int fraction = 0, power = 0;
    if (negative)
        p->at++;
    if (!is_digit(peek(p)))
        return fault(p, "a value was expected");
    if (peek(p) == '0' && p->at + 1 < p->size && is_digit(p->text[p->at + 1]))
        return fault(p, "a number with a leading zero");
    for (; is_digit(peek(p)); p->at++)
        take_digit(&d, peek(p));
    if (peek(p) == '.') {
        whole = false;
        p->at++;
        if (!is_digit(peek(p)))
            return fault(p, "a digit was expected");
        for (; is_digit(peek(p)); p->at++) {
            take_digit(&d, peek(p));
            fraction += fraction < 100000;
        }
    }
    if (peek(p) == 'e' || peek(p) == 'E') {
        whole = false;
        p->at++;
        const bool minus = peek(p) == '-';
        if (peek(p) == '-' || peek(p) == '+')
            p->at++;
        if (!is_digit(peek(p)))
            return fault(p, "a digit was expected");
        for (; is_digit(peek(p)); p->at++)
            power = power < 100000 ? power * 10 + (peek(p) - '0') : power;
        power = minus ? -power : power;
    }
    if (d.too_long || d.zeros >= 100000 || fraction >= 100000) {
        p->at = start;
        return fault(p, "a number with too many digits");
    }
    if (!convert(d.digit, d.count, power + d.zeros - fraction, &value->number)) {
        p->at = start;
        return fault(p, "a number too large");
    }
    value->kind = ASCC_JSON_NUMBER;
    if (whole && d.count + d.zeros <= 18) {
        int64_t integer = 0;
        for (int i = 0; i < d.count + d.zeros; i++)
            integer = integer * 10 + (i < d.count ? d.digit[i] - '0' : 0);
        value->integer = negative ? -integer : integer;
        value->is_integer = 1;
    }
    if (negative)
        value->number = -value->number;
    return ASCC_OK;
}

/* ---- Strings ----------------------------------------------------------------------------------- */

/* Length of the valid UTF-8 sequence at text[0..size), 0 = not valid. */
static size_t utf8_length(const unsigned char *text, size_t size)
{
    const unsigned char c = text[0];
    if (c < 0x80)
        return 1;
    const size_t length = c >= 0xf0 ? 4 : c >= 0xe0 ? 3 : 2;
    if (c < 0xc2 || c > 0xf4 || size < length)
        return 0;
    for (size_t i = 1; i < length; i++)
        if ((text[i] & 0xc0) != 0x80)
            return 0;
    if ((c == 0xe0 && text[1] < 0xa0) || (c == 0xed && text[1] > 0x9f) ||
        (c == 0xf0 && text[1] < 0x90) || (c == 0xf4 && text[1] > 0x8f))
        return 0;
    return length;
}

static void put_utf8(parser *p, uint32_t code)
{
    if (code < 0x80) {
        *p->decoded++ = (char)code;
        return;
    }
    if (code < 0x800) {
        *p->decoded++ = (char)(0xc0 | code >> 6);
    } else {
        if (code < 0x10000) {
            *p->decoded++ = (char)(0xe0 | code >> 12);
        } else {
            *p->decoded++ = (char)(0xf0 | code >> 18);
            *p->decoded++ = (char)(0x80 | (code >> 12 & 0x3f));
        }
        *p->decoded++ = (char)(0x80 | (code >> 6 & 0x3f));
    }
    *p->decoded++ = (char)(0x80 | (code & 0x3f));
}

static bool hex4(parser *p, uint32_t *code)
{
    if (p->size - p->at < 4)
        return false;
    *code = 0;
    for (int i = 0; i < 4; i++, p->at++) {
        const unsigned char c = p->text[p->at];
        const int digit = is_digit(c)              ? c - '0'
                          : (c >= 'a' && c <= 'f') ? c - 'a' + 10
                          : (c >= 'A' && c <= 'F') ? c - 'A' + 10
                                                   : -1;
        if (digit < 0)
            return false;
        *code = *code << 4 | (uint32_t)digit;
    }
    return true;
}

/* After a backslash. */
static ascc_status parse_escape(parser *p)
{
    static const char from[] = "\"\\/bfnrt", to[] = "\"\\/\b\f\n\r\t";
    const int c = peek(p);
    const char *simple = c > 0 ? strchr(from, c) : NULL;
    if (simple) {
        p->at++;
        *p->decoded++ = to[simple - from];
        return ASCC_OK;
    }
    uint32_t code = 0, low = 0;
    if (c != 'u')
        return fault(p, "an unknown escape");
    p->at++;
    if (!hex4(p, &code))
        return fault(p, "four hexadecimal digits were expected");
    if (code >= 0xd800 && code <= 0xdbff) {
        if (p->size - p->at < 2 || p->text[p->at] != '\\' || p->text[p->at + 1] != 'u')
            return fault(p, "half of a surrogate pair");
        p->at += 2;
        if (!hex4(p, &low) || low < 0xdc00 || low > 0xdfff)
            return fault(p, "half of a surrogate pair");
        code = 0x10000 + ((code - 0xd800) << 10) + (low - 0xdc00);
    } else if (code >= 0xdc00 && code <= 0xdfff) {
        return fault(p, "half of a surrogate pair");
    }
    if (code == 0)
        return fault(p, "a NUL in a string");
    put_utf8(p, code);
    return ASCC_OK;
}

static ascc_status parse_string(parser *p, const char **text)
{
    *text = p->decoded;
    p->at++;
    for (;;) {
        const int c = peek(p);
        if (c < 0)
            return fault(p, "a string without end");
        if (c < 0x20)
            return fault(p, "a control character in a string");
        if (c == '"') {
            p->at++;
            *p->decoded++ = '\0';
            return ASCC_OK;
        }
        if (c == '\\') {
            p->at++;
            const ascc_status status = parse_escape(p);
            if (status != ASCC_OK)
                return status;
            continue;
        }
        const size_t length = utf8_length(p->text + p->at, p->size - p->at);
        if (length == 0)
            return fault(p, "text that is not UTF-8");
        memcpy(p->decoded, p->text + p->at, length);
        p->decoded += length;
        p->at += length;
    }
}

/* ---- Structure --------------------------------------------------------------------------------- */

static ascc_status append(parser *p, uint32_t parent, const char *name, uint32_t *index)
{
    ascc_json *json = p->json;
    if (json->count >= ASCC_JSON_MAX_VALUES)
        return fault(p, "too many values");
    void *memory = json->value;
    if (!ascc_grow(&json->allocator, &memory, &json->capacity, json->count + 1,
                   sizeof *json->value))
        return ascc_fail(p->message, ASCC_ERROR_MEMORY, "no memory for JSON values");
    json->value = memory;
    *index = (uint32_t)json->count++;
    json->value[*index] = (ascc_json_value){.parent = parent, .name = name, .text = ""};
    if (parent != NONE) {
        ascc_json_value *container = &json->value[parent];
        if (container->last != 0)
            json->value[container->last].next = *index;
        container->last = *index;
        container->count++;
    }
    return ASCC_OK;
}

static bool take_word(parser *p, const char *word)
{
    const size_t length = strlen(word);
    if (p->size - p->at < length || memcmp(p->text + p->at, word, length) != 0)
        return false;
    p->at += length;
    return true;
}

/* A value that is no container. */
static ascc_status parse_scalar(parser *p, ascc_json_value *value)
{
    const int c = peek(p);
    if (c == '"') {
        value->kind = ASCC_JSON_STRING;
        return parse_string(p, &value->text);
    }
    if (take_word(p, "null")) {
        value->kind = ASCC_JSON_NULL;
        return ASCC_OK;
    }
    if (take_word(p, "true")) {
        value->kind = ASCC_JSON_TRUE;
        return ASCC_OK;
    }
    if (take_word(p, "false")) {
        value->kind = ASCC_JSON_FALSE;
        return ASCC_OK;
    }
    return parse_number(p, value);
}

static ascc_status parse_key(parser *p, const char **name)
{
    skip_space(p);
    if (peek(p) != '"')
        return fault(p, "a key was expected");
    const ascc_status status = parse_string(p, name);
    if (status != ASCC_OK)
        return status;
    skip_space(p);
    if (peek(p) != ':')
        return fault(p, "':' was expected");
    p->at++;
    return ASCC_OK;
}

/* After a value: closes what ends here. *open is then the container that goes on, NONE at the end. */
static ascc_status close_containers(parser *p, uint32_t *open, int *depth)
{
    while (*open != NONE) {
        const ascc_json_value *container = &p->json->value[*open];
        const int end = container->kind == ASCC_JSON_OBJECT ? '}' : ']';
        skip_space(p);
        const int c = peek(p);
        if (c == end) {
            p->at++;
            *open = container->parent;
            (*depth)--;
        } else if (c == ',') {
            p->at++;
            return ASCC_OK;
        } else {
            return fault(p, end == '}' ? "',' or '}' was expected" : "',' or ']' was expected");
        }
    }
    return ASCC_OK;
}

static ascc_status parse(parser *p)
{
    uint32_t open = NONE;
    int depth = 0;
    do {
        const char *name = "";
        uint32_t index = 0;
        ascc_status status;
        if (open != NONE && p->json->value[open].kind == ASCC_JSON_OBJECT) {
            status = parse_key(p, &name);
            if (status != ASCC_OK)
                return status;
        }
        skip_space(p);
        status = append(p, open, name, &index);
        if (status != ASCC_OK)
            return status;
        const int c = peek(p);
        if (c == '{' || c == '[') {
            if (depth == ASCC_JSON_MAX_DEPTH)
                return fault(p, "nested too deeply");
            p->json->value[index].kind = c == '{' ? ASCC_JSON_OBJECT : ASCC_JSON_ARRAY;
            p->at++;
            open = index;
            depth++;
            skip_space(p);
            if (peek(p) != (c == '{' ? '}' : ']'))
                continue;
        } else {
            status = parse_scalar(p, &p->json->value[index]);
            if (status != ASCC_OK)
                return status;
        }
        status = close_containers(p, &open, &depth);
        if (status != ASCC_OK)
            return status;
    } while (open != NONE);
    skip_space(p);
    return p->at == p->size ? ASCC_OK : fault(p, "text after the end");
}

/* ---- Duplicate keys: members sorted by (parent, name) ------------------------------------------- */

static int compare(const ascc_json *json, uint32_t a, uint32_t b)
{
    const ascc_json_value *x = &json->value[a], *y = &json->value[b];
    if (x->parent != y->parent)
        return x->parent < y->parent ? -1 : 1;
    return strcmp(x->name, y->name);
}

static bool member_before(const void *json, const void *a, const void *b)
{
    return compare(json, *(const uint32_t *)a, *(const uint32_t *)b) < 0;
}

static ascc_status refuse_duplicates(const ascc_json *json, ascc_message *message)
{
    uint32_t *key = ascc_allocate(&json->allocator, json->count, sizeof *key);
    if (!key)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for JSON keys");
    size_t count = 0;
    for (size_t i = 1; i < json->count; i++)
        if (json->value[json->value[i].parent].kind == ASCC_JSON_OBJECT)
            key[count++] = (uint32_t)i;
    ascc_heap_sort(key, count, sizeof *key, member_before, json);
    ascc_status status = ASCC_OK;
    for (size_t i = 1; i < count && status == ASCC_OK; i++)
        if (compare(json, key[i - 1], key[i]) == 0)
            status = ascc_fail(message, ASCC_ERROR_FORMAT, "JSON: key '%s' appears twice",
                               ascc_quote(json->value[key[i]].name).text);
    ascc_release(&json->allocator, key, json->count, sizeof *key);
    return status;
}

/* ---- The interface ------------------------------------------------------------------------------ */

ascc_status ascc_json_open(const ascc_allocator *allocator, const char *text, size_t size,
                           ascc_json *json, ascc_message *message)
{
    *json = (ascc_json){.allocator = *allocator, .text_size = size};
    /* A string's text is shorter than it was with its quotes, so `size` bytes hold them all. */
    json->text = ascc_allocate(allocator, size, 1);
    if (!json->text)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for JSON text");
    parser p = {.text = (const unsigned char *)text,
                .size = size,
                .json = json,
                .decoded = json->text,
                .message = message};
    ascc_status status = parse(&p);
    if (status == ASCC_OK)
        status = refuse_duplicates(json, message);
    if (status != ASCC_OK)
        ascc_json_close(json);
    return status;
}

void ascc_json_close(ascc_json *json)
{
    if (json->value)
        ascc_release(&json->allocator, json->value, json->capacity, sizeof *json->value);
    if (json->text)
        ascc_release(&json->allocator, json->text, json->text_size, 1);
    *json = (ascc_json){.value = NULL};
}

uint32_t ascc_json_first(const ascc_json *json, uint32_t parent)
{
    return json->value[parent].count ? parent + 1 : 0;
}

uint32_t ascc_json_find(ascc_json *json, uint32_t object, const char *name)
{
    for (uint32_t i = ascc_json_first(json, object); i != 0; i = json->value[i].next)
        if (strcmp(json->value[i].name, name) == 0) {
            json->value[i].used = 1;
            return i;
        }
    return 0;
}

size_t ascc_json_number(const char *text, double *number)
{
    ascc_message message;
    ascc_json_value value = {.kind = ASCC_JSON_NUMBER};
    parser p = {.text = (const unsigned char *)text, .size = strlen(text), .message = &message};
    if (parse_number(&p, &value) != ASCC_OK)
        return 0;
    *number = value.number;
    return p.at;
}

ascc_quoted ascc_quote(const char *text)
{
    ascc_quoted quoted;
    size_t i = 0;
    for (; text[i] != '\0' && i < sizeof quoted.text - 1; i++)
        quoted.text[i] = text[i] >= 0x20 && text[i] < 0x7f ? text[i] : '?';
    quoted.text[i] = '\0';
    if (text[i] != '\0')
        memcpy(quoted.text + i - 3, "...", 3);
    return quoted;
}
