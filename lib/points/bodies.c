/* Bodies: adding, moving, removing, and what they received. SPDX-License-Identifier: MIT */
#include "bodies.h"

#include <string.h>

#include "rest.h"
#include "rotation.h"
#include "shapes.h"

_Static_assert(sizeof(void *) != 8 || sizeof(ascc_shape) == 112, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_pose) == 128, "layout is part of the ABI");
_Static_assert(sizeof(void *) != 8 || sizeof(ascc_body_info) == 136, "layout is part of the ABI");

/* ---- Which points are a body's ---------------------------------------------------------------- */

struct ascc_body *ascc_bodies_find(const ascc_particles *particles, int32_t number)
{
    size_t low = 0, high = particles->body_count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (particles->bodies[middle].number < number)
            low = middle + 1;
        else
            high = middle;
    }
    return low < particles->body_count && particles->bodies[low].number == number
               ? &particles->bodies[low]
               : NULL;
}

/* The first row whose id is not below. */
static size_t row_from(const ascc_particles *particles, uint64_t id)
{
    size_t low = 0, high = particles->boundary_count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        if (particles->wall_id[middle] < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

void ascc_body_rows(const ascc_particles *particles, const struct ascc_body *body, size_t *first,
                    size_t *count)
{
    *first = row_from(particles, body->first_id);
    *count = row_from(particles, body->end_id) - *first;
}

ascc_status ascc_bodies_check_free(const ascc_particles *particles, size_t first, size_t count,
                                   ascc_message *message)
{
    for (size_t b = 0; b < particles->body_count && count > 0; b++) {
        size_t own, own_count;
        ascc_body_rows(particles, &particles->bodies[b], &own, &own_count);
        if (own_count > 0 && own < first + count && first < own + own_count)
            return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                             "boundary: row %zu is of body %ld, which ascc_body_move moves",
                             own > first ? own : first, (long)particles->bodies[b].number);
    }
    return ASCC_OK;
}

/* ---- Frames ---------------------------------------------------------------------------------- */

bool ascc_body_advance(const ascc_particles *particles, struct ascc_body *body, double seconds)
{
    const double *const w = body->spin;
    for (int c = 0; c < 3; c++) {
        body->position[c] += body->velocity[c] * seconds;
        if (!(fabs(body->position[c]) <= ASCC_POSITION_LIMIT * particles->spacing))
            return false;
    }
    if (particles->dimension == 2) {
        body->angle += w[2] * seconds;
        return fabs(body->angle) <= ASCC_ANGLE_LIMIT;
    }
    if (!(sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]) * seconds <= ASCC_ANGLE_LIMIT))
        return false;
    ascc_rotation_spin(body->rotation, w, seconds);
    return true;
}

/* The frame as a matrix. */
static void matrix_of(const struct ascc_body *body, int32_t dimension, double matrix[3][3])
{
    if (dimension == 2)
        ascc_rotation_matrix_2d(body->angle, matrix);
    else
        ascc_rotation_matrix(body->rotation, matrix);
}

static void turn(double matrix[3][3], size_t d, const double *own, double out[3])
{
    for (size_t c = 0; c < d; c++) {
        out[c] = 0;
        for (size_t k = 0; k < d; k++)
            out[c] += matrix[c][k] * own[k];
    }
}

/* The velocity of what lies at `arm` from the origin. */
static void velocity_at(const struct ascc_body *body, const double arm[3], double velocity[3])
{
    const double *const w = body->spin;
    for (int c = 0; c < 3; c++)
        velocity[c] = body->velocity[c] +
                      (w[(c + 1) % 3] * arm[(c + 2) % 3] - w[(c + 2) % 3] * arm[(c + 1) % 3]);
}

/* Where a point of the frame is, and what it does. */
static void place_point(const struct ascc_body *body, double matrix[3][3], size_t d,
                        const double *own, double position[3], double velocity[3])
{
    double arm[3] = {0, 0, 0};
    turn(matrix, d, own, arm);
    for (size_t c = 0; c < d; c++)
        position[c] = body->position[c] + arm[c];
    velocity_at(body, arm, velocity);
}

void ascc_body_place(const ascc_particles *particles, const struct ascc_body *body,
                     double *position, double *normal, double *velocity)
{
    const size_t d = ascc_particles_width(particles);
    size_t first, count;
    double matrix[3][3];
    ascc_body_rows(particles, body, &first, &count);
    matrix_of(body, particles->dimension, matrix);
    for (size_t k = first * d; k < (first + count) * d; k += d) {
        double at[3], by[3], towards[3];
        place_point(body, matrix, d, particles->wall_own_position + k, at, by);
        memcpy(position + k, at, d * sizeof *at);
        if (normal == NULL)
            continue;
        turn(matrix, d, particles->wall_own_normal + k, towards);
        memcpy(normal + k, towards, d * sizeof *towards);
        memcpy(velocity + k, by, d * sizeof *by);
    }
}

/* ---- What they received ---------------------------------------------------------------------- */

void ascc_body_add_torque(const ascc_particles *particles, struct ascc_body *body,
                          const int64_t *impulse, const int64_t *before)
{
    const size_t d = ascc_particles_width(particles);
    size_t first, count;
    ascc_body_rows(particles, body, &first, &count);
    for (size_t k = first * d; k < (first + count) * d; k += d) {
        double arm[3] = {0, 0, 0}, push[3] = {0, 0, 0};
        for (size_t c = 0; c < d; c++) {
            arm[c] = particles->wall_position[k + c] - body->position[c];
            push[c] = (double)impulse[k + c] * particles->quantum;
            if (before != NULL)
                push[c] = (double)(impulse[k + c] - before[k + c]) * particles->quantum;
        }
        for (int c = 0; c < 3; c++)
            body->torque[c] +=
                arm[(c + 1) % 3] * push[(c + 2) % 3] - arm[(c + 2) % 3] * push[(c + 1) % 3];
    }
}

/* The torque of points at rest, while they are where they were. */
static void settle_torque(const ascc_particles *particles, struct ascc_body *body)
{
    if (body->moved)
        return;
    memset(body->torque, 0, sizeof body->torque);
    ascc_body_add_torque(particles, body, particles->wall_impulse, NULL);
    body->moved = 1;
}

/* ---- Poses ----------------------------------------------------------------------------------- */

static ascc_status check_finite(const char *name, const char *member, const double *values,
                                int count, ascc_message *message)
{
    for (int c = 0; c < count; c++)
        if (!isfinite(values[c]))
            return ascc_fail(message, ASCC_ERROR_NOT_FINITE, "%s: %s component %d is %g", name,
                             member, c, ascc_readable(values[c]));
    return ASCC_OK;
}

static ascc_status check_numbers(const struct ascc_body *body, const char *name,
                                 ascc_message *message)
{
    ascc_status status = check_finite(name, "position", body->position, 3, message);
    if (status == ASCC_OK)
        status = check_finite(name, "rotation", body->rotation, 4, message);
    if (status == ASCC_OK)
        status = check_finite(name, "angle", &body->angle, 1, message);
    if (status == ASCC_OK)
        status = check_finite(name, "velocity", body->velocity, 3, message);
    if (status == ASCC_OK)
        status = check_finite(name, "spin", body->spin, 3, message);
    return status;
}

static bool is_flat(const struct ascc_body *body)
{
    return body->position[2] == 0 && body->velocity[2] == 0 && body->spin[0] == 0 &&
           body->spin[1] == 0 && body->rotation[0] == 0 && body->rotation[1] == 0 &&
           body->rotation[2] == 0 && (body->rotation[3] == 0 || body->rotation[3] == 1);
}

ascc_status ascc_body_check(struct ascc_body *body, int32_t dimension, double spacing,
                            const char *name, ascc_message *message)
{
    const ascc_status status = check_numbers(body, name, message);
    if (status != ASCC_OK)
        return status;
    if (dimension == 2 ? !is_flat(body) : body->angle != 0)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "%s: it has what %ldD does not have", name,
                         (long)dimension);
    if (!ascc_rotation_normalize(body->rotation))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT,
                         "%s: rotation (%g, %g, %g, %g) has not length 1", name, body->rotation[0],
                         body->rotation[1], body->rotation[2], body->rotation[3]);
    for (int c = 0; c < 3; c++) {
        if (fabs(body->position[c]) > ASCC_POSITION_LIMIT * spacing ||
            fabs(body->velocity[c]) > ASCC_POSITION_LIMIT * spacing)
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "%s: position or velocity component %d is beyond 2^40 spacings", name,
                             c);
        if (fabs(body->spin[c]) > ASCC_ANGLE_LIMIT || fabs(body->angle) > ASCC_ANGLE_LIMIT)
            return ascc_fail(message, ASCC_ERROR_RANGE, "%s: angle %g or spin %g is beyond 1e6",
                             name, body->angle, body->spin[c]);
    }
    return ASCC_OK;
}

/* A host's pose as that of a body, which otherwise stays as it is. */
static ascc_status read_pose(const ascc_particles *particles, const ascc_pose *given,
                             struct ascc_body *body, double *jump, ascc_message *message)
{
    ascc_pose pose = {0};
    if (given != NULL && !ascc_read_struct(&pose, sizeof pose, given, sizeof pose))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "pose: of a size not known here");
    memcpy(body->position, pose.position, sizeof pose.position);
    memcpy(body->rotation, pose.rotation, sizeof pose.rotation);
    memcpy(body->velocity, pose.velocity, sizeof pose.velocity);
    memcpy(body->spin, pose.spin, sizeof pose.spin);
    body->angle = pose.angle;
    *jump = pose.jump == 0 ? particles->spacing : pose.jump;
    if (!(*jump > 0))
        return ascc_fail(message, isnan(*jump) ? ASCC_ERROR_NOT_FINITE : ASCC_ERROR_ARGUMENT,
                         "pose: jump is %g", ascc_readable(*jump));
    return ascc_body_check(body, particles->dimension, particles->spacing, "pose", message);
}

/* Whether points given in the frame can be held, and are no farther than `jump` from rows that begin at `now`, if
 * there are some. */
static ascc_status check_points(const ascc_particles *particles, const struct ascc_body *body,
                                const double *own, size_t count, const double *now, double jump,
                                ascc_message *message)
{
    const size_t d = ascc_particles_width(particles);
    const double limit = ASCC_POSITION_LIMIT * particles->spacing;
    double matrix[3][3];
    matrix_of(body, particles->dimension, matrix);
    for (size_t row = 0; row < count; row++) {
        double at[3], by[3], square = 0;
        bool fits = true;
        place_point(body, matrix, d, own + row * d, at, by);
        for (size_t c = 0; c < d; c++) {
            const double way = now != NULL ? at[c] - now[row * d + c] : 0;
            square += way * way;
            fits &= fabs(at[c]) <= limit && fabs(by[c]) <= limit;
        }
        if (!fits)
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "pose: point %zu or its velocity would be beyond 2^40 spacings", row);
        if (!(sqrt(square) <= jump))
            return ascc_fail(message, ASCC_ERROR_RANGE,
                             "pose: point %zu would jump by %g, farther than %g (jump)", row,
                             sqrt(square), jump);
    }
    return ASCC_OK;
}

/* ---- Adding ---------------------------------------------------------------------------------- */

static ascc_status add_sampled(ascc_particles *particles, const ascc_surface *surface,
                               struct ascc_body *body, ascc_message *message)
{
    const size_t d = ascc_particles_width(particles), count = surface->count;
    const ascc_host_array positions = {"shape.position", (const unsigned char *)surface->position,
                                       (ptrdiff_t)(d * sizeof(double)), sizeof(double),
                                       ASCC_DOUBLE};
    ascc_host_array normals = positions;
    normals.name = "shape.normal";
    normals.data = (const unsigned char *)surface->normal;
    ascc_status status =
        ascc_field_check(particles, ASCC_FIELD_wall_position, &positions, count, message);
    if (status == ASCC_OK)
        status = ascc_field_check(particles, ASCC_FIELD_wall_normal, &normals, count, message);
    if (status == ASCC_OK)
        status = check_points(particles, body, surface->position, count, NULL, 0, message);
    if (status != ASCC_OK)
        return status;
    size_t first;
    if (!ascc_grow(&particles->context->allocator, (void **)&particles->bodies,
                   &particles->body_capacity, particles->body_count + 1, sizeof *body))
        return ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for one more body");
    status = ascc_particles_append_walls(particles, count, body->number, &first, message);
    if (status != ASCC_OK)
        return status;
    ascc_field_store(particles, ASCC_FIELD_wall_own_position, &positions, first, count);
    ascc_field_store(particles, ASCC_FIELD_wall_own_normal, &normals, first, count);
    body->first_id = particles->wall_id[first];
    body->end_id = particles->next_id;
    particles->bodies[particles->body_count++] = *body;
    ascc_body_place(particles, body, particles->wall_position, particles->wall_normal,
                    particles->wall_velocity);
    ascc_rest_disturb(particles, ASCC_BOUNDARY, first, count);
    return ASCC_OK;
}

static ascc_status add_body(ascc_particles *particles, const ascc_shape *given,
                            const ascc_pose *pose, int32_t *number, ascc_message *message)
{
    ascc_shape shape;
    if (given == NULL || !ascc_read_struct(&shape, sizeof shape, given, sizeof shape))
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "shape: NULL, or of a size not known here");
    if (number == NULL)
        return ascc_fail(message, ASCC_ERROR_ARGUMENT, "body: NULL");
    if (particles->next_body > INT32_MAX)
        return ascc_fail(message, ASCC_ERROR_RANGE, "body: no number above %ld is left",
                         (long)INT32_MAX);
    struct ascc_body body = {.number = (int32_t)particles->next_body};
    double jump;
    ascc_status status = read_pose(particles, pose, &body, &jump, message);
    if (status != ASCC_OK)
        return status;
    ascc_surface surface;
    ascc_surface_open(&surface, &particles->context->allocator, particles->dimension);
    status = ascc_shape_sample(&surface, &shape, particles->spacing, message);
    if (status == ASCC_OK)
        status = add_sampled(particles, &surface, &body, message);
    ascc_surface_close(&surface);
    if (status == ASCC_OK)
        *number = body.number;
    return status;
}

ascc_status ascc_body_add(ascc_particles *particles, const ascc_shape *shape, const ascc_pose *pose,
                          int32_t *body)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    const ascc_status status = add_body(particles, shape, pose, body, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

/* ---- Moving ---------------------------------------------------------------------------------- */

static ascc_status find_body(const ascc_particles *particles, int32_t number,
                             struct ascc_body **body, ascc_message *message)
{
    *body = ascc_bodies_find(particles, number);
    if (*body != NULL)
        return ASCC_OK;
    return ascc_fail(message, ASCC_ERROR_ARGUMENT, "body: none has the number %ld", (long)number);
}

static ascc_status move_body(ascc_particles *particles, int32_t number, const ascc_pose *pose,
                             ascc_message *message)
{
    const size_t d = ascc_particles_width(particles);
    struct ascc_body *body;
    size_t first, count;
    double jump;
    ascc_status status = find_body(particles, number, &body, message);
    if (status == ASCC_OK && pose == NULL)
        status = ascc_fail(message, ASCC_ERROR_ARGUMENT, "pose: NULL");
    if (status != ASCC_OK)
        return status;
    struct ascc_body moved = *body;
    status = read_pose(particles, pose, &moved, &jump, message);
    ascc_body_rows(particles, body, &first, &count);
    if (status == ASCC_OK)
        status = check_points(particles, &moved, particles->wall_own_position + first * d, count,
                              particles->wall_position + first * d, jump, message);
    if (status != ASCC_OK)
        return status;
    settle_torque(particles, body);
    memcpy(moved.torque, body->torque, sizeof moved.torque);
    moved.moved = 1;
    /* A pose that is not where it was; velocities wake fluid as they move the points. */
    const bool jumps = memcmp(moved.position, body->position, sizeof moved.position) != 0 ||
                       memcmp(moved.rotation, body->rotation, sizeof moved.rotation) != 0 ||
                       moved.angle != body->angle;
    if (jumps)
        ascc_rest_disturb(particles, ASCC_BOUNDARY, first, count);
    *body = moved;
    ascc_body_place(particles, body, particles->wall_position, particles->wall_normal,
                    particles->wall_velocity);
    if (jumps)
        ascc_rest_disturb(particles, ASCC_BOUNDARY, first, count);
    return ASCC_OK;
}

ascc_status ascc_body_move(ascc_particles *particles, int32_t body, const ascc_pose *pose)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    const ascc_status status = move_body(particles, body, pose, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

/* ---- Removing -------------------------------------------------------------------------------- */

static ascc_status remove_body(ascc_particles *particles, int32_t number, ascc_message *message)
{
    const ascc_allocator *const allocator = &particles->context->allocator;
    const size_t rows = particles->boundary_count;
    struct ascc_body *body;
    size_t first, count;
    const ascc_status status = find_body(particles, number, &body, message);
    if (status != ASCC_OK)
        return status;
    ascc_body_rows(particles, body, &first, &count);
    unsigned char *const marked = ascc_allocate(allocator, rows, 1);
    if (marked == NULL)
        return ascc_fail(message, ASCC_ERROR_MEMORY, "out of memory for removing body %ld",
                         (long)number);
    if (rows > 0) {
        memset(marked, 0, rows);
        memset(marked + first, 1, count);
    }
    ascc_rest_disturb(particles, ASCC_BOUNDARY, first, count);
    ascc_particles_drop_rows(particles, ASCC_BOUNDARY, marked);
    ascc_release(allocator, marked, rows, 1);
    const size_t index = (size_t)(body - particles->bodies);
    memmove(body, body + 1, (particles->body_count - index - 1) * sizeof *body);
    particles->body_count--;
    return ASCC_OK;
}

ascc_status ascc_body_remove(ascc_particles *particles, int32_t body)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    const ascc_status status = remove_body(particles, body, &message);
    return status == ASCC_OK ? status : ascc_particles_fail(particles, status, "%s", message.text);
}

/* ---- Reading --------------------------------------------------------------------------------- */

size_t ascc_bodies_list(const ascc_particles *particles, size_t capacity, int32_t *bodies)
{
    if (!ascc_particles_is_set(particles))
        return 0;
    for (size_t b = 0; b < particles->body_count && b < capacity && bodies != NULL; b++)
        bodies[b] = particles->bodies[b].number;
    return particles->body_count;
}

ascc_status ascc_body_get(const ascc_particles *particles, int32_t number, ascc_body_info *info)
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    struct ascc_body *body;
    ascc_message message;
    ascc_status status = find_body(particles, number, &body, &message);
    if (status != ASCC_OK)
        return ascc_particles_fail_reading(particles, status, "%s", message.text);
    ascc_body_info all = {.angle = body->angle};
    ascc_body_rows(particles, body, &all.first, &all.count);
    memcpy(all.position, body->position, sizeof all.position);
    memcpy(all.rotation, body->rotation, sizeof all.rotation);
    memcpy(all.velocity, body->velocity, sizeof all.velocity);
    memcpy(all.spin, body->spin, sizeof all.spin);
    if (info == NULL || !ascc_write_struct(info, &all, sizeof all, sizeof all))
        return ascc_particles_fail_reading(particles, ASCC_ERROR_ARGUMENT,
                                           "info: NULL, or of a size not known here");
    return ASCC_OK;
}

static ascc_status sum_body(const ascc_particles *particles, int32_t number, int64_t *impulse,
                            double *torque, ascc_message *message)
{
    struct ascc_body *body;
    size_t first, count;
    const ascc_status status = find_body(particles, number, &body, message);
    if (status != ASCC_OK)
        return status;
    ascc_body_rows(particles, body, &first, &count);
    if (impulse != NULL && !ascc_wall_impulse_sum(particles, first, count, impulse))
        return ascc_fail(message, ASCC_ERROR_RANGE,
                         "impulse: that of body %ld does not fit 64 bits", (long)number);
    struct ascc_body summed = *body;
    if (torque == NULL)
        return ASCC_OK;
    settle_torque(particles, &summed);
    memcpy(torque, summed.torque, sizeof summed.torque);
    return ASCC_OK;
}

ascc_status ascc_bodies_impulse(const ascc_particles *particles, size_t count,
                                const int32_t *bodies, int64_t (*impulse)[3], double (*torque)[3])
{
    ASCC_FLOAT_SCOPE;
    if (!ascc_particles_is_set(particles))
        return ASCC_ERROR_ARGUMENT;
    ascc_message message;
    ascc_status status = ASCC_OK;
    if (count > 0 && bodies == NULL)
        status = ascc_fail(&message, ASCC_ERROR_ARGUMENT, "bodies: NULL");
    /* Twice, so that a failure writes nothing: most calls are about a few bodies. */
    for (size_t b = 0; b < count && status == ASCC_OK; b++) {
        int64_t sum[3];
        status = sum_body(particles, bodies[b], sum, NULL, &message);
    }
    if (status != ASCC_OK)
        return ascc_particles_fail_reading(particles, status, "%s", message.text);
    for (size_t b = 0; b < count; b++)
        (void)sum_body(particles, bodies[b], impulse != NULL ? impulse[b] : NULL,
                       torque != NULL ? torque[b] : NULL, &message);
    return ASCC_OK;
}
