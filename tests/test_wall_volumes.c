/* Volumes of wall points, where some of them have moved. SPDX-License-Identifier: MIT */
#include <math.h>

#include "step/wall_volumes.h"
#include "support/tools.h"

#define COUNT 700
#define SUPPORT 0.1
#define STEPS 40

typedef struct walls {
    double at[3 * COUNT], normal[3 * COUNT];
} walls;

/* A crowd in one corner, and points far apart; some in pairs back to back, as thin walls have them. */
static void scatter(walls *w, size_t d, dice *r)
{
    for (size_t i = 0; i < COUNT; i++) {
        const double size = i % 3 ? 6.0 * SUPPORT : 40.0 * SUPPORT;
        const size_t axis = dice_next(r) % d;
        for (size_t c = 0; c < d; c++) {
            w->at[i * d + c] = dice_uniform(r, -size, size);
            w->normal[i * d + c] = c == axis ? 1.0 : 0.0;
        }
        if (i % 5 != 4)
            continue;
        for (size_t c = 0; c < d; c++) {
            w->at[i * d + c] = w->at[(i - 1) * d + c];
            w->normal[i * d + c] = -w->normal[(i - 1) * d + c];
        }
    }
}

/* A few near each other, by up to two supports, or far away, or turned only. */
static void change_some(walls *w, size_t d, dice *r)
{
    const size_t first = dice_next(r) % (COUNT - 12);
    const uint32_t kind = dice_next(r) % 3;
    for (size_t i = first; i < first + 12; i++)
        for (size_t c = 0; c < d; c++) {
            if (kind == 2)
                w->normal[i * d + c] = -w->normal[i * d + c];
            else
                w->at[i * d + c] += dice_uniform(r, -1.0, 1.0) * (kind ? 20.0 : 2.0) * SUPPORT;
        }
}

static void update(ascc_wall_volumes *v, test_tools *t, const walls *w, size_t d)
{
    ascc_arena_reset(&t->arena);
    assert_int_equal(
        ascc_wall_volumes_update(v, &t->search, w->at, w->normal, COUNT, (int32_t)d, SUPPORT),
        ASCC_OK);
}

static void after_some_moved_all_volumes_are_those_made_anew(void **state)
{
    (void)state;
    for (size_t d = 2; d <= 3; d++)
        for (int32_t threads = 1; threads <= 3; threads += 2) {
            test_tools t;
            dice r = {7 + d};
            int changes = 0;
            walls *w = calloc(1, sizeof *w);
            tools_open(&t, threads, 0);
            ascc_wall_volumes kept = {.allocator = &t.context->allocator};
            scatter(w, d, &r);
            update(&kept, &t, w, d);
            for (int step = 0; step < STEPS; step++) {
                ascc_wall_volumes anew = {.allocator = &t.context->allocator};
                float *before = malloc(COUNT * sizeof *before);
                memcpy(before, kept.volume, COUNT * sizeof *before);
                change_some(w, d, &r);
                update(&kept, &t, w, d);
                update(&anew, &t, w, d);
                assert_memory_equal(kept.volume, anew.volume, COUNT * sizeof *kept.volume);
                changes += memcmp(kept.volume, before, COUNT * sizeof *before) != 0;
                ascc_wall_volumes_close(&anew);
                free(before);
            }
            assert_true(changes > STEPS / 2);
            ascc_wall_volumes_close(&kept);
            tools_close(&t);
            free(w);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(after_some_moved_all_volumes_are_those_made_anew),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
