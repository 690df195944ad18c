/* Fuzzes a target where libFuzzer is not at hand: replays its corpus, then mutates it from a seed.
 * SPDX-License-Identifier: MIT
 *
 *   fuzz_TARGET [-max_total_time=SECONDS] [-runs=N] [-seed=N] [-dict=FILE] [-artifact_prefix=PREFIX]
 *               FILE OR FOLDER...
 *
 * Options are libFuzzer's. Input k of a seed is always the same bytes, so a worker process can be lost: its
 * parent makes the input again, keeps it as PREFIXcrash-SEED-K (or leak-, timeout-), and goes on behind it.
 */
#define _DEFAULT_SOURCE 1 /* MAP_ANONYMOUS */
#include <dirent.h>
#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

#include "fuzz.h"
#include "support/random.h"

enum {
    LONGEST = 1 << 16,  /* bytes of a mutated input */
    PATIENCE = 60,      /* seconds that one input may take */
    LEAK_BATCH = 256,   /* mutated inputs from one search for leaks to the next */
    MOST_FAILURES = 10, /* then there is no use in going on */
    STATUS_LEAK = 77,
};

/* Only there with AddressSanitizer. */
int __lsan_do_recoverable_leak_check(void) __attribute__((weak));

/* Undefined behaviour ends the worker, as every other fault does. */
const char *__ubsan_default_options(void);
const char *__ubsan_default_options(void)
{
    return "halt_on_error=1:print_stacktrace=1";
}

typedef struct bytes {
    uint8_t *data;
    size_t size;
} bytes;

typedef struct list {
    bytes *item;
    size_t count;
} list;

typedef struct fuzzing {
    list corpus, words;
    uint64_t seed, runs;
    double seconds;
    const char *prefix;
} fuzzing;

/* What a worker leaves to its parent. */
typedef struct progress {
    uint64_t at;      /* the input that runs */
    uint64_t checked; /* inputs before this one were not seen to leak at two searches */
    uint64_t last;    /* search */
} progress;

static void *make(size_t size)
{
    void *memory = malloc(size ? size : 1);
    fuzz_require(memory != NULL);
    return memory;
}

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* ---- Corpus and dictionary ---- */

static void append(list *to, const void *data, size_t size)
{
    to->item = realloc(to->item, (to->count + 1) * sizeof *to->item);
    fuzz_require(to->item != NULL);
    bytes *item = &to->item[to->count++];
    *item = (bytes){make(size), size};
    memcpy(item->data, data, size);
}

static void read_file(list *to, const char *path)
{
    static uint8_t data[1 << 20];
    FILE *file = fopen(path, "rb");
    if (!file) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        exit(2);
    }
    const size_t size = fread(data, 1, sizeof data, file);
    (void)fclose(file);
    append(to, data, size);
}

static int is_shown(const struct dirent *entry)
{
    return entry->d_name[0] != '.';
}

static void read_path(list *to, const char *path)
{
    struct stat about;
    struct dirent **entry;
    if (stat(path, &about) == 0 && !S_ISDIR(about.st_mode)) {
        read_file(to, path);
        return;
    }
    const int count = scandir(path, &entry, is_shown, alphasort);
    if (count < 0) {
        fprintf(stderr, "%s: %s\n", path, strerror(errno));
        exit(2);
    }
    for (int i = 0; i < count; i++) {
        char inner[1024];
        (void)snprintf(inner, sizeof inner, "%s/%s", path, entry[i]->d_name);
        read_path(to, inner);
        free(entry[i]);
    }
    free(entry);
}

/* Lines "word", with \\, \" and \xHH. */
static void read_words(list *to, const char *path)
{
    char line[512];
    FILE *file = fopen(path, "r");
    while (file && fgets(line, sizeof line, file)) {
        uint8_t word[512];
        size_t size = 0;
        if (line[0] != '"')
            continue;
        for (const char *c = line + 1; *c && *c != '"'; c++) {
            unsigned value = (unsigned char)*c;
            if (*c == '\\' && c[1] == 'x' && sscanf(c + 2, "%2x", &value) == 1)
                c += 3;
            else if (*c == '\\' && c[1])
                value = (unsigned char)*++c;
            word[size++] = (uint8_t)value;
        }
        append(to, word, size);
    }
    if (file)
        (void)fclose(file);
}

/* ---- Mutation ---- */

typedef struct mutation {
    const fuzzing *f;
    test_random random;
    uint8_t data[LONGEST];
    size_t size;
} mutation;

static size_t below(mutation *m, size_t limit)
{
    return limit ? (size_t)test_random_below(&m->random, limit) : 0;
}

/* Puts data in place of [at, at + old). */
static void replace(mutation *m, size_t at, size_t old, const void *data, size_t size)
{
    if (at > m->size || old > m->size - at || size > LONGEST - (m->size - old))
        return;
    memmove(m->data + at + size, m->data + at + old, m->size - at - old);
    memcpy(m->data + at, data, size);
    m->size += size - old;
}

static void flip_bit(mutation *m)
{
    if (m->size)
        m->data[below(m, m->size)] ^= (uint8_t)(1u << below(m, 8));
}

static void change_bytes(mutation *m)
{
    static const uint8_t telling[] = {0,   1,   0x7f, 0x80, 0xff, '"', '{',
                                      '[', ',', '-',  '9',  'e',  '.'};
    for (size_t n = 1 + below(m, 4); n && m->size; n--)
        m->data[below(m, m->size)] =
            below(m, 2) ? telling[below(m, sizeof telling)] : (uint8_t)below(m, 256);
}

static void remove_part(mutation *m)
{
    const size_t at = below(m, m->size), size = below(m, 64) + 1;
    replace(m, at, size < m->size - at ? size : m->size - at, "", 0);
}

static void repeat_part(mutation *m)
{
    uint8_t part[256];
    const size_t at = below(m, m->size), most = m->size - at;
    size_t size = below(m, sizeof part) + 1;
    size = size < most ? size : most;
    memcpy(part, m->data + at, size);
    for (size_t n = 1 + below(m, 3); n; n--)
        replace(m, below(m, m->size + 1), 0, part, size);
}

static void put_word(mutation *m)
{
    if (!m->f->words.count)
        return;
    const bytes *word = &m->f->words.item[below(m, m->f->words.count)];
    const size_t at = below(m, m->size + 1);
    replace(m, at, below(m, 2) && word->size <= m->size - at ? word->size : 0, word->data,
            word->size);
}

/* A number written in digits becomes another. */
static void put_number(mutation *m)
{
    static const char *const numbers[] = {"0",
                                          "1",
                                          "2",
                                          "-1",
                                          "3",
                                          "64",
                                          "1e308",
                                          "-0.0",
                                          "1e-320",
                                          "1e39",
                                          "2147483647",
                                          "2147483648",
                                          "4294967296",
                                          "9223372036854775807",
                                          "-1e9",
                                          "0.5",
                                          "1e400",
                                          "nan",
                                          "inf",
                                          "1e-9",
                                          "18446744073709551616"};
    size_t at = below(m, m->size), end;
    while (at < m->size && (m->data[at] < '0' || m->data[at] > '9'))
        at++;
    for (end = at; end < m->size && strchr("0123456789.eE", m->data[end]) && m->data[end];)
        end++;
    const char *number = numbers[below(m, sizeof numbers / sizeof *numbers)];
    if (end > at)
        replace(m, at, end - at, number, strlen(number));
}

/* Four or eight bytes become a telling float, double or integer. */
static void put_binary(mutation *m)
{
    static const double numbers[] = {0.0,    -0.0,    1.0,     -1.0,   0.5,     1e-3,
                                     1e3,    1e9,     1e20,    -1e20,  1e38,    -1e300,
                                     0x1p61, -0x1p61, 0x1p40,  1e-40,  2e-308,  1e308,
                                     0x1p53, 0x1p63,  -0x1p63, 5e-324, HUGE_VAL};
    static const uint64_t integers[] = {0,
                                        1,
                                        2,
                                        3,
                                        0x7fffffff,
                                        0x80000000,
                                        0xffffffff,
                                        (uint64_t)1 << 61,
                                        ((uint64_t)1 << 61) + 1,
                                        INT64_MAX,
                                        (uint64_t)INT64_MAX + 1,
                                        UINT64_MAX,
                                        0 - ((uint64_t)1 << 61)};
    uint8_t to[8];
    const double number = numbers[below(m, sizeof numbers / sizeof *numbers)];
    const float small = (float)number;
    const uint64_t integer = integers[below(m, sizeof integers / sizeof *integers)];
    const size_t size = below(m, 3) ? 8 : 4, step = below(m, 4) ? size : 1;
    if (below(m, 2))
        memcpy(to, &integer, 8);
    else if (size == 8)
        memcpy(to, &number, 8);
    else
        memcpy(to, &small, 4);
    if (m->size < size + 1)
        return;
    const size_t at = 1 + below(m, (m->size - 1) / step) * step;
    if (at + size <= m->size)
        memcpy(m->data + at, to, size);
}

/* The end of another input behind the beginning of this. */
static void splice(mutation *m)
{
    const bytes *other = &m->f->corpus.item[below(m, m->f->corpus.count)];
    const size_t at = below(m, m->size + 1), from = below(m, other->size + 1);
    replace(m, at, m->size - at, other->data + from, other->size - from);
}

/* Input k: first the corpus as it is, then what becomes of it. The caller's to free. */
static bytes input_of(const fuzzing *f, uint64_t k)
{
    static void (*const ways[])(mutation *) = {flip_bit,   change_bytes, remove_part, repeat_part,
                                               put_word,   put_word,     put_number,  put_number,
                                               put_binary, put_binary,   splice};
    static mutation m;
    bytes input;
    if (k < f->corpus.count) {
        input = (bytes){make(f->corpus.item[k].size), f->corpus.item[k].size};
        memcpy(input.data, f->corpus.item[k].data, input.size);
        return input;
    }
    m.f = f;
    m.random.state = f->seed * UINT64_C(0x9e3779b97f4a7c15) + k;
    (void)test_random_bits(&m.random);
    const bytes *from = &f->corpus.item[below(&m, f->corpus.count)];
    m.size = from->size < LONGEST ? from->size : LONGEST;
    memcpy(m.data, from->data, m.size);
    for (size_t n = 1 + below(&m, 1 + below(&m, 8)); n; n--)
        ways[below(&m, sizeof ways / sizeof *ways)](&m);
    input = (bytes){make(m.size), m.size}; /* exact, so that reads beyond the end are seen */
    memcpy(input.data, m.data, m.size);
    return input;
}

/* ---- Running ---- */

/* What earlier calls left on the stack may point to what they have lost. */
static __attribute__((noinline)) void wipe_stack(void)
{
    volatile uint8_t wiped[1 << 16];
    for (size_t i = 0; i < sizeof wiped; i++)
        wiped[i] = 0;
}

static bool leaks(void)
{
    wipe_stack();
    return __lsan_do_recoverable_leak_check && __lsan_do_recoverable_leak_check() != 0;
}

static bool over(const fuzzing *f, uint64_t k, double begin)
{
    return k >= f->corpus.count && (k - f->corpus.count >= f->runs || now() - begin >= f->seconds);
}

static void run_input(const fuzzing *f, uint64_t k)
{
    bytes input = input_of(f, k);
    (void)alarm(PATIENCE);
    (void)LLVMFuzzerTestOneInput(input.data, input.size);
    (void)alarm(0);
    free(input.data);
}

/* In a process of its own, from input `first` until the time is over, or up to `until` if that is not 0. Leaks
 * are looked for now and then, or at the end. */
static void work(const fuzzing *f, progress *p, uint64_t first, uint64_t until, double begin)
{
    for (uint64_t k = first; until ? k < until : !over(f, k, begin); k++) {
        p->at = k;
        run_input(f, k);
        if (!until && (k < f->corpus.count || k % LEAK_BATCH == 0)) {
            if (leaks())
                _exit(STATUS_LEAK);
            p->checked = p->last;
            p->last = k + 1;
        }
    }
    for (int n = 0; until && n < 32; n++)
        run_input(f, 0); /* so that nothing points to what is lost any more */
    p->at++;
    _exit(leaks() ? STATUS_LEAK : 0);
}

/* Returns the worker's end as of waitpid. */
static int run_worker(const fuzzing *f, progress *p, uint64_t first, uint64_t until, double begin)
{
    int status = 0;
    (void)fflush(NULL);
    const pid_t child = fork();
    fuzz_require(child >= 0);
    if (child == 0)
        work(f, p, first, until, begin);
    while (waitpid(child, &status, 0) < 0)
        fuzz_require(errno == EINTR);
    return status;
}

static void keep(const fuzzing *f, uint64_t k, const char *kind)
{
    char path[1024];
    bytes input = input_of(f, k);
    (void)snprintf(path, sizeof path, "%s%s-%" PRIu64 "-%" PRIu64, f->prefix, kind, f->seed, k);
    FILE *file = fopen(path, "wb");
    const bool kept = file && fwrite(input.data, 1, input.size, file) == input.size;
    if (file)
        (void)fclose(file);
    fprintf(stderr, "%s: input %" PRIu64 " of seed %" PRIu64 " %s %s\n", kind, k, f->seed,
            kept ? "kept as" : "could not be kept as", path);
    free(input.data);
}

static bool is_leak(int status)
{
    return WIFEXITED(status) && WEXITSTATUS(status) == STATUS_LEAK;
}

/* The input of [first, until) that leaks, by halving; the last one if none does alone. */
static uint64_t find_leak(const fuzzing *f, progress *p, uint64_t first, uint64_t until)
{
    while (until - first > 1) {
        const uint64_t middle = first + (until - first) / 2;
        if (is_leak(run_worker(f, p, first, middle, 0.0)))
            until = middle;
        else
            first = middle;
    }
    return first;
}

/* Failures. */
static int fuzz(const fuzzing *f, progress *p)
{
    const double begin = now();
    int failures = 0;
    for (uint64_t next = 0; failures < MOST_FAILURES;) {
        p->checked = p->last = next;
        const int status = run_worker(f, p, next, 0, begin);
        if (status == 0)
            break;
        const char *kind = WIFSIGNALED(status) && WTERMSIG(status) == SIGALRM ? "timeout" : "crash";
        uint64_t at = p->at;
        next = at + 1;
        if (is_leak(status)) {
            kind = "leak";
            at = find_leak(f, p, p->checked, next);
        }
        keep(f, at, kind);
        failures++;
    }
    return failures;
}

static bool option(const char *argument, const char *name, const char **value)
{
    const size_t length = strlen(name);
    *value = argument + length;
    return strncmp(argument, name, length) == 0;
}

int main(int argc, char **argv)
{
    fuzzing f = {.seed = 1, .runs = UINT64_MAX, .prefix = ""};
    const char *value;
    for (int i = 1; i < argc; i++) {
        if (option(argv[i], "-max_total_time=", &value))
            f.seconds = strtod(value, NULL);
        else if (option(argv[i], "-runs=", &value))
            f.runs = strtoull(value, NULL, 10);
        else if (option(argv[i], "-seed=", &value))
            f.seed = strtoull(value, NULL, 10);
        else if (option(argv[i], "-dict=", &value))
            read_words(&f.words, value);
        else if (option(argv[i], "-artifact_prefix=", &value))
            f.prefix = value;
        else if (argv[i][0] != '-')
            read_path(&f.corpus, argv[i]);
    }
    if (!f.corpus.count) {
        fprintf(stderr, "%s: FILES or FOLDERS of inputs are wanted\n", argv[0]);
        return 2;
    }
    progress *p = mmap(NULL, sizeof *p, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    fuzz_require(p != MAP_FAILED);
    (void)fuzz_folder(); /* one for all workers: a lost one leaves nothing behind */
    const int failures = fuzz(&f, p);
    printf("%s: %zu inputs of the corpus, %" PRIu64 " in all, seed %" PRIu64 ": %d failures\n",
           argv[0], f.corpus.count, p->at, f.seed, failures);
    for (size_t i = 0; i < f.corpus.count; i++)
        free(f.corpus.item[i].data);
    for (size_t i = 0; i < f.words.count; i++)
        free(f.words.item[i].data);
    free(f.corpus.item);
    free(f.words.item);
    return failures != 0;
}
