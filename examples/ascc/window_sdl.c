/* A window by SDL2: its renderer draws the canvas as one texture. SPDX-License-Identifier: MIT */
#include "window.h"

#define SDL_MAIN_HANDLED
#include <SDL.h>
#include <stdio.h>
#include <stdlib.h>

struct ascc_window {
    SDL_Window *window;
    SDL_Renderer *renderer;
    SDL_Texture *texture;
    int width, height;
};

/* The program ends by itself where it is interrupted. */
static bool start(void)
{
    SDL_SetMainReady();
    (void)SDL_SetHint(SDL_HINT_NO_SIGNAL_HANDLERS, "1");
    return SDL_Init(SDL_INIT_VIDEO) == 0;
}

static SDL_Renderer *make_renderer(SDL_Window *window)
{
    SDL_Renderer *fast = SDL_CreateRenderer(window, -1, 0);
    return fast ? fast : SDL_CreateRenderer(window, -1, SDL_RENDERER_SOFTWARE);
}

static bool make(ascc_window *w, const char *title, int width, int height)
{
    w->width = width;
    w->height = height;
    w->window = SDL_CreateWindow(title, SDL_WINDOWPOS_UNDEFINED, SDL_WINDOWPOS_UNDEFINED, width,
                                 height, SDL_WINDOW_RESIZABLE);
    w->renderer = w->window ? make_renderer(w->window) : NULL;
    if (!w->renderer || SDL_RenderSetLogicalSize(w->renderer, width, height) != 0)
        return false;
    w->texture = SDL_CreateTexture(w->renderer, SDL_PIXELFORMAT_RGB24, SDL_TEXTUREACCESS_STREAMING,
                                   width, height);
    return w->texture != NULL;
}

ascc_window *ascc_window_open(const char *title, int width, int height, char *error,
                              size_t capacity)
{
    ascc_window *w = calloc(1, sizeof *w);
    if (w && start() && make(w, title, width, height))
        return w;
    (void)snprintf(error, capacity, "no window: %s", w ? SDL_GetError() : "no memory");
    ascc_window_close(w);
    return NULL;
}

void ascc_window_close(ascc_window *w)
{
    if (!w)
        return;
    if (w->texture)
        SDL_DestroyTexture(w->texture);
    if (w->renderer)
        SDL_DestroyRenderer(w->renderer);
    if (w->window)
        SDL_DestroyWindow(w->window);
    SDL_Quit();
    free(w);
}

void ascc_window_show(ascc_window *w, const ascc_canvas *canvas)
{
    (void)SDL_UpdateTexture(w->texture, NULL, canvas->pixel, 3 * canvas->width);
    (void)SDL_RenderClear(w->renderer);
    (void)SDL_RenderCopy(w->renderer, w->texture, NULL, NULL);
    SDL_RenderPresent(w->renderer);
}

static char letter_of(SDL_Keycode code)
{
    if (code == SDLK_RIGHT)
        return '.';
    if (code == SDLK_LEFT)
        return ',';
    if (code == SDLK_ESCAPE)
        return 'q';
    return code > 0 && code < 128 ? (char)code : '\0';
}

/* False for what nobody asks for. */
static bool read_event(const SDL_Event *e, ascc_input *input)
{
    switch (e->type) {
    case SDL_QUIT:
        *input = (ascc_input){.kind = ASCC_INPUT_QUIT};
        return true;
    case SDL_KEYDOWN:
        *input = (ascc_input){.kind = ASCC_INPUT_KEY, .key = letter_of(e->key.keysym.sym)};
        return true;
    case SDL_MOUSEBUTTONDOWN:
    case SDL_MOUSEBUTTONUP:
        *input = (ascc_input){.kind = e->type == SDL_MOUSEBUTTONDOWN ? ASCC_INPUT_PRESS
                                                                     : ASCC_INPUT_RELEASE,
                              .x = e->button.x,
                              .y = e->button.y};
        return e->button.button == SDL_BUTTON_LEFT;
    case SDL_MOUSEMOTION:
        *input = (ascc_input){.kind = ASCC_INPUT_MOVE, .x = e->motion.x, .y = e->motion.y};
        return true;
    case SDL_MOUSEWHEEL:
        *input = (ascc_input){.kind = ASCC_INPUT_WHEEL, .turn = e->wheel.y};
        return true;
    default:
        return false;
    }
}

bool ascc_window_next(ascc_window *w, ascc_input *input)
{
    SDL_Event event;
    (void)w;
    while (SDL_PollEvent(&event))
        if (read_event(&event, input))
            return true;
    return false;
}

void ascc_window_do(ascc_window *w, const ascc_input *input)
{
    const Uint32 id = SDL_GetWindowID(w->window);
    const int x = (int)input->x, y = (int)input->y;
    SDL_Event e = {0};
    switch (input->kind) {
    case ASCC_INPUT_QUIT:
        e.quit = (SDL_QuitEvent){.type = SDL_QUIT};
        break;
    case ASCC_INPUT_KEY:
        e.key = (SDL_KeyboardEvent){
            .type = SDL_KEYDOWN, .windowID = id, .keysym.sym = (SDL_Keycode)input->key};
        break;
    case ASCC_INPUT_PRESS:
    case ASCC_INPUT_RELEASE:
        e.button = (SDL_MouseButtonEvent){
            .type = input->kind == ASCC_INPUT_PRESS ? SDL_MOUSEBUTTONDOWN : SDL_MOUSEBUTTONUP,
            .windowID = id,
            .button = SDL_BUTTON_LEFT,
            .x = x,
            .y = y};
        break;
    case ASCC_INPUT_MOVE:
        e.motion = (SDL_MouseMotionEvent){.type = SDL_MOUSEMOTION, .windowID = id, .x = x, .y = y};
        break;
    case ASCC_INPUT_WHEEL:
        e.wheel =
            (SDL_MouseWheelEvent){.type = SDL_MOUSEWHEEL, .windowID = id, .y = (int)input->turn};
        break;
    }
    (void)SDL_PushEvent(&e);
}

double ascc_window_clock(void)
{
    return (double)SDL_GetPerformanceCounter() / (double)SDL_GetPerformanceFrequency();
}

void ascc_window_rest(double seconds)
{
    SDL_Delay((Uint32)(1e3 * seconds));
}
