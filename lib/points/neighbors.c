/* Neighbour lists made on demand from runs of cells. SPDX-License-Identifier: MIT */
#include "neighbors.h"

#include <math.h>
#include <string.h>

/* Candidates given to the search kernel at once: after each such piece a list is compared with
 * max_neighbors, so scratch has to hold no more than one piece beyond that. */
#define SEARCH_CHUNK 1024

ascc_status ascc_rows_open(ascc_rows *rows, const ascc_search_tools *tools, size_t expected)
{
    const size_t count = rows->query->count;
    rows->used = rows->capacity = rows->stored = 0;
    rows->longest = 0;
    rows->span = 0;
    rows->count = ascc_arena_take(tools->arena, count, sizeof *rows->count);
    rows->start = ascc_arena_take(tools->arena, count, sizeof *rows->start);
    if (!rows->count || !rows->start)
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu neighbour lists",
                         count);
    memset(rows->count, 0xff, count * sizeof *rows->count); /* ASCC_ROW_ABSENT */
    rows->neighbor = NULL;
    rows->capacity = expected;
    return ASCC_OK;
}

/* Room for `capacity` neighbours, the `used` ones kept. */
static bool rows_reserve(ascc_rows *rows, ascc_arena *arena, size_t capacity)
{
    uint32_t *neighbor = ascc_arena_grow(arena, rows->neighbor, rows->neighbor ? rows->capacity : 0,
                                         capacity, sizeof *neighbor);
    if (!neighbor)
        return false;
    rows->neighbor = neighbor;
    rows->capacity = capacity;
    return true;
}

/* A neighbour and how far it is. */
typedef struct distance {
    float square;
    uint32_t row;
} distance;

typedef struct rows_job {
    ascc_rows *rows;
    const ascc_search_tools *tools;
    const uint8_t *wanted;
    uint32_t *scratch; /* [slots][scratch_size] */
    distance *cut;     /* [query count], with a limit: the last neighbour kept */
    distance *heap;    /* [slots][limit] */
    size_t scratch_size;
    atomic_size_t used;
    atomic_uint crowded; /* 1 + a query with too many neighbours */
    atomic_uint longest;
    atomic_size_t stored, span;
} rows_job;

static void low_words(const ascc_points *points, size_t row, int32_t at[3])
{
    for (int c = 0; c < 3; c++)
        at[c] = points->low[c][row];
}

/* Squared distance, the same bits as the search kernel's. */
static float squared_distance(const int32_t a[3], const ascc_points *points, uint32_t row)
{
    float d[3];
    for (int c = 0; c < 3; c++)
        d[c] = (float)(int32_t)((uint32_t)points->low[c][row] - (uint32_t)a[c]);
    return d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
}

static bool farther(float a, uint32_t a_row, float b, uint32_t b_row)
{
    return a > b || (a == b && a_row > b_row);
}

/* Puts the root of a heap, the farthest on top, where it belongs. */
static void sink(distance *heap, size_t count)
{
    const distance moved = heap[0];
    size_t at = 0;
    for (;;) {
        size_t child = 2 * at + 1;
        if (child + 1 < count && farther(heap[child + 1].square, heap[child + 1].row,
                                         heap[child].square, heap[child].row))
            child++;
        if (child >= count ||
            !farther(heap[child].square, heap[child].row, moved.square, moved.row))
            break;
        heap[at] = heap[child];
        at = child;
    }
    heap[at] = moved;
}

static void rise(distance *heap, size_t at)
{
    const distance moved = heap[at];
    for (; at > 0; at = (at - 1) / 2) {
        const distance parent = heap[(at - 1) / 2];
        if (!farther(moved.square, moved.row, parent.square, parent.row))
            break;
        heap[at] = parent;
    }
    heap[at] = moved;
}

/* Drops all but the `limit` nearest of found[count]; the query itself does not count and stays. Order
 * is kept. Tells the last one kept, or that all were. heap has room for `limit`. */
static size_t keep_nearest(const ascc_rows *rows, const int32_t at[3], uint32_t query,
                           uint32_t *found, size_t count, distance *heap, distance *cut)
{
    const size_t limit = (size_t)rows->limit;
    size_t others = 0;
    for (size_t k = 0; k < count; k++) {
        if (rows->same && found[k] == query)
            continue;
        const distance d = {squared_distance(at, rows->source, found[k]), found[k]};
        if (others < limit) {
            heap[others] = d;
            rise(heap, others);
        } else if (farther(heap[0].square, heap[0].row, d.square, d.row)) {
            heap[0] = d;
            sink(heap, limit);
        }
        others++;
    }
    *cut = (distance){INFINITY, UINT32_MAX};
    if (others < limit)
        return count;
    *cut = heap[0];
    size_t kept = 0;
    for (size_t k = 0; k < count; k++)
        if ((rows->same && found[k] == query) ||
            !farther(squared_distance(at, rows->source, found[k]), found[k], cut->square, cut->row))
            found[kept++] = found[k];
    return kept;
}

/* What a search needs again and again. */
typedef struct searcher {
    const rows_job *job;
    ascc_coordinates points; /* of slots */
    const uint32_t *order;   /* rows of slots, or NULL */
    float limit;
    size_t (*find)(const ascc_coordinates *points, const ascc_run *runs, size_t count, int32_t x,
                   int32_t y, int32_t z, float limit, uint32_t *found);
} searcher;

static searcher searcher_of(const rows_job *job)
{
    const ascc_rows *rows = job->rows;
    const ascc_grid *grid = rows->source_grid;
    const ascc_kernels *kernels = job->tools->kernels;
    const bool cube = rows->inverse_cube > 0.0f;
    return (searcher){.job = job,
                      .points = {grid->low[0], grid->low[1], grid->low[2]},
                      .order = grid->order,
                      .limit = cube ? rows->inverse_cube : (float)(rows->radius * rows->radius),
                      .find = cube ? kernels->search_cube : kernels->search};
}

/* Drops points at the query's own place; returns how many are left. */
static size_t drop_self(const ascc_rows *rows, const int32_t at[3], uint32_t *found, size_t count)
{
    size_t kept = 0;
    for (size_t k = 0; k < count; k++) {
        const uint32_t row = found[k];
        if (rows->source->low[0][row] != at[0] || rows->source->low[1][row] != at[1] ||
            rows->source->low[2][row] != at[2])
            found[kept++] = row;
    }
    return kept;
}

/* Drops what the list's user does not want to see. */
static size_t drop_hidden(const ascc_rows *rows, uint32_t query, uint32_t *found, size_t count)
{
    size_t kept = 0;
    for (size_t k = 0; k < count; k++)
        if (!rows->hides(rows->hides_data, query, found[k]))
            found[kept++] = found[k];
    return kept;
}

/* Appends the neighbours of one query within runs of at most SEARCH_CHUNK slots in all; false when there are
 * too many. */
static bool search_piece(const searcher *s, const ascc_run *runs, size_t run_count,
                         const int32_t at[3], uint32_t query, uint32_t *found, size_t *count,
                         distance *heap)
{
    const ascc_rows *rows = s->job->rows;
    uint32_t *fresh = found + *count;
    size_t n = s->find(&s->points, runs, run_count, at[0], at[1], at[2], s->limit, fresh);
    for (size_t k = 0; s->order && k < n; k++)
        fresh[k] = s->order[fresh[k]];
    if (rows->skip_self)
        n = drop_self(rows, at, fresh, n);
    if (rows->hides)
        n = drop_hidden(rows, query, fresh, n);
    *count += n;
    if (*count > (size_t)rows->max_neighbors) {
        if (!rows->limit)
            return false;
        distance cut;
        *count = keep_nearest(rows, at, query, found, *count, heap, &cut);
    }
    return true;
}

/* Runs of slots around a cell, and how many slots that is. */
typedef struct surroundings {
    ascc_run run[9];
    size_t cell[9]; /* where the last lookup in a row of cells ended: the next query cell is near */
    size_t count, slots;
} surroundings;

/* All neighbours of one query; a crowd piece by piece. */
static bool search_around(const searcher *s, const surroundings *around, const int32_t at[3],
                          uint32_t query, uint32_t *found, size_t *count, distance *heap)
{
    if (around->slots <= SEARCH_CHUNK)
        return search_piece(s, around->run, around->count, at, query, found, count, heap);
    for (size_t r = 0; r < around->count; r++) {
        ascc_run piece = {around->run[r].begin, around->run[r].begin};
        for (; piece.end < around->run[r].end; piece.begin = piece.end) {
            piece.end = ascc_min_size(around->run[r].end, piece.begin + SEARCH_CHUNK);
            if (!search_piece(s, &piece, 1, at, query, found, count, heap))
                return false;
        }
    }
    return true;
}

/* Neighbours a worker sets aside at once, so that threads seldom meet at the counter. */
#define SET_ASIDE 512

/* What a worker has set aside and not used; its longest list, the widest, and all it stored. */
typedef struct room {
    size_t next, end;
    size_t longest, stored, span;
} room;

/* How far in the order of rows a list goes. Where slots are rows, it ascends: its ends tell. */
static size_t span_of(const ascc_rows *rows, size_t query, const uint32_t *found, size_t count)
{
    const size_t step = rows->source_grid->order || count < 2 ? 1 : count - 1;
    size_t span = 0;
    for (size_t k = 0; rows->same && k < count; k += step) {
        const size_t j = found[k];
        span = ascc_max_size(span, j > query ? j - query : query - j);
    }
    return span;
}

/* Copies a finished list to its place, if there is one; else it is made again. */
static void store_row(rows_job *job, room *r, size_t query, const uint32_t *found, size_t count)
{
    ascc_rows *rows = job->rows;
    if (count > r->end - r->next) {
        const size_t wanted = ascc_max_size(count, SET_ASIDE);
        r->next = atomic_fetch_add_explicit(&job->used, wanted, memory_order_relaxed);
        r->end = r->next + wanted;
    }
    const size_t start = r->next;
    r->next += count; /* also where there is no room: what is set aside tells how much is needed */
    if (start + count > rows->capacity)
        return;
    memcpy(rows->neighbor + start, found, count * sizeof *found);
    rows->start[query] = start;
    rows->count[query] = (uint32_t)count;
    r->longest = ascc_max_size(r->longest, count);
    r->stored += count;
    r->span = ascc_max_size(r->span, span_of(rows, query, found, count));
}

static void tell(rows_job *job, const room *r)
{
    atomic_fetch_add_explicit(&job->stored, r->stored, memory_order_relaxed);
    size_t span = atomic_load_explicit(&job->span, memory_order_relaxed);
    while (span < r->span &&
           !atomic_compare_exchange_weak_explicit(&job->span, &span, r->span, memory_order_relaxed,
                                                  memory_order_relaxed))
        ;
    unsigned seen = atomic_load_explicit(&job->longest, memory_order_relaxed);
    while (seen < r->longest &&
           !atomic_compare_exchange_weak_explicit(&job->longest, &seen, (unsigned)r->longest,
                                                  memory_order_relaxed, memory_order_relaxed))
        ;
}

/* First occupied cell whose key is not below `key`, looking from `from` on: steps of growing length,
 * then halves, since the wanted cell is mostly near. */
static size_t cell_at(const ascc_grid *grid, size_t from, uint64_t key)
{
    size_t low = from, step = 1;
    while (low + step < grid->cell_count && grid->key[low + step] < key) {
        low += step;
        step *= 2;
    }
    size_t high = ascc_min_size(low + step, grid->cell_count);
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (grid->key[middle] < key)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

/* The runs of source slots around a query cell: three cells along x each, for every (dz, dy). */
static void find_runs(const ascc_rows *rows, uint64_t key, surroundings *around)
{
    const ascc_grid *grid = rows->source_grid;
    const int reach = grid->flat ? 0 : 1;
    size_t n = 0;
    around->slots = 0;
    for (int dz = -reach; dz <= reach; dz++)
        for (int dy = -1; dy <= 1; dy++, n++) {
            const uint64_t middle = key + ((uint64_t)(int64_t)dz << grid->shift_z) +
                                    ((uint64_t)(int64_t)dy << grid->shift_y);
            const size_t first = cell_at(grid, around->cell[n], middle - 1);
            size_t last = first;
            while (last < grid->cell_count && grid->key[last] <= middle + 1)
                last++;
            around->cell[n] = first;
            around->run[n] = (ascc_run){grid->start[first], grid->start[last]};
            around->slots += around->run[n].end - around->run[n].begin;
        }
    around->count = n;
}

static bool row_wanted(const rows_job *job, size_t row)
{
    return job->rows->count[row] == ASCC_ROW_ABSENT && (!job->wanted || job->wanted[row]);
}

/* Lists of the queries in cells [begin, end). */
static void make_rows(void *data, size_t begin, size_t end, int32_t slot)
{
    rows_job *job = data;
    ascc_rows *rows = job->rows;
    const ascc_grid *grid = rows->query_grid;
    uint32_t *found = job->scratch + (size_t)slot * job->scratch_size;
    distance *heap = rows->limit ? job->heap + (size_t)slot * (size_t)rows->limit : NULL;
    const searcher search = searcher_of(job);
    surroundings around = {.count = 0};
    room set_aside = {0};
    for (size_t c = begin; c < end; c++) {
        around.count = 0;
        for (size_t s = grid->start[c]; s < grid->start[c + 1]; s++) {
            const size_t row = grid->order ? grid->order[s] : s;
            if (!row_wanted(job, row))
                continue;
            if (around.count == 0)
                find_runs(rows, grid->key[c], &around);
            int32_t at[3];
            low_words(rows->query, row, at);
            size_t count = 0;
            if (!search_around(&search, &around, at, (uint32_t)row, found, &count, heap)) {
                atomic_store_explicit(&job->crowded, (unsigned)row + 1, memory_order_relaxed);
                return;
            }
            if (rows->limit)
                count = keep_nearest(rows, at, (uint32_t)row, found, count, heap, &job->cut[row]);
            store_row(job, &set_aside, row, found, count);
        }
    }
    tell(job, &set_aside);
}

/* One pass over all query cells; the lists that did not fit are left absent. */
static ascc_status rows_pass(rows_job *job)
{
    const ascc_rows *rows = job->rows;
    atomic_store(&job->used, rows->used);
    ascc_workers_run(job->tools->workers, rows->query_grid->cell_count, 64, make_rows, job);
    const unsigned crowded = atomic_load(&job->crowded);
    if (crowded)
        return ascc_fail(job->tools->message, ASCC_ERROR_LIMIT,
                         "a point has more than max_neighbors = %d neighbours",
                         rows->max_neighbors);
    return ASCC_OK;
}

/* Keeps a neighbour only if both sides kept each other, so that the relation stays symmetric. */
static void drop_one_sided(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    const rows_job *job = data;
    ascc_rows *rows = job->rows;
    for (size_t i = begin; i < end; i++) {
        uint32_t *neighbor = rows->neighbor + rows->start[i];
        int32_t at[3];
        low_words(rows->query, i, at);
        size_t kept = 0;
        for (size_t k = 0; k < rows->count[i]; k++) {
            const uint32_t j = neighbor[k];
            const float d = squared_distance(at, rows->source, j);
            if (j != i && farther(d, (uint32_t)i, job->cut[j].square, job->cut[j].row))
                continue;
            neighbor[kept++] = j;
        }
        rows->count[i] = (uint32_t)kept;
    }
}

ascc_status ascc_rows_make(ascc_rows *rows, const ascc_search_tools *tools, const uint8_t *wanted)
{
    const bool mutual = rows->limit && rows->same;
    if (mutual) { /* whom a list keeps depends on all others */
        wanted = NULL;
        if (rows->neighbor)
            return ASCC_OK;
    }
    const ascc_arena_mark mark = ascc_arena_mark_of(tools->arena);
    const size_t slots = (size_t)ascc_workers_count(tools->workers);
    rows_job job = {.rows = rows, .tools = tools, .wanted = wanted};
    job.scratch_size = (size_t)rows->max_neighbors + SEARCH_CHUNK + 32;
    job.scratch = ascc_arena_lend(tools->arena, slots * job.scratch_size, sizeof *job.scratch);
    if (rows->limit) {
        job.cut = ascc_arena_lend(tools->arena, rows->query->count, sizeof *job.cut);
        job.heap = ascc_arena_lend(tools->arena, slots * (size_t)rows->limit, sizeof *job.heap);
    }
    if (!job.scratch || (rows->limit && (!job.cut || !job.heap)))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for a neighbour search");
    if (!rows->neighbor && !rows_reserve(rows, tools->arena, rows->capacity))
        return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu neighbours",
                         rows->capacity);
    ascc_status status = rows_pass(&job);
    size_t needed = atomic_load(&job.used);
    while (status == ASCC_OK && needed > rows->capacity) {
        rows->used = rows->capacity; /* whole lists below it are kept, with holes at the end */
        if (!rows_reserve(rows, tools->arena, needed + needed / 8))
            return ascc_fail(tools->message, ASCC_ERROR_MEMORY, "no memory for %zu neighbours",
                             needed);
        status = rows_pass(&job);
        needed = atomic_load(&job.used);
    }
    if (status != ASCC_OK)
        return status;
    rows->used = needed;
    rows->longest = (uint32_t)ascc_max_size(rows->longest, atomic_load(&job.longest));
    rows->stored += atomic_load(&job.stored);
    rows->span = ascc_max_size(rows->span, atomic_load(&job.span));
    if (mutual)
        ascc_workers_run(tools->workers, rows->query->count, 256, drop_one_sided, &job);
    ascc_arena_return(tools->arena, mark);
    return ASCC_OK;
}
