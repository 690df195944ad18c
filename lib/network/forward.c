/* Layer by layer: what the rows that are needed are worth. SPDX-License-Identifier: MIT
 *
 * A value that only first terms read, each row its own, is passed on tile by tile and never stored: moments,
 * with hundreds of channels, leave but what dense layers make of them.
 */
#include <math.h>
#include <string.h>

#include "early_rows.h"
#include "kept.h"
#include "network.h"

typedef struct layer_job {
    ascc_network_run *run;
    const ascc_layer *layer;
    ascc_value *value;    /* NULL: passed on */
    size_t width;         /* of a tile's row: what any term may write */
    const uint32_t *list; /* active rows */
    float *scratch; /* [slots][scratch_size]: columns, a tile of the layer, scratch of terms */
    size_t scratch_size, tile_offset, next_offset, term_offset;
    ascc_scratch_sizes sizes;
    uint32_t *sequence; /* 0, 1, 2, ... */
    bool drift;         /* of walls' motions */
    int32_t fresh;      /* the value whose ghosts can be refreshed meanwhile; 0 = none */
} layer_job;

ascc_scratch_sizes ascc_network_sizes(const ascc_network_run *run, const ascc_layer *layer)
{
    ascc_scratch_sizes sizes = {.room = ((size_t)run->longest + 15) / 8 * 8};
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        const ascc_term *term = &run->plan->term[t];
        if (term->operation->scratch)
            term->operation->scratch(run->plan, term, &sizes);
    }
    return sizes;
}

/* Stores one row of a value as its readers want it, filled up with zeros. */
static void store_row(const ascc_value *value, size_t row, const float *from, int32_t channels)
{
    const size_t padded = ascc_padded(channels), count = (size_t)channels;
    if (value->raw) {
        float *to = value->raw + row * padded;
        memcpy(to, from, count * sizeof *to);
        memset(to + count, 0, (padded - count) * sizeof *to);
    }
    if (value->rectified) {
        float *to = value->rectified + row * padded;
        for (size_t c = 0; c < count; c++)
            to[c] = from[c] < 0.0f ? 0.0f : from[c];
        memset(to + count, 0, (padded - count) * sizeof *to);
    }
}

/* ---- Values that are passed on ---- */

static const ascc_term *first_term(const ascc_plan *plan, int32_t l)
{
    return &plan->term[plan->layer[l].first_term];
}

/* Does layer m read that of layer l tile by tile? */
static bool reads_tiles(const ascc_plan *plan, int32_t m, int32_t l)
{
    const ascc_term *term = first_term(plan, m);
    return term->source == l + 2 && term->operation->reads_tiles && !term->rectify &&
           plan->layer[m].set == plan->layer[l].set;
}

bool ascc_network_passes_on(const ascc_network *network, int32_t l)
{
    const ascc_plan *plan = network->plan;
    bool read = false;
    if (network->keeps_values || plan->output.term.source == l + 2 ||
        plan->relaxation.guess == l + 2 || network->looked_at == l + 2)
        return false;
    for (int32_t m = l + 1; m < plan->layer_count; m++)
        for (int32_t t = 0; t < plan->layer[m].term_count; t++)
            if (plan->term[plan->layer[m].first_term + t].source == l + 2) {
                if (t > 0 || !reads_tiles(plan, m, l))
                    return false;
                read = true;
            }
    return read;
}

/* The first term of layer m was computed with its source. */
static bool is_begun(const ascc_network *network, int32_t m)
{
    const int32_t l = first_term(network->plan, m)->source - 2;
    return l >= 0 && ascc_network_passes_on(network, l);
}

/* Where a row waits for the other terms of its layer. */
static float *begun_row(const ascc_value *value, size_t row, int32_t channels)
{
    return (value->raw ? value->raw : value->rectified) + row * ascc_padded(channels);
}

/* Gives the rows of a tile to all who read them. */
static void pass_on(const layer_job *job, const ascc_tile *from, float *sum)
{
    const ascc_plan *plan = job->run->plan;
    const int32_t l = (int32_t)(job->layer - plan->layer);
    for (int32_t m = l + 1; m < plan->layer_count; m++) {
        if (!reads_tiles(plan, m, l))
            continue;
        const ascc_layer *layer = &plan->layer[m];
        ascc_value *value = &job->run->value[m + 2];
        ascc_tile tile = *from;
        tile.layer = layer;
        tile.sum = sum;
        tile.width = ascc_padded(layer->channels) + 8;
        tile.given = from->sum;
        tile.given_width = from->width;
        memset(sum, 0, tile.n * tile.width * sizeof *sum);
        first_term(plan, m)->operation->forward(&tile, first_term(plan, m));
        for (size_t r = 0; r < tile.n; r++) {
            const float *row = sum + r * tile.width;
            if (layer->term_count == 1)
                store_row(value, tile.list[r], row, layer->channels);
            else
                memcpy(begun_row(value, tile.list[r], layer->channels), row,
                       (size_t)layer->channels * sizeof *row);
        }
    }
}

/* ---- Layers ---- */

/* What the tile's rows begin with: 0, or what they were given. Returns the number of the next term. */
static int32_t begin_tile(const layer_job *job, const ascc_tile *tile)
{
    const ascc_layer *layer = job->layer;
    const int32_t l = (int32_t)(layer - job->run->plan->layer);
    memset(tile->sum, 0, tile->n * tile->width * sizeof *tile->sum);
    if (job->drift || !is_begun(job->run->network, l))
        return 0;
    const ascc_value *value = &job->run->value[l + 2]; /* there, even if it is passed on in turn */
    for (size_t r = 0; r < tile->n; r++)
        memcpy(tile->sum + r * tile->width, begun_row(value, tile->list[r], layer->channels),
               (size_t)layer->channels * sizeof *tile->sum);
    return 1;
}

static void compute_tiles(void *data, size_t begin, size_t end, int32_t slot)
{
    const layer_job *job = data;
    float *scratch = job->scratch + (size_t)slot * job->scratch_size;
    ascc_tile tile = {.run = job->run,
                      .layer = job->layer,
                      .sum = scratch + job->tile_offset,
                      .width = job->width,
                      .column = scratch,
                      .scratch = scratch + job->term_offset,
                      .room = job->sizes.room,
                      .sequence = job->sequence};
    for (size_t at = begin; at < end; at += ASCC_TILE_ROWS) {
        tile.n = ascc_min_size(ASCC_TILE_ROWS, end - at);
        tile.list = job->list + at;
        for (int32_t t = begin_tile(job, &tile); t < job->layer->term_count; t++) {
            const ascc_term *term = &job->run->plan->term[job->layer->first_term + t];
            if (!job->drift || ascc_network_carries(job->run->network, term))
                term->operation->forward(&tile, term);
        }
        if (!job->value)
            pass_on(job, &tile, scratch + job->next_offset);
        for (size_t r = 0; job->value && r < tile.n; r++)
            store_row(job->value, tile.list[r], tile.sum + r * job->width, job->layer->channels);
    }
}

/* Values are mostly read once: one takes over the memory of another on the same set that has been read for the last
 * time before this layer, if there is one. */
static float *take_over(ascc_network_run *run, int32_t v, int32_t layer)
{
    const ascc_network *network = run->network;
    const size_t channels = ascc_padded(ascc_network_channels(network, v));
    if (network->keeps_values)
        return NULL;
    for (int32_t u = 2; u < v; u++) {
        ascc_value *old = &run->value[u];
        float **memory = old->raw ? &old->raw : &old->rectified, *taken = *memory;
        if (ascc_network_set(network, u) != ascc_network_set(network, v) ||
            network->last_reader[u] >= layer ||
            ascc_padded(ascc_network_channels(network, u)) != channels || !taken)
            continue;
        *memory = NULL;
        return taken;
    }
    return NULL;
}

static bool take_copy(ascc_network_run *run, int32_t v, int32_t layer, size_t rows, size_t channels,
                      float **copy)
{
    *copy = take_over(run, v, layer);
    if (!*copy)
        *copy = ascc_arena_take(run->tools->arena, rows, channels * sizeof(float));
    return *copy != NULL;
}

/* Room for a value as its readers want it, while this layer is computed; kernels may load eight numbers from any in a row. */
static bool take_value(ascc_network_run *run, int32_t v, int32_t layer)
{
    const size_t rows = ascc_network_rows(run, ascc_network_set(run->network, v)) + 1;
    const size_t channels = ascc_padded(ascc_network_channels(run->network, v));
    ascc_value *value = &run->value[v];
    const uint8_t wants = run->network->wants[v];
    return (!(wants & ASCC_WANTS_RAW) || take_copy(run, v, layer, rows, channels, &value->raw)) &&
           (!(wants & ASCC_WANTS_RECTIFIED) ||
            take_copy(run, v, layer, rows, channels, &value->rectified));
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

/* Room for the layer's value, or for those of all who are given it; the widest of these. */
static bool take_values(ascc_network_run *run, int32_t l, bool passed_on, size_t *width)
{
    const ascc_plan *plan = run->plan;
    *width = 0;
    if (!passed_on)
        return is_begun(run->network, l) || take_value(run, l + 2, l);
    for (int32_t m = l + 1; m < plan->layer_count; m++)
        if (reads_tiles(plan, m, l)) {
            *width = ascc_max_size(*width, ascc_padded(plan->layer[m].channels) + 8);
            if (!take_value(run, m + 2, l))
                return false;
        }
    return true;
}

/* What the terms of a layer want made first. */
static ascc_status prepare_terms(const ascc_network_run *run, const ascc_layer *layer)
{
    ascc_status status = ASCC_OK;
    for (int32_t t = 0; t < layer->term_count && status == ASCC_OK; t++) {
        const ascc_term *term = &run->plan->term[layer->first_term + t];
        if (term->operation->prepare)
            status = term->operation->prepare(run, term);
    }
    return status;
}

static ascc_status no_memory(const ascc_network_run *run, const ascc_layer *layer)
{
    return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for layer %s", layer->name);
}

/* ---- What other processes computed ---- */

/* Is the value read through neighbour lists? */
static bool is_read_around(const ascc_network *network, int32_t v)
{
    bool read = false;
    for (int32_t t = 0; t <= network->plan->term_count; t++)
        read |= ascc_plan_term(network->plan, t)->source == v && network->term_key[t][0] >= 0;
    return read;
}

static bool is_exchanged(const ascc_network_run *run, int32_t l)
{
    return run->hierarchy->halo && !ascc_network_passes_on(run->network, l) &&
           is_read_around(run->network, l + 2);
}

static void refresh_of(const ascc_network_run *run, int32_t v, ascc_halo_refresh *refresh)
{
    const ascc_value *value = &run->value[v];
    const size_t size = ascc_padded(ascc_network_channels(run->network, v)) * sizeof(float);
    float *const copies[3] = {value->raw, value->rectified, value->drift};
    *refresh = (ascc_halo_refresh){.set = ascc_network_set(run->network, v)};
    for (int i = 0; i < 3; i++)
        if (copies[i])
            refresh->arrays[refresh->count++] = (ascc_halo_rows){copies[i], size};
}

/* All rows hold numbers now. */
static void note_fresh(ascc_network_run *run, int32_t v)
{
    ascc_value *value = &run->value[v];
    memset(value->active, 1, ascc_network_rows(run, ascc_network_set(run->network, v)));
    value->fresh = true;
}

/* The value that is complete, and can be sent, when a tile of layer l is computed: its own, or that of the one layer
 * that it is passed on to. 0 = none; what walls carry comes afterwards. */
static int32_t sent_with(const ascc_network_run *run, int32_t l)
{
    const ascc_plan *plan = run->plan;
    const bool passed_on = ascc_network_passes_on(run->network, l);
    int32_t value = passed_on ? 0 : l + 2;
    for (int32_t m = l + 1; passed_on && m < plan->layer_count; m++)
        if (reads_tiles(plan, m, l))
            value = value || plan->layer[m].term_count > 1 ? -1 : m + 2;
    return value > 0 && is_exchanged(run, value - 2) &&
                   !(run->network->wants[value] & ASCC_WANTS_DRIFT && run->value[1].drift)
               ? value
               : 0;
}

/* Lists the active rows of a set in the order of its rows (early_rows.h). */
static size_t list_in_order(const ascc_hierarchy *h, int32_t set, const uint8_t *active,
                            uint32_t *list, size_t *early)
{
    const ascc_row_order *order = &h->order[ascc_set_level(set)];
    size_t count = 0;
    *early = 0;
    for (size_t k = 0; k < order->count; k++) {
        if (k == order->early)
            *early = count;
        for (uint32_t i = order->range[k].begin; i < order->range[k].end; i++)
            if (active[i])
                list[count++] = i;
    }
    *early = order->early == order->count ? count : *early;
    return count;
}

/* The layer of a job tile by tile, in scratch that is lent. next_width: of values that are given a tile. */
static ascc_status run_job(layer_job *job, uint32_t *list, size_t next_width)
{
    ascc_network_run *run = job->run;
    const ascc_layer *layer = job->layer;
    const ascc_search_tools *tools = run->tools;
    const size_t slots = (size_t)ascc_workers_count(tools->workers);
    job->list = list;
    job->sizes = ascc_network_sizes(run, layer);
    job->width = ascc_padded(layer->channels) + 8;
    job->tile_offset = ASCC_TILE_ROWS * (job->sizes.column + ASCC_COLUMN_PADDING);
    job->next_offset = job->tile_offset + ASCC_TILE_ROWS * job->width;
    job->term_offset = job->next_offset + ASCC_TILE_ROWS * next_width;
    job->scratch_size = job->term_offset + job->sizes.scratch;
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    job->sequence = ascc_arena_lend(tools->arena, job->sizes.room, sizeof *job->sequence);
    for (size_t i = 0; job->sequence && i < job->sizes.room; i++)
        job->sequence[i] = (uint32_t)i;
    job->scratch = ascc_arena_lend(tools->arena, slots * job->scratch_size, sizeof(float));
    if (!job->scratch || !job->sequence)
        return no_memory(run, layer);
    const int32_t value = (int32_t)(layer - run->plan->layer) + 2;
    const uint8_t *active = run->value[value].active;
    size_t count, early = 0;
    ascc_halo_refresh refresh;
    if (job->fresh) {
        count = list_in_order(run->hierarchy, layer->set, active, list, &early);
        refresh_of(run, job->fresh, &refresh);
    } else {
        count = list_active(tools, active, ascc_network_rows(run, layer->set), list);
    }
    const ascc_status status =
        ascc_early_list_run(run->hierarchy, tools, early, count, ASCC_TILE_ROWS * 4, compute_tiles,
                            job, job->fresh ? &refresh : NULL);
    ascc_arena_return(tools->arena, mark);
    if (job->fresh && status == ASCC_OK)
        note_fresh(run, job->fresh);
    return status;
}

static ascc_status compute_layer(ascc_network_run *run, int32_t l, uint32_t *list)
{
    const ascc_layer *layer = &run->plan->layer[l];
    const bool passed_on = ascc_network_passes_on(run->network, l);
    layer_job job = {.run = run, .layer = layer};
    job.value = passed_on ? NULL : &run->value[l + 2];
    size_t next_width;
    if (is_begun(run->network, l) && layer->term_count == 1)
        return ASCC_OK;
    const ascc_status status = prepare_terms(run, layer);
    if (status != ASCC_OK)
        return status;
    if (!take_values(run, l, passed_on, &next_width))
        return no_memory(run, layer);
    job.fresh = sent_with(run, l);
    return run_job(&job, list, next_width);
}

/* ---- What moving walls carry ---- */

static float *take_drift(ascc_network_run *run, int32_t v)
{
    const size_t rows = run->hierarchy->set[ascc_network_set(run->network, v)].count + 1;
    const size_t channels = ascc_padded(ascc_network_channels(run->network, v));
    return run->value[v].drift = ascc_arena_take(run->tools->arena, rows, channels * sizeof(float));
}

/* Motions of walls times their areas, where their features have normals. */
static ascc_status begin_drift(ascc_network_run *run)
{
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t normal = ascc_plan_feature(run->plan, 1, ASCC_FEATURE_NORMAL);
    const size_t stride = ascc_padded(run->plan->boundary_channels);
    const size_t rows = h->set[ASCC_SET_BOUNDARY].count;
    if (!h->drift || !(run->network->wants[1] & ASCC_WANTS_DRIFT) || normal < 0)
        return ASCC_OK;
    float *to = take_drift(run, 1);
    if (!to)
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the features");
    const float *area = ascc_wall_areas(run);
    memset(to, 0, (rows + 1) * stride * sizeof *to);
    for (size_t i = 0; i < rows; i++)
        for (int32_t c = 0; c < run->plan->dimension; c++)
            to[i * stride + (size_t)(normal + c)] =
                (area ? area[i * stride] : 1.0f) * h->drift[i * 4 + (size_t)c];
    return ASCC_OK;
}

/* The layer once more, of these alone. */
static ascc_status carry_layer(ascc_network_run *run, int32_t l, uint32_t *list)
{
    const ascc_arena_mark mark = ascc_arena_mark_of(run->tools->arena);
    ascc_network_run other = *run;
    layer_job job = {.run = &other, .layer = &run->plan->layer[l], .drift = true};
    if (!run->value[1].drift || !(run->network->wants[l + 2] & ASCC_WANTS_DRIFT))
        return ASCC_OK;
    other.value =
        ascc_arena_lend(run->tools->arena, (size_t)run->network->value_count, sizeof *other.value);
    if (!take_drift(run, l + 2) || !other.value)
        return no_memory(run, job.layer);
    for (int32_t v = 0; v < run->network->value_count; v++)
        other.value[v] = (ascc_value){.active = run->value[v].active, .raw = run->value[v].drift};
    job.value = &other.value[l + 2];
    const ascc_status status = run_job(&job, list, 0);
    ascc_arena_return(run->tools->arena, mark);
    return status;
}

/* Ghosts of a layer's value, if they have not travelled while it was computed. */
static ascc_status refresh_value(ascc_network_run *run, int32_t l)
{
    ascc_halo_refresh refresh;
    if (!is_exchanged(run, l) || run->value[l + 2].fresh)
        return ASCC_OK;
    refresh_of(run, l + 2, &refresh);
    const ascc_status status = ascc_hierarchy_refresh(run->hierarchy, &refresh);
    if (status == ASCC_OK)
        note_fresh(run, l + 2);
    return status;
}

static void keep_guess(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const ascc_network_run *run = data;
    const ascc_value *value = &run->value[run->plan->relaxation.guess];
    for (size_t i = begin; i < end; i++)
        run->guess[i] = value->active[i] ? value->rectified[i * ascc_padded(1)] : 0.0f;
}

ascc_status ascc_network_forward(ascc_network_run *run, const float *fluid_features,
                                 const float *boundary_features)
{
    const ascc_network *network = run->network;
    size_t most = run->edges.count;
    for (int s = 0; s < ASCC_MAX_SETS; s++)
        most = ascc_max_size(most, run->hierarchy->set[s].count);
    uint32_t *list = ascc_arena_lend(run->tools->arena, most, sizeof *list);
    if (!list || !take_value(run, 0, 0) || !take_value(run, 1, 0))
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the features");
    for (int32_t v = 0; v < 2; v++) {
        features_job job = {run, v, v == 0 ? fluid_features : boundary_features};
        ascc_workers_run(run->tools->workers, run->hierarchy->set[v].count, 4096, place_features,
                         &job);
    }
    ascc_status status = begin_drift(run);
    for (int32_t l = 0; status == ASCC_OK && l < network->plan->layer_count; l++) {
        status = compute_layer(run, l, list);
        if (status == ASCC_OK)
            status = carry_layer(run, l, list);
        if (status == ASCC_OK)
            ascc_kept_fill(run, l);
        if (status == ASCC_OK)
            status = refresh_value(run, l);
    }
    if (status == ASCC_OK && run->hierarchy->kept)
        ascc_kept_end(run->hierarchy->kept);
    if (status == ASCC_OK && run->guess)
        ascc_workers_run(run->tools->workers, run->hierarchy->set[ASCC_SET_FLUID].count, 4096,
                         keep_guess, run);
    return status;
}
