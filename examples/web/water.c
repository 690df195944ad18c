/* A tank of water for a web page: what a page calls, over the public API. SPDX-License-Identifier: MIT
 *
 * All lengths in metres. Pointers are into the memory of the module; they hold until the next call. */
#include <ascc/ascc.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#if defined(__wasm__)
#define EXPORT(name) __attribute__((export_name(#name)))
#else
#define EXPORT(name)
#endif

/* Wall points lie this far apart, in particle spacings: as the networks were trained. */
#define WALL_SPACING 0.64

static struct tank {
    ascc_context *context;
    ascc_model *model;
    ascc_particles *particles;
    ascc_step *step;
    float *numbers; /* positions, then speeds, as the page reads them */
    double width, height, spacing, time_step;
    char message[256];
} tank;

/* The page puts the bytes of a model file there. */
EXPORT(allocate) void *water_allocate(size_t size)
{
    return malloc(size);
}

EXPORT(release) void water_release(void *memory)
{
    free(memory);
}

EXPORT(close) void water_close(void)
{
    ascc_step_destroy(&tank.step);
    ascc_particles_destroy(&tank.particles);
    ascc_model_destroy(&tank.model);
    ascc_context_destroy(&tank.context);
    free(tank.numbers);
    memset(&tank, 0, sizeof tank);
}

/* 1, or 0 with the reason in the message. */
static int told(ascc_status status, const char *message)
{
    if (status == ASCC_OK)
        return 1;
    if (!message || !*message)
        message = ascc_status_text(status);
    strncpy(tank.message, message, sizeof tank.message - 1);
    return 0;
}

static ascc_status add_wall(double x, double y, double normal_x, double normal_y)
{
    const double at[2] = {x, y}, normal[2] = {normal_x, normal_y};
    const ascc_const_array position = {.data = at, .scalar = ASCC_DOUBLE};
    const ascc_const_array normals = {.data = normal, .scalar = ASCC_DOUBLE};
    return ascc_particles_add_boundary(tank.particles, 1, &position, &normals, 0, NULL);
}

/* One layer of points around, half a distance from the corners on. */
static ascc_status add_walls(void)
{
    ascc_status status = ASCC_OK;
    const double apart = WALL_SPACING * tank.spacing;
    const int across = (int)ceil(tank.width / apart), up = (int)ceil(tank.height / apart);
    for (int i = 0; i < across && status == ASCC_OK; i++) {
        const double x = (i + 0.5) * tank.width / across;
        status = add_wall(x, 0.0, 0.0, 1.0);
        if (status == ASCC_OK)
            status = add_wall(x, tank.height, 0.0, -1.0);
    }
    for (int i = 0; i < up && status == ASCC_OK; i++) {
        const double y = (i + 0.5) * tank.height / up;
        status = add_wall(0.0, y, 1.0, 0.0);
        if (status == ASCC_OK)
            status = add_wall(tank.width, y, -1.0, 0.0);
    }
    return status;
}

/* A block of columns x rows particles in the lower left corner. */
static ascc_status add_water(int columns, int rows)
{
    const size_t count = (size_t)columns * (size_t)rows;
    tank.numbers = malloc(count * 3 * sizeof *tank.numbers);
    if (!tank.numbers)
        return ASCC_ERROR_MEMORY;
    for (size_t i = 0; i < count; i++) {
        tank.numbers[2 * i] = (float)(((double)(i % (size_t)columns) + 0.5) * tank.spacing);
        tank.numbers[2 * i + 1] = (float)(((double)(i / (size_t)columns) + 0.5) * tank.spacing);
    }
    const ascc_const_array position = {.data = tank.numbers};
    return ascc_particles_add_fluid(tank.particles, count, &position, NULL, NULL, NULL);
}

/* A dam break: water of columns x rows particles in a tank four times as wide and half as high again. The model
 * is the bytes of a file. Returns 1, or 0 with a message. */
EXPORT(open) int water_open(const void *model, size_t size, int columns, int rows)
{
    ascc_particles_options options = {.size = sizeof options};
    ascc_model_info info = {.size = sizeof info};
    water_close();
    if (!told(ascc_context_create(NULL, &tank.context), ""))
        return 0;
    const ascc_status loaded = ascc_model_load_memory(tank.context, model, size, &tank.model);
    char why[256];
    (void)ascc_context_message(tank.context, why, sizeof why);
    if (!told(loaded, why) || !told(ascc_model_get_info(tank.model, &info), "") ||
        !told(ascc_model_particles_options(tank.model, 1.0, &options), ""))
        return 0;
    if (info.dimension != 2)
        return told(ASCC_ERROR_MISMATCH, "a network of two dimensions is wanted");
    tank.spacing = info.particle_spacing;
    tank.time_step = info.time_step;
    tank.width = 4.0 * columns * tank.spacing;
    tank.height = 1.5 * rows * tank.spacing;
    return told(ascc_particles_create(tank.context, &options, &tank.particles), "") &&
           told(add_water(columns, rows), ascc_particles_message(tank.particles)) &&
           told(add_walls(), ascc_particles_message(tank.particles)) &&
           told(ascc_step_create(tank.context, tank.model, NULL, &tank.step), "");
}

/* Runs so many steps under this gravity, m/s^2. Returns 1, or 0 with a message. */
EXPORT(run) int water_run(int steps, double gravity_x, double gravity_y)
{
    const double gravity[3] = {gravity_x, gravity_y, 0.0};
    const ascc_forces forces = {.size = sizeof forces, .gravity = gravity};
    return tank.step && told(ascc_step_run(tank.step, tank.particles, &forces, steps),
                             ascc_step_message(tank.step));
}

EXPORT(count) int water_count(void)
{
    return tank.particles ? (int)ascc_particles_count(tank.particles, ASCC_FLUID) : 0;
}

/* float[count][2] positions, then float[count] speeds, m/s; NULL where there are none. */
EXPORT(numbers) const float *water_numbers(void)
{
    const size_t count = (size_t)water_count();
    float *speed = tank.numbers + 2 * count;
    const ascc_array numbers = {.data = tank.numbers};
    if (count == 0 || ascc_particles_get(tank.particles, ASCC_FLUID, ASCC_VELOCITY, 0, count,
                                         &numbers) != ASCC_OK)
        return NULL;
    for (size_t i = 0; i < count; i++)
        speed[i] = hypotf(tank.numbers[2 * i], tank.numbers[2 * i + 1]);
    return ascc_particles_get(tank.particles, ASCC_FLUID, ASCC_POSITION, 0, count, &numbers) ==
                   ASCC_OK
               ? tank.numbers
               : NULL;
}

EXPORT(width) double water_width(void)
{
    return tank.width;
}

EXPORT(height) double water_height(void)
{
    return tank.height;
}

EXPORT(spacing) double water_spacing(void)
{
    return tank.spacing;
}

EXPORT(time_step) double water_time_step(void)
{
    return tank.time_step;
}

/* Half of the state's hash: the upper 32 bits, or the lower. */
EXPORT(hash) uint32_t water_hash(int upper)
{
    const uint64_t hash = tank.particles ? ascc_particles_hash(tank.particles) : 0;
    return (uint32_t)(upper ? hash >> 32 : hash);
}

/* Why the last call failed. */
EXPORT(message) const char *water_message(void)
{
    return tank.message;
}
