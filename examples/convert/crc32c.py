# SPDX-License-Identifier: MIT
"""CRC-32C (Castagnoli), and its masked form in TFRecord and tensor-bundle files.

The bytewise loop is too slow in Python for files of gigabytes, so long data is cut into lanes of
equal length whose registers numpy advances together. The register is linear in its start value:

    register(start, A + B) = advance(register(start, A), len B) ^ register(0, B)

and advance by one lane length is four look-ups in tables made once.
"""

import functools

import numpy as np

POLYNOMIAL = 0x82F63B78  # reversed bits
LANE = 2048


def _byte_table():
    table = np.arange(256, dtype=np.uint32)
    for _ in range(8):
        table = np.where(table & 1, (table >> 1) ^ np.uint32(POLYNOMIAL), table >> 1)
    return table.astype(np.uint32)


_TABLE = _byte_table()
_TABLE_LIST = _TABLE.tolist()


@functools.lru_cache(maxsize=None)
def _lane_tables():
    """Four tables of 256: what each byte of a register becomes after LANE zero bytes."""
    register = np.zeros((4, 256), np.uint32)
    for byte in range(4):
        register[byte] = np.arange(256, dtype=np.uint32) << np.uint32(8 * byte)
    for _ in range(LANE):
        register = _TABLE[register & 0xFF] ^ (register >> 8)
    return register.tolist()


def crc32c(data):
    """CRC-32C of a bytes-like object."""
    bytes_ = np.frombuffer(data, np.uint8)
    register = 0xFFFFFFFF
    lanes = len(bytes_) // LANE
    if lanes:
        columns = np.ascontiguousarray(bytes_[: lanes * LANE].reshape(lanes, LANE).T)
        registers = np.zeros(lanes, np.uint32)
        for column in columns:
            registers = _TABLE[(registers ^ column) & 0xFF] ^ (registers >> 8)
        a, b, c, d = _lane_tables()
        for lane in registers.tolist():
            register = lane ^ (
                a[register & 255]
                ^ b[register >> 8 & 255]
                ^ c[register >> 16 & 255]
                ^ d[register >> 24]
            )
    for byte in bytes_[lanes * LANE :].tolist():
        register = _TABLE_LIST[(register ^ byte) & 0xFF] ^ (register >> 8)
    return register ^ 0xFFFFFFFF


def mask(crc):
    """The form stored in files that themselves hold CRCs: rotated right by 15, plus a constant."""
    return ((crc >> 15 | crc << 17) + 0xA282EAD8) & 0xFFFFFFFF


def masked_crc32c(data):
    return mask(crc32c(data))
