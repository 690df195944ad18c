# SPDX-License-Identifier: MIT
"""The protocol-buffer wire format, as far as TFRecord examples and tensor bundles need it.

A message is a run of fields: a varint key (number << 3 | type), then by type 0 a varint, 1 eight
bytes, 2 a length and that many bytes, 5 four bytes.
"""


class WireError(ValueError):
    """Bytes that are no message."""


def varint(data, at):
    """(value, next index) of the varint at data[at]."""
    value = shift = 0
    while shift < 70:
        if at >= len(data):
            raise WireError("ends inside a number")
        byte = data[at]
        at += 1
        value |= (byte & 0x7F) << shift
        if byte < 0x80:
            return value & 0xFFFFFFFFFFFFFFFF, at
        shift += 7
    raise WireError("number of more than ten bytes")


def fields(data):
    """Yields (number, type, value) of each field; values of types 1, 2 and 5 are memoryviews."""
    data = memoryview(data)
    at = 0
    while at < len(data):
        key, at = varint(data, at)
        number, kind = key >> 3, key & 7
        if number == 0:
            raise WireError("field number 0")
        if kind == 0:
            value, at = varint(data, at)
        elif kind in (1, 2, 5):
            size = 8 if kind == 1 else 4
            if kind == 2:
                size, at = varint(data, at)
            if size > len(data) - at:
                raise WireError(f"field {number} wants {size} bytes, {len(data) - at} are left")
            value, at = data[at : at + size], at + size
        else:
            raise WireError(f"field {number} has type {kind}")
        yield number, kind, value


def messages(data, number):
    """The length-delimited values of one field, in order."""
    return [value for n, kind, value in fields(data) if n == number and kind == 2]


def integers(data):
    """{number: value} of the varint fields; the last one counts."""
    return {number: value for number, kind, value in fields(data) if kind == 0}


def texts(data):
    """{number: text} of the length-delimited fields that are UTF-8; the last one counts."""
    found = {number: bytes(value) for number, kind, value in fields(data) if kind == 2}
    return {number: value.decode("utf-8", "replace") for number, value in found.items()}


def signed(value):
    """A varint read as int64."""
    return value - (1 << 64) if value >> 63 else value
