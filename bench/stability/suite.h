/* The scenes of the stability suite. SPDX-License-Identifier: MIT */
#ifndef STABILITY_SUITE_H
#define STABILITY_SUITE_H

#include "cell.h"

#define SPACING 0.05 /* m, what the published networks were trained with */
#define G 9.81
/* What a fall through a box of 16 spacings ends with. */
#define FALL sqrt(2.0 * G * 16 * SPACING)

typedef struct stability_scene {
    const char *name;
    const char *line; /* what passes */
    long quick, full; /* frames */
    void (*run)(cell *c);
} stability_scene;

/** NULL name at the end. A scene more is a function and a line in its table: docs/stability.md. */
extern const stability_scene stability_scenes[];

/* Those of moving.c. */
void stability_light_body(cell *c);
void stability_heavy_body(cell *c);
void stability_held_box(cell *c);
void stability_thin_cup(cell *c);
void stability_narrow_slab(cell *c);
void stability_paddle(cell *c);
void stability_turned_tank(cell *c);
void stability_tap(cell *c);
/* Those of resting.c. */
void stability_sleep_and_wake(cell *c);
void stability_pool_with_a_drop(cell *c);
/* Those of rungs.c. */
void stability_budget(cell *c);
void stability_seam(cell *c);

#endif
