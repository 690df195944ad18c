/* Marks the rows that sweeps change. SPDX-License-Identifier: MIT */
#include "active_rows.h"

#include <string.h>

#define ROWS 1024 /* of a block of work */

enum { PUSHED = 1, MOVED = 2 };

bool ascc_active_rows_open(ascc_active_rows *rows, ascc_arena *arena, size_t count)
{
    *rows = (ascc_active_rows){.count = count};
    rows->pushed = ascc_arena_lend(arena, count, 1);
    rows->moved = ascc_arena_lend(arena, count, 1);
    rows->told = ascc_arena_lend(arena, count, 1);
    return rows->pushed && rows->moved && rows->told;
}

void ascc_active_rows_clear(ascc_active_rows *rows)
{
    memset(rows->pushed, 0, rows->count);
    memset(rows->moved, 0, rows->count);
    memset(rows->told, 0, rows->count);
}

/* Several threads may mark one row; all write the same. */
static void mark(uint8_t *marks, size_t row)
{
    __atomic_store_n(&marks[row], 1, __ATOMIC_RELAXED);
}

static void mark_pairs(const ascc_gradients *pairs, size_t i, uint8_t *marks)
{
    mark(marks, i);
    for (size_t k = pairs->start[i]; k < pairs->end[i]; k++)
        mark(marks, pairs->neighbor[k]);
}

static void press_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const ascc_active_rows *rows = data;
    for (size_t i = begin; i < end; i++)
        if (rows->pressure[i] > 0.0f && !(rows->told[i] & PUSHED)) {
            rows->told[i] |= PUSHED;
            mark_pairs(rows->pairs, i, rows->pushed);
        }
}

static void move_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const ascc_active_rows *rows = data;
    for (size_t i = begin; i < end; i++)
        if (rows->pushed[i] && !(rows->told[i] & MOVED)) {
            rows->told[i] |= MOVED;
            mark_pairs(rows->pairs, i, rows->moved);
        }
}

void ascc_active_rows_press(ascc_active_rows *rows, ascc_workers *workers,
                            const ascc_gradients *pairs, const float *pressure)
{
    rows->pairs = pairs;
    rows->pressure = pressure;
    ascc_workers_run(workers, rows->count, ROWS, press_rows, rows);
}

void ascc_active_rows_move(ascc_active_rows *rows, ascc_workers *workers,
                           const ascc_gradients *pairs)
{
    rows->pairs = pairs;
    ascc_workers_run(workers, rows->count, ROWS, move_rows, rows);
}
