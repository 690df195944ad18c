/* The scenes of the stability suite. SPDX-License-Identifier: MIT */
#ifndef STABILITY_SUITE_H
#define STABILITY_SUITE_H

#include "cell.h"

typedef struct stability_scene {
    const char *name;
    const char *line; /* what passes */
    long quick, full; /* frames */
    void (*run)(cell *c);
} stability_scene;

/** NULL name at the end. A scene more is a function and a line in its table: docs/stability.md. */
extern const stability_scene stability_scenes[];

#endif
