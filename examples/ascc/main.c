/* The ascc program: picks the subcommand. SPDX-License-Identifier: MIT */
#include <stdio.h>
#include <string.h>

#include <ascc/ascc.h>

#include "commands.h"
#include "console.h"

static const struct {
    const char *name, *text;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"sim", "run a model on a scene", ascc_command_sim},
    {"info", "describe a model or sequence file", ascc_command_info},
    {"show", "draw a sequence's frames", ascc_command_show},
    {"generate", "make sequences with the reference solver", ascc_command_generate},
    {"lint", "check sequences for spikes, escapes and clumps", ascc_command_lint},
    {"eval", "measure a method on true sequences", ascc_command_eval},
    {"relax", "give a model file a relaxation", ascc_command_relax},
    {"train", "train a network over rollouts", ascc_command_train},
    {"convert", "make a model file of a published network", ascc_command_convert},
};

static void usage(FILE *out)
{
    fprintf(out, "usage: ascc COMMAND ...\n\n");
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        fprintf(out, "  %-10s %s\n", commands[i].name, commands[i].text);
    fprintf(out, "  %-10s print the version\n\nascc COMMAND --help tells more.\n", "version");
}

static int run(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++)
        if (strcmp(name, commands[i].name) == 0)
            return commands[i].run(argc - 2, argv + 2);
    if (strcmp(name, "version") == 0 || strcmp(name, "--version") == 0) {
        const int32_t v = ascc_version();
        ascc_line(stdout, "ascc %d.%d.%d", v / 10000, v / 100 % 100, v % 100);
        return 0;
    }
    const int help = strcmp(name, "help") == 0 || strcmp(name, "--help") == 0;
    if (!help && argc > 1)
        ascc_line(stderr, "ascc: '%s' is no command", name);
    usage(help ? stdout : stderr);
    return help ? 0 : 2;
}

int main(int argc, char **argv)
{
    ascc_console_open();
    return ascc_console_close(run(argc, argv));
}
