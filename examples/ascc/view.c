/* ascc view: a window on a run or a sequence. SPDX-License-Identifier: MIT */
#include <math.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>

#include "arguments.h"
#include "commands.h"
#include "console.h"
#include "live.h"
#include "picture.h"
#include "scenes.h"
#include "view_script.h"
#include "window.h"

enum { WIDTH = 1280, HEIGHT = 720, LEFT = 40, ROW = 20 };

typedef struct viewer {
    ascc_live live;
    ascc_canvas canvas;
    ascc_window *window;
    ascc_script script;
    bool scripted, running, help, times, quit;
    bool turning, dragging; /* with the left button down */
    double x, y;            /* where the mouse was */
    double rate;            /* simulated seconds a second, smoothed */
    char note[512];         /* the last thing worth telling */
} viewer;

static const char *const keys[] = {"space  pause, go on",
                                   ".      one step or frame",
                                   ",      one frame back",
                                   "r      restart",
                                   "m      next model",
                                   "c      colour: speed, density",
                                   "b      ball in the water, or not",
                                   "t      times, or not",
                                   "p      picture: view-00000.png",
                                   "0      look from where it began",
                                   "h      help",
                                   "q      quit",
                                   "mouse  drag the ball, turn, zoom",
                                   NULL};

static void usage(FILE *to)
{
    fprintf(
        to,
        "usage: ascc view MODEL SCENE [options]\n"
        "ascc view SEQUENCE [options]\n\n"
        "Runs a model on a scene in a window, or plays a sequence file.\n\n"
        "MODEL  a model by name (water3d) or file, a published network, or demo\n"
        "SCENE  a sequence file, whose first frame starts the run, or one of (3D without -2d)\n");
    ascc_scene_list(to);
    fprintf(
        to,
        "\n"
        "  --model MODEL      one more model, for the key m\n"
        "  --ball R           radius of the ball, metres (four spacings, less in a narrow box)\n"
        "  --size N           particles along a named scene's longest edge\n"
        "  --spacing S        particle spacing of a named scene, metres (the model's)\n"
        "  --threads N        threads to use (1)\n"
        "  --paused           begins paused\n"
        "  --script FILE      what is done at which frame: docs/viewing.md\n\n"
        "Keys:\n");
    for (const char *const *key = keys; *key; key++)
        fprintf(to, "  %s\n", *key);
}

static const char *const option_names[] = {"--model",   "--ball",   "--size",   "--spacing",
                                           "--threads", "--paused", "--script", NULL};

/* ---- Arguments ---- */

typedef struct options {
    ascc_live_options live;
    const char *script, *word[2];
    int words;
    bool paused;
} options;

static bool read_option(options *o, const char *name, const char *value)
{
    if (strcmp(name, "--script") == 0)
        return (o->script = value) != NULL;
    if (strcmp(name, "--ball") == 0)
        return ascc_read_real("view", name, value, 1e-6, 1e6, &o->live.ball);
    if (strcmp(name, "--spacing") == 0)
        return ascc_read_real("view", name, value, 1e-6, 1e6, &o->live.spacing);
    if (strcmp(name, "--size") == 0)
        return ascc_read_whole("view", name, value, 4, 1000, &o->live.size);
    if (strcmp(name, "--threads") == 0)
        return ascc_read_whole("view", name, value, 1, 1024, &o->live.threads);
    if (strcmp(name, "--model") != 0)
        return ascc_bad_option("view", option_names, name, value);
    if (o->live.models == ASCC_LIVE_MODELS - 1)
        return ascc_bad_use("view", "too many models", value, NULL);
    o->live.model[++o->live.models] = value; /* the first is a word */
    return true;
}

static bool read_arguments(options *o, int argc, char **argv)
{
    for (int i = 0; i < argc; i++) {
        if (strcmp(argv[i], "--paused") == 0) {
            o->paused = true;
        } else if (argv[i][0] == '-') {
            if (i + 1 >= argc)
                return ascc_bad_option("view", option_names, argv[i], NULL);
            if (!read_option(o, argv[i], argv[i + 1]))
                return false;
            i++;
        } else if (o->words < 2) {
            o->word[o->words++] = argv[i];
        } else {
            return ascc_bad_use("view", "one argument too many", argv[i], NULL);
        }
    }
    if (o->words == 0 || (o->words == 1 && o->live.models))
        return ascc_bad_use("view", "MODEL and SCENE, or a SEQUENCE is wanted", NULL, NULL);
    o->live.scene = o->word[o->words - 1];
    o->live.model[0] = o->word[0];
    o->live.models += o->words == 2;
    return true;
}

/* ---- What is seen ---- */

static void write_times(viewer *v, int y)
{
    char text[64];
    (void)snprintf(text, sizeof text, "%.2f of real time   h: help", v->rate);
    ascc_canvas_text(&v->canvas, LEFT, y - ROW, 2, text);
    for (size_t i = 0; i < v->live.stages; i++) {
        y += ROW;
        (void)snprintf(text, sizeof text, "%-11s %7.2f ms", v->live.stage[i].name,
                       1e3 * v->live.stage[i].seconds);
        ascc_canvas_text(&v->canvas, LEFT, y, 2, text);
    }
}

static void write_state(viewer *v)
{
    const ascc_live *l = &v->live;
    char text[160];
    if (l->options.models)
        (void)snprintf(text, sizeof text, "%.40s   t = %.2f s   step %zu   %zu particles   %s",
                       l->options.model[l->model], l->time, l->step, l->count,
                       v->running ? "" : "paused");
    else
        (void)snprintf(text, sizeof text, "t = %.2f s   frame %zu/%zu   %zu particles   %s",
                       l->time, l->step, l->scene.frames - 1, l->count, v->running ? "" : "paused");
    ascc_canvas_text(&v->canvas, LEFT, 22, 2, text);
    if (v->times)
        write_times(v, 22 + 2 * ROW);
    for (int i = 0; v->help && keys[i]; i++)
        ascc_canvas_text(&v->canvas, WIDTH - LEFT - 400, 22 + (3 + i) * ROW, 2, keys[i]);
    ascc_canvas_text(&v->canvas, LEFT, HEIGHT - 2 * ROW, 2, v->note);
}

static bool draw(viewer *v)
{
    const ascc_marks marks = ascc_live_marks(&v->live);
    if (!ascc_draw(&v->canvas, &v->live.view, &marks))
        return false;
    write_state(v);
    return true;
}

/* What comes of it is told on the screen, to a script on stderr: its pictures show nothing of others. */
static void save_picture(viewer *v, const char *path, bool tell)
{
    char said[512] = "no memory for a picture";
    if (draw(v) && ascc_picture_save(path, &v->canvas, said, sizeof said))
        (void)snprintf(said, sizeof said, "%.500s written", path);
    if (tell)
        (void)snprintf(v->note, sizeof v->note, "%s", said);
    else
        ascc_line(stderr, "ascc view: %s", said);
}

/* ---- What is done ---- */

/* A deed that may fail: what it tells is shown. */
static void tell(viewer *v, bool good)
{
    (void)snprintf(v->note, sizeof v->note, "%s", good ? "" : v->live.error);
}

static void on_key(viewer *v, char key)
{
    char path[64];
    ascc_live *l = &v->live;
    if (key == ' ')
        v->running = !v->running;
    else if (key == '.' || key == ',') {
        v->running = false;
        tell(v, key == '.' ? ascc_live_advance(l) : ascc_live_back(l));
    } else if (key == 'r')
        tell(v, ascc_live_restart(l));
    else if (key == 'm')
        tell(v, ascc_live_switch(l));
    else if (key == 'c')
        tell(v, ascc_live_toggle_density(l));
    else if (key == 'b')
        tell(v, ascc_live_toggle_ball(l));
    else if (key == 't')
        v->times = !v->times;
    else if (key == 'h')
        v->help = !v->help;
    else if (key == 'q')
        v->quit = true;
    else if (key == '0') {
        l->view = ascc_view_of(&l->scene);
    } else if (key == 'p') {
        (void)snprintf(path, sizeof path, "view-%05zu.png", l->step);
        save_picture(v, path, true);
    }
}

/* On the ball it takes the ball, elsewhere it turns the view. */
static void on_press(viewer *v, double x, double y)
{
    const ascc_live_ball *ball = &v->live.ball;
    double pixel[2];
    const double scale = ascc_view_pixel(&v->live.view, &v->canvas, ball->center, pixel);
    v->dragging = ball->there && hypot(x - pixel[0], y - pixel[1]) <= scale * ball->radius;
    v->turning = !v->dragging && v->live.view.dimension == 3;
    v->x = x;
    v->y = y;
}

static void on_move(viewer *v, double x, double y)
{
    const double by[2] = {x - v->x, y - v->y};
    ascc_view *view = &v->live.view;
    v->x = x;
    v->y = y;
    if (v->turning) {
        view->turn -= 0.008 * by[0];
        view->tilt = fmin(fmax(view->tilt + 0.008 * by[1], -1.5), 1.5);
    } else if (v->dragging) {
        double shift[3], target[3];
        ascc_view_shift(view, &v->canvas, by, shift);
        for (int c = 0; c < 3; c++)
            target[c] = v->live.ball.target[c] + shift[c];
        ascc_live_pull(&v->live, target);
    }
}

static void on_input(viewer *v, const ascc_input *input)
{
    ascc_view *view = &v->live.view;
    switch (input->kind) {
    case ASCC_INPUT_QUIT:
        v->quit = true;
        break;
    case ASCC_INPUT_KEY:
        on_key(v, input->key);
        break;
    case ASCC_INPUT_PRESS:
        on_press(v, input->x, input->y);
        break;
    case ASCC_INPUT_MOVE:
        on_move(v, input->x, input->y);
        break;
    case ASCC_INPUT_RELEASE:
        v->turning = v->dragging = false;
        break;
    case ASCC_INPUT_WHEEL:
        view->zoom = fmin(fmax(view->zoom * pow(1.15, input->turn), 0.1), 50.0);
        break;
    }
}

/* What hands do, and what the script has for this frame. */
static void take_input(viewer *v, long frame)
{
    ascc_input input;
    const ascc_script_line *line;
    while (ascc_window_next(v->window, &input))
        on_input(v, &input);
    while ((line = ascc_script_due(&v->script, frame)) != NULL) {
        if (line->picture)
            save_picture(v, line->picture, false);
        else
            ascc_window_do(v->window, &line->input);
        while (ascc_window_next(v->window, &input))
            on_input(v, &input);
    }
}

/* ---- The loop ---- */

static volatile sig_atomic_t interrupted;

static void on_interrupt(int number)
{
    (void)number;
    interrupted = 1;
}

/* No faster than the fluid would be; a script waits for nothing. */
static void keep_pace(viewer *v, double began, double simulated)
{
    const double least = v->running && simulated > 0.0 ? simulated : 0.02;
    const double left = began + least - ascc_window_clock();
    if (!v->scripted && left > 0.0)
        ascc_window_rest(left);
    const double took = ascc_window_clock() - began;
    if (simulated > 0.0 && took > 0.0)
        v->rate += 0.1 * (simulated / took - v->rate);
}

static bool loop(viewer *v)
{
    for (long frame = 0; !v->quit && !interrupted; frame++) {
        const double began = ascc_window_clock(), time = v->live.time;
        take_input(v, frame);
        if (v->quit)
            break;
        if (v->running && !ascc_live_advance(&v->live)) {
            v->running = false;
            tell(v, false);
        }
        if (!draw(v)) {
            ascc_line(stderr, "ascc view: no memory to draw");
            return false;
        }
        ascc_window_show(v->window, &v->canvas);
        keep_pace(v, began, v->live.time - time);
    }
    return true;
}

static bool open_viewer(viewer *v, const options *o, char *error, size_t capacity)
{
    v->running = !o->paused;
    v->times = true;
    v->scripted = o->script != NULL;
    if (o->script && !ascc_script_read(&v->script, o->script, error, capacity))
        return false;
    if (!ascc_live_open(&v->live, &o->live)) {
        (void)snprintf(error, capacity, "%s", v->live.error);
        return false;
    }
    if (!ascc_canvas_open(&v->canvas, WIDTH, HEIGHT)) {
        (void)snprintf(error, capacity, "no memory for a picture");
        return false;
    }
    v->window = ascc_window_open("ascc view", WIDTH, HEIGHT, error, capacity);
    return v->window != NULL;
}

int ascc_command_view(int argc, char **argv)
{
    if (argc == 1 && strcmp(argv[0], "--help") == 0) {
        usage(stdout);
        return 0;
    }
    options o = {.live.threads = 1};
    if (!read_arguments(&o, argc, argv))
        return 2;
    viewer v = {.quit = false};
    char error[512] = "";
    bool good = open_viewer(&v, &o, error, sizeof error);
    if (!good)
        ascc_line(stderr, "ascc view: %s", error);
    if (good) {
        (void)signal(SIGINT, on_interrupt);
        (void)signal(SIGTERM, on_interrupt);
        good = loop(&v);
        (void)signal(SIGINT, SIG_DFL);
        (void)signal(SIGTERM, SIG_DFL);
    }
    ascc_window_close(v.window);
    ascc_canvas_close(&v.canvas);
    ascc_live_close(&v.live);
    ascc_script_free(&v.script);
    return !good ? 1 : interrupted ? 130 : 0;
}
