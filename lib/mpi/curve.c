/* Blocks, their order and their owners. SPDX-License-Identifier: MIT */
#include "curve.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#define BITS 21 /* of a coordinate */
#define HALF ((int64_t)1 << (BITS - 1))

void ascc_curve_block(const ascc_curve *curve, const double *place, int64_t block[3])
{
    for (int32_t c = 0; c < 3; c++) {
        const double b = c < curve->dimension ? floor(place[c] / curve->edge) : 0.0;
        block[c] = b < (double)-HALF ? -HALF : b < (double)HALF ? (int64_t)b : HALF - 1;
    }
}

/* Two zeros before each of 21 bits. */
static uint64_t spread(uint64_t x)
{
    x = (x | x << 32) & UINT64_C(0x001f00000000ffff);
    x = (x | x << 16) & UINT64_C(0x001f0000ff0000ff);
    x = (x | x << 8) & UINT64_C(0x100f00f00f00f00f);
    x = (x | x << 4) & UINT64_C(0x10c30c30c30c30c3);
    return (x | x << 2) & UINT64_C(0x1249249249249249);
}

/* And back: every third of 63 bits. */
static uint64_t join(uint64_t x)
{
    x &= UINT64_C(0x1249249249249249);
    x = (x | x >> 2) & UINT64_C(0x10c30c30c30c30c3);
    x = (x | x >> 4) & UINT64_C(0x100f00f00f00f00f);
    x = (x | x >> 8) & UINT64_C(0x001f0000ff0000ff);
    x = (x | x >> 16) & UINT64_C(0x001f00000000ffff);
    return (x | x >> 32) & UINT64_C(0x00000000001fffff);
}

uint64_t ascc_curve_key(const ascc_curve *curve, const int64_t block[3])
{
    uint64_t key = 0;
    for (int c = 0; c < curve->dimension; c++)
        key |= spread((uint64_t)(block[c] + HALF)) << c;
    return key;
}

/* Who has the place of a key on the curve. */
static int owner_of_key(const ascc_curve *curve, uint64_t key)
{
    int low = 0, high = curve->size; /* the owner is in [low, high) */
    while (high - low > 1) {
        const int middle = low + (high - low) / 2;
        if (curve->first[middle] <= key)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* What is known of a block; NULL if nothing is. at: the nearest block in the box of those with fluid. */
static ascc_holding *find_holding(const ascc_curve *curve, const int64_t block[3], int64_t at[3])
{
    memcpy(at, block, 3 * sizeof *at);
    if (curve->blocks.count == 0)
        return NULL;
    for (int c = 0; c < 3; c++)
        at[c] = at[c] < curve->low[c]    ? curve->low[c]
                : at[c] > curve->high[c] ? curve->high[c]
                                         : at[c];
    const uint32_t known = ascc_blocks_find(&curve->blocks, at);
    return known != ASCC_NO_BLOCK ? &curve->holding[known] : NULL;
}

int ascc_curve_owner(const ascc_curve *curve, const int64_t block[3])
{
    int64_t at[3];
    const ascc_holding *holding = find_holding(curve, block, at);
    return holding ? holding->owner : owner_of_key(curve, ascc_curve_key(curve, at));
}

int ascc_curve_owner_of(const ascc_curve *curve, const double *place)
{
    int64_t block[3];
    ascc_curve_block(curve, place, block);
    return ascc_curve_owner(curve, block);
}

static void add_owner(ascc_owners *owners, int rank)
{
    if (!owners->is[rank])
        owners->rank[owners->count++] = rank;
    owners->is[rank] = 1;
}

/* Of all blocks that touch a box. */
static void find_in_box(ascc_owners *owners, const ascc_curve *curve, const double from[3],
                        const double to[3])
{
    int64_t low[3], high[3], at[3];
    ascc_curve_block(curve, from, low);
    ascc_curve_block(curve, to, high);
    if (owners->known && memcmp(low, owners->low, sizeof low) == 0 &&
        memcmp(high, owners->high, sizeof high) == 0)
        return; /* places follow one another mostly in one block */
    memcpy(owners->low, low, sizeof low);
    memcpy(owners->high, high, sizeof high);
    owners->known = true;
    owners->count = 0;
    memset(owners->is, 0, (size_t)curve->size);
    for (at[2] = low[2]; at[2] <= high[2]; at[2]++)
        for (at[1] = low[1]; at[1] <= high[1]; at[1]++)
            for (at[0] = low[0]; at[0] <= high[0]; at[0]++)
                add_owner(owners, ascc_curve_owner(curve, at));
}

/* Whether one process owns all within reach of a block that is known, as of most of them. */
static bool is_inner(ascc_owners *owners, const ascc_curve *curve, const double *place,
                     double reach)
{
    double from[3] = {0.0, 0.0, 0.0}, to[3] = {0.0, 0.0, 0.0};
    int64_t block[3], at[3];
    ascc_curve_block(curve, place, block);
    ascc_holding *holding = find_holding(curve, block, at);
    if (!holding || memcmp(at, block, sizeof at) != 0 || reach >= holding->outer)
        return false;
    if (reach > holding->inner) {
        for (int32_t c = 0; c < curve->dimension; c++) {
            from[c] = (double)block[c] * curve->edge - reach;
            to[c] = (double)(block[c] + 1) * curve->edge + reach;
        }
        find_in_box(owners, curve, from, to);
        *(owners->count == 1 ? &holding->inner : &holding->outer) = reach;
    }
    return reach <= holding->inner;
}

/* One process alone. */
static void set_owner(ascc_owners *owners, int rank)
{
    owners->known = false;
    owners->count = 1;
    owners->rank[0] = rank;
}

void ascc_owners_find(ascc_owners *owners, const ascc_curve *curve, const double *place,
                      double reach)
{
    double from[3] = {0.0, 0.0, 0.0}, to[3] = {0.0, 0.0, 0.0};
    if (is_inner(owners, curve, place, reach)) {
        set_owner(owners, ascc_curve_owner_of(curve, place));
        return;
    }
    for (int32_t c = 0; c < curve->dimension; c++) {
        from[c] = place[c] - reach;
        to[c] = place[c] + reach;
    }
    find_in_box(owners, curve, from, to);
}

/* ---- Blocks beside fluid ---- */

#define BESIDE 26

/* The blocks that touch a block, those with a face in common first, then edges; how many. */
static int find_beside(const ascc_curve *curve, const int64_t block[3], int64_t beside[BESIDE][3])
{
    const int64_t deep = curve->dimension == 3;
    int count = 0;
    for (int64_t far = 1; far <= curve->dimension; far++)
        for (int64_t z = -deep; z <= deep; z++)
            for (int64_t y = -1; y <= 1; y++)
                for (int64_t x = -1; x <= 1; x++)
                    if (x * x + y * y + z * z == far) {
                        const int64_t at[3] = {block[0] + x, block[1] + y, block[2] + z};
                        memcpy(beside[count++], at, sizeof at);
                    }
    return count;
}

static bool reserve(ascc_curve *curve, const ascc_allocator *allocator, size_t count)
{
    ascc_blocks *b = &curve->blocks;
    const size_t slots = ascc_blocks_slots(count);
    void *at = b->at, *slot = b->slot, *holding = curve->holding;
    const bool room =
        ascc_grow(allocator, &at, &curve->block_capacity, count, sizeof *b->at) &
        ascc_grow(allocator, &slot, &curve->slot_capacity, slots, sizeof *b->slot) &
        ascc_grow(allocator, &holding, &curve->holding_capacity, count, sizeof *curve->holding);
    b->at = at;
    b->slot = slot;
    curve->holding = holding;
    if (room)
        ascc_blocks_open(b, at, slot, slots);
    return room;
}

static void add_block(ascc_curve *curve, const int64_t block[3], int owner)
{
    const ascc_holding holding = {.owner = owner, .inner = -1.0, .outer = HUGE_VAL};
    curve->holding[ascc_blocks_add(&curve->blocks, block)] = holding;
}

static void add_full(ascc_curve *curve, const ascc_load *load, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        int64_t at[3] = {0, 0, 0};
        for (int c = 0; c < curve->dimension; c++) {
            at[c] = (int64_t)join(load[i].key >> c) - HALF;
            curve->low[c] = i && curve->low[c] < at[c] ? curve->low[c] : at[c];
            curve->high[c] = i && curve->high[c] > at[c] ? curve->high[c] : at[c];
        }
        add_block(curve, at, owner_of_key(curve, load[i].key));
    }
}

/* Adds a block without fluid: it has the owner of the first beside it that has some. */
static void add_empty(ascc_curve *curve, const int64_t block[3], size_t full)
{
    int64_t beside[BESIDE][3];
    const int count = find_beside(curve, block, beside);
    for (int k = 0; k < count; k++) {
        const uint32_t found = ascc_blocks_find(&curve->blocks, beside[k]);
        if (found < full) {
            add_block(curve, block, curve->holding[found].owner);
            return;
        }
    }
}

bool ascc_curve_know(ascc_curve *curve, const ascc_allocator *allocator, const ascc_load *load,
                     size_t count)
{
    int64_t beside[BESIDE][3];
    ascc_curve_forget(curve);
    if (count == 0)
        return true;
    if (count >= ASCC_NO_BLOCK / BESIDE || !reserve(curve, allocator, count))
        return false;
    add_full(curve, load, count);
    size_t empty = 0; /* some are counted several times */
    for (size_t i = 0; i < count; i++)
        for (int k = find_beside(curve, curve->blocks.at[i], beside) - 1; k >= 0; k--)
            empty += ascc_blocks_find(&curve->blocks, beside[k]) == ASCC_NO_BLOCK;
    if (!reserve(curve, allocator, count + empty))
        return false;
    add_full(curve, load, count);
    for (size_t i = 0; i < count; i++)
        for (int k = find_beside(curve, curve->blocks.at[i], beside) - 1; k >= 0; k--)
            if (ascc_blocks_find(&curve->blocks, beside[k]) == ASCC_NO_BLOCK)
                add_empty(curve, beside[k], count);
    return true;
}

void ascc_curve_forget(ascc_curve *curve)
{
    curve->blocks.count = 0;
}

void ascc_curve_release(ascc_curve *curve, const ascc_allocator *allocator)
{
    if (curve->blocks.at)
        ascc_release(allocator, curve->blocks.at, curve->block_capacity, sizeof *curve->blocks.at);
    if (curve->blocks.slot)
        ascc_release(allocator, curve->blocks.slot, curve->slot_capacity,
                     sizeof *curve->blocks.slot);
    if (curve->holding)
        ascc_release(allocator, curve->holding, curve->holding_capacity, sizeof *curve->holding);
}

/* ---- Balance ---- */

static int by_key(const void *a, const void *b)
{
    const ascc_load *x = a, *y = b;
    return x->key < y->key ? -1 : x->key > y->key;
}

size_t ascc_loads_join(ascc_load *load, size_t count)
{
    size_t joined = 0;
    if (count)
        qsort(load, count, sizeof *load, by_key);
    for (size_t i = 0; i < count; i++)
        if (joined && load[joined - 1].key == load[i].key)
            load[joined - 1].cost += load[i].cost;
        else
            load[joined++] = load[i];
    return joined;
}

/* What lies before each cut, as it is now. */
static void find_cuts(const ascc_curve *curve, const ascc_load *load, size_t count, double *cut)
{
    double before = 0.0;
    size_t i = 0;
    for (int rank = 0; rank < curve->size; rank++) {
        for (; i < count && load[i].key < curve->first[rank]; i++)
            before += (double)load[i].cost;
        cut[rank] = before;
    }
}

double ascc_curve_most(ascc_curve *curve, const ascc_load *load, size_t count)
{
    double most = 0.0, total = 0.0;
    for (size_t i = 0; i < count; i++)
        total += (double)load[i].cost;
    find_cuts(curve, load, count, curve->cut);
    for (int r = 0; r < curve->size; r++)
        most = fmax(most, (r + 1 < curve->size ? curve->cut[r + 1] : total) - curve->cut[r]);
    return most;
}

void ascc_curve_cut(ascc_curve *curve, const ascc_load *load, size_t count, double limit)
{
    double total = 0.0, before = 0.0;
    int rank = 1;
    for (size_t i = 0; i < count; i++)
        total += (double)load[i].cost;
    const double share = total / curve->size;
    find_cuts(curve, load, count, curve->cut);
    for (int r = 0; r < curve->size; r++) {
        const double now = curve->cut[r], far = limit * share;
        curve->cut[r] = fmin(fmax(share * r, now - far), now + far);
    }
    for (size_t i = 0; i < count; i++) {
        const double here = (double)load[i].cost;
        /* A cut comes before the block whose middle lies behind it. */
        while (rank < curve->size && before + 0.5 * here >= curve->cut[rank])
            curve->first[rank++] = load[i].key;
        before += here;
    }
    while (rank < curve->size)
        curve->first[rank++] = UINT64_MAX;
    curve->first[0] = 0;
}
