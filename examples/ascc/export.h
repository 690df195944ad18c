/* A sequence as frames for other programs. SPDX-License-Identifier: MIT */
#ifndef ASCC_EXPORT_H
#define ASCC_EXPORT_H

#include "frames.h"

/* Writes each frames->every-th frame of a sequence file into the folders of `frames`; time_step is the
 * sequence's. The exit status, 1 after a line on stderr. */
int ascc_export(const char *sequence, ascc_frames *frames);

#endif
