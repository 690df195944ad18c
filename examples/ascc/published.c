/* The published pretrained networks as model files. SPDX-License-Identifier: MIT */
#include "published.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "members.h"
#include "network_writer.h"
#include "system.h"
#include "tensor_file.h"

#define SPACINGS_PER_EXTENT 4.5 /* CConv: a filter reaches across 9 particle radii */
#define REST_DENSITY 1000.0     /* water: what both were trained on; their files do not say */

/* Limits of a model file. */
enum { MAX_LEVELS = 8, MAX_CHANNELS = 1024, MAX_CELLS = 4096 };
static const double SMALLEST = 1e-15, LARGEST = 1e15;

static const struct word {
    const char *text, *word;
} windows[] = {{"poly6: clip((1-q)^3,0,1), q=d^2/r^2", "poly6"},
               {"peak: (1-sqrt(q))^2", "peak"},
               {"none", "none"}},
  mappings[] = {{"ball_to_cube_volume_preserving", "volume"},
                {"ball_to_cube_radial", "radial"},
                {"identity", "identity"}},
  integrations[] = {
      {"v2=v1+dt*g; p2=p1+dt*v2; p=p2+correction; v=(p-p1)/dt", "advected"},
      {"v2=v1+dt*g; p2=p1+dt*(v1+v2)/2; p=p2+correction; v=(p-p1)/dt", "advected_mean"}};
#define WORDS(list) (list), sizeof(list) / sizeof *(list)

/* Widths of the branches of one layer; 0 = the branch has none. */
typedef struct widths {
    int of[MAX_LEVELS];
} widths;

/* How all convolutions but the last look around a point. */
typedef struct filter {
    double cells[3]; /* z, y, x */
    const char *window, *mapping;
    bool skip_self;
} filter;

typedef struct published {
    ascc_members m;
    ascc_network_writer w;
    const json_t *header;
    size_t dimension;
    int levels; /* the particles included */
    double radius[MAX_LEVELS];
    double time_step, gravity[3], scale[3];
    filter filter;
} published;

/* ---- Sentences ---------------------------------------------------------------------------------- */

/* Reads the number that a text begins with, as JSON has it: its length, 0 = none. */
static size_t number_at(const char *text, double *number)
{
    json_error_t end;
    json_t *value =
        json_loadb(text, strlen(text),
                   JSON_DECODE_ANY | JSON_DECODE_INT_AS_REAL | JSON_DISABLE_EOF_CHECK, &end);
    const size_t length = json_is_number(value) && text[0] > ' ' ? (size_t)end.position : 0;
    *number = json_number_value(value);
    json_decref(value);
    return length;
}

/* Matches the beginning of a text: '#' stands for a number, '@' for one of digits only, which are
 * stored in turn. Returns what follows, NULL = no match. */
static const char *match(const char *text, const char *pattern, double *number)
{
    for (; *pattern != '\0'; pattern++) {
        if (*pattern == '#') {
            const size_t length = number_at(text, number++);
            if (length == 0)
                return NULL;
            text += length;
        } else if (*pattern == '@') {
            if (*text < '0' || *text > '9')
                return NULL;
            for (*number = 0.0; *text >= '0' && *text <= '9' && *number < 1e6; text++)
                *number = *number * 10.0 + (*text - '0');
            number++;
        } else if (*text++ != *pattern) {
            return NULL;
        }
    }
    return text;
}

static bool match_all(const char *text, const char *pattern, double *number)
{
    const char *rest = match(text, pattern, number);
    return rest && *rest == '\0';
}

/* Adds to a text of limited size; what does not fit makes it differ from any other. */
static void append(char *text, size_t capacity, const char *format, ...) ASCC_FORMAT(3, 4);
static void append(char *text, size_t capacity, const char *format, ...)
{
    const size_t length = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    (void)vsnprintf(text + length, capacity - length, format, arguments);
    va_end(arguments);
}

static void refuse_text(published *p, const char *key, const char *text)
{
    ascc_members_fail(&p->m, "'%s' is not understood: '%.70s'", key, text);
}

static void expect_text(published *p, json_t *object, const char *key, const char *expected)
{
    const char *text = ascc_members_text(&p->m, object, key);
    if (strcmp(text, expected) != 0)
        refuse_text(p, key, text);
}

static void expect_flag(published *p, json_t *object, const char *key, bool expected)
{
    if (ascc_members_flag(&p->m, object, key) != expected)
        ascc_members_fail(&p->m, "'%s' must be %s", key, expected ? "true" : "false");
}

/* The model file's word for one of the sentences known. */
static const char *read_word(published *p, json_t *object, const char *key, const struct word *word,
                             size_t count)
{
    const char *text = ascc_members_text(&p->m, object, key);
    for (size_t i = 0; i < count; i++)
        if (strcmp(text, word[i].text) == 0)
            return word[i].word;
    refuse_text(p, key, text);
    return "";
}

/* ---- The description being made ----------------------------------------------------------------- */

/* cells[z, y, x] as x, y, z. */
static void put_cells(published *p, json_t *object, const double cells[3])
{
    json_t *list = ascc_network_put(&p->w, object, "cells", json_array());
    for (int axis = 2; axis >= 0; axis--)
        (void)ascc_network_append(&p->w, list, json_integer((json_int_t)cells[axis]));
}

static void put_filter(published *p, json_t *object, double radius, const filter *f)
{
    (void)ascc_network_put(&p->w, object, "radius", json_real(radius));
    ascc_network_put_text(&p->w, object, "window", f->window);
    ascc_network_put_text(&p->w, object, "mapping", f->mapping);
}

/* The shape of a tensor that must have `rank` dimensions; false after a fault. */
static bool shape_of(published *p, const char *name, size_t rank, double *shape)
{
    const json_t *list = json_object_get(json_object_get(p->header, name), "shape");
    if (!list)
        ascc_members_fail(&p->m, "tensor '%s' is missing", name);
    else if (json_array_size(list) != rank)
        ascc_members_fail(&p->m, "tensor '%s' has %zu dimensions, but must have %zu", name,
                          json_array_size(list), rank);
    for (size_t i = 0; i < rank; i++)
        shape[i] = json_number_value(json_array_get(list, i));
    return ascc_members_good(&p->m);
}

/* Names the tensors name.kernel and name.bias, which must give the channels stated. */
static void put_weights(published *p, json_t *term, const char *key, const char *name, int outputs,
                        bool cells)
{
    const size_t rank = cells ? 5 : 2;
    char kernel[48], bias[48];
    double shape[5];
    (void)snprintf(kernel, sizeof kernel, "%.40s.kernel", name);
    (void)snprintf(bias, sizeof bias, "%.40s.bias", name);
    ascc_network_put_text(&p->w, term, key, kernel);
    ascc_network_put_text(&p->w, term, "bias", bias);
    if (!shape_of(p, kernel, rank, shape))
        return;
    if (shape[rank - 1] != (double)outputs)
        ascc_members_fail(&p->m, "'%s' gives %g channels, but %d are stated", name, shape[rank - 1],
                          outputs);
    if (cells && memcmp(shape, p->filter.cells, sizeof p->filter.cells) != 0)
        ascc_members_fail(&p->m, "'%s' is not of the 'kernel_size' stated", name);
    (void)ascc_network_put(&p->w, term, "outputs", json_integer(outputs));
    if (cells)
        put_cells(p, term, shape);
}

static void add_convolution(published *p, const char *name, const char *source, bool relu,
                            int column, int outputs, double radius)
{
    json_t *term = ascc_network_add_term(&p->w, "convolution", source, relu, column);
    put_weights(p, term, "kernel", name, outputs, true);
    put_filter(p, term, radius, &p->filter);
    if (p->filter.skip_self)
        (void)ascc_network_put(&p->w, term, "skip_self", json_true());
}

static void add_dense(published *p, const char *name, const char *source, bool relu, int column,
                      int outputs)
{
    put_weights(p, ascc_network_add_term(&p->w, "dense", source, relu, column), "weight", name,
                outputs, false);
}

static json_t *add_output(published *p, const char *type, const char *source)
{
    json_t *output = ascc_network_put(&p->w, p->w.network, "output", json_object());
    ascc_network_put_text(&p->w, output, "type", type);
    ascc_network_put_text(&p->w, output, "source", source);
    ascc_network_put_numbers(&p->w, output, "scale", p->dimension, p->scale);
    return output;
}

/* ---- What both networks state ------------------------------------------------------------------- */

static double read_length(published *p, json_t *object, const char *key)
{
    return ascc_members_number(&p->m, object, key, SMALLEST, LARGEST);
}

/* As tensors are stored: z, y, x. */
static void read_cells(published *p, json_t *object, double cells[3])
{
    cells[0] = cells[1] = cells[2] = 1.0;
    ascc_members_numbers(&p->m, object, "kernel_size", 3, 1.0, MAX_CELLS, cells);
    for (int i = 0; i < 3; i++)
        if (cells[i] != floor(cells[i]))
            ascc_members_fail(&p->m, "'kernel_size' must be whole numbers");
}

/* "1" is the constant, prefix.x, prefix.y ... the components of a vector. */
static void read_features(published *p, json_t *object, const char *whose, const char *prefix,
                          const char *vector)
{
    const json_t *list = ascc_members_array(&p->m, object, whose);
    json_t *made =
        ascc_network_put(&p->w, json_object_get(p->w.network, "features"), whose, json_array());
    size_t component = 0;
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *text = json_string_value(json_array_get(list, i));
        char expected[16];
        (void)snprintf(expected, sizeof expected, "%s.%c", prefix, "xyz"[component]);
        const bool one = component == 0 && text && strcmp(text, "1") == 0;
        if (!one && (!text || strcmp(text, expected) != 0))
            ascc_members_fail(&p->m, "feature '%.70s' of '%s' is not understood", text ? text : "",
                              whose);
        else if (one)
            (void)ascc_network_append(&p->w, made, json_string("one"));
        else if (component == 0)
            (void)ascc_network_append(&p->w, made, json_string(vector));
        if (!ascc_members_good(&p->m))
            break;
        component = one ? 0 : (component + 1) % p->dimension;
    }
    if (component != 0)
        ascc_members_fail(&p->m, "'%s' ends within a vector", whose);
}

/* Both lists; what else the section holds is left in it. */
static json_t *read_feature_lists(published *p, json_t *root)
{
    json_t *object = ascc_members_object(&p->m, root, "features");
    (void)ascc_network_put(&p->w, p->w.network, "features", json_object());
    ascc_members_where(&p->m, "architecture 'features'");
    read_features(p, object, "fluid", "v2", "velocity");
    read_features(p, object, "boundary", "n", "normal");
    return object;
}

static void read_crop(published *p, json_t *root)
{
    double crop[2] = {0.0, 0.0};
    const char *text = ascc_members_text(&p->m, root, "boundary_crop");
    if (strcmp(text, "none") == 0)
        return;
    if (!match_all(text, "keep b iff min(p2)-# <= b <= max(p2)+# per axis", crop) ||
        crop[0] != crop[1] || !(crop[0] > 0.0))
        refuse_text(p, "boundary_crop", text);
    (void)ascc_network_put(&p->w, p->w.network, "boundary_crop", json_real(crop[0]));
}

/* The section "conv": how every convolution but an antisymmetric one works. */
static json_t *read_convolution(published *p, json_t *root)
{
    json_t *object = ascc_members_object(&p->m, root, "conv");
    ascc_members_where(&p->m, "architecture 'conv'");
    read_cells(p, object, p->filter.cells);
    p->filter.window = read_word(p, object, "window", WORDS(windows));
    p->filter.mapping = read_word(p, object, "coordinate_mapping", WORDS(mappings));
    expect_text(p, object, "interpolation", "trilinear, clamped");
    expect_flag(p, object, "align_corners", true);
    expect_flag(p, object, "normalize", false);
    p->filter.skip_self = ascc_members_flag(&p->m, object, "ignore_query_point");
    expect_flag(p, object, "bias", true);
    return object;
}

static void read_head(published *p, json_t *root, const char *name, const char *network)
{
    ascc_network_put_text(&p->w, p->w.network, "name", name ? name : "published");
    ascc_network_put_text(&p->w, p->w.network, "description", network);
    (void)ascc_network_put(&p->w, p->w.network, "dimension",
                           json_integer((json_int_t)p->dimension));
    p->time_step = read_length(p, root, "timestep");
    ascc_members_numbers(&p->m, root, "gravity", p->dimension, -LARGEST, LARGEST, p->gravity);
    ascc_members_numbers(&p->m, root, "out_scale", p->dimension, -LARGEST, LARGEST, p->scale);
    (void)ascc_network_put(&p->w, p->w.network, "time_step", json_real(p->time_step));
    ascc_network_put_numbers(&p->w, p->w.network, "gravity", p->dimension, p->gravity);
    (void)ascc_network_put(&p->w, p->w.network, "rest_density", json_real(REST_DENSITY));
    ascc_network_put_text(&p->w, p->w.network, "evaluate",
                          read_word(p, root, "integration", WORDS(integrations)));
    read_crop(p, root);
    (void)ascc_network_put(&p->w, p->w.network, "layers", json_array());
}

/* ---- DMCF: branches and an antisymmetric last layer --------------------------------------------- */

static void read_branch(published *p, json_t *branch, double base)
{
    const int level = p->levels++;
    ascc_members_where(&p->m, "architecture 'branches' %d", level);
    if (level == MAX_LEVELS || !json_is_object(branch)) {
        ascc_members_fail(&p->m, "too many, or no object");
        return;
    }
    const int stride = ascc_members_integer(&p->m, branch, "stride", 1, 1 << 20);
    p->radius[level] = read_length(p, branch, "radius");
    if (level == 0) {
        expect_text(p, branch, "points", "fluid then kept boundary");
        if (stride != 1)
            ascc_members_fail(&p->m, "'stride' must be 1");
    } else {
        const double voxel = read_length(p, branch, "voxel");
        if (level == 1)
            (void)ascc_network_put(&p->w, p->w.network, "levels", json_array());
        (void)ascc_network_put(
            &p->w,
            ascc_network_append(&p->w, json_object_get(p->w.network, "levels"), json_object()),
            "voxel", json_real(voxel));
        if (fabs(stride * base - voxel) > 1e-9 * voxel)
            ascc_members_fail(&p->m, "'voxel' is not 'stride' times 'base_voxel'");
        if (p->radius[level] < p->radius[level - 1])
            ascc_members_fail(&p->m, "'radius' is less than that of the branch before");
    }
    ascc_members_end(&p->m, branch);
}

/* Returns the base voxel. */
static double read_branches(published *p, json_t *root)
{
    json_t *sampling = ascc_members_object(&p->m, root, "sampling");
    const double base = read_length(p, sampling, "base_voxel");
    expect_flag(p, sampling, "centralize", true);
    const double hysteresis = ascc_members_number(&p->m, sampling, "hysteresis", 0.0, 0.5);
    (void)ascc_members_integer(&p->m, sampling, "pad", 0, 0);
    expect_text(p, sampling, "source", "branch 0 points for every branch");
    ascc_members_end(&p->m, sampling);

    const json_t *list = ascc_members_array(&p->m, root, "branches");
    for (size_t i = 0; i < json_array_size(list) && ascc_members_good(&p->m); i++)
        read_branch(p, json_array_get(list, i), base);
    ascc_members_where(&p->m, "architecture");
    if (p->levels == 0)
        ascc_members_fail(&p->m, "'branches' is empty");
    if (p->levels > 1) {
        json_t *made = ascc_network_put(&p->w, p->w.network, "sampling", json_object());
        ascc_network_put_text(&p->w, made, "method", "voxel_corners");
        ascc_network_put_text(&p->w, made, "anchor", "centroid");
        (void)ascc_network_put(&p->w, made, "hysteresis", json_real(hysteresis));
    }
    return base;
}

static void read_dmcf_features(published *p, json_t *root)
{
    json_t *object = read_feature_lists(p, root);
    expect_flag(p, object, "use_vel", true);
    expect_flag(p, object, "use_acc", false);
    expect_flag(p, object, "use_feats", false);
    expect_flag(p, object, "use_box_feats", true);
    expect_flag(p, object, "density_features", false);
    ascc_members_end(&p->m, object);
    ascc_members_where(&p->m, "architecture");
}

static void read_first_layer(published *p, json_t *object, widths *out)
{
    static const char *const patterns[] = {"conv_fluid(@)", "conv_obstacle(@)",
                                           "dense_fluid|dense_obstacle(@)"};
    int width[3] = {0}, sum = 0;
    expect_text(p, object, "name", "l0");
    out->of[0] = ascc_members_integer(&p->m, object, "out", 1, MAX_CHANNELS);
    const json_t *list = ascc_members_array(&p->m, object, "concat");
    ascc_members_end(&p->m, object);
    for (size_t i = 0; i < 3 && ascc_members_good(&p->m); i++) {
        const char *text = json_string_value(json_array_get(list, i));
        double number = 0.0;
        if (!text || !match_all(text, patterns[i], &number) || number > MAX_CHANNELS)
            ascc_members_fail(&p->m, "'concat' of l0 is not understood");
        width[i] = (int)number;
        sum += width[i];
    }
    if (json_array_size(list) != 3 || sum != out->of[0])
        ascc_members_fail(&p->m, "'concat' of l0 does not add up to 'out'");
    ascc_network_add_layer(&p->w, "l0", 0, true, out->of[0]);
    add_convolution(p, "conv_fluid", "fluid", false, 0, width[0], p->radius[0]);
    add_convolution(p, "conv_obstacle", "boundary", false, width[0], width[1], p->radius[0]);
    const int column = width[0] + width[1];
    add_dense(p, "dense_fluid", "fluid", false, column, width[2]);
    add_dense(p, "dense_obstacle", "boundary", false, column, width[2]);
}

/* {"0": 16, "1": 8}: channels of each branch. */
static void read_widths(published *p, json_t *object, const char *key, widths *w)
{
    *w = (widths){{0}};
    object = ascc_members_object(&p->m, object, key);
    for (int i = 0; i < p->levels; i++) {
        const char name[2] = {(char)('0' + i), '\0'};
        if (json_object_get(object, name))
            w->of[i] = ascc_members_integer(&p->m, object, name, 1, MAX_CHANNELS);
    }
    ascc_members_end(&p->m, object);
}

/* Which layers have a dense term and which a residual, in the words of the file. */
typedef struct sentences {
    char activation[512], dense[512], residual[512];
    int residuals;
} sentences;

/* Name of the value of a branch: the first layer's, or that of a layer behind it. */
static void value_name(char name[32], int number, int branch)
{
    if (number == 0)
        (void)snprintf(name, 32, "l0");
    else
        (void)snprintf(name, 32, "l%d.out_%d", number, branch);
}

/* One branch of a trunk layer: the sum over S of conv_S_D, with dense and residual where S = D. */
static void read_trunk_branch(published *p, int number, int d, const widths *in, int outputs,
                              char *separator, sentences *said)
{
    char name[32], source[32];
    value_name(name, number, d);
    ascc_network_add_layer(&p->w, name, d, true, outputs);
    for (int s = 0; s < p->levels; s++) {
        if (in->of[s] == 0)
            continue;
        (void)snprintf(name, sizeof name, "l%d.conv_%d_%d", number, s, d);
        value_name(source, number - 1, s);
        add_convolution(p, name, source, true, 0, outputs, p->radius[s > d ? s : d]);
    }
    if (in->of[d] == 0)
        return;
    (void)snprintf(name, sizeof name, "l%d.dense_%d", number, d);
    value_name(source, number - 1, d);
    add_dense(p, name, source, true, 0, outputs);
    if (*separator == '_')
        append(said->dense, sizeof said->dense, "%sl%d.dense_%d", number > 1 ? ", " : "", number,
               d);
    else
        append(said->dense, sizeof said->dense, "/%d", d);
    *separator = '/';
    if (in->of[d] != outputs)
        return;
    (void)ascc_network_add_term(&p->w, "identity", source, false, 0);
    append(said->residual, sizeof said->residual, "%sl%d.out_%d += l%d.out_%d",
           said->residuals++ ? ", " : "", number, d, number - 1, d);
}

static void read_trunk_layer(published *p, json_t *object, int number, widths *in, sentences *said)
{
    widths stated, out;
    char name[32], separator = '_';
    (void)snprintf(name, sizeof name, "l%d", number);
    expect_text(p, object, "name", name);
    read_widths(p, object, "inputs", &stated);
    read_widths(p, object, "outputs", &out);
    ascc_members_end(&p->m, object);
    if (memcmp(&stated, in, sizeof stated) != 0)
        ascc_members_fail(&p->m, "'inputs' of %s are not the outputs before it", name);
    append(said->activation, sizeof said->activation, "%s%s", number > 1 ? "," : "", name);
    for (int d = 0; d < p->levels && ascc_members_good(&p->m); d++)
        if (out.of[d] > 0)
            read_trunk_branch(p, number, d, in, out.of[d], &separator, said);
    *in = out;
}

/* The kernel of which half is stored, in the words of the file. */
static void check_half(published *p, const double cells[3], int axis, const char *stored,
                       const char *full)
{
    double stated[5], shape[5], number = 0.0;
    if (!match_all(full, "concat(axis=@: -half[::-1,::-1,::-1], half)", &number) ||
        number != (double)axis)
        ascc_members_fail(&p->m, "'full' is not understood, or not along 'sym_axis'");
    if (!match_all(stored, "sym0.kernel_half [@,@,@,@,@]", stated))
        refuse_text(p, "stored", stored);
    if (!ascc_members_good(&p->m) || !shape_of(p, "sym0.kernel_half", 5, shape))
        return;
    if (memcmp(shape, stated, sizeof shape) != 0)
        ascc_members_fail(&p->m, "'stored' states another shape than the tensor has");
    for (int i = 0; i < 3; i++)
        if (cells[i] != (i == axis ? 2.0 * shape[i] : shape[i]))
            ascc_members_fail(&p->m, "'kernel_size' is not that of the whole kernel");
}

static void read_antisymmetric(published *p, json_t *root, int trunk_layers)
{
    static const char *const axes[] = {"z", "y", "x"};
    char source[32];
    double cells[3], number = 0.0;
    filter last = p->filter;
    json_t *object = ascc_members_object(&p->m, root, "antisymmetric");
    ascc_members_where(&p->m, "architecture 'antisymmetric'");
    read_cells(p, object, cells);
    last.window = read_word(p, object, "window", WORDS(windows));
    const double radius = read_length(p, object, "radius");
    expect_flag(p, object, "ignore_query_point", true);
    expect_flag(p, object, "bias", false);
    const int axis = ascc_members_integer(&p->m, object, "sym_axis", 0, 2);
    const char *stored = ascc_members_text(&p->m, object, "stored");
    const char *full = ascc_members_text(&p->m, object, "full");
    const char *formula = ascc_members_text(&p->m, object, "formula");
    ascc_members_end(&p->m, object);
    check_half(p, cells, axis, stored, full);
    if (!match_all(formula, "out_i = sum_k a_ik (f_i+f_k) g(x_k-x_i), f=relu(l@.out_0)", &number) ||
        number != (double)trunk_layers)
        refuse_text(p, "formula", formula);

    value_name(source, trunk_layers, 0);
    json_t *output = add_output(p, "antisymmetric", source);
    (void)ascc_network_put(&p->w, output, "relu", json_true());
    ascc_network_put_text(&p->w, output, "kernel", "sym0.kernel_half");
    ascc_network_put_text(&p->w, output, "stored", "half");
    ascc_network_put_text(&p->w, output, "half_axis", axes[axis]);
    put_cells(p, output, cells);
    ascc_network_put_text(&p->w, output, "projection", "none");
    put_filter(p, output, radius, &last);
}

/* What the sentences about the trunk must be, now that its layers are known. */
static void check_sentences(published *p, json_t *root, sentences *said)
{
    append(said->activation, sizeof said->activation,
           " convolution/dense and of the antisymmetric convolution; none on inputs of layer 0 and "
           "none on outputs");
    append(said->dense, sizeof said->dense,
           " act on relu(features) of the same branch and are added");
    append(said->residual, sizeof said->residual, "%s",
           said->residuals ? " (before relu); no other layer has equal widths"
                           : "no layer has equal widths");
    expect_text(p, root, "activation", said->activation);
    expect_text(p, root, "dense", said->dense);
    expect_text(p, root, "residual", said->residual);
}

static void read_dmcf_layers(published *p, json_t *root)
{
    sentences said = {"relu on the input of every ",
                      "fluid and boundary rows each have their own layer-0 dense; ", "", 0};
    widths in = {{0}}, stated, out;
    const json_t *list = ascc_members_array(&p->m, root, "layers");
    const size_t count = json_array_size(list);
    ascc_members_where(&p->m, "architecture 'layers'");
    for (size_t i = 0; i + 1 < count && ascc_members_good(&p->m); i++)
        if (!json_is_object(json_array_get(list, i)))
            ascc_members_fail(&p->m, "each must be an object");
        else if (i == 0)
            read_first_layer(p, json_array_get(list, i), &in);
        else
            read_trunk_layer(p, json_array_get(list, i), (int)i, &in, &said);
    json_t *last = count > 1 ? json_array_get(list, count - 1) : NULL;
    if (!json_is_object(last) || in.of[0] == 0)
        ascc_members_fail(&p->m, "a first layer, any number of l1, l2 ... and sym0 were expected");
    expect_text(p, last, "name", "sym0");
    read_widths(p, last, "inputs", &stated);
    read_widths(p, last, "outputs", &out);
    ascc_members_end(&p->m, last);
    if (stated.of[0] != in.of[0] || out.of[0] != (int)p->dimension)
        ascc_members_fail(&p->m, "sym0 does not go from branch 0 to the dimension");
    ascc_members_where(&p->m, "architecture");
    check_sentences(p, root, &said);
    read_antisymmetric(p, root, (int)count - 2);
}

/* What the metadata say of the training; without it the spacing is the one given. */
static double read_spacing(published *p, double spacing)
{
    double number[4] = {0.0};
    const char *trained = ascc_tensor_file_metadata(p->header, "trained_with");
    if (!trained)
        return spacing;
    ascc_members_where(&p->m, "metadata");
    if (!match_all(trained,
                   "gravity # along y, particle spacing # m, boundary about # points per m^2, "
                   "dt # s",
                   number) ||
        number[0] != p->gravity[1] || number[3] != p->time_step)
        ascc_members_fail(&p->m, "'trained_with' is not understood, or contradicts the "
                                 "architecture");
    return number[1];
}

static void read_dmcf(published *p, json_t *root)
{
    const double base = read_branches(p, root);
    read_dmcf_features(p, root);
    expect_flag(p, root, "use_boundary_in_all_layers", true);
    expect_text(p, root, "cross_branch_radius", "radius of the coarser of the two branches");
    expect_text(p, root, "merge", "sum (add_merge)");
    ascc_members_end(&p->m, read_convolution(p, root));
    (void)ascc_network_put(&p->w, p->w.network, "particle_spacing",
                           json_real(read_spacing(p, 2.0 * base)));
    ascc_members_where(&p->m, "architecture");
    read_dmcf_layers(p, root);
}

/* ---- CConv: one branch, a plain last layer ------------------------------------------------------ */

/* The widths 96,64,64,3 after layer 0, and what follows them; NULL = not understood. */
static const char *read_cconv_widths(const char *text, int count, int *width)
{
    for (int i = 0; text && i <= count; i++) {
        double number = 0.0;
        text = match(text, i == 0 ? "@" : ",@", &number);
        if (number < 1.0 || number > MAX_CHANNELS)
            return NULL;
        width[i] = (int)number;
    }
    return text;
}

/* Layer i behind the first: a convolution and a dense term, and a residual where widths are equal. */
static void add_cconv_layer(published *p, int i, const int *width, bool residual, double radius)
{
    char name[32], source[32];
    (void)snprintf(name, sizeof name, "A%d", i);
    (void)snprintf(source, sizeof source, "A%d", i - 1);
    ascc_network_add_layer(&p->w, name, 0, false, width[i]);
    (void)snprintf(name, sizeof name, "conv%d", i);
    add_convolution(p, name, source, true, 0, width[i], radius);
    (void)snprintf(name, sizeof name, "dense%d", i);
    add_dense(p, name, source, true, 0, width[i]);
    if ((width[i] == width[i - 1]) != residual)
        ascc_members_fail(&p->m, "'layers' states another residual than its widths give");
    if (residual)
        (void)ascc_network_add_term(&p->w, "identity", source, false, 0);
}

static void read_cconv_layers(published *p, json_t *root, double radius)
{
    enum { MAX = 32 };
    const char *text = ascc_members_text(&p->m, root, "layers");
    double number[5], last[2];
    int width[MAX + 1];
    const char *rest = match(
        text,
        "A0=concat(conv0_obstacle(@),conv0_fluid(@),dense0_fluid(@)) at fluid points; for i=1..@: "
        "f=relu(A_{i-1}); A_i=conv_i(f)+dense_i(f) (+A_{i-1} if widths are equal, i.e. only i=@); "
        "widths ",
        number);
    const int count = rest && number[3] >= 1.0 && number[3] <= MAX ? (int)number[3] : 0;
    rest = count ? read_cconv_widths(rest, count, width) : NULL;
    if (!rest || !match_all(rest, "; correction=A_@/#", last) || last[0] != number[3] ||
        number[0] + number[1] + number[2] != (double)width[0]) {
        refuse_text(p, "layers", text);
        return;
    }
    for (size_t i = 0; i < p->dimension; i++)
        if (p->scale[i] * last[1] != 1.0)
            ascc_members_fail(&p->m, "'layers' and 'out_scale' contradict each other");

    const int obstacle = (int)number[0], fluid = (int)number[1];
    ascc_network_add_layer(&p->w, "A0", 0, false, width[0]);
    add_convolution(p, "conv0_obstacle", "boundary", false, 0, obstacle, radius);
    add_convolution(p, "conv0_fluid", "fluid", false, obstacle, fluid, radius);
    add_dense(p, "dense0_fluid", "fluid", false, obstacle + fluid, (int)number[2]);
    for (int i = 1; i <= count; i++)
        add_cconv_layer(p, i, width, (double)i == number[4], radius);
    char source[32];
    (void)snprintf(source, sizeof source, "A%d", count);
    (void)add_output(p, "plain", source);
}

static void read_cconv(published *p, json_t *root)
{
    ascc_members_end(&p->m, read_feature_lists(p, root));
    json_t *object = read_convolution(p, root);
    const double radius = read_length(p, object, "radius");
    const double extent = read_length(p, object, "extent");
    ascc_members_end(&p->m, object);
    if (extent != 2.0 * radius)
        ascc_members_fail(&p->m, "'extent' is not twice the 'radius'");
    (void)ascc_network_put(&p->w, p->w.network, "particle_spacing",
                           json_real(extent / SPACINGS_PER_EXTENT));
    ascc_members_where(&p->m, "architecture");
    read_cconv_layers(p, root, radius);
}

/* ---- The file ----------------------------------------------------------------------------------- */

/* How many numbers all tensors hold. */
static double count_floats(json_t *header)
{
    const char *name;
    json_t *tensor, *extent;
    size_t i;
    double total = 0.0;
    json_object_foreach(header, name, tensor)
    {
        double count = strcmp(name, "__metadata__") == 0 ? 0.0 : 1.0;
        json_array_foreach(json_object_get(tensor, "shape"), i, extent) count *=
            json_number_value(extent);
        total += count;
    }
    return total;
}

static void check_metadata(published *p, json_t *header)
{
    static const char axes[] = "[z,y,x,in,out] row-major";
    double dimension = 0.0, floats = 0.0;
    const double total = count_floats(header);
    const char *format = ascc_tensor_file_metadata(header, "format");
    const char *version = ascc_tensor_file_metadata(header, "version");
    const char *dim = ascc_tensor_file_metadata(header, "dim");
    const char *order = ascc_tensor_file_metadata(header, "kernel_axis_order");
    const char *count = ascc_tensor_file_metadata(header, "floats");
    const char *names = ascc_tensor_file_metadata(header, "conv_name");
    ascc_members_where(&p->m, "metadata");
    if (!format || strcmp(format, "ascc.weights") != 0)
        ascc_members_fail(&p->m, "'format' is '%.70s', not 'ascc.weights'", format ? format : "");
    if (!version || strcmp(version, "1") != 0)
        ascc_members_fail(&p->m, "'version' is '%.70s', but must be '1'", version ? version : "");
    if (!dim || !match_all(dim, "@", &dimension) || (dimension != 2.0 && dimension != 3.0))
        ascc_members_fail(&p->m, "'dim' must be 2 or 3");
    if (!order || strncmp(order, axes, sizeof axes - 1) != 0)
        ascc_members_fail(&p->m, "'kernel_axis_order' is not understood");
    if (names && strcmp(names, "lL.conv_S_D: layer L, from branch S to branch D; lL.dense_D: "
                               "same-branch dense") != 0)
        ascc_members_fail(&p->m, "'conv_name' is not understood");
    if (count && (!match_all(count, "#", &floats) || floats != total))
        ascc_members_fail(&p->m, "'floats' is not what the tensors hold together, %.0f", total);
    p->dimension = (size_t)dimension;
}

static void read_architecture(published *p, json_t *root)
{
    double dimension = 0.0;
    ascc_members_where(&p->m, "architecture");
    const char *network = ascc_members_text(&p->m, root, "network");
    read_head(p, root, ascc_tensor_file_metadata(p->header, "model"), network);
    if (match_all(network, "DMCF SymNet (HRNet trunk + antisymmetric output convolution), dim @",
                  &dimension))
        read_dmcf(p, root);
    else if (match_all(network, "CConv (Ummenhofer et al. ICLR 2020), dim @", &dimension))
        read_cconv(p, root);
    else
        refuse_text(p, "network", network);
    ascc_members_where(&p->m, "architecture");
    if (dimension != (double)p->dimension)
        ascc_members_fail(&p->m, "'network' and 'dim' contradict each other");
    ascc_members_end(&p->m, root);
}

/* From the architecture to the network described. */
static void read_description(published *p)
{
    const char *text = ascc_tensor_file_metadata(p->header, "architecture");
    json_error_t why;
    if (!ascc_members_good(&p->m))
        return;
    if (!text) {
        ascc_members_fail(&p->m, "there is no 'architecture'");
        return;
    }
    json_t *root = json_loads(text, JSON_REJECT_DUPLICATES, &why);
    if (!root)
        ascc_members_fail(&p->m, "'architecture' is not JSON: %s", why.text);
    else if (!json_is_object(root))
        ascc_members_fail(&p->m, "'architecture' must be a JSON object");
    else
        read_architecture(p, root);
    json_decref(root);
}

/* The network takes the place of what it was made from; where the weights come from stays. */
static void describe(published *p, json_t *header)
{
    static const char *const read[] = {"architecture", "dim",    "kernel_axis_order",
                                       "conv_name",    "floats", "model"};
    json_t *metadata = json_object_get(header, "__metadata__");
    char *text = ascc_network_text(&p->w);
    for (size_t i = 0; i < sizeof read / sizeof *read; i++)
        (void)json_object_del(metadata, read[i]);
    ascc_network_put_text(&p->w, metadata, "format", "ascc.model");
    (void)ascc_network_put(&p->w, metadata, "network", text ? json_string(text) : NULL);
    free(text);
}

bool ascc_published_is(const unsigned char *bytes, size_t size)
{
    char error[300];
    size_t data;
    json_t *header = ascc_tensor_file_header(bytes, size, &data, error, sizeof error);
    const char *format = ascc_tensor_file_metadata(header, "format");
    const bool is = format && strcmp(format, "ascc.weights") == 0;
    json_decref(header);
    return is;
}

unsigned char *ascc_published_convert(const unsigned char *bytes, size_t size, size_t *converted,
                                      char *error, size_t capacity)
{
    size_t data;
    unsigned char *made = NULL;
    json_t *header = ascc_tensor_file_header(bytes, size, &data, error, capacity);
    if (!header)
        return NULL;
    published p = {.header = header, .levels = 0, .w.network = json_object()};
    p.m.taken = json_array();
    check_metadata(&p, header);
    read_description(&p);
    if (ascc_members_good(&p.m))
        describe(&p, header);
    if (ascc_members_good(&p.m) && !p.w.failed)
        made = ascc_tensor_file_build(header, bytes + data, size - data, converted);
    if (!made)
        (void)snprintf(error, capacity, "%s", ascc_members_good(&p.m) ? "no memory" : p.m.error);
    json_decref(p.m.taken);
    json_decref(p.w.network);
    json_decref(header);
    return made;
}
