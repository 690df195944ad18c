/* Initial values of weights, as initial.h draws them. SPDX-License-Identifier: MIT */
#include "initial.h"

#include <math.h>

static const double PI = 3.14159265358979323846;
static const double FILL = 0.7;  /* of the neighbours inside a lattice: fluids have surfaces */
static const double WALLS = 2.5; /* points of a wall in a square spacing: dense, or in layers */
static const double BIAS = 0.1;
static const double GUESS = 0.1; /* of a relaxation's pressures: weak, and most above 0 */

void ascc_initial_fill(ascc_initial *initial, size_t first, size_t count, double deviation)
{
    const bool positive = initial->term->operation->not_negative >> initial->number & 1;
    for (size_t i = first; i < first + count; i++) {
        const double random = initial->gain * deviation * ascc_random_normal(&initial->random);
        initial->value[i] = (float)(positive ? fabs(random) : random);
    }
}

static bool is_guess(const ascc_initial *initial)
{
    const int32_t guess = initial->plan->relaxation.guess;
    return guess && initial->layer == &initial->plan->layer[guess - 2];
}

void ascc_initial_default(ascc_initial *initial)
{
    const bool rectify = initial->term->rectify != 0, guess = is_guess(initial);
    const double outputs = (double)initial->shape[initial->rank - 1];
    if (initial->rank > 1)
        ascc_initial_fill(initial, 0, initial->count,
                          (guess ? GUESS : 1.0) *
                              sqrt((rectify ? 2.0 : 1.0) * outputs / (double)initial->count));
    for (size_t i = 0; initial->rank == 1 && i < initial->count; i++)
        initial->value[i] = guess ? (float)GUESS : rectify ? 0.0f : (float)(initial->gain * BIAS);
}

int32_t ascc_initial_source(const ascc_initial *initial)
{
    return ascc_plan_value_set(initial->plan->layer, initial->term->source);
}

bool ascc_initial_sees_itself(const ascc_initial *initial)
{
    return !initial->term->filter.skip_self && initial->layer &&
           ascc_initial_source(initial) == initial->layer->set;
}

/* By Newton, from above. */
static double cube_root(double number)
{
    double root = fmax(number, 1.0);
    for (int i = 0; i < 100; i++)
        root = (2.0 * root + number / (root * root)) / 3.0;
    return root;
}

double ascc_initial_spacing(const ascc_plan *plan, int32_t set)
{
    if (set < ASCC_SET_LEVEL || set == ASCC_SET_EDGES)
        return plan->spacing;
    const ascc_level *level = &plan->level[set - ASCC_SET_LEVEL + 1];
    if (!(level->ratio > 0.0))
        return level->voxel;
    const double fewer = 1.0 / level->ratio;
    return plan->spacing * (plan->dimension == 2 ? sqrt(fewer) : cube_root(fewer));
}

double ascc_initial_sum(const ascc_initial *initial,
                        double (*weight)(const ascc_filter *filter, int32_t k, double rho),
                        int32_t k, int power)
{
    enum { SLICES = 400 };
    const ascc_filter *filter = &initial->term->filter;
    const int32_t set = ascc_initial_source(initial);
    const bool wall = set == ASCC_SET_BOUNDARY, flat = initial->plan->dimension == 2;
    const double radius = filter->radius / ascc_initial_spacing(initial->plan, set);
    const double away = wall ? 0.25 * radius : 0.0; /* of the plane */
    double sum = 0.0;
    for (int i = 0; i < SLICES; i++) {
        const double r = radius * (i + 0.5) / SLICES, dr = radius / SLICES;
        const double rho = sqrt(r * r + away * away) / radius;
        const double by = rho < 1.0 ? weight(filter, k, rho) : 0.0;
        const double area = wall && flat ? 2.0 : wall || flat ? 2.0 * PI * r : 4.0 * PI * r * r;
        sum += area * dr * (power == 2 ? by * by : by);
    }
    return (wall ? WALLS : FILL) * sum;
}

double ascc_initial_output(const ascc_plan *plan)
{
    const double scale = fabs(plan->output.scale[0]);
    return scale > 0.0 ? fmin(0.05 * plan->spacing / scale, 10.0) : 1.0;
}
