/* The commands of the benchmarks, and what they share. SPDX-License-Identifier: MIT */
#ifndef BENCH_H
#define BENCH_H

#include <ascc/ascc.h>

#include "clock.h"
#include "field.h"
#include "machine.h"
#include "measure.h"
#include "options.h"
#include "pairs.h"
#include "report.h"

void bench_kernel(const bench_options *options);
void bench_roofline(const bench_options *options);
void bench_step(const bench_options *options);
void bench_threads(const bench_options *options);
void bench_scale(const bench_options *options);
void bench_load(const bench_options *options);
void bench_train(const bench_options *options);
void bench_bodies(const bench_options *options);
void bench_pool(const bench_options *options);

#endif
