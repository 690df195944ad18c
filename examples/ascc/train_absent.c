/* `ascc train` of a build without libascc-train. SPDX-License-Identifier: MIT */
#include <stdio.h>

#include "commands.h"

int ascc_command_train(int argc, char **argv)
{
    (void)argc;
    (void)argv;
    fprintf(stderr, "ascc train: this program was built without libascc-train\n");
    return 1;
}
