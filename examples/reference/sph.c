/* Weakly compressible SPH: equations of Adami, Hu and Adams 2012 with delta-SPH density diffusion.
 * SPDX-License-Identifier: MIT
 *
 * One step (kick, drift, kick; Adami et al. eq. 25 and following):
 *     v += dt/2 a         x += dt/2 v
 *     rho += dt * rate(x, v)              sweep 1: continuity and density diffusion
 *     x += dt/2 v         p = p(rho)
 *     walls take p and v from the fluid   sweep 2
 *     a = forces(x, v, rho, p)            sweep 3, which also makes the density gradients
 *     v += dt/2 a
 */
#include "sph.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "near.h"

#define PI 3.14159265358979323846
#define SURFACE 0.85 /* share below which it is at the surface */

struct sph {
    sph_options options;
    near_lists *lists;
    size_t fluid, walls, capacity; /* capacity of state, ghosts included */
    sph_particle *state;           /* [fluid | walls | ghosts] */
    double (*acceleration)[3];     /* [fluid] */
    double (*gradient)[3];         /* [capacity] of the density, renormalised */
    double (*shift)[3];            /* [fluid] */
    double *rate;                  /* [fluid] of the density */
    double mass, length, support, stiffness, normalisation, slope, spacing_weight;
    double contact, wall_contact,
        push;   /* distance below which pairs push each other, and the force, N */
    bool ready; /* accelerations belong to the positions */
    sph_totals totals;
    ascc_message message;
};

/* ---- Making ---- */

static void set_default(double *value, double otherwise)
{
    if (*value == 0.0)
        *value = otherwise;
}

/* Wendland C2 without its factor; q = distance / smoothing length. */
static inline double wendland(double q)
{
    const double t = 1.0 - 0.5 * q, square = t * t;
    return square * square * (2.0 * q + 1.0);
}

static void derive(sph *s)
{
    sph_options *o = &s->options;
    set_default(&o->rest_density, 1000.0);
    set_default(&o->smoothing, 1.5);
    set_default(&o->density_diffusion, 0.1);
    set_default(&o->impact_viscosity, 1.5);
    set_default(&o->shifting, 1.0);
    set_default(&o->contact, 0.7);
    set_default(&o->courant, 0.5);
    set_default(&o->skin, 0.3);
    const double h = o->smoothing * o->spacing;
    o->impact_viscosity = fmax(0.0, o->impact_viscosity);
    s->length = h;
    s->support = 2.0 * h;
    s->mass = o->rest_density * pow(o->spacing, o->dimension);
    s->stiffness = o->sound_speed * o->sound_speed * o->rest_density / 7.0;
    s->normalisation =
        o->dimension == 2 ? 7.0 / (4.0 * PI * h * h) : 21.0 / (16.0 * PI * h * h * h);
    s->slope = -5.0 * s->normalisation / (h * h);
    s->spacing_weight = wendland(1.0 / o->smoothing);
    s->contact = o->contact * o->spacing;
    /* four wall points in a square leave a hole 0.71 spacings from each */
    s->wall_contact = o->dimension == 3 ? 1.25 * s->contact : s->contact;
    s->push = 0.5 * s->mass * o->sound_speed * o->sound_speed / o->spacing;
}

sph *sph_create(const sph_options *options)
{
    if ((options->dimension != 2 && options->dimension != 3) || !(options->spacing > 0.0) ||
        !(options->sound_speed > 0.0))
        return NULL;
    sph *s = calloc(1, sizeof *s);
    if (!s)
        return NULL;
    s->options = *options;
    derive(s);
    near_options near = {.dimension = options->dimension,
                         .thread_count = options->thread_count,
                         .radius = s->support,
                         .skin = s->options.skin * options->spacing};
    memcpy(near.period, options->period, sizeof near.period);
    s->lists = near_create(&near);
    if (!s->lists)
        sph_destroy(&s);
    return s;
}

void sph_destroy(sph **solver)
{
    sph *s = *solver;
    if (!s)
        return;
    near_destroy(&s->lists);
    free(s->state);
    free(s->acceleration);
    free(s->gradient);
    free(s->shift);
    free(s->rate);
    free(s);
    *solver = NULL;
}

int32_t sph_wall_layers(const sph_options *options)
{
    const double smoothing = options->smoothing > 0.0 ? options->smoothing : 1.5;
    return (int32_t)ceil(2.0 * smoothing - 1e-9);
}

static bool grow(void **array, size_t count, size_t element)
{
    void *grown = realloc(*array, (count ? count : 1) * element);
    if (grown)
        *array = grown;
    return grown != NULL;
}

/* Room for `count` points in all arrays. */
static ascc_status reserve(sph *s, size_t count)
{
    if (count <= s->capacity)
        return ASCC_OK;
    if (!grow((void **)&s->state, count, sizeof *s->state) ||
        !grow((void **)&s->gradient, count, sizeof *s->gradient) ||
        !grow((void **)&s->acceleration, count, sizeof *s->acceleration) ||
        !grow((void **)&s->shift, count, sizeof *s->shift) ||
        !grow((void **)&s->rate, count, sizeof *s->rate))
        return ascc_fail(&s->message, ASCC_ERROR_MEMORY, "no memory for %zu particles", count);
    s->capacity = count;
    return ASCC_OK;
}

static void place(const sph *s, sph_particle *p, size_t count, const double *position,
                  const double *velocity)
{
    const size_t d = (size_t)s->options.dimension;
    for (size_t i = 0; i < count; i++) {
        p[i] = (sph_particle){.density = s->options.rest_density};
        for (size_t c = 0; c < d; c++) {
            p[i].position[c] = position[i * d + c];
            p[i].velocity[c] = velocity ? velocity[i * d + c] : 0.0;
        }
    }
}

ascc_status sph_set_fluid(sph *s, size_t count, const double *position, const double *velocity)
{
    const ascc_status status = reserve(s, count + s->walls);
    if (status != ASCC_OK)
        return status;
    if (s->walls)
        memmove(s->state + count, s->state + s->fluid, s->walls * sizeof *s->state);
    s->fluid = count;
    place(s, s->state, count, position, velocity);
    if (s->capacity)
        memset(s->gradient, 0, s->capacity * sizeof *s->gradient);
    s->totals = (sph_totals){0};
    s->ready = false;
    near_forget(s->lists);
    return ASCC_OK;
}

ascc_status sph_set_walls(sph *s, size_t count, const double *position)
{
    const ascc_status status = reserve(s, s->fluid + count);
    if (status != ASCC_OK)
        return status;
    s->walls = count;
    place(s, s->state + s->fluid, count, position, NULL);
    if (s->capacity)
        memset(s->gradient, 0, s->capacity * sizeof *s->gradient);
    s->ready = false;
    near_forget(s->lists);
    return ASCC_OK;
}

/* ---- Equation of state: Tait with exponent 7 ---- */

static inline double pressure_of(const sph *s, double density)
{
    const double x = density / s->options.rest_density, x3 = x * x * x;
    const double p = s->stiffness * (x3 * x3 * x - 1.0);
    return p < 0.0 && !s->options.keep_tension ? 0.0 : p;
}

static inline double density_of(const sph *s, double pressure)
{
    const double ratio = 1.0 + pressure / s->stiffness;
    return s->options.rest_density * pow(ratio > 1e-3 ? ratio : 1e-3, 1.0 / 7.0);
}

void sph_set_depth(sph *s, const double *depth)
{
    double square = 0.0;
    for (int c = 0; c < 3; c++)
        square += s->options.gravity[c] * s->options.gravity[c];
    for (size_t i = 0; i < s->fluid; i++)
        s->state[i].density = density_of(s, s->options.rest_density * sqrt(square) * depth[i]);
    s->ready = false;
}

/* ---- Neighbour lists and ghosts ---- */

static void refresh_ghosts(sph *s)
{
    const size_t own = s->fluid + s->walls;
    for (size_t g = 0; g < s->lists->ghosts; g++) {
        const size_t owner = s->lists->owner[g];
        s->state[own + g] = s->state[owner];
        for (int c = 0; c < 3; c++)
            s->state[own + g].position[c] += s->lists->shift[g][c];
        memcpy(s->gradient[own + g], s->gradient[owner], sizeof *s->gradient);
    }
}

static void wrap_positions(sph *s)
{
    for (int c = 0; c < s->options.dimension; c++) {
        const double period = s->options.period[c];
        for (size_t i = 0; period > 0.0 && i < s->fluid; i++) {
            double *x = &s->state[i].position[c];
            *x -= period * floor(*x / period);
        }
    }
}

static ascc_status refresh(sph *s)
{
    const size_t stride = sizeof(sph_particle) / sizeof(double);
    if (!near_current(s->lists, s->fluid, s->state->position, stride)) {
        wrap_positions(s);
        ascc_status status = near_update(s->lists, s->fluid, s->walls, s->state->position, stride);
        if (status != ASCC_OK)
            return ascc_fail(&s->message, status, "%s", s->lists->message.text);
        status = reserve(s, s->fluid + s->walls + s->lists->ghosts);
        if (status != ASCC_OK)
            return status;
    }
    refresh_ghosts(s);
    return ASCC_OK;
}

/* ---- Sweeps. `d` is a constant at every call, so each becomes a 2D and a 3D loop ---- */

#define INLINE static inline __attribute__((always_inline))

typedef struct pair {
    double r[3]; /* x_i - x_j */
    double v[3]; /* v_i - v_j */
    double square, distance;
    double slope; /* gradient of the kernel = slope * r */
} pair;

/* False if the two do not see each other. */
INLINE bool look(const sph *s, const sph_particle *a, const sph_particle *b, const int d, pair *p)
{
    p->square = 0.0;
    for (int c = 0; c < d; c++) {
        p->r[c] = a->position[c] - b->position[c];
        p->square += p->r[c] * p->r[c];
    }
    if (!(p->square < s->support * s->support))
        return false;
    for (int c = 0; c < d; c++)
        p->v[c] = a->velocity[c] - b->velocity[c];
    p->distance = sqrt(p->square);
    const double t = 1.0 - p->distance / s->support;
    p->slope = s->slope * (t * t * t);
    return true;
}

INLINE double dot(const double *a, const double *b, const int d)
{
    double sum = a[0] * b[0] + a[1] * b[1];
    if (d == 3)
        sum += a[2] * b[2];
    return sum;
}

/* Sweep 1: d rho_i / dt = rho_i sum V_j v_ij . grad W + delta c h sum V_j psi_ij . grad W, where
 * psi . grad W = -2 slope ((rho_j - rho_i) - (g_i + g_j) . r_ji / 2) with density gradients g. */
INLINE void continuity_row(sph *s, size_t i, const int d)
{
    const sph_particle *a = &s->state[i];
    const uint32_t *index = s->lists->index + s->lists->start[i];
    const size_t walls_end = s->fluid + s->walls;
    double divergence = 0.0, diffusion = 0.0;
    for (uint32_t k = 0; k < s->lists->count[i]; k++) {
        const size_t j = index[k];
        const sph_particle *b = &s->state[j];
        pair p;
        if (!look(s, a, b, d, &p))
            continue;
        const double volume = s->mass / b->density;
        if (j >= s->fluid && j < walls_end) { /* walls stand still, whatever velocity they show */
            divergence += volume * p.slope * dot(a->velocity, p.r, d);
            continue;
        }
        divergence += volume * p.slope * dot(p.v, p.r, d);
        double linear = 0.0; /* (g_i + g_j) . r_ij / 2 */
        for (int c = 0; c < d; c++)
            linear += 0.5 * (s->gradient[i][c] + s->gradient[j][c]) * p.r[c];
        diffusion -= 2.0 * volume * p.slope * (b->density - a->density + linear);
    }
    const double delta = s->options.density_diffusion;
    s->rate[i] = a->density * divergence;
    if (delta > 0.0)
        s->rate[i] += delta * s->length * s->options.sound_speed * diffusion;
}

static void continuity(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    sph *s = data;
    for (size_t i = begin; i < end; i++)
        if (s->options.dimension == 2)
            continuity_row(s, i, 2);
        else
            continuity_row(s, i, 3);
}

/* Sweep 2: the generalised wall condition (Adami et al. 2012, eq. 22, 23, 27): pressure from the fluid
 * plus the weight of what lies between, velocity opposite to the fluid's mean. */
static void walls(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    sph *s = data;
    const int d = s->options.dimension;
    for (size_t w = begin; w < end; w++) {
        sph_particle *a = &s->state[s->fluid + w];
        double sum = 0.0, pressure = 0.0, velocity[3] = {0};
        for (size_t k = s->lists->wall_start[w]; k < s->lists->wall_start[w + 1]; k++) {
            const sph_particle *b = &s->state[s->lists->wall_index[k]];
            pair p;
            if (!look(s, a, b, d, &p))
                continue;
            const double weight = wendland(p.distance / s->length);
            sum += weight;
            pressure += weight * (b->pressure + b->density * dot(s->options.gravity, p.r, d));
            for (int c = 0; c < d; c++)
                velocity[c] += weight * b->velocity[c];
        }
        const double inverse = sum > 0.0 ? 1.0 / sum : 0.0;
        pressure *= inverse;
        a->pressure = pressure < 0.0 && !s->options.keep_tension ? 0.0 : pressure;
        a->density = density_of(s, a->pressure);
        for (int c = 0; c < 3; c++)
            a->velocity[c] = -velocity[c] * inverse;
    }
}

/* Sums of sweep 3 for one particle. */
typedef struct sums {
    double force[3];    /* N (per metre in 2D) */
    double gradient[3]; /* sum V_j (rho_j - rho_i) grad W, fluid only */
    double moment[6];   /* sum V_j r_ji grad W: xx yy xy zz xz yz, fluid only */
    double shift[3];    /* sum V_j (1 + 0.2 (W / W(spacing))^4) grad W */
    double trace;       /* of the moment, walls included: `dimension` inside the fluid */
} sums;

/* Pressure and viscosity of a pair, N: coefficient of r_ij. Commutes, so that forces are opposite. */
INLINE double pair_force(const sph *s, const sph_particle *a, const sph_particle *b, const pair *p,
                         double volume_a, double volume_b, bool wall, const int d)
{
    const double both = a->density + b->density;
    const double pressure = (b->density * a->pressure + a->density * b->pressure) / both;
    double force = -(volume_a * volume_a + volume_b * volume_b) * pressure * p->slope;
    const sph_options *o = &s->options;
    const double approach = dot(p->v, p->r, d);
    const double blur = 0.01 * s->length * s->length;
    if (o->viscosity > 0.0)
        force += 2.0 * (d + 2) * o->viscosity * o->rest_density * volume_a * volume_b * approach /
                 (p->square + blur) * p->slope;
    const double closing = wall ? dot(a->velocity, p->r, d) : approach; /* walls stand still */
    if (closing < 0.0) {
        const double mu = s->length * closing / (p->square + blur);
        const double linear = o->artificial_viscosity * o->sound_speed;
        force +=
            2.0 * s->mass * s->mass / both * mu * (linear - o->impact_viscosity * mu) * p->slope;
    }
    const double contact = wall ? s->wall_contact : s->contact;
    if (p->distance < contact && p->distance > 0.0) /* falls off to 0 at the contact distance */
        force += s->push * (1.0 / p->distance - 1.0 / contact);
    return force;
}

INLINE void add_fluid(sums *m, const pair *p, double volume, double difference, const int d)
{
    const double weight = volume * p->slope;
    for (int c = 0; c < d; c++)
        m->gradient[c] += weight * difference * p->r[c];
    m->moment[0] -= weight * p->r[0] * p->r[0];
    m->moment[1] -= weight * p->r[1] * p->r[1];
    m->moment[2] -= weight * p->r[0] * p->r[1];
    if (d == 3) {
        m->moment[3] -= weight * p->r[2] * p->r[2];
        m->moment[4] -= weight * p->r[0] * p->r[2];
        m->moment[5] -= weight * p->r[1] * p->r[2];
    }
}

INLINE void add_shift(const sph *s, sums *m, const pair *p, double volume, const int d)
{
    const double ratio = wendland(p->distance / s->length) / s->spacing_weight;
    const double square = ratio * ratio;
    const double weight = volume * p->slope * (1.0 + 0.2 * square * square);
    for (int c = 0; c < d; c++)
        m->shift[c] += weight * p->r[c];
}

/* gradient = moment^-1 * sum; zero where too few neighbours determine it. */
static void solve_gradient(const sums *m, const int d, double gradient[3])
{
    const double xx = m->moment[0], yy = m->moment[1], xy = m->moment[2], zz = m->moment[3],
                 xz = m->moment[4], yz = m->moment[5];
    const double *b = m->gradient;
    gradient[0] = gradient[1] = gradient[2] = 0.0;
    if (d == 2) {
        const double determinant = xx * yy - xy * xy;
        if (determinant > 0.05) {
            gradient[0] = (yy * b[0] - xy * b[1]) / determinant;
            gradient[1] = (xx * b[1] - xy * b[0]) / determinant;
        }
        return;
    }
    const double c0 = yy * zz - yz * yz, c1 = xz * yz - xy * zz, c2 = xy * yz - xz * yy;
    const double determinant = xx * c0 + xy * c1 + xz * c2;
    if (determinant > 0.02) {
        gradient[0] = (c0 * b[0] + c1 * b[1] + c2 * b[2]) / determinant;
        gradient[1] =
            (c1 * b[0] + (xx * zz - xz * xz) * b[1] + (xy * xz - xx * yz) * b[2]) / determinant;
        gradient[2] =
            (c2 * b[0] + (xy * xz - xx * yz) * b[1] + (xx * yy - xy * xy) * b[2]) / determinant;
    }
}

/* Sweep 3: accelerations, density gradients, and the direction towards fewer neighbours. */
INLINE void force_row(sph *s, size_t i, const int d)
{
    const sph_particle *a = &s->state[i];
    const uint32_t *index = s->lists->index + s->lists->start[i];
    const size_t walls_end = s->fluid + s->walls;
    const double volume_a = s->mass / a->density;
    const bool shifting = s->options.shifting > 0.0;
    sums m = {0};
    for (uint32_t k = 0; k < s->lists->count[i]; k++) {
        const size_t j = index[k];
        const sph_particle *b = &s->state[j];
        pair p;
        if (!look(s, a, b, d, &p))
            continue;
        const bool wall = j >= s->fluid && j < walls_end;
        const double volume_b = s->mass / b->density;
        const double force = pair_force(s, a, b, &p, volume_a, volume_b, wall, d);
        for (int c = 0; c < d; c++)
            m.force[c] += force * p.r[c];
        if (!wall)
            add_fluid(&m, &p, volume_b, b->density - a->density, d);
        m.trace -= volume_b * p.slope * p.square;
        if (shifting)
            add_shift(s, &m, &p, volume_b, d);
    }
    for (int c = 0; c < d; c++)
        s->acceleration[i][c] = m.force[c] / s->mass + s->options.gravity[c];
    solve_gradient(&m, d, s->gradient[i]);
    for (int c = 0; c < d; c++) /* not at the free surface */
        s->shift[i][c] = m.trace > SURFACE * d ? m.shift[c] : 0.0;
}

static void forces(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    sph *s = data;
    for (size_t i = begin; i < end; i++)
        if (s->options.dimension == 2)
            force_row(s, i, 2);
        else
            force_row(s, i, 3);
}

/* ---- Steps ---- */

/* Forces at the present positions. Gradients are written while nobody reads them. */
static ascc_status evaluate(sph *s)
{
    const ascc_status status = refresh(s);
    if (status != ASCC_OK)
        return status;
    for (size_t i = 0; i < s->fluid; i++)
        s->state[i].pressure = pressure_of(s, s->state[i].density);
    refresh_ghosts(s);
    near_run(s->lists, s->walls, walls, s);
    near_run(s->lists, s->fluid, forces, s);
    s->ready = true;
    return ASCC_OK;
}

static double fastest(const sph *s, const double (*vector)[3], size_t stride)
{
    double most = 0.0;
    for (size_t i = 0; i < s->fluid; i++) {
        const double *v = (const double *)vector + i * stride;
        const double square =
            v[0] * v[0] + v[1] * v[1] + (s->options.dimension == 3 ? v[2] * v[2] : 0.0);
        if (!(square <= most))
            most = square;
    }
    return sqrt(most);
}

/* The longest stable step, cut so that equal ones make up the rest of the frame. */
static double step_length(sph *s, double rest)
{
    const sph_options *o = &s->options;
    const size_t stride = sizeof(sph_particle) / sizeof(double);
    const double speed = fastest(s, (const double(*)[3])s->state->velocity, stride);
    const double push = fastest(s, (const double(*)[3])s->acceleration, 3);
    if (speed > s->totals.fastest)
        s->totals.fastest = speed;
    double dt = o->courant * s->length / (o->sound_speed + speed);
    if (push > 0.0)
        dt = fmin(dt, 0.25 * sqrt(s->length / push));
    if (o->viscosity > 0.0)
        dt = fmin(dt, 0.125 * s->length * s->length / o->viscosity);
    if (!isfinite(speed) || !isfinite(push) || dt * o->sound_speed < 1e-3 * s->length)
        return 0.0;
    return rest / ceil(rest / dt - 1e-9);
}

static void kick(sph *s, double dt)
{
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < s->options.dimension; c++)
            s->state[i].velocity[c] += dt * s->acceleration[i][c];
}

static void drift(sph *s, double dt)
{
    for (size_t i = 0; i < s->fluid; i++)
        for (int c = 0; c < s->options.dimension; c++)
            s->state[i].position[c] += dt * s->state[i].velocity[c];
}

/* Moves particles from crowded to thin places (Sun et al. 2017, eq. 6), at most 0.05 spacings. */
static void shift(sph *s, double dt)
{
    const double most = 0.05 * s->options.spacing;
    const double factor =
        s->options.shifting * dt * 4.0 * s->length *
        fastest(s, (const double(*)[3])s->state->velocity, sizeof(sph_particle) / sizeof(double));
    for (size_t i = 0; factor > 0.0 && i < s->fluid; i++) {
        double square = 0.0;
        for (int c = 0; c < s->options.dimension; c++)
            square += s->shift[i][c] * s->shift[i][c];
        const double length = factor * sqrt(square);
        const double scale = length > most ? factor * most / length : factor;
        for (int c = 0; c < s->options.dimension; c++)
            s->state[i].position[c] -= scale * s->shift[i][c];
    }
}

static ascc_status step(sph *s, double dt)
{
    kick(s, 0.5 * dt);
    drift(s, 0.5 * dt);
    const ascc_status status = refresh(s);
    if (status != ASCC_OK)
        return status;
    near_run(s->lists, s->fluid, continuity, s);
    for (size_t i = 0; i < s->fluid; i++)
        s->state[i].density += dt * s->rate[i];
    drift(s, 0.5 * dt);
    shift(s, dt);
    const ascc_status evaluated = evaluate(s);
    kick(s, 0.5 * dt);
    s->totals.steps++;
    s->totals.time += dt;
    return evaluated;
}

ascc_status sph_advance(sph *s, double dt)
{
    ascc_status status = s->ready || s->fluid == 0 ? ASCC_OK : evaluate(s);
    for (double rest = dt; status == ASCC_OK && s->fluid && rest > 1e-9 * dt;) {
        const double length = step_length(s, rest);
        if (!(length > 0.0))
            return ascc_fail(&s->message, ASCC_ERROR_NOT_FINITE, "a velocity is not finite at %g s",
                             s->totals.time);
        status = step(s, length);
        rest -= length;
    }
    s->totals.rebuilds = s->lists->rebuilds;
    return status;
}

const sph_particle *sph_particles(const sph *s, size_t *fluid_count, size_t *wall_count)
{
    if (fluid_count)
        *fluid_count = s->fluid;
    if (wall_count)
        *wall_count = s->walls;
    return s->state;
}

double sph_mass(const sph *s)
{
    return s->mass;
}

sph_totals sph_get_totals(const sph *s)
{
    return s->totals;
}

const char *sph_message(const sph *s)
{
    return s->message.text;
}
