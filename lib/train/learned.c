/* Constants that are trained: between parameters, plan and file. SPDX-License-Identifier: MIT */
#include "learned.h"

#include <ascc/train.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "model/relaxation.h"

#define ROOM 24 /* bytes of a number of 17 digits */
/* How far values may go from the model's own, as parameters. */
#define LEAST_VOLUME (-0.25)
#define MOST_VOLUME 0.25
#define LEAST (-0.9)
#define MOST 9.0

static const struct {
    uint32_t bit;
    const char *key;
} keys[] = {{ASCC_LEARN_REST_VOLUME, "rest_volume"},
            {ASCC_LEARN_EPSILON, "epsilon"},
            {ASCC_LEARN_OMEGA, "omega"},
            {ASCC_LEARN_DIVERGENCE, "divergence"}};
enum { KEYS = sizeof keys / sizeof *keys };

/* The values of key k among these constants. */
static double *values_of(ascc_relaxation *r, int k, int32_t *count)
{
    double *const at[KEYS] = {&r->rest_volume, &r->epsilon, r->pressure.omega, r->divergence.omega};
    const int32_t counts[KEYS] = {1, 1, r->pressure.count, r->divergence.count};
    *count = counts[k];
    return at[k];
}

ascc_status ascc_learned_open(ascc_learned *learned, uint32_t which, const ascc_plan *plan,
                              ascc_message *message)
{
    *learned = (ascc_learned){.which = which,
                              .given = plan->relaxation,
                              .spacing = plan->spacing,
                              .dimension = plan->dimension};
    for (int k = 0; k < KEYS; k++) {
        int32_t count;
        (void)values_of(&learned->given, k, &count);
        if (!(which & keys[k].bit))
            continue;
        if (!plan->relaxation.pressure.count || count == 0)
            return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                             "options: the model has no relaxation with '%s' to learn",
                             keys[k].key);
        learned->count += (size_t)count;
    }
    return ASCC_OK;
}

/* ---- Values ---- */

/* The constants of these parameters. */
static ascc_relaxation constants_of(const ascc_learned *learned, const float *parameters)
{
    ascc_relaxation r = learned->given;
    for (int k = 0; k < KEYS; k++) {
        int32_t count;
        double *value = values_of(&r, k, &count);
        for (int32_t i = 0; learned->which & keys[k].bit && i < count; i++)
            value[i] *= 1.0 + (double)*parameters++;
    }
    return r;
}

void ascc_learned_apply(const ascc_learned *learned, const float *parameters, ascc_plan *plan)
{
    ascc_relaxation r = constants_of(learned, parameters);
    if (learned->count == 0)
        return;
    ascc_relaxation_derive(&r, learned->dimension);
    plan->relaxation = r;
}

static bool is_volume_good(const ascc_learned *learned, double volume)
{
    const double support = learned->given.support, s = learned->spacing;
    const double bounds[4] = {support / ASCC_SMALLEST_SUPPORT, 2.0 * s,
                              support / ASCC_LARGEST_SUPPORT, 0.5 * s};
    bool good = true;
    for (int i = 0; i < 4; i++) { /* a little less than what the reader takes, who finds roots */
        const double b = bounds[i], power = learned->dimension == 2 ? b * b : b * b * b;
        good &= i < 2 ? volume <= 0.9999 * power : volume >= 1.0001 * power;
    }
    return good;
}

static float within(float parameter, double value, double least, double most)
{
    const double low = fmax(least / value - 1.0, LEAST), high = fmin(most / value - 1.0, MOST);
    const double t = fmin(fmax((double)parameter, low), high);
    float to = (float)t;
    if ((double)to > high)
        to = nextafterf(to, -1.0f);
    if ((double)to < low)
        to = nextafterf(to, INFINITY);
    return to;
}

/* All weights become smaller until their sweeps settle. */
static void settle(const ascc_learned *learned, int k, float *parameters, int32_t count)
{
    for (;;) {
        ascc_sweeps sweeps = k == 2 ? learned->given.pressure : learned->given.divergence;
        for (int32_t i = 0; i < count; i++)
            sweeps.omega[i] *= 1.0 + (double)parameters[i];
        if (ascc_sweeps_settle(&sweeps))
            return;
        for (int32_t i = 0; i < count; i++)
            parameters[i] = within((float)(0.995 * (1.0 + (double)parameters[i]) - 1.0),
                                   sweeps.omega[i], ASCC_SMALLEST_OMEGA, ASCC_LARGEST_OMEGA);
    }
}

void ascc_learned_bound(const ascc_learned *learned, float *parameters)
{
    ascc_relaxation given = learned->given;
    for (int k = 0; k < KEYS; k++) {
        int32_t count;
        const double *value = values_of(&given, k, &count);
        if (!(learned->which & keys[k].bit))
            continue;
        for (int32_t i = 0; i < count; i++)
            parameters[i] =
                k == 0 ? (float)fmin(fmax((double)parameters[i], LEAST_VOLUME), MOST_VOLUME)
                : k == 1
                    ? within(parameters[i], value[i], ASCC_SMALLEST_EPSILON, ASCC_LARGEST_EPSILON)
                    : within(parameters[i], value[i], ASCC_SMALLEST_OMEGA, ASCC_LARGEST_OMEGA);
        while (k == 0 && parameters[0] != 0.0f &&
               !is_volume_good(learned, value[0] * (1.0 + (double)parameters[0])))
            parameters[0] = fabsf(parameters[0]) < 1e-6f ? 0.0f : 0.9f * parameters[0];
        if (k >= 2)
            settle(learned, k, parameters, count);
        parameters += count;
    }
}

bool ascc_learned_takes(const ascc_learned *learned, const float *parameters)
{
    float bounded[ASCC_MOST_LEARNED];
    for (size_t i = 0; i < learned->count; i++)
        if (!isfinite(parameters[i]))
            return false;
    memcpy(bounded, parameters, learned->count * sizeof *bounded);
    ascc_learned_bound(learned, bounded);
    return memcmp(bounded, parameters, learned->count * sizeof *bounded) == 0;
}

void ascc_learned_add_gradient(const ascc_learned *learned,
                               const ascc_constant_gradients *gradients, const float *parameters,
                               float share, float *to)
{
    const double *const from[KEYS] = {&gradients->volume, &gradients->epsilon, gradients->pressure,
                                      gradients->divergence};
    ascc_relaxation given = learned->given;
    for (int k = 0; k < KEYS; k++) {
        int32_t count;
        const double *value = values_of(&given, k, &count);
        for (int32_t i = 0; learned->which & keys[k].bit && i < count; i++, parameters++) {
            const double by_logarithm = 1.0 / (1.0 + (double)*parameters);
            *to++ += share * (float)(from[k][i] * (k == 0 ? by_logarithm : value[i]));
        }
    }
}

/* ---- The file ---- */

/* The place behind "key": in the header, in a text within its text; NULL if it is not there. */
static const char *after_key(const char *from, const char *end, const char *key)
{
    char name[32];
    const int length = snprintf(name, sizeof name, "\\\"%s\\\"", key);
    for (const char *c = from; end - c > length; c++)
        if (memcmp(c, name, (size_t)length) == 0) {
            for (c += length; c < end && (*c == ' ' || *c == ':'); c++)
                ;
            return c;
        }
    return NULL;
}

static size_t number_length(const char *c, const char *end)
{
    size_t n = 0;
    while (c + n < end && strchr("+-.0123456789eE", c[n]) && c[n])
        n++;
    return n;
}

typedef struct copying {
    const char *from, *end; /* of the header that is left */
    unsigned char *to;
    size_t size, most;
} copying;

static void copy_until(copying *c, const char *stop)
{
    const size_t n = (size_t)(stop - c->from);
    if (c->to)
        memcpy(c->to + c->size, c->from, n);
    c->size += n;
    c->from = stop;
}

/* Copies what lies before a number, and the number into room of its own. False where there is none. */
static bool copy_number(copying *c, const char *number, size_t *place)
{
    const size_t length = number_length(number, c->end);
    if (length == 0 || length > ROOM)
        return false;
    copy_until(c, number);
    *place = c->size;
    copy_until(c, number + length);
    if (c->to)
        memset(c->to + c->size, ' ', ROOM - length);
    c->size += ROOM - length;
    return true;
}

/* Keys in the order of the file. */
static int next_key(const ascc_learned *learned, const copying *c, const char **at)
{
    int found = -1;
    for (int k = 0; k < KEYS; k++) {
        const char *place =
            learned->which & keys[k].bit ? after_key(c->from, c->end, keys[k].key) : NULL;
        if (place && (found < 0 || place < *at)) {
            found = k;
            *at = place;
        }
    }
    return found;
}

/* Where among the parameters those of key k begin. */
static size_t first_of(const ascc_learned *learned, int k)
{
    ascc_relaxation given = learned->given;
    size_t first = 0;
    for (int i = 0; i < k; i++) {
        int32_t count;
        (void)values_of(&given, i, &count);
        first += learned->which & keys[i].bit ? (size_t)count : 0;
    }
    return first;
}

/* The whole header; false if a value is not written plainly. */
static bool copy_header(ascc_learned *learned, copying *c)
{
    size_t done = 0;
    const char *at = after_key(c->from, c->end, "relaxation");
    if (!at)
        return false;
    copy_until(c, at);
    for (int k; done < learned->count && (k = next_key(learned, c, &at)) >= 0;) {
        int32_t count;
        (void)values_of(&learned->given, k, &count);
        for (int32_t i = 0; i < count; i++, done++) {
            while (at < c->end && (*at == '[' || *at == ',' || *at == ' '))
                at++;
            if (!copy_number(c, at, &learned->place[first_of(learned, k) + (size_t)i]))
                return false;
            at = c->from;
        }
    }
    copy_until(c, c->end);
    while (c->size % 8) {
        if (c->to)
            c->to[c->size] = ' ';
        c->size++;
    }
    return done == learned->count;
}

ascc_status ascc_learned_make_room(ascc_learned *learned, const ascc_allocator *allocator,
                                   const unsigned char *file, size_t size, unsigned char **made,
                                   size_t *made_size, ascc_message *message)
{
    uint64_t length = 0;
    for (int i = 7; i >= 0; i--)
        length = length << 8 | file[i];
    const char *header = (const char *)file + 8, *end = header + length;
    copying c = {.from = header, .end = end};
    if (!copy_header(learned, &c))
        return ascc_fail(message, ASCC_ERROR_FORMAT,
                         "model: constants to learn are not written in it as plain numbers");
    const size_t data = size - 8 - (size_t)length;
    *made_size = 8 + c.size + data;
    *made = ascc_allocate(allocator, *made_size, 1);
    if (!*made)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory for the trainer");
    for (int i = 0; i < 8; i++)
        (*made)[i] = (unsigned char)((uint64_t)c.size >> (8 * i));
    c = (copying){.from = header, .end = end, .to = *made + 8};
    (void)copy_header(learned, &c);
    memcpy(*made + 8 + c.size, file + 8 + length, data);
    for (size_t i = 0; i < learned->count; i++)
        learned->place[i] += 8;
    return ASCC_OK;
}

bool ascc_learned_covers(const ascc_learned *learned, size_t at)
{
    for (size_t i = 0; i < learned->count; i++)
        if (at >= learned->place[i] && at < learned->place[i] + ROOM)
            return true;
    return false;
}

/* A positive number in 17 digits, whatever the host's decimal point. */
static size_t print_number(double value, char text[ROOM + 1])
{
    char digits[48];
    (void)snprintf(digits, sizeof digits, "%.16e", value);
    const char *e = strchr(digits, 'e');
    return (size_t)snprintf(text, ROOM + 1, "%c.%.16s%s", digits[0], e - 16, e);
}

void ascc_learned_write(const ascc_learned *learned, const float *parameters, unsigned char *file)
{
    float bounded[ASCC_MOST_LEARNED];
    if (learned->count == 0)
        return;
    memcpy(bounded, parameters, learned->count * sizeof *bounded);
    ascc_learned_bound(learned, bounded); /* averages of weights need not settle */
    ascc_relaxation r = constants_of(learned, bounded);
    size_t n = 0;
    for (int k = 0; k < KEYS; k++) {
        int32_t count;
        const double *value = values_of(&r, k, &count);
        for (int32_t i = 0; learned->which & keys[k].bit && i < count; i++, n++) {
            char text[ROOM + 1];
            const size_t length = print_number(value[i], text);
            memcpy(file + learned->place[n], text, length);
            memset(file + learned->place[n] + length, ' ', ROOM - length);
        }
    }
}
