/* Named figures of several runs: as a table, as JSON, as CSV.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdarg.h>
#include <string.h>

#include "report.h"
#include "console.h"
#include "new_file.h"

void ascc_report_add(ascc_report_run *run, double value, const char *name, ...)
{
    va_list arguments;
    if (run->count == ASCC_REPORT_FIGURES)
        return;
    ascc_figure *figure = &run->figure[run->count++];
    va_start(arguments, name);
    vsnprintf(figure->name, sizeof figure->name, name, arguments);
    va_end(arguments);
    figure->value = value;
}

static const ascc_figure *find(const ascc_report_run *run, const char *name)
{
    for (size_t i = 0; i < run->count; i++)
        if (strcmp(run->figure[i].name, name) == 0)
            return &run->figure[i];
    return NULL;
}

static void table_cell(FILE *file, const ascc_figure *figure)
{
    if (!figure)
        fprintf(file, " %14s", "");
    else if (!isfinite(figure->value))
        fprintf(file, " %14s", "-");
    else if (figure->value == floor(figure->value) && fabs(figure->value) < 1e6)
        fprintf(file, " %14.0f", figure->value);
    else
        fprintf(file, " %14.5g", figure->value);
}

/* Has an earlier run a figure of this name? Then its row is printed already. */
static bool printed(const ascc_report_run *runs, size_t count, const char *name)
{
    for (size_t i = 0; i < count; i++)
        if (find(&runs[i], name))
            return true;
    return false;
}

static void table_block(FILE *file, const ascc_report_run *runs, size_t count)
{
    fprintf(file, "%-26s", "");
    for (size_t r = 0; r < count; r++) {
        const size_t length = strlen(runs[r].sequence);
        char name[15];
        (void)snprintf(name, sizeof name, "%.14s",
                       runs[r].sequence + (length > 14 ? length - 14 : 0));
        ascc_printable(name);
        fprintf(file, " %14s", name);
    }
    fputc('\n', file);
    for (size_t first = 0; first < count; first++)
        for (size_t i = 0; i < runs[first].count; i++) {
            const char *name = runs[first].figure[i].name;
            if (printed(runs, first, name))
                continue;
            fprintf(file, "%-26s", name);
            for (size_t r = 0; r < count; r++)
                table_cell(file, find(&runs[r], name));
            fputc('\n', file);
        }
    for (size_t r = 0; r < count; r++)
        if (runs[r].note[0])
            ascc_line(file, "%s: %s", runs[r].sequence, runs[r].note);
}

void ascc_report_table(FILE *file, const char *method, const ascc_report_run *runs, size_t count,
                       size_t columns)
{
    ascc_line(file, "%s", method);
    for (size_t first = 0; first < count; first += columns)
        table_block(file, runs + first, count - first < columns ? count - first : columns);
}

static void json_text(FILE *file, const char *text)
{
    fputc('"', file);
    for (; *text; text++) {
        const unsigned char c = (unsigned char)*text;
        if (c == '"' || c == '\\')
            fprintf(file, "\\%c", c);
        else if (c < 0x20)
            fprintf(file, "\\u%04x", c);
        else
            fputc(c, file);
    }
    fputc('"', file);
}

static void json_run(FILE *file, const ascc_report_run *run)
{
    fputs("\n  {\"sequence\": ", file);
    json_text(file, run->sequence);
    fputs(", \"note\": ", file);
    json_text(file, run->note);
    for (size_t i = 0; i < run->count; i++) {
        fputs(",\n   ", file);
        json_text(file, run->figure[i].name);
        if (isfinite(run->figure[i].value))
            fprintf(file, ": %.17g", run->figure[i].value);
        else
            fputs(": null", file);
    }
    fputc('}', file);
}

bool ascc_report_json(const char *path, const char *method, const ascc_report_run *runs,
                      size_t count, char *error, size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    FILE *file = output.stream;
    fputs("{\"method\": ", file);
    json_text(file, method);
    fputs(", \"runs\": [", file);
    for (size_t r = 0; r < count; r++) {
        json_run(file, &runs[r]);
        fputs(r + 1 < count ? "," : "", file);
    }
    fputs("\n]}\n", file);
    return ascc_new_file_close(&output, true, error, capacity);
}

static void csv_text(FILE *file, const char *text)
{
    fputc('"', file);
    for (; *text; text++) {
        if (*text == '"')
            fputc('"', file);
        fputc(*text, file);
    }
    fputc('"', file);
}

bool ascc_report_csv(const char *path, const char *method, const ascc_report_run *runs,
                     size_t count, char *error, size_t capacity)
{
    ascc_new_file output;
    if (!ascc_new_file_open(&output, path, error, capacity))
        return false;
    FILE *file = output.stream;
    fputs("method,sequence,figure,value\n", file);
    for (size_t r = 0; r < count; r++)
        for (size_t i = 0; i < runs[r].count; i++) {
            csv_text(file, method);
            fputc(',', file);
            csv_text(file, runs[r].sequence);
            fprintf(file, ",%s,", runs[r].figure[i].name);
            if (isfinite(runs[r].figure[i].value))
                fprintf(file, "%.17g", runs[r].figure[i].value);
            fputc('\n', file);
        }
    return ascc_new_file_close(&output, true, error, capacity);
}
