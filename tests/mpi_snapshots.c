/* Snapshots of several processes in one file, against the snapshot of an ordinary set of the same.
 * SPDX-License-Identifier: MIT
 *
 *   mpirun -n N mpi_snapshots FOLDER
 */
#include <ascc/mpi.h>

#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "support/distributed.h"
#include "support/failing_allocator.h"

#define ROUNDS 40
#define LARGE 6000 /* rows a round of all processes: several blocks of a snapshot */
#define SMALL 60

typedef struct fixture {
    ascc_context *context;
    ascc_mpi_particles *set;
    ascc_particles *one; /* on process 0: the whole */
} fixture;

static ascc_particles *make_whole(ascc_context *context)
{
    const ascc_particles_options options = {.size = sizeof options, .dimension = 3, .spacing = 0.1};
    ascc_particles *one;
    need(ascc_particles_create(context, &options, &one), "set", "");
    return one;
}

static ascc_mpi_particles *make_spread(ascc_context *context)
{
    const ascc_particles_options options = {.size = sizeof options, .dimension = 3, .spacing = 0.1};
    ascc_mpi_particles *set;
    need(ascc_mpi_particles_create(context, &options, MPI_COMM_WORLD, &set), "set", "");
    return set;
}

static void add_box(ascc_particles *set)
{
    const ascc_shape shape = {.size = sizeof shape,
                              .kind = ASCC_SHAPE_BOX,
                              .water = ASCC_WATER_INSIDE,
                              .half = {0.5, 0.5, 0.5}};
    const ascc_pose pose = {.size = sizeof pose, .spin = {0.0, 0.0, 1.0}};
    int32_t body;
    need(ascc_body_add(set, &shape, &pose, &body), "walls", ascc_particles_message(set));
}

/* How many rows a process adds in a round: none, few or many. */
static size_t part(size_t most, int round, int of)
{
    return most / (size_t)processes * (size_t)((3 * round + 5 * of) % 4) / 2;
}

/* Fluid whose ids are scattered over processes, some of them gone. */
static void scatter_fluid(fixture *f, size_t most)
{
    double(*position)[3] = calloc(2 * most, sizeof *position);
    uint64_t first = 0, *gone = calloc(2 * most, sizeof *gone);
    if (!position || !gone)
        MPI_Abort(MPI_COMM_WORLD, 1);
    add_box(ascc_mpi_particles_local(f->set));
    if (rank == 0)
        add_box(f->one);
    for (int round = 0; round < ROUNDS; round++)
        for (int r = 0; r < processes; r++) {
            const size_t count = part(most, round, r);
            for (size_t i = 0; i < count; i++, first++)
                for (int c = 0; c < 3; c++)
                    position[i][c] = 0.01 * (double)((first * (size_t)(c + 3)) % 3001) - 15.0;
            const ascc_const_array rows = {.data = position, .scalar = ASCC_DOUBLE};
            need(ascc_mpi_particles_add_fluid(f->set, r == rank ? count : 0, &rows, &rows, NULL,
                                              NULL),
                 "fluid", ascc_mpi_particles_message(f->set));
            if (rank == 0 && count)
                need(ascc_particles_add_fluid(f->one, count, &rows, &rows, NULL, NULL), "fluid",
                     ascc_particles_message(f->one));
        }
    uint64_t fluid;
    size_t count = 0;
    need(ascc_mpi_particles_count(f->set, &fluid), "count", "");
    for (uint64_t id = fluid; rank == 0 && id > fluid / 2 && count < most; id -= 7) {
        ascc_kind kind;
        size_t row;
        if (ascc_particles_find(f->one, id, &kind, &row) == ASCC_OK && kind == ASCC_FLUID)
            gone[count++] = id;
    }
    need(ascc_mpi_particles_remove_fluid(f->set, count, gone), "remove",
         ascc_mpi_particles_message(f->set));
    if (rank == 0)
        need(ascc_particles_remove(f->one, count, gone), "remove", "");
    free(position);
    free(gone);
}

static fixture open_fixture(ascc_context *context, size_t most)
{
    fixture f = {context, make_spread(context), rank == 0 ? make_whole(context) : NULL};
    scatter_fluid(&f, most);
    return f;
}

static void close_fixture(fixture *f)
{
    ascc_mpi_particles_destroy(&f->set);
    ascc_particles_destroy(&f->one);
}

static uint64_t hash_of(ascc_mpi_particles *set)
{
    uint64_t hash = 0;
    need(ascc_mpi_particles_hash(set, &hash), "hash", "");
    return hash;
}

/* ---- Files, on process 0 ---- */

static unsigned char *read_file(const char *path, size_t *bytes)
{
    FILE *file = fopen(path, "rb");
    struct stat about;
    if (!file || stat(path, &about) != 0)
        MPI_Abort(MPI_COMM_WORLD, 1);
    *bytes = (size_t)about.st_size;
    unsigned char *read = malloc(*bytes + 1);
    if (!read || fread(read, 1, *bytes, file) != *bytes)
        MPI_Abort(MPI_COMM_WORLD, 1);
    (void)fclose(file);
    return read;
}

static void write_file(const char *path, const unsigned char *bytes, size_t count)
{
    FILE *file = fopen(path, "wb");
    if (!file || fwrite(bytes, 1, count, file) != count || fclose(file) != 0)
        MPI_Abort(MPI_COMM_WORLD, 1);
}

/* Whether the file has the snapshot's bytes of an ordinary set. */
static bool has_snapshot(const char *path, const ascc_particles *one)
{
    if (rank != 0)
        return true;
    size_t bytes;
    unsigned char *found = read_file(path, &bytes), *wanted = malloc(bytes);
    const bool same = wanted && ascc_particles_snapshot_size(one) == bytes &&
                      ascc_particles_snapshot(one, wanted, bytes) == ASCC_OK &&
                      memcmp(found, wanted, bytes) == 0;
    free(found);
    free(wanted);
    return same;
}

/* ---- Facts ---- */

static void the_file_has_the_bytes_of_one_process(fixture *f, const char *path)
{
    need(ascc_mpi_particles_save(f->set, path), "save", ascc_mpi_particles_message(f->set));
    tell(has_snapshot(path, f->one), "the file has the bytes of one process's snapshot");
}

static void what_was_loaded_goes_on_with_the_same_ids(fixture *f, const char *path)
{
    ascc_mpi_particles *other = make_spread(f->context);
    const double at[3] = {0.5, 0.5, 0.5};
    const ascc_const_array row = {.data = at, .scalar = ASCC_DOUBLE};
    need(ascc_mpi_particles_load(other, path), "load", ascc_mpi_particles_message(other));
    tell(hash_of(other) == hash_of(f->set), "the set that was loaded has the same hash");
    need(ascc_mpi_particles_add_fluid(other, rank == processes - 1, &row, NULL, NULL, NULL), "add",
         "");
    if (rank == 0)
        need(ascc_particles_add_fluid(f->one, 1, &row, NULL, NULL, NULL), "add", "");
    need(ascc_mpi_particles_save(other, path), "save", ascc_mpi_particles_message(other));
    tell(has_snapshot(path, f->one), "and gives out the ids that one process does");
    ascc_mpi_particles_destroy(&other);
}

/* Status and words of the message are the same everywhere, and nothing has changed. */
static void refuses(fixture *f, const char *path, ascc_status wanted, const char *words,
                    const char *what)
{
    const uint64_t before = hash_of(f->set);
    const ascc_status status = ascc_mpi_particles_load(f->set, path);
    const char *message = ascc_mpi_particles_message(f->set);
    const bool good = status == wanted && strstr(message, words) != NULL;
    if (!good)
        (void)fprintf(stderr, "# rank %d: %s: %s\n", rank, ascc_status_text(status), message);
    tell(good && hash_of(f->set) == before, "%s is refused everywhere, and changes nothing", what);
}

static uint64_t word_at(const unsigned char *bytes)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++)
        word |= (uint64_t)bytes[i] << 8 * i;
    return word;
}

static void put_word(unsigned char *bytes, uint64_t word)
{
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)(word >> 8 * i);
}

static void put_checksum(unsigned char *bytes, size_t count)
{
    uint64_t sum = UINT64_C(0x50414e5343435341);
    for (size_t i = 0; i + 8 < count; i += 8) {
        sum = (sum ^ word_at(bytes + i)) * UINT64_C(0x9e3779b97f4a7c15);
        sum ^= sum >> 32;
    }
    put_word(bytes + count - 8, sum);
}

/* Ids of the last row of one process and of the first of the next, exchanged: each process alone sees nothing. */
static void swap_ids(unsigned char *bytes)
{
    const uint64_t fluid = word_at(bytes + 24);
    unsigned char *ids = bytes + 72 + fluid * 8 * (3 + 3 + 1), word[8];
    const uint64_t row = fluid / (uint64_t)processes;
    memcpy(word, ids + 8 * row, 8);
    memcpy(ids + 8 * row, ids + 8 * (row - 1), 8);
    memcpy(ids + 8 * (row - 1), word, 8);
}

static void what_is_no_snapshot_is_refused(fixture *f, const char *path)
{
    size_t count = 0;
    unsigned char *bytes = NULL;
    refuses(f, "/nonexistent/file", ASCC_ERROR_FILE, "/nonexistent/file",
            "a file that is not there");
    if (rank == 0) {
        bytes = read_file(path, &count);
        bytes[count / 2] ^= 1;
        write_file(path, bytes, count);
        bytes[count / 2] ^= 1;
    }
    refuses(f, path, ASCC_ERROR_FORMAT, "checksum", "a damaged file");
    if (rank == 0)
        write_file(path, bytes, count - 8);
    refuses(f, path, ASCC_ERROR_FORMAT, "size", "a short file");
    if (rank == 0) {
        put_word(bytes + 72 + 8 * 9, UINT64_C(0x7ff8000000000000));
        put_checksum(bytes, count);
        write_file(path, bytes, count);
    }
    refuses(f, path, ASCC_ERROR_FORMAT, "rank 0: position: row 3", "a position that is no number");
    if (rank == 0) {
        free(bytes);
        need(ascc_particles_snapshot_size(f->one) == count ? ASCC_OK : ASCC_ERROR_FORMAT, "size",
             "");
        bytes = malloc(count);
        need(ascc_particles_snapshot(f->one, bytes, count), "snapshot", "");
        swap_ids(bytes);
        put_checksum(bytes, count);
        write_file(path, bytes, count);
    }
    if (processes > 1)
        refuses(f, path, ASCC_ERROR_FORMAT, "ids", "a row with another's id");
    free(bytes);
}

/* Process 0 may write no more than a part of the file. */
static void a_full_disk_leaves_the_old_file(fixture *f, const char *path)
{
    struct rlimit limit, small;
    const uint64_t before = hash_of(f->set);
    if (rank == 0) {
        write_file(path, (const unsigned char *)"old", 3);
        (void)signal(SIGXFSZ, SIG_IGN);
        (void)getrlimit(RLIMIT_FSIZE, &limit);
        small = (struct rlimit){.rlim_cur = 1000000, .rlim_max = limit.rlim_max};
        (void)setrlimit(RLIMIT_FSIZE, &small);
    }
    const ascc_status status = ascc_mpi_particles_save(f->set, path);
    if (rank == 0)
        (void)setrlimit(RLIMIT_FSIZE, &limit);
    bool good = status == ASCC_ERROR_FILE &&
                strstr(ascc_mpi_particles_message(f->set), "rank 0: cannot write") != NULL;
    if (rank == 0) {
        size_t count;
        unsigned char *bytes = read_file(path, &count);
        good &= count == 3 && memcmp(bytes, "old", 3) == 0;
        free(bytes);
    }
    tell(good && hash_of(f->set) == before,
         "a full disk is an error everywhere, the old file stays");
}

/* Every allocation of the last process fails once. */
static void no_memory_on_one_process_is_an_error_on_all(const char *path)
{
    failing_allocator own = {0};
    const ascc_context_options options = {.size = sizeof options,
                                          .allocate = failing_allocate,
                                          .reallocate = failing_reallocate,
                                          .release = failing_release,
                                          .user = &own};
    ascc_context *context;
    need(ascc_context_create(&options, &context), "context", "");
    bool good = true;
    int done = 0, failures = 0;
    for (long n = 1; good && !done; n++) {
        fixture f = open_fixture(context, SMALL);
        const uint64_t before = hash_of(f.set);
        own.fail_at = rank == processes - 1 ? own.calls + n : 0;
        ascc_status status = ascc_mpi_particles_save(f.set, path);
        if (status == ASCC_OK)
            status = ascc_mpi_particles_load(f.set, path);
        own.fail_at = 0;
        good = (status == ASCC_OK || status == ASCC_ERROR_MEMORY) && hash_of(f.set) == before;
        failures += status != ASCC_OK;
        done = status == ASCC_OK;
        MPI_Bcast(&done, 1, MPI_INT, 0, MPI_COMM_WORLD);
        good &= done == (status == ASCC_OK);
        MPI_Allreduce(MPI_IN_PLACE, &good, 1, MPI_C_BOOL, MPI_LAND, MPI_COMM_WORLD);
        close_fixture(&f);
    }
    ascc_context_destroy(&context);
    tell(good && failures > 3 && own.blocks == 0,
         "no memory on one process is an error on all (%d times), nothing changes or leaks",
         failures);
}

int main(int argc, char **argv)
{
    char path[4096];
    ascc_context *context;
    open_world(&argc, &argv);
    (void)snprintf(path, sizeof path, "%s/snapshot", argc > 1 ? argv[1] : ".");
    need(ascc_context_create(NULL, &context), "context", "");
    fixture f = open_fixture(context, LARGE);
    the_file_has_the_bytes_of_one_process(&f, path);
    what_was_loaded_goes_on_with_the_same_ids(&f, path);
    what_is_no_snapshot_is_refused(&f, path);
    a_full_disk_leaves_the_old_file(&f, path);
    close_fixture(&f);
    ascc_context_destroy(&context);
    no_memory_on_one_process_is_an_error_on_all(path);
    return close_world();
}
