/* Layer by layer: which rows are needed, which neighbours they have, what they are worth.
 * SPDX-License-Identifier: MIT */
#include "network.h"

#include <math.h>
#include <string.h>

#define WANTS_RAW 1
#define WANTS_RECTIFIED 2

/* Rows that are computed together: their columns share one pass over the weights. */
#define TILE_ROWS 24
/* Floats between the columns of a tile beyond their length, so that they do not collide in the cache. */
#define COLUMN_PADDING 16

int32_t ascc_network_set(const ascc_network *network, int32_t value)
{
    return value < 2 ? value : network->plan->layer[value - 2].set;
}

int32_t ascc_network_channels(const ascc_network *network, int32_t value)
{
    const ascc_plan *plan = network->plan;
    return value == 0   ? plan->fluid_channels
           : value == 1 ? plan->boundary_channels
                        : plan->layer[value - 2].channels;
}

size_t ascc_cell_count(const ascc_filter *filter)
{
    return (size_t)filter->cells[0] * (size_t)filter->cells[1] * (size_t)filter->cells[2];
}

/* ---- Prepared once ---- */

/* A radius whose cells serve the search of a cube: one that is searched anyway, if it is little more. */
static double cube_reach(const ascc_plan *plan, double cube)
{
    double reach = INFINITY;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const bool last = t == plan->term_count;
        const double radius = last ? plan->output.filter.radius : plan->term[t].filter.radius;
        const bool ball = last || plan->term[t].kind == ASCC_TERM_CONVOLUTION;
        if (ball && radius >= cube && radius < reach)
            reach = radius;
    }
    return reach <= 1.5 * cube ? reach : cube;
}

static int32_t find_key(ascc_network *network, int32_t query, int32_t source,
                        const ascc_filter *filter, bool skip_self, double cube)
{
    ascc_rows_key wanted = {.query = query,
                            .source = source,
                            .skip_self = skip_self,
                            .limit = filter->neighbor_limit,
                            .radius = cube > 0.0 ? cube_reach(network->plan, cube) : filter->radius,
                            .cube = cube};
    int32_t k = 0;
    for (; k < network->key_count; k++) {
        const ascc_rows_key *key = &network->key[k];
        if (key->query == query && key->source == source && key->skip_self == wanted.skip_self &&
            key->limit == wanted.limit && key->radius == wanted.radius && key->cube == cube)
            break;
    }
    if (k == network->key_count)
        network->key[network->key_count++] = wanted;
    return k;
}

static size_t arranged_size(const ascc_plan *plan, int32_t t)
{
    const ascc_output *output = &plan->output;
    if (t == plan->term_count)
        return output->kind != ASCC_OUTPUT_ANTISYMMETRIC ? 0
               : output->filter.bumps ? ASCC_PARTS * ASCC_MAX_BUMPS * ascc_padded(output->inputs)
                                      : ascc_cell_count(&output->filter) * (size_t)plan->dimension *
                                            ascc_padded(output->inputs);
    const ascc_term *term = &plan->term[t];
    if (term->kind == ASCC_TERM_IDENTITY)
        return 0;
    const size_t cells = term->kind == ASCC_TERM_CONVOLUTION ? ascc_cell_count(&term->filter) : 1;
    return cells * ascc_padded(term->inputs) * ascc_padded(term->outputs);
}

const float *ascc_output_part(const ascc_output *output, int part, size_t *bumps)
{
    const float *const weights[ASCC_PARTS] = {output->weight, output->damping, output->walls.weight,
                                              output->walls.damping};
    *bumps = (size_t)(part < ASCC_PART_WALL ? output->filter.bumps : output->walls.filter.bumps);
    return weights[part];
}

static void arrange_parts(const ascc_output *output, float *to)
{
    const size_t a = (size_t)output->inputs, size = ascc_padded(output->inputs) * ASCC_MAX_BUMPS;
    memset(to, 0, ASCC_PARTS * size * sizeof *to);
    for (int part = 0; part < ASCC_PARTS; part++, to += size) {
        size_t bumps;
        const float *from = ascc_output_part(output, part, &bumps);
        for (size_t k = 0; from && k < bumps; k++)
            for (size_t i = 0; i < a; i++)
                to[i * ASCC_MAX_BUMPS + k] = from[k * a + i];
    }
}

/* Fills up the channels of one term's weights with zeros; the output's are turned over as well. */
static void arrange(const ascc_plan *plan, int32_t t, float *to)
{
    const bool last = t == plan->term_count;
    const ascc_term *term = last ? NULL : &plan->term[t];
    const float *from = last ? plan->output.weight : term->weight;
    const size_t a = (size_t)(last ? plan->output.inputs : term->inputs);
    const size_t b = (size_t)(last ? plan->dimension : term->outputs);
    const size_t a8 = ascc_padded((int32_t)a), b8 = last ? b : ascc_padded((int32_t)b);
    if (last && plan->output.filter.bumps) {
        arrange_parts(&plan->output, to);
        return;
    }
    const size_t cells = arranged_size(plan, t) / (a8 * b8);
    memset(to, 0, cells * a8 * b8 * sizeof *to);
    for (size_t c = 0; c < cells; c++)
        for (size_t i = 0; i < a; i++)
            for (size_t o = 0; o < b; o++)
                to[last ? (c * b + o) * a8 + i : (c * a8 + i) * b8 + o] = from[(c * a + i) * b + o];
}

void ascc_network_arrange(ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    float *to = network->weights;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const size_t size = arranged_size(plan, t);
        network->term_weight[t] = to;
        if (size)
            arrange(plan, t, to);
        to += size;
    }
    const float *part = network->term_weight[plan->term_count];
    for (int p = 0; p < ASCC_PARTS && plan->output.filter.bumps; p++) {
        size_t bumps;
        network->part_weight[p] = ascc_output_part(&plan->output, p, &bumps) ? part : NULL;
        part += ascc_padded(plan->output.inputs) * ASCC_MAX_BUMPS;
    }
}

static bool arrange_all(ascc_network *network)
{
    for (int32_t t = 0; t <= network->plan->term_count; t++)
        network->weight_count += arranged_size(network->plan, t);
    network->weights = ascc_allocate(network->allocator, network->weight_count, sizeof(float));
    if (network->weights)
        ascc_network_arrange(network);
    return network->weights != NULL;
}

ascc_status ascc_network_create(ascc_network *network, const ascc_allocator *allocator,
                                const ascc_plan *plan, int32_t max_neighbors, ascc_message *message)
{
    memset(network, 0, sizeof *network);
    network->allocator = allocator;
    network->plan = plan;
    network->value_count = plan->layer_count + 2;
    network->max_neighbors = max_neighbors;
    const size_t terms = (size_t)plan->term_count + 1;
    network->wall_key = -1;
    const ascc_output *output = &plan->output;
    const bool antisymmetric = output->kind == ASCC_OUTPUT_ANTISYMMETRIC;
    network->key = ascc_allocate(allocator, terms + 1, sizeof *network->key);
    network->term_key = ascc_allocate(allocator, terms, sizeof *network->term_key);
    network->wants = ascc_allocate(allocator, (size_t)network->value_count, 1);
    network->term_weight = ascc_allocate(allocator, terms, sizeof *network->term_weight);
    if (!network->key || !network->term_key || !network->wants || !network->term_weight ||
        !arrange_all(network)) {
        ascc_network_destroy(network);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory to prepare the network");
    }
    memset(network->wants, 0, (size_t)network->value_count);
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t t = plan->layer[l].first_term;
             t < plan->layer[l].first_term + plan->layer[l].term_count; t++) {
            const ascc_term *term = &plan->term[t];
            network->wants[term->source] |= term->rectify ? WANTS_RECTIFIED : WANTS_RAW;
            if (term->relative)
                network->wants[0] |= WANTS_RAW;
            network->term_key[t] =
                !ascc_term_searches(term)
                    ? -1
                    : find_key(network, plan->layer[l].set, ascc_network_set(network, term->source),
                               &term->filter, term->filter.skip_self, term->voxel);
        }
    network->wants[output->source] |= output->rectify ? WANTS_RECTIFIED : WANTS_RAW;
    network->term_key[plan->term_count] = -1;
    if (antisymmetric) {
        const int32_t set = ascc_network_set(network, output->source);
        network->term_key[plan->term_count] =
            find_key(network, set, set, &output->filter, false, 0.0);
        if (output->walls.present)
            network->wall_key = find_key(network, ASCC_SET_FLUID, ASCC_SET_BOUNDARY,
                                         &output->walls.filter, false, 0.0);
        if (output->damping || output->walls.damping)
            network->wants[0] |= WANTS_RAW;
    }
    return ASCC_OK;
}

void ascc_network_destroy(ascc_network *network)
{
    const ascc_allocator *a = network->allocator;
    if (!a)
        return;
    const size_t terms = (size_t)network->plan->term_count + 1;
    ascc_release(a, network->key, terms + 1, sizeof *network->key);
    ascc_release(a, network->term_key, terms, sizeof *network->term_key);
    ascc_release(a, network->wants, (size_t)network->value_count, 1);
    ascc_release(a, network->weights, network->weight_count, sizeof(float));
    ascc_release(a, (void *)network->term_weight, terms, sizeof *network->term_weight);
    memset(network, 0, sizeof *network);
}

/* ---- Backwards: demand ---- */

static ascc_status open_rows(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    ascc_hierarchy *h = run->hierarchy;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_rows_key *key = &network->key[k];
        ascc_rows *rows = &run->rows[k];
        memset(rows, 0, sizeof *rows);
        rows->query = &h->set[key->query];
        rows->source = &h->set[key->source];
        rows->radius = key->radius * h->scale.inverse;
        rows->same = key->query == key->source;
        rows->skip_self = key->skip_self;
        rows->limit = key->limit;
        rows->inverse_cube = key->cube > 0.0 ? (float)(h->scale.unit / key->cube) : 0.0f;
        rows->max_neighbors = network->max_neighbors;
        ascc_status status =
            ascc_hierarchy_grid(h, run->tools, key->query, rows->radius, &rows->query_grid);
        if (status == ASCC_OK)
            status =
                ascc_hierarchy_grid(h, run->tools, key->source, rows->radius, &rows->source_grid);
        if (status == ASCC_OK)
            status = ascc_rows_open(rows, run->tools, key->expected);
        if (status != ASCC_OK)
            return status;
    }
    return ASCC_OK;
}

static bool take_active(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    for (int32_t v = 0; v < network->value_count; v++) {
        const size_t count = run->hierarchy->set[ascc_network_set(network, v)].count;
        run->value[v].active = ascc_arena_take(run->tools->arena, count, 1);
        if (!run->value[v].active)
            return false;
        memset(run->value[v].active, 0, count);
    }
    return true;
}

bool ascc_network_shared_row(const ascc_hierarchy *h, int32_t from, int32_t to, size_t row,
                             size_t *shared)
{
    *shared = row;
    if (from == to)
        return true;
    if (from == ASCC_SET_ALL && to < ASCC_SET_ALL) {
        const bool fluid = h->origin[row] < h->fluid_count;
        *shared = h->part[row];
        return fluid == (to == ASCC_SET_FLUID);
    }
    if (from < ASCC_SET_ALL && to == ASCC_SET_ALL) {
        *shared = h->whole[from][row];
        return true;
    }
    return false;
}

typedef struct mark_job {
    const ascc_rows *rows;
    const uint8_t *active;
    uint8_t *source;
    atomic_size_t left; /* rows of the source not marked yet */
} mark_job;

static void mark_neighbors(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    mark_job *job = data;
    const ascc_rows *rows = job->rows;
    size_t marked = 0; /* told once at the end: threads share that counter */
    for (size_t i = begin; i < end; i++) {
        if (!job->active[i])
            continue;
        if (!atomic_load_explicit(&job->left, memory_order_relaxed))
            return;
        const uint32_t *neighbor = rows->neighbor + rows->start[i];
        for (uint32_t k = 0; k < rows->count[i]; k++) {
            uint8_t *flag = &job->source[neighbor[k]];
            if (!__atomic_load_n(flag, __ATOMIC_RELAXED) &&
                !__atomic_exchange_n(flag, (uint8_t)1, __ATOMIC_RELAXED))
                marked++;
        }
    }
    atomic_fetch_sub_explicit(&job->left, marked, memory_order_relaxed);
}

/* A row that searches its own set finds itself: marked first, which mostly leaves none to mark. */
static void mark_own(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    mark_job *job = data;
    const bool own = job->rows->same && !job->rows->skip_self;
    size_t left = 0;
    for (size_t i = begin; i < end; i++) {
        if (own && job->active[i])
            job->source[i] = 1;
        left += !job->source[i];
    }
    atomic_fetch_add_explicit(&job->left, left, memory_order_relaxed);
}

/* Makes the rows of the active queries and marks what they read. */
static ascc_status demand_rows(ascc_network_run *run, int32_t key, const uint8_t *active,
                               uint8_t *source)
{
    ascc_rows *rows = &run->rows[key];
    const ascc_status status = ascc_rows_make(rows, run->tools, active);
    if (status != ASCC_OK)
        return status;
    mark_job job = {.rows = rows, .active = active, .source = source};
    ascc_workers_run(run->tools->workers, rows->source->count, 8192, mark_own, &job);
    if (atomic_load(&job.left))
        ascc_workers_run(run->tools->workers, rows->query->count, 1024, mark_neighbors, &job);
    return ASCC_OK;
}

static ascc_status demand_output(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    const ascc_output *output = &network->plan->output;
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t set = ascc_network_set(network, output->source);
    uint8_t *active = run->value[output->source].active;
    for (size_t i = 0; i < h->fluid_count; i++)
        active[set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i]] = 1;
    const int32_t key = network->term_key[network->plan->term_count];
    if (key < 0)
        return ASCC_OK;
    uint8_t *fluid = ascc_arena_lend(run->tools->arena, h->set[set].count, 1);
    if (!fluid)
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the last layer");
    memcpy(fluid, active, h->set[set].count);
    const ascc_status status = demand_rows(run, key, fluid, active);
    if (status != ASCC_OK || network->wall_key < 0)
        return status;
    return ascc_rows_make(&run->rows[network->wall_key], run->tools, fluid);
}

static ascc_status demand_layer(ascc_network_run *run, int32_t l)
{
    const ascc_network *network = run->network;
    const ascc_layer *layer = &network->plan->layer[l];
    const uint8_t *active = run->value[l + 2].active;
    const size_t count = run->hierarchy->set[layer->set].count;
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        const int32_t source = network->plan->term[t].source;
        uint8_t *reads = run->value[source].active;
        if (network->term_key[t] >= 0) {
            const ascc_status status = demand_rows(run, network->term_key[t], active, reads);
            if (status != ASCC_OK)
                return status;
            continue;
        }
        const int32_t set = ascc_network_set(network, source);
        for (size_t i = 0, j; i < count; i++)
            if (active[i] && ascc_network_shared_row(run->hierarchy, layer->set, set, i, &j))
                reads[j] = 1;
    }
    return ASCC_OK;
}

ascc_status ascc_network_demand(ascc_network_run *run, ascc_network *network,
                                ascc_hierarchy *hierarchy, const ascc_search_tools *tools)
{
    memset(run, 0, sizeof *run);
    run->network = network;
    run->hierarchy = hierarchy;
    run->tools = tools;
    run->value = ascc_arena_take(tools->arena, (size_t)network->value_count, sizeof *run->value);
    run->rows = ascc_arena_take(tools->arena, (size_t)network->key_count, sizeof *run->rows);
    if (!run->value || !run->rows)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the network");
    memset(run->value, 0, (size_t)network->value_count * sizeof *run->value);
    if (!take_active(run))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the network");
    ascc_status status = open_rows(run);
    if (status == ASCC_OK)
        status = demand_output(run);
    for (int32_t l = network->plan->layer_count - 1; status == ASCC_OK && l >= 0; l--)
        status = demand_layer(run, l);
    for (int32_t k = 0; status == ASCC_OK && k < network->key_count; k++) {
        const ascc_rows *rows = &run->rows[k];
        network->key[k].expected = rows->used + rows->used / 8;
        run->neighbor_count += rows->stored;
        run->longest = rows->longest > run->longest ? rows->longest : run->longest;
    }
    return status;
}

/* ---- Forwards: values ---- */

typedef struct layer_job {
    const ascc_network_run *run;
    const ascc_layer *layer;
    ascc_value *value;
    size_t width;         /* of a tile's row: what any term may write */
    const uint32_t *list; /* active rows */
    float *scratch;       /* [slots][scratch_size]: columns, a tile of the layer, geometry */
    size_t scratch_size, tile_offset, geometry_offset;
    ascc_column_sizes sizes;
    uint32_t *sequence; /* 0, 1, 2, ... */
} layer_job;

const float *ascc_network_source(const ascc_network_run *run, const ascc_term *term)
{
    const ascc_value *value = &run->value[term->source];
    return term->rectify ? value->rectified : value->raw;
}

ascc_geometry ascc_network_geometry(const ascc_network_run *run, const ascc_rows *rows,
                                    const ascc_filter *filter, size_t query,
                                    const uint32_t *neighbor, size_t count, float *scratch,
                                    size_t room)
{
    ascc_geometry g = {{scratch, scratch + room, scratch + 2 * room, {NULL}, NULL}, NULL};
    if (filter->window != ASCC_WINDOW_NONE)
        g.window = g.pairs.window[filter->window] = scratch + 3 * room;
    else if (filter->mapping == ASCC_MAPPING_DIRECTION)
        g.pairs.distance = scratch + 3 * room;
    const float inverse =
        rows->inverse_cube > 0.0f ? rows->inverse_cube : (float)(1.0 / rows->radius);
    const ascc_points *s = rows->source, *q = rows->query;
    const ascc_coordinates source = {s->low[0], s->low[1], s->low[2]};
    run->tools->kernels->geometry(&source, neighbor, count, q->low[0][query], q->low[1][query],
                                  q->low[2][query], inverse, (int)filter->mapping, &g.pairs);
    return g;
}

static void add_bias(const ascc_term *term, float *row)
{
    for (int32_t c = 0; term->bias && c < term->outputs; c++)
        row[c] += term->bias[c];
}

/* Hats become shares of their sum. */
static void normalize_hats(float *hat, size_t count)
{
    float sum = 0.0f;
    for (size_t k = 0; k < count; k++)
        sum += hat[k];
    for (size_t k = 0; k < count; k++)
        hat[k] /= sum;
}

/* Features of a row's neighbours, their motion less the row's own. */
static void relative_features(const ascc_network_run *run, const ascc_term *term, size_t row,
                              const uint32_t *neighbor, size_t count, float *to)
{
    const ascc_plan *plan = run->network->plan;
    const size_t a = ascc_padded(term->inputs), own_a = ascc_padded(plan->fluid_channels);
    const int32_t from = ascc_plan_motion(plan, term->source);
    const float *own = run->value[0].raw + row * own_a + ascc_plan_motion(plan, 0);
    const float *feature = run->value[term->source].raw;
    for (size_t k = 0; k < count; k++, to += a) {
        memcpy(to, feature + neighbor[k] * a, a * sizeof *to);
        for (int32_t c = 0; c < plan->dimension; c++)
            to[from + c] -= own[c];
    }
}

ascc_column_scratch ascc_network_scratch(const ascc_column_sizes *sizes, float *memory,
                                         uint32_t *sequence)
{
    return (ascc_column_scratch){memory, memory + ASCC_GEOMETRY_ARRAYS * sizes->room,
                                 memory + (ASCC_GEOMETRY_ARRAYS + sizes->members) * sizes->room,
                                 sequence, sizes->room};
}

ascc_column_sizes ascc_network_sizes(const ascc_network_run *run, const ascc_layer *layer)
{
    const ascc_plan *plan = run->network->plan;
    ascc_column_sizes sizes = {.room = ((size_t)run->longest + 15) / 8 * 8};
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        const ascc_term *term = &plan->term[t];
        const size_t cells = ascc_cell_count(&term->filter);
        if (!ascc_term_searches(term))
            continue;
        sizes.column = ascc_max_size(sizes.column, cells * ascc_padded(term->inputs));
        if (term->filter.bumps)
            sizes.members = ascc_max_size(sizes.members, cells);
        if (term->relative)
            sizes.relative = ascc_max_size(sizes.relative, ascc_padded(term->inputs));
    }
    sizes.scratch = (ASCC_GEOMETRY_ARRAYS + sizes.members + sizes.relative) * sizes.room;
    return sizes;
}

void ascc_network_column(const ascc_network_run *run, const ascc_term *term, const ascc_rows *rows,
                         size_t row, const ascc_column_scratch *scratch, float *column)
{
    const ascc_kernels *kernels = run->tools->kernels;
    const ascc_filter *filter = &term->filter;
    const size_t a = ascc_padded(term->inputs), count = rows->count[row], room = scratch->room;
    const uint32_t *neighbor = rows->neighbor + rows->start[row], *read = neighbor;
    const float *feature = ascc_network_source(run, term);
    if (term->relative) {
        relative_features(run, term, row, neighbor, count, scratch->relative);
        feature = scratch->relative;
        read = scratch->sequence;
    }
    const ascc_geometry g =
        ascc_network_geometry(run, rows, filter, row, neighbor, count, scratch->geometry, room);
    if (term->kind == ASCC_TERM_TRANSFER) {
        float *hat = g.pairs.window[ASCC_WINDOW_HAT];
        if (term->normalize)
            normalize_hats(hat, count);
        kernels->gather_basis(hat, room, 1, 1, read, count, feature, a, column);
    } else if (filter->bumps) {
        const size_t harmonics = (size_t)filter->cells[0], bumps = (size_t)filter->bumps;
        kernels->basis(&g.pairs, count, bumps, harmonics, scratch->factor, room);
        kernels->gather_basis(scratch->factor, room, bumps, harmonics, read, count, feature, a,
                              column);
    } else {
        kernels->gather(&g.pairs, g.window, read, count, feature, a, filter->cells, column);
    }
}

static void convolve_tile(const layer_job *job, const ascc_term *term, const ascc_rows *rows,
                          const uint32_t *list, size_t n, float *column, float *tile,
                          const ascc_column_scratch *scratch)
{
    const ascc_kernels *kernels = job->run->tools->kernels;
    const size_t a = ascc_padded(term->inputs), width = job->width;
    const size_t length = ascc_cell_count(&term->filter) * a, stride = length + COLUMN_PADDING;
    for (size_t r = 0; r < n; r++) {
        ascc_network_column(job->run, term, rows, list[r], scratch, column + r * stride);
        add_bias(term, tile + r * width + term->column);
    }
    kernels->multiply(column, stride, n, length,
                      job->run->network->term_weight[term - job->run->network->plan->term],
                      ascc_padded(term->outputs), tile + term->column, width);
}

/* Dense and residual terms: rows that the source's set shares with the layer's. */
static void pointwise_tile(const layer_job *job, const ascc_term *term, const uint32_t *list,
                           size_t n, float *tile)
{
    const ascc_network_run *run = job->run;
    const int32_t set = ascc_network_set(run->network, term->source);
    const size_t a = ascc_padded(term->inputs), width = job->width;
    const float *source = ascc_network_source(run, term);
    for (size_t r = 0, j; r < n; r++) {
        if (!ascc_network_shared_row(run->hierarchy, job->layer->set, set, list[r], &j))
            continue;
        float *row = tile + r * width + term->column;
        const float *from = source + j * a;
        if (term->kind == ASCC_TERM_IDENTITY) {
            for (int32_t c = 0; c < term->inputs; c++)
                row[c] += from[c];
            continue;
        }
        add_bias(term, row);
        run->tools->kernels->multiply(from, a, 1, a,
                                      run->network->term_weight[term - run->network->plan->term],
                                      ascc_padded(term->outputs), row, width);
    }
}

/* Stores one row of a value as its readers want it, filled up with zeros. */
static void store_row(const ascc_value *value, size_t row, const float *from, int32_t channels)
{
    const size_t padded = ascc_padded(channels);
    float *raw = value->raw ? value->raw + row * padded : NULL;
    float *rectified = value->rectified ? value->rectified + row * padded : NULL;
    for (size_t c = 0; c < padded; c++) {
        const float x = c < (size_t)channels ? from[c] : 0.0f;
        if (raw)
            raw[c] = x;
        if (rectified)
            rectified[c] = x < 0.0f ? 0.0f : x;
    }
}

static void compute_tiles(void *data, size_t begin, size_t end, int32_t slot)
{
    const layer_job *job = data;
    const ascc_plan *plan = job->run->network->plan;
    float *column = job->scratch + (size_t)slot * job->scratch_size;
    float *tile = column + job->tile_offset;
    const ascc_column_scratch scratch =
        ascc_network_scratch(&job->sizes, column + job->geometry_offset, job->sequence);
    for (size_t at = begin; at < end; at += TILE_ROWS) {
        const size_t n = ascc_min_size(TILE_ROWS, end - at);
        const uint32_t *list = job->list + at;
        memset(tile, 0, n * job->width * sizeof *tile);
        for (int32_t t = job->layer->first_term;
             t < job->layer->first_term + job->layer->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            const int32_t key = job->run->network->term_key[t];
            if (key >= 0)
                convolve_tile(job, term, &job->run->rows[key], list, n, column, tile, &scratch);
            else
                pointwise_tile(job, term, list, n, tile);
        }
        for (size_t r = 0; r < n; r++)
            store_row(job->value, list[r], tile + r * job->width, job->layer->channels);
    }
}

/* Room for a value as its readers want it. */
static bool take_value(ascc_network_run *run, int32_t v)
{
    const size_t rows = run->hierarchy->set[ascc_network_set(run->network, v)].count;
    const size_t channels = ascc_padded(ascc_network_channels(run->network, v));
    ascc_value *value = &run->value[v];
    if (run->network->wants[v] & WANTS_RAW) {
        value->raw = ascc_arena_take(run->tools->arena, rows, channels * sizeof(float));
        if (!value->raw)
            return false;
    }
    if (run->network->wants[v] & WANTS_RECTIFIED) {
        value->rectified = ascc_arena_take(run->tools->arena, rows, channels * sizeof(float));
        if (!value->rectified)
            return false;
    }
    return true;
}

typedef struct features_job {
    const ascc_network_run *run;
    int32_t value;
    const float *features;
} features_job;

/* Features come in the host's order; values are in the order of the set. */
static void place_features(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const features_job *job = data;
    const int32_t v = job->value;
    const ascc_hierarchy *h = job->run->hierarchy;
    const int32_t channels = ascc_network_channels(job->run->network, v);
    for (size_t i = begin; i < end; i++) {
        const size_t row = h->origin[h->whole[v][i]] - (v == 0 ? 0 : h->fluid_count);
        store_row(&job->run->value[v], i, job->features + row * (size_t)channels, channels);
    }
}

typedef struct list_job {
    const uint8_t *active;
    uint32_t *list;
    size_t part;
    size_t first[ASCC_SORT_PARTS]; /* how many, then where the first goes */
} list_job;

static void count_active(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    list_job *job = data;
    size_t count = 0;
    for (size_t i = begin; i < end; i++)
        count += job->active[i];
    job->first[begin / job->part] = count;
}

static void list_part(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const list_job *job = data;
    uint32_t *next = job->list + job->first[begin / job->part];
    for (size_t i = begin; i < end; i++)
        if (job->active[i])
            *next++ = (uint32_t)i;
}

/* Lists the active rows; returns how many. */
static size_t list_active(const ascc_search_tools *tools, const uint8_t *active, size_t rows,
                          uint32_t *list)
{
    list_job job = {.active = active, .list = list, .part = ascc_part_size(rows)};
    ascc_workers_run(tools->workers, rows, job.part, count_active, &job);
    const size_t count = ascc_part_sums(job.first);
    ascc_workers_run(tools->workers, rows, job.part, list_part, &job);
    return count;
}

static ascc_status compute_layer(ascc_network_run *run, int32_t l, uint32_t *list)
{
    const ascc_plan *plan = run->network->plan;
    const ascc_layer *layer = &plan->layer[l];
    const ascc_search_tools *tools = run->tools;
    layer_job job = {.run = run, .layer = layer, .value = &run->value[l + 2], .list = list};
    const size_t slots = (size_t)ascc_workers_count(tools->workers);
    job.sizes = ascc_network_sizes(run, layer);
    job.width = ascc_padded(layer->channels) + 8;
    job.tile_offset = TILE_ROWS * (job.sizes.column + COLUMN_PADDING);
    job.geometry_offset = job.tile_offset + TILE_ROWS * job.width;
    job.scratch_size = job.geometry_offset + job.sizes.scratch;
    const size_t numbers = job.sizes.relative ? job.sizes.room : 0;
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    job.sequence = ascc_arena_lend(tools->arena, numbers, sizeof *job.sequence);
    for (size_t i = 0; job.sequence && i < numbers; i++)
        job.sequence[i] = (uint32_t)i;
    job.scratch = ascc_arena_lend(tools->arena, slots * job.scratch_size, sizeof(float));
    if (!job.scratch || !job.sequence || !take_value(run, l + 2))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for layer %s", layer->name);
    const size_t count =
        list_active(tools, run->value[l + 2].active, run->hierarchy->set[layer->set].count, list);
    ascc_workers_run(tools->workers, count, TILE_ROWS * 4, compute_tiles, &job);
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}

ascc_status ascc_network_forward(ascc_network_run *run, const float *fluid_features,
                                 const float *boundary_features)
{
    const ascc_network *network = run->network;
    size_t most = 0;
    for (int s = 0; s < ASCC_MAX_SETS; s++)
        most = ascc_max_size(most, run->hierarchy->set[s].count);
    uint32_t *list = ascc_arena_lend(run->tools->arena, most, sizeof *list);
    if (!list || !take_value(run, 0) || !take_value(run, 1))
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the features");
    for (int32_t v = 0; v < 2; v++) {
        features_job job = {run, v, v == 0 ? fluid_features : boundary_features};
        ascc_workers_run(run->tools->workers, run->hierarchy->set[v].count, 4096, place_features,
                         &job);
    }
    ascc_status status = ASCC_OK;
    for (int32_t l = 0; status == ASCC_OK && l < network->plan->layer_count; l++)
        status = compute_layer(run, l, list);
    return status;
}
