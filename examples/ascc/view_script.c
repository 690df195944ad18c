/* What is done in a window, read from a file: to show the same again, and for tests.
 * SPDX-License-Identifier: MIT */
#include "view_script.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "system.h"

enum { LINES = 10000 };

/* What stands behind the frame. */
static bool read_deed(ascc_script_line *line, const char *text)
{
    static const struct {
        const char *word;
        ascc_input_kind kind;
    } mouse[] = {
        {"press", ASCC_INPUT_PRESS}, {"move", ASCC_INPUT_MOVE}, {"release", ASCC_INPUT_RELEASE}};
    ascc_input *input = &line->input;
    char word[16], rest[3] = "";
    if (strncmp(text, "picture ", 8) == 0 && text[8]) {
        const size_t length = strlen(text + 8) + 1;
        line->picture = malloc(length);
        return line->picture && memcpy(line->picture, text + 8, length);
    }
    if (sscanf(text, "%15s", word) != 1)
        return false;
    for (size_t i = 0; i < sizeof mouse / sizeof *mouse; i++)
        if (strcmp(word, mouse[i].word) == 0) {
            input->kind = mouse[i].kind;
            return sscanf(text, "%*s %lf %lf %2s", &input->x, &input->y, rest) == 2 &&
                   input->x >= -1e4 && input->x <= 1e4 && input->y >= -1e4 && input->y <= 1e4;
        }
    if (strcmp(word, "wheel") == 0) {
        input->kind = ASCC_INPUT_WHEEL;
        return sscanf(text, "%*s %lf %2s", &input->turn, rest) == 1 && input->turn >= -100.0 &&
               input->turn <= 100.0;
    }
    if (strcmp(word, "key") == 0 && sscanf(text, "%*s %2s", rest) == 1) {
        input->kind = ASCC_INPUT_KEY;
        input->key = strcmp(text, "key space") == 0 ? ' ' : rest[0];
        return input->key == ' ' || rest[1] == '\0';
    }
    input->kind = ASCC_INPUT_QUIT;
    return strcmp(text, "quit") == 0;
}

static bool add(ascc_script *script, const char *text)
{
    const size_t n = script->count;
    if (!script->line)
        script->line = calloc(LINES, sizeof *script->line);
    if (!script->line || n == LINES)
        return false;
    ascc_script_line *line = &script->line[script->count++];
    char *end;
    line->frame = strtol(text, &end, 10);
    return end != text && *end == ' ' && line->frame >= 0 &&
           (n == 0 || script->line[n - 1].frame <= line->frame) && read_deed(line, end + 1);
}

bool ascc_script_read(ascc_script *script, const char *path, char *error, size_t capacity)
{
    char text[1024];
    FILE *file = ascc_system_open(path, "r");
    *script = (ascc_script){NULL, 0, 0};
    if (!file) {
        (void)snprintf(error, capacity, "%s: %s", path, strerror(errno));
        return false;
    }
    bool good = true;
    for (int number = 1; good && fgets(text, sizeof text, file); number++) {
        text[strcspn(text, "\r\n")] = '\0';
        good = text[0] == '\0' || text[0] == '#' || add(script, text);
        if (!good)
            (void)snprintf(error, capacity, "%s: line %d: '%.60s' is nothing to do", path, number,
                           text);
    }
    (void)fclose(file);
    return good;
}

void ascc_script_free(ascc_script *script)
{
    for (size_t i = 0; i < script->count; i++)
        free(script->line[i].picture);
    free(script->line);
    *script = (ascc_script){NULL, 0, 0};
}

const ascc_script_line *ascc_script_due(ascc_script *script, long frame)
{
    if (script->next == script->count || script->line[script->next].frame > frame)
        return NULL;
    return &script->line[script->next++];
}
