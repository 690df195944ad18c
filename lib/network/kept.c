/* Values on the finest lattice that outlive a step. SPDX-License-Identifier: MIT */
#include "kept.h"

#include <math.h>
#include <string.h>

#define FINEST ASCC_SET_LEVEL

/* ---- What a network lets be kept ---- */

/* What is known of a value. */
typedef struct insight {
    bool local;    /* depends on particles and values of the finest lattice alone */
    double reach;  /* m along each axis, within which these are */
    double wanted; /* of fluid: m around a particle that is computed; -1 = nobody reads it there */
} insight;

static double list_reach(const ascc_network *network, int32_t term)
{
    double reach = 0.0;
    for (int i = 0; i < ASCC_MAX_LISTS && network->term_key[term][i] >= 0; i++) {
        const ascc_list_key *key = &network->key[network->term_key[term][i]];
        reach = fmax(reach, key->cube > 0.0 ? key->cube : key->radius);
    }
    return reach;
}

static bool reads_walls_too(const ascc_network *network, int32_t term)
{
    return network->term_key[term][1] >= 0;
}

static void look_at_layer(const ascc_network *network, int32_t l, insight *of)
{
    const ascc_plan *plan = network->plan;
    const ascc_layer *layer = &plan->layer[l];
    insight *own = &of[l + 2];
    own->local = layer->set == ASCC_SET_FLUID || layer->set == FINEST;
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
        const insight *source = &of[plan->term[t].source];
        own->local &= source->local;
        own->reach = fmax(own->reach, source->reach + list_reach(network, t));
    }
}

/* Is it kept, or read by none but layers that are? */
static bool is_fine(const ascc_network *network, int32_t value, const insight *of)
{
    return of[value].local && ascc_network_set(network, value) == FINEST;
}

/* Other layers on levels must not look at particles, wherever these are. */
static bool looks_at_particles(const ascc_network *network, int32_t l, const insight *of)
{
    const ascc_layer *layer = &network->plan->layer[l];
    bool looks = false;
    if (layer->set < FINEST || is_fine(network, l + 2, of))
        return false;
    for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++)
        looks |= ascc_network_set(network, network->plan->term[t].source) < FINEST ||
                 reads_walls_too(network, t);
    return looks;
}

static bool is_read_from_outside(const ascc_network *network, int32_t value, const insight *of)
{
    const ascc_plan *plan = network->plan;
    bool read = plan->output.term.source == value || plan->relaxation.guess == value;
    for (int32_t l = 0; l < plan->layer_count; l++)
        for (int32_t t = 0; t < plan->layer[l].term_count; t++)
            read |= plan->term[plan->layer[l].first_term + t].source == value &&
                    !is_fine(network, l + 2, of);
    return read;
}

/* How far around a particle that is computed the network looks at fluid, level by level apart. */
static double look_around(const ascc_network *network, insight *of)
{
    const ascc_plan *plan = network->plan;
    double around = plan->relaxation.reach;
    of[plan->output.term.source].wanted = list_reach(network, plan->term_count);
    if (plan->relaxation.guess)
        of[plan->relaxation.guess].wanted =
            fmax(list_reach(network, plan->term_count), plan->relaxation.reach);
    for (int32_t l = plan->layer_count - 1; l >= 0; l--) {
        const ascc_layer *layer = &plan->layer[l];
        if (layer->set != ASCC_SET_FLUID || of[l + 2].wanted < 0.0)
            continue;
        for (int32_t t = layer->first_term; t < layer->first_term + layer->term_count; t++) {
            insight *source = &of[plan->term[t].source];
            source->wanted = fmax(source->wanted, of[l + 2].wanted + list_reach(network, t));
        }
    }
    for (int32_t v = 0; v < network->value_count; v++)
        if (ascc_network_set(network, v) == ASCC_SET_FLUID)
            around = fmax(around, of[v].wanted);
    return around;
}

/* Corners where fluid is, at the world's origin, each level's every so many of the finest's. */
static bool has_nested_lattices(const ascc_plan *plan)
{
    bool nested = plan->level_count > 1 && plan->fluid_sampled && !plan->centroid_anchor &&
                  plan->sampling == ASCC_SAMPLING_CORNERS && plan->hysteresis == 0.0;
    for (int32_t l = 2; l < plan->level_count; l++) {
        int exponent;
        nested &= frexp(plan->level[l].voxel / plan->level[1].voxel, &exponent) == 0.5 &&
                  ldexp(plan->level[1].voxel, exponent - 1) == plan->level[l].voxel;
    }
    return nested;
}

static bool has_simple_sets(const ascc_plan *plan)
{
    bool simple = plan->history == 0 && plan->edge_radius == 0.0 && !(plan->boundary_crop > 0.0) &&
                  !ascc_hierarchy_reads_whole(plan);
    for (int32_t l = 0; l < plan->layer_count; l++)
        simple &= plan->layer[l].set == ASCC_SET_FLUID || plan->layer[l].set >= FINEST;
    return simple;
}

static int64_t whole_voxels(const ascc_kept *kept, double length)
{
    return (int64_t)floor(length / kept->voxel * (1.0 + 1e-9));
}

static void choose_layers(ascc_kept *kept, const ascc_network *network, insight *of)
{
    const ascc_plan *plan = network->plan;
    double reach = 0.0;
    for (int32_t l = 0; l < plan->layer_count; l++)
        look_at_layer(network, l, of);
    for (int32_t l = 0; l < plan->layer_count; l++) {
        kept->offset[l] = -1;
        kept->serves &= !looks_at_particles(network, l, of);
        if (!is_fine(network, l + 2, of) || !is_read_from_outside(network, l + 2, of))
            continue;
        kept->serves &= !ascc_network_passes_on(network, l);
        kept->offset[l] = (int32_t)kept->width;
        kept->width += ascc_padded(plan->layer[l].channels);
        reach = fmax(reach, of[l + 2].reach);
    }
    kept->serves &= kept->width > 0;
    kept->reach = whole_voxels(kept, reach);
    kept->around = whole_voxels(kept, look_around(network, of)) + 1;
}

bool ascc_kept_open(ascc_kept *kept, const ascc_network *network)
{
    const ascc_plan *plan = network->plan;
    *kept = (ascc_kept){.allocator = network->allocator, .layer_count = plan->layer_count};
    if (!has_nested_lattices(plan) || !has_simple_sets(plan))
        return true;
    const size_t values = (size_t)network->value_count;
    insight *of = ascc_allocate(network->allocator, values, sizeof *of);
    kept->offset =
        ascc_allocate(network->allocator, (size_t)plan->layer_count, sizeof *kept->offset);
    if (of && kept->offset) {
        for (size_t v = 0; v < values; v++)
            of[v] = (insight){.local = true, .wanted = -1.0};
        kept->voxel = plan->level[1].voxel;
        kept->serves = true;
        choose_layers(kept, network, of);
    }
    const bool room = of && kept->offset;
    if (of)
        ascc_release(network->allocator, of, values, sizeof *of);
    if (!room)
        ascc_kept_close(kept);
    return room;
}

static void close_corners(const ascc_kept *kept, ascc_kept_corners *c)
{
    ascc_release(kept->allocator, c->at, c->at_capacity, sizeof *c->at);
    ascc_release(kept->allocator, c->slot, c->slot_capacity, sizeof *c->slot);
    ascc_release(kept->allocator, c->value, c->value_capacity, sizeof *c->value);
}

void ascc_kept_close(ascc_kept *kept)
{
    if (!kept->allocator)
        return;
    if (kept->offset)
        ascc_release(kept->allocator, kept->offset, (size_t)kept->layer_count,
                     sizeof *kept->offset);
    close_corners(kept, &kept->corners[0]);
    close_corners(kept, &kept->corners[1]);
    *kept = (ascc_kept){0};
}

/* ---- Voxels ---- */

static double voxel_units(const ascc_kept *kept, const ascc_scale *scale)
{
    return kept->voxel * scale->inverse;
}

bool ascc_kept_voxel(const ascc_kept *kept, const ascc_scale *scale, const double *place,
                     int32_t dimension, int64_t at[3])
{
    int64_t units;
    for (int32_t c = 0; c < 3; c++) {
        at[c] = 0;
        if (c >= dimension)
            continue;
        if (!ascc_scale_apply(scale, place[c], &units))
            return false;
        at[c] = (int64_t)floor((double)units / voxel_units(kept, scale));
    }
    return true;
}

void ascc_kept_middle(const ascc_kept *kept, const ascc_scale *scale, const int64_t at[3],
                      int32_t dimension, int64_t middle[3])
{
    for (int32_t c = 0; c < 3; c++)
        middle[c] =
            c < dimension ? (int64_t)rint(((double)at[c] + 0.5) * voxel_units(kept, scale)) : 0;
}

/* ---- One step ---- */

static bool make_room(const ascc_kept *kept, ascc_kept_corners *c, size_t count)
{
    c->count = count;
    return ascc_grow(kept->allocator, (void **)&c->at, &c->at_capacity, count, sizeof *c->at) &&
           ascc_grow(kept->allocator, (void **)&c->slot, &c->slot_capacity,
                     ascc_blocks_slots(count), sizeof *c->slot) &&
           ascc_grow(kept->allocator, (void **)&c->value, &c->value_capacity, count * kept->width,
                     sizeof *c->value);
}

/* Where the last step has this corner, unless something near it has changed. */
static uint32_t find_before(const ascc_kept *kept, const ascc_scale *scale,
                            const ascc_blocks *before, const int64_t at[3])
{
    int64_t voxel[3];
    if (!kept->dirty)
        return UINT32_MAX;
    for (int32_t c = 0; c < 3; c++)
        voxel[c] = (int64_t)rint((double)at[c] / voxel_units(kept, scale));
    if (ascc_blocks_find(kept->dirty, voxel) != ASCC_NO_BLOCK)
        return UINT32_MAX;
    return ascc_blocks_find(before, at);
}

bool ascc_kept_begin(ascc_kept *kept, const ascc_hierarchy *h, ascc_arena *arena)
{
    const ascc_points *points = &h->set[FINEST];
    ascc_kept_corners *old = &kept->corners[kept->now], *new = &kept->corners[1 - kept->now];
    const ascc_blocks before = {.count = old->count,
                                .slots = ascc_blocks_slots(old->count),
                                .at = old->at,
                                .slot = old->slot};
    kept->from = ascc_arena_take(arena, points->count, sizeof *kept->from);
    if (!kept->from || !make_room(kept, new, points->count))
        return false;
    ascc_blocks now;
    ascc_blocks_open(&now, new->at, new->slot, ascc_blocks_slots(points->count));
    for (size_t i = 0; i < points->count; i++) {
        const int64_t at[3] = {points->position[0][i], points->position[1][i],
                               points->position[2][i]};
        (void)ascc_blocks_add(&now, at);
        kept->from[i] = find_before(kept, &h->scale, &before, at);
    }
    return true;
}

void ascc_kept_demand(const ascc_kept *kept, int32_t layer, size_t rows, uint8_t *active)
{
    for (size_t i = 0; kept->offset[layer] >= 0 && i < rows; i++)
        active[i] = kept->from[i] == UINT32_MAX;
}

void ascc_kept_fill(const ascc_network_run *run, int32_t layer)
{
    const ascc_kept *kept = run->hierarchy->kept;
    if (!kept || kept->offset[layer] < 0)
        return;
    const ascc_value *value = &run->value[layer + 2];
    const ascc_kept_corners *old = &kept->corners[kept->now], *new = &kept->corners[1 - kept->now];
    const size_t channels = ascc_padded(run->plan->layer[layer].channels);
    const size_t size = channels * sizeof(float), at = (size_t)kept->offset[layer];
    float *const whole = value->raw ? value->raw : value->rectified;
    for (size_t i = 0; i < new->count; i++) {
        float *to = new->value + i * kept->width + at, *row = whole + i *channels;
        if (kept->from[i] == UINT32_MAX) {
            memcpy(to, row, size);
            continue;
        }
        memcpy(to, old->value + kept->from[i] * kept->width + at, size);
        memcpy(row, to, size);
        for (size_t c = 0; value->raw && value->rectified && c < channels; c++)
            value->rectified[i * channels + c] = to[c] < 0.0f ? 0.0f : to[c];
    }
}

void ascc_kept_end(ascc_kept *kept)
{
    kept->now = 1 - kept->now;
    kept->valid = true;
}
