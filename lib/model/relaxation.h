/* A pressure relaxation after the network: its constants, from a description (docs/method.md, section on
 * relaxation). SPDX-License-Identifier: MIT */
#ifndef ASCC_MODEL_RELAXATION_H
#define ASCC_MODEL_RELAXATION_H

#include "file/json_reader.h"
#include "plan_builder.h"

/* Reads the member `relaxation` of the description, if it is there, and finds what follows from it. The layers
 * are known. */
void ascc_relaxation_read(ascc_reader *reader, uint32_t object, ascc_plan_builder *builder);

#endif
