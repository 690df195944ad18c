/* Words of 64 bits in bytes, little endian on every machine, and a sum that tells damage. SPDX-License-Identifier: MIT */
#ifndef ASCC_WORDS_H
#define ASCC_WORDS_H

#include <stddef.h>
#include <stdint.h>
#include <string.h>

static inline uint64_t ascc_bits_of(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static inline double ascc_double_of(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

static inline void ascc_put_word(unsigned char *into, uint64_t word)
{
    for (int i = 0; i < 8; i++)
        into[i] = (unsigned char)(word >> 8 * i);
}

static inline uint64_t ascc_get_word(const unsigned char *from)
{
    uint64_t word = 0;
    for (int i = 0; i < 8; i++)
        word |= (uint64_t)from[i] << 8 * i;
    return word;
}

/* Each step is a bijection of both the sum and the word, so no change of one word goes unseen. */
static inline uint64_t ascc_sum_words(uint64_t sum, const unsigned char *bytes, size_t words)
{
    for (size_t i = 0; i < words; i++) {
        sum = (sum ^ ascc_get_word(bytes + 8 * i)) * UINT64_C(0x9e3779b97f4a7c15);
        sum ^= sum >> 32;
    }
    return sum;
}

#endif
