/* Streams of random numbers, the same on every machine. SPDX-License-Identifier: MIT */
#include "random.h"

ascc_random ascc_random_open(uint64_t seed, uint64_t first, uint64_t second)
{
    ascc_random r = {seed * 0x9e3779b97f4a7c15u + first};
    (void)ascc_random_uniform(&r);
    r.state += second * 0xd1342543de82ef95u;
    (void)ascc_random_uniform(&r);
    return r;
}

/* splitmix64. */
double ascc_random_uniform(ascc_random *r)
{
    uint64_t z = r->state += 0x9e3779b97f4a7c15u;
    z = (z ^ z >> 30) * 0xbf58476d1ce4e5b9u;
    z = (z ^ z >> 27) * 0x94d049bb133111ebu;
    z ^= z >> 31;
    return (double)(z >> 11) * 0x1p-53;
}

/* The sum of twelve uniform numbers less six: near enough to normal, the same on every machine. */
double ascc_random_normal(ascc_random *r)
{
    double sum = -6.0;
    for (int i = 0; i < 12; i++)
        sum += ascc_random_uniform(r);
    return sum;
}
