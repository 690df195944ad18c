/* Numbers as binary files want them, whatever the machine's order. SPDX-License-Identifier: MIT */
#ifndef ASCC_LITTLE_ENDIAN_H
#define ASCC_LITTLE_ENDIAN_H

#include <stdint.h>
#include <string.h>

static inline void ascc_put_word(unsigned char *to, uint32_t word)
{
    for (int i = 0; i < 4; i++)
        to[i] = (unsigned char)(word >> 8 * i);
}

static inline void ascc_put_long(unsigned char *to, uint64_t word)
{
    for (int i = 0; i < 8; i++)
        to[i] = (unsigned char)(word >> 8 * i);
}

static inline void ascc_put_float(unsigned char *to, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    ascc_put_word(to, bits);
}

#endif
