/* `ascc relax`: gives a model file a relaxation, or makes one that is nothing else.
 * SPDX-License-Identifier: MIT
 *
 * Only the description in the file changes: weights stay as they are, byte for byte.
 */
#include <errno.h>
#include <jansson.h>
#include <math.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <ascc/ascc.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "host.h"
#include "tensor_file.h"

#define SWEEPS 32
#define TEXT (JSON_COMPACT | JSON_PRESERVE_ORDER | JSON_REAL_PRECISION(9))

typedef struct relax {
    const char *model, *output, *name;
    int32_t dimension; /* of a new one */
    double spacing, time_step;
    bool none, current;
    double rounds, again, left, below;
    double omega[SWEEPS], divergence[SWEEPS], viscosity[SWEEPS];
    int omega_count, divergence_count, viscosity_count;
    /* Lengths in spacings, volume in spacings^dimension. */
    double support, volume, epsilon, limit, repulsion, stiffness, contact;
} relax;

static const char help[] =
    "usage: ascc relax MODEL -o FILE [options]\n"
    "       ascc relax --new DIMENSION --spacing M --dt S -o FILE [options]\n"
    "  Writes MODEL with a relaxation after its network (docs/file-format.md), in place of one "
    "that it\n"
    "  has, whose guess it keeps; or a model that is a relaxation alone.\n"
    "\n"
    "options, lengths in particle spacings\n"
    "  --omega A,B,...       weights of the pressure sweeps (0.5,0.5,0.5,0.5)\n"
    "  --divergence A,B,...  of the divergence sweeps, or none (0.5,0.5,0.5,0.5)\n"
    "  --hyperviscosity A,.. shares of the sweeps that even out rough velocities, or none (none)\n"
    "  --below V             m/s: what is rougher stays as it is (0.1)\n"
    "  --rounds N            of pressure sweeps at most, each at the places that the one before "
    "left (1)\n"
    "  --again E             another round follows one that began with an excess of density above "
    "this (0.2)\n"
    "  --left E              and would find more than this (anything)\n"
    "  --support H           of the cubic spline (2)\n"
    "  --volume V            of a particle at rest, spacings^dimension (0.8)\n"
    "  --epsilon E           softening (0.1)\n"
    "  --limit L             the most that one pair corrects (0.15)\n"
    "  --repulsion R         pairs nearer than this part (0.25; 0 = none)\n"
    "  --stiffness S         by this share of what they lack (0.5)\n"
    "  --contact C           with --new: how near the fluid comes to walls (0.4)\n"
    "  --current             corrections lie along lines before the step: angular momentum is "
    "conserved\n"
    "  --name NAME           of the model\n"
    "  --none                takes a relaxation away\n";

/* ---- Arguments ---- */

static bool read_number(const char *text, double *number)
{
    char *end;
    errno = 0;
    *number = strtod(text, &end);
    return end != text && *end == '\0' && errno == 0 && isfinite(*number);
}

static bool read_list(const char *text, double numbers[SWEEPS], int *count)
{
    *count = 0;
    if (strcmp(text, "none") == 0)
        return true;
    for (const char *at = text; *count < SWEEPS; at++) {
        char *end;
        numbers[*count] = strtod(at, &end);
        if (end == at || !isfinite(numbers[*count]))
            return false;
        (*count)++;
        if (*end == '\0')
            return true;
        if (*end != ',')
            return false;
        at = end;
    }
    return false;
}

static bool read_option(relax *r, const char *name, const char *value)
{
    const struct {
        const char *name;
        double *number;
    } numbers[] = {
        {"--spacing", &r->spacing},     {"--dt", &r->time_step},        {"--support", &r->support},
        {"--volume", &r->volume},       {"--epsilon", &r->epsilon},     {"--limit", &r->limit},
        {"--repulsion", &r->repulsion}, {"--stiffness", &r->stiffness}, {"--contact", &r->contact},
        {"--rounds", &r->rounds},       {"--again", &r->again},         {"--left", &r->left},
        {"--below", &r->below},
    };
    double number;
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers; i++)
        if (strcmp(name, numbers[i].name) == 0)
            return read_number(value, numbers[i].number);
    if (strcmp(name, "--omega") == 0)
        return read_list(value, r->omega, &r->omega_count) && r->omega_count > 0;
    if (strcmp(name, "--divergence") == 0)
        return read_list(value, r->divergence, &r->divergence_count);
    if (strcmp(name, "--hyperviscosity") == 0)
        return read_list(value, r->viscosity, &r->viscosity_count);
    if (strcmp(name, "--new") == 0) {
        const bool good = read_number(value, &number) && (number == 2.0 || number == 3.0);
        r->dimension = good ? (int32_t)number : 0;
        return good;
    }
    if (strcmp(name, "--name") == 0)
        r->name = value;
    else if (strcmp(name, "-o") == 0)
        r->output = value;
    else
        return false;
    return true;
}

static bool read_arguments(relax *r, int argc, char **argv)
{
    static const char *const options[] = {
        "--spacing",   "--dt",        "--support", "--volume", "--epsilon",    "--limit",
        "--repulsion", "--stiffness", "--contact", "--omega",  "--divergence", "--hyperviscosity",
        "--new",       "--name",      "-o",        "--none",   "--current",    "--below",
        "--rounds",    "--again",     "--left",    NULL};
    for (int i = 0; i < argc; i++) {
        if (strcmp(argv[i], "--none") == 0) {
            r->none = true;
        } else if (strcmp(argv[i], "--current") == 0) {
            r->current = true;
        } else if (argv[i][0] != '-' && !r->model) {
            r->model = argv[i];
        } else if (i + 1 == argc || !read_option(r, argv[i], argv[i + 1])) {
            return ascc_bad_option("relax", options, argv[i], argv[i + 1]);
        } else {
            i++;
        }
    }
    const bool new = r->dimension && !r->model && r->spacing > 0.0 && r->time_step > 0.0;
    const bool whole = r->output && (new || (r->model && !r->dimension));
    return whole ||
           ascc_bad_use("relax", "a model, or --new with --spacing and --dt, and -o are wanted",
                        NULL, NULL);
}

/* ---- Descriptions ---- */

static json_t *list_of(const double *numbers, int count)
{
    json_t *list = json_array();
    for (int i = 0; i < count; i++)
        json_array_append_new(list, json_real(numbers[i]));
    return list;
}

static json_t *relaxation_of(const relax *r, int32_t dimension, double spacing)
{
    json_t *o = json_object();
    const double cell = dimension == 2 ? spacing * spacing : spacing * spacing * spacing;
    json_object_set_new(o, "support", json_real(r->support * spacing));
    json_object_set_new(o, "rest_volume", json_real(r->volume * cell));
    json_object_set_new(o, "omega", list_of(r->omega, r->omega_count));
    json_object_set_new(o, "epsilon", json_real(r->epsilon));
    json_object_set_new(o, "limit", json_real(r->limit * spacing));
    if (r->divergence_count)
        json_object_set_new(o, "divergence", list_of(r->divergence, r->divergence_count));
    if (r->viscosity_count)
        json_object_set_new(o, "hyperviscosity",
                            json_pack("{s:o,s:f}", "shares",
                                      list_of(r->viscosity, r->viscosity_count), "below",
                                      r->below));
    if (r->rounds != 1.0)
        json_object_set_new(
            o, "rounds", json_pack("{s:I,s:f}", "most", (json_int_t)r->rounds, "above", r->again));
    if (r->rounds != 1.0 && r->left >= 0.0)
        json_object_set_new(json_object_get(o, "rounds"), "left", json_real(r->left));
    if (r->repulsion > 0.0)
        json_object_set_new(
            o, "repulsion",
            json_pack("{s:f,s:f}", "distance", r->repulsion * spacing, "stiffness", r->stiffness));
    if (r->current)
        json_object_set_new(o, "direction", json_string("current"));
    if (r->dimension && r->contact > 0.0)
        json_object_set_new(o, "contact", json_real(r->contact * spacing));
    return o;
}

static json_t *new_network(const relax *r)
{
    json_t *gravity =
        r->dimension == 2 ? json_pack("[i,f]", 0, -9.81) : json_pack("[i,f,i]", 0, -9.81, 0);
    return json_pack("{s:s,s:s,s:i,s:f,s:o,s:f,s:i,s:s,s:{s:[s],s:[]},s:[]}", "name",
                     r->name             ? r->name
                     : r->dimension == 2 ? "pbf2d"
                                         : "pbf3d",
                     "description", "position based fluids: a relaxation and no network",
                     "dimension", (int)r->dimension, "time_step", r->time_step, "gravity", gravity,
                     "particle_spacing", r->spacing, "rest_density", 1000, "evaluate", "advected",
                     "features", "fluid", "one", "boundary", "layers");
}

/* The description with what was asked for; NULL with a line on stderr. */
static char *describe(const relax *r, const char *text)
{
    json_t *network = text ? json_loads(text, JSON_REJECT_DUPLICATES, NULL) : new_network(r);
    const double spacing = json_number_value(json_object_get(network, "particle_spacing"));
    const json_int_t dimension = json_integer_value(json_object_get(network, "dimension"));
    json_t *guess = json_incref(json_object_get(json_object_get(network, "relaxation"), "guess"));
    json_object_del(network, "relaxation");
    if (!r->none) {
        json_t *made = relaxation_of(r, (int32_t)dimension, spacing);
        if (guess)
            json_object_set(made, "guess", guess);
        json_object_set_new(network, "relaxation", made);
    }
    json_decref(guess);
    if (r->name)
        json_object_set_new(network, "name", json_string(r->name));
    char *written = network ? json_dumps(network, TEXT) : NULL;
    json_decref(network);
    return written;
}

/* ---- Files ---- */

static int failed(const char *path, const char *why)
{
    ascc_line(stderr, "ascc relax: %s: %s", path, why);
    return 1;
}

/* The header of a new model file. */
static json_t *new_header(void)
{
    return json_pack("{s:{s:s,s:s}}", "__metadata__", "format", "ascc.model", "version", "1");
}

/* The bytes of the model file of that name or path, from malloc; NULL with *why. */
static unsigned char *read_model(const char *name, size_t *size, ascc_host_error *why)
{
    char path[ASCC_HOST_PATH];
    ascc_context *context = NULL;
    ascc_status status = ascc_context_create(NULL, &context);
    if (status == ASCC_OK)
        status = ascc_host_find(context, name, path, why);
    ascc_context_destroy(&context);
    return status == ASCC_OK ? ascc_tensor_file_read(path, size, why->text, sizeof why->text)
                             : NULL;
}

/* The bytes of the model that was asked for, from malloc; NULL after failed. */
static unsigned char *change(const relax *r, size_t *size)
{
    ascc_host_error why = {"no model file"};
    size_t old_size = 0, data = 0;
    unsigned char *made = NULL, *old = NULL;
    json_t *header = NULL;
    if (r->model)
        old = read_model(r->model, &old_size, &why);
    if (old)
        header = ascc_tensor_file_header(old, old_size, &data, why.text, sizeof why.text);
    else if (!r->model)
        header = new_header();
    const char *before = header ? ascc_tensor_file_metadata(header, "network") : NULL;
    char *text = header && (before || !r->model) ? describe(r, before) : NULL;
    if (text) {
        json_object_set_new(json_object_get(header, "__metadata__"), "network", json_string(text));
        made = ascc_tensor_file_build(header, old ? old + data : NULL, old_size - data, size);
    } else if (header) {
        (void)snprintf(why.text, sizeof why.text, "no model file");
    }
    if (!made)
        (void)failed(r->model ? r->model : "--new", why.text);
    free(text);
    json_decref(header);
    free(old);
    return made;
}

/* Loads the model, which checks all of it, and writes it. */
static int write_model(const relax *r, const unsigned char *bytes, size_t size)
{
    char why[256];
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    if (ascc_context_create(NULL, &context) != ASCC_OK)
        return failed(r->output, "no memory");
    const bool good = ascc_model_load_memory(context, bytes, size, &model) == ASCC_OK &&
                      ascc_model_save(model, r->output) == ASCC_OK;
    (void)ascc_context_message(context, why, sizeof why);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return good ? 0 : failed(r->output, why);
}

int ascc_command_relax(int argc, char **argv)
{
    if (argc == 1 && strcmp(argv[0], "--help") == 0) {
        fputs(help, stdout);
        return 0;
    }
    relax r = {.omega = {0.5, 0.5, 0.5, 0.5},
               .omega_count = 4,
               .divergence = {0.5, 0.5, 0.5, 0.5},
               .divergence_count = 4,
               .support = 2.0,
               .volume = 0.8,
               .epsilon = 0.1,
               .limit = 0.15,
               .repulsion = 0.25,
               .stiffness = 0.5,
               .rounds = 1.0,
               .again = 0.2,
               .left = -1.0,
               .below = 0.1,
               .contact = 0.4};
    if (!read_arguments(&r, argc, argv))
        return 2;
    size_t size = 0;
    unsigned char *bytes = change(&r, &size);
    const int status = bytes ? write_model(&r, bytes, size) : 1;
    free(bytes);
    return status;
}
