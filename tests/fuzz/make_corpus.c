/* Writes seeds that reach deep into each target, a folder for each in the folder named.
 * SPDX-License-Identifier: MIT
 *
 * tests/fuzz/corpus holds what this program wrote, and inputs that once found a fault.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

#include <ascc/ascc.h>

#include "support/model_builder.h"

static int failures;
static const char *folder; /* of all targets */

/* A file of a target: what comes before, then the data. */
static void write_parts(const char *target, const char *name, const void *before,
                        size_t before_size, const void *data, size_t size)
{
    char path[512];
    snprintf(path, sizeof path, "%s/%s", folder, target);
    (void)mkdir(path, 0777);
    snprintf(path, sizeof path, "%s/%s/%s", folder, target, name);
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(before, 1, before_size, file) != before_size ||
        fwrite(data, 1, size, file) != size)
        failures++;
    if (file && fclose(file) != 0)
        failures++;
}

static void write_seed(const char *target, const char *name, char kind, const void *data,
                       size_t size)
{
    write_parts(target, name, &kind, 1, data, size);
}

static void write_text(const char *target, const char *name, const char *text)
{
    write_parts(target, name, "", 0, text, strlen(text));
}

/* ---- Models ---- */

/* A whole file, or without its length and with a separator before the data. */
static void write_file(const char *target, const char *name, char kind, unsigned char *bytes,
                       size_t size)
{
    if (kind == 'h') {
        size_t length = 0;
        for (int i = 7; i >= 0; i--)
            length = length << 8 | bytes[i];
        memmove(bytes, bytes + 8, length);
        bytes[length] = 0xff;
        memmove(bytes + length + 1, bytes + 8 + length, size - 8 - length);
        size -= 7;
    }
    write_seed(target, name, kind, bytes, size);
    free(bytes);
}

static void write_models(void)
{
    static const char *const headers[] = {
        "{}",
        "{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\",\"network\":\"{}\"}}",
        "{\"a\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]},"
        "\"b\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[4,12]}}\xff"
        "012345678901",
        "{\"a\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[0,8]},"
        "\"b\":{\"dtype\":\"F32\",\"shape\":[2],\"data_offsets\":[12,20]}}\xff"
        "01234567890123456789",
        "{\"a\":{\"dtype\":\"F64\",\"shape\":[2147483648,1073741824],\"data_offsets\":[0,0]}}",
        "{\"a\":1,\"a\":2}",
        "{\"\\ud83d\\ude00\\u00e9\\n\":[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[[]",
        "{\"a\":[1e308,-0.1e-320,123456789012345678901234567890,5e-324,true,false,null]}",
    };
    static const char kinds[] = {'n', 'b', 'p', 'g', 'd', 'c', 't'};
    const model_random tiny = {.channels = 4, .cells = 1, .output_cells = 2, .trunk_layers = 1};
    const model_random farthest = {.levels = 2,
                                   .channels = 4,
                                   .cells = 1,
                                   .output_cells = 2,
                                   .method = "farthest",
                                   .half_axis = "x",
                                   .plain = 1};
    const model_random graph = {
        .channels = 4, .graph = 1, .history = 2, .plain = 1, .radius = 1.45};
    const model_random abstraction = {
        .channels = 4, .levels = 2, .method = "farthest", .abstraction = 1 + 2 + 16, .plain = 1};
    for (int i = 0; i < 2; i++) {
        const char kind = "fh"[i];
        char name[32];
        size_t size;
        unsigned char *bytes = model_builder_random(&tiny, &size);
        snprintf(name, sizeof name, "random-%c", kind);
        write_file("model", name, kind, bytes, size);
        bytes = model_builder_random(&farthest, &size);
        snprintf(name, sizeof name, "farthest-%c", kind);
        write_file("model", name, kind, bytes, size);
        bytes = model_builder_random(&graph, &size);
        snprintf(name, sizeof name, "graph-%c", kind);
        write_file("model", name, kind, bytes, size);
        bytes = model_builder_random(&abstraction, &size);
        snprintf(name, sizeof name, "abstraction-%c", kind);
        write_file("model", name, kind, bytes, size);
        bytes = model_builder_cconv(NULL, NULL, &size);
        snprintf(name, sizeof name, "cconv-%c", kind);
        write_file("model", name, kind, bytes, size);
    }
    for (size_t i = 0; i < sizeof headers / sizeof *headers; i++) {
        char name[32];
        snprintf(name, sizeof name, "header-%zu", i);
        write_seed("model", name, 'h', headers[i], strlen(headers[i]));
    }
    for (size_t i = 0; i < sizeof kinds; i++) {
        char name[32], *text = model_builder_description(kinds[i]);
        snprintf(name, sizeof name, "description-%c", kinds[i]);
        write_seed("model", name, kinds[i], text, strlen(text));
        free(text);
    }
}

/* ---- JSON ---- */

static void write_json(void)
{
    static const char *const texts[] = {
        "{\"a\":[1,2.5,-3e-2,{\"b\":true,\"c\":null}],\"fluid\":\"boundary\",\"n\":[0,1,2]}",
        "[\"\\u00e9\\ud83d\\ude00\\t\\\\\\\"\",0.1,1e308,5e-324,-0.0,"
        "123456789012345678901234567890]",
        " { \"x\" : { \"y\" : { \"z\" : [ [ [ ] ] ] } } } ",
        "17",
        "\"\"",
        "1e-400"};
    for (size_t i = 0; i < sizeof texts / sizeof *texts; i++) {
        char name[32];
        snprintf(name, sizeof name, "text-%zu", i);
        write_text("json", name, texts[i]);
    }
}

/* ---- Snapshots ---- */

static void write_snapshot(int dimension, int walls)
{
    ascc_context *context = NULL;
    ascc_particles *particles = NULL;
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = 0.05, .mass = 0.125};
    double x[12][3], n[12][3] = {{0}}, v[12][3] = {{0}};
    const ascc_const_array position = {.data = x, .stride = sizeof *x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = n, .stride = sizeof *n, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = v, .stride = sizeof *v, .scalar = ASCC_DOUBLE};
    for (int i = 0; i < 12; i++) {
        const int at[3] = {i % 3, i / 3 % 2, i / 6};
        for (int c = 0; c < 3; c++)
            x[i][c] = 0.05 * at[c] + 0.02;
        v[i][0] = 0.5 - 0.1 * i;
        n[i][1] = 1.0;
    }
    if (ascc_context_create(NULL, &context) != ASCC_OK ||
        ascc_particles_create(context, &options, &particles) != ASCC_OK ||
        ascc_particles_add_fluid(particles, 6, &position, &velocity, NULL, NULL) != ASCC_OK)
        exit(1);
    for (int i = 0; i < 12; i++)
        x[i][1] = -0.02;
    if (walls && ascc_particles_add_boundary(particles, 5, &position, &normal, 1, NULL) != ASCC_OK)
        exit(1);
    const size_t size = ascc_particles_snapshot_size(particles);
    unsigned char *bytes = malloc(size);
    if (!bytes || ascc_particles_snapshot(particles, bytes, size) != ASCC_OK)
        exit(1);
    char name[32];
    const unsigned char complete[3] = {'c', (unsigned char)(dimension - 2),
                                       (unsigned char)(walls ? 128 : 0)};
    snprintf(name, sizeof name, "%dd-%s-r", dimension, walls ? "walls" : "free");
    write_seed("snapshot", name, 'r', bytes, size);
    snprintf(name, sizeof name, "%dd-%s-s", dimension, walls ? "walls" : "free");
    write_seed("snapshot", name, 's', bytes, size);
    snprintf(name, sizeof name, "%dd-%s-c", dimension, walls ? "walls" : "free");
    write_parts("snapshot", name, complete, sizeof complete, bytes + 40, size - 40);
    free(bytes);
    ascc_particles_destroy(&particles);
    ascc_context_destroy(&context);
}

/* ---- Sequences ---- */

static void write_sequence(const char *name, int dimension, int frames, int velocity_frames)
{
    model_builder b;
    float x[2 * 4 * 3], wall[3 * 3], normal[3 * 3];
    const size_t d = (size_t)dimension;
    size_t size;
    char text[32];
    for (size_t k = 0; k < 2 * 4 * d; k++)
        x[k] = 0.05f * (float)(k / d % 4 >> k % d & 1) + 0.001f * (float)k;
    for (size_t k = 0; k < 3 * d; k++) {
        wall[k] = k % d == 1 ? -0.05f : 0.05f * (float)(k / d);
        normal[k] = k % d == 1 ? 1.0f : 0.0f;
    }
    model_builder_open(&b);
    model_builder_metadata(&b, "format", "ascc.sequence");
    model_builder_metadata(&b, "version", "1");
    snprintf(text, sizeof text, "%d", dimension);
    model_builder_metadata(&b, "dim", text);
    model_builder_metadata(&b, "dt", "0.01");
    model_builder_metadata(&b, "particle_radius", "0.025");
    model_builder_metadata(&b, "particle_mass", "2.5");
    model_builder_metadata(&b, "rest_density", "1000");
    model_builder_metadata(&b, "gravity", dimension == 2 ? "0 -9.81" : "0 -9.81 0");
    model_builder_metadata(&b, "boundary_layers", "2 1");
    model_builder_metadata(&b, "source", "make_corpus");
    model_builder_tensor(&b, "fluid.position", 3, (const size_t[]){(size_t)frames, 4, d}, x);
    model_builder_tensor(&b, "fluid.velocity", 3, (const size_t[]){(size_t)velocity_frames, 4, d},
                         x);
    model_builder_tensor(&b, "boundary.position", 2, (const size_t[]){3, d}, wall);
    model_builder_tensor(&b, "boundary.normal", 2, (const size_t[]){3, d}, normal);
    unsigned char *bytes = model_builder_finish(&b, &size);
    write_seed("sequence", name, 'f', bytes, size);
    char header[40];
    snprintf(header, sizeof header, "%s-h", name);
    write_file("sequence", header, 'h', bytes, size);
}

/* ---- Training ---- */

static void write_training(void)
{
    static const char grid[] =
        "{\"network\":{\"name\":\"g\",\"dimension\":2,\"kernel\":\"grid\",\"spacing\":0.05,"
        "\"time_step\":0.005,\"channels\":4,\"levels\":1,\"coarse_channels\":[4]},"
        "\"data\":{\"train\":[\"*.safetensors\",{\"path\":\"a.safetensors\",\"share\":2,\"every\":"
        "2}"
        "],\"valid\":[\"a.safetensors\"]},\"stages\":[{\"iterations\":10,\"unroll\":2,"
        "\"warm_up\":1,\"learning_rate\":0.001,\"learning_rate_end\":1e-05}],\"output\":\"m\","
        "\"validate\":{\"every_iterations\":5,\"frames\":2,\"starts\":1,\"rollouts\":1}}";
    static const char described[] =
        "{\"description\":{\"name\":\"d\",\"dimension\":2,\"time_step\":0.005,\"gravity\":[0,-9.81]"
        ","
        "\"particle_spacing\":0.05,\"rest_density\":1000,\"evaluate\":\"current\",\"features\":"
        "{\"fluid\":[\"one\",\"velocity\"],\"boundary\":[\"one\"]},\"layers\":[{\"name\":\"a\","
        "\"points\":\"fluid\",\"channels\":4,\"terms\":[{\"type\":\"convolution\",\"source\":"
        "\"fluid\","
        "\"outputs\":2,\"kernel\":\"k\",\"bias\":\"kb\",\"cells\":[3,2,1],\"radius\":0.1,"
        "\"window\":"
        "\"poly6\",\"mapping\":\"volume\"},{\"type\":\"dense\",\"source\":\"fluid\",\"column\":2,"
        "\"weight\":\"w\"}]}],\"output\":{\"type\":\"antisymmetric\",\"source\":\"a\",\"scale\":0."
        "01,"
        "\"kernel\":\"o\",\"stored\":\"full\",\"cells\":[3,3,1],\"radius\":0.1,\"window\":\"peak\","
        "\"mapping\":\"identity\",\"projection\":\"none\"}},\"data\":{\"train\":[\"a.safetensors\"]"
        "},"
        "\"stages\":[{\"iterations\":1,\"unroll\":1,\"learning_rate\":0.1}],\"output\":\"m\"}";
    static const char basis[] =
        "{\"network\":{\"name\":\"b\",\"dimension\":3,\"spacing\":0.05,\"time_step\":0.02,"
        "\"channels\":8,\"fine_layers\":2,\"levels\":2,\"coarse_channels\":[4,4],\"radius\":2,"
        "\"wall_radius\":2,\"bumps\":3,\"order\":1,\"damping\":true,\"gravity_seen\":true,"
        "\"impulse_limit\":0.5,\"contact\":0.4,\"direction\":\"seen\",\"sampling\":\"corners\","
        "\"evaluate\":\"advected\",\"seed\":3},\"data\":{\"train\":[\"a.safetensors\"]},"
        "\"stages\":[{\"iterations\":1,\"horizon\":1,\"learning_rate\":0.1}],\"batch\":2,"
        "\"clip\":1,\"average\":0.9,\"jitter\":0.1,\"rotate\":true,\"mirror\":true,"
        "\"neighbor_weight\":0.5,\"density_weight\":1,\"wall_weight\":1,\"truth_share\":0.5,"
        "\"position_gradients\":true,\"memory\":1,\"output\":\"out/m.safetensors\","
        "\"log\":\"l.csv\",\"checkpoint\":{\"path\":\"c\",\"every_seconds\":60}}";
    static const char rows[] = "\5h1,1,2,1,0.001,0.5,1.5,0.100000,4,0,0,,,,,,\n"
                               "2,1,2,1,0.001,0.4,1.25,0.200000,8,0,0,0.00125,0.0025,20,0,0.125,1\n"
                               "3,1,2,1,0.001,0.3,1,0.300000,12,0,1,0.001,0.002,20,3,0.25,0\n";
    unsigned char numbers[64] = {0};
    write_text("train_config", "grid", grid);
    write_text("train_config", "basis", basis);
    write_text("train_config", "described", described);
    write_text("train_log", "rows", rows);
    write_text("train_log", "headless", "\2xiteration,stage\n1,2\n");
    for (char k = 0; k < 4; k++) {
        const char kind[6] = {'m', k, (char)(0x15 << k), (char)k, 1, 7};
        char name[32];
        snprintf(name, sizeof name, "network-%d", k);
        write_parts("trainer", name, kind, sizeof kind, numbers, sizeof numbers);
    }
    char *text = model_builder_description('n');
    const char options[] = {'t', 3, 1, 1, 7, 0};
    write_parts("trainer", "described", options, sizeof options, text, strlen(text));
    free(text);
    const float weights[] = {0.1f, 0.2f, 0.3f, 0.05f}; /* moments are positive */
    const unsigned char iteration[9] = {'w', 3};
    write_parts("checkpoint", "numbers", iteration, sizeof iteration, weights, sizeof weights);
    write_text("checkpoint", "header",
               "h{\"__metadata__\":{\"format\":\"ascc.trainer\",\"version\":\"1\",\"iteration\":"
               "\"3\",\"network\":\"0\"},\"weights\":{\"dtype\":\"F32\",\"shape\":[1],"
               "\"data_offsets\":[0,4]}}\xff"
               "0123");
}

/* ---- Arguments ---- */

static void write_arguments(void)
{
    static const char *const lines[] = {
        "sim\ndemo\nfree-fall-2d\n-n\n2\n--size\n4\n--dt\n0.005\n--gravity\n0,-9.8",
        "sim\nm\ns\n-n\n3\n-o\nout\n--every\n2\n--threads\n2\n--ply\np\n--frames\nf",
        "sim\nm\ns\n-n\n1\n--velocity\ndifference\n--spacing\n0.1",
        "sim\ndemo\ndam-break\n-n\n99999999999999999999",
        "info\ns",
        "info\nm",
        "show\ns\n-o\nf\n--every\n2",
        "generate\nwbc2d\n--seed\n3\n--count\n2\n--frames\n4\n--dimension\n2\n--spacing\n0.1",
        "lint\n--speed\n1.5\n--clump\n0.1\n--worst\n0.2\ns",
        "eval\nballistic\ns",
        "eval\nm\ns\n--frames\n1,2\n--quiet\n--no-rollout\n--threads\n2",
        "eval\nsph:2\ns\n--transport",
        "eval\npbf\ns",
        "train\nc\n--resume\n--iterations\n3\n--threads\n2",
        "train\n--help",
        "convert\nm\n-o\nout",
        "sim\n--help"};
    for (size_t i = 0; i < sizeof lines / sizeof *lines; i++) {
        char name[32];
        snprintf(name, sizeof name, "line-%zu", i);
        write_text("arguments", name, lines[i]);
    }
}

int main(int argc, char **argv)
{
    if (argc != 2) {
        fprintf(stderr, "usage: make_corpus FOLDER\n");
        return 2;
    }
    folder = argv[1];
    (void)mkdir(folder, 0777);
    write_models();
    write_json();
    for (int dimension = 2; dimension <= 3; dimension++)
        for (int walls = 0; walls < 2; walls++)
            write_snapshot(dimension, walls);
    write_sequence("2d", 2, 2, 1);
    write_sequence("3d", 3, 2, 2);
    write_training();
    write_arguments();
    return failures != 0;
}
