/* ascc info: what is in a model or sequence file. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "host.h"
#include "tensor_file.h"
#include "system.h"

static void print_model(const char *path, const ascc_model_info *m)
{
    ascc_line(stdout, "%s: model %s", path, m->name);
    if (m->description[0])
        ascc_line(stdout, "  %s", m->description);
    ascc_line(stdout, "  dimension         %d", m->dimension);
    ascc_line(stdout, "  levels, layers    %d, %d", m->level_count, m->layer_count);
    ascc_line(stdout, "  parameters        %llu", (unsigned long long)m->parameter_count);
    ascc_line(stdout, "  cost              about %.0f multiply-adds a particle and step",
              m->multiply_adds);
    ascc_line(stdout, "  conserves         %s",
              m->conserves_angular_momentum ? "momentum, angular momentum"
              : m->conserves_momentum       ? "momentum"
                                            : "nothing exactly");
    ascc_line(stdout, "  sees particles at %s",
              m->advected ? "advected positions" : "their current positions");
    if (m->support_radius > 0.0)
        ascc_line(stdout, "  radius            %g m, reaches %g m in a step", m->support_radius,
                  m->receptive_radius);
    else /* the last layer looks at no neighbours */
        ascc_line(stdout, "  reaches           %g m in a step", m->receptive_radius);
    if (m->neighbor_limit)
        ascc_line(stdout, "  neighbour limit   %d, mutual", m->neighbor_limit);
    ascc_line(
        stdout,
        "  trained with      spacing %g m, time step %g s, gravity %g %g %g m/s^2, density %g",
        m->particle_spacing, m->time_step, m->gravity[0], m->gravity[1], m->gravity[2],
        m->rest_density);
    ascc_line(stdout,
              "  in one step       at most %g s, gravity %g spacings / step^2, ways of %g spacings",
              m->time_step_max, m->gravity_max, m->way_max);
    if (m->tells_distance && m->distance_threshold > 0.0)
        ascc_line(stdout,
                  "  trust             tells the distance from training; errors double at %g",
                  m->distance_threshold);
    else if (m->tells_distance)
        ascc_line(stdout, "  trust             tells the distance from training");
}

static void print_sequence(const char *path, const ascc_sequence *s)
{
    ascc_line(stdout, "%s: sequence of particles", path);
    ascc_line(stdout, "  dimension         %d", s->dimension);
    ascc_line(stdout, "  frames            %zu, %g s apart", s->frames, s->time_step);
    ascc_line(stdout, "  fluid particles   %zu, spacing %g m, mass %g kg", s->count,
              2.0 * s->radius, s->mass);
    ascc_line(stdout, "  velocities        %s",
              s->velocity_frames == s->frames ? "in every frame" : "in the first frame");
    ascc_line(stdout, "  boundary points   %zu", s->walls);
    ascc_line(stdout, "  gravity           %g %g %g m/s^2", s->gravity[0], s->gravity[1],
              s->gravity[2]);
    if (s->source[0])
        ascc_line(stdout, "  source            %.160s", s->source);
}

/* What a file says that it is. */
static bool read_format(const char *path, char *format, size_t capacity, char *why, size_t room)
{
    size_t size, data;
    unsigned char *bytes = ascc_tensor_file_read(path, &size, why, room);
    if (!bytes)
        return false;
    char reason[256] = "";
    json_t *header = ascc_tensor_file_header(bytes, size, &data, reason, sizeof reason);
    const char *said = header ? ascc_tensor_file_metadata(header, "format") : NULL;
    (void)snprintf(format, capacity, "%s", said ? said : "");
    const bool known = strcmp(format, "ascc.sequence") == 0 || strcmp(format, "ascc.model") == 0 ||
                       strcmp(format, "ascc.weights") == 0;
    if (!header)
        (void)snprintf(why, room, "neither a model nor a sequence: %s", reason);
    else if (!known)
        (void)snprintf(why, room, "neither a model nor a sequence: its format is '%s'", format);
    json_decref(header);
    free(bytes);
    return known;
}

static int describe_sequence(const char *path)
{
    ascc_sequence sequence;
    char error[512];
    if (!ascc_sequence_read(path, &sequence, error, sizeof error)) {
        ascc_line(stderr, "ascc info: %s", error);
        return 1;
    }
    print_sequence(path, &sequence);
    ascc_sequence_free(&sequence);
    return 0;
}

static int describe_model(const char *path)
{
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    ascc_host_error why = {""};
    ascc_model_info info = {.size = sizeof info};
    ascc_status status = ascc_context_create(NULL, &context);
    if (status == ASCC_OK)
        status = ascc_host_load(context, path, &model, &why);
    if (status == ASCC_OK)
        status = ascc_model_get_info(model, &info);
    if (status == ASCC_OK)
        print_model(path, &info);
    else
        ascc_host_complain(path, status, why.text);
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return status == ASCC_OK ? 0 : 1;
}

int ascc_command_info(int argc, char **argv)
{
    if (argc == 1 && strcmp(argv[0], "--help") == 0) {
        fputs(
            "usage: ascc info FILE\n\n"
            "FILE is a model by name (water3d) or file, a published network or a sequence file.\n",
            stdout);
        return 0;
    }
    if (argc != 1)
        return ascc_bad_use("info", "one FILE is wanted", NULL, NULL), 2;
    if (argv[0][0] == '-')
        return ascc_bad_use("info", "unknown option", argv[0], NULL), 2;
    char format[64] = "", why[512];
    if (!ascc_system_there(argv[0]))
        return describe_model(argv[0]); /* which tells the reason */
    if (!read_format(argv[0], format, sizeof format, why, sizeof why)) {
        ascc_line(stderr, "ascc info: %s: %s", argv[0], why);
        return 1;
    }
    return strcmp(format, "ascc.sequence") == 0 ? describe_sequence(argv[0])
                                                : describe_model(argv[0]);
}
