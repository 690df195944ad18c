/* The table of operations, from operations.list. SPDX-License-Identifier: MIT */
#include "operations.h"

#define OPERATION(name) &ascc_op_##name,
const ascc_operation *const ascc_operations[] = {
#include "operations.list"
    NULL};
