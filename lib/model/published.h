/* The published pretrained networks, converted to safetensors but otherwise as they are.
 * SPDX-License-Identifier: MIT
 *
 * Their metadata (format "ascc.weights") describe the architecture partly in numbers and partly in
 * sentences. Every number is read from them, and a sentence that is not understood is refused.
 */
#ifndef ASCC_PUBLISHED_H
#define ASCC_PUBLISHED_H

#include "plan.h"

/* Reads the metadata into an opened builder. errors: FORMAT with the key at fault, MEMORY. */
ascc_status ascc_published_read(ascc_plan_builder *builder, ascc_safetensors *file);

#endif
