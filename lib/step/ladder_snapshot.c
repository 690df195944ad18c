/* A ladder's choices and what it knows of costs, as bytes and back. SPDX-License-Identifier: MIT */
#include <math.h>

#include "base/words.h"
#include "ladder.h"

/*
 * Words of 64 bits, little endian:
 *
 *   magic version rungs rung stood recent_count late changes doubted doubter doubts | recent[3] | cost[rungs] steps_on[rungs]
 *   | (step rung)[changes] | checksum
 */
#define MAGIC UINT64_C(0x44414c4343534141) /* the bytes "AASCCLAD" */
#define VERSION 2
#define RECENT 11 /* where `recent` begins */
#define HEADER (RECENT + ASCC_RUNG_RECENT)

static bool is_ladder(const ascc_ladder *ladder)
{
    return ladder && ladder->magic == ASCC_LADDER_MAGIC;
}

static size_t words_of(size_t rungs, size_t changes)
{
    return HEADER + 2 * rungs + 2 * changes + 1;
}

static unsigned char *put(unsigned char *at, uint64_t word)
{
    ascc_put_word(at, word);
    return at + 8;
}

static uint64_t word(const unsigned char *bytes, size_t index)
{
    return ascc_get_word(bytes + 8 * index);
}

static double real(const unsigned char *bytes, size_t index)
{
    return ascc_double_of(word(bytes, index));
}

size_t ascc_ladder_snapshot_size(const ascc_ladder *ladder)
{
    return is_ladder(ladder) ? 8 * words_of((size_t)ladder->count, ladder->change_count) : 0;
}

ascc_status ascc_ladder_snapshot(const ascc_ladder *ladder, void *memory, size_t capacity)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder) || !memory || capacity < ascc_ladder_snapshot_size(ladder))
        return ASCC_ERROR_ARGUMENT;
    const ascc_rung_choice *choice = &ladder->choice;
    const ascc_ladder_statistics *s = &ladder->statistics;
    unsigned char *at = memory;
    at = put(at, MAGIC);
    at = put(at, VERSION);
    at = put(at, (uint64_t)ladder->count);
    at = put(at, (uint64_t)choice->rung);
    at = put(at, choice->stood);
    at = put(at, choice->recent_count);
    at = put(at, s->late);
    at = put(at, ladder->change_count);
    at = put(at, (uint64_t)choice->doubted);
    at = put(at, (uint64_t)choice->doubter);
    at = put(at, choice->doubts);
    for (int i = 0; i < ASCC_RUNG_RECENT; i++)
        at = put(at, ascc_bits_of(choice->recent[i]));
    for (int32_t r = 0; r < ladder->count; r++)
        at = put(at, ascc_bits_of(choice->cost[r]));
    for (int32_t r = 0; r < ladder->count; r++)
        at = put(at, s->steps_on[r]);
    for (size_t k = 0; k < ladder->change_count; k++) {
        at = put(at, ladder->change[k].step);
        at = put(at, (uint64_t)ladder->change[k].rung);
    }
    put(at, ascc_sum_words(MAGIC, memory, (size_t)(at - (unsigned char *)memory) / 8));
    return ASCC_OK;
}

/* Whether a ladder of that many rungs can have come to this. */
static bool is_possible(const unsigned char *bytes, size_t rungs, size_t changes)
{
    bool good = word(bytes, 3) < rungs && word(bytes, 8) <= rungs && word(bytes, 8) > 0 &&
                word(bytes, 9) < rungs;
    for (size_t i = RECENT; i < HEADER + rungs; i++) {
        const double seconds = real(bytes, i);
        good = good && seconds >= 0.0 && isfinite(seconds);
    }
    uint64_t steps = 0;
    for (size_t r = 0; r < rungs; r++)
        good = good && !__builtin_add_overflow(steps, word(bytes, HEADER + rungs + r), &steps);
    good = good && (changes == 0) == (steps == 0) && word(bytes, 6) <= steps;
    for (size_t k = 0; good && k < changes; k++) {
        const size_t at = HEADER + 2 * rungs + 2 * k;
        const uint64_t step = word(bytes, at), rung = word(bytes, at + 1);
        good = step < steps && rung < rungs &&
               (k ? step > word(bytes, at - 2) && rung != word(bytes, at - 1) : step == 0);
    }
    return good;
}

static ascc_status check(ascc_ladder *ladder, const unsigned char *bytes, size_t size)
{
    const size_t words = size / 8;
    if (!bytes)
        return ascc_ladder_fail(ladder, ASCC_ERROR_ARGUMENT, "memory: NULL");
    if (size % 8 != 0 || words < words_of(1, 0) || word(bytes, 0) != MAGIC)
        return ascc_ladder_fail(ladder, ASCC_ERROR_FORMAT, "memory: not a ladder's snapshot");
    if (word(bytes, 1) != VERSION)
        return ascc_ladder_fail(ladder, ASCC_ERROR_FORMAT, "memory: of a version not known here");
    if (word(bytes, words - 1) != ascc_sum_words(MAGIC, bytes, words - 1))
        return ascc_ladder_fail(ladder, ASCC_ERROR_FORMAT,
                                "memory: damaged: its checksum is wrong");
    const uint64_t rungs = word(bytes, 2), changes = word(bytes, 7);
    if (rungs < 1 || rungs > ASCC_MAX_RUNGS || changes > words ||
        words != words_of((size_t)rungs, (size_t)changes) ||
        !is_possible(bytes, (size_t)rungs, (size_t)changes))
        return ascc_ladder_fail(ladder, ASCC_ERROR_FORMAT, "memory: of no possible ladder");
    if (rungs != (uint64_t)ladder->count)
        return ascc_ladder_fail(ladder, ASCC_ERROR_MISMATCH,
                                "memory: a snapshot of %d rungs, the ladder has %d", (int)rungs,
                                ladder->count);
    return ASCC_OK;
}

static void become(ascc_ladder *ladder, const unsigned char *bytes, size_t changes)
{
    ascc_rung_choice *choice = &ladder->choice;
    ascc_ladder_statistics *s = &ladder->statistics;
    const size_t rungs = (size_t)ladder->count;
    choice->rung = s->rung = (int32_t)word(bytes, 3);
    choice->reason = s->reason = ASCC_LADDER_FITS;
    choice->stood = word(bytes, 4);
    choice->recent_count = word(bytes, 5);
    s->late = word(bytes, 6);
    choice->doubted = (int32_t)word(bytes, 8);
    choice->doubter = (int32_t)word(bytes, 9);
    choice->doubts = word(bytes, 10);
    s->changes = changes ? changes - 1 : 0;
    for (size_t i = 0; i < ASCC_RUNG_RECENT; i++)
        choice->recent[i] = real(bytes, RECENT + i);
    for (size_t r = 0; r < rungs; r++) {
        choice->cost[r] = real(bytes, HEADER + r);
        s->steps_on[r] = word(bytes, HEADER + rungs + r);
    }
    for (size_t k = 0; k < changes; k++)
        ladder->change[k] =
            (ascc_rung_change){.step = word(bytes, HEADER + 2 * rungs + 2 * k),
                               .rung = (int32_t)word(bytes, HEADER + 2 * rungs + 2 * k + 1)};
    ladder->change_count = changes;
}

ascc_status ascc_ladder_restore(ascc_ladder *ladder, const void *memory, size_t size)
{
    ASCC_FLOAT_SCOPE;
    if (!is_ladder(ladder))
        return ASCC_ERROR_ARGUMENT;
    const ascc_status status = check(ladder, memory, size);
    if (status != ASCC_OK)
        return status;
    const size_t changes = (size_t)word(memory, 7);
    if (!ascc_grow(&ladder->context->allocator, (void **)&ladder->change, &ladder->change_capacity,
                   changes, sizeof *ladder->change))
        return ascc_ladder_fail(ladder, ASCC_ERROR_MEMORY, "no memory for %zu choices", changes);
    become(ladder, memory, changes);
    return ASCC_OK;
}
