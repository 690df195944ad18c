/* A switch of the model's fuzz target. SPDX-License-Identifier: MIT */
#ifndef ASCC_FUZZ_MODEL_H
#define ASCC_FUZZ_MODEL_H

/* 0: models are loaded and checked, but not run. */
extern int fuzz_model_runs;

#endif
