/* Rigid bodies of points: how they move, and what a force does to them. SPDX-License-Identifier: MIT */
#include "rigid.h"

#include <math.h>
#include <string.h>

static void matrix_of(const double q[4], double m[3][3])
{
    const double w = q[0], x = q[1], y = q[2], z = q[3];
    const double rows[3][3] = {{1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)},
                               {2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)},
                               {2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)}};
    memcpy(m, rows, sizeof rows);
}

/* R diag(1 / inertia) R^T; an axis without inertia does not turn. */
static void turn_inertia(rigid *b)
{
    double axes[3][3];
    matrix_of(b->turn, axes);
    for (int r = 0; r < 3; r++)
        for (int c = 0; c < 3; c++) {
            double sum = 0.0;
            for (int k = 0; k < 3 && b->inverse_mass > 0.0; k++)
                sum += b->inertia[k] > 0.0 ? axes[r][k] * axes[c][k] / b->inertia[k] : 0.0;
            b->inverse_inertia[r][c] = sum;
        }
}

bool rigid_begin(rigid *b, int32_t dimension)
{
    const bool moves = b->kind == RIGID_FREE;
    if (dimension == 2)
        b->inertia[0] = b->inertia[1] = 0.0;
    if (moves && !(b->mass > 0.0 && b->inertia[2] > 0.0 &&
                   (dimension == 2 || (b->inertia[0] > 0.0 && b->inertia[1] > 0.0))))
        return false;
    if (b->kind == RIGID_STILL) {
        memset(b->velocity, 0, sizeof b->velocity);
        memset(b->spin, 0, sizeof b->spin);
    }
    const double straight[4] = {1.0, 0.0, 0.0, 0.0};
    memcpy(b->turn, straight, sizeof straight);
    memset(b->impulse, 0, sizeof b->impulse);
    memset(b->angular, 0, sizeof b->angular);
    b->inverse_mass = moves ? 1.0 / b->mass : 0.0;
    turn_inertia(b);
    return true;
}

void rigid_push(rigid *b, const double force[3], const double torque[3], double dt)
{
    for (int c = 0; c < 3; c++) {
        b->velocity[c] += dt * b->inverse_mass * force[c];
        for (int k = 0; k < 3; k++)
            b->spin[c] += dt * b->inverse_inertia[c][k] * torque[k];
    }
}

/* Spin of a free body that no torque acts on, in its own axes: Euler's equations, one explicit step. */
static void precess(rigid *b, double dt)
{
    double axes[3][3], own[3] = {0};
    matrix_of(b->turn, axes);
    for (int k = 0; k < 3; k++)
        for (int c = 0; c < 3; c++)
            own[k] += axes[c][k] * b->spin[c];
    const double *i = b->inertia;
    const double change[3] = {(i[1] - i[2]) * own[1] * own[2] / i[0],
                              (i[2] - i[0]) * own[2] * own[0] / i[1],
                              (i[0] - i[1]) * own[0] * own[1] / i[2]};
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 3; k++)
            b->spin[c] += dt * axes[c][k] * change[k];
}

void rigid_move(rigid *b, double dt)
{
    if (b->kind == RIGID_STILL)
        return;
    if (b->kind == RIGID_FREE && b->inertia[0] > 0.0)
        precess(b, dt);
    const double speed =
        sqrt(b->spin[0] * b->spin[0] + b->spin[1] * b->spin[1] + b->spin[2] * b->spin[2]);
    const double half = 0.5 * dt * speed, part = speed > 0.0 ? sin(half) / speed : 0.0;
    const double p[4] = {cos(half), part * b->spin[0], part * b->spin[1], part * b->spin[2]};
    const double q[4] = {b->turn[0], b->turn[1], b->turn[2], b->turn[3]};
    const double turned[4] = {p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3],
                              p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2],
                              p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1],
                              p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0]};
    double square = 0.0;
    for (int k = 0; k < 4; k++)
        square += turned[k] * turned[k];
    for (int k = 0; k < 4; k++)
        b->turn[k] = turned[k] / sqrt(square);
    for (int c = 0; c < 3; c++)
        b->center[c] += dt * b->velocity[c];
    turn_inertia(b);
}

void rigid_direction(const rigid *b, const double own[3], double direction[3])
{
    double axes[3][3];
    matrix_of(b->turn, axes);
    for (int c = 0; c < 3; c++)
        direction[c] = axes[c][0] * own[0] + axes[c][1] * own[1] + axes[c][2] * own[2];
}

void rigid_point(const rigid *b, const double own[3], double point[3])
{
    double axes[3][3];
    matrix_of(b->turn, axes);
    for (int c = 0; c < 3; c++)
        point[c] = b->center[c] + axes[c][0] * own[0] + axes[c][1] * own[1] + axes[c][2] * own[2];
}
