/* Runs the subcommands of `ascc` on texts: each ends with a status from 0 to 2. SPDX-License-Identifier: MIT
 *
 * One argument a line; the first names the command. A folder of its own holds a small sequence "s" and the
 * demonstration model "m". Inputs that would leave the folder or run for long are left out.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "../../examples/demo_model.h"
#include "commands.h"
#include "fuzz.h"
#include "sequence.h"

enum { ARGUMENTS = 16, LONGEST = 2000 };

static const struct {
    const char *name;
    int (*run)(int argc, char **argv);
} commands[] = {{"sim", ascc_command_sim},     {"info", ascc_command_info},
                {"show", ascc_command_show},   {"generate", ascc_command_generate},
                {"lint", ascc_command_lint},   {"eval", ascc_command_eval},
                {"train", ascc_command_train}, {"convert", ascc_command_convert}};

/* No other folder; numbers of one digit, or so many that they are refused anyway. */
static int is_harmless(const char *text)
{
    int digits = 0;
    if (strchr(text, '/') || strstr(text, ".."))
        return 0;
    for (const char *c = text;; c++) {
        if (*c >= '0' && *c <= '9') {
            digits++;
            continue;
        }
        if (digits > 1 && digits < 20)
            return 0;
        digits = 0;
        if (!*c)
            return 1;
    }
}

static void write_files(void)
{
    const float x[2][3][2] = {{{0.0f, 0.0f}, {0.05f, 0.0f}, {0.0f, 0.05f}},
                              {{0.0f, 0.0f}, {0.05f, 0.0f}, {0.0f, 0.05f}}};
    const float v[3][2] = {{0.0f, 0.0f}};
    float wall[1][2] = {{0.0f, -0.05f}}, normal[1][2] = {{0.0f, 1.0f}};
    const ascc_sequence header = {.dimension = 2,
                                  .time_step = 0.01,
                                  .gravity = {0.0, -9.81},
                                  .radius = 0.025,
                                  .mass = 2.5,
                                  .rest_density = 1000.0,
                                  .count = 3,
                                  .walls = 1,
                                  .first_layer = 1,
                                  .wall = wall[0],
                                  .normal = normal[0]};
    char error[512];
    size_t size;
    ascc_sequence_writer *w = ascc_sequence_create("s", &header, false, error, sizeof error);
    fuzz_require(w && ascc_sequence_append(w, x[0][0], v[0], error, sizeof error) &&
                 ascc_sequence_append(w, x[1][0], NULL, error, sizeof error) &&
                 ascc_sequence_finish(w, true, error, sizeof error));
    unsigned char *bytes = demo_model_bytes(2, 0.05, &size);
    (void)fuzz_file("m", bytes, size);
    free(bytes);
}

/* What the commands print goes nowhere; the sanitizers write past stdio. */
static void be_silent(void)
{
    static int silent;
    if (silent)
        return;
    silent = 1;
    stdout = fopen("/dev/null", "w");
    stderr = fopen("/dev/null", "w");
    fuzz_require(stdout && stderr);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    char text[LONGEST + 1], *argument[ARGUMENTS + 1];
    int count = 0;
    if (size == 0 || size > LONGEST || memchr(data, '\0', size))
        return 0;
    memcpy(text, data, size);
    text[size] = '\0';
    if (!is_harmless(text))
        return 0;
    for (char *next = text; next && count < ARGUMENTS;) {
        argument[count++] = next;
        next = strchr(next, '\n');
        if (next)
            *next++ = '\0';
    }
    argument[count] = NULL;
    for (size_t i = 0; i < sizeof commands / sizeof *commands; i++) {
        int folder = 0; /* generating takes seconds: without an -o it is refused behind all else */
        for (int k = 1; k < count; k++)
            folder |= strcmp(argument[k], "-o") == 0;
        if (strcmp(argument[0], commands[i].name) != 0 ||
            (folder && strcmp(argument[0], "generate") == 0))
            continue;
        be_silent();
        fuzz_require(chdir(fuzz_folder()) == 0);
        write_files();
        const int status = commands[i].run(count - 1, argument + 1);
        fuzz_require(status >= 0 && status <= 2);
        fuzz_clear_folder();
    }
    return 0;
}
