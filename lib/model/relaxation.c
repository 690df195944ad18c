/* Reads a relaxation and refuses constants with which it would not settle. SPDX-License-Identifier: MIT */
#include "relaxation.h"

#include <math.h>
#include <string.h>

/* Neighbour lists of a relaxation reach this far beyond its support, in spacings: they are made where
 * the network sees the particles, and it moves them. */
#define MARGIN 0.25
/* Above the largest eigenvalue of a sweep, D^-1 B B^T: 3.2 on a cubic lattice at rest, 2.4 on a square
 * one, more where it is compressed. */
#define LARGEST_EIGENVALUE 4.0

/* The positive root of x^d = v by Newton, in any build the same. */
static double root(double v, int32_t d)
{
    double x = v > 1.0 ? v : 1.0;
    for (int i = 0; i < 200; i++)
        x -= (d == 2 ? x * x - v : x * x * x - v) / (d == 2 ? 2.0 * x : 3.0 * x * x);
    return x;
}

/* D of a particle inside an unbounded square or cubic lattice, in supports^-2. */
static double lattice_response(double amount, double apart, int32_t d)
{
    const int reach = (int)ceil(1.0 / apart);
    double sum = 0.0;
    for (int z = d == 3 ? -reach : 0; z <= (d == 3 ? reach : 0); z++)
        for (int y = -reach; y <= reach; y++)
            for (int x = -reach; x <= reach; x++) {
                const double q = apart * sqrt((double)(x * x + y * y + z * z));
                const double far = 1.0 - q, near = 0.5 - q;
                const double slope =
                    q >= 1.0 ? 0.0 : 6.0 * (far * far - (near > 0.0 ? 4.0 * near * near : 0.0));
                sum += amount * slope * amount * slope;
            }
    return sum;
}

static double support_volume(const ascc_relaxation *r, int32_t d)
{
    return d == 2 ? r->support * r->support : r->support * r->support * r->support;
}

/* How far particles at rest are apart, in supports. */
static double distance_at_rest(const ascc_relaxation *r, int32_t d)
{
    return root(r->rest_volume / support_volume(r, d), d);
}

/* Volumes are counted in what the spline sums to. */
void ascc_relaxation_derive(ascc_relaxation *r, int32_t d)
{
    static const double pi = 3.14159265358979323846;
    r->amount = (d == 2 ? 40.0 / (7.0 * pi) : 8.0 / pi) * r->rest_volume / support_volume(r, d);
    r->lattice_response = lattice_response(r->amount, distance_at_rest(r, d), d);
}

static void find_constants(ascc_reader *reader, const ascc_plan *plan, ascc_relaxation *r)
{
    const double apart = distance_at_rest(r, plan->dimension);
    if (!(ASCC_SMALLEST_SUPPORT * apart <= 1.0 && ASCC_LARGEST_SUPPORT * apart >= 1.0)) {
        ascc_reader_fail(reader,
                         "'support' must be %g to %g times the distance of particles at rest, "
                         "%g m by 'rest_volume'",
                         ASCC_SMALLEST_SUPPORT, ASCC_LARGEST_SUPPORT, apart * r->support);
        return;
    }
    if (!(apart * r->support >= 0.5 * plan->spacing && apart * r->support <= 2.0 * plan->spacing)) {
        ascc_reader_fail(reader,
                         "by 'rest_volume' particles at rest are %g m apart, but must be 0.5 to 2 "
                         "particle spacings",
                         apart * r->support);
        return;
    }
    ascc_relaxation_derive(r, plan->dimension);
    r->reach = r->support + MARGIN * plan->spacing;
}

/* What sweeps leave of an excess is the product of their 1 - omega lambda, for every eigenvalue lambda. */
bool ascc_sweeps_settle(const ascc_sweeps *sweeps)
{
    enum { STEPS = 400 };
    for (int i = 0; i <= STEPS; i++) {
        const double eigenvalue = LARGEST_EIGENVALUE * i / STEPS;
        double left = 1.0;
        for (int32_t k = 0; k < sweeps->count; k++)
            left *= 1.0 - sweeps->omega[k] * eigenvalue;
        if (!(fabs(left) <= 1.0 + 1e-9))
            return false;
    }
    return true;
}

/* The length of a list of sweeps; 0 if it is none. */
static int32_t count_sweeps(ascc_reader *reader, uint32_t object, const char *key)
{
    const uint32_t list = ascc_reader_array(reader, object, key);
    int32_t count = 0;
    if (reader->status != ASCC_OK)
        return 0;
    for (uint32_t i = ascc_json_first(reader->json, list); i != 0; i = reader->json->value[i].next)
        count++;
    if (count >= 1 && count <= ASCC_MAX_SWEEPS)
        return count;
    ascc_reader_fail(reader, "'%s' must have a number for each sweep, 1 to %d of them", key,
                     ASCC_MAX_SWEEPS);
    return 0;
}

static void read_sweeps(ascc_reader *reader, uint32_t object, const char *key, ascc_sweeps *sweeps)
{
    const int32_t count = count_sweeps(reader, object, key);
    if (count == 0)
        return;
    ascc_reader_numbers(reader, object, key, count, ASCC_SMALLEST_OMEGA, ASCC_LARGEST_OMEGA,
                        sweeps->omega);
    sweeps->count = count;
    if (reader->status == ASCC_OK && !ascc_sweeps_settle(sweeps))
        ascc_reader_fail(reader,
                         "sweeps of these numbers '%s' would not settle; if all are the same, 0.5 "
                         "is the most",
                         key);
}

/* Each sweep is at most a half: then none adds energy, whatever the velocities. */
static void read_viscosity(ascc_reader *reader, uint32_t object, ascc_relaxation *r)
{
    const uint32_t o = ascc_reader_object(reader, object, "hyperviscosity");
    ascc_reader_where(reader, "relaxation 'hyperviscosity'");
    const int32_t count = count_sweeps(reader, o, "shares");
    if (count > 0)
        ascc_reader_numbers(reader, o, "shares", count, 1e-3, 0.5, r->viscosity.omega);
    r->viscosity.count = count;
    r->viscosity_below = ascc_reader_number(reader, o, "below", 1e-6, 1e6);
    ascc_reader_end(reader, o);
    ascc_reader_where(reader, "relaxation");
}

/* The value that pressures begin with. */
static int32_t read_guess(ascc_reader *reader, uint32_t object, const ascc_plan_builder *builder)
{
    const char *name = ascc_reader_text(reader, object, "guess");
    const int32_t value = reader->status == ASCC_OK ? ascc_plan_find_value(builder, name) : -1;
    const ascc_layer *layer = value >= 2 ? &builder->layer[value - 2] : NULL;
    if (reader->status == ASCC_OK &&
        (!layer || layer->set != ASCC_SET_FLUID || layer->channels != 1))
        ascc_reader_fail(reader,
                         "'guess' is '%s', not a layer of one channel on the points 'fluid'",
                         ascc_quote(name).text);
    return value;
}

/* How often pressure sweeps may begin anew in a step. */
static void read_rounds(ascc_reader *reader, uint32_t object, ascc_relaxation *r)
{
    const uint32_t o = ascc_reader_object(reader, object, "rounds");
    ascc_reader_where(reader, "relaxation 'rounds'");
    r->rounds = ascc_reader_integer(reader, o, "most", 1, ASCC_MAX_ROUNDS);
    r->again = ascc_reader_number(reader, o, "above", 1e-3, 1e3);
    if (ascc_reader_has(reader, o, "left"))
        r->left = ascc_reader_number(reader, o, "left", 0.0, r->again);
    ascc_reader_end(reader, o);
    ascc_reader_where(reader, "relaxation");
}

void ascc_relaxation_read(ascc_reader *reader, uint32_t object, ascc_plan_builder *builder)
{
    static const char *const directions[] = {"current"};
    ascc_plan *plan = &builder->plan;
    if (!ascc_reader_has(reader, object, "relaxation"))
        return;
    const uint32_t o = ascc_reader_object(reader, object, "relaxation");
    ascc_relaxation r = {.rounds = 1, .left = -1.0};
    ascc_reader_where(reader, "relaxation");
    r.support = ascc_reader_number(reader, o, "support", ASCC_PLAN_MIN, ASCC_PLAN_MAX);
    r.rest_volume = ascc_reader_number(reader, o, "rest_volume", 1e-45, 1e45);
    read_sweeps(reader, o, "omega", &r.pressure);
    r.epsilon =
        ascc_reader_number(reader, o, "epsilon", ASCC_SMALLEST_EPSILON, ASCC_LARGEST_EPSILON);
    r.limit = ascc_reader_number(reader, o, "limit", 1e-6 * r.support, r.support);
    if (ascc_reader_has(reader, o, "divergence"))
        read_sweeps(reader, o, "divergence", &r.divergence);
    if (ascc_reader_has(reader, o, "hyperviscosity"))
        read_viscosity(reader, o, &r);
    if (ascc_reader_has(reader, o, "rounds"))
        read_rounds(reader, o, &r);
    if (ascc_reader_has(reader, o, "direction"))
        r.current_direction = 1 + ascc_reader_choice(reader, o, "direction", directions, 1);
    if (ascc_reader_has(reader, o, "guess"))
        r.guess = read_guess(reader, o, builder);
    if (ascc_reader_has(reader, o, "contact"))
        r.contact = ascc_reader_number(reader, o, "contact", 0.0, r.support);
    if (ascc_reader_has(reader, o, "repulsion")) {
        const uint32_t p = ascc_reader_object(reader, o, "repulsion");
        ascc_reader_where(reader, "relaxation 'repulsion'");
        r.repulsion = ascc_reader_number(reader, p, "distance", 0.0, 0.5 * r.support);
        r.stiffness = ascc_reader_number(reader, p, "stiffness", 0.0, 1.0);
        ascc_reader_end(reader, p);
        ascc_reader_where(reader, "relaxation");
    }
    ascc_reader_end(reader, o);
    if (reader->status == ASCC_OK)
        find_constants(reader, plan, &r);
    ascc_reader_where(reader, "network");
    plan->relaxation = r;
}
