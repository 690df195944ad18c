/* Draws the bar a few times a second. SPDX-License-Identifier: MIT */
#include "progress.h"

#include <math.h>
#include <stdio.h>
#include <time.h>

#include "system.h"

#define WIDTH 30

static double now(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void draw(const ascc_progress *p, double time)
{
    const double share = p->total ? (double)p->done / (double)p->total : 1.0;
    const double spent = time - p->started, done = (double)(p->done - p->before);
    const double rate = spent > 0.0 ? done / spent : 0.0;
    const double left = p->work > 0.0 ? spent / p->work * p->work_left
                        : rate > 0.0  ? (double)(p->total - p->done) / rate
                                      : 0.0;
    char bar[WIDTH + 1];
    for (int i = 0; i < WIDTH; i++)
        bar[i] = i < (int)(share * WIDTH) ? '#' : '.';
    bar[WIDTH] = '\0';
    fprintf(stderr, "\r%s [%s] %zu/%zu  %.1f/s  ", p->label, bar, p->done, p->total, rate);
    if (left < 3600.0)
        fprintf(stderr, "%d:%02d left \033[K", (int)left / 60, (int)left % 60);
    else
        fprintf(stderr, "%d:%02d:%02d left \033[K", (int)(left / 3600.0), (int)(left / 60.0) % 60,
                (int)fmod(left, 60.0));
    fflush(stderr);
}

void ascc_progress_start(ascc_progress *p, const char *label, size_t total)
{
    p->label = label;
    p->done = p->before = 0;
    p->work = p->work_left = 0.0;
    p->total = total;
    p->started = p->drawn = now();
    p->visible = ascc_system_is_terminal(stderr);
    if (p->visible)
        draw(p, p->started);
}

void ascc_progress_add(ascc_progress *p, size_t count)
{
    p->done += count;
    const double time = p->visible ? now() : 0.0;
    if (!p->visible || (time - p->drawn < 0.1 && p->done < p->total))
        return;
    p->drawn = time;
    draw(p, time);
}

void ascc_progress_end(ascc_progress *p)
{
    if (p->visible)
        fprintf(stderr, "\r\033[K");
}
