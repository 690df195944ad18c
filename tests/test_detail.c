/* A better network where detail is wanted: momentum, bits, and what each network gives. SPDX-License-Identifier: MIT */
#include <math.h>

#include "detail.h"
#include "step/ladder.h"
#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

enum { LONG = 60, HIGH = 6, FLUID = LONG * HIGH, WALLS = 160, RUNGS = 2 };

static const double spacing = 0.05, time_step = 0.005;

/* ---- Models ---- */

static const char base_relaxation[] =
    "{\"support\":0.1,\"rest_volume\":0.002,\"omega\":[0.5,0.4],\"epsilon\":0.1,\"limit\":0.01,"
    "\"divergence\":[0.3]}";
static const char best_relaxation[] =
    "{\"support\":0.1,\"rest_volume\":0.002,\"omega\":[0.6,0.3,0.2],\"epsilon\":0.1,\"limit\":0.02,"
    "\"divergence\":[0.5,0.5],\"hyperviscosity\":{\"shares\":[0.5],\"below\":1},\"rounds\":{"
    "\"most\":2,\"above\":0.05},\"guess\":\"guess\"}";

static model_random network(bool best)
{
    return (model_random){.seed = best ? 11 : 5,
                          .spacing = spacing,
                          .levels = 2,
                          .channels = best ? 12 : 8,
                          .method = "voxel_corners",
                          .no_hysteresis = 1,
                          .bumps = 3,
                          .transfer = 1,
                          .fluid_only = 1,
                          .motion = 1,
                          .damping = 1,
                          .walls = 1,
                          .contact = 0.3,
                          .scale = 0.001,
                          .evaluate = "advected",
                          .guess = best,
                          .relaxation = best ? best_relaxation : base_relaxation};
}

static ascc_model *make_model(ascc_context *context, const model_random *random)
{
    ascc_model *model = NULL;
    size_t size;
    unsigned char *bytes = model_builder_random(random, &size);
    assert_int_equal(ascc_model_load_memory(context, bytes, size, &model), ASCC_OK);
    free(bytes);
    return model;
}

/* ---- A world ---- */

typedef struct world {
    ascc_context *context;
    ascc_model *model[RUNGS];
    ascc_particles *particles;
    ascc_ladder *ladder;
} world;

static double tick(void *user)
{
    double *time = user;
    return *time += 0.001;
}

/* A loose heap that slides along a floor, walls of body 4. */
static void fill(ascc_particles *p)
{
    double x[FLUID][2], v[FLUID][2], m[FLUID], floor[WALLS][2], normal[WALLS][2];
    dice d = {9};
    for (int i = 0; i < FLUID; i++) {
        x[i][0] = spacing * (i % LONG + dice_uniform(&d, -0.3, 0.3));
        x[i][1] = spacing * (0.8 + i / LONG + dice_uniform(&d, -0.3, 0.3));
        v[i][0] = dice_uniform(&d, -0.5, 1.0);
        v[i][1] = dice_uniform(&d, -0.5, 0.5);
        m[i] = 2.5 * dice_uniform(&d, 0.9, 1.1);
    }
    for (int i = 0; i < WALLS; i++) {
        floor[i][0] = 0.5 * spacing * (i - 20);
        floor[i][1] = normal[i][0] = 0.0;
        normal[i][1] = 1.0;
    }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array velocity = {.data = v, .scalar = ASCC_DOUBLE};
    const ascc_const_array mass = {.data = m, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = floor, .scalar = ASCC_DOUBLE};
    const ascc_const_array up = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(p, FLUID, &position, &velocity, &mass, NULL),
                     ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, WALLS, &wall, &up, 4, NULL), ASCC_OK);
}

static void open_with(world *w, const ascc_context_options *context, const model_random models[2],
                      double sleep_speed)
{
    static double time;
    memset(w, 0, sizeof *w);
    assert_int_equal(ascc_context_create(context, &w->context), ASCC_OK);
    for (int i = 0; i < RUNGS; i++)
        w->model[i] = make_model(w->context, &models[i]);
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 2, .spacing = spacing};
    assert_int_equal(ascc_particles_create(w->context, &options, &w->particles), ASCC_OK);
    const ascc_step_options step = {
        .size = sizeof step, .time_step = time_step, .sleep_speed = sleep_speed};
    const ascc_ladder_options ladder = {
        .size = sizeof ladder, .clock = tick, .user = &time, .step = &step};
    const ascc_model *models_of[RUNGS] = {w->model[0], w->model[1]};
    assert_int_equal(ascc_ladder_create(w->context, RUNGS, models_of, &ladder, &w->ladder),
                     ASCC_OK);
}

static void open_world(world *w, int32_t threads, uint32_t cpu_disable)
{
    const ascc_context_options context = {
        .size = sizeof context, .thread_count = threads, .cpu_disable = cpu_disable};
    const model_random models[RUNGS] = {network(false), network(true)};
    open_with(w, &context, models, 0.0);
    fill(w->particles);
}

static void close_world(world *w)
{
    ascc_ladder_destroy(&w->ladder);
    ascc_particles_destroy(&w->particles);
    for (int i = 0; i < RUNGS; i++)
        ascc_model_destroy(&w->model[i]);
    ascc_context_destroy(&w->context);
}

static void set_weights(world *w, const double *weight)
{
    const ascc_const_array rows = {.data = weight, .scalar = ASCC_DOUBLE};
    const size_t count = ascc_particles_count(w->particles, ASCC_FLUID);
    assert_int_equal(ascc_particles_set(w->particles, ASCC_FLUID, ASCC_DETAIL, 0, count, &rows),
                     ASCC_OK);
}

static void set_all(world *w, double weight)
{
    double rows[FLUID];
    for (int i = 0; i < FLUID; i++)
        rows[i] = weight;
    set_weights(w, rows);
}

/* 1 on the left, 0 on the right, and a ramp over `band` spacings around a place. */
static void set_ramp(world *w, double place, double band)
{
    double x[FLUID][2], weight[FLUID];
    const ascc_array rows = {.data = x, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(w->particles, ASCC_FLUID, ASCC_POSITION, 0, FLUID, &rows),
                     ASCC_OK);
    for (int i = 0; i < FLUID; i++)
        weight[i] = fmin(1.0, fmax(0.0, 0.5 + (place - x[i][0] / spacing) / band));
    set_weights(w, weight);
}

static void set_random(world *w, uint64_t seed)
{
    double weight[FLUID];
    dice d = {seed};
    for (int i = 0; i < FLUID; i++)
        weight[i] = fmin(1.0, fmax(0.0, dice_uniform(&d, -0.5, 1.5)));
    set_weights(w, weight);
}

/* Steps on this rung, and what they tell. */
static ascc_ladder_statistics run(world *w, int32_t rung, int32_t steps)
{
    ascc_ladder_statistics s = {.size = sizeof s};
    for (int32_t n = 0; n < steps; n++)
        if (ascc_ladder_replay(w->ladder, w->particles, NULL, &rung, 1) != ASCC_OK)
            fail_msg("%s", ascc_ladder_message(w->ladder));
    assert_int_equal(ascc_ladder_get_statistics(w->ladder, &s), ASCC_OK);
    return s;
}

static void read_momenta(const world *w, int64_t to[FLUID][2])
{
    memcpy(to, w->particles->momentum, FLUID * sizeof *to);
}

static void assert_conserved(const ascc_ladder_statistics *s)
{
    for (int c = 0; c < 3; c++)
        assert_true(s->momentum_before[c] + s->external_impulse[c] - s->wall_impulse[c] -
                        s->support_impulse[c] ==
                    s->momentum_after[c]);
}

/* ---- The field ---- */

static void weights_are_set_read_kept_and_hashed_once_they_are_not_zero(void **state)
{
    (void)state;
    world w, other;
    open_world(&w, 1, 0);
    open_world(&other, 1, 0);
    const uint64_t before = ascc_particles_hash(w.particles);
    set_all(&w, 0.0);
    assert_true(ascc_particles_hash(w.particles) == before);
    set_ramp(&w, 20.0, 8.0);
    const uint64_t after = ascc_particles_hash(w.particles);
    assert_true(after != before);
    const size_t size = ascc_particles_snapshot_size(w.particles);
    void *bytes = malloc(size);
    assert_int_equal(ascc_particles_snapshot(w.particles, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_restore(other.particles, bytes, size), ASCC_OK);
    assert_true(ascc_particles_hash(other.particles) == after);
    double weight[FLUID];
    const ascc_array rows = {.data = weight, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_get(other.particles, ASCC_FLUID, ASCC_DETAIL, 0, FLUID, &rows),
                     ASCC_OK);
    assert_memory_equal(weight, w.particles->detail, sizeof weight);
    free(bytes);
    close_world(&w);
    close_world(&other);
}

static void weights_beyond_0_to_1_are_refused_by_row(void **state)
{
    (void)state;
    world w;
    open_world(&w, 1, 0);
    const double bad[] = {-1e-9, 1.0 + 1e-9, NAN, INFINITY};
    double weight[FLUID] = {0.0};
    const ascc_const_array rows = {.data = weight, .scalar = ASCC_DOUBLE};
    const uint64_t hash = ascc_particles_hash(w.particles);
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        weight[0] = 0.5;
        weight[17] = bad[k];
        assert_int_equal(ascc_particles_set(w.particles, ASCC_FLUID, ASCC_DETAIL, 0, FLUID, &rows),
                         ASCC_ERROR_ARGUMENT);
        assert_non_null(strstr(ascc_particles_message(w.particles), "row 17 is"));
        assert_true(ascc_particles_hash(w.particles) == hash);
    }
    weight[17] = 0.0;
    assert_int_equal(ascc_particles_set(w.particles, ASCC_BOUNDARY, ASCC_DETAIL, 0, 1, &rows),
                     ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

/* ---- What runs where ---- */

static void weights_of_one_are_the_best_model_and_of_zero_the_rungs_own(void **state)
{
    (void)state;
    for (int32_t weight = 0; weight < 2; weight++) {
        world w, other;
        open_world(&w, 1, 0);
        open_world(&other, 1, 0);
        set_all(&w, weight);
        set_all(&other, weight);
        const ascc_step_options options = {.size = sizeof options, .time_step = time_step};
        ascc_step *step;
        assert_int_equal(ascc_step_create(other.context, other.model[weight], &options, &step),
                         ASCC_OK);
        const ascc_ladder_statistics s = run(&w, 0, 4);
        assert_int_equal(ascc_step_run(step, other.particles, NULL, 4), ASCC_OK);
        assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
        assert_int_equal(s.particles_on[0], weight ? 0 : FLUID);
        assert_int_equal(s.particles_on[1], weight ? FLUID : 0);
        assert_conserved(&s);
        ascc_step_destroy(&step);
        close_world(&w);
        close_world(&other);
    }
}

static void far_from_the_seam_each_model_does_what_it_does_alone(void **state)
{
    (void)state;
    /* Reach of the network (two radii of level 0 and of level 1 each), and three rounds of sweeps. */
    enum { REACH = 24 };
    static int64_t mixed[FLUID][2], alone[RUNGS][FLUID][2];
    world w;
    for (int32_t r = 0; r < RUNGS; r++) {
        open_world(&w, 1, 0);
        run(&w, r, 1);
        read_momenta(&w, alone[r]);
        close_world(&w);
    }
    open_world(&w, 1, 0);
    set_ramp(&w, 0.5 * LONG, 4.0);
    run(&w, 0, 1);
    read_momenta(&w, mixed);
    int seen[RUNGS] = {0, 0};
    double apart = 0.0;
    for (int i = 0; i < FLUID; i++) {
        const int column = i % LONG, side = column < LONG / 2;
        for (int c = 0; c < 2; c++)
            apart = fmax(apart, fabs((double)(alone[0][i][c] - alone[1][i][c])));
        if (abs(column - LONG / 2) < REACH)
            continue;
        seen[side]++;
        for (int c = 0; c < 2; c++) /* sums of floats in another order: 1e-6 of the momenta */
            assert_true(fabs((double)(mixed[i][c] - alone[side][i][c])) <=
                        1e-6 * 2.5 / w.particles->quantum);
    }
    assert_true(seen[0] > 20 && seen[1] > 20);
    assert_true(apart > 1e-3 * 2.5 / w.particles->quantum); /* the models are not one */
    close_world(&w);
}

static void particles_between_two_are_counted_for_both(void **state)
{
    (void)state;
    world w;
    double weight[FLUID] = {0.0};
    open_world(&w, 1, 0);
    for (int i = 0; i < 100; i++)
        weight[i] = i < 30 ? 1.0 : 0.25;
    set_weights(&w, weight);
    const ascc_ladder_statistics s = run(&w, 0, 1);
    assert_int_equal(s.particles_on[1], 100);
    assert_int_equal(s.particles_on[0], FLUID - 30);
    assert_int_equal(run(&w, 1, 1).particles_on[1],
                     FLUID); /* on the best rung weights say nothing */
    assert_int_equal(run(&w, 1, 1).particles_on[0], 0);
    close_world(&w);
}

/* Two particles, whose pair gives what their weights say: linear in each of them. */
static void what_a_pair_gives_is_linear_in_its_two_weights(void **state)
{
    (void)state;
    const double at[][2] = {{0, 0}, {1, 0}, {0, 1}, {1, 1}, {0.25, 0.75}, {0.5, 0.5}};
    enum { TRIES = sizeof at / sizeof *at };
    int64_t got[TRIES][2];
    model_random models[RUNGS] = {network(false), network(true)};
    for (int i = 0; i < RUNGS; i++) {
        models[i].relaxation = NULL;
        models[i].guess = 0;
        models[i].damping = 0;
        models[i].walls = 0;
        models[i].contact = 0.0;
        models[i].motion = 0;
    }
    for (int k = 0; k < TRIES; k++) {
        const ascc_context_options context = {.size = sizeof context, .thread_count = 1};
        world w;
        open_with(&w, &context, models, 0.0);
        const double x[2][2] = {{0.0, 0.0}, {1.1 * spacing, 0.4 * spacing}};
        const ascc_const_array rows = {.data = x, .scalar = ASCC_DOUBLE};
        const double none[2] = {0.0, 0.0};
        const ascc_forces forces = {.size = sizeof forces, .gravity = none};
        const int32_t base = 0;
        assert_int_equal(ascc_particles_add_fluid(w.particles, 2, &rows, NULL, NULL, NULL),
                         ASCC_OK);
        set_weights(&w, at[k]);
        assert_int_equal(ascc_ladder_replay(w.ladder, w.particles, &forces, &base, 1), ASCC_OK);
        memcpy(got[k], w.particles->momentum, sizeof *got);
        assert_true(got[k][0] == -w.particles->momentum[2]);
        close_world(&w);
    }
    for (int c = 0; c < 2; c++) {
        const double f00 = (double)got[0][c], f10 = (double)got[1][c], f01 = (double)got[2][c];
        assert_true(fabs(f10 - f00) > 100.0 && fabs(f01 - f00) > 100.0);
        for (int k = 3; k < TRIES; k++) { /* floats, and a quantum for each of four roundings */
            const double want = f00 + at[k][0] * (f10 - f00) + at[k][1] * (f01 - f00);
            assert_true(fabs((double)got[k][c] - want) <= 4.0 + 1e-6 * fabs(want));
        }
    }
}

/* ---- What never changes ---- */

static void momentum_is_exact_whatever_the_weights(void **state)
{
    (void)state;
    world w;
    open_world(&w, 1, 0);
    for (uint64_t n = 0; n < 12; n++) {
        if (n % 3 == 2)
            set_ramp(&w, 10.0 + (double)n, n % 2 ? 6.0 : 1e-9);
        else
            set_random(&w, n);
        const ascc_ladder_statistics s = run(&w, 0, 1);
        assert_conserved(&s);
        assert_true(s.wall_impulse[1] != 0);
        int64_t wall[3];
        assert_int_equal(ascc_particles_body_impulse(w.particles, 4, NULL, wall, NULL), ASCC_OK);
        assert_memory_equal(wall, s.wall_impulse, sizeof wall);
    }
    close_world(&w);
}

static void momentum_is_exact_while_some_of_it_sleeps(void **state)
{
    (void)state;
    const ascc_context_options context = {.size = sizeof context, .thread_count = 1};
    const model_random models[RUNGS] = {network(false), network(true)};
    const double quick[2] = {3.0, 0.0};
    const ascc_const_array push = {.data = quick, .scalar = ASCC_DOUBLE};
    uint64_t asleep = 0;
    world w;
    open_with(&w, &context, models, 100.0);
    fill(w.particles);
    set_ramp(&w, 40.0, 6.0);
    for (int n = 0; n < 130; n++) {
        const ascc_ladder_statistics s = run(&w, 0, 1);
        assert_conserved(&s);
        ascc_step_statistics told = {.size = sizeof told};
        assert_int_equal(ascc_step_get_statistics(ascc_ladder_step(w.ladder, 0), &told), ASCC_OK);
        if (told.asleep > 0 && told.asleep < FLUID)
            asleep++;
        if (n == 110)
            assert_int_equal(
                ascc_particles_set(w.particles, ASCC_FLUID, ASCC_VELOCITY, 30, 1, &push), ASCC_OK);
    }
    assert_true(asleep > 0);
    close_world(&w);
}

static void threads_and_instruction_sets_give_the_same_bits(void **state)
{
    (void)state;
    uint64_t hash = 0;
    for (int k = 0; k < 3; k++) {
        world w;
        open_world(&w, k == 1 ? 3 : 1,
                   k == 2 ? ASCC_CPU_AVX2 | ASCC_CPU_AVX512 | ASCC_CPU_NEON : 0);
        set_ramp(&w, 25.0, 8.0);
        run(&w, 0, 3);
        assert_true(k == 0 || hash == ascc_particles_hash(w.particles));
        hash = ascc_particles_hash(w.particles);
        close_world(&w);
    }
}

static void a_run_goes_on_from_a_snapshot_to_the_same_bits(void **state)
{
    (void)state;
    world w, other;
    open_world(&w, 1, 0);
    open_world(&other, 1, 0);
    set_ramp(&w, 25.0, 8.0);
    run(&w, 0, 2);
    const size_t size = ascc_particles_snapshot_size(w.particles);
    void *bytes = malloc(size);
    assert_int_equal(ascc_particles_snapshot(w.particles, bytes, size), ASCC_OK);
    run(&w, 0, 3);
    assert_int_equal(ascc_particles_restore(other.particles, bytes, size), ASCC_OK);
    run(&other, 0, 3);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    free(bytes);
    close_world(&w);
    close_world(&other);
}

/* ---- What cannot be done ---- */

static void models_that_cannot_share_a_step_are_refused_by_name(void **state)
{
    (void)state;
    const struct {
        void (*spoil)(model_random *r);
        const char *word;
    } tries[] = {{NULL, "relaxation"}, {NULL, "other places"}, {NULL, "pairs"}, {NULL, "support"}};
    for (int k = 0; k < 4; k++) {
        model_random models[RUNGS] = {network(false), network(true)};
        if (k == 0)
            models[0].relaxation = NULL;
        if (k == 1)
            models[0].evaluate = "current";
        if (k == 2)
            models[0] = (model_random){.spacing = spacing, .plain = 1, .evaluate = "advected"};
        if (k == 3)
            models[0].relaxation = "{\"support\":0.12,\"rest_volume\":0.002,\"omega\":[0.5],"
                                   "\"epsilon\":0.1,\"limit\":0.01}";
        const ascc_context_options context = {.size = sizeof context, .thread_count = 1};
        const int32_t base = 0;
        world w;
        open_with(&w, &context, models, 0.0);
        fill(w.particles);
        set_ramp(&w, 20.0, 4.0);
        const uint64_t hash = ascc_particles_hash(w.particles);
        assert_int_equal(ascc_ladder_replay(w.ladder, w.particles, NULL, &base, 1),
                         ASCC_ERROR_MISMATCH);
        if (!strstr(ascc_ladder_message(w.ladder), tries[k].word))
            fail_msg("%s", ascc_ladder_message(w.ladder));
        assert_true(ascc_particles_hash(w.particles) == hash);
        assert_int_equal(ascc_ladder_step_count(w.ladder), 0);
        set_all(&w, 0.0); /* alone each of them runs */
        run(&w, 0, 1);
        close_world(&w);
    }
}

static void without_memory_nothing_changes_and_nothing_leaks(void **state)
{
    (void)state;
    for (size_t fail_at = 1;; fail_at += 1 + fail_at / 40) {
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        const model_random models[RUNGS] = {network(false), network(true)};
        const int32_t base = 0;
        world w;
        open_with(&w, &options, models, 0.0);
        fill(w.particles);
        set_ramp(&w, 20.0, 8.0);
        const uint64_t hash = ascc_particles_hash(w.particles);
        memory.fail_at = memory.calls + fail_at;
        const ascc_status status = ascc_ladder_replay(w.ladder, w.particles, NULL, &base, 1);
        memory.fail_at = 0;
        assert_true(status == ASCC_OK || status == ASCC_ERROR_MEMORY);
        assert_true(status == ASCC_OK || hash == ascc_particles_hash(w.particles));
        close_world(&w);
        assert_true(test_memory_is_clean(&memory));
        if (status == ASCC_OK)
            break;
    }
}

/* ---- What the program asks for ---- */

static void the_program_weighs_place_speed_and_depth(void **state)
{
    (void)state;
    enum { ROWS = 40 };
    float x[ROWS][2], v[ROWS][2];
    double weight[ROWS];
    ascc_detail detail;
    for (int i = 0; i < ROWS; i++) { /* two columns of 20, the second at speeds that rise */
        x[i][0] = i < 20 ? 0.0f : 1.0f;
        x[i][1] = 0.05f * (float)(i % 20);
        v[i][0] = i < 20 ? 0.0f : 0.1f * (float)(i - 20);
        v[i][1] = 0.0f;
    }
    const ascc_detail_fluid fluid = {.dimension = 2,
                                     .count = ROWS,
                                     .position = x[0],
                                     .velocity = v[0],
                                     .spacing = 0.05,
                                     .gravity = {0.0, -9.81, 0.0}};
    assert_true(ascc_detail_read("fast:1", 2, &detail));
    assert_true(ascc_detail_weigh(&detail, &fluid, weight));
    for (int i = 0; i < ROWS; i++) /* 0 up to half of it, 1 from it on */
        assert_true(fabs(weight[i] - fmin(1.0, fmax(0.0, 2.0 * (double)v[i][0] - 1.0))) < 1e-12);
    assert_true(ascc_detail_read("surface:0.2", 2, &detail));
    assert_true(ascc_detail_weigh(&detail, &fluid, weight));
    for (int i = 0; i < ROWS; i++) /* of depths 0 to 0.95: 1 to 0.2, 0 from 0.4 on */
        assert_true(fabs(weight[i] -
                         fmin(1.0, fmax(0.0, 1.0 - (0.95 - (double)x[i][1] - 0.2) / 0.2))) < 1e-5);
    assert_true(ascc_detail_read("near:1,0.5,0.1+fast:1e9", 2, &detail));
    assert_true(ascc_detail_weigh(&detail, &fluid, weight));
    for (int i = 0; i < ROWS; i++) {
        const double far = hypot((double)x[i][0] - 1.0, (double)x[i][1] - 0.5) - 0.1;
        assert_true(fabs(weight[i] - fmin(1.0, fmax(0.0, 1.0 - far / 0.2))) < 1e-12);
    }
}

static void texts_that_say_nothing_are_refused(void **state)
{
    (void)state;
    static const char *const bad[] = {
        "",       "near",    "near:",   "near:1,2", "near:1,2,3,4", "near:1,2,0",
        "fast:",  "fast:0",  "fast:-1", "fast:nan", "fast:1,2",     "surface:x",
        "deep:1", "fast:1+", "+fast:1", "fast:1 ",  "fast:1+fast",  "surface:inf"};
    ascc_detail detail;
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++)
        if (ascc_detail_read(bad[k], 2, &detail))
            fail_msg("'%s' is taken", bad[k]);
    assert_true(ascc_detail_read("near:1,2,3,4", 3, &detail));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weights_are_set_read_kept_and_hashed_once_they_are_not_zero),
        cmocka_unit_test(weights_beyond_0_to_1_are_refused_by_row),
        cmocka_unit_test(weights_of_one_are_the_best_model_and_of_zero_the_rungs_own),
        cmocka_unit_test(far_from_the_seam_each_model_does_what_it_does_alone),
        cmocka_unit_test(particles_between_two_are_counted_for_both),
        cmocka_unit_test(what_a_pair_gives_is_linear_in_its_two_weights),
        cmocka_unit_test(momentum_is_exact_whatever_the_weights),
        cmocka_unit_test(momentum_is_exact_while_some_of_it_sleeps),
        cmocka_unit_test(threads_and_instruction_sets_give_the_same_bits),
        cmocka_unit_test(a_run_goes_on_from_a_snapshot_to_the_same_bits),
        cmocka_unit_test(models_that_cannot_share_a_step_are_refused_by_name),
        cmocka_unit_test(without_memory_nothing_changes_and_nothing_leaks),
        cmocka_unit_test(the_program_weighs_place_speed_and_depth),
        cmocka_unit_test(texts_that_say_nothing_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
