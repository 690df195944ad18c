/* The methods that `ascc eval` and the charts know. SPDX-License-Identifier: MIT */
#include "method.h"

const ascc_method *const ascc_methods[] = {
    &ascc_method_ballistic,
    &ascc_method_sph,
    &ascc_method_dfsph,
    &ascc_method_pbf,
    &ascc_method_model, /* takes every word: last */
    NULL,
};
