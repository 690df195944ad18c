/* Every operation by name, for those that look at one alone: tests and benchmarks.
 * SPDX-License-Identifier: MIT */
#ifndef ASCC_OPERATIONS_H
#define ASCC_OPERATIONS_H

#include "model/operation.h"

#define OPERATION(name) extern const ascc_operation ascc_op_##name;
#include "operations.list"
#undef OPERATION

#endif
