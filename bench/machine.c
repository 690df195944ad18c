/* Peaks, and the machine's name. SPDX-License-Identifier: MIT */
#include "machine.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/ascc.h>

#include "clock.h"
#include "kernels/kernels.h"
#include "peak.h"

size_t bench_isas(const bench_isa **isas)
{
    static bench_isa found[3];
    size_t count = 0;
    const uint32_t cpu = ascc_kernels_available();
    found[count++] = (bench_isa){"portable", 0, bench_multiply_add_portable, bench_triad_portable};
#ifdef BENCH_HAVE_NEON
    if (cpu & ASCC_CPU_NEON)
        found[count++] =
            (bench_isa){"neon", ASCC_CPU_NEON, bench_multiply_add_neon, bench_triad_neon};
#endif
#ifdef BENCH_HAVE_AVX2
    if (cpu & ASCC_CPU_AVX2)
        found[count++] =
            (bench_isa){"avx2", ASCC_CPU_AVX2, bench_multiply_add_avx2, bench_triad_avx2};
#endif
#ifdef BENCH_HAVE_AVX512
    if (cpu & ASCC_CPU_AVX512)
        found[count++] = (bench_isa){"avx512", ASCC_CPU_AVX2 | ASCC_CPU_AVX512,
                                     bench_multiply_add_avx512, bench_triad_avx512};
#endif
    *isas = found;
    return count;
}

double bench_peak(void)
{
    const bench_isa *isas;
    const bench_isa *best = NULL;
    const size_t count = bench_isas(&isas);
    best = &isas[count - 1];
    double rate = 0.0;
    for (int round = 0; round < 4; round++) {
        const double begin = bench_seconds();
        const double flops = best->multiply_add(200000);
        const double now = flops / (bench_seconds() - begin) * 1e-9;
        rate = now > rate ? now : rate;
    }
    return rate;
}

double bench_bandwidth(size_t bytes)
{
    const bench_isa *isas;
    const bench_isa *best = NULL;
    const size_t count = bench_isas(&isas), n = bytes / 3 / sizeof(float) / 16 * 16;
    best = &isas[count - 1];
    float *memory = aligned_alloc(64, 3 * n * sizeof *memory);
    if (!memory)
        bench_fail("no memory for %zu bytes", bytes);
    for (size_t i = 0; i < 3 * n; i++)
        memory[i] = 1.0f;
    const size_t calls = (size_t)5e7 / bytes + 1;
    double rate = 0.0;
    for (int round = 0; round < 7; round++) {
        const double begin = bench_seconds();
        for (size_t i = 0; i < calls; i++)
            best->triad(memory, memory + n, memory + 2 * n, n);
        const double now =
            (double)calls * 3.0 * (double)(n * sizeof(float)) / (bench_seconds() - begin) * 1e-9;
        rate = now > rate ? now : rate;
    }
    free(memory);
    return rate;
}

/* ---- Its name ---- */

/* The value of a key of /proc/cpuinfo, or "". */
static void cpu_info(const char *key, char *value, size_t capacity)
{
    char line[512];
    value[0] = '\0';
    FILE *file = fopen("/proc/cpuinfo", "r");
    while (file && !value[0] && fgets(line, sizeof line, file)) {
        const size_t length = strlen(key);
        char *colon = strchr(line, ':');
        if (strncmp(line, key, length) != 0 || !strchr("\t :", line[length]) || !colon)
            continue;
        line[strcspn(line, "\n")] = '\0';
        (void)snprintf(value, capacity, "%s", colon + 2);
    }
    if (file)
        fclose(file);
}

void bench_cpu_name(char *name, size_t capacity)
{
    char model[128], family[32], number[32];
    cpu_info("model name", model, sizeof model);
    cpu_info("cpu family", family, sizeof family);
    cpu_info("model", number, sizeof number);
    (void)snprintf(name, capacity, "%s family %s model %s", model[0] ? model : "unknown CPU",
                   family, number);
}
