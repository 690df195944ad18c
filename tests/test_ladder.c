/* A ladder keeps to its budget, never flickers, and can be run again to the bit. SPDX-License-Identifier: MIT */
#include <math.h>

#include "step/ladder.h"
#include "support/counting.h"
#include "support/model_builder.h"
#include "support/tools.h"

enum { RUNGS = 3, MOST_STEPS = 400 };

/* A clock that tells what the test says a step of a rung takes. */
typedef struct false_clock {
    const ascc_ladder *ladder;
    double time, cost[RUNGS]; /* s */
    int32_t measured;         /* calls while rungs are measured: two for each of two steps */
    uint64_t calls;
    bool began;
} false_clock;

static double tell_time(void *user)
{
    false_clock *c = user;
    if (c->began) {
        const int32_t rung = c->measured < 4 * RUNGS ? c->measured / 4
                             : c->ladder             ? c->ladder->choice.rung
                                                     : 0;
        c->time += c->cost[rung];
    }
    c->measured += c->measured < 4 * RUNGS;
    c->began = !c->began;
    c->calls++;
    return c->time;
}

typedef struct world {
    ascc_context *context;
    ascc_model *model[RUNGS];
    ascc_particles *particles;
    ascc_ladder *ladder;
    false_clock clock;
} world;

static const double spacing = 0.05;

static ascc_model *make_model(ascc_context *context, int which, double size)
{
    ascc_model *model = NULL;
    size_t bytes_size;
    const model_random r = {.seed = 1 + (uint64_t)which, .dimension = 2, .spacing = size};
    unsigned char *bytes = model_builder_random(&r, &bytes_size);
    assert_int_equal(ascc_model_load_memory(context, bytes, bytes_size, &model), ASCC_OK);
    free(bytes);
    return model;
}

/* A block above a floor: walls of body 4. */
static void fill(ascc_particles *p)
{
    double x[120 * 2], floor[40 * 2], normal[40 * 2];
    for (int i = 0; i < 120; i++) {
        x[2 * i] = spacing * (i % 12);
        x[2 * i + 1] = spacing * (1 + i / 12);
    }
    for (int i = 0; i < 40; i++) {
        floor[2 * i] = 0.5 * spacing * (i - 8);
        floor[2 * i + 1] = normal[2 * i] = 0.0;
        normal[2 * i + 1] = 1.0;
    }
    const ascc_const_array position = {.data = x, .scalar = ASCC_DOUBLE};
    const ascc_const_array wall = {.data = floor, .scalar = ASCC_DOUBLE};
    const ascc_const_array up = {.data = normal, .scalar = ASCC_DOUBLE};
    assert_int_equal(ascc_particles_add_fluid(p, 120, &position, NULL, NULL, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_add_boundary(p, 40, &wall, &up, 4, NULL), ASCC_OK);
}

static const double time_step = 0.005;

static void open_world(world *w, double budget, int32_t threads)
{
    memset(w, 0, sizeof *w);
    const ascc_context_options context = {.size = sizeof context, .thread_count = threads};
    assert_int_equal(ascc_context_create(&context, &w->context), ASCC_OK);
    for (int i = 0; i < RUNGS; i++)
        w->model[i] = make_model(w->context, i, spacing);
    const ascc_particles_options options = {
        .size = sizeof options, .dimension = 2, .spacing = spacing};
    assert_int_equal(ascc_particles_create(w->context, &options, &w->particles), ASCC_OK);
    fill(w->particles);
    const ascc_step_options step = {.size = sizeof step, .time_step = time_step};
    const ascc_ladder_options ladder = {.size = sizeof ladder,
                                        .budget = budget,
                                        .dwell = 20 * time_step,
                                        .clock = tell_time,
                                        .user = &w->clock,
                                        .step = &step};
    const ascc_model *models[RUNGS] = {w->model[0], w->model[1], w->model[2]};
    assert_int_equal(ascc_ladder_create(w->context, RUNGS, models, &ladder, &w->ladder), ASCC_OK);
    w->clock.ladder = w->ladder;
    memcpy(w->clock.cost, (const double[]){0.001, 0.002, 0.004}, sizeof w->clock.cost);
}

static void close_world(world *w)
{
    ascc_context_destroy(&w->context);
    for (int i = 0; i < RUNGS; i++)
        ascc_model_destroy(&w->model[i]);
    ascc_ladder_destroy(&w->ladder);
    assert_null(w->ladder);
    ascc_particles_destroy(&w->particles);
}

/* Weightless: the random networks give pushes that mean nothing. */
static const double none[3] = {0.0, 0.0, 0.0};
static const ascc_forces still = {.size = sizeof still, .gravity = none};

static ascc_ladder_statistics run(world *w, int32_t steps)
{
    if (ascc_ladder_run(w->ladder, w->particles, &still, steps) != ASCC_OK)
        fail_msg("ladder: %s", ascc_ladder_message(w->ladder));
    ascc_ladder_statistics s = {.size = sizeof s};
    assert_int_equal(ascc_ladder_get_statistics(w->ladder, &s), ASCC_OK);
    assert_int_equal(s.steps, steps);
    return s;
}

/* ---- The handle ---- */

static void without_a_budget_the_top_rung_runs_as_a_step_of_its_own(void **state)
{
    (void)state;
    world w, other;
    open_world(&w, 0.0, 1);
    open_world(&other, 0.0, 1);
    const ascc_ladder_statistics s = run(&w, 5);
    assert_int_equal(s.rung, RUNGS - 1);
    assert_int_equal(s.reason, ASCC_LADDER_FITS);
    const ascc_step_options options = {.size = sizeof options, .time_step = time_step};
    ascc_step *step;
    assert_int_equal(ascc_step_create(other.context, other.model[RUNGS - 1], &options, &step),
                     ASCC_OK);
    assert_int_equal(ascc_step_run(step, other.particles, &still, 5), ASCC_OK);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    ascc_step_statistics t = {.size = sizeof t};
    assert_int_equal(ascc_step_get_statistics(step, &t), ASCC_OK);
    assert_memory_equal(s.momentum_before, t.momentum_before, sizeof s.momentum_before);
    assert_memory_equal(s.momentum_after, t.momentum_after, sizeof s.momentum_after);
    assert_memory_equal(s.wall_impulse, t.wall_impulse, sizeof s.wall_impulse);
    int64_t mine[3], theirs[3];
    assert_int_equal(ascc_particles_body_impulse(w.particles, 4, NULL, mine, NULL), ASCC_OK);
    assert_int_equal(ascc_particles_body_impulse(other.particles, 4, NULL, theirs, NULL), ASCC_OK);
    assert_true(mine[1] != 0);
    assert_memory_equal(mine, theirs, sizeof mine); /* of all five steps */
    assert_memory_equal(mine, s.wall_impulse, sizeof mine);
    ascc_step_destroy(&step);
    close_world(&w);
    close_world(&other);
}

static void the_best_rung_that_fits_the_budget_is_taken_and_left(void **state)
{
    (void)state;
    world w;
    open_world(&w, 0.003, 1);
    ascc_ladder_statistics s = run(&w, 1);
    assert_int_equal(s.rung, 1); /* measured before the first step: none was late */
    assert_int_equal(s.late, 0);
    assert_int_equal(s.changes, 0);
    assert_true(fabs(s.predicted[2] - 0.004) < 1e-9 && fabs(s.predicted[0] - 0.001) < 1e-9);
    w.clock.cost[1] = 0.0036;
    s = run(&w, 60);
    assert_int_equal(s.rung, 0);
    assert_int_equal(s.changes, 1);
    w.clock.cost[1] = 0.002; /* not known before it is taken: 0 became cheaper, too, or it stays */
    w.clock.cost[0] = 0.0005;
    s = run(&w, 200);
    assert_int_equal(s.rung, 1);
    assert_int_equal(ascc_ladder_set_budget(w.ladder, 0.01), ASCC_OK);
    s = run(&w, 60);
    assert_int_equal(s.rung, 2);
    assert_int_equal(ascc_ladder_set_budget(w.ladder, 0.0006), ASCC_OK);
    s = run(&w, 60);
    assert_int_equal(s.rung, 0);
    assert_int_equal(s.reason, ASCC_LADDER_FITS);
    assert_int_equal(ascc_ladder_set_budget(w.ladder, 0.0004), ASCC_OK);
    s = run(&w, 1);
    assert_int_equal(s.reason, ASCC_LADDER_TOO_SLOW);
    assert_true(s.late > 0);
    assert_int_equal(ascc_ladder_set_budget(w.ladder, NAN), ASCC_ERROR_ARGUMENT);
    close_world(&w);
}

static void choices_can_be_run_again_to_the_bit(void **state)
{
    (void)state;
    world w, other;
    int32_t choice[MOST_STEPS];
    open_world(&w, 0.003, 1);
    (void)run(&w, 30);
    w.clock.cost[1] = 0.004;
    (void)run(&w, 60);
    w.clock.cost[0] = 0.0004;
    w.clock.cost[1] = 0.0016;
    ascc_ladder_statistics s = run(&w, 120);
    assert_true(s.changes >= 2);
    const size_t steps = (size_t)ascc_ladder_step_count(w.ladder);
    assert_int_equal(steps, 210);
    assert_int_equal(ascc_ladder_get_choices(w.ladder, 0, steps, choice), ASCC_OK);
    assert_int_equal(ascc_ladder_get_choices(w.ladder, 1, steps, choice), ASCC_ERROR_ARGUMENT);
    uint64_t on[RUNGS] = {0};
    for (size_t n = 0; n < steps; n++)
        on[choice[n]]++;
    assert_memory_equal(on, s.steps_on, sizeof on);
    open_world(&other, 0.001, 3);
    assert_int_equal(
        ascc_ladder_replay(other.ladder, other.particles, &still, choice, (int32_t)steps), ASCC_OK);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    int32_t again[MOST_STEPS];
    assert_int_equal(ascc_ladder_get_choices(other.ladder, 5, 100, again), ASCC_OK);
    assert_memory_equal(again, choice + 5, 100 * sizeof *again);
    const uint64_t hash = ascc_particles_hash(other.particles);
    choice[1] = RUNGS;
    assert_int_equal(ascc_ladder_replay(other.ladder, other.particles, &still, choice, 2),
                     ASCC_ERROR_ARGUMENT);
    assert_true(hash == ascc_particles_hash(other.particles));
    assert_int_equal(ascc_ladder_replay(other.ladder, other.particles, &still, NULL, 2),
                     ASCC_ERROR_ARGUMENT);
    close_world(&w);
    close_world(&other);
}

static void a_restored_ladder_chooses_as_the_first_would(void **state)
{
    (void)state;
    world w, other;
    open_world(&w, 0.003, 1);
    (void)run(&w, 30);
    w.clock.cost[1] = 0.004;
    (void)run(&w, 8); /* under way to a change */
    const size_t size = ascc_ladder_snapshot_size(w.ladder);
    const size_t set_size = ascc_particles_snapshot_size(w.particles);
    unsigned char *bytes = malloc(size), *set = malloc(set_size);
    assert_int_equal(ascc_ladder_snapshot(w.ladder, bytes, size - 1), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_ladder_snapshot(w.ladder, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_snapshot(w.particles, set, set_size), ASCC_OK);
    open_world(&other, 0.003, 1);
    other.clock = w.clock;
    other.clock.ladder = other.ladder;
    assert_int_equal(ascc_ladder_restore(other.ladder, bytes, size), ASCC_OK);
    assert_int_equal(ascc_particles_restore(other.particles, set, set_size), ASCC_OK);
    const ascc_ladder_statistics a = run(&w, 70), b = run(&other, 70);
    assert_int_equal(a.rung, 0);
    assert_int_equal(a.rung, b.rung);
    assert_memory_equal(a.steps_on, b.steps_on, sizeof a.steps_on);
    assert_memory_equal(a.predicted, b.predicted, sizeof a.predicted);
    assert_true(ascc_particles_hash(w.particles) == ascc_particles_hash(other.particles));
    /* Damaged: refused, and nothing changes. */
    for (size_t k = 0; k < size; k++) {
        bytes[k] ^= 0x10;
        assert_int_equal(ascc_ladder_restore(other.ladder, bytes, size), ASCC_ERROR_FORMAT);
        bytes[k] ^= 0x10;
    }
    for (size_t k = 0; k < size; k++)
        assert_int_equal(ascc_ladder_restore(other.ladder, bytes, k), ASCC_ERROR_FORMAT);
    assert_int_equal(ascc_ladder_step_count(other.ladder), 108);
    free(bytes);
    free(set);
    close_world(&w);
    close_world(&other);
}

static void a_failed_step_leaves_set_and_choices(void **state)
{
    (void)state;
    world w;
    open_world(&w, 0.0, 1);
    (void)run(&w, 3);
    const uint64_t hash = ascc_particles_hash(w.particles);
    const double mad[2] = {1e300, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = mad};
    assert_int_equal(ascc_ladder_run(w.ladder, w.particles, &forces, 2), ASCC_ERROR_RANGE);
    assert_true(strlen(ascc_ladder_message(w.ladder)) > 10);
    assert_true(hash == ascc_particles_hash(w.particles));
    assert_int_equal(ascc_ladder_step_count(w.ladder), 3);
    assert_int_equal(ascc_ladder_run(w.ladder, NULL, NULL, 1), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_ladder_run(w.ladder, w.particles, NULL, -1), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_ladder_run(NULL, w.particles, NULL, 1), ASCC_ERROR_ARGUMENT);
    assert_null(ascc_ladder_step(w.ladder, RUNGS));
    assert_null(ascc_ladder_step(w.ladder, -1));
    assert_non_null(ascc_ladder_step(w.ladder, 0));
    close_world(&w);
}

static void models_that_do_not_go_together_are_refused(void **state)
{
    (void)state;
    world w;
    open_world(&w, 0.0, 1);
    char text[256];
    ascc_ladder *made = NULL;
    ascc_model *finer = make_model(w.context, 1, 0.5 * spacing);
    const ascc_model *two[2] = {w.model[0], finer}, *missing[2] = {w.model[0], NULL};
    assert_int_equal(ascc_ladder_create(w.context, 2, two, NULL, &made), ASCC_ERROR_MISMATCH);
    assert_null(made);
    ascc_context_message(w.context, text, sizeof text);
    assert_non_null(strstr(text, "spacing"));
    assert_int_equal(ascc_ladder_create(w.context, 2, missing, NULL, &made), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_ladder_create(w.context, 0, two, NULL, &made), ASCC_ERROR_ARGUMENT);
    assert_int_equal(ascc_ladder_create(w.context, 17, two, NULL, &made), ASCC_ERROR_ARGUMENT);
    const ascc_ladder_options bad = {.size = sizeof bad, .budget = -1.0};
    assert_int_equal(ascc_ladder_create(w.context, 1, two, &bad, &made), ASCC_ERROR_ARGUMENT);
    const ascc_step_options step = {.size = sizeof step, .time_step = -1.0};
    const ascc_ladder_options backwards = {.size = sizeof backwards, .step = &step};
    assert_int_equal(ascc_ladder_create(w.context, 1, two, &backwards, &made), ASCC_ERROR_ARGUMENT);
    assert_null(made);
    ascc_model_destroy(&finer);
    close_world(&w);
}

static void without_memory_nothing_changes_and_nothing_leaks(void **state)
{
    (void)state;
    for (size_t fail_at = 1;; fail_at++) {
        test_memory memory = {0};
        const ascc_context_options options = test_memory_options(&memory);
        ascc_context *context;
        assert_int_equal(ascc_context_create(&options, &context), ASCC_OK);
        ascc_model *model[2] = {make_model(context, 0, spacing), make_model(context, 1, spacing)};
        const ascc_particles_options set = {.size = sizeof set, .dimension = 2, .spacing = spacing};
        ascc_particles *p;
        assert_int_equal(ascc_particles_create(context, &set, &p), ASCC_OK);
        fill(p);
        const uint64_t hash = ascc_particles_hash(p);
        const ascc_step_options step = {.size = sizeof step, .time_step = time_step};
        const ascc_ladder_options o = {.size = sizeof o, .budget = 10.0, .step = &step};
        const ascc_model *models[2] = {model[0], model[1]};
        ascc_ladder *ladder = NULL;
        memory.fail_at = memory.calls + fail_at;
        ascc_status status = ascc_ladder_create(context, 2, models, &o, &ladder);
        if (status == ASCC_OK)
            status = ascc_ladder_run(ladder, p, &still, 1);
        memory.fail_at = 0;
        assert_true(status == ASCC_OK || status == ASCC_ERROR_MEMORY);
        assert_true(status == ASCC_OK || hash == ascc_particles_hash(p));
        ascc_ladder_destroy(&ladder);
        ascc_particles_destroy(&p);
        ascc_model_destroy(&model[0]);
        ascc_model_destroy(&model[1]);
        ascc_context_destroy(&context);
        assert_true(test_memory_is_clean(&memory));
        if (status == ASCC_OK)
            break;
    }
}

/* ---- The choice alone: many thousand steps of made-up times ---- */

typedef struct outcome {
    int changes, late, on[RUNGS], shortest; /* between two changes, steps */
} outcome;

/* load: of a step, times the rung's cost. */
static outcome simulate(double (*load)(int step, dice *d), int steps, double budget)
{
    static const double cost[RUNGS] = {1.0, 2.2, 4.5};
    const size_t particles = 1000;
    dice d = {77};
    ascc_rung_choice c;
    ascc_rung_choice_open(&c, RUNGS, 50);
    for (int32_t r = 0; r < RUNGS; r++)
        ascc_rung_choice_know(&c, r, load(0, &d) * cost[r] / (double)particles);
    outcome o = {.shortest = steps};
    int last = -1, since = 0;
    for (int n = 0; n < steps; n++) {
        const int32_t rung = ascc_rung_choice_make(&c, budget, particles);
        if (last >= 0 && rung != last) {
            o.changes++;
            o.shortest = since < o.shortest && o.changes > 1 ? since : o.shortest;
            since = 0;
        }
        since++;
        last = rung;
        const double seconds = load(n, &d) * cost[rung];
        ascc_rung_choice_learn(&c, seconds, particles);
        o.late += seconds > budget;
        o.on[rung]++;
    }
    return o;
}

static double splash(int n, dice *d)
{
    const double t = n % 2000 / 2000.0,
                 rise = t > 0.3 && t < 0.7 ? sin((t - 0.3) / 0.4 * 3.14159) : 0.0;
    return (1.0 + 0.8 * rise) * dice_uniform(d, 0.98, 1.02);
}

static double wild(int n, dice *d)
{
    (void)n;
    return dice_uniform(d, 0.3, 3.0);
}

static double interrupted(int n, dice *d)
{
    return n % 40 == 7 ? 6.0 : dice_uniform(d, 0.98, 1.02);
}

static void a_load_that_rises_and_falls_stays_within_the_budget(void **state)
{
    (void)state;
    const outcome o = simulate(splash, 20000, 6.0);
    assert_true(o.late < 200);                       /* 1 % */
    assert_true(o.on[2] > 8000 && o.on[1] > 4000);   /* each where it fits */
    assert_true(o.changes >= 20 && o.changes <= 30); /* two a splash, hardly more */
    assert_true(o.shortest >= 50);
}

static void changes_are_never_nearer_than_the_dwell(void **state)
{
    (void)state;
    const outcome o = simulate(wild, 20000, 4.0);
    assert_true(o.changes > 10);
    assert_true(o.shortest >= 50);
}

static void one_slow_step_changes_nothing(void **state)
{
    (void)state;
    const outcome o = simulate(interrupted, 4000, 6.0);
    assert_int_equal(o.changes, 0);
    assert_int_equal(o.on[2], 4000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(without_a_budget_the_top_rung_runs_as_a_step_of_its_own),
        cmocka_unit_test(the_best_rung_that_fits_the_budget_is_taken_and_left),
        cmocka_unit_test(choices_can_be_run_again_to_the_bit),
        cmocka_unit_test(a_restored_ladder_chooses_as_the_first_would),
        cmocka_unit_test(a_failed_step_leaves_set_and_choices),
        cmocka_unit_test(models_that_do_not_go_together_are_refused),
        cmocka_unit_test(without_memory_nothing_changes_and_nothing_leaks),
        cmocka_unit_test(a_load_that_rises_and_falls_stays_within_the_budget),
        cmocka_unit_test(changes_are_never_nearer_than_the_dwell),
        cmocka_unit_test(one_slow_step_changes_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
