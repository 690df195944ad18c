/* Position based fluids (Macklin and Mueller 2013). SPDX-License-Identifier: MIT
 *
 * Lengths inside are in units of the support radius h = 2 spacings, and densities in units of what
 * an unbounded lattice has, so that one relaxation serves every size:
 *     v += dt g, x* = x + dt v, neighbours
 *     repeat: lambda_i = -C_i / (sum_k |grad_k C_i|^2 + epsilon), C_i = max(rho_i - 1, 0)
 *             x*_i += sum_j (lambda_i + lambda_j + s_corr) grad W
 *     v = (x* - x) / dt, then XSPH viscosity
 */
#include "pbf.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "near.h"

#define SUPPORT 2.0 /* spacings */
#define CONTACT 0.3 /* supports; nearer than that a wall point pushes a particle away at once */

struct pbf {
    pbf_options options;
    near_lists *lists;
    size_t fluid, walls, capacity;
    double (*x)[3];                       /* [fluid | walls] predicted positions, m */
    double (*start)[3], (*v)[3];          /* [fluid] */
    double (*change)[3];                  /* [fluid] of positions, or of velocities */
    double *lambda, *density;             /* [fluid] */
    double radius, inverse, poly6, spiky; /* m, 1/m, normalisations of W and of its slope */
    double tension_weight;                /* W at the distance of eq. 13 */
    ascc_message message;
};

/* W and its slope with distance, without normalisation; q in [0, 1). */
static inline double bump(double square)
{
    const double t = 1.0 - square;
    return t * t * t;
}

static inline double slope(double q)
{
    return -3.0 * (1.0 - q) * (1.0 - q);
}

/* Normalisations by sums over the lattice: density 1, and the slope of a density that is linear. */
static void normalise(pbf *p)
{
    double sum = 0.0, moment = 0.0;
    const int d = p->options.dimension;
    for (int z = d == 3 ? -2 : 0; z <= (d == 3 ? 2 : 0); z++)
        for (int y = -2; y <= 2; y++)
            for (int x = -2; x <= 2; x++) {
                const double square = (x * x + y * y + z * z) / (SUPPORT * SUPPORT);
                if (square >= 1.0)
                    continue;
                sum += bump(square);
                if (square > 0.0)
                    moment -= slope(sqrt(square)) * sqrt(square) / d;
            }
    p->poly6 = 1.0 / sum;
    p->spiky = 1.0 / moment;
}

pbf *pbf_create(const pbf_options *options)
{
    if ((options->dimension != 2 && options->dimension != 3) || !(options->spacing > 0.0))
        return NULL;
    pbf *p = calloc(1, sizeof *p);
    if (!p)
        return NULL;
    p->options = *options;
    pbf_options *o = &p->options;
    o->iterations = o->iterations > 0 ? o->iterations : 4;
    o->substeps = o->substeps > 0 ? o->substeps : 1;
    o->relaxation = o->relaxation > 0.0 ? o->relaxation : 0.05;
    o->viscosity = o->viscosity == 0.0 ? 0.01 : fmax(0.0, o->viscosity);
    p->radius = SUPPORT * o->spacing;
    p->inverse = 1.0 / p->radius;
    normalise(p);
    p->tension_weight = bump(0.04);
    const near_options near = {.dimension = o->dimension,
                               .thread_count = o->thread_count,
                               .radius = p->radius,
                               .skin = 0.5 * o->spacing};
    p->lists = near_create(&near);
    if (!p->lists)
        pbf_destroy(&p);
    return p;
}

void pbf_destroy(pbf **solver)
{
    pbf *p = *solver;
    if (!p)
        return;
    near_destroy(&p->lists);
    free(p->x);
    free(p->start);
    free(p->v);
    free(p->change);
    free(p->lambda);
    free(p->density);
    free(p);
    *solver = NULL;
}

static bool grow(void **array, size_t count, size_t element)
{
    void *grown = realloc(*array, count * element);
    if (grown)
        *array = grown;
    return grown != NULL;
}

static ascc_status reserve(pbf *p, size_t count)
{
    if (count <= p->capacity)
        return ASCC_OK;
    if (!grow((void **)&p->x, count, sizeof *p->x) ||
        !grow((void **)&p->start, count, sizeof *p->start) ||
        !grow((void **)&p->v, count, sizeof *p->v) ||
        !grow((void **)&p->change, count, sizeof *p->change) ||
        !grow((void **)&p->lambda, count, sizeof *p->lambda) ||
        !grow((void **)&p->density, count, sizeof *p->density))
        return ascc_fail(&p->message, ASCC_ERROR_MEMORY, "no memory for %zu particles", count);
    p->capacity = count;
    return ASCC_OK;
}

static void place(double (*to)[3], size_t count, int32_t d, const double *from)
{
    if (count)
        memset(to, 0, count * sizeof *to);
    for (size_t i = 0; from && i < count; i++)
        memcpy(to[i], from + i * (size_t)d, (size_t)d * sizeof(double));
}

ascc_status pbf_set_fluid(pbf *p, size_t count, const double *position, const double *velocity)
{
    const ascc_status status = reserve(p, count + p->walls);
    if (status != ASCC_OK)
        return status;
    if (p->walls)
        memmove(p->x + count, p->x + p->fluid, p->walls * sizeof *p->x);
    p->fluid = count;
    place(p->x, count, p->options.dimension, position);
    place(p->v, count, p->options.dimension, velocity);
    near_forget(p->lists);
    return ASCC_OK;
}

ascc_status pbf_set_walls(pbf *p, size_t count, const double *position)
{
    const ascc_status status = reserve(p, p->fluid + count);
    if (status != ASCC_OK)
        return status;
    p->walls = count;
    place(p->x + p->fluid, count, p->options.dimension, position);
    near_forget(p->lists);
    return ASCC_OK;
}

/* ---- Sweeps ---- */

/* Displacement x_i - x_j in supports and its square; false beyond the support or when coincident. */
static inline bool look(const pbf *p, size_t i, size_t j, double r[3], double *square)
{
    *square = 0.0;
    for (int c = 0; c < 3; c++) {
        r[c] = (p->x[i][c] - p->x[j][c]) * p->inverse;
        *square += r[c] * r[c];
    }
    return *square < 1.0 && *square > 0.0;
}

static void find_lambda(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pbf *p = data;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *index = p->lists->index + p->lists->start[i];
        double density = p->poly6, own[3] = {0}, others = 0.0;
        for (uint32_t k = 0; k < p->lists->count[i]; k++) {
            double r[3], square;
            if (!look(p, i, index[k], r, &square))
                continue;
            density += p->poly6 * bump(square);
            const double q = sqrt(square), steep = p->spiky * slope(q);
            for (int c = 0; c < 3; c++)
                own[c] += steep / q * r[c];
            if (index[k] < p->fluid) /* walls do not move */
                others += steep * steep;
        }
        const double sum = own[0] * own[0] + own[1] * own[1] + own[2] * own[2] + others;
        p->density[i] = density;
        p->lambda[i] = -fmax(density - 1.0, 0.0) / (sum + p->options.relaxation);
    }
}

static void find_change(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pbf *p = data;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *index = p->lists->index + p->lists->start[i];
        double change[3] = {0};
        for (uint32_t k = 0; k < p->lists->count[i]; k++) {
            double r[3], square;
            if (!look(p, i, index[k], r, &square))
                continue;
            const double q = sqrt(square);
            double both = p->lambda[i] + (index[k] < p->fluid ? p->lambda[index[k]] : 0.0);
            if (p->options.tension > 0.0) {
                const double ratio = bump(square) / p->tension_weight;
                both -= p->options.tension * ratio * ratio * ratio * ratio;
            }
            double push = both * p->spiky * slope(q) / q;
            if (index[k] >= p->fluid && q < CONTACT)
                push += 0.5 * (CONTACT - q) / q;
            for (int c = 0; c < 3; c++)
                change[c] += push * r[c];
        }
        memcpy(p->change[i], change, sizeof change);
    }
}

/* XSPH: velocities towards the neighbours' mean, opposite within each pair. */
static void find_drag(void *data, size_t begin, size_t end, int32_t slot)
{
    (void)slot;
    pbf *p = data;
    for (size_t i = begin; i < end; i++) {
        const uint32_t *index = p->lists->index + p->lists->start[i];
        double change[3] = {0};
        for (uint32_t k = 0; k < p->lists->count[i]; k++) {
            double r[3], square;
            if (index[k] >= p->fluid || !look(p, i, index[k], r, &square))
                continue;
            for (int c = 0; c < 3; c++)
                change[c] += p->poly6 * bump(square) * (p->v[index[k]][c] - p->v[i][c]);
        }
        memcpy(p->change[i], change, sizeof change);
    }
}

/* ---- Steps ---- */

static ascc_status refresh(pbf *p)
{
    if (near_current(p->lists, p->fluid, p->x[0], 3))
        return ASCC_OK;
    const ascc_status status = near_update(p->lists, p->fluid, p->walls, p->x[0], 3);
    return status == ASCC_OK ? ASCC_OK
                             : ascc_fail(&p->message, status, "%s", p->lists->message.text);
}

static ascc_status step(pbf *p, double dt)
{
    memcpy(p->start, p->x, p->fluid * sizeof *p->x);
    for (size_t i = 0; i < p->fluid; i++)
        for (int c = 0; c < p->options.dimension; c++) {
            p->v[i][c] += dt * p->options.gravity[c];
            p->x[i][c] += dt * p->v[i][c];
        }
    for (int32_t k = 0; k < p->options.iterations; k++) {
        const ascc_status status = refresh(p);
        if (status != ASCC_OK)
            return status;
        near_run(p->lists, p->fluid, find_lambda, p);
        near_run(p->lists, p->fluid, find_change, p);
        for (size_t i = 0; i < p->fluid; i++)
            for (int c = 0; c < p->options.dimension; c++)
                p->x[i][c] += p->radius * p->change[i][c];
    }
    for (size_t i = 0; i < p->fluid; i++)
        for (int c = 0; c < 3; c++)
            p->v[i][c] = (p->x[i][c] - p->start[i][c]) / dt;
    const ascc_status status = refresh(p);
    if (status != ASCC_OK || !(p->options.viscosity > 0.0))
        return status;
    near_run(p->lists, p->fluid, find_drag, p);
    for (size_t i = 0; i < p->fluid; i++)
        for (int c = 0; c < 3; c++)
            p->v[i][c] += p->options.viscosity * p->change[i][c];
    return ASCC_OK;
}

ascc_status pbf_advance(pbf *p, double dt)
{
    ascc_status status = ASCC_OK;
    for (int32_t k = 0; k < p->options.substeps && p->fluid && status == ASCC_OK; k++)
        status = step(p, dt / p->options.substeps);
    return status;
}

ascc_status pbf_density_error(pbf *p, double *mean)
{
    *mean = 0.0;
    const ascc_status status = p->fluid ? refresh(p) : ASCC_OK;
    if (status != ASCC_OK || p->fluid == 0)
        return status;
    near_run(p->lists, p->fluid, find_lambda, p);
    for (size_t i = 0; i < p->fluid; i++)
        *mean += fmax(p->density[i] - 1.0, 0.0) / (double)p->fluid;
    return ASCC_OK;
}

const double (*pbf_positions(const pbf *p))[3]
{
    return (const double(*)[3])p->x;
}

const double (*pbf_velocities(const pbf *p))[3]
{
    return (const double(*)[3])p->v;
}

const char *pbf_message(const pbf *p)
{
    return p->message.text;
}
