/* A model for when no trained network is at hand: a demonstration, not trained.
 * SPDX-License-Identifier: MIT
 *
 * The repulsion f(r) = STIFFNESS (1 - r / spacing), in spacings per step, is stored divided by the
 * window that the layer multiplies with, on a grid of the cube around the ball of 2 spacings:
 *
 *      kernel(p) = -p/|p| f(2 |p| spacing) / (2 (1 - |p|)^2)       p in [-1, 1]^d, |p| < 1/2
 *
 * The 2 is f_i + f_j of a feature that is always 1. Opposite grid points get exactly opposite values.
 */
#include "demo_model.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CELLS 16       /* along each axis; even, so that no grid point is the centre */
#define STIFFNESS 0.18 /* below 4/3 over the sum of a lattice's neighbours, or it would ring */
#define REACH 2.0      /* spacings */
#define STEP 0.035     /* time step in units of sqrt(spacing / g) */
#define GRAVITY 9.81   /* m/s^2, down along y */

/* A number as JSON wants it, whatever the host's locale. */
static const char *number(char text[32], double value)
{
    char raw[32];
    size_t used = 0;
    snprintf(raw, sizeof raw, "%.9g", value);
    for (const char *c = raw; *c != '\0'; c++) {
        const int plain = (*c >= '0' && *c <= '9') || *c == '-' || *c == '+' || *c == 'e';
        if (plain)
            text[used++] = *c;
        else if (used > 0 && text[used - 1] != '.')
            text[used++] = '.';
    }
    text[used] = '\0';
    return text;
}

/* The network as text, with the quotes escaped that a text within JSON needs. */
static int write_network(char *text, size_t capacity, int dimension, double spacing)
{
    char h[32], reach[32], dt[32], g[32];
    number(h, spacing);
    number(reach, REACH * spacing);
    number(dt, STEP * sqrt(spacing / GRAVITY));
    number(g, -GRAVITY);
    return snprintf(
        text, capacity,
        "{\\\"name\\\":\\\"repulsion-%dd\\\","
        "\\\"description\\\":\\\"demonstration, not trained: particles push each other apart\\\","
        "\\\"dimension\\\":%d,\\\"time_step\\\":%s,\\\"gravity\\\":[0,%s%s],"
        "\\\"particle_spacing\\\":%s,\\\"rest_density\\\":1000,\\\"evaluate\\\":\\\"advected\\\","
        "\\\"features\\\":{\\\"fluid\\\":[\\\"one\\\"],\\\"boundary\\\":[\\\"one\\\"]},"
        "\\\"layers\\\":[{\\\"name\\\":\\\"ones\\\",\\\"points\\\":\\\"all\\\",\\\"channels\\\":1,"
        "\\\"terms\\\":[{\\\"type\\\":\\\"identity\\\",\\\"source\\\":\\\"fluid\\\"},"
        "{\\\"type\\\":\\\"identity\\\",\\\"source\\\":\\\"boundary\\\"}]}],"
        "\\\"output\\\":{\\\"type\\\":\\\"antisymmetric\\\",\\\"source\\\":\\\"ones\\\","
        "\\\"kernel\\\":\\\"repulsion\\\",\\\"stored\\\":\\\"full\\\",\\\"cells\\\":[%d,%d,%d],"
        "\\\"radius\\\":%s,"
        "\\\"window\\\":\\\"peak\\\",\\\"mapping\\\":\\\"identity\\\","
        "\\\"projection\\\":\\\"radial\\\",\\\"scale\\\":%s}}",
        dimension, dimension, dt, g, dimension == 3 ? ",0" : "", h, CELLS, CELLS,
        dimension == 3 ? CELLS : 1, reach, h);
}

/* Component `axis` of the kernel at grid coordinates n, odd integers within +-(CELLS - 1). */
static float kernel(const int n[3], int axis)
{
    const double length = sqrt((double)(n[0] * n[0] + n[1] * n[1] + n[2] * n[2])) / (CELLS - 1);
    const double distance = REACH * length; /* spacings */
    if (distance >= 1.0)
        return 0.0f;
    const double push = STIFFNESS * (1.0 - distance) / (2.0 * (1.0 - length) * (1.0 - length));
    return (float)(-push * n[axis] / (CELLS - 1) / length);
}

static void put32(unsigned char *bytes, float value)
{
    unsigned int bits;
    memcpy(&bits, &value, sizeof bits);
    for (int i = 0; i < 4; i++)
        bytes[i] = (unsigned char)(bits >> 8 * i);
}

static void write_kernel(unsigned char *bytes, int dimension)
{
    const int depth = dimension == 3 ? CELLS : 1;
    for (int z = 0; z < depth; z++)
        for (int y = 0; y < CELLS; y++)
            for (int x = 0; x < CELLS; x++)
                for (int axis = 0; axis < dimension; axis++, bytes += 4) {
                    const int n[3] = {2 * x - CELLS + 1, 2 * y - CELLS + 1,
                                      dimension == 3 ? 2 * z - CELLS + 1 : 0};
                    put32(bytes, kernel(n, axis));
                }
}

unsigned char *demo_model_bytes(int dimension, double spacing, size_t *size)
{
    char network[2048], header[4096];
    if ((dimension != 2 && dimension != 3) || !(spacing > 1e-9 && spacing < 1e9) || !size)
        return NULL;
    const int depth = dimension == 3 ? CELLS : 1;
    const size_t data = (size_t)(depth * CELLS * CELLS * dimension) * 4;
    write_network(network, sizeof network, dimension, spacing);
    int length = snprintf(header, sizeof header,
                          "{\"__metadata__\":{\"format\":\"ascc.model\",\"version\":\"1\","
                          "\"network\":\"%s\"},\"repulsion\":{\"dtype\":\"F32\","
                          "\"shape\":[%d,%d,%d,1,%d],\"data_offsets\":[0,%zu]}}",
                          network, depth, CELLS, CELLS, dimension, data);
    while (length % 8 != 0)
        header[length++] = ' ';
    unsigned char *bytes = calloc(8 + (size_t)length + data, 1);
    if (!bytes)
        return NULL;
    for (int i = 0; i < 8; i++)
        bytes[i] = (unsigned char)((unsigned long long)length >> 8 * i);
    memcpy(bytes + 8, header, (size_t)length);
    write_kernel(bytes + 8 + length, dimension);
    *size = 8 + (size_t)length + data;
    return bytes;
}
