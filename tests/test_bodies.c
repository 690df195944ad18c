/* Bodies: where their points are, what carries them, what they are made of, what they received.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "support/counting.h"
#include "support/model_builder.h"
#include "support/random.h"
#include "support/test.h"

#define SPACING 0.05
#define MOST 20000
static const double pi = 3.14159265358979323846;

typedef struct fixture {
    test_memory memory;
    ascc_context *context;
    ascc_model *model[4]; /* [dimension] */
    ascc_particles *set[4];
    ascc_step *step[4];
} fixture;

static ascc_particles *new_set(ascc_context *context, int32_t dimension)
{
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = dimension, .spacing = SPACING, .mass = 0.125};
    ascc_particles *set;
    assert_int_equal(ascc_particles_create(context, &options, &set), ASCC_OK);
    return set;
}

static int open_fixture(void **state)
{
    fixture *self = calloc(1, sizeof *self);
    const ascc_context_options options = test_memory_options(&self->memory);
    assert_int_equal(ascc_context_create(&options, &self->context), ASCC_OK);
    for (int d = 2; d <= 3; d++) {
        const model_random kind = {.seed = 3,
                                   .dimension = d,
                                   .channels = 4,
                                   .bumps = 2,
                                   .order = 1,
                                   .fluid_only = 1,
                                   .motion = 1,
                                   .damping = 1,
                                   .walls = 1,
                                   .limit = 0.5,
                                   .contact = 0.4};
        size_t size;
        unsigned char *bytes = model_builder_random(&kind, &size);
        assert_int_equal(ascc_model_load_memory(self->context, bytes, size, &self->model[d]),
                         ASCC_OK);
        free(bytes);
        self->set[d] = new_set(self->context, d);
        assert_int_equal(ascc_step_create(self->context, self->model[d], NULL, &self->step[d]),
                         ASCC_OK);
    }
    *state = self;
    return 0;
}

static int close_fixture(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++) {
        ascc_step_destroy(&self->step[d]);
        ascc_particles_destroy(&self->set[d]);
        ascc_model_destroy(&self->model[d]);
    }
    ascc_context_destroy(&self->context);
    const bool clean = test_memory_is_clean(&self->memory);
    free(self);
    return clean ? 0 : 1;
}

static double time_step_of(const fixture *self, int d)
{
    ascc_model_info info = {.size = sizeof info};
    assert_int_equal(ascc_model_get_info(self->model[d], &info), ASCC_OK);
    return info.time_step;
}

static void read_field(const ascc_particles *set, ascc_field field, size_t first, size_t count,
                       double *into)
{
    const ascc_array to = {.data = into, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(set, ASCC_BOUNDARY, field, first, count, &to), ASCC_OK);
}

/* Some points of a body in its frame. */
#define OWN 7
static double own[3 * OWN], own_normal[3 * OWN];
static const ascc_const_array own_array = {.data = own, .scalar = ASCC_DOUBLE};
static const ascc_const_array normal_array = {.data = own_normal, .scalar = ASCC_DOUBLE};

static int32_t add_points(ascc_particles *set, int d, const ascc_pose *pose)
{
    test_random random = {5};
    for (int i = 0; i < OWN; i++) {
        double square = 0;
        for (int c = 0; c < d; c++) {
            own[i * d + c] = test_random_between(&random, -0.2, 0.2);
            own_normal[i * d + c] = test_random_between(&random, -1, 1);
            square += own_normal[i * d + c] * own_normal[i * d + c];
        }
        for (int c = 0; c < d; c++)
            own_normal[i * d + c] /= sqrt(square);
    }
    const ascc_shape shape = {
        .size = sizeof shape, .count = OWN, .position = &own_array, .normal = &normal_array};
    int32_t body = -1;
    if (ascc_body_add(set, &shape, pose, &body) != ASCC_OK)
        fail_msg("%s", ascc_particles_message(set));
    return body;
}

/* v turned by `angle` about a unit axis (Rodrigues). */
static void rotate(const double v[3], const double axis[3], double angle, double out[3])
{
    const double c = cos(angle), s = sin(angle);
    const double along = axis[0] * v[0] + axis[1] * v[1] + axis[2] * v[2];
    for (int k = 0; k < 3; k++) {
        const int i = (k + 1) % 3, j = (k + 2) % 3;
        out[k] = v[k] * c + (axis[i] * v[j] - axis[j] * v[i]) * s + axis[k] * along * (1 - c);
    }
}

/* Points are where the frame, turned by these, takes them: first about one axis, then about another. */
static void assert_placed(const ascc_particles *set, int d, int32_t body, const double position[3],
                          const double axis[2][3], const double angle[2], double tolerance)
{
    double at[3 * OWN], normal[3 * OWN];
    ascc_body_info info = {.size = sizeof info};
    assert_int_equal(ascc_body_get(set, body, &info), ASCC_OK);
    assert_int_equal(info.count, OWN);
    read_field(set, ASCC_POSITION, info.first, OWN, at);
    read_field(set, ASCC_NORMAL, info.first, OWN, normal);
    for (int i = 0; i < OWN; i++) {
        double v[3] = {0}, n[3] = {0}, v1[3], n1[3], v2[3], n2[3];
        memcpy(v, own + i * d, (size_t)d * sizeof *v);
        memcpy(n, own_normal + i * d, (size_t)d * sizeof *n);
        rotate(v, axis[0], angle[0], v1);
        rotate(v1, axis[1], angle[1], v2);
        rotate(n, axis[0], angle[0], n1);
        rotate(n1, axis[1], angle[1], n2);
        for (int c = 0; c < d; c++) {
            assert_true(fabs(at[i * d + c] - (position[c] + v2[c])) < tolerance);
            assert_true(fabs(normal[i * d + c] - n2[c]) < tolerance);
        }
    }
}

static ascc_pose some_pose(int d)
{
    ascc_pose pose = {.size = sizeof pose, .position = {1, -2, 0}, .velocity = {0.5, -0.25, 0}};
    if (d == 2) {
        pose.angle = 0.7;
        pose.spin[2] = -3;
        return pose;
    }
    pose.position[2] = 3;
    pose.velocity[2] = 1;
    pose.rotation[2] = sin(0.35); /* 0.7 about z */
    pose.rotation[3] = cos(0.35);
    pose.spin[0] = 2;
    pose.spin[1] = -1;
    pose.spin[2] = 2;
    return pose;
}

static const double spin_axis[3] = {2.0 / 3, -1.0 / 3, 2.0 / 3}; /* of 3 rad/s */

static void a_body_is_where_its_pose_says(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++) {
        const ascc_pose pose = some_pose(d);
        const int32_t body = add_points(self->set[d], d, &pose);
        assert_placed(self->set[d], d, body, pose.position,
                      (const double[2][3]){{0, 0, 1}, {0, 0, 1}}, (const double[2]){0.7, 0},
                      1e-15 * 8);
        /* Velocities are those of a solid. */
        double at[3 * OWN], velocity[3 * OWN];
        read_field(self->set[d], ASCC_POSITION, 0, OWN, at);
        read_field(self->set[d], ASCC_VELOCITY, 0, OWN, velocity);
        for (int i = 0; i < OWN; i++) {
            double arm[3] = {0};
            for (int c = 0; c < d; c++)
                arm[c] = at[i * d + c] - pose.position[c];
            for (int c = 0; c < d; c++) {
                const int j = (c + 1) % 3, k = (c + 2) % 3;
                const double want =
                    pose.velocity[c] + pose.spin[j] * arm[k] - pose.spin[k] * arm[j];
                assert_true(fabs(velocity[i * d + c] - want) < 1e-14);
            }
        }
    }
}

static void steps_carry_a_body_exactly(void **state)
{
    fixture *self = *state;
    const double x[3] = {9, 9, 9};
    const ascc_const_array fluid = {.data = x, .scalar = ASCC_DOUBLE};
    for (int d = 2; d <= 3; d++) {
        const ascc_pose pose = some_pose(d);
        ascc_particles *const set = self->set[d];
        const double dt = time_step_of(self, d);
        ascc_step *cut;
        const ascc_step_options options = {.size = sizeof options, .time_step = 5 * dt};
        assert_int_equal(ascc_step_create(self->context, self->model[d], &options, &cut), ASCC_OK);
        const int32_t body = add_points(set, d, &pose);
        assert_int_equal(ascc_particles_add_fluid(set, 1, &fluid, NULL, NULL, NULL), ASCC_OK);
        if (ascc_step_run(self->step[d], set, NULL, 45) != ASCC_OK)
            fail_msg("%s", ascc_step_message(self->step[d]));
        assert_int_equal(ascc_step_run(cut, set, NULL, 11), ASCC_OK);
        const double seconds = 100 * dt, angle = (d == 2 ? -3 : 3) * seconds;
        double position[3];
        for (int c = 0; c < 3; c++)
            position[c] = pose.position[c] + seconds * pose.velocity[c];
        const double axes[2][3] = {
            {0, 0, 1},
            {d == 2 ? 0 : spin_axis[0], d == 2 ? 0 : spin_axis[1], d == 2 ? 1 : spin_axis[2]}};
        assert_placed(set, d, body, position, axes, (const double[2]){0.7, angle}, 1e-12);
        ascc_body_info info = {.size = sizeof info};
        assert_int_equal(ascc_body_get(set, body, &info), ASCC_OK);
        for (int c = 0; c < d; c++)
            assert_true(fabs(info.position[c] - position[c]) < 1e-13);
        /* And what it tells is a pose for it, which changes nothing. */
        const uint64_t hash = ascc_particles_hash(set);
        ascc_pose same = {.size = sizeof same, .angle = info.angle, .jump = 1e-300};
        memcpy(same.position, info.position, sizeof same.position);
        memcpy(same.rotation, info.rotation, sizeof same.rotation);
        memcpy(same.velocity, info.velocity, sizeof same.velocity);
        memcpy(same.spin, info.spin, sizeof same.spin);
        assert_int_equal(ascc_body_move(set, body, &same), ASCC_OK);
        assert_true(ascc_particles_hash(set) == hash);
        ascc_step_destroy(&cut);
    }
}

static void a_failed_step_leaves_bodies_where_they_were(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[2];
    const double x[2] = {9, 9}, dt = time_step_of(self, 2);
    const ascc_const_array fluid = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_step_options options = {.size = sizeof options, .time_step = 5 * dt};
    ascc_pose pose = some_pose(2);
    ascc_step *cut;
    assert_int_equal(ascc_step_create(self->context, self->model[2], &options, &cut), ASCC_OK);
    pose.angle =
        1e6 + 3.5 * dt * pose.spin[2]; /* beyond what is held in the fourth substep of five */
    pose.spin[2] = -pose.spin[2];
    (void)add_points(set, 2, &pose);
    assert_int_equal(ascc_particles_add_fluid(set, 1, &fluid, NULL, NULL, NULL), ASCC_OK);
    const uint64_t hash = ascc_particles_hash(set);
    assert_int_equal(ascc_step_run(cut, set, NULL, 1), ASCC_ERROR_RANGE);
    assert_non_null(strstr(ascc_step_message(cut), "body 0 moves or turns beyond"));
    assert_true(ascc_particles_hash(set) == hash);
    ascc_step_destroy(&cut);
}

/* ---- Wrong calls ---- */

typedef enum damage {
    ROTATION_LONG,
    ROTATION_NAN,
    POSITION_NAN,
    VELOCITY_INFINITE,
    SPIN_HUGE,
    JUMP_FAR,
    JUMP_NEGATIVE,
    OTHER_DIMENSION,
    FAR_AWAY,
    SIZE,
    DAMAGES
} damage;

static void spoil(ascc_pose *pose, damage how, int d)
{
    switch (how) {
    case ROTATION_LONG:
        pose->rotation[0] = 1.1;
        break;
    case ROTATION_NAN:
        pose->rotation[1] = (double)NAN;
        break;
    case POSITION_NAN:
        pose->position[1] = (double)NAN;
        break;
    case VELOCITY_INFINITE:
        pose->velocity[0] = (double)INFINITY;
        break;
    case SPIN_HUGE:
        pose->spin[2] = 1e7;
        break;
    case JUMP_FAR:
        pose->position[0] += 1.001 * SPACING;
        break;
    case JUMP_NEGATIVE:
        pose->jump = -1;
        break;
    case OTHER_DIMENSION:
        if (d == 2)
            pose->spin[0] = 1;
        else
            pose->angle = 1;
        break;
    case FAR_AWAY:
        pose->jump = (double)INFINITY;
        pose->position[0] = 1e13 * SPACING;
        break;
    default:
        pose->size = 8;
        break;
    }
}

static void a_wrong_pose_is_named_and_nothing_has_changed(void **state)
{
    fixture *self = *state;
    static const char *const said[DAMAGES] = {"rotation",
                                              "rotation component 1",
                                              "position component 1",
                                              "velocity component 0",
                                              "spin",
                                              "jump",
                                              "jump",
                                              "does not have",
                                              "2^40",
                                              "pose"};
    static const ascc_status status[DAMAGES] = {
        ASCC_ERROR_ARGUMENT, ASCC_ERROR_NOT_FINITE, ASCC_ERROR_NOT_FINITE, ASCC_ERROR_NOT_FINITE,
        ASCC_ERROR_RANGE,    ASCC_ERROR_RANGE,      ASCC_ERROR_ARGUMENT,   ASCC_ERROR_ARGUMENT,
        ASCC_ERROR_RANGE,    ASCC_ERROR_ARGUMENT};
    for (int d = 2; d <= 3; d++) {
        ascc_particles *const set = self->set[d];
        const ascc_pose pose = some_pose(d);
        const int32_t body = add_points(set, d, &pose);
        const uint64_t hash = ascc_particles_hash(set);
        for (damage how = 0; how < DAMAGES; how++) {
            ascc_pose wrong = pose;
            spoil(&wrong, how, d);
            if (how == ROTATION_LONG && d == 2)
                continue; /* said in other words */
            assert_int_equal(ascc_body_move(set, body, &wrong), status[how]);
            assert_non_null(strstr(ascc_particles_message(set), said[how]));
            assert_true(ascc_particles_hash(set) == hash);
            if (how == JUMP_FAR || how == JUMP_NEGATIVE)
                continue; /* where nothing is yet, nothing jumps */
            int32_t number = -7;
            const ascc_shape shape = {.size = sizeof shape,
                                      .count = OWN,
                                      .position = &own_array,
                                      .normal = &normal_array};
            assert_int_equal(ascc_body_add(set, &shape, &wrong, &number), status[how]);
            assert_int_equal(number, -7);
            assert_true(ascc_particles_hash(set) == hash);
        }
        ascc_pose right = pose;
        right.position[0] += 0.999 * SPACING;
        assert_int_equal(ascc_body_move(set, body, &right), ASCC_OK);
        right.position[0] += 1000;
        right.jump = (double)INFINITY;
        assert_int_equal(ascc_body_move(set, body, &right), ASCC_OK);
        assert_int_equal(ascc_body_move(set, body + 1, &right), ASCC_ERROR_ARGUMENT);
        assert_non_null(strstr(ascc_particles_message(set), "none has the number 1"));
        assert_int_equal(ascc_body_move(set, body, NULL), ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_body_remove(set, 9), ASCC_ERROR_ARGUMENT);
        ascc_body_info info = {.size = sizeof info};
        assert_int_equal(ascc_body_get(set, 9, &info), ASCC_ERROR_ARGUMENT);
        assert_int_equal(ascc_body_get(set, body, NULL), ASCC_ERROR_ARGUMENT);
    }
}

static void a_wrong_shape_is_named_and_nothing_was_added(void **state)
{
    fixture *self = *state;
    static const int32_t beyond[3] = {0, 1, 3}, flat[3] = {0, 1, 1}, whole[3] = {0, 1, 2};
    static const double corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
    static const double bad_corners[9] = {0, 0, 0, 1, NAN, 0, 0, 1, 0};
    static const ascc_const_array corner = {.data = corners, .scalar = ASCC_DOUBLE};
    static const ascc_const_array bad_corner = {.data = bad_corners, .scalar = ASCC_DOUBLE};
    static const double long_normal[9] = {2, 0, 0};
    static const ascc_const_array long_array = {.data = long_normal, .scalar = ASCC_DOUBLE};
#define MESH .kind = ASCC_SHAPE_MESH, .count = 3, .face_count = 1
    const struct {
        ascc_shape shape;
        ascc_status status;
        const char *said;
    } cases[] = {
        {{.kind = (ascc_shape_kind)9}, ASCC_ERROR_ARGUMENT, "kind"},
        {{.kind = ASCC_SHAPE_SPHERE}, ASCC_ERROR_ARGUMENT, "radius is 0"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = (double)NAN}, ASCC_ERROR_NOT_FINITE, "radius"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1, .water = (ascc_water)3},
         ASCC_ERROR_ARGUMENT,
         "water"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1, .open = 1}, ASCC_ERROR_ARGUMENT, "open"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1, .reserved = 1}, ASCC_ERROR_ARGUMENT, "reserved"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1, .pitch = -1}, ASCC_ERROR_ARGUMENT, "pitch"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1, .inset = 1}, ASCC_ERROR_ARGUMENT, "inset"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 0.01, .inset = 0.01}, ASCC_ERROR_ARGUMENT, "inset"},
        {{.kind = ASCC_SHAPE_SPHERE, .radius = 1e9}, ASCC_ERROR_RANGE, "2^26"},
        {{.kind = ASCC_SHAPE_BOX, .half = {1, -1, 1}}, ASCC_ERROR_ARGUMENT, "half[1]"},
        {{.kind = ASCC_SHAPE_BOX, .half = {1, 1, 1}, .open = 64}, ASCC_ERROR_ARGUMENT, "open"},
        {{.kind = ASCC_SHAPE_BOX, .half = {1, 1, 1}, .open = 63}, ASCC_ERROR_ARGUMENT, "no points"},
        {{.kind = ASCC_SHAPE_CAPSULE, .radius = 1}, ASCC_ERROR_ARGUMENT, "half[1]"},
        {{.kind = ASCC_SHAPE_POINTS}, ASCC_ERROR_ARGUMENT, "shape.position"},
        {{.kind = ASCC_SHAPE_POINTS, .count = 1, .position = &corner, .normal = &long_array},
         ASCC_ERROR_ARGUMENT,
         "shape.normal: row 0 has length 2"},
        {{.kind = ASCC_SHAPE_POINTS, .count = 3, .position = &bad_corner, .normal = &corner},
         ASCC_ERROR_NOT_FINITE,
         "shape.position: row 1"},
        {{MESH, .position = &corner}, ASCC_ERROR_ARGUMENT, "without faces"},
        {{MESH, .position = &corner, .faces = beyond}, ASCC_ERROR_ARGUMENT, "corner 3 of 3"},
        {{MESH, .position = &corner, .faces = flat}, ASCC_ERROR_ARGUMENT, "no points"},
        {{MESH, .position = &bad_corner, .faces = beyond},
         ASCC_ERROR_NOT_FINITE,
         "row 1 component 1"},
        {{MESH, .position = &corner, .faces = whole, .pitch = 1e-9}, ASCC_ERROR_RANGE, "shape"},
    };
    ascc_particles *const set = self->set[3];
    const uint64_t hash = ascc_particles_hash(set);
    int32_t body = -7;
    for (size_t i = 0; i < COUNT_OF(cases); i++) {
        ascc_shape shape = cases[i].shape;
        shape.size = sizeof shape;
        const ascc_status status = ascc_body_add(set, &shape, NULL, &body);
        if (status != cases[i].status || !strstr(ascc_particles_message(set), cases[i].said))
            fail_msg("case %zu: %d, '%s'", i, (int)status, ascc_particles_message(set));
        assert_true(ascc_particles_hash(set) == hash);
        assert_int_equal(ascc_bodies_list(set, 0, NULL), 0);
    }
    assert_int_equal(body, -7);
    assert_int_equal(ascc_body_add(set, NULL, NULL, &body), ASCC_ERROR_ARGUMENT);
    const ascc_shape good = {.size = sizeof good, .kind = ASCC_SHAPE_SPHERE, .radius = 0.1};
    assert_int_equal(ascc_body_add(set, &good, NULL, NULL), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_body_add(NULL, &good, NULL, &body), ASCC_ERROR_ARGUMENT);
}

static void every_failing_allocation_is_told_and_changes_nothing(void **state)
{
    fixture *self = *state;
    static const double corners[12] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1};
    static const ascc_const_array corner = {.data = corners, .scalar = ASCC_DOUBLE};
    static const int32_t faces[6] = {0, 1, 2, 0, 2, 3};
    const ascc_shape mesh = {.size = sizeof mesh,
                             .kind = ASCC_SHAPE_MESH,
                             .count = 4,
                             .position = &corner,
                             .face_count = 2,
                             .faces = faces};
    size_t tries = 0, done = 0;
    for (; !done; tries++) {
        ascc_particles *set = new_set(self->context, 3);
        int32_t body;
        (void)add_points(set, 3, NULL);
        const uint64_t hash = ascc_particles_hash(set);
        self->memory.fail_at = self->memory.calls + 1 + tries;
        const ascc_status status = ascc_body_add(set, &mesh, NULL, &body);
        done = self->memory.calls < self->memory.fail_at;
        self->memory.fail_at = 0;
        assert_int_equal(status, done ? ASCC_OK : ASCC_ERROR_MEMORY);
        assert_true(done || ascc_particles_hash(set) == hash);
        self->memory.fail_at = self->memory.calls + 1;
        assert_int_equal(ascc_body_remove(set, 0), ASCC_ERROR_MEMORY);
        self->memory.fail_at = 0;
        assert_int_equal(ascc_bodies_list(set, 0, NULL), done ? 2 : 1);
        ascc_particles_destroy(&set);
    }
    assert_true(tries > 5);
}

/* ---- Numbers and rows ---- */

static void numbers_are_never_given_again(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[3];
    int32_t list[4];
    ascc_body_info info = {.size = sizeof info};
    assert_int_equal(add_points(set, 3, NULL), 0);
    assert_int_equal(ascc_particles_add_boundary(set, 2, &own_array, &normal_array, 4, NULL),
                     ASCC_OK);
    assert_int_equal(add_points(set, 3, NULL), 5);
    assert_int_equal(add_points(set, 3, NULL), 6);
    assert_int_equal(ascc_body_remove(set, 5), ASCC_OK);
    assert_int_equal(ascc_particles_count(set, ASCC_BOUNDARY), 2 * OWN + 2);
    assert_int_equal(ascc_bodies_list(set, 4, list), 2);
    assert_int_equal(list[0], 0);
    assert_int_equal(list[1], 6);
    assert_int_equal(ascc_body_get(set, 6, &info), ASCC_OK);
    assert_int_equal(info.first, OWN + 2);
    assert_int_equal(info.count, OWN);
    assert_int_equal(ascc_body_remove(set, 6), ASCC_OK);
    assert_int_equal(add_points(set, 3, NULL), 7);
    /* The points of a body are its own, until they are removed. */
    assert_int_equal(ascc_particles_add_boundary(set, 1, &own_array, &normal_array, 7, NULL),
                     ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_particles_set(set, ASCC_BOUNDARY, ASCC_POSITION, OWN, 3, &own_array),
                     ASCC_ERROR_ARGUMENT);
    assert_non_null(strstr(ascc_particles_message(set), "row 9 is of body 7"));
    assert_int_equal(ascc_particles_set(set, ASCC_BOUNDARY, ASCC_POSITION, OWN, 2, &own_array),
                     ASCC_OK);
    uint64_t ids[3];
    assert_int_equal(ascc_particles_get_ids(set, ASCC_BOUNDARY, OWN + 1, 3, ids), ASCC_OK);
    assert_int_equal(ascc_particles_remove(set, 3, ids), ASCC_OK);
    assert_int_equal(ascc_body_get(set, 7, &info), ASCC_OK);
    assert_int_equal(info.first, OWN + 1);
    assert_int_equal(info.count, OWN - 2);
    assert_int_equal(ascc_particles_clear(set, ASCC_BOUNDARY), ASCC_OK);
    assert_int_equal(ascc_bodies_list(set, 4, list), 0);
    assert_int_equal(ascc_body_get(set, 7, &info), ASCC_ERROR_ARGUMENT);
}

/* ---- Impulses ---- */

/* Fluid around points that push it. */
static void add_scene(ascc_particles *set, int d, bool moving, int32_t body[2])
{
    test_random random = {8};
    double x[3 * 40];
    const ascc_const_array fluid = {.data = x, .scalar = ASCC_DOUBLE};
    for (int k = 0; k < 40 * d; k++)
        x[k] = test_random_between(&random, -0.25, 0.25);
    assert_int_equal(ascc_particles_add_fluid(set, 40, &fluid, NULL, NULL, NULL), ASCC_OK);
    for (int b = 0; b < 2; b++) {
        ascc_pose pose = some_pose(d);
        pose.position[0] = 0.1 * b;
        pose.position[1] = pose.position[2] = 0;
        if (!moving) {
            memset(pose.velocity, 0, sizeof pose.velocity);
            memset(pose.spin, 0, sizeof pose.spin);
        }
        body[b] = add_points(set, d, &pose);
    }
}

static void impulses_of_bodies_are_those_of_their_points(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++)
        for (int moving = 0; moving < 2; moving++) {
            ascc_particles *const set = new_set(self->context, d);
            int32_t body[2];
            int64_t impulse[2][3], one[3], sum[3] = {0};
            double torque[2][3], turn[3], sum_torque[2][3] = {{0}};
            add_scene(set, d, moving, body);
            const size_t size = ascc_particles_snapshot_size(set);
            unsigned char *const begun = malloc(size);
            assert_int_equal(ascc_particles_snapshot(set, begun, size), ASCC_OK);
            double largest = 0;
            for (int n = 0; n < 3; n++) { /* step by step, with points where each began */
                ascc_body_info info[2] = {{.size = sizeof info[0]}, {.size = sizeof info[0]}};
                double at[2][3 * OWN];
                for (int b = 0; b < 2; b++) {
                    assert_int_equal(ascc_body_get(set, body[b], &info[b]), ASCC_OK);
                    read_field(set, ASCC_POSITION, info[b].first, OWN, at[b]);
                }
                assert_int_equal(ascc_step_run(self->step[d], set, NULL, 1), ASCC_OK);
                assert_int_equal(ascc_bodies_impulse(set, 2, body, impulse, torque), ASCC_OK);
                for (int b = 0; b < 2; b++) {
                    assert_int_equal(
                        ascc_particles_body_impulse(set, body[b], info[b].position, one, turn),
                        ASCC_OK);
                    assert_memory_equal(one, impulse[b], sizeof one);
                    for (int c = 0; c < 3; c++) {
                        largest = fmax(largest, fabs(torque[b][c]));
                        sum[c] += one[c];
                        sum_torque[b][c] += torque[b][c];
                        if (!moving)
                            assert_true(fabs(turn[c] - torque[b][c]) <= 1e-12 * largest);
                    }
                }
            }
            assert_true(largest > 0);
            const uint64_t hash = ascc_particles_hash(set);
            /* And in one run: the sums. */
            assert_int_equal(ascc_particles_restore(set, begun, size), ASCC_OK);
            assert_int_equal(ascc_step_run(self->step[d], set, NULL, 3), ASCC_OK);
            assert_true(ascc_particles_hash(set) == hash);
            assert_int_equal(ascc_bodies_impulse(set, 2, body, impulse, torque), ASCC_OK);
            for (int c = 0; c < 3; c++) {
                assert_true(impulse[0][c] + impulse[1][c] == sum[c]);
                for (int b = 0; b < 2; b++)
                    assert_true(fabs(torque[b][c] - sum_torque[b][c]) <= 1e-12 * largest);
            }
            /* Which a new pose leaves as it is. */
            double later[3];
            ascc_pose pose = {.size = sizeof pose, .position = {7, 7, 0}, .jump = (double)INFINITY};
            assert_int_equal(ascc_body_move(set, body[1], &pose), ASCC_OK);
            assert_int_equal(ascc_bodies_impulse(set, 1, &body[1], NULL, &later), ASCC_OK);
            assert_memory_equal(later, torque[1], sizeof later);
            const int32_t wrong[2] = {body[0], 99};
            assert_int_equal(ascc_bodies_impulse(set, 2, wrong, impulse, torque),
                             ASCC_ERROR_ARGUMENT);
            ascc_particles *old = set;
            ascc_particles_destroy(&old);
            free(begun);
        }
}

/* ---- Snapshots ---- */

static void a_restored_body_goes_on_bit_for_bit(void **state)
{
    fixture *self = *state;
    for (int d = 2; d <= 3; d++) {
        ascc_particles *const set = self->set[d];
        int32_t body[2], list[2];
        double torque[2][3], restored[2][3];
        add_scene(set, d, true, body);
        assert_int_equal(ascc_step_run(self->step[d], set, NULL, 2), ASCC_OK);
        assert_int_equal(ascc_bodies_impulse(set, 2, body, NULL, torque), ASCC_OK);
        const size_t size = ascc_particles_snapshot_size(set);
        unsigned char *const bytes = malloc(size), *const again = malloc(size);
        assert_int_equal(ascc_particles_snapshot(set, bytes, size), ASCC_OK);
        ascc_particles *twin = new_set(self->context, d);
        assert_int_equal(ascc_particles_restore(twin, bytes, size), ASCC_OK);
        assert_true(ascc_particles_hash(twin) == ascc_particles_hash(set));
        assert_int_equal(ascc_particles_snapshot(twin, again, size), ASCC_OK);
        assert_memory_equal(bytes, again, size);
        assert_int_equal(ascc_bodies_list(twin, 2, list), 2);
        assert_memory_equal(list, body, sizeof list);
        assert_int_equal(ascc_bodies_impulse(twin, 2, body, NULL, restored), ASCC_OK);
        assert_memory_equal(torque, restored, sizeof torque);
        assert_int_equal(ascc_step_run(self->step[d], set, NULL, 3), ASCC_OK);
        assert_int_equal(ascc_step_run(self->step[d], twin, NULL, 3), ASCC_OK);
        assert_true(ascc_particles_hash(twin) == ascc_particles_hash(set));
        assert_int_equal(add_points(twin, d, NULL), 2);
        /* Back to before there were any. */
        ascc_particles *empty = new_set(self->context, d);
        const size_t none = ascc_particles_snapshot_size(empty);
        assert_int_equal(ascc_particles_snapshot(empty, again, none), ASCC_OK);
        assert_int_equal(ascc_particles_restore(twin, again, none), ASCC_OK);
        assert_int_equal(ascc_bodies_list(twin, 0, NULL), 0);
        ascc_particles_destroy(&empty);
        ascc_particles_destroy(&twin);
        free(again);
        free(bytes);
    }
}

static void the_hash_sees_how_a_body_moves(void **state)
{
    fixture *self = *state;
    ascc_particles *const set = self->set[3];
    const ascc_pose pose = some_pose(3);
    const int32_t body = add_points(set, 3, &pose);
    const uint64_t hash = ascc_particles_hash(set);
    for (int k = 0; k < 6; k++) {
        ascc_pose other = pose;
        (k < 3 ? other.velocity : other.spin)[k % 3] += 1;
        assert_int_equal(ascc_body_move(set, body, &other), ASCC_OK);
        assert_true(ascc_particles_hash(set) != hash);
    }
    assert_int_equal(ascc_body_move(set, body, &pose), ASCC_OK);
    assert_true(ascc_particles_hash(set) == hash);
}

/* ---- Shapes ---- */

/* Signed distance from the surfaces, positive outside, for shapes with x, y, z half extents or a radius. */
static double distance(const ascc_shape *shape, int d, const double p[3])
{
    if (shape->kind == ASCC_SHAPE_SPHERE) {
        return sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2]) - shape->radius;
    }
    const double across = d == 2 ? fabs(p[0]) : hypot(p[0], p[2]);
    if (shape->kind == ASCC_SHAPE_CAPSULE)
        return hypot(across, fmax(fabs(p[1]) - shape->half[1], 0)) - shape->radius;
    double q[3] = {0, 0, 0}, outside = 0, inside = -INFINITY;
    int n = d;
    if (shape->kind == ASCC_SHAPE_CYLINDER) {
        q[0] = across - shape->radius;
        q[1] = fabs(p[1]) - shape->half[1];
        n = 2;
    } else {
        for (int c = 0; c < d; c++)
            q[c] = fabs(p[c]) - shape->half[c];
    }
    for (int c = 0; c < n; c++) {
        outside += fmax(q[c], 0) * fmax(q[c], 0);
        inside = fmax(inside, q[c]);
    }
    return outside > 0 ? sqrt(outside) : inside;
}

static double area(const ascc_shape *shape, int d)
{
    const double r = shape->radius, *h = shape->half;
    switch (shape->kind) {
    case ASCC_SHAPE_BOX:
        return d == 2 ? 4 * (h[0] + h[1]) : 8 * (h[0] * h[1] + h[1] * h[2] + h[2] * h[0]);
    case ASCC_SHAPE_SPHERE:
        return d == 2 ? 2 * pi * r : 4 * pi * r * r;
    case ASCC_SHAPE_CAPSULE:
        return d == 2 ? 2 * pi * r + 4 * h[1] : 4 * pi * r * r + 4 * pi * r * h[1];
    default:
        return d == 2 ? 4 * r + 4 * h[1] : 2 * pi * r * r + 4 * pi * r * h[1];
    }
}

static double nearest(const double *points, size_t count, int d, const double p[3], size_t except)
{
    double best = INFINITY;
    for (size_t i = 0; i < count; i++) {
        double square = 0;
        for (int c = 0; c < d; c++)
            square += (points[i * (size_t)d + (size_t)c] - p[c]) *
                      (points[i * (size_t)d + (size_t)c] - p[c]);
        if (i != except && square < best)
            best = square;
    }
    return sqrt(best);
}

static void points_of_shapes_cover_them_evenly(void **state)
{
    fixture *self = *state;
    static double at[3 * MOST], normal[3 * MOST];
    for (int d = 2; d <= 3; d++)
        for (int kind = ASCC_SHAPE_BOX; kind <= ASCC_SHAPE_CYLINDER; kind++)
            for (int side = 0; side < 2; side++)
                for (int inset = 0; inset < 2; inset++) {
                    ascc_particles *set = new_set(self->context, d);
                    ascc_shape shape = {.size = sizeof shape,
                                        .kind = (ascc_shape_kind)kind,
                                        .water = (ascc_water)side,
                                        .half = {0.31, 0.23, 0.17},
                                        .radius = 0.27,
                                        .inset = inset * 0.02};
                    const double pitch = 0.64 * SPACING, sign = side ? -1 : 1;
                    const double behind = inset  ? shape.inset
                                          : side ? 0
                                                 : (d == 2 ? 1.0 : 0.6) * SPACING;
                    int32_t body;
                    assert_int_equal(ascc_body_add(set, &shape, NULL, &body), ASCC_OK);
                    const size_t n = ascc_particles_count(set, ASCC_BOUNDARY);
                    assert_true(n < MOST);
                    read_field(set, ASCC_POSITION, 0, n, at);
                    read_field(set, ASCC_NORMAL, 0, n, normal);
                    ascc_shape moved = shape; /* the surface that points are on */
                    for (int c = 0; c < 3; c++)
                        moved.half[c] -= kind == ASCC_SHAPE_CAPSULE ? 0 : sign * behind;
                    moved.radius -= sign * behind;
                    const double whole = area(&moved, d) / pow(pitch, d - 1);
                    assert_true((double)n > 0.95 * whole && (double)n < 1.35 * whole + 8);
                    test_random random = {4};
                    for (size_t i = 0; i < n; i++) {
                        double p[3] = {0}, out[3] = {0};
                        memcpy(p, at + i * (size_t)d, (size_t)d * sizeof *p);
                        for (int c = 0; c < d; c++)
                            out[c] = p[c] + 1e-3 * sign * normal[i * (size_t)d + (size_t)c];
                        assert_true(fabs(distance(&moved, d, p)) < 1e-12);
                        assert_true(fabs(distance(&moved, d, out) - 1e-3) < 1e-6);
                        assert_true(nearest(at, n, d, p, i) > 0.25 * pitch);
                    }
                    for (int tries = 0; tries < 2000; tries++) { /* no hole between them */
                        double p[3] = {0};
                        for (int c = 0; c < d; c++)
                            p[c] = test_random_between(&random, -0.6, 0.6);
                        const double off = distance(&moved, d, p);
                        if (fabs(off) < 0.1 * pitch)
                            assert_true(nearest(at, n, d, p, n) < 0.95 * pitch);
                    }
                    ascc_particles_destroy(&set);
                }
}

static void a_plane_and_open_boxes_leave_away_what_they_say(void **state)
{
    fixture *self = *state;
    static double at[3 * MOST], normal[3 * MOST];
    for (int d = 2; d <= 3; d++) {
        ascc_particles *const set = self->set[d];
        int32_t body;
        ascc_body_info info = {.size = sizeof info};
        const ascc_shape plane = {.size = sizeof plane,
                                  .kind = ASCC_SHAPE_PLANE,
                                  .half = {0.5, 0, 0.25},
                                  .pitch = SPACING};
        assert_int_equal(ascc_body_add(set, &plane, NULL, &body), ASCC_OK);
        assert_int_equal(ascc_body_get(set, body, &info), ASCC_OK);
        assert_int_equal(info.count, d == 2 ? 20 : 200);
        read_field(set, ASCC_NORMAL, 0, info.count, normal);
        for (size_t i = 0; i < info.count; i++)
            assert_true(normal[i * (size_t)d + 1] == 1);
        ascc_shape cup = {.size = sizeof cup,
                          .kind = ASCC_SHAPE_BOX,
                          .water = ASCC_WATER_BOTH,
                          .half = {0.2, 0.2, 0.2},
                          .open = 8,
                          .pitch = SPACING};
        assert_int_equal(ascc_body_add(set, &cup, NULL, &body), ASCC_OK);
        assert_int_equal(ascc_body_get(set, body, &info), ASCC_OK);
        assert_int_equal(info.count, d == 2 ? 2 * 3 * 8 : 2 * 5 * 64);
        read_field(set, ASCC_POSITION, info.first, info.count, at);
        read_field(set, ASCC_NORMAL, info.first, info.count, normal);
        int up = 0, down = 0;
        for (size_t i = 0; i < info.count; i++) {
            assert_true(at[i * (size_t)d + 1] < 0.19);
            up += normal[i * (size_t)d + 1] == 1;
            down += normal[i * (size_t)d + 1] == -1;
        }
        assert_int_equal(up, d == 2 ? 8 : 64);
        assert_int_equal(down, up);
    }
}

/* A cube of triangles, each face cut into n x n squares. */
static size_t add_cube(ascc_particles *set, int n, double half)
{
    static float corner[6 * 41 * 41][3];
    static int32_t face[6 * 40 * 40 * 2][3];
    size_t corners = 0, faces = 0;
    assert_true(n <= 40);
    for (int f = 0; f < 6; f++) {
        const int axis = f / 2, sign = f % 2 ? 1 : -1;
        const int32_t base = (int32_t)corners;
        for (int j = 0; j <= n; j++)
            for (int i = 0; i <= n; i++, corners++) {
                corner[corners][axis] = (float)(sign * half);
                corner[corners][(axis + 1) % 3] = (float)(half * (2.0 * i / n - 1));
                corner[corners][(axis + 2) % 3] = (float)(half * (2.0 * j / n - 1));
            }
        for (int j = 0; j < n; j++)
            for (int i = 0; i < n; i++) {
                const int32_t a = base + j * (n + 1) + i, b = a + 1, c = a + n + 1, e = c + 1;
                const int32_t two[2][3] = {{a, b, e}, {a, e, c}};
                for (int k = 0; k < 2; k++, faces++)
                    for (int m = 0; m < 3; m++)
                        face[faces][m] = two[k][sign > 0 ? m : 2 - m];
            }
    }
    const ascc_const_array array = {.data = corner};
    const ascc_shape mesh = {.size = sizeof mesh,
                             .kind = ASCC_SHAPE_MESH,
                             .count = corners,
                             .position = &array,
                             .face_count = faces,
                             .faces = &face[0][0]};
    int32_t body;
    ascc_body_info info = {.size = sizeof info};
    assert_int_equal(ascc_body_add(set, &mesh, NULL, &body), ASCC_OK);
    assert_int_equal(ascc_body_get(set, body, &info), ASCC_OK);
    return info.count;
}

static void a_mesh_has_points_as_its_surface_asks_not_as_its_faces_do(void **state)
{
    fixture *self = *state;
    static double at[3 * MOST], normal[3 * MOST];
    const double half = 0.3, pitch = 0.64 * SPACING;
    const double whole = 24 * half * half / (pitch * pitch);
    const int cuts[3] = {1, 7, 40};
    for (int k = 0; k < 3; k++) {
        ascc_particles *set = new_set(self->context, 3);
        const size_t n = add_cube(set, cuts[k], half);
        const ascc_shape box = {.kind = ASCC_SHAPE_BOX, .half = {half, half, half}};
        test_random random = {4};
        if ((double)n < 0.8 * whole || (double)n > 1.9 * whole)
            fail_msg("%zu points where %g are wanted", n, whole);
        read_field(set, ASCC_POSITION, 0, n, at);
        read_field(set, ASCC_NORMAL, 0, n, normal);
        for (size_t i = 0; i < n; i++) {
            double out[3];
            for (int c = 0; c < 3; c++)
                out[c] = at[3 * i + (size_t)c] + 1e-3 * normal[3 * i + (size_t)c];
            assert_true(fabs(distance(&box, 3, at + 3 * i)) < 1e-7);
            assert_true(fabs(distance(&box, 3, out) - 1e-3) < 1e-7);
        }
        for (int tries = 0; tries < 5000; tries++) {
            double p[3];
            for (int c = 0; c < 3; c++)
                p[c] = test_random_between(&random, -half, half);
            p[tries % 3] = tries % 2 ? half : -half;
            assert_true(nearest(at, n, 3, p, n) < 1.2 * pitch);
        }
        ascc_particles_destroy(&set);
    }
}

static void lines_are_a_mesh_in_2d(void **state)
{
    fixture *self = *state;
    static const float corner[4][2] = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
    static const int32_t faces[4][2] = {{0, 1}, {1, 2}, {2, 3}, {3, 0}}; /* counterclockwise */
    static double at[2 * MOST], normal[2 * MOST];
    const ascc_const_array array = {.data = corner};
    const ascc_shape mesh = {.size = sizeof mesh,
                             .kind = ASCC_SHAPE_MESH,
                             .count = 4,
                             .position = &array,
                             .face_count = 4,
                             .faces = &faces[0][0]};
    int32_t body;
    ascc_particles *const set = self->set[2];
    assert_int_equal(ascc_body_add(set, &mesh, NULL, &body), ASCC_OK);
    const size_t n = ascc_particles_count(set, ASCC_BOUNDARY);
    assert_true(n > 120 && n < 180);
    read_field(set, ASCC_POSITION, 0, n, at);
    read_field(set, ASCC_NORMAL, 0, n, normal);
    for (size_t i = 0; i < n; i++) /* away from the middle */
        assert_true((at[2 * i] - 0.5) * normal[2 * i] + (at[2 * i + 1] - 0.5) * normal[2 * i + 1] >
                    0.499);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_fixture, close_fixture)
    const struct CMUnitTest tests[] = {
        TEST(a_body_is_where_its_pose_says),
        TEST(steps_carry_a_body_exactly),
        TEST(a_failed_step_leaves_bodies_where_they_were),
        TEST(a_wrong_pose_is_named_and_nothing_has_changed),
        TEST(a_wrong_shape_is_named_and_nothing_was_added),
        TEST(every_failing_allocation_is_told_and_changes_nothing),
        TEST(numbers_are_never_given_again),
        TEST(impulses_of_bodies_are_those_of_their_points),
        TEST(a_restored_body_goes_on_bit_for_bit),
        TEST(the_hash_sees_how_a_body_moves),
        TEST(points_of_shapes_cover_them_evenly),
        TEST(a_plane_and_open_boxes_leave_away_what_they_say),
        TEST(a_mesh_has_points_as_its_surface_asks_not_as_its_faces_do),
        TEST(lines_are_a_mesh_in_2d),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
