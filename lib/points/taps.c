/* Taps, which let fluid in where there is room, and drains, which take it out. SPDX-License-Identifier: MIT */
#include <string.h>

#include "rest.h"

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_tap) == 136, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_drain) == 104, "layout is part of the ABI");

#define MOST_PLACES ((size_t)1 << 20)
#define CLEARANCE 0.9  /* spacings */
#define WALL_SHARE 0.5 /* of the clearance */

static ascc_status check_finite(const char *name, const double *values, int count,
                                ascc_message *message)
{
    for (int c = 0; c < count; c++)
        if (!isfinite(values[c]))
            return ascc_fail(message, ASCC_ERROR_NOT_FINITE, "%s component %d is %g", name, c,
                             ascc_readable(values[c]));
    return ASCC_OK;
}

static ascc_status check_not_negative(const char *name, double value, ascc_message *message)
{
    const ascc_status status = check_finite(name, &value, 1, message);
    if (status != ASCC_OK || value >= 0)
        return status;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s is %g, negative", name, value);
}

/* ---- Places of a mouth ------------------------------------------------------------------------- */

typedef struct places {
    size_t count;
    double *at;           /* [count][dimension] */
    unsigned char *taken; /* [count] by fluid or walls */
} places;

/* Axes of the mouth's lattice: across the velocity for a disc, the world's for a box. */
typedef struct mouth {
    int axis_count;
    double axis[3][3];
    int64_t cells[3]; /* places go from -cells to cells on each axis */
    double offset[3]; /* of the lattice: 0, or half a pitch where an even number fits better */
    double pitch, radius;
} mouth;

static void find_axes(const ascc_tap *tap, size_t d, mouth *m)
{
    const double *v = tap->velocity;
    double length = 0;
    size_t least = 0;
    for (size_t c = 0; c < d; c++) {
        length += v[c] * v[c];
        least = fabs(v[c]) < fabs(v[least]) ? c : least;
    }
    length = sqrt(length);
    memset(m->axis, 0, sizeof m->axis);
    if (d == 2) {
        m->axis[0][0] = -v[1] / length;
        m->axis[0][1] = v[0] / length;
        return;
    }
    double first[3] = {0, 0, 0}, size = 0;
    for (size_t c = 0; c < 3; c++) {
        first[c] = (c == least ? 1.0 : 0.0) - v[least] * v[c] / (length * length);
        size += first[c] * first[c];
    }
    for (size_t c = 0; c < 3; c++)
        m->axis[0][c] = first[c] / sqrt(size);
    for (size_t c = 0; c < 3; c++)
        m->axis[1][c] =
            (v[(c + 1) % 3] * m->axis[0][(c + 2) % 3] - v[(c + 2) % 3] * m->axis[0][(c + 1) % 3]) /
            length;
}

static ascc_status find_mouth(const ascc_tap *tap, size_t d, mouth *m, ascc_message *message)
{
    const bool disc = tap->radius > 0;
    double extent[3], count = 1;
    m->pitch = tap->pitch;
    m->radius = tap->radius;
    m->axis_count = (int)d - (disc ? 1 : 0);
    if (disc)
        find_axes(tap, d, m);
    else
        memcpy(m->axis, (const double[3][3]){{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, sizeof m->axis);
    for (int a = 0; a < m->axis_count; a++) {
        extent[a] = disc ? tap->radius : tap->half[a];
        count *= 2 * extent[a] / m->pitch + 1;
    }
    if (!(count < (double)MOST_PLACES))
        return ascc_fail(message, ASCC_ERROR_RANGE, "tap: its mouth has over 2^20 places");
    for (int a = 0; a < m->axis_count; a++) {
        const int64_t fit = (int64_t)floor(2 * extent[a] / m->pitch * (1 + 1e-9)); /* pitches */
        m->offset[a] = !disc && fit % 2 == 1 ? 0.5 * m->pitch : 0;
        m->cells[a] = disc ? (int64_t)floor(extent[a] / m->pitch * (1 + 1e-9)) : (fit + 1) / 2;
    }
    return ASCC_OK;
}

/* Whether a place of the lattice is in the mouth, and where. */
static bool place_at(const mouth *m, const ascc_tap *tap, const int64_t cell[3], double at[3])
{
    double square = 0;
    memcpy(at, tap->position, 3 * sizeof *at);
    for (int a = 0; a < m->axis_count; a++) {
        const double along = (double)cell[a] * m->pitch + m->offset[a];
        if (m->radius <= 0 && fabs(along) > tap->half[a] * (1 + 1e-9) + 1e-12 * m->pitch)
            return false;
        square += along * along;
        for (int c = 0; c < 3; c++)
            at[c] += along * m->axis[a][c];
    }
    return m->radius <= 0 || square <= m->radius * m->radius * (1 + 1e-9);
}

/* Counts the places, or writes them where there is room. */
static size_t list_places(const mouth *m, const ascc_tap *tap, size_t d, double *into)
{
    int64_t cell[3], low[3] = {0, 0, 0}, high[3] = {0, 0, 0};
    size_t count = 0;
    for (int a = 0; a < m->axis_count; a++) {
        low[a] = -m->cells[a];
        high[a] = m->cells[a];
    }
    for (cell[2] = low[2]; cell[2] <= high[2]; cell[2]++)
        for (cell[1] = low[1]; cell[1] <= high[1]; cell[1]++)
            for (cell[0] = low[0]; cell[0] <= high[0]; cell[0]++) {
                double at[3];
                if (!place_at(m, tap, cell, at))
                    continue;
                if (into != NULL)
                    memcpy(into + count * d, at, d * sizeof *at);
                count++;
            }
    return count;
}

/* Marks places nearer than `clearance` to one of these positions. */
static void mark_taken(places *p, size_t d, const double *position, size_t count, double clearance)
{
    double low[3], high[3];
    for (size_t c = 0; c < d; c++) {
        low[c] = (double)INFINITY;
        high[c] = -(double)INFINITY;
        for (size_t k = 0; k < p->count; k++) {
            low[c] = fmin(low[c], p->at[k * d + c] - clearance);
            high[c] = fmax(high[c], p->at[k * d + c] + clearance);
        }
    }
    for (size_t i = 0; i < count; i++) {
        const double *at = position + i * d;
        bool near = true;
        for (size_t c = 0; c < d; c++)
            near &= at[c] > low[c] && at[c] < high[c];
        for (size_t k = 0; near && k < p->count; k++) {
            double square = 0;
            for (size_t c = 0; c < d; c++)
                square += (at[c] - p->at[k * d + c]) * (at[c] - p->at[k * d + c]);
            p->taken[k] |= square < clearance * clearance;
        }
    }
}

/* ---- Taps ------------------------------------------------------------------------------------ */

static ascc_status check_tap(const ascc_particles *particles, ascc_tap *tap, double seconds,
                             ascc_message *message)
{
    ascc_status status = check_finite("tap: position", tap->position, 3, message);
    if (status == ASCC_OK)
        status = check_finite("tap: velocity", tap->velocity, 3, message);
    for (int c = 0; c < 3 && status == ASCC_OK; c++)
        status = check_not_negative("tap: half", tap->half[c], message);
    const struct {
        const char *name;
        double value;
    } numbers[] = {{"tap: radius", tap->radius}, {"tap: rate", tap->rate},
                   {"tap: pitch", tap->pitch},   {"tap: clearance", tap->clearance},
                   {"tap: mass", tap->mass},     {"tap: owed", tap->owed},
                   {"seconds", seconds}};
    for (size_t i = 0; i < sizeof numbers / sizeof *numbers && status == ASCC_OK; i++)
        status = check_not_negative(numbers[i].name, numbers[i].value, message);
    double speed = 0;
    for (size_t c = 0; c < ascc_particles_width(particles); c++)
        speed += fabs(tap->velocity[c]);
    if (status == ASCC_OK && tap->radius > 0 && speed == 0)
        status = ascc_fail(message, ASCC_ERROR_ARGUMENT,
                           "tap: velocity is 0, so that no disc lies across it");
    tap->pitch = tap->pitch > 0 ? tap->pitch : particles->spacing;
    tap->clearance = tap->clearance > 0 ? tap->clearance : CLEARANCE * particles->spacing;
    tap->mass = tap->mass > 0 ? tap->mass : particles->default_mass;
    return status;
}

/* Moves free places to the front, `most` at most, beginning at a place that goes round from call to call. */
static size_t choose_places(places *p, size_t d, size_t most, uint64_t emitted, double *chosen)
{
    size_t count = 0, k = (size_t)(emitted % p->count);
    for (size_t n = 0; n < p->count && count < most; n++, k = k + 1 < p->count ? k + 1 : 0)
        if (!p->taken[k])
            memcpy(chosen + count++ * d, p->at + k * d, d * sizeof *chosen);
    return count;
}

static ascc_status emit(ascc_particles *particles, ascc_tap *tap, const double *chosen,
                        size_t count, uint64_t *ids)
{
    const ascc_const_array position = {.data = chosen, .scalar = ASCC_DOUBLE};
    double *const velocity =
        ascc_allocate(&particles->context->allocator, count, 4 * sizeof(double));
    if (velocity == NULL)
        return ascc_particles_fail(particles, ASCC_ERROR_MEMORY, "out of memory for %zu particles",
                                   count);
    for (size_t i = 0; i < count; i++) {
        memcpy(velocity + 4 * i, tap->velocity, 3 * sizeof(double));
        velocity[4 * i + 3] = tap->mass;
    }
    const ascc_const_array velocities = {
        .data = velocity, .stride = 4 * sizeof(double), .scalar = ASCC_DOUBLE};
    const ascc_const_array masses = {
        .data = velocity + 3, .stride = 4 * sizeof(double), .scalar = ASCC_DOUBLE};
    const ascc_status status =
        ascc_particles_add_fluid(particles, count, &position, &velocities, &masses, ids);
    ascc_release(&particles->context->allocator, velocity, count, 4 * sizeof(double));
    return status;
}

/* What is owed now, and lets it out. `tap` has its defaults filled in. */
static ascc_status fill_places(ascc_particles *particles, ascc_tap *tap, double seconds,
                               size_t capacity, uint64_t *ids, places *p, double *chosen,
                               size_t *count)
{
    const size_t d = ascc_particles_width(particles);
    const double due = tap->rate > 0 ? tap->owed + tap->rate * seconds : (double)p->count;
    tap->owed = fmin(due, (double)p->count);
    memset(p->taken, 0, p->count);
    mark_taken(p, d, particles->position, particles->fluid_count, tap->clearance);
    mark_taken(p, d, particles->wall_position, particles->boundary_count,
               WALL_SHARE * tap->clearance);
    const size_t most = ascc_min_size((size_t)tap->owed, ids != NULL ? capacity : SIZE_MAX);
    const size_t chosen_count = choose_places(p, d, most, tap->emitted, chosen);
    const ascc_status status =
        chosen_count > 0 ? emit(particles, tap, chosen, chosen_count, ids) : ASCC_OK;
    if (status != ASCC_OK)
        return status;
    tap->owed = tap->rate > 0 ? tap->owed - (double)chosen_count : 0;
    tap->emitted += chosen_count;
    *count = chosen_count;
    return ASCC_OK;
}

static ascc_status run_tap(ascc_particles *particles, ascc_tap *tap, double seconds,
                           size_t capacity, uint64_t *ids, size_t *count)
{
    const size_t d = ascc_particles_width(particles);
    const ascc_allocator *const allocator = &particles->context->allocator;
    ascc_message message;
    mouth m;
    ascc_status status = check_tap(particles, tap, seconds, &message);
    if (status == ASCC_OK)
        status = find_mouth(tap, d, &m, &message);
    if (status != ASCC_OK)
        return ascc_particles_fail(particles, status, "%s", message.text);
    places p = {.count = list_places(&m, tap, d, NULL)};
    const size_t numbers = 2 * p.count * d;
    p.at = ascc_allocate(allocator, numbers, sizeof *p.at);
    p.taken = ascc_allocate(allocator, p.count, 1);
    if (p.at == NULL || p.taken == NULL) {
        status = ascc_particles_fail(particles, ASCC_ERROR_MEMORY,
                                     "tap: out of memory for %zu places", p.count);
    } else {
        (void)list_places(&m, tap, d, p.at);
        status = fill_places(particles, tap, seconds, capacity, ids, &p, p.at + p.count * d, count);
    }
    if (p.at != NULL)
        ascc_release(allocator, p.at, numbers, sizeof *p.at);
    if (p.taken != NULL)
        ascc_release(allocator, p.taken, p.count, 1);
    return status;
}

ascc_status ascc_tap_run(ascc_particles *particles, ascc_tap *tap, double seconds, size_t capacity,
                         uint64_t *ids, size_t *count)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_tap running;
    if (tap == NULL || count == NULL ||
        !ascc_read_struct(&running, sizeof running, tap, sizeof running))
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                   "tap or count: NULL, or of a size not known here");
    const ascc_status status = run_tap(particles, &running, seconds, capacity, ids, count);
    if (status == ASCC_OK) {
        tap->owed = running.owed;
        tap->emitted = running.emitted;
    }
    return status;
}

/* ---- Drains ---------------------------------------------------------------------------------- */

static ascc_status check_drain(const ascc_drain *drain, size_t d, ascc_message *message)
{
    double square = 0;
    if ((int)drain->kind < ASCC_DRAIN_ALL || (int)drain->kind > ASCC_DRAIN_HALF_SPACE)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "drain: kind is %d", (int)drain->kind);
    if (drain->outside != 0 && (drain->outside != 1 || drain->kind == ASCC_DRAIN_ALL))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "drain: outside is %ld",
                         (long)drain->outside);
    ascc_status status = check_finite("drain: position", drain->position, 3, message);
    for (int c = 0; c < 3 && status == ASCC_OK; c++)
        status = check_not_negative("drain: half", drain->half[c], message);
    if (status == ASCC_OK)
        status = check_not_negative("drain: radius", drain->radius, message);
    if (status == ASCC_OK)
        status = check_finite("drain: normal", drain->normal, 3, message);
    for (size_t c = 0; c < d; c++)
        square += fabs(drain->normal[c]);
    if (status == ASCC_OK && drain->kind == ASCC_DRAIN_HALF_SPACE && square == 0)
        status = ascc_fail(message, ASCC_ERROR_ARGUMENT, "drain: normal is 0");
    return status;
}

static bool is_drained(const ascc_drain *drain, size_t d, const double *at, uint64_t id)
{
    double square = 0, along = 0;
    bool inside = true;
    if (drain->before != 0 && id >= drain->before)
        return false;
    for (size_t c = 0; c < d; c++) {
        const double off = at[c] - drain->position[c];
        square += off * off;
        along += off * drain->normal[c];
        inside &= drain->kind != ASCC_DRAIN_BOX || fabs(off) <= drain->half[c];
    }
    if (drain->kind == ASCC_DRAIN_SPHERE)
        inside = square <= drain->radius * drain->radius;
    if (drain->kind == ASCC_DRAIN_HALF_SPACE)
        inside = along > 0;
    return inside != (drain->outside == 1);
}

static ascc_status run_drain(ascc_particles *particles, const ascc_drain *drain, size_t capacity,
                             uint64_t *ids, size_t *count, ascc_message *message)
{
    const size_t d = ascc_particles_width(particles), rows = particles->fluid_count;
    const ascc_allocator *const allocator = &particles->context->allocator;
    const ascc_status status = check_drain(drain, d, message);
    if (status != ASCC_OK)
        return status;
    unsigned char *const marked = ascc_allocate(allocator, rows, 1);
    if (marked == NULL)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "drain: out of memory for %zu particles",
                         rows);
    size_t removed = 0;
    for (size_t row = 0; row < rows; row++) {
        marked[row] = (ids == NULL || removed < capacity) &&
                      is_drained(drain, d, particles->position + row * d, particles->id[row]);
        if (marked[row] && ids != NULL)
            ids[removed] = particles->id[row];
        removed += marked[row];
    }
    if (removed > 0) {
        ascc_rest_disturb_marked(particles, ASCC_FLUID, marked);
        ascc_particles_drop_rows(particles, ASCC_FLUID, marked);
    }
    ascc_release(allocator, marked, rows, 1);
    if (count != NULL)
        *count = removed;
    return ASCC_OK;
}

ascc_status ascc_drain_run(ascc_particles *particles, const ascc_drain *drain, size_t capacity,
                           uint64_t *ids, size_t *count)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_drain read;
    ascc_message message;
    if (drain == NULL || !ascc_read_struct(&read, sizeof read, drain, sizeof read))
        return ascc_particles_fail(particles, ASCC_ERROR_ARGUMENT,
                                   "drain: NULL, or of a size not known here");
    const ascc_status status = run_drain(particles, &read, capacity, ids, count, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}
