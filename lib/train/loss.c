/* The loss of one predicted state (Eq. 3) and the penalties of docs/training.md.
 * SPDX-License-Identifier: MIT */
#include <math.h>
#include <string.h>

#include "points/search.h"
#include "rollout.h"

static double distance_loss(const ascc_rollout_task *task, const ascc_plan *plan, const double *x,
                            const double *truth, size_t frame, double share, double *gradient)
{
    const ascc_kept_sequence *s = task->sequence;
    const size_t d = (size_t)s->dimension, n = s->fluid_count;
    const uint16_t *near = s->near + frame * n;
    double sum = 0.0, weights = 0.0, mean = 0.0;
    for (size_t i = 0; i < n; i++)
        mean += near[i];
    mean = fmax(mean / (double)n, 1e-9);
    for (size_t i = 0; i < n; i++)
        weights += exp(-task->neighbor_weight * near[i] / mean);
    for (size_t i = 0; i < n; i++) {
        const double w = exp(-task->neighbor_weight * near[i] / mean) / weights / plan->spacing;
        double square = 0.0;
        for (size_t c = 0; c < d; c++)
            square += (x[i * d + c] - truth[i * d + c]) * (x[i * d + c] - truth[i * d + c]);
        const double distance = sqrt(square);
        sum += w * distance;
        for (size_t c = 0; gradient && distance > 0.0 && c < d; c++)
            gradient[i * d + c] += share * w * (x[i * d + c] - truth[i * d + c]) / distance;
    }
    return sum;
}

static ascc_status density_loss(const ascc_rollout_task *task, const ascc_plan *plan,
                                const ascc_search_tools *tools, const double *x, double share,
                                double *loss, double *gradient)
{
    const ascc_kept_sequence *s = task->sequence;
    const size_t d = (size_t)s->dimension, n = s->fluid_count;
    const double radius = 2.0 * plan->spacing, factor = task->density_weight / (double)n;
    ascc_search near;
    const ascc_search_options within = {
        .dimension = s->dimension, .radius = radius, .query = {x, n, "fluid row"}};
    const ascc_status status = ascc_search_run(&near, tools, &within);
    for (size_t i = 0; status == ASCC_OK && i < n; i++) {
        const uint32_t *neighbor = near.rows.neighbor + near.rows.start[i];
        double rho = 0.0, e[3], square;
        for (uint32_t k = 0; k < near.rows.count[i]; k++) {
            square = ascc_search_separation(&near, i, neighbor[k], e);
            const double t = fmax(1.0 - square, 0.0);
            rho += t * t * t;
        }
        const double excess = rho / s->dense - 1.0;
        if (excess <= 0.0)
            continue;
        *loss += factor * excess * excess;
        const double by_rho = share * factor * 2.0 * excess / s->dense;
        for (uint32_t k = 0; gradient && k < near.rows.count[i]; k++) {
            square = ascc_search_separation(&near, i, neighbor[k], e);
            const double t = fmax(1.0 - square, 0.0), by = by_rho * -6.0 * t * t / radius;
            for (size_t c = 0; c < d; c++) {
                gradient[neighbor[k] * d + c] += by * e[c];
                gradient[i * d + c] -= by * e[c];
            }
        }
    }
    return status;
}

static ascc_status wall_loss(const ascc_rollout_task *task, const ascc_plan *plan,
                             const ascc_search_tools *tools, const double *x, const double *wall,
                             const double *normal, double share, double *loss, double *gradient)
{
    const ascc_kept_sequence *s = task->sequence;
    const size_t d = (size_t)s->dimension, n = s->fluid_count;
    const double factor = task->wall_weight / (double)n, h = plan->spacing;
    ascc_search near;
    const ascc_search_options within = {.dimension = s->dimension,
                                        .radius = 4.0 * h,
                                        .query = {x, n, "fluid row"},
                                        .source = {wall, s->boundary_count, "boundary row"}};
    const ascc_status status = ascc_search_run(&near, tools, &within);
    for (size_t i = 0; status == ASCC_OK && i < n; i++) {
        const uint32_t *neighbor = near.rows.neighbor + near.rows.start[i];
        double nearest = INFINITY, e[3], square, depth = 0.0;
        size_t at = 0;
        for (uint32_t k = 0; k < near.rows.count[i]; k++) {
            square = ascc_search_separation(&near, i, neighbor[k], e);
            if (square < nearest) {
                nearest = square;
                at = neighbor[k];
            }
        }
        if (!isfinite(nearest))
            continue;
        for (size_t c = 0; c < d; c++)
            depth += (x[i * d + c] - wall[at * d + c]) * normal[at * d + c];
        const double inside = (s->wall_depth - depth) / h;
        if (inside <= 0.0)
            continue;
        *loss += factor * inside * inside;
        for (size_t c = 0; gradient && c < d; c++)
            gradient[i * d + c] -= share * factor * 2.0 * inside / h * normal[at * d + c];
    }
    return status;
}

double ascc_velocity_loss_of(const ascc_rollout_task *task, const ascc_plan *plan,
                             const double *way, const double *from, const double *to, double share,
                             double *gradient)
{
    const size_t d = (size_t)plan->dimension, n = task->sequence->fluid_count;
    const double factor = task->velocity_weight / ((double)n * plan->spacing);
    double sum = 0.0;
    for (size_t i = 0; i < n * d; i += d) {
        double e[3], square = 0.0;
        for (size_t c = 0; c < d; c++) {
            e[c] = way[i + c] - (to[i + c] - from[i + c]);
            square += e[c] * e[c];
        }
        const double length = sqrt(square);
        sum += factor * length;
        for (size_t c = 0; gradient && length > 0.0 && c < d; c++)
            gradient[i + c] += share * factor * e[c] / length;
    }
    return share * sum;
}

ascc_status ascc_loss_of(const ascc_rollout_task *task, const ascc_plan *plan,
                         const ascc_search_tools *tools, const double *position,
                         const double *truth, const double *wall, const double *normal,
                         size_t frame, double share, double *loss, double *gradient)
{
    ascc_status status = ASCC_OK;
    double sum = distance_loss(task, plan, position, truth, frame, share, gradient);
    ascc_arena_reset(tools->arena);
    if (task->density_weight > 0.0)
        status = density_loss(task, plan, tools, position, share, &sum, gradient);
    if (status == ASCC_OK && task->wall_weight > 0.0 && task->sequence->boundary_count)
        status = wall_loss(task, plan, tools, position, wall, normal, share, &sum, gradient);
    *loss += share * sum;
    return status;
}
