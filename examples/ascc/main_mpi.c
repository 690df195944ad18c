/* The ascc-mpi program: `ascc sim` on the processes of an mpirun. SPDX-License-Identifier: MIT */
#include <mpi.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "console.h"
#include "system.h"

static bool wants_help(int argc, char **argv)
{
    for (int i = 1; i < argc; i++)
        if (strcmp(argv[i], "--help") == 0 || strcmp(argv[i], "-h") == 0)
            return true;
    return false;
}

static int run(int argc, char **argv, bool lead)
{
    const bool help = wants_help(argc, argv);
    if (argc > 1 && strcmp(argv[1], "sim") == 0 && !help)
        return ascc_command_sim(argc - 2, argv + 2);
    if (lead)
        fprintf(help ? stdout : stderr,
                "usage: mpirun -n N ascc-mpi sim ...\n\n"
                "What `ascc sim` does, on N processes: the same arguments, the same files. ascc "
                "sim --help\n"
                "tells more. Neither --ladder nor --sleep runs on more than one.\n");
    return help ? 0 : 2;
}

int main(int argc, char **argv)
{
    int provided, rank;
    ascc_system_start(&argc, &argv);
    if (MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &provided) != MPI_SUCCESS)
        return 1;
    (void)MPI_Comm_rank(MPI_COMM_WORLD, &rank);
    if (rank != 0)
        ascc_console_mute();
    const int status = ascc_console_close(run(argc, argv, rank == 0));
    (void)MPI_Finalize();
    return status;
}
