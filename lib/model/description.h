/* The network description of libascc's own model files: JSON text to plan (docs/file-format.md).
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_DESCRIPTION_H
#define ASCC_DESCRIPTION_H

#include "plan_builder.h"

/* Reads the text into an opened builder. errors: FORMAT with the key at fault, MEMORY. */
ascc_status ascc_description_read(ascc_plan_builder *builder, const char *text);

#endif
