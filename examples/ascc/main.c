/* The ascc program: picks the subcommand. SPDX-License-Identifier: MIT */
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/ascc.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "system.h"

static const struct {
    const char *name, *text;
    int (*run)(int argc, char **argv);
} commands[] = {
    {"sim", "run a model on a scene", ascc_command_sim},
    {"info", "describe a model or sequence file", ascc_command_info},
    {"show", "draw a sequence's frames", ascc_command_show},
    {"view", "a window on a running model or a sequence", ascc_command_view},
    {"generate", "make sequences with the reference solver", ascc_command_generate},
    {"lint", "check sequences for spikes, escapes and clumps", ascc_command_lint},
    {"eval", "measure a method on true sequences", ascc_command_eval},
    {"relax", "give a model file a relaxation", ascc_command_relax},
    {"trust", "give a model file statistics of its training", ascc_command_trust},
    {"train", "train a network over rollouts", ascc_command_train},
    {"convert", "a published network as a model file, a sequence as PLY or VTK",
     ascc_command_convert},
};

enum { COMMANDS = sizeof commands / sizeof *commands };

static void usage(FILE *out)
{
    fprintf(out, "usage: ascc COMMAND ...\n\n");
    for (size_t i = 0; i < COMMANDS; i++)
        fprintf(out, "  %-10s %s\n", commands[i].name, commands[i].text);
    fprintf(out, "  %-10s print the version\n\nascc COMMAND --help tells more.\n", "version");
}

static bool is_help(const char *word)
{
    return strcmp(word, "--help") == 0 || strcmp(word, "-h") == 0;
}

/* Wherever it stands: who asks for help wants nothing else. */
static bool wants_help(int argc, char **argv)
{
    for (int i = 0; i < argc; i++)
        if (is_help(argv[i]))
            return true;
    return false;
}

static int unknown(const char *name)
{
    const char *names[COMMANDS + 3] = {"help", "version"};
    char what[96];
    for (size_t i = 0; i < COMMANDS; i++)
        names[i + 2] = commands[i].name;
    (void)snprintf(what, sizeof what, "'%.64s' is no %s", name,
                   name[0] == '-' ? "option" : "command");
    const char *meant = ascc_nearest(name, names);
    if (meant)
        ascc_line(stderr, "ascc: %s; did you mean '%s'?", what, meant);
    else
        ascc_line(stderr, "ascc: %s; ascc --help tells more", what);
    return 2;
}

/* Whether an mpirun of Open MPI or MPICH started more of us, who would write over one another's files. */
static bool is_one_of_many(void)
{
    static const char *const counts[] = {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"};
    for (size_t i = 0; i < sizeof counts / sizeof *counts; i++) {
        const char *count = getenv(counts[i]);
        if (count && atoi(count) > 1)
            return true;
    }
    return false;
}

static int sim_of_many(char **argv)
{
    ascc_system_become(argv[0], "ascc-mpi", argv);
    ascc_line(
        stderr,
        "ascc sim: started by mpirun, but ascc-mpi, which runs on several processes, is not there: "
        "it is built where an MPI is");
    return 1;
}

static int run(int argc, char **argv)
{
    const char *name = argc > 1 ? argv[1] : "";
    if (strcmp(name, "sim") == 0 && is_one_of_many())
        return sim_of_many(argv);
    const bool help = strcmp(name, "help") == 0 || is_help(name);
    static char help_word[] = "--help";
    char *help_words[] = {help_word, NULL};
    const char *command = help && argc > 2 && !is_help(argv[2]) ? argv[2] : name;
    for (size_t i = 0; i < COMMANDS; i++)
        if (strcmp(command, commands[i].name) == 0)
            return help || wants_help(argc - 2, argv + 2) ? commands[i].run(1, help_words)
                                                          : commands[i].run(argc - 2, argv + 2);
    if (command != name)
        return unknown(command);
    if (strcmp(name, "version") == 0 || strcmp(name, "--version") == 0 || strcmp(name, "-V") == 0) {
        const int32_t v = ascc_version();
        ascc_line(stdout, "ascc %d.%d.%d", v / 10000, v / 100 % 100, v % 100);
        return 0;
    }
    if (!help && argc > 1)
        return unknown(name);
    usage(help ? stdout : stderr);
    return help ? 0 : 2;
}

int main(int argc, char **argv)
{
    ascc_system_start(&argc, &argv);
    return ascc_console_close(run(argc, argv));
}
