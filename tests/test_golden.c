/* Published arithmetic: tiny convolutions, every layer and rollouts of the pretrained networks.
 * SPDX-License-Identifier: MIT */
#include <math.h>

#include "network/operations.h"
#include "model/model.h"
#include "network/pair_sum.h"
#include "points/resample.h"
#include "host.h"
#include "support/golden.h"

#define LAYER_TOLERANCE 2e-5 /* of the layer's largest value */

static double largest(const double *x, size_t count)
{
    double m = 0.0;
    for (size_t i = 0; i < count; i++)
        m = fmax(m, fabs(x[i]));
    return m;
}

/* ---- Tiny convolutions ---- */

static const char *text_of(golden *g, const char *key)
{
    const char *text = ascc_safetensors_metadata(&g->file, key);
    assert_non_null(text);
    return text;
}

/* A number or word behind "key": in a flat JSON text. */
static const char *behind(const char *text, const char *key)
{
    const char *at = strstr(text, key);
    assert_non_null(at);
    at = strchr(at + strlen(key), ':') + 1;
    while (*at == ' ' || *at == '"')
        at++;
    return at;
}

typedef struct small_case {
    ascc_plan plan;
    ascc_layer layer;
    ascc_term term;
    float *kernel, *feature;
    double *points, *queries, *output;
    size_t point_count, query_count;
    bool antisymmetric;
} small_case;

static float *as_floats(double *x, size_t count)
{
    float *f = malloc((count + 1) * sizeof *f);
    for (size_t i = 0; i < count; i++)
        f[i] = (float)x[i];
    free(x);
    return f;
}

/* The stored half and its negated point mirror, joined along an axis [z, y, x]. */
static float *whole_kernel(const float *half, const size_t shape[5], int axis, size_t whole[5])
{
    memcpy(whole, shape, 5 * sizeof *whole);
    whole[axis] *= 2;
    const size_t channels = shape[3] * shape[4];
    float *k = malloc(whole[0] * whole[1] * whole[2] * channels * sizeof *k);
    for (size_t z = 0; z < whole[0]; z++)
        for (size_t y = 0; y < whole[1]; y++)
            for (size_t x = 0; x < whole[2]; x++) {
                size_t at[3] = {z, y, x};
                const bool upper = at[axis] >= shape[axis];
                if (upper)
                    at[axis] -= shape[axis];
                else
                    for (int c = 0; c < 3; c++)
                        at[c] = (c == axis ? shape[c] : whole[c]) - 1 - at[c];
                for (size_t i = 0; i < channels; i++) {
                    const float v =
                        half[((at[0] * shape[1] + at[1]) * shape[2] + at[2]) * channels + i];
                    k[((z * whole[1] + y) * whole[2] + x) * channels + i] = upper ? v : -v;
                }
            }
    return k;
}

static small_case small_open(golden *g, const char *name)
{
    small_case s = {0};
    char key[96];
    const char *text = text_of(g, name);
#define TENSOR(what) (snprintf(key, sizeof key, "%s." what, name), key)
    size_t count;
    s.points = golden_values(g, TENSOR("points"), &count);
    s.point_count = count / 3;
    s.queries = golden_values(g, TENSOR("queries"), &count);
    s.query_count = count / 3;
    s.output = golden_values(g, TENSOR("output"), NULL);
    double *feature = golden_values(g, TENSOR("features"), &count);
    s.feature = as_floats(feature, count);
    const ascc_tensor *kernel = golden_tensor(g, TENSOR("kernel"));
    size_t shape[5], whole[5];
    memcpy(shape, kernel->shape, sizeof shape);
    memcpy(whole, shape, sizeof whole);
    double *values = golden_values(g, TENSOR("kernel"), &count);
    s.kernel = as_floats(values, count);
    s.antisymmetric = strncmp(behind(text, "\"antisymmetric\""), "true", 4) == 0;
    if (s.antisymmetric) {
        float *half = s.kernel;
        s.kernel = whole_kernel(half, shape, atoi(behind(text, "\"sym_axis\"")), whole);
        free(half);
    }
    const char *window = behind(text, "\"window\""), *mapping = behind(text, "\"mapping\"");
    const ascc_filter filter = {
        .cells = {(int32_t)whole[2], (int32_t)whole[1], (int32_t)whole[0]},
        .radius = (double)(float)atof(behind(text, "\"radius\"")),
        .window = window[0] == 'n'   ? ASCC_WINDOW_NONE
                  : window[1] == 'o' ? ASCC_WINDOW_POLY6
                                     : ASCC_WINDOW_PEAK,
        .mapping = mapping[0] == 'i'                           ? ASCC_MAPPING_IDENTITY
                   : strstr(mapping, "radial") == mapping + 13 ? ASCC_MAPPING_RADIAL
                                                               : ASCC_MAPPING_VOLUME,
        .skip_self = strncmp(behind(text, "\"ignore_query_point\""), "true", 4) == 0};
    s.term = (ascc_term){.operation = &ascc_op_grid,
                         .source = 1,
                         .inputs = (int32_t)whole[3],
                         .gathered = (int32_t)whole[3],
                         .outputs = (int32_t)whole[4],
                         .filter = filter};
    s.plan.dimension = 3;
    s.plan.level_count = 1;
    s.plan.time_step = 1.0;
    s.plan.spacing = 0.05;
    return s;
}

static void small_close(small_case *s)
{
    free(s->kernel);
    free(s->feature);
    free(s->points);
    free(s->queries);
    free(s->output);
}

/* One convolution, boundary points to fluid queries; or one antisymmetric layer over the fluid. */
static void run_small(small_case *s, test_tools *t, double *got)
{
    const int32_t a = s->term.inputs, b = s->term.outputs;
    float *zeros = calloc(s->point_count + s->query_count + 1, sizeof *zeros);
    ascc_plan *p = &s->plan;
    p->fluid_channels = s->antisymmetric ? a : 1;
    p->boundary_channels = s->antisymmetric ? 1 : a;
    s->term.tensor[ASCC_TENSOR_WEIGHT] = s->kernel;
    if (s->antisymmetric) {
        p->output = (ascc_output){.term = {.operation = &ascc_op_pairs_grid,
                                           .inputs = a,
                                           .outputs = b,
                                           .filter = s->term.filter,
                                           .tensor = {s->kernel}},
                                  .conserves = 1,
                                  .half_axis = -1,
                                  .scale = {1.0, 1.0, 1.0}};
    } else {
        s->layer = (ascc_layer){.set = ASCC_SET_FLUID, .channels = b, .term_count = 1};
        p->layer = &s->layer;
        p->term = &s->term;
        p->layer_count = p->term_count = 1;
        p->output.term =
            (ascc_term){.operation = &ascc_op_plain, .source = 2, .inputs = b, .outputs = b};
    }
    const ascc_scene scene = {.fluid_count = s->query_count,
                              .boundary_count = s->antisymmetric ? 0 : s->point_count,
                              .fluid = s->queries,
                              .boundary = s->points};
    ascc_packed packed;
    ascc_network network;
    ascc_hierarchy h;
    ascc_network_run run;
    assert_int_equal(ascc_packed_create(&packed, &t->context->allocator, p, &t->message), ASCC_OK);
    assert_int_equal(
        ascc_network_create(&network, &t->context->allocator, p, &packed, 4096, &t->message),
        ASCC_OK);
    assert_int_equal(ascc_hierarchy_build(&h, &t->search, p, &scene), ASCC_OK);
    assert_int_equal(ascc_network_demand(&run, &network, &h, &t->search, NULL), ASCC_OK);
    assert_int_equal(ascc_network_forward(&run, s->antisymmetric ? s->feature : zeros,
                                          s->antisymmetric ? zeros : s->feature),
                     ASCC_OK);
    if (s->antisymmetric) {
        const double unit = 1e-10;
        double *mass = malloc(s->query_count * sizeof *mass);
        int64_t *impulse = calloc(s->query_count * 3, sizeof *impulse);
        for (size_t i = 0; i < s->query_count; i++)
            mass[i] = 1.0;
        const ascc_impulse_scale scale = {.mass = mass,
                                          .factor = {1.0 / unit, 1.0 / unit, 1.0 / unit}};
        const ascc_impulses impulses = {impulse, NULL};
        uint64_t pairs;
        assert_int_equal(ascc_op_pairs_grid.impulses(&run, &scale, &impulses, &pairs), ASCC_OK);
        int64_t sum[3] = {0};
        for (size_t i = 0; i < s->query_count * 3; i++) {
            got[i] = (double)impulse[i] * unit;
            sum[i % 3] += impulse[i];
        }
        assert_true(sum[0] == 0 && sum[1] == 0 && sum[2] == 0);
        free(mass);
        free(impulse);
    } else {
        for (size_t i = 0; i < s->query_count; i++) {
            const size_t row = h.origin[h.whole[0][i]];
            for (int32_t c = 0; c < b; c++)
                got[row * (size_t)b + (size_t)c] =
                    (double)run.value[2].raw[i * ascc_padded(b) + (size_t)c];
        }
    }
    ascc_network_destroy(&network);
    ascc_packed_destroy(&packed, &t->context->allocator);
    free(zeros);
}

static void tiny_convolutions_match_on_every_cpu(void **state)
{
    (void)state;
    static const char *names[] = {
        "basic_444",     "basic_666_peak",   "noncubic_543", "planar_188",    "odd_333_nowindow",
        "k111",          "special_444",      "radial_444",   "identity_444",  "empty_neighborhood",
        "no_points",     "self_included",    "self_ignored", "antisym_axis0", "antisym_axis1",
        "antisym_axis2", "antisym_444_poly6"};
    golden g;
    assert_true(golden_open(&g, SOURCE_ROOT "/tests/data/small-conv-golden.safetensors"));
    for (size_t n = 0; n < sizeof names / sizeof *names; n++)
        for (int variant = 0; variant < 2; variant++) {
            test_tools t;
            tools_open(&t, 1, variant ? ASCC_CPU_AVX2 : 0);
            small_case s = small_open(&g, names[n]);
            const size_t count = s.query_count * (size_t)s.term.outputs;
            double *got = calloc(count + 1, sizeof *got);
            run_small(&s, &t, got);
            const double scale = fmax(largest(s.output, count), 1e-30);
            for (size_t i = 0; i < count; i++)
                if (!(fabs(got[i] - s.output[i]) <= LAYER_TOLERANCE * scale))
                    fail_msg("%s: index %zu: %.9g, expected %.9g", names[n], i, got[i],
                             s.output[i]);
            free(got);
            small_close(&s);
            tools_close(&t);
        }
    golden_close(&g);
}

/* ---- Sampling ---- */

static void sampled_points_match_as_sets(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double voxel;
    } cases[] = {{"sampling_small", 0.05}, {"sampling_one", 0.1}, {"sampling_wide", 0.1}};
    golden g;
    assert_true(golden_open(&g, SOURCE_ROOT "/tests/data/small-conv-golden.safetensors"));
    for (size_t n = 0; n < 3; n++) {
        test_tools t;
        tools_open(&t, 1, 0);
        char key[96];
        size_t count, nodes;
        snprintf(key, sizeof key, "%s.points", cases[n].name);
        double *x = golden_values(&g, key, &count);
        snprintf(key, sizeof key, "%s.position", cases[n].name);
        double *want = golden_values(&g, key, &nodes);
        nodes /= 3;
        const ascc_scale scale = ascc_scale_for_radius(0.4);
        const ascc_points points = points_of(&t, &scale, x, count / 3, 3);
        double anchor[3];
        ascc_centroid(&points, anchor);
        ascc_points samples;
        assert_int_equal(ascc_sample_corners(&samples, &t.search, &points, 3,
                                             (double)(float)cases[n].voxel * scale.inverse, 0.1,
                                             anchor),
                         ASCC_OK);
        assert_int_equal(samples.count, nodes);
        for (size_t k = 0; k < nodes; k++) {
            bool found = false;
            for (size_t i = 0; i < nodes && !found; i++) {
                found = true;
                for (size_t c = 0; c < 3; c++)
                    found &=
                        fabs((double)samples.position[c][i] * scale.unit - want[k * 3 + c]) < 1e-7;
            }
            assert_true(found);
        }
        free(x);
        free(want);
        tools_close(&t);
    }
    golden_close(&g);
}

/* ---- Whole networks ---- */

typedef struct network_case {
    golden g;
    ascc_context *context;
    ascc_model *model;
    double *fluid, *velocity, *wall, *normal; /* inputs */
    size_t fluid_count, wall_count;
    double time_step, gravity[3];
} network_case;

static bool network_open(network_case *n, const char *model, const char *scene, bool weightless)
{
    char path[512], name[96];
    memset(n, 0, sizeof *n);
    snprintf(name, sizeof name, "golden/golden-%s-%s.safetensors", model, scene);
    if (!golden_open(&n->g, shared_path(path, sizeof path, name)))
        return false;
    assert_int_equal(ascc_context_create(NULL, &n->context), ASCC_OK);
    snprintf(name, sizeof name, "weights/%s-liquid3d.safetensors", model);
    ascc_host_error why;
    if (ascc_host_load(n->context, shared_path(path, sizeof path, name), &n->model, &why) !=
        ASCC_OK)
        fail_msg("%s: %s", path, why.text);
    size_t count;
    n->fluid = golden_values(&n->g, "fluid.position", &count);
    n->velocity = golden_values(&n->g, "fluid.velocity", NULL);
    n->fluid_count = count / 3;
    n->wall = golden_values(&n->g, "boundary.position", &count);
    n->normal = golden_values(&n->g, "boundary.normal", NULL);
    n->wall_count = count / 3;
    n->time_step = (double)0.02f; /* the goldens' float32 constants */
    n->gravity[1] = weightless ? 0.0 : (double)-9.81f;
    return true;
}

static void network_close(network_case *n)
{
    free(n->fluid);
    free(n->velocity);
    free(n->wall);
    free(n->normal);
    ascc_model_destroy(&n->model);
    ascc_context_destroy(&n->context);
    golden_close(&n->g);
}

/* Runs one step's network on the golden's own advected positions and velocities. */
static void run_layers(network_case *n, test_tools *t, ascc_network *network, ascc_hierarchy *h,
                       ascc_network_run *run)
{
    const ascc_plan *p = &n->model->plan;
    double *x = golden_values(&n->g, "step1.pos_advected", NULL);
    double *v = golden_values(&n->g, "step1.vel_advected", NULL);
    const size_t a = (size_t)p->fluid_channels, b = (size_t)p->boundary_channels;
    float *fluid = malloc((n->fluid_count * a + 1) * sizeof *fluid);
    float *wall = malloc((n->wall_count * b + 1) * sizeof *wall);
    for (size_t i = 0; i < n->fluid_count; i++)
        for (size_t c = 0; c < a; c++)
            fluid[i * a + c] = c == 0 ? 1.0f : (float)v[i * 3 + c - 1];
    for (size_t i = 0; i < n->wall_count; i++)
        for (size_t c = 0; c < b; c++)
            wall[i * b + c] = b == 3   ? (float)n->normal[i * 3 + c]
                              : c == 0 ? 1.0f
                                       : (float)n->normal[i * 3 + c - 1];
    const ascc_scene scene = {.fluid_count = n->fluid_count,
                              .boundary_count = n->wall_count,
                              .fluid = x,
                              .boundary = n->wall};
    assert_int_equal(ascc_network_create(network, &t->context->allocator, p, &n->model->packed,
                                         8192, &t->message),
                     ASCC_OK);
    network->keeps_values = true;
    assert_int_equal(ascc_hierarchy_build(h, &t->search, p, &scene), ASCC_OK);
    assert_int_equal(ascc_network_demand(run, network, h, &t->search, NULL), ASCC_OK);
    assert_int_equal(ascc_network_forward(run, fluid, wall), ASCC_OK);
    free(x);
    free(v);
    free(fluid);
    free(wall);
}

/* The golden's row of a row of a set: fluid then kept boundary in input order, or a node found by
 * its position. */
static size_t golden_row(const network_case *n, const ascc_hierarchy *h, int set, size_t row,
                         const size_t *kept_row, const double *nodes, size_t node_count)
{
    if (set <= ASCC_SET_ALL) {
        const size_t host = h->origin[set == ASCC_SET_ALL ? row : h->whole[set][row]];
        return host < n->fluid_count ? host : n->fluid_count + kept_row[host - n->fluid_count];
    }
    for (size_t k = 0; k < node_count; k++) {
        bool same = true;
        for (size_t c = 0; c < 3; c++)
            same &= fabs((double)h->set[set].position[c][row] * h->scale.unit - nodes[k * 3 + c]) <
                    1e-6;
        if (same)
            return k;
    }
    fail_msg("a coarse point is not among the golden ones");
    return 0;
}

/* Compares columns of a computed value with a golden tensor; only rows that reach the fluid are
 * computed, so only those are compared. Returns how many. */
static size_t compare_value(const network_case *n, const ascc_network_run *run, int32_t v,
                            size_t column, const char *tensor, const size_t *kept_row)
{
    char key[96];
    const ascc_hierarchy *h = run->hierarchy;
    const int set = ascc_network_set(run->network, v);
    const size_t stride = ascc_padded(ascc_network_channels(run->network, v));
    size_t count, node_count = 0;
    double *want = golden_values(&n->g, tensor, &count);
    double *nodes = NULL;
    if (set >= ASCC_SET_LEVEL) {
        snprintf(key, sizeof key, "step1.branch%d.pos", set - ASCC_SET_LEVEL + 1);
        nodes = golden_values(&n->g, key, &node_count);
        node_count /= 3;
        assert_int_equal(node_count, h->set[set].count);
    }
    const ascc_tensor *t = golden_tensor(&n->g, tensor);
    const size_t width = t->shape[1];
    const double scale = largest(want, count);
    const float *value = run->value[v].raw ? run->value[v].raw : run->value[v].rectified;
    size_t compared = 0;
    for (size_t i = 0; i < h->set[set].count; i++) {
        if (!run->value[v].active[i])
            continue;
        const size_t row = golden_row(n, h, set, i, kept_row, nodes, node_count);
        for (size_t c = 0; c < width; c++) {
            double expected = want[row * width + c];
            if (!run->value[v].raw && expected < 0.0)
                expected = 0.0;
            const double got = (double)value[i * stride + column + c];
            if (!(fabs(got - expected) <= LAYER_TOLERANCE * scale))
                fail_msg("%s: row %zu column %zu: %.9g, expected %.9g (largest %.3g)", tensor, row,
                         c, got, expected, scale);
        }
        compared++;
    }
    free(want);
    free(nodes);
    return compared;
}

static int32_t value_named(const network_case *n, const char *name)
{
    for (int32_t l = 0; l < n->model->plan.layer_count; l++)
        if (strcmp(n->model->plan.layer[l].name, name) == 0)
            return l + 2;
    fail_msg("the model has no layer %s", name);
    return -1;
}

static size_t *kept_rows(const network_case *n)
{
    size_t count = 0, next = 0;
    size_t *row = calloc(n->wall_count + 1, sizeof *row);
    if (!golden_tensor(&n->g, "step1.boundary_kept"))
        return row;
    double *kept = golden_values(&n->g, "step1.boundary_kept", &count);
    for (size_t i = 0; i < count; i++)
        row[i] = kept[i] != 0.0 ? next++ : SIZE_MAX;
    free(kept);
    return row;
}

static void dmcf_layers(const char *scene, bool weightless, int32_t threads)
{
    static const struct {
        const char *layer, *tensor;
        size_t column;
    } values[] = {{"l0", "step1.l0.conv_fluid", 0},  {"l0", "step1.l0.conv_obstacle", 8},
                  {"l0", "step1.l0.dense", 16},      {"l1.out_0", "step1.l1.out_0", 0},
                  {"l1.out_1", "step1.l1.out_1", 0}, {"l1.out_2", "step1.l1.out_2", 0},
                  {"l2.out_0", "step1.l2.out_0", 0}, {"l2.out_1", "step1.l2.out_1", 0},
                  {"l2.out_2", "step1.l2.out_2", 0}, {"l3.out_0", "step1.l3.out_0", 0}};
    network_case n;
    if (!network_open(&n, "dmcf", scene, weightless))
        skip();
    test_tools t;
    tools_open(&t, threads, 0);
    ascc_network network;
    ascc_hierarchy h;
    ascc_network_run run;
    run_layers(&n, &t, &network, &h, &run);
    size_t *kept = kept_rows(&n);
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        assert_true(compare_value(&n, &run, value_named(&n, values[i].layer), values[i].column,
                                  values[i].tensor, kept) > 0);
    free(kept);
    ascc_network_destroy(&network);
    tools_close(&t);
    network_close(&n);
}

static void every_dmcf_layer_matches_in_a_box(void **state)
{
    (void)state;
    dmcf_layers("a", false, 1);
}

static void every_dmcf_layer_matches_in_free_space(void **state)
{
    (void)state;
    dmcf_layers("b", true, 3);
}

static void cconv_layers(const char *scene, bool weightless)
{
    static const struct {
        const char *layer, *tensor;
        size_t column;
    } values[] = {{"A0", "step1.l0.conv_obstacle", 0}, {"A0", "step1.l0.conv_fluid", 32},
                  {"A0", "step1.l0.dense_fluid", 64},  {"A1", "step1.l1.out", 0},
                  {"A2", "step1.l2.out", 0},           {"A3", "step1.l3.out", 0}};
    network_case n;
    if (!network_open(&n, "cconv", scene, weightless))
        skip();
    test_tools t;
    tools_open(&t, 2, 0);
    ascc_network network;
    ascc_hierarchy h;
    ascc_network_run run;
    run_layers(&n, &t, &network, &h, &run);
    size_t *kept = kept_rows(&n);
    for (size_t i = 0; i < sizeof values / sizeof *values; i++)
        assert_int_equal(compare_value(&n, &run, value_named(&n, values[i].layer), values[i].column,
                                       values[i].tensor, kept),
                         n.fluid_count);
    free(kept);
    ascc_network_destroy(&network);
    tools_close(&t);
    network_close(&n);
}

static void every_cconv_layer_matches_in_a_box(void **state)
{
    (void)state;
    cconv_layers("a", false);
}

static void every_cconv_layer_matches_in_free_space(void **state)
{
    (void)state;
    cconv_layers("b", true);
}

/* ---- Rollouts through the public API ---- */

static ascc_particles *golden_particles(const network_case *n)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 3, .spacing = 0.05, .mass = 0.125};
    ascc_particles *p;
    assert_int_equal(ascc_particles_create(n->context, &options, &p), ASCC_OK);
    const ascc_const_array x = {.data = n->fluid, .scalar = ASCC_DOUBLE};
    const ascc_const_array v = {.data = n->velocity, .scalar = ASCC_DOUBLE};
    const ascc_const_array w = {.data = n->wall, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = n->normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(p, n->fluid_count, &x, &v, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, n->wall_count, &w, &normal, 0, NULL), ASCC_OK);
    return p;
}

/* Largest difference of positions from the golden rollout after `steps` steps, metres. */
static double rollout_difference(const network_case *n, const ascc_particles *p, int steps)
{
    char key[64];
    snprintf(key, sizeof key, "rollout.position.%d", steps);
    double *want = golden_values(&n->g, key, NULL);
    double *got = malloc(n->fluid_count * 3 * sizeof *got);
    const ascc_array x = {.data = got, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(p, ASCC_FLUID, ASCC_POSITION, 0, n->fluid_count, &x),
                     ASCC_OK);
    double difference = 0.0;
    for (size_t i = 0; i < n->fluid_count * 3; i++)
        difference = fmax(difference, fabs(got[i] - want[i]));
    free(got);
    free(want);
    return difference;
}

/* bounds: after 1, 2, 5, 10, 20 steps; a few times what float32 costs the reference. */
static void check_rollout(const char *model, const char *scene, bool weightless, int last,
                          const double bounds[5])
{
    static const int marks[5] = {1, 2, 5, 10, 20};
    network_case n;
    if (!network_open(&n, model, scene, weightless))
        skip();
    ascc_particles *p = golden_particles(&n);
    ascc_step *step;
    const ascc_step_options options = {
        .size = sizeof options, .time_step = n.time_step, .substeps = -1};
    const ascc_forces forces = {.size = sizeof forces, .gravity = n.gravity};
    assert_int_equal(ascc_step_create(n.context, n.model, &options, &step), ASCC_OK);
    for (int done = 0, m = 0; m < 5 && marks[m] <= last; m++) {
        if (ascc_step_run(step, p, &forces, marks[m] - done) != ASCC_OK)
            fail_msg("%s %s: %s", model, scene, ascc_step_message(step));
        done = marks[m];
        const double difference = rollout_difference(&n, p, done);
        print_message("%s %s: %d steps: %.2g m\n", model, scene, done, difference);
        assert_true(difference < bounds[m]);
    }
    ascc_step_destroy(&step);
    ascc_particles_destroy(&p);
    network_close(&n);
}

static void the_dmcf_rollout_matches_in_a_box(void **state)
{
    (void)state;
    check_rollout("dmcf", "a", false, 20, (const double[]){1e-7, 2e-7, 2e-6, 6e-6, 6e-5});
}

static void the_dmcf_rollout_matches_in_free_space(void **state)
{
    (void)state;
    check_rollout("dmcf", "b", true, 20, (const double[]){2e-7, 5e-7, 2e-6, 6e-6, 2e-5});
}

static void the_dmcf_rollout_matches_in_the_canyon(void **state)
{
    (void)state;
    check_rollout("dmcf", "canyon", false, 5, (const double[]){1e-6, 3e-6, 6e-5, 0, 0});
}

static void the_cconv_rollout_matches_in_a_box(void **state)
{
    (void)state;
    check_rollout("cconv", "a", false, 20, (const double[]){1e-7, 3e-7, 1e-6, 5e-6, 4e-5});
}

static void the_cconv_rollout_matches_in_free_space(void **state)
{
    (void)state;
    check_rollout("cconv", "b", true, 20, (const double[]){2e-7, 3e-7, 2e-6, 5e-6, 2e-5});
}

static void the_cconv_rollout_matches_in_the_canyon(void **state)
{
    (void)state;
    check_rollout("cconv", "canyon", false, 5, (const double[]){1e-6, 3e-6, 6e-5, 0, 0});
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tiny_convolutions_match_on_every_cpu),
        cmocka_unit_test(sampled_points_match_as_sets),
        cmocka_unit_test(every_dmcf_layer_matches_in_a_box),
        cmocka_unit_test(every_dmcf_layer_matches_in_free_space),
        cmocka_unit_test(every_cconv_layer_matches_in_a_box),
        cmocka_unit_test(every_cconv_layer_matches_in_free_space),
        cmocka_unit_test(the_dmcf_rollout_matches_in_a_box),
        cmocka_unit_test(the_dmcf_rollout_matches_in_free_space),
        cmocka_unit_test(the_dmcf_rollout_matches_in_the_canyon),
        cmocka_unit_test(the_cconv_rollout_matches_in_a_box),
        cmocka_unit_test(the_cconv_rollout_matches_in_free_space),
        cmocka_unit_test(the_cconv_rollout_matches_in_the_canyon),
    };
    return cmocka_run_group_tests_name("golden", tests, NULL, NULL);
}
