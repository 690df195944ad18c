/* Cells in a file, so that a run goes on where an earlier one was stopped. SPDX-License-Identifier: MIT */
#ifndef STABILITY_KEPT_H
#define STABILITY_KEPT_H

#include "cell.h"

/* Whether the file has the cell, of as many frames and dimensions: frame, verdict and text are read into it. */
bool kept_find(const char *path, const char *scene, const char *method, cell *c, double *seconds);

/* Adds the cell as a line; processes may do so at once. */
bool kept_add(const char *path, const char *scene, const char *method, const cell *c,
              double seconds);

#endif
