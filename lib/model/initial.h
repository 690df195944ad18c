/* Initial values of weights: random, of a size that carries values of about 1 through a network.
 * SPDX-License-Identifier: MIT
 *
 * Operations fill their tensors with this. Only operations that are rounded correctly (+ - * / sqrt), so that
 * the same numbers come out on every machine.
 */
#ifndef ASCC_INITIAL_H
#define ASCC_INITIAL_H

#include "base/random.h"
#include "operation.h"

/* A tensor to be filled. */
typedef struct ascc_initial {
    const ascc_plan *plan;
    const ascc_layer *layer; /* NULL of an output */
    const ascc_term *term;   /* the first that reads the tensor */
    int32_t number;          /* which of its tensors */
    int32_t rank;
    double gain; /* of all values: small in a layer that is a plain output's source */
    ascc_random random;
    float *value; /* [count], zeros; last dimension: outputs */
    size_t count;
    const size_t *shape;
} ascc_initial;

/* Fills value[first .. first + count) with normal numbers of that deviation, times the gain; where the tensor
 * may hold no negative numbers, with their magnitudes. */
void ascc_initial_fill(ascc_initial *initial, size_t first, size_t count, double deviation);

/* Weights by the number of their inputs (He with ReLU, Glorot without); biases (of one dimension) 0 after a ReLU,
 * else a small positive number, as layers of features have no ReLU before them but one behind. */
void ascc_initial_default(ascc_initial *initial);

/* ---- What operations find their deviations with ---- */

/* Set of the term's source; whether a point is its own neighbour; m between points of a set. */
int32_t ascc_initial_source(const ascc_initial *initial);
bool ascc_initial_sees_itself(const ascc_initial *initial);
double ascc_initial_spacing(const ascc_plan *plan, int32_t set);

/* Sum of weight(filter, k, distance / radius)^power, power 1 or 2, over the neighbours that a term's point may
 * expect: a lattice around it, somewhat thinned as fluids have surfaces; of walls a plane. */
double ascc_initial_sum(const ascc_initial *initial,
                        double (*weight)(const ascc_filter *filter, int32_t k, double rho),
                        int32_t k, int power);

/* Units of output of a twentieth of a spacing, at most 10: outputs begin as small whatever their `scale`. */
double ascc_initial_output(const ascc_plan *plan);

#endif
