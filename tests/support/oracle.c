/* Brute force, in doubles. SPDX-License-Identifier: MIT */
#include "oracle.h"

#include "file/safetensors.h"
#include "network/column.h"
#include "network/operations.h"
#include "relaxation_oracle.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define NOBODY SIZE_MAX

static void *take(size_t count, size_t size)
{
    void *memory = calloc(count + 1, size);
    if (!memory)
        abort();
    return memory;
}

/* ---- Point sets ---- */

typedef struct point {
    double x[3];
    size_t particle; /* fluid row, or fluid count + wall row; NOBODY = of a lattice */
} point;

typedef struct point_set {
    size_t count;
    point *point;
} point_set;

/* Where everything is in one step. */
struct oracle_record {
    point_set set[ASCC_MAX_SETS];
    double *before; /* [fluid][3] positions before the step */
};

static void free_record(oracle_record *record)
{
    for (int s = 0; record && s < ASCC_MAX_SETS; s++)
        free(record->set[s].point);
    if (record)
        free(record->before);
    free(record);
}

static point_set make_set(size_t count)
{
    return (point_set){count, take(count, sizeof(point))};
}

static point_set copy_set(const point_set *from)
{
    point_set to = make_set(from->count);
    if (from->count)
        memcpy(to.point, from->point, from->count * sizeof(point));
    return to;
}

static void add_point(point_set *set, const double x[3], size_t particle)
{
    set->point[set->count].particle = particle;
    memcpy(set->point[set->count++].x, x, 3 * sizeof(double));
}

static void centroid_of(const point_set *all, double center[3])
{
    for (int c = 0; c < 3; c++) {
        center[c] = 0.0;
        for (size_t i = 0; i < all->count; i++)
            center[c] += all->point[i].x[c] / (double)all->count;
    }
}

/* The point of a cell if it is not there yet; places are compared as whole numbers. */
static void add_node(point_set *set, double (*cells)[3], const double cell[3], int dimension,
                     double voxel, double offset, const double anchor[3])
{
    double x[3] = {0.0, 0.0, 0.0};
    for (size_t i = 0; i < set->count; i++)
        if (cells[i][0] == cell[0] && cells[i][1] == cell[1] && cells[i][2] == cell[2])
            return;
    memcpy(cells[set->count], cell, 3 * sizeof(double));
    for (int c = 0; c < dimension; c++)
        x[c] = (cell[c] + offset) * voxel + anchor[c];
    add_point(set, x, NOBODY);
}

static point_set sample_voxels(const ascc_plan *plan, const point_set *all, double voxel)
{
    double anchor[3] = {0.0, 0.0, 0.0};
    const int corners = 1 << plan->dimension;
    point_set set = make_set(all->count * 2 * (size_t)corners);
    double(*cells)[3] = take(set.count, sizeof *cells);
    set.count = 0;
    if (plan->centroid_anchor)
        centroid_of(all, anchor);
    for (size_t i = 0; i < all->count; i++)
        for (int side = -1; side <= 1; side += 2) {
            double cell[3] = {0.0, 0.0, 0.0};
            const bool centers = plan->sampling == ASCC_SAMPLING_CENTERS;
            for (int c = 0; c < plan->dimension; c++)
                cell[c] = floor((all->point[i].x[c] - anchor[c]) / voxel +
                                (centers ? 0.0 : side * plan->hysteresis));
            for (int k = 0; k < (centers ? 1 : corners); k++) {
                const double node[3] = {cell[0] + (k & 1), cell[1] + (k >> 1 & 1),
                                        cell[2] + (k >> 2)};
                add_node(&set, cells, node, plan->dimension, voxel, centers ? 0.5 : 0.0, anchor);
            }
        }
    free(cells);
    return set;
}

static double distance(const double *a, const double *b, size_t d)
{
    double square = 0.0;
    for (size_t c = 0; c < d; c++)
        square += (a[c] - b[c]) * (a[c] - b[c]);
    return sqrt(square);
}

static double square_distance(const double a[3], const double b[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++)
        square += (a[c] - b[c]) * (a[c] - b[c]);
    return square;
}

static bool searches(const ascc_term *term)
{
    return term->operation->lists != NULL;
}

/* The library starts at the first particle in the order of its cells; nothing outside says so. */
static size_t first_in_cells(const ascc_plan *plan, const point_set *all)
{
    double smallest = INFINITY, largest = 0.0;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const bool last = t == plan->term_count;
        if (last ? !plan->output.conserves : !searches(&plan->term[t]))
            continue;
        const double radius = last ? plan->output.term.filter.radius : plan->term[t].filter.radius;
        smallest = fmin(smallest, radius);
        largest = fmax(largest, radius);
        if (last && plan->output.has_walls) {
            smallest = fmin(smallest, plan->output.walls.radius);
            largest = fmax(largest, plan->output.walls.radius);
        }
    }
    int exponent;
    (void)frexp(largest, &exponent);
    const double cell = smallest * (1.0 + 1.0 / 2048.0) + ldexp(1.0, exponent - 27);
    size_t first = 0;
    for (size_t i = 1; i < all->count; i++) {
        int order = 0;
        for (int pass = 0; order == 0 && pass < 2; pass++)
            for (int c = 2; order == 0 && c >= 0; c--) {
                const double a = all->point[i].x[c], b = all->point[first].x[c];
                const double u = pass ? a : floor(a / cell), v = pass ? b : floor(b / cell);
                order = (u > v) - (u < v);
            }
        first = order < 0 ? i : first;
    }
    return first;
}

static point_set sample_farthest(const ascc_plan *plan, const point_set *all, double ratio)
{
    const size_t count = (size_t)ceil(ratio * (double)all->count);
    point_set set = make_set(count);
    double *nearest = take(all->count, sizeof *nearest);
    size_t last = first_in_cells(plan, all);
    for (size_t i = 0; i < all->count; i++)
        nearest[i] = INFINITY;
    for (set.count = 0; set.count < count;) {
        add_point(&set, all->point[last].x, all->point[last].particle);
        size_t farthest = 0;
        nearest[last] = -1.0;
        for (size_t i = 0; i < all->count; i++) {
            nearest[i] = fmin(nearest[i], square_distance(all->point[i].x, all->point[last].x));
            if (nearest[i] > nearest[farthest])
                farthest = i;
        }
        last = farthest;
    }
    free(nearest);
    return set;
}

static bool in_sight(const oracle *o, const point_set *fluid, const double x[3])
{
    const ascc_plan *plan = &o->model->plan;
    for (int c = 0; plan->boundary_crop > 0.0 && c < plan->dimension; c++) {
        double low = INFINITY, high = -INFINITY;
        for (size_t i = 0; i < fluid->count; i++) {
            low = fmin(low, fluid->point[i].x[c]);
            high = fmax(high, fluid->point[i].x[c]);
        }
        if (x[c] < low - plan->boundary_crop || x[c] > high + plan->boundary_crop)
            return false;
    }
    return true;
}

static oracle_record *build_sets(const oracle *o, const double *before, const double *seen)
{
    const ascc_plan *plan = &o->model->plan;
    const size_t d = (size_t)plan->dimension;
    const oracle_record *old = o->mode >= ORACLE_LATTICES ? o->record[o->step] : NULL;
    oracle_record *r = take(1, sizeof *r);
    point_set *fluid = &r->set[ASCC_SET_FLUID], *walls = &r->set[ASCC_SET_BOUNDARY];
    point_set *all = &r->set[ASCC_SET_ALL];
    *fluid = make_set(o->fluid_count);
    r->before = take(o->fluid_count * 3, sizeof(double));
    for (size_t i = 0; i < o->fluid_count; i++) {
        fluid->point[i].particle = i;
        for (size_t c = 0; c < d; c++) {
            fluid->point[i].x[c] = seen[i * d + c];
            r->before[i * 3 + c] = before[i * d + c];
        }
        if (o->mode == ORACLE_POSITIONS) {
            fluid->point[i] = old->set[ASCC_SET_FLUID].point[i];
            memcpy(r->before + i * 3, old->before + i * 3, 3 * sizeof(double));
        }
    }
    *walls = old ? copy_set(&old->set[ASCC_SET_BOUNDARY]) : make_set(o->wall_count);
    if (!old) {
        walls->count = 0;
        for (size_t i = 0; i < o->wall_count; i++) {
            double x[3] = {0.0, 0.0, 0.0};
            memcpy(x, o->wall + i * d, d * sizeof(double));
            if (in_sight(o, fluid, x))
                add_point(walls, x, o->fluid_count + i);
        }
    }
    *all = make_set(fluid->count + walls->count);
    memcpy(all->point, fluid->point, fluid->count * sizeof(point));
    if (walls->count)
        memcpy(all->point + fluid->count, walls->point, walls->count * sizeof(point));
    for (int32_t l = 1; l < plan->level_count; l++)
        r->set[ASCC_SET_LEVEL + l - 1] =
            old ? copy_set(&old->set[ASCC_SET_LEVEL + l - 1])
            : plan->sampling == ASCC_SAMPLING_FARTHEST
                ? sample_farthest(plan, plan->fluid_sampled ? fluid : all, plan->level[l].ratio)
                : sample_voxels(plan, plan->fluid_sampled ? fluid : all, plan->level[l].voxel);
    return r;
}

/* ---- Kernels ---- */

static double bump_at(int bumps, int k, double rho)
{
    const double t = bumps * rho - k, bell = fmax(0.0, 1.0 - t * t);
    return bell * bell;
}

static void basis_factors(const ascc_filter *filter, int dimension, const double d[3], double rho,
                          double *factor)
{
    const double length = sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    const double x = length > 0.0 ? d[0] / length : 0.0, y = length > 0.0 ? d[1] / length : 0.0;
    const double z = length > 0.0 ? d[2] / length : 0.0, root = sqrt(3.0);
    const double flat[5] = {1.0, x, y, 2.0 * x * y, x * x - y * y};
    const double full[9] = {1.0,
                            x,
                            y,
                            z,
                            root * x * y,
                            root * y * z,
                            root * z * x,
                            root / 2.0 * (x * x - y * y),
                            z * z - (x * x + y * y) / 2.0};
    const int harmonics =
        dimension == 2 ? 2 * filter->order + 1 : (filter->order + 1) * (filter->order + 1);
    for (int k = 0; k < filter->bumps; k++)
        for (int m = 0; m < harmonics; m++)
            factor[k * harmonics + m] =
                bump_at(filter->bumps, k, rho) * (dimension == 2 ? flat : full)[m];
}

/* Ball to cylinder, cylinder to cube (docs/method.md). */
static void map_volume(double p[3])
{
    const double pi = acos(-1.0);
    const double flat = hypot(p[0], p[1]), n = hypot(flat, p[2]);
    if (n == 0.0)
        return;
    const bool cap = 1.25 * p[2] * p[2] > flat * flat;
    const double s = cap ? sqrt(3.0 * n / (n + fabs(p[2]))) : n / flat;
    p[2] = cap ? copysign(n, p[2]) : 1.5 * p[2];
    const double x = p[0] * s, y = p[1] * s, h = hypot(x, y);
    p[0] = p[1] = 0.0;
    if (h == 0.0)
        return;
    if (fabs(y) <= fabs(x)) {
        p[0] = copysign(h, x);
        p[1] = p[0] * 4.0 / pi * atan(y / x);
    } else {
        p[1] = copysign(h, y);
        p[0] = p[1] * 4.0 / pi * atan(x / y);
    }
}

static void map_to_cube(ascc_mapping mapping, double p[3])
{
    const double n = sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]);
    const double largest = fmax(fabs(p[0]), fmax(fabs(p[1]), fabs(p[2])));
    if (mapping == ASCC_MAPPING_VOLUME)
        map_volume(p);
    else if (mapping == ASCC_MAPPING_RADIAL && n > 0.0)
        for (int c = 0; c < 3; c++)
            p[c] *= n / largest;
}

static double window_at(ascc_window window, double rho)
{
    return window == ASCC_WINDOW_POLY6  ? pow(fmax(0.0, 1.0 - rho * rho), 3.0)
           : window == ASCC_WINDOW_PEAK ? pow(fmax(0.0, 1.0 - rho), 2.0)
                                        : 1.0;
}

/* Window times trilinear weights, [z][y][x]. */
static void grid_factors(const ascc_filter *filter, const double d[3], double rho, double *factor)
{
    double p[3] = {d[0] / filter->radius, d[1] / filter->radius, d[2] / filter->radius};
    double part[3];
    int low[3], high[3];
    map_to_cube(filter->mapping, p);
    for (int c = 0; c < 3; c++) {
        const int size = filter->cells[c];
        const double at = (p[c] / 2.0 + 0.5) * (size - 1);
        low[c] = (int)fmin(fmax(floor(at), 0.0), size > 1 ? size - 2 : 0);
        high[c] = low[c] + 1 < size ? low[c] + 1 : size - 1;
        part[c] = size > 1 ? fmin(fmax(at - low[c], 0.0), 1.0) : 0.0;
    }
    memset(factor, 0,
           (size_t)(filter->cells[0] * filter->cells[1] * filter->cells[2]) * sizeof *factor);
    for (int corner = 0; corner < 8; corner++) {
        int at[3];
        double share = window_at(filter->window, rho);
        for (int c = 0; c < 3; c++) {
            const bool up = corner >> c & 1;
            at[c] = up ? high[c] : low[c];
            share *= up ? part[c] : 1.0 - part[c];
        }
        factor[(at[2] * filter->cells[1] + at[1]) * filter->cells[0] + at[0]] += share;
    }
}

static double hat_at(int dimension, const double d[3], double voxel)
{
    double hat = 1.0;
    for (int c = 0; c < dimension; c++)
        hat *= fmax(0.0, 1.0 - fabs(d[c]) / voxel);
    return hat;
}

/* ---- Layers ---- */

typedef struct values {
    int32_t set, channels;
    double *row; /* [set count][channels] */
} values;

/* From a point to another within the radius of edges; both may be one. */
typedef struct edge {
    size_t sender, receiver;
} edge;

typedef struct network_state {
    const oracle *o;
    const oracle_record *sets;
    values *value;
    edge *edges;
    size_t edge_count;
} network_state;

static double weight_at(const oracle *o, const float *pointer, size_t index)
{
    return o->weight[(size_t)(pointer - o->model->weights) + index];
}

static double read_value(const network_state *n, int32_t value, bool rectify, size_t row, int32_t a)
{
    const values *v = &n->value[value];
    const double x = v->row[row * (size_t)v->channels + (size_t)a];
    return rectify && x < 0.0 ? 0.0 : x;
}

static int32_t motion_channel(const int32_t *feature, int32_t count, int dimension)
{
    int32_t channel = 0;
    for (int32_t f = 0; f < count; f++) {
        if (feature[f] == ASCC_FEATURE_MOTION)
            return channel;
        channel +=
            feature[f] == ASCC_FEATURE_ONE || feature[f] == ASCC_FEATURE_AREA ? 1 : dimension;
    }
    return -1;
}

/* A fluid particle's motion; that of walls is 0. */
static double motion_of(const network_state *n, size_t fluid, int component)
{
    const ascc_plan *plan = &n->o->model->plan;
    const int32_t first =
        motion_channel(plan->fluid_features, plan->fluid_feature_count, plan->dimension);
    return n->value[0].row[fluid * (size_t)plan->fluid_channels + (size_t)(first + component)];
}

/* What a convolution reads of a neighbour. */
static double source_of(const network_state *n, const ascc_term *term, size_t query, size_t row,
                        int32_t channel)
{
    const ascc_plan *plan = &n->o->model->plan;
    double x = read_value(n, term->source, term->rectify != 0, row, channel);
    if (term->option[ASCC_OPTION_RELATIVE] != 0.0) {
        const int32_t first =
            term->source == 0
                ? motion_channel(plan->fluid_features, plan->fluid_feature_count, plan->dimension)
                : motion_channel(plan->boundary_features, plan->boundary_feature_count,
                                 plan->dimension);
        if (channel >= first && channel < first + plan->dimension)
            x -= motion_of(n, query, channel - first);
    }
    return x;
}

static void add_product(const network_state *n, const ascc_term *term, size_t cell,
                        const double *in, double *out)
{
    for (int32_t b = 0; b < term->outputs; b++)
        for (int32_t a = 0; a < term->inputs; a++)
            out[b] += in[a] *
                      weight_at(n->o, term->tensor[ASCC_TENSOR_WEIGHT],
                                (cell * (size_t)term->inputs + (size_t)a) * (size_t)term->outputs +
                                    (size_t)b);
}

static double displacement(const point *to, const point *from, double d[3])
{
    double square = 0.0;
    for (int c = 0; c < 3; c++) {
        d[c] =
            to->particle == from->particle && to->particle != NOBODY ? 0.0 : to->x[c] - from->x[c];
        square += d[c] * d[c];
    }
    return sqrt(square);
}

/* ---- Edges ---- */

static void find_edges(network_state *n)
{
    const ascc_plan *plan = &n->o->model->plan;
    const point_set *set = &n->sets->set[plan->edge_set];
    double d[3];
    n->edges = take(plan->edge_radius > 0.0 ? set->count * set->count : 0, sizeof *n->edges);
    for (size_t i = 0; plan->edge_radius > 0.0 && i < set->count; i++)
        for (size_t j = 0; j < set->count; j++)
            if (displacement(&set->point[j], &set->point[i], d) <= plan->edge_radius)
                n->edges[n->edge_count++] = (edge){.sender = j, .receiver = i};
}

static size_t rows_of(const network_state *n, int32_t set)
{
    return set == ASCC_SET_EDGES ? n->edge_count : n->sets->set[set].count;
}

static void add_displacement(const network_state *n, size_t row, double *out)
{
    const ascc_plan *plan = &n->o->model->plan;
    const point *at = n->sets->set[plan->edge_set].point;
    double d[3];
    out[plan->dimension] +=
        displacement(&at[n->edges[row].sender], &at[n->edges[row].receiver], d) / plan->edge_radius;
    for (int32_t c = 0; c < plan->dimension; c++)
        out[c] += d[c] / plan->edge_radius;
}

static void sum_edges(const network_state *n, const ascc_term *term, size_t row, double *out)
{
    for (size_t e = 0; e < n->edge_count; e++)
        for (int32_t a = 0; n->edges[e].receiver == row && a < term->inputs; a++)
            out[a] += read_value(n, term->source, term->rectify != 0, e, a);
}

static void normalize(const network_state *n, const ascc_term *term, const double *in, double *out)
{
    double mean = 0.0, variance = 0.0;
    for (int32_t a = 0; a < term->inputs; a++)
        mean += in[a] / term->inputs;
    for (int32_t a = 0; a < term->inputs; a++)
        variance += (in[a] - mean) * (in[a] - mean) / term->inputs;
    for (int32_t a = 0; a < term->inputs; a++)
        out[a] += (in[a] - mean) / sqrt(variance + 1e-5) *
                  weight_at(n->o, term->tensor[ASCC_TENSOR_WEIGHT], (size_t)a);
}

static void convolve(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                     size_t row, double *out)
{
    const ascc_filter *f = &term->filter;
    const int dimension = n->o->model->plan.dimension;
    const size_t cells = (size_t)f->cells[0] * (size_t)f->cells[1] * (size_t)f->cells[2];
    const size_t inputs = (size_t)term->inputs;
    const point_set *source = &n->sets->set[n->value[term->source].set];
    const point *query = &n->sets->set[layer->set].point[row];
    double *factor = take(cells, sizeof *factor), *column = take(cells * inputs, sizeof *column);
    for (size_t j = 0; j < source->count; j++) {
        double d[3];
        const double length = displacement(&source->point[j], query, d);
        if (length > f->radius || (f->skip_self && length == 0.0))
            continue;
        if (f->bumps)
            basis_factors(f, dimension, d, length / f->radius, factor);
        else
            grid_factors(f, d, length / f->radius, factor);
        for (size_t a = 0; a < inputs; a++) {
            const double x = source_of(n, term, row, j, (int32_t)a);
            for (size_t c = 0; c < cells; c++)
                column[c * inputs + a] += factor[c] * x;
        }
    }
    for (size_t c = 0; c < cells; c++)
        add_product(n, term, c, column + c * inputs, out);
    free(column);
    free(factor);
}

/* Pair moments over one list: fluid, or (wall) the boundary. */
/* What a wall stands for, from its feature, which boundary features begin with: 1 without. */
static double area_of(const network_state *n, size_t wall)
{
    const bool known = n->o->model->plan.boundary_features[0] == ASCC_FEATURE_AREA;
    return known ? read_value(n, 1, false, wall, 0) : 1.0;
}

static double *add_moments_of(const network_state *n, bool wall, double radius, int bumps,
                              size_t row, double *out)
{
    const ascc_plan *plan = &n->o->model->plan;
    const point_set *set = &n->sets->set[wall ? ASCC_SET_BOUNDARY : ASCC_SET_FLUID];
    const point *query = &n->sets->set[ASCC_SET_FLUID].point[row];
    const int d = plan->dimension;
    const int32_t normal = plan->boundary_features[0] == ASCC_FEATURE_NORMAL ? 0 : 1;
    for (size_t j = 0; j < set->count; j++) {
        double r[3], q[8] = {1.0}, relative[3];
        const double length = displacement(&set->point[j], query, r);
        for (int c = 0; c < d; c++) {
            const double u = length > 0.0 ? r[c] / length : 0.0;
            const double other = wall ? read_value(n, 1, false, j, normal + c) : motion_of(n, j, c);
            relative[c] = (wall ? 0.0 : other) - motion_of(n, row, c);
            q[1 + c] = u;
            q[1 + d] -= u * relative[c];
            q[2 + d + c] = wall ? other : relative[c];
        }
        for (int k = 0; length < radius && k < bumps; k++)
            for (int m = 0; m < 2 + 2 * d; m++)
                out[k * (2 + 2 * d) + m] += bump_at(bumps, k, length / radius) * q[m] *
                                            (wall && m < 2 + d ? area_of(n, j) : 1.0);
    }
    return out + bumps * (2 + 2 * d);
}

static void add_moments(const network_state *n, const ascc_term *term, size_t row, double *out)
{
    out = add_moments_of(n, false, term->filter.radius, term->filter.bumps, row, out);
    add_moments_of(n, true, term->option[1], (int)term->option[0], row, out);
}

static void transfer(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                     size_t row, double *out)
{
    const point_set *source = &n->sets->set[n->value[term->source].set];
    const point *query = &n->sets->set[layer->set].point[row];
    double *in = take((size_t)term->inputs, sizeof *in), hats = 0.0;
    for (size_t j = 0; j < source->count; j++) {
        double d[3];
        displacement(&source->point[j], query, d);
        const double hat = hat_at(n->o->model->plan.dimension, d, term->option[ASCC_OPTION_VOXEL]);
        hats += hat;
        for (int32_t a = 0; hat > 0.0 && a < term->inputs; a++)
            in[a] += hat * read_value(n, term->source, term->rectify != 0, j, a);
    }
    for (int32_t a = 0;
         term->option[ASCC_OPTION_NORMALIZE] != 0.0 && hats > 0.0 && a < term->inputs; a++)
        in[a] /= hats;
    for (int32_t a = 0; !term->tensor[ASCC_TENSOR_WEIGHT] && a < term->inputs; a++)
        out[a] += in[a];
    if (term->tensor[ASCC_TENSOR_WEIGHT])
        add_product(n, term, 0, in, out);
    free(in);
}

/* What the taps of a stencil read, [tap][channel], x fastest; corners that are not there are 0. */
static double *read_taps(const network_state *n, const ascc_term *term, const point *query)
{
    const ascc_plan *plan = &n->o->model->plan;
    const int32_t set_number = n->value[term->source].set, d = plan->dimension;
    const point_set *set = &n->sets->set[set_number];
    const double voxel = plan->level[set_number - ASCC_SET_LEVEL + 1].voxel;
    double *tap = take(27 * (size_t)term->inputs, sizeof *tap);
    for (size_t j = 0; j < set->count; j++) {
        int number = 0, near = 1;
        for (int c = d - 1; c >= 0; c--) {
            const double steps = round((set->point[j].x[c] - query->x[c]) / voxel);
            near &= fabs(steps) <= 1.0;
            number = number * 3 + (int)fmax(-1.0, fmin(1.0, steps)) + 1;
        }
        for (int32_t a = 0; near && a < term->inputs; a++)
            tap[number * term->inputs + a] = read_value(n, term->source, term->rectify != 0, j, a);
    }
    return tap;
}

static void stencil(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                    size_t row, double *out)
{
    const int d = n->o->model->plan.dimension, taps = d == 2 ? 9 : 27;
    const bool sums = term->option[3] != 0.0;
    const int32_t in = term->inputs, reads = in + (sums ? d : 0);
    double *tap = read_taps(n, term, &n->sets->set[layer->set].point[row]);
    double mass = 0.0, u[3] = {0.0, 0.0, 0.0};
    for (int t = 0; sums && t < taps; t++) {
        double w = 1.0;
        for (int c = 0, at = t; c < d; c++, at /= 3)
            w *= at % 3 == 1 ? 0.5 : 0.25;
        mass += w * tap[t * in];
        for (int c = 0; c < d; c++)
            u[c] += w * tap[t * in + 1 + c];
    }
    for (int t = 0; t < taps; t++) {
        double x[64];
        for (int32_t a = 0; a < in; a++)
            x[a] = tap[t * in + a];
        for (int c = 0; sums && c < d; c++) {
            const double mean = mass > 0.0 ? u[c] / mass : 0.0;
            x[1 + c] -= x[0] * mean;
            x[in + c] = -x[1 + d] * mean;
        }
        for (int32_t b = 0; b < term->outputs; b++)
            for (int32_t a = 0; a < reads; a++)
                out[b] += x[a] * weight_at(n->o, term->tensor[ASCC_TENSOR_WEIGHT],
                                           (size_t)((t * reads + a) * term->outputs + b));
    }
    free(tap);
}

/* Source points within the radius of a query in the order of their distance, at most the limit; how many. */
static size_t nearest_of(const network_state *n, const ascc_term *term, const point *query,
                         size_t *nearest)
{
    const point_set *source = &n->sets->set[n->value[term->source].set];
    double d[3];
    size_t count = 0;
    for (size_t j = 0; j < source->count; j++) {
        const double length = displacement(&source->point[j], query, d);
        if (length > term->filter.radius)
            continue;
        size_t at = count++;
        for (; at > 0 && displacement(&source->point[nearest[at - 1]], query, d) > length; at--)
            nearest[at] = nearest[at - 1];
        nearest[at] = j;
    }
    const size_t limit = (size_t)term->filter.neighbor_limit;
    return limit && count > limit ? limit : count;
}

static bool shared_row(const network_state *n, int32_t source, int32_t set, size_t row, size_t *at);

/* relu(bias + in matrix) */
static void rectified_product(const network_state *n, const double *in, size_t inputs,
                              const float *matrix, const float *bias, size_t outputs, double *out)
{
    for (size_t b = 0; b < outputs; b++) {
        out[b] = weight_at(n->o, bias, b);
        for (size_t a = 0; a < inputs; a++)
            out[b] += in[a] * weight_at(n->o, matrix, a * outputs + b);
        out[b] = fmax(0.0, out[b]);
    }
}

static void abstract(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                     size_t row, double *out)
{
    enum { RELATIVE = 0, HIDDEN = 1, MEAN = 2 };
    const point_set *source = &n->sets->set[n->value[term->source].set];
    const point *query = &n->sets->set[layer->set].point[row];
    const size_t inputs = (size_t)term->inputs, outputs = (size_t)term->outputs;
    const size_t d = (size_t)n->o->model->plan.dimension, hidden = (size_t)term->option[HIDDEN];
    size_t *nearest = take(source->count, sizeof *nearest), own = 0;
    double *in = take(inputs + d, sizeof *in), *h = take(hidden, sizeof *h);
    double *value = take(outputs, sizeof *value), *pooled = take(outputs, sizeof *pooled), r[3];
    const size_t count = nearest_of(n, term, query, nearest);
    if (term->option[RELATIVE] != 0.0)
        shared_row(n, n->value[term->source].set, layer->set, row, &own);
    for (size_t k = 0; k < count; k++) {
        displacement(&source->point[nearest[k]], query, r);
        for (size_t a = 0; a < inputs; a++)
            in[a] = read_value(n, term->source, term->rectify != 0, nearest[k], (int32_t)a) -
                    (term->option[RELATIVE] != 0.0
                         ? read_value(n, term->source, term->rectify != 0, own, (int32_t)a)
                         : 0.0);
        for (size_t c = 0; c < d; c++)
            in[inputs + c] = r[c] / term->filter.radius;
        rectified_product(n, in, inputs + d, term->tensor[2], term->tensor[3], hidden, h);
        rectified_product(n, h, hidden, term->tensor[0], term->tensor[1], outputs, value);
        for (size_t b = 0; b < outputs; b++)
            pooled[b] = term->option[MEAN] != 0.0 ? pooled[b] + value[b] / (double)count
                                                  : fmax(pooled[b], value[b]);
    }
    for (size_t b = 0; b < outputs; b++)
        out[b] += pooled[b];
    free(pooled);
    free(value);
    free(h);
    free(in);
    free(nearest);
}

static void interpolate(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                        size_t row, double *out)
{
    const point_set *source = &n->sets->set[n->value[term->source].set];
    const point *query = &n->sets->set[layer->set].point[row];
    size_t *nearest = take(source->count, sizeof *nearest);
    double *in = take((size_t)term->inputs, sizeof *in), r[3], sum = 0.0;
    const size_t count = nearest_of(n, term, query, nearest);
    for (size_t k = 0; k < count; k++) {
        const double q = displacement(&source->point[nearest[k]], query, r) / term->filter.radius;
        const double weight = 1.0 / (q * q + 1e-6);
        sum += weight;
        for (int32_t a = 0; a < term->inputs; a++)
            in[a] += weight * read_value(n, term->source, term->rectify != 0, nearest[k], a);
    }
    for (int32_t a = 0; count && a < term->inputs; a++)
        in[a] /= sum;
    for (int32_t a = 0; !term->tensor[ASCC_TENSOR_WEIGHT] && a < term->inputs; a++)
        out[a] += in[a];
    if (term->tensor[ASCC_TENSOR_WEIGHT])
        add_product(n, term, 0, in, out);
    free(in);
    free(nearest);
}

/* The source's row that is the layer's; false where there is none. */
static bool shared_row(const network_state *n, int32_t source, int32_t set, size_t row, size_t *at)
{
    const size_t fluid = n->sets->set[ASCC_SET_FLUID].count;
    *at = row;
    if (source == set)
        return true;
    if (set == ASCC_SET_ALL) {
        *at = source == ASCC_SET_FLUID ? row : row - fluid;
        return (row < fluid) == (source == ASCC_SET_FLUID);
    }
    *at = set == ASCC_SET_FLUID ? row : row + fluid; /* part of all */
    return true;
}

static void add_term(const network_state *n, const ascc_layer *layer, const ascc_term *term,
                     size_t row, double *out)
{
    size_t from = 0;
    if (!searches(term) && term->operation != &ascc_op_sum &&
        !shared_row(n, n->value[term->source].set, layer->set, row, &from))
        return;
    if (term->operation == &ascc_op_gather)
        from = term->option[0] == ASCC_END_SENDER ? n->edges[row].sender : n->edges[row].receiver;
    if (term->operation == &ascc_op_displacement) {
        add_displacement(n, row, out);
    } else if (term->operation == &ascc_op_sum) {
        sum_edges(n, term, row, out);
    } else if (term->operation == &ascc_op_grid || term->operation == &ascc_op_basis) {
        convolve(n, layer, term, row, out);
    } else if (term->operation == &ascc_op_stencil) {
        stencil(n, layer, term, row, out);
    } else if (term->operation == &ascc_op_moments) {
        add_moments(n, term, row, out);
    } else if (term->operation == &ascc_op_transfer) {
        transfer(n, layer, term, row, out);
    } else if (term->operation == &ascc_op_abstraction) {
        abstract(n, layer, term, row, out);
        return; /* its biases are within */
    } else if (term->operation == &ascc_op_interpolation) {
        interpolate(n, layer, term, row, out);
    } else {
        double *in = take((size_t)term->inputs, sizeof *in);
        for (int32_t a = 0; a < term->inputs; a++)
            in[a] = read_value(n, term->source, term->rectify != 0, from, a);
        const bool adds =
            term->operation == &ascc_op_identity || term->operation == &ascc_op_gather;
        if (term->operation == &ascc_op_dense)
            add_product(n, term, 0, in, out);
        else if (term->operation == &ascc_op_normalize)
            normalize(n, term, in, out);
        else if (!adds)
            n->o->add_other(term, in, out);
        for (int32_t a = 0; adds && a < term->inputs; a++)
            out[a] += in[a];
        free(in);
    }
    for (int32_t b = 0; term->tensor[ASCC_TENSOR_BIAS] && b < term->outputs; b++)
        out[b] += weight_at(n->o, term->tensor[ASCC_TENSOR_BIAS], (size_t)b);
}

static values make_values(const network_state *n, int32_t set, int32_t channels)
{
    const size_t count = rows_of(n, set);
    return (values){set, channels, take(count * (size_t)channels, sizeof(double))};
}

static void run_layer(network_state *n, int32_t l)
{
    const ascc_plan *plan = &n->o->model->plan;
    const ascc_layer *layer = &plan->layer[l];
    values *v = &n->value[l + 2];
    *v = make_values(n, layer->set, layer->channels);
    for (size_t row = 0; row < rows_of(n, layer->set); row++)
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
            add_term(n, layer, &plan->term[t], row,
                     v->row + row * (size_t)layer->channels + plan->term[t].column);
}

static void set_features(const ascc_plan *plan, const int32_t *feature, int32_t count,
                         const double *vector, const double *past, const double *gravity, bool wall,
                         double area, double *to)
{
    for (int32_t f = 0; f < count; f++)
        if (feature[f] == ASCC_FEATURE_ONE)
            *to++ = 1.0;
        else if (feature[f] == ASCC_FEATURE_AREA)
            *to++ = area;
        else if (feature[f] == ASCC_FEATURE_HISTORY)
            for (int c = 0; c < plan->history * plan->dimension; c++)
                *to++ = past[c] * plan->time_step / plan->spacing;
        else
            for (int c = 0; c < plan->dimension; c++)
                *to++ = feature[f] == ASCC_FEATURE_GRAVITY
                            ? gravity[c] * plan->time_step * plan->time_step / plan->spacing
                        : feature[f] != ASCC_FEATURE_MOTION ? vector[c] * area
                        : wall                              ? 0.0
                               : vector[c] * plan->time_step / plan->spacing;
}

/* The share of the area that the spline weighs, in spacings^(dimension - 1), if the features have it. */
static double wall_area(const oracle *o, size_t wall)
{
    const ascc_plan *plan = &o->model->plan;
    const size_t d = (size_t)plan->dimension;
    const double support =
        plan->relaxation.pressure.count ? plan->relaxation.support : 2.0 * plan->spacing;
    const double whole = d == 2 ? 3.0 / 4.0 : 7.0 / 40.0 * acos(-1.0);
    double sum = 0.0;
    if (plan->boundary_features[0] != ASCC_FEATURE_AREA)
        return 1.0;
    for (size_t i = 0; i < o->wall_count; i++) {
        const double q = distance(o->wall + wall * d, o->wall + i * d, d) / support;
        sum += q < 1.0 ? 2.0 * pow(1.0 - q, 3.0) - 8.0 * pow(fmax(0.0, 0.5 - q), 3.0) : 0.0;
    }
    return whole * pow(support / plan->spacing, (double)d - 1.0) / sum;
}

static void run_layers(network_state *n, const double *velocity)
{
    const oracle *o = n->o;
    const ascc_plan *plan = &o->model->plan;
    const size_t d = (size_t)plan->dimension;
    find_edges(n);
    n->value[0] = make_values(n, ASCC_SET_FLUID, plan->fluid_channels);
    n->value[1] = make_values(n, ASCC_SET_BOUNDARY, plan->boundary_channels);
    for (size_t i = 0; i < o->fluid_count; i++)
        set_features(plan, plan->fluid_features, plan->fluid_feature_count, velocity + i * d,
                     o->past ? o->past + i * (size_t)plan->history * d : NULL, o->gravity, false,
                     1.0, n->value[0].row + i * (size_t)plan->fluid_channels);
    for (size_t i = 0; i < n->sets->set[ASCC_SET_BOUNDARY].count; i++) {
        const size_t wall = n->sets->set[ASCC_SET_BOUNDARY].point[i].particle - o->fluid_count;
        set_features(plan, plan->boundary_features, plan->boundary_feature_count,
                     o->normal + wall * d, NULL, o->gravity, true, wall_area(o, wall),
                     n->value[1].row + i * (size_t)plan->boundary_channels);
    }
    for (int32_t l = 0; l < plan->layer_count; l++)
        run_layer(n, l);
}

/* ---- The output ---- */

/* The whole last kernel from what is stored. A kernel stored whole is odd; moved weights are made so. */
static double odd_kernel(const oracle *o, const int at[3], size_t value, size_t per_cell)
{
    const ascc_output *output = &o->model->plan.output;
    const int32_t *n = output->term.filter.cells;
    if (o->half_axis < 0) {
        const size_t cell = (size_t)((at[2] * n[1] + at[1]) * n[0] + at[0]);
        const size_t mirror = (size_t)(n[0] * n[1] * n[2] - 1) - cell;
        return 0.5 *
               (weight_at(o, output->term.tensor[ASCC_TENSOR_STRENGTH], cell * per_cell + value) -
                weight_at(o, output->term.tensor[ASCC_TENSOR_STRENGTH], mirror * per_cell + value));
    }
    int own[3] = {at[0], at[1], at[2]}, size[3] = {n[0], n[1], n[2]};
    size[o->half_axis] /= 2;
    const bool lower = at[o->half_axis] < size[o->half_axis];
    for (int c = 0; lower && c < 3; c++)
        own[c] = n[c] - 1 - at[c];
    own[o->half_axis] -= size[o->half_axis];
    const size_t cell = (size_t)((own[2] * size[1] + own[1]) * size[0] + own[0]);
    return (lower ? -1.0 : 1.0) * o->weight[o->half + cell * per_cell + value];
}

static void grid_pair(const network_state *n, const double *sum, const double d[3], double length,
                      double *correction)
{
    const ascc_plan *plan = &n->o->model->plan;
    const ascc_output *output = &plan->output;
    const int32_t *cells = output->term.filter.cells;
    const size_t d_count = (size_t)plan->dimension, inputs = (size_t)output->term.inputs;
    double *factor = take((size_t)cells[0] * (size_t)cells[1] * (size_t)cells[2], sizeof *factor);
    double term[3] = {0.0, 0.0, 0.0}, along = 0.0;
    grid_factors(&output->term.filter, d, length / output->term.filter.radius, factor);
    for (int z = 0, cell = 0; z < cells[2]; z++)
        for (int y = 0; y < cells[1]; y++)
            for (int x = 0; x < cells[0]; x++, cell++)
                for (size_t k = 0; factor[cell] != 0.0 && k < inputs * d_count; k++)
                    term[k % d_count] +=
                        factor[cell] * sum[k / d_count] *
                        odd_kernel(n->o, (const int[3]){x, y, z}, k, inputs * d_count);
    free(factor);
    for (size_t c = 0; c < d_count; c++) {
        term[c] *= output->scale[c];
        along += term[c] * d[c] / length;
    }
    for (size_t c = 0; c < d_count; c++)
        correction[c] += output->central ? along * d[c] / length : term[c];
}

/* Sum over bumps and inputs of phi f tensor. */
static double strength_of(const network_state *n, const ascc_filter *filter, const float *tensor,
                          const double *f, double length)
{
    const int32_t inputs = n->o->model->plan.output.term.inputs;
    double strength = 0.0;
    for (int k = 0; tensor && length < filter->radius && k < filter->bumps; k++)
        for (int32_t a = 0; a < inputs; a++)
            strength += bump_at(filter->bumps, k, length / filter->radius) * f[a] *
                        weight_at(n->o, tensor, (size_t)(k * inputs + a));
    return strength;
}

/* A pair along a line: i is a fluid particle, j another or (NOBODY) a wall at wall_at. */
static void central_pair(const network_state *n, const ascc_filter *filter, const float *tensor,
                         const float *damping, const double *f, const double seen[3], size_t i,
                         size_t j, const double *wall_at, double *correction)
{
    const ascc_plan *plan = &n->o->model->plan;
    const double length = sqrt(seen[0] * seen[0] + seen[1] * seen[1] + seen[2] * seen[2]);
    double line[3] = {seen[0], seen[1], seen[2]}, approach = 0.0;
    const bool before = plan->output.current_direction && !wall_at;
    for (size_t c = 0; before && c < 3; c++)
        line[c] = n->sets->before[j * 3 + c] - n->sets->before[i * 3 + c];
    const double across = sqrt(line[0] * line[0] + line[1] * line[1] + line[2] * line[2]);
    if (across == 0.0 || length == 0.0)
        return;
    double strength = strength_of(n, filter, tensor, f, length);
    if (before)
        strength *= (line[0] * seen[0] + line[1] * seen[1] + line[2] * seen[2]) / (across * length);
    for (int c = 0; damping && c < plan->dimension; c++)
        approach += (motion_of(n, i, c) - (wall_at ? 0.0 : motion_of(n, j, c))) * line[c] / across;
    if (damping)
        strength -= strength_of(n, filter, damping, f, length) * approach;
    double given = plan->output.scale[0] * strength;
    if (plan->output.limit > 0.0)
        given = fmax(-plan->output.limit, fmin(plan->output.limit, given));
    for (int c = 0; c < plan->dimension; c++)
        correction[c] += given * line[c] / across;
}

static void correct_particle(const network_state *n, size_t i, double *correction)
{
    const ascc_plan *plan = &n->o->model->plan;
    const ascc_output *output = &plan->output;
    const values *v = &n->value[output->term.source];
    const bool rectify = output->term.rectify != 0;
    const point_set *set = &n->sets->set[v->set], *walls = &n->sets->set[ASCC_SET_BOUNDARY];
    double *f = take((size_t)output->term.inputs, sizeof *f), d[3];
    for (size_t j = 0; j < set->count; j++) {
        const double length = displacement(&set->point[j], &set->point[i], d);
        if (length > output->term.filter.radius || length == 0.0)
            continue;
        for (int32_t a = 0; a < output->term.inputs; a++)
            f[a] = read_value(n, output->term.source, rectify, i, a) +
                   read_value(n, output->term.source, rectify, j, a);
        if (!output->term.filter.bumps) {
            grid_pair(n, f, d, length, correction);
            continue;
        }
        const bool wall = j >= n->o->fluid_count;
        central_pair(n, &output->term.filter, output->term.tensor[ASCC_TENSOR_STRENGTH],
                     output->term.tensor[ASCC_TENSOR_DAMPING], f, d, i, j,
                     wall ? set->point[j].x : NULL, correction);
    }
    for (size_t j = 0; output->has_walls && j < walls->count; j++) {
        for (int32_t a = 0; a < output->term.inputs; a++)
            f[a] = area_of(n, j) * read_value(n, output->term.source, rectify, i, a);
        displacement(&walls->point[j], &set->point[i], d);
        central_pair(n, &output->walls, output->term.tensor[ASCC_TENSOR_WALL],
                     output->term.tensor[ASCC_TENSOR_WALL_DAMPING], f, d, i, NOBODY,
                     walls->point[j].x, correction);
    }
    free(f);
}

static void run_output(const network_state *n, double *correction)
{
    const ascc_plan *plan = &n->o->model->plan;
    const ascc_output *output = &plan->output;
    const size_t d = (size_t)plan->dimension;
    for (size_t i = 0; i < n->o->fluid_count; i++) {
        for (size_t c = 0; !output->conserves && c < d; c++)
            correction[i * d + c] =
                output->scale[c] *
                read_value(n, output->term.source, output->term.rectify != 0, i, (int32_t)c);
        if (output->conserves)
            correct_particle(n, i, correction + i * d);
    }
}

/* ---- A step ---- */

static void relax(const network_state *n, const double *before, double *position, double *velocity)
{
    const oracle *o = n->o;
    const int32_t value = o->model->plan.relaxation.guess;
    double *guess = take(o->fluid_count, sizeof *guess);
    for (size_t i = 0; value && i < o->fluid_count; i++)
        guess[i] = read_value(n, value, true, i, 0);
    relaxation_oracle(&o->model->plan, o->fluid_count, o->wall_count, o->wall, before,
                      value ? guess : NULL, o->gravity, position, velocity);
    free(guess);
}

static void add_past(const oracle *o, const double *velocity)
{
    const size_t d = (size_t)o->model->plan.dimension, n = (size_t)o->model->plan.history;
    for (size_t i = 0; n && i < o->fluid_count; i++) {
        memmove(o->past + (i * n + 1) * d, o->past + i * n * d, (n - 1) * d * sizeof *o->past);
        memcpy(o->past + i * n * d, velocity + i * d, d * sizeof *o->past);
    }
}

void oracle_step(oracle *o, double *position, double *velocity, double *correction)
{
    const ascc_plan *plan = &o->model->plan;
    const size_t d = (size_t)plan->dimension, numbers = o->fluid_count * d;
    const double dt = plan->time_step;
    double *after = take(numbers, sizeof *after), *seen = take(numbers, sizeof *seen);
    double *moved = take(numbers, sizeof *moved), *before = take(numbers, sizeof *before);
    memcpy(before, position, numbers * sizeof *before);
    for (size_t k = 0; k < numbers; k++) {
        after[k] = velocity[k] + dt * o->gravity[k % d];
        seen[k] = position[k] + (plan->advection == ASCC_ADVECT_NONE ? 0.0
                                 : plan->advection == ASCC_ADVECT_END
                                     ? dt * after[k]
                                     : dt * 0.5 * (velocity[k] + after[k]));
    }
    oracle_record *sets = build_sets(o, position, seen);
    network_state n = {
        .o = o, .sets = sets, .value = take((size_t)plan->layer_count + 2, sizeof(values))};
    run_layers(&n, after);
    run_output(&n, moved);
    add_past(o, velocity);
    for (size_t k = 0; k < numbers; k++) {
        const double carried =
            plan->advection == ASCC_ADVECT_MEAN ? 0.5 * (velocity[k] + after[k]) : after[k];
        velocity[k] = carried + moved[k] / dt;
        position[k] += dt * velocity[k];
        if (correction)
            correction[k] = moved[k];
    }
    if (plan->relaxation.pressure.count)
        relax(&n, before, position, velocity);
    for (int32_t v = 0; v < plan->layer_count + 2; v++)
        free(n.value[v].row);
    free(n.value);
    free(n.edges);
    free(before);
    free(moved);
    free(seen);
    free(after);
    if (o->mode == ORACLE_RECORD) {
        free_record(o->record[o->step]);
        o->record[o->step] = sets;
    } else {
        free_record(sets);
    }
    o->step++;
}

oracle oracle_open(const ascc_model *model, const double *weight)
{
    oracle o = {.model = model, .weight = weight, .half_axis = -1};
    memcpy(o.gravity, model->plan.gravity, sizeof o.gravity);
    return o;
}

size_t oracle_tensors(const ascc_model *model, oracle_tensor list[ORACLE_MAX_TENSORS])
{
    const ascc_allocator allocator = ascc_allocator_default();
    ascc_safetensors file;
    ascc_message message;
    size_t offset = 0;
    if (ascc_safetensors_open(&allocator, model->bytes, model->byte_count, &file, &message) !=
            ASCC_OK ||
        file.tensor_count > ORACLE_MAX_TENSORS)
        abort();
    const size_t count = file.tensor_count;
    for (size_t i = 0; i < count; i++) {
        if (strlen(file.tensor[i].name) >= sizeof list->name)
            abort();
        memcpy(list[i].name, file.tensor[i].name, strlen(file.tensor[i].name) + 1);
        list[i].offset = offset;
        list[i].count = file.tensor[i].count;
        offset += (list[i].count + 15) / 16 * 16; /* tensors begin on lines of the cache */
    }
    ascc_safetensors_close(&file);
    return count;
}

void oracle_set_half(oracle *o, const char *half_axis)
{
    oracle_tensor list[ORACLE_MAX_TENSORS];
    const size_t count = oracle_tensors(o->model, list);
    o->half_axis = half_axis ? half_axis[0] - 'x' : -1;
    for (size_t i = 0; half_axis && i < count; i++)
        if (strcmp(list[i].name, "output.kernel") == 0)
            o->half = list[i].offset;
}

double *oracle_weights(const ascc_model *model)
{
    double *weight = take(model->weight_count, sizeof *weight);
    for (size_t i = 0; i < model->weight_count; i++)
        weight[i] = (double)model->weights[i];
    return weight;
}

void oracle_close(oracle *o)
{
    for (int s = 0; s < ORACLE_MAX_STEPS; s++) {
        free_record(o->record[s]);
        o->record[s] = NULL;
    }
}

/* ---- The loss ---- */

static int ascending(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

/* The value of that rank, read as the middle of its bin. Sorts the values. */
static double percentile(double *value, size_t count, double share, double bin)
{
    size_t rank = 0; /* of the first value that no less than the share is at or below */
    qsort(value, count, sizeof *value, ascending);
    while (rank + 1 < count && (double)(rank + 1) < share * (double)count)
        rank++;
    return (floor(value[rank] / bin) + 0.5) * bin;
}

static double density_of(const oracle *o, const double *x, size_t i)
{
    const size_t d = (size_t)o->model->plan.dimension;
    double rho = 0.0;
    for (size_t j = 0; j < o->fluid_count; j++) {
        const double q = distance(x + i * d, x + j * d, d) / (2.0 * o->model->plan.spacing);
        rho += pow(fmax(0.0, 1.0 - q * q), 3.0);
    }
    return rho;
}

/* How far a place is into the fluid from its nearest wall within `reach`; false without one. */
static bool clearance(const oracle *o, const double *x, double reach, double *s)
{
    const size_t d = (size_t)o->model->plan.dimension;
    size_t nearest = NOBODY;
    double least = reach;
    for (size_t b = 0; b < o->wall_count; b++)
        if (distance(x, o->wall + b * d, d) <= least) {
            least = distance(x, o->wall + b * d, d);
            nearest = b;
        }
    *s = 0.0;
    for (size_t c = 0; nearest != NOBODY && c < d; c++)
        *s += (x[c] - o->wall[nearest * d + c]) * o->normal[nearest * d + c];
    return nearest != NOBODY;
}

static void true_frame(const oracle *o, const oracle_sequence *sequence, size_t frame, double *x)
{
    const size_t numbers = o->fluid_count * (size_t)o->model->plan.dimension;
    for (size_t k = 0; k < numbers; k++)
        x[k] = (double)sequence->position[frame * numbers + k];
}

/* Within which radius the last layer sees: ascc_model_info says the same. 2 spacings where it sees no neighbours. */
static double support_radius(const ascc_plan *plan)
{
    const ascc_layer *layer = &plan->layer[plan->output.term.source - 2];
    double radius = 0.0;
    if (plan->output.conserves)
        return plan->output.term.filter.radius;
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
        if (searches(&plan->term[t]))
            radius = fmax(radius, plan->term[t].filter.radius);
    return radius > 0.0 ? radius : 2.0 * plan->spacing;
}

static double neighbors_of(const oracle *o, const double *x, size_t i)
{
    const size_t d = (size_t)o->model->plan.dimension;
    double count = 0.0;
    for (size_t j = 0; j < o->fluid_count; j++)
        count += j != i && distance(x + i * d, x + j * d, d) <= support_radius(&o->model->plan);
    return count;
}

oracle_references oracle_measure(const oracle *o, const oracle_sequence *sequence)
{
    const size_t d = (size_t)o->model->plan.dimension, n = o->fluid_count;
    const size_t rows = sequence->frame_count * n;
    double *all = take(rows, sizeof *all), *x = take(n * d, sizeof *x);
    double *near = take(rows, sizeof *near), spacing = o->model->plan.spacing;
    size_t count = 0;
    oracle_references r = {0.0, -INFINITY};
    for (size_t t = 0; t < sequence->frame_count; t++) {
        true_frame(o, sequence, t, x);
        for (size_t i = 0; i < n; i++) {
            all[t * n + i] = density_of(o, x, i);
            count += clearance(o, x + i * d, spacing, &near[count]);
        }
    }
    r.density = percentile(all, rows, 0.95, 1.0 / 64.0);
    if (count)
        r.clearance = percentile(near, count, 0.05, spacing / 2048.0);
    free(near);
    free(x);
    free(all);
    return r;
}

static double frame_loss(const oracle *o, const double *x, const double *y,
                         const oracle_loss_options *options, const oracle_references *r)
{
    const size_t d = (size_t)o->model->plan.dimension, n = o->fluid_count;
    const double h = o->model->plan.spacing;
    const double share = options->neighbor_weight == 0.0  ? 1.0
                         : options->neighbor_weight < 0.0 ? 0.0
                                                          : options->neighbor_weight;
    double sum = 0.0, weights = 0.0, penalty = 0.0, mean = 0.0;
    for (size_t i = 0; i < n; i++)
        mean += neighbors_of(o, y, i) / (double)n;
    for (size_t i = 0; i < n; i++) {
        double s;
        const double w = mean > 0.0 ? exp(-share * neighbors_of(o, y, i) / mean) : 1.0;
        weights += w;
        sum += w * distance(x + i * d, y + i * d, d) / h;
        penalty += options->density_weight / (double)n *
                   pow(fmax(0.0, density_of(o, x, i) / r->density - 1.0), 2.0);
        if (clearance(o, x + i * d, 4.0 * h, &s))
            penalty +=
                options->wall_weight / (double)n * pow(fmax(0.0, (r->clearance - s) / h), 2.0);
    }
    return sum / weights + penalty;
}

double oracle_loss(oracle *o, const oracle_sequence *sequence, const oracle_references *references,
                   const oracle_loss_options *options, size_t frame, int warm_up, int unroll)
{
    const size_t d = (size_t)o->model->plan.dimension, numbers = o->fluid_count * d;
    double *x = take(numbers, sizeof *x), *v = take(numbers, sizeof *v);
    double *y = take(numbers, sizeof *y), loss = 0.0;
    double *before = take(numbers, sizeof *before), *way = take(numbers, sizeof *way);
    true_frame(o, sequence, frame - 1, y);
    true_frame(o, sequence, frame, x);
    for (size_t k = 0; k < numbers; k++)
        v[k] = (x[k] - y[k]) / o->model->plan.time_step;
    const size_t history = (size_t)o->model->plan.history;
    o->past = take(history * numbers, sizeof *o->past);
    for (size_t age = 0; age < history; age++) {
        const bool there = frame >= age + 2;
        true_frame(o, sequence, there ? frame - age - 1 : 1, way);
        true_frame(o, sequence, there ? frame - age - 2 : 0, before);
        for (size_t k = 0; k < numbers; k++)
            o->past[(k / d * history + age) * d + k % d] =
                (way[k] - before[k]) / o->model->plan.time_step;
    }
    o->step = 0;
    const double *moved = o->weight;
    for (int t = 1; t <= warm_up + unroll; t++) {
        o->weight = t <= warm_up && o->still ? o->still : moved;
        oracle_step(o, x, v, NULL);
        true_frame(o, sequence, frame + (size_t)t, y);
        if (t > warm_up)
            loss += frame_loss(o, x, y, options, references) / unroll;
        true_frame(o, sequence, frame + (size_t)t - 1, before);
        for (size_t k = 0; k < numbers; k++)
            way[k] = v[k] * o->model->plan.time_step + before[k];
        for (size_t i = 0; t > warm_up && i < o->fluid_count; i++)
            loss += options->velocity_weight * distance(way + i * d, y + i * d, d) /
                    (o->model->plan.spacing * (double)o->fluid_count * unroll);
    }
    o->weight = moved;
    free(o->past);
    o->past = NULL;
    free(way);
    free(before);
    free(y);
    free(v);
    free(x);
    return loss;
}
