/* Which rows are needed, and which neighbours they have: backwards through the layers.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "kept.h"
#include "network.h"
#include "sheets.h"

/* ---- Prepared once ---- */

/* A radius whose cells serve the search of a cube: one that is searched anyway, if it is little more. */
static double cube_reach(const ascc_plan *plan, double cube)
{
    double reach = INFINITY;
    for (int32_t t = 0; t <= plan->term_count; t++) {
        const ascc_term *term = ascc_plan_term(plan, t);
        ascc_list_key key[ASCC_MAX_LISTS];
        if (!term->operation->lists || !term->operation->lists(plan, term, 0, key))
            continue;
        if (key[0].cube == 0.0 && key[0].radius >= cube)
            reach = fmin(reach, key[0].radius);
    }
    return reach <= 1.5 * cube ? reach : cube;
}

/* The number of a key; equal keys share it. */
static int32_t find_key(ascc_network *network, const ascc_list_key *wanted)
{
    const double radius =
        wanted->cube > 0.0 ? cube_reach(network->plan, wanted->cube) : wanted->radius;
    int32_t k = 0;
    for (; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        if (key->query == wanted->query && key->source == wanted->source &&
            key->skip_self == wanted->skip_self && key->limit == wanted->limit &&
            key->radius == radius && key->cube == wanted->cube)
            return k;
    }
    network->key[k] = *wanted;
    network->key[k].radius = radius;
    network->key_count++;
    return k;
}

/* Keys of one term, for rows of `set`, and which copies of values it reads. */
static void prepare_term(ascc_network *network, int32_t t, int32_t set)
{
    const ascc_term *term = ascc_plan_term(network->plan, t);
    const ascc_operation *operation = term->operation;
    ascc_list_key key[ASCC_MAX_LISTS];
    const int lists = operation->lists ? operation->lists(network->plan, term, set, key) : 0;
    for (int i = 0; i < ASCC_MAX_LISTS; i++)
        network->term_key[t][i] = i < lists ? find_key(network, &key[i]) : -1;
    network->wants[term->source] |= term->rectify ? ASCC_WANTS_RECTIFIED : ASCC_WANTS_RAW;
    if (operation->reads_features && operation->reads_features(term))
        network->wants[0] |= ASCC_WANTS_RAW;
    if (lists > 1)
        network->wants[1] |= ASCC_WANTS_RAW;
}

bool ascc_network_carries(const ascc_network *network, const ascc_term *term)
{
    bool weighs = false;
    for (int t = 0; t < ASCC_MAX_TENSORS; t++)
        weighs |= term->tensor[t] != NULL;
    return network->wants[term->source] & ASCC_WANTS_DRIFT && term->source != 0 && !weighs &&
           !term->rectify;
}

/* Values are sums of others: those of motions are sums of theirs. */
static void want_drift(ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    for (int32_t l = plan->layer_count - 1; l >= 0; l--) {
        const ascc_layer *layer = &plan->layer[l];
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
            const ascc_term *term = &plan->term[t];
            if ((term->operation->reads_drift && term->operation->reads_drift(term)) ||
                network->wants[l + 2] & ASCC_WANTS_DRIFT)
                network->wants[term->source] |= ASCC_WANTS_DRIFT;
        }
    }
}

/* Pairs of a relaxation: a list that is made anyway, if it is not much longer than needed. */
static int32_t relaxation_key(ascc_network *network, int32_t source)
{
    const double reach = network->plan->relaxation.reach;
    const ascc_list_key wanted = {.query = ASCC_SET_FLUID, .source = source, .radius = reach};
    int32_t best = -1;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        if (key->query == wanted.query && key->source == source && !key->skip_self && !key->limit &&
            key->cube == 0.0 && key->radius >= (1.0 - 1e-9) * reach &&
            key->radius <= ASCC_LONGER * reach &&
            (best < 0 || key->radius < network->key[best].radius))
            best = k;
    }
    return best < 0 ? find_key(network, &wanted) : best;
}

/* How far from fluid walls can be that are in some list: of its own points, or of a level's where fluid is. Where
 * walls have rows of their own in layers, they reach on from one to the next. */
static double wall_reach(const ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    double reach = 0.0;
    if (plan->centroid_anchor || (plan->level_count > 1 && !plan->fluid_sampled))
        return INFINITY;
    for (int32_t l = 0; l < plan->layer_count; l++)
        if (plan->layer[l].set == ASCC_SET_ALL || plan->layer[l].set == ASCC_SET_BOUNDARY ||
            plan->layer[l].set == ASCC_SET_EDGES)
            return INFINITY;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
        if (key->query == ASCC_SET_ALL || key->source == ASCC_SET_ALL ||
            key->query == ASCC_SET_BOUNDARY)
            return INFINITY;
        const int32_t level = ascc_set_level(key->query);
        const double apart = level ? (1.0 + plan->hysteresis) * plan->level[level].voxel : 0.0;
        if (key->source == ASCC_SET_BOUNDARY)
            reach = fmax(reach, key->radius + apart);
    }
    return plan->sampling == ASCC_SAMPLING_FARTHEST && plan->level_count > 1 ? INFINITY : reach;
}

static size_t key_capacity(const ascc_plan *plan)
{
    return ((size_t)plan->term_count + 1) * ASCC_MAX_LISTS + 3;
}

ascc_status ascc_network_create(ascc_network *network, const ascc_allocator *allocator,
                                const ascc_plan *plan, const ascc_packed *packed,
                                int32_t max_neighbors, ascc_message *message)
{
    const size_t terms = (size_t)plan->term_count + 1;
    *network = (ascc_network){.allocator = allocator,
                              .plan = plan,
                              .packed = packed,
                              .value_count = plan->layer_count + 2,
                              .edge_key = -1,
                              .max_neighbors = max_neighbors};
    network->key = ascc_allocate(allocator, key_capacity(plan), sizeof *network->key);
    network->term_key = ascc_allocate(allocator, terms, sizeof *network->term_key);
    network->wants = ascc_allocate(allocator, (size_t)network->value_count, 1);
    network->last_reader =
        ascc_allocate(allocator, (size_t)network->value_count, sizeof *network->last_reader);
    if (!network->key || !network->term_key || !network->wants || !network->last_reader) {
        ascc_network_destroy(network);
        return ascc_fail(message, ASCC_ERROR_MEMORY, "no memory to prepare the network");
    }
    memset(network->wants, 0, (size_t)network->value_count);
    for (int32_t v = 0; v < network->value_count; v++)
        network->last_reader[v] = -1;
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t t = plan->layer[l].first_term;
             t < plan->layer[l].first_term + plan->layer[l].term_count; t++) {
            prepare_term(network, t, plan->layer[l].set);
            network->last_reader[plan->term[t].source] = l;
        }
    network->last_reader[plan->output.term.source] = plan->layer_count;
    prepare_term(network, plan->term_count, ascc_network_set(network, plan->output.term.source));
    want_drift(network);
    if (plan->relaxation.guess) {
        network->wants[plan->relaxation.guess] |= ASCC_WANTS_RECTIFIED;
        network->last_reader[plan->relaxation.guess] = plan->layer_count;
    }
    if (plan->edge_radius > 0.0) {
        const ascc_list_key edges = ascc_edges_list(plan);
        network->edge_key = find_key(network, &edges);
    }
    for (int i = 0; i < 2; i++)
        network->relaxation_key[i] =
            plan->relaxation.pressure.count
                ? relaxation_key(network, i == 0 ? ASCC_SET_FLUID : ASCC_SET_BOUNDARY)
                : -1;
    network->wall_reach = wall_reach(network);
    return ASCC_OK;
}

void ascc_network_look_at(ascc_network *network, int32_t layer)
{
    network->looked_at = layer + 2;
    network->wants[layer + 2] |= ASCC_WANTS_RAW;
    network->last_reader[layer + 2] = network->plan->layer_count;
}

void ascc_network_destroy(ascc_network *network)
{
    const ascc_allocator *a = network->allocator;
    if (!a)
        return;
    const size_t terms = (size_t)network->plan->term_count + 1;
    if (network->key)
        ascc_release(a, network->key, key_capacity(network->plan), sizeof *network->key);
    if (network->term_key)
        ascc_release(a, network->term_key, terms, sizeof *network->term_key);
    if (network->wants)
        ascc_release(a, network->wants, (size_t)network->value_count, 1);
    if (network->last_reader)
        ascc_release(a, network->last_reader, (size_t)network->value_count,
                     sizeof *network->last_reader);
    memset(network, 0, sizeof *network);
}

/* ---- Backwards: demand ---- */

/* The farthest that fluid in a list of fluid is apart, units. */
static double fluid_reach(const ascc_network *network, const ascc_hierarchy *h)
{
    double reach = 0.0;
    for (int32_t k = 0; k < network->key_count; k++)
        if (network->key[k].query == ASCC_SET_FLUID && network->key[k].source == ASCC_SET_FLUID)
            reach = fmax(reach, network->key[k].radius * h->scale.inverse);
    return reach;
}

static ascc_status open_rows(ascc_network_run *run, const size_t *expected)
{
    const ascc_network *network = run->network;
    ascc_hierarchy *h = run->hierarchy;
    const ascc_status prepared =
        ascc_sheets_prepare(h, run->tools, fluid_reach(network, h), network->max_neighbors);
    if (prepared != ASCC_OK)
        return prepared;
    for (int32_t k = 0; k < network->key_count; k++) {
        const ascc_list_key *key = &network->key[k];
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
        ascc_sheets_veil(h, rows);
        ascc_status status =
            ascc_hierarchy_grid(h, run->tools, key->query, rows->radius, &rows->query_grid);
        if (status == ASCC_OK)
            status =
                ascc_hierarchy_grid(h, run->tools, key->source, rows->radius, &rows->source_grid);
        if (status == ASCC_OK)
            status = ascc_rows_open(rows, run->tools, expected ? expected[k] : 0);
        if (status != ASCC_OK)
            return status;
    }
    return ASCC_OK;
}

static bool take_active(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    for (int32_t v = 0; v < network->value_count; v++) {
        const int32_t set = ascc_network_set(network, v);
        /* edges: those of a point are needed together, and told apart once they are counted */
        const size_t count =
            run->hierarchy->set[set == ASCC_SET_EDGES ? network->plan->edge_set : set].count;
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

/* The rows of all fluid particles; the first list of an output also says what it reads of its source. */
static ascc_status demand_output(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    const ascc_hierarchy *h = run->hierarchy;
    const int32_t source = run->plan->output.term.source, set = ascc_network_set(network, source);
    const int32_t *key = network->term_key[run->plan->term_count];
    uint8_t *active = run->value[source].active;
    uint8_t *guessed =
        run->plan->relaxation.guess ? run->value[run->plan->relaxation.guess].active : NULL;
    const size_t rows = h->set[ASCC_SET_FLUID].count;
    for (size_t i = 0; i < rows; i++) {
        const bool wanted = !ascc_hierarchy_is_quiet(h, i);
        active[set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i]] = wanted;
        if (guessed)
            guessed[i] = wanted;
    }
    if (key[0] < 0)
        return ASCC_OK;
    uint8_t *fluid = ascc_arena_lend(run->tools->arena, h->set[set].count, 1);
    if (!fluid)
        return ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the last layer");
    memcpy(fluid, active, h->set[set].count);
    ascc_status status = demand_rows(run, key[0], fluid, active);
    for (size_t i = 0; h->share && i < rows; i++) /* what counts for nothing need not be there */
        if (h->share[i] == 0.0f)
            active[set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i]] = 0;
    /* Rows that sleep push the others with the pressure that they guess. */
    for (size_t i = 0; guessed && h->idle && status == ASCC_OK && i < rows; i++)
        guessed[i] |= active[set == ASCC_SET_FLUID ? i : h->whole[ASCC_SET_FLUID][i]];
    for (int i = 1; i < ASCC_MAX_LISTS && status == ASCC_OK && key[i] >= 0; i++)
        status = ascc_rows_make(&run->rows[key[i]], run->tools, fluid);
    return status;
}

/* A term that lies on edges or reads them; active, and flags of edges: of the points that edges lead to. */
static ascc_status demand_edges(ascc_network_run *run, const ascc_term *term, const uint8_t *active)
{
    const int32_t key = run->network->edge_key;
    const bool on_edges = ascc_network_set(run->network, term->source) == ASCC_SET_EDGES;
    const int ends = term->operation->ends ? term->operation->ends(term) : 0;
    uint8_t *reads = run->value[term->source].active;
    if (ends & ASCC_END_SENDER)
        return demand_rows(run, key, active, reads);
    for (size_t i = 0; (on_edges || ends) && i < run->rows[key].query->count; i++)
        reads[i] |= active[i];
    return ascc_rows_make(&run->rows[key], run->tools, active);
}

static ascc_status demand_term(ascc_network_run *run, const ascc_layer *layer, int32_t t,
                               const uint8_t *active)
{
    const int32_t source = run->plan->term[t].source, *key = run->network->term_key[t];
    uint8_t *reads = run->value[source].active;
    ascc_status status = ASCC_OK;
    if (layer->set == ASCC_SET_EDGES || ascc_network_set(run->network, source) == ASCC_SET_EDGES)
        return demand_edges(run, &run->plan->term[t], active);
    for (int i = 0; i < ASCC_MAX_LISTS && status == ASCC_OK && key[i] >= 0; i++)
        status = demand_rows(run, key[i], active, i ? run->value[1].active : reads);
    if (key[0] >= 0)
        return status;
    const int32_t set = ascc_network_set(run->network, source);
    for (size_t i = 0, j; i < run->hierarchy->set[layer->set].count; i++)
        if (active[i] && ascc_network_shared_row(run->hierarchy, layer->set, set, i, &j))
            reads[j] = 1;
    return ASCC_OK;
}

static ascc_status demand_layer(ascc_network_run *run, int32_t l)
{
    const ascc_layer *layer = &run->plan->layer[l];
    const ascc_hierarchy *h = run->hierarchy;
    ascc_status status = ASCC_OK;
    if (h->kept)
        ascc_kept_demand(h->kept, l, h->set[layer->set].count, run->value[l + 2].active);
    for (int32_t t = 0; t < layer->term_count && status == ASCC_OK; t++)
        status = demand_term(run, layer, layer->first_term + t, run->value[l + 2].active);
    return status;
}

/* With a halo: all rows that are computed here, since other processes may read any, and their neighbours. */
static ascc_status demand_own(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    const ascc_hierarchy *h = run->hierarchy;
    ascc_status status = ASCC_OK;
    for (int32_t v = 0; v < network->value_count; v++) {
        const int32_t set = ascc_network_set(network, v);
        for (size_t i = 0; i < h->set[set].count; i++)
            run->value[v].active[i] = set == ASCC_SET_FLUID ? !h->idle[i]
                                      : set == ASCC_SET_BOUNDARY
                                          ? 1
                                          : h->own[set - ASCC_SET_LEVEL + 1][i];
    }
    for (int32_t t = 0; t <= run->plan->term_count; t++)
        for (int i = 0; i < ASCC_MAX_LISTS && status == ASCC_OK && network->term_key[t][i] >= 0;
             i++) {
            const int32_t key = network->term_key[t][i], set = network->key[key].query;
            const uint8_t *own =
                set == ASCC_SET_FLUID ? run->value[0].active : h->own[set - ASCC_SET_LEVEL + 1];
            status = ascc_rows_make(&run->rows[key], run->tools, own);
        }
    return status;
}

/* Edges become rows, and flags of the points that they lead to flags of edges. */
static ascc_status number_edges(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    ascc_status status = ascc_edges_number(&run->edges, &run->rows[network->edge_key], run->tools);
    for (int32_t v = 2; v < network->value_count && status == ASCC_OK; v++)
        if (ascc_network_set(network, v) == ASCC_SET_EDGES)
            status = ascc_edges_flags(&run->edges, run->tools, &run->value[v].active);
    return status;
}

/* A list of all fluid that somebody wants the impulses of. */
static ascc_status make_relaxed(ascc_network_run *run, int32_t key)
{
    const ascc_hierarchy *h = run->hierarchy;
    const size_t count = h->set[ASCC_SET_FLUID].count;
    if (!h->idle)
        return ascc_rows_make(&run->rows[key], run->tools, NULL);
    const ascc_arena_mark mark = ascc_arena_mark_of(run->tools->arena);
    uint8_t *wanted = ascc_arena_lend(run->tools->arena, count, 1);
    for (size_t i = 0; wanted && i < count; i++)
        wanted[i] = !h->idle[i];
    const ascc_status status =
        wanted ? ascc_rows_make(&run->rows[key], run->tools, wanted)
               : ascc_fail(run->tools->message, ASCC_ERROR_MEMORY, "no memory for the relaxation");
    ascc_arena_return(run->tools->arena, mark);
    return status;
}

/* Entries that there is room for in lists which outlive the layers: those of a relaxation, and of contact. */
static size_t lasting_room(const ascc_network_run *run)
{
    const ascc_network *network = run->network;
    size_t room = 0;
    for (int i = 0; i < 2; i++)
        room +=
            network->relaxation_key[i] >= 0 ? run->rows[network->relaxation_key[i]].capacity : 0;
    return run->plan->output.contact > 0.0
               ? room + ascc_term_list(run, &run->plan->output.term, 1)->capacity
               : room;
}

/* All lists, those first that outlive the layers. A list that grows moves, and what was taken before it stays. */
static ascc_status make_lists(ascc_network_run *run)
{
    const ascc_network *network = run->network;
    const bool halo = run->hierarchy->halo != NULL;
    ascc_status status = halo ? demand_own(run) : demand_output(run);
    const bool relaxes = !run->hierarchy->joins;
    for (int i = 0; status == ASCC_OK && relaxes && i < 2 && network->relaxation_key[i] >= 0; i++)
        status = make_relaxed(run, network->relaxation_key[i]);
    const size_t lasting = lasting_room(run);
    run->before_layers = ascc_arena_point_of(run->tools->arena);
    for (int32_t l = network->plan->layer_count - 1; status == ASCC_OK && l >= 0 && !halo; l--)
        status = demand_layer(run, l);
    if (status == ASCC_OK && lasting_room(run) != lasting)
        run->before_layers = ascc_arena_point_of(run->tools->arena);
    return status;
}

/* The guess of a relaxation outlives the layers, too. */
static bool take_guess(ascc_network_run *run)
{
    if (!run->plan->relaxation.guess)
        return true;
    const size_t count = run->hierarchy->set[ASCC_SET_FLUID].count;
    run->guess = ascc_arena_take(run->tools->arena, count, sizeof *run->guess);
    return run->guess != NULL;
}

void ascc_network_done(ascc_network_run *run)
{
    if (!run->network->keeps_values)
        ascc_arena_drop(run->tools->arena, run->before_layers);
}

ascc_status ascc_network_demand(ascc_network_run *run, const ascc_network *network,
                                ascc_hierarchy *hierarchy, const ascc_search_tools *tools,
                                size_t *expected)
{
    memset(run, 0, sizeof *run);
    run->network = network;
    run->plan = network->plan;
    run->hierarchy = hierarchy;
    run->tools = tools;
    run->value = ascc_arena_take(tools->arena, (size_t)network->value_count, sizeof *run->value);
    run->rows = ascc_arena_take(tools->arena, (size_t)network->key_count, sizeof *run->rows);
    run->table = ascc_arena_take(tools->arena, (size_t)network->key_count, sizeof *run->table);
    if (!run->value || !run->rows || !run->table)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the network");
    memset(run->value, 0, (size_t)network->value_count * sizeof *run->value);
    for (int32_t k = 0; k < network->key_count; k++)
        run->table[k] = NULL;
    if (!take_active(run) || !take_guess(run))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for the network");
    ascc_status status = open_rows(run, expected);
    if (status == ASCC_OK)
        status = make_lists(run);
    if (status == ASCC_OK && network->edge_key >= 0)
        status = number_edges(run);
    for (int32_t k = 0; status == ASCC_OK && k < network->key_count; k++) {
        const ascc_rows *rows = &run->rows[k];
        if (expected)
            expected[k] = rows->used + rows->used / 8;
        run->neighbor_count += rows->stored;
        run->longest = rows->longest > run->longest ? rows->longest : run->longest;
    }
    return status;
}
