"""view_screen.py SCREEN.xwd PICTURE.png: where on the screen (Xvfb's file) the picture is seen, each pixel.

SPDX-License-Identifier: MIT
"""

import struct
import sys
import zlib


def read_png(path):
    """Rows of 8-bit RGB."""
    data = open(path, "rb").read()
    at, packed, width = 8, b"", 0
    while at < len(data):
        length, kind = struct.unpack(">I4s", data[at : at + 8])
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 2)
        packed += body if kind == b"IDAT" else b""
        at += length + 12
    raw = zlib.decompress(packed)
    rows, before, size = [], bytearray(3 * width), 3 * width
    for y in range(height):
        kind, line = raw[y * (size + 1)], bytearray(raw[y * (size + 1) + 1 : (y + 1) * (size + 1)])
        for i in range(size):
            left, up = line[i - 3] if i > 2 else 0, before[i]
            corner = before[i - 3] if i > 2 else 0
            if kind == 4:
                guess = left + up - corner
                near = min((abs(guess - left), 0, left), (abs(guess - up), 1, up), (abs(guess - corner), 2, corner))
                line[i] = (line[i] + near[2]) & 255
            elif kind:
                line[i] = (line[i] + (left, up, (left + up) // 2)[kind - 1]) & 255
        rows.append(bytes(line))
        before = line
    return rows


def read_screen(path):
    """Rows of 8-bit RGB."""
    data = open(path, "rb").read()
    head = struct.unpack(">25I", data[:100])
    width, height, stride, colours = head[4], head[5], head[12], head[19]
    assert head[11] == 32  # bits a pixel
    first, rows = head[0] + 12 * colours, []
    for y in range(height):
        row = data[first + y * stride : first + y * stride + 4 * width]
        if head[7]:  # most significant byte first: x, red, green, blue
            red, green, blue = row[1::4], row[2::4], row[3::4]
        else:
            red, green, blue = row[2::4], row[1::4], row[0::4]
        rgb = bytearray(3 * width)
        rgb[0::3], rgb[1::3], rgb[2::3] = red, green, blue
        rows.append(bytes(rgb))
    return rows


screen, picture = read_screen(sys.argv[1]), read_png(sys.argv[2])
assert len(set(picture)) > 100, "a picture of nothing"
for top in range(len(screen) - len(picture) + 1):
    left = screen[top].find(picture[0])
    if left >= 0 and all(screen[top + y][left : left + len(row)] == row for y, row in enumerate(picture)):
        print("seen at", left // 3, top)
        sys.exit(0)
sys.exit("the picture is not on the screen")
