/* Checks the reference solvers against what is known, and writes the table and figures of
 * docs/reference.md: validate-reference [--docs DIR] [--threads N]. SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include "inspect.h"
#include "pbf.h"
#include "base/common.h"
#include "recipes.h"
#include "validate.h"

#define PI 3.14159265358979323846

/* ---- Table and figures ---- */

void validate_row(report *r, const char *what, bool passes, const char *bound, const char *format,
                  ...)
{
    char found[256];
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(found, sizeof found, format, arguments);
    va_end(arguments);
    const size_t room = sizeof r->table - r->length;
    const int n = snprintf(r->table + r->length, room, "| %s | %s | %s | %s |\n", what, found,
                           bound, passes ? "yes" : "**no**");
    r->length += n > 0 && (size_t)n < room ? (size_t)n : 0;
    r->good &= passes;
    printf("%-4s %s: %s (wanted: %s)\n", passes ? "ok" : "FAIL", what, found, bound);
    (void)fflush(stdout);
}

/* A data file of the figure `name`, DIR/figures/NAME.dat; a dropped one without --docs. */
static FILE *open_data(const report *r, const char *name)
{
    char path[4096];
    (void)snprintf(path, sizeof path, "%s/figures", r->docs ? r->docs : "");
    if (r->docs)
        (void)mkdir(path, 0777);
    (void)snprintf(path, sizeof path, "%s/figures/%s.dat", r->docs ? r->docs : "", name);
    return r->docs ? fopen(path, "w") : tmpfile();
}

/* Draws NAME.svg and NAME.png; `plot` refers to the data as DATA. */
static void draw(const report *r, const char *name, const char *labels, const char *plot)
{
    FILE *pipe = r->docs ? popen("gnuplot", "w") : NULL;
    if (!pipe)
        return;
    for (int k = 0; k < 2; k++)
        fprintf(pipe,
                "set fit quiet logfile '/dev/null'\nset terminal %s\nset output "
                "'%s/figures/%s.%s'\nDATA='%s/figures/%s.dat'\n"
                "set grid\nset key bottom right\n%s\n%s\nunset output\n",
                k ? "pngcairo size 800,500 font 'sans,11'" : "svg size 800,500 font 'sans,13'",
                r->docs, name, k ? "png" : "svg", r->docs, name, labels, plot);
    if (pclose(pipe) != 0)
        printf("note: gnuplot did not draw %s\n", name);
}

/* Puts the table between the two marks of DIR/reference.md. */
static void write_table(const report *r)
{
    static const char begin[] = "<!-- validation begins -->\n", end[] = "<!-- validation ends -->";
    char path[4096], part[4104], *text = calloc(1, 1 << 20);
    (void)snprintf(path, sizeof path, "%s/reference.md", r->docs);
    (void)snprintf(part, sizeof part, "%s.part", path);
    FILE *in = fopen(path, "r");
    if (in && text)
        (void)!fread(text, 1, (1 << 20) - 1, in);
    if (in)
        (void)fclose(in);
    char *from = text ? strstr(text, begin) : NULL, *to = from ? strstr(from, end) : NULL;
    FILE *out = to ? fopen(part, "w") : NULL;
    if (out) {
        fprintf(out, "%.*s%s| case | found | wanted | met |\n|---|---|---|---|\n%s%s",
                (int)(from - text), text, begin, r->table, to);
        if (fclose(out) != 0 || rename(part, path) != 0)
            printf("note: could not write %s\n", path);
    } else {
        printf("note: %s has no place for the table\n", path);
    }
    free(text);
}

/* ---- Cases ---- */

static void hydrostatic(report *r)
{
    const recipe_options options = {.dimension = 2, .number = 1};
    recipe c;
    sph *s;
    wall_points walls;
    if (recipe_make("still-column", &options, &c) != ASCC_OK ||
        recipe_solver(&c, r->threads, &s, &walls) != ASCC_OK)
        return;
    const double level = c.depth[0] + c.position[1], step = 0.01;
    double bottom = 0.0;
    for (int f = 0; f < 200 && sph_advance(s, step) == ASCC_OK; f++) {
        const sph_particle *p = sph_particles(s, NULL, NULL);
        double sum = 0.0, count = 0.0;
        for (size_t i = 0; i < c.count; i++)
            if (p[i].position[1] < c.spacing) {
                sum += p[i].pressure + 1000.0 * G * p[i].position[1];
                count += 1.0;
            }
        bottom += f >= 100 && count > 0.0 ? sum / count / 100.0 : 0.0;
    }
    FILE *data = open_data(r, "hydrostatic");
    const sph_particle *p = sph_particles(s, NULL, NULL);
    for (size_t i = 0; data && i < c.count; i++)
        fprintf(data, "%.5f %.3f\n", p[i].position[1] / level,
                p[i].pressure / (1000.0 * G * level));
    if (data)
        (void)fclose(data);
    draw(r, "hydrostatic",
         "set title 'Water at rest after 2 s: every particle'\nset xlabel 'height / depth'\n"
         "set ylabel 'pressure / (rho g depth)'\nset key top right",
         "plot [0:1.05] DATA with points pt 7 ps 0.4 title 'SPH', 1-x with lines lw 2 title "
         "'exact'");
    const double ratio = bottom / (1000.0 * G * level);
    validate_row(r, "hydrostatic column, pressure at the bottom, mean of 1 to 2 s",
                 fabs(ratio - 1) < 0.02, "1 within 2 %", "%.4f rho g h (%.0f spacings deep)", ratio,
                 level / c.spacing);
    sph_destroy(&s);
    wall_points_free(&walls);
    recipe_free(&c);
}

static FILE *open_experiment(void)
{
    const char *shared = getenv("ASCC_SHARED");
    char path[4096];
    (void)snprintf(path, sizeof path, "%s/data/dambreak/dambreak_front_validation.csv",
                   shared ? shared : "../shared");
    FILE *file = fopen(path, "r");
    if (!file)
        printf("skip dam break: %s cannot be read; ASCC_SHARED names the folder\n", path);
    return file;
}

/* When the front passes x, by linear interpolation in its history front[frame], frames of `step`. */
static double time_at(const double *front, int frames, double step, double x)
{
    for (int f = 1; f < frames; f++)
        if (front[f] >= x)
            return step * (f - (front[f] - x) / (front[f] - front[f - 1]));
    return NAN;
}

/* Front of a column of 1 m x 2 m in a tank of 4 m x 3 m. */
static bool run_dam(int32_t threads, double front[DAM_FRAMES], double step)
{
    const double dp = 0.02;
    const solid tank = {.kind = SOLID_ROOM, .center = {2.0, 1.5}, .half = {2.0, 1.5}};
    const sph_options options = {.dimension = 2,
                                 .thread_count = threads,
                                 .spacing = dp,
                                 .sound_speed = 63.0,
                                 .gravity = {0.0, -G},
                                 .artificial_viscosity = 0.02};
    static double position[5000 * 2], depth[5000];
    for (size_t i = 0; i < 5000; i++) {
        position[2 * i] = ((double)(i % 50) + 0.5) * dp;
        position[2 * i + 1] = ((double)(i / 50) + 0.5) * dp;
        depth[i] = 2.0 - position[2 * i + 1];
    }
    wall_points walls = {0};
    sph *s = sph_create(&options);
    bool good = s && solids_sample(&tank, 1, 2, dp, 3, &walls) &&
                sph_set_walls(s, walls.count, walls.position) == ASCC_OK &&
                sph_set_fluid(s, 5000, position, NULL) == ASCC_OK;
    if (good)
        sph_set_depth(s, depth);
    for (int f = 0; good && f < DAM_FRAMES; f++) {
        const sph_particle *p = sph_particles(s, NULL, NULL);
        front[f] = 0.5 * dp;
        for (size_t i = 0; i < 5000; i++)
            front[f] = fmax(front[f], p[i].position[0] + 0.5 * dp);
        good = sph_advance(s, step) == ASCC_OK;
    }
    sph_destroy(&s);
    wall_points_free(&walls);
    return good;
}

/* Compares a front with the experiment, and writes what that has to *data if given. */
static void judge_dam(report *r, FILE *experiment, const char *what, const double *front,
                      FILE *data)
{
    char line[512];
    double mean = 0.0, most = 0.0, theirs = 0.0, count = 0.0;
    rewind(experiment);
    while (fgets(line, sizeof line, experiment)) {
        double t, x, simulated, difference, reached;
        if (sscanf(line, "%lf,%lf,%lf,%lf,%lf", &t, &x, &simulated, &difference, &reached) != 5)
            continue;
        if (data)
            fprintf(data, "%.4f %.4f %.4f\n", t, x, simulated);
        const double lead = t - time_at(front, DAM_FRAMES, DAM_STEP, x);
        if (x > 3.8 || !isfinite(lead)) /* the far wall is near */
            continue;
        mean += lead;
        theirs += t - reached;
        most = fmax(most, fabs(lead));
        count += 1.0;
    }
    validate_row(r, what, most < 0.075, "about 0.05 s, as DualSPHysics",
                 "mean %.3f s, most %.3f s (DualSPHysics: mean %.3f s)", mean / count, most,
                 theirs / count);
}

static void dam_break(report *r)
{
    FILE *experiment = open_experiment();
    static double front[DAM_FRAMES], other[DAM_FRAMES];
    if (!experiment || !run_dam(r->threads, front, DAM_STEP) ||
        !validate_dfsph_dam(r->threads, other)) {
        if (experiment)
            (void)fclose(experiment);
        return;
    }
    FILE *data = open_data(r, "dambreak");
    for (int f = 0; data && f < DAM_FRAMES; f++)
        fprintf(data, "%.3f %.4f %.4f\n", f * DAM_STEP, front[f], other[f]);
    if (data)
        fprintf(data, "\n\n");
    judge_dam(r, experiment, "dam break, lead of the front over the experiment", front, data);
    judge_dam(r, experiment, "DFSPH: dam break, lead of the front over the experiment", other,
              NULL);
    (void)fclose(experiment);
    if (data)
        (void)fclose(data);
    draw(r, "dambreak",
         "set title 'Front of a collapsing column, 1 m x 2 m'\nset xlabel 'time, s'\n"
         "set ylabel 'front, m'",
         "plot [0:0.8][0.9:4.2] DATA index 0 with lines lw 2 title 'SPH, spacing 0.02 m', DATA "
         "index 0 using 1:3 with lines lw 2 dt 2 title 'DFSPH, spacing 0.02 m', DATA index 1 "
         "using 1:3 with linespoints title 'DualSPHysics, spacing 0.02 m', DATA index 1 "
         "using 1:2 with points pt 7 title 'Koshizuka and Oka 1996'");
}

static void droplets(report *r)
{
    const recipe_options options = {.dimension = 2, .seed = 3};
    recipe c;
    sph *s;
    wall_points walls;
    if (recipe_make("droplets", &options, &c) != ASCC_OK ||
        recipe_solver(&c, r->threads, &s, &walls) != ASCC_OK)
        return;
    double error = 0.0;
    for (int f = 0; f < 100 && sph_advance(s, 0.005) == ASCC_OK; f++) {
        const sph_particle *p = sph_particles(s, NULL, NULL);
        double sum[2] = {0}, start[2] = {0}, size = 0.0;
        for (size_t i = 0; i < c.count; i++)
            for (int k = 0; k < 2; k++) {
                sum[k] += p[i].velocity[k];
                start[k] += c.velocity[2 * i + (size_t)k];
                size += fabs(p[i].velocity[k]);
            }
        error = fmax(error, hypot(sum[0] - start[0], sum[1] - start[1]) / size);
    }
    validate_row(
        r, "two droplets, no gravity, change of momentum over the sum of its sizes, worst of 0.5 s",
        error < 1e-13, "rounding", "%.1e", error);
    sph_destroy(&s);
    recipe_free(&c);
}

typedef struct vortex {
    double rate;  /* of the velocity, over the exact one */
    double error; /* of the velocity at the end, relative to its mean square */
} vortex;

/* Taylor-Green vortices in a unit box, U = 1 m/s, nu = 0.01 m^2/s, until t = 0.5 s. */
static bool run_vortex(report *r, int n, FILE *data, vortex *v)
{
    const double nu = 0.01, dp = 1.0 / n, step = 0.02;
    const size_t count = (size_t)n * (size_t)n;
    const sph_options options = {.dimension = 2,
                                 .thread_count = r->threads,
                                 .spacing = dp,
                                 .sound_speed = 10.0,
                                 .viscosity = nu,
                                 .impact_viscosity = -1.0,
                                 .contact = -1.0,
                                 .keep_tension = 1,
                                 .period = {1.0, 1.0, 0.0}};
    double *position = malloc(2 * count * sizeof *position),
           *velocity = malloc(2 * count * sizeof *velocity);
    sph *s = sph_create(&options);
    bool good = s && position && velocity;
    for (size_t i = 0; good && i < count; i++) {
        const double x = ((double)(i % (size_t)n) + 0.5) * dp,
                     y = ((double)(i / (size_t)n) + 0.5) * dp;
        position[2 * i] = x;
        position[2 * i + 1] = y;
        velocity[2 * i] = -cos(2 * PI * x) * sin(2 * PI * y);
        velocity[2 * i + 1] = sin(2 * PI * x) * cos(2 * PI * y);
    }
    good = good && sph_set_fluid(s, count, position, velocity) == ASCC_OK;
    double first = 0.0;
    for (int f = 0; good && f <= 25; f++) {
        const sph_particle *p = sph_particles(s, NULL, NULL);
        const double t = f * step, decay = exp(-8.0 * PI * PI * nu * t);
        double energy = 0.0, error = 0.0;
        for (size_t i = 0; i < count; i++) {
            const double x = 2 * PI * p[i].position[0], y = 2 * PI * p[i].position[1];
            const double u = p[i].velocity[0], w = p[i].velocity[1];
            energy += u * u + w * w;
            error += pow(u + decay * cos(x) * sin(y), 2) + pow(w - decay * sin(x) * cos(y), 2);
        }
        if (data)
            fprintf(data, "%.3f %.6f\n", t, sqrt(2.0 * energy / (double)count));
        if (f == 5)
            first = energy;
        v->rate = log(first / energy) / (2.0 * (t - 5 * step)) / (8.0 * PI * PI * nu);
        v->error = sqrt(error / (double)count) / (decay * sqrt(0.5));
        good = f == 25 || sph_advance(s, step) == ASCC_OK;
    }
    if (data)
        fprintf(data, "\n\n");
    sph_destroy(&s);
    free(position);
    free(velocity);
    return good;
}

static void vortices(report *r)
{
    static const int sizes[] = {25, 50, 100};
    vortex v[3];
    FILE *decay = open_data(r, "taylor-green"), *order = open_data(r, "convergence");
    for (int k = 0; k < 3; k++) {
        if (!run_vortex(r, sizes[k], decay, &v[k]))
            v[k] = (vortex){NAN, NAN};
        if (order)
            fprintf(order, "%.4f %.6f\n", 1.0 / sizes[k], v[k].error);
    }
    if (decay)
        (void)fclose(decay);
    if (order)
        (void)fclose(order);
    draw(r, "taylor-green",
         "set title 'Taylor-Green vortices, Re = 100'\nset xlabel 'time, s'\n"
         "set ylabel 'speed, 1 = at first'\nset key top right",
         "plot DATA index 0 with points title '25 x 25', DATA index 1 with points title '50 x 50', "
         "DATA index 2 with points title '100 x 100', exp(-0.08*pi*pi*x) with lines lw 2 title "
         "'exact'");
    draw(r, "convergence",
         "set title 'Taylor-Green vortices: error of the velocity at 0.5 s'\nset logscale xy\n"
         "set xlabel 'particle spacing'\nset ylabel 'relative error'",
         "f(x)=a*x**b\na=1\nb=1\nfit f(x) DATA via a,b\nplot [0.008:0.05] DATA with points pt 7 ps "
         "1.5 title 'SPH', f(x) with lines title sprintf('order %.2f', b)");
    validate_row(r, "Taylor-Green, rate of decay from 0.1 to 0.5 s, 50 x 50",
                 fabs(v[1].rate - 1) < 0.05, "1 within 5 %",
                 "%.4f of 8 pi^2 nu (25 x 25: %.4f, 100 x 100: %.4f)", v[1].rate, v[0].rate,
                 v[2].rate);
    const double slope = log(v[0].error / v[2].error) / log(4.0);
    validate_row(r, "order of convergence, Taylor-Green velocity, 25 to 100", slope > 0.9,
                 "1 or better", "%.2f (errors %.4f, %.4f, %.4f)", slope, v[0].error, v[1].error,
                 v[2].error);
}

/* ---- Clumping ---- */

/* A splash without walls' help: shares of particles near each other, by choice of remedy. */
static bool splash(const report *r, const sph_options *choice, inspection *found)
{
    const recipe_options options = {.seed = 1, .number = 4, .frames = 160};
    recipe c;
    if (recipe_make("wbc2d", &options, &c) != ASCC_OK)
        return false;
    sph_options o = *choice;
    o.dimension = 2;
    o.thread_count = r->threads;
    o.spacing = c.spacing;
    o.sound_speed = 10.0 * c.speed;
    o.artificial_viscosity = 0.05;
    memcpy(o.gravity, c.gravity, sizeof o.gravity);
    wall_points walls = {0};
    sph *s = sph_create(&o);
    float *frames = calloc(c.count * 2 * 160, sizeof *frames);
    bool good = s && frames && solids_sample(c.solids, c.solid_count, 2, c.spacing, 3, &walls) &&
                sph_set_walls(s, walls.count, walls.position) == ASCC_OK &&
                sph_set_fluid(s, c.count, c.position, c.velocity) == ASCC_OK;
    for (size_t f = 0; good && f < 160; f++) {
        const sph_particle *p = sph_particles(s, NULL, NULL);
        for (size_t i = 0; i < 2 * c.count; i++)
            frames[f * 2 * c.count + i] = (float)p[i / 2].position[i % 2];
        good = sph_advance(s, c.frame) == ASCC_OK;
    }
    const inspect_input input = {.dimension = 2,
                                 .frames = 160,
                                 .count = c.count,
                                 .time_step = c.frame,
                                 .spacing = c.spacing,
                                 .position = frames};
    good = good && inspect(&input, NULL, found) == ASCC_OK;
    free(frames);
    sph_destroy(&s);
    wall_points_free(&walls);
    recipe_free(&c);
    return good;
}

static void clumping(report *r)
{
    static const struct {
        const char *name;
        sph_options options;
    } choices[] = {
        {"neither: tension kept", {.keep_tension = 1, .shifting = -1, .contact = -1}},
        {"shifting, tension kept", {.keep_tension = 1, .contact = -1}},
        {"clipped", {.shifting = -1, .contact = -1}},
        {"clipped, shifting", {.contact = -1}},
        {"clipped, shifting, contact force: the default", {.shifting = 0}},
    };
    for (size_t k = 0; k < sizeof choices / sizeof *choices; k++) {
        inspection f;
        char name[128];
        (void)snprintf(name, sizeof name, "clumping in a splash, %s", choices[k].name);
        const bool last = k + 1 == sizeof choices / sizeof *choices;
        if (splash(r, &choices[k].options, &f))
            validate_row(r, name, !last || f.pair_worst < 0.01,
                         last ? "worst below 1 %" : "for comparison",
                         "nearer than 0.3 spacings: mean %.2f %%, worst %.2f %%; fastest %.1f m/s",
                         100 * f.pair_mean, 100 * f.pair_worst, f.fastest);
        else
            validate_row(r, name, !last, "for comparison", "did not run to its end");
    }
}

/* ---- Position based fluids ---- */

/* Mean density error of a block falling into a box, 1 s in frames of 0.0025 s. */
static double run_pbf(report *r, int32_t iterations)
{
    const recipe_options options = {.dimension = 2, .number = 1};
    recipe c;
    if (recipe_make("pool-drop", &options, &c) != ASCC_OK)
        return NAN;
    const pbf_options o = {.dimension = 2,
                           .thread_count = r->threads,
                           .spacing = c.spacing,
                           .gravity = {0.0, -G},
                           .iterations = iterations};
    wall_points walls = {0};
    pbf *p = pbf_create(&o);
    bool good = p && solids_sample(c.solids, c.solid_count, 2, c.spacing, 3, &walls) &&
                pbf_set_walls(p, walls.count, walls.position) == ASCC_OK &&
                pbf_set_fluid(p, c.count, c.position, c.velocity) == ASCC_OK;
    double sum = 0.0;
    for (int f = 0; good && f < 200; f++) {
        double error;
        good = pbf_advance(p, c.frame) == ASCC_OK && pbf_density_error(p, &error) == ASCC_OK;
        sum += good ? error / 200 : NAN;
    }
    pbf_destroy(&p);
    wall_points_free(&walls);
    recipe_free(&c);
    return good ? sum : NAN;
}

static void position_based(report *r)
{
    double error[6];
    FILE *data = open_data(r, "pbf");
    bool falls = true;
    for (int k = 0; k < 6; k++) {
        error[k] = run_pbf(r, 1 << k);
        falls &= k == 0 || error[k] < error[k - 1];
        if (data)
            fprintf(data, "%d %.6f\n", 1 << k, error[k]);
    }
    if (data)
        (void)fclose(data);
    draw(r, "pbf",
         "set title 'Position based fluids: drop into a pool, frames of 0.0025 s'\n"
         "set logscale xy\nset xlabel 'iterations'\nset ylabel 'mean compression'\n"
         "set key top right",
         "plot DATA with linespoints pt 7 title 'mean of max(density - 1, 0)'");
    validate_row(r, "position based fluids, mean compression with 1, 2, 4, 8, 16, 32 iterations",
                 falls, "falls", "%.4f, %.4f, %.4f, %.4f, %.4f, %.4f", error[0], error[1], error[2],
                 error[3], error[4], error[5]);
}

int main(int argc, char **argv)
{
    static report r = {.threads = 1, .good = true};
    for (int i = 1; i + 1 < argc; i += 2) {
        if (strcmp(argv[i], "--docs") == 0)
            r.docs = argv[i + 1];
        else if (strcmp(argv[i], "--threads") == 0)
            r.threads = (int32_t)strtol(argv[i + 1], NULL, 10);
    }
    hydrostatic(&r);
    droplets(&r);
    vortices(&r);
    position_based(&r);
    clumping(&r);
    validate_dfsph(&r);
    dam_break(&r);
    if (r.docs)
        write_table(&r);
    return r.good ? 0 : 1;
}
