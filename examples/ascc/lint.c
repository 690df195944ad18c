/* ascc lint: tells whether sequence files are fit to learn from. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "inspect.h"
#include "sequence.h"

static void usage(void)
{
    fprintf(
        stdout,
        "usage: ascc lint [--speed X] [--clump X] [--worst X] FILE...\n\n"
        "Rejects sequences with values that are not finite, spikes, escapes or clumps.\n"
        "  --speed X  times the speed that the fluid can reach (start and fall)   (default 5)\n"
        "  --clump X  mean share of particles with two neighbours nearer than half a spacing\n"
        "             (default 0.005)\n"
        "  --worst X  the same share in the worst frame (default 0.05)\n"
        "Columns: fastest speed, over what it can reach; particles that spike; that escape;\n"
        "mean and worst share nearer than 0.3 spacings to another; in clumps; mean density and\n"
        "mean of the densest 1 %% in the worst frame, fluid alone, 1 = rest.\n"
        "Exit status: 0 all pass, 1 some do not, 2 wrong usage or unreadable file.\n");
}

/* Above the first line of the table. */
static void print_heading(bool *printed)
{
    if (!*printed)
        ascc_line(stdout, "       speed /reach spike  out  near mean, worst  clump mean, worst  "
                          "density, top");
    *printed = true;
}

static bool lint_file(const char *path, const inspect_limits *limits, bool *heading,
                      bool *unreadable)
{
    ascc_sequence s;
    char error[256];
    if (!ascc_sequence_read(path, &s, error, sizeof error)) {
        ascc_line(stderr, "ascc lint: %s", error);
        *unreadable = true;
        return false;
    }
    inspect_input input = {.dimension = s.dimension,
                           .frames = s.frames,
                           .count = s.count,
                           .time_step = s.time_step,
                           .spacing = 2.0 * s.radius,
                           .position = s.position,
                           .velocity = s.velocity_frames ? s.velocity : NULL,
                           .walls = s.first_layer,
                           .wall = s.wall,
                           .normal = s.normal,
                           .wall_stride = s.walls_move ? s.walls * (size_t)s.dimension : 0};
    memcpy(input.gravity, s.gravity, sizeof input.gravity);
    inspection f;
    const ascc_status status = inspect(&input, limits, &f);
    ascc_sequence_free(&s);
    if (status != ASCC_OK) {
        ascc_line(stderr, "ascc lint: %s: %s", path,
                  status == ASCC_ERROR_RANGE ? "a position is too far out to have neighbours"
                                             : ascc_status_text(status));
        *unreadable = true;
        return false;
    }
    print_heading(heading);
    ascc_line(stdout, "%-6s %5.2f %5.2f %5zu %5zu  %.4f %.4f  %.4f %.4f  %.3f %.3f  %s%s%s",
              f.verdict ? "reject" : "pass", f.fastest, f.reach > 0.0 ? f.fastest / f.reach : 0.0,
              f.spikes, f.escapes, f.pair_mean, f.pair_worst, f.clump_mean, f.clump_worst,
              f.density_mean, f.density_worst, path, f.verdict ? ": " : "",
              f.verdict ? f.verdict : "");
    return f.verdict == NULL;
}

int ascc_command_lint(int argc, char **argv)
{
    inspect_limits limits = {0};
    int first = 0;
    for (; first < argc && argv[first][0] == '-'; first += 2) {
        double *value = strcmp(argv[first], "--speed") == 0   ? &limits.speed
                        : strcmp(argv[first], "--clump") == 0 ? &limits.clump
                        : strcmp(argv[first], "--worst") == 0 ? &limits.worst
                                                              : NULL;
        if (strcmp(argv[first], "--help") == 0) {
            usage();
            return 0;
        }
        char *end = NULL;
        if (value && first + 1 < argc)
            *value = strtod(argv[first + 1], &end);
        if (!end || *end || !(*value > 0.0)) {
            static const char *const options[] = {"--speed", "--clump", "--worst", NULL};
            return ascc_bad_option("lint", options, argv[first], argv[first + 1]), 2;
        }
    }
    if (first >= argc) {
        return ascc_bad_use("lint", "a FILE is wanted", NULL, NULL), 2;
    }
    bool good = true, heading = false, unreadable = false;
    for (int i = first; i < argc; i++)
        good &= lint_file(argv[i], &limits, &heading, &unreadable);
    return unreadable ? 2 : good ? 0 : 1;
}
