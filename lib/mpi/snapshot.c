/* The whole set in one file, and from it. SPDX-License-Identifier: MIT
 *
 * The bytes are those of ascc_particles_snapshot. Process 0 alone writes and reads, from the first byte to the last, a
 * block at a time, so that it needs no memory for the whole and nobody needs a file system in common:
 *
 *     saving    fluid of all processes comes to process 0 in the order of ids, block by block
 *     loading   each process gets a snapshot of its share of the fluid and of all walls, and restores it
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "base/float_env.h"
#include "base/words.h"
#include "file/write_file.h"
#include "points/snapshot.h"
#include "set.h"

#define TAG 0x5d
/* Bytes of numbers that process 0 has at hand at a time. */
#define BLOCK ((size_t)1 << 22)

/* ---- The fluid of all in the order of ids ---- */

/* Blocks of at most `most` rows of all processes together, each of ids below all that follow. */
typedef struct walk {
    size_t most;
    size_t first, end; /* rows of this process in the block */
} walk;

/*
 * A block ends before the id that any process wants last: with `most / size` rows of each it cannot have too many. Nor
 * can it with `most` ids, whoever has them; the farther of both ends it. False: all fluid has been seen.
 */
static bool next_block(ascc_mpi_particles *set, walk *w)
{
    const ascc_particles *p = set->local;
    const size_t count = p->fluid_count, share = w->most / (size_t)set->size;
    w->first = w->end;
    uint64_t own[2] = {w->first < count ? p->id[w->first] : UINT64_MAX,
                       share < count - w->first ? p->id[w->first + share] : UINT64_MAX};
    ascc_mpi_reduce(set, own, 2, MPI_UINT64_T, MPI_MIN);
    if (own[0] == UINT64_MAX)
        return false;
    const uint64_t end = own[0] + w->most > own[1] ? own[0] + w->most : own[1];
    while (w->end < count && p->id[w->end] < end)
        w->end++;
    return true;
}

/* ---- Saving ---- */

/* What process 0 writes; after a failure nothing more, though blocks still come. */
typedef struct writer {
    ascc_file_writer file;
    uint64_t sum;
    ascc_status status;
    ascc_message message;
} writer;

static void write_bytes(writer *w, const void *bytes, size_t size)
{
    if (w->status != ASCC_OK)
        return;
    w->sum = ascc_sum_words(w->sum, bytes, size / 8);
    w->status = ascc_file_add(&w->file, bytes, size, &w->message);
}

/* Numbers as words, a block at a time. */
static void write_numbers(writer *w, const ascc_particle_field *field, const unsigned char *numbers,
                          size_t count, unsigned char *block)
{
    const size_t most = BLOCK / 8;
    for (size_t k = 0, n; k < count; k += n) {
        n = ascc_min_size(count - k, most);
        (void)ascc_snapshot_put_numbers(field, numbers + k * ascc_field_element_size(field), n,
                                        block);
        write_bytes(w, block, 8 * n);
    }
}

/* Rows of this process as ids and words. */
static void pack_block(const ascc_mpi_particles *set, const ascc_particle_field *field,
                       const walk *w, unsigned char *to)
{
    const ascc_particles *p = set->local;
    const size_t numbers = (size_t)ascc_field_numbers(field, p->dimension, p->past_count);
    const unsigned char *rows = ascc_field_rows(p, field);
    for (size_t i = w->first; i < w->end; i++) {
        memcpy(to, &p->id[i], 8);
        to = ascc_snapshot_put_numbers(field, rows + i * numbers * ascc_field_element_size(field),
                                       numbers, to + 8);
    }
}

/* Processes by the ids of their next rows, the least first. */
typedef struct heap {
    const unsigned char *rows;
    const size_t *next; /* [process]: bytes */
    size_t *process, count;
} heap;

static uint64_t id_in(const heap *h, size_t place)
{
    uint64_t id;
    memcpy(&id, h->rows + h->next[h->process[place]], sizeof id);
    return id;
}

static void sift(heap *h, size_t place)
{
    for (size_t child; (child = 2 * place + 1) < h->count; place = child) {
        if (child + 1 < h->count && id_in(h, child + 1) < id_in(h, child))
            child++;
        if (id_in(h, place) < id_in(h, child))
            return;
        const size_t swapped = h->process[place];
        h->process[place] = h->process[child];
        h->process[child] = swapped;
    }
}

/* Rows of so many bytes, each process's in order, become words in the order of ids. Returns where they end. */
static unsigned char *merge_block(ascc_mpi_particles *set, const int *bytes, size_t size,
                                  unsigned char *to)
{
    size_t *next = set->counts, *end = next + set->size;
    heap h = {.rows = set->incoming.at, .next = next, .process = end + set->size};
    for (size_t r = 0, at = 0; r < (size_t)set->size; r++) {
        next[r] = at;
        end[r] = at += (size_t)bytes[r];
        if (bytes[r])
            h.process[h.count++] = r;
    }
    for (size_t place = h.count / 2; place-- > 0;)
        sift(&h, place);
    while (h.count) {
        const size_t r = h.process[0];
        memcpy(to, h.rows + next[r] + 8, size - 8);
        to += size - 8;
        next[r] += size;
        if (next[r] == end[r])
            h.process[0] = h.process[--h.count];
        sift(&h, 0);
    }
    return to;
}

static void save_fluid(ascc_mpi_particles *set, const ascc_particle_field *field, writer *w)
{
    const ascc_particles *p = set->local;
    const size_t size = 8 + 8 * (size_t)ascc_field_numbers(field, p->dimension, p->past_count);
    walk block = {.most = BLOCK / size};
    int *bytes = (int *)set->told, *at = bytes + set->size;
    while (size > 8 && next_block(set, &block)) {
        const int own = (int)((block.end - block.first) * size);
        pack_block(set, field, &block, set->outgoing.at);
        MPI_Gather(&own, 1, MPI_INT, bytes, 1, MPI_INT, 0, set->comm);
        for (int r = 0, before = 0; set->rank == 0 && r < set->size; before += bytes[r++])
            at[r] = before;
        MPI_Gatherv(set->outgoing.at, own, MPI_BYTE, set->incoming.at, bytes, at, MPI_BYTE, 0,
                    set->comm);
        if (set->rank == 0) {
            unsigned char *const merged = set->kept.at;
            write_bytes(w, merged, (size_t)(merge_block(set, bytes, size, merged) - merged));
        }
    }
}

/* Walls are everywhere; what they have received is summed. */
static ascc_status save_walls(ascc_mpi_particles *set, const ascc_particle_field *field, writer *w)
{
    const ascc_particles *p = set->local;
    const bool summed = field == &ascc_particle_fields[ASCC_FIELD_wall_impulse];
    const ascc_status status = summed ? ascc_mpi_sum_wall_impulses(set) : ASCC_OK;
    if (status == ASCC_OK && set->rank == 0)
        write_numbers(w, field, summed ? set->sums.at : ascc_field_rows(p, field),
                      p->boundary_count *
                          (size_t)ascc_field_numbers(field, p->dimension, p->past_count),
                      set->kept.at);
    return status;
}

static void save_ends(const ascc_mpi_particles *set, writer *w, uint64_t fluid, bool head)
{
    unsigned char *const from = set->kept.at;
    if (set->rank != 0)
        return;
    if (head) {
        write_bytes(w, from,
                    (size_t)(ascc_snapshot_put_head(set->local, (size_t)fluid, from) - from));
        return;
    }
    write_bytes(w, from, (size_t)(ascc_snapshot_put_tail(set->local, from) - from));
    ascc_put_word(from, w->sum);
    write_bytes(w, from, 8);
}

static bool make_room(ascc_mpi_particles *set)
{
    const size_t tail = 8 * ascc_snapshot_tail_words(set->local);
    return ascc_mpi_room(set, &set->outgoing, BLOCK, 1) &&
           (set->rank != 0 || (ascc_mpi_room(set, &set->incoming, BLOCK, 1) &&
                               ascc_mpi_room(set, &set->kept, ascc_max_size(BLOCK, tail), 1)));
}

ascc_status ascc_mpi_particles_save(ascc_mpi_particles *set, const char *path)
{
    ASCC_FLOAT_SCOPE;
    uint64_t fluid;
    writer w = {.sum = ASCC_SNAPSHOT_MAGIC, .message = {"no memory for blocks of the snapshot"}};
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    ascc_status status = ascc_mpi_conclude(
        set, set->rank == 0 && !path ? ASCC_ERROR_ARGUMENT : ASCC_OK, "path: NULL");
    if (status != ASCC_OK)
        return status;
    w.status = make_room(set) ? ASCC_OK : ASCC_ERROR_MEMORY;
    if (set->rank == 0 && w.status == ASCC_OK)
        w.status = ascc_file_begin(&w.file, path, &w.message);
    const bool open = set->rank == 0 && w.status == ASCC_OK;
    status = ascc_mpi_conclude(set, w.status, w.message.text);
    if (status == ASCC_OK)
        status = ascc_mpi_particles_count(set, &fluid);
    if (status == ASCC_OK)
        save_ends(set, &w, fluid, true);
    for (size_t i = 0; i < ASCC_FIELD_COUNT && status == ASCC_OK; i++) {
        const ascc_particle_field *field = &ascc_particle_fields[i];
        if (field->kind == ASCC_FLUID)
            save_fluid(set, field, &w);
        else
            status = save_walls(set, field, &w);
    }
    if (status == ASCC_OK) {
        save_ends(set, &w, fluid, false);
        if (open && w.status == ASCC_OK)
            w.status = ascc_file_finish(&w.file, &w.message);
        status = ascc_mpi_conclude(set, w.status, w.message.text);
    }
    if (open)
        ascc_file_drop(&w.file);
    return status;
}

/* ---- Loading ---- */

/* What process 0 reads; after a failure zeros, which are handed out as promised. */
typedef struct source {
    FILE *file;
    bool good;
    uint64_t sum;
} source;

static void read_bytes(source *from, unsigned char *to, size_t size)
{
    from->good = from->good && fread(to, 1, size, from->file) == size;
    if (!from->good)
        memset(to, 0, size);
    from->sum = ascc_sum_words(from->sum, to, size / 8);
}

/* The next bytes to all. */
static void hand_to_all(ascc_mpi_particles *set, source *from, unsigned char *to, size_t size)
{
    for (size_t done = 0, n; done < size; done += n) {
        n = ascc_min_size(size - done, BLOCK);
        if (set->rank == 0)
            read_bytes(from, to + done, n);
        MPI_Bcast(to + done, (int)n, MPI_BYTE, 0, set->comm);
    }
}

/* The next bytes to one process. */
static void hand_to_one(ascc_mpi_particles *set, source *from, int rank, unsigned char *to,
                        size_t size)
{
    for (size_t done = 0, n; done < size; done += n) {
        n = ascc_min_size(size - done, BLOCK);
        if (set->rank == 0)
            read_bytes(from, rank == 0 ? to + done : set->outgoing.at, n);
        if (set->rank == 0 && rank != 0)
            MPI_Send(set->outgoing.at, (int)n, MPI_BYTE, rank, TAG, set->comm);
        else if (set->rank == rank && rank != 0)
            MPI_Recv(to + done, (int)n, MPI_BYTE, 0, TAG, set->comm, MPI_STATUS_IGNORE);
    }
}

/* The share of a process in so many rows. */
static size_t share_of(const ascc_mpi_particles *set, size_t rows, int rank)
{
    const uint64_t size = (uint64_t)set->size, r = (uint64_t)rank;
    return (size_t)(rows * (r + 1) / size - rows * r / size);
}

/* Everything behind the head but the checksum. */
static void hand_out(ascc_mpi_particles *set, source *from, const ascc_snapshot_layout *whole,
                     const ascc_snapshot_layout *own, unsigned char *at)
{
    for (size_t i = 0; i < whole->fields; i++) {
        const ascc_particle_field *field = &ascc_particle_fields[i];
        const size_t size = 8 * (size_t)ascc_field_numbers(field, whole->dimension, whole->past);
        if (field->kind == ASCC_BOUNDARY)
            hand_to_all(set, from, at, own->rows[ASCC_BOUNDARY] * size);
        else
            for (int r = 0; r < set->size; r++)
                hand_to_one(set, from, r, at, share_of(set, whole->rows[ASCC_FLUID], r) * size);
        at += own->rows[field->kind] * size;
    }
    hand_to_all(set, from, at, 8 * own->tail);
}

/* The head of a file that is one, and how many words there are. */
static ascc_status open_source(ascc_mpi_particles *set, source *from, const char *path,
                               uint64_t words[ASCC_SNAPSHOT_HEAD + 1], ascc_message *message)
{
    unsigned char head[8 * ASCC_SNAPSHOT_HEAD] = {0};
    ascc_snapshot_layout layout;
    const char *why;
    from->file = ascc_path_open(path);
    if (!from->file)
        return ascc_fail(message, ASCC_ERROR_FILE, "cannot open '%.140s'", path);
    long size = fseek(from->file, 0, SEEK_END) == 0 ? ftell(from->file) : -1;
    if (size < 0 || fseek(from->file, 0, SEEK_SET) != 0)
        return ascc_fail(message, ASCC_ERROR_FILE, "'%.140s' is no file to be read", path);
    if ((size_t)size < sizeof head || size % 8 != 0)
        size = 0;
    if (size)
        read_bytes(from, head, sizeof head);
    for (size_t i = 0; i < ASCC_SNAPSHOT_HEAD; i++)
        words[i] = ascc_get_word(head + 8 * i);
    words[ASCC_SNAPSHOT_HEAD] = (uint64_t)size / 8;
    if (!ascc_snapshot_read_head(head, (uint64_t)size / 8, &layout, &why))
        return ascc_fail(message, ASCC_ERROR_FORMAT, "'%.140s': %s", path, why);
    if (layout.dimension != set->local->dimension)
        return ascc_fail(message, ASCC_ERROR_MISMATCH,
                         "'%.140s' is of dimension %ld, the set has %ld", path,
                         (long)layout.dimension, (long)set->local->dimension);
    return ASCC_OK;
}

/* Whether all was read, and undamaged. */
static ascc_status close_source(source *from, const char *path, ascc_message *message)
{
    unsigned char end[8];
    const uint64_t sum = from->sum;
    read_bytes(from, end, sizeof end);
    if (!from->good)
        return ascc_fail(message, ASCC_ERROR_FILE, "cannot read all of '%.140s'", path);
    if (ascc_get_word(end) != sum)
        return ascc_fail(message, ASCC_ERROR_FORMAT, "'%.140s': damaged: its checksum is wrong",
                         path);
    return ASCC_OK;
}

/* Ids ascend from process to process. */
static bool are_in_order(const ascc_mpi_particles *set, const ascc_particles *p)
{
    uint64_t last = p && p->fluid_count ? p->id[p->fluid_count - 1] : 0, before = 0;
    MPI_Exscan(&last, &before, 1, MPI_UINT64_T, MPI_MAX, set->comm);
    return set->rank == 0 || !p || !p->fluid_count || before < p->id[0];
}

/* A set from a piece that is a snapshot; NULL on failure, of which a piece from memory is spoken. */
static ascc_status restore_piece(ascc_mpi_particles *set, const unsigned char *piece, size_t size,
                                 ascc_particles **fresh, ascc_message *message)
{
    static const char prefix[] = "memory: ";
    const ascc_particles *p = set->local;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = p->dimension,
                                            .spacing = p->spacing,
                                            .mass = p->default_mass};
    ascc_status status = ascc_particles_create(set->context, &options, fresh);
    if (status != ASCC_OK)
        return ascc_fail(message, status, "no memory for a set");
    status = ascc_particles_restore(*fresh, piece, size);
    if (status != ASCC_OK) {
        const char *text = (*fresh)->message.text;
        const size_t skipped = strncmp(text, prefix, strlen(prefix)) == 0 ? strlen(prefix) : 0;
        (void)ascc_fail(message, status, "%s", text + skipped);
        ascc_particles_destroy(fresh);
    }
    return status;
}

/* Each process has its piece, and the set becomes that, or stays. */
static ascc_status take_pieces(ascc_mpi_particles *set, const unsigned char *piece, size_t size)
{
    ascc_particles *fresh = NULL;
    ascc_message message;
    ascc_status status = restore_piece(set, piece, size, &fresh, &message);
    if (!are_in_order(set, fresh))
        status = ascc_fail(&message, ASCC_ERROR_FORMAT, "impossible ids: they do not ascend");
    status = ascc_mpi_conclude(set, status, message.text);
    if (status == ASCC_OK && set->rank != 0 && fresh->boundary_count)
        memset(fresh->wall_impulse, 0, /* they are summed over processes */
               fresh->boundary_count * (size_t)fresh->dimension * sizeof(int64_t));
    if (status == ASCC_OK)
        ascc_mpi_become(set, fresh);
    ascc_particles_destroy(&fresh);
    return status;
}

/* Once all know the head. */
static ascc_status load_rest(ascc_mpi_particles *set, source *from, const char *path,
                             const uint64_t *words)
{
    ascc_snapshot_layout whole, own;
    ascc_message message = {"no memory for this share of the snapshot"};
    unsigned char head[8 * ASCC_SNAPSHOT_HEAD];
    const char *why;
    for (size_t i = 0; i < ASCC_SNAPSHOT_HEAD; i++)
        ascc_put_word(head + 8 * i, words[i]);
    (void)ascc_snapshot_read_head(head, words[ASCC_SNAPSHOT_HEAD], &whole, &why);
    own = whole;
    ascc_snapshot_set_fluid(&own, head, share_of(set, whole.rows[ASCC_FLUID], set->rank));
    const ascc_allocator *allocator = &set->context->allocator;
    unsigned char *piece = ascc_allocate(allocator, own.words, 8);
    const bool room = piece && (set->rank != 0 || ascc_mpi_room(set, &set->outgoing, BLOCK, 1));
    ascc_status status = ascc_mpi_conclude(set, room ? ASCC_OK : ASCC_ERROR_MEMORY, message.text);
    if (status == ASCC_OK) {
        memcpy(piece, head, sizeof head);
        hand_out(set, from, &whole, &own, piece + sizeof head);
        status = set->rank == 0 ? close_source(from, path, &message) : ASCC_OK;
        status = ascc_mpi_conclude(set, status, message.text);
    }
    if (status == ASCC_OK) {
        ascc_put_word(piece + 8 * (own.words - 1),
                      ascc_sum_words(ASCC_SNAPSHOT_MAGIC, piece, own.words - 1));
        status = take_pieces(set, piece, 8 * own.words);
    }
    if (piece)
        ascc_release(allocator, piece, own.words, 8);
    return status;
}

ascc_status ascc_mpi_particles_load(ascc_mpi_particles *set, const char *path)
{
    ASCC_FLOAT_SCOPE;
    uint64_t words[ASCC_SNAPSHOT_HEAD + 1] = {0};
    source from = {.good = true, .sum = ASCC_SNAPSHOT_MAGIC};
    ascc_message message = {"path: NULL"};
    ascc_status status = ASCC_OK;
    if (!ascc_mpi_is_set(set))
        return ASCC_ERROR_ARGUMENT;
    ascc_mpi_open(set);
    if (set->rank == 0)
        status = path ? open_source(set, &from, path, words, &message) : ASCC_ERROR_ARGUMENT;
    status = ascc_mpi_conclude(set, status, message.text);
    if (status == ASCC_OK) {
        MPI_Bcast(words, ASCC_SNAPSHOT_HEAD + 1, MPI_UINT64_T, 0, set->comm);
        status = load_rest(set, &from, path, words);
    }
    if (from.file)
        (void)fclose(from.file);
    return status;
}
