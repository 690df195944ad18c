/* The subcommands of the ascc program. SPDX-License-Identifier: MIT
 *
 * Each gets the arguments behind its name and returns the exit status: 0 done, 1 failed, 2 bad use. */
#ifndef ASCC_COMMANDS_H
#define ASCC_COMMANDS_H

int ascc_command_sim(int argc, char **argv);
int ascc_command_info(int argc, char **argv);
int ascc_command_show(int argc, char **argv);
int ascc_command_view(int argc, char **argv);
int ascc_command_generate(int argc, char **argv);
int ascc_command_lint(int argc, char **argv);
int ascc_command_eval(int argc, char **argv);
int ascc_command_relax(int argc, char **argv);
int ascc_command_trust(int argc, char **argv);
int ascc_command_train(int argc, char **argv);
int ascc_command_convert(int argc, char **argv);

#endif
