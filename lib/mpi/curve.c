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

uint64_t ascc_curve_key(const ascc_curve *curve, const int64_t block[3])
{
    uint64_t key = 0;
    for (int c = 0; c < curve->dimension; c++)
        key |= spread((uint64_t)(block[c] + HALF)) << c;
    return key;
}

int ascc_curve_owner(const ascc_curve *curve, const int64_t block[3])
{
    const uint64_t key = ascc_curve_key(curve, block);
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

/* Whether one process owns all within reach of a block, as of most of them. */
static bool is_inner(ascc_owners *owners, const ascc_curve *curve, const double *place,
                     double reach)
{
    double from[3] = {0.0, 0.0, 0.0}, to[3] = {0.0, 0.0, 0.0};
    int64_t block[3];
    ascc_curve_block(curve, place, block);
    if (!owners->known || owners->reach != reach ||
        memcmp(block, owners->block, sizeof block) != 0) {
        for (int32_t c = 0; c < curve->dimension; c++) {
            from[c] = (double)block[c] * curve->edge - reach;
            to[c] = (double)(block[c] + 1) * curve->edge + reach;
        }
        owners->known = false;
        find_in_box(owners, curve, from, to);
        memcpy(owners->block, block, sizeof block);
        owners->reach = reach;
        owners->inner = owners->count == 1;
    }
    return owners->inner;
}

void ascc_owners_find(ascc_owners *owners, const ascc_curve *curve, const double *place,
                      double reach)
{
    double from[3] = {0.0, 0.0, 0.0}, to[3] = {0.0, 0.0, 0.0};
    if (is_inner(owners, curve, place, reach))
        return;
    for (int32_t c = 0; c < curve->dimension; c++) {
        from[c] = place[c] - reach;
        to[c] = place[c] + reach;
    }
    find_in_box(owners, curve, from, to);
}

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
