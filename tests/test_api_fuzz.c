/* Random calls of the public API, right and wrong, beside a plain list of what the set must hold.
 * SPDX-License-Identifier: MIT
 *
 * A call that fails changes nothing and says why; counts, ids, fields follow the list; momentum is exact; twins
 * made by snapshot, by another order of rows, and with other numbers of threads have equal hashes; memory that
 * is not there is an error. A failure prints its seed; ASCC_TEST_SEED=N runs that sequence alone.
 */
#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/counting.h"
#include "support/model_builder.h"
#include "support/random.h"
#include "support/test.h"

#if defined(__SANITIZE_ADDRESS__)
#define SEQUENCES 500
#else
#define SEQUENCES 10000
#endif

enum { MOST = 96, CALLS = 30, MODELS = 4, SIZES = 3, MOST_BODIES = 4 };

static const double spacing = 0.05;

/* ---- What all sequences share ---- */

static const int32_t thread_counts[SIZES] = {1, 2, 7};
static ascc_context *contexts[SIZES];
static ascc_model *models[2][MODELS]; /* [dimension - 2] */

static int open_all(void **state)
{
    static const model_random kinds[MODELS] = {
        {.seed = 1, .levels = 2, .channels = 4, .cells = 2, .output_cells = 2},
        {.seed = 2,
         .channels = 4,
         .bumps = 2,
         .order = 1,
         .levels = 2,
         .transfer = 1,
         .method = "voxel_corners",
         .no_hysteresis = 1},
        {.seed = 3,
         .channels = 4,
         .bumps = 2,
         .order = 1,
         .fluid_only = 1,
         .motion = 1,
         .damping = 1,
         .walls = 1,
         .limit = 0.5,
         .contact = 0.4},
        {.seed = 4, .channels = 4, .cells = 2, .output_cells = 2, .plain = 1}};
    (void)state;
    for (int i = 0; i < SIZES; i++) {
        const ascc_context_options options = {.size = sizeof options,
                                              .thread_count = thread_counts[i]};
        assert_int_equal(ascc_context_create(&options, &contexts[i]), ASCC_OK);
    }
    for (int d = 2; d <= 3; d++)
        for (int k = 0; k < MODELS; k++) {
            model_random kind = kinds[k];
            size_t size;
            kind.dimension = d;
            unsigned char *bytes = model_builder_random(&kind, &size);
            assert_int_equal(ascc_model_load_memory(contexts[0], bytes, size, &models[d - 2][k]),
                             ASCC_OK);
            free(bytes);
        }
    return 0;
}

static int close_all(void **state)
{
    (void)state;
    for (int i = 0; i < SIZES; i++)
        ascc_context_destroy(&contexts[i]);
    for (int d = 0; d < 2; d++)
        for (int k = 0; k < MODELS; k++)
            ascc_model_destroy(&models[d][k]);
    return 0;
}

/* ---- One sequence ---- */

typedef struct shadow_row {
    uint64_t id;
    double position[3], mass, detail, normal[3];
    int32_t body;
} shadow_row;

typedef struct sequence {
    test_random random;
    uint64_t seed;
    int call;
    int32_t d;
    size_t width;
    int kind; /* of the model */
    test_memory memory;
    ascc_context *context;
    ascc_particles *particles;
    ascc_step *step;
    shadow_row row[2][MOST]; /* by ascc_kind */
    size_t count[2];
    uint64_t last_id;
    int32_t body[MOST_BODIES]; /* that have a frame */
    size_t body_count;
    int32_t last_body; /* the highest number so far */
} sequence;

#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition))                                                                          \
            fail_msg("seed %" PRIu64 ", call %d: does not hold: %s; last message '%s' '%s'",       \
                     s->seed, s->call, #condition, ascc_particles_message(s->particles),           \
                     ascc_step_message(s->step));                                                  \
    } while (0)

static size_t below(sequence *s, size_t limit)
{
    return (size_t)test_random_below(&s->random, limit);
}

static bool once_in(sequence *s, size_t times)
{
    return below(s, times) == 0;
}

static double between(sequence *s, double low, double high)
{
    return test_random_between(&s->random, low, high);
}

/* Refused with this status, for a reason, and the set is what it was. */
static void check_refused(sequence *s, ascc_status status, ascc_status wanted, uint64_t before)
{
    CHECK(status == wanted);
    CHECK(ascc_particles_message(s->particles)[0] != '\0');
    CHECK(ascc_particles_hash(s->particles) == before);
}

/* ---- The host's arrays ---- */

/* Numbers [rows][components] in one of the layouts that a host may have. */
typedef struct host_array {
    unsigned char bytes[MOST * 64];
    ascc_const_array from;
    ascc_array to;
} host_array;

static void lay_out(sequence *s, host_array *h, size_t rows, size_t components)
{
    const ascc_scalar scalar = once_in(s, 2) ? ASCC_FLOAT : ASCC_DOUBLE;
    const ptrdiff_t size = scalar == ASCC_FLOAT ? 4 : 8;
    ptrdiff_t stride = 0, component_stride = 0;
    switch (below(s, 3)) {
    case 0:
        break;
    case 1: /* a struct of more than this */
        stride = size * (ptrdiff_t)components + (ptrdiff_t)below(s, 4) * 4;
        component_stride = 0;
        break;
    default: /* each component apart */
        stride = size;
        component_stride = size * (ptrdiff_t)(rows + 1);
        break;
    }
    memset(h->bytes, 0xa5, sizeof h->bytes);
    h->from = (ascc_const_array){
        .data = h->bytes, .stride = stride, .component_stride = component_stride, .scalar = scalar};
    h->to = (ascc_array){
        .data = h->bytes, .stride = stride, .component_stride = component_stride, .scalar = scalar};
}

static unsigned char *place_of(host_array *h, size_t row, size_t c, size_t components)
{
    const ptrdiff_t size = h->from.scalar == ASCC_FLOAT ? 4 : 8;
    const ptrdiff_t across = h->from.component_stride ? h->from.component_stride : size;
    const ptrdiff_t down = h->from.stride ? h->from.stride : size * (ptrdiff_t)components;
    return h->bytes + (ptrdiff_t)row * down + (ptrdiff_t)c * across;
}

/* Writes a number and returns what the array then holds. */
static double put(host_array *h, size_t row, size_t c, size_t components, double value)
{
    unsigned char *at = place_of(h, row, c, components);
    if (h->from.scalar == ASCC_DOUBLE) {
        memcpy(at, &value, sizeof value);
        return value;
    }
    const float narrow = (float)value;
    memcpy(at, &narrow, sizeof narrow);
    return (double)narrow;
}

static double take(host_array *h, size_t row, size_t c, size_t components)
{
    const unsigned char *at = place_of(h, row, c, components);
    double value;
    float narrow;
    memcpy(&narrow, at, sizeof narrow);
    if (h->from.scalar == ASCC_FLOAT)
        return (double)narrow;
    memcpy(&value, at, sizeof value);
    return value;
}

/* ---- Values ---- */

static double some_position(sequence *s)
{
    if (once_in(s, 300))
        return between(s, -1.0, 1.0) * pow(10.0, between(s, 0.0, 9.0));
    return between(s, 0.0, 6.0) * spacing;
}

static double some_velocity(sequence *s)
{
    return between(s, -1.0, 1.0) * (once_in(s, 200) ? 1e5 : 1.0);
}

static double some_mass(sequence *s)
{
    return once_in(s, 3) ? between(s, 0.05, 0.5) : 0.125;
}

static double bad_number(sequence *s)
{
    return once_in(s, 2) ? (double)NAN : (once_in(s, 2) ? (double)INFINITY : -(double)INFINITY);
}

/* ---- Calls ---- */

static void add_fluid(sequence *s)
{
    const size_t n = below(s, 13), first = s->count[ASCC_FLUID], d = s->width;
    static host_array x, v, m;
    uint64_t ids[16];
    if (first + n > MOST)
        return;
    lay_out(s, &x, n, d);
    lay_out(s, &v, n, d);
    lay_out(s, &m, n, 1);
    const bool velocity = once_in(s, 2), mass = once_in(s, 2);
    for (size_t i = 0; i < n; i++) {
        shadow_row *row = &s->row[ASCC_FLUID][first + i];
        for (size_t c = 0; c < d; c++) {
            row->position[c] = put(&x, i, c, d, some_position(s));
            (void)put(&v, i, c, d, some_velocity(s));
        }
        row->mass = mass ? put(&m, i, 0, 1, some_mass(s)) : 0.125;
        row->detail = 0.0;
    }
    if (n > 1 && once_in(s, 8)) /* two at one place */
        for (size_t c = 0; c < d; c++)
            s->row[ASCC_FLUID][first + 1].position[c] =
                put(&x, 1, c, d, s->row[ASCC_FLUID][first].position[c]);
    CHECK(ascc_particles_add_fluid(s->particles, n, &x.from, velocity ? &v.from : NULL,
                                   mass ? &m.from : NULL, ids) == ASCC_OK);
    for (size_t i = 0; i < n; i++) {
        CHECK(ids[i] > s->last_id);
        s->row[ASCC_FLUID][first + i].id = s->last_id = ids[i];
    }
    s->count[ASCC_FLUID] += n;
}

static void add_bad_fluid(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    const size_t n = 1 + below(s, 5), d = s->width;
    static host_array x, v, m;
    ascc_status wanted = ASCC_ERROR_ARGUMENT;
    uint64_t ids[8];
    lay_out(s, &x, n, d);
    lay_out(s, &v, n, d);
    lay_out(s, &m, n, 1);
    for (size_t i = 0; i < n; i++) {
        for (size_t c = 0; c < d; c++) {
            (void)put(&x, i, c, d, some_position(s));
            (void)put(&v, i, c, d, 0.0);
        }
        (void)put(&m, i, 0, 1, 0.125);
    }
    ascc_const_array position = x.from;
    const size_t bad = below(s, n);
    switch (below(s, 9)) {
    case 0:
        (void)put(&x, bad, below(s, d), d, bad_number(s));
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    case 1:
        (void)put(&x, bad, below(s, d), d, once_in(s, 2) ? 1e30 : -1e30);
        wanted = ASCC_ERROR_RANGE;
        break;
    case 2:
        (void)put(&v, bad, below(s, d), d, bad_number(s));
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    case 3:
        (void)put(&v, bad, below(s, d), d, once_in(s, 2) ? 1e30 : -1e30);
        wanted = ASCC_ERROR_RANGE;
        break;
    case 4:
        (void)put(&m, bad, 0, 1, once_in(s, 2) ? 0.0 : -1.0);
        break;
    case 5:
        (void)put(&m, bad, 0, 1, bad_number(s));
        wanted = ASCC_OK; /* ARGUMENT or NOT_FINITE */
        break;
    case 6:
        position.data = NULL;
        break;
    case 7:
        position.scalar = (ascc_scalar)7;
        break;
    default:
        position.reserved = 1;
        break;
    }
    const ascc_status status =
        ascc_particles_add_fluid(s->particles, n, &position, &v.from, &m.from, ids);
    if (wanted == ASCC_OK)
        CHECK(status == ASCC_ERROR_ARGUMENT || status == ASCC_ERROR_NOT_FINITE);
    check_refused(s, status, wanted == ASCC_OK ? status : wanted, before);
}

static bool has_frame(const sequence *s, int32_t body)
{
    for (size_t b = 0; b < s->body_count; b++)
        if (s->body[b] == body)
            return true;
    return false;
}

static void add_boundary(sequence *s)
{
    const size_t n = below(s, 9), first = s->count[ASCC_BOUNDARY], d = s->width;
    static host_array x, v;
    uint64_t ids[16];
    const int32_t body = (int32_t)below(s, 3);
    if (first + n > MOST)
        return;
    lay_out(s, &x, n, d);
    lay_out(s, &v, n, d);
    if (has_frame(s, body)) {
        const uint64_t before = ascc_particles_hash(s->particles);
        check_refused(s, ascc_particles_add_boundary(s->particles, n, &x.from, &v.from, body, ids),
                      ASCC_ERROR_ARGUMENT, before);
        return;
    }
    s->last_body = n > 0 && body > s->last_body ? body : s->last_body;
    for (size_t i = 0; i < n; i++) {
        shadow_row *row = &s->row[ASCC_BOUNDARY][first + i];
        const size_t axis = below(s, d);
        for (size_t c = 0; c < d; c++) {
            row->position[c] = put(&x, i, c, d, c == axis ? 0.0 : some_position(s));
            row->normal[c] = put(&v, i, c, d, c == axis ? 1.0 : 0.0);
        }
        row->body = body;
    }
    CHECK(ascc_particles_add_boundary(s->particles, n, &x.from, &v.from, body, ids) == ASCC_OK);
    for (size_t i = 0; i < n; i++) {
        CHECK(ids[i] > s->last_id);
        s->row[ASCC_BOUNDARY][first + i].id = s->last_id = ids[i];
    }
    s->count[ASCC_BOUNDARY] += n;
}

static void add_bad_boundary(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    double x[3] = {0.0, 0.0, 0.0}, n[3] = {1.0, 0.0, 0.0};
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array normal = {.data = n, .scalar = ASCC_DOUBLE}, none = {0};
    int32_t body = s->last_body + 1;
    const ascc_const_array *given = &normal;
    ascc_status wanted = ASCC_ERROR_ARGUMENT;
    switch (below(s, 5)) {
    case 0:
        body = -1;
        break;
    case 1:
        n[0] = 1.1;
        break;
    case 2:
        n[1] = bad_number(s);
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    case 3:
        x[1] = bad_number(s);
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    default:
        given = once_in(s, 2) ? &none : NULL;
        break;
    }
    check_refused(s, ascc_particles_add_boundary(s->particles, 1, &position, given, body, NULL),
                  wanted, before);
}

static void drop_row(sequence *s, int kind, size_t row)
{
    memmove(&s->row[kind][row], &s->row[kind][row + 1],
            (s->count[kind] - row - 1) * sizeof s->row[kind][0]);
    s->count[kind]--;
}

static void remove_some(sequence *s)
{
    uint64_t ids[8] = {0};
    size_t n = 0;
    for (size_t tries = below(s, 7); tries; tries--) {
        const int kind = (int)below(s, 2);
        if (!s->count[kind])
            continue;
        const size_t row = below(s, s->count[kind]);
        ids[n++] = s->row[kind][row].id;
        drop_row(s, kind, row);
    }
    CHECK(ascc_particles_remove(s->particles, n, ids) == ASCC_OK);
    for (size_t i = 0; i < n; i++)
        CHECK(ascc_particles_find(s->particles, ids[i], NULL, NULL) == ASCC_ERROR_ARGUMENT);
}

static void remove_wrongly(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    const int kind = (int)below(s, 2);
    if (!s->count[kind])
        return;
    const uint64_t good = s->row[kind][below(s, s->count[kind])].id;
    const uint64_t ids[2] = {good, once_in(s, 2) ? good : once_in(s, 2) ? 0 : s->last_id + 1};
    check_refused(s, ascc_particles_remove(s->particles, 2, ids), ASCC_ERROR_ARGUMENT, before);
}

/* Where points of bodies are is the library's to say: tests/test_bodies.c holds it against an oracle. */
static void follow_bodies(sequence *s)
{
    for (size_t i = 0; i < s->count[ASCC_BOUNDARY]; i++) {
        shadow_row *row = &s->row[ASCC_BOUNDARY][i];
        const ascc_array x = {.data = row->position, .scalar = ASCC_DOUBLE};
        const ascc_array n = {.data = row->normal, .scalar = ASCC_DOUBLE};
        if (!has_frame(s, row->body))
            continue;
        CHECK(ascc_particles_get(s->particles, ASCC_BOUNDARY, ASCC_POSITION, i, 1, &x) == ASCC_OK);
        CHECK(ascc_particles_get(s->particles, ASCC_BOUNDARY, ASCC_NORMAL, i, 1, &n) == ASCC_OK);
    }
}

static ascc_pose some_pose(sequence *s)
{
    ascc_pose pose = {.size = sizeof pose, .jump = once_in(s, 2) ? (double)INFINITY : 10 * spacing};
    const bool moves = once_in(s, 2);
    for (size_t c = 0; c < s->width; c++) {
        pose.position[c] = some_position(s);
        pose.velocity[c] = moves ? 0.3 * some_velocity(s) : 0.0;
    }
    if (s->d == 2) {
        pose.angle = between(s, -10.0, 10.0);
        pose.spin[2] = moves ? between(s, -9.0, 9.0) : 0.0;
        return pose;
    }
    double square = 0.0;
    for (int c = 0; c < 4; c++) {
        pose.rotation[c] = between(s, -1.0, 1.0) + (c == 3 ? 2.0 : 0.0);
        square += pose.rotation[c] * pose.rotation[c];
    }
    for (int c = 0; c < 4; c++)
        pose.rotation[c] /= sqrt(square);
    for (int c = 0; c < 3; c++)
        pose.spin[c] = moves ? between(s, -9.0, 9.0) : 0.0;
    return pose;
}

static void add_body(sequence *s)
{
    static const double half = 0.8 * spacing;
    const ascc_shape shape = {.size = sizeof shape,
                              .kind = (ascc_shape_kind)(1 + below(s, 5)),
                              .water = (ascc_water)below(s, 2),
                              .half = {half, half, half},
                              .radius = half,
                              .pitch = 1.6 * spacing};
    const ascc_pose pose = some_pose(s);
    const size_t first = s->count[ASCC_BOUNDARY];
    int32_t body;
    ascc_body_info info = {.size = sizeof info};
    if (s->body_count == MOST_BODIES || first + 40 > MOST)
        return;
    CHECK(ascc_body_add(s->particles, &shape, once_in(s, 4) ? NULL : &pose, &body) == ASCC_OK);
    CHECK(body == s->last_body + 1);
    CHECK(ascc_body_get(s->particles, body, &info) == ASCC_OK);
    CHECK(info.first == first && info.count > 0 && first + info.count <= MOST);
    for (size_t i = first; i < first + info.count; i++) {
        uint64_t id;
        CHECK(ascc_particles_get_ids(s->particles, ASCC_BOUNDARY, i, 1, &id) == ASCC_OK);
        CHECK(id > s->last_id);
        s->row[ASCC_BOUNDARY][i] = (shadow_row){.id = s->last_id = id, .body = body};
    }
    s->count[ASCC_BOUNDARY] += info.count;
    s->body[s->body_count++] = s->last_body = body;
    follow_bodies(s);
}

static void move_body(sequence *s)
{
    const ascc_pose pose = some_pose(s);
    const uint64_t before = ascc_particles_hash(s->particles);
    if (!s->body_count)
        return;
    const ascc_status status =
        ascc_body_move(s->particles, s->body[below(s, s->body_count)], &pose);
    if (status != ASCC_OK) /* only a jump */
        check_refused(s, status, ASCC_ERROR_RANGE, before);
    CHECK(status == ASCC_OK || isfinite(pose.jump));
    follow_bodies(s);
}

static void move_wrongly(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    ascc_pose pose = some_pose(s);
    ascc_status wanted = ASCC_ERROR_ARGUMENT;
    int32_t body = s->body_count ? s->body[0] : 0, bodies[2] = {body, s->last_body + 1};
    int64_t impulse[2][3];
    CHECK(ascc_bodies_impulse(s->particles, 2, bodies, impulse, NULL) == ASCC_ERROR_ARGUMENT);
    switch (s->body_count ? below(s, 5) : 0) {
    case 0:
        body = once_in(s, 2) ? s->last_body + 1 : -1;
        break;
    case 1:
        pose.position[below(s, s->width)] = bad_number(s);
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    case 2:
        pose.spin[2] = bad_number(s);
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    case 3:
        pose.rotation[0] += 3.0;
        break;
    default:
        pose.jump = -1.0;
        break;
    }
    check_refused(s, ascc_body_move(s->particles, body, &pose), wanted, before);
}

static void remove_body(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    check_refused(s, ascc_body_remove(s->particles, s->last_body + 1), ASCC_ERROR_ARGUMENT, before);
    if (!s->body_count)
        return;
    const size_t which = below(s, s->body_count);
    const int32_t body = s->body[which];
    CHECK(ascc_body_remove(s->particles, body) == ASCC_OK);
    for (size_t i = s->count[ASCC_BOUNDARY]; i; i--)
        if (s->row[ASCC_BOUNDARY][i - 1].body == body)
            drop_row(s, ASCC_BOUNDARY, i - 1);
    memmove(s->body + which, s->body + which + 1, (s->body_count - which - 1) * sizeof *s->body);
    s->body_count--;
}

static void check_bodies(sequence *s)
{
    int32_t bodies[MOST_BODIES + 1];
    CHECK(ascc_bodies_list(s->particles, MOST_BODIES + 1, bodies) == s->body_count);
    for (size_t b = 0; b < s->body_count; b++) {
        ascc_body_info info = {.size = sizeof info};
        size_t count = 0;
        CHECK(bodies[b] == s->body[b]);
        CHECK(ascc_body_get(s->particles, bodies[b], &info) == ASCC_OK);
        for (size_t i = 0; i < s->count[ASCC_BOUNDARY]; i++)
            if (s->row[ASCC_BOUNDARY][i].body == bodies[b]) {
                CHECK(i >= info.first);
                count++;
            }
        CHECK(info.count == count);
    }
}

static void resize(sequence *s)
{
    const size_t before = s->count[ASCC_FLUID], wanted = below(s, before + 6);
    if (wanted > MOST)
        return;
    CHECK(ascc_particles_resize_fluid(s->particles, wanted) == ASCC_OK);
    for (size_t i = before; i < wanted; i++) {
        uint64_t id;
        CHECK(ascc_particles_get_ids(s->particles, ASCC_FLUID, i, 1, &id) == ASCC_OK);
        CHECK(id > s->last_id);
        s->row[ASCC_FLUID][i] = (shadow_row){.id = s->last_id = id, .mass = 0.125};
    }
    s->count[ASCC_FLUID] = wanted;
}

static void clear_one(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    check_refused(s, ascc_particles_clear(s->particles, (ascc_kind)5), ASCC_ERROR_ARGUMENT, before);
    const int kind = (int)below(s, 2);
    CHECK(ascc_particles_clear(s->particles, (ascc_kind)kind) == ASCC_OK);
    s->count[kind] = 0;
    if (kind == ASCC_BOUNDARY)
        s->body_count = 0;
}

static void set_some(sequence *s)
{
    static host_array h;
    const size_t count = s->count[ASCC_FLUID], first = below(s, count + 1);
    const size_t n = below(s, count - first + 1), d = s->width;
    static const ascc_field fields[] = {ASCC_POSITION, ASCC_VELOCITY, ASCC_MASS, ASCC_DETAIL};
    const ascc_field field = fields[below(s, 4)];
    const size_t components = field == ASCC_MASS || field == ASCC_DETAIL ? 1 : d;
    lay_out(s, &h, n, components);
    for (size_t i = 0; i < n; i++) {
        shadow_row *row = &s->row[ASCC_FLUID][first + i];
        for (size_t c = 0; c < components; c++)
            if (field == ASCC_POSITION)
                row->position[c] = put(&h, i, c, components, some_position(s));
            else if (field == ASCC_VELOCITY)
                (void)put(&h, i, c, components, some_velocity(s));
            else if (field == ASCC_MASS)
                row->mass = put(&h, i, c, components, some_mass(s));
            else
                row->detail = put(&h, i, c, components, between(s, 0.0, 1.0));
    }
    CHECK(ascc_particles_set(s->particles, ASCC_FLUID, field, first, n, &h.from) == ASCC_OK);
}

static void set_wrongly(sequence *s)
{
    static host_array h;
    const uint64_t before = ascc_particles_hash(s->particles);
    const size_t count = s->count[ASCC_FLUID], d = s->width;
    lay_out(s, &h, 4, d);
    for (size_t i = 0; i < 4; i++)
        for (size_t c = 0; c < d; c++)
            (void)put(&h, i, c, d, 1.0);
    ascc_kind kind = ASCC_FLUID;
    ascc_field field = ASCC_POSITION;
    size_t first = 0, n = count ? 1 : 0;
    ascc_status wanted = ASCC_ERROR_ARGUMENT;
    switch (below(s, 6)) {
    case 0:
        first = count;
        n = 1;
        break;
    case 1:
        first = SIZE_MAX;
        n = 2;
        break;
    case 2:
        field = (ascc_field)9;
        break;
    case 3:
        kind = ASCC_BOUNDARY;
        field = ASCC_MASS;
        n = 0;
        break;
    case 4:
        field = ASCC_NORMAL;
        break;
    default:
        if (!count)
            return;
        (void)put(&h, 0, below(s, d), d, bad_number(s));
        wanted = ASCC_ERROR_NOT_FINITE;
        break;
    }
    check_refused(s, ascc_particles_set(s->particles, kind, field, first, n, &h.from), wanted,
                  before);
}

static void restore_garbage(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    const size_t size = ascc_particles_snapshot_size(s->particles);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    CHECK(ascc_particles_snapshot(s->particles, bytes, size - 1) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_particles_snapshot(s->particles, bytes, size) == ASCC_OK);
    bytes[below(s, size)] ^= (unsigned char)(1u << below(s, 8));
    check_refused(s, ascc_particles_restore(s->particles, bytes, size), ASCC_ERROR_FORMAT, before);
    check_refused(s, ascc_particles_restore(s->particles, bytes, below(s, size)), ASCC_ERROR_FORMAT,
                  before);
    check_refused(s, ascc_particles_restore(s->particles, NULL, size), ASCC_ERROR_ARGUMENT, before);
    free(bytes);
}

static void ask_wrongly(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    uint64_t ids[2];
    int64_t momentum[3];
    ascc_step_options options = {.size = sizeof options, .time_step = -1.0};
    ascc_step *none = NULL;
    CHECK(ascc_particles_get_ids(s->particles, ASCC_FLUID, s->count[0] + 1, 0, ids) ==
          ASCC_ERROR_ARGUMENT);
    CHECK(ascc_particles_get_momentum(s->particles, s->count[0], 1, momentum) ==
          ASCC_ERROR_ARGUMENT);
    CHECK(ascc_particles_get_bodies(s->particles, SIZE_MAX, 2, NULL) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_particles_measure(s->particles, NULL) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_particles_find(s->particles, s->last_id + 7, NULL, NULL) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_create(s->context, models[s->d - 2][s->kind], &options, &none) ==
          ASCC_ERROR_ARGUMENT);
    CHECK(!none);
    options = (ascc_step_options){.size = 3};
    CHECK(ascc_step_create(s->context, models[s->d - 2][s->kind], &options, &none) ==
          ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_create(s->context, NULL, NULL, &none) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_run(s->step, s->particles, NULL, -1) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_run(s->step, NULL, NULL, 1) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_run(NULL, s->particles, NULL, 1) == ASCC_ERROR_ARGUMENT);
    CHECK(ascc_step_create(s->context, models[3 - s->d][s->kind], NULL, &none) == ASCC_OK);
    CHECK(ascc_step_run(none, s->particles, NULL, 1) == ASCC_ERROR_MISMATCH);
    ascc_step_destroy(&none);
    CHECK(ascc_particles_hash(s->particles) == before);
}

/* ---- Taps and drains ---- */

static ascc_tap some_tap(sequence *s)
{
    ascc_tap tap = {.size = sizeof tap,
                    .radius = once_in(s, 2) ? between(s, 0.0, 1.5) * spacing : 0.0,
                    .rate = once_in(s, 2) ? between(s, 0.0, 500.0) : 0.0,
                    .pitch = once_in(s, 3) ? between(s, 0.7, 2.0) * spacing : 0.0,
                    .clearance = once_in(s, 3) ? between(s, 0.1, 1.2) * spacing : 0.0,
                    .mass = once_in(s, 2) ? some_mass(s) : 0.0,
                    .owed = once_in(s, 2) ? between(s, 0.0, 3.0) : 0.0,
                    .emitted = below(s, 100)};
    for (size_t c = 0; c < 3; c++) {
        tap.position[c] = between(s, 0.0, 6.0) * spacing;
        tap.half[c] = between(s, 0.0, 0.7) * spacing;
        tap.velocity[c] = between(s, -1.0, 1.0);
    }
    return tap;
}

/* What comes out is as the tap says, and no nearer to what was there than its clearance. */
static void check_emitted(sequence *s, const ascc_tap *tap, size_t first, size_t count)
{
    const double clearance = tap->clearance > 0.0 ? tap->clearance : 0.9 * spacing;
    for (size_t i = first; i < first + count; i++) {
        shadow_row *row = &s->row[ASCC_FLUID][i];
        const ascc_array x = {.data = row->position, .scalar = ASCC_DOUBLE};
        row->mass = tap->mass > 0.0 ? tap->mass : 0.125;
        row->detail = 0.0;
        CHECK(ascc_particles_get(s->particles, ASCC_FLUID, ASCC_POSITION, i, 1, &x) == ASCC_OK);
        for (size_t j = 0; j < first; j++) {
            double square = 0.0;
            for (size_t c = 0; c < s->width; c++) {
                const double off = row->position[c] - s->row[ASCC_FLUID][j].position[c];
                square += off * off;
            }
            CHECK(square >= 0.999 * clearance * clearance);
        }
    }
}

static void run_tap(sequence *s)
{
    enum { ROOM = 12 };
    ascc_tap tap = some_tap(s);
    const ascc_tap began = tap;
    const size_t first = s->count[ASCC_FLUID], room = below(s, ROOM + 1);
    uint64_t ids[ROOM];
    size_t count = SIZE_MAX;
    if (first + ROOM > MOST)
        return;
    CHECK(ascc_tap_run(s->particles, &tap, between(s, 0.0, 0.02), room, ids, &count) == ASCC_OK);
    CHECK(count <= room && tap.emitted == began.emitted + count && tap.owed >= 0.0);
    for (size_t i = 0; i < count; i++) {
        CHECK(ids[i] > s->last_id);
        s->row[ASCC_FLUID][first + i] = (shadow_row){.id = s->last_id = ids[i]};
    }
    check_emitted(s, &tap, first, count);
    s->count[ASCC_FLUID] += count;
}

/* Says of a row what the header says of drains. */
static bool is_in_drain(const sequence *s, const ascc_drain *drain, const shadow_row *row)
{
    double square = 0.0, along = 0.0, farthest = 0.0;
    for (size_t c = 0; c < s->width; c++) {
        const double off = row->position[c] - drain->position[c];
        square += off * off;
        along += off * drain->normal[c];
        farthest = fmax(farthest, fabs(off) - drain->half[c]);
    }
    const bool in = drain->kind == ASCC_DRAIN_ALL      ? true
                    : drain->kind == ASCC_DRAIN_BOX    ? farthest <= 0.0
                    : drain->kind == ASCC_DRAIN_SPHERE ? square <= drain->radius * drain->radius
                                                       : along > 0.0;
    return in != (drain->outside != 0) && (!drain->before || row->id < drain->before);
}

static ascc_drain some_drain(sequence *s)
{
    ascc_drain drain = {.size = sizeof drain,
                        .kind = (ascc_drain_kind)below(s, 4),
                        .radius = between(s, 0.0, 2.0) * spacing,
                        .before = once_in(s, 2) ? 1 + below(s, (size_t)s->last_id + 2) : 0};
    drain.outside = drain.kind != ASCC_DRAIN_ALL && once_in(s, 6);
    for (size_t c = 0; c < 3; c++) {
        drain.position[c] = between(s, 0.0, 6.0) * spacing;
        drain.half[c] = between(s, 0.0, 2.0) * spacing;
        drain.normal[c] = between(s, 0.1, 1.0) * (once_in(s, 2) ? 1.0 : -1.0);
    }
    return drain;
}

static void run_drain(sequence *s)
{
    enum { ROOM = 6 };
    const ascc_drain drain = some_drain(s);
    const bool all = once_in(s, 6);
    uint64_t ids[ROOM];
    size_t count = SIZE_MAX, found = 0;
    CHECK(ascc_drain_run(s->particles, &drain, ROOM, all ? NULL : ids, &count) == ASCC_OK);
    for (size_t i = 0; i < s->count[ASCC_FLUID];) {
        if ((!all && found == ROOM) || !is_in_drain(s, &drain, &s->row[ASCC_FLUID][i])) {
            i++;
            continue;
        }
        CHECK(all || ids[found] == s->row[ASCC_FLUID][i].id);
        found++;
        drop_row(s, ASCC_FLUID, i);
    }
    CHECK(count == found);
}

static void run_tap_wrongly(sequence *s)
{
    const uint64_t before = ascc_particles_hash(s->particles);
    ascc_tap tap = some_tap(s);
    ascc_drain drain = some_drain(s);
    ascc_status wanted = ASCC_ERROR_NOT_FINITE, drained = ASCC_ERROR_NOT_FINITE;
    double seconds = 0.01;
    size_t count = 7;
    switch (below(s, 6)) {
    case 0:
        tap.position[below(s, 3)] = bad_number(s);
        drain.position[below(s, 3)] = bad_number(s);
        break;
    case 1:
        tap.velocity[below(s, 3)] = bad_number(s);
        drain.normal[below(s, 3)] = bad_number(s);
        break;
    case 2:
        seconds = bad_number(s);
        drain.radius = bad_number(s);
        break;
    case 3:
        tap.size = drain.size = 3;
        wanted = drained = ASCC_ERROR_ARGUMENT;
        break;
    case 4:
        tap.half[below(s, 3)] = drain.half[below(s, 3)] = -spacing;
        wanted = drained = ASCC_ERROR_ARGUMENT;
        break;
    default:
        tap.half[1] = 1e9 * spacing;
        tap.radius = 0.0;
        wanted = ASCC_ERROR_RANGE;
        drain.kind = (ascc_drain_kind)(4 + below(s, 3));
        drained = ASCC_ERROR_ARGUMENT;
        break;
    }
    const ascc_tap was = tap;
    check_refused(s, ascc_tap_run(s->particles, &tap, seconds, 0, NULL, &count), wanted, before);
    CHECK(count == 7 && tap.emitted == was.emitted && memcmp(&tap, &was, sizeof tap) == 0);
    check_refused(s, ascc_drain_run(s->particles, &drain, 0, NULL, &count), drained, before);
    CHECK(count == 7);
}

/* ---- Steps ---- */

/* Positions after a step are the set's to choose; masses, walls and ids are not. */
static void follow_positions(sequence *s)
{
    for (size_t i = 0; i < s->count[ASCC_FLUID]; i++) {
        const ascc_array x = {.data = s->row[ASCC_FLUID][i].position, .scalar = ASCC_DOUBLE};
        CHECK(ascc_particles_get(s->particles, ASCC_FLUID, ASCC_POSITION, i, 1, &x) == ASCC_OK);
        for (size_t c = 0; c < s->width; c++)
            CHECK(isfinite(s->row[ASCC_FLUID][i].position[c]));
    }
    follow_bodies(s);
}

static void check_momentum(sequence *s, const int64_t before[3])
{
    ascc_step_statistics t = {.size = sizeof t};
    int64_t after[3], all[3] = {0}, wall[3] = {0};
    CHECK(ascc_step_get_statistics(s->step, &t) == ASCC_OK);
    CHECK(t.steps == 1);
    CHECK(ascc_particles_total_momentum(s->particles, after) == ASCC_OK);
    CHECK(ascc_particles_body_impulse(s->particles, -1, NULL, all, NULL) == ASCC_OK);
    for (int32_t body = 0; body <= s->last_body; body++) {
        int64_t one[3];
        CHECK(ascc_particles_body_impulse(s->particles, body, NULL, one, NULL) == ASCC_OK);
        for (int c = 0; c < 3; c++)
            wall[c] += one[c];
    }
    for (int c = 0; c < 3; c++) {
        CHECK(t.momentum_after[c] == after[c]);
        CHECK(!s->count[ASCC_FLUID] || t.momentum_before[c] == before[c]);
        CHECK(!s->count[ASCC_FLUID] || (all[c] == wall[c] && all[c] == t.wall_impulse[c]));
        if (s->kind != MODELS - 1) /* the last kind does not conserve it */
            CHECK(t.momentum_before[c] + t.external_impulse[c] - t.wall_impulse[c] == after[c]);
    }
}

typedef struct push {
    double gravity[3], acceleration[MOST][3];
    ascc_const_array array;
    ascc_forces forces;
} push;

static void some_forces(sequence *s, push *p)
{
    for (int c = 0; c < 3; c++)
        p->gravity[c] = between(s, -10.0, 10.0);
    for (size_t i = 0; i < MOST; i++)
        for (int c = 0; c < 3; c++)
            p->acceleration[i][c] = between(s, -1.0, 1.0);
    p->array = (ascc_const_array){
        .data = p->acceleration, .stride = sizeof *p->acceleration, .scalar = ASCC_DOUBLE};
    p->forces = (ascc_forces){.size = sizeof p->forces,
                              .gravity = once_in(s, 3) ? NULL : p->gravity,
                              .acceleration = once_in(s, 2) ? NULL : &p->array};
}

static void check_named(sequence *s, ascc_status status)
{
    CHECK(status == ASCC_ERROR_RANGE || status == ASCC_ERROR_NOT_FINITE ||
          status == ASCC_ERROR_LIMIT || status == ASCC_ERROR_MEMORY);
    CHECK(ascc_step_message(s->step)[0] != '\0');
}

static void run_step(sequence *s)
{
    static push p;
    int64_t total[3];
    const uint64_t before = ascc_particles_hash(s->particles);
    CHECK(ascc_particles_total_momentum(s->particles, total) == ASCC_OK);
    some_forces(s, &p);
    const ascc_status status = ascc_step_run(s->step, s->particles, &p.forces, 1);
    if (status == ASCC_OK) {
        check_momentum(s, total);
        follow_positions(s);
    } else {
        check_named(s, status);
        CHECK(ascc_particles_hash(s->particles) == before);
    }
}

static void run_with_bad_forces(sequence *s)
{
    static push p;
    const uint64_t before = ascc_particles_hash(s->particles);
    if (!s->count[ASCC_FLUID])
        return;
    some_forces(s, &p);
    p.forces.gravity = p.gravity;
    p.forces.acceleration = &p.array;
    ascc_status wanted = ASCC_ERROR_NOT_FINITE;
    if (once_in(s, 3)) {
        p.gravity[below(s, s->width)] = bad_number(s);
    } else if (once_in(s, 2)) {
        p.acceleration[below(s, s->count[ASCC_FLUID])][below(s, s->width)] = bad_number(s);
    } else {
        p.forces.size = 2;
        wanted = ASCC_ERROR_ARGUMENT;
    }
    CHECK(ascc_step_run(s->step, s->particles, &p.forces, 1) == wanted);
    CHECK(ascc_step_message(s->step)[0] != '\0');
    CHECK(ascc_particles_hash(s->particles) == before);
}

/* ---- Twins ---- */

static ascc_particles *empty_twin(sequence *s, ascc_context *context)
{
    ascc_particles *twin = NULL;
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = s->d,
                                            .spacing = spacing,
                                            .mass = 0.125,
                                            .momentum_quantum =
                                                ascc_particles_momentum_quantum(s->particles)};
    CHECK(ascc_particles_create(context, &options, &twin) == ASCC_OK);
    return twin;
}

static ascc_particles *restored_twin(sequence *s, ascc_context *context)
{
    ascc_particles *twin = empty_twin(s, context);
    const size_t size = ascc_particles_snapshot_size(s->particles);
    unsigned char *bytes = malloc(size);
    assert_non_null(bytes);
    CHECK(ascc_particles_snapshot(s->particles, bytes, size) == ASCC_OK);
    CHECK(ascc_particles_restore(twin, bytes, size) == ASCC_OK);
    free(bytes);
    return twin;
}

/* The same particles added backwards; *same: their momenta could be given as velocities. */
static ascc_particles *reversed_twin(sequence *s, ascc_context *context, bool *same)
{
    ascc_particles *twin = empty_twin(s, context);
    *same = true;
    for (size_t n = s->count[ASCC_FLUID]; n; n--) {
        shadow_row *row = &s->row[ASCC_FLUID][n - 1];
        double velocity[3];
        int64_t given[3], held[3];
        const ascc_const_array x = {.data = row->position, .scalar = ASCC_DOUBLE};
        const ascc_const_array v = {.data = velocity, .scalar = ASCC_DOUBLE};
        const ascc_const_array m = {.data = &row->mass, .scalar = ASCC_DOUBLE};
        const ascc_array read = {.data = velocity, .scalar = ASCC_DOUBLE};
        CHECK(ascc_particles_get(s->particles, ASCC_FLUID, ASCC_VELOCITY, n - 1, 1, &read) ==
              ASCC_OK);
        const ascc_const_array detail = {.data = &row->detail, .scalar = ASCC_DOUBLE};
        CHECK(ascc_particles_add_fluid(twin, 1, &x, &v, &m, NULL) == ASCC_OK);
        CHECK(ascc_particles_set(twin, ASCC_FLUID, ASCC_DETAIL, s->count[ASCC_FLUID] - n, 1,
                                 &detail) == ASCC_OK);
        CHECK(ascc_particles_get_momentum(s->particles, n - 1, 1, given) == ASCC_OK);
        CHECK(ascc_particles_get_momentum(twin, s->count[ASCC_FLUID] - n, 1, held) == ASCC_OK);
        *same = *same && memcmp(given, held, s->width * sizeof *given) == 0;
    }
    for (size_t n = s->count[ASCC_BOUNDARY]; n; n--) {
        shadow_row *row = &s->row[ASCC_BOUNDARY][n - 1];
        const ascc_const_array x = {.data = row->position, .scalar = ASCC_DOUBLE};
        const ascc_const_array v = {.data = row->normal, .scalar = ASCC_DOUBLE};
        CHECK(ascc_particles_add_boundary(twin, 1, &x, &v, row->body, NULL) == ASCC_OK);
    }
    return twin;
}

/* Both go the same way for some steps; 7 threads, 2, or 1. */
static void run_beside_twin(sequence *s)
{
    static push p;
    bool same = true;
    const int32_t steps = (int32_t)below(s, 4);
    ascc_context *context = contexts[below(s, SIZES)];
    const bool reversed =
        once_in(s, 2) && !s->body_count; /* whose numbers follow from their order */
    ascc_particles *twin = reversed ? reversed_twin(s, context, &same) : restored_twin(s, context);
    ascc_step *step = NULL;
    some_forces(s, &p);
    if (reversed)
        p.forces.acceleration = NULL; /* which is by row */
    if (same) {
        CHECK(ascc_particles_hash(twin) == ascc_particles_hash(s->particles));
        CHECK(ascc_step_create(context, models[s->d - 2][s->kind], NULL, &step) == ASCC_OK);
        const ascc_status first = ascc_step_run(s->step, s->particles, &p.forces, steps);
        const ascc_status second = ascc_step_run(step, twin, &p.forces, steps);
        CHECK(first == second);
        if (first != ASCC_OK)
            check_named(s, first);
        CHECK(ascc_particles_hash(twin) == ascc_particles_hash(s->particles));
        follow_positions(s);
    }
    ascc_step_destroy(&step);
    ascc_particles_destroy(&twin);
}

/* ---- Memory ---- */

static void run_out_of_memory(sequence *s)
{
    static push p;
    const uint64_t before = ascc_particles_hash(s->particles);
    const double x[3] = {0.0, 0.0, 0.0};
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    ascc_measures measures = {.size = sizeof measures};
    const size_t calls = s->memory.calls;
    ascc_status status = ASCC_OK;
    uint64_t id = 0;
    const size_t what = below(s, 5);
    if (what == 0 && s->count[ASCC_FLUID] == MOST)
        return;
    some_forces(s, &p);
    s->memory.fail_at = calls + 1 + below(s, 3);
    switch (what) {
    case 0:
        status = ascc_particles_add_fluid(s->particles, 1, &position, NULL, NULL, &id);
        if (status == ASCC_OK)
            s->row[ASCC_FLUID][s->count[ASCC_FLUID]++] =
                (shadow_row){.id = s->last_id = id, .mass = 0.125};
        break;
    case 1:
        status = ascc_particles_reserve(s->particles, below(s, 400), below(s, 400));
        break;
    case 2:
        status = ascc_particles_measure(s->particles, &measures);
        break;
    case 3:
        status = ascc_step_reserve(s->step, below(s, 3000), below(s, 3000));
        break;
    default:
        status = ascc_step_run(s->step, s->particles, &p.forces, 1);
        if (status == ASCC_OK)
            follow_positions(s);
        break;
    }
    const bool failed = s->memory.calls >= s->memory.fail_at;
    s->memory.fail_at = 0;
    if (status != ASCC_OK)
        CHECK(ascc_particles_hash(s->particles) == before);
    if (what < 3) /* a step may do without the one block that it asks for first */
        CHECK(!failed || status == ASCC_ERROR_MEMORY);
}

/* ---- After each call ---- */

static void check_ids(sequence *s, int kind)
{
    uint64_t ids[MOST];
    const size_t count = s->count[kind];
    CHECK(ascc_particles_count(s->particles, (ascc_kind)kind) == count);
    CHECK(ascc_particles_capacity(s->particles, (ascc_kind)kind) >= count);
    CHECK(ascc_particles_get_ids(s->particles, (ascc_kind)kind, 0, count, ids) == ASCC_OK);
    for (size_t i = 0; i < count; i++)
        CHECK(ids[i] == s->row[kind][i].id);
    if (count) {
        const size_t i = below(s, count);
        ascc_kind found;
        size_t row;
        CHECK(ascc_particles_find(s->particles, ids[i], &found, &row) == ASCC_OK);
        CHECK(found == (ascc_kind)kind && row == i);
    }
}

static void check_field(sequence *s, ascc_kind kind, ascc_field field)
{
    static host_array h;
    const bool single = field == ASCC_MASS || field == ASCC_DETAIL;
    const size_t count = s->count[kind], components = single ? 1 : s->width;
    lay_out(s, &h, count, components);
    CHECK(ascc_particles_get(s->particles, kind, field, 0, count, &h.to) == ASCC_OK);
    for (size_t i = 0; i < count; i++) {
        const shadow_row *row = &s->row[kind][i];
        const double *held = field == ASCC_MASS     ? &row->mass
                             : field == ASCC_DETAIL ? &row->detail
                             : field == ASCC_NORMAL ? row->normal
                                                    : row->position;
        for (size_t c = 0; c < components; c++) {
            const double wanted = h.from.scalar == ASCC_FLOAT ? (double)(float)held[c] : held[c];
            CHECK(take(&h, i, c, components) == wanted);
        }
    }
}

static void check_all(sequence *s)
{
    ascc_measures measures = {.size = sizeof measures};
    int32_t bodies[MOST];
    check_ids(s, ASCC_FLUID);
    check_ids(s, ASCC_BOUNDARY);
    check_bodies(s);
    check_field(s, ASCC_FLUID, ASCC_POSITION);
    check_field(s, ASCC_FLUID, ASCC_MASS);
    check_field(s, ASCC_FLUID, ASCC_DETAIL);
    check_field(s, ASCC_BOUNDARY, ASCC_POSITION);
    check_field(s, ASCC_BOUNDARY, ASCC_NORMAL);
    CHECK(ascc_particles_get_bodies(s->particles, 0, s->count[ASCC_BOUNDARY], bodies) == ASCC_OK);
    for (size_t i = 0; i < s->count[ASCC_BOUNDARY]; i++)
        CHECK(bodies[i] == s->row[ASCC_BOUNDARY][i].body);
    if (once_in(s, 10)) {
        const ascc_status status = ascc_particles_measure(s->particles, &measures);
        CHECK(status == ASCC_OK || status == ASCC_ERROR_RANGE);
    }
}

static void open_sequence(sequence *s, uint64_t seed)
{
    memset(s, 0, sizeof *s);
    s->seed = s->random.state = seed;
    s->last_body = -1;
    (void)test_random_bits(&s->random);
    s->d = 2 + (int32_t)below(s, 2);
    s->width = (size_t)s->d;
    s->kind = (int)below(s, MODELS);
    const ascc_context_options context = test_memory_options(&s->memory);
    const ascc_particles_options options = {.size = sizeof options,
                                            .dimension = s->d,
                                            .spacing = spacing,
                                            .mass = 0.125,
                                            .fluid_capacity = below(s, 20),
                                            .boundary_capacity = below(s, 20)};
    CHECK(ascc_context_create(&context, &s->context) == ASCC_OK);
    CHECK(ascc_particles_create(s->context, &options, &s->particles) == ASCC_OK);
    CHECK(ascc_step_create(s->context, models[s->d - 2][s->kind], NULL, &s->step) == ASCC_OK);
}

static void close_sequence(sequence *s)
{
    const size_t first = below(s, 3);
    for (size_t i = first; i < first + 3; i++)
        if (i % 3 == 0)
            ascc_context_destroy(&s->context);
        else if (i % 3 == 1)
            ascc_particles_destroy(&s->particles);
        else
            ascc_step_destroy(&s->step);
    if (!test_memory_is_clean(&s->memory))
        fail_msg("seed %" PRIu64 ": %zu blocks are left, %zu faults", s->seed, s->memory.blocks,
                 s->memory.faults);
}

static void run_sequence(uint64_t seed)
{
    static void (*const calls[])(sequence *) = {
        add_fluid,       add_fluid,        add_fluid,         add_boundary,    add_boundary,
        add_bad_fluid,   add_bad_boundary, remove_some,       remove_wrongly,  resize,
        set_some,        set_some,         set_wrongly,       restore_garbage, ask_wrongly,
        run_step,        run_step,         run_step,          run_step,        run_with_bad_forces,
        run_beside_twin, run_beside_twin,  run_out_of_memory, add_body,        move_body,
        move_body,       move_wrongly,     remove_body,       run_tap,         run_tap,
        run_drain,       run_tap_wrongly};
    static sequence one;
    sequence *s = &one;
    open_sequence(s, seed);
    for (s->call = 0; s->call < CALLS; s->call++) {
        if (once_in(s, 40))
            clear_one(s);
        else
            calls[below(s, COUNT_OF(calls))](s);
        check_all(s);
    }
    close_sequence(s);
}

static void random_calls_follow_a_plain_list(void **state)
{
    (void)state;
    const char *alone = getenv("ASCC_TEST_SEED"), *more = getenv("ASCC_TEST_LONG");
    const uint64_t first = alone ? strtoull(alone, NULL, 10) : 1;
    const uint64_t count = alone ? 1 : more && *more ? 10 * SEQUENCES : SEQUENCES;
    print_message("seeds %" PRIu64 " to %" PRIu64 ", %d calls each\n", first, first + count - 1,
                  CALLS);
    for (uint64_t seed = first; seed < first + count; seed++)
        run_sequence(seed);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(random_calls_follow_a_plain_list, open_all, close_all),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
