#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Published data sets and networks as libascc's own files; see README.md beside this file.

    convert.py data FORMAT INPUT... -o DIR       one sequence file per scene
    convert.py weights FORMAT INPUT -o FILE      one network, for `ascc convert`

Exit codes: 0 done, 2 wrong input or arguments; what was written before an error is whole.
"""

import argparse
import importlib
import itertools
import math
import os
import sys

from errors import ConvertError

DATA = {
    "dlf": ("read_dlf", "Liquid3d, WBC-SPH: msgpack + zstd shards (.msgpack.zst)"),
    "gns": ("read_gns", "Water-Ramps: .tfrecord beside metadata.json"),
    "lagrangebench": ("read_lagrangebench", "LagrangeBench: .h5 beside metadata.json"),
}
WEIGHTS = {
    "dmcf": "TensorFlow checkpoint of the DMCF Liquid3d network (its .index file)",
    "cconv-h5": "Keras .h5 of the CConv Liquid3d network",
    "cconv-pt": "PyTorch .pt of the CConv Liquid3d network",
}


def positive(text):
    value = float(text)
    if not (math.isfinite(value) and value > 0):
        raise argparse.ArgumentTypeError(f"{text} is not a positive number")
    return value


def count(text):
    value = int(text)
    if value < 0:
        raise argparse.ArgumentTypeError(f"{text} is negative")
    return value


def vector(text):
    values = tuple(float(part) for part in text.replace(",", " ").split())
    if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
        raise argparse.ArgumentTypeError(f"{text!r} is not two or three numbers")
    return values


def arguments(argv):
    parser = argparse.ArgumentParser(prog="convert.py", description=__doc__.split("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)

    data = commands.add_parser(
        "data", help="sequences", formatter_class=argparse.RawTextHelpFormatter
    )
    data.add_argument(
        "format",
        choices=DATA,
        help="\n".join(f"{name}: {about}" for name, (_, about) in DATA.items()),
    )
    data.add_argument("input", nargs="+", help="files, or folders of them")
    data.add_argument("-o", "--output", required=True, metavar="DIR")
    data.add_argument("--count", type=count, help="only the first COUNT sequences")
    data.add_argument("--spacing", type=positive, help="particle spacing, m")
    data.add_argument("--dt", type=positive, help="time between frames, s")
    data.add_argument("--gravity", type=vector, metavar='"X Y [Z]"', help="m/s^2")
    data.add_argument("--rest-density", type=positive, help="kg/m^3")
    data.add_argument(
        "--dim", type=int, choices=(2, 3), help="dlf: 2 drops z (as found by default)"
    )
    data.add_argument("--metadata", help="gns, lagrangebench: where metadata.json is")
    data.add_argument(
        "--fluid-type",
        type=count,
        action="append",
        help="gns: particle type read as fluid (5, water); may be repeated",
    )
    data.add_argument(
        "--wall-layers",
        type=count,
        default=3,
        help="gns: layers of wall particles around the box (3; 0 = none)",
    )
    data.add_argument(
        "--moving-walls-at-rest",
        action="store_true",
        help="lagrangebench: convert moving walls as if they stood still",
    )
    data.add_argument("--source", help="text for the files' metadata")

    weights = commands.add_parser(
        "weights", help="networks", formatter_class=argparse.RawTextHelpFormatter
    )
    weights.add_argument(
        "format",
        choices=WEIGHTS,
        help="\n".join(f"{name}: {about}" for name, about in WEIGHTS.items()),
    )
    weights.add_argument("input")
    weights.add_argument("-o", "--output", required=True, metavar="FILE")
    return parser.parse_args(argv)


def files(inputs, suffix):
    """The named files, and those with the suffix in the named folders."""
    found = []
    for path in inputs:
        if os.path.isdir(path):
            names = sorted(name for name in os.listdir(path) if name.endswith(suffix))
            if not names:
                raise ConvertError(path, "", f"no {suffix} files in this folder")
            found += [os.path.join(path, name) for name in names]
        else:
            found.append(path)
    return found


def convert_data(options):
    reader = importlib.import_module(DATA[options.format][0])
    sequence = importlib.import_module("sequence")
    os.makedirs(options.output, exist_ok=True)
    written = set()
    sequences = reader.read(files(options.input, reader.SUFFIX), options)
    for item in itertools.islice(sequences, options.count):
        if item.name in written:
            raise ConvertError(
                item.origin,
                "name",
                f"{item.name} was already written from another input; "
                "convert them into different folders",
            )
        sequence.write(item, options.output)
        written.add(item.name)


def main(argv=None):
    options = arguments(argv)
    try:
        if options.command == "data":
            convert_data(options)
        else:
            importlib.import_module("weights").convert(
                options.format, options.input, options.output
            )
    except ConvertError as error:
        print(f"convert: error: {error}", file=sys.stderr)
        return 2
    except ModuleNotFoundError as error:
        print(
            f"convert: error: Python module {error.name} is missing; see requirements.txt",
            file=sys.stderr,
        )
        return 2
    except OSError as error:
        print(f"convert: error: {error.filename or ''}: {error.strerror or error}", file=sys.stderr)
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
