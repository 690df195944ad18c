/* The published pretrained networks, converted to safetensors but otherwise as they are.
 * SPDX-License-Identifier: MIT */
#include "published.h"
#include "file/json_reader.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define SPACINGS_PER_EXTENT 4.5 /* CConv: a filter reaches across 9 particle radii */
#define REST_DENSITY 1000.0     /* water: what both were trained on; their files do not say */

static const struct {
    const char *text;
    ascc_window window;
} windows[] = {{"poly6: clip((1-q)^3,0,1), q=d^2/r^2", ASCC_WINDOW_POLY6},
               {"peak: (1-sqrt(q))^2", ASCC_WINDOW_PEAK},
               {"none", ASCC_WINDOW_NONE}};

static const struct {
    const char *text;
    ascc_mapping mapping;
} mappings[] = {{"ball_to_cube_volume_preserving", ASCC_MAPPING_VOLUME},
                {"ball_to_cube_radial", ASCC_MAPPING_RADIAL},
                {"identity", ASCC_MAPPING_IDENTITY}};

/* Widths of the branches of one layer; 0 = the branch has none. */
typedef struct widths {
    int32_t of[ASCC_MAX_LEVELS];
} widths;

typedef struct published {
    ascc_plan_builder *builder;
    ascc_plan *plan; /* the builder's */
    ascc_safetensors *file;
    ascc_reader reader;
    ascc_filter filter; /* of all convolutions but the last; radius per term */
    double radius[ASCC_MAX_LEVELS];
} published;

/* ---- Sentences ---------------------------------------------------------------------------------- */

/* Matches the beginning of a text: '#' stands for a number, '@' for one of digits only, which are
 * stored in turn. Returns what follows, NULL = no match. */
static const char *match(const char *text, const char *pattern, double *number)
{
    for (; *pattern != '\0'; pattern++) {
        if (*pattern == '#') {
            const size_t length = ascc_json_number(text, number++);
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
static void append(char *text, size_t capacity, const char *format, ...) ASCC_PRINTF(3, 4);
static void append(char *text, size_t capacity, const char *format, ...)
{
    const size_t length = strlen(text);
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(text + length, capacity - length, format, arguments);
    va_end(arguments);
}

static void expect_text(ascc_reader *reader, uint32_t object, const char *key, const char *expected)
{
    const char *text = ascc_reader_text(reader, object, key);
    if (reader->status == ASCC_OK && strcmp(text, expected) != 0)
        ascc_reader_fail(reader, "'%s' is not understood: '%s'", key, ascc_quote(text).text);
}

static void expect_flag(ascc_reader *reader, uint32_t object, const char *key, bool expected)
{
    if (ascc_reader_flag(reader, object, key) != expected && reader->status == ASCC_OK)
        ascc_reader_fail(reader, "'%s' must be %s", key, expected ? "true" : "false");
}

/* ---- What both networks state ------------------------------------------------------------------- */

static double length_of(ascc_reader *reader, uint32_t object, const char *key)
{
    return ascc_reader_number(reader, object, key, ASCC_PLAN_MIN, ASCC_PLAN_MAX);
}

static ascc_window read_window(ascc_reader *reader, uint32_t object)
{
    const char *text = ascc_reader_text(reader, object, "window");
    for (size_t i = 0; i < sizeof windows / sizeof *windows; i++)
        if (strcmp(text, windows[i].text) == 0)
            return windows[i].window;
    ascc_reader_fail(reader, "'window' is not understood: '%s'", ascc_quote(text).text);
    return ASCC_WINDOW_NONE;
}

static ascc_mapping read_mapping(ascc_reader *reader, uint32_t object)
{
    const char *text = ascc_reader_text(reader, object, "coordinate_mapping");
    for (size_t i = 0; i < sizeof mappings / sizeof *mappings; i++)
        if (strcmp(text, mappings[i].text) == 0)
            return mappings[i].mapping;
    ascc_reader_fail(reader, "'coordinate_mapping' is not understood: '%s'", ascc_quote(text).text);
    return ASCC_MAPPING_IDENTITY;
}

/* Kernel sizes are stated as tensors are stored, [z, y, x]. */
static void read_cells(ascc_reader *reader, uint32_t object, int32_t cells[3])
{
    double size[3] = {1.0, 1.0, 1.0};
    ascc_reader_numbers(reader, object, "kernel_size", 3, 1.0, ASCC_MAX_CELLS, size);
    for (int i = 0; i < 3; i++) {
        cells[2 - i] = (int32_t)size[i];
        if ((double)cells[2 - i] != size[i])
            ascc_reader_fail(reader, "'kernel_size' must be whole numbers");
    }
}

/* "1" is the constant, prefix.x, prefix.y ... the components of a vector. */
static void read_features(published *p, uint32_t object, const char *whose, const char *prefix,
                          ascc_feature vector, int32_t *feature, int32_t *count)
{
    ascc_reader *reader = &p->reader;
    const ascc_json *json = reader->json;
    const uint32_t list = ascc_reader_array(reader, object, whose);
    int32_t component = 0;
    if (reader->status != ASCC_OK)
        return;
    for (uint32_t i = ascc_json_first(json, list); i != 0; i = json->value[i].next) {
        char expected[16];
        snprintf(expected, sizeof expected, "%s.%c", prefix, "xyz?"[component]);
        const bool one = component == 0 && strcmp(json->value[i].text, "1") == 0;
        if ((!one && strcmp(json->value[i].text, expected) != 0) || *count == ASCC_MAX_FEATURES) {
            ascc_reader_fail(reader, "feature '%s' of '%s' is not understood",
                             ascc_quote(json->value[i].text).text, whose);
            return;
        }
        if (one) {
            feature[(*count)++] = ASCC_FEATURE_ONE;
        } else if (++component == p->plan->dimension) {
            feature[(*count)++] = (int32_t)vector;
            component = 0;
        }
    }
    if (component != 0)
        ascc_reader_fail(reader, "'%s' ends within a vector", whose);
}

static void read_advection(published *p)
{
    static const char *const texts[] = {
        [ASCC_ADVECT_END] = "v2=v1+dt*g; p2=p1+dt*v2; p=p2+correction; v=(p-p1)/dt",
        [ASCC_ADVECT_MEAN] = "v2=v1+dt*g; p2=p1+dt*(v1+v2)/2; p=p2+correction; v=(p-p1)/dt"};
    const char *text = ascc_reader_text(&p->reader, 0, "integration");
    if (strcmp(text, texts[ASCC_ADVECT_END]) == 0)
        p->plan->advection = ASCC_ADVECT_END;
    else if (strcmp(text, texts[ASCC_ADVECT_MEAN]) == 0)
        p->plan->advection = ASCC_ADVECT_MEAN;
    else
        ascc_reader_fail(&p->reader, "'integration' is not understood: '%s'",
                         ascc_quote(text).text);
}

static void read_crop(published *p)
{
    double crop[2] = {0.0, 0.0};
    const char *text = ascc_reader_text(&p->reader, 0, "boundary_crop");
    if (strcmp(text, "none") == 0)
        return;
    if (!match_all(text, "keep b iff min(p2)-# <= b <= max(p2)+# per axis", crop) ||
        crop[0] != crop[1] || !(crop[0] > 0.0))
        ascc_reader_fail(&p->reader, "'boundary_crop' is not understood: '%s'",
                         ascc_quote(text).text);
    p->plan->boundary_crop = crop[0];
}

/* The section "conv": how every convolution but an antisymmetric one works. */
static uint32_t read_convolution(published *p)
{
    ascc_reader *reader = &p->reader;
    const uint32_t object = ascc_reader_object(reader, 0, "conv");
    ascc_reader_where(reader, "architecture 'conv'");
    read_cells(reader, object, p->filter.cells);
    p->filter.window = read_window(reader, object);
    p->filter.mapping = read_mapping(reader, object);
    expect_text(reader, object, "interpolation", "trilinear, clamped");
    expect_flag(reader, object, "align_corners", true);
    expect_flag(reader, object, "normalize", false);
    p->filter.skip_self = ascc_reader_flag(reader, object, "ignore_query_point");
    expect_flag(reader, object, "bias", true);
    return object;
}

static void read_head(published *p)
{
    ascc_plan *plan = p->plan;
    plan->time_step = length_of(&p->reader, 0, "timestep");
    ascc_reader_numbers(&p->reader, 0, "gravity", plan->dimension, -ASCC_PLAN_MAX, ASCC_PLAN_MAX,
                        plan->gravity);
    ascc_reader_numbers(&p->reader, 0, "out_scale", plan->dimension, -ASCC_PLAN_MAX, ASCC_PLAN_MAX,
                        plan->output.scale);
    plan->rest_density = REST_DENSITY;
    read_advection(p);
    read_crop(p);
}

/* ---- Layers ------------------------------------------------------------------------------------- */

static void add_layer(published *p, const char *name, int32_t set, int32_t channels)
{
    if (p->reader.status == ASCC_OK)
        p->reader.status = ascc_plan_add_layer(p->builder, name, set, channels);
}

/* A term with tensors name.kernel and name.bias that gives `outputs` channels. */
static void add_term(published *p, ascc_term_kind kind, const char *name, int32_t source,
                     bool rectify, int32_t column, int32_t outputs, double radius)
{
    ascc_term term = {.kind = kind, .source = source, .rectify = rectify, .column = column};
    char kernel[48], bias[48];
    if (p->reader.status != ASCC_OK)
        return;
    snprintf(kernel, sizeof kernel, "%s.kernel", name);
    snprintf(bias, sizeof bias, "%s.bias", name);
    if (kind == ASCC_TERM_CONVOLUTION) {
        term.filter = p->filter;
        term.filter.radius = radius;
    }
    const bool weighted = kind != ASCC_TERM_IDENTITY;
    p->reader.status =
        ascc_plan_add_term(p->builder, &term, weighted ? kernel : NULL, weighted ? bias : NULL);
    if (p->reader.status != ASCC_OK)
        return;
    const ascc_term *made = &p->builder->term[p->plan->term_count - 1].term;
    if (made->outputs != outputs)
        ascc_reader_fail(&p->reader, "'%s' gives %d channels, but %d are stated", name,
                         (int)made->outputs, (int)outputs);
    if (kind == ASCC_TERM_CONVOLUTION &&
        memcmp(made->filter.cells, p->filter.cells, sizeof p->filter.cells) != 0)
        ascc_reader_fail(&p->reader, "'%s' is not of the 'kernel_size' stated", name);
}

static void finish_output(published *p, const ascc_output *output, const char *kernel,
                          int32_t storage)
{
    if (p->reader.status == ASCC_OK)
        p->reader.status = ascc_plan_set_output(p->builder, output,
                                                &(ascc_output_names){.weight = kernel}, storage);
}

static void begin_layers(published *p)
{
    ascc_reader_where(&p->reader, "architecture");
    if (p->reader.status == ASCC_OK)
        p->reader.status = ascc_plan_begin(p->builder);
}

/* ---- DMCF: branches and an antisymmetric last layer --------------------------------------------- */

static void read_branches(published *p)
{
    ascc_reader *reader = &p->reader;
    const ascc_json *json = reader->json;
    ascc_plan *plan = p->plan;
    const uint32_t sampling = ascc_reader_object(reader, 0, "sampling");
    const double base = length_of(reader, sampling, "base_voxel");
    plan->sampling = ASCC_SAMPLING_CORNERS;
    plan->centroid_anchor = 1;
    expect_flag(reader, sampling, "centralize", true);
    plan->hysteresis = ascc_reader_number(reader, sampling, "hysteresis", 0.0, 0.5);
    ascc_reader_integer(reader, sampling, "pad", 0, 0);
    expect_text(reader, sampling, "source", "branch 0 points for every branch");
    ascc_reader_end(reader, sampling);
    plan->spacing = 2.0 * base;

    const uint32_t list = ascc_reader_array(reader, 0, "branches");
    if (reader->status != ASCC_OK)
        return;
    plan->level_count = 0;
    for (uint32_t i = ascc_json_first(json, list); i != 0 && reader->status == ASCC_OK;
         i = json->value[i].next) {
        const int32_t level = plan->level_count++;
        ascc_reader_where(reader, "architecture 'branches' %d", (int)level);
        if (level == ASCC_MAX_LEVELS || json->value[i].kind != ASCC_JSON_OBJECT) {
            ascc_reader_fail(reader, "too many, or no object");
            return;
        }
        const int32_t stride = ascc_reader_integer(reader, i, "stride", 1, 1 << 20);
        p->radius[level] = length_of(reader, i, "radius");
        if (level == 0) {
            expect_text(reader, i, "points", "fluid then kept boundary");
            if (stride != 1)
                ascc_reader_fail(reader, "'stride' must be 1");
        } else {
            plan->level[level].voxel = length_of(reader, i, "voxel");
            if (fabs(stride * base - plan->level[level].voxel) > 1e-9 * plan->level[level].voxel)
                ascc_reader_fail(reader, "'voxel' is not 'stride' times 'base_voxel'");
            if (p->radius[level] < p->radius[level - 1])
                ascc_reader_fail(reader, "'radius' is less than that of the branch before");
        }
        ascc_reader_end(reader, i);
    }
    ascc_reader_where(reader, "architecture");
}

static void read_dmcf_features(published *p)
{
    ascc_reader *reader = &p->reader;
    ascc_plan *plan = p->plan;
    const uint32_t object = ascc_reader_object(reader, 0, "features");
    ascc_reader_where(reader, "architecture 'features'");
    read_features(p, object, "fluid", "v2", ASCC_FEATURE_VELOCITY, plan->fluid_features,
                  &plan->fluid_feature_count);
    read_features(p, object, "boundary", "n", ASCC_FEATURE_NORMAL, plan->boundary_features,
                  &plan->boundary_feature_count);
    expect_flag(reader, object, "use_vel", true);
    expect_flag(reader, object, "use_acc", false);
    expect_flag(reader, object, "use_feats", false);
    expect_flag(reader, object, "use_box_feats", true);
    expect_flag(reader, object, "density_features", false);
    ascc_reader_end(reader, object);
    ascc_reader_where(reader, "architecture");
}

static void read_first_layer(published *p, uint32_t object, widths *out)
{
    static const char *const patterns[] = {"conv_fluid(@)", "conv_obstacle(@)",
                                           "dense_fluid|dense_obstacle(@)"};
    ascc_reader *reader = &p->reader;
    const ascc_json *json = reader->json;
    int32_t width[3], column = 0;
    expect_text(reader, object, "name", "l0");
    out->of[0] = ascc_reader_integer(reader, object, "out", 1, ASCC_MAX_CHANNELS);
    const uint32_t list = ascc_reader_array(reader, object, "concat");
    ascc_reader_end(reader, object);
    if (reader->status != ASCC_OK)
        return;
    uint32_t item = ascc_json_first(json, list);
    for (int i = 0; i < 3; i++, item = json->value[item].next) {
        double number = 0.0;
        if (item == 0 || !match_all(json->value[item].text, patterns[i], &number) ||
            number > ASCC_MAX_CHANNELS) {
            ascc_reader_fail(reader, "'concat' of l0 is not understood");
            return;
        }
        width[i] = (int32_t)number;
        column += width[i];
    }
    if (item != 0 || column != out->of[0]) {
        ascc_reader_fail(reader, "'concat' of l0 does not add up to 'out'");
        return;
    }
    add_layer(p, "l0", ASCC_SET_ALL, out->of[0]);
    add_term(p, ASCC_TERM_CONVOLUTION, "conv_fluid", 0, false, 0, width[0], p->radius[0]);
    add_term(p, ASCC_TERM_CONVOLUTION, "conv_obstacle", 1, false, width[0], width[1], p->radius[0]);
    column = width[0] + width[1];
    add_term(p, ASCC_TERM_DENSE, "dense_fluid", 0, false, column, width[2], 0.0);
    add_term(p, ASCC_TERM_DENSE, "dense_obstacle", 1, false, column, width[2], 0.0);
}

/* {"0": 16, "1": 8}: channels of each branch. */
static void read_widths(published *p, uint32_t object, const char *key, widths *w)
{
    ascc_reader *reader = &p->reader;
    *w = (widths){{0}};
    object = ascc_reader_object(reader, object, key);
    for (int32_t i = 0; i < p->plan->level_count; i++) {
        const char name[2] = {(char)('0' + i), '\0'};
        if (ascc_reader_has(reader, object, name))
            w->of[i] = ascc_reader_integer(reader, object, name, 1, ASCC_MAX_CHANNELS);
    }
    if (reader->status == ASCC_OK)
        ascc_reader_end(reader, object);
}

/* Which layers have a dense term and which a residual, in the words of the file. */
typedef struct sentences {
    char activation[512], dense[512], residual[512];
    int residuals;
} sentences;

/* One trunk layer: out_D = sum over S of conv_S_D, with dense and residual where S = D. */
static void read_trunk_layer(published *p, uint32_t object, int number, widths *in,
                             int32_t value[ASCC_MAX_LEVELS], sentences *said)
{
    ascc_reader *reader = &p->reader;
    widths stated, out;
    int32_t made[ASCC_MAX_LEVELS] = {0};
    char name[32], separator = '_';
    snprintf(name, sizeof name, "l%d", number);
    expect_text(reader, object, "name", name);
    read_widths(p, object, "inputs", &stated);
    read_widths(p, object, "outputs", &out);
    ascc_reader_end(reader, object);
    if (memcmp(&stated, in, sizeof stated) != 0)
        ascc_reader_fail(reader, "'inputs' of %s are not the outputs before it", name);
    append(said->activation, sizeof said->activation, "%s%s", number > 1 ? "," : "", name);

    for (int d = 0; d < p->plan->level_count && reader->status == ASCC_OK; d++) {
        if (out.of[d] == 0)
            continue;
        snprintf(name, sizeof name, "l%d.out_%d", number, d);
        add_layer(p, name, d == 0 ? ASCC_SET_ALL : ASCC_SET_LEVEL + d - 1, out.of[d]);
        made[d] = p->plan->layer_count + 1;
        for (int s = 0; s < p->plan->level_count; s++) {
            if (in->of[s] == 0)
                continue;
            snprintf(name, sizeof name, "l%d.conv_%d_%d", number, s, d);
            add_term(p, ASCC_TERM_CONVOLUTION, name, value[s], true, 0, out.of[d],
                     p->radius[s > d ? s : d]);
        }
        if (in->of[d] == 0)
            continue;
        snprintf(name, sizeof name, "l%d.dense_%d", number, d);
        add_term(p, ASCC_TERM_DENSE, name, value[d], true, 0, out.of[d], 0.0);
        if (separator == '_')
            append(said->dense, sizeof said->dense, "%sl%d.dense_%d", number > 1 ? ", " : "",
                   number, d);
        else
            append(said->dense, sizeof said->dense, "/%d", d);
        separator = '/';
        if (in->of[d] != out.of[d])
            continue;
        add_term(p, ASCC_TERM_IDENTITY, "residual", value[d], false, 0, out.of[d], 0.0);
        append(said->residual, sizeof said->residual, "%sl%d.out_%d += l%d.out_%d",
               said->residuals++ ? ", " : "", number, d, number - 1, d);
    }
    *in = out;
    memcpy(value, made, sizeof made);
}

static void read_antisymmetric(published *p, int32_t source, int trunk_layers)
{
    ascc_reader *reader = &p->reader;
    ascc_output output = p->plan->output;
    double shape[5], number = 0.0;
    const uint32_t object = ascc_reader_object(reader, 0, "antisymmetric");
    ascc_reader_where(reader, "architecture 'antisymmetric'");
    output.kind = ASCC_OUTPUT_ANTISYMMETRIC;
    output.source = source;
    output.rectify = 1;
    int32_t cells[3] = {0, 0, 0};
    read_cells(reader, object, cells);
    output.filter.window = read_window(reader, object);
    output.filter.mapping = p->filter.mapping;
    output.filter.radius = length_of(reader, object, "radius");
    expect_flag(reader, object, "ignore_query_point", true);
    expect_flag(reader, object, "bias", false);
    const int32_t axis = ascc_reader_integer(reader, object, "sym_axis", 0, 2);
    const char *stored = ascc_reader_text(reader, object, "stored");
    const char *full = ascc_reader_text(reader, object, "full");
    const char *formula = ascc_reader_text(reader, object, "formula");
    ascc_reader_end(reader, object);
    if (reader->status != ASCC_OK)
        return;
    if (!match_all(full, "concat(axis=@: -half[::-1,::-1,::-1], half)", &number) ||
        number != (double)axis)
        ascc_reader_fail(reader, "'full' is not understood, or not along 'sym_axis'");
    if (!match_all(formula, "out_i = sum_k a_ik (f_i+f_k) g(x_k-x_i), f=relu(l@.out_0)", &number) ||
        number != (double)trunk_layers)
        ascc_reader_fail(reader, "'formula' is not understood: '%s'", ascc_quote(formula).text);
    if (!match_all(stored, "sym0.kernel_half [@,@,@,@,@]", shape))
        ascc_reader_fail(reader, "'stored' is not understood: '%s'", ascc_quote(stored).text);
    finish_output(p, &output, "sym0.kernel_half", 2 - axis);
    if (reader->status != ASCC_OK)
        return;
    const ascc_tensor *tensor = &p->file->tensor[p->builder->output_tensor];
    for (int i = 0; i < 5; i++)
        if (shape[i] != (double)tensor->shape[i])
            ascc_reader_fail(reader, "'stored' states another shape than the tensor has");
    if (memcmp(cells, p->plan->output.filter.cells, sizeof cells) != 0)
        ascc_reader_fail(reader, "'kernel_size' is not that of the whole kernel");
}

static void read_dmcf_layers(published *p)
{
    ascc_reader *reader = &p->reader;
    const ascc_json *json = reader->json;
    sentences said = {"relu on the input of every ",
                      "fluid and boundary rows each have their own layer-0 dense; ", "", 0};
    widths in = {{0}}, stated, out;
    int32_t value[ASCC_MAX_LEVELS] = {2};
    const uint32_t list = ascc_reader_array(reader, 0, "layers");
    if (reader->status != ASCC_OK)
        return;
    int number = 0;
    uint32_t last = 0;
    ascc_reader_where(reader, "architecture 'layers'");
    for (uint32_t i = ascc_json_first(json, list); i != 0 && reader->status == ASCC_OK;
         i = json->value[i].next) {
        if (json->value[i].kind != ASCC_JSON_OBJECT)
            ascc_reader_fail(reader, "each must be an object");
        else if (number == 0)
            read_first_layer(p, i, &in);
        else if (json->value[i].next != 0)
            read_trunk_layer(p, i, number, &in, value, &said);
        else
            last = i;
        number++;
    }
    if (reader->status == ASCC_OK && (last == 0 || in.of[0] == 0))
        ascc_reader_fail(reader, "a first layer, any number of l1, l2 ... and sym0 were expected");
    if (reader->status != ASCC_OK)
        return;
    expect_text(reader, last, "name", "sym0");
    read_widths(p, last, "inputs", &stated);
    read_widths(p, last, "outputs", &out);
    ascc_reader_end(reader, last);
    if (stated.of[0] != in.of[0] || out.of[0] != p->plan->dimension)
        ascc_reader_fail(reader, "sym0 does not go from branch 0 to the dimension");

    ascc_reader_where(reader, "architecture");
    append(said.activation, sizeof said.activation,
           " convolution/dense and of the antisymmetric convolution; none on inputs of layer 0 and "
           "none on outputs");
    append(said.dense, sizeof said.dense,
           " act on relu(features) of the same branch and are added");
    append(said.residual, sizeof said.residual, "%s",
           said.residuals ? " (before relu); no other layer has equal widths"
                          : "no layer has equal widths");
    expect_text(reader, 0, "activation", said.activation);
    expect_text(reader, 0, "dense", said.dense);
    expect_text(reader, 0, "residual", said.residual);
    read_antisymmetric(p, value[0], number - 2);
}

static void read_dmcf(published *p)
{
    ascc_reader *reader = &p->reader;
    read_branches(p);
    read_dmcf_features(p);
    expect_flag(reader, 0, "use_boundary_in_all_layers", true);
    expect_text(reader, 0, "cross_branch_radius", "radius of the coarser of the two branches");
    expect_text(reader, 0, "merge", "sum (add_merge)");
    ascc_reader_end(reader, read_convolution(p));
    const char *trained = ascc_safetensors_metadata(p->file, "trained_with");
    if (trained && reader->status == ASCC_OK) {
        double number[4];
        ascc_reader_where(reader, "metadata");
        if (!match_all(trained,
                       "gravity # along y, particle spacing # m, boundary about # points per m^2, "
                       "dt # s",
                       number) ||
            number[0] != p->plan->gravity[1] || number[3] != p->plan->time_step)
            ascc_reader_fail(reader, "'trained_with' is not understood, or contradicts the "
                                     "architecture");
        else
            p->plan->spacing = number[1];
    }
    begin_layers(p);
    read_dmcf_layers(p);
}

/* ---- CConv: one branch, a plain last layer ------------------------------------------------------ */

/* The widths 96,64,64,3 after layer 0, and what follows them; NULL = not understood. */
static const char *read_cconv_widths(const char *text, int count, int32_t *width)
{
    for (int i = 0; text && i <= count; i++) {
        double number = 0.0;
        text = match(text, i == 0 ? "@" : ",@", &number);
        if (number < 1.0 || number > ASCC_MAX_CHANNELS)
            return NULL;
        width[i] = (int32_t)number;
    }
    return text;
}

static void read_cconv_layers(published *p, double radius)
{
    enum { MAX = 32 };
    ascc_reader *reader = &p->reader;
    const char *text = ascc_reader_text(reader, 0, "layers");
    double number[5], last[2];
    int32_t width[MAX + 1];
    if (reader->status != ASCC_OK)
        return;
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
        ascc_reader_fail(reader, "'layers' is not understood: '%s'", ascc_quote(text).text);
        return;
    }
    for (int i = 0; i < p->plan->dimension; i++)
        if (p->plan->output.scale[i] * last[1] != 1.0)
            ascc_reader_fail(reader, "'layers' and 'out_scale' contradict each other");

    const int32_t obstacle = (int32_t)number[0], fluid = (int32_t)number[1];
    add_layer(p, "A0", ASCC_SET_FLUID, width[0]);
    add_term(p, ASCC_TERM_CONVOLUTION, "conv0_obstacle", 1, false, 0, obstacle, radius);
    add_term(p, ASCC_TERM_CONVOLUTION, "conv0_fluid", 0, false, obstacle, fluid, radius);
    add_term(p, ASCC_TERM_DENSE, "dense0_fluid", 0, false, obstacle + fluid, (int32_t)number[2],
             0.0);
    for (int i = 1; i <= count; i++) {
        char name[32];
        snprintf(name, sizeof name, "A%d", i);
        add_layer(p, name, ASCC_SET_FLUID, width[i]);
        snprintf(name, sizeof name, "conv%d", i);
        add_term(p, ASCC_TERM_CONVOLUTION, name, i + 1, true, 0, width[i], radius);
        snprintf(name, sizeof name, "dense%d", i);
        add_term(p, ASCC_TERM_DENSE, name, i + 1, true, 0, width[i], 0.0);
        if ((width[i] == width[i - 1]) != ((double)i == number[4]))
            ascc_reader_fail(reader, "'layers' states another residual than its widths give");
        if (width[i] == width[i - 1])
            add_term(p, ASCC_TERM_IDENTITY, "residual", i + 1, false, 0, width[i], 0.0);
    }
    ascc_output output = p->plan->output;
    output.kind = ASCC_OUTPUT_PLAIN;
    output.source = count + 2;
    finish_output(p, &output, NULL, ASCC_FULL);
}

static void read_cconv(published *p)
{
    ascc_reader *reader = &p->reader;
    ascc_plan *plan = p->plan;
    const uint32_t features = ascc_reader_object(reader, 0, "features");
    ascc_reader_where(reader, "architecture 'features'");
    read_features(p, features, "fluid", "v2", ASCC_FEATURE_VELOCITY, plan->fluid_features,
                  &plan->fluid_feature_count);
    read_features(p, features, "boundary", "n", ASCC_FEATURE_NORMAL, plan->boundary_features,
                  &plan->boundary_feature_count);
    ascc_reader_end(reader, features);
    const uint32_t object = read_convolution(p);
    const double radius = length_of(reader, object, "radius");
    const double extent = length_of(reader, object, "extent");
    ascc_reader_end(reader, object);
    if (extent != 2.0 * radius)
        ascc_reader_fail(reader, "'extent' is not twice the 'radius'");
    plan->spacing = extent / SPACINGS_PER_EXTENT;
    begin_layers(p);
    read_cconv_layers(p, radius);
}

/* ---- Metadata ----------------------------------------------------------------------------------- */

static void check_metadata(published *p)
{
    static const char axes[] = "[z,y,x,in,out] row-major";
    ascc_reader *reader = &p->reader;
    double dimension = 0.0, floats = 0.0, total = 0.0;
    const char *dim = ascc_safetensors_metadata(p->file, "dim");
    const char *order = ascc_safetensors_metadata(p->file, "kernel_axis_order");
    const char *count = ascc_safetensors_metadata(p->file, "floats");
    const char *names = ascc_safetensors_metadata(p->file, "conv_name");
    const char *model = ascc_safetensors_metadata(p->file, "model");
    ascc_reader_where(reader, "metadata");
    if (!dim || !match_all(dim, "@", &dimension) || (dimension != 2.0 && dimension != 3.0))
        ascc_reader_fail(reader, "'dim' must be 2 or 3");
    if (!order || strncmp(order, axes, sizeof axes - 1) != 0)
        ascc_reader_fail(reader, "'kernel_axis_order' is not understood");
    if (names && strcmp(names, "lL.conv_S_D: layer L, from branch S to branch D; lL.dense_D: "
                               "same-branch dense") != 0)
        ascc_reader_fail(reader, "'conv_name' is not understood");
    for (size_t i = 0; i < p->file->tensor_count; i++)
        total += (double)p->file->tensor[i].count;
    if (count && (!match_all(count, "#", &floats) || floats != total))
        ascc_reader_fail(reader, "'floats' is not what the tensors hold together, %.0f", total);
    p->plan->dimension = (int32_t)dimension;
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_text(p->builder, "model", model ? model : "published",
                                        p->plan->name, sizeof p->plan->name);
}

static void read_architecture(published *p)
{
    ascc_reader *reader = &p->reader;
    double dimension = 0.0;
    ascc_reader_where(reader, "architecture");
    if (reader->json->value[0].kind != ASCC_JSON_OBJECT) {
        ascc_reader_fail(reader, "it must be a JSON object");
        return;
    }
    const char *network = ascc_reader_text(reader, 0, "network");
    if (reader->status == ASCC_OK)
        reader->status = ascc_plan_text(p->builder, "network", network, p->plan->description,
                                        sizeof p->plan->description);
    read_head(p);
    if (match_all(network, "DMCF SymNet (HRNet trunk + antisymmetric output convolution), dim @",
                  &dimension))
        read_dmcf(p);
    else if (match_all(network, "CConv (Ummenhofer et al. ICLR 2020), dim @", &dimension))
        read_cconv(p);
    else
        ascc_reader_fail(reader, "'network' is not understood: '%s'", ascc_quote(network).text);
    ascc_reader_where(reader, "architecture");
    if (reader->status == ASCC_OK && dimension != (double)p->plan->dimension)
        ascc_reader_fail(reader, "'network' and 'dim' contradict each other");
    ascc_reader_end(reader, 0);
}

ascc_status ascc_published_read(ascc_plan_builder *builder, ascc_safetensors *file)
{
    ascc_json json;
    const char *text = ascc_safetensors_metadata(file, "architecture");
    if (!text)
        return ascc_fail(builder->message, ASCC_ERROR_FORMAT,
                         "__metadata__ states no 'architecture'");
    const ascc_status status =
        ascc_json_open(&builder->allocator, text, strlen(text), &json, builder->message);
    if (status != ASCC_OK)
        return status;
    published p = {.builder = builder, .plan = &builder->plan, .file = file};
    p.reader = (ascc_reader){.json = &json, .message = builder->message, .status = ASCC_OK};
    check_metadata(&p);
    if (p.reader.status == ASCC_OK)
        read_architecture(&p);
    ascc_json_close(&json);
    return p.reader.status;
}
