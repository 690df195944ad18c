/* A model for when no trained network is at hand: a demonstration, not trained.
 * SPDX-License-Identifier: MIT
 *
 * One antisymmetric layer whose kernel is a radial repulsion: particles nearer than a spacing push
 * each other apart, walls push too. It shows what the antisymmetric layer guarantees, exact
 * momentum, with a fluid that bounces and settles. It is not water, and no substitute for training.
 */
#ifndef DEMO_MODEL_H
#define DEMO_MODEL_H

#include <stddef.h>

/**
 * The bytes of a model file (docs/file-format.md), for ascc_model_load_memory.
 *
 * dimension  2 or 3
 * spacing    particle spacing, m. The time step follows: a fluid at this scale falls as many
 *            spacings in a step as at any other.
 * size       receives the number of bytes
 * returns    NULL without memory or with bad arguments; else the caller's, to be given to free().
 */
unsigned char *demo_model_bytes(int dimension, double spacing, size_t *size);

#endif
