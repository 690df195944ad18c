/* ascc info: what is in a model or sequence file. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "host.h"

static void print_model(const char *path, const ascc_model_info *m)
{
    printf("%s: model %s\n", path, m->name);
    if (m->description[0])
        printf("  %s\n", m->description);
    printf("  dimension         %d\n", m->dimension);
    printf("  levels, layers    %d, %d\n", m->level_count, m->layer_count);
    printf("  parameters        %llu\n", (unsigned long long)m->parameter_count);
    printf("  cost              about %.0f multiply-adds a particle and step\n", m->multiply_adds);
    printf("  conserves         %s\n", m->conserves_angular_momentum ? "momentum, angular momentum"
                                       : m->conserves_momentum       ? "momentum"
                                                                     : "nothing exactly");
    printf("  sees particles at %s\n",
           m->advected ? "advected positions" : "their current positions");
    printf("  radius            %g m, reaches %g m in a step\n", m->support_radius,
           m->receptive_radius);
    if (m->neighbor_limit)
        printf("  neighbour limit   %d, mutual\n", m->neighbor_limit);
    printf("  trained with      spacing %g m, time step %g s, gravity %g %g %g m/s^2, density %g\n",
           m->particle_spacing, m->time_step, m->gravity[0], m->gravity[1], m->gravity[2],
           m->rest_density);
}

static void print_sequence(const char *path, const ascc_sequence *s)
{
    printf("%s: sequence of particles\n", path);
    printf("  dimension         %d\n", s->dimension);
    printf("  frames            %zu, %g s apart\n", s->frames, s->time_step);
    printf("  fluid particles   %zu, spacing %g m, mass %g kg\n", s->count, 2.0 * s->radius,
           s->mass);
    printf("  velocities        %s\n",
           s->velocity_frames == s->frames ? "in every frame" : "in the first frame");
    printf("  boundary points   %zu\n", s->walls);
    printf("  gravity           %g %g %g m/s^2\n", s->gravity[0], s->gravity[1], s->gravity[2]);
    if (s->source[0])
        printf("  source            %.160s\n", s->source);
}

int ascc_command_info(int argc, char **argv)
{
    if (argc != 1 || strcmp(argv[0], "--help") == 0) {
        fprintf(argc == 1 ? stdout : stderr, "usage: ascc info FILE\n\n"
                                             "FILE is a model file, a published network "
                                             "or a sequence file.\n");
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
        fprintf(stderr, "ascc: read as a sequence: %s\n", error);
    }
    ascc_model_destroy(&model);
    ascc_context_destroy(&context);
    return status == ASCC_OK ? 0 : 1;
}
