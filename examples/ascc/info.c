/* ascc info: what is in a model or sequence file. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "console.h"
#include "host.h"

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
    ascc_line(stdout, "  radius            %g m, reaches %g m in a step", m->support_radius,
              m->receptive_radius);
    if (m->neighbor_limit)
        ascc_line(stdout, "  neighbour limit   %d, mutual", m->neighbor_limit);
    ascc_line(
        stdout,
        "  trained with      spacing %g m, time step %g s, gravity %g %g %g m/s^2, density %g",
        m->particle_spacing, m->time_step, m->gravity[0], m->gravity[1], m->gravity[2],
        m->rest_density);
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

int ascc_command_info(int argc, char **argv)
{
    if (argc != 1 || strcmp(argv[0], "--help") == 0) {
        fprintf(argc == 1 ? stdout : stderr, "usage: ascc info FILE\n\n"
                                             "FILE is a model by name (water3d) or file, a "
                                             "published network or a sequence file.\n");
        return argc == 1 ? 0 : 2;
    }
    ascc_sequence sequence;
    char error[512];
    if (ascc_sequence_read(argv[0], &sequence, error, sizeof error)) {
        print_sequence(argv[0], &sequence);
        ascc_sequence_free(&sequence);
        return 0;
    }
    ascc_context *context = NULL;
    ascc_model *model = NULL;
    ascc_host_error why = {""};
    ascc_status status = ascc_context_create(NULL, &context);
    if (status == ASCC_OK)
        status = ascc_host_load(context, argv[0], &model, &why);
    if (status == ASCC_OK) {
        ascc_model_info info = {.size = sizeof info};
        status = ascc_model_get_info(model, &info);
        if (status == ASCC_OK)
            print_model(argv[0], &info);
    } else {
        ascc_host_complain("neither a model nor a sequence", status, why.text);
        ascc_line(stderr, "ascc: read as a sequence: %s", error);
    }
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return status == ASCC_OK ? 0 : 1;
}
