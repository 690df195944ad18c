/* What the machine is, and the most that it can do now. SPDX-License-Identifier: MIT */
#ifndef BENCH_MACHINE_H
#define BENCH_MACHINE_H

#include <stddef.h>
#include <stdint.h>

/* Instruction sets that this CPU can run and this build has, weakest first. */
typedef struct bench_isa {
    const char *name;
    uint32_t cpu;                          /* ASCC_CPU_* bits of a context */
    double (*multiply_add)(size_t rounds); /* returns the flops done */
    void (*triad)(float *a, const float *b, const float *c, size_t n); /* a = b + 3 c */
} bench_isa;

size_t bench_isas(const bench_isa **isas);
/* The best multiply-adds per second that the machine does now, GFLOP/s, over some milliseconds. */
double bench_peak(void);
/* Triad bandwidth with three arrays of this many bytes in all, GB/s. */
double bench_bandwidth(size_t bytes);

/* The CPU's name, family and model. */
void bench_cpu_name(char *name, size_t capacity);

#endif
